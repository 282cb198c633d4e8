//! The samples of a line and the sides of the limit that they are on.
//!
//! Positions are coordinates of the second axis, which are its values or their logarithms.
//! Distances are signed distances from the limit, of order one (a logarithm of a ratio).

use super::SearchRange;

/// Returns the coordinate of an axis's value.
pub(super) fn coordinate(value: f64, is_log: bool) -> f64 {
    if is_log { libm::log(value) } else { value }
}

impl SearchRange {
    /// Returns the range that is searched, in coordinates.
    pub(super) fn span(&self) -> Span {
        Span {
            least: coordinate(self.least, self.is_second_log),
            greatest: coordinate(self.greatest, self.is_second_log),
            tolerance: self.tolerance,
        }
    }

    /// Returns the value of the second axis at a position.
    pub(super) fn value(&self, position: f64) -> f64 {
        let span = self.span();
        // The ends of the range are returned exactly, without the rounding of the logarithm.
        if position <= span.least {
            self.least
        } else if position >= span.greatest {
            self.greatest
        } else if self.is_second_log {
            libm::exp(position)
        } else {
            position
        }
    }
}

/// The side of the limit that a sample is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LimitSide {
    Reliable,
    Unreliable,
    Undefined,
}

/// An evaluated position on a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LineSample {
    pub position: f64,
    pub distance: Option<f64>,
}

impl LineSample {
    pub(super) fn side(&self) -> LimitSide {
        match self.distance {
            Some(distance) if distance < 0.0 => LimitSide::Reliable,
            Some(_) => LimitSide::Unreliable,
            None => LimitSide::Undefined,
        }
    }

    pub(super) fn finite_distance(&self) -> Option<f64> {
        self.distance.filter(|distance| distance.is_finite())
    }
}

/// The range that is searched, in coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    pub least: f64,
    pub greatest: f64,
    /// The greatest width of a final bracket.
    pub tolerance: f64,
}

/// An interval of a line on which all samples are on one side. It ends where the side changes, or
/// at the range's end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SideInterval {
    pub from: f64,
    pub to: f64,
    pub side: LimitSide,
}

/// Returns the side of a line at a position; `None` before its first samples.
pub(super) fn side_at(intervals: &[SideInterval], position: f64) -> Option<LimitSide> {
    let interval_at =
        intervals.iter().find(|interval| interval.from <= position && position <= interval.to);
    interval_at.map(|interval| interval.side)
}

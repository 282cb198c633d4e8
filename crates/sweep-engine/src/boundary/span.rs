//! What is known along a row, and what one row tells another.
//!
//! Positions are coordinates of the second axis: its values, or their logarithms. Distances are
//! signed distances from the limit, of order one (a logarithm of a ratio).

/// Which side of the limit a sample is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Reliable,
    Unreliable,
    Undefined,
}

/// A value tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tried {
    pub at: f64,
    pub distance: Option<f64>,
}

impl Tried {
    pub(super) fn side(&self) -> Side {
        match self.distance {
            Some(distance) if distance < 0.0 => Side::Reliable,
            Some(_) => Side::Unreliable,
            None => Side::Undefined,
        }
    }

    /// Where it is and how far from the limit, if that can be calculated with.
    pub(super) fn finite(&self) -> Option<(f64, f64)> {
        Some((self.at, self.distance.filter(|distance| distance.is_finite())?))
    }
}

/// The range that is searched, as coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    pub least: f64,
    pub greatest: f64,
    pub tolerance: f64,
}

impl Span {
    pub(super) fn contains(&self, at: f64) -> bool {
        self.least <= at && at <= self.greatest
    }
}

/// A stretch of the range on one side, as far as is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SideRange {
    pub from: f64,
    pub to: f64,
    pub side: Side,
}

impl SideRange {
    pub(super) fn middle(&self) -> f64 {
        0.5 * (self.from + self.to)
    }

    pub(super) fn width(&self) -> f64 {
        self.to - self.from
    }
}

/// Where the side should change by what other rows say, and how far they may be mistaken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hint {
    pub root: f64,
    pub spread: f64,
}

/// What a row is asked because of other rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Question {
    /// To be tried.
    pub places: Vec<f64>,
    /// Where to cast nets at once, in order.
    pub roots: Vec<Hint>,
    /// Where to cast one if there is a bracket around it.
    pub perhaps: Vec<Hint>,
}

impl Question {
    /// One for these places alone.
    pub(super) fn places(places: Vec<f64>) -> Self {
        Self { places, ..Self::default() }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.places.is_empty() && self.roots.is_empty()
    }
}

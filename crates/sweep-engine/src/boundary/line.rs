//! The search along one line of the second axis: its samples, and the next positions to evaluate.
//!
//! Neighbouring samples on different sides are a bracket, narrowed by [`Itp`] until it is within
//! tolerance. A bracket over which the distance still changes much may contain a jump, and is
//! bisected further.

use super::continuation::PredictedSide;
use super::itp::Itp;
use super::sample::{LimitSide, LineSample, SideInterval, Span};
use super::{SideChange, SideChangeKind};

/// The change of the distance over a narrow bracket above which it contains a jump. Basis: ln 1.5,
/// a factor of 1.5 in a ratio, which changes a reader's decision. Doubling it reports jumps by a
/// factor of up to 2.25 as crossings.
const JUMP_LN_RATIO: f64 = 0.405;
/// The width, in tolerances, to which a bracket that may contain a jump is narrowed. Basis: a steep
/// crossing in it is then located to a sixteenth of the tolerance. Doubling it saves one trial per
/// jump.
const JUMP_BRACKET_WIDTH: f64 = 1.0 / 16.0;

/// The search along a line.
#[derive(Clone, Debug, Default)]
pub(super) struct LineSearch {
    /// The samples in order of position, no two at the same.
    samples: Vec<LineSample>,
    /// The requested positions that have not been taken yet.
    requested_positions: Vec<f64>,
    /// The open brackets with their root finders.
    open_brackets: Vec<([f64; 2], Itp)>,
}

impl LineSearch {
    /// Requests samples at these positions, clamped to the range, except where samples exist.
    pub(super) fn request_samples(
        &mut self,
        positions: impl IntoIterator<Item = f64>,
        span: &Span,
    ) {
        for requested in positions {
            let position = requested.clamp(span.least, span.greatest);
            if self.sample_at(position).is_none() {
                self.requested_positions.push(position);
            }
        }
        self.requested_positions.sort_by(f64::total_cmp);
        self.requested_positions.dedup();
    }

    /// Returns whether some requested positions have not been taken yet.
    pub(super) fn has_requests(&self) -> bool {
        !self.requested_positions.is_empty()
    }

    pub(super) fn insert_sample(&mut self, sample: LineSample) {
        let index = self.samples.partition_point(|other| other.position < sample.position);
        if self.samples.get(index).is_none_or(|other| other.position != sample.position) {
            self.samples.insert(index, sample);
        }
    }

    /// Returns the sample at exactly this position.
    pub(super) fn sample_at(&self, position: f64) -> Option<&LineSample> {
        let index =
            self.samples.binary_search_by(|sample| sample.position.total_cmp(&position)).ok()?;
        self.samples.get(index)
    }

    /// Returns whether the sample at this position is on the side that is predicted.
    pub(super) fn confirms(&self, predicted: &PredictedSide) -> bool {
        self.sample_at(predicted.position).is_some_and(|sample| sample.side() == predicted.side)
    }

    pub(super) fn samples(&self) -> &[LineSample] {
        &self.samples
    }

    /// Takes the positions to evaluate next: those requested, or else a step in every open bracket;
    /// none if every bracket is narrow.
    pub(super) fn take_positions(&mut self, span: &Span) -> Vec<f64> {
        if self.has_requests() {
            return std::mem::take(&mut self.requested_positions);
        }
        let earlier_brackets = std::mem::take(&mut self.open_brackets);
        let open_brackets: Vec<[LineSample; 2]> =
            self.sample_brackets().filter(|[low, high]| needs_narrowing(low, high, span)).collect();
        let mut positions = Vec::with_capacity(open_brackets.len());
        for [low, high] in open_brackets {
            let width = high.position - low.position;
            if width <= span.tolerance {
                positions.push(0.5 * (low.position + high.position));
                continue;
            }
            let enclosing_bracket = earlier_brackets
                .iter()
                .find(|(ends, _)| ends[0] <= low.position && high.position <= ends[1]);
            let mut itp = match enclosing_bracket {
                Some((_, itp)) => *itp,
                None => Itp::new(width, span.tolerance),
            };
            let distances = low.finite_distance().zip(high.finite_distance());
            positions.push(itp.next_position(
                low.position,
                high.position,
                distances.map(<[f64; 2]>::from),
            ));
            self.open_brackets.push(([low.position, high.position], itp));
        }
        positions
    }

    /// Returns the positions that divide an interval so that no gap between samples is wider than
    /// `widest`. If there are any, a position beyond either end is added, so that a side that
    /// appears in the interval has narrow brackets. No position is within half a tolerance of a
    /// sample.
    pub(super) fn subdividing_positions(
        &self,
        interval: [f64; 2],
        max_gap: f64,
        span: &Span,
    ) -> Vec<f64> {
        let [from, to] = interval;
        let sample_positions = self
            .samples
            .iter()
            .map(|sample| sample.position)
            .filter(|position| from < *position && *position < to);
        let interval_ends: Vec<f64> =
            [from].into_iter().chain(sample_positions).chain([to]).collect();
        let min_gap = 0.5 * span.tolerance;
        let is_far_from_samples = |position: &f64| {
            self.samples.iter().all(|sample| (sample.position - position).abs() >= min_gap)
        };
        let mut positions = Vec::new();
        for gap in interval_ends.windows(2) {
            let width = gap[1] - gap[0];
            // Rounding must not add a gap.
            let piece_count = libm::ceil(width / max_gap - 1e-6);
            let division_positions =
                (1..piece_count as usize).map(|k| gap[0] + width * (k as f64 / piece_count));
            positions.extend(division_positions.filter(is_far_from_samples));
        }
        if !positions.is_empty() {
            positions
                .extend([from - max_gap, to + max_gap].into_iter().filter(is_far_from_samples));
        }
        positions
    }

    /// Iterates over neighbouring samples on different sides.
    fn sample_brackets(&self) -> impl Iterator<Item = [LineSample; 2]> + '_ {
        let sample_pairs = self.samples.windows(2).map(|pair| [pair[0], pair[1]]);
        sample_pairs.filter(|[low, high]| low.side() != high.side())
    }

    /// Returns the intervals of one side in order; none before the first sample.
    pub(super) fn side_intervals(&self, span: &Span) -> Vec<SideInterval> {
        let mut intervals = Vec::new();
        let mut from = span.least;
        for [low, high] in self.sample_brackets() {
            let to = interpolate_root(&low, &high).unwrap_or(0.5 * (low.position + high.position));
            intervals.push(SideInterval { from, to, side: low.side() });
            from = to;
        }
        if let Some(last) = self.samples.last() {
            intervals.push(SideInterval { from, to: span.greatest, side: last.side() });
        }
        intervals
    }

    /// Returns the changes of side of the line in order; `value` returns the value of the second
    /// axis at a position.
    pub(super) fn side_changes(
        &self,
        span: &Span,
        axis_value: &dyn Fn(f64) -> f64,
    ) -> Vec<SideChange> {
        let mut side_changes = Vec::new();
        for [low, high] in self.sample_brackets() {
            let is_narrow = high.position - low.position <= span.tolerance;
            let is_jump =
                |change: f64| !change.is_finite() || (change.abs() > JUMP_LN_RATIO && is_narrow);
            let kind = match (low.distance, high.distance) {
                (Some(distance_low), Some(distance_high))
                    if is_jump(distance_low - distance_high) =>
                {
                    SideChangeKind::Jump
                }
                (Some(_), Some(_)) => SideChangeKind::Crossing,
                _ => SideChangeKind::Undefined,
            };
            let root =
                if kind == SideChangeKind::Crossing { interpolate_root(&low, &high) } else { None };
            side_changes.push(SideChange {
                kind,
                position: root.map(axis_value),
                bracket: Some([axis_value(low.position), axis_value(high.position)]),
                distances: [low.distance, high.distance],
            });
        }
        if side_changes.is_empty() {
            let kind = match self.samples.first().map(LineSample::side) {
                Some(LimitSide::Reliable) => SideChangeKind::AllReliable,
                Some(LimitSide::Unreliable) => SideChangeKind::AllUnreliable,
                Some(LimitSide::Undefined) | None => SideChangeKind::AllUndefined,
            };
            side_changes.push(SideChange {
                kind,
                position: None,
                bracket: None,
                distances: [None; 2],
            });
        }
        side_changes
    }
}

/// Returns whether a bracket has to be narrowed: it is wider than the tolerance, or may contain a
/// jump.
fn needs_narrowing(low: &LineSample, high: &LineSample, span: &Span) -> bool {
    let width = high.position - low.position;
    let middle = 0.5 * (low.position + high.position);
    let may_jump = match (low.finite_distance(), high.finite_distance()) {
        (Some(distance_low), Some(distance_high)) => {
            (distance_low - distance_high).abs() > JUMP_LN_RATIO
                && width > JUMP_BRACKET_WIDTH * span.tolerance
        }
        _ => false,
    };
    // A bracket whose middle rounds to one of its ends cannot be narrowed.
    (width > span.tolerance || may_jump) && low.position < middle && middle < high.position
}

/// Returns the position of the limit within a bracket, by the straight line between its ends.
fn interpolate_root(low: &LineSample, high: &LineSample) -> Option<f64> {
    let distance_low = low.finite_distance()?;
    let distance_high = high.finite_distance()?;
    let root = low.position
        + (high.position - low.position) * (distance_low / (distance_low - distance_high));
    Some(root.clamp(low.position, high.position))
}

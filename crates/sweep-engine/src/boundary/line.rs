//! The search along one line of the second axis: its samples, and the positions that it needs next.
//!
//! Neighbouring samples on different sides are a bracket, narrowed by [`Itp`] until it is within
//! tolerance. A bracket over which the distance still changes much may contain a jump, and is
//! bisected further.

use super::continuation::PredictedSide;
use super::itp::Itp;
use super::sample::{LimitSide, LineSample, SideInterval, Span};
use super::{Edge, EdgeKind};

/// The change of the distance over a narrow bracket above which the edge is a jump. Basis: ln 1.5,
/// a factor of 1.5 in a ratio, which changes a reader's decision. Doubling it reports jumps by a
/// factor of up to 2.25 as crossings.
const JUMP_LN_RATIO: f64 = 0.405;
/// The width, in tolerances, to which a bracket that may contain a jump is narrowed. Basis: a steep
/// crossing in it is then located to a sixteenth of the tolerance. Doubling it saves one trial per
/// jump.
const JUMP_WIDTH: f64 = 1.0 / 16.0;

/// The search along a line.
#[derive(Clone, Debug, Default)]
pub(super) struct LineSearch {
    /// The samples in order of position, no two at the same.
    samples: Vec<LineSample>,
    /// The positions that are requested and not yet taken.
    requested: Vec<f64>,
    /// The open brackets with their root finders.
    brackets: Vec<([f64; 2], Itp)>,
}

impl LineSearch {
    /// Requests samples at these positions, moved into the range, where there are none yet.
    pub(super) fn request(&mut self, places: impl IntoIterator<Item = f64>, span: &Span) {
        for place in places {
            let at = place.clamp(span.least, span.greatest);
            if self.sample_at(at).is_none() {
                self.requested.push(at);
            }
        }
        self.requested.sort_by(f64::total_cmp);
        self.requested.dedup();
    }

    /// Whether positions are requested that are not yet taken.
    pub(super) fn has_requests(&self) -> bool {
        !self.requested.is_empty()
    }

    pub(super) fn insert(&mut self, sample: LineSample) {
        let index = self.samples.partition_point(|other| other.at < sample.at);
        if self.samples.get(index).is_none_or(|other| other.at != sample.at) {
            self.samples.insert(index, sample);
        }
    }

    /// Returns the sample at exactly this position.
    pub(super) fn sample_at(&self, at: f64) -> Option<&LineSample> {
        let index = self.samples.binary_search_by(|sample| sample.at.total_cmp(&at)).ok()?;
        self.samples.get(index)
    }

    /// Whether the sample at this position is on the side that is predicted.
    pub(super) fn confirms(&self, predicted: &PredictedSide) -> bool {
        self.sample_at(predicted.at).is_some_and(|sample| sample.side() == predicted.side)
    }

    pub(super) fn samples(&self) -> &[LineSample] {
        &self.samples
    }

    /// Takes the positions to evaluate next: those requested, or else a step in every open bracket;
    /// none when every bracket is narrow.
    pub(super) fn take_places(&mut self, span: &Span) -> Vec<f64> {
        if self.has_requests() {
            return std::mem::take(&mut self.requested);
        }
        let known = std::mem::take(&mut self.brackets);
        let open: Vec<[LineSample; 2]> =
            self.changes().filter(|[low, high]| is_open(low, high, span)).collect();
        let mut places = Vec::with_capacity(open.len());
        for [low, high] in open {
            let width = high.at - low.at;
            if width <= span.tolerance {
                places.push(0.5 * (low.at + high.at));
                continue;
            }
            let outer = known.iter().find(|(ends, _)| ends[0] <= low.at && high.at <= ends[1]);
            let mut itp = match outer {
                Some((_, itp)) => *itp,
                None => Itp::new(width, span.tolerance),
            };
            let distances = low.finite_distance().zip(high.finite_distance());
            places.push(itp.step(low.at, high.at, distances.map(<[f64; 2]>::from)));
            self.brackets.push(([low.at, high.at], itp));
        }
        places
    }

    /// Returns the positions that divide an interval so that no gap between samples is wider than
    /// `widest`. If there are any, it adds one beyond either end, so that a side that shows up in
    /// the interval has narrow brackets. None is within half a tolerance of a sample.
    pub(super) fn subdivide(&self, interval: [f64; 2], widest: f64, span: &Span) -> Vec<f64> {
        let [from, to] = interval;
        let inside =
            self.samples.iter().map(|sample| sample.at).filter(|at| from < *at && *at < to);
        let marks: Vec<f64> = [from].into_iter().chain(inside).chain([to]).collect();
        let least_gap = 0.5 * span.tolerance;
        let is_new =
            |at: &f64| self.samples.iter().all(|sample| (sample.at - at).abs() >= least_gap);
        let mut places = Vec::new();
        for gap in marks.windows(2) {
            let width = gap[1] - gap[0];
            // Rounding must not add a piece.
            let pieces = libm::ceil(width / widest - 1e-6);
            let cuts = (1..pieces as usize).map(|k| gap[0] + width * (k as f64 / pieces));
            places.extend(cuts.filter(is_new));
        }
        if !places.is_empty() {
            places.extend([from - widest, to + widest].into_iter().filter(is_new));
        }
        places
    }

    /// Iterates over neighbouring samples on different sides.
    fn changes(&self) -> impl Iterator<Item = [LineSample; 2]> + '_ {
        let pairs = self.samples.windows(2).map(|pair| [pair[0], pair[1]]);
        pairs.filter(|[low, high]| low.side() != high.side())
    }

    /// Returns the intervals of one side in order; none before the first sample.
    pub(super) fn intervals(&self, span: &Span) -> Vec<SideInterval> {
        let mut intervals = Vec::new();
        let mut from = span.least;
        for [low, high] in self.changes() {
            let to = interpolate_root(&low, &high).unwrap_or(0.5 * (low.at + high.at));
            intervals.push(SideInterval { from, to, side: low.side() });
            from = to;
        }
        if let Some(last) = self.samples.last() {
            intervals.push(SideInterval { from, to: span.greatest, side: last.side() });
        }
        intervals
    }

    /// Returns the places where the line changes sides, in order; `value` turns positions into
    /// values of the second axis.
    pub(super) fn edges(&self, span: &Span, value: &dyn Fn(f64) -> f64) -> Vec<Edge> {
        let mut edges = Vec::new();
        for [low, high] in self.changes() {
            let is_narrow = high.at - low.at <= span.tolerance;
            let is_jump =
                |change: f64| !change.is_finite() || (change.abs() > JUMP_LN_RATIO && is_narrow);
            let kind = match (low.distance, high.distance) {
                (Some(at_low), Some(at_high)) if is_jump(at_low - at_high) => EdgeKind::Jump,
                (Some(_), Some(_)) => EdgeKind::Crossing,
                _ => EdgeKind::Undefined,
            };
            let root =
                if kind == EdgeKind::Crossing { interpolate_root(&low, &high) } else { None };
            edges.push(Edge {
                kind,
                at: root.map(value),
                bracket: Some([value(low.at), value(high.at)]),
                distances: [low.distance, high.distance],
            });
        }
        if edges.is_empty() {
            let kind = match self.samples.first().map(LineSample::side) {
                Some(LimitSide::Reliable) => EdgeKind::NoneReliable,
                Some(LimitSide::Unreliable) => EdgeKind::NoneUnreliable,
                Some(LimitSide::Undefined) | None => EdgeKind::NoneUndefined,
            };
            edges.push(Edge { kind, at: None, bracket: None, distances: [None; 2] });
        }
        edges
    }
}

/// Whether a bracket has to be narrowed: it is wider than the tolerance, or may contain a jump.
fn is_open(low: &LineSample, high: &LineSample, span: &Span) -> bool {
    let width = high.at - low.at;
    let middle = 0.5 * (low.at + high.at);
    let may_jump = match (low.finite_distance(), high.finite_distance()) {
        (Some(at_low), Some(at_high)) => {
            (at_low - at_high).abs() > JUMP_LN_RATIO && width > JUMP_WIDTH * span.tolerance
        }
        _ => false,
    };
    // A bracket whose middle rounds to one of its ends cannot be narrowed.
    (width > span.tolerance || may_jump) && low.at < middle && middle < high.at
}

/// Returns the position of the limit within a bracket, by the straight line between its ends.
fn interpolate_root(low: &LineSample, high: &LineSample) -> Option<f64> {
    let at_low = low.finite_distance()?;
    let at_high = high.finite_distance()?;
    let root = low.at + (high.at - low.at) * (at_low / (at_low - at_high));
    Some(root.clamp(low.at, high.at))
}

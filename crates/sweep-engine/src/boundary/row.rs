//! One row: the trials along it, the sides that they show, and the trials that it wants next.

use super::net;
use super::{Edge, EdgeKind, Hint, Net, Question, Side, SideRange, Span, Tried, Want, refine};

/// After so many rounds brackets are cut evenly, and after so many looks none is taken any more:
/// whatever the function does, it ends.
const PATIENCE: usize = 12;
/// A net is so many times wider after one that caught nothing.
const WIDER: f64 = 4.0;
/// A change of the distance over a bracket within tolerance that calls for a closer look: a factor
/// of 1.5 in a ratio.
const LEAP: f64 = 0.405;
/// How much closer that look goes.
const CLOSER: f64 = 1.0 / 16.0;
/// Brackets of so many tolerances tell other rows where to begin.
const PLACED: f64 = 4.0;

/// A row in the making.
#[derive(Clone, Debug, Default)]
pub(super) struct RowSearch {
    /// In order of position, no two at the same.
    samples: Vec<Tried>,
    /// Not yet passed on.
    asked: Question,
    /// Where the side changes by what other rows say, for brackets that turn up there.
    perhaps: Vec<Hint>,
    /// The sides at the ends of the range, where they are taken from other rows until they are
    /// seen.
    assumed: [Option<Side>; 2],
    /// Where nets were cast of late, and how much wider the next ones are because these failed.
    cast: Vec<[f64; 2]>,
    strain: f64,
    rounds: usize,
    looks: usize,
}

/// The end of a bracket: where, on which side, and the sample unless it is assumed.
#[derive(Clone, Copy)]
struct End {
    at: f64,
    side: Side,
    sample: Option<Tried>,
}

impl RowSearch {
    /// A row that begins with this question.
    pub(super) fn new(asked: Question, assumed: [Option<Side>; 2]) -> Self {
        Self { asked, assumed, strain: 1.0, ..Self::default() }
    }

    /// Has this looked into.
    pub(super) fn ask(&mut self, question: Question) {
        self.asked.places.extend(question.places);
        self.asked.roots.extend(question.roots);
        self.asked.perhaps.extend(question.perhaps);
    }

    /// Whether there is a question that it has not passed on.
    pub(super) fn is_asked(&self) -> bool {
        !self.asked.is_empty()
    }

    /// Keeps what came of a trial.
    pub(super) fn insert(&mut self, sample: Tried) {
        let place = self.samples.partition_point(|other| other.at < sample.at);
        if self.samples.get(place).is_none_or(|other| other.at != sample.at) {
            self.samples.insert(place, sample);
        }
    }

    /// Whether something was tried here.
    pub(super) fn knows(&self, at: f64) -> bool {
        self.samples.binary_search_by(|sample| sample.at.total_cmp(&at)).is_ok()
    }

    /// Remembers where a net was cast.
    pub(super) fn note(&mut self, net: [f64; 2]) {
        self.cast.push(net);
    }

    /// How many values were tried.
    pub(super) fn trials(&self) -> usize {
        self.samples.len()
    }

    /// What to try next; nothing when the row is done.
    pub(super) fn wants(&mut self, span: &Span) -> Vec<Want> {
        let mut wants = self.pass_on(span);
        if wants.is_empty() {
            self.rounds += 1;
            wants = self.close(span);
        }
        if wants.is_empty() && self.looks < PATIENCE {
            self.looks += 1;
            wants = refine::around(&self.samples, span);
        }
        wants
    }

    /// What it was asked.
    fn pass_on(&mut self, span: &Span) -> Vec<Want> {
        let Question { places, roots, perhaps } = std::mem::take(&mut self.asked);
        self.perhaps.extend(perhaps);
        let places = places.into_iter().map(|at| at.clamp(span.least, span.greatest));
        let mut wants: Vec<Want> = places.filter(|at| !self.knows(*at)).map(Want::At).collect();
        for (k, hint) in roots.iter().enumerate() {
            // Halfway to the next root is the other one's.
            let half = |other: &Hint| 0.5 * (other.root + hint.root);
            let before = k.checked_sub(1).and_then(|k| roots.get(k));
            let from = before.map_or(span.least, half);
            let to = roots.get(k + 1).map_or(span.greatest, half);
            let Hint { root, spread } = *hint;
            if from < root && root < to {
                wants.push(Want::Net(Net { from, to, root, spread, least: 2 }));
            }
        }
        wants
    }

    /// Samples, and what is assumed of the range's ends beyond them, in order.
    fn ends(&self, span: &Span) -> Vec<End> {
        let tried =
            |sample: &Tried| End { at: sample.at, side: sample.side(), sample: Some(*sample) };
        let assumed = |at, side| End { at, side, sample: None };
        let mut ends: Vec<End> = self.samples.iter().map(tried).collect();
        let [low, high] = self.assumed;
        if let Some(side) = low.filter(|_| !self.knows(span.least)) {
            ends.insert(0, assumed(span.least, side));
        }
        if let Some(side) = high.filter(|_| !self.knows(span.greatest)) {
            ends.push(assumed(span.greatest, side));
        }
        ends
    }

    /// Brackets: neighbouring ends on different sides.
    fn brackets(&self, span: &Span) -> Vec<[End; 2]> {
        let ends = self.ends(span);
        let pairs = ends.windows(2).map(|pair| [pair[0], pair[1]]);
        pairs.filter(|[a, b]| a.side != b.side).collect()
    }

    /// Nets that narrow brackets.
    fn close(&mut self, span: &Span) -> Vec<Want> {
        let cast = std::mem::take(&mut self.cast);
        let mut open = self.brackets(span);
        open.retain(|[a, b]| is_open(a, b, span));
        let is_caught = |[a, b]: &[End; 2]| cast.iter().any(|net| net[0] <= a.at && b.at <= net[1]);
        if cast.is_empty() || open.iter().any(is_caught) {
            self.strain = 1.0;
        } else if !open.is_empty() {
            self.strain *= WIDER;
        }
        let mut wants: Vec<Want> = open.iter().map(|[a, b]| self.narrow(a, b, span)).collect();
        let first = self.samples.first().map(Tried::side);
        if wants.is_empty() && self.samples.iter().all(|sample| Some(sample.side()) == first) {
            // A row never takes from other rows that it has no change of side.
            let ends = [span.least, span.greatest].into_iter();
            wants.extend(ends.filter(|end| !self.knows(*end)).map(Want::At));
        }
        wants
    }

    /// What narrows one bracket.
    fn narrow(&mut self, a: &End, b: &End, span: &Span) -> Want {
        let (from, to) = (a.at, b.at);
        let width = to - from;
        let impatient = self.rounds > PATIENCE;
        if a.sample.is_none() || b.sample.is_none() {
            // What was assumed of the range's end has to be seen if the bracket comes close to it.
            if impatient || width <= 2.0 * span.tolerance {
                return Want::At(if a.sample.is_none() { from } else { to });
            }
        }
        if impatient || width <= span.tolerance {
            return Want::Net(Net::even(from, to));
        }
        let told = self.perhaps.iter().position(|hint| from < hint.root && hint.root < to);
        let estimate = match told.map(|k| self.perhaps.swap_remove(k)) {
            Some(hint) => Some((hint.root, hint.spread)),
            None => net::estimate(&self.around(from, to), from, to),
        };
        // Without an estimate, the root is near the tried end: that is where others expected it.
        let stride = (span.tolerance * self.strain).min(0.5 * width);
        let (root, spread) = match (estimate, a.sample, b.sample) {
            (Some((root, spread)), ..) => (root, (spread * self.strain).min(0.5 * width)),
            (None, None, Some(_)) => (to - stride, 0.5 * stride),
            (None, Some(_), None) => (from + stride, 0.5 * stride),
            (None, ..) => return Want::Net(Net::even(from, to)),
        };
        Want::Net(Net { from, to, root, spread, least: 1 })
    }

    /// Up to two samples with finite distances on each side of a bracket, in order.
    fn around(&self, from: f64, to: f64) -> Vec<(f64, f64)> {
        let left = self.samples.partition_point(|sample| sample.at <= from);
        let right = self.samples.partition_point(|sample| sample.at < to);
        let left = &self.samples[left.saturating_sub(2)..left];
        left.iter().chain(self.samples[right..].iter().take(2)).filter_map(Tried::finite).collect()
    }

    /// Whether its roots are known well enough to tell where those of other rows are.
    pub(super) fn is_placed(&self, span: &Span) -> bool {
        let is_narrow = |[a, b]: &[End; 2]| {
            a.sample.is_some() && b.sample.is_some() && b.at - a.at <= PLACED * span.tolerance
        };
        !self.samples.is_empty() && !self.is_asked() && self.brackets(span).iter().all(is_narrow)
    }

    /// Neighbouring samples on different sides.
    fn changes(&self) -> impl Iterator<Item = [Tried; 2]> + '_ {
        let pairs = self.samples.windows(2).map(|pair| [pair[0], pair[1]]);
        pairs.filter(|[a, b]| a.side() != b.side())
    }

    /// Stretches of one side, in order; each reaches to where the side changes, or to the range's
    /// end.
    pub(super) fn runs(&self, span: &Span) -> Vec<SideRange> {
        let mut runs: Vec<SideRange> = Vec::new();
        let mut from = span.least;
        for [a, b] in self.changes() {
            let to = crossing(&a, &b).unwrap_or(0.5 * (a.at + b.at));
            runs.push(SideRange { from, to, side: a.side() });
            from = to;
        }
        if let Some(last) = self.samples.last() {
            runs.push(SideRange { from, to: span.greatest, side: last.side() });
        }
        runs
    }

    /// The gaps that trials leave within a stretch.
    pub(super) fn gaps(&self, from: f64, to: f64) -> Vec<[f64; 2]> {
        let inside =
            self.samples.iter().map(|sample| sample.at).filter(|at| from < *at && *at < to);
        let marks: Vec<f64> = [from].into_iter().chain(inside).chain([to]).collect();
        marks.windows(2).map(|pair| [pair[0], pair[1]]).collect()
    }

    /// What the row says in the end; `value` turns positions into values.
    pub(super) fn edges(&self, span: &Span, value: &dyn Fn(f64) -> f64) -> Vec<Edge> {
        let edge = |[a, b]: [Tried; 2]| {
            let is_narrow = b.at - a.at <= span.tolerance;
            let leaps = |leap: f64| !leap.is_finite() || (leap.abs() > LEAP && is_narrow);
            let kind = match (a.distance, b.distance) {
                (Some(from), Some(to)) if leaps(from - to) => EdgeKind::Jump,
                (Some(_), Some(_)) => EdgeKind::Crossing,
                _ => EdgeKind::Undefined,
            };
            Edge {
                kind,
                at: if kind == EdgeKind::Crossing { crossing(&a, &b).map(value) } else { None },
                bracket: Some([value(a.at), value(b.at)]),
                distances: [a.distance, b.distance],
            }
        };
        let mut edges: Vec<Edge> = self.changes().map(edge).collect();
        if edges.is_empty() {
            let kind = match self.samples.first().map(Tried::side) {
                Some(Side::Reliable) => EdgeKind::NoneReliable,
                Some(Side::Unreliable) => EdgeKind::NoneUnreliable,
                Some(Side::Undefined) | None => EdgeKind::NoneUndefined,
            };
            edges.push(Edge { kind, at: None, bracket: None, distances: [None; 2] });
        }
        edges
    }
}

/// Whether a bracket has to be narrowed: it is too wide, or the quantity may leap over its limit in
/// it.
fn is_open(a: &End, b: &End, span: &Span) -> bool {
    let (width, middle) = (b.at - a.at, 0.5 * (a.at + b.at));
    let Some((low, high)) = a.sample.zip(b.sample) else { return true };
    let leap = low.finite().zip(high.finite()).map(|(low, high)| (low.1 - high.1).abs());
    let may_leap = leap.is_some_and(|leap| leap > LEAP) && width > CLOSER * span.tolerance;
    // Rounding ends it too.
    (width > span.tolerance || may_leap) && a.at < middle && middle < b.at
}

/// Where the limit is met within a bracket: by the straight line between its ends.
fn crossing(a: &Tried, b: &Tried) -> Option<f64> {
    let ((from, at_from), (to, at_to)) = (a.finite()?, b.finite()?);
    Some((from + (to - from) * (at_from / (at_from - at_to))).clamp(from, to))
}

//! Root finding along one row: which values of the second axis to try next, from those tried so far.
//!
//! Positions are coordinates of the second axis: its values, or their logarithms. Distances are signed distances from
//! the limit, of order one (a logarithm of a ratio).

use super::{Edge, Kind};

/// Beyond this many rounds a row's brackets are halved instead of interpolated: whatever the function does, it ends.
const PATIENCE: usize = 12;
/// A change of the distance over a bracket within tolerance that calls for a closer look: a factor of 1.5 in a ratio.
const LEAP: f64 = 0.405;
/// How much closer that look goes.
const CLOSER: f64 = 1.0 / 16.0;
/// Distances below this are near the limit: neighbouring samples there should not differ by more than [`STRIDE`].
const NEAR: f64 = 0.5;
/// A factor of 2 in a ratio.
const STRIDE: f64 = 0.693;
/// An extremum expected this close to the limit, or beyond it, is looked at.
const TOUCH: f64 = 0.05;
/// Trials on both sides of an expected root stand this far from it, in tolerances: a little less than half, so that the
/// bracket they make is within tolerance.
const HALF: f64 = 0.45;

/// Which side of the limit a sample is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Reliable,
    Unreliable,
    Undefined,
}

/// A value tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample {
    pub(super) at: f64,
    pub(super) distance: Option<f64>,
}

impl Sample {
    pub(super) fn side(&self) -> Side {
        match self.distance {
            Some(distance) if distance < 0.0 => Side::Reliable,
            Some(_) => Side::Unreliable,
            None => Side::Undefined,
        }
    }

    /// Distance if it can be calculated with.
    fn finite(&self) -> Option<f64> {
        self.distance.filter(|distance| distance.is_finite())
    }
}

/// The range that is searched, as coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    pub(super) least: f64,
    pub(super) greatest: f64,
    pub(super) tolerance: f64,
}

/// A row in the making.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// In order of position, no two at the same.
    samples: Vec<Sample>,
    /// To be tried first.
    seeds: Vec<f64>,
    /// The sides expected at both ends of the range, if the row was begun near a root its neighbours point to.
    expected: Option<[Side; 2]>,
    rounds: usize,
}

impl Row {
    /// A row that begins with these positions.
    pub(super) fn new(seeds: Vec<f64>, expected: Option<[Side; 2]>) -> Self {
        Self { samples: Vec::new(), seeds, expected, rounds: 0 }
    }

    /// How many values were tried.
    pub(super) fn trials(&self) -> usize {
        self.samples.len()
    }

    /// Keeps what came of a trial.
    pub(super) fn insert(&mut self, sample: Sample) {
        let place = self.samples.partition_point(|other| other.at < sample.at);
        if self.samples.get(place).is_none_or(|other| other.at != sample.at) {
            self.samples.insert(place, sample);
        }
    }

    /// What to try next, in order and each once; nothing when the row is done.
    pub(super) fn propose(&mut self, span: &Span) -> Vec<f64> {
        let mut trials = std::mem::take(&mut self.seeds);
        if trials.is_empty() {
            self.rounds += 1;
            for pair in self.samples.windows(2) {
                if pair[0].side() != pair[1].side() {
                    self.close(pair[0], pair[1], span, &mut trials);
                }
            }
            if trials.is_empty() {
                self.reach_out(span, &mut trials);
            }
            if trials.is_empty() {
                self.look_around(span, &mut trials);
            }
        }
        for trial in &mut trials {
            *trial = trial.clamp(span.least, span.greatest);
        }
        trials.sort_by(f64::total_cmp);
        trials.dedup();
        trials.retain(|trial| self.samples.iter().all(|sample| sample.at != *trial));
        trials
    }

    /// Trials that narrow a bracket.
    fn close(&self, a: Sample, b: Sample, span: &Span, trials: &mut Vec<f64>) {
        let (width, tolerance) = (b.at - a.at, span.tolerance);
        let middle = 0.5 * (a.at + b.at);
        let halvable = a.at < middle && middle < b.at;
        let (Some(from), Some(to)) = (a.finite(), b.finite()) else {
            if width > tolerance && halvable {
                trials.push(middle);
            }
            return;
        };
        if width <= tolerance {
            if (from - to).abs() > LEAP && width > CLOSER * tolerance && halvable {
                trials.push(middle);
            }
            return;
        }
        if self.rounds > PATIENCE {
            trials.push(middle);
            return;
        }
        let (root, nearest) = self.root(a, b, from, to);
        if root - a.at <= 0.75 * tolerance {
            trials.push((root + 0.25 * tolerance).min(middle.max(a.at + 0.5 * tolerance)));
        } else if b.at - root <= 0.75 * tolerance {
            trials.push((root - 0.25 * tolerance).max(middle.min(b.at - 0.5 * tolerance)));
        } else if nearest <= 8.0 * tolerance {
            trials.extend([root - HALF * tolerance, root + HALF * tolerance]);
        } else {
            trials.push(root);
        }
    }

    /// Where the limit is expected between two samples on either side of it, and how far that is from the nearest
    /// sample it was found from: the secant through the two samples closest to the limit, or through the ends.
    fn root(&self, a: Sample, b: Sample, from: f64, to: f64) -> (f64, f64) {
        let place = self.samples.partition_point(|sample| sample.at < a.at);
        let first = place.saturating_sub(1);
        let around = &self.samples[first..(place + 3).min(self.samples.len())];
        let mut close: Vec<(f64, f64)> =
            around.iter().filter_map(|sample| Some((sample.at, sample.finite()?))).collect();
        close.sort_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let secant = match close[..] {
            [(x0, y0), (x1, y1), ..] if y0 != y1 => x0 - y0 * (x1 - x0) / (y1 - y0),
            _ => f64::NAN,
        };
        let inside = a.at < secant && secant < b.at;
        // Far from the limit a ratio saturates: what is beyond one only says which side it is on.
        let (from, to) = (from.clamp(-1.0, 1.0), to.clamp(-1.0, 1.0));
        let root = if inside { secant } else { a.at + (b.at - a.at) * (from / (from - to)) };
        (root, (root - a.at).min(b.at - root))
    }

    /// Trials beyond the samples, where a side that is expected at an end has not been met, and at both ends of the
    /// range where no change of side was found at all.
    fn reach_out(&self, span: &Span, trials: &mut Vec<f64>) {
        let (Some(first), Some(last)) = (self.samples.first(), self.samples.last()) else { return };
        if let Some([low, high]) = self.expected {
            if first.side() != low && first.at > span.least {
                trials.push(self.beyond(-1.0, span));
            }
            if last.side() != high && last.at < span.greatest {
                trials.push(self.beyond(1.0, span));
            }
            if !trials.is_empty() {
                return;
            }
        }
        if self.samples.iter().all(|sample| sample.side() == first.side()) {
            trials.extend([span.least, span.greatest]);
        }
    }

    /// The next trial outwards in this direction: a little beyond where the last two samples point, or in growing
    /// strides.
    fn beyond(&self, direction: f64, span: &Span) -> f64 {
        let tolerance = span.tolerance;
        let (last, before) = if direction > 0.0 {
            (self.samples.last(), self.samples.iter().rev().nth(1))
        } else {
            (self.samples.first(), self.samples.get(1))
        };
        let Some(last) = last else { return span.least };
        let stride = tolerance * f64::powi(4.0, i32::try_from(self.rounds.min(20)).unwrap_or(20));
        let step = match (last.finite(), before.and_then(|before| Some((before.at, before.finite()?)))) {
            (Some(distance), Some((at, other))) => {
                let step = direction * -distance * (last.at - at) / (distance - other);
                if step > 0.0 && step <= 2.0 * stride { step + 0.25 * tolerance } else { stride }
            }
            _ => stride,
        };
        last.at + direction * step
    }

    /// Trials against what hides between samples of one side: where the distance changes fast near the limit, where
    /// three samples make an extremum that may touch it, and beyond samples that point to the limit.
    fn look_around(&self, span: &Span, trials: &mut Vec<f64>) {
        let samples: Vec<Option<(f64, f64)>> =
            self.samples.iter().map(|sample| Some((sample.at, sample.finite()?))).collect();
        for pair in samples.windows(2) {
            let &[Some((a, from)), Some((b, to))] = pair else { continue };
            let near = from.abs().min(to.abs()) < NEAR && (from < 0.0) == (to < 0.0);
            if near && (from - to).abs() > STRIDE && b - a > 4.0 * span.tolerance {
                trials.push(0.5 * (a + b));
            }
        }
        for three in samples.windows(3) {
            let &[Some(a), Some(b), Some(c)] = three else { continue };
            let Some(extremum) = touching(a, b, c) else { continue };
            let clear = |at: f64| [a, b, c].iter().all(|sample| (sample.0 - at).abs() > 0.5 * span.tolerance);
            // An extremum on top of a sample may be a kink in the wider gap beside it.
            let (from, to) = if b.0 - a.0 > c.0 - b.0 { (a.0, b.0) } else { (b.0, c.0) };
            let middle = 0.5 * (from + to);
            if let Some(trial) = [extremum, middle].into_iter().find(|at| clear(*at)) {
                trials.push(trial);
            }
        }
        let backwards = samples.iter().rev().copied();
        for ends in [samples.iter().copied().take(2).collect::<Vec<_>>(), backwards.take(2).collect()] {
            let &[Some((last, at_last)), Some((before, at_before))] = ends.as_slice() else { continue };
            let (near, far) = (at_last.abs(), at_before.abs());
            if (at_last < 0.0) == (at_before < 0.0) && near < far && near < NEAR && 2.0 * near - far < TOUCH {
                trials.push(last + (last - before));
            }
        }
    }

    /// Changes of side, as positions in order.
    pub(super) fn roots(&self) -> Vec<f64> {
        self.samples
            .windows(2)
            .filter(|pair| pair[0].side() != pair[1].side())
            .map(|pair| self.place(&pair[0], &pair[1]).unwrap_or(0.5 * (pair[0].at + pair[1].at)))
            .collect()
    }

    /// Where the limit is met within a final bracket: by the straight line between its ends.
    fn place(&self, a: &Sample, b: &Sample) -> Option<f64> {
        let (from, to) = (a.finite()?, b.finite()?);
        Some((a.at + (b.at - a.at) * (from / (from - to))).clamp(a.at, b.at))
    }

    /// The sides at the outermost samples.
    pub(super) fn ends(&self) -> Option<[Side; 2]> {
        Some([self.samples.first()?.side(), self.samples.last()?.side()])
    }

    /// What the row says in the end; `value` turns positions into values.
    pub(super) fn edges(&self, span: &Span, value: &dyn Fn(f64) -> f64) -> Vec<Edge> {
        let mut edges = Vec::new();
        for pair in self.samples.windows(2) {
            let [a, b] = [pair[0], pair[1]];
            if a.side() == b.side() {
                continue;
            }
            let kind = match (a.distance, b.distance) {
                (Some(from), Some(to)) => {
                    let leaps = (from - to).abs() > LEAP && b.at - a.at <= span.tolerance;
                    if leaps || !(from - to).is_finite() { Kind::Jump } else { Kind::Crossing }
                }
                _ => Kind::Undefined,
            };
            edges.push(Edge {
                kind,
                at: if kind == Kind::Crossing { self.place(&a, &b).map(value) } else { None },
                bracket: Some([value(a.at), value(b.at)]),
                distances: [a.distance, b.distance],
            });
        }
        if edges.is_empty() {
            let kind = match self.samples.first().map(Sample::side) {
                Some(Side::Reliable) => Kind::NoneReliable,
                Some(Side::Unreliable) => Kind::NoneUnreliable,
                Some(Side::Undefined) | None => Kind::NoneUndefined,
            };
            edges.push(Edge { kind, at: None, bracket: None, distances: [None; 2] });
        }
        edges
    }
}

/// The extremum of the parabola through three samples of one side, if the middle one is the closest to the limit and the
/// parabola comes as close as [`TOUCH`].
fn touching(a: (f64, f64), b: (f64, f64), c: (f64, f64)) -> Option<f64> {
    let sign = b.1.signum();
    let [fa, fb, fc] = [sign * a.1, sign * b.1, sign * c.1];
    if fa < 0.0 || fc < 0.0 || fb > fa || fb > fc || fb >= NEAR {
        return None;
    }
    let (left, right) = ((fb - fa) / (b.0 - a.0), (fc - fb) / (c.0 - b.0));
    let curvature = (right - left) / (c.0 - a.0);
    if curvature <= 0.0 {
        return None;
    }
    let slope = (left * (c.0 - b.0) + right * (b.0 - a.0)) / (c.0 - a.0);
    let step = -0.5 * slope / curvature;
    let least = fb + 0.5 * slope * step;
    (least < TOUCH).then_some((b.0 + step).clamp(a.0, c.0))
}

//! Continuation of crossings from line to line, and the intervals on which neighbours disagree.
//!
//! A line between others starts from brackets around the crossings that theirs predict, as in
//! predictor-corrector continuation (E. L. Allgower and K. Georg, "Numerical Continuation Methods",
//! Springer, 1990). The predictor is the polynomial through the crossings of up to four lines by
//! Neville's algorithm, whose last correction estimates the error (W. H. Press and others,
//! "Numerical Recipes", 3rd edition, section 3.2).

use super::itp::ROOT_MARGIN;
use super::sample::{LimitSide, SideInterval, Span, side_at};

/// The part of a lattice cell by which a crossing may miss its prediction before the interval
/// between is disputed, and the widest gap in a disputed interval, as a part of that or of a cell.
/// Basis: two bisections. Doubling it takes 5 % fewer trials in the test `random_level_sets`, which
/// then misses 1.8 times as many stretches that a neighbour shows.
pub(super) const DISPUTED_PART: f64 = 0.25;

/// A traced line, seen from another.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbour<'a> {
    /// The position on the first axis.
    pub at: f64,
    pub intervals: &'a [SideInterval],
}

impl Neighbour<'_> {
    /// Whether another line has the same sides in the same order.
    pub(super) fn agrees_with(&self, other: &Self) -> bool {
        let own_sides = self.intervals.iter().map(|interval| interval.side);
        own_sides.eq(other.intervals.iter().map(|interval| interval.side))
    }
}

/// A position and the side that is predicted there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PredictedSide {
    pub at: f64,
    pub side: LimitSide,
}

/// Predicts the sides of a line at `at` around its crossings, from the lines to its left and to its
/// right, the nearest first. Returns `None` if the nearest two disagree, or a position is farther
/// than a lattice cell from their crossing.
pub(super) fn predict(
    at: f64,
    parents: &[Vec<Neighbour<'_>>; 2],
    cell: f64,
    span: &Span,
) -> Option<Vec<PredictedSide>> {
    let left = parents[0].first()?;
    let right = parents[1].first()?;
    if !left.agrees_with(right) {
        return None;
    }
    if let [whole] = left.intervals {
        return Some(
            [span.least, span.greatest].map(|at| PredictedSide { at, side: whole.side }).into(),
        );
    }
    let mut lines: Vec<&Neighbour<'_>> =
        parents.iter().flatten().filter(|line| line.agrees_with(left)).collect();
    lines.sort_by(|a, b| (a.at - at).abs().total_cmp(&(b.at - at).abs()));
    let mut predicted = Vec::new();
    for k in 1..left.intervals.len() {
        let points: Vec<[f64; 2]> =
            lines.iter().map(|line| [line.at, line.intervals[k].from]).collect();
        let (root, correction) = extrapolate(&points, at);
        let half_width = correction.abs().max(ROOT_MARGIN * span.tolerance);
        for (at, side) in [
            (root - half_width, left.intervals[k - 1].side),
            (root + half_width, left.intervals[k].side),
        ] {
            if [left, right].iter().any(|line| (at - line.intervals[k].from).abs() > cell) {
                return None;
            }
            predicted.push(PredictedSide { at: at.clamp(span.least, span.greatest), side });
        }
    }
    Some(predicted)
}

/// Returns the value at `at` of the polynomial through these points, at distinct positions, and its
/// last correction, by Neville's algorithm.
fn extrapolate(points: &[[f64; 2]], at: f64) -> (f64, f64) {
    let mut values: Vec<f64> = points.iter().map(|point| point[1]).collect();
    let mut correction = 0.0;
    // After round `m`, `values[i]` is that of the polynomial through points `i` to `i + m`.
    for m in 1..points.len() {
        let before = values[0];
        for i in 0..points.len() - m {
            let from = points[i][0];
            let to = points[i + m][0];
            values[i] = ((at - to) * values[i] + (from - at) * values[i + 1]) / (from - to);
        }
        correction = values[0] - before;
    }
    (values[0], correction)
}

/// A line, the neighbour that it is compared with, and the line beyond that.
#[derive(Clone, Copy, Debug)]
pub(super) struct LinePair<'a> {
    pub own: Neighbour<'a>,
    pub neighbour: Neighbour<'a>,
    pub beyond: Option<Neighbour<'a>>,
}

impl LinePair<'_> {
    /// Returns the intervals on which the line is not on the side that its neighbour predicts.
    pub(super) fn disputed(&self, cell: f64, span: &Span) -> Vec<[f64; 2]> {
        let own = self.own.intervals;
        let predicted = self.predicted(span);
        // Between a crossing and its prediction the sides differ, as far as predictions are off.
        let mut misses = shared_crossings(own, &predicted);
        misses.retain(|[is, predicted]| (is - predicted).abs() <= DISPUTED_PART * cell);
        let mut marks: Vec<f64> = own
            .iter()
            .chain(&predicted)
            .flat_map(|interval| [interval.from, interval.to])
            .collect();
        marks.sort_by(f64::total_cmp);
        marks.dedup();
        let mut disputed = Vec::new();
        for pair in marks.windows(2) {
            let from = pair[0];
            let to = pair[1];
            let middle = 0.5 * (from + to);
            let is_miss = misses.iter().any(|[a, b]| a.min(*b) <= from && to <= a.max(*b));
            if !is_miss && side_at(own, middle) != side_at(&predicted, middle) {
                disputed.push([from, to]);
            }
        }
        disputed
    }

    /// Returns the neighbour's intervals at the positions where this line should have them: on the
    /// straight line from those beyond, or else moved as far as the nearest crossing that both
    /// have.
    fn predicted(&self, span: &Span) -> Vec<SideInterval> {
        let beyond = self.beyond.filter(|beyond| beyond.agrees_with(&self.neighbour));
        let shared = shared_crossings(self.own.intervals, self.neighbour.intervals);
        let move_of = |k: usize, at: f64| match beyond {
            Some(beyond) => {
                let slope = (at - beyond.intervals[k].from) / (self.neighbour.at - beyond.at);
                slope * (self.own.at - self.neighbour.at)
            }
            None => {
                let gap = |pair: &&[f64; 2]| (pair[1] - at).abs();
                let nearest = shared.iter().min_by(|a, b| gap(a).total_cmp(&gap(b)));
                nearest.map_or(0.0, |[own, neighbours]| own - neighbours)
            }
        };
        let mut predicted = Vec::new();
        let mut from = span.least;
        for (k, interval) in self.neighbour.intervals.iter().enumerate() {
            let to = match self.neighbour.intervals.get(k + 1) {
                Some(next) => (next.from + move_of(k + 1, next.from)).clamp(from, span.greatest),
                None => span.greatest,
            };
            if from < to {
                predicted.push(SideInterval { from, to, side: interval.side });
            }
            from = to;
        }
        predicted
    }
}

/// Returns the crossings that two lines share, as pairs of positions: each is the other's nearest
/// between the same sides.
fn shared_crossings(a: &[SideInterval], b: &[SideInterval]) -> Vec<[f64; 2]> {
    let crossings_of_a = crossings(a);
    let crossings_of_b = crossings(b);
    let mut shared = Vec::new();
    for crossing in &crossings_of_a {
        if let Some(partner) = nearest(crossing, &crossings_of_b)
            && nearest(&partner, &crossings_of_a) == Some(*crossing)
        {
            shared.push([crossing.at, partner.at]);
        }
    }
    shared
}

/// A change of side.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SideChange {
    at: f64,
    sides: [LimitSide; 2],
}

fn crossings(intervals: &[SideInterval]) -> Vec<SideChange> {
    let change = |pair: &[SideInterval]| SideChange {
        at: pair[1].from,
        sides: [pair[0].side, pair[1].side],
    };
    intervals.windows(2).map(change).filter(|change| change.sides[0] != change.sides[1]).collect()
}

fn nearest(to: &SideChange, among: &[SideChange]) -> Option<SideChange> {
    let alike = among.iter().filter(|other| other.sides == to.sides);
    alike.min_by(|a, b| (a.at - to.at).abs().total_cmp(&(b.at - to.at).abs())).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPAN: Span = Span { least: 0.0, greatest: 100.0, tolerance: 1.0 };
    const CELL: f64 = 20.0;

    /// Intervals that change sides here, the first unreliable.
    fn intervals(crossings: &[f64]) -> Vec<SideInterval> {
        let mut side = LimitSide::Unreliable;
        let mut from = SPAN.least;
        let mut intervals = Vec::new();
        for &to in crossings.iter().chain([&SPAN.greatest]) {
            intervals.push(SideInterval { from, to, side });
            from = to;
            side = match side {
                LimitSide::Unreliable => LimitSide::Reliable,
                _ => LimitSide::Unreliable,
            };
        }
        intervals
    }

    fn disputed(own: &[f64], neighbour: &[f64], beyond: Option<&[f64]>) -> Vec<[f64; 2]> {
        let own = intervals(own);
        let neighbour = intervals(neighbour);
        let beyond = beyond.map(intervals);
        let pair = LinePair {
            own: Neighbour { at: 3.0, intervals: &own },
            neighbour: Neighbour { at: 2.0, intervals: &neighbour },
            beyond: beyond.as_ref().map(|intervals| Neighbour { at: 1.0, intervals }),
        };
        pair.disputed(CELL, &SPAN)
    }

    #[test]
    fn the_polynomial_goes_through_its_points_and_beyond() {
        let cube = |x: f64| x * x * x - 2.0 * x;
        let points = [0.0, 1.0, 3.0, 4.0].map(|x| [x, cube(x)]);
        assert!((extrapolate(&points, 2.0).0 - cube(2.0)).abs() < 1e-12);
        assert_eq!(extrapolate(&points[1..2], 9.0), (points[1][1], 0.0));
        let (value, correction) = extrapolate(&[[0.0, 1.0], [1.0, 3.0]], 2.0);
        assert_eq!((value, correction), (5.0, 4.0));
    }

    #[test]
    fn lines_that_agree_predict_the_sides_around_each_crossing() {
        let predict_between = |a: &[f64], b: &[f64]| {
            let left = intervals(a);
            let right = intervals(b);
            let left = Neighbour { at: 0.0, intervals: &left };
            let right = Neighbour { at: 2.0, intervals: &right };
            let predicted = predict(1.0, &[vec![left], vec![right]], CELL, &SPAN)?;
            Some(predicted.iter().map(|predicted| (predicted.at, predicted.side)).collect())
        };
        let reliable = LimitSide::Reliable;
        let unreliable = LimitSide::Unreliable;
        let pocket: Option<Vec<_>> = predict_between(&[20.0, 60.0], &[22.0, 64.0]);
        let expected = [(20.0, unreliable), (22.0, reliable), (60.0, reliable), (64.0, unreliable)];
        assert_eq!(pocket, Some(expected.to_vec()));
        let whole = predict_between(&[], &[]);
        assert_eq!(whole, Some(vec![(0.0, unreliable), (100.0, unreliable)]));
        assert_eq!(predict_between(&[20.0], &[]), None);
        assert_eq!(predict_between(&[20.0], &[40.2]), None, "farther than a cell");
        assert!(predict_between(&[20.0], &[39.8]).is_some());
    }

    #[test]
    fn a_crossing_that_moves_on_is_not_disputed() {
        assert_eq!(disputed(&[50.0], &[40.0], Some(&[30.0])), [[0.0; 2]; 0]);
        assert_eq!(disputed(&[54.0], &[40.0], Some(&[30.0])), [[0.0; 2]; 0], "by less than 5");
        assert_eq!(disputed(&[56.0], &[40.0], Some(&[30.0])), [[50.0, 56.0]]);
        assert_eq!(disputed(&[50.0], &[40.0], None), [[0.0; 2]; 0], "moved as it has moved");
    }

    #[test]
    fn a_pocket_of_the_neighbour_is_disputed_where_it_should_have_moved() {
        assert_eq!(disputed(&[], &[40.0, 46.0], Some(&[35.0, 43.0])), [[45.0, 49.0]]);
        assert_eq!(disputed(&[], &[40.0, 46.0], None), [[40.0, 46.0]]);
        let beside_a_crossing = disputed(&[77.0], &[40.0, 46.0, 70.0], None);
        assert_eq!(beside_a_crossing, [[47.0, 53.0]], "moved with the crossing beside it");
        assert_eq!(disputed(&[], &[40.0, 41.0], Some(&[30.0, 40.0])), [[0.0; 2]; 0], "closed");
    }
}

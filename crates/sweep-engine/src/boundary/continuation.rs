//! Continuation of crossings from line to line, and the intervals on which neighbours disagree.
//!
//! A line between traced lines starts from brackets around the crossings that these predict, as in
//! predictor-corrector continuation (E. L. Allgower and K. Georg, "Numerical Continuation Methods",
//! Springer, 1990). The predictor is the polynomial through the crossings of up to four lines by
//! Neville's algorithm, whose last correction estimates the error (W. H. Press and others,
//! "Numerical Recipes", 3rd edition, section 3.2).

use super::itp::ROOT_MARGIN;
use super::sample::{LimitSide, SideInterval, Span, side_at};

/// A fraction with two uses. A crossing may miss its prediction by this fraction of a lattice cell
/// before the interval between the two is disputed; and samples subdivide a disputed interval into
/// gaps of at most this fraction of the interval or of a cell. Basis: two bisections. Doubling it
/// takes 5 % fewer trials in the test `random_level_sets`, which then misses 1.8 times as many
/// stretches that a neighbour shows.
pub(super) const DISPUTED_FRACTION: f64 = 0.25;

/// A traced line to which another line is compared.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbour<'a> {
    /// The position on the first axis.
    pub position: f64,
    pub intervals: &'a [SideInterval],
}

impl Neighbour<'_> {
    /// Returns whether another line has the same sides in the same order.
    pub(super) fn agrees_with(&self, other: &Self) -> bool {
        let own_sides = self.intervals.iter().map(|interval| interval.side);
        own_sides.eq(other.intervals.iter().map(|interval| interval.side))
    }
}

/// A position and the side that is predicted there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PredictedSide {
    pub position: f64,
    pub side: LimitSide,
}

/// Predicts the sides of a line at a position around its crossings, from the lines to its left and
/// to its right, the nearest first. Returns `None` if the nearest two disagree, or if a predicted
/// position is farther than a lattice cell from their crossing.
pub(super) fn predict_sides(
    position: f64,
    parents: &[Vec<Neighbour<'_>>; 2],
    cell: f64,
    span: &Span,
) -> Option<Vec<PredictedSide>> {
    let left = parents[0].first()?;
    let right = parents[1].first()?;
    if !left.agrees_with(right) {
        return None;
    }
    if let [whole_interval] = left.intervals {
        return Some(
            [span.least, span.greatest]
                .map(|position| PredictedSide { position, side: whole_interval.side })
                .into(),
        );
    }
    let mut agreeing_lines: Vec<&Neighbour<'_>> =
        parents.iter().flatten().filter(|line| line.agrees_with(left)).collect();
    agreeing_lines
        .sort_by(|a, b| (a.position - position).abs().total_cmp(&(b.position - position).abs()));
    let mut predicted_sides = Vec::new();
    for k in 1..left.intervals.len() {
        let crossing_points: Vec<[f64; 2]> =
            agreeing_lines.iter().map(|line| [line.position, line.intervals[k].from]).collect();
        let (root, correction) = extrapolate(&crossing_points, position);
        let half_width = correction.abs().max(ROOT_MARGIN * span.tolerance);
        for (position, side) in [
            (root - half_width, left.intervals[k - 1].side),
            (root + half_width, left.intervals[k].side),
        ] {
            if [left, right].iter().any(|line| (position - line.intervals[k].from).abs() > cell) {
                return None;
            }
            predicted_sides
                .push(PredictedSide { position: position.clamp(span.least, span.greatest), side });
        }
    }
    Some(predicted_sides)
}

/// Returns the value at a position of the polynomial through points at distinct positions, and its
/// last correction, by Neville's algorithm.
fn extrapolate(points: &[[f64; 2]], position: f64) -> (f64, f64) {
    let mut polynomial_values: Vec<f64> = points.iter().map(|point| point[1]).collect();
    let mut correction = 0.0;
    // After round `m`, `values[i]` is that of the polynomial through points `i` to `i + m`.
    for m in 1..points.len() {
        let previous_value = polynomial_values[0];
        for i in 0..points.len() - m {
            let left_position = points[i][0];
            let right_position = points[i + m][0];
            polynomial_values[i] = ((position - right_position) * polynomial_values[i]
                + (left_position - position) * polynomial_values[i + 1])
                / (left_position - right_position);
        }
        correction = polynomial_values[0] - previous_value;
    }
    (polynomial_values[0], correction)
}

/// A line, the neighbour with which it is compared, and the line beyond the neighbour.
#[derive(Clone, Copy, Debug)]
pub(super) struct LinePair<'a> {
    pub line: Neighbour<'a>,
    pub neighbour: Neighbour<'a>,
    pub second_neighbour: Option<Neighbour<'a>>,
}

impl LinePair<'_> {
    /// Returns the intervals on which the line is not on the side that its neighbour predicts.
    pub(super) fn find_disputed_intervals(&self, cell: f64, span: &Span) -> Vec<[f64; 2]> {
        let intervals = self.line.intervals;
        let predicted_intervals = self.shift_neighbour_intervals(span);
        // A crossing and its prediction are a pair between which the sides differ, by as much as
        // the prediction is wrong.
        let mut prediction_errors = find_shared_crossings(intervals, &predicted_intervals);
        prediction_errors.retain(|[position, predicted_intervals]| {
            (position - predicted_intervals).abs() <= DISPUTED_FRACTION * cell
        });
        let mut interval_ends: Vec<f64> = intervals
            .iter()
            .chain(&predicted_intervals)
            .flat_map(|interval| [interval.from, interval.to])
            .collect();
        interval_ends.sort_by(f64::total_cmp);
        interval_ends.dedup();
        let mut disputed_intervals = Vec::new();
        for pair in interval_ends.windows(2) {
            let from = pair[0];
            let to = pair[1];
            let middle = 0.5 * (from + to);
            let is_prediction_error =
                prediction_errors.iter().any(|[a, b]| a.min(*b) <= from && to <= a.max(*b));
            if !is_prediction_error
                && side_at(intervals, middle) != side_at(&predicted_intervals, middle)
            {
                disputed_intervals.push([from, to]);
            }
        }
        disputed_intervals
    }

    /// Returns the neighbour's intervals, moved to the positions that they should have on this
    /// line: on the straight line through both neighbours' crossings. Without a second neighbour
    /// they move by the distance of the nearest crossing that this line and the neighbour share.
    fn shift_neighbour_intervals(&self, span: &Span) -> Vec<SideInterval> {
        let second_neighbour = self
            .second_neighbour
            .filter(|second_neighbour| second_neighbour.agrees_with(&self.neighbour));
        let shared_positions = find_shared_crossings(self.line.intervals, self.neighbour.intervals);
        let displacement_at = |k: usize, position: f64| match second_neighbour {
            Some(second_neighbour) => {
                let slope = (position - second_neighbour.intervals[k].from)
                    / (self.neighbour.position - second_neighbour.position);
                slope * (self.line.position - self.neighbour.position)
            }
            None => {
                let distance_to = |pair: &&[f64; 2]| (pair[1] - position).abs();
                let nearest_crossing = shared_positions
                    .iter()
                    .min_by(|a, b| distance_to(a).total_cmp(&distance_to(b)));
                nearest_crossing.map_or(0.0, |[own, neighbours]| own - neighbours)
            }
        };
        let mut moved_intervals = Vec::new();
        let mut from = span.least;
        for (k, interval) in self.neighbour.intervals.iter().enumerate() {
            let to = match self.neighbour.intervals.get(k + 1) {
                Some(next) => {
                    (next.from + displacement_at(k + 1, next.from)).clamp(from, span.greatest)
                }
                None => span.greatest,
            };
            if from < to {
                moved_intervals.push(SideInterval { from, to, side: interval.side });
            }
            from = to;
        }
        moved_intervals
    }
}

/// Returns the crossings that two lines share, as pairs of positions: each is the other's nearest
/// between the same sides.
fn find_shared_crossings(a: &[SideInterval], b: &[SideInterval]) -> Vec<[f64; 2]> {
    let crossings_of_a = find_crossings(a);
    let crossings_of_b = find_crossings(b);
    let mut shared_pairs = Vec::new();
    for crossing in &crossings_of_a {
        if let Some(partner) = find_nearest_crossing(crossing, &crossings_of_b)
            && find_nearest_crossing(&partner, &crossings_of_a) == Some(*crossing)
        {
            shared_pairs.push([crossing.position, partner.position]);
        }
    }
    shared_pairs
}

/// A change of side.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LineCrossing {
    position: f64,
    sides: [LimitSide; 2],
}

fn find_crossings(intervals: &[SideInterval]) -> Vec<LineCrossing> {
    let crossing_between = |pair: &[SideInterval]| LineCrossing {
        position: pair[1].from,
        sides: [pair[0].side, pair[1].side],
    };
    intervals
        .windows(2)
        .map(crossing_between)
        .filter(|crossing_between| crossing_between.sides[0] != crossing_between.sides[1])
        .collect()
}

fn find_nearest_crossing(
    crossing: &LineCrossing,
    candidates: &[LineCrossing],
) -> Option<LineCrossing> {
    let candidates_between_same_sides =
        candidates.iter().filter(|other| other.sides == crossing.sides);
    candidates_between_same_sides
        .min_by(|a, b| {
            (a.position - crossing.position)
                .abs()
                .total_cmp(&(b.position - crossing.position).abs())
        })
        .copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPAN: Span = Span { least: 0.0, greatest: 100.0, tolerance: 1.0 };
    const CELL_WIDTH: f64 = 20.0;

    /// Returns intervals that change sides at these positions; the first one is unreliable.
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

    fn find_disputed(
        own_crossings: &[f64],
        neighbour_crossings: &[f64],
        second_neighbour_crossings: Option<&[f64]>,
    ) -> Vec<[f64; 2]> {
        let own_crossings = intervals(own_crossings);
        let neighbour = intervals(neighbour_crossings);
        let second_neighbour = second_neighbour_crossings.map(intervals);
        let pair = LinePair {
            line: Neighbour { position: 3.0, intervals: &own_crossings },
            neighbour: Neighbour { position: 2.0, intervals: &neighbour },
            second_neighbour: second_neighbour
                .as_ref()
                .map(|intervals| Neighbour { position: 1.0, intervals }),
        };
        pair.find_disputed_intervals(CELL_WIDTH, &SPAN)
    }

    #[test]
    fn the_polynomial_goes_through_its_points_and_beyond() {
        let cubic = |x: f64| x * x * x - 2.0 * x;
        let points = [0.0, 1.0, 3.0, 4.0].map(|x| [x, cubic(x)]);
        assert!((extrapolate(&points, 2.0).0 - cubic(2.0)).abs() < 1e-12);
        assert_eq!(extrapolate(&points[1..2], 9.0), (points[1][1], 0.0));
        let (value, correction) = extrapolate(&[[0.0, 1.0], [1.0, 3.0]], 2.0);
        assert_eq!((value, correction), (5.0, 4.0));
    }

    #[test]
    fn lines_that_agree_predict_the_sides_around_each_crossing() {
        let predict_between = |a: &[f64], b: &[f64]| {
            let left = intervals(a);
            let right = intervals(b);
            let left = Neighbour { position: 0.0, intervals: &left };
            let right = Neighbour { position: 2.0, intervals: &right };
            let predicted_sides =
                predict_sides(1.0, &[vec![left], vec![right]], CELL_WIDTH, &SPAN)?;
            Some(
                predicted_sides
                    .iter()
                    .map(|predicted_sides| (predicted_sides.position, predicted_sides.side))
                    .collect(),
            )
        };
        let reliable = LimitSide::Reliable;
        let unreliable = LimitSide::Unreliable;
        let sides_with_two_crossings: Option<Vec<_>> =
            predict_between(&[20.0, 60.0], &[22.0, 64.0]);
        let expected_sides =
            [(20.0, unreliable), (22.0, reliable), (60.0, reliable), (64.0, unreliable)];
        assert_eq!(sides_with_two_crossings, Some(expected_sides.to_vec()));
        let sides_without_crossings = predict_between(&[], &[]);
        assert_eq!(sides_without_crossings, Some(vec![(0.0, unreliable), (100.0, unreliable)]));
        assert_eq!(predict_between(&[20.0], &[]), None);
        assert_eq!(predict_between(&[20.0], &[40.2]), None, "farther than a cell");
        assert!(predict_between(&[20.0], &[39.8]).is_some());
    }

    #[test]
    fn a_crossing_that_moves_on_is_not_disputed() {
        assert_eq!(find_disputed(&[50.0], &[40.0], Some(&[30.0])), [[0.0; 2]; 0]);
        assert_eq!(find_disputed(&[54.0], &[40.0], Some(&[30.0])), [[0.0; 2]; 0], "by less than 5");
        assert_eq!(find_disputed(&[56.0], &[40.0], Some(&[30.0])), [[50.0, 56.0]]);
        assert_eq!(find_disputed(&[50.0], &[40.0], None), [[0.0; 2]; 0], "moved as it has moved");
    }

    #[test]
    fn a_pocket_of_the_neighbour_is_disputed_where_it_should_have_moved() {
        assert_eq!(find_disputed(&[], &[40.0, 46.0], Some(&[35.0, 43.0])), [[45.0, 49.0]]);
        assert_eq!(find_disputed(&[], &[40.0, 46.0], None), [[40.0, 46.0]]);
        let intervals_beside_a_crossing = find_disputed(&[77.0], &[40.0, 46.0, 70.0], None);
        assert_eq!(
            intervals_beside_a_crossing,
            [[47.0, 53.0]],
            "moved with the crossing beside it"
        );
        assert_eq!(find_disputed(&[], &[40.0, 41.0], Some(&[30.0, 40.0])), [[0.0; 2]; 0], "closed");
    }
}

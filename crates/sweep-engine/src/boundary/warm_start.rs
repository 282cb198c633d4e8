//! Warm starts: where the side should change in a row, by the rows around it that are done.

use super::pockets::missing;
use super::{Hint, Neighbour, Question, RowSearch, SideRange, Span, hint, nearest, shared};

/// Most rows on each side that a prediction is made from.
pub(super) const HEARD: usize = 2;
/// The part of a prediction's last correction by which it may still be off.
const CORRECTION: f64 = 0.25;

/// A new row at `at` among rows that are done: those to its left and those to its right, at least
/// one each, the nearest first.
pub(super) fn start(
    at: f64,
    left: &[Neighbour<'_>],
    right: &[Neighbour<'_>],
    span: &Span,
) -> RowSearch {
    let (a, b) = (&left[0], &right[0]);
    if !a.is_like(b) {
        return between_unlike(at, left, right, span);
    }
    if a.runs.len() < 2 {
        return RowSearch::new(Question::places(vec![span.least, span.greatest]), [None; 2]);
    }
    let like: Vec<Neighbour<'_>> = [left, right]
        .into_iter()
        .flat_map(|side| side.iter().take(HEARD))
        .filter(|row| row.is_like(a))
        .copied()
        .collect();
    let roots: Vec<Hint> = (1..a.runs.len()).map(|k| predicted(at, k, &like, span)).collect();
    // What lies between two roots is seen, not taken from the neighbours.
    let places = roots.windows(2).map(|two| 0.5 * (two[0].root + two[1].root)).collect();
    let assumed = [a.runs.first(), a.runs.last()].map(|run| run.map(|run| run.side));
    RowSearch::new(Question { places, roots, perhaps: Vec::new() }, assumed)
}

/// Where the k-th change of side of rows that are alike should be.
fn predicted(at: f64, k: usize, like: &[Neighbour<'_>], span: &Span) -> Hint {
    let mut known: Vec<(f64, f64)> = like.iter().map(|row| (row.at, row.runs[k].from)).collect();
    known.sort_by(|x, y| (x.0 - at).abs().total_cmp(&(y.0 - at).abs()));
    let root = polynomial(&known, at);
    let fewer = polynomial(&known[..known.len() - 1], at);
    hint(root.clamp(span.least, span.greatest), CORRECTION * (root - fewer), span)
}

/// A row between two whose sides change differently.
fn between_unlike(
    at: f64,
    left: &[Neighbour<'_>],
    right: &[Neighbour<'_>],
    span: &Span,
) -> RowSearch {
    let (few, many) =
        if left[0].runs.len() < right[0].runs.len() { (left, right) } else { (right, left) };
    let (poor, rich) = (few[0], many[0]);
    // An end on whose side both agree is taken from them, the other is tried.
    let agreed = |run: fn(&[SideRange]) -> Option<&SideRange>| {
        let [a, b] = [poor, rich].map(|row| run(row.runs).map(|run| run.side));
        if a == b { a } else { None }
    };
    let assumed = [agreed(<[SideRange]>::first), agreed(<[SideRange]>::last)];
    let ends = [span.least, span.greatest].into_iter().zip(assumed);
    let mut places: Vec<f64> =
        ends.filter(|(_, side)| side.is_none()).map(|(end, _)| end).collect();
    let part = (at - rich.at) / (poor.at - rich.at);
    let shared = shared(rich, poor, few.get(1));
    let moved = |[k, m]: [usize; 2]| poor.runs[m].from - rich.runs[k].from;
    let roots = shared.iter().map(|pair| {
        let moved = moved(*pair);
        hint(rich.runs[pair[0]].from + part * moved, CORRECTION * moved, span)
    });
    let mut roots: Vec<Hint> = roots.collect();
    if rich.runs.len() == 2 && shared.is_empty() {
        // It leaves the range between the two, towards where it comes from.
        let alike = many.iter().filter(|row| row.is_like(&rich));
        let from: Vec<(f64, f64)> = alike.map(|row| (row.at, row.runs[1].from)).collect();
        let root = polynomial(&from, at);
        if span.contains(root) {
            roots.push(hint(root, CORRECTION * (root - rich.runs[1].from), span));
        }
    }
    // What one has inside the range and the other lacks, moved along with the change beside it.
    for run in missing(rich.runs, poor.runs, span) {
        let near = nearest(run, shared.iter().map(|pair| (rich.runs[pair[0]].from, moved(*pair))));
        places.push(run.middle() + part * near);
    }
    for run in missing(poor.runs, rich.runs, span) {
        let near = nearest(run, shared.iter().map(|pair| (poor.runs[pair[1]].from, -moved(*pair))));
        places.push(run.middle() + (1.0 - part) * near);
    }
    places.retain(|place| span.contains(*place));
    RowSearch::new(Question { places, roots, perhaps: Vec::new() }, assumed)
}

/// The value at `at` of the polynomial through these points, at distinct places (Lagrange's form).
fn polynomial(points: &[(f64, f64)], at: f64) -> f64 {
    let mut sum = 0.0;
    for (i, (x, y)) in points.iter().enumerate() {
        let others = points.iter().enumerate().filter(|(j, _)| *j != i);
        sum += y * others.map(|(_, (other, _))| (at - other) / (x - other)).product::<f64>();
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::span::Side;
    use super::*;

    const SPAN: Span = Span { least: 0.0, greatest: 100.0, tolerance: 1.0 };

    /// Runs that change sides here, the first unreliable.
    pub(in super::super) fn runs(roots: &[f64]) -> Vec<SideRange> {
        let marks: Vec<f64> =
            [0.0].into_iter().chain(roots.iter().copied()).chain([100.0]).collect();
        let side = |k: usize| if k.is_multiple_of(2) { Side::Unreliable } else { Side::Reliable };
        let pairs = marks.windows(2).enumerate();
        pairs.map(|(k, pair)| SideRange { from: pair[0], to: pair[1], side: side(k) }).collect()
    }

    #[test]
    fn the_polynomial_goes_through_its_points_and_beyond() {
        let cube = |x: f64| x * x * x - 2.0 * x;
        let points: Vec<(f64, f64)> = [0.0, 1.0, 3.0, 4.0].map(|x| (x, cube(x))).to_vec();
        assert!((polynomial(&points, 2.0) - cube(2.0)).abs() < 1e-12);
        assert_eq!(polynomial(&points[1..2], 9.0), points[1].1);
    }

    #[test]
    fn a_change_is_recognised_by_where_it_should_have_moved() {
        let [before, poor, rich] = [runs(&[35.0]), runs(&[50.0]), runs(&[55.0, 58.0, 65.0])];
        let [before, poor, rich] = [(0.0, &before), (1.0, &poor), (2.0, &rich)]
            .map(|(at, runs)| Neighbour { at, runs: runs.as_slice() });
        assert_eq!(shared(rich, poor, None), [[1, 1]]);
        assert_eq!(shared(rich, poor, Some(&before)), [[3, 1]]);
        assert_eq!(shared(poor, rich, None), [[1, 1]]);
        let other = [
            SideRange { from: 0.0, to: 40.0, side: Side::Reliable },
            SideRange { from: 40.0, to: 100.0, side: Side::Unreliable },
        ];
        let other = Neighbour { at: 3.0, runs: &other };
        assert_eq!(shared(poor, other, None), [[0; 2]; 0], "the other way round is no match");
    }

    #[test]
    fn between_rows_alike_two_trials_a_root_and_one_a_pocket() {
        let [a, b] = [runs(&[20.0, 30.0, 60.0]), runs(&[22.0, 34.0, 62.0])];
        let [a, b] =
            [(0.0, &a), (1.0, &b)].map(|(at, runs)| Neighbour { at, runs: runs.as_slice() });
        let wants = start(0.5, &[a], &[b], &SPAN).wants(&SPAN);
        assert_eq!(wants.iter().map(|want| want.needed()).sum::<usize>(), 3 * 2 + 2, "{wants:?}");
    }
}

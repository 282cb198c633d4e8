//! Warm starts: where the roots of a row should be, from the rows around it that are done.

use super::row::{Row, Side, Span};

/// Most rows on each side that a prediction is made from.
const NEIGHBOURS: usize = 2;

/// A row that is done: its place along the first axis, and what was found.
#[derive(Clone, Debug)]
pub(super) struct Done {
    pub(super) at: f64,
    pub(super) roots: Vec<f64>,
    pub(super) ends: [Side; 2],
}

/// A new row at `at` among rows that are done, which are in order of their places and lie on both of its sides.
pub(super) fn start(at: f64, done: &[Done], span: &Span, columns: &[f64]) -> Row {
    let right = done.partition_point(|row| row.at < at);
    let (Some(a), Some(b)) = (right.checked_sub(1).map(|left| &done[left]), done.get(right)) else {
        return Row::new(columns.to_vec(), None);
    };
    let near = &done[right.saturating_sub(NEIGHBOURS)..(right + NEIGHBOURS).min(done.len())];
    let pair = |root: f64| [root - 0.45 * span.tolerance, root + 0.45 * span.tolerance];
    if a.ends == b.ends && a.roots.len() == b.roots.len() {
        let like: Vec<&Done> =
            near.iter().filter(|row| row.ends == a.ends && row.roots.len() == a.roots.len()).collect();
        let predicted: Vec<f64> = (0..a.roots.len())
            .map(|k| {
                let known: Vec<(f64, f64)> = like.iter().map(|row| (row.at, row.roots[k])).collect();
                polynomial(&known, at).clamp(span.least, span.greatest)
            })
            .collect();
        if predicted.is_empty() {
            return Row::new(vec![span.least, span.greatest], None);
        }
        let between = predicted.windows(2).map(|two| 0.5 * (two[0] + two[1]));
        let seeds = predicted.iter().flat_map(|root| pair(*root)).chain(between).collect();
        return Row::new(seeds, Some(a.ends));
    }
    let (poor, rich) = if a.roots.len() < b.roots.len() { (a, b) } else { (b, a) };
    if rich.ends != poor.ends || poor.roots.len() != 1 {
        // A root enters or leaves the range here: where the other rows that have it point to, and both ends.
        let like: Vec<(f64, f64)> = near
            .iter()
            .filter(|row| row.ends == rich.ends && row.roots.len() == 1)
            .map(|row| (row.at, row.roots[0]))
            .collect();
        let mut seeds = vec![span.least, span.greatest];
        if rich.roots.len() == 1 {
            let root = polynomial(&like, at);
            seeds.extend(pair(root).into_iter().filter(|seed| span.least < *seed && *seed < span.greatest));
        } else {
            seeds.extend_from_slice(columns);
        }
        return Row::new(seeds, None);
    }
    // The curve folds between the two: one of the richer row's roots is the poorer row's. Which one, the poorer row's
    // own neighbours tell. The rest moves along with it.
    let single: Vec<(f64, f64)> = done
        .iter()
        .filter(|row| row.ends == poor.ends && row.roots.len() == 1)
        .map(|row| (row.at, row.roots[0]))
        .collect();
    let nearest_two = nearest(&single, rich.at);
    let pointed = polynomial(&nearest_two, rich.at);
    let main = rich.roots.iter().copied().min_by(|x, y| (x - pointed).abs().total_cmp(&(y - pointed).abs()));
    let main = main.unwrap_or(pointed);
    let known = [(poor.at, poor.roots[0]), (rich.at, main)];
    let root = polynomial(&known, at);
    let shift = root - main;
    let mut seeds: Vec<f64> = pair(root).to_vec();
    for island in rich.roots.windows(2) {
        let middle = 0.5 * (island[0] + island[1]) + shift;
        seeds.push(middle);
    }
    seeds.extend(rich.roots.iter().filter(|other| **other != main).map(|other| other + shift));
    Row::new(seeds, Some(rich.ends))
}

/// The two of these points nearest to `at`.
fn nearest(points: &[(f64, f64)], at: f64) -> Vec<(f64, f64)> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| (a.0 - at).abs().total_cmp(&(b.0 - at).abs()));
    sorted.truncate(2);
    sorted
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
    use super::*;

    #[test]
    fn the_polynomial_goes_through_its_points_and_beyond() {
        let cube = |x: f64| x * x * x - 2.0 * x;
        let points: Vec<(f64, f64)> = [0.0, 1.0, 3.0, 4.0].map(|x| (x, cube(x))).to_vec();
        assert!((polynomial(&points, 2.0) - cube(2.0)).abs() < 1e-12);
        assert_eq!(polynomial(&points[1..2], 9.0), points[1].1);
    }
}

//! Rows in their order: the lattice first, then the rows between, each with the help of those that are done.

use super::row::{Row, Sample, Span};
use super::warm::{self, Done};
use super::{Evaluate, Search, Traced, TracedRow, Trial};

/// Rows that are worked on at once, in whole curves: bounds memory, and is plenty to fill lanes.
const ROWS_AT_ONCE: usize = 1 << 14;

/// The evaluator was told to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stopped;

/// Traces `curves` curves over these values of the first axis.
///
/// # Errors
/// [`Stopped`] when the evaluator was.
pub fn trace(
    evaluator: &dyn Evaluate,
    firsts: &[f64],
    curves: usize,
    search: &Search,
) -> Result<Traced, Stopped> {
    let mut traced = Traced { curves: Vec::with_capacity(curves), trials: 0, rounds: 0 };
    let at_once = (ROWS_AT_ONCE / firsts.len().max(1)).max(1);
    let mut begun = 0;
    while begun < curves {
        let end = (begun + at_once).min(curves);
        let mut block: Vec<Curve> = (begun..end).map(|_| Curve::new(firsts, search)).collect();
        loop {
            let mut trials = Vec::new();
            let mut owners = Vec::new();
            for (k, curve) in block.iter_mut().enumerate() {
                for (row, at) in curve.propose() {
                    let second = curve.value(at);
                    trials.push(Trial { curve: begun + k, first: firsts[row], second });
                    owners.push((k, row, at));
                }
            }
            if trials.is_empty() {
                break;
            }
            let distances = evaluator.evaluate(&trials).ok_or(Stopped)?;
            for ((k, row, at), distance) in owners.into_iter().zip(distances) {
                block[k].insert(row, Sample { at, distance: distance.filter(|d| !d.is_nan()) });
            }
            traced.trials += trials.len();
            traced.rounds += 1;
        }
        traced.curves.extend(block.into_iter().map(|curve| curve.finish(firsts)));
        begun = end;
    }
    Ok(traced)
}

/// One curve in the making.
struct Curve {
    search: Search,
    span: Span,
    /// Places of the rows along the first axis: values, or logarithms.
    places: Vec<f64>,
    /// Lattice of the second axis, as positions.
    columns: Vec<f64>,
    /// Rows by index, in the order of [`levels`].
    levels: Vec<Vec<usize>>,
    level: usize,
    rows: Vec<Option<Row>>,
}

impl Curve {
    fn new(firsts: &[f64], search: &Search) -> Self {
        let position = |value: f64, log: bool| if log { libm::log(value) } else { value };
        let places: Vec<f64> = firsts.iter().map(|first| position(*first, search.first_log)).collect();
        let [least, greatest] =
            [search.least, search.greatest].map(|value| position(value, search.second_log));
        let cells = search.lattice.max(1);
        let columns = (0..=cells).map(|k| match k {
            0 => least,
            k if k == cells => greatest,
            k => least + (greatest - least) * (k as f64 / cells as f64),
        });
        let mut order: Vec<usize> = (0..places.len()).collect();
        order.sort_by(|a, b| places[*a].total_cmp(&places[*b]));
        let levels: Vec<Vec<usize>> = levels(places.len(), cells)
            .into_iter()
            .map(|level| level.into_iter().map(|rank| order[rank]).collect())
            .collect();
        let mut curve = Self {
            search: *search,
            span: Span { least, greatest, tolerance: search.tolerance },
            columns: columns.collect(),
            rows: vec![None; places.len()],
            places,
            levels,
            level: 0,
        };
        for row in curve.levels.first().cloned().unwrap_or_default() {
            curve.rows[row] = Some(Row::new(curve.columns.clone(), None));
        }
        curve
    }

    /// The value of the second axis at a position.
    fn value(&self, at: f64) -> f64 {
        let value = if self.search.second_log { libm::exp(at) } else { at };
        // The ends are exact whatever the logarithm rounds to.
        if at <= self.span.least {
            self.search.least
        } else if at >= self.span.greatest {
            self.search.greatest
        } else {
            value
        }
    }

    /// Rows and positions to try next; nothing when the curve is done.
    fn propose(&mut self) -> Vec<(usize, f64)> {
        while let Some(level) = self.levels.get(self.level) {
            let mut trials = Vec::new();
            for &index in level {
                if let Some(row) = &mut self.rows[index] {
                    trials.extend(row.propose(&self.span).into_iter().map(|at| (index, at)));
                }
            }
            if !trials.is_empty() {
                return trials;
            }
            self.level += 1;
            self.begin_level();
        }
        Vec::new()
    }

    /// Starts the rows of the current level from those of the levels before.
    fn begin_level(&mut self) {
        let Some(level) = self.levels.get(self.level) else { return };
        let mut done: Vec<Done> = Vec::new();
        for (row, &at) in self.rows.iter().zip(&self.places) {
            if let Some(row) = row
                && let Some(ends) = row.ends()
            {
                done.push(Done { at, roots: row.roots(), ends });
            }
        }
        done.sort_by(|a, b| a.at.total_cmp(&b.at));
        for &index in level {
            self.rows[index] = Some(warm::start(self.places[index], &done, &self.span, &self.columns));
        }
    }

    fn insert(&mut self, row: usize, sample: Sample) {
        if let Some(row) = &mut self.rows[row] {
            row.insert(sample);
        }
    }

    fn finish(self, firsts: &[f64]) -> Vec<TracedRow> {
        let value = |at: f64| self.value(at);
        let rows = self.rows.iter().zip(firsts);
        rows.filter_map(|(row, &first)| {
            let row = row.as_ref()?;
            Some(TracedRow { first, edges: row.edges(&self.span, &value), trials: row.trials() })
        })
        .collect()
    }
}

/// Ranks of rows by level: the lattice's rows, evenly spread with both ends, then again and again the middle of every
/// gap.
fn levels(rows: usize, cells: usize) -> Vec<Vec<usize>> {
    let Some(last) = rows.checked_sub(1) else { return Vec::new() };
    let mut known: Vec<usize> = (0..=cells).map(|k| (k * last + cells / 2) / cells).collect();
    known.dedup();
    let mut levels = vec![known.clone()];
    loop {
        let middles: Vec<usize> = known
            .windows(2)
            .filter(|gap| gap[1] - gap[0] > 1)
            .map(|gap| gap[0] + (gap[1] - gap[0]) / 2)
            .collect();
        if middles.is_empty() {
            return levels;
        }
        known.extend(&middles);
        known.sort_unstable();
        levels.push(middles);
    }
}

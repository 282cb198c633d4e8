//! The lattice, and the order in which lines are traced.
//!
//! Lattice lines and columns are evenly spread over the axes, with both ends. The gaps between
//! lattice lines are bisected again and again, as cells are in adaptive marching squares (R. Shu,
//! C. Zhou and M. S. Kankanhalli, "Adaptive marching cubes", The Visual Computer 11:202-217, 1995).

use super::sample::Span;

/// The greatest number of lines on each side from which a line is predicted. Basis: two on each
/// side make a cubic; with one, `sweeps/fig12.toml` takes a third more trials. Doubling it predicts
/// through lines that are cells away, which takes a quarter more trials in that study.
const MAX_PARENTS: usize = 2;

/// A line along the second axis, in the order of the first.
#[derive(Clone, Debug)]
pub(super) struct PlannedLine {
    /// The value of the first axis, or its logarithm.
    pub position: f64,
    /// The index among the values of the first axis.
    pub value_index: usize,
    /// The ranks of the lines from which this line is predicted, to its left and to its right, the
    /// nearest first; none for a lattice line.
    pub parents: [Vec<usize>; 2],
}

impl PlannedLine {
    pub(super) fn is_lattice_line(&self) -> bool {
        self.parents[0].is_empty()
    }
}

/// Returns the columns of a lattice: evenly spread positions, with both ends.
pub(super) fn lattice_columns(span: &Span, cells: usize) -> Vec<f64> {
    let width = span.greatest - span.least;
    let mut columns: Vec<f64> =
        (0..cells).map(|k| span.least + width * (k as f64 / cells as f64)).collect();
    columns.push(span.greatest);
    columns
}

/// Returns the ranks of the lattice lines among `lines` lines: evenly spread, with both ends.
pub(super) fn lattice_ranks(lines: usize, cells: usize) -> Vec<usize> {
    let Some(last_rank) = lines.checked_sub(1) else { return Vec::new() };
    let mut ranks: Vec<usize> = (0..=cells).map(|k| (k * last_rank + cells / 2) / cells).collect();
    ranks.dedup();
    ranks
}

/// Plans the lines at these positions of the first axis: the lattice lines first, then repeatedly
/// the middle of every gap.
pub(super) fn plan_lines(positions: &[f64], cells: usize) -> Vec<PlannedLine> {
    let mut lines = Vec::with_capacity(positions.len());
    for (index, &position) in positions.iter().enumerate() {
        lines.push(PlannedLine { position, value_index: index, parents: Default::default() });
    }
    lines.sort_by(|a, b| a.position.total_cmp(&b.position));
    let mut planned_ranks = lattice_ranks(lines.len(), cells);
    loop {
        let mut middle_ranks = Vec::new();
        for right in 1..planned_ranks.len() {
            let rank_gap = planned_ranks[right] - planned_ranks[right - 1];
            if rank_gap > 1 {
                let middle = planned_ranks[right - 1] + rank_gap / 2;
                let left_parents =
                    planned_ranks[..right].iter().rev().take(MAX_PARENTS).copied().collect();
                let right_parents =
                    planned_ranks[right..].iter().take(MAX_PARENTS).copied().collect();
                lines[middle].parents = [left_parents, right_parents];
                middle_ranks.push(middle);
            }
        }
        if middle_ranks.is_empty() {
            return lines;
        }
        planned_ranks.extend(middle_ranks);
        planned_ranks.sort_unstable();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_is_planned_after_its_parents() {
        for count in 0..60 {
            for cells in 1..=12 {
                // In falling order: ranks are not indices.
                let positions: Vec<f64> = (0..count).rev().map(f64::from).collect();
                let lines = plan_lines(&positions, cells);
                let mut planned_flags = vec![false; lines.len()];
                for rank in lattice_ranks(lines.len(), cells) {
                    assert!(lines[rank].is_lattice_line());
                    planned_flags[rank] = true;
                }
                for _ in 0..lines.len() {
                    for rank in 0..lines.len() {
                        let parents = lines[rank].parents.concat();
                        planned_flags[rank] |= !parents.is_empty()
                            && parents.iter().all(|parent| planned_flags[*parent]);
                    }
                }
                assert!(planned_flags.iter().all(|is_planned| *is_planned), "{count} {cells}");
                assert!(lines.iter().all(|line| positions[line.value_index] == line.position));
            }
        }
    }

    #[test]
    fn columns_end_at_the_ends() {
        let span = Span { least: 0.1, greatest: 0.7, tolerance: 0.01 };
        let columns = lattice_columns(&span, 3);
        assert_eq!((columns[0], columns[3], columns.len()), (0.1, 0.7, 4));
    }
}

//! The trace of all lines: the lattice lines first, then each line between them as soon as the
//! lines from which it is predicted are traced. A line continues if neighbours disagree with it.
//!
//! Claim: if a rectangle is at least as large as a lattice cell along both axes, and all of it is
//! on one side, then every line through the rectangle has an interval of that side in it. The proof
//! is by induction over the order in which lines begin:
//!
//! - A line that is evaluated at the lattice's columns has a sample in the rectangle. Lattice lines
//!   are, and at least one of them passes the rectangle.
//! - Any other line has been predicted, and is on the predicted sides around every crossing. Its
//!   nearest parent towards that lattice line passes the rectangle too. So the parent shows the
//!   rectangle's side on an interval that spans the rectangle, because no crossing is inside. The
//!   sides around the interval's ends are predicted within a cell of the parent's: those around
//!   the lower end below the rectangle's top, those around the upper end above its bottom. Of each
//!   two the outer is on another side, so it is outside of the rectangle, and the crossing between
//!   the two is as well. So the interval between these crossings spans the rectangle.

use super::continuation::{DISPUTED_FRACTION, LinePair, Neighbour, PredictedSide, predict_sides};
use super::lattice::{PlannedLine, lattice_columns, plan_lines};
use super::line::LineSearch;
use super::lipschitz;
use super::sample::{LineSample, SideInterval, Span, coordinate};
use super::{BoundaryRow, BoundaryTrial, SearchRange, TracedBoundary};

/// The greatest number of lines that are traced at once, in whole curves. Basis: they take some ten
/// megabytes, and give trials enough to fill lanes. Doubling it doubles the memory.
const MAX_GROUP_LINES: usize = 1 << 14;
/// The greatest number of samples that a line takes because its neighbours disagree with it. Basis:
/// it makes the trace of any function end (test `the_search_of_noise_ends`). Doubling it doubles
/// the trials of noise.
const MAX_DISPUTED_SAMPLES: usize = 64;
/// The narrowest gap on a lattice line that is searched for pairs of roots, as a fraction of a
/// lattice cell. Basis: three bisections. Doubling it loses the folds of `sweeps/fig12.toml`.
const MIN_GAP_FRACTION: f64 = 0.125;

/// Traces `curves` curves over these values of the first axis. `evaluate` returns one signed
/// distance from the limit for each trial, in the same order: negative on the reliable side, `None`
/// where the quantity is not defined. Before every batch, `report_lines` receives the number of
/// lines that are traced; a later disagreement of neighbours can reduce that number.
///
/// # Errors
/// The error with which `evaluate` stopped.
pub fn trace_boundary<E>(
    evaluate: &dyn Fn(&[BoundaryTrial]) -> Result<Vec<Option<f64>>, E>,
    first_values: &[f64],
    curves: usize,
    search: &SearchRange,
    report_lines: &mut dyn FnMut(usize),
) -> Result<TracedBoundary, E> {
    let mut traced_boundary =
        TracedBoundary { rows_by_curve: Vec::with_capacity(curves), ..TracedBoundary::default() };
    let curves_at_once = (MAX_GROUP_LINES / first_values.len().max(1)).max(1);
    while traced_boundary.rows_by_curve.len() < curves {
        let first_curve = traced_boundary.rows_by_curve.len();
        let end_curve = (first_curve + curves_at_once).min(curves);
        let mut curve_group = CurveGroup::new(first_curve..end_curve, first_values, search);
        loop {
            let batch = curve_group.next_batch();
            if batch.is_empty() {
                break;
            }
            report_lines(first_curve * first_values.len() + curve_group.count_traced_lines());
            let trials: Vec<BoundaryTrial> = batch.iter().map(|request| request.trial).collect();
            let distances = evaluate(&trials)?;
            for (request, distance) in batch.iter().zip(distances) {
                curve_group.insert_distance(request, distance);
            }
            traced_boundary.trial_count += trials.len();
            traced_boundary.batch_count += 1;
        }
        traced_boundary.rows_by_curve.extend(curve_group.into_rows());
    }
    Ok(traced_boundary)
}

/// A trial, with the line that needs it: its curve within the block, its rank along the first axis,
/// and the position on it.
struct TrialRequest {
    trial: BoundaryTrial,
    curve: usize,
    rank: usize,
    position: f64,
}

/// Curves that are traced together.
struct CurveGroup<'a> {
    first_curve: usize,
    first_values: &'a [f64],
    search: SearchRange,
    span: Span,
    columns: Vec<f64>,
    /// The width of a lattice cell along the second axis.
    cell_width: f64,
    lines: Vec<PlannedLine>,
    /// The states of the lines, by curve and rank.
    curves: Vec<Vec<LineState>>,
}

/// The state of one line of a curve.
#[derive(Clone, Default)]
struct LineState {
    /// The search, once it has begun.
    search: Option<LineSearch>,
    /// The sides that the parents predict for the first samples, until they are compared with these
    /// samples.
    predicted_sides: Vec<PredictedSide>,
    /// The intervals of one side, while all brackets are narrow.
    intervals: Option<Vec<SideInterval>>,
    /// Whether the line needs no further samples, unless a neighbour disagrees.
    is_traced: bool,
    /// The number of samples taken because neighbours disagree.
    disputed_samples: usize,
}

impl<'a> CurveGroup<'a> {
    fn new(curves: std::ops::Range<usize>, first_values: &'a [f64], search: &SearchRange) -> Self {
        let span = search.span();
        let cells = search.lattice_cells.max(1);
        let positions: Vec<f64> =
            first_values.iter().map(|first| coordinate(*first, search.is_first_log)).collect();
        Self {
            first_curve: curves.start,
            first_values,
            search: *search,
            span,
            columns: lattice_columns(&span, cells),
            cell_width: (span.greatest - span.least) / cells as f64,
            lines: plan_lines(&positions, cells),
            curves: vec![vec![LineState::default(); first_values.len()]; curves.len()],
        }
    }

    /// Returns the trials of the next batch, in the order of their lines; none when all is traced.
    fn next_batch(&mut self) -> Vec<TrialRequest> {
        let mut requests = Vec::new();
        for curve in 0..self.curves.len() {
            for rank in 0..self.lines.len() {
                self.request_trials(curve, rank, &mut requests);
            }
            for rank in 0..self.lines.len() {
                if self.curves[curve][rank].search.is_none() && self.can_begin(curve, rank) {
                    self.begin_line(curve, rank);
                    self.request_trials(curve, rank, &mut requests);
                }
            }
            for (rank, positions) in self.find_disputes(curve) {
                let line_state = &mut self.curves[curve][rank];
                let Some(search) = &mut line_state.search else { continue };
                line_state.disputed_samples += positions.len();
                line_state.is_traced = false;
                search.request_samples(positions, &self.span);
                self.request_trials(curve, rank, &mut requests);
            }
        }
        requests
    }

    /// Adds the trials that a line needs next to the batch.
    fn request_trials(&mut self, curve: usize, rank: usize, batch: &mut Vec<TrialRequest>) {
        let first_value = self.first_values[self.lines[rank].value_index];
        for position in self.next_positions(curve, rank) {
            let second_value = self.search.value(position);
            let trial =
                BoundaryTrial { curve_index: self.first_curve + curve, first_value, second_value };
            batch.push(TrialRequest { trial, curve, rank, position });
        }
    }

    /// Returns the positions that a line needs next: those requested, the columns of the lattice if
    /// a prediction failed, steps in brackets, or else those of the search for pairs of roots.
    fn next_positions(&mut self, curve: usize, rank: usize) -> Vec<f64> {
        let span = self.span;
        let line_state = &mut self.curves[curve][rank];
        let Some(search) = line_state.search.as_mut().filter(|_| !line_state.is_traced) else {
            return Vec::new();
        };
        if !search.has_requests() {
            let predicted_sides = std::mem::take(&mut line_state.predicted_sides);
            if !predicted_sides.iter().all(|predicted_sides| search.confirms(predicted_sides)) {
                search.request_samples(self.columns.iter().copied(), &span);
            }
        }
        let positions = search.take_positions(&span);
        if !positions.is_empty() {
            line_state.intervals = None;
            return positions;
        }
        // Other lines begin from these intervals while the search for pairs of roots goes on.
        line_state.intervals = Some(search.side_intervals(&span));
        if self.lines[rank].is_lattice_line() {
            let min_gap = (MIN_GAP_FRACTION * self.cell_width).max(span.tolerance);
            search
                .request_samples(lipschitz::candidate_positions(search.samples(), min_gap), &span);
        }
        let positions = search.take_positions(&span);
        line_state.is_traced = positions.is_empty();
        positions
    }

    /// Returns whether all brackets are narrow on the parents of a line.
    fn can_begin(&self, curve: usize, rank: usize) -> bool {
        let mut parents = self.lines[rank].parents.iter().flatten();
        parents.all(|parent| self.neighbour(curve, *parent).is_some())
    }

    /// Begins a line: around the crossings that its parents predict, or else at the columns of the
    /// lattice.
    fn begin_line(&mut self, curve: usize, rank: usize) {
        let line = &self.lines[rank];
        let find_parents = |ranks: &Vec<usize>| {
            ranks.iter().filter_map(|rank| self.neighbour(curve, *rank)).collect()
        };
        let parents = line.parents.each_ref().map(find_parents);
        let mut search = LineSearch::default();
        let predicted = predict_sides(line.position, &parents, self.cell_width, &self.span);
        match &predicted {
            Some(sides) => {
                search.request_samples(sides.iter().map(|predicted| predicted.position), &self.span)
            }
            None => search.request_samples(self.columns.iter().copied(), &self.span),
        }
        let state = &mut self.curves[curve][rank];
        state.search = Some(search);
        state.predicted_sides = predicted.unwrap_or_default();
    }

    /// Returns a line for comparison with others, if all its brackets are narrow.
    fn neighbour(&self, curve: usize, rank: usize) -> Option<Neighbour<'_>> {
        let intervals = self.curves[curve].get(rank)?.intervals.as_ref()?;
        Some(Neighbour { position: self.lines[rank].position, intervals })
    }

    /// Returns, by rank, the positions that subdivide the intervals about which neighbours
    /// disagree.
    fn find_disputes(&self, curve: usize) -> Vec<(usize, Vec<f64>)> {
        let mut positions_by_rank = Vec::new();
        for (rank, state) in self.curves[curve].iter().enumerate() {
            if !state.is_traced || state.disputed_samples >= MAX_DISPUTED_SAMPLES {
                continue;
            }
            let Some(search) = &state.search else { continue };
            let Some(own_line) = self.neighbour(curve, rank) else { continue };
            let mut positions = Vec::new();
            for step in [-1, 1] {
                let neighbour_at = |offset| self.neighbour(curve, rank.checked_add_signed(offset)?);
                let Some(neighbour) = neighbour_at(step) else { continue };
                let pair = LinePair {
                    line: own_line,
                    neighbour,
                    second_neighbour: neighbour_at(2 * step),
                };
                for interval in pair.find_disputed_intervals(self.cell_width, &self.span) {
                    let width = interval[1] - interval[0];
                    let max_gap = DISPUTED_FRACTION * self.cell_width.min(width);
                    let max_gap = max_gap.max(0.5 * self.span.tolerance);
                    positions.extend(search.subdividing_positions(interval, max_gap, &self.span));
                }
            }
            if !positions.is_empty() {
                positions_by_rank.push((rank, positions));
            }
        }
        positions_by_rank
    }

    fn insert_distance(&mut self, request: &TrialRequest, distance: Option<f64>) {
        let distance = distance.filter(|distance| !distance.is_nan());
        if let Some(search) = &mut self.curves[request.curve][request.rank].search {
            search.insert_sample(LineSample { position: request.position, distance });
        }
    }

    fn count_traced_lines(&self) -> usize {
        self.curves.iter().flatten().filter(|state| state.is_traced).count()
    }

    /// Returns the traced rows of every curve, in the order of the first axis's values.
    fn into_rows(self) -> Vec<Vec<BoundaryRow>> {
        let axis_value = |position: f64| self.search.value(position);
        let mut ranks: Vec<usize> = (0..self.lines.len()).collect();
        ranks.sort_by_key(|rank| self.lines[*rank].value_index);
        let mut rows_by_curve = Vec::with_capacity(self.curves.len());
        for states in &self.curves {
            let mut rows = Vec::with_capacity(ranks.len());
            for &rank in &ranks {
                let Some(search) = &states[rank].search else { continue };
                rows.push(BoundaryRow {
                    first_value: self.first_values[self.lines[rank].value_index],
                    side_changes: search.side_changes(&self.span, &axis_value),
                    trial_count: search.samples().len(),
                });
            }
            rows_by_curve.push(rows);
        }
        rows_by_curve
    }
}

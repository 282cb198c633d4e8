//! The pool of threads: it batches runs of one model and refinement level, whichever rows they
//! belong to.
//!
//! A batch costs the same with one trajectory as with eight, because trajectories fill the lanes of
//! a vector. So runs of one level wait for each other, and a thread takes a batch as soon as one is
//! full. It takes the finest level first, so that rows that are nearly done leave the queue. Once
//! the source is empty, the threads share all runs of the coarsest level, because its rows may need
//! all finer levels. By a method that chooses steps for each trajectory, batches are larger and
//! begin with the longest trajectories: a lane that ends early continues with the next trajectory.
//!
//! A lane's numbers do not depend on the other lanes, so a row does not depend on its batch.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::mem::take;
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::Duration;

use lane_ode::Cancel;
use lane_ode::MAX_LANES;
use washer_model::{Method, Point, PointInput};
use washer_row::{LevelRun, NextStep, Outcome, RefinementRule, RowRefinement, Status};

use super::{ModelEngine, RunContext, growth};
use crate::plan::point_input;
use sweep_engine::RowSource;
use sweep_files::panics::lock;

/// Number of points that are prepared together. Basis: the searches for speed amplitudes of
/// friction take different numbers of runs, and with four points per lane the lanes of most runs
/// are full. Doubling it makes threads wait longer for the first runs.
const PREPARE_BATCH: usize = 4 * MAX_LANES;

/// Returns the number of runs by a method that a thread takes at once.
fn batch_size(method: &Method) -> usize {
    if method.kind.adapts_steps() { 4 * MAX_LANES } else { MAX_LANES }
}

impl ModelEngine<'_> {
    /// Returns the maximum number of rows that so many threads have under refinement at once. For
    /// each level of both models less than a batch waits, and each thread has one batch.
    pub(crate) fn max_rows_in_flight(&self, threads: usize) -> usize {
        let level_count: usize = self.levels().iter().map(|levels| 2 * levels.levels.len()).sum();
        (level_count + threads) * batch_size(&self.levels()[0].levels[0])
    }
}

/// Maximum age of a queued row, in rows queued after it. Older rows run in a batch that is not
/// full, so that chunks complete and an interrupt loses little. Doubling it halves the batches that
/// are not full.
const MAX_QUEUE_AGE: u64 = 2048;

/// A sink of rows, in no particular order.
pub(super) type OutcomeSink<'a> = dyn Fn(&Outcome) + Sync + 'a;

/// Time between two looks at the stop flag by a thread that waits for others. Basis: an interrupt
/// ends a run within a tenth of a second. Doubling it doubles that delay.
const STOP_POLL_INTERVAL: Duration = Duration::from_millis(50);

/// The kind of a run: its refinement level and its model's position in `ModelKind::ALL`.
type RunKind = (usize, usize);

/// A row under refinement.
struct RowTask {
    /// The caller's identifier.
    id: u64,
    /// The prepared point, or the reason why there is none.
    point: Result<Arc<Point>, Status>,
    refinement: RowRefinement,
    /// The runs that have returned since the last step, each with its model and its level.
    returned_runs: Vec<((usize, usize), LevelRun)>,
    /// The number of runs that were requested and have not returned.
    pending_runs: usize,
    /// The number of rows that were queued before this one.
    queue_sequence: u64,
}

impl RowTask {
    /// Returns the runs that the row needs next, or its outcome. No run may be pending.
    fn next_step(&mut self, rule: RefinementRule<'_>) -> NextStep {
        match &self.point {
            Ok(point) => {
                self.refinement.advance(take(&mut self.returned_runs), self.id, point, rule)
            }
            Err(status) => {
                let method = rule.levels[0].levels[0].kind;
                NextStep::Done(Box::new(Outcome { method, ..Outcome::failed(self.id, *status) }))
            }
        }
    }
}

/// Rows and the runs that they wait for.
#[derive(Default)]
pub(super) struct PoolState {
    /// Rows under refinement, by the caller's identifier.
    tasks: BTreeMap<u64, RowTask>,
    /// The number of rows that were queued so far: the points taken from the source.
    queued_rows: u64,
    /// The identifiers of the rows that wait for a run, by the kind of the run, oldest first.
    waiting_rows: BTreeMap<RunKind, Vec<u64>>,
    /// The number of threads at work on runs or points.
    busy_threads: usize,
    /// Whether the source is empty.
    is_source_empty: bool,
}

/// The next action of a thread.
enum ThreadAction {
    Prepare,
    Runs(RunKind, Vec<(u64, Arc<Point>)>),
    Wait,
    End,
}

/// The queue of rows that the threads share, with its source and sink.
pub(super) struct Pool<'a> {
    pub(super) engine: &'a ModelEngine<'a>,
    pub(super) source: &'a RowSource<'a>,
    pub(super) sink: &'a OutcomeSink<'a>,
    pub(super) context: &'a RunContext<'a>,
    /// The number of threads that call [`Self::run_worker`].
    pub(super) thread_count: usize,
    pub(super) state: Mutex<PoolState>,
    pub(super) state_changed: Condvar,
}

impl Pool<'_> {
    /// Works on one thread until nothing is left or the context is stopped.
    pub(super) fn run_worker(&self) {
        while !self.context.must_stop() {
            let mut state = self.lock_state();
            let full_batch_size = |(level, model): RunKind| {
                let batch_size_by_rule =
                    |rule: RefinementRule<'_>| batch_size(rule.levels[model].method(level));
                self.rule().map_or(MAX_LANES, batch_size_by_rule)
            };
            match state.choose_action(&full_batch_size, self.thread_count) {
                ThreadAction::End => break,
                ThreadAction::Wait => {
                    drop(self.state_changed.wait_timeout(state, STOP_POLL_INTERVAL))
                }
                ThreadAction::Prepare => {
                    state.busy_threads += 1;
                    drop(state);
                    let mut rows = self.prepare_rows();
                    let mut state = self.lock_state();
                    state.is_source_empty |= rows.is_empty();
                    for row in &mut rows {
                        row.queue_sequence = state.queued_rows;
                        state.queued_rows += 1;
                    }
                    self.advance_rows(state, rows);
                }
                ThreadAction::Runs((level, model), run_batch) => {
                    state.busy_threads += 1;
                    drop(state);
                    let Some(rule) = self.rule() else { break };
                    let levels = &rule.levels[model];
                    let original_points = || run_batch.iter().map(|(_, point)| point.as_ref());
                    let perturbed_points: Vec<Point> = match levels.is_perturbed(level) {
                        true => original_points().map(Point::perturbed).collect(),
                        false => Vec::new(),
                    };
                    let points: Vec<&Point> = match perturbed_points.is_empty() {
                        true => original_points().collect(),
                        false => perturbed_points.iter().collect(),
                    };
                    let runs = self.engine.integrate_runs(
                        model,
                        levels.method(level),
                        &points,
                        self.context,
                    );
                    // Runs of a stopped context may have ended early.
                    if self.context.must_stop() {
                        break;
                    }
                    let mut state = self.lock_state();
                    let mut rows = Vec::with_capacity(run_batch.len());
                    for ((row_id, _), run) in run_batch.iter().zip(runs) {
                        let Some(mut row) = state.tasks.remove(row_id) else { continue };
                        row.pending_runs -= 1;
                        row.returned_runs.push(((model, level), run));
                        rows.push(row);
                    }
                    self.advance_rows(state, rows);
                }
            }
        }
        self.state_changed.notify_all();
    }

    /// Returns the rule by which rows are refined; `None` if the context is stopped before the
    /// levels are found.
    fn rule(&self) -> Option<RefinementRule<'_>> {
        let ModelEngine { purpose, row_rule, .. } = self.engine;
        let levels = self.engine.levels_unless_stopped(self.context)?;
        Some(RefinementRule { levels, purpose: *purpose, row_rule })
    }

    fn lock_state(&self) -> MutexGuard<'_, PoolState> {
        lock(&self.state)
    }

    /// Prepares the next points of the source; none at its end.
    fn prepare_rows(&self) -> Vec<RowTask> {
        let rows = std::iter::from_fn(self.source).take(PREPARE_BATCH);
        let id_and_input =
            |(id, values): (u64, Vec<f64>)| (id, point_input(self.engine.plan, &values));
        let (ids, inputs): (Vec<u64>, Vec<PointInput>) = rows.map(id_and_input).unzip();
        let points = self.engine.prepare(&inputs);
        let new_task = |(id, point): (u64, Result<Point, Status>)| {
            let point = point.map(Arc::new);
            RowTask {
                id,
                point,
                refinement: RowRefinement::default(),
                returned_runs: Vec::new(),
                pending_runs: 0,
                queue_sequence: 0,
            }
        };
        ids.into_iter().zip(points).map(new_task).collect()
    }

    /// Queues the next runs of rows, and gives the sink those that are done.
    fn advance_rows(&self, mut state: MutexGuard<'_, PoolState>, rows: Vec<RowTask>) {
        let mut finished_rows = Vec::new();
        for mut row in rows {
            let next_step = if row.pending_runs > 0 {
                NextStep::Runs(Vec::new())
            } else {
                // Rows of a stopped run are dropped.
                let Some(rule) = self.rule() else { break };
                row.next_step(rule)
            };
            match next_step {
                NextStep::Runs(run_kinds) => {
                    let row_id = row.id;
                    row.pending_runs += run_kinds.len();
                    for (model, level) in run_kinds {
                        state.waiting_rows.entry((level, model)).or_default().push(row_id);
                    }
                    state.tasks.insert(row_id, row);
                }
                NextStep::Done(outcome) => finished_rows.push((*outcome, row.point)),
            }
        }
        state.busy_threads -= 1;
        drop(state);
        self.state_changed.notify_all();
        let model = &self.engine.plan.model;
        if let Some(speeds) = &model.held_speeds {
            let is_stopped = || self.context.must_stop();
            let metrics = (speeds.values(), model.measures.metrics.as_slice());
            let mut rows: Vec<_> = finished_rows
                .iter_mut()
                .filter_map(|(outcome, point)| point.as_deref().ok().map(|point| (outcome, point)))
                .collect();
            let simd = self.engine.widest_simd();
            growth::add_held_speed_metrics(&mut rows, simd, metrics, Cancel::When(&is_stopped));
            if is_stopped() {
                return;
            }
        }
        finished_rows.iter().for_each(|(outcome, _)| (self.sink)(outcome));
    }
}

impl PoolState {
    /// Chooses the next action of one of `threads` threads. `full_batch_size` returns the number of
    /// runs of a full batch of a kind.
    fn choose_action(
        &mut self,
        full_batch_size: &dyn Fn(RunKind) -> usize,
        threads: usize,
    ) -> ThreadAction {
        if !self.is_source_empty {
            let is_batch_full = |(kind, waiting_ids): &(&RunKind, &Vec<u64>)| {
                waiting_ids.len() >= full_batch_size(**kind)
            };
            let finest_kind = self.waiting_rows.iter().rfind(is_batch_full).map(|(kind, _)| *kind);
            return match finest_kind.or_else(|| self.find_overdue_kind()) {
                Some(kind) => self.take_batch(kind, full_batch_size(kind)),
                None => ThreadAction::Prepare,
            };
        }
        let coarsest_runs =
            self.waiting_rows.iter().find(|(_, waiting_ids)| !waiting_ids.is_empty());
        match coarsest_runs.map(|(kind, waiting_ids)| (*kind, waiting_ids.len())) {
            // Each thread takes its share, so that none waits for the last batch of another.
            Some((kind, waiting_count)) => {
                self.take_batch(kind, waiting_count.div_ceil(threads).max(MAX_LANES))
            }
            None if self.busy_threads == 0 => ThreadAction::End,
            None => ThreadAction::Wait,
        }
    }

    /// Returns the kind of runs that a row has waited for too long, if any.
    fn find_overdue_kind(&self) -> Option<RunKind> {
        let min_sequence = self.queued_rows.checked_sub(MAX_QUEUE_AGE)?;
        let is_overdue =
            |id: &u64| self.tasks.get(id).is_some_and(|row| row.queue_sequence < min_sequence);
        let mut waiting_by_kind = self.waiting_rows.iter();
        let finest_runs =
            waiting_by_kind.rfind(|(_, waiting_ids)| waiting_ids.first().is_some_and(is_overdue));
        finest_runs.map(|(kind, _)| *kind)
    }

    /// Takes a batch of the rows that wait first, the longest trajectories first.
    fn take_batch(&mut self, kind: RunKind, max_count: usize) -> ThreadAction {
        let waiting_ids = self.waiting_rows.entry(kind).or_default();
        let mut row_ids: Vec<u64> = waiting_ids.drain(..waiting_ids.len().min(max_count)).collect();
        let step_count = |id: &u64| self.tasks.get(id).map(|row| row.refinement.steps(kind.1));
        row_ids.sort_by_key(|id| Reverse(step_count(id)));
        let id_and_point =
            |row_id: &u64| Some((*row_id, self.tasks.get(row_id)?.point.clone().ok()?));
        ThreadAction::Runs(kind, row_ids.iter().filter_map(id_and_point).collect())
    }
}

//! The pool of threads: it batches runs of one model and refinement level, whichever rows they
//! belong to.
//!
//! A batch costs the same with one trajectory as with eight, because trajectories fill the lanes of
//! a vector. So runs of one level wait for each other, and a thread takes a batch as soon as one is
//! full. It takes the finest level first, so that rows that are nearly done leave the queue. Once
//! the source is empty, batches that are not full are taken, too, the coarsest level first, because
//! its rows may need all finer levels. By a method that chooses steps for each trajectory, batches
//! are larger and begin with the longest trajectories: a lane that ends early continues with the
//! next trajectory.
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
        let levels: usize = self.levels().iter().map(|levels| 2 * levels.levels.len()).sum();
        (levels + threads) * batch_size(&self.levels()[0].levels[0])
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
    runs: Vec<((usize, usize), LevelRun)>,
    /// The number of runs that were requested and have not returned.
    pending: usize,
    /// The number of rows queued before it.
    sequence: u64,
}

impl RowTask {
    /// Returns the runs that the row needs next, or its outcome. No run may be pending.
    fn next(&mut self, rule: RefinementRule<'_>) -> NextStep {
        match &self.point {
            Ok(point) => self.refinement.advance(take(&mut self.runs), self.id, point, rule),
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
    rows: BTreeMap<u64, RowTask>,
    /// The number of points taken from the source.
    queued: u64,
    /// Rows that wait for a run, by its kind.
    waiting: BTreeMap<RunKind, Vec<u64>>,
    /// The number of threads at work on runs or points.
    busy_threads: usize,
    /// Whether the source is empty.
    is_source_empty: bool,
}

/// The next work of a thread.
enum Work {
    Prepare,
    Runs(RunKind, Vec<(u64, Arc<Point>)>),
    Wait,
    End,
}

/// The threads' shared work.
pub(super) struct Pool<'a> {
    pub(super) engine: &'a ModelEngine<'a>,
    pub(super) source: &'a RowSource<'a>,
    pub(super) sink: &'a OutcomeSink<'a>,
    pub(super) context: &'a RunContext<'a>,
    /// The number of threads that call [`Self::work`].
    pub(super) threads: usize,
    pub(super) state: Mutex<PoolState>,
    pub(super) changed: Condvar,
}

impl Pool<'_> {
    /// Works on one thread until nothing is left or the context is stopped.
    pub(super) fn work(&self) {
        while !self.context.must_stop() {
            let mut state = self.lock();
            let size_of_kind = |(level, model): RunKind| {
                let size = |rule: RefinementRule<'_>| batch_size(rule.levels[model].method(level));
                self.rule().map_or(MAX_LANES, size)
            };
            match state.choose(&size_of_kind, self.threads) {
                Work::End => break,
                Work::Wait => drop(self.changed.wait_timeout(state, STOP_POLL_INTERVAL)),
                Work::Prepare => {
                    state.busy_threads += 1;
                    drop(state);
                    let mut rows = self.prepare_rows();
                    let mut state = self.lock();
                    state.is_source_empty |= rows.is_empty();
                    for row in &mut rows {
                        row.sequence = state.queued;
                        state.queued += 1;
                    }
                    self.advance(state, rows);
                }
                Work::Runs((level, model), taken) => {
                    state.busy_threads += 1;
                    drop(state);
                    let Some(rule) = self.rule() else { break };
                    let levels = &rule.levels[model];
                    let originals = || taken.iter().map(|(_, point)| point.as_ref());
                    let perturbed: Vec<Point> = match levels.is_perturbed(level) {
                        true => originals().map(Point::perturbed).collect(),
                        false => Vec::new(),
                    };
                    let points: Vec<&Point> = match perturbed.is_empty() {
                        true => originals().collect(),
                        false => perturbed.iter().collect(),
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
                    let mut state = self.lock();
                    let mut rows = Vec::with_capacity(taken.len());
                    for ((position, _), run) in taken.iter().zip(runs) {
                        let Some(mut row) = state.rows.remove(position) else { continue };
                        row.pending -= 1;
                        row.runs.push(((model, level), run));
                        rows.push(row);
                    }
                    self.advance(state, rows);
                }
            }
        }
        self.changed.notify_all();
    }

    /// Returns the rule by which rows are refined; `None` if the context is stopped before the
    /// levels are found.
    fn rule(&self) -> Option<RefinementRule<'_>> {
        let ModelEngine { demand, rule, .. } = self.engine;
        let levels = self.engine.levels_unless_stopped(self.context)?;
        Some(RefinementRule { levels, purpose: *demand, row_rule: rule })
    }

    fn lock(&self) -> MutexGuard<'_, PoolState> {
        lock(&self.state)
    }

    /// Prepares the next points of the source; none at its end.
    fn prepare_rows(&self) -> Vec<RowTask> {
        let rows = std::iter::from_fn(self.source).take(PREPARE_BATCH);
        let input = |(id, values): (u64, Vec<f64>)| (id, point_input(self.engine.plan, &values));
        let (ids, inputs): (Vec<u64>, Vec<PointInput>) = rows.map(input).unzip();
        let points = self.engine.prepare(&inputs);
        let row = |(id, point): (u64, Result<Point, Status>)| {
            let point = point.map(Arc::new);
            RowTask {
                id,
                point,
                refinement: RowRefinement::default(),
                runs: Vec::new(),
                pending: 0,
                sequence: 0,
            }
        };
        ids.into_iter().zip(points).map(row).collect()
    }

    /// Queues the next runs of rows, and gives the sink those that are done.
    fn advance(&self, mut state: MutexGuard<'_, PoolState>, rows: Vec<RowTask>) {
        let mut done = Vec::new();
        for mut row in rows {
            let next = if row.pending > 0 {
                NextStep::Runs(Vec::new())
            } else {
                // Rows of a stopped run are dropped.
                let Some(rule) = self.rule() else { break };
                row.next(rule)
            };
            match next {
                NextStep::Runs(kinds) => {
                    let position = row.id;
                    row.pending += kinds.len();
                    for (model, level) in kinds {
                        state.waiting.entry((level, model)).or_default().push(position);
                    }
                    state.rows.insert(position, row);
                }
                NextStep::Done(outcome) => done.push((*outcome, row.point)),
            }
        }
        state.busy_threads -= 1;
        drop(state);
        self.changed.notify_all();
        let model = &self.engine.plan.model;
        if let Some(speeds) = &model.held_speeds {
            let is_stopped = || self.context.must_stop();
            let metrics = (speeds.values(), model.measures.metrics.as_slice());
            let mut rows: Vec<_> = done
                .iter_mut()
                .filter_map(|(outcome, point)| point.as_deref().ok().map(|point| (outcome, point)))
                .collect();
            let simd = self.engine.widest_simd();
            growth::add_held_speed_metrics(&mut rows, simd, metrics, Cancel::When(&is_stopped));
            if is_stopped() {
                return;
            }
        }
        done.iter().for_each(|(outcome, _)| (self.sink)(outcome));
    }
}

impl PoolState {
    /// Chooses the next work of one of `threads` threads. `size` returns the size of a full batch
    /// of a kind.
    fn choose(&mut self, size: &dyn Fn(RunKind) -> usize, threads: usize) -> Work {
        let is_full = |(kind, waiting): &(&RunKind, &Vec<u64>)| waiting.len() >= size(**kind);
        let finest = self.waiting.iter().rfind(is_full).map(|(kind, _)| *kind);
        if let Some(kind) = finest.or_else(|| self.overdue()) {
            return self.take(kind, size(kind));
        }
        if !self.is_source_empty {
            return Work::Prepare;
        }
        let coarsest = self.waiting.iter().find(|(_, waiting)| !waiting.is_empty());
        match coarsest.map(|(kind, waiting)| (*kind, waiting.len())) {
            // Each thread takes its share, so that none waits for the last batch of another.
            Some((kind, count)) => self.take(kind, count.div_ceil(threads).max(MAX_LANES)),
            None if self.busy_threads == 0 => Work::End,
            None => Work::Wait,
        }
    }

    /// Returns the kind of runs that a row has waited for too long, if any.
    fn overdue(&self) -> Option<RunKind> {
        let latest = self.queued.checked_sub(MAX_QUEUE_AGE)?;
        let is_overdue = |id: &u64| self.rows.get(id).is_some_and(|row| row.sequence < latest);
        let mut waiting = self.waiting.iter();
        let finest = waiting.rfind(|(_, waiting)| waiting.first().is_some_and(is_overdue));
        finest.map(|(kind, _)| *kind)
    }

    /// Takes a batch of the rows that wait first, the longest trajectories first.
    fn take(&mut self, kind: RunKind, most: usize) -> Work {
        let waiting = self.waiting.entry(kind).or_default();
        let mut positions: Vec<u64> = waiting.drain(..waiting.len().min(most)).collect();
        let steps = |id: &u64| self.rows.get(id).map(|row| row.refinement.steps(kind.1));
        positions.sort_by_key(|id| Reverse(steps(id)));
        let point =
            |position: &u64| Some((*position, self.rows.get(position)?.point.clone().ok()?));
        Work::Runs(kind, positions.iter().filter_map(point).collect())
    }
}

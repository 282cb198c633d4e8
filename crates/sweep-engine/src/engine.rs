//! The interface between an evaluator and its run: rows come from a source, results go to a sink,
//! and a context carries cancellation, progress and known rows.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::interrupt::Interrupt;
use crate::store::PointRows;
use sweep_files::panics::{into_content, lock};

/// A source of rows: returns a row's number and the values of the plan's axes there.
pub type RowSource<'a> = dyn Fn() -> Option<(u64, Vec<f64>)> + Sync + 'a;

/// A sink of evaluated rows.
pub type RowSink<'a> = dyn Fn(PointRows) + Sync + 'a;

/// A lookup of a row that was evaluated before.
pub type RowLookup<'a> = dyn Fn(u64) -> Option<PointRows> + Sync + 'a;

/// An evaluator of the rows of a plan.
pub trait Evaluator: Sync {
    /// Evaluates rows until the source is empty, on the grid or between its points, and passes each
    /// result to the sink, in any order. Leaves rows unevaluated only if [`RunContext::must_stop`]
    /// holds. Works on all threads of the rayon pool that it is called in, and calls source and
    /// sink from any of them.
    ///
    /// A row that fails, even by a panic, is a result. A panic that leaves this function loses all
    /// rows that have left the source and not reached the sink.
    fn evaluate(&self, source: &RowSource<'_>, sink: &RowSink<'_>, context: &RunContext<'_>);
}

/// Evaluates points, each given by the values of the plan's axes, on the grid or between its
/// points. Returns the results in the order of the points, numbered from 0; `None` if the context
/// stopped the work.
pub fn evaluate_points(
    evaluator: &dyn Evaluator,
    axis_values: &[Vec<f64>],
    context: &RunContext<'_>,
) -> Option<Vec<PointRows>> {
    let point_queue = Mutex::new(axis_values.iter().enumerate());
    let point_source =
        || lock(&point_queue).next().map(|(point, values)| (point as u64, values.clone()));
    let rows_by_point = Mutex::new(Vec::with_capacity(axis_values.len()));
    let row_sink = |result: PointRows| lock(&rows_by_point).push(result);
    evaluator.evaluate(&point_source, &row_sink, context);
    let mut rows_by_point = into_content(rows_by_point);
    rows_by_point.sort_by_key(|result| result.point);
    (rows_by_point.len() == axis_values.len()).then_some(rows_by_point)
}

/// An evaluator with the facts that a run needs of it.
pub struct Engine<'a> {
    /// The evaluator.
    pub evaluator: Box<dyn Evaluator + 'a>,
    /// The name of the instruction set in use.
    pub simd: &'static str,
    /// Whether consecutive rows share work. If so, the source yields points in the grid's order;
    /// otherwise it yields chunks that are far apart.
    pub shares_work_of_rows: bool,
    /// The function that returns the reason, in words, why a point of the grid fails; `None` if the
    /// reason is not known.
    pub failure_reason: Box<dyn Fn(u64) -> Option<String> + Sync + 'a>,
}

impl<'a> Engine<'a> {
    /// Creates an engine of an evaluator whose rows share no work.
    pub fn new(evaluator: impl Evaluator + 'a, simd: &'static str) -> Self {
        Self {
            evaluator: Box::new(evaluator),
            simd,
            shares_work_of_rows: false,
            failure_reason: Box::new(|_| None),
        }
    }
}

/// The state of a run that an engine shares with its caller.
pub struct RunContext<'a> {
    interrupt: &'a Interrupt,
    /// The flag that is set if a result cannot be stored, because later results could not be stored
    /// either.
    is_aborted: AtomicBool,
    points_done: AtomicU64,
    is_late: Option<&'a (dyn Fn() -> bool + Sync)>,
    row_lookup: Option<&'a RowLookup<'a>>,
}

impl<'a> RunContext<'a> {
    /// Creates a context without known rows or a time limit.
    pub const fn new(interrupt: &'a Interrupt) -> Self {
        Self {
            interrupt,
            is_aborted: AtomicBool::new(false),
            points_done: AtomicU64::new(0),
            is_late: None,
            row_lookup: None,
        }
    }

    /// Creates a context with the rows that earlier processes have stored.
    pub const fn with_known_rows(interrupt: &'a Interrupt, row_lookup: &'a RowLookup<'a>) -> Self {
        Self { row_lookup: Some(row_lookup), ..Self::new(interrupt) }
    }

    /// Creates a context that stops the engine once `is_late` returns true.
    pub const fn with_time_limit(
        interrupt: &'a Interrupt,
        is_late: &'a (dyn Fn() -> bool + Sync),
    ) -> Self {
        Self { is_late: Some(is_late), ..Self::new(interrupt) }
    }

    /// Returns a row that any process has stored.
    pub fn find_known_row(&self, row: u64) -> Option<PointRows> {
        self.row_lookup.and_then(|look_up| look_up(row))
    }

    /// Adds to the number of points done, which progress shows.
    pub fn add_points(&self, points: u64) {
        self.points_done.fetch_add(points, Ordering::Relaxed);
    }

    /// Returns the number of points done.
    pub fn points_done(&self) -> u64 {
        self.points_done.load(Ordering::Relaxed)
    }

    /// Stops the engine.
    pub fn abort(&self) {
        self.is_aborted.store(true, Ordering::Relaxed);
    }

    /// Returns whether the engine has to stop.
    pub fn must_stop(&self) -> bool {
        self.interrupt.is_raised()
            || self.is_aborted.load(Ordering::Relaxed)
            || self.is_late.is_some_and(|is_late| is_late())
    }
}

/// Results in incomplete groups, by the group's number.
#[derive(Debug, Default)]
pub struct IncompleteGroups(pub Mutex<BTreeMap<u64, Vec<PointRows>>>);

impl IncompleteGroups {
    /// Adds a result to a group of `size` results. Returns the group's results, sorted by point, if
    /// that completes it.
    pub fn add_result(&self, group: u64, size: u64, result: PointRows) -> Option<Vec<PointRows>> {
        let mut incomplete_groups = lock(&self.0);
        let results = incomplete_groups.entry(group).or_default();
        results.push(result);
        if (results.len() as u64) < size {
            return None;
        }
        let mut complete_group = incomplete_groups.remove(&group)?;
        drop(incomplete_groups);
        complete_group.sort_by_key(|result| result.point);
        Some(complete_group)
    }
}

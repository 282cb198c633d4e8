//! Points through the engine, into rows in memory.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex};

use arrow_array::RecordBatch;
use arrow_schema::{ArrowError, SchemaRef};
use once_cell::sync::OnceCell;
use serde_json::json;

use super::Effort;
use super::points::PointTable;
use super::result::MemoryTable;
use super::run::Task;
use crate::engine::ModelEngine;
use crate::plan::Plan;
use sweep_engine::store::{BATCH_ROWS, Done, Layout, ResultRows};
use sweep_engine::watch::IncompleteGroups;
use sweep_engine::{Error, Job, Progress, RunContext, StoreError, threads};
use sweep_files::panics::{self, lock};
use washer_row::RefinementLevels;

/// A plan that is evaluated any number of times. The steps of its method are found once.
pub struct Evaluator {
    plan: Plan,
    levels: Arc<OnceCell<[RefinementLevels; 2]>>,
}

impl Evaluator {
    /// An evaluator of this plan.
    pub fn new(plan: Plan) -> Self {
        Self { plan, levels: Arc::default() }
    }

    /// The plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Evaluates points of a table. A row is the same, bit for bit, whatever the other rows are,
    /// and the same as that of a run of the plan which has this point.
    ///
    /// Beside table and result, memory holds some thousand rows.
    ///
    /// # Errors
    /// Columns or values that do not fit the plan's axes; no threads; `SWEEP_SIMD` naming nothing
    /// this machine has.
    pub fn evaluate(&self, table: &PointTable, effort: Effort<'_>) -> Result<MemoryTable, Error> {
        let points = table.on(&self.plan)?;
        let mut job = Job::of(&self.plan);
        job.points = table.rows() as u64;
        job.plan["design"] = json!({
            "method": "table", "points": job.points, "hash": points.hash(),
        });
        job.axis_values = Box::new(|point| points.axis_values(point));
        self.task(job)?.in_memory(effort)
    }

    /// Every point of the plan.
    ///
    /// # Errors
    /// `SWEEP_SIMD` naming nothing this machine has.
    pub fn whole(&self) -> Result<Task<'_>, Error> {
        self.task(Job::of(&self.plan))
    }

    fn task<'a>(&'a self, job: Job<'a>) -> Result<Task<'a>, Error> {
        let mut engine = ModelEngine::new(&self.plan)?;
        engine.levels = Arc::clone(&self.levels);
        Ok(Task { job, engine: Box::new(engine) })
    }
}

impl Task<'_> {
    /// Every row, in memory.
    ///
    /// # Errors
    /// No threads, and a panic of the engine.
    pub fn in_memory(&self, effort: Effort<'_>) -> Result<MemoryTable, Error> {
        let Self { job, engine } = self;
        let pool = threads::pool(effort.threads()?)?;
        let watch = RunContext::new(effort.interrupt);
        let rows = Mutex::new(0..job.points);
        let next = || {
            let row = if watch.stopped() { None } else { lock(&rows).next() }?;
            Some((row, (job.axis_values)(row)))
        };
        // Of this program.
        let last = job.points.saturating_sub(1);
        let defect = |reason| StoreError::Engine { first: 0, last, reason };
        let gathered = Gathered::new(job);
        let progress = Progress::new(effort.progress, job.points, 0);
        let keep = |outcome| {
            gathered.keep(outcome, &watch);
            progress.show(watch.points_done());
        };
        let evaluate = || pool.install(|| engine.evaluate(&next, &keep, &watch));
        let evaluated = catch_unwind(AssertUnwindSafe(evaluate));
        progress.finish();
        evaluated.map_err(|panic| {
            defect(format!("the engine panicked: {}", panics::text(panic.as_ref())))
        })?;
        let is_whole = watch.points_done() == job.points;
        let batches = gathered.into_batches().map_err(|error| defect(error.to_string()))?;
        Ok(MemoryTable::of_rows(job, batches, is_whole))
    }
}

/// Outcomes as they come, and the batches that are whole.
struct Gathered<'a> {
    job: &'a Job<'a>,
    /// The schema of every batch.
    schema: SchemaRef,
    parts: IncompleteGroups,
    batches: Mutex<BTreeMap<u64, Result<RecordBatch, ArrowError>>>,
}

impl<'a> Gathered<'a> {
    fn new(job: &'a Job<'a>) -> Self {
        let schema = job.layout.schema();
        Self { job, schema, parts: IncompleteGroups::default(), batches: Mutex::default() }
    }

    fn keep(&self, outcome: Done, watch: &RunContext<'_>) {
        const ROWS: u64 = BATCH_ROWS as u64;
        let place = outcome.point / ROWS;
        let wanted = ROWS.min(self.job.points - place * ROWS);
        if let Some(outcomes) = self.parts.add(place, wanted, outcome) {
            let batch = self.batch(outcomes);
            lock(&self.batches).insert(place, batch);
        }
        watch.add_points(1);
    }

    fn batch(&self, mut outcomes: Vec<Done>) -> Result<RecordBatch, ArrowError> {
        outcomes.sort_by_key(|outcome| outcome.point);
        let layout: &Layout = &self.job.layout;
        let mut rows = ResultRows::sharing(layout, SchemaRef::clone(&self.schema));
        for done in outcomes {
            for row in done.rows {
                rows.push(done.point, (self.job.axis_values)(done.point), row);
            }
        }
        rows.take()
    }

    /// All batches in order, of what is there.
    fn into_batches(self) -> Result<Vec<RecordBatch>, ArrowError> {
        let parts = std::mem::take(&mut *lock(&self.parts.0));
        let mut batches = std::mem::take(&mut *lock(&self.batches));
        for (place, outcomes) in parts {
            batches.insert(place, self.batch(outcomes));
        }
        batches.into_values().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::GridInput;
    use sweep_engine::interrupt::Interrupt;
    use sweep_engine::progress::ProgressMode;

    #[test]
    fn batches_share_their_schema() {
        let text = "spin = { profile = \"ramp\", peak_rpm = 300, ramp_s = 0.01 }\n\
             time = { end_s = 0.01 }\nintegrator = { method = \"rk4\", step_s = 2e-4 }\n\
             [[axis]]\nparameter = \"unbalance_mass_kg\"\n\
             range = { from = 0.1, to = 0.9, count = 4097 }\n";
        let grid = GridInput::text("grid", text.to_owned(), Vec::new());
        let evaluator = Evaluator::new(grid.load().unwrap());
        let interrupt = Interrupt::new();
        let effort =
            Effort { threads: Some(2), progress: ProgressMode::None, interrupt: &interrupt };
        let found = evaluator.whole().unwrap().in_memory(effort).unwrap();
        let [first, second] = found.batches() else { panic!("{found:?}") };
        assert_eq!([first.num_rows(), second.num_rows()], [BATCH_ROWS, 1]);
        assert!(Arc::ptr_eq(&first.schema(), &second.schema()));
    }
}

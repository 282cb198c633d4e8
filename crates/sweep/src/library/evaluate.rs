//! Evaluation of points, whose rows are returned in memory.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex};

use arrow_array::RecordBatch;
use arrow_schema::{ArrowError, SchemaRef};
use once_cell::sync::OnceCell;
use serde_json::json;

use super::Execution;
use super::points::PointTable;
use super::result::MemoryTable;
use super::run::EvaluationTask;
use crate::engine::ModelEngine;
use crate::plan::Plan;
use sweep_engine::engine::IncompleteGroups;
use sweep_engine::store::{BATCH_ROWS, BatchBuilder, Layout, PointRows};
use sweep_engine::{Error, Job, Progress, RunContext, StoreError, threads};
use sweep_files::panics::{self, lock};
use washer_row::RefinementLevels;

/// An evaluator of a plan's points. The refinement levels of the plan's method are determined once,
/// for all evaluations.
pub struct PlanEvaluator {
    plan: Plan,
    levels: Arc<OnceCell<[RefinementLevels; 2]>>,
}

impl PlanEvaluator {
    /// Returns an evaluator of a plan.
    pub fn new(plan: Plan) -> Self {
        Self { plan, levels: Arc::default() }
    }

    /// Returns the plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Evaluates the points of a table. The bits of a row do not depend on the other rows; they are
    /// those of a run of the plan with this point.
    ///
    /// Some thousand rows are in memory in addition to the table and the result.
    ///
    /// # Errors
    ///
    /// Returns an error if columns or values do not fit the plan's axes, if no threads can be
    /// started, and if `SWEEP_SIMD` names no instruction set of this processor.
    pub fn evaluate(
        &self,
        table: &PointTable,
        execution: Execution<'_>,
    ) -> Result<MemoryTable, Error> {
        let points = table.assign_to_axes(&self.plan)?;
        let mut job = Job::new(&self.plan);
        job.points = table.rows() as u64;
        job.plan["design"] = json!({
            "method": "table", "points": job.points, "hash": points.hash(),
        });
        job.axis_values = Box::new(|point| points.axis_values(point));
        self.run_task(job)?.compute_in_memory(execution)
    }

    /// Returns the task to compute all points of the plan.
    ///
    /// # Errors
    /// Returns an error if `SWEEP_SIMD` names no instruction set of this processor.
    pub fn task_for_all_points(&self) -> Result<EvaluationTask<'_>, Error> {
        self.run_task(Job::new(&self.plan))
    }

    fn run_task<'a>(&'a self, job: Job<'a>) -> Result<EvaluationTask<'a>, Error> {
        let mut engine = ModelEngine::new(&self.plan)?;
        engine.levels = Arc::clone(&self.levels);
        Ok(EvaluationTask { job, engine: engine.into_engine() })
    }
}

impl EvaluationTask<'_> {
    /// Computes all rows in memory.
    ///
    /// # Errors
    /// Returns an error if no threads can be started, and if the engine panics.
    pub fn compute_in_memory(&self, execution: Execution<'_>) -> Result<MemoryTable, Error> {
        let Self { job, engine } = self;
        let pool = threads::build_pool(execution.threads()?)?;
        let context = RunContext::new(execution.interrupt);
        let rows = Mutex::new(0..job.points);
        let source = || {
            let row = if context.must_stop() { None } else { lock(&rows).next() }?;
            Some((row, (job.axis_values)(row)))
        };
        let last_row = job.points.saturating_sub(1);
        // A panic is a defect of this program.
        let engine_error = |reason| StoreError::Engine { first: 0, last: last_row, reason };
        let collector = BatchCollector::new(job);
        let progress = Progress::new(execution.progress, job.points, 0);
        let sink = |outcome| {
            collector.add(outcome, &context);
            progress.show(context.points_done());
        };
        let evaluate = || pool.install(|| engine.evaluator.evaluate(&source, &sink, &context));
        let evaluation_result = catch_unwind(AssertUnwindSafe(evaluate));
        progress.finish();
        evaluation_result.map_err(|panic| {
            engine_error(format!("the engine panicked: {}", panics::panic_message(panic.as_ref())))
        })?;
        let is_complete = context.points_done() == job.points;
        let batches = collector.into_batches().map_err(|error| engine_error(error.to_string()))?;
        Ok(MemoryTable::from_rows(job, batches, is_complete))
    }
}

/// A collector of rows, which arrive in any order, into batches in order.
struct BatchCollector<'a> {
    job: &'a Job<'a>,
    /// The schema of every batch.
    schema: SchemaRef,
    incomplete_batches: IncompleteGroups,
    batches: Mutex<BTreeMap<u64, Result<RecordBatch, ArrowError>>>,
}

impl<'a> BatchCollector<'a> {
    fn new(job: &'a Job<'a>) -> Self {
        let schema = job.layout.schema();
        Self {
            job,
            schema,
            incomplete_batches: IncompleteGroups::default(),
            batches: Mutex::default(),
        }
    }

    /// Adds a row, and completes its batch if the row is the last one.
    fn add(&self, outcome: PointRows, context: &RunContext<'_>) {
        let rows_per_batch = BATCH_ROWS as u64;
        let batch_index = outcome.point / rows_per_batch;
        let batch_size = rows_per_batch.min(self.job.points - batch_index * rows_per_batch);
        if let Some(outcomes) = self.incomplete_batches.add_result(batch_index, batch_size, outcome)
        {
            let batch = self.build_batch(outcomes);
            lock(&self.batches).insert(batch_index, batch);
        }
        context.add_points(1);
    }

    fn build_batch(&self, mut outcomes: Vec<PointRows>) -> Result<RecordBatch, ArrowError> {
        outcomes.sort_by_key(|outcome| outcome.point);
        let layout: &Layout = &self.job.layout;
        let mut batch_builder = BatchBuilder::with_schema(layout, SchemaRef::clone(&self.schema));
        for outcome in outcomes {
            for row in outcome.rows {
                batch_builder.push_row(outcome.point, (self.job.axis_values)(outcome.point), row);
            }
        }
        batch_builder.take_batch()
    }

    /// Returns all batches in order, including incomplete ones.
    fn into_batches(self) -> Result<Vec<RecordBatch>, ArrowError> {
        let incomplete_batches = std::mem::take(&mut *lock(&self.incomplete_batches.0));
        let mut batches = std::mem::take(&mut *lock(&self.batches));
        for (batch_index, outcomes) in incomplete_batches {
            batches.insert(batch_index, self.build_batch(outcomes));
        }
        batches.into_values().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::WasherGridInput;
    use sweep_engine::interrupt::Interrupt;
    use sweep_engine::progress::ProgressMode;

    #[test]
    fn batches_share_their_schema() {
        let text = "spin = { profile = \"ramp\", peak_rpm = 300, ramp_s = 0.01 }\n\
             time = { end_s = 0.01 }\nintegrator = { method = \"rk4\", step_s = 2e-4 }\n\
             [[axis]]\nparameter = \"unbalance_mass_kg\"\n\
             range = { from = 0.1, to = 0.9, count = 4097 }\n";
        let grid = WasherGridInput::text("grid", text.to_owned(), Vec::new());
        let evaluator = PlanEvaluator::new(grid.load().unwrap());
        let interrupt = Interrupt::new();
        let execution =
            Execution { threads: Some(2), progress: ProgressMode::None, interrupt: &interrupt };
        let table = evaluator.task_for_all_points().unwrap().compute_in_memory(execution).unwrap();
        let [first_batch, second_batch] = table.batches() else { panic!("{table:?}") };
        assert_eq!([first_batch.num_rows(), second_batch.num_rows()], [BATCH_ROWS, 1]);
        assert!(Arc::ptr_eq(&first_batch.schema(), &second_batch.schema()));
    }
}

//! The engine of the washing machine: it integrates both models at the points of a plan, in lanes,
//! each point at as many refinement levels as its error requires.

mod growth;
mod pool;
mod reference;

pub(crate) use growth::{CarriedState, fastest_growth, find_motions, find_responses};
pub(crate) use reference::{reference_method, reference_step_s};
pub(crate) use sweep_engine::{Engine, Evaluator, RunContext};

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex};

use lane_ode::{Cancel, Simd};
use once_cell::sync::OnceCell;
use pool::{OutcomeSink, Pool};
use washer_model::{
    Machine, Method, ModelKind, Point, PointInput, Spin, StepSelector, Timing, prepare,
};
use washer_row::{
    LevelRun, MethodKind, Outcome, OutcomePurpose, RefinementLevels, RowRule, Status,
    integrate_points, refinement_levels,
};

use crate::columns::Columns;
use crate::map_row::{MapLayout, MapRow};
use crate::method::direct_method;
use crate::plan::{Plan, compared_channels, failure_reason, point_input};
use sweep_engine::engine::evaluate_points;
use sweep_engine::method::Steps;
use sweep_engine::{Error, Interrupt, RowSink, RowSource};

/// Number of parts of a run at whose ends a perturbed run is compared with its original. Basis: an
/// exponential separation is measured over many of them. Doubling it doubles the memory of the
/// comparison and, where steps are long, the steps that end at a checkpoint.
pub(crate) const CHECKPOINT_COUNT: u32 = 128;

/// The methods by which a row with capped modes was computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CappedRun {
    /// The method of the nonlinear model, and that of the linear one.
    pub(crate) methods: [Method; 2],
    /// The number of equal parts of the run at whose ends a step ends.
    pub(crate) checkpoints: u32,
}

/// An engine that computes rows of a plan with both models.
pub struct ModelEngine<'a> {
    plan: &'a Plan,
    /// The use of the rows, which decides how far they are refined.
    pub(crate) purpose: OutcomePurpose,
    /// The instruction set of all groups. With `None` each group gets the narrowest that has a lane
    /// for each of its trajectories.
    required_simd: Option<Simd>,
    timing: Timing,
    row_rule: RowRule,
    /// The refinement levels of both models, found when first used.
    pub(crate) levels: Arc<OnceCell<[RefinementLevels; 2]>>,
}

/// Returns the instruction set that the variable `SWEEP_SIMD` names, or else the best one.
///
/// # Errors
/// Returns an error if this processor has no instruction set of that name.
pub(crate) fn simd_from_environment() -> Result<Simd, Error> {
    Ok(required_simd_from_environment()?.unwrap_or_else(Simd::widest))
}

/// Returns the instruction set that the variable `SWEEP_SIMD` names, if it is set.
fn required_simd_from_environment() -> Result<Option<Simd>, Error> {
    let Ok(name) = std::env::var("SWEEP_SIMD") else { return Ok(None) };
    let available_simds = || Simd::ALL.into_iter().filter(|simd| simd.is_available());
    let matching_simd = available_simds().find(|simd| simd.name() == name);
    matching_simd.map(Some).ok_or_else(|| {
        let names = available_simds().map(Simd::name).collect::<Vec<_>>().join(", ");
        Error::Refused(format!("SWEEP_SIMD={name}: expected one that this machine has: {names}"))
    })
}

impl<'a> ModelEngine<'a> {
    /// Returns an engine for a plan, with the instruction set that `SWEEP_SIMD` names, if it is
    /// set.
    ///
    /// # Errors
    /// Returns an error if this processor has no instruction set of that name.
    pub fn new(plan: &'a Plan) -> Result<Self, Error> {
        Ok(Self::with_simd(required_simd_from_environment()?, plan))
    }

    /// Returns an engine for a plan of which one column is read.
    ///
    /// # Errors
    /// Returns the errors of [`Self::new`].
    pub(crate) fn for_column(plan: &'a Plan, only_column: Option<&str>) -> Result<Self, Error> {
        // A search for a ratio's limit needs only the side of the limit. The limits of other
        // columns are not known to the engine, so these need complete rows.
        let column_has_prefix = |prefix| only_column.is_some_and(|only| only.starts_with(prefix));
        let purpose = if column_has_prefix("ratio_") {
            OutcomePurpose::Side
        } else if column_has_prefix("growth_") || column_has_prefix("dwell_") {
            OutcomePurpose::Growth
        } else {
            OutcomePurpose::Row
        };
        Ok(Self { purpose, ..Self::new(plan)? })
    }

    /// Returns the engine as commands use it.
    pub fn into_engine(self) -> Engine<'a> {
        let simd = self.widest_simd().name();
        let plan = self.plan;
        Engine {
            failure_reason: Box::new(move |point| failure_reason(plan, point)),
            ..Engine::new(self, simd)
        }
    }

    fn with_simd(required_simd: Option<Simd>, plan: &'a Plan) -> Self {
        let is_checked = matches!(plan.integrator.steps(), Steps::Checked(_));
        let checkpoints = if is_checked { CHECKPOINT_COUNT } else { 0 };
        let timing = Timing { end_s: plan.end_s, window_s: plan.window_s, checkpoints };
        let levels = Arc::default();
        Self {
            plan,
            purpose: OutcomePurpose::Row,
            required_simd,
            timing,
            row_rule: make_row_rule(plan),
            levels,
        }
    }

    /// Returns an engine for another plan, with the instruction set and the levels of this one.
    pub(crate) fn for_plan<'b>(&self, plan: &'b Plan) -> ModelEngine<'b> {
        self.levels();
        ModelEngine {
            levels: Arc::clone(&self.levels),
            ..ModelEngine::with_simd(self.required_simd, plan)
        }
    }

    pub(crate) const fn plan(&self) -> &'a Plan {
        self.plan
    }

    /// Returns the refinement levels of both models.
    pub(crate) fn levels(&self) -> &[RefinementLevels; 2] {
        self.levels.get_or_init(|| self.find_levels(Cancel::Never))
    }

    /// Returns [`Self::levels`], or `None` if the context stops the search.
    fn levels_unless_stopped(&self, context: &RunContext<'_>) -> Option<&[RefinementLevels; 2]> {
        // The standard library's cell has no `get_or_try_init` yet.
        let find_levels_or_stop = || {
            let found_levels = self.find_levels(Cancel::When(&|| context.must_stop()));
            // A search that was stopped may lack levels.
            if context.must_stop() { Err(()) } else { Ok(found_levels) }
        };
        self.levels.get_or_try_init(find_levels_or_stop).ok()
    }

    /// Returns the methods by which a row of this kind of method was computed; `None` if the kind
    /// caps no modes.
    pub(crate) fn capped_run(&self, kind: MethodKind) -> Option<CappedRun> {
        if !kind.is_capped() {
            return None;
        }
        let [nonlinear, linear] = self.levels();
        let methods = [nonlinear.capped_method(kind)?, linear.capped_method(kind)?];
        Some(CappedRun { methods, checkpoints: self.timing.checkpoints })
    }

    fn find_levels(&self, cancel: Cancel<'_>) -> [RefinementLevels; 2] {
        if let Some(method) = direct_method(&self.plan.integrator) {
            return ModelKind::ALL.map(|_| RefinementLevels::direct(method));
        }
        // The corners of the grid have the extremes of the machines' frequencies.
        let corners = self.plan.corners_to_prepare();
        let inputs: Vec<PointInput> =
            corners.iter().map(|values| point_input(self.plan, values)).collect();
        let prepared_points = self.prepare(&inputs);
        let points = prepared_points
            .iter()
            .zip(&inputs)
            .filter_map(|(point, input)| Some((point.as_ref().ok()?, &input.spin)));
        let step_selector = StepSelector::until(points, self.plan.end_s, cancel);
        ModelKind::ALL.map(|model| refinement_levels(&step_selector, model, self.row_rule.accuracy))
    }

    /// Evaluates points, each given by the values of the plan's axes, on the grid or between its
    /// points. Returns their rows in the order of the points; `None` if the context stopped the
    /// work.
    ///
    /// Within a rayon pool it uses all threads of the pool, otherwise the calling thread.
    pub fn evaluate_points(
        &self,
        axis_values: &[Vec<f64>],
        context: &RunContext<'_>,
    ) -> Option<Vec<MapRow>> {
        let map = Arc::new(MapLayout::new(self.plan));
        let results = evaluate_points(self, axis_values, context)?;
        let cells = results.into_iter().flat_map(|result| result.rows);
        Some(cells.map(|cells| MapRow::new(Arc::clone(&map), cells)).collect())
    }

    /// Evaluates the only point of a plan without axes. Returns `None` if the interrupt was raised.
    pub(crate) fn evaluate_only_point(&self, interrupt: &Interrupt) -> Option<MapRow> {
        self.evaluate_points(&[Vec::new()], &RunContext::new(interrupt))?.pop()
    }

    /// Computes the rows of all points from a source and passes them to a sink. Within a rayon pool
    /// it uses all threads of the pool, otherwise the calling thread.
    fn integrate_rows(
        &self,
        source: &RowSource<'_>,
        sink: &OutcomeSink<'_>,
        context: &RunContext<'_>,
    ) {
        let state = Mutex::default();
        let state_changed = Condvar::new();
        // Estimates time a single thread.
        let is_in_pool = rayon::current_thread_index().is_some();
        let thread_count = if is_in_pool { rayon::current_num_threads() } else { 1 };
        let pool = Pool { engine: self, source, sink, context, thread_count, state, state_changed };
        match is_in_pool {
            true => drop(rayon::broadcast(|_| pool.run_worker())),
            false => pool.run_worker(),
        }
    }

    /// Returns the instruction set of the widest groups.
    pub(crate) fn widest_simd(&self) -> Simd {
        self.required_simd.unwrap_or_else(Simd::widest)
    }

    fn simd_for(&self, trajectories: usize) -> Simd {
        self.required_simd.unwrap_or_else(|| Simd::widest().narrowest_for(trajectories))
    }

    /// Prepares points for integration, those with the same window together. A point that cannot be
    /// prepared has its status.
    fn prepare(&self, inputs: &[PointInput]) -> Vec<Result<Point, Status>> {
        let mut prepared_points = Vec::with_capacity(inputs.len());
        for inputs_of_window in inputs.chunk_by(|a, b| a.window_s == b.window_s) {
            let machines: Vec<_> = inputs_of_window
                .iter()
                .map(|PointInput { machine, spin, .. }| (machine.clone(), spin.clone()))
                .collect();
            let timing = Timing { window_s: inputs_of_window[0].window_s, ..self.timing };
            let prepare_machines = |machines: &[(Machine, Spin)]| {
                let points = prepare(self.simd_for(machines.len()), machines, &timing);
                points.into_iter().map(|point| point.map_err(|_| Status::NoEquilibrium)).collect()
            };
            let panicked_point = || Err(Status::Panicked);
            prepared_points.extend(map_isolating_panics(
                &machines,
                prepare_machines,
                panicked_point,
            ));
        }
        prepared_points
    }

    /// Integrates one model at every point with one method. Once the context is stopped, the result
    /// is meaningless.
    fn integrate_runs(
        &self,
        model: usize,
        method: &Method,
        points: &[&Point],
        context: &RunContext<'_>,
    ) -> Vec<LevelRun> {
        let is_stopped = || context.must_stop();
        let cancel = Cancel::When(&is_stopped);
        let integrate_group = |points: &[&Point]| {
            let simd = self.simd_for(points.len());
            integrate_points(simd, ModelKind::ALL[model], method, points, &self.row_rule, cancel)
                .unwrap_or_default()
        };
        let panicked = || LevelRun::failed(Status::Panicked);
        map_isolating_panics(points, integrate_group, panicked)
    }
}

/// Returns the measures that rows take from the trajectories of a plan, and the accuracy required.
pub(crate) fn make_row_rule(plan: &Plan) -> RowRule {
    let accuracy = match plan.integrator.steps() {
        Steps::Checked(accuracy) => accuracy,
        // A single method has no accuracy to reach.
        Steps::Fixed(_) | Steps::ByError => f64::INFINITY,
    };
    RowRule {
        end_s: plan.end_s,
        window_s: plan.window_s,
        accuracy,
        limits: plan.reliability.limits,
        channels: compared_channels(plan),
        measures: plan.model.measures.clone(),
    }
}

/// Returns the results of `map_group`, one for each item.
///
/// If it panics, every item is mapped alone, which gives the same bits, so that a panic over one
/// item does not cost the others their results. An item that panics alone has the result
/// `panicked`.
pub(crate) fn map_isolating_panics<I, R>(
    items: &[I],
    map_group: impl Fn(&[I]) -> Vec<R>,
    panicked_result: impl Fn() -> R,
) -> Vec<R> {
    let map_unless_panicking =
        |items: &[I]| catch_unwind(AssertUnwindSafe(|| map_group(items))).ok();
    map_unless_panicking(items).unwrap_or_else(|| {
        let map_single_item = |item: &I| {
            map_unless_panicking(std::slice::from_ref(item)).and_then(|mut results| results.pop())
        };
        items.iter().map(|item| map_single_item(item).unwrap_or_else(&panicked_result)).collect()
    })
}

impl Evaluator for ModelEngine<'_> {
    fn evaluate(&self, source: &RowSource<'_>, sink: &RowSink<'_>, context: &RunContext<'_>) {
        let columns = Columns::for_run(self.plan);
        let sink = |outcome: &Outcome| columns.pass(outcome, sink);
        self.integrate_rows(source, &sink, context);
    }
}

#[cfg(test)]
mod tests;

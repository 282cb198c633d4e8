//! The engine: points through both models, in lanes, each at as many refinement levels as it needs.

mod growth;
mod pool;
mod reference;

pub(crate) use growth::{Carried, motions, of_speeds, responses};
pub(crate) use reference::{reference, reference_step_s};
pub(crate) use sweep_engine::{Engine, RunContext};

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex};

use lane_ode::Simd;
use once_cell::sync::OnceCell;
use pool::{Pool, Sink, Source};
use washer_model::{Machine, Method, ModelKind, Point, Spin, StepSelector, Timing, prepare};
use washer_row::{
    Demand, Level, LevelRun, Outcome, RefinementLevels, Rule, Status, refinement_levels, runs,
};

use crate::columns::Columns;
use crate::plan::{Plan, Scenario};
use sweep_engine::method::{Integrator as _, Steps};
use sweep_engine::{Error, Interrupt, RowSink, RowSource};
use sweep_files::panics::{lock, unlocked};

/// Parts of a run at whose ends a perturbed run is compared with its original.
pub(crate) const CHECKPOINTS: u32 = 128;

/// What a row by capped modes came from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CappedRun {
    pub(crate) level: Level,
    /// The nonlinear model's, the linear one's.
    pub(crate) methods: [Method; 2],
    /// Steps end at so many parts of the run.
    pub(crate) checkpoints: u32,
}

/// Both models over a plan's points.
pub struct ModelEngine<'a> {
    plan: &'a Plan,
    /// What its rows are good for.
    pub(crate) demand: Demand,
    /// What groups run on; else as few lanes as a group needs.
    forced: Option<Simd>,
    timing: Timing,
    rule: Rule,
    /// The refinement levels of both models; found when first asked for.
    pub(crate) levels: Arc<OnceCell<[RefinementLevels; 2]>>,
}

/// The instruction set that `SWEEP_SIMD` asks for, else the best.
///
/// # Errors
/// A name that is not one of this machine's.
pub(crate) fn simd_from_environment() -> Result<Simd, Error> {
    Ok(forced_simd()?.unwrap_or_else(Simd::best))
}

/// The instruction set that `SWEEP_SIMD` asks for, if it does.
fn forced_simd() -> Result<Option<Simd>, Error> {
    let Ok(name) = std::env::var("SWEEP_SIMD") else { return Ok(None) };
    let available = || Simd::ALL.into_iter().filter(|simd| simd.is_available());
    let named = available().find(|simd| simd.name() == name);
    named.map(Some).ok_or_else(|| {
        let names = available().map(Simd::name).collect::<Vec<_>>().join(", ");
        Error::Refused(format!("SWEEP_SIMD={name}: expected one that this machine has: {names}"))
    })
}

impl<'a> ModelEngine<'a> {
    /// An engine for a plan, on the best instruction set or the one asked for.
    ///
    /// # Errors
    /// A method or an instruction set that is not there.
    pub fn new(plan: &'a Plan) -> Result<Self, Error> {
        Ok(Self::on(forced_simd()?, plan))
    }

    fn on(forced: Option<Simd>, plan: &'a Plan) -> Self {
        let is_checked = matches!(plan.integrator.steps(), Steps::Checked(_));
        let checkpoints = if is_checked { CHECKPOINTS } else { 0 };
        let timing = Timing { end_s: plan.end_s, window_s: plan.window_s, checkpoints };
        let levels = Arc::default();
        Self { plan, demand: Demand::Row, forced, timing, rule: rule(plan), levels }
    }

    /// Returns an engine for another plan, with the instruction set and the levels of this one.
    pub(crate) fn over<'b>(&self, plan: &'b Plan) -> ModelEngine<'b> {
        self.levels();
        ModelEngine { levels: Arc::clone(&self.levels), ..ModelEngine::on(self.forced, plan) }
    }

    /// What it computes.
    pub(crate) const fn plan(&self) -> &'a Plan {
        self.plan
    }

    /// Returns the refinement levels of both models.
    pub(crate) fn levels(&self) -> &[RefinementLevels; 2] {
        self.levels.get_or_init(|| self.find_levels(&|| false))
    }

    /// Returns [`Self::levels`], or `None` if `watch` stops the search.
    fn levels_under(&self, watch: &RunContext<'_>) -> Option<&[RefinementLevels; 2]> {
        // The standard library's cell has no `get_or_try_init` yet.
        let find = || {
            let found = self.find_levels(&|| watch.stopped());
            // They may have been cut short.
            if watch.stopped() { Err(()) } else { Ok(found) }
        };
        self.levels.get_or_try_init(find).ok()
    }

    /// How the trajectories of a row of this level were integrated; `None` where modes were not
    /// capped.
    pub(crate) fn quick(&self, level: Level) -> Option<CappedRun> {
        if !level.is_capped() {
            return None;
        }
        let [nonlinear, linear] = self.levels();
        let methods = [nonlinear.capped(level)?, linear.capped(level)?];
        Some(CappedRun { level, methods, checkpoints: self.timing.checkpoints })
    }

    fn find_levels(&self, is_stopped: &dyn Fn() -> bool) -> [RefinementLevels; 2] {
        if let Some((level, method)) = self.plan.integrator.direct() {
            return ModelKind::ALL.map(|_| RefinementLevels::direct(level, method));
        }
        // The fast method's, by the corners of the grid.
        let scenarios: Vec<_> =
            self.plan.some_corners().iter().map(|at| self.plan.scenario_at(at)).collect();
        let prepared = self.prepare(&scenarios);
        let ready = prepared.iter().zip(&scenarios);
        let ready = ready
            .filter_map(|(point, scenario)| Some((point.as_ref().ok()?, &scenario.model.spin)));
        let steps = StepSelector::until(ready, self.plan.end_s, is_stopped);
        ModelKind::ALL.map(|model| refinement_levels(&steps, model, self.rule.accuracy))
    }

    /// One row per point given by the values of its axes, on the grid or between its points;
    /// `point` of an outcome is the position among them. On all threads of the rayon pool it is
    /// called in, if in one.
    pub fn evaluate_at(&self, axis_values: &[Vec<f64>]) -> Vec<Outcome> {
        let interrupt = Interrupt::new();
        let watch = RunContext::new(&interrupt);
        self.evaluate_under(axis_values, &watch).unwrap_or_default()
    }

    /// As [`Self::evaluate_at`]; `None` if `watch` stopped it.
    pub fn evaluate_under(
        &self,
        axis_values: &[Vec<f64>],
        watch: &RunContext<'_>,
    ) -> Option<Vec<Outcome>> {
        let next = Mutex::new(0..axis_values.len());
        let source = |most: usize| {
            let mut next = lock(&next);
            let positions: Vec<usize> = next.by_ref().take(most).collect();
            positions
                .into_iter()
                .map(|i| (i as u64, self.plan.scenario_at(&axis_values[i])))
                .collect()
        };
        let found = Mutex::new(Vec::with_capacity(axis_values.len()));
        let sink = |outcome: Outcome| lock(&found).push(outcome);
        self.integrate_rows(&source, &sink, watch);
        let mut found = unlocked(found);
        found.sort_by_key(|outcome| outcome.point);
        (found.len() == axis_values.len()).then_some(found)
    }

    /// Computes rows from a source and gives them to a sink, on all threads of the rayon pool this
    /// is called in.
    fn integrate_rows(&self, source: &Source<'_>, sink: &Sink<'_>, watch: &RunContext<'_>) {
        let state = Mutex::default();
        let changed = Condvar::new();
        let pool = Pool { engine: self, source, sink, watch, state, changed };
        match rayon::current_thread_index() {
            Some(_) => drop(rayon::broadcast(|_| pool.work())),
            // An estimate is of one thread.
            None => pool.work(),
        }
    }

    /// What groups of any size run on.
    fn widest(&self) -> Simd {
        self.forced.unwrap_or_else(Simd::best)
    }

    fn simd_for(&self, trajectories: usize) -> Simd {
        self.forced.unwrap_or_else(|| Simd::best().narrowed(trajectories))
    }

    /// Points made ready, those of one window together; or why there is none.
    fn prepare(&self, scenarios: &[Scenario]) -> Vec<Result<Point, Status>> {
        let mut prepared = Vec::with_capacity(scenarios.len());
        for alike in scenarios.chunk_by(|a, b| a.window_s == b.window_s) {
            let machines: Vec<_> = alike
                .iter()
                .map(|Scenario { model, .. }| (model.machine.clone(), model.spin.clone()))
                .collect();
            let timing = Timing { window_s: alike[0].window_s, ..self.timing };
            let together = |machines: &[(Machine, Spin)]| {
                let points = prepare(self.simd_for(machines.len()), machines, &timing);
                points.into_iter().map(|point| point.map_err(|_| Status::NoEquilibrium)).collect()
            };
            prepared.extend(together_or_alone(&machines, together, || Err(Status::Panicked)));
        }
        prepared
    }

    /// One model at every point, by one method. Once `watch` says to stop, what this returns means
    /// nothing.
    fn runs(
        &self,
        model: usize,
        method: &Method,
        points: &[&Point],
        watch: &RunContext<'_>,
    ) -> Vec<LevelRun> {
        let stop = || watch.stopped();
        let together = |points: &[&Point]| {
            let simd = self.simd_for(points.len());
            runs(simd, ModelKind::ALL[model], method, points, &self.rule, &stop).unwrap_or_default()
        };
        let panicked = || LevelRun::failed(Status::Panicked);
        together_or_alone(points, together, panicked)
    }
}

/// What the rows of a plan take from trajectories, and what they must be good for.
pub(crate) fn rule(plan: &Plan) -> Rule {
    let accuracy = match plan.integrator.steps() {
        Steps::Checked(accuracy) => accuracy,
        // A single method has no accuracy to reach.
        Steps::Fixed(_) | Steps::ByError => f64::INFINITY,
    };
    Rule {
        end_s: plan.end_s,
        window_s: plan.window_s,
        accuracy,
        limits: plan.reliability.limits,
        channels: plan.reliability.channels.clone(),
        measures: plan.model.measures.clone(),
    }
}

/// One result per item of a group. A panic over one item must not cost the others theirs: then each
/// is done alone, which gives the same bits, and the one is a defect.
pub(crate) fn together_or_alone<I, R>(
    items: &[I],
    together: impl Fn(&[I]) -> Vec<R>,
    defect: impl Fn() -> R,
) -> Vec<R> {
    let caught = |items: &[I]| catch_unwind(AssertUnwindSafe(|| together(items))).ok();
    caught(items).unwrap_or_else(|| {
        let alone =
            |item: &I| caught(std::slice::from_ref(item)).and_then(|mut results| results.pop());
        items.iter().map(|item| alone(item).unwrap_or_else(&defect)).collect()
    })
}

impl Engine for ModelEngine<'_> {
    fn evaluate(&self, next: &RowSource<'_>, keep: &RowSink<'_>, watch: &RunContext<'_>) {
        let columns = Columns::of_run(self.plan);
        let sink = |outcome: Outcome| keep(columns.done(outcome));
        let source = |most: usize| {
            let rows = std::iter::from_fn(next).take(most);
            rows.map(|(row, values)| (row, self.plan.scenario_at(&values))).collect()
        };
        self.integrate_rows(&source, &sink, watch);
    }

    fn simd(&self) -> &str {
        self.widest().name()
    }
}

#[cfg(test)]
mod tests;

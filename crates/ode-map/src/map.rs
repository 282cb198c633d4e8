//! An oscillator as a model of the engine.

use std::marker::PhantomData;
use std::time::Instant;

use lane_ode::{MAX_LANES, Simd};
use serde_json::{Map as JsonMap, Value};
use sweep_engine::columns::{
    Compared, ResultColumn, amplitude_columns, declared, row, run_columns, verdict_columns,
};
use sweep_engine::config::Keys;
use sweep_engine::config::schema::set;
use sweep_engine::method::{ACCURACY, ATOL, Integrator as _, RTOL, STEP_S, Steps};
use sweep_engine::store::read::{NameCounts, add};
use sweep_engine::store::{Done, Layout, axis_columns};
use sweep_engine::{
    Build, Engine, Error, Estimate, GridInput, Job, Listed, Model as EngineModel, Plan, Read,
    RowSink, RowSource, Rows, RunContext, Scenario, Swept, methods,
};
use sweep_parameter::{Channel, Range, UnknownParameter};

use crate::equations::{Model, PreparedPoint};
use crate::run::{Integration, Method, ModelRun};
use crate::{Coordinate, Oscillator, Parameter};

methods! {
    Rk4 = "rk4", "classical Runge-Kutta of order 4, in fixed steps" { step_s: STEP_S }
        Steps::Fixed(step_s);
    Dopri5 = "dopri5", "Dormand-Prince 5(4), adaptive" { rtol: RTOL, atol: ATOL } Steps::ByError;
    Rk4Halved = "rk4-halved", "rk4 in steps that are halved until two runs agree" {
        accuracy: ACCURACY
    } Steps::Checked(accuracy);
}

/// First step of the halving method, as the product of step and the linear model's highest
/// frequency (rad). Basis: order 4 is then stable. Doubling it adds a useless first run.
const FIRST_STEP_RAD: f64 = 0.5;
/// Greatest number of runs of the halving method, each with half the step of the one before. Basis:
/// the last step is 1/2048 of the first. Doubling it makes rows that do not converge take 4096
/// times as long.
const MAX_HALVING_RUNS: u32 = 12;
/// The error of a run of order 4, relative to its difference from the run with twice the step.
/// Derived: 1 / (2^4 - 1). Doubling it doubles the estimate.
const CONTRACTION: f64 = 1.0 / 15.0;
/// Least scale of the difference of amplitudes, relative to the row's greatest amplitude. Basis:
/// rounding errors are smaller. Doubling it halves the relative differences of smaller amplitudes.
const FLOOR: f64 = 1e-9;

/// Names of methods in results.
const METHODS: [&str; 2] = ["rk4", "dopri5"];
/// Values of `status`. First those of the nonlinear model: `ok`, then the reasons of
/// [`lane_ode::Failure`] in their order, then that of a point without equilibrium. The last three
/// are those of the linear model if it alone fails.
const STATUSES: [&str; 8] = [
    "ok",
    "diverged",
    "step_too_small",
    "step_limit",
    "no_equilibrium",
    "linear_diverged",
    "linear_step_too_small",
    "linear_step_limit",
];
const NO_EQUILIBRIUM: usize = 4;

/// The model that a grid file describes: an oscillator with a value for every parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Map<O, const C: usize, const D: usize, const P: usize> {
    values: [f64; P],
    oscillator: PhantomData<O>,
}

/// The edges of the window, which can be set and swept like parameters.
const EDGES: [Parameter; 2] = [
    edge("window_from_s", "where the window begins"),
    edge("window_to_s", "where the window ends"),
];

const fn edge(name: &'static str, description: &'static str) -> Parameter {
    let source = "the grid file's [time]";
    Parameter { name, unit: "s", description, range: Range::NonNegative, default: 0.0, source }
}

impl sweep_parameter::Parameter for Parameter {
    fn name(&self) -> &str {
        self.name
    }

    fn unit(&self) -> &'static str {
        self.unit
    }

    fn description(&self) -> &'static str {
        self.description
    }

    fn range(&self) -> Range {
        self.range
    }

    fn window_edge(&self) -> Option<usize> {
        EDGES.iter().position(|edge| edge == self)
    }
}

impl Channel for Coordinate {
    fn name(self) -> &'static str {
        self.name
    }

    fn unit(self) -> &'static str {
        self.unit
    }

    fn description(self) -> &'static str {
        self.description
    }
}

impl<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> EngineModel
    for Map<O, C, D, P>
{
    type Parameter = Parameter;
    type Channel = Coordinate;
    type Integrator = Integrator;

    const BUILD: Build = Build { version: O::VERSION, numerics: 1 };

    fn channels() -> &'static [Coordinate] {
        &O::COORDINATES
    }

    fn parameters(&self) -> Vec<Parameter> {
        O::PARAMETERS.into_iter().chain(EDGES).collect()
    }

    fn find(&self, name: &str) -> Result<Parameter, UnknownParameter> {
        let found = self.parameters().into_iter().find(|one| one.name == name);
        found.ok_or_else(UnknownParameter::strange)
    }

    fn write(&mut self, parameter: &Parameter, value: f64) {
        if let Some(place) = O::PARAMETERS.iter().position(|one| one.name == parameter.name) {
            self.values[place] = value;
        }
    }
}

impl<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> Read
    for Map<O, C, D, P>
{
    fn blank() -> Self {
        Self { values: O::PARAMETERS.map(|one| one.default), oscillator: PhantomData }
    }

    fn walk(&mut self, keys: &mut Keys<'_>, _: Option<&GridInput<Self>>) {
        let named = O::PARAMETERS.iter().zip(self.values);
        let pair = |(one, value): (&Parameter, f64)| (one.name.to_owned(), Value::from(value));
        keys.write("parameters", named.map(pair).collect());
    }

    fn schema_of_set() -> Value {
        set(&Self::blank().parameters(), JsonMap::new())
    }
}

impl<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> Rows
    for Map<O, C, D, P>
{
    fn layout(plan: &Plan<Self>) -> Layout {
        Layout::map(axis_columns(plan), declared(columns(plan)))
    }
}

impl<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> Swept
    for Map<O, C, D, P>
{
    fn engine<'a>(plan: &'a Plan<Self>, _: Option<&str>) -> Result<Box<dyn Engine + 'a>, Error> {
        Simd::check().map_err(Error::model)?;
        Ok(Box::new(Evaluator { plan }))
    }

    fn estimate(plan: &Plan<Self>, threads: usize) -> Result<Estimate, Error> {
        let points = plan.points().min(MAX_LANES as u64);
        let some: Vec<Vec<f64>> = (0..points).map(|k| plan.axis_values(k)).collect();
        let began = Instant::now();
        let rows = Evaluator { plan }.rows(&some, &|| false);
        let core_s_per_point = began.elapsed().as_secs_f64() / points as f64;
        let mut sampled = NameCounts::new();
        rows.iter().for_each(|row| add(&mut sampled, STATUSES[row.status()]));
        let layout = &Job::new(plan).layout;
        let result_bytes = plan.points() as f64 * layout.bytes_a_row() as f64;
        let steps = match plan.integrator.steps() {
            Steps::Checked(_) => ", until two runs agree",
            Steps::Fixed(_) => ", two trajectories per point",
            Steps::ByError => ": steps as it needs",
        };
        Ok(Estimate {
            simd: Simd::best().name().to_owned(),
            threads,
            wall_s: plan.points() as f64 * core_s_per_point / threads as f64,
            core_s_per_point,
            sampled,
            sampled_s: plan.end_s,
            // The memory of unfinished chunks, or of a row group.
            memory_bytes: 14e6 + result_bytes.min(40e6),
            disk_bytes: result_bytes,
            result_bytes,
            method: format!("{}{steps}", plan.integrator),
        })
    }

    fn listed(plan: Option<&Plan<Self>>) -> Vec<Listed<Self>> {
        let own = O::PARAMETERS.into_iter().enumerate().map(|(k, parameter)| {
            let value = plan.map_or(parameter.default, |plan| plan.model.values[k]);
            let source = if value == parameter.default { parameter.source } else { "given" };
            Listed { parameter, value: Some(value), source: source.to_owned() }
        });
        let edges = EDGES.into_iter().enumerate().map(|(k, parameter)| {
            let value = plan.map(|plan| plan.window_s[k]);
            Listed { parameter, value, source: parameter.source.to_owned() }
        });
        own.chain(edges).collect()
    }
}

/// The runs of both models at a point, and their error.
#[derive(Clone)]
struct PointRuns<const C: usize> {
    runs: [ModelRun<C>; 2],
    error: Option<f64>,
    converged: Option<bool>,
}

impl<const C: usize> PointRuns<C> {
    fn status(&self) -> usize {
        match self.runs.map(|run| run.failure.map_or(0, |(status, _)| status)) {
            [0, 0] => 0,
            [0, linear] => NO_EQUILIBRIUM + linear,
            [nonlinear, _] => nonlinear,
        }
    }
}

fn columns<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize>(
    plan: &Plan<Map<O, C, D, P>>,
) -> Vec<ResultColumn<Compared>> {
    let reliability = &plan.reliability;
    let amplitude = "largest deviation from equilibrium in the window";
    let ratio = "nonlinear over linear amplitude; null where the linear one is zero or a model \
                 failed";
    let (limits, methods) = (reliability.limits, METHODS.to_vec());
    let mut columns = amplitude_columns(&reliability.channels, limits, amplitude, ratio);
    let method_description = "the method that the row's numbers come from";
    columns.extend(verdict_columns(&reliability.channels, limits, methods, method_description));
    columns.extend(run_columns(STATUSES.to_vec()));
    columns
}

/// The engine that computes the rows of a plan.
struct Evaluator<'a, O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> {
    plan: &'a Plan<Map<O, C, D, P>>,
}

impl<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize>
    Evaluator<'_, O, C, D, P>
{
    /// Computes rows at points with these values of the axes, in lanes.
    fn compared(&self, axis_values: &[Vec<f64>], is_stopped: &dyn Fn() -> bool) -> Vec<Compared> {
        let channels = self.channels();
        let limits = self.plan.reliability.limits;
        let method = self.common_method().1;
        let compared = |row: PointRuns<C>| {
            let amplitudes = row.runs.map(|run| {
                let sound = channels.iter().filter(|_| run.failure.is_none());
                sound.map(|k| run.peaks[*k]).collect::<Vec<_>>()
            });
            let ratio = |k: usize| {
                let linear = amplitudes[1].get(k).filter(|linear| **linear != 0.0)?;
                Some(amplitudes[0].get(k)? / linear)
            };
            let ratios: Vec<Option<f64>> = (0..channels.len()).map(ratio).collect();
            let defined =
                || ratios.iter().enumerate().filter_map(|(k, ratio)| Some((k, (*ratio)?)));
            let greatest = defined().reduce(|most, next| if next.1 > most.1 { next } else { most });
            let least = defined().reduce(|least, next| if next.1 < least.1 { next } else { least });
            Compared {
                reliable: least.zip(greatest).map(|(least, most)| limits.trust(least.1, most.1)),
                greatest,
                least,
                converged: row.converged,
                // Chaos is not examined.
                sensitive: None,
                method,
                error: row.error,
                status: row.status(),
                fail_time_s: row.runs.iter().find_map(|run| run.failure).and_then(|(_, at)| at),
                steps: row.runs.map(|run| run.steps),
                rejected: row.runs.map(|run| run.rejected),
                amplitudes,
                ratios,
            }
        };
        self.rows(axis_values, is_stopped).into_iter().map(compared).collect()
    }

    /// Returns the indices of the coordinates that the plan compares.
    fn channels(&self) -> Vec<usize> {
        let place = |channel: &Coordinate| O::COORDINATES.iter().position(|one| one == channel);
        self.plan.reliability.channels.iter().filter_map(place).collect()
    }

    /// Returns the method if it is the same for all rows, and the index of its name.
    fn common_method(&self) -> (Option<Method>, usize) {
        match self.plan.integrator {
            Integrator::Rk4 { step_s } => (Some(Method::Rk4(step_s)), 0),
            Integrator::Dopri5 { rtol, atol } => (Some(Method::Dopri5(rtol, atol)), 1),
            Integrator::Rk4Halved { .. } => (None, 0),
        }
    }

    fn rows(&self, axis_values: &[Vec<f64>], is_stopped: &dyn Fn() -> bool) -> Vec<PointRuns<C>> {
        let ready = |values: &Vec<f64>| {
            let Scenario { model, window_s } = self.plan.scenario_at(values);
            PreparedPoint::new::<O, D>(model.values, window_s)
        };
        let cases: Vec<Option<PreparedPoint<C, P>>> = axis_values.iter().map(ready).collect();
        let places: Vec<usize> = (0..cases.len()).filter(|k| cases[*k].is_some()).collect();
        let prepared: Vec<&PreparedPoint<C, P>> = cases.iter().flatten().collect();
        let none = ModelRun { failure: Some((NO_EQUILIBRIUM, None)), ..ModelRun::NONE };
        let mut rows =
            vec![PointRuns { runs: [none; 2], error: None, converged: None }; cases.len()];
        if let (Some(method), _) = self.common_method() {
            for (place, runs) in
                places.into_iter().zip(self.run_both_models(method, &prepared, is_stopped))
            {
                rows[place].runs = runs;
            }
            return rows;
        }
        // Each point has its own steps, so that a row does not depend on the other points.
        for (place, case) in places.into_iter().zip(prepared) {
            self.refine(&mut rows[place], case, is_stopped);
            if is_stopped() {
                break;
            }
        }
        rows
    }

    /// Integrates both models at some points by one method.
    fn run_both_models(
        &self,
        method: Method,
        cases: &[&PreparedPoint<C, P>],
        is_stopped: &dyn Fn() -> bool,
    ) -> Vec<[ModelRun<C>; 2]> {
        let end_s = self.plan.end_s;
        let runs = |model| {
            Integration::<O, C, D, P> {
                model,
                method,
                cases,
                end_s,
                is_stopped,
                oscillator: PhantomData,
            }
            .runs()
        };
        let pairs = runs(Model::Nonlinear).into_iter().zip(runs(Model::Linear));
        pairs.map(|(nonlinear, linear)| [nonlinear, linear]).collect()
    }

    /// Integrates both models with steps that are halved until two runs agree.
    fn refine(
        &self,
        row: &mut PointRuns<C>,
        case: &PreparedPoint<C, P>,
        is_stopped: &dyn Fn() -> bool,
    ) {
        let Steps::Checked(accuracy) = self.plan.integrator.steps() else { return };
        let channels = self.channels();
        let mut step_s = (FIRST_STEP_RAD / case.fastest_rad_per_s()).min(self.plan.end_s / 8.0);
        for run_index in 0..MAX_HALVING_RUNS {
            let now = self.run_both_models(Method::Rk4(step_s), &[case], is_stopped)[0];
            row.error =
                if run_index > 0 { error_of_finer(&row.runs, &now, &channels) } else { None };
            row.converged = Some(row.error.is_some_and(|error| error <= accuracy));
            row.runs = now;
            if row.converged == Some(true) {
                return;
            }
            step_s *= 0.5;
        }
    }
}

/// Returns the relative error of the finer runs; `None` if any run failed.
fn error_of_finer<const C: usize>(
    coarse: &[ModelRun<C>; 2],
    fine: &[ModelRun<C>; 2],
    channels: &[usize],
) -> Option<f64> {
    let mut greatest = 0.0_f64;
    for (coarse, fine) in coarse.iter().zip(fine) {
        if coarse.failure.or(fine.failure).is_some() {
            return None;
        }
        let largest = fine.peaks.iter().copied().fold(0.0, f64::max);
        for &channel in channels {
            let (a, b) = (coarse.peaks[channel], fine.peaks[channel]);
            if a != b {
                greatest = greatest.max((a - b).abs() / b.max(FLOOR * largest));
            }
        }
    }
    Some(CONTRACTION * greatest)
}

impl<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> Engine
    for Evaluator<'_, O, C, D, P>
{
    fn evaluate(&self, source: &RowSource<'_>, sink: &RowSink<'_>, context: &RunContext<'_>) {
        let columns = columns(self.plan);
        rayon::broadcast(|_| {
            while !context.stopped() {
                let (points, axis_values): (Vec<u64>, Vec<Vec<f64>>) =
                    std::iter::from_fn(source).take(MAX_LANES).unzip();
                if points.is_empty() {
                    break;
                }
                let rows = self.compared(&axis_values, &|| context.stopped());
                // The rows may be incomplete if the engine was stopped.
                if context.stopped() {
                    break;
                }
                for (&point, compared) in points.iter().zip(&rows) {
                    sink(Done { point, rows: vec![row(&columns, compared)] });
                }
            }
        });
    }

    fn simd(&self) -> &str {
        Simd::best().name()
    }
}

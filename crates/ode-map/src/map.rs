//! An oscillator as a model of the engine.

use std::borrow::Cow;
use std::marker::PhantomData;

use lane_ode::{Cancel, MAX_LANES, Simd};
use serde_json::Value;
use sweep_engine::columns::{
    ComparisonColumns, ResultColumn, RowComparison, into_declarations, pass_rows,
};
use sweep_engine::config::Keys;
use sweep_engine::method::{ACCURACY, DOPRI5, IntegrationMethod, RK4, StepRule, Steps};
use sweep_engine::store::{Layout, axis_columns};
use sweep_engine::{
    About, Build, Engine, Error, Evaluator, GridInput, GridTable, Model, ModelParameter, Plan,
    RowSink, RowSource, RunContext,
};
use sweep_parameter::{Range, RatioLimits, Verdict};

use crate::equations::{OscillatorModel, PreparedPoint};
use crate::run::{Integration, ModelRun, OscillatorMethod};
use crate::{Coordinate, Oscillator, OscillatorParameter};

/// The methods of integration.
static INTEGRATION_METHODS: [IntegrationMethod; 3] = [
    RK4,
    DOPRI5,
    IntegrationMethod {
        name: "rk4-halved",
        description: "rk4 in steps that are halved until two runs agree",
        settings: &[ACCURACY],
        step_rule: StepRule::Checked,
    },
];

/// First step of the method with halved steps, as the product of step and the linear model's
/// highest frequency (rad). Basis: order 4 is stable at this step. Doubling it adds a useless first
/// run.
const FIRST_STEP_RAD: f64 = 0.5;
/// Greatest number of runs of the method with halved steps, each with half the step of the run
/// before. Basis: the last step is 1/2048 of the first. Doubling it makes rows that do not converge
/// take 4096 times as long.
const MAX_HALVING_RUNS: u32 = 12;
/// The error of a run of order 4, relative to its difference from the run with twice the step.
/// Basis: 1 / (2^4 - 1). Doubling it doubles the estimate.
const RICHARDSON_FACTOR: f64 = 1.0 / 15.0;
/// Least scale of the difference of amplitudes, relative to the row's greatest amplitude. Basis:
/// rounding errors are smaller. Doubling it halves the relative differences of smaller amplitudes.
const AMPLITUDE_FLOOR: f64 = 1e-9;

/// Names of methods in results.
const METHOD_NAMES: [&str; 2] = ["rk4", "dopri5"];
/// Values of `status`: `ok`, the reasons of [`lane_ode::Failure`] in their order, and a point
/// without equilibrium; then the same reasons of the linear model, for rows in which it alone
/// fails.
const STATUS_NAMES: [&str; 8] = [
    "ok",
    "diverged",
    "step_too_small",
    "step_limit",
    "no_equilibrium",
    "linear_diverged",
    "linear_step_too_small",
    "linear_step_limit",
];
/// The index of `no_equilibrium` in [`STATUS_NAMES`].
const NO_EQUILIBRIUM_STATUS: usize = 4;

/// The model that a grid file describes: an oscillator with a value for every parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Map<O, const C: usize, const D: usize, const P: usize> {
    parameter_values: [f64; P],
    oscillator: PhantomData<O>,
}

/// The ends of the window, which can be set and swept like parameters.
const WINDOW_ENDS: [(&str, &str); 2] =
    [("window_from_s", "where the window begins"), ("window_to_s", "where the window ends")];

impl<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> Model
    for Map<O, C, D, P>
{
    /// The position in the list of the oscillator's parameters and the window's ends.
    type Handle = usize;

    const ABOUT: About = About::new(
        Build { version: O::VERSION, numerics: 1 },
        &O::COORDINATES,
        &INTEGRATION_METHODS,
    );

    fn blank() -> Self {
        Self {
            parameter_values: O::PARAMETERS.map(|parameter| parameter.default),
            oscillator: PhantomData,
        }
    }

    fn parameters(&self) -> Vec<ModelParameter<Self>> {
        let model_parameters =
            O::PARAMETERS.into_iter().zip(self.parameter_values).map(|(parameter, value)| {
                let OscillatorParameter { name, unit, description, range, source, .. } = parameter;
                (name, unit, description, range, source, Some(value))
            });
        let window_source = "the grid file's [time]";
        let window_ends = WINDOW_ENDS.into_iter().map(|(name, description)| {
            (name, "s", description, Range::NonNegative, window_source, None)
        });
        let to_model = |(handle, (name, unit, description, range, source, value))| {
            let window_end_index = usize::checked_sub(handle, P);
            sweep_parameter::Parameter {
                name: Cow::Borrowed(name),
                unit,
                description,
                range,
                source,
                value,
                number_names: vec![Cow::Borrowed(name)],
                window_edge: window_end_index,
                is_from_grid_file: window_end_index.is_some(),
                handle,
            }
        };
        model_parameters.chain(window_ends).enumerate().map(to_model).collect()
    }

    fn write(&mut self, handle: &usize, value: f64) {
        self.parameter_values[*handle] = value;
    }

    fn walk(&mut self, table: GridTable, keys: &mut Keys<'_>, _: Option<&GridInput<Self>>) {
        if table == GridTable::Top {
            let parameters_with_values = O::PARAMETERS.iter().zip(self.parameter_values);
            let name_and_value = |(parameter, value): (&OscillatorParameter, f64)| {
                (parameter.name.to_owned(), Value::from(value))
            };
            keys.write_value("parameters", parameters_with_values.map(name_and_value).collect());
        }
    }

    fn layout(plan: &Plan<Self>) -> Layout {
        Layout::map(axis_columns(plan), into_declarations(map_columns(plan)))
    }

    fn engine<'a>(plan: &'a Plan<Self>, _: Option<&str>) -> Result<Engine<'a>, Error> {
        Simd::check_processor().map_err(Error::model)?;
        Ok(Engine::new(RowEvaluator { plan }, Simd::widest().name()))
    }
}

/// The runs of both models at a point, their error, and their comparison.
#[derive(Clone)]
struct PointRuns<const C: usize> {
    model_runs: [ModelRun<C>; 2],
    relative_error: Option<f64>,
    is_converged: Option<bool>,
    /// The index of the method's name.
    method: usize,
    /// The amplitudes of each model in the plan's channels; empty for a model that failed.
    amplitudes: [Vec<f64>; 2],
    verdict: Verdict,
}

impl<const C: usize> PointRuns<C> {
    /// Creates the runs of a point without equilibrium.
    fn without_equilibrium(method: usize) -> Self {
        let failed_run =
            ModelRun { failure: Some((NO_EQUILIBRIUM_STATUS, None)), ..ModelRun::EMPTY };
        Self {
            model_runs: [failed_run; 2],
            relative_error: None,
            is_converged: None,
            method,
            amplitudes: Default::default(),
            verdict: Verdict::default(),
        }
    }

    fn status_index(&self) -> usize {
        match self.model_runs.map(|run| run.failure.map_or(0, |(status, _)| status)) {
            [0, 0] => 0,
            [0, linear] => NO_EQUILIBRIUM_STATUS + linear,
            [nonlinear, _] => nonlinear,
        }
    }

    /// Compares the amplitudes of both runs in the coordinates of the plan's channels.
    fn compare_models(&mut self, channels: &[usize], limits: RatioLimits) {
        self.amplitudes = self.model_runs.map(|run| {
            let completed_channels = channels.iter().filter(|_| run.failure.is_none());
            completed_channels.map(|k| run.peaks[*k]).collect()
        });
        let channel_ratio = |k: usize| {
            let linear = self.amplitudes[1].get(k).filter(|linear| **linear != 0.0)?;
            Some(self.amplitudes[0].get(k)? / linear)
        };
        self.verdict = Verdict::new((0..channels.len()).map(channel_ratio).collect(), limits);
    }

    /// Returns the comparison as columns read it.
    fn compared_models(&self) -> RowComparison<'_> {
        RowComparison {
            amplitudes: self.amplitudes.each_ref().map(Vec::as_slice),
            verdict: &self.verdict,
            is_converged: self.is_converged,
            // Chaos is not examined.
            is_sensitive: None,
            method_index: self.method,
            relative_error: self.relative_error,
            status_index: self.status_index(),
            fail_time_s: self.model_runs.iter().find_map(|run| run.failure).and_then(|(_, at)| at),
            accepted_steps: self.model_runs.map(|run| run.steps),
            rejected_steps: self.model_runs.map(|run| run.rejected),
        }
    }
}

fn map_columns<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize>(
    plan: &Plan<Map<O, C, D, P>>,
) -> Vec<ResultColumn<PointRuns<C>>> {
    let comparison = ComparisonColumns {
        channels: &plan.reliability.channels,
        limits: plan.reliability.limits,
        row_comparison: PointRuns::compared_models,
    };
    let amplitude_description = "largest deviation from equilibrium in the window";
    let ratio_description =
        "nonlinear over linear amplitude; null where the linear one is zero or a model failed";
    let mut result_columns = comparison.amplitude_columns(amplitude_description, ratio_description);
    let method_description = "the method that the row's numbers come from";
    result_columns.extend(comparison.verdict_columns(METHOD_NAMES.to_vec(), method_description));
    result_columns.extend(comparison.run_columns(STATUS_NAMES.to_vec()));
    result_columns
}

/// The engine that computes the rows of a plan.
struct RowEvaluator<'a, O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> {
    plan: &'a Plan<Map<O, C, D, P>>,
}

impl<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize>
    RowEvaluator<'_, O, C, D, P>
{
    /// Computes rows at points with these values of the axes, in lanes.
    fn compare_points(&self, axis_values: &[Vec<f64>], cancel: Cancel<'_>) -> Vec<PointRuns<C>> {
        let mut rows = self.evaluate_points(axis_values, cancel);
        let channels = self.channels();
        for row in &mut rows {
            row.compare_models(&channels, self.plan.reliability.limits);
        }
        rows
    }

    /// Returns the indices of the coordinates that the plan compares.
    fn channels(&self) -> Vec<usize> {
        let coordinate_index =
            |channel: &Coordinate| O::COORDINATES.iter().position(|one| one == channel);
        self.plan.reliability.channels.iter().filter_map(coordinate_index).collect()
    }

    /// Returns the method if it is the same for all rows, and the index of its name.
    fn common_method(&self) -> (Option<OscillatorMethod>, usize) {
        let settings = self.plan.integrator.settings();
        match (self.plan.integrator.steps(), &settings[..]) {
            (Steps::Fixed(step_s), _) => (Some(OscillatorMethod::Rk4(step_s)), 0),
            (Steps::ByError, &[(_, rtol), (_, atol)]) => {
                (Some(OscillatorMethod::Dopri5(rtol, atol)), 1)
            }
            _ => (None, 0),
        }
    }

    /// Integrates both models at points with these values of the axes.
    fn evaluate_points(&self, axis_values: &[Vec<f64>], cancel: Cancel<'_>) -> Vec<PointRuns<C>> {
        let prepare_point = |values: &Vec<f64>| {
            let mut parameters = self.plan.model.parameter_values;
            let mut window_s = self.plan.window_s;
            for (axis, &value) in self.plan.axes.iter().zip(values) {
                let handle = axis.parameter.handle;
                match handle.checked_sub(P) {
                    Some(edge) => window_s[edge] = value,
                    None => parameters[handle] = value,
                }
            }
            PreparedPoint::new::<O, D>(parameters, window_s)
        };
        let prepared_or_none: Vec<Option<PreparedPoint<C, P>>> =
            axis_values.iter().map(prepare_point).collect();
        let prepared_indices: Vec<usize> =
            (0..prepared_or_none.len()).filter(|k| prepared_or_none[*k].is_some()).collect();
        let prepared_points: Vec<&PreparedPoint<C, P>> =
            prepared_or_none.iter().flatten().collect();
        let (common_method, method_index) = self.common_method();
        let mut rows = vec![PointRuns::without_equilibrium(method_index); prepared_or_none.len()];
        if let Some(method) = common_method {
            for (position, runs) in prepared_indices.into_iter().zip(self.run_both_models(
                method,
                &prepared_points,
                cancel,
            )) {
                rows[position].model_runs = runs;
            }
            return rows;
        }
        // Each point has its own steps, so that a row does not depend on the other points.
        for (position, point) in prepared_indices.into_iter().zip(prepared_points) {
            self.refine(&mut rows[position], point, cancel);
            if cancel.is_requested() {
                break;
            }
        }
        rows
    }

    /// Integrates both models at some points by one method.
    fn run_both_models(
        &self,
        method: OscillatorMethod,
        points: &[&PreparedPoint<C, P>],
        cancel: Cancel<'_>,
    ) -> Vec<[ModelRun<C>; 2]> {
        let end_s = self.plan.end_s;
        let run_model = |model| {
            Integration::<O, C, D, P> {
                model,
                method,
                points,
                end_s,
                cancel,
                oscillator: PhantomData,
            }
            .integrate()
        };
        let run_pairs = run_model(OscillatorModel::Nonlinear)
            .into_iter()
            .zip(run_model(OscillatorModel::Linear));
        run_pairs.map(|(nonlinear, linear)| [nonlinear, linear]).collect()
    }

    /// Integrates both models with steps that are halved until two runs agree.
    fn refine(&self, row: &mut PointRuns<C>, point: &PreparedPoint<C, P>, cancel: Cancel<'_>) {
        let Steps::Checked(accuracy) = self.plan.integrator.steps() else { return };
        let channels = self.channels();
        let mut step_s =
            (FIRST_STEP_RAD / point.highest_frequency_rad_per_s()).min(self.plan.end_s / 8.0);
        for run_index in 0..MAX_HALVING_RUNS {
            let model_runs =
                self.run_both_models(OscillatorMethod::Rk4(step_s), &[point], cancel)[0];
            row.relative_error = if run_index > 0 {
                error_of_finer_run(&row.model_runs, &model_runs, &channels)
            } else {
                None
            };
            row.is_converged = Some(row.relative_error.is_some_and(|error| error <= accuracy));
            row.model_runs = model_runs;
            if row.is_converged == Some(true) {
                return;
            }
            step_s *= 0.5;
        }
    }
}

/// Returns the relative error of the finer runs; `None` if any run failed.
fn error_of_finer_run<const C: usize>(
    coarse_runs: &[ModelRun<C>; 2],
    fine_runs: &[ModelRun<C>; 2],
    channels: &[usize],
) -> Option<f64> {
    let mut max_difference = 0.0_f64;
    for (coarse_run, fine_run) in coarse_runs.iter().zip(fine_runs) {
        if coarse_run.failure.or(fine_run.failure).is_some() {
            return None;
        }
        let max_peak = fine_run.peaks.iter().copied().fold(0.0, f64::max);
        for &channel in channels {
            let a = coarse_run.peaks[channel];
            let b = fine_run.peaks[channel];
            if a != b {
                max_difference =
                    max_difference.max((a - b).abs() / b.max(AMPLITUDE_FLOOR * max_peak));
            }
        }
    }
    Some(RICHARDSON_FACTOR * max_difference)
}

impl<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> Evaluator
    for RowEvaluator<'_, O, C, D, P>
{
    fn evaluate(&self, source: &RowSource<'_>, sink: &RowSink<'_>, context: &RunContext<'_>) {
        let columns = map_columns(self.plan);
        rayon::broadcast(|_| {
            while !context.must_stop() {
                let (points, axis_values): (Vec<u64>, Vec<Vec<f64>>) =
                    std::iter::from_fn(source).take(MAX_LANES).unzip();
                if points.is_empty() {
                    break;
                }
                let rows = self.compare_points(&axis_values, Cancel::When(&|| context.must_stop()));
                // The rows may be incomplete if the engine was stopped.
                if context.must_stop() {
                    break;
                }
                for (&point, row) in points.iter().zip(&rows) {
                    pass_rows(&columns, point, [row], sink);
                }
            }
        });
    }
}

//! Evaluation of single points.

use lane_ode::{Cancel, Failure, Simd};
use sweep_parameter::RatioLimits;
use washer_model::{
    Channel, Disturbance, HeldSpeed, InitialDeviation, Method, ModelKind, Point, PointInput,
    Response, StartRule, Timing, find_attractors, find_responses, integrate_history, prepare,
};
use washer_row::{
    Deviations, DwellPeaks, LevelRun, MethodKind, NextStep, Outcome, OutcomePurpose,
    RefinementLevels, RefinementRule, RowRefinement, RowRule, Status, Trajectory, integrate_points,
};

use crate::setup::Setup;

/// The reason why a point has no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointError {
    /// A number of the machine is out of its range.
    Impossible,
    /// The machine has no static equilibrium.
    NoEquilibrium,
}

/// The results of both models at a point. Arrays of two have the nonlinear model first.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// The row of a map. A quick answer lacks the numbers that follow from the comparison of runs.
    pub outcome: Outcome,
    /// The amplitudes of all channels by the criterion (m, rad), also of channels that the verdict
    /// does not compare.
    pub amplitudes: [Deviations; 2],
    /// The ratios of all channels, also of those that the verdict does not compare.
    pub ratios: Vec<Option<f64>>,
    /// The index of the refinement level of each model's numbers.
    pub level_indices: [usize; 2],
    /// The kind of the method of each model's numbers.
    pub method_kinds: [MethodKind; 2],
    /// The estimated relative error of each model's numbers, if it is known.
    pub errors: [Option<f64>; 2],
}

impl Answer {
    fn new(
        outcome: Outcome,
        amplitudes: [Deviations; 2],
        level_indices: [usize; 2],
        levels_by_model: &[RefinementLevels; 2],
        limits: RatioLimits,
    ) -> Self {
        let to_all_channels = |run: &Trajectory, amplitudes: &Deviations| match run.status {
            Status::Ok => Trajectory { amplitudes: amplitudes.to_vec(), ..run.clone() },
            failure => Trajectory::failed(failure),
        };
        let nonlinear = to_all_channels(&outcome.nonlinear, &amplitudes[0]);
        let linear = to_all_channels(&outcome.linear, &amplitudes[1]);
        let mut all_channels_outcome = Outcome::new(outcome.point, nonlinear, linear);
        all_channels_outcome.compare(&Channel::ALL, limits);
        let ratios = all_channels_outcome.verdict.ratios;
        let method_kinds =
            [0, 1].map(|model| levels_by_model[model].levels[level_indices[model]].kind);
        Self { outcome, amplitudes, ratios, level_indices, method_kinds, errors: [None; 2] }
    }
}

/// The motion of one model at equal time intervals.
#[derive(Clone, Debug, PartialEq)]
pub struct PointHistory {
    /// The reason and the time (s) of a failure, at which the lists end.
    pub failure: Option<(Failure, f64)>,
    /// The deviations from equilibrium in the order of [`Channel::ALL`] (m, rad).
    pub channels: Vec<[f64; Channel::ALL.len()]>,
    /// The gap between drum and tub (m).
    pub gaps_m: Vec<f64>,
}

/// Returns the input of a point: that of the setup with these values of its sliders. Sliders
/// without a value have that of the setup.
pub(crate) fn point_input(setup: &Setup, values: &[f64]) -> Result<PointInput, PointError> {
    let Setup { machine, spin, rule, .. } = setup;
    let machine = machine.clone();
    let spin = spin.clone();
    let mut input = PointInput { machine, spin, window_s: rule.window_s };
    for (parameter, &value) in setup.sliders.parameters.iter().zip(values) {
        if !parameter.range().contains(value) {
            return Err(PointError::Impossible);
        }
        input.write(parameter, value);
    }
    let [from_s, to_s] = input.window_s;
    let is_window_valid = from_s < to_s && to_s <= rule.end_s;
    let violations = [input.machine.violations(), input.spin.violations()].concat();
    if !is_window_valid || !violations.is_empty() {
        return Err(PointError::Impossible);
    }
    Ok(input)
}

/// Returns the refinement levels of both models for these values of the sliders.
fn refinement_levels<'a>(setup: &'a Setup, values: &[f64]) -> &'a [RefinementLevels; 2] {
    let other_sliders = setup.sliders.parameters.iter().zip(values).skip(setup.sliders.axis_count);
    let differs_from_setup = |(parameter, value): (&washer_model::MachineParameter, &f64)| {
        parameter.get(&setup.machine, &setup.spin) != Some(*value)
    };
    if other_sliders.into_iter().any(differs_from_setup) {
        &setup.wide_levels
    } else {
        &setup.levels
    }
}

/// Prepares a point for integration.
///
/// # Errors
///
/// Returns a [`PointError`] if the point is impossible or has no equilibrium.
fn prepare_point(setup: &Setup, values: &[f64]) -> Result<Point, PointError> {
    let PointInput { machine, spin, window_s } = point_input(setup, values)?;
    let timing = Timing { end_s: setup.rule.end_s, window_s, checkpoints: setup.checkpoints };
    let mut points = prepare(Simd::Scalar, &[(machine, spin)], &timing);
    points.pop().and_then(Result::ok).ok_or(PointError::NoEquilibrium)
}

/// Integrates both models at some points at the quick level, in lanes, without an error estimate.
pub fn evaluate_points(setup: &Setup, points: &[&[f64]]) -> Vec<Result<Answer, PointError>> {
    let prepared_points: Vec<_> = points
        .iter()
        .map(|values| (refinement_levels(setup, values), prepare_point(setup, values)))
        .collect();
    let rule = RowRule { accuracy: f64::INFINITY, ..setup.rule.clone() };
    let mut answers: Vec<Result<Answer, PointError>> = Vec::with_capacity(points.len());
    // Points with the same refinement levels are integrated together in lanes.
    for group in prepared_points.chunk_by(|(a, _), (b, _)| core::ptr::eq(*a, *b)) {
        let levels = group[0].0;
        let valid_points: Vec<&Point> =
            group.iter().filter_map(|(_, prepared_point)| prepared_point.as_ref().ok()).collect();
        let level_indices = [0, 1].map(|model| quick_level_index(&levels[model]));
        let [nonlinear, linear] = [0, 1].map(|model| {
            run_method(model, levels[model].method(level_indices[model]), &valid_points, &rule)
        });
        let mut run_pairs = nonlinear.into_iter().zip(linear);
        let to_answer = |(nonlinear, linear): (LevelRun, LevelRun)| {
            let amplitudes = [nonlinear.amplitudes, linear.amplitudes];
            let mut outcome = Outcome::new(0, nonlinear.trajectory, linear.trajectory);
            outcome.compare(&rule.channels, rule.limits);
            Answer::new(outcome, amplitudes, level_indices, levels, rule.limits)
        };
        answers.extend(group.iter().map(|(_, prepared_point)| match prepared_point {
            Ok(_) => run_pairs.next().map(to_answer).ok_or(PointError::NoEquilibrium),
            Err(error) => Err(*error),
        }));
    }
    answers
}

/// Computes a point like a row of the map: each model is refined until two levels agree.
///
/// # Errors
///
/// Returns a [`PointError`] if the point is impossible or has no equilibrium.
pub fn check_point(setup: &Setup, values: &[f64]) -> Result<Answer, PointError> {
    let point = prepare_point(setup, values)?;
    let levels = refinement_levels(setup, values);
    let rule = &setup.rule;
    let refinement_rule = RefinementRule { levels, purpose: OutcomePurpose::Row, row_rule: rule };
    let mut refinement = RowRefinement::default();
    let mut runs = Vec::new();
    let outcome = loop {
        let requests = match refinement.advance(runs, 0, &point, refinement_rule) {
            NextStep::Done(outcome) => break *outcome,
            NextStep::Runs(requests) => requests,
        };
        runs = Vec::with_capacity(requests.len());
        for (model, level_index) in requests {
            let model_levels = &levels[model];
            let perturbed = model_levels.is_perturbed(level_index).then(|| point.perturbed());
            let start_point = perturbed.as_ref().unwrap_or(&point);
            let level_runs =
                run_method(model, model_levels.method(level_index), &[start_point], rule);
            runs.extend(
                level_runs.into_iter().map(|level_runs| ((model, level_index), level_runs)),
            );
        }
    };
    let finest_runs = [0, 1].map(|model| refinement.finest_run(model, &point, refinement_rule));
    let [Some(nonlinear), Some(linear)] = finest_runs else {
        return Err(PointError::NoEquilibrium);
    };
    let finest_runs = [nonlinear, linear];
    let amplitudes = finest_runs.map(|(run, ..)| run.amplitudes);
    let level_indices = finest_runs.map(|(_, level_index, _)| level_index);
    let answer = Answer::new(outcome, amplitudes, level_indices, levels, rule.limits);
    Ok(Answer { errors: finest_runs.map(|(.., error)| error), ..answer })
}

fn run_method(model: usize, method: &Method, points: &[&Point], rule: &RowRule) -> Vec<LevelRun> {
    let runs = integrate_points(
        Simd::widest(),
        ModelKind::ALL[model],
        method,
        points,
        rule,
        Cancel::Never,
    );
    runs.unwrap_or_default()
}

/// Returns the index of the quick level: the second level, which is accurate enough for most rows,
/// or the first level if no modes are capped.
fn quick_level_index(levels: &RefinementLevels) -> usize {
    usize::from(levels.levels.get(1).is_some_and(|second_level| second_level.kind.is_capped()))
}

/// Integrates the motion of one model at a point, at a refinement level or by default at the quick
/// one, and returns it at intervals of `interval_s` from 0 to the end.
///
/// # Errors
///
/// Returns a [`PointError`] if the point is impossible or has no equilibrium.
pub fn integrate_motion(
    setup: &Setup,
    values: &[f64],
    model: ModelKind,
    level_index: Option<usize>,
    interval_s: f64,
) -> Result<PointHistory, PointError> {
    let point = prepare_point(setup, values)?;
    let levels = &refinement_levels(setup, values)[model as usize];
    let method = level_index.and_then(|level_index| levels.levels.get(level_index));
    let method = method.unwrap_or(&levels.levels[quick_level_index(levels)]);
    let history =
        integrate_history(model, method, &point, &InitialDeviation::default(), interval_s);
    let instants = (0..history.len()).filter_map(|k| history.instant_outputs(k));
    let (channels, gaps_m) = instants.map(|instant| (instant.channels, instant.gap_m)).unzip();
    Ok(PointHistory { failure: history.failure, channels, gaps_m })
}

/// Returns the fastest growing disturbance of a point's periodic response at each of some constant
/// speeds (rpm), and whether the response is on the curve of a machine that runs up; `None` without
/// a response.
///
/// # Errors
///
/// Returns a [`PointError`] if the point is impossible or has no equilibrium.
pub fn find_disturbances(
    setup: &Setup,
    values: &[f64],
    speeds_rpm: &[f64],
) -> Result<Vec<Option<(Disturbance, bool)>>, PointError> {
    let point = prepare_point(setup, values)?;
    let held_speeds: Vec<HeldSpeed<'_>> =
        speeds_rpm.iter().map(|&speed_rpm| HeldSpeed { point: &point, speed_rpm }).collect();
    let disturbance =
        |first_response: &Response| (first_response.disturbance(), first_response.is_on_curve);
    let results_by_speed = find_responses(&held_speeds, Cancel::Never).into_iter();
    Ok(results_by_speed.map(|answer| answer.ok()?.first().map(disturbance)).collect())
}

/// Returns the largest attractor of a point over some constant speeds (rpm), from the default
/// starts; `None` if none was found.
///
/// # Errors
///
/// Returns a [`PointError`] if the point is impossible or has no equilibrium.
pub fn find_largest_attractor(
    setup: &Setup,
    values: &[f64],
    speeds_rpm: &[f64],
) -> Result<Option<DwellPeaks>, PointError> {
    let point = prepare_point(setup, values)?;
    let held_speeds: Vec<HeldSpeed<'_>> =
        speeds_rpm.iter().map(|&speed_rpm| HeldSpeed { point: &point, speed_rpm }).collect();
    let no_carried_states = vec![None; held_speeds.len()];
    let attractors = find_attractors(
        Simd::widest(),
        &held_speeds,
        &no_carried_states,
        &StartRule::default(),
        Cancel::Never,
    );
    Ok(DwellPeaks::from_attractors(speeds_rpm, &attractors))
}

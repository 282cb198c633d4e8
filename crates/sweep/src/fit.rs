//! `sweep fit`: fits parameters of the machine to measurements, and computes their errors and the
//! verdict of the fitted machine.
//!
//! `measurement`, `pulses` and `speed` read a measurement. `model` compares it with the model and
//! its derivatives, `search` finds the least cost, `statistics` computes the errors of the fitted
//! numbers, and `report` holds the results. `evaluations` stores the evaluations of a fit.

mod algebra;
mod curves;
mod evaluations;
mod fixed_numbers;
mod measurement;
mod model;
mod pulses;
mod report;
mod search;
mod spectrum;
mod speed;
mod statistics;
#[cfg(test)]
mod tests;
mod units;
mod verdict;

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use washer_model::{MachineParameter, Method, MethodKind, ModelKind, Target};

use crate::config::WasherGridInput;
use crate::engine::simd_from_environment;
use lane_ode::Cancel;
use sweep_engine::config::{Diagnostic, Location, Report as Mistakes};
use sweep_engine::design::{DesignRule, DistributionShape};
use sweep_engine::{Design, Diagnostics, Distribution, Error};

use algebra::EigenDecomposition;
pub(crate) use evaluations::Evaluations;
use fixed_numbers::FixedNumbers;
pub(crate) use measurement::Measurement;
use measurement::REST_SPEED_RATIO;
pub(crate) use model::FitCase;
use model::{FreeParameter, NormalEquations, Problem, SignalComparison};
pub(crate) use report::FitReport;
use search::{Descent, DescentError, MAX_EVALUATIONS, descend};
use statistics::Statistics;

/// The range of further starting values of a parameter without a given range, as factors of its
/// first starting value. Basis: a data sheet is seldom wrong by more. Doubling the width tries more
/// distant minima with fewer starts near the first.
const START_FACTOR_RANGE: [f64; 2] = [0.3, 1.7];
/// The greatest number of descents. They begin at the first starting point and at the further ones
/// with the least cost. Basis: the test data have two minima. Doubling it doubles the time of a fit
/// with `--starts`.
const MAX_DESCENTS: usize = 3;
/// The seed of all random numbers of a fit.
const SEED: u64 = 1;
/// The greatest change of a fitted parameter, in standard errors, at which the integration step is
/// not halved. Basis: the change is that by half the step, and adds some five percent to a standard
/// error. Doubling it adds four times as much.
const MAX_STEP_EFFECT: f64 = 0.3;
/// The greatest number of halvings of the integration step. Basis: test
/// `reference_data_lead_to_the_truth` needs none. Doubling it makes a fit that needs them four
/// times as long.
const MAX_STEP_HALVINGS: usize = 2;

/// The options of a fit.
#[derive(Clone, Debug, clap::Args)]
pub struct FitOptions {
    /// Parameters to fit, each optionally with bounds; separated by commas
    #[arg(long, value_name = "NAME[=FROM:TO],...", value_delimiter = ',')]
    pub free: Vec<String>,
    /// Parameters with a separate value for every file
    #[arg(long, value_name = "NAME[=FROM:TO],...", value_delimiter = ',')]
    pub own: Vec<String>,
    /// Fit the nonlinear model, or the linear one
    #[arg(long, value_name = "MODEL", default_value = ModelKind::Nonlinear.name())]
    #[arg(value_parser = ModelKind::ALL.map(ModelKind::name))]
    pub model: String,
    /// Take the clock of every file as it is, instead of fitting a shift of it
    #[arg(long)]
    pub no_shift: bool,
    /// Number of starting points of the search
    #[arg(long, value_name = "N", default_value_t = 1)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub starts: u32,
    /// Number of further fits, to resampled residuals
    #[arg(long, value_name = "N", default_value_t = 0)]
    #[arg(value_parser = clap::value_parser!(u32).range(0..=10_000))]
    pub bootstrap: u32,
    /// Standard deviations of fixed numbers, which widen intervals; `gain` is that of the sensors.
    /// All others have those of their kind, or with `none` are taken as exact
    #[arg(long, value_name = "NAME=TOLERANCE[%],...", value_delimiter = ',')]
    pub known: Vec<String>,
    /// Number of samples of the fitted distribution, for the verdict's probability; 0 for none
    #[arg(long, value_name = "N", default_value_t = 64)]
    #[arg(value_parser = clap::value_parser!(u32).range(0..=100_000))]
    pub draws: u32,
}

impl FitOptions {
    /// Checks that counts are in the ranges that the command line accepts, for callers other than
    /// the command line.
    ///
    /// # Errors
    /// An option that is out of its range.
    pub(crate) fn check(&self) -> Result<(), sweep_engine::Error> {
        for (option, count, min_count, max_count) in [
            ("starts", self.starts, 1, 10_000),
            ("bootstrap", self.bootstrap, 0, 10_000),
            ("draws", self.draws, 0, 100_000),
        ] {
            if !(min_count..=max_count).contains(&count) {
                let expected = format!("a number from {min_count} to {max_count}");
                return Err(sweep_engine::Error::option(option, count, expected));
            }
        }
        Ok(())
    }
}

/// A finished fit.
pub(crate) struct FinishedFit<'a> {
    pub(crate) problem: Problem<'a>,
    pub(crate) x: Vec<f64>,
    comparisons: Vec<SignalComparison>,
    pub(crate) report: FitReport,
    /// The stored evaluations, which are deleted once the machine file is written.
    pub(crate) evaluations: Option<Evaluations>,
}

/// The context of a fit: cancellation, progress and stored evaluations.
pub(crate) struct FitContext<'a> {
    /// The cancellation. A cancelled fit has no valid result.
    pub(crate) cancel: Cancel<'a>,
    /// A function that is called after every evaluation with the number of evaluations.
    pub(crate) report_evaluations: &'a (dyn Fn(usize) + Sync),
    /// The machine file beside which evaluations are stored.
    pub(crate) output: Option<&'a Path>,
    /// Whether to discard stored evaluations.
    pub(crate) fresh: bool,
}

/// Prepares a case of a fit: a measurement, and the plan of its run by a grid and the constants of
/// this measurement.
///
/// # Errors
/// Returns mistakes in the grid and the constants. An axis without a constant is fixed at the
/// middle of its range.
pub(crate) fn prepare_case(
    grid: &WasherGridInput,
    constants: &[String],
    mut measurement: Measurement,
) -> Result<FitCase, Error> {
    let (plan, _) = grid.load_point(&[&middle_constants(grid, constants)?, constants].concat())?;
    measurement.count_from_first_row(plan.end_s);
    let smoothed_spin = measurement.smooth_spin();
    Ok(FitCase { plan, measurement, smoothed_spin })
}

/// Returns the middle value of every axis that has several values and no constant, as NAME=VALUE.
fn middle_constants(
    grid: &WasherGridInput,
    constants: &[String],
) -> Result<Vec<String>, Diagnostics> {
    let plan = grid.load()?;
    let is_given =
        |name: &str| constants.iter().any(|constant| constant.split('=').next() == Some(name));
    let varied_axes =
        plan.axes.iter().filter(|axis| axis.values.len() > 1 && !is_given(&axis.parameter.name));
    let format_middle_constant = |axis: &crate::plan::Axis| {
        let [from, to] = axis.values.extremes();
        format!("{}={}", axis.parameter.name, 0.5 * (from + to))
    };
    Ok(varied_axes.map(format_middle_constant).collect())
}

/// Reads the free parameters of `--free` and `--own`.
fn read_free_parameters(
    options: &FitOptions,
    cases: &[FitCase],
) -> Result<Vec<FreeParameter>, Diagnostics> {
    let mistakes = Mistakes::default();
    let mut free_parameters: Vec<FreeParameter> = Vec::new();
    let shared_texts = options.free.iter().map(|text| (text, "--free", &cases[..1]));
    let own_texts = options.own.iter().map(|text| (text, "--own", cases));
    for (text, option, cases) in shared_texts.chain(own_texts) {
        let location = Location::new(mistakes.add(option, text.as_str()), 0..text.len());
        for (k, case) in cases.iter().enumerate() {
            let earlier_parameters: &[FreeParameter] =
                if cases.len() == 1 { &free_parameters } else { &[] };
            let Some(read_parameter) =
                read_free_parameter(text, case, earlier_parameters, (&location, &mistakes))
            else {
                break;
            };
            free_parameters
                .push(FreeParameter { case: (option == "--own").then_some(k), ..read_parameter });
        }
    }
    mistakes.finish(Some(free_parameters))
}

/// Reads a free parameter from the text of an option, and reports mistakes in the text. A parameter
/// among the earlier ones is a mistake.
fn read_free_parameter(
    text: &str,
    case: &FitCase,
    earlier_parameters: &[FreeParameter],
    (location, mistakes): (&Location, &Mistakes),
) -> Option<FreeParameter> {
    let refuse = |title: String, expected: &str| mistakes.refuse(location, title, expected);
    let (name, range_text) = match text.split_once('=') {
        Some((name, range)) => (name.trim(), Some(range)),
        None => (text.trim(), None),
    };
    let machine = &case.plan.model.machine;
    let spin = case.spin();
    let parameter = match MachineParameter::find(name, machine, spin) {
        Ok(parameter) if !matches!(parameter.target(), Target::Window(_)) => parameter,
        Ok(_) => {
            return refuse(format!("`{name}` is no number of the machine"), "expected another");
        }
        Err(error) => {
            let parameters = MachineParameter::all(machine, spin);
            let title = format!("`{name}` cannot be fitted: {error}");
            let refusal = Diagnostic::new(title).at_location(location, "expected a parameter");
            mistakes.push(
                refusal
                    .with_nearest_name(name, parameters.iter().map(|parameter| parameter.name())),
            );
            return None;
        }
    };
    if earlier_parameters.iter().any(|free| free.parameter == parameter) {
        return refuse(format!("`{name}` is free twice"), "expected each once");
    }
    let allowed_bounds = parameter.range().bounds();
    let parsed_range = range_text.map(|range| {
        let (from, to) = range.split_once(':')?;
        let [from, to] = [from.trim().parse().ok()?, to.trim().parse().ok()?];
        let is_within_bounds = allowed_bounds[0] <= from && from < to && to <= allowed_bounds[1];
        (is_within_bounds && f64::is_finite(from) && f64::is_finite(to)).then_some([from, to])
    });
    let Some(range) = parsed_range.unwrap_or(Some(allowed_bounds)) else {
        let expected = "expected NAME=FROM:TO with FROM below TO, both allowed";
        return refuse(format!("`{text}` is no range"), expected);
    };
    let value = parameter.get(machine, spin).filter(|value| (range[0]..=range[1]).contains(value));
    let start = match value {
        _ if parsed_range.is_some() => Some(value.unwrap_or(0.5 * (range[0] + range[1]))),
        value => value.filter(|value| *value != 0.0),
    };
    let Some(start) = start else {
        let expected = "expected a range, NAME=FROM:TO, or a value by --set";
        let reason = if value.is_some() { "is 0" } else { "differs from part to part" };
        return refuse(format!("`{name}` {reason}: there is no value to start from"), expected);
    };
    Some(FreeParameter { parameter, range, start, case: None })
}

/// Fits the free parameters on all threads of the current rayon pool; `None` after a cancellation.
///
/// # Errors
/// Returns mistakes in the options, an error if the data do not depend on a parameter, and an error
/// if a trajectory of the model fails at the start.
pub(crate) fn fit<'a>(
    cases: Vec<FitCase>,
    options: &FitOptions,
    context: &FitContext<'a>,
) -> Result<Option<FinishedFit<'a>>, Error> {
    match run_fit(cases, options, context) {
        Ok(finished_fit) => Ok(Some(finished_fit)),
        Err(DescentError::Cancelled) => Ok(None),
        Err(DescentError::Refused(error)) => Err(error),
    }
}

fn run_fit<'a>(
    cases: Vec<FitCase>,
    options: &FitOptions,
    context: &FitContext<'a>,
) -> Result<FinishedFit<'a>, DescentError> {
    let free_parameters = read_free_parameters(options, &cases)?;
    let fixed_numbers = FixedNumbers::read(&options.known, &cases[0], &free_parameters)?;
    let method = Problem::select_method(&cases).map_err(Error::model)?;
    let model_kind = ModelKind::named(&options.model).unwrap_or(ModelKind::Nonlinear);
    let simd = simd_from_environment()?;
    let fits_shift = !options.no_shift;
    let cancel = context.cancel;
    let mut problem =
        Problem { cases, free_parameters, model_kind, fits_shift, method, simd, cancel };
    let sample_count: usize =
        problem.cases.iter().map(|case| case.measurement.count_samples()).sum();
    let unknown_count = problem.unknown_count() + problem.signals().count();
    if unknown_count >= sample_count {
        let expected = "expected more samples, or fewer `--free`";
        let message = format!("{unknown_count} unknowns for {sample_count} samples: {expected}");
        return Err(Error::Refused(message).into());
    }
    for case in &problem.cases {
        let first_rpm = case.first_rpm().unwrap_or_default();
        if first_rpm.abs() > REST_SPEED_RATIO * case.greatest_rpm() {
            let unknown_reason = "where its unbalance was then is not known: expected the record \
                                  from rest on";
            let message = format!(
                "{} begins at {first_rpm:.0} rpm, and {unknown_reason}",
                case.measurement.name
            );
            return Err(Error::Refused(message).into());
        }
    }
    let open_evaluations = |output| Evaluations::open(output, &problem, context.fresh);
    let stored_evaluations = context.output.map(open_evaluations).transpose()?;
    let evaluation_count = AtomicUsize::new(0);
    // A fit to data in a wrong unit takes long and does not converge, so it is tried with few
    // evaluations first.
    let mut suspected_unit_by_case = units::find_suspected_units(&problem)?;
    let is_suspect = suspected_unit_by_case.iter().any(Option::is_some);
    let search = MinimumSearch {
        problem: &problem,
        stored_evaluations: stored_evaluations.as_ref(),
        context,
        evaluation_count: &evaluation_count,
        max_evaluations: if is_suspect { units::MAX_TRIAL_EVALUATIONS } else { MAX_EVALUATIONS },
    };
    let start_count = u64::from(options.starts);
    let mut minima = search.find_minima(start_count);
    let best_explains_record = |minima: &Vec<Descent>| {
        minima.first().is_some_and(|best| units::explains_record(&problem, best))
    };
    if is_suspect && minima.as_ref().is_ok_and(best_explains_record) {
        minima =
            MinimumSearch { max_evaluations: MAX_EVALUATIONS, ..search }.find_minima(start_count);
    }
    stored_evaluations.as_ref().map_or(Ok(()), Evaluations::write)?;
    let mut minima = minima?;
    let mut best = minima.first().cloned().ok_or_else(failed_start_error)?;
    let mut step_effect = None;
    // An integration step that is too long for the corners of forces changes the fitted
    // parameters; then the step is halved.
    for _ in 0..=MAX_STEP_HALVINGS {
        if problem.method.kind != MethodKind::Rk4 || !best.is_converged {
            break;
        }
        let step_s = problem.method.step_s;
        let comparisons = problem.compare(&best.x).ok_or(DescentError::Cancelled)?;
        problem.method = Method::rk4(0.5 * step_s);
        let finer_comparisons = problem.compare(&best.x).ok_or(DescentError::Cancelled)?;
        let inverse_normal_matrix = algebra::pseudo_inverse(&best.equations.normal_matrix);
        let changes = standardised_changes(
            &inverse_normal_matrix,
            &best.equations,
            &comparisons,
            &finer_comparisons,
        );
        let greatest_change = changes.into_iter().fold(0.0, f64::max);
        step_effect = Some(greatest_change);
        if greatest_change < MAX_STEP_EFFECT {
            problem.method = Method::rk4(step_s);
            break;
        }
        let search = MinimumSearch::without_store(&problem, context, &evaluation_count);
        best = search.descend_from(&best.x)?.ok_or_else(failed_start_error)?;
        minima[0] = best.clone();
    }
    let total_evaluations = evaluation_count.load(Ordering::Relaxed);
    let comparisons = problem.compare(&best.x).ok_or(DescentError::Cancelled)?;
    // A search of data in a wrong unit may change the parameters so much that only the comparison
    // at the start shows the unit.
    let start_comparisons =
        problem.compare(&problem.start_point()).unwrap_or_else(|| comparisons.clone());
    let mut statistics = Statistics::from_comparisons(&problem, &comparisons, &best.equations);
    let tachometer_covariance = compute_tachometer_covariance(&problem, &best, &comparisons);
    statistics::add_scaled(&mut statistics.covariance, &tachometer_covariance, 1.0);
    if problem.model_kind == ModelKind::Linear {
        // The fitted parameters may compensate for the terms that the linear model lacks, so that
        // the residual does not show the lack.
        problem.model_kind = ModelKind::Nonlinear;
        statistics.standardised_bias = problem.compare(&best.x).map(|nonlinear| {
            standardised_changes(&statistics.covariance, &best.equations, &comparisons, &nonlinear)
        });
        problem.model_kind = ModelKind::Linear;
    }
    let mut bootstrap_fits = None;
    if options.bootstrap > 0 && best.is_converged {
        bootstrap_fits = Some(fit_bootstrap_samples(
            &mut problem,
            &best.x,
            &comparisons,
            options.bootstrap,
            context,
        )?);
    }
    if best.is_converged && statistics.objection(&problem).is_none() {
        let variances = statistics.signal_variances(&best.equations);
        statistics.influences =
            fixed_numbers.influences(&problem, &best.x, &comparisons, &best.equations, &variances);
    }
    if statistics.least_explained_signal().is_none() {
        suspected_unit_by_case.fill(None);
    }
    let report_data = report::ReportData {
        problem: &problem,
        suspected_unit_by_case: &suspected_unit_by_case,
        minima: &minima,
        comparisons: &comparisons,
        start_comparisons: &start_comparisons,
        statistics: &statistics,
        evaluations: total_evaluations,
        step_effect,
        bootstrap_fits: bootstrap_fits.as_deref(),
        draws: options.draws.into(),
    };
    let report = report_data.report()?;
    if cancel.is_requested() {
        return Err(DescentError::Cancelled);
    }
    Ok(FinishedFit { problem, x: best.x, comparisons, report, evaluations: stored_evaluations })
}

/// Returns the error for a starting point at which the model fails.
fn failed_start_error() -> Error {
    let message = "the model does not get through the record at the starting values: expected a \
                   start from which it does (`--set NAME=VALUE`)";
    Error::Refused(message.to_owned())
}

/// Returns the change of each unknown, in standard errors, by which a fit of the model of
/// `other_comparisons` would differ from that of the model of `comparisons`.
fn standardised_changes(
    covariance: &[Vec<f64>],
    equations: &NormalEquations,
    comparisons: &[SignalComparison],
    other_comparisons: &[SignalComparison],
) -> Vec<f64> {
    let mut rhs = vec![0.0; covariance.len()];
    for ((comparison, other), sigma) in
        comparisons.iter().zip(other_comparisons).zip(&equations.sigma)
    {
        let residual_pairs = comparison.residual.iter().zip(&other.residual);
        let difference: Vec<f64> =
            residual_pairs.map(|(residual, other)| residual - other).collect();
        for (rhs, slope) in rhs.iter_mut().zip(&comparison.slopes) {
            *rhs -= algebra::dot(slope, &difference) / (sigma * sigma);
        }
    }
    let inverse_normal_matrix = algebra::pseudo_inverse(&equations.normal_matrix);
    let standardised_change = |k: usize| {
        let variance = covariance[k][k];
        let change = algebra::dot(&inverse_normal_matrix[k], &rhs);
        if variance > 0.0 { change.abs() / variance.sqrt() } else { 0.0 }
    };
    (0..rhs.len()).map(standardised_change).collect()
}

/// Computes the part of the unknowns' covariance that is due to the noise of the tachometers.
fn compute_tachometer_covariance(
    problem: &Problem<'_>,
    best: &Descent,
    comparisons: &[SignalComparison],
) -> Vec<Vec<f64>> {
    let unknown_count = problem.unknown_count();
    let inverse_normal_matrix = algebra::pseudo_inverse(&best.equations.normal_matrix);
    let mut covariance = vec![vec![0.0; unknown_count]; unknown_count];
    for (case_index, fit_case) in problem.cases.iter().enumerate() {
        let random_spins =
            fit_case.smoothed_spin.as_ref().map(|spin| &spin.random_spins[..]).unwrap_or_default();
        let sigma = &best.equations.sigma[..];
        let right_sides = problem.compute_right_sides(
            case_index,
            &best.x,
            (comparisons, sigma),
            random_spins.len(),
            |k, _, spin| {
                *spin = random_spins[k].clone();
            },
        );
        let right_sides: Vec<Vec<f64>> = right_sides.into_iter().flatten().collect();
        for rhs in &right_sides {
            let changes: Vec<f64> =
                inverse_normal_matrix.iter().map(|row| algebra::dot(row, rhs)).collect();
            algebra::add_outer(&mut covariance, &changes, 1.0 / right_sides.len() as f64);
        }
    }
    covariance
}

/// Fits `count` times with residuals that are resampled in blocks (the block bootstrap), and
/// returns the free parameters of each fit.
fn fit_bootstrap_samples(
    problem: &mut Problem<'_>,
    x: &[f64],
    comparisons: &[SignalComparison],
    count: u32,
    context: &FitContext<'_>,
) -> Result<Vec<Vec<f64>>, DescentError> {
    /// The number of samples in a block of the block bootstrap. Basis: residuals of the test data
    /// are correlated over some ten samples. Doubling it preserves slower correlations, but leaves
    /// fewer blocks.
    const BLOCK_SAMPLES: usize = 100;
    let measured_cases = problem.cases.clone();
    let uniform_design = Design::Spread { rule: DesignRule::MonteCarlo, points: 0, seed: SEED };
    let mut draw_count = 0;
    let mut fitted_parameter_sets = Vec::new();
    for _ in 0..count {
        for comparison in comparisons {
            let residual = &comparison.residual;
            let mut resampled = Vec::with_capacity(residual.len() + BLOCK_SAMPLES);
            while resampled.len() < residual.len() {
                let fraction = uniform_design.position(draw_count, 0).unwrap_or(0.5);
                draw_count += 1;
                let first_sample = (fraction * residual.len() as f64) as usize;
                resampled.extend(
                    (first_sample..first_sample + BLOCK_SAMPLES)
                        .map(|i| residual[i % residual.len()]),
                );
            }
            let signal = &mut problem.cases[comparison.case_index].measurement.signals
                [comparison.signal_index];
            let rows: Vec<usize> = signal.samples().map(|(row, _)| row).collect();
            for (row, residual) in rows.into_iter().zip(resampled) {
                signal.values[row] = comparison.model_values[row] + comparison.offset + residual;
            }
        }
        let evaluation_count = AtomicUsize::new(0);
        let search = MinimumSearch::without_store(problem, context, &evaluation_count);
        let refit = search.descend_from(x)?.filter(|refit| refit.is_converged);
        fitted_parameter_sets
            .extend(refit.map(|refit| refit.x[..problem.free_parameters.len()].to_vec()));
    }
    problem.cases = measured_cases;
    Ok(fitted_parameter_sets)
}

/// A search for the least cost of a problem.
struct MinimumSearch<'a> {
    problem: &'a Problem<'a>,
    stored_evaluations: Option<&'a Evaluations>,
    context: &'a FitContext<'a>,
    /// The number of evaluations so far.
    evaluation_count: &'a AtomicUsize,
    /// The greatest number of evaluations of a descent.
    max_evaluations: usize,
}

impl<'a> MinimumSearch<'a> {
    /// Returns a search whose evaluations are not stored.
    fn without_store(
        problem: &'a Problem<'a>,
        context: &'a FitContext<'a>,
        evaluation_count: &'a AtomicUsize,
    ) -> Self {
        Self {
            problem,
            stored_evaluations: None,
            context,
            evaluation_count,
            max_evaluations: MAX_EVALUATIONS,
        }
    }

    /// Computes the normal equations at a point, or reads stored ones.
    fn evaluate(&self, x: &[f64]) -> Result<Option<NormalEquations>, DescentError> {
        let compute_equations = || {
            let comparisons = self.problem.compare(x);
            if self.problem.cancel.is_requested() {
                return Err(DescentError::Cancelled);
            }
            Ok(comparisons.map(|comparisons| self.problem.normal_equations(&comparisons)))
        };
        let equations = self.stored_evaluations.map_or_else(compute_equations, |stored| {
            stored.find_or_compute(x, compute_equations)
        })?;
        (self.context.report_evaluations)(
            1 + self.evaluation_count.fetch_add(1, Ordering::Relaxed),
        );
        Ok(equations)
    }

    /// Runs a descent from a starting point, and returns its end; `None` if the model fails at the
    /// start.
    fn descend_from(&self, start: &[f64]) -> Result<Option<Descent>, DescentError> {
        let ranges: Vec<[f64; 2]> =
            (0..self.problem.unknown_count()).map(|k| self.problem.unknown_range(k)).collect();
        descend(start, &ranges, self.max_evaluations, &|x| self.evaluate(x))
    }

    /// Finds the distinct minima of descents from `start_count` starting points, and returns them
    /// in ascending order of cost.
    fn find_minima(&self, start_count: u64) -> Result<Vec<Descent>, DescentError> {
        let start = self.problem.start_point();
        let join_names_without_influence = |equations: &NormalEquations| {
            let lacks_influence = |k: &usize| equations.normal_matrix[*k][*k] == 0.0;
            let parameters = (0..self.problem.free_parameters.len()).filter(lacks_influence);
            let names: Vec<&str> =
                parameters.map(|k| self.problem.free_parameters[k].parameter.name()).collect();
            (!names.is_empty()).then(|| names.join(", "))
        };
        let no_influence_error = |names: &str| {
            let expected = "expected another channel, another start (`--set NAME=VALUE`), or to \
                            leave it out of `--free`";
            Error::Refused(format!("the measurement does not depend on {names}: {expected}"))
        };
        let names_without_influence =
            self.evaluate(&start)?.as_ref().and_then(join_names_without_influence);
        if let (Some(names), 1) = (&names_without_influence, start_count) {
            return Err(no_influence_error(names).into());
        }
        let mut start_points = vec![start.clone()];
        if start_count > 1 {
            let design = Design::Spread {
                rule: DesignRule::LatinHypercube,
                points: start_count - 1,
                seed: SEED,
            };
            let draw_start_value = |point: u64, k: usize| {
                let FreeParameter { range, start, .. } = &self.problem.free_parameters[k];
                let default_range = START_FACTOR_RANGE.map(|factor| factor * start);
                let has_finite_range = range.iter().all(|end| end.is_finite());
                let [from, to] = if has_finite_range {
                    *range
                } else {
                    [default_range[0].max(range[0]), default_range[1]]
                };
                from + design.position(point, k).unwrap_or(0.5) * (to - from)
            };
            let candidates: Vec<Vec<f64>> = (0..start_count - 1)
                .map(|point| {
                    let mut x = start.clone();
                    (0..self.problem.free_parameters.len())
                        .for_each(|k| x[k] = draw_start_value(point, k));
                    x
                })
                .collect();
            let costs = self.problem.compute_costs(&candidates);
            let mut candidates_by_cost: Vec<usize> =
                (0..candidates.len()).filter(|&k| costs[k].is_finite()).collect();
            candidates_by_cost.sort_by(|&a, &b| costs[a].total_cmp(&costs[b]));
            start_points.extend(
                candidates_by_cost
                    .into_iter()
                    .take(MAX_DESCENTS - 1)
                    .map(|k| candidates[k].clone()),
            );
        }
        let descents: Vec<_> =
            start_points.par_iter().map(|start| self.descend_from(start)).collect();
        let mut minima: Vec<Descent> = Vec::new();
        for descent in descents {
            minima.extend(descent?);
        }
        minima.sort_by(|a, b| a.equations.cost.total_cmp(&b.equations.cost));
        // A parameter without influence at the first start may have one at the end of a descent.
        let names_parameter_without_influence =
            |minimum: &Descent| join_names_without_influence(&minimum.equations).is_some();
        if let Some(names) =
            names_without_influence.filter(|_| minima.iter().all(names_parameter_without_influence))
        {
            return Err(no_influence_error(&names).into());
        }
        let mut distinct_minima: Vec<Descent> = Vec::new();
        for minimum in minima {
            if !distinct_minima.iter().any(|other| self.is_same_minimum(other, &minimum)) {
                distinct_minima.push(minimum);
            }
        }
        Ok(distinct_minima)
    }

    /// Returns whether two descents ended in the same minimum: every free parameter differs by at
    /// most five standard errors, or by at most a thousandth of its value.
    fn is_same_minimum(&self, a: &Descent, b: &Descent) -> bool {
        let inverse_normal_matrix = algebra::pseudo_inverse(&a.equations.normal_matrix);
        (0..self.problem.free_parameters.len()).all(|k| {
            let tolerance =
                (5.0 * inverse_normal_matrix[k][k].max(0.0).sqrt()).max(1e-3 * a.x[k].abs());
            (a.x[k] - b.x[k]).abs() <= tolerance
        })
    }
}

/// Returns a function that returns the component `k` of sample number `point`. The `count` samples
/// of the standard normal distribution are drawn by Latin hypercube sampling.
fn normal_quantile_sampler(count: u64) -> impl Fn(u64, usize) -> f64 {
    let design = Design::Spread { rule: DesignRule::LatinHypercube, points: count, seed: SEED };
    let shape = DistributionShape::Normal { mean: 0.0, sd: 1.0 };
    let normal = Distribution { shape, from: -6.0, to: 6.0 };
    move |point, k| normal.quantile(design.position(point, k).unwrap_or(0.5))
}

/// Draws sets of the free parameters from the fitted distribution by Latin hypercube sampling, each
/// value within its range.
fn draw_parameters(
    problem: &Problem<'_>,
    x: &[f64],
    covariance: &[Vec<f64>],
    count: u64,
) -> Vec<Vec<f64>> {
    let sample_normal = normal_quantile_sampler(count);
    let (unit_matrix, scales) = algebra::scale_to_unit_diagonal(covariance);
    let eigen = EigenDecomposition::from_matrix(&unit_matrix);
    let draw_set = |point: u64| {
        let standard_normal: Vec<f64> =
            (0..scales.len()).map(|k| sample_normal(point, k)).collect();
        let correlated_normal = eigen.apply(&standard_normal, |value| value.max(0.0).sqrt());
        let value_in_range = |k: usize| {
            let [from, to] = problem.unknown_range(k);
            (x[k] + scales[k] * correlated_normal[k]).clamp(from, to)
        };
        (0..scales.len()).map(value_in_range).collect()
    };
    (0..count).map(draw_set).collect()
}

//! `sweep fit`: the numbers with which the model follows a measurement, their errors, and the
//! verdict of the fitted machine.
//!
//! `measured`, `pulses` and `speed` read a measurement. `model` compares it with the model and its
//! derivatives, `search` finds the least cost, `statistics` computes the errors of the fitted
//! numbers, and `report` holds the results. `evaluations` stores the evaluations of a fit.

mod algebra;
mod curves;
mod evaluations;
mod known;
mod measured;
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

use algebra::Symmetric;
pub(crate) use evaluations::Evaluations;
use known::FixedNumbers;
pub(crate) use measured::Measurement;
use measured::REST_SPEED_RATIO;
pub(crate) use model::FitCase;
use model::{FreeParameter, NormalEquations, Problem, SignalComparison};
pub(crate) use report::FitReport;
use search::{Descent, DescentEnd, MAX_EVALUATIONS, descend};
use statistics::Statistics;

/// The range of further starts without a given range, as parts of the first start. Basis: a data
/// sheet is seldom wrong by more. Doubling the width tries more distant minima with fewer starts
/// near the first.
const START_RANGE: [f64; 2] = [0.3, 1.7];
/// The greatest number of starts from which a descent begins: those with the least cost. Basis: the
/// test data have two minima. Doubling it doubles the time of a fit with `--starts`.
const MAX_DESCENTS: usize = 3;
/// The seed of all draws.
const SEED: u64 = 1;
/// The greatest change of a fitted parameter by half the integration step, in standard errors.
/// Basis: it adds some five percent to an error. Doubling it adds four times as much.
const MAX_STEP_EFFECT: f64 = 0.3;
/// The greatest number of halvings of the integration step. Basis: test
/// `reference_data_lead_to_the_truth` needs none. Doubling it makes a fit that needs them four
/// times as long.
const MAX_STEP_HALVINGS: usize = 2;

/// The options of a fit.
#[derive(Clone, Debug, clap::Args)]
pub struct FitOptions {
    /// Parameters to fit, each perhaps between two values; separated by commas
    #[arg(long, value_name = "NAME[=FROM:TO],...", value_delimiter = ',')]
    pub free: Vec<String>,
    /// Parameters of which every file has its own
    #[arg(long, value_name = "NAME[=FROM:TO],...", value_delimiter = ',')]
    pub own: Vec<String>,
    /// Fit the nonlinear model, or the linear one
    #[arg(long, value_name = "MODEL", default_value = ModelKind::Nonlinear.name())]
    #[arg(value_parser = ModelKind::ALL.map(ModelKind::name))]
    pub model: String,
    /// Take the clock of every file as it is, instead of fitting a shift of it
    #[arg(long)]
    pub no_shift: bool,
    /// Starts that are looked at for further minima
    #[arg(long, value_name = "N", default_value_t = 1)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub starts: u32,
    /// Fit again so many times with resampled residuals
    #[arg(long, value_name = "N", default_value_t = 0)]
    #[arg(value_parser = clap::value_parser!(u32).range(0..=10_000))]
    pub bootstrap: u32,
    /// Standard deviations of fixed numbers, which widen intervals; `gain` is that of the sensors.
    /// All others have those of their kind, or with `none` are taken as exact
    #[arg(long, value_name = "NAME=TOLERANCE[%],...", value_delimiter = ',')]
    pub known: Vec<String>,
    /// Rows of the map over the fitted distribution, for the verdict's probability; 0 for none
    #[arg(long, value_name = "N", default_value_t = 64)]
    #[arg(value_parser = clap::value_parser!(u32).range(0..=100_000))]
    pub draws: u32,
}

impl FitOptions {
    /// Refuses counts beyond those that the command line takes, for callers without one.
    ///
    /// # Errors
    /// An option that is out of its range.
    pub(crate) fn check(&self) -> Result<(), sweep_engine::Error> {
        for (option, count, least, most) in [
            ("starts", self.starts, 1, 10_000),
            ("bootstrap", self.bootstrap, 0, 10_000),
            ("draws", self.draws, 0, 100_000),
        ] {
            if !(least..=most).contains(&count) {
                let expected = format!("a number from {least} to {most}");
                return Err(sweep_engine::Error::option(option, count, expected));
            }
        }
        Ok(())
    }
}

/// A finished fit.
pub(crate) struct Fitted<'a> {
    pub(crate) problem: Problem<'a>,
    pub(crate) x: Vec<f64>,
    against: Vec<SignalComparison>,
    pub(crate) report: FitReport,
    /// The stored evaluations, which are deleted once the machine file is written.
    pub(crate) evaluations: Option<Evaluations>,
}

/// The context of a fit: cancellation, progress and stored evaluations.
pub(crate) struct FitWork<'a> {
    /// The cancellation. The result of a cancelled fit means nothing.
    pub(crate) cancel: Cancel<'a>,
    /// A function that is called after every evaluation with the number of evaluations.
    pub(crate) count_evaluations: &'a (dyn Fn(usize) + Sync),
    /// The machine file beside which evaluations are stored.
    pub(crate) output: Option<&'a Path>,
    /// Whether to discard stored evaluations.
    pub(crate) fresh: bool,
}

/// Prepares a case of a fit: a measurement with the grid and its own constants.
///
/// # Errors
/// Returns mistakes in the grid and the constants. An axis without a constant has its middle value.
pub(crate) fn case(
    grid: &WasherGridInput,
    constants: &[String],
    mut measured: Measurement,
) -> Result<FitCase, Error> {
    let (plan, _) = grid.load_point(&[&middle(grid, constants)?, constants].concat())?;
    measured.count_from_first_row(plan.end_s);
    let smoothed = measured.smoothed_spin();
    Ok(FitCase { plan, measured, smoothed })
}

/// Returns the middle value of every axis that has several values and no constant, as NAME=VALUE.
fn middle(grid: &WasherGridInput, constants: &[String]) -> Result<Vec<String>, Diagnostics> {
    let plan = grid.load()?;
    let is_given =
        |name: &str| constants.iter().any(|constant| constant.split('=').next() == Some(name));
    let several =
        plan.axes.iter().filter(|axis| axis.values.len() > 1 && !is_given(&axis.parameter.name));
    let value = |axis: &crate::plan::Axis| {
        let [from, to] = axis.values.extremes();
        format!("{}={}", axis.parameter.name, 0.5 * (from + to))
    };
    Ok(several.map(value).collect())
}

/// Reads the free parameters.
fn free_parameters(
    options: &FitOptions,
    cases: &[FitCase],
) -> Result<Vec<FreeParameter>, Diagnostics> {
    let mistakes = Mistakes::default();
    let mut free: Vec<FreeParameter> = Vec::new();
    let shared = options.free.iter().map(|text| (text, "--free", &cases[..1]));
    let own = options.own.iter().map(|text| (text, "--own", cases));
    for (text, option, cases) in shared.chain(own) {
        let location = Location::new(mistakes.add(option, text.as_str()), 0..text.len());
        for (k, case) in cases.iter().enumerate() {
            let known: &[FreeParameter] = if cases.len() == 1 { &free } else { &[] };
            let Some(read) = free_parameter(text, case, known, (&location, &mistakes)) else {
                break;
            };
            free.push(FreeParameter { case: (option == "--own").then_some(k), ..read });
        }
    }
    mistakes.finish(Some(free))
}

/// Reads a free parameter of a case, in addition to `known` ones, and reports its mistakes.
fn free_parameter(
    text: &str,
    case: &FitCase,
    known: &[FreeParameter],
    (location, mistakes): (&Location, &Mistakes),
) -> Option<FreeParameter> {
    let refuse = |title: String, expected: &str| mistakes.refuse(location, title, expected);
    let (name, range) = match text.split_once('=') {
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
            let known = MachineParameter::all(machine, spin);
            let title = format!("`{name}` cannot be fitted: {error}");
            let refusal = Diagnostic::new(title).at(location, "expected a parameter");
            mistakes.push(refusal.nearest(name, known.iter().map(|known| known.name())));
            return None;
        }
    };
    if known.iter().any(|free| free.parameter == parameter) {
        return refuse(format!("`{name}` is free twice"), "expected each once");
    }
    let allowed = parameter.range().bounds();
    let parsed = range.map(|range| {
        let (from, to) = range.split_once(':')?;
        let [from, to] = [from.trim().parse().ok()?, to.trim().parse().ok()?];
        let within = allowed[0] <= from && from < to && to <= allowed[1];
        (within && f64::is_finite(from) && f64::is_finite(to)).then_some([from, to])
    });
    let Some(range) = parsed.unwrap_or(Some(allowed)) else {
        let expected = "expected NAME=FROM:TO with FROM below TO, both allowed";
        return refuse(format!("`{text}` is no range"), expected);
    };
    let value = parameter.get(machine, spin).filter(|value| (range[0]..=range[1]).contains(value));
    let start = match value {
        _ if parsed.is_some() => Some(value.unwrap_or(0.5 * (range[0] + range[1]))),
        value => value.filter(|value| *value != 0.0),
    };
    let Some(start) = start else {
        let expected = "expected a range, NAME=FROM:TO, or a value by --set";
        let is = if value.is_some() { "is 0" } else { "differs from part to part" };
        return refuse(format!("`{name}` {is}: there is no value to start from"), expected);
    };
    Some(FreeParameter { parameter, range, start, case: None })
}

/// Fits the free parameters on all threads of the current rayon pool; `None` after a cancellation.
///
/// # Errors
/// Returns mistakes in the options, and errors for data that do not depend on a parameter and for a
/// model whose trajectory fails.
pub(crate) fn fit<'a>(
    cases: Vec<FitCase>,
    options: &FitOptions,
    work: &FitWork<'a>,
) -> Result<Option<Fitted<'a>>, Error> {
    match run_fit(cases, options, work) {
        Ok(fitted) => Ok(Some(fitted)),
        Err(DescentEnd::Stopped) => Ok(None),
        Err(DescentEnd::Refused(error)) => Err(error),
    }
}

fn run_fit<'a>(
    cases: Vec<FitCase>,
    options: &FitOptions,
    work: &FitWork<'a>,
) -> Result<Fitted<'a>, DescentEnd> {
    let free = free_parameters(options, &cases)?;
    let known = FixedNumbers::read(&options.known, &cases[0], &free)?;
    let method = Problem::method(&cases).map_err(Error::model)?;
    let model = ModelKind::named(&options.model).unwrap_or(ModelKind::Nonlinear);
    let simd = simd_from_environment()?;
    let with_shift = !options.no_shift;
    let cancel = work.cancel;
    let mut problem = Problem { cases, free, model, with_shift, method, simd, cancel };
    let samples: usize = problem.cases.iter().map(|case| case.measured.count()).sum();
    let unknowns = problem.unknowns() + problem.signals().count();
    if unknowns >= samples {
        let expected = "expected more samples, or fewer `--free`";
        let message = format!("{unknowns} unknowns for {samples} samples: {expected}");
        return Err(Error::Refused(message).into());
    }
    for case in &problem.cases {
        let rpm = case.first_rpm().unwrap_or_default();
        if rpm.abs() > REST_SPEED_RATIO * case.greatest_rpm() {
            let unknown = "where its unbalance was then is not known: expected the record from \
                           rest on";
            let message = format!("{} begins at {rpm:.0} rpm, and {unknown}", case.measured.name);
            return Err(Error::Refused(message).into());
        }
    }
    let open = |output| Evaluations::open(output, &problem, work.fresh);
    let stored = work.output.map(open).transpose()?;
    let evaluations_made = AtomicUsize::new(0);
    // A search in a wrong unit takes long and comes to nothing.
    let mut suspicions = units::suspicions(&problem)?;
    let is_suspect = suspicions.iter().any(Option::is_some);
    let search = MinimumSearch {
        problem: &problem,
        stored: stored.as_ref(),
        work,
        evaluations_made: &evaluations_made,
        max_evaluations: if is_suspect { units::TRIAL_EVALUATIONS } else { MAX_EVALUATIONS },
    };
    let starts = u64::from(options.starts);
    let mut minima = search.minima(starts);
    let is_explained = |minima: &Vec<Descent>| {
        minima.first().is_some_and(|best| units::is_explained(&problem, best))
    };
    if is_suspect && minima.as_ref().is_ok_and(is_explained) {
        minima = MinimumSearch { max_evaluations: MAX_EVALUATIONS, ..search }.minima(starts);
    }
    stored.as_ref().map_or(Ok(()), Evaluations::write)?;
    let mut minima = minima?;
    let mut best = minima.first().cloned().ok_or_else(no_answer)?;
    let mut step_effect = None;
    // An integration step that is too long for the corners of forces changes the fitted
    // parameters; then the step is halved.
    for _ in 0..=MAX_STEP_HALVINGS {
        if problem.method.kind != MethodKind::Rk4 || !best.is_settled {
            break;
        }
        let step_s = problem.method.step_s;
        let against = problem.compare(&best.x).ok_or(DescentEnd::Stopped)?;
        problem.method = Method::rk4(0.5 * step_s);
        let finer = problem.compare(&best.x).ok_or(DescentEnd::Stopped)?;
        let bread = algebra::inverse(&best.summary.normal);
        let changes = effect(&bread, &best.summary, &against, &finer);
        let greatest_change = changes.into_iter().fold(0.0, f64::max);
        step_effect = Some(greatest_change);
        if greatest_change < MAX_STEP_EFFECT {
            problem.method = Method::rk4(step_s);
            break;
        }
        let search = MinimumSearch::further(&problem, work, &evaluations_made);
        best = search.from(&best.x)?.ok_or_else(no_answer)?;
        minima[0] = best.clone();
    }
    let evaluations = evaluations_made.load(Ordering::Relaxed);
    let against = problem.compare(&best.x).ok_or(DescentEnd::Stopped)?;
    // A wrong unit may change the numbers so much that only the start shows the unit.
    let at_start = problem.compare(&problem.start()).unwrap_or_else(|| against.clone());
    let mut statistics = Statistics::at_end(&problem, &against, &best.summary);
    let by_tachometer = covariance_by_tachometer(&problem, &best, &against);
    statistics::add(&mut statistics.covariance, &by_tachometer, 1.0);
    if problem.model == ModelKind::Linear {
        // The numbers may compensate for the terms that the linear model lacks, without a residual.
        problem.model = ModelKind::Nonlinear;
        statistics.bias = problem
            .compare(&best.x)
            .map(|nonlinear| effect(&statistics.covariance, &best.summary, &against, &nonlinear));
        problem.model = ModelKind::Linear;
    }
    let mut resampled = None;
    if options.bootstrap > 0 && best.is_settled {
        resampled = Some(bootstrap(&mut problem, &best.x, &against, options.bootstrap, work)?);
    }
    if best.is_settled && statistics.objection(&problem).is_none() {
        let variances = statistics.variances(&best.summary);
        statistics.influences =
            known.influences(&problem, &best.x, &against, &best.summary, &variances);
    }
    if statistics.unexplained().is_none() {
        suspicions.fill(None);
    }
    let report_data = report::ReportData {
        problem: &problem,
        suspicions: &suspicions,
        minima: &minima,
        against: &against,
        at_start: &at_start,
        statistics: &statistics,
        evaluations,
        step_effect,
        resampled: resampled.as_deref(),
        draws: options.draws.into(),
    };
    let report = report_data.report()?;
    if cancel.is_requested() {
        return Err(DescentEnd::Stopped);
    }
    Ok(Fitted { problem, x: best.x, against, report, evaluations: stored })
}

/// Returns the error of a start at which the model fails.
fn no_answer() -> Error {
    let message = "the model does not get through the record at the starting values: expected a \
                   start from which it does (`--set NAME=VALUE`)";
    Error::Refused(message.to_owned())
}

/// Returns the change of each unknown by another model, in standard errors.
fn effect(
    covariance: &[Vec<f64>],
    summary: &NormalEquations,
    comparisons: &[SignalComparison],
    other: &[SignalComparison],
) -> Vec<f64> {
    let mut pull = vec![0.0; covariance.len()];
    for ((model, other), sigma) in comparisons.iter().zip(other).zip(&summary.sigma) {
        let pairs = model.residual.iter().zip(&other.residual);
        let difference: Vec<f64> = pairs.map(|(model, other)| model - other).collect();
        for (pull, slope) in pull.iter_mut().zip(&model.slopes) {
            *pull -= algebra::dot(slope, &difference) / (sigma * sigma);
        }
    }
    let bread = algebra::inverse(&summary.normal);
    let standardised = |k: usize| {
        let variance = covariance[k][k];
        let change = algebra::dot(&bread[k], &pull);
        if variance > 0.0 { change.abs() / variance.sqrt() } else { 0.0 }
    };
    (0..pull.len()).map(standardised).collect()
}

/// Computes the part of the unknowns' covariance that is due to the noise of the tachometers.
fn covariance_by_tachometer(
    problem: &Problem<'_>,
    best: &Descent,
    against: &[SignalComparison],
) -> Vec<Vec<f64>> {
    let n = problem.unknowns();
    let bread = algebra::inverse(&best.summary.normal);
    let mut covariance = vec![vec![0.0; n]; n];
    for (case, one_case) in problem.cases.iter().enumerate() {
        let drawn =
            one_case.smoothed.as_ref().map(|smoothed| &smoothed.drawn[..]).unwrap_or_default();
        let sigma = &best.summary.sigma[..];
        let pulls = problem.pulls(case, &best.x, (against, sigma), drawn.len(), |k, _, spin| {
            *spin = drawn[k].clone();
        });
        let pulls: Vec<Vec<f64>> = pulls.into_iter().flatten().collect();
        for pull in &pulls {
            let changes: Vec<f64> = bread.iter().map(|row| algebra::dot(row, pull)).collect();
            algebra::add_outer(&mut covariance, &changes, 1.0 / pulls.len() as f64);
        }
    }
    covariance
}

/// Fits `count` times with residuals that are resampled in blocks (the block bootstrap), and
/// returns the free parameters of each fit.
fn bootstrap(
    problem: &mut Problem<'_>,
    x: &[f64],
    against: &[SignalComparison],
    count: u32,
    work: &FitWork<'_>,
) -> Result<Vec<Vec<f64>>, DescentEnd> {
    /// The number of samples in a block of the block bootstrap. Basis: residuals of the test data
    /// are correlated over some ten samples. Doubling it preserves slower correlations, but leaves
    /// fewer blocks.
    const BLOCK_SAMPLES: usize = 100;
    let measured = problem.cases.clone();
    let draw = Design::Spread { rule: DesignRule::MonteCarlo, points: 0, seed: SEED };
    let mut drawn = 0;
    let mut fits = Vec::new();
    for _ in 0..count {
        for one in against {
            let residual = &one.residual;
            let mut resampled = Vec::with_capacity(residual.len() + BLOCK_SAMPLES);
            while resampled.len() < residual.len() {
                let place = draw.position(drawn, 0).unwrap_or(0.5);
                drawn += 1;
                let first = (place * residual.len() as f64) as usize;
                resampled
                    .extend((first..first + BLOCK_SAMPLES).map(|i| residual[i % residual.len()]));
            }
            let signal = &mut problem.cases[one.case].measured.signals[one.signal];
            let rows: Vec<usize> = signal.samples().map(|(row, _)| row).collect();
            for (row, residual) in rows.into_iter().zip(resampled) {
                signal.values[row] = one.model[row] + one.offset + residual;
            }
        }
        let evaluations_made = AtomicUsize::new(0);
        let search = MinimumSearch::further(problem, work, &evaluations_made);
        let refit = search.from(x)?.filter(|refit| refit.is_settled);
        fits.extend(refit.map(|refit| refit.x[..problem.free.len()].to_vec()));
    }
    problem.cases = measured;
    Ok(fits)
}

/// A search for the least cost of a problem.
struct MinimumSearch<'a> {
    problem: &'a Problem<'a>,
    stored: Option<&'a Evaluations>,
    work: &'a FitWork<'a>,
    /// The number of evaluations so far.
    evaluations_made: &'a AtomicUsize,
    /// The greatest number of evaluations of a descent.
    max_evaluations: usize,
}

impl<'a> MinimumSearch<'a> {
    /// Returns a search whose evaluations are not stored.
    fn further(
        problem: &'a Problem<'a>,
        work: &'a FitWork<'a>,
        evaluations_made: &'a AtomicUsize,
    ) -> Self {
        Self { problem, stored: None, work, evaluations_made, max_evaluations: MAX_EVALUATIONS }
    }

    /// Computes the normal equations at a point, or reads stored ones.
    fn evaluate(&self, x: &[f64]) -> Result<Option<NormalEquations>, DescentEnd> {
        let find = || {
            let comparisons = self.problem.compare(x);
            if self.problem.cancel.is_requested() {
                return Err(DescentEnd::Stopped);
            }
            Ok(comparisons.map(|against| self.problem.normal_equations(&against)))
        };
        let equations = self.stored.map_or_else(find, |stored| stored.answer(x, find))?;
        (self.work.count_evaluations)(1 + self.evaluations_made.fetch_add(1, Ordering::Relaxed));
        Ok(equations)
    }

    /// Descends from a start.
    fn from(&self, start: &[f64]) -> Result<Option<Descent>, DescentEnd> {
        let ranges: Vec<[f64; 2]> =
            (0..self.problem.unknowns()).map(|k| self.problem.range(k)).collect();
        descend(start, &ranges, self.max_evaluations, &|x| self.evaluate(x))
    }

    /// Finds the minima from a number of starts, the least first.
    fn minima(&self, starts: u64) -> Result<Vec<Descent>, DescentEnd> {
        let start = self.problem.start();
        let without_influence = |equations: &NormalEquations| {
            let has_none = |k: &usize| equations.normal[*k][*k] == 0.0;
            let numbers = (0..self.problem.free.len()).filter(has_none);
            let names: Vec<&str> = numbers.map(|k| self.problem.free[k].parameter.name()).collect();
            (!names.is_empty()).then(|| names.join(", "))
        };
        let no_influence = |names: &str| {
            let expected = "expected another channel, another start (`--set NAME=VALUE`), or to \
                            leave it out of `--free`";
            Error::Refused(format!("the measurement does not depend on {names}: {expected}"))
        };
        let idle_at_start = self.evaluate(&start)?.as_ref().and_then(without_influence);
        if let (Some(names), 1) = (&idle_at_start, starts) {
            return Err(no_influence(names).into());
        }
        let mut chosen = vec![start.clone()];
        if starts > 1 {
            let design =
                Design::Spread { rule: DesignRule::LatinHypercube, points: starts - 1, seed: SEED };
            let place = |point: u64, k: usize| {
                let FreeParameter { range, start, .. } = &self.problem.free[k];
                let range_of_starts = START_RANGE.map(|share| share * start);
                let is_bounded = range.iter().all(|end| end.is_finite());
                let [from, to] = if is_bounded {
                    *range
                } else {
                    [range_of_starts[0].max(range[0]), range_of_starts[1]]
                };
                from + design.position(point, k).unwrap_or(0.5) * (to - from)
            };
            let sets: Vec<Vec<f64>> = (0..starts - 1)
                .map(|point| {
                    let mut x = start.clone();
                    (0..self.problem.free.len()).for_each(|k| x[k] = place(point, k));
                    x
                })
                .collect();
            let costs = self.problem.costs(&sets);
            let mut order: Vec<usize> = (0..sets.len()).filter(|&k| costs[k].is_finite()).collect();
            order.sort_by(|&a, &b| costs[a].total_cmp(&costs[b]));
            chosen.extend(order.into_iter().take(MAX_DESCENTS - 1).map(|k| sets[k].clone()));
        }
        let ended: Vec<_> = chosen.par_iter().map(|start| self.from(start)).collect();
        let mut minima: Vec<Descent> = Vec::new();
        for descent in ended {
            minima.extend(descent?);
        }
        minima.sort_by(|a, b| a.summary.cost.total_cmp(&b.summary.cost));
        // All numbers may have an influence at another start.
        let is_idle = |minimum: &Descent| without_influence(&minimum.summary).is_some();
        if let Some(names) = idle_at_start.filter(|_| minima.iter().all(is_idle)) {
            return Err(no_influence(&names).into());
        }
        let mut distinct: Vec<Descent> = Vec::new();
        for minimum in minima {
            if !distinct.iter().any(|other| self.is_same(other, &minimum)) {
                distinct.push(minimum);
            }
        }
        Ok(distinct)
    }

    /// Whether two descents ended in one minimum: within a few standard errors, or a thousandth.
    fn is_same(&self, a: &Descent, b: &Descent) -> bool {
        let bread = algebra::inverse(&a.summary.normal);
        (0..self.problem.free.len()).all(|k| {
            let tolerance = (5.0 * bread[k][k].max(0.0).sqrt()).max(1e-3 * a.x[k].abs());
            (a.x[k] - b.x[k]).abs() <= tolerance
        })
    }
}

/// Returns a function of a draw and k: the k-th component of one of `count` draws from the standard
/// normal distribution by a Latin hypercube.
fn normal_draws(count: u64) -> impl Fn(u64, usize) -> f64 {
    let design = Design::Spread { rule: DesignRule::LatinHypercube, points: count, seed: SEED };
    let shape = DistributionShape::Normal { mean: 0.0, sd: 1.0 };
    let normal = Distribution { shape, from: -6.0, to: 6.0 };
    move |point, k| normal.quantile(design.position(point, k).unwrap_or(0.5))
}

/// Draws values of the free parameters from the fitted distribution by a low-discrepancy sequence,
/// each within its range.
fn draws(problem: &Problem<'_>, x: &[f64], covariance: &[Vec<f64>], count: u64) -> Vec<Vec<f64>> {
    let normal = normal_draws(count);
    let (unit, scale) = algebra::scaled(covariance);
    let eigen = Symmetric::from_matrix(&unit);
    let draw = |point: u64| {
        let even: Vec<f64> = (0..scale.len()).map(|k| normal(point, k)).collect();
        let moved = eigen.apply(&even, |value| value.max(0.0).sqrt());
        let value = |k: usize| {
            let [from, to] = problem.range(k);
            (x[k] + scale[k] * moved[k]).clamp(from, to)
        };
        (0..scale.len()).map(value).collect()
    };
    (0..count).map(draw).collect()
}

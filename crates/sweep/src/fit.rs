//! `sweep fit`: the numbers that make the model follow a measurement, how well they are known, and
//! what the map says of that machine.
//!
//! `measured`, `pulses` and `speed` read a measurement. `model` compares it with the model and its
//! derivatives, `search` finds the least cost, `statistics` says how well the numbers are known,
//! and `report` holds all of it. `evaluations` keeps what a fit has found out.

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
use washer_model::{MachineParameter, Method, ModelKind, Target};

use crate::config::WasherGridInput;
use crate::engine::simd_from_environment;
use lane_ode::Cancel;
use sweep_engine::config::{Diagnostic, Location, Report as Mistakes};
use sweep_engine::design::{DesignRule, DistributionShape};
use sweep_engine::{Design, Diagnostics, Distribution, Error};

use algebra::Symmetric;
pub(crate) use evaluations::Evaluations;
use known::Known;
pub(crate) use measured::Measurement;
use measured::REST_SPEED_RATIO;
pub(crate) use model::FitCase;
use model::{Against, Free, Problem, Summary};
pub(crate) use report::FitReport;
use search::{Descent, DescentEnd, MAX_EVALUATIONS, descend};
use statistics::Statistics;

/// Shares of a start between which further starts lie, where no range is given.
const AROUND: [f64; 2] = [0.3, 1.7];
/// Starts from which a descent begins, of all that are looked at.
const DESCENTS: usize = 3;
/// Seed of all draws.
const SEED: u64 = 1;
/// Half the step may move no number by more than this share of its standard error.
const STEP_EFFECT: f64 = 0.3;
/// The greatest number of halvings of the step. Basis: test `reference_data_lead_to_the_truth`
/// needs none. Doubling it makes a fit that needs them four times as long.
const HALVINGS: usize = 2;

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

/// A fit that was made.
pub(crate) struct Fitted<'a> {
    pub(crate) problem: Problem<'a>,
    pub(crate) x: Vec<f64>,
    against: Vec<Against>,
    pub(crate) report: FitReport,
    /// The evaluations that it keeps until its machine file is in place.
    pub(crate) evaluations: Option<Evaluations>,
}

/// The context of a fit: cancellation, progress and stored evaluations.
pub(crate) struct FitWork<'a> {
    /// The cancellation. The result of a cancelled fit means nothing.
    pub(crate) cancel: Cancel<'a>,
    /// The listener that is called after every evaluation with their number.
    pub(crate) seen: &'a (dyn Fn(usize) + Sync),
    /// The machine file beside which evaluations are kept.
    pub(crate) output: Option<&'a Path>,
    /// Whether to discard evaluations that are kept.
    pub(crate) fresh: bool,
}

/// Prepares a case of a fit: a measurement with the grid and its own constants.
///
/// # Errors
/// Mistakes in the grid and the constants. An axis without a constant stands at its middle.
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
    let is_given = |name: &str| constants.iter().any(|it| it.split('=').next() == Some(name));
    let several =
        plan.axes.iter().filter(|axis| axis.values.len() > 1 && !is_given(&axis.parameter.name));
    let value = |axis: &crate::plan::Axis| {
        let [from, to] = axis.values.extremes();
        format!("{}={}", axis.parameter.name, 0.5 * (from + to))
    };
    Ok(several.map(value).collect())
}

/// Reads the free numbers.
fn free(options: &FitOptions, cases: &[FitCase]) -> Result<Vec<Free>, Diagnostics> {
    let mistakes = Mistakes::default();
    let mut found: Vec<Free> = Vec::new();
    let shared = options.free.iter().map(|text| (text, "--free", &cases[..1]));
    let own = options.own.iter().map(|text| (text, "--own", cases));
    for (text, option, cases) in shared.chain(own) {
        let at = Location::new(mistakes.add(option, text.as_str()), 0..text.len());
        for (k, case) in cases.iter().enumerate() {
            let known: &[Free] = if cases.len() == 1 { &found } else { &[] };
            let Some(free) = free_number(text, case, known, (&at, &mistakes)) else { break };
            found.push(Free { case: (option == "--own").then_some(k), ..free });
        }
    }
    mistakes.finish(Some(found))
}

/// Reads a free parameter of a case, in addition to those already read, and reports what is wrong
/// with it.
fn free_number(
    text: &str,
    case: &FitCase,
    known: &[Free],
    (at, mistakes): (&Location, &Mistakes),
) -> Option<Free> {
    let refuse = |title: String, expected: &str| mistakes.refuse(at, title, expected);
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
            let refusal = Diagnostic::new(title).at(at, "expected a parameter");
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
    let value = parameter.get(machine, spin).filter(|it| (range[0]..=range[1]).contains(it));
    let start = match value {
        _ if parsed.is_some() => Some(value.unwrap_or(0.5 * (range[0] + range[1]))),
        value => value.filter(|value| *value != 0.0),
    };
    let Some(start) = start else {
        let expected = "expected a range, NAME=FROM:TO, or a value by --set";
        let is = if value.is_some() { "is 0" } else { "differs from part to part" };
        return refuse(format!("`{name}` {is}: there is no value to start from"), expected);
    };
    Some(Free { parameter, range, start, case: None })
}

/// Fits; `None` if it was stopped. On all threads of the rayon pool it is called in.
///
/// # Errors
/// Mistakes in the options; data that cannot tell; a model that does not get through.
pub(crate) fn fit<'a>(
    cases: Vec<FitCase>,
    options: &FitOptions,
    work: &FitWork<'a>,
) -> Result<Option<Fitted<'a>>, Error> {
    match fitted(cases, options, work) {
        Ok(fitted) => Ok(Some(fitted)),
        Err(DescentEnd::Stopped) => Ok(None),
        Err(DescentEnd::Refused(error)) => Err(error),
    }
}

fn fitted<'a>(
    cases: Vec<FitCase>,
    options: &FitOptions,
    work: &FitWork<'a>,
) -> Result<Fitted<'a>, DescentEnd> {
    let free = free(options, &cases)?;
    let known = Known::read(&options.known, &cases[0], &free)?;
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
        let said = format!("{unknowns} unknowns for {samples} samples: {expected}");
        return Err(Error::Refused(said).into());
    }
    for case in &problem.cases {
        let rpm = case.first_rpm().unwrap_or_default();
        if rpm.abs() > REST_SPEED_RATIO * case.greatest_rpm() {
            let unknown = "where its unbalance was then is not known: expected the record from \
                           rest on";
            let said = format!("{} begins at {rpm:.0} rpm, and {unknown}", case.measured.name);
            return Err(Error::Refused(said).into());
        }
    }
    let open = |output| Evaluations::open(output, &problem, work.fresh);
    let kept = work.output.map(open).transpose()?;
    let made = AtomicUsize::new(0);
    let search = MinimumSearch { problem: &problem, kept: kept.as_ref(), work, made: &made };
    let minima = search.minima(u64::from(options.starts));
    kept.as_ref().map_or(Ok(()), Evaluations::write)?;
    let mut minima = minima?;
    let mut best = minima.first().cloned().ok_or_else(no_answer)?;
    let mut step_effect = None;
    // A step too long for the forces' corners shows in the numbers: then it is halved.
    for _ in 0..=HALVINGS {
        let Method::Rk4 { step_s } = problem.method else { break };
        if !best.is_settled {
            break;
        }
        let against = problem.against(&best.x).ok_or(DescentEnd::Stopped)?;
        problem.method = Method::Rk4 { step_s: 0.5 * step_s };
        let finer = problem.against(&best.x).ok_or(DescentEnd::Stopped)?;
        let bread = algebra::inverse(&best.summary.normal);
        let moved = effect(&bread, &best.summary, &against, &finer);
        let moved = moved.into_iter().fold(0.0, f64::max);
        step_effect = Some(moved);
        if moved < STEP_EFFECT {
            problem.method = Method::Rk4 { step_s };
            break;
        }
        let search = MinimumSearch { problem: &problem, kept: None, work, made: &made };
        best = search.from(&best.x)?.ok_or_else(no_answer)?;
        minima[0] = best.clone();
    }
    let evaluations = made.load(Ordering::Relaxed);
    let against = problem.against(&best.x).ok_or(DescentEnd::Stopped)?;
    // A wrong unit may lead numbers so far away that only the start shows it.
    let at_start = problem.against(&problem.start()).unwrap_or_else(|| against.clone());
    let mut statistics = Statistics::of(&problem, &against, &best.summary);
    let further = by_tachometer(&problem, &best, &against);
    statistics::add(&mut statistics.covariance, &further, 1.0);
    if problem.model == ModelKind::Linear {
        // The numbers may make up for what the linear model lacks and leave no residual.
        problem.model = ModelKind::Nonlinear;
        statistics.bias = problem
            .against(&best.x)
            .map(|nonlinear| effect(&statistics.covariance, &best.summary, &against, &nonlinear));
        problem.model = ModelKind::Linear;
    }
    let mut repeated = None;
    if options.bootstrap > 0 && best.is_settled {
        repeated = Some(bootstrap(&mut problem, &best.x, &against, options.bootstrap, work)?);
    }
    if best.is_settled && statistics.objection(&problem).is_none() {
        let variances = statistics.variances(&best.summary);
        statistics.influences =
            known.influences(&problem, &best.x, &against, &best.summary, &variances);
    }
    let suspicions = match statistics.unexplained() {
        Some(_) => units::suspicions(&problem)?,
        None => vec![None; problem.cases.len()],
    };
    let found = report::ReportData {
        problem: &problem,
        suspicions: &suspicions,
        minima: &minima,
        against: &against,
        at_start: &at_start,
        statistics: &statistics,
        evaluations,
        step_effect,
        repeated: repeated.as_deref(),
        draws: options.draws.into(),
    };
    let report = found.report()?;
    if cancel.is_requested() {
        return Err(DescentEnd::Stopped);
    }
    Ok(Fitted { problem, x: best.x, against, report, evaluations: kept })
}

fn no_answer() -> Error {
    let said = "the model does not get through the record at the starting values: expected a start \
                from which it does (`--set NAME=VALUE`)";
    Error::Refused(said.to_owned())
}

/// Returns the move of each unknown by another model, in standard errors.
fn effect(
    covariance: &[Vec<f64>],
    summary: &Summary,
    model: &[Against],
    other: &[Against],
) -> Vec<f64> {
    let mut pull = vec![0.0; covariance.len()];
    for ((model, other), sigma) in model.iter().zip(other).zip(&summary.sigma) {
        let pairs = model.residual.iter().zip(&other.residual);
        let apart: Vec<f64> = pairs.map(|(model, other)| model - other).collect();
        for (pull, slope) in pull.iter_mut().zip(&model.slopes) {
            *pull -= algebra::dot(slope, &apart) / (sigma * sigma);
        }
    }
    let bread = algebra::inverse(&summary.normal);
    let share = |k: usize| {
        let size = covariance[k][k];
        let moved = algebra::dot(&bread[k], &pull);
        if size > 0.0 { moved.abs() / size.sqrt() } else { 0.0 }
    };
    (0..pull.len()).map(share).collect()
}

/// Computes the covariance that noise of the tachometers gives the unknowns.
fn by_tachometer(problem: &Problem<'_>, best: &Descent, against: &[Against]) -> Vec<Vec<f64>> {
    let n = problem.unknowns();
    let bread = algebra::inverse(&best.summary.normal);
    let mut covariance = vec![vec![0.0; n]; n];
    for (case, one_case) in problem.cases.iter().enumerate() {
        let drawn = one_case.smoothed.as_ref().map(|it| &it.drawn[..]).unwrap_or_default();
        let sigma = &best.summary.sigma[..];
        let pulls = problem.pulls(case, &best.x, (against, sigma), drawn.len(), |k, _, spin| {
            *spin = drawn[k].clone();
        });
        let pulls: Vec<Vec<f64>> = pulls.into_iter().flatten().collect();
        for pull in &pulls {
            let moved: Vec<f64> = bread.iter().map(|row| algebra::dot(row, pull)).collect();
            algebra::add_outer(&mut covariance, &moved, 1.0 / pulls.len() as f64);
        }
    }
    covariance
}

/// Fits so many times again, with residuals resampled in blocks longer than they are correlated,
/// and returns the free numbers of each fit.
fn bootstrap(
    problem: &mut Problem<'_>,
    x: &[f64],
    against: &[Against],
    count: u32,
    work: &FitWork<'_>,
) -> Result<Vec<Vec<f64>>, DescentEnd> {
    /// The number of samples in a block of the block bootstrap. Basis: residuals of the test data
    /// are correlated over some ten samples. Doubling it preserves slower correlations, but leaves
    /// fewer blocks.
    const BLOCK: usize = 100;
    let measured = problem.cases.clone();
    let draw = Design::Spread { rule: DesignRule::MonteCarlo, points: 0, seed: SEED };
    let mut drawn = 0;
    let mut found = Vec::new();
    for _ in 0..count {
        for one in against {
            let residual = &one.residual;
            let mut resampled = Vec::with_capacity(residual.len() + BLOCK);
            while resampled.len() < residual.len() {
                let place = draw.position(drawn, 0).unwrap_or(0.5);
                drawn += 1;
                let first = (place * residual.len() as f64) as usize;
                resampled.extend((first..first + BLOCK).map(|i| residual[i % residual.len()]));
            }
            let signal = &mut problem.cases[one.case].measured.signals[one.signal];
            let rows: Vec<usize> = signal.samples().map(|(row, _)| row).collect();
            for (row, residual) in rows.into_iter().zip(resampled) {
                signal.values[row] = one.model[row] + one.offset + residual;
            }
        }
        let made = AtomicUsize::new(0);
        let search = MinimumSearch { problem, kept: None, work, made: &made };
        let again = search.from(x)?.filter(|again| again.is_settled);
        found.extend(again.map(|again| again.x[..problem.free.len()].to_vec()));
    }
    problem.cases = measured;
    Ok(found)
}

/// A search for the least cost of a problem.
struct MinimumSearch<'a> {
    problem: &'a Problem<'a>,
    kept: Option<&'a Evaluations>,
    work: &'a FitWork<'a>,
    /// The number of evaluations so far.
    made: &'a AtomicUsize,
}

impl MinimumSearch<'_> {
    fn evaluate(&self, x: &[f64]) -> Result<Option<Summary>, DescentEnd> {
        let find = || {
            let found = self.problem.against(x);
            if self.problem.cancel.is_requested() {
                return Err(DescentEnd::Stopped);
            }
            Ok(found.map(|against| self.problem.summary(&against)))
        };
        let found = self.kept.map_or_else(find, |kept| kept.answer(x, find))?;
        (self.work.seen)(1 + self.made.fetch_add(1, Ordering::Relaxed));
        Ok(found)
    }

    /// Descends from a start.
    fn from(&self, start: &[f64]) -> Result<Option<Descent>, DescentEnd> {
        let ranges: Vec<[f64; 2]> =
            (0..self.problem.unknowns()).map(|k| self.problem.range(k)).collect();
        descend(start, &ranges, MAX_EVALUATIONS, &|x| self.evaluate(x))
    }

    /// Finds the minima from so many starts, the least first.
    fn minima(&self, starts: u64) -> Result<Vec<Descent>, DescentEnd> {
        let start = self.problem.start();
        let dead = |summary: &Summary| {
            let dead = |k: &usize| summary.normal[*k][*k] == 0.0;
            let dead = (0..self.problem.free.len()).filter(dead);
            let names: Vec<&str> = dead.map(|k| self.problem.free[k].parameter.name()).collect();
            (!names.is_empty()).then(|| names.join(", "))
        };
        let no_influence = |names: &str| {
            let expected = "expected another channel, another start (`--set NAME=VALUE`), or to \
                            leave it out of `--free`";
            Error::Refused(format!("the measurement does not depend on {names}: {expected}"))
        };
        let dead_at_start = self.evaluate(&start)?.as_ref().and_then(dead);
        if let (Some(names), 1) = (&dead_at_start, starts) {
            return Err(no_influence(names).into());
        }
        let mut chosen = vec![start.clone()];
        if starts > 1 {
            let design =
                Design::Spread { rule: DesignRule::LatinHypercube, points: starts - 1, seed: SEED };
            let place = |point: u64, k: usize| {
                let Free { range, start, .. } = &self.problem.free[k];
                let around = AROUND.map(|share| share * start);
                let is_bounded = range.iter().all(|end| end.is_finite());
                let [from, to] =
                    if is_bounded { *range } else { [around[0].max(range[0]), around[1]] };
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
            chosen.extend(order.into_iter().take(DESCENTS - 1).map(|k| sets[k].clone()));
        }
        let ended: Vec<_> = chosen.par_iter().map(|start| self.from(start)).collect();
        let mut minima: Vec<Descent> = Vec::new();
        for descent in ended {
            minima.extend(descent?);
        }
        minima.sort_by(|a, b| a.summary.cost.total_cmp(&b.summary.cost));
        // From another start all numbers may count.
        let is_dead = |minimum: &Descent| dead(&minimum.summary).is_some();
        if let Some(names) = dead_at_start.filter(|_| minima.iter().all(is_dead)) {
            return Err(no_influence(&names).into());
        }
        let mut apart: Vec<Descent> = Vec::new();
        for minimum in minima {
            if !apart.iter().any(|other| self.is_same(other, &minimum)) {
                apart.push(minimum);
            }
        }
        Ok(apart)
    }

    /// Whether two descents ended in one minimum: within a few standard errors, or a thousandth.
    fn is_same(&self, a: &Descent, b: &Descent) -> bool {
        let bread = algebra::inverse(&a.summary.normal);
        (0..self.problem.free.len()).all(|k| {
            let reach = (5.0 * bread[k][k].max(0.0).sqrt()).max(1e-3 * a.x[k].abs());
            (a.x[k] - b.x[k]).abs() <= reach
        })
    }
}

/// Returns a function of a draw and k: the k-th component of one of `count` draws from the standard
/// normal distribution by a Latin hypercube.
fn evenly(count: u64) -> impl Fn(u64, usize) -> f64 {
    let design = Design::Spread { rule: DesignRule::LatinHypercube, points: count, seed: SEED };
    let shape = DistributionShape::Normal { mean: 0.0, sd: 1.0 };
    let normal = Distribution { shape, from: -6.0, to: 6.0 };
    move |point, k| normal.quantile(design.position(point, k).unwrap_or(0.5))
}

/// Draws free numbers from the fitted distribution, evenly spread, each within its range.
fn draws(problem: &Problem<'_>, x: &[f64], covariance: &[Vec<f64>], count: u64) -> Vec<Vec<f64>> {
    let normal = evenly(count);
    let (unit, scale) = algebra::scaled(covariance);
    let eigen = Symmetric::of(&unit);
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

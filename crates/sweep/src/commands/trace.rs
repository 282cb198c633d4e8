//! `sweep trace GRID.toml`: time histories of both models at one point, or at every one.

use std::path::PathBuf;

use crate::engine::ModelEngine;
use crate::method::direct;
use crate::plan::{Plan, compared_channels};
use crate::trace::{
    Models, StartValue, TraceExtras, TraceSettings, TraceTable, check_spacing, parse_start_value,
    start_from, trace_in_pool,
};
use sweep_engine::commands::cells::{Lines as _, short, span, table};
use sweep_engine::commands::grid::quoted;
use sweep_engine::{Error, Exit, Job, tell};
use sweep_files::{FileKind, Output, key};
use sweep_parameter::Worse;
use sweep_results::{Cell, ResultTable, top};
use washer_model::Channel;
use washer_row::{Level, Trajectory, Verdict};

/// Arguments of `sweep trace`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    grid: sweep_engine::commands::grid::GridArgs,
    /// The point of this number in the grid, as in a result's column `point`
    #[arg(long, value_name = "N", conflicts_with_all = ["worst", "at"])]
    point: Option<u64>,
    /// The point of the grid's result where this column is worst [default: ratio_max]
    #[arg(long, value_name = "COLUMN", conflicts_with = "at")]
    #[arg(num_args = 0..=1, default_missing_value = "ratio_max")]
    worst: Option<String>,
    /// The result that --worst looks into [default: results/NAME.parquet]
    #[arg(long, value_name = "FILE", requires = "worst")]
    result: Option<PathBuf>,
    /// Every point of the grid, in one table with the points' numbers and axes
    #[arg(long, conflicts_with_all = ["point", "worst"])]
    all: bool,
    /// Which models to integrate
    #[arg(long, value_enum, default_value_t)]
    model: Models,
    /// One instant a turn of the drum, where the unbalance is up
    #[arg(long, conflicts_with = "every")]
    turns: bool,
    /// Add the drum's angle
    #[arg(long)]
    angle: bool,
    /// Time between two instants of the file, in s; the integration's steps are its own
    #[arg(long, value_name = "S", default_value_t = 0.01)]
    every: f64,
    /// Add rates and accelerations of the channels
    #[arg(long)]
    rates: bool,
    /// Add the ten coordinates and their speeds
    #[arg(long)]
    states: bool,
    /// Add the force of each spring, damper, stop and bushing, their sum on the cabinet, and the
    /// load of each foot
    #[arg(long)]
    forces: bool,
    /// Begin away from equilibrium, both models alike: a coordinate q1 to q10 (m, rad) or a speed
    /// u1 to u10 (per s); may be repeated
    #[arg(long, value_name = "NAME=VALUE", value_parser = parse_start_value)]
    start: Vec<StartValue>,
    /// Trace file to write
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
}

/// Integrates and writes.
///
/// # Errors
/// Mistakes in the grid file or the options, a machine without equilibrium, and a file that cannot
/// be written.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let chosen = if args.all { Vec::new() } else { chosen(args)? };
    let (plan, at) = match args.all {
        true => (args.grid.load()?, None),
        false => args.grid.load_point(&chosen).map(|(plan, at)| (plan, Some(at)))?,
    };
    let every_s = check_spacing((!args.turns).then_some(args.every), &plan)?;
    let Args { rates, states, forces, angle, model: models, .. } = *args;
    let extras = TraceExtras { rates, states, forces, angle };
    let start = start_from(&args.start);
    let output = Output::begin(&args.out, FileKind::Trace)?;
    let settings = TraceSettings { every_s, models, start, extras, capped: None };
    // A signal ends the process: there is nothing to keep.
    let traced = trace_in_pool(&plan, at, &settings, &|| false).map_err(Error::model)?;
    let TraceTable { table, instants, failures, level } = traced;
    failures.iter().for_each(|failure| tell(failure));
    output.finish(&table.into_bytes(&args.out)?)?;
    let of = if args.all { format!(" of {} points", plan.points()) } else { String::new() };
    let (out, end_s) = (args.out.display(), plan.end_s);
    tell(&format!("wrote {out}: {instants} instants{of} from 0 to {end_s} s"));
    // A map's row is of machines that start at rest, and of both models.
    if args.start.is_empty() && !args.all && models == Models::Both {
        tell(compared(&plan, &chosen, level)?.trim_end());
    }
    Ok(Exit::Done)
}

/// The point as `--at` would give it.
fn chosen(args: &Args) -> Result<Vec<String>, Error> {
    if args.point.is_none() && args.worst.is_none() {
        return Ok(args.grid.at.clone());
    }
    let plan: Plan = args.grid.load()?;
    let mut point = args.point.unwrap_or_default();
    if let Some(column) = &args.worst {
        let worse;
        (point, worse) = worst(args, &plan, column)?;
        tell(&format!("point {point} is where {column} is {}", worse.extreme()));
    }
    if point >= plan.points() {
        return Err(Error::option("--point", point, format!("from 0 to {}", plan.points() - 1)));
    }
    let names = plan.axes.iter().map(|axis| &*axis.parameter.name);
    // The shortest decimals read back to the same values.
    Ok(names.zip(plan.axis_values(point)).map(|(name, value)| format!("{name}={value}")).collect())
}

/// The worst point of the grid's result, and which way that is.
fn worst(args: &Args, plan: &Plan, column: &str) -> Result<(u64, Worse), Error> {
    let default = || PathBuf::from(format!("results/{}.parquet", plan.name));
    let path = args.result.clone().unwrap_or_else(default);
    let refused = |expected: String| Error::option("--worst", column, expected);
    if !path.exists() {
        let run = format!("`sweep run {}`", quoted(&args.grid.grid.display().to_string()));
        let expected = format!("a result at {} (--result); {run} makes it", path.display());
        return Err(refused(expected));
    }
    let file = ResultTable::open(&path)?;
    let hash = Job::of(plan).hash().to_hex().to_string();
    if file.file().value(key::PLAN_HASH) != Some(hash.as_str()) {
        let expected = format!("a result of this very grid, which {} is not", path.display());
        return Err(refused(expected));
    }
    let worse = file.column(column).map_or(Some(Worse::Greater), |known| known.worse);
    let worse = worse.ok_or_else(|| {
        refused(format!(
            "a column that is bad one way, which {column} is not: --point takes the number of any \
             row"
        ))
    })?;
    let rows = top(&file, &["point", column], None, Some((column, worse)), 1)?;
    match rows.first().map(Vec::as_slice) {
        Some([Cell::Number(point), Cell::Number(_)]) => Ok((*point as u64, worse)),
        _ => Err(refused(format!("a column that has values in {}", path.display()))),
    }
}

/// Peaks of both models in the window, their ratios and the verdict: what the point's row of a map
/// holds. `of_file` is the method of the trace.
fn compared(plan: &Plan, at: &[String], of_file: Option<Level>) -> Result<String, Error> {
    // What is told has nothing of held speeds.
    let mut plan = plan.clone();
    plan.model.held_speeds = None;
    let mut outcomes = ModelEngine::new(&plan)?.evaluate_at(&[Vec::new()]);
    let Some(outcome) = outcomes.pop() else { return Ok(String::new()) };
    let (channels, limits) = (&compared_channels(&plan), plan.reliability.limits);
    let verdict = Verdict::new(&outcome, channels.len(), limits);
    let number = |value: Option<f64>| value.map_or_else(|| "none".to_owned(), short);
    let row = |(k, channel): (usize, &Channel)| {
        let amplitude = |model: &Trajectory| number(model.amplitudes.get(k).copied());
        vec![
            channel.name().to_owned(),
            channel.unit().to_owned(),
            amplitude(&outcome.nonlinear),
            amplitude(&outcome.linear),
            number(verdict.ratios.get(k).copied().flatten()),
        ]
    };
    let rows: Vec<Vec<String>> = channels.iter().enumerate().map(row).collect();
    let headings = ["", "unit", "nonlinear", "linear", "ratio"].map(str::to_owned);
    let window = span(plan.window_s, short);
    let what = plan.model.measures.criterion.amplitude();
    let place = if at.is_empty() { String::new() } else { format!(" at {}", at.join(", ")) };
    let mut text = format!("{what}, {window} s{place}:\n{}", table(&headings, &rows, ""));
    // The ratio that is beyond its limit, or the greatest.
    let too_low = limits.least.zip(verdict.least).filter(|(limit, (_, ratio))| ratio <= limit);
    let told = match (verdict.greatest, too_low) {
        (Some((_, ratio)), Some((limit, least))) if ratio < limits.most => {
            Some((least, "least", limit))
        }
        (greatest, _) => greatest.map(|greatest| (greatest, "greatest", limits.most)),
    };
    let said = match (verdict.reliable, told) {
        (Some(reliable), Some(((channel, ratio), which, limit))) => {
            let said = if reliable { "reliable" } else { "not reliable" };
            let (channel, ratio, limit) = (channels[channel].name(), short(ratio), short(limit));
            format!("{said}: the {which} ratio is {ratio} ({channel}), the limit {limit}")
        }
        _ => "undefined: no ratio is".to_owned(),
    };
    text.line("verdict", &said);
    if let Some(of_file) = of_file.filter(|_| direct(&plan.integrator).is_none()) {
        let [row, file] = [outcome.method, of_file].map(Level::name);
        let told = format!("{row}, as in the point's row of a map; the file: {file}");
        text.line("method", told);
    }
    if outcome.sensitive == Some(true) {
        text.line("sensitive", "chaotic: the digits are those of one trajectory");
    }
    let gaps = [&outcome.nonlinear, &outcome.linear].map(|model| number(model.min_gap_m));
    let told = format!("{} m nonlinear, {} m linear, over the whole run", gaps[0], gaps[1]);
    text.line("least gap", &told);
    Ok(text)
}

//! `sweep trace GRID.toml` writes time histories of both models at one point or at all points.

use std::path::PathBuf;

use crate::engine::ModelEngine;
use crate::method::direct_method;
use crate::plan::{Plan, compared_channels};
use crate::trace::{
    Models, StartValue, TraceExtras, TraceSettings, TraceTable, check_spacing, parse_start_value,
    start_from, trace_in_pool,
};
use lane_ode::Cancel;
use sweep_engine::columns::MODEL_NAMES;
use sweep_engine::commands::cells::{Lines as _, format_number, format_range, format_table};
use sweep_engine::commands::grid::quote_for_shell;
use sweep_engine::{Error, Exit, Interrupt, Job, tell};
use sweep_files::{FileKind, Output, key};
use sweep_parameter::Worse;
use sweep_results::{Cell, ResultTable, top_rows};
use washer_model::Channel;
use washer_row::MethodKind;

/// Arguments of `sweep trace`.
#[derive(Debug, clap::Args)]
pub struct TraceArgs {
    #[command(flatten)]
    grid: sweep_engine::commands::grid::GridArgs,
    /// Trace the point with this number, which is in a result's column `point`
    #[arg(long, value_name = "N", conflicts_with_all = ["worst", "at"])]
    point: Option<u64>,
    /// Trace the point at which this column of the grid's result is worst [default: ratio_max]
    #[arg(long, value_name = "COLUMN", conflicts_with = "at")]
    #[arg(num_args = 0..=1, default_missing_value = "ratio_max")]
    worst: Option<String>,
    /// Result file in which --worst looks for the point [default: results/NAME.parquet]
    #[arg(long, value_name = "FILE", requires = "worst")]
    result: Option<PathBuf>,
    /// Trace every point of the grid, in one table with the points' numbers and axes
    #[arg(long, conflicts_with_all = ["point", "worst"])]
    all: bool,
    /// Which models to integrate
    #[arg(long, value_enum, default_value_t)]
    model: Models,
    /// Write one instant for each turn of the drum, at which the unbalance is up
    #[arg(long, conflicts_with = "every")]
    turns: bool,
    /// Add the drum's angle
    #[arg(long)]
    angle: bool,
    /// Time between two instants of the file, in s; integration has shorter steps of its own
    #[arg(long, value_name = "S", default_value_t = 0.01)]
    every: f64,
    /// Add the rates and accelerations of the channels
    #[arg(long)]
    rates: bool,
    /// Add the ten coordinates and their speeds
    #[arg(long)]
    states: bool,
    /// Add the force of each spring, damper, stop and bushing, their sum on the cabinet, and the
    /// load of each foot
    #[arg(long)]
    forces: bool,
    /// Start both models away from equilibrium: a coordinate q1 to q10 (m, rad) or a speed u1 to
    /// u10 (per s); may be repeated
    #[arg(long, value_name = "NAME=VALUE", value_parser = parse_start_value)]
    start: Vec<StartValue>,
    /// Trace file to write
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
}

/// Integrates the models and writes the trace.
///
/// # Errors
/// Returns an error for mistakes in the grid file or the options, for a machine without
/// equilibrium, and if the file cannot be written.
pub(crate) fn run(args: &TraceArgs) -> Result<Exit, Error> {
    let point_values = if args.all { Vec::new() } else { choose_point(args)? };
    let (plan, parameters) = match args.all {
        true => (args.grid.load()?, None),
        false => {
            let (plan, parameters) = args.grid.load_point(&point_values)?;
            (plan, Some(parameters))
        }
    };
    let every_s = check_spacing((!args.turns).then_some(args.every), &plan)?;
    let TraceArgs { rates, states, forces, angle, model: models, .. } = *args;
    let extras = TraceExtras { rates, states, forces, angle };
    let start_state = start_from(&args.start);
    let output = Output::begin(&args.out, FileKind::Trace)?;
    let settings = TraceSettings { every_s, models, start: start_state, extras, capped: None };
    // A signal ends the process, because there are no partial results to keep.
    let trace_table =
        trace_in_pool(&plan, parameters, &settings, Cancel::Never).map_err(Error::model)?;
    let TraceTable { table, instants, failures, method } = trace_table;
    failures.iter().for_each(|failure| tell(failure));
    output.finish(&table.into_bytes(&args.out)?)?;
    let points_text =
        if args.all { format!(" of {} points", plan.points()) } else { String::new() };
    let out = args.out.display();
    tell(&format!("wrote {out}: {instants} instants{points_text} from 0 to {} s", plan.end_s));
    // A row is comparable only with a trace of both models that start at equilibrium.
    if args.start.is_empty() && !args.all && models == Models::Both {
        tell(summarise_row(&plan, &point_values, method)?.trim_end());
    }
    Ok(Exit::Done)
}

/// Returns the point to trace as texts `NAME=VALUE`, as in `--at`.
fn choose_point(args: &TraceArgs) -> Result<Vec<String>, Error> {
    if args.point.is_none() && args.worst.is_none() {
        return Ok(args.grid.at.clone());
    }
    let plan: Plan = args.grid.load()?;
    let mut point = args.point.unwrap_or_default();
    if let Some(column) = &args.worst {
        let worse_direction;
        (point, worse_direction) = find_worst(args, &plan, column)?;
        tell(&format!("point {point} is where {column} is {}", worse_direction.worst_value_word()));
    }
    if point >= plan.points() {
        return Err(Error::option("--point", point, format!("from 0 to {}", plan.points() - 1)));
    }
    let axis_names = plan.axes.iter().map(|axis| &*axis.parameter.name);
    // `Display` writes the shortest decimals that parse to the same values.
    Ok(axis_names
        .zip(plan.axis_values(point))
        .map(|(name, value)| format!("{name}={value}"))
        .collect())
}

/// Returns the point of the grid's result at which a column is worst, and the bad direction of that
/// column.
fn find_worst(args: &TraceArgs, plan: &Plan, column: &str) -> Result<(u64, Worse), Error> {
    let default_path = || PathBuf::from(format!("results/{}.parquet", plan.name));
    let path = args.result.clone().unwrap_or_else(default_path);
    let refuse = |expected: String| Error::option("--worst", column, expected);
    if !path.exists() {
        let run_command =
            format!("`sweep run {}`", quote_for_shell(&args.grid.grid.display().to_string()));
        let expected = format!("a result at {} (--result); {run_command} makes it", path.display());
        return Err(refuse(expected));
    }
    let map_table = ResultTable::open(&path)?;
    let hash = Job::new(plan).hash().to_hex().to_string();
    if map_table.file().value(key::PLAN_HASH) != Some(hash.as_str()) {
        let expected = format!("a result of this very grid, which {} is not", path.display());
        return Err(refuse(expected));
    }
    let worse_or_none =
        map_table.column(column).map_or(Some(Worse::Greater), |info| info.metadata.worse);
    let worse_direction = worse_or_none.ok_or_else(|| {
        refuse(format!(
            "a column that is bad one way, which {column} is not: --point takes the number of any \
             row"
        ))
    })?;
    let rows = top_rows(&map_table, &["point", column], None, Some((column, worse_direction)), 1)?;
    match rows.first().map(Vec::as_slice) {
        Some([Cell::Number(point), Cell::Number(_)]) => Ok((*point as u64, worse_direction)),
        _ => Err(refuse(format!("a column that has values in {}", path.display()))),
    }
}

/// Returns the contents of the point's row in a map as text: the amplitudes of both models, their
/// ratios and the verdict. `trace_method` is the kind of the method of the trace.
fn summarise_row(
    plan: &Plan,
    at: &[String],
    trace_method: Option<MethodKind>,
) -> Result<String, Error> {
    // The text has no metrics, so those at held speeds are not computed.
    let mut plan = plan.clone();
    plan.model.held_speeds = None;
    let engine = ModelEngine::new(&plan)?;
    let interrupt = Interrupt::new();
    let Some(row) = engine.evaluate_only_point(&interrupt) else { return Ok(String::new()) };
    let channels = &compared_channels(&plan);
    let limits = plan.reliability.limits;
    let verdict = row.verdict();
    let column_text =
        |column: &str| row.number(column).map_or_else(|| "none".to_owned(), format_number);
    let channel_cells = |channel: &Channel| {
        let name = channel.name();
        let numbers =
            ["nonlinear", "linear", "ratio"].map(|prefix| column_text(&format!("{prefix}_{name}")));
        [vec![name.to_owned(), channel.unit().to_owned()], numbers.to_vec()].concat()
    };
    let channel_rows: Vec<Vec<String>> = channels.iter().map(channel_cells).collect();
    let headings = ["", "unit", "nonlinear", "linear", "ratio"].map(str::to_owned);
    let window_text = format_range(plan.window_s, format_number);
    let amplitude_text = plan.model.measures.criterion.amplitude_description();
    let point_text = if at.is_empty() { String::new() } else { format!(" at {}", at.join(", ")) };
    let mut text = format!(
        "{amplitude_text}, {window_text} s{point_text}:\n{}",
        format_table(&headings, &channel_rows, "")
    );
    // The decisive ratio is one that is beyond its limit, or else the greatest.
    let least_below_limit =
        limits.lower.zip(verdict.least).filter(|(limit, (_, ratio))| ratio <= limit);
    let decisive_ratio = match (verdict.greatest, least_below_limit) {
        (Some((_, ratio)), Some((limit, least))) if ratio < limits.upper => {
            Some((least, "least", limit))
        }
        (greatest, _) => greatest.map(|greatest| (greatest, "greatest", limits.upper)),
    };
    let verdict_text = match (verdict.reliable, decisive_ratio) {
        (Some(reliable), Some(((channel, ratio), extreme_name, limit))) => {
            let verdict_word = if reliable { "reliable" } else { "not reliable" };
            let channel_name = channels[channel].name();
            let ratio_text = format_number(ratio);
            let limit_text = format_number(limit);
            format!(
                "{verdict_word}: the {extreme_name} ratio is {ratio_text} ({channel_name}), the \
                 limit {limit_text}"
            )
        }
        _ => "undefined: no ratio is defined".to_owned(),
    };
    text.line("verdict", &verdict_text);
    if let Some(trace_method) = trace_method.filter(|_| direct_method(&plan.integrator).is_none()) {
        let row_method = row.name("method").unwrap_or_default();
        let trace_name = trace_method.name();
        let methods_text =
            format!("{row_method}, as in the point's row of a map; the file: {trace_name}");
        text.line("method", methods_text);
    }
    if row.flag("sensitive") == Some(true) {
        text.line("sensitive", "chaotic: the digits are those of one trajectory");
    }
    let least_gaps = MODEL_NAMES.map(|model| column_text(&format!("min_gap_{model}_m")));
    let gap_text =
        format!("{} m nonlinear, {} m linear, over the whole run", least_gaps[0], least_gaps[1]);
    text.line("least gap", &gap_text);
    Ok(text)
}

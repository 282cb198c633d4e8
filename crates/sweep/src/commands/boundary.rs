//! `sweep boundary GRID.toml`: the curve itself.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Instant;

use super::run::line;
use super::{Grid, quoted};
use crate::boundary::file::bytes;
use crate::boundary::product::{Models, Task};
use crate::boundary::quantity::Quantity;
use crate::boundary::{Kind, Traced, trace};
use crate::engine::ModelEngine;
use crate::exit::{Error, Exit, tell};
use crate::files::{FileKind, Output};
use crate::interrupt::Interrupt;
use crate::plan::Plan;
use crate::progress::duration;
use crate::store::StoreError;
use crate::threads;

/// Arguments of `sweep boundary`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG)]
pub struct Args {
    /// The grid: its first axis gives the rows, its second the range that is searched
    #[command(flatten)]
    pub grid: Grid,
    /// Boundary file [default: results/NAME-boundary.parquet]
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// What is at its limit: ratio_max, ratio_CHANNEL, min_gap_nonlinear_m or min_gap_linear_m (at no gap)
    #[arg(long, value_name = "NAME", default_value = "ratio_max", value_parser = str::parse::<Quantity>)]
    pub quantity: Quantity,
    /// Width of the final brackets, in the second axis's unit; if that axis is logarithmic, as a fraction of its value
    /// [default: 1/480 of the range]
    #[arg(long, value_name = "WIDTH")]
    pub tolerance: Option<f64>,
    /// Cells along each axis of the lattice that guards against islands: the finer, the smaller the island it cannot
    /// miss, and the more points it takes
    #[arg(long, value_name = "CELLS", default_value_t = 6, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub lattice: u16,
    /// Worker threads [default: SLURM_CPUS_PER_TASK, else the cores of this machine]
    #[arg(long, value_name = "N", value_parser = threads::parse)]
    pub threads: Option<usize>,
}

/// What `--help` adds.
const LONG: &str = "\
For each value of the first axis, the places along the second where the quantity passes its limit, each with the bracket \
it is known to lie in. Where there is no such place, or the quantity leaps over its limit, the file says so and gives \
no number. The least and greatest value of the second axis are the range, however it is written. Axes beyond the second \
give one curve for every combination of their values.

The file is a pure function of its input, whatever the number of threads. An interrupted run leaves nothing behind.";

/// Traces the boundary of a grid.
///
/// # Errors
/// Mistakes in the grid file, a plan without a range to search, and whatever keeps the file from being written.
pub fn run(args: &Args) -> Result<Exit, Error> {
    let plan = args.grid.load()?;
    let plan = args.quantity.plan(&plan);
    let task = Task::new(&plan, args.tolerance, usize::from(args.lattice))?;
    let default = || PathBuf::from(format!("results/{}-boundary.parquet", plan.name));
    let output = args.out.clone().unwrap_or_else(default);
    let threads = threads::count(args.threads, &|name| std::env::var(name).ok())?;
    let file = Output::begin(&output, FileKind::Boundary)?;
    let interrupt = Interrupt::install().map_err(|source| Error::File {
        action: "install signal handlers for",
        path: PathBuf::from("this process"),
        source,
    })?;
    let engine = ModelEngine::new(&plan)?;
    let began = Instant::now();
    let told = Mutex::new(began);
    let progress = |points: u64| {
        // A line a minute is what a batch job's log can bear; a thread that finds another telling goes on.
        if let Ok(mut told) = told.try_lock()
            && told.elapsed().as_secs() >= 60
        {
            *told = Instant::now();
            tell(&format!("{points} points so far"));
        }
    };
    let models = Models::new(&plan, engine, args.quantity, threads, &interrupt, &progress)?;
    let Ok(traced) = trace(&models, &task.firsts, task.curves, &task.search) else {
        tell(&format!("{}: interrupted; nothing was written", plan.name));
        return Ok(match interrupt.signal() {
            Some(15) => Exit::Terminated,
            _ => Exit::Interrupted,
        });
    };
    let bytes = bytes(&plan, args.quantity, &task, &traced);
    file.finish(&bytes.map_err(StoreError::parquet("write", &output))?)?;
    let mut text = summary(&plan, args.quantity, &task, &traced, began.elapsed().as_secs_f64());
    let shown = output.display().to_string();
    line(&mut text, "file", &shown);
    line(&mut text, "next", &format!("sweep plot {}", quoted(&shown)));
    tell(text.trim_end());
    Ok(Exit::Done)
}

fn summary(plan: &Plan, quantity: Quantity, task: &Task, traced: &Traced, wall_s: f64) -> String {
    let mut text = String::new();
    let grid: f64 = plan.axes.iter().map(|axis| axis.values.len() as f64).product();
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "{}: {} = {} traced with {} points (the grid has {grid}) in {} rounds, {}",
        plan.name,
        quantity.name(),
        quantity.limit(plan),
        traced.trials,
        traced.rounds,
        duration(wall_s)
    );
    let rows = || traced.curves.iter().flatten();
    let counts: Vec<String> = Kind::ALL
        .into_iter()
        .map(|kind| (kind, rows().flat_map(|row| &row.edges).filter(|edge| edge.kind == kind).count()))
        .filter(|(_, count)| *count > 0)
        .map(|(kind, count)| format!("{count} {}", kind.name()))
        .collect();
    line(&mut text, "found", &counts.join(", "));
    let several = rows().filter(|row| row.edges.len() > 1).count();
    if several > 0 {
        line(&mut text, "folds", &format!("{several} values of the first axis have several crossings"));
    }
    let widest = rows()
        .flat_map(|row| &row.edges)
        .filter_map(|edge| edge.bracket.map(|[low, high]| high - low))
        .fold(0.0, f64::max);
    let unit = plan.axes.get(1).map_or("", |axis| axis.parameter.unit());
    line(
        &mut text,
        "brackets",
        &format!("at most {widest:.3} {unit} wide (asked: {})", task.search.tolerance),
    );
    text
}

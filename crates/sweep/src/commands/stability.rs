//! `sweep stability GRID.toml --speed FROM:TO:STEP`: periodic responses and whether they are
//! stable.

use super::held::{SpeedArgs, carry_out};
use crate::plan::Plan;
use crate::stability::{DwellEngine, check, dwells, tongues};
use sweep_engine::commands::grid::ResultArgs;
use sweep_engine::commands::run::{RunCommand, WorkArgs};
use sweep_engine::exit::{Error, Exit};

/// Arguments of `sweep stability`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG, mut_arg("out", |out| out.help(OUT)))]
pub struct Args {
    /// The grid, and the file: results/NAME-stability.parquet by default.
    #[command(flatten)]
    target: ResultArgs,
    #[command(flatten)]
    held: SpeedArgs,
    /// How it is done.
    #[command(flatten)]
    work: WorkArgs,
    /// Exit with 3 if any row has no response
    #[arg(long)]
    fail_on_error: bool,
}

/// Where the result goes, which is not where a run's goes.
const OUT: &str = "Result file [default: results/NAME-stability.parquet]";

/// What `--help` adds.
const LONG: &str = "\
A row for every point of the grid and every speed: the periodic response of both models while the \
drum turns at that speed for ever, and how fast a small disturbance of the nonlinear one grows. \
The spin profile, the window and the integrator of the grid file do not matter here. The result is \
written to results/NAME-stability.parquet unless --out names a file.

The file is a pure function of its input, whatever the number of threads, shards and \
interruptions. What an interrupted command has computed stays in FILE.partial, and the same \
command goes on from there.";

/// Finds the responses and writes them.
///
/// # Errors
/// Mistakes in the grid file or the options, and whatever keeps the file from being written;
/// finished chunks are kept.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let plan: Plan = args.target.grid.load()?;
    check(&plan, "--speed", &args.held.speed.to_string())?;
    let engine = DwellEngine::new(&plan, args.held.speed.values())?;
    let (job, output) = dwells(&plan, &args.held.speed, args.target.out.as_deref());
    let options = format!(" --speed {}", args.held.speed);
    let command = RunCommand {
        name: &plan.name,
        verb: "stability",
        rows: "rows",
        target: &args.target,
        work: &args.work,
        options: [&options; 2],
    };
    let lines = |file: &_| Ok(tongues::summary(file)?.lines());
    carry_out(&command, &engine, (&job, &output), lines, args.fail_on_error)
}

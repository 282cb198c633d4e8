//! `sweep dwell GRID.toml --speed SPEEDS`: the motions that held speeds end in.

use super::held::{SearchArgs, SpeedArgs, carry_out};
use crate::dwell::{Motions, motions, summary};
use crate::plan::Plan;
use crate::stability::{Asked, DwellEngine, check};
use sweep_engine::commands::grid::ResultArgs;
use sweep_engine::commands::run::{RunCommand, WorkArgs};
use sweep_engine::exit::{Error, Exit};

/// Where the result goes.
const OUT: &str = "Result file [default: results/NAME-dwell.parquet]";

/// Arguments of `sweep dwell`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG, mut_arg("out", |out| out.help(OUT)))]
pub struct Args {
    /// The grid, and the file: results/NAME-dwell.parquet by default.
    #[command(flatten)]
    target: ResultArgs,
    #[command(flatten)]
    held: SpeedArgs,
    /// How motions are looked for.
    #[command(flatten)]
    search: SearchArgs,
    /// How it is done.
    #[command(flatten)]
    work: WorkArgs,
    /// Exit with 3 if any row is not ok
    #[arg(long)]
    fail_on_error: bool,
}

/// What `--help` adds.
const LONG: &str = "\
A row for every point of the grid, every speed and every motion that was found there while the \
drum turns at that speed. Trajectories start from the periodic response, slightly disturbed, and \
from kicks in the two modes that rock most, one by one and together, each a third of a decade \
harder. They are followed until their largest deviations no longer change. It is a search, not a \
proof: a motion that no start leads to is not found.

The result is written to results/NAME-dwell.parquet unless --out names a file. The file is a pure \
function of its input, whatever the number of threads, shards and interruptions. What an \
interrupted command has computed stays in FILE.partial, and the same command goes on from there.";

/// Finds the motions and writes them.
///
/// # Errors
/// Mistakes in the grid file or the options, and whatever keeps the file from being written;
/// finished chunks are kept.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let plan: Plan = args.target.grid.load()?;
    check(&plan, "--speed", &args.held.speed.to_string())?;
    let (search, speeds_rpm) = (args.search.search(), args.held.speed.values());
    let engine =
        DwellEngine::asking(&plan, speeds_rpm, Asked::Motions(Motions::new(&plan, search)))?;
    let (job, output) = motions(&plan, speeds_rpm, &search, args.target.out.as_deref());
    let options = format!(" --speed {}{}", args.held.speed, args.search);
    let command = RunCommand {
        name: &plan.name,
        verb: "dwell",
        rows: "rows",
        target: &args.target,
        work: &args.work,
        options: [&options, &format!(" --dwell{options}")],
    };
    carry_out(&command, &engine, (&job, &output), summary::lines, args.fail_on_error)
}

//! `sweep stability GRID.toml --speed FROM:TO:STEP`: periodic responses and whether they are
//! stable.

use super::held::SpeedArgs;
use sweep_engine::commands::grid::ResultArgs;
use sweep_engine::commands::run::WorkArgs;
use sweep_engine::{Error, Exit};

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
The spin profile, the window and the integrator of the grid file do not matter here, but that the \
modes of a machine with friction are named as in that run. The result is written to \
results/NAME-stability.parquet unless --out names a file.

The file is a pure function of its input, whatever the number of threads, shards and \
interruptions. What an interrupted command has computed stays in FILE.partial, and the same \
command goes on from there.";

/// Finds the responses and writes them.
///
/// # Errors
/// Mistakes in the grid file or the options, and whatever keeps the file from being written;
/// finished chunks are kept.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    args.held.run(None, &args.target, &args.work, args.fail_on_error)
}

//! `sweep dwell GRID.toml --speed SPEEDS`: the motions that held speeds end in.

use super::held::SpeedArgs;
use crate::dwell::Search;
use sweep_engine::commands::grid::ResultArgs;
use sweep_engine::commands::run::WorkArgs;
use sweep_engine::{Error, Exit};

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
    search: Search,
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
    args.held.run(Some(args.search), &args.target, &args.work, args.fail_on_error)
}

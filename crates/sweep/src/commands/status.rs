//! `sweep status GRID.toml`: progress of a run, or of dwells.

use super::held::HeldArgs;
use crate::plan::Plan;
use sweep_engine::commands::status;
use sweep_engine::commands::status::of_job;
use sweep_engine::{Error, Exit};

/// Arguments of `sweep status`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    status: status::Args,
    #[command(flatten)]
    held: HeldArgs,
}

/// Shows the progress, without disturbing it.
///
/// # Errors
/// Mistakes in the grid file, a folder or file of another plan, a file that cannot be read.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let target = &args.status.target;
    let plan: Plan = target.grid.load()?;
    let (job, output, [verb, options]) = args.held.job(&plan, target);
    of_job(&args.status, &job, &output, [&verb, &options])
}

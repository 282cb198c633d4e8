//! `sweep merge GRID.toml`: finished shards into the one file, of a run or of dwells.

use super::held::HeldArgs;
use crate::plan::Plan;
use sweep_engine::commands::merge;
use sweep_engine::commands::merge::of_job;
use sweep_engine::{Error, Exit};

/// Arguments of `sweep merge`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    merge: merge::Args,
    #[command(flatten)]
    held: HeldArgs,
}

/// Joins what the shards have left.
///
/// # Errors
/// As the engine's command.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let target = &args.merge.target;
    let plan: Plan = target.grid.load()?;
    let (job, output, _) = args.held.job(&plan, target);
    of_job(&plan.name, &job, &output)
}

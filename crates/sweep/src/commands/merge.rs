//! `sweep merge GRID.toml`: finished shards into the one file, of a run or of dwells.

use crate::plan::Plan;
use crate::speeds::{Speeds, turning};
use crate::stability::dwells;
use sweep_engine::commands::merge::{self, of_job};
use sweep_engine::exit::{Error, Exit};

/// Arguments of `sweep merge`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    merge: merge::Args,
    /// Of `sweep stability` with these speeds, not of `sweep run`
    #[arg(long, value_name = "FROM:TO:STEP", value_parser = turning, allow_hyphen_values = true)]
    speed: Option<Speeds>,
}

/// Joins what the shards have left.
///
/// # Errors
/// As the engine's command.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let target = &args.merge.target;
    let Some(speed) = args.speed else { return merge::run::<crate::Washer>(&args.merge) };
    let plan: Plan = target.grid.load()?;
    let (job, output) = dwells(&plan, speed, target.out.as_deref());
    of_job(&plan.name, &job, &output)
}

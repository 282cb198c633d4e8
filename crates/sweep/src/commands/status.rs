//! `sweep status GRID.toml`: progress of a run, or of dwells.

use crate::plan::Plan;
use crate::speeds::{Speeds, turning};
use crate::stability::dwells;
use sweep_engine::commands::status::{self, of_job};
use sweep_engine::exit::{Error, Exit};

/// Arguments of `sweep status`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    status: status::Args,
    /// Of `sweep stability` with these speeds, not of `sweep run`
    #[arg(long, value_name = "FROM:TO:STEP", value_parser = turning, allow_hyphen_values = true)]
    speed: Option<Speeds>,
}

/// Shows the progress, without disturbing it.
///
/// # Errors
/// Mistakes in the grid file, a folder or file of another plan, a file that cannot be read.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let target = &args.status.target;
    let Some(speed) = args.speed else { return status::run::<crate::Washer>(&args.status) };
    let plan: Plan = target.grid.load()?;
    let (job, output) = dwells(&plan, speed, target.out.as_deref());
    of_job(&args.status, &job, &output, ["stability", &format!(" --speed {speed}")])
}

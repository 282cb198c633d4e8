//! `sweep explain GRID.toml --at NAME=VALUE` explains why the linear model fails at a point.

use crate::explain::{explain, format, json};
use crate::speeds::{Speeds, parse_speeds_above_zero};
use sweep_engine::commands::grid::GridArgs;
use sweep_engine::{Error, ExecutionArgs, Exit, Interrupt, show};

/// Arguments of `sweep explain`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG_HELP)]
pub struct ExplainArgs {
    #[command(flatten)]
    grid: GridArgs,
    /// Speeds to look at, in rpm, above 0 [default: from half of the slowest mode's frequency to
    /// the profile's fastest speed, by 1]
    #[arg(long, value_name = "FROM:TO:STEP", value_parser = parse_speeds_above_zero)]
    #[arg(allow_hyphen_values = true)]
    speed: Option<Speeds>,
    /// Print everything as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    execution: ExecutionArgs,
}

/// The end of `sweep explain --help`.
const LONG_HELP: &str = "\
Runs the point as `sweep run` does, finds the bands of speed in which the turning machine's \
periodic response is unstable, and follows small disturbances of the run through them. A \
disturbance is measured by its energy. docs/stability.md explains every line.";

/// Explains a point and prints the explanation.
///
/// # Errors
/// Returns an error for mistakes in the grid file or the options, for a profile that cannot be
/// explained, and for a machine without equilibrium or modes.
pub(crate) fn run(args: &ExplainArgs) -> Result<Exit, Error> {
    let (plan, parameters) = args.grid.load_point(&args.grid.at)?;
    // A signal ends the process, because there are no partial results to keep.
    let interrupt = Interrupt::new();
    let explanation =
        explain(&plan, parameters, args.speed, args.execution.with_interrupt(&interrupt))?;
    if args.json {
        return show(&format!("{:#}\n", json::to_json(&explanation)));
    }
    show(&format::to_text(&explanation))
}

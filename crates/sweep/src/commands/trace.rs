//! `sweep trace GRID.toml`: time histories of both models at one point.

use std::path::PathBuf;

use super::examples::Examples;
use crate::config;
use crate::exit::{Error, Exit, tell};
use crate::threads;
use crate::trace::{Extras, StartValue, every, start_of, start_value, trace};
use sweep_files::{FileKind, Output};

/// Shown by `--help`.
pub(super) const EXAMPLES: Examples = &[
    [
        "sweep trace my.toml --at unbalance_mass_kg=0.4 --at damping_n_s_per_m=100 --out \
                 rocking.parquet",
        "both models at one point",
    ],
    ["sweep plot rocking.parquet", "drawn over time and spin speed"],
];

/// Arguments of `sweep trace`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    grid: super::grid::GridArgs,
    /// The point: a value for each axis, on the grid or between its points, and for any other
    /// parameter; may be repeated
    #[arg(long, value_name = "NAME=VALUE")]
    at: Vec<String>,
    /// Time between two instants of the file, in s; the integration's steps are its own
    #[arg(long, value_name = "S", default_value_t = 0.01)]
    every: f64,
    /// Add the ten coordinates and their speeds
    #[arg(long)]
    states: bool,
    /// Add the force of each spring, damper, stop and bushing, and their sum on the cabinet
    #[arg(long)]
    forces: bool,
    /// Begin away from equilibrium, both models alike: a coordinate q1 to q10 (m, rad) or a speed
    /// u1 to u10 (per s); may be repeated
    #[arg(long, value_name = "NAME=VALUE", value_parser = start_value)]
    start: Vec<StartValue>,
    /// Trace file to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Integrates and writes.
///
/// # Errors
/// Mistakes in the grid file or the options, a machine without equilibrium, and a file that cannot
/// be written.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let (plan, at) = config::load_point(&args.grid.grid, &args.grid.sets, &args.at)?;
    let every_s = every(args.every, &plan)?;
    let extras = Extras { states: args.states, forces: args.forces };
    let start = start_of(&args.start);
    let output = Output::begin(&args.out, FileKind::Trace)?;
    let work = || trace(&plan, plan.scenario(0), at, every_s, &start, extras);
    // A thread for each model, where there may be two; they write the same bytes as one.
    let trace = match threads::pool(2) {
        Ok(pool) => pool.install(work)?,
        Err(_) => work()?,
    };
    trace.failures.iter().for_each(|failure| tell(failure));
    let instants = trace.instants;
    output.finish(&trace.into_bytes(&args.out)?)?;
    tell(&format!("wrote {}: {instants} instants from 0 to {} s", args.out.display(), plan.end_s));
    Ok(Exit::Done)
}

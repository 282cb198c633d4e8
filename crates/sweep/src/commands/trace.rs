//! `sweep trace GRID.toml`: time histories of both models at one point.

use std::path::PathBuf;

use washer_model::{COORDINATES, Start};

use super::examples::Examples;
use crate::config;
use crate::exit::{Error, Exit, tell};
use crate::plan::Plan;
use crate::threads;
use crate::trace::{Extras, MOST_INSTANTS, trace};
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
    #[arg(long, value_name = "NAME=VALUE", value_parser = start)]
    start: Vec<StartValue>,
    /// Trace file to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// One coordinate or speed at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
struct StartValue {
    is_speed: bool,
    /// From 0.
    index: usize,
    value: f64,
}

/// Angles beyond a right angle, and shifts of metres, are no start of anything.
const FARTHEST_START: f64 = 1.5;

fn start(text: &str) -> Result<StartValue, String> {
    let expected =
        "expected a coordinate q1 to q10 or a speed u1 to u10 with its value, as in q5=0.1";
    let (name, value) = text.split_once('=').ok_or(expected)?;
    let (is_speed, number) = match (name.trim().strip_prefix('q'), name.trim().strip_prefix('u')) {
        (Some(number), _) => (false, number),
        (_, Some(number)) => (true, number),
        _ => return Err(expected.to_owned()),
    };
    let index = number
        .parse::<usize>()
        .ok()
        .filter(|number| (1..=COORDINATES).contains(number))
        .ok_or(expected)?;
    let value =
        value.trim().parse::<f64>().ok().filter(|value| value.is_finite()).ok_or(expected)?;
    if !is_speed && value.abs() > FARTHEST_START {
        return Err(format!("expected at most {FARTHEST_START} m or rad from equilibrium"));
    }
    Ok(StartValue { is_speed, index: index - 1, value })
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
    let mut start = Start::default();
    for StartValue { is_speed, index, value } in &args.start {
        if *is_speed { start.speeds[*index] = *value } else { start.deviations[*index] = *value }
    }
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

/// The time between instants, if it makes a sensible number of them.
fn every(every_s: f64, plan: &Plan) -> Result<f64, Error> {
    let least = plan.end_s / MOST_INSTANTS;
    if (least..=plan.end_s).contains(&every_s) {
        return Ok(every_s);
    }
    Err(Error::Option {
        option: "--every",
        given: every_s.to_string(),
        expected: format!("from {least:e} to {} s", plan.end_s),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_start_is_a_coordinate_or_a_speed() {
        assert_eq!(start("q5=0.1"), Ok(StartValue { is_speed: false, index: 4, value: 0.1 }));
        assert_eq!(start(" u10 = -2"), Ok(StartValue { is_speed: true, index: 9, value: -2.0 }));
        for wrong in ["", "q5", "q0=1", "q11=1", "x=1", "q1=nan", "u1=1e999", "q=1", "q5=2"] {
            assert!(start(wrong).unwrap_err().contains("expected"), "{wrong}");
        }
    }
}

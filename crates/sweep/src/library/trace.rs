//! Time histories at one point, in memory.

use super::result::{ResultKind, ResultTable};
use crate::config::GridInput;
use crate::exit::Error;
use crate::random_keys::draw_random_keys;
use crate::threads;
use crate::trace::{self, Extras, every, start_of, start_value};

/// What a trace holds.
#[derive(Clone, Debug)]
pub struct TraceOptions {
    /// Time between two instants, s.
    pub every_s: f64,
    /// Whether the ten coordinates and their speeds are there too.
    pub states: bool,
    /// Whether the forces of springs and dampers are there too.
    pub forces: bool,
    /// Where both models begin, away from equilibrium: `q5=0.1` (m, rad), `u1=2` (per s).
    pub start: Vec<String>,
}

/// Time histories of both models at a point of a grid, or of its only one: `at` gives each axis a
/// value, and any other parameter, as `NAME=VALUE`. Beside them, how each model failed that did.
///
/// # Errors
/// Mistakes in the grid or the options; a machine without equilibrium.
pub fn trace_point(
    grid: &GridInput,
    at: &[String],
    options: &TraceOptions,
) -> Result<(ResultTable, Vec<String>), Error> {
    draw_random_keys()?;
    let (plan, at) = grid.load_point(at)?;
    let every_s = every(options.every_s, &plan)?;
    let start = options.start.iter().map(|text| {
        start_value(text).map_err(|expected| Error::Option {
            option: "start",
            given: text.clone(),
            expected: expected.trim_start_matches("expected ").to_owned(),
        })
    });
    let start = start_of(&start.collect::<Result<Vec<_>, _>>()?);
    let extras = Extras { states: options.states, forces: options.forces };
    let work = || trace::trace(&plan, plan.scenario(0), at, every_s, &start, extras, None);
    // A thread for each model, where there may be two; they give the same bits as one.
    let trace = match threads::pool(2) {
        Ok(pool) => pool.install(work)?,
        Err(_) => work()?,
    };
    let failures = trace.failures.clone();
    Ok((ResultTable::of_table(ResultKind::Trace, trace.into_table())?, failures))
}

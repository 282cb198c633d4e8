//! Time histories at one point, in memory.

use super::result::ResultTable;
use crate::config::GridInput;
use crate::trace::{self, Extras, View, every, start_of, start_value};
use sweep_engine::exit::Error;
use sweep_engine::interrupt::Interrupt;
use sweep_engine::threads;
use sweep_files::FileKind;

/// What a trace holds.
#[derive(Clone, Debug, Default)]
pub struct TraceOptions {
    /// Time between two instants, s.
    pub every_s: f64,
    /// Whether rates and accelerations of the channels are there too.
    pub rates: bool,
    /// Whether the ten coordinates and their speeds are there too.
    pub states: bool,
    /// Whether the forces of springs and dampers are there too.
    pub forces: bool,
    /// Where both models begin, away from equilibrium: `q5=0.1` (m, rad), `u1=2` (per s).
    pub start: Vec<String>,
}

/// Time histories of both models at a point of a grid, or of its only one: `at` gives each axis a
/// value, and any other parameter, as `NAME=VALUE`. Beside them, how each model failed that did;
/// `None` if it was interrupted.
///
/// # Errors
/// Mistakes in the grid or the options; a machine without equilibrium.
pub fn trace_point(
    grid: &GridInput,
    at: &[String],
    options: &TraceOptions,
    interrupt: &Interrupt,
) -> Result<Option<(ResultTable, Vec<String>)>, Error> {
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
    let TraceOptions { rates, states, forces, .. } = *options;
    let extras = Extras { rates, states, forces };
    let view = View { every_s, start, extras, quick: None };
    let stop = || interrupt.stopped();
    let work = || trace::trace(&plan, plan.scenario(0), at, &view, &stop);
    // A thread for each model, where there may be two; they give the same bits as one.
    let trace = match threads::pool(2) {
        Ok(pool) => pool.install(work),
        Err(_) => work(),
    }
    .map_err(Error::model)?;
    if interrupt.stopped() {
        return Ok(None);
    }
    let failures = trace.failures.clone();
    Ok(Some((ResultTable::of_table(FileKind::Trace, trace.into_table())?, failures)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::find_modes;

    #[test]
    fn an_interrupt_ends_a_trace_and_modes() {
        // Hours of work each.
        let text = "spin = { profile = \"ramp\", peak_rpm = 350, ramp_s = 5 }\n\
             time = { end_s = 1e5 }\nintegrator = { method = \"rk4\", step_s = 1e-5 }\n";
        let grid = GridInput::text("grid", text.to_owned(), Vec::new());
        let speeds: Vec<f64> = (0..60_000_u32).map(|k| 100.0 + 0.005 * f64::from(k)).collect();
        let interrupt = Interrupt::new();
        interrupt.raise(2);
        let options = TraceOptions { every_s: 1.0, ..TraceOptions::default() };
        assert!(trace_point(&grid, &[], &options, &interrupt).unwrap().is_none());
        assert!(find_modes(Some(&grid), &[], &speeds, &interrupt).unwrap().is_none());
    }
}

//! Time histories at one point or at all of a grid, in memory.

use clap::ValueEnum as _;

use super::result::MemoryTable;
use crate::config::GridInput;
use crate::trace::{self, Extras, Models, View, every, start_of, start_value};
use sweep_engine::{Error, Interrupt};
use sweep_files::FileKind;

/// What a trace holds.
#[derive(Clone, Debug, Default)]
pub struct TraceOptions {
    /// Time between two instants, s; `None` for one a turn, where the unbalance is up.
    pub every_s: Option<f64>,
    /// `nonlinear` or `linear`: that model alone.
    pub model: Option<String>,
    /// Every point of the grid, not one.
    pub all: bool,
    /// What it holds beside channels, gap and speed.
    pub extras: Extras,
    /// Where both models begin, away from equilibrium: `q5=0.1` (m, rad), `u1=2` (per s).
    pub start: Vec<String>,
}

/// Time histories of both models at a point of a grid, or of its only one: `at` gives each axis a
/// value, and any other parameter, as `NAME=VALUE`. Of all points it fixes what it names. Beside
/// them, how each model failed that did;
/// `None` if it was interrupted.
///
/// # Errors
/// Mistakes in the grid or the options; a machine without equilibrium.
pub fn trace_point(
    grid: &GridInput,
    at: &[String],
    options: &TraceOptions,
    interrupt: &Interrupt,
) -> Result<Option<(MemoryTable, Vec<String>)>, Error> {
    let (plan, at) = match options.all {
        true => (grid.clone().fixing(at).load()?, None),
        false => grid.load_point(at).map(|(plan, at)| (plan, Some(at)))?,
    };
    let every_s = every(options.every_s, &plan)?;
    let start = options.start.iter().map(|text| {
        start_value(text).map_err(|expected| {
            Error::option("start", text, expected.trim_start_matches("expected "))
        })
    });
    let start = start_of(&start.collect::<Result<Vec<_>, _>>()?);
    let models = match options.model.as_deref() {
        None => Models::Both,
        Some(name) => Models::from_str(name, false)
            .map_err(|_| Error::option("model", name, "nonlinear, linear or both"))?,
    };
    let view = View { every_s, models, start, extras: options.extras, quick: None };
    let stop = || interrupt.stopped();
    let trace = trace::in_pool(&plan, at, &view, &stop).map_err(Error::model)?;
    if interrupt.stopped() {
        return Ok(None);
    }
    Ok(Some((MemoryTable::of_table(FileKind::Trace, trace.table)?, trace.failures)))
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
        let options = TraceOptions { every_s: Some(1.0), ..TraceOptions::default() };
        assert!(trace_point(&grid, &[], &options, &interrupt).unwrap().is_none());
        assert!(find_modes(Some(&grid), &[], &speeds, &interrupt).unwrap().is_none());
    }
}

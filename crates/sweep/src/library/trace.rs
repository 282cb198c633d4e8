//! Time histories at one point or at all points of a grid, in memory.

use clap::ValueEnum as _;
use lane_ode::Cancel;

use super::result::MemoryTable;
use crate::config::WasherGridInput;
use crate::trace::{
    Models, TraceExtras, TraceSettings, check_spacing, parse_start_value, start_from, trace_in_pool,
};
use sweep_engine::{Error, Interrupt};
use sweep_files::FileKind;

/// The models, the instants and the quantities of a trace.
#[derive(Clone, Debug, Default)]
pub struct TraceOptions {
    /// The time between two instants (s). `None` stands for one instant a turn, where the unbalance
    /// is up.
    pub every_s: Option<f64>,
    /// The only model, `nonlinear` or `linear`; `None` for both.
    pub model: Option<String>,
    /// Whether all points of the grid are traced, instead of one.
    pub all: bool,
    /// The quantities besides channels, gap and speed.
    pub extras: TraceExtras,
    /// The initial values of both models that differ from equilibrium, such as `q5=0.1` (m or rad)
    /// and `u1=2` (per s).
    pub start: Vec<String>,
}

/// Returns time histories of both models and a message for each integration that failed; `None` if
/// the work was interrupted.
///
/// `point_values` has texts `NAME=VALUE`. For one point they give every axis its value and may set
/// other parameters; for all points they fix the parameters that they name.
///
/// # Errors
///
/// Returns an error for mistakes in the grid or the options, and for a machine without equilibrium.
pub fn trace_point(
    grid: &WasherGridInput,
    point_values: &[String],
    options: &TraceOptions,
    interrupt: &Interrupt,
) -> Result<Option<(MemoryTable, Vec<String>)>, Error> {
    let (plan, parameters) = match options.all {
        true => (grid.clone().with_fixed(point_values).load()?, None),
        false => {
            grid.load_point(point_values).map(|(plan, parameters)| (plan, Some(parameters)))?
        }
    };
    let every_s = check_spacing(options.every_s, &plan)?;
    let start_values = options.start.iter().map(|text| {
        parse_start_value(text).map_err(|expected| {
            Error::option("start", text, expected.trim_start_matches("expected "))
        })
    });
    let initial_deviation = start_from(&start_values.collect::<Result<Vec<_>, _>>()?);
    let models = match options.model.as_deref() {
        None => Models::Both,
        Some(name) => Models::from_str(name, false)
            .map_err(|_| Error::option("model", name, "nonlinear, linear or both"))?,
    };
    let settings = TraceSettings {
        every_s,
        models,
        start: initial_deviation,
        extras: options.extras,
        capped: None,
    };
    let cancel = Cancel::Flag(interrupt.flag());
    let trace_table = trace_in_pool(&plan, parameters, &settings, cancel).map_err(Error::model)?;
    if interrupt.is_raised() {
        return Ok(None);
    }
    Ok(Some((MemoryTable::from_table(FileKind::Trace, trace_table.table)?, trace_table.failures)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::find_modes;

    #[test]
    fn an_interrupt_ends_a_trace_and_modes() {
        // Each of the two functions would take hours.
        let grid_text = "spin = { profile = \"ramp\", peak_rpm = 350, ramp_s = 5 }\n\
             time = { end_s = 1e5 }\nintegrator = { method = \"rk4\", step_s = 1e-5 }\n";
        let grid = WasherGridInput::text("grid", grid_text.to_owned(), Vec::new());
        let speeds_rpm: Vec<f64> = (0..60_000_u32).map(|k| 100.0 + 0.005 * f64::from(k)).collect();
        let interrupt = Interrupt::new();
        interrupt.raise(2);
        let options = TraceOptions { every_s: Some(1.0), ..TraceOptions::default() };
        assert!(trace_point(&grid, &[], &options, &interrupt).unwrap().is_none());
        assert!(find_modes(Some(&grid), &[], &speeds_rpm, &interrupt).unwrap().is_none());
    }
}

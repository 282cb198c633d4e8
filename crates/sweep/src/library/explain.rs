//! The cause of a failure of the linear model at a point, as data and as text.

use serde_json::Value;

use super::{Execution, speeds_error};
use crate::config::WasherGridInput;
use crate::explain::{explain, format, json};
use crate::speeds::Speeds;
use sweep_engine::Error;

/// The result of a command as data and as text.
#[derive(Debug)]
pub struct CommandReport {
    /// The data, which the command prints with `--json`.
    pub data: Value,
    /// The text that the command prints.
    pub text: String,
}

/// Explains the verdict of a point of a grid; `None` if it was interrupted.
///
/// `point_values` has texts `NAME=VALUE`, which give every axis its value and may set other
/// parameters. `speeds_rpm` are equally spaced; by default they go from half of the slowest mode's
/// frequency to the profile's greatest speed.
///
/// # Errors
///
/// Returns an error for mistakes in the grid or the options, if the profile reaches no speed at
/// which responses are sought, and if the machine has no equilibrium or no modes.
pub fn explain_point(
    grid: &WasherGridInput,
    point_values: &[String],
    speeds_rpm: Option<&[f64]>,
    execution: Execution<'_>,
) -> Result<Option<CommandReport>, Error> {
    let (plan, parameters) = grid.load_point(point_values)?;
    let speeds_of_values = |speeds: &[f64]| {
        Speeds::from_values(speeds).filter(|speeds| speeds.from_rpm > 0.0).ok_or_else(|| {
            let expected = "at least two equally spaced speeds in rpm above 0, as those of \
                            range(200, 351)";
            speeds_error(speeds.len(), expected.to_owned())
        })
    };
    let speeds = speeds_rpm.map(speeds_of_values).transpose()?;
    let explanation = explain(&plan, parameters, speeds, execution)?;
    if execution.interrupt.is_raised() {
        return Ok(None);
    }
    Ok(Some(CommandReport {
        data: json::to_json(&explanation),
        text: format::to_text(&explanation),
    }))
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;
    use sweep_engine::interrupt::Interrupt;
    use sweep_engine::progress::ProgressMode;

    #[test]
    fn an_interrupt_ends_an_explanation() {
        let grid_text =
            "spin = { profile = \"ramp\", peak_rpm = 350, ramp_s = 5 }\ntime = { end_s = 5 }\n";
        let grid = WasherGridInput::text("grid", grid_text.to_owned(), Vec::new());
        // An explanation at all these speeds would take minutes.
        let speeds: Vec<f64> = (0..60_000_u32).map(|k| 100.0 + 0.005 * f64::from(k)).collect();
        let interrupt = Interrupt::new();
        let execution =
            Execution { threads: Some(1), progress: ProgressMode::None, interrupt: &interrupt };
        let explanation = std::thread::scope(|scope| {
            let explaining_thread =
                scope.spawn(|| explain_point(&grid, &[], Some(&speeds), execution));
            std::thread::sleep(Duration::from_millis(500));
            assert!(!explaining_thread.is_finished(), "it is too short");
            let start_instant = Instant::now();
            interrupt.raise(2);
            let explanation = explaining_thread.join().unwrap();
            assert!(
                start_instant.elapsed() < Duration::from_secs(5),
                "{:?}",
                start_instant.elapsed()
            );
            explanation
        });
        assert!(explanation.unwrap().is_none());
    }
}

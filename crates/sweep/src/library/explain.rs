//! Why the linear model fails at a point, as data and in words.

use serde_json::Value;

use super::{Effort, refused_speeds};
use crate::config::GridInput;
use crate::explain::{explain, format, json};
use crate::speeds::Speeds;
use sweep_engine::Error;

/// What is found at a point.
#[derive(Debug)]
pub struct Explained {
    /// Everything, as `sweep explain --json` prints it.
    pub found: Value,
    /// What `sweep explain` prints.
    pub text: String,
}

/// Explains a point of a grid, or its only one: `at` gives each axis a value, and any other
/// parameter, as `NAME=VALUE`. Looks at even speeds (rpm), without any from half of the slowest
/// mode's frequency to the profile's fastest speed; `None` if it was interrupted.
///
/// # Errors
/// Mistakes in the grid or the options, a profile that cannot be explained, and a machine without
/// equilibrium or modes.
pub fn explain_point(
    grid: &GridInput,
    at: &[String],
    speeds_rpm: Option<&[f64]>,
    effort: Effort<'_>,
) -> Result<Option<Explained>, Error> {
    let (plan, at) = grid.load_point(at)?;
    let even = |speeds: &[f64]| {
        Speeds::of_values(speeds).filter(|speeds| speeds.from > 0.0).ok_or_else(|| {
            let expected = "at least two speeds in rpm above 0 at even distances, as those of \
                            range(200, 351)";
            refused_speeds(speeds.len(), expected.to_owned())
        })
    };
    let speeds = speeds_rpm.map(even).transpose()?;
    let found = explain(&plan, at, speeds, effort)?;
    if effort.interrupt.stopped() {
        return Ok(None);
    }
    Ok(Some(Explained { found: json::of(&found), text: format::of(&found) }))
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;
    use sweep_engine::interrupt::Interrupt;
    use sweep_engine::progress::ProgressMode;

    #[test]
    fn an_interrupt_ends_it() {
        let text =
            "spin = { profile = \"ramp\", peak_rpm = 350, ramp_s = 5 }\ntime = { end_s = 5 }\n";
        let grid = GridInput::text("grid", text.to_owned(), Vec::new());
        // Minutes of work.
        let speeds: Vec<f64> = (0..60_000_u32).map(|k| 100.0 + 0.005 * f64::from(k)).collect();
        let interrupt = Interrupt::new();
        let effort =
            Effort { threads: Some(1), progress: ProgressMode::None, interrupt: &interrupt };
        let found = std::thread::scope(|scope| {
            let work = scope.spawn(|| explain_point(&grid, &[], Some(&speeds), effort));
            std::thread::sleep(Duration::from_millis(500));
            assert!(!work.is_finished(), "it is too short");
            let raised = Instant::now();
            interrupt.raise(2);
            let found = work.join().unwrap();
            assert!(raised.elapsed() < Duration::from_secs(5), "{:?}", raised.elapsed());
            found
        });
        assert!(found.unwrap().is_none());
    }
}

//! Why the linear model fails at a point, as data and in words.

use serde_json::Value;

use super::{Effort, refused_speeds};
use crate::config::GridInput;
use crate::engine::simd_from_environment;
use crate::exit::Error;
use crate::explain::{explain, json, words};
use crate::random_keys::draw_random_keys;
use crate::speeds::Speeds;
use crate::threads;

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
/// mode's frequency to the profile's fastest speed. Nothing interrupts it.
///
/// # Errors
/// Mistakes in the grid or the options, a profile that cannot be explained, and a machine without
/// equilibrium or modes.
pub fn explain_point(
    grid: &GridInput,
    at: &[String],
    speeds_rpm: Option<&[f64]>,
    effort: Effort<'_>,
) -> Result<Explained, Error> {
    draw_random_keys()?;
    let (plan, at) = grid.load_point(at)?;
    let even = |speeds: &[f64]| {
        Speeds::of_values(speeds).filter(|speeds| speeds.from > 0.0).ok_or_else(|| {
            let expected = "at least two speeds in rpm above 0 at even distances, as those of \
                            range(200, 351)";
            refused_speeds(speeds.len(), expected.to_owned())
        })
    };
    let speeds = speeds_rpm.map(even).transpose()?;
    let (threads, simd) = (effort.threads()?, simd_from_environment()?);
    let found = threads::pool(threads)?.install(|| explain(&plan, at, speeds, simd))?;
    Ok(Explained { found: json::of(&found), text: words::of(&found) })
}

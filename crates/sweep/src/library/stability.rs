//! Machines at constant speeds.

use super::check_speeds;
use super::run::Task;
use crate::dwell::Search;
use crate::plan::Plan;
use crate::stability::{Held, check};
use sweep_engine::Error;

/// What becomes of each point of a plan's grid at each constant speed (rpm, rising): by a search
/// the motions that it ends in, else the periodic responses of both models and how fast
/// disturbances of them grow. Speeds vary fastest.
///
/// # Errors
/// Speeds that do not rise, an axis that means nothing at a constant speed, a search out of bounds;
/// `SWEEP_SIMD` naming nothing this machine has.
pub fn held<'a>(
    plan: &'a Plan,
    speeds_rpm: &'a [f64],
    search: Option<Search>,
) -> Result<Task<'a>, Error> {
    check_speeds(speeds_rpm, 1, |speed| speed > 0.0, " above 0")?;
    check(plan, "speeds", &format!("with {} values", speeds_rpm.len()))?;
    search.map_or(Ok(()), |search| search.check())?;
    let held = Held { plan, speeds_rpm, search };
    Ok(Task { job: held.job(), engine: Box::new(held.engine()?) })
}

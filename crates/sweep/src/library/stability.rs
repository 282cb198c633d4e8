//! The task to find periodic responses or attractors of machines at held speeds.

use super::check_speeds;
use super::run::EvaluationTask;
use crate::dwell::AttractorSearch;
use crate::plan::Plan;
use crate::stability::{HeldPlan, check_axes};
use sweep_engine::Error;

/// Returns the task to find the motions of each point of a plan's grid at increasing held speeds
/// (rpm): with a search the attractors, without one the periodic responses of both models with the
/// growth of disturbances. Speeds vary fastest.
///
/// # Errors
/// Returns an error if speeds do not increase, if an axis has no meaning at a held speed, if an
/// option of the search is out of bounds, and if `SWEEP_SIMD` names no instruction set of this
/// processor.
pub fn held_speeds_task<'a>(
    plan: &'a Plan,
    speeds_rpm: &'a [f64],
    search: Option<AttractorSearch>,
) -> Result<EvaluationTask<'a>, Error> {
    check_speeds(speeds_rpm, 1, |speed| speed > 0.0, " above 0")?;
    check_axes(plan, "speeds", &format!("with {} values", speeds_rpm.len()))?;
    search.map_or(Ok(()), |search| search.check())?;
    let held_plan = HeldPlan { plan, speeds_rpm, search };
    Ok(EvaluationTask { job: held_plan.job(), engine: held_plan.engine()? })
}

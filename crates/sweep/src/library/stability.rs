//! Machines at constant speeds, in memory or into a file.

use std::path::Path;

use super::evaluate::in_memory;
use super::result::ResultTable;
use super::run::{RanToFile, into_file};
use super::{Effort, check_speeds};
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
/// no threads.
pub fn find_held(
    plan: &Plan,
    speeds_rpm: &[f64],
    search: Option<Search>,
    effort: Effort<'_>,
) -> Result<ResultTable, Error> {
    let held = checked(plan, speeds_rpm, search)?;
    in_memory(&held.job(), effort, &held.engine()?)
}

/// As [`find_held`], into a result file: the bytes of `sweep dwell` or `sweep stability`, resumed
/// if it was interrupted.
///
/// # Errors
/// As [`find_held`] and [`super::run_to_file`].
pub fn held_to_file(
    plan: &Plan,
    (speeds_rpm, search): (&[f64], Option<Search>),
    output: &Path,
    fresh: bool,
    tell: &dyn Fn(&str),
    effort: Effort<'_>,
) -> Result<RanToFile, Error> {
    let held = checked(plan, speeds_rpm, search)?;
    into_file(&held.engine()?, &held.job(), output, fresh, tell, effort)
}

fn checked<'a>(
    plan: &'a Plan,
    speeds_rpm: &'a [f64],
    search: Option<Search>,
) -> Result<Held<'a>, Error> {
    check_speeds(speeds_rpm, 1, |speed| speed > 0.0, " above 0")?;
    check(plan, "speeds", &format!("with {} values", speeds_rpm.len()))?;
    search.map_or(Ok(()), |search| search.check())?;
    Ok(Held { plan, speeds_rpm, search })
}

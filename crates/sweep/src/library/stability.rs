//! Machines at constant speeds, in memory or into a file.

use std::path::Path;

use super::evaluate::{Evaluated, in_memory};
use super::run::{RanToFile, into_file};
use super::{Effort, check_speeds};
use crate::dwell::{Motions, Search, motions};
use crate::plan::Plan;
use crate::stability::{Asked, DwellEngine, check, job};
use sweep_engine::exit::Error;
use sweep_engine::store::Job;

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
) -> Result<Evaluated, Error> {
    let (engine, job) = asked(plan, speeds_rpm, search)?;
    in_memory(&job, effort, &engine)
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
    let (engine, job) = asked(plan, speeds_rpm, search)?;
    into_file(&engine, &job, output, fresh, tell, effort)
}

fn asked<'a>(
    plan: &'a Plan,
    speeds_rpm: &'a [f64],
    search: Option<Search>,
) -> Result<(DwellEngine<'a>, Job<'a>), Error> {
    check_speeds(speeds_rpm, 1, |speed| speed > 0.0, " above 0")?;
    check(plan, "speeds", &format!("with {} values", speeds_rpm.len()))?;
    let Some(search) = search else {
        return Ok((DwellEngine::new(plan, speeds_rpm)?, job(plan, speeds_rpm)));
    };
    search.check()?;
    let asked = Asked::Motions(Motions::new(plan, search));
    let engine = DwellEngine::asking(plan, speeds_rpm, asked)?;
    Ok((engine, motions(plan, speeds_rpm, &search, None).0))
}

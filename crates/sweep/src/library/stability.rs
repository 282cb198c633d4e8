//! Periodic responses at constant speeds, in memory or into a file.

use std::path::Path;

use super::evaluate::{Evaluated, in_memory};
use super::run::{RanToFile, into_file};
use super::{Effort, refused_speeds};
use crate::plan::Plan;
use crate::speeds::MOST_SPEEDS;
use crate::stability::{DwellEngine, check};
use sweep_engine::exit::Error;

/// The periodic response of both models at each point of a plan's grid and each constant speed
/// (rpm, rising), and how fast disturbances of it grow; speeds vary fastest.
///
/// # Errors
/// Speeds that do not rise, an axis that means nothing at a constant speed; no threads.
pub fn find_stability(
    plan: &Plan,
    speeds_rpm: &[f64],
    effort: Effort<'_>,
) -> Result<Evaluated, Error> {
    check_speeds(plan, speeds_rpm)?;
    let engine = DwellEngine::new(plan, speeds_rpm)?;
    let job = crate::stability::job(plan, speeds_rpm);
    in_memory(&job, effort, &engine)
}

/// As [`find_stability`], into a result file: the bytes of `sweep stability`, resumed if it was
/// interrupted.
///
/// # Errors
/// As [`find_stability`] and [`super::run_to_file`].
pub fn stability_to_file(
    plan: &Plan,
    speeds_rpm: &[f64],
    output: &Path,
    fresh: bool,
    tell: &dyn Fn(&str),
    effort: Effort<'_>,
) -> Result<RanToFile, Error> {
    check_speeds(plan, speeds_rpm)?;
    let engine = DwellEngine::new(plan, speeds_rpm)?;
    into_file(&engine, &crate::stability::job(plan, speeds_rpm), output, fresh, tell, effort)
}

fn check_speeds(plan: &Plan, speeds_rpm: &[f64]) -> Result<(), Error> {
    let rise = speeds_rpm.windows(2).all(|pair| pair[0] < pair[1]);
    let turn = speeds_rpm.iter().all(|speed| speed.is_finite() && *speed > 0.0);
    let count = speeds_rpm.len();
    if !(rise && turn && count > 0 && count as f64 <= MOST_SPEEDS + 1.0) {
        return Err(refused_speeds(
            count,
            format!(
                "from 1 to {MOST_SPEEDS} finite speeds in rpm above 0, each above the one before"
            ),
        ));
    }
    check(plan, "speeds", &format!("with {count} values"))
}

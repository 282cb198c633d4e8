//! Disturbances of periodic responses at constant speeds.

use washer_model::{Dwell, NoAnswer, Point, Response, respond};
use washer_row::{Growth, Status};

use super::together_or_alone;

/// The periodic responses of points at constant speeds, or why there is none.
pub(crate) fn responses(dwells: &[Dwell<'_>]) -> Vec<Result<Response, Status>> {
    let together = |dwells: &[Dwell<'_>]| {
        let answers = respond(dwells).into_iter();
        let status = |none| match none {
            NoAnswer::NoResponse => Status::NoResponse,
            NoAnswer::Eigenvalues => Status::NoMultipliers,
        };
        answers.map(|answer| answer.map_err(status)).collect()
    };
    together_or_alone(dwells, together, || Err(Status::Panicked))
}

/// The fastest growing disturbance at any of these speeds; the first speed wins a tie. Speeds
/// without a response are left out.
pub(super) fn fastest_growth(point: &Point, speeds_rpm: &[f64]) -> Option<Growth> {
    let dwells: Vec<Dwell<'_>> =
        speeds_rpm.iter().map(|&speed_rpm| Dwell { point, speed_rpm }).collect();
    let found = responses(&dwells);
    let fastest = found
        .iter()
        .flatten()
        .reduce(|most, next| if next.growth_per_s() > most.growth_per_s() { next } else { most })?;
    Some(Growth::from(fastest))
}

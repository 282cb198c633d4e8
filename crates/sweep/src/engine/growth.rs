//! Disturbances of periodic responses at constant speeds.

use washer_model::{Dwell, NoAnswer, Point, Response, respond};
use washer_row::{Growth, Status};

use super::together_or_alone;

/// The periodic responses of points at constant speeds, that of a machine that runs up first, or
/// why there is none. Once `is_stopped` says so, what comes means nothing.
pub(crate) fn responses(
    dwells: &[Dwell<'_>],
    is_stopped: &dyn Fn() -> bool,
) -> Vec<Result<Vec<Response>, Status>> {
    let together = |dwells: &[Dwell<'_>]| {
        let answers = respond(dwells, is_stopped).into_iter();
        let status = |none| match none {
            NoAnswer::NoResponse | NoAnswer::Stopped => Status::NoResponse,
            NoAnswer::Eigenvalues => Status::NoMultipliers,
            NoAnswer::TooSlow => Status::TooSlow,
        };
        answers.map(|answer| answer.map_err(status)).collect()
    };
    together_or_alone(dwells, together, || Err(Status::Panicked))
}

/// The fastest growing disturbance at any of these speeds, of the response that a machine is in
/// that runs up; the first speed wins a tie. Speeds without a response are left out. Where that
/// response is within the machine's geometry, what another passes is told.
pub(super) fn fastest_growth(
    point: &Point,
    speeds_rpm: &[f64],
    is_stopped: &dyn Fn() -> bool,
) -> Option<Growth> {
    let dwells: Vec<Dwell<'_>> =
        speeds_rpm.iter().map(|&speed_rpm| Dwell { point, speed_rpm }).collect();
    let found = responses(&dwells, is_stopped);
    let there = || found.iter().flatten().filter_map(|responses| responses.first());
    let fastest = there()
        .reduce(|most, next| if next.growth_per_s() > most.growth_per_s() { next } else { most })?;
    let beyond = fastest.beyond.or_else(|| there().find_map(|response| response.beyond));
    Some(Growth { beyond, ..Growth::from(fastest) })
}

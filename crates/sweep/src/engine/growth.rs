//! What becomes of machines at constant speeds: growth of disturbances, motions that they end in.

use lane_ode::Simd;
use washer_model::{Dwell, Endings, Point, Response, STATE_LEN, Starts, endings, respond};
use washer_row::{Dwelt, Growth, Metric, Outcome, Status};

use super::together_or_alone;

/// A state that a machine brings along from another speed.
pub(crate) type Carried = Option<[f64; STATE_LEN]>;

/// The periodic responses of points at constant speeds, that of a machine that runs up first, or
/// why there is none. Once `is_stopped` says so, what comes means nothing.
pub(crate) fn responses(
    dwells: &[Dwell<'_>],
    is_stopped: &dyn Fn() -> bool,
) -> Vec<Result<Vec<Response>, Status>> {
    let together = |dwells: &[Dwell<'_>]| {
        let answers = respond(dwells, is_stopped).into_iter();
        answers.map(|answer| answer.map_err(Status::from)).collect()
    };
    together_or_alone(dwells, together, || Err(Status::Panicked))
}

/// The response of a machine that runs up whose disturbances grow fastest, of those at some speeds;
/// the first of equals.
pub(crate) fn fastest(found: &[Result<Vec<Response>, Status>]) -> Option<&Response> {
    let there = found.iter().flatten().filter_map(|responses| responses.first());
    there.reduce(|most, next| if next.growth_per_s() > most.growth_per_s() { next } else { most })
}

/// The motions that points end in at constant speeds, or why there are none. Once `is_stopped` says
/// so, what comes means nothing.
pub(crate) fn motions(
    simd: Simd,
    dwells: &[(Dwell<'_>, Carried)],
    starts: &Starts,
    is_stopped: &dyn Fn() -> bool,
) -> Vec<Result<Endings, Status>> {
    let together = |dwells: &[(Dwell<'_>, Carried)]| {
        let (dwells, carried): (Vec<_>, Vec<_>) = dwells.iter().copied().unzip();
        let found = endings(simd, &dwells, &carried, starts, is_stopped).into_iter();
        found.map(|found| found.map_err(Status::from)).collect()
    };
    together_or_alone(dwells, together, || Err(Status::Panicked))
}

/// Adds what metrics ask of points at constant speeds (rpm), those of all points in lanes: the
/// fastest growing disturbance of the response that a machine is in that runs up, where the first
/// speed wins a tie, and how far its motions go. Speeds without an answer are left out. Where that
/// response is within the machine's geometry, what another passes is told.
pub(super) fn add(
    rows: &mut [(&mut Outcome, &Point)],
    simd: Simd,
    (speeds_rpm, metrics): (&[f64], &[Metric]),
    is_stopped: &dyn Fn() -> bool,
) {
    let at_speeds = |point| speeds_rpm.iter().map(move |&speed_rpm| Dwell { point, speed_rpm });
    let dwells: Vec<Dwell<'_>> = rows.iter().flat_map(|(_, point)| at_speeds(*point)).collect();
    if metrics.contains(&Metric::Growth) {
        let found = responses(&dwells, is_stopped);
        for ((outcome, _), found) in rows.iter_mut().zip(found.chunks(speeds_rpm.len())) {
            outcome.growth = fastest(found).map(|fastest| {
                let there = found.iter().flatten().filter_map(|responses| responses.first());
                let others = || there.clone().find_map(|response| response.beyond);
                Growth { beyond: fastest.beyond.or_else(others), ..Growth::from(fastest) }
            });
        }
    }
    if metrics.contains(&Metric::Dwell) {
        let dwells: Vec<_> = dwells.iter().map(|dwell| (*dwell, None)).collect();
        let found = motions(simd, &dwells, &Starts::default(), is_stopped);
        for ((outcome, _), found) in rows.iter_mut().zip(found.chunks(speeds_rpm.len())) {
            let all = speeds_rpm.iter().zip(found).flat_map(|(speed, found)| {
                let motions = found.iter().flat_map(|found| &found.motions);
                motions.map(|motion| (*speed, motion))
            });
            outcome.dwelt = Dwelt::of(all);
        }
    }
}

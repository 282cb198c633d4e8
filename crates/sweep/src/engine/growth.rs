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

/// What is told of the response of a machine that runs up whose disturbances grow fastest, of those
/// at some speeds; the first of equals. Where it is within the machine's geometry, what another of
/// these passes is told too; where one is missing or off the curve, so is it: a machine that runs
/// up may be in another motion there.
pub(crate) fn of_speeds(found: &[Result<Vec<Response>, Status>]) -> Option<Growth> {
    let firsts = || found.iter().map(|found| found.as_ref().ok()?.first());
    let faster = |most: &Response, next: &Response| next.growth_per_s() > most.growth_per_s();
    let fastest =
        firsts().flatten().reduce(|most, next| if faster(most, next) { next } else { most })?;
    let beyond = fastest.beyond.or_else(|| firsts().flatten().find_map(|first| first.beyond));
    let is_on_curve = firsts().all(|first| first.is_some_and(|first| first.is_on_curve));
    Some(Growth { beyond, is_on_curve, ..Growth::from(fastest) })
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
/// speed wins a tie, and how far its motions go. Speeds without an answer are left out.
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
            outcome.growth = of_speeds(found);
        }
    }
    if metrics.contains(&Metric::Dwell) {
        let dwells: Vec<_> = dwells.iter().map(|dwell| (*dwell, None)).collect();
        let found = motions(simd, &dwells, &Starts::default(), is_stopped);
        for ((outcome, _), found) in rows.iter_mut().zip(found.chunks(speeds_rpm.len())) {
            outcome.dwelt = Dwelt::of(speeds_rpm, found);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use washer_model::Channel;

    #[test]
    fn growth_is_that_of_a_run_up_only_where_no_speed_is_off_the_curve() {
        let response = |speed_rpm: f64, is_on_curve: bool| {
            Ok(vec![Response {
                speed_rpm,
                is_on_curve,
                branch: 0,
                between_rpm: [None; 2],
                beyond: None,
                nonlinear: [0.0; Channel::ALL.len()],
                linear: [0.0; Channel::ALL.len()],
                start: [0.0; STATE_LEN],
                multiplier: [-1.2, 0.0],
                participants: Vec::new(),
            }])
        };
        let [on, other] = [response(240.0, true), response(260.0, true)];
        let growth =
            |found: &[_]| of_speeds(found).map(|it| (it.fastest.speed_rpm, it.is_on_curve));
        assert_eq!(growth(&[on.clone(), other.clone()]), Some((260.0, true)));
        assert_eq!(growth(&[response(230.0, false), on, other.clone()]), Some((260.0, false)));
        assert_eq!(growth(&[Err(Status::NoResponse), other]), Some((260.0, false)));
        assert_eq!(growth(&[Err(Status::NoResponse)]), None);
    }
}

//! Machines at held speeds: their periodic responses, the growth of disturbances about these, and
//! the motions in which machines end.

use lane_ode::{Cancel, Simd};
use washer_model::{Attractors, HeldSpeed, Point, Response, STATE_LEN, StartRule, find_attractors};
use washer_row::{DwellPeaks, Growth, Metric, Outcome, Status};

use super::map_isolating_panics;

/// The state in which a machine arrives from another speed, if it does.
pub(crate) type CarriedState = Option<[f64; STATE_LEN]>;

/// Returns the periodic responses of points at held speeds, or the status of a point without one.
/// The first response is that of a machine that runs up. Once `cancel` is requested, the result
/// is meaningless.
pub(crate) fn find_responses(
    held_speeds: &[HeldSpeed<'_>],
    cancel: Cancel<'_>,
) -> Vec<Result<Vec<Response>, Status>> {
    let find_group = |dwells: &[HeldSpeed<'_>]| {
        let responses_or_errors = washer_model::find_responses(dwells, cancel).into_iter();
        responses_or_errors.map(|answer| answer.map_err(Status::from)).collect()
    };
    map_isolating_panics(held_speeds, find_group, || Err(Status::Panicked))
}

/// Returns the fastest growth of disturbances about the response of a machine that runs up, over
/// several speeds; the first speed wins a tie.
///
/// `exceeded_limit` is the limit of the machine's geometry that this response passes, or else one
/// that a response at another speed passes. `is_on_curve` holds only if every speed has a response
/// on the curve of a run-up: otherwise the machine may be in another motion at some of them.
pub(crate) fn fastest_growth(
    responses_at_speeds: &[Result<Vec<Response>, Status>],
) -> Option<Growth> {
    let first_responses =
        || responses_at_speeds.iter().map(|responses| responses.as_ref().ok()?.first());
    let fastest = first_responses().flatten().reduce(|fastest, response| {
        if response.growth_per_s() > fastest.growth_per_s() { response } else { fastest }
    })?;
    let exceeded_limit = fastest
        .exceeded_limit
        .or_else(|| first_responses().flatten().find_map(|first| first.exceeded_limit));
    let is_on_curve = first_responses().all(|first| first.is_some_and(|first| first.is_on_curve));
    Some(Growth { exceeded_limit, is_on_curve, ..Growth::from(fastest) })
}

/// Returns the motions in which points end at held speeds, or the status of a point without one.
/// Once `cancel` is requested, the result is meaningless.
pub(crate) fn find_motions(
    simd: Simd,
    held_speeds: &[(HeldSpeed<'_>, CarriedState)],
    starts: &StartRule,
    cancel: Cancel<'_>,
) -> Vec<Result<Attractors, Status>> {
    let find_group = |dwells: &[(HeldSpeed<'_>, CarriedState)]| {
        let (dwells, carried_states): (Vec<_>, Vec<_>) = dwells.iter().copied().unzip();
        let attractors =
            find_attractors(simd, &dwells, &carried_states, starts, cancel).into_iter();
        attractors.map(|attractors| attractors.map_err(Status::from)).collect()
    };
    map_isolating_panics(held_speeds, find_group, || Err(Status::Panicked))
}

/// Adds the metrics at held speeds (rpm) to the rows of points, which share lanes: the fastest
/// growth of disturbances, and the amplitudes of the motions in which machines end. Speeds without
/// an answer are left out.
pub(super) fn add_held_speed_metrics(
    rows: &mut [(&mut Outcome, &Point)],
    simd: Simd,
    (speeds_rpm, metrics): (&[f64], &[Metric]),
    cancel: Cancel<'_>,
) {
    let held_speeds_of_point =
        |point| speeds_rpm.iter().map(move |&speed_rpm| HeldSpeed { point, speed_rpm });
    let held_speeds: Vec<HeldSpeed<'_>> =
        rows.iter().flat_map(|(_, point)| held_speeds_of_point(*point)).collect();
    if metrics.contains(&Metric::Growth) {
        let responses = find_responses(&held_speeds, cancel);
        for ((outcome, _), responses) in rows.iter_mut().zip(responses.chunks(speeds_rpm.len())) {
            outcome.growth = fastest_growth(responses);
        }
    }
    if metrics.contains(&Metric::Dwell) {
        let held_speeds_and_states: Vec<_> =
            held_speeds.iter().map(|dwell| (*dwell, None)).collect();
        let motions = find_motions(simd, &held_speeds_and_states, &StartRule::default(), cancel);
        for ((outcome, _), motions) in rows.iter_mut().zip(motions.chunks(speeds_rpm.len())) {
            outcome.dwell_peaks = DwellPeaks::from_attractors(speeds_rpm, motions);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use washer_model::Channel;

    #[test]
    fn growth_is_on_the_curve_only_if_every_speed_is() {
        let response = |speed_rpm: f64, is_on_curve: bool| {
            Ok(vec![Response {
                speed_rpm,
                is_on_curve,
                branch: 0,
                fold_speeds_rpm: [None; 2],
                exceeded_limit: None,
                nonlinear_peaks: [0.0; Channel::ALL.len()],
                linear_peaks: [0.0; Channel::ALL.len()],
                start_state: [0.0; STATE_LEN],
                multiplier: [-1.2, 0.0],
                participating_modes: Vec::new(),
            }])
        };
        let [response_on_curve, other_response] = [response(240.0, true), response(260.0, true)];
        let speed_and_curve = |responses: &[_]| {
            fastest_growth(responses).map(|growth| (growth.fastest.speed_rpm, growth.is_on_curve))
        };
        assert_eq!(
            speed_and_curve(&[response_on_curve.clone(), other_response.clone()]),
            Some((260.0, true))
        );
        assert_eq!(
            speed_and_curve(&[response(230.0, false), response_on_curve, other_response.clone()]),
            Some((260.0, false))
        );
        assert_eq!(
            speed_and_curve(&[Err(Status::NoResponse), other_response]),
            Some((260.0, false))
        );
        assert_eq!(speed_and_curve(&[Err(Status::NoResponse)]), None);
    }
}

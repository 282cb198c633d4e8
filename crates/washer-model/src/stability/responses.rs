//! Periodic responses at requested speeds: Newton's method from guesses on the curve of a point's
//! responses, and the stability of the responses.

use super::continuation::{Guess, OVERSHOOT_RATIO, ResponseCurve};
use super::monodromy::scale_speeds;
use super::newton::{NewtonSearch, relative_residual, run_searches};
use super::participation::{eigenvector, energy_shares, participating_modes};
use super::period_map::{
    LinearResponse, OrbitRecord, TurnRequest, TurnSetup, compute_turns,
    linear_responses_with_motion_friction, solve_linear_responses,
};
use super::settings::{HeldCase, Settings};
use super::{GeometryLimit, HeldSpeed, Response, ResponseError, StabilityKind, round_last_digits};
use crate::coordinates::{COORDINATES, STATES};
use crate::modes::modes;
use crate::point::Point;
use crate::run::model::{LaneModel, NonlinearModel};
use crate::run::suspension::attachment_vectors;
use crate::steps::SUSPENSION_MODES;
use core::f64::consts::TAU;
use faer::{Mat, c64};
use lane_ode::Cancel;

/// The least share of a disturbance's energy in the counted modes with which its multiplier counts.
/// Basis: the disturbance then belongs mostly to these modes. Doubling it excludes almost every
/// multiplier.
const MIN_ENERGY_SHARE: f64 = 0.5;

/// The magnitude of growth (1/s) below which a response is computed again without caps. Basis: it
/// exceeds the effect of caps on the growth. Doubling it computes more responses again.
const UNCERTAIN_GROWTH_PER_S: f64 = 2e-3;

/// The highest harmonic of the drum's speed that may excite the hinge, if forces have no corners.
/// Basis: higher harmonics of smooth forces are below the tolerance. Doubling it checks more
/// responses.
const MAX_HINGE_HARMONIC: f64 = 7.0;
/// The relative residual of a turn without caps, from a response with caps, above which the
/// response is computed again without caps. Basis: caps change the bearings' deflection by as much.
/// Doubling it doubles the effect of caps that is accepted.
const CAP_RESIDUAL_TOLERANCE: f64 = 2e-4;

/// The greatest distance (m, rad) of a response from its guess; a response farther away belongs to
/// another branch. Doubling it assigns more responses of other branches to a guess.
const MAX_GUESS_DISTANCE: f64 = 5e-3;

/// The distance (m, rad) below which two responses are the same. Doubling it changes nothing as
/// long as responses are more accurate.
const SAME_RESPONSE_DISTANCE: f64 = 1e-6;

/// The distance (m, rad) above which two guesses of a curve belong to different responses. Basis:
/// it is ten times the distance of equal responses. Doubling it skips the check of branches closer
/// to a fold.
const SEPARATE_GUESS_DISTANCE: f64 = 10.0 * SAME_RESPONSE_DISTANCE;

/// The greatest step (m, rad) of the damped search after an undamped one has failed.
/// Basis: it is a fifth of the distance within which a result belongs to its guess. Doubling it
/// loses responses beside folds to their neighbours; halving it doubles the turns.
const MAX_DAMPED_STEP: f64 = 0.2 * MAX_GUESS_DISTANCE;

/// The factor by which the suspension's slowest transient decays before Newton's method starts, if
/// no curve has a response at the speed. Basis: Newton's method converges from an error of a
/// thousandth of the motion. Doubling it makes the integration a tenth shorter.
const TRANSIENT_DECAY: f64 = 1e-3;

/// The longest integration of a transient (s). Basis: modes with a decay of at least 0.06/s reach
/// [`TRANSIENT_DECAY`] within it. Doubling it doubles the time of a speed without any response.
const MAX_TRANSIENT_S: f64 = 120.0;

/// Returns the periodic responses at constant speeds, computed in lanes. Consecutive speeds of the
/// same point share the point's curve of responses. Each result is that of
/// [`ResponseCurves::find_at_speeds`].
pub fn find_responses(
    held_speeds: &[HeldSpeed<'_>],
    cancel: Cancel<'_>,
) -> Vec<Result<Vec<Response>, ResponseError>> {
    let is_same_point = |a: &HeldSpeed<'_>, b: &HeldSpeed<'_>| core::ptr::eq(a.point, b.point);
    let mut points_with_max_speed = Vec::new();
    let mut requests = Vec::new();
    for point_speeds in held_speeds.chunk_by(is_same_point) {
        let max_speed_rpm =
            point_speeds.iter().map(|held_speed| held_speed.speed_rpm).fold(0.0, f64::max);
        requests.extend(
            point_speeds
                .iter()
                .map(|held_speed| (points_with_max_speed.len(), held_speed.speed_rpm)),
        );
        points_with_max_speed.push((point_speeds[0].point, max_speed_rpm));
    }
    let mut curves = ResponseCurves::continue_curves(&points_with_max_speed, None, cancel);
    ResponseCurves::find_at_speeds(&mut curves, &requests, cancel)
}

/// A point's periodic responses over speed.
#[derive(Clone)]
pub struct ResponseCurves<'a> {
    /// The curve from a low speed up.
    upward_curve: ResponseCurve<'a>,
    /// The curve from a high speed down, if the upward curve is lost.
    downward_curve: Option<ResponseCurve<'a>>,
}

impl<'a> ResponseCurves<'a> {
    /// Continues the responses of points from a low speed up, each to the highest speed (rpm) that
    /// will be requested, in lanes. With a `start_response` of another machine, the continuation
    /// begins with the nearby response at that speed. Once `cancel` is requested, the result
    /// has no meaning.
    #[must_use]
    pub fn continue_curves(
        points: &[(&'a Point, f64)],
        start_response: Option<&Response>,
        cancel: Cancel<'_>,
    ) -> Vec<Self> {
        let curves_with_range = points.iter().map(|&(point, max_speed_rpm)| {
            let curve = ResponseCurve::new(Settings::new(point));
            let lowest_rpm = start_response
                .map_or_else(|| curve.settings.lowest_rpm(), |response| Ok(response.speed_rpm));
            let lowest_rpm = lowest_rpm.ok().filter(|&lowest_rpm| lowest_rpm < max_speed_rpm);
            let end_rpm = start_response.map_or(OVERSHOOT_RATIO, |_| 1.0) * max_speed_rpm;
            (curve, lowest_rpm.map(|lowest_rpm| [lowest_rpm, end_rpm]))
        });
        let Some(upward_curve) =
            continue_between(curves_with_range.collect(), start_response, cancel)
        else {
            return Vec::new();
        };
        // From the response of another machine, only the branch of that response is continued.
        let is_lost = |curve: &ResponseCurve<'_>, max_speed_rpm: f64| {
            start_response.is_none() && curve.is_lost(max_speed_rpm)
        };
        let lost_curves = upward_curve
            .iter()
            .zip(points)
            .filter(|(curve, (_, max_speed_rpm))| is_lost(curve, *max_speed_rpm));
        let curves_with_range = lost_curves.map(|(curve, (point, _))| {
            let [highest_rpm, lowest_rpm] =
                [curve.settings.highest_rpm(), curve.settings.lowest_rpm()];
            let range_rpm = highest_rpm
                .ok()
                .zip(lowest_rpm.ok())
                .filter(|(highest_rpm, lowest_rpm)| highest_rpm > lowest_rpm);
            (ResponseCurve::new(Settings::new(point)), range_rpm.map(<[f64; 2]>::from))
        });
        let Some(downward_curve) = continue_between(curves_with_range.collect(), None, cancel)
        else {
            return Vec::new();
        };
        let mut downward_curve = downward_curve.into_iter();
        let curves =
            upward_curve.into_iter().zip(points).map(|(upward_curve, (_, max_speed_rpm))| {
                let downward_curve = if is_lost(&upward_curve, *max_speed_rpm) {
                    downward_curve.next()
                } else {
                    None
                };
                Self { upward_curve, downward_curve }
            });
        curves.collect()
    }

    /// Returns the guesses of the responses at a speed (rpm): those on the upward curve and, if
    /// that curve is lost, those on the downward curve, whose branches have the next numbers.
    fn guesses_at(&self, speed_rpm: f64) -> Vec<Guess> {
        let mut guesses = self.upward_curve.guesses_at(speed_rpm);
        if let Some(downward_curve) =
            self.downward_curve.as_ref().filter(|_| self.upward_curve.is_lost(speed_rpm))
        {
            let downward_guesses = downward_curve.guesses_at(speed_rpm).into_iter();
            let first_branch = self.upward_curve.fold_count() + 1;
            guesses.extend(
                downward_guesses
                    .map(|guess| Guess { branch: first_branch + guess.branch, ..guess }),
            );
        }
        guesses
    }

    /// Finds the responses for each request, an index in `curves` and a speed (rpm), in lanes.
    ///
    /// The responses of a request are in the order of the upward curve: the first one is that of a
    /// machine that runs up, until its branch ends. Then come those of the downward curve, if the
    /// upward one is lost, and the response that a search from the linear model's response finds,
    /// if the machine has friction or stops. If the upward curve has no response, that of the
    /// search comes first. The responses do not depend on other requests, nor on the end of the
    /// continuation.
    ///
    /// A response with a growth close to 0 is computed without caps, by classical Runge-Kutta in
    /// steps that resolve the bearings' modes.
    ///
    /// # Errors
    /// Returns [`ResponseError`] for a request without a response, and [`ResponseError::Stopped`]
    /// once `cancel` is requested.
    pub fn find_at_speeds(
        curves: &mut [Self],
        requests: &[(usize, f64)],
        cancel: Cancel<'_>,
    ) -> Vec<Result<Vec<Response>, ResponseError>> {
        let stopped_results = || requests.iter().map(|_| Err(ResponseError::Stopped)).collect();
        if cancel.is_requested() {
            return stopped_results();
        }
        let mut held_cases = Vec::with_capacity(requests.len());
        let mut setups = Vec::new();
        for &(curve, speed_rpm) in requests {
            let Some(Self { upward_curve, .. }) = curves.get_mut(curve) else {
                return stopped_results();
            };
            let held_case = upward_curve.settings.held_case(speed_rpm);
            setups.extend(
                held_case
                    .as_ref()
                    .ok()
                    .map(|held_case| upward_curve.settings.linear_setup(held_case.setup)),
            );
            held_cases.push(held_case);
        }
        let mut linear_responses =
            linear_responses_with_motion_friction(&setups, cancel).into_iter();
        let (mut sought_responses, mut searches): (Vec<SoughtResponse<'_>>, Vec<NewtonSearch<'_>>) =
            Default::default();
        for (request, (held_case, (curve, speed_rpm))) in
            held_cases.iter().zip(requests).enumerate()
        {
            let Ok(held_case) = held_case else { continue };
            let Some(linear_response) = linear_responses.next() else { continue };
            let mut guesses = curves[*curve].guesses_at(*speed_rpm);
            // Friction and stops may cause responses that are not on the curve. At a speed below
            // the beginning of the curve there is only one response.
            let is_off_curve = guesses.iter().all(|guess| !guess.is_on_curve);
            if is_off_curve || held_case.setup.has_corners() {
                let branch = guesses.last().map_or(0, |last_guess| last_guess.branch + 1);
                let first_rpm = curves[*curve].upward_curve.settings.lowest_rpm();
                let is_on_curve = first_rpm.is_ok_and(|first_rpm| *speed_rpm < first_rpm);
                let guess = guess_from_linear(held_case.setup.point, &linear_response);
                let insert_index = if is_off_curve { 0 } else { guesses.len() };
                guesses.insert(insert_index, Guess { branch, is_on_curve, ..guess });
            }
            for guess in guesses {
                searches.push(NewtonSearch::new(
                    held_case.setup,
                    guess.state,
                    guess.factors.clone(),
                ));
                sought_responses.push(SoughtResponse {
                    request_index: request,
                    held_case: held_case.clone(),
                    guess,
                    linear_peaks: linear_response.peaks,
                });
            }
        }
        if !run_searches(&mut searches, cancel) {
            return stopped_results();
        }
        let mut results: Vec<Result<Response, ResponseError>> = sought_responses
            .iter()
            .zip(searches)
            .map(|(sought_response, search)| sought_response.to_response(search))
            .collect();
        if cancel.is_requested()
            || !retry_missing_responses(&sought_responses, &mut results, cancel)
        {
            return stopped_results();
        }
        discard_known_responses(&sought_responses, &mut results);
        if !find_lost_branches(&sought_responses, &mut results, cancel) {
            return stopped_results();
        }
        // Responses whose stability is uncertain, or which caps change, are computed again without
        // caps.
        let changed_by_caps = find_changed_by_caps(&sought_responses, &results, cancel);
        let mut uncertain_responses = Vec::new();
        for (index, response) in results.iter().enumerate() {
            let Ok(response) = response else { continue };
            let is_uncertain = response.growth_per_s().abs() < UNCERTAIN_GROWTH_PER_S;
            if (is_uncertain || changed_by_caps[index])
                && sought_responses[index].held_case.setup.caps.is_some()
            {
                uncertain_responses.push((
                    index,
                    sought_responses[index].held_case.without_caps(),
                    response.start_state,
                ));
            }
        }
        let mut searches: Vec<(usize, NewtonSearch<'_>)> = Vec::new();
        for (index, held_case, start_state) in uncertain_responses {
            match held_case {
                Ok(held_case) => {
                    searches.push((index, NewtonSearch::new(held_case.setup, start_state, None)));
                    sought_responses[index].held_case = held_case;
                }
                Err(error) => results[index] = Err(error),
            }
        }
        let start_states: Vec<(usize, [f64; STATES])> =
            searches.iter().map(|(index, search)| (*index, search.state())).collect();
        if !run_and_store(&sought_responses, &mut results, searches, cancel) {
            return stopped_results();
        }
        // If a harmonic excites the hinge, the response may be far from the one with caps.
        let retries: [fn(&HeldCase<'a>, [f64; STATES]) -> NewtonSearch<'a>; 2] = [
            |held_case, start_state| {
                NewtonSearch::new_damped(held_case.setup, start_state, MAX_DAMPED_STEP)
            },
            |held_case, start_state| {
                NewtonSearch::new_after_transient(
                    held_case.setup,
                    start_state,
                    transient_turn_count(held_case),
                )
            },
        ];
        for retry in retries {
            let missing_starts =
                start_states.iter().filter(|(index, _)| is_missing(&results[*index]));
            let searches = missing_starts.map(|(index, start_state)| {
                (*index, retry(&sought_responses[*index].held_case, *start_state))
            });
            let searches: Vec<(usize, NewtonSearch<'_>)> = searches.collect();
            if !run_and_store(&sought_responses, &mut results, searches, cancel) {
                return stopped_results();
            }
        }
        if !find_lost_branches(&sought_responses, &mut results, cancel) {
            return stopped_results();
        }
        let error = |held_case: Result<HeldCase<'_>, ResponseError>| {
            held_case.err().unwrap_or(ResponseError::NoResponse)
        };
        let mut request_results: Vec<Result<Vec<Response>, ResponseError>> =
            held_cases.into_iter().map(|held_case| Err(error(held_case))).collect();
        for (sought_response, response) in sought_responses.iter().zip(results) {
            let request_result = &mut request_results[sought_response.request_index];
            match (response, request_result.as_mut()) {
                (Ok(response), Ok(responses)) => responses.push(response),
                (Ok(response), Err(_)) => *request_result = Ok(vec![response]),
                (Err(error), Err(previous_error)) => *previous_error = error,
                (Err(_), Ok(_)) => {}
            }
        }
        request_results
    }
}

/// Continues curves, each between two speeds (rpm), from the linear model's response or from the
/// response of another machine. Returns `None` once `cancel` is requested.
fn continue_between<'a>(
    curves_with_range: Vec<(ResponseCurve<'a>, Option<[f64; 2]>)>,
    start_response: Option<&Response>,
    cancel: Cancel<'_>,
) -> Option<Vec<ResponseCurve<'a>>> {
    let (mut curves, ranges_rpm): (Vec<ResponseCurve<'a>>, Vec<Option<[f64; 2]>>) =
        curves_with_range.into_iter().unzip();
    let start_setups: Vec<Option<TurnSetup<'_>>> = curves
        .iter_mut()
        .zip(&ranges_rpm)
        .map(|(curve, range_rpm)| curve.settings.continuation_setup((*range_rpm)?[0]).ok())
        .collect();
    // The curve must not depend on the speeds at which friction is linearised.
    let setups: Vec<TurnSetup<'_>> = curves
        .iter()
        .zip(&start_setups)
        .filter_map(|(curve, start_setup)| {
            Some(TurnSetup { point: curve.settings.without_friction(), ..(*start_setup)? })
        })
        .collect();
    let linear_responses = solve_linear_responses(&setups, cancel);
    let setups_with_linear = start_setups.iter().flatten().zip(&linear_responses);
    let mut searches: Vec<NewtonSearch<'_>> = setups_with_linear
        .map(|(setup, linear_response)| {
            let linear_state = || guess_from_linear(setup.point, linear_response).state;
            NewtonSearch::new(
                *setup,
                start_response.map_or_else(linear_state, |response| response.start_state),
                None,
            )
        })
        .collect();
    let is_complete = run_searches(&mut searches, cancel);
    let mut searches = searches.into_iter();
    for ((curve, range_rpm), start_setup) in curves.iter_mut().zip(&ranges_rpm).zip(&start_setups) {
        if let (Some(setup), Some([_, end_rpm])) = (start_setup, range_rpm)
            && let Some((state, _)) = searches.next().and_then(NewtonSearch::into_response)
        {
            curve.begin(setup.speed_rpm, &state, *end_rpm);
        }
    }
    (is_complete && run_searches(&mut curves, cancel)).then_some(curves)
}

/// Searches again for missing responses. Guesses on a curve are tried with damped steps. If a
/// request still has no response, the machine is integrated from the linear model's response until
/// its transient has decayed, which may lead to a stable response. Returns false once `cancel` is
/// requested.
fn retry_missing_responses(
    sought_responses: &[SoughtResponse<'_>],
    results: &mut [Result<Response, ResponseError>],
    cancel: Cancel<'_>,
) -> bool {
    let mut retries: Vec<(usize, NewtonSearch<'_>)> = Vec::new();
    for (index, sought_response) in sought_responses.iter().enumerate() {
        if sought_response.guess.is_on_either_curve() && is_missing(&results[index]) {
            retries.push((
                index,
                NewtonSearch::new_damped(
                    sought_response.held_case.setup,
                    sought_response.guess.state,
                    MAX_DAMPED_STEP,
                ),
            ));
        }
    }
    if !run_and_store(sought_responses, results, retries, cancel) {
        return false;
    }
    let mut retries: Vec<(usize, NewtonSearch<'_>)> = Vec::new();
    for (index, sought_response) in sought_responses.iter().enumerate() {
        let mut same_request = sought_responses
            .iter()
            .zip(results.iter())
            .filter(|(other, _)| other.request_index == sought_response.request_index);
        if !sought_response.guess.is_on_either_curve()
            && same_request.all(|(_, response)| is_missing(response))
        {
            let turn_count = transient_turn_count(&sought_response.held_case);
            let setup = sought_response.held_case.setup;
            let state = sought_response.guess.state;
            retries.push((index, NewtonSearch::new_after_transient(setup, state, turn_count)));
        }
    }
    run_and_store(sought_responses, results, retries, cancel)
}

/// Finds branches whose searches ended in the responses of neighbouring branches.
///
/// A curve crosses a speed alternately upwards and downwards, and branches vanish in pairs, at
/// folds. If an odd number of a curve's guesses at a speed have no response of their own, at least
/// one branch was missed: deflated searches, which the known responses repel, find it. Returns
/// false once `cancel` is requested.
fn find_lost_branches(
    sought_responses: &[SoughtResponse<'_>],
    results: &mut [Result<Response, ResponseError>],
    cancel: Cancel<'_>,
) -> bool {
    discard_duplicates(sought_responses, results);
    let mut searches: Vec<(usize, NewtonSearch<'_>)> = Vec::new();
    let indices: Vec<usize> = (0..sought_responses.len())
        .filter(|&index| sought_responses[index].guess.is_on_either_curve())
        .collect();
    let curve_key = |index: usize| {
        (sought_responses[index].request_index, sought_responses[index].guess.is_on_curve)
    };
    for curve_indices in indices.chunk_by(|&a, &b| curve_key(a) == curve_key(b)) {
        let missing_indices = curve_indices.iter().filter(|&&index| is_missing(&results[index]));
        let missing_indices: Vec<usize> = missing_indices.copied().collect();
        if missing_indices.len().is_multiple_of(2) {
            continue;
        }
        let known_responses: Vec<[f64; STATES]> = curve_indices
            .iter()
            .filter_map(|&index| Some(results[index].as_ref().ok()?.start_state))
            .collect();
        for index in missing_indices {
            let SoughtResponse { held_case, guess, .. } = &sought_responses[index];
            let search = NewtonSearch::new_deflated(
                held_case.setup,
                guess.state,
                MAX_DAMPED_STEP,
                known_responses.clone(),
            );
            searches.push((index, search));
        }
    }
    let is_complete = run_and_store(sought_responses, results, searches, cancel);
    discard_duplicates(sought_responses, results);
    is_complete
}

/// Discards duplicates among a curve's responses at a speed: of two equal responses, the one closer
/// to its guess stays.
fn discard_duplicates(
    sought_responses: &[SoughtResponse<'_>],
    results: &mut [Result<Response, ResponseError>],
) {
    let state_distance = |a: &[f64; STATES], b: &[f64; STATES]| {
        (0..COORDINATES).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max)
    };
    for index in 0..results.len() {
        for other_index in index + 1..results.len() {
            let SoughtResponse { guess, request_index, .. } = &sought_responses[index];
            let other_response = &sought_responses[other_index];
            if other_response.request_index != *request_index {
                break;
            }
            let are_on_curves =
                guess.is_on_either_curve() && other_response.guess.is_on_either_curve();
            let are_separate =
                state_distance(&guess.state, &other_response.guess.state) > SEPARATE_GUESS_DISTANCE;
            let (Ok(a), Ok(b)) = (&results[index], &results[other_index]) else { continue };
            if are_on_curves
                && are_separate
                && state_distance(&a.start_state, &b.start_state) < SAME_RESPONSE_DISTANCE
            {
                let first_distance = state_distance(&a.start_state, &guess.state);
                let second_distance = state_distance(&b.start_state, &other_response.guess.state);
                let farther_index =
                    if first_distance > second_distance { index } else { other_index };
                results[farther_index] = Err(ResponseError::NoResponse);
            }
        }
    }
}

/// Whether a search has found no response.
fn is_missing(response: &Result<Response, ResponseError>) -> bool {
    matches!(response, Err(ResponseError::NoResponse))
}

/// Returns the number of turns after which the suspension's slowest transient has decayed.
fn transient_turn_count(held_case: &HeldCase<'_>) -> usize {
    let modes = &held_case.frozen_modes.modes[..SUSPENSION_MODES];
    let decay_per_s = modes.iter().map(|mode| -mode.re_per_s).fold(f64::INFINITY, f64::min);
    let transient_s = -libm::log(TRANSIENT_DECAY) / decay_per_s.max(0.0);
    (transient_s.min(MAX_TRANSIENT_S) / held_case.setup.turn_s()).ceil() as usize
}

/// Runs searches, and stores their responses at the given indices. Returns false once `cancel` is
/// requested.
fn run_and_store<'a>(
    sought_responses: &[SoughtResponse<'a>],
    results: &mut [Result<Response, ResponseError>],
    searches: Vec<(usize, NewtonSearch<'a>)>,
    cancel: Cancel<'_>,
) -> bool {
    let (indices, mut searches): (Vec<usize>, Vec<NewtonSearch<'_>>) = searches.into_iter().unzip();
    if !run_searches(&mut searches, cancel) {
        return false;
    }
    for (index, search) in indices.into_iter().zip(searches) {
        results[index] = sought_responses[index].to_response(search);
    }
    true
}

/// Discards responses that another search at the same speed has found as well: those of the search
/// from the linear response that are on a curve, and those of the downward curve that are on the
/// upward one.
fn discard_known_responses(
    sought_responses: &[SoughtResponse<'_>],
    results: &mut [Result<Response, ResponseError>],
) {
    for index in 0..results.len() {
        let SoughtResponse { request_index, guess, .. } = &sought_responses[index];
        let Ok(Response { start_state, .. }) = &results[index] else { continue };
        let is_same_response = |other: &Response| {
            (0..COORDINATES)
                .all(|i| (other.start_state[i] - start_state[i]).abs() < SAME_RESPONSE_DISTANCE)
        };
        let first_index = sought_responses
            .partition_point(|sought_response| sought_response.request_index < *request_index);
        let last_index = if guess.is_on_either_curve() { index } else { results.len() };
        let same_request = (first_index..last_index).take_while(|other_index| {
            sought_responses[*other_index].request_index == *request_index
        });
        let mut other_indices = same_request.filter(|other_index| *other_index != index);
        let is_known = !guess.is_on_curve
            && other_indices
                .any(|other_index| results[other_index].as_ref().is_ok_and(is_same_response));
        if is_known {
            results[index] = Err(ResponseError::NoResponse);
        }
    }
}

/// Returns for each response whether a turn without caps fails to close. Only responses are tested
/// for which a harmonic of the drum's speed may be near the hinge's frequency.
fn find_changed_by_caps(
    sought_responses: &[SoughtResponse<'_>],
    results: &[Result<Response, ResponseError>],
    cancel: Cancel<'_>,
) -> Vec<bool> {
    let mut changed_by_caps = vec![false; sought_responses.len()];
    let mut indices = Vec::new();
    let mut requests = Vec::new();
    for (index, (sought_response, response)) in sought_responses.iter().zip(results).enumerate() {
        let hinge_frequency_rpm =
            sought_response.held_case.frozen_modes.modes[SUSPENSION_MODES].frequency_rpm();
        let may_excite_hinge = sought_response.held_case.setup.has_corners()
            || hinge_frequency_rpm < MAX_HINGE_HARMONIC * sought_response.held_case.setup.speed_rpm;
        if let (true, Ok(response), Some(_)) =
            (may_excite_hinge, response, sought_response.held_case.setup.caps)
            && let Ok(uncapped_case) = sought_response.held_case.without_caps()
        {
            indices.push(index);
            requests.push(TurnRequest {
                setup: uncapped_case.setup,
                start_state: response.start_state,
                is_recorded: false,
            });
        }
    }
    for ((index, request), result) in
        indices.into_iter().zip(&requests).zip(compute_turns(&requests, cancel))
    {
        let TurnSetup { point, speed_rpm, .. } = request.setup;
        let residual = relative_residual(point, speed_rpm, &request.start_state, &result.end_state);
        changed_by_caps[index] = residual.is_nan() || residual > CAP_RESIDUAL_TOLERANCE;
    }
    changed_by_caps
}

/// Returns the linear model's response as a guess, or the machine at rest if there is none.
fn guess_from_linear(point: &Point, linear_response: &LinearResponse) -> Guess {
    let rest_state = <NonlinearModel<f64> as LaneModel<f64>>::rest_state(point);
    let has_response = linear_response.state.iter().all(|x| x.is_finite());
    let deviation = |i: usize| if has_response { linear_response.state[i] } else { 0.0 };
    let state = core::array::from_fn(|i| rest_state[i] + deviation(i));
    Guess { branch: 0, fold_speeds_rpm: [None; 2], state, factors: None, is_on_curve: false }
}

/// A response for which a search runs, and its guess.
struct SoughtResponse<'a> {
    /// The index of the request.
    request_index: usize,
    held_case: HeldCase<'a>,
    guess: Guess,
    /// The largest deviations by the linear model.
    linear_peaks: [f64; crate::channel::CHANNELS],
}

impl SoughtResponse<'_> {
    /// Returns the response that a search has found, unless it is too far from the guess.
    fn to_response(&self, search: NewtonSearch<'_>) -> Result<Response, ResponseError> {
        let (start_state, record) = search.into_response().ok_or(ResponseError::NoResponse)?;
        let is_far_from_guess =
            |i: usize| (start_state[i] - self.guess.state[i]).abs() > MAX_GUESS_DISTANCE;
        if self.guess.is_on_either_curve() && (0..COORDINATES).any(is_far_from_guess) {
            return Err(ResponseError::NoResponse);
        }
        let setup = &self.held_case.setup;
        let unit_per_s = setup.unit_per_s();
        let matrix = scale_speeds(&record.monodromy, unit_per_s);
        let (multiplier, vector) =
            leading_multiplier(&self.held_case, &matrix).ok_or(ResponseError::NoEigenvalues)?;
        let mut response = Response {
            speed_rpm: setup.speed_rpm,
            is_on_curve: self.guess.is_on_curve,
            branch: self.guess.branch,
            fold_speeds_rpm: self.guess.fold_speeds_rpm,
            exceeded_limit: exceeded_limit(setup.point, &record),
            nonlinear_peaks: record.peaks,
            linear_peaks: self.linear_peaks,
            start_state,
            multiplier: [multiplier.re, multiplier.im].map(round_last_digits),
            participating_modes: Vec::new(),
        };
        if response.kind() != StabilityKind::Stable {
            let speed_rad_per_s = setup.speed_rpm * TAU / 60.0;
            let frozen_modes = modes(setup.point, 0.0, speed_rad_per_s)
                .map_err(|_| ResponseError::NoEigenvalues)?;
            response.participating_modes =
                participating_modes(setup.point, &frozen_modes, &vector, unit_per_s);
        }
        Ok(response)
    }
}

/// Returns the largest multiplier of a monodromy matrix that belongs to a motion of the suspension,
/// in the upper half plane, and its eigenvector; `None` if the eigenvalues are not finite. Speeds
/// in the matrix have the unit [`TurnSetup::unit_per_s`].
///
/// A motion of an uncapped hinge counts only if it grows. Such motions decay slowly, so that
/// otherwise stable responses would seem close to instability wherever the hinge has no cap.
pub(crate) fn leading_multiplier(
    held_case: &HeldCase<'_>,
    matrix: &Mat<f64>,
) -> Option<(c64, Mat<c64>)> {
    let unit_per_s = held_case.setup.unit_per_s();
    let mut multipliers = matrix.eigenvalues().ok()?;
    if multipliers.iter().any(|mu| !mu.re.is_finite() || !mu.im.is_finite()) {
        return None;
    }
    multipliers.retain(|mu| mu.im >= 0.0);
    multipliers
        .sort_by(|a, b| b.norm_sqr().total_cmp(&a.norm_sqr()).then_with(|| b.im.total_cmp(&a.im)));
    multipliers.into_iter().find_map(|mu| {
        let eigenvector = eigenvector(matrix, mu);
        let energy_shares = energy_shares(&held_case.frozen_modes, &eigenvector, unit_per_s);
        let mode_count =
            if mu.norm_sqr() > 1.0 { held_case.counted_mode_count } else { SUSPENSION_MODES };
        let counted_shares = energy_shares.iter().filter(|(mode, _)| *mode < mode_count);
        let counted_share: f64 = counted_shares.map(|(_, energy)| energy).sum();
        // The share is NaN if there is no eigenvector.
        (counted_share >= MIN_ENERGY_SHARE).then_some((mu, eigenvector))
    })
}

/// Returns the limit of the machine's geometry that a motion exceeds, if it does.
fn exceeded_limit(point: &Point, record: &OrbitRecord) -> Option<GeometryLimit> {
    let rest_vectors = attachment_vectors(point, point.equilibrium());
    let mut exceeds_limit = [false; 2];
    for state in &record.states {
        let current_vectors = attachment_vectors(point, &core::array::from_fn(|i| state[i]));
        for ((exceeds_limit, now), rest_vector) in
            exceeds_limit.iter_mut().zip(current_vectors).zip(&rest_vectors)
        {
            *exceeds_limit |= now.iter().zip(rest_vector).any(|(now, rest_vector)| {
                let projection: f64 = now.iter().zip(rest_vector).map(|(a, b)| a * b).sum();
                projection.is_nan() || projection <= 0.0
            });
        }
    }
    if exceeds_limit[0] {
        Some(GeometryLimit::SpringHooks)
    } else if exceeds_limit[1] {
        Some(GeometryLimit::DamperEnds)
    } else if record.min_gap_m.is_nan() || record.min_gap_m <= 0.0 {
        Some(GeometryLimit::Clearance)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::CHANNELS;
    use crate::stability::tests::{machine_with, prepare_at_speed};

    /// Replaces each of the three responses of the paper's machine with little damping at 255 rpm
    /// by a failed search, or by another response, and checks that it is found again.
    #[test]
    fn a_branch_that_was_lost_is_found_again() {
        let point = prepare_at_speed(machine_with(0.3, 30.0), 100.0);
        let mut curves =
            ResponseCurves::continue_curves(&[(&point, 255.0)], None, Cancel::Never).remove(0);
        let held_case = curves.upward_curve.settings.held_case(255.0).unwrap();
        let guesses = curves.guesses_at(255.0).into_iter();
        let sought_responses: Vec<SoughtResponse<'_>> = guesses
            .map(|guess| SoughtResponse {
                request_index: 0,
                held_case: held_case.clone(),
                guess,
                linear_peaks: [0.0; CHANNELS],
            })
            .collect();
        let searches = sought_responses.iter();
        let searches = searches.map(|sought_response| {
            NewtonSearch::new(sought_response.held_case.setup, sought_response.guess.state, None)
        });
        let mut solved_searches: Vec<NewtonSearch<'_>> = searches.collect();
        assert!(run_searches(&mut solved_searches, Cancel::Never));
        let results: Vec<Result<Response, ResponseError>> = sought_responses
            .iter()
            .zip(solved_searches)
            .map(|(sought_response, search)| sought_response.to_response(search))
            .collect();
        let branches = results.iter().map(|response| response.as_ref().unwrap().branch);
        assert_eq!(branches.collect::<Vec<_>>(), [0, 1, 2]);
        for index in 0..3 {
            for replacement in [Err(ResponseError::NoResponse), results[(index + 1) % 3].clone()] {
                let mut restored_results = results.clone();
                restored_results[index] = replacement;
                assert!(find_lost_branches(
                    &sought_responses,
                    &mut restored_results,
                    Cancel::Never
                ));
                let [found_again, original] = [&restored_results, &results]
                    .map(|responses| responses[index].as_ref().unwrap().start_state);
                let differences = (0..COORDINATES).map(|i| (found_again[i] - original[i]).abs());
                assert!(differences.fold(0.0, f64::max) < SAME_RESPONSE_DISTANCE, "{index}");
            }
        }
        // An even number of missing responses may have vanished at a fold, so that no search runs.
        let mut results_with_two_missing = vec![
            Err(ResponseError::NoResponse),
            results[1].clone(),
            Err(ResponseError::NoResponse),
        ];
        assert!(find_lost_branches(
            &sought_responses,
            &mut results_with_two_missing,
            Cancel::Never
        ));
        assert!(
            is_missing(&results_with_two_missing[0]) && is_missing(&results_with_two_missing[2])
        );
    }
}

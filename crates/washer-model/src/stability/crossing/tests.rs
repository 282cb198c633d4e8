//! Tests of crossings against nearby runs and against periodic responses.

use super::super::{HeldSpeed, find_responses};
use super::*;
use crate::machine::Machine;
use crate::machine::spin::{Profile, Spin};
use crate::point::{Timing, prepare};
use lane_ode::Cancel;

const STEP_S: f64 = 2e-4;

fn prepare_point(spin: Spin) -> Point {
    let timing = Timing { end_s: 4.0, window_s: [0.0, 4.0], checkpoints: 0 };
    prepare(&[(Machine::paper(), spin)], &timing).remove(0).unwrap()
}

/// Returns a crossing with a response at its start.
fn forward_crossing(interval_s: [f64; 2], response: Option<&Response>) -> Crossing<'_> {
    Crossing { interval_s, responses: [response, None], is_backward: false }
}

/// Returns a point whose speed rises until 2 s and is constant afterwards.
fn ramp_point() -> Point {
    prepare_point(Spin::Ramped { profile: Profile::Ramp, peak_rpm: 250.0, ramp_s: 2.0 })
}

#[test]
fn the_tangent_map_agrees_with_differences_of_nearby_runs() {
    let point = ramp_point();
    let rest_state = <NonlinearModel<f64> as LaneModel<f64>>::rest_state(&point);
    let entry_state = integrate_run(&point, STEP_S, [0.0, 1.8], &rest_state).end_state;
    // The interval contains the profile's kink.
    let crossing = forward_crossing([1.8, 2.2], None);
    let tangent_map = Simd::dispatch_narrow(TangentMap {
        point: &point,
        step_s: STEP_S,
        crossing: &crossing,
        entry_state: &entry_state,
    });
    let disturbed_end = |disturbance: f64, index: usize| {
        let mut start_state = entry_state;
        start_state[index] += disturbance;
        integrate_run(&point, STEP_S, crossing.interval_s, &start_state).end_state
    };
    for index in 0..STATES {
        let disturbance_size = if index < COORDINATES { 1e-7 } else { 1e-5 };
        let end_above = disturbed_end(disturbance_size, index);
        let end_below = disturbed_end(-disturbance_size, index);
        let max_slope =
            tangent_map[index].iter().fold(0.0_f64, |max_slope, slope| max_slope.max(slope.abs()));
        for i in 0..STATES {
            let slope = (end_above[i] - end_below[i]) / (2.0 * disturbance_size);
            let difference = (slope - tangent_map[index][i]).abs() / max_slope;
            assert!(difference < 1e-6, "{index} {i}: {slope} {}", tangent_map[index][i]);
        }
    }
}

#[test]
fn a_crossing_of_zero_length_does_not_amplify() {
    let point = ramp_point();
    let crossing = forward_crossing([1.0, 1.0 + 1e-9], None);
    let effect = follow_crossings(&point, STEP_S, &[crossing])[0].unwrap();
    assert!((effect.amplification - 1.0).abs() < 1e-4, "{effect:?}");
    assert_eq!(effect.departure_j, [None, None]);
}

#[test]
fn a_run_on_its_response_does_not_depart() {
    let point = prepare_point(Spin::Table { time_s: vec![0.0], speed_rpm: vec![225.0] });
    let response = find_responses(&[HeldSpeed { point: &point, speed_rpm: 225.0 }], Cancel::Never);
    let response = response.into_iter().next().unwrap().unwrap().remove(0);
    for time_s in [0.0_f64, 0.1, 0.2, 1.0] {
        let followed_state =
            integrate_run(&point, STEP_S, [0.0, time_s.max(1e-12)], &response.start_state)
                .end_state;
        let expected_state = response_state_at(&point, STEP_S, &response, false, time_s);
        let difference = core::array::from_fn(|i| followed_state[i] - expected_state[i]);
        let deviation = core::array::from_fn(|i| {
            expected_state[i] - if i < COORDINATES { point.equilibrium()[i] } else { 0.0 }
        });
        let energy_norm = EnergyNorm::new(&point, time_s);
        let energy_ratio = energy_norm.energy_j(&difference) / energy_norm.energy_j(&deviation);
        assert!(energy_ratio < 1e-6, "{time_s}: {energy_ratio}");
    }
}

#[test]
fn peaks_are_those_of_the_window_and_of_a_run_that_starts_on_its_response() {
    let point = ramp_point();
    let rest_state = <NonlinearModel<f64> as LaneModel<f64>>::rest_state(&point);
    let ramp_peaks = integrate_run(&point, STEP_S, [0.0, 3.0], &rest_state).peaks;
    let state_at_1_s = integrate_run(&point, STEP_S, [0.0, 1.0], &rest_state);
    let window_peaks = integrate_run(&point, STEP_S, [1.0, 3.0], &state_at_1_s.end_state).peaks;
    let all_peaks = peaks_without_departures(&point, STEP_S, &[], [0.0, 3.0]).unwrap();
    let window_only_peaks = peaks_without_departures(&point, STEP_S, &[], [1.0, 3.0]).unwrap();
    for i in 0..CHANNELS {
        assert!((all_peaks[i] / ramp_peaks[i] - 1.0).abs() < 1e-6);
        assert!((window_only_peaks[i] / window_peaks[i] - 1.0).abs() < 1e-6);
    }
    // After the ramp of two seconds the run differs much from the response.
    let response = find_responses(&[HeldSpeed { point: &point, speed_rpm: 225.0 }], Cancel::Never);
    let response = response.into_iter().next().unwrap().unwrap().remove(0);
    let crossing = forward_crossing([1.8, 2.2], Some(&response));
    let peaks_on_response =
        peaks_without_departures(&point, STEP_S, &[crossing], [1.9, 3.0]).unwrap();
    assert!(
        peaks_on_response
            .iter()
            .zip(&ramp_peaks)
            .all(|(peaks_on_response, ramp_peaks)| peaks_on_response < ramp_peaks),
        "{peaks_on_response:?} {ramp_peaks:?}"
    );
}

#[test]
fn a_run_that_leaves_its_range_reports_the_time() {
    let point = ramp_point();
    // The suspension cannot stop a motion of this speed within the model's range.
    let mut start_state = <NonlinearModel<f64> as LaneModel<f64>>::rest_state(&point);
    start_state[COORDINATES] = 1e4;
    let failure = integrate_run(&point, STEP_S, [0.0, 1.0], &start_state).failure.unwrap();
    assert!(failure.time_s > 0.0 && failure.time_s < 1.0, "{failure}");
}

/// The response of an asymmetric machine whose drum turns backwards is the mirror image of the
/// response of the mirrored machine.
#[test]
fn a_backward_response_is_that_of_the_mirrored_machine() {
    let mut machine = Machine::paper();
    machine.springs[0].stiffness_n_per_m *= 1.3;
    machine.dampers[1].damping_n_s_per_m *= 0.6;
    let held_point = |machine: &Machine, speed_rpm: f64| {
        let spin = Spin::Table { time_s: vec![0.0], speed_rpm: vec![speed_rpm] };
        let timing = Timing { end_s: 4.0, window_s: [0.0, 4.0], checkpoints: 0 };
        prepare(&[(machine.clone(), spin)], &timing).remove(0).unwrap()
    };
    let point = held_point(&machine, -225.0);
    let mirrored_point = held_point(&machine.mirrored(), 225.0);
    let response =
        find_responses(&[HeldSpeed { point: &mirrored_point, speed_rpm: 225.0 }], Cancel::Never);
    let response = response.into_iter().next().unwrap().unwrap().remove(0);
    for time_s in [1e-12, 0.1, 0.2, 1.0] {
        let start_state = mirror_state(&response.start_state);
        let followed_state = integrate_run(&point, STEP_S, [0.0, time_s], &start_state).end_state;
        let expected_state = response_state_at(&point, STEP_S, &response, true, time_s);
        let deviation = core::array::from_fn(|i| {
            expected_state[i] - if i < COORDINATES { point.equilibrium()[i] } else { 0.0 }
        });
        let energy_norm = EnergyNorm::new(&point, time_s);
        let energy_ratio = |state: &[f64; STATES]| {
            let difference = core::array::from_fn(|i| followed_state[i] - state[i]);
            energy_norm.energy_j(&difference) / energy_norm.energy_j(&deviation)
        };
        assert!(
            energy_ratio(&expected_state) < 1e-6,
            "{time_s}: {}",
            energy_ratio(&expected_state)
        );
        // The mirror image of the expected state is not a response.
        assert!(
            energy_ratio(&mirror_state(&expected_state)) > 1e-2,
            "{time_s}: {}",
            energy_ratio(&mirror_state(&expected_state))
        );
    }
}

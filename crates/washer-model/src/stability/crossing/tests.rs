use super::super::{Dwell, respond};
use super::*;
use crate::machine::Machine;
use crate::machine::spin::{Profile, Spin};
use crate::point::{Timing, prepare};
use lane_ode::Cancel;

const STEP_S: f64 = 2e-4;

fn point(spin: Spin) -> Point {
    let timing = Timing { end_s: 4.0, window_s: [0.0, 4.0], checkpoints: 0 };
    prepare(&[(Machine::paper(), spin)], &timing).remove(0).unwrap()
}

/// A crossing with a response at its begin.
fn forwards(from_to_s: [f64; 2], response: Option<&Response>) -> Crossing<'_> {
    Crossing { from_to_s, responses: [response, None], is_backward: false }
}

/// A run that gains speed until 2 s, and is held from there.
fn ramp() -> Point {
    point(Spin::Ramped { profile: Profile::Ramp, peak_rpm: 250.0, ramp_s: 2.0 })
}

#[test]
fn the_tangent_map_is_what_nearby_runs_do() {
    let point = ramp();
    let at_rest = <Nonlinear<f64> as LaneModel<f64>>::at_rest(&point);
    let entry = run(&point, STEP_S, [0.0, 1.8], &at_rest).end;
    // Over the profile's kink.
    let crossing = forwards([1.8, 2.2], None);
    let map = Simd::dispatch_narrow(Tangent {
        point: &point,
        step_s: STEP_S,
        crossing: &crossing,
        entry: &entry,
    });
    let end = |disturbance: f64, place: usize| {
        let mut start = entry;
        start[place] += disturbance;
        run(&point, STEP_S, crossing.from_to_s, &start).end
    };
    for place in 0..STATES {
        let size = if place < COORDINATES { 1e-7 } else { 1e-5 };
        let above = end(size, place);
        let below = end(-size, place);
        let largest = map[place].iter().fold(0.0_f64, |most, slope| most.max(slope.abs()));
        for i in 0..STATES {
            let slope = (above[i] - below[i]) / (2.0 * size);
            let apart = (slope - map[place][i]).abs() / largest;
            assert!(apart < 1e-6, "{place} {i}: {slope} {}", map[place][i]);
        }
    }
}

#[test]
fn a_crossing_of_no_length_amplifies_nothing() {
    let point = ramp();
    let crossing = forwards([1.0, 1.0 + 1e-9], None);
    let crossed = cross(&point, STEP_S, &[crossing])[0].unwrap();
    assert!((crossed.amplification - 1.0).abs() < 1e-4, "{crossed:?}");
    assert_eq!(crossed.departure_j, [None, None]);
}

#[test]
fn a_run_on_its_response_departs_by_nothing() {
    let point = point(Spin::Table { time_s: vec![0.0], speed_rpm: vec![225.0] });
    let response = respond(&[Dwell { point: &point, speed_rpm: 225.0 }], Cancel::Never);
    let response = response.into_iter().next().unwrap().unwrap().remove(0);
    for at_s in [0.0_f64, 0.1, 0.2, 1.0] {
        let followed = run(&point, STEP_S, [0.0, at_s.max(1e-12)], &response.start).end;
        let expected = response_at(&point, STEP_S, &response, false, at_s);
        let apart = core::array::from_fn(|i| followed[i] - expected[i]);
        let whole = core::array::from_fn(|i| {
            expected[i] - if i < COORDINATES { point.equilibrium()[i] } else { 0.0 }
        });
        let energy = Energy::new(&point, at_s);
        let share = energy.of(&apart) / energy.of(&whole);
        assert!(share < 1e-6, "{at_s}: {share}");
    }
}

#[test]
fn peaks_are_of_the_window_and_of_the_run_that_was_put_on_its_response() {
    let point = ramp();
    let at_rest = <Nonlinear<f64> as LaneModel<f64>>::at_rest(&point);
    let plain = run(&point, STEP_S, [0.0, 3.0], &at_rest).peaks;
    let late = run(&point, STEP_S, [0.0, 1.0], &at_rest);
    let late = run(&point, STEP_S, [1.0, 3.0], &late.end).peaks;
    let whole = peaks_without_departures(&point, STEP_S, &[], [0.0, 3.0]).unwrap();
    let part = peaks_without_departures(&point, STEP_S, &[], [1.0, 3.0]).unwrap();
    for i in 0..CHANNELS {
        assert!((whole[i] / plain[i] - 1.0).abs() < 1e-6);
        assert!((part[i] / late[i] - 1.0).abs() < 1e-6);
    }
    // The ramp of two seconds leaves much that the response has not.
    let response = respond(&[Dwell { point: &point, speed_rpm: 225.0 }], Cancel::Never);
    let response = response.into_iter().next().unwrap().unwrap().remove(0);
    let crossing = forwards([1.8, 2.2], Some(&response));
    let quiet = peaks_without_departures(&point, STEP_S, &[crossing], [1.9, 3.0]).unwrap();
    assert!(quiet.iter().zip(&plain).all(|(quiet, plain)| quiet < plain), "{quiet:?} {plain:?}");
}

#[test]
fn a_run_that_leaves_its_range_says_when() {
    let point = ramp();
    // A speed that no suspension holds.
    let mut start = <Nonlinear<f64> as LaneModel<f64>>::at_rest(&point);
    start[COORDINATES] = 1e4;
    let failure = run(&point, STEP_S, [0.0, 1.0], &start).failure.unwrap();
    assert!(failure.time_s > 0.0 && failure.time_s < 1.0, "{failure}");
}

/// A machine that is not its own mirror image, whose drum turns backwards, is in the mirror image
/// of the mirrored machine's response.
#[test]
fn backwards_the_response_is_the_mirrored_machines() {
    let mut machine = Machine::paper();
    machine.springs[0].stiffness_n_per_m *= 1.3;
    machine.dampers[1].damping_n_s_per_m *= 0.6;
    let held = |machine: &Machine, speed_rpm: f64| {
        let spin = Spin::Table { time_s: vec![0.0], speed_rpm: vec![speed_rpm] };
        let timing = Timing { end_s: 4.0, window_s: [0.0, 4.0], checkpoints: 0 };
        prepare(&[(machine.clone(), spin)], &timing).remove(0).unwrap()
    };
    let point = held(&machine, -225.0);
    let image = held(&machine.mirrored(), 225.0);
    let response = respond(&[Dwell { point: &image, speed_rpm: 225.0 }], Cancel::Never);
    let response = response.into_iter().next().unwrap().unwrap().remove(0);
    for at_s in [1e-12, 0.1, 0.2, 1.0] {
        let start = mirrored(&response.start);
        let followed = run(&point, STEP_S, [0.0, at_s], &start).end;
        let expected = response_at(&point, STEP_S, &response, true, at_s);
        let whole = core::array::from_fn(|i| {
            expected[i] - if i < COORDINATES { point.equilibrium()[i] } else { 0.0 }
        });
        let energy = Energy::new(&point, at_s);
        let share = |of: &[f64; STATES]| {
            let apart = core::array::from_fn(|i| followed[i] - of[i]);
            energy.of(&apart) / energy.of(&whole)
        };
        assert!(share(&expected) < 1e-6, "{at_s}: {}", share(&expected));
        // Nothing else is it: not the response as it is.
        assert!(share(&mirrored(&expected)) > 1e-2, "{at_s}: {}", share(&mirrored(&expected)));
    }
}

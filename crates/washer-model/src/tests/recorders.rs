//! Tests of the optional recorders against densely sampled time histories.

use super::instruments::{ALL_RECORDERS, paper_machine};
use crate::machine::spin::turn_division_times_s;
use crate::{
    Caps, Channel, Gauge, InitialDeviation, Machine, Method, MethodKind, ModelKind, Point, Profile,
    Recorders, Spin, Timing, integrate_history, prepare, simulate, simulate_with,
};
use lane_ode::{Simd, Tolerance};

const TIMING: Timing = Timing { end_s: 4.0, window_s: [1.3, 3.9], checkpoints: 0 };
const INTERVAL_S: f64 = 2.5e-4;

/// Returns a point that passes the resonances in four seconds, with a clearance so small that drum
/// and tub overlap at times.
fn prepare_resonant_point() -> Point {
    let machine = Machine { radial_clearance_m: 0.4e-3, ..paper_machine(0.8, 120.0) };
    let spin =
        Spin::Table { time_s: vec![0.0, 1.0, 3.0, 4.0], speed_rpm: vec![0.0, 100.0, 420.0, 300.0] };
    prepare(Simd::widest(), &[(machine, spin)], &TIMING).remove(0).unwrap()
}

/// The readings that are computed from a history.
struct SampledReadings {
    root_mean_squares: [f64; 8],
    turns: Vec<[f64; 8]>,
    cabinet_force_n: f64,
    clash_time_s: f64,
}

fn sample_readings(point: &Point, model: ModelKind, method: &Method) -> SampledReadings {
    let history = integrate_history(model, method, point, &InitialDeviation::default(), INTERVAL_S);
    let turn_boundaries_s = turn_division_times_s(&point.spin_segments, TIMING.window_s);
    let [first, last] = TIMING.window_s.map(|edge_s| (edge_s / INTERVAL_S).round() as usize);
    let mut readings = SampledReadings {
        root_mean_squares: [0.0; 8],
        turns: vec![[0.0; 8]; turn_boundaries_s.len() + 1],
        cabinet_force_n: 0.0,
        clash_time_s: 0.0,
    };
    for k in first..=last {
        // The weight of the trapezoidal rule.
        let weight = if k == first || k == last { 0.5 * INTERVAL_S } else { INTERVAL_S };
        let instant = history.instant_outputs(k).unwrap();
        let turn =
            turn_boundaries_s.partition_point(|boundary_s| *boundary_s < k as f64 * INTERVAL_S);
        for (i, y) in instant.channels.into_iter().enumerate() {
            readings.root_mean_squares[i] += weight * y * y;
            readings.turns[turn][i] = readings.turns[turn][i].max(y.abs());
        }
        let force_n =
            history.forces(k).unwrap().cabinet_force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
        readings.cabinet_force_n = readings.cabinet_force_n.max(force_n);
        readings.clash_time_s += if instant.gap_m < 0.0 { weight } else { 0.0 };
    }
    let length_s = TIMING.window_s[1] - TIMING.window_s[0];
    readings.root_mean_squares =
        readings.root_mean_squares.map(|integral| (integral / length_s).sqrt());
    readings
}

fn assert_close(quantity: &str, value: f64, expected: f64, tolerance: f64) {
    let error = (value - expected).abs() / expected.abs();
    assert!(error <= tolerance, "{quantity}: {value} instead of {expected}, error {error:e}");
}

#[test]
fn readings_agree_with_densely_sampled_histories() {
    let point = prepare_resonant_point();
    let method = Method::rk4(2e-4);
    for model in [ModelKind::Nonlinear, ModelKind::Linear] {
        let (records, readings) =
            simulate_with(Simd::widest(), model, &method, &[&point], ALL_RECORDERS);
        assert_eq!(
            records,
            simulate(Simd::widest(), model, &method, &[&point]),
            "recorders do not change peaks"
        );
        let reading = &readings[0];
        let expected = sample_readings(&point, model, &method);
        let root_mean_squares = reading.root_mean_squares.unwrap();
        assert!(reading.turns.len() > 10);
        assert_eq!(reading.turns.len(), expected.turns.len());
        for channel in Channel::ALL {
            let i = channel.index();
            let name = channel.name();
            assert_close(name, root_mean_squares[i], expected.root_mean_squares[i], 1e-5);
            let mut exact_turns = 0;
            for (turn_peaks, expected) in reading.turns.iter().zip(&expected.turns) {
                // A sample near a maximum has almost the value of the maximum. The error is greater
                // for a turn whose largest deviation is at its end, where the slope is not zero.
                assert_close(name, turn_peaks[i], expected[i], 2e-2);
                exact_turns +=
                    usize::from((turn_peaks[i] - expected[i]).abs() < 1e-4 * turn_peaks[i]);
            }
            assert!(
                2 * exact_turns > reading.turns.len(),
                "{name}: {exact_turns} of {} turns",
                reading.turns.len()
            );
            let amplitude = reading.turns.iter().map(|turn| turn[i]).fold(0.0, f64::max);
            assert_close(name, amplitude, records[0].amplitudes[i], 1e-9);
        }
        assert_close(
            "force",
            reading.gauge_values(Gauge::CabinetForce)[0],
            expected.cabinet_force_n,
            1e-4,
        );
        let clash_s = reading.gauge_values(Gauge::ClashTime)[0];
        assert!(clash_s > 0.05 && clash_s < 2.5, "{clash_s} s, least gap {}", records[0].min_gap_m);
        // The error of each overlap is at most one interval.
        let clash_error_s = (clash_s - expected.clash_time_s).abs();
        assert!(
            clash_error_s < 20.0 * INTERVAL_S,
            "{clash_s} instead of {}",
            expected.clash_time_s
        );
    }
}

#[test]
fn readings_do_not_depend_on_the_method() {
    let point = prepare_resonant_point();
    let tolerance =
        Tolerance { relative: 1e-7, absolute: 1e-10, max_steps: 1_000_000, longest_step_s: None };
    for model in [ModelKind::Nonlinear, ModelKind::Linear] {
        let simulate_readings = |method| {
            simulate_with(Simd::widest(), model, &method, &[&point], ALL_RECORDERS).1.remove(0)
        };
        let reference_reading = simulate_readings(Method::rk4(2e-4));
        for reading in [
            simulate_readings(Method::dopri5(tolerance)),
            simulate_readings(Method::additive(tolerance)),
        ] {
            let root_mean_squares =
                [&reading, &reference_reading].map(|reading| reading.root_mean_squares.unwrap());
            root_mean_squares[0]
                .iter()
                .zip(root_mean_squares[1])
                .for_each(|(value, expected)| assert_close("rms", *value, expected, 1e-4));
            assert_eq!(reading.turns.len(), reference_reading.turns.len());
            for (value, expected) in
                reading.turns.iter().flatten().zip(reference_reading.turns.iter().flatten())
            {
                assert_close("turn", *value, *expected, 1e-3);
            }
            assert_close(
                "force",
                reading.gauge_values(Gauge::CabinetForce)[0],
                reference_reading.gauge_values(Gauge::CabinetForce)[0],
                1e-4,
            );
            assert_close(
                "clash",
                reading.gauge_values(Gauge::ClashTime)[0],
                reference_reading.gauge_values(Gauge::ClashTime)[0],
                1e-3,
            );
        }
    }
}

#[test]
fn recorders_that_are_not_in_use_leave_no_readings() {
    let point = prepare_resonant_point();
    let caps = Caps { bearings_rad_per_s: 1500.0, hinge_rad_per_s: None };
    let method = Method::capped(MethodKind::Capped0, 1e-3, caps);
    let simulate_readings = |recorders| {
        simulate_with(Simd::widest(), ModelKind::Linear, &method, &[&point, &point], recorders)
    };
    assert!(simulate_readings(Recorders::default()).1.is_empty());
    let (_, readings) = simulate_readings(Recorders::with_gauge(Gauge::ClashTime));
    assert_eq!(readings.len(), 2);
    for reading in readings {
        assert!(reading.root_mean_squares.is_none() && reading.turns.is_empty());
        let lengths = reading.gauges.each_ref().map(Vec::len);
        assert_eq!(lengths, Gauge::ALL.map(|gauge| usize::from(gauge == Gauge::ClashTime)));
    }
}

#[test]
fn at_rest_the_cabinet_carries_the_weight() {
    let mut machine = Machine::paper();
    machine.unbalance.mass_kg = 0.0;
    let weight_n = machine.gravity_m_per_s2
        * (machine.tub.mass_kg + machine.shaft.mass_kg + machine.drum.mass_kg);
    let timing = Timing { end_s: 0.02, window_s: [0.0, 0.02], checkpoints: 0 };
    let zero_spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 0.0, ramp_s: 1.0 };
    let point = prepare(Simd::widest(), &[(machine, zero_spin)], &timing).remove(0).unwrap();
    for model in [ModelKind::Nonlinear, ModelKind::Linear] {
        let (_, readings) =
            simulate_with(Simd::widest(), model, &Method::rk4(2e-4), &[&point], ALL_RECORDERS);
        // The springs also have a small force along c1, which the model's constraint balances.
        assert_close("force", readings[0].gauge_values(Gauge::CabinetForce)[0], weight_n, 1e-4);
        assert_eq!(readings[0].gauge_values(Gauge::ClashTime), [0.0]);
        assert_eq!(readings[0].turns.len(), 1);
    }
}

#[test]
fn the_sag_of_the_papers_machine_agrees_with_the_model_page() {
    let spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 0.0, ramp_s: 1.0 };
    let machine = Machine::paper();
    let centre_m = machine.tub.centre_x_m;
    let point = prepare(Simd::widest(), &[(machine, spin)], &TIMING).remove(0).unwrap();
    // At equilibrium q1 = -14.0969 mm and q6 = 3.3526 mrad.
    let expected = 14.0969e-3 - centre_m * 3.3526e-3_f64.sin();
    assert!((point.static_sag_m() - expected).abs() < 1e-7, "{}", point.static_sag_m());
}

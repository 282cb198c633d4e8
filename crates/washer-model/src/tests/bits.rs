//! Tests that the bits of a result depend neither on the instruction set, nor on the position in a
//! batch, nor on the other points of the batch.

use super::instruments::{ALL_RECORDERS, paper_machine, random_machine, random_spin};
use crate::{
    Caps, Machine, Method, MethodKind, ModelKind, Point, Profile, Reading, Record, Recorders, Spin,
    Timing, prepare, simulate_until, simulate_with,
};
use core::sync::atomic::{AtomicU32, Ordering};
use lane_ode::{CANCEL_POLL_STEPS, Cancel, Simd, Tolerance};

type BitsScenario = (Machine, Spin);

const END_S: f64 = 1.0;
const TIMING: Timing = Timing { end_s: END_S, window_s: [0.4, 0.9], checkpoints: 8 };
const MODELS: [ModelKind; 2] = [ModelKind::Nonlinear, ModelKind::Linear];
const CAPS: Caps = Caps { bearings_rad_per_s: 1500.0, hinge_rad_per_s: Some(1200.0) };
const METHODS: [Method; 5] = [
    Method::rk4(1e-4),
    Method::capped(MethodKind::Capped0, 1e-3, CAPS),
    Method::dop853(4e-4),
    Method::dopri5(Tolerance {
        relative: 1e-5,
        absolute: 1e-8,
        max_steps: 1_000_000,
        longest_step_s: None,
    }),
    Method::additive(Tolerance {
        relative: 1e-5,
        absolute: 1e-8,
        max_steps: 1_000_000,
        longest_step_s: None,
    }),
];

/// Returns eleven scenarios, so that some of four or eight lanes stay idle: the corners, the
/// middles of the edges and the centre of the quick map, and two more points, with a spin of one
/// second.
fn quick_map_scenarios() -> Vec<BitsScenario> {
    let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 0.6 };
    let grid_points =
        [0.05, 0.525, 1.0].into_iter().flat_map(|m| [60.0, 180.0, 300.0].map(|c| (m, c)));
    grid_points
        .chain([(0.4, 90.0), (0.7, 120.0)])
        .map(|(m, c)| (paper_machine(m, c), spin.clone()))
        .collect()
}

/// Returns random machines with spins of all kinds.
fn random_scenarios() -> Vec<BitsScenario> {
    let mut rng = fastrand::Rng::with_seed(31);
    (0..11).map(|i| (random_machine(&mut rng), random_spin(&mut rng, i, END_S))).collect()
}

fn prepare_points(simd: Simd, scenarios: &[BitsScenario]) -> Vec<Point> {
    prepare(simd, scenarios, &TIMING).into_iter().map(Result::unwrap).collect()
}

/// Returns the bits of all recorded numbers.
fn record_bits((record, reading): (&Record, &Reading)) -> Vec<u64> {
    let Record { failure, amplitudes, min_gap_m, accepted_steps, rejected_steps } = record;
    let mut bits: Vec<_> = amplitudes.iter().map(|a| a.to_bits()).collect();
    bits.extend([min_gap_m.to_bits(), *accepted_steps, *rejected_steps]);
    bits.extend(failure.iter().flat_map(|(reason, time_s)| [*reason as u64, time_s.to_bits()]));
    let Reading {
        root_mean_squares,
        turns,
        gauges,
        checkpoints,
        // Snapshots are compared by the tests of `run/snapshots.rs`.
        snapshots: _,
    } = reading;
    bits.extend(turns.iter().chain(root_mean_squares).flatten().map(|a| a.to_bits()));
    let coordinates = checkpoints.iter().flat_map(|checkpoint| checkpoint.coordinates.iter());
    bits.extend(coordinates.map(|coordinate| coordinate.to_bits()));
    bits.extend(gauges.iter().flatten().map(|number| number.to_bits()));
    bits
}

/// Returns the bits of every scenario for each model and method, simulated as one batch.
fn simulate_batch(simd: Simd, scenarios: &[BitsScenario]) -> Vec<Vec<Vec<u64>>> {
    let points = prepare_points(simd, scenarios);
    let points: Vec<_> = points.iter().collect();
    let mut results = Vec::new();
    for model in MODELS {
        for method in &METHODS {
            let (records, readings) = simulate_with(simd, model, method, &points, ALL_RECORDERS);
            assert_eq!((records.len(), readings.len()), (scenarios.len(), scenarios.len()));
            results.push(records.iter().zip(&readings).map(record_bits).collect());
        }
    }
    results
}

/// Selects scenarios by their indices for every model and method.
fn select_scenarios(results: &[Vec<Vec<u64>>], indices: &[usize]) -> Vec<Vec<Vec<u64>>> {
    results.iter().map(|records| indices.iter().map(|&i| records[i].clone()).collect()).collect()
}

fn assert_same_on_every_instruction_set(scenarios: &[BitsScenario]) {
    let scalar_results = simulate_batch(Simd::Scalar, scenarios);
    for simd in Simd::ALL.into_iter().filter(|simd| simd.is_available()) {
        assert!(
            simulate_batch(simd, scenarios) == scalar_results,
            "{} gives other bits than scalar",
            simd.name()
        );
    }
}

fn assert_same_at_any_position(scenarios: &[BitsScenario]) {
    let count = scenarios.len();
    let ordered_results = simulate_batch(Simd::widest(), scenarios);
    for shift in [1, 2, 3, 5, 7] {
        let scenario_order: Vec<_> = (0..count).map(|i| (i + shift) % count).collect();
        let reordered_scenarios: Vec<_> =
            scenario_order.iter().map(|&i| scenarios[i].clone()).collect();
        assert!(
            simulate_batch(Simd::widest(), &reordered_scenarios)
                == select_scenarios(&ordered_results, &scenario_order),
            "moved by {shift}"
        );
    }
    let scenario_order: Vec<_> = (0..count).rev().collect();
    let reordered_scenarios: Vec<_> =
        scenario_order.iter().map(|&i| scenarios[i].clone()).collect();
    assert!(
        simulate_batch(Simd::widest(), &reordered_scenarios)
            == select_scenarios(&ordered_results, &scenario_order),
        "backwards"
    );
}

fn assert_same_with_any_other_points(scenarios: &[BitsScenario]) {
    let batch_results = simulate_batch(Simd::widest(), scenarios);
    for (i, scenario) in scenarios.iter().enumerate() {
        let single_results = simulate_batch(Simd::widest(), core::slice::from_ref(scenario));
        assert!(single_results == select_scenarios(&batch_results, &[i]), "scenario {i} alone");
    }
    // Two consecutive points fail, one early and one late, and other points start in their lanes.
    let failing_scenario = |ramp_s: f64| {
        (paper_machine(30.0, 0.0), Spin::Ramped { profile: Profile::Ramp, peak_rpm: 9e4, ramp_s })
    };
    let mut mixed_scenarios = scenarios.to_vec();
    mixed_scenarios.insert(1, failing_scenario(0.02));
    mixed_scenarios.insert(5, failing_scenario(0.3));
    let other_points: Vec<_> = (0..mixed_scenarios.len()).filter(|i| ![1, 5].contains(i)).collect();
    let results_beside_failing = simulate_batch(Simd::widest(), &mixed_scenarios);
    let nonlinear_results = &results_beside_failing[0];
    assert!(
        [1, 5].iter().all(|&i| nonlinear_results[i].len() < nonlinear_results[0].len()),
        "the added points fail"
    );
    assert!(
        select_scenarios(&results_beside_failing, &other_points) == batch_results,
        "beside failing neighbours"
    );
}

#[test]
fn same_bits_on_every_instruction_set_quick_map() {
    assert_same_on_every_instruction_set(&quick_map_scenarios());
}

#[test]
fn same_bits_on_every_instruction_set_random_machines() {
    assert_same_on_every_instruction_set(&random_scenarios());
}

#[test]
fn same_bits_at_any_position_in_a_batch_quick_map() {
    assert_same_at_any_position(&quick_map_scenarios());
}

#[test]
fn same_bits_at_any_position_in_a_batch_random_machines() {
    assert_same_at_any_position(&random_scenarios());
}

#[test]
fn same_bits_with_any_other_points_quick_map() {
    assert_same_with_any_other_points(&quick_map_scenarios());
}

#[test]
fn same_bits_with_any_other_points_random_machines() {
    assert_same_with_any_other_points(&random_scenarios());
}

/// Integrates a segment with more steps than the integrator makes between two polls of its
/// cancellation, while segments in other lanes end earlier.
#[test]
fn blocks_of_steps_do_not_change_bits() {
    let timing = Timing { end_s: 1.0, window_s: [0.9, 1.0], checkpoints: 0 };
    let spins = [2.0, 0.37, 0.11].map(|ramp_s| Spin::Ramped {
        profile: Profile::Triangular,
        peak_rpm: 350.0,
        ramp_s,
    });
    let scenarios: Vec<_> =
        spins.into_iter().map(|spin| (paper_machine(0.4, 90.0), spin)).collect();
    let simd = Simd::widest();
    let points: Vec<_> =
        prepare(simd, &scenarios, &timing).into_iter().map(Result::unwrap).collect();
    let all_points: Vec<_> = points.iter().collect();
    let dop853_method = Method::capped(MethodKind::Capped0, 2e-5, CAPS);
    for method in [Method::rk4(2e-5), dop853_method] {
        for model in MODELS {
            let batch_results = simulate_with(simd, model, &method, &all_points, ALL_RECORDERS);
            assert!(
                batch_results.0[0].accepted_steps > 3 * CANCEL_POLL_STEPS,
                "{} steps",
                batch_results.0[0].accepted_steps
            );
            for (k, point) in all_points.iter().enumerate() {
                let single_results = simulate_with(simd, model, &method, &[point], ALL_RECORDERS);
                let expected_bits = record_bits((&batch_results.0[k], &batch_results.1[k]));
                assert_eq!(
                    record_bits((&single_results.0[0], &single_results.1[0])),
                    expected_bits,
                    "{model:?} by {method:?}, {k}"
                );
            }
        }
    }
}

#[test]
fn every_method_stops_within_a_segment() {
    let timing = Timing { end_s: 1.0, window_s: [0.0, 1.0], checkpoints: 0 };
    let scenario = (
        paper_machine(0.4, 90.0),
        Spin::Ramped { profile: Profile::Ramp, peak_rpm: 350.0, ramp_s: 1.0 },
    );
    let point = prepare(Simd::widest(), &[scenario], &timing).remove(0).unwrap();
    let tolerance =
        Tolerance { relative: 1e-9, absolute: 1e-12, max_steps: 1_000_000, longest_step_s: None };
    let dop853_method = Method::capped(MethodKind::Capped0, 2e-5, CAPS);
    let adaptive_methods = [Method::dopri5(tolerance), Method::additive(tolerance)];
    for method in [Method::rk4(2e-5), dop853_method].into_iter().chain(adaptive_methods) {
        for model in MODELS {
            let call_count = AtomicU32::new(0);
            let run_until = |max_calls: u32| {
                call_count.store(0, Ordering::Relaxed);
                let must_stop = || call_count.fetch_add(1, Ordering::Relaxed) >= max_calls;
                simulate_until(
                    Simd::widest(),
                    model,
                    &method,
                    &[&point],
                    Recorders::default(),
                    Cancel::When(&must_stop),
                )
            };
            assert!(run_until(u32::MAX).is_some_and(|(records, _)| records[0].failure.is_none()));
            assert!(
                call_count.load(Ordering::Relaxed) > 3,
                "{model:?} by {method:?}: {} calls",
                call_count.load(Ordering::Relaxed)
            );
            assert_eq!(run_until(2), None, "{model:?} by {method:?}");
            assert_eq!(call_count.load(Ordering::Relaxed), 3, "{model:?} by {method:?}");
        }
    }
}

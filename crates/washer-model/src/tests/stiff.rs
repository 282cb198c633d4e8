//! Tests of the additive method, which treats bearings implicitly, with stiff bearings.

use crate::{
    Channel, Machine, Method, ModelKind, Point, Record, Spin, Timing,
    highest_explicit_frequency_rad_per_s, highest_frequency_rad_per_s, prepare, simulate,
};
use lane_ode::{Simd, Tolerance};

const TIMING: Timing = Timing { end_s: 3.0, window_s: [0.7, 2.9], checkpoints: 0 };

/// Returns a run-up past the resonances, with kinks inside and outside of the window.
fn prepare_point(bearing_stiffness_n_per_m: f64) -> Point {
    let mut machine = Machine::paper();
    machine.bearings.front_stiffness_n_per_m = bearing_stiffness_n_per_m;
    machine.bearings.rear_stiffness_n_per_m = bearing_stiffness_n_per_m;
    let spin =
        Spin::Table { time_s: vec![0.0, 0.5, 1.5, 2.5], speed_rpm: vec![0.0, 100.0, 400.0, 300.0] };
    prepare(Simd::widest(), &[(machine, spin)], &TIMING).remove(0).unwrap()
}

fn new_tolerance(relative: f64) -> Tolerance {
    Tolerance { relative, absolute: 1e-3 * relative, max_steps: 1_000_000, longest_step_s: None }
}

fn simulate_point(model: ModelKind, method: &Method, point: &Point) -> Record {
    simulate(Simd::widest(), model, method, &[point]).remove(0)
}

/// Returns the greatest relative difference of two records' amplitudes and least gaps.
fn record_difference(a: &Record, b: &Record) -> f64 {
    assert_eq!((a.failure, b.failure), (None, None));
    let gap_difference = (a.min_gap_m - b.min_gap_m).abs() / b.min_gap_m;
    Channel::ALL.iter().map(|channel| channel.index()).fold(gap_difference, |max_difference, i| {
        max_difference.max((a.amplitudes[i] - b.amplitudes[i]).abs() / b.amplitudes[i])
    })
}

#[test]
fn the_additive_method_agrees_with_converged_rk4() {
    let point = prepare_point(2e8);
    for model in ModelKind::ALL {
        let reference_record = simulate_point(model, &Method::rk4(5e-5), &point);
        for (relative, max_error) in [(1e-5, 1e-4), (1e-7, 1e-6)] {
            let record = simulate_point(model, &Method::additive(new_tolerance(relative)), &point);
            let error = record_difference(&record, &reference_record);
            eprintln!("{model:?} at {relative:e}: {error:.1e} in {} steps", record.accepted_steps);
            assert!(error < max_error, "{model:?} at {relative:e}: {error:e}");
        }
    }
}

#[test]
fn the_additive_method_integrates_bearings_too_stiff_for_explicit_methods() {
    let points = [2e9, 1e11, 1e14].map(prepare_point);
    for model in ModelKind::ALL {
        // The bearings of the reference deflect by a tenth of a micrometre only, so that the almost
        // rigid bearings of the other points give a similar motion.
        let reference_record = simulate_point(model, &Method::rk4(5e-5), &points[0]);
        for stiff_point in &points[1..] {
            assert!(simulate_point(model, &Method::rk4(5e-5), stiff_point).failure.is_some());
            let record = simulate_point(model, &Method::additive(new_tolerance(1e-4)), stiff_point);
            let error = record_difference(&record, &reference_record);
            let attempted_steps = record.accepted_steps + record.rejected_steps;
            eprintln!("{model:?}: {error:.1e} in {attempted_steps} steps");
            assert!(error < 5e-4, "{model:?}: {error:e}");
            // An explicit method of order 5 needs 3e5 and 1e7 steps.
            assert!(attempted_steps < 10_000, "{model:?}: {attempted_steps} steps");
        }
    }
}

#[test]
fn records_of_stiff_bearings_do_not_depend_on_other_points() {
    let points = [2e8, 1e11, 1e7, 1e8].map(prepare_point);
    let all_points: Vec<&Point> = points.iter().collect();
    // With a single lane the points run one after another; on other instruction sets they share
    // lanes.
    let method = Method::additive(new_tolerance(1e-5));
    for model in ModelKind::ALL {
        let batch_records = simulate(Simd::Scalar, model, &method, &all_points);
        assert_eq!(
            simulate(Simd::widest(), model, &method, &all_points),
            batch_records,
            "{model:?}"
        );
        for (point, record) in all_points.iter().zip(batch_records) {
            assert_eq!(simulate_point(model, &method, point), record, "{model:?}");
        }
    }
}

#[test]
fn stiff_bearings_do_not_limit_the_steps_of_the_additive_method() {
    let [soft_point, stiff_point] = [2e9, 1e14].map(prepare_point);
    let full_rad_per_s = highest_frequency_rad_per_s(&stiff_point, 40.0).unwrap();
    let explicit_rad_per_s = highest_explicit_frequency_rad_per_s(&stiff_point, 40.0).unwrap();
    assert!(full_rad_per_s > 1e6, "{full_rad_per_s}");
    assert!(explicit_rad_per_s < 1e4, "{explicit_rad_per_s}");
    let soft_explicit_rad_per_s = highest_explicit_frequency_rad_per_s(&soft_point, 40.0).unwrap();
    assert!(
        (soft_explicit_rad_per_s / explicit_rad_per_s - 1.0).abs() < 0.1,
        "{soft_explicit_rad_per_s} and {explicit_rad_per_s}"
    );
}

//! Tests of time histories against those of independent programs, and of their general properties.

use crate::coordinates::COORDINATES;
use crate::{
    Channel, History, InitialDeviation, Machine, Method, ModelKind, Point, Profile, Spin, Timing,
    integrate_history, prepare,
};
use lane_ode::Simd;

fn prepare_point(machine: Machine, spin: Spin, end_s: f64) -> Point {
    let timing = Timing { end_s, window_s: [0.0, end_s], checkpoints: 0 };
    prepare(Simd::Scalar, &[(machine, spin)], &timing).remove(0).unwrap()
}

/// Returns the largest difference from the channels of a reference file, relative to the peaks of
/// the reference.
fn relative_difference(file: &str, history: &History<'_>) -> f64 {
    let path = format!("{}/tests/reference/{file}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    assert_eq!(history.len(), rows.len());
    let computed_channels: Vec<_> =
        (0..rows.len()).map(|k| history.instant_outputs(k).unwrap().channels).collect();
    let mut max_difference = 0.0_f64;
    for channel in Channel::ALL {
        let name = format!("{}_{}", channel.name(), channel.unit());
        let column = names.iter().position(|known| **known == name).unwrap();
        let peak = rows.iter().fold(0.0_f64, |peak, row| peak.max(row[column].abs()));
        for (computed_channels, row) in computed_channels.iter().zip(&rows) {
            max_difference =
                max_difference.max((computed_channels[channel.index()] - row[column]).abs() / peak);
        }
    }
    max_difference
}

#[test]
fn val_a_run_up_matches_that_of_an_independent_program() {
    let spin = Spin::Ramped { profile: Profile::Cycloidal, peak_rpm: 600.0, ramp_s: 4.0 };
    let point = prepare_point(Machine::paper(), spin, 6.0);
    // Most instants are inside a step, because the interval between instants is no multiple of the
    // step.
    let method = Method::rk4(0.97e-4);
    for (model, file) in [(ModelKind::Nonlinear, "nonlinear"), (ModelKind::Linear, "linear")] {
        let history = integrate_history(model, &method, &point, &InitialDeviation::default(), 0.01);
        let max_difference =
            relative_difference(&format!("cycloidal_600rpm_4s_{file}.csv"), &history);
        assert!(max_difference < 1e-8, "{file}: {max_difference:e}");
    }
}

#[test]
fn val_a_run_up_and_down_matches_that_of_an_independent_program() {
    let mut machine = Machine::paper();
    machine.unbalance.mass_kg = 0.7;
    machine.dampers.iter_mut().for_each(|damper| damper.damping_n_s_per_m = 110.0);
    let point = prepare_point(
        machine,
        Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 8.0 },
        16.0,
    );
    let method = Method::rk4(1e-4);
    for (model, file) in [(ModelKind::Nonlinear, "nonlinear"), (ModelKind::Linear, "linear")] {
        let history = integrate_history(model, &method, &point, &InitialDeviation::default(), 0.01);
        let max_difference =
            relative_difference(&format!("triangular_350rpm_8s_{file}.csv"), &history);
        assert!(max_difference < 1e-6, "{file}: {max_difference:e}");
    }
}

#[test]
fn a_trajectory_does_not_depend_on_the_instants() {
    let point = prepare_point(
        Machine::paper(),
        Spin::Ramped { profile: Profile::Ramp, peak_rpm: 300.0, ramp_s: 1.0 },
        1.0,
    );
    let adaptive_tolerance = lane_ode::Tolerance {
        relative: 1e-6,
        absolute: 1e-9,
        max_steps: 1_000_000,
        longest_step_s: None,
    };
    for method in [
        Method::rk4(2e-4),
        Method::dopri5(adaptive_tolerance),
        Method::additive(adaptive_tolerance),
    ] {
        let sample_history = |every_s: f64| {
            integrate_history(
                ModelKind::Nonlinear,
                &method,
                &point,
                &InitialDeviation::default(),
                every_s,
            )
        };
        let coarse_history = sample_history(0.25);
        let dense_history = sample_history(0.25 / 1024.0);
        assert_eq!((coarse_history.len(), dense_history.len()), (5, 4097));
        for k in 0..5 {
            assert_eq!(coarse_history.instant_outputs(k), dense_history.instant_outputs(1024 * k));
        }
    }
}

#[test]
fn a_failed_trajectory_ends_before_the_time_of_its_failure() {
    let point = prepare_point(
        Machine::paper(),
        Spin::Ramped { profile: Profile::Ramp, peak_rpm: 300.0, ramp_s: 1.0 },
        1.0,
    );
    let mut initial_deviation = InitialDeviation::default();
    initial_deviation.speeds[4] = 100.0;
    let history = integrate_history(
        ModelKind::Nonlinear,
        &Method::rk4(1e-4),
        &point,
        &initial_deviation,
        1e-4,
    );
    let (_, time_s) = history.failure.unwrap();
    assert!(time_s > 0.0 && time_s < 1.0, "{time_s}");
    assert!(history.len() as f64 * 1e-4 <= time_s + 1e-9);
    assert!(history.len() as f64 * 1e-4 >= time_s - 1.1e-4);
    assert!((0..history.len()).all(|k| history.instant_outputs(k).unwrap().gap_m.is_finite()));
    assert_eq!(history.instant_outputs(history.len()), None);
}

#[test]
fn at_rest_the_cabinet_carries_the_weight() {
    let machine = Machine::paper();
    let mass_kg = machine.tub.mass_kg
        + machine.shaft.mass_kg
        + machine.drum.mass_kg
        + machine.unbalance.mass_kg;
    let weight_n = mass_kg * machine.gravity_m_per_s2;
    let point = prepare_point(
        machine,
        Spin::Ramped { profile: Profile::Ramp, peak_rpm: 60.0, ramp_s: 1.0 },
        0.1,
    );
    for model in [ModelKind::Nonlinear, ModelKind::Linear] {
        let history =
            integrate_history(model, &Method::rk4(1e-4), &point, &InitialDeviation::default(), 0.1);
        let forces = history.forces(0).unwrap();
        let [x, y, z] = forces.cabinet_force_n;
        // The force along c1 may differ from zero, because the model does not move along c1.
        assert!((y + weight_n).abs() < 1e-9 * weight_n && z.abs() < 1e-9 * weight_n, "{x} {y} {z}");
        assert_eq!(forces.damper_tensions_n, [0.0; 2]);
        assert!(
            forces.spring_tensions_n.iter().all(|tension| *tension > 0.0),
            "{:?}",
            forces.spring_tensions_n
        );
    }
}

#[test]
fn linear_forces_equal_the_nonlinear_forces_to_first_order() {
    let point = prepare_point(
        Machine::paper(),
        Spin::Ramped { profile: Profile::Ramp, peak_rpm: 60.0, ramp_s: 1.0 },
        0.1,
    );
    let force_difference = |size: f64| {
        let initial_deviation = InitialDeviation {
            deviations: std::array::from_fn(|i| size * (0.3 + 0.1 * i as f64)),
            speeds: std::array::from_fn(|i| size * (5.0 - i as f64)),
        };
        let [nonlinear, linear] = [ModelKind::Nonlinear, ModelKind::Linear].map(|model| {
            integrate_history(model, &Method::rk4(1e-4), &point, &initial_deviation, 0.1)
                .forces(0)
                .unwrap()
        });
        let all_forces = |forces: &crate::SuspensionForces| {
            [
                &forces.spring_tensions_n[..],
                &forces.damper_tensions_n[..],
                &forces.cabinet_force_n[..],
            ]
            .concat()
        };
        let pairs = all_forces(&nonlinear).into_iter().zip(all_forces(&linear));
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let large_difference = force_difference(1e-2);
    let small_difference = force_difference(1e-3);
    assert!(large_difference > 1e-3, "{large_difference}");
    // The difference is of second order: for a tenth of the motion it is a hundredth.
    assert!(
        (large_difference / small_difference - 100.0).abs() < 10.0,
        "{large_difference} {small_difference}"
    );
}

#[test]
fn both_models_start_at_the_given_state() {
    let point = prepare_point(
        Machine::paper(),
        Spin::Ramped { profile: Profile::Ramp, peak_rpm: 60.0, ramp_s: 1.0 },
        0.1,
    );
    let initial_deviation = InitialDeviation {
        deviations: std::array::from_fn(|i| 1e-3 * i as f64),
        speeds: std::array::from_fn(|i| 0.1 - 0.01 * i as f64),
    };
    for model in [ModelKind::Nonlinear, ModelKind::Linear] {
        let first_outputs =
            integrate_history(model, &Method::rk4(1e-4), &point, &initial_deviation, 0.1)
                .instant_outputs(0)
                .unwrap();
        for i in 0..COORDINATES {
            assert!((first_outputs.deviations[i] - initial_deviation.deviations[i]).abs() < 1e-15);
            assert_eq!(first_outputs.speeds[i], initial_deviation.speeds[i]);
        }
        let yaw = first_outputs.channels[Channel::TubYaw.index()];
        assert!((yaw - initial_deviation.deviations[4]).abs() < 1e-15, "{yaw}");
    }
}

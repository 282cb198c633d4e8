//! Tests of the speed amplitudes at which the linear model linearises friction, if they follow from
//! the linear motion.

use crate::modes::mode_roots;
use crate::{
    Damper, Gauge, Machine, Method, ModelKind, Point, Profile, Recorders, Spin, Timing, modes,
    prepare, simulate_with,
};
use lane_ode::Simd;

const TIMING: Timing = Timing { end_s: 12.0, window_s: [4.0, 10.0], checkpoints: 0 };

/// Returns a machine whose dampers have friction. Without `fixed_speed_m_per_s`, their speed
/// amplitudes follow from the motion.
pub(crate) fn machine_with_friction(
    unbalance_mass_kg: f64,
    frictions_n: [f64; 2],
    fixed_speed_m_per_s: Option<f64>,
) -> Machine {
    let mut machine = Machine::paper();
    machine.unbalance.mass_kg = unbalance_mass_kg;
    for (damper, friction_n) in machine.dampers.iter_mut().zip(frictions_n) {
        let friction_linear_speed_m_per_s = fixed_speed_m_per_s;
        *damper = Damper {
            damping_n_s_per_m: 10.0,
            friction_n,
            friction_linear_speed_m_per_s,
            ..*damper
        };
    }
    machine
}

fn prepare_points(machines: &[Machine]) -> Vec<Point> {
    let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 12.0 };
    let points: Vec<_> = machines.iter().map(|machine| (machine.clone(), spin.clone())).collect();
    prepare(Simd::widest(), &points, &TIMING).into_iter().map(Result::unwrap).collect()
}

#[test]
fn speed_amplitudes_that_are_not_given_follow_from_the_linear_motion() {
    let cases = [(0.4, [60.0, 60.0]), (0.2, [20.0, 60.0]), (0.9, [10.0, 0.0]), (0.5, [80.0, 81.0])];
    let machines =
        cases.map(|(mass_kg, frictions_n)| machine_with_friction(mass_kg, frictions_n, None));
    let points = prepare_points(&machines);
    let method = Method::rk4(2e-4);
    let recorders = Recorders::with_gauge(Gauge::DamperSpeed);
    let point_references: Vec<&Point> = points.iter().collect();
    let (_, readings) =
        simulate_with(Simd::widest(), ModelKind::Linear, &method, &point_references, recorders);
    for ((point, reading), machine) in points.iter().zip(&readings).zip(&machines) {
        let speeds = reading.gauge_values(Gauge::DamperSpeed);
        let speed_factor = point.friction_speed_factor(ModelKind::Linear, speeds).unwrap();
        assert!(
            speed_factor < 1.01,
            "{speed_factor}: {:?} for {reading:?}",
            point.friction_speeds()
        );
        // The speeds do not depend on the other points.
        let single_point = prepare_points(std::slice::from_ref(machine)).remove(0);
        assert_eq!(single_point.friction_speeds(), point.friction_speeds());
        let friction_damper_count =
            machine.dampers.iter().filter(|damper| damper.friction_n > 0.0).count();
        assert_eq!(point.friction_speeds().len(), friction_damper_count);
    }
    let point_with_fixed_speed =
        prepare_points(&[machine_with_friction(0.4, [60.0, 60.0], Some(0.02))]).remove(0);
    let speed_factor =
        point_with_fixed_speed.friction_speed_factor(ModelKind::Linear, &[0.1, 0.005]).unwrap();
    assert!(
        (speed_factor - 5.0).abs() < 1e-12,
        "{speed_factor}: below 4 v_s / pi friction is viscous"
    );
}

/// Friction dissipates almost all of the work of the unbalance's force. A change of the speed
/// amplitudes then changes the motion's speeds by nearly as much, so that residuals are small
/// although the fixed point is far away.
#[test]
fn own_speeds_near_a_resonance_are_a_fixed_point() {
    let machine_with = |fixed_speed_m_per_s: Option<f64>, friction_n: f64| {
        let mut machine = machine_with_friction(0.5, [friction_n; 2], fixed_speed_m_per_s);
        machine.dampers.iter_mut().for_each(|damper| damper.damping_n_s_per_m = 4.0);
        machine
    };
    let method = Method::rk4(2e-4);
    let recorders = Recorders::with_gauge(Gauge::DamperSpeed);
    for friction_n in [45.0, 50.0, 55.0] {
        let point = prepare_points(&[machine_with(None, friction_n)]).remove(0);
        let speeds_m_per_s: Vec<f64> =
            point.friction_speeds().iter().map(|amplitude| amplitude.speed_m_per_s).collect();
        // Newton's method for both speeds, with finite differences between long runs.
        let motion_reciprocals = |speeds: &[f64]| -> Vec<f64> {
            let mut machine = machine_with(Some(1.0), friction_n);
            for (damper, speed) in machine.dampers.iter_mut().zip(speeds) {
                damper.friction_linear_speed_m_per_s = Some(*speed);
            }
            let point = prepare_points(&[machine]).remove(0);
            let (_, readings) =
                simulate_with(Simd::widest(), ModelKind::Linear, &method, &[&point], recorders);
            let reciprocals =
                readings[0].gauge_values(Gauge::DamperSpeed).iter().map(|speed| 1.0 / speed);
            reciprocals.collect()
        };
        let mut reciprocals: Vec<f64> = speeds_m_per_s.iter().map(|speed| 1.0 / speed).collect();
        for _ in 0..4 {
            let to_speeds = |x: &[f64]| -> Vec<f64> { x.iter().map(|x| 1.0 / x).collect() };
            let residual = |x: &[f64]| -> [f64; 2] {
                let reciprocals_at_x = motion_reciprocals(&to_speeds(x));
                [reciprocals_at_x[0] - x[0], reciprocals_at_x[1] - x[1]]
            };
            let residual_here = residual(&reciprocals);
            let jacobian_column = |k: usize| {
                let mut shifted_reciprocals = reciprocals.clone();
                let difference_step = 1e-3 * shifted_reciprocals[k];
                shifted_reciprocals[k] += difference_step;
                let shifted_residual = residual(&shifted_reciprocals);
                [
                    (shifted_residual[0] - residual_here[0]) / difference_step,
                    (shifted_residual[1] - residual_here[1]) / difference_step,
                ]
            };
            let [[a, c], [b, d]] = [jacobian_column(0), jacobian_column(1)];
            let determinant = a * d - b * c;
            reciprocals[0] -= (d * residual_here[0] - b * residual_here[1]) / determinant;
            reciprocals[1] -= (a * residual_here[1] - c * residual_here[0]) / determinant;
        }
        let ratios =
            speeds_m_per_s.iter().zip(&reciprocals).map(|(speed, reciprocal)| speed * reciprocal);
        let ratios: Vec<f64> = ratios.collect();
        println!("{friction_n} N: {speeds_m_per_s:?} m/s are {ratios:?} of the fixed point");
        assert!(
            ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.01),
            "{friction_n} N: {ratios:?}"
        );
    }
}

/// Both dampers of a machine at its resonance slide, and the step to the fixed point has the
/// opposite sign of the residual of one damper. The expected speeds were computed by Newton's
/// method, with rows of `sweep run` at fixed speed amplitudes.
#[test]
fn own_speeds_of_dampers_that_move_together_are_a_fixed_point() {
    let mut machine = machine_with_friction(0.514, [46.1; 2], None);
    machine.dampers.iter_mut().for_each(|damper| damper.damping_n_s_per_m = 3.4);
    let spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 265.13, ramp_s: 8.0 };
    let timing = Timing { end_s: 30.0, window_s: [10.0, 30.0], checkpoints: 0 };
    let point = prepare(Simd::widest(), &[(machine, spin)], &timing).remove(0).unwrap();
    let expected_m_per_s = [0.622_071, 0.388_478];
    assert_eq!(point.friction_speeds().len(), 2);
    for (friction_speed, expected) in point.friction_speeds().iter().zip(expected_m_per_s) {
        let ratio = friction_speed.speed_m_per_s / expected;
        assert!((ratio - 1.0).abs() < 0.02, "{ratio}: {friction_speed:?}");
    }
}

#[test]
fn a_stuck_damper_has_the_least_speed_amplitude() {
    let machine = machine_with_friction(0.01, [120.0, 120.0], None);
    let stuck_point = prepare_points(std::slice::from_ref(&machine)).remove(0);
    let min_speed_m_per_s = 4.0 * machine.dampers[0].friction_speed_m_per_s / std::f64::consts::PI;
    for speed in stuck_point.friction_speeds() {
        assert!(
            (speed.speed_m_per_s / min_speed_m_per_s - 1.0).abs() < 1e-12,
            "{speed:?}, least {min_speed_m_per_s}"
        );
    }
}

/// Checks that the two rates of an overdamped mode are paired by their shapes. Pairs of consecutive
/// rates would give a mode of two slow rates, and another of two fast rates that is as fast as the
/// hinge's modes.
#[test]
fn the_two_rates_of_an_overdamped_mode_have_one_shape() {
    let find_modes = |frictions_n: [f64; 2]| {
        let point = prepare_points(&[machine_with_friction(0.1, frictions_n, None)]).remove(0);
        let modes = modes(&point, 0.0, 0.0).unwrap().modes;
        let roots_without_shapes = mode_roots(&point, 0.0, None).unwrap();
        for (mode, motion) in modes.iter().zip(roots_without_shapes) {
            let error = motion.magnitude_rad_per_s / mode.magnitude_rad_per_s - 1.0;
            assert!(error.abs() < 1e-9, "{frictions_n:?}: {error:e}");
        }
        modes
    };
    let frictionless_modes = find_modes([0.0, 0.0]);
    let mut max_overdamped_count = 0;
    for friction_n in [20.0, 40.0, 60.0, 120.0, 300.0] {
        let damped_modes = find_modes([friction_n, 0.9 * friction_n]);
        let overdamped_count = damped_modes.iter().filter(|mode| mode.im_rad_per_s == 0.0).count();
        max_overdamped_count = max_overdamped_count.max(overdamped_count);
        for (damped_mode, frictionless_mode) in damped_modes.iter().zip(&frictionless_modes) {
            let ratio = damped_mode.magnitude_rad_per_s / frictionless_mode.magnitude_rad_per_s;
            assert!((0.8..1.25).contains(&ratio), "{friction_n} N: {ratio}");
        }
    }
    assert_eq!(max_overdamped_count, 2);
}

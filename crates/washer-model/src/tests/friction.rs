//! Tests of the speed amplitudes at which the linear model takes friction, if they are those of its
//! own motion.

use crate::modes::motions;
use crate::{
    Damper, Gauge, Machine, Method, ModelKind, Point, Profile, Recorders, Spin, Timing, modes,
    prepare, simulate_with,
};
use lane_ode::Simd;

const TIMING: Timing = Timing { end_s: 12.0, window_s: [4.0, 10.0], checkpoints: 0 };

/// Returns a machine whose dampers have friction, at their own speed amplitudes or at a given one.
pub(crate) fn machine(
    unbalance_mass_kg: f64,
    frictions_n: [f64; 2],
    given_m_per_s: Option<f64>,
) -> Machine {
    let mut machine = Machine::paper();
    machine.unbalance.mass_kg = unbalance_mass_kg;
    for (damper, friction_n) in machine.dampers.iter_mut().zip(frictions_n) {
        let friction_linear_speed_m_per_s = given_m_per_s;
        *damper = Damper {
            damping_n_s_per_m: 10.0,
            friction_n,
            friction_linear_speed_m_per_s,
            ..*damper
        };
    }
    machine
}

fn prepared(machines: &[Machine]) -> Vec<Point> {
    let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 12.0 };
    let points: Vec<_> = machines.iter().map(|machine| (machine.clone(), spin.clone())).collect();
    prepare(Simd::best(), &points, &TIMING).into_iter().map(Result::unwrap).collect()
}

#[test]
fn own_speeds_are_those_of_the_linear_motion() {
    let cases = [(0.4, [60.0, 60.0]), (0.2, [20.0, 60.0]), (0.9, [10.0, 0.0]), (0.5, [80.0, 81.0])];
    let machines = cases.map(|(mass_kg, frictions_n)| machine(mass_kg, frictions_n, None));
    let points = prepared(&machines);
    let method = Method::Rk4 { step_s: 2e-4 };
    let recorders = Recorders::gauge(Gauge::DamperSpeed);
    let simulated: Vec<&Point> = points.iter().collect();
    let (_, readings) =
        simulate_with(Simd::best(), ModelKind::Linear, &method, &simulated, recorders);
    for ((point, reading), machine) in points.iter().zip(&readings).zip(&machines) {
        let speeds = reading.gauge(Gauge::DamperSpeed);
        let factor = point.friction_speed_factor(ModelKind::Linear, speeds).unwrap();
        assert!(factor < 1.01, "{factor}: {:?} for {reading:?}", point.friction_speeds());
        // They do not depend on the other points.
        let alone = prepared(std::slice::from_ref(machine)).remove(0);
        assert_eq!(alone.friction_speeds(), point.friction_speeds());
        let count = machine.dampers.iter().filter(|damper| damper.friction_n > 0.0).count();
        assert_eq!(point.friction_speeds().len(), count);
    }
    let given = prepared(&[machine(0.4, [60.0, 60.0], Some(0.02))]).remove(0);
    let factor = given.friction_speed_factor(ModelKind::Linear, &[0.1, 0.005]).unwrap();
    assert!((factor - 5.0).abs() < 1e-12, "{factor}: below 4 v_s / pi friction is viscous");
}

#[test]
fn a_stuck_damper_has_the_least_speed_amplitude() {
    let machine = machine(0.01, [120.0, 120.0], None);
    let stuck = prepared(std::slice::from_ref(&machine)).remove(0);
    let least = 4.0 * machine.dampers[0].friction_speed_m_per_s / std::f64::consts::PI;
    for speed in stuck.friction_speeds() {
        assert!((speed.speed_m_per_s / least - 1.0).abs() < 1e-12, "{speed:?}, least {least}");
    }
}

/// Pairs of neighbouring rates would give a mode of two slow rates, and another of two fast rates
/// that is as fast as the hinge's modes.
#[test]
fn the_two_rates_of_an_overdamped_mode_have_one_shape() {
    let frequencies = |frictions_n: [f64; 2]| {
        let point = prepared(&[machine(0.1, frictions_n, None)]).remove(0);
        let modes = modes(&point, 0.0, 0.0).unwrap().modes;
        let without_shapes = motions(&point, 0.0, None).unwrap();
        for (mode, motion) in modes.iter().zip(without_shapes) {
            let error = motion.magnitude_rad_per_s / mode.magnitude_rad_per_s - 1.0;
            assert!(error.abs() < 1e-9, "{frictions_n:?}: {error:e}");
        }
        modes
    };
    let frictionless = frequencies([0.0, 0.0]);
    let mut most_overdamped = 0;
    for friction_n in [20.0, 40.0, 60.0, 120.0, 300.0] {
        let damped = frequencies([friction_n, 0.9 * friction_n]);
        let overdamped = damped.iter().filter(|mode| mode.im_rad_per_s == 0.0).count();
        most_overdamped = most_overdamped.max(overdamped);
        for (damped, frictionless) in damped.iter().zip(&frictionless) {
            let ratio = damped.magnitude_rad_per_s / frictionless.magnitude_rad_per_s;
            assert!((0.8..1.25).contains(&ratio), "{friction_n} N: {ratio}");
        }
    }
    assert_eq!(most_overdamped, 2);
}

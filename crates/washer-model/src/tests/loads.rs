//! Tests of the recorded loads of stops and feet, and of the speeds of dampers, against the forces
//! of densely sampled time histories.

use super::elements::machine_with_every_element;
use super::energy::{body_axes, position};
use crate::machine::feet::{Feet, LOAD_COMPONENTS};
use crate::machine::{Cabinet, Foot, Machine};
use crate::{
    Gauge, InitialDeviation, Method, ModelKind, Point, Profile, Reading, Recorders, Spin, Timing,
    integrate_history, prepare, simulate_with,
};
use lane_ode::Simd;

const TIMING: Timing = Timing { end_s: 3.0, window_s: [0.5, 2.9], checkpoints: 0 };
const INTERVAL_S: f64 = 1e-4;

/// Adds a cabinet on four feet to a machine.
fn machine_with_cabinet(mut machine: Machine) -> Machine {
    machine.cabinet =
        Some(Cabinet { mass_kg: 35.0, centre_m: [0.18, -0.1, 0.02], friction_coefficient: 0.4 });
    let corners = [[0.47, 0.26], [0.47, -0.26], [-0.07, 0.26], [-0.07, -0.26]];
    machine.feet = corners.map(|[x, z]| Foot { foot_m: [x, -0.45, z] }).to_vec();
    machine
}

fn prepare_ramp_point(machine: Machine) -> Point {
    let spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 300.0, ramp_s: 2.0 };
    prepare(Simd::widest(), &[(machine, spin)], &TIMING).remove(0).unwrap()
}

/// Returns the least of each number over all instants.
fn find_minima(instants: impl Iterator<Item = Vec<f64>>) -> Vec<f64> {
    let pairwise_minima =
        |a: Vec<f64>, b: Vec<f64>| a.iter().zip(&b).map(|(a, b)| a.min(*b)).collect();
    instants.reduce(pairwise_minima).unwrap()
}

fn assert_close(quantity: &str, values: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(values.len(), expected.len(), "{quantity}");
    for (k, (value, expected)) in values.iter().zip(expected).enumerate() {
        let error = (value - expected).abs();
        assert!(error < tolerance, "{quantity} {}: {value} instead of {expected}", k + 1);
    }
}

/// Returns the readings of all gauges of loads and damper speeds.
fn read_gauges(point: &Point, model: ModelKind, simd: Simd) -> Reading {
    let method = Method::rk4(1e-4);
    let [clash, force] = [Gauge::ClashTime, Gauge::CabinetForce];
    let gauges = Gauge::ALL.map(|gauge| gauge != clash && gauge != force);
    let recorders = Recorders { gauges, ..Recorders::default() };
    let (_, mut readings) = simulate_with(simd, model, &method, &[point], recorders);
    readings.remove(0)
}

/// Computes the force and the moment about O on the cabinet at an instant, from the forces of the
/// elements, each along its line or at its point.
fn compute_load(
    machine: &Machine,
    point: &Point,
    deviations: &[f64; 10],
    forces: &crate::SuspensionForces,
) -> [f64; LOAD_COMPONENTS] {
    let q: [f64; 10] = std::array::from_fn(|i| point.equilibrium()[i] + deviations[i]);
    let tub = body_axes(q[4], q[5]);
    let tub_point = |position_m: [f64; 3]| position([0.0, q[0], q[1]], &tub, position_m);
    let mut load = [0.0; LOAD_COMPONENTS];
    let mut add_force = |position_m: [f64; 3], force: [f64; 3]| {
        for i in 0..3 {
            let j = (i + 1) % 3;
            let k = (i + 2) % 3;
            load[i] += force[i];
            load[3 + i] += position_m[j] * force[k] - position_m[k] * force[j];
        }
    };
    let springs =
        machine.springs.iter().map(|s| (s.cabinet_m, s.tub_m)).zip(&forces.spring_tensions_n);
    let dampers =
        machine.dampers.iter().map(|d| (d.cabinet_m, d.tub_m)).zip(&forces.damper_tensions_n);
    for ((cabinet_m, tub_m), tension_n) in springs.chain(dampers) {
        let tub_end_m = tub_point(tub_m);
        let span: [f64; 3] = std::array::from_fn(|i| tub_end_m[i] - cabinet_m[i]);
        let length = span.iter().map(|s| s * s).sum::<f64>().sqrt();
        add_force(cabinet_m, span.map(|s| tension_n * s / length));
    }
    for (stop, force_n) in machine.stops.iter().zip(&forces.stop_forces_n) {
        let length = stop.direction_length();
        add_force(tub_point(stop.tub_m), stop.direction.map(|d| force_n * d / length));
    }
    for (bushing, force_n) in machine.bushings.iter().zip(&forces.bushing_forces_n) {
        add_force(tub_point(bushing.tub_m), *force_n);
    }
    load
}

#[test]
fn recorded_loads_agree_with_a_densely_sampled_history() {
    let mut machine = machine_with_cabinet(machine_with_every_element());
    machine.unbalance.mass_kg = 0.9;
    machine.stops[..2].iter_mut().for_each(|stop| stop.clearance_m = 0.003);
    // The cabinet is so heavy that no foot lifts. On a single foot there would be no resistance to
    // turning.
    machine.cabinet.as_mut().unwrap().mass_kg = 1000.0;
    let point = prepare_ramp_point(machine.clone());
    let feet = Feet::new(&machine).unwrap();
    let method = Method::rk4(1e-4);
    let history = integrate_history(
        ModelKind::Nonlinear,
        &method,
        &point,
        &InitialDeviation::default(),
        INTERVAL_S,
    );
    let [first_instant, last_instant] =
        TIMING.window_s.map(|edge_s| (edge_s / INTERVAL_S).round() as usize);
    let mut foot_loads_n = vec![f64::INFINITY; 4];
    let mut slip_margin_n = f64::INFINITY;
    let mut walk_margin_n = f64::INFINITY;
    let mut stop_forces_n = vec![0.0_f64; 3];
    let mut contact_times_s = vec![0.0_f64; 3];
    let mut greatest_tensions_n = vec![0.0_f64; machine.dampers.len()];
    for k in first_instant..=last_instant {
        let forces = history.forces(k).unwrap();
        let instant = history.instant_outputs(k).unwrap();
        let load = compute_load(&machine, &point, &instant.deviations, &forces);
        for i in 0..3 {
            assert!((load[i] - forces.cabinet_force_n[i]).abs() < 1e-9);
        }
        let loads_n = feet.loads_n(&load);
        assert_close("a history's load of foot", &forces.foot_loads_n, &loads_n, 1e-9);
        let horizontal_n = (load[0] * load[0] + load[2] * load[2]).sqrt();
        let slip_margin_now_n = 0.4 * (feet.distribution.cabinet_weight.0 - load[1]) - horizontal_n;
        assert!((forces.slip_margin_n.unwrap() - slip_margin_now_n).abs() < 1e-9);
        slip_margin_n = slip_margin_n.min(slip_margin_now_n);
        // The moment is taken about the centre of the feet's loads; feet that lift have no load.
        let positive_loads_n: Vec<f64> = loads_n.iter().map(|n| n.max(0.0)).collect();
        let total_n: f64 = positive_loads_n.iter().sum();
        let mean_coordinate = |axis: usize| {
            let feet = machine.feet.iter().zip(&positive_loads_n);
            feet.map(|(foot, n)| foot.foot_m[axis] * n / total_n).sum::<f64>()
        };
        let arm = |foot: &Foot| {
            (foot.foot_m[0] - mean_coordinate(0)).hypot(foot.foot_m[2] - mean_coordinate(2))
        };
        let arms: Vec<f64> = machine.feet.iter().map(arm).collect();
        let mean_square_arm_m2: f64 =
            arms.iter().zip(&positive_loads_n).map(|(arm, n)| n / total_n * arm * arm).sum();
        let longest_arm_m = arms.iter().copied().fold(0.0, f64::max);
        let moment = load[4] + mean_coordinate(0) * load[2] - mean_coordinate(2) * load[0];
        let walk_margin_now_n =
            slip_margin_now_n - moment.abs() * longest_arm_m / mean_square_arm_m2;
        assert!((forces.walk_margin_n.unwrap() - walk_margin_now_n).abs() < 1e-6);
        walk_margin_n = walk_margin_n.min(walk_margin_now_n);
        foot_loads_n = find_minima([foot_loads_n, loads_n].into_iter());
        for (greatest_n, now_n) in stop_forces_n.iter_mut().zip(&forces.stop_forces_n) {
            *greatest_n = greatest_n.max(*now_n);
        }
        for (greatest_n, now_n) in greatest_tensions_n.iter_mut().zip(&forces.damper_tensions_n) {
            *greatest_n = greatest_n.max(now_n.abs());
        }
        let q: [f64; 10] = std::array::from_fn(|i| point.equilibrium()[i] + instant.deviations[i]);
        for (contact_times_s, stop) in contact_times_s.iter_mut().zip(&machine.stops) {
            let stop_point = position([0.0, q[0], q[1]], &body_axes(q[4], q[5]), stop.tub_m);
            let length = stop.direction_length();
            let displacement_m: f64 =
                (0..3).map(|i| (stop_point[i] - stop.tub_m[i]) * stop.direction[i] / length).sum();
            *contact_times_s += if displacement_m > stop.clearance_m { INTERVAL_S } else { 0.0 };
        }
    }
    let hit_stops = stop_forces_n
        .iter()
        .zip(&contact_times_s)
        .filter(|(force_n, s)| **force_n > 20.0 && **s > 0.01);
    assert!(hit_stops.count() >= 2, "{stop_forces_n:?} N, {contact_times_s:?} s");
    let reading = read_gauges(&point, ModelKind::Nonlinear, Simd::widest());
    assert_close("least load of foot", reading.gauge_values(Gauge::FootLoad), &foot_loads_n, 1e-2);
    assert_close("margin", reading.gauge_values(Gauge::SlipMargin), &[slip_margin_n], 1e-2);
    assert_close("walking", reading.gauge_values(Gauge::WalkMargin), &[walk_margin_n], 0.1);
    assert!(
        walk_margin_n < slip_margin_n - 1.0,
        "{walk_margin_n} N, {slip_margin_n} N: this machine turns"
    );
    let greatest_n = stop_forces_n.iter().copied().fold(0.0, f64::max);
    assert_close(
        "force of stop",
        reading.gauge_values(Gauge::StopForce),
        &stop_forces_n,
        1e-3 * greatest_n,
    );
    // A damper's tension increases with its speed, so that both are greatest at the same instant.
    let tensions_n: Vec<f64> = reading
        .gauge_values(Gauge::DamperSpeed)
        .iter()
        .zip(&machine.dampers)
        .map(|(speed, damper)| {
            let friction_speed = damper.friction_speed_m_per_s;
            damper.damping_n_s_per_m * speed
                + damper.friction_n * speed
                    / (speed * speed + friction_speed * friction_speed).sqrt()
        })
        .collect();
    let quantity = "tension at the greatest speed of damper";
    assert_close(quantity, &tensions_n, &greatest_tensions_n, 1e-2);
    // The error of each contact is up to one interval at both ends.
    assert_close(
        "contact of stop",
        reading.gauge_values(Gauge::StopContact),
        &contact_times_s,
        40.0 * INTERVAL_S,
    );
    assert_eq!(read_gauges(&point, ModelKind::Nonlinear, Simd::Scalar), reading);
}

#[test]
fn loads_of_the_linear_model_agree_with_its_history() {
    let mut machine = machine_with_cabinet(machine_with_every_element());
    machine.unbalance.mass_kg = 0.9;
    let point = prepare_ramp_point(machine.clone());
    let method = Method::rk4(1e-4);
    let history = integrate_history(
        ModelKind::Linear,
        &method,
        &point,
        &InitialDeviation::default(),
        INTERVAL_S,
    );
    let [first_instant, last_instant] =
        TIMING.window_s.map(|edge_s| (edge_s / INTERVAL_S).round() as usize);
    let forces: Vec<_> =
        (first_instant..=last_instant).map(|k| history.forces(k).unwrap()).collect();
    let foot_loads_n = find_minima(forces.iter().map(|forces| forces.foot_loads_n.clone()));
    let slip_margin_n =
        find_minima(forces.iter().map(|forces| vec![forces.slip_margin_n.unwrap()]));
    let negated_stops_n =
        find_minima(forces.iter().map(|forces| forces.stop_forces_n.iter().map(|n| -n).collect()));
    let stop_forces_n: Vec<f64> = negated_stops_n.iter().map(|negated_n| -negated_n).collect();
    let reading = read_gauges(&point, ModelKind::Linear, Simd::widest());
    let at_rest = history.forces(0).unwrap();
    assert!(
        at_rest.foot_loads_n.iter().zip(&foot_loads_n).all(|(rest_n, n)| rest_n - n > 10.0),
        "{foot_loads_n:?}"
    );
    assert_close("least load of foot", reading.gauge_values(Gauge::FootLoad), &foot_loads_n, 1e-2);
    assert_close("margin", reading.gauge_values(Gauge::SlipMargin), &slip_margin_n, 1e-2);
    assert_close("force of stop", reading.gauge_values(Gauge::StopForce), &stop_forces_n, 1e-6);
    let dampers = machine.dampers.iter().zip(reading.gauge_values(Gauge::DamperSpeed));
    let tensions_n: Vec<f64> = dampers
        .map(|(damper, speed)| {
            let linear_speed = damper.friction_linear_speed_m_per_s.unwrap_or(f64::INFINITY);
            let equivalent_damping =
                4.0 * damper.friction_n / (std::f64::consts::PI * linear_speed);
            (damper.damping_n_s_per_m + equivalent_damping) * speed
        })
        .collect();
    let negated_tensions_n = find_minima(
        forces.iter().map(|forces| forces.damper_tensions_n.iter().map(|n| -n.abs()).collect()),
    );
    let greatest_tensions_n: Vec<f64> = negated_tensions_n.iter().map(|n| -n).collect();
    assert!(greatest_tensions_n.iter().all(|n| *n > 1.0), "{greatest_tensions_n:?}");
    let quantity = "tension at the greatest speed of damper";
    assert_close(quantity, &tensions_n, &greatest_tensions_n, 1e-2);
}

#[test]
fn the_foot_loads_of_both_models_agree_for_small_motions() {
    let mut machine = machine_with_cabinet(machine_with_every_element());
    machine.dampers.iter_mut().for_each(|damper| {
        damper.friction_n = 0.0;
        damper.damping_n_s_per_m = 100.0;
    });
    machine.unbalance.mass_kg = 1e-3;
    machine.further_unbalances.clear();
    let point = prepare_ramp_point(machine.clone());
    let feet = Feet::new(&machine).unwrap();
    let history = integrate_history(
        ModelKind::Nonlinear,
        &Method::rk4(1e-4),
        &point,
        &InitialDeviation::default(),
        0.1,
    );
    let rest_load = compute_load(&machine, &point, &[0.0; 10], &history.forces(0).unwrap());
    let min_rest_load_n = feet.loads_n(&rest_load).into_iter().fold(f64::INFINITY, f64::min);
    let [nonlinear, linear] = [ModelKind::Nonlinear, ModelKind::Linear].map(|model| {
        let reading = read_gauges(&point, model, Simd::widest());
        min_rest_load_n
            - reading.gauge_values(Gauge::FootLoad).iter().copied().fold(f64::INFINITY, f64::min)
    });
    assert!(nonlinear > 0.01, "{nonlinear} N");
    assert!((linear / nonlinear - 1.0).abs() < 5e-3, "{linear} N for {nonlinear} N");
}

#[test]
fn a_machine_without_stops_and_cabinet_has_only_damper_speeds() {
    let point = prepare_ramp_point(Machine::paper());
    let mut reading = read_gauges(&point, ModelKind::Nonlinear, Simd::widest());
    let speeds = core::mem::take(&mut reading.gauges[Gauge::DamperSpeed as usize]);
    assert_eq!((speeds.len(), reading), (2, Reading::default()));
}

/// Only the loads that a gauge needs are evaluated.
#[test]
fn a_gauge_does_not_depend_on_the_other_gauges_in_use() {
    let point = prepare_ramp_point(machine_with_cabinet(machine_with_every_element()));
    let read = |model: ModelKind, recorders: Recorders| {
        let (_, mut readings) =
            simulate_with(Simd::widest(), model, &Method::rk4(2e-4), &[&point], recorders);
        readings.remove(0)
    };
    for model in ModelKind::ALL {
        let gauges = Gauge::ALL.map(|_| true);
        let reading_of_all = read(model, Recorders { gauges, ..Recorders::default() });
        for gauge in Gauge::ALL {
            let reading = read(model, Recorders::with_gauge(gauge));
            let values = reading.gauge_values(gauge);
            assert!(!values.is_empty(), "{gauge:?}");
            assert_eq!(values, reading_of_all.gauge_values(gauge), "{gauge:?}, {model:?}");
        }
    }
}

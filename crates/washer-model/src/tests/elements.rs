//! Tests of friction, stops, bushings, cubic springs and further unbalances against independent
//! time histories and closed forms.

use super::instruments::{paper_machine, prepare_point};
use super::reference::read_reference;
use crate::coordinates::COORDINATES;
use crate::{
    BumpStop, Bushing, Channel, Damper, InitialDeviation, Machine, Method, ModelKind, Point,
    Profile, Spin, Spring, Unbalance, integrate_history, simulate,
};
use core::f64::consts::PI;
use lane_ode::{Simd, Tolerance};
use serde_json::Value;

/// The speed amplitude of the linear model's friction, for tests whose results do not depend on it.
const LINEAR_SPEED_M_PER_S: f64 = 0.3;

fn to_vector(values: &[f64]) -> [f64; 3] {
    [values[0], values[1], values[2]]
}

fn read_rows(case: &Value, key: &str) -> Vec<Vec<f64>> {
    let rows = case[key].as_array().into_iter().flatten();
    rows.map(|row| row.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()).collect()
}

/// Reads the machine of a file of `tests/reference`, whose README explains the keys.
pub(crate) fn read_machine(case: &Value) -> Machine {
    let read_number = |key: &str| case[key].as_f64();
    let mut machine = paper_machine(
        read_number("unbalance_mass_kg").unwrap(),
        read_number("damping_n_s_per_m").unwrap(),
    );
    for damper in &mut machine.dampers {
        damper.friction_n = read_number("Ff").unwrap_or(0.0);
        damper.friction_speed_m_per_s = read_number("vs").unwrap_or(damper.friction_speed_m_per_s);
        damper.friction_linear_speed_m_per_s = Some(LINEAR_SPEED_M_PER_S);
    }
    for spring in &mut machine.springs {
        spring.cubic_n_per_m3 = read_number("kc").unwrap_or(0.0);
    }
    machine.stops = read_rows(case, "stops")
        .iter()
        .map(|row| BumpStop {
            tub_m: to_vector(&row[0..3]),
            direction: to_vector(&row[3..6]),
            clearance_m: row[6],
            stiffness_n_per_m: row[7],
            damping_n_s_per_m: row[8],
            softness_m: 1e-4,
        })
        .collect();
    machine.bushings = read_rows(case, "bush")
        .iter()
        .map(|row| Bushing {
            tub_m: to_vector(&row[0..3]),
            stiffness_n_per_m: to_vector(&row[3..6]),
            cubic_n_per_m3: to_vector(&row[6..9]),
            damping_n_s_per_m: to_vector(&row[9..12]),
        })
        .collect();
    machine.further_unbalances = read_number("m2")
        .map(|mass_kg| Unbalance {
            mass_kg,
            x_m: read_number("x2").unwrap(),
            radius_m: read_number("r2").unwrap(),
            angle_deg: 0.0,
        })
        .into_iter()
        .collect();
    machine
}

/// Returns the reference machine that has elements of every kind.
pub(super) fn machine_with_every_element() -> Machine {
    read_machine(&read_reference("elements_all.json"))
}

/// Computes the largest error of each method's history against a reference, relative to each
/// channel's peak.
fn reference_errors<const N: usize>(name: &str, methods: [Method; N]) -> [f64; N] {
    let case = read_reference(&format!("elements_{name}.json"));
    let peak_rpm = case["peak_rpm"].as_f64().unwrap();
    let ramp_s = case["ramp_s"].as_f64().unwrap();
    let spin = match case["spin"].as_str().unwrap() {
        "triangular" => Spin::Ramped { profile: Profile::Triangular, peak_rpm, ramp_s },
        "cycloidal" => Spin::Ramped { profile: Profile::Cycloidal, peak_rpm, ramp_s },
        other => panic!("{other}"),
    };
    let point = prepare_point(read_machine(&case), spin, case["end_s"].as_f64().unwrap());
    let reference_equilibrium = case["equilibrium_m_rad"].as_array().unwrap();
    for i in 0..COORDINATES {
        let expected = reference_equilibrium[i].as_f64().unwrap();
        assert!((point.equilibrium[i] - expected).abs() < 1e-12, "{name}: q{}", i + 1);
    }
    let path = format!("{}/tests/reference/elements_{name}.csv", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    let find_channel = |name: &&str| {
        let has_name =
            |channel: &Channel| format!("{}_{}", channel.name(), channel.unit()) == *name;
        Channel::ALL.into_iter().find(has_name)
    };
    let channels: Vec<Channel> = names.iter().filter_map(find_channel).collect();
    assert_eq!((names[0], channels.len()), ("time_s", 6));
    methods.map(|method| {
        let history = integrate_history(
            ModelKind::Nonlinear,
            &method,
            &point,
            &InitialDeviation::default(),
            0.01,
        );
        assert_eq!(history.len(), rows.len());
        let mut max_error = 0.0_f64;
        for (column, channel) in channels.iter().enumerate() {
            let peak = rows.iter().fold(0.0_f64, |peak, row| peak.max(row[column + 1].abs()));
            for (k, row) in rows.iter().enumerate() {
                let computed = history.instant_outputs(k).unwrap().channels[channel.index()];
                max_error = max_error.max((computed - row[column + 1]).abs() / peak);
            }
        }
        max_error
    })
}

#[test]
fn val_histories_with_every_element_match_those_of_independent_programs() {
    for name in ["friction", "stops", "gasket_cubic", "second_unbalance", "all"] {
        let rk4 = Method::rk4;
        let tolerance = Tolerance {
            relative: 1e-7,
            absolute: 1e-9,
            max_steps: 10_000_000,
            longest_step_s: None,
        };
        let methods = [rk4(1e-4), rk4(5e-5), Method::additive(tolerance)];
        let [coarse, fine, additive] = reference_errors(name, methods);
        eprintln!(
            "{name}: {coarse:.1e} of the peak at steps of 1e-4 s, {fine:.1e} at 5e-5 s, \
             {additive:.1e} by the additive method"
        );
        assert!(fine < 1e-5, "{name}: {fine:e}");
        assert!(additive < 1e-4, "{name}: {additive:e} by the additive method");
    }
}

/// The tolerance of the closed forms (m), which neglect the bearings: the rotor's inertia deflects
/// these by 8 kg x 20 m/s^2 / 4e8 N/m = 4e-7 m, and they ring with the same amplitude.
const BEARING_DEFLECTION_M: f64 = 8e-7;

/// Returns a machine that moves only vertically, and the natural frequency (rad/s) of this motion.
/// All mass centres are between the bearings, four springs are vertical, and the shaft hardly
/// bends.
fn heaving_machine() -> (Machine, f64) {
    let mut machine = paper_machine(0.0, 0.0);
    machine.tub.centre_x_m = 0.0;
    machine.shaft.centre_x_m = 0.0;
    machine.drum.centre_x_m = 0.0;
    machine.drum.hinge_x_m = 0.0;
    machine.unbalance.x_m = 0.0;
    let spring = |x_m: f64, z_m: f64| Spring {
        cabinet_m: [x_m, 0.4, z_m],
        tub_m: [x_m, 0.1, z_m],
        ..machine.springs[0]
    };
    machine.springs =
        vec![spring(0.2, 0.2), spring(0.2, -0.2), spring(-0.2, 0.2), spring(-0.2, -0.2)];
    machine.dampers.clear();
    let mass_kg = machine.tub.mass_kg + machine.shaft.mass_kg + machine.drum.mass_kg;
    (machine, (32_000.0 / mass_kg).sqrt())
}

/// Computes the heights (m above equilibrium) of a heaving machine at equal intervals. The machine
/// starts at rest from the height `start_m`.
fn heights_m(machine: Machine, start_m: f64, interval_s: f64, count: u32) -> Vec<f64> {
    let end_s = interval_s * f64::from(count) * (1.0 + 1e-9);
    let zero_spin = Spin::Table { time_s: vec![0.0], speed_rpm: vec![0.0] };
    let point = prepare_point(machine, zero_spin, end_s);
    let mut initial_deviation = InitialDeviation::default();
    initial_deviation.deviations[0] = start_m;
    initial_deviation.deviations[2] = start_m;
    let method = Method::rk4(2e-5);
    let history =
        integrate_history(ModelKind::Nonlinear, &method, &point, &initial_deviation, interval_s);
    (0..history.len()).map(|k| history.instant_outputs(k).unwrap().deviations[0]).collect()
}

#[test]
fn friction_shortens_every_half_swing_by_the_same_length() {
    let (mut machine, frequency_rad_per_s) = heaving_machine();
    machine.dampers = vec![Damper {
        cabinet_m: [0.0, -0.4, 0.0],
        tub_m: [0.0, -0.1, 0.0],
        damping_n_s_per_m: 0.0,
        friction_n: 40.0,
        friction_speed_m_per_s: 1e-4,
        friction_linear_speed_m_per_s: Some(0.3),
        ..Machine::paper().dampers[0]
    }];
    let heights = heights_m(machine, 0.02, PI / frequency_rad_per_s, 7);
    assert_eq!(heights.len(), 8);
    for (n, height) in heights.iter().enumerate() {
        let amplitude_m = 0.02 - 2.0 * n as f64 * 40.0 / 32_000.0;
        let expected = if n % 2 == 0 { amplitude_m } else { -amplitude_m };
        assert!(
            (height - expected).abs() < BEARING_DEFLECTION_M,
            "half swing {n}: {height} m, not {expected} m"
        );
    }
}

#[test]
fn friction_beyond_a_free_stroke_dissipates_its_work_in_every_half_swing() {
    let (mut machine, _) = heaving_machine();
    let stiffness_n_per_m = 32_000.0;
    let friction_n = 40.0;
    let stroke_m = 0.012;
    machine.dampers = vec![Damper {
        cabinet_m: [0.0, -0.4, 0.0],
        tub_m: [0.0, -0.1, 0.0],
        damping_n_s_per_m: 0.0,
        friction_n,
        friction_speed_m_per_s: 1e-4,
        free_stroke_m: stroke_m,
        free_stroke_softness_m: 1e-5,
        ..Machine::paper().dampers[0]
    }];
    let heights = heights_m(machine, 0.02, 2e-4, 9000);
    let is_extreme = |heights: &[f64]| (heights[1] - heights[0]) * (heights[2] - heights[1]) <= 0.0;
    let extreme_heights_m: Vec<f64> =
        heights.windows(3).filter(|w| is_extreme(w)).map(|w| w[1].abs()).collect();
    // The energy lost from amplitude a to b is k (a^2 - b^2) / 2 = F (a - s) + F (b - s), without
    // the last term if it is negative.
    let next_amplitude_m = |a: f64| {
        let remaining_energy_j = stiffness_n_per_m * a * a / 2.0 - friction_n * (a - stroke_m);
        let c = remaining_energy_j + friction_n * stroke_m;
        let b = (-friction_n + (friction_n * friction_n + 2.0 * stiffness_n_per_m * c).sqrt())
            / stiffness_n_per_m;
        if b > stroke_m { b } else { (2.0 * remaining_energy_j / stiffness_n_per_m).sqrt() }
    };
    let mut expected = 0.02;
    assert!(extreme_heights_m.len() > 12, "{}", extreme_heights_m.len());
    for (n, amplitude) in extreme_heights_m.iter().enumerate() {
        expected = if expected > stroke_m { next_amplitude_m(expected) } else { expected };
        assert!(
            (amplitude - expected).abs() < 1e-5,
            "half swing {n}: {amplitude} m, not {expected} m"
        );
    }
    // The amplitude tends to the free stroke.
    let last_extreme = extreme_heights_m[extreme_heights_m.len() - 1];
    assert!(last_extreme > stroke_m && last_extreme < 1.05 * stroke_m, "{last_extreme}");
}

#[test]
fn the_linear_model_uses_the_tangent_of_a_damper_within_its_free_stroke() {
    let softness_m = 1e-3;
    let mut staged_machine = paper_machine(0.4, 80.0);
    for damper in &mut staged_machine.dampers {
        damper.friction_n = 60.0;
        damper.free_stroke_m = 0.01;
        damper.free_stroke_softness_m = softness_m;
        damper.outer_damping_n_s_per_m = 300.0;
    }
    // The engagement h at rest, where delta = -s / 2.
    let engagement = 0.5 * (1.0 - 0.005 / 0.005_f64.hypot(softness_m));
    let mut viscous_machine = paper_machine(0.4, 80.0);
    for damper in &mut viscous_machine.dampers {
        damper.damping_n_s_per_m += engagement * (300.0 + 60.0 / damper.friction_speed_m_per_s);
    }
    let spin = || Spin::Ramped { profile: Profile::Ramp, peak_rpm: 300.0, ramp_s: 1.0 };
    let [staged_machine, viscous_machine] =
        [staged_machine, viscous_machine].map(|machine| prepare_point(machine, spin(), 1.0));
    assert!(staged_machine.friction_speeds().is_empty());
    let [computed, expected] =
        [staged_machine, viscous_machine].map(|point| point.matrices(0.3, 20.0, 1.0));
    assert_eq!(computed.mass, expected.mass);
    let matrix_pairs =
        [(computed.damping, expected.damping), (computed.stiffness, expected.stiffness)];
    for (computed, expected) in matrix_pairs {
        for (computed, expected) in computed.iter().flatten().zip(expected.iter().flatten()) {
            assert!(
                (computed - expected).abs() <= 1e-9 * expected.abs().max(1.0),
                "{computed} {expected}"
            );
        }
    }
}

#[test]
fn a_closed_stop_is_a_spring_in_parallel() {
    let (mut machine, open_frequency) = heaving_machine();
    let stiffness = 32_000.0;
    let stop_stiffness = 40_000.0;
    machine.stops = vec![BumpStop {
        tub_m: [0.0, 0.1, 0.0],
        // The force does not depend on the length of the direction vector.
        direction: [0.0, 2.0, 0.0],
        clearance_m: 0.0,
        stiffness_n_per_m: stop_stiffness,
        damping_n_s_per_m: 0.0,
        softness_m: 1e-6,
    }];
    // The gap of the stop at rest is the sag of the machine. A swing that starts 20 mm below
    // equilibrium closes the gap.
    let gap_m = 9.81 / (open_frequency * open_frequency);
    let start_depth_m = 0.02;
    let closed_frequency = open_frequency * (1.0 + stop_stiffness / stiffness).sqrt();
    let centre_m = stop_stiffness * gap_m / (stiffness + stop_stiffness);
    let speed = open_frequency * (start_depth_m * start_depth_m - gap_m * gap_m).sqrt();
    let amplitude_m = (gap_m - centre_m).hypot(speed / closed_frequency);
    let half_period_s = (-gap_m / start_depth_m).acos() / open_frequency
        + (0.5 * PI - ((gap_m - centre_m) / amplitude_m).asin()) / closed_frequency;
    let heights = heights_m(machine, -start_depth_m, half_period_s, 6);
    for (n, height) in heights.iter().enumerate() {
        let expected = if n % 2 == 0 { -start_depth_m } else { centre_m + amplitude_m };
        assert!(
            (height - expected).abs() < BEARING_DEFLECTION_M,
            "half swing {n}: {height} m, not {expected} m"
        );
    }
}

#[test]
fn friction_is_equivalent_viscous_damping_in_the_linear_model() {
    let machine = machine_with_every_element();
    let mut viscous_machine = machine.clone();
    for damper in &mut viscous_machine.dampers {
        damper.damping_n_s_per_m += 4.0 * damper.friction_n / (PI * LINEAR_SPEED_M_PER_S);
        damper.friction_n = 0.0;
    }
    let spin = || Spin::Ramped { profile: Profile::Ramp, peak_rpm: 300.0, ramp_s: 1.0 };
    let [point, viscous_machine] =
        [machine, viscous_machine].map(|machine| prepare_point(machine, spin(), 1.0));
    let matrices = |point: &Point| {
        let matrices = point.matrices(0.3, 20.0, 1.0);
        (matrices.mass, matrices.damping, matrices.stiffness, matrices.force)
    };
    assert_eq!(matrices(&point), matrices(&viscous_machine));
}

#[test]
fn linear_forces_of_stops_and_bushings_are_first_order() {
    let mut machine = machine_with_every_element();
    machine.dampers.iter_mut().for_each(|damper| damper.friction_n = 0.0);
    // The stop is closed at rest, and soft enough for the first order to be a good approximation.
    machine.stops[2].clearance_m = 0.01;
    machine.stops.iter_mut().for_each(|stop| stop.softness_m = 0.05);
    let point = prepare_point(
        machine,
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
        assert!(nonlinear.stop_forces_n.iter().any(|force_n| *force_n > 100.0), "{nonlinear:?}");
        let all_forces = |forces: &crate::SuspensionForces| {
            let bushings = forces.bushing_forces_n.concat();
            [
                &forces.spring_tensions_n[..],
                &forces.stop_forces_n,
                &bushings,
                &forces.cabinet_force_n,
            ]
            .concat()
        };
        let pairs = all_forces(&nonlinear).into_iter().zip(all_forces(&linear));
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let large_difference = force_difference(1e-3);
    let small_difference = force_difference(1e-4);
    assert!(large_difference > 1e-4, "{large_difference}");
    // The difference is of second order: for a tenth of the motion it is a hundredth.
    assert!(
        (large_difference / small_difference - 100.0).abs() < 10.0,
        "{large_difference} {small_difference}"
    );
}

#[test]
fn elements_without_force_and_machines_in_other_lanes_do_not_change_bits() {
    let frictionless_machine = paper_machine(0.6, 90.0);
    let mut machine_with_friction_speed = frictionless_machine.clone();
    machine_with_friction_speed
        .dampers
        .iter_mut()
        .for_each(|d| d.friction_linear_speed_m_per_s = Some(0.2));
    let mut machine_with_friction = machine_with_friction_speed.clone();
    machine_with_friction.dampers.iter_mut().for_each(|d| d.friction_n = 60.0);
    machine_with_friction.springs.iter_mut().for_each(|s| s.cubic_n_per_m3 = 1e6);
    let spin = || Spin::Ramped { profile: Profile::Ramp, peak_rpm: 350.0, ramp_s: 1.0 };
    let [frictionless_machine, machine_with_friction_speed, machine_with_friction] =
        [frictionless_machine, machine_with_friction_speed, machine_with_friction]
            .map(|machine| prepare_point(machine, spin(), 1.5));
    let method = Method::rk4(2e-4);
    for simd in Simd::ALL.into_iter().filter(|simd| simd.is_available()) {
        let simulate_points =
            |points: &[&Point]| simulate(simd, ModelKind::Nonlinear, &method, points);
        let single_record = simulate_points(&[&frictionless_machine])[0];
        assert_eq!(single_record, simulate_points(&[&machine_with_friction_speed])[0], "{simd:?}");
        let batch_records = simulate_points(&[
            &frictionless_machine,
            &machine_with_friction,
            &machine_with_friction_speed,
            &machine_with_friction,
            &frictionless_machine,
        ]);
        assert_eq!(
            [batch_records[0], batch_records[2], batch_records[4]],
            [single_record; 3],
            "{simd:?}"
        );
        assert_eq!(
            [batch_records[1], batch_records[3]],
            [simulate_points(&[&machine_with_friction])[0]; 2],
            "{simd:?}"
        );
        assert!(
            batch_records[1].amplitudes[0] < 0.8 * single_record.amplitudes[0],
            "{batch_records:?}"
        );
    }
}

//! Tests of the energy balance of the machine without spin. Energy and losses are computed
//! independently of the equations of motion.

use super::elements::machine_with_every_element;
use super::instruments::{mass_matrix, prepare_point};
use crate::coordinates::COORDINATES;
use crate::machine::spin::{Spin, SpinState};
use crate::machine::{BumpStop, Damper, Machine};
use crate::nonlinear::coefficients::MachineCoefficients;
use crate::{InitialDeviation, InstantOutputs, Method, ModelKind, Unbalance, integrate_history};
use lane_ode::N;

type PlainVector = [f64; 3];

/// Returns the columns of Ry(yaw) Rz(pitch) (Table 1).
pub(super) fn body_axes(yaw: f64, pitch: f64) -> [PlainVector; 3] {
    let ((sy, cy), (sp, cp)) = (yaw.sin_cos(), pitch.sin_cos());
    [[cy * cp, sp, -sy * cp], [-cy * sp, cp, sy * sp], [sy, 0.0, cy]]
}

/// Returns `start` plus the sum of the components times the axes.
pub(super) fn position(
    start: PlainVector,
    axes: &[PlainVector; 3],
    components: PlainVector,
) -> PlainVector {
    std::array::from_fn(|i| start[i] + (0..3).map(|k| components[k] * axes[k][i]).sum::<f64>())
}

fn distance(a: PlainVector, b: PlainVector) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Computes the potential energy (J) at theta = 0: gravity, springs, bearings, flexure, stops,
/// bushings (model page, section 3).
fn potential_j(m: &Machine, q: &[f64; COORDINATES]) -> f64 {
    let tub_axes = body_axes(q[4], q[5]);
    let shaft_axes = body_axes(q[6], q[7]);
    let p_t = [0.0, q[0], q[1]];
    let p_s = [0.0, q[2], q[3]];
    // The drum's axes are those of the shaft, rotated by q9 about s2, then by q10.
    let drum_in_shaft = body_axes(q[8], q[9]);
    let drum_axes: [PlainVector; 3] =
        std::array::from_fn(|k| position([0.0; 3], &shaft_axes, drum_in_shaft[k]));
    let hinge_position = position(p_s, &shaft_axes, [m.drum.hinge_x_m, 0.0, 0.0]);
    let drum_point = |x_m: f64, r_m: f64, angle_deg: f64| {
        let (sin, cos) = angle_deg.to_radians().sin_cos();
        position(hinge_position, &drum_axes, [x_m - m.drum.hinge_x_m, r_m * cos, r_m * sin])
    };
    let mass_moments_kg_m = [
        m.tub.mass_kg * position(p_t, &tub_axes, [m.tub.centre_x_m, 0.0, 0.0])[1],
        m.shaft.mass_kg * position(p_s, &shaft_axes, [m.shaft.centre_x_m, 0.0, 0.0])[1],
        m.drum.mass_kg * drum_point(m.drum.centre_x_m, 0.0, 0.0)[1],
    ];
    let unbalance_mass_moment =
        |u: &Unbalance| u.mass_kg * drum_point(u.x_m, u.radius_m, u.angle_deg)[1];
    let unbalance_mass_moments = m.unbalances().map(unbalance_mass_moment);
    let mut energy_j = m.gravity_m_per_s2
        * mass_moments_kg_m.into_iter().chain(unbalance_mass_moments).sum::<f64>();
    for s in &m.springs {
        let free_length_m = s.free_length_m.unwrap_or_else(|| distance(s.cabinet_m, s.tub_m));
        let elongation = distance(position(p_t, &tub_axes, s.tub_m), s.cabinet_m) - free_length_m;
        energy_j += 0.5 * s.stiffness_n_per_m * elongation.powi(2);
        energy_j += 0.25 * s.cubic_n_per_m3 * elongation.powi(4);
    }
    let displacement = |tub_point: PlainVector| -> PlainVector {
        let cabinet_point = position(p_t, &tub_axes, tub_point);
        std::array::from_fn(|i| cabinet_point[i] - tub_point[i])
    };
    for s in &m.stops {
        // The integral of (depth + w) / 2 with w = sqrt(depth^2 + softness^2).
        let depth = depth_m(s, displacement(s.tub_m));
        let softness = s.softness_m;
        let w = depth.hypot(softness);
        let integral_of_w = depth * w + softness * softness * (depth / softness).asinh();
        energy_j += 0.25 * s.stiffness_n_per_m * (depth * depth + integral_of_w);
    }
    for b in &m.bushings {
        for (i, d) in displacement(b.tub_m).into_iter().enumerate() {
            energy_j += 0.5 * b.stiffness_n_per_m[i] * d.powi(2);
            energy_j += 0.25 * b.cubic_n_per_m3[i] * d.powi(4);
        }
    }
    let b = &m.bearings;
    for (x_m, stiffness) in
        [(b.front_x_m, b.front_stiffness_n_per_m), (b.rear_x_m, b.rear_stiffness_n_per_m)]
    {
        let tub_centre = position(p_t, &tub_axes, [x_m, 0.0, 0.0]);
        let shaft_centre = position(p_s, &shaft_axes, [x_m, 0.0, 0.0]);
        let deflection_squared =
            (shaft_centre[1] - tub_centre[1]).powi(2) + (shaft_centre[2] - tub_centre[2]).powi(2);
        energy_j += 0.5 * stiffness * deflection_squared;
    }
    let phi = (q[8].cos() * q[9].cos()).acos();
    energy_j + 0.5 * m.flexure.stiffness_n_m_per_rad * phi * phi
}

/// Returns the depth (m) of a stop's tub point.
fn depth_m(stop: &BumpStop, displacement: PlainVector) -> f64 {
    component_along(displacement, stop.direction) - stop.clearance_m
}

/// Returns the component along a direction vector of any length.
fn component_along(a: PlainVector, direction: PlainVector) -> f64 {
    (0..3).map(|i| a[i] * direction[i]).sum::<f64>() / distance(direction, [0.0; 3])
}

/// Computes the power (W) that dampers, friction, stops and bushings dissipate.
fn losses_w(
    m: &Machine,
    rest_coordinates: &[f64; COORDINATES],
    q: &[f64; COORDINATES],
    u: &[f64; COORDINATES],
) -> f64 {
    let rest_axes = body_axes(rest_coordinates[4], rest_coordinates[5]);
    let tub_axes = body_axes(q[4], q[5]);
    let tub_point = |point: PlainVector| position([0.0, q[0], q[1]], &tub_axes, point);
    // The tub's angular velocity: yaw rate about c2, pitch rate about t3.
    let angular_velocity: PlainVector = [u[5] * tub_axes[2][0], u[4], u[5] * tub_axes[2][2]];
    let velocity = |point: PlainVector| -> PlainVector {
        let arm = position([0.0; 3], &tub_axes, point);
        let rotation: PlainVector = std::array::from_fn(|i| {
            let j = (i + 1) % 3;
            let k = (i + 2) % 3;
            angular_velocity[j] * arm[k] - angular_velocity[k] * arm[j]
        });
        [rotation[0], rotation[1] + u[0], rotation[2] + u[1]]
    };
    let mut dissipated_power_w = 0.0;
    for d in &m.dampers {
        let end = tub_point(d.tub_m);
        let rest_m = distance(
            position([0.0, rest_coordinates[0], rest_coordinates[1]], &rest_axes, d.tub_m),
            d.cabinet_m,
        );
        let v =
            component_along(velocity(d.tub_m), std::array::from_fn(|i| end[i] - d.cabinet_m[i]));
        dissipated_power_w += d.damping_n_s_per_m * v * v;
        let stage_damping =
            d.friction_n / v.hypot(d.friction_speed_m_per_s) + d.outer_damping_n_s_per_m;
        dissipated_power_w +=
            engagement(d, distance(end, d.cabinet_m) - rest_m) * stage_damping * v * v;
    }
    for s in &m.stops {
        let cabinet_point = tub_point(s.tub_m);
        let depth = depth_m(s, std::array::from_fn(|i| cabinet_point[i] - s.tub_m[i]));
        let v = component_along(velocity(s.tub_m), s.direction);
        let contact_share = 0.5 * (1.0 + depth / depth.hypot(s.softness_m));
        dissipated_power_w += s.damping_n_s_per_m * contact_share * v * v;
    }
    for b in &m.bushings {
        let v = velocity(b.tub_m);
        dissipated_power_w += (0..3).map(|i| b.damping_n_s_per_m[i] * v[i] * v[i]).sum::<f64>();
    }
    dissipated_power_w
}

/// Returns the share of friction and outer damping that acts at an elongation from rest (m).
fn engagement(damper: &Damper, elongation_m: f64) -> f64 {
    let stroke_m = damper.free_stroke_m;
    if stroke_m == 0.0 {
        return 1.0;
    }
    let excess_stroke_m = (elongation_m * elongation_m - stroke_m * stroke_m) / (2.0 * stroke_m);
    0.5 * (1.0 + excess_stroke_m / excess_stroke_m.hypot(damper.free_stroke_softness_m))
}

/// Computes the kinetic energy (J) without spin, u M u / 2.
fn kinetic_j(
    machine: &MachineCoefficients<f64>,
    q: &[f64; COORDINATES],
    u: &[f64; COORDINATES],
) -> f64 {
    let zero_spin = SpinState::new((N(0.0), N(1.0)), N(0.0), N(0.0));
    let mass = mass_matrix(machine, &zero_spin, q);
    let row_sum = |i: usize| (0..COORDINATES).map(|j| u[i] * mass[i][j] * u[j]).sum::<f64>();
    0.5 * (0..COORDINATES).map(row_sum).sum::<f64>()
}

/// Returns the history of a machine without spin that starts at its equilibrium with a velocity.
fn history_from_initial_velocity(
    machine: &Machine,
    end_s: f64,
    step_s: f64,
    interval_s: f64,
) -> Vec<InstantOutputs> {
    let zero_spin = Spin::Table { time_s: vec![0.0], speed_rpm: vec![0.0] };
    let point = prepare_point(machine.clone(), zero_spin, end_s);
    // Velocities of 0.1 and 0.15 m/s, 0.5 and -0.4 rad/s give motions of some 20 mm and 40 mrad.
    let mut initial_deviation = InitialDeviation::default();
    for (tub, rotor, speed) in [(0, 2, 0.1), (1, 3, 0.15), (4, 6, 0.5), (5, 7, -0.4)] {
        (initial_deviation.speeds[tub], initial_deviation.speeds[rotor]) = (speed, speed);
    }
    let history = integrate_history(
        ModelKind::Nonlinear,
        &Method::rk4(step_s),
        &point,
        &initial_deviation,
        interval_s,
    );
    let with_full_coordinates = |k| {
        let mut instant = history.instant_outputs(k).unwrap();
        instant.deviations = std::array::from_fn(|i| point.equilibrium[i] + instant.deviations[i]);
        instant
    };
    (0..history.len()).map(with_full_coordinates).collect()
}

/// Returns the energies (J) over 10 s of the paper's machine without dampers, which starts at its
/// equilibrium with a velocity. Tub and rotor have the same velocity, which does not excite the
/// bearing modes; a step of 2e-4 s would damp these.
fn energies_j(step_s: f64) -> Vec<f64> {
    let mut machine = Machine::paper();
    machine.dampers.clear();
    let coefficients = MachineCoefficients::new(&machine);
    let instants = history_from_initial_velocity(&machine, 10.0, step_s, 0.05);
    let rest_energy_j = potential_j(&machine, &equilibrium(&machine));
    let energy = |InstantOutputs { deviations: q, speeds: u, .. }: &InstantOutputs| {
        potential_j(&machine, q) - rest_energy_j + kinetic_j(&coefficients, q, u)
    };
    instants.iter().map(energy).collect()
}

fn equilibrium(machine: &Machine) -> [f64; COORDINATES] {
    let zero_spin = Spin::Table { time_s: vec![0.0], speed_rpm: vec![0.0] };
    prepare_point(machine.clone(), zero_spin, 1.0).equilibrium
}

#[test]
fn energy_drifts_by_less_than_1e_9_in_10_s_at_the_default_step() {
    let energies = energies_j(2e-4);
    assert_eq!(energies.len(), 201);
    let drift = energies.iter().map(|e| (e / energies[0] - 1.0).abs()).fold(0.0, f64::max);
    eprintln!("energy {:.3} J, drift over 10 s at steps of 2e-4 s: {drift:.1e}", energies[0]);
    assert!(drift < 1e-9, "{drift:e}");
}

#[test]
fn the_energy_decreases_by_the_work_of_the_dissipative_elements() {
    let mut machine = machine_with_every_element();
    // The softness is wide enough for the trapezoidal rule.
    machine.stops.iter_mut().for_each(|stop| stop.softness_m = 1e-3);
    // The clearance is small enough that the motion closes the stop before friction stops it.
    machine.stops[..2].iter_mut().for_each(|stop| stop.clearance_m = 0.001);
    machine.dampers.iter_mut().for_each(|damper| damper.friction_speed_m_per_s = 0.05);
    machine.dampers[0].free_stroke_m = 0.003;
    machine.dampers[0].free_stroke_softness_m = 1e-3;
    machine.dampers[0].outer_damping_n_s_per_m = 50.0;
    machine.unbalance.angle_deg = 35.0;
    let coefficients = MachineCoefficients::new(&machine);
    let interval_s = 1e-4;
    let instants = history_from_initial_velocity(&machine, 3.0, interval_s, interval_s);
    let energy = |instant: &InstantOutputs| {
        potential_j(&machine, &instant.deviations)
            + kinetic_j(&coefficients, &instant.deviations, &instant.speeds)
    };
    let initial_energy_j = energy(&instants[0]);
    let rest_coordinates = equilibrium(&machine);
    let mut dissipated_j = 0.0;
    let mut max_error = 0.0_f64;
    for pair in instants.windows(2) {
        let [before, after] = [&pair[0], &pair[1]].map(|instant| {
            losses_w(&machine, &rest_coordinates, &instant.deviations, &instant.speeds)
        });
        dissipated_j += 0.5 * interval_s * (before + after);
        max_error = max_error.max(
            (initial_energy_j - energy(&pair[1]) - dissipated_j).abs()
                / initial_energy_j.abs().max(dissipated_j),
        );
    }
    let initial_j = kinetic_j(&coefficients, &instants[0].deviations, &instants[0].speeds);
    eprintln!(
        "{dissipated_j:.3} of {initial_j:.3} J dissipated; error of the balance {max_error:.1e}"
    );
    // Most of the energy is dissipated within 3 s.
    assert!(
        dissipated_j > 0.5 * initial_j && dissipated_j < initial_j * (1.0 + 1e-6),
        "{dissipated_j} of {initial_j} J"
    );
    assert!(max_error < 1e-6, "{max_error:e}");
    // At least one stop closes.
    let max_depth_m = |stop: &BumpStop| {
        let depth = |instant: &InstantOutputs| {
            let q = &instant.deviations;
            let cabinet_point = position([0.0, q[0], q[1]], &body_axes(q[4], q[5]), stop.tub_m);
            depth_m(stop, std::array::from_fn(|i| cabinet_point[i] - stop.tub_m[i]))
        };
        instants.iter().map(depth).fold(f64::NEG_INFINITY, f64::max)
    };
    let deepest_m = machine.stops[..2].iter().map(max_depth_m).fold(f64::NEG_INFINITY, f64::max);
    assert!(deepest_m > 1e-3, "{deepest_m} m");
}

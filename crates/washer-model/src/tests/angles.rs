//! Tests of unbalances at any angle about the drum's axis.

use super::instruments::{
    add_skew_unbalance, equations, paper_machine, prepare_point, random_machine, triangular_spin,
};
use crate::coordinates::COORDINATES;
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::MachineCoefficients;
use crate::nonlinear::elements::Elements;
use crate::nonlinear::elements::TubMotion;
use crate::{
    Damper, InitialDeviation, Machine, Method, ModelKind, Point, Spin, Unbalance,
    integrate_history, simulate,
};
use lane_ode::{Dual, N, Real, Simd};

/// Computes the position of a point of the drum in cabinet axes from its coordinates in drum axes.
fn drum_point<T: Real>(
    q: &[N<T>; COORDINATES],
    theta: N<T>,
    hinge_x_m: f64,
    position_m: [f64; 3],
) -> [N<T>; 3] {
    let rotate_about_2 =
        |(sin, cos): (N<T>, N<T>), [x, y, z]: [N<T>; 3]| [cos * x + sin * z, y, cos * z - sin * x];
    let rotate_about_3 =
        |(sin, cos): (N<T>, N<T>), [x, y, z]: [N<T>; 3]| [cos * x - sin * y, sin * x + cos * y, z];
    let [x, y, z] = position_m.map(|component| theta.lit(component));
    let from_hinge = rotate_about_3(q[9].sin_cos(), [x - hinge_x_m, y, z]);
    let [x, y, z] = rotate_about_2(q[8].sin_cos(), from_hinge);
    let (sin, cos) = theta.sin_cos();
    let tub_position = [x + hinge_x_m, cos * y - sin * z, sin * y + cos * z];
    let [x, y, z] = rotate_about_2(q[6].sin_cos(), rotate_about_3(q[7].sin_cos(), tub_position));
    [x, y + q[2], z + q[3]]
}

/// Checks that a point mass m at p adds m (p'' + g) . dp/dq to M a - f, for random machines.
#[test]
fn an_unbalance_at_an_angle_is_a_point_mass() {
    let mut rng = fastrand::Rng::with_seed(81);
    let mut max_error = 0.0_f64;
    for _ in 0..100 {
        let mut machine = random_machine(&mut rng);
        if rng.bool() {
            add_skew_unbalance(&mut machine, &mut rng);
        }
        let added_unbalance = Unbalance {
            mass_kg: 0.1 + rng.f64(),
            x_m: 0.1 + 0.3 * rng.f64(),
            radius_m: 0.1 + 0.2 * rng.f64(),
            angle_deg: 360.0 * rng.f64(),
        };
        let mut heavier_machine = machine.clone();
        heavier_machine.further_unbalances.push(added_unbalance);
        let mut random_within = |size: f64| size * (2.0 * rng.f64() - 1.0);
        let [angle, speed, acceleration] =
            [random_within(3.0), random_within(130.0), random_within(10.0)];
        let spin = SpinState::new(N(angle).sin_cos(), N(speed), N(acceleration));
        let mut random_vector =
            |size: f64| -> [f64; COORDINATES] { core::array::from_fn(|_| random_within(size)) };
        let [q, u, a] = [random_vector(0.05), random_vector(0.5), random_vector(20.0)];
        let residual = |machine: &Machine| {
            let coefficients = MachineCoefficients::new(machine);
            let [inertia, force] = equations(&coefficients, &spin, &q.map(N), &u.map(N), &a.map(N));
            let residual: [f64; COORDINATES] = core::array::from_fn(|i| (inertia[i] - force[i]).0);
            residual
        };
        let [residual_without, residual_with] = [residual(&machine), residual(&heavier_machine)];
        let (sin, cos) = added_unbalance.angle_deg.to_radians().sin_cos();
        let position_m =
            [added_unbalance.x_m, added_unbalance.radius_m * cos, added_unbalance.radius_m * sin];
        let hinge_x_m = machine.drum.hinge_x_m;
        let twice_dual = |value: f64, rate: f64, second_derivative: f64| {
            let slope = Dual { value: rate, slope: second_derivative };
            N(Dual { value: Dual { value, slope: rate }, slope })
        };
        let moving_q = core::array::from_fn(|i| twice_dual(q[i], u[i], a[i]));
        let theta = twice_dual(angle, speed, acceleration);
        let mut accelerations = drum_point(&moving_q, theta, hinge_x_m, position_m)
            .map(|coordinate| coordinate.0.slope.slope);
        accelerations[1] += machine.gravity_m_per_s2;
        let max_force =
            residual_with.iter().fold(0.0_f64, |max_force, force| max_force.max(force.abs()));
        for r in 0..COORDINATES {
            let shifted_q = core::array::from_fn(|i| {
                N(Dual { value: q[i], slope: if i == r { 1.0 } else { 0.0 } })
            });
            let position_derivative =
                drum_point(&shifted_q, N(Dual { value: angle, slope: 0.0 }), hinge_x_m, position_m);
            let power: f64 =
                (0..3).map(|i| accelerations[i] * position_derivative[i].0.slope).sum();
            let error = residual_with[r] - residual_without[r] - added_unbalance.mass_kg * power;
            max_error = max_error.max(error.abs() / max_force);
        }
    }
    eprintln!("a point mass at an angle: within {max_error:.1e} of the largest force");
    assert!(max_error < 1e-13, "{max_error:e}");
}

#[test]
fn quarter_turns_are_exact() {
    let unbalance_at =
        |radius_m, angle_deg| Unbalance { radius_m, angle_deg, ..Unbalance::default() };
    assert_eq!(unbalance_at(0.2, 0.0).position_m(), [0.2, 0.0]);
    assert_eq!(unbalance_at(0.2, 90.0).position_m(), [0.0, 0.2]);
    assert_eq!(unbalance_at(0.2, -90.0).position_m(), [0.0, -0.2]);
    assert_eq!(unbalance_at(0.2, 180.0).position_m(), unbalance_at(-0.2, 0.0).position_m());
    assert_eq!(unbalance_at(0.2, 270.0).position_m(), [0.0, -0.2]);
    let [y, z] = unbalance_at(0.2, 150.0).position_m();
    assert!((y + 0.1 * 3.0_f64.sqrt()).abs() < 1e-16 && (z - 0.1).abs() < 1e-16, "{y} {z}");
}

#[test]
fn a_mirrored_machine_that_turns_backwards_moves_mirrored() {
    let mut rng = fastrand::Rng::with_seed(82);
    let mut machine = random_machine(&mut rng);
    add_skew_unbalance(&mut machine, &mut rng);
    let simulate_deviations = |machine: &Machine, rpm: f64| -> Vec<[f64; COORDINATES]> {
        let spin = Spin::Table { time_s: vec![0.0, 2.0], speed_rpm: vec![0.0, rpm] };
        let point = prepare_point(machine.clone(), spin, 2.0);
        let method = Method::rk4(2e-4);
        let history = integrate_history(
            ModelKind::Nonlinear,
            &method,
            &point,
            &InitialDeviation::default(),
            0.1,
        );
        (0..history.len()).map(|k| history.instant_outputs(k).unwrap().deviations).collect()
    };
    let [forwards, mirrored] =
        [simulate_deviations(&machine, 300.0), simulate_deviations(&machine.mirrored(), -300.0)];
    // The mirror reverses translations along z and rotations about y.
    let mirror_signs = [1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0];
    for (k, (forward, backward)) in forwards.iter().zip(&mirrored).enumerate() {
        for i in 0..COORDINATES {
            let error = (forward[i] - mirror_signs[i] * backward[i]).abs();
            assert!(error < 1e-12, "instant {k}, q{}: {} {}", i + 1, forward[i], backward[i]);
        }
    }
}

#[test]
fn an_unbalance_at_an_angle_in_other_lanes_does_not_change_the_bits() {
    let mut rotated_unbalance = paper_machine(0.6, 90.0);
    rotated_unbalance.unbalance.angle_deg = 40.0;
    let [reference, rotated_unbalance] = [paper_machine(0.6, 90.0), rotated_unbalance]
        .map(|m| prepare_point(m, triangular_spin(), 1.5));
    for model in [ModelKind::Nonlinear, ModelKind::Linear] {
        for simd in Simd::ALL.into_iter().filter(|simd| simd.is_available()) {
            let simulate_points =
                |points: &[&Point]| simulate(simd, model, &Method::rk4(2e-4), points);
            let batch_records = simulate_points(&[
                &reference,
                &rotated_unbalance,
                &reference,
                &rotated_unbalance,
                &reference,
            ]);
            let single_record = simulate_points(&[&reference])[0];
            assert_eq!(
                [batch_records[0], batch_records[2], batch_records[4]],
                [single_record; 3],
                "{model:?} {simd:?}"
            );
            assert_eq!(
                [batch_records[1], batch_records[3]],
                [simulate_points(&[&rotated_unbalance])[0]; 2],
                "{model:?} {simd:?}"
            );
        }
    }
}

#[test]
fn slopes_of_dampers_in_two_stages_are_derivatives_of_their_force() {
    let mut machine = paper_machine(0.4, 50.0);
    machine.dampers[0] = Damper {
        friction_n: 60.0,
        free_stroke_m: 0.004,
        free_stroke_softness_m: 1e-3,
        outer_damping_n_s_per_m: 80.0,
        ..machine.dampers[0]
    };
    let elements = Elements::new(&machine);
    let motion_at_rest = TubMotion::new(&[N(0.0); 4], &[N(0.0); 4]);
    let motions = elements.corner_motions(&motion_at_rest);
    let force_at = |elongation_m: f64, speed: f64| {
        let mut shifted_motions = motions.clone();
        shifted_motions[0] = [shifted_motions[0][0] + elongation_m, N(speed)];
        let mut forces = Vec::new();
        elements.append_corner_forces(&shifted_motions, &mut forces);
        forces[0]
    };
    for elongation_m in [-0.006, -0.0041, 0.0, 0.001, 0.0038, 0.005] {
        for speed in [-0.2, -0.004, 0.03] {
            let force = force_at(elongation_m, speed);
            let difference_step = 1e-7;
            let force_per_depth = (force_at(elongation_m + difference_step, speed).force
                - force_at(elongation_m - difference_step, speed).force)
                .0
                / (2.0 * difference_step);
            let force_per_speed = (force_at(elongation_m, speed + difference_step).force
                - force_at(elongation_m, speed - difference_step).force)
                .0
                / (2.0 * difference_step);
            assert!(
                (force.force_per_depth.0 - force_per_depth).abs()
                    < 1e-3 + 1e-5 * force_per_depth.abs()
            );
            assert!(
                (force.force_per_speed.0 - force_per_speed).abs()
                    < 1e-3 + 1e-5 * force_per_speed.abs()
            );
            // The force opposes the motion.
            assert!(force.force.0 * speed <= 0.0);
        }
    }
}

//! Tests of the linear model against automatic differentiation of the nonlinear equations of
//! motion, for random machines at random spins.

use super::instruments::{
    add_skew_unbalance, equations, paper_machine, prepare_point, random_machine,
};
use crate::coordinates::{COORDINATES, STATES};
use crate::lanes::ToDual as _;
use crate::machine::spin::SpinState;
use crate::nonlinear::coupling::Coupling;
use crate::nonlinear::outputs::{BodyAxes, MovingCoordinates, RADIAL_COMPONENTS};
use crate::point::Point;
use crate::run::model::{LaneModel, LinearModel, NonlinearModel};
use crate::{Channel, ModelKind, PointEquations, Spin};
use lane_ode::{Dual, N, System};

/// The number of random machines, each at one instant.
const INSTANT_COUNT: usize = 100;

type CoordinateVector = [f64; COORDINATES];

/// The linear model of a machine at a time of its spin.
struct LinearModelAtInstant {
    point: Point,
    t_s: f64,
    model: LinearModel<f64>,
    spin: SpinState<f64>,
}

impl LinearModelAtInstant {
    fn random(rng: &mut fastrand::Rng) -> Self {
        let mut random_rpm = || 1200.0 * (2.0 * rng.f64() - 1.0);
        let spin =
            Spin::Table { time_s: vec![0.0, 10.0], speed_rpm: vec![random_rpm(), random_rpm()] };
        let mut machine = random_machine(rng);
        if rng.bool() {
            add_skew_unbalance(&mut machine, rng);
        }
        let point = prepare_point(machine, spin, 10.0);
        let model = LinearModel::splat(N(0.0), &point, Coupling::Springs);
        let t_s = 10.0 * rng.f64();
        let spin = NonlinearModel::splat(N(0.0), &point, Coupling::Springs).forcing(N(t_s));
        Self { point, t_s, model, spin }
    }

    /// Computes M a - f at equilibrium, and its derivative along deviations `q`, speeds `u` and
    /// accelerations `a`.
    fn residual(
        &self,
        q: &CoordinateVector,
        u: &CoordinateVector,
        a: &CoordinateVector,
    ) -> [CoordinateVector; 2] {
        let dual = |value: f64, slope: f64| N(Dual { value, slope });
        let dual_q: [_; COORDINATES] =
            core::array::from_fn(|i| dual(self.point.equilibrium[i], q[i]));
        let [u, a] = [u, a].map(|v| v.map(|v| dual(0.0, v)));
        let [inertia, force] =
            equations(&self.point.machine.constant(), &self.spin.constant(), &dual_q, &u, &a);
        let residual: [_; COORDINATES] = core::array::from_fn(|i| inertia[i] - force[i]);
        [residual.map(|r| r.0.value), residual.map(|r| r.0.slope)]
    }
}

/// Calls `check` at random instants of random machines.
fn check_random_instants(
    seed: u64,
    mut check: impl FnMut(&LinearModelAtInstant, &mut fastrand::Rng),
) {
    let mut rng = fastrand::Rng::with_seed(seed);
    for _ in 0..INSTANT_COUNT {
        let instant = LinearModelAtInstant::random(&mut rng);
        check(&instant, &mut rng);
    }
}

/// Returns random numbers between -size and size.
fn random_vector(rng: &mut fastrand::Rng, size: f64) -> CoordinateVector {
    core::array::from_fn(|_| size * (2.0 * rng.f64() - 1.0))
}

const ZERO_VECTOR: CoordinateVector = [0.0; COORDINATES];

#[test]
fn matrices_are_the_derivatives_of_the_nonlinear_equations() {
    let mut max_errors = [0.0_f64; 4];
    check_random_instants(21, |instant, _| {
        let SpinState { sin, cos, speed, acceleration, .. } = instant.spin;
        let computed_matrices = instant.point.matrices(sin.0.atan2(cos.0), speed.0, acceleration.0);
        let [mut mass, mut damping, mut stiffness] = [[[0.0; COORDINATES]; COORDINATES]; 3];
        let mut force = ZERO_VECTOR;
        for j in 0..COORDINATES {
            let mut unit_vector = ZERO_VECTOR;
            unit_vector[j] = 1.0;
            let [at_rest, by_a] = instant.residual(&ZERO_VECTOR, &ZERO_VECTOR, &unit_vector);
            let [_, by_u] = instant.residual(&ZERO_VECTOR, &unit_vector, &ZERO_VECTOR);
            let [_, by_q] = instant.residual(&unit_vector, &ZERO_VECTOR, &ZERO_VECTOR);
            for i in 0..COORDINATES {
                mass[i][j] = by_a[i];
                damping[i][j] = by_u[i];
                stiffness[i][j] = by_q[i];
                force[i] = -at_rest[i];
            }
        }
        let matrices = [
            (computed_matrices.mass, mass),
            (computed_matrices.damping, damping),
            (computed_matrices.stiffness, stiffness),
        ];
        for (kind, (computed_matrices, expected)) in matrices.into_iter().enumerate() {
            let max_magnitude = expected.iter().flatten().fold(0.0_f64, |m, a| m.max(a.abs()));
            let entry_pairs = computed_matrices.iter().flatten().zip(expected.iter().flatten());
            max_errors[kind] = entry_pairs
                .fold(max_errors[kind], |m, (a, b)| m.max((a - b).abs() / max_magnitude));
        }
        // The entries of F may be far below the weight, of which they are differences.
        let bodies = &instant.point.machine.bodies;
        let weight_n = bodies.gravity.0 * bodies.rotor_mass.0;
        let max_magnitude = force.iter().fold(weight_n, |m, a| m.max(a.abs()));
        let entry_pairs = computed_matrices.force.iter().zip(&force);
        max_errors[3] =
            entry_pairs.fold(max_errors[3], |m, (a, b)| m.max((a - b).abs() / max_magnitude));
    });
    let [m, c, k, f] = max_errors;
    eprintln!(
        "against automatic differentiation: M {m:.1e}, C {c:.1e}, K {k:.1e}, F {f:.1e} of the \
         largest entry"
    );
    assert!(m < 1e-14 && c < 1e-14 && k < 1e-14 && f < 1e-10);
}

#[test]
fn accelerations_solve_the_expanded_equations() {
    let mut max_error = 0.0_f64;
    check_random_instants(22, |instant, rng| {
        let mut q = random_vector(rng, 0.02);
        let u = random_vector(rng, 0.5);
        // Shaft and tub differ by a small deflection of the bearings.
        for (rotor, tub) in [(2, 0), (3, 1), (6, 4), (7, 5)] {
            q[rotor] = q[tub] + 1e-5 * (rng.f64() - 0.5);
        }
        let x: [N<f64>; STATES] =
            core::array::from_fn(|i| N(if i < COORDINATES { q[i] } else { u[i - COORDINATES] }));
        let dx = instant.model.derivative(&instant.model.forcing(N(instant.t_s)), &x);
        let a: CoordinateVector = core::array::from_fn(|i| dx[COORDINATES + i].0);
        let [at_rest, slope] = instant.residual(&q, &u, &a);
        let force_scale = instant.residual(&q, &u, &ZERO_VECTOR)[1];
        let force_scale =
            (0..COORDINATES).fold(0.0_f64, |m, i| m.max((at_rest[i] + force_scale[i]).abs()));
        for i in 0..COORDINATES {
            assert_eq!(dx[i].0, u[i]);
            max_error = max_error.max((at_rest[i] + slope[i]).abs() / force_scale);
        }
    });
    eprintln!("M q'' + C q' + K q - F: at most {max_error:.1e} of the largest force");
    assert!(max_error < 1e-10, "{max_error:e}");
}

#[test]
fn outputs_are_the_first_order_of_the_nonlinear_outputs() {
    // The greatest errors of values, rates and second derivatives.
    let mut max_errors = [0.0_f64; 3];
    let mut max_rest_value = 0.0_f64;
    check_random_instants(23, |instant, rng| {
        let [q, u, a] = [0.02, 0.5, 20.0].map(|size| random_vector(rng, size));
        let join_state =
            |first: &CoordinateVector, second: &CoordinateVector| -> [N<f64>; STATES] {
                core::array::from_fn(|i| N([first, second][i / COORDINATES][i % COORDINATES]))
            };
        let forcing = instant.model.forcing(N(instant.t_s));
        let (radial_position, channels) =
            instant.model.observe(&forcing, &join_state(&q, &u), &join_state(&u, &a), true);
        let dual = |value: f64, slope: f64| N(Dual { value, slope });
        let dual_q = core::array::from_fn(|i| dual(instant.point.equilibrium[i], q[i]));
        let [u, a] = [u, a].map(|v| v.map(|v| dual(0.0, v)));
        let motion = MovingCoordinates { q: dual_q, u, a };
        let bodies = instant.point.machine.bodies.constant();
        let axes = BodyAxes::new(&instant.spin.constant(), &motion);
        let spin_squared = instant.spin.speed.0.powi(2) + instant.spin.acceleration.0.abs();
        let scales = [1.0, 1.0 + spin_squared.sqrt(), 1.0 + spin_squared];
        // Channels are deviations from equilibrium; the radial distance is not.
        let channel_rest_values =
            instant.point.channel_rest_values.into_iter().chain([0.0; RADIAL_COMPONENTS]);
        let computed = channels.unwrap().into_iter().chain(radial_position);
        let expected = axes
            .channels(&bodies, &motion)
            .into_iter()
            .chain(axes.radial_position(&bodies, &motion));
        for ((computed, expected), channel_rest_values) in
            computed.zip(expected).zip(channel_rest_values)
        {
            let order_zero = expected.value.0.value - channel_rest_values;
            let sampled_values = [
                (computed.value.0, order_zero + expected.value.0.slope),
                (computed.slope.0, expected.slope.0.value + expected.slope.0.slope),
                (computed.curvature.0, expected.curvature.0.value + expected.curvature.0.slope),
            ];
            for (k, (computed, expected)) in sampled_values.into_iter().enumerate() {
                max_errors[k] = max_errors[k].max((computed - expected).abs() / scales[k]);
            }
            max_rest_value = max_rest_value.max(order_zero.abs());
        }
    });
    eprintln!(
        "linear outputs at deviations of 20 mm and 20 mrad: within {:.1e} m or rad, with a part \
         of order zero up to {max_rest_value:.1e}; \
         rates and second derivatives within {:.1e} and {:.1e} of what the spin makes of 1 m",
        max_errors[0], max_errors[1], max_errors[2]
    );
    assert!(max_errors.iter().all(|max_error| *max_error < 1e-14), "{max_errors:?}");
    assert!(max_rest_value > 5e-3, "{max_rest_value:e}");
}

#[test]
fn outputs_of_order_zero_turn_with_the_drum() {
    // Unbalance mass (kg), motion of the mass centre (mm) and of the drum's front (micrometres),
    // from an independent program: linear histories of these two machines, with and without the
    // part of order zero.
    for (unbalance_mass_kg, centre_mm, front_um) in [(0.4, 4.960, 47.96), (0.7, 8.600, 56.86)] {
        let machine = paper_machine(unbalance_mass_kg, 140.0);
        let mass_kg =
            machine.tub.mass_kg + machine.shaft.mass_kg + machine.drum.mass_kg + unbalance_mass_kg;
        let [drum_kg, drum_x_m] = [machine.drum.mass_kg, machine.drum.centre_x_m];
        let [hinge_x_m, front_x_m] = [machine.drum.hinge_x_m, machine.drum.front_x_m];
        let unbalance = machine.unbalance;
        // The drum makes one turn per second.
        let spin = Spin::Table { time_s: vec![0.0, 1.0], speed_rpm: vec![60.0, 60.0] };
        let point = prepare_point(machine, spin, 1.0);
        let mut equations = PointEquations::new(&point, ModelKind::Linear);
        let mut channel_at =
            |t_s: f64, channel: Channel| equations.channels(t_s, &[0.0; STATES]).0[channel.index()];
        // The weight tilts the shaft by q8 and bends the hinge by q10. The bend turns with the
        // drum.
        let shaft_cosine = point.equilibrium[7].cos();
        let hinge_angle = point.equilibrium[9];
        let axial_moment =
            drum_kg * (drum_x_m - hinge_x_m) + unbalance_mass_kg * (unbalance.x_m - hinge_x_m);
        let radial_moment = unbalance_mass_kg * unbalance.radius_m;
        let centre_m =
            (radial_moment * hinge_angle.cos() + axial_moment * hinge_angle.sin()) / mass_kg;
        let front_m = (front_x_m - hinge_x_m) * hinge_angle.sin();
        for (y, z, radius_m) in [
            (Channel::TotalCentreY, Channel::TotalCentreZ, centre_m),
            (Channel::DrumFrontY, Channel::DrumFrontZ, front_m),
        ] {
            for (t_s, expected_y, expected_z) in [
                (0.0, 0.0, 0.0),
                (0.25, -radius_m * shaft_cosine, radius_m),
                (0.5, -2.0 * radius_m * shaft_cosine, 0.0),
                (0.75, -radius_m * shaft_cosine, -radius_m),
            ] {
                assert!(
                    (channel_at(t_s, y) - expected_y).abs() < 1e-15,
                    "{y:?} at {t_s} s: {}",
                    channel_at(t_s, y)
                );
                assert!(
                    (channel_at(t_s, z) - expected_z).abs() < 1e-15,
                    "{z:?} at {t_s} s: {}",
                    channel_at(t_s, z)
                );
            }
        }
        for channel in [Channel::TubFrontY, Channel::TubFrontZ, Channel::TubYaw, Channel::TubPitch]
        {
            assert_eq!(channel_at(0.5, channel), 0.0);
        }
        // After half a turn the front of the drum is higher, because the bend of the hinge by the
        // weight has turned.
        for (channel, expected_m) in
            [(Channel::TotalCentreY, -1e-3 * centre_mm), (Channel::DrumFrontY, 1e-6 * front_um)]
        {
            let displacement_m = channel_at(0.5, channel);
            assert!(
                (displacement_m / expected_m - 1.0).abs() < 1e-3,
                "{channel:?}: {displacement_m} for {expected_m}"
            );
        }
    }
}

#[test]
fn the_models_differ_by_second_order_in_the_deviation() {
    // For half the deviation the remainder of M a = f is a quarter.
    let mut orders = Vec::new();
    check_random_instants(24, |instant, rng| {
        let q = random_vector(rng, 1.0);
        let u = random_vector(rng, 10.0);
        let a = random_vector(rng, 100.0);
        let remainder = |size: f64| {
            let [q, u, a] = [&q, &u, &a].map(|v| v.map(|v| size * v));
            let [at_rest, slope] = instant.residual(&q, &u, &a);
            let full_q = core::array::from_fn(|i| N(instant.point.equilibrium[i] + q[i]));
            let [inertia, force] =
                equations(&instant.point.machine, &instant.spin, &full_q, &u.map(N), &a.map(N));
            let difference = |i: usize| (inertia[i] - force[i]).0 - at_rest[i] - slope[i];
            (0..COORDINATES).fold(0.0_f64, |m, i| m.max(difference(i).abs()))
        };
        orders.push((remainder(2e-3) / remainder(1e-3)).log2());
    });
    let (min_order, max_order) =
        orders.iter().fold((f64::INFINITY, 0.0_f64), |(l, g), &s| (l.min(s), g.max(s)));
    eprintln!("order of the remainder: {min_order:.3} to {max_order:.3}");
    assert!((1.9..2.1).contains(&min_order) && (1.9..2.1).contains(&max_order));
}

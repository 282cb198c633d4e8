//! Common functions of the tests: random machines, and the equations of motion as M a and f.

use crate::coordinates::COORDINATES;
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::MachineCoefficients;
use crate::nonlinear::equilibrium;
use crate::nonlinear::floating::FloatingChain;
use crate::nonlinear::{Half, Halves, assemble_coupled_halves};
use crate::point::Point;
use crate::{
    Gauge, Machine, MachineParameter, Profile, Recorders, Spin, Target, Timing, Unbalance, prepare,
};
use lane_ode::{Lane, N, Real, Simd};

/// All recorders.
pub(super) const ALL_RECORDERS: Recorders = Recorders {
    with_root_mean_squares: true,
    with_turns: true,
    gauges: [true; Gauge::ALL.len()],
    with_checkpoints: true,
    with_snapshots: true,
};

/// Returns the spin of the paper's Fig. 12.
pub(super) fn triangular_spin() -> Spin {
    Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 }
}

/// Returns the paper's machine with another unbalance mass and damping.
pub(super) fn paper_machine(unbalance_mass_kg: f64, damping_n_s_per_m: f64) -> Machine {
    let mut machine = Machine::paper();
    machine.unbalance.mass_kg = unbalance_mass_kg;
    machine.dampers.iter_mut().for_each(|d| d.damping_n_s_per_m = damping_n_s_per_m);
    machine
}

/// Returns a random machine whose numbers are within a fifth of the paper's, and which is valid and
/// has a static equilibrium.
pub(super) fn random_machine(rng: &mut fastrand::Rng) -> Machine {
    loop {
        let mut machine = Machine::paper();
        let mut spin = triangular_spin();
        for parameter in MachineParameter::all(&machine, &spin) {
            if parameter.target() == Target::Machine
                && let Some(value) = parameter.get(&machine, &spin)
            {
                parameter.set(&mut machine, &mut spin, value * (0.8 + 0.4 * rng.f64()));
            }
        }
        if machine.violations().is_empty()
            && equilibrium::solve_equilibrium(N(0.0), &MachineCoefficients::new(&machine)).1 & 1
                == 1
        {
            return machine;
        }
    }
}

/// Rotates the unbalance of a machine about the axis, and adds an unbalance in another plane.
pub(super) fn add_skew_unbalance(machine: &mut Machine, rng: &mut fastrand::Rng) {
    let mut angle_deg = || 360.0 * (2.0 * rng.f64() - 1.0);
    machine.unbalance.angle_deg = angle_deg();
    let angle_deg = angle_deg();
    machine.further_unbalances.push(Unbalance {
        mass_kg: 0.5 * machine.unbalance.mass_kg,
        x_m: machine.drum.hinge_x_m,
        angle_deg,
        ..machine.unbalance
    });
}

/// Returns a random spin of one of four kinds.
pub(super) fn random_spin(rng: &mut fastrand::Rng, kind: usize, end_s: f64) -> Spin {
    let peak_rpm = 200.0 + 400.0 * rng.f64();
    let ramp_s = end_s * (0.3 + 0.4 * rng.f64());
    match kind % 4 {
        0 => Spin::Ramped { profile: Profile::Cycloidal, peak_rpm, ramp_s },
        1 => Spin::Ramped { profile: Profile::Triangular, peak_rpm, ramp_s },
        2 => Spin::Ramped { profile: Profile::Ramp, peak_rpm: -peak_rpm, ramp_s },
        _ => Spin::Table {
            time_s: vec![0.0, 0.4 * ramp_s, ramp_s],
            speed_rpm: vec![100.0, peak_rpm, 50.0],
        },
    }
}

/// Prepares the point of a machine and a spin.
pub(super) fn prepare_point(machine: Machine, spin: Spin, end_s: f64) -> Point {
    let timing = Timing { end_s, window_s: [0.0, end_s], checkpoints: 0 };
    prepare(Simd::Scalar, &[(machine, spin)], &timing).remove(0).unwrap()
}

/// Computes M a of a half: y and z of its midpoint, then its rotations.
fn inertia_forces<T: Real, const R: usize>(
    half: &Half<T, R>,
    midpoint: [N<T>; 2],
    rotation: [N<T>; R],
) -> ([N<T>; 2], [N<T>; R]) {
    let FloatingChain { inverse_mass, arm, .. } = &half.chain;
    let mut force = midpoint;
    for i in 0..2 {
        for r in 0..R {
            force[i] += arm[r][i] * rotation[r];
        }
        force[i] = force[i] / *inverse_mass;
    }
    let mut torques = rotation;
    for r in 0..R {
        torques[r] = arm[r][0] * force[0] + arm[r][1] * force[1];
        for s in 0..R {
            torques[r] += half.inertia[r.max(s)][r.min(s)] * rotation[s];
        }
    }
    (force, torques)
}

/// Computes M a and f of the equations M a = f of both halves with their loads.
pub(super) fn loaded_equations<T: Real>(
    halves: &Halves<T>,
    a: &[N<T>; COORDINATES],
) -> [[N<T>; COORDINATES]; 2] {
    let ([i1, i2], [i5, i6]) = inertia_forces(&halves.tub, [a[0], a[1]], [a[4], a[5]]);
    let ([i3, i4], [i7, i8, i9, i10]) =
        inertia_forces(&halves.rotor, [a[2], a[3]], [a[6], a[7], a[8], a[9]]);
    let ([f1, f2], [f5, f6]) = halves.tub.chain.generalised_forces();
    let ([f3, f4], [f7, f8, f9, f10]) = halves.rotor.chain.generalised_forces();
    [[i1, i2, i3, i4, i5, i6, i7, i8, i9, i10], [f1, f2, f3, f4, f5, f6, f7, f8, f9, f10]]
}

/// Computes M(q, theta) a and f(q, u, theta, theta', theta'') of the nonlinear equations M a = f.
pub(super) fn equations<T: Lane>(
    machine: &MachineCoefficients<T>,
    spin: &SpinState<T>,
    q: &[N<T>; COORDINATES],
    u: &[N<T>; COORDINATES],
    a: &[N<T>; COORDINATES],
) -> [[N<T>; COORDINATES]; 2] {
    loaded_equations(&assemble_coupled_halves(machine, spin, q, u), a)
}

/// Computes the mass matrix of the nonlinear model by columns from unit accelerations.
pub(super) fn mass_matrix(
    machine: &MachineCoefficients<f64>,
    spin: &SpinState<f64>,
    q: &[f64; COORDINATES],
) -> [[f64; COORDINATES]; COORDINATES] {
    let q = q.map(N);
    let zeros = [N(0.0); COORDINATES];
    let mut matrix = [[0.0; COORDINATES]; COORDINATES];
    for j in 0..COORDINATES {
        let mut unit_acceleration = zeros;
        unit_acceleration[j] = N(1.0);
        let [column, _] = equations(machine, spin, &q, &zeros, &unit_acceleration);
        for i in 0..COORDINATES {
            matrix[i][j] = column[i].0;
        }
    }
    matrix
}

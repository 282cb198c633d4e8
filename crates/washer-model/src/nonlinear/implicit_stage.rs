//! The equations of motion for the implicit part of the additive Runge-Kutta method, in which the
//! springs of bearings and hinge are evaluated at the end of a stage.
//!
//! A stage solves k = f(q, u) + f_springs(r + g k) for its derivative k = (u, a), where r is the
//! known part of the state and g the implicit coefficient times the step. At the stage's end u =
//! r_u + g a and q = r_q + g r_u + g^2 a. The springs are linearised about a nearby state. This
//! leaves the hinge's inertia J + g^2 K_D and a 4x4 system for the bearings' load, which is the
//! system of section 4.3 of the model page with 1 / g for both caps.

use crate::coordinates::{COORDINATES, HINGE_PITCH, HINGE_YAW, STATES};
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::MachineCoefficients;
use crate::nonlinear::coupling::{accelerations_under_load, mass_scaled_load};
use crate::nonlinear::floating::LdltFactors;
use crate::nonlinear::forces::Deflection;
use crate::nonlinear::{assemble_rotor_in_lanes, assemble_tub};
use lane_ode::{Lane, N};

/// Computes the stage's derivative k. The springs are evaluated at r + g k with `g` in s, all other
/// forces and the inertia at coordinates `q` (m, rad) and speeds `u`.
#[inline(always)]
pub(crate) fn solve_implicit_stage<T: Lane>(
    machine: &MachineCoefficients<T>,
    spin: &SpinState<T>,
    q: &[N<T>; COORDINATES],
    u: &[N<T>; COORDINATES],
    r: &[N<T>; STATES],
    g: N<T>,
) -> [N<T>; STATES] {
    let b = &machine.bodies;
    let mut tub = assemble_tub(machine, q, u);
    let mut rotor = assemble_rotor_in_lanes(b, spin, q, u);
    // The known part of the coordinates' change from `q` to the end of the stage. The unknown part
    // is g^2 times the accelerations.
    let mut coordinate_change = *q;
    for i in 0..COORDINATES {
        coordinate_change[i] = r[i] + g * r[COORDINATES + i] - q[i];
    }
    let g_squared = (g * g).v();
    for (index, i) in [(2, HINGE_YAW), (3, HINGE_PITCH)] {
        rotor.inertia[index][index] += g_squared * b.flexure_stiffness;
        rotor.chain.torque[index] -= b.flexure_stiffness * coordinate_change[i];
    }
    let mut deflection = Deflection::new(q, &tub.tilt, &rotor.tilt);
    let deflection_change =
        Deflection::from_linear_model(&coordinate_change, &tub.chain.axis, &rotor.chain.axis);
    for i in 0..2 {
        deflection.offset[i] += deflection_change.offset[i];
        deflection.tilt[i] += deflection_change.tilt[i];
    }
    // The bearings' deflection at the stage's end depends on the generalised accelerations, not on
    // the drift of the axes, their acceleration at constant generalised speeds.
    let zero = g.lit(0.0);
    tub.chain.axis_drift = [zero; 2];
    rotor.chain.axis_drift = [zero; 2];
    let no_sag = Deflection { offset: [zero; 2], tilt: [zero; 2] };
    let tub_factors = LdltFactors::new(tub.inertia);
    let rotor_factors = LdltFactors::new(rotor.inertia);
    let tub = &tub.chain;
    let rotor = &rotor.chain;
    let tub_response = tub.axis_response(&tub_factors);
    let rotor_response = rotor.axis_response(&rotor_factors);
    // The system is that of modes capped at 1 / g (rad/s), at standstill.
    let squares_of_cap_and_speed = (g_squared.recip(), zero);
    let shaft_load = mass_scaled_load(
        b,
        squares_of_cap_and_speed,
        &deflection,
        &no_sag,
        &tub_response,
        &rotor_response,
    );
    let a = accelerations_under_load((tub, &tub_factors), (rotor, &rotor_factors), &shaft_load);
    let mut k = *r;
    for i in 0..COORDINATES {
        k[i] = r[COORDINATES + i] + g * a[i];
        k[COORDINATES + i] = a[i];
    }
    k
}

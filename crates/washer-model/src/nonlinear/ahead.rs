//! The equations with the springs of bearings and hinge at a state ahead: what the additive method
//! takes implicitly.
//!
//! With k = (u, a) for the derivative, the state ahead has u = r_u + g a and q = r_q + g r_u + g^2
//! a. The springs, linear about a state nearby, leave J + g^2 K_D for the hinge's inertia and one
//! system of four for the bearings' load: those of section 4.3 of the model page, with 1 / g in
//! place of both caps.

use crate::coordinates::{COORDINATES, HINGE_PITCH, HINGE_YAW, STATES};
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::Coefficients;
use crate::nonlinear::coupling::{mass_scaled_load, under_load};
use crate::nonlinear::floating::Factors;
use crate::nonlinear::forces::Deflection;
use crate::nonlinear::{rotor, tub};
use lane_ode::{Lane, N};

/// Derivative k of a state: with all forces and inertia at coordinates `q` (m, rad) and speeds `u`,
/// but for the springs, which are at r + g k, for `g` (s).
#[inline(always)]
pub(crate) fn derivative_ahead<T: Lane>(
    machine: &Coefficients<T>,
    spin: &SpinState<T>,
    q: &[N<T>; COORDINATES],
    u: &[N<T>; COORDINATES],
    r: &[N<T>; STATES],
    g: N<T>,
) -> [N<T>; STATES] {
    let b = &machine.bodies;
    let (mut tub, mut rotor) = (tub(machine, q, u), rotor(b, spin, q, u));
    // How far ahead of `q`, but for g^2 a.
    let mut ahead = *q;
    for i in 0..COORDINATES {
        ahead[i] = r[i] + g * r[COORDINATES + i] - q[i];
    }
    let g_squared = (g * g).v();
    for (place, i) in [(2, HINGE_YAW), (3, HINGE_PITCH)] {
        rotor.inertia[place][place] += g_squared * b.flexure_stiffness;
        rotor.floating.torque[place] -= b.flexure_stiffness * ahead[i];
    }
    let mut deflection = Deflection::new(q, &tub.tilt, &rotor.tilt);
    let further = Deflection::linear(&ahead, &tub.floating.axis, &rotor.floating.axis);
    for i in 0..2 {
        deflection.offset[i] += further.offset[i];
        deflection.tilt[i] += further.tilt[i];
    }
    // The deflection is linear in the accelerations alone.
    let zero = g.lit(0.0);
    tub.floating.axis_drift = [zero; 2];
    rotor.floating.axis_drift = [zero; 2];
    let none = Deflection { offset: [zero; 2], tilt: [zero; 2] };
    let (of_tub, of_rotor) = (Factors::new(tub.inertia), Factors::new(rotor.inertia));
    let (tub, rotor) = (&tub.floating, &rotor.floating);
    let (by_tub, by_rotor) = (tub.response(&of_tub), rotor.response(&of_rotor));
    let squares = (g_squared.recip(), zero);
    let on_shaft = mass_scaled_load(b, squares, &deflection, &none, &by_tub, &by_rotor);
    let a = under_load((tub, &of_tub), (rotor, &of_rotor), &on_shaft);
    let mut k = *r;
    for i in 0..COORDINATES {
        k[i] = r[COORDINATES + i] + g * a[i];
        k[COORDINATES + i] = a[i];
    }
    k
}

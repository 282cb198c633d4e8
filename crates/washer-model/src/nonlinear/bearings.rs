//! The bearings as the stiff linear part of the equations: what the additive method takes
//! implicitly.
//!
//! About a state their load on the shaft is -K G q, with G q the relative deflection and K their
//! stiffness; the accelerations by a load are those of both halves, whose inertia is that of the
//! state. With u' = -B K G q and q' = u, where B are these accelerations per load, z - g L z = r
//! leaves one system of four for the load, (K^-1 / g^2 + C) load = -G (r_q + g r_u) / g^2, C the
//! compliance of both halves: that of section 4.3 of the model page, with 1 / g in place of the
//! cap.

use crate::coordinates::{COORDINATES, STATES};
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::Coefficients;
use crate::nonlinear::coupling::{mass_scaled_system, under_load};
use crate::nonlinear::floating::{Factors, Floating};
use crate::nonlinear::forces::{AxisLoad, Deflection};
use crate::nonlinear::{rotor, tub};
use lane_ode::{Lane, N};

/// Both halves at a state, free of every load.
pub(crate) struct Bearings<T> {
    tub: (Floating<T, 2>, Factors<T, 2>),
    rotor: (Floating<T, 4>, Factors<T, 4>),
    /// Of tub and rotor; lower triangles.
    compliances: [[[N<T>; 4]; 4]; 2],
    of_bearings: [N<T>; 3],
}

/// What stands beside these for steps of one length.
pub(crate) struct Factored<T> {
    system: Factors<T, 4>,
    g: N<T>,
    per_g_squared: N<T>,
}

/// Accelerations du/dt of all ten coordinates at `q` (m, rad) and `u`, bearings as they are, and
/// these bearings.
#[inline(always)]
pub(crate) fn accelerations_with_bearings<T: Lane>(
    machine: &Coefficients<T>,
    spin: &SpinState<T>,
    q: &[N<T>; COORDINATES],
    u: &[N<T>; COORDINATES],
) -> ([N<T>; COORDINATES], Bearings<T>) {
    let b = &machine.bodies;
    let (tub, rotor) = (tub(machine, q, u), rotor(b, spin, q, u));
    let (of_tub, of_rotor) = (Factors::new(tub.inertia), Factors::new(rotor.inertia));
    let on_shaft = Deflection::new(q, &tub.tilt, &rotor.tilt).load(b);
    let accelerations =
        under_load((&tub.floating, &of_tub), (&rotor.floating, &of_rotor), &on_shaft);
    let compliances =
        [tub.floating.response(&of_tub).compliance, rotor.floating.response(&of_rotor).compliance];
    let bearings = Bearings {
        tub: (tub.floating.free_of_load(), of_tub),
        rotor: (rotor.floating.free_of_load(), of_rotor),
        compliances,
        of_bearings: b.bearing_compliance(),
    };
    (accelerations, bearings)
}

impl<T: Lane> Bearings<T> {
    /// For `g` (s).
    #[inline(always)]
    pub(crate) fn factored(&self, g: N<T>) -> Factored<T> {
        let per_g_squared = (g * g).v().recip();
        let [tub, rotor] = &self.compliances;
        let system = mass_scaled_system(per_g_squared, self.of_bearings, tub, rotor);
        Factored { system: Factors::new(system), g, per_g_squared }
    }

    /// z with z - g L z = r, and L z.
    #[inline(always)]
    pub(crate) fn solve(
        &self,
        Factored { system, g, per_g_squared }: &Factored<T>,
        r: &[N<T>; STATES],
    ) -> ([N<T>; STATES], [N<T>; STATES]) {
        let Self { tub, rotor, .. } = self;
        let (mut z, mut of_stiff) = (*r, *r);
        let mut ahead = [*g; COORDINATES];
        for i in 0..COORDINATES {
            ahead[i] = r[i] + *g * r[COORDINATES + i];
        }
        let mut load = Deflection::linear(&ahead, &tub.0.axis, &rotor.0.axis).rows();
        for i in 0..4 {
            load[i] = -(*per_g_squared * load[i]).v();
        }
        let [force_y, force_z, moment_y, moment_z] = system.solve(load);
        let on_shaft = AxisLoad { force: [force_y, force_z], moment: [moment_y, moment_z] };
        let by_load = under_load((&tub.0, &tub.1), (&rotor.0, &rotor.1), &on_shaft);
        for i in 0..COORDINATES {
            let speed = r[COORDINATES + i] + *g * by_load[i];
            z[i] = r[i] + *g * speed;
            z[COORDINATES + i] = speed;
            of_stiff[i] = speed;
            of_stiff[COORDINATES + i] = by_load[i];
        }
        (z, of_stiff)
    }
}

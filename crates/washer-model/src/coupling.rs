//! How the bearings couple tub and rotor: as springs, or as springs with inertia.
//!
//! Bearings are so stiff that their modes (up to 1e4 rad/s, hardly damped) force an explicit method to steps far below what
//! the motion of interest needs. Selective mass scaling caps those modes: a bearing force
//!
//! ```text
//! lambda = -K (d + d'' / w^2)
//! ```
//!
//! adds the mass K / w^2 to the relative motion d of the bearing centres and to nothing else. No bearing mode is then faster than the cap w;
//! static deflections, and with them the equilibrium, stay exact; motion at a frequency f sees the bearings softer by
//! (f/w)^2. Since d'' is taken of the true deflection, velocities included, it is K / w^2 in the mass matrix of the nonlinear model
//! and its first-order expansion in the linear one. Compare L. Olovsson, K. Simonsson, M. Unosson, Int. J. Numer. Meth. Engng 63
//! (2005) 1436.
//!
//! With d'' = e + C lambda, e and C found by solving the halves, only a symmetric positive definite system of four is left:
//!
//! ```text
//! (w^2 K^-1 + C) lambda = -(w^2 d + e)
//! ```

use crate::coefficients::Bodies;
use crate::floating::{Factors, Floating};
use crate::forces::AxisLoad;
use crate::frame::Tilt;
use crate::nonlinear::COORDINATES;
use lane_ode::{N, Real};

/// Where the shaft's bearing midpoint is from the tub's, and its axis from the tub's axis; y and z.
pub(crate) struct Deflection<T> {
    pub(crate) offset: [N<T>; 2],
    pub(crate) tilt: [N<T>; 2],
}

impl<T: Real> Deflection<T> {
    /// Of the nonlinear model.
    #[inline(always)]
    pub(crate) fn new(q: &[N<T>; COORDINATES], tub: &Tilt<T>, shaft: &Tilt<T>) -> Self {
        Self {
            offset: [q[2] - q[0], q[3] - q[1]],
            tilt: [shaft.axis_c[1] - tub.axis_c[1], shaft.axis_c[2] - tub.axis_c[2]],
        }
    }
}

/// The bearings as a model treats them.
#[derive(Clone, Copy)]
pub(crate) enum Coupling<T> {
    /// Springs, as they are.
    Springs,
    /// With mass, so that no bearing mode is faster than a cap; its square, rad^2/s^2.
    MassScaled(N<T>),
}

impl<T: Real> Coupling<T> {
    /// Accelerations du/dt of both halves, given without the bearings' forces.
    #[inline(always)]
    pub(crate) fn accelerations(
        &self,
        bodies: &Bodies<T>,
        deflection: &Deflection<T>,
        (tub, tub_inertia): (&Floating<T, 2>, &Factors<T, 2>),
        (rotor, rotor_inertia): (&Floating<T, 4>, &Factors<T, 4>),
    ) -> [N<T>; COORDINATES] {
        let on_shaft = match self {
            Self::Springs => deflection.load(bodies),
            Self::MassScaled(cap_squared) => {
                let of_tub = tub.response(tub_inertia);
                let of_rotor = rotor.response(rotor_inertia);
                mass_scaled_load(bodies, *cap_squared, deflection, &of_tub, &of_rotor)
            }
        };
        let ([a1, a2], [a5, a6]) = tub.accelerations(tub_inertia, &on_shaft.reaction());
        let ([a3, a4], [a7, a8, a9, a10]) = rotor.accelerations(rotor_inertia, &on_shaft);
        [a1, a2, a3, a4, a5, a6, a7, a8, a9, a10]
    }
}

/// How a half's midpoint (y, z) and axis (y, z) accelerate: on their own, and per unit of force (y, z) and moment (y, z).
pub(crate) struct Response<T> {
    pub(crate) free: [N<T>; 4],
    /// Symmetric; lower triangle.
    pub(crate) compliance: [[N<T>; 4]; 4],
}

#[inline(always)]
fn mass_scaled_load<T: Real>(
    b: &Bodies<T>,
    cap_squared: N<T>,
    deflection: &Deflection<T>,
    tub: &Response<T>,
    rotor: &Response<T>,
) -> AxisLoad<T> {
    let mut system = rotor.compliance;
    for row in 0..4 {
        for column in 0..=row {
            system[row][column] += tub.compliance[row][column];
        }
    }
    // K^-1 couples force and moment of one direction.
    for i in 0..2 {
        system[i][i] += cap_squared * b.bearing_force_compliance;
        system[2 + i][2 + i] += cap_squared * b.bearing_moment_compliance;
        system[2 + i][i] += cap_squared * b.bearing_mixed_compliance;
    }
    let d = [deflection.offset[0], deflection.offset[1], deflection.tilt[0], deflection.tilt[1]];
    let mut load = d;
    for i in 0..4 {
        load[i] = tub.free[i] - (cap_squared * d[i] + rotor.free[i]);
    }
    let [force_y, force_z, moment_y, moment_z] = Factors::new(system).solve(load);
    AxisLoad { force: [force_y, force_z], moment: [moment_y, moment_z] }
}

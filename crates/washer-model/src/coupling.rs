//! How the bearings couple tub and rotor: as springs, or as springs with inertia; and likewise the hinge.
//!
//! Bearings are so stiff that their modes (up to 1e4 rad/s, hardly damped) force an explicit method to steps far below what
//! the motion of interest needs. Selective mass scaling caps those modes: a bearing force
//!
//! ```text
//! lambda = -K (d + (d'' + theta'^2 (d - d0)) / w^2)
//! ```
//!
//! adds the mass K / w^2 to the relative motion d of the bearing centres and to nothing else. No bearing mode is then faster than the cap w.
//! The static deflection d0, and with it the equilibrium, stays exact. What turns with the drum has d'' = -theta'^2 (d - d0) and
//! is exact too; motion at another frequency f sees the bearings softer by (f^2 - theta'^2) / w^2. Since d'' is taken of the true deflection, velocities
//! included, it is K / w^2 in the mass matrix of the nonlinear model
//! and its first-order expansion in the linear one. Compare L. Olovsson, K. Simonsson, M. Unosson, Int. J. Numer. Meth. Engng 63
//! (2005) 1436.
//!
//! With d'' = e + C lambda, e and C found by solving the halves, only a symmetric positive definite system of four is left:
//!
//! ```text
//! (w^2 K^-1 + C) lambda = -(w^2 d + theta'^2 (d - d0) + e)
//! ```
//!
//! The hinge's modes come next. Its angles p = (q9, q10) turn with the shaft, so that a whirl at the
//! drum's speed is at rest in them, and the weight's sag p0 turns backwards. With J a right angle
//! forwards, the moment is
//!
//! ```text
//! -k (p + (p'' + 3/2 theta' J p' - theta'^2 p0(theta) / 2) / w^2)
//! ```
//!
//! A whirl at the frequency f, seen from the cabinet and signed as the drum turns, finds the hinge softer
//! by (f - theta') (f + theta' / 2) / w^2: the moment is exact for what turns with the drum, for the
//! weight, and for the backward half of a motion at half the drum's speed, which is where parametric
//! resonance doubles the period. It adds k / w^2 to two entries of the rotor's inertia, a torque per
//! speed that does no work, and a known torque.

use crate::coefficients::Bodies;
use crate::floating::{Factors, Floating};
use crate::forces::AxisLoad;
use crate::frame::Tilt;
use crate::lanes::{SetLane, Splat};
use crate::nonlinear::COORDINATES;
use crate::spin::SpinState;
use lane_ode::{Lane, N, Real};

/// Where the shaft's bearing midpoint is from the tub's, and its axis from the tub's axis; y and z.
#[derive(Clone, Copy, Debug)]
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

    /// Of the linear model, by deviations from equilibrium (or, alike, by accelerations) and the partial derivatives of both axes.
    #[inline(always)]
    pub(crate) fn linear(
        q: &[N<T>; COORDINATES],
        tub_axis: &[[N<T>; 2]; 2],
        rotor_axis: &[[N<T>; 2]; 2],
    ) -> Self {
        let [tub, rotor] = [tub_axis, rotor_axis];
        Self {
            offset: [q[2] - q[0], q[3] - q[1]],
            tilt: [
                rotor[1][0] * q[7] - tub[1][0] * q[5],
                rotor[0][1] * q[6] + rotor[1][1] * q[7] - tub[0][1] * q[4] - tub[1][1] * q[5],
            ],
        }
    }

    /// Offset, then tilt.
    #[inline(always)]
    pub(crate) fn rows(&self) -> [N<T>; 4] {
        [self.offset[0], self.offset[1], self.tilt[0], self.tilt[1]]
    }
}

/// The hinge's scaled mass is exact for a backward whirl at this share of the drum's speed.
pub(crate) const BACKWARD_SHARE: f64 = 0.5;

/// The bearings as a model treats them.
#[derive(Clone, Copy)]
pub(crate) enum Coupling<T> {
    /// Springs, as they are.
    Springs,
    /// With mass, so that no mode of theirs is faster than a cap.
    MassScaled(Scaling<T>),
}

/// Caps on the fast modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Caps {
    /// On the modes of the bearings.
    pub bearings_rad_per_s: f64,
    /// On those of the hinge, unless it is left as it is.
    pub hinge_rad_per_s: Option<f64>,
}

impl Caps {
    /// The bearings' cap squared, and the reciprocal square of the hinge's; 0 if that is left alone.
    fn squares(&self) -> [f64; 2] {
        let hinge = self.hinge_rad_per_s.unwrap_or(f64::INFINITY);
        [self.bearings_rad_per_s * self.bearings_rad_per_s, 1.0 / (hinge * hinge)]
    }
}

/// Caps as the equations use them.
#[derive(Clone, Copy)]
pub(crate) struct Scaling<T> {
    /// Square of the bearings' cap, rad^2/s^2.
    pub(crate) bearings_squared: N<T>,
    /// Reciprocal square of the hinge's; 0 if it is left alone.
    per_hinge_squared: N<T>,
}

/// How weight deflects bearings and hinge at the static equilibrium, unbalance up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sag<T> {
    pub(crate) bearings: Deflection<T>,
    /// q9, q10.
    pub(crate) hinge: [N<T>; 2],
}

impl Sag<f64> {
    /// At the equilibrium `q`.
    pub(crate) fn new(q: &[f64; COORDINATES]) -> Self {
        let q = q.map(N);
        let bearings = Deflection::new(&q, &Tilt::new(q[4], q[5]), &Tilt::new(q[6], q[7]));
        Self { bearings, hinge: [q[8], q[9]] }
    }

    /// The same in every lane.
    #[inline(always)]
    pub(crate) fn splat<T: Lane>(&self, zero: N<T>) -> Sag<T> {
        let Deflection { offset, tilt } = &self.bearings;
        Sag {
            bearings: Deflection { offset: Splat::splat(zero, offset), tilt: Splat::splat(zero, tilt) },
            hinge: Splat::splat(zero, &self.hinge),
        }
    }
}

impl<T: Lane> SetLane<Sag<f64>> for Sag<T> {
    fn set_lane(&mut self, lane: usize, from: &Sag<f64>) {
        self.bearings.offset.set_lane(lane, &from.bearings.offset);
        self.bearings.tilt.set_lane(lane, &from.bearings.tilt);
        self.hinge.set_lane(lane, &from.hinge);
    }
}

/// What scaled mass at the hinge changes in the rotor's equations, for each of q9 and q10.
pub(crate) struct HingeMass<T> {
    /// Added to the inertia's diagonal.
    pub(crate) inertia: N<T>,
    /// Added to the torque.
    pub(crate) torque: [N<T>; 2],
    /// Torque about q9 per speed of q10; about q10 per speed of q9 it is the opposite.
    pub(crate) torque_per_speed: N<T>,
}

impl<T: Real> Coupling<T> {
    /// With these caps, if any.
    #[inline(always)]
    pub(crate) fn new(zero: N<T>, caps: Option<&Caps>) -> Self {
        let Some(caps) = caps else { return Self::Springs };
        let [bearings_squared, per_hinge_squared] = caps.squares().map(|square| zero.lit(square));
        Self::MassScaled(Scaling { bearings_squared, per_hinge_squared })
    }

    /// Other caps in one lane; for bearings that are springs there are none to set.
    pub(crate) fn set_caps(&mut self, lane: usize, caps: &Caps)
    where
        T: Lane,
    {
        if let Self::MassScaled(scaling) = self {
            let [bearings_squared, per_hinge_squared] = caps.squares();
            scaling.bearings_squared.0.set(lane, bearings_squared);
            scaling.per_hinge_squared.0.set(lane, per_hinge_squared);
        }
    }

    /// The hinge's scaled mass, if modes are capped; the hinge sags by these q9 and q10.
    #[inline(always)]
    pub(crate) fn hinge_mass(
        &self,
        flexure_stiffness: N<T>,
        spin: &SpinState<T>,
        [sag_9, sag_10]: [N<T>; 2],
    ) -> Option<HingeMass<T>> {
        let Self::MassScaled(scaling) = self else { return None };
        let inertia = (scaling.per_hinge_squared * flexure_stiffness).v();
        let of_sag = (BACKWARD_SHARE * (inertia * (spin.speed * spin.speed).v()).v()).v();
        Some(HingeMass {
            inertia,
            torque: [
                (of_sag * (spin.cos * sag_9 + spin.sin * sag_10)).v(),
                (of_sag * (spin.cos * sag_10 - spin.sin * sag_9)).v(),
            ],
            torque_per_speed: ((1.0 + BACKWARD_SHARE) * (inertia * spin.speed).v()).v(),
        })
    }

    /// Accelerations du/dt of both halves, given without the bearings' forces, at theta' = `speed`. `sag` is the part of the deflection
    /// that does not turn with the drum. The linear model's are in `linear_step.rs`.
    #[inline(always)]
    pub(crate) fn accelerations(
        &self,
        bodies: &Bodies<T>,
        speed: N<T>,
        deflection: &Deflection<T>,
        sag: &Deflection<T>,
        (tub, tub_inertia): (&Floating<T, 2>, &Factors<T, 2>),
        (rotor, rotor_inertia): (&Floating<T, 4>, &Factors<T, 4>),
    ) -> [N<T>; COORDINATES] {
        let on_shaft = match self {
            Self::Springs => deflection.load(bodies),
            Self::MassScaled(scaling) => {
                let of_tub = tub.response(tub_inertia);
                let of_rotor = rotor.response(rotor_inertia);
                let speed_squared = (speed * speed).v();
                let squares = (scaling.bearings_squared, speed_squared);
                mass_scaled_load(bodies, squares, deflection, sag, &of_tub, &of_rotor)
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

/// w^2 K^-1 + C, lower triangle: from the compliances of the bearings in one direction (offset by force, offset by moment, tilt by moment) and
/// of both halves.
#[inline(always)]
pub(crate) fn mass_scaled_system<T: Real>(
    cap_squared: N<T>,
    [by_force, mixed, by_moment]: [N<T>; 3],
    tub: &[[N<T>; 4]; 4],
    rotor: &[[N<T>; 4]; 4],
) -> [[N<T>; 4]; 4] {
    let mut system = *rotor;
    for row in 0..4 {
        for column in 0..=row {
            system[row][column] += tub[row][column];
        }
    }
    // K^-1 couples force and moment of one direction.
    for i in 0..2 {
        system[i][i] += cap_squared * by_force;
        system[2 + i][2 + i] += cap_squared * by_moment;
        system[2 + i][i] += cap_squared * mixed;
    }
    system
}

#[inline(always)]
fn mass_scaled_load<T: Real>(
    b: &Bodies<T>,
    (cap_squared, speed_squared): (N<T>, N<T>),
    deflection: &Deflection<T>,
    sag: &Deflection<T>,
    tub: &Response<T>,
    rotor: &Response<T>,
) -> AxisLoad<T> {
    let of_bearings = [b.bearing_force_compliance, b.bearing_mixed_compliance, b.bearing_moment_compliance];
    let system = mass_scaled_system(cap_squared, of_bearings, &tub.compliance, &rotor.compliance);
    let both_squared = cap_squared + speed_squared;
    let (d, sag) = (deflection.rows(), sag.rows());
    let mut load = d;
    for i in 0..4 {
        load[i] = tub.free[i] - (both_squared * d[i] + rotor.free[i]) + speed_squared * sag[i];
    }
    let [force_y, force_z, moment_y, moment_z] = Factors::new(system).solve(load);
    AxisLoad { force: [force_y, force_z], moment: [moment_y, moment_z] }
}

//! How the bearings couple tub and rotor: as springs, or with the mass that caps their modes; and
//! the mass that caps the hinge's.
//!
//! Section 4.3 of the model page holds the laws, their derivation and what they leave exact.

use crate::coordinates::{
    COORDINATES, HINGE_PITCH, HINGE_YAW, SHAFT_PITCH, SHAFT_Y, SHAFT_YAW, SHAFT_Z, TUB_PITCH,
    TUB_Y, TUB_YAW, TUB_Z,
};
use crate::lanes::{InLanes as _, lane_struct};
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::Bodies;
use crate::nonlinear::floating::{Factors, Floating, Response};
use crate::nonlinear::forces::{AxisLoad, Deflection};
use crate::nonlinear::frame::Tilt;
use lane_ode::{Lane, N, Real};

impl<T: Real> Deflection<T> {
    /// Of the nonlinear model.
    #[inline(always)]
    pub(crate) fn new(q: &[N<T>; COORDINATES], tub: &Tilt<T>, shaft: &Tilt<T>) -> Self {
        Self {
            offset: [q[SHAFT_Y] - q[TUB_Y], q[SHAFT_Z] - q[TUB_Z]],
            tilt: [shaft.axis_c[1] - tub.axis_c[1], shaft.axis_c[2] - tub.axis_c[2]],
        }
    }

    /// Of the linear model, by deviations from equilibrium (or, alike, by accelerations) and the
    /// partial derivatives of both axes.
    #[inline(always)]
    pub(crate) fn linear(
        q: &[N<T>; COORDINATES],
        tub_axis: &[[N<T>; 2]; 2],
        rotor_axis: &[[N<T>; 2]; 2],
    ) -> Self {
        let [tub, rotor] = [tub_axis, rotor_axis];
        Self {
            offset: [q[SHAFT_Y] - q[TUB_Y], q[SHAFT_Z] - q[TUB_Z]],
            tilt: [
                rotor[1][0] * q[SHAFT_PITCH] - tub[1][0] * q[TUB_PITCH],
                rotor[0][1] * q[SHAFT_YAW] + rotor[1][1] * q[SHAFT_PITCH]
                    - tub[0][1] * q[TUB_YAW]
                    - tub[1][1] * q[TUB_PITCH],
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
    /// Springs with mass, so that none of their modes is faster than a cap.
    MassScaled(Scaling<T>),
}

/// Caps on the fast modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Caps {
    /// On the modes of the bearings.
    pub bearings_rad_per_s: f64,
    /// On those of the hinge, if it is capped.
    pub hinge_rad_per_s: Option<f64>,
}

lane_struct! {
    /// The caps as the equations use them.
    #[derive(Clone, Copy)]
    Scaling {
        /// Square of the bearings' cap, rad^2/s^2.
        bearings_squared,
        /// Reciprocal square of the hinge's; 0 if the hinge is not capped.
        per_hinge_squared,
    }
}

impl Scaling<f64> {
    fn new(caps: &Caps) -> Self {
        let hinge = caps.hinge_rad_per_s.unwrap_or(f64::INFINITY);
        Self {
            bearings_squared: N(caps.bearings_rad_per_s * caps.bearings_rad_per_s),
            per_hinge_squared: N(1.0 / (hinge * hinge)),
        }
    }
}

lane_struct! {
    /// How weight deflects bearings and hinge at the static equilibrium, unbalance up.
    #[derive(Clone, Copy, Debug)]
    Sag {
        bearings: Deflection<T>,
        /// q9, q10.
        hinge: [N<T>; 2],
    }
}

impl Sag<f64> {
    /// At the equilibrium `q`.
    pub(crate) fn new(q: &[f64; COORDINATES]) -> Self {
        let q = q.map(N);
        let bearings = Deflection::new(&q, &Tilt::of_tub(&q), &Tilt::of_shaft(&q));
        Self { bearings, hinge: [q[HINGE_YAW], q[HINGE_PITCH]] }
    }
}

/// The terms that scaled mass at the hinge adds to the rotor's equations of q9 and q10.
pub(crate) struct HingeMass<T> {
    /// Added to the inertia's diagonal.
    pub(crate) inertia: N<T>,
    /// Added to the torque.
    pub(crate) torque: [N<T>; 2],
    /// Torque about q9 per speed of q10; about q10 per speed of q9 it is the opposite.
    pub(crate) torque_per_speed: N<T>,
}

impl<T: Lane> Coupling<T> {
    /// Springs, or mass scaled to these caps.
    #[inline(always)]
    pub(crate) fn new(zero: N<T>, caps: Option<&Caps>) -> Self {
        // No closure: it would be compiled without the instruction set.
        let Some(caps) = caps else { return Self::Springs };
        Self::MassScaled(Scaling::splat(zero, &Scaling::new(caps)))
    }

    /// Sets the caps of one lane. Bearings that are springs have none.
    pub(crate) fn set_caps(&mut self, lane: usize, caps: &Caps) {
        if let Self::MassScaled(scaling) = self {
            scaling.set_lane(lane, &Scaling::new(caps));
        }
    }

    /// The hinge's scaled mass, if modes are capped. `sag_9` and `sag_10` are its angles at rest.
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

    /// Accelerations du/dt of both halves, given without the bearings' forces, at theta' = `speed`.
    /// `sag` is the part of the deflection that does not turn with the drum. `linear/step.rs` has
    /// those of the linear model.
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
        under_load((tub, tub_inertia), (rotor, rotor_inertia), &on_shaft)
    }
}

/// Accelerations of both halves under a load on the shaft.
#[inline(always)]
pub(crate) fn under_load<T: Real>(
    (tub, tub_inertia): (&Floating<T, 2>, &Factors<T, 2>),
    (rotor, rotor_inertia): (&Floating<T, 4>, &Factors<T, 4>),
    on_shaft: &AxisLoad<T>,
) -> [N<T>; COORDINATES] {
    let ([a1, a2], [a5, a6]) = tub.accelerations(tub_inertia, &on_shaft.reaction());
    let ([a3, a4], [a7, a8, a9, a10]) = rotor.accelerations(rotor_inertia, on_shaft);
    [a1, a2, a3, a4, a5, a6, a7, a8, a9, a10]
}

/// w^2 K^-1 + C, lower triangle: from the compliances of the bearings and of both halves.
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
pub(crate) fn mass_scaled_load<T: Real>(
    b: &Bodies<T>,
    (cap_squared, speed_squared): (N<T>, N<T>),
    deflection: &Deflection<T>,
    sag: &Deflection<T>,
    tub: &Response<T>,
    rotor: &Response<T>,
) -> AxisLoad<T> {
    let system =
        mass_scaled_system(cap_squared, b.bearing_compliance(), &tub.compliance, &rotor.compliance);
    let both_squared = cap_squared + speed_squared;
    let (d, sag) = (deflection.rows(), sag.rows());
    let mut load = d;
    for i in 0..4 {
        load[i] = tub.free[i] - (both_squared * d[i] + rotor.free[i]) + speed_squared * sag[i];
    }
    let [force_y, force_z, moment_y, moment_z] = Factors::new(system).solve(load);
    AxisLoad { force: [force_y, force_z], moment: [moment_y, moment_z] }
}

//! Couples tub and rotor by the bearings: by springs, or by springs with scaled mass, which caps
//! the frequencies of the bearings' modes. The hinge's modes are capped in the same way.
//!
//! Section 4.3 of the model page derives the force laws and lists the quantities that stay exact.

use crate::coordinates::{
    COORDINATES, HINGE_PITCH, HINGE_YAW, SHAFT_PITCH, SHAFT_Y, SHAFT_YAW, SHAFT_Z, TUB_PITCH,
    TUB_Y, TUB_YAW, TUB_Z,
};
use crate::lanes::{InLanes as _, lane_struct};
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::Bodies;
use crate::nonlinear::floating::{AxisResponse, FloatingChain, LdltFactors};
use crate::nonlinear::forces::{AxisLoad, Deflection};
use crate::nonlinear::frame::Tilt;
use lane_ode::{Lane, N, Real};

impl<T: Real> Deflection<T> {
    /// Computes the deflection in the nonlinear model.
    #[inline(always)]
    pub(crate) fn new(q: &[N<T>; COORDINATES], tub: &Tilt<T>, shaft: &Tilt<T>) -> Self {
        Self {
            offset: [q[SHAFT_Y] - q[TUB_Y], q[SHAFT_Z] - q[TUB_Z]],
            tilt: [shaft.axis_c[1] - tub.axis_c[1], shaft.axis_c[2] - tub.axis_c[2]],
        }
    }

    /// Computes the deflection in the linear model from the partial derivatives of the tub's and
    /// the rotor's axis. `q` are deviations from equilibrium, or accelerations for the second
    /// derivative of the deflection.
    #[inline(always)]
    pub(crate) fn from_linear_model(
        q: &[N<T>; COORDINATES],
        tub_axis: &[[N<T>; 2]; 2],
        rotor_axis: &[[N<T>; 2]; 2],
    ) -> Self {
        Self {
            offset: [q[SHAFT_Y] - q[TUB_Y], q[SHAFT_Z] - q[TUB_Z]],
            tilt: [
                rotor_axis[1][0] * q[SHAFT_PITCH] - tub_axis[1][0] * q[TUB_PITCH],
                rotor_axis[0][1] * q[SHAFT_YAW] + rotor_axis[1][1] * q[SHAFT_PITCH]
                    - tub_axis[0][1] * q[TUB_YAW]
                    - tub_axis[1][1] * q[TUB_PITCH],
            ],
        }
    }

    /// Returns offset and tilt as one vector.
    #[inline(always)]
    pub(crate) fn as_vector(&self) -> [N<T>; 4] {
        [self.offset[0], self.offset[1], self.tilt[0], self.tilt[1]]
    }
}

/// The speed of the backward whirl for which the hinge's scaled mass is exact, relative to the
/// drum's speed. Basis: motions with twice the period of a turn whirl at this speed, and capping
/// the hinge changes these motions most. Doubling it makes a backward whirl at the drum's speed
/// exact instead.
pub(crate) const BACKWARD_WHIRL_RATIO: f64 = 0.5;

/// The model of the bearings.
#[derive(Clone, Copy)]
pub(crate) enum Coupling<T> {
    Springs,
    /// Springs with scaled mass, so that no mode of the bearings is faster than a cap.
    MassScaled(CapCoefficients<T>),
}

/// The caps of the fast modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Caps {
    /// The cap of the bearings' modes.
    pub bearings_rad_per_s: f64,
    /// The cap of the hinge's modes, if they are capped.
    pub hinge_rad_per_s: Option<f64>,
}

lane_struct! {
    /// The coefficients of the caps.
    #[derive(Clone, Copy)]
    CapCoefficients {
        /// The square of the bearings' cap, rad^2/s^2.
        bearing_cap_squared,
        /// The reciprocal square of the hinge's cap; 0 if the hinge is not capped.
        inverse_hinge_cap_squared,
    }
}

impl CapCoefficients<f64> {
    fn new(caps: &Caps) -> Self {
        let hinge_cap = caps.hinge_rad_per_s.unwrap_or(f64::INFINITY);
        Self {
            bearing_cap_squared: N(caps.bearings_rad_per_s * caps.bearings_rad_per_s),
            inverse_hinge_cap_squared: N(1.0 / (hinge_cap * hinge_cap)),
        }
    }
}

lane_struct! {
    /// The deflections of bearings and hinge by weight at the static equilibrium, unbalance up.
    #[derive(Clone, Copy, Debug)]
    Sag {
        bearing_deflection: Deflection<T>,
        /// The hinge's angles q9 and q10.
        hinge_angles: [N<T>; 2],
    }
}

impl Sag<f64> {
    /// Computes the deflections at the equilibrium `q`.
    pub(crate) fn new(q: &[f64; COORDINATES]) -> Self {
        let q = q.map(N);
        let bearing_deflection = Deflection::new(&q, &Tilt::tub(&q), &Tilt::shaft(&q));
        Self { bearing_deflection, hinge_angles: [q[HINGE_YAW], q[HINGE_PITCH]] }
    }
}

/// The terms that scaled mass at the hinge adds to the rotor's equations of q9 and q10.
pub(crate) struct HingeMass<T> {
    /// The term added to the inertia's diagonal.
    pub(crate) inertia: N<T>,
    /// The term added to the torque.
    pub(crate) torque: [N<T>; 2],
    /// The torque about q9 per speed of q10, and the negative torque about q10 per speed of q9.
    pub(crate) torque_per_speed: N<T>,
}

impl<T: Lane> Coupling<T> {
    /// Creates springs, or springs with mass scaled to caps.
    #[inline(always)]
    pub(crate) fn new(zero: N<T>, caps: Option<&Caps>) -> Self {
        // This is not `Option::map_or`, whose closure would be compiled without the kernel's
        // instruction set.
        let Some(caps) = caps else { return Self::Springs };
        Self::MassScaled(CapCoefficients::splat(zero, &CapCoefficients::new(caps)))
    }

    /// Sets the caps of one lane; springs have none.
    pub(crate) fn set_caps(&mut self, lane: usize, caps: &Caps) {
        if let Self::MassScaled(scaling) = self {
            scaling.set_lane(lane, &CapCoefficients::new(caps));
        }
    }

    /// Computes the terms of the hinge's scaled mass, if modes are capped. `sag_9` and `sag_10` are
    /// the hinge's angles at rest.
    #[inline(always)]
    pub(crate) fn hinge_mass(
        &self,
        flexure_stiffness: N<T>,
        spin: &SpinState<T>,
        [sag_9, sag_10]: [N<T>; 2],
    ) -> Option<HingeMass<T>> {
        let Self::MassScaled(scaling) = self else { return None };
        let inertia = (scaling.inverse_hinge_cap_squared * flexure_stiffness).v();
        let sag_torque = (BACKWARD_WHIRL_RATIO * (inertia * (spin.speed * spin.speed).v()).v()).v();
        Some(HingeMass {
            inertia,
            torque: [
                (sag_torque * (spin.cos * sag_9 + spin.sin * sag_10)).v(),
                (sag_torque * (spin.cos * sag_10 - spin.sin * sag_9)).v(),
            ],
            torque_per_speed: ((1.0 + BACKWARD_WHIRL_RATIO) * (inertia * spin.speed).v()).v(),
        })
    }

    /// Computes the accelerations du/dt of both halves at the spin speed theta' = `speed`. The
    /// arguments `tub` and `rotor` do not contain the bearings' forces. `sag` is the part of the
    /// deflection that does not turn with the drum. `linear/step.rs` computes the accelerations of
    /// the linear model.
    #[inline(always)]
    pub(crate) fn accelerations(
        &self,
        bodies: &Bodies<T>,
        speed: N<T>,
        deflection: &Deflection<T>,
        sag: &Deflection<T>,
        (tub, tub_factors): (&FloatingChain<T, 2>, &LdltFactors<T, 2>),
        (rotor, rotor_factors): (&FloatingChain<T, 4>, &LdltFactors<T, 4>),
    ) -> [N<T>; COORDINATES] {
        let shaft_load = match self {
            Self::Springs => deflection.load_on_shaft(bodies),
            Self::MassScaled(scaling) => {
                let tub_response = tub.axis_response(tub_factors);
                let rotor_response = rotor.axis_response(rotor_factors);
                let speed_squared = (speed * speed).v();
                let squares_of_cap_and_speed = (scaling.bearing_cap_squared, speed_squared);
                mass_scaled_load(
                    bodies,
                    squares_of_cap_and_speed,
                    deflection,
                    sag,
                    &tub_response,
                    &rotor_response,
                )
            }
        };
        accelerations_under_load((tub, tub_factors), (rotor, rotor_factors), &shaft_load)
    }
}

/// Computes the accelerations of both halves under a bearing load on the shaft.
#[inline(always)]
pub(crate) fn accelerations_under_load<T: Real>(
    (tub, tub_factors): (&FloatingChain<T, 2>, &LdltFactors<T, 2>),
    (rotor, rotor_factors): (&FloatingChain<T, 4>, &LdltFactors<T, 4>),
    shaft_load: &AxisLoad<T>,
) -> [N<T>; COORDINATES] {
    let ([a1, a2], [a5, a6]) = tub.accelerations(tub_factors, &shaft_load.reaction());
    let ([a3, a4], [a7, a8, a9, a10]) = rotor.accelerations(rotor_factors, shaft_load);
    [a1, a2, a3, a4, a5, a6, a7, a8, a9, a10]
}

/// Computes the lower triangle of w^2 K^-1 + C from the compliances of the bearings and of both
/// halves.
#[inline(always)]
pub(crate) fn mass_scaled_system<T: Real>(
    cap_squared: N<T>,
    [force_compliance, cross_compliance, moment_compliance]: [N<T>; 3],
    tub_compliance: &[[N<T>; 4]; 4],
    rotor_compliance: &[[N<T>; 4]; 4],
) -> [[N<T>; 4]; 4] {
    let mut system_matrix = *rotor_compliance;
    for row in 0..4 {
        for column in 0..=row {
            system_matrix[row][column] += tub_compliance[row][column];
        }
    }
    // K^-1 couples the force and the moment in one direction.
    for i in 0..2 {
        system_matrix[i][i] += cap_squared * force_compliance;
        system_matrix[2 + i][2 + i] += cap_squared * moment_compliance;
        system_matrix[2 + i][i] += cap_squared * cross_compliance;
    }
    system_matrix
}

/// Computes the bearing load on the shaft for springs with scaled mass.
#[inline(always)]
pub(crate) fn mass_scaled_load<T: Real>(
    b: &Bodies<T>,
    (cap_squared, speed_squared): (N<T>, N<T>),
    deflection: &Deflection<T>,
    sag: &Deflection<T>,
    tub: &AxisResponse<T>,
    rotor: &AxisResponse<T>,
) -> AxisLoad<T> {
    let system_matrix =
        mass_scaled_system(cap_squared, b.bearing_compliance(), &tub.compliance, &rotor.compliance);
    let sum_of_squares = cap_squared + speed_squared;
    let d = deflection.as_vector();
    let sag = sag.as_vector();
    let mut load = d;
    for i in 0..4 {
        load[i] = tub.unloaded_accelerations[i]
            - (sum_of_squares * d[i] + rotor.unloaded_accelerations[i])
            + speed_squared * sag[i];
    }
    let [force_y, force_z, moment_y, moment_z] = LdltFactors::new(system_matrix).solve(load);
    AxisLoad { force: [force_y, force_z], moment: [moment_y, moment_z] }
}

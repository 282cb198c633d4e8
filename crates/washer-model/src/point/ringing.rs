//! A bound on the swing of hinge and bearings after jumps of the drum's acceleration.
//!
//! Where the acceleration jumps, so do the loads of everything that turns with the drum:
//! unbalances, and bodies whose weight holds them beside the axis. Every method follows the slow
//! modes. Hinge and bearings have no damping of their own and swing about their new deflection from
//! then on. Steps longer than their periods do not resolve that swing, and two runs with such steps
//! lose the same part of it, so that their comparison does not show the error.
//!
//! The static deflection under the jump bounds the swing, without eigenvalues. The machine is free
//! meanwhile, because its suspension is slow: the load is that of the linear model (Eq. 41) less
//! what accelerates the machine as a rigid body (inertia relief).

use core::f64::consts::PI;

use lane_ode::{Lu, N};

use crate::channel::{CHANNELS, ChannelKind};
use crate::coordinates::{
    HINGE_PITCH, HINGE_YAW, SHAFT_PITCH, SHAFT_Y, SHAFT_YAW, SHAFT_Z, TUB_PITCH, TUB_Y, TUB_YAW,
    TUB_Z,
};
use crate::machine::spin::SpinStretch;
use crate::{COORDINATES, Channel, Machine, Matrices};

/// The greatest swing over the static deflection: of a free body about its new place of rest.
const SWING_FACTOR: f64 = 2.0;

/// The coordinates of the tub, and of the shaft in the same order.
const RIGID: [[usize; 2]; 4] =
    [[TUB_Y, SHAFT_Y], [TUB_Z, SHAFT_Z], [TUB_YAW, SHAFT_YAW], [TUB_PITCH, SHAFT_PITCH]];

/// The coordinates that deflect bearings and hinge while the tub is held.
const ELASTIC: [usize; 6] = [SHAFT_Y, SHAFT_Z, SHAFT_YAW, SHAFT_PITCH, HINGE_YAW, HINGE_PITCH];

/// The angles (rad) of the unbalance at which loads are computed: a load turns with the drum, or
/// with the weight, or stands.
const ANGLES_RAD: [f64; 4] = [0.0, 0.5 * PI, PI, 1.5 * PI];

/// The deflections of the free machine.
#[derive(Clone, Copy, Debug, Default)]
struct Deflection {
    drum_front_m: f64,
    tub_front_m: f64,
    tub_rad: f64,
}

impl Deflection {
    /// Returns the greater deflection of each kind.
    fn max(self, other: Self) -> Self {
        Self {
            drum_front_m: self.drum_front_m.max(other.drum_front_m),
            tub_front_m: self.tub_front_m.max(other.tub_front_m),
            tub_rad: self.tub_rad.max(other.tub_rad),
        }
    }
}

/// The greatest deflections under all jumps of the drum's acceleration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ringing {
    bearings: Deflection,
    hinge_and_bearings: Deflection,
}

/// Returns the sum of all jumps of the drum's acceleration before `end_s` (rad/s^2).
pub(crate) fn jumps_rad_per_s2(stretches: &[SpinStretch], end_s: f64) -> f64 {
    let mut before = 0.0;
    let mut sum = 0.0;
    for (i, stretch) in stretches.iter().enumerate() {
        let at_s = stretch.start_s.0;
        if at_s >= end_s {
            break;
        }
        sum += (stretch.acceleration_rad_per_s2(at_s) - before).abs();
        if let Some(next) = stretches.get(i + 1) {
            before = stretch.acceleration_rad_per_s2(next.start_s.0);
        }
    }
    sum
}

/// The modes that a step does not resolve: it is longer than their periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnresolvedModes {
    /// Hinge and bearings.
    HingeAndBearings,
    /// The bearings.
    Bearings,
}

/// A swing of everything that a row takes from a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing {
    /// Of each channel (m, rad), in the order of [`Channel::ALL`].
    pub channels: [f64; CHANNELS],
    /// Of the gap between drum and tub (m).
    pub gap_m: f64,
}

impl Ringing {
    /// Computes the deflections under jumps of the drum's acceleration with this sum (rad/s^2).
    /// `matrices_at` returns the linear model's matrices at an angle (rad) and an acceleration
    /// (rad/s^2) of the drum at rest.
    pub(crate) fn new(
        machine: &Machine,
        jumps_rad_per_s2: f64,
        matrices_at: impl Fn(f64, f64) -> Matrices,
    ) -> Self {
        let mut ringing =
            Self { bearings: Deflection::default(), hinge_and_bearings: Deflection::default() };
        for angle_rad in ANGLES_RAD {
            let still = matrices_at(angle_rad, 0.0);
            let accelerated = matrices_at(angle_rad, jumps_rad_per_s2);
            let load: [f64; COORDINATES] =
                core::array::from_fn(|i| accelerated.force[i] - still.force[i]);
            // Without a solution, springs of bearings or hinge are missing, and no level is stable.
            let Some(elastic) = static_deflection(&still, &load) else { continue };
            let mut bearings = elastic;
            bearings[HINGE_YAW] = 0.0;
            bearings[HINGE_PITCH] = 0.0;
            let deflections = [bearings, elastic]
                .map(|elastic| deflection_of_free_machine(machine, &still, &elastic));
            ringing.bearings = ringing.bearings.max(deflections[0]);
            ringing.hinge_and_bearings = ringing.hinge_and_bearings.max(deflections[1]);
        }
        ringing
    }

    /// Returns the greatest swing of each channel and of the gap, by the modes that are not
    /// resolved.
    pub(crate) fn swing(&self, unresolved: UnresolvedModes) -> Swing {
        let deflection = match unresolved {
            UnresolvedModes::HingeAndBearings => self.hinge_and_bearings,
            UnresolvedModes::Bearings => self.bearings,
        };
        let channels = Channel::ALL.map(|channel| {
            SWING_FACTOR
                * match channel.kind() {
                    ChannelKind::DrumPoint => deflection.drum_front_m,
                    ChannelKind::TubPoint => deflection.tub_front_m,
                    ChannelKind::TubAngle => deflection.tub_rad,
                }
        });
        let gap_m = SWING_FACTOR * (deflection.drum_front_m + deflection.tub_front_m);
        Swing { channels, gap_m }
    }
}

/// Returns the static deflection of bearings and hinge under a load (N, N m) on the free machine,
/// relative to the tub; `None` if nothing holds them.
fn static_deflection(matrices: &Matrices, load: &[f64; COORDINATES]) -> Option<[f64; COORDINATES]> {
    let rigid = rigid_motion(matrices, load)?;
    let relieved = |i: usize| {
        let inertial: f64 = (0..COORDINATES).map(|j| matrices.mass[i][j] * rigid[j]).sum();
        N(load[i] - inertial)
    };
    let stiffness = ELASTIC.map(|i| ELASTIC.map(|j| N(matrices.stiffness[i][j])));
    let solution = Lu::new(stiffness)?.solve(&ELASTIC.map(relieved));
    let mut deflection = [0.0; COORDINATES];
    for (i, value) in ELASTIC.into_iter().zip(solution) {
        deflection[i] = value.0;
    }
    Some(deflection)
}

/// Returns the rigid-body acceleration of the machine under a load: with S the sums over
/// coordinates of tub and shaft, (S' M S) a = S' f.
fn rigid_motion(matrices: &Matrices, load: &[f64; COORDINATES]) -> Option<[f64; COORDINATES]> {
    let sum = |of: &dyn Fn(usize) -> f64, pair: [usize; 2]| of(pair[0]) + of(pair[1]);
    let mass = RIGID
        .map(|row| RIGID.map(|column| N(sum(&|i| sum(&|j| matrices.mass[i][j], column), row))));
    let force = RIGID.map(|row| N(sum(&|i| load[i], row)));
    let accelerations = Lu::new(mass)?.solve(&force);
    let mut rigid = [0.0; COORDINATES];
    for (pair, acceleration) in RIGID.into_iter().zip(accelerations) {
        pair.into_iter().for_each(|i| rigid[i] = acceleration.0);
    }
    Some(rigid)
}

/// Returns the deflections of the free machine, whose tub moves against shaft and drum so that
/// momentum is conserved.
fn deflection_of_free_machine(
    machine: &Machine,
    matrices: &Matrices,
    elastic: &[f64; COORDINATES],
) -> Deflection {
    let momentum: [f64; COORDINATES] = core::array::from_fn(|i| {
        (0..COORDINATES).map(|j| matrices.mass[i][j] * elastic[j]).sum::<f64>()
    });
    let rigid = rigid_motion(matrices, &momentum).unwrap_or([0.0; COORDINATES]);
    let drum = &machine.drum;
    let tub_rad = rigid[TUB_YAW].hypot(rigid[TUB_PITCH]);
    let bearings_m = elastic[SHAFT_Y].hypot(elastic[SHAFT_Z]);
    let bearings_rad = elastic[SHAFT_YAW].hypot(elastic[SHAFT_PITCH]);
    let hinge_rad = elastic[HINGE_YAW].hypot(elastic[HINGE_PITCH]);
    let tub_m = rigid[TUB_Y].hypot(rigid[TUB_Z]);
    let drum_front_m = bearings_m
        + drum.front_x_m.abs() * bearings_rad
        + (drum.front_x_m - drum.hinge_x_m).abs() * hinge_rad;
    Deflection {
        drum_front_m: drum_front_m + tub_m + drum.front_x_m.abs() * tub_rad,
        tub_front_m: tub_m + machine.tub.front_x_m.abs() * tub_rad,
        tub_rad,
    }
}

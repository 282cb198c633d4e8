//! A bound on the swing of hinge and bearings after jumps of the drum's acceleration.
//!
//! Where the acceleration jumps, the load of the unbalance jumps by m_u r_u times as much. Every
//! method follows the slow modes. Hinge and bearings have no damping of their own and swing about
//! their new deflection from then on. Steps longer than their periods do not follow that swing, and
//! two runs with such steps leave out the same, so that their comparison does not show it. The
//! static deflection under the jump bounds it, without eigenvalues.

use crate::channel::{CHANNELS, ChannelKind};
use crate::machine::spin::SpinStretch;
use crate::{Channel, Machine};

/// The greatest swing over the static deflection: of a free body about its new place of rest.
const SWING_FACTOR: f64 = 2.0;

/// The tub's motion as a share of the drum's swing: the drum has far less mass and inertia.
const TUB_SHARE: f64 = 0.25;

/// The greatest deflections of hinge and bearings.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ringing {
    hinge_rad: f64,
    bearings_m: f64,
    hinge_to_front_m: f64,
    between_bearings_m: f64,
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

/// The parts whose ringing a step leaves out: it is longer than their periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeftOut {
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
    pub(crate) fn new(machine: &Machine, jumps_rad_per_s2: f64) -> Self {
        let bearings = &machine.bearings;
        let between_bearings_m = (bearings.front_x_m - bearings.rear_x_m).abs();
        let softer = bearings.front_stiffness_n_per_m.min(bearings.rear_stiffness_n_per_m);
        let hinge_x_m = machine.drum.hinge_x_m;
        let mut moment_n_m = 0.0;
        let mut on_bearings_n = 0.0;
        for unbalance in machine.unbalances() {
            let load_n = unbalance.mass_kg * unbalance.radius_m.abs() * jumps_rad_per_s2;
            moment_n_m += load_n * (unbalance.x_m - hinge_x_m).abs();
            on_bearings_n += load_n * (1.0 + unbalance.x_m.abs() / between_bearings_m);
        }
        Self {
            hinge_rad: moment_n_m / machine.flexure.stiffness_n_m_per_rad,
            bearings_m: on_bearings_n / softer,
            hinge_to_front_m: (machine.drum.front_x_m - hinge_x_m).abs(),
            between_bearings_m,
        }
    }

    /// Returns the greatest swing of each channel and of the gap, by what is left out.
    pub(crate) fn swing(&self, left_out: LeftOut) -> Swing {
        let hinge_rad = if left_out == LeftOut::HingeAndBearings { self.hinge_rad } else { 0.0 };
        let tilt_rad = SWING_FACTOR * (hinge_rad + self.bearings_m / self.between_bearings_m);
        let front_m = SWING_FACTOR * self.bearings_m + self.hinge_to_front_m * tilt_rad;
        let channels = Channel::ALL.map(|channel| match channel.kind() {
            ChannelKind::DrumPoint => front_m,
            ChannelKind::TubPoint => TUB_SHARE * front_m,
            ChannelKind::TubAngle => TUB_SHARE * tilt_rad,
        });
        Swing { channels, gap_m: (1.0 + TUB_SHARE) * front_m }
    }
}

//! How far jumps of the drum's acceleration leave hinge and bearings swinging.
//!
//! Where the acceleration jumps, so does the load of the unbalance, by m_u r_u times the jump. Slow modes answer by moving off, which
//! every method follows. Hinge and bearings have a new deflection to go to, and, with no damping of their own, swing about it
//! from then on. Steps that are longer than their periods do not follow that, and any two of them leave out the same: to compare
//! them shows nothing. So what is left out is bounded here, by the static deflection under the jump.

use crate::channel::Channel;
use crate::machine::Machine;
use crate::outputs::CHANNELS;
use crate::spin::SpinStretch;

/// Bodies that are free to move off take and give more than the static deflection says.
const MOST: f64 = 2.0;

/// What the tub moves by when the drum swings, whose mass and inertia are far smaller.
const SHARE_OF_TUB: f64 = 0.25;

/// Swings of hinge and bearings at most.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ringing {
    hinge_rad: f64,
    bearings_m: f64,
    /// From the hinge to the drum's front (m).
    reach_m: f64,
    /// Between the bearings (m).
    span_m: f64,
}

/// All jumps of the drum's acceleration until `end_s`, added.
pub(crate) fn jumps_rad_per_s2(stretches: &[SpinStretch], end_s: f64) -> f64 {
    let mut acceleration = 0.0;
    let mut jumps = 0.0;
    for (i, stretch) in stretches.iter().enumerate().filter(|(_, stretch)| stretch.start_s <= end_s) {
        jumps += (stretch.acceleration_rad_per_s2(stretch.start_s) - acceleration).abs();
        if let Some(next) = stretches.get(i + 1) {
            acceleration = stretch.acceleration_rad_per_s2(next.start_s);
        }
    }
    jumps
}

impl Ringing {
    /// Left by all jumps of the drum's acceleration, added (rad/s2).
    pub(crate) fn new(machine: &Machine, jumps_rad_per_s2: f64) -> Self {
        let unbalance = &machine.unbalance;
        let load_n = unbalance.mass_kg * unbalance.radius_m.abs() * jumps_rad_per_s2;
        let bearings = &machine.bearings;
        let span_m = (bearings.front_x_m - bearings.rear_x_m).abs();
        let softer = bearings.front_stiffness_n_per_m.min(bearings.rear_stiffness_n_per_m);
        let arm_m = (unbalance.x_m - machine.drum.hinge_x_m).abs();
        Self {
            hinge_rad: load_n * arm_m / machine.flexure.stiffness_n_m_per_rad,
            bearings_m: load_n * (1.0 + unbalance.x_m.abs() / span_m) / softer,
            reach_m: (machine.drum.front_x_m - machine.drum.hinge_x_m).abs(),
            span_m,
        }
    }

    /// By how much each channel swings at most (m, rad), in the order of `Channel::ALL`.
    pub(crate) fn channels(&self) -> [f64; CHANNELS] {
        let tilt_rad = self.hinge_rad + self.bearings_m / self.span_m;
        Channel::ALL.map(|channel| {
            let swing = match channel {
                Channel::DrumFrontY | Channel::DrumFrontZ => self.bearings_m + self.reach_m * tilt_rad,
                Channel::TubFrontY | Channel::TubFrontZ | Channel::TotalCentreY | Channel::TotalCentreZ => {
                    SHARE_OF_TUB * (self.bearings_m + self.reach_m * tilt_rad)
                }
                Channel::TubYaw | Channel::TubPitch => SHARE_OF_TUB * tilt_rad,
            };
            MOST * swing
        })
    }
}

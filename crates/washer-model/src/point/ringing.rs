//! How far hinge and bearings swing after jumps of the drum's acceleration.
//!
//! Where the acceleration jumps, the load of the unbalance jumps by m_u r_u times as much. Every
//! method follows the slow modes. Hinge and bearings have no damping of their own and swing about
//! their new deflection from then on. Steps longer than their periods do not follow that swing, and
//! two runs with such steps leave out the same, so that their comparison does not show it.
//!
//! The static deflection under the jump bounds it. That is enough for most rows, and takes no
//! eigenvalues. The modes of bearings and hinge say nearer what each channel swings, and what is
//! left of it later (`fast/ringing.rs`).

use core::array;

use crate::channel::{CHANNELS, ChannelKind};
use crate::machine::spin::SpinStretch;
use crate::{Channel, Machine};

/// Free bodies swing by more than the static deflection, up to this factor.
const MOST: f64 = 2.0;

/// Motion of the tub as a share of the drum's swing: the drum has far less mass and inertia.
const SHARE_OF_TUB: f64 = 0.25;

/// The greatest swings of hinge and bearings, and how far the hinge hangs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ringing {
    hinge_rad: f64,
    bearings_m: f64,
    /// By the weight of what it carries.
    sag_rad: f64,
    /// From the hinge to the drum's front (m).
    reach_m: f64,
    /// Between the bearings (m).
    span_m: f64,
}

/// A jump of the drum's acceleration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jump {
    pub(crate) at_s: f64,
    pub(crate) by_rad_per_s2: f64,
}

/// All of them before `end_s`.
pub(crate) fn jumps(stretches: &[SpinStretch], end_s: f64) -> Vec<Jump> {
    let mut before = 0.0;
    let mut jumps = Vec::new();
    for (i, stretch) in
        stretches.iter().enumerate().filter(|(_, stretch)| stretch.start_s.0 < end_s)
    {
        let at_s = stretch.start_s.0;
        let by_rad_per_s2 = (stretch.acceleration_rad_per_s2(at_s) - before).abs();
        if by_rad_per_s2 != 0.0 {
            jumps.push(Jump { at_s, by_rad_per_s2 });
        }
        if let Some(next) = stretches.get(i + 1) {
            before = stretch.acceleration_rad_per_s2(next.start_s.0);
        }
    }
    jumps
}

/// All jumps, added.
pub(crate) fn sum_rad_per_s2(jumps: &[Jump]) -> f64 {
    jumps.iter().fold(0.0, |sum, jump| sum + jump.by_rad_per_s2)
}

/// A swing of everything that a row takes from a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing {
    /// Of each channel (m, rad), in the order of [`Channel::ALL`].
    pub channels: [f64; CHANNELS],
    /// Of the gap between drum and tub (m).
    pub gap_m: f64,
}

impl Swing {
    pub(crate) const NONE: Self = Self { channels: [0.0; CHANNELS], gap_m: 0.0 };

    /// Each of its numbers with the other's.
    pub(crate) fn with(&self, other: &Self, of: impl Fn(f64, f64) -> f64) -> Self {
        Self {
            channels: array::from_fn(|i| of(self.channels[i], other.channels[i])),
            gap_m: of(self.gap_m, other.gap_m),
        }
    }
}

/// The swing of a group of modes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decaying {
    /// After a jump by 1 rad/s^2.
    pub(crate) per_jump: Swing,
    pub(crate) decay_per_s: f64,
}

impl Ringing {
    /// After jumps of the drum's acceleration whose sum is given (rad/s^2).
    pub(crate) fn new(machine: &Machine, jumps_rad_per_s2: f64) -> Self {
        let bearings = &machine.bearings;
        let span_m = (bearings.front_x_m - bearings.rear_x_m).abs();
        let softer = bearings.front_stiffness_n_per_m.min(bearings.rear_stiffness_n_per_m);
        let (mut moment_n_m, mut on_bearings_n) = (0.0, 0.0);
        let hinge_x_m = machine.drum.hinge_x_m;
        let mut hanging_kg_m = machine.drum.mass_kg * (machine.drum.centre_x_m - hinge_x_m);
        for unbalance in machine.unbalances() {
            let load_n = unbalance.mass_kg * unbalance.radius_m.abs() * jumps_rad_per_s2;
            moment_n_m += load_n * (unbalance.x_m - hinge_x_m).abs();
            hanging_kg_m += unbalance.mass_kg * (unbalance.x_m - hinge_x_m);
            on_bearings_n += load_n * (1.0 + unbalance.x_m.abs() / span_m);
        }
        let flexure_n_m_per_rad = machine.flexure.stiffness_n_m_per_rad;
        Self {
            hinge_rad: moment_n_m / flexure_n_m_per_rad,
            bearings_m: on_bearings_n / softer,
            sag_rad: hanging_kg_m.abs() * machine.gravity_m_per_s2 / flexure_n_m_per_rad,
            reach_m: (machine.drum.front_x_m - hinge_x_m).abs(),
            span_m,
        }
    }

    /// These shares of what hinge and bearings swing.
    pub(crate) fn share(&self, [of_hinge, of_bearings]: [f64; 2]) -> Self {
        let (hinge_rad, bearings_m) = (of_hinge * self.hinge_rad, of_bearings * self.bearings_m);
        Self { hinge_rad, bearings_m, ..*self }
    }

    /// The greatest swing of the gap between drum and tub (m).
    pub(crate) fn gap_m(&self) -> f64 {
        MOST * (1.0 + SHARE_OF_TUB) * self.drum_front_m()
    }

    fn tilt_rad(&self) -> f64 {
        self.hinge_rad + self.bearings_m / self.span_m
    }

    fn drum_front_m(&self) -> f64 {
        self.bearings_m + self.reach_m * self.tilt_rad()
    }

    /// The greatest swing of each channel (m, rad), in the order of `Channel::ALL`.
    pub(crate) fn channels(&self) -> [f64; CHANNELS] {
        in_channels(MOST * self.drum_front_m(), MOST * self.tilt_rad())
    }

    /// How far each channel (m, rad) is where it is for the hinge's sag.
    pub(crate) fn sag(&self) -> [f64; CHANNELS] {
        in_channels(self.reach_m * self.sag_rad, self.sag_rad)
    }
}

/// What a motion of the drum's front and tilt is in each channel, at most.
fn in_channels(drum_front_m: f64, tilt_rad: f64) -> [f64; CHANNELS] {
    Channel::ALL.map(|channel| match channel.kind() {
        ChannelKind::DrumPoint => drum_front_m,
        ChannelKind::TubPoint => SHARE_OF_TUB * drum_front_m,
        ChannelKind::TubAngle => SHARE_OF_TUB * tilt_rad,
    })
}

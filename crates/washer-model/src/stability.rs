//! The machine at constant speeds: its periodic response, and whether that is stable.

mod branch;
mod corners;
mod crossing;
mod exponents;
pub(crate) mod monodromy;
pub(crate) mod orbit;
mod participants;
#[cfg(test)]
mod plain;
pub(crate) mod respond;
pub(crate) mod search;
pub(crate) mod settings;
mod stepwise;
#[cfg(test)]
mod tests;
pub(crate) mod turn;

use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::modes::shape::ModeMotion;
use crate::point::Point;
use core::f64::consts::TAU;

pub use crossing::{Crossed, Crossing, LeftRange, cross, peaks_without_departures};
pub use exponents::{Exact, exact_motions};
pub use respond::{Responses, respond};

/// A machine that turns at a constant speed.
#[derive(Clone, Copy, Debug)]
pub struct Dwell<'a> {
    /// The machine.
    pub point: &'a Point,
    /// The drum's speed (rpm), above 0.
    pub speed_rpm: f64,
}

/// The way in which a periodic response loses its stability, if it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Every disturbance decays.
    Stable,
    /// A multiplier is below -1: the motion repeats every second turn.
    PeriodDoubling,
    /// A complex pair is outside of the unit circle: two frequencies that no turn locks.
    QuasiPeriodic,
    /// A multiplier is above 1: the response jumps to another.
    Fold,
}

impl Kind {
    /// Every kind.
    pub const ALL: [Self; 4] =
        [Self::Stable, Self::PeriodDoubling, Self::QuasiPeriodic, Self::Fold];

    /// Returns the name in result files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Stable => "stable",
            Self::PeriodDoubling => "period_doubling",
            Self::QuasiPeriodic => "quasi_periodic",
            Self::Fold => "fold",
        }
    }
}

/// The periodic response at a constant speed, and what becomes of small disturbances.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// The drum's speed (rpm).
    pub speed_rpm: f64,
    /// Whether it is on the curve of responses that begins at a low speed.
    pub is_on_curve: bool,
    /// The number of folds that the curve has before this one: 0 is the branch of a machine that
    /// runs up. It counts on where that curve is lost and another comes down from a high speed; a
    /// response beside both has one more than the last at its speed.
    pub branch: u32,
    /// Speeds (rpm) of the folds between which that branch lies, lower and upper: none where it
    /// goes on.
    pub between_rpm: [Option<f64>; 2],
    /// The part of the machine's geometry that the nonlinear response passes, if it does.
    pub beyond: Option<Beyond>,
    /// Largest deviation from equilibrium over a turn by the nonlinear model, in the order of
    /// [`Channel::ALL`](crate::Channel::ALL) (m, rad).
    pub nonlinear: [f64; CHANNELS],
    /// The deviations by the linear model.
    pub linear: [f64; CHANNELS],
    /// The nonlinear response where the unbalance is up: coordinates q1 to q10 (m, rad), then their
    /// speeds (per s).
    pub start: [f64; STATES],
    /// Floquet multiplier of the nonlinear response, real and imaginary part (not negative): the
    /// largest of those whose motion is the suspension's. Motions of the bearings are left out, and
    /// so are those of the hinge while its modes are fast compared with the drum's speed, because
    /// these modes are capped.
    pub multiplier: [f64; 2],
    /// Modes that take part in what grows, most first; none if nothing grows.
    pub participants: Vec<Participant>,
}

/// A limit of the machine that a motion passes: the equations do not know it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Beyond {
    /// A spring's end at the tub passes its hook.
    SpringHooks,
    /// A damper's end at the tub passes its end at the cabinet.
    DamperEnds,
    /// The drum touches the tub.
    Clearance,
}

impl Beyond {
    /// All of it.
    pub const ALL: [Self; 3] = [Self::SpringHooks, Self::DamperEnds, Self::Clearance];

    /// Returns the name in result files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SpringHooks => "spring_hooks",
            Self::DamperEnds => "damper_ends",
            Self::Clearance => "clearance",
        }
    }
}

/// A mode of the linear model that takes part in what grows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Participant {
    /// The mode's number, the slowest's being 1.
    pub mode: usize,
    /// The damped natural frequency while the drum turns (cycles per minute).
    pub frequency_cpm: f64,
    /// The motion of the mode.
    pub motion: ModeMotion,
    /// The mode's share of the growing motion's energy.
    pub share: f64,
}

/// A disturbance of a periodic response, by what a turn multiplies it with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbance {
    /// The drum's speed (rpm).
    pub speed_rpm: f64,
    /// Real and imaginary part of the Floquet multiplier.
    pub multiplier: [f64; 2],
}

impl Disturbance {
    /// Returns how fast it grows (1/s); below 0 where it decays.
    #[must_use]
    pub fn growth_per_s(&self) -> f64 {
        growth_per_s(self.multiplier, self.speed_rpm)
    }

    /// Returns the frequency (cycles per minute), known up to whole multiples of the drum's speed
    /// and sign: the one from 0 to half the speed.
    #[must_use]
    pub fn frequency_cpm(&self) -> f64 {
        let [re, im] = self.multiplier;
        libm::atan2(im.abs(), re) / TAU * self.speed_rpm
    }

    /// Returns the speed less the frequency: another that the same multiplier belongs to.
    #[must_use]
    pub fn other_frequency_cpm(&self) -> f64 {
        self.speed_rpm - self.frequency_cpm()
    }

    /// Returns the kind of response that it leads to.
    #[must_use]
    pub fn kind(&self) -> Kind {
        let [re, im] = self.multiplier;
        if self.growth_per_s() <= 0.0 {
            Kind::Stable
        } else if im != 0.0 {
            Kind::QuasiPeriodic
        } else if re < 0.0 {
            Kind::PeriodDoubling
        } else {
            Kind::Fold
        }
    }
}

impl Response {
    /// Returns the fastest growing disturbance, or the slowest to decay.
    #[must_use]
    pub fn disturbance(&self) -> Disturbance {
        Disturbance { speed_rpm: self.speed_rpm, multiplier: self.multiplier }
    }

    /// Returns how fast the fastest growing disturbance grows (1/s); below 0 where all decay.
    #[must_use]
    pub fn growth_per_s(&self) -> f64 {
        self.disturbance().growth_per_s()
    }

    /// Returns the frequency as [`Disturbance::frequency_cpm`] does.
    #[must_use]
    pub fn frequency_cpm(&self) -> f64 {
        self.disturbance().frequency_cpm()
    }

    /// Returns the kind of response that a disturbance leads to.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.disturbance().kind()
    }
}

/// Returns ln |mu| / T.
fn growth_per_s([re, im]: [f64; 2], speed_rpm: f64) -> f64 {
    0.5 * libm::log(re * re + im * im) * speed_rpm / 60.0
}

/// Why there is no answer at a speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoAnswer {
    /// The curve of responses does not get to this speed, and Newton's method does not find one.
    #[error("no periodic response was found")]
    NoResponse,
    /// A turn of the drum takes too many steps.
    #[error("the drum is too slow: a turn of it takes more than 32768 steps")]
    TooSlow,
    /// It was stopped.
    #[error("the search was stopped")]
    Stopped,
    /// The multipliers cannot be computed.
    #[error("the Floquet multipliers cannot be found: masses and stiffnesses are too far apart")]
    Eigenvalues,
}

/// Digits of a multiplier that count: its last ones are the processor's own.
const MULTIPLIER_DIGITS: f64 = (1_u64 << 36) as f64;

pub(crate) fn rounded(part: f64) -> f64 {
    (part * MULTIPLIER_DIGITS).round_ties_even() / MULTIPLIER_DIGITS
}

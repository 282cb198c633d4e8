//! Periodic responses of the machine at constant speeds, and their stability.

mod continuation;
mod corners;
mod crossing;
mod floquet_modes;
pub(crate) mod monodromy;
pub(crate) mod newton;
mod participation;
pub(crate) mod period_map;
#[cfg(test)]
mod reference_monodromy;
pub(crate) mod responses;
pub(crate) mod settings;
mod stepwise_monodromy;
#[cfg(test)]
mod tests;
pub(crate) mod turn;

use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::modes::shape::ModeMotion;
use crate::point::Point;
use core::f64::consts::TAU;

pub use crossing::{
    Crossing, CrossingEffect, LeftRangeError, follow_crossings, peaks_without_departures,
};
pub use floquet_modes::{FloquetMode, floquet_modes};
pub use responses::{ResponseCurves, find_responses};

/// A machine that turns at a constant speed.
#[derive(Clone, Copy, Debug)]
pub struct HeldSpeed<'a> {
    /// The machine.
    pub point: &'a Point,
    /// The drum's speed (rpm), above 0.
    pub speed_rpm: f64,
}

/// The way in which a periodic response loses its stability, if it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StabilityKind {
    /// Every disturbance decays.
    Stable,
    /// A multiplier is below -1: the motion repeats every second turn.
    PeriodDoubling,
    /// A complex pair is outside of the unit circle: the motion has a second frequency, which is
    /// not locked to the drum's.
    QuasiPeriodic,
    /// A multiplier is above 1: the response jumps to another.
    Fold,
}

impl StabilityKind {
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

/// A periodic response at a constant speed, and its stability.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// The drum's speed (rpm).
    pub speed_rpm: f64,
    /// Whether the response is on the curve of responses that begins at a low speed.
    pub is_on_curve: bool,
    /// The number of folds on the curve before the response: 0 is the branch of a machine that
    /// runs up. On a second curve, which comes down from a high speed if the first one is lost, the
    /// numbers continue; a response on neither curve has one more than the last at its speed.
    pub branch: u32,
    /// The speeds (rpm) of the lower and of the upper fold at the ends of the branch; `None` at an
    /// end without a fold.
    pub fold_speeds_rpm: [Option<f64>; 2],
    /// The limit of the machine's geometry that the nonlinear response exceeds, if it does.
    pub exceeded_limit: Option<GeometryLimit>,
    /// The largest deviations from equilibrium over a turn by the nonlinear model, in the order of
    /// [`Channel::ALL`](crate::Channel::ALL) (m, rad).
    pub nonlinear_peaks: [f64; CHANNELS],
    /// The largest deviations from equilibrium over a turn by the linear model.
    pub linear_peaks: [f64; CHANNELS],
    /// The state of the nonlinear response at which the unbalance is up: coordinates q1 to q10 (m,
    /// rad), then their speeds (per s).
    pub start_state: [f64; STATES],
    /// The Floquet multiplier of the nonlinear response, real and imaginary part (not negative):
    /// the largest of those that belong to motions of the suspension. Motions of the bearings are
    /// excluded, because their modes are capped; motions of the hinge are excluded if the hinge's
    /// modes are capped, which they are while they are fast compared with the drum's speed.
    pub multiplier: [f64; 2],
    /// The modes that take part in the disturbance that grows fastest, the greatest share first;
    /// empty if no disturbance grows.
    pub participating_modes: Vec<ParticipatingMode>,
}

/// A limit of the machine's geometry, beyond which the equations do not hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GeometryLimit {
    /// The tub end of a spring passes the spring's hook at the cabinet.
    SpringHooks,
    /// The tub end of a damper passes the damper's cabinet end.
    DamperEnds,
    /// The drum touches the tub.
    Clearance,
}

impl GeometryLimit {
    /// All limits.
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

/// A mode of the linear model that takes part in a growing disturbance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParticipatingMode {
    /// The number of the mode, 1 for the slowest.
    pub mode: usize,
    /// The damped natural frequency while the drum turns (cycles per minute).
    pub frequency_cpm: f64,
    /// The motion of the mode.
    pub motion: ModeMotion,
    /// The mode's share of the disturbance's energy.
    pub share: f64,
}

/// A small disturbance of a periodic response, which a turn multiplies by its Floquet multiplier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbance {
    /// The drum's speed (rpm).
    pub speed_rpm: f64,
    /// The real and the imaginary part of the Floquet multiplier.
    pub multiplier: [f64; 2],
}

impl Disturbance {
    /// Returns the growth of the disturbance (1/s), which is negative if it decays.
    #[must_use]
    pub fn growth_per_s(&self) -> f64 {
        growth_per_s(self.multiplier, self.speed_rpm)
    }

    /// Returns the frequency of the disturbance (cycles per minute) from 0 to half the drum's
    /// speed. Frequencies that differ by sign or by multiples of that speed are equivalent.
    #[must_use]
    pub fn frequency_cpm(&self) -> f64 {
        let [re, im] = self.multiplier;
        libm::atan2(im.abs(), re) / TAU * self.speed_rpm
    }

    /// Returns the drum's speed less the frequency, an equivalent frequency (cycles per minute).
    #[must_use]
    pub fn complementary_frequency_cpm(&self) -> f64 {
        self.speed_rpm - self.frequency_cpm()
    }

    /// Returns the kind of stability of a response whose fastest growing disturbance this is.
    #[must_use]
    pub fn kind(&self) -> StabilityKind {
        let [re, im] = self.multiplier;
        if self.growth_per_s() <= 0.0 {
            StabilityKind::Stable
        } else if im != 0.0 {
            StabilityKind::QuasiPeriodic
        } else if re < 0.0 {
            StabilityKind::PeriodDoubling
        } else {
            StabilityKind::Fold
        }
    }
}

impl Response {
    /// Returns the fastest growing disturbance, or the slowest to decay.
    #[must_use]
    pub fn disturbance(&self) -> Disturbance {
        Disturbance { speed_rpm: self.speed_rpm, multiplier: self.multiplier }
    }

    /// Returns the growth of the fastest growing disturbance (1/s), negative if all decay.
    #[must_use]
    pub fn growth_per_s(&self) -> f64 {
        self.disturbance().growth_per_s()
    }

    /// Returns [`Disturbance::frequency_cpm`] of the fastest growing disturbance.
    #[must_use]
    pub fn frequency_cpm(&self) -> f64 {
        self.disturbance().frequency_cpm()
    }

    /// Returns the kind of stability of the response.
    #[must_use]
    pub fn kind(&self) -> StabilityKind {
        self.disturbance().kind()
    }
}

/// Returns ln |mu| / T (1/s), with the multiplier mu and the duration T of a turn.
fn growth_per_s([re, im]: [f64; 2], speed_rpm: f64) -> f64 {
    0.5 * libm::log(re * re + im * im) * speed_rpm / 60.0
}

/// The reason why there is no response at a speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ResponseError {
    /// The curve of responses does not reach the speed, and Newton's method does not converge.
    #[error("no periodic response was found")]
    NoResponse,
    /// A turn of the drum takes too many steps.
    #[error("the drum is too slow: a turn of it takes more than 32768 steps")]
    TooSlow,
    /// The search was stopped.
    #[error("the search was stopped")]
    Stopped,
    /// The eigenvalues of the monodromy matrix cannot be computed.
    #[error("the Floquet multipliers cannot be found: masses and stiffnesses are too far apart")]
    NoEigenvalues,
}

/// The reciprocal of the unit to which multipliers are rounded. Basis: the last digits of an
/// eigenvalue depend on the processor. Doubling it keeps one binary digit more.
const ROUNDING_PER_UNIT: f64 = (1_u64 << 36) as f64;

/// Rounds a number to digits that do not depend on the processor.
pub(crate) fn round_last_digits(value: f64) -> f64 {
    (value * ROUNDING_PER_UNIT).round_ties_even() / ROUNDING_PER_UNIT
}

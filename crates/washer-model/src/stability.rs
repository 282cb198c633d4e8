//! The machine at constant speeds: its periodic response, and whether that is stable.

mod crossing;
mod exponents;
mod orbit;
mod participants;
#[cfg(test)]
mod plain;
mod turn;

use crate::fast::{HINGE_TO_DRUM, SUSPENSION_MODES, hinge_shift};
use crate::modes::{Modes, highest_frequency_rad_per_s, modes, motions_with_caps};
use crate::nonlinear::coupling::Caps;

use crate::channel::CHANNELS;
use crate::coordinates::{COORDINATES, STATES};
use crate::modes::shape::Motion;
use crate::point::Point;
use core::f64::consts::TAU;
use faer::Mat;
use lane_ode::Simd;
use lane_ode::rk4::RK4_STABILITY_LIMIT;
use orbit::{Found, Respond, Row};
use participants::{named, shares};

pub use crossing::{Crossed, Crossing, LeftRange, cross, peaks_without_departures};
pub use exponents::{Exact, exact_motions};

#[cfg(test)]
mod tests;

/// A machine that turns at a constant speed.
#[derive(Clone, Copy, Debug)]
pub struct Dwell<'a> {
    /// The machine.
    pub point: &'a Point,
    /// Its drum's speed (rpm), above 0.
    pub speed_rpm: f64,
}

/// How a periodic response loses its stability, or that it does not.
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

    /// Name in result files.
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
    /// Largest deviation from equilibrium over a turn by the nonlinear model, in the order of
    /// [`Channel::ALL`](crate::Channel::ALL) (m, rad).
    pub nonlinear: [f64; CHANNELS],
    /// The same by the linear model.
    pub linear: [f64; CHANNELS],
    /// The nonlinear response where the unbalance is up: coordinates q1 to q10 (m, rad), then their
    /// speeds (per s).
    pub start: [f64; STATES],
    /// Floquet multiplier of the nonlinear response, real and imaginary part (not negative): the
    /// largest of those whose motion is the suspension's. Motions of the bearings are left out, and
    /// those of the hinge while the drum is slow beside it: their modes are capped.
    pub multiplier: [f64; 2],
    /// Modes that take part in what grows, most first; none if nothing grows.
    pub participants: Vec<Participant>,
}

/// A mode of the linear model that takes part in what grows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Participant {
    /// Its number, the slowest's being 1.
    pub mode: usize,
    /// Its damped natural frequency while the drum turns (cycles per minute).
    pub frequency_cpm: f64,
    /// What moves.
    pub motion: Motion,
    /// Its share of the growing motion's energy.
    pub share: f64,
}

impl Response {
    /// How fast the fastest growing disturbance grows (1/s); below 0 where all decay.
    #[must_use]
    pub fn growth_per_s(&self) -> f64 {
        growth_per_s(self.multiplier, self.speed_rpm)
    }

    /// The frequency of that disturbance (cycles per minute), known up to whole multiples of the
    /// drum's speed and sign: the one from 0 to half the speed. The speed less this is another.
    #[must_use]
    pub fn frequency_cpm(&self) -> f64 {
        let [re, im] = self.multiplier;
        libm::atan2(im.abs(), re) / TAU * self.speed_rpm
    }

    /// What a disturbance turns the response into.
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

/// ln |mu| / T.
fn growth_per_s([re, im]: [f64; 2], speed_rpm: f64) -> f64 {
    0.5 * libm::log(re * re + im * im) * speed_rpm / 60.0
}

/// Why there is no answer at a speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoAnswer {
    /// Newton's method does not find a periodic response from the linear model's.
    #[error("no periodic response was found from the linear model's")]
    NoResponse,
    /// The multipliers cannot be computed.
    #[error("the Floquet multipliers cannot be found: masses and stiffnesses are too far apart")]
    Eigenvalues,
}

/// The periodic responses at constant speeds, on lanes. What is found does not depend on what else
/// is looked for.
///
/// # Errors
/// Per dwell: [`NoAnswer`].
#[must_use]
pub fn respond(simd: Simd, dwells: &[Dwell<'_>]) -> Vec<Result<Response, NoAnswer>> {
    let cases: Vec<Option<Case<'_>>> = dwells.iter().map(|dwell| case(dwell).ok()).collect();
    let mut order: Vec<(usize, &Case<'_>)> =
        cases.iter().enumerate().filter_map(|(k, case)| Some((k, case.as_ref()?))).collect();
    // Lanes turn in equally many steps, all with caps or none.
    let alike = |(_, case): &(usize, &Case<'_>)| (case.row.steps, case.row.caps.is_some());
    order.sort_by_key(alike);
    let mut answers = vec![Err(NoAnswer::Eigenvalues); dwells.len()];
    for together in order.chunk_by(|a, b| alike(a) == alike(b)) {
        let rows: Vec<Row<'_>> = together.iter().map(|(_, case)| case.row).collect();
        let found = simd.dispatch(Respond { rows: &rows });
        for ((k, case), found) in together.iter().zip(found) {
            answers[*k] = found.ok_or(NoAnswer::NoResponse).and_then(|found| answer(case, &found));
        }
    }
    answers
}

/// Digits of a multiplier that count: its last ones are the processor's own.
const MULTIPLIER_DIGITS: f64 = (1_u64 << 36) as f64;

fn rounded(part: f64) -> f64 {
    (part * MULTIPLIER_DIGITS).round_ties_even() / MULTIPLIER_DIGITS
}

/// Steps a turn, at least, and what their number is a multiple of.
const STEPS: usize = 96;

/// Longest step times the fastest of the suspension's modes, all of which the steps must follow.
const LONGEST_PHASE: f64 = 0.25;

/// Step times cap, as a share of the formula's limit. Gyroscopic effects may make whirls of the
/// capped hinge faster than its cap.
const CAP_SHARE: f64 = 0.7;

/// Step times the fastest mode, where none is capped.
const PLAIN_PHASE: f64 = 1.0;

/// Caps may move modes of the suspension by this much (1/s, rad/s).
const MOST_SHIFT_PER_S: f64 = 3e-4;

/// A motion is judged if the modes that are right have this share of its energy.
const JUDGED_SHARE: f64 = 0.5;

/// A row, and what is known of its machine with theta frozen.
struct Case<'a> {
    row: Row<'a>,
    frozen: Modes,
}

/// With as many steps a turn as its drum's speed and the suspension's modes ask for, and caps as
/// high as these steps allow. Where these would move the suspension's modes, there are more steps;
/// where the drum is not slow beside the hinge, there are no caps (`fast.rs`).
fn case<'a>(dwell: &Dwell<'a>) -> Result<Case<'a>, NoAnswer> {
    let Dwell { point, speed_rpm } = *dwell;
    let (turn_s, speed) = (60.0 / speed_rpm, speed_rpm * TAU / 60.0);
    let frozen = modes(point, 0.0, speed).map_err(|_| NoAnswer::Eigenvalues)?;
    let rest = modes(point, 0.0, 0.0).map_err(|_| NoAnswer::Eigenvalues)?;
    let fastest = rest.modes[SUSPENSION_MODES - 1].magnitude_rad_per_s;
    let mut steps =
        STEPS * (fastest * turn_s / (LONGEST_PHASE * STEPS as f64)).ceil().max(1.0) as usize;
    if rest.modes[SUSPENSION_MODES].magnitude_rad_per_s >= HINGE_TO_DRUM * speed {
        let highest = rest.modes[COORDINATES - 1].magnitude_rad_per_s;
        // More steps than that cap nothing.
        while (steps as f64) < highest * turn_s {
            let cap = CAP_SHARE * RK4_STABILITY_LIMIT * steps as f64 / turn_s;
            let caps = Caps { bearings_rad_per_s: cap, hinge_rad_per_s: Some(cap) };
            if shift_per_s(point, speed, &frozen, &caps)? <= MOST_SHIFT_PER_S {
                return Ok(Case { row: Row { point, speed_rpm, steps, caps: Some(caps) }, frozen });
            }
            steps *= 2;
        }
    }
    let highest = highest_frequency_rad_per_s(point, speed).map_err(|_| NoAnswer::Eigenvalues)?;
    let steps = STEPS * (highest * turn_s / (PLAIN_PHASE * STEPS as f64)).ceil().max(1.0) as usize;
    Ok(Case { row: Row { point, speed_rpm, steps, caps: None }, frozen })
}

/// How far caps move the suspension's modes.
fn shift_per_s(
    point: &Point,
    speed_rad_per_s: f64,
    frozen: &Modes,
    caps: &Caps,
) -> Result<f64, NoAnswer> {
    let of_bearings = Caps { hinge_rad_per_s: None, ..*caps };
    let capped = motions_with_caps(point, speed_rad_per_s, &of_bearings)
        .map_err(|_| NoAnswer::Eigenvalues)?;
    let shifts = frozen.modes.iter().zip(&capped).take(SUSPENSION_MODES).map(|(mode, capped)| {
        let (slower, detuned) = (capped.s.re - mode.re_per_s, capped.s.im - mode.im_rad_per_s);
        let of_hinge = hinge_shift(point, mode, speed_rad_per_s, caps.hinge_rad_per_s);
        (slower * slower + detuned * detuned).sqrt() + of_hinge
    });
    Ok(shifts.fold(0.0, f64::max))
}

fn answer(case: &Case<'_>, found: &Found) -> Result<Response, NoAnswer> {
    let matrix = Mat::from_fn(STATES, STATES, |i, j| found.monodromy[i][j].0);
    let mut multipliers = matrix.eigenvalues().map_err(|_| NoAnswer::Eigenvalues)?;
    if multipliers.iter().any(|mu| !mu.re.is_finite() || !mu.im.is_finite()) {
        return Err(NoAnswer::Eigenvalues);
    }
    multipliers.retain(|mu| mu.im >= 0.0);
    multipliers
        .sort_by(|a, b| b.norm_sqr().total_cmp(&a.norm_sqr()).then_with(|| b.im.total_cmp(&a.im)));
    let judged = if case.row.caps.is_some() { SUSPENSION_MODES } else { SUSPENSION_MODES + 2 };
    for mu in multipliers {
        let shares = shares(case, &matrix, mu);
        let share: f64 = shares.iter().filter(|(mode, _)| *mode < judged).map(|(_, e)| e).sum();
        if !(share >= JUDGED_SHARE) {
            continue;
        }
        let mut response = Response {
            speed_rpm: case.row.speed_rpm,
            nonlinear: found.nonlinear,
            linear: found.linear,
            start: found.start,
            multiplier: [mu.re, mu.im].map(rounded),
            participants: Vec::new(),
        };
        if response.kind() != Kind::Stable {
            response.participants = named(case, &shares);
        }
        return Ok(response);
    }
    Err(NoAnswer::Eigenvalues)
}

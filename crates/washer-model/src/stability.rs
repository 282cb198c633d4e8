//! The machine at constant speeds: its periodic response, and whether that is stable.

mod crossing;
mod exponents;
mod monodromy;
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
use participants::{named, shares, vector_of};
use std::collections::BTreeMap;
use std::rc::Rc;

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

/// A disturbance of a periodic response, by what a turn multiplies it with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbance {
    /// The drum's speed (rpm).
    pub speed_rpm: f64,
    /// Real and imaginary part of the Floquet multiplier.
    pub multiplier: [f64; 2],
}

impl Disturbance {
    /// How fast it grows (1/s); below 0 where it decays.
    #[must_use]
    pub fn growth_per_s(&self) -> f64 {
        growth_per_s(self.multiplier, self.speed_rpm)
    }

    /// Its frequency (cycles per minute), known up to whole multiples of the drum's speed and sign:
    /// the one from 0 to half the speed.
    #[must_use]
    pub fn frequency_cpm(&self) -> f64 {
        let [re, im] = self.multiplier;
        libm::atan2(im.abs(), re) / TAU * self.speed_rpm
    }

    /// The speed less the frequency: another that the same multiplier belongs to.
    #[must_use]
    pub fn other_frequency_cpm(&self) -> f64 {
        self.speed_rpm - self.frequency_cpm()
    }

    /// What it turns the response into.
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
    /// The fastest growing disturbance, or the slowest to decay.
    #[must_use]
    pub fn disturbance(&self) -> Disturbance {
        Disturbance { speed_rpm: self.speed_rpm, multiplier: self.multiplier }
    }

    /// How fast the fastest growing disturbance grows (1/s); below 0 where all decay.
    #[must_use]
    pub fn growth_per_s(&self) -> f64 {
        self.disturbance().growth_per_s()
    }

    /// As [`Disturbance::frequency_cpm`].
    #[must_use]
    pub fn frequency_cpm(&self) -> f64 {
        self.disturbance().frequency_cpm()
    }

    /// What a disturbance turns the response into.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.disturbance().kind()
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
/// A response is the one that Newton's method reaches from the linear model's; where that fails,
/// the one that is reached by following it from lower speeds. Where growth is close to 0, it is
/// that of the machine as it is, by classical Runge-Kutta in steps that follow its bearings.
///
/// # Errors
/// Per dwell: [`NoAnswer`].
#[must_use]
pub fn respond(dwells: &[Dwell<'_>]) -> Vec<Result<Response, NoAnswer>> {
    let mut settings: Vec<Settings<'_>> = Vec::new();
    let cases: Vec<Result<Case<'_>, NoAnswer>> = dwells
        .iter()
        .map(|dwell| {
            if settings.last().is_none_or(|last| !core::ptr::eq(last.point, dwell.point)) {
                settings.push(Settings::new(dwell.point));
            }
            settings.last_mut().ok_or(NoAnswer::Eigenvalues)?.case(dwell.speed_rpm)
        })
        .collect();
    let mut answers = answers(&cases);
    // What is close to an edge is asked of the machine as it is.
    let close: Vec<usize> = (0..answers.len())
        .filter(|&k| {
            let is_capped = cases[k].as_ref().is_ok_and(|case| case.row.caps.is_some());
            let is_close =
                |response: &Response| response.growth_per_s().abs() < CLOSE_TO_EDGE_PER_S;
            is_capped && answers[k].as_ref().is_ok_and(is_close)
        })
        .collect();
    let plain: Vec<Result<Case<'_>, NoAnswer>> = close
        .iter()
        .map(|&k| {
            let start = answers[k].as_ref().map_err(|none| *none)?.start;
            cases[k].as_ref().map_err(|none| *none)?.without_caps(start)
        })
        .collect();
    for (k, response) in close.into_iter().zip(self::answers(&plain)) {
        answers[k] = response;
    }
    answers
}

/// The answers of some cases, on lanes.
fn answers(cases: &[Result<Case<'_>, NoAnswer>]) -> Vec<Result<Response, NoAnswer>> {
    let mut order: Vec<(usize, &Case<'_>)> =
        cases.iter().enumerate().filter_map(|(k, case)| Some((k, case.as_ref().ok()?))).collect();
    // Lanes turn in equally many steps, all with caps or none.
    let alike = |(_, case): &(usize, &Case<'_>)| (case.row.steps, case.row.caps.is_some());
    order.sort_by_key(alike);
    let mut answers: Vec<Result<Response, NoAnswer>> = cases
        .iter()
        .map(|case| Err(case.as_ref().err().copied().unwrap_or(NoAnswer::NoResponse)))
        .collect();
    for together in order.chunk_by(|a, b| alike(a) == alike(b)) {
        let rows: Vec<Row<'_>> = together.iter().map(|(_, case)| case.row).collect();
        let found = Simd::dispatch_narrow(Respond { rows: &rows });
        for ((k, case), found) in together.iter().zip(found) {
            let found = found.or_else(|| followed(case));
            answers[*k] = found.ok_or(NoAnswer::NoResponse).and_then(|found| answer(case, &found));
        }
    }
    answers
}

/// A response that is followed from lower speeds, each the start of the search at the next: first
/// from a little below, then from farther below.
fn followed(case: &Case<'_>) -> Option<Box<Found>> {
    let one = |speed_rpm: f64, from: Option<[f64; STATES]>| {
        Simd::dispatch_narrow(Respond { rows: &[Row { speed_rpm, from, ..case.row }] })
            .pop()
            .flatten()
    };
    let speed_rpm = case.row.speed_rpm;
    FOLLOWED_FROM.iter().find_map(|below| {
        let mut at_rpm = speed_rpm * (1.0 - below);
        let mut step_rpm = speed_rpm - at_rpm;
        let mut found = one(at_rpm, None)?;
        while at_rpm < speed_rpm {
            let next_rpm = (at_rpm + step_rpm).min(speed_rpm);
            match one(next_rpm, Some(found.start)) {
                Some(next) => (at_rpm, found) = (next_rpm, next),
                None => step_rpm *= 0.5,
            }
            if step_rpm < LEAST_STEP * speed_rpm {
                return None;
            }
        }
        Some(found)
    })
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

/// Growth closer to 0 than this (1/s) is asked of the machine as it is: it is more than caps may
/// move it.
const CLOSE_TO_EDGE_PER_S: f64 = 2e-3;

/// How far below its speed a response is followed from, as shares of it.
const FOLLOWED_FROM: [f64; 4] = [0.005, 0.02, 0.05, 0.1];

/// Shortest step in speed by which a response is followed, as a share of the speed.
const LEAST_STEP: f64 = 1e-5;

/// Ranges of speed in a doubling of it, in each of which steps and caps are chosen once.
const RANGES: f64 = 4.0;

/// A row, and what is known of its machine with theta frozen.
struct Case<'a> {
    row: Row<'a>,
    /// At the low end of the range that the speed is in.
    frozen: Rc<Modes>,
    /// Modes that are judged, the slowest.
    judged: usize,
}

impl<'a> Case<'a> {
    /// The same for the machine as it is, with a search that starts close to the response.
    fn without_caps(&self, start: [f64; STATES]) -> Result<Self, NoAnswer> {
        let steps = plain_steps(self.row.point, self.row.speed_rpm, self.row.turn_s())?;
        let row = Row { steps, caps: None, from: Some(start), ..self.row };
        Ok(Self { row, frozen: Rc::clone(&self.frozen), judged: self.judged })
    }
}

/// Steps of a turn that follow all modes.
fn plain_steps(point: &Point, speed_rpm: f64, turn_s: f64) -> Result<usize, NoAnswer> {
    let highest = highest_frequency_rad_per_s(point, speed_rpm * TAU / 60.0)
        .map_err(|_| NoAnswer::Eigenvalues)?;
    Ok(STEPS * (highest * turn_s / (PLAIN_PHASE * STEPS as f64)).ceil().max(1.0) as usize)
}

/// Steps and caps at a point's speeds.
struct Settings<'a> {
    point: &'a Point,
    rest: Option<Modes>,
    ranges: BTreeMap<i64, Result<Setting, NoAnswer>>,
}

/// Those of a range of speeds.
#[derive(Clone)]
struct Setting {
    frozen: Rc<Modes>,
    steps: usize,
    is_capped: bool,
}

impl<'a> Settings<'a> {
    fn new(point: &'a Point) -> Self {
        Self { point, rest: modes(point, 0.0, 0.0).ok(), ranges: BTreeMap::new() }
    }

    fn case(&mut self, speed_rpm: f64) -> Result<Case<'a>, NoAnswer> {
        let range = (RANGES * libm::log2(speed_rpm)).floor();
        let point = self.point;
        let rest = self.rest.as_ref().ok_or(NoAnswer::Eigenvalues)?;
        let setting = self.ranges.entry(range as i64).or_insert_with(|| {
            let end_rpm = |range: f64| libm::exp2(range / RANGES);
            setting(point, rest, [end_rpm(range), end_rpm(range + 1.0)])
        });
        let Setting { frozen, steps, is_capped } = setting.clone()?;
        let caps = is_capped.then(|| caps(steps, 60.0 / speed_rpm));
        let row = Row { point, speed_rpm, steps, caps, from: None };
        let judged = if is_capped { SUSPENSION_MODES } else { SUSPENSION_MODES + 2 };
        Ok(Case { row, frozen, judged })
    }
}

/// As many steps a turn as the suspension's modes ask for in a range of speeds, and caps as high as
/// these steps allow. Where these would move the suspension's modes, there are more steps; where
/// the drum is not slow beside the hinge, there are no caps (`fast.rs`).
fn setting(point: &Point, rest: &Modes, ends_rpm: [f64; 2]) -> Result<Setting, NoAnswer> {
    let of_modes = |speed_rpm: f64| {
        modes(point, 0.0, speed_rpm * TAU / 60.0).map_err(|_| NoAnswer::Eigenvalues)
    };
    let frozen = [of_modes(ends_rpm[0])?, of_modes(ends_rpm[1])?];
    let turn_s = 60.0 / ends_rpm[0];
    let fastest = rest.modes[SUSPENSION_MODES - 1].magnitude_rad_per_s;
    let mut steps =
        STEPS * (fastest * turn_s / (LONGEST_PHASE * STEPS as f64)).ceil().max(1.0) as usize;
    let mut is_capped = false;
    let top_rad_per_s = ends_rpm[1] * TAU / 60.0;
    if rest.modes[SUSPENSION_MODES].magnitude_rad_per_s >= HINGE_TO_DRUM * top_rad_per_s {
        let highest = rest.modes[COORDINATES - 1].magnitude_rad_per_s;
        // More steps than that cap nothing.
        while !is_capped && (steps as f64) < highest * turn_s {
            let shift = |end: usize| {
                let caps = caps(steps, 60.0 / ends_rpm[end]);
                shift_per_s(point, ends_rpm[end] * TAU / 60.0, &frozen[end], &caps)
            };
            is_capped = shift(0)?.max(shift(1)?) <= MOST_SHIFT_PER_S;
            if !is_capped {
                steps *= 2;
            }
        }
    }
    if !is_capped {
        steps =
            plain_steps(point, ends_rpm[0], turn_s)?.max(plain_steps(point, ends_rpm[1], turn_s)?);
    }
    let [frozen, _] = frozen;
    Ok(Setting { frozen: Rc::new(frozen), steps, is_capped })
}

/// As high as so many steps a turn allow.
fn caps(steps: usize, turn_s: f64) -> Caps {
    let cap = CAP_SHARE * RK4_STABILITY_LIMIT * steps as f64 / turn_s;
    Caps { bearings_rad_per_s: cap, hinge_rad_per_s: Some(cap) }
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
    for mu in multipliers {
        let vector = vector_of(&matrix, mu);
        let shares = shares(&case.frozen, &vector, case.row.unit_per_s());
        let share: f64 =
            shares.iter().filter(|(mode, _)| *mode < case.judged).map(|(_, e)| e).sum();
        // Not finite where there is no such disturbance.
        if share.is_nan() || share < JUDGED_SHARE {
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
            let speed = case.row.speed_rpm * TAU / 60.0;
            let frozen = modes(case.row.point, 0.0, speed).map_err(|_| NoAnswer::Eigenvalues)?;
            response.participants = named(case.row.point, &frozen, &vector, case.row.unit_per_s());
        }
        return Ok(response);
    }
    Err(NoAnswer::Eigenvalues)
}

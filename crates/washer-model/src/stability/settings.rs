//! Steps and caps at constant speeds, and what of a machine's motion they leave right.

use super::NoAnswer;
use super::monodromy::{INSTANTS, INSTANTS_AT_CORNERS};
use super::orbit::{Row, caps};
use crate::coordinates::COORDINATES;
use crate::modes::{Mode, Modes, highest_frequency_rad_per_s, modes, motions};
use crate::nonlinear::coupling::{BACKWARD_SHARE, Caps};
use crate::point::Point;
use crate::steps::{HINGE_TO_DRUM, SUSPENSION_MODES};
use core::f64::consts::TAU;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The factor of the number of steps where so many are not enough.
const MORE_STEPS: f64 = 1.5;

/// The part of a capped hinge's shift that affects motions: its law is exact for motion that turns
/// with the drum.
const FREE_SHARE: f64 = 0.1;

/// Step times the fastest mode, where none is capped.
const PLAIN_PHASE: f64 = 1.0;

/// The limits for steps, caps and derivatives.
struct Care {
    /// Steps of a turn, at least.
    steps: usize,
    /// Instants of it at which derivatives are taken.
    instants: usize,
    /// Longest step times the fastest of the suspension's modes.
    phase: f64,
    /// The greatest shift of these modes by caps (1/s, rad/s).
    shift_per_s: f64,
    /// Longest steps (s) where friction and stops give forces corners.
    at_corners_s: f64,
}

/// The use of a setting.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Use {
    Rows,
    Followed,
}

/// The limits for rows.
const OF_ROWS: Care =
    Care { steps: 96, instants: INSTANTS, phase: 0.25, shift_per_s: 3e-4, at_corners_s: 1e-4 };

/// The limits for the linear model, whose forces have no corners, and whose response turns with the
/// drum; and where smooth responses are only followed: what lies on the curve is looked for anew.
const OF_FOLLOWED: Care =
    Care { steps: 48, instants: 8, phase: 0.4, shift_per_s: 3e-3, at_corners_s: f64::INFINITY };

/// The least number of steps of every turn where responses with corners are followed, and others
/// that ranges' own steps lose. A hit of a stop rings the hinge, by other steps or caps otherwise,
/// so that a change of these would break the curve. Basis: it is twice what smooth forces take at
/// low speeds. Doubling it doubles the time.
const LEAST_STEPS: usize = 256;
/// The greatest number of these steps. Basis: they are as short as contacts at usual speeds.
/// Doubling it makes a curve that is lost take twice as long.
const MOST_STEPS_FOLLOWED: usize = 2048;

/// The share of the slowest mode's frequency from which responses are followed. Basis: the second
/// harmonic is still below it. Doubling it begins amid resonances.
const LOWEST_SHARE: f64 = 0.45;
/// The number of parts of a turn per minute of which that is a multiple. Basis: an eigenvalue's
/// last digits are below it. Doubling it changes the speed by less than a hundredth rpm.
const LOWEST_DIGITS: f64 = 64.0;

/// The speed from which a second curve is followed down, over the fastest mode's frequency. Basis:
/// responses are small there. Doubling it takes more steps.
const HIGHEST_SHARE: f64 = 2.0;

/// Steps of a turn, at most: a drum so slow that it asks for more leaves its machine at rest, but
/// for its own unbalance going round.
const MOST_STEPS: usize = 1 << 15;

/// Ranges of speed in a doubling of it, in each of which steps and caps are chosen once.
const RANGES: f64 = 4.0;

/// A row, and what is known of its machine with theta frozen.
#[derive(Clone)]
pub(crate) struct Case<'a> {
    pub(crate) row: Row<'a>,
    /// At the low end of the range that the speed is in.
    pub(crate) frozen: Arc<Modes>,
    /// Modes that are judged, the slowest.
    pub(super) judged: usize,
}

impl<'a> Case<'a> {
    /// Returns the case for the machine as it is. A harmonic of the turn may ring its hinge, so
    /// derivatives are taken at as many instants as where forces have corners: fewer do not see
    /// that harmonic, and Newton's method fails.
    pub(crate) fn without_caps(&self) -> Result<Self, NoAnswer> {
        let steps = plain_steps(self.row.point, self.row.speed_rpm, self.row.turn_s())?;
        let steps = steps.next_multiple_of(INSTANTS_AT_CORNERS);
        let row = Row { steps, instants: INSTANTS_AT_CORNERS, caps: None, ..self.row };
        Ok(Self { row, frozen: Arc::clone(&self.frozen), judged: self.judged })
    }
}

/// Steps of a turn that follow all modes.
fn plain_steps(point: &Point, speed_rpm: f64, turn_s: f64) -> Result<usize, NoAnswer> {
    let highest = highest_frequency_rad_per_s(point, speed_rpm * TAU / 60.0)
        .map_err(|_| NoAnswer::Eigenvalues)?;
    whole(point, highest * turn_s / PLAIN_PHASE)
}

/// Returns at how many instants of a machine's turn derivatives are taken, at most.
fn most_instants(point: &Point) -> usize {
    if point.machine.elements.are_nonsmooth() { INSTANTS_AT_CORNERS } else { INSTANTS }
}

/// Returns at least so many steps, a multiple of [`most_instants`].
fn whole(point: &Point, steps: f64) -> Result<usize, NoAnswer> {
    let of = most_instants(point) as f64;
    let steps = of * (steps / of).ceil().max(1.0);
    if steps > MOST_STEPS as f64 { Err(NoAnswer::TooSlow) } else { Ok(steps as usize) }
}

/// Steps and caps at a point's speeds.
#[derive(Clone)]
pub(crate) struct Settings<'a> {
    pub(crate) point: &'a Point,
    /// Without friction, whose modes are asked for: friction that is taken at a low speed holds the
    /// linear model, not the machine.
    free: Cow<'a, Point>,
    rest: Option<Modes>,
    /// Modes where ranges begin, by range.
    frozen: BTreeMap<i64, Result<Arc<Modes>, NoAnswer>>,
    /// Steps of every turn where responses are followed, at least, if ranges do not choose them.
    steps: Option<usize>,
    /// The settings by range and use.
    ranges: BTreeMap<(i64, Use), Result<Setting, NoAnswer>>,
}

/// The setting of a range of speeds.
#[derive(Clone)]
struct Setting {
    frozen: Arc<Modes>,
    steps: usize,
    is_capped: bool,
}

/// Returns where a range begins (rpm).
fn begins_rpm(range: i64) -> f64 {
    libm::exp2(range as f64 / RANGES)
}

impl<'a> Settings<'a> {
    pub(crate) fn new(point: &'a Point) -> Self {
        let free = match point.friction_speeds().is_empty() {
            true => Cow::Borrowed(point),
            false => Cow::Owned(point.without_friction()),
        };
        let rest = modes(&free, 0.0, 0.0).ok();
        Self {
            point,
            free,
            rest,
            frozen: BTreeMap::new(),
            steps: point.machine.elements.are_nonsmooth().then_some(LEAST_STEPS),
            ranges: BTreeMap::new(),
        }
    }

    /// Returns the machine without friction.
    pub(super) fn without_friction(&self) -> &Point {
        &self.free
    }

    /// Returns from where responses are followed (rpm): below all that the suspension answers to.
    pub(super) fn lowest_rpm(&self) -> Result<f64, NoAnswer> {
        self.share_of_mode(LOWEST_SHARE, 0)
    }

    /// Returns from where they are followed down: above all that it answers to.
    pub(super) fn highest_rpm(&self) -> Result<f64, NoAnswer> {
        self.share_of_mode(HIGHEST_SHARE, SUSPENSION_MODES - 1)
    }

    fn share_of_mode(&self, share: f64, mode: usize) -> Result<f64, NoAnswer> {
        let rpm = self.rest.as_ref().ok_or(NoAnswer::Eigenvalues)?.modes[mode].frequency_rpm();
        // The last digits of an eigenvalue are the processor's own.
        Ok((share * rpm * LOWEST_DIGITS).ceil() / LOWEST_DIGITS)
    }

    /// Returns the case of a speed.
    ///
    /// # Errors
    /// [`NoAnswer::Eigenvalues`]; [`NoAnswer::TooSlow`].
    pub(crate) fn case(&mut self, speed_rpm: f64) -> Result<Case<'a>, NoAnswer> {
        self.chosen(speed_rpm, Use::Rows)
    }

    /// Returns a row for the linear model.
    pub(super) fn linear(&mut self, row: Row<'a>) -> Row<'a> {
        self.chosen(row.speed_rpm, Use::Followed).map_or(row, |case| case.row)
    }

    /// Returns the row of a speed where responses are only followed.
    ///
    /// # Errors
    /// As [`Self::case`].
    pub(super) fn followed(&mut self, speed_rpm: f64) -> Result<Row<'a>, NoAnswer> {
        let point = self.point;
        let Some(least) = self.steps else {
            return Ok(self.chosen(speed_rpm, Use::Followed)?.row);
        };
        let steps = self.steps_of_every_turn(least)?;
        let caps = Some(caps(steps, 60.0 / speed_rpm));
        Ok(Row { point, speed_rpm, steps, instants: steps, caps })
    }

    /// Returns the steps of every turn where responses are followed, at least so many.
    fn steps_of_every_turn(&self, least: usize) -> Result<usize, NoAnswer> {
        let rest = self.rest.as_ref().ok_or(NoAnswer::Eigenvalues)?;
        let fastest = rest.modes[SUSPENSION_MODES - 1].magnitude_rad_per_s;
        let longest_turn_s = 60.0 / self.lowest_rpm()?;
        let steps = whole(self.point, fastest * longest_turn_s / OF_FOLLOWED.phase)?;
        Ok(steps.max(least))
    }

    /// Returns the steps of a turn where responses are followed, if forces have corners.
    pub(super) fn steps_at_corners(&self) -> Option<usize> {
        let least = self.steps.filter(|_| self.point.machine.elements.are_nonsmooth())?;
        self.steps_of_every_turn(least).ok()
    }

    /// Follows responses by turns of more steps from now on; false if there are enough.
    pub(super) fn follow_closer(&mut self) -> bool {
        let steps = self.steps.map_or(LEAST_STEPS, |steps| 2 * steps);
        self.steps = Some(steps);
        steps <= MOST_STEPS_FOLLOWED
    }

    fn chosen(&mut self, speed_rpm: f64, of: Use) -> Result<Case<'a>, NoAnswer> {
        let range = (RANGES * libm::log2(speed_rpm)).floor() as i64;
        let care = match of {
            Use::Rows => OF_ROWS,
            Use::Followed => OF_FOLLOWED,
        };
        let known = self.ranges.get(&(range, of)).cloned();
        let setting = known.unwrap_or_else(|| {
            let setting = self.setting(range, &care);
            self.ranges.insert((range, of), setting.clone());
            setting
        });
        let Setting { frozen, steps, is_capped } = setting?;
        let point = self.point;
        let caps = is_capped.then(|| caps(steps, 60.0 / speed_rpm));
        let instants = care.instants * most_instants(point) / INSTANTS;
        let row = Row { point, speed_rpm, steps, instants, caps };
        let judged = if is_capped { SUSPENSION_MODES } else { SUSPENSION_MODES + 2 };
        Ok(Case { row, frozen, judged })
    }

    /// Modes where a range begins.
    fn frozen(&mut self, range: i64) -> Result<Arc<Modes>, NoAnswer> {
        let found = || modes(&self.free, 0.0, begins_rpm(range) * TAU / 60.0);
        let found = || found().map(Arc::new).map_err(|_| NoAnswer::Eigenvalues);
        self.frozen.entry(range).or_insert_with(found).clone()
    }

    /// Chooses as many steps a turn as the suspension's modes ask for in a range of speeds, and
    /// caps as high as these steps allow. Where these would move the suspension's modes, there are
    /// more steps; where the drum is not slow beside the hinge, there are no caps.
    fn setting(&mut self, range: i64, care: &Care) -> Result<Setting, NoAnswer> {
        let point = self.point;
        let ends_rpm = [range, range + 1].map(begins_rpm);
        let frozen = [self.frozen(range)?, self.frozen(range + 1)?];
        let rest = self.rest.as_ref().ok_or(NoAnswer::Eigenvalues)?;
        let turn_s = 60.0 / ends_rpm[0];
        let fastest = rest.modes[SUSPENSION_MODES - 1].magnitude_rad_per_s;
        let mut steps = whole(point, fastest * turn_s / care.phase)?.max(care.steps);
        if point.machine.elements.are_nonsmooth() {
            steps = steps.max(whole(point, turn_s / care.at_corners_s)?);
        }
        let mut is_capped = false;
        let top_rad_per_s = ends_rpm[1] * TAU / 60.0;
        if rest.modes[SUSPENSION_MODES].magnitude_rad_per_s >= HINGE_TO_DRUM * top_rad_per_s {
            let highest = rest.modes[COORDINATES - 1].magnitude_rad_per_s;
            // More steps than that cap nothing.
            while !is_capped && (steps as f64) < highest * turn_s {
                let shift = |end: usize| {
                    let caps = caps(steps, 60.0 / ends_rpm[end]);
                    shift_per_s(&self.free, ends_rpm[end] * TAU / 60.0, &frozen[end], &caps)
                };
                is_capped = shift(0)?.max(shift(1)?) <= care.shift_per_s;
                if !is_capped {
                    steps = whole(point, MORE_STEPS * steps as f64)?;
                }
            }
        }
        if !is_capped {
            let [low, high] = ends_rpm.map(|rpm| plain_steps(point, rpm, turn_s));
            steps = low?.max(high?);
        }
        let [frozen, _] = frozen;
        Ok(Setting { frozen, steps, is_capped })
    }
}

/// Returns the weighted shift (rad/s) of a suspension mode by the hinge's cap, if it has one, while
/// the drum turns.
fn hinge_shift(
    point: &Point,
    mode: &Mode,
    turning_rad_per_s: f64,
    cap_rad_per_s: Option<f64>,
) -> f64 {
    let Some(cap_rad_per_s) = cap_rad_per_s else { return 0.0 };
    let frequency = mode.magnitude_rad_per_s;
    let softening =
        (frequency * frequency - BACKWARD_SHARE * turning_rad_per_s * turning_rad_per_s).abs()
            + (1.0 - BACKWARD_SHARE) * frequency * turning_rad_per_s;
    let in_hinge = softening / (cap_rad_per_s * cap_rad_per_s);
    FREE_SHARE * 0.5 * mode.hinge_share(point) * frequency * in_hinge
}

/// Returns how far caps move the suspension's modes.
fn shift_per_s(
    point: &Point,
    speed_rad_per_s: f64,
    frozen: &Modes,
    caps: &Caps,
) -> Result<f64, NoAnswer> {
    let bearing_caps = Caps { hinge_rad_per_s: None, ..*caps };
    let capped =
        motions(point, speed_rad_per_s, Some(&bearing_caps)).map_err(|_| NoAnswer::Eigenvalues)?;
    let shifts = frozen.modes.iter().zip(&capped).take(SUSPENSION_MODES).map(|(mode, capped)| {
        let slower = capped.s.re - mode.re_per_s;
        let detuned = capped.s.im - mode.im_rad_per_s;
        let hinge_shift_per_s = hinge_shift(point, mode, speed_rad_per_s, caps.hinge_rad_per_s);
        (slower * slower + detuned * detuned).sqrt() + hinge_shift_per_s
    });
    Ok(shifts.fold(0.0, f64::max))
}

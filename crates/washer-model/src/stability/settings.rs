//! The choice of steps and caps at constant speeds, with limits on their effect on the suspension.

use super::ResponseError;
use super::monodromy::{INSTANTS_PER_TURN, INSTANTS_PER_TURN_WITH_CORNERS};
use super::period_map::{TurnSetup, caps_for_steps};
use crate::coordinates::COORDINATES;
use crate::modes::{Mode, Modes, highest_frequency_rad_per_s, mode_roots, modes};
use crate::nonlinear::coupling::{BACKWARD_WHIRL_RATIO, Caps};
use crate::point::Point;
use crate::steps::{MIN_HINGE_SPEED_RATIO, SUSPENSION_MODES};
use core::f64::consts::TAU;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The factor by which the number of steps grows if caps shift modes too far. Doubling it may take
/// up to twice as many steps as needed.
const STEP_COUNT_INCREASE_FACTOR: f64 = 1.5;

/// The assumed share of a motion that does not rotate with the drum. Only this share has the
/// frequency error of a capped hinge. Basis: the law of the capped hinge is exact for motion that
/// turns with the drum, which most motion does. Doubling it takes more steps.
const NON_ROTATING_MOTION_SHARE: f64 = 0.1;

/// The product of step and frequency of the fastest mode (rad), if none is capped. Doubling it
/// makes errors of that mode 16 times as large.
const UNCAPPED_STEP_PHASE_RAD: f64 = 1.0;

/// The limits of steps, caps and derivatives.
struct AccuracyLimits {
    /// The least number of steps of a turn.
    min_steps: usize,
    /// The number of instants of a turn at which derivatives are computed, if no force has corners.
    instant_count: usize,
    /// The greatest product of step and frequency of the suspension's fastest mode (rad).
    max_step_phase_rad: f64,
    /// The greatest shift of the suspension's modes by caps (1/s, rad/s).
    max_shift_per_s: f64,
    /// The longest step (s) if friction or stops give forces corners.
    max_corner_step_s: f64,
}

/// The purpose for which turns are integrated.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Purpose {
    /// The responses at requested speeds.
    Response,
    /// The continuation of the curve, and the linear model.
    Continuation,
}

/// The limits for responses at requested speeds.
const RESPONSE_LIMITS: AccuracyLimits = AccuracyLimits {
    min_steps: 96,
    instant_count: INSTANTS_PER_TURN,
    max_step_phase_rad: 0.25,
    max_shift_per_s: 3e-4,
    max_corner_step_s: 1e-4,
};

/// The limits for the continuation of smooth responses, which are computed again at requested
/// speeds; and for the linear model, whose forces have no corners and whose response turns with the
/// drum.
const CONTINUATION_LIMITS: AccuracyLimits = AccuracyLimits {
    min_steps: 48,
    instant_count: 8,
    max_step_phase_rad: 0.4,
    max_shift_per_s: 3e-3,
    max_corner_step_s: f64::INFINITY,
};

/// The least number of steps of every turn in the continuation of responses with corners, and of
/// other responses whose curve is lost with steps that change from range to range. An impact on a
/// stop makes the hinge ring in a way that depends on steps and caps, so that a change of steps or
/// caps would break the curve. Basis: smooth forces take half as many steps at low speeds. Doubling
/// it doubles the time.
const MIN_CONTINUATION_STEPS: usize = 256;

/// The least width of the corners of stops and free strokes in the continuation, over the duration
/// of a step (m/s).
///
/// If a tub passes corners within a step, the period map has ripples, on which the curve folds back
/// again and again until it is lost. So the continuation follows a machine with wider corners, and
/// responses at requested speeds are found from its curve with the corners as they are. Basis: a
/// tub that swings by 40 mm at 25 rad/s reaches 1 m/s, so that a corner takes two steps; of the
/// machine in test `a_curve_passes_the_corners_of_stops`, a width of 0.5 mm at all speeds leaves
/// nine times as many folds as one of 1 mm. Doubling it shifts folds twice as far from those of the
/// machine as it is.
const CORNER_WIDTH_PER_STEP_M_PER_S: f64 = 1.0;

/// The greatest number of steps of every turn in the continuation. Basis: these steps are as short
/// as contacts at usual speeds. Doubling it doubles the time of curves that are lost.
const MAX_CONTINUATION_STEPS: usize = 2048;

/// The speed at which the continuation begins, over the slowest mode's frequency. Basis: the second
/// harmonic of the speed is still below that mode. Doubling it begins amid resonances.
const LOWEST_SPEED_RATIO: f64 = 0.45;
/// The reciprocal of the unit (rpm) to which the first speed is rounded up. Basis: the last digits
/// of an eigenvalue depend on the processor. Doubling it changes the speed by less than 0.01 rpm.
const SPEED_ROUNDING_PER_RPM: f64 = 64.0;

/// The speed from which a second curve is continued down, over the frequency of the suspension's
/// fastest mode. Basis: responses are small at this speed. Doubling it takes more steps.
const HIGHEST_SPEED_RATIO: f64 = 2.0;

/// The greatest number of steps of a turn. Basis: a drum that needs more is so slow that the
/// machine follows its unbalance statically. Doubling it allows half the speed.
const MAX_STEPS_PER_TURN: usize = 1 << 15;

/// The number of speed ranges in an octave, in each of which steps and caps are chosen once.
/// Doubling it chooses them twice as often, and closer to their limits.
const SPEED_RANGES_PER_OCTAVE: f64 = 4.0;

/// A point at a held speed: the set-up of its turns, and its modes with theta frozen.
#[derive(Clone)]
pub(crate) struct HeldCase<'a> {
    pub(crate) setup: TurnSetup<'a>,
    /// The modes with theta frozen, at the lower end of the speed range.
    pub(crate) frozen_modes: Arc<Modes>,
    /// The number of modes, from the slowest on, whose multipliers count.
    pub(super) counted_mode_count: usize,
}

impl<'a> HeldCase<'a> {
    /// Returns the case without caps. A harmonic of the turn may excite the hinge, so that
    /// derivatives are computed at as many instants as with corners: at fewer instants they lack
    /// that harmonic, and Newton's method fails.
    pub(crate) fn without_caps(&self) -> Result<Self, ResponseError> {
        let step_count =
            uncapped_step_count(self.setup.point, self.setup.speed_rpm, self.setup.turn_s())?;
        let step_count = step_count.next_multiple_of(INSTANTS_PER_TURN_WITH_CORNERS);
        let setup = TurnSetup {
            step_count,
            instant_count: INSTANTS_PER_TURN_WITH_CORNERS,
            caps: None,
            ..self.setup
        };
        Ok(Self {
            setup,
            frozen_modes: Arc::clone(&self.frozen_modes),
            counted_mode_count: self.counted_mode_count,
        })
    }
}

/// Returns the number of steps of a turn that resolve all modes.
fn uncapped_step_count(point: &Point, speed_rpm: f64, turn_s: f64) -> Result<usize, ResponseError> {
    let highest_rad_per_s = highest_frequency_rad_per_s(point, speed_rpm * TAU / 60.0)
        .map_err(|_| ResponseError::NoEigenvalues)?;
    round_up_steps(point, highest_rad_per_s * turn_s / UNCAPPED_STEP_PHASE_RAD)
}

/// Returns the greatest number of instants of a turn at which derivatives are computed.
fn max_instants(point: &Point) -> usize {
    if point.machine.elements.has_nonsmooth_force() {
        INSTANTS_PER_TURN_WITH_CORNERS
    } else {
        INSTANTS_PER_TURN
    }
}

/// Rounds a number of steps up to a multiple of [`max_instants`].
fn round_up_steps(point: &Point, step_count: f64) -> Result<usize, ResponseError> {
    let divisor = max_instants(point) as f64;
    let step_count = divisor * (step_count / divisor).ceil().max(1.0);
    if step_count > MAX_STEPS_PER_TURN as f64 {
        Err(ResponseError::TooSlow)
    } else {
        Ok(step_count as usize)
    }
}

/// The steps and caps of a point at all speeds.
#[derive(Clone)]
pub(crate) struct Settings<'a> {
    pub(crate) point: &'a Point,
    /// The point without friction, whose modes are used: friction that is linearised at a low speed
    /// blocks the linear model, but not the machine.
    frictionless_point: Cow<'a, Point>,
    modes_at_rest: Option<Modes>,
    /// The modes at the lower ends of ranges.
    modes_by_range: BTreeMap<i64, Result<Arc<Modes>, ResponseError>>,
    /// The least number of steps of every turn in the continuation; `None` if each range has its
    /// own number.
    min_continuation_steps: Option<usize>,
    /// The settings by range and purpose.
    settings_by_range: BTreeMap<(i64, Purpose), Result<RangeSetting, ResponseError>>,
}

/// The steps and caps of a range of speeds.
#[derive(Clone)]
struct RangeSetting {
    frozen_modes: Arc<Modes>,
    step_count: usize,
    is_capped: bool,
}

/// Returns the lower end (rpm) of the speed range with an index.
fn range_start_rpm(range_index: i64) -> f64 {
    libm::exp2(range_index as f64 / SPEED_RANGES_PER_OCTAVE)
}

impl<'a> Settings<'a> {
    pub(crate) fn new(point: &'a Point) -> Self {
        let frictionless_point = match point.friction_speeds().is_empty() {
            true => Cow::Borrowed(point),
            false => Cow::Owned(point.without_friction()),
        };
        let modes_at_rest = modes(&frictionless_point, 0.0, 0.0).ok();
        Self {
            point,
            frictionless_point,
            modes_at_rest,
            modes_by_range: BTreeMap::new(),
            min_continuation_steps: point
                .machine
                .elements
                .has_nonsmooth_force()
                .then_some(MIN_CONTINUATION_STEPS),
            settings_by_range: BTreeMap::new(),
        }
    }

    /// Returns the machine without friction.
    pub(super) fn without_friction(&self) -> &Point {
        &self.frictionless_point
    }

    /// Returns the speed (rpm) from which responses are continued up, below all resonances.
    pub(super) fn lowest_rpm(&self) -> Result<f64, ResponseError> {
        self.mode_speed_rpm(LOWEST_SPEED_RATIO, 0)
    }

    /// Returns the speed (rpm) from which responses are continued down, above all resonances of the
    /// suspension.
    pub(super) fn highest_rpm(&self) -> Result<f64, ResponseError> {
        self.mode_speed_rpm(HIGHEST_SPEED_RATIO, SUSPENSION_MODES - 1)
    }

    /// Returns a multiple of a mode's frequency at rest, rounded up (rpm).
    fn mode_speed_rpm(&self, ratio: f64, mode: usize) -> Result<f64, ResponseError> {
        let frequency_rpm = self.modes_at_rest.as_ref().ok_or(ResponseError::NoEigenvalues)?.modes
            [mode]
            .frequency_rpm();
        // The last digits of an eigenvalue depend on the processor.
        Ok((ratio * frequency_rpm * SPEED_ROUNDING_PER_RPM).ceil() / SPEED_ROUNDING_PER_RPM)
    }

    /// Returns the case for responses at a speed.
    ///
    /// # Errors
    /// [`ResponseError::NoEigenvalues`] or [`ResponseError::TooSlow`].
    pub(crate) fn held_case(&mut self, speed_rpm: f64) -> Result<HeldCase<'a>, ResponseError> {
        self.case_for(speed_rpm, Purpose::Response)
    }

    /// Returns the set-up for the linear model at the speed of another set-up.
    pub(super) fn linear_setup(&mut self, setup: TurnSetup<'a>) -> TurnSetup<'a> {
        self.case_for(setup.speed_rpm, Purpose::Continuation)
            .map_or(setup, |held_case| held_case.setup)
    }

    /// Returns the set-up at a speed in the continuation.
    ///
    /// # Errors
    /// The errors of [`Self::held_case`].
    pub(super) fn continuation_setup(
        &mut self,
        speed_rpm: f64,
    ) -> Result<TurnSetup<'a>, ResponseError> {
        let point = self.point;
        let Some(min_steps) = self.min_continuation_steps else {
            return Ok(self.case_for(speed_rpm, Purpose::Continuation)?.setup);
        };
        let step_count = self.continuation_steps(min_steps)?;
        let caps = Some(caps_for_steps(step_count, 60.0 / speed_rpm));
        let setup = TurnSetup {
            point,
            speed_rpm,
            step_count,
            instant_count: step_count,
            caps,
            corner_width_m: 0.0,
        };
        Ok(TurnSetup { corner_width_m: CORNER_WIDTH_PER_STEP_M_PER_S * setup.step_s(), ..setup })
    }

    /// Returns the number of steps of every turn in the continuation, which is at least
    /// `min_steps`.
    fn continuation_steps(&self, min_steps: usize) -> Result<usize, ResponseError> {
        let modes_at_rest = self.modes_at_rest.as_ref().ok_or(ResponseError::NoEigenvalues)?;
        let highest_frequency_rad_per_s =
            modes_at_rest.modes[SUSPENSION_MODES - 1].magnitude_rad_per_s;
        let longest_turn_s = 60.0 / self.lowest_rpm()?;
        let step_count = round_up_steps(
            self.point,
            highest_frequency_rad_per_s * longest_turn_s / CONTINUATION_LIMITS.max_step_phase_rad,
        )?;
        Ok(step_count.max(min_steps))
    }

    /// Returns the number of steps of a turn in the continuation, if forces have corners.
    pub(super) fn steps_at_corners(&self) -> Option<usize> {
        let min_steps = self
            .min_continuation_steps
            .filter(|_| self.point.machine.elements.has_nonsmooth_force())?;
        self.continuation_steps(min_steps).ok()
    }

    /// Doubles the number of steps in the continuation; returns false if it exceeds its limit.
    pub(super) fn refine_continuation(&mut self) -> bool {
        let step_count =
            self.min_continuation_steps.map_or(MIN_CONTINUATION_STEPS, |step_count| 2 * step_count);
        self.min_continuation_steps = Some(step_count);
        step_count <= MAX_CONTINUATION_STEPS
    }

    /// Returns the case at a speed for a purpose, with the setting of the speed's range.
    fn case_for(
        &mut self,
        speed_rpm: f64,
        purpose: Purpose,
    ) -> Result<HeldCase<'a>, ResponseError> {
        let range_index = (SPEED_RANGES_PER_OCTAVE * libm::log2(speed_rpm)).floor() as i64;
        let limits = match purpose {
            Purpose::Response => RESPONSE_LIMITS,
            Purpose::Continuation => CONTINUATION_LIMITS,
        };
        let known_setting = self.settings_by_range.get(&(range_index, purpose)).cloned();
        let setting = known_setting.unwrap_or_else(|| {
            let setting = self.choose_setting(range_index, &limits);
            self.settings_by_range.insert((range_index, purpose), setting.clone());
            setting
        });
        let RangeSetting { frozen_modes, step_count, is_capped } = setting?;
        let point = self.point;
        let caps = is_capped.then(|| caps_for_steps(step_count, 60.0 / speed_rpm));
        let instant_count = limits.instant_count * max_instants(point) / INSTANTS_PER_TURN;
        let setup =
            TurnSetup { point, speed_rpm, step_count, instant_count, caps, corner_width_m: 0.0 };
        let counted_mode_count = if is_capped { SUSPENSION_MODES } else { SUSPENSION_MODES + 2 };
        Ok(HeldCase { setup, frozen_modes, counted_mode_count })
    }

    /// Returns the modes at the lower end of a range.
    fn modes_at_range_start(&mut self, range_index: i64) -> Result<Arc<Modes>, ResponseError> {
        let compute_modes =
            || modes(&self.frictionless_point, 0.0, range_start_rpm(range_index) * TAU / 60.0);
        let checked_modes =
            || compute_modes().map(Arc::new).map_err(|_| ResponseError::NoEigenvalues);
        self.modes_by_range.entry(range_index).or_insert_with(checked_modes).clone()
    }

    /// Chooses the number of steps that the suspension's modes need in a range of speeds, and the
    /// highest caps that are stable with it. If caps shift the suspension's modes too far, the
    /// number of steps is increased; if the drum is not slow compared with the hinge, modes are not
    /// capped.
    fn choose_setting(
        &mut self,
        range_index: i64,
        limits: &AccuracyLimits,
    ) -> Result<RangeSetting, ResponseError> {
        let point = self.point;
        let bounds_rpm = [range_index, range_index + 1].map(range_start_rpm);
        let frozen_modes =
            [self.modes_at_range_start(range_index)?, self.modes_at_range_start(range_index + 1)?];
        let modes_at_rest = self.modes_at_rest.as_ref().ok_or(ResponseError::NoEigenvalues)?;
        let turn_s = 60.0 / bounds_rpm[0];
        let highest_frequency_rad_per_s =
            modes_at_rest.modes[SUSPENSION_MODES - 1].magnitude_rad_per_s;
        let mut step_count = round_up_steps(
            point,
            highest_frequency_rad_per_s * turn_s / limits.max_step_phase_rad,
        )?
        .max(limits.min_steps);
        if point.machine.elements.has_nonsmooth_force() {
            step_count = step_count.max(round_up_steps(point, turn_s / limits.max_corner_step_s)?);
        }
        let mut is_capped = false;
        let max_speed_rad_per_s = bounds_rpm[1] * TAU / 60.0;
        if modes_at_rest.modes[SUSPENSION_MODES].magnitude_rad_per_s
            >= MIN_HINGE_SPEED_RATIO * max_speed_rad_per_s
        {
            let highest_rad_per_s = modes_at_rest.modes[COORDINATES - 1].magnitude_rad_per_s;
            // With more steps caps would exceed all modes.
            while !is_capped && (step_count as f64) < highest_rad_per_s * turn_s {
                let compute_shift_per_s = |bound: usize| {
                    let caps = caps_for_steps(step_count, 60.0 / bounds_rpm[bound]);
                    max_shift_per_s(
                        &self.frictionless_point,
                        bounds_rpm[bound] * TAU / 60.0,
                        &frozen_modes[bound],
                        &caps,
                    )
                };
                is_capped =
                    compute_shift_per_s(0)?.max(compute_shift_per_s(1)?) <= limits.max_shift_per_s;
                if !is_capped {
                    step_count =
                        round_up_steps(point, STEP_COUNT_INCREASE_FACTOR * step_count as f64)?;
                }
            }
        }
        if !is_capped {
            let [low, high] = bounds_rpm.map(|rpm| uncapped_step_count(point, rpm, turn_s));
            step_count = low?.max(high?);
        }
        let [frozen_modes, _] = frozen_modes;
        Ok(RangeSetting { frozen_modes, step_count, is_capped })
    }
}

/// Returns the weighted shift (rad/s) of a suspension mode by the hinge's cap, if there is a cap,
/// while the drum turns.
fn hinge_shift(
    point: &Point,
    mode: &Mode,
    speed_rad_per_s: f64,
    cap_rad_per_s: Option<f64>,
) -> f64 {
    let Some(cap_rad_per_s) = cap_rad_per_s else { return 0.0 };
    let frequency_rad_per_s = mode.magnitude_rad_per_s;
    let shift_rad2_per_s2 = (frequency_rad_per_s * frequency_rad_per_s
        - BACKWARD_WHIRL_RATIO * speed_rad_per_s * speed_rad_per_s)
        .abs()
        + (1.0 - BACKWARD_WHIRL_RATIO) * frequency_rad_per_s * speed_rad_per_s;
    let cap_ratio = shift_rad2_per_s2 / (cap_rad_per_s * cap_rad_per_s);
    NON_ROTATING_MOTION_SHARE
        * 0.5
        * mode.hinge_energy_share(point)
        * frequency_rad_per_s
        * cap_ratio
}

/// Returns the greatest shift of the suspension's modes by caps, in the complex plane.
fn max_shift_per_s(
    point: &Point,
    speed_rad_per_s: f64,
    frozen_modes: &Modes,
    caps: &Caps,
) -> Result<f64, ResponseError> {
    let bearing_caps = Caps { hinge_rad_per_s: None, ..*caps };
    let capped_root = mode_roots(point, speed_rad_per_s, Some(&bearing_caps))
        .map_err(|_| ResponseError::NoEigenvalues)?;
    let shifts = frozen_modes.modes.iter().zip(&capped_root).take(SUSPENSION_MODES).map(
        |(mode, capped_root)| {
            let decay_shift = capped_root.s.re - mode.re_per_s;
            let frequency_shift = capped_root.s.im - mode.im_rad_per_s;
            let hinge_shift_per_s = hinge_shift(point, mode, speed_rad_per_s, caps.hinge_rad_per_s);
            (decay_shift * decay_shift + frequency_shift * frequency_shift).sqrt()
                + hinge_shift_per_s
        },
    );
    Ok(shifts.fold(0.0, f64::max))
}

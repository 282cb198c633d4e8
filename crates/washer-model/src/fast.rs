//! The choice of caps and steps: how far the modes of bearings and hinge may be capped, and how
//! long the steps may then be, for a given accuracy, spin and machine. The caps' laws are in
//! section 4.3 of the model page.
//!
//! Three bounds limit a step h with cap w:
//!
//! * Truncation. Over one memory of a lightly damped motion of frequency f, 1/(zeta f), the local
//!   errors of RK4, (h f)^5 / 120, add up to (h f)^4 / (120 zeta), and those of the formula of
//!   order 8 to (h f)^8 / (9! zeta). The method has to follow the drum's rotation and the
//!   suspension's modes; f is the fastest of them. With zeta = 0.1 the sum must stay below the
//!   accuracy.
//! * Stability. h |s| stays within the method's limit for every mode s of the machine with its
//!   caps, hinge and gyroscopic effects included. A higher cap is more faithful, but a cap just
//!   above the hinge's modes pushes these up. So h w is the first of 0.95, 0.84, ... times the
//!   formula's limit at which the step is stable, with the hinge uncapped if possible, capped if
//!   not.
//! * Fidelity. Motion that turns with the drum is exact under the caps. Other motion is not: the
//!   modes of the suspension shift by ds. The relative error of an amplitude is ds over the
//!   distance from resonance, or over the resonance's half-width |Re s| if that is greater. A mode
//!   faster than the drum by a factor r contributes 1/r^2 of the motion, of which its frequency
//!   affects 1/r^2 again, because static compliance stays exact. The weighted shift must stay below
//!   the accuracy. Stiff bearings pass at once, because they hold hardly any strain energy of slow
//!   modes. With soft ones the cap rises until it caps nothing, which is plain RK4.
//!
//! The hinge turns with the shaft. In its axes a motion of frequency f has the frequencies f +
//! theta' and f - theta', which modes with theta frozen do not show. A hinge with the share e of a
//! mode's strain energy shifts that mode by e f / 2 times the greater softening of the two. A tenth
//! of that is added to ds; on the paper's machine the effect on motions is smaller.
//!
//! The polynomial of degree 5 between steps bounds the step as well.
//!
//! Elements that are not linear (stiffening springs, bushings) count in the nonlinear model as
//! their steepest tangents, and the motion to follow includes the tub's swing on these. Where
//! forces have corners ([`Cases::are_nonsmooth`]), no such step is for the nonlinear model.

pub(crate) mod geared;
pub(crate) mod ringing;

use crate::{
    COORDINATES, Caps, Formula, Gear, Geared, Mode, ModelKind, Modes, NoModes, Point, Spin,
    highest_frequency_rad_per_s,
};
use core::iter;

use crate::fast::geared::{GEARS, interpolation_phase};
use crate::modes::{Root, fastest_rigid_rad_per_s, highest_with_caps, modes_with_caps, motions};
use crate::nonlinear::coupling::BACKWARD_SHARE;

/// Modes of the suspension: yaw, pitch, two translations.
pub(crate) const SUSPENSION_MODES: usize = 4;

/// The modes of the suspension and the two of the hinge. The other four are the bearings', faster
/// unless the bearings are soft.
const SLOW_MODES: usize = SUSPENSION_MODES + 2;

/// Damping ratio of the motions with the longest memory.
const MEMORY_DAMPING_RATIO: f64 = 0.1;

/// h times the cap as a share of the formula's limit, the best first.
const STEP_TIMES_CAP: [f64; 4] = [0.95, 0.84, 0.73, 0.62];

/// The hinge's cap as a multiple of the bearings', the best first; the best of all is none.
const HINGE_CAP: [Option<f64>; 3] = [None, Some(1.5), Some(1.0)];

/// How many times faster than the drum a capped hinge is, at least, where the gap between drum and
/// tub counts: a harmonic n of the drum's speed finds it softer by (n - 1) (n + 1/2) over the
/// square of this. At 2.4 the gap was seen to err by a third of what it moves.
const HINGE_CAP_TO_DRUM: f64 = 5.0;

/// Half-width of a resonance that has no damping, as a share of its frequency.
const LEAST_HALF_WIDTH: f64 = 0.01;

/// Modes are capped only where the hinge's are faster than the drum by this factor.
///
/// At drum speeds near (f + f_i) / 3, f being a frequency of the hinge and f_i one of the
/// suspension, whirls of the hinge can grow from a tiny start. The start depends on the ringing of
/// the bearings, which all runs with caps leave out alike, so that their comparison does not show
/// it.
pub(crate) const HINGE_TO_DRUM: f64 = 3.2;

/// Bits of a step's fraction that are kept: 1e-6 of the step.
const STEP_BITS: u32 = 20;

/// Ratio of one candidate step to the one before.
const SHORTER: f64 = 0.97;

/// The search for the longest step tries one in so many candidates first.
const STRIDE: usize = 8;

/// The part of a capped hinge's shift that affects motions: its law is exact for motion that turns
/// with the drum.
const FREE_SHARE: f64 = 0.1;

/// The gear of the fastest drum.
const TOP: usize = GEARS - 1;

/// Greatest speeds of the drum in each gear, as shares of the greatest of all.
///
/// A slower drum drives slower motions and hardly drives modes faster than itself, so that steps
/// may be longer in proportion. Modes that the drum has passed still ring, so a gear is never
/// changed back.
const GEAR_SHARES: [f64; GEARS] = [0.5, 0.71, 1.0];

/// A lower gear is taken if its step is longer by this.
const WORTH_A_GEAR: f64 = 1.1;

/// The machines for which a run's steps and caps are chosen, with their modes without caps.
pub struct Cases<'a> {
    cases: Vec<Result<Case<'a>, NoModes>>,
    /// When the runs end (s).
    end_s: f64,
    is_stopped: &'a dyn Fn() -> bool,
}

struct Case<'a> {
    point: &'a Point,
    /// Fastest of the motions that the nonlinear model's method has to follow.
    fastest_followed_rad_per_s: f64,
    /// The same if all elements were as at rest, which is where the linear model has them.
    fastest_at_rest_rad_per_s: f64,
    /// Fastest of all modes, at rest and turning.
    fastest_rad_per_s: f64,
    /// The hinge's slower frequency at rest.
    hinge_rad_per_s: f64,
    /// The faster one.
    faster_hinge_rad_per_s: f64,
    /// The greatest speed of the drum.
    top_rad_per_s: f64,
    /// The drum at the greatest speed of each gear.
    turning: [State; GEARS],
    rest: State,
}

/// The machine while its drum turns at one speed.
struct State {
    speed_rad_per_s: f64,
    modes: Modes,
}

impl State {
    fn new(point: &Point, speed_rad_per_s: f64) -> Result<Self, NoModes> {
        Ok(Self { speed_rad_per_s, modes: modes_with_caps(point, 0.0, speed_rad_per_s, None)? })
    }
}

/// A step and its caps, for a model's formula.
#[derive(Clone, Copy)]
struct Trial {
    model: ModelKind,
    step_s: f64,
    caps: Caps,
}

impl Trial {
    fn is_stable(&self, frequency_rad_per_s: f64) -> bool {
        self.step_s * frequency_rad_per_s <= Formula::of(self.model).limit()
    }
}

impl<'a> Case<'a> {
    fn new(point: &'a Point, spin: &Spin, end_s: f64) -> Result<Self, NoModes> {
        let top = spin.greatest_speed_rad_per_s(end_s);
        let rest = State::new(point, 0.0)?;
        let [first, second, third] = GEAR_SHARES.map(|share| State::new(point, share * top));
        let modes = &rest.modes.modes;
        // Where strong dampers let motions of the suspension creep, these are not to be followed.
        let swinging = modes[..SUSPENSION_MODES].iter().filter(|mode| mode.im_rad_per_s != 0.0);
        let at_rest = swinging.map(|mode| mode.magnitude_rad_per_s).fold(top, f64::max);
        let followed = match &point.steepest {
            Some(steepest) => at_rest.max(fastest_rigid_rad_per_s(point, steepest)?),
            None => at_rest,
        };
        let hinge = modes[SUSPENSION_MODES].magnitude_rad_per_s;
        // A soft hinge takes part in the motion. Stops may drive faster motions than the hinge's.
        let with_hinge =
            |fastest: f64| if hinge < 2.0 * fastest { hinge.max(fastest) } else { fastest };
        Ok(Self {
            point,
            fastest_followed_rad_per_s: with_hinge(followed),
            fastest_at_rest_rad_per_s: with_hinge(at_rest),
            hinge_rad_per_s: hinge,
            faster_hinge_rad_per_s: modes[SUSPENSION_MODES + 1].magnitude_rad_per_s,
            top_rad_per_s: top,
            fastest_rad_per_s: highest_frequency_rad_per_s(point, 0.0)?
                .max(highest_frequency_rad_per_s(point, top)?),
            turning: [first?, second?, third?],
            rest,
        })
    }

    /// Whether a step is stable with these caps in a gear, and the slow modes hardly shift. The
    /// check that refuses most comes first, the one that needs eigenvalues at every angle last.
    fn holds(&self, trial: &Trial, gear: usize, accuracy: f64) -> Result<bool, NoModes> {
        let top_rad_per_s = self.turning[gear].speed_rad_per_s;
        for state in [&self.turning[gear], &self.rest] {
            let hinge = |mode| self.hinge_shift(mode, state.speed_rad_per_s, &trial.caps);
            let slow = &state.modes.modes[..SLOW_MODES];
            if slow.iter().any(|mode| error_of_shift(mode, hinge(mode), top_rad_per_s) > accuracy) {
                return Ok(false);
            }
            let capped = motions(self.point, state.speed_rad_per_s, Some(&trial.caps))?;
            if !trial.is_stable(capped[COORDINATES - 1].magnitude_rad_per_s) {
                return Ok(false);
            }
            let of_bearings = match trial.caps.hinge_rad_per_s {
                None => capped,
                Some(_) => self.motions_with_capped_bearings(state, &trial.caps)?,
            };
            let error = self.error_of_caps(state, &of_bearings, &trial.caps, top_rad_per_s);
            if error > accuracy {
                return Ok(false);
            }
        }
        for state in [&self.turning[gear], &self.rest] {
            let speed_rad_per_s = state.speed_rad_per_s;
            let caps = Some(&trial.caps);
            if !trial.is_stable(highest_with_caps(self.point, trial.model, speed_rad_per_s, caps)?)
            {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The motions with the bearings' caps alone.
    fn motions_with_capped_bearings(
        &self,
        state: &State,
        caps: &Caps,
    ) -> Result<[Root; COORDINATES], NoModes> {
        let of_bearings = Caps { hinge_rad_per_s: None, ..*caps };
        motions(self.point, state.speed_rad_per_s, Some(&of_bearings))
    }

    /// Relative error of amplitudes by the shifts of slow modes; `capped` are the motions with the
    /// bearings' caps alone.
    fn error_of_caps(
        &self,
        state: &State,
        capped: &[Root; COORDINATES],
        caps: &Caps,
        top_rad_per_s: f64,
    ) -> f64 {
        let slow = state.modes.modes[..SLOW_MODES].iter().zip(capped);
        // Strong dampers let a motion creep; how fast it is brought to that matters to nothing.
        let swinging = slow.filter(|(plain, _)| plain.im_rad_per_s != 0.0);
        let errors = swinging.map(|(plain, capped)| {
            let (slower, detuned) =
                (capped.s.re - plain.re_per_s, capped.s.im - plain.im_rad_per_s);
            let of_bearings = (slower * slower + detuned * detuned).sqrt();
            let of_hinge = self.hinge_shift(plain, state.speed_rad_per_s, caps);
            error_of_shift(plain, of_bearings + of_hinge, top_rad_per_s)
        });
        errors.fold(0.0, f64::max)
    }

    /// Weighted shift (rad/s) of a suspension mode by a capped hinge while the drum turns.
    fn hinge_shift(&self, mode: &Mode, turning_rad_per_s: f64, caps: &Caps) -> f64 {
        let is_of_suspension = mode.magnitude_rad_per_s <= self.hinge_rad_per_s;
        if !is_of_suspension {
            return 0.0;
        }
        hinge_shift(self.point, mode, turning_rad_per_s, caps.hinge_rad_per_s)
    }

    /// Fastest of the motions that a model's method has to follow (rad/s).
    fn fastest_followed_rad_per_s(&self, model: ModelKind) -> f64 {
        match model {
            ModelKind::Nonlinear => self.fastest_followed_rad_per_s,
            ModelKind::Linear => self.fastest_at_rest_rad_per_s,
        }
    }

    /// Relative error of amplitudes by truncation.
    fn error_of_truncation(&self, model: ModelKind, step_s: f64) -> f64 {
        let phase = step_s * self.fastest_followed_rad_per_s(model);
        Formula::of(model).error_per_radian(phase) / MEMORY_DAMPING_RATIO
    }
}

/// Weighted shift (rad/s) of a suspension mode by the hinge's cap, if it has one, while the drum
/// turns.
pub(crate) fn hinge_shift(
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

/// Relative error of an amplitude by a mode's shift (rad/s).
fn error_of_shift(mode: &Mode, shift_rad_per_s: f64, speed_rad_per_s: f64) -> f64 {
    let frequency = mode.magnitude_rad_per_s;
    let half_width = mode.re_per_s.abs().max(LEAST_HALF_WIDTH * frequency);
    let distance = half_width.max(frequency - speed_rad_per_s);
    let weight = (speed_rad_per_s / frequency).min(1.0).powi(4);
    weight * shift_rad_per_s / distance
}

impl<'a> Cases<'a> {
    /// Points with their spins, which last until `end_s`.
    pub fn new(points: impl IntoIterator<Item = (&'a Point, &'a Spin)>, end_s: f64) -> Self {
        Self::until(points, end_s, &|| false)
    }

    /// As [`Self::new`], until `is_stopped`: it is asked before each machine's eigenvalues are
    /// found, and once it says so, whatever these cases give means nothing.
    pub fn until(
        points: impl IntoIterator<Item = (&'a Point, &'a Spin)>,
        end_s: f64,
        is_stopped: &'a dyn Fn() -> bool,
    ) -> Self {
        let points = points.into_iter().take_while(|_| !is_stopped());
        let cases = points.map(|(point, spin)| Case::new(point, spin, end_s)).collect();
        Self { cases, end_s, is_stopped }
    }

    /// The longest step (s) at which plain RK4 is stable at all points; `None` if there are none.
    /// Machines without modes are left out.
    pub fn plain_step_s(&self) -> Option<f64> {
        let steps =
            self.cases.iter().flatten().map(|case| Formula::Rk4.limit() / case.fastest_rad_per_s);
        steps.reduce(f64::min).map(rounded_down)
    }

    /// The share of what hinges swing after a jump that plain RK4 leaves out by these steps (s):
    /// the phase (rad) by which it is late at the end.
    pub fn left_out_of_hinge(&self, step_s: f64) -> f64 {
        let late_rad = self.cases.iter().flatten().map(|case| {
            let hinge_rad_per_s = case.faster_hinge_rad_per_s;
            let error_per_radian = Formula::Rk4.error_per_radian(step_s * hinge_rad_per_s);
            self.end_s * hinge_rad_per_s * error_per_radian
        });
        rounded_down(late_rad.fold(0.0, f64::max).min(1.0))
    }

    /// Whether some machine's forces have corners that steps longer than they are wide do not see:
    /// friction and stops. There errors do not shrink with the step by the order of a formula.
    pub fn are_nonsmooth(&self) -> bool {
        self.cases.iter().flatten().any(|case| case.point.machine.elements.are_nonsmooth())
    }

    /// The least frequency of a hinge over the greatest speed of its drum; infinite if there is no
    /// machine with modes.
    ///
    /// Where a multiple of the drum's speed passes a whirl of the hinge, the hinge is left
    /// ringing, hardly damped. Runs with caps have the ringing, but soon not its phase.
    pub fn hinge_to_drum(&self) -> f64 {
        self.cases
            .iter()
            .flatten()
            .map(|case| case.hinge_rad_per_s / case.top_rad_per_s)
            .fold(f64::INFINITY, f64::min)
    }

    /// Whether closed stops or stiffened springs make the tub swing faster (rad/s, given back) than
    /// anything else that the method has to follow.
    pub fn stiffened_rad_per_s(&self) -> Option<f64> {
        let stiffened = self.cases.iter().flatten().filter(|case| {
            case.fastest_followed_rad_per_s > case.fastest_at_rest_rad_per_s
                && case.point.steepest.is_some()
        });
        stiffened.map(|case| case.fastest_followed_rad_per_s).reduce(f64::max)
    }

    fn with_modes(&self) -> Result<Vec<&Case<'a>>, NoModes> {
        self.cases.iter().map(|case| case.as_ref().map_err(|none| *none)).collect()
    }

    /// The longest steps of a model's formula, with their caps, at which the relative error of
    /// amplitudes should be below `accuracy` at all points; `None` if plain RK4 at its longest
    /// stable step is cheaper.
    ///
    /// # Errors
    /// [`NoModes`] of a machine that has none.
    pub fn choose(&self, model: ModelKind, accuracy: f64) -> Result<Option<Geared>, NoModes> {
        let Some((mut search, trial)) = self.choose_top(model, accuracy, 0.0)? else {
            return Ok(None);
        };
        let mut geared = Geared::steady(trial.step_s, trial.caps);
        for gear in 0..TOP {
            let steps_s = [WORTH_A_GEAR * trial.step_s, search.longest_s / GEAR_SHARES[gear]];
            if let Some(Trial { step_s, caps, .. }) = search.longest(gear, steps_s)? {
                let speeds = search.cases.iter().map(|case| case.turning[gear].speed_rad_per_s);
                let up_to_rad_per_s = speeds.fold(f64::INFINITY, f64::min);
                geared.gears[gear] = Gear { up_to_rad_per_s, step_s, caps };
            } else {
                // The next gear serves here too.
                geared.gears[gear].up_to_rad_per_s = 0.0;
            }
        }
        Ok(Some(geared))
    }

    /// As [`Self::choose`], with one step and its caps at every speed, and a hinge that harmonics
    /// of the drum's speed hardly bend farther than without its cap.
    ///
    /// # Errors
    /// As there.
    pub fn choose_steady(
        &self,
        model: ModelKind,
        accuracy: f64,
    ) -> Result<Option<Geared>, NoModes> {
        let chosen = self.choose_top(model, accuracy, HINGE_CAP_TO_DRUM)?;
        Ok(chosen.map(|(_, trial)| Geared::steady(trial.step_s, trial.caps)))
    }

    /// The choice for the fastest drum, and the search that found it.
    fn choose_top(
        &self,
        model: ModelKind,
        accuracy: f64,
        hinge_cap_to_drum: f64,
    ) -> Result<Option<(Search<'_, 'a>, Trial)>, NoModes> {
        let cases = self.with_modes()?;
        let Some(plain_step_s) = self.plain_step_s() else { return Ok(None) };
        if self.hinge_to_drum() < HINGE_TO_DRUM {
            return Ok(None);
        }
        let most_evaluations_per_s = Formula::Rk4.evaluations_per_s(plain_step_s);
        let formula = Formula::of(model);
        let followed = cases.iter().map(|case| case.fastest_followed_rad_per_s(model));
        let followed = followed.fold(0.0, f64::max);
        let longest_phase =
            formula.step_phase(MEMORY_DAMPING_RATIO * accuracy).min(interpolation_phase(accuracy));
        let longest_s = longest_phase / followed;
        let shortest_s = formula.evaluations_per_s(1.0) / most_evaluations_per_s;
        let is_stopped = self.is_stopped;
        let mut search =
            Search { cases, model, accuracy, hinge_cap_to_drum, longest_s, is_stopped };
        let trial = search.longest(TOP, [shortest_s, longest_s])?;
        Ok(trial.map(|trial| (search, trial)))
    }

    /// The relative error of amplitudes that the rule expects of a choice: the greatest by
    /// truncation or caps, over all points.
    ///
    /// # Errors
    /// [`NoModes`] of a machine that has none.
    pub fn expected_error(&self, model: ModelKind, geared: &Geared) -> Result<f64, NoModes> {
        let Gear { step_s, caps, .. } = *geared.top();
        let mut error = 0.0_f64;
        for case in self.with_modes()? {
            error = error.max(case.error_of_truncation(model, step_s));
            let state = &case.turning[TOP];
            let of_bearings = case.motions_with_capped_bearings(state, &caps)?;
            let of_caps = case.error_of_caps(state, &of_bearings, &caps, state.speed_rad_per_s);
            error = error.max(of_caps);
        }
        Ok(error)
    }
}

/// A choice under way.
struct Search<'c, 'a> {
    /// In the order in which they are asked: those that refused a trial last come first, because
    /// they mostly refuse the next one too.
    cases: Vec<&'c Case<'a>>,
    model: ModelKind,
    accuracy: f64,
    /// The least cap of a hinge over the drum's speed.
    hinge_cap_to_drum: f64,
    /// The longest step that truncation lets pass in the top gear.
    longest_s: f64,
    is_stopped: &'a dyn Fn() -> bool,
}

impl Search<'_, '_> {
    /// The longest step above the shorter of two, and up to the longer one, that holds in a gear,
    /// with its caps.
    fn longest(
        &mut self,
        gear: usize,
        [above_s, up_to_s]: [f64; 2],
    ) -> Result<Option<Trial>, NoModes> {
        let steps_s =
            iter::successors(Some(rounded_down(up_to_s)), |step_s| Some(SHORTER * step_s));
        let steps_s: Vec<f64> = steps_s.take_while(|step_s| *step_s > above_s).collect();
        // By strides, and back to the longest step of the last one by halving.
        let mut fail = 0;
        for at in (0..steps_s.len()).step_by(STRIDE).chain(steps_s.len().checked_sub(1)) {
            if let Some(mut best) = self.holding(gear, steps_s[at])? {
                let mut holds = at;
                while fail < holds {
                    let between = fail.midpoint(holds);
                    match self.holding(gear, steps_s[between])? {
                        Some(trial) => (best, holds) = (trial, between),
                        None => fail = between + 1,
                    }
                }
                return Ok(Some(best));
            }
            fail = at + 1;
        }
        Ok(None)
    }

    /// The best caps with which a step holds in a gear, if any.
    fn holding(&mut self, gear: usize, step_s: f64) -> Result<Option<Trial>, NoModes> {
        let model = self.model;
        for step_times_cap in STEP_TIMES_CAP {
            let cap = step_times_cap * Formula::of(model).limit() / step_s;
            for multiple in HINGE_CAP {
                let hinge_rad_per_s = multiple.map(|multiple| multiple * cap);
                let caps = Caps { bearings_rad_per_s: cap, hinge_rad_per_s };
                let trial = Trial { model, step_s, caps };
                let fastest = self.cases.iter().map(|case| case.turning[gear].speed_rad_per_s);
                let least = self.hinge_cap_to_drum * fastest.fold(0.0, f64::max);
                let is_fast = hinge_rad_per_s.is_none_or(|cap_rad_per_s| cap_rad_per_s >= least);
                if is_fast && self.all_hold(&trial, gear)? {
                    return Ok(Some(trial));
                }
            }
        }
        Ok(None)
    }

    fn all_hold(&mut self, trial: &Trial, gear: usize) -> Result<bool, NoModes> {
        for place in 0..self.cases.len() {
            if (self.is_stopped)() {
                return Ok(false);
            }
            if !self.cases[place].holds(trial, gear, self.accuracy)? {
                self.cases[..=place].rotate_right(1);
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// A number of few digits. The last digits of an eigenvalue depend on the processor and on the
/// system's mathematical library; a result must not.
pub(crate) fn rounded_down(number: f64) -> f64 {
    to_bits(number, STEP_BITS)
}

/// A positive number with so many binary digits behind the first; the others are dropped.
pub(crate) fn to_bits(number: f64, bits: u32) -> f64 {
    let dropped = f64::MANTISSA_DIGITS - 1 - bits;
    f64::from_bits(number.to_bits() >> dropped << dropped)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Machine, Profile, Timing, prepare};
    use core::cell::Cell;
    use lane_ode::Simd;

    /// The run-up is so slow that the fastest suspension mode, an eigenvalue, decides the step.
    fn chosen(stiffer: f64) -> (Geared, Option<f64>) {
        let mut machine = Machine::paper();
        for spring in &mut machine.springs {
            spring.stiffness_n_per_m *= stiffer;
        }
        let spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 100.0, ramp_s: 4.0 };
        let timing = Timing { end_s: 4.0, window_s: [3.0, 4.0], checkpoints: 0 };
        let points = prepare(Simd::Scalar, &[(machine, spin.clone())], &timing);
        let ready: Vec<_> = points.iter().flatten().map(|point| (point, &spin)).collect();
        let cases = Cases::new(ready, timing.end_s);
        (cases.choose(ModelKind::Nonlinear, 1e-3).unwrap().unwrap(), cases.plain_step_s())
    }

    #[test]
    fn the_last_digits_of_eigenvalues_change_neither_step_nor_cap() {
        let (capping, plain_step_s) = chosen(1.0);
        assert_eq!(chosen(1.0 + 1e-10), (capping, plain_step_s));
        assert_eq!(chosen(1.0 - 1e-10), (capping, plain_step_s));
        let stiffer = chosen(1.01).0;
        let cap = |geared: &Geared| geared.top().caps.bearings_rad_per_s;
        assert!(stiffer.top().step_s < capping.top().step_s && cap(&stiffer) > cap(&capping));
    }

    #[test]
    fn a_choice_is_put_down_where_it_is_told_to() {
        let machine = Machine::paper();
        let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 };
        let timing = Timing { end_s: 50.0, window_s: [30.0, 50.0], checkpoints: 0 };
        let points = prepare(Simd::Scalar, &[(machine, spin.clone())], &timing);
        let asked = Cell::new(0);
        let ask_until = |last: u32, work: &dyn Fn(&Cases<'_>)| {
            asked.set(0);
            let is_stopped = || {
                asked.set(asked.get() + 1);
                asked.get() >= last
            };
            let ready = points.iter().flatten().map(|point| (point, &spin)).cycle().take(8);
            work(&Cases::until(ready, timing.end_s, &is_stopped));
            asked.get()
        };
        let choose = |cases: &Cases<'_>| cases.choose(ModelKind::Nonlinear, 1e-3).unwrap();
        let whole = ask_until(u32::MAX, &|cases| assert!(choose(cases).is_some()));
        assert!(whole > 24, "{whole}");
        assert_eq!(ask_until(3, &|cases| assert_eq!(cases.cases.len(), 2)), 3);
        // What is left are trials without a single eigenvalue.
        ask_until(20, &|cases| {
            choose(cases);
            assert!(asked.get() >= 20, "it was never told to stop");
        });
    }

    #[test]
    fn one_step_for_all_speeds_is_the_top_gears() {
        let machine = Machine::paper();
        let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 };
        let timing = Timing { end_s: 50.0, window_s: [30.0, 50.0], checkpoints: 0 };
        let points = prepare(Simd::Scalar, &[(machine, spin.clone())], &timing);
        let cases = Cases::new(points.iter().flatten().map(|point| (point, &spin)), timing.end_s);
        let geared = cases.choose(ModelKind::Nonlinear, 1e-5).unwrap().unwrap();
        let steady = cases.choose_steady(ModelKind::Nonlinear, 1e-5).unwrap().unwrap();
        assert_eq!(steady, Geared::steady(geared.top().step_s, geared.top().caps));
    }

    #[test]
    fn a_step_is_rounded_down_by_less_than_a_millionth() {
        for step_s in [2e-4, 1.0 / 3.0, 5.9e-3, 1e-300] {
            let rounded = rounded_down(step_s);
            assert!(rounded <= step_s && rounded > step_s * (1.0 - 1e-6), "{step_s}: {rounded}");
        }
        assert_eq!(rounded_down(0.25), 0.25);
    }
}

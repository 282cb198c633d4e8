//! How far the modes of bearings and hinge may be capped, and how long the steps may then be: from the accuracy asked for, the spin
//! and the machine's own frequencies.
//!
//! Three bounds hold a step h with cap w:
//!
//! * Truncation. Over one memory of a lightly damped motion of frequency f, 1/(zeta f), the local errors of RK4,
//!   (h f)^5 / 120, add up to (h f)^4 / (120 zeta), and those of the formula of order 8 to (h f)^8 / (9! zeta). The
//!   motions to follow are the drum's turning and the suspension's modes; f is the fastest of them. With zeta = 0.1 the
//!   sum is to stay below the accuracy.
//! * Stability. h |s| stays within the method's limit for every mode s of the machine with its caps, hinge and gyroscopic
//!   effects included. The higher the cap the better, but the closer it comes to the hinge's modes from above, the more these
//!   are pushed up by it: h w is the first of 0.95, 0.84, ... times the
//!   formula's limit that leaves the step stable, with the hinge as it is or, if that does not do,
//!   capped too.
//! * Fidelity. What turns with the drum is exact under the caps (`coupling.rs`); other motion is not, and so the modes of
//!   the suspension move, by ds. A motion answers to ds over the distance from resonance, or over the resonance's
//!   half-width |Re s| if that is more. A mode faster than the drum by a factor r takes part in the motion by 1/r^2
//!   only, and of that its speed matters by 1/r^2 again, because static compliance stays exact. The shift so weighted
//!   stays below the accuracy. Stiff bearings pass at once: they hold next to no strain energy of slow modes. Soft ones
//!   do not, and then the cap rises until it caps nothing: plain RK4.
//!
//! The hinge turns with the shaft: a motion of frequency f has f + theta' and f - theta' in it, which modes with theta
//! frozen do not show. A hinge that holds the share e of a mode's strain energy moves it by e f / 2 times the greater
//! softening of the two (`coupling.rs`). A tenth of that is added to ds: on the paper's machine motions answer to less.
//!
//! Between steps a motion is a polynomial of degree 5, which bounds the step too.

use core::iter;

use crate::coupling::{BACKWARD_SHARE, Caps};
use crate::geared::{Formula, GEARS, Gear, Geared, interpolation_phase};
use crate::modal::{Mode, Modes, NoModes, highest_with_caps, modes_with_caps, motions_with_caps};
use crate::nonlinear::COORDINATES;
use crate::point::Point;
use crate::spin::Spin;

/// Modes of the suspension: yaw, pitch, two translations.
const SUSPENSION_MODES: usize = 4;

/// These and the two of the hinge. The bearings' are the other four, and faster unless they are soft.
const SLOW_MODES: usize = SUSPENSION_MODES + 2;

/// Damping ratio of the motions that remember longest.
const MEMORY_DAMPING_RATIO: f64 = 0.1;

/// h times the cap as a share of the formula's limit, the best first.
const STEP_TIMES_CAP: [f64; 4] = [0.95, 0.84, 0.73, 0.62];

/// The hinge's cap as a multiple of the bearings', the best first; the best of all is none.
const HINGE_CAP: [Option<f64>; 3] = [None, Some(1.5), Some(1.0)];

/// Half-width of a resonance that has no damping, as a share of its frequency.
const LEAST_HALF_WIDTH: f64 = 0.01;

/// Modes are capped only where the hinge's are faster than the drum by this.
///
/// Near (f + f_i) / 3, with f of the hinge and f_i of the suspension, its whirls can grow from next to nothing. What they
/// grow from depends on how bearings ring, which rungs with caps share and do not show.
const HINGE_TO_DRUM: f64 = 3.2;

/// Bits of a step's fraction that count: 1e-6 of the step.
const STEP_BITS: u32 = 20;

/// From one candidate step to the next.
const SHORTER: f64 = 0.97;

/// So many candidates are passed over until one holds.
const STRIDE: usize = 8;

/// The part of what a capped hinge shifts that motions answer to: its law is exact for what turns with the drum.
const FREE_SHARE: f64 = 0.1;

/// Greatest speeds of the drum in each gear, as shares of the greatest of all.
///
/// A slower drum drives slower motions, and modes faster than it are hardly driven at all: the step may be longer by as
/// much. Modes that the drum has passed still ring, so a gear is never changed back.
const GEAR_SHARES: [f64; GEARS] = [0.5, 0.71, 1.0];

/// A lower gear is taken if its step is longer by this.
const WORTH_A_GEAR: f64 = 1.1;

/// Machines on whose account a run's steps and caps are chosen, with what is known of them without a cap.
pub struct Cases<'a>(Vec<Result<Case<'a>, NoModes>>);

struct Case<'a> {
    point: &'a Point,
    /// Of the motions to follow.
    fastest_followed_rad_per_s: f64,
    /// Of all modes, at rest and turning.
    fastest_rad_per_s: f64,
    /// The hinge is stiff enough.
    may_be_capped: bool,
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

/// A step and its caps, for a formula.
#[derive(Clone, Copy)]
struct Trial {
    formula: Formula,
    step_s: f64,
    caps: Caps,
}

impl Trial {
    fn is_stable(&self, frequency_rad_per_s: f64) -> bool {
        self.step_s * frequency_rad_per_s <= self.formula.limit()
    }
}

impl<'a> Case<'a> {
    fn new(point: &'a Point, spin: &Spin, end_s: f64) -> Result<Self, NoModes> {
        let top = spin.greatest_speed_rad_per_s(end_s);
        let rest = State::new(point, 0.0)?;
        let [first, second, third] = GEAR_SHARES.map(|share| State::new(point, share * top));
        let slow = &rest.modes.modes;
        let followed = top.max(slow[SUSPENSION_MODES - 1].magnitude_rad_per_s);
        let hinge = slow[SUSPENSION_MODES].magnitude_rad_per_s;
        Ok(Self {
            point,
            // A soft hinge takes part in the motion.
            fastest_followed_rad_per_s: if hinge < 2.0 * followed { hinge } else { followed },
            may_be_capped: hinge >= HINGE_TO_DRUM * top,
            fastest_rad_per_s: highest_with_caps(point, 0.0, None)?.max(highest_with_caps(point, top, None)?),
            turning: [first?, second?, third?],
            rest,
        })
    }

    /// Whether a step is stable with these caps in a gear, and the slow modes stay where they are. What refuses most is
    /// asked first, and what needs eigenvalues at every angle last.
    fn holds(&self, trial: &Trial, gear: usize, accuracy: f64) -> Result<bool, NoModes> {
        let top_rad_per_s = self.turning[gear].speed_rad_per_s;
        for state in [&self.turning[gear], &self.rest] {
            let hinge = |mode| self.hinge_shift(mode, state.speed_rad_per_s, &trial.caps);
            let slow = &state.modes.modes[..SLOW_MODES];
            if slow.iter().any(|mode| error_of_shift(mode, hinge(mode), top_rad_per_s) > accuracy) {
                return Ok(false);
            }
            let capped = motions_with_caps(self.point, state.speed_rad_per_s, &trial.caps)?;
            if !trial.is_stable(capped[COORDINATES - 1].magnitude_rad_per_s)
                || self.error_of_caps(state, &trial.caps, top_rad_per_s)? > accuracy
            {
                return Ok(false);
            }
        }
        for state in [&self.turning[gear], &self.rest] {
            if !trial.is_stable(highest_with_caps(self.point, state.speed_rad_per_s, Some(&trial.caps))?) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// What the shifts of slow modes do to amplitudes.
    fn error_of_caps(&self, state: &State, caps: &Caps, top_rad_per_s: f64) -> Result<f64, NoModes> {
        let of_bearings = Caps { hinge_rad_per_s: None, ..*caps };
        let capped = motions_with_caps(self.point, state.speed_rad_per_s, &of_bearings)?;
        let errors = state.modes.modes[..SLOW_MODES].iter().zip(&capped).map(|(plain, capped)| {
            let (slower, detuned) = (capped.s.re - plain.re_per_s, capped.s.im - plain.im_rad_per_s);
            let of_bearings = (slower * slower + detuned * detuned).sqrt();
            let of_hinge = self.hinge_shift(plain, state.speed_rad_per_s, caps);
            error_of_shift(plain, of_bearings + of_hinge, top_rad_per_s)
        });
        Ok(errors.fold(0.0, f64::max))
    }

    /// What a hinge with a cap adds to a suspension mode's shift while the drum turns (rad/s), as it counts.
    fn hinge_shift(&self, mode: &Mode, turning_rad_per_s: f64, caps: &Caps) -> f64 {
        let Some(cap_rad_per_s) = caps.hinge_rad_per_s else { return 0.0 };
        let frequency = mode.magnitude_rad_per_s;
        let is_of_suspension = frequency <= self.rest.modes.modes[SUSPENSION_MODES].magnitude_rad_per_s;
        if !is_of_suspension {
            return 0.0;
        }
        let softening = (frequency * frequency - BACKWARD_SHARE * turning_rad_per_s * turning_rad_per_s)
            .abs()
            + (1.0 - BACKWARD_SHARE) * frequency * turning_rad_per_s;
        let in_hinge = softening / (cap_rad_per_s * cap_rad_per_s);
        FREE_SHARE * 0.5 * mode.hinge_share(self.point) * frequency * in_hinge
    }

    /// What truncation does to amplitudes.
    fn error_of_truncation(&self, formula: Formula, step_s: f64) -> f64 {
        formula.error_per_radian(step_s * self.fastest_followed_rad_per_s) / MEMORY_DAMPING_RATIO
    }
}

/// Relative error of an amplitude if a mode moves so far (rad/s).
fn error_of_shift(mode: &Mode, shift_rad_per_s: f64, speed_rad_per_s: f64) -> f64 {
    let frequency = mode.magnitude_rad_per_s;
    let half_width = mode.re_per_s.abs().max(LEAST_HALF_WIDTH * frequency);
    let distance = half_width.max(frequency - speed_rad_per_s);
    let weight = (speed_rad_per_s / frequency).min(1.0).powi(4);
    weight * shift_rad_per_s / distance
}

impl<'a> Cases<'a> {
    /// Points whose drums turn as their spins say until `end_s`.
    #[must_use]
    pub fn new(points: impl IntoIterator<Item = (&'a Point, &'a Spin)>, end_s: f64) -> Self {
        Self(points.into_iter().map(|(point, spin)| Case::new(point, spin, end_s)).collect())
    }

    /// The longest step at which plain RK4 is stable at each of the points; `None` if there are none.
    /// Machines without modes are left out.
    #[must_use]
    pub fn plain_step_s(&self) -> Option<f64> {
        let steps = self.0.iter().flatten().map(|case| Formula::Rk4.limit() / case.fastest_rad_per_s);
        steps.reduce(f64::min).map(rounded_down)
    }

    fn all(&self) -> Result<Vec<&Case<'a>>, NoModes> {
        self.0.iter().map(|case| case.as_ref().map_err(|none| *none)).collect()
    }

    /// The longest steps of a formula, and their caps, at which amplitudes should be right to `accuracy` (relative) at
    /// each of the points; `None` if plain RK4 at its longest stable step is cheaper.
    ///
    /// # Errors
    /// [`NoModes`] of the first machine that has none.
    pub fn choose(&self, formula: Formula, accuracy: f64) -> Result<Option<Geared>, NoModes> {
        let cases = self.all()?;
        let Some(plain_step_s) = self.plain_step_s() else { return Ok(None) };
        if !cases.iter().all(|case| case.may_be_capped) {
            return Ok(None);
        }
        let most_evaluations_per_s = Formula::Rk4.evaluations_per_s(plain_step_s);
        let followed = cases.iter().map(|case| case.fastest_followed_rad_per_s).fold(0.0, f64::max);
        let longest_phase =
            formula.step_phase(MEMORY_DAMPING_RATIO * accuracy).min(interpolation_phase(accuracy));
        let longest_s = longest_phase / followed;
        let top = GEARS - 1;
        let shortest_s = formula.evaluations_per_s(1.0) / most_evaluations_per_s;
        let Some(trial) = longest(&cases, formula, top, [shortest_s, longest_s], accuracy)? else {
            return Ok(None);
        };
        let mut geared = Geared::steady(formula, trial.step_s, trial.caps);
        for gear in 0..top {
            let steps_s = [WORTH_A_GEAR * trial.step_s, longest_s / GEAR_SHARES[gear]];
            if let Some(Trial { step_s, caps, .. }) = longest(&cases, formula, gear, steps_s, accuracy)? {
                let speeds = cases.iter().map(|case| case.turning[gear].speed_rad_per_s);
                let up_to_rad_per_s = speeds.fold(f64::INFINITY, f64::min);
                geared.gears[gear] = Gear { up_to_rad_per_s, step_s, caps };
            } else {
                // The next gear serves here too.
                geared.gears[gear].up_to_rad_per_s = 0.0;
            }
        }
        Ok(Some(geared))
    }

    /// The relative error of amplitudes that the rule expects of a choice: the greatest of what truncation and caps do
    /// at any of the points.
    ///
    /// # Errors
    /// [`NoModes`] of the first machine that has none.
    pub fn expected_error(&self, geared: &Geared) -> Result<f64, NoModes> {
        let Gear { step_s, caps, .. } = *geared.top();
        let mut error = 0.0_f64;
        for case in self.all()? {
            error = error.max(case.error_of_truncation(geared.formula, step_s));
            let state = &case.turning[GEARS - 1];
            error = error.max(case.error_of_caps(state, &caps, state.speed_rad_per_s)?);
        }
        Ok(error)
    }
}

/// The longest step above the shorter of two, and up to the longer one, that holds in a gear, with its caps.
fn longest(
    cases: &[&Case<'_>],
    formula: Formula,
    gear: usize,
    [above_s, up_to_s]: [f64; 2],
    accuracy: f64,
) -> Result<Option<Trial>, NoModes> {
    let steps_s = iter::successors(Some(rounded_down(up_to_s)), |step_s| Some(SHORTER * step_s));
    let steps_s: Vec<f64> = steps_s.take_while(|step_s| *step_s > above_s).collect();
    // By strides, and back to the longest step of the last one by halving.
    let mut fail = 0;
    for at in (0..steps_s.len()).step_by(STRIDE).chain(steps_s.len().checked_sub(1)) {
        if let Some(mut best) = holding(cases, formula, gear, steps_s[at], accuracy)? {
            let mut holds = at;
            while fail < holds {
                let between = fail.midpoint(holds);
                match holding(cases, formula, gear, steps_s[between], accuracy)? {
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
fn holding(
    cases: &[&Case<'_>],
    formula: Formula,
    gear: usize,
    step_s: f64,
    accuracy: f64,
) -> Result<Option<Trial>, NoModes> {
    for step_times_cap in STEP_TIMES_CAP {
        let cap = step_times_cap * formula.limit() / step_s;
        'caps: for multiple in HINGE_CAP {
            let hinge_rad_per_s = multiple.map(|multiple| multiple * cap);
            let trial = Trial { formula, step_s, caps: Caps { bearings_rad_per_s: cap, hinge_rad_per_s } };
            for case in cases {
                if !case.holds(&trial, gear, accuracy)? {
                    continue 'caps;
                }
            }
            return Ok(Some(trial));
        }
    }
    Ok(None)
}

/// A step of few digits. The last ones of an eigenvalue are the processor's and the system's mathematical library's own, and a
/// result must not depend on either.
fn rounded_down(step_s: f64) -> f64 {
    f64::from_bits(
        step_s.to_bits() >> (f64::MANTISSA_DIGITS - 1 - STEP_BITS) << (f64::MANTISSA_DIGITS - 1 - STEP_BITS),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Machine, Timing, prepare};
    use lane_ode::Simd;

    /// Run up slowly enough for the fastest suspension mode, an eigenvalue, to decide the step.
    fn chosen(stiffer: f64) -> (Geared, Option<f64>) {
        let mut machine = Machine::paper();
        for spring in &mut machine.springs {
            spring.stiffness_n_per_m *= stiffer;
        }
        let spin = Spin::Ramp { peak_rpm: 100.0, ramp_s: 4.0 };
        let timing = Timing { end_s: 4.0, window_s: [3.0, 4.0], checkpoints: 0 };
        let points = prepare(Simd::Scalar, &[(machine, spin.clone())], &timing);
        let ready: Vec<_> = points.iter().flatten().map(|point| (point, &spin)).collect();
        let cases = Cases::new(ready, timing.end_s);
        (cases.choose(Formula::Dop853, 1e-3).unwrap().unwrap(), cases.plain_step_s())
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
    fn a_step_is_rounded_down_by_less_than_a_millionth() {
        for step_s in [2e-4, 1.0 / 3.0, 5.9e-3, 1e-300] {
            let rounded = rounded_down(step_s);
            assert!(rounded <= step_s && rounded > step_s * (1.0 - 1e-6), "{step_s}: {rounded}");
        }
        assert_eq!(rounded_down(0.25), 0.25);
    }
}

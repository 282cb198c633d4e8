//! How far the modes of bearings and hinge may be capped, and how long the steps may then be: from the accuracy asked for, the spin
//! and the machine's own frequencies.
//!
//! Three bounds hold a step h of RK4 with cap w:
//!
//! * Truncation. Over one memory of a lightly damped motion of frequency f, 1/(zeta f), RK4's local errors (h f)^5 / 120 add up to
//!   (h f)^4 / (120 zeta). The motions to follow are the drum's turning and the suspension's modes; f is the fastest of them. With
//!   zeta = 0.1, (h f)^4 / 12 is to stay below the accuracy.
//! * Stability. h |s| stays within the method's limit for every mode s of the machine with its caps, hinge and gyroscopic
//!   effects included. The higher the cap the better, but the closer it comes to the hinge's modes from above, the more these
//!   are pushed up by it: h w is the first of 2.6, 2.3, ... that leaves the step stable, with the hinge as it is or, if that does not do,
//!   capped too.
//! * Fidelity. What turns with the drum is exact under the caps (`coupling.rs`); other motion is not, and so the modes of suspension and hinge
//!   move, by ds. A response at the drum's speed would answer to ds over
//!   the distance from resonance, or the resonance's half-width |Re s| if that is more; that it is exact leaves free and nonlinear motion to
//!   answer, which is less. A mode faster than the drum by a factor r
//!   takes part in the motion by 1/r^2 only, and of that its speed matters by 1/r^2 again, because static compliance stays exact.
//!   The shift so weighted stays below the accuracy.
//!   Stiff bearings pass at once: they hold next to no strain energy of slow modes. Soft ones do not, and then the cap rises until it
//!   caps nothing: plain RK4.
//!
//! The hinge turns with the shaft: a motion of frequency f has frequencies up to f + theta' in it, which modes with theta frozen do not show.
//! A hinge that holds the share e of a mode's strain energy moves it by e f / 2 times ((f + theta') / w)^2. Two and a half times that is added to ds: violent
//! motion, which does not keep to the drum's speed, answers to it as well.

use crate::coupling::Caps;
use crate::modal::{Mode, Modes, NoModes, highest_with_caps, modes_with_caps};
use crate::nonlinear::COORDINATES;
use crate::point::Point;
use crate::run::Method;
use crate::spin::Spin;
use lane_ode::rk4::RK4_STABILITY_LIMIT;

/// Modes of the suspension: yaw, pitch, two translations.
const SUSPENSION_MODES: usize = 4;

/// These and the two of the hinge. The bearings' are the other four, and faster unless they are soft.
const SLOW_MODES: usize = SUSPENSION_MODES + 2;

/// Damping ratio of the motions that remember longest.
const MEMORY_DAMPING_RATIO: f64 = 0.1;

/// h times the cap, the best first.
const STEP_TIMES_CAP: [f64; 4] = [2.6, 2.3, 2.0, 1.7];

/// The hinge's cap as a multiple of the bearings', the best first; the best of all is none.
const HINGE_CAP: [Option<f64>; 3] = [None, Some(1.5), Some(1.0)];

/// h times the fastest mode: within the limit by what nonlinear motion may add.
const STEP_TIMES_FASTEST: f64 = 0.97 * RK4_STABILITY_LIMIT;

/// Half-width of a resonance that has no damping, as a share of its frequency.
const LEAST_HALF_WIDTH: f64 = 0.01;

/// By how much the shift that a turning hinge adds counts more than another.
const HINGE_WEIGHT: f64 = 2.5;

/// Bits of a step's fraction that count: 1e-6 of the step.
const STEP_BITS: u32 = 20;

/// From one candidate step to the next.
const SHORTER: f64 = 0.97;

/// Step and cap for one accuracy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capping {
    /// Longest step.
    pub step_s: f64,
    /// The caps, if capping gains anything.
    pub caps: Option<Caps>,
}

impl Capping {
    /// The method of these numbers.
    #[must_use]
    pub const fn method(&self) -> Method {
        match self.caps {
            Some(caps) => Method::Rk4MassScaled { step_s: self.step_s, caps },
            None => Method::Rk4 { step_s: self.step_s },
        }
    }
}

/// Machines on whose account a run's step and cap are chosen, with what is known of them without a cap.
pub struct Cases<'a>(Vec<Result<Case<'a>, NoModes>>);

struct Case<'a> {
    point: &'a Point,
    /// The drum's greatest.
    speed_rad_per_s: f64,
    /// Of the motions to follow.
    fastest_followed_rad_per_s: f64,
    /// Of all modes, at rest and turning.
    fastest_rad_per_s: f64,
    /// At the drum's greatest speed, and at rest.
    modes: [Modes; 2],
}

impl<'a> Case<'a> {
    fn new(point: &'a Point, spin: &Spin, end_s: f64) -> Result<Self, NoModes> {
        let speed = spin.greatest_speed_rad_per_s(end_s);
        let modes = [modes_with_caps(point, 0.0, speed, None)?, modes_with_caps(point, 0.0, 0.0, None)?];
        let slow = &modes[1].modes;
        let followed = speed.max(slow[SUSPENSION_MODES - 1].magnitude_rad_per_s);
        let hinge = slow[SUSPENSION_MODES].magnitude_rad_per_s;
        Ok(Self {
            point,
            speed_rad_per_s: speed,
            // A soft hinge takes part in the motion.
            fastest_followed_rad_per_s: if hinge < 2.0 * followed { hinge } else { followed },
            fastest_rad_per_s: highest_with_caps(point, 0.0, None)?
                .max(highest_with_caps(point, speed, None)?),
            modes,
        })
    }

    /// Whether a step is stable with these caps, and the slow modes stay where they are. What refuses most is asked first, and what needs
    /// eigenvalues at every angle last.
    fn holds(&self, step_s: f64, caps: &Caps, accuracy: f64) -> Result<bool, NoModes> {
        let speeds = [self.speed_rad_per_s, 0.0];
        for (turning, plain) in speeds.into_iter().zip(&self.modes) {
            let slow = &plain.modes[..SLOW_MODES];
            let added: [f64; SLOW_MODES] = core::array::from_fn(|i| match caps.hinge_rad_per_s {
                Some(cap) if i < SUSPENSION_MODES => {
                    HINGE_WEIGHT * self.turning_shift(&slow[i], turning, cap)
                }
                _ => 0.0,
            });
            if slow.iter().zip(added).any(|(mode, added)| !self.allows(mode, added, accuracy)) {
                return Ok(false);
            }
            let capped = modes_with_caps(self.point, 0.0, turning, Some(caps))?;
            if step_s * capped.modes[COORDINATES - 1].magnitude_rad_per_s > STEP_TIMES_FASTEST {
                return Ok(false);
            }
            for ((plain, capped), added) in slow.iter().zip(&capped.modes).zip(added) {
                let (slower, detuned) =
                    (capped.re_per_s - plain.re_per_s, capped.im_rad_per_s - plain.im_rad_per_s);
                if !self.allows(plain, (slower * slower + detuned * detuned).sqrt() + added, accuracy) {
                    return Ok(false);
                }
            }
        }
        for turning in speeds {
            if step_s * highest_with_caps(self.point, turning, Some(caps))? > STEP_TIMES_FASTEST {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// By how much a hinge with a cap moves a mode while the drum turns (rad/s).
    fn turning_shift(&self, mode: &Mode, turning_rad_per_s: f64, cap_rad_per_s: f64) -> f64 {
        let frequency = mode.magnitude_rad_per_s;
        let in_hinge = (frequency + turning_rad_per_s) / cap_rad_per_s;
        0.5 * mode.hinge_share(self.point) * frequency * in_hinge * in_hinge
    }

    /// Whether a mode may move so far (rad/s).
    fn allows(&self, mode: &Mode, shift_rad_per_s: f64, accuracy: f64) -> bool {
        let frequency = mode.magnitude_rad_per_s;
        let half_width = mode.re_per_s.abs().max(LEAST_HALF_WIDTH * frequency);
        let distance = half_width.max(frequency - self.speed_rad_per_s);
        let weight = (self.speed_rad_per_s / frequency).min(1.0).powi(4);
        weight * shift_rad_per_s <= accuracy * distance
    }
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
        let steps = self.0.iter().flatten().map(|case| STEP_TIMES_FASTEST / case.fastest_rad_per_s);
        steps.reduce(f64::min).map(rounded_down)
    }

    /// The longest step, and its cap, at which amplitudes should be right to `accuracy` (relative) at each of the points.
    ///
    /// # Errors
    /// [`NoModes`] of the first machine that has none.
    pub fn choose(&self, accuracy: f64) -> Result<Capping, NoModes> {
        let cases = self.0.iter().map(|case| case.as_ref().map_err(|none| *none));
        let cases = cases.collect::<Result<Vec<_>, _>>()?;
        let fastest_followed = cases.iter().map(|case| case.fastest_followed_rad_per_s).fold(0.0, f64::max);
        let mut step_s =
            rounded_down((120.0 * MEMORY_DAMPING_RATIO * accuracy).powf(0.25) / fastest_followed);
        let plain_step_s = self.plain_step_s().unwrap_or(f64::INFINITY);
        if step_s <= plain_step_s {
            return Ok(Capping { step_s, caps: None });
        }
        while step_s > plain_step_s {
            for step_times_cap in STEP_TIMES_CAP {
                let cap = step_times_cap / step_s;
                for multiple in HINGE_CAP {
                    let hinge_rad_per_s = multiple.map(|multiple| multiple * cap);
                    let caps = Caps { bearings_rad_per_s: cap, hinge_rad_per_s };
                    let mut holds = true;
                    for case in &cases {
                        holds = holds && case.holds(step_s, &caps, accuracy)?;
                    }
                    if holds {
                        return Ok(Capping { step_s, caps: Some(caps) });
                    }
                }
            }
            step_s *= SHORTER;
        }
        Ok(Capping { step_s: plain_step_s, caps: None })
    }
}

/// A step of few digits. The last ones of an eigenvalue are the processor's and the system's mathematical library's own, and a result must not
/// depend on either.
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
    fn chosen(stiffer: f64) -> (Capping, Option<f64>) {
        let mut machine = Machine::paper();
        for spring in &mut machine.springs {
            spring.stiffness_n_per_m *= stiffer;
        }
        let spin = Spin::Ramp { peak_rpm: 100.0, ramp_s: 4.0 };
        let timing = Timing { end_s: 4.0, window_s: [3.0, 4.0] };
        let points = prepare(Simd::Scalar, &[(machine, spin.clone())], &timing);
        let ready: Vec<_> = points.iter().flatten().map(|point| (point, &spin)).collect();
        let cases = Cases::new(ready, timing.end_s);
        (cases.choose(1e-3).unwrap(), cases.plain_step_s())
    }

    #[test]
    fn the_last_digits_of_eigenvalues_change_neither_step_nor_cap() {
        let (capping, plain_step_s) = chosen(1.0);
        assert_eq!(chosen(1.0 + 1e-10), (capping, plain_step_s));
        assert_eq!(chosen(1.0 - 1e-10), (capping, plain_step_s));
        let stiffer = chosen(1.01).0;
        let cap = |capping: &Capping| capping.caps.unwrap().bearings_rad_per_s;
        assert!(stiffer.step_s < capping.step_s && cap(&stiffer) > cap(&capping));
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

//! Finds the longest stable steps of the explicit formulas, with and without capped bearing modes.
//!
//! The stiff bearings limit an explicit method to steps of some 0.4 ms, although they hardly move.
//! With caps on their modes (section 4.3 of the model page) the hinge is the fastest part, and
//! steps may be twenty times as long. The cap is the formula's limit of stability, less a reserve,
//! divided by the step. If it is above the bearings' own modes, no modes are capped.

pub(crate) mod formula;

use crate::highest_frequency_rad_per_s;
use crate::modes::{highest_capped_frequency_rad_per_s, mode_roots};
use crate::{Caps, Formula, Method, MethodKind, ModelKind, ModesError, Point, Spin};
use lane_ode::Cancel;

/// The number of modes of the suspension: yaw, pitch and two translations.
pub(crate) const SUSPENSION_MODES: usize = 4;

/// The least ratio of the hinge's frequency to the drum's speed at which modes are capped.
///
/// Derived: a drum whose speed is a third of the hinge's frequency f (more exactly (f + f_i) / 3,
/// with a frequency f_i of the suspension), or a quarter, excites a whirl of the hinge. The whirl
/// decays slowly, but the long steps of capped levels damp it. So the ratio is 4, and the rest
/// allows for f_i. On the machine of `differential_test -- 9 313678833`, the whirl at a fifth is a
/// tenth of that at a quarter. Doubling the ratio leaves no capped modes above 470 rpm on the
/// paper's machine.
pub(crate) const MIN_HINGE_SPEED_RATIO: f64 = 4.2;

/// The product of step and cap, relative to [`Formula::limit`]. The reserve allows for the hinge: a
/// cap near its modes raises their frequencies. Basis: `sweep check` finds the longest stable step
/// with this value; with 0.84 caps are lower and errors larger, with 0.99 steps are shorter.
/// Doubling it leaves no step stable.
const CAP_LIMIT_SHARE: f64 = 0.85;

/// The number of bits of a step's fraction that are kept, which is 1e-6 of the step. Basis: the
/// last digits of an eigenvalue depend on the processor and on the system's mathematical library,
/// and steps must not depend on them. Doubling it keeps such digits.
const STEP_BITS: u32 = 20;

/// The number of bisections of the interval of the longest step. Basis: they find its logarithm to
/// 2^-10 of the interval, about 0.6 % of the step. Doubling it doubles the time.
const BISECTION_COUNT: usize = 10;

/// The machines of a run with the frequencies that bound their steps.
pub struct StepSelector<'a> {
    machine_frequencies: Vec<Result<MachineFrequencies<'a>, ModesError>>,
    cancel: Cancel<'a>,
}

/// The frequencies of one machine.
struct MachineFrequencies<'a> {
    point: &'a Point,
    /// The greatest speed of the drum.
    max_speed_rad_per_s: f64,
    /// The frequency of the fastest mode of the suspension at rest.
    suspension_frequency_rad_per_s: f64,
    /// The frequency of the slower mode of the hinge at rest.
    hinge_rad_per_s: f64,
    /// The highest frequency of all modes, at rest and at the drum's greatest speed.
    highest_frequency_rad_per_s: f64,
}

impl<'a> MachineFrequencies<'a> {
    fn new(point: &'a Point, spin: &Spin, end_s: f64) -> Result<Self, ModesError> {
        let max_speed_rad_per_s = spin.max_speed_rad_per_s(end_s);
        let rest_roots = mode_roots(point, 0.0, None)?;
        let highest_at_rest_rad_per_s = highest_frequency_rad_per_s(point, 0.0)?;
        let highest_at_speed_rad_per_s = highest_frequency_rad_per_s(point, max_speed_rad_per_s)?;
        Ok(Self {
            point,
            max_speed_rad_per_s,
            suspension_frequency_rad_per_s: rest_roots[SUSPENSION_MODES - 1].magnitude_rad_per_s,
            hinge_rad_per_s: rest_roots[SUSPENSION_MODES].magnitude_rad_per_s,
            highest_frequency_rad_per_s: highest_at_rest_rad_per_s.max(highest_at_speed_rad_per_s),
        })
    }

    /// Whether a step with capped modes is stable, at rest and at the drum's greatest speed.
    fn is_stable(&self, model: ModelKind, step_s: f64) -> Result<bool, ModesError> {
        let caps = caps_for_step(model, step_s);
        let stability_limit = Formula::for_model(model).limit();
        for speed_rad_per_s in [self.max_speed_rad_per_s, 0.0] {
            let highest_rad_per_s = highest_capped_frequency_rad_per_s(
                self.point,
                model,
                speed_rad_per_s,
                Some(&caps),
            )?;
            if step_s * highest_rad_per_s > stability_limit {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// Returns the bearings' cap for a step; the hinge has none.
fn caps_for_step(model: ModelKind, step_s: f64) -> Caps {
    let bearings_rad_per_s = CAP_LIMIT_SHARE * Formula::for_model(model).limit() / step_s;
    Caps { bearings_rad_per_s, hinge_rad_per_s: None }
}

/// Returns the method of a capped kind that integrates a model in these steps (s).
pub fn capped_method(model: ModelKind, kind: MethodKind, step_s: f64) -> Method {
    Method::capped(kind, step_s, caps_for_step(model, step_s))
}

impl<'a> StepSelector<'a> {
    /// Creates a selector for points with their spins, which last until `end_s`.
    pub fn new(points: impl IntoIterator<Item = (&'a Point, &'a Spin)>, end_s: f64) -> Self {
        Self::until(points, end_s, Cancel::Never)
    }

    /// Creates a selector as [`Self::new`] does, but polls `cancel` before each machine's
    /// eigenvalues.
    ///
    /// Once `cancel` is requested, the selector must not be used.
    pub fn until(
        points: impl IntoIterator<Item = (&'a Point, &'a Spin)>,
        end_s: f64,
        cancel: Cancel<'a>,
    ) -> Self {
        let points = points.into_iter().take_while(|_| !cancel.is_requested());
        let machine_frequencies =
            points.map(|(point, spin)| MachineFrequencies::new(point, spin, end_s)).collect();
        Self { machine_frequencies, cancel }
    }

    /// Returns the longest step (s) at which a formula is stable at all points without capped
    /// modes; `None` if there are no points. Machines whose modes cannot be computed are skipped.
    pub fn plain_step_s(&self, formula: Formula) -> Option<f64> {
        let machines = self.machine_frequencies.iter().flatten();
        let step_limits_s =
            machines.map(|machine| formula.limit() / machine.highest_frequency_rad_per_s);
        step_limits_s.reduce(f64::min).map(round_down_step)
    }

    /// Returns the longest stable step (s) of a model's formula without capped modes.
    pub fn uncapped_step_s(&self, model: ModelKind) -> Option<f64> {
        self.plain_step_s(Formula::for_model(model))
    }

    /// Whether any machine has forces with corners, such as friction or stops. At corners errors do
    /// not decrease with the step by the order of a formula.
    pub fn has_nonsmooth_force(&self) -> bool {
        let mut machines = self.machine_frequencies.iter().flatten();
        machines.any(|machine| machine.point.machine.elements.has_nonsmooth_force())
    }

    /// Returns the longest stable step (s) of a model's formula with capped bearing modes, over all
    /// points; `None` if it is not longer than the uncapped one, or if the search was stopped.
    ///
    /// # Errors
    /// [`ModesError`] of a machine that has none.
    pub fn capped_step_s(&self, model: ModelKind) -> Result<Option<f64>, ModesError> {
        let Some(uncapped_s) = self.uncapped_step_s(model) else { return Ok(None) };
        let mut machines = Vec::with_capacity(self.machine_frequencies.len());
        for machine in &self.machine_frequencies {
            machines.push(machine.as_ref().map_err(|none| *none)?);
        }
        let is_whirling = |machine: &&MachineFrequencies<'_>| {
            machine.hinge_rad_per_s < MIN_HINGE_SPEED_RATIO * machine.max_speed_rad_per_s
        };
        if machines.iter().any(is_whirling) {
            return Ok(None);
        }
        let max_resolved_rad_per_s = |fastest: f64, machine: &&MachineFrequencies<'_>| {
            fastest.max(machine.suspension_frequency_rad_per_s).max(machine.max_speed_rad_per_s)
        };
        let resolved_rad_per_s = machines.iter().fold(0.0, max_resolved_rad_per_s);
        let mut stable_s = uncapped_s;
        let mut unstable_s = Formula::for_model(model).limit() / resolved_rad_per_s;
        for _ in 0..BISECTION_COUNT {
            let midpoint_s = (stable_s * unstable_s).sqrt();
            let mut is_stable = true;
            for machine in &machines {
                if self.cancel.is_requested() {
                    return Ok(None);
                }
                is_stable = is_stable && machine.is_stable(model, midpoint_s)?;
            }
            if is_stable {
                stable_s = midpoint_s;
            } else {
                unstable_s = midpoint_s;
            }
        }
        Ok((stable_s > uncapped_s).then(|| round_down_step(stable_s)))
    }
}

/// Rounds a positive number down to few digits. The last digits of an eigenvalue depend on the
/// processor and on the system's mathematical library; results must not depend on them.
pub(crate) fn round_down_step(number: f64) -> f64 {
    round_down_to_bits(number, STEP_BITS)
}

/// Rounds a positive number down to `bits` binary digits after the first.
pub(crate) fn round_down_to_bits(number: f64, bits: u32) -> f64 {
    let dropped_bits = f64::MANTISSA_DIGITS - 1 - bits;
    f64::from_bits(number.to_bits() >> dropped_bits << dropped_bits)
}

//! Error norm and step size control of adaptive methods, per lane.

use crate::{Lane, N};

/// The tolerances and the step limit of an adaptive method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// The relative tolerance of the error of each component in a step.
    pub relative: f64,
    /// The absolute tolerance of the error of each component in a step, in the component's unit.
    pub absolute: f64,
    /// The greatest number of steps of one segment, accepted and rejected ones together.
    pub max_steps: u64,
    /// The longest step (s), if there is one, such as the limit of stability.
    pub longest_step_s: Option<f64>,
}

impl Tolerance {
    /// Returns the largest ratio of a component's error to its tolerance. A step is accepted if
    /// this ratio is below 1. The result is NaN if any component is not finite.
    #[inline(always)]
    pub(crate) fn error_norm<T: Lane, const D: usize>(
        &self,
        start_state: &[N<T>; D],
        end_state: &[N<T>; D],
        error: &[N<T>; D],
    ) -> N<T> {
        let zero = start_state[0].lit(0.0);
        let mut largest_ratio = zero;
        let mut nan_sum = zero;
        for i in 0..D {
            let magnitude = N(start_state[i].0.abs().larger(end_state[i].0.abs()));
            let ratio = error[i].abs() / (magnitude * self.relative + self.absolute);
            largest_ratio = N(ratio.0.larger(largest_ratio.0));
            // The maximum ignores a NaN, so that the product with zero passes it on to the result.
            nan_sum += ratio * zero;
        }
        largest_ratio + nan_sum
    }
}

/// Returns a matrix of coefficients from its rows, which may omit zeros at their ends.
pub(crate) const fn pad_rows<const ROWS: usize, const COLUMNS: usize>(
    rows: [&[f64]; ROWS],
) -> [[f64; COLUMNS]; ROWS] {
    let mut matrix = [[0.0; COLUMNS]; ROWS];
    let mut i = 0;
    while i < ROWS {
        let (row, _) = matrix[i].split_at_mut(rows[i].len());
        row.copy_from_slice(rows[i]);
        i += 1;
    }
    matrix
}

/// The exponents of the step control for the order of a method. They are sums of powers of one
/// half, so that they need square roots only and the bits are the same everywhere.
#[derive(Clone, Copy)]
pub(crate) enum ControlExponents {
    /// alpha = 11/64 = 0.172, beta = 5/128 = 0.039 (`dopri5.f`: 0.17 and 0.04).
    Order5,
    /// alpha = 1/8, beta = 0 (`dop853.f`).
    Order8,
}

/// Proportional-integral step control (Hairer and Wanner II, section IV.2): h is multiplied by 0.9
/// err^-alpha err_before^beta, within 0.2 to 5.
pub(crate) struct StepControl<T> {
    exponents: ControlExponents,
    /// The step to try next.
    pub(crate) step: N<T>,
    /// The factor err^beta of the last accepted step.
    error_memory: N<T>,
    /// A mask of the lanes whose last step was rejected: their next step must not grow.
    rejected_lanes: u32,
}

/// The next step of each lane, if the current one is accepted and if it is rejected.
pub(crate) struct Proposals<T> {
    step_if_accepted: N<T>,
    step_if_rejected: N<T>,
    error_memory_if_accepted: N<T>,
}

/// Clamps the factor from one step to the next to the range from [`MIN_STEP_FACTOR`] to
/// `max_factor`.
#[inline(always)]
fn clamp_factor<T: Lane>(factor: N<T>, max_factor: f64) -> N<T> {
    let min_factor = factor.lit(MIN_STEP_FACTOR);
    let max_factor = factor.lit(max_factor);
    let factor = factor.where_less(max_factor, factor, max_factor);
    min_factor.where_less(factor, factor, min_factor)
}

/// The safety factor of the step size. Basis: `dopri5.f` (0.9). With double the value nearly every
/// step would be rejected.
const SAFETY_FACTOR: f64 = 0.9;
/// The least factor from one step to the next. Basis: `dopri5.f` (0.2). Doubling it takes more
/// rejected steps where the motion suddenly becomes faster.
const MIN_STEP_FACTOR: f64 = 0.2;
/// The greatest factor from one step to the next. Basis: half of `dopri5.f`'s 10. Doubling it has
/// more steps rejected after the first one of a segment.
const MAX_STEP_FACTOR: f64 = 5.0;
/// The least error, relative to the tolerance, from which the next step is computed. Basis: such an
/// error gives a factor far above [`MAX_STEP_FACTOR`], so that doubling it changes no step.
const MIN_ERROR: f64 = 1e-10;

impl<T: Lane> StepControl<T> {
    #[inline(always)]
    pub(crate) fn new(zero: N<T>, exponents: ControlExponents) -> Self {
        Self { exponents, step: zero, error_memory: zero.lit(1.0), rejected_lanes: 0 }
    }

    /// Starts a segment in a lane. The memory of the lane's earlier trajectories is discarded, so
    /// that results do not depend on them.
    #[inline(always)]
    pub(crate) fn start(&mut self, lane: usize, first_step_s: f64) {
        self.step.0.set(lane, first_step_s);
        self.error_memory.0.set(lane, 1.0);
        self.rejected_lanes &= !(1 << lane);
    }

    /// Computes the next steps after a step `h` with error `error`.
    #[inline(always)]
    pub(crate) fn propose_steps(&self, error: N<T>, h: N<T>) -> Proposals<T> {
        // A NaN is treated as a far too large error.
        let error = error.where_less(error.lit(1e30), error, error.lit(1e30));
        let error = error.lit(MIN_ERROR).where_less(error, error, error.lit(MIN_ERROR));
        let root_2 = error.sqrt();
        let root_8 = root_2.sqrt().sqrt();
        let [alpha_power, beta_power] = match self.exponents {
            ControlExponents::Order5 => {
                let root_32 = root_8.sqrt().sqrt();
                let root_64 = root_32.sqrt();
                let root_128 = root_64.sqrt();
                [(root_8 * (root_32 * root_64)).v(), (root_32 * root_128).v()]
            }
            ControlExponents::Order8 => [root_8, error.lit(1.0)],
        };
        let accepted_factor = SAFETY_FACTOR * self.error_memory / alpha_power;
        Proposals {
            step_if_accepted: (h * clamp_factor(accepted_factor, MAX_STEP_FACTOR)).v(),
            step_if_rejected: (h * clamp_factor(SAFETY_FACTOR / alpha_power, 1.0)).v(),
            error_memory_if_accepted: beta_power,
        }
    }

    /// Sets a lane's next step, after its step was accepted or rejected.
    #[inline(always)]
    pub(crate) fn update(&mut self, lane: usize, is_accepted: bool, proposals: &Proposals<T>) {
        let bit = 1 << lane;
        if is_accepted {
            let mut step = proposals.step_if_accepted.0.get(lane);
            if self.rejected_lanes & bit != 0 {
                step = step.min(self.step.0.get(lane));
            }
            self.step.0.set(lane, step);
            self.error_memory.0.set(lane, proposals.error_memory_if_accepted.0.get(lane));
            self.rejected_lanes &= !bit;
        } else {
            self.step.0.set(lane, proposals.step_if_rejected.0.get(lane));
            self.rejected_lanes |= bit;
        }
    }
}

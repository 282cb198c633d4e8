//! Error norm and step size control of adaptive methods, per lane.

use crate::{Lane, N};

/// Limits of an adaptive method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Relative error per component and step.
    pub relative: f64,
    /// Absolute error per component and step, in the component's unit.
    pub absolute: f64,
    /// Greatest number of steps of one segment, accepted and rejected ones together.
    pub max_steps: u64,
}

impl Tolerance {
    /// Returns the largest component of the error over its tolerance. A step is good below 1. The
    /// result is NaN if any component is not finite.
    #[inline(always)]
    pub(crate) fn norm<T: Lane, const D: usize>(
        &self,
        before: &[N<T>; D],
        after: &[N<T>; D],
        error: &[N<T>; D],
    ) -> N<T> {
        let zero = before[0].lit(0.0);
        let mut largest = zero;
        let mut poison = zero;
        for i in 0..D {
            let size = N(before[i].0.abs().larger(after[i].0.abs()));
            let ratio = error[i].abs() / (size * self.relative + self.absolute);
            largest = N(ratio.0.larger(largest.0));
            // Comparisons drop a NaN; a product with zero keeps it.
            poison += ratio * zero;
        }
        largest + poison
    }
}

/// Returns a formula's matrix from its rows. Zeros at the end of a row may be left out.
pub(crate) const fn padded<const ROWS: usize, const COLUMNS: usize>(
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

/// Proportional-integral step control (Hairer and Wanner II, section IV.2): h grows by
/// 0.9 err^-alpha err_before^beta, within 0.2 to 5.
///
/// The exponents are sums of powers of one half, so that square roots are enough: the same bits
/// everywhere.
pub(crate) struct StepControl<T> {
    /// The step to try next.
    pub(crate) step: N<T>,
    /// err^beta of the last accepted step.
    memory: N<T>,
    /// Lanes whose last attempt was rejected: their next step must not grow.
    was_rejected: u32,
}

/// The next step of each lane, for an accepted and for a rejected step.
pub(crate) struct Proposals<T> {
    accepted: N<T>,
    rejected: N<T>,
    memory: N<T>,
}

/// Returns a step's factor within the shrink limit and `greatest`.
#[inline(always)]
fn clamped<T: Lane>(factor: N<T>, greatest: f64) -> N<T> {
    let least = factor.lit(SHRINK_LIMIT);
    let greatest = factor.lit(greatest);
    let factor = factor.where_less(greatest, factor, greatest);
    least.where_less(factor, factor, least)
}

/// Factor of a step beside the one whose error would be the tolerance. Basis: `dopri5.f` (0.9).
/// Twice as much would have nearly every step rejected.
const SAFETY: f64 = 0.9;
/// Least factor from one step to the next. Basis: `dopri5.f` (0.2). Twice as much takes more
/// rejected steps where the motion suddenly becomes faster.
const SHRINK_LIMIT: f64 = 0.2;
/// Greatest factor from one step to the next. Basis: half of `dopri5.f`'s 10. Twice as much has
/// more steps rejected after the first one of a segment.
const GROWTH_LIMIT: f64 = 5.0;
/// Least error, in tolerances, that the next step is computed from. Basis: the factor of such an
/// error is far above [`GROWTH_LIMIT`], so twice as much changes no step.
const LEAST_ERROR: f64 = 1e-10;

impl<T: Lane> StepControl<T> {
    #[inline(always)]
    pub(crate) fn new(zero: N<T>) -> Self {
        Self { step: zero, memory: zero.lit(1.0), was_rejected: 0 }
    }

    /// Starts a segment. Nothing is kept of the lane's earlier trajectories, so that results do not
    /// depend on them.
    #[inline(always)]
    pub(crate) fn start(&mut self, lane: usize, first_step_s: f64) {
        self.step.0.set(lane, first_step_s);
        self.memory.0.set(lane, 1.0);
        self.was_rejected &= !(1 << lane);
    }

    /// Computes the next steps after error `error` over step `h`.
    #[inline(always)]
    pub(crate) fn proposals(&self, error: N<T>, h: N<T>) -> Proposals<T> {
        // NaN is far too large.
        let error = error.where_less(error.lit(1e30), error, error.lit(1e30));
        let error = error.lit(LEAST_ERROR).where_less(error, error, error.lit(LEAST_ERROR));
        let root_2 = error.sqrt();
        let root_8 = root_2.sqrt().sqrt();
        let root_32 = root_8.sqrt().sqrt();
        let root_64 = root_32.sqrt();
        let root_128 = root_64.sqrt();
        // alpha = 11/64 = 0.172, beta = 5/128 = 0.039 (dopri5.f: 0.17 and 0.04).
        let alpha = (root_8 * (root_32 * root_64)).v();
        let beta = (root_32 * root_128).v();
        Proposals {
            accepted: (h * clamped(SAFETY * self.memory / alpha, GROWTH_LIMIT)).v(),
            rejected: (h * clamped(SAFETY / alpha, 1.0)).v(),
            memory: beta,
        }
    }

    /// Sets a lane's next step, after a step that was accepted or not.
    #[inline(always)]
    pub(crate) fn update(&mut self, lane: usize, is_accepted: bool, next: &Proposals<T>) {
        let bit = 1 << lane;
        if is_accepted {
            let mut step = next.accepted.0.get(lane);
            if self.was_rejected & bit != 0 {
                step = step.min(self.step.0.get(lane));
            }
            self.step.0.set(lane, step);
            self.memory.0.set(lane, next.memory.0.get(lane));
            self.was_rejected &= !bit;
        } else {
            self.step.0.set(lane, next.rejected.0.get(lane));
            self.was_rejected |= bit;
        }
    }
}

//! Lanes: numbers of independent trajectories side by side in one register.

use crate::Real;

/// Greatest number of lanes of any instruction set. Basis: AVX-512 has eight. Doubling it would
/// serve registers of 1024 bits.
pub const MAX_LANES: usize = 8;

/// A [`Real`] whose lanes can be read and written one by one.
pub trait Lane: Real {
    /// The number of trajectories that one value carries.
    const LANES: usize;
    /// Returns the value of lane `i`.
    ///
    /// # Panics
    /// If `i >= LANES`.
    fn get(self, i: usize) -> f64;
    /// Writes lane `i`.
    ///
    /// # Panics
    /// If `i >= LANES`.
    fn set(&mut self, i: usize, value: f64);
    /// Rounds to the nearest integer, ties to even.
    #[must_use]
    fn round(self) -> Self;
    /// Packs the truth values of all lanes: bit `i` is that of lane `i`.
    fn bits(mask: Self::Mask) -> u32;
    /// Returns the larger of each pair of lanes; `b` where either is NaN.
    #[inline(always)]
    #[must_use]
    fn larger(self, b: Self) -> Self {
        Self::select(b.less(self), self, b)
    }
    /// Runs `computation`, which uses lanes of this type, as a separate function that is compiled
    /// once for all callers with the type's instructions.
    #[inline(always)]
    fn run_out_of_line<W: OutOfLine>(self, computation: W) -> W::Output {
        call_out_of_line(computation)
    }
}

/// A computation over lanes of one type that is compiled once, as a separate function instead of
/// inline in each caller. This suits long code that runs rarely, because the time to compile a
/// function grows faster than its length. [`Lane::run_out_of_line`] runs the computation over
/// several lanes, [`Simd::one_lane`](crate::Simd::one_lane) over a single one.
pub trait OutOfLine {
    /// The result of the computation.
    type Output;
    /// Runs the computation. Mark implementations `#[inline(always)]`, like those of
    /// [`Kernel::run`](crate::Kernel::run).
    fn run(self) -> Self::Output;
}

/// Runs `computation` compiled with the target's baseline instructions.
#[inline(never)]
pub(crate) fn call_out_of_line<W: OutOfLine>(computation: W) -> W::Output {
    computation.run()
}

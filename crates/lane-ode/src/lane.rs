//! Lanes: independent trajectories side by side in one number.

use crate::Real;

/// The most lanes that any instruction set has here.
pub const MAX_LANES: usize = 8;

/// A [`Real`] whose lanes can be reached one by one.
pub trait Lane: Real {
    /// How many trajectories one value carries.
    const LANES: usize;
    /// The value of lane `i`.
    ///
    /// # Panics
    /// If `i >= LANES`.
    fn get(self, i: usize) -> f64;
    /// Writes lane `i`.
    ///
    /// # Panics
    /// If `i >= LANES`.
    fn set(&mut self, i: usize, value: f64);
    /// To the nearest integer, ties to even.
    #[must_use]
    fn round(self) -> Self;
    /// Bit `i` is lane `i`'s truth value.
    fn bits(mask: Self::Mask) -> u32;
    /// The larger of each pair; `b` where either is NaN.
    #[inline(always)]
    #[must_use]
    fn larger(self, b: Self) -> Self {
        Self::select(b.less(self), self, b)
    }
    /// Runs work over lanes of this type as a function of its own, compiled with the type's
    /// instructions once for all callers.
    #[inline(always)]
    fn aside<W: Aside>(self, work: W) -> W::Output {
        out_of_line(work)
    }
}

/// Work over lanes of one type that is compiled once, as a function of its own, not wherever it is
/// called from: for what is long and runs seldom beside what surrounds it. [`Lane::aside`] runs it,
/// and [`Simd::one_lane`](crate::Simd::one_lane) what comes singly. The time that a function takes
/// to compile grows faster than its length.
pub trait Aside {
    /// What the work gives.
    type Output;
    /// Does the work. Mark it `#[inline(always)]` as [`Kernel::run`](crate::Kernel::run).
    fn run(self) -> Self::Output;
}

/// Work without any instruction set of its own.
#[inline(never)]
pub(crate) fn out_of_line<W: Aside>(work: W) -> W::Output {
    work.run()
}

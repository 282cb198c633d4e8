//! Lanes: independent trajectories side by side in one number.

use crate::real::Real;
use crate::simd::{Aside, Simd, out_of_line};
use crate::trig;

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
    /// Runs work over lanes of this type as a function of its own, compiled with the type's instructions once for all callers.
    #[inline(always)]
    fn aside<W: Aside>(self, work: W) {
        out_of_line(work);
    }
}

impl Real for f64 {
    type Mask = bool;
    #[inline(always)]
    fn lit(self, value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self + b
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self - b
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        self * b
    }
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        self / b
    }
    #[inline(always)]
    fn neg(self) -> Self {
        #[cfg(target_arch = "aarch64")]
        {
            crate::aarch64::negated(self)
        }
        #[cfg(not(target_arch = "aarch64"))]
        -self
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        f64::mul_add(self, b, c)
    }
    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        f64::mul_add(self, b, -c)
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        f64::mul_add(-self, b, c)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        trig::sin_cos(self)
    }
    #[inline(always)]
    fn less(self, b: Self) -> bool {
        self < b
    }
    #[inline(always)]
    fn select(mask: bool, a: Self, b: Self) -> Self {
        if mask { a } else { b }
    }
    #[inline(always)]
    fn all(mask: bool) -> bool {
        mask
    }
}

impl Lane for f64 {
    const LANES: usize = 1;
    #[inline(always)]
    fn get(self, i: usize) -> f64 {
        assert!(i == 0, "a scalar has one lane");
        self
    }
    #[inline(always)]
    fn set(&mut self, i: usize, value: f64) {
        assert!(i == 0, "a scalar has one lane");
        *self = value;
    }
    #[inline(always)]
    fn round(self) -> Self {
        self.round_ties_even()
    }
    #[inline(always)]
    fn bits(mask: bool) -> u32 {
        u32::from(mask)
    }
    #[inline(always)]
    fn aside<W: Aside>(self, work: W) {
        Simd::aside(work);
    }
}

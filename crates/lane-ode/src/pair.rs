//! Two registers as one.

use crate::lane::Lane;
use crate::real::Real;
use crate::simd::Aside;
use crate::trig;

/// Twice the lanes of `T`.
///
/// Where registers are narrow and many, as NEON's 32 of two lanes, one register a value leaves the processor waiting for
/// results: there is nothing else to do. The second register's operations depend on none of the first's.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair<T>(T, T);

impl<T: Copy> Pair<T> {
    /// The first value: both halves are `half`.
    #[inline(always)]
    pub(crate) fn first(half: T) -> Self {
        Self(half, half)
    }
}

impl<T: Lane> Real for Pair<T> {
    type Mask = (T::Mask, T::Mask);
    #[inline(always)]
    fn lit(self, value: f64) -> Self {
        Self(self.0.lit(value), self.1.lit(value))
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self(self.0.add(b.0), self.1.add(b.1))
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self(self.0.sub(b.0), self.1.sub(b.1))
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        Self(self.0.mul(b.0), self.1.mul(b.1))
    }
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        Self(self.0.div(b.0), self.1.div(b.1))
    }
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.neg(), self.1.neg())
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(self.0.mul_add(b.0, c.0), self.1.mul_add(b.1, c.1))
    }
    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        Self(self.0.mul_sub(b.0, c.0), self.1.mul_sub(b.1, c.1))
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        Self(self.0.neg_mul_add(b.0, c.0), self.1.neg_mul_add(b.1, c.1))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt(), self.1.sqrt())
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs(), self.1.abs())
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        trig::sin_cos(self)
    }
    #[inline(always)]
    fn less(self, b: Self) -> Self::Mask {
        (self.0.less(b.0), self.1.less(b.1))
    }
    #[inline(always)]
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self {
        Self(T::select(mask.0, a.0, b.0), T::select(mask.1, a.1, b.1))
    }
    #[inline(always)]
    fn all(mask: Self::Mask) -> bool {
        T::all(mask.0) & T::all(mask.1)
    }
}

impl<T: Lane> Lane for Pair<T> {
    const LANES: usize = 2 * T::LANES;
    #[inline(always)]
    fn get(self, i: usize) -> f64 {
        if i < T::LANES { self.0.get(i) } else { self.1.get(i - T::LANES) }
    }
    #[inline(always)]
    fn set(&mut self, i: usize, value: f64) {
        if i < T::LANES { self.0.set(i, value) } else { self.1.set(i - T::LANES, value) }
    }
    #[inline(always)]
    fn round(self) -> Self {
        Self(self.0.round(), self.1.round())
    }
    #[inline(always)]
    fn bits(mask: Self::Mask) -> u32 {
        T::bits(mask.0) | T::bits(mask.1) << T::LANES
    }
    #[inline(always)]
    fn aside<W: Aside>(self, work: W) {
        self.0.aside(work);
    }
}

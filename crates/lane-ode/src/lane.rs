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

/// Lanes in plain arrays, for processors without a type of their own here. On aarch64 the compiler turns them into
/// NEON, whose vectors and fused operations every such processor has.
#[derive(Clone, Copy, Debug)]
pub struct Array<const W: usize>(pub [f64; W]);

impl<const W: usize> Array<W> {
    #[inline(always)]
    fn zip(self, b: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self(core::array::from_fn(|i| f(self.0[i], b.0[i])))
    }
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Self(self.0.map(f))
    }
}

impl<const W: usize> Real for Array<W> {
    type Mask = [bool; W];
    #[inline(always)]
    fn lit(self, value: f64) -> Self {
        Self([value; W])
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self.zip(b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self.zip(b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        self.zip(b, |a, b| a * b)
    }
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        self.zip(b, |a, b| a / b)
    }
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(core::array::from_fn(|i| self.0[i].mul_add(b.0[i], c.0[i])))
    }
    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        self.mul_add(b, c.neg())
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        self.neg().mul_add(b, c)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(f64::sqrt)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.map(f64::abs)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        trig::sin_cos(self)
    }
    #[inline(always)]
    fn less(self, b: Self) -> [bool; W] {
        core::array::from_fn(|i| self.0[i] < b.0[i])
    }
    #[inline(always)]
    fn select(mask: [bool; W], a: Self, b: Self) -> Self {
        Self(core::array::from_fn(|i| if mask[i] { a.0[i] } else { b.0[i] }))
    }
    #[inline(always)]
    fn all(mask: [bool; W]) -> bool {
        mask.iter().all(|&m| m)
    }
}

impl<const W: usize> Lane for Array<W> {
    const LANES: usize = W;
    #[inline(always)]
    fn get(self, i: usize) -> f64 {
        self.0[i]
    }
    #[inline(always)]
    fn set(&mut self, i: usize, value: f64) {
        self.0[i] = value;
    }
    #[inline(always)]
    fn round(self) -> Self {
        self.map(f64::round_ties_even)
    }
    #[inline(always)]
    fn bits(mask: [bool; W]) -> u32 {
        mask.iter().enumerate().fold(0, |bits, (i, &m)| bits | u32::from(m) << i)
    }
}

//! Forward automatic differentiation: the same source, with one derivative carried along.

use crate::lane::{Aside, Lane};
use crate::num::N;
use crate::real::Real;

/// A value and its derivative along one direction. Nest it for second derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Dual<T> {
    /// The value.
    pub value: T,
    /// Its derivative.
    pub slope: T,
}

impl<T: Real> Dual<T> {
    /// A constant.
    #[inline(always)]
    #[must_use]
    pub fn constant(value: T) -> Self {
        Self { value, slope: value.lit(0.0) }
    }
}

impl<T: Real> N<T> {
    /// This value as a constant of a dual number.
    #[inline(always)]
    #[must_use]
    pub fn constant(self) -> N<Dual<T>> {
        N(Dual::constant(self.0))
    }
}

impl<T: Real> Real for Dual<T> {
    type Mask = T::Mask;
    #[inline(always)]
    fn lit(self, value: f64) -> Self {
        Self::constant(self.value.lit(value))
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self { value: self.value.add(b.value), slope: self.slope.add(b.slope) }
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self { value: self.value.sub(b.value), slope: self.slope.sub(b.slope) }
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        Self {
            value: self.value.mul(b.value),
            slope: self.slope.mul_add(b.value, self.value.mul(b.slope)),
        }
    }
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        let value = self.value.div(b.value);
        Self { value, slope: value.neg_mul_add(b.slope, self.slope).div(b.value) }
    }
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: self.value.neg(), slope: self.slope.neg() }
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self {
            value: self.value.mul_add(b.value, c.value),
            slope: self.slope.mul_add(b.value, self.value.mul_add(b.slope, c.slope)),
        }
    }
    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        Self {
            value: self.value.mul_sub(b.value, c.value),
            slope: self.slope.mul_add(b.value, self.value.mul_sub(b.slope, c.slope)),
        }
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        Self {
            value: self.value.neg_mul_add(b.value, c.value),
            slope: self.slope.neg_mul_add(b.value, self.value.neg_mul_add(b.slope, c.slope)),
        }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let value = self.value.sqrt();
        Self { value, slope: self.slope.div(value.add(value)) }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self::select(self.less(self.lit(0.0)), self.neg(), self)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (
            Self { value: sin, slope: cos.mul(self.slope) },
            Self { value: cos, slope: sin.neg().mul(self.slope) },
        )
    }
    #[inline(always)]
    fn less(self, b: Self) -> Self::Mask {
        self.value.less(b.value)
    }
    #[inline(always)]
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self {
        Self { value: T::select(mask, a.value, b.value), slope: T::select(mask, a.slope, b.slope) }
    }
    #[inline(always)]
    fn all(mask: Self::Mask) -> bool {
        T::all(mask)
    }
}

/// Lanes of dual numbers: whole systems run on them, so that each lane can carry a derivative along
/// a direction of its own.
impl<T: Lane> Lane for Dual<T> {
    const LANES: usize = T::LANES;
    #[inline(always)]
    fn get(self, i: usize) -> f64 {
        self.value.get(i)
    }
    /// Writes a constant.
    #[inline(always)]
    fn set(&mut self, i: usize, value: f64) {
        self.value.set(i, value);
        self.slope.set(i, 0.0);
    }
    /// A step function: its derivative is zero wherever it has one.
    #[inline(always)]
    fn round(self) -> Self {
        Self::constant(self.value.round())
    }
    #[inline(always)]
    fn bits(mask: Self::Mask) -> u32 {
        T::bits(mask)
    }
    #[inline(always)]
    fn aside<W: Aside>(self, work: W) -> W::Output {
        self.value.aside(work)
    }
}

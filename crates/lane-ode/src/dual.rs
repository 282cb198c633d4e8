//! Forward automatic differentiation by dual numbers: values with one derivative.

use crate::real::operations;
use crate::{Lane, N, OutOfLine, Real};

/// A value and its derivative along one direction. Nested dual numbers have second derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Dual<T> {
    /// The value.
    pub value: T,
    /// The derivative of the value.
    pub slope: T,
}

impl<T: Real> Dual<T> {
    /// Returns a constant.
    #[inline(always)]
    pub fn constant(value: T) -> Self {
        Self { value, slope: value.lit(0.0) }
    }
}

impl<T: Real> N<T> {
    /// Returns this value as a dual number with a slope of zero.
    #[inline(always)]
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
    operations! {
        add |a, b| Self { value: a.value.add(b.value), slope: a.slope.add(b.slope) },
        sub |a, b| Self { value: a.value.sub(b.value), slope: a.slope.sub(b.slope) },
        mul |a, b| Self {
            value: a.value.mul(b.value),
            slope: a.slope.mul_add(b.value, a.value.mul(b.slope)),
        },
        div |a, b| {
            let value = a.value.div(b.value);
            Self { value, slope: value.neg_mul_add(b.slope, a.slope).div(b.value) }
        },
        neg |a| Self { value: a.value.neg(), slope: a.slope.neg() },
        mul_add |a, b, c| Self {
            value: a.value.mul_add(b.value, c.value),
            slope: a.slope.mul_add(b.value, a.value.mul_add(b.slope, c.slope)),
        },
        mul_sub |a, b, c| Self {
            value: a.value.mul_sub(b.value, c.value),
            slope: a.slope.mul_add(b.value, a.value.mul_sub(b.slope, c.slope)),
        },
        neg_mul_add |a, b, c| Self {
            value: a.value.neg_mul_add(b.value, c.value),
            slope: a.slope.neg_mul_add(b.value, a.value.neg_mul_add(b.slope, c.slope)),
        },
        sqrt |a| {
            let value = a.value.sqrt();
            Self { value, slope: a.slope.div(value.add(value)) }
        },
        abs |a| Self::select(a.less(a.lit(0.0)), a.neg(), a),
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

/// Lanes of dual numbers, over which whole systems can be evaluated. Each lane has its own
/// direction of differentiation.
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
    /// Rounds to an integer. The derivative of this step function is zero.
    #[inline(always)]
    fn round(self) -> Self {
        Self::constant(self.value.round())
    }
    #[inline(always)]
    fn bits(mask: Self::Mask) -> u32 {
        T::bits(mask)
    }
    #[inline(always)]
    fn run_out_of_line<W: OutOfLine>(self, computation: W) -> W::Output {
        self.value.run_out_of_line(computation)
    }
}

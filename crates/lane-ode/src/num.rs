//! Operators that fuse by their types: a product is rounded together with the sum that it is part
//! of.
//!
//! `a * b` is a [`Product`] that is not rounded yet; an addition or subtraction fuses with it. So
//! `m * v + k * (x - y)` compiles to one multiplication and one fused multiply-add, in the order
//! that the types determine, on every instruction set. The rules, for a sum of two products, are
//! `a*b + c*d = fma(a, b, c*d)`.

use crate::Real;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A value with operators.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct N<T>(pub T);

/// A product that is not rounded yet.
#[derive(Clone, Copy, Debug)]
pub struct Product<T>(T, T);

impl<T: Real> Product<T> {
    /// Rounds the product to a value.
    #[inline(always)]
    pub fn v(self) -> N<T> {
        N(self.0.mul(self.1))
    }
}

impl<T: Real> From<Product<T>> for N<T> {
    #[inline(always)]
    fn from(p: Product<T>) -> Self {
        p.v()
    }
}

impl<T: Real> N<T> {
    /// Returns a number of this type with the constant `value` in every lane.
    #[inline(always)]
    #[must_use]
    pub fn lit(self, value: f64) -> Self {
        Self(self.0.lit(value))
    }
    /// Returns the square root.
    #[inline(always)]
    #[must_use]
    pub fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    /// Returns the magnitude.
    #[inline(always)]
    #[must_use]
    pub fn abs(self) -> Self {
        Self(self.0.abs())
    }
    /// Returns `1 / self`.
    #[inline(always)]
    #[must_use]
    pub fn recip(self) -> Self {
        Self(self.0.lit(1.0).div(self.0))
    }
    /// Returns `self * self`, not rounded yet.
    #[inline(always)]
    pub fn squared(self) -> Product<T> {
        Product(self.0, self.0)
    }
    /// Returns sine and cosine.
    #[inline(always)]
    pub fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.0.sin_cos();
        (Self(sin), Self(cos))
    }
    /// Returns `a` in lanes where `self < bound`, else `b`.
    #[inline(always)]
    #[must_use]
    pub fn where_less(self, bound: Self, a: Self, b: Self) -> Self {
        Self(T::select(self.0.less(bound.0), a.0, b.0))
    }
}

/// Implements a binary operator for two operands, each a value, a product or a plain constant.
macro_rules! binary {
    ($Op:ident :: $op:ident, $L:ty, $R:ty => $Out:ty, |$a:ident, $b:ident| $body:expr) => {
        impl<T: Real> $Op<$R> for $L {
            type Output = $Out;
            #[inline(always)]
            fn $op(self, rhs: $R) -> $Out {
                let ($a, $b) = (self, rhs);
                $body
            }
        }
    };
}

binary!(Add::add, N<T>, N<T> => N<T>, |a, b| N(a.0.add(b.0)));
binary!(Sub::sub, N<T>, N<T> => N<T>, |a, b| N(a.0.sub(b.0)));
binary!(Mul::mul, N<T>, N<T> => Product<T>, |a, b| Product(a.0, b.0));
binary!(Div::div, N<T>, N<T> => N<T>, |a, b| N(a.0.div(b.0)));

binary!(Add::add, Product<T>, N<T> => N<T>, |a, b| N(a.0.mul_add(a.1, b.0)));
binary!(Add::add, N<T>, Product<T> => N<T>, |a, b| N(b.0.mul_add(b.1, a.0)));
binary!(Sub::sub, Product<T>, N<T> => N<T>, |a, b| N(a.0.mul_sub(a.1, b.0)));
binary!(Sub::sub, N<T>, Product<T> => N<T>, |a, b| N(b.0.neg_mul_add(b.1, a.0)));
binary!(Add::add, Product<T>, Product<T> => N<T>, |a, b| a + b.v());
binary!(Sub::sub, Product<T>, Product<T> => N<T>, |a, b| a - b.v());
binary!(Mul::mul, Product<T>, N<T> => Product<T>, |a, b| Product(a.v().0, b.0));
binary!(Mul::mul, N<T>, Product<T> => Product<T>, |a, b| Product(a.0, b.v().0));
binary!(Mul::mul, Product<T>, Product<T> => Product<T>, |a, b| Product(a.v().0, b.v().0));
binary!(Div::div, Product<T>, N<T> => N<T>, |a, b| a.v() / b);
binary!(Div::div, N<T>, Product<T> => N<T>, |a, b| a / b.v());

binary!(Add::add, N<T>, f64 => N<T>, |a, b| a + a.lit(b));
binary!(Sub::sub, N<T>, f64 => N<T>, |a, b| a - a.lit(b));
binary!(Mul::mul, N<T>, f64 => Product<T>, |a, b| a * a.lit(b));
binary!(Add::add, Product<T>, f64 => N<T>, |a, b| a + N(a.0.lit(b)));
binary!(Sub::sub, Product<T>, f64 => N<T>, |a, b| a - N(a.0.lit(b)));
binary!(Add::add, f64, N<T> => N<T>, |a, b| b.lit(a) + b);
binary!(Sub::sub, f64, N<T> => N<T>, |a, b| b.lit(a) - b);
binary!(Mul::mul, f64, N<T> => Product<T>, |a, b| b.lit(a) * b);
binary!(Div::div, f64, N<T> => N<T>, |a, b| b.lit(a) / b);
binary!(Sub::sub, f64, Product<T> => N<T>, |a, b| N(b.0.lit(a)) - b);
binary!(Add::add, f64, Product<T> => N<T>, |a, b| N(b.0.lit(a)) + b);

impl<T: Real> Neg for N<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.neg())
    }
}
impl<T: Real> Neg for Product<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.neg(), self.1)
    }
}

/// Implements a compound assignment operator.
macro_rules! assign {
    ($Op:ident :: $op:ident, $R:ty, $sign:tt) => {
        impl<T: Real> $Op<$R> for N<T> {
            #[inline(always)]
            fn $op(&mut self, rhs: $R) {
                *self = *self $sign rhs;
            }
        }
    };
}

assign!(AddAssign::add_assign, Self, +);
assign!(AddAssign::add_assign, Product<T>, +);
assign!(SubAssign::sub_assign, Self, -);
assign!(SubAssign::sub_assign, Product<T>, -);

//! The operations that equations need of a number.

/// A real number, several of them side by side, or one with derivatives. Equations written over
/// this trait can be evaluated for all of these.
///
/// Every operation is correctly rounded (IEEE 754), or a fixed sequence of such operations, so that
/// the same source gives the same bits for every type of lane. [`Real::lit`] needs an existing
/// value to make a constant, because the first value of a vector type proves that the processor has
/// the type's instructions.
pub trait Real: Copy {
    /// A truth value per lane.
    type Mask: Copy;

    /// Returns the constant `value` in every lane.
    #[must_use]
    fn lit(self, value: f64) -> Self;
    /// Returns `self + b`.
    #[must_use]
    fn add(self, b: Self) -> Self;
    /// Returns `self - b`.
    #[must_use]
    fn sub(self, b: Self) -> Self;
    /// Returns `self * b`.
    #[must_use]
    fn mul(self, b: Self) -> Self;
    /// Returns `self / b`.
    #[must_use]
    fn div(self, b: Self) -> Self;
    /// Returns `-self`.
    #[must_use]
    fn neg(self) -> Self;
    /// Returns `self * b + c`, rounded once.
    #[must_use]
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// Returns `self * b - c`, rounded once.
    #[must_use]
    fn mul_sub(self, b: Self, c: Self) -> Self;
    /// Returns `c - self * b`, rounded once.
    #[must_use]
    fn neg_mul_add(self, b: Self, c: Self) -> Self;
    /// Returns the square root.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Returns the magnitude.
    #[must_use]
    fn abs(self) -> Self;
    /// Returns sine and cosine of an angle in radians.
    fn sin_cos(self) -> (Self, Self);
    /// Compares: true where `self < b`, false where either is NaN.
    fn less(self, b: Self) -> Self::Mask;
    /// Returns `a` in lanes where the mask is true, else `b`.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;
    /// Whether the mask is true in every lane.
    fn all(mask: Self::Mask) -> bool;
}

/// Operations of a [`Real`] as a table: name, operands, result.
macro_rules! operations {
    ($($op:ident |$own:ident $(, $other:ident)*| $result:expr,)+) => {
        $(
            #[inline(always)]
            fn $op(self $(, $other: Self)*) -> Self {
                let $own = self;
                $result
            }
        )+
    };
}
pub(crate) use operations;

//! `f64` as one lane.

use crate::real::operations;
use crate::{Lane, OutOfLine, Real, Simd, trig};

impl Real for f64 {
    type Mask = bool;
    #[inline(always)]
    fn lit(self, value: f64) -> Self {
        value
    }
    operations! {
        add |a, b| a + b,
        sub |a, b| a - b,
        mul |a, b| a * b,
        div |a, b| a / b,
        neg |a| negated(a),
        mul_add |a, b, c| fused(a, b, c),
        mul_sub |a, b, c| fused(a, b, -c),
        neg_mul_add |a, b, c| fused(-a, b, c),
        sqrt |a| f64::sqrt(a),
        abs |a| f64::abs(a),
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
    fn run_out_of_line<W: OutOfLine>(self, computation: W) -> W::Output {
        Simd::one_lane(computation)
    }
}

#[cfg(target_arch = "aarch64")]
use crate::aarch64::negated;

#[cfg(not(target_arch = "aarch64"))]
#[inline(always)]
fn negated(x: f64) -> f64 {
    -x
}

/// Returns `a * b + c`, rounded once; rounded twice on WebAssembly, whose vector lanes round twice
/// too.
#[inline(always)]
fn fused(a: f64, b: f64, c: f64) -> f64 {
    if cfg!(target_arch = "wasm32") { a * b + c } else { f64::mul_add(a, b, c) }
}

//! Sine and cosine over lanes, from fused operations alone, so that every instruction set gives the
//! same bits.
//!
//! Within a quarter turn the polynomials are those of fdlibm's `k_sin.c` and `k_cos.c` (Sun
//! Microsystems, 1993), without their correction of a rounding error of the cosine. Errors measured
//! against arbitrary precision (`tests/trig.rs`): up to 1.2 ulp within pi/4, 1.5 ulp up to 1e6 rad,
//! 1.6 ulp of angles in turns.

use crate::{Lane, N, Real};
use core::f64::consts::FRAC_PI_4;

/// Coefficients S1 to S6 of fdlibm's `k_sin.c`.
const SIN_COEFFICIENTS: [f64; 6] = [
    -1.666_666_666_666_663_243_48e-1,
    8.333_333_333_322_489_461_24e-3,
    -1.984_126_982_985_794_931_34e-4,
    2.755_731_370_707_006_767_89e-6,
    -2.505_076_025_340_686_341_95e-8,
    1.589_690_995_211_550_102_21e-10,
];
/// Coefficients C1 to C6 of fdlibm's `k_cos.c`.
const COS_COEFFICIENTS: [f64; 6] = [
    4.166_666_666_666_660_190_37e-2,
    -1.388_888_888_887_410_957_49e-3,
    2.480_158_728_947_672_941_78e-5,
    -2.755_731_435_139_066_330_35e-7,
    2.087_572_321_298_174_827_9e-9,
    -1.135_964_755_778_819_482_65e-11,
];

/// pi/2 as a sum of three doubles.
const HALF_PI_PARTS: [f64; 3] =
    [core::f64::consts::FRAC_PI_2, 6.123_233_995_736_766e-17, -1.497_384_904_859_169_8e-33];

/// Computes sine and cosine for |x| up to pi/4.
#[inline(always)]
fn sin_cos_within_quarter<T: Real>(x: N<T>) -> (N<T>, N<T>) {
    let z = x.squared().v();
    let sin = (x * z) * polynomial(&SIN_COEFFICIENTS, z) + x;
    let cos = z.squared() * polynomial(&COS_COEFFICIENTS, z) + (1.0 - z * 0.5);
    (sin, cos)
}

/// Evaluates c0 + c1 z + ... by Horner's rule.
#[inline(always)]
fn polynomial<T: Real>(c: &[f64; 6], z: N<T>) -> N<T> {
    let mut sum = z.lit(c[5]);
    for i in (0..5).rev() {
        sum = sum * z + c[i];
    }
    sum
}

/// Rotates sine and cosine of an angle in quadrant 0 by `quadrant` (an integer) quarter turns.
#[inline(always)]
fn rotate_by_quarter_turns<T: Lane>(quadrant: N<T>, sin: N<T>, cos: N<T>) -> (N<T>, N<T>) {
    // The quadrant as a fraction of a turn: 0, 0.25, 0.5 or 0.75. A multiple of 1/4 minus 3/8
    // rounds to the floor of the multiple.
    let quarter_turns = (quadrant * 0.25).v();
    let fraction = quarter_turns - N((quarter_turns - 0.375).0.round());
    (
        select_by_quadrant(fraction, [sin, cos, -sin, -cos]),
        select_by_quadrant(fraction, [cos, -sin, -cos, sin]),
    )
}

/// Selects the value of the quadrant that `fraction` (0, 0.25, 0.5 or 0.75 of a turn) stands for.
#[inline(always)]
fn select_by_quadrant<T: Real>(fraction: N<T>, values: [N<T>; 4]) -> N<T> {
    let upper_value = fraction.where_less(fraction.lit(0.625), values[2], values[3]);
    let lower_value = fraction.where_less(fraction.lit(0.125), values[0], values[1]);
    fraction.where_less(fraction.lit(0.375), lower_value, upper_value)
}

/// Computes sine and cosine of any angle up to about 1e6 rad.
#[inline(always)]
pub(crate) fn sin_cos<T: Lane>(x: T) -> (T, T) {
    if T::all(x.abs().less(x.lit(FRAC_PI_4))) {
        let (sin, cos) = sin_cos_within_quarter(N(x));
        return (sin.0, cos.0);
    }
    sin_cos_by_lanes(x)
}

/// Computes sine and cosine lane by lane, out of line, so that the common path stays short. The
/// result has the same bits as on the common path for an angle up to pi/4, so that a lane does not
/// depend on the other lanes.
#[cold]
#[inline(never)]
fn sin_cos_by_lanes<T: Lane>(x: T) -> (T, T) {
    let mut sin = x;
    let mut cos = x;
    for i in 0..T::LANES {
        let x = N(x.get(i));
        let quadrant = N((x * core::f64::consts::FRAC_2_PI).v().0.round());
        // The first difference is exact: both terms are multiples of 2^-53 and it is below 1.
        let reduced_angle = ((x - quadrant * HALF_PI_PARTS[0]) - quadrant * HALF_PI_PARTS[1])
            - quadrant * HALF_PI_PARTS[2];
        let (s, c) = sin_cos_within_quarter(reduced_angle);
        let (s, c) = rotate_by_quarter_turns(quadrant, s, c);
        sin.set(i, s.0);
        cos.set(i, c.0);
    }
    (sin, cos)
}

/// Computes sine and cosine of an angle in turns, whose integer part is removed without rounding.
#[inline(always)]
pub fn sin_cos_turns<T: Lane>(turns: N<T>) -> (N<T>, N<T>) {
    let fraction = turns - N(turns.0.round());
    let quadrant = N((fraction * 4.0).v().0.round());
    let remainder = fraction - quadrant * 0.25;
    let (sin, cos) = sin_cos_within_quarter((remainder * core::f64::consts::TAU).v());
    rotate_by_quarter_turns(quadrant, sin, cos)
}

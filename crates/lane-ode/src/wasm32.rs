//! Lanes of WebAssembly's vectors (simd128): intrinsics behind a newtype.
//!
//! WebAssembly has no fused multiply-add, and one in software is far slower than a multiplication
//! and an addition. So the fused operations round twice here, and in one lane of this target too:
//! results are not the bits of other instruction sets. Amplitudes at reliable points of the paper's
//! map differ by less than 1e-9 of themselves (`tests/browser/check_live.py`). They are the same
//! bits in every browser, because each operation is correctly rounded.
//!
//! An engine validates a module before it runs, so a value of this type exists only where the
//! instructions do, which makes the `unsafe` below sound.
#![allow(unsafe_code)]
// On this target the intrinsics are safe to call, which the lint would report.
#![allow(unused_unsafe)]

use crate::vector::vector;
use core::arch::wasm32::*;

vector!(
    F64x2, v128, 2, v128, "simd128", "Two lanes of simd128.",
    set1 f64x2_splat,
    operations {
        add |a, b| f64x2_add(a, b),
        sub |a, b| f64x2_sub(a, b),
        mul |a, b| f64x2_mul(a, b),
        div |a, b| f64x2_div(a, b),
        sqrt |a| f64x2_sqrt(a),
        mul_add |a, b, c| f64x2_add(f64x2_mul(a, b), c),
        mul_sub |a, b, c| f64x2_sub(f64x2_mul(a, b), c),
        neg_mul_add |a, b, c| f64x2_sub(c, f64x2_mul(a, b)),
        neg |a| f64x2_neg(a),
        abs |a| f64x2_abs(a),
    }
    round |a| f64x2_nearest(a),
    less |a, b| f64x2_lt(a, b),
    select |m, a, b| v128_bitselect(a, b, m),
    // SAFETY: as in `lit`.
    bits |m| u32::from(unsafe { i64x2_bitmask(m) })
);

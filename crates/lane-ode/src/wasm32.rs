//! Lanes of WebAssembly's vectors (simd128): intrinsics behind a newtype.
//!
//! WebAssembly has no fused multiply-add, and an emulation in software is far slower than a
//! multiplication and an addition. So the fused operations round twice on this target, in one lane
//! as well as in two: results differ from those of other instruction sets in the last bits.
//! Relative differences of amplitudes at reliable points of the paper's map are below 1e-9
//! (`tests/browser/check_live.py`). Every browser gives the same bits, because each operation is
//! correctly rounded.
//!
//! An engine validates a module before it runs, so a value of this type exists only in engines with
//! the instructions, which makes the `unsafe` below sound.
#![allow(unsafe_code)]
// The intrinsics are safe to call on this target, so that the lint would report the `unsafe` blocks
// of the macro.
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

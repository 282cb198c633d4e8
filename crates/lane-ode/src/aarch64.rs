//! NEON lanes: intrinsics behind a newtype.
//!
//! Every processor of this target has NEON. Like on other architectures, only the entry function
//! makes the first value of this type, which makes the `unsafe` below sound.
//!
//! A value takes one register. With two registers per value, the right-hand sides would need more
//! than the 32 registers, and a lane's step a sixth more instructions (results/benchmarks/arm.md).
#![allow(unsafe_code)]

use crate::vector::vector;
use core::arch::aarch64::*;
use core::arch::asm;

vector!(
    F64x2, float64x2_t, 2, uint64x2_t, "neon", "Two lanes of NEON.",
    set1 vdupq_n_f64,
    operations {
        add |a, b| vaddq_f64(a, b),
        sub |a, b| vsubq_f64(a, b),
        mul |a, b| vmulq_f64(a, b),
        div |a, b| vdivq_f64(a, b),
        sqrt |a| vsqrtq_f64(a),
        mul_add |a, b, c| vfmaq_f64(c, a, b),
        // NEON has no instruction for a b - c, and -(c - a b) is -0 where the other instruction
        // sets give 0.
        mul_sub |a, b, c| vfmaq_f64(vnegq_f64(c), a, b),
        neg_mul_add |a, b, c| vfmsq_f64(c, a, b),
        neg |a| vnegq_f64(a),
        abs |a| vabsq_f64(a),
    }
    round |a| vrndnq_f64(a),
    less |a, b| vcltq_f64(a, b),
    select |m, a, b| vbslq_f64(m, a, b),
    bits |m| {
        // SAFETY: as in `lit`.
        let [first, second] = unsafe { [vgetq_lane_u64::<0>(m), vgetq_lane_u64::<1>(m)] };
        (first & 1 | second & 2) as u32
    }
);

/// Returns `-x`, computed by a separate instruction.
///
/// LLVM 22 turns the negative of a fused a b + c into one `fnmadd`, which is -a b - c. Where the
/// terms cancel, that gives 0 and not -0. NEON's vectors have no such instruction.
#[inline(always)]
pub(crate) fn negated(x: f64) -> f64 {
    let negative;
    // SAFETY: one instruction from register to register.
    unsafe {
        asm!("fneg {:d}, {:d}", lateout(vreg) negative, in(vreg) x,
            options(pure, nomem, nostack, preserves_flags));
    }
    negative
}

//! AVX2 and AVX-512 lanes: intrinsics behind newtypes.
//!
//! Every function of this module is inlined into the entry function of its instruction set
//! (`simd::dispatch`). Only that function makes a first value of its type (`splat`), after a check
//! of the processor. So a value of these types exists only on processors with the instructions,
//! which makes the `unsafe` below sound.
#![allow(unsafe_code)]

use crate::vector::vector;
use core::arch::x86_64::*;

vector!(
    F64x4, __m256d, 4, __m256d, "avx2,fma", "Four lanes of AVX2 with FMA.",
    set1 _mm256_set1_pd,
    operations {
        add |a, b| _mm256_add_pd(a, b),
        sub |a, b| _mm256_sub_pd(a, b),
        mul |a, b| _mm256_mul_pd(a, b),
        div |a, b| _mm256_div_pd(a, b),
        sqrt |a| _mm256_sqrt_pd(a),
        mul_add |a, b, c| _mm256_fmadd_pd(a, b, c),
        mul_sub |a, b, c| _mm256_fmsub_pd(a, b, c),
        neg_mul_add |a, b, c| _mm256_fnmadd_pd(a, b, c),
        neg |a| _mm256_xor_pd(a, _mm256_set1_pd(-0.0)),
        abs |a| _mm256_andnot_pd(_mm256_set1_pd(-0.0), a),
    }
    round |a| _mm256_round_pd::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(a),
    less |a, b| _mm256_cmp_pd::<_CMP_LT_OQ>(a, b),
    select |m, a, b| _mm256_blendv_pd(b, a, m),
    bits |m| {
        // SAFETY: as in `lit`.
        unsafe { _mm256_movemask_pd(m) }.cast_unsigned()
    }
);

vector!(
    F64x8, __m512d, 8, __mmask8, "avx2,fma,avx512f,avx512dq,avx512vl", "Eight lanes of AVX-512.",
    set1 _mm512_set1_pd,
    operations {
        add |a, b| _mm512_add_pd(a, b),
        sub |a, b| _mm512_sub_pd(a, b),
        mul |a, b| _mm512_mul_pd(a, b),
        div |a, b| _mm512_div_pd(a, b),
        sqrt |a| _mm512_sqrt_pd(a),
        mul_add |a, b, c| _mm512_fmadd_pd(a, b, c),
        mul_sub |a, b, c| _mm512_fmsub_pd(a, b, c),
        neg_mul_add |a, b, c| _mm512_fnmadd_pd(a, b, c),
        neg |a| _mm512_castsi512_pd(_mm512_xor_si512(
            _mm512_castpd_si512(a),
            _mm512_castpd_si512(_mm512_set1_pd(-0.0)))),
        abs |a| _mm512_abs_pd(a),
    }
    round |a| _mm512_roundscale_pd::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(a),
    less |a, b| _mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b),
    select |m, a, b| _mm512_mask_blend_pd(m, b, a),
    bits |m| u32::from(m)
);

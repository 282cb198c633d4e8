//! AVX2 and AVX-512 lanes: intrinsics behind newtypes.
//!
//! Every function here is inlined into the entry function of its instruction set (`simd::dispatch`), which is the
//! only place that makes a first value, after it has asked the processor. That is why the `unsafe` below is sound:
//! a value of these types exists only where the instructions do.
#![allow(unsafe_code)]

use crate::lane::Lane;
use crate::real::Real;
use crate::simd::Aside;
use crate::trig;
use core::arch::x86_64::*;

macro_rules! vector {
    ($name:ident, $raw:ty, $lanes:literal, $mask:ty, $features:literal, $doc:literal,
     set1 $set1:ident, add $add:ident, sub $sub:ident, mul $mul:ident, div $div:ident, sqrt $sqrt:ident,
     fmadd $fmadd:ident, fmsub $fmsub:ident, fnmadd $fnmadd:ident,
     neg |$n:ident| $neg:expr, abs |$ab:ident| $abs:expr, round |$r:ident| $round:expr,
     less |$l1:ident, $l2:ident| $less:expr, select |$m:ident, $s1:ident, $s2:ident| $select:expr,
     bits |$b:ident| $bits:expr) => {
        #[doc = $doc]
        #[derive(Clone, Copy, Debug)]
        #[repr(transparent)]
        pub(crate) struct $name($raw);

        impl $name {
            /// The constant `value` in every lane.
            ///
            /// # Safety
            /// The processor must have this type's instruction set.
            #[inline(always)]
            pub(crate) unsafe fn first(value: f64) -> Self {
                // SAFETY: the caller's promise.
                Self(unsafe { $set1(value) })
            }
        }

        impl Real for $name {
            type Mask = $mask;
            #[inline(always)]
            fn lit(self, value: f64) -> Self {
                // SAFETY: `self` exists, so its instruction set does (module docs); likewise below.
                Self(unsafe { $set1(value) })
            }
            #[inline(always)]
            fn add(self, b: Self) -> Self {
                // SAFETY: as in `lit`.
                Self(unsafe { $add(self.0, b.0) })
            }
            #[inline(always)]
            fn sub(self, b: Self) -> Self {
                // SAFETY: as in `lit`.
                Self(unsafe { $sub(self.0, b.0) })
            }
            #[inline(always)]
            fn mul(self, b: Self) -> Self {
                // SAFETY: as in `lit`.
                Self(unsafe { $mul(self.0, b.0) })
            }
            #[inline(always)]
            fn div(self, b: Self) -> Self {
                // SAFETY: as in `lit`.
                Self(unsafe { $div(self.0, b.0) })
            }
            #[inline(always)]
            fn neg(self) -> Self {
                let $n = self.0;
                // SAFETY: as in `lit`.
                Self(unsafe { $neg })
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                // SAFETY: as in `lit`.
                Self(unsafe { $fmadd(self.0, b.0, c.0) })
            }
            #[inline(always)]
            fn mul_sub(self, b: Self, c: Self) -> Self {
                // SAFETY: as in `lit`.
                Self(unsafe { $fmsub(self.0, b.0, c.0) })
            }
            #[inline(always)]
            fn neg_mul_add(self, b: Self, c: Self) -> Self {
                // SAFETY: as in `lit`.
                Self(unsafe { $fnmadd(self.0, b.0, c.0) })
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                // SAFETY: as in `lit`.
                Self(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn abs(self) -> Self {
                let $ab = self.0;
                // SAFETY: as in `lit`.
                Self(unsafe { $abs })
            }
            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                trig::sin_cos(self)
            }
            #[inline(always)]
            fn less(self, b: Self) -> $mask {
                let ($l1, $l2) = (self.0, b.0);
                // SAFETY: as in `lit`.
                unsafe { $less }
            }
            #[inline(always)]
            fn select($m: $mask, a: Self, b: Self) -> Self {
                let ($s1, $s2) = (a.0, b.0);
                // SAFETY: as in `lit`.
                Self(unsafe { $select })
            }
            #[inline(always)]
            fn all(mask: $mask) -> bool {
                Self::bits(mask) == (1 << $lanes) - 1
            }
        }

        impl Lane for $name {
            const LANES: usize = $lanes;
            #[inline(always)]
            fn get(self, i: usize) -> f64 {
                // SAFETY: the two types have the same size and no invalid bit patterns.
                let lanes = unsafe { core::mem::transmute::<$raw, [f64; $lanes]>(self.0) };
                lanes[i]
            }
            #[inline(always)]
            fn set(&mut self, i: usize, value: f64) {
                // SAFETY: as in `get`.
                let lanes = unsafe { &mut *(&raw mut self.0).cast::<[f64; $lanes]>() };
                lanes[i] = value;
            }
            #[inline(always)]
            fn round(self) -> Self {
                let $r = self.0;
                // SAFETY: as in `lit`.
                Self(unsafe { $round })
            }
            #[inline(always)]
            fn bits($b: $mask) -> u32 {
                $bits
            }
            #[inline(always)]
            fn aside<W: Aside>(self, work: W) {
                #[inline(never)]
                #[target_feature(enable = $features)]
                fn inner<W: Aside>(work: W) {
                    work.run();
                }
                // SAFETY: as in `lit`.
                unsafe { inner(work) }
            }
        }
    };
}

vector!(
    F64x4, __m256d, 4, __m256d, "avx2,fma", "Four lanes of AVX2 with FMA.",
    set1 _mm256_set1_pd, add _mm256_add_pd, sub _mm256_sub_pd, mul _mm256_mul_pd, div _mm256_div_pd,
    sqrt _mm256_sqrt_pd, fmadd _mm256_fmadd_pd, fmsub _mm256_fmsub_pd, fnmadd _mm256_fnmadd_pd,
    neg |a| _mm256_xor_pd(a, _mm256_set1_pd(-0.0)),
    abs |a| _mm256_andnot_pd(_mm256_set1_pd(-0.0), a),
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
    set1 _mm512_set1_pd, add _mm512_add_pd, sub _mm512_sub_pd, mul _mm512_mul_pd, div _mm512_div_pd,
    sqrt _mm512_sqrt_pd, fmadd _mm512_fmadd_pd, fmsub _mm512_fmsub_pd, fnmadd _mm512_fnmadd_pd,
    neg |a| _mm512_castsi512_pd(_mm512_xor_si512(
        _mm512_castpd_si512(a),
        _mm512_castpd_si512(_mm512_set1_pd(-0.0)))),
    abs |a| _mm512_abs_pd(a),
    round |a| _mm512_roundscale_pd::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(a),
    less |a, b| _mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b),
    select |m, a, b| _mm512_mask_blend_pd(m, b, a),
    bits |m| u32::from(m)
);

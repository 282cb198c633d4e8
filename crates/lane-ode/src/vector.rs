//! Lane types made of vector registers: the part common to all instruction sets.
//!
//! The module that invokes the macro defines each operation by its instructions, and guarantees
//! that values of its types exist only on processors that have them. The `unsafe` code below relies
//! on this guarantee.

/// Defines `$name`, a [`Lane`](crate::Lane) of `$lanes` numbers in one register of type `$raw`,
/// compiled with `$features`.
macro_rules! vector {
    ($name:ident, $raw:ty, $lanes:literal, $mask:ty, $features:literal, $doc:literal,
     set1 $set1:ident,
     operations { $($op:ident |$own:ident $(, $other:ident)*| $result:expr,)+ }
     round |$r:ident| $round:expr,
     less |$l1:ident, $l2:ident| $less:expr, select |$m:ident, $s1:ident, $s2:ident| $select:expr,
     bits |$b:ident| $bits:expr) => {
        #[doc = $doc]
        #[derive(Clone, Copy, Debug)]
        #[repr(transparent)]
        pub(crate) struct $name($raw);

        impl $name {
            /// Returns the constant `value` in every lane.
            ///
            /// # Safety
            /// The processor must have this type's instruction set.
            #[inline(always)]
            pub(crate) unsafe fn splat(value: f64) -> Self {
                // SAFETY: the caller guarantees the instruction set.
                Self(unsafe { $set1(value) })
            }
        }

        impl $crate::Real for $name {
            type Mask = $mask;
            #[inline(always)]
            fn lit(self, value: f64) -> Self {
                // SAFETY: a value of this type exists only on processors with its instruction set
                // (module docs); likewise below.
                Self(unsafe { $set1(value) })
            }
            $crate::real::operations! {
                $($op |$own $(, $other)*| {
                    let ($own, $($other,)*) = ($own.0, $($other.0,)*);
                    // SAFETY: as in `lit`.
                    Self(unsafe { $result })
                },)+
            }
            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                $crate::trig::sin_cos(self)
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
                <Self as $crate::Lane>::bits(mask) == (1 << $lanes) - 1
            }
        }

        impl $crate::Lane for $name {
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
            fn run_out_of_line<W: $crate::OutOfLine>(self, computation: W) -> W::Output {
                #[inline(never)]
                #[target_feature(enable = $features)]
                fn inner<W: $crate::OutOfLine>(computation: W) -> W::Output {
                    computation.run()
                }
                // SAFETY: as in `lit`.
                unsafe { inner(computation) }
            }
        }
    };
}

pub(crate) use vector;

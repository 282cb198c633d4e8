//! The choice of an instruction set, made when the program runs.

use core::fmt;

#[cfg(not(target_arch = "x86_64"))]
use crate::lane::call_out_of_line as one_lane;
use crate::{Lane, OutOfLine};
#[cfg(target_arch = "x86_64")]
use x86::one_lane;

/// An instruction set that the integrators can run on. Results are the same bits on all of them,
/// except [`Simd::Simd128`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Simd {
    /// A single lane, with the processor's fused multiply-add. On x86-64 this needs a processor
    /// with AVX2 and FMA.
    Scalar,
    /// Four lanes of AVX2 with FMA.
    Avx2,
    /// Eight lanes of AVX-512.
    Avx512,
    /// Two lanes of NEON.
    Neon,
    /// Two lanes of WebAssembly's vectors, which have no fused multiply-add, so that results differ
    /// from those of other sets in the last bits (see `wasm32.rs`).
    Simd128,
}

/// The error of a processor without any instruction set that kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnsupportedProcessor;

impl fmt::Display for UnsupportedProcessor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(
            "this processor lacks AVX2 or FMA: use an x86-64 processor that has them (Intel's \
             since 2013, AMD's since 2015), or a 64-bit ARM one",
        )
    }
}

impl core::error::Error for UnsupportedProcessor {}

/// A computation that is written once and compiled for every instruction set.
///
/// Mark `run`, and every function that it calls in a loop, `#[inline(always)]`: only code that is
/// inlined into the entry function of an instruction set is compiled with its instructions.
pub trait Kernel {
    /// The result of the computation.
    type Output;
    /// Runs the computation over lanes of type `T`. `zero` is a value of that type, from which the
    /// kernel makes all constants.
    fn run<T: Lane>(self, zero: T) -> Self::Output;
}

impl Simd {
    /// Every instruction set, the widest first.
    pub const ALL: [Self; 5] = [Self::Avx512, Self::Avx2, Self::Neon, Self::Simd128, Self::Scalar];

    /// Checks that this processor has an instruction set that kernels are compiled for. Programs
    /// call it before they begin.
    ///
    /// # Errors
    /// [`UnsupportedProcessor`] if it has none.
    pub fn check_processor() -> Result<(), UnsupportedProcessor> {
        if Self::Scalar.is_available() { Ok(()) } else { Err(UnsupportedProcessor) }
    }

    /// Returns the widest instruction set that this processor has.
    pub fn widest() -> Self {
        Self::ALL.into_iter().find(|simd| simd.is_available()).unwrap_or(Self::Scalar)
    }

    /// Returns the instruction set with the fewest lanes that still holds `trajectories` at once,
    /// with at most as many lanes as this one; this one if none does. Half the lanes take little
    /// more than half the time on a processor that splits its widest instructions.
    pub fn narrowest_for(self, trajectories: usize) -> Self {
        let holds_trajectories =
            |simd: &Self| (trajectories..=self.lanes()).contains(&simd.lanes());
        let mut narrowest_first = Self::ALL.into_iter().rev().filter(|simd| simd.is_available());
        narrowest_first.find(holds_trajectories).unwrap_or(self)
    }

    /// Returns the instruction set that [`Self::dispatch_narrow`] uses.
    pub fn narrow_set() -> Self {
        [Self::Avx2, Self::Neon, Self::Simd128]
            .into_iter()
            .find(|simd| simd.is_available())
            .unwrap_or(Self::Scalar)
    }

    /// Whether this processor has the instruction set.
    pub fn is_available(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Scalar | Self::Avx2 => {
                is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
            }
            #[cfg(not(target_arch = "x86_64"))]
            Self::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_available()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
            }
            Self::Neon => cfg!(target_arch = "aarch64"),
            // A WebAssembly engine without these instructions does not load the module at all.
            Self::Simd128 => cfg!(target_arch = "wasm32"),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// Returns the name in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
            Self::Neon => "neon",
            Self::Simd128 => "simd128",
        }
    }

    /// Returns the number of lanes.
    pub const fn lanes(self) -> usize {
        match self {
            Self::Scalar => 1,
            Self::Avx2 => 4,
            Self::Avx512 => 8,
            Self::Neon | Self::Simd128 => 2,
        }
    }

    /// Runs the kernel on this instruction set, or on one lane if this processor lacks it: the
    /// result is the same.
    ///
    /// # Panics
    /// On an [`UnsupportedProcessor`].
    #[inline(never)]
    pub fn dispatch<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 if self.is_available() => x86::avx512(kernel),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => x86::avx2(kernel),
            #[cfg(target_arch = "x86_64")]
            _ => x86::scalar(kernel),
            #[cfg(target_arch = "aarch64")]
            Self::Neon => aarch64::neon(kernel),
            #[cfg(target_arch = "wasm32")]
            Self::Simd128 => wasm32::simd128(kernel),
            #[cfg(not(target_arch = "x86_64"))]
            _ => kernel.run(0.0_f64),
        }
    }

    /// Runs a computation on one lane, for single trajectories. The computation is compiled once,
    /// not for every number of lanes, and the results have the same bits as in any lane.
    ///
    /// # Panics
    /// Like [`Self::dispatch`], on an [`UnsupportedProcessor`].
    #[inline(always)]
    pub fn one_lane<W: OutOfLine>(computation: W) -> W::Output {
        one_lane(computation)
    }

    /// Runs a kernel that integrates one trajectory and uses lanes for another purpose, such as
    /// derivatives, on at most four lanes. The result is the same on any number of lanes. The
    /// kernel is compiled for one instruction set instead of all, which shortens the build.
    ///
    /// # Panics
    /// Like [`Self::dispatch`], on an [`UnsupportedProcessor`].
    #[inline(never)]
    pub fn dispatch_narrow<K: Kernel>(kernel: K) -> K::Output {
        #[cfg(target_arch = "x86_64")]
        {
            x86::avx2(kernel)
        }
        #[cfg(target_arch = "aarch64")]
        {
            aarch64::neon(kernel)
        }
        #[cfg(target_arch = "wasm32")]
        {
            wasm32::simd128(kernel)
        }
        #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64", target_arch = "wasm32")))]
        kernel.run(0.0_f64)
    }
}

/// Defines an entry function that is compiled for an instruction set, and a safe function around it
/// that checks that the processor has the set.
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64", target_arch = "wasm32"))]
macro_rules! entry {
    ($name:ident, $Work:ident, $features:literal, $simd:ident, |$work:ident| $run:expr) => {
        pub(super) fn $name<W: $Work>($work: W) -> W::Output {
            #[inline(never)]
            #[target_feature(enable = $features)]
            fn inner<W: $Work>($work: W) -> W::Output {
                $run
            }
            assert!(
                super::Simd::$simd.is_available(),
                "dispatched to an instruction set that this processor lacks"
            );
            // WebAssembly's features make no call unsafe.
            #[allow(unused_unsafe)]
            // SAFETY: asserted above.
            unsafe {
                inner($work)
            }
        }
    };
}

// SAFETY (of each `splat` below): inside the entry function of its instruction set.

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod x86 {
    use super::{Kernel, OutOfLine};
    use crate::x86::{F64x4, F64x8};

    entry!(avx512, Kernel, "avx2,fma,avx512f,avx512dq,avx512vl", Avx512, |kernel| {
        kernel.run(unsafe { F64x8::splat(0.0) })
    });
    entry!(avx2, Kernel, "avx2,fma", Avx2, |kernel| kernel.run(unsafe { F64x4::splat(0.0) }));
    entry!(scalar, Kernel, "avx2,fma", Avx2, |kernel| kernel.run(0.0_f64));
    entry!(one_lane, OutOfLine, "avx2,fma", Avx2, |work| work.run());
}

#[cfg(target_arch = "aarch64")]
#[allow(unsafe_code)]
mod aarch64 {
    use super::Kernel;
    use crate::aarch64::F64x2;

    entry!(neon, Kernel, "neon", Neon, |kernel| kernel.run(unsafe { F64x2::splat(0.0) }));
}

#[cfg(target_arch = "wasm32")]
#[allow(unsafe_code)]
mod wasm32 {
    use super::Kernel;
    use crate::wasm32::F64x2;

    entry!(simd128, Kernel, "simd128", Simd128, |kernel| {
        kernel.run(unsafe { F64x2::splat(0.0) })
    });
}

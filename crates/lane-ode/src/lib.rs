//! Integrators over SIMD lanes: each lane a trajectory with its own time, no heap after set-up, the same bits on
//! every instruction set.

mod dual;
mod lane;
mod num;
mod real;
mod simd;
pub mod trig;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use dual::Dual;
pub use lane::{Array, Lane};
pub use num::{N, Product};
pub use real::Real;
pub use simd::{Kernel, Simd};

//! Integrators over SIMD lanes: each lane a trajectory with its own time, no heap after set-up, the same bits on
//! every instruction set.

mod control;
pub mod dopri5;
mod dual;
mod lane;
mod num;
mod peaks;
mod real;
pub mod rk4;
mod simd;
mod system;
pub mod trig;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use control::Tolerance;
pub use dual::Dual;
pub use lane::{Array, Lane};
pub use num::{N, Product};
pub use peaks::{Peaks, Sample};
pub use real::Real;
pub use rk4::MAX_LANES;
pub use simd::{Kernel, ScalarKernel, Simd};
pub use system::{Count, Ended, Failure, Leg, Step, System, Task};

#[cfg(test)]
mod tests;

//! Integrators over SIMD lanes. Each lane integrates a trajectory with its own time. Nothing is
//! allocated after set-up, and results are the same bits on every instruction set except
//! WebAssembly's, which has no fused operations ([`Simd::Simd128`]).
//!
//! One trajectory of a small system cannot fill a processor's vector units; eight trajectories side
//! by side can. So a value of this crate ([`Lane`]) carries 1, 2, 4 or 8 numbers, one per
//! trajectory, and the lanes share only the program: each has its own parameters, time, step and
//! end, and starts the next trajectory when its own has ended.
//!
//! A user writes, in this order:
//!
//! 1. [`System`]: x' = f(t, x), over values with operators ([`N`]). A product fuses with the sum
//!    that it is part of, in the same way on every instruction set; [`Product::v`] rounds a product
//!    that is not part of a sum.
//! 2. [`Task`]: the trajectories of a system, each divided into [`Segment`]s at its kinks, and what
//!    is recorded at every [`ObservedStep`]. [`Peaks`] finds the largest magnitudes, also inside
//!    steps.
//! 3. [`Kernel`]: the computation as a whole. [`Simd::dispatch`] is compiled for every instruction
//!    set and runs the kernel on one.
//!
//! The methods are [`rk4`] (classical, fixed step), [`dop853`] (order 8, fixed step),
//! [`dop853_adaptive`] (the same formula, adaptive), [`dopri5`] (Dormand-Prince 5(4), adaptive,
//! with dense output) and [`additive`] (Kennedy and Carpenter's ARK5(4), adaptive, for systems with
//! a stiff linear part).
//!
//! # Example
//!
//! Twenty masses on springs, x'' = -k x, each with its own k, over one second.
//!
//! ```
//! use lane_ode::{
//!     Kernel, Lane, MAX_LANES, N, ObservedStep, Segment, SegmentEnd, Simd, System, Task, rk4,
//! };
//!
//! /// The stiffness k of the trajectory in each lane (1/s^2).
//! struct Spring<T>(N<T>);
//!
//! struct Springs<'a, T> {
//!     spring: Spring<T>,
//!     /// The stiffness k of every trajectory.
//!     all: &'a [f64],
//!     /// The number of trajectories that have started.
//!     started: usize,
//!     /// The index of the trajectory in each lane.
//!     current: [usize; MAX_LANES],
//!     /// The position at the end of each trajectory.
//!     ends: Vec<f64>,
//! }
//!
//! impl<T: Lane> System<T, 2> for Spring<T> {
//!     type Forcing = ();
//!
//!     #[inline(always)]
//!     fn forcing(&self, _: N<T>) {}
//!
//!     #[inline(always)]
//!     fn derivative(&self, (): &(), x: &[N<T>; 2]) -> [N<T>; 2] {
//!         [x[1], -(self.0 * x[0]).v()]
//!     }
//!
//!     #[inline(always)]
//!     fn in_range(&self, x: &[N<T>; 2]) -> T::Mask {
//!         x[0].abs().0.less(x[0].lit(1e3).0)
//!     }
//! }
//!
//! impl<T: Lane> Task<T, 2> for Springs<'_, T> {
//!     type System = Spring<T>;
//!
//!     fn system(&self) -> &Spring<T> {
//!         &self.spring
//!     }
//!
//!     fn next_segment(
//!         &mut self,
//!         lane: usize,
//!         end: SegmentEnd,
//!         x: &mut [N<T>; 2],
//!     ) -> Option<Segment> {
//!         if let SegmentEnd::Completed(_) = end {
//!             self.ends[self.current[lane]] = x[0].0.get(lane);
//!         }
//!         let stiffness = *self.all.get(self.started)?;
//!         self.spring.0.0.set(lane, stiffness);
//!         self.current[lane] = self.started;
//!         self.started += 1;
//!         x[0].0.set(lane, 1.0);
//!         x[1].0.set(lane, 0.0);
//!         Some(Segment { start_s: 0.0, end_s: 1.0, step_s: 0.01 })
//!     }
//!
//!     fn begin(&mut self, (): &(), _: &[N<T>; 2], _: &[N<T>; 2]) {}
//!
//!     fn observe(&mut self, (): &(), _: &ObservedStep<'_, T, 2>) {}
//! }
//!
//! struct Run<'a>(&'a [f64]);
//!
//! impl Kernel for Run<'_> {
//!     type Output = Vec<f64>;
//!
//!     #[inline(always)]
//!     fn run<T: Lane>(self, zero: T) -> Vec<f64> {
//!         let ends = vec![f64::NAN; self.0.len()];
//!         let spring = Spring(N(zero));
//!         let current = [0; MAX_LANES];
//!         let mut springs = Springs { spring, all: self.0, started: 0, current, ends };
//!         rk4::integrate(zero, &mut springs);
//!         springs.ends
//!     }
//! }
//!
//! let stiffness: Vec<f64> = (1..=20).map(f64::from).collect();
//! let ends = Simd::widest().dispatch(Run(&stiffness));
//! for (k, x) in stiffness.iter().zip(&ends) {
//!     assert!((x - k.sqrt().cos()).abs() < 1e-6, "k = {k}: {x}");
//! }
//! // One lane or eight: the same bits.
//! assert_eq!(ends, Simd::Scalar.dispatch(Run(&stiffness)));
//! ```

#[cfg(target_arch = "aarch64")]
mod aarch64;
mod adaptive;
pub mod additive;
mod cancel;
mod control;
pub mod dop853;
pub mod dop853_adaptive;
pub mod dopri5;
mod dual;
mod fixed;
mod interval_peaks;
mod lane;
mod linear_solve;
mod num;
mod partials;
mod peaks;
mod quintic;
mod real;
pub mod rk4;
mod scalar;
mod simd;
mod squares;
mod system;
mod time_above;
pub mod trig;
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64", target_arch = "wasm32"))]
mod vector;
#[cfg(target_arch = "wasm32")]
mod wasm32;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use cancel::Cancel;
pub use control::Tolerance;
pub use dual::Dual;
pub use fixed::CANCEL_POLL_STEPS;
pub use interval_peaks::IntervalPeaks;
pub use lane::{Lane, MAX_LANES, OutOfLine};
pub use linear_solve::Lu;
pub use num::{N, Product};
pub use partials::Partials;
pub use peaks::Peaks;
pub use quintic::Sample;
pub use real::Real;
pub use simd::{Kernel, Simd, UnsupportedProcessor};
pub use squares::SquareIntegrals;
pub use system::{
    Failure, Forcing, ObservedStep, Segment, SegmentEnd, SemiImplicit, StepCount, System, Task,
};
pub use time_above::TimeAbove;

#[cfg(test)]
mod tests;

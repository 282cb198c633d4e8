//! Both models at single points, behind plain exports for a page.
//!
//! `sweep plot --live` writes a [`Setup`] into a page: the machine, its spin and the refinement
//! levels of the fast method, as the program chose them for the map and for the sliders. The page's
//! workers load this crate as a WebAssembly module, and ask for
//!
//! * [`quick`]: both models at some points at one level, which is quick and not checked;
//! * [`check`]: a point as a row of the map has it, by runs that agree;
//! * [`motion`]: the time history of one model at a point;
//! * [`growth`]: how fast disturbances grow there while the drum turns at constant speeds;
//! * [`dwell`]: how far the motions go that such a speed ends in.
//!
//! Numbers go in and come out as arrays of 64 bit floats; `exports.rs` says in which order. Where
//! this crate runs natively, [`check`] gives the bits of the program's rows, because both climb by
//! the rule of `washer-row` (tests of `sweep`). As a module it rounds without fused operations
//! (`tests/browser/check_live.py`).

#[cfg(target_arch = "wasm32")]
mod exports;
mod numbers;
mod point;
mod setup;

pub use point::{Answer, NoPoint, PointHistory, check, dwell, growth, motion, quick};
pub use setup::{Setup, Sliders};

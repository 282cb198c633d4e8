//! Evaluates both models of a washing machine at single points, with exports for a page.
//!
//! `sweep plot --live` writes a [`Setup`] into a page: the machine, its spin and the refinement
//! levels of the fast method, as the program chose them for the map and for the sliders. The page's
//! workers load this crate as a WebAssembly module and call
//!
//! * [`evaluate_points`]: both models at some points at one refinement level, without an error
//!   estimate;
//! * [`check_point`]: both models at a point with an error estimate, like a row of the map;
//! * [`integrate_motion`]: the time history of one model at a point;
//! * [`find_disturbances`]: the growth of disturbances while the drum turns at constant speeds;
//! * [`find_largest_attractor`]: the largest attractor at constant speeds.
//!
//! Numbers are passed as arrays of 64-bit floats, in the order given in `exports.rs`. Compiled for
//! the host, [`check_point`] gives the bits of the program's rows, because both refine by the rule
//! of `washer-row` (tests of `sweep`). The module rounds without fused operations
//! (`tests/browser/check_live.py`).

#![allow(missing_docs, reason = "private crate: a name that says enough needs no comment")]

#[cfg(target_arch = "wasm32")]
mod exports;
mod numbers;
mod point;
mod setup;

pub use point::{
    Answer, PointError, PointHistory, check_point, evaluate_points, find_disturbances,
    find_largest_attractor, integrate_motion,
};
pub use setup::{Setup, Sliders};

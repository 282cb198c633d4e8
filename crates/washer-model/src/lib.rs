//! Physics of a front-loading washing machine: parameters, equations of motion, equilibrium, modes,
//! spin.
//!
//! A [`Machine`] is plain numbers in SI units; [`Machine::paper`] is the one of Park, Jeong and Yoo
//! (2021). Every number also has a flat name ([`MachineParameter`]) by which it is read, set and
//! swept. [`Machine::violations`] reports every [`Violation`] of a machine at once. A machine with
//! a [`Spin`] becomes a [`Point`]: [`prepare`] finds the static equilibrium and the linear model
//! about it. A point is the input of
//!
//! * [`simulate`]: integrates trajectories of the nonlinear or the linear model in the lanes of a
//!   vector register, and returns a [`Record`] of each;
//! * [`Point::matrices`]: M, C, K and F of the linear model at an instant;
//! * [`modes`] and [`campbell`]: natural motions at an instant, and over spin speed, with the
//!   resonances.
//!
//! `docs/equations.md` of the repository ("the model page") holds the equations by the numbers that
//! comments cite.
//!
//! # Example
//!
//! Compares sag and first resonance of the paper's machine with those on springs of twice the
//! stiffness.
//!
//! ```
//! use lane_ode::Simd;
//! use washer_model::{Machine, Profile, Spin, Timing, campbell, modes, prepare};
//!
//! let standard = Machine::paper();
//! let mut stiff = standard.clone();
//! for spring in &mut stiff.springs {
//!     spring.stiffness_n_per_m *= 2.0;
//! }
//! let spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 400.0, ramp_s: 40.0 };
//! let timing = Timing { end_s: 50.0, window_s: [0.0, 50.0], checkpoints: 0 };
//! let points = prepare(Simd::widest(), &[(standard, spin.clone()), (stiff, spin)], &timing);
//!
//! let mut results = Vec::new();
//! for point in points {
//!     let point = point?;
//!     // The sag under the machine's weight (q1, m).
//!     let sag_m = -point.equilibrium()[0];
//!     // The linear model at rest: a symmetric, positive stiffness.
//!     let stiffness = point.matrices(0.0, 0.0, 0.0).stiffness;
//!     let asymmetry = stiffness[4][0] - stiffness[0][4];
//!     assert!(stiffness[0][0] > 0.0 && asymmetry.abs() < 1e-6 * stiffness[0][0]);
//!     // Its natural motions at 100 rpm, the slowest first, decay.
//!     let slowest = modes(&point, 0.0, 100.0 * std::f64::consts::TAU / 60.0)?.modes[0];
//!     assert!(slowest.damping_ratio() > 0.0 && slowest.damping_ratio() < 1.0);
//!     // The resonances: speeds that equal a mode's frequency.
//!     let speeds_rpm: Vec<f64> = (2..=20).map(|k| 20.0 * f64::from(k)).collect();
//!     let modes = campbell(&point, &speeds_rpm)?.into_iter();
//!     let resonances = modes.flat_map(|mode| mode.resonances);
//!     let resonances_rpm = resonances.map(|resonance| resonance.speed_rpm);
//!     let first_rpm = resonances_rpm.fold(f64::INFINITY, f64::min);
//!     results.push((sag_m, first_rpm));
//! }
//! let [(sag_m, first_rpm), (stiff_sag_m, stiff_first_rpm)] = results[..] else { unreachable!() };
//! assert!((sag_m - 0.0141).abs() < 1e-4);
//! assert!((first_rpm - 99.9).abs() < 0.5); // the paper: 99.9 rpm
//! assert!(stiff_sag_m < 0.6 * sag_m && stiff_first_rpm > 1.2 * first_rpm);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![allow(missing_docs, reason = "a name that is clear needs no comment")]

#[doc(hidden)]
pub mod bench;
mod channel;
mod coordinates;
mod dwell;
mod kind;
mod lanes;
mod linear;
mod machine;
mod modes;
mod nonlinear;
mod point;
mod preparation;
mod run;
mod stability;
mod steps;

pub use channel::Channel;
pub use coordinates::COORDINATES;
pub use dwell::{
    Attractor, AttractorStatus, Attractors, Exponent, MotionKind, StartRule, find_attractors,
    find_attractors_from_responses,
};
pub use kind::ModelKind;
pub use linear::Matrices;
pub use machine::parameters::{
    Assumption, DataSheet, ElementList, ExpectedRange, MachineParameter, Range, Target,
    UnknownParameter, decimal, unit_suffix,
};
pub use machine::spin::{Profile, Spin};
pub use machine::violations::Violation;
pub use machine::{
    Bearings, BumpStop, Bushing, Cabinet, Damper, Drum, Flexure, Foot, Machine, Shaft, Spring, Tub,
    Unbalance,
};
pub use modes::campbell::{ModeAtSpeed, ModeOverSpeed, Resonance, campbell, campbell_until};
pub use modes::shape::{ModeMotion, MotionPlane, Movement};
pub use modes::{
    Mode, Modes, ModesError, highest_explicit_frequency_rad_per_s, highest_frequency_rad_per_s,
    modes,
};
pub use nonlinear::coupling::Caps;
pub use point::friction::FrictionSpeed;
pub use point::input::PointInput;
pub use point::ringing::{Swing, UnresolvedModes};
pub use point::{NoEquilibrium, Point, Timing};
pub use preparation::prepare;
pub use run::equations::{PointEquations, STATE_LEN};
pub use run::history::{
    History, HistoryRequest, InitialDeviation, InstantOutputs, histories_per_batch, instant_count,
    integrate_histories, integrate_history,
};
pub use run::suspension::{SuspensionForces, stop_forces_at_rest_n};
pub use run::{
    Checkpoint, Checkpoints, Gauge, Method, MethodKind, Reading, Record, Recorders, Snapshot,
    simulate, simulate_until, simulate_with,
};
pub use stability::{
    Crossing, CrossingEffect, Disturbance, FloquetMode, GeometryLimit, HeldSpeed, LeftRangeError,
    ParticipatingMode, Response, ResponseCurves, ResponseError, StabilityKind, find_responses,
    floquet_modes, follow_crossings, peaks_without_departures,
};
pub use steps::formula::Formula;
pub use steps::{StepSelector, capped_method};

#[cfg(test)]
mod tests;

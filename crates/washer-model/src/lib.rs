//! Physics of a front-loading washing machine: parameters, equations of motion, equilibrium, spin.

mod channel;
mod coefficients;
mod coupling;
mod equilibrium;
mod floating;
mod forces;
mod frame;
mod harmonics;
mod lanes;
mod linear;
mod linear_outputs;
mod machine;
mod model;
mod nonlinear;
mod outputs;
mod parameters;
mod point;
mod run;
mod spin;
mod violations;

pub use channel::Channel;
pub use linear::Matrices;
pub use machine::{Bearings, Damper, Drum, Flexure, Machine, Shaft, Spring, Tub, Unbalance};
pub use nonlinear::COORDINATES;
pub use parameters::{Parameter, Range, Source, UnknownParameter, decimal};
pub use point::{NoEquilibrium, Point, Timing, prepare};
pub use run::{Method, ModelKind, Record, simulate};
pub use spin::{Spin, SpinStretch};
pub use violations::Violation;

#[cfg(test)]
mod reference_tests;

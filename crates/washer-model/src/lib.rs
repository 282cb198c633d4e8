//! Physics of a front-loading washing machine: parameters, equations of motion, equilibrium, spin.

mod campbell;
mod capping;
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
mod modal;
mod model;
mod nonlinear;
mod outputs;
mod parameters;
mod point;
mod run;
mod shape;
mod spin;
mod violations;

pub use campbell::{ModeAtSpeed, ModeOverSpeed, Resonance, campbell};
pub use capping::Capping;
pub use channel::Channel;
pub use linear::Matrices;
pub use machine::{Bearings, Damper, Drum, Flexure, Machine, Shaft, Spring, Tub, Unbalance};
pub use modal::{Mode, Modes, NoModes, highest_frequency_rad_per_s, modes};
pub use nonlinear::COORDINATES;
pub use parameters::{Parameter, Range, Source, UnknownParameter, decimal};
pub use point::{NoEquilibrium, Point, Timing, prepare};
pub use run::{Method, ModelKind, Record, simulate};
pub use shape::{Motion, Movement, Plane};
pub use spin::{Spin, SpinStretch};
pub use violations::Violation;

#[cfg(test)]
mod campbell_tests;
#[cfg(test)]
mod reference_tests;
#[cfg(test)]
mod tests;

//! Physics of a front-loading washing machine: parameters, equations of motion, equilibrium, spin.

mod channel;
mod coefficients;
mod equilibrium;
mod floating;
mod forces;
mod frame;
mod harmonics;
mod lanes;
mod linear;
mod machine;
mod nonlinear;
mod outputs;
mod spin;

pub use channel::Channel;
pub use machine::{Bearings, Damper, Drum, Flexure, Machine, Shaft, Spring, Tub, Unbalance};
pub use spin::Spin;

#[cfg(test)]
mod reference_tests;

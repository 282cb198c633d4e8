//! Physics of a front-loading washing machine: parameters, equations of motion, equilibrium, spin.

mod channel;
mod machine;
mod parameters;
mod spin;
mod violations;

pub use channel::Channel;
pub use machine::{Bearings, Damper, Drum, Flexure, Machine, Shaft, Spring, Tub, Unbalance};
pub use parameters::{Parameter, Range, Source, UnknownParameter};
pub use spin::Spin;
pub use violations::Violation;

//! What the model promises, and the instruments to show it.

mod allocation;
mod bits;
mod cost;
pub(crate) mod elements;
mod energy;
mod expansion;
mod extras;
mod findings;
pub(crate) mod friction;
mod instruments;
mod loads;
mod long_tables;
mod mass;
mod observation;
pub(crate) mod reference;
mod stiff;

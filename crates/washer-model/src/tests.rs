//! Tests of the models, and their common functions.

mod allocation;
mod angles;
mod bits;
mod cost;
pub(crate) mod elements;
mod energy;
mod expansion;
mod findings;
pub(crate) mod friction;
mod instruments;
mod loads;
mod long_tables;
mod mass;
mod observation;
mod recorders;
pub(crate) mod reference;
mod stiff;

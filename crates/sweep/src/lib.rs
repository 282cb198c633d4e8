//! The sweep.

pub mod interrupt;
pub mod outcome;
pub mod progress;
pub mod run;
pub mod store;
pub mod verdict;

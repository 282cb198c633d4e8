//! The sweep: from a grid file to a result file.

pub mod config;
pub mod outcome;
pub mod plan;

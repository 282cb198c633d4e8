//! The sweep: from a grid file to a result file.

pub mod outcome;
pub mod plan;

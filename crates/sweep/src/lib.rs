//! The sweep: from a grid file to a result file.

pub mod cli;
pub mod commands;
pub mod config;
pub mod exit;
pub mod outcome;
pub mod plan;

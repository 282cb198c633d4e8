//! The sweep: from a grid file to a result file.

pub mod boundary;
mod cells;
pub mod cli;
pub mod commands;
pub mod config;
pub mod design;
pub mod engine;
pub mod estimate;
pub mod exit;
pub mod interrupt;
pub mod measures;
pub mod outcome;
pub mod plan;
pub mod plot;
pub mod progress;
pub mod run;
pub mod store;
mod table;
pub mod trace;
pub mod verdict;

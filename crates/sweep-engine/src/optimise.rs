//! Optimisation studies: the minimum of some objectives over some parameters.
//!
//! A candidate is a value of each parameter. It is evaluated at every point of the study's grid:
//! the model's engine computes the rows of a whole generation, and expressions over them are the
//! objectives and constraints. [`evolve()`] chooses the candidates from these numbers alone. The
//! store keeps them, so that an interrupted study is resumed and ends in the same bytes.

pub mod evolve;
pub mod file;
pub mod search;
pub mod study;

use evolve::{Candidate, Evolution, evolve, find_pareto_front};
pub use study::Study;

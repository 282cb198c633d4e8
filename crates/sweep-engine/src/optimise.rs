//! The least of some numbers over some parameters: a study.
//!
//! A candidate is a value of each parameter. It is tried at every point of the study's grid, its
//! rows go through the model's engine together with those of its generation, and expressions over
//! them are its objectives and conditions. [`evolve()`] chooses the candidates, by their answers
//! alone; the store keeps the answers, so an interrupted study goes on and ends in the same bytes.

pub mod evolve;
pub mod file;
pub mod search;
pub mod study;

use evolve::{Candidate, Evolution, evolve, front};
pub use study::Study;

//! The washing machine's part of grid files, read by the engine's rules.
//!
//! Defaults: `machine` is `"paper"`, and `[reliability]` compares the peaks of six channels, the
//! fronts of tub and drum and the tub's angles. `[spin]` is required, and a machine file must be
//! complete. Bounds: spin tables have at most 20,000 rows, and a machine at most 1000 elements of
//! each kind.
//!
//! `damping_n_s_per_m` sets every `damper_N_damping_n_s_per_m`, so one section may not have both.

pub(crate) mod grid;
pub(crate) mod machine;
mod plausible;
pub(crate) mod read;
mod schema;
pub(crate) mod spin;
#[cfg(test)]
mod tests;
mod validate;

use std::path::Path;

use crate::model::Washer;
use crate::plan::Plan;

pub(crate) use machine::{to_json as machine_json, to_toml as machine_file};
pub use sweep_engine::config::{Diagnostics, Mistake};
pub(crate) use sweep_engine::config::{check_columns, not_numbers_mistake, wrong_length_mistake};

/// A grid of washing machines as a user gives it.
pub type WasherGridInput = sweep_engine::GridInput<Washer>;

/// Reads a grid file and its machine file, applies the constants `NAME=VALUE`, and checks the plan.
///
/// # Errors
/// Returns all mistakes that one pass finds.
pub fn load(path: &Path, sets: &[String]) -> Result<Plan, Diagnostics> {
    WasherGridInput::file(path.to_owned(), sets.to_vec()).load()
}

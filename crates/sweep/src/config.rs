//! What grid files hold of the washing machine, read by the engine's rules.
//!
//! Defaults: `machine` is `"paper"`, `[reliability]` compares the six channels of tub and drum
//! fronts and tub angles by their peaks. `[spin]` must be given, and a machine file is always
//! whole. Bounds: spin tables of 20,000 rows, 1000 of each kind of element.
//!
//! Precedence: `damping_n_s_per_m` writes every `damper_1_damping_n_s_per_m`, so that not both may
//! stand in one place.

pub(crate) mod grid;
pub(crate) mod machine;
mod plausible;
mod read;
mod schema;
mod spin;
#[cfg(test)]
mod tests;
mod validate;

use std::path::Path;

use crate::model::Washer;
use crate::plan::Plan;

pub(crate) use machine::{to_json as machine_json, to_toml as machine_file};
pub use sweep_engine::config::{Diagnostics, Mistake};
pub(crate) use sweep_engine::config::{check_columns, not_numbers, other_length};

/// A grid as a user gives it.
pub type GridInput = sweep_engine::GridInput<Washer>;

/// Reads a grid file with its machine file, puts the constants `NAME=VALUE` in place, and checks
/// the whole.
///
/// # Errors
/// Every mistake found, in one pass.
pub fn load(path: &Path, sets: &[String]) -> Result<Plan, Diagnostics> {
    GridInput::file(path.to_owned(), sets.to_vec()).load()
}

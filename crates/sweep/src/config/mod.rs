//! From what a user typed to a [`Plan`], or to every mistake in it.
//!
//! A grid file, the machine file it names and the constants of the command line are walked once, each value with the
//! place where it stands. Wrong values are reported and replaced by stand-ins, so that the walk goes on and one pass
//! finds every mistake; a plan comes out only if there is none.
//!
//! Precedence, later over earlier: machine file, `[set]`, `--set`, axes. Within each of them no number may be written
//! twice, not even under two names (`damping_n_s_per_m` writes every `damper_1_damping_n_s_per_m`), because nothing
//! would say which comes last.

mod canonical;
mod grid;
mod machine;
mod origins;
mod parameters;
mod render;
mod report;
pub mod schema;
mod section;
mod source;
mod validate;

use std::path::Path;

pub use report::Diagnostics;

use report::Report;
use washer_model::Machine;

use crate::plan::Plan;

/// Reads a grid file with its machine file, puts the constants `NAME=VALUE` in place, and checks the whole.
///
/// # Errors
/// Every mistake found, in one pass.
pub fn load(path: &Path, sets: &[String]) -> Result<Plan, Diagnostics> {
    let mut report = Report::default();
    let Some(draft) = grid::draft(path, sets, &mut report) else { return Err(report.into_diagnostics()) };
    validate::steps(&draft, &mut report);
    validate::scenarios(&draft, &mut report);
    report.finish(draft.plan)
}

/// A machine as the text of a machine file: loading it gives the same machine, bit for bit.
#[must_use]
pub fn machine_file(machine: &Machine) -> String {
    machine::to_toml(machine)
}

//! From what a user typed to a [`Plan`], or to every mistake in it.
//!
//! A grid file, the machine file it names and the constants of the command line are walked once,
//! each value with its place. Wrong values are reported and replaced by stand-ins, so that the walk
//! goes on and one pass finds every mistake. There is a plan only if there are no mistakes.
//!
//! Defaults: `name` is the file's own name, `machine` is `"paper"`, `window_s` the whole run,
//! `[integrator]` the defaults of [`crate::method`]'s table, `[reliability]` the ratio 2 over the
//! six channels of tub and drum fronts and tub angles; without axes the grid is a single point.
//! `[spin]` and `end_s` must be given, and a machine file is always whole.
//!
//! With `[design]` the axes are ranges without a count, over which `latin_hypercube` or `sobol`
//! spreads `points` points; or there is no axis, and `list` takes points from a CSV or Parquet file
//! whose columns are parameters.
//!
//! Bounds: files to 896 KiB; lists of points to 256 MiB, packed or not, and 2e7 numbers; a Sobol
//! design to 2^32 points over 32 axes; 1e12 grid points; 1e6 s; 1e10 steps that stability asks for;
//! spin tables of 20,000 rows; numbers to 1e12 in magnitude; 1000 of each kind
//! of element.
//!
//! Precedence, later over earlier: machine file, `[set]`, `--set`, axes. Within each of them no
//! number may be written twice, not even under two names (`damping_n_s_per_m` writes every
//! `damper_1_damping_n_s_per_m`), because nothing would say which comes last.

mod again;
mod axes;
#[cfg(test)]
mod bounds_tests;
mod canonical;
mod design;
mod grid;
mod list;
mod machine;
mod origins;
mod parameters;
mod points;
mod render;
mod report;
mod scalars;
pub(crate) mod schema;
mod section;
mod source;
mod spin;
mod syntax;
#[cfg(test)]
mod tests;
mod validate;

use std::path::{Path, PathBuf};

pub(crate) use points::{check_columns, not_numbers, other_length};
pub use report::{Diagnostics, Mistake};

use grid::Draft;
use report::{Diagnostic, Report};
use serde_json::Value;
use source::Location;
use washer_model::Machine;

use crate::plan::Plan;

/// A grid as a user gives it: a file or a text, with the constants `NAME=VALUE` over those it sets.
#[derive(Clone, Debug)]
pub struct GridInput {
    path: PathBuf,
    /// If it is not the file's.
    text: Option<String>,
    /// The text of a machine file, in place of the machine that the grid names.
    machine: Option<String>,
    sets: Vec<String>,
}

impl GridInput {
    /// A grid file. The paths in it are relative to its folder.
    #[must_use]
    pub fn file(path: PathBuf, sets: Vec<String>) -> Self {
        Self { path, text: None, machine: None, sets }
    }

    /// The text of a grid file. Messages call it by this name, which is also that of the run if the
    /// text gives none. The paths in it are relative to the working directory.
    #[must_use]
    pub fn text(name: &str, text: String, sets: Vec<String>) -> Self {
        Self { path: name.into(), text: Some(text), machine: None, sets }
    }

    /// The grid that a result was made of, by its plan in the result (`Plan::to_json`). The points
    /// of a design are left out.
    pub(crate) fn of_plan(name: &str, plan: &Value) -> Self {
        let parts =
            ["name", "spin", "time", "integrator", "axis", "reliability", "metrics", "stability"];
        let text = again::file(parts.map(|key| (key, plan.get(key))));
        let machine = plan.get("machine").and_then(Value::as_object);
        let machine = machine.map(|machine| {
            again::file(machine.iter().map(|(key, value)| (key.as_str(), Some(value))))
        });
        Self { path: name.into(), text: Some(text), machine, sets: Vec::new() }
    }

    /// Reads the grid with its machine file, puts the constants in place, and checks the whole.
    ///
    /// # Errors
    /// Every mistake found, in one pass.
    pub fn load(&self) -> Result<Plan, Diagnostics> {
        resolve(self, |_, _| ()).map(|(plan, ())| plan)
    }

    /// As [`Self::load`], for one point: `at` gives each axis of several values one (on the grid or
    /// between its points), and any other parameter too. The plan has no axes; its machine and spin
    /// are the point's. Beside it, what `at` says, by name.
    ///
    /// # Errors
    /// Every mistake found, in one pass.
    pub(crate) fn load_point(&self, at: &[String]) -> Result<(Plan, NamedValues), Diagnostics> {
        resolve(self, |draft, report| parameters::point(at, draft, report))
    }
}

/// Reads a grid file with its machine file, puts the constants `NAME=VALUE` in place, and checks
/// the whole.
///
/// # Errors
/// Every mistake found, in one pass.
pub fn load(path: &Path, sets: &[String]) -> Result<Plan, Diagnostics> {
    GridInput::file(path.to_owned(), sets.to_vec()).load()
}

/// The name of a run as the command line gives it, or what it should have been.
///
/// # Errors
/// In words.
pub(crate) fn plain_name(text: &str) -> Result<String, String> {
    grid::plain_name(text)
}

/// Parameters by name, with a value each.
pub(crate) type NamedValues = Vec<(String, f64)>;

/// As [`load`], for one point: [`GridInput::load_point`].
///
/// # Errors
/// Every mistake found, in one pass.
pub(crate) fn load_point(
    path: &Path,
    sets: &[String],
    at: &[String],
) -> Result<(Plan, NamedValues), Diagnostics> {
    GridInput::file(path.to_owned(), sets.to_vec()).load_point(at)
}

fn resolve<T>(
    input: &GridInput,
    finish: impl FnOnce(&mut Draft, &mut Report) -> T,
) -> Result<(Plan, T), Diagnostics> {
    let mut report = Report::default();
    let Some(mut draft) = grid::draft(input, &mut report) else {
        return Err(report.into_diagnostics());
    };
    let finished = finish(&mut draft, &mut report);
    validate::steps(&draft, &mut report);
    validate::scenarios(&draft, &mut report);
    validate::stability(&draft, &mut report);
    validate::growth(&draft, &mut report);
    report.finish((draft.plan, finished))
}

pub(crate) use machine::with_one_of_each;
/// Mistakes in expressions that an option or argument takes, each with its text.
#[must_use]
pub(crate) fn mistakes_in_expressions<'a>(
    option: &str,
    mistakes: impl IntoIterator<Item = (&'a str, sweep_results::Mistake)>,
) -> Diagnostics {
    let mut report = Report::default();
    for (text, mistake) in mistakes {
        let source = report.sources.add(option, text);
        let at = Location::new(source, mistake.span);
        let mut diagnostic = Diagnostic::new(mistake.title).at(&at, mistake.expected);
        if let Some((typed, names)) = &mistake.candidates {
            diagnostic = diagnostic.nearest(typed, names.iter().map(String::as_str));
        }
        report.push(diagnostic);
    }
    report.into_diagnostics()
}

/// A machine in full, as a result file carries it.
#[must_use]
pub(crate) fn machine_json(machine: &Machine) -> serde_json::Value {
    machine::to_json(machine)
}

/// A machine as the text of a machine file: loading it gives the same machine, bit for bit.
#[must_use]
pub(crate) fn machine_file(machine: &Machine) -> String {
    machine::to_toml(machine)
}

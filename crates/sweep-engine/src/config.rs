//! From what a user typed to a [`Plan`], or to every mistake in it.
//!
//! A grid file, the file that it names for its model and the constants of the command line are
//! walked once, each value with its place. Wrong values are reported and replaced by stand-ins, so
//! that the walk goes on and one pass finds every mistake. There is a plan only if there are no
//! mistakes.
//!
//! Defaults: `name` is the file's own name, `window_s` the whole run, `[integrator]` the defaults
//! of [`crate::method`]'s table, `[reliability]` the ratio 2 over the model's usual channels;
//! without axes the grid is a single point. `end_s` must be given.
//!
//! With `[design]` the axes are ranges without a count, over which `latin_hypercube` or `sobol`
//! spreads `points` points; or there is no axis, and `list` takes points from a CSV or Parquet file
//! whose columns are parameters.
//!
//! Bounds: files to 896 KiB; lists of points to 256 MiB, packed or not, and 2e7 numbers; a Sobol
//! design to 2^32 points over 32 axes; 1e12 grid points; 1e6 s; 1e10 steps that stability asks for;
//! numbers to 1e12 in magnitude.
//!
//! Precedence, later over earlier: the model's own file, `[set]`, `--set`, axes. Within each of
//! them no number may be written twice, not even under two names, because nothing would say which
//! comes last.

pub mod axes;
mod canonical;
pub mod design;
mod draft;
pub mod form;
pub mod grid;
pub mod keys;
pub mod list;
pub mod parameters;
mod plan_to_toml;
mod points;
pub mod read;
mod render;
pub mod report;
pub mod schema;
pub mod section;
pub mod sections;
pub mod source;
pub mod syntax;
pub mod whole;
pub mod words;
pub mod written;

use std::marker::PhantomData;
use std::path::PathBuf;

pub use draft::Draft;
pub use form::Form;
pub use keys::{Key, Keys, Walk};
pub use points::{check_columns, not_numbers, other_length};
pub use read::Read;
pub use report::{Diagnostic, Diagnostics, Mistake, Report};
pub use section::{Field, Section, quoted, refused_number, short, twice, unknown_word};
pub use sections::plain_name;
pub use source::{Located, Location, SourceId, Sources};
pub use written::Written;

use serde_json::Value;

use crate::plan::{Aside, Plan, WrittenIn};

/// A grid as a user gives it: a file or a text, with the constants `NAME=VALUE` over those it sets.
#[derive(Clone, Debug)]
pub struct GridInput<M> {
    /// The file, to which the paths in it are relative.
    pub path: PathBuf,
    /// The run's name, over the file's.
    name: Option<String>,
    /// If it is not the file's.
    text: Option<String>,
    /// The text of a file of the model's own, in place of the one that the grid names.
    pub own_file: Option<String>,
    sets: Vec<String>,
    at: Vec<String>,
    model: PhantomData<M>,
}

impl<M: Read> GridInput<M> {
    /// A grid file. The paths in it are relative to its folder.
    pub fn file(path: PathBuf, sets: Vec<String>) -> Self {
        let (name, text, own_file, at) = (None, None, None, Vec::new());
        Self { path, name, text, own_file, sets, at, model: PhantomData }
    }

    /// The text of a grid file. Messages call it by this name, which is also that of the run if the
    /// text gives none. The paths in it are relative to the working directory.
    pub fn text(name: &str, text: String, sets: Vec<String>) -> Self {
        Self { text: Some(text), ..Self::file(name.into(), sets) }
    }

    /// The grid that a result was made of, by its plan in the result (`Plan::to_json`). The points
    /// of a design are left out.
    pub fn of_plan(name: &str, plan: &Value) -> Self {
        let is_read = |key: &str| {
            !["design", "set", "boundary", "optimise"].contains(&key) && Some(key) != M::OWN_FILE
        };
        let top = plan.as_object().into_iter().flatten().filter(|(key, _)| is_read(key));
        let own = M::OWN_FILE.and_then(|key| plan.get(key)?.as_object());
        Self {
            text: Some(plan_to_toml::file(top)),
            own_file: own.map(plan_to_toml::file),
            ..Self::file(name.into(), Vec::new())
        }
    }

    /// As it is, with these `NAME=VALUE` beside the constants: a parameter that an axis sweeps
    /// is fixed by one, as it is by a constant.
    #[must_use]
    pub fn fixing(self, at: &[String]) -> Self {
        Self { at: at.to_vec(), ..self }
    }

    /// As it is, with this name of the run, if it is one, over the file's.
    #[must_use]
    pub fn named(self, name: Option<String>) -> Self {
        Self { name, ..self }
    }

    /// Reads the grid, puts the constants in place, and checks the whole.
    ///
    /// # Errors
    /// Every mistake found, in one pass.
    pub fn load(&self) -> Result<Plan<M>, Diagnostics> {
        resolve(self, |_| ()).map(|(plan, ())| plan)
    }

    /// As [`Self::load`], for one point: `at` gives each axis of several values one (on the grid or
    /// between its points), and any other parameter too. The plan has no axes; its model
    /// is the point's. Beside it, what `at` says, by name.
    ///
    /// # Errors
    /// Every mistake found, in one pass.
    pub fn load_point(&self, at: &[String]) -> Result<(Plan<M>, NamedValues), Diagnostics> {
        resolve(self, |draft| parameters::point(at, draft))
    }
}

/// Parameters by name, with a value each.
pub type NamedValues = Vec<(String, f64)>;

fn resolve<M: Read, T>(
    input: &GridInput<M>,
    finish: impl FnOnce(&mut Draft<'_, M>) -> T,
) -> Result<(Plan<M>, T), Diagnostics> {
    let report = Report::default();
    let read = grid::draft(input, &report).map(|mut draft| {
        let finished = finish(&mut draft);
        whole::steps(&draft);
        M::judge(&draft);
        let written = WrittenIn(report.written());
        let aside = Aside { notes: report.take_notes(), ..draft.plan.aside };
        (Plan { written, aside, ..draft.plan }, finished)
    });
    report.finish(read)
}

//! The configuration: from a user's input to a [`Plan`], or to every mistake in it.
//!
//! A grid file, the file that it names for its model, and the constants of the command line are
//! read in one walk, each value with its location. Wrong values are reported and replaced by
//! placeholders, so that the walk goes on and one pass finds every mistake. There is a plan only if
//! there are no mistakes.
//!
//! Defaults: `name` is the file's name, `window_s` the whole run, `[integrator]` the defaults of
//! [`crate::method`]'s table, `[reliability]` the ratio 2 over the model's default channels;
//! without axes the grid is a single point. `end_s` must be given.
//!
//! With `[design]` the axes are ranges without a count, over which `latin_hypercube` or `sobol`
//! spreads `points` points; or there is no axis, and `list` takes points from a CSV or Parquet file
//! whose columns are parameters.
//!
//! Bounds: files to 896 KiB; lists of points to 256 MiB, compressed or not, and 2e7 numbers; a
//! Sobol design to 2^32 points over 32 axes; 1e12 grid points; 1e6 s; 1e10 steps that stability
//! requires; numbers to 1e12 in magnitude.
//!
//! Precedence, later over earlier: the model's own file, `[set]`, `--set`, axes. Within each of
//! them a number may be written only once, even under two names, because their order is not
//! defined.

pub mod arguments;
pub mod axes;
mod canonical;
pub mod design;
mod draft;
pub mod form;
pub mod grid;
pub mod keys;
pub mod list;
pub mod parameters;
pub mod plan_checks;
mod plan_to_toml;
mod points;
mod render;
pub mod report;
pub mod schema;
pub mod section;
pub mod sections;
pub mod source;
pub mod syntax;
pub mod words;

use std::marker::PhantomData;
use std::path::PathBuf;

pub use arguments::NamedArgument;
pub use draft::Draft;
pub use form::Form;
pub use keys::{Key, KeyWalk, Keys};
pub use points::{check_columns, not_numbers_mistake, wrong_length_mistake};
pub use report::{Diagnostic, Diagnostics, Mistake, Report};
pub use section::{
    Field, Section, number_mistake, quote, shorten, unknown_word_mistake, written_twice_mistake,
};
pub use sections::parse_name;
pub use source::{Located, Location, SourceId, Sources};

use serde_json::Value;

use crate::Model;
use crate::plan::{NumberSources, Plan, ReadingNotes};

/// A grid as a user gives it: a file or a text, with constants `NAME=VALUE` that override its own.
#[derive(Clone, Debug)]
pub struct GridInput<M> {
    /// The file; paths in it are relative to its folder.
    pub path: PathBuf,
    /// The run's name, if it overrides that of the file.
    name: Option<String>,
    /// The text of the grid, if it is not read from the file.
    text: Option<String>,
    /// The text of the model's own file, if it is not the one that the grid names.
    pub model_file: Option<String>,
    /// The arguments NAME=VALUE of `--set`.
    set_arguments: Vec<String>,
    /// The arguments NAME=VALUE of `--at`.
    at_arguments: Vec<String>,
    model: PhantomData<M>,
}

impl<M: Model> GridInput<M> {
    /// Returns the input of a grid file. Paths in it are relative to its folder.
    pub fn file(path: PathBuf, sets: Vec<String>) -> Self {
        let name = None;
        let text = None;
        let model_file = None;
        let at_arguments = Vec::new();
        Self { path, name, text, model_file, set_arguments: sets, at_arguments, model: PhantomData }
    }

    /// Returns the input of a grid's text. `name` stands in messages, and is the run's name if the
    /// text gives none. Paths in it are relative to the working directory.
    pub fn text(name: &str, text: String, sets: Vec<String>) -> Self {
        Self { text: Some(text), ..Self::file(name.into(), sets) }
    }

    /// Returns the grid of a result from the plan in it (`Plan::to_json`), without the points of a
    /// design. Axes with tolerances keep the values that the tolerances gave.
    pub fn from_plan(name: &str, plan: &Value) -> Self {
        let model_file_key = M::ABOUT.model_file.map(|file| file.key);
        let is_grid_key = |key: &str| {
            !["design", "set", "boundary", "optimise"].contains(&key) && Some(key) != model_file_key
        };
        let mut plan = plan.clone();
        for axis in plan.get_mut("axis").and_then(Value::as_array_mut).into_iter().flatten() {
            axis.as_object_mut().map(|axis| axis.remove("tolerance"));
        }
        let grid_keys = plan.as_object().into_iter().flatten().filter(|(key, _)| is_grid_key(key));
        let model_file_keys = model_file_key.and_then(|key| plan.get(key)?.as_object());
        Self {
            text: Some(plan_to_toml::format_toml(grid_keys)),
            model_file: model_file_keys.map(plan_to_toml::format_toml),
            ..Self::file(name.into(), Vec::new())
        }
    }

    /// Returns the input with additional constants `NAME=VALUE`, which also fix parameters that an
    /// axis sweeps.
    #[must_use]
    pub fn with_fixed(self, at_arguments: &[String]) -> Self {
        Self { at_arguments: at_arguments.to_vec(), ..self }
    }

    /// Returns the input with this name of the run, if there is one.
    #[must_use]
    pub fn with_name(self, name: Option<String>) -> Self {
        Self { name, ..self }
    }

    /// Reads the grid, applies the constants, and checks the plan.
    ///
    /// # Errors
    /// Every mistake found, in one pass.
    pub fn load(&self) -> Result<Plan<M>, Diagnostics> {
        read_plan(self, |_| ()).map(|(plan, ())| plan)
    }

    /// Reads the grid for one point. `at_arguments` has arguments NAME=VALUE for each axis of
    /// several values (on the grid or between its points) and for other parameters. Returns the
    /// plan, which has no axes and the point's model, and these values by name.
    ///
    /// # Errors
    /// Every mistake found, in one pass.
    pub fn load_point(
        &self,
        at_arguments: &[String],
    ) -> Result<(Plan<M>, NamedValues), Diagnostics> {
        read_plan(self, |draft| parameters::fix_point(at_arguments, draft))
    }
}

/// Parameters by name with their values.
pub type NamedValues = Vec<(String, f64)>;

fn read_plan<M: Model, T>(
    input: &GridInput<M>,
    finish: impl FnOnce(&mut Draft<'_, M>) -> T,
) -> Result<(Plan<M>, T), Diagnostics> {
    let report = Report::default();
    let result = grid::read_draft(input, &report).map(|mut draft| {
        let finish_result = finish(&mut draft);
        plan_checks::check_steps(&draft);
        M::check(&draft);
        let sources = NumberSources(report.parameter_sources());
        let reading_notes = ReadingNotes { notes: report.take_notes(), ..draft.plan.reading_notes };
        (Plan { sources, reading_notes, ..draft.plan }, finish_result)
    });
    report.finish(result)
}

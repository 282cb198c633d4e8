//! Sweeps a [`Model`] over a grid: from a grid file to a result file. This crate does not know any
//! particular model.
//!
//! A model implements two traits: [`Model`], which is in this file because all other items are
//! generic over it, and [`Evaluator`].
//!
//! * `config` reads a grid file into a [`Plan`], or says every mistake in it. `method` declares a
//!   model's methods of integration. `design` places points off the grid.
//! * `run` has an [`Engine`] compute a plan's points on all cores and keeps them as they come.
//!   `store` is the folder on disk meanwhile, and the result file; [`sweep_files`] has the rules of
//!   writing and reading.
//! * `boundary` traces the curve where a quantity is at its limit; `optimise` looks for the least
//!   of some numbers. Both ask the engine through `evaluator`.
//! * `commands` is the command line; `progress`, `interrupt` and `exit` serve it.

pub mod boundary;
pub mod build;
pub mod columns;
pub mod commands;
pub mod config;
pub mod design;
pub mod engine;
pub mod estimate;
pub mod evaluator;
pub mod execution;
pub mod exit;
pub mod interrupt;
pub mod method;
pub mod model;
pub mod optimise;
pub mod plan;
pub mod program;
pub mod progress;
pub mod run;
pub mod store;
pub mod table;
pub mod threads;

pub use build::Build;
pub use config::{Diagnostics, GridInput, Mistake};
pub use design::{Design, Distribution};
pub use engine::{Engine, Evaluator, RowLookup, RowSink, RowSource, RunContext};
pub use estimate::Estimate;
pub use execution::{Execution, ExecutionArgs};
pub use exit::{Error, Exit, print, show, tell};
pub use interrupt::{Interrupt, check_random_numbers, survive_file_size_limits};
pub use model::{About, GridTable, ModelFile};
pub use plan::{Axis, AxisTolerance, AxisValues, Plan, Reliability};
pub use program::program;
pub use progress::{Progress, ProgressMode, format_duration};
pub use store::{Job, StoreError};
pub use table::Table;
pub use threads::{Environment, ThreadsError};

pub use sweep_results::nearest_name;

use std::fmt;

use serde_json::{Map, Value};
use sweep_parameter::{Parameter, UnknownParameter};

use config::{Draft, Keys, plan_checks, schema};
use store::Layout;

/// A parameter of a model.
pub type ModelParameter<M> = Parameter<<M as Model>::Handle>;

/// A model that can be swept. A value holds the model's parameters as a grid file sets them; the
/// points of a plan differ from it in the values of the axes only.
///
/// A model writes five functions: [`blank`](Model::blank), [`parameters`](Model::parameters),
/// [`write`](Model::write), [`layout`](Model::layout) and [`engine`](Model::engine), whose
/// [`Evaluator`] has one more. The other functions have defaults.
pub trait Model: Clone + PartialEq + fmt::Debug + Send + Sync + Sized + 'static {
    /// The type of a parameter's handle, by which the model writes the parameter's value.
    type Handle: Clone + fmt::Debug + Send + Sync + 'static;

    /// The facts about the model that are the same for every plan.
    const ABOUT: About;

    /// Returns the model with its default values.
    fn blank() -> Self;

    /// Returns every parameter, with its value.
    fn parameters(&self) -> Vec<ModelParameter<Self>>;

    /// Returns the parameter of a name, with its value.
    ///
    /// # Errors
    /// An unknown name, with the reason.
    fn find(&self, name: &str) -> Result<ModelParameter<Self>, UnknownParameter> {
        let matching_parameter =
            self.parameters().into_iter().find(|parameter| parameter.name == name);
        matching_parameter.ok_or_else(UnknownParameter::in_no_model)
    }

    /// Writes a parameter's value, which is in its range. The parameter is no edge of the window.
    fn write(&mut self, parameter: &Self::Handle, value: f64);

    /// Walks over the model's keys in a table of the grid file; `input` is the grid that is read.
    /// The engine itself walks over `name`, `[set]`, `[time]`, `[integrator]`, `[design]`,
    /// `[[axis]]` and its own keys of `[reliability]`.
    fn walk(&mut self, _table: GridTable, _: &mut Keys<'_>, _input: Option<&GridInput<Self>>) {}

    /// Checks the plan as a whole, after every value is set.
    fn check(draft: &Draft<'_, Self>) {
        plan_checks::check_windows(draft);
    }

    /// Returns the schema of `[set]`.
    fn schema_of_set() -> Value {
        schema::set_schema(&Self::blank().parameters(), Map::new())
    }

    /// Returns the columns of a result.
    fn layout(plan: &Plan<Self>) -> Layout;

    /// Creates the engine that computes the rows of a plan.
    ///
    /// With `only`, the caller reads a single column, and the cells of other columns are arbitrary.
    /// If that column is a ratio, it has to be on the correct side of the plan's limit, but
    /// accurate only near the limit.
    ///
    /// # Errors
    /// A plan that has no engine.
    fn engine<'a>(plan: &'a Plan<Self>, only: Option<&str>) -> Result<Engine<'a>, Error>;

    /// Estimates the time and memory of a run on a number of threads; by default from the rows of
    /// a few points.
    ///
    /// # Errors
    /// The errors of [`Self::engine`].
    fn estimate(plan: &Plan<Self>, threads: usize) -> Result<Estimate, Error> {
        Estimate::from_first_rows(plan, threads)
    }

    /// Returns plans of the same points whose rows have more columns: one plan for each kind of
    /// measurement that a plan can have, and then one with all kinds.
    fn variants(_: &Plan<Self>) -> Vec<Plan<Self>> {
        Vec::new()
    }
}

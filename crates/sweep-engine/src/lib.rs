//! Sweeps a [`Model`] over a grid: from a grid file to a result file. Nothing here knows which
//! model it is.
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
pub mod effort;
pub mod estimate;
pub mod evaluator;
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
pub mod swept;
pub mod table;
pub mod threads;
pub mod watch;

pub use build::Build;
pub use config::{Diagnostics, GridInput, Mistake, Read};
pub use design::{Design, Distribution};
pub use effort::{Effort, EffortArgs};
pub use estimate::Estimate;
pub use exit::{Error, Exit, print, show, tell};
pub use interrupt::{Interrupt, expect_random_numbers, survive_file_size_limits};
pub use model::Model;
pub use plan::{Axis, AxisValues, Plan, Reliability, Scenario};
pub use program::program;
pub use progress::{Progress, ProgressMode, duration};
pub use store::{Job, Rows, StoreError};
pub use swept::{Listed, Swept};
pub use table::Table;
pub use threads::{Environment, ThreadsError};
pub use watch::{Engine, RowLookup, RowSink, RowSource, RunContext};

pub use sweep_results::nearest;

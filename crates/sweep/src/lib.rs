//! Sweeps over washing machines, from a grid file to a result file. The program `sweep` is the
//! command line of this library.
//!
//! * `config` reads a grid file into a [`Plan`], or reports all mistakes in it. `method` is the
//!   table of the methods of integration.
//! * `engine` integrates both models of `washer_model` at points of a plan, and `columns` makes
//!   rows of the outcomes. A [`MapRow`] is a row in memory. `estimate` predicts the cost of a run.
//! * [`sweep_engine`] computes the points of a plan on all cores, stores finished rows, traces
//!   boundaries and runs studies; [`sweep_files`] reads and writes files. `identity` is the version
//!   that decides which builds write the same bytes.
//! * `trace` computes time histories, `stability` periodic responses, `dwell` attractors; `explain`
//!   finds the cause of a verdict, `fit` estimates parameters from measurements. [`washer_plot`]
//!   draws the files of all of these.
//! * `library` has the work of the commands as functions: a [`PlanEvaluator`] evaluates tables of
//!   points, a [`MemoryTable`] is a result in memory.
//! * `commands` is the command line.
//!
//! The crate's public items are those that the program, the fuzzer and the examples use.
//!
//! # Example
//!
//! A point of the grid of the paper's Fig. 12, in its first two seconds.
//!
//! ```
//! use std::path::Path;
//! use sweep::{Interrupt, ModelEngine, Plan, RunContext};
//!
//! let grid = Path::new("../../sweeps/fig12_reference.toml");
//! let plan = sweep::load(grid, &[])?;
//! assert_eq!((plan.axes.len(), plan.points()), (2, 39 * 33));
//!
//! let plan = Plan { end_s: 2.0, window_s: [1.0, 2.0], ..plan };
//! let interrupt = Interrupt::new();
//! let context = RunContext::new(&interrupt);
//! let rows = ModelEngine::new(&plan)?.evaluate_points(&[vec![0.4, 100.0]], &context);
//! assert_eq!(rows.unwrap()[0].flag("reliable"), Some(true));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod columns;
mod commands;
mod config;
mod dwell;
mod engine;
mod estimate;
mod explain;
mod fit;
mod identity;
mod library;
mod live;
mod map_row;
mod method;
mod model;
mod notes;
mod places;
mod plan;
mod speeds;
mod stability;
#[cfg(test)]
mod tests;
mod trace;
mod washer;

pub use commands::WasherCli;
pub use config::{Diagnostics, Mistake, WasherGridInput, load};
pub use dwell::{AttractorSearch, Carry};
pub use engine::ModelEngine;
pub use fit::FitOptions;
pub use identity::{NUMERICS_VERSION, VERSION};
pub use library::{
    BoundaryOptions, CommandReport, EvaluationTask, Execution, FileRunEnd, MemoryTable,
    PlanEvaluator, PointTable, TraceOptions, explain_point, find_boundary, find_modes, fit_tables,
    held_speeds_task, list_parameters, optimise_study, trace_point,
};
pub use map_row::MapRow;
pub use method::{Integrator, rk4, rk4_mass_scaled};
pub use model::Washer;
pub use plan::{Plan, point_input};
pub use sweep_engine::config::section::format_count;
pub use sweep_engine::progress::ProgressMode;
pub use sweep_engine::run::{RunEnd, RunOptions, run};
pub use sweep_engine::store::{
    Job, OpenOptions, OpenOutcome, OpenRun, RunStage, Shard, ShardRequest, StoreError, read_status,
};
pub use sweep_engine::{
    Error, Exit, Interrupt, RunContext, check_random_numbers, survive_file_size_limits, tell,
};
pub use trace::TraceExtras;
pub use washer_model::StartRule;
pub use washer_row::{MIN_SPEED_SCALE_M_PER_S, MethodKind, Verdict};

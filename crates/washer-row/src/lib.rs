//! One row of a map: both models at a point, in finer and finer runs until two agree, and the
//! numbers that the row takes from them.
//!
//! Nothing here knows of grids, files or threads. `sweep` takes many rows through lanes at a time,
//! a live page (`washer-live`) one. Both use this rule, so they get the same bits.
//!
//! * [`RefinementLevels`] holds one model's levels, coarsest first; [`runs`] integrates
//!   trajectories at one of them.
//! * [`RowRefinement`] is a row under refinement: it asks for runs, takes them, and estimates the
//!   error by the rule of `error_control.rs`.
//! * An [`Outcome`] is the result: both models' amplitudes and [`Metric`]s. A [`Verdict`] compares
//!   them.

mod error_control;
mod levels;
mod measures;
mod outcome;
mod refinement;
mod run;
mod separation;
mod verdict;

pub use error_control::{MAX_ADAPTIVE_STEPS, refinement_levels};
pub use levels::{RefinementLevel, RefinementLevels};
pub use measures::{CREEPING_M_PER_S, Criterion, Facts, Measured, Measures, Metric, Part};
pub use outcome::{Deviations, Dwelt, GrowingMode, Growth, Outcome, Status, Trajectory};
pub use refinement::{Demand, Next, RefinementRule, RowRefinement};
pub use run::{LevelRun, Rule, runs};
pub use verdict::{ROW_STATUSES, Verdict, row_status};
pub use washer_model::Level;

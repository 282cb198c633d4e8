//! One row of a map: both models at a point, in finer and finer runs until two agree, and the
//! numbers that the row takes from them.
//!
//! Nothing here knows of grids, files or threads. `sweep` takes many rows through lanes at a time,
//! a live page (`washer-live`) one. Both use this rule, so they get the same bits.
//!
//! * A [`Ladder`] holds one model's rungs, [`runs`] integrates trajectories by one of them.
//! * [`Climbs`] is a row in the making. It says which runs it needs next, takes them, and estimates
//!   the error left.
//! * An [`Outcome`] is the result: both models' amplitudes and [`Metric`]s. A [`Verdict`] compares
//!   them.

mod climb;
mod convergence;
mod ladder;
mod measures;
mod outcome;
mod run;
mod twin;
mod verdict;

pub use climb::{Climbs, Demand, Next, Terms};
pub use convergence::Convergence;
pub use ladder::{Ladder, Rung};
pub use measures::{CREEPING_M_PER_S, Criterion, Facts, Floor, Measured, Measures, Metric, Part};
pub use outcome::{Deviations, Dwelt, GrowingMode, Growth, Outcome, Status, Trajectory};
pub use run::{Rule, RungRun, runs};
pub use verdict::{ROW_STATUSES, Verdict, row_status};
pub use washer_model::Level;

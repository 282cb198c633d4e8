//! One row of a map: both models at a point, by finer and finer runs until two agree, and what is
//! taken from them.
//!
//! Nothing here knows of grids, files or threads. `sweep` takes rows through lanes many at a time,
//! a live page (`washer-live`) one by one, and both by this rule, so that they get the same bits.
//!
//! * A [`Ladder`] holds one model's rungs, [`runs`] integrates trajectories by one of them.
//! * [`Climbs`] is a row in the making. It says which runs it needs next, takes them, and reckons
//!   what error is left.
//! * An [`Outcome`] is what came of it: both models' amplitudes and [`Metric`]s. A [`Verdict`]
//!   compares them.

mod climb;
mod convergence;
mod ladder;
mod level;
mod measures;
mod outcome;
mod run;
mod verdict;

pub use climb::{Climbs, Demand, MODELS, Next};
pub use convergence::Convergence;
pub use ladder::{Ladder, Rung};
pub use level::Level;
pub use measures::{Criterion, Measured, Measures, Metric};
pub use outcome::{Deviations, GrowingMode, Growth, Outcome, Status, Trajectory};
pub use run::{Rule, RungRun, runs};
pub use verdict::{ROW_STATUSES, Verdict, row_status};

//! Computes a row of a map: both models are integrated at a point, at finer and finer levels until
//! two agree, and the row takes its numbers from these trajectories.
//!
//! The crate does not depend on grids, files or threads. `sweep` computes many rows at a time in
//! lanes, a live page (`washer-live`) computes a single one. Both use the rules of this crate, so
//! that their rows have the same bits.
//!
//! * [`RefinementLevels`] holds one model's levels, coarsest first; [`integrate_points`] integrates
//!   trajectories at one of them.
//! * [`RowRefinement`] is a row under refinement: it requests trajectories, compares them with the
//!   level before, and estimates the error by the rule of `error_control.rs`.
//! * An [`Outcome`] is the result: both models' amplitudes and [`Metric`]s. Its [`Verdict`]
//!   compares them.

#![allow(missing_docs, reason = "a name that is clear needs no comment")]

mod error_control;
mod levels;
mod measures;
mod metrics;
mod outcome;
mod refinement;
mod run;
mod separation;
mod verdict;

pub use error_control::{MAX_ADAPTIVE_STEPS, refinement_levels};
pub use levels::RefinementLevels;
pub use measures::{Criterion, MIN_SPEED_SCALE_M_PER_S, Measures, MetricColumn};
pub use metrics::{Metric, MetricProperties, MetricSource, PartKind};
pub use outcome::{
    Deviations, DwellPeaks, GrowingMode, Growth, Outcome, ROW_STATUSES, Status, Trajectory,
};
pub use refinement::{NextStep, OutcomePurpose, RefinementRule, RowRefinement};
pub use run::{LevelRun, RowRule, integrate_points};
pub use sweep_parameter::Verdict;
pub use washer_model::MethodKind;

//! Queries of finished results, from the files alone.
//!
//! * [`Condition`] is an expression over a file's columns. [`check_condition`] returns the rows
//!   that violate it, [`top_rows`] the rows that come first in an order.
//! * [`Goal`] is an objective or a constraint of a search, over rows in memory.
//! * [`compare`] returns the differences between two files.
//! * [`export`] writes a file's rows in another format.
//!
//! The crate knows no model. [`sweep_files`] opens every file and refuses damaged ones.

mod compare;
mod condition;
mod error;
mod export;
mod goal;
mod nearest;
mod parse;
mod require;
#[cfg(test)]
mod sample;
mod top;

pub use compare::{
    BoundaryCrossing, BoundaryShift, ColumnChange, ColumnRow, Comparison, Flip, MAX_WORST_ROWS,
    PlanChange, SharedRow, compare, plan_changes,
};
pub use condition::{Condition, ExpressionError};
pub use error::ResultsError;
pub use export::{ExportFormat, export};
pub use goal::{Goal, Slack};
pub use nearest::nearest_name;
pub use require::{ConditionCheck, ViolatingRow, check_condition};
pub use sweep_files::{Cell, CellKind, Column, ResultTable, columns, ratio_limits};
pub use top::top_rows;

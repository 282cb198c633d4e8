//! Questions to finished results, from the files alone: whether conditions hold, which rows are
//! extreme, what differs between two files. It also writes the rows in other formats.
//!
//! * [`Condition`] is an expression over a file's columns; [`check`] says which rows keep it,
//!   [`top`] which rows come first in an order.
//! * [`compare`] says what differs between two files, [`export`] writes one in another format.
//!
//! Nothing here knows the model; [`sweep_files`] opens every file, so a damaged one is refused.

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
    ColumnChange, Comparison, Crossing, Flip, Moved, PlanChange, SharedRow, compare,
};
pub use condition::{Condition, Mistake};
pub use error::ResultsError;
pub use export::{Format, export};
pub use goal::Goal;
pub use nearest::nearest;
pub use require::{Checked, Offender, check};
pub use sweep_files::{Cell, CellKind, Column, ResultTable, columns, ratio_limits};
pub use top::top;

//! The commands' work as functions with results in memory, for programs.
//!
//! Functions that may take long take an [`Interrupt`](crate::Interrupt). Raised from another
//! thread, it ends the work in a fraction of a second.

mod evaluate;
mod explain;
mod fit;
pub(crate) mod modes;
mod points;
mod result;
mod run;
mod search;
mod stability;
mod trace;

pub use evaluate::Evaluator;
pub use explain::{Explained, explain_point};
pub use fit::fit_tables;
pub use modes::find_modes;
pub use points::PointTable;
pub use result::MemoryTable;
pub use run::{RanToFile, Task};
pub use search::{BoundaryOptions, find_boundary, optimise_study};
pub use stability::held;
pub use trace::{TraceOptions, trace_point};

use sweep_engine::commands::parameters::as_json;
pub use sweep_engine::effort::Effort;
use sweep_engine::{Error, Swept as _};

use crate::model::Washer;
use crate::plan::Plan;
use crate::speeds::MOST_SPEEDS;

/// Every number that can be set or swept as a JSON array of objects: `name`, `value`, `unit`,
/// `description`, `range` and `source`. The values are the plan's, before its axes; without a plan
/// those of the built-in machine.
pub fn list_parameters(plan: Option<&Plan>) -> String {
    as_json(&Washer::listed(plan))
}

/// Speeds that make no sense.
fn refused_speeds(count: usize, expected: String) -> Error {
    Error::option("speeds", format!("with {count} values"), expected)
}

/// Refuses speeds (rpm) that do not rise, fewer than `least` of them or too many, and any that is
/// not `allowed`, which are those `said`.
fn check_speeds(
    speeds_rpm: &[f64],
    least: usize,
    allowed: fn(f64) -> bool,
    said: &str,
) -> Result<(), Error> {
    let count = speeds_rpm.len();
    let rise = speeds_rpm.windows(2).all(|pair| pair[0] < pair[1]);
    let are_speeds = speeds_rpm.iter().all(|speed| speed.is_finite() && allowed(*speed));
    if rise && are_speeds && count >= least && count as f64 <= MOST_SPEEDS + 1.0 {
        return Ok(());
    }
    let expected = format!(
        "from {least} to {MOST_SPEEDS} finite speeds in rpm{said}, each above the one before"
    );
    Err(refused_speeds(count, expected))
}

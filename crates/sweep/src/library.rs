//! The computations of the commands as functions that return results in memory, for programs.
//!
//! Functions that may take long have an [`Interrupt`](crate::Interrupt) as an argument. If another
//! thread raises it, the work ends within a fraction of a second.

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

pub use evaluate::PlanEvaluator;
pub use explain::{CommandReport, explain_point};
pub use fit::fit_tables;
pub use modes::find_modes;
pub use points::PointTable;
pub use result::MemoryTable;
pub use run::{EvaluationTask, FileRunEnd};
pub use search::{BoundaryOptions, find_boundary, optimise_study};
pub use stability::held_speeds_task;
pub use trace::{TraceOptions, trace_point};

use sweep_engine::Error;
use sweep_engine::commands::parameters::{self, format_json};
pub use sweep_engine::execution::Execution;

use crate::model::Washer;
use crate::plan::Plan;
use crate::speeds::MAX_SPEEDS;

/// Returns all parameters as a JSON array of objects with `name`, `value`, `unit`, `description`,
/// `range` and `source`. The values are those of the plan without its axes, or those of the
/// built-in machine.
pub fn list_parameters(plan: Option<&Plan>) -> String {
    format_json(&parameters::list_parameters::<Washer>(plan))
}

/// Returns the error for a list of speeds that is refused.
fn speeds_error(count: usize, expected: String) -> Error {
    Error::option("speeds", format!("with {count} values"), expected)
}

/// Checks that speeds (rpm) increase, that there are at least `min_count` and at most
/// [`MAX_SPEEDS`], and that each `is_allowed`, which `condition` describes.
fn check_speeds(
    speeds_rpm: &[f64],
    min_count: usize,
    is_allowed: fn(f64) -> bool,
    condition: &str,
) -> Result<(), Error> {
    let count = speeds_rpm.len();
    let are_increasing = speeds_rpm.windows(2).all(|pair| pair[0] < pair[1]);
    let are_speeds = speeds_rpm.iter().all(|speed| speed.is_finite() && is_allowed(*speed));
    if are_increasing && are_speeds && count >= min_count && count as f64 <= MAX_SPEEDS + 1.0 {
        return Ok(());
    }
    let expected = format!(
        "from {min_count} to {MAX_SPEEDS} finite speeds in rpm{condition}, each above the one \
         before"
    );
    Err(speeds_error(count, expected))
}

//! The parameter table with values, for programs.

use sweep_engine::Swept as _;
use sweep_engine::commands::parameters::as_json;

use crate::model::Washer;
use crate::plan::Plan;

/// Every number that can be set or swept as a JSON array of objects: `name`, `value`, `unit`,
/// `description`, `range` and `source`. The values are the plan's, before its axes; without a plan
/// those of the built-in machine.
pub fn list_parameters(plan: Option<&Plan>) -> String {
    as_json(&Washer::listed(plan))
}

//! The differences between two plans.

use std::fmt;

use serde_json::Value;

use crate::config::section::truncate;
use sweep_files::{Step, visit_leaves};

/// A value that differs between two plans.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlanDifference {
    /// The JSON pointer to the value in the plan.
    pub pointer: String,
    /// The value in the older plan; `None` if it has none.
    pub older_value: Option<String>,
    /// The value in the present plan; `None` if it has none.
    pub present_value: Option<String>,
}

impl fmt::Display for PlanDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value_or_absent =
            |value: &Option<String>| value.clone().unwrap_or_else(|| "absent".into());
        write!(
            f,
            "{}: was {}, is {}",
            self.pointer,
            value_or_absent(&self.older_value),
            value_or_absent(&self.present_value)
        )
    }
}

/// Returns every leaf at which two JSON values differ.
pub(super) fn find_differences(older: &Value, present: &Value) -> Vec<PlanDifference> {
    let mut differences = Vec::new();
    visit_leaves([Some(older), Some(present)], |_, _| true, &mut Vec::new(), &mut |path,
                                                                                   [
        older,
        present,
    ]| {
        if older != present {
            let format_pointer_step = |step: &Step<'_>| match step {
                Step::Name(name) => format!("/{}", name.replace('~', "~0").replace('/', "~1")),
                Step::Index(index) => format!("/{index}"),
            };
            let pointer = path.iter().map(format_pointer_step).collect();
            differences.push(PlanDifference {
                pointer,
                older_value: older.map(format_value),
                present_value: present.map(format_value),
            });
        }
    });
    differences
}

/// Formats a value on one line, and shortens it if it is long.
fn format_value(value: &Value) -> String {
    truncate(&value.to_string(), 60)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn differences_name_every_leaf_by_pointer() {
        let older = json!({ "axes": [{ "count": 39 }, { "count": 33 }], "gone": 1, "a/b": [1, 2] });
        let present =
            json!({ "axes": [{ "count": 40 }, { "count": 33 }], "new": true, "a/b": [1] });
        let lines: Vec<String> =
            find_differences(&older, &present).iter().map(ToString::to_string).collect();
        assert_eq!(
            lines,
            [
                "/a~1b/1: was 2, is absent",
                "/axes/0/count: was 39, is 40",
                "/gone: was 1, is absent",
                "/new: was absent, is true",
            ]
        );
        assert!(find_differences(&older, &older).is_empty());
    }

    #[test]
    fn long_values_are_cut_on_a_character() {
        let older = json!({ "name": "ä".repeat(100) });
        let formatted = find_differences(&older, &json!({}))[0].older_value.clone().unwrap();
        assert!(formatted.ends_with("...") && formatted.chars().count() == 63, "{formatted}");
    }
}

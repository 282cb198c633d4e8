//! The differences between two plans.

use std::fmt;

use serde_json::Value;

use crate::config::section::cut;
use sweep_files::{Step, leaves};

/// A value that differs between two plans.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlanDifference {
    /// The JSON pointer to the value in the plan.
    pub pointer: String,
    /// The value in the older plan; `None` if it has none.
    pub was: Option<String>,
    /// The value in the present plan; `None` if it has none.
    pub is: Option<String>,
}

impl fmt::Display for PlanDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let side = |value: &Option<String>| value.clone().unwrap_or_else(|| "absent".into());
        write!(f, "{}: was {}, is {}", self.pointer, side(&self.was), side(&self.is))
    }
}

/// Returns every leaf at which two JSON values differ.
pub(super) fn differences(was: &Value, is: &Value) -> Vec<PlanDifference> {
    let mut found = Vec::new();
    leaves([Some(was), Some(is)], |_, _| true, &mut Vec::new(), &mut |path, [was, is]| {
        if was != is {
            let step = |step: &Step<'_>| match step {
                Step::Name(name) => format!("/{}", name.replace('~', "~0").replace('/', "~1")),
                Step::Place(place) => format!("/{place}"),
            };
            let pointer = path.iter().map(step).collect();
            found.push(PlanDifference { pointer, was: was.map(brief), is: is.map(brief) });
        }
    });
    found
}

/// Returns a value on one line, cut if it is long.
fn brief(value: &Value) -> String {
    cut(&value.to_string(), 60)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn differences_name_every_leaf_by_pointer() {
        let was = json!({ "axes": [{ "count": 39 }, { "count": 33 }], "gone": 1, "a/b": [1, 2] });
        let is = json!({ "axes": [{ "count": 40 }, { "count": 33 }], "new": true, "a/b": [1] });
        let lines: Vec<String> = differences(&was, &is).iter().map(ToString::to_string).collect();
        assert_eq!(
            lines,
            [
                "/a~1b/1: was 2, is absent",
                "/axes/0/count: was 39, is 40",
                "/gone: was 1, is absent",
                "/new: was absent, is true",
            ]
        );
        assert!(differences(&was, &was).is_empty());
    }

    #[test]
    fn long_values_are_cut_on_a_character() {
        let was = json!({ "name": "ä".repeat(100) });
        let shown = differences(&was, &json!({}))[0].was.clone().unwrap();
        assert!(shown.ends_with("...") && shown.chars().count() == 63, "{shown}");
    }
}

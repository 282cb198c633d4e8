//! Comparison of the plans and versions of two files.

use serde::Serialize;
use serde_json::{Map, Value};
use sweep_files::{ParquetFile, dotted_path, key, visit_leaves};

/// A value that differs between the plans of two files.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlanChange {
    /// The dotted path: `machine.body.mass_kg`.
    pub path: String,
    /// The value in the first file, null where the file has none.
    pub first: Value,
    /// The value in the second file, null where the file has none.
    pub second: Value,
}

/// Returns a file's plan and versions, and for a trace or modes the settings of the request, as one
/// JSON object.
fn provenance(file: &ParquetFile) -> Value {
    let read_metadata = |name: &str| {
        let text = file.value(name)?;
        Some(serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.to_owned())))
    };
    let mut provenance = match read_metadata(key::PLAN) {
        Some(Value::Object(plan)) => plan,
        _ => Map::new(),
    };
    for (name, key) in [
        ("version", key::VERSION),
        ("numerics", key::NUMERICS),
        ("trace", key::TRACE),
        ("modes", key::MODES),
    ] {
        provenance.extend(read_metadata(key).map(|value| (name.to_owned(), value)));
    }
    Value::Object(provenance)
}

/// Returns every value that differs between the plans of two files.
pub(super) fn compare_plans(first: &ParquetFile, second: &ParquetFile) -> Vec<PlanChange> {
    plan_changes(&provenance(first), &provenance(second))
}

/// Returns every value that differs between two plans. Lists of different lengths, and lists of
/// numbers, are one value each.
pub fn plan_changes(first_plan: &Value, second_plan: &Value) -> Vec<PlanChange> {
    let is_nested_list = |first_list: &[Value], second_list: &[Value]| {
        first_list.len() == second_list.len() && first_list.iter().any(Value::is_object)
    };
    let mut changes = Vec::new();
    visit_leaves(
        [Some(first_plan), Some(second_plan)],
        is_nested_list,
        &mut Vec::new(),
        &mut |path, values| {
            let [first, second] = values.map(|value| value.cloned().unwrap_or_default());
            if first != second {
                changes.push(PlanChange { path: dotted_path(path), first, second });
            }
        },
    );
    changes
}

/// Returns whether the points of two plans differ only by the nominal values of axes with
/// tolerances.
pub(super) fn differs_in_nominal_values(
    first_plan: Option<&Value>,
    second_plan: Option<&Value>,
) -> bool {
    let Some((first_plan, second_plan)) = first_plan.zip(second_plan) else { return false };
    first_plan["axis"] != second_plan["axis"]
        && first_plan["design"] == second_plan["design"]
        && without_toleranced_numbers(&first_plan["axis"])
            == without_toleranced_numbers(&second_plan["axis"])
}

/// Returns the axes of a plan without the numbers that a tolerance and its nominal value determine.
fn without_toleranced_numbers(axes: &Value) -> Value {
    let mut axes = axes.clone();
    for axis in axes.as_array_mut().into_iter().flatten() {
        if axis.get("tolerance").is_none() {
            continue;
        }
        for key in ["range", "distribution"] {
            if let Some(values) = axis.get_mut(key).and_then(Value::as_object_mut) {
                let dependent_keys = ["from", "to", "mean", "sd", "median", "sigma"];
                values.retain(|key, _| !dependent_keys.contains(&key.as_str()));
            }
        }
    }
    axes
}

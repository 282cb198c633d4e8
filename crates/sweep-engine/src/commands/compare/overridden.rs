//! The numbers that differ between two plans and that an axis of both overrides.

use serde_json::Value;

use crate::{GridInput, Model, Plan};
use sweep_results::{Comparison, PlanChange, ResultTable, plan_changes};

/// The differences between two plans that have no effect, because an axis of both files sets these
/// numbers.
pub(super) struct OverriddenNumbers {
    /// The name of the axis.
    pub(super) axis: String,
    /// The dotted paths of the differences: `machine.body.mass_kg`.
    pub(super) paths: Vec<String>,
}

/// Returns the differences of the plans that an axis of both files overrides. An axis with a
/// tolerance overrides nothing, because its values follow from the plan's number.
pub(super) fn find_overridden<M: Model>(
    tables: &[ResultTable; 2],
    comparison: &Comparison,
) -> Vec<OverriddenNumbers> {
    let plans = tables.each_ref().map(|table| table.plan.as_ref());
    let [Some(first), Some(second)] = plans else { return Vec::new() };
    let [Some(first_model), Some(second_model)] = [first, second].map(read_plan_without_axes::<M>)
    else {
        return Vec::new();
    };
    let changes_before = plan_changes(&first_model.to_json(), &second_model.to_json());
    let second_axes = overriding_axes(second);
    let shared_axes = overriding_axes(first).into_iter().filter(|name| second_axes.contains(name));
    let overridden_by_axis = shared_axes.filter_map(|name| {
        // Both plans get the same number from the axis, so that any number serves here.
        let value = first_model.model.find(name).ok()?.value.unwrap_or(1.0);
        let [first, second] =
            [&first_model, &second_model].map(|plan| plan_with_number(plan, name, value));
        let changes_after = plan_changes(&first?.to_json(), &second?.to_json());
        let contains_path =
            |changes: &[PlanChange], path: &str| changes.iter().any(|change| change.path == path);
        let changed_paths = comparison.plan.iter().map(|change| &change.path);
        let paths: Vec<String> = changed_paths
            .filter(|path| {
                contains_path(&changes_before, path) && !contains_path(&changes_after, path)
            })
            .cloned()
            .collect();
        (!paths.is_empty()).then(|| OverriddenNumbers { axis: name.to_owned(), paths })
    });
    overridden_by_axis.collect()
}

/// Reads the plan of a result, without its axes; `None` if this version does not read it.
fn read_plan_without_axes<M: Model>(plan: &Value) -> Option<Plan<M>> {
    let mut plan = plan.clone();
    plan.as_object_mut()?.remove("axis");
    GridInput::from_plan("plan", &plan).load().ok()
}

/// Returns the names of a plan's axes without a tolerance.
fn overriding_axes(plan: &Value) -> Vec<&str> {
    let axes = plan["axis"].as_array().into_iter().flatten();
    let axes = axes.filter(|axis| axis.get("tolerance").is_none());
    axes.filter_map(|axis| axis["parameter"].as_str()).collect()
}

/// Returns a plan with another value of a parameter.
fn plan_with_number<M: Model>(plan: &Plan<M>, name: &str, value: f64) -> Option<Plan<M>> {
    let parameter = plan.model.find(name).ok()?;
    let mut plan = plan.clone();
    plan.write(&parameter, value);
    Some(plan)
}

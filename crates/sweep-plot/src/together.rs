//! Checks that the plans of files that are drawn together agree in everything that the figure
//! shows.
//!
//! Otherwise a figure of two machines would look like one of a single machine. Other differences,
//! such as a name or the levels of an integrator, do not matter. A file without a plan is not
//! checked.

use std::path::Path;

use serde_json::Value;
use sweep_files::{Step, dotted_path, key, visit_leaves};

use crate::error::{PlotError, Result};
use crate::read::{FigureFile, ModelKinds};

/// Returns the parts of a plan on which time histories and their extremes depend.
pub(crate) fn history_sections(model_kinds: ModelKinds) -> Vec<&'static str> {
    [model_kinds.history_sections, &["time.end_s"]].concat()
}

/// Returns the parts of a plan on which ratios depend.
pub(crate) fn ratio_sections(model_kinds: ModelKinds) -> Vec<&'static str> {
    [model_kinds.history_sections, &["time", "reliability.channels", "reliability.criterion"]]
        .concat()
}

/// Parameters by name with their values.
pub type NamedPoint = Vec<(String, f64)>;

/// Returns the point that a trace belongs to, by its metadata.
pub fn point_of_trace(source: &FigureFile) -> NamedPoint {
    let point_values = source.find_metadata("at").and_then(Value::as_object).into_iter().flatten();
    point_values.filter_map(|(name, value)| Some((name.clone(), value.as_f64()?))).collect()
}

/// Returns the differences of the plans of two files, each at a point: path and both values.
pub fn plan_differences(files: [(&FigureFile, &NamedPoint); 2], sections: &[&str]) -> Vec<String> {
    let plans = files.map(|(source, _)| source.find_metadata(key::PLAN));
    let [Some(first), Some(second)] = plans else { return Vec::new() };
    let mut differences = Vec::new();
    for section in sections {
        let path: Vec<Step<'_>> = section.split('.').map(Step::Name).collect();
        let pointer = format!("/{}", section.replace('.', "/"));
        let (first_key, _) = section.split_once('.').unwrap_or((section, ""));
        if [first, second].iter().all(|plan| plan.get(first_key).is_some()) {
            let values_by_file = [first, second].map(|plan| plan.pointer(&pointer));
            collect_differences(
                values_by_file,
                files.map(|(_, point)| point),
                path,
                &mut differences,
            );
        }
    }
    differences
}

/// Rejects two files whose plans differ.
///
/// # Errors
/// [`PlotError::Unfit`], which lists the differences.
pub fn check_agreement(
    option: &str,
    path: &Path,
    files: [(&FigureFile, &NamedPoint); 2],
    sections: &[&str],
) -> Result<()> {
    let differences = plan_differences(files, sections);
    if differences.is_empty() {
        return Ok(());
    }
    Err(PlotError::Unfit(format!(
        "`{option}`: {} is of another plan than {}: {}",
        path.display(),
        files[0].0.path.display(),
        join_first(&differences, 3)
    )))
}

/// Joins the first `max_count` texts, and appends the number of further ones.
pub fn join_first(texts: &[String], max_count: usize) -> String {
    let omitted_count = texts.len().saturating_sub(max_count);
    let first_texts = texts[..texts.len() - omitted_count].join(", ");
    if omitted_count > 0 { format!("{first_texts} and {omitted_count} more") } else { first_texts }
}

/// Collects the differences of two values of a plan from this path on.
fn collect_differences<'a>(
    values_by_file: [Option<&'a Value>; 2],
    points: [&NamedPoint; 2],
    mut path: Vec<Step<'a>>,
    differences: &mut Vec<String>,
) {
    let have_same_length = |first: &[Value], second: &[Value]| first.len() == second.len();
    visit_leaves(values_by_file, have_same_length, &mut path, &mut |path, values| {
        let [first, second] = [0, 1].map(|side| value_at_point(values[side], points[side], path));
        if first != second && !is_parameter_of_point([&first, &second], points, path) {
            let [first, second] = [first, second].map(|value| match value {
                Value::Null => "none".to_owned(),
                value => value.to_string(),
            });
            // The elements of a list, such as springs, give one difference together.
            let key_names = path.iter().copied().filter(|step| matches!(step, Step::Name(_)));
            let phrase =
                format!("{} {first} and {second}", dotted_path(&key_names.collect::<Vec<_>>()));
            if !differences.contains(&phrase) {
                differences.push(phrase);
            }
        }
    });
}

/// Returns the value at a path of the plan, or the value of the point that replaces it.
fn value_at_point(value: Option<&Value>, point: &NamedPoint, path: &[Step<'_>]) -> Value {
    let parameter = point.iter().find(|(name, _)| is_set_by(name, path));
    parameter.map_or_else(|| value.cloned().unwrap_or_default(), |(_, value)| (*value).into())
}

/// Whether a parameter sets the value at this path: `rotor_mass_kg` sets `machine.rotor.mass_kg`,
/// `damping_n_s_per_m` the damping of every damper, and `damper_2_damping_n_s_per_m` that of one
/// damper.
fn is_set_by(parameter: &str, path: &[Step<'_>]) -> bool {
    let inner_path = if path[0] == Step::Name("machine") { &path[1..] } else { path };
    let (Some(last_key), Some(Step::Name(first_key))) = (inner_path.last(), inner_path.first())
    else {
        return false;
    };
    let last_key = last_key.to_string();
    let singular_key = first_key.strip_suffix('s').unwrap_or(first_key);
    let index = inner_path.get(1).filter(|index| matches!(index, Step::Index(_)));
    parameter == last_key
        || parameter == format!("{singular_key}_{last_key}")
        || index.is_some_and(|index| parameter == format!("{singular_key}_{index}_{last_key}"))
}

/// Whether a value is that of a parameter of the point, although its path has another name.
fn is_parameter_of_point(values: [&Value; 2], points: [&NamedPoint; 2], path: &[Step<'_>]) -> bool {
    points.into_iter().flatten().any(|(name, value)| {
        let mut words_in_name = name.split('_').filter(|token| token.len() > 1);
        let path_text = dotted_path(path);
        !is_set_by(name, path)
            && values.iter().any(|plan_value| plan_value.as_f64() == Some(*value))
            && words_in_name.next().is_some_and(|first| path_text.contains(first))
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn plan_differences_at(
        first: (&Value, &NamedPoint),
        second: (&Value, &NamedPoint),
    ) -> Vec<String> {
        let mut differences = Vec::new();
        let values_by_file = [Some(first.0), Some(second.0)];
        let points = [first.1, second.1];
        collect_differences(values_by_file, points, vec![Step::Name("machine")], &mut differences);
        differences
    }

    fn machine_plan(damping: f64, mass: f64, point_with_inertia: f64) -> Value {
        json!({
            "rotor": { "mass_kg": mass, "inertia_kg_m2": [1.0, point_with_inertia, 1.5] },
            "dampers": [{ "damping_n_s_per_m": damping }, { "damping_n_s_per_m": damping }],
        })
    }

    #[test]
    fn plans_are_compared_at_the_points_of_their_files() {
        let point_from = |list: &[(&str, f64)]| -> NamedPoint {
            list.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect()
        };
        let base_plan = machine_plan(140.0, 24.0, 1.6);
        let no_values = point_from(&[]);
        assert!(plan_differences_at((&base_plan, &no_values), (&base_plan, &no_values)).is_empty());
        let light_plan = machine_plan(140.0, 20.0, 1.6);
        let differences = plan_differences_at((&base_plan, &no_values), (&light_plan, &no_values));
        assert_eq!(differences, ["machine.rotor.mass_kg 24.0 and 20.0"]);
        // The first file is a map at a point; the second a trace, whose plan has the point's
        // values.
        let point = point_from(&[("damping_n_s_per_m", 100.0), ("rotor_mass_kg", 20.0)]);
        let run_plan = machine_plan(100.0, 20.0, 1.6);
        assert!(plan_differences_at((&base_plan, &point), (&run_plan, &no_values)).is_empty());
        assert!(plan_differences_at((&base_plan, &point), (&base_plan, &point)).is_empty());
        assert_eq!(
            plan_differences_at((&base_plan, &point), (&base_plan, &no_values)),
            [
                "machine.dampers.damping_n_s_per_m 100.0 and 140.0",
                "machine.rotor.mass_kg 20.0 and 24.0"
            ]
        );
        let one_damper = point_from(&[("damper_2_damping_n_s_per_m", 100.0)]);
        assert_eq!(
            plan_differences_at((&base_plan, &one_damper), (&base_plan, &no_values)).len(),
            1
        );
        // The path of this value has another name than the parameter.
        let point_with_inertia = point_from(&[("rotor_inertia_22_kg_m2", 1.7)]);
        let other_inertia = machine_plan(140.0, 24.0, 1.7);
        assert!(
            plan_differences_at((&base_plan, &point_with_inertia), (&other_inertia, &no_values))
                .is_empty()
        );
        assert_eq!(
            plan_differences_at(
                (&base_plan, &point_with_inertia),
                (&machine_plan(140.0, 24.0, 1.8), &no_values)
            )
            .len(),
            1
        );
        // The second plan lacks values of the first.
        let incomplete_plan = json!({ "rotor": {} });
        let differences =
            plan_differences_at((&base_plan, &no_values), (&incomplete_plan, &no_values));
        assert_eq!(differences.len(), 3, "{differences:?}");
        assert!(
            differences[1].starts_with("machine.rotor.inertia_kg_m2 [1.0")
                && differences[1].ends_with("none")
        );
    }
}

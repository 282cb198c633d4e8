//! Checks that the plans of files that are drawn together agree in everything that the figure
//! shows.
//!
//! Otherwise a figure of two machines would look like one of a single machine. Other differences,
//! such as a name or the levels of an integrator, do not matter. A file without a plan is not
//! checked.

use std::path::Path;

use serde_json::Value;
use sweep_files::{Step, dotted, key, leaves};

use crate::error::{PlotError, Result};
use crate::read::{FigureFile, ModelKinds};

/// Returns the parts of a plan on which time histories and their extremes depend.
pub(crate) fn history_parts(model_kinds: ModelKinds) -> Vec<&'static str> {
    [model_kinds.history_sections, &["time.end_s"]].concat()
}

/// Returns the parts of a plan on which ratios depend.
pub(crate) fn ratio_parts(model_kinds: ModelKinds) -> Vec<&'static str> {
    [model_kinds.history_sections, &["time", "reliability.channels", "reliability.criterion"]]
        .concat()
}

/// Parameters by name with their values.
pub type NamedPoint = Vec<(String, f64)>;

/// Returns the point that a trace belongs to, by its metadata.
pub fn at(source: &FigureFile) -> NamedPoint {
    let at = source.find("at").and_then(Value::as_object).into_iter().flatten();
    at.filter_map(|(name, value)| Some((name.clone(), value.as_f64()?))).collect()
}

/// Returns the differences of the plans of two files, each at a point: path and both values.
pub fn plan_differences(files: [(&FigureFile, &NamedPoint); 2], parts: &[&str]) -> Vec<String> {
    let plans = files.map(|(source, _)| source.find(key::PLAN));
    let [Some(first), Some(second)] = plans else { return Vec::new() };
    let mut found = Vec::new();
    for part in parts {
        let path: Vec<Step<'_>> = part.split('.').map(Step::Name).collect();
        let pointer = format!("/{}", part.replace('.', "/"));
        let (section, _) = part.split_once('.').unwrap_or((part, ""));
        if [first, second].iter().all(|plan| plan.get(section).is_some()) {
            let sides = [first, second].map(|plan| plan.pointer(&pointer));
            collect_differences(sides, files.map(|(_, at)| at), path, &mut found);
        }
    }
    found
}

/// Rejects two files whose plans differ.
///
/// # Errors
/// [`PlotError::Unfit`], which lists the differences.
pub fn check_agreement(
    option: &str,
    path: &Path,
    files: [(&FigureFile, &NamedPoint); 2],
    parts: &[&str],
) -> Result<()> {
    let found = plan_differences(files, parts);
    if found.is_empty() {
        return Ok(());
    }
    Err(PlotError::Unfit(format!(
        "`{option}`: {} is of another plan than {}: {}",
        path.display(),
        files[0].0.path.display(),
        list_first(&found, 3)
    )))
}

/// Lists the first `most` places, and the number of further ones.
pub fn list_first(places: &[String], most: usize) -> String {
    let more = places.len().saturating_sub(most);
    let first = places[..places.len() - more].join(", ");
    if more > 0 { format!("{first} and {more} more") } else { first }
}

/// Collects the differences of two values of a plan from this path on.
fn collect_differences<'a>(
    sides: [Option<&'a Value>; 2],
    points: [&NamedPoint; 2],
    mut path: Vec<Step<'a>>,
    found: &mut Vec<String>,
) {
    let opens = |first: &[Value], second: &[Value]| first.len() == second.len();
    leaves(sides, opens, &mut path, &mut |path, own| {
        let [first, second] = [0, 1].map(|side| value_at_point(own[side], points[side], path));
        if first != second && !is_of_point([&first, &second], points, path) {
            let [first, second] = [first, second].map(|value| match value {
                Value::Null => "none".to_owned(),
                value => value.to_string(),
            });
            // Springs, dampers and other elements of a list give one difference together.
            let place = path.iter().copied().filter(|step| matches!(step, Step::Name(_)));
            let phrase = format!("{} {first} and {second}", dotted(&place.collect::<Vec<_>>()));
            if !found.contains(&phrase) {
                found.push(phrase);
            }
        }
    });
}

/// Returns the value at a path of the plan, or the value of the point that replaces it.
fn value_at_point(value: Option<&Value>, at: &NamedPoint, path: &[Step<'_>]) -> Value {
    let named = at.iter().find(|(name, _)| names(name, path));
    named.map_or_else(|| value.cloned().unwrap_or_default(), |(_, value)| (*value).into())
}

/// Returns whether a parameter is the value at this path: `rotor_mass_kg` is
/// `machine.rotor.mass_kg`, `damping_n_s_per_m` that of every damper, `damper_2_damping_n_s_per_m`
/// that of one.
fn names(parameter: &str, path: &[Step<'_>]) -> bool {
    let own = if path[0] == Step::Name("machine") { &path[1..] } else { path };
    let (Some(last), Some(Step::Name(list))) = (own.last(), own.first()) else { return false };
    let last = last.to_string();
    let one = list.strip_suffix('s').unwrap_or(list);
    let place = own.get(1).filter(|place| matches!(place, Step::Place(_)));
    parameter == last
        || parameter == format!("{one}_{last}")
        || place.is_some_and(|place| parameter == format!("{one}_{place}_{last}"))
}

/// Returns whether a value is that of a parameter of the point, at a path with another name.
fn is_of_point(values: [&Value; 2], points: [&NamedPoint; 2], path: &[Step<'_>]) -> bool {
    points.into_iter().flatten().any(|(name, value)| {
        let mut tokens = name.split('_').filter(|token| token.len() > 1);
        let words = dotted(path);
        !names(name, path)
            && values.iter().any(|known| known.as_f64() == Some(*value))
            && tokens.next().is_some_and(|first| words.contains(first))
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn parts_of(first: (&Value, &NamedPoint), second: (&Value, &NamedPoint)) -> Vec<String> {
        let mut found = Vec::new();
        let sides = [Some(first.0), Some(second.0)];
        let points = [first.1, second.1];
        collect_differences(sides, points, vec![Step::Name("machine")], &mut found);
        found
    }

    fn machine(damping: f64, mass: f64, inertia: f64) -> Value {
        json!({
            "rotor": { "mass_kg": mass, "inertia_kg_m2": [1.0, inertia, 1.5] },
            "dampers": [{ "damping_n_s_per_m": damping }, { "damping_n_s_per_m": damping }],
        })
    }

    #[test]
    fn plans_are_compared_at_the_points_of_their_files() {
        let at = |list: &[(&str, f64)]| -> NamedPoint {
            list.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect()
        };
        let base = machine(140.0, 24.0, 1.6);
        let none = at(&[]);
        assert!(parts_of((&base, &none), (&base, &none)).is_empty());
        let light = machine(140.0, 20.0, 1.6);
        let phrase = parts_of((&base, &none), (&light, &none));
        assert_eq!(phrase, ["machine.rotor.mass_kg 24.0 and 20.0"]);
        // The first file is a map at a point; the second a trace, whose plan has the point's
        // values.
        let point = at(&[("damping_n_s_per_m", 100.0), ("rotor_mass_kg", 20.0)]);
        let run = machine(100.0, 20.0, 1.6);
        assert!(parts_of((&base, &point), (&run, &none)).is_empty());
        assert!(parts_of((&base, &point), (&base, &point)).is_empty());
        assert_eq!(
            parts_of((&base, &point), (&base, &none)),
            [
                "machine.dampers.damping_n_s_per_m 100.0 and 140.0",
                "machine.rotor.mass_kg 20.0 and 24.0"
            ]
        );
        let one = at(&[("damper_2_damping_n_s_per_m", 100.0)]);
        assert_eq!(parts_of((&base, &one), (&base, &none)).len(), 1);
        // The path of this value has another name than the parameter.
        let inertia = at(&[("rotor_inertia_22_kg_m2", 1.7)]);
        let other = machine(140.0, 24.0, 1.7);
        assert!(parts_of((&base, &inertia), (&other, &none)).is_empty());
        assert_eq!(parts_of((&base, &inertia), (&machine(140.0, 24.0, 1.8), &none)).len(), 1);
        // The second plan lacks values of the first.
        let bare = json!({ "rotor": {} });
        let phrase = parts_of((&base, &none), (&bare, &none));
        assert_eq!(phrase.len(), 3, "{phrase:?}");
        assert!(
            phrase[1].starts_with("machine.rotor.inertia_kg_m2 [1.0")
                && phrase[1].ends_with("none")
        );
    }
}

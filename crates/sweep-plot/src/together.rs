//! Whether files can be drawn together: their plans must agree in what the picture shows.
//!
//! A reader would take a picture of two plans for one of a single machine. Other differences, such
//! as a name or the rungs of an integrator, do not matter. A file without a plan is taken as it is.

use std::path::Path;

use serde_json::Value;
use sweep_files::{Step, dotted, key, leaves};

use crate::error::{PlotError, Result};
use crate::read::{Known, Source};

/// What histories, and extremes of them, follow from.
pub(crate) fn of_runs(known: Known) -> Vec<&'static str> {
    [known.of_runs, &["time.end_s"]].concat()
}

/// What ratios follow from.
pub(crate) fn of_ratios(known: Known) -> Vec<&'static str> {
    [known.of_runs, &["time", "reliability.channels", "reliability.criterion"]].concat()
}

/// Parameters with their values.
pub type At = Vec<(String, f64)>;

/// The point that a trace says it is of.
pub fn at(source: &Source) -> At {
    let at = source.find("at").and_then(Value::as_object).into_iter().flatten();
    at.filter_map(|(name, value)| Some((name.clone(), value.as_f64()?))).collect()
}

/// Where the plans of two files part, each at a point, in words.
pub fn parted(files: [(&Source, &At); 2], parts: &[&str]) -> Vec<String> {
    let plans = files.map(|(source, _)| source.find(key::PLAN));
    let [Some(first), Some(second)] = plans else { return Vec::new() };
    let mut found = Vec::new();
    for part in parts {
        let path: Vec<Step<'_>> = part.split('.').map(Step::Name).collect();
        let pointer = format!("/{}", part.replace('.', "/"));
        let (section, _) = part.split_once('.').unwrap_or((part, ""));
        if [first, second].iter().all(|plan| plan.get(section).is_some()) {
            let sides = [first, second].map(|plan| plan.pointer(&pointer));
            descend(sides, files.map(|(_, at)| at), path, &mut found);
        }
    }
    found
}

/// Refuses two files whose plans part.
///
/// # Errors
/// [`PlotError::Unfit`], which names the places.
pub fn agree(option: &str, path: &Path, files: [(&Source, &At); 2], parts: &[&str]) -> Result<()> {
    let found = parted(files, parts);
    if found.is_empty() {
        return Ok(());
    }
    Err(PlotError::Unfit(format!(
        "`{option}`: {} is of another plan than {}: {}",
        path.display(),
        files[0].0.path.display(),
        some(&found, 3)
    )))
}

/// The first of some places, and how many more there are.
pub fn some(places: &[String], most: usize) -> String {
    let more = places.len().saturating_sub(most);
    let first = places[..places.len() - more].join(", ");
    if more > 0 { format!("{first} and {more} more") } else { first }
}

/// Where two values of a plan part, from this path on.
fn descend<'a>(
    sides: [Option<&'a Value>; 2],
    points: [&At; 2],
    mut path: Vec<Step<'a>>,
    found: &mut Vec<String>,
) {
    let opens = |first: &[Value], second: &[Value]| first.len() == second.len();
    leaves(sides, opens, &mut path, &mut |path, own| {
        let [first, second] = [0, 1].map(|side| moved(own[side], points[side], path));
        if first != second && !is_of_point([&first, &second], points, path) {
            let [first, second] = [first, second].map(|value| match value {
                Value::Null => "none".to_owned(),
                value => value.to_string(),
            });
            // Springs, dampers and the like part one as another.
            let place = path.iter().copied().filter(|step| matches!(step, Step::Name(_)));
            let said = format!("{} {first} and {second}", dotted(&place.collect::<Vec<_>>()));
            if !found.contains(&said) {
                found.push(said);
            }
        }
    });
}

/// A value of the plan, or what its point says in its place.
fn moved(value: Option<&Value>, at: &At, path: &[Step<'_>]) -> Value {
    let named = at.iter().find(|(name, _)| names(name, path));
    named.map_or_else(|| value.cloned().unwrap_or_default(), |(_, value)| (*value).into())
}

/// Whether a parameter is the value at this place: `rotor_mass_kg` is `machine.rotor.mass_kg`,
/// `damping_n_s_per_m` that of every damper, `damper_2_damping_n_s_per_m` that of one.
fn names(parameter: &str, path: &[Step<'_>]) -> bool {
    let own = if path[0] == Step::Name("machine") { &path[1..] } else { path };
    let (Some(last), Some(Step::Name(list))) = (own.last(), own.first()) else { return false };
    let (last, one) = (last.to_string(), list.strip_suffix('s').unwrap_or(list));
    let place = own.get(1).filter(|place| matches!(place, Step::Place(_)));
    parameter == last
        || parameter == format!("{one}_{last}")
        || place.is_some_and(|place| parameter == format!("{one}_{place}_{last}"))
}

/// Whether a value is that of a parameter of the point whose place in the plan has another name.
fn is_of_point(values: [&Value; 2], points: [&At; 2], path: &[Step<'_>]) -> bool {
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

    fn parts_of(first: (&Value, &At), second: (&Value, &At)) -> Vec<String> {
        let mut found = Vec::new();
        let (sides, points) = ([Some(first.0), Some(second.0)], [first.1, second.1]);
        descend(sides, points, vec![Step::Name("machine")], &mut found);
        found
    }

    fn machine(damping: f64, mass: f64, inertia: f64) -> Value {
        json!({
            "rotor": { "mass_kg": mass, "inertia_kg_m2": [1.0, inertia, 1.5] },
            "dampers": [{ "damping_n_s_per_m": damping }, { "damping_n_s_per_m": damping }],
        })
    }

    #[test]
    fn plans_are_compared_at_their_points() {
        let at = |list: &[(&str, f64)]| -> At {
            list.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect()
        };
        let (base, none) = (machine(140.0, 24.0, 1.6), at(&[]));
        assert!(parts_of((&base, &none), (&base, &none)).is_empty());
        let light = machine(140.0, 20.0, 1.6);
        let said = parts_of((&base, &none), (&light, &none));
        assert_eq!(said, ["machine.rotor.mass_kg 24.0 and 20.0"]);
        // A point of a map, and its trace with the numbers in place.
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
        // Its place has another name than the parameter.
        let inertia = at(&[("rotor_inertia_22_kg_m2", 1.7)]);
        let other = machine(140.0, 24.0, 1.7);
        assert!(parts_of((&base, &inertia), (&other, &none)).is_empty());
        assert_eq!(parts_of((&base, &inertia), (&machine(140.0, 24.0, 1.8), &none)).len(), 1);
        // What one plan has and the other has not.
        let bare = json!({ "rotor": {} });
        let said = parts_of((&base, &none), (&bare, &none));
        assert_eq!(said.len(), 3, "{said:?}");
        assert!(
            said[1].starts_with("machine.rotor.inertia_kg_m2 [1.0") && said[1].ends_with("none")
        );
    }
}

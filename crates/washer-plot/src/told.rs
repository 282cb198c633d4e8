//! A plan's machine and spin in words: what a reader of a page must know of them without the
//! program.

use serde_json::Value;
use sweep_plot::label::{significant, unit_of_name};

/// What the plan says of them, each with its heading.
pub(crate) fn told(plan: &Value) -> Vec<(&'static str, String)> {
    let said = [("Machine", machine(&plan["machine"])), ("Spin", spin(&plan["spin"]))];
    said.into_iter().filter_map(|(title, text)| Some((title, text?))).collect()
}

/// A number under a key, with the unit that the key's end says.
fn quantity(of: &Value, key: &str) -> Option<String> {
    let value = significant(of.get(key)?.as_f64()?, 4);
    Some(format!("{value} {}", unit_of_name(key)).trim_end().to_owned())
}

fn machine(machine: &Value) -> Option<String> {
    let mass = |body: &str| quantity(&machine[body], "mass_kg");
    let (tub, shaft, drum) = (mass("tub")?, mass("shaft")?, mass("drum")?);
    let (unbalance, radius) = (mass("unbalance")?, quantity(&machine["unbalance"], "radius_m")?);
    let mut parts = vec![format!(
        "tub {tub}, shaft {shaft}, drum {drum}, unbalance {unbalance} at radius {radius}"
    )];
    // Numbers of a list's elements, each behind its word: the one that they have in common, or the
    // least and the greatest.
    let elements = |(list, numbers): (&str, &[(&str, &str)])| {
        let all = machine.get(list).and_then(Value::as_array)?;
        let said = numbers.iter().filter_map(|(word, number)| {
            // What an element does not say is 0; what none says is not told.
            let size = |of: &Value| of[*number].as_f64().unwrap_or_default();
            let most = all.iter().max_by(|a, b| size(a).total_cmp(&size(b)))?;
            let least = all.iter().map(size).fold(f64::INFINITY, f64::min);
            let from = match least == size(most) {
                true => String::new(),
                false => format!("{} to ", significant(least, 4)),
            };
            Some(format!(" {word} {from}{}", quantity(most, number)?))
        });
        let words = list.replace('_', " ");
        let words = if all.len() == 1 { words.trim_end_matches('s') } else { &words };
        Some(format!("{} {words}{}", all.len(), said.collect::<Vec<_>>().join(",")))
    };
    let lists: [(&str, &[(&str, &str)]); 6] = [
        ("springs", &[("of", "stiffness_n_per_m")]),
        ("dampers", &[("of", "damping_n_s_per_m"), ("with friction of", "friction_n")]),
        ("stops", &[("of", "stiffness_n_per_m"), ("after", "clearance_m")]),
        ("bushings", &[]),
        ("further_unbalances", &[("of", "mass_kg")]),
        ("feet", &[]),
    ];
    parts.extend(lists.into_iter().filter_map(elements));
    if let Some(mass) = machine.get("cabinet").and_then(|cabinet| quantity(cabinet, "mass_kg")) {
        parts.push(format!("a cabinet of {mass}"));
    }
    if let Some(gap) = quantity(machine, "radial_clearance_m") {
        parts.push(format!("a gap of {gap} between drum and tub"));
    }
    Some(format!("{}; each point has its own values of the axes' parameters", parts.join("; ")))
}

fn spin(spin: &Value) -> Option<String> {
    let profile = spin["profile"].as_str()?;
    match (quantity(spin, "peak_rpm"), quantity(spin, "ramp_s")) {
        (Some(peak), Some(ramp)) => Some(format!("{profile}, up to {peak} in {ramp}")),
        _ => Some(format!("{profile} of {} points", spin["time_s"].as_array()?.len())),
    }
}

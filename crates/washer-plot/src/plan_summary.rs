//! The summary of a plan's machine and spin, which a reader of a page needs.

use serde_json::Value;
use sweep_plot::label::{significant, unit_of_name};

/// Returns the summary as headings and texts.
pub(crate) fn plan_summary(plan: &Value) -> Vec<(&'static str, String)> {
    let phrase = [("Machine", machine(&plan["machine"])), ("Spin", spin(&plan["spin"]))];
    phrase.into_iter().filter_map(|(title, text)| Some((title, text?))).collect()
}

/// Returns the number under a key, with the unit that ends the key.
fn quantity(table: &Value, key: &str) -> Option<String> {
    let value = significant(table.get(key)?.as_f64()?, 4);
    Some(format!("{value} {}", unit_of_name(key)).trim_end().to_owned())
}

fn machine(machine: &Value) -> Option<String> {
    let mass = |body: &str| quantity(&machine[body], "mass_kg");
    let tub = mass("tub")?;
    let shaft = mass("shaft")?;
    let drum = mass("drum")?;
    let radius = quantity(&machine["unbalance"], "radius_m")?;
    let unbalance = mass("unbalance")?;
    let mut parts = vec![format!(
        "tub {tub}, shaft {shaft}, drum {drum}, unbalance {unbalance} at radius {radius}"
    )];
    // Each number of a list's elements follows its word: the common value, or the least and the
    // greatest.
    let elements = |(list, numbers): (&str, &[(&str, &str)])| {
        let all = machine.get(list).and_then(Value::as_array)?;
        let phrase = numbers.iter().filter_map(|(word, number)| {
            // A number that an element lacks is 0; a number that all lack is left out.
            let size = |element: &Value| element[*number].as_f64().unwrap_or_default();
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
        Some(format!("{} {words}{}", all.len(), phrase.collect::<Vec<_>>().join(",")))
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

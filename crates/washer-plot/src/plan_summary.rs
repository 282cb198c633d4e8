//! The summary of a plan's machine and spin, which a reader of a page needs.

use serde_json::Value;
use sweep_plot::label::{format_significant, unit_of_name};

/// Returns the summary as headings and texts.
pub(crate) fn plan_summary(plan: &Value) -> Vec<(&'static str, String)> {
    let summary_lines =
        [("Machine", machine_summary(&plan["machine"])), ("Spin", spin_summary(&plan["spin"]))];
    summary_lines.into_iter().filter_map(|(title, text)| Some((title, text?))).collect()
}

/// Returns the number under a key, with the unit that ends the key.
fn format_quantity(table: &Value, key: &str) -> Option<String> {
    let value_text = format_significant(table.get(key)?.as_f64()?, 4);
    Some(format!("{value_text} {}", unit_of_name(key)).trim_end().to_owned())
}

fn machine_summary(machine: &Value) -> Option<String> {
    let format_mass = |body: &str| format_quantity(&machine[body], "mass_kg");
    let tub = format_mass("tub")?;
    let shaft = format_mass("shaft")?;
    let drum = format_mass("drum")?;
    let radius = format_quantity(&machine["unbalance"], "radius_m")?;
    let unbalance = format_mass("unbalance")?;
    let mut phrases = vec![format!(
        "tub {tub}, shaft {shaft}, drum {drum}, unbalance {unbalance} at radius {radius}"
    )];
    // Each number of a list's elements follows its word: the common value, or the least and the
    // greatest.
    let list_summary = |(list, numbers): (&str, &[(&str, &str)])| {
        let elements_of_list = machine.get(list).and_then(Value::as_array)?;
        let value_texts = numbers.iter().filter_map(|(word, key)| {
            // A number that an element lacks is 0; a number that all lack is left out.
            let number_of_element = |element: &Value| element[*key].as_f64().unwrap_or_default();
            let greatest_element = elements_of_list
                .iter()
                .max_by(|a, b| number_of_element(a).total_cmp(&number_of_element(b)))?;
            let least_number =
                elements_of_list.iter().map(number_of_element).fold(f64::INFINITY, f64::min);
            let least_text = match least_number == number_of_element(greatest_element) {
                true => String::new(),
                false => format!("{} to ", format_significant(least_number, 4)),
            };
            Some(format!(" {word} {least_text}{}", format_quantity(greatest_element, key)?))
        });
        let element_name = list.replace('_', " ");
        let element_name = if elements_of_list.len() == 1 {
            element_name.trim_end_matches('s')
        } else {
            &element_name
        };
        Some(format!(
            "{} {element_name}{}",
            elements_of_list.len(),
            value_texts.collect::<Vec<_>>().join(",")
        ))
    };
    let lists: [(&str, &[(&str, &str)]); 6] = [
        ("springs", &[("of", "stiffness_n_per_m")]),
        ("dampers", &[("of", "damping_n_s_per_m"), ("with friction of", "friction_n")]),
        ("stops", &[("of", "stiffness_n_per_m"), ("after", "clearance_m")]),
        ("bushings", &[]),
        ("further_unbalances", &[("of", "mass_kg")]),
        ("feet", &[]),
    ];
    phrases.extend(lists.into_iter().filter_map(list_summary));
    if let Some(cabinet_mass) =
        machine.get("cabinet").and_then(|cabinet| format_quantity(cabinet, "mass_kg"))
    {
        phrases.push(format!("a cabinet of {cabinet_mass}"));
    }
    if let Some(gap) = format_quantity(machine, "radial_clearance_m") {
        phrases.push(format!("a gap of {gap} between drum and tub"));
    }
    Some(format!("{}; each point has its own values of the axes' parameters", phrases.join("; ")))
}

fn spin_summary(spin: &Value) -> Option<String> {
    let profile = spin["profile"].as_str()?;
    match (format_quantity(spin, "peak_rpm"), format_quantity(spin, "ramp_s")) {
        (Some(peak), Some(ramp)) => Some(format!("{profile}, up to {peak} in {ramp}")),
        _ => Some(format!("{profile} of {} points", spin["time_s"].as_array()?.len())),
    }
}

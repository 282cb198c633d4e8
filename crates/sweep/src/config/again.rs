//! JSON of plans as TOML, so that a plan in a result is read as grid files are.

use serde_json::{Map, Value};

/// A value on one line; `None` for null, which TOML leaves out.
pub(super) fn toml(value: &Value) -> Option<String> {
    Some(match value {
        Value::Null => return None,
        // Both write the same.
        Value::Bool(_) | Value::Number(_) => value.to_string(),
        Value::String(text) => quoted(text),
        Value::Array(items) => {
            let items: Vec<String> = items.iter().filter_map(toml).collect();
            format!("[{}]", items.join(", "))
        }
        Value::Object(entries) => format!("{{ {} }}", entries_of(entries).join(", ")),
    })
}

/// An object as a file, a key a line.
pub(super) fn toml_file(value: &Value) -> Option<String> {
    value.as_object().map(|entries| entries_of(entries).join("\n"))
}

fn entries_of(entries: &Map<String, Value>) -> Vec<String> {
    let entry = |(key, value): (&String, &Value)| {
        toml(value).map(|value| format!("{} = {value}", quoted(key)))
    };
    entries.iter().filter_map(entry).collect()
}

fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => quoted.push_str(&format!("\\u{:04X}", c as u32)),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use crate::config::{GridInput, with_one_of_each};

    const GRID: &str = r#"
name = "again"
set = { tub_mass_kg = 24.5 }
spin = { profile = "table", time_s = [0, 10, 50], speed_rpm = [0, 300, 1e2] }
time = { end_s = 50, window_s = [30, 50] }
integrator = { accuracy = 1e-5 }
reliability = { ratio_limit = 1.5, channels = ["tub_yaw", "tub_pitch"] }
[[axis]]
parameter = "unbalance_mass_kg"
values = [0.1, 0.30000000000000004]
[[axis]]
parameter = "bearing_stiffness_n_per_m"
range = { from = 1e7, to = 2e8, count = 4, spacing = "log" }
"#;

    #[test]
    fn a_plan_is_read_again_from_its_own_json() {
        let mut plan = GridInput::text("again", GRID.to_owned(), Vec::new()).load().unwrap();
        let again = |plan: &crate::Plan| {
            let input = GridInput::of_plan("again", &plan.to_json());
            input.load().unwrap_or_else(|mistakes| panic!("{mistakes}"))
        };
        assert_eq!(again(&plan), plan);
        plan.machine = with_one_of_each();
        plan.machine.feet = [[0.5, -0.4, 0.3], [0.5, -0.4, -0.3], [-0.2, -0.4, 0.0]]
            .map(|foot_m| washer_model::Foot { foot_m })
            .to_vec();
        plan.measures.stops = plan.machine.stops.len();
        plan.measures.feet = plan.machine.feet.len();
        assert_eq!(again(&plan), plan);
    }

    #[test]
    fn text_is_escaped() {
        let odd = "a \"quoted\" \\ \n line";
        let read: toml::Table = format!("x = {}", super::quoted(odd)).parse().unwrap();
        assert_eq!(read["x"].as_str(), Some(odd));
    }
}

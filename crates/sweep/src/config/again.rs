//! JSON of plans as TOML, so that a plan in a result is read as grid files are.

use toml::{Table, Value};

/// A file with these keys; a value that is absent or null is left out.
pub(super) fn file<'a>(
    entries: impl IntoIterator<Item = (&'a str, Option<&'a serde_json::Value>)>,
) -> String {
    let entry = |(key, value): (&str, Option<&_>)| Some((key.to_owned(), toml(value?)?));
    entries.into_iter().filter_map(entry).collect::<Table>().to_string()
}

/// The value; `None` for null, which TOML does not have.
fn toml(value: &serde_json::Value) -> Option<Value> {
    Some(match value {
        serde_json::Value::Null => return None,
        serde_json::Value::Bool(flag) => Value::Boolean(*flag),
        serde_json::Value::Number(number) => match number.as_i64() {
            Some(number) => Value::Integer(number),
            None => Value::Float(number.as_f64()?),
        },
        serde_json::Value::String(text) => Value::String(text.clone()),
        serde_json::Value::Array(items) => Value::Array(items.iter().filter_map(toml).collect()),
        serde_json::Value::Object(entries) => {
            let entry = |(key, value): (&String, &_)| Some((key.clone(), toml(value)?));
            Value::Table(entries.iter().filter_map(entry).collect())
        }
    })
}

#[cfg(test)]
mod tests {
    use washer_row::Metric;

    use crate::config::{GridInput, with_one_of_each};

    const GRID: &str = r#"
name = "again"
set = { tub_mass_kg = 24.5 }
spin = { profile = "table", time_s = [0, 10, 50], speed_rpm = [0, 300, 1e2] }
time = { end_s = 50, window_s = [30, 50] }
integrator = { accuracy = 1e-5 }
reliability = { ratio_limit = 1.5, channels = ["tub_yaw", "tub_pitch"], criterion = "rms" }
metrics = ["static_sag", "growth"]
stability = { speed_rpm = "200:240:20" }
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
        // Its stops have no growth.
        (plan.measures.metrics, plan.growth_speeds) = (vec![Metric::StopForce], None);
        plan.machine = with_one_of_each();
        plan.machine.feet = [[0.5, -0.4, 0.3], [0.5, -0.4, -0.3], [-0.2, -0.4, 0.0]]
            .map(|foot_m| washer_model::Foot { foot_m })
            .to_vec();
        plan.measures.stops = plan.machine.stops.len();
        plan.measures.feet = plan.machine.feet.len();
        assert_eq!(again(&plan), plan);
    }
}

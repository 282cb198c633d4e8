//! What a figure's file says of the machine.

use serde_json::Value;

use sweep_plot::table::Table;

/// The two numbers of the machine that reliability turns on, as far as the file has them and all
/// dampers are alike.
pub(crate) fn machine(table: &Table) -> Vec<(&'static str, f64)> {
    let Some(machine) = table.source.find("machine") else { return Vec::new() };
    let unbalance = machine.pointer("/unbalance/mass_kg").and_then(Value::as_f64);
    let dampers = machine.get("dampers").and_then(Value::as_array).into_iter().flatten();
    let mut dampings: Vec<f64> = dampers
        .filter_map(|damper| damper.get("damping_n_s_per_m").and_then(Value::as_f64))
        .collect();
    dampings.dedup();
    let damping = (dampings.len() == 1).then(|| dampings[0]);
    let named = [("unbalance_mass_kg", unbalance), ("damping_n_s_per_m", damping)];
    named.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
}

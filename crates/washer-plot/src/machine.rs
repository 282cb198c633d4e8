//! The machine's numbers in the plan of a file.

use serde_json::Value;

use sweep_plot::table::FigureTable;

/// Returns the unbalance and the damping of the machine, if the file has them and all dampers are
/// equal.
pub(crate) fn unbalance_and_damping(table: &FigureTable) -> Vec<(&'static str, f64)> {
    let Some(machine) = table.source.find_metadata("machine") else { return Vec::new() };
    let unbalance_kg = machine.pointer("/unbalance/mass_kg").and_then(Value::as_f64);
    let dampers = machine.get("dampers").and_then(Value::as_array).into_iter().flatten();
    let mut dampings_n_s_per_m: Vec<f64> = dampers
        .filter_map(|damper| damper.get("damping_n_s_per_m").and_then(Value::as_f64))
        .collect();
    dampings_n_s_per_m.dedup();
    let damping_n_s_per_m = (dampings_n_s_per_m.len() == 1).then(|| dampings_n_s_per_m[0]);
    let values = [("unbalance_mass_kg", unbalance_kg), ("damping_n_s_per_m", damping_n_s_per_m)];
    values.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
}

//! Where rows about held speeds are: points by the values of their axes.

use sweep_files::{ParquetFile, key};
use washer_model::decimal;

/// The axes that a file has columns of.
pub(crate) fn axes(file: &ParquetFile) -> Vec<String> {
    let plan = file.json(key::PLAN).unwrap_or_default();
    let axes = plan["axis"].as_array().into_iter().flatten();
    let names = axes.filter_map(|axis| axis["parameter"].as_str());
    names.filter(|name| file.schema().index_of(name).is_ok()).map(str::to_owned).collect()
}

/// A point in words, as `unbalance_mass_kg 0.4, 250 rpm`.
pub(crate) fn words(axes: &[String], values: &[f64]) -> String {
    let one = |(name, value): (&String, &f64)| match name.as_str() {
        "speed_rpm" => format!("{} rpm", decimal(*value)),
        _ => format!("{name} {}", decimal(*value)),
    };
    axes.iter().zip(values).map(one).collect::<Vec<_>>().join(", ")
}

//! Where rows about held speeds are: points by the values of their axes.

use sweep_engine::commands::cells::short;
use sweep_files::{ParquetFile, key};

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
        "speed_rpm" => format!("{} rpm", short(*value)),
        _ => format!("{name} {}", short(*value)),
    };
    axes.iter().zip(values).map(one).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    #[test]
    fn numbers_are_rounded_for_people() {
        let axes = ["mass_kg", "speed_rpm"].map(str::to_owned);
        let said = super::words(&axes, &[0.939_999_999_999_999_8, 250.0]);
        assert_eq!(said, "mass_kg 0.94, 250 rpm");
    }
}

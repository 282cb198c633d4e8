//! Names and texts of the points of rows at held speeds.

use sweep_engine::commands::cells::format_number;
use sweep_files::{ParquetFile, key};

/// Returns the names of the plan's axes that a file has columns of.
pub(crate) fn axis_names(file: &ParquetFile) -> Vec<String> {
    let plan = file.json(key::PLAN).unwrap_or_default();
    let axes_json = plan["axis"].as_array().into_iter().flatten();
    let names = axes_json.filter_map(|axis| axis["parameter"].as_str());
    names.filter(|name| file.schema().index_of(name).is_ok()).map(str::to_owned).collect()
}

/// Returns the values of a point's axes as text, such as `unbalance_mass_kg 0.4, 250 rpm`.
pub(crate) fn point_text(axis_names: &[String], values: &[f64]) -> String {
    let format_value = |(name, value): (&String, &f64)| match name.as_str() {
        "speed_rpm" => format!("{} rpm", format_number(*value)),
        _ => format!("{name} {}", format_number(*value)),
    };
    axis_names.iter().zip(values).map(format_value).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    #[test]
    fn numbers_are_rounded() {
        let axis_names = ["mass_kg", "speed_rpm"].map(str::to_owned);
        let text = super::point_text(&axis_names, &[0.939_999_999_999_999_8, 250.0]);
        assert_eq!(text, "mass_kg 0.94, 250 rpm");
    }
}

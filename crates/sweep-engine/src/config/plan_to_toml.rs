//! Conversion of plans from JSON to TOML, so that the plan of a result is read like a grid file.

use serde_json::{Map, Value};
use toml::Table;

/// Writes a TOML file with these keys. Nulls are left out, which TOML does not have.
pub(super) fn format_toml<'a>(
    entries: impl IntoIterator<Item = (&'a String, &'a Value)>,
) -> String {
    let entries: Map<String, Value> =
        entries.into_iter().map(|(key, value)| (key.clone(), value.clone())).collect();
    // All other values of JSON have a counterpart in TOML.
    Table::try_from(without_nulls(Value::Object(entries))).unwrap_or_default().to_string()
}

fn without_nulls(value: Value) -> Value {
    match value {
        Value::Array(items) => {
            items.into_iter().filter(|item| !item.is_null()).map(without_nulls).collect()
        }
        Value::Object(entries) => {
            let entries = entries.into_iter().filter(|(_, value)| !value.is_null());
            entries.map(|(key, value)| (key, without_nulls(value))).collect()
        }
        other => other,
    }
}

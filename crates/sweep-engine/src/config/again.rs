//! JSON of plans as TOML, so that a plan in a result is read as grid files are.

use toml::{Table, Value};

/// A file with these keys; a value that is null is left out.
pub(super) fn file(entries: impl IntoIterator<Item = (String, serde_json::Value)>) -> String {
    let entry = |(key, value): (String, serde_json::Value)| Some((key, toml(&value)?));
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

//! Where two plans part.

use serde::Serialize;
use serde_json::{Map, Value};
use sweep_files::{ParquetFile, key};

/// One place where the plans of two files part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlanChange {
    /// Dotted path: `machine.tub.mass_kg`.
    pub path: String,
    /// Value in the first file; null if it has none there.
    pub first: Value,
    /// Value in the second.
    pub second: Value,
}

/// What a file says of how it was made: its plan, versions, and of a trace or a boundary what was
/// asked for.
fn account(file: &ParquetFile) -> Value {
    let own = |name: &str| {
        let text = file.value(name)?;
        Some(serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.to_owned())))
    };
    let mut account = match own(key::PLAN) {
        Some(Value::Object(plan)) => plan,
        _ => Map::new(),
    };
    for (name, key) in [
        ("version", key::VERSION),
        ("numerics", key::NUMERICS),
        ("trace", key::TRACE),
        ("modes", key::MODES),
    ] {
        account.extend(own(key).map(|value| (name.to_owned(), value)));
    }
    Value::Object(account)
}

/// Every place where the accounts of two files part.
pub(super) fn changes(first: &ParquetFile, second: &ParquetFile) -> Vec<PlanChange> {
    let mut found = Vec::new();
    descend(&account(first), &account(second), &mut String::new(), &mut found);
    found
}

fn descend(first: &Value, second: &Value, path: &mut String, found: &mut Vec<PlanChange>) {
    if first == second {
        return;
    }
    let length = path.len();
    let mut step = |name: &str, first: &Value, second: &Value| {
        if !path.is_empty() {
            path.push('.');
        }
        path.push_str(name);
        descend(first, second, path, found);
        path.truncate(length);
    };
    match (first, second) {
        (Value::Object(first), Value::Object(second)) => {
            for (name, value) in first {
                step(name, value, second.get(name).unwrap_or(&Value::Null));
            }
            for (name, value) in second.iter().filter(|(name, _)| !first.contains_key(*name)) {
                step(name, &Value::Null, value);
            }
        }
        // Lists of other lengths, and of numbers, part as a whole.
        (Value::Array(first), Value::Array(second))
            if first.len() == second.len() && first.iter().any(Value::is_object) =>
        {
            for (k, (first, second)) in first.iter().zip(second).enumerate() {
                step(&(k + 1).to_string(), first, second);
            }
        }
        _ => found.push(PlanChange {
            path: path.clone(),
            first: first.clone(),
            second: second.clone(),
        }),
    }
}

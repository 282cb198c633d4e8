//! Where two plans part.

use serde::Serialize;
use serde_json::{Map, Value};
use sweep_files::{ParquetFile, dotted, key, leaves};

/// One place where the plans of two files part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlanChange {
    /// Dotted path: `machine.body.mass_kg`.
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

/// Every place where the accounts of two files part. Lists of other lengths, and of numbers, part
/// as a whole.
pub(super) fn changes(first: &ParquetFile, second: &ParquetFile) -> Vec<PlanChange> {
    let (first, second) = (account(first), account(second));
    let opens = |first: &[Value], second: &[Value]| {
        first.len() == second.len() && first.iter().any(Value::is_object)
    };
    let mut found = Vec::new();
    leaves([Some(&first), Some(&second)], opens, &mut Vec::new(), &mut |path, sides| {
        let [first, second] = sides.map(|side| side.cloned().unwrap_or_default());
        if first != second {
            found.push(PlanChange { path: dotted(path), first, second });
        }
    });
    found
}

//! Conversion of Python mappings to the texts that the engine reads: grid files and `NAME=VALUE`.

use std::path::PathBuf;

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyMapping, PyString};
use toml::{Table, Value};

use crate::columns::read_number;

/// Returns `NAME=VALUE` for each entry. A number is written in the shortest form that reads back to
/// the same bits.
pub(crate) fn to_assignments(values: Option<&Bound<'_, PyMapping>>) -> PyResult<Vec<String>> {
    let to_assignment = |item: Bound<'_, PyAny>| {
        let (name, value): (String, Bound<'_, PyAny>) = item.extract()?;
        let value = read_number(&value).map_err(|_| {
            PyTypeError::new_err(format!(
                "`{name}`: expected a number, got `{}`",
                type_name(&value)
            ))
        })?;
        Ok(format!("{name}={value:?}"))
    };
    match values {
        Some(values) => values.items()?.iter().map(to_assignment).collect(),
        None => Ok(Vec::new()),
    }
}

/// Returns a mapping as the text of a grid file.
pub(crate) fn to_grid_text(grid: &Bound<'_, PyMapping>) -> PyResult<String> {
    Ok(to_table(grid, 0)?.to_string())
}

/// The greatest depth of nested mappings and lists. Basis: five times that of a grid, and a limit
/// for a mapping that contains itself. Doubling it accepts no further grid.
const MAX_DEPTH: usize = 24;

fn to_table(entries: &Bound<'_, PyMapping>, depth: usize) -> PyResult<Table> {
    let to_key_value = |item: Bound<'_, PyAny>| {
        let (key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
        let key: String = key.extract().map_err(|_| {
            PyTypeError::new_err(format!("a grid's keys are text, not `{}`", type_name(&key)))
        })?;
        let value = to_toml_value(&key, &value, depth + 1)?;
        Ok((key, value))
    };
    entries.items()?.iter().map(to_key_value).collect()
}

fn to_toml_value(key: &str, value: &Bound<'_, PyAny>, depth: usize) -> PyResult<Value> {
    if depth > MAX_DEPTH {
        let text = format!(
            "`{key}`: nested deeper than {MAX_DEPTH} levels; check whether the dictionary contains \
             itself"
        );
        return Err(PyValueError::new_err(text));
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(Value::String(text.to_string()));
    }
    if let Ok(flag) = value.extract::<bool>() {
        return Ok(Value::Boolean(flag));
    }
    if let Ok(entries) = value.cast::<PyMapping>() {
        return Ok(Value::Table(to_table(entries, depth)?));
    }
    // Arrays come before numbers, because a NumPy array with a single value converts to a number.
    if let Ok(entries) = value.try_iter() {
        let entries = entries.map(|item| to_toml_value(key, &item?, depth + 1));
        return Ok(Value::Array(entries.collect::<PyResult<_>>()?));
    }
    if let Ok(number) = value.extract::<i64>() {
        return Ok(Value::Integer(number));
    }
    // The reader of grid files reports `nan` and `inf` with their location.
    if let Ok(number) = read_number(value) {
        return Ok(Value::Float(number));
    }
    if let Ok(path) = value.extract::<PathBuf>() {
        return Ok(Value::String(path.display().to_string()));
    }
    Err(PyTypeError::new_err(format!("`{key}`: a grid cannot contain a `{}`", type_name(value))))
}

fn type_name(value: &Bound<'_, PyAny>) -> String {
    value.get_type().name().map(|name| name.to_string()).unwrap_or_default()
}

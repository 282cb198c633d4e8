//! Mappings of Python's as the words that the engine reads: the text of a grid file, and
//! `NAME=VALUE`.

use std::path::PathBuf;

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyMapping, PyString};
use toml::{Table, Value};

use crate::columns::number;

/// `NAME=VALUE` of each entry; numbers in the shortest form that reads back to the same bits.
pub(crate) fn assignments(values: Option<&Bound<'_, PyMapping>>) -> PyResult<Vec<String>> {
    let one = |entry: Bound<'_, PyAny>| {
        let (name, value): (String, Bound<'_, PyAny>) = entry.extract()?;
        let value = number(&value).map_err(|_| {
            PyTypeError::new_err(format!("`{name}`: expected a number, got `{}`", type_of(&value)))
        })?;
        Ok(format!("{name}={value:?}"))
    };
    values.map_or_else(|| Ok(Vec::new()), |values| values.items()?.iter().map(one).collect())
}

/// A dictionary as the text of a grid file.
pub(crate) fn text(grid: &Bound<'_, PyMapping>) -> PyResult<String> {
    Ok(table(grid, 0)?.to_string())
}

/// Deepest nesting of a dictionary: a grid's own is a fifth of it.
const DEEPEST: usize = 24;

fn table(entries: &Bound<'_, PyMapping>, depth: usize) -> PyResult<Table> {
    let one = |entry: Bound<'_, PyAny>| {
        let (key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>) = entry.extract()?;
        let key: String = key.extract().map_err(|_| {
            PyTypeError::new_err(format!("a grid's keys are text, not `{}`", type_of(&key)))
        })?;
        let value = toml(&key, &value, depth + 1)?;
        Ok((key, value))
    };
    entries.items()?.iter().map(one).collect()
}

fn toml(key: &str, value: &Bound<'_, PyAny>, depth: usize) -> PyResult<Value> {
    if depth > DEEPEST {
        let text =
            format!("`{key}`: nested deeper than {DEEPEST}: does the dictionary hold itself?");
        return Err(PyValueError::new_err(text));
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(Value::String(text.to_string()));
    }
    if let Ok(flag) = value.extract::<bool>() {
        return Ok(Value::Boolean(flag));
    }
    if let Ok(entries) = value.cast::<PyMapping>() {
        return Ok(Value::Table(table(entries, depth)?));
    }
    // Before numbers: an array of NumPy's with one value passes for a number.
    if let Ok(entries) = value.try_iter() {
        let entries = entries.map(|entry| toml(key, &entry?, depth + 1));
        return Ok(Value::Array(entries.collect::<PyResult<_>>()?));
    }
    if let Ok(number) = value.extract::<i64>() {
        return Ok(Value::Integer(number));
    }
    // `nan` and `inf` too, which are then refused at their place.
    if let Ok(number) = number(value) {
        return Ok(Value::Float(number));
    }
    if let Ok(path) = value.extract::<PathBuf>() {
        return Ok(Value::String(path.display().to_string()));
    }
    Err(PyTypeError::new_err(format!("`{key}`: a grid holds no `{}`", type_of(value))))
}

fn type_of(value: &Bound<'_, PyAny>) -> String {
    value.get_type().name().map(|name| name.to_string()).unwrap_or_default()
}

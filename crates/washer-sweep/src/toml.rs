//! Mappings of Python's as the words that the engine reads: the text of a grid file, and
//! `NAME=VALUE`.

use std::path::PathBuf;

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyMapping, PyString};

/// `NAME=VALUE` of each entry; numbers in the shortest form that reads back to the same bits.
pub(crate) fn assignments(values: Option<&Bound<'_, PyMapping>>) -> PyResult<Vec<String>> {
    let one = |entry: Bound<'_, PyAny>| {
        let (name, value): (String, Bound<'_, PyAny>) = entry.extract()?;
        let value: f64 = value.extract().map_err(|_| {
            let found = value.get_type().name().map(|name| name.to_string()).unwrap_or_default();
            PyTypeError::new_err(format!("`{name}`: expected a number, got `{found}`"))
        })?;
        Ok(format!("{name}={value:?}"))
    };
    values.map_or_else(|| Ok(Vec::new()), |values| values.items()?.iter().map(one).collect())
}

/// A dictionary as the text of a grid file.
pub(crate) fn toml(grid: &Bound<'_, PyMapping>) -> PyResult<String> {
    let mut text = String::new();
    let mut tables = String::new();
    for entry in grid.items()?.iter() {
        let (name, value): (String, Bound<'_, PyAny>) = entry.extract()?;
        let key = quoted(&name);
        if let Ok(table) = value.cast::<PyDict>() {
            tables.push_str(&format!("\n[{key}]\n{}", pairs(table)?));
        } else if let Some(listed) = tables_of(&value) {
            for table in listed {
                tables.push_str(&format!("\n[[{key}]]\n{}", pairs(&table)?));
            }
        } else {
            text.push_str(&format!("{key} = {}\n", toml_value(&name, &value)?));
        }
    }
    Ok(text + &tables)
}

/// The dictionaries of a list that holds nothing else, and at least one.
fn tables_of<'py>(value: &Bound<'py, PyAny>) -> Option<Vec<Bound<'py, PyDict>>> {
    let list = value.cast::<PyList>().ok()?;
    let tables: Option<Vec<_>> =
        list.iter().map(|entry| entry.cast_into::<PyDict>().ok()).collect();
    tables.filter(|tables| !tables.is_empty())
}

fn pairs(table: &Bound<'_, PyDict>) -> PyResult<String> {
    let mut text = String::new();
    for (key, value) in table.iter() {
        let key: String = key.extract()?;
        text.push_str(&format!("{} = {}\n", quoted(&key), toml_value(&key, &value)?));
    }
    Ok(text)
}

/// A value in one line.
fn toml_value(key: &str, value: &Bound<'_, PyAny>) -> PyResult<String> {
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(string(&text.to_string()));
    }
    if let Ok(flag) = value.extract::<bool>() {
        return Ok(flag.to_string());
    }
    if let Ok(table) = value.cast::<PyDict>() {
        let entries = table.iter().map(|(name, value)| {
            let name: String = name.extract()?;
            Ok(format!("{} = {}", quoted(&name), toml_value(&name, &value)?))
        });
        return Ok(format!("{{ {} }}", entries.collect::<PyResult<Vec<_>>>()?.join(", ")));
    }
    // Before numbers: an array of NumPy's with one value passes for a number.
    if let Ok(entries) = value.try_iter() {
        let entries = entries.map(|entry| toml_value(key, &entry?));
        return Ok(format!("[{}]", entries.collect::<PyResult<Vec<_>>>()?.join(", ")));
    }
    if let Ok(number) = value.extract::<i64>() {
        return Ok(number.to_string());
    }
    if let Ok(number) = value.extract::<f64>() {
        return Ok(float(number));
    }
    if let Ok(path) = value.extract::<PathBuf>() {
        return Ok(string(&path.display().to_string()));
    }
    let found = value.get_type().name().map(|name| name.to_string()).unwrap_or_default();
    Err(PyTypeError::new_err(format!("`{key}`: a grid holds no `{found}`")))
}

/// As TOML writes numbers: `nan` and `inf` too, which are then refused at their place.
fn float(number: f64) -> String {
    match number {
        number if number.is_nan() => "nan".to_owned(),
        number if number.is_infinite() => {
            if number > 0.0 {
                "inf".to_owned()
            } else {
                "-inf".to_owned()
            }
        }
        number => format!("{number:?}"),
    }
}

fn quoted(key: &str) -> String {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !key.is_empty() && key.chars().all(is_bare) { key.to_owned() } else { string(key) }
}

/// A string of TOML, whose escapes are those of JSON.
fn string(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

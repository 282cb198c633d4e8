//! Reads tables that users pass: any object with Arrow's C stream, or a mapping of columns.

use std::ffi::CStr;

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyMapping};
use sweep::PointTable;

use crate::arrow;
use crate::errors::plan_error;

/// Reads the points of a table.
pub(crate) fn read_points(table: &Bound<'_, PyAny>) -> PyResult<PointTable> {
    let py = table.py();
    if let Some((schema, batches)) = arrow::read_rows(table)? {
        return PointTable::new(&schema, &batches).map_err(|error| plan_error(py, &error));
    }
    let Ok(columns) = table.cast::<PyMapping>() else {
        let type_name = table.get_type().name()?;
        return Err(PyTypeError::new_err(format!(
            "expected a table with `__arrow_c_stream__` (polars, pyarrow, pandas, DuckDB), or a \
             mapping of parameter name to numbers; got `{type_name}`"
        )));
    };
    let read_column = |item: Bound<'_, PyAny>| {
        let (name, numbers): (String, Bound<'_, PyAny>) = item.extract()?;
        let numbers = read_numbers(&numbers).map_err(|error| {
            let type_error = PyTypeError::new_err(format!("column `{name}`: expected numbers"));
            type_error.set_cause(py, Some(error));
            type_error
        })?;
        Ok((name, numbers))
    };
    let columns = columns.items()?.iter().map(read_column).collect::<PyResult<Vec<_>>>()?;
    PointTable::from_columns(columns).map_err(|error| plan_error(py, &error))
}

/// Reads the numbers of a one-dimensional NumPy array, or of another iterable.
pub(crate) fn read_numbers(values: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    check_numbers(values)?;
    let dimension_count = values.getattr_opt("ndim")?.map(|count| count.extract::<usize>());
    let dimension_count = dimension_count.transpose()?.unwrap_or(1);
    if dimension_count != 1 {
        let text = format!("expected one dimension, got {dimension_count}");
        return Err(PyTypeError::new_err(text));
    }
    match PyBuffer::<f64>::get(values) {
        // PyO3 does not check the byte order, so that arrays with another byte order are read value
        // by value.
        Ok(buffer) if [c"d", NATIVE_DOUBLE].contains(&buffer.format()) => {
            buffer.to_vec(values.py())
        }
        _ => values.try_iter()?.map(|value| read_number(&value?)).collect(),
    }
}

/// The buffer format of an eight-byte float with this machine's byte order.
const NATIVE_DOUBLE: &CStr = if cfg!(target_endian = "little") { c"<d" } else { c">d" };

/// Reads a number. Other types that Python converts to numbers are errors.
pub(crate) fn read_number(value: &Bound<'_, PyAny>) -> PyResult<f64> {
    check_numbers(value)?;
    if value.is_instance_of::<PyBool>() {
        return Err(PyTypeError::new_err("expected a number, got a truth value"));
    }
    value.extract()
}

/// Checks that values are real numbers. NumPy would convert masked and complex values, truth values
/// and times with a loss.
fn check_numbers(values: &Bound<'_, PyAny>) -> PyResult<()> {
    if values.getattr_opt("mask")?.is_some_and(|mask| !mask.is_callable()) {
        let text = "expected numbers, got masked ones: fill or drop what is masked";
        return Err(PyTypeError::new_err(text));
    }
    let Some(dtype) = values.getattr_opt("dtype")? else { return Ok(()) };
    let Some(kind) = dtype.getattr_opt("kind")? else { return Ok(()) };
    // Values of an array of objects are checked one by one.
    match kind.extract::<char>() {
        Ok('f' | 'i' | 'u' | 'O') => Ok(()),
        _ => Err(PyTypeError::new_err(format!("expected real numbers, got `{dtype}`"))),
    }
}

//! Tables as users hold them: anything that speaks Arrow's C stream, or a dictionary of columns.

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sweep::PointTable;

use crate::arrow;
use crate::errors::plan_error;

/// The points of a table.
pub(crate) fn points(table: &Bound<'_, PyAny>) -> PyResult<PointTable> {
    let py = table.py();
    if let Some((schema, batches)) = arrow::rows(table)? {
        return PointTable::new(&schema, &batches).map_err(|wrong| plan_error(py, &wrong));
    }
    let Ok(columns) = table.cast::<PyDict>() else {
        let found = table.get_type().name()?;
        return Err(PyTypeError::new_err(format!(
            "expected a table with `__arrow_c_stream__` (polars, pyarrow, pandas, DuckDB), or a \
             dict of parameter name to numbers; got `{found}`"
        )));
    };
    let column = |(name, values): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let name: String = name.extract()?;
        let values = numbers(&values).map_err(|error| {
            let wrong = PyTypeError::new_err(format!("column `{name}`: expected numbers"));
            wrong.set_cause(py, Some(error));
            wrong
        })?;
        Ok((name, values))
    };
    let columns = columns.iter().map(column).collect::<PyResult<Vec<_>>>()?;
    PointTable::from_columns(columns).map_err(|wrong| plan_error(py, &wrong))
}

/// Numbers of an array of NumPy's, or of any sequence.
fn numbers(values: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    match PyBuffer::<f64>::get(values) {
        Ok(buffer) if buffer.dimensions() == 1 => buffer.to_vec(values.py()),
        Ok(buffer) => Err(PyTypeError::new_err(format!(
            "expected one dimension, got {}",
            buffer.dimensions()
        ))),
        Err(_) => values.extract(),
    }
}

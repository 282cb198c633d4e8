//! Tables as users hold them: anything that speaks Arrow's C stream, or a dictionary of columns.

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyMapping;
use sweep::PointTable;

use crate::arrow;
use crate::errors::plan_error;

/// The points of a table.
pub(crate) fn points(table: &Bound<'_, PyAny>) -> PyResult<PointTable> {
    let py = table.py();
    if let Some((schema, batches)) = arrow::rows(table)? {
        return PointTable::new(&schema, &batches).map_err(|wrong| plan_error(py, &wrong));
    }
    let Ok(columns) = table.cast::<PyMapping>() else {
        let found = table.get_type().name()?;
        return Err(PyTypeError::new_err(format!(
            "expected a table with `__arrow_c_stream__` (polars, pyarrow, pandas, DuckDB), or a \
             mapping of parameter name to numbers; got `{found}`"
        )));
    };
    let column = |entry: Bound<'_, PyAny>| {
        let (name, values): (String, Bound<'_, PyAny>) = entry.extract()?;
        let values = numbers(&values).map_err(|error| {
            let wrong = PyTypeError::new_err(format!("column `{name}`: expected numbers"));
            wrong.set_cause(py, Some(error));
            wrong
        })?;
        Ok((name, values))
    };
    let columns = columns.items()?.iter().map(column).collect::<PyResult<Vec<_>>>()?;
    PointTable::from_columns(columns).map_err(|wrong| plan_error(py, &wrong))
}

/// Numbers of an array of NumPy's, or of anything else in one dimension.
fn numbers(values: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let dimensions = values.getattr_opt("ndim")?.map(|count| count.extract::<usize>());
    let dimensions = dimensions.transpose()?.unwrap_or(1);
    if dimensions != 1 {
        let text = format!("expected one dimension, got {dimensions}");
        return Err(PyTypeError::new_err(text));
    }
    match PyBuffer::<f64>::get(values) {
        Ok(buffer) => buffer.to_vec(values.py()),
        Err(_) => values.try_iter()?.map(|value| value?.extract()).collect(),
    }
}

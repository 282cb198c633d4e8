//! Conversion of errors to Python exceptions: `washer_sweep.PlanError` for mistakes in the input,
//! with each mistake as data, `OSError` for files, `RuntimeError` for all others.

use pyo3::exceptions::{PyOSError, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use sweep::{Diagnostics, Error, Exit, Mistake, StoreError};
use sweep_plot::PlotError;

/// Creates an exception of one of the package's classes.
fn package_error(py: Python<'_>, class_name: &str, text: String, data: Py<PyAny>) -> PyErr {
    let class = py.import("washer_sweep._errors").and_then(|module| module.getattr(class_name));
    let exception = class.and_then(|class| class.call1((text, data)));
    exception.map_or_else(|error| error, PyErr::from_value)
}

/// Creates the exception of mistakes in a plan, or in a table of points.
pub(crate) fn plan_error(py: Python<'_>, mistakes: &Diagnostics) -> PyErr {
    let mistake_to_dict = |mistake: Mistake| -> PyResult<Bound<'_, PyDict>> {
        let mistake_entry = PyDict::new(py);
        mistake_entry.set_item("file", mistake.file)?;
        mistake_entry.set_item("line", mistake.line)?;
        mistake_entry.set_item("column", mistake.column)?;
        mistake_entry.set_item("message", mistake.message)?;
        mistake_entry.set_item("expected", mistake.expected)?;
        let hint = mistake.hints.join("\n");
        mistake_entry.set_item("hint", (!hint.is_empty()).then_some(hint))?;
        Ok(mistake_entry)
    };
    let entries =
        mistakes.mistakes().into_iter().map(mistake_to_dict).collect::<PyResult<Vec<_>>>();
    match entries.and_then(|entries| PyList::new(py, entries)) {
        Ok(entries) => {
            package_error(py, "PlanError", mistakes.to_string(), entries.into_any().unbind())
        }
        Err(error) => error,
    }
}

/// Creates the exception of any error of the engine.
pub(crate) fn to_exception(py: Python<'_>, error: &Error) -> PyErr {
    match error {
        Error::Input(mistakes) => plan_error(py, mistakes),
        Error::Files(_)
        | Error::File { .. }
        | Error::Store(StoreError::File(_) | StoreError::Parquet { .. })
        | Error::Plot(PlotError::File(_)) => PyOSError::new_err(error.to_string()),
        other if other.exit_code() == Exit::BadInput => {
            let empty_list = PyList::empty(py).into_any().unbind();
            package_error(py, "PlanError", other.to_string(), empty_list)
        }
        _ => PyRuntimeError::new_err(error.to_string()),
    }
}

/// Creates the exception of Ctrl-C, a `KeyboardInterrupt` with the rows that were computed before.
pub(crate) fn interrupted_error(py: Python<'_>, text: String, result: Py<PyAny>) -> PyErr {
    package_error(py, "Interrupted", text, result)
}

/// Creates the exception of Ctrl-C during a computation that has no result before its end.
pub(crate) fn interrupted_without_result_error(py: Python<'_>) -> PyErr {
    interrupted_error(py, "interrupted".to_owned(), py.None())
}

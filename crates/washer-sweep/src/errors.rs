//! Errors as Python's: `washer_sweep.PlanError` for what a user wrote, with each mistake as data;
//! `OSError` for files, `RuntimeError` for the rest.

use pyo3::exceptions::{PyOSError, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use sweep::{Diagnostics, Error, Exit, Mistake, StoreError};
use sweep_plot::PlotError;

/// An error of one of the package's own classes.
fn raised(py: Python<'_>, class: &str, text: String, with: Py<PyAny>) -> PyErr {
    let own = py.import("washer_sweep._errors").and_then(|own| own.getattr(class));
    own.and_then(|class| class.call1((text, with))).map_or_else(|error| error, PyErr::from_value)
}

/// Mistakes in a plan, or in a table given to it.
pub(crate) fn plan_error(py: Python<'_>, mistakes: &Diagnostics) -> PyErr {
    let entry = |mistake: Mistake| -> PyResult<Bound<'_, PyDict>> {
        let entry = PyDict::new(py);
        entry.set_item("file", mistake.file)?;
        entry.set_item("line", mistake.line)?;
        entry.set_item("column", mistake.column)?;
        entry.set_item("message", mistake.message)?;
        entry.set_item("expected", mistake.expected)?;
        let hint = mistake.hints.join("\n");
        entry.set_item("hint", (!hint.is_empty()).then_some(hint))?;
        Ok(entry)
    };
    let listed = mistakes.mistakes().into_iter().map(entry).collect::<PyResult<Vec<_>>>();
    match listed.and_then(|listed| PyList::new(py, listed)) {
        Ok(listed) => raised(py, "PlanError", mistakes.to_string(), listed.into_any().unbind()),
        Err(error) => error,
    }
}

/// Any error of the engine's.
pub(crate) fn error(py: Python<'_>, error: &Error) -> PyErr {
    match error {
        Error::Input(mistakes) => plan_error(py, mistakes),
        Error::Files(_)
        | Error::File { .. }
        | Error::Store(StoreError::File(_) | StoreError::Parquet { .. })
        | Error::Plot(PlotError::File(_)) => PyOSError::new_err(error.to_string()),
        other if other.exit() == Exit::BadInput => {
            let nothing = PyList::empty(py).into_any().unbind();
            raised(py, "PlanError", other.to_string(), nothing)
        }
        _ => PyRuntimeError::new_err(error.to_string()),
    }
}

/// What Ctrl-C raises: `KeyboardInterrupt`, with what was computed.
pub(crate) fn interrupted(py: Python<'_>, text: String, result: Py<PyAny>) -> PyErr {
    raised(py, "Interrupted", text, result)
}

/// An interruption of what has no result before its end.
pub(crate) fn early(py: Python<'_>) -> PyErr {
    interrupted(py, "interrupted".to_owned(), py.None())
}

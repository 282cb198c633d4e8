//! Returns the tables of computations that have ended, and raises exceptions after interruptions.

use std::path::PathBuf;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use sweep::{Error, EvaluationTask, FileRunEnd, MemoryTable, format_count};

use crate::computation::{ComputationOptions, Supervised, supervise};
use crate::errors;
use crate::result::PyResultTable;

/// Returns the rows; after Ctrl-C raises an exception with the rows computed before.
pub(crate) fn rows_or_raise(
    py: Python<'_>,
    evaluation: Supervised<MemoryTable>,
) -> PyResult<PyResultTable> {
    let table = evaluation.value_or_raise(py, |evaluation| match evaluation {
        Err(error) => errors::to_exception(py, &error),
        Ok(table) => {
            let rows = format_count(table.rows(), "row");
            let text = format!("interrupted; `result` of this exception holds {rows}");
            interruption_error(py, text, Some(table))
        }
    })?;
    Ok(PyResultTable::new(table))
}

/// Computes a task in memory, or into a file if `out` is given, and returns the rows. With `fresh`
/// an unfinished file is started anew; otherwise the call continues it. With progress, the task
/// prints the same lines as the command.
pub(crate) fn rows_or_file(
    py: Python<'_>,
    task: Result<EvaluationTask<'_>, Error>,
    (out, fresh): (Option<PathBuf>, bool),
    options: ComputationOptions,
) -> PyResult<PyResultTable> {
    let task = &task.map_err(|error| errors::to_exception(py, &error))?;
    let Some(out) = out else {
        return rows_or_raise(
            py,
            supervise(py, options, |execution| task.compute_in_memory(execution))?,
        );
    };
    let report_progress: fn(&str) = if options.progress { sweep::tell } else { |_| () };
    let result = supervise(py, options, |execution| {
        task.compute_to_file(&out, fresh, &report_progress, execution)
    })?;
    let result = result.value_or_raise(py, |result| match result {
        Err(error) => errors::to_exception(py, &error),
        Ok(FileRunEnd::Complete(table)) => {
            let text = format!("interrupted after {} was complete", out.display());
            interruption_error(py, text, Some(table))
        }
        Ok(FileRunEnd::Interrupted { stored_rows, points }) => {
            let text = format!(
                "interrupted with {stored_rows} of {points} points kept beside {}; the same call \
                 continues with the others",
                out.display()
            );
            interruption_error(py, text, None)
        }
    })?;
    match result {
        FileRunEnd::Complete(table) => Ok(PyResultTable::new(table)),
        FileRunEnd::Interrupted { stored_rows, points } => Err(PyValueError::new_err(format!(
            "stopped with {stored_rows} of {points} points without an interruption"
        ))),
    }
}

/// Returns the table of a search, or raises `interrupted` after Ctrl-C.
pub(crate) fn table_or_raise(
    py: Python<'_>,
    result: Supervised<Option<MemoryTable>>,
    interrupted: impl Fn() -> PyErr,
) -> PyResult<PyResultTable> {
    let result = result.value_or_raise(py, |_| interrupted())?;
    result.map(PyResultTable::new).ok_or_else(interrupted)
}

/// Creates the exception of an interruption, with the rows computed before.
pub(crate) fn interruption_error(
    py: Python<'_>,
    text: String,
    result: Option<MemoryTable>,
) -> PyErr {
    match result.map(|result| Py::new(py, PyResultTable::new(result))).transpose() {
        Ok(result) => {
            let result = result.map_or_else(|| py.None(), Py::into_any);
            errors::interrupted_error(py, text, result)
        }
        Err(error) => error,
    }
}

//! How a work ended: rows, a file, or Ctrl-C with what is there.

use std::path::PathBuf;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use sweep::{Error, EvaluationTask, MemoryTable, RanToFile};

use crate::errors;
use crate::result::PyResultTable;
use crate::work::{Attended, How, attended};

/// The rows, or those that were computed before Ctrl-C.
pub(crate) fn rows(py: Python<'_>, evaluated: Attended<MemoryTable>) -> PyResult<PyResultTable> {
    let table = evaluated.or_raise(py, |evaluated| match evaluated {
        Err(error) => errors::error(py, &error),
        Ok(table) => {
            let rows = table.rows();
            let text = format!("interrupted; `result` of this exception holds {rows} rows");
            holding(py, text, Some(table))
        }
    })?;
    Ok(PyResultTable::new(table))
}

/// The rows of a task that keeps them in memory or, if there is one, in a file, perhaps afresh; if
/// it is shown, it says beforehand what matters. Of a file that Ctrl-C leaves unfinished, the same
/// call goes on.
pub(crate) fn rows_or_file(
    py: Python<'_>,
    task: Result<EvaluationTask<'_>, Error>,
    (out, fresh): (Option<PathBuf>, bool),
    how: How,
) -> PyResult<PyResultTable> {
    let task = &task.map_err(|error| errors::error(py, &error))?;
    let Some(out) = out else {
        return rows(py, attended(py, how, |effort| task.in_memory(effort))?);
    };
    let tell: fn(&str) = if how.progress { sweep::tell } else { |_| () };
    let ran = attended(py, how, |effort| task.to_file(&out, fresh, &tell, effort))?;
    let ran = ran.or_raise(py, |ran| match ran {
        Err(error) => errors::error(py, &error),
        Ok(RanToFile::Whole(table)) => {
            let text = format!("interrupted when {} was done", out.display());
            holding(py, text, Some(table))
        }
        Ok(RanToFile::Interrupted { kept, points }) => {
            let text = format!(
                "interrupted with {kept} of {points} points kept beside {}; the same call goes on",
                out.display()
            );
            holding(py, text, None)
        }
    })?;
    match ran {
        RanToFile::Whole(table) => Ok(PyResultTable::new(table)),
        RanToFile::Interrupted { kept, points } => Err(PyValueError::new_err(format!(
            "stopped with {kept} of {points} points, though nothing interrupted it"
        ))),
    }
}

/// A search's table, or what `interrupted` raises.
pub(crate) fn table(
    py: Python<'_>,
    found: Attended<Option<MemoryTable>>,
    interrupted: impl Fn() -> PyErr,
) -> PyResult<PyResultTable> {
    let found = found.or_raise(py, |_| interrupted())?;
    found.map(PyResultTable::new).ok_or_else(interrupted)
}

/// An interruption that holds what was computed.
pub(crate) fn holding(py: Python<'_>, text: String, result: Option<MemoryTable>) -> PyErr {
    match result.map(|result| Py::new(py, PyResultTable::new(result))).transpose() {
        Ok(result) => {
            let result = result.map_or_else(|| py.None(), Py::into_any);
            errors::interrupted(py, text, result)
        }
        Err(error) => error,
    }
}

//! How a work ended: rows, a file, or Ctrl-C with what is there.

use std::path::Path;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use sweep::{Error, Evaluated, ProgressMode, RanToFile};

use crate::errors;
use crate::result::PyResultTable;
use crate::work::Attended;

/// How progress is shown.
pub(crate) const fn mode(progress: bool) -> ProgressMode {
    if progress { ProgressMode::Auto } else { ProgressMode::None }
}

/// Shows what matters before the work starts, if progress is wanted.
pub(crate) fn teller(progress: bool) -> &'static dyn Fn(&str) {
    if progress { &sweep::tell } else { &|_| () }
}

/// The rows, or those that were computed before Ctrl-C.
pub(crate) fn rows(
    py: Python<'_>,
    evaluated: Attended<Result<Evaluated, Error>>,
) -> PyResult<PyResultTable> {
    let evaluated = evaluated.or_raise(py, |evaluated| match evaluated {
        Err(error) => errors::error(py, &error),
        Ok(evaluated) => {
            let rows = evaluated.table.rows();
            let text = format!("interrupted; `result` of this exception holds {rows} rows");
            holding(py, text, Some(PyResultTable::new(evaluated.table)))
        }
    })?;
    let evaluated = evaluated.map_err(|error| errors::error(py, &error))?;
    Ok(PyResultTable::new(evaluated.table))
}

/// The rows of a file that was computed, or the word that the same call goes on.
pub(crate) fn file(
    py: Python<'_>,
    ran: Attended<Result<RanToFile, Error>>,
    out: &Path,
) -> PyResult<PyResultTable> {
    let ran = ran.or_raise(py, |ran| match ran {
        Err(error) => errors::error(py, &error),
        Ok(RanToFile::Whole(table)) => {
            let text = format!("interrupted when {} was done", out.display());
            holding(py, text, Some(PyResultTable::new(table)))
        }
        Ok(RanToFile::Interrupted { kept, points }) => {
            let text = format!(
                "interrupted with {kept} of {points} points kept beside {}; the same call goes on",
                out.display()
            );
            holding(py, text, None)
        }
    })?;
    match ran.map_err(|error| errors::error(py, &error))? {
        RanToFile::Whole(table) => Ok(PyResultTable::new(table)),
        RanToFile::Interrupted { kept, points } => Err(PyValueError::new_err(format!(
            "stopped with {kept} of {points} points, though nothing interrupted it"
        ))),
    }
}

/// An interruption that holds what was computed.
pub(crate) fn holding(py: Python<'_>, text: String, result: Option<PyResultTable>) -> PyErr {
    match result.map(|result| Py::new(py, result)).transpose() {
        Ok(result) => {
            let result = result.map_or_else(|| py.None(), Py::into_any);
            errors::interrupted(py, text, result)
        }
        Err(error) => error,
    }
}

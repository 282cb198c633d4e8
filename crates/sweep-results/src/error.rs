//! What can go wrong with a result that is asked something.

use sweep_files::FileError;

/// Why a result does not answer.
#[derive(Debug, thiserror::Error)]
pub enum ResultsError {
    /// A file that cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// What cannot be done with a file, and why.
    #[error("{0}")]
    Refused(String),
}

/// An answer, unless there is none.
pub(crate) type Result<T, E = ResultsError> = std::result::Result<T, E>;

//! Errors of queries of results.

use sweep_files::FileError;

/// An error of a query of a result.
#[derive(Debug, thiserror::Error)]
pub enum ResultsError {
    /// A file that cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A request that a file cannot satisfy, with the reason.
    #[error("{0}")]
    Refused(String),
}

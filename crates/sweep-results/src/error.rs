//! Errors of queries of results.

use std::path::PathBuf;

use sweep_files::FileError;

/// An error of a query of a result.
#[derive(Debug, thiserror::Error)]
pub enum ResultsError {
    /// A file that cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A temporary file of an export that the system refused.
    #[error("cannot write a temporary file to export {}: {reason}", path.display())]
    TemporaryFile {
        /// The exported file.
        path: PathBuf,
        /// The system's reason.
        reason: String,
    },
    /// A request that a file cannot satisfy, with the reason.
    #[error("{0}")]
    Refused(String),
}

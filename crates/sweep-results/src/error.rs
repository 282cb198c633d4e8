//! What can go wrong with a result that is asked something.

use std::path::PathBuf;

use sweep_files::FileError;

/// Why a result does not answer.
#[derive(Debug, thiserror::Error)]
pub enum ResultsError {
    /// A file that cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A column that the file does not have.
    #[error("{} has no column `{name}`{}", path.display(), nearest.as_ref().map_or_else(
        String::new, |near| format!("; did you mean `{near}`?")))]
    Column {
        /// The file.
        path: PathBuf,
        /// As typed.
        name: String,
        /// The column that may have been meant.
        nearest: Option<String>,
    },
    /// What cannot be done with a file, and why.
    #[error("{0}")]
    Refused(String),
}

impl ResultsError {
    /// Whether the user's words are to blame, rather than a file.
    pub const fn is_refusal(&self) -> bool {
        !matches!(self, Self::File(_))
    }
}

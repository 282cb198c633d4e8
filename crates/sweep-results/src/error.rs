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
    /// Two files that have nothing in common to compare.
    #[error("{} and {} cannot be compared: {reason}", first.display(), second.display())]
    Incomparable {
        /// One file.
        first: PathBuf,
        /// The other.
        second: PathBuf,
        /// Why not.
        reason: String,
    },
    /// A format that has no room for a file.
    #[error("{} cannot be exported as .{ending}: {reason}", path.display())]
    Export {
        /// The file.
        path: PathBuf,
        /// The format.
        ending: &'static str,
        /// Why not.
        reason: String,
    },
    /// A file of more cells than fit in memory.
    #[error("{} has {cells} cells, more than the {most} that are kept in memory",
        path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its cells.
        cells: u64,
        /// The most.
        most: u64,
    },
    /// A column of which there is no order.
    #[error("`{name}` of {} holds no numbers, so it has no order", path.display())]
    NoOrder {
        /// The file.
        path: PathBuf,
        /// The column.
        name: String,
    },
}

impl ResultsError {
    /// Whether the user's words are to blame, rather than a file.
    pub const fn is_refusal(&self) -> bool {
        !matches!(self, Self::File(_))
    }
}

//! Why a figure could not be made.

use std::path::PathBuf;

use sweep_files::FileError;

/// What went wrong, where, and what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// A file that cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A file that cannot be drawn.
    #[error("{}: {reason}", path.display())]
    Undrawable {
        /// Which file.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// The rows do not lie on a grid.
    #[error("{}: {reason}; a map has one row per point of a full grid", path.display())]
    NotAGrid {
        /// Which file.
        path: PathBuf,
        /// What was found.
        reason: String,
    },
    /// An option or a name that does not fit the file, or the kind of output.
    #[error("{0}")]
    Unfit(String),
    /// A name that the file does not have.
    #[error("{refusal}")]
    NotThere {
        /// What was asked for, where it is not, and what there is.
        refusal: String,
        /// The name as typed.
        given: String,
        /// The names that there are.
        valid: Vec<String>,
    },
    /// The figure cannot be drawn.
    #[error("cannot draw the figure: {0}")]
    Drawing(String),
}

/// What there is unless the figure could not be made.
pub(crate) type Result<T, E = PlotError> = std::result::Result<T, E>;

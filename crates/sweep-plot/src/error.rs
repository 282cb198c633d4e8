//! The errors of drawing a figure.

use std::path::PathBuf;

use sweep_files::FileError;

/// The error of drawing a figure: it says what went wrong, where, and what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// A file that cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A file that cannot be drawn.
    #[error("{}: {reason}", path.display())]
    Undrawable { path: PathBuf, reason: String },
    /// A file whose rows do not lie on a grid.
    #[error("{}: {reason}; a map has one row per point of a full grid", path.display())]
    NotAGrid {
        path: PathBuf,
        /// The finding that excludes a grid.
        reason: String,
    },
    /// An option or a name that does not fit the file, or the kind of output.
    #[error("{0}")]
    Unfit(String),
    /// A name that the file does not have.
    #[error("{message}")]
    NotThere {
        /// The message: the requested name, the place that lacks it, and the names that exist.
        message: String,
        /// The requested name.
        requested_name: String,
        /// The names that exist.
        valid_names: Vec<String>,
    },
    /// A figure that cannot be laid out or encoded.
    #[error("cannot draw the figure: {0}")]
    Drawing(String),
}

/// A result with [`PlotError`] as its default error.
pub(crate) type Result<T, E = PlotError> = std::result::Result<T, E>;

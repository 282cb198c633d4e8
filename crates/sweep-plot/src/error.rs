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
    /// A Parquet file, but none that this program writes.
    #[error(
        "{}: its columns ({columns}) are those of no map, trace, modes, boundary or stability \
         file, so there is no figure that fits it",
        path.display()
    )]
    UnknownKind {
        /// Which file.
        path: PathBuf,
        /// The columns it has.
        columns: String,
    },
    /// A column that the figure needs is missing or holds the wrong type.
    #[error("{}: a {kind} file needs the {expected} column `{column}`", path.display())]
    Column {
        /// Which file.
        path: PathBuf,
        /// What kind of file it was taken for.
        kind: &'static str,
        /// What the column should hold.
        expected: &'static str,
        /// Its name.
        column: String,
    },
    /// No rows, or none that can be drawn.
    #[error("{}: nothing to draw: {reason}", path.display())]
    Empty {
        /// Which file.
        path: PathBuf,
        /// What is missing.
        reason: &'static str,
    },
    /// More rows than a figure of this kind can show.
    #[error("{}: a {kind} file of {rows} rows is more than a figure can show, which is {most} of \
             them", path.display())]
    TooMany {
        /// Which file.
        path: PathBuf,
        /// What kind of file it is.
        kind: &'static str,
        /// Its rows.
        rows: usize,
        /// The most.
        most: usize,
    },
    /// The rows do not lie on a grid.
    #[error("{}: {reason}; a map has one row per point of a full grid", path.display())]
    NotAGrid {
        /// Which file.
        path: PathBuf,
        /// What was found.
        reason: String,
    },
    /// An option names something that the file does not have.
    #[error("`{option} {given}`: {}: there is no such {what}; it has {known}", path.display())]
    NotThere {
        /// The option, as typed.
        option: &'static str,
        /// Its value.
        given: String,
        /// Which file was looked in.
        path: PathBuf,
        /// What was looked for.
        what: &'static str,
        /// What there is.
        known: String,
    },
    /// An option does not fit the kind of file or of output.
    #[error("{0}")]
    Unfit(String),
    /// The output's name does not say in which format to write.
    #[error("{}: the figure's format goes by its name's ending: .svg, .png or \
             .html", path.display())]
    Format {
        /// The output as given.
        path: PathBuf,
    },
    /// The figure cannot be drawn.
    #[error("cannot draw the figure: {0}")]
    Drawing(String),
}

impl PlotError {
    /// Whether the command line is at fault rather than a file or the machine.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::File(error) => error.is_refusal(),
            _ => matches!(self, Self::NotThere { .. } | Self::Unfit(_) | Self::Format { .. }),
        }
    }
}

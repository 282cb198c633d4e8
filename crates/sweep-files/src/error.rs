//! Failures of files, each with the path and with advice.

use std::borrow::Cow;
use std::io;
use std::path::{Path, PathBuf};

use arrow_schema::ArrowError;

/// A failure to read or write a file.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The system refused an operation.
    #[error("cannot {action} {}: {source}\n  = help: {}", path.display(), advice(path, source))]
    Io {
        /// The operation, in the infinitive.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// An output path at which there is something that must not be overwritten.
    #[error("{} cannot be an output: {reason}\n  = help: {help}", path.display())]
    Refused {
        /// The path as given.
        path: PathBuf,
        /// The reason.
        reason: String,
        /// The advice.
        help: &'static str,
    },
    /// A file that is not Parquet or is truncated.
    #[error("{} is not a readable Parquet file: {reason}", path.display())]
    NotParquet {
        /// The file.
        path: PathBuf,
        /// The reason that the reader gives.
        reason: String,
    },
    /// A result of this program whose bytes have changed since it was written.
    #[error(
        "{} is damaged: {DAMAGED}\n  = help: \
         restore it from a copy, or move it away and run the command again that wrote it",
        path.display()
    )]
    Damaged {
        /// The file.
        path: PathBuf,
    },
    /// A result of this program that another program has read and written again.
    #[error(
        "{} carries no digest: another program has rewritten it\n  = help: \
         restore it from a copy, or move it away and run the command again that wrote it",
        path.display()
    )]
    Rewritten {
        /// The file.
        path: PathBuf,
    },
}

/// Reason in the message about a damaged file.
const DAMAGED: &str = "the digest that it carries is not that of its bytes";

impl FileError {
    /// Makes a [`FileError::Io`] from a system's error; `action` is a verb in the infinitive.
    pub fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::Io { action, path, source }
    }

    /// Makes the error for cells of another type than the schema has.
    pub fn cells(path: &Path) -> impl FnOnce(ArrowError) -> Self {
        move |error| Self::not_parquet(path, error.to_string())
    }

    /// Makes the error for a file that cannot be read.
    pub(crate) fn not_parquet(path: &Path, reason: impl Into<String>) -> Self {
        Self::NotParquet { path: path.to_path_buf(), reason: reason.into() }
    }

    /// Makes the error for a result of this program that has changed.
    pub fn damaged(path: &Path) -> Self {
        Self::Damaged { path: path.to_path_buf() }
    }

    /// Whether the user's input is the cause, and nothing was done: a file is missing or is of
    /// another kind than the command needs.
    pub fn is_refusal(&self) -> bool {
        use io::ErrorKind::{InvalidInput, NotADirectory, NotFound, PermissionDenied};
        let Self::Io { action, source, .. } = self else { return true };
        let user_error_kinds = [InvalidInput, NotADirectory, NotFound, PermissionDenied];
        *action == "open" && user_error_kinds.contains(&source.kind())
    }
}

/// Returns the advice about a failed operation. Most end in running the same command again, because
/// finished chunks of a run are kept in any case.
fn advice(path: &Path, source: &io::Error) -> Cow<'static, str> {
    let advice = match source.kind() {
        io::ErrorKind::StorageFull => {
            "the disk is full: free some space and run the same command again; finished chunks of \
             a run are kept"
        }
        io::ErrorKind::QuotaExceeded => {
            "the quota is used up: free some space and run the same command again; finished chunks \
             of a run are kept"
        }
        io::ErrorKind::FileTooLarge => {
            "a file-size limit was hit: raise it (ulimit -f) and run the same command again; \
             finished chunks of a run are kept"
        }
        io::ErrorKind::ReadOnlyFilesystem | io::ErrorKind::PermissionDenied => {
            "give this user the right to it, or another path"
        }
        io::ErrorKind::NotFound => {
            if let Some(similar) = find_similar(path) {
                return format!("{} is there: is it meant?", similar.display()).into();
            }
            "check the name and its folder; if it has vanished, bring it back and run the same \
             command again"
        }
        io::ErrorKind::NotADirectory => {
            "a part of that path is a file, not a folder: move it, or give another path"
        }
        io::ErrorKind::AlreadyExists => {
            "a file of that name is in the way: move it, or give another path"
        }
        io::ErrorKind::InvalidInput => "give the name of a regular file",
        _ => {
            "check the disk (the system's log may say more) and run the same command again; \
             finished chunks of a run are kept"
        }
    };
    advice.into()
}

/// Finds the result that was probably meant by a path that lacks its folder or its ending.
fn find_similar(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?;
    let mut full_name = name.to_owned();
    if path.extension().is_none_or(|ending| ending != "parquet") {
        full_name.push(".parquet");
    }
    let folders = [path.with_file_name(""), path.with_file_name("results"), "results".into()];
    let mut candidates = folders.map(|folder: PathBuf| folder.join(&full_name)).into_iter();
    candidates.find(|place| place.is_file())
}

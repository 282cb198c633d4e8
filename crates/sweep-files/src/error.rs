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
    /// There is something at a path where this program must not write.
    #[error("{} cannot be an output: {reason}\n  = help: {help}", path.display())]
    Refused {
        /// The path as given.
        path: PathBuf,
        /// The reason.
        reason: String,
        /// The advice.
        help: &'static str,
    },
    /// A file that is not Parquet, or only a part of one.
    #[error("{} is not a readable Parquet file: {reason}", path.display())]
    NotParquet {
        /// The file.
        path: PathBuf,
        /// The reason, by the reader.
        reason: String,
    },
    /// A file of this program whose bytes have changed since it was written.
    #[error(
        "{} is damaged: {DAMAGED}\n  = help: \
         restore it from a copy, or move it away and run the command again that wrote it",
        path.display()
    )]
    Damaged {
        /// The file.
        path: PathBuf,
    },
    /// A result of this program that another one has written anew.
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

/// The reason why a file is called damaged.
const DAMAGED: &str = "the digest that it carries is not that of its bytes";

impl FileError {
    /// Makes [`FileError::Io`] of a system's error; `action` in the infinitive.
    pub fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::Io { action, path, source }
    }

    /// Makes the error of cells that are not of their schema's types.
    pub fn cells(path: &Path) -> impl FnOnce(ArrowError) -> Self {
        move |error| Self::not_parquet(path, error.to_string())
    }

    /// Makes the error of a file that cannot be read, for this reason.
    pub(crate) fn not_parquet(path: &Path, reason: impl Into<String>) -> Self {
        Self::NotParquet { path: path.to_path_buf(), reason: reason.into() }
    }

    /// Makes the error of a file of this program that has changed.
    pub fn damaged(path: &Path) -> Self {
        Self::Damaged { path: path.to_path_buf() }
    }

    /// Whether the request is at fault, and nothing was done: a file that is not there or is not
    /// what it must be.
    pub fn is_refusal(&self) -> bool {
        use io::ErrorKind::{InvalidInput, NotADirectory, NotFound, PermissionDenied};
        let Self::Io { action, source, .. } = self else { return true };
        let kinds = [InvalidInput, NotADirectory, NotFound, PermissionDenied];
        *action == "open" && kinds.contains(&source.kind())
    }
}

/// Returns the advice about a failed operation. Finished chunks are whole whatever happened, so
/// that it ends alike.
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
            if let Some(near) = near(path) {
                return format!("{} is there: is it meant?", near.display()).into();
            }
            "check the name and its folder; if it has vanished, bring it back and run the same \
             command again"
        }
        io::ErrorKind::NotADirectory => {
            "a part of that path is a file, not a folder: move it, or give another path"
        }
        io::ErrorKind::InvalidInput => "give the name of a regular file",
        _ => {
            "check the disk (the system's log may say more) and run the same command again; \
             finished chunks of a run are kept"
        }
    };
    advice.into()
}

/// Finds the result that a path without its folder or ending means.
fn near(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?;
    let mut whole = name.to_owned();
    if path.extension().is_none_or(|ending| ending != "parquet") {
        whole.push(".parquet");
    }
    let folders = [path.with_file_name(""), path.with_file_name("results"), "results".into()];
    let mut places = folders.map(|folder: PathBuf| folder.join(&whole)).into_iter();
    places.find(|place| place.is_file())
}

//! The errors of a run's files, each with the path and advice.

use std::io;
use std::path::{Path, PathBuf};

use super::differences::PlanDifference;
use crate::threads::ThreadsError;
use sweep_files::FileError;

/// A failure of the store.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// A file that cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Another process has locked this output.
    #[error("{} is in use by {}\n  = help: wait for it to end, or give another \
             --out", output.display(), describe_holders(holders))]
    Busy {
        /// The path of the result that was asked for.
        output: PathBuf,
        /// The processes that work on it, as far as their names could be read.
        holders: Vec<LockHolder>,
    },
    /// The run folder belongs to another plan, or to a build whose numbers may differ.
    #[error(
        "{} was begun with another plan or by another build:\n{}  = help: end it with that plan \
         and build, give another --out, or start over with --fresh (which deletes that folder's \
         finished chunks)",
        folder.display(),
        list_differences(differences)
    )]
    PlanDiffers {
        /// The run folder.
        folder: PathBuf,
        /// The differences between the plans.
        differences: Vec<PlanDifference>,
    },
    /// The output is the result of another plan, or of a build whose numbers may differ.
    #[error(
        "{} already holds the result of another plan or build:\n{}  = help: give another --out, or \
         replace it with --fresh",
        output.display(),
        list_differences(differences)
    )]
    OutputDiffers {
        /// The result.
        output: PathBuf,
        /// The differences between the plans.
        differences: Vec<PlanDifference>,
    },
    /// A shard that does not fit the run, or a plan that is too long for a plan file.
    #[error("{0}")]
    Refused(String),
    /// Chunks are missing, so that the result cannot be written.
    #[error("{} is incomplete: {missing} of {chunks} chunks are missing{}\n  = help: \
         {}", folder.display(), describe_shards(missing_shards), completion_advice(missing_shards))]
    Incomplete {
        /// The run folder.
        folder: PathBuf,
        /// The number of missing chunks.
        missing: u64,
        /// The number of all chunks.
        chunks: u64,
        /// The shards of the missing chunks, as a list such as `2,5-7`, if the run is divided into
        /// shards.
        missing_shards: Option<String>,
    },
    /// Neither the folder nor the output exists.
    #[error("there is no run at {}: neither {} nor that file exists\n  = help: start it with \
             `sweep run`",
        output.display(), folder.display())]
    NoRun {
        /// The requested output.
        output: PathBuf,
        /// The folder in which a run on this output would work.
        folder: PathBuf,
    },
    /// A result was requested before it is finished.
    #[error("{} is not finished: {}, in {}\n  = help: give the command again that began it, and it \
             goes on from there",
        .output.display(), .progress, .folder.display())]
    Unfinished {
        /// The path of the result.
        output: PathBuf,
        /// The number of finished points, in words.
        progress: String,
        /// The folder of the unfinished work.
        folder: PathBuf,
    },
    /// The engine returned rows that do not fit their chunk, which is a defect of this program.
    #[error(
        "internal error in points {first} to {last}: {reason}\n  = help: \
         the other chunks are kept; please report this with the grid file"
    )]
    Engine {
        /// The first point of the chunk.
        first: u64,
        /// The last point of the chunk.
        last: u64,
        /// The reason.
        reason: String,
    },
    /// An error of the Arrow or Parquet library: a defect of this program, or a file without the
    /// expected content.
    #[error("cannot {action} {}: {source}", path.display())]
    Parquet {
        /// The attempted action: `"write"`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The error of the library.
        source: parquet::errors::ParquetError,
    },
    /// The worker threads could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
}

/// A process that works on an output.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct LockHolder {
    /// The process id.
    pub pid: u32,
    /// The name of the host on which the process runs.
    pub host: String,
    /// The shard that it computes, from 1; `None` for the whole run.
    pub shard: Option<u64>,
}

impl StoreError {
    /// Returns a function that turns an I/O error at a file into an error of the store.
    pub fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let to_file_error = FileError::io(action, path);
        move |source| Self::File(to_file_error(source))
    }

    /// Returns a function that turns an error of the Parquet library into an error of the store. An
    /// I/O error in it is unwrapped.
    pub fn parquet(
        action: &'static str,
        path: &Path,
    ) -> impl Fn(parquet::errors::ParquetError) -> Self {
        let path = path.to_path_buf();
        move |error| match error {
            parquet::errors::ParquetError::External(inner) => match inner.downcast::<io::Error>() {
                Ok(source) => FileError::Io { action, path: path.clone(), source: *source }.into(),
                Err(inner) => Self::Parquet {
                    action,
                    path: path.clone(),
                    source: parquet::errors::ParquetError::External(inner),
                },
            },
            source => Self::Parquet { action, path: path.clone(), source },
        }
    }

    /// Returns whether the request was refused before any work, because it does not fit the
    /// existing files.
    pub fn is_refusal(&self) -> bool {
        match self {
            Self::PlanDiffers { .. }
            | Self::OutputDiffers { .. }
            | Self::Refused(_)
            | Self::Unfinished { .. } => true,
            Self::Threads(error) => error.is_refusal(),
            Self::File(error) => error.is_refusal(),
            Self::Parquet { action, .. } => *action == "read",
            _ => false,
        }
    }
}

fn completion_advice(missing_shards: &Option<String>) -> &'static str {
    match missing_shards {
        Some(_) => "run those shards again, or run the same command as `sweep run` without --shard",
        None => "run `sweep run` with the same grid: it computes what is missing",
    }
}

fn describe_shards(missing_shards: &Option<String>) -> String {
    missing_shards
        .as_ref()
        .map_or(String::new(), |shard_numbers| format!(", of shards {shard_numbers}"))
}

fn describe_holders(holders: &[LockHolder]) -> String {
    /// The number of processes that are named. Basis: a message of one line. Doubling it names
    /// twice as many.
    const MAX_NAMED_HOLDERS: usize = 4;
    let describe_holder = |LockHolder { pid, host, shard }: &LockHolder| {
        let shard = shard.map_or(String::new(), |shard| format!(" (shard {shard})"));
        format!("process {pid} on {host}{shard}")
    };
    let holder_texts: Vec<String> =
        holders.iter().take(MAX_NAMED_HOLDERS).map(describe_holder).collect();
    match holders.len() {
        0 => "another run".to_owned(),
        1..=MAX_NAMED_HOLDERS => holder_texts.join(", "),
        holder_count => {
            format!("{} and {} more", holder_texts.join(", "), holder_count - MAX_NAMED_HOLDERS)
        }
    }
}

/// Returns differences, one per line.
fn list_differences(differences: &[PlanDifference]) -> String {
    /// The number of differences that are shown. Basis: half of the lines of a terminal. Doubling
    /// it shows twice as many.
    const MAX_LISTED_DIFFERENCES: usize = 12;
    let listed_differences = differences.iter().take(MAX_LISTED_DIFFERENCES);
    let mut text: String =
        listed_differences.map(|difference| format!("  {difference}\n")).collect();
    if differences.len() > MAX_LISTED_DIFFERENCES {
        let hidden_count = differences.len() - MAX_LISTED_DIFFERENCES;
        let plural = if hidden_count == 1 { "" } else { "s" };
        text += &format!("  and {hidden_count} more difference{plural}\n");
    }
    text
}

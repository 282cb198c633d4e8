//! What can go wrong with a run's files, each with the path and what to do about it.

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
    /// Another process runs on this output.
    #[error("{} is in use by {}\n  = help: wait for it to end, or give another \
             --out", output.display(), named(holders))]
    Busy {
        /// The output both want.
        output: PathBuf,
        /// Who holds it, as far as they could be read.
        holders: Vec<Holder>,
    },
    /// The run folder belongs to another plan, or was begun by a build that computes other numbers.
    #[error(
        "{} was begun with another plan or by another build:\n{}  = help: end it with that plan \
         and build, give another --out, or start over with --fresh (which deletes that folder's \
         finished chunks)",
        folder.display(),
        listed(differences)
    )]
    PlanDiffers {
        /// The run folder.
        folder: PathBuf,
        /// Where the plans part.
        differences: Vec<PlanDifference>,
    },
    /// The finished output belongs to another plan, or is of a build that computes other numbers.
    #[error(
        "{} already holds the result of another plan or build:\n{}  = help: give another --out, or \
         replace it with --fresh",
        output.display(),
        listed(differences)
    )]
    OutputDiffers {
        /// The finished file.
        output: PathBuf,
        /// Where the plans part.
        differences: Vec<PlanDifference>,
    },
    /// A shard that does not fit, or a plan with more numbers than a run folder keeps.
    #[error("{0}")]
    Refused(String),
    /// Chunks are missing, so there is no whole result to write.
    #[error("{} is incomplete: {missing} of {chunks} chunks are missing{}\n  = help: \
         {}", folder.display(), of_shards(missing_shards), how_to_complete(missing_shards))]
    Incomplete {
        /// The run folder.
        folder: PathBuf,
        /// How many chunks are missing.
        missing: u64,
        /// How many chunks there should be.
        chunks: u64,
        /// The shards they belong to, as a list such as `2,5-7`, if the run was sharded.
        missing_shards: Option<String>,
    },
    /// There is no run to speak of.
    #[error("there is no run at {}: neither {} nor that file exists\n  = help: start it with \
             `sweep run`",
        output.display(), folder.display())]
    NoRun {
        /// The output asked about.
        output: PathBuf,
        /// Its run folder.
        folder: PathBuf,
    },
    /// A result that is asked for before it is whole.
    #[error("{} is not finished: {}, in {}\n  = help: give the command again that began it, and it \
             goes on from there",
        .output.display(), .progress, .folder.display())]
    Unfinished {
        /// The path of the result.
        output: PathBuf,
        /// The points done, in words.
        progress: String,
        /// The folder of its work.
        folder: PathBuf,
    },
    /// The engine handed over something that cannot be a chunk; a defect of this program.
    #[error(
        "internal error in points {first} to {last}: {reason}\n  = help: \
         the other chunks are kept; please report this with the grid file"
    )]
    Engine {
        /// First point of the chunk.
        first: u64,
        /// Last point of the chunk.
        last: u64,
        /// What was wrong.
        reason: String,
    },
    /// Arrow or Parquet refused; a defect of this program or a file that lacks what is looked for.
    #[error("cannot {action} {}: {source}", path.display())]
    Parquet {
        /// What was being done, in the infinitive.
        action: &'static str,
        /// The file it was done to.
        path: PathBuf,
        /// What the library answered.
        source: parquet::errors::ParquetError,
    },
    /// There are no threads to work with.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
}

/// A process that holds an output.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Holder {
    /// Process id.
    pub pid: u32,
    /// Its machine.
    pub host: String,
    /// Its shard, 1-based, if it runs one.
    pub shard: Option<u64>,
}

impl StoreError {
    /// A failure of the Parquet library at a file.
    pub fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let failed = FileError::io(action, path);
        move |source| Self::File(failed(source))
    }

    /// Wraps what the Parquet library reported, as a plain I/O failure where it was one.
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

    /// Whether nothing was begun, because the request does not fit what is there.
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

fn how_to_complete(missing_shards: &Option<String>) -> &'static str {
    match missing_shards {
        Some(_) => "run those shards again, or run the same command as `sweep run` without --shard",
        None => "run `sweep run` with the same grid: it computes what is missing",
    }
}

fn of_shards(missing: &Option<String>) -> String {
    missing.as_ref().map_or(String::new(), |list| format!(", of shards {list}"))
}

fn named(holders: &[Holder]) -> String {
    let name = |Holder { pid, host, shard }: &Holder| {
        let shard = shard.map_or(String::new(), |shard| format!(" (shard {shard})"));
        format!("process {pid} on {host}{shard}")
    };
    let first: Vec<String> = holders.iter().take(4).map(name).collect();
    match holders.len() {
        0 => "another run".to_owned(),
        1..=4 => first.join(", "),
        all => format!("{} and {} more", first.join(", "), all - 4),
    }
}

/// Differences, a line each.
fn listed(differences: &[PlanDifference]) -> String {
    const SHOWN: usize = 12;
    let mut text: String = differences.iter().take(SHOWN).map(|one| format!("  {one}\n")).collect();
    if differences.len() > SHOWN {
        let more = differences.len() - SHOWN;
        let plural = if more == 1 { "" } else { "s" };
        text += &format!("  and {more} more difference{plural}\n");
    }
    text
}

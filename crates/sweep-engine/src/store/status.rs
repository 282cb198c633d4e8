//! Progress of a run, without disturbing it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

use super::open::{self, parts_there, read_part};
use super::plan_file::{Found, PlanFile};
use super::point_parts::PointParts;
use super::read::{NameCounts, failed};
use super::shard::{self, ShardLayout};
use super::{Folder, Holder, Job, StoreError, lock};

/// How far a run is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Nothing is there.
    #[default]
    NotStarted,
    /// Chunks are missing.
    Unfinished,
    /// Every chunk is there and waits for the merge.
    Complete,
    /// The one file is there.
    Finished,
}

/// Progress of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FolderStatus {
    /// The finished file, or where it will be.
    #[serde(serialize_with = "shown")]
    pub output: PathBuf,
    /// How far.
    pub state: State,
    /// Rows of the whole result.
    pub points: u64,
    /// Rows that are there.
    pub points_done: u64,
    /// Of those, rows whose status is not `ok`.
    pub points_failed: u64,
    /// Rows that are there, by status.
    pub by_status: NameCounts,
    /// Chunks of the whole.
    pub chunks: u64,
    /// Chunks that are there and whole.
    pub chunks_done: u64,
    /// Chunks that are not there, or damaged.
    pub chunks_missing: u64,
    /// Chunks that are there but not as they were written; the next run computes them again.
    pub chunks_damaged: Vec<u64>,
    /// Who is at work.
    pub running: Vec<Holder>,
    /// Into how many shards the run was dealt, if it was.
    pub shards: Option<u64>,
    /// Shards with something missing that nobody is working on, as the scheduler numbers them:
    /// `2,5-7`, for `sbatch --array=`; empty if none is.
    pub missing_shards: String,
    /// The same shards by their numbers from 1, for `--shard I/N`.
    pub missing_shard_numbers: Vec<u64>,
}

/// A path as people see it: JSON holds no other bytes than text.
pub(super) fn shown<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&path.display())
}

/// Looks at an output and its folder. What would stop a run is an error here too: another plan in
/// the folder, another result or another file at the output, a damaged result.
///
/// # Errors
/// As [`super::OpenRun::open`], but never [`StoreError::Busy`].
pub fn status(output: &Path, job: &Job<'_>) -> Result<FolderStatus, StoreError> {
    let folder = Folder::of(output, &job.layout)?;
    let parts = PointParts::new(job);
    let chunks = parts.chunks();
    let mut status = FolderStatus {
        output: output.to_path_buf(),
        points: job.points,
        chunks,
        chunks_missing: chunks,
        ..FolderStatus::default()
    };
    let ours = PlanFile::of(job);
    match PlanFile::read(&folder)? {
        Found::Plan(found) => open::refuse_other_plan(&folder, &found, &ours)?,
        Found::Nothing => {
            let Some((_, tally)) = open::finished(&folder, job)? else { return Ok(status) };
            return Ok(FolderStatus {
                state: State::Finished,
                points_done: tally.points,
                points_failed: failed(&tally.by_status),
                by_status: tally.by_status,
                chunks_done: chunks,
                chunks_missing: 0,
                ..status
            });
        }
        Found::Damaged => {}
    }
    let mut present = BTreeSet::new();
    for chunk in parts_there(&folder)?.into_iter().filter(|chunk| *chunk < chunks) {
        let range = parts.range(chunk);
        let mut by_status = NameCounts::new();
        let points = read_part(&parts, &folder, chunk, |part| {
            part.add_statuses(&mut by_status)?;
            Ok(part.points())
        });
        match points? {
            Ok(Some(points)) => {
                if points == range.end - range.start {
                    present.insert(chunk);
                }
                status.points_done += points;
                for (name, count) in by_status {
                    *status.by_status.entry(name).or_default() += count;
                }
            }
            Err(_) => status.chunks_damaged.push(chunk),
            // The run was finished, or the part set aside, a moment ago.
            Ok(None) => {}
        }
    }
    status.chunks_done = present.len() as u64;
    status.points_failed = failed(&status.by_status);
    status.chunks_missing = chunks - status.chunks_done;
    status.state = if status.chunks_missing == 0 { State::Complete } else { State::Unfinished };
    status.running = lock::holders(&folder);
    if let Some(dealing) = ShardLayout::read(&folder)? {
        let running =
            |shard: &u64| status.running.iter().any(|holder| holder.shard == Some(*shard));
        let missing =
            dealing.incomplete(chunks, &present).into_iter().filter(|shard| !running(shard));
        status.missing_shard_numbers = missing.collect();
        let array_ids =
            status.missing_shard_numbers.iter().map(|shard| shard - 1 + dealing.first_array_id);
        status.missing_shards = shard::list(array_ids);
        status.shards = Some(dealing.shards);
    }
    Ok(status)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn a_path_that_is_no_text_is_shown() {
        use std::os::unix::ffi::OsStrExt as _;
        let output = std::ffi::OsStr::from_bytes(b"o\xff.parquet").into();
        let status = FolderStatus { output, ..FolderStatus::default() };
        assert_eq!(serde_json::json!(status)["output"], "o\u{fffd}.parquet");
    }
}

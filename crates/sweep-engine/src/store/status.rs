//! The progress of a run. Looking at it does not disturb the run.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

use super::open::{self, list_part_indices, read_part};
use super::plan_file::{PlanFile, StoredPlan};
use super::point_parts::PointParts;
use super::read::{NameCounts, count_failed};
use super::shard::{self, ShardLayout};
use super::{Folder, Job, LockHolder, StoreError, lock};

/// The stage of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RunStage {
    /// There are no chunks.
    #[default]
    NotStarted,
    /// Chunks are missing.
    Unfinished,
    /// All chunks are complete, but not yet merged.
    Complete,
    /// The result exists.
    Finished,
}

/// The progress of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FolderStatus {
    /// The path of the result, which may not exist yet.
    #[serde(serialize_with = "serialize_path")]
    pub output: PathBuf,
    /// The stage.
    pub state: RunStage,
    /// The number of all points.
    pub points: u64,
    /// The number of stored points.
    pub points_done: u64,
    /// The number of stored rows whose status is not `ok`.
    pub points_failed: u64,
    /// The number of stored rows of each status.
    pub by_status: NameCounts,
    /// The number of all chunks.
    pub chunks: u64,
    /// The number of complete chunks.
    pub chunks_done: u64,
    /// The number of chunks that are missing, incomplete or damaged.
    pub chunks_missing: u64,
    /// The chunks whose part is damaged; the next run computes them again.
    pub chunks_damaged: Vec<u64>,
    /// The processes that work on the run.
    pub running: Vec<LockHolder>,
    /// The number of shards, if the run is divided into shards.
    pub shards: Option<u64>,
    /// The incomplete shards on which no process works, in the scheduler's numbers: `2,5-7`, for
    /// `sbatch --array=`; empty if there are none.
    pub missing_shards: String,
    /// The numbers of these shards from 1, for `--shard I/N`.
    pub missing_shard_numbers: Vec<u64>,
}

/// Serialises a path as text, because JSON cannot hold other bytes.
pub(super) fn serialize_path<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&path.display())
}

/// Reads the progress of a run. Files that would make a run fail are errors here too: another plan
/// in the folder, another result or a foreign file at the output, a damaged result.
///
/// # Errors
/// The errors of [`super::OpenRun::open`] except [`StoreError::Busy`].
pub fn read_status(output: &Path, job: &Job<'_>) -> Result<FolderStatus, StoreError> {
    let folder = Folder::new(output, &job.layout)?;
    let point_parts = PointParts::new(job);
    let chunks = point_parts.chunk_count();
    let mut status = FolderStatus {
        output: output.to_path_buf(),
        points: job.points,
        chunks,
        chunks_missing: chunks,
        ..FolderStatus::default()
    };
    let job_plan = PlanFile::new(job);
    match PlanFile::read(&folder)? {
        StoredPlan::Plan(stored_plan) => open::refuse_other_plan(&folder, &stored_plan, &job_plan)?,
        StoredPlan::Nothing => {
            let Some((_, tally)) = open::find_finished_result(&folder, job)? else {
                return Ok(status);
            };
            return Ok(FolderStatus {
                state: RunStage::Finished,
                points_done: tally.points,
                points_failed: count_failed(&tally.by_status),
                by_status: tally.by_status,
                chunks_done: chunks,
                chunks_missing: 0,
                ..status
            });
        }
        StoredPlan::Damaged => {}
    }
    let mut complete_chunks = BTreeSet::new();
    for chunk in list_part_indices(&folder)?.into_iter().filter(|chunk| *chunk < chunks) {
        let range = point_parts.chunk_range(chunk);
        let mut by_status = NameCounts::new();
        let points = read_part(&point_parts, &folder, chunk, |part| {
            part.add_status_counts(&mut by_status)?;
            Ok(part.point_count())
        });
        match points? {
            Ok(Some(points)) => {
                if points == range.end - range.start {
                    complete_chunks.insert(chunk);
                }
                status.points_done += points;
                for (name, count) in by_status {
                    *status.by_status.entry(name).or_default() += count;
                }
            }
            Err(_) => status.chunks_damaged.push(chunk),
            // Another process has deleted or renamed the part since it was listed.
            Ok(None) => {}
        }
    }
    status.chunks_done = complete_chunks.len() as u64;
    status.points_failed = count_failed(&status.by_status);
    status.chunks_missing = chunks - status.chunks_done;
    status.state =
        if status.chunks_missing == 0 { RunStage::Complete } else { RunStage::Unfinished };
    status.running = lock::find_holders(&folder);
    if let Some(layout) = ShardLayout::read(&folder)? {
        let is_running =
            |shard: &u64| status.running.iter().any(|holder| holder.shard == Some(*shard));
        let missing_shards = layout
            .incomplete_shards(chunks, &complete_chunks)
            .into_iter()
            .filter(|shard| !is_running(shard));
        status.missing_shard_numbers = missing_shards.collect();
        let array_ids =
            status.missing_shard_numbers.iter().map(|shard| shard - 1 + layout.first_array_id);
        status.missing_shards = shard::format_numbers(array_ids);
        status.shards = Some(layout.shards);
    }
    Ok(status)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn a_path_that_is_not_utf8_is_serialized() {
        use std::os::unix::ffi::OsStrExt as _;
        let output = std::ffi::OsStr::from_bytes(b"o\xff.parquet").into();
        let status = FolderStatus { output, ..FolderStatus::default() };
        assert_eq!(serde_json::json!(status)["output"], "o\u{fffd}.parquet");
    }
}

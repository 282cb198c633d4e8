//! Opening of a run: checks that the output and its folder belong to the same plan, and finds out
//! which chunks exist.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs;
use std::io::ErrorKind;
use std::ops::Range;
use std::path::Path;
use std::sync::{Mutex, MutexGuard};

use arrow_schema::Schema;
use serde_json::json;

use super::differences::PlanDifference;
use super::lock::Lock;
use super::own_files;
use super::part::{PartDamage, PartError};
use super::plan_file::{PlanFile, StoredPlan, format_json, rename_damaged};
use super::point_parts::{PointPart, PointParts};
use super::provenance::Session;
use super::read::{self, NameCounts, ResultFile, Tally};
use super::schema::PointRows;
use super::shard::{self, Shard, ShardLayout, ShardRequest};
use super::{Folder, Job, PLAN_FILE, part_index, part_name};
use crate::{Environment, StoreError};
use sweep_files::panics::lock;
use sweep_files::{FileError, ParquetFile, atomic, regular};

/// The options of opening a run.
#[derive(Clone, Copy)]
pub struct OpenOptions<'a> {
    /// Whether to start over: finished chunks are deleted at once; a finished result stays until
    /// the new one replaces it.
    pub starts_over: bool,
    /// The shard to compute; if `None`, the scheduler's environment variables give it.
    pub shard: Option<ShardRequest>,
    /// The function that looks up the scheduler's environment variables.
    pub environment: Environment<'a>,
}

/// The outcome of opening an output.
#[derive(Debug)]
pub enum OpenOutcome<F, T> {
    /// The output exists, complete and of the same plan.
    Finished(F),
    /// Work remains to be done. The value holds the lock.
    Open(T),
}

/// A run whose folder this process has locked.
#[derive(Debug)]
pub struct OpenRun {
    /// The paths of the result and of its folder of unfinished work.
    pub folder: Folder,
    /// The lock of the folder.
    pub lock: Lock,
    point_parts: PointParts,
    /// The shard of this process and the division into shards, if the run is divided.
    shard: Option<(Shard, ShardLayout)>,
    /// The chunks of this process that are complete; behind a mutex because workers read the set
    /// while the writer adds to it.
    complete_chunks: Mutex<BTreeSet<u64>>,
    /// The rows of this process's incomplete chunks, until [`OpenRun::take_incomplete_chunks`].
    incomplete_chunks: Mutex<BTreeMap<u64, Vec<PointRows>>>,
    notes: Vec<String>,
}

impl OpenRun {
    /// Locks the output for this job, writes its plan or compares it with the one that an earlier
    /// process has written, and reads the chunks that exist.
    ///
    /// # Errors
    /// [`StoreError::Busy`] if another run has locked the output, [`StoreError::PlanDiffers`],
    /// [`StoreError::OutputDiffers`] if the output is the result of another plan,
    /// [`StoreError::Refused`] for a shard that does not fit, [`StoreError::File`] for a file of
    /// another program at the output, and for errors of the file system.
    pub fn open(
        output: &Path,
        job: &Job<'_>,
        options: OpenOptions<'_>,
    ) -> Result<OpenOutcome<(ResultFile, Tally), Self>, StoreError> {
        let folder = Folder::new(output, &job.layout)?;
        let resolve_with =
            |stored_layout| shard::resolve_shard(options.shard, options.environment, stored_layout);
        let mut shard = None;
        let find_shard_index = || {
            shard = resolve_with(ShardLayout::read(&folder)?)?;
            if options.starts_over && shard.is_some() {
                return Err(StoreError::Refused(format!(
                    "--fresh would delete what the other shards have done\n  = help: delete {} \
                     first, then start the shards",
                    folder.path.display()
                )));
            }
            Ok(shard.map(|(shard, _)| shard.index))
        };
        let find_finished = || find_finished_result(&folder, job);
        let (lock, notes) =
            match claim_folder(&folder, job, options.starts_over, find_shard_index, find_finished)?
            {
                OpenOutcome::Finished(found) => return Ok(OpenOutcome::Finished(found)),
                OpenOutcome::Open(lock_and_notes) => lock_and_notes,
            };
        if let Some((_, layout)) = shard {
            let stored_layout = layout.write_if_absent(&folder)?;
            shard = resolve_with(Some(stored_layout))?;
        }
        let mut run = Self {
            folder,
            lock,
            point_parts: PointParts::new(job),
            shard,
            complete_chunks: Mutex::default(),
            incomplete_chunks: Mutex::default(),
            notes,
        };
        run.rescan_parts()?;
        Ok(OpenOutcome::Open(run))
    }

    /// Opens the folder of a run in order to join the chunks of its shards. It never begins a run.
    ///
    /// # Errors
    /// [`StoreError::NoRun`] if neither folder nor output exists, and the errors of
    /// [`OpenRun::open`].
    pub fn open_for_merge(
        output: &Path,
        job: &Job<'_>,
    ) -> Result<OpenOutcome<(ResultFile, Tally), Self>, StoreError> {
        let folder = Folder::new(output, &job.layout)?;
        if !folder.path.exists() && !output.exists() {
            return Err(StoreError::NoRun { output: output.to_path_buf(), folder: folder.path });
        }
        Self::open(
            output,
            job,
            OpenOptions { starts_over: false, shard: None, environment: &|_| None },
        )
    }

    /// Reads the chunks again, and renames parts that are damaged.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn rescan_parts(&mut self) -> Result<(), StoreError> {
        let mut complete_chunks = BTreeSet::new();
        let mut incomplete_chunks = BTreeMap::new();
        for chunk in list_part_indices(&self.folder)? {
            if chunk >= self.chunk_count() || !self.owns_chunk(chunk) {
                continue;
            }
            let chunk_points = self.chunk_length(chunk);
            let rows_if_incomplete = self.read(chunk, |part| {
                if part.point_count() == chunk_points {
                    Ok(None)
                } else {
                    part.read_point_rows().map(Some)
                }
            })?;
            match rows_if_incomplete {
                Some(None) => {
                    complete_chunks.insert(chunk);
                }
                Some(Some(rows_if_incomplete)) => {
                    incomplete_chunks.insert(chunk, rows_if_incomplete);
                }
                None => {}
            }
        }
        *self.complete_chunks() = complete_chunks;
        *lock(&self.incomplete_chunks) = incomplete_chunks;
        Ok(())
    }

    /// Reads the part of a complete chunk. Returns `None` if there is none, or if it is damaged; a
    /// damaged part is renamed and noted.
    pub(super) fn read_complete_chunk<T>(
        &mut self,
        chunk: u64,
        read: impl FnOnce(&PointPart<'_>) -> Result<T, PartError>,
    ) -> Result<Option<T>, StoreError> {
        let chunk_points = self.chunk_length(chunk);
        let value = self.read(chunk, |part| {
            if part.point_count() == chunk_points { read(part).map(Some) } else { Ok(None) }
        })?;
        let value = value.flatten();
        if value.is_none() {
            self.complete_chunks().remove(&chunk);
        }
        Ok(value)
    }

    /// Returns the stored rows of a point, whichever process has computed them.
    pub fn find_stored_rows(&self, point: u64) -> Option<PointRows> {
        let part = self.point_parts.open(&self.folder, self.chunk_of(point)).ok()??;
        part.read_point_rows().ok()?.into_iter().find(|rows| rows.point == point)
    }

    /// Reads the part of a chunk, if there is one. A damaged part is renamed and noted.
    fn read<T>(
        &mut self,
        chunk: u64,
        read: impl FnOnce(&PointPart<'_>) -> Result<T, PartError>,
    ) -> Result<Option<T>, StoreError> {
        match read_part(&self.point_parts, &self.folder, chunk, read)? {
            Ok(found) => Ok(found),
            Err(damage) => {
                let note = rename_damaged_part(&self.folder, chunk, damage)?;
                self.notes.push(note);
                Ok(None)
            }
        }
    }

    /// Writes the rows of a chunk, in any order; when this returns, they survive a power cut. The
    /// next process resumes an incomplete chunk.
    ///
    /// # Errors
    /// [`StoreError::Engine`] if the rows are not of this chunk, [`StoreError::File`].
    pub fn write_chunk(
        &self,
        job: &Job<'_>,
        chunk: u64,
        mut chunk_rows: Vec<PointRows>,
    ) -> Result<(), StoreError> {
        chunk_rows.sort_by_key(|point_rows| point_rows.point);
        let bytes = self.point_parts.encode(job, chunk, &chunk_rows)?;
        let point_count = chunk_rows.len() as u64;
        let is_complete = point_count == self.chunk_length(chunk);
        // Another process with the same shard may have written more rows of this chunk.
        if !is_complete
            && let Ok(Some(stored_points)) =
                read_part(&self.point_parts, &self.folder, chunk, |part| Ok(part.point_count()))?
            && stored_points > point_count
        {
            return Ok(());
        }
        atomic::write(&self.folder.path, &self.folder.file(part_name(chunk)), &bytes)?;
        if is_complete {
            self.complete_chunks().insert(chunk);
        } else {
            lock(&self.incomplete_chunks).insert(chunk, chunk_rows);
        }
        Ok(())
    }

    /// Counts the stored rows of this process's chunks by status.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn count_statuses(&mut self) -> Result<NameCounts, StoreError> {
        let mut counts = NameCounts::new();
        let chunks = self.complete_chunks().clone();
        for chunk in chunks {
            self.read_complete_chunk(chunk, |part| part.add_status_counts(&mut counts))?;
        }
        Ok(counts)
    }

    /// Takes the stored rows of incomplete chunks, from which this process resumes them.
    pub fn take_incomplete_chunks(&self) -> BTreeMap<u64, Vec<PointRows>> {
        std::mem::take(&mut *lock(&self.incomplete_chunks))
    }

    /// Returns the number of chunks of the whole run.
    pub const fn chunk_count(&self) -> u64 {
        self.point_parts.chunk_count()
    }

    /// Returns the points of a chunk.
    pub fn chunk_range(&self, chunk: u64) -> Range<u64> {
        self.point_parts.chunk_range(chunk)
    }

    /// Returns the number of points of a chunk.
    fn chunk_length(&self, chunk: u64) -> u64 {
        let range = self.chunk_range(chunk);
        range.end - range.start
    }

    /// Returns the chunk of a point.
    pub const fn chunk_of(&self, point: u64) -> u64 {
        self.point_parts.chunk_of(point)
    }

    /// Returns the shard of this process; `None` if it computes the whole run.
    pub fn shard(&self) -> Option<Shard> {
        self.shard.map(|(shard, _)| shard)
    }

    fn owns_chunk(&self, chunk: u64) -> bool {
        self.shard().is_none_or(|shard| shard.owns_chunk(chunk))
    }

    /// Returns whether this process still has to compute a chunk.
    pub fn is_missing(&self, chunk: u64) -> bool {
        self.owns_chunk(chunk) && !self.complete_chunks().contains(&chunk)
    }

    fn complete_chunks(&self) -> MutexGuard<'_, BTreeSet<u64>> {
        lock(&self.complete_chunks)
    }

    /// Returns the number of points that this process has to compute, and how many of them are
    /// stored.
    pub fn count_own_points(&self) -> (u64, u64) {
        let chunks = self.chunk_count();
        let own_chunks = self.shard().map_or(chunks, |shard| shard.count_chunks(chunks));
        let full_chunk_points = self.chunk_length(0);
        // Every chunk of a run is full, except perhaps the last.
        let missing_in_last_chunk = match chunks.checked_sub(1) {
            Some(last) if self.owns_chunk(last) => full_chunk_points - self.chunk_length(last),
            _ => 0,
        };
        let mut stored_points: u64 =
            self.complete_chunks().iter().map(|&chunk| self.chunk_length(chunk)).sum();
        for rows in lock(&self.incomplete_chunks).values() {
            stored_points += rows.len() as u64;
        }
        (
            own_chunks.saturating_mul(full_chunk_points).saturating_sub(missing_in_last_chunk),
            stored_points,
        )
    }

    /// Takes the notes for the user: damaged chunks, a file system without locks.
    pub fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Writes a record of this process's work to the folder, for the sidecar of the process that
    /// finishes the run.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn record_session(&self, session: &Session) -> Result<(), StoreError> {
        let file_name =
            format!("session-{}-{}-{}.json", session.host, session.pid, session.started_unix_s);
        let path = self.folder.file(file_name.replace(['/', '\0'], "_"));
        Ok(atomic::write(&self.folder.path, &path, &format_json(&json!(session)))?)
    }

    /// Returns the error about the missing chunks and the shards to which they belong.
    pub fn incomplete_error(&self) -> Result<StoreError, StoreError> {
        let chunks = self.chunk_count();
        let complete_chunks = self.complete_chunks();
        let layout = ShardLayout::read(&self.folder)?;
        Ok(StoreError::Incomplete {
            folder: self.folder.path.clone(),
            missing: chunks - complete_chunks.len() as u64,
            chunks,
            missing_shards: layout.map(|layout| {
                shard::format_numbers(layout.incomplete_shards(chunks, &complete_chunks))
            }),
        })
    }
}

/// Reads the part of a chunk. Returns `None` if there is no file, and the damage if the file is no
/// such part.
pub(super) fn read_part<T>(
    parts: &PointParts,
    folder: &Folder,
    chunk: u64,
    read: impl FnOnce(&PointPart<'_>) -> Result<T, PartError>,
) -> Result<Result<Option<T>, PartDamage>, StoreError> {
    let result = parts.open(folder, chunk).and_then(|part| part.as_ref().map(read).transpose());
    PartError::separate_damage(result)
}

/// Renames a damaged part to `*.damaged`, and returns a note about it.
pub(super) fn rename_damaged_part(
    folder: &Folder,
    index: u64,
    damage: PartDamage,
) -> Result<String, StoreError> {
    let path = folder.file(part_name(index));
    let new_path = rename_damaged(&path)?;
    let new_path = new_path.file_name().unwrap_or_default().to_string_lossy();
    let path = path.display();
    Ok(format!("{path}: {damage}; kept as {new_path} and computed again"))
}

/// Returns the indices of the parts in a folder.
pub(super) fn list_part_indices(folder: &Folder) -> Result<BTreeSet<u64>, StoreError> {
    let mut indices = BTreeSet::new();
    for name in regular::file_names(&folder.path).map_err(StoreError::io("list", &folder.path))? {
        indices.extend(name.to_str().and_then(part_index));
    }
    Ok(indices)
}

/// Returns the result at the output after checks; `None` if there is none.
///
/// # Errors
/// [`StoreError::OutputDiffers`] if the file is of another plan or build.
pub(super) fn find_finished_result(
    folder: &Folder,
    job: &Job<'_>,
) -> Result<Option<(ResultFile, Tally)>, StoreError> {
    let Some((file, result)) = open_result_of_same_plan(folder, job)? else { return Ok(None) };
    if let Some(difference) = find_column_difference(file.schema(), &job.layout.schema()) {
        let output = folder.output.clone();
        return Err(StoreError::OutputDiffers { output, differences: vec![difference] });
    }
    let tally = read::tally_rows(&file)?;
    Ok(Some((result, tally)))
}

/// Returns the file at the output and its metadata; `None` if there is no file.
///
/// # Errors
/// [`StoreError::OutputDiffers`] if the file is of another plan or build; [`FileError::Rewritten`].
pub(super) fn open_result_of_same_plan(
    folder: &Folder,
    job: &Job<'_>,
) -> Result<Option<(ParquetFile, ResultFile)>, StoreError> {
    match fs::metadata(&folder.output) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        // Some programs create an empty file before they write its content.
        Ok(metadata) if metadata.len() == 0 => return Ok(None),
        _ => {}
    }
    let file = ParquetFile::open(&folder.output)?;
    let kind = job.layout.kind;
    let result = ResultFile::read(&file, kind).ok_or_else(|| {
        read::content_error(&file, format!("its metadata is not that of a {}", kind.name()))
    })?;
    if result.plan_hash == job.hash().to_hex().as_str() {
        // This build writes a digest into every result.
        if !file.is_sealed() {
            return Err(FileError::Rewritten { path: folder.output.clone() }.into());
        }
        return Ok(Some((file, result)));
    }
    let ResultFile { plan, version, numerics, .. } = result;
    let job_plan = PlanFile::new(job);
    let differences =
        PlanFile { plan, version, numerics, ..job_plan.clone() }.differences(&job_plan);
    Err(StoreError::OutputDiffers { output: folder.output.clone(), differences })
}

/// Returns the difference between the columns of two builds for the same plan, if there is one.
fn find_column_difference(older: &Schema, present: &Schema) -> Option<PlanDifference> {
    let [older_names, present_names] = [older, present].map(|schema| -> Vec<&str> {
        schema.fields().iter().map(|field| field.name().as_str()).collect()
    });
    let names_without = |names: &[&str], others: &[&str]| {
        let mut remaining_names = names.to_vec();
        remaining_names.retain(|name| !others.contains(name));
        (!remaining_names.is_empty()).then(|| remaining_names.join(", "))
    };
    let pointer = "/columns".to_owned();
    (older_names != present_names).then(|| PlanDifference {
        pointer,
        older_value: names_without(&older_names, &present_names),
        present_value: names_without(&present_names, &older_names),
    })
}

/// Locks a folder, for a shard if `shard` returns one, and writes the plan to it, or checks that
/// the stored plan is the same. If no plan is stored and the work is not to start over,
/// `find_finished` is called first; if it returns a result, nothing is written. Returns the lock
/// with notes for the user.
pub(super) fn claim_folder<T>(
    folder: &Folder,
    job: &Job<'_>,
    fresh: bool,
    shard: impl FnOnce() -> Result<Option<u64>, StoreError>,
    find_finished: impl Fn() -> Result<Option<T>, StoreError>,
) -> Result<OpenOutcome<T, (Lock, Vec<String>)>, StoreError> {
    if !fresh
        && !folder.path.exists()
        && let Some(result) = find_finished()?
    {
        return Ok(OpenOutcome::Finished(result));
    }
    let lock = Lock::acquire(folder, shard()?)?;
    let mut notes: Vec<String> = lock.note_missing_locks(folder).into_iter().collect();
    if fresh {
        own_files::delete_own_files(folder)?;
    }
    atomic::clear_leftovers(&folder.path);
    let job_plan = PlanFile::new(job);
    match PlanFile::read(folder)? {
        StoredPlan::Plan(stored_plan) => refuse_other_plan(folder, &stored_plan, &job_plan)?,
        StoredPlan::Damaged => {
            let new_path = rename_damaged(&folder.file(PLAN_FILE))?;
            notes.push(format!("the frozen plan was damaged; kept as {}", new_path.display()));
            job_plan.write_if_absent(folder)?;
        }
        StoredPlan::Nothing => {
            if !fresh && let Some(result) = find_finished()? {
                // A process that was killed after publishing its result has left the folder.
                remove_folder(folder, lock);
                return Ok(OpenOutcome::Finished(result));
            }
            job_plan.write_if_absent(folder)?;
            // Another shard may have written another plan in the meantime.
            if let StoredPlan::Plan(stored_plan) = PlanFile::read(folder)? {
                refuse_other_plan(folder, &stored_plan, &job_plan)?;
            }
        }
    }
    Ok(OpenOutcome::Open((lock, notes)))
}

/// Refuses a folder in which a run of another plan has begun.
pub(super) fn refuse_other_plan(
    folder: &Folder,
    stored_plan: &PlanFile,
    job_plan: &PlanFile,
) -> Result<(), StoreError> {
    if stored_plan == job_plan {
        return Ok(());
    }
    Err(StoreError::PlanDiffers {
        folder: folder.path.clone(),
        differences: stored_plan.differences(job_plan),
    })
}

/// Removes the folder of a finished run. Files that the run has not written, or has renamed as
/// damaged, stay, and the folder with them. The result does not depend on the folder, so a failure
/// is returned as a note.
pub(super) fn remove_folder(folder: &Folder, lock: Lock) -> Option<String> {
    let path = folder.path.display();
    let removal_result = own_files::delete_own_files(folder).and_then(|remaining_files| {
        lock.delete()?;
        if remaining_files.is_empty() {
            let removal_result = regular::none_if_missing(fs::remove_dir(&folder.path));
            removal_result.map_err(StoreError::io("remove the folder", &folder.path))?;
        }
        Ok(remaining_files)
    });
    match removal_result {
        Ok(remaining_files) if remaining_files.is_empty() => None,
        Ok(remaining_files) => Some(format!(
            "the result is whole; {path} stays, for it holds what this run did not write or has \
             set aside: {}; delete it when you do not need that",
            abbreviate(&remaining_files)
        )),
        Err(error) => Some(format!(
            "the result is whole, but {path} could not be removed; delete it by hand ({})",
            error.to_string().lines().next().unwrap_or_default()
        )),
    }
}

/// Returns the first names of a list, and the number of further ones.
fn abbreviate(names: &[OsString]) -> String {
    /// The number of names that are shown. Basis: a note of one line. Doubling it shows twice as
    /// many.
    const MAX_SHOWN_NAMES: usize = 4;
    let shown_names: Vec<String> = names
        .iter()
        .take(MAX_SHOWN_NAMES)
        .map(|name| name.to_string_lossy().into_owned())
        .collect();
    match names.len().saturating_sub(MAX_SHOWN_NAMES) {
        0 => shown_names.join(", "),
        hidden_count => format!("{} and {hidden_count} more", shown_names.join(", ")),
    }
}

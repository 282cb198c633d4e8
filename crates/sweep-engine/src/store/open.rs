//! Opening a run on an output: whose it is, what is there, what is missing.

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
use super::own;
use super::part::{Damage, Unreadable};
use super::plan_file::{Found, PlanFile, pretty, set_aside};
use super::point_parts::{PointPart, PointParts};
use super::provenance::Session;
use super::read::{self, NameCounts, ResultFile, Tally};
use super::schema::Done;
use super::shard::{self, Shard, ShardLayout, ShardRequest};
use super::{Folder, Job, PLAN, part_index, part_name};
use crate::{Environment, StoreError};
use sweep_files::panics::lock;
use sweep_files::{FileError, ParquetFile, atomic, regular};

/// How a run is opened.
#[derive(Clone, Copy)]
pub struct OpenOptions<'a> {
    /// Start over: finished chunks go now, a finished file stays until the new one takes its place.
    pub fresh: bool,
    /// Which part to compute; if `None`, the scheduler's variables say.
    pub shard: Option<ShardRequest>,
    /// Looks up the scheduler's variables.
    pub environment: Environment<'a>,
}

/// What opening an output came to.
#[derive(Debug)]
pub enum Opened<F, T> {
    /// The output is there, whole, and of this very plan.
    Finished(F),
    /// There is something to do, by what holds the lock.
    Open(T),
}

/// A run folder this process has a right to.
#[derive(Debug)]
pub struct OpenRun {
    /// Its paths.
    pub folder: Folder,
    /// What it holds.
    pub lock: Lock,
    parts: PointParts,
    dealt: Option<(Shard, ShardLayout)>,
    /// This process's chunks that are there; behind a lock because workers look while the writer
    /// adds.
    present: Mutex<BTreeSet<u64>>,
    /// What there is of this process's other chunks, until it is taken.
    incomplete: Mutex<BTreeMap<u64, Vec<Done>>>,
    notes: Vec<String>,
}

impl OpenRun {
    /// Takes the output for this job, freezes its plan or finds it frozen, and looks through its
    /// chunks.
    ///
    /// # Errors
    /// [`StoreError::Busy`] when another run holds the output, [`StoreError::PlanDiffers`],
    /// [`StoreError::OutputDiffers`] when another result is there already, [`StoreError::Refused`]
    /// for a part that does not fit, [`StoreError::File`] for anything else at the output that is
    /// not ours, and for the file system.
    pub fn open(
        output: &Path,
        job: &Job<'_>,
        options: OpenOptions<'_>,
    ) -> Result<Opened<(ResultFile, Tally), Self>, StoreError> {
        let folder = Folder::of(output, &job.layout)?;
        let resolve = |frozen| shard::resolve(options.shard, options.environment, frozen);
        let mut dealt = None;
        let shard = || {
            dealt = resolve(ShardLayout::read(&folder)?)?;
            if options.fresh && dealt.is_some() {
                return Err(StoreError::Refused(format!(
                    "--fresh would delete what the other shards have done\n  = help: delete {} \
                     first, then start the shards",
                    folder.path.display()
                )));
            }
            Ok(dealt.map(|(shard, _)| shard.index))
        };
        let finished = || finished(&folder, job);
        let (lock, notes) = match claim(&folder, job, options.fresh, shard, finished)? {
            Opened::Finished(found) => return Ok(Opened::Finished(found)),
            Opened::Open(held) => held,
        };
        if let Some((_, dealing)) = dealt {
            let frozen = dealing.freeze(&folder)?;
            dealt = resolve(Some(frozen))?;
        }
        let mut run = Self {
            folder,
            lock,
            parts: PointParts::new(job),
            dealt,
            present: Mutex::default(),
            incomplete: Mutex::default(),
            notes,
        };
        run.rescan()?;
        Ok(Opened::Open(run))
    }

    /// Opens what shards have left, in order to join it; never begins a run.
    ///
    /// # Errors
    /// [`StoreError::NoRun`] when nothing is there; else as [`OpenRun::open`].
    pub fn open_for_merge(
        output: &Path,
        job: &Job<'_>,
    ) -> Result<Opened<(ResultFile, Tally), Self>, StoreError> {
        let folder = Folder::of(output, &job.layout)?;
        if !folder.path.exists() && !output.exists() {
            return Err(StoreError::NoRun { output: output.to_path_buf(), folder: folder.path });
        }
        Self::open(output, job, OpenOptions { fresh: false, shard: None, environment: &|_| None })
    }

    /// Looks through the chunks again, setting aside what is not whole.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn rescan(&mut self) -> Result<(), StoreError> {
        let mut present = BTreeSet::new();
        let mut incomplete = BTreeMap::new();
        for chunk in parts_there(&self.folder)? {
            if chunk >= self.chunks() || !self.owns(chunk) {
                continue;
            }
            let length = self.chunk_length(chunk);
            let outcomes = self.read(chunk, |part| {
                if part.points() == length { Ok(None) } else { part.outcomes().map(Some) }
            })?;
            match outcomes {
                Some(None) => {
                    present.insert(chunk);
                }
                Some(Some(outcomes)) => {
                    incomplete.insert(chunk, outcomes);
                }
                None => {}
            }
        }
        *self.present() = present;
        *lock(&self.incomplete) = incomplete;
        Ok(())
    }

    /// Reads a whole chunk's part; `None` if it is not there, or, with the file set aside and
    /// noted, if it is damaged.
    pub(super) fn read_whole<T>(
        &mut self,
        chunk: u64,
        read: impl FnOnce(&PointPart<'_>) -> Result<T, Unreadable>,
    ) -> Result<Option<T>, StoreError> {
        let length = self.chunk_length(chunk);
        let found = self.read(chunk, |part| {
            if part.points() == length { read(part).map(Some) } else { Ok(None) }
        })?;
        let whole = found.flatten();
        if whole.is_none() {
            self.present().remove(&chunk);
        }
        Ok(whole)
    }

    /// What is kept of a point, by whichever process.
    pub fn known(&self, point: u64) -> Option<Done> {
        let part = self.parts.open(&self.folder, self.chunk_of(point)).ok()??;
        part.outcomes().ok()?.into_iter().find(|done| done.point == point)
    }

    /// Reads the part of a chunk, if there is one. A damaged one is set aside and noted.
    fn read<T>(
        &mut self,
        chunk: u64,
        read: impl FnOnce(&PointPart<'_>) -> Result<T, Unreadable>,
    ) -> Result<Option<T>, StoreError> {
        match read_part(&self.parts, &self.folder, chunk, read)? {
            Ok(found) => Ok(found),
            Err(damage) => {
                let note = set_part_aside(&self.folder, chunk, damage)?;
                self.notes.push(note);
                Ok(None)
            }
        }
    }

    /// Keeps what there is of a chunk, in any order: when this returns, it outlives a power cut.
    /// What is not whole is for the next process to go on from.
    ///
    /// # Errors
    /// [`StoreError::Engine`] when the outcomes are not this chunk's, [`StoreError::File`].
    pub fn write_chunk(
        &self,
        job: &Job<'_>,
        chunk: u64,
        mut outcomes: Vec<Done>,
    ) -> Result<(), StoreError> {
        outcomes.sort_by_key(|outcome| outcome.point);
        let bytes = self.parts.encode(job, chunk, &outcomes)?;
        let count = outcomes.len() as u64;
        let is_whole = count == self.chunk_length(chunk);
        // Another process with the same shard may have done it.
        if !is_whole
            && let Ok(Some(known)) =
                read_part(&self.parts, &self.folder, chunk, |part| Ok(part.points()))?
            && known > count
        {
            return Ok(());
        }
        atomic::write(&self.folder.path, &self.folder.file(part_name(chunk)), &bytes)?;
        if is_whole {
            self.present().insert(chunk);
        } else {
            lock(&self.incomplete).insert(chunk, outcomes);
        }
        Ok(())
    }

    /// How this process's rows that are there ended.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn statuses(&mut self) -> Result<NameCounts, StoreError> {
        let mut counts = NameCounts::new();
        let own = self.present().clone();
        for chunk in own {
            self.read_whole(chunk, |part| part.add_statuses(&mut counts))?;
        }
        Ok(counts)
    }

    /// The outcomes there are of chunks that are not whole, to go on from.
    pub fn take_incomplete(&self) -> BTreeMap<u64, Vec<Done>> {
        std::mem::take(&mut *lock(&self.incomplete))
    }

    /// How many chunks make up the whole result.
    pub const fn chunks(&self) -> u64 {
        self.parts.chunks()
    }

    /// The points of a chunk.
    pub fn chunk_range(&self, chunk: u64) -> Range<u64> {
        self.parts.range(chunk)
    }

    /// The number of points of a chunk.
    fn chunk_length(&self, chunk: u64) -> u64 {
        let range = self.chunk_range(chunk);
        range.end - range.start
    }

    /// The chunk that a point is in.
    pub const fn chunk_of(&self, point: u64) -> u64 {
        self.parts.chunk(point)
    }

    /// The part this process computes, if not the whole.
    pub fn shard(&self) -> Option<Shard> {
        self.dealt.map(|(shard, _)| shard)
    }

    fn owns(&self, chunk: u64) -> bool {
        self.shard().is_none_or(|shard| shard.owns(chunk))
    }

    /// Whether a chunk is this process's to compute and not there yet.
    pub fn is_missing(&self, chunk: u64) -> bool {
        self.owns(chunk) && !self.present().contains(&chunk)
    }

    fn present(&self) -> MutexGuard<'_, BTreeSet<u64>> {
        lock(&self.present)
    }

    /// Points this process answers for, and how many of them are there.
    pub fn own_points(&self) -> (u64, u64) {
        let chunks = self.chunks();
        let own = self.shard().map_or(chunks, |shard| shard.chunks(chunks));
        let full = self.chunk_length(0);
        // All chunks are full but the last of the run.
        let short = match chunks.checked_sub(1) {
            Some(last) if self.owns(last) => full - self.chunk_length(last),
            _ => 0,
        };
        let whole: u64 = self.present().iter().map(|&chunk| self.chunk_length(chunk)).sum();
        let incomplete = lock(&self.incomplete);
        let there = whole + incomplete.values().map(|some| some.len() as u64).sum::<u64>();
        (own.saturating_mul(full).saturating_sub(short), there)
    }

    /// Things a user should hear of once: damaged chunks, a file system without locks.
    pub fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Records this process's work in the folder, for the sidecar of the process that finishes the
    /// run.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn record(&self, session: &Session) -> Result<(), StoreError> {
        let name =
            format!("session-{}-{}-{}.json", session.host, session.pid, session.started_unix_s);
        let path = self.folder.file(name.replace(['/', '\0'], "_"));
        Ok(atomic::write(&self.folder.path, &path, &pretty(&json!(session)))?)
    }

    /// The error that says which chunks, and of which shards, are missing from the whole.
    pub fn incomplete(&self) -> Result<StoreError, StoreError> {
        let chunks = self.chunks();
        let present = self.present();
        let dealing = ShardLayout::read(&self.folder)?;
        Ok(StoreError::Incomplete {
            folder: self.folder.path.clone(),
            missing: chunks - present.len() as u64,
            chunks,
            missing_shards: dealing
                .map(|dealing| shard::list(dealing.incomplete(chunks, &present))),
        })
    }
}

/// Reads the part of a chunk: `None` if there is no file, or why it is no part.
pub(super) fn read_part<T>(
    parts: &PointParts,
    folder: &Folder,
    chunk: u64,
    read: impl FnOnce(&PointPart<'_>) -> Result<T, Unreadable>,
) -> Result<Result<Option<T>, Damage>, StoreError> {
    let found = parts.open(folder, chunk).and_then(|part| part.as_ref().map(read).transpose());
    Unreadable::damage(found)
}

/// Sets the part of this index aside, and returns a note on it.
pub(super) fn set_part_aside(
    folder: &Folder,
    index: u64,
    damage: Damage,
) -> Result<String, StoreError> {
    let path = folder.file(part_name(index));
    let aside = set_aside(&path)?;
    let aside = aside.file_name().unwrap_or_default().to_string_lossy();
    let path = path.display();
    Ok(format!("{path}: {damage}; kept as {aside} and computed again"))
}

/// Returns the indices of the parts that have a file.
pub(super) fn parts_there(folder: &Folder) -> Result<BTreeSet<u64>, StoreError> {
    let mut parts = BTreeSet::new();
    for name in regular::names(&folder.path).map_err(StoreError::io("list", &folder.path))? {
        parts.extend(name.to_str().and_then(part_index));
    }
    Ok(parts)
}

/// The result at the output, checked; `None` if there is none.
///
/// # Errors
/// [`StoreError::OutputDiffers`] if another plan or build made it.
pub(super) fn finished(
    folder: &Folder,
    job: &Job<'_>,
) -> Result<Option<(ResultFile, Tally)>, StoreError> {
    let Some((file, result)) = of_plan(folder, job)? else { return Ok(None) };
    if let Some(apart) = columns_apart(file.schema(), &job.layout.schema()) {
        let (output, differences) = (folder.output.clone(), vec![apart]);
        return Err(StoreError::OutputDiffers { output, differences });
    }
    let tally = read::tally(&file)?;
    Ok(Some((result, tally)))
}

/// The file at the output and its own word, if this very plan and build made it; `None` if there is
/// none.
///
/// # Errors
/// [`StoreError::OutputDiffers`] if another plan or build made it; [`FileError::Rewritten`].
pub(super) fn of_plan(
    folder: &Folder,
    job: &Job<'_>,
) -> Result<Option<(ParquetFile, ResultFile)>, StoreError> {
    match fs::metadata(&folder.output) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        // What some programs make of a file before its content.
        Ok(found) if found.len() == 0 => return Ok(None),
        _ => {}
    }
    let (file, kind) = (ParquetFile::open(&folder.output)?, job.layout.kind);
    let result = ResultFile::of(&file, kind).ok_or_else(|| {
        read::unlike(&file, format!("its metadata is not that of a {}", kind.name()))
    })?;
    if result.plan_hash == job.hash().to_hex().as_str() {
        // Files of this build carry a digest.
        if !file.is_sealed() {
            return Err(FileError::Rewritten { path: folder.output.clone() }.into());
        }
        return Ok(Some((file, result)));
    }
    let ResultFile { plan, version, numerics, .. } = result;
    let ours = PlanFile::of(job);
    let differences = PlanFile { plan, version, numerics, ..ours.clone() }.differences(&ours);
    Err(StoreError::OutputDiffers { output: folder.output.clone(), differences })
}

/// The columns that only one of two builds has for the same plan, if they differ.
fn columns_apart(was: &Schema, is: &Schema) -> Option<PlanDifference> {
    let [was, is] = [was, is].map(|schema| -> Vec<&str> {
        schema.fields().iter().map(|field| field.name().as_str()).collect()
    });
    let only = |some: &[&str], others: &[&str]| {
        let of_some: Vec<_> = some.iter().filter(|name| !others.contains(name)).copied().collect();
        (!of_some.is_empty()).then(|| of_some.join(", "))
    };
    let pointer = "/columns".to_owned();
    (was != is).then(|| PlanDifference { pointer, was: only(&was, &is), is: only(&is, &was) })
}

/// Takes a folder's lock, for the `shard` if it says one, and finds this plan frozen in the folder
/// or freezes it. Where there was none, `finished` has the first word unless the work is to start
/// over: nothing is frozen then, nor is a folder made. With the lock comes what a user should hear
/// of.
pub(super) fn claim<T>(
    folder: &Folder,
    job: &Job<'_>,
    fresh: bool,
    shard: impl FnOnce() -> Result<Option<u64>, StoreError>,
    finished: impl Fn() -> Result<Option<T>, StoreError>,
) -> Result<Opened<T, (Lock, Vec<String>)>, StoreError> {
    if !fresh
        && !folder.path.exists()
        && let Some(finished) = finished()?
    {
        return Ok(Opened::Finished(finished));
    }
    let lock = Lock::acquire(folder, shard()?)?;
    let mut notes: Vec<String> = lock.note(folder).into_iter().collect();
    if fresh {
        own::clear(folder)?;
    }
    atomic::clear_leftovers(&folder.path);
    let ours = PlanFile::of(job);
    match PlanFile::read(folder)? {
        Found::Plan(found) => refuse_other_plan(folder, &found, &ours)?,
        Found::Damaged => {
            let aside = set_aside(&folder.file(PLAN))?;
            notes.push(format!("the frozen plan was damaged; kept as {}", aside.display()));
            ours.freeze(folder)?;
        }
        Found::Nothing => {
            if !fresh && let Some(finished) = finished()? {
                // What dies between publishing its file and removing its folder leaves that.
                remove(folder, lock);
                return Ok(Opened::Finished(finished));
            }
            ours.freeze(folder)?;
            // Another process, a shard, may have been first, with another plan.
            if let Found::Plan(found) = PlanFile::read(folder)? {
                refuse_other_plan(folder, &found, &ours)?;
            }
        }
    }
    Ok(Opened::Open((lock, notes)))
}

/// Refuses a folder that another plan was begun in.
pub(super) fn refuse_other_plan(
    folder: &Folder,
    found: &PlanFile,
    ours: &PlanFile,
) -> Result<(), StoreError> {
    if found == ours {
        return Ok(());
    }
    Err(StoreError::PlanDiffers {
        folder: folder.path.clone(),
        differences: found.differences(ours),
    })
}

/// Removes a folder that has served. What the run has not written, or has set aside, stays with the
/// folder. The result does not depend on it, so a failure is only worth a note.
pub(super) fn remove(folder: &Folder, lock: Lock) -> Option<String> {
    let path = folder.path.display();
    let removed = own::clear(folder).and_then(|others| {
        lock.retire()?;
        if others.is_empty() {
            let removed = regular::if_there(fs::remove_dir(&folder.path));
            removed.map_err(StoreError::io("remove the folder", &folder.path))?;
        }
        Ok(others)
    });
    match removed {
        Ok(others) if others.is_empty() => None,
        Ok(others) => Some(format!(
            "the result is whole; {path} stays, for it holds what this run did not write or has \
             set aside: {}; delete it when you do not need that",
            listed(&others)
        )),
        Err(error) => Some(format!(
            "the result is whole, but {path} could not be removed; delete it by hand ({})",
            error.to_string().lines().next().unwrap_or_default()
        )),
    }
}

/// The first of some names, and how many more there are.
fn listed(names: &[OsString]) -> String {
    const SHOWN: usize = 4;
    let first: Vec<String> =
        names.iter().take(SHOWN).map(|name| name.to_string_lossy().into_owned()).collect();
    match names.len().saturating_sub(SHOWN) {
        0 => first.join(", "),
        more => format!("{} and {more} more", first.join(", ")),
    }
}

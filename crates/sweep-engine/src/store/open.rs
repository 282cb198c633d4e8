//! Opening a run on an output: whose it is, what is there, what is missing.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs;
use std::io::{ErrorKind, Read as _};
use std::ops::Range;
use std::path::Path;
use std::sync::{Mutex, MutexGuard};

use arrow_schema::Schema;
use serde_json::json;

use super::chunk::{self, Damage, Place, Shape};
use super::differences::PlanDifference;
use super::lock::Lock;
use super::own;
use super::plan_file::{Found, PlanFile, pretty, set_aside};
use super::provenance::Session;
use super::read::{self, NameCounts, ResultFile, Tally};
use super::schema::Done;
use super::shard::{self, Shard, ShardLayout, ShardRequest};
use super::{Folder, Job, PLAN, chunk_name, chunk_of_name, chunk_points};
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
    place: Place,
    points: u64,
    chunk_points: u64,
    dealt: Option<(Shard, ShardLayout)>,
    /// This process's chunks that are there; behind a lock because workers look while the writer
    /// adds.
    present: Mutex<BTreeSet<u64>>,
    /// What there is of this process's other chunks, until it is taken.
    parts: Mutex<BTreeMap<u64, Vec<Done>>>,
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
        let place =
            Place { plan: job.hash(), shape: Shape::of(&job.layout), chunk: 0, first: 0, count: 0 };
        let mut run = Self {
            folder,
            lock,
            place,
            points: job.points,
            chunk_points: chunk_points(job.points),
            dealt,
            present: Mutex::default(),
            parts: Mutex::default(),
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
        let (mut present, mut parts) = (BTreeSet::new(), BTreeMap::new());
        for chunk in chunks_there(&self.folder)? {
            if chunk >= self.chunks() || !self.owns(chunk) {
                continue;
            }
            match self.read(chunk)? {
                Some(outcomes) if outcomes.len() as u64 == self.place(chunk).count => {
                    present.insert(chunk);
                }
                Some(part) => {
                    parts.insert(chunk, part);
                }
                None => {}
            }
        }
        *self.present() = present;
        *lock(&self.parts) = parts;
        Ok(())
    }

    /// A whole chunk's outcomes; `None` if it is not there, or, with the file set aside and noted,
    /// if it is damaged.
    pub fn read_chunk(&mut self, chunk: u64) -> Result<Option<Vec<Done>>, StoreError> {
        let count = self.place(chunk).count;
        let whole = self.read(chunk)?.filter(|outcomes| outcomes.len() as u64 == count);
        if whole.is_none() {
            self.present().remove(&chunk);
        }
        Ok(whole)
    }

    /// What is kept of a point, by whichever process.
    pub fn known(&self, point: u64) -> Option<Done> {
        let place = self.place(self.chunk_of(point));
        let there = read_chunk(&self.folder, &place).ok()??.ok()?;
        there.into_iter().find(|done| done.point == point)
    }

    /// What there is of a chunk; a damaged file is set aside and noted.
    fn read(&mut self, chunk: u64) -> Result<Option<Vec<Done>>, StoreError> {
        match read_chunk(&self.folder, &self.place(chunk))? {
            Some(Ok(outcomes)) => Ok(Some(outcomes)),
            None => Ok(None),
            Some(Err(damage)) => {
                let path = self.folder.file(chunk_name(chunk));
                let aside = set_aside(&path)?;
                let (path, aside) = (path.display(), aside.file_name().unwrap_or_default());
                let kept = format!("kept as {} and computed again", aside.to_string_lossy());
                self.notes.push(format!("{path}: {damage}; {kept}"));
                Ok(None)
            }
        }
    }

    /// Keeps what there is of a chunk, in any order: when this returns, it outlives a power cut.
    /// What is not whole is for the next process to go on from.
    ///
    /// # Errors
    /// [`StoreError::Engine`] when the outcomes are not this chunk's, [`StoreError::File`].
    pub fn write_chunk(&self, chunk: u64, mut outcomes: Vec<Done>) -> Result<(), StoreError> {
        let place = self.place(chunk);
        outcomes.sort_by_key(|outcome| outcome.point);
        let bytes = chunk::encode(&place, &outcomes)?;
        let is_whole = outcomes.len() as u64 == place.count;
        // Another process with the same shard may have done it.
        if !is_whole
            && let Some(Ok(known)) = read_chunk(&self.folder, &place)?
            && known.len() > outcomes.len()
        {
            return Ok(());
        }
        atomic::write(&self.folder.path, &self.folder.file(chunk_name(chunk)), &bytes)?;
        if is_whole {
            self.present().insert(chunk);
        } else {
            lock(&self.parts).insert(chunk, outcomes);
        }
        Ok(())
    }

    /// How this process's rows that are there ended.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn statuses(&mut self, job: &Job<'_>) -> Result<NameCounts, StoreError> {
        let (mut counts, own) = (NameCounts::new(), self.present().clone());
        for chunk in own {
            let rows = self.read_chunk(chunk)?.unwrap_or_default();
            read::add_statuses(&mut counts, job, &rows);
        }
        Ok(counts)
    }

    /// The outcomes there are of chunks that are not whole, to go on from.
    pub fn take_parts(&self) -> BTreeMap<u64, Vec<Done>> {
        std::mem::take(&mut *lock(&self.parts))
    }

    /// How many chunks make up the whole result.
    pub fn chunks(&self) -> u64 {
        self.points.div_ceil(self.chunk_points)
    }

    /// The points of a chunk.
    pub fn chunk_range(&self, chunk: u64) -> Range<u64> {
        let first = chunk.saturating_mul(self.chunk_points).min(self.points);
        first..first.saturating_add(self.chunk_points).min(self.points)
    }

    /// The chunk that a point is in.
    pub const fn chunk_of(&self, point: u64) -> u64 {
        point / self.chunk_points
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
        let length = |chunk| {
            let range = self.chunk_range(chunk);
            range.end - range.start
        };
        let chunks = self.chunks();
        let own = self.shard().map_or(chunks, |shard| shard.chunks(chunks));
        // All chunks are full but the last of the run.
        let short = match chunks.checked_sub(1) {
            Some(last) if self.owns(last) => self.chunk_points - length(last),
            _ => 0,
        };
        let whole: u64 = self.present().iter().map(|&chunk| length(chunk)).sum();
        let there = whole + lock(&self.parts).values().map(|part| part.len() as u64).sum::<u64>();
        (own.saturating_mul(self.chunk_points).saturating_sub(short), there)
    }

    /// Things a user should hear of once: damaged chunks, a file system without locks.
    pub fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// The place of a chunk.
    pub fn place(&self, chunk: u64) -> Place {
        let range = self.chunk_range(chunk);
        Place { chunk, first: range.start, count: range.end - range.start, ..self.place.clone() }
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

/// What is where a chunk's file would be: its outcomes, or why they are none.
pub(super) fn read_chunk(
    folder: &Folder,
    place: &Place,
) -> Result<Option<Result<Vec<Done>, Damage>>, StoreError> {
    let path = &folder.file(chunk_name(place.chunk));
    let mut bytes = Vec::new();
    // A byte too many is enough to know that it is too long.
    let read = regular::open(path)
        .and_then(|file| file.take(place.most_bytes() + 1).read_to_end(&mut bytes));
    let read = regular::if_there(read).map_err(StoreError::io("read", path))?;
    Ok(read.map(|_| chunk::decode(place, &bytes)))
}

/// The chunks that have a file.
pub(super) fn chunks_there(folder: &Folder) -> Result<BTreeSet<u64>, StoreError> {
    let mut chunks = BTreeSet::new();
    for name in regular::names(&folder.path).map_err(StoreError::io("list", &folder.path))? {
        chunks.extend(name.to_str().and_then(chunk_of_name));
    }
    Ok(chunks)
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
        own::clear(folder, &job.hash())?;
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
                remove(folder, lock, &job.hash());
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

/// Removes a folder that has served, of the run whose plan has this hash. What the run has not
/// written, or has set aside, stays with the folder. The result does not depend on it, so a failure
/// is only worth a note.
pub(super) fn remove(folder: &Folder, lock: Lock, plan: &blake3::Hash) -> Option<String> {
    let path = folder.path.display();
    let removed = own::clear(folder, plan).and_then(|others| {
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

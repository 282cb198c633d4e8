//! The trials of a search. A search's next trials follow from the answers so far, so after an
//! interruption it runs again over the rows that are there, and ends in the same bytes.
//!
//! A search on `x.parquet` works in the folder `x.parquet.partial`, under the same lock and with
//! the same frozen plan as a run. Which points it needs is not known beforehand, so its parts have
//! no places but their order: a part is written again with the rows that have come since, until it
//! is full, and then the next one begins.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::json;

use super::open::{self, Opened};
use super::part::{Damage, PartSchema, Unreadable};
use super::{Column, Folder, Job, Lock, Row, StoreError, part_name};
use sweep_files::{FileKind, atomic};

/// The number of rows of a full part. Basis: a part is written again at most once in
/// [`WRITE_INTERVAL`], and so many rows of ten columns take a millisecond. Doubling it halves the
/// number of files and doubles what a write costs.
const PART_ROWS: usize = 1024;

/// The time between two writes of trials that come one by one. Basis: a kill loses the trials of a
/// second at most, and writes take a thousandth of the time. Doubling it doubles what is lost.
pub const WRITE_INTERVAL: Duration = Duration::from_secs(1);

/// The identity of a trial: the cells of its first columns, none of which is null.
pub type Key = Vec<u64>;

/// The columns of a search's trials.
#[derive(Clone, Debug)]
pub struct TrialColumns {
    /// The columns that identify a trial.
    pub keys: Vec<Column>,
    /// The columns of its answer.
    pub answers: Vec<Column>,
}

/// The trials of a search that this process has a right to.
#[derive(Debug)]
pub struct Trials {
    folder: Folder,
    lock: Lock,
    parts: PartSchema,
    known: BTreeMap<Key, Row>,
    /// The index and the rows of the last part, which is not full.
    last: u64,
    rows: Vec<Row>,
    /// Whether the last part has rows that are not written.
    is_dirty: bool,
    written: Instant,
    notes: Vec<String>,
}

impl Trials {
    /// Takes the output for this search, freezes its plan or finds it frozen, and reads its trials.
    /// `fresh` starts over: trials go now, a finished file stays until the new one takes its place.
    ///
    /// # Errors
    /// [`StoreError::Busy`] when another process holds the output, [`StoreError::PlanDiffers`],
    /// [`StoreError::OutputDiffers`] when another result is there already, [`StoreError::File`] for
    /// anything else at the output that is not ours, and for the file system.
    pub fn open(
        output: &Path,
        job: &Job<'_>,
        columns: TrialColumns,
        fresh: bool,
    ) -> Result<Opened<(), Self>, StoreError> {
        let folder = Folder::beside(output, job.layout.kind)?;
        let finished = || match job.layout.kind {
            // The model's own file does not say which search it is from.
            FileKind::Own => Ok(None),
            _ => Ok(open::of_plan(&folder, job)?.map(drop)),
        };
        let (lock, notes) = match open::claim(&folder, job, fresh, || Ok(None), finished)? {
            Opened::Finished(()) => return Ok(Opened::Finished(())),
            Opened::Open(held) => held,
        };
        let TrialColumns { mut keys, answers } = columns;
        let width = keys.len();
        keys.extend(answers);
        let mut trials = Self {
            folder,
            lock,
            parts: PartSchema::new(job, keys),
            known: BTreeMap::new(),
            last: 0,
            rows: Vec::new(),
            is_dirty: false,
            written: Instant::now(),
            notes,
        };
        trials.read(width)?;
        Ok(Opened::Open(trials))
    }

    /// Reads the parts that are there, setting aside what is not whole.
    fn read(&mut self, width: usize) -> Result<(), StoreError> {
        for index in open::parts_there(&self.folder)? {
            match Unreadable::damage(read_rows(&self.parts, &self.folder, index))? {
                Ok(rows) => {
                    for row in &rows {
                        let (key, answer) = row.split_at(width);
                        let key = key.iter().map(|cell| cell.unwrap_or_default()).collect();
                        self.known.insert(key, answer.to_vec());
                    }
                    self.last = index;
                    self.rows = rows;
                }
                Err(damage) => {
                    let note = open::set_part_aside(&self.folder, index, damage)?;
                    self.notes.push(note);
                }
            }
        }
        Ok(())
    }

    /// How many trials are there.
    pub fn count(&self) -> usize {
        self.known.len()
    }

    /// The answer to a trial that was made before.
    pub fn recall(&self, key: &[u64]) -> Option<&Row> {
        self.known.get(key)
    }

    /// Adds an answer, which [`Trials::write`] writes.
    ///
    /// # Errors
    /// [`StoreError::File`], where the answer fills a part.
    pub fn add(&mut self, key: Key, answer: Row) -> Result<(), StoreError> {
        if self.rows.len() >= PART_ROWS {
            self.write()?;
            self.last += 1;
            self.rows.clear();
        }
        self.rows.push(key.iter().copied().map(Some).chain(answer.iter().copied()).collect());
        self.known.insert(key, answer);
        self.is_dirty = true;
        Ok(())
    }

    /// Whether there are answers to write, and none were written for a while.
    pub fn is_due(&self) -> bool {
        self.is_dirty && self.written.elapsed() >= WRITE_INTERVAL
    }

    /// Writes the answers that are not written: when this returns, they outlive a power cut.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn write(&mut self) -> Result<(), StoreError> {
        if !self.is_dirty {
            return Ok(());
        }
        let path = self.folder.file(part_name(self.last));
        let bytes = self.parts.encode(&place(self.last), &self.rows);
        let bytes = bytes.map_err(StoreError::parquet("write", &path))?;
        atomic::write(&self.folder.path, &path, &bytes)?;
        self.is_dirty = false;
        self.written = Instant::now();
        Ok(())
    }

    /// Things a user should hear of once.
    pub fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Removes the folder of a search whose file is in place; a failure is only worth a note.
    pub fn complete(self) -> Option<String> {
        open::remove(&self.folder, self.lock)
    }
}

/// Returns the entry of a part's metadata that says which of a search's parts it is.
fn place(index: u64) -> String {
    json!({ "index": index }).to_string()
}

/// Reads the rows of the part of this index; none where there is no file.
fn read_rows(parts: &PartSchema, folder: &Folder, index: u64) -> Result<Vec<Row>, Unreadable> {
    let part = parts.open(&folder.file(part_name(index)), &place(index))?;
    let Some(part) = part else { return Ok(Vec::new()) };
    if part.rows() > PART_ROWS as u64 {
        return Err(Damage::Rows.into());
    }
    part.all_cells()
}

#[cfg(test)]
mod tests;

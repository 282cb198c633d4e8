//! The stored trials of a search. The next trials of a search follow from the responses so far.
//! After an interruption the search therefore starts from its beginning, takes the responses of
//! earlier trials from the store, and ends in the same bytes.
//!
//! A search on `x.parquet` works in the folder `x.parquet.partial`, with the same lock and plan
//! file as a run. Its points are not known beforehand, so its parts are only numbered: the last
//! part is rewritten with the rows that have been added, until it is full, and then the next part
//! begins.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::json;

use super::open::{self, OpenOutcome};
use super::part::{Damage, PartError, PartSchema};
use super::{DeclaredColumn, Folder, Job, Lock, RowCells, StoreError, part_name};
use sweep_files::{FileKind, atomic};

/// The number of rows of a full part. Basis: a part is rewritten at most once per
/// [`WRITE_INTERVAL`], and writing that many rows of ten columns takes a millisecond. Doubling it
/// halves the number of files and doubles the time of a write.
const PART_ROWS: usize = 1024;

/// The minimum time between two writes of trials that are added one by one. Basis: a killed process
/// loses the trials of one second, and writes take a thousandth of the time. Doubling it doubles
/// the loss.
pub const WRITE_INTERVAL: Duration = Duration::from_secs(1);

/// The identity of a trial: the cells of its first columns, none of which is null.
pub type TrialKey = Vec<u64>;

/// The columns of a search's trials.
#[derive(Clone, Debug)]
pub struct TrialColumns {
    /// The columns that identify a trial.
    pub keys: Vec<DeclaredColumn>,
    /// The columns of a trial's response.
    pub responses: Vec<DeclaredColumn>,
}

/// The stored trials of a search whose folder this process has locked.
#[derive(Debug)]
pub struct Trials {
    folder: Folder,
    lock: Lock,
    parts: PartSchema,
    /// The responses of all trials.
    responses: BTreeMap<TrialKey, RowCells>,
    /// The index of the last part.
    last_part: u64,
    /// The rows of the last part.
    last_part_rows: Vec<RowCells>,
    /// Whether the last part has rows that are not written.
    is_dirty: bool,
    last_write: Instant,
    notes: Vec<String>,
}

impl Trials {
    /// Locks the output for this search, writes its plan or compares it with the one that an
    /// earlier process has written, and reads the stored trials. With `fresh` these are deleted at
    /// once; a finished result stays until the new one replaces it.
    ///
    /// # Errors
    /// [`StoreError::Busy`] if another process has locked the output, [`StoreError::PlanDiffers`],
    /// [`StoreError::OutputDiffers`] if the output is the result of another plan,
    /// [`StoreError::File`] for a file of another program at the output, and for errors of the file
    /// system.
    pub fn open(
        output: &Path,
        job: &Job<'_>,
        columns: TrialColumns,
        fresh: bool,
    ) -> Result<OpenOutcome<(), Self>, StoreError> {
        let folder = Folder::beside(output, job.layout.kind)?;
        let find_finished = || match job.layout.kind {
            // A file of the model's parameters does not record the search that made it.
            FileKind::ModelFile => Ok(None),
            _ => Ok(open::result_of_same_plan(&folder, job)?.map(drop)),
        };
        let (lock, notes) =
            match open::claim_folder(&folder, job, fresh, || Ok(None), find_finished)? {
                OpenOutcome::Finished(()) => return Ok(OpenOutcome::Finished(())),
                OpenOutcome::Open(lock_and_notes) => lock_and_notes,
            };
        let TrialColumns { keys: mut columns, responses } = columns;
        let key_count = columns.len();
        columns.extend(responses);
        let mut trials = Self {
            folder,
            lock,
            parts: PartSchema::new(job, columns),
            responses: BTreeMap::new(),
            last_part: 0,
            last_part_rows: Vec::new(),
            is_dirty: false,
            last_write: Instant::now(),
            notes,
        };
        trials.read(key_count)?;
        Ok(OpenOutcome::Open(trials))
    }

    /// Reads the parts, and renames damaged ones. The first `key_count` columns identify a trial.
    fn read(&mut self, key_count: usize) -> Result<(), StoreError> {
        for index in open::part_indices(&self.folder)? {
            match PartError::damage(read_rows(&self.parts, &self.folder, index))? {
                Ok(rows) => {
                    for row in &rows {
                        let (key, response) = row.split_at(key_count);
                        let key = key.iter().map(|cell| cell.unwrap_or_default()).collect();
                        self.responses.insert(key, response.to_vec());
                    }
                    self.last_part = index;
                    self.last_part_rows = rows;
                }
                Err(damage) => {
                    let note = open::rename_damaged_part(&self.folder, index, damage)?;
                    self.notes.push(note);
                }
            }
        }
        Ok(())
    }

    /// Returns the number of stored trials.
    pub fn count(&self) -> usize {
        self.responses.len()
    }

    /// Returns the response of an earlier trial.
    pub fn find_response(&self, key: &[u64]) -> Option<&RowCells> {
        self.responses.get(key)
    }

    /// Adds a response, which the next [`Trials::write`] stores.
    ///
    /// # Errors
    /// [`StoreError::File`], if the last part is full and has to be written.
    pub fn add(&mut self, key: TrialKey, response: RowCells) -> Result<(), StoreError> {
        if self.last_part_rows.len() >= PART_ROWS {
            self.write()?;
            self.last_part += 1;
            self.last_part_rows.clear();
        }
        self.last_part_rows
            .push(key.iter().copied().map(Some).chain(response.iter().copied()).collect());
        self.responses.insert(key, response);
        self.is_dirty = true;
        Ok(())
    }

    /// Returns whether there are responses to write and the last write is at least
    /// [`WRITE_INTERVAL`] ago.
    pub fn is_due(&self) -> bool {
        self.is_dirty && self.last_write.elapsed() >= WRITE_INTERVAL
    }

    /// Writes the responses that were added since the last write. When this returns, they survive a
    /// power cut.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn write(&mut self) -> Result<(), StoreError> {
        if !self.is_dirty {
            return Ok(());
        }
        let path = self.folder.file(part_name(self.last_part));
        let bytes = self.parts.encode(&part_entry(self.last_part), &self.last_part_rows);
        let bytes = bytes.map_err(StoreError::parquet("write", &path))?;
        atomic::write(&self.folder.path, &path, &bytes)?;
        self.is_dirty = false;
        self.last_write = Instant::now();
        Ok(())
    }

    /// Takes the notes for the user.
    pub fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Removes the folder of a search whose result is complete. A failure is returned as a note.
    pub fn complete(self) -> Option<String> {
        open::remove_folder(&self.folder, self.lock)
    }
}

/// Returns the entry in a part's metadata that gives its index.
fn part_entry(index: u64) -> String {
    json!({ "index": index }).to_string()
}

/// Reads the rows of the part with this index; none if there is no file.
fn read_rows(parts: &PartSchema, folder: &Folder, index: u64) -> Result<Vec<RowCells>, PartError> {
    let part = parts.open(&folder.file(part_name(index)), &part_entry(index))?;
    let Some(part) = part else { return Ok(Vec::new()) };
    if part.rows() > PART_ROWS as u64 {
        return Err(Damage::Rows.into());
    }
    part.all_cells()
}

#[cfg(test)]
mod tests;

//! The stored trials of a search. The next trials of a search follow from the values of those
//! before. After an interruption the search therefore starts from its beginning, takes the values
//! of earlier trials from the store, and ends in the same bytes.
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
use super::part::{PartDamage, PartError, PartSchema};
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
    pub key_columns: Vec<DeclaredColumn>,
    /// The columns of a trial's values.
    pub value_columns: Vec<DeclaredColumn>,
}

/// The stored trials of a search whose folder this process has locked.
#[derive(Debug)]
pub struct Trials {
    folder: Folder,
    lock: Lock,
    part_schema: PartSchema,
    /// The values of all trials.
    values_by_key: BTreeMap<TrialKey, RowCells>,
    /// The index of the last part.
    last_part_index: u64,
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
        trial_columns: TrialColumns,
        fresh: bool,
    ) -> Result<OpenOutcome<(), Self>, StoreError> {
        let folder = Folder::next_to_output(output, job.layout.kind)?;
        let find_finished = || match job.layout.kind {
            // A file of the model's parameters does not record the search that made it.
            FileKind::ModelFile => Ok(None),
            _ => Ok(open::open_result_of_same_plan(&folder, job)?.map(drop)),
        };
        let (lock, notes) =
            match open::claim_folder(&folder, job, fresh, || Ok(None), find_finished)? {
                OpenOutcome::Finished(()) => return Ok(OpenOutcome::Finished(())),
                OpenOutcome::Open(lock_and_notes) => lock_and_notes,
            };
        let TrialColumns { key_columns: mut columns, value_columns } = trial_columns;
        let key_count = columns.len();
        columns.extend(value_columns);
        let mut trials = Self {
            folder,
            lock,
            part_schema: PartSchema::new(job, columns),
            values_by_key: BTreeMap::new(),
            last_part_index: 0,
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
        for index in open::list_part_indices(&self.folder)? {
            match PartError::separate_damage(read_rows(&self.part_schema, &self.folder, index))? {
                Ok(rows) => {
                    for row in &rows {
                        let (trial_key, values) = row.split_at(key_count);
                        let trial_key =
                            trial_key.iter().map(|cell| cell.unwrap_or_default()).collect();
                        self.values_by_key.insert(trial_key, values.to_vec());
                    }
                    self.last_part_index = index;
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
    pub fn trial_count(&self) -> usize {
        self.values_by_key.len()
    }

    /// Returns the values of an earlier trial.
    pub fn find_values(&self, key: &[u64]) -> Option<&RowCells> {
        self.values_by_key.get(key)
    }

    /// Adds a trial, which the next [`Trials::write`] stores.
    ///
    /// # Errors
    /// [`StoreError::File`], if the last part is full and has to be written.
    pub fn add_trial(&mut self, key: TrialKey, values: RowCells) -> Result<(), StoreError> {
        if self.last_part_rows.len() >= PART_ROWS {
            self.write()?;
            self.last_part_index += 1;
            self.last_part_rows.clear();
        }
        self.last_part_rows
            .push(key.iter().copied().map(Some).chain(values.iter().copied()).collect());
        self.values_by_key.insert(key, values);
        self.is_dirty = true;
        Ok(())
    }

    /// Returns whether there are trials to write and the last write is at least
    /// [`WRITE_INTERVAL`] ago.
    pub fn is_write_due(&self) -> bool {
        self.is_dirty && self.last_write.elapsed() >= WRITE_INTERVAL
    }

    /// Writes the trials that were added since the last write. When this returns, they survive a
    /// power cut.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn write(&mut self) -> Result<(), StoreError> {
        if !self.is_dirty {
            return Ok(());
        }
        let path = self.folder.file(part_name(self.last_part_index));
        let bytes =
            self.part_schema.encode(&part_entry(self.last_part_index), &self.last_part_rows);
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
    if part.row_count() > PART_ROWS as u64 {
        return Err(PartDamage::Rows.into());
    }
    part.read_all_cells()
}

#[cfg(test)]
mod tests;

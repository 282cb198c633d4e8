//! Joining the chunks into the one Parquet file, a row group at a time.

use std::io::BufWriter;

use parquet::arrow::ArrowWriter;
use parquet::errors::ParquetError;

use super::Job;
use super::error::StoreError;
use super::open::{OpenRun, remove};
use super::provenance::{self, Session};
use super::read::{self, Tally};
use super::schema::{self, BATCH_ROWS, ResultRows};
use sweep_files::panics;
use sweep_files::{self as files, ParquetFile, atomic, seal};

/// A finished result.
#[derive(Debug)]
pub struct Joined {
    /// What it holds.
    pub tally: Tally,
    /// Things a user should hear of.
    pub notes: Vec<String>,
}

impl OpenRun {
    /// Joins the chunks into the output and syncs it into place; `None` when `stop` said so. The
    /// folder stays until [`OpenRun::complete`].
    ///
    /// Memory: one row group while it is encoded and one chunk, about 40 MB whatever the number of
    /// points, and 150 bytes a column for each row group behind (10 MB for a billion points).
    ///
    /// # Errors
    /// [`StoreError::Incomplete`] when a chunk is missing or was found damaged (it is then set
    /// aside, and [`OpenRun::is_missing`]); [`StoreError::File`].
    pub fn join(
        &mut self,
        job: &Job<'_>,
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<Tally>, StoreError> {
        let output = self.output().to_path_buf();
        let mut file = atomic::begin(self.folder())?;
        let failed = |error| StoreError::parquet("write", &output)(error);
        let from_arrow = |error| failed(ParquetError::from(error));
        let mut rows = ResultRows::new(&job.layout);
        let properties = schema::properties(job);
        let begin = || ArrowWriter::try_new(BufWriter::new(&file), rows.schema(), Some(properties));
        let mut writer =
            panics::in_parquet("the library gave up writing", begin).map_err(failed)?;
        for chunk in 0..self.chunks() {
            if stop() {
                return Ok(None);
            }
            let Some(outcomes) = self.read_chunk(chunk)? else {
                self.rescan()?;
                return Err(self.incomplete()?);
            };
            for outcome in outcomes {
                rows.push((job.axis_values)(outcome.point), outcome);
                if rows.len() == BATCH_ROWS {
                    let batch = rows.take().map_err(from_arrow)?;
                    panics::in_parquet("the library gave up writing", || writer.write(&batch))
                        .map_err(failed)?;
                }
            }
        }
        if rows.len() > 0 {
            let batch = rows.take().map_err(from_arrow)?;
            panics::in_parquet("the library gave up writing", || writer.write(&batch))
                .map_err(failed)?;
        }
        // Closing flushes to the file. (Taking the file back out of the writer would tell a full
        // disk as text only.)
        writer.append_key_value_metadata(seal::blank());
        panics::in_parquet("the library gave up writing", || writer.close()).map_err(failed)?;
        seal::seal(file.as_file_mut()).map_err(StoreError::io("write", &output))?;
        // Read back before it takes its place: what cannot be read must not replace anything.
        let tally = read::tally(&ParquetFile::open(file.path())?)?;
        files::judge(&output, job.layout.file_kind())?;
        atomic::publish(file, &output)?;
        Ok(Some(tally))
    }

    /// Ends a run whose output is in place: writes the sidecar and removes the folder.
    ///
    /// # Errors
    /// [`StoreError::File`] when the sidecar cannot be written.
    pub fn complete(
        mut self,
        job: &Job<'_>,
        tally: Tally,
        session: Option<Session>,
    ) -> Result<Joined, StoreError> {
        let sidecar = provenance::sidecar(&self.folder, job, &tally, session)?;
        let path = self.folder.sidecar();
        files::judge(&path, self.folder.account())?;
        atomic::write(self.folder(), &path, &sidecar)?;
        let mut notes = self.take_notes();
        notes.extend(remove(&self.folder, self.lock));
        Ok(Joined { tally, notes })
    }
}

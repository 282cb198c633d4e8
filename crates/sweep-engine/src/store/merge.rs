//! Joining the parts of a run into the one Parquet file, a row group at a time.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

use arrow_array::RecordBatch;
use arrow_schema::SchemaRef;
use parquet::errors::ParquetError;
use tempfile::NamedTempFile;

use super::open::remove_folder;
use super::{Job, OpenRun, Session, StoreError, Tally};
use super::{provenance, read, schema};
use sweep_files::batches::from_arrow;
use sweep_files::{self as files, ParquetFile, Writer, atomic, panics, seal};

/// An unfinished result file.
struct ResultWriter<'a> {
    output: &'a Path,
    schema: SchemaRef,
    file: NamedTempFile,
    writer: Writer<BufWriter<File>>,
}

impl<'a> ResultWriter<'a> {
    /// Begins the result file of a job in a temporary file; `output` is its later path, for
    /// messages.
    fn begin(
        job: &Job<'_>,
        temporary_file: NamedTempFile,
        output: &'a Path,
    ) -> Result<Self, StoreError> {
        let schema = job.layout.schema();
        let properties = schema::result_writer_properties(job);
        let file_handle =
            temporary_file.as_file().try_clone().map_err(StoreError::io("write", output))?;
        let create_writer = || Writer::new(BufWriter::new(file_handle), &schema, properties);
        let writer = catch_write_errors(output, create_writer)?;
        Ok(Self { output, schema, file: temporary_file, writer })
    }

    /// Writes a batch of a part. The batch gets the schema of the result, because batches stay in
    /// memory until their row group is complete, and a schema for each of them would take memory.
    fn write_part_batch(&mut self, batch: &RecordBatch) -> Result<(), StoreError> {
        let batch = RecordBatch::try_new(Arc::clone(&self.schema), batch.columns().to_vec());
        let batch =
            batch.map_err(|error| StoreError::parquet("write", self.output)(from_arrow(error)))?;
        self.write(&batch)
    }

    fn write(&mut self, batch: &RecordBatch) -> Result<(), StoreError> {
        catch_write_errors(self.output, || self.writer.write(batch))
    }

    /// Writes the end of the file and its digest, and returns the temporary file.
    fn finish(self) -> Result<NamedTempFile, StoreError> {
        let Self { output, mut file, writer, .. } = self;
        // Closing flushes to the file and returns the error of a full disk as such; `into_inner`
        // would return only its text.
        catch_write_errors(output, || {
            let mut file = writer.end()?;
            file.append_key_value_metadata(seal::blank_digest());
            file.close()
        })?;
        seal::seal(file.as_file_mut()).map_err(StoreError::io("write", output))?;
        Ok(file)
    }
}

/// Runs a function that writes by the Parquet library, and turns its errors and panics into errors
/// about the output.
fn catch_write_errors<T>(
    output: &Path,
    write: impl FnOnce() -> Result<T, ParquetError>,
) -> Result<T, StoreError> {
    panics::catch_in_parquet("the library gave up writing", write)
        .map_err(StoreError::parquet("write", output))
}

/// Writes the result file of a job whose rows are in memory. The file has the same bytes as that of
/// a run.
///
/// # Errors
/// [`StoreError::File`].
pub fn write_map(job: &Job<'_>, batches: &[RecordBatch], output: &Path) -> Result<(), StoreError> {
    files::check_replaceable(output, job.layout.kind)?;
    let folder = atomic::parent(output);
    files::create_folder_without_leftovers(folder)?;
    let mut writer = ResultWriter::begin(job, atomic::create_temporary(folder)?, output)?;
    batches.iter().try_for_each(|batch| writer.write(batch))?;
    let file = writer.finish()?;
    files::check_replaceable(output, job.layout.kind)?;
    Ok(atomic::publish(file, output)?)
}

impl OpenRun {
    /// Joins the parts into a file, and moves this to the output. Returns `None` if `stop` returns
    /// true before the end. The folder stays until [`OpenRun::complete`].
    ///
    /// Memory: one part and one row group while it is encoded, about 40 MB for any number of
    /// points, and 150 bytes per column for each row group that is written (10 MB for a billion
    /// points).
    ///
    /// # Errors
    /// [`StoreError::Incomplete`] if a chunk is missing or damaged (a damaged part is renamed, so
    /// that [`OpenRun::is_missing`] is true of its chunk); [`StoreError::File`].
    pub fn join(
        &mut self,
        job: &Job<'_>,
        must_stop: &dyn Fn() -> bool,
    ) -> Result<Option<Tally>, StoreError> {
        let output = self.folder.output.clone();
        let file = atomic::create_temporary(&self.folder.path)?;
        let mut writer = ResultWriter::begin(job, file, &output)?;
        for chunk in 0..self.chunk_count() {
            if must_stop() {
                return Ok(None);
            }
            let Some(batches) =
                self.read_complete_chunk(chunk, |part| part.read_result_batches())?
            else {
                self.rescan_parts()?;
                return Err(self.incomplete_error()?);
            };
            batches.iter().try_for_each(|batch| writer.write_part_batch(batch))?;
        }
        let file = writer.finish()?;
        // The file is read before it is moved to the output, because an unreadable file must not
        // replace another one.
        let tally = read::tally_rows(&ParquetFile::open(file.path())?)?;
        files::check_replaceable(&output, job.layout.kind)?;
        atomic::publish(file, &output)?;
        Ok(Some(tally))
    }

    /// Ends a run whose result is complete: writes the sidecar and removes the folder. Returns
    /// notes for the user.
    ///
    /// # Errors
    /// [`StoreError::File`] if the sidecar cannot be written.
    pub fn complete(
        mut self,
        job: &Job<'_>,
        tally: &Tally,
        session: Option<Session>,
    ) -> Result<Vec<String>, StoreError> {
        let sidecar = provenance::sidecar_content(&self.folder, job, tally, session)?;
        let path = self.folder.sidecar_path();
        files::check_replaceable(&path, self.folder.sidecar_kind())?;
        atomic::write(&self.folder.path, &path, &sidecar)?;
        let mut notes = self.take_notes();
        notes.extend(remove_folder(&self.folder, self.lock));
        Ok(notes)
    }
}

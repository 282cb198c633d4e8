//! Joining the parts of a run into the one Parquet file, a row group at a time.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

use arrow_array::RecordBatch;
use arrow_schema::SchemaRef;
use parquet::errors::ParquetError;
use tempfile::NamedTempFile;

use super::open::remove;
use super::provenance::{self};
use super::read::{self};
use super::schema::{self};
use super::{Job, OpenRun, Session, StoreError, Tally};
use sweep_files::batches::from_arrow;
use sweep_files::{self as files, ParquetFile, Writer, atomic, panics, seal};

/// An unfinished result file.
struct MapWriter<'a> {
    output: &'a Path,
    schema: SchemaRef,
    file: NamedTempFile,
    writer: Writer<BufWriter<File>>,
}

impl<'a> MapWriter<'a> {
    /// Begins the file of a job, which is to be at `output`.
    fn begin(job: &Job<'_>, file: NamedTempFile, output: &'a Path) -> Result<Self, StoreError> {
        let schema = job.layout.schema();
        let properties = schema::properties(job);
        let handle = file.as_file().try_clone().map_err(StoreError::io("write", output))?;
        let begin = || Writer::new(BufWriter::new(handle), &schema, properties);
        let writer = written(output, begin)?;
        Ok(Self { output, schema, file, writer })
    }

    /// Writes a batch of a part. With the schema of the file, the batches that are held until
    /// their row group is whole do not each hold one of their own.
    fn write_part(&mut self, batch: &RecordBatch) -> Result<(), StoreError> {
        let batch = RecordBatch::try_new(Arc::clone(&self.schema), batch.columns().to_vec());
        let batch =
            batch.map_err(|error| StoreError::parquet("write", self.output)(from_arrow(error)))?;
        self.write(&batch)
    }

    fn write(&mut self, batch: &RecordBatch) -> Result<(), StoreError> {
        written(self.output, || self.writer.write(batch))
    }

    /// The whole file, with its digest.
    fn finish(self) -> Result<NamedTempFile, StoreError> {
        let Self { output, mut file, writer, .. } = self;
        // Closing flushes to the file. (Taking the file back out of the writer would tell a full
        // disk as text only.)
        written(output, || {
            let mut file = writer.end()?;
            file.append_key_value_metadata(seal::blank());
            file.close()
        })?;
        seal::seal(file.as_file_mut()).map_err(StoreError::io("write", output))?;
        Ok(file)
    }
}

/// Has the library write.
fn written<T>(
    output: &Path,
    work: impl FnOnce() -> Result<T, ParquetError>,
) -> Result<T, StoreError> {
    panics::in_parquet("the library gave up writing", work)
        .map_err(StoreError::parquet("write", output))
}

/// Writes the result file of a job whose rows are in memory: the same bytes as a run's.
///
/// # Errors
/// [`StoreError::File`].
pub fn write_map(job: &Job<'_>, batches: &[RecordBatch], output: &Path) -> Result<(), StoreError> {
    files::judge(output, job.layout.kind)?;
    let folder = atomic::parent(output);
    files::ready(folder)?;
    let mut writer = MapWriter::begin(job, atomic::begin(folder)?, output)?;
    batches.iter().try_for_each(|batch| writer.write(batch))?;
    let file = writer.finish()?;
    files::judge(output, job.layout.kind)?;
    Ok(atomic::publish(file, output)?)
}

impl OpenRun {
    /// Joins the parts into the output and syncs it into place; `None` when `stop` said so. The
    /// folder stays until [`OpenRun::complete`].
    ///
    /// Memory: one row group while it is encoded and one part, about 40 MB whatever the number of
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
        let output = self.folder.output.clone();
        let file = atomic::begin(&self.folder.path)?;
        let mut writer = MapWriter::begin(job, file, &output)?;
        for chunk in 0..self.chunks() {
            if stop() {
                return Ok(None);
            }
            let Some(batches) = self.read_whole(chunk, |part| part.result_batches())? else {
                self.rescan()?;
                return Err(self.incomplete()?);
            };
            batches.iter().try_for_each(|batch| writer.write_part(batch))?;
        }
        let file = writer.finish()?;
        // Read back before it takes its place: what cannot be read must not replace anything.
        let tally = read::tally(&ParquetFile::open(file.path())?)?;
        files::judge(&output, job.layout.kind)?;
        atomic::publish(file, &output)?;
        Ok(Some(tally))
    }

    /// Ends a run whose output is in place: writes the sidecar and removes the folder. Gives what a
    /// user should hear of.
    ///
    /// # Errors
    /// [`StoreError::File`] when the sidecar cannot be written.
    pub fn complete(
        mut self,
        job: &Job<'_>,
        tally: &Tally,
        session: Option<Session>,
    ) -> Result<Vec<String>, StoreError> {
        let sidecar = provenance::sidecar(&self.folder, job, tally, session)?;
        let path = self.folder.sidecar();
        files::judge(&path, self.folder.account())?;
        atomic::write(&self.folder.path, &path, &sidecar)?;
        let mut notes = self.take_notes();
        notes.extend(remove(&self.folder, self.lock));
        Ok(notes)
    }
}

//! Results in memory, and their files.

use std::path::Path;

use arrow_array::RecordBatch;
use arrow_schema::SchemaRef;
use serde_json::Value;

use crate::identity;
use sweep_engine::store::{Layout, write_map};
use sweep_engine::{Error, Job, StoreError, Table};
use sweep_files::{FileError, FileKind, Output, ParquetFile, key};
use sweep_plot::{PlotOptions, render};
use washer_plot::WasherFigures;

/// A result with its rows in memory.
#[derive(Debug)]
pub struct MemoryTable {
    kind: FileKind<'static>,
    plan: Value,
    schema: SchemaRef,
    batches: Vec<RecordBatch>,
    file_content: FileContent,
}

/// The content of a result's file.
#[derive(Debug)]
enum FileContent {
    /// The bytes of the file, in memory because the file may be replaced later.
    Bytes(Vec<u8>),
    /// The rows of a run with this number of points, written in the layout of its file.
    Rows { points: u64, layout: Box<Layout>, is_complete: bool },
}

impl MemoryTable {
    /// Creates a table from the rows of a job.
    pub(super) fn from_rows(job: &Job<'_>, batches: Vec<RecordBatch>, is_complete: bool) -> Self {
        let plan = job.plan.clone();
        let layout = Box::new(job.layout.clone());
        let kind = layout.kind;
        let schema = layout.schema();
        let file_content = FileContent::Rows { points: job.points, layout, is_complete };
        Self { kind, plan, schema, batches, file_content }
    }

    /// Creates a table from a small result, which is a single batch.
    pub(super) fn from_table(kind: FileKind<'static>, table: Table) -> Result<Self, Error> {
        let plan = table.plan();
        let (batch, bytes) =
            table.finish().map_err(StoreError::parquet("write", Path::new("a table")))?;
        Ok(Self {
            kind,
            plan,
            schema: batch.schema(),
            batches: vec![batch],
            file_content: FileContent::Bytes(bytes),
        })
    }

    /// Reads a result file of any kind and checks its digest.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, if it is damaged, or if this program did not
    /// write it.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let file = ParquetFile::open(path)?;
        let unknown_file_error = || FileError::NotParquet {
            path: path.to_path_buf(),
            reason: "it is no result of this program".to_owned(),
        };
        let plan = file.json(key::PLAN).or_else(|| file.json(key::DIFFERENCES));
        let plan = plan.ok_or_else(unknown_file_error)?;
        let kind = file.kind().ok_or_else(unknown_file_error)?;
        let all_columns = (0..file.schema().fields().len()).collect();
        let batches = file.batches(all_columns)?.collect::<Result<Vec<_>, _>>()?;
        let schema = SchemaRef::clone(file.schema());
        let file_content = FileContent::Bytes(file.bytes()?);
        Ok(Self { kind, plan, schema, batches, file_content })
    }

    /// Returns the kind of the result.
    pub fn kind(&self) -> FileKind<'static> {
        self.kind
    }

    /// Returns the plan as JSON, as the file has it; for differences, the two files compared.
    pub fn plan(&self) -> &Value {
        &self.plan
    }

    /// Returns the schema. The metadata of each field have `unit` and `description`.
    pub fn schema(&self) -> &SchemaRef {
        &self.schema
    }

    /// Returns the rows as record batches.
    pub fn batches(&self) -> &[RecordBatch] {
        &self.batches
    }

    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        self.batches.iter().map(RecordBatch::num_rows).sum()
    }

    /// Writes the result as a Parquet file, with the bytes that the command writes.
    ///
    /// # Errors
    /// Returns an error if the path has a file of another kind, if the file cannot be written, and
    /// if the evaluation was interrupted.
    pub fn save(&self, path: &Path) -> Result<(), Error> {
        let FileContent::Rows { points, layout, is_complete } = &self.file_content else {
            return self.finish(Output::begin(path, self.kind)?);
        };
        if !is_complete {
            let description = format!("with {} of {points} rows", self.rows());
            return Err(Error::option("save", description, "a result that was not interrupted"));
        }
        let job = Job {
            plan: self.plan.clone(),
            version: identity::VERSION,
            numerics: identity::NUMERICS_VERSION,
            points: *points,
            layout: Layout::clone(layout),
            // Only summaries and progress use these.
            limits: f64::NAN.into(),
            axis_values: Box::new(|_| Vec::new()),
        };
        Ok(write_map(&job, &self.batches, path)?)
    }

    /// Writes the bytes of a small result, or of a file that was read, to an output.
    pub(super) fn finish(&self, output: Output<'_>) -> Result<(), Error> {
        match &self.file_content {
            FileContent::Bytes(bytes) => Ok(output.finish(bytes)?),
            FileContent::Rows { .. } => Ok(()),
        }
    }

    /// Draws the table's figure. The extension of the output (`.svg`, `.pdf`, `.png`, `.html`)
    /// selects the format.
    ///
    /// # Errors
    /// Returns the errors of [`sweep_plot::render`] and [`Self::save`].
    pub fn draw(&self, output: &Path) -> Result<(), Error> {
        let folder_description = Path::new("a temporary folder");
        let folder = tempfile::tempdir().map_err(FileError::io("make", folder_description))?;
        let path = folder.path().join("result.parquet");
        self.save(&path)?;
        Ok(render(&path, &PlotOptions::default(), &WasherFigures::default(), output)?)
    }
}

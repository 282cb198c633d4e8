//! Results in memory: rows as columns, and the file that they are or would be.

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
    file: FileContent,
}

/// What a result's file is made of.
#[derive(Debug)]
enum FileContent {
    /// These bytes. Of a file that was read, those of then: another may lie there by now.
    Bytes(Vec<u8>),
    /// The rows, by the rules of a run's file of so many points.
    Rows { points: u64, layout: Box<Layout>, is_whole: bool },
}

impl MemoryTable {
    /// The rows of a run, or of one at constant speeds.
    pub(super) fn of_rows(job: &Job<'_>, batches: Vec<RecordBatch>, is_whole: bool) -> Self {
        let (plan, layout) = (job.plan.clone(), Box::new(job.layout.clone()));
        let (kind, schema) = (layout.kind, layout.schema());
        let file = FileContent::Rows { points: job.points, layout, is_whole };
        Self { kind, plan, schema, batches, file }
    }

    /// A small result.
    pub(super) fn of_table(kind: FileKind<'static>, table: Table) -> Result<Self, Error> {
        let plan = table.plan();
        let (batch, bytes) =
            table.finish().map_err(StoreError::parquet("write", Path::new("a table")))?;
        let (schema, batches) = (batch.schema(), vec![batch]);
        Ok(Self { kind, plan, schema, batches, file: FileContent::Bytes(bytes) })
    }

    /// Reads a result file of any kind, and checks its digest.
    ///
    /// # Errors
    /// A file that cannot be read, is damaged, or is no result of this program.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let file = ParquetFile::open(path)?;
        let not_ours = || FileError::NotParquet {
            path: path.to_path_buf(),
            reason: "it is no result of this program".to_owned(),
        };
        let plan = file.json(key::PLAN).or_else(|| file.json(key::DIFFERENCES));
        let plan = plan.ok_or_else(not_ours)?;
        let kind = file.kind().ok_or_else(not_ours)?;
        let all = (0..file.schema().fields().len()).collect();
        let batches = file.batches(all)?.collect::<Result<Vec<_>, _>>()?;
        let schema = SchemaRef::clone(file.schema());
        let file = FileContent::Bytes(file.bytes()?);
        Ok(Self { kind, plan, schema, batches, file })
    }

    /// What it is.
    pub fn kind(&self) -> FileKind<'static> {
        self.kind
    }

    /// The plan as JSON, as the file carries it; of differences, what was compared.
    pub fn plan(&self) -> &Value {
        &self.plan
    }

    /// The columns: names, types, and in each field's metadata `unit` and `description`.
    pub fn schema(&self) -> &SchemaRef {
        &self.schema
    }

    /// The rows.
    pub fn batches(&self) -> &[RecordBatch] {
        &self.batches
    }

    /// How many rows.
    pub fn rows(&self) -> usize {
        self.batches.iter().map(RecordBatch::num_rows).sum()
    }

    /// Writes the Parquet file: the bytes that the command writes.
    ///
    /// # Errors
    /// A path that holds something else, what the file system refuses, and the rows of an
    /// evaluation that was interrupted, which are no result.
    pub fn save(&self, path: &Path) -> Result<(), Error> {
        let FileContent::Rows { points, layout, is_whole } = &self.file else {
            return self.finish(Output::begin(path, self.kind)?);
        };
        if !is_whole {
            let given = format!("with {} of {points} rows", self.rows());
            return Err(Error::option("save", given, "a result that was not interrupted"));
        }
        let job = Job {
            plan: self.plan.clone(),
            version: identity::VERSION,
            numerics: identity::NUMERICS_VERSION,
            points: *points,
            layout: Layout::clone(layout),
            // Tables and progress alone need these.
            limits: f64::NAN.into(),
            axis_values: Box::new(|_| Vec::new()),
        };
        Ok(write_map(&job, &self.batches, path)?)
    }

    /// Writes a small result, or a copy of the file that this one was, to an output already begun.
    pub(super) fn finish(&self, output: Output<'_>) -> Result<(), Error> {
        match &self.file {
            FileContent::Bytes(bytes) => Ok(output.finish(bytes)?),
            FileContent::Rows { .. } => Ok(()),
        }
    }

    /// Draws the figure of it; the output's ending (`.svg`, `.pdf`, `.png`, `.html`) says how.
    ///
    /// # Errors
    /// As [`sweep_plot::render`] and [`Self::save`].
    pub fn draw(&self, output: &Path) -> Result<(), Error> {
        let here = Path::new("a temporary folder");
        let folder = tempfile::tempdir().map_err(FileError::io("make", here))?;
        let path = folder.path().join("result.parquet");
        self.save(&path)?;
        let (options, figures) = (PlotOptions::default(), WasherFigures::default());
        Ok(render(&path, &options, &figures, output)?)
    }
}

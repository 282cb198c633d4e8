//! Parts: Parquet files with the finished rows of unfinished work. Any program can read them while
//! the work goes on.
//!
//! A part has the columns of its job ([`PartSchema`]) and three entries of metadata of its own:
//!
//! | entry | content |
//! |---|---|
//! | `sweep.plan_hash` | the hash of the plan |
//! | `sweep.part` | the index and points of the part, as JSON |
//! | `sweep.digest` | the BLAKE3 hash of all other bytes of the file |
//!
//! The digest is made like that of results (`sweep_files::seal`). The entries show whether a byte
//! has changed, and whether the part is of another plan or has another index.

use std::io;
use std::path::Path;
use std::sync::Arc;

use arrow_array::RecordBatch;
use arrow_schema::{ArrowError, Schema, SchemaRef};
use parquet::basic::Compression;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesBuilder};
use parquet::schema::types::ColumnPath;

use super::schema::{self, CellType};
use super::{DeclaredColumn, Job, RowCells, StoreError};
use sweep_files::batches::from_arrow;
use sweep_files::{CREATED_BY, FileError, ParquetFile, Writer, key, panics, seal};

/// A reason why a file is not the expected part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum PartDamage {
    #[error("it is not as it was written")]
    Bytes,
    #[error("it belongs to another plan, index or version")]
    Foreign,
    #[error("its rows make no sense")]
    Rows,
}

/// A reason why a part's rows cannot be read.
#[derive(Debug)]
pub(super) enum PartError {
    /// The file is not the expected part.
    Damaged(PartDamage),
    /// Reading the file failed.
    Failed(StoreError),
}

impl From<PartDamage> for PartError {
    fn from(damage: PartDamage) -> Self {
        Self::Damaged(damage)
    }
}

impl From<FileError> for PartError {
    fn from(error: FileError) -> Self {
        match error {
            FileError::Io { .. } => Self::Failed(error.into()),
            _ => Self::Damaged(PartDamage::Bytes),
        }
    }
}

impl PartError {
    /// Separates damage, which the inner result has, from failures of reading.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub(super) fn separate_damage<T>(
        result: Result<T, Self>,
    ) -> Result<Result<T, PartDamage>, StoreError> {
        match result {
            Ok(value) => Ok(Ok(value)),
            Err(Self::Damaged(damage)) => Ok(Err(damage)),
            Err(Self::Failed(error)) => Err(error),
        }
    }
}

/// The columns of a job's parts, and the hash of its plan.
#[derive(Clone, Debug)]
pub(super) struct PartSchema {
    plan_hash: String,
    columns: Vec<DeclaredColumn>,
    schema: SchemaRef,
    properties: WriterProperties,
}

impl PartSchema {
    /// Returns the schema of a job's parts.
    pub(super) fn new(job: &Job<'_>, columns: Vec<DeclaredColumn>) -> Self {
        let plan = job.hash().to_hex().to_string();
        let metadata = vec![KeyValue::new(key::PLAN_HASH.to_owned(), plan.clone())];
        // A part is read once or twice, so compression and statistics would take more time than
        // they save.
        let builder = schema::common_writer_properties(job.version, metadata)
            .set_compression(Compression::UNCOMPRESSED)
            .set_statistics_enabled(EnabledStatistics::None)
            .set_offset_index_disabled(true)
            .set_max_row_group_row_count(None)
            .set_max_row_group_bytes(None)
            .set_dictionary_enabled(false);
        let name_columns =
            columns.iter().filter(|column| matches!(column.cell_type, CellType::Name(_)));
        let enable_dictionary = |builder: WriterPropertiesBuilder, column: &DeclaredColumn| {
            builder.set_column_dictionary_enabled(ColumnPath::from(column.name.as_str()), true)
        };
        let properties = name_columns.fold(builder, enable_dictionary).build();
        let fields: Vec<_> = columns.iter().map(DeclaredColumn::to_arrow_field).collect();
        Self { plan_hash: plan, schema: Arc::new(Schema::new(fields)), columns, properties }
    }

    /// Encodes rows as a part. `entry` is the entry `sweep.part` of its metadata.
    ///
    /// # Errors
    /// Returns the errors of the library, which are a defect of this program.
    pub(super) fn encode(&self, entry: &str, rows: &[RowCells]) -> Result<Vec<u8>, ParquetError> {
        let arrays = self.columns.iter().enumerate().map(|(k, column)| {
            column.to_array(rows.iter().map(|row| row.get(k).copied().flatten()))
        });
        let arrays = arrays.collect::<Result<Vec<_>, ArrowError>>().map_err(from_arrow)?;
        let batch = RecordBatch::try_new(Arc::clone(&self.schema), arrays).map_err(from_arrow)?;
        let write_unsealed = || {
            let mut writer = Writer::new(Vec::new(), &self.schema, self.properties.clone())?;
            writer.write(&batch)?;
            let mut writer = writer.end()?;
            writer.append_key_value_metadata(KeyValue::new(key::PART.to_owned(), entry.to_owned()));
            writer.append_key_value_metadata(seal::blank_digest());
            writer.into_inner()
        };
        let mut unsealed_file = io::Cursor::new(panics::catch_in_parquet(
            "the library gave up writing",
            write_unsealed,
        )?);
        seal::seal(&mut unsealed_file).map_err(|error| ParquetError::External(Box::new(error)))?;
        Ok(unsealed_file.into_inner())
    }

    /// Opens the part at a path; `None` if there is no file. A part with another `entry` is damage.
    pub(super) fn open(&self, path: &Path, entry: &str) -> Result<Option<Part<'_>>, PartError> {
        let Some(file) = open_sealed(path)? else { return Ok(None) };
        let has_same_plan = file.value(key::PLAN_HASH) == Some(&self.plan_hash)
            && file.value(key::PART) == Some(entry)
            && *file.schema() == self.schema;
        if has_same_plan {
            Ok(Some(Part { file, schema: self }))
        } else {
            Err(PartDamage::Foreign.into())
        }
    }

    /// Returns the number of columns.
    pub(super) const fn column_count(&self) -> usize {
        self.columns.len()
    }
}

/// An open part whose digest has been checked.
#[derive(Debug)]
pub(super) struct Part<'a> {
    file: ParquetFile,
    schema: &'a PartSchema,
}

impl Part<'_> {
    /// Returns the number of rows.
    pub(super) fn row_count(&self) -> u64 {
        self.file.rows()
    }

    /// Reads the columns at these positions, in batches.
    pub(super) fn read_batches(&self, columns: Vec<usize>) -> Result<Vec<RecordBatch>, PartError> {
        Ok(self.file.batches(columns)?.collect::<Result<_, FileError>>()?)
    }

    /// Reads the cells of the columns at these positions, row by row.
    pub(super) fn read_cells(&self, columns: &[usize]) -> Result<Vec<RowCells>, PartError> {
        let mut rows = Vec::new();
        for batch in self.read_batches(columns.to_vec())? {
            let first_row = rows.len();
            rows.resize_with(first_row + batch.num_rows(), || {
                RowCells::with_capacity(columns.len())
            });
            for (column, array) in columns.iter().zip(batch.columns()) {
                let column = &self.schema.columns[*column];
                let cells = column.cells_from_array(array).ok_or(PartDamage::Rows)?;
                rows[first_row..].iter_mut().zip(cells).for_each(|(row, cell)| row.push(cell));
            }
        }
        Ok(rows)
    }

    /// Reads the cells of all columns, row by row.
    pub(super) fn read_all_cells(&self) -> Result<Vec<RowCells>, PartError> {
        self.read_cells(&(0..self.schema.columns.len()).collect::<Vec<_>>())
    }
}

/// Opens a file that has a digest; `None` if there is no file.
fn open_sealed(path: &Path) -> Result<Option<ParquetFile>, PartError> {
    match ParquetFile::open(path) {
        Err(FileError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => Ok(None),
        Ok(file) if file.is_sealed() => Ok(Some(file)),
        Ok(_) => Err(PartDamage::Foreign.into()),
        Err(error) => Err(error.into()),
    }
}

/// Returns whether a file is a part that this program wrote, of any plan, damaged or not.
pub(super) fn is_part(path: &Path) -> bool {
    let part = ParquetFile::open_unchecked(path).ok();
    part.is_some_and(|file| {
        let is_from_this_program =
            file.created_by().is_some_and(|creator| creator.starts_with(CREATED_BY));
        is_from_this_program && file.value(key::PART).is_some()
    })
}

/// Opens a part of the plan with this hash, with any columns. Returns the part and its entry
/// `sweep.part`; `None` for any other file.
///
/// # Errors
/// A file that cannot be read.
pub(super) fn open_part_of_plan(
    path: &Path,
    plan: &blake3::Hash,
) -> Result<Option<(ParquetFile, String)>, StoreError> {
    let Ok(Some(file)) = PartError::separate_damage(open_sealed(path))? else { return Ok(None) };
    let has_same_plan = file.value(key::PLAN_HASH) == Some(plan.to_hex().as_str());
    let entry = file.value(key::PART).map(str::to_owned);
    Ok(entry.filter(|_| has_same_plan).map(|entry| (file, entry)))
}

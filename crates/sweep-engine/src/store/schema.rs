//! The columns of a result, which depend on the plan alone. The file has their units and
//! descriptions. Rows are lists of cells, so that the store does not depend on a model's numbers.

use std::sync::Arc;

use arrow_array::cast::AsArray as _;
use arrow_array::types::{Float64Type, Int32Type, UInt64Type};
use arrow_array::{
    Array, ArrayRef, BooleanArray, DictionaryArray, Float64Array, Int32Array, RecordBatch,
    StringArray, UInt64Array,
};
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef};
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{WriterProperties, WriterPropertiesBuilder};
use parquet::schema::types::ColumnPath;
use serde_json::Value;

use super::Job;
use sweep_files::{CREATED_BY, ColumnMetadata, FileKind, key};

/// The number of rows of a row group, which is fixed so that the file does not depend on chunks.
/// Basis: a group of 25 columns takes about 30 MB of memory while it is written. Doubling it
/// doubles that.
pub const ROW_GROUP_ROWS: usize = 1 << 17;

/// The number of rows that are passed to the Parquet writer at once, which is fixed so that the
/// file does not depend on chunks. Basis: a divisor of [`ROW_GROUP_ROWS`]. Doubling it doubles the
/// memory of a batch.
pub const BATCH_ROWS: usize = 1 << 12;

/// The name of the column of point indices.
pub(super) const POINT_COLUMN: &str = "point";

/// The type of a column's cells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CellType {
    /// A whole number, never null.
    Count,
    /// A whole number, or null.
    KnownCount,
    /// A number, or null. The numbers of a column hardly ever repeat.
    Measured,
    /// The value of an axis, never null.
    Axis,
    /// A number that may repeat, or null.
    Time,
    /// A number that a resumed run needs. It is in parts, but not in the result.
    Kept,
    /// True, false, or null.
    Flag,
    /// An index in a list of names, or null. The list is the same for every row and batch of a
    /// plan.
    Name(Vec<&'static str>),
}

/// A column of a file that is to be written.
#[derive(Clone, Debug, PartialEq)]
pub struct DeclaredColumn {
    /// The name.
    pub name: String,
    /// The metadata of the column's field.
    pub metadata: ColumnMetadata,
    /// The type of the cells.
    pub cell_type: CellType,
    /// The difference from the column's limit that is as important as a factor of e is for a ratio,
    /// in the column's unit; `None` without a limit.
    pub limit_scale: Option<f64>,
}

/// The columns and the kind of a result.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// The axes, first to last.
    pub axes: Vec<DeclaredColumn>,
    /// The model's columns, in order.
    pub columns: Vec<DeclaredColumn>,
    /// The kind of the result file.
    pub kind: FileKind<'static>,
    /// The number of tasks that the engine computes for each point of the grid: more than 1 if, for
    /// example, a point is evaluated at several held speeds. Each task has a number of its own.
    pub tasks_per_point: u64,
    /// Whether a task may return several rows.
    pub has_several_rows: bool,
    /// Further entries in the file's metadata.
    pub metadata: Vec<(&'static str, Value)>,
}

/// The cells of a row, without point and axis values: bits of numbers, indices of names, 0 or 1 for
/// false or true, `None` for null.
pub type RowCells = Vec<Option<u64>>;

/// A point with its rows: one, or several if the model finds several.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PointRows {
    /// The number by which the engine identifies the point.
    pub point: u64,
    /// The rows, at least one.
    pub rows: Vec<RowCells>,
}

impl Layout {
    /// Returns the layout of a map, which has one row for each point.
    pub fn map(axes: Vec<DeclaredColumn>, columns: Vec<DeclaredColumn>) -> Self {
        let kind = FileKind::Map;
        Self {
            axes,
            columns,
            kind,
            tasks_per_point: 1,
            has_several_rows: false,
            metadata: Vec::new(),
        }
    }
}

impl DeclaredColumn {
    /// Creates a column.
    pub fn new(
        name: impl Into<String>,
        unit: &str,
        description: impl Into<String>,
        kind: CellType,
    ) -> Self {
        let description = description.into();
        let metadata =
            ColumnMetadata { unit: unit.into(), description, ..ColumnMetadata::default() };
        Self { name: name.into(), metadata, cell_type: kind, limit_scale: None }
    }

    /// Returns the number in a cell; `None` for null, flags and names.
    pub fn number(&self, cell: Option<u64>) -> Option<f64> {
        match self.cell_type {
            CellType::Count | CellType::KnownCount => cell.map(|count| count as f64),
            CellType::Measured | CellType::Axis | CellType::Time | CellType::Kept => {
                cell.map(f64::from_bits)
            }
            CellType::Flag | CellType::Name(_) => None,
        }
    }

    pub(super) fn to_arrow_field(&self) -> Field {
        let dictionary_type =
            || DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        let (data_type, nullable) = match self.cell_type {
            CellType::Count => (DataType::UInt64, false),
            CellType::KnownCount => (DataType::UInt64, true),
            CellType::Axis => (DataType::Float64, false),
            CellType::Measured | CellType::Time | CellType::Kept => (DataType::Float64, true),
            CellType::Flag => (DataType::Boolean, true),
            CellType::Name(_) => (dictionary_type(), true),
        };
        self.arrow_field(data_type, nullable)
    }

    /// Returns the Arrow field of the column with its metadata.
    pub(crate) fn arrow_field(&self, data_type: DataType, nullable: bool) -> Field {
        Field::new(&self.name, data_type, nullable).with_metadata(self.metadata.to_pairs())
    }

    /// Returns the array of the column's cells. A missing count becomes 0, and a missing axis value
    /// NaN.
    pub(super) fn to_array(
        &self,
        cells: impl Iterator<Item = Option<u64>>,
    ) -> Result<ArrayRef, ArrowError> {
        Ok(match &self.cell_type {
            CellType::Count => {
                Arc::new(UInt64Array::from_iter_values(cells.map(Option::unwrap_or_default)))
            }
            CellType::KnownCount => Arc::new(cells.collect::<UInt64Array>()),
            CellType::Axis => Arc::new(Float64Array::from_iter_values(
                cells.map(|cell| cell.map_or(f64::NAN, f64::from_bits)),
            )),
            CellType::Measured | CellType::Time | CellType::Kept => {
                Arc::new(cells.map(|cell| cell.map(f64::from_bits)).collect::<Float64Array>())
            }
            CellType::Flag => {
                Arc::new(cells.map(|cell| cell.map(|flag| flag != 0)).collect::<BooleanArray>())
            }
            CellType::Name(names) => {
                let name_indices: Int32Array =
                    cells.map(|name| i32::try_from(name?).ok()).collect();
                let names = StringArray::from_iter_values(names);
                Arc::new(DictionaryArray::<Int32Type>::try_new(name_indices, Arc::new(names))?)
            }
        })
    }

    /// Returns the cells of an array, as the inverse of [`DeclaredColumn::to_array`]; `None` for an
    /// array of another type.
    pub(super) fn cells_from_array(&self, array: &dyn Array) -> Option<Vec<Option<u64>>> {
        let cells: Vec<Option<u64>> = match &self.cell_type {
            CellType::Count | CellType::KnownCount => {
                array.as_primitive_opt::<UInt64Type>()?.iter().collect()
            }
            CellType::Measured | CellType::Axis | CellType::Time | CellType::Kept => {
                let numbers = array.as_primitive_opt::<Float64Type>()?.iter();
                numbers.map(|number| number.map(f64::to_bits)).collect()
            }
            CellType::Flag => {
                array.as_boolean_opt()?.iter().map(|flag| flag.map(u64::from)).collect()
            }
            CellType::Name(names) => {
                let dictionary = array.as_dictionary_opt::<Int32Type>()?;
                let dictionary_words = dictionary.values().as_string_opt::<i32>()?.iter();
                let name_index =
                    |word: Option<&str>| names.iter().position(|name| Some(*name) == word);
                let indices: Vec<u64> = dictionary_words
                    .map(|word| name_index(word).map(|name_index| name_index as u64))
                    .collect::<Option<_>>()?;
                let cell_of_key = |key: Option<i32>| key.map(|key| indices[key as usize]);
                dictionary.keys().iter().map(cell_of_key).collect()
            }
        };
        Some(cells)
    }

    /// Returns whether a cell fits the type of the column.
    pub(super) fn accepts_cell(&self, cell: Option<u64>) -> bool {
        match (&self.cell_type, cell) {
            (CellType::Count | CellType::Axis, cell) => cell.is_some(),
            (_, None)
            | (CellType::KnownCount | CellType::Measured | CellType::Time | CellType::Kept, _) => {
                true
            }
            (CellType::Flag, Some(flag)) => flag <= 1,
            (CellType::Name(names), Some(name)) => name < names.len() as u64,
        }
    }
}

impl Layout {
    /// Returns the maximum number of bytes that a row takes in a part.
    pub fn bytes_per_row(&self) -> usize {
        8 * (1 + self.axes.len() + self.columns.len())
    }

    /// Iterates over all columns of the result: the point's index, the axes, and the model's
    /// columns.
    pub(super) fn all_columns(&self) -> impl Iterator<Item = &DeclaredColumn> + Clone {
        /// The column of point indices.
        static POINT_INDEX_COLUMN: std::sync::LazyLock<DeclaredColumn> =
            std::sync::LazyLock::new(|| {
                DeclaredColumn::new(POINT_COLUMN, "1", "index in grid order", CellType::Count)
            });
        let columns = self.columns.iter().filter(|column| column.cell_type != CellType::Kept);
        std::iter::once(&*POINT_INDEX_COLUMN).chain(&self.axes).chain(columns)
    }

    /// Returns the Arrow schema.
    pub fn schema(&self) -> SchemaRef {
        Arc::new(Schema::new(
            self.all_columns().map(DeclaredColumn::to_arrow_field).collect::<Vec<_>>(),
        ))
    }

    /// Returns the number in a row's cell of a column; `None` for null, flags and names, and
    /// without such a column.
    pub fn number(&self, row: &RowCells, column: &str) -> Option<f64> {
        let k = self.position(column)?;
        self.columns[k].number(*row.get(k)?)
    }

    /// Returns the truth value in a row's cell of a column; `None` for null, and without such a
    /// column.
    pub fn flag(&self, row: &RowCells, column: &str) -> Option<bool> {
        let k = self.position(column).filter(|k| self.columns[*k].cell_type == CellType::Flag)?;
        row.get(k)?.map(|flag| flag != 0)
    }

    /// Returns the name in a row's cell of a column; `None` for null, and without such a column of
    /// names.
    pub fn name(&self, row: &RowCells, column: &str) -> Option<&'static str> {
        let k = self.position(column)?;
        let CellType::Name(names) = &self.columns[k].cell_type else { return None };
        names.get((*row.get(k)?)? as usize).copied()
    }

    /// Returns the position of a column among those of the model.
    pub fn position(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.name == name)
    }
}

/// Returns the settings of the writer and the metadata of a result. They do not depend on time,
/// host or progress of the run.
pub fn result_writer_properties(job: &Job<'_>) -> WriterProperties {
    let metadata_entry = |key: &str, value: String| KeyValue::new(key.to_owned(), value);
    let mut metadata_entries = vec![
        metadata_entry(key::PLAN, job.plan.to_string()),
        metadata_entry(key::PLAN_HASH, job.hash().to_hex().to_string()),
        metadata_entry(key::VERSION, job.version.to_owned()),
        metadata_entry(key::NUMERICS, job.numerics.to_string()),
    ];
    metadata_entries.extend(
        job.layout.metadata.iter().map(|(key, value)| metadata_entry(key, value.to_string())),
    );
    let builder = common_writer_properties(job.version, metadata_entries)
        .set_max_row_group_row_count(Some(ROW_GROUP_ROWS))
        .set_max_row_group_bytes(None);
    // A dictionary of numbers that hardly repeat would be built and then discarded.
    let measured_columns =
        job.layout.all_columns().filter(|column| column.cell_type == CellType::Measured);
    let disable_dictionary = |builder: WriterPropertiesBuilder, column: &DeclaredColumn| {
        builder.set_column_dictionary_enabled(ColumnPath::from(column.name.as_str()), false)
    };
    measured_columns.fold(builder, disable_dictionary).build()
}

/// Returns the settings of the writer that all files of this program share.
pub(crate) fn common_writer_properties(
    version: &str,
    metadata: Vec<KeyValue>,
) -> WriterPropertiesBuilder {
    WriterProperties::builder()
        // The library's default contains its version, so that an upgrade would change the bytes.
        .set_created_by(format!("{CREATED_BY}{version}"))
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(metadata))
}

/// A builder of batches from rows.
pub struct BatchBuilder<'a> {
    layout: &'a Layout,
    schema: SchemaRef,
    /// The rows, each with the number of its point and the values of the axes.
    rows: Vec<(u64, Vec<f64>, RowCells)>,
}

impl<'a> BatchBuilder<'a> {
    /// Creates a builder without rows.
    pub fn new(layout: &'a Layout) -> Self {
        Self::with_schema(layout, layout.schema())
    }

    /// Creates a builder whose batches share the schema of others of the same layout. A schema
    /// contains descriptions; one for each batch would take 4 % of its memory.
    pub fn with_schema(layout: &'a Layout, schema: SchemaRef) -> Self {
        Self { layout, schema, rows: Vec::with_capacity(BATCH_ROWS) }
    }

    /// Returns the schema of the batches.
    pub fn schema(&self) -> SchemaRef {
        Arc::clone(&self.schema)
    }

    /// Adds a row of a point with the values of the axes.
    pub fn push_row(&mut self, point: u64, axis_values: Vec<f64>, row: RowCells) {
        self.rows.push((point, axis_values, row));
    }

    /// Takes the rows that were added so far, and returns them as a batch.
    ///
    /// # Errors
    /// Rows that do not fit the layout.
    pub fn take_batch(&mut self) -> Result<RecordBatch, ArrowError> {
        let rows = &self.rows;
        let tasks_per_point = self.layout.tasks_per_point;
        let axis_count = self.layout.axes.len();
        let column_array = |(k, column): (usize, &DeclaredColumn)| match k.checked_sub(1) {
            None => column.to_array(rows.iter().map(|(point, ..)| Some(point / tasks_per_point))),
            Some(axis) if axis < axis_count => column.to_array(
                rows.iter().map(|(_, values, _)| values.get(axis).map(|value| value.to_bits())),
            ),
            Some(k) => {
                let model_column = k - axis_count;
                column
                    .to_array(rows.iter().map(|(.., row)| row.get(model_column).copied().flatten()))
            }
        };
        let arrays = self
            .layout
            .all_columns()
            .enumerate()
            .map(column_array)
            .collect::<Result<Vec<_>, _>>()?;
        self.rows.clear();
        RecordBatch::try_new(self.schema(), arrays)
    }
}

#[cfg(test)]
mod tests;

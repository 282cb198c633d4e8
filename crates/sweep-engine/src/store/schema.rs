//! The result file's columns: a function of the plan, with units and descriptions that travel in
//! the file. A row is kept by its cells, so that neither unfinished work nor joining knows what a
//! model computes.

use std::collections::HashMap;
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
use sweep_files::{CREATED_BY, FileKind, key};
use sweep_parameter::{Limit, Worse};

/// Rows in a row group: fixed, so that chunking leaves no trace in the file. A group of 25 columns
/// takes about 30 MB in memory while it is written.
pub const ROW_GROUP_ROWS: usize = 1 << 17;

/// Rows handed to the Parquet writer at once: fixed for the same reason, and a whole number of them
/// makes a group.
pub const BATCH_ROWS: usize = 1 << 12;

/// The name of the column of points.
pub(super) const POINT: &str = "point";

/// What a column's cells are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Holds {
    /// A whole number, never null.
    Count,
    /// A whole number, if it is known.
    KnownCount,
    /// A number that hardly ever repeats.
    Measured,
    /// A swept value, never null.
    Axis,
    /// A number that may repeat.
    Time,
    /// A number for whoever goes on with an unfinished run: the file does not have it.
    Kept,
    /// True or false.
    Flag,
    /// A position in a list of names that is the same for every row, batch and run of the plan.
    Name(Vec<&'static str>),
}

/// A column of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// One line.
    pub description: String,
    /// What its cells are.
    pub kind: Holds,
    /// Which way it is bad, if it is a number that can be.
    pub worse: Option<Worse>,
    /// Up to where it is good, if that has a meaning of its own.
    pub limit: Option<Limit>,
}

/// What the columns depend on.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// The axes, first to last.
    pub axes: Vec<Column>,
    /// The model's columns, in order.
    pub columns: Vec<Column>,
    /// The kind of the result file.
    pub kind: FileKind<'static>,
    /// Numbers that the engine knows rows by, of each point of the grid: 1 but where a point is
    /// looked at several times.
    pub rows_a_point: u64,
    /// Whether there may be several rows of one number.
    pub has_several: bool,
    /// Further entries of the file's metadata.
    pub metadata: Vec<(&'static str, Value)>,
}

/// The cells of a row, without its place: bits of numbers, positions of names, 0 or 1; none where
/// null.
pub type Row = Vec<Option<u64>>;

/// The outcome of a point: one row, or several where a model finds several.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Done {
    /// What the engine was asked for.
    pub point: u64,
    /// At least one.
    pub rows: Vec<Row>,
}

impl Layout {
    /// Returns the layout of a map, which has one row for each point.
    pub fn map(axes: Vec<Column>, columns: Vec<Column>) -> Self {
        let kind = FileKind::Map;
        Self { axes, columns, kind, rows_a_point: 1, has_several: false, metadata: Vec::new() }
    }
}

impl Column {
    /// A column.
    pub fn new(
        name: impl Into<String>,
        unit: &str,
        description: impl Into<String>,
        kind: Holds,
    ) -> Self {
        let (name, description) = (name.into(), description.into());
        Self { name, unit: unit.into(), description, kind, worse: None, limit: None }
    }

    /// The number in a cell, if it is a column of numbers.
    pub fn number(&self, cell: Option<u64>) -> Option<f64> {
        match self.kind {
            Holds::Count | Holds::KnownCount => cell.map(|count| count as f64),
            Holds::Measured | Holds::Axis | Holds::Time | Holds::Kept => cell.map(f64::from_bits),
            Holds::Flag | Holds::Name(_) => None,
        }
    }

    pub(super) fn field(&self) -> Field {
        let names = || DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        let (data_type, nullable) = match self.kind {
            Holds::Count => (DataType::UInt64, false),
            Holds::KnownCount => (DataType::UInt64, true),
            Holds::Axis => (DataType::Float64, false),
            Holds::Measured | Holds::Time | Holds::Kept => (DataType::Float64, true),
            Holds::Flag => (DataType::Boolean, true),
            Holds::Name(_) => (names(), true),
        };
        self.declared(data_type, nullable)
    }

    /// The field of such data, with what the file says of the column.
    pub(crate) fn declared(&self, data_type: DataType, nullable: bool) -> Field {
        let mut told = HashMap::from([
            ("unit".to_owned(), self.unit.clone()),
            ("description".to_owned(), self.description.clone()),
        ]);
        told.extend(self.worse.map(|worse| (key::WORSE.to_owned(), worse.name().to_owned())));
        told.extend(
            self.limit.map(|limit| (key::LIMIT.to_owned(), Value::from(limit.value).to_string())),
        );
        Field::new(&self.name, data_type, nullable).with_metadata(told)
    }

    /// The column's array; cells that must be there and are not become zeros.
    pub(super) fn array(
        &self,
        cells: impl Iterator<Item = Option<u64>>,
    ) -> Result<ArrayRef, ArrowError> {
        Ok(match &self.kind {
            Holds::Count => {
                Arc::new(UInt64Array::from_iter_values(cells.map(Option::unwrap_or_default)))
            }
            Holds::KnownCount => Arc::new(cells.collect::<UInt64Array>()),
            Holds::Axis => Arc::new(Float64Array::from_iter_values(
                cells.map(|cell| cell.map_or(f64::NAN, f64::from_bits)),
            )),
            Holds::Measured | Holds::Time | Holds::Kept => {
                Arc::new(cells.map(|cell| cell.map(f64::from_bits)).collect::<Float64Array>())
            }
            Holds::Flag => {
                Arc::new(cells.map(|cell| cell.map(|flag| flag != 0)).collect::<BooleanArray>())
            }
            Holds::Name(names) => {
                let keys: Int32Array = cells.map(|name| i32::try_from(name?).ok()).collect();
                let names = StringArray::from_iter_values(names);
                Arc::new(DictionaryArray::<Int32Type>::try_new(keys, Arc::new(names))?)
            }
        })
    }

    /// Returns the cells of an array that [`Column::array`] has made, or of one that was read back;
    /// `None` of any other.
    pub(super) fn cells(&self, array: &dyn Array) -> Option<Vec<Option<u64>>> {
        let cells: Vec<Option<u64>> = match &self.kind {
            Holds::Count | Holds::KnownCount => {
                array.as_primitive_opt::<UInt64Type>()?.iter().collect()
            }
            Holds::Measured | Holds::Axis | Holds::Time | Holds::Kept => {
                let numbers = array.as_primitive_opt::<Float64Type>()?.iter();
                numbers.map(|number| number.map(f64::to_bits)).collect()
            }
            Holds::Flag => array.as_boolean_opt()?.iter().map(|flag| flag.map(u64::from)).collect(),
            Holds::Name(names) => {
                let coded = array.as_dictionary_opt::<Int32Type>()?;
                let words = coded.values().as_string_opt::<i32>()?.iter();
                let place = |word: Option<&str>| names.iter().position(|name| Some(*name) == word);
                let places: Vec<u64> = words
                    .map(|word| place(word).map(|place| place as u64))
                    .collect::<Option<_>>()?;
                let cell = |key: Option<i32>| key.map(|key| places[key as usize]);
                coded.keys().iter().map(cell).collect()
            }
        };
        Some(cells)
    }

    /// Whether a cell is one of this column.
    pub(super) fn takes(&self, cell: Option<u64>) -> bool {
        match (&self.kind, cell) {
            (Holds::Count | Holds::Axis, cell) => cell.is_some(),
            (_, None) | (Holds::KnownCount | Holds::Measured | Holds::Time | Holds::Kept, _) => {
                true
            }
            (Holds::Flag, Some(flag)) => flag <= 1,
            (Holds::Name(names), Some(name)) => name < names.len() as u64,
        }
    }
}

impl Layout {
    /// Returns the bytes of a row in a part, at most.
    pub fn bytes_a_row(&self) -> usize {
        8 * (1 + self.axes.len() + self.columns.len())
    }

    /// Every column, in order.
    pub(super) fn all(&self) -> impl Iterator<Item = &Column> + Clone {
        static POINTS: std::sync::LazyLock<Column> = std::sync::LazyLock::new(|| {
            Column::new(POINT, "1", "index in grid order", Holds::Count)
        });
        let columns = self.columns.iter().filter(|column| column.kind != Holds::Kept);
        std::iter::once(&*POINTS).chain(&self.axes).chain(columns)
    }

    /// The Arrow schema.
    pub fn schema(&self) -> SchemaRef {
        Arc::new(Schema::new(self.all().map(Column::field).collect::<Vec<_>>()))
    }

    /// The position of one of the model's columns.
    pub fn position(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.name == name)
    }
}

/// Writer settings and metadata of a result file. Nothing in them depends on when, where or how the
/// run went.
pub fn properties(job: &Job<'_>) -> WriterProperties {
    let pair = |key: &str, value: String| KeyValue::new(key.to_owned(), value);
    let mut metadata = vec![
        pair(key::PLAN, job.plan.to_string()),
        pair(key::PLAN_HASH, job.hash().to_hex().to_string()),
        pair(key::VERSION, job.version.to_owned()),
        pair(key::NUMERICS, job.numerics.to_string()),
    ];
    metadata.extend(job.layout.metadata.iter().map(|(key, value)| pair(key, value.to_string())));
    let builder = writer(job.version, metadata)
        .set_max_row_group_row_count(Some(ROW_GROUP_ROWS))
        .set_max_row_group_bytes(None);
    // A dictionary of them would be written and thrown away.
    let unlike = job.layout.all().filter(|column| column.kind == Holds::Measured);
    let plain = |builder: WriterPropertiesBuilder, column: &Column| {
        builder.set_column_dictionary_enabled(ColumnPath::from(column.name.as_str()), false)
    };
    unlike.fold(builder, plain).build()
}

/// Settings of every file that this program writes.
pub(crate) fn writer(version: &str, metadata: Vec<KeyValue>) -> WriterPropertiesBuilder {
    WriterProperties::builder()
        // The library's own default names its version, and an upgrade would change the bytes.
        .set_created_by(format!("{CREATED_BY}{version}"))
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(metadata))
}

/// Rows on their way into a batch.
pub struct ResultRows<'a> {
    layout: &'a Layout,
    schema: SchemaRef,
    /// Each with the number that it is known by, and its place.
    rows: Vec<(u64, Vec<f64>, Row)>,
}

impl<'a> ResultRows<'a> {
    /// The rows of a layout.
    pub fn new(layout: &'a Layout) -> Self {
        Self::sharing(layout, layout.schema())
    }

    /// With the schema of other batches of this layout: every field carries its description, so
    /// that one of their own would take 4 % of a batch's memory.
    pub fn sharing(layout: &'a Layout, schema: SchemaRef) -> Self {
        Self { layout, schema, rows: Vec::with_capacity(BATCH_ROWS) }
    }

    /// The schema of its batches.
    pub fn schema(&self) -> SchemaRef {
        Arc::clone(&self.schema)
    }

    /// Adds a row of a point, with the values of the axes there.
    pub fn push(&mut self, point: u64, axis_values: Vec<f64>, row: Row) {
        self.rows.push((point, axis_values, row));
    }

    /// The rows so far as a batch; leaves none.
    ///
    /// # Errors
    /// Rows of another layout.
    pub fn take(&mut self) -> Result<RecordBatch, ArrowError> {
        let rows = &self.rows;
        let a_point = self.layout.rows_a_point;
        let axes = self.layout.axes.len();
        let array = |(k, column): (usize, &Column)| match k.checked_sub(1) {
            None => column.array(rows.iter().map(|(point, ..)| Some(point / a_point))),
            Some(axis) if axis < axes => column
                .array(rows.iter().map(|(_, at, _)| at.get(axis).map(|value| value.to_bits()))),
            Some(k) => {
                let k = k - axes;
                column.array(rows.iter().map(|(.., row)| row.get(k).copied().flatten()))
            }
        };
        let arrays = self.layout.all().enumerate().map(array).collect::<Result<Vec<_>, _>>()?;
        self.rows.clear();
        RecordBatch::try_new(self.schema(), arrays)
    }
}

#[cfg(test)]
mod tests;

//! Writes rows into a Parquet file, by the Parquet library's own column writers.

use std::io::Write;

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int32Type, UInt64Type};
use arrow_array::{Array, RecordBatch};
use arrow_schema::{DataType, Field, FieldRef, Schema};
use parquet::basic::{LogicalType, Repetition, Type};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type as Declared;
use serde_json::Value;

use crate::key;

/// An unfinished Parquet file of counts, numbers, truth values, and words of a dictionary.
pub struct Writer<W: Write> {
    file: SerializedFileWriter<W>,
    /// The number of rows of a whole row group.
    group_rows: usize,
    /// The number of rows of the unfinished group.
    count: usize,
    rows: Vec<RecordBatch>,
}

impl<W: Write + Send> Writer<W> {
    /// Begins a file of these columns, which are described under [`key::COLUMNS`].
    ///
    /// # Errors
    /// Those of the library.
    pub fn new(
        sink: W,
        schema: &Schema,
        properties: WriterProperties,
    ) -> Result<Self, ParquetError> {
        let fields = schema.fields().iter().map(|field| Ok(declared(field)?.into()));
        let fields = fields.collect::<Result<_, ParquetError>>()?;
        let root = Declared::group_type_builder("arrow_schema").with_fields(fields).build()?;
        let group_rows = properties.max_row_group_row_count().unwrap_or(usize::MAX);
        let mut file = SerializedFileWriter::new(sink, root.into(), properties.into())?;
        file.append_key_value_metadata(column_metadata(schema));
        Ok(Self { file, group_rows, count: 0, rows: Vec::new() })
    }

    /// Adds rows. They are held until their group is whole.
    ///
    /// # Errors
    /// Those of the library.
    pub fn write(&mut self, rows: &RecordBatch) -> Result<(), ParquetError> {
        let mut from = 0;
        while from < rows.num_rows() {
            let more = (rows.num_rows() - from).min(self.group_rows - self.count);
            self.rows.push(rows.slice(from, more));
            self.count += more;
            from += more;
            if self.count == self.group_rows {
                self.flush()?;
            }
        }
        Ok(())
    }

    /// Writes the last row group. The returned file is open for its last metadata and its end.
    ///
    /// # Errors
    /// Those of the library.
    pub fn end(mut self) -> Result<SerializedFileWriter<W>, ParquetError> {
        if self.count > 0 {
            self.flush()?;
        }
        Ok(self.file)
    }

    fn flush(&mut self) -> Result<(), ParquetError> {
        let mut group = self.file.next_row_group()?;
        let mut place = 0;
        while let Some(mut column) = group.next_column()? {
            for rows in &self.rows {
                write(column.untyped(), rows.column(place))?;
            }
            column.close()?;
            place += 1;
        }
        group.close()?;
        self.rows.clear();
        self.count = 0;
        Ok(())
    }
}

/// Returns the fields' metadata as an entry of the file's, because Parquet has no place for it
/// beside the columns.
fn column_metadata(schema: &Schema) -> KeyValue {
    let entry = |field: &FieldRef| {
        let kind = match field.data_type() {
            DataType::Boolean => "bool",
            DataType::UInt64 => "uint64",
            DataType::Float64 => "float64",
            _ => "string",
        };
        let pairs = field.metadata().iter().map(|(key, text)| {
            let number = (key == key::LIMIT).then(|| serde_json::from_str(text).ok()).flatten();
            (key.clone(), number.unwrap_or_else(|| Value::from(text.as_str())))
        });
        let entry = pairs.chain([("type".to_owned(), kind.into())]).collect::<Value>();
        (field.name().clone(), entry)
    };
    let columns: Value = schema.fields().iter().map(entry).collect();
    KeyValue::new(key::COLUMNS.to_owned(), columns.to_string())
}

fn declared(field: &Field) -> Result<Declared, ParquetError> {
    let (physical, logical) = match field.data_type() {
        DataType::Boolean => (Type::BOOLEAN, None),
        DataType::UInt64 => (Type::INT64, Some(LogicalType::integer(64, false))),
        DataType::Float64 => (Type::DOUBLE, None),
        _ => (Type::BYTE_ARRAY, Some(LogicalType::String)),
    };
    let is_nullable = field.is_nullable();
    Declared::primitive_type_builder(field.name(), physical)
        .with_logical_type(logical)
        .with_repetition(if is_nullable { Repetition::OPTIONAL } else { Repetition::REQUIRED })
        .build()
}

fn write(column: &mut ColumnWriter<'_>, array: &dyn Array) -> Result<usize, ParquetError> {
    let levels: Vec<i16> = match array.nulls() {
        None => vec![1; array.len()],
        Some(nulls) => nulls.iter().map(i16::from).collect(),
    };
    let levels = Some(levels.as_slice());
    match column {
        ColumnWriter::BoolColumnWriter(column) => {
            let cells: Vec<bool> = array.as_boolean().iter().flatten().collect();
            column.write_batch(&cells, levels, None)
        }
        ColumnWriter::Int64ColumnWriter(column) => {
            let cells = array.as_primitive::<UInt64Type>().iter().flatten();
            column.write_batch(&cells.map(u64::cast_signed).collect::<Vec<_>>(), levels, None)
        }
        ColumnWriter::DoubleColumnWriter(column) => {
            let array = array.as_primitive::<Float64Type>();
            if array.null_count() == 0 {
                return column.write_batch(array.values(), levels, None);
            }
            column.write_batch(&array.iter().flatten().collect::<Vec<_>>(), levels, None)
        }
        ColumnWriter::ByteArrayColumnWriter(column) => {
            let coded = array.as_dictionary::<Int32Type>();
            let words = coded.values().as_string::<i32>().iter();
            let words: Vec<ByteArray> = words.map(|word| word.unwrap_or_default().into()).collect();
            let cells = coded.keys().iter().flatten().map(|key| words[key as usize].clone());
            column.write_batch(&cells.collect::<Vec<_>>(), levels, None)
        }
        _ => unreachable!("`declared` makes no others"),
    }
}

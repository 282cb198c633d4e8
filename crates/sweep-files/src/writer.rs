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
use parquet::schema::types::Type as ParquetType;
use serde_json::Value;

use crate::key;

/// A writer of a Parquet file of counts, numbers, truth values, and words of a dictionary.
pub struct Writer<W: Write> {
    file: SerializedFileWriter<W>,
    /// The number of rows of a full row group.
    group_rows: usize,
    /// The number of rows of the unfinished group.
    count: usize,
    rows: Vec<RecordBatch>,
}

impl<W: Write + Send> Writer<W> {
    /// Begins a file of these columns, and describes them in the metadata under [`key::COLUMNS`].
    ///
    /// # Errors
    /// Those of the library.
    pub fn new(
        sink: W,
        schema: &Schema,
        properties: WriterProperties,
    ) -> Result<Self, ParquetError> {
        let fields = schema.fields().iter().map(|field| Ok(declare_type(field)?.into()));
        let fields = fields.collect::<Result<_, ParquetError>>()?;
        let root_type =
            ParquetType::group_type_builder("arrow_schema").with_fields(fields).build()?;
        let group_rows = properties.max_row_group_row_count().unwrap_or(usize::MAX);
        let mut file = SerializedFileWriter::new(sink, root_type.into(), properties.into())?;
        file.append_key_value_metadata(column_metadata(schema));
        Ok(Self { file, group_rows, count: 0, rows: Vec::new() })
    }

    /// Adds rows, which are held until their row group is full.
    ///
    /// # Errors
    /// Those of the library.
    pub fn write(&mut self, rows: &RecordBatch) -> Result<(), ParquetError> {
        let mut first_row = 0;
        while first_row < rows.num_rows() {
            let row_count = (rows.num_rows() - first_row).min(self.group_rows - self.count);
            self.rows.push(rows.slice(first_row, row_count));
            self.count += row_count;
            first_row += row_count;
            if self.count == self.group_rows {
                self.flush()?;
            }
        }
        Ok(())
    }

    /// Writes the last row group. Further metadata can be added to the returned file before it is
    /// closed.
    ///
    /// # Errors
    /// Those of the library.
    pub fn end(mut self) -> Result<SerializedFileWriter<W>, ParquetError> {
        if self.count > 0 {
            self.flush()?;
        }
        Ok(self.file)
    }

    /// Writes a row group. The library gets each column in one call: it ends pages by the rows of a
    /// call, and the file must not depend on the batches in which the rows came.
    fn flush(&mut self) -> Result<(), ParquetError> {
        let mut row_group = self.file.next_row_group()?;
        let mut column_index = 0;
        while let Some(mut column) = row_group.next_column()? {
            let arrays: Vec<&dyn Array> =
                self.rows.iter().map(|rows| rows.column(column_index).as_ref()).collect();
            write_column(column.untyped(), &arrays)?;
            column.close()?;
            column_index += 1;
        }
        row_group.close()?;
        self.rows.clear();
        self.count = 0;
        Ok(())
    }
}

/// Returns the metadata of all columns as one entry of the file's metadata, because Parquet has
/// none for a column.
fn column_metadata(schema: &Schema) -> KeyValue {
    let column_description = |field: &FieldRef| {
        let cell_type = match field.data_type() {
            DataType::Boolean => "bool",
            DataType::UInt64 => "uint64",
            DataType::Float64 => "float64",
            _ => "string",
        };
        let metadata_pairs = field.metadata().iter().map(|(key, text)| {
            let limit_number =
                (key == key::LIMIT).then(|| serde_json::from_str(text).ok()).flatten();
            (key.clone(), limit_number.unwrap_or_else(|| Value::from(text.as_str())))
        });
        let column_description =
            metadata_pairs.chain([("type".to_owned(), cell_type.into())]).collect::<Value>();
        (field.name().clone(), column_description)
    };
    let columns: Value = schema.fields().iter().map(column_description).collect();
    KeyValue::new(key::COLUMNS.to_owned(), columns.to_string())
}

fn declare_type(field: &Field) -> Result<ParquetType, ParquetError> {
    let (physical, logical) = match field.data_type() {
        DataType::Boolean => (Type::BOOLEAN, None),
        DataType::UInt64 => (Type::INT64, Some(LogicalType::integer(64, false))),
        DataType::Float64 => (Type::DOUBLE, None),
        _ => (Type::BYTE_ARRAY, Some(LogicalType::String)),
    };
    let is_nullable = field.is_nullable();
    ParquetType::primitive_type_builder(field.name(), physical)
        .with_logical_type(logical)
        .with_repetition(if is_nullable { Repetition::OPTIONAL } else { Repetition::REQUIRED })
        .build()
}

/// Writes the arrays of a column one after the other.
fn write_column(
    column: &mut ColumnWriter<'_>,
    arrays: &[&dyn Array],
) -> Result<usize, ParquetError> {
    let mut levels: Vec<i16> = Vec::new();
    for array in arrays {
        match array.nulls() {
            None => levels.resize(levels.len() + array.len(), 1),
            Some(nulls) => levels.extend(nulls.iter().map(i16::from)),
        }
    }
    let levels = Some(levels.as_slice());
    match column {
        ColumnWriter::BoolColumnWriter(column) => {
            let cells = arrays.iter().flat_map(|array| array.as_boolean().iter().flatten());
            column.write_batch(&cells.collect::<Vec<bool>>(), levels, None)
        }
        ColumnWriter::Int64ColumnWriter(column) => {
            let cells =
                arrays.iter().flat_map(|array| array.as_primitive::<UInt64Type>().iter().flatten());
            column.write_batch(&cells.map(u64::cast_signed).collect::<Vec<_>>(), levels, None)
        }
        ColumnWriter::DoubleColumnWriter(column) => {
            let mut cells = Vec::new();
            for array in arrays.iter().map(|array| array.as_primitive::<Float64Type>()) {
                match array.null_count() {
                    0 => cells.extend_from_slice(array.values()),
                    _ => cells.extend(array.iter().flatten()),
                }
            }
            column.write_batch(&cells, levels, None)
        }
        ColumnWriter::ByteArrayColumnWriter(column) => {
            let mut cells: Vec<ByteArray> = Vec::new();
            for dictionary_array in arrays.iter().map(|array| array.as_dictionary::<Int32Type>()) {
                let words = dictionary_array.values().as_string::<i32>().iter();
                let words: Vec<ByteArray> =
                    words.map(|word| word.unwrap_or_default().into()).collect();
                let keys = dictionary_array.keys().iter().flatten();
                cells.extend(keys.map(|key| words[key as usize].clone()));
            }
            column.write_batch(&cells, levels, None)
        }
        _ => unreachable!("`declared` makes no others"),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow_array::{ArrayRef, Float64Array, UInt64Array};

    use super::*;

    #[test]
    fn bytes_do_not_depend_on_batches() {
        const ROW_COUNT: usize = 100_000;
        let counts: ArrayRef = Arc::new((0..ROW_COUNT as u64).map(Some).collect::<UInt64Array>());
        let number_in_row = |row: usize| (!row.is_multiple_of(7)).then_some(row as f64 / 3.0);
        let numbers: ArrayRef =
            Arc::new((0..ROW_COUNT).map(number_in_row).collect::<Float64Array>());
        let batch = RecordBatch::try_from_iter([("count", counts), ("number", numbers)]).unwrap();
        let written_bytes = |batch_rows: usize| {
            let properties = WriterProperties::builder().set_max_row_group_row_count(Some(60_000));
            let mut writer = Writer::new(Vec::new(), &batch.schema(), properties.build()).unwrap();
            for from in (0..ROW_COUNT).step_by(batch_rows) {
                writer.write(&batch.slice(from, batch_rows.min(ROW_COUNT - from))).unwrap();
            }
            writer.end().unwrap().into_inner().unwrap()
        };
        let one_batch_bytes = written_bytes(ROW_COUNT);
        for batch_rows in [1000, 4096, 33_333] {
            assert!(written_bytes(batch_rows) == one_batch_bytes, "batches of {batch_rows} rows");
        }
    }
}

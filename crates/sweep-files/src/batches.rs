//! Columns of a Parquet file as Arrow's arrays, by the Parquet library's own column readers.
//!
//! The library's reader of Arrow's arrays would compile selection and comparison of every type that
//! Arrow has. Our files have numbers, truth values and words.

use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::types::{
    ArrowPrimitiveType, Float64Type, Int32Type, Int64Type, Time64MicrosecondType,
    Time64NanosecondType, TimestampMicrosecondType, TimestampMillisecondType,
    TimestampNanosecondType, UInt64Type,
};
use arrow_array::{
    ArrayRef, BooleanArray, DictionaryArray, Int32Array, PrimitiveArray, RecordBatch,
    RecordBatchOptions, StringArray,
};
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef, TimeUnit};
use parquet::basic::{ConvertedType, LogicalType, Repetition, TimeUnit as ParquetTimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArrayType, DataType as Physical};
use parquet::errors::ParquetError;
use parquet::file::metadata::ParquetMetaData;
use parquet::file::reader::ChunkReader;
use parquet::schema::types::Type as ParquetType;
use serde_json::Value;

use crate::{key, pages};

/// Greatest number of rows in a batch; a batch has rows of one row group. Basis: a batch of a
/// hundred columns takes 3 MB. Doubling it doubles the memory.
const BATCH_ROWS: usize = 1 << 12;

/// Number of words that are decoded before their bytes are counted. Basis: a few bytes of a damaged
/// file may decode to many long words. Doubling it may double the memory.
const WORDS_AT_ONCE: usize = 32;
/// Greatest total size of a batch's distinct words, in bytes. Basis: the same damaged files.
/// Doubling it may take 2 GB.
const MAX_WORD_BYTES: usize = 1 << 30;

/// Returns the columns of a file. A column of a type that is not supported, such as a group or a
/// time, has the type [`DataType::Null`].
pub fn schema(metadata: &ParquetMetaData) -> SchemaRef {
    described_schema(metadata, |_| None)
}

/// Returns the columns of a file like [`schema`], and supports instants and times of day.
pub fn schema_with_clocks(metadata: &ParquetMetaData) -> SchemaRef {
    described_schema(metadata, clock_type)
}

fn described_schema(
    metadata: &ParquetMetaData,
    clock_type: impl Fn(&ParquetType) -> Option<DataType>,
) -> SchemaRef {
    let file_metadata = metadata.file_metadata();
    let metadata_pairs = file_metadata.key_value_metadata().into_iter().flatten();
    let descriptions = metadata_pairs
        .filter(|pair| pair.key == key::COLUMNS)
        .find_map(|pair| pair.value.as_deref());
    let descriptions: Value = descriptions
        .and_then(|descriptions| serde_json::from_str(descriptions).ok())
        .unwrap_or_default();
    let fields =
        file_metadata.schema_descr().root_schema().get_fields().iter().map(|parquet_type| {
            let descriptions = descriptions[parquet_type.name()].as_object().into_iter().flatten();
            let descriptions =
                descriptions.filter(|(key, _)| *key != "type").map(|(key, value)| {
                    (key.clone(), value.as_str().map_or_else(|| value.to_string(), str::to_owned))
                });
            let descriptions: HashMap<String, String> = descriptions.collect();
            let is_nullable = parquet_type.get_basic_info().repetition() != Repetition::REQUIRED;
            let data_type = clock_type(parquet_type).unwrap_or_else(|| data_type(parquet_type));
            Field::new(parquet_type.name(), data_type, is_nullable).with_metadata(descriptions)
        });
    Arc::new(Schema::new(fields.collect::<Vec<_>>()))
}

/// Whether values of a column of decimals have a length that is read. The library allocates a
/// batch of values of any length that a file declares.
fn has_decimal_length(parquet_type: &ParquetType) -> bool {
    let ParquetType::PrimitiveType { type_length, .. } = parquet_type else { return false };
    usize::try_from(*type_length).is_ok_and(|length| (1..=MAX_DECIMAL_BYTES).contains(&length))
}

/// Returns the type as which a column is read. Integers and floats are read as the widest type of
/// their kind.
fn data_type(parquet_type: &ParquetType) -> DataType {
    use ConvertedType as As;
    let basic_info = parquet_type.get_basic_info();
    if parquet_type.is_group() || basic_info.repetition() == Repetition::REPEATED {
        return DataType::Null;
    }
    match (parquet_type.get_physical_type(), basic_info.converted_type()) {
        (Type::FIXED_LEN_BYTE_ARRAY, As::DECIMAL) if !has_decimal_length(parquet_type) => {
            DataType::Null
        }
        (Type::BOOLEAN, _) => DataType::Boolean,
        (Type::FLOAT | Type::DOUBLE, _) => DataType::Float64,
        (Type::INT32 | Type::INT64 | Type::FIXED_LEN_BYTE_ARRAY, As::DECIMAL) => DataType::Float64,
        (_, As::INT_8 | As::INT_16 | As::INT_32 | As::INT_64) => DataType::Int64,
        (_, As::UINT_8 | As::UINT_16 | As::UINT_32 | As::UINT_64) => DataType::UInt64,
        // Times in nanoseconds have a logical type but no converted one.
        (Type::INT32 | Type::INT64, As::NONE) if basic_info.logical_type_ref().is_none() => {
            DataType::Int64
        }
        // Words are read as a dictionary, so that each distinct word takes memory once.
        (_, As::UTF8 | As::JSON) => {
            DataType::Dictionary(DataType::Int32.into(), DataType::Utf8.into())
        }
        _ => DataType::Null,
    }
}

/// Returns the type of a column of instants or of times of day in units of 64 bits. Instants are
/// read without their time zone.
fn clock_type(parquet_type: &ParquetType) -> Option<DataType> {
    let basic_info = parquet_type.get_basic_info();
    let is_single_value =
        !parquet_type.is_group() && basic_info.repetition() != Repetition::REPEATED;
    if !is_single_value || parquet_type.get_physical_type() != Type::INT64 {
        return None;
    }
    let unit = match (basic_info.logical_type_ref(), basic_info.converted_type()) {
        (Some(LogicalType::Timestamp(time) | LogicalType::Time(time)), _) => match time.unit {
            ParquetTimeUnit::MILLIS => TimeUnit::Millisecond,
            ParquetTimeUnit::MICROS => TimeUnit::Microsecond,
            ParquetTimeUnit::NANOS => TimeUnit::Nanosecond,
        },
        (None, ConvertedType::TIMESTAMP_MILLIS) => TimeUnit::Millisecond,
        (None, ConvertedType::TIMESTAMP_MICROS | ConvertedType::TIME_MICROS) => {
            TimeUnit::Microsecond
        }
        _ => return None,
    };
    let is_time_of_day = matches!(basic_info.logical_type_ref(), Some(LogicalType::Time(_)))
        || basic_info.converted_type() == ConvertedType::TIME_MICROS;
    match (is_time_of_day, unit) {
        (false, unit) => Some(DataType::Timestamp(unit, None)),
        // Times of day in milliseconds have 32 bits.
        (true, TimeUnit::Millisecond) => None,
        (true, unit) => Some(DataType::Time64(unit)),
    }
}

/// A reader of some columns of a file, batch by batch.
pub struct Batches<R> {
    reader_source: Arc<R>,
    metadata: Arc<ParquetMetaData>,
    schema: SchemaRef,
    /// The index of each column among those of a row group.
    leaf_indices: Vec<usize>,
    /// The number of decimal places of each column; `None` if it has no decimals.
    decimal_places: Vec<Option<i32>>,
    /// The next row group.
    next_group: usize,
    /// The number of rows that are still to be read of the current row group.
    remaining_rows: usize,
    column_readers: Vec<ColumnReader>,
}

impl<R: ChunkReader + 'static> Batches<R> {
    /// Opens some columns of a file, which are given by their indices in its [`schema`].
    ///
    /// # Errors
    /// Fails if the type of a column is not supported.
    pub fn new(
        reader_source: R,
        metadata: Arc<ParquetMetaData>,
        schema: &Schema,
        field_indices: Vec<usize>,
    ) -> Result<Self, ParquetError> {
        let schema = Arc::new(schema.project(&field_indices).map_err(from_arrow)?);
        if let Some(unsupported_field) =
            schema.fields().iter().find(|field| *field.data_type() == DataType::Null)
        {
            let reason =
                format!("its column `{}` is of a type that is not read", unsupported_field.name());
            return Err(ParquetError::General(reason));
        }
        let schema_descriptor = metadata.file_metadata().schema_descr();
        let mut leaf_indices = vec![0; schema_descriptor.root_schema().get_fields().len()];
        (0..schema_descriptor.num_columns())
            .for_each(|leaf| leaf_indices[schema_descriptor.get_column_root_idx(leaf)] = leaf);
        let leaf_indices: Vec<usize> =
            field_indices.into_iter().map(|field_index| leaf_indices[field_index]).collect();
        let decimal_scale = |leaf: &usize| {
            let column = schema_descriptor.column(*leaf);
            (column.converted_type() == ConvertedType::DECIMAL).then(|| column.type_scale())
        };
        let decimal_places = leaf_indices.iter().map(decimal_scale).collect();
        Ok(Self {
            reader_source: Arc::new(reader_source),
            metadata,
            schema,
            leaf_indices,
            decimal_places,
            next_group: 0,
            remaining_rows: 0,
            column_readers: Vec::new(),
        })
    }

    /// Reads the next rows; `None` after the last.
    ///
    /// # Errors
    /// Fails if the file is damaged.
    pub fn read_batch(&mut self) -> Result<Option<RecordBatch>, ParquetError> {
        while self.remaining_rows == 0 {
            let Some(row_group) = self.metadata.row_groups().get(self.next_group) else {
                return Ok(None);
            };
            self.next_group += 1;
            self.remaining_rows = usize::try_from(row_group.num_rows())?;
            // The pages of the last row group are freed before others are read.
            self.column_readers.clear();
            let byte_budget = pages::new_budget();
            let open_column = |leaf: &usize| {
                pages::open_pages(
                    &self.reader_source,
                    row_group.column(*leaf),
                    self.remaining_rows,
                    &byte_budget,
                )
            };
            self.column_readers =
                self.leaf_indices.iter().map(open_column).collect::<Result<_, ParquetError>>()?;
        }
        let batch_rows = self.remaining_rows.min(BATCH_ROWS);
        self.remaining_rows -= batch_rows;
        let column_readers = self.column_readers.iter_mut().zip(self.schema.fields());
        let arrays =
            column_readers.zip(&self.decimal_places).map(|((column, field), scale)| match scale {
                Some(scale) => read_decimals(column, *scale, batch_rows),
                None => read_array(column, field.data_type(), batch_rows),
            });
        let arrays = arrays.collect::<Result<Vec<_>, _>>()?;
        // The number of rows is given because there may be no column.
        let batch_options = RecordBatchOptions::new().with_row_count(Some(batch_rows));
        let batch =
            RecordBatch::try_new_with_options(Arc::clone(&self.schema), arrays, &batch_options);
        batch.map(Some).map_err(from_arrow)
    }
}

/// Wraps an error of Arrow as one of the Parquet library.
pub fn from_arrow(error: ArrowError) -> ParquetError {
    ParquetError::External(Box::new(error))
}

fn read_array(
    column: &mut ColumnReader,
    data_type: &DataType,
    rows: usize,
) -> Result<ArrayRef, ParquetError> {
    use ColumnReader as Reader;
    let is_unsigned = *data_type == DataType::UInt64;
    match column {
        Reader::BoolColumnReader(column) => {
            Ok(Arc::new(cells_by_level(read_values(column, rows)?).collect::<BooleanArray>()))
        }
        Reader::Int32ColumnReader(column) if is_unsigned => {
            read_numbers::<_, UInt64Type>(column, rows, |cell| cell.cast_unsigned().into())
        }
        Reader::Int32ColumnReader(column) => read_numbers::<_, Int64Type>(column, rows, i64::from),
        Reader::Int64ColumnReader(column) if is_unsigned => {
            read_numbers::<_, UInt64Type>(column, rows, |cell| cell.cast_unsigned())
        }
        Reader::Int64ColumnReader(column) => read_integers(column, data_type, rows),
        Reader::FloatColumnReader(column) => {
            read_numbers::<_, Float64Type>(column, rows, f64::from)
        }
        Reader::DoubleColumnReader(column) => {
            read_numbers::<_, Float64Type>(column, rows, |cell| cell)
        }
        Reader::ByteArrayColumnReader(column) => read_words(column, rows),
        _ => unreachable!("`data_type` has no other types"),
    }
}

/// Reads the next values of a column, and a level for each row: 1 if it has a value, else 0.
fn read_values<T: Physical>(
    column: &mut ColumnReaderImpl<T>,
    rows: usize,
) -> Result<(Vec<i16>, Vec<T::T>), ParquetError> {
    let mut levels = Vec::new();
    let mut values = Vec::new();
    let (values_read, ..) = column.read_records(rows, Some(&mut levels), None, &mut values)?;
    if values_read != rows {
        return Err(ParquetError::General("a column has fewer rows than it should".to_owned()));
    }
    // The library gives no levels for a column without nulls.
    levels.resize(rows, 1);
    Ok((levels, values))
}

/// Returns the value of each row, if it has one.
fn cells_by_level<T>((levels, values): (Vec<i16>, Vec<T>)) -> impl Iterator<Item = Option<T>> {
    let mut values = values.into_iter();
    levels.into_iter().map(move |level| if level == 1 { values.next() } else { None })
}

/// Reads integers as numbers, instants or times of day.
fn read_integers(
    column: &mut ColumnReaderImpl<parquet::data_type::Int64Type>,
    data_type: &DataType,
    rows: usize,
) -> Result<ArrayRef, ParquetError> {
    macro_rules! read_as {
        ($type:ty) => {
            read_numbers::<_, $type>(column, rows, |cell| cell)
        };
    }
    match data_type {
        DataType::Timestamp(TimeUnit::Millisecond, _) => read_as!(TimestampMillisecondType),
        DataType::Timestamp(TimeUnit::Microsecond, _) => read_as!(TimestampMicrosecondType),
        DataType::Timestamp(TimeUnit::Nanosecond, _) => read_as!(TimestampNanosecondType),
        DataType::Time64(TimeUnit::Microsecond) => read_as!(Time64MicrosecondType),
        DataType::Time64(TimeUnit::Nanosecond) => read_as!(Time64NanosecondType),
        _ => read_as!(Int64Type),
    }
}

fn read_numbers<T: Physical, A: ArrowPrimitiveType>(
    column: &mut ColumnReaderImpl<T>,
    rows: usize,
    convert: impl Fn(T::T) -> A::Native,
) -> Result<ArrayRef, ParquetError> {
    let (levels, converted_values) = read_values(column, rows)?;
    let converted_values: Vec<A::Native> = converted_values.into_iter().map(convert).collect();
    Ok(Arc::new(if converted_values.len() == rows {
        PrimitiveArray::<A>::new(converted_values.into(), None)
    } else {
        cells_by_level((levels, converted_values)).collect()
    }))
}

/// Greatest size of a decimal that is read, in bytes. Basis: 38 digits, which is the most that
/// other programs write. Doubling it needs wider integers than i128.
const MAX_DECIMAL_BYTES: usize = 16;

/// Reads decimals as numbers. They are stored as whole numbers, in units of the last of `scale`
/// decimal places.
fn read_decimals(
    column: &mut ColumnReader,
    scale: i32,
    rows: usize,
) -> Result<ArrayRef, ParquetError> {
    let scale_factor = 10_f64.powi(scale);
    match column {
        ColumnReader::Int32ColumnReader(column) => {
            read_numbers::<_, Float64Type>(column, rows, |cell| f64::from(cell) / scale_factor)
        }
        ColumnReader::Int64ColumnReader(column) => {
            read_numbers::<_, Float64Type>(column, rows, |cell| cell as f64 / scale_factor)
        }
        ColumnReader::FixedLenByteArrayColumnReader(column) => {
            read_numbers::<_, Float64Type>(column, rows, |cell| {
                big_endian_integer(cell.data()) as f64 / scale_factor
            })
        }
        _ => Err(ParquetError::General("a column of decimals holds something else".to_owned())),
    }
}

/// Returns the integer that big-endian bytes in two's complement stand for.
fn big_endian_integer(bytes: &[u8]) -> i128 {
    let is_negative = bytes.first().is_some_and(|first| *first >= 0x80);
    let sign_extension: i128 = if is_negative { -1 } else { 0 };
    bytes.iter().fold(sign_extension, |sum, byte| (sum << 8) | i128::from(*byte))
}

fn read_words(
    column: &mut ColumnReaderImpl<ByteArrayType>,
    rows: usize,
) -> Result<ArrayRef, ParquetError> {
    let mut distinct_words = Vec::<String>::new();
    let mut word_bytes = 0;
    // A word's code by its address in a page's dictionary, which has each word once. Another page
    // may have another word at the same address, so that the words are compared too.
    let mut codes = HashMap::new();
    let mut keys = Vec::with_capacity(rows);
    while keys.len() < rows {
        // Neighbouring rows mostly have the same word: `last_word` spares the look-up.
        let mut last_word = (("".as_ptr(), usize::MAX), 0);
        for word in cells_by_level(read_values(column, WORDS_AT_ONCE.min(rows - keys.len()))?) {
            let Some(word) = word else {
                keys.push(None);
                continue;
            };
            let address = (word.data().as_ptr(), word.len());
            if address != last_word.0 {
                let known_code = codes.get(&address).copied();
                let known_code = known_code
                    .filter(|code| distinct_words[*code as usize].as_bytes() == word.data());
                let code = known_code.unwrap_or(distinct_words.len() as i32);
                if known_code.is_none() {
                    word_bytes += word.len();
                    distinct_words.push(word.as_utf8()?.to_owned());
                    codes.insert(address, code);
                }
                last_word = (address, code);
            }
            keys.push(Some(last_word.1));
        }
        if word_bytes > MAX_WORD_BYTES {
            return Err(ParquetError::General("its words are too long".to_owned()));
        }
    }
    let distinct_words = Arc::new(StringArray::from(distinct_words));
    let dictionary = DictionaryArray::<Int32Type>::try_new(Int32Array::from(keys), distinct_words);
    Ok(Arc::new(dictionary.map_err(from_arrow)?))
}

//! Parquet files of numbers.

use std::sync::Arc;

use arrow_schema::DataType;
use bytes::Bytes;
use parquet::basic::Compression;
use parquet::errors::ParquetError;
use parquet::file::metadata::ParquetMetaData;

use sweep_files::batches::{self, Batches};
use sweep_files::{cells, footer, panics};

use super::super::section::shorten;
use super::names::{ColumnNames, KnownName};
use super::units::UnitScale;
use super::{ListError, TIME_COLUMN, check_size, is_index_column};

/// The compressions that are read, for a message.
const READABLE_CODECS: &str = "snappy, zstd, gzip, lz4_raw or none";

/// A column of a file.
#[derive(Debug, PartialEq)]
pub(super) struct ParquetColumn {
    /// The name of the quantity, or the name in the file if it is not known.
    pub(super) name: String,
    /// The name in the file.
    pub(super) header: String,
    /// The numbers, if the column is known.
    pub(super) values: Option<Vec<f64>>,
    /// Whether the numbers are times of a clock (s).
    pub(super) is_clock: bool,
}

/// Returns the columns of a file without its index. If `allows_missing` is true, a null is NaN.
pub(super) fn read_columns(
    bytes: Vec<u8>,
    allows_missing: bool,
    names: &ColumnNames<'_>,
) -> Result<Vec<ParquetColumn>, ListError> {
    let damage_by_panic = |panic| Err(format!("it is damaged: it makes no sense inside: {panic}"));
    panics::catch_panic(|| read_columns_unguarded(bytes.into(), allows_missing, names))
        .unwrap_or_else(damage_by_panic)
}

fn read_columns_unguarded(
    bytes: Bytes,
    allows_missing: bool,
    names: &ColumnNames<'_>,
) -> Result<Vec<ParquetColumn>, ListError> {
    let metadata = footer::read_metadata(&bytes).map_err(damage_error)?;
    let schema = batches::schema_with_clocks(&metadata);
    let fields = schema.fields();
    check_size(0, fields.len())?;
    let mut columns: Vec<ParquetColumn> = Vec::new();
    let mut known_columns: Vec<(usize, usize, UnitScale)> = Vec::new();
    for (column_index, field) in fields.iter().enumerate() {
        let header = field.name().clone();
        let known_name = names.find_known_name(&header, None);
        match known_name.map_err(|[title, expected]| format!("{title}: {expected}"))? {
            Some(KnownName { name, unit_scale: scale }) => {
                let is_clock = name == TIME_COLUMN && cells::is_clock(field.data_type());
                if !cells::is_number(field.data_type()) && !is_clock {
                    return Err(no_numbers_error(&header, field.data_type()));
                }
                let scale = if is_clock { UnitScale::IDENTITY } else { scale };
                known_columns.push((columns.len(), column_index, scale));
                columns.push(ParquetColumn { name, header, values: Some(Vec::new()), is_clock });
            }
            None if is_index_column(&header) => {}
            None => {
                let name = header.clone();
                columns.push(ParquetColumn { name, header, values: None, is_clock: false });
            }
        }
    }
    check_row_groups(&metadata, fields.len())?;
    let mut row_count = 0;
    let fields = known_columns.iter().map(|(_, column_index, _)| *column_index).collect();
    let reader = Batches::new(bytes, Arc::new(metadata), &schema, fields);
    let mut reader = reader.map_err(damage_error)?;
    while let Some(batch) = reader.read_batch().map_err(damage_error)? {
        check_size((row_count + batch.num_rows()) as u64, known_columns.len())?;
        for ((column, _, scale), array) in known_columns.iter().zip(batch.columns()) {
            let ParquetColumn { header, values: Some(values), is_clock, .. } =
                &mut columns[*column]
            else {
                continue;
            };
            let numbers =
                if *is_clock { cells::clock_seconds(array) } else { cells::numbers(array) };
            let numbers = numbers.map_err(|error| error.to_string())?;
            for (k, value) in numbers.into_iter().enumerate() {
                let row = row_count + k + 1;
                let null_error =
                    || format!("its column `{}` has no value in row {row}", shorten(header));
                let value = if allows_missing { value.or(Some(f64::NAN)) } else { value };
                values.push(scale.apply(value.ok_or_else(null_error)?));
            }
        }
        row_count += batch.num_rows();
    }
    Ok(columns)
}

/// Returns the mistake of a column without numbers.
fn no_numbers_error(header: &str, data_type: &DataType) -> ListError {
    let cell_kind = match data_type {
        DataType::Boolean => "true and false",
        text if cells::is_text(text) => "text",
        _ => "dates, times, lists or bytes",
    };
    format!("its column `{}` holds no numbers but {cell_kind}", shorten(header))
}

/// Rejects a file of too many rows, or of an unknown compression, before its pages are read.
fn check_row_groups(metadata: &ParquetMetaData, columns: usize) -> Result<(), ListError> {
    let mut row_count = 0_u64;
    for row_group in metadata.row_groups() {
        row_count =
            row_count.saturating_add(u64::try_from(row_group.num_rows()).unwrap_or(u64::MAX));
        check_size(row_count, columns)?;
        for column in row_group.columns() {
            let codec = column.compression();
            // The parquet library has these codecs only with features that the workspace's
            // Cargo.toml leaves out.
            if matches!(codec, Compression::BROTLI(_) | Compression::LZ4 | Compression::LZO) {
                let name = shorten(&column.column_path().string());
                // The level in brackets does not matter to the user.
                let codec = codec.to_string();
                let codec = codec.split('(').next().unwrap_or_default().to_lowercase();
                return Err(format!(
                    "its column `{name}` is compressed by {codec}, which this program does not \
                     read: write it with {READABLE_CODECS}"
                ));
            }
        }
    }
    Ok(())
}

fn damage_error(error: ParquetError) -> ListError {
    let text = error.to_string();
    let reason = text.strip_prefix("Parquet error: ").unwrap_or(&text);
    format!("it is damaged: {}", reason.trim())
}

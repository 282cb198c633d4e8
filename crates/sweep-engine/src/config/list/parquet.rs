//! Parquet files of numbers. The library trusts a file's own account of its sizes, so that is
//! checked first.

use std::io::Cursor;
use std::sync::Arc;

use arrow_schema::DataType;
use bytes::Bytes;
use parquet::basic::Compression;
use parquet::errors::ParquetError;
use parquet::file::metadata::{ParquetMetaData, ParquetMetaDataReader};

use sweep_files::batches::{self, Batches};
use sweep_files::pages::{self, Unpacked};
use sweep_files::{Refused, cells, footer, panics};

use super::super::section::short;
use super::{LONGEST_BYTES, Unreadable, fits};

/// How a list may be compressed, for a message.
const READABLE_CODECS: &str = "snappy, zstd, gzip, lz4_raw or none";

/// Names and values of the columns. With `gaps`, a null is NaN.
pub(super) fn columns(bytes: Vec<u8>, gaps: bool) -> Result<Vec<(String, Vec<f64>)>, Unreadable> {
    let panicked = |panic| Err(format!("it is damaged: it makes no sense inside: {panic}"));
    panics::caught(|| read(bytes.into(), gaps)).unwrap_or_else(panicked)
}

fn read(bytes: Bytes, gaps: bool) -> Result<Vec<(String, Vec<f64>)>, Unreadable> {
    footer::check(&mut Cursor::new(&bytes)).map_err(refused)?;
    let metadata = ParquetMetaDataReader::new().parse_and_finish(&bytes).map_err(damaged)?;
    let schema = batches::schema(&metadata);
    let fields = schema.fields();
    fits(0, fields.len())?;
    if let Some(field) = fields.iter().find(|field| !cells::is_number(field.data_type())) {
        let found = match field.data_type() {
            DataType::Boolean => "true and false",
            text if cells::is_text(text) => "text",
            _ => "dates, times, lists or bytes",
        };
        return Err(format!("its column `{}` holds no numbers but {found}", short(field.name())));
    }
    check_sizes(&metadata, &bytes, fields.len())?;
    let mut columns: Vec<(String, Vec<f64>)> =
        fields.iter().map(|field| (field.name().clone(), Vec::new())).collect();
    let mut rows = 0;
    let all = (0..fields.len()).collect();
    let reader = Batches::new(bytes, Arc::new(metadata), &schema, all);
    let mut reader = reader.map_err(damaged)?;
    while let Some(batch) = reader.batch().map_err(damaged)? {
        fits((rows + batch.num_rows()) as u64, columns.len())?;
        for ((name, values), array) in columns.iter_mut().zip(batch.columns()) {
            let numbers = cells::numbers(array).map_err(|error| error.to_string())?;
            for (k, value) in numbers.into_iter().enumerate() {
                let row = rows + k + 1;
                let no_value = || format!("its column `{}` has no value in row {row}", short(name));
                let value = if gaps { value.or(Some(f64::NAN)) } else { value };
                values.push(value.ok_or_else(no_value)?);
            }
        }
        rows += batch.num_rows();
    }
    Ok(columns)
}

/// Refuses what could not be held, or not be unpacked, before any of it is.
fn check_sizes(metadata: &ParquetMetaData, bytes: &[u8], columns: usize) -> Result<(), Unreadable> {
    let (mut rows, mut unpacked) = (0_u64, 0_u64);
    for group in metadata.row_groups() {
        rows = rows.saturating_add(u64::try_from(group.num_rows()).unwrap_or(u64::MAX));
        fits(rows, columns)?;
        for column in group.columns() {
            let codec = column.compression();
            // What the features of `parquet` in the workspace's Cargo.toml are not for.
            if matches!(codec, Compression::BROTLI(_) | Compression::LZ4 | Compression::LZO) {
                let name = short(&column.column_path().string());
                // Its level, in brackets, is nothing to a reader.
                let codec = codec.to_string();
                let codec = codec.split('(').next().unwrap_or_default().to_lowercase();
                return Err(format!(
                    "its column `{name}` is compressed by {codec}, which this program does not \
                     read: write it with {READABLE_CODECS}"
                ));
            }
            let (start, length) = column.byte_range();
            if start.checked_add(length).is_none_or(|end| end > bytes.len() as u64) {
                return Err("it is damaged: a column lies outside of it".to_owned());
            }
            let left = LONGEST_BYTES - unpacked;
            let most = Unpacked { total: left, at_once: left };
            let sizes = pages::unpacked(&mut Cursor::new(bytes), start, length, codec, most);
            unpacked += sizes.map_err(refused)?.total;
        }
    }
    Ok(())
}

fn refused(refused: Refused) -> Unreadable {
    match refused {
        Refused::Io(error) => error.to_string(),
        Refused::TooLong => format!("unpacked, it is longer than {} MiB", LONGEST_BYTES >> 20),
        refused => format!("it is damaged: {refused}"),
    }
}

fn damaged(error: ParquetError) -> Unreadable {
    let text = error.to_string();
    let reason = text.strip_prefix("Parquet error: ").unwrap_or(&text);
    format!("it is damaged: {}", reason.trim())
}

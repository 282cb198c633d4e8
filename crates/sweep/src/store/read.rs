//! Reading Parquet files back: whose plan a result is of, what it holds, what any file's columns range over.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::ErrorKind;
use std::path::Path;

use arrow_array::cast::AsArray;
use arrow_array::types::UInt64Type;
use arrow_array::{Array, RecordBatch};
use arrow_schema::{ArrowError, DataType};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};
use parquet::errors::ParquetError;
use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};
use serde_json::Value;

use super::error::StoreError;
use super::schema::key;
use crate::cells;
use crate::verdict::ROW_STATUSES;

/// A finished result's own word about itself.
#[derive(Clone, Debug, PartialEq)]
pub struct ResultFile {
    /// Grid as run, full machine, method.
    pub plan: Value,
    /// Hash over version and plan, hexadecimal.
    pub plan_hash: String,
    /// Version of the program that made it.
    pub version: String,
    /// Rows.
    pub points: u64,
}

/// What stands where a result may be.
pub(crate) enum Finished {
    Absent,
    Result(Box<ResultFile>),
    /// Not a result of a sweep, and why.
    Foreign(String),
}

/// Looks at an output's metadata alone.
pub(crate) fn finished(path: &Path) -> Result<Finished, StoreError> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Finished::Absent),
        Err(error) => return Err(StoreError::io("open", path)(error)),
    };
    let reader = match ParquetRecordBatchReaderBuilder::try_new(file) {
        Ok(reader) => reader,
        Err(error) => return Ok(Finished::Foreign(error.to_string())),
    };
    Ok(match own_word(&reader) {
        Some(result) => Finished::Result(Box::new(result)),
        None if has_points(&reader) => {
            Finished::Foreign(format!("it has no `{}` in its metadata", key::PLAN))
        }
        None => Finished::Foreign("it has no column `point`, as the result of a run has".into()),
    })
}

/// Other files of this program carry the plan too: a boundary's rows are not points.
fn has_points(reader: &ParquetRecordBatchReaderBuilder<File>) -> bool {
    reader.schema().column_with_name("point").is_some()
}

fn own_word(reader: &ParquetRecordBatchReaderBuilder<File>) -> Option<ResultFile> {
    if !has_points(reader) {
        return None;
    }
    let plan = metadata(reader, key::PLAN)?;
    Some(ResultFile {
        plan: serde_json::from_str(&plan).ok()?,
        plan_hash: metadata(reader, key::PLAN_HASH)?,
        version: metadata(reader, key::VERSION)?,
        points: u64::try_from(reader.metadata().file_metadata().num_rows()).ok()?,
    })
}

fn metadata(reader: &ParquetRecordBatchReaderBuilder<File>, key: &str) -> Option<String> {
    let pairs = reader.metadata().file_metadata().key_value_metadata()?;
    pairs.iter().find(|pair| pair.key == key)?.value.clone()
}

/// A value that stands out, and where.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Extreme {
    /// The value.
    pub value: f64,
    /// Point index.
    pub point: u64,
}

/// What a result holds, counted.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Tally {
    /// Rows.
    pub points: u64,
    /// Rows by status.
    pub by_status: StatusCounts,
    /// Rows whose ratio is below the limit.
    pub reliable: u64,
    /// Rows whose ratio is at or above the limit.
    pub unreliable: u64,
    /// Rows without a verdict: a model failed, or nothing moves.
    pub undefined: u64,
    /// Rows known to be chaotic: plain RK4 does not agree with itself.
    pub sensitive: u64,
    /// Rows by the method that their numbers come from, where the file says so.
    pub by_method: BTreeMap<String, u64>,
    /// The greatest error left in a row that is not sensitive.
    pub greatest_error: Option<Extreme>,
    /// The greatest ratio.
    pub greatest_ratio: Option<Extreme>,
    /// The least gap of the nonlinear model, m.
    pub least_gap_nonlinear_m: Option<Extreme>,
}

/// Rows by status, in the order of [`ROW_STATUSES`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StatusCounts([u64; ROW_STATUSES.len()]);

impl StatusCounts {
    /// The statuses that occur, and how often.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, u64)> + '_ {
        ROW_STATUSES.into_iter().zip(self.0).filter(|(_, count)| *count > 0)
    }

    /// Rows whose status is not `ok`.
    #[must_use]
    pub fn failed(&self) -> u64 {
        self.0[1..].iter().sum()
    }

    pub(crate) fn add(&mut self, status: usize) {
        if let Some(count) = self.0.get_mut(status) {
            *count += 1;
        }
    }
}

impl Serialize for StatusCounts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (name, count) in self.iter() {
            map.serialize_entry(name, &count)?;
        }
        map.end()
    }
}

/// Counts a result file's rows, in bounded memory.
///
/// # Errors
/// [`StoreError::Io`] and [`StoreError::Parquet`], the latter also for a file that lacks a result's columns.
pub fn tally(path: &Path) -> Result<Tally, StoreError> {
    const COLUMNS: [&str; 8] =
        ["point", "status", "reliable", "sensitive", "method", "error", "ratio_max", "min_gap_nonlinear_m"];
    let failed = |error| StoreError::parquet("read", path)(error);
    let builder = builder(path)?;
    let mask = ProjectionMask::columns(builder.parquet_schema(), COLUMNS);
    let reader = builder.with_projection(mask).build().map_err(failed)?;
    let mut tally = Tally::default();
    for batch in reader {
        let batch = batch.map_err(|error| failed(error.into()))?;
        count(&batch, &mut tally).map_err(failed)?;
    }
    Ok(tally)
}

fn count(batch: &RecordBatch, tally: &mut Tally) -> Result<(), ParquetError> {
    let column = |name: &str| {
        batch
            .column_by_name(name)
            .ok_or_else(|| ParquetError::General(format!("there is no column `{name}`")))
    };
    let points = column("point")?;
    let points = points
        .as_primitive_opt::<UInt64Type>()
        .ok_or_else(|| ParquetError::General(format!("column `point` is of type {}", points.data_type())))?;
    for name in cells::texts(column("status")?)?.into_iter().flatten() {
        if let Some(status) = ROW_STATUSES.iter().position(|status| *status == name) {
            tally.by_status.add(status);
        }
    }
    for reliable in cells::flags(column("reliable")?)? {
        match reliable {
            Some(true) => tally.reliable += 1,
            Some(false) => tally.unreliable += 1,
            None => tally.undefined += 1,
        }
    }
    let sensitive = cells::flags(column("sensitive")?)?;
    tally.sensitive += sensitive.true_count() as u64;
    for name in cells::texts(column("method")?)?.into_iter().flatten() {
        *tally.by_method.entry(name.to_owned()).or_default() += 1;
    }
    let errors = cells::numbers(column("error")?)?.into_iter().zip(sensitive.iter()).zip(points);
    for ((error, sensitive), point) in errors {
        if let (Some(value), Some(point)) = (error, point)
            && sensitive != Some(true)
            && tally.greatest_error.as_ref().is_none_or(|greatest| value > greatest.value)
        {
            tally.greatest_error = Some(Extreme { value, point });
        }
    }
    let extreme = |name: &str, best: &mut Option<Extreme>, better: fn(f64, f64) -> bool| {
        for (value, point) in cells::numbers(column(name)?)?.into_iter().zip(points) {
            if let (Some(value), Some(point)) = (value, point)
                && best.as_ref().is_none_or(|best| better(value, best.value))
            {
                *best = Some(Extreme { value, point });
            }
        }
        Ok::<(), ParquetError>(())
    };
    extreme("ratio_max", &mut tally.greatest_ratio, |a, b| a > b)?;
    extreme("min_gap_nonlinear_m", &mut tally.least_gap_nonlinear_m, |a, b| a < b)?;
    tally.points += batch.num_rows() as u64;
    Ok(())
}

/// What one column of any file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnRange {
    /// Name.
    pub name: String,
    /// Unit from the field's metadata, if it carries one.
    pub unit: Option<String>,
    /// Rows without a value.
    pub nulls: u64,
    /// Least and greatest value of a numeric column that has any.
    pub range: Option<(f64, f64)>,
    /// How often each value of a text or bool column occurs; the first `NAMES_SHOWN` to appear.
    pub names: Vec<(String, u64)>,
}

/// A text column of more different values is not a list of names.
const NAMES_SHOWN: usize = 16;

/// What any Parquet file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Overview {
    /// Its own word, if it is a result of a sweep.
    pub result: Option<ResultFile>,
    /// Rows.
    pub rows: u64,
    /// Columns in order.
    pub columns: Vec<ColumnRange>,
    /// The program that wrote it.
    pub created_by: Option<String>,
}

/// Reads through a file, in bounded memory.
///
/// # Errors
/// [`StoreError::Io`] and [`StoreError::Parquet`].
pub fn overview(path: &Path) -> Result<Overview, StoreError> {
    let failed = |error| StoreError::parquet("read", path)(error);
    let builder = builder(path)?;
    let file = builder.metadata().file_metadata();
    let (created_by, rows) =
        (file.created_by().map(str::to_owned), u64::try_from(file.num_rows()).unwrap_or(0));
    let result = own_word(&builder);
    let new = |field: &std::sync::Arc<arrow_schema::Field>| ColumnRange {
        name: field.name().clone(),
        unit: field.metadata().get("unit").cloned().filter(|unit| !unit.is_empty()),
        nulls: 0,
        range: None,
        names: Vec::new(),
    };
    let mut columns: Vec<ColumnRange> = builder.schema().fields().iter().map(new).collect();
    let reader: ParquetRecordBatchReader = builder.build().map_err(failed)?;
    for batch in reader {
        let batch = batch.map_err(|error| failed(error.into()))?;
        for (column, array) in columns.iter_mut().zip(batch.columns()) {
            column.widen(array).map_err(|error| failed(error.into()))?;
        }
    }
    Ok(Overview { result, rows, columns, created_by })
}

impl ColumnRange {
    /// Takes in more rows. Of types that none of our files has, only the nulls are counted.
    fn widen(&mut self, array: &dyn Array) -> Result<(), ArrowError> {
        self.nulls += array.null_count() as u64;
        match array.data_type() {
            DataType::Boolean => {
                for flag in cells::flags(array)?.iter().flatten() {
                    self.count(if flag { "true" } else { "false" });
                }
            }
            text if cells::is_text(text) => {
                cells::texts(array)?.into_iter().flatten().for_each(|name| self.count(name));
            }
            number if cells::is_number(number) => {
                for value in cells::numbers(array)?.into_iter().flatten() {
                    let (least, greatest) = self.range.unwrap_or((value, value));
                    self.range = Some((least.min(value), greatest.max(value)));
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn count(&mut self, name: &str) {
        if let Some((_, count)) = self.names.iter_mut().find(|(known, _)| known == name) {
            *count += 1;
        } else if self.names.len() < NAMES_SHOWN {
            self.names.push((name.to_owned(), 1));
        }
    }
}

/// Numeric columns of one row, counted from 0.
///
/// # Errors
/// [`StoreError::Io`] and [`StoreError::Parquet`], the latter also for a row or column that is not there.
pub fn row(path: &Path, row: u64, columns: &[&str]) -> Result<Vec<f64>, StoreError> {
    let failed = |error| StoreError::parquet("read", path)(error);
    let absent = || ParquetError::General(format!("there is no row {row} with all of {columns:?}"));
    let builder = builder(path)?;
    let mask = ProjectionMask::columns(builder.parquet_schema(), columns.iter().copied());
    let reader =
        builder.with_projection(mask).with_offset(usize::try_from(row).unwrap_or(usize::MAX)).with_limit(1);
    let batch = reader.build().map_err(failed)?.next().ok_or_else(absent).map_err(failed)?;
    let batch = batch.map_err(|error| failed(error.into()))?;
    let value = |name: &&str| {
        let column = batch.column_by_name(name).ok_or_else(absent)?;
        cells::numbers(column)?.first().copied().flatten().ok_or_else(absent)
    };
    columns.iter().map(value).collect::<Result<_, _>>().map_err(failed)
}

fn builder(path: &Path) -> Result<ParquetRecordBatchReaderBuilder<File>, StoreError> {
    let file = File::open(path).map_err(StoreError::io("open", path))?;
    ParquetRecordBatchReaderBuilder::try_new(file).map_err(StoreError::parquet("read", path))
}

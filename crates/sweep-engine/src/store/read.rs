//! Reading of Parquet files: a result's plan, counts of its rows, and the ranges of the columns of
//! any file.

use std::collections::BTreeMap;

use parquet::errors::ParquetError;
use serde::Serialize;
use serde_json::Value;

use super::error::StoreError;
use sweep_files::{Column, ColumnMetadata, FileKind, ParquetFile, columns, key};
use sweep_parameter::{RatioLimits, Worse};
use sweep_results::ratio_limits;

/// The metadata of a result.
#[derive(Clone, Debug, PartialEq)]
pub struct ResultFile {
    /// The grid with all options applied, the full machine, and the method.
    pub plan: Value,
    /// The hash of version, numerics and plan, hexadecimal.
    pub plan_hash: String,
    /// The version of the program that made the result.
    pub version: String,
    /// The version of the numerics; 0 for files of builds that did not record it.
    pub numerics: u32,
    /// The number of rows.
    pub points: u64,
}

impl ResultFile {
    /// Reads the metadata of a file; `None` if the file is not of this kind or lacks an entry.
    pub fn read(file: &ParquetFile, kind: FileKind<'_>) -> Option<Self> {
        // Files of other kinds, such as boundaries, have a plan too, but their rows are not points.
        if file.kind() != Some(kind) {
            return None;
        }
        let numerics = file.value(key::NUMERICS).and_then(|numerics| numerics.parse().ok());
        Some(Self {
            plan: file.json(key::PLAN)?,
            plan_hash: file.value(key::PLAN_HASH)?.to_owned(),
            version: file.value(key::VERSION)?.to_owned(),
            numerics: numerics.unwrap_or(0),
            points: file.rows(),
        })
    }
}

/// Returns the error about a file with other content than expected.
pub(super) fn content_error(file: &ParquetFile, reason: String) -> StoreError {
    StoreError::parquet("read", file.path())(ParquetError::General(reason))
}

/// An extreme value and its point.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Extreme {
    /// The value.
    pub value: f64,
    /// The index of the point.
    pub point: u64,
}

/// The worst value of a column, and the number of rows beyond its limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColumnExtreme {
    /// The name of the column.
    pub column: String,
    /// The direction in which values are worse.
    #[serde(skip)]
    pub worse: Worse,
    /// The limit between good and bad values, if the column has one.
    pub limit: Option<f64>,
    /// The number of rows that are worse than the limit.
    #[serde(rename = "beyond")]
    pub rows_beyond_limit: u64,
    /// The worst value and its point; `None` if no row has a value.
    #[serde(flatten)]
    pub worst_value: Option<Extreme>,
}

impl ColumnExtreme {
    /// Creates the extreme of a column without rows; `None` for a column that is not in summaries.
    fn new(column: &Column) -> Option<Self> {
        let ColumnMetadata { worse, limit, is_in_summary, .. } = column.metadata;
        let worse = worse.filter(|_| is_in_summary)?;
        let name = column.name.clone();
        Some(Self { column: name, worse, limit, rows_beyond_limit: 0, worst_value: None })
    }

    /// Adds the value at a point.
    fn add(&mut self, value: f64, point: u64) {
        let is_worse = |reference: f64| self.worse.excess(value, reference) > 0.0;
        self.rows_beyond_limit += u64::from(self.limit.is_some_and(is_worse));
        if !value.is_nan() && self.worst_value.as_ref().is_none_or(|worst| is_worse(worst.value)) {
            self.worst_value = Some(Extreme { value, point });
        }
    }
}

/// The counts and extremes of a result's rows.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Tally {
    /// The number of rows.
    pub points: u64,
    /// The number of rows of each status.
    pub by_status: NameCounts,
    /// The number of rows whose verdict is reliable.
    pub reliable: u64,
    /// The number of rows whose verdict is not reliable.
    pub unreliable: u64,
    /// The number of rows without a verdict, because no ratio is defined.
    pub undefined: u64,
    /// The number of rows without a verdict in which no model failed.
    pub undefined_without_failure: u64,
    /// The first point without a verdict at which no model failed.
    pub first_undefined_without_failure: Option<u64>,
    /// The condition under which a ratio is null, as the description of its column ends.
    #[serde(skip)]
    pub undefined_condition: Option<String>,
    /// The number of rows in which the linear model over-estimates: a ratio is below `ratio_min`
    /// or, if that is not given, below 1 / `ratio_limit`.
    pub over_estimated: u64,
    /// The number of over-estimated rows that are reliable.
    pub over_estimated_reliable: u64,
    /// The number of rows whose motion is known to be chaotic.
    pub sensitive: u64,
    /// The number of rows whose error exceeds the requested accuracy.
    pub unconverged: u64,
    /// The number of rows of each method, if the file has that column.
    pub by_method: NameCounts,
    /// The greatest estimated error of a row.
    pub greatest_error: Option<Extreme>,
    /// The greatest ratio.
    pub greatest_ratio: Option<Extreme>,
    /// The worst values of the columns that are marked for summaries.
    pub extremes: Vec<ColumnExtreme>,
    /// The first point of each status except `ok`.
    pub first_failed: BTreeMap<String, u64>,
}

/// The number of occurrences of each name.
pub type NameCounts = BTreeMap<String, u64>;

/// Returns the number of rows of each status except `ok`.
pub fn failure_counts(by_status: &NameCounts) -> impl Iterator<Item = (&String, &u64)> {
    by_status.iter().filter(|(status, _)| *status != "ok")
}

/// Returns the number of rows whose status is not `ok`.
pub fn count_failed(by_status: &NameCounts) -> u64 {
    failure_counts(by_status).map(|(_, count)| count).sum()
}

/// Adds one occurrence of a name.
pub fn count_name(counts: &mut NameCounts, name: &str) {
    *counts.entry(name.to_owned()).or_default() += 1;
}

/// Returns the condition under which ratios are null, by the description of their first column.
fn null_condition_of_ratios(columns: &[Column]) -> Option<String> {
    let ratio_column = columns.iter().find(|column| column.name.starts_with("ratio_"))?;
    let (_, condition) = ratio_column.metadata.description.rsplit_once("; ")?;
    condition.starts_with("null ").then(|| condition.to_owned())
}

/// Counts a result file's rows, in bounded memory.
///
/// # Errors
/// [`StoreError::File`], and [`StoreError::Parquet`] for a file that lacks a result's columns.
pub fn tally_rows(file: &ParquetFile) -> Result<Tally, StoreError> {
    let field_names = file.schema().fields().iter().map(|field| field.name().as_str());
    let ratio_names = field_names.clone().filter(|name| name.starts_with("ratio_"));
    let has_column = |name: &str| field_names.clone().any(|field| field == name);
    // Files of other kinds, such as responses at held speeds, have no verdicts.
    let has_verdicts = file.kind() == Some(FileKind::Map);
    let required_columns = match has_verdicts {
        true => &["point", "status", "reliable", "sensitive", "method"][..],
        false => &["point", "status"],
    };
    if let Some(name) = required_columns.iter().find(|name| !has_column(name)) {
        return Err(content_error(file, format!("there is no column `{name}`")));
    }
    let limits = file.json(key::PLAN).and_then(|plan| ratio_limits(&plan));
    let over_estimate_limit = limits.map_or(0.0, RatioLimits::over_estimate_limit);
    // Files of other programs may mark a column that has no worse side.
    let all_columns = columns(file.schema());
    let (marked_names, mut extremes): (Vec<&str>, Vec<ColumnExtreme>) = all_columns
        .iter()
        .filter_map(|column| Some((column.name.as_str(), ColumnExtreme::new(column)?)))
        .unzip();
    let mut read_columns: Vec<&str> = ratio_names.collect();
    let ratio_count = read_columns.len();
    read_columns.extend(marked_names);
    let mut add_column = |name| {
        read_columns.push(name);
        read_columns.len() - 1
    };
    let [point_column, status_column, method_column] =
        ["point", "status", "method"].map(&mut add_column);
    let [reliable_column, sensitive_column] = ["reliable", "sensitive"].map(&mut add_column);
    let [error_column, converged_column, ratio_column] =
        ["error", "converged", "ratio_max"].map(&mut add_column);
    let mut tally = Tally::default();
    file.each_row(&read_columns, |row| {
        let flag_cell = |column| row.cell(column).flag();
        tally.points += 1;
        let point = row.value(point_column) as u64;
        if let Some(name) = row.word(status_column) {
            count_name(&mut tally.by_status, name);
            if name != "ok" {
                tally.first_failed.entry(name.to_owned()).or_insert(point);
            }
        }
        for (k, extreme) in extremes.iter_mut().enumerate() {
            extreme.add(row.value(ratio_count + k), point);
        }
        if !has_verdicts {
            return Ok(());
        }
        let least_ratio = (0..ratio_count).map(|k| row.value(k)).fold(f64::INFINITY, f64::min);
        let is_reliable = flag_cell(reliable_column);
        match is_reliable {
            Some(true) => tally.reliable += 1,
            Some(false) => tally.unreliable += 1,
            None => tally.undefined += 1,
        }
        if is_reliable.is_none() && row.word(status_column) == Some("ok") {
            tally.undefined_without_failure += 1;
            tally.first_undefined_without_failure.get_or_insert(point);
        }
        tally.over_estimated += u64::from(least_ratio < over_estimate_limit);
        tally.over_estimated_reliable +=
            u64::from(least_ratio < over_estimate_limit && is_reliable == Some(true));
        tally.sensitive += u64::from(flag_cell(sensitive_column) == Some(true));
        tally.unconverged += u64::from(flag_cell(converged_column) == Some(false));
        row.word(method_column).into_iter().for_each(|name| count_name(&mut tally.by_method, name));
        let keep_if_greatest = |greatest: &mut Option<Extreme>, value: f64| {
            let is_greatest = greatest.as_ref().is_none_or(|greatest| value > greatest.value);
            if is_greatest && !value.is_nan() {
                *greatest = Some(Extreme { value, point });
            }
        };
        // The error of a failed row has no meaning.
        let row_error =
            if row.word(status_column) == Some("ok") { row.value(error_column) } else { f64::NAN };
        keep_if_greatest(&mut tally.greatest_error, row_error);
        keep_if_greatest(&mut tally.greatest_ratio, row.value(ratio_column));
        Ok::<(), StoreError>(())
    })?;
    tally.extremes = extremes;
    tally.undefined_condition = null_condition_of_ratios(&all_columns);
    Ok(tally)
}

/// Reads the method of each row; `None` for a row without one.
///
/// # Errors
/// [`StoreError::File`].
pub fn read_methods(file: &ParquetFile) -> Result<Vec<Option<String>>, StoreError> {
    let mut methods = Vec::new();
    file.each_row(&["method"], |row| {
        methods.push(row.word(0).map(str::to_owned));
        Ok::<(), StoreError>(())
    })?;
    Ok(methods)
}

/// The range of one column of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnRange {
    /// The name.
    pub name: String,
    /// The metadata of the column's field.
    pub metadata: ColumnMetadata,
    /// The number of rows without a value.
    pub null_count: u64,
    /// The least and the greatest value, if there are numbers.
    pub range: Option<(f64, f64)>,
    /// The values of a text or bool column with their numbers of occurrences: the first
    /// `MAX_COUNTED_WORDS` that appear.
    pub word_counts: Vec<(String, u64)>,
}

/// The maximum number of distinct texts of a column that are counted. Basis: columns of names have
/// fewer. Doubling it counts texts of columns that are not names.
const MAX_COUNTED_WORDS: usize = 16;

/// The content of any Parquet file in short.
#[derive(Clone, Debug, PartialEq)]
pub struct FileOverview {
    /// The metadata of a result, if the file is a result of `sweep run`.
    pub result: Option<ResultFile>,
    /// The number of rows.
    pub row_count: u64,
    /// The columns in the order of the file.
    pub columns: Vec<ColumnRange>,
}

/// Reads all of a file in bounded memory, and returns its content in short.
///
/// # Errors
/// [`StoreError::File`].
pub fn read_overview(file: &ParquetFile) -> Result<FileOverview, StoreError> {
    let empty_range = |field: &std::sync::Arc<arrow_schema::Field>| ColumnRange {
        name: field.name().clone(),
        metadata: ColumnMetadata::from_field(field),
        null_count: 0,
        range: None,
        word_counts: Vec::new(),
    };
    let mut ranges: Vec<ColumnRange> = file.schema().fields().iter().map(empty_range).collect();
    // Columns of types that files of this program do not have are not read.
    let readable_columns = columns(file.schema());
    let names: Vec<&str> = readable_columns.iter().map(|column| column.name.as_str()).collect();
    file.each_row(&names, |row| {
        for (k, column) in readable_columns.iter().enumerate() {
            ranges[column.field].add(row.value(k), row.word(k));
        }
        Ok::<(), StoreError>(())
    })?;
    Ok(FileOverview {
        result: ResultFile::read(file, FileKind::Map),
        row_count: file.rows(),
        columns: ranges,
    })
}

impl ColumnRange {
    /// Adds a cell to the range: a number, a word, or neither.
    fn add(&mut self, value: f64, word: Option<&str>) {
        if !value.is_nan() {
            let (least, greatest) = self.range.unwrap_or((value, value));
            self.range = Some((least.min(value), greatest.max(value)));
            return;
        }
        let Some(word) = word else {
            self.null_count += 1;
            return;
        };
        if let Some((_, count)) = self.word_counts.iter_mut().find(|(known, _)| known == word) {
            *count += 1;
        } else if self.word_counts.len() < MAX_COUNTED_WORDS {
            self.word_counts.push((word.to_owned(), 1));
        }
    }
}

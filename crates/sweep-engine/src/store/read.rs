//! Reading of Parquet files: a result's plan, counts of its rows, and the ranges of the columns of
//! any file.

use std::collections::BTreeMap;

use parquet::errors::ParquetError;
use serde::Serialize;
use serde_json::Value;

use super::error::StoreError;
use sweep_files::{FileKind, ParquetFile, columns, key};
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
pub(super) fn refuse_content(file: &ParquetFile, reason: String) -> StoreError {
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

/// The factor by which the speed amplitude that the linear model assumes for friction may differ
/// from that of the motion. Basis: with more than twice the speed, the friction is that of another
/// motion. Doubling it reports fewer rows.
pub const FAR_OFF: f64 = 2.0;

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_zero(count: &u64) -> bool {
    *count == 0
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
    /// The number of rows without a verdict, because a model failed or nothing moves.
    pub undefined: u64,
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
    /// The least gap of the nonlinear model, m.
    pub least_gap_nonlinear_m: Option<Extreme>,
    /// The number of rows in which the linear model linearises friction at a speed that is wrong by
    /// a factor of more than [`FAR_OFF`].
    #[serde(skip_serializing_if = "is_zero")]
    pub far_off: u64,
    /// The greatest factor by which the speed for friction is wrong, if there is friction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub greatest_off: Option<Extreme>,
    /// The counts of a `sweep stability` result, which has no verdicts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dwells: Option<DwellCounts>,
}

/// The numbers of rows of a `sweep stability` result, by stability.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DwellCounts {
    /// The number of rows in which all disturbances decay.
    pub stable: u64,
    /// The number of rows in which a disturbance grows.
    pub unstable: u64,
    /// The number of stable rows whose motion is beyond the limits of the machine.
    pub beyond: u64,
    /// The number of rows without a response.
    pub unknown: u64,
}

/// The number of occurrences of each name.
pub type NameCounts = BTreeMap<String, u64>;

/// Returns the number of rows of each status except `ok`.
pub fn failures(by_status: &NameCounts) -> impl Iterator<Item = (&String, &u64)> {
    by_status.iter().filter(|(status, _)| *status != "ok")
}

/// Returns the number of rows whose status is not `ok`.
pub fn failed(by_status: &NameCounts) -> u64 {
    failures(by_status).map(|(_, count)| count).sum()
}

/// Adds one occurrence of a name.
pub fn add(counts: &mut NameCounts, name: &str) {
    *counts.entry(name.to_owned()).or_default() += 1;
}

/// Counts a result file's rows, in bounded memory.
///
/// # Errors
/// [`StoreError::File`], and [`StoreError::Parquet`] for a file that lacks a result's columns.
pub fn tally(file: &ParquetFile) -> Result<Tally, StoreError> {
    let fields = file.schema().fields().iter().map(|field| field.name().as_str());
    let ratios = fields.clone().filter(|name| name.starts_with("ratio_"));
    let has = |name: &str| fields.clone().any(|field| field == name);
    // A result of `sweep stability` or `sweep dwell` has no verdicts.
    let is_stability = has("stable");
    let has_verdicts = !is_stability && !has("motion");
    let needed = match has_verdicts {
        true => &["point", "status", "reliable", "sensitive", "method"][..],
        false => &["point", "status"],
    };
    if let Some(name) = needed.iter().find(|name| !has(name)) {
        return Err(refuse_content(file, format!("there is no column `{name}`")));
    }
    let limits = file.json(key::PLAN).and_then(|plan| ratio_limits(&plan));
    let over = limits.map_or(0.0, RatioLimits::over_estimate);
    let mut names: Vec<&str> = ratios.collect();
    let ratios = names.len();
    let mut column = |name| {
        names.push(name);
        names.len() - 1
    };
    let [point, status, method] = ["point", "status", "method"].map(&mut column);
    let [stable, beyond, reliable] = ["stable", "beyond", "reliable"].map(&mut column);
    let [sensitive, error, converged] = ["sensitive", "error", "converged"].map(&mut column);
    let [greatest, gap] = ["ratio_max", "min_gap_nonlinear_m"].map(&mut column);
    let off = column("friction_speed_off");
    let mut tally = Tally::default();
    file.each_row(&names, |row| {
        let flag = |column| row.cell(column).flag();
        tally.points += 1;
        row.word(status).into_iter().for_each(|name| add(&mut tally.by_status, name));
        if is_stability {
            let dwells = tally.dwells.get_or_insert_default();
            match flag(stable) {
                Some(true) => {
                    dwells.stable += 1;
                    dwells.beyond += u64::from(row.word(beyond).is_some());
                }
                Some(false) => dwells.unstable += 1,
                None => dwells.unknown += 1,
            }
        }
        if !has_verdicts {
            return Ok(());
        }
        let least = (0..ratios).map(|k| row.value(k)).fold(f64::INFINITY, f64::min);
        let reliable = flag(reliable);
        match reliable {
            Some(true) => tally.reliable += 1,
            Some(false) => tally.unreliable += 1,
            None => tally.undefined += 1,
        }
        tally.over_estimated += u64::from(least < over);
        tally.over_estimated_reliable += u64::from(least < over && reliable == Some(true));
        tally.sensitive += u64::from(flag(sensitive) == Some(true));
        tally.unconverged += u64::from(flag(converged) == Some(false));
        row.word(method).into_iter().for_each(|name| add(&mut tally.by_method, name));
        tally.far_off += u64::from(row.value(off) > FAR_OFF);
        let extreme = |best: &mut Option<Extreme>, value: f64, better: fn(&f64, &f64) -> bool| {
            let is_best = best.as_ref().is_none_or(|best| better(&value, &best.value));
            if is_best && !value.is_nan() {
                *best = Some(Extreme { value, point: row.value(point) as u64 });
            }
        };
        extreme(&mut tally.greatest_off, row.value(off), f64::gt);
        // The error of a failed row means nothing.
        let error = if row.word(status) == Some("ok") { row.value(error) } else { f64::NAN };
        extreme(&mut tally.greatest_error, error, f64::gt);
        extreme(&mut tally.greatest_ratio, row.value(greatest), f64::gt);
        extreme(&mut tally.least_gap_nonlinear_m, row.value(gap), f64::lt);
        Ok::<(), StoreError>(())
    })?;
    Ok(tally)
}

/// Reads the method of each row; `None` for a row without one.
///
/// # Errors
/// [`StoreError::File`].
pub fn methods(file: &ParquetFile) -> Result<Vec<Option<String>>, StoreError> {
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
    /// The unit, if the field's metadata have one.
    pub unit: Option<String>,
    /// The direction in which values are worse, if the file gives it.
    pub worse: Option<Worse>,
    /// The number of rows without a value.
    pub nulls: u64,
    /// The least and the greatest value, if there are numbers.
    pub range: Option<(f64, f64)>,
    /// The values of a text or bool column with their numbers of occurrences: the first
    /// `MAX_NAMES` that appear.
    pub names: Vec<(String, u64)>,
}

/// The maximum number of distinct texts of a column that are counted. Basis: columns of names have
/// fewer. Doubling it counts texts of columns that are not names.
const MAX_NAMES: usize = 16;

/// The content of any Parquet file in short.
#[derive(Clone, Debug, PartialEq)]
pub struct Overview {
    /// The metadata of a result, if the file is a result of `sweep run`.
    pub result: Option<ResultFile>,
    /// The number of rows.
    pub rows: u64,
    /// The columns in the order of the file.
    pub columns: Vec<ColumnRange>,
}

/// Reads all of a file in bounded memory, and returns its content in short.
///
/// # Errors
/// [`StoreError::File`].
pub fn overview(file: &ParquetFile) -> Result<Overview, StoreError> {
    let new = |field: &std::sync::Arc<arrow_schema::Field>| ColumnRange {
        name: field.name().clone(),
        unit: field.metadata().get("unit").cloned().filter(|unit| !unit.is_empty()),
        worse: field.metadata().get(key::WORSE).and_then(|name| Worse::named(name)),
        nulls: 0,
        range: None,
        names: Vec::new(),
    };
    let mut ranges: Vec<ColumnRange> = file.schema().fields().iter().map(new).collect();
    // Columns of types that files of this program do not have are not read.
    let known = columns(file.schema());
    let names: Vec<&str> = known.iter().map(|column| column.name.as_str()).collect();
    file.each_row(&names, |row| {
        for (k, column) in known.iter().enumerate() {
            ranges[column.field].add(row.value(k), row.word(k));
        }
        Ok::<(), StoreError>(())
    })?;
    Ok(Overview {
        result: ResultFile::read(file, FileKind::Map),
        rows: file.rows(),
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
            self.nulls += 1;
            return;
        };
        if let Some((_, count)) = self.names.iter_mut().find(|(known, _)| known == word) {
            *count += 1;
        } else if self.names.len() < MAX_NAMES {
            self.names.push((word.to_owned(), 1));
        }
    }
}

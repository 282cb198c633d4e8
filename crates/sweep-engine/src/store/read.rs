//! Reading Parquet files back: whose plan a result is of, what it holds, what any file's columns
//! range over.

use std::collections::BTreeMap;

use parquet::errors::ParquetError;
use serde::Serialize;
use serde_json::Value;

use super::error::StoreError;
use sweep_files::{FileKind, ParquetFile, columns, key};
use sweep_parameter::{RatioLimits, Worse};
use sweep_results::ratio_limits;

/// What a finished result says of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct ResultFile {
    /// Grid as run, full machine, method.
    pub plan: Value,
    /// Hash over version, numerics and plan, hexadecimal.
    pub plan_hash: String,
    /// Version of the program that made it.
    pub version: String,
    /// Version of its numerics; 0 in files older than that.
    pub numerics: u32,
    /// Rows.
    pub points: u64,
}

impl ResultFile {
    /// What the metadata says; nothing of a file that is not of this kind.
    pub fn of(file: &ParquetFile, kind: FileKind<'_>) -> Option<Self> {
        // Other files of this program carry the plan too: a boundary's rows are not points.
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

/// That a file is not what it is taken for.
pub(super) fn unlike(file: &ParquetFile, reason: String) -> StoreError {
    StoreError::parquet("read", file.path())(ParquetError::General(reason))
}

/// An extreme value, and its place.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Extreme {
    /// The value.
    pub value: f64,
    /// Point index.
    pub point: u64,
}

/// A linear model that takes friction at a speed off by more than this is that of another motion.
pub const FAR_OFF: f64 = 2.0;

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_none(count: &u64) -> bool {
    *count == 0
}

/// What a result holds, counted.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Tally {
    /// Rows.
    pub points: u64,
    /// Rows by status.
    pub by_status: NameCounts,
    /// Rows whose ratio is below the limit.
    pub reliable: u64,
    /// Rows whose ratio is at or above the limit.
    pub unreliable: u64,
    /// Rows without a verdict: a model failed, or nothing moves.
    pub undefined: u64,
    /// Rows with a ratio so low that the linear model over-estimates as much as a reliable one may
    /// under-estimate.
    pub over_estimated: u64,
    /// How many of these are reliable.
    pub over_estimated_reliable: u64,
    /// Rows known to be chaotic.
    pub sensitive: u64,
    /// Rows whose error is above the accuracy asked for.
    pub unconverged: u64,
    /// Rows by the method that their numbers come from, where the file says so.
    pub by_method: NameCounts,
    /// The greatest error left in a row.
    pub greatest_error: Option<Extreme>,
    /// The greatest ratio.
    pub greatest_ratio: Option<Extreme>,
    /// The least gap of the nonlinear model, m.
    pub least_gap_nonlinear_m: Option<Extreme>,
    /// Rows whose linear model takes friction at a speed off by more than [`FAR_OFF`].
    #[serde(skip_serializing_if = "is_none")]
    pub far_off: u64,
    /// The greatest factor by which a speed is off, where there is friction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub greatest_off: Option<Extreme>,
    /// The counts of a `sweep stability` result, which has none of the verdicts above.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dwells: Option<DwellCounts>,
}

/// Rows of a result of `sweep stability`, counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DwellCounts {
    /// Rows whose disturbances all decay.
    pub stable: u64,
    /// Rows with one that grows.
    pub unstable: u64,
    /// Stable rows whose motion no machine can make.
    pub beyond: u64,
    /// Rows without a response.
    pub unknown: u64,
}

/// How often each name occurs.
pub type NameCounts = BTreeMap<String, u64>;

/// Rows by status, without those that are `ok`.
pub fn failures(by_status: &NameCounts) -> impl Iterator<Item = (&String, &u64)> {
    by_status.iter().filter(|(status, _)| *status != "ok")
}

/// Rows whose status is not `ok`.
pub fn failed(by_status: &NameCounts) -> u64 {
    failures(by_status).map(|(_, count)| count).sum()
}

/// Counts one more of a name.
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
    let (is_of_stability, has_verdicts) = (has("stable"), !has("stable") && !has("motion"));
    let needed = match has_verdicts {
        true => &["point", "status", "reliable", "sensitive", "method"][..],
        false => &["point", "status"],
    };
    if let Some(name) = needed.iter().find(|name| !has(name)) {
        return Err(unlike(file, format!("there is no column `{name}`")));
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
        if is_of_stability {
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
        // Of a run that failed nothing is left to err.
        let error = if row.word(status) == Some("ok") { row.value(error) } else { f64::NAN };
        extreme(&mut tally.greatest_error, error, f64::gt);
        extreme(&mut tally.greatest_ratio, row.value(greatest), f64::gt);
        extreme(&mut tally.least_gap_nonlinear_m, row.value(gap), f64::lt);
        Ok::<(), StoreError>(())
    })?;
    Ok(tally)
}

/// Which method each row's numbers come from; nothing where the file does not say.
///
/// # Errors
/// [`StoreError::File`].
pub fn levels(file: &ParquetFile) -> Result<Vec<Option<String>>, StoreError> {
    let mut levels = Vec::new();
    file.each_row(&["method"], |row| {
        levels.push(row.word(0).map(str::to_owned));
        Ok::<(), StoreError>(())
    })?;
    Ok(levels)
}

/// What one column of any file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnRange {
    /// Name.
    pub name: String,
    /// Unit from the field's metadata, if it carries one.
    pub unit: Option<String>,
    /// Which way it is bad, if the file says so.
    pub worse: Option<Worse>,
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
}

/// Reads through a file, in bounded memory.
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
    // Nothing is known of cells of types that none of our files has.
    let known = columns(file.schema());
    let names: Vec<&str> = known.iter().map(|column| column.name.as_str()).collect();
    file.each_row(&names, |row| {
        for (k, column) in known.iter().enumerate() {
            ranges[column.field].widen(row.value(k), row.word(k));
        }
        Ok::<(), StoreError>(())
    })?;
    Ok(Overview { result: ResultFile::of(file, FileKind::Map), rows: file.rows(), columns: ranges })
}

impl ColumnRange {
    /// Takes in a number or a word, if there is one.
    fn widen(&mut self, value: f64, word: Option<&str>) {
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
        } else if self.names.len() < NAMES_SHOWN {
            self.names.push((word.to_owned(), 1));
        }
    }
}

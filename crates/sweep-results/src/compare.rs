//! Comparison of two results of one kind: rows, verdicts, plans and the boundary.

mod boundary;
mod plans;
mod side;

use std::collections::HashMap;

use serde::Serialize;
use sweep_files::{Cell, FileKind, ResultTable, ratio_limits};

pub use boundary::{BoundaryCrossing, BoundaryShift};
pub use plans::{PlanChange, plan_changes};

use crate::error::ResultsError;
use side::ComparedFile;
use sweep_parameter::named;

named! {
    /// A change of a row's verdict from the first file to the second.
    #[derive(Serialize)]
    #[serde(rename_all = "snake_case")]
    pub enum Flip {
        /// The verdict is the same.
        None = "none",
        /// The row was reliable and is not.
        Lost = "lost",
        /// The row was not reliable and is.
        Gained = "gained",
        /// Only one file has a verdict for the row.
        Defined = "defined",
    }
}

/// A row that both files have.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SharedRow {
    /// The row's numbers in the first and in the second file, from 0.
    pub rows: [u64; 2],
    /// The values of the key columns in the first file.
    pub key: Vec<f64>,
    /// The values of the key columns in the second file; those of the first where both agree to
    /// nine digits.
    pub second_key: Vec<f64>,
    /// The greatest ratio in either file.
    #[serde(rename = "ratio")]
    pub ratios: [Option<f64>; 2],
    /// The least ratio in either file.
    #[serde(rename = "least_ratio")]
    pub least_ratios: [Option<f64>; 2],
    /// The least gap of the nonlinear model in either file, m.
    #[serde(rename = "gap_m")]
    pub gaps_m: [Option<f64>; 2],
    /// The change of the verdict.
    pub flip: Flip,
    /// Whether the row was reliable and is now unreliable or without a verdict.
    pub is_lost: bool,
    /// Whether either file calls the row sensitive, so that its verdict may differ between builds.
    #[serde(rename = "sensitive")]
    pub is_sensitive: bool,
    /// Whether any cell differs.
    pub differs: bool,
}

impl SharedRow {
    /// Returns the second ratio over the first.
    pub fn ratio_quotient(&self) -> Option<f64> {
        let first_ratio = self.ratios[0]?;
        let second_ratio = self.ratios[1]?;
        Some(second_ratio / first_ratio).filter(|quotient| quotient.is_finite())
    }

    /// Returns the second gap less the first, m.
    pub fn gap_difference_m(&self) -> Option<f64> {
        Some(self.gaps_m[1]? - self.gaps_m[0]?)
    }

    /// Returns the larger ratio over the smaller, less 1; infinite if only one file has a ratio.
    pub fn ratio_deviation(&self) -> f64 {
        deviation(self.ratios, |first, second| (second / first).max(first / second) - 1.0)
    }

    /// Returns the distance of the two gaps (m); infinite if only one file has a gap.
    pub fn gap_deviation_m(&self) -> f64 {
        deviation(self.gaps_m, |first, second| (second - first).abs())
    }
}

/// Returns the distance of two values by a measure. It is infinite if only one of them exists, so
/// that such rows are listed first.
fn deviation(values: [Option<f64>; 2], distance: fn(f64, f64) -> f64) -> f64 {
    match values {
        [first, second] if first == second => 0.0,
        [Some(first), Some(second)] => distance(first, second),
        _ => f64::INFINITY,
    }
}

/// The differences in a column that both files have.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColumnChange {
    /// The name of the column.
    pub name: String,
    /// The unit of the column.
    pub unit: String,
    /// The number of shared rows in which the column differs.
    pub rows: u64,
    /// The greatest difference of numbers.
    pub greatest_difference: f64,
    /// The rows in which numbers differ most, the farthest apart first, without sensitive ones; at
    /// most [`MAX_WORST_ROWS`].
    #[serde(rename = "worst")]
    pub worst_rows: Vec<ColumnRow>,
}

/// Maximum number of rows that are kept for each column that differs. Basis: what a table shows.
/// Doubling it doubles the rows that a table of a column can show.
pub const MAX_WORST_ROWS: usize = 20;

/// A row in which a column's numbers differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColumnRow {
    /// The index of the row in [`Comparison::shared_rows`].
    pub row: usize,
    /// The number in either file.
    pub values: [Option<f64>; 2],
}

impl ColumnRow {
    /// Returns the distance of the two numbers; infinite if only one file has a number.
    pub fn deviation(&self) -> f64 {
        deviation(self.values, |first, second| (second - first).abs())
    }
}

/// The differences between two files.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// The differences of the plans: parameters, spin, method, versions.
    pub plan: Vec<PlanChange>,
    /// The columns in both files that identify a row.
    pub keys: Vec<String>,
    /// The units of the key columns.
    pub key_units: Vec<String>,
    /// Whether rows are matched by the index of their point, because the axes have the same
    /// tolerances about different nominal values.
    pub is_matched_by_point: bool,
    /// The axes that only one file has, with the same value in all of its rows: the index of the
    /// file, the axis, the value.
    pub single_valued_axes: Vec<(usize, String, f64)>,
    /// The number of rows that only the first file has, and that only the second has.
    pub unmatched_rows: [u64; 2],
    /// The names of the columns that only the first file has, and that only the second has.
    pub unmatched_columns: [Vec<String>; 2],
    /// The rows that both files have, in the order of the first.
    #[serde(rename = "shared")]
    pub shared_rows: Vec<SharedRow>,
    /// The columns that differ, in the order of the first file.
    #[serde(rename = "columns")]
    pub changed_columns: Vec<ColumnChange>,
    /// Whether both files have verdicts.
    pub has_verdicts: bool,
    /// The number of shared rows in either file in which the linear model over-estimates beyond the
    /// limit of reliable rows; `None` for files without limits.
    #[serde(rename = "over_estimated")]
    pub over_estimated_rows: Option<[usize; 2]>,
    /// Whether both files have ratios.
    pub has_ratios: bool,
    /// Whether both files have least gaps of the nonlinear model.
    pub has_gaps: bool,
    /// The shift of the boundary, if the files have one.
    pub boundary: Option<BoundaryShift>,
}

impl Comparison {
    /// Returns whether nothing at all differs.
    pub fn is_empty(&self) -> bool {
        self.plan.is_empty()
            && self.unmatched_rows == [0, 0]
            && self.single_valued_axes.is_empty()
            && self.unmatched_columns.iter().all(Vec::is_empty)
            && self.changed_columns.is_empty()
    }

    /// Iterates over the rows whose verdict differs, either the sensitive or the other ones.
    pub fn flips(&self, sensitive: bool) -> impl Iterator<Item = &SharedRow> {
        self.shared_rows
            .iter()
            .filter(move |row| row.flip != Flip::None && row.is_sensitive == sensitive)
    }

    /// Returns the `count` rows with the greatest deviations above 0, the greatest first, either of
    /// the sensitive or of the other rows.
    pub fn most_deviating(
        &self,
        count: usize,
        sensitive: bool,
        deviation: fn(&SharedRow) -> f64,
    ) -> Vec<&SharedRow> {
        let mut rows: Vec<&SharedRow> = self
            .shared_rows
            .iter()
            .filter(|row| row.is_sensitive == sensitive && deviation(row) > 0.0)
            .collect();
        rows.sort_by(|a, b| deviation(b).total_cmp(&deviation(a)));
        rows.truncate(count);
        rows
    }
}

/// Returns the kind of a file; only files of the same kind are compared.
fn result_kind(table: &ResultTable) -> &'static str {
    let is_map = table.column("ratio_max").is_some() && table.column("status").is_some();
    let default_kind = if is_map { "map" } else { "other" };
    table.file().kind().map_or(default_kind, FileKind::short_name)
}

/// Compares the second file with the first.
///
/// Rows match if their key columns agree to nine digits: a grid's axes, and any further column that
/// numbers the rows of one point. An axis that only one file has is ignored if it has a single
/// value. Where the axes have the same tolerances about different nominal values, the index of the
/// point takes the place of their values.
///
/// # Errors
/// [`ResultsError::Refused`] with the reason, [`ResultsError::File`].
pub fn compare(first: &ResultTable, second: &ResultTable) -> Result<Comparison, ResultsError> {
    let refusal = |reason: String| {
        let [first, second] = [first, second].map(|table| table.path().display());
        ResultsError::Refused(format!("{first} and {second} cannot be compared: {reason}"))
    };
    let result_kinds = [result_kind(first), result_kind(second)];
    if result_kinds[0] != result_kinds[1] {
        return Err(refusal(format!(
            "the kinds of file are {} and {}",
            result_kinds[0], result_kinds[1]
        )));
    }
    let is_boundary = result_kinds[0] == "boundary";
    let tables = [first, second];
    let keys_by_file = tables.map(|table| side::key_columns(table, is_boundary));
    let keys: Vec<String> =
        keys_by_file[0].iter().filter(|name| keys_by_file[1].contains(name)).cloned().collect();
    let mut single_valued_axes = Vec::new();
    for (file, names) in keys_by_file.iter().enumerate() {
        for name in names.iter().filter(|name| !keys.contains(name)) {
            let Some(value) = side::find_single_value(tables[file], name)? else {
                let ordinal = ["first", "second"][file];
                return Err(refusal(format!(
                    "only the {ordinal} has the axis `{name}`, with several values"
                )));
            };
            single_valued_axes.push((file, name.clone(), value));
        }
    }
    let unmatched_columns = [0, 1].map(|file| {
        let other_table = tables[1 - file];
        let column_names = tables[file].columns.iter().map(|column| column.name.clone());
        column_names
            .filter(|name| other_table.column(name).is_none() && !keys_by_file[file].contains(name))
            .collect::<Vec<_>>()
    });
    let is_matched_by_point = !is_boundary
        && tables.iter().all(|table| table.column("point").is_some())
        && plans::differs_in_nominal_values(first.plan.as_ref(), second.plan.as_ref());
    let mut matching_columns = keys.clone();
    if is_matched_by_point {
        matching_columns.retain(|name| !first.axes().contains(&name.as_str()));
        matching_columns.push("point".to_owned());
    }
    let files = [
        ComparedFile::read(first, second, &keys, &matching_columns)?,
        ComparedFile::read(second, first, &keys, &matching_columns)?,
    ];
    let row_pairs = match_rows(&files);
    if row_pairs.is_empty() && files.iter().any(|file| file.rows > 0) {
        let keys = if keys.is_empty() { "rows".to_owned() } else { keys.join(", ") };
        return Err(refusal(format!("they share no row: no values of {keys} are in both")));
    }
    let mut shared_rows: Vec<SharedRow> =
        row_pairs.iter().map(|&pair| files[0].shared_row(&files[1], pair)).collect();
    let changed_columns = compare_columns(&files, &row_pairs, &mut shared_rows);
    let key_unit = |name: &String| first.column(name).map(|column| column.unit().to_owned());
    let key_units = keys.iter().map(|name| key_unit(name).unwrap_or_default()).collect();
    let boundary = if is_boundary {
        boundary::compare_boundaries(first, second)?
    } else {
        boundary::compare_maps(first, &keys, &shared_rows)
    };
    let is_column_in_both = |name: &str| tables.iter().all(|table| table.column(name).is_some());
    Ok(Comparison {
        plan: plans::compare_plans(first.file(), second.file()),
        unmatched_rows: [0, 1].map(|file| (files[file].rows - row_pairs.len()) as u64),
        has_verdicts: is_column_in_both("reliable"),
        over_estimated_rows: count_over_estimated(tables, &shared_rows),
        has_ratios: is_column_in_both("ratio_max"),
        has_gaps: is_column_in_both("min_gap_nonlinear_m"),
        keys,
        key_units,
        is_matched_by_point,
        single_valued_axes,
        unmatched_columns,
        shared_rows,
        changed_columns,
        boundary,
    })
}

/// Counts the rows of either file whose least ratio is below the limit of that file's plan.
fn count_over_estimated(
    tables: [&ResultTable; 2],
    shared_rows: &[SharedRow],
) -> Option<[usize; 2]> {
    let count_in_file = |file: usize| {
        let limit = ratio_limits(tables[file].plan.as_ref()?)?.over_estimate_limit();
        let is_below = |row: &&SharedRow| row.least_ratios[file].is_some_and(|least| least < limit);
        Some(shared_rows.iter().filter(is_below).count())
    };
    Some([count_in_file(0)?, count_in_file(1)?])
}

/// Returns the row numbers of matching rows, in the order of the first file. Rows with equal keys
/// are paired in the order of their files.
fn match_rows(files: &[ComparedFile; 2]) -> Vec<[usize; 2]> {
    let mut key_counts = HashMap::new();
    let second_rows: HashMap<_, usize> = (0..files[1].rows)
        .map(|row| (numbered_key(&files[1], row, &mut key_counts), row))
        .collect();
    key_counts.clear();
    (0..files[0].rows)
        .filter_map(|row| {
            let key = numbered_key(&files[0], row, &mut key_counts);
            Some([row, *second_rows.get(&key)?])
        })
        .collect()
}

/// Returns a row's key and its occurrence among the rows so far, from 1.
fn numbered_key(
    file: &ComparedFile,
    row: usize,
    key_counts: &mut HashMap<Vec<u64>, usize>,
) -> (Vec<u64>, usize) {
    let key = file.key(row);
    let occurrence = key_counts.entry(key.clone()).or_default();
    *occurrence += 1;
    (key, *occurrence)
}

/// Returns the columns that differ in the shared rows, and marks the rows that differ.
fn compare_columns(
    files: &[ComparedFile; 2],
    row_pairs: &[[usize; 2]],
    shared_rows: &mut [SharedRow],
) -> Vec<ColumnChange> {
    let mut column_changes = Vec::new();
    for (first, column) in files[0].columns() {
        let Some(second) = files[1].column_position(&column.name) else { continue };
        let mut column_change = ColumnChange {
            name: column.name.clone(),
            unit: column.unit().to_owned(),
            rows: 0,
            greatest_difference: 0.0,
            worst_rows: Vec::new(),
        };
        for (index, (row_pair, row)) in row_pairs.iter().zip(shared_rows.iter_mut()).enumerate() {
            let first_cell = files[0].cell(first, row_pair[0]);
            let second_cell = files[1].cell(second, row_pair[1]);
            if first_cell == second_cell {
                continue;
            }
            column_change.rows += 1;
            row.differs = true;
            // Other writers store NaN where a value is missing.
            let to_number = |cell: Cell| cell.number().filter(|number| !number.is_nan());
            let column_row =
                ColumnRow { row: index, values: [to_number(first_cell), to_number(second_cell)] };
            if let [Some(first), Some(second)] = column_row.values {
                column_change.greatest_difference =
                    column_change.greatest_difference.max((second - first).abs());
            }
            let deviation = column_row.deviation();
            if deviation > 0.0 && !row.is_sensitive {
                let index_in_worst = column_change
                    .worst_rows
                    .partition_point(|worst_row| worst_row.deviation() >= deviation);
                column_change.worst_rows.insert(index_in_worst, column_row);
                column_change.worst_rows.truncate(MAX_WORST_ROWS);
            }
        }
        if column_change.rows > 0 {
            column_changes.push(column_change);
        }
    }
    column_changes
}

#[cfg(test)]
mod tests;

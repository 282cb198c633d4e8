//! What differs between two results of one kind.

mod boundary;
mod plans;
mod side;

use std::collections::HashMap;

use serde::Serialize;
use sweep_files::{Cell, FileKind, ResultTable, ratio_limits};

pub use boundary::{Crossing, Moved};
pub use plans::PlanChange;

use crate::error::{Result, ResultsError};
use side::Side;
use sweep_parameter::named;

named! {
    /// What became of a row's verdict, as a file of differences says it.
    #[derive(Serialize)]
    #[serde(rename_all = "snake_case")]
    pub enum Flip {
        /// The same.
        None = "none",
        /// It was reliable and is not.
        Lost = "lost",
        /// It was not reliable and is.
        Gained = "gained",
        /// It has a verdict, or has none any more.
        Defined = "defined",
    }
}

/// A row that both files have.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SharedRow {
    /// Its number in the first and in the second file, from 0.
    pub rows: [u64; 2],
    /// Where it is, by the columns that both files have for it.
    pub place: Vec<f64>,
    /// The greatest ratio in either file.
    pub ratio: [Option<f64>; 2],
    /// The least ratio in either file.
    pub least_ratio: [Option<f64>; 2],
    /// The least gap of the nonlinear model in either file, m.
    pub gap_m: [Option<f64>; 2],
    /// What became of the verdict.
    pub flip: Flip,
    /// Whether it was reliable and is so no more: not reliable, or without a verdict.
    pub is_lost: bool,
    /// Whether either file calls the row sensitive: its digits, and maybe its verdict, are those of
    /// one trajectory.
    pub sensitive: bool,
    /// Whether any cell differs.
    pub differs: bool,
}

impl SharedRow {
    /// The second ratio over the first.
    pub fn ratio_change(&self) -> Option<f64> {
        let [first, second] = [self.ratio[0]?, self.ratio[1]?];
        Some(second / first).filter(|change| change.is_finite())
    }

    /// The second gap less the first, m.
    pub fn gap_change_m(&self) -> Option<f64> {
        Some(self.gap_m[1]? - self.gap_m[0]?)
    }

    /// By how much the ratio changed either way, as a factor less 1; infinite where one file alone
    /// has a ratio.
    pub fn ratio_by(&self) -> f64 {
        by(self.ratio, |first, second| (second / first).max(first / second) - 1.0)
    }

    /// By how much the gap changed either way, m; infinite where one file alone has a gap.
    pub fn gap_by_m(&self) -> f64 {
        by(self.gap_m, |first, second| (second - first).abs())
    }
}

/// How far two values are apart. A value that came or went is farther than any measure.
fn by([first, second]: [Option<f64>; 2], apart: fn(f64, f64) -> f64) -> f64 {
    match (first, second) {
        _ if first == second => 0.0,
        (Some(first), Some(second)) => apart(first, second),
        _ => f64::INFINITY,
    }
}

/// How a column that both files have differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColumnChange {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Shared rows in which it differs.
    pub rows: u64,
    /// The greatest difference of numbers.
    pub greatest: f64,
}

/// What differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Where the plans part: parameters, spin, method, versions.
    pub plan: Vec<PlanChange>,
    /// Columns by which rows are told apart, in both files.
    pub keys: Vec<String>,
    /// Their units.
    pub key_units: Vec<String>,
    /// Axes of a single value that only one file has, by its place (0 or 1), with the value.
    pub fixed: Vec<(usize, String, f64)>,
    /// Rows of only the first and of only the second file.
    pub alone: [u64; 2],
    /// Columns that only the first and only the second file has.
    pub columns_alone: [Vec<String>; 2],
    /// The rows that both have, in the order of the first.
    pub shared: Vec<SharedRow>,
    /// Columns that differ, in the order of the first file.
    pub columns: Vec<ColumnChange>,
    /// Whether the files have verdicts.
    pub has_verdicts: bool,
    /// Shared rows that the linear model over-estimates as much as it may under-estimate a reliable
    /// one, in either file; of files with limits.
    pub over_estimated: Option<[usize; 2]>,
    /// Whether the files have ratios.
    pub has_ratios: bool,
    /// Whether the files have least gaps of the nonlinear model.
    pub has_gaps: bool,
    /// How the boundary moved, if there is one.
    pub boundary: Option<Moved>,
}

impl Comparison {
    /// Whether nothing at all differs.
    pub fn is_empty(&self) -> bool {
        self.plan.is_empty()
            && self.alone == [0, 0]
            && self.fixed.is_empty()
            && self.columns_alone.iter().all(Vec::is_empty)
            && self.columns.is_empty()
    }

    /// Rows whose verdict differs; of `sensitive` ones, or of the others.
    pub fn flips(&self, sensitive: bool) -> impl Iterator<Item = &SharedRow> {
        self.shared.iter().filter(move |row| row.flip != Flip::None && row.sensitive == sensitive)
    }

    /// The `count` rows with the greatest changes by `of`, those without a change left out; of
    /// `sensitive` rows, or of the others.
    pub fn greatest(
        &self,
        count: usize,
        sensitive: bool,
        of: fn(&SharedRow) -> f64,
    ) -> Vec<&SharedRow> {
        let own = self.shared.iter().filter(|row| row.sensitive == sensitive && of(row) > 0.0);
        let mut rows: Vec<&SharedRow> = own.collect();
        rows.sort_by(|a, b| of(b).total_cmp(&of(a)));
        rows.truncate(count);
        rows
    }
}

/// The kind of a file, for telling what cannot be compared.
fn kind(table: &ResultTable) -> &'static str {
    let is_map = table.column("ratio_max").is_some() && table.column("status").is_some();
    let other = if is_map { "map" } else { "other" };
    table.file().kind().map_or(other, FileKind::word)
}

/// Compares the second file with the first.
///
/// Rows are the same where the values of all key columns are, to nine digits: a grid's axes, and
/// whatever else counts on along them. An axis that only one file has is left out if it has one
/// value there.
///
/// # Errors
/// [`ResultsError::Refused`] with the reason, [`ResultsError::File`].
pub fn compare(first: &ResultTable, second: &ResultTable) -> Result<Comparison, ResultsError> {
    let refuse = |reason: String| {
        let [first, second] = [first, second].map(|table| table.path().display());
        ResultsError::Refused(format!("{first} and {second} cannot be compared: {reason}"))
    };
    let kinds = [kind(first), kind(second)];
    if kinds[0] != kinds[1] {
        return Err(refuse(format!("the kinds of file are {} and {}", kinds[0], kinds[1])));
    }
    let is_boundary = kinds[0] == "boundary";
    let tables = [first, second];
    let own_keys = tables.map(|table| side::keys(table, is_boundary));
    let [firsts, seconds] = &own_keys;
    let keys: Vec<String> = firsts.iter().filter(|name| seconds.contains(name)).cloned().collect();
    let mut fixed = Vec::new();
    for (place, names) in own_keys.iter().enumerate() {
        for name in names.iter().filter(|name| !keys.contains(name)) {
            let Some(value) = side::only_value(tables[place], name)? else {
                let which = ["first", "second"][place];
                return Err(refuse(format!(
                    "only the {which} has the axis `{name}`, with several values"
                )));
            };
            fixed.push((place, name.clone(), value));
        }
    }
    let columns_alone = [0, 1].map(|place| {
        let other = tables[1 - place];
        let own = tables[place].columns.iter().map(|column| column.name.clone());
        own.filter(|name| other.column(name).is_none())
            .filter(|name| !own_keys[place].contains(name))
            .collect::<Vec<_>>()
    });
    let sides = [Side::read(first, second, &keys)?, Side::read(second, first, &keys)?];
    let pairs = matched(&sides);
    if pairs.is_empty() && sides.iter().any(|side| side.rows > 0) {
        let keys = if keys.is_empty() { "rows".to_owned() } else { keys.join(", ") };
        return Err(refuse(format!("they share no row: no values of {keys} are in both")));
    }
    let mut shared: Vec<SharedRow> =
        pairs.iter().map(|&pair| sides[0].shared(&sides[1], pair)).collect();
    let columns = changes(&sides, &pairs, &mut shared);
    let unit = |name: &String| first.column(name).map(|column| column.unit.clone());
    let key_units = keys.iter().map(|name| unit(name).unwrap_or_default()).collect();
    let boundary = if is_boundary {
        boundary::of_boundaries(first, second)?
    } else {
        boundary::of_maps(first, &keys, &shared)
    };
    let both_have = |name: &str| tables.iter().all(|table| table.column(name).is_some());
    Ok(Comparison {
        plan: plans::changes(first.file(), second.file()),
        alone: [0, 1].map(|place| (sides[place].rows - pairs.len()) as u64),
        has_verdicts: both_have("reliable"),
        over_estimated: over_estimated(tables, &shared),
        has_ratios: both_have("ratio_max"),
        has_gaps: both_have("min_gap_nonlinear_m"),
        keys,
        key_units,
        fixed,
        columns_alone,
        shared,
        columns,
        boundary,
    })
}

/// How many of the rows have too low a ratio in either file, by its own limits.
fn over_estimated(tables: [&ResultTable; 2], shared: &[SharedRow]) -> Option<[usize; 2]> {
    let of = |side: usize| {
        let limit = ratio_limits(tables[side].plan.as_ref()?)?.over_estimate();
        let is_below = |row: &&SharedRow| row.least_ratio[side].is_some_and(|least| least < limit);
        Some(shared.iter().filter(is_below).count())
    };
    Some([of(0)?, of(1)?])
}

/// Places of the rows that both sides have, in the order of the first. Rows of one key are paired
/// in the order of their files.
fn matched(sides: &[Side; 2]) -> Vec<[usize; 2]> {
    let mut seen = HashMap::new();
    let known: HashMap<_, usize> =
        (0..sides[1].rows).map(|row| (numbered(&sides[1], row, &mut seen), row)).collect();
    seen.clear();
    (0..sides[0].rows)
        .filter_map(|row| Some([row, *known.get(&numbered(&sides[0], row, &mut seen))?]))
        .collect()
}

/// A row's key, and how many rows up to this one have it.
fn numbered(side: &Side, row: usize, seen: &mut HashMap<Vec<u64>, usize>) -> (Vec<u64>, usize) {
    let key = side.key(row);
    let count = seen.entry(key.clone()).or_default();
    *count += 1;
    (key, *count)
}

/// The columns that differ in the shared rows, which are marked.
fn changes(sides: &[Side; 2], pairs: &[[usize; 2]], shared: &mut [SharedRow]) -> Vec<ColumnChange> {
    let mut changes = Vec::new();
    for (first, column) in sides[0].columns() {
        let Some(second) = sides[1].place(&column.name) else { continue };
        let mut change = ColumnChange {
            name: column.name.clone(),
            unit: column.unit.clone(),
            rows: 0,
            greatest: 0.0,
        };
        for (pair, row) in pairs.iter().zip(shared.iter_mut()) {
            let [first, second] = [sides[0].cell(first, pair[0]), sides[1].cell(second, pair[1])];
            if first == second {
                continue;
            }
            change.rows += 1;
            row.differs = true;
            if let (Cell::Number(first), Cell::Number(second)) = (first, second) {
                change.greatest = change.greatest.max((second - first).abs());
            }
        }
        if change.rows > 0 {
            changes.push(change);
        }
    }
    changes
}

#[cfg(test)]
mod tests;

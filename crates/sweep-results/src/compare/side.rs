//! One of two files, in memory.

use super::{Flip, SharedRow};
use crate::error::{Result, ResultsError};
use sweep_files::{Cell, Column, ResultTable, Rows};

/// Most cells of a file that are kept: two files of so many take some gigabytes.
const MOST_CELLS: u64 = 100_000_000;

/// The columns that take part in a comparison, and the keys of the rows.
#[derive(Debug)]
pub(super) struct Side {
    /// The keys' columns first.
    parts: Vec<Rows>,
    /// How many rows it has.
    pub(super) rows: usize,
    keys: usize,
    columns: Vec<Column>,
}

/// The columns by which a file's rows are told apart.
pub(super) fn keys(table: &ResultTable, is_boundary: bool) -> Vec<String> {
    let mut names: Vec<&str> = table.places().into_iter().filter(|name| *name != "point").collect();
    if names.contains(&"time_s") {
        // The speed follows from the time.
        names = vec!["time_s"];
    }
    if is_boundary {
        // The second axis is what was found.
        let second = table.axes().get(1).map(|name| (*name).to_owned());
        names.retain(|name| Some(*name) != second.as_deref());
    }
    names.into_iter().map(str::to_owned).collect()
}

/// The value of a column that has one in all rows.
pub(super) fn only_value(table: &ResultTable, name: &str) -> Result<Option<f64>> {
    let mut value = None;
    for rows in table.file().read(&[name])? {
        let rows = rows?;
        for at in 0..rows.count {
            let found = rows.row(at).cell(0).number();
            if found.is_none() || value.is_some_and(|value| Some(value) != found) {
                return Ok(None);
            }
            value = found;
        }
    }
    Ok(value)
}

impl Side {
    /// Reads the columns that the other file has too.
    ///
    /// # Errors
    /// [`ResultsError::Refused`], [`ResultsError::File`].
    pub(super) fn read(table: &ResultTable, other: &ResultTable, keys: &[String]) -> Result<Self> {
        let in_both = |column: &Column| {
            let beside = other.column(&column.name);
            let is_same = beside.is_some_and(|beside| beside.kind == column.kind);
            is_same && column.name != "point" && !keys.contains(&column.name)
        };
        let mut columns = table.columns.clone();
        columns.retain(in_both);
        let cells = table.rows().saturating_mul((columns.len() + keys.len()) as u64);
        if cells > MOST_CELLS {
            return Err(ResultsError::Refused(format!(
                "{} has {cells} cells, more than the {MOST_CELLS} that are kept in memory",
                table.path().display()
            )));
        }
        let names = keys.iter().chain(columns.iter().map(|column| &column.name));
        let names: Vec<&str> = names.map(String::as_str).collect();
        let parts = table.file().read(&names)?.collect::<Result<Vec<Rows>, _>>()?;
        let rows = parts.iter().map(|part| part.count).sum();
        Ok(Self { parts, rows, keys: keys.len(), columns })
    }

    /// The columns, each with its place in [`Side::cell`].
    pub(super) fn columns(&self) -> impl Iterator<Item = (usize, &Column)> {
        (self.keys..).zip(&self.columns)
    }

    /// The place of the column of that name.
    pub(super) fn place(&self, name: &str) -> Option<usize> {
        self.columns().find(|(_, column)| column.name == name).map(|(place, _)| place)
    }

    /// The cell of a row in the column at a place.
    pub(super) fn cell(&self, place: usize, row: usize) -> Cell {
        let part = self.parts.partition_point(|part| part.first <= row as u64) - 1;
        let part = &self.parts[part];
        part.row(row - part.first as usize).cell(place)
    }

    /// The values by which a row is told from others.
    fn key_values(&self, row: usize) -> Vec<f64> {
        (0..self.keys).map(|key| self.cell(key, row).number().unwrap_or(f64::NAN)).collect()
    }

    /// A row's key values, rounded to nine digits: grids of other counts meet in values that differ
    /// by rounding alone.
    pub(super) fn key(&self, row: usize) -> Vec<u64> {
        self.key_values(row).into_iter().map(rounded).collect()
    }

    fn least_ratio(&self, row: usize) -> Option<f64> {
        let ratios = self.columns().filter(|(_, column)| column.name.starts_with("ratio_"));
        ratios.filter_map(|(place, _)| self.cell(place, row).number()).reduce(f64::min)
    }

    /// A pair of rows as both files have it.
    pub(super) fn shared(&self, other: &Self, pair: [usize; 2]) -> SharedRow {
        let cells = |name: &str| {
            [(self, pair[0]), (other, pair[1])].map(|(side, row)| {
                side.place(name).map_or(Cell::Null, |place| side.cell(place, row))
            })
        };
        let numbers = |name: &str| cells(name).map(|cell| cell.number());
        let flags = |name: &str| cells(name).map(|cell| cell.flag());
        let verdicts = flags("reliable");
        let flip = match verdicts {
            [first, second] if first == second => Flip::None,
            [Some(true), Some(false)] => Flip::Lost,
            [Some(false), Some(true)] => Flip::Gained,
            _ => Flip::Defined,
        };
        SharedRow {
            rows: pair.map(|row| row as u64),
            place: self.key_values(pair[0]),
            ratio: numbers("ratio_max"),
            least_ratio: [self.least_ratio(pair[0]), other.least_ratio(pair[1])],
            gap_m: numbers("min_gap_nonlinear_m"),
            flip,
            is_lost: verdicts[0] == Some(true) && verdicts[1] != Some(true),
            sensitive: flags("sensitive").contains(&Some(true)),
            differs: false,
        }
    }
}

/// Nine digits of a number, as a key.
fn rounded(value: f64) -> u64 {
    let text = format!("{value:.8e}");
    let rounded: f64 = text.parse().unwrap_or(value);
    // Zero has two signs and is one value.
    (rounded + 0.0).to_bits()
}

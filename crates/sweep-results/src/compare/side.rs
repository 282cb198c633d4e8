//! The contents of one of the two compared files.

use super::{Flip, SharedRow};
use crate::error::ResultsError;
use sweep_files::{Cell, Column, ResultTable, Rows};

/// The greatest number of cells that are read of one file. Basis: a cell takes some 16 bytes, so
/// two files take a few gigabytes. Doubling it doubles that memory.
const MAX_CELLS: u64 = 100_000_000;

/// The columns of a file that take part in a comparison.
#[derive(Debug)]
pub(super) struct ComparedFile {
    /// The row groups: the key columns, further columns by which rows are matched, and the compared
    /// columns.
    row_groups: Vec<Rows>,
    /// The number of rows.
    pub(super) rows: usize,
    /// The number of key columns.
    key_count: usize,
    /// The positions of the columns by which rows are matched.
    matching_columns: Vec<usize>,
    /// The position of the first compared column.
    first_column: usize,
    /// The compared columns.
    columns: Vec<Column>,
}

/// Returns the columns that identify a file's rows.
pub(super) fn key_columns(table: &ResultTable, is_boundary: bool) -> Vec<String> {
    let mut names: Vec<&str> =
        table.key_columns().into_iter().filter(|name| *name != "point").collect();
    if names.contains(&"time_s") {
        // The speed follows from the time.
        names = vec!["time_s"];
    }
    if is_boundary {
        // Values along the second axis are results of the search, not keys.
        let second_axis = table.axes().get(1).map(|name| (*name).to_owned());
        names.retain(|name| Some(*name) != second_axis.as_deref());
    }
    names.into_iter().map(str::to_owned).collect()
}

/// Returns the value of a column that has the same value in all rows.
pub(super) fn find_single_value(
    table: &ResultTable,
    name: &str,
) -> Result<Option<f64>, ResultsError> {
    let mut value = None;
    for rows in table.file().read(&[name])? {
        let rows = rows?;
        for row in 0..rows.count {
            let row_value = rows.row(row).cell(0).number();
            if row_value.is_none() || value.is_some_and(|value| Some(value) != row_value) {
                return Ok(None);
            }
            value = row_value;
        }
    }
    Ok(value)
}

impl ComparedFile {
    /// Reads the columns that the other file has too.
    ///
    /// # Errors
    /// [`ResultsError::Refused`], [`ResultsError::File`].
    pub(super) fn read(
        table: &ResultTable,
        other_table: &ResultTable,
        keys: &[String],
        matching_columns: &[String],
    ) -> Result<Self, ResultsError> {
        let is_in_both = |column: &Column| {
            let counterpart = other_table.column(&column.name);
            let has_same_kind =
                counterpart.is_some_and(|counterpart| counterpart.kind == column.kind);
            has_same_kind && column.name != "point" && !keys.contains(&column.name)
        };
        let mut columns = table.columns.clone();
        columns.retain(is_in_both);
        let mut names: Vec<&str> = keys.iter().map(String::as_str).collect();
        let matching_names = matching_columns.iter().filter(|name| !keys.contains(name));
        names.extend(matching_names.map(String::as_str));
        let first_column = names.len();
        let column_position = |name: &String| names.iter().position(|read_name| read_name == name);
        let matching_columns = matching_columns.iter().filter_map(column_position).collect();
        names.extend(columns.iter().map(|column| column.name.as_str()));
        let cell_count = table.rows().saturating_mul(names.len() as u64);
        if cell_count > MAX_CELLS {
            return Err(ResultsError::Refused(format!(
                "{} has {cell_count} cells, more than the {MAX_CELLS} that are kept in memory",
                table.path().display()
            )));
        }
        let row_groups = table.file().read(&names)?.collect::<Result<Vec<Rows>, _>>()?;
        let row_count = row_groups.iter().map(|group| group.count).sum();
        Ok(Self {
            row_groups,
            rows: row_count,
            key_count: keys.len(),
            matching_columns,
            first_column,
            columns,
        })
    }

    /// Iterates over the columns, each with its position in [`ComparedFile::cell`].
    pub(super) fn columns(&self) -> impl Iterator<Item = (usize, &Column)> {
        (self.first_column..).zip(&self.columns)
    }

    /// Returns the position of the column of a name.
    pub(super) fn column_position(&self, name: &str) -> Option<usize> {
        self.columns().find(|(_, column)| column.name == name).map(|(position, _)| position)
    }

    /// Returns the cell of a row in the column at a position.
    pub(super) fn cell(&self, position: usize, row: usize) -> Cell {
        let group_index =
            self.row_groups.partition_point(|row_group| row_group.first_row <= row as u64) - 1;
        let row_group = &self.row_groups[group_index];
        row_group.row(row - row_group.first_row as usize).cell(position)
    }

    /// Returns the values of a row's key columns.
    fn key_values(&self, row: usize) -> Vec<f64> {
        (0..self.key_count).map(|key| self.number_or_nan(key, row)).collect()
    }

    /// Returns the number of a row in the column at a position, NaN where there is none.
    fn number_or_nan(&self, position: usize, row: usize) -> f64 {
        self.cell(position, row).number().unwrap_or(f64::NAN)
    }

    /// Returns the values by which a row is matched, rounded to nine digits, because grids with
    /// different numbers of values have common points whose values differ by rounding.
    pub(super) fn key(&self, row: usize) -> Vec<u64> {
        self.matching_columns
            .iter()
            .map(|&position| rounded_bits(self.number_or_nan(position, row)))
            .collect()
    }

    /// Returns the least of the ratios of a row's channels.
    fn least_ratio(&self, row: usize) -> Option<f64> {
        let ratios = self.columns().filter(|(_, column)| column.name.starts_with("ratio_"));
        ratios.filter_map(|(position, _)| self.cell(position, row).number()).reduce(f64::min)
    }

    /// Combines two matching rows: one of this file and one of the other.
    pub(super) fn shared_row(&self, other: &Self, pair: [usize; 2]) -> SharedRow {
        let pair_cells = |name: &str| {
            [(self, pair[0]), (other, pair[1])].map(|(file, row)| {
                file.column_position(name).map_or(Cell::Null, |position| file.cell(position, row))
            })
        };
        let pair_numbers = |name: &str| pair_cells(name).map(|cell| cell.number());
        let pair_flags = |name: &str| pair_cells(name).map(|cell| cell.flag());
        let verdicts = pair_flags("reliable");
        let flip = match verdicts {
            [first, second] if first == second => Flip::None,
            [Some(true), Some(false)] => Flip::Lost,
            [Some(false), Some(true)] => Flip::Gained,
            _ => Flip::Defined,
        };
        let key = self.key_values(pair[0]);
        let second_key = key.iter().zip(other.key_values(pair[1]));
        let second_key = second_key.map(|(&first, second)| {
            if rounded_bits(first) == rounded_bits(second) { first } else { second }
        });
        SharedRow {
            rows: pair.map(|row| row as u64),
            second_key: second_key.collect(),
            key,
            ratios: pair_numbers("ratio_max"),
            least_ratios: [self.least_ratio(pair[0]), other.least_ratio(pair[1])],
            gaps_m: pair_numbers("min_gap_nonlinear_m"),
            flip,
            is_lost: verdicts[0] == Some(true) && verdicts[1] != Some(true),
            is_sensitive: pair_flags("sensitive").contains(&Some(true)),
            differs: false,
        }
    }
}

/// Returns the bits of a number rounded to nine digits.
fn rounded_bits(value: f64) -> u64 {
    let rounded_text = format!("{value:.8e}");
    let rounded_value: f64 = rounded_text.parse().unwrap_or(value);
    // Adding zero makes -0 and 0 one value.
    (rounded_value + 0.0).to_bits()
}

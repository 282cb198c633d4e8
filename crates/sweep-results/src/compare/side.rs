//! One of two files, in memory.

use super::{Flip, SharedRow, is_compared};
use crate::error::ResultsError;
use crate::rows::{Cell, ResultTable};
use sweep_files::{CellKind, Column};

/// Most cells of a file that are kept: two files of so many take some gigabytes.
const MOST_CELLS: u64 = 100_000_000;

/// The cells of a column.
#[derive(Debug)]
pub(super) enum Cells {
    /// Missing ones are NaN.
    Numbers(Vec<f64>),
    /// Places among the names; missing ones are the greatest.
    Texts {
        names: Vec<String>,
        codes: Vec<u32>,
    },
    Flags(Vec<Option<bool>>),
}

impl Cells {
    pub(super) fn get(&self, row: usize) -> Cell {
        match self {
            Self::Numbers(cells) if cells[row].is_nan() => Cell::Null,
            Self::Numbers(cells) => Cell::Number(cells[row]),
            Self::Texts { names, codes } => {
                names.get(codes[row] as usize).map_or(Cell::Null, |name| Cell::Text(name.clone()))
            }
            Self::Flags(cells) => cells[row].map_or(Cell::Null, Cell::Flag),
        }
    }

    fn push(&mut self, cell: Cell) {
        match self {
            Self::Numbers(cells) => cells.push(cell.number().unwrap_or(f64::NAN)),
            Self::Flags(cells) => cells.push(cell.flag()),
            Self::Texts { names, codes } => codes.push(match cell {
                Cell::Text(text) => {
                    let known = names.iter().position(|name| *name == text);
                    let place = known.unwrap_or_else(|| {
                        names.push(text);
                        names.len() - 1
                    });
                    u32::try_from(place).unwrap_or(u32::MAX)
                }
                _ => u32::MAX,
            }),
        }
    }
}

/// The columns that take part in a comparison, and the keys of the rows.
#[derive(Debug)]
pub(super) struct Side {
    pub(super) rows: usize,
    keys: Vec<Vec<f64>>,
    pub(super) columns: Vec<(Column, Cells)>,
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
pub(super) fn only_value(table: &ResultTable, name: &str) -> Result<Option<f64>, ResultsError> {
    let mut value = None;
    for rows in table.read(&[name])? {
        let rows = rows?;
        for row in 0..rows.count {
            let found = rows.cell(0, row).number();
            match (value, found) {
                (_, None) => return Ok(None),
                (None, found) => value = found,
                (Some(value), Some(found)) if value != found => return Ok(None),
                _ => {}
            }
        }
    }
    Ok(value)
}

impl Side {
    /// Reads the columns that the other file has too.
    ///
    /// # Errors
    /// [`ResultsError::TooLarge`], [`ResultsError::File`].
    pub(super) fn read(
        table: &ResultTable,
        other: &ResultTable,
        keys: &[String],
    ) -> Result<Self, ResultsError> {
        let columns: Vec<&Column> = table
            .columns
            .iter()
            .filter(|column| is_compared(&column.name, keys))
            .filter(|column| {
                other.column(&column.name).is_some_and(|other| other.kind == column.kind)
            })
            .collect();
        let cells = table.rows().saturating_mul((columns.len() + keys.len()) as u64);
        if cells > MOST_CELLS {
            return Err(ResultsError::TooLarge {
                path: table.path().to_owned(),
                cells,
                most: MOST_CELLS,
            });
        }
        let names: Vec<&str> = keys
            .iter()
            .map(String::as_str)
            .chain(columns.iter().map(|column| column.name.as_str()))
            .collect();
        let new = |column: &&Column| {
            let cells = match column.kind {
                CellKind::Number => Cells::Numbers(Vec::new()),
                CellKind::Text => Cells::Texts { names: Vec::new(), codes: Vec::new() },
                CellKind::Flag => Cells::Flags(Vec::new()),
            };
            ((*column).clone(), cells)
        };
        let mut side = Self {
            rows: 0,
            keys: vec![Vec::new(); keys.len()],
            columns: columns.iter().map(new).collect(),
        };
        for rows in table.read(&names)? {
            let rows = rows?;
            for row in 0..rows.count {
                for (place, key) in side.keys.iter_mut().enumerate() {
                    key.push(rows.cell(place, row).number().unwrap_or(f64::NAN));
                }
                for (place, (_, cells)) in side.columns.iter_mut().enumerate() {
                    cells.push(rows.cell(keys.len() + place, row));
                }
            }
            side.rows += rows.count;
        }
        Ok(side)
    }

    /// A row's key values, rounded to nine digits: grids of other counts meet in values that differ
    /// by rounding alone.
    pub(super) fn key(&self, row: usize) -> Vec<u64> {
        self.keys.iter().map(|key| rounded(key[row])).collect()
    }

    fn cell(&self, name: &str, row: usize) -> Cell {
        let column = self.columns.iter().find(|(column, _)| column.name == name);
        column.map_or(Cell::Null, |(_, cells)| cells.get(row))
    }

    fn least_ratio(&self, row: usize) -> Option<f64> {
        let ratios = self.columns.iter().filter(|(column, _)| column.name.starts_with("ratio_"));
        ratios.filter_map(|(_, cells)| cells.get(row).number()).reduce(f64::min)
    }

    /// A pair of rows as both files have it.
    pub(super) fn shared(&self, other: &Self, pair: [usize; 2]) -> SharedRow {
        let cells = |name: &str| [self.cell(name, pair[0]), other.cell(name, pair[1])];
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
            place: self.keys.iter().map(|key| key[pair[0]]).collect(),
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

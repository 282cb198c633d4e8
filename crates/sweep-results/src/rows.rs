//! A result file as columns and rows.

use std::collections::HashMap;
use std::path::Path;

use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::ArrowError;
use serde::Serialize;
use serde_json::Value;
use sweep_files::{CellKind, Column, FileError, ParquetFile, cells, columns, key};
use sweep_parameter::RatioLimits;

use crate::error::ResultsError;

/// One cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Cell {
    /// No value; a number that is none counts as such.
    Null,
    /// A number.
    Number(f64),
    /// Words.
    Text(String),
    /// True or false.
    Flag(bool),
}

impl Cell {
    /// Whether it is true or false, if it is either.
    pub const fn flag(&self) -> Option<bool> {
        let Self::Flag(flag) = self else { return None };
        Some(*flag)
    }

    /// The number, if it is one.
    pub const fn number(&self) -> Option<f64> {
        let Self::Number(number) = self else { return None };
        Some(*number)
    }
}

/// The limits of a plan's ratios.
pub fn ratio_limits(plan: &Value) -> Option<RatioLimits> {
    let reliability = &plan["reliability"];
    let most = reliability["ratio_limit"].as_f64()?;
    Some(RatioLimits { most, least: reliability["ratio_min"].as_f64() })
}

/// An open result file of any kind.
#[derive(Debug)]
pub struct ResultTable {
    /// Its columns in file order, without those of types that none of our files has.
    pub columns: Vec<Column>,
    /// The grid as run, the machine and the method, if it carries them.
    pub plan: Option<Value>,
    file: ParquetFile,
}

impl ResultTable {
    /// Opens a file.
    ///
    /// # Errors
    /// [`ResultsError::File`].
    pub fn open(path: &Path) -> Result<Self, ResultsError> {
        Ok(Self::of(ParquetFile::open(path)?))
    }

    /// The columns of an open file.
    pub fn of(file: ParquetFile) -> Self {
        let columns = columns(file.schema());
        let plan = file.json(key::PLAN);
        Self { columns, plan, file }
    }

    /// The file.
    pub const fn file(&self) -> &ParquetFile {
        &self.file
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// How many rows it has.
    pub fn rows(&self) -> u64 {
        self.file.rows()
    }

    /// The column of that name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }

    /// The names of the swept parameters that have a column: of a map all, in order.
    pub fn axes(&self) -> Vec<&str> {
        let planned = self.plan.as_ref().and_then(|plan| plan["axis"].as_array());
        if let Some(axes) = planned {
            let names = axes.iter().filter_map(|axis| axis["parameter"].as_str());
            return names.filter_map(|name| Some(self.column(name)?.name.as_str())).collect();
        }
        // Files that have been through other programs have lost the plan.
        let of_model = |name: &str| name.starts_with("nonlinear_") || name.starts_with("linear_");
        let before = self.columns.iter().take_while(|column| !of_model(&column.name));
        if self.column("ratio_max").is_none() {
            return Vec::new();
        }
        before
            .filter(|column| column.is_number() && column.name != "point")
            .map(|column| column.name.as_str())
            .collect()
    }

    /// The names of the columns that say where a row is: the point's index, the axes, and what
    /// counts on along them in files that are no maps.
    pub fn places(&self) -> Vec<&str> {
        let further = ["crossing", "speed_rpm", "branch", "motion", "mode", "time_s"];
        let mut names: Vec<&str> = ["point"].into_iter().chain(self.axes()).collect();
        names.extend(further.into_iter().filter(|name| !names.contains(name)).collect::<Vec<_>>());
        names.retain(|name| self.column(name).is_some());
        names
    }

    /// Reads the named columns, batch by batch. A name that the file lacks gives no column.
    ///
    /// # Errors
    /// [`ResultsError::File`].
    pub fn read(
        &self,
        names: &[&str],
    ) -> Result<impl Iterator<Item = Result<Rows, ResultsError>> + use<'_>, ResultsError> {
        let chosen: Vec<&Column> = names.iter().filter_map(|name| self.column(name)).collect();
        let kinds: Vec<CellKind> = chosen.iter().map(|column| column.kind).collect();
        let batches = self.file.rows_of(&chosen)?;
        let mut first = 0;
        Ok(batches.map(move |batch| {
            let (count, cells) = batch?;
            let columns = cells.iter().zip(&kinds).map(|(cells, kind)| decode(cells, *kind));
            let columns: Result<_, _> = columns.collect();
            let rows =
                Rows { first, count, columns: columns.map_err(FileError::cells(self.path()))? };
            first += count as u64;
            Ok(rows)
        }))
    }
}

/// Some rows of some columns.
#[derive(Debug, Default)]
pub struct Rows {
    /// Number of the first of them in the file, from 0.
    pub first: u64,
    /// How many there are.
    pub count: usize,
    columns: Vec<Cells>,
}

impl Rows {
    /// These columns of rows in memory.
    pub(crate) fn of(batch: &RecordBatch, columns: &[Column]) -> Result<Self, ArrowError> {
        let decoded = |column: &Column| decode(batch.column(column.field), column.kind);
        let columns = columns.iter().map(decoded).collect::<Result<_, _>>()?;
        Ok(Self { first: 0, count: batch.num_rows(), columns })
    }

    /// The cell of a row in the `column`-th of the columns that were asked for.
    pub fn cell(&self, column: usize, row: usize) -> Cell {
        self.columns.get(column).map_or(Cell::Null, |cells| cells.get(row))
    }

    /// Takes up further rows of these columns.
    pub(crate) fn extend(&mut self, further: Self) {
        self.count += further.count;
        if self.columns.is_empty() {
            self.columns = further.columns;
            return;
        }
        for (cells, further) in self.columns.iter_mut().zip(further.columns) {
            cells.extend(further);
        }
    }
}

/// The cells of a column.
#[derive(Debug)]
enum Cells {
    /// Missing ones are NaN.
    Numbers(Vec<f64>),
    /// Few words are many rows' word: places among the names; missing ones are the greatest.
    Texts {
        names: Vec<String>,
        codes: Vec<u32>,
    },
    Flags(Vec<Option<bool>>),
}

impl Cells {
    fn get(&self, row: usize) -> Cell {
        match self {
            Self::Numbers(cells) if cells[row].is_nan() => Cell::Null,
            Self::Numbers(cells) => Cell::Number(cells[row]),
            Self::Texts { names, codes } => {
                names.get(codes[row] as usize).map_or(Cell::Null, |name| Cell::Text(name.clone()))
            }
            Self::Flags(cells) => cells[row].map_or(Cell::Null, Cell::Flag),
        }
    }

    fn extend(&mut self, further: Self) {
        match (self, further) {
            (Self::Numbers(cells), Self::Numbers(further)) => cells.extend(further),
            (Self::Flags(cells), Self::Flags(further)) => cells.extend(further),
            (Self::Texts { names, codes }, Self::Texts { names: words, codes: further }) => {
                let place = |word: String| {
                    let known = names.iter().position(|name| *name == word);
                    known.unwrap_or_else(|| {
                        names.push(word);
                        names.len() - 1
                    })
                };
                let places: Vec<u32> = words.into_iter().map(place).map(code).collect();
                let place = |code: u32| places.get(code as usize).copied().unwrap_or(u32::MAX);
                codes.extend(further.into_iter().map(place));
            }
            // A column is of one kind.
            _ => {}
        }
    }
}

/// A place among names.
fn code(place: usize) -> u32 {
    u32::try_from(place).unwrap_or(u32::MAX)
}

fn decode(array: &ArrayRef, kind: CellKind) -> Result<Cells, ArrowError> {
    Ok(match kind {
        CellKind::Number => {
            let cells = cells::numbers(array)?.into_iter();
            Cells::Numbers(cells.map(|cell| cell.unwrap_or(f64::NAN)).collect())
        }
        CellKind::Flag => Cells::Flags(cells::flags(array)?.iter().collect()),
        CellKind::Text => {
            let mut names: Vec<String> = Vec::new();
            // Keyed by place: the words of a batch lie there once, and may be long.
            let mut places = HashMap::new();
            let mut place = |word: &str| {
                *places.entry((word.as_ptr(), word.len())).or_insert_with(|| {
                    names.push(word.to_owned());
                    code(names.len() - 1)
                })
            };
            let words = cells::texts(array)?.into_iter();
            let codes = words.map(|word| word.map_or(u32::MAX, &mut place)).collect();
            Cells::Texts { names, codes }
        }
    })
}

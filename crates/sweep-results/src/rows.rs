//! A result file as columns and rows.

use std::collections::HashMap;
use std::path::Path;

use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::ArrowError;
use serde::{Serialize, Serializer};
use serde_json::Value;
use sweep_files::{CellKind, Column, FileError, ParquetFile, cells, columns, key};
use sweep_parameter::RatioLimits;

use crate::error::ResultsError;

/// One cell.
#[derive(Clone, Debug, PartialEq)]
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
        match self {
            Self::Flag(flag) => Some(*flag),
            _ => None,
        }
    }

    /// The number, if it is one.
    pub const fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            _ => None,
        }
    }
}

impl Serialize for Cell {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Null => serializer.serialize_none(),
            Self::Number(number) => serializer.serialize_f64(*number),
            Self::Text(text) => serializer.serialize_str(text),
            Self::Flag(flag) => serializer.serialize_bool(*flag),
        }
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
#[derive(Debug)]
pub struct Rows {
    /// Number of the first of them in the file, from 0.
    pub first: u64,
    /// How many there are.
    pub count: usize,
    columns: Vec<Decoded>,
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
        match self.columns.get(column) {
            Some(Decoded::Numbers(cells)) => {
                cells[row].filter(|number| !number.is_nan()).map_or(Cell::Null, Cell::Number)
            }
            Some(Decoded::Texts { names, codes }) => {
                codes[row].map_or(Cell::Null, |code| Cell::Text(names[code].clone()))
            }
            Some(Decoded::Flags(cells)) => cells[row].map_or(Cell::Null, Cell::Flag),
            None => Cell::Null,
        }
    }
}

/// The cells of a batch's column.
#[derive(Debug)]
enum Decoded {
    Numbers(Vec<Option<f64>>),
    /// Few words are many rows' word.
    Texts {
        names: Vec<String>,
        codes: Vec<Option<usize>>,
    },
    Flags(Vec<Option<bool>>),
}

fn decode(array: &ArrayRef, kind: CellKind) -> Result<Decoded, ArrowError> {
    Ok(match kind {
        CellKind::Number => Decoded::Numbers(cells::numbers(array)?),
        CellKind::Flag => Decoded::Flags(cells::flags(array)?.iter().collect()),
        CellKind::Text => {
            let mut names: Vec<String> = Vec::new();
            // Keyed by place: the words of a batch lie there once, and may be long.
            let mut places = HashMap::new();
            let mut code = |word: &str| {
                *places.entry((word.as_ptr(), word.len())).or_insert_with(|| {
                    names.push(word.to_owned());
                    names.len() - 1
                })
            };
            let codes = cells::texts(array)?.into_iter().map(|word| word.map(&mut code)).collect();
            Decoded::Texts { names, codes }
        }
    })
}

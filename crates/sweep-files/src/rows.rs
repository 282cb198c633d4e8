//! A result file as columns and rows.

use std::collections::BTreeMap;
use std::path::Path;

use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array, ArrayRef, Int32Array, RecordBatch, StringArray};
use arrow_schema::ArrowError;
use serde::Serialize;
use serde_json::Value;
use sweep_parameter::RatioLimits;

use crate::{CellKind, Column, FileError, ParquetFile, cells, columns, key};

/// The value of a column in a row.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Cell {
    /// No value, or a number that is NaN.
    Null,
    /// A number; in JSON, whole numbers have no decimal point.
    Number(#[serde(serialize_with = "serialize_without_point")] f64),
    /// Words.
    Text(String),
    /// True or false.
    Flag(bool),
}

impl Cell {
    /// Returns the cell's truth value, if it is one.
    pub const fn flag(&self) -> Option<bool> {
        let Self::Flag(flag) = self else { return None };
        Some(*flag)
    }

    /// Returns the cell's number, if it is one.
    pub const fn number(&self) -> Option<f64> {
        let Self::Number(number) = self else { return None };
        Some(*number)
    }
}

fn serialize_without_point<S: serde::Serializer>(
    number: &f64,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let integer = *number as i64;
    // An f64 holds every whole number up to 2^53.
    let is_integer = integer as f64 == *number && number.abs() < 2_f64.powi(53);
    if is_integer { serializer.serialize_i64(integer) } else { serializer.serialize_f64(*number) }
}

/// Returns the limits of ratios in a plan.
pub fn ratio_limits(plan: &Value) -> Option<RatioLimits> {
    let reliability = &plan["reliability"];
    let upper_limit = reliability["ratio_limit"].as_f64()?;
    Some(RatioLimits { upper: upper_limit, lower: reliability["ratio_min"].as_f64() })
}

/// An open result file of any kind.
#[derive(Debug)]
pub struct ResultTable {
    /// The columns that have a supported type, in the order of the file.
    pub columns: Vec<Column>,
    /// The plan in the file's metadata: the grid as run, the machine and the method.
    pub plan: Option<Value>,
    file: ParquetFile,
}

impl ResultTable {
    /// Opens a file.
    ///
    /// # Errors
    /// Those of [`ParquetFile::open`].
    pub fn open(path: &Path) -> Result<Self, FileError> {
        Ok(Self::from_file(ParquetFile::open(path)?))
    }

    /// Makes the table of an open file.
    pub fn from_file(file: ParquetFile) -> Self {
        let columns = columns(file.schema());
        let plan = file.json(key::PLAN);
        Self { columns, plan, file }
    }

    /// Returns the file.
    pub const fn file(&self) -> &ParquetFile {
        &self.file
    }

    /// Returns the path.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// Returns the number of rows.
    pub fn rows(&self) -> u64 {
        self.file.rows()
    }

    /// Finds the column of a name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }

    /// Returns the names of the swept parameters that have a column, in order; in a map, all have
    /// one.
    pub fn axes(&self) -> Vec<&str> {
        let planned_axes = self.plan.as_ref().and_then(|plan| plan["axis"].as_array());
        if let Some(axes) = planned_axes {
            let axis_names = axes.iter().filter_map(|axis| axis["parameter"].as_str());
            return axis_names.filter_map(|name| Some(self.column(name)?.name.as_str())).collect();
        }
        // Files that other programs have rewritten lack the plan.
        let is_amplitude =
            |name: &str| name.starts_with("nonlinear_") || name.starts_with("linear_");
        let columns_before_results =
            self.columns.iter().take_while(|column| !is_amplitude(&column.name));
        if self.column("ratio_max").is_none() {
            return Vec::new();
        }
        columns_before_results
            .filter(|column| column.is_number() && column.name != "point")
            .map(|column| column.name.as_str())
            .collect()
    }

    /// Returns the names of the columns that identify a row: the point's index, the axes, and in
    /// results other than maps the further columns that number their rows.
    pub fn key_columns(&self) -> Vec<&str> {
        let further_key_columns = ["crossing", "speed_rpm", "branch", "motion", "mode", "time_s"];
        let mut names: Vec<&str> = ["point"].into_iter().chain(self.axes()).collect();
        names.extend(
            further_key_columns
                .into_iter()
                .filter(|name| !names.contains(name))
                .collect::<Vec<_>>(),
        );
        names.retain(|name| self.column(name).is_some());
        names
    }
}

impl ParquetFile {
    /// Reads the rows batch by batch, with the columns of these names. A column that the file lacks
    /// is null.
    ///
    /// # Errors
    /// [`FileError::Io`], [`FileError::NotParquet`].
    pub fn read(
        &self,
        column_names: &[&str],
    ) -> Result<impl Iterator<Item = Result<Rows, FileError>> + use<'_>, FileError> {
        let all_columns = columns(self.schema());
        let find_by_name = |name: &&str| all_columns.iter().find(|column| column.name == **name);
        let requested_columns: Vec<Option<&Column>> =
            column_names.iter().map(find_by_name).collect();
        // A column that is named twice is decoded once.
        let fields: BTreeMap<usize, CellKind> =
            requested_columns.iter().flatten().map(|column| (column.field, column.kind)).collect();
        let position_in_batch =
            |column: &Column| fields.keys().position(|field| *field == column.field);
        let positions_in_batch: Vec<Option<usize>> =
            requested_columns.iter().map(|column| position_in_batch((*column)?)).collect();
        let batches = self.batches(fields.keys().copied().collect())?;
        let mut first_row = 0;
        Ok(batches.map(move |batch| {
            let batch = batch?;
            let cell_columns = batch.columns().iter().zip(fields.values());
            let cell_columns =
                cell_columns.map(|(cells, kind)| decode(cells, *kind)).collect::<Result<_, _>>();
            let cell_columns = cell_columns.map_err(FileError::cells(self.path()))?;
            let rows = Rows {
                first_row,
                count: batch.num_rows(),
                column_positions: positions_in_batch.clone(),
                columns: cell_columns,
            };
            first_row += rows.count as u64;
            Ok(rows)
        }))
    }

    /// Calls `take` for each row, with the columns of these names. A column that the file lacks is
    /// null.
    ///
    /// # Errors
    /// Those of [`ParquetFile::read`], and those of `take`.
    pub fn each_row<E: From<FileError>>(
        &self,
        column_names: &[&str],
        mut take: impl FnMut(Row<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        for rows in self.read(column_names)? {
            let rows = rows?;
            (0..rows.count).try_for_each(|row_index| take(rows.row(row_index)))?;
        }
        Ok(())
    }
}

/// Some rows of some columns.
#[derive(Debug)]
pub struct Rows {
    /// The number of the first row in the file, from 0.
    pub first_row: u64,
    /// The number of rows.
    pub count: usize,
    /// The index in `columns` of each requested column, if the file has it.
    column_positions: Vec<Option<usize>>,
    columns: Vec<Cells>,
}

impl Rows {
    /// Decodes these columns of a batch in memory.
    ///
    /// # Errors
    /// Fails if the batch's columns have other types.
    pub fn from_batch(batch: &RecordBatch, columns: &[Column]) -> Result<Self, ArrowError> {
        let decode_column = |column: &Column| decode(batch.column(column.field), column.kind);
        let columns = columns.iter().map(decode_column).collect::<Result<Vec<_>, _>>()?;
        let column_positions = (0..columns.len()).map(Some).collect();
        Ok(Self { first_row: 0, count: batch.num_rows(), column_positions, columns })
    }

    /// Returns a row.
    pub const fn row(&self, row_index: usize) -> Row<'_> {
        Row { rows: self, row_index }
    }
}

/// A row, whose cells are in the order of the requested columns.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    rows: &'a Rows,
    row_index: usize,
}

impl<'a> Row<'a> {
    /// Returns the row's index in the file, from 0.
    pub const fn index(self) -> u64 {
        self.rows.first_row + self.row_index as u64
    }

    #[inline]
    fn column_cells(self, column: usize) -> Option<&'a Cells> {
        self.rows.column_positions[column].map(|position| &self.rows.columns[position])
    }

    /// Returns the cell of a column.
    pub fn cell(self, column: usize) -> Cell {
        match self.column_cells(column) {
            Some(Cells::Numbers(cells)) if cells[self.row_index].is_nan() => Cell::Null,
            Some(Cells::Numbers(cells)) => Cell::Number(cells[self.row_index]),
            Some(Cells::Flags(cells)) => cells[self.row_index].map_or(Cell::Null, Cell::Flag),
            _ => self.word(column).map_or(Cell::Null, |word| Cell::Text(word.to_owned())),
        }
    }

    /// Returns the number in a column, NaN if there is none.
    #[inline]
    pub fn value(self, column: usize) -> f64 {
        let Some(Cells::Numbers(cells)) = self.column_cells(column) else { return f64::NAN };
        cells[self.row_index]
    }

    /// Returns the word in a column; a truth value is a word too.
    #[inline]
    pub fn word(self, column: usize) -> Option<&'a str> {
        match self.column_cells(column)? {
            Cells::Words(word_indices, words) => {
                let word_index = word_indices
                    .is_valid(self.row_index)
                    .then(|| word_indices.value(self.row_index))?;
                Some(words.value(word_index as usize))
            }
            Cells::Flags(cells) => {
                cells[self.row_index].map(|flag| if flag { "true" } else { "false" })
            }
            Cells::Numbers(_) => None,
        }
    }
}

/// The cells of a column.
#[derive(Debug)]
enum Cells {
    /// Numbers, with NaN for missing ones.
    Numbers(Vec<f64>),
    /// The index of each row's word in the list of distinct words, and this list.
    Words(Int32Array, StringArray),
    Flags(Vec<Option<bool>>),
}

fn decode(array: &ArrayRef, kind: CellKind) -> Result<Cells, ArrowError> {
    Ok(match kind {
        CellKind::Number => Cells::Numbers(match array.as_primitive_opt::<Float64Type>() {
            Some(whole) if whole.null_count() == 0 => whole.values().to_vec(),
            _ => {
                let cells = cells::numbers(array)?.into_iter();
                cells.map(|cell| cell.unwrap_or(f64::NAN)).collect()
            }
        }),
        CellKind::Flag => Cells::Flags(cells::flags(array)?.iter().collect()),
        CellKind::Text => {
            let dictionary = cells::words(array)?;
            Cells::Words(dictionary.keys().clone(), dictionary.values().clone())
        }
    })
}

//! Lists of points: files whose columns are parameters and whose rows are points.
//!
//! A list is read into memory as a whole. The bytes of its file, packed and unpacked, and the
//! numbers in it are bounded; each bound is checked before the memory is taken.

mod csv;
mod notation;
mod parquet;

use std::io::Read as _;
use std::path::Path;

use super::report::{Diagnostic, Report};
use super::section::cut;
use super::source::{Located, Location, SourceId, Sources, beside};
use crate::design::Design;
use sweep_files::regular;

/// Longest list that is read, in bytes; and so of a Parquet file's pages unpacked.
const LONGEST_BYTES: u64 = 256 << 20;
/// Most numbers of a list.
const MOST_NUMBERS: u64 = 20_000_000;
/// Most columns of a list.
const MOST_COLUMNS: usize = 1000;
/// Most characters of a path in a message.
const LONGEST_PATH: usize = 1000;

/// Name of a column that is no parameter: it tells people which row is which.
pub(super) const ID: &str = "id";

/// A table of numbers in a file of its own, whatever they are; NaN where a value is missing.
pub struct NumberTable {
    /// Its columns, all of one length.
    pub columns: Vec<ListColumn>,
    rows: Rows,
}

impl NumberTable {
    /// Reads a CSV or Parquet file of numbers; `None` after mistakes, which are reported.
    pub fn read(path: &Path, report: &Report) -> Option<Self> {
        let shown = shown(path);
        let file = Location::new(report.add(shown.as_str(), String::new()), 0..0);
        match table(path, &file, true, report) {
            Ok((table, _)) => report.is_clean().then_some(table),
            Err(reason) => {
                let title = format!("cannot read {shown}: {reason}");
                let help = "expected a CSV or Parquet file of numbers under a line of names";
                report.push(Diagnostic::new(title).help(help));
                None
            }
        }
    }

    /// A table in memory, which messages call so.
    pub fn of_columns(name: &str, columns: Vec<(String, Vec<f64>)>, report: &Report) -> Self {
        let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
        let (source, places) = report.header(name, &names);
        let located = |((value, values), at)| ListColumn { name: Located { value, at }, values };
        let columns = columns.into_iter().zip(places).map(located).collect();
        Self { columns, rows: Rows::Binary(Location::new(source, 0..0)) }
    }

    /// Whether a value was refused when it was read.
    pub fn is_refused(&self, value: f64) -> bool {
        matches!(self.rows, Rows::Lines { .. }) && value.is_nan()
    }

    /// The place of a value, both counted from 0.
    pub fn place(&self, sources: &Sources, column: usize, row: usize) -> Location {
        match &self.rows {
            Rows::Binary(at) => at.clone(),
            Rows::Lines { source, starts, separator } => {
                let start = starts.get(row).map_or(0, |&start| start as usize);
                let span = csv::cell_span(sources.text(*source), start, *separator, column);
                Location::new(*source, span)
            }
        }
    }
}

/// A list of points.
pub struct List {
    /// The design of its points.
    pub design: Design,
    /// Its parameters with their values.
    pub table: NumberTable,
}

/// A column of numbers.
pub struct ListColumn {
    /// Its name, with its place.
    pub name: Located<String>,
    /// Row by row.
    pub values: Vec<f64>,
}

/// The places of rows.
enum Rows {
    /// In lines of a text that begin at these bytes.
    Lines { source: SourceId, starts: Vec<u32>, separator: char },
    /// In no text; the file is named here.
    Binary(Location),
}

/// Why a file is no list.
type Unreadable = String;

/// A path in a message.
fn shown(path: &Path) -> String {
    cut(&path.display().to_string(), LONGEST_PATH)
}

/// The table of a file, and the hash of its bytes; mistakes are reported. The file is named at
/// `file`. With `gaps`, a missing value is NaN; else that is one that was refused.
fn table(
    path: &Path,
    file: &Location,
    gaps: bool,
    report: &Report,
) -> Result<(NumberTable, String), Unreadable> {
    let bytes = bytes(path)?;
    let hash = blake3::hash(&bytes).to_hex().to_string();
    if bytes.starts_with(b"PAR1") {
        let columns = parquet::columns(bytes, gaps)?;
        let located = |value| Located { value, at: file.clone() };
        let column = |(name, values)| ListColumn { name: located(name), values };
        let columns = columns.into_iter().map(column).collect();
        return Ok((NumberTable { columns, rows: Rows::Binary(file.clone()) }, hash));
    }
    let text = String::from_utf8(bytes)
        .map_err(|error| error.utf8_error().valid_up_to() + 1)
        .map_err(|byte| format!("it is neither Parquet nor UTF-8 text: byte {byte} is wrong"))?;
    // Messages quote the text when all is read; until then it is held here.
    let source = report.add(shown(path), String::new());
    let read = csv::read(&text, source, gaps, report);
    report.fill(source, text);
    let (columns, starts, separator) = read?;
    Ok((NumberTable { columns, rows: Rows::Lines { source, starts, separator } }, hash))
}

/// Reads the listed points.
pub(super) fn read(file: &str, grid: &Path, report: &Report) -> Option<List> {
    let path = beside(grid, file);
    let at = report.place("design.file")?;
    let shown = shown(&path);
    let (table, hash) = match table(&path, &at, false, report) {
        Ok(read) => read,
        Err(reason) => {
            let title = format!("cannot read the list of points {shown}: {reason}");
            let expected = "expected a CSV or Parquet file of numbers, one column a parameter, \
                relative to this file";
            return report.refuse(&at, title, expected);
        }
    };
    let points = table.columns.first().map_or(0, |column| column.values.len());
    if points == 0 && !report.is_clean() {
        return None;
    }
    if points == 0 {
        let title = format!("the list of points {shown} is empty");
        let expected = "expected a line of parameter names, and under it a row of numbers a point";
        return report.refuse(&at, title, expected);
    }
    if table.columns.iter().all(|column| column.name.value == ID) {
        let title = format!("the list of points {shown} has no column but `{ID}`");
        return report.refuse(&at, title, "expected a column of a parameter");
    }
    let design = Design::List { file: file.to_owned(), points: points as u64, hash };
    Some(List { design, table })
}

fn bytes(path: &Path) -> Result<Vec<u8>, Unreadable> {
    let mut bytes = Vec::new();
    let read = regular::open(path)
        .and_then(|file| file.take(LONGEST_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|error| error.to_string())?;
    match read as u64 > LONGEST_BYTES {
        true => Err(format!("it is longer than {} MiB", LONGEST_BYTES >> 20)),
        false => Ok(bytes),
    }
}

/// Whether so many rows of so many columns are accepted.
fn fits(rows: u64, columns: usize) -> Result<(), Unreadable> {
    if columns > MOST_COLUMNS {
        return Err(format!("it has {columns} columns, more than {MOST_COLUMNS}"));
    }
    match rows.checked_mul(columns as u64) {
        Some(0..=MOST_NUMBERS) => Ok(()),
        _ => Err(format!("it holds more than {MOST_NUMBERS} numbers")),
    }
}

#[cfg(test)]
mod tests;

//! Lists of points: files whose columns are parameters and whose rows are points.
//!
//! A list is read into memory as a whole. The bytes of its file, packed and unpacked, and the
//! numbers in it are bounded; each bound is checked before the memory is taken.

mod clock;
mod csv;
mod layout;
mod names;
mod notation;
mod parquet;
mod text;
mod units;

use std::io::Read as _;
use std::path::Path;

use super::report::{Diagnostic, Report};
use super::section::{counted, cut, quoted};
use super::source::{Located, Location, SourceId, Sources, beside};
use crate::design::Design;
use layout::Line;
use sweep_files::regular;

pub use names::Names;

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

/// Names of the columns in which programs number rows, beside those without a name.
const INDEX: [&str; 3] = ["__index_level_0__", "Unnamed: 0", "index"];

/// Whether a column of this name only numbers rows.
pub fn is_index(name: &str) -> bool {
    name.is_empty() || INDEX.contains(&name)
}

/// A table of numbers in a file of its own, whatever they are; NaN where a value is missing.
pub struct NumberTable {
    /// Its columns: those that are known, all of one length, and those that are left out.
    pub columns: Vec<ListColumn>,
    rows: Rows,
    /// Lines before the line of names.
    preamble: usize,
}

impl NumberTable {
    /// Reads a CSV or Parquet file of numbers; `None` after mistakes, which are reported.
    pub fn read(path: &Path, names: &Names<'_>, report: &Report) -> Option<Self> {
        let shown = shown(path);
        let file = Location::new(report.add(shown.as_str(), String::new()), 0..0);
        match table(path, &file, true, names, report) {
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
    pub fn of_columns(
        name: &str,
        columns: Vec<(String, Vec<f64>)>,
        names: &Names<'_>,
        report: &Report,
    ) -> Self {
        let headers: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
        let (source, places) = report.header(name, &headers);
        let mut table = Vec::new();
        for (place, ((header, values), at)) in columns.into_iter().zip(places).enumerate() {
            let found = names.find(&header, None).unwrap_or_else(|[title, expected]| {
                report.refuse::<()>(&at, title, expected);
                None
            });
            let is_known = found.is_some();
            let (value, values) = match found {
                Some(found) => {
                    let values = values.into_iter().map(|value| found.scale.apply(value));
                    (found.name, values.collect())
                }
                None => (header.clone(), Vec::new()),
            };
            let name = Located { value, at };
            table.push(ListColumn { name, header, place, is_known, values });
        }
        Self { columns: table, rows: Rows::Binary(Location::new(source, 0..0)), preamble: 0 }
    }

    /// Whether a value was refused when it was read.
    pub fn is_refused(&self, value: f64) -> bool {
        matches!(self.rows, Rows::Lines { .. }) && value.is_nan()
    }

    /// The place of a value: of a column by its place in the file, of a row from 0.
    pub fn place(&self, sources: &Sources, column: usize, row: usize) -> Location {
        match &self.rows {
            Rows::Binary(at) => at.clone(),
            Rows::Lines { source, starts, separator } => {
                let start = starts.get(row).map_or(0, |&start| start as usize);
                let line = Line::at(sources.text(*source), start);
                let span = line.cells(*separator).nth(column).map(|(_, at)| at);
                Location::new(*source, span.unwrap_or(start..start))
            }
        }
    }

    /// Returns what was read otherwise than it stands, or not at all, a line each.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.preamble > 0 {
            notes.push(format!("{} before the names left out", counted(self.preamble, "line")));
        }
        let left_out: Vec<String> =
            self.columns.iter().filter(|it| !it.is_known).map(|it| quoted(&it.header)).collect();
        if !left_out.is_empty() {
            let (few, more) = left_out.split_at(left_out.len().min(MOST_NAMED));
            let more = if more.is_empty() { "" } else { ", ..." };
            let columns = if left_out.len() == 1 { "the column" } else { "the columns" };
            notes.push(format!("left out {columns} {}{more}", few.join(", ")));
        }
        let renamed = self.columns.iter().filter(|it| it.is_known && it.header != it.name.value);
        let renamed = renamed.map(|it| format!("{} is {}", quoted(&it.header), it.name.value));
        let renamed: Vec<String> = renamed.collect();
        if !renamed.is_empty() {
            notes.push(renamed.join(", "));
        }
        notes
    }
}

/// Columns that a note names; more are said to be there.
const MOST_NAMED: usize = 8;

/// A list of points.
pub struct List {
    /// The design of its points.
    pub design: Design,
    /// Its parameters with their values.
    pub table: NumberTable,
}

/// A column of numbers.
pub struct ListColumn {
    /// The name of what it holds, with the header's place.
    pub name: Located<String>,
    /// The name in the file.
    pub header: String,
    /// The place in the file, from 0.
    pub place: usize,
    /// Whether the reader knows the name; else there are no values.
    pub is_known: bool,
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
    names: &Names<'_>,
    report: &Report,
) -> Result<(NumberTable, String), Unreadable> {
    let bytes = bytes(path)?;
    let hash = blake3::hash(&bytes).to_hex().to_string();
    if bytes.starts_with(b"PAR1") {
        let mut columns = Vec::new();
        for (place, read) in parquet::columns(bytes, gaps, names)?.into_iter().enumerate() {
            let parquet::Column { name, header, values } = read;
            let name = Located { value: name, at: file.clone() };
            let is_known = values.is_some();
            let values = values.unwrap_or_default();
            columns.push(ListColumn { name, header, place, is_known, values });
        }
        return Ok((NumberTable { columns, rows: Rows::Binary(file.clone()), preamble: 0 }, hash));
    }
    let text = text::text(bytes)?;
    // Messages quote the text when all is read; until then it is held here.
    let source = report.add(shown(path), String::new());
    let read = csv::read(&text, source, gaps, names, report);
    report.fill(source, text);
    let csv::Read { columns, starts, separator, preamble } = read?;
    Ok((NumberTable { columns, rows: Rows::Lines { source, starts, separator }, preamble }, hash))
}

/// Reads the listed points.
pub(super) fn read(file: &str, grid: &Path, names: &Names<'_>, report: &Report) -> Option<List> {
    let path = beside(grid, file);
    let at = report.place("design.file")?;
    let shown = shown(&path);
    let (table, hash) = match table(&path, &at, false, names, report) {
        Ok(read) => read,
        Err(reason) => {
            let title = format!("cannot read the list of points {shown}: {reason}");
            let expected = "expected a CSV or Parquet file of numbers, one column a parameter, \
                relative to this file";
            return report.refuse(&at, title, expected);
        }
    };
    let points = table.columns.iter().map(|column| column.values.len()).max().unwrap_or_default();
    if points == 0 && !report.is_clean() {
        return None;
    }
    let is_parameter = |column: &ListColumn| column.is_known && column.name.value != ID;
    let has_parameter = table.columns.iter().any(is_parameter);
    let has_unknown = table.columns.iter().any(|column| !column.is_known);
    if points == 0 && (has_parameter || !has_unknown) {
        let title = format!("the list of points {shown} is empty");
        let expected = "expected a line of parameter names, and under it a row of numbers a point";
        return report.refuse(&at, title, expected);
    }
    // What is wrong with unknown names is said when they are looked for.
    if !has_parameter && !has_unknown {
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

//! Lists of points: files whose columns are parameters and whose rows are points.
//!
//! A list is read into memory as a whole. The size of its file, compressed and decompressed, and
//! the number of its values are bounded; each bound is checked before memory is allocated.

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
use super::section::{format_count, quote, truncate};
use super::source::{Located, Location, SourceId, Sources, resolve_beside};
use crate::design::Design;
use layout::TextLine;
use sweep_files::regular;

pub use names::{ANY_UNIT, ColumnNames};

/// Maximum size of a list, bytes. Basis: it holds the maximum number of values. Doubling it doubles
/// the memory of a list.
const MAX_LIST_BYTES: u64 = 256 << 20;
/// Maximum number of values of a list. Basis: they take 160 MB of memory. Doubling it doubles that
/// memory.
const MAX_NUMBERS: u64 = 20_000_000;
/// Maximum number of columns of a list. Basis: far more than a machine has parameters. Doubling it
/// accepts wider files.
const MAX_COLUMNS: usize = 1000;
/// Maximum length of a path in a message, characters. Basis: no sensible path is longer. Doubling
/// it shows longer paths.
const MAX_PATH_CHARACTERS: usize = 1000;

/// The name of a column that identifies rows for people and is no parameter.
pub(super) const ID_COLUMN: &str = "id";

/// The name of a column of times (s), whose cells may be times of day.
const TIME_COLUMN: &str = "time_s";

/// The names of columns in which programs number rows, beside empty names.
const INDEX_COLUMNS: [&str; 3] = ["__index_level_0__", "Unnamed: 0", "index"];

/// Returns whether a column of this name only numbers rows.
pub fn is_index_column(name: &str) -> bool {
    name.is_empty() || INDEX_COLUMNS.contains(&name)
}

/// A table of numbers in a file; NaN for a missing value.
pub struct NumberTable {
    /// The columns: known columns of equal length, and ignored columns.
    pub columns: Vec<ListColumn>,
    row_locations: RowLocations,
    /// The number of lines before the line of names.
    preamble_lines: usize,
}

impl NumberTable {
    /// Reads a CSV or Parquet file of numbers; `None` after mistakes, which are reported.
    pub fn read_point_list(path: &Path, names: &ColumnNames<'_>, report: &Report) -> Option<Self> {
        let path_text = shorten_path(path);
        let file = Location::new(report.add(path_text.as_str(), String::new()), 0..0);
        match read_table(path, &file, true, names, report) {
            Ok((table, _)) => report.is_clean().then_some(table),
            Err(reason) => {
                let title = format!("cannot read {path_text}: {reason}");
                let help = "expected a CSV or Parquet file of numbers under a line of names";
                report.push(Diagnostic::new(title).with_help(help));
                None
            }
        }
    }

    /// Returns a table of columns in memory; `name` stands in messages.
    pub fn from_columns(
        name: &str,
        columns: Vec<(String, Vec<f64>)>,
        names: &ColumnNames<'_>,
        report: &Report,
    ) -> Self {
        let headers: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
        let (source, locations) = report.add_header(name, &headers);
        let mut list_columns = Vec::new();
        for (index, ((header, values), location)) in columns.into_iter().zip(locations).enumerate()
        {
            let known_name =
                names.find_known_name(&header, None).unwrap_or_else(|[title, expectation]| {
                    report.refuse::<()>(&location, title, expectation);
                    None
                });
            let is_known = known_name.is_some();
            let (column_name, values) = match known_name {
                Some(known_name) => {
                    let values = values
                        .into_iter()
                        .map(|column_name| known_name.unit_scale.apply(column_name));
                    (known_name.name, values.collect())
                }
                None => (header.clone(), Vec::new()),
            };
            let name = Located { value: column_name, location };
            list_columns.push(ListColumn {
                name,
                header,
                column_index: index,
                is_known,
                values,
                is_clock: false,
            });
        }
        Self {
            columns: list_columns,
            row_locations: RowLocations::Binary(Location::new(source, 0..0)),
            preamble_lines: 0,
        }
    }

    /// Returns whether a value was rejected when it was read.
    pub fn is_rejected(&self, value: f64) -> bool {
        matches!(self.row_locations, RowLocations::Lines { .. }) && value.is_nan()
    }

    /// Returns the location of a value. `column` is the index of the column in the file, and `row`
    /// the index of the row, both from 0.
    pub fn locate(&self, sources: &Sources, column: usize, row: usize) -> Location {
        match &self.row_locations {
            RowLocations::Binary(location) => location.clone(),
            RowLocations::Lines { source, row_starts, separator } => {
                let start = row_starts.get(row).map_or(0, |&start| start as usize);
                let line = TextLine::starting_at(sources.text(*source), start);
                let span = line.cells(*separator).nth(column).map(|(_, location)| location);
                Location::new(*source, span.unwrap_or(start..start))
            }
        }
    }

    /// Returns the text of a value in a file of text; the indices are those of [`Self::locate`].
    pub fn cell(&self, report: &Report, column: usize, row: usize) -> Option<String> {
        let RowLocations::Lines { source, .. } = &self.row_locations else { return None };
        let sources = report.sources();
        let cell = sources.text(*source).get(self.locate(&sources, column, row).span)?;
        Some(cell.trim_matches('"').to_owned())
    }

    /// Returns notes on ignored lines and columns and on renamed columns, a line each.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.preamble_lines > 0 {
            notes.push(format!(
                "{} before the names left out",
                format_count(self.preamble_lines, "line")
            ));
        }
        let ignored_columns: Vec<String> = self
            .columns
            .iter()
            .filter(|column| !column.is_known)
            .map(|column| quote(&column.header))
            .collect();
        if !ignored_columns.is_empty() {
            let (named_columns, ellipsis) =
                ignored_columns.split_at(ignored_columns.len().min(MAX_NAMED_COLUMNS));
            let ellipsis = if ellipsis.is_empty() { "" } else { ", ..." };
            let columns = if ignored_columns.len() == 1 { "the column" } else { "the columns" };
            notes.push(format!("left out {columns} {}{ellipsis}", named_columns.join(", ")));
        }
        let renamed_columns = self
            .columns
            .iter()
            .filter(|column| column.is_known && column.header != column.name.value);
        let renamed_columns = renamed_columns
            .map(|column| format!("{} is {}", quote(&column.header), column.name.value));
        let renamed_columns: Vec<String> = renamed_columns.collect();
        if !renamed_columns.is_empty() {
            notes.push(renamed_columns.join(", "));
        }
        notes
    }
}

/// Maximum number of columns that a note names. Basis: a note of one line. Doubling it names twice
/// as many.
const MAX_NAMED_COLUMNS: usize = 8;

/// A list of points.
pub struct PointList {
    /// The design of the plan.
    pub design: Design,
    /// The parameters with their values.
    pub table: NumberTable,
}

/// A column of numbers.
pub struct ListColumn {
    /// The name of the parameter or quantity, with the header's location.
    pub name: Located<String>,
    /// The name in the file.
    pub header: String,
    /// The index in the file, from 0.
    pub column_index: usize,
    /// Whether the reader knows the name. An unknown column has no values.
    pub is_known: bool,
    /// The value of each row.
    pub values: Vec<f64>,
    /// Whether the values stand for instants or times of day in a file without text.
    pub is_clock: bool,
}

impl ListColumn {
    /// Returns a value as a clock time, if the column holds instants or times of day in a file
    /// without text.
    pub fn clock_time(&self, row: usize) -> Option<String> {
        self.values
            .get(row)
            .filter(|_| self.is_clock)
            .map(|seconds| clock::format_clock_time(*seconds))
    }
}

/// The locations of rows.
enum RowLocations {
    /// Lines of a text that begin at these bytes.
    Lines { source: SourceId, row_starts: Vec<u32>, separator: char },
    /// Rows without a text; messages name the file.
    Binary(Location),
}

/// The reason why a file is no list.
type ListError = String;

/// Returns a path as messages show it.
fn shorten_path(path: &Path) -> String {
    truncate(&path.display().to_string(), MAX_PATH_CHARACTERS)
}

/// Reads the table of a file and the hash of its bytes; mistakes are reported at `file`. With
/// `allows_missing`, a missing value is NaN; otherwise NaN marks a rejected value.
fn read_table(
    path: &Path,
    file_location: &Location,
    allows_missing: bool,
    names: &ColumnNames<'_>,
    report: &Report,
) -> Result<(NumberTable, String), ListError> {
    let bytes = read_bytes(path)?;
    let hash = blake3::hash(&bytes).to_hex().to_string();
    if bytes.starts_with(b"PAR1") {
        let mut columns = Vec::new();
        for (index, parquet_column) in
            parquet::read_columns(bytes, allows_missing, names)?.into_iter().enumerate()
        {
            let parquet::ParquetColumn { name, header, values, is_clock } = parquet_column;
            let name = Located { value: name, location: file_location.clone() };
            let is_known = values.is_some();
            let values = values.unwrap_or_default();
            columns.push(ListColumn {
                name,
                header,
                column_index: index,
                is_known,
                values,
                is_clock,
            });
        }
        return Ok((
            NumberTable {
                columns,
                row_locations: RowLocations::Binary(file_location.clone()),
                preamble_lines: 0,
            },
            hash,
        ));
    }
    let text = text::decode_text(bytes)?;
    // The report gets the text after it is read, because this function borrows it until then.
    let source = report.add(shorten_path(path), String::new());
    let text_table = csv::read_text_table(&text, source, allows_missing, names, report);
    report.set_text(source, text);
    let csv::TextTable { columns, row_starts, separator, preamble_lines } = text_table?;
    Ok((
        NumberTable {
            columns,
            row_locations: RowLocations::Lines { source, row_starts, separator },
            preamble_lines,
        },
        hash,
    ))
}

/// Reads a list of points.
pub(super) fn read(
    file: &str,
    grid: &Path,
    names: &ColumnNames<'_>,
    report: &Report,
) -> Option<PointList> {
    let path = resolve_beside(grid, file);
    let location = report.location("design.file")?;
    let path_text = shorten_path(&path);
    let (table, hash) = match read_table(&path, &location, false, names, report) {
        Ok(table_and_hash) => table_and_hash,
        Err(reason) => {
            let title = format!("cannot read the list of points {path_text}: {reason}");
            let expectation = "expected a CSV or Parquet file of numbers, one column a parameter, \
                relative to this file";
            return report.refuse(&location, title, expectation);
        }
    };
    let point_count =
        table.columns.iter().map(|column| column.values.len()).max().unwrap_or_default();
    if point_count == 0 && !report.is_clean() {
        return None;
    }
    let is_parameter = |column: &ListColumn| column.is_known && column.name.value != ID_COLUMN;
    let has_parameter = table.columns.iter().any(is_parameter);
    let has_unknown = table.columns.iter().any(|column| !column.is_known);
    if point_count == 0 && (has_parameter || !has_unknown) {
        let title = format!("the list of points {path_text} is empty");
        let expectation = "expected a line of parameter names, and under it a row of numbers a \
                           point";
        return report.refuse(&location, title, expectation);
    }
    // Unknown names are reported when they are looked up.
    if !has_parameter && !has_unknown {
        let title = format!("the list of points {path_text} has no column but `{ID_COLUMN}`");
        return report.refuse(&location, title, "expected a column of a parameter");
    }
    let design = Design::List { file: file.to_owned(), points: point_count as u64, hash };
    Some(PointList { design, table })
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, ListError> {
    let mut bytes = Vec::new();
    let byte_count = regular::open(path)
        .and_then(|file| file.take(MAX_LIST_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|error| error.to_string())?;
    match byte_count as u64 > MAX_LIST_BYTES {
        true => Err(format!("it is longer than {} MiB", MAX_LIST_BYTES >> 20)),
        false => Ok(bytes),
    }
}

/// Checks that a table of this size is accepted.
fn check_size(rows: u64, columns: usize) -> Result<(), ListError> {
    if columns > MAX_COLUMNS {
        return Err(format!("it has {columns} columns, more than {MAX_COLUMNS}"));
    }
    match rows.checked_mul(columns as u64) {
        Some(0..=MAX_NUMBERS) => Ok(()),
        _ => Err(format!("it holds more than {MAX_NUMBERS} numbers")),
    }
}

#[cfg(test)]
mod tests;

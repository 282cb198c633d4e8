//! Tables of numbers in text: a line of names, and cells separated by commas, semicolons, tabs or
//! spaces. All numbers of a file have the same decimal mark, which they decide together. Empty
//! lines and lines that begin with `#` are skipped.

use super::super::report::{Diagnostic, Report};
use super::super::section::{format_count, shorten};
use super::super::source::{Located, Location, SourceId};
use super::clock;
use super::layout::{TableLayout, TextLine, data_lines, separator_words};
use super::names::ColumnNames;
use super::notation::{Evidence, Notation, NotationEvidence, UnclearNotation};
use super::units::UnitScale;
use super::{ID_COLUMN, ListColumn, ListError, TIME_COLUMN, check_size, is_index_column};

/// A table that is read from text.
#[derive(Default)]
pub(super) struct TextTable {
    /// The columns, with NaN for rejected values.
    pub(super) columns: Vec<ListColumn>,
    /// The byte at which each row's line begins.
    pub(super) row_starts: Vec<u32>,
    /// The separator of cells.
    pub(super) separator: char,
    /// The number of lines before the line of names.
    pub(super) preamble_lines: usize,
}

/// Texts of cells without a value, in lower case.
const MISSING_VALUES: [&str; 9] = ["", "nan", "na", "n/a", "#n/a", "null", "none", "-", "<na>"];

/// Reads a text; mistakes are reported.
pub(super) fn read(
    text: &str,
    source: SourceId,
    allows_missing: bool,
    names: &ColumnNames<'_>,
    report: &Report,
) -> Result<TextTable, ListError> {
    let Some(layout) = TableLayout::find(text, names)? else {
        return Ok(TextTable { separator: ',', ..TextTable::default() });
    };
    let separator = layout.separator;
    let headers = find_headers(&layout)?;
    let width = headers.len();
    let mut table =
        TextTable { separator, preamble_lines: layout.preamble_lines, ..TextTable::default() };
    let mut scales: Vec<Option<UnitScale>> = Vec::new();
    for (column_index, (header, location)) in headers.into_iter().enumerate() {
        let unit = layout.units.get(column_index).map(String::as_str);
        let (column, scale) = create_column(
            header,
            column_index,
            unit,
            Location::new(source, location),
            names,
            report,
        );
        table.columns.push(column);
        scales.push(scale);
    }
    let rows = data_lines(text, layout.rows_start);
    let notation = match layout.notation.map_or_else(|| detect_notation(rows.clone(), &table), Ok) {
        Ok(notation) => notation,
        Err(unclear) => {
            report.push(notation_mistake(&unclear, source));
            return Ok(table);
        }
    };
    for line in rows {
        let cells = line.cells(separator);
        let count = cells.clone().count();
        // Spreadsheets end rows with separators, and write rows that were emptied.
        let is_padded = (2..=2 * width).contains(&count);
        if is_padded && cells.clone().all(|(cell, _)| cell.is_empty()) {
            continue;
        }
        let mut extra_cells = cells.clone().skip(width);
        let has_empty_end = is_padded && extra_cells.all(|(cell, _)| cell.is_empty());
        if count < width || !(count == width || has_empty_end || layout.is_labview) {
            report.push_with(|_| wrong_row_length(line, count, width, separator, source));
            continue;
        }
        check_size(table.row_starts.len() as u64 + 1, width)?;
        // The cast loses nothing, because a list is smaller than 4 GiB.
        table.row_starts.push(line.start as u32);
        for (((cell, location), column), scale) in cells.zip(&mut table.columns).zip(&scales) {
            let Some(scale) = scale else { continue };
            if allows_missing && is_missing(cell) {
                column.values.push(f64::NAN);
                continue;
            }
            let is_time = column.name.value == TIME_COLUMN;
            let clock = || clock::parse_clock_time(cell).filter(|_| is_time);
            if let Some(value) = notation.parse_number(cell).or_else(clock)
                && (allows_missing || !value.is_nan())
            {
                column.values.push(scale.apply(value));
                continue;
            }
            column.values.push(f64::NAN);
            report.push_with(|_| {
                let title = format!("`{}` is not a number", shorten(cell));
                let expected = "expected a number such as 0.25, 80 or 1e7";
                Diagnostic::new(title).at_location(&Location::new(source, location), expected)
            });
        }
    }
    let rows = table.row_starts.len();
    for (column, scale) in table.columns.iter_mut().zip(&scales) {
        // A column of row identifiers has no numbers, so zeros fill it.
        if scale.is_none() && column.name.value == ID_COLUMN {
            column.values = vec![0.0; rows];
        }
    }
    table.columns.retain(|column| column.is_known || !is_index_column(&column.name.value));
    Ok(table)
}

/// Returns the names in the line of names with their positions; empty names at its end are dropped.
fn find_headers<'t>(
    layout: &TableLayout<'t>,
) -> Result<Vec<(&'t str, std::ops::Range<usize>)>, ListError> {
    let cells = layout.header.cells(layout.separator);
    check_size(0, cells.clone().count())?;
    let mut headers: Vec<_> = cells.collect();
    while headers.len() > 1 && headers.last().is_some_and(|(name, _)| name.is_empty()) {
        headers.pop();
    }
    if layout.is_labview && headers.last().is_some_and(|(name, _)| *name == "Comment") {
        headers.pop();
    }
    if let (true, Some((name, _))) = (layout.is_labview, headers.first_mut())
        && *name == "X_Value"
    {
        *name = TIME_COLUMN;
    }
    Ok(headers)
}

/// Returns a column without its numbers, and the factor to the unit of its name; `None` instead of
/// the factor for an ignored column.
fn create_column(
    header: &str,
    index: usize,
    unit: Option<&str>,
    location: Location,
    names: &ColumnNames<'_>,
    report: &Report,
) -> (ListColumn, Option<UnitScale>) {
    let named_column = |name: String, is_known| ListColumn {
        name: Located { value: name, location: location.clone() },
        header: header.to_owned(),
        index,
        is_known,
        values: Vec::new(),
        is_clock: false,
    };
    if header == ID_COLUMN {
        return (named_column(header.to_owned(), true), None);
    }
    match names.find(header, unit) {
        Ok(Some(found)) => (named_column(found.name, true), Some(found.scale)),
        Ok(None) => (named_column(header.to_owned(), false), None),
        Err([title, expected]) => {
            report.refuse::<()>(&location, title, expected);
            (named_column(header.to_owned(), true), None)
        }
    }
}

/// Returns whether a cell marks a missing value.
fn is_missing(cell: &str) -> bool {
    cell.len() <= 4 && MISSING_VALUES.contains(&cell.to_lowercase().as_str())
}

/// Returns the mistake of a row with too few or too many cells.
fn wrong_row_length(
    line: TextLine<'_>,
    count: usize,
    width: usize,
    separator: char,
    source: SourceId,
) -> Diagnostic {
    let location = Location::new(source, line.offset..line.offset + line.text.len());
    let [names, numbers] = ["name", "number"].map(|noun| format_count(width, noun));
    let title = format!("a row of {} under {names}", format_count(count, "number"));
    let expected = format!("expected {numbers}, separated by {}", separator_words(separator));
    let mistake = Diagnostic::new(title).at_location(&location, expected);
    let help = "commas separate cells here: if they separate decimals or thousands too, write the \
                file with semicolons or tabs between cells";
    if separator == ',' && count > width { mistake.with_help(help) } else { mistake }
}

/// Returns the notation of the numbers in these lines.
fn detect_notation<'t>(
    rows: impl Iterator<Item = TextLine<'t>> + Clone,
    table: &TextTable,
) -> Result<Notation, UnclearNotation> {
    // If commas separate cells, a mark within a cell is a decimal point.
    let has_comma_separator = table.separator == ',' && table.columns.len() > 1;
    let mut evidence = NotationEvidence::default();
    if has_comma_separator && !rows.clone().any(|line| line.text.contains('"')) {
        return Ok(Notation::POINT);
    }
    for line in rows {
        for ((cell, location), column) in line.cells(table.separator).zip(&table.columns) {
            if column.name.value != ID_COLUMN {
                evidence.add_cell(cell, location);
            }
        }
    }
    evidence.decide(has_comma_separator)
}

/// Returns the mistake of numbers that can be read in two ways.
fn notation_mistake(unclear: &UnclearNotation, source: SourceId) -> Diagnostic {
    let evidence_location =
        |evidence: &Evidence| Location::new(source, evidence.byte_range.clone());
    match unclear {
        UnclearNotation::TwoNotations(point, comma) => {
            let title = format!(
                "the file has decimal points, as in `{}`, and decimal commas, as in `{}`",
                shorten(&point.cell),
                shorten(&comma.cell)
            );
            Diagnostic::new(title)
                .at_location(
                    &evidence_location(comma),
                    "expected one decimal mark in the whole file",
                )
                .at_location(&evidence_location(point), "the other one")
                .with_help("write every number of the file with the same decimal mark")
        }
        UnclearNotation::OneCell(evidence) => {
            let [thousands, decimals] = evidence.readings();
            let title = format!("`{}` may be {thousands} or {decimals}", shorten(&evidence.cell));
            let help = format!(
                "no other number of the file shows its decimal mark: write {thousands}, or \
                 {decimals}0"
            );
            let expected = "expected a number without separators of thousands";
            Diagnostic::new(title)
                .at_location(&evidence_location(evidence), expected)
                .with_help(help)
        }
    }
}

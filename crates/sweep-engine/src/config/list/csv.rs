//! Tables of numbers in text: a line of names, and cells separated by commas, semicolons, tabs or
//! spaces. All numbers of a file have the same decimal mark, which they decide together. Empty
//! lines and lines that begin with `#` are skipped.

use super::super::report::{Diagnostic, Report};
use super::super::section::{format_count, shorten};
use super::super::source::{Located, Location, SourceId};
use super::clock;
use super::layout::{TableLayout, TextLine, data_lines, separator_words};
use super::names::ColumnNames;
use super::notation::{CellEvidence, Notation, NotationEvidence, UnclearNotation};
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
const MISSING_VALUE_TEXTS: [&str; 9] =
    ["", "nan", "na", "n/a", "#n/a", "null", "none", "-", "<na>"];

/// Reads a text; mistakes are reported.
pub(super) fn read_text_table(
    text: &str,
    source: SourceId,
    allows_missing: bool,
    names: &ColumnNames<'_>,
    report: &Report,
) -> Result<TextTable, ListError> {
    let Some(layout) = TableLayout::detect(text, names)? else {
        return Ok(TextTable { separator: ',', ..TextTable::default() });
    };
    let separator = layout.separator;
    let headers = find_headers(&layout)?;
    let column_count = headers.len();
    let mut table =
        TextTable { separator, preamble_lines: layout.preamble_lines, ..TextTable::default() };
    let mut unit_scales: Vec<Option<UnitScale>> = Vec::new();
    for (column_index, (header, location)) in headers.into_iter().enumerate() {
        let unit = layout.units.get(column_index).map(String::as_str);
        let (column, unit_scale) = create_column(
            header,
            column_index,
            unit,
            Location::new(source, location),
            names,
            report,
        );
        table.columns.push(column);
        unit_scales.push(unit_scale);
    }
    let rows = data_lines(text, layout.rows_start);
    let notation =
        match layout.stated_notation.map_or_else(|| detect_notation(rows.clone(), &table), Ok) {
            Ok(notation) => notation,
            Err(unclear) => {
                report.push(notation_mistake(&unclear, source));
                return Ok(table);
            }
        };
    for line in rows {
        let cells = line.cells(separator);
        let cell_count = cells.clone().count();
        // Spreadsheets end rows with separators, and write rows that were emptied.
        let may_be_padded = (2..=2 * column_count).contains(&cell_count);
        if may_be_padded && cells.clone().all(|(cell, _)| cell.is_empty()) {
            continue;
        }
        let mut extra_cells = cells.clone().skip(column_count);
        let has_empty_end = may_be_padded && extra_cells.all(|(cell, _)| cell.is_empty());
        if cell_count < column_count
            || !(cell_count == column_count || has_empty_end || layout.is_labview)
        {
            report.push_with(|_| {
                row_length_mistake(line, cell_count, column_count, separator, source)
            });
            continue;
        }
        check_size(table.row_starts.len() as u64 + 1, column_count)?;
        // The cast loses nothing, because a list is smaller than 4 GiB.
        table.row_starts.push(line.line_start as u32);
        for (((cell, location), column), unit_scale) in
            cells.zip(&mut table.columns).zip(&unit_scales)
        {
            let Some(unit_scale) = unit_scale else { continue };
            if allows_missing && is_missing(cell) {
                column.values.push(f64::NAN);
                continue;
            }
            let is_time = column.name.value == TIME_COLUMN;
            let parse_clock = || clock::parse_clock_time(cell).filter(|_| is_time);
            if let Some(value) = notation.parse_number(cell).or_else(parse_clock)
                && (allows_missing || !value.is_nan())
            {
                column.values.push(unit_scale.apply(value));
                continue;
            }
            column.values.push(f64::NAN);
            report.push_with(|_| {
                let title = format!("`{}` is not a number", shorten(cell));
                let expectation = "expected a number such as 0.25, 80 or 1e7";
                Diagnostic::new(title).at_location(&Location::new(source, location), expectation)
            });
        }
    }
    let rows = table.row_starts.len();
    for (column, unit_scale) in table.columns.iter_mut().zip(&unit_scales) {
        // A column of row identifiers has no numbers, so zeros fill it.
        if unit_scale.is_none() && column.name.value == ID_COLUMN {
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
    let cells = layout.header_line.cells(layout.separator);
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
    let make_column = |name: String, is_known| ListColumn {
        name: Located { value: name, location: location.clone() },
        header: header.to_owned(),
        column_index: index,
        is_known,
        values: Vec::new(),
        is_clock: false,
    };
    if header == ID_COLUMN {
        return (make_column(header.to_owned(), true), None);
    }
    match names.find_known_name(header, unit) {
        Ok(Some(found)) => (make_column(found.name, true), Some(found.unit_scale)),
        Ok(None) => (make_column(header.to_owned(), false), None),
        Err([title, expectation]) => {
            report.refuse::<()>(&location, title, expectation);
            (make_column(header.to_owned(), true), None)
        }
    }
}

/// Returns whether a cell marks a missing value.
fn is_missing(cell: &str) -> bool {
    cell.len() <= 4 && MISSING_VALUE_TEXTS.contains(&cell.to_lowercase().as_str())
}

/// Returns the mistake of a row with too few or too many cells.
fn row_length_mistake(
    line: TextLine<'_>,
    cell_count: usize,
    column_count: usize,
    separator: char,
    source: SourceId,
) -> Diagnostic {
    let location = Location::new(source, line.text_start..line.text_start + line.text.len());
    let [names, numbers] = ["name", "number"].map(|noun| format_count(column_count, noun));
    let title = format!("a row of {} under {names}", format_count(cell_count, "number"));
    let expectation = format!("expected {numbers}, separated by {}", separator_words(separator));
    let mistake = Diagnostic::new(title).at_location(&location, expectation);
    let help = "commas separate cells here: if they separate decimals or thousands too, write the \
                file with semicolons or tabs between cells";
    if separator == ',' && cell_count > column_count { mistake.with_help(help) } else { mistake }
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
        return Ok(Notation::DECIMAL_POINT);
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
        |evidence: &CellEvidence| Location::new(source, evidence.byte_range.clone());
    match unclear {
        UnclearNotation::TwoNotations(point_cell, comma_cell) => {
            let title = format!(
                "the file has decimal points, as in `{}`, and decimal commas, as in `{}`",
                shorten(&point_cell.cell),
                shorten(&comma_cell.cell)
            );
            Diagnostic::new(title)
                .at_location(
                    &evidence_location(comma_cell),
                    "expected one decimal mark in the whole file",
                )
                .at_location(&evidence_location(point_cell), "the other one")
                .with_help("write every number of the file with the same decimal mark")
        }
        UnclearNotation::OneCell(evidence) => {
            let [thousands, decimals] = evidence.possible_numbers();
            let title = format!("`{}` may be {thousands} or {decimals}", shorten(&evidence.cell));
            let help = format!(
                "no other number of the file shows its decimal mark: write {thousands}, or \
                 {decimals}0"
            );
            let expectation = "expected a number without separators of thousands";
            Diagnostic::new(title)
                .at_location(&evidence_location(evidence), expectation)
                .with_help(help)
        }
    }
}

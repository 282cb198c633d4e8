//! Tables of numbers in text: a line of names, and cells separated by commas, semicolons, tabs or
//! spaces. All numbers of a file have the same decimal mark, which they decide together. Empty
//! lines and lines that begin with `#` are skipped.

use super::super::report::{Diagnostic, Report};
use super::super::section::{counted, short};
use super::super::source::{Located, Location, SourceId};
use super::clock;
use super::layout::{TableLayout, TextLine, lines, separator_words};
use super::names::Names;
use super::notation::{Evidence, Notation, NotationEvidence, Unclear};
use super::units::UnitScale;
use super::{ID_COLUMN, ListColumn, ListError, TIME_COLUMN, check_size, is_index};

/// A table that is read from text.
#[derive(Default)]
pub(super) struct TextTable {
    /// The columns, with NaN for rejected values.
    pub(super) columns: Vec<ListColumn>,
    /// The byte at which each row's line begins.
    pub(super) starts: Vec<u32>,
    /// The separator of cells.
    pub(super) separator: char,
    /// The number of lines before the line of names.
    pub(super) preamble: usize,
}

/// Texts of cells without a value, in lower case.
const MISSING_VALUES: [&str; 9] = ["", "nan", "na", "n/a", "#n/a", "null", "none", "-", "<na>"];

/// Reads a text; mistakes are reported.
pub(super) fn read(
    text: &str,
    source: SourceId,
    allows_missing: bool,
    names: &Names<'_>,
    report: &Report,
) -> Result<TextTable, ListError> {
    let Some(layout) = TableLayout::find(text, names)? else {
        return Ok(TextTable { separator: ',', ..TextTable::default() });
    };
    let separator = layout.separator;
    let headers = headers(&layout)?;
    let width = headers.len();
    let mut table = TextTable { separator, preamble: layout.preamble, ..TextTable::default() };
    let mut scales: Vec<Option<UnitScale>> = Vec::new();
    for (place, (header, location)) in headers.into_iter().enumerate() {
        let unit = layout.units.get(place).map(String::as_str);
        let (column, scale) =
            column(header, place, unit, Location::new(source, location), names, report);
        table.columns.push(column);
        scales.push(scale);
    }
    let rows = lines(text, layout.rows);
    let notation = match layout.notation.map_or_else(|| notation(rows.clone(), &table), Ok) {
        Ok(notation) => notation,
        Err(unclear) => {
            report.push(refusal(&unclear, source));
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
        check_size(table.starts.len() as u64 + 1, width)?;
        // The cast loses nothing, because a list is smaller than 4 GiB.
        table.starts.push(line.start as u32);
        for (((cell, location), column), scale) in cells.zip(&mut table.columns).zip(&scales) {
            let Some(scale) = scale else { continue };
            if allows_missing && is_missing(cell) {
                column.values.push(f64::NAN);
                continue;
            }
            let is_time = column.name.value == TIME_COLUMN;
            let clock = || clock::seconds(cell).filter(|_| is_time);
            if let Some(value) = notation.number(cell).or_else(clock)
                && (allows_missing || !value.is_nan())
            {
                column.values.push(scale.apply(value));
                continue;
            }
            column.values.push(f64::NAN);
            report.push_with(|_| {
                let title = format!("`{}` is not a number", short(cell));
                let expected = "expected a number such as 0.25, 80 or 1e7";
                Diagnostic::new(title).at_location(&Location::new(source, location), expected)
            });
        }
    }
    let rows = table.starts.len();
    for (column, scale) in table.columns.iter_mut().zip(&scales) {
        // A column of row identifiers has no numbers, so zeros fill it.
        if scale.is_none() && column.name.value == ID_COLUMN {
            column.values = vec![0.0; rows];
        }
    }
    table.columns.retain(|column| column.is_known || !is_index(&column.name.value));
    Ok(table)
}

/// Returns the names in the line of names with their positions; empty names at its end are dropped.
fn headers<'t>(
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
fn column(
    header: &str,
    index: usize,
    unit: Option<&str>,
    location: Location,
    names: &Names<'_>,
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
    let [names, numbers] = ["name", "number"].map(|noun| counted(width, noun));
    let title = format!("a row of {} under {names}", counted(count, "number"));
    let expected = format!("expected {numbers}, separated by {}", separator_words(separator));
    let refusal = Diagnostic::new(title).at_location(&location, expected);
    let help = "commas separate cells here: if they separate decimals or thousands too, write the \
                file with semicolons or tabs between cells";
    if separator == ',' && count > width { refusal.help(help) } else { refusal }
}

/// Returns the notation of the numbers in these lines.
fn notation<'t>(
    rows: impl Iterator<Item = TextLine<'t>> + Clone,
    table: &TextTable,
) -> Result<Notation, Unclear> {
    // If commas separate cells, a mark within a cell is a decimal point.
    let has_comma_separator = table.separator == ',' && table.columns.len() > 1;
    let mut seen = NotationEvidence::default();
    if has_comma_separator && !rows.clone().any(|line| line.text.contains('"')) {
        return Ok(Notation::POINT);
    }
    for line in rows {
        for ((cell, location), column) in line.cells(table.separator).zip(&table.columns) {
            if column.name.value != ID_COLUMN {
                seen.note(cell, location);
            }
        }
    }
    seen.notation(has_comma_separator)
}

/// Returns the mistake of numbers that can be read in two ways.
fn refusal(unclear: &Unclear, source: SourceId) -> Diagnostic {
    let evidence_location = |evidence: &Evidence| Location::new(source, evidence.location.clone());
    match unclear {
        Unclear::TwoNotations(point, comma) => {
            let title = format!(
                "the file has decimal points, as in `{}`, and decimal commas, as in `{}`",
                short(&point.cell),
                short(&comma.cell)
            );
            Diagnostic::new(title)
                .at_location(
                    &evidence_location(comma),
                    "expected one decimal mark in the whole file",
                )
                .at_location(&evidence_location(point), "the other one")
                .help("write every number of the file with the same decimal mark")
        }
        Unclear::OneCell(evidence) => {
            let [thousands, decimals] = evidence.readings();
            let title = format!("`{}` may be {thousands} or {decimals}", short(&evidence.cell));
            let help = format!(
                "no other number of the file shows its decimal mark: write {thousands}, or \
                 {decimals}0"
            );
            let expected = "expected a number without separators of thousands";
            Diagnostic::new(title).at_location(&evidence_location(evidence), expected).help(help)
        }
    }
}

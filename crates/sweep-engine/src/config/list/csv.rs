//! Numbers under a line of names, separated by commas, semicolons, tabs or spaces. All numbers of a
//! file have one decimal mark, which they show together. Lines that are empty or begin with `#` do
//! not count.

use super::super::report::{Diagnostic, Report};
use super::super::section::{counted, short};
use super::super::source::{Located, Location, SourceId};
use super::clock;
use super::layout::{Layout, Line, lines, said};
use super::names::Names;
use super::notation::{Evidence, Notation, Seen, Unclear};
use super::units::Scale;
use super::{ID, ListColumn, Unreadable, fits, is_index};

/// What is read of a table in text.
#[derive(Default)]
pub(super) struct Read {
    /// The columns, with NaN for what is refused.
    pub(super) columns: Vec<ListColumn>,
    /// The byte at which each row's line begins.
    pub(super) starts: Vec<u32>,
    /// What separates cells.
    pub(super) separator: char,
    /// Lines before the line of names.
    pub(super) preamble: usize,
}

/// The name of a column of times (s), which may be those of a clock.
const TIME: &str = "time_s";

/// Texts of cells that hold no sample, in small letters.
const MISSING: [&str; 9] = ["", "nan", "na", "n/a", "#n/a", "null", "none", "-", "<na>"];

/// Reads a text; mistakes are reported.
pub(super) fn read(
    text: &str,
    source: SourceId,
    gaps: bool,
    names: &Names<'_>,
    report: &Report,
) -> Result<Read, Unreadable> {
    let Some(layout) = Layout::find(text, names)? else {
        return Ok(Read { separator: ',', ..Read::default() });
    };
    let separator = layout.separator;
    let headers = headers(&layout)?;
    let width = headers.len();
    let mut read = Read { separator, preamble: layout.preamble, ..Read::default() };
    let mut scales: Vec<Option<Scale>> = Vec::new();
    for (place, (header, at)) in headers.into_iter().enumerate() {
        let unit = layout.units.get(place).map(String::as_str);
        let (column, scale) = column(header, place, unit, Location::new(source, at), names, report);
        read.columns.push(column);
        scales.push(scale);
    }
    let rows = lines(text, layout.rows);
    let notation = match layout.notation.map_or_else(|| notation(rows.clone(), &read), Ok) {
        Ok(notation) => notation,
        Err(unclear) => {
            report.push(refusal(&unclear, source));
            return Ok(read);
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
        let mut further = cells.clone().skip(width);
        let ends_empty = is_padded && further.all(|(cell, _)| cell.is_empty());
        if count < width || !(count == width || ends_empty || layout.is_labview) {
            report.push_with(|_| wrong_row(line, count, width, separator, source));
            continue;
        }
        fits(read.starts.len() as u64 + 1, width)?;
        // Fits: no list is as long as 4 GiB.
        read.starts.push(line.start as u32);
        for (((cell, at), column), scale) in cells.zip(&mut read.columns).zip(&scales) {
            let Some(scale) = scale else { continue };
            if gaps && is_missing(cell) {
                column.values.push(f64::NAN);
                continue;
            }
            let is_time = column.name.value == TIME;
            let clock = || clock::seconds(cell).filter(|_| is_time);
            if let Some(value) = notation.number(cell).or_else(clock)
                && (gaps || !value.is_nan())
            {
                column.values.push(scale.apply(value));
                continue;
            }
            column.values.push(f64::NAN);
            report.push_with(|_| {
                let title = format!("`{}` is not a number", short(cell));
                let expected = "expected a number such as 0.25, 80 or 1e7";
                Diagnostic::new(title).at(&Location::new(source, at), expected)
            });
        }
    }
    let rows = read.starts.len();
    for (column, scale) in read.columns.iter_mut().zip(&scales) {
        // A number holds the place of whatever tells people which row is which.
        if scale.is_none() && column.name.value == ID {
            column.values = vec![0.0; rows];
        }
    }
    read.columns.retain(|column| column.is_known || !is_index(&column.name.value));
    Ok(read)
}

/// Returns the names in the line of names, with their places; those without a name at its end do
/// not count.
fn headers<'t>(layout: &Layout<'t>) -> Result<Vec<(&'t str, std::ops::Range<usize>)>, Unreadable> {
    let cells = layout.header.cells(layout.separator);
    fits(0, cells.clone().count())?;
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
        *name = TIME;
    }
    Ok(headers)
}

/// Returns a column without its numbers, and the factor to its name's unit; no factor if it is left
/// out.
fn column(
    header: &str,
    place: usize,
    unit: Option<&str>,
    at: Location,
    names: &Names<'_>,
    report: &Report,
) -> (ListColumn, Option<Scale>) {
    let of_name = |name: String, is_known| ListColumn {
        name: Located { value: name, at: at.clone() },
        header: header.to_owned(),
        place,
        is_known,
        values: Vec::new(),
    };
    if header == ID {
        return (of_name(header.to_owned(), true), None);
    }
    match names.find(header, unit) {
        Ok(Some(found)) => (of_name(found.name, true), Some(found.scale)),
        Ok(None) => (of_name(header.to_owned(), false), None),
        Err([title, expected]) => {
            report.refuse::<()>(&at, title, expected);
            (of_name(header.to_owned(), true), None)
        }
    }
}

/// Whether a cell says that there is no sample.
fn is_missing(cell: &str) -> bool {
    cell.len() <= 4 && MISSING.contains(&cell.to_lowercase().as_str())
}

/// Returns the mistake of a row of too few or too many cells.
fn wrong_row(
    line: Line<'_>,
    count: usize,
    width: usize,
    separator: char,
    source: SourceId,
) -> Diagnostic {
    let at = Location::new(source, line.offset..line.offset + line.text.len());
    let [names, numbers] = ["name", "number"].map(|what| counted(width, what));
    let title = format!("a row of {} under {names}", counted(count, "number"));
    let expected = format!("expected {numbers}, separated by {}", said(separator));
    let refusal = Diagnostic::new(title).at(&at, expected);
    let help = "commas separate cells here: if they separate decimals or thousands too, write the \
                file with semicolons or tabs between cells";
    if separator == ',' && count > width { refusal.help(help) } else { refusal }
}

/// Returns the notation of the numbers in these lines.
fn notation<'t>(
    rows: impl Iterator<Item = Line<'t>> + Clone,
    read: &Read,
) -> Result<Notation, Unclear> {
    // Commas end cells, and so every mark within one is a decimal point.
    let is_by_commas = read.separator == ',' && read.columns.len() > 1;
    let mut seen = Seen::default();
    if is_by_commas && !rows.clone().any(|line| line.text.contains('"')) {
        return Ok(Notation::POINT);
    }
    for line in rows {
        for ((cell, at), column) in line.cells(read.separator).zip(&read.columns) {
            if column.name.value != ID {
                seen.note(cell, at);
            }
        }
    }
    seen.notation(is_by_commas)
}

/// Returns the mistake of numbers that may be others.
fn refusal(unclear: &Unclear, source: SourceId) -> Diagnostic {
    let place = |evidence: &Evidence| Location::new(source, evidence.at.clone());
    match unclear {
        Unclear::TwoNotations(point, comma) => {
            let title = format!(
                "the file has decimal points, as in `{}`, and decimal commas, as in `{}`",
                short(&point.cell),
                short(&comma.cell)
            );
            Diagnostic::new(title)
                .at(&place(comma), "expected one decimal mark in the whole file")
                .at(&place(point), "the other one")
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
            Diagnostic::new(title).at(&place(evidence), expected).help(help)
        }
    }
}

//! Numbers under a line of names, separated by commas, semicolons or tabs. All numbers of a file
//! have one decimal mark, which they show together. Lines that are empty or begin with `#` do not
//! count.

use std::ops::Range;

use super::super::report::{Diagnostic, Report};
use super::super::section::{counted, short};
use super::super::source::{Located, Location, SourceId};
use super::notation::{Evidence, Notation, Seen, Unclear};
use super::{ID, ListColumn, Unreadable, fits};

/// Columns, with NaN for what is refused; the byte at which each row's line begins, and what
/// separates cells.
pub(super) type Read = (Vec<ListColumn>, Vec<u32>, char);

/// Reads a text; mistakes are reported.
pub(super) fn read(
    text: &str,
    source: SourceId,
    gaps: bool,
    report: &Report,
) -> Result<Read, Unreadable> {
    let mut lines = lines(text);
    let Some((_, line, offset)) = lines.next() else { return Ok((Vec::new(), Vec::new(), ',')) };
    let separator = [';', '\t'].into_iter().find(|&other| line.contains(other)).unwrap_or(',');
    fits(0, cells(line, separator, offset).count())?;
    let column = |(name, at): (&str, _)| ListColumn {
        name: Located { value: name.to_owned(), at: Location::new(source, at) },
        values: Vec::new(),
    };
    let mut columns: Vec<ListColumn> = cells(line, separator, offset).map(column).collect();
    let mut starts: Vec<u32> = Vec::new();
    let notation = match notation(lines.clone(), separator, &columns) {
        Ok(notation) => notation,
        Err(unclear) => {
            report.push(refusal(&unclear, source));
            return Ok((columns, starts, separator));
        }
    };
    for (start, line, offset) in lines {
        let count = cells(line, separator, offset).count();
        if count != columns.len() {
            report.push_with(|_| {
                let at = Location::new(source, offset..offset + line.len());
                let [names, numbers] = ["name", "number"].map(|what| counted(columns.len(), what));
                let title = format!("a row of {} under {names}", counted(count, "number"));
                let by = match separator {
                    ';' => "semicolons",
                    '\t' => "tabs",
                    _ => "commas",
                };
                let expected = format!("expected {numbers}, separated by {by}");
                Diagnostic::new(title).at(&at, expected)
            });
            continue;
        }
        fits(starts.len() as u64 + 1, count)?;
        // Fits: no list is as long as 4 GiB.
        starts.push(start as u32);
        for ((cell, at), column) in cells(line, separator, offset).zip(&mut columns) {
            if column.name.value == ID {
                // Whatever it says; a number holds its place.
                column.values.push(0.0);
                continue;
            }
            if gaps && cell.is_empty() {
                column.values.push(f64::NAN);
                continue;
            }
            if let Some(value) = notation.number(cell)
                && (gaps || !value.is_nan())
            {
                column.values.push(value);
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
    Ok((columns, starts, separator))
}

/// Returns the notation of the numbers in these lines.
fn notation<'t>(
    lines: impl Iterator<Item = (usize, &'t str, usize)>,
    separator: char,
    columns: &[ListColumn],
) -> Result<Notation, Unclear> {
    let mut seen = Seen::default();
    for (_, line, offset) in lines {
        if separator == ',' && columns.len() > 1 && !line.contains('"') {
            // Commas end cells, and so every mark within one is a decimal point.
            continue;
        }
        if cells(line, separator, offset).count() != columns.len() {
            continue;
        }
        for ((cell, at), column) in cells(line, separator, offset).zip(columns) {
            if column.name.value != ID {
                seen.note(cell, at);
            }
        }
    }
    seen.notation(separator == ',' && columns.len() > 1)
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

/// The lines that count: the byte at which each begins, and its text with the byte of that.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str, usize)> + Clone {
    let mut next = 0;
    let lines = text.split_inclusive('\n').map(move |line| {
        let start = next;
        next += line.len();
        let (line, offset) = body(line, start);
        (start, line, offset)
    });
    lines.filter(|(_, line, _)| {
        let line = line.trim();
        !line.is_empty() && !line.starts_with('#')
    })
}

/// The place of a cell in the line that begins at a byte of a text.
pub(super) fn cell_span(text: &str, start: usize, separator: char, column: usize) -> Range<usize> {
    let line = text.get(start..).unwrap_or_default();
    let line = line.split_inclusive('\n').next().unwrap_or_default();
    let (line, offset) = body(line, start);
    cells(line, separator, offset).nth(column).map_or(start..start, |(_, at)| at)
}

/// A line that begins at byte `start`, without byte order mark and line end, and where that begins.
fn body(line: &str, start: usize) -> (&str, usize) {
    let body = line.trim_end_matches(['\n', '\r']);
    let plain = if start == 0 { body.trim_start_matches('\u{feff}') } else { body };
    (plain, start + body.len() - plain.len())
}

/// The cells of a line without white space and quotation marks, and their places.
fn cells(line: &str, separator: char, offset: usize) -> impl Iterator<Item = (&str, Range<usize>)> {
    let (mut next, mut is_quoted, mut may_begin) = (offset, false, true);
    // A separator between quotation marks, which may begin a cell, is none.
    let ends = move |c: char| {
        is_quoted ^= c == '"' && (is_quoted || may_begin);
        let ends = c == separator && !is_quoted;
        may_begin = ends || c == '"' || may_begin && c.is_whitespace();
        ends
    };
    line.split(ends).map(move |cell| {
        let start = next + (cell.len() - cell.trim_start().len());
        next += cell.len() + 1;
        let trimmed = cell.trim();
        let quoted = trimmed.len() >= 2 && trimmed.starts_with('"') && trimmed.ends_with('"');
        let inner = if quoted { &trimmed[1..trimmed.len() - 1] } else { trimmed };
        (inner, start..start + trimmed.len())
    })
}

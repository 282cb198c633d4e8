//! Comma-separated numbers under a line of names. Lines that are empty or begin with `#` do not
//! count.

use std::ops::Range;

use super::super::report::{Diagnostic, Report};
use super::super::section::short;
use super::super::source::{Located, Location, SourceId};
use super::{ID, ListColumn, MOST_COLUMNS, Unreadable, fits};

/// The columns, and the byte at which each row's line begins; `None` after mistakes, which are
/// reported.
pub(super) fn read(
    text: &str,
    source: SourceId,
    gaps: bool,
    report: &Report,
) -> Result<Option<(Vec<ListColumn>, Vec<u32>)>, Unreadable> {
    let mut columns: Vec<ListColumn> = Vec::new();
    let mut starts: Vec<u32> = Vec::new();
    let mut sound = true;
    let mut next = 0;
    for line in text.split_inclusive('\n') {
        let start = next;
        next += line.len();
        let (line, offset) = body(line, start);
        if line.trim().is_empty() || line.trim_start().starts_with('#') {
            continue;
        }
        let count = 1 + line.bytes().filter(|&byte| byte == b',').count();
        if columns.is_empty() {
            if count > MOST_COLUMNS {
                return Err(Unreadable::TooManyColumns(count));
            }
            let column = |(name, at): (&str, _)| ListColumn {
                name: Located { value: name.to_owned(), at: Location::new(source, at) },
                values: Vec::new(),
            };
            columns = cells(line, offset).map(column).collect();
            continue;
        }
        if count != columns.len() {
            sound = false;
            report.push_with(|_| {
                let at = Location::new(source, offset..offset + line.len());
                let of = |count, what| {
                    let plural = if count == 1 { "" } else { "s" };
                    format!("{count} {what}{plural}")
                };
                let (names, numbers) = (of(columns.len(), "name"), of(columns.len(), "number"));
                let title = format!("a row of {} under {names}", of(count, "number"));
                let expected = format!("expected {numbers}, separated by commas");
                Diagnostic::new(title).at(&at, expected)
            });
            continue;
        }
        fits(starts.len() as u64 + 1, count)?;
        // Fits: no list is as long as 4 GiB.
        starts.push(start as u32);
        for ((cell, at), column) in cells(line, offset).zip(&mut columns) {
            if column.name.value == ID {
                // Whatever it says; a number holds its place.
                column.values.push(0.0);
                continue;
            }
            if gaps && cell.is_empty() {
                column.values.push(f64::NAN);
                continue;
            }
            if let Ok(value) = cell.parse::<f64>() {
                column.values.push(value);
                continue;
            }
            sound = false;
            report.push_with(|_| {
                let title = format!("`{}` is not a number", short(cell));
                let expected = "expected a number such as 0.25, 80 or 1e7";
                Diagnostic::new(title).at(&Location::new(source, at), expected)
            });
        }
    }
    Ok(sound.then_some((columns, starts)))
}

/// The place of a cell in the line that begins at a byte of a text.
pub(super) fn cell_span(text: &str, start: usize, column: usize) -> Range<usize> {
    let line = text.get(start..).unwrap_or_default();
    let line = line.split_inclusive('\n').next().unwrap_or_default();
    let (line, offset) = body(line, start);
    cells(line, offset).nth(column).map_or(start..start, |(_, at)| at)
}

/// A line that begins at byte `start`, without byte order mark and line end, and where that begins.
fn body(line: &str, start: usize) -> (&str, usize) {
    let body = line.trim_end_matches(['\n', '\r']);
    let plain = if start == 0 { body.trim_start_matches('\u{feff}') } else { body };
    (plain, start + body.len() - plain.len())
}

/// The cells of a line without white space and quotation marks, and their places.
fn cells(line: &str, offset: usize) -> impl Iterator<Item = (&str, Range<usize>)> {
    let mut next = offset;
    line.split(',').map(move |cell| {
        let start = next + (cell.len() - cell.trim_start().len());
        next += cell.len() + 1;
        let trimmed = cell.trim();
        let quoted = trimmed.len() >= 2 && trimmed.starts_with('"') && trimmed.ends_with('"');
        let inner = if quoted { &trimmed[1..trimmed.len() - 1] } else { trimmed };
        (inner, start..start + trimmed.len())
    })
}

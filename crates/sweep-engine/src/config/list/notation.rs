//! The notation of a table's numbers: its decimal mark, and the separator of groups of three
//! digits. All cells decide together, because `1.050` alone may be 1.05 or 1050.

use std::borrow::Cow;
use std::ops::Range;

/// The marks that separate decimals in some countries and thousands in others.
const MARKS: [char; 2] = ['.', ','];

/// The marks that only separate thousands: apostrophes, and spaces of several widths.
const GROUP_MARKS: [char; 6] = ['\'', '\u{2019}', ' ', '\u{a0}', '\u{202f}', '\u{2009}'];

/// The number of digits in a group of thousands.
const GROUP_DIGITS: usize = 3;

/// The evidence of a cell about the notation.
#[derive(Clone, Copy, Debug, PartialEq)]
enum MarkEvidence {
    /// The cell has no mark, or is no number.
    Nothing,
    /// The mark separates decimals.
    Decimal(char),
    /// The mark separates thousands, and there are no decimals.
    Thousands(char),
    /// The mark can be either: at most three digits precede it, and three follow.
    Either(char),
}

/// A cell with evidence about the notation.
#[derive(Clone, Debug)]
pub(super) struct Evidence {
    /// The text of the cell.
    pub(super) cell: String,
    /// The range of the cell in the file, in bytes.
    pub(super) byte_range: Range<usize>,
}

/// The evidence so far: the first cell of each kind for each mark.
#[derive(Debug, Default)]
pub(super) struct NotationEvidence {
    decimal: [Option<Evidence>; 2],
    thousands: [Option<Evidence>; 2],
    either: [Option<Evidence>; 2],
}

/// The reason why the notation of a file is unclear.
#[derive(Debug)]
pub(super) enum UnclearNotation {
    /// Two cells have decimals with different marks.
    TwoNotations(Evidence, Evidence),
    /// The cell can be two numbers, and no other cell decides.
    OneCell(Evidence),
}

/// A notation by its decimal mark; the other mark separates thousands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Notation {
    decimal: char,
}

impl Notation {
    /// Decimal points.
    pub(super) const POINT: Self = Self { decimal: '.' };

    /// Decimal commas.
    pub(super) const COMMA: Self = Self { decimal: ',' };

    /// Parses the number in a cell.
    pub(super) fn parse_number(self, cell: &str) -> Option<f64> {
        if self == Self::POINT && !cell.contains(',') && !cell.contains(GROUP_MARKS) {
            return cell.parse().ok();
        }
        let cell = remove_groups(cell);
        let thousands = other_mark(self.decimal);
        match mark_evidence(&cell) {
            MarkEvidence::Nothing if cell.contains(MARKS) => None,
            MarkEvidence::Decimal(mark) if mark != self.decimal => None,
            MarkEvidence::Thousands(mark) if mark == self.decimal => None,
            _ => cell.replace(thousands, "").replace(self.decimal, ".").parse().ok(),
        }
    }
}

impl NotationEvidence {
    /// Adds the evidence of a cell.
    pub(super) fn add_cell(&mut self, cell: &str, byte_range: Range<usize>) {
        if !cell.contains(MARKS) {
            return;
        }
        let text = remove_groups(cell);
        let (kinds, mark) = match mark_evidence(&text) {
            MarkEvidence::Nothing => return,
            MarkEvidence::Decimal(mark) => (&mut self.decimal, mark),
            MarkEvidence::Thousands(mark) => (&mut self.thousands, mark),
            MarkEvidence::Either(mark) => (&mut self.either, mark),
        };
        kinds[mark_index(mark)]
            .get_or_insert_with(|| Evidence { cell: cell.to_owned(), byte_range });
    }

    /// Returns the notation in which every cell is a number. `has_commas` says that commas separate
    /// cells; such files have decimal points.
    ///
    /// # Errors
    /// Cells that contradict each other, or one that may be two numbers.
    pub(super) fn decide(self, has_commas: bool) -> Result<Notation, UnclearNotation> {
        let [decimal_point, decimal_comma] = self.decimal;
        let [thousands_point, thousands_comma] = self.thousands;
        let [either_point, either_comma] = self.either;
        let points = decimal_point.or(thousands_comma);
        let commas = decimal_comma.or(thousands_point);
        match (points, commas) {
            (Some(point), Some(comma)) => Err(UnclearNotation::TwoNotations(point, comma)),
            (Some(_), None) => Ok(Notation::POINT),
            (None, Some(_)) => Ok(Notation::COMMA),
            (None, None) => match (either_point, either_comma) {
                (None, None) => Ok(Notation::POINT),
                (Some(_), None) if has_commas => Ok(Notation::POINT),
                (Some(one), _) | (None, Some(one)) => Err(UnclearNotation::OneCell(one)),
            },
        }
    }
}

impl Evidence {
    /// Returns both numbers that the cell can be: with thousands, and with decimals.
    pub(super) fn readings(&self) -> [String; 2] {
        let text = remove_groups(&self.cell);
        [text.replace(MARKS, ""), text.replace(MARKS, ".")]
    }
}

/// Returns the index of a mark in [`MARKS`].
fn mark_index(mark: char) -> usize {
    usize::from(mark == MARKS[1])
}

/// Returns the mark of thousands for a decimal mark.
fn other_mark(mark: char) -> char {
    MARKS[1 - mark_index(mark)]
}

/// Returns the evidence of a cell.
fn mark_evidence(cell: &str) -> MarkEvidence {
    let number = cell.strip_prefix(['+', '-']).unwrap_or(cell);
    let mantissa = number.split(['e', 'E']).next().unwrap_or_default();
    let has_exponent = mantissa.len() < number.len();
    let Some(last) = mantissa.rfind(MARKS) else { return MarkEvidence::Nothing };
    let mark = if mantissa.as_bytes()[last] == b'.' { MARKS[0] } else { MARKS[1] };
    let before = &mantissa[..last];
    let after = &mantissa[last + 1..];
    if !is_digits(after) || before.is_empty() && after.is_empty() {
        return MarkEvidence::Nothing;
    }
    if before.contains(mark) {
        let is_whole = !has_exponent && is_grouped(mantissa, mark);
        return if is_whole { MarkEvidence::Thousands(mark) } else { MarkEvidence::Nothing };
    }
    if before.contains(other_mark(mark)) {
        let is_number = is_grouped(before, other_mark(mark));
        return if is_number { MarkEvidence::Decimal(mark) } else { MarkEvidence::Nothing };
    }
    match is_digits(before) {
        false => MarkEvidence::Nothing,
        true if !has_exponent && is_grouped(mantissa, mark) => MarkEvidence::Either(mark),
        true => MarkEvidence::Decimal(mark),
    }
}

/// Returns whether a text consists of digits, or is empty.
fn is_digits(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_digit())
}

/// Returns whether a mark separates groups of three digits; the first group does not begin with 0.
fn is_grouped(text: &str, mark: char) -> bool {
    let mut groups = text.split(mark);
    let first = groups.next().unwrap_or_default();
    let is_first = (1..=GROUP_DIGITS).contains(&first.len()) && is_digits(first);
    is_first
        && !first.starts_with('0')
        && groups.all(|group| group.len() == GROUP_DIGITS && is_digits(group))
}

/// Returns a cell without marks that only separate thousands.
fn remove_groups(cell: &str) -> Cow<'_, str> {
    let Some(mark) = cell.chars().find(|mark| GROUP_MARKS.contains(mark)) else {
        return Cow::Borrowed(cell);
    };
    let number = cell.strip_prefix(['+', '-']).unwrap_or(cell);
    let integer_part = number.split(MARKS).next().unwrap_or_default();
    match is_grouped(integer_part, mark) {
        true => Cow::Owned(cell.replace(mark, "")),
        false => Cow::Borrowed(cell),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(cells: &[&str], has_commas: bool) -> Result<Vec<Option<f64>>, UnclearNotation> {
        let mut evidence = NotationEvidence::default();
        cells.iter().for_each(|cell| evidence.add_cell(cell, 0..cell.len()));
        let notation = evidence.decide(has_commas)?;
        Ok(cells.iter().map(|cell| notation.parse_number(cell)).collect())
    }

    #[test]
    fn a_file_decides_between_decimals_and_thousands() {
        for (cells, numbers) in [
            (["0.9", "950", "1,050"], [0.9, 950.0, 1050.0]),
            (["0,9", "950,0", "1.050"], [0.9, 950.0, 1050.0]),
            (["0.9", "1.050", "12.345"], [0.9, 1.05, 12.345]),
            (["1,234,567", "1,050", "0.5"], [1_234_567.0, 1050.0, 0.5]),
            (["1.234.567", "1.050", "-2"], [1_234_567.0, 1050.0, -2.0]),
            (["1.234,5", "1.050", "0,125"], [1234.5, 1050.0, 0.125]),
            (["-1'234.5", "1 050", "+3"], [-1234.5, 1050.0, 3.0]),
            (["1\u{a0}234,5", "1e3", "2,5e-3"], [1234.5, 1e3, 2.5e-3]),
            (["1.050e3", ".5", "7."], [1050.0, 0.5, 7.0]),
            (["1234,567", "0,050", "1,050"], [1234.567, 0.05, 1.05]),
        ] {
            assert_eq!(read(&cells, false).unwrap(), numbers.map(Some), "{cells:?}");
        }
    }

    #[test]
    fn unclear_notations_are_rejected() {
        for cells in [["0,9", "0.9"], ["0.9", "1.234.567"], ["1,234,567", "0,9"]] {
            assert!(
                matches!(read(&cells, false), Err(UnclearNotation::TwoNotations(..))),
                "{cells:?}"
            );
        }
        for cells in [["950", "1,050"], ["1.050", "2"], ["1.050", "1,050"]] {
            let Err(UnclearNotation::OneCell(cell)) = read(&cells, false) else {
                panic!("{cells:?}")
            };
            assert!(cells.contains(&cell.cell.as_str()));
            assert_eq!(cell.readings(), ["1050", "1.050"]);
        }
        assert_eq!(read(&["1.050", "2"], true).unwrap(), [Some(1.05), Some(2.0)]);
        assert!(matches!(read(&["1,050", "2"], true), Err(UnclearNotation::OneCell(_))));
    }

    #[test]
    fn cells_without_a_number_are_no_evidence() {
        for cell in ["1.2.3", "12:30", "a,b", "1,05,000", "1,0,5", ".", "1,050.", "01,050.2"] {
            let numbers = read(&["0.5", cell], false).unwrap();
            assert!(numbers[1].is_none() || cell == "1,050.", "{cell}: {numbers:?}");
        }
    }
}

//! The notation of a table's numbers: its decimal mark, and the separator of groups of three
//! digits. All cells decide together, because `1.050` alone may be 1.05 or 1050.

use std::borrow::Cow;
use std::ops::Range;

/// The marks that separate decimals in some countries and thousands in others.
const DECIMAL_OR_GROUP_MARKS: [char; 2] = ['.', ','];

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
pub(super) struct CellEvidence {
    /// The text of the cell.
    pub(super) cell: String,
    /// The range of the cell in the file, in bytes.
    pub(super) byte_range: Range<usize>,
}

/// The evidence so far: the first cell of each kind for each mark.
#[derive(Debug, Default)]
pub(super) struct NotationEvidence {
    decimal_cells: [Option<CellEvidence>; 2],
    thousands_cells: [Option<CellEvidence>; 2],
    ambiguous_cells: [Option<CellEvidence>; 2],
}

/// The reason why the notation of a file is unclear.
#[derive(Debug)]
pub(super) enum UnclearNotation {
    /// Two cells have decimals with different marks.
    TwoNotations(CellEvidence, CellEvidence),
    /// The cell can be two numbers, and no other cell decides.
    OneCell(CellEvidence),
}

/// A notation by its decimal mark; the other mark separates thousands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Notation {
    decimal_mark: char,
}

impl Notation {
    /// Decimal points.
    pub(super) const DECIMAL_POINT: Self = Self { decimal_mark: '.' };

    /// Decimal commas.
    pub(super) const DECIMAL_COMMA: Self = Self { decimal_mark: ',' };

    /// Parses the number in a cell.
    pub(super) fn parse_number(self, cell: &str) -> Option<f64> {
        if self == Self::DECIMAL_POINT && !cell.contains(',') && !cell.contains(GROUP_MARKS) {
            return cell.parse().ok();
        }
        let cell = remove_group_marks(cell);
        let group_mark = thousands_mark(self.decimal_mark);
        match classify_mark(&cell) {
            MarkEvidence::Nothing if cell.contains(DECIMAL_OR_GROUP_MARKS) => None,
            MarkEvidence::Decimal(mark) if mark != self.decimal_mark => None,
            MarkEvidence::Thousands(mark) if mark == self.decimal_mark => None,
            _ => cell.replace(group_mark, "").replace(self.decimal_mark, ".").parse().ok(),
        }
    }
}

impl NotationEvidence {
    /// Adds the evidence of a cell.
    pub(super) fn add_cell(&mut self, cell: &str, byte_range: Range<usize>) {
        if !cell.contains(DECIMAL_OR_GROUP_MARKS) {
            return;
        }
        let text = remove_group_marks(cell);
        let (cells_of_kind, mark) = match classify_mark(&text) {
            MarkEvidence::Nothing => return,
            MarkEvidence::Decimal(mark) => (&mut self.decimal_cells, mark),
            MarkEvidence::Thousands(mark) => (&mut self.thousands_cells, mark),
            MarkEvidence::Either(mark) => (&mut self.ambiguous_cells, mark),
        };
        cells_of_kind[mark_index(mark)]
            .get_or_insert_with(|| CellEvidence { cell: cell.to_owned(), byte_range });
    }

    /// Returns the notation in which every cell is a number. `has_commas` says that commas separate
    /// cells; such files have decimal points.
    ///
    /// # Errors
    /// Cells that contradict each other, or one that may be two numbers.
    pub(super) fn decide(self, has_commas: bool) -> Result<Notation, UnclearNotation> {
        let [decimal_point, decimal_comma] = self.decimal_cells;
        let [thousands_point, thousands_comma] = self.thousands_cells;
        let [either_point, either_comma] = self.ambiguous_cells;
        let point_evidence = decimal_point.or(thousands_comma);
        let comma_evidence = decimal_comma.or(thousands_point);
        match (point_evidence, comma_evidence) {
            (Some(point), Some(comma)) => Err(UnclearNotation::TwoNotations(point, comma)),
            (Some(_), None) => Ok(Notation::DECIMAL_POINT),
            (None, Some(_)) => Ok(Notation::DECIMAL_COMMA),
            (None, None) => match (either_point, either_comma) {
                (None, None) => Ok(Notation::DECIMAL_POINT),
                (Some(_), None) if has_commas => Ok(Notation::DECIMAL_POINT),
                (Some(one), _) | (None, Some(one)) => Err(UnclearNotation::OneCell(one)),
            },
        }
    }
}

impl CellEvidence {
    /// Returns both numbers that the cell can be: with thousands, and with decimals.
    pub(super) fn possible_numbers(&self) -> [String; 2] {
        let text = remove_group_marks(&self.cell);
        [text.replace(DECIMAL_OR_GROUP_MARKS, ""), text.replace(DECIMAL_OR_GROUP_MARKS, ".")]
    }
}

/// Returns the index of a mark in [`DECIMAL_OR_GROUP_MARKS`].
fn mark_index(mark: char) -> usize {
    usize::from(mark == DECIMAL_OR_GROUP_MARKS[1])
}

/// Returns the mark of thousands for a decimal mark.
fn thousands_mark(mark: char) -> char {
    DECIMAL_OR_GROUP_MARKS[1 - mark_index(mark)]
}

/// Returns the evidence of a cell.
fn classify_mark(cell: &str) -> MarkEvidence {
    let number = cell.strip_prefix(['+', '-']).unwrap_or(cell);
    let mantissa = number.split(['e', 'E']).next().unwrap_or_default();
    let has_exponent = mantissa.len() < number.len();
    let Some(last_mark) = mantissa.rfind(DECIMAL_OR_GROUP_MARKS) else {
        return MarkEvidence::Nothing;
    };
    let mark = if mantissa.as_bytes()[last_mark] == b'.' {
        DECIMAL_OR_GROUP_MARKS[0]
    } else {
        DECIMAL_OR_GROUP_MARKS[1]
    };
    let digits_before = &mantissa[..last_mark];
    let digits_after = &mantissa[last_mark + 1..];
    if !is_digits(digits_after) || digits_before.is_empty() && digits_after.is_empty() {
        return MarkEvidence::Nothing;
    }
    if digits_before.contains(mark) {
        let is_grouped_integer = !has_exponent && is_grouped(mantissa, mark);
        return if is_grouped_integer {
            MarkEvidence::Thousands(mark)
        } else {
            MarkEvidence::Nothing
        };
    }
    if digits_before.contains(thousands_mark(mark)) {
        let is_number = is_grouped(digits_before, thousands_mark(mark));
        return if is_number { MarkEvidence::Decimal(mark) } else { MarkEvidence::Nothing };
    }
    match is_digits(digits_before) {
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
    let first_group = groups.next().unwrap_or_default();
    let is_first_group = (1..=GROUP_DIGITS).contains(&first_group.len()) && is_digits(first_group);
    is_first_group
        && !first_group.starts_with('0')
        && groups.all(|group| group.len() == GROUP_DIGITS && is_digits(group))
}

/// Returns a cell without marks that only separate thousands.
fn remove_group_marks(cell: &str) -> Cow<'_, str> {
    let Some(mark) = cell.chars().find(|mark| GROUP_MARKS.contains(mark)) else {
        return Cow::Borrowed(cell);
    };
    let number = cell.strip_prefix(['+', '-']).unwrap_or(cell);
    let integer_part = number.split(DECIMAL_OR_GROUP_MARKS).next().unwrap_or_default();
    match is_grouped(integer_part, mark) {
        true => Cow::Owned(cell.replace(mark, "")),
        false => Cow::Borrowed(cell),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse_cells(cells: &[&str], has_commas: bool) -> Result<Vec<Option<f64>>, UnclearNotation> {
        let mut evidence = NotationEvidence::default();
        cells.iter().for_each(|cell| evidence.add_cell(cell, 0..cell.len()));
        let notation = evidence.decide(has_commas)?;
        Ok(cells.iter().map(|cell| notation.parse_number(cell)).collect())
    }

    #[test]
    fn a_file_decides_between_decimals_and_thousands() {
        for (cells, expected_numbers) in [
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
            assert_eq!(
                parse_cells(&cells, false).unwrap(),
                expected_numbers.map(Some),
                "{cells:?}"
            );
        }
    }

    #[test]
    fn unclear_notations_are_rejected() {
        for cells in [["0,9", "0.9"], ["0.9", "1.234.567"], ["1,234,567", "0,9"]] {
            assert!(
                matches!(parse_cells(&cells, false), Err(UnclearNotation::TwoNotations(..))),
                "{cells:?}"
            );
        }
        for cells in [["950", "1,050"], ["1.050", "2"], ["1.050", "1,050"]] {
            let Err(UnclearNotation::OneCell(cell)) = parse_cells(&cells, false) else {
                panic!("{cells:?}")
            };
            assert!(cells.contains(&cell.cell.as_str()));
            assert_eq!(cell.possible_numbers(), ["1050", "1.050"]);
        }
        assert_eq!(parse_cells(&["1.050", "2"], true).unwrap(), [Some(1.05), Some(2.0)]);
        assert!(matches!(parse_cells(&["1,050", "2"], true), Err(UnclearNotation::OneCell(_))));
    }

    #[test]
    fn cells_without_a_number_are_no_evidence() {
        for cell in ["1.2.3", "12:30", "a,b", "1,05,000", "1,0,5", ".", "1,050.", "01,050.2"] {
            let numbers = parse_cells(&["0.5", cell], false).unwrap();
            assert!(numbers[1].is_none() || cell == "1,050.", "{cell}: {numbers:?}");
        }
    }
}

//! Formatting of cells and summaries for people.

use std::fmt::{Display, Write as _};
use std::path::Path;

use super::grid::quote_for_shell;
use crate::program::program;
use sweep_results::Cell;

/// A summary of lines, each with a name and a text.
pub trait Lines {
    /// Adds a line.
    fn line(&mut self, name: &str, text: impl Display);

    /// Adds a line with the command that the user may run next on a file.
    fn suggest_command(&mut self, verb: &str, file: &Path) {
        let file = quote_for_shell(&file.display().to_string());
        self.line("next", format!("{} {verb} {file}", program()));
    }
}

impl Lines for String {
    fn line(&mut self, name: &str, text: impl Display) {
        // Writing to a String cannot fail.
        let _ = writeln!(self, "{name:>10}  {text}");
    }
}

/// Formats a number with six digits, and with an exponent only if it is very large or small.
pub fn format_number(value: f64) -> String {
    if value == 0.0 || (1e-4..1e9).contains(&value.abs()) {
        // Small numbers keep their digits behind the zeros.
        let decimals = 5 - value.abs().max(1e-300).log10().floor().min(0.0) as i32;
        let text = format!("{value:.*}", decimals.clamp(6, 9) as usize);
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{value:.5e}")
    }
}

/// Returns the shortest decimal that differs from a number by rounding noise only, for display:
/// 43.5 for 43.49999999999999.
pub(super) fn without_rounding_noise(value: f64) -> f64 {
    /// Greatest difference, in units of the last place. Basis: a number that follows from others
    /// by some ten operations. Doubling it hides more of the last digit.
    const ROUNDING_ULPS: f64 = 4.0;
    let max_noise = ROUNDING_ULPS * f64::EPSILON * value.abs();
    let mut candidates =
        (0..15).filter_map(|digits| format!("{value:.digits$e}").parse::<f64>().ok());
    let is_near = |candidate: &f64| (candidate - value).abs() <= max_noise;
    candidates.find(is_near).unwrap_or(value)
}

/// Formats a range by a function. If both ends become the same text, they are written with all
/// digits.
pub fn format_range([from, to]: [f64; 2], format: impl Fn(f64) -> String) -> String {
    let is_distinct = from == to || format(from) != format(to);
    let [from, to] = [from, to].map(|end| if is_distinct { format(end) } else { end.to_string() });
    format!("{from} to {to}")
}

/// Formats a cell.
pub fn format_cell(cell: &Cell) -> String {
    match cell {
        Cell::Null => "null".to_owned(),
        Cell::Number(number) => format_number(*number),
        Cell::Text(text) => shorten(text),
        Cell::Flag(flag) => flag.to_string(),
    }
}

/// Shortens a text to fit a line, because a file of another program may have very long texts.
pub fn shorten(text: &str) -> String {
    /// The maximum number of characters. Basis: the width of a terminal. Doubling it fills two
    /// lines.
    const MAX_CHARACTERS: usize = 80;
    match text.char_indices().nth(MAX_CHARACTERS) {
        Some((end, _)) => format!("{}... ({} characters)", &text[..end], text.chars().count()),
        None => text.to_owned(),
    }
}

/// Formats a table with headings. Each column is as wide as its widest cell, and each line begins
/// with `indent`.
pub fn format_table(headings: &[String], rows: &[Vec<String>], indent: &str) -> String {
    let width_of = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column)).chain(headings.get(column));
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..headings.len()).map(width_of).collect();
    let format_line = |cells: &[String]| {
        let padded_cells: Vec<String> =
            cells.iter().zip(&widths).map(|(cell, &width)| format!("{cell:>width$}")).collect();
        format!("{indent}{}\n", padded_cells.join("  ").trim_end())
    };
    std::iter::once(format_line(headings)).chain(rows.iter().map(|row| format_line(row))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_noise_is_not_shown_and_digits_are_kept() {
        for (value, shown_text) in [
            (43.499_999_999_999_99, "43.5"),
            (23.887_500_000_000_003, "23.8875"),
            (0.1 + 0.2, "0.3"),
            (-0.449_999_999_999_999_96, "-0.45"),
            (1.0 / 3.0, "0.3333333333333333"),
            (0.181_584_158_415_841_58, "0.18158415841584158"),
            (43.499_999, "43.499999"),
            (2e8, "200000000"),
            (0.0, "0"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(without_rounding_noise(value).to_string(), shown_text);
        }
    }

    #[test]
    fn numbers_have_six_digits() {
        let formatted: Vec<String> =
            [0.0, 0.05, 300.0, -1.5e-7, 2e12, 1.0 / 3.0, 0.549_999_999_999_999_9, 0.001_234_567_8]
                .into_iter()
                .map(format_number)
                .collect();
        let expected_values =
            ["0", "0.05", "300", "-1.50000e-7", "2.00000e12", "0.333333", "0.55", "0.00123457"];
        assert_eq!(formatted, expected_values);
    }

    #[test]
    fn the_ends_of_a_range_are_distinct() {
        let formatted = [[0.6, 0.600_000_1], [0.6, 0.6], [1.0, 2.0]]
            .map(|ends| format_range(ends, format_number));
        assert_eq!(formatted, ["0.6 to 0.6000001", "0.6 to 0.6", "1 to 2"]);
    }

    #[test]
    fn long_words_are_clipped_between_characters() {
        assert_eq!(format_cell(&Cell::Text("\u{e4}".repeat(80))), "\u{e4}".repeat(80));
        let formatted = format_cell(&Cell::Text("\u{e4}".repeat(1000)));
        assert_eq!(formatted, format!("{}... (1000 characters)", "\u{e4}".repeat(80)));
    }

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let cells =
            |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>();
        let text =
            format_table(&cells(&["a", "long"]), &[cells(&["10", "1"]), cells(&["2", "3"])], " ");
        assert_eq!(text, "  a  long\n 10     1\n  2     3\n");
    }
}

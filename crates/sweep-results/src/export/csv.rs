//! Export to text that spreadsheets, pandas (`comment="#"`) and gnuplot read.

use std::fmt::Write as _;

use sweep_files::{Cell, EXPORTED_CSV, FileError, ResultTable, key};

use super::column_names;

/// Number of bytes that are collected before they are written. Basis: it only has to be far greater
/// than a row. Doubling it halves the number of writes.
const WRITE_SIZE: usize = 1 << 16;

/// Writes rows as they are read, because the whole text may be far larger than the file, which
/// stores a word only once however many rows have it.
pub(super) fn write(
    table: &ResultTable,
    append: &mut dyn FnMut(&str) -> Result<(), FileError>,
) -> Result<(), FileError> {
    let version = table.file().value(key::VERSION).unwrap_or("of another version");
    let mut text = format!("{EXPORTED_CSV}{}\n", escape_comment(version));
    // Writing to a String cannot fail.
    for column in &table.columns {
        let unit = if column.unit().is_empty() { "-" } else { column.unit() };
        let _ = writeln!(
            text,
            "# {} [{}]: {}",
            escape_comment(&column.name),
            escape_comment(unit),
            escape_comment(&column.metadata.description)
        );
    }
    if let Some(plan) = table.file().value(key::PLAN) {
        let _ = writeln!(text, "# plan: {}", escape_comment(plan));
    }
    let names = column_names(table);
    let headings: Vec<String> = names.iter().map(|name| quote_cell(name)).collect();
    let _ = writeln!(text, "{}", headings.join(","));
    table.file().each_row(&names, |row| {
        for column in 0..names.len() {
            let _ = match row.cell(column) {
                Cell::Null => Ok(()),
                Cell::Number(number) => text.write_str(&format_number(number)),
                Cell::Text(word) => text.write_str(&quote_cell(&word)),
                Cell::Flag(flag) => write!(text, "{flag}"),
            };
            text.push(if column + 1 < names.len() { ',' } else { '\n' });
        }
        if text.len() >= WRITE_SIZE {
            append(&text)?;
            text.clear();
        }
        Ok::<(), FileError>(())
    })?;
    append(&text)
}

/// Formats a number with the fewest digits that parse to the same number, with an exponent if that
/// is shorter.
fn format_number(number: f64) -> String {
    let plain_text = number.to_string();
    let with_exponent = format!("{number:e}");
    if plain_text.len() <= with_exponent.len() { plain_text } else { with_exponent }
}

/// Escapes a comment so that it is one line and no spreadsheet finds a formula in it.
///
/// A spreadsheet splits a comment into cells at commas, semicolons and tabs, and takes a cell that
/// begins with `=`, `+`, `-` or `@` for a formula. Such a sign gets an apostrophe before it, unless
/// it belongs to a number.
fn escape_comment(text: &str) -> String {
    let mut line = String::with_capacity(text.len());
    let mut is_cell_start = false;
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        let letter = if letter.is_control() && letter != '\t' { ' ' } else { letter };
        let is_number = letter == '-' && letters.peek().is_some_and(char::is_ascii_digit);
        if is_cell_start && "=+-@".contains(letter) && !is_number {
            line.push('\'');
        }
        line.push(letter);
        is_cell_start = ",;\t\"".contains(letter) || (is_cell_start && letter == ' ');
    }
    line
}

/// Formats a text as one cell, in quotes where it contains separators. A text that a spreadsheet
/// would take for a formula gets an apostrophe.
fn quote_cell(text: &str) -> String {
    let is_formula = text.trim_start().starts_with(['=', '+', '-', '@']);
    if is_formula || text.contains(['"', ',', ';', '\t', '\n', '\r', '#']) {
        let apostrophe = if is_formula { "'" } else { "" };
        format!("\"{apostrophe}{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    #[test]
    fn comments_come_first_then_names_then_rows() {
        let mut text = String::new();
        let mut append = |part: &str| {
            text.push_str(part);
            Ok(())
        };
        write(&sample::table(), &mut append).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].starts_with("# exported by sweep "), "{}", lines[0]);
        assert!(lines.iter().any(|line| line.starts_with("# damping_n_s_per_m [N s/m]")));
        let heading_line = lines.iter().position(|line| !line.starts_with('#')).unwrap();
        assert!(lines[heading_line].starts_with("point,unbalance_mass_kg,damping_n_s_per_m,"));
        assert_eq!(lines[heading_line + 1], "0,0.1,60,1,1,1,1,true,false,0.009000000000000001,ok");
        assert_eq!(lines[heading_line + 4], "3,0.2,60,,1,,,,false,,diverged");
        assert_eq!(lines.len(), heading_line + 7);
    }

    #[test]
    fn a_long_word_in_many_rows_is_written_in_parts() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("x.parquet");
        let word = "a".repeat(1 << 18);
        sample::write(
            &path,
            vec![("status", "", sample::text_array(&vec![word.as_str(); 100]))],
            &[],
        );
        let mut longest_part_bytes = 0;
        let mut total_bytes = 0;
        let mut count_bytes = |text: &str| {
            longest_part_bytes = text.len().max(longest_part_bytes);
            total_bytes += text.len();
            Ok(())
        };
        write(&ResultTable::open(&path).unwrap(), &mut count_bytes).unwrap();
        assert!(
            total_bytes > 100 << 18 && longest_part_bytes < 2 << 18,
            "{total_bytes} {longest_part_bytes}"
        );
    }

    #[test]
    fn comments_are_escaped_so_that_no_cell_is_a_formula() {
        assert_eq!(
            escape_comment(r#"{"name":"x","values":[1.0,-2.0]}"#),
            r#"{"name":"x","values":[1.0,-2.0]}"#
        );
        for (text, escaped) in [
            (r#"{"name":"=1+1"}"#, r#"{"name":"'=1+1"}"#),
            ("a,=1+1", "a,'=1+1"),
            ("a; \t@SUM(A1)", "a; \t'@SUM(A1)"),
            ("a,+1", "a,'+1"),
            ("a,-x()", "a,'-x()"),
            ("a\n=1\r,=2", "a =1 ,'=2"),
        ] {
            assert_eq!(escape_comment(text), escaped);
        }
    }

    #[test]
    fn texts_with_separators_or_formulas_are_quoted() {
        assert_eq!(quote_cell("ok"), "ok");
        assert_eq!(quote_cell("a,\"b\""), "\"a,\"\"b\"\"\"");
        assert_eq!(quote_cell("=cmd()"), "\"'=cmd()\"");
        assert_eq!([1e-7, 0.25, 1e22].map(format_number), ["1e-7", "0.25", "1e22"]);
    }
}

//! Text that spreadsheets, pandas (`comment="#"`) and gnuplot read.

use std::fmt::Write as _;

use sweep_files::{Cell, EXPORTED_CSV, FileError, ResultTable, key};

use super::names;

/// Bytes of text that are written at once, at least.
const AT_ONCE: usize = 1 << 16;

/// Writes rows as they are read: one word of a small file may stand in all of its rows.
pub(super) fn write(
    table: &ResultTable,
    put: &mut dyn FnMut(&str) -> Result<(), FileError>,
) -> Result<(), FileError> {
    let version = table.file().value(key::VERSION).unwrap_or("of another version");
    let mut text = format!("{EXPORTED_CSV}{}\n", no_cells(version));
    // Writing to a String cannot fail.
    for column in &table.columns {
        let unit = if column.unit.is_empty() { "-" } else { &column.unit };
        let (unit, description) = (no_cells(unit), no_cells(&column.description));
        let _ = writeln!(text, "# {} [{unit}]: {description}", no_cells(&column.name));
    }
    if let Some(plan) = table.file().value(key::PLAN) {
        let _ = writeln!(text, "# plan: {}", no_cells(plan));
    }
    let names = names(table);
    let headings: Vec<String> = names.iter().map(|name| quoted(name)).collect();
    let _ = writeln!(text, "{}", headings.join(","));
    table.file().each_row(&names, |row| {
        for column in 0..names.len() {
            let _ = match row.cell(column) {
                Cell::Null => Ok(()),
                // The shortest digits that read back to the same number.
                Cell::Number(number) => text.write_str(&shortest(number)),
                Cell::Text(word) => text.write_str(&quoted(&word)),
                Cell::Flag(flag) => write!(text, "{flag}"),
            };
            text.push(if column + 1 < names.len() { ',' } else { '\n' });
        }
        if text.len() >= AT_ONCE {
            put(&text)?;
            text.clear();
        }
        Ok::<(), FileError>(())
    })?;
    put(&text)
}

/// The shortest digits of a number, with an exponent where that is shorter.
fn shortest(number: f64) -> String {
    let (plain, exponent) = (number.to_string(), format!("{number:e}"));
    if plain.len() <= exponent.len() { plain } else { exponent }
}

/// A text on one line, of which a sheet makes no formula: it takes commas, semicolons and tabs of a
/// comment for the borders of cells, and a cell that begins with a sign for a formula. Such a sign
/// moves behind an apostrophe. A JSON number keeps its sign: it is in no text.
fn no_cells(text: &str) -> String {
    let mut line = String::with_capacity(text.len());
    let mut begins = false;
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        let c = if c.is_control() && c != '\t' { ' ' } else { c };
        let is_number = c == '-' && chars.peek().is_some_and(char::is_ascii_digit);
        if begins && "=+-@".contains(c) && !is_number {
            line.push('\'');
        }
        line.push(c);
        begins = ",;\t\"".contains(c) || (begins && c == ' ');
    }
    line
}

/// A text as a cell: in quotes where it would be taken for more than one.
fn quoted(text: &str) -> String {
    // A sheet takes what begins like this for a formula.
    let formula = text.trim_start().starts_with(['=', '+', '-', '@']);
    if formula || text.contains(['"', ',', ';', '\t', '\n', '\r', '#']) {
        let mark = if formula { "'" } else { "" };
        format!("\"{mark}{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    #[test]
    fn rows_stand_under_their_names_and_units_above() {
        let mut text = String::new();
        let mut put = |more: &str| {
            text.push_str(more);
            Ok(())
        };
        write(&sample::table(), &mut put).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].starts_with("# exported by sweep "), "{}", lines[0]);
        assert!(lines.iter().any(|line| line.starts_with("# damping_n_s_per_m [N s/m]")));
        let head = lines.iter().position(|line| !line.starts_with('#')).unwrap();
        assert!(lines[head].starts_with("point,unbalance_mass_kg,damping_n_s_per_m,"));
        assert_eq!(lines[head + 1], "0,0.1,60,1,1,1,1,true,false,0.009000000000000001,ok");
        assert_eq!(lines[head + 4], "3,0.2,60,,1,,,,false,,diverged");
        assert_eq!(lines.len(), head + 7);
    }

    #[test]
    fn a_word_of_many_rows_is_in_memory_a_few_times_at_once() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("x.parquet");
        let word = "a".repeat(1 << 18);
        sample::write(&path, vec![("status", "", sample::texts(&vec![word.as_str(); 100]))], &[]);
        let (mut most, mut all) = (0, 0);
        let mut put = |text: &str| {
            (most, all) = (text.len().max(most), all + text.len());
            Ok(())
        };
        write(&ResultTable::open(&path).unwrap(), &mut put).unwrap();
        assert!(all > 100 << 18 && most < 2 << 18, "{all} {most}");
    }

    #[test]
    fn no_cell_of_a_comment_begins_as_a_formula() {
        assert_eq!(
            no_cells(r#"{"name":"x","values":[1.0,-2.0]}"#),
            r#"{"name":"x","values":[1.0,-2.0]}"#
        );
        for (text, mended) in [
            (r#"{"name":"=1+1"}"#, r#"{"name":"'=1+1"}"#),
            ("a,=1+1", "a,'=1+1"),
            ("a; \t@SUM(A1)", "a; \t'@SUM(A1)"),
            ("a,+1", "a,'+1"),
            ("a,-x()", "a,'-x()"),
            ("a\n=1\r,=2", "a =1 ,'=2"),
        ] {
            assert_eq!(no_cells(text), mended);
        }
    }

    #[test]
    fn texts_that_mean_more_are_quoted() {
        assert_eq!(quoted("ok"), "ok");
        assert_eq!(quoted("a,\"b\""), "\"a,\"\"b\"\"\"");
        assert_eq!(quoted("=cmd()"), "\"'=cmd()\"");
        assert_eq!([shortest(1e-7), shortest(0.25), shortest(1e22)], ["1e-7", "0.25", "1e22"]);
    }
}

//! A workbook of three sheets: the rows, the columns with units and descriptions, the plan.

use rust_xlsxwriter::{
    DocProperties, ExcelDateTime, Format as Style, Workbook, Worksheet, XlsxError,
};
use serde_json::Value;
use sweep_files::{Cell, Column, ResultTable, dotted, key, leaves, panics};

use super::{Format, names, no_room};
use crate::error::{Result, ResultsError};

/// Rows of a sheet, less the two of headings.
const MOST_ROWS: u64 = (1 << 20) - 2;
/// Columns of a sheet.
const MOST_COLUMNS: usize = 1 << 14;
/// Characters of a sheet's cell.
const LONGEST: usize = 32_767;
/// Widths of columns (characters): of a number, and of the longest words that are not cut off.
const WIDTHS: [usize; 2] = [12, 60];
/// What a filter's button takes of a heading (characters).
const BUTTON: usize = 3;

/// Returns the workbook of a table. The library panics where the system refuses its temporary
/// files.
pub(super) fn bytes(table: &ResultTable) -> Result<Vec<u8>> {
    let written = panics::caught(|| workbook(table));
    let reason = |panic| format!("the system refused a temporary file: {panic}");
    written.unwrap_or_else(|panic| Err(no_room(table, Format::Xlsx, &reason(panic))))
}

fn workbook(table: &ResultTable) -> Result<Vec<u8>> {
    let no_room = |reason: String| no_room(table, Format::Xlsx, &reason);
    if table.rows() > MOST_ROWS {
        let reason = format!("{} rows, and a sheet has room for {MOST_ROWS}", table.rows());
        return Err(no_room(reason));
    }
    if table.columns.len() > MOST_COLUMNS {
        return Err(no_room(format!("more than {MOST_COLUMNS} columns")));
    }
    let mut book = Workbook::new();
    let refused = |error: XlsxError| no_room(error.to_string());
    let mut rows = Sheet::new(&mut book, "rows", 2).map_err(refused)?;
    fill(&mut rows, table, refused)?;
    about_columns(&mut book, table)
        .and_then(|()| about_plan(&mut book, table))
        .and_then(|()| {
            // The same rows give the same bytes, whenever it is.
            let made = ExcelDateTime::from_ymd(2000, 1, 1)?;
            book.set_properties(&DocProperties::new().set_creation_datetime(&made));
            book.save_to_buffer()
        })
        .map_err(refused)
}

/// A sheet in the making, row by row: what is written is in a temporary file.
struct Sheet<'a> {
    sheet: &'a mut Worksheet,
    row: u32,
}

impl<'a> Sheet<'a> {
    /// With so many rows of headings, which stay in sight.
    fn new(book: &'a mut Workbook, name: &str, headings: u32) -> Result<Self, XlsxError> {
        let sheet = book.add_worksheet_with_constant_memory()?;
        sheet.set_name(name)?.set_freeze_panes(headings, 0)?;
        sheet.set_row_format(0, &Style::new().set_bold())?;
        Ok(Self { sheet, row: 0 })
    }

    fn row(&mut self, cells: impl IntoIterator<Item = Cell>) -> Result<(), XlsxError> {
        for (column, cell) in (0..).zip(cells) {
            match cell {
                // What is missing has no cell.
                Cell::Null => continue,
                Cell::Number(number) if number.is_finite() => {
                    self.sheet.write_number(self.row, column, number)?
                }
                // A sheet has no infinity.
                Cell::Number(number) => {
                    self.sheet.write_string(self.row, column, number.to_string())?
                }
                Cell::Flag(flag) => self.sheet.write_boolean(self.row, column, flag)?,
                Cell::Text(text) => {
                    let fits: String = text.chars().take(LONGEST).collect();
                    self.sheet.write_string(self.row, column, fits)?
                }
            };
        }
        self.row += 1;
        Ok(())
    }

    /// The columns are as wide as these words of theirs.
    fn widths<'b>(&mut self, words: impl Iterator<Item = &'b str>) -> Result<(), XlsxError> {
        for (column, word) in (0..).zip(words) {
            let width = (word.chars().count() + BUTTON).clamp(WIDTHS[0], WIDTHS[1]);
            self.sheet.set_column_width(column, u32::try_from(width).unwrap_or(u32::MAX))?;
        }
        Ok(())
    }
}

fn text(text: &str) -> Cell {
    Cell::Text(text.to_owned())
}

/// The rows, under their names and units, with a filter.
fn fill(
    sheet: &mut Sheet<'_>,
    table: &ResultTable,
    refused: impl Fn(XlsxError) -> ResultsError + Copy,
) -> Result<()> {
    let names = names(table);
    sheet.widths(names.iter().copied()).map_err(refused)?;
    sheet.row(names.iter().map(|name| text(name))).map_err(refused)?;
    sheet.row(table.columns.iter().map(|column| text(&column.unit))).map_err(refused)?;
    let heading = sheet.row - 1;
    table.file().each_row(&names, |row| {
        sheet.row((0..names.len()).map(|column| row.cell(column))).map_err(refused)
    })?;
    let last = u16::try_from(names.len().saturating_sub(1)).unwrap_or(u16::MAX);
    // Its buttons stand beside the units, so that sorting moves neither units nor names.
    sheet.sheet.autofilter(heading, 0, sheet.row - 1, last).map_err(refused)?;
    Ok(())
}

fn about_columns(book: &mut Workbook, table: &ResultTable) -> Result<(), XlsxError> {
    let mut sheet = Sheet::new(book, "columns", 1)?;
    let longest = |word: fn(&Column) -> &str| {
        let words = table.columns.iter().map(word);
        words.max_by_key(|word| word.chars().count()).unwrap_or_default()
    };
    let widest = [longest(|c| &c.name), longest(|c| &c.unit), longest(|c| &c.description)];
    sheet.widths(widest.into_iter())?;
    sheet.row(["column", "unit", "description"].map(text))?;
    for column in &table.columns {
        sheet.row([&column.name, &column.unit, &column.description].map(|word| text(word)))?;
    }
    Ok(())
}

/// Every number and word of the plan under its path.
fn about_plan(book: &mut Workbook, table: &ResultTable) -> Result<(), XlsxError> {
    let mut sheet = Sheet::new(book, "plan", 1)?;
    let mut all = Vec::new();
    for (name, key) in [("version", key::VERSION), ("numerics", key::NUMERICS)] {
        all.extend(table.file().value(key).map(|value| (name.to_owned(), value.into())));
    }
    if let Some(plan) = &table.plan {
        collect(plan, &mut all);
    }
    let longest = all.iter().map(|(path, _)| path.as_str()).max_by_key(|path| path.len());
    sheet.widths(longest.into_iter())?;
    sheet.row(["setting", "value"].map(text))?;
    for (path, value) in all {
        let value = match &value {
            Value::Number(number) => number.as_f64().map_or(Cell::Null, Cell::Number),
            Value::String(word) => text(word),
            other => text(&other.to_string()),
        };
        sheet.row([Cell::Text(path), value])?;
    }
    Ok(())
}

/// The leaves of a plan by their paths; a list of numbers is one.
fn collect(plan: &Value, found: &mut Vec<(String, Value)>) {
    let opens = |values: &[Value], _: &[Value]| values.iter().any(Value::is_object);
    leaves([Some(plan); 2], opens, &mut Vec::new(), &mut |path, [value, _]| {
        found.extend(value.map(|value| (dotted(path), value.clone())));
    });
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use super::*;
    use crate::sample;

    #[test]
    fn the_same_rows_give_the_same_workbook() {
        let first = bytes(&sample::table()).unwrap();
        assert!(first.starts_with(b"PK\x03\x04"));
        std::thread::sleep(std::time::Duration::from_millis(1100));
        assert_eq!(first, bytes(&sample::table()).unwrap());
    }

    /// A file of the workbook: what follows its local header.
    fn part(book: &[u8], name: &str) -> String {
        let at = book.windows(name.len()).position(|part| part == name.as_bytes()).unwrap();
        let extra = u16::from_le_bytes([book[at - 2], book[at - 1]]);
        let mut text = String::new();
        let packed = &book[at + name.len() + usize::from(extra)..];
        flate2::read::DeflateDecoder::new(packed).read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn rows_have_a_filter_wide_columns_and_headings_that_stay() {
        let sheet = part(&bytes(&sample::table()).unwrap(), "xl/worksheets/sheet1.xml");
        // Names and units are two rows; below them six rows of eleven columns.
        for said in ["<pane ySplit=\"2\"", "state=\"frozen\"", "<autoFilter ref=\"A2:K8\""] {
            assert!(sheet.contains(said), "{said}: {sheet}");
        }
        let number = |text: &str, name: &str| -> f64 {
            let (_, rest) = text.split_once(&format!("{name}=\"")).unwrap();
            rest.split('"').next().unwrap().parse().unwrap()
        };
        // Neighbours of one width share an element.
        let width = |column: f64| {
            let mut of = sheet.split("<col ").skip(1);
            let is_of = |text: &&str| (number(text, "min")..=number(text, "max")).contains(&column);
            number(of.find(is_of).unwrap(), "width")
        };
        assert!(
            width(2.0) > 17.0 && width(1.0) < width(2.0),
            "unbalance_mass_kg needs more than point"
        );
    }

    #[test]
    fn the_plan_is_a_list_of_paths() {
        let mut leaves = Vec::new();
        collect(&sample::plan(), &mut leaves);
        let paths: Vec<&str> = leaves.iter().map(|(path, _)| path.as_str()).collect();
        assert!(paths.contains(&"machine.body.mass_kg"), "{paths:?}");
        assert!(paths.contains(&"axis.1.values"), "{paths:?}");
    }
}

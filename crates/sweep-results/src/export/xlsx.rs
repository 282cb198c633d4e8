//! Export to a workbook with three sheets: the rows, the columns with units and descriptions, the
//! plan.

use rust_xlsxwriter::{
    DocProperties, ExcelDateTime, Format as Style, Workbook, Worksheet, XlsxError,
};
use serde_json::Value;
use sweep_files::{Cell, Column, ResultTable, dotted_path, key, panics, visit_leaves};

use super::{ExportFormat, column_names, export_error};
use crate::error::ResultsError;

/// The number of rows of a sheet (a limit of the format), less two rows of headings.
const MAX_ROWS: u64 = (1 << 20) - 2;
/// The number of columns of a sheet, a limit of the format.
const MAX_COLUMNS: usize = 1 << 14;
/// The number of characters of a cell, a limit of the format. Longer texts are cut.
const MAX_CELL_CHARACTERS: usize = 32_767;
/// The least width of a column, in characters. Basis: most numbers fit. Doubling it makes columns
/// of numbers twice as wide.
const MIN_WIDTH: usize = 12;
/// The greatest width of a column, in characters. Basis: all names of columns fit. Doubling it
/// shows more of long descriptions.
const MAX_WIDTH: usize = 60;
/// The width of a filter's button, in characters, which a heading needs beside its name. Basis: the
/// button covers about three digits in a spreadsheet program. Doubling it widens columns with short
/// cells.
const FILTER_BUTTON_WIDTH: usize = 3;

/// Encodes a table as a workbook.
pub(super) fn encode(table: &ResultTable) -> Result<Vec<u8>, ResultsError> {
    // The library panics where the system refuses its temporary files.
    panics::catch_panic(|| write_workbook(table))
        .unwrap_or_else(|panic| Err(temporary_file_error(table, panic.to_string())))
}

/// Returns the error of a temporary file that the system refused.
fn temporary_file_error(table: &ResultTable, reason: String) -> ResultsError {
    ResultsError::TemporaryFile { path: table.path().to_owned(), reason }
}

fn write_workbook(table: &ResultTable) -> Result<Vec<u8>, ResultsError> {
    let export_error = |reason: String| export_error(table, ExportFormat::Xlsx, &reason);
    if table.rows() > MAX_ROWS {
        let reason = format!("{} rows, and a sheet has room for {MAX_ROWS}", table.rows());
        return Err(export_error(reason));
    }
    if table.columns.len() > MAX_COLUMNS {
        return Err(export_error(format!("more than {MAX_COLUMNS} columns")));
    }
    let mut workbook = Workbook::new();
    let from_xlsx_error = |error: XlsxError| match error {
        XlsxError::IoError(error) | XlsxError::TempFileError(_, error) => {
            temporary_file_error(table, error.to_string())
        }
        other => export_error(other.to_string()),
    };
    let mut rows_sheet = SheetWriter::new(&mut workbook, "rows", 2).map_err(from_xlsx_error)?;
    write_rows(&mut rows_sheet, table, from_xlsx_error)?;
    write_columns(&mut workbook, table).map_err(from_xlsx_error)?;
    write_plan(&mut workbook, table).map_err(from_xlsx_error)?;
    // A fixed date, so that the same rows always give the same bytes.
    let creation_date = ExcelDateTime::from_ymd(2000, 1, 1).map_err(from_xlsx_error)?;
    workbook.set_properties(&DocProperties::new().set_creation_datetime(&creation_date));
    workbook.save_to_buffer().map_err(from_xlsx_error)
}

/// A writer of a sheet's rows. The library keeps the rows in a temporary file.
struct SheetWriter<'a> {
    sheet: &'a mut Worksheet,
    next_row: u32,
}

impl<'a> SheetWriter<'a> {
    /// Adds a sheet in which the first rows, its headings, do not scroll.
    fn new(workbook: &'a mut Workbook, name: &str, heading_rows: u32) -> Result<Self, XlsxError> {
        let sheet = workbook.add_worksheet_with_constant_memory()?;
        sheet.set_name(name)?.set_freeze_panes(heading_rows, 0)?;
        sheet.set_row_format(0, &Style::new().set_bold())?;
        Ok(Self { sheet, next_row: 0 })
    }

    fn write_row(&mut self, cells: impl IntoIterator<Item = Cell>) -> Result<(), XlsxError> {
        for (column, cell) in (0..).zip(cells) {
            match cell {
                Cell::Null => continue,
                Cell::Number(number) if number.is_finite() => {
                    self.sheet.write_number(self.next_row, column, number)?
                }
                // The format has no infinite numbers.
                Cell::Number(number) => {
                    self.sheet.write_string(self.next_row, column, number.to_string())?
                }
                Cell::Flag(flag) => self.sheet.write_boolean(self.next_row, column, flag)?,
                Cell::Text(text) => {
                    let text: String = text.chars().take(MAX_CELL_CHARACTERS).collect();
                    self.sheet.write_string(self.next_row, column, text)?
                }
            };
        }
        self.next_row += 1;
        Ok(())
    }

    /// Makes each column wide enough for a text.
    fn set_widths<'b>(&mut self, texts: impl Iterator<Item = &'b str>) -> Result<(), XlsxError> {
        for (column, text) in (0..).zip(texts) {
            let characters = text.chars().count() + FILTER_BUTTON_WIDTH;
            let width = characters.clamp(MIN_WIDTH, MAX_WIDTH);
            self.sheet.set_column_width(column, u32::try_from(width).unwrap_or(u32::MAX))?;
        }
        Ok(())
    }
}

fn text_cell(text: &str) -> Cell {
    Cell::Text(text.to_owned())
}

/// Writes the rows under their names and units, with a filter.
fn write_rows(
    sheet: &mut SheetWriter<'_>,
    table: &ResultTable,
    from_xlsx_error: impl Fn(XlsxError) -> ResultsError + Copy,
) -> Result<(), ResultsError> {
    let names = column_names(table);
    let units = table.columns.iter().map(|column| text_cell(column.unit()));
    sheet.set_widths(names.iter().copied()).map_err(from_xlsx_error)?;
    sheet.write_row(names.iter().map(|name| text_cell(name))).map_err(from_xlsx_error)?;
    sheet.write_row(units).map_err(from_xlsx_error)?;
    let units_row = sheet.next_row - 1;
    table.file().each_row(&names, |row| {
        sheet.write_row((0..names.len()).map(|column| row.cell(column))).map_err(from_xlsx_error)
    })?;
    let last_row = sheet.next_row - 1;
    let last_column = u16::try_from(names.len().saturating_sub(1)).unwrap_or(u16::MAX);
    // The filter begins at the units, so that sorting moves neither units nor names.
    sheet.sheet.autofilter(units_row, 0, last_row, last_column).map_err(from_xlsx_error)?;
    Ok(())
}

/// Writes the sheet of columns.
fn write_columns(workbook: &mut Workbook, table: &ResultTable) -> Result<(), XlsxError> {
    let mut sheet = SheetWriter::new(workbook, "columns", 1)?;
    let longest_text = |text: fn(&Column) -> &str| {
        let texts = table.columns.iter().map(text);
        texts.max_by_key(|text| text.chars().count()).unwrap_or_default()
    };
    let longest_texts = [
        longest_text(|column| &column.name),
        longest_text(Column::unit),
        longest_text(|column| &column.metadata.description),
    ];
    sheet.set_widths(longest_texts.into_iter())?;
    sheet.write_row(["column", "unit", "description"].map(text_cell))?;
    for column in &table.columns {
        let texts = [&column.name, column.unit(), &column.metadata.description];
        sheet.write_row(texts.map(text_cell))?;
    }
    Ok(())
}

/// Writes the sheet of the plan: each value beside its path.
fn write_plan(workbook: &mut Workbook, table: &ResultTable) -> Result<(), XlsxError> {
    let mut sheet = SheetWriter::new(workbook, "plan", 1)?;
    let mut settings = Vec::new();
    for (name, key) in [("version", key::VERSION), ("numerics", key::NUMERICS)] {
        settings.extend(table.file().value(key).map(|value| (name.to_owned(), value.into())));
    }
    if let Some(plan) = &table.plan {
        collect_leaves(plan, &mut settings);
    }
    let longest_path = settings.iter().map(|(path, _)| path.as_str()).max_by_key(|path| path.len());
    sheet.set_widths(longest_path.into_iter())?;
    sheet.write_row(["setting", "value"].map(text_cell))?;
    for (path, value) in settings {
        let value = match &value {
            Value::Number(number) => number.as_f64().map_or(Cell::Null, Cell::Number),
            Value::String(text) => text_cell(text),
            other => text_cell(&other.to_string()),
        };
        sheet.write_row([Cell::Text(path), value])?;
    }
    Ok(())
}

/// Collects the values of a plan with their paths. A list of numbers is one value.
fn collect_leaves(plan: &Value, settings: &mut Vec<(String, Value)>) {
    let has_objects = |values: &[Value], _: &[Value]| values.iter().any(Value::is_object);
    visit_leaves([Some(plan); 2], has_objects, &mut Vec::new(), &mut |path, [value, _]| {
        settings.extend(value.map(|value| (dotted_path(path), value.clone())));
    });
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use super::*;
    use crate::sample;

    #[test]
    fn equal_rows_give_equal_workbooks() {
        let first_workbook = encode(&sample::table()).unwrap();
        assert!(first_workbook.starts_with(b"PK\x03\x04"));
        std::thread::sleep(std::time::Duration::from_millis(1100));
        assert_eq!(first_workbook, encode(&sample::table()).unwrap());
    }

    /// Extracts a file of the workbook, which is a ZIP archive. Its data follow the local header.
    fn extract(archive: &[u8], name: &str) -> String {
        let name_offset =
            archive.windows(name.len()).position(|window| window == name.as_bytes()).unwrap();
        let extra_length = u16::from_le_bytes([archive[name_offset - 2], archive[name_offset - 1]]);
        let mut text = String::new();
        let compressed_text = &archive[name_offset + name.len() + usize::from(extra_length)..];
        flate2::read::DeflateDecoder::new(compressed_text).read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn rows_have_a_filter_wide_columns_and_frozen_headings() {
        let sheet_xml = extract(&encode(&sample::table()).unwrap(), "xl/worksheets/sheet1.xml");
        // Two rows of names and units stand above six rows of eleven columns.
        for element in ["<pane ySplit=\"2\"", "state=\"frozen\"", "<autoFilter ref=\"A2:K8\""] {
            assert!(sheet_xml.contains(element), "{element}: {sheet_xml}");
        }
        let read_number = |text: &str, name: &str| -> f64 {
            let (_, rest) = text.split_once(&format!("{name}=\"")).unwrap();
            rest.split('"').next().unwrap().parse().unwrap()
        };
        // Neighbouring columns of equal width share an element.
        let column_width = |column: f64| {
            let mut elements = sheet_xml.split("<col ").skip(1);
            let is_covered = |text: &&str| {
                (read_number(text, "min")..=read_number(text, "max")).contains(&column)
            };
            read_number(elements.find(is_covered).unwrap(), "width")
        };
        assert!(
            column_width(2.0) > 17.0 && column_width(1.0) < column_width(2.0),
            "unbalance_mass_kg needs more than point"
        );
    }

    #[test]
    fn the_plan_is_listed_by_paths() {
        let mut settings = Vec::new();
        collect_leaves(&sample::plan(), &mut settings);
        let paths: Vec<&str> = settings.iter().map(|(path, _)| path.as_str()).collect();
        assert!(paths.contains(&"machine.body.mass_kg"), "{paths:?}");
        assert!(paths.contains(&"axis.1.values"), "{paths:?}");
    }
}

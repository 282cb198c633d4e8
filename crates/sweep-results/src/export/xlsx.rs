//! A workbook of three sheets: the rows, the columns with units and descriptions, the plan. Office
//! Open XML (ECMA-376), with texts in their cells and two styles.

use std::fmt::Write as _;
use std::io;

use serde_json::Value;
use sweep_files::key;

use super::zip::Archive;
use super::{Format, names, no_room};
use crate::error::ResultsError;
use crate::rows::{Cell, ResultTable};

/// Rows of a sheet, less the two of headings.
const MOST_ROWS: u64 = (1 << 20) - 2;
/// Columns of a sheet.
const MOST_COLUMNS: usize = 1 << 14;
/// Characters of a sheet's cell.
const LONGEST: usize = 32_767;

const HEAD: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"yes\"?>\n";
const MAIN: &str = "http://schemas.openxmlformats.org/spreadsheetml/2006/main";
const OFFICE: &str = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";
const PACKAGE: &str = "http://schemas.openxmlformats.org/package/2006";
const PART: &str = "application/vnd.openxmlformats-officedocument.spreadsheetml";

const SHEETS: [&str; 3] = ["rows", "columns", "plan"];

pub(super) fn bytes(table: &ResultTable) -> Result<Vec<u8>, ResultsError> {
    if table.rows() > MOST_ROWS {
        let reason = format!("{} rows, and a sheet has room for {MOST_ROWS}", table.rows());
        return Err(no_room(table, Format::Xlsx, reason));
    }
    if table.columns.len() > MOST_COLUMNS {
        let reason = format!("more than {MOST_COLUMNS} columns");
        return Err(no_room(table, Format::Xlsx, reason));
    }
    let sheets = [rows(table)?, columns(table), plan(table)];
    archive(&sheets).map_err(|error| no_room(table, Format::Xlsx, error.to_string()))
}

/// The parts of a workbook with these sheets.
fn archive(sheets: &[String; 3]) -> io::Result<Vec<u8>> {
    let mut archive = Archive::default();
    let numbered = || (1..).zip(SHEETS);
    let overrides: String = numbered()
        .map(|(k, _): (usize, _)| {
            let name = format!("/xl/worksheets/sheet{k}.xml");
            format!("<Override PartName=\"{name}\" ContentType=\"{PART}.worksheet+xml\"/>")
        })
        .collect();
    let content = format!(
        "{HEAD}<Types xmlns=\"{PACKAGE}/content-types\">\
         <Default Extension=\"rels\" \
         ContentType=\"application/vnd.openxmlformats-package.relationships+xml\"/>\
         <Default Extension=\"xml\" ContentType=\"application/xml\"/>\
         <Override PartName=\"/xl/workbook.xml\" ContentType=\"{PART}.sheet.main+xml\"/>\
         <Override PartName=\"/xl/styles.xml\" ContentType=\"{PART}.styles+xml\"/>\
         {overrides}</Types>"
    );
    archive.add("[Content_Types].xml", content.as_bytes())?;
    let related = |links: &[(String, &str, String)]| {
        let links: String = links
            .iter()
            .map(|(id, kind, target)| {
                format!("<Relationship Id=\"{id}\" Type=\"{OFFICE}/{kind}\" Target=\"{target}\"/>")
            })
            .collect();
        format!("{HEAD}<Relationships xmlns=\"{PACKAGE}/relationships\">{links}</Relationships>")
    };
    let link = |id: usize, kind, target: &str| (format!("r{id}"), kind, target.to_owned());
    let root = related(&[link(1, "officeDocument", "xl/workbook.xml")]);
    archive.add("_rels/.rels", root.as_bytes())?;
    let listed: String = numbered()
        .map(|(k, name): (usize, _)| {
            format!("<sheet name=\"{name}\" sheetId=\"{k}\" r:id=\"r{k}\"/>")
        })
        .collect();
    let workbook = format!(
        "{HEAD}<workbook xmlns=\"{MAIN}\" xmlns:r=\"{OFFICE}\"><sheets>{listed}</sheets></workbook>"
    );
    archive.add("xl/workbook.xml", workbook.as_bytes())?;
    let mut links: Vec<_> = numbered()
        .map(|(k, _)| link(k, "worksheet", &format!("worksheets/sheet{k}.xml")))
        .collect();
    links.push(link(SHEETS.len() + 1, "styles", "styles.xml"));
    archive.add("xl/_rels/workbook.xml.rels", related(&links).as_bytes())?;
    archive.add("xl/styles.xml", styles().as_bytes())?;
    for (k, sheet) in (1..).zip(sheets) {
        let k: usize = k;
        archive.add(&format!("xl/worksheets/sheet{k}.xml"), sheet.as_bytes())?;
    }
    archive.finish()
}

/// Style 0 is plain, 1 bold.
fn styles() -> String {
    let font = |bold: &str| format!("<font>{bold}<sz val=\"11\"/><name val=\"Calibri\"/></font>");
    let style = |font: u8| {
        format!("<xf numFmtId=\"0\" fontId=\"{font}\" fillId=\"0\" borderId=\"0\" xfId=\"0\"/>")
    };
    format!(
        "{HEAD}<styleSheet xmlns=\"{MAIN}\"><fonts count=\"2\">{}{}</fonts>\
         <fills count=\"2\"><fill><patternFill patternType=\"none\"/></fill>\
         <fill><patternFill patternType=\"gray125\"/></fill></fills>\
         <borders count=\"1\"><border/></borders>\
         <cellStyleXfs count=\"1\"><xf/></cellStyleXfs>\
         <cellXfs count=\"2\">{}{}</cellXfs>\
         <cellStyles count=\"1\">\
         <cellStyle name=\"Normal\" xfId=\"0\" builtinId=\"0\"/></cellStyles>\
         </styleSheet>",
        font(""),
        font("<b/>"),
        style(0),
        style(1)
    )
}

/// A sheet in the making.
struct Sheet {
    text: String,
    row: usize,
}

impl Sheet {
    /// With so many rows of headings, which stay in sight.
    fn new(headings: usize) -> Self {
        let text = format!(
            "{HEAD}<worksheet xmlns=\"{MAIN}\"><sheetViews><sheetView workbookViewId=\"0\">\
             <pane ySplit=\"{headings}\" topLeftCell=\"A{}\" activePane=\"bottomLeft\" \
             state=\"frozen\"/></sheetView></sheetViews><sheetData>",
            headings + 1
        );
        Self { text, row: 0 }
    }

    fn row(&mut self, cells: impl IntoIterator<Item = Cell>, bold: bool) {
        self.row += 1;
        // Writing to a String cannot fail.
        let _ = write!(self.text, "<row r=\"{}\">", self.row);
        for (column, cell) in cells.into_iter().enumerate() {
            let style = if bold { " s=\"1\"" } else { "" };
            let place = format!("{}{}", letters(column), self.row);
            let _ = match cell {
                // What is missing has no cell.
                Cell::Null => Ok(()),
                // A sheet has no infinity.
                Cell::Number(number) if number.is_finite() => {
                    write!(self.text, "<c r=\"{place}\"{style}><v>{number:e}</v></c>")
                }
                Cell::Flag(flag) => {
                    let flag = u8::from(flag);
                    write!(self.text, "<c r=\"{place}\"{style} t=\"b\"><v>{flag}</v></c>")
                }
                Cell::Number(number) => self.words(&place, style, &number.to_string()),
                Cell::Text(text) => self.words(&place, style, &text),
            };
        }
        self.text.push_str("</row>");
    }

    fn words(&mut self, place: &str, style: &str, text: &str) -> std::fmt::Result {
        let text = escaped(text);
        write!(
            self.text,
            "<c r=\"{place}\"{style} t=\"inlineStr\">\
             <is><t xml:space=\"preserve\">{text}</t></is></c>"
        )
    }

    fn finish(mut self) -> String {
        self.text.push_str("</sheetData></worksheet>");
        self.text
    }
}

/// A column as sheets count: A to Z, AA, AB, ...
fn letters(column: usize) -> String {
    let mut letters = Vec::new();
    let mut rest = column + 1;
    while rest > 0 {
        rest -= 1;
        // Below 26.
        letters.push(b'A' + (rest % 26) as u8);
        rest /= 26;
    }
    letters.reverse();
    String::from_utf8(letters).unwrap_or_default()
}

/// A text in XML, as long as a cell takes it, without characters that XML has no place for.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars().take(LONGEST) {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '\t' | '\n' => escaped.push(c),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => {
                escaped.push('\u{fffd}');
            }
            c => escaped.push(c),
        }
    }
    escaped
}

fn text(text: &str) -> Cell {
    Cell::Text(text.to_owned())
}

fn rows(table: &ResultTable) -> Result<String, ResultsError> {
    let mut sheet = Sheet::new(2);
    let names = names(table);
    sheet.row(names.iter().map(|name| text(name)), true);
    sheet.row(table.columns.iter().map(|column| text(&column.unit)), false);
    for rows in table.read(&names)? {
        let rows = rows?;
        for row in 0..rows.count {
            sheet.row((0..names.len()).map(|column| rows.cell(column, row)), false);
        }
    }
    Ok(sheet.finish())
}

fn columns(table: &ResultTable) -> String {
    let mut sheet = Sheet::new(1);
    sheet.row(["column", "unit", "description"].map(text), true);
    for column in &table.columns {
        sheet.row([&column.name, &column.unit, &column.description].map(|word| text(word)), false);
    }
    sheet.finish()
}

/// Every number and word of the plan under its path.
fn plan(table: &ResultTable) -> String {
    let mut sheet = Sheet::new(1);
    sheet.row(["setting", "value"].map(text), true);
    let mut leaves = Vec::new();
    for (name, key) in [("version", key::VERSION), ("numerics", key::NUMERICS)] {
        leaves.extend(table.file().value(key).map(|value| (name.to_owned(), value.into())));
    }
    if let Some(plan) = &table.plan {
        collect(plan, &mut String::new(), &mut leaves);
    }
    for (path, value) in leaves {
        let value = match &value {
            Value::Number(number) => number.as_f64().map_or(Cell::Null, Cell::Number),
            Value::String(word) => text(word),
            other => text(&other.to_string()),
        };
        sheet.row([Cell::Text(path), value], false);
    }
    sheet.finish()
}

fn collect(value: &Value, path: &mut String, leaves: &mut Vec<(String, Value)>) {
    let length = path.len();
    let mut step = |name: &str, value: &Value| {
        if !path.is_empty() {
            path.push('.');
        }
        path.push_str(name);
        collect(value, path, leaves);
        path.truncate(length);
    };
    match value {
        Value::Object(map) => map.iter().for_each(|(name, value)| step(name, value)),
        Value::Array(values) if values.iter().any(Value::is_object) => {
            (1..).zip(values).for_each(|(k, value): (usize, _)| step(&k.to_string(), value));
        }
        leaf => leaves.push((path.clone(), leaf.clone())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    #[test]
    fn the_same_rows_give_the_same_workbook() {
        let first = bytes(&sample::table()).unwrap();
        assert!(first.starts_with(b"PK\x03\x04"));
        assert_eq!(first, bytes(&sample::table()).unwrap());
    }

    #[test]
    fn cells_stand_where_they_belong() {
        let sheet = rows(&sample::table()).unwrap();
        assert!(sheet.contains("<row r=\"3\"><c r=\"A3\"><v>0e0</v></c><c r=\"B3\"><v>1e-1</v>"));
        assert!(sheet.contains("<c r=\"H3\" t=\"b\"><v>1</v></c>"), "{sheet}");
        assert!(!sheet.contains("r=\"G6\""), "what is missing has no cell");
        let named = [0, 25, 26, 701, 702].map(letters);
        assert_eq!(named, ["A", "Z", "AA", "ZZ", "AAA"]);
        assert_eq!(escaped("a<b>&\u{1}"), "a&lt;b&gt;&amp;\u{fffd}");
    }

    #[test]
    fn the_plan_is_a_list_of_paths() {
        let mut leaves = Vec::new();
        collect(&sample::plan(), &mut String::new(), &mut leaves);
        let paths: Vec<&str> = leaves.iter().map(|(path, _)| path.as_str()).collect();
        assert!(paths.contains(&"machine.tub.mass_kg"), "{paths:?}");
        assert!(paths.contains(&"axis.1.values"), "{paths:?}");
    }
}

//! `[design]`: points by a rule over the axes' ranges, or listed in a file of their own.

use std::fs::File;
use std::path::Path;

use arrow_array::cast::AsArray;
use arrow_array::types::{
    Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type, UInt16Type, UInt32Type,
    UInt64Type,
};
use arrow_array::{Array, ArrayRef};
use arrow_schema::DataType;
use washer_model::decimal;

use super::machine::beside;
use super::parameters::MOST_POINTS;
use super::report::{Diagnostic, Report};
use super::section::{Field, Section, cut, short};
use super::source::{Located, Location};
use crate::design::Design;
use crate::files::ParquetFile;

/// The methods by name.
pub(super) const METHODS: [&str; 3] = ["latin_hypercube", "sobol", "list"];
/// `seed` when the grid names none.
pub(super) const DEFAULT_SEED: u64 = 0;
/// Greatest seed: what JSON and TOML carry exactly everywhere.
pub(super) const MOST_SEED: u64 = (1 << 53) - 1;
/// Points of Sobol's sequence with 32 bits.
pub(super) const MOST_SOBOL: u64 = 1 << 32;
/// Longest list that is read, in bytes.
const LONGEST_LIST: u64 = 256 << 20;
/// Most columns of a list.
const MOST_COLUMNS: usize = 1000;
/// Most characters of a path in a message.
const LONGEST_PATH: usize = 1000;

/// What `[design]` says.
pub(super) enum Written {
    /// Nothing: a grid.
    None,
    /// Something wrong, already reported.
    Bad,
    /// Points over ranges.
    Box(Located<Design>),
    /// Points as listed.
    List(List),
}

/// A list of points.
pub(super) struct List {
    pub(super) design: Design,
    pub(super) columns: Vec<ListColumn>,
}

/// One parameter's values.
pub(super) struct ListColumn {
    pub(super) name: Located<String>,
    pub(super) values: Vec<f64>,
    /// Where each value stands; empty where the file is no text.
    pub(super) places: Vec<Location>,
}

/// Reads the section, and the file it names.
pub(super) fn read(root: &mut Section<'_>, grid: &Path, report: &mut Report) -> Written {
    let mut section = match root.table("design", "[design]", report) {
        Field::Absent => return Written::None,
        Field::Bad => return Written::Bad,
        Field::Given(section) => section.value,
    };
    let at = section.at().clone();
    let field = section.choice("method", &METHODS, report);
    let expected = "`latin_hypercube`, `sobol` or `list`";
    let Some(method) = section.require(field, "method", expected, report) else { return Written::Bad };
    let written = if METHODS[method.value] == "list" {
        section.misplace(&["points", "seed"], "a list has the points that it lists");
        let field = section.text("file", report);
        let file = section.require(field, "file", "a CSV or Parquet file, relative to this file", report);
        file.and_then(|file| list(&file, grid, report)).map_or(Written::Bad, Written::List)
    } else {
        section.misplace(&["file"], "only the method \"list\" has it");
        let sobol = METHODS[method.value] == "sobol";
        let field = section.count("points", if sobol { MOST_SOBOL } else { MOST_POINTS }, report);
        let points = section.require(field, "points", "the number of points", report);
        let seed = section.whole("seed", 0..=MOST_SEED, report).or(DEFAULT_SEED);
        // Stand-ins for what was refused, so that the axes are read all the same.
        let (points, seed) = (points.map_or(1, |points| points.value), seed.unwrap_or(DEFAULT_SEED));
        let design =
            if sobol { Design::Sobol { points, seed } } else { Design::LatinHypercube { points, seed } };
        Written::Box(Located { value: design, at })
    };
    section.finish(report);
    written
}

/// Reads the listed points.
fn list(file: &Located<&str>, grid: &Path, report: &mut Report) -> Option<List> {
    let path = beside(grid, file.value);
    let shown = cut(&path.display().to_string(), LONGEST_PATH);
    let mut refuse = |reason: String| {
        let title = format!("cannot read the list of points {shown}: {reason}");
        let expected =
            "expected a CSV or Parquet file of numbers, one column a parameter, relative to this file";
        report.push(Diagnostic::new(title).at(&file.at, expected));
        None
    };
    let bytes = match bytes(&path) {
        Ok(bytes) => bytes,
        Err(reason) => return refuse(reason),
    };
    let hash = blake3::hash(&bytes).to_hex().to_string();
    let columns = if bytes.starts_with(b"PAR1") {
        match parquet(&path, &file.at) {
            Ok(columns) => columns,
            Err(reason) => return refuse(reason),
        }
    } else {
        match String::from_utf8(bytes) {
            Ok(text) => csv(&shown, text, report)?,
            Err(error) => {
                let byte = error.utf8_error().valid_up_to() + 1;
                return refuse(format!("it is neither Parquet nor UTF-8 text: byte {byte} is wrong"));
            }
        }
    };
    let points = columns.first().map_or(0, |column| column.values.len());
    if points == 0 {
        let title = format!("the list of points {shown} is empty");
        report.push(
            Diagnostic::new(title)
                .at(&file.at, "expected a line of parameter names, and under it a row of numbers a point"),
        );
        return None;
    }
    let design = Design::List { file: file.value.to_owned(), points: points as u64, hash };
    Some(List { design, columns })
}

fn bytes(path: &Path) -> Result<Vec<u8>, String> {
    use std::io::Read as _;
    let file = File::open(path).map_err(|error| error.to_string())?;
    let mut bytes = Vec::new();
    file.take(LONGEST_LIST + 1).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    if bytes.len() as u64 > LONGEST_LIST {
        return Err(format!("it is longer than {} MiB", LONGEST_LIST >> 20));
    }
    Ok(bytes)
}

/// Comma-separated numbers under a line of names. Lines that are empty or begin with `#` do not count.
fn csv(shown: &str, text: String, report: &mut Report) -> Option<Vec<ListColumn>> {
    let source = report.sources.add(shown, text.as_str());
    let mut columns: Vec<ListColumn> = Vec::new();
    let mut sound = true;
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        let offset = start;
        start += line.len();
        let body = line.trim_end_matches(['\n', '\r']);
        let plain = if offset == 0 { body.trim_start_matches('\u{feff}') } else { body };
        if plain.trim().is_empty() || plain.trim_start().starts_with('#') {
            continue;
        }
        let cells = cells(plain, offset + body.len() - plain.len());
        if columns.is_empty() {
            if cells.len() > MOST_COLUMNS {
                let at = Location::new(source, offset..offset + body.len());
                let title = format!("the list of points has {} columns", cells.len());
                report.push(Diagnostic::new(title).at(&at, format!("expected at most {MOST_COLUMNS}")));
                return None;
            }
            columns = cells
                .into_iter()
                .map(|(cell, at)| ListColumn {
                    name: Located { value: cell.to_owned(), at: Location::new(source, at) },
                    values: Vec::new(),
                    places: Vec::new(),
                })
                .collect();
            continue;
        }
        if cells.len() != columns.len() {
            sound = false;
            report.push_with(|_| {
                let at = Location::new(source, offset..offset + body.len());
                let count =
                    |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
                let (numbers, names) = (count(cells.len(), "number"), count(columns.len(), "name"));
                let title = format!("a row of {numbers} under {names}");
                let expected = count(columns.len(), "number");
                Diagnostic::new(title).at(&at, format!("expected {expected}, separated by commas"))
            });
            continue;
        }
        for ((cell, at), column) in cells.into_iter().zip(&mut columns) {
            let at = Location::new(source, at);
            match cell.parse::<f64>() {
                Ok(value) => {
                    column.values.push(value);
                    column.places.push(at);
                }
                Err(_) => {
                    sound = false;
                    report.push_with(|_| {
                        let title = format!("`{}` is not a number", short(cell));
                        Diagnostic::new(title).at(&at, "expected a number such as 0.25, 80 or 1e7")
                    });
                }
            }
        }
    }
    sound.then_some(columns)
}

/// The cells of a line without white space and quotation marks, and where they stand.
fn cells(line: &str, offset: usize) -> Vec<(&str, std::ops::Range<usize>)> {
    let mut start = offset;
    line.split(',')
        .map(|cell| {
            let from = start;
            start += cell.len() + 1;
            let trimmed = cell.trim();
            let from = from + (cell.len() - cell.trim_start().len());
            let quoted = trimmed.len() >= 2 && trimmed.starts_with('"') && trimmed.ends_with('"');
            let inner = if quoted { &trimmed[1..trimmed.len() - 1] } else { trimmed };
            (inner, from..from + trimmed.len())
        })
        .collect()
}

/// Columns of numbers.
fn parquet(path: &Path, at: &Location) -> Result<Vec<ListColumn>, String> {
    let file = ParquetFile::open(path).map_err(|error| error.reason())?;
    let fields = file.schema().fields().clone();
    if fields.len() > MOST_COLUMNS {
        return Err(format!("it has {} columns, more than {MOST_COLUMNS}", fields.len()));
    }
    if let Some(field) = fields.iter().find(|field| !field.data_type().is_numeric()) {
        return Err(format!(
            "its column `{}` holds no numbers but {}",
            short(field.name()),
            field.data_type()
        ));
    }
    let column = |name: &String| ListColumn {
        name: Located { value: name.clone(), at: at.clone() },
        values: Vec::new(),
        places: Vec::new(),
    };
    let mut columns: Vec<ListColumn> = fields.iter().map(|field| column(field.name())).collect();
    for batch in file.batches(|builder| builder).map_err(|error| error.reason())? {
        let batch = batch.map_err(|error| error.reason())?;
        for (column, array) in columns.iter_mut().zip(batch.columns()) {
            column.values.extend(numbers(array, &column.name.value, column.values.len())?);
        }
    }
    Ok(columns)
}

fn numbers(array: &ArrayRef, name: &str, before: usize) -> Result<Vec<f64>, String> {
    if let Some(row) = (0..array.len()).find(|row| array.is_null(*row)) {
        return Err(format!(
            "its column `{}` has no value in row {}",
            short(name),
            decimal((before + row + 1) as f64)
        ));
    }
    macro_rules! widened {
        ($type:ty) => {
            array.as_primitive::<$type>().values().iter().map(|&value| f64::from(value)).collect()
        };
    }
    // 64-bit integers beyond 2^53 are rounded; no parameter is that long a number.
    macro_rules! rounded {
        ($type:ty) => {
            array.as_primitive::<$type>().values().iter().map(|&value| value as f64).collect()
        };
    }
    Ok(match array.data_type() {
        DataType::Float64 => array.as_primitive::<Float64Type>().values().to_vec(),
        DataType::Float32 => widened!(Float32Type),
        DataType::Int8 => widened!(Int8Type),
        DataType::Int16 => widened!(Int16Type),
        DataType::Int32 => widened!(Int32Type),
        DataType::UInt8 => widened!(UInt8Type),
        DataType::UInt16 => widened!(UInt16Type),
        DataType::UInt32 => widened!(UInt32Type),
        DataType::Int64 => rounded!(Int64Type),
        DataType::UInt64 => rounded!(UInt64Type),
        other => {
            let name = short(name);
            return Err(format!(
                "its column `{name}` holds numbers of the type {other}; write it as float64"
            ));
        }
    })
}

//! NetCDF classic with 64-bit offsets ("CDF-2"), after the NetCDF Classic Format Specification:
//! everything big-endian, every name and value padded to four bytes. `xarray`, `ncdump`, MATLAB and
//! Octave read it.
//!
//! The rows of a whole grid become variables over its axes, with coordinate variables; other rows
//! are variables over `row`. Words and truth values are bytes with the CF conventions'
//! `flag_values` and `flag_meanings`.

use sweep_files::key;

use super::{Format, names, no_room};
use crate::error::ResultsError;
use crate::rows::{Cell, CellKind, Column, ResultTable};

const DIMENSIONS: u32 = 0x0A;
const VARIABLES: u32 = 0x0B;
const ATTRIBUTES: u32 = 0x0C;
const BYTE: u32 = 1;
const CHAR: u32 = 2;
const DOUBLE: u32 = 6;

/// A byte without a meaning.
const MISSING: i8 = -1;
/// Most words of a column: what fits a byte.
const MOST_WORDS: usize = 127;
/// A variable's length and a dimension's are signed.
const MOST_BYTES: u64 = (1 << 31) - 4;

/// The values of a variable.
enum Values {
    Numbers(Vec<f64>),
    Codes { words: Vec<String>, codes: Vec<i8> },
}

impl Values {
    fn bytes(&self) -> u64 {
        match self {
            Self::Numbers(numbers) => 8 * numbers.len() as u64,
            Self::Codes { codes, .. } => (codes.len() as u64).next_multiple_of(4),
        }
    }
}

/// A variable: its name, unit and description, its dimensions by number, its values.
struct Variable<'a> {
    name: &'a str,
    unit: &'a str,
    description: &'a str,
    dimensions: Vec<u32>,
    values: Values,
}

pub(super) fn bytes(table: &ResultTable) -> Result<Vec<u8>, ResultsError> {
    let mut columns = Vec::new();
    for column in &table.columns {
        columns.push((column, Values::empty(column.kind)));
    }
    let names = names(table);
    let mut rows_read = 0;
    for rows in table.read(&names)? {
        let rows = rows?;
        for row in 0..rows.count {
            for (place, (column, values)) in columns.iter_mut().enumerate() {
                if !values.push(rows.cell(place, row)) {
                    let reason = format!("`{}` has more than {MOST_WORDS} words", column.name);
                    return Err(no_room(table, Format::NetCdf, reason));
                }
            }
        }
        rows_read += rows.count;
    }
    if let Some((column, _)) = columns.iter().find(|(_, values)| values.bytes() > MOST_BYTES) {
        let reason = format!("`{}` takes more than 2 GB", column.name);
        return Err(no_room(table, Format::NetCdf, reason));
    }
    let grid = grid(table, &columns, rows_read);
    let (dimensions, variables) = laid_out(&columns, grid, rows_read);
    let global = [
        ("Conventions", "CF-1.8"),
        ("title", "exported by sweep"),
        ("sweep_version", table.file().value(key::VERSION).unwrap_or_default()),
        ("sweep_plan", table.file().value(key::PLAN).unwrap_or_default()),
    ];
    Ok(written(&dimensions, &global, &variables))
}

impl Values {
    fn empty(kind: CellKind) -> Self {
        let words = match kind {
            CellKind::Number => return Self::Numbers(Vec::new()),
            CellKind::Flag => vec!["false".to_owned(), "true".to_owned()],
            CellKind::Text => Vec::new(),
        };
        Self::Codes { words, codes: Vec::new() }
    }

    /// Adds a cell; says whether there was room for its word.
    fn push(&mut self, cell: Cell) -> bool {
        match (self, cell) {
            (Self::Numbers(numbers), cell) => numbers.push(cell.number().unwrap_or(f64::NAN)),
            (Self::Codes { codes, .. }, Cell::Flag(flag)) => codes.push(i8::from(flag)),
            (Self::Codes { words, codes }, Cell::Text(text)) => {
                let known = words.iter().position(|word| *word == text);
                let place = known.unwrap_or_else(|| {
                    words.push(text);
                    words.len() - 1
                });
                if place >= MOST_WORDS {
                    return false;
                }
                codes.push(i8::try_from(place).unwrap_or(MISSING));
            }
            (Self::Codes { codes, .. }, _) => codes.push(MISSING),
        }
        true
    }
}

type Filled<'a> = (&'a Column, Values);

/// The axes' values, if the rows are all points of their grid in order: the first varies slowest.
fn grid<'a>(
    table: &'a ResultTable,
    columns: &[Filled<'_>],
    rows: usize,
) -> Option<Vec<(&'a str, Vec<f64>)>> {
    let mut axes = Vec::new();
    for name in table.axes() {
        let (_, values) = columns.iter().find(|(column, _)| column.name == name)?;
        let Values::Numbers(values) = values else { return None };
        axes.push((name, values));
    }
    let mut grid: Vec<(&str, Vec<f64>)> = Vec::new();
    // From the last axis on: it goes through its values before any other changes.
    let mut inner = 1;
    for (name, values) in axes.iter().rev() {
        let mut own = Vec::new();
        let mut at = 0;
        while at < rows && !own.contains(values.get(at)?) {
            own.push(values[at]);
            at += inner;
        }
        inner = inner.checked_mul(own.len())?;
        grid.insert(0, (name, own));
    }
    if inner != rows || grid.is_empty() {
        return None;
    }
    let mut every = 1;
    for ((_, values), (_, own)) in axes.iter().zip(&grid).rev() {
        let fits = |row: usize| values[row] == own[row / every % own.len()];
        if !(0..rows).all(fits) {
            return None;
        }
        every *= own.len();
    }
    Some(grid)
}

/// Dimensions with their lengths, and the variables over them.
fn laid_out<'a>(
    columns: &'a [Filled<'a>],
    grid: Option<Vec<(&'a str, Vec<f64>)>>,
    rows: usize,
) -> (Vec<(String, u32)>, Vec<Variable<'a>>) {
    let length = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
    let mut variables = Vec::new();
    let mut dimensions = Vec::new();
    for (number, (name, values)) in grid.iter().flatten().enumerate() {
        dimensions.push(((*name).to_owned(), length(values.len())));
        if let Some((column, _)) = columns.iter().find(|(column, _)| column.name == *name) {
            let number = length(number);
            variables.push(variable(column, vec![number], Values::Numbers(values.clone())));
        }
    }
    if grid.is_none() {
        dimensions.push(("row".to_owned(), length(rows)));
    }
    let all: Vec<u32> = (0..length(dimensions.len())).collect();
    let is_axis = |name: &str| grid.iter().flatten().any(|(axis, _)| *axis == name);
    for (column, values) in columns.iter().filter(|(column, _)| !is_axis(&column.name)) {
        let values = match values {
            Values::Numbers(numbers) => Values::Numbers(numbers.clone()),
            Values::Codes { words, codes } => {
                Values::Codes { words: words.clone(), codes: codes.clone() }
            }
        };
        variables.push(variable(column, all.clone(), values));
    }
    (dimensions, variables)
}

fn variable<'a>(column: &'a Column, dimensions: Vec<u32>, values: Values) -> Variable<'a> {
    let Column { name, unit, description, .. } = column;
    Variable { name, unit, description, dimensions, values }
}

/// Bytes in the format's terms.
#[derive(Default)]
struct Writer(Vec<u8>);

impl Writer {
    fn word(&mut self, value: u32) {
        self.0.extend(value.to_be_bytes());
    }

    fn pad(&mut self, with: u8) {
        self.0.resize(self.0.len().next_multiple_of(4), with);
    }

    fn length(&mut self, count: usize) {
        self.word(u32::try_from(count).unwrap_or(u32::MAX));
    }

    fn text(&mut self, text: &str) {
        self.length(text.len());
        self.0.extend(text.as_bytes());
        self.pad(0);
    }

    fn attribute(&mut self, name: &str, text: &str) {
        self.text(name);
        self.word(CHAR);
        self.text(text);
    }

    /// The head of a list; an empty one has no tag.
    fn list(&mut self, tag: u32, count: usize) {
        self.word(if count == 0 { 0 } else { tag });
        self.length(count);
    }
}

fn written(
    dimensions: &[(String, u32)],
    global: &[(&str, &str)],
    variables: &[Variable<'_>],
) -> Vec<u8> {
    // The offsets take as many bytes whatever they are, so a first go tells where values begin.
    let header = header(dimensions, global, variables, 0);
    let mut bytes = Writer(self::header(dimensions, global, variables, header.len() as u64));
    for variable in variables {
        match &variable.values {
            Values::Numbers(numbers) => {
                numbers.iter().for_each(|number| bytes.0.extend(number.to_be_bytes()));
            }
            Values::Codes { codes, .. } => {
                bytes.0.extend(codes.iter().map(|code| code.to_be_bytes()[0]));
                bytes.pad(MISSING.to_be_bytes()[0]);
            }
        }
    }
    bytes.0
}

fn header(
    dimensions: &[(String, u32)],
    global: &[(&str, &str)],
    variables: &[Variable<'_>],
    mut offset: u64,
) -> Vec<u8> {
    let mut header = Writer(b"CDF\x02".to_vec());
    header.word(0); // No record dimension.
    header.list(DIMENSIONS, dimensions.len());
    for (name, length) in dimensions {
        header.text(name);
        header.word(*length);
    }
    header.list(ATTRIBUTES, global.len());
    for (name, text) in global {
        header.attribute(name, text);
    }
    header.list(VARIABLES, variables.len());
    for variable in variables {
        header.text(variable.name);
        header.length(variable.dimensions.len());
        variable.dimensions.iter().for_each(|dimension| header.word(*dimension));
        let unit = if variable.unit.is_empty() { "1" } else { variable.unit };
        match &variable.values {
            Values::Numbers(_) => {
                header.list(ATTRIBUTES, 3);
                header.attribute("units", unit);
                header.attribute("long_name", variable.description);
                header.text("_FillValue");
                header.word(DOUBLE);
                header.word(1);
                header.0.extend(f64::NAN.to_be_bytes());
                header.word(DOUBLE);
            }
            Values::Codes { words, .. } => {
                header.list(ATTRIBUTES, if words.is_empty() { 2 } else { 4 });
                header.attribute("long_name", variable.description);
                header.text("_FillValue");
                header.word(BYTE);
                header.word(1);
                header.0.extend(MISSING.to_be_bytes());
                header.pad(0);
                if !words.is_empty() {
                    header.text("flag_values");
                    header.word(BYTE);
                    header.length(words.len());
                    header.0.extend((0..words.len()).map(|code| code as u8));
                    header.pad(0);
                    let meanings: Vec<String> =
                        words.iter().map(|word| word.replace(char::is_whitespace, "_")).collect();
                    header.attribute("flag_meanings", &meanings.join(" "));
                }
                header.word(BYTE);
            }
        }
        let bytes = variable.values.bytes();
        header.word(u32::try_from(bytes).unwrap_or(u32::MAX));
        header.0.extend(offset.to_be_bytes());
        offset += bytes;
    }
    header.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    /// A reader of what the specification says, no more than the tests need.
    struct Reader<'a>(&'a [u8]);

    impl Reader<'_> {
        fn take(&mut self, count: usize) -> Vec<u8> {
            let (taken, rest) = self.0.split_at(count);
            self.0 = rest;
            taken.to_vec()
        }
        fn word(&mut self) -> u32 {
            u32::from_be_bytes(self.take(4).try_into().unwrap())
        }
        fn text(&mut self) -> String {
            let length = self.word() as usize;
            let text = self.take(length.next_multiple_of(4));
            String::from_utf8(text[..length].to_vec()).unwrap()
        }
        fn attributes(&mut self) -> Vec<(String, Vec<u8>)> {
            let (tag, count) = (self.word(), self.word());
            assert!(tag == ATTRIBUTES || (tag, count) == (0, 0));
            (0..count)
                .map(|_| {
                    let (name, kind, count) = (self.text(), self.word(), self.word() as usize);
                    let width = if kind == DOUBLE { 8 } else { 1 };
                    let value = self.take((count * width).next_multiple_of(4));
                    (name, value[..count * width].to_vec())
                })
                .collect()
        }
    }

    fn variables(bytes: &[u8]) -> (Vec<(String, u32)>, Vec<(String, Vec<u32>, Vec<u8>)>) {
        let mut reader = Reader(bytes);
        assert_eq!(reader.take(4), b"CDF\x02");
        assert_eq!([reader.word(), reader.word()], [0, DIMENSIONS]);
        let dimensions = (0..reader.word()).map(|_| (reader.text(), reader.word())).collect();
        let global = reader.attributes();
        assert!(global.iter().any(|(name, value)| name == "Conventions" && value == b"CF-1.8"));
        assert_eq!(reader.word(), VARIABLES);
        let variables = (0..reader.word())
            .map(|_| {
                let name = reader.text();
                let over = (0..reader.word()).map(|_| reader.word()).collect();
                let attributes = reader.attributes();
                assert!(attributes.iter().any(|(name, _)| name == "long_name"));
                let (kind, size) = (reader.word(), reader.word() as usize);
                let at = u64::from_be_bytes(reader.take(8).try_into().unwrap()) as usize;
                assert!(kind == DOUBLE || kind == BYTE);
                (name, over, bytes[at..at + size].to_vec())
            })
            .collect();
        (dimensions, variables)
    }

    #[test]
    fn a_grid_is_laid_out_over_its_axes() {
        let bytes = bytes(&sample::table()).unwrap();
        let (dimensions, variables) = variables(&bytes);
        let own = |name: &str, length| (name.to_owned(), length);
        assert_eq!(dimensions, [own("unbalance_mass_kg", 2), own("damping_n_s_per_m", 3)]);
        let find = |name: &str| variables.iter().find(|(known, ..)| known == name).unwrap();
        let numbers = |name: &str| -> Vec<f64> {
            let numbers = find(name).2.chunks(8);
            numbers.map(|bytes| f64::from_be_bytes(bytes.try_into().unwrap())).collect()
        };
        assert_eq!(numbers("damping_n_s_per_m"), [60.0, 70.0, 80.0]);
        assert_eq!(find("damping_n_s_per_m").1, [1]);
        assert_eq!(find("ratio_max").1, [0, 1]);
        let ratios = numbers("ratio_max");
        assert_eq!(ratios[..3], [1.0, 1.5, 2.5]);
        assert!(ratios[3].is_nan());
        assert_eq!(find("reliable").2, [1, 1, 0, 255, 0, 1, 255, 255]);
        assert_eq!(find("status").2[..6], [0, 0, 0, 1, 0, 0]);
        let (_, _, last) = variables.last().unwrap();
        assert!(bytes.ends_with(last), "nothing stands behind the last variable");
    }

    #[test]
    fn rows_that_are_no_grid_are_over_rows() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("x.parquet");
        sample::write(&path, sample::map(&sample::RATIOS[..5]), &[(key::PLAN, sample::plan())]);
        let table = ResultTable::open(&path).unwrap();
        let (dimensions, variables) = variables(&bytes(&table).unwrap());
        assert_eq!(dimensions, [("row".to_owned(), 5)]);
        assert!(
            variables.iter().any(|(name, over, _)| name == "damping_n_s_per_m" && over == &[0])
        );
    }
}

//! One of this program's Parquet files: its columns as typed vectors, what they mean, and where they came from.

use std::path::{Path, PathBuf};

use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::{ArrowError, DataType, Field};
use serde_json::Value;

use super::error::PlotError;
use super::label;
use crate::cells;
use crate::files::{FileError, ParquetFile};

/// What a file holds, told by its columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One row per grid point.
    Map,
    /// Time histories of both models at one point.
    Trace,
    /// Modes over spin speed.
    Modes,
    /// The curve on which the ratio is at its limit.
    Boundary,
}

impl Kind {
    /// As in "a map file".
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Map => "map",
            Self::Trace => "trace",
            Self::Modes => "modes",
            Self::Boundary => "boundary",
        }
    }
}

/// The values of a column.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Any numeric type; null is NaN.
    Number(Vec<f64>),
    /// Truth values.
    Flag(Vec<Option<bool>>),
    /// Text, plain or dictionary coded.
    Text(Vec<Option<String>>),
}

/// A column.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// As in the file.
    pub name: String,
    /// As the file's field metadata says, or else as the name's suffix does; empty for pure numbers.
    pub unit: String,
    /// As the file's field metadata says; may be empty.
    pub description: String,
    /// One per row.
    pub values: Values,
}

/// A whole file.
#[derive(Clone, Debug)]
pub struct Table {
    /// Where it was read.
    pub path: PathBuf,
    /// What it holds.
    pub kind: Kind,
    /// In file order.
    pub columns: Vec<Column>,
    /// The file-level key-value metadata, parsed where it is JSON; in file order.
    pub provenance: Vec<(String, Value)>,
    /// Number of rows.
    pub rows: usize,
}

/// Key under which Arrow keeps its own copy of the schema: no provenance.
const ARROW_SCHEMA: &str = "ARROW:schema";

impl Table {
    /// Reads a file whole.
    ///
    /// # Errors
    /// [`PlotError::File`], or [`PlotError::UnknownKind`] when the columns are not those of
    /// a file of ours.
    pub fn open(path: &Path) -> Result<Self, PlotError> {
        let file = ParquetFile::open(path)?;
        let damaged =
            |error: ArrowError| FileError::NotParquet { path: path.to_owned(), reason: error.to_string() };
        let provenance = file
            .pairs()
            .filter(|entry| entry.key != ARROW_SCHEMA)
            .map(|entry| {
                let text = entry.value.clone().unwrap_or_default();
                (entry.key.clone(), serde_json::from_str(&text).unwrap_or(Value::String(text)))
            })
            .collect();
        let schema = file.schema().clone();
        let batches = file.batches(|builder| builder)?.collect::<Result<Vec<RecordBatch>, _>>()?;

        let mut columns = Vec::with_capacity(schema.fields().len());
        for (index, field) in schema.fields().iter().enumerate() {
            let parts: Vec<&ArrayRef> = batches.iter().map(|batch| batch.column(index)).collect();
            if let Some(values) = values(field.data_type(), &parts).map_err(damaged)? {
                columns.push(column(field, values));
            }
        }
        let rows = batches.iter().map(RecordBatch::num_rows).sum();
        let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
        let kind = recognise(&names)
            .ok_or_else(|| PlotError::UnknownKind { path: path.to_owned(), columns: names.join(", ") })?;
        Ok(Self { path: path.to_owned(), kind, columns, provenance, rows })
    }

    /// The column of that name.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }

    /// The numbers of a column that this kind of file must have.
    ///
    /// # Errors
    /// [`PlotError::Column`].
    pub fn numbers(&self, name: &str) -> Result<&[f64], PlotError> {
        self.column(name).and_then(Column::numbers).ok_or_else(|| self.lacks(name, "numeric"))
    }

    fn lacks(&self, column: &str, expected: &'static str) -> PlotError {
        PlotError::Column {
            path: self.path.clone(),
            kind: self.kind.name(),
            expected,
            column: column.to_owned(),
        }
    }

    /// Columns of numbers whose name starts with `prefix`, without it.
    #[must_use]
    pub fn with_prefix(&self, prefix: &str) -> Vec<(&str, &Column)> {
        self.columns
            .iter()
            .filter(|column| column.numbers().is_some())
            .filter_map(|column| Some((column.name.strip_prefix(prefix)?, column)))
            .collect()
    }

    /// The first value stored under `key` in the provenance, outer levels before inner ones.
    #[must_use]
    pub fn find(&self, key: &str) -> Option<&Value> {
        self.provenance
            .iter()
            .find_map(|(name, value)| if name == key { Some(value) } else { find(value, key) })
    }

    /// Name of the run, if the file says it.
    #[must_use]
    pub fn run_name(&self) -> Option<&str> {
        self.find("name").and_then(Value::as_str)
    }

    /// How each row's point ended; `unknown` where the file does not say.
    pub fn statuses(&self) -> impl Iterator<Item = &str> {
        let texts = self.column("status").and_then(Column::texts).unwrap_or_default();
        texts.iter().map(|text| text.as_deref().unwrap_or("unknown"))
    }

    /// What its ratios are ratios of, by the criterion that the run was told.
    #[must_use]
    pub fn compared(&self) -> &'static str {
        match self.find("criterion").and_then(Value::as_str) {
            Some("envelope") => "amplitudes by turn",
            Some("rms") => "root mean squares",
            _ => "amplitudes",
        }
    }

    /// The ratio from which on a point is unreliable: as the run was told, or else 2 as in the paper.
    #[must_use]
    pub fn ratio_limit(&self) -> f64 {
        self.find("ratio_limit").and_then(Value::as_f64).filter(|limit| *limit > 0.0).unwrap_or(2.0)
    }
}

impl Column {
    /// The values, if they are numbers.
    #[must_use]
    pub fn numbers(&self) -> Option<&[f64]> {
        match &self.values {
            Values::Number(values) => Some(values),
            Values::Flag(_) | Values::Text(_) => None,
        }
    }

    /// The values, if they are text.
    #[must_use]
    pub fn texts(&self) -> Option<&[Option<String>]> {
        match &self.values {
            Values::Text(values) => Some(values),
            Values::Flag(_) | Values::Number(_) => None,
        }
    }
}

fn find<'a>(value: &'a Value, key: &str) -> Option<&'a Value> {
    match value {
        Value::Object(map) => map.get(key).or_else(|| map.values().find_map(|inner| find(inner, key))),
        Value::Array(items) => items.iter().find_map(|inner| find(inner, key)),
        _ => None,
    }
}

fn recognise(names: &[&str]) -> Option<Kind> {
    let has = |name: &str| names.contains(&name);
    if has("status") && has("ratio_max") {
        Some(Kind::Map)
    } else if has("time_s") && names.iter().any(|name| name.starts_with("nonlinear_")) {
        Some(Kind::Trace)
    } else if has("mode") && has("frequency_rpm") && has("speed_rpm") {
        Some(Kind::Modes)
    } else if bracket(names).is_some() {
        Some(Kind::Boundary)
    } else {
        None
    }
}

/// The two columns between which a boundary is known to lie, after its two coordinates.
pub(crate) fn bracket<'a>(names: &[&'a str]) -> Option<(&'a str, &'a str)> {
    let with_word = |words: &[&str]| {
        names.iter().skip(2).copied().find(|name| name.split('_').any(|part| words.contains(&part)))
    };
    Some((with_word(&["low", "lower", "min"])?, with_word(&["high", "upper", "max"])?))
}

fn column(field: &Field, values: Values) -> Column {
    let told = |key: &str| field.metadata().get(key).filter(|text| !text.is_empty()).cloned();
    let unit = told("unit").unwrap_or_else(|| label::unit_of_name(field.name()).to_owned());
    Column {
        name: field.name().clone(),
        // A pure number's unit is 1, which no label should say.
        unit: if unit == "1" { String::new() } else { unit },
        description: told("description").unwrap_or_default(),
        values,
    }
}

/// A column's values from its batches; `None` for types that none of our files has.
fn values(data_type: &DataType, parts: &[&ArrayRef]) -> Result<Option<Values>, ArrowError> {
    Ok(match data_type {
        DataType::Boolean => {
            let mut flags = Vec::new();
            for part in parts {
                flags.extend(cells::flags(part)?);
            }
            Some(Values::Flag(flags))
        }
        text if cells::is_text(text) => {
            let mut texts = Vec::new();
            for part in parts {
                texts.extend(cells::texts(part)?.into_iter().map(|text| text.map(str::to_owned)));
            }
            Some(Values::Text(texts))
        }
        number if cells::is_number(number) => {
            let mut numbers = Vec::new();
            for part in parts {
                numbers.extend(cells::numbers(part)?.into_iter().map(|value| value.unwrap_or(f64::NAN)));
            }
            Some(Values::Number(numbers))
        }
        _ => None,
    })
}

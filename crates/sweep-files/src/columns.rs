//! The columns of a file: what each says of itself.

use arrow_schema::{DataType, Field, Schema};
use sweep_parameter::Worse;

use crate::{cells, key};

/// What the cells of a column are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellKind {
    /// Integers or floats.
    Number,
    /// Words.
    Text,
    /// True or false.
    Flag,
}

impl CellKind {
    /// In a sentence: "a number".
    pub const fn name(self) -> &'static str {
        match self {
            Self::Number => "a number",
            Self::Text => "a text",
            Self::Flag => "true or false",
        }
    }
}

/// A column, without its rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// As in the file.
    pub name: String,
    /// From the field's metadata; empty for pure numbers and words.
    pub unit: String,
    /// From the field's metadata; may be empty.
    pub description: String,
    /// What its cells are.
    pub kind: CellKind,
    /// Whether the file keeps it as whole numbers.
    pub whole: bool,
    /// Which way it is bad, if the file says so.
    pub worse: Option<Worse>,
    /// Up to where it is good, if the file says so.
    pub limit: Option<f64>,
    /// Its place among the fields.
    pub field: usize,
}

impl Column {
    /// Whether its cells are numbers.
    pub fn is_number(&self) -> bool {
        self.kind == CellKind::Number
    }
}

/// The columns of rows, without those of types that none of our files has.
pub fn columns(schema: &Schema) -> Vec<Column> {
    let fields = schema.fields().iter().enumerate();
    fields.filter_map(|(place, field)| column(field, place)).collect()
}

fn column(field: &Field, place: usize) -> Option<Column> {
    let kind = match field.data_type() {
        DataType::Boolean => CellKind::Flag,
        text if cells::is_text(text) => CellKind::Text,
        number if cells::is_number(number) => CellKind::Number,
        _ => return None,
    };
    let told = |key: &str| field.metadata().get(key).cloned().unwrap_or_default();
    let unit = told("unit");
    Some(Column {
        name: field.name().clone(),
        unit: if unit == "1" { String::new() } else { unit },
        description: told("description"),
        kind,
        whole: field.data_type().is_integer(),
        worse: Worse::named(&told(key::WORSE)),
        limit: told(key::LIMIT).parse().ok(),
        field: place,
    })
}

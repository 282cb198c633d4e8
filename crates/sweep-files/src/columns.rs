//! The columns of a file and their metadata.

use arrow_schema::{DataType, Field, Schema};
use sweep_parameter::Worse;

use crate::{cells, key};

/// The kind of a column's cells.
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
    /// Returns the kind's name with its article, as in "a number".
    pub const fn name(self) -> &'static str {
        match self {
            Self::Number => "a number",
            Self::Text => "a text",
            Self::Flag => "true or false",
        }
    }
}

/// The description of a column.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// The name in the file.
    pub name: String,
    /// The unit, from the field's metadata; empty for pure numbers and words.
    pub unit: String,
    /// The description, from the field's metadata; may be empty.
    pub description: String,
    /// The kind of the cells.
    pub kind: CellKind,
    /// Whether the column's type in the file is an integer.
    pub whole: bool,
    /// The direction in which values of the column get worse, if the file's metadata has one.
    pub worse: Option<Worse>,
    /// The limit between good and bad values, if the file's metadata has one.
    pub limit: Option<f64>,
    /// Whether summaries of the file report the column's worst value.
    pub is_in_summary: bool,
    /// The index among the fields of the schema.
    pub field: usize,
}

impl Column {
    /// Whether the column's cells are numbers.
    pub fn is_number(&self) -> bool {
        self.kind == CellKind::Number
    }
}

/// Returns the columns of a schema that have a supported type.
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
    let metadata = |key: &str| field.metadata().get(key).cloned().unwrap_or_default();
    let unit = metadata("unit");
    Some(Column {
        name: field.name().clone(),
        unit: if unit == "1" { String::new() } else { unit },
        description: metadata("description"),
        kind,
        whole: field.data_type().is_integer(),
        worse: Worse::named(&metadata(key::WORSE)),
        limit: metadata(key::LIMIT).parse().ok(),
        is_in_summary: metadata(key::SUMMARY) == "true",
        field: place,
    })
}

//! The columns of a file and their metadata.

use std::collections::HashMap;

use arrow_schema::{DataType, Field, Schema};
use serde_json::Value;
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

/// A column of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// The name in the file.
    pub name: String,
    /// The metadata of the column's field; each part is empty where the file has none.
    pub metadata: ColumnMetadata,
    /// The kind of the cells.
    pub kind: CellKind,
    /// Whether the column's type in the file is an integer.
    pub whole: bool,
    /// The index among the fields of the schema.
    pub field: usize,
}

impl Column {
    /// Returns whether the column's cells are numbers.
    pub fn is_number(&self) -> bool {
        self.kind == CellKind::Number
    }

    /// Returns the unit to show: empty for pure numbers and words.
    pub fn unit(&self) -> &str {
        self.metadata.shown_unit()
    }
}

/// The metadata of a column, which the field of a file carries as pairs of texts. Columns that are
/// declared to be written and columns that are read have it in common.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ColumnMetadata {
    /// The unit as the file has it: `1` for pure numbers, empty for words.
    pub unit: String,
    /// The description, in one line.
    pub description: String,
    /// The direction in which values get worse, if there is one.
    pub worse: Option<Worse>,
    /// The limit between good and bad values, if there is one.
    pub limit: Option<f64>,
    /// Whether summaries of the file report the column's worst value.
    pub is_in_summary: bool,
}

/// The key of a field's unit.
const UNIT_KEY: &str = "unit";
/// The key of a field's description.
const DESCRIPTION_KEY: &str = "description";

impl ColumnMetadata {
    /// Returns the unit to show: empty for pure numbers and words.
    pub fn shown_unit(&self) -> &str {
        if self.unit == "1" { "" } else { &self.unit }
    }

    /// Returns the pairs that a field carries.
    pub fn to_pairs(&self) -> HashMap<String, String> {
        let worse = self.worse.map(|worse| (key::WORSE, worse.name().to_owned()));
        let limit = self.limit.map(|limit| (key::LIMIT, Value::from(limit).to_string()));
        let summary = self.is_in_summary.then(|| (key::SUMMARY, true.to_string()));
        let mut pairs =
            vec![(UNIT_KEY, self.unit.clone()), (DESCRIPTION_KEY, self.description.clone())];
        pairs.extend([worse, limit, summary].into_iter().flatten());
        pairs.into_iter().map(|(key, text)| (key.to_owned(), text)).collect()
    }

    /// Reads the pairs of a field. A missing pair is an empty text, and an unknown word of another
    /// program is left out.
    pub fn from_field(field: &Field) -> Self {
        let text = |key: &str| field.metadata().get(key).cloned().unwrap_or_default();
        Self {
            unit: text(UNIT_KEY),
            description: text(DESCRIPTION_KEY),
            worse: Worse::named(&text(key::WORSE)),
            limit: text(key::LIMIT).parse().ok(),
            is_in_summary: text(key::SUMMARY) == true.to_string(),
        }
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
    Some(Column {
        name: field.name().clone(),
        metadata: ColumnMetadata::from_field(field),
        kind,
        whole: field.data_type().is_integer(),
        field: place,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_that_is_written_is_read_again() {
        let full_metadata = ColumnMetadata {
            unit: "N s/m".to_owned(),
            description: "damping".to_owned(),
            worse: Some(Worse::Less),
            limit: Some(0.1),
            is_in_summary: true,
        };
        let plain_metadata = ColumnMetadata { unit: "1".to_owned(), ..ColumnMetadata::default() };
        for metadata in [full_metadata, plain_metadata] {
            let field = Field::new("x", DataType::Float64, true);
            let field = field.with_metadata(metadata.to_pairs());
            assert_eq!(ColumnMetadata::from_field(&field), metadata);
        }
    }
}

//! A small result file: columns with units and descriptions, metadata as in the map's file
//! (`store::schema`), in one piece.

use std::collections::HashMap;
use std::io::Cursor;
use std::sync::Arc;

use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, BooleanArray, DictionaryArray, Float64Array, RecordBatch, UInt64Array,
};
use arrow_schema::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use serde_json::{Map, Value, json};

use crate::build::Build;
use sweep_files::panics;
use sweep_files::{CREATED_BY, key, seal};
use sweep_parameter::{Parameter, Worse};

/// A column's metadata in the Arrow schema.
pub fn field_metadata(unit: &str, description: &str) -> HashMap<String, String> {
    [("unit", unit), ("description", description)]
        .map(|(key, text)| (key.to_owned(), text.to_owned()))
        .into()
}

/// A column's entry in the column dictionary, the JSON under `key::COLUMNS`.
pub fn dictionary_entry(type_name: &str, unit: &str, description: &str) -> Value {
    json!({ "type": type_name, "unit": unit, "description": description })
}

/// Columns on their way to a file.
pub struct Table {
    build: Build,
    fields: Vec<Field>,
    arrays: Vec<ArrayRef>,
    dictionary: Map<String, Value>,
    metadata: Vec<KeyValue>,
}

impl Table {
    /// Without columns, by this build.
    pub fn new(build: Build) -> Self {
        Self {
            build,
            fields: Vec::new(),
            arrays: Vec::new(),
            dictionary: Map::new(),
            metadata: Vec::new(),
        }
    }

    /// Adds numbers; unknown ones are null.
    pub fn numbers(
        &mut self,
        name: &str,
        unit: &str,
        description: &str,
        values: impl IntoIterator<Item = Option<f64>>,
    ) {
        let array: Float64Array = values.into_iter().collect();
        self.add(name, unit, description, "float64", Arc::new(array));
    }

    /// Adds values of a parameter.
    pub fn parameter(
        &mut self,
        of: &impl Parameter,
        values: impl IntoIterator<Item = Option<f64>>,
    ) {
        self.numbers(of.name(), of.unit(), of.description(), values);
    }

    /// Says of the last column which way it is bad.
    pub fn worse(&mut self, worse: Worse) {
        if let Some(field) = self.fields.pop() {
            let mut metadata = field.metadata().clone();
            metadata.insert(key::WORSE.to_owned(), worse.name().to_owned());
            self.dictionary[field.name()][key::WORSE] = worse.name().into();
            self.fields.push(field.with_metadata(metadata));
        }
    }

    /// Adds counts.
    pub fn counts(&mut self, name: &str, description: &str, values: impl IntoIterator<Item = u64>) {
        self.add(name, "1", description, "uint64", Arc::new(UInt64Array::from_iter_values(values)));
    }

    /// Adds words from a short list.
    pub fn words<'a>(
        &mut self,
        name: &str,
        description: &str,
        values: impl IntoIterator<Item = &'a str>,
    ) {
        let array: DictionaryArray<Int32Type> = values.into_iter().collect();
        self.add(name, "", description, "string", Arc::new(array));
    }

    /// Adds truth values.
    pub fn flags(&mut self, name: &str, description: &str, values: impl Iterator<Item = bool>) {
        let array: BooleanArray = values.map(Some).collect();
        self.add(name, "", description, "bool", Arc::new(array));
    }

    fn add(&mut self, name: &str, unit: &str, description: &str, type_name: &str, array: ArrayRef) {
        let nullable = matches!(array.data_type(), DataType::Float64);
        self.fields.push(
            Field::new(name, array.data_type().clone(), nullable)
                .with_metadata(field_metadata(unit, description)),
        );
        self.arrays.push(array);
        self.dictionary.insert(name.to_owned(), dictionary_entry(type_name, unit, description));
    }

    /// Adds an entry to the file's key-value metadata.
    pub fn metadata(&mut self, key: &str, value: &Value) {
        self.text(key, value.to_string());
    }

    /// Adds an entry that is not JSON.
    pub fn text(&mut self, key: &str, value: String) {
        self.metadata.push(KeyValue::new(key.to_owned(), value));
    }

    /// The plan that was added to the metadata; null if none was.
    pub fn plan(&self) -> Value {
        let plan = self.metadata.iter().find(|pair| pair.key == key::PLAN);
        let plan = plan.and_then(|pair| serde_json::from_str(pair.value.as_deref()?).ok());
        plan.unwrap_or_default()
    }

    /// The file's bytes.
    ///
    /// # Errors
    /// What the Parquet library refuses: a defect of whoever filled the table.
    pub fn into_bytes(self) -> Result<Vec<u8>, ParquetError> {
        self.finish().map(|(_, bytes)| bytes)
    }

    /// The columns, and the bytes of their file.
    ///
    /// # Errors
    /// As [`Self::into_bytes`].
    pub fn finish(mut self) -> Result<(RecordBatch, Vec<u8>), ParquetError> {
        let Build { version, numerics } = self.build;
        self.text(key::VERSION, version.to_owned());
        self.text(key::NUMERICS, numerics.to_string());
        self.metadata.push(KeyValue::new(
            key::COLUMNS.to_owned(),
            Value::Object(self.dictionary).to_string(),
        ));
        let properties = WriterProperties::builder()
            .set_created_by(format!("{CREATED_BY}{version}"))
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_dictionary_enabled(false)
            .set_key_value_metadata(Some(self.metadata))
            .build();
        let schema = Arc::new(Schema::new(self.fields));
        let batch = RecordBatch::try_new(schema.clone(), self.arrays)?;
        let rows = batch.clone();
        let bytes = panics::in_parquet("the library gave up writing", move || {
            let mut writer = ArrowWriter::try_new(Vec::new(), schema, Some(properties))?;
            writer.write(&rows)?;
            writer.append_key_value_metadata(seal::blank());
            writer.into_inner()
        })?;
        let mut file = Cursor::new(bytes);
        seal::seal(&mut file)?;
        Ok((batch, file.into_inner()))
    }
}

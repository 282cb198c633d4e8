//! A writer of small result files. A file has columns with units and descriptions, the metadata of
//! a map's file (`store::schema`), and one row group.

use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, BooleanArray, DictionaryArray, Float64Array, RecordBatch, UInt64Array,
};
use arrow_schema::{DataType, Field, Schema};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use serde_json::Value;

use crate::store::schema::{CellType, DeclaredColumn, common_writer_properties};
use crate::{Build, StoreError};
use sweep_files::batches::from_arrow;
use sweep_files::{Writer, key, panics, seal};
use sweep_parameter::{Parameter, Worse};

/// A result file under construction.
pub struct Table {
    build: Build,
    columns: Vec<(DeclaredColumn, ArrayRef)>,
    metadata: Vec<KeyValue>,
}

impl Table {
    /// Creates a table without columns.
    pub fn new(build: Build) -> Self {
        Self { build, columns: Vec::new(), metadata: Vec::new() }
    }

    /// Adds a column of numbers, null where there is none.
    pub fn add_numbers(
        &mut self,
        name: &str,
        unit: &str,
        description: &str,
        values: impl IntoIterator<Item = Option<f64>>,
    ) {
        let array: Float64Array = values.into_iter().collect();
        self.add_column(name, unit, description, CellType::Measured, Arc::new(array));
    }

    /// Adds a column of a parameter's values.
    pub fn add_parameter(
        &mut self,
        parameter: &Parameter<impl Sized>,
        values: impl IntoIterator<Item = Option<f64>>,
    ) {
        self.add_numbers(&parameter.name, parameter.unit, parameter.description, values);
    }

    /// Sets the direction in which values of the last column are worse.
    pub fn set_worse(&mut self, worse: Worse) {
        if let Some((column, _)) = self.columns.last_mut() {
            column.metadata.worse = Some(worse);
        }
    }

    /// Adds a column of counts.
    pub fn add_counts(
        &mut self,
        name: &str,
        description: &str,
        values: impl IntoIterator<Item = u64>,
    ) {
        let array = UInt64Array::from_iter_values(values);
        self.add_column(name, "1", description, CellType::Count, Arc::new(array));
    }

    /// Adds a column of words, few of which are distinct.
    pub fn add_words<'a>(
        &mut self,
        name: &str,
        description: &str,
        values: impl IntoIterator<Item = &'a str>,
    ) {
        let array: DictionaryArray<Int32Type> = values.into_iter().collect();
        self.add_column(name, "", description, CellType::Name(Vec::new()), Arc::new(array));
    }

    /// Adds a column of truth values.
    pub fn add_flags(&mut self, name: &str, description: &str, values: impl Iterator<Item = bool>) {
        let array: BooleanArray = values.map(Some).collect();
        self.add_column(name, "", description, CellType::Flag, Arc::new(array));
    }

    fn add_column(
        &mut self,
        name: &str,
        unit: &str,
        description: &str,
        kind: CellType,
        array: ArrayRef,
    ) {
        self.columns.push((DeclaredColumn::new(name, unit, description, kind), array));
    }

    /// Adds a JSON value to the file's key-value metadata.
    pub fn add_metadata(&mut self, key: &str, value: &Value) {
        self.add_text(key, value.to_string());
    }

    /// Adds a text to the file's key-value metadata.
    pub fn add_text(&mut self, key: &str, value: String) {
        self.metadata.push(KeyValue::new(key.to_owned(), value));
    }

    /// Returns the plan in the metadata, null if there is none.
    pub fn plan(&self) -> Value {
        let plan = self.metadata.iter().find(|pair| pair.key == key::PLAN);
        let plan = plan.and_then(|pair| serde_json::from_str(pair.value.as_deref()?).ok());
        plan.unwrap_or_default()
    }

    /// Returns the bytes of the file; `path` is named in errors.
    ///
    /// # Errors
    /// The errors of [`Self::finish`].
    pub fn into_bytes(self, path: &Path) -> Result<Vec<u8>, StoreError> {
        self.finish().map(|(_, bytes)| bytes).map_err(StoreError::parquet("write", path))
    }

    /// Returns the columns, and the bytes of their file.
    ///
    /// # Errors
    /// A table that the Parquet library refuses, such as one with columns of different lengths.
    pub fn finish(mut self) -> Result<(RecordBatch, Vec<u8>), ParquetError> {
        let Build { version, numerics } = self.build;
        self.add_text(key::VERSION, version.to_owned());
        self.add_text(key::NUMERICS, numerics.to_string());
        let properties =
            common_writer_properties(version, self.metadata).set_dictionary_enabled(false).build();
        let field_and_array = |(column, array): (DeclaredColumn, ArrayRef)| {
            let data_type = array.data_type().clone();
            let is_nullable = data_type == DataType::Float64;
            (column.arrow_field(data_type, is_nullable), array)
        };
        let (fields, arrays): (Vec<Field>, _) =
            self.columns.into_iter().map(field_and_array).unzip();
        let schema = Arc::new(Schema::new(fields));
        let batch = RecordBatch::try_new(schema.clone(), arrays).map_err(from_arrow)?;
        let batch_to_write = batch.clone();
        let bytes = panics::catch_in_parquet("the library gave up writing", move || {
            let mut writer = Writer::new(Vec::new(), &schema, properties)?;
            writer.write(&batch_to_write)?;
            let mut file = writer.end()?;
            file.append_key_value_metadata(seal::blank_digest());
            file.into_inner()
        })?;
        let mut file = Cursor::new(bytes);
        seal::seal(&mut file)?;
        Ok((batch, file.into_inner()))
    }
}

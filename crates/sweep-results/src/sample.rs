//! Result files for tests.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, BooleanArray, DictionaryArray, Float64Array, RecordBatch, UInt64Array,
};
use arrow_schema::{Field, Schema};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use serde_json::{Value, json};
use sweep_files::{ColumnMetadata, ResultTable, Writer, key};
use sweep_parameter::Worse;

/// A column to be written: name, unit, cells.
pub(crate) type ColumnData = (&'static str, &'static str, ArrayRef);

pub(crate) fn number_array(values: &[Option<f64>]) -> ArrayRef {
    Arc::new(Float64Array::from(values.to_vec()))
}

pub(crate) fn flag_array(values: &[Option<bool>]) -> ArrayRef {
    Arc::new(BooleanArray::from(values.to_vec()))
}

pub(crate) fn text_array(values: &[&str]) -> ArrayRef {
    Arc::new(values.iter().copied().collect::<DictionaryArray<Int32Type>>())
}

/// Writes a file of these columns and key-value metadata.
pub(crate) fn write(path: &Path, columns: Vec<ColumnData>, key_values: &[(&str, Value)]) {
    let to_field = |(name, unit, array): &ColumnData| {
        let metadata = ColumnMetadata {
            unit: (*unit).to_owned(),
            worse: name.starts_with("min_gap").then_some(Worse::Less),
            ..ColumnMetadata::default()
        };
        Field::new(*name, array.data_type().clone(), true).with_metadata(metadata.to_pairs())
    };
    let schema = Arc::new(Schema::new(columns.iter().map(to_field).collect::<Vec<_>>()));
    let arrays = columns.into_iter().map(|(_, _, array)| array).collect();
    let batch = RecordBatch::try_new(schema.clone(), arrays).unwrap();
    let metadata_pairs = key_values.iter().map(|(key, value)| {
        let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        KeyValue::new((*key).to_owned(), text)
    });
    let properties =
        WriterProperties::builder().set_key_value_metadata(Some(metadata_pairs.collect())).build();
    let file = File::create(path).unwrap();
    let mut writer = Writer::new(file, &schema, properties).unwrap();
    writer.write(&batch).unwrap();
    writer.end().unwrap().close().unwrap();
}

/// Returns the plan of the sample.
pub(crate) fn plan() -> Value {
    json!({
        "name": "sample",
        "machine": { "body": { "mass_kg": 24.0 } },
        "axis": [
            { "parameter": "unbalance_mass_kg", "values": [0.1, 0.2] },
            { "parameter": "damping_n_s_per_m", "values": [60.0, 70.0, 80.0] },
        ],
        "reliability": { "ratio_limit": 2.0 },
    })
}

/// Returns the columns of a map of two masses by three dampings.
pub(crate) fn map_columns(ratios: &[Option<f64>]) -> Vec<ColumnData> {
    let row_count = ratios.len();
    let masses: Vec<_> = (0..row_count).map(|row| Some(if row < 3 { 0.1 } else { 0.2 })).collect();
    let dampings: Vec<_> = (0..row_count).map(|row| Some(60.0 + 10.0 * (row % 3) as f64)).collect();
    let reliable_flags: Vec<_> =
        ratios.iter().map(|ratio| ratio.map(|ratio| ratio < 2.0)).collect();
    let statuses: Vec<_> =
        ratios.iter().map(|ratio| if ratio.is_some() { "ok" } else { "diverged" }).collect();
    let sensitive_flags: Vec<_> = (0..row_count).map(|row| Some(row == 4)).collect();
    let gaps: Vec<_> = ratios.iter().map(|ratio| ratio.map(|ratio| 0.01 - ratio * 1e-3)).collect();
    vec![
        ("point", "1", Arc::new(UInt64Array::from_iter_values(0..row_count as u64))),
        ("unbalance_mass_kg", "kg", number_array(&masses)),
        ("damping_n_s_per_m", "N s/m", number_array(&dampings)),
        ("nonlinear_body_yaw", "rad", number_array(ratios)),
        ("linear_body_yaw", "rad", number_array(&vec![Some(1.0); row_count])),
        ("ratio_body_yaw", "1", number_array(ratios)),
        ("ratio_max", "1", number_array(ratios)),
        ("reliable", "", flag_array(&reliable_flags)),
        ("sensitive", "", flag_array(&sensitive_flags)),
        ("min_gap_nonlinear_m", "m", number_array(&gaps)),
        ("status", "", text_array(&statuses)),
    ]
}

/// The ratios of the sample.
pub(crate) const RATIOS: [Option<f64>; 6] =
    [Some(1.0), Some(1.5), Some(2.5), None, Some(4.0), Some(1.2)];

/// Returns a map of six rows: the fourth has diverged, the fifth is sensitive.
pub(crate) fn table() -> ResultTable {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("sample.parquet");
    write(&path, map_columns(&RATIOS), &[(key::PLAN, plan())]);
    // The open file stays readable after its folder is deleted.
    ResultTable::open(&path).unwrap()
}

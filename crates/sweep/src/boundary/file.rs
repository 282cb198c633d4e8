//! The boundary file: one row per place where the side changes, or per row of the first axis that has none.

use std::collections::HashMap;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, DictionaryArray, Float64Array, Int32Array, RecordBatch, StringArray, UInt64Array,
};
use arrow_schema::{ArrowError, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::FileReader;
use parquet::file::serialized_reader::SerializedFileReader;
use serde_json::{Map, Value, json};

use super::product::{Task, further_values};
use super::quantity::Quantity;
use super::{Edge, Kind, Traced, TracedRow};
use crate::plan::{Axis, Plan};
use crate::store::schema::key;
use crate::store::{Job, StoreError, atomic};

/// Key of the file's metadata that says what was traced: quantity, limit, tolerance, lattice, trials, rounds.
pub const BOUNDARY: &str = "sweep.boundary";

/// One line of the file.
struct Line<'a> {
    curve: usize,
    row: &'a TracedRow,
    /// From 1; 0 where there is none in range.
    number: usize,
    edge: &'a Edge,
}

/// A column on its way into the file.
struct Column {
    name: String,
    unit: String,
    description: String,
    type_name: &'static str,
    array: ArrayRef,
}

/// A name with something before its unit's suffix: `damping_n_s_per_m` and `low` give `damping_low_n_s_per_m`.
fn within(name: &str, unit: &str, word: &str) -> String {
    let suffix = match unit {
        "m" => "_m",
        "kg" => "_kg",
        "s" => "_s",
        "rpm" => "_rpm",
        "N/m" => "_n_per_m",
        "N s/m" => "_n_s_per_m",
        "N m/rad" => "_n_m_per_rad",
        "kg m^2" => "_kg_m2",
        "m/s^2" => "_m_per_s2",
        _ => "",
    };
    let stem = name.strip_suffix(suffix).unwrap_or(name);
    format!("{stem}_{word}{}", &name[stem.len()..])
}

/// Writes the file whole, or not at all.
///
/// # Errors
/// [`StoreError::Io`].
pub fn write(
    path: &Path,
    plan: &Plan,
    quantity: Quantity,
    task: &Task,
    traced: &Traced,
) -> Result<(), StoreError> {
    let failed = |error| StoreError::parquet("write", path)(error);
    let columns = columns(plan, quantity, traced).map_err(|error| failed(ParquetError::from(error)))?;
    let fields: Vec<Field> = columns.iter().map(field).collect();
    let dictionary: Map<String, Value> = columns
        .iter()
        .map(|column| {
            let facts =
                json!({ "type": column.type_name, "unit": column.unit, "description": column.description });
            (column.name.clone(), facts)
        })
        .collect();
    let job = Job::of(plan);
    let about = json!({
        "quantity": quantity.name(),
        "limit": quantity.limit(plan),
        "tolerance": task.search.tolerance,
        "lattice": task.search.lattice,
        "points": traced.trials,
        "rounds": traced.rounds,
    });
    let pair = |key: &str, value: String| KeyValue::new(key.to_owned(), value);
    let metadata = vec![
        pair(key::PLAN, job.plan.to_string()),
        pair(key::PLAN_HASH, job.hash().to_hex().to_string()),
        pair(key::VERSION, job.version.to_owned()),
        pair(BOUNDARY, about.to_string()),
        pair(key::COLUMNS, Value::Object(dictionary).to_string()),
    ];
    let properties = WriterProperties::builder()
        // The library's own default names its version, and an upgrade would change the bytes.
        .set_created_by(format!("sweep version {}", job.version))
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(metadata))
        .build();
    let schema = Arc::new(Schema::new(fields));
    let arrays = columns.into_iter().map(|column| column.array).collect();
    let batch = RecordBatch::try_new(Arc::clone(&schema), arrays)
        .map_err(|error| failed(ParquetError::from(error)))?;
    let folder = atomic::parent(path);
    std::fs::create_dir_all(folder).map_err(StoreError::io("create the folder", folder))?;
    let file = atomic::begin(folder)?;
    let mut writer = ArrowWriter::try_new(BufWriter::new(&file), schema, Some(properties)).map_err(failed)?;
    writer.write(&batch).map_err(failed)?;
    let buffer = writer.into_inner().map_err(failed)?;
    buffer.into_inner().map_err(|error| StoreError::io("write", path)(error.into_error()))?;
    atomic::publish(file, path)
}

/// Whether this path may be written: nothing is there, or a boundary file.
///
/// # Errors
/// [`StoreError::BadOutput`] when something else is.
pub fn may_replace(path: &Path) -> Result<(), StoreError> {
    let bad = |reason| StoreError::BadOutput { output: path.to_path_buf(), reason };
    if path.file_name().is_none() {
        return Err(bad("it has no file name"));
    }
    if path.is_dir() {
        return Err(bad("it is a folder"));
    }
    let Ok(file) = std::fs::File::open(path) else { return Ok(()) };
    let reader = SerializedFileReader::new(file).ok();
    let metadata = reader.as_ref().and_then(|reader| reader.metadata().file_metadata().key_value_metadata());
    if metadata.is_some_and(|pairs| pairs.iter().any(|pair| pair.key == BOUNDARY)) {
        Ok(())
    } else {
        Err(bad("a file that is no boundary file is there; give another name, or remove it first"))
    }
}

fn field(column: &Column) -> Field {
    let metadata = HashMap::from([
        ("unit".into(), column.unit.clone()),
        ("description".into(), column.description.clone()),
    ]);
    let nullable = column.array.null_count() > 0 || column.type_name == "float64";
    Field::new(&column.name, column.array.data_type().clone(), nullable).with_metadata(metadata)
}

fn columns(plan: &Plan, quantity: Quantity, traced: &Traced) -> Result<Vec<Column>, ArrowError> {
    let lines: Vec<Line<'_>> = traced
        .curves
        .iter()
        .enumerate()
        .flat_map(|(curve, rows)| rows.iter().map(move |row| (curve, row)))
        .flat_map(|(curve, row)| {
            row.edges.iter().enumerate().map(move |(k, edge)| {
                let number = if edge.bracket.is_some() { k + 1 } else { 0 };
                Line { curve, row, number, edge }
            })
        })
        .collect();
    let mut columns = axis_columns(plan, quantity, &lines);
    let kinds = Int32Array::from_iter_values(lines.iter().map(|line| {
        let position = Kind::ALL.iter().position(|kind| *kind == line.edge.kind);
        position.and_then(|position| i32::try_from(position).ok()).unwrap_or_default()
    }));
    let names = StringArray::from_iter_values(Kind::ALL.map(Kind::name));
    columns.push(Column {
        name: "kind".into(),
        unit: String::new(),
        description: "crossing, jump (the quantity leaps over its limit), undefined (it is not defined on one side), or \
                      why there is none in range: reliable, unreliable or undefined wherever it was evaluated"
            .into(),
        type_name: "string",
        array: Arc::new(DictionaryArray::<Int32Type>::try_new(kinds, Arc::new(names))?),
    });
    let count = |name: &str, description: &str, of: &dyn Fn(&Line<'_>) -> usize| Column {
        name: name.into(),
        unit: "1".into(),
        description: description.into(),
        type_name: "uint64",
        array: Arc::new(UInt64Array::from_iter_values(lines.iter().map(|line| of(line) as u64))),
    };
    columns.push(count(
        "crossing",
        "number of this change of side at this value of the first axis, from 1 upwards along the second; 0 where none is \
         in range",
        &|line| line.number,
    ));
    columns.push(count("crossings", "how many changes of side there are", &|line| {
        line.row.edges.iter().filter(|edge| edge.bracket.is_some()).count()
    }));
    let ends = [(0, "low", "lower"), (1, "high", "upper")];
    columns.extend(ends.map(|(end, word, side)| {
        Column {
            name: format!("quantity_{word}"),
            unit: quantity.unit().into(),
            description: format!("{} at the bracket's {side} end; null where not defined", quantity.name()),
            type_name: "float64",
            array: Arc::new(
                lines
                    .iter()
                    .map(|line| line.edge.distances[end].map(|distance| quantity.value(distance, plan)))
                    .collect::<Float64Array>(),
            ),
        }
    }));
    columns
        .push(count("points", "points evaluated at this value of the first axis", &|line| line.row.trials));
    Ok(columns)
}

/// Where the boundary is: both axes, the bracket, and the axes beyond the second.
fn axis_columns(plan: &Plan, quantity: Quantity, lines: &[Line<'_>]) -> Vec<Column> {
    let [first, second, further @ ..] = plan.axes.as_slice() else { return Vec::new() };
    let column = |axis: &Axis, name: String, description: String, array: Float64Array| Column {
        name,
        unit: axis.parameter.unit().to_owned(),
        description,
        type_name: "float64",
        array: Arc::new(array),
    };
    let plain = |axis: &Axis, array: Float64Array| {
        column(axis, axis.parameter.name().to_owned(), axis.parameter.description().to_owned(), array)
    };
    let (name, unit) = (second.parameter.name(), second.parameter.unit());
    let said = format!(
        "{}, where {} = {}; null unless it is a crossing",
        second.parameter.description(),
        quantity.name(),
        quantity.limit(plan)
    );
    let bracket = |end: usize| -> Float64Array {
        lines.iter().map(|line| line.edge.bracket.map(|bracket| bracket[end])).collect()
    };
    let mut columns = vec![
        plain(first, lines.iter().map(|line| Some(line.row.first)).collect()),
        column(second, name.to_owned(), said, lines.iter().map(|line| line.edge.at).collect()),
        column(
            second,
            within(name, unit, "low"),
            "lower end of the bracket in which the side changes; null where none is in range".into(),
            bracket(0),
        ),
        column(
            second,
            within(name, unit, "high"),
            "upper end of the bracket in which the side changes; null where none is in range".into(),
            bracket(1),
        ),
    ];
    for (k, axis) in further.iter().enumerate() {
        let values = lines.iter().map(|line| further_values(plan, line.curve).get(k).copied());
        columns.push(plain(axis, values.collect()));
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_word_stands_before_the_unit() {
        assert_eq!(within("damping_n_s_per_m", "N s/m", "low"), "damping_low_n_s_per_m");
        assert_eq!(within("drum_front_x_m", "m", "high"), "drum_front_x_high_m");
        assert_eq!(within("plain", "1", "low"), "plain_low");
    }
}

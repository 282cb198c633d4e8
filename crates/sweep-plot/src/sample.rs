//! Small files as the program writes them, for the tests of this crate and of a model's figures.

#![allow(dead_code, reason = "each of the two crates uses a part of it")]

use std::collections::HashMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use arrow_array::types::Int32Type;
use arrow_array::{
    Array as _, ArrayRef, BooleanArray, DictionaryArray, Float64Array, RecordBatch, StringArray,
    UInt64Array,
};
use arrow_schema::{Field, Schema};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use sweep_files::Writer;

/// The columns and metadata of a file to be written.
#[derive(Clone, Default)]
pub(crate) struct SampleFile {
    columns: Vec<(Field, ArrayRef)>,
    metadata: Vec<KeyValue>,
}

impl SampleFile {
    pub(crate) fn column(mut self, name: &str, unit: &str, array: ArrayRef) -> Self {
        let metadata = if unit.is_empty() {
            HashMap::new()
        } else {
            HashMap::from([
                ("unit".to_owned(), unit.to_owned()),
                ("description".to_owned(), format!("{name}, described")),
            ])
        };
        let field = Field::new(name, array.data_type().clone(), true).with_metadata(metadata);
        self.columns.push((field, array));
        self
    }

    pub(crate) fn numbers(
        self,
        name: &str,
        unit: &str,
        values: impl IntoIterator<Item = f64>,
    ) -> Self {
        // Result files mark a missing value by null, not by NaN.
        let values = values.into_iter().map(|value| value.is_finite().then_some(value));
        self.column(name, unit, Arc::new(values.collect::<Float64Array>()))
    }

    /// Adds to the last column the direction in which its values are worse, and the limit.
    pub(crate) fn with_worse(mut self, worse: &str, limit: Option<f64>) -> Self {
        let (field, _) = self.columns.last_mut().unwrap();
        let mut metadata = field.metadata().clone();
        metadata.insert("worse".to_owned(), worse.to_owned());
        metadata.extend(limit.map(|limit| ("limit".to_owned(), limit.to_string())));
        *field = field.clone().with_metadata(metadata);
        self
    }

    /// Sets the limit of the column of this name.
    pub(crate) fn with_limit(mut self, name: &str, limit: &str) -> Self {
        for (field, _) in self.columns.iter_mut().filter(|(field, _)| field.name() == name) {
            let mut metadata = field.metadata().clone();
            metadata.insert("limit".to_owned(), limit.to_owned());
            *field = field.clone().with_metadata(metadata);
        }
        self
    }

    pub(crate) fn counts(self, name: &str, values: impl IntoIterator<Item = u64>) -> Self {
        self.column(name, "1", Arc::new(UInt64Array::from_iter_values(values)))
    }

    pub(crate) fn words<'a>(
        self,
        name: &str,
        values: impl IntoIterator<Item = Option<&'a str>>,
    ) -> Self {
        let array: DictionaryArray<Int32Type> = values.into_iter().collect();
        self.column(name, "", Arc::new(array))
    }

    pub(crate) fn flags(self, name: &str, values: impl IntoIterator<Item = Option<bool>>) -> Self {
        self.column(name, "", Arc::new(values.into_iter().collect::<BooleanArray>()))
    }

    pub(crate) fn with_metadata(mut self, key: &str, value: &str) -> Self {
        self.metadata.push(KeyValue::new(key.to_owned(), value.to_owned()));
        self
    }

    pub(crate) fn without_metadata(mut self, key: &str) -> Self {
        self.metadata.retain(|pair| pair.key != key);
        self
    }

    /// Replaces cells of every column by what other writers or failed runs may leave: null, NaN,
    /// infinite, tiny and huge numbers. Some, all or none of a column's cells are replaced.
    pub(crate) fn with_damage(mut self, rng: &mut fastrand::Rng) -> Self {
        for (_, array) in &mut self.columns {
            let replaced_share = [0.0, 0.0, 0.1, 0.5, 1.0][rng.usize(..5)];
            *array = replace_cells(array, replaced_share, rng);
        }
        self
    }

    pub(crate) fn write(self, folder: &Path, name: &str) -> PathBuf {
        write_all(folder, name, [self])
    }
}

/// Replaces this share of a column's cells, all by the same value or each by another value.
fn replace_cells(array: &ArrayRef, replaced_share: f64, rng: &mut fastrand::Rng) -> ArrayRef {
    /// Values that a figure must handle without failing.
    const DAMAGED_VALUES: [Option<f64>; 12] = [
        None,
        Some(f64::NAN),
        Some(f64::INFINITY),
        Some(f64::NEG_INFINITY),
        Some(0.0),
        Some(-0.0),
        Some(-1.0),
        Some(f64::from_bits(1)),
        Some(f64::MIN_POSITIVE),
        Some(1e300),
        Some(f64::MAX),
        Some(f64::MIN),
    ];
    let common_index = rng.bool().then(|| rng.usize(..DAMAGED_VALUES.len()));
    let mut next_index = || {
        (rng.f64() < replaced_share)
            .then(|| common_index.unwrap_or(rng.usize(..DAMAGED_VALUES.len())))
    };
    if let Some(values) = array.as_any().downcast_ref::<Float64Array>() {
        let cells =
            values.iter().map(|cell| next_index().map_or(cell, |index| DAMAGED_VALUES[index]));
        return Arc::new(cells.collect::<Float64Array>());
    }
    if let Some(flags) = array.as_any().downcast_ref::<BooleanArray>() {
        let cells = flags.iter().map(|cell| if next_index().is_some() { None } else { cell });
        return Arc::new(cells.collect::<BooleanArray>());
    }
    if let Some(words) = array.as_any().downcast_ref::<DictionaryArray<Int32Type>>() {
        let words = words.downcast_dict::<StringArray>().unwrap();
        let replacement_words = ["", "diverged", "no_equilibrium"];
        let cell = |cell| match next_index() {
            Some(index) => replacement_words.get(index).copied(),
            None => cell,
        };
        let cells = words.into_iter().map(cell);
        return Arc::new(cells.collect::<DictionaryArray<Int32Type>>());
    }
    // Other writers may store counts as numbers of any type.
    let Some(counts) = array.as_any().downcast_ref::<UInt64Array>() else { return array.clone() };
    let cells = counts.iter().map(|cell| {
        next_index().map_or(cell.map(|cell| cell as f64), |index| DAMAGED_VALUES[index])
    });
    Arc::new(cells.collect::<Float64Array>())
}

/// Writes samples of the same columns to one file, one after the other, with the metadata of the
/// first.
fn write_all(folder: &Path, name: &str, samples: impl IntoIterator<Item = SampleFile>) -> PathBuf {
    let path = folder.join(name);
    let mut writer: Option<Writer<std::fs::File>> = None;
    for sample in samples {
        let with_type_of_array = |(field, array): (Field, ArrayRef)| {
            (field.with_data_type(array.data_type().clone()), array)
        };
        let (fields, arrays): (Vec<Field>, Vec<ArrayRef>) =
            sample.columns.into_iter().map(with_type_of_array).unzip();
        let batch = RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays).unwrap();
        let writer = writer.get_or_insert_with(|| {
            let properties =
                WriterProperties::builder().set_key_value_metadata(Some(sample.metadata)).build();
            let file = std::fs::File::create(&path).unwrap();
            Writer::new(file, &batch.schema(), properties).unwrap()
        });
        writer.write(&batch).unwrap();
    }
    writer.unwrap().end().unwrap().close().unwrap();
    path
}

/// A map to be written: axes by name and values, and the motion of both models at a point.
pub(crate) struct MapSample<'a> {
    pub(crate) axes: Vec<(&'a str, Vec<f64>)>,
    pub(crate) limit: f64,
    /// The amplitudes of `body_yaw` in the nonlinear and the linear model, rad; `None` if the run
    /// diverged.
    pub(crate) yaw: &'a dyn Fn(&[f64]) -> Option<[f64; 2]>,
    /// Whether the motion at a point is chaotic.
    pub(crate) is_chaotic: &'a dyn Fn(&[f64]) -> bool,
}

impl MapSample<'_> {
    pub(crate) fn sample(&self) -> SampleFile {
        self.rows(0..self.point_count())
    }

    /// Writes all rows, of which few are in memory at a time.
    pub(crate) fn write_long(&self, folder: &Path, name: &str) -> PathBuf {
        /// Rows in memory at a time.
        const ROWS_AT_A_TIME: usize = 1 << 14;
        let row_count = self.point_count();
        let sample_from = |row: usize| self.rows(row..row_count.min(row + ROWS_AT_A_TIME));
        write_all(folder, name, (0..row_count).step_by(ROWS_AT_A_TIME).map(sample_from))
    }

    fn point_count(&self) -> usize {
        self.axes.iter().map(|(_, values)| values.len()).product()
    }

    fn point(&self, index: usize) -> Vec<f64> {
        let mut remaining = index;
        let mut point: Vec<f64> = Vec::with_capacity(self.axes.len());
        for (_, values) in self.axes.iter().rev() {
            point.push(values[remaining % values.len()]);
            remaining /= values.len();
        }
        point.reverse();
        point
    }

    fn rows(&self, rows: std::ops::Range<usize>) -> SampleFile {
        let points: Vec<Vec<f64>> = rows.clone().map(|index| self.point(index)).collect();
        let amplitudes: Vec<Option<[f64; 2]>> =
            points.iter().map(|point| (self.yaw)(point)).collect();
        let amplitudes_of_model = |k: usize| {
            amplitudes
                .iter()
                .map(move |yaw| yaw.map_or(f64::NAN, |yaw| yaw[k]))
                .collect::<Vec<f64>>()
        };
        let ratios: Vec<f64> = amplitudes_of_model(0)
            .iter()
            .zip(amplitudes_of_model(1))
            .map(|(nonlinear, linear)| if linear > 0.0 { nonlinear / linear } else { f64::NAN })
            .collect();
        let mut sample = SampleFile::default().counts("point", rows.start as u64..rows.end as u64);
        for (k, (name, _)) in self.axes.iter().enumerate() {
            sample = sample.numbers(name, "", points.iter().map(|point| point[k]));
        }
        let scale_by = |factor: f64| move |value: f64| factor * value;
        let is_known = |ratios: &f64| ratios.is_finite();
        let channel = |ratios: &f64| is_known(ratios).then_some("body_yaw");
        let reliable = |ratios: &f64| is_known(ratios).then_some(*ratios < self.limit);
        let status_name = |yaw: &Option<_>| Some(if yaw.is_some() { "ok" } else { "diverged" });
        let fail_time = |yaw: &Option<_>| if yaw.is_some() { f64::NAN } else { 41.5 };
        let plan = serde_json::json!({
            "machine": { "name": "paper" }, "name": "sample",
            "reliability": { "ratio_limit": self.limit },
        });
        sample
            .numbers("nonlinear_body_yaw", "rad", amplitudes_of_model(0))
            .numbers(
                "nonlinear_body_pitch",
                "rad",
                amplitudes_of_model(0).into_iter().map(scale_by(0.4)),
            )
            .numbers("linear_body_yaw", "rad", amplitudes_of_model(1))
            .numbers(
                "linear_body_pitch",
                "rad",
                amplitudes_of_model(1).into_iter().map(scale_by(0.5)),
            )
            .numbers("ratio_body_yaw", "1", ratios.iter().copied())
            .numbers("ratio_body_pitch", "1", ratios.iter().map(|ratios| 0.8 * ratios))
            .numbers("ratio_max", "1", ratios.iter().copied())
            .words("ratio_max_channel", ratios.iter().map(channel))
            .flags("reliable", ratios.iter().map(reliable))
            .flags("sensitive", points.iter().map(|point| Some((self.is_chaotic)(point))))
            .numbers(
                "min_gap_nonlinear_m",
                "m",
                amplitudes_of_model(0).into_iter().map(|yaw| 0.01 - 0.1 * yaw),
            )
            .with_worse("less", Some(0.0))
            .numbers("margin_n", "N", amplitudes_of_model(0).into_iter().map(|yaw| 1.0 - yaw))
            .with_worse("less", None)
            .numbers(
                "min_gap_linear_m",
                "m",
                amplitudes_of_model(1).into_iter().map(|yaw| 0.01 - 0.1 * yaw),
            )
            .with_worse("less", Some(0.0))
            .words("status", amplitudes.iter().map(status_name))
            .numbers("fail_time_s", "s", amplitudes.iter().map(fail_time))
            .counts("steps_nonlinear", points.iter().map(|_| 250_000))
            .with_metadata("sweep.plan", &plan.to_string())
            .with_metadata("sweep.version", "0.1.0")
    }
}

/// Returns a map over two axes whose boundary is the line damping = 50 + 200 mass, with a failed
/// and an undefined point.
pub(crate) fn map_sample() -> SampleFile {
    let axis = |from: f64, step: f64, count: i32| {
        (0..count).map(|k| from + step * f64::from(k)).collect::<Vec<f64>>()
    };
    MapSample {
        axes: vec![
            ("unbalance_mass_kg", axis(0.1, 0.1, 10)),
            ("damping_n_s_per_m", axis(60.0, 30.0, 9)),
        ],
        limit: 3.0,
        yaw: &|point| match point {
            [mass, damping] if *mass > 0.95 && *damping < 70.0 => None,
            [mass, damping] if *mass < 0.15 && *damping > 290.0 => Some([0.0, 0.0]),
            [mass, damping] => {
                Some([0.009 * 3.0 * ((50.0 + 200.0 * mass - damping) / 60.0).exp(), 0.009])
            }
            _ => unreachable!("two axes"),
        },
        is_chaotic: &|_| false,
    }
    .sample()
}

/// Returns a boundary file with its bracket.
pub(crate) fn boundary_sample() -> SampleFile {
    let masses: Vec<f64> = (1..=10).map(|k| 0.1 * f64::from(k)).collect();
    let damping = |offset: f64| {
        masses.iter().map(move |masses| 50.0 + 200.0 * masses + offset).collect::<Vec<f64>>()
    };
    SampleFile::default()
        .numbers("unbalance_mass_kg", "kg", masses.iter().copied())
        .numbers("damping_n_s_per_m", "N s/m", damping(0.0))
        .numbers("damping_low_n_s_per_m", "N s/m", damping(-2.0))
        .numbers("damping_high_n_s_per_m", "N s/m", damping(3.0))
}

/// Maximum time of a figure of a small file. Basis: a hundred times that of the slowest intact
/// file. A larger bound finds only loops that never end.
const MAX_TIME: Duration = Duration::from_secs(20);

/// Draws a damaged file and returns whether it has a figure; otherwise it has an error. `name`
/// stands in messages; `max_bytes` is the maximum size of the figure.
pub(crate) fn has_figure<E: Display>(
    name: &str,
    max_bytes: usize,
    draw: impl FnOnce() -> Result<Vec<u8>, E>,
) -> bool {
    let start_time = Instant::now();
    let result = draw();
    let elapsed_time = start_time.elapsed();
    assert!(elapsed_time < MAX_TIME, "{name}: {elapsed_time:?}");
    match result {
        Ok(bytes) => assert!(bytes.len() < max_bytes, "{name}: {} bytes", bytes.len()),
        Err(error) => {
            assert!(!error.to_string().is_empty(), "{name}");
            return false;
        }
    }
    true
}

/// Returns the number in an environment variable, or else its default.
pub(crate) fn number_from_environment(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().unwrap())
}

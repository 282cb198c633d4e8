//! Tests of `sweep plot` for maps with more rows than a figure has pixels: its memory and the size
//! of its files.

#![cfg(target_os = "linux")]

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Output};
use std::sync::Arc;

use arrow_array::types::Int32Type;
use arrow_array::{ArrayRef, BooleanArray, DictionaryArray, Float64Array, Int32Array};
use arrow_array::{RecordBatch, StringArray, UInt64Array};
use sweep_files::Writer;

use crate::flips::finished;
use crate::test_folder::sweep_binary;

/// The greatest memory of a plot (bytes), for any number of rows.
const MAX_MEMORY_BYTES: u64 = 200_000_000;
/// The greatest size of a figure or a page (bytes).
const MAX_FIGURE_BYTES: u64 = 10_000_000;

const ROWS_AT_ONCE: u64 = 1 << 16;

/// Returns a pseudorandom number from 0 to 1.
fn noise(index: u64) -> f64 {
    let mixed = (index ^ 0x5bf0_3635).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mixed >> 11) as f64 / (1_u64 << 53) as f64
}

fn name_array(list: &[&str], keys: impl Iterator<Item = Option<i32>>) -> ArrayRef {
    let names = StringArray::from_iter_values(list);
    Arc::new(DictionaryArray::<Int32Type>::new(keys.collect::<Int32Array>(), Arc::new(names)))
}

/// Returns rows of a map with `values_per_axis` dampings for each mass. The ratio falls with
/// damping, with noise of the size `noise_factor`; some points fail, some are undefined, some
/// chaotic.
fn rows(from: u64, to: u64, values_per_axis: u64, noise_factor: f64) -> RecordBatch {
    let points: Vec<u64> = (from..to).collect();
    let has_failed = |point: u64| noise(3 * point) < 0.05 * noise_factor;
    let ratio = |point: u64| {
        let [mass, damping] = [point / values_per_axis, point % values_per_axis]
            .map(|at| at as f64 / values_per_axis as f64);
        let undisturbed_ratio =
            (3.0 * (mass - damping) + noise_factor * 6.0 * (noise(point) - 0.5)).exp();
        (!has_failed(point) && noise(7 * point) > 0.01 * noise_factor)
            .then_some(2.0 * undisturbed_ratio)
    };
    let number_array = |value: &dyn Fn(u64) -> Option<f64>| -> ArrayRef {
        Arc::new(points.iter().map(|&point| value(point)).collect::<Float64Array>())
    };
    let count_array = |value: &dyn Fn(u64) -> u64| -> ArrayRef {
        Arc::new(UInt64Array::from_iter_values(points.iter().map(|&point| value(point))))
    };
    let flag_array = |value: &dyn Fn(u64) -> Option<bool>| -> ArrayRef {
        Arc::new(points.iter().map(|&point| value(point)).collect::<BooleanArray>())
    };
    let amplitude = |point: u64| (!has_failed(point)).then(|| 0.01 * (1.0 + noise(5 * point)));
    let nonlinear = |point: u64| Some(amplitude(point)? * ratio(point).unwrap_or(0.0));
    let gap = |point: u64| Some(0.01 - 0.1 * amplitude(point)?);
    let statuses = points.iter().map(|&point| Some(i32::from(has_failed(point))));
    let channels = points.iter().map(|&point| ratio(point).map(|_| i32::from(noise(point) < 0.5)));
    let methods = points.iter().map(|&point| Some((point % 4) as i32));
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("point", count_array(&|point| point)),
        (
            "unbalance_mass_kg",
            number_array(&|point| Some(0.05 + 1e-4 * (point / values_per_axis) as f64)),
        ),
        (
            "damping_n_s_per_m",
            number_array(&|point| Some(60.0 + 0.1 * (point % values_per_axis) as f64)),
        ),
        ("nonlinear_tub_yaw", number_array(&nonlinear)),
        ("nonlinear_tub_pitch", number_array(&nonlinear)),
        ("linear_tub_yaw", number_array(&amplitude)),
        ("linear_tub_pitch", number_array(&amplitude)),
        ("ratio_tub_yaw", number_array(&ratio)),
        ("ratio_tub_pitch", number_array(&|point| Some(0.8 * ratio(point)?))),
        ("ratio_max", number_array(&ratio)),
        ("ratio_max_channel", name_array(&["tub_yaw", "tub_pitch"], channels)),
        ("reliable", flag_array(&|point| Some(ratio(point)? < 2.0))),
        (
            "sensitive",
            flag_array(&|point| {
                (!has_failed(point)).then_some(noise(11 * point) < 0.3 * noise_factor)
            }),
        ),
        ("method", name_array(&["capped_1", "capped_2", "dop853", "rk4"], methods)),
        ("error", number_array(&|point| Some(1e-3 * noise(13 * point)))),
        ("min_gap_nonlinear_m", number_array(&gap)),
        ("min_gap_linear_m", number_array(&gap)),
        ("status", name_array(&["ok", "diverged"], statuses)),
        ("fail_time_s", number_array(&|point| has_failed(point).then_some(41.5))),
        ("steps_nonlinear", count_array(&|_| 250_000)),
        ("steps_linear", count_array(&|_| 250_000)),
        ("rejected_nonlinear", count_array(&|_| 0)),
        ("rejected_linear", count_array(&|_| 0)),
    ];
    let columns = columns.into_iter().map(|(name, array)| (name, array, true));
    RecordBatch::try_from_iter_with_nullable(columns).expect("columns of one length")
}

/// Writes a map of `values_per_axis` masses by `values_per_axis` dampings.
fn write_map(path: &Path, values_per_axis: u64, noise_factor: f64) {
    let file = File::create(path).expect("the map can be made");
    let mut writer: Option<Writer<File>> = None;
    let mut file = Some(file);
    for from in (0..values_per_axis * values_per_axis).step_by(ROWS_AT_ONCE as usize) {
        let batch = rows(
            from,
            (from + ROWS_AT_ONCE).min(values_per_axis * values_per_axis),
            values_per_axis,
            noise_factor,
        );
        let writer = writer.get_or_insert_with(|| {
            let file = file.take().expect("one writer");
            Writer::new(file, &batch.schema(), Default::default()).expect("a writer")
        });
        writer.write(&batch).expect("rows are written");
    }
    writer.expect("rows").end().and_then(|file| file.close()).expect("the map is written");
}

/// Runs the command with a limit of address space.
fn plot_within(bytes: u64, folder: &Path, words: &[&str]) -> Output {
    let limit = format!("ulimit -v {}; exec \"$@\"", bytes / 1000);
    let mut command = Command::new("sh");
    command.args(["-c", &limit, "sh"]).arg(sweep_binary()).arg("plot");
    command.args(words).current_dir(folder).output().expect("sh runs")
}

fn assert_bounded_figures(values_per_axis: u64, noise_factor: f64) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write_map(&folder.path().join("map.parquet"), values_per_axis, noise_factor);
    for name in ["map.svg", "map.png", "map.html"] {
        let run = plot_within(MAX_MEMORY_BYTES, folder.path(), &["map.parquet", "-o", name]);
        let messages = String::from_utf8_lossy(&run.stderr);
        assert!(run.status.success(), "{values_per_axis} by {values_per_axis}, {name}: {messages}");
        let bytes = fs::metadata(folder.path().join(name)).expect("a figure").len();
        assert!(
            bytes < MAX_FIGURE_BYTES,
            "{values_per_axis} per axis, noise factor {noise_factor}: {bytes} bytes of {name}"
        );
        if let Some(output_folder) = std::env::var_os("SHOTS") {
            let output_folder =
                Path::new(&output_folder).join(format!("{values_per_axis}_{noise_factor}_{name}"));
            fs::copy(folder.path().join(name), output_folder).expect("the figure is kept");
        }
    }
}

#[test]
fn memory_and_figures_of_a_million_rows_are_bounded() {
    assert_bounded_figures(1000, 0.02);
}

#[test]
fn memory_and_figures_of_noisy_rows_are_bounded() {
    assert_bounded_figures(1000, 1.0);
}

#[test]
#[ignore = "writes 1.5 GB and takes a minute; .ci/run runs it"]
fn memory_and_figures_of_ten_million_rows_are_bounded() {
    assert_bounded_figures(3163, 0.02);
}

#[test]
fn a_flipped_bit_is_an_error() {
    let test_folder = finished();
    fs::rename(test_folder.path("x.parquet"), test_folder.path("map.parquet"))
        .expect("there is a result");
    assert!(test_folder.sweep(&["plot", "map.parquet", "-o", "whole.svg"]).status.success());
    let whole_file = fs::read(test_folder.path("map.parquet")).expect("a map");
    for bit in (0..8 * whole_file.len()).step_by(8 * whole_file.len() / 150 + 1) {
        let mut bytes = whole_file.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        fs::write(test_folder.path("map.parquet"), bytes).expect("the map is written");
        let run = test_folder.sweep(&["plot", "map.parquet", "-o", "a.svg"]);
        let messages = String::from_utf8_lossy(&run.stderr);
        assert_eq!(run.status.code(), Some(2), "bit {bit}: {messages}");
        assert!(messages.contains("map.parquet is"), "bit {bit}: {messages}");
        assert!(!messages.contains("panicked"), "bit {bit}: {messages}");
        assert!(!test_folder.path("a.svg").exists(), "bit {bit}");
    }
}

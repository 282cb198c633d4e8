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

use crate::flips::folder_with_result;
use crate::test_folder::sweep_binary;

/// The greatest memory of a plot (bytes), for any number of rows.
const MAX_MEMORY_BYTES: u64 = 200_000_000;
/// The greatest size of a figure or a page (bytes).
const MAX_FIGURE_BYTES: u64 = 10_000_000;

const ROWS_AT_ONCE: u64 = 1 << 16;

/// Returns a pseudorandom number from 0 to 1.
fn random_unit(index: u64) -> f64 {
    let mixed = (index ^ 0x5bf0_3635).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mixed >> 11) as f64 / (1_u64 << 53) as f64
}

fn dictionary_array(distinct_names: &[&str], keys: impl Iterator<Item = Option<i32>>) -> ArrayRef {
    let names = StringArray::from_iter_values(distinct_names);
    Arc::new(DictionaryArray::<Int32Type>::new(keys.collect::<Int32Array>(), Arc::new(names)))
}

/// Returns rows of a map with `values_per_axis` dampings for each mass. The ratio falls with
/// damping, with noise in proportion to `noise_factor`. Some points fail, some have no ratio, and
/// some are chaotic.
fn map_rows(
    first_point: u64,
    end_point: u64,
    values_per_axis: u64,
    noise_factor: f64,
) -> RecordBatch {
    let points: Vec<u64> = (first_point..end_point).collect();
    let point_fails = |point: u64| random_unit(3 * point) < 0.05 * noise_factor;
    let ratio_of_point = |point: u64| {
        let [mass, damping] = [point / values_per_axis, point % values_per_axis]
            .map(|index| index as f64 / values_per_axis as f64);
        let noisy_ratio =
            (3.0 * (mass - damping) + noise_factor * 6.0 * (random_unit(point) - 0.5)).exp();
        (!point_fails(point) && random_unit(7 * point) > 0.01 * noise_factor)
            .then_some(2.0 * noisy_ratio)
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
    let linear_amplitude =
        |point: u64| (!point_fails(point)).then(|| 0.01 * (1.0 + random_unit(5 * point)));
    let nonlinear_amplitude =
        |point: u64| Some(linear_amplitude(point)? * ratio_of_point(point).unwrap_or(0.0));
    let gap_m = |point: u64| Some(0.01 - 0.1 * linear_amplitude(point)?);
    let status_keys = points.iter().map(|&point| Some(i32::from(point_fails(point))));
    let channel_keys = points
        .iter()
        .map(|&point| ratio_of_point(point).map(|_| i32::from(random_unit(point) < 0.5)));
    let method_keys = points.iter().map(|&point| Some((point % 4) as i32));
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
        ("nonlinear_tub_yaw", number_array(&nonlinear_amplitude)),
        ("nonlinear_tub_pitch", number_array(&nonlinear_amplitude)),
        ("linear_tub_yaw", number_array(&linear_amplitude)),
        ("linear_tub_pitch", number_array(&linear_amplitude)),
        ("ratio_tub_yaw", number_array(&ratio_of_point)),
        ("ratio_tub_pitch", number_array(&|point| Some(0.8 * ratio_of_point(point)?))),
        ("ratio_max", number_array(&ratio_of_point)),
        ("ratio_max_channel", dictionary_array(&["tub_yaw", "tub_pitch"], channel_keys)),
        ("reliable", flag_array(&|point| Some(ratio_of_point(point)? < 2.0))),
        (
            "sensitive",
            flag_array(&|point| {
                (!point_fails(point)).then_some(random_unit(11 * point) < 0.3 * noise_factor)
            }),
        ),
        ("method", dictionary_array(&["capped_1", "capped_2", "dop853", "rk4"], method_keys)),
        ("error", number_array(&|point| Some(1e-3 * random_unit(13 * point)))),
        ("min_gap_nonlinear_m", number_array(&gap_m)),
        ("min_gap_linear_m", number_array(&gap_m)),
        ("status", dictionary_array(&["ok", "diverged"], status_keys)),
        ("fail_time_s", number_array(&|point| point_fails(point).then_some(41.5))),
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
    for first_point in (0..values_per_axis * values_per_axis).step_by(ROWS_AT_ONCE as usize) {
        let batch = map_rows(
            first_point,
            (first_point + ROWS_AT_ONCE).min(values_per_axis * values_per_axis),
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
fn plot_with_memory_limit(memory_limit_bytes: u64, folder: &Path, words: &[&str]) -> Output {
    let limit_script = format!("ulimit -v {}; exec \"$@\"", memory_limit_bytes / 1000);
    let mut command = Command::new("sh");
    command.args(["-c", &limit_script, "sh"]).arg(sweep_binary()).arg("plot");
    command.args(words).current_dir(folder).output().expect("sh runs")
}

fn assert_bounded_figures(values_per_axis: u64, noise_factor: f64) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write_map(&folder.path().join("map.parquet"), values_per_axis, noise_factor);
    for name in ["map.svg", "map.png", "map.html"] {
        let plot_output =
            plot_with_memory_limit(MAX_MEMORY_BYTES, folder.path(), &["map.parquet", "-o", name]);
        let messages = String::from_utf8_lossy(&plot_output.stderr);
        assert!(
            plot_output.status.success(),
            "{values_per_axis} by {values_per_axis}, {name}: {messages}"
        );
        let figure_bytes = fs::metadata(folder.path().join(name)).expect("a figure").len();
        assert!(
            figure_bytes < MAX_FIGURE_BYTES,
            "{values_per_axis} per axis, noise factor {noise_factor}: {figure_bytes} bytes of \
             {name}"
        );
        if let Some(screenshots_folder) = std::env::var_os("SHOTS") {
            let screenshot_path = Path::new(&screenshots_folder)
                .join(format!("{values_per_axis}_{noise_factor}_{name}"));
            fs::copy(folder.path().join(name), screenshot_path).expect("the figure is kept");
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
    let test_folder = folder_with_result();
    fs::rename(test_folder.path("x.parquet"), test_folder.path("map.parquet"))
        .expect("there is a result");
    assert!(test_folder.run_sweep(&["plot", "map.parquet", "-o", "whole.svg"]).status.success());
    let whole_file = fs::read(test_folder.path("map.parquet")).expect("a map");
    for bit in (0..8 * whole_file.len()).step_by(8 * whole_file.len() / 150 + 1) {
        let mut bytes = whole_file.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        fs::write(test_folder.path("map.parquet"), bytes).expect("the map is written");
        let plot_output = test_folder.run_sweep(&["plot", "map.parquet", "-o", "a.svg"]);
        let messages = String::from_utf8_lossy(&plot_output.stderr);
        assert_eq!(plot_output.status.code(), Some(2), "bit {bit}: {messages}");
        assert!(messages.contains("map.parquet is"), "bit {bit}: {messages}");
        assert!(!messages.contains("panicked"), "bit {bit}: {messages}");
        assert!(!test_folder.path("a.svg").exists(), "bit {bit}");
    }
}

//! Tests of the example `duffing` against results from textbooks.

#![allow(clippy::unwrap_used, reason = "a test fails where it must")]

use std::path::{Path, PathBuf};
use std::process::Command;

use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int32Type};

/// Returns the example, which cargo builds beside this test.
fn program_path() -> PathBuf {
    let test_path = std::env::current_exe().unwrap();
    let target_folder = test_path.parent().and_then(Path::parent).unwrap();
    target_folder.join("examples").join(format!("duffing{}", std::env::consts::EXE_SUFFIX))
}

/// Runs a grid and returns its rows.
fn run_grid(grid: &str) -> RecordBatch {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("grid.toml"), grid).unwrap();
    let mut command = Command::new(program_path());
    let arguments = ["run", "grid.toml", "--out", "x.parquet", "--progress", "none"];
    let output = command.current_dir(folder.path()).args(arguments).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let file = sweep_files::ParquetFile::open(&folder.path().join("x.parquet")).unwrap();
    file.batches((0..file.schema().fields().len()).collect()).unwrap().next().unwrap().unwrap()
}

fn read_numbers(rows: &RecordBatch, name: &str) -> Vec<f64> {
    rows.column_by_name(name).unwrap().as_primitive::<Float64Type>().values().to_vec()
}

/// Returns whether each row is `ok`.
fn ok_flags(rows: &RecordBatch) -> Vec<bool> {
    let statuses = rows.column_by_name("status").unwrap().as_dictionary::<Int32Type>();
    let statuses = statuses.downcast_dict::<arrow_array::StringArray>().unwrap();
    statuses.into_iter().map(|status| status == Some("ok")).collect()
}

/// Returns the residual of the frequency-response equation for an amplitude: Nayfeh and Mook,
/// Nonlinear Oscillations (1979), equation (4.1.19), without the assumption that the frequency is
/// near 1 (harmonic balance with one harmonic).
fn frequency_response(amplitude: f64, frequency: f64) -> f64 {
    let [damping, cubic, forcing] = [0.05, 0.1, 0.18];
    let amplitude_squared = amplitude * amplitude;
    let stiffness = 1.0 - frequency * frequency + 0.75 * cubic * amplitude_squared;
    amplitude_squared * (stiffness * stiffness + (damping * frequency).powi(2)) - forcing * forcing
}

#[test]
fn steady_amplitudes_satisfy_the_frequency_response_equation() {
    let frequencies = [0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.3, 1.4, 1.5, 1.6, 1.7, 1.8];
    let rows = run_grid(&format!(
        "name = \"duffing\"\ntime = {{ end_s = 500, window_s = [450, 500] }}\n\
         integrator = {{ method = \"rk4-halved\", accuracy = 1e-7 }}\n\
         [[axis]]\nparameter = \"frequency\"\nvalues = {frequencies:?}\n"
    ));
    let amplitudes = read_numbers(&rows, "nonlinear_x");
    assert_eq!(amplitudes.len(), frequencies.len());
    for (frequency, amplitude) in frequencies.into_iter().zip(amplitudes) {
        // Each of these frequencies has one response, so that the equation has one root. Higher
        // harmonics, which the equation leaves out, add at most 0.6 %.
        let [below, above] =
            [0.99, 1.01].map(|factor| frequency_response(factor * amplitude, frequency));
        assert!(below < 0.0 && above > 0.0, "frequency {frequency}: amplitude {amplitude}");
    }
}

#[test]
fn a_softening_spring_breaks_most_easily_at_the_frequency_given_by_davis() {
    // Davis, Introduction to Nonlinear Differential and Integral Equations (1962): from rest, the
    // least forcing that breaks the spring x - x^3 / 6 without damping has its minimum over the
    // frequency at 0.8852.
    let rows = run_grid(
        "name = \"davis\"\nset = { damping = 0, cubic = -0.16666666666666666 }\n\
         time = { end_s = 100 }\nintegrator = { method = \"rk4\", step_s = 0.02 }\n\
         [[axis]]\nparameter = \"frequency\"\nrange = { from = 0.86, to = 0.91, count = 21 }\n\
         [[axis]]\nparameter = \"forcing\"\nrange = { from = 0.07, to = 0.13, count = 61 }\n",
    );
    let frequencies = read_numbers(&rows, "frequency");
    let forcings = read_numbers(&rows, "forcing");
    let broken_flags = ok_flags(&rows).into_iter().map(|is_ok| !is_ok);
    let broken_rows = (0..rows.num_rows())
        .zip(broken_flags)
        .filter_map(|(row, is_broken)| is_broken.then_some(row));
    let weakest_row = broken_rows.min_by(|a, b| forcings[*a].total_cmp(&forcings[*b])).unwrap();
    let frequency = frequencies[weakest_row];
    assert!((frequency - 0.8852).abs() < 0.003, "{frequency} by {}", forcings[weakest_row]);
}

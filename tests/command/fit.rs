//! Tests of `sweep fit`, with a trace of the program as the measurement.

use std::fs;

use arrow_array::cast::AsArray as _;
use arrow_array::types::Float64Type;
use serde_json::Value;
use sweep_files::ParquetFile;

use crate::test_folder::{TestFolder, all_output};

const GRID: &str = "spin = { profile = \"triangular\", peak_rpm = 300, ramp_s = 3 }\n\
                    time = { end_s = 3 }\n\
                    [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [100, 140]\n";

/// Returns a folder with a CSV file of a measurement of a machine with 180 N s/m and 0.35 kg. It
/// has an acceleration with an offset of gravity, an angle that lacks every seventh sample, and an
/// angular rate, all with noise.
fn folder_with_measurement() -> TestFolder {
    let test_folder = TestFolder::new(GRID);
    let point_options = ["--at", "damping_n_s_per_m=180", "--at", "unbalance_mass_kg=0.35"];
    let trace_words =
        [&["trace", "g.toml", "--rates", "-o", "t.parquet"], &point_options[..]].concat();
    let trace_output = test_folder.run_sweep(&trace_words);
    assert!(trace_output.status.success(), "{}", all_output(&trace_output));
    let trace_file = ParquetFile::open(&test_folder.path("t.parquet")).expect("it is there");
    let all_columns = (0..trace_file.schema().fields().len()).collect();
    let batches = trace_file.batches(all_columns).expect("it is read");
    let mut csv_text = "time_s,tub_front_y_m_per_s2,tub_yaw_rad,tub_pitch_rad_per_s\n".to_owned();
    for batch in batches {
        let batch = batch.expect("it is read");
        let column_values = |name: &str| {
            batch.column_by_name(name).expect(name).as_primitive::<Float64Type>().clone()
        };
        let [times, accelerations, yaws, pitches] = [
            "time_s",
            "nonlinear_tub_front_y_m_per_s2",
            "nonlinear_tub_yaw",
            "nonlinear_tub_pitch_rad_per_s",
        ]
        .map(column_values);
        for row in 0..batch.num_rows() {
            // The noise is a sawtooth, which does not correlate with the signals.
            let noise = (row * 7919 % 1000) as f64 / 1000.0 - 0.5;
            let yaw_cell = if row % 7 == 0 {
                String::new()
            } else {
                format!("{}", yaws.value(row) + 1e-4 * noise)
            };
            let acceleration = 9.81 + accelerations.value(row) + 0.1 * noise;
            let pitch = pitches.value(row) + 1e-3 * noise;
            csv_text += &format!("{},{acceleration},{yaw_cell},{pitch}\n", times.value(row));
        }
    }
    fs::write(test_folder.path("run.csv"), csv_text).expect("it is written");
    test_folder
}

#[test]
fn a_fit_writes_a_machine_file_that_runs() {
    let test_folder = folder_with_measurement();
    let fit_words = ["fit", "g.toml", "run.csv", "--free", "damping_n_s_per_m,unbalance_mass_kg"];
    let output_options =
        ["--json", "--draws", "4", "--out", "bench.toml", "--curves", "fit.parquet"];
    let further_options =
        [&output_options[..], &["--set", "unbalance_mass_kg=0.3", "--name", "monday"]].concat();
    let command_output = test_folder.run_sweep(&[&fit_words[..], &further_options].concat());
    assert!(command_output.status.success(), "{}", all_output(&command_output));
    let estimate: Value = serde_json::from_slice(&command_output.stdout).expect("it is JSON");
    for (parameter, (name, true_value)) in estimate["parameters"]
        .as_array()
        .expect("a list")
        .iter()
        .zip([("damping_n_s_per_m", 180.0), ("unbalance_mass_kg", 0.35)])
    {
        assert_eq!(parameter["name"], name);
        let json_number = |value: &Value| value.as_f64().expect("a number");
        let [from_value, to_value] = [0, 1].map(|end| json_number(&parameter["interval_95"][end]));
        assert!(from_value < true_value && true_value < to_value, "{parameter}");
        assert!((json_number(&parameter["value"]) / true_value - 1.0).abs() < 0.01, "{parameter}");
    }
    let offset_m_per_s2 = estimate["offset"]["tub_front_y_m_per_s2"].as_f64().expect("a number");
    assert!((offset_m_per_s2 - 9.81).abs() < 0.05, "{estimate}");
    for key in ["correlations", "noise", "shift_s", "residual_rms", "explained", "verdict"] {
        assert!(!estimate[key].is_null(), "{key}: {estimate}");
    }
    // The machine file has the fitted numbers to the last bit.
    let fitted_grid = format!("machine = \"bench.toml\"\n{GRID}");
    fs::write(test_folder.path("own.toml"), fitted_grid).expect("it is written");
    let parameters_output = test_folder.run_sweep(&["parameters", "own.toml", "--json"]);
    let parameters_json: Value =
        serde_json::from_slice(&parameters_output.stdout).expect("it is JSON");
    let parameters = parameters_json.as_array().expect("a list").iter();
    let mut mass_parameters =
        parameters.filter(|parameter| parameter["name"] == "unbalance_mass_kg");
    let machine_file_value = mass_parameters.next().map(|parameter| &parameter["value"]);
    assert_eq!(machine_file_value, Some(&estimate["parameters"][1]["value"]));
    assert!(!test_folder.path("bench.toml.partial").exists());
    for (view, figure_name) in
        [("time", "t.svg"), ("passages", "p.html"), ("profiles", "c.svg"), ("spectrum", "s.svg")]
    {
        let plot_output =
            test_folder.run_sweep(&["plot", "fit.parquet", "--view", view, "-o", figure_name]);
        assert!(plot_output.status.success(), "{view}: {}", all_output(&plot_output));
    }
    // The figure shows the fitted numbers, not the initial ones.
    let figure = fs::read_to_string(test_folder.path("t.svg")).expect("it is text");
    assert!(figure.contains("damping 1") && !figure.contains("damping 120 N s/m"));
    assert!(figure.contains("monday"));
    assert!(!figure.contains("unbalance_mass_kg = 0.3"));
    // A fit overwrites a fit, and no other file.
    let repeated_output = test_folder.run_sweep(&[&fit_words[..], &further_options].concat());
    assert!(repeated_output.status.success(), "{}", all_output(&repeated_output));
    let overwrite_output =
        test_folder.run_sweep(&[&fit_words[..], &["--out", "own.toml"]].concat());
    assert_eq!(overwrite_output.status.code(), Some(2), "{}", all_output(&overwrite_output));
    assert!(
        all_output(&overwrite_output).contains("own.toml cannot be an output"),
        "{}",
        all_output(&overwrite_output)
    );
}

#[test]
fn a_number_that_differs_from_damper_to_damper_needs_a_range() {
    let test_folder = folder_with_measurement();
    let friction_options = ["--set", "damper_1_friction_n=20", "--set", "damper_2_friction_n=30"];
    let fit_words = ["fit", "g.toml", "run.csv", "--free", "friction_n"];
    let refused_output = test_folder.run_sweep(&[&fit_words[..], &friction_options].concat());
    assert_eq!(refused_output.status.code(), Some(2), "{}", all_output(&refused_output));
    assert!(
        all_output(&refused_output).contains("`friction_n` differs from part to part"),
        "{}",
        all_output(&refused_output)
    );
}

#[test]
fn a_fit_uses_the_given_point() {
    let fit_words = ["fit", "g.toml", "run.csv", "--free", "damping_n_s_per_m", "--draws", "0"];
    let command_output = folder_with_measurement()
        .run_sweep(&[&fit_words[..], &["--json", "--at", "unbalance_mass_kg=0.35"]].concat());
    assert!(command_output.status.success(), "{}", all_output(&command_output));
    let estimate: Value = serde_json::from_slice(&command_output.stdout).expect("it is JSON");
    let fitted_damping = estimate["parameters"][0]["value"].as_f64().expect("a number");
    assert!((fitted_damping / 180.0 - 1.0).abs() < 0.01, "{estimate}");
}

#[test]
fn mistakes_in_a_measurement_are_reported_with_their_place() {
    let test_folder = TestFolder::new(GRID);
    fs::write(test_folder.path("run.csv"), "time_s,tub_front_x_m\n0,1\n1,2\n0.5,3\n")
        .expect("written");
    let command_output =
        test_folder.run_sweep(&["fit", "g.toml", "run.csv", "--free", "damping_n_s_per_m"]);
    assert_eq!(command_output.status.code(), Some(2));
    for expected_part in
        ["run.csv:1:8", "does not name a channel", "run.csv:4:1", "time goes back: 0.5 s after 1 s"]
    {
        assert!(
            all_output(&command_output).contains(expected_part),
            "{expected_part}: {}",
            all_output(&command_output)
        );
    }
    let missing_file_output =
        test_folder.run_sweep(&["fit", "g.toml", "gone.csv", "--free", "damping_n_s_per_m"]);
    assert_eq!(missing_file_output.status.code(), Some(2), "{}", all_output(&missing_file_output));
    assert!(
        all_output(&missing_file_output).contains("cannot read gone.csv"),
        "{}",
        all_output(&missing_file_output)
    );
}

#[test]
fn times_since_1970_are_relative_to_the_first_row() {
    let test_folder = folder_with_measurement();
    let csv_text = fs::read_to_string(test_folder.path("run.csv")).expect("it is text");
    let mut lines = csv_text.lines();
    let mut shifted_csv = format!("{}\n", lines.next().expect("a line of names"));
    for line in lines {
        let (time_text, remaining_cells) = line.split_once(',').expect("a time");
        let time_s: f64 = time_text.parse().expect("a number");
        shifted_csv += &format!("{:.3},{remaining_cells}\n", 1_700_000_000.0 + time_s);
    }
    fs::write(test_folder.path("epoch.csv"), &shifted_csv).expect("it is written");
    let fit_options = ["--draws", "0", "--json", "--at", "unbalance_mass_kg=0.35"];
    let fit_words = ["fit", "g.toml", "epoch.csv", "--free", "damping_n_s_per_m"];
    let command_output = test_folder.run_sweep(&[&fit_words[..], &fit_options].concat());
    assert!(command_output.status.success(), "{}", all_output(&command_output));
    let estimate: Value = serde_json::from_slice(&command_output.stdout).expect("it is JSON");
    let fitted_damping = estimate["parameters"][0]["value"].as_f64().expect("a number");
    assert!((fitted_damping / 180.0 - 1.0).abs() < 0.01, "{estimate}");
    let note = estimate["notes"][0].as_str().expect("a note");
    assert!(note.contains("its clock reads 1700000000 s at the first row"), "{note}");

    fs::write(test_folder.path("stray.csv"), csv_text + "100000,9.81,0,0\n")
        .expect("it is written");
    let fit_words = ["fit", "g.toml", "stray.csv", "--free", "damping_n_s_per_m"];
    let command_output = test_folder.run_sweep(&fit_words);
    assert_eq!(command_output.status.code(), Some(2), "{}", all_output(&command_output));
    assert!(
        all_output(&command_output).contains("time jumps by 99997 s, from 3 to 100000 s"),
        "{}",
        all_output(&command_output)
    );
}

#[cfg(target_os = "linux")]
#[test]
fn a_fifo_is_an_error() {
    let test_folder = TestFolder::new(GRID);
    let fifo_status = std::process::Command::new("mkfifo").arg(test_folder.path("fifo")).status();
    assert!(fifo_status.expect("mkfifo starts").success());
    fs::write(test_folder.path("machine.toml"), "machine = \"fifo\"\n").expect("it is written");
    for words in [&["fit", "g.toml", "fifo"][..], &["check", "fifo"], &["check", "machine.toml"]] {
        let command_output = test_folder
            .command_under(&["timeout", "20"])
            .args(words)
            .output()
            .expect("timeout starts");
        assert_eq!(
            command_output.status.code(),
            Some(2),
            "{words:?}: {}",
            all_output(&command_output)
        );
        assert!(
            all_output(&command_output).contains("it is a FIFO"),
            "{words:?}: {}",
            all_output(&command_output)
        );
    }
}

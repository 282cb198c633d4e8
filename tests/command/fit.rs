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

/// Returns a folder with a measurement of a machine with 180 N s/m and 0.35 kg as CSV: an
/// acceleration with gravity, with both signs of a sensor, and an angle without every seventh
/// sample.
fn folder_with_measurement() -> TestFolder {
    let test_folder = TestFolder::new(GRID);
    let at = ["--at", "damping_n_s_per_m=180", "--at", "unbalance_mass_kg=0.35"];
    let words = [&["trace", "g.toml", "--rates", "-o", "t.parquet"], &at[..]].concat();
    let trace_output = test_folder.sweep(&words);
    assert!(trace_output.status.success(), "{}", all_output(&trace_output));
    let file = ParquetFile::open(&test_folder.path("t.parquet")).expect("it is there");
    let all = (0..file.schema().fields().len()).collect();
    let batches = file.batches(all).expect("it is read");
    let mut text = "time_s,tub_front_y_m_per_s2,tub_yaw_rad,tub_pitch_rad_per_s\n".to_owned();
    for batch in batches {
        let batch = batch.expect("it is read");
        let column = |name: &str| {
            batch.column_by_name(name).expect(name).as_primitive::<Float64Type>().clone()
        };
        let [time, y, yaw, pitch] = [
            "time_s",
            "nonlinear_tub_front_y_m_per_s2",
            "nonlinear_tub_yaw",
            "nonlinear_tub_pitch_rad_per_s",
        ]
        .map(column);
        for row in 0..batch.num_rows() {
            // The noise is a sawtooth, which does not correlate with the signals.
            let noise = (row * 7919 % 1000) as f64 / 1000.0 - 0.5;
            let yaw = if row % 7 == 0 {
                String::new()
            } else {
                format!("{}", yaw.value(row) + 1e-4 * noise)
            };
            let y = 9.81 + y.value(row) + 0.1 * noise;
            let pitch = pitch.value(row) + 1e-3 * noise;
            text += &format!("{},{y},{yaw},{pitch}\n", time.value(row));
        }
    }
    fs::write(test_folder.path("run.csv"), text).expect("it is written");
    test_folder
}

#[test]
fn a_fit_writes_a_machine_file_that_runs() {
    let test_folder = folder_with_measurement();
    let words = ["fit", "g.toml", "run.csv", "--free", "damping_n_s_per_m,unbalance_mass_kg"];
    let more = ["--json", "--draws", "4", "--out", "bench.toml", "--curves", "fit.parquet"];
    let more = [&more[..], &["--set", "unbalance_mass_kg=0.3", "--name", "monday"]].concat();
    let command_output = test_folder.sweep(&[&words[..], &more].concat());
    assert!(command_output.status.success(), "{}", all_output(&command_output));
    let estimate: Value = serde_json::from_slice(&command_output.stdout).expect("it is JSON");
    for (parameter, (name, truth)) in estimate["parameters"]
        .as_array()
        .expect("a list")
        .iter()
        .zip([("damping_n_s_per_m", 180.0), ("unbalance_mass_kg", 0.35)])
    {
        assert_eq!(parameter["name"], name);
        let number = |value: &Value| value.as_f64().expect("a number");
        let [from, to] = [0, 1].map(|end| number(&parameter["interval_95"][end]));
        assert!(from < truth && truth < to, "{parameter}");
        assert!((number(&parameter["value"]) / truth - 1.0).abs() < 0.01, "{parameter}");
    }
    let offset = estimate["offset"]["tub_front_y_m_per_s2"].as_f64().expect("a number");
    assert!((offset - 9.81).abs() < 0.05, "{estimate}");
    for key in ["correlations", "noise", "shift_s", "residual_rms", "explained", "verdict"] {
        assert!(!estimate[key].is_null(), "{key}: {estimate}");
    }
    // The machine file has the fitted numbers to the last bit.
    let grid = format!("machine = \"bench.toml\"\n{GRID}");
    fs::write(test_folder.path("own.toml"), grid).expect("it is written");
    let parameter_output = test_folder.sweep(&["parameters", "own.toml", "--json"]);
    let parameter_output: Value =
        serde_json::from_slice(&parameter_output.stdout).expect("it is JSON");
    let mass = parameter_output.as_array().expect("a list").iter();
    let mut mass = mass.filter(|parameter| parameter["name"] == "unbalance_mass_kg");
    let value = mass.next().map(|parameter| &parameter["value"]);
    assert_eq!(value, Some(&estimate["parameters"][1]["value"]));
    assert!(!test_folder.path("bench.toml.partial").exists());
    for (view, picture) in
        [("time", "t.svg"), ("passages", "p.html"), ("profiles", "c.svg"), ("spectrum", "s.svg")]
    {
        let plot_output =
            test_folder.sweep(&["plot", "fit.parquet", "--view", view, "-o", picture]);
        assert!(plot_output.status.success(), "{view}: {}", all_output(&plot_output));
    }
    // The figure shows the fitted numbers, not the initial ones.
    let picture = fs::read_to_string(test_folder.path("t.svg")).expect("it is text");
    assert!(picture.contains("damping 1") && !picture.contains("damping 120 N s/m"));
    assert!(picture.contains("monday"));
    assert!(!picture.contains("unbalance_mass_kg = 0.3"));
    // A fit overwrites a fit, and no other file.
    let repeated_output = test_folder.sweep(&[&words[..], &more].concat());
    assert!(repeated_output.status.success(), "{}", all_output(&repeated_output));
    let overwrite_output = test_folder.sweep(&[&words[..], &["--out", "own.toml"]].concat());
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
    let apart = ["--set", "damper_1_friction_n=20", "--set", "damper_2_friction_n=30"];
    let words = ["fit", "g.toml", "run.csv", "--free", "friction_n"];
    let refused_output = test_folder.sweep(&[&words[..], &apart].concat());
    assert_eq!(refused_output.status.code(), Some(2), "{}", all_output(&refused_output));
    assert!(
        all_output(&refused_output).contains("`friction_n` differs from part to part"),
        "{}",
        all_output(&refused_output)
    );
}

#[test]
fn a_fit_uses_the_given_point() {
    let words = ["fit", "g.toml", "run.csv", "--free", "damping_n_s_per_m", "--draws", "0"];
    let command_output = folder_with_measurement()
        .sweep(&[&words[..], &["--json", "--at", "unbalance_mass_kg=0.35"]].concat());
    assert!(command_output.status.success(), "{}", all_output(&command_output));
    let estimate: Value = serde_json::from_slice(&command_output.stdout).expect("it is JSON");
    let value = estimate["parameters"][0]["value"].as_f64().expect("a number");
    assert!((value / 180.0 - 1.0).abs() < 0.01, "{estimate}");
}

#[test]
fn mistakes_in_a_measurement_are_reported_with_their_place() {
    let test_folder = TestFolder::new(GRID);
    fs::write(test_folder.path("run.csv"), "time_s,tub_front_x_m\n0,1\n1,2\n0.5,3\n")
        .expect("written");
    let command_output =
        test_folder.sweep(&["fit", "g.toml", "run.csv", "--free", "damping_n_s_per_m"]);
    assert_eq!(command_output.status.code(), Some(2));
    for said_of in
        ["run.csv:1:8", "does not name a channel", "run.csv:4:1", "time goes back: 0.5 s after 1 s"]
    {
        assert!(
            all_output(&command_output).contains(said_of),
            "{said_of}: {}",
            all_output(&command_output)
        );
    }
    let gone = test_folder.sweep(&["fit", "g.toml", "gone.csv", "--free", "damping_n_s_per_m"]);
    assert_eq!(gone.status.code(), Some(2), "{}", all_output(&gone));
    assert!(all_output(&gone).contains("cannot read gone.csv"), "{}", all_output(&gone));
}

#[test]
fn times_since_1970_are_relative_to_the_first_row() {
    let test_folder = folder_with_measurement();
    let text = fs::read_to_string(test_folder.path("run.csv")).expect("it is text");
    let mut lines = text.lines();
    let mut shifted = format!("{}\n", lines.next().expect("a line of names"));
    for line in lines {
        let (time, rest) = line.split_once(',').expect("a time");
        let time: f64 = time.parse().expect("a number");
        shifted += &format!("{:.3},{rest}\n", 1_700_000_000.0 + time);
    }
    fs::write(test_folder.path("epoch.csv"), &shifted).expect("it is written");
    let at = ["--draws", "0", "--json", "--at", "unbalance_mass_kg=0.35"];
    let words = ["fit", "g.toml", "epoch.csv", "--free", "damping_n_s_per_m"];
    let command_output = test_folder.sweep(&[&words[..], &at].concat());
    assert!(command_output.status.success(), "{}", all_output(&command_output));
    let estimate: Value = serde_json::from_slice(&command_output.stdout).expect("it is JSON");
    let value = estimate["parameters"][0]["value"].as_f64().expect("a number");
    assert!((value / 180.0 - 1.0).abs() < 0.01, "{estimate}");
    let note = estimate["notes"][0].as_str().expect("a note");
    assert!(note.contains("its clock reads 1700000000 s at the first row"), "{note}");

    fs::write(test_folder.path("stray.csv"), text + "100000,9.81,0,0\n").expect("it is written");
    let words = ["fit", "g.toml", "stray.csv", "--free", "damping_n_s_per_m"];
    let command_output = test_folder.sweep(&words);
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
        let command_output =
            test_folder.under(&["timeout", "20"]).args(words).output().expect("timeout starts");
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

//! Tests of `sweep boundary`: its files, errors and interruptions.

#![cfg(unix)]

use std::fs;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::send_signal;
use crate::test_folder::{all_output, sweep_binary};

/// A grid whose trajectories last a tenth of a second, which suffices for these tests.
const GRID_TEMPLATE: &str = r#"
[spin]
profile = "triangular"
peak_rpm = 350.0
ramp_s = 50.0
[time]
end_s = END
[integrator]
method = "rk4"
step_s = 2.0e-4
[[axis]]
parameter = "unbalance_mass_kg"
values = [0.2, 0.4]
[[axis]]
parameter = "damping_n_s_per_m"
values = [60.0, 300.0]
[[axis]]
parameter = "spin_peak_rpm"
values = [300.0, 350.0, 400.0]
"#;

fn folder_with_grid(end_s: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("grid.toml"), GRID_TEMPLATE.replace("END", end_s))
        .expect("the grid is written");
    folder
}

fn boundary_command(folder: &tempfile::TempDir, arguments: &[&str]) -> Command {
    let mut command = Command::new(sweep_binary());
    command.current_dir(folder.path()).args(["boundary", "grid.toml"]).args(arguments);
    command
}

#[test]
fn every_combination_of_further_axes_has_a_curve() {
    let folder = folder_with_grid("0.1");
    let command_output = boundary_command(&folder, &["--quantity", "min_gap_nonlinear_m"])
        .output()
        .expect("it starts");
    let messages = all_output(&command_output);
    assert_eq!(command_output.status.code(), Some(0), "{messages}");
    // No gap closes in a tenth of a second, so that all six lines are within the limit.
    assert!(
        messages.contains("6 lines within the limit throughout") && !messages.contains("brackets"),
        "{messages}"
    );
    let boundary_file = "results/grid-boundary.parquet";
    assert!(folder.path().join(boundary_file).is_file());
    let plot_output = Command::new(sweep_binary())
        .current_dir(folder.path())
        .args(["plot", boundary_file, "-o", "curve.svg"])
        .output()
        .expect("it starts");
    assert_eq!(
        plot_output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&plot_output.stderr)
    );
    let run_sweep = |arguments: &[&str]| {
        let command_output =
            Command::new(sweep_binary()).current_dir(folder.path()).args(arguments).output();
        let command_output = command_output.expect("it starts");
        (
            command_output.status.code(),
            [command_output.stdout, command_output.stderr]
                .map(|text| String::from_utf8_lossy(&text).into_owned()),
        )
    };
    let (exit_code, [shown_table, messages]) = run_sweep(&["show", boundary_file]);
    assert_eq!(exit_code, Some(0), "{messages}");
    assert!(shown_table.contains("6 none_in_range_reliable"), "{shown_table}");
    // The file has the grid's plan, but is not that grid's map.
    let (exit_code, [_, messages]) = run_sweep(&["run", "grid.toml", "--out", boundary_file]);
    assert_eq!(exit_code, Some(2), "{messages}");
    assert!(messages.contains("is no result of `sweep run`"), "{messages}");
}

#[test]
fn brackets_of_a_logarithmic_axis_are_relative() {
    let folder = folder_with_grid("0.1");
    let grid =
        GRID_TEMPLATE.replace("END", "0.1").split_once("[[axis]]").expect("axes").0.to_owned();
    let axes = "[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.2, 0.4]\n[[axis]]\n\
         parameter = \"spring_stiffness_n_per_m\"\n\
         range = { from = 4e3, to = 4e4, count = 3, spacing = \"log\" }\n";
    let grid_text = format!("metrics = [\"static_sag\"]\n{grid}{axes}");
    fs::write(folder.path().join("grid.toml"), grid_text).expect("the grid is written");
    let boundary_options = ["--quantity", "static_sag_m", "--limit", "0.01", "--tolerance", "0.01"];
    let command_output = boundary_command(&folder, &boundary_options).output().expect("it starts");
    let messages = String::from_utf8_lossy(&command_output.stderr);
    let widest_bracket =
        messages.split("brackets  at most ").nth(1).expect("brackets").split(' ').next();
    let widest_bracket: f64 = widest_bracket.expect("a number").parse().expect("a number");
    assert!(
        widest_bracket <= 0.01 && messages.contains("of its value wide (tolerance: 0.01)"),
        "{messages}"
    );
}

#[test]
fn quantities_without_a_boundary_are_errors_before_the_search() {
    let folder = folder_with_grid("0.1");
    fs::write(folder.path().join("notes.parquet"), "mine").expect("the notes are written");
    for (arguments, expected) in [
        (["--tolerance", "1e9"], "--tolerance 1000000000 is out of range"),
        (["--quantity", "ratio_tub"], "expected one of ratio_max"),
        (["--quantity", "ratio_tub_yw < 2"], "did you mean `ratio_tub_yaw`?"),
        (["--quantity", "unknown < 2"], "`--quantity` without a name lists the columns"),
        (["--lattice", "0"], "--lattice"),
        (["--out", "notes.parquet"], "is no result of `sweep boundary`"),
    ] {
        let refused_output = boundary_command(&folder, &arguments).output().expect("it starts");
        let messages = String::from_utf8_lossy(&refused_output.stderr).into_owned();
        assert_eq!(refused_output.status.code(), Some(2), "{messages}");
        assert!(messages.contains(expected), "{messages}");
    }
    assert_eq!(fs::read(folder.path().join("notes.parquet")).expect("still there"), b"mine");
    assert!(!folder.path().join("results").exists());
}

/// Returns the number of bytes that a search for `x.parquet` has stored.
fn stored_bytes(folder: &tempfile::TempDir) -> u64 {
    let Ok(entries) = fs::read_dir(folder.path().join("x.parquet.partial")) else { return 0 };
    let part_files = entries
        .flatten()
        .filter(|entry| entry.path().extension().is_some_and(|extension| extension == "parquet"));
    // The search may rename a part file or finish between the listing and this line.
    part_files.map(|part| part.metadata().map_or(0, |metadata| metadata.len())).sum()
}

/// Starts a search and waits until it has stored more bytes than were stored before.
fn start_search_until_stored(folder: &tempfile::TempDir, search: &mut Command) -> Child {
    let bytes_before = stored_bytes(folder);
    let start_instant = Instant::now();
    let child = search.stderr(Stdio::piped()).spawn().expect("it starts");
    while stored_bytes(folder) <= bytes_before {
        assert!(start_instant.elapsed() < Duration::from_secs(60), "no points are kept");
        std::thread::sleep(Duration::from_millis(5));
    }
    child
}

fn file_names(folder: &tempfile::TempDir) -> Vec<String> {
    let entries = fs::read_dir(folder.path()).expect("the folder is there");
    let mut sorted_names: Vec<_> = entries
        .map(|entry| entry.expect("a name").file_name().into_string().expect("UTF-8"))
        .collect();
    sorted_names.sort();
    sorted_names
}

#[test]
fn an_interrupted_search_continues_to_the_same_bytes() {
    // The search takes so long that the signals come before its end on any machine: points are kept
    // once a second.
    let folder = folder_with_grid("100");
    let search_options = ["--threads", "1", "--lattice", "11", "--progress", "none", "--out"];
    let search_command =
        |out: &str| boundary_command(&folder, &[&search_options, &[out][..]].concat());
    let undisturbed_output = search_command("whole.parquet").output().expect("it starts");
    assert_eq!(undisturbed_output.status.code(), Some(0), "{}", all_output(&undisturbed_output));
    for (name, exit_code) in [("INT", 130), ("TERM", 143)] {
        let child = start_search_until_stored(&folder, &mut search_command("x.parquet"));
        send_signal(name, child.id());
        let command_output = child.wait_with_output().expect("it ends");
        assert_eq!(
            command_output.status.code(),
            Some(exit_code),
            "{}",
            all_output(&command_output)
        );
        assert!(
            all_output(&command_output).contains("points kept"),
            "{}",
            all_output(&command_output)
        );
        let expected_advice =
            "go on  sweep boundary grid.toml --threads 1 --lattice 11 --progress none --out";
        assert!(
            all_output(&command_output).contains(expected_advice),
            "{}",
            all_output(&command_output)
        );
        assert_eq!(file_names(&folder), ["grid.toml", "whole.parquet", "x.parquet.partial"]);
    }
    // SIGKILL leaves the search no time for a message.
    let mut child = start_search_until_stored(&folder, &mut search_command("x.parquet"));
    child.kill().expect("it is killed");
    child.wait().expect("it ends");
    let other_plan_output = boundary_command(&folder, &["--lattice", "2", "--out", "x.parquet"])
        .output()
        .expect("it starts");
    assert_eq!(other_plan_output.status.code(), Some(2), "{}", all_output(&other_plan_output));
    assert!(
        all_output(&other_plan_output).contains("/boundary/lattice: was 11, is 2"),
        "{}",
        all_output(&other_plan_output)
    );
    let resumed_output = search_command("x.parquet").output().expect("it starts");
    assert_eq!(resumed_output.status.code(), Some(0), "{}", all_output(&resumed_output));
    assert!(all_output(&resumed_output).contains("going on: "), "{}", all_output(&resumed_output));
    let result_bytes = |name: &str| fs::read(folder.path().join(name)).expect("there is a file");
    assert!(result_bytes("x.parquet") == result_bytes("whole.parquet"), "other bytes");
    assert_eq!(file_names(&folder), ["grid.toml", "whole.parquet", "x.parquet"]);
}

#[test]
fn a_boundary_of_another_plan_is_overwritten_only_on_request() {
    let folder = folder_with_grid("0.1");
    let write_boundary = |options: &[&str]| {
        let boundary_arguments = [&["--lattice", "1", "--out", "x.parquet"][..], options].concat();
        let command_output =
            boundary_command(&folder, &boundary_arguments).output().expect("it starts");
        (command_output.status.code(), String::from_utf8_lossy(&command_output.stderr).into_owned())
    };
    let result_bytes = || fs::read(folder.path().join("x.parquet")).expect("there is a file");
    let (exit_code, messages) = write_boundary(&[]);
    assert_eq!(exit_code, Some(0), "{messages}");
    let first_bytes = result_bytes();
    let (exit_code, messages) = write_boundary(&[]);
    assert_eq!(exit_code, Some(0), "{messages}");
    assert!(messages.contains("is there already"), "{messages}");
    for (options, expected) in [
        (["--tolerance", "3"], "/boundary/tolerance: was 0.5, is 3"),
        (["--quantity", "min_gap_linear_m"], "/boundary/quantity: was"),
        (["--set", "tub_mass_kg=31"], "/machine/tub/mass_kg: was"),
    ] {
        let (exit_code, messages) = write_boundary(&options);
        assert_eq!(exit_code, Some(2), "{messages}");
        assert!(messages.contains("already holds the result of another plan"), "{messages}");
        assert!(messages.contains(expected) && messages.contains("--fresh"), "{messages}");
        assert!(result_bytes() == first_bytes, "{options:?}");
    }
    let (exit_code, messages) = write_boundary(&["--quantity", "min_gap_linear_m", "--fresh"]);
    assert_eq!(exit_code, Some(0), "{messages}");
    assert!(result_bytes() != first_bytes);
    assert_eq!(file_names(&folder), ["grid.toml", "x.parquet"]);
}

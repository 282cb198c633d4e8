//! Tests of `sweep stability`: its files, interruptions and errors.

#![cfg(unix)]

use std::fs;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::send_signal;
use crate::test_folder::{all_output, sweep_binary};

const GRID: &str = r#"
machine = "paper"
[spin]
profile = "triangular"
peak_rpm = 350.0
ramp_s = 50.0
[time]
end_s = 50.0
window_s = [30.0, 50.0]
[integrator]
method = "rk4-mass-scaled"
accuracy = 1e-3
[[axis]]
parameter = "unbalance_mass_kg"
values = [0.4]
[[axis]]
parameter = "damping_n_s_per_m"
values = [140.0, 300.0]
"#;

fn folder_with_grid(further_keys: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("grid.toml"), format!("{GRID}{further_keys}"))
        .expect("it is written");
    folder
}

fn sweep_command(folder: &tempfile::TempDir, arguments: &[&str]) -> Command {
    let mut command = Command::new(sweep_binary());
    command.current_dir(folder.path()).args(arguments);
    command
}

fn run_stability(folder: &tempfile::TempDir, speed: &str, further_options: &[&str]) -> Output {
    let stability_words = ["stability", "grid.toml", "--speed", speed];
    sweep_command(folder, &[&stability_words, further_options].concat())
        .output()
        .expect("it starts")
}

#[test]
fn both_tongues_of_the_papers_machine_are_found_and_named() {
    let folder = folder_with_grid("");
    let command_output = run_stability(&folder, "230:325:1", &[]);
    assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
    let stability_file = "results/grid-stability.parquet";
    let shown_text =
        all_output(&sweep_command(&folder, &["show", stability_file]).output().expect("it starts"));
    for messages in [&all_output(&command_output), &shown_text] {
        for line in [
            "43 not, 0 without a response; 2 points",
            "damping_n_s_per_m 140: 239 to 259 rpm, quasi periodic, up to 0.39",
            "damping_n_s_per_m 140: 295 to 316 rpm, period doubling, up to 0.28",
            "rocking, vertical plane",
            "rocking, horizontal plane",
        ] {
            assert!(messages.contains(line), "{line}\n{messages}");
        }
    }
    let plot_output =
        sweep_command(&folder, &["plot", stability_file]).output().expect("it starts");
    assert_eq!(plot_output.status.code(), Some(0), "{}", all_output(&plot_output));
    // A map does not overwrite the result of `sweep stability`.
    let run_output = sweep_command(&folder, &["run", "grid.toml", "--out", stability_file])
        .output()
        .expect("it starts");
    assert_eq!(run_output.status.code(), Some(2), "{}", all_output(&run_output));
}

#[test]
fn bytes_do_not_depend_on_threads_or_instruction_set() {
    let folder = folder_with_grid("");
    let result_bytes = |name: &str, threads: &str, simd: Option<&str>| {
        let mut command =
            sweep_command(&folder, &["stability", "grid.toml", "--speed", "20:320:7"]);
        command.args(["--out", name, "--threads", threads]);
        if let Some(simd) = simd {
            command.env("SWEEP_SIMD", simd);
        }
        let command_output = command.output().expect("it starts");
        assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
        fs::read(folder.path().join(name)).expect("it is there")
    };
    let first_bytes = result_bytes("a.parquet", "1", None);
    assert!(first_bytes == result_bytes("b.parquet", "2", None));
    assert!(first_bytes == result_bytes("c.parquet", "2", Some("scalar")));
    assert!(first_bytes == result_bytes("a.parquet", "2", None));
}

#[test]
fn contradictory_options_are_errors_before_the_computation() {
    let folder = folder_with_grid("");
    for (speed, expected) in
        [("0:100:1", "above 0 rpm"), ("-5:100:1", "0 rpm or more"), ("fast", "FROM:TO:STEP")]
    {
        let refused_output = run_stability(&folder, speed, &[]);
        assert_eq!(refused_output.status.code(), Some(2), "{speed}");
        assert!(
            all_output(&refused_output).contains(expected),
            "{speed}: {}",
            all_output(&refused_output)
        );
    }
    for (parameter, value, expected) in [
        ("spin_peak_rpm", "300.0", "without the axis `spin_peak_rpm`"),
        ("window_from_s", "31.0", "without the axis `window_from_s`"),
    ] {
        let axis = format!("[[axis]]\nparameter = \"{parameter}\"\nvalues = [{value}]\n");
        let refused_output = run_stability(&folder_with_grid(&axis), "60:100:1", &[]);
        assert_eq!(
            refused_output.status.code(),
            Some(2),
            "{parameter}: {}",
            all_output(&refused_output)
        );
        assert!(
            all_output(&refused_output).contains(expected),
            "{parameter}: {}",
            all_output(&refused_output)
        );
    }
}

#[test]
fn an_interrupted_run_continues_to_the_same_bytes() {
    let folder = folder_with_grid("");
    let stability_words =
        ["stability", "grid.toml", "--speed", "60:360:0.05", "--progress", "none"];
    let mut command = sweep_command(&folder, &stability_words);
    let child = command.stderr(Stdio::piped()).spawn().expect("it starts");
    // The signal comes after the first chunk.
    let partial_folder = folder.path().join("results/grid-stability.parquet.partial");
    let is_part = |entry: std::io::Result<fs::DirEntry>| {
        entry.is_ok_and(|entry| entry.file_name().to_string_lossy().starts_with("part-"))
    };
    let start_instant = Instant::now();
    while !fs::read_dir(&partial_folder).is_ok_and(|mut entries| entries.any(is_part)) {
        assert!(start_instant.elapsed() < Duration::from_secs(60), "no part is kept");
        std::thread::sleep(Duration::from_millis(20));
    }
    send_signal("TERM", child.id());
    let interrupted_output = child.wait_with_output().expect("it ends");
    assert_eq!(interrupted_output.status.code(), Some(143), "{}", all_output(&interrupted_output));
    assert!(
        all_output(&interrupted_output).contains("sweep stability grid.toml --speed 60:360:0.05")
    );
    let status_output =
        sweep_command(&folder, &["status", "grid.toml", "--speed", "60:360:0.05"]).output();
    assert!(all_output(&status_output.expect("it starts")).contains("unfinished"));
    let resumed_output = sweep_command(&folder, &stability_words).output().expect("it starts");
    assert_eq!(resumed_output.status.code(), Some(0), "{}", all_output(&resumed_output));
    assert!(all_output(&resumed_output).contains("going on: "), "{}", all_output(&resumed_output));
    let whole_output =
        sweep_command(&folder, &stability_words).args(["--out", "whole.parquet"]).output();
    assert_eq!(whole_output.expect("it starts").status.code(), Some(0));
    let file_bytes = |name: &str| fs::read(folder.path().join(name)).expect("it is there");
    assert!(file_bytes("results/grid-stability.parquet") == file_bytes("whole.parquet"));
    let repeated_output = sweep_command(&folder, &stability_words).output().expect("it starts");
    assert!(
        all_output(&repeated_output).contains("there already"),
        "{}",
        all_output(&repeated_output)
    );
}

#[test]
fn joined_shards_have_the_same_bytes() {
    let folder = folder_with_grid("");
    let speed_option = ["--speed", "210:330:0.5"];
    let run_stability_with = |more: &[&str]| {
        let command_output = sweep_command(
            &folder,
            &[&["stability", "grid.toml"], &speed_option[..], more].concat(),
        );
        let command_output = { command_output }.output().expect("it starts");
        assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
        command_output
    };
    for shard in ["1/3", "3/3", "2/3"] {
        run_stability_with(&["--shard", shard]);
    }
    let merge_output =
        sweep_command(&folder, &[&["merge", "grid.toml"], &speed_option[..]].concat()).output();
    let merge_output = merge_output.expect("it starts");
    assert_eq!(merge_output.status.code(), Some(0), "{}", all_output(&merge_output));
    run_stability_with(&["--out", "whole.parquet"]);
    let file_bytes = |name: &str| fs::read(folder.path().join(name)).expect("it is there");
    assert!(file_bytes("results/grid-stability.parquet") == file_bytes("whole.parquet"));
}

#[test]
fn growth_is_a_metric_of_maps_and_a_quantity_of_boundaries() {
    // The last tongue closes at 0.4 kg and 252.5 N s/m by the independent program.
    let stability_section = "[stability]\nspeed_rpm = \"296:316:0.5\"\n";
    let folder = folder_with_grid("");
    let grid_text = format!("metrics = [\"growth\"]\n{GRID}{stability_section}");
    let grid_text =
        grid_text.replace("values = [140.0, 300.0]", "range = { from = 240, to = 270, count = 2 }");
    fs::write(folder.path().join("grid.toml"), grid_text).expect("it is written");
    let command_output = sweep_command(&folder, &["run", "grid.toml"]).output().expect("it starts");
    assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
    let show_output =
        sweep_command(&folder, &["show", "results/grid.parquet"]).output().expect("it starts");
    for column in ["growth_per_s", "growth_speed_rpm", "growth_kind", "growth_mode_1_name"] {
        assert!(
            all_output(&show_output).contains(column),
            "{column}: {}",
            all_output(&show_output)
        );
    }
    assert!(all_output(&show_output).contains("period_doubling"), "{}", all_output(&show_output));
    let boundary_output =
        sweep_command(&folder, &["boundary", "grid.toml", "--quantity", "growth_per_s"]).output();
    let boundary_output = boundary_output.expect("it starts");
    assert_eq!(boundary_output.status.code(), Some(0), "{}", all_output(&boundary_output));
    assert!(
        all_output(&boundary_output).contains("1 crossing"),
        "{}",
        all_output(&boundary_output)
    );
    let folder_without_growth = folder_with_grid("");
    let refused_output = sweep_command(
        &folder_without_growth,
        &["boundary", "grid.toml", "--quantity", "growth_per_s"],
    )
    .output();
    let refused_output = refused_output.expect("it starts");
    assert_eq!(refused_output.status.code(), Some(2), "{}", all_output(&refused_output));
    let expected = "`--quantity growth_per_s`: expected [stability] in the grid file";
    assert!(all_output(&refused_output).contains(expected), "{}", all_output(&refused_output));
}

/// Between the folds the machine has three responses. A search without the curve finds only one, at
/// a speed at which the attractor has large deviations.
#[test]
fn coexisting_responses_have_rows() {
    let folder = folder_with_grid("");
    let grid_text = GRID.replace("values = [0.4]", "values = [0.3, 0.4]");
    let grid_text = grid_text.replace("values = [140.0, 300.0]", "values = [30.0, 140.0]");
    fs::write(folder.path().join("grid.toml"), grid_text).expect("it is written");
    let speed_range = "254:259:0.5";
    let command_output = run_stability(&folder, speed_range, &[]);
    assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
    let stability_file = "results/grid-stability.parquet";
    let shown_text =
        all_output(&sweep_command(&folder, &["show", stability_file]).output().expect("it starts"));
    let jump_text = "damping_n_s_per_m 30: at 255.36 rpm, running up";
    for line in ["6 of 44 rows", "4 further rows", jump_text] {
        assert!(
            shown_text.contains(line) || all_output(&command_output).contains(line),
            "{line}\n{shown_text}"
        );
    }
    let export_output = sweep_command(&folder, &["export", stability_file, "rows.csv"])
        .output()
        .expect("it starts");
    assert_eq!(export_output.status.code(), Some(0), "{}", all_output(&export_output));
    let csv_text = fs::read_to_string(folder.path().join("rows.csv")).expect("it is there");
    let mut lines = csv_text.lines().filter(|line| !line.starts_with('#'));
    let column_names: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let column_index =
        |name: &str| column_names.iter().position(|known| known.starts_with(name)).expect(name);
    let [point_column, speed_column, growth_column, branch_column] =
        ["point", "speed_rpm", "growth_per_s", "branch"].map(column_index);
    // The comma in the name of a mode does not separate fields.
    let without_quoted_commas = |line: &str| -> String {
        let pieces = line.split('"').enumerate();
        pieces
            .map(|(k, piece)| if k % 2 == 1 { piece.replace(',', ";") } else { piece.into() })
            .collect()
    };
    let rows_without_commas: Vec<String> = lines.map(without_quoted_commas).collect();
    let rows: Vec<Vec<&str>> =
        rows_without_commas.iter().map(|line| line.split(',').collect()).collect();
    let rows_of_first_point = |speed_text: &str| -> Vec<&Vec<&str>> {
        rows.iter()
            .filter(|row| row[point_column] == "0" && row[speed_column] == speed_text)
            .collect()
    };
    let branches: Vec<&str> =
        rows_of_first_point("255").iter().map(|row| row[branch_column]).collect();
    assert_eq!(branches, ["0", "1", "2"]);
    for speed_text in ["256.5", "257", "257.5"] {
        let [row] = rows_of_first_point(speed_text)[..] else {
            panic!("one response at {speed_text} rpm: {csv_text}")
        };
        assert!(row[growth_column].parse::<f64>().expect("a number") > 2.9, "{row:?}");
    }
    // The further rows are also in shards, and in the comparison of a file with itself.
    for shard in ["2/2", "1/2"] {
        let command_output =
            run_stability(&folder, speed_range, &["--out", "joined.parquet", "--shard", shard]);
        assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
    }
    let merge_words = ["merge", "grid.toml", "--speed", speed_range, "--out", "joined.parquet"];
    let merge_output = sweep_command(&folder, &merge_words).output().expect("it starts");
    assert_eq!(merge_output.status.code(), Some(0), "{}", all_output(&merge_output));
    let file_bytes = |name: &str| fs::read(folder.path().join(name)).expect("it is there");
    assert!(file_bytes("joined.parquet") == file_bytes(stability_file));
    let compare_output =
        sweep_command(&folder, &["compare", stability_file, "joined.parquet"]).output();
    let compare_output = compare_output.expect("it starts");
    assert!(
        all_output(&compare_output).contains("differ  not at all"),
        "{}",
        all_output(&compare_output)
    );
}

/// The integration of a turn of so slow a drum would take hours.
#[test]
fn a_drum_that_is_too_slow_has_a_status_at_once() {
    let folder = folder_with_grid("");
    let command_output = run_stability(&folder, "0.01:0.02:0.01", &[]);
    assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
    let show_output =
        sweep_command(&folder, &["show", "--all", "results/grid-stability.parquet"]).output();
    let shown_text = all_output(&show_output.expect("it starts"));
    assert!(shown_text.contains("too_slow"), "{shown_text}");
}

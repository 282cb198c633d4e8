//! Tests of `sweep optimise`: its files, interruptions and errors.

#![cfg(unix)]

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::send_signal;
use crate::test_folder::{all_output, sweep_binary};

const GRID_TEMPLATE: &str = r#"
machine = "paper"
metrics = ["cabinet_force"]
spin = { profile = "ramp", peak_rpm = 350.0, ramp_s = 2.0 }
time = { end_s = END }
integrator = { method = "rk4", step_s = 2.0e-4 }
[[axis]]
parameter = "unbalance_mass_kg"
range = { from = 0.1, to = 0.4, count = 4 }
"#;

const STUDY: &str = r#"
grid = "grid.toml"
seed = 3
population = 8
candidates = 24
conditions = ["quantile(nonlinear_tub_front_y, 0.9) < 0.02", "max(ratio_max) < 50"]
[[objective]]
minimise = "max(cabinet_force_nonlinear_n)"
[[parameter]]
name = "spring_stiffness_n_per_m"
from = 4000
to = 12000
spacing = "log"
[[parameter]]
name = "damping_n_s_per_m"
from = 60
to = 400
"#;

fn folder_with_study(end_s: &str, study: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let write_file = |name: &str, text: &str| {
        fs::write(folder.path().join(name), text).expect("it is written");
    };
    write_file("grid.toml", &GRID_TEMPLATE.replace("END", end_s));
    write_file("study.toml", study);
    folder
}

fn sweep_command(folder: &tempfile::TempDir, command_line: &str) -> Command {
    let mut command = Command::new(sweep_binary());
    command.current_dir(folder.path()).args(command_line.split(' '));
    command
}

/// Runs a command that succeeds, and returns its output.
fn successful_output_text(folder: &tempfile::TempDir, command_line: &str) -> String {
    let command_output = sweep_command(folder, command_line).output().expect("it starts");
    assert_eq!(
        command_output.status.code(),
        Some(0),
        "{command_line}: {}",
        all_output(&command_output)
    );
    all_output(&command_output)
}

/// Returns the number in a column of a result with a single row.
fn number_in_first_row(folder: &tempfile::TempDir, command_line: &str, column: &str) -> f64 {
    let rows_json: serde_json::Value =
        serde_json::from_str(&successful_output_text(folder, command_line)).expect("it is JSON");
    rows_json[0][column].as_f64().unwrap_or_else(|| panic!("no {column} in {rows_json}"))
}

#[test]
fn the_summary_says_how_the_front_grew_in_the_last_third() {
    let further_objective = "[[objective]]\nmaximise = \"min(min_gap_nonlinear_m)\"\n[[parameter]]";
    let folder = folder_with_study("2", &STUDY.replacen("[[parameter]]", further_objective, 1));
    let summary_text = successful_output_text(&folder, "optimise study.toml");
    let search_text =
        summary_text.split_once("the last 8 candidates put ").expect("the line `search`").1;
    let search_text = search_text.split_once(" on the front").expect("its end").0;
    let (late_count, front_count) = search_text.split_once(" of ").expect("two counts");
    let require_conditions = [
        format!("count(on_front and candidate >= 16) == {late_count}"),
        format!("count(on_front) == {front_count}"),
    ];
    let require_output =
        sweep_command(&folder, "require results/study.parquet").args(&require_conditions).output();
    let require_output = require_output.expect("it starts");
    assert_eq!(require_output.status.code(), Some(0), "{}", all_output(&require_output));
}

#[test]
fn the_best_candidate_is_a_row_of_the_table() {
    let further_objectives = "[[objective]]\nmaximise = \"min(min_gap_nonlinear_m)\"\n\
        [[objective]]\nminimise = \"max(nonlinear_tub_front_y + nonlinear_tub_front_z)\"\n\
        [[objective]]\nminimise = \"max(nonlinear_tub_front_y - nonlinear_tub_front_z)\"\n\
        [[parameter]]";
    let study = STUDY.replacen("[[parameter]]", further_objectives, 1).replace("24", "200");
    let folder = folder_with_study("2", &study);
    let summary_text = successful_output_text(&folder, "optimise study.toml");
    let best_candidate = summary_text.split_once("best  candidate ").expect("a best").1;
    let best_candidate = best_candidate.split_whitespace().next().expect("its number");
    let is_row_of_candidate = |line: &str| line.split_whitespace().next() == Some(best_candidate);
    assert!(
        summary_text.lines().any(is_row_of_candidate),
        "no row of candidate {best_candidate} in {summary_text}"
    );
    for column in [
        "max_nonlinear_tub_front_y_plus_nonlinear_tub_front_z",
        "max_nonlinear_tub_front_y_minus_nonlinear_tub_front_z",
    ] {
        assert!(summary_text.contains(column), "{summary_text}");
    }
}

#[test]
fn the_summary_names_the_closest_condition_and_the_nearest_candidate() {
    let folder = folder_with_study("2", STUDY);
    let summary_text = successful_output_text(&folder, "optimise study.toml");
    // The best candidate keeps both conditions by far, so that none binds.
    let closest_line = summary_text.lines().find(|line| line.trim_start().starts_with("closest  "));
    let closest_line =
        closest_line.unwrap_or_else(|| panic!("no line `closest` in {summary_text}"));
    assert!(closest_line.contains(": slack ") && closest_line.ends_with(" %"), "{closest_line}");
    assert!(!summary_text.contains("binds"), "{summary_text}");
    assert!(!summary_text.contains("nearest"), "{summary_text}");

    let study = STUDY.replace("max(ratio_max) < 50", "max(ratio_max) < 1e-3");
    let folder = folder_with_study("2", &study);
    let infeasible_output =
        sweep_command(&folder, "optimise study.toml").output().expect("it starts");
    assert_eq!(infeasible_output.status.code(), Some(4), "{}", all_output(&infeasible_output));
    let summary_text = all_output(&infeasible_output);
    let nearest_text = summary_text.split_once("nearest  candidate ").expect("the nearest").1;
    assert!(nearest_text.contains("max(ratio_max) < 1e-3 by "), "{summary_text}");
    let candidate = nearest_text.split(',').next().expect("its number");
    let is_row_of_candidate = |line: &str| line.split_whitespace().next() == Some(candidate);
    assert!(
        summary_text.lines().any(is_row_of_candidate),
        "no row of candidate {candidate} in {summary_text}"
    );
    let show_words = "show results/study.parquet --json --columns candidate --where feasible";
    assert_eq!(successful_output_text(&folder, show_words).trim(), "[]");
    let excess_in_row = |show_line: &str| number_in_first_row(&folder, show_line, "excess_2");
    let own_excess = excess_in_row(&format!(
        "show results/study.parquet --json --columns excess_2 --where candidate=={candidate}"
    ));
    let least_excess = excess_in_row(
        "show results/study.parquet --json --by excess_2 --ascending --columns excess_2",
    );
    assert!(
        own_excess >= least_excess && own_excess < 2.0 * least_excess,
        "{own_excess} and {least_excess}"
    );
}

#[test]
fn an_objective_that_is_a_parameter_has_its_own_column() {
    let study = STUDY.replace("max(cabinet_force_nonlinear_n)", "damping_n_s_per_m");
    let folder = folder_with_study("2", &study);
    let grid = GRID_TEMPLATE.replace("END", "2");
    let grid_without_axes = &grid[..grid.find("[[axis]]").expect("an axis")];
    fs::write(folder.path().join("grid.toml"), grid_without_axes).expect("it is written");
    let summary_text = successful_output_text(&folder, "optimise study.toml");
    assert!(summary_text.contains("objective_damping_n_s_per_m"), "{summary_text}");
}

#[test]
fn the_machine_file_of_the_best_has_the_force_of_the_study() {
    let folder = folder_with_study("2", STUDY);
    let summary_text =
        successful_output_text(&folder, "optimise study.toml --best best.toml --threads 2");
    assert!(summary_text.contains("24 candidates of 4 points"), "{summary_text}");
    let study_result = "results/study.parquet";
    let column = "max_cabinet_force_nonlinear_n";
    let show_words = format!("show {study_result} --where on_front --json --columns {column}");
    let force_n = number_in_first_row(&folder, &show_words, column);
    let grid = fs::read_to_string(folder.path().join("grid.toml")).expect("there is a grid");
    let grid_of_best = grid.replace("\"paper\"", "\"best.toml\"");
    fs::write(folder.path().join("own.toml"), grid_of_best).expect("it is written");
    successful_output_text(&folder, "run own.toml --out own.parquet");
    let worst_words = "show own.parquet --by cabinet_force_nonlinear_n --top 1 --json \
                 --columns cabinet_force_nonlinear_n";
    let own_force_n = number_in_first_row(
        &folder,
        &worst_words.split_whitespace().collect::<Vec<_>>().join(" "),
        "cabinet_force_nonlinear_n",
    );
    assert_eq!(own_force_n, force_n, "a fixed step: the same bits");
    // Every candidate is within its bounds, and no feasible one is better than the best.
    let require_conditions = [
        "spring_stiffness_n_per_m >= 4000 and damping_n_s_per_m <= 400".to_owned(),
        format!("not feasible or max_cabinet_force_nonlinear_n >= {force_n}"),
        "count(on_front) == 1".to_owned(),
        "feasible == (excess_1 + excess_2 == 0)".to_owned(),
    ];
    let require_output = sweep_command(&folder, &format!("require {study_result}"))
        .args(&require_conditions)
        .output();
    let require_output = require_output.expect("it starts");
    assert_eq!(require_output.status.code(), Some(0), "{}", all_output(&require_output));
    successful_output_text(&folder, &format!("plot {study_result} -o study.svg"));
    let figure = fs::read_to_string(folder.path().join("study.svg")).expect("it was drawn");
    assert!(figure.contains(">max(cabinet_force_nonlinear_n) (N)<"), "the study's own words");
    successful_output_text(&folder, &format!("plot {study_result} -o study.html"));
    successful_output_text(&folder, &format!("export {study_result} study.csv"));
    assert!(successful_output_text(&folder, "optimise study.toml").contains("it is there already"));
}

#[test]
fn an_interrupted_study_continues_to_the_same_bytes() {
    let folder = folder_with_study("6", STUDY);
    let command_line = "optimise study.toml --threads 1 --progress none --out";
    successful_output_text(&folder, &format!("{command_line} whole.parquet"));
    let trials_path = folder.path().join("x.parquet.partial/part-00000000.parquet");
    for name in ["INT", "KILL"] {
        let bytes_before = fs::metadata(&trials_path).map_or(0, |study_result| study_result.len());
        let mut child = sweep_command(&folder, &format!("{command_line} x.parquet"))
            .stderr(Stdio::null())
            .spawn()
            .expect("it starts");
        let deadline = Instant::now() + Duration::from_secs(60);
        while fs::metadata(&trials_path).map_or(0, |study_result| study_result.len())
            <= bytes_before
        {
            assert!(Instant::now() < deadline, "no answer was kept");
            assert!(child.try_wait().expect("it is ours").is_none(), "it ended");
            std::thread::sleep(Duration::from_millis(2));
        }
        send_signal(name, child.id());
        let exit_code = child.wait().expect("it ends").code();
        assert_eq!(exit_code, if name == "INT" { Some(130) } else { None });
        assert!(!folder.path().join("x.parquet").exists());
    }
    successful_output_text(
        &folder,
        &format!("{} x.parquet", command_line.replace("threads 1", "threads 2")),
    );
    let file_bytes = |name: &str| fs::read(folder.path().join(name)).expect("there is a file");
    assert!(file_bytes("x.parquet") == file_bytes("whole.parquet"), "other bytes");
    assert!(!Path::new(&trials_path).exists());
    fs::write(folder.path().join("study.toml"), STUDY.replace("seed = 3", "seed = 4"))
        .expect("it is written");
    let other_seed_output =
        sweep_command(&folder, &format!("{command_line} x.parquet")).output().expect("it starts");
    assert_eq!(other_seed_output.status.code(), Some(2), "{}", all_output(&other_seed_output));
    assert!(
        all_output(&other_seed_output).contains("/optimise/seed: was 3, is 4"),
        "{}",
        all_output(&other_seed_output)
    );
}

#[test]
fn all_mistakes_in_a_study_and_its_grid_are_reported_together() {
    let invalid_study = STUDY
        .replace("candidates = 24", "candidate = 24")
        .replace("damping_n_s_per_m", "dampin_n_s_per_m")
        .replace("to = 12000", "to = 4000\ntolerance = 0.1")
        .replace("max(ratio_max) < 50", "max(ratio_max) = 50")
        .replace("max(cabinet_force_nonlinear_n)", "cabinet_force_nonlinear_n");
    let folder = folder_with_study("-2", &invalid_study);
    let refused_output = sweep_command(&folder, "optimise study.toml").output().expect("it starts");
    assert_eq!(refused_output.status.code(), Some(2));
    for expected in [
        "did you mean `candidates`?",
        "did you mean `damping_n_s_per_m`?",
        "study.toml:5:1",
        "from 4000 to 4000",
        "a tolerance without a design that spreads it",
        "grid.toml:5:18",
        "study.toml:6:78",
        "expected max(), min(), mean()",
        "7 mistakes",
    ] {
        assert!(
            all_output(&refused_output).contains(expected),
            "no {expected} in {}",
            all_output(&refused_output)
        );
    }
    // The columns are known once there are no other mistakes.
    let invalid_study = STUDY
        .replace("ratio_max) < 50", "ratio_mx) < 50")
        .replace("max(cabinet_force_nonlinear_n)", "cabinet_force_nonlinear_n");
    let folder = folder_with_study("2", &invalid_study);
    let refused_output = sweep_command(&folder, "optimise study.toml").output().expect("it starts");
    for expected in
        ["did you mean `ratio_max`?", "study.toml:6:67", "expected max(), min(), mean()"]
    {
        assert!(
            all_output(&refused_output).contains(expected),
            "no {expected} in {}",
            all_output(&refused_output)
        );
    }
    assert!(!folder.path().join("results").exists());
}

#[test]
fn tolerances_vary_the_parameters_of_a_candidate() {
    let folder =
        folder_with_study("2", &STUDY.replace("to = 400\n", "to = 400\ntolerance = 0.2\n"));
    let grid = GRID_TEMPLATE.replace("END", "2").replace(", count = 4", "");
    let design_section = "[design]\nmethod = \"sobol\"\npoints = 8\n";
    fs::write(folder.path().join("grid.toml"), format!("{grid}{design_section}"))
        .expect("it is written");
    successful_output_text(&folder, "optimise study.toml --out wide.parquet");
    fs::write(folder.path().join("study.toml"), STUDY).expect("it is written");
    successful_output_text(&folder, "optimise study.toml --out exact.parquet");
    let column = "max_cabinet_force_nonlinear_n";
    let number_of_first_row = |study_result: &str| {
        number_in_first_row(
            &folder,
            &format!("show {study_result} --top 1 --json --columns {column}"),
            column,
        )
    };
    // The worst of eight machines with different dampings is worse than the candidate itself.
    assert_ne!(number_of_first_row("wide.parquet"), number_of_first_row("exact.parquet"));
}

#[test]
fn the_path_of_the_machine_file_is_checked_before_the_search() {
    let folder = folder_with_study("2", STUDY);
    for (words, expected) in [
        ("--best study.toml", "no file of `sweep optimise --best` or"),
        ("--best grid.toml", "no file of `sweep optimise --best` or"),
        ("--out x.toml.parquet --best ./x.toml.parquet", "another file than that of all"),
        ("--best best.toml --candidate 24", "expected a number from 0 to 23"),
        ("--set damping_n_s_per_m=90", "`damping_n_s_per_m` is given twice"),
    ] {
        let refused_output =
            sweep_command(&folder, &format!("optimise study.toml {words}")).output();
        let refused_output = refused_output.expect("it starts");
        assert_eq!(
            refused_output.status.code(),
            Some(2),
            "{words}: {}",
            all_output(&refused_output)
        );
        assert!(
            all_output(&refused_output).contains(expected),
            "{words}: {}",
            all_output(&refused_output)
        );
    }
    assert!(fs::read_to_string(folder.path().join("study.toml")).is_ok_and(|text| text == STUDY));
    // Folders are created, and the machine file of an earlier search is overwritten.
    for candidate in [0, 23] {
        let command_line =
            format!("optimise study.toml --best made/best.toml --candidate {candidate}");
        successful_output_text(&folder, &command_line);
        let machine_file =
            fs::read_to_string(folder.path().join("made/best.toml")).expect("it is there");
        assert!(
            machine_file
                .starts_with(&format!("# Written by sweep: candidate {candidate} of study\n")),
            "{machine_file}"
        );
    }
}

#[test]
fn a_study_without_a_feasible_candidate_writes_no_machine_file() {
    let folder =
        folder_with_study("2", &STUDY.replace("max(ratio_max) < 50", "max(ratio_max) < 0"));
    let command_line = "optimise study.toml --best best.toml";
    let command_output = sweep_command(&folder, command_line).output().expect("it starts");
    assert_eq!(command_output.status.code(), Some(4), "{}", all_output(&command_output));
    for expected in ["feasible  0 of 24\n", "none is feasible; best.toml is not written"] {
        assert!(
            all_output(&command_output).contains(expected),
            "no {expected} in {}",
            all_output(&command_output)
        );
    }
    assert!(!folder.path().join("best.toml").exists());
}

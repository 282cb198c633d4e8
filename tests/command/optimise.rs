//! Tests of `sweep optimise`: its files, interruptions and errors.

#![cfg(unix)]

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::signal;
use crate::test_folder::{all_output, sweep_binary};

const GRID: &str = r#"
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

fn folder_with(end_s: &str, study: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let write = |name: &str, text: &str| {
        fs::write(folder.path().join(name), text).expect("it is written");
    };
    write("grid.toml", &GRID.replace("END", end_s));
    write("study.toml", study);
    folder
}

fn sweep(folder: &tempfile::TempDir, line: &str) -> Command {
    let mut command = Command::new(sweep_binary());
    command.current_dir(folder.path()).args(line.split(' '));
    command
}

/// Runs a command that succeeds, and returns its output.
fn output_of(folder: &tempfile::TempDir, line: &str) -> String {
    let output = sweep(folder, line).output().expect("it starts");
    assert_eq!(output.status.code(), Some(0), "{line}: {}", all_output(&output));
    all_output(&output)
}

/// Returns the number in a column of a result with a single row.
fn number(folder: &tempfile::TempDir, line: &str, column: &str) -> f64 {
    let rows: serde_json::Value =
        serde_json::from_str(&output_of(folder, line)).expect("it is JSON");
    rows[0][column].as_f64().unwrap_or_else(|| panic!("no {column} in {rows}"))
}

#[test]
fn the_summary_says_how_the_front_grew_in_the_last_third() {
    let second = "[[objective]]\nmaximise = \"min(min_gap_nonlinear_m)\"\n[[parameter]]";
    let folder = folder_with("2", &STUDY.replacen("[[parameter]]", second, 1));
    let text = output_of(&folder, "optimise study.toml");
    let search_text = text.split_once("the last 8 candidates put ").expect("the line `search`").1;
    let search_text = search_text.split_once(" on the front").expect("its end").0;
    let (late, front) = search_text.split_once(" of ").expect("two counts");
    let conditions = [
        format!("count(on_front and candidate >= 16) == {late}"),
        format!("count(on_front) == {front}"),
    ];
    let require_output = sweep(&folder, "require results/study.parquet").args(&conditions).output();
    let require_output = require_output.expect("it starts");
    assert_eq!(require_output.status.code(), Some(0), "{}", all_output(&require_output));
}

#[test]
fn the_best_candidate_is_a_row_of_the_table() {
    let objectives = "[[objective]]\nmaximise = \"min(min_gap_nonlinear_m)\"\n\
        [[objective]]\nminimise = \"max(nonlinear_tub_front_y + nonlinear_tub_front_z)\"\n\
        [[objective]]\nminimise = \"max(nonlinear_tub_front_y - nonlinear_tub_front_z)\"\n\
        [[parameter]]";
    let study = STUDY.replacen("[[parameter]]", objectives, 1).replace("24", "200");
    let folder = folder_with("2", &study);
    let text = output_of(&folder, "optimise study.toml");
    let best_candidate = text.split_once("best  candidate ").expect("a best").1;
    let best_candidate = best_candidate.split_whitespace().next().expect("its number");
    let is_row = |line: &str| line.split_whitespace().next() == Some(best_candidate);
    assert!(text.lines().any(is_row), "no row of candidate {best_candidate} in {text}");
    for column in [
        "max_nonlinear_tub_front_y_plus_nonlinear_tub_front_z",
        "max_nonlinear_tub_front_y_minus_nonlinear_tub_front_z",
    ] {
        assert!(text.contains(column), "{text}");
    }
}

#[test]
fn the_summary_names_the_closest_condition_and_the_nearest_candidate() {
    let folder = folder_with("2", STUDY);
    let text = output_of(&folder, "optimise study.toml");
    // The best candidate keeps both conditions by far, so that none binds.
    let closest_line = text.lines().find(|line| line.trim_start().starts_with("closest  "));
    let closest_line = closest_line.unwrap_or_else(|| panic!("no line `closest` in {text}"));
    assert!(closest_line.contains(": slack ") && closest_line.ends_with(" %"), "{closest_line}");
    assert!(!text.contains("binds"), "{text}");
    assert!(!text.contains("nearest"), "{text}");

    let study = STUDY.replace("max(ratio_max) < 50", "max(ratio_max) < 1e-3");
    let folder = folder_with("2", &study);
    let infeasible_output = sweep(&folder, "optimise study.toml").output().expect("it starts");
    assert_eq!(infeasible_output.status.code(), Some(4), "{}", all_output(&infeasible_output));
    let text = all_output(&infeasible_output);
    let nearest_text = text.split_once("nearest  candidate ").expect("the nearest").1;
    assert!(nearest_text.contains("max(ratio_max) < 1e-3 by "), "{text}");
    let candidate = nearest_text.split(',').next().expect("its number");
    let is_row = |line: &str| line.split_whitespace().next() == Some(candidate);
    assert!(text.lines().any(is_row), "no row of candidate {candidate} in {text}");
    let show = "show results/study.parquet --json --columns candidate --where feasible";
    assert_eq!(output_of(&folder, show).trim(), "[]");
    let excess = |file: &str| number(&folder, file, "excess_2");
    let own_excess = excess(&format!(
        "show results/study.parquet --json --columns excess_2 --where candidate=={candidate}"
    ));
    let least =
        excess("show results/study.parquet --json --by excess_2 --ascending --columns excess_2");
    assert!(own_excess >= least && own_excess < 2.0 * least, "{own_excess} and {least}");
}

#[test]
fn an_objective_that_is_a_parameter_has_its_own_column() {
    let study = STUDY.replace("max(cabinet_force_nonlinear_n)", "damping_n_s_per_m");
    let folder = folder_with("2", &study);
    let grid = GRID.replace("END", "2");
    let grid_without_axes = &grid[..grid.find("[[axis]]").expect("an axis")];
    fs::write(folder.path().join("grid.toml"), grid_without_axes).expect("it is written");
    let text = output_of(&folder, "optimise study.toml");
    assert!(text.contains("objective_damping_n_s_per_m"), "{text}");
}

#[test]
fn the_machine_file_of_the_best_has_the_force_of_the_study() {
    let folder = folder_with("2", STUDY);
    let text = output_of(&folder, "optimise study.toml --best best.toml --threads 2");
    assert!(text.contains("24 candidates of 4 points"), "{text}");
    let file = "results/study.parquet";
    let column = "max_cabinet_force_nonlinear_n";
    let show_words = format!("show {file} --where on_front --json --columns {column}");
    let force_n = number(&folder, &show_words, column);
    let grid = fs::read_to_string(folder.path().join("grid.toml")).expect("there is a grid");
    let own_grid = grid.replace("\"paper\"", "\"best.toml\"");
    fs::write(folder.path().join("own.toml"), own_grid).expect("it is written");
    output_of(&folder, "run own.toml --out own.parquet");
    let worst_words = "show own.parquet --by cabinet_force_nonlinear_n --top 1 --json \
                 --columns cabinet_force_nonlinear_n";
    let own_n = number(
        &folder,
        &worst_words.split_whitespace().collect::<Vec<_>>().join(" "),
        "cabinet_force_nonlinear_n",
    );
    assert_eq!(own_n, force_n, "a fixed step: the same bits");
    // Every candidate is within its bounds, and no feasible one is better than the best.
    let require = [
        "spring_stiffness_n_per_m >= 4000 and damping_n_s_per_m <= 400".to_owned(),
        format!("not feasible or max_cabinet_force_nonlinear_n >= {force_n}"),
        "count(on_front) == 1".to_owned(),
        "feasible == (excess_1 + excess_2 == 0)".to_owned(),
    ];
    let require_output = sweep(&folder, &format!("require {file}")).args(&require).output();
    let require_output = require_output.expect("it starts");
    assert_eq!(require_output.status.code(), Some(0), "{}", all_output(&require_output));
    output_of(&folder, &format!("plot {file} -o study.svg"));
    let picture = fs::read_to_string(folder.path().join("study.svg")).expect("it was drawn");
    assert!(picture.contains(">max(cabinet_force_nonlinear_n) (N)<"), "the study's own words");
    output_of(&folder, &format!("plot {file} -o study.html"));
    output_of(&folder, &format!("export {file} study.csv"));
    assert!(output_of(&folder, "optimise study.toml").contains("it is there already"));
}

#[test]
fn an_interrupted_study_continues_to_the_same_bytes() {
    let folder = folder_with("6", STUDY);
    let line = "optimise study.toml --threads 1 --progress none --out";
    output_of(&folder, &format!("{line} whole.parquet"));
    let trials = folder.path().join("x.parquet.partial/part-00000000.parquet");
    for name in ["INT", "KILL"] {
        let stored_bytes = fs::metadata(&trials).map_or(0, |file| file.len());
        let mut child = sweep(&folder, &format!("{line} x.parquet"))
            .stderr(Stdio::null())
            .spawn()
            .expect("it starts");
        let until = Instant::now() + Duration::from_secs(60);
        while fs::metadata(&trials).map_or(0, |file| file.len()) <= stored_bytes {
            assert!(Instant::now() < until, "no answer was kept");
            assert!(child.try_wait().expect("it is ours").is_none(), "it ended");
            std::thread::sleep(Duration::from_millis(2));
        }
        signal(name, child.id());
        let code = child.wait().expect("it ends").code();
        assert_eq!(code, if name == "INT" { Some(130) } else { None });
        assert!(!folder.path().join("x.parquet").exists());
    }
    output_of(&folder, &format!("{} x.parquet", line.replace("threads 1", "threads 2")));
    let bytes = |name: &str| fs::read(folder.path().join(name)).expect("there is a file");
    assert!(bytes("x.parquet") == bytes("whole.parquet"), "other bytes");
    assert!(!Path::new(&trials).exists());
    fs::write(folder.path().join("study.toml"), STUDY.replace("seed = 3", "seed = 4"))
        .expect("it is written");
    let other_output = sweep(&folder, &format!("{line} x.parquet")).output().expect("it starts");
    assert_eq!(other_output.status.code(), Some(2), "{}", all_output(&other_output));
    assert!(
        all_output(&other_output).contains("/optimise/seed: was 3, is 4"),
        "{}",
        all_output(&other_output)
    );
}

#[test]
fn all_mistakes_in_a_study_and_its_grid_are_reported_together() {
    let invalid_output = STUDY
        .replace("candidates = 24", "candidate = 24")
        .replace("damping_n_s_per_m", "dampin_n_s_per_m")
        .replace("to = 12000", "to = 4000\ntolerance = 0.1")
        .replace("max(ratio_max) < 50", "max(ratio_max) = 50")
        .replace("max(cabinet_force_nonlinear_n)", "cabinet_force_nonlinear_n");
    let folder = folder_with("-2", &invalid_output);
    let refused_output = sweep(&folder, "optimise study.toml").output().expect("it starts");
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
    let invalid_output = STUDY
        .replace("ratio_max) < 50", "ratio_mx) < 50")
        .replace("max(cabinet_force_nonlinear_n)", "cabinet_force_nonlinear_n");
    let folder = folder_with("2", &invalid_output);
    let refused_output = sweep(&folder, "optimise study.toml").output().expect("it starts");
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
    let folder = folder_with("2", &STUDY.replace("to = 400\n", "to = 400\ntolerance = 0.2\n"));
    let grid = GRID.replace("END", "2").replace(", count = 4", "");
    let design = "[design]\nmethod = \"sobol\"\npoints = 8\n";
    fs::write(folder.path().join("grid.toml"), format!("{grid}{design}")).expect("it is written");
    output_of(&folder, "optimise study.toml --out wide.parquet");
    fs::write(folder.path().join("study.toml"), STUDY).expect("it is written");
    output_of(&folder, "optimise study.toml --out exact.parquet");
    let column = "max_cabinet_force_nonlinear_n";
    let first_row = |file: &str| {
        number(&folder, &format!("show {file} --top 1 --json --columns {column}"), column)
    };
    // The worst of eight machines with different dampings is worse than the candidate itself.
    assert_ne!(first_row("wide.parquet"), first_row("exact.parquet"));
}

#[test]
fn the_path_of_the_machine_file_is_checked_before_the_search() {
    let folder = folder_with("2", STUDY);
    for (words, expected) in [
        ("--best study.toml", "no file of `sweep optimise --best` or"),
        ("--best grid.toml", "no file of `sweep optimise --best` or"),
        ("--out x.toml.parquet --best ./x.toml.parquet", "another file than that of all"),
        ("--best best.toml --candidate 24", "expected a number from 0 to 23"),
        ("--set damping_n_s_per_m=90", "`damping_n_s_per_m` is given twice"),
    ] {
        let refused_output = sweep(&folder, &format!("optimise study.toml {words}")).output();
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
        let line = format!("optimise study.toml --best made/best.toml --candidate {candidate}");
        output_of(&folder, &line);
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
    let folder = folder_with("2", &STUDY.replace("max(ratio_max) < 50", "max(ratio_max) < 0"));
    let line = "optimise study.toml --best best.toml";
    let command_output = sweep(&folder, line).output().expect("it starts");
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

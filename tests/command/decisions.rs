//! Tests of the commands that work on a finished map: `require`, `compare`, `export`, rows of
//! `show`, `trace --point`; and of `--set` for the scalars of a grid file.

use std::fs::{self, File};
use std::process::Output;
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, RecordBatch};
use serde_json::{Value, json};
use sweep_files::Writer;

use crate::test_folder::{TestFolder, all_output, grid};

/// Returns a folder with a finished map of six points, `results/short.parquet`.
fn folder_with_map() -> TestFolder {
    let test_folder = TestFolder::new(&grid(3, 2));
    let command_output = test_folder.sweep(&["run", "g.toml", "--progress", "none"]);
    assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
    test_folder
}

const MAP: &str = "results/short.parquet";

fn exit_code(output: &Output) -> Option<i32> {
    output.status.code()
}

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn json_output(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| {
        panic!("{error} in {}\n{}", stdout(output), all_output(output));
    })
}

#[test]
fn report_does_not_overwrite_a_page_of_plot_and_takes_an_option_for_each_expression() {
    let test_folder = folder_with_map();
    let page = "results/short.html";
    assert_eq!(exit_code(&test_folder.sweep(&["plot", MAP, "-o", page])), Some(0));
    let before = fs::read(test_folder.path(page)).unwrap();
    let written_output = test_folder.sweep(&["report", MAP]);
    assert_eq!(exit_code(&written_output), Some(0), "{}", all_output(&written_output));
    assert!(fs::read(test_folder.path(page)).unwrap() == before);
    assert!(test_folder.path("results/short.report.html").exists());
    let failed = test_folder.sweep(&["report", MAP, "--require", "count(point >= 0) < 0"]);
    assert_eq!(exit_code(&failed), Some(4), "{}", all_output(&failed));
    assert!(all_output(&failed).contains("FAILS  count(point >= 0) < 0: 6\n"));
    let refused_output =
        test_folder.sweep(&["report", MAP, "--require", "point >= 0", "point < 9"]);
    assert_eq!(exit_code(&refused_output), Some(2));
    assert!(
        all_output(&refused_output).contains("a `--require` of its own"),
        "{}",
        all_output(&refused_output)
    );
}

#[test]
fn require_names_the_failing_rows_and_exits_with_4() {
    let test_folder = folder_with_map();
    let passed_gate =
        test_folder.sweep(&["require", MAP, "ratio_max < 1e6", "count(status == 'ok') == 6"]);
    assert_eq!(exit_code(&passed_gate), Some(0), "{}", all_output(&passed_gate));
    assert!(
        all_output(&passed_gate).contains("holds  ratio_max < 1e6: 6 rows"),
        "{}",
        all_output(&passed_gate)
    );

    let closed =
        test_folder.sweep(&["require", MAP, "unbalance_mass_kg < 0.9", "share(reliable) >= 0"]);
    assert_eq!(exit_code(&closed), Some(4));
    let text = all_output(&closed);
    assert!(text.contains("FAILS  unbalance_mass_kg < 0.9: 2 of 6 rows false"), "{text}");
    assert!(text.contains("holds  share(reliable) >= 0"), "{text}");

    let gate = json_output(&test_folder.sweep(&["require", MAP, "point < 2", "--json"]));
    assert_eq!(gate["holds"], false);
    assert_eq!(gate["expressions"][0]["failing"], 4);
    assert_eq!(gate["expressions"][0]["offenders"][0]["row"], 2);

    let empty_selection = test_folder.sweep(&["require", MAP, "reliable", "--where", "false"]);
    assert_eq!(exit_code(&empty_selection), Some(4));
    assert!(all_output(&empty_selection).contains("no row"), "{}", all_output(&empty_selection));
}

#[test]
fn only_results_go_to_standard_output() {
    let test_folder = folder_with_map();
    for words in [
        &["check", "g.toml"][..],
        &["status", "g.toml"],
        &["show", MAP],
        &["require", MAP, "point < 2"],
        &["compare", MAP, MAP],
        &["modes", "--speed", "0:300:100"],
    ] {
        let command_output = test_folder.sweep(words);
        assert!(
            command_output.stdout.len() > 40 && command_output.stderr.is_empty(),
            "{words:?}: {}",
            all_output(&command_output)
        );
    }
    for words in [&["run", "g.toml"][..], &["plot", MAP]] {
        let command_output = test_folder.sweep(words);
        assert!(
            command_output.stdout.is_empty() && !command_output.stderr.is_empty(),
            "{words:?}: {}",
            all_output(&command_output)
        );
    }
}

/// Writes a result with a ratio for each of several masses.
fn write_ratios(test_folder: &TestFolder, name: &str, ratio: impl Fn(u32) -> Option<f64>) {
    let number_array = |value: &dyn Fn(u32) -> Option<f64>| -> ArrayRef {
        Arc::new((0..400).map(value).collect::<Float64Array>())
    };
    let columns = [
        ("unbalance_mass_kg", number_array(&|row| Some(0.01 * f64::from(row)))),
        ("nonlinear_tub_yaw", number_array(&ratio)),
        ("ratio_max", number_array(&ratio)),
        ("min_gap_nonlinear_m", number_array(&|row| Some(0.01 * ratio(row)?))),
        ("status", number_array(&|_| None)),
    ];
    let rows = RecordBatch::try_from_iter(columns).expect("columns of one length");
    let file = File::create(test_folder.path(name)).expect("the file can be made");
    let mut writer = Writer::new(file, &rows.schema(), Default::default()).expect("a writer");
    writer.write(&rows).expect("rows are written");
    writer.end().and_then(|file| file.close()).expect("the file is written");
}

#[test]
fn conditions_do_not_hold_if_points_failed() {
    let test_folder = TestFolder::new(&grid(1, 1));
    write_ratios(&test_folder, "whole.parquet", |_| Some(1.5));
    write_ratios(&test_folder, "half.parquet", |row| (row % 2 == 0).then_some(1.5));
    write_ratios(&test_folder, "nan.parquet", |_| Some(f64::NAN));
    for (file, over) in [("half.parquet", 200), ("nan.parquet", 0)] {
        for gate in
            ["max(ratio_max)<2", "mean(ratio_max)<2", "min(ratio_max)>1", "count(ratio_max>=2)==0"]
        {
            let failed_gate = test_folder.sweep(&["require", file, gate]);
            assert_eq!(exit_code(&failed_gate), Some(4), "{file}: {gate}");
            let expected = format!("over {over} of 400 rows");
            assert!(all_output(&failed_gate).contains(&expected), "{}", all_output(&failed_gate));
        }
        for gate in ["ratio=0.05", "gap=0.001"] {
            let failed_gate =
                test_folder.sweep(&["compare", "whole.parquet", file, "--fail-on", gate]);
            assert_eq!(
                exit_code(&failed_gate),
                Some(4),
                "{file}: {gate}\n{}",
                stdout(&failed_gate)
            );
            let same_output = test_folder.sweep(&["compare", file, file, "--fail-on", gate]);
            assert_eq!(
                exit_code(&same_output),
                Some(0),
                "{file}: {gate}\n{}",
                stdout(&same_output)
            );
        }
    }
    let allowed_output =
        test_folder.sweep(&["require", "half.parquet", "max(ratio_max)<2", "--allow-null"]);
    assert_eq!(exit_code(&allowed_output), Some(0), "{}", all_output(&allowed_output));
    let words = ["compare", "half.parquet", "half.parquet", "--fail-on", "flips"];
    let lacking_output = test_folder.sweep(&words);
    assert_eq!(exit_code(&lacking_output), Some(2), "{}", all_output(&lacking_output));
    assert!(
        all_output(&lacking_output).contains("two files with verdicts"),
        "{}",
        all_output(&lacking_output)
    );
}

#[test]
fn all_mistakes_in_conditions_are_reported() {
    let test_folder = folder_with_map();
    let refused_output = test_folder.sweep(&["require", MAP, "ratio_mx < 2", "reliable = true"]);
    assert_eq!(exit_code(&refused_output), Some(2));
    let text = all_output(&refused_output);
    assert!(text.contains("did you mean `ratio_max`?") && text.contains("expected `==`"), "{text}");
    let misplaced_extreme =
        test_folder.sweep(&["require", MAP, "reliable", "--where", "max(ratio_max) > 2"]);
    assert_eq!(exit_code(&misplaced_extreme), Some(2), "{}", all_output(&misplaced_extreme));
    let absent_output = test_folder.sweep(&["require", "no.parquet", "reliable"]);
    assert_eq!(exit_code(&absent_output), Some(2), "{}", all_output(&absent_output));
    for invalid_name in ["short.parquet", "resluts/short.parquet", "results/short"] {
        let absent_output = test_folder.sweep(&["show", invalid_name]);
        assert!(
            all_output(&absent_output).contains("results/short.parquet is there"),
            "{}",
            all_output(&absent_output)
        );
    }
    let no_grid = test_folder.sweep(&["check", MAP]);
    assert!(
        all_output(&no_grid).contains("it is a Parquet file, not text"),
        "{}",
        all_output(&no_grid)
    );
}

#[test]
fn show_sorts_and_filters_rows_and_prints_json() {
    let test_folder = folder_with_map();
    let top_rows = json_output(&test_folder.sweep(&[
        "show",
        MAP,
        "--top",
        "2",
        "--by",
        "ratio_tub_yaw",
        "--json",
    ]));
    let rows = top_rows.as_array().expect("rows");
    let ratios: Vec<f64> = rows.iter().filter_map(|row| row["ratio_tub_yaw"].as_f64()).collect();
    assert!(ratios.len() == 2 && ratios[0] >= ratios[1], "{top_rows}");
    // The table has every column, and counts are integers.
    assert!(rows[0]["point"].is_u64() && rows[0]["nonlinear_tub_yaw"].is_f64(), "{top_rows}");
    let whole_table = json_output(&test_folder.sweep(&["show", MAP, "--json"]));
    assert_eq!(whole_table["summary"]["points"], 6);
    assert_eq!(whole_table["plan"]["name"], "short");
    let filtered_output = test_folder.sweep(&["show", MAP, "--where", "damping_n_s_per_m > 200"]);
    assert_eq!(stdout(&filtered_output).lines().count(), 4, "{}", stdout(&filtered_output));
    let invalid_output = test_folder.sweep(&["show", MAP, "--by", "ratio_tub_yw"]);
    assert_eq!(exit_code(&invalid_output), Some(2));
    assert!(
        all_output(&invalid_output).contains("`ratio_tub_yaw`"),
        "{}",
        all_output(&invalid_output)
    );
}

#[test]
fn compare_reports_the_differences_of_two_maps() {
    let test_folder = folder_with_map();
    let same_output = test_folder.sweep(&["compare", MAP, MAP, "--fail-on", "any"]);
    assert_eq!(exit_code(&same_output), Some(0), "{}", stdout(&same_output));
    assert!(stdout(&same_output).contains("not at all"), "{}", stdout(&same_output));

    let light = ["run", "g.toml", "--set", "tub_mass_kg=20", "--name", "light"];
    let command_output = test_folder.sweep(&[&light[..], &["--progress", "none"]].concat());
    assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    let shown = stdout(&test_folder.sweep(&["show", "results/light.parquet"]));
    assert!(shown.contains("--set  tub_mass_kg = 20"), "{shown}");

    let arguments = ["compare", MAP, "results/light.parquet"];
    let differs =
        test_folder.sweep(&[&arguments[..], &["--fail-on", "ratio=0", "--json"]].concat());
    assert_eq!(exit_code(&differs), Some(4), "{}", all_output(&differs));
    let comparison = json_output(&differs);
    let paths: Vec<&str> = comparison["plan"]
        .as_array()
        .expect("changes")
        .iter()
        .filter_map(|change| change["path"].as_str())
        .collect();
    assert!(paths.contains(&"machine.tub.mass_kg") && paths.contains(&"set"), "{paths:?}");
    assert_eq!(comparison["rows"]["in_both"], 6);

    let markdown = stdout(&test_folder.sweep(&[&arguments[..], &["--markdown"]].concat()));
    assert!(markdown.starts_with("### `results/light.parquet` compared with"), "{markdown}");
    let written_output = test_folder.sweep(&[&arguments[..], &["--out", "d.parquet"]].concat());
    assert_eq!(exit_code(&written_output), Some(0), "{}", all_output(&written_output));
    for (quantity, title) in [
        (None, "Greatest ratio of B over that of A"),
        (Some("gap_change_m"), "Least gap of the nonlinear model in B less that in A"),
        (Some("ratio_max_b"), "Greatest ratio of B"),
    ] {
        let option = quantity.map(|column| ["--quantity", column]);
        let options = option.as_ref().map_or(&[][..], |option| option);
        let plot_output =
            test_folder.sweep(&[&["plot", "d.parquet", "-o", "d.svg"], options].concat());
        assert_eq!(exit_code(&plot_output), Some(0), "{}", all_output(&plot_output));
        let picture = fs::read_to_string(test_folder.path("d.svg")).expect("it was drawn");
        assert!(picture.contains(&format!(">{title}<")), "{quantity:?}");
        // The limits of both files are unknown.
        assert!(!picture.contains("boundary: "), "{quantity:?}");
    }
    let shown = json_output(&test_folder.sweep(&["show", "d.parquet", "--json"]));
    let columns = shown["columns"].as_array().expect("a list").iter();
    let worse: Vec<_> = columns.filter_map(|column| column["worse"].as_str()).collect();
    assert_eq!(worse, ["greater", "less"], "of the ratio's change and of the gap's");
    let refused_output = test_folder.sweep(&["compare", MAP, "d.parquet"]);
    assert_eq!(exit_code(&refused_output), Some(2), "{}", all_output(&refused_output));
}

#[test]
fn compare_matches_points_of_tolerances_about_other_numbers() {
    let tolerance = |parameter: &str| {
        format!("[[axis]]\nparameter = \"{parameter}\"\ntolerance = \"5 %\"\ncount = 2\n")
    };
    let plain = grid(3, 2);
    let start = plain.split("[[axis]]").next().expect("the keys before the axes");
    let axes = tolerance("tub_mass_kg") + &tolerance("damping_n_s_per_m");
    let test_folder = TestFolder::new(&format!("{start}{axes}"));
    for (name, mass) in [("a", "20"), ("b", "24")] {
        let mass = format!("[set]\ntub_mass_kg = {mass}\n");
        fs::write(test_folder.path("g.toml"), format!("{start}{mass}{axes}")).expect("written");
        let command_output =
            test_folder.sweep(&["run", "g.toml", "--name", name, "--progress", "none"]);
        assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    }
    let arguments = ["compare", "results/a.parquet", "results/b.parquet", "--fail-on", "rows"];
    let compare_output = test_folder.sweep(&arguments);
    assert_eq!(exit_code(&compare_output), Some(0), "{}", all_output(&compare_output));
    let text = stdout(&compare_output);
    assert!(text.contains("4 in both") && text.contains("rows are matched by point"), "{text}");
    let comparison = json_output(&test_folder.sweep(&[&arguments[..], &["--json"]].concat()));
    assert_eq!(
        (&comparison["matched_by"], &comparison["rows"]["in_both"]),
        (&"point".into(), &4.into())
    );
    assert_eq!(comparison["overridden"].as_array().map(Vec::len), Some(0));
}

#[test]
fn compare_names_differences_that_an_axis_overrides() {
    let axis = "[[axis]]\nparameter = \"spring_1_stiffness_n_per_m\"\nvalues = [7e3, 9e3]\n";
    let plain = grid(3, 2);
    let start = plain.split("[[axis]]").next().expect("the keys before the axes");
    let test_folder = TestFolder::new(&format!("{start}{axis}"));
    for (name, mass) in [("a", ""), ("b", "[set]\nspring_stiffness_n_per_m = 9e3\n")] {
        fs::write(test_folder.path("g.toml"), format!("{start}{mass}{axis}")).expect("written");
        let command_output =
            test_folder.sweep(&["run", "g.toml", "--name", name, "--progress", "none"]);
        assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    }
    let arguments = ["compare", "results/a.parquet", "results/b.parquet"];
    let text = stdout(&test_folder.sweep(&arguments));
    let expected_text = "overridden  machine.springs.1.stiffness_n_per_m: the axis \
                spring_1_stiffness_n_per_m sets this in both, so that the change does not show";
    assert!(text.contains(expected_text), "{text}");
    let comparison = json_output(&test_folder.sweep(&[&arguments[..], &["--json"]].concat()));
    // The other springs are another machine's.
    let paths = &comparison["overridden"][0]["paths"];
    assert_eq!(paths.as_array().map(Vec::len), Some(1), "{paths}");
    let markdown = stdout(&test_folder.sweep(&[&arguments[..], &["--markdown"]].concat()));
    assert!(markdown.contains("- overridden: machine.springs.1"), "{markdown}");
}

#[test]
fn compare_can_limit_the_difference_of_any_column() {
    let test_folder = folder_with_map();
    let light = ["run", "g.toml", "--set", "tub_mass_kg=20", "--out", "light.parquet"];
    let command_output = test_folder.sweep(&light);
    assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    let compare_output =
        |gate: &str| test_folder.sweep(&["compare", MAP, "light.parquet", "--fail-on", gate]);
    assert_eq!(exit_code(&compare_output("nonlinear_tub_yaw=1e9")), Some(0));
    let failed = compare_output("nonlinear_tub_yaw=0");
    assert_eq!(exit_code(&failed), Some(4), "{}", all_output(&failed));
    let text = stdout(&failed);
    assert!(text.contains("--fail-on: nonlinear_tub_yaw changed by up to "), "{text}");
    assert!(text.contains("greatest changes of nonlinear_tub_yaw, rad"), "{text}");
    for unfit in ["nonlinear_tub_yow=1", "unbalance_mass_kg=1", "status=1"] {
        let refused_output = compare_output(unfit);
        assert_eq!(exit_code(&refused_output), Some(2), "{unfit}");
        assert!(
            all_output(&refused_output).contains("a column of numbers in both files"),
            "{unfit}"
        );
    }
}

#[test]
fn compare_shows_both_ratios_of_a_changed_verdict() {
    let test_folder = TestFolder::new(&grid(3, 2));
    for (name, least, mass) in [("a", "ratio_min=0.5", "20"), ("b", "ratio_min=1", "22")] {
        let mass = format!("tub_mass_kg={mass}");
        let run = ["run", "g.toml", "--name", name, "--set", least, "--set", &mass];
        let command_output = test_folder.sweep(&[&run[..], &["--progress", "none"]].concat());
        assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    }
    let output = stdout(&test_folder.sweep(&["compare", "results/a.parquet", "results/b.parquet"]));
    let flips = output.split("verdicts that flipped").nth(1).expect("some");
    let row = flips.lines().nth(2).expect("a row");
    assert_eq!(row.matches(" to ").count(), 2, "{output}");
    assert!(row.contains(" reliable") && row.ends_with(" not"), "{output}");
}

#[test]
fn trace_says_which_limit_is_violated() {
    let test_folder = TestFolder::new(&grid(3, 2));
    let run_summary = |sets: &[&str]| {
        let trace = ["trace", "g.toml", "--point", "1", "--out", "t.parquet"];
        all_output(&test_folder.sweep(&[&trace[..], sets].concat()))
    };
    let high = run_summary(&[]);
    assert!(high.contains("the greatest ratio is ") && high.contains("the limit 2"), "{high}");
    // The ratios of so short a run are almost 1, and one of this point is less.
    let low = run_summary(&["--set", "ratio_min=1"]);
    let expected = "not reliable: the least ratio is 1 (tub_yaw), the limit 1";
    assert!(low.contains(expected), "{low}");
}

#[test]
fn a_report_describes_quantities_and_both_limits() {
    let grid = grid(3, 2).replace("ratio_limit = 2.0", "ratio_limit = 2.0\nratio_min = 0.999");
    let test_folder =
        TestFolder::new(&format!("metrics = [\"damper_speed\", \"static_sag\"]\n{grid}"));
    let sets = ["--set", "spin_ramp_s=0.05", "--set", "damper_1_friction_n=3"];
    let command_output =
        test_folder.sweep(&[&["run", "g.toml", "--progress", "none"], &sets[..]].concat());
    assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    let written_output = test_folder.sweep(&["report", MAP, "-o", "r.html"]);
    assert_eq!(exit_code(&written_output), Some(0), "{}", all_output(&written_output));
    let page = fs::read_to_string(test_folder.path("r.html")).expect("it was written");
    for text in [
        "is between 0.999 and 2",
        ">Tub front, vertical<",
        ">Least ratio<",
        ">Damper speed<",
        ">Static sag<",
        ">Ratio tub yaw<",
        "Resonances at Unbalance mass 0.525",
        "Unbalance mass ",
        // This is the only damper with friction.
        "with friction of 0 to 3 N",
    ] {
        assert!(page.contains(text), "{text}");
    }
    assert_eq!(page.matches(">Tub front, vertical<").count(), 1, "of the nonlinear model alone");
    // The file does not say where a number comes from, not even this one, which `--set` gave.
    assert!(!page.contains("assumed") && page.contains("sweep parameters"), "where from");
    // The column of all dampers replaces those of each, and lines do not break between numbers and
    // units.
    assert!(!page.contains("Damper 1 speed"), "numbered");
    assert!(page.contains("\u{a0}N\u{a0}s/m") && page.contains("\u{a0}m/s"), "units");
}

#[test]
fn exports_overwrite_only_files_of_the_same_kind() {
    let test_folder = folder_with_map();
    for (name, begins) in [("m.csv", &b"# exported by sweep "[..]), ("m.xlsx", b"PK\x03\x04")] {
        for _ in 0..2 {
            let command_output = test_folder.sweep(&["export", MAP, name]);
            assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
        }
        let bytes = fs::read(test_folder.path(name)).expect("the export is there");
        assert!(bytes.starts_with(begins), "{name}");
    }
    // The output may be an option, as with every other command.
    assert_eq!(exit_code(&test_folder.sweep(&["export", MAP, "--out", "o.csv"])), Some(0));
    let bytes = |name| fs::read(test_folder.path(name)).expect("the export is there");
    assert_eq!(bytes("o.csv"), bytes("m.csv"));
    assert_eq!(exit_code(&test_folder.sweep(&["export", MAP, "p.csv", "-o", "q.csv"])), Some(2));
    assert_eq!(exit_code(&test_folder.sweep(&["export", MAP])), Some(2));
    fs::write(test_folder.path("mine.csv"), "my,own\n1,2\n").expect("written");
    assert_eq!(exit_code(&test_folder.sweep(&["export", MAP, "mine.csv"])), Some(2));
    assert_eq!(exit_code(&test_folder.sweep(&["export", MAP, "m.ods"])), Some(2));
}

#[test]
#[cfg(unix)]
fn a_refused_temporary_file_of_an_export_is_a_failure_of_the_system() {
    let test_folder = folder_with_map();
    let mut command = test_folder.under(&[]);
    command.args(["export", MAP, "m.xlsx"]).env("TMPDIR", test_folder.path("missing"));
    let refused_output = command.output().expect("the command starts");
    assert_eq!(exit_code(&refused_output), Some(1), "{}", all_output(&refused_output));
    let text = all_output(&refused_output);
    assert!(text.contains("cannot write a temporary file to export"), "{text}");
}

#[test]
fn trace_selects_a_point_by_number_or_the_worst_one() {
    let test_folder = folder_with_map();
    let traced = test_folder.sweep(&["trace", "g.toml", "--point", "3", "--out", "t.parquet"]);
    assert_eq!(exit_code(&traced), Some(0), "{}", all_output(&traced));
    let row = json_output(&test_folder.sweep(&["show", MAP, "--where", "point == 3", "--json"]));
    let ratio = row[0]["ratio_max"].as_f64().expect("a ratio");
    let text = all_output(&traced);
    assert!(text.contains("verdict  ") && text.contains(&format!("{ratio:.4}")[..5]), "{text}");

    let worst = test_folder.sweep(&["trace", "g.toml", "--worst", "--out", "t.parquet"]);
    assert_eq!(exit_code(&worst), Some(0), "{}", all_output(&worst));
    let first = json_output(&test_folder.sweep(&[
        "show",
        MAP,
        "--top",
        "1",
        "--by",
        "ratio_max",
        "--json",
    ]));
    let expected = format!("point {} is where ratio_max is greatest", first[0]["point"]);
    assert!(all_output(&worst).contains(&expected), "{expected}: {}", all_output(&worst));

    let beyond = test_folder.sweep(&["trace", "g.toml", "--point", "6", "--out", "t.parquet"]);
    assert_eq!(exit_code(&beyond), Some(2));
    assert!(all_output(&beyond).contains("from 0 to 5"), "{}", all_output(&beyond));
    let other = ["trace", "g.toml", "--worst", "--set", "tub_mass_kg=20", "--out", "t.parquet"];
    let other = test_folder.sweep(&other);
    assert_eq!(exit_code(&other), Some(2));
    assert!(all_output(&other).contains("of this very grid"), "{}", all_output(&other));
}

#[test]
fn every_scalar_of_the_grid_file_can_be_set() {
    let test_folder = TestFolder::new(&grid(3, 2));
    let plan = |sets: &[&str]| {
        json_output(&test_folder.sweep(&[&["check", "g.toml", "--json"], sets].concat()))
    };
    let set = plan(&["--set", "end_s=0.2", "--ratio-limit", "1.5", "--set", "step_s=1e-4"]);
    assert_eq!(set["time"]["end_s"], 0.2);
    assert_eq!(set["reliability"]["ratio_limit"], 1.5);
    assert_eq!(set["integrator"]["step_s"], 1e-4);
    assert_eq!(set["set"]["ratio_limit"], 1.5);
    let method = plan(&["--set", "method=dopri5", "--set", "rtol=1e-5", "--set", "criterion=rms"]);
    assert_eq!(method["integrator"]["rtol"], 1e-5);
    assert_eq!(method["reliability"]["criterion"], "rms");
    assert!(plan(&[])["set"].is_null(), "a plan without --set reads as ever");
    let named = ["--set", "profile=ramp", "--set", "channels=tub_yaw, tub_pitch"];
    let named = plan(&[&named[..], &["--set", "metrics=static_sag,clash_time"]].concat());
    assert_eq!(named["spin"]["profile"], "ramp");
    assert_eq!(named["spin"]["peak_rpm"], plan(&[])["spin"]["peak_rpm"]);
    assert_eq!(named["reliability"]["channels"], json!(["tub_yaw", "tub_pitch"]));
    assert_eq!(named["metrics"], json!(["static_sag", "clash_time"]));
    assert_eq!(named["set"]["metrics"], "static_sag,clash_time");
    for (sets, expected) in [
        (["--set", "rtol=1e-5"], "the method \"rk4\" has no `rtol`"),
        (["--set", "method=dopri"], "did you mean `dopri5`?"),
        (["--set", "end_s=-1"], "`end_s`"),
        (["--set", "end_s=0.01"], "window"),
        (["--set", "seed=1"], "this grid has none"),
        (["--set", "profile=table"], "unknown profile"),
        (["--set", "channels=tub_yw"], "did you mean `tub_yaw`?"),
        (["--set", "channels=tub_yaw,tub_yaw"], "given twice"),
        (["--set", "channels="], "unknown channel"),
        (["--set", "metrics=growth"], "needs speeds"),
        (["--ratio-limit", "nan"], "ratio_limit"),
        (["--name", "a/b"], "expected letters"),
    ] {
        let refused_output = test_folder.sweep(&[&["check", "g.toml"], &sets[..]].concat());
        assert_eq!(
            exit_code(&refused_output),
            Some(2),
            "{sets:?}: {}",
            all_output(&refused_output)
        );
        assert!(
            all_output(&refused_output).contains(expected),
            "{sets:?}: {}",
            all_output(&refused_output)
        );
    }
}

#[test]
fn show_describes_lists_and_unfinished_runs() {
    let test_folder = TestFolder::new(&grid(3, 2));
    fs::write(test_folder.path("list.csv"), "unbalance_mass_kg\n0.1\n0.2\n").expect("written");
    let listed = "name = \"short\"\n\
        spin = { profile = \"triangular\", peak_rpm = 350, ramp_s = 50 }\n\
        time = { end_s = 0.1 }\n\
        integrator = { method = \"rk4\" }\n\
        design = { method = \"list\", file = \"list.csv\" }\n";
    fs::write(test_folder.path("list.toml"), listed).expect("written");
    let command_output = test_folder.sweep(&["run", "list.toml", "--progress", "none"]);
    assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    let shown = stdout(&test_folder.sweep(&["show", MAP]));
    assert!(shown.contains("design  file list.csv"), "{shown}");
    assert!(shown.contains("axis  unbalance_mass_kg\n"), "{shown}");

    // A shard has every second chunk of 8 rows, or 16 of 32 rows.
    fs::write(test_folder.path("g.toml"), grid(8, 4)).expect("written");
    let part = test_folder.sweep(&["run", "g.toml", "--out", "part.parquet", "--shard", "1/2"]);
    assert_eq!(exit_code(&part), Some(0), "{}", all_output(&part));
    for path in ["part.parquet", "part.parquet.partial"] {
        let shown = stdout(&test_folder.sweep(&["show", path]));
        assert!(shown.contains("unfinished: 16 of 32 points done (50.0 %)"), "{shown}");
        let output = json_output(&test_folder.sweep(&["show", path, "--json"]));
        assert_eq!((&output["points"], &output["points_done"]), (&json!(32), &json!(16)));
    }
    for words in [
        &["show", "part.parquet", "--top", "3"][..],
        &["report", "part.parquet"],
        &["require", "part.parquet", "ratio_max < 2"],
        &["plot", "part.parquet"],
        &["export", "part.parquet", "part.csv"],
        &["compare", MAP, "part.parquet"],
    ] {
        let refused_output = test_folder.sweep(words);
        assert_eq!(exit_code(&refused_output), Some(2), "{words:?}");
        let text = all_output(&refused_output);
        assert!(text.contains("is not finished: 16 of 32 points done"), "{words:?}: {text}");
    }

    fs::create_dir(test_folder.path("x.parquet.partial")).expect("made");
    let folder = test_folder.sweep(&["show", "x.parquet.partial"]);
    assert!(all_output(&folder).contains("a run that is not finished"), "{}", all_output(&folder));
}

#[test]
fn require_names_the_failing_part_and_the_confidence_of_shares() {
    let test_folder = TestFolder::new(&designed("monte_carlo"));
    let command_output = test_folder.sweep(&["run", "g.toml", "--progress", "none"]);
    assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    let text = "share(unbalance_mass_kg < 0.5) > 0.99 and count(true) == 32";
    let closed = test_folder.sweep(&["require", MAP, text]);
    assert_eq!(exit_code(&closed), Some(4), "{}", all_output(&closed));
    let output = json_output(&test_folder.sweep(&["require", MAP, text, "--json"]));
    let whole_table = &output["expressions"][0];
    let share = whole_table["folded"][0].as_f64().expect("a share");
    let ends = [0, 1].map(|end| whole_table["intervals"][0][end].as_f64().expect("an interval"));
    assert!(ends[0] < share && share < ends[1] && ends[1] - ends[0] < 0.4, "{ends:?}");
    let holds: Vec<&Value> =
        whole_table["parts"].as_array().expect("parts").iter().map(|part| &part["holds"]).collect();
    assert_eq!(holds, [&json!(false), &json!(true)]);
    let text = stdout(&closed);
    assert!(text.contains("95 % confidence"), "{text}");
    assert!(text.contains("       FAILS  share(unbalance_mass_kg < 0.5) > 0.99"), "{text}");
    assert!(text.contains("       holds  count(true) == 32"), "{text}");
    // The share of a grid has no confidence interval.
    let grid = folder_with_map();
    let open = stdout(&grid.sweep(&["require", MAP, "share(unbalance_mass_kg < 0.5) > 0"]));
    assert!(!open.contains("confidence"), "{open}");
}

#[test]
fn plot_suggests_the_nearest_name_of_a_quantity() {
    let test_folder = folder_with_map();
    let refused_output = test_folder.sweep(&["plot", MAP, "--quantity", "ratio_mx"]);
    assert_eq!(exit_code(&refused_output), Some(2));
    assert!(
        all_output(&refused_output).contains("is `ratio_max` meant?"),
        "{}",
        all_output(&refused_output)
    );
}

#[test]
fn figures_show_the_constants_of_set() {
    let test_folder = folder_with_map();
    let light = ["run", "g.toml", "--set", "tub_mass_kg=20", "--set", "channels=tub_yaw"];
    let command_output =
        test_folder.sweep(&[&light[..], &["--name", "light", "--progress", "none"]].concat());
    assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    let plot_output = test_folder.sweep(&["plot", "results/light.parquet", "-o", "light.svg"]);
    assert_eq!(exit_code(&plot_output), Some(0), "{}", all_output(&plot_output));
    let figure = fs::read_to_string(test_folder.path("light.svg")).expect("a figure");
    assert!(figure.contains("tub_mass_kg = 20") && figure.contains("channels = tub_yaw"));
}

#[test]
fn the_size_of_a_small_result_is_that_of_check() {
    let test_folder = folder_with_map();
    let checked = all_output(&test_folder.sweep(&["check", "g.toml"]));
    let end = checked.find(" kB for the result").expect("a size in kB");
    let most = checked[..end].rsplit(' ').next().and_then(|kb| kb.parse::<f64>().ok());
    let most = most.expect("a number") * 1e3;
    let bytes = fs::metadata(test_folder.path(MAP)).expect("a result").len() as f64;
    assert!(bytes <= most && most < 2.0 * bytes, "{bytes} of {most}: {checked}");
}

/// Returns a grid file with a design over two parameters.
fn designed(method: &str) -> String {
    format!(
        "name = \"short\"\n\
         spin = {{ profile = \"triangular\", peak_rpm = 350, ramp_s = 50 }}\n\
         time = {{ end_s = 0.1 }}\n\
         integrator = {{ method = \"rk4\" }}\n\
         design = {{ method = \"{method}\", points = 32 }}\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nrange = {{ from = 0.1, to = 1.0 }}\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nrange = {{ from = 60, to = 300 }}\n"
    )
}

#[test]
fn run_recommends_a_figure_that_can_be_drawn_for_a_design() {
    for method in ["latin_hypercube", "sobol", "monte_carlo"] {
        let test_folder = TestFolder::new(&designed(method));
        let command_output = test_folder.sweep(&["run", "g.toml", "--progress", "none"]);
        assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
        let text = all_output(&command_output);
        assert!(text.contains("share  ") && text.contains("next  sweep plot "), "{text}");
        let next = test_folder.sweep(&["plot", MAP]);
        assert_eq!(exit_code(&next), Some(0), "{}", all_output(&next));
        for (view, expected) in [
            ("scatter", "Greatest ratio"),
            ("histogram", "% confidence"),
            ("influence", "Rank correlation (Spearman)"),
        ] {
            for name in ["a.svg", "a.png", "a.html"] {
                let plot_output = test_folder.sweep(&["plot", MAP, "--view", view, "-o", name]);
                assert_eq!(exit_code(&plot_output), Some(0), "{}", all_output(&plot_output));
            }
            let figure = fs::read_to_string(test_folder.path("a.svg")).expect("a figure");
            assert!(figure.contains(expected), "{method}, {view}");
        }
    }
    let test_folder = folder_with_map();
    let refused_output = test_folder.sweep(&["plot", MAP, "--view", "influence", "-o", "a.svg"]);
    assert_eq!(exit_code(&refused_output), Some(2));
    assert!(
        all_output(&refused_output).contains("`--view` is for designs"),
        "{}",
        all_output(&refused_output)
    );
}

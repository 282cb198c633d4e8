//! Tests of the commands that work on a finished map: `require`, `compare`, `export`, rows of
//! `show`, `trace --point`; and of `--set` for the scalars of a grid file.

use std::fs::{self, File};
use std::process::Output;
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, RecordBatch};
use serde_json::{Value, json};
use sweep_files::Writer;

use crate::test_folder::{TestFolder, all_output, grid_text};

/// Returns a folder with a finished map of six points, `results/short.parquet`.
fn folder_with_map() -> TestFolder {
    let test_folder = TestFolder::new(&grid_text(3, 2));
    let command_output = test_folder.run_sweep(&["run", "g.toml", "--progress", "none"]);
    assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
    test_folder
}

const MAP_FILE: &str = "results/short.parquet";

fn exit_code(output: &Output) -> Option<i32> {
    output.status.code()
}

fn stdout_text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn json_output(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| {
        panic!("{error} in {}\n{}", stdout_text(output), all_output(output));
    })
}

#[test]
fn report_does_not_overwrite_a_page_of_plot_and_takes_an_option_for_each_expression() {
    let test_folder = folder_with_map();
    let plot_page = "results/short.html";
    assert_eq!(exit_code(&test_folder.run_sweep(&["plot", MAP_FILE, "-o", plot_page])), Some(0));
    let page_bytes_before = fs::read(test_folder.path(plot_page)).unwrap();
    let written_output = test_folder.run_sweep(&["report", MAP_FILE]);
    assert_eq!(exit_code(&written_output), Some(0), "{}", all_output(&written_output));
    assert!(fs::read(test_folder.path(plot_page)).unwrap() == page_bytes_before);
    assert!(test_folder.path("results/short.report.html").exists());
    let failed_report =
        test_folder.run_sweep(&["report", MAP_FILE, "--require", "count(point >= 0) < 0"]);
    assert_eq!(exit_code(&failed_report), Some(4), "{}", all_output(&failed_report));
    assert!(all_output(&failed_report).contains("FAILS  count(point >= 0) < 0: 6\n"));
    let refused_output =
        test_folder.run_sweep(&["report", MAP_FILE, "--require", "point >= 0", "point < 9"]);
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
    let passed_gate = test_folder.run_sweep(&[
        "require",
        MAP_FILE,
        "ratio_max < 1e6",
        "count(status == 'ok') == 6",
    ]);
    assert_eq!(exit_code(&passed_gate), Some(0), "{}", all_output(&passed_gate));
    assert!(
        all_output(&passed_gate).contains("holds  ratio_max < 1e6: 6 rows"),
        "{}",
        all_output(&passed_gate)
    );

    let failed_gate = test_folder.run_sweep(&[
        "require",
        MAP_FILE,
        "unbalance_mass_kg < 0.9",
        "share(reliable) >= 0",
    ]);
    assert_eq!(exit_code(&failed_gate), Some(4));
    let gate_text = all_output(&failed_gate);
    assert!(gate_text.contains("FAILS  unbalance_mass_kg < 0.9: 2 of 6 rows false"), "{gate_text}");
    assert!(gate_text.contains("holds  share(reliable) >= 0"), "{gate_text}");

    let gate_json =
        json_output(&test_folder.run_sweep(&["require", MAP_FILE, "point < 2", "--json"]));
    assert_eq!(gate_json["holds"], false);
    assert_eq!(gate_json["expressions"][0]["failing"], 4);
    assert_eq!(gate_json["expressions"][0]["offenders"][0]["row"], 2);

    let empty_selection =
        test_folder.run_sweep(&["require", MAP_FILE, "reliable", "--where", "false"]);
    assert_eq!(exit_code(&empty_selection), Some(4));
    assert!(all_output(&empty_selection).contains("no row"), "{}", all_output(&empty_selection));
}

#[test]
fn only_results_go_to_standard_output() {
    let test_folder = folder_with_map();
    for command_words in [
        &["check", "g.toml"][..],
        &["status", "g.toml"],
        &["show", MAP_FILE],
        &["require", MAP_FILE, "point < 2"],
        &["compare", MAP_FILE, MAP_FILE],
        &["modes", "--speed", "0:300:100"],
    ] {
        let command_output = test_folder.run_sweep(command_words);
        assert!(
            command_output.stdout.len() > 40 && command_output.stderr.is_empty(),
            "{command_words:?}: {}",
            all_output(&command_output)
        );
    }
    for command_words in [&["run", "g.toml"][..], &["plot", MAP_FILE]] {
        let command_output = test_folder.run_sweep(command_words);
        assert!(
            command_output.stdout.is_empty() && !command_output.stderr.is_empty(),
            "{command_words:?}: {}",
            all_output(&command_output)
        );
    }
}

/// Writes a result of 400 rows, one for each mass, with the ratio that a function returns for the
/// row's index.
fn write_ratios(test_folder: &TestFolder, name: &str, ratio: impl Fn(u32) -> Option<f64>) {
    let number_array = |value: &dyn Fn(u32) -> Option<f64>| -> ArrayRef {
        Arc::new((0..400).map(value).collect::<Float64Array>())
    };
    let columns = [
        ("unbalance_mass_kg", number_array(&|row_index| Some(0.01 * f64::from(row_index)))),
        ("nonlinear_tub_yaw", number_array(&ratio)),
        ("ratio_max", number_array(&ratio)),
        ("min_gap_nonlinear_m", number_array(&|row_index| Some(0.01 * ratio(row_index)?))),
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
    let test_folder = TestFolder::new(&grid_text(1, 1));
    write_ratios(&test_folder, "whole.parquet", |_| Some(1.5));
    write_ratios(&test_folder, "half.parquet", |row| (row % 2 == 0).then_some(1.5));
    write_ratios(&test_folder, "nan.parquet", |_| Some(f64::NAN));
    for (file, null_row_count) in [("half.parquet", 200), ("nan.parquet", 0)] {
        for condition in
            ["max(ratio_max)<2", "mean(ratio_max)<2", "min(ratio_max)>1", "count(ratio_max>=2)==0"]
        {
            let failed_gate = test_folder.run_sweep(&["require", file, condition]);
            assert_eq!(exit_code(&failed_gate), Some(4), "{file}: {condition}");
            let expected_text = format!("over {null_row_count} of 400 rows");
            assert!(
                all_output(&failed_gate).contains(&expected_text),
                "{}",
                all_output(&failed_gate)
            );
        }
        for gate_option in ["ratio=0.05", "gap=0.001"] {
            let failed_gate = test_folder.run_sweep(&[
                "compare",
                "whole.parquet",
                file,
                "--fail-on",
                gate_option,
            ]);
            assert_eq!(
                exit_code(&failed_gate),
                Some(4),
                "{file}: {gate_option}\n{}",
                stdout_text(&failed_gate)
            );
            let self_comparison =
                test_folder.run_sweep(&["compare", file, file, "--fail-on", gate_option]);
            assert_eq!(
                exit_code(&self_comparison),
                Some(0),
                "{file}: {gate_option}\n{}",
                stdout_text(&self_comparison)
            );
        }
    }
    let allowed_output =
        test_folder.run_sweep(&["require", "half.parquet", "max(ratio_max)<2", "--allow-null"]);
    assert_eq!(exit_code(&allowed_output), Some(0), "{}", all_output(&allowed_output));
    let comparison_words = ["compare", "half.parquet", "half.parquet", "--fail-on", "flips"];
    let missing_verdict_output = test_folder.run_sweep(&comparison_words);
    assert_eq!(
        exit_code(&missing_verdict_output),
        Some(2),
        "{}",
        all_output(&missing_verdict_output)
    );
    assert!(
        all_output(&missing_verdict_output).contains("two files with verdicts"),
        "{}",
        all_output(&missing_verdict_output)
    );
}

#[test]
fn all_mistakes_in_conditions_are_reported() {
    let test_folder = folder_with_map();
    let refused_output =
        test_folder.run_sweep(&["require", MAP_FILE, "ratio_mx < 2", "reliable = true"]);
    assert_eq!(exit_code(&refused_output), Some(2));
    let text = all_output(&refused_output);
    assert!(text.contains("did you mean `ratio_max`?") && text.contains("expected `==`"), "{text}");
    let misplaced_aggregate_output =
        test_folder.run_sweep(&["require", MAP_FILE, "reliable", "--where", "max(ratio_max) > 2"]);
    assert_eq!(
        exit_code(&misplaced_aggregate_output),
        Some(2),
        "{}",
        all_output(&misplaced_aggregate_output)
    );
    let absent_output = test_folder.run_sweep(&["require", "no.parquet", "reliable"]);
    assert_eq!(exit_code(&absent_output), Some(2), "{}", all_output(&absent_output));
    for invalid_name in ["short.parquet", "resluts/short.parquet", "results/short"] {
        let absent_output = test_folder.run_sweep(&["show", invalid_name]);
        assert!(
            all_output(&absent_output).contains("results/short.parquet is there"),
            "{}",
            all_output(&absent_output)
        );
    }
    let map_as_grid_output = test_folder.run_sweep(&["check", MAP_FILE]);
    assert!(
        all_output(&map_as_grid_output).contains("it is a Parquet file, not text"),
        "{}",
        all_output(&map_as_grid_output)
    );
}

#[test]
fn show_sorts_and_filters_rows_and_prints_json() {
    let test_folder = folder_with_map();
    let top_rows = json_output(&test_folder.run_sweep(&[
        "show",
        MAP_FILE,
        "--top",
        "2",
        "--by",
        "ratio_tub_yaw",
        "--json",
    ]));
    let rows = top_rows.as_array().expect("rows");
    let ratios: Vec<f64> = rows.iter().filter_map(|row| row["ratio_tub_yaw"].as_f64()).collect();
    assert!(ratios.len() == 2 && ratios[0] >= ratios[1], "{top_rows}");
    // The JSON output has every column, and its counts are integers.
    assert!(rows[0]["point"].is_u64() && rows[0]["nonlinear_tub_yaw"].is_f64(), "{top_rows}");
    let whole_table = json_output(&test_folder.run_sweep(&["show", MAP_FILE, "--json"]));
    assert_eq!(whole_table["summary"]["points"], 6);
    assert_eq!(whole_table["plan"]["name"], "short");
    let filtered_output =
        test_folder.run_sweep(&["show", MAP_FILE, "--where", "damping_n_s_per_m > 200"]);
    assert_eq!(
        stdout_text(&filtered_output).lines().count(),
        4,
        "{}",
        stdout_text(&filtered_output)
    );
    let invalid_output = test_folder.run_sweep(&["show", MAP_FILE, "--by", "ratio_tub_yw"]);
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
    let self_comparison =
        test_folder.run_sweep(&["compare", MAP_FILE, MAP_FILE, "--fail-on", "any"]);
    assert_eq!(exit_code(&self_comparison), Some(0), "{}", stdout_text(&self_comparison));
    assert!(
        stdout_text(&self_comparison).contains("not at all"),
        "{}",
        stdout_text(&self_comparison)
    );

    let light_machine_words = ["run", "g.toml", "--set", "tub_mass_kg=20", "--name", "light"];
    let command_output =
        test_folder.run_sweep(&[&light_machine_words[..], &["--progress", "none"]].concat());
    assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    let shown_table = stdout_text(&test_folder.run_sweep(&["show", "results/light.parquet"]));
    assert!(shown_table.contains("--set  tub_mass_kg = 20"), "{shown_table}");

    let comparison_words = ["compare", MAP_FILE, "results/light.parquet"];
    let differing_output = test_folder
        .run_sweep(&[&comparison_words[..], &["--fail-on", "ratio=0", "--json"]].concat());
    assert_eq!(exit_code(&differing_output), Some(4), "{}", all_output(&differing_output));
    let comparison = json_output(&differing_output);
    let changed_paths: Vec<&str> = comparison["plan"]
        .as_array()
        .expect("changes")
        .iter()
        .filter_map(|change| change["path"].as_str())
        .collect();
    assert!(
        changed_paths.contains(&"machine.tub.mass_kg") && changed_paths.contains(&"set"),
        "{changed_paths:?}"
    );
    assert_eq!(comparison["rows"]["in_both"], 6);

    let markdown_table =
        stdout_text(&test_folder.run_sweep(&[&comparison_words[..], &["--markdown"]].concat()));
    assert!(
        markdown_table.starts_with("### `results/light.parquet` compared with"),
        "{markdown_table}"
    );
    let written_output =
        test_folder.run_sweep(&[&comparison_words[..], &["--out", "d.parquet"]].concat());
    assert_eq!(exit_code(&written_output), Some(0), "{}", all_output(&written_output));
    for (quantity, title) in [
        (None, "Greatest ratio of B over that of A"),
        (Some("gap_change_m"), "Least gap of the nonlinear model in B less that in A"),
        (Some("ratio_max_b"), "Greatest ratio of B"),
    ] {
        let quantity_option = quantity.map(|column| ["--quantity", column]);
        let plot_options =
            quantity_option.as_ref().map_or(&[][..], |quantity_option| quantity_option);
        let plot_output =
            test_folder.run_sweep(&[&["plot", "d.parquet", "-o", "d.svg"], plot_options].concat());
        assert_eq!(exit_code(&plot_output), Some(0), "{}", all_output(&plot_output));
        let figure = fs::read_to_string(test_folder.path("d.svg")).expect("it was drawn");
        assert!(figure.contains(&format!(">{title}<")), "{quantity:?}");
        // Files of differences do not store the limits of both maps, so that no boundary is drawn.
        assert!(!figure.contains("boundary: "), "{quantity:?}");
    }
    let comparison_json = json_output(&test_folder.run_sweep(&["show", "d.parquet", "--json"]));
    let columns = comparison_json["columns"].as_array().expect("a list").iter();
    let worse_directions: Vec<_> = columns.filter_map(|column| column["worse"].as_str()).collect();
    assert_eq!(worse_directions, ["greater", "less"], "of the ratio's change and of the gap's");
    let refused_output = test_folder.run_sweep(&["compare", MAP_FILE, "d.parquet"]);
    assert_eq!(exit_code(&refused_output), Some(2), "{}", all_output(&refused_output));
}

#[test]
fn compare_matches_points_of_tolerances_about_other_numbers() {
    let tolerance_axis = |parameter: &str| {
        format!("[[axis]]\nparameter = \"{parameter}\"\ntolerance = \"5 %\"\ncount = 2\n")
    };
    let plain_grid = grid_text(3, 2);
    let grid_head = plain_grid.split("[[axis]]").next().expect("the keys before the axes");
    let axis_text = tolerance_axis("tub_mass_kg") + &tolerance_axis("damping_n_s_per_m");
    let test_folder = TestFolder::new(&format!("{grid_head}{axis_text}"));
    for (name, mass) in [("a", "20"), ("b", "24")] {
        let mass_section = format!("[set]\ntub_mass_kg = {mass}\n");
        fs::write(test_folder.path("g.toml"), format!("{grid_head}{mass_section}{axis_text}"))
            .expect("written");
        let command_output =
            test_folder.run_sweep(&["run", "g.toml", "--name", name, "--progress", "none"]);
        assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    }
    let comparison_words =
        ["compare", "results/a.parquet", "results/b.parquet", "--fail-on", "rows"];
    let compare_output = test_folder.run_sweep(&comparison_words);
    assert_eq!(exit_code(&compare_output), Some(0), "{}", all_output(&compare_output));
    let comparison_text = stdout_text(&compare_output);
    assert!(
        comparison_text.contains("4 in both")
            && comparison_text.contains("rows are matched by point"),
        "{comparison_text}"
    );
    let comparison =
        json_output(&test_folder.run_sweep(&[&comparison_words[..], &["--json"]].concat()));
    assert_eq!(
        (&comparison["matched_by"], &comparison["rows"]["in_both"]),
        (&"point".into(), &4.into())
    );
    assert_eq!(comparison["overridden"].as_array().map(Vec::len), Some(0));
}

#[test]
fn compare_names_differences_that_an_axis_overrides() {
    let stiffness_axis =
        "[[axis]]\nparameter = \"spring_1_stiffness_n_per_m\"\nvalues = [7e3, 9e3]\n";
    let plain_grid = grid_text(3, 2);
    let grid_head = plain_grid.split("[[axis]]").next().expect("the keys before the axes");
    let test_folder = TestFolder::new(&format!("{grid_head}{stiffness_axis}"));
    for (name, stiffness_section) in [("a", ""), ("b", "[set]\nspring_stiffness_n_per_m = 9e3\n")] {
        fs::write(
            test_folder.path("g.toml"),
            format!("{grid_head}{stiffness_section}{stiffness_axis}"),
        )
        .expect("written");
        let command_output =
            test_folder.run_sweep(&["run", "g.toml", "--name", name, "--progress", "none"]);
        assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    }
    let comparison_words = ["compare", "results/a.parquet", "results/b.parquet"];
    let comparison_text = stdout_text(&test_folder.run_sweep(&comparison_words));
    let expected_text = "overridden  machine.springs.1.stiffness_n_per_m: the axis \
                spring_1_stiffness_n_per_m sets this in both, so that the change does not show";
    assert!(comparison_text.contains(expected_text), "{comparison_text}");
    let comparison =
        json_output(&test_folder.run_sweep(&[&comparison_words[..], &["--json"]].concat()));
    // Only spring 1 is overridden: the other springs differ between the maps.
    let overridden_paths = &comparison["overridden"][0]["paths"];
    assert_eq!(overridden_paths.as_array().map(Vec::len), Some(1), "{overridden_paths}");
    let markdown_table =
        stdout_text(&test_folder.run_sweep(&[&comparison_words[..], &["--markdown"]].concat()));
    assert!(markdown_table.contains("- overridden: machine.springs.1"), "{markdown_table}");
}

#[test]
fn compare_can_limit_the_difference_of_any_column() {
    let test_folder = folder_with_map();
    let light_machine_words =
        ["run", "g.toml", "--set", "tub_mass_kg=20", "--out", "light.parquet"];
    let command_output = test_folder.run_sweep(&light_machine_words);
    assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    let run_comparison = |gate: &str| {
        test_folder.run_sweep(&["compare", MAP_FILE, "light.parquet", "--fail-on", gate])
    };
    assert_eq!(exit_code(&run_comparison("nonlinear_tub_yaw=1e9")), Some(0));
    let failed_gate = run_comparison("nonlinear_tub_yaw=0");
    assert_eq!(exit_code(&failed_gate), Some(4), "{}", all_output(&failed_gate));
    let gate_text = stdout_text(&failed_gate);
    assert!(gate_text.contains("--fail-on: nonlinear_tub_yaw changed by up to "), "{gate_text}");
    assert!(gate_text.contains("greatest changes of nonlinear_tub_yaw, rad"), "{gate_text}");
    for unsuitable_gate in ["nonlinear_tub_yow=1", "unbalance_mass_kg=1", "status=1"] {
        let refused_output = run_comparison(unsuitable_gate);
        assert_eq!(exit_code(&refused_output), Some(2), "{unsuitable_gate}");
        assert!(
            all_output(&refused_output).contains("a column of numbers in both files"),
            "{unsuitable_gate}"
        );
    }
}

#[test]
fn compare_shows_both_ratios_of_a_changed_verdict() {
    let test_folder = TestFolder::new(&grid_text(3, 2));
    for (name, ratio_min_option, mass) in [("a", "ratio_min=0.5", "20"), ("b", "ratio_min=1", "22")]
    {
        let mass_option = format!("tub_mass_kg={mass}");
        let run_words =
            ["run", "g.toml", "--name", name, "--set", ratio_min_option, "--set", &mass_option];
        let command_output =
            test_folder.run_sweep(&[&run_words[..], &["--progress", "none"]].concat());
        assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    }
    let comparison_text =
        stdout_text(&test_folder.run_sweep(&["compare", "results/a.parquet", "results/b.parquet"]));
    let flipped_verdicts = comparison_text.split("verdicts that flipped").nth(1).expect("some");
    let flipped_row = flipped_verdicts.lines().nth(2).expect("a row");
    assert_eq!(flipped_row.matches(" to ").count(), 2, "{comparison_text}");
    assert!(
        flipped_row.contains(" reliable") && flipped_row.ends_with(" not"),
        "{comparison_text}"
    );
}

#[test]
fn trace_says_which_limit_is_violated() {
    let test_folder = TestFolder::new(&grid_text(3, 2));
    let trace_summary = |set_options: &[&str]| {
        let trace_words = ["trace", "g.toml", "--point", "1", "--out", "t.parquet"];
        all_output(&test_folder.run_sweep(&[&trace_words[..], set_options].concat()))
    };
    let high_ratio_summary = trace_summary(&[]);
    assert!(
        high_ratio_summary.contains("the greatest ratio is ")
            && high_ratio_summary.contains("the limit 2"),
        "{high_ratio_summary}"
    );
    // The ratios of so short a run are almost 1, and one of this point is less.
    let low_ratio_summary = trace_summary(&["--set", "ratio_min=1"]);
    let expected_text = "not reliable: the least ratio is 1 (tub_yaw), the limit 1";
    assert!(low_ratio_summary.contains(expected_text), "{low_ratio_summary}");
}

#[test]
fn a_report_describes_quantities_and_both_limits() {
    let grid = grid_text(3, 2).replace("ratio_limit = 2.0", "ratio_limit = 2.0\nratio_min = 0.999");
    let test_folder =
        TestFolder::new(&format!("metrics = [\"damper_speed\", \"static_sag\"]\n{grid}"));
    let set_options = ["--set", "spin_ramp_s=0.05", "--set", "damper_1_friction_n=3"];
    let command_output = test_folder
        .run_sweep(&[&["run", "g.toml", "--progress", "none"], &set_options[..]].concat());
    assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    let written_output = test_folder.run_sweep(&["report", MAP_FILE, "-o", "r.html"]);
    assert_eq!(exit_code(&written_output), Some(0), "{}", all_output(&written_output));
    let page = fs::read_to_string(test_folder.path("r.html")).expect("it was written");
    for page_text in [
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
        assert!(page.contains(page_text), "{page_text}");
    }
    assert_eq!(page.matches(">Tub front, vertical<").count(), 1, "of the nonlinear model alone");
    // The page does not say where numbers come from, not even those that `--set` gave.
    assert!(!page.contains("assumed") && page.contains("sweep parameters"), "where from");
    // The column of all dampers replaces the columns of single dampers. Numbers and units are
    // joined by spaces at which lines do not break.
    assert!(!page.contains("Damper 1 speed"), "numbered");
    assert!(page.contains("\u{a0}N\u{a0}s/m") && page.contains("\u{a0}m/s"), "units");
}

#[test]
fn exports_overwrite_only_files_of_the_same_kind() {
    let test_folder = folder_with_map();
    for (name, magic_bytes) in [("m.csv", &b"# exported by sweep "[..]), ("m.xlsx", b"PK\x03\x04")]
    {
        for _ in 0..2 {
            let command_output = test_folder.run_sweep(&["export", MAP_FILE, name]);
            assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
        }
        let export_bytes = fs::read(test_folder.path(name)).expect("the export is there");
        assert!(export_bytes.starts_with(magic_bytes), "{name}");
    }
    // The output may be an option, as with every other command.
    assert_eq!(exit_code(&test_folder.run_sweep(&["export", MAP_FILE, "--out", "o.csv"])), Some(0));
    let export_bytes = |name| fs::read(test_folder.path(name)).expect("the export is there");
    assert_eq!(export_bytes("o.csv"), export_bytes("m.csv"));
    assert_eq!(
        exit_code(&test_folder.run_sweep(&["export", MAP_FILE, "p.csv", "-o", "q.csv"])),
        Some(2)
    );
    assert_eq!(exit_code(&test_folder.run_sweep(&["export", MAP_FILE])), Some(2));
    fs::write(test_folder.path("mine.csv"), "my,own\n1,2\n").expect("written");
    assert_eq!(exit_code(&test_folder.run_sweep(&["export", MAP_FILE, "mine.csv"])), Some(2));
    assert_eq!(exit_code(&test_folder.run_sweep(&["export", MAP_FILE, "m.ods"])), Some(2));
}

#[test]
#[cfg(unix)]
fn a_refused_temporary_file_of_an_export_is_a_failure_of_the_system() {
    let test_folder = folder_with_map();
    let mut command = test_folder.command_under(&[]);
    command.args(["export", MAP_FILE, "m.xlsx"]).env("TMPDIR", test_folder.path("missing"));
    let refused_output = command.output().expect("the command starts");
    assert_eq!(exit_code(&refused_output), Some(1), "{}", all_output(&refused_output));
    let error_text = all_output(&refused_output);
    assert!(error_text.contains("cannot write a temporary file to export"), "{error_text}");
}

#[test]
fn trace_selects_a_point_by_number_or_the_worst_one() {
    let test_folder = folder_with_map();
    let trace_output =
        test_folder.run_sweep(&["trace", "g.toml", "--point", "3", "--out", "t.parquet"]);
    assert_eq!(exit_code(&trace_output), Some(0), "{}", all_output(&trace_output));
    let row_json =
        json_output(&test_folder.run_sweep(&["show", MAP_FILE, "--where", "point == 3", "--json"]));
    let ratio = row_json[0]["ratio_max"].as_f64().expect("a ratio");
    let trace_text = all_output(&trace_output);
    assert!(
        trace_text.contains("verdict  ") && trace_text.contains(&format!("{ratio:.4}")[..5]),
        "{trace_text}"
    );

    let worst_trace_output =
        test_folder.run_sweep(&["trace", "g.toml", "--worst", "--out", "t.parquet"]);
    assert_eq!(exit_code(&worst_trace_output), Some(0), "{}", all_output(&worst_trace_output));
    let worst_row = json_output(&test_folder.run_sweep(&[
        "show",
        MAP_FILE,
        "--top",
        "1",
        "--by",
        "ratio_max",
        "--json",
    ]));
    let expected_text = format!("point {} is where ratio_max is greatest", worst_row[0]["point"]);
    assert!(
        all_output(&worst_trace_output).contains(&expected_text),
        "{expected_text}: {}",
        all_output(&worst_trace_output)
    );

    let out_of_range_output =
        test_folder.run_sweep(&["trace", "g.toml", "--point", "6", "--out", "t.parquet"]);
    assert_eq!(exit_code(&out_of_range_output), Some(2));
    assert!(
        all_output(&out_of_range_output).contains("from 0 to 5"),
        "{}",
        all_output(&out_of_range_output)
    );
    let other_grid_words =
        ["trace", "g.toml", "--worst", "--set", "tub_mass_kg=20", "--out", "t.parquet"];
    let other_grid_output = test_folder.run_sweep(&other_grid_words);
    assert_eq!(exit_code(&other_grid_output), Some(2));
    assert!(
        all_output(&other_grid_output).contains("of this very grid"),
        "{}",
        all_output(&other_grid_output)
    );
}

#[test]
fn every_scalar_of_the_grid_file_can_be_set() {
    let test_folder = TestFolder::new(&grid_text(3, 2));
    let check_plan = |set_options: &[&str]| {
        json_output(&test_folder.run_sweep(&[&["check", "g.toml", "--json"], set_options].concat()))
    };
    let set_plan =
        check_plan(&["--set", "end_s=0.2", "--ratio-limit", "1.5", "--set", "step_s=1e-4"]);
    assert_eq!(set_plan["time"]["end_s"], 0.2);
    assert_eq!(set_plan["reliability"]["ratio_limit"], 1.5);
    assert_eq!(set_plan["integrator"]["step_s"], 1e-4);
    assert_eq!(set_plan["set"]["ratio_limit"], 1.5);
    let method_plan =
        check_plan(&["--set", "method=dopri5", "--set", "rtol=1e-5", "--set", "criterion=rms"]);
    assert_eq!(method_plan["integrator"]["rtol"], 1e-5);
    assert_eq!(method_plan["reliability"]["criterion"], "rms");
    assert!(check_plan(&[])["set"].is_null(), "a plan without --set reads as ever");
    let named_words = ["--set", "profile=ramp", "--set", "channels=tub_yaw, tub_pitch"];
    let named_plan =
        check_plan(&[&named_words[..], &["--set", "metrics=static_sag,clash_time"]].concat());
    assert_eq!(named_plan["spin"]["profile"], "ramp");
    assert_eq!(named_plan["spin"]["peak_rpm"], check_plan(&[])["spin"]["peak_rpm"]);
    assert_eq!(named_plan["reliability"]["channels"], json!(["tub_yaw", "tub_pitch"]));
    assert_eq!(named_plan["metrics"], json!(["static_sag", "clash_time"]));
    assert_eq!(named_plan["set"]["metrics"], "static_sag,clash_time");
    for (set_options, expected_text) in [
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
        let refused_output =
            test_folder.run_sweep(&[&["check", "g.toml"], &set_options[..]].concat());
        assert_eq!(
            exit_code(&refused_output),
            Some(2),
            "{set_options:?}: {}",
            all_output(&refused_output)
        );
        assert!(
            all_output(&refused_output).contains(expected_text),
            "{set_options:?}: {}",
            all_output(&refused_output)
        );
    }
}

#[test]
fn show_describes_lists_and_unfinished_runs() {
    let test_folder = TestFolder::new(&grid_text(3, 2));
    fs::write(test_folder.path("list.csv"), "unbalance_mass_kg\n0.1\n0.2\n").expect("written");
    let list_grid = "name = \"short\"\n\
        spin = { profile = \"triangular\", peak_rpm = 350, ramp_s = 50 }\n\
        time = { end_s = 0.1 }\n\
        integrator = { method = \"rk4\" }\n\
        design = { method = \"list\", file = \"list.csv\" }\n";
    fs::write(test_folder.path("list.toml"), list_grid).expect("written");
    let command_output = test_folder.run_sweep(&["run", "list.toml", "--progress", "none"]);
    assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    let shown_table = stdout_text(&test_folder.run_sweep(&["show", MAP_FILE]));
    assert!(shown_table.contains("design  file list.csv"), "{shown_table}");
    assert!(shown_table.contains("axis  unbalance_mass_kg\n"), "{shown_table}");

    // The shard 1/2 has every second chunk of 8 rows, which are 16 of the 32 rows.
    fs::write(test_folder.path("g.toml"), grid_text(8, 4)).expect("written");
    let shard_output =
        test_folder.run_sweep(&["run", "g.toml", "--out", "part.parquet", "--shard", "1/2"]);
    assert_eq!(exit_code(&shard_output), Some(0), "{}", all_output(&shard_output));
    for result_path in ["part.parquet", "part.parquet.partial"] {
        let shown_table = stdout_text(&test_folder.run_sweep(&["show", result_path]));
        assert!(shown_table.contains("unfinished: 16 of 32 points done (50.0 %)"), "{shown_table}");
        let shown_json = json_output(&test_folder.run_sweep(&["show", result_path, "--json"]));
        assert_eq!((&shown_json["points"], &shown_json["points_done"]), (&json!(32), &json!(16)));
    }
    for words in [
        &["show", "part.parquet", "--top", "3"][..],
        &["report", "part.parquet"],
        &["require", "part.parquet", "ratio_max < 2"],
        &["plot", "part.parquet"],
        &["export", "part.parquet", "part.csv"],
        &["compare", MAP_FILE, "part.parquet"],
    ] {
        let refused_output = test_folder.run_sweep(words);
        assert_eq!(exit_code(&refused_output), Some(2), "{words:?}");
        let text = all_output(&refused_output);
        assert!(text.contains("is not finished: 16 of 32 points done"), "{words:?}: {text}");
    }

    fs::create_dir(test_folder.path("x.parquet.partial")).expect("made");
    let folder_output = test_folder.run_sweep(&["show", "x.parquet.partial"]);
    assert!(
        all_output(&folder_output).contains("a run that is not finished"),
        "{}",
        all_output(&folder_output)
    );
}

#[test]
fn require_names_the_failing_part_and_the_confidence_of_shares() {
    let test_folder = TestFolder::new(&design_grid("monte_carlo"));
    let command_output = test_folder.run_sweep(&["run", "g.toml", "--progress", "none"]);
    assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    let condition = "share(unbalance_mass_kg < 0.5) > 0.99 and count(true) == 32";
    let failed_gate = test_folder.run_sweep(&["require", MAP_FILE, condition]);
    assert_eq!(exit_code(&failed_gate), Some(4), "{}", all_output(&failed_gate));
    let gate_json =
        json_output(&test_folder.run_sweep(&["require", MAP_FILE, condition, "--json"]));
    let expression_json = &gate_json["expressions"][0];
    let share_value = expression_json["folded"][0].as_f64().expect("a share");
    let interval_ends =
        [0, 1].map(|end| expression_json["intervals"][0][end].as_f64().expect("an interval"));
    assert!(
        interval_ends[0] < share_value
            && share_value < interval_ends[1]
            && interval_ends[1] - interval_ends[0] < 0.4,
        "{interval_ends:?}"
    );
    let part_holds: Vec<&Value> = expression_json["parts"]
        .as_array()
        .expect("parts")
        .iter()
        .map(|part| &part["holds"])
        .collect();
    assert_eq!(part_holds, [&json!(false), &json!(true)]);
    let gate_text = stdout_text(&failed_gate);
    assert!(gate_text.contains("95 % confidence"), "{gate_text}");
    assert!(
        gate_text.contains("       FAILS  share(unbalance_mass_kg < 0.5) > 0.99"),
        "{gate_text}"
    );
    assert!(gate_text.contains("       holds  count(true) == 32"), "{gate_text}");
    // The share of a grid has no confidence interval.
    let map_folder = folder_with_map();
    let passed_gate = stdout_text(&map_folder.run_sweep(&[
        "require",
        MAP_FILE,
        "share(unbalance_mass_kg < 0.5) > 0",
    ]));
    assert!(!passed_gate.contains("confidence"), "{passed_gate}");
}

#[test]
fn plot_suggests_the_nearest_name_of_a_quantity() {
    let test_folder = folder_with_map();
    let refused_output = test_folder.run_sweep(&["plot", MAP_FILE, "--quantity", "ratio_mx"]);
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
    let light_machine_words =
        ["run", "g.toml", "--set", "tub_mass_kg=20", "--set", "channels=tub_yaw"];
    let command_output = test_folder.run_sweep(
        &[&light_machine_words[..], &["--name", "light", "--progress", "none"]].concat(),
    );
    assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
    let plot_output = test_folder.run_sweep(&["plot", "results/light.parquet", "-o", "light.svg"]);
    assert_eq!(exit_code(&plot_output), Some(0), "{}", all_output(&plot_output));
    let figure = fs::read_to_string(test_folder.path("light.svg")).expect("a figure");
    assert!(figure.contains("tub_mass_kg = 20") && figure.contains("channels = tub_yaw"));
}

#[test]
fn the_size_of_a_small_result_is_that_of_check() {
    let test_folder = folder_with_map();
    let check_text = all_output(&test_folder.run_sweep(&["check", "g.toml"]));
    let size_end = check_text.find(" kB for the result").expect("a size in kB");
    let estimated_bytes =
        check_text[..size_end].rsplit(' ').next().and_then(|kb| kb.parse::<f64>().ok());
    let estimated_bytes = estimated_bytes.expect("a number") * 1e3;
    let result_bytes = fs::metadata(test_folder.path(MAP_FILE)).expect("a result").len() as f64;
    assert!(
        result_bytes <= estimated_bytes && estimated_bytes < 2.0 * result_bytes,
        "{result_bytes} of {estimated_bytes}: {check_text}"
    );
}

/// Returns a grid file with a design over two parameters.
fn design_grid(method: &str) -> String {
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
        let test_folder = TestFolder::new(&design_grid(method));
        let command_output = test_folder.run_sweep(&["run", "g.toml", "--progress", "none"]);
        assert_eq!(exit_code(&command_output), Some(0), "{}", all_output(&command_output));
        let run_text = all_output(&command_output);
        assert!(
            run_text.contains("share  ") && run_text.contains("next  sweep plot "),
            "{run_text}"
        );
        let plot_output = test_folder.run_sweep(&["plot", MAP_FILE]);
        assert_eq!(exit_code(&plot_output), Some(0), "{}", all_output(&plot_output));
        for (view, expected_text) in [
            ("scatter", "Greatest ratio"),
            ("histogram", "% confidence"),
            ("influence", "Rank correlation (Spearman)"),
        ] {
            for figure_name in ["a.svg", "a.png", "a.html"] {
                let plot_output =
                    test_folder.run_sweep(&["plot", MAP_FILE, "--view", view, "-o", figure_name]);
                assert_eq!(exit_code(&plot_output), Some(0), "{}", all_output(&plot_output));
            }
            let figure = fs::read_to_string(test_folder.path("a.svg")).expect("a figure");
            assert!(figure.contains(expected_text), "{method}, {view}");
        }
    }
    let test_folder = folder_with_map();
    let refused_output =
        test_folder.run_sweep(&["plot", MAP_FILE, "--view", "influence", "-o", "a.svg"]);
    assert_eq!(exit_code(&refused_output), Some(2));
    assert!(
        all_output(&refused_output).contains("`--view` is for designs"),
        "{}",
        all_output(&refused_output)
    );
}

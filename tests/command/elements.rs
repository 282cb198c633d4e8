//! Tests with a machine that has friction, stops and feet: their columns, traces and errors.

#![cfg(unix)]

use std::fs;
use std::path::Path;

use crate::test_folder::{TestFolder, all_output};

const GRID: &str = r#"
machine = "machine.toml"
metrics = ["stop_force", "stop_contact", "foot_load", "slip_margin"]
[set]
stop_1_clearance_m = 0.006
stop_2_clearance_m = 0.006
[spin]
profile = "ramp"
peak_rpm = 350.0
ramp_s = 6.0
[time]
end_s = 7.0
window_s = [0.0, 7.0]
[[axis]]
parameter = "unbalance_mass_kg"
values = [0.05, 1.0]
"#;

fn test_folder(machine: &str) -> TestFolder {
    let test_folder = TestFolder::new(GRID);
    fs::write(test_folder.path("machine.toml"), machine).expect("the folder can be written");
    test_folder
}

fn example() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples/friction.toml");
    fs::read_to_string(path).expect("the example is there")
}

/// Returns a column of a result.
fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines().filter(|line| !line.starts_with('#'));
    let header = lines.next().expect("a header");
    let place = header.split(',').position(|column| column == name).expect("the column is there");
    let value = |row: &str| row.split(',').nth(place).and_then(|value| value.parse().ok());
    lines.map(|row| value(row).expect("a number")).collect()
}

#[test]
fn loads_of_stops_and_feet_are_columns() {
    let test_folder = test_folder(&example());
    let run = test_folder.sweep(&["run", "g.toml", "--out", "map.parquet"]);
    assert!(run.status.success(), "{}", all_output(&run));
    let export = test_folder.sweep(&["export", "map.parquet", "map.csv"]);
    assert!(export.status.success(), "{}", all_output(&export));
    let csv = fs::read_to_string(test_folder.path("map.csv")).expect("it was written");
    let of = |name: &str| column(&csv, name);
    // With a small unbalance the machine reaches no stop and does not slip; with 1 kg it does both.
    let [pushes, contacts] = [of("stop_force_nonlinear_n"), of("stop_contact_nonlinear_s")];
    assert!(pushes[0] < 1.0 && contacts[0] == 0.0, "{pushes:?} N, {contacts:?} s");
    assert!(pushes[1] > 100.0 && contacts[1] > 0.02, "{pushes:?} N, {contacts:?} s");
    let [feet, margins] = [of("foot_load_nonlinear_n"), of("slip_margin_nonlinear_n")];
    assert!(feet[0] > 100.0 && margins[0] > 150.0, "{feet:?} N, {margins:?} N");
    assert!(feet[1] < feet[0] - 50.0 && margins[1] < margins[0] - 50.0, "{feet:?}, {margins:?}");
}

/// Returns the extreme value of a column of a trace.
fn extreme(csv: &str, name: &str, extreme: fn(f64, f64) -> f64) -> f64 {
    column(csv, name).into_iter().reduce(extreme).expect("a trace has instants")
}

#[test]
fn columns_of_stops_and_feet_agree_with_the_trace() {
    let test_folder = test_folder(&example());
    // With a fixed step map and trace have the same trajectory, and every step is an instant.
    let grid = format!("{GRID}[integrator]\nmethod = \"rk4\"\nstep_s = 1e-4\n");
    fs::write(test_folder.path("g.toml"), grid).expect("the grid is written");
    let export_csv = |words: &[&str], file: &str| {
        let command_output =
            test_folder.sweep(&[words, &["--out", &format!("{file}.parquet")]].concat());
        assert!(command_output.status.success(), "{}", all_output(&command_output));
        let [from, to] = ["parquet", "csv"].map(|ending| format!("{file}.{ending}"));
        assert!(test_folder.sweep(&["export", &from, &to]).status.success());
        fs::read_to_string(test_folder.path(&to)).expect("it was written")
    };
    let map = export_csv(&["run", "g.toml"], "map");
    let at = "unbalance_mass_kg=1";
    let trace =
        export_csv(&["trace", "g.toml", "--at", at, "--every", "1e-4", "--forces"], "trace");
    let cell = |name: String| column(&map, &name)[1];
    for model in ["nonlinear", "linear"] {
        let assert_close =
            |what: String, traced_value: f64, recorded_value: f64, tolerance: f64| {
                assert!(
                    (traced_value - recorded_value).abs() < tolerance,
                    "{what}: {traced_value} traced, {recorded_value} in the map"
                );
            };
        let pushes: Vec<f64> = (1..=3).map(|k| cell(format!("stop_{k}_force_{model}_n"))).collect();
        let loads: Vec<f64> = (1..=4).map(|k| cell(format!("foot_{k}_load_{model}_n"))).collect();
        let contacts: Vec<f64> =
            (1..=3).map(|k| cell(format!("stop_{k}_contact_{model}_s"))).collect();
        for (k, push) in (1..).zip(&pushes) {
            let name = format!("stop_{k}_force_{model}_n");
            let traced_value = extreme(&trace, &name, f64::max);
            assert_close(name, traced_value, *push, 2e-3 * push.max(1.0));
        }
        for (k, load) in (1..).zip(&loads) {
            let name = format!("foot_{k}_load_{model}_n");
            assert_close(name.clone(), extreme(&trace, &name, f64::min), *load, 0.5);
        }
        let name = format!("slip_margin_{model}_n");
        assert_close(name.clone(), extreme(&trace, &name, f64::min), cell(name), 0.5);
        let extreme_of_all = |values: &[f64], extreme: fn(f64, f64) -> f64| {
            values.iter().copied().reduce(extreme).expect("there are some")
        };
        assert_eq!(cell(format!("stop_force_{model}_n")), extreme_of_all(&pushes, f64::max));
        assert_eq!(cell(format!("stop_contact_{model}_s")), extreme_of_all(&contacts, f64::max));
        assert_eq!(cell(format!("foot_load_{model}_n")), extreme_of_all(&loads, f64::min));
        let differ = |values: &[f64]| values.windows(2).all(|pair| pair[0] != pair[1]);
        assert!(differ(&pushes) && differ(&loads), "{pushes:?} N, {loads:?} N");
    }
    let contact_s = |k: usize| cell(format!("stop_{k}_contact_nonlinear_s"));
    assert!(contact_s(1) > 0.01 && contact_s(2) > 0.01 && contact_s(1) != contact_s(2));

    let plot_output = |stop: &str| {
        let column = format!("{stop}_force_nonlinear_n");
        test_folder.sweep(&["plot", "map.parquet", "-o", "map.svg", "--quantity", &column])
    };
    assert!(plot_output("stop_2").status.success());
    let picture = fs::read_to_string(test_folder.path("map.svg")).expect("it was written");
    assert!(picture.contains("Stop 2 force"));
    let refused_output = plot_output("stop_4");
    assert_eq!(refused_output.status.code(), Some(2), "{}", all_output(&refused_output));
    assert!(
        all_output(&refused_output).contains("stop_3_force_nonlinear_n"),
        "{}",
        all_output(&refused_output)
    );
    let require_output =
        test_folder.sweep(&["require", "map.parquet", "stop_3_contact_nonlinear_s == 0"]);
    assert_eq!(
        require_output.status.success(),
        contact_s(3) == 0.0,
        "{}",
        all_output(&require_output)
    );
}

#[test]
fn metrics_of_missing_stops_and_feet_are_errors() {
    let text = example();
    let machine_without_stops = text.split("[[stops]]").next().expect("a first part");
    let test_folder = test_folder(machine_without_stops);
    let run = test_folder.sweep(&["run", "g.toml"]);
    assert_eq!(run.status.code(), Some(2), "{}", all_output(&run));
    let messages = all_output(&run);
    for part in ["`stop_force` needs", "`foot_load` needs", "[[stops]]", "[cabinet]"] {
        assert!(messages.contains(part), "{part} is not in {messages}");
    }
}

#[test]
fn feet_that_do_not_support_the_cabinet_are_an_error() {
    let text = example();
    let machine_with_lifted_foot =
        text.replace("centre_m = [0.18, -0.1, 0.0] ", "centre_m = [1.8, -0.1, 0.0] ");
    let two = text.rsplitn(3, "[[feet]]").last().expect("a first part");
    let (before, after) = text.split_once("[cabinet]").expect("a cabinet");
    let (_, feet) = after.split_once("[[feet]]").expect("feet");
    let without = format!("{before}[[feet]]{feet}");
    let machine_on_uneven_feet =
        text.replace("foot_m = [-0.07, -0.45, 0.26]", "foot_m = [-0.07, -0.43, 0.26]");
    for (machine, expected) in [
        (machine_with_lifted_foot.as_str(), "lifts at rest"),
        (machine_on_uneven_feet.as_str(), "foot 3 stands 0.02 m higher than foot 1"),
        (two, "the cabinet stands on 2 feet"),
        (without.as_str(), "feet without a cabinet"),
    ] {
        let run = test_folder(machine).sweep(&["run", "g.toml"]);
        assert_eq!(run.status.code(), Some(2), "{}", all_output(&run));
        assert!(all_output(&run).contains(expected), "{expected} is not in {}", all_output(&run));
    }
}

/// Machines with friction and stops have stability results too, because their laws are smooth.
#[test]
fn machines_with_friction_and_stops_have_responses_and_growth() {
    let test_folder = test_folder(&example());
    let command_output =
        test_folder.sweep(&["stability", "g.toml", "--speed", "240:260:10", "--out", "s.parquet"]);
    assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
    let require_output = test_folder.sweep(&["require", "s.parquet", "count(status == 'ok') > 0"]);
    assert_eq!(require_output.status.code(), Some(0), "{}", all_output(&require_output));
}

#[test]
fn friction_has_the_speed_amplitude_of_the_linear_motion() {
    let test_folder = test_folder(&example());
    let metrics = "metrics=stop_force,damper_speed";
    let run = test_folder.sweep(&["run", "g.toml", "--set", metrics, "--out", "map.parquet"]);
    assert!(run.status.success(), "{}", all_output(&run));
    let summary = all_output(&run);
    assert!(summary.contains("greatest  friction_speed_off 1"), "{summary}");
    assert!(!summary.contains(" above 2"), "{summary}");
    let conditions = ["friction_speed_off >= 1", "friction_speed_off < 1.01"];
    let require_output =
        test_folder.sweep(&[&["require", "map.parquet"][..], &conditions].concat());
    assert_eq!(require_output.status.code(), Some(0), "{}", all_output(&require_output));

    // Traces and modes have the same linear model as the row.
    let at = ["--at", "unbalance_mass_kg=1"];
    let modes = test_folder.sweep(&[&["modes", "g.toml", "--json"][..], &at].concat());
    let modes: serde_json::Value = serde_json::from_slice(&modes.stdout).expect("it is JSON");
    let point =
        test_folder.sweep(&[&["modes", "g.toml", "--out", "modes.parquet"][..], &at].concat());
    assert!(point.status.success(), "{}", all_output(&point));
    test_folder.sweep(&["plot", "modes.parquet", "-o", "modes.svg"]);
    let figure = fs::read_to_string(test_folder.path("modes.svg")).expect("it was drawn");
    assert!(figure.contains("unbalance_mass_kg = 1 "), "a figure shows what was set");
    let export = test_folder.sweep(&["export", "map.parquet", "map.csv"]);
    assert!(export.status.success(), "{}", all_output(&export));
    let csv = fs::read_to_string(test_folder.path("map.csv")).expect("it was written");
    for damper in 1..=2 {
        let row = column(&csv, &format!("damper_{damper}_speed_linear_m_per_s"))[1];
        let linear_speed = &modes["friction_speeds_m_per_s"][format!("damper_{damper}")];
        let speed_ratio = linear_speed.as_f64().expect("a speed") / row;
        assert!((speed_ratio - 1.0).abs() < 0.01, "{linear_speed} for {row} m/s");
    }

    let slow_speed = ["--set", "friction_linear_speed_m_per_s=0.02"];
    let given_output = test_folder
        .sweep(&[&["run", "g.toml", "--out", "given.parquet"], &slow_speed[..]].concat());
    assert!(
        all_output(&given_output).contains("; 1 row above 2\n"),
        "{}",
        all_output(&given_output)
    );
    let shown_text = test_folder.sweep(&["show", "given.parquet"]);
    let shown_text = String::from_utf8_lossy(&shown_text.stdout).into_owned();
    assert!(shown_text.contains("greatest  friction_speed_off "), "{shown_text}");
    assert!(shown_text.contains("; 1 row above 2\n"), "{shown_text}");
}

/// With a given speed amplitude friction may stop the linear model, but not the machine.
#[test]
fn a_given_speed_of_friction_is_compared_with_both_motions() {
    let grid = GRID.replace("values = [0.05, 1.0]", "values = [0.05, 0.52]");
    let test_folder =
        TestFolder::new(&grid.replace("metrics = [", "metrics = [\"damper_speed\", "));
    fs::write(test_folder.path("machine.toml"), example()).expect("the folder can be written");
    let friction_settings = ["friction_n=80", "friction_linear_speed_m_per_s=0.02"];
    let words = [
        "run",
        "g.toml",
        "--out",
        "m.parquet",
        "--set",
        friction_settings[0],
        "--set",
        friction_settings[1],
    ];
    let run = test_folder.sweep(&words);
    assert!(all_output(&run).contains("; 1 row above 2\n"), "{}", all_output(&run));
    let export = test_folder.sweep(&["export", "m.parquet", "m.csv"]);
    assert!(export.status.success(), "{}", all_output(&export));
    let csv = fs::read_to_string(test_folder.path("m.csv")).expect("it was written");
    let factor = |model: &str| {
        let speed = |damper| column(&csv, &format!("damper_{damper}_speed_{model}_m_per_s"))[1];
        let speed_ratio = |damper| speed(damper).max(4.0 * 0.01 / std::f64::consts::PI) / 0.02;
        [speed_ratio(1), speed_ratio(2)]
            .map(|speed_ratio| speed_ratio.max(1.0 / speed_ratio))
            .into_iter()
            .fold(1.0, f64::max)
    };
    assert!(factor("linear") < 2.0 && factor("nonlinear") > 5.0, "{csv}");
    let speed_ratio = column(&csv, "friction_speed_off")[1];
    assert!((speed_ratio / factor("nonlinear") - 1.0).abs() < 1e-12, "{speed_ratio}");
}

#[test]
fn live_pages_exist_for_a_single_axis_and_for_designs() {
    let test_folder = test_folder(&example());
    let write_page = |words: &[&str], map: &str| {
        let run = test_folder.sweep(&[words, &["--out", map]].concat());
        assert!(run.status.success(), "{}", all_output(&run));
        let plot = test_folder.sweep(&["plot", map, "-o", "page.html", "--live"]);
        assert!(plot.status.success(), "{}", all_output(&plot));
        fs::read_to_string(test_folder.path("page.html")).expect("it was written")
    };
    let one_axis = write_page(&["run", "g.toml"], "map.parquet");
    for part in ["\"kind\":\"chart\"", "\"setup\":", "with friction of 50 N", "a cabinet of 35 kg"]
    {
        assert!(one_axis.contains(part), "{part}");
    }
    assert!(!one_axis.contains("built-in machine"));
    let design = GRID.replace("values = [0.05, 1.0]", "range = { from = 0.05, to = 1.0 }");
    let design = format!("{design}[design]\nmethod = \"sobol\"\npoints = 4\n");
    fs::write(test_folder.path("d.toml"), design).expect("the grid is written");
    fs::write(
        test_folder.path("points.csv"),
        "unbalance_mass_kg,friction_n\n0.1,20\n0.3,60\n0.2,50\n",
    )
    .expect("the list is written");
    let (head, _) = GRID.split_once("[[axis]]").expect("an axis");
    let list = format!("{head}[design]\nmethod = \"list\"\nfile = \"points.csv\"\n");
    fs::write(test_folder.path("l.toml"), list).expect("the grid is written");
    // The figure of a design over one parameter has curves.
    for (grid, kind) in [("d.toml", "chart"), ("l.toml", "design")] {
        let text = write_page(&["run", grid], &format!("{grid}.parquet"));
        assert!(text.contains(&format!("\"kind\":\"{kind}\"")), "{grid}");
        let slider =
            "\"axis\":true,\"description\":\"friction of all dampers (F_f)\",\"from\":20.0";
        assert_eq!(text.contains(slider), grid == "l.toml", "{grid}");
        // The range is that of the axis, whose ends no point of the design reaches.
        assert_eq!(text.contains("\"from\":0.05,"), grid == "d.toml", "{grid}");
    }
}

#[test]
fn responses_with_friction_are_followed_through_folds() {
    let test_folder = test_folder(&example());
    let (head, _) = GRID.split_once("[[axis]]").expect("an axis");
    let (_, run) = head.split_once("[spin]").expect("a spin");
    let set_options =
        "machine = \"machine.toml\"\nset = { unbalance_mass_kg = 1.0, friction_n = 60.0 }";
    fs::write(test_folder.path("g.toml"), format!("{set_options}\n[spin]{run}"))
        .expect("the grid is written");
    // The first machine has the defaults. The second has friction that stops the linear model, so
    // that the linear response is no estimate of the nonlinear one.
    for set_words in [&[][..], &["--set", "friction_linear_speed_m_per_s=0.01"]] {
        let options = ["stability", "g.toml", "--speed", "255:256:1", "--fresh", "--out"];
        let stability_output =
            test_folder.sweep(&[&options[..], &["s.parquet"], set_words].concat());
        assert!(stability_output.status.success(), "{}", all_output(&stability_output));
        let shown_text = ["show", "s.parquet", "--columns", "branch,nonlinear_tub_yaw,on_curve"];
        let shown_text =
            String::from_utf8(test_folder.sweep(&shown_text).stdout).expect("it is text");
        let number = |word: &str| word.parse::<f64>().expect("a number");
        let rows = shown_text.lines().skip(1).map(|row| row.split_whitespace().collect::<Vec<_>>());
        let (curve_rows, off_curve_rows): (Vec<_>, Vec<_>) = rows.partition(|row| row[2] == "true");
        let branches: Vec<f64> = curve_rows.iter().map(|row| number(row[0])).collect();
        assert_eq!(branches, [0.0, 1.0, 2.0, 0.0, 1.0, 2.0], "{set_words:?}");
        let has_yaw_within = |rows: &[Vec<&str>], range: std::ops::Range<f64>| {
            rows.iter().all(|row| range.contains(&number(row[1])))
        };
        assert!(has_yaw_within(&curve_rows, 0.045..0.055), "{set_words:?}: {curve_rows:?}");
        // A search from the linear response finds other responses, with half of this yaw.
        assert!(
            has_yaw_within(&off_curve_rows, 0.02..0.03) && !off_curve_rows.is_empty(),
            "{set_words:?}: {off_curve_rows:?}"
        );
    }
}

#[test]
#[ignore = "takes a minute; .ci/run runs it"]
fn growth_with_friction_vanishes_at_the_boundary() {
    let point = "machine = \"paper\"\nmetrics = [\"growth\"]\n[set]\ndamping_n_s_per_m = 20.0\n\
                 [spin]\nprofile = \"ramp\"\npeak_rpm = 350.0\nramp_s = 6.0\n\
                 [time]\nend_s = 6.0\nwindow_s = [3.0, 6.0]\n[stability]\nspeed_rpm = 250\n";
    let axes = "[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.35, 0.4]\n\
                [[axis]]\nparameter = \"friction_n\"\nvalues = [20.0, 40.0]\n";
    let test_folder = TestFolder::new(&format!("{point}{axes}"));
    fs::write(test_folder.path("point.toml"), point).expect("the grid is written");
    let options = ["--quantity", "growth_per_s", "--tolerance", "1", "--out", "b.parquet"];
    let boundary_output = test_folder.sweep(&[&["boundary", "g.toml"], &options[..]].concat());
    assert!(boundary_output.status.success(), "{}", all_output(&boundary_output));
    let show_row = |file: &str, columns: &str| {
        let show_output = test_folder.sweep(&["show", file, "--columns", columns]);
        let text = String::from_utf8(show_output.stdout).expect("it is text");
        let row = text.lines().nth(1).expect("a row").split_whitespace();
        row.map(|word| word.parse::<f64>().expect("a number")).collect::<Vec<_>>()
    };
    let bracket = show_row("b.parquet", "friction_low_n,friction_high_n");
    assert!(bracket[1] - bracket[0] <= 1.0, "{bracket:?}");
    for (friction_n, grows) in [(bracket[0], true), (bracket[1], false)] {
        let set_options = ["unbalance_mass_kg=0.35".to_owned(), format!("friction_n={friction_n}")];
        let set_options =
            ["--set", &set_options[0], "--set", &set_options[1], "--fresh", "--out", "s.parquet"];
        let stability_output = test_folder
            .sweep(&[&["stability", "point.toml", "--speed", "250"], &set_options[..]].concat());
        assert!(stability_output.status.success(), "{}", all_output(&stability_output));
        let growth_per_s = show_row("s.parquet", "growth_per_s")[0];
        assert_eq!(growth_per_s > 0.0, grows, "{growth_per_s} /s at {friction_n} N");
    }
}

#[test]
fn check_reports_a_machine_that_rests_on_a_stop() {
    let test_folder = test_folder(&example());
    let check_output =
        |clearance: &str| all_output(&test_folder.sweep(&["check", "g.toml", "--set", clearance]));
    assert!(!check_output("stop_3_clearance_m=0.04").contains("at rest"));
    let text = check_output("stop_3_clearance_m=0.005");
    assert!(text.contains("stop 3 carries ") && text.contains(" N at rest"), "{text}");
}

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

fn folder_with_machine(machine: &str) -> TestFolder {
    let test_folder = TestFolder::new(GRID);
    fs::write(test_folder.path("machine.toml"), machine).expect("the folder can be written");
    test_folder
}

fn example_machine() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples/friction.toml");
    fs::read_to_string(path).expect("the example is there")
}

/// Returns a column of a result.
fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines().filter(|line| !line.starts_with('#'));
    let header = lines.next().expect("a header");
    let column_index =
        header.split(',').position(|column| column == name).expect("the column is there");
    let cell_value =
        |row: &str| row.split(',').nth(column_index).and_then(|cell_value| cell_value.parse().ok());
    lines.map(|row| cell_value(row).expect("a number")).collect()
}

#[test]
fn loads_of_stops_and_feet_are_columns() {
    let test_folder = folder_with_machine(&example_machine());
    let run_output = test_folder.run_sweep(&["run", "g.toml", "--out", "map.parquet"]);
    assert!(run_output.status.success(), "{}", all_output(&run_output));
    let export_output = test_folder.run_sweep(&["export", "map.parquet", "map.csv"]);
    assert!(export_output.status.success(), "{}", all_output(&export_output));
    let csv = fs::read_to_string(test_folder.path("map.csv")).expect("it was written");
    let map_column = |name: &str| column(&csv, name);
    // With 0.05 kg the tub reaches no stop and the feet do not slip. With 1 kg the tub reaches one,
    // and both the least foot load and the slip margin are smaller.
    let [stop_forces_n, contacts_s] =
        [map_column("stop_force_nonlinear_n"), map_column("stop_contact_nonlinear_s")];
    assert!(
        stop_forces_n[0] < 1.0 && contacts_s[0] == 0.0,
        "{stop_forces_n:?} N, {contacts_s:?} s"
    );
    assert!(
        stop_forces_n[1] > 100.0 && contacts_s[1] > 0.02,
        "{stop_forces_n:?} N, {contacts_s:?} s"
    );
    let [foot_loads_n, slip_margins_n] =
        [map_column("foot_load_nonlinear_n"), map_column("slip_margin_nonlinear_n")];
    assert!(
        foot_loads_n[0] > 100.0 && slip_margins_n[0] > 150.0,
        "{foot_loads_n:?} N, {slip_margins_n:?} N"
    );
    assert!(
        foot_loads_n[1] < foot_loads_n[0] - 50.0 && slip_margins_n[1] < slip_margins_n[0] - 50.0,
        "{foot_loads_n:?}, {slip_margins_n:?}"
    );
}

/// Returns the extreme value of a column of a trace.
fn extreme_value(csv: &str, name: &str, extreme_value: fn(f64, f64) -> f64) -> f64 {
    column(csv, name).into_iter().reduce(extreme_value).expect("a trace has instants")
}

#[test]
fn columns_of_stops_and_feet_agree_with_the_trace() {
    let test_folder = folder_with_machine(&example_machine());
    // With a fixed step map and trace have the same trajectory, and every step is an instant.
    let grid = format!("{GRID}[integrator]\nmethod = \"rk4\"\nstep_s = 1e-4\n");
    fs::write(test_folder.path("g.toml"), grid).expect("the grid is written");
    let command_csv = |words: &[&str], file: &str| {
        let command_output =
            test_folder.run_sweep(&[words, &["--out", &format!("{file}.parquet")]].concat());
        assert!(command_output.status.success(), "{}", all_output(&command_output));
        let [parquet_name, csv_name] = ["parquet", "csv"].map(|ending| format!("{file}.{ending}"));
        assert!(test_folder.run_sweep(&["export", &parquet_name, &csv_name]).status.success());
        fs::read_to_string(test_folder.path(&csv_name)).expect("it was written")
    };
    let map_csv = command_csv(&["run", "g.toml"], "map");
    let point_option = "unbalance_mass_kg=1";
    let trace_csv = command_csv(
        &["trace", "g.toml", "--at", point_option, "--every", "1e-4", "--forces"],
        "trace",
    );
    let map_cell = |name: String| column(&map_csv, &name)[1];
    for model in ["nonlinear", "linear"] {
        let assert_trace_agrees =
            |column_name: String, traced_value: f64, recorded_value: f64, max_difference: f64| {
                assert!(
                    (traced_value - recorded_value).abs() < max_difference,
                    "{column_name}: {traced_value} traced, {recorded_value} in the map"
                );
            };
        let stop_forces_n: Vec<f64> =
            (1..=3).map(|k| map_cell(format!("stop_{k}_force_{model}_n"))).collect();
        let foot_loads_n: Vec<f64> =
            (1..=4).map(|k| map_cell(format!("foot_{k}_load_{model}_n"))).collect();
        let contacts_s: Vec<f64> =
            (1..=3).map(|k| map_cell(format!("stop_{k}_contact_{model}_s"))).collect();
        for (k, force_n) in (1..).zip(&stop_forces_n) {
            let column_name = format!("stop_{k}_force_{model}_n");
            let traced_value = extreme_value(&trace_csv, &column_name, f64::max);
            assert_trace_agrees(column_name, traced_value, *force_n, 2e-3 * force_n.max(1.0));
        }
        for (k, load_n) in (1..).zip(&foot_loads_n) {
            let column_name = format!("foot_{k}_load_{model}_n");
            assert_trace_agrees(
                column_name.clone(),
                extreme_value(&trace_csv, &column_name, f64::min),
                *load_n,
                0.5,
            );
        }
        let column_name = format!("slip_margin_{model}_n");
        assert_trace_agrees(
            column_name.clone(),
            extreme_value(&trace_csv, &column_name, f64::min),
            map_cell(column_name),
            0.5,
        );
        let extreme_of_all = |values: &[f64], extreme: fn(f64, f64) -> f64| {
            values.iter().copied().reduce(extreme).expect("there are some")
        };
        assert_eq!(
            map_cell(format!("stop_force_{model}_n")),
            extreme_of_all(&stop_forces_n, f64::max)
        );
        assert_eq!(
            map_cell(format!("stop_contact_{model}_s")),
            extreme_of_all(&contacts_s, f64::max)
        );
        assert_eq!(
            map_cell(format!("foot_load_{model}_n")),
            extreme_of_all(&foot_loads_n, f64::min)
        );
        let all_differ = |values: &[f64]| values.windows(2).all(|pair| pair[0] != pair[1]);
        assert!(
            all_differ(&stop_forces_n) && all_differ(&foot_loads_n),
            "{stop_forces_n:?} N, {foot_loads_n:?} N"
        );
    }
    let contact_s = |k: usize| map_cell(format!("stop_{k}_contact_nonlinear_s"));
    assert!(contact_s(1) > 0.01 && contact_s(2) > 0.01 && contact_s(1) != contact_s(2));

    let plot_stop_force = |stop: &str| {
        let column = format!("{stop}_force_nonlinear_n");
        test_folder.run_sweep(&["plot", "map.parquet", "-o", "map.svg", "--quantity", &column])
    };
    assert!(plot_stop_force("stop_2").status.success());
    let figure = fs::read_to_string(test_folder.path("map.svg")).expect("it was written");
    assert!(figure.contains("Stop 2 force"));
    let refused_output = plot_stop_force("stop_4");
    assert_eq!(refused_output.status.code(), Some(2), "{}", all_output(&refused_output));
    assert!(
        all_output(&refused_output).contains("stop_3_force_nonlinear_n"),
        "{}",
        all_output(&refused_output)
    );
    let require_output =
        test_folder.run_sweep(&["require", "map.parquet", "stop_3_contact_nonlinear_s == 0"]);
    assert_eq!(
        require_output.status.success(),
        contact_s(3) == 0.0,
        "{}",
        all_output(&require_output)
    );
}

#[test]
fn metrics_of_missing_stops_and_feet_are_errors() {
    let machine_text = example_machine();
    let machine_without_stops = machine_text.split("[[stops]]").next().expect("a first part");
    let test_folder = folder_with_machine(machine_without_stops);
    let run_output = test_folder.run_sweep(&["run", "g.toml"]);
    assert_eq!(run_output.status.code(), Some(2), "{}", all_output(&run_output));
    let messages = all_output(&run_output);
    for message_part in ["`stop_force` needs", "`foot_load` needs", "[[stops]]", "[cabinet]"] {
        assert!(messages.contains(message_part), "{message_part} is not in {messages}");
    }
}

#[test]
fn feet_that_do_not_support_the_cabinet_are_an_error() {
    let machine_text = example_machine();
    let machine_with_lifted_foot =
        machine_text.replace("centre_m = [0.18, -0.1, 0.0] ", "centre_m = [1.8, -0.1, 0.0] ");
    let machine_with_two_feet = machine_text.rsplitn(3, "[[feet]]").last().expect("a first part");
    let (text_before_cabinet, text_after_cabinet) =
        machine_text.split_once("[cabinet]").expect("a cabinet");
    let (_, text_after_first_foot) = text_after_cabinet.split_once("[[feet]]").expect("feet");
    let feet_without_cabinet = format!("{text_before_cabinet}[[feet]]{text_after_first_foot}");
    let machine_on_uneven_feet =
        machine_text.replace("foot_m = [-0.07, -0.45, 0.26]", "foot_m = [-0.07, -0.43, 0.26]");
    for (machine, expected) in [
        (machine_with_lifted_foot.as_str(), "lifts at rest"),
        (machine_on_uneven_feet.as_str(), "foot 3 stands 0.02 m higher than foot 1"),
        (machine_with_two_feet, "the cabinet stands on 2 feet"),
        (feet_without_cabinet.as_str(), "feet without a cabinet"),
    ] {
        let run_output = folder_with_machine(machine).run_sweep(&["run", "g.toml"]);
        assert_eq!(run_output.status.code(), Some(2), "{}", all_output(&run_output));
        assert!(
            all_output(&run_output).contains(expected),
            "{expected} is not in {}",
            all_output(&run_output)
        );
    }
}

/// Machines with friction and stops have stability results too, because their laws are smooth.
#[test]
fn machines_with_friction_and_stops_have_responses_and_growth() {
    let test_folder = folder_with_machine(&example_machine());
    let command_output = test_folder.run_sweep(&[
        "stability",
        "g.toml",
        "--speed",
        "240:260:10",
        "--out",
        "s.parquet",
    ]);
    assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
    let require_output =
        test_folder.run_sweep(&["require", "s.parquet", "count(status == 'ok') > 0"]);
    assert_eq!(require_output.status.code(), Some(0), "{}", all_output(&require_output));
}

#[test]
fn friction_has_the_speed_amplitude_of_the_linear_motion() {
    let test_folder = folder_with_machine(&example_machine());
    let metrics = "metrics=stop_force,damper_speed";
    let run_output =
        test_folder.run_sweep(&["run", "g.toml", "--set", metrics, "--out", "map.parquet"]);
    assert!(run_output.status.success(), "{}", all_output(&run_output));
    let summary = all_output(&run_output);
    assert!(summary.contains("greatest  friction_speed_off 1"), "{summary}");
    assert!(!summary.contains(" above 2"), "{summary}");
    let conditions = ["friction_speed_off >= 1", "friction_speed_off < 1.01"];
    let require_output =
        test_folder.run_sweep(&[&["require", "map.parquet"][..], &conditions].concat());
    assert_eq!(require_output.status.code(), Some(0), "{}", all_output(&require_output));

    // Traces and modes have the same linear model as the row.
    let point_options = ["--at", "unbalance_mass_kg=1"];
    let modes_output =
        test_folder.run_sweep(&[&["modes", "g.toml", "--json"][..], &point_options].concat());
    let modes_json: serde_json::Value =
        serde_json::from_slice(&modes_output.stdout).expect("it is JSON");
    let modes_output = test_folder
        .run_sweep(&[&["modes", "g.toml", "--out", "modes.parquet"][..], &point_options].concat());
    assert!(modes_output.status.success(), "{}", all_output(&modes_output));
    test_folder.run_sweep(&["plot", "modes.parquet", "-o", "modes.svg"]);
    let figure = fs::read_to_string(test_folder.path("modes.svg")).expect("it was drawn");
    assert!(figure.contains("unbalance_mass_kg = 1 "), "a figure shows what was set");
    let export_output = test_folder.run_sweep(&["export", "map.parquet", "map.csv"]);
    assert!(export_output.status.success(), "{}", all_output(&export_output));
    let csv = fs::read_to_string(test_folder.path("map.csv")).expect("it was written");
    for damper in 1..=2 {
        let row_speed_m_per_s = column(&csv, &format!("damper_{damper}_speed_linear_m_per_s"))[1];
        let linear_speed = &modes_json["friction_speeds_m_per_s"][format!("damper_{damper}")];
        let speed_ratio = linear_speed.as_f64().expect("a speed") / row_speed_m_per_s;
        assert!((speed_ratio - 1.0).abs() < 0.01, "{linear_speed} for {row_speed_m_per_s} m/s");
    }

    let speed_option = ["--set", "friction_linear_speed_m_per_s=0.02"];
    let slow_speed_output = test_folder
        .run_sweep(&[&["run", "g.toml", "--out", "given.parquet"], &speed_option[..]].concat());
    assert!(
        all_output(&slow_speed_output).contains("; 1 row above 2\n"),
        "{}",
        all_output(&slow_speed_output)
    );
    let show_output = test_folder.run_sweep(&["show", "given.parquet"]);
    let shown_text = String::from_utf8_lossy(&show_output.stdout).into_owned();
    assert!(shown_text.contains("greatest  friction_speed_off "), "{shown_text}");
    assert!(shown_text.contains("; 1 row above 2\n"), "{shown_text}");
}

/// With a given speed amplitude friction may stop the linear model, but not the machine.
#[test]
fn a_given_speed_of_friction_is_compared_with_both_motions() {
    let grid = GRID.replace("values = [0.05, 1.0]", "values = [0.05, 0.52]");
    let test_folder =
        TestFolder::new(&grid.replace("metrics = [", "metrics = [\"damper_speed\", "));
    fs::write(test_folder.path("machine.toml"), example_machine())
        .expect("the folder can be written");
    let friction_settings = ["friction_n=80", "friction_linear_speed_m_per_s=0.02"];
    let run_words = [
        "run",
        "g.toml",
        "--out",
        "m.parquet",
        "--set",
        friction_settings[0],
        "--set",
        friction_settings[1],
    ];
    let run_output = test_folder.run_sweep(&run_words);
    assert!(all_output(&run_output).contains("; 1 row above 2\n"), "{}", all_output(&run_output));
    let export_output = test_folder.run_sweep(&["export", "m.parquet", "m.csv"]);
    assert!(export_output.status.success(), "{}", all_output(&export_output));
    let csv = fs::read_to_string(test_folder.path("m.csv")).expect("it was written");
    let greatest_speed_factor = |model: &str| {
        let speed_m_per_s =
            |damper| column(&csv, &format!("damper_{damper}_speed_{model}_m_per_s"))[1];
        let speed_ratio =
            |damper| speed_m_per_s(damper).max(4.0 * 0.01 / std::f64::consts::PI) / 0.02;
        [speed_ratio(1), speed_ratio(2)]
            .map(|speed_ratio| speed_ratio.max(1.0 / speed_ratio))
            .into_iter()
            .fold(1.0, f64::max)
    };
    assert!(
        greatest_speed_factor("linear") < 2.0 && greatest_speed_factor("nonlinear") > 5.0,
        "{csv}"
    );
    let speed_ratio = column(&csv, "friction_speed_off")[1];
    assert!(
        (speed_ratio / greatest_speed_factor("nonlinear") - 1.0).abs() < 1e-12,
        "{speed_ratio}"
    );
}

#[test]
fn live_pages_exist_for_a_single_axis_and_for_designs() {
    let test_folder = folder_with_machine(&example_machine());
    let live_page = |words: &[&str], map_file: &str| {
        let run_output = test_folder.run_sweep(&[words, &["--out", map_file]].concat());
        assert!(run_output.status.success(), "{}", all_output(&run_output));
        let plot_output = test_folder.run_sweep(&["plot", map_file, "-o", "page.html", "--live"]);
        assert!(plot_output.status.success(), "{}", all_output(&plot_output));
        fs::read_to_string(test_folder.path("page.html")).expect("it was written")
    };
    let one_axis_page = live_page(&["run", "g.toml"], "map.parquet");
    for page_part in
        ["\"kind\":\"chart\"", "\"setup\":", "with friction of 50 N", "a cabinet of 35 kg"]
    {
        assert!(one_axis_page.contains(page_part), "{page_part}");
    }
    assert!(!one_axis_page.contains("built-in machine"));
    let axes_grid = GRID.replace("values = [0.05, 1.0]", "range = { from = 0.05, to = 1.0 }");
    let design_grid = format!("{axes_grid}[design]\nmethod = \"sobol\"\npoints = 4\n");
    fs::write(test_folder.path("d.toml"), design_grid).expect("the grid is written");
    fs::write(
        test_folder.path("points.csv"),
        "unbalance_mass_kg,friction_n\n0.1,20\n0.3,60\n0.2,50\n",
    )
    .expect("the list is written");
    let (grid_head, _) = GRID.split_once("[[axis]]").expect("an axis");
    let list_grid = format!("{grid_head}[design]\nmethod = \"list\"\nfile = \"points.csv\"\n");
    fs::write(test_folder.path("l.toml"), list_grid).expect("the grid is written");
    // The figure of a design over one parameter has curves.
    for (grid, kind) in [("d.toml", "chart"), ("l.toml", "design")] {
        let page_text = live_page(&["run", grid], &format!("{grid}.parquet"));
        assert!(page_text.contains(&format!("\"kind\":\"{kind}\"")), "{grid}");
        let slider_json =
            "\"axis\":true,\"description\":\"friction of all dampers (F_f)\",\"from\":20.0";
        assert_eq!(page_text.contains(slider_json), grid == "l.toml", "{grid}");
        // The range is that of the axis, whose ends no point of the design reaches.
        assert_eq!(page_text.contains("\"from\":0.05,"), grid == "d.toml", "{grid}");
    }
}

#[test]
fn responses_with_friction_are_followed_through_folds() {
    let test_folder = folder_with_machine(&example_machine());
    let (grid_head, _) = GRID.split_once("[[axis]]").expect("an axis");
    let (_, spin_and_time) = grid_head.split_once("[spin]").expect("a spin");
    let machine_and_set =
        "machine = \"machine.toml\"\nset = { unbalance_mass_kg = 1.0, friction_n = 60.0 }";
    fs::write(test_folder.path("g.toml"), format!("{machine_and_set}\n[spin]{spin_and_time}"))
        .expect("the grid is written");
    // The first machine has the defaults. The second has friction that stops the linear model, so
    // that the linear response is no estimate of the nonlinear one.
    for set_words in [&[][..], &["--set", "friction_linear_speed_m_per_s=0.01"]] {
        let stability_words = ["stability", "g.toml", "--speed", "255:256:1", "--fresh", "--out"];
        let stability_output =
            test_folder.run_sweep(&[&stability_words[..], &["s.parquet"], set_words].concat());
        assert!(stability_output.status.success(), "{}", all_output(&stability_output));
        let show_words = ["show", "s.parquet", "--columns", "branch,nonlinear_tub_yaw,on_curve"];
        let shown_text =
            String::from_utf8(test_folder.run_sweep(&show_words).stdout).expect("it is text");
        let parsed_number = |word: &str| word.parse::<f64>().expect("a number");
        let rows = shown_text.lines().skip(1).map(|row| row.split_whitespace().collect::<Vec<_>>());
        let (curve_rows, off_curve_rows): (Vec<_>, Vec<_>) = rows.partition(|row| row[2] == "true");
        let branches: Vec<f64> = curve_rows.iter().map(|row| parsed_number(row[0])).collect();
        assert_eq!(branches, [0.0, 1.0, 2.0, 0.0, 1.0, 2.0], "{set_words:?}");
        let has_yaw_within = |rows: &[Vec<&str>], range: std::ops::Range<f64>| {
            rows.iter().all(|row| range.contains(&parsed_number(row[1])))
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
    let point_grid = "machine = \"paper\"\nmetrics = [\"growth\"]\n\
                 [set]\ndamping_n_s_per_m = 20.0\n\
                 [spin]\nprofile = \"ramp\"\npeak_rpm = 350.0\nramp_s = 6.0\n\
                 [time]\nend_s = 6.0\nwindow_s = [3.0, 6.0]\n[stability]\nspeed_rpm = 250\n";
    let axes = "[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.35, 0.4]\n\
                [[axis]]\nparameter = \"friction_n\"\nvalues = [20.0, 40.0]\n";
    let test_folder = TestFolder::new(&format!("{point_grid}{axes}"));
    fs::write(test_folder.path("point.toml"), point_grid).expect("the grid is written");
    let boundary_options = ["--quantity", "growth_per_s", "--tolerance", "1", "--out", "b.parquet"];
    let boundary_output =
        test_folder.run_sweep(&[&["boundary", "g.toml"], &boundary_options[..]].concat());
    assert!(boundary_output.status.success(), "{}", all_output(&boundary_output));
    let first_row_numbers = |file: &str, column_list: &str| {
        let show_output = test_folder.run_sweep(&["show", file, "--columns", column_list]);
        let text = String::from_utf8(show_output.stdout).expect("it is text");
        let row_words = text.lines().nth(1).expect("a row").split_whitespace();
        row_words.map(|word| word.parse::<f64>().expect("a number")).collect::<Vec<_>>()
    };
    let bracket = first_row_numbers("b.parquet", "friction_low_n,friction_high_n");
    assert!(bracket[1] - bracket[0] <= 1.0, "{bracket:?}");
    for (friction_n, expects_growth) in [(bracket[0], true), (bracket[1], false)] {
        let set_values = ["unbalance_mass_kg=0.35".to_owned(), format!("friction_n={friction_n}")];
        let set_options =
            ["--set", &set_values[0], "--set", &set_values[1], "--fresh", "--out", "s.parquet"];
        let stability_output = test_folder.run_sweep(
            &[&["stability", "point.toml", "--speed", "250"], &set_options[..]].concat(),
        );
        assert!(stability_output.status.success(), "{}", all_output(&stability_output));
        let growth_per_s = first_row_numbers("s.parquet", "growth_per_s")[0];
        assert_eq!(growth_per_s > 0.0, expects_growth, "{growth_per_s} /s at {friction_n} N");
    }
}

#[test]
fn check_reports_a_machine_that_rests_on_a_stop() {
    let test_folder = folder_with_machine(&example_machine());
    let check_text_with = |clearance: &str| {
        all_output(&test_folder.run_sweep(&["check", "g.toml", "--set", clearance]))
    };
    assert!(!check_text_with("stop_3_clearance_m=0.04").contains("at rest"));
    let check_text = check_text_with("stop_3_clearance_m=0.005");
    assert!(
        check_text.contains("stop 3 carries ") && check_text.contains(" N at rest"),
        "{check_text}"
    );
}

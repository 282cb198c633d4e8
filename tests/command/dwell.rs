//! Tests of `sweep dwell`: its files, summaries and errors.

use std::fs;
use std::process::{Command, Output};

use crate::test_folder::{all_output, sweep_binary};

const GRID: &str = r#"
machine = "paper"
[spin]
profile = "ramp"
peak_rpm = 350.0
ramp_s = 50.0
[time]
end_s = 50.0
[[axis]]
parameter = "unbalance_mass_kg"
values = [0.1, 0.4]
"#;

fn folder_with_grid() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("grid.toml"), GRID).expect("it is written");
    folder
}

fn sweep(folder: &tempfile::TempDir, arguments: &[&str], simd: Option<&str>) -> Output {
    let mut command = Command::new(sweep_binary());
    command.current_dir(folder.path()).args(arguments);
    if let Some(simd) = simd {
        command.env("SWEEP_SIMD", simd);
    }
    command.output().expect("it starts")
}

#[test]
fn every_motion_of_a_held_speed_has_a_row() {
    let folder = folder_with_grid();
    let command_output = sweep(&folder, &["dwell", "grid.toml", "--speed", "250,297.5"], None);
    assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
    let dwell_file = "results/grid-dwell.parquet";
    let shown_text = all_output(&sweep(&folder, &["show", dwell_file], None));
    for output_text in [&all_output(&command_output), &shown_text] {
        for line in [
            "4 at 4 points and speeds: 2 periodic, 1 periodic 2, 1 quasi periodic",
            "tub yaw 152.3 mrad, quasi periodic, at unbalance_mass_kg 0.4, 250 rpm",
            "tub pitch 163.7 mrad, periodic 2, at unbalance_mass_kg 0.4, 297.5 rpm",
        ] {
            assert!(output_text.contains(line), "{line}\n{output_text}");
        }
    }
    let stdout_bytes = sweep(&folder, &["show", dwell_file, "--json"], None).stdout;
    let shown_json: serde_json::Value = serde_json::from_slice(&stdout_bytes).expect("it is JSON");
    assert_eq!(shown_json["lines"][0][0], "motions");
    assert_eq!(
        (&shown_json["columns"][0]["greatest"], &shown_json["columns"][0]["name"]),
        (&1.into(), &"point".into())
    );
    let require_words = ["require", dwell_file, "nonlinear_tub_yaw < 0.1"];
    assert_eq!(sweep(&folder, &require_words, None).status.code(), Some(4));
    let point_option = "unbalance_mass_kg=0.4";
    let plot_output =
        sweep(&folder, &["plot", dwell_file, "--at", point_option, "-o", "a.svg"], None);
    assert_eq!(plot_output.status.code(), Some(0), "{}", all_output(&plot_output));
    let figure = fs::read_to_string(folder.path().join("a.svg")).expect("it is there");
    assert!(figure.contains("motion at a held speed: two frequencies"));
}

#[test]
fn at_can_replace_an_axis() {
    let folder = folder_with_grid();
    let file_bytes = [("--at", "a.parquet"), ("--set", "b.parquet")].map(|(option, file)| {
        let point_option = [option, "unbalance_mass_kg=0.4"];
        let dwell_words = ["dwell", "grid.toml", "--speed", "250", "--starts", "1", "--out", file];
        let command_output = sweep(&folder, &[&dwell_words[..], &point_option].concat(), None);
        assert!(
            all_output(&command_output).contains("1 at 1 point and speed: 1 quasi periodic"),
            "{}",
            all_output(&command_output)
        );
        fs::read(folder.path().join(file)).expect("it is there")
    });
    assert!(file_bytes[0] == file_bytes[1]);
    let stability_text = |further_options: &[&str]| {
        let stability_words = ["stability", "grid.toml", "--speed", "250", "--fresh"];
        all_output(&sweep(&folder, &[&stability_words[..], further_options].concat(), None))
    };
    assert!(stability_text(&[]).contains("unbalance_mass_kg 0.4: 250 rpm, quasi periodic"));
    assert!(
        stability_text(&["--at", "unbalance_mass_kg=0.4"]).contains("unstable  250 rpm, quasi")
    );
    let contradictory_text =
        stability_text(&["--at", "unbalance_mass_kg=0.4", "--set", "unbalance_mass_kg=0.1"]);
    assert!(contradictory_text.contains("given twice"), "{contradictory_text}");
}

#[test]
fn peaks_of_attractors_are_a_metric_of_maps() {
    let folder = folder_with_grid();
    let grid = format!("metrics = [\"dwell\"]\n{GRID}\n[stability]\nspeed_rpm = \"250,297.5\"\n");
    fs::write(folder.path().join("map.toml"), grid).expect("it is written");
    let run_output = sweep(&folder, &["run", "map.toml"], None);
    assert_eq!(run_output.status.code(), Some(0), "{}", all_output(&run_output));
    let map_file = "results/map.parquet";
    let columns = "dwell_tub_yaw,dwell_tub_pitch,dwell_speed_rpm,dwell_kind";
    let show_words =
        ["show", map_file, "--top", "2", "--by", "dwell_tub_yaw", "--columns", columns];
    let messages = all_output(&sweep(&folder, &show_words, None));
    // The greatest yaw is that at 250 rpm, the greatest pitch that at 297.5 rpm, which is greater.
    let first_line = messages.lines().find(|line| line.contains("0.152"));
    let first_line = first_line.unwrap_or_else(|| panic!("{messages}"));
    assert!(
        first_line.contains("0.1637")
            && first_line.contains("297.5")
            && first_line.contains("periodic_2")
    );
    let require_words = ["require", map_file, "dwell_tub_yaw < 0.02"];
    assert_eq!(sweep(&folder, &require_words, None).status.code(), Some(4));
    let plot_words = ["plot", map_file, "--quantity", "dwell_tub_yaw", "-o", "m.svg"];
    let plot_output = sweep(&folder, &plot_words, None);
    assert_eq!(plot_output.status.code(), Some(0), "{}", all_output(&plot_output));
    let output_without_speeds =
        sweep(&folder, &["run", "grid.toml", "--set", "metrics=dwell"], None);
    assert!(
        all_output(&output_without_speeds).contains("the metric `dwell` needs speeds"),
        "{}",
        all_output(&output_without_speeds)
    );
}

#[test]
fn motions_have_sections_and_metrics_and_can_be_compared() {
    let folder = folder_with_grid();
    let grid = format!("metrics = [\"cabinet_force\", \"clash_time\"]\n{GRID}");
    fs::write(folder.path().join("grid.toml"), grid).expect("it is written");
    let run_dwell = |damping: &str, further_options: &[&str], out: &str| {
        let fixed_options = ["--at", "unbalance_mass_kg=0.4", "--set", damping, "--starts", "1"];
        let dwell_words = ["dwell", "grid.toml", "--speed", "250,280", "--out", out];
        let command_output =
            sweep(&folder, &[&dwell_words[..], &fixed_options, further_options].concat(), None);
        assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
        all_output(&command_output)
    };
    let messages = run_dwell("damping_n_s_per_m=140", &["--sections", "64"], "a.parquet");
    assert!(messages.contains("2 at 2 points and speeds"), "{messages}");
    let shown_text = all_output(&sweep(&folder, &["show", "a.parquet", "--all"], None));
    for column in ["turn", "q5_rad", "u10_rad_per_s", "cabinet_force_nonlinear_n"] {
        assert!(shown_text.contains(column), "{column}\n{shown_text}");
    }
    assert!(shown_text.contains("rows  128"), "64 states of each of two motions\n{shown_text}");
    assert!(!shown_text.contains("clash_time"), "a motion that goes on has no such time");
    let plot_words = ["plot", "a.parquet", "--view", "sections", "-o", "s.html"];
    let plot_output = sweep(&folder, &plot_words, None);
    assert_eq!(plot_output.status.code(), Some(0), "{}", all_output(&plot_output));
    run_dwell("damping_n_s_per_m=140", &[], "b.parquet");
    run_dwell("damping_n_s_per_m=240", &[], "c.parquet");
    let compare_words = ["compare", "b.parquet", "c.parquet", "--fail-on", "any"];
    let compare_output = sweep(&folder, &compare_words, None);
    assert_eq!(compare_output.status.code(), Some(4), "{}", all_output(&compare_output));
    let show_words = ["show", "b.parquet", "--top", "1", "--by", "nonlinear_tub_yaw"];
    assert!(all_output(&sweep(&folder, &show_words, None)).contains("0.15232"));
}

#[test]
fn bytes_do_not_depend_on_threads_instruction_set_or_shards() {
    let folder = folder_with_grid();
    for search_options in [&["--starts", "3", "--threshold"][..], &["--carry", "down"]] {
        let dwell_arguments = |further_arguments: &[&'static str]| {
            [&["dwell", "grid.toml", "--speed", "240:300:30"], search_options, further_arguments]
                .concat()
        };
        let result_bytes = |further_arguments: &[&'static str], simd| {
            let command_output = sweep(&folder, &dwell_arguments(further_arguments), simd);
            assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
            further_arguments
                .last()
                .map(|name| fs::read(folder.path().join(name)).unwrap_or_default())
        };
        let single_thread_bytes = result_bytes(&["--threads", "1", "--out", "a.parquet"], None);
        assert!(
            single_thread_bytes
                == result_bytes(&["--threads", "2", "--out", "b.parquet"], Some("scalar"))
        );
        for shard in [["--shard", "1/2"], ["--shard", "2/2"]] {
            result_bytes(&[shard[0], shard[1], "--out", "c.parquet"], None);
        }
        let search_words = ["grid.toml", "--speed", "240:300:30", "--dwell", "--out", "c.parquet"];
        let run_command =
            |verb| sweep(&folder, &[&[verb][..], &search_words, search_options].concat(), None);
        let expected_advice =
            "next  sweep merge grid.toml --out c.parquet --dwell --speed 240:300:30";
        assert!(
            all_output(&run_command("status")).contains(expected_advice),
            "{}",
            all_output(&run_command("status"))
        );
        let merge_output = run_command("merge");
        assert_eq!(merge_output.status.code(), Some(0), "{}", all_output(&merge_output));
        let joined_bytes = fs::read(folder.path().join("c.parquet")).expect("it is there");
        assert!(single_thread_bytes == Some(joined_bytes));
        for name in ["a.parquet", "b.parquet", "c.parquet"] {
            fs::remove_file(folder.path().join(name)).expect("it is there");
        }
    }
}

#[test]
fn contradictory_options_are_errors() {
    let folder = folder_with_grid();
    for (options, expected) in [
        (&["--speed", "0"][..], "above 0 rpm"),
        (&["--speed", "250,240"], "rising"),
        (&["--speed", "250", "--starts", "0"], "1..=1024"),
        (&["--speed", "250", "--kick=-1"], "above 0"),
        (&["--speed", "250", "--carry", "sideways"], "up or down"),
        (&["--speed", "250", "--carry", "up", "--threshold"], "cannot be used with"),
    ] {
        let refused_output = sweep(&folder, &[&["dwell", "grid.toml"], options].concat(), None);
        assert_eq!(refused_output.status.code(), Some(2), "{options:?}");
        assert!(
            all_output(&refused_output).contains(expected),
            "{options:?}: {}",
            all_output(&refused_output)
        );
    }
}

/// The summary has a line for each motion, with its starts and whether a kick leads to another one.
#[test]
fn the_summary_has_a_line_for_each_motion() {
    let folder = folder_with_grid();
    let dwell_words = ["dwell", "grid.toml", "--speed", "250,280", "--at", "unbalance_mass_kg=0.4"];
    let messages =
        all_output(&sweep(&folder, &[&dwell_words[..], &["--starts", "6"]].concat(), None));
    let lines_named = |name: &str| {
        let named_lines =
            messages.lines().filter(|line| line.trim_start().starts_with(&format!("{name} ")));
        named_lines.map(str::to_owned).collect::<Vec<_>>()
    };
    let motion_lines = lines_named("motion");
    assert_eq!(motion_lines.len(), 2, "{messages}");
    for (line, kind, speed, yaw) in [
        (&motion_lines[0], "quasi periodic at", "250 rpm", "tub yaw 152.3 mrad"),
        (&motion_lines[1], "periodic at", "280 rpm", "tub yaw 4.9 mrad"),
    ] {
        for expected_part in
            [kind, speed, yaw, "from 6 of 6 starts, the disturbed periodic response among"]
        {
            assert!(line.contains(expected_part), "{expected_part}: {line}");
        }
    }
    let push_lines = lines_named("push");
    assert_eq!(push_lines.len(), 2, "{messages}");
    for (line, speed) in push_lines.iter().zip(["250 rpm", "280 rpm"]) {
        let expected_text = "no push up to 6 rad/s that was tried leads elsewhere at";
        assert!(line.contains(expected_text) && line.contains(speed), "{line}");
    }
}

/// Held speeds do not depend on the profile of the spin.
#[test]
fn held_speeds_do_not_depend_on_the_spin() {
    let folder = folder_with_grid();
    let table_spin = "profile = \"table\"\ntime_s = [0, 9, 12, 20]\nspeed_rpm = [0, 0, 200, -200]";
    let ramp_spin = "profile = \"ramp\"\npeak_rpm = 350.0\nramp_s = 50.0";
    fs::write(folder.path().join("grid.toml"), GRID.replace(ramp_spin, table_spin))
        .expect("it is written");
    let dwell_words = ["dwell", "grid.toml", "--speed", "250", "--starts", "1"];
    let messages = all_output(&sweep(&folder, &dwell_words, None));
    assert!(messages.contains("tub yaw 152.3 mrad, quasi periodic"), "{messages}");
}

/// The dots of a single speed are in the middle of the figure, not clipped by its frame.
#[test]
fn dots_of_one_speed_are_whole() {
    let folder = folder_with_grid();
    let dwell_words = ["dwell", "grid.toml", "--speed", "280", "--at", "unbalance_mass_kg=0.4"];
    let command_output = sweep(&folder, &[&dwell_words[..], &["--starts", "1"]].concat(), None);
    assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
    let plot_output =
        sweep(&folder, &["plot", "results/grid-dwell.parquet", "-o", "one.svg"], None);
    assert_eq!(plot_output.status.code(), Some(0), "{}", all_output(&plot_output));
    let figure = fs::read_to_string(folder.path().join("one.svg")).expect("it is there");
    let leading_number = |text: &str| -> f64 {
        let number_end = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
        text[..number_end].parse().expect("a number")
    };
    let path_data =
        |text: &str| text.split_once("d=\"M").map(|(_, path_data)| path_data.to_owned());
    let number_after_mark =
        |text: &str, mark: char| text.split_once(mark).map(|(_, rest)| leading_number(rest));
    // The path of a panel's frame is M LEFT TOP h WIDTH v HEIGHT.
    let frame_paths =
        figure.lines().filter(|line| line.contains("<clipPath")).filter_map(path_data);
    let frames: Vec<[f64; 4]> = frame_paths
        .map(|frame| {
            let sizes = ['h', 'v'].map(|mark| number_after_mark(&frame, mark).expect("a size"));
            [
                leading_number(&frame),
                number_after_mark(&frame, ' ').expect("its top"),
                sizes[0],
                sizes[1],
            ]
        })
        .collect();
    let middle_x = frames[0][0] + 0.5 * frames[0][2];
    let is_dot = |line: &&str| !line.contains("stroke") && line.ends_with("z\" fill=\"#0072b2\"/>");
    let dot_paths = figure.lines().filter(is_dot).filter_map(path_data);
    // The dots of the legend are below all frames.
    let is_within_frame =
        |y: f64| frames.iter().any(|[_, top, _, height]| y > *top && y < top + height);
    let dot_paths_in_frames = dot_paths
        .filter(|path_data| number_after_mark(path_data, ' ').is_some_and(is_within_frame));
    let dot_xs: Vec<f64> =
        dot_paths_in_frames.map(|path_data| leading_number(&path_data)).collect();
    assert!(dot_xs.len() >= frames.len(), "{figure}");
    for x in dot_xs {
        assert!((x - middle_x).abs() < 1.0, "{x}, not {middle_x}");
    }
}

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

fn folder() -> tempfile::TempDir {
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
    let folder = folder();
    let command_output = sweep(&folder, &["dwell", "grid.toml", "--speed", "250,297.5"], None);
    assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
    let file = "results/grid-dwell.parquet";
    let shown_text = all_output(&sweep(&folder, &["show", file], None));
    for messages in [&all_output(&command_output), &shown_text] {
        for line in [
            "4 at 4 points and speeds: 2 periodic, 1 periodic 2, 1 quasi periodic",
            "tub yaw 152.3 mrad, quasi periodic, at unbalance_mass_kg 0.4, 250 rpm",
            "tub pitch 163.7 mrad, periodic 2, at unbalance_mass_kg 0.4, 297.5 rpm",
        ] {
            assert!(messages.contains(line), "{line}\n{messages}");
        }
    }
    let json = sweep(&folder, &["show", file, "--json"], None).stdout;
    let json: serde_json::Value = serde_json::from_slice(&json).expect("it is JSON");
    assert_eq!(json["lines"][0][0], "motions");
    assert_eq!(
        (&json["columns"][0]["greatest"], &json["columns"][0]["name"]),
        (&1.into(), &"point".into())
    );
    let gate = ["require", file, "nonlinear_tub_yaw < 0.1"];
    assert_eq!(sweep(&folder, &gate, None).status.code(), Some(4));
    let at = "unbalance_mass_kg=0.4";
    let plot_output = sweep(&folder, &["plot", file, "--at", at, "-o", "a.svg"], None);
    assert_eq!(plot_output.status.code(), Some(0), "{}", all_output(&plot_output));
    let picture = fs::read_to_string(folder.path().join("a.svg")).expect("it is there");
    assert!(picture.contains("motion at a held speed: two frequencies"));
}

#[test]
fn at_can_replace_an_axis() {
    let folder = folder();
    let files = [("--at", "a.parquet"), ("--set", "b.parquet")].map(|(option, file)| {
        let point = [option, "unbalance_mass_kg=0.4"];
        let dwell = ["dwell", "grid.toml", "--speed", "250", "--starts", "1", "--out", file];
        let command_output = sweep(&folder, &[&dwell[..], &point].concat(), None);
        assert!(
            all_output(&command_output).contains("1 at 1 point and speed: 1 quasi periodic"),
            "{}",
            all_output(&command_output)
        );
        fs::read(folder.path().join(file)).expect("it is there")
    });
    assert!(files[0] == files[1]);
    let dwell_output = |more: &[&str]| {
        let stability = ["stability", "grid.toml", "--speed", "250", "--fresh"];
        all_output(&sweep(&folder, &[&stability[..], more].concat(), None))
    };
    assert!(dwell_output(&[]).contains("unbalance_mass_kg 0.4: 250 rpm, quasi periodic"));
    assert!(dwell_output(&["--at", "unbalance_mass_kg=0.4"]).contains("unstable  250 rpm, quasi"));
    let contradictory_output =
        dwell_output(&["--at", "unbalance_mass_kg=0.4", "--set", "unbalance_mass_kg=0.1"]);
    assert!(contradictory_output.contains("given twice"), "{contradictory_output}");
}

#[test]
fn peaks_of_attractors_are_a_metric_of_maps() {
    let folder = folder();
    let grid = format!("metrics = [\"dwell\"]\n{GRID}\n[stability]\nspeed_rpm = \"250,297.5\"\n");
    fs::write(folder.path().join("map.toml"), grid).expect("it is written");
    let run_output = sweep(&folder, &["run", "map.toml"], None);
    assert_eq!(run_output.status.code(), Some(0), "{}", all_output(&run_output));
    let file = "results/map.parquet";
    let columns = "dwell_tub_yaw,dwell_tub_pitch,dwell_speed_rpm,dwell_kind";
    let rows = ["show", file, "--top", "2", "--by", "dwell_tub_yaw", "--columns", columns];
    let messages = all_output(&sweep(&folder, &rows, None));
    // The greatest yaw is that at 250 rpm, the greatest pitch that at 297.5 rpm, which is greater.
    let first_line = messages.lines().find(|line| line.contains("0.152"));
    let first_line = first_line.unwrap_or_else(|| panic!("{messages}"));
    assert!(
        first_line.contains("0.1637")
            && first_line.contains("297.5")
            && first_line.contains("periodic_2")
    );
    let gate = ["require", file, "dwell_tub_yaw < 0.02"];
    assert_eq!(sweep(&folder, &gate, None).status.code(), Some(4));
    let map = ["plot", file, "--quantity", "dwell_tub_yaw", "-o", "m.svg"];
    let plot_output = sweep(&folder, &map, None);
    assert_eq!(plot_output.status.code(), Some(0), "{}", all_output(&plot_output));
    let without = sweep(&folder, &["run", "grid.toml", "--set", "metrics=dwell"], None);
    assert!(
        all_output(&without).contains("the metric `dwell` needs speeds"),
        "{}",
        all_output(&without)
    );
}

#[test]
fn motions_have_sections_and_metrics_and_can_be_compared() {
    let folder = folder();
    let grid = format!("metrics = [\"cabinet_force\", \"clash_time\"]\n{GRID}");
    fs::write(folder.path().join("grid.toml"), grid).expect("it is written");
    let dwell = |damping: &str, more: &[&str], out: &str| {
        let at = ["--at", "unbalance_mass_kg=0.4", "--set", damping, "--starts", "1"];
        let dwell = ["dwell", "grid.toml", "--speed", "250,280", "--out", out];
        let command_output = sweep(&folder, &[&dwell[..], &at, more].concat(), None);
        assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
        all_output(&command_output)
    };
    let messages = dwell("damping_n_s_per_m=140", &["--sections", "64"], "a.parquet");
    assert!(messages.contains("2 at 2 points and speeds"), "{messages}");
    let shown_text = all_output(&sweep(&folder, &["show", "a.parquet", "--all"], None));
    for column in ["turn", "q5_rad", "u10_rad_per_s", "cabinet_force_nonlinear_n"] {
        assert!(shown_text.contains(column), "{column}\n{shown_text}");
    }
    assert!(shown_text.contains("rows  128"), "64 states of each of two motions\n{shown_text}");
    assert!(!shown_text.contains("clash_time"), "a motion that goes on has no such time");
    let view = ["plot", "a.parquet", "--view", "sections", "-o", "s.html"];
    let plot_output = sweep(&folder, &view, None);
    assert_eq!(plot_output.status.code(), Some(0), "{}", all_output(&plot_output));
    dwell("damping_n_s_per_m=140", &[], "b.parquet");
    dwell("damping_n_s_per_m=240", &[], "c.parquet");
    let gate = ["compare", "b.parquet", "c.parquet", "--fail-on", "any"];
    let compared = sweep(&folder, &gate, None);
    assert_eq!(compared.status.code(), Some(4), "{}", all_output(&compared));
    let top = ["show", "b.parquet", "--top", "1", "--by", "nonlinear_tub_yaw"];
    assert!(all_output(&sweep(&folder, &top, None)).contains("0.15232"));
}

#[test]
fn bytes_do_not_depend_on_threads_instruction_set_or_shards() {
    let folder = folder();
    for search in [&["--starts", "3", "--threshold"][..], &["--carry", "down"]] {
        let arguments = |more: &[&'static str]| {
            [&["dwell", "grid.toml", "--speed", "240:300:30"], search, more].concat()
        };
        let bytes = |more: &[&'static str], simd| {
            let command_output = sweep(&folder, &arguments(more), simd);
            assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
            more.last().map(|name| fs::read(folder.path().join(name)).unwrap_or_default())
        };
        let first_line = bytes(&["--threads", "1", "--out", "a.parquet"], None);
        assert!(first_line == bytes(&["--threads", "2", "--out", "b.parquet"], Some("scalar")));
        for shard in [["--shard", "1/2"], ["--shard", "2/2"]] {
            bytes(&[shard[0], shard[1], "--out", "c.parquet"], None);
        }
        let search_words = ["grid.toml", "--speed", "240:300:30", "--dwell", "--out", "c.parquet"];
        let run_verb = |verb| sweep(&folder, &[&[verb][..], &search_words, search].concat(), None);
        let next = "next  sweep merge grid.toml --out c.parquet --dwell --speed 240:300:30";
        assert!(
            all_output(&run_verb("status")).contains(next),
            "{}",
            all_output(&run_verb("status"))
        );
        let merged = run_verb("merge");
        assert_eq!(merged.status.code(), Some(0), "{}", all_output(&merged));
        let joined = fs::read(folder.path().join("c.parquet")).expect("it is there");
        assert!(first_line == Some(joined));
        for name in ["a.parquet", "b.parquet", "c.parquet"] {
            fs::remove_file(folder.path().join(name)).expect("it is there");
        }
    }
}

#[test]
fn contradictory_options_are_errors() {
    let folder = folder();
    for (more, expected) in [
        (&["--speed", "0"][..], "above 0 rpm"),
        (&["--speed", "250,240"], "rising"),
        (&["--speed", "250", "--starts", "0"], "1..=1024"),
        (&["--speed", "250", "--kick=-1"], "above 0"),
        (&["--speed", "250", "--carry", "sideways"], "up or down"),
        (&["--speed", "250", "--carry", "up", "--threshold"], "cannot be used with"),
    ] {
        let refused_output = sweep(&folder, &[&["dwell", "grid.toml"], more].concat(), None);
        assert_eq!(refused_output.status.code(), Some(2), "{more:?}");
        assert!(
            all_output(&refused_output).contains(expected),
            "{more:?}: {}",
            all_output(&refused_output)
        );
    }
}

/// The summary has a line for each motion, with its starts and whether a kick leads to another one.
#[test]
fn the_summary_has_a_line_for_each_motion() {
    let folder = folder();
    let dwell = ["dwell", "grid.toml", "--speed", "250,280", "--at", "unbalance_mass_kg=0.4"];
    let messages = all_output(&sweep(&folder, &[&dwell[..], &["--starts", "6"]].concat(), None));
    let lines = |name: &str| {
        let expected_message =
            messages.lines().filter(|line| line.trim_start().starts_with(&format!("{name} ")));
        expected_message.map(str::to_owned).collect::<Vec<_>>()
    };
    let motions = lines("motion");
    assert_eq!(motions.len(), 2, "{messages}");
    for (line, kind, speed, yaw) in [
        (&motions[0], "quasi periodic at", "250 rpm", "tub yaw 152.3 mrad"),
        (&motions[1], "periodic at", "280 rpm", "tub yaw 4.9 mrad"),
    ] {
        for part in [kind, speed, yaw, "from 6 of 6 starts, the disturbed periodic response among"]
        {
            assert!(line.contains(part), "{part}: {line}");
        }
    }
    let pushes = lines("push");
    assert_eq!(pushes.len(), 2, "{messages}");
    for (line, speed) in pushes.iter().zip(["250 rpm", "280 rpm"]) {
        let expected = "no push up to 6 rad/s that was tried leads elsewhere at";
        assert!(line.contains(expected) && line.contains(speed), "{line}");
    }
}

/// Held speeds do not depend on the profile of the spin.
#[test]
fn held_speeds_do_not_depend_on_the_spin() {
    let folder = folder();
    let table = "profile = \"table\"\ntime_s = [0, 9, 12, 20]\nspeed_rpm = [0, 0, 200, -200]";
    let ramp = "profile = \"ramp\"\npeak_rpm = 350.0\nramp_s = 50.0";
    fs::write(folder.path().join("grid.toml"), GRID.replace(ramp, table)).expect("it is written");
    let dwell = ["dwell", "grid.toml", "--speed", "250", "--starts", "1"];
    let messages = all_output(&sweep(&folder, &dwell, None));
    assert!(messages.contains("tub yaw 152.3 mrad, quasi periodic"), "{messages}");
}

/// The dots of a single speed are in the middle of the figure, not clipped by its frame.
#[test]
fn dots_of_one_speed_are_whole() {
    let folder = folder();
    let dwell = ["dwell", "grid.toml", "--speed", "280", "--at", "unbalance_mass_kg=0.4"];
    let command_output = sweep(&folder, &[&dwell[..], &["--starts", "1"]].concat(), None);
    assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
    let plot_output =
        sweep(&folder, &["plot", "results/grid-dwell.parquet", "-o", "one.svg"], None);
    assert_eq!(plot_output.status.code(), Some(0), "{}", all_output(&plot_output));
    let picture = fs::read_to_string(folder.path().join("one.svg")).expect("it is there");
    let number = |text: &str| -> f64 {
        let end = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
        text[..end].parse().expect("a number")
    };
    let curve_path =
        |text: &str| text.split_once("d=\"M").map(|(_, curve_path)| curve_path.to_owned());
    let number_after = |text: &str, mark: char| text.split_once(mark).map(|(_, rest)| number(rest));
    // The path of a panel's frame is M LEFT TOP h WIDTH v HEIGHT.
    let frames = picture.lines().filter(|line| line.contains("<clipPath")).filter_map(curve_path);
    let frames: Vec<[f64; 4]> = frames
        .map(|frame| {
            let sizes = ['h', 'v'].map(|mark| number_after(&frame, mark).expect("a size"));
            [number(&frame), number_after(&frame, ' ').expect("its top"), sizes[0], sizes[1]]
        })
        .collect();
    let middle = frames[0][0] + 0.5 * frames[0][2];
    let is_dot = |line: &&str| !line.contains("stroke") && line.ends_with("z\" fill=\"#0072b2\"/>");
    let dots = picture.lines().filter(is_dot).filter_map(curve_path);
    // The dots of the legend are below all frames.
    let is_framed = |y: f64| frames.iter().any(|[_, top, _, height]| y > *top && y < top + height);
    let dots = dots.filter(|curve_path| number_after(curve_path, ' ').is_some_and(is_framed));
    let dots: Vec<f64> = dots.map(|curve_path| number(&curve_path)).collect();
    assert!(dots.len() >= frames.len(), "{picture}");
    for x in dots {
        assert!((x - middle).abs() < 1.0, "{x}, not {middle}");
    }
}

//! `sweep stability` as a user meets it: what it writes, says and refuses.

#![cfg(unix)]

use std::fs;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::home::{said, sweep_binary};
use crate::signal;

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

fn folder_with(more: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("grid.toml"), format!("{GRID}{more}")).expect("it is written");
    folder
}

fn sweep(folder: &tempfile::TempDir, arguments: &[&str]) -> Command {
    let mut command = Command::new(sweep_binary());
    command.current_dir(folder.path()).args(arguments);
    command
}

fn stability(folder: &tempfile::TempDir, speed: &str, more: &[&str]) -> Output {
    let arguments = ["stability", "grid.toml", "--speed", speed];
    sweep(folder, &[&arguments, more].concat()).output().expect("it starts")
}

#[test]
fn both_tongues_of_the_papers_machine_are_found_and_named() {
    let folder = folder_with("");
    let done = stability(&folder, "230:325:1", &[]);
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    let file = "results/grid-stability.parquet";
    let shown = said(&sweep(&folder, &["show", file]).output().expect("it starts"));
    for told in [&said(&done), &shown] {
        for line in [
            "43 not, 0 without a response; 2 points",
            "damping_n_s_per_m 140: 239 to 259 rpm, quasi periodic, up to 0.39",
            "damping_n_s_per_m 140: 295 to 316 rpm, period doubling, up to 0.28",
            "rocking, vertical plane",
            "rocking, horizontal plane",
        ] {
            assert!(told.contains(line), "{line}\n{told}");
        }
    }
    let drawn = sweep(&folder, &["plot", file]).output().expect("it starts");
    assert_eq!(drawn.status.code(), Some(0), "{}", said(&drawn));
    // It is not written over by a map.
    let run = sweep(&folder, &["run", "grid.toml", "--out", file]).output().expect("it starts");
    assert_eq!(run.status.code(), Some(2), "{}", said(&run));
}

#[test]
fn bytes_depend_on_neither_threads_nor_instruction_set() {
    let folder = folder_with("");
    let bytes = |name: &str, threads: &str, simd: Option<&str>| {
        let mut command = sweep(&folder, &["stability", "grid.toml", "--speed", "20:320:7"]);
        command.args(["--out", name, "--threads", threads]);
        if let Some(simd) = simd {
            command.env("SWEEP_SIMD", simd);
        }
        let done = command.output().expect("it starts");
        assert_eq!(done.status.code(), Some(0), "{}", said(&done));
        fs::read(folder.path().join(name)).expect("it is there")
    };
    let first = bytes("a.parquet", "1", None);
    assert!(first == bytes("b.parquet", "2", None));
    assert!(first == bytes("c.parquet", "2", Some("scalar")));
    assert!(first == bytes("a.parquet", "2", None));
}

#[test]
fn what_makes_no_sense_is_refused_before_any_work() {
    let folder = folder_with("");
    for (speed, expected) in
        [("0:100:1", "above 0 rpm"), ("-5:100:1", "0 rpm or more"), ("fast", "FROM:TO:STEP")]
    {
        let refused = stability(&folder, speed, &[]);
        assert_eq!(refused.status.code(), Some(2), "{speed}");
        assert!(said(&refused).contains(expected), "{speed}: {}", said(&refused));
    }
    for (parameter, value, expected) in [
        ("spin_peak_rpm", "300.0", "without the axis `spin_peak_rpm`"),
        ("window_from_s", "31.0", "without the axis `window_from_s`"),
    ] {
        let axis = format!("[[axis]]\nparameter = \"{parameter}\"\nvalues = [{value}]\n");
        let refused = stability(&folder_with(&axis), "60:100:1", &[]);
        assert_eq!(refused.status.code(), Some(2), "{parameter}: {}", said(&refused));
        assert!(said(&refused).contains(expected), "{parameter}: {}", said(&refused));
    }
}

#[test]
fn what_a_signal_stops_goes_on_to_the_same_bytes() {
    let folder = folder_with("");
    let arguments = ["stability", "grid.toml", "--speed", "60:360:0.05", "--progress", "none"];
    let mut command = sweep(&folder, &arguments);
    let child = command.stderr(Stdio::piped()).spawn().expect("it starts");
    // Once a chunk is there.
    let partial = folder.path().join("results/grid-stability.parquet.partial");
    let is_part = |entry: std::io::Result<fs::DirEntry>| {
        entry.is_ok_and(|entry| entry.file_name().to_string_lossy().starts_with("part-"))
    };
    let began = Instant::now();
    while !fs::read_dir(&partial).is_ok_and(|mut entries| entries.any(is_part)) {
        assert!(began.elapsed() < Duration::from_secs(60), "no part is kept");
        std::thread::sleep(Duration::from_millis(20));
    }
    signal("TERM", child.id());
    let ended = child.wait_with_output().expect("it ends");
    assert_eq!(ended.status.code(), Some(143), "{}", said(&ended));
    assert!(said(&ended).contains("sweep stability grid.toml --speed 60:360:0.05"));
    let status = sweep(&folder, &["status", "grid.toml", "--speed", "60:360:0.05"]).output();
    assert!(said(&status.expect("it starts")).contains("unfinished"));
    let done = sweep(&folder, &arguments).output().expect("it starts");
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    assert!(said(&done).contains("going on: "), "{}", said(&done));
    let whole = sweep(&folder, &arguments).args(["--out", "whole.parquet"]).output();
    assert_eq!(whole.expect("it starts").status.code(), Some(0));
    let bytes = |name: &str| fs::read(folder.path().join(name)).expect("it is there");
    assert!(bytes("results/grid-stability.parquet") == bytes("whole.parquet"));
    let again = sweep(&folder, &arguments).output().expect("it starts");
    assert!(said(&again).contains("there already"), "{}", said(&again));
}

#[test]
fn shards_join_to_the_same_bytes() {
    let folder = folder_with("");
    let speed = ["--speed", "210:330:0.5"];
    let run = |more: &[&str]| {
        let done = sweep(&folder, &[&["stability", "grid.toml"], &speed[..], more].concat());
        let done = { done }.output().expect("it starts");
        assert_eq!(done.status.code(), Some(0), "{}", said(&done));
        done
    };
    for shard in ["1/3", "3/3", "2/3"] {
        run(&["--shard", shard]);
    }
    let merged = sweep(&folder, &[&["merge", "grid.toml"], &speed[..]].concat()).output();
    let merged = merged.expect("it starts");
    assert_eq!(merged.status.code(), Some(0), "{}", said(&merged));
    run(&["--out", "whole.parquet"]);
    let bytes = |name: &str| fs::read(folder.path().join(name)).expect("it is there");
    assert!(bytes("results/grid-stability.parquet") == bytes("whole.parquet"));
}

#[test]
fn growth_is_a_metric_of_maps_and_a_quantity_of_boundaries() {
    // The reference closes the last tongue at 0.4 kg by 252.5 N s/m.
    let growth = "[stability]\nspeed_rpm = \"296:316:0.5\"\n";
    let folder = folder_with("");
    let grid = format!("metrics = [\"growth\"]\n{GRID}{growth}");
    let grid =
        grid.replace("values = [140.0, 300.0]", "range = { from = 240, to = 270, count = 2 }");
    fs::write(folder.path().join("grid.toml"), grid).expect("it is written");
    let done = sweep(&folder, &["run", "grid.toml"]).output().expect("it starts");
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    let shown = sweep(&folder, &["show", "results/grid.parquet"]).output().expect("it starts");
    for column in ["growth_per_s", "growth_speed_rpm", "growth_kind", "growth_mode_1_name"] {
        assert!(said(&shown).contains(column), "{column}: {}", said(&shown));
    }
    assert!(said(&shown).contains("period_doubling"), "{}", said(&shown));
    let traced = sweep(&folder, &["boundary", "grid.toml", "--quantity", "growth_per_s"]).output();
    let traced = traced.expect("it starts");
    assert_eq!(traced.status.code(), Some(0), "{}", said(&traced));
    assert!(said(&traced).contains("1 crossing"), "{}", said(&traced));
    let plain = folder_with("");
    let refused = sweep(&plain, &["boundary", "grid.toml", "--quantity", "growth_per_s"]).output();
    let refused = refused.expect("it starts");
    assert_eq!(refused.status.code(), Some(2), "{}", said(&refused));
    let expected = "`--quantity growth_per_s`: expected [stability] in the grid file";
    assert!(said(&refused).contains(expected), "{}", said(&refused));
}

/// Between its folds the machine has three responses; one of them, found by a search of its own,
/// used to be called stable where a dwell shakes violently.
#[test]
fn coexisting_responses_are_rows_of_their_own() {
    let folder = folder_with("");
    let grid = GRID.replace("values = [0.4]", "values = [0.3, 0.4]");
    let grid = grid.replace("values = [140.0, 300.0]", "values = [30.0, 140.0]");
    fs::write(folder.path().join("grid.toml"), grid).expect("it is written");
    let speed = "254:259:0.5";
    let done = stability(&folder, speed, &[]);
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    let file = "results/grid-stability.parquet";
    let shown = said(&sweep(&folder, &["show", file]).output().expect("it starts"));
    let jump = "damping_n_s_per_m 30: at 255.36 rpm, running up";
    for line in ["6 of 44 rows", "4 further rows", jump] {
        assert!(shown.contains(line) || said(&done).contains(line), "{line}\n{shown}");
    }
    let csv = sweep(&folder, &["export", file, "rows.csv"]).output().expect("it starts");
    assert_eq!(csv.status.code(), Some(0), "{}", said(&csv));
    let text = fs::read_to_string(folder.path().join("rows.csv")).expect("it is there");
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let place = |name: &str| names.iter().position(|known| known.starts_with(name)).expect(name);
    let [point, rpm, growth, branch] = ["point", "speed_rpm", "growth_per_s", "branch"].map(place);
    // No name of a mode ends a field by its comma.
    let unquoted = |line: &str| -> String {
        let pieces = line.split('"').enumerate();
        pieces
            .map(|(k, piece)| if k % 2 == 1 { piece.replace(',', ";") } else { piece.into() })
            .collect()
    };
    let lines: Vec<String> = lines.map(unquoted).collect();
    let rows: Vec<Vec<&str>> = lines.iter().map(|line| line.split(',').collect()).collect();
    let at = |speed: &str| -> Vec<&Vec<&str>> {
        rows.iter().filter(|row| row[point] == "0" && row[rpm] == speed).collect()
    };
    let branches: Vec<&str> = at("255").iter().map(|row| row[branch]).collect();
    assert_eq!(branches, ["0", "1", "2"]);
    for speed in ["256.5", "257", "257.5"] {
        let [row] = at(speed)[..] else { panic!("one response at {speed} rpm: {text}") };
        assert!(row[growth].parse::<f64>().expect("a number") > 2.9, "{row:?}");
    }
    // Shards and a file compared with itself meet the further rows too.
    for shard in ["2/2", "1/2"] {
        let done = stability(&folder, speed, &["--out", "joined.parquet", "--shard", shard]);
        assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    }
    let merge = ["merge", "grid.toml", "--speed", speed, "--out", "joined.parquet"];
    let merged = sweep(&folder, &merge).output().expect("it starts");
    assert_eq!(merged.status.code(), Some(0), "{}", said(&merged));
    let bytes = |name: &str| fs::read(folder.path().join(name)).expect("it is there");
    assert!(bytes("joined.parquet") == bytes(file));
    let compared = sweep(&folder, &["compare", file, "joined.parquet"]).output();
    let compared = compared.expect("it starts");
    assert!(said(&compared).contains("differ  not at all"), "{}", said(&compared));
}

/// A turn of so slow a drum would take hours.
#[test]
fn a_drum_too_slow_to_follow_says_so_at_once() {
    let folder = folder_with("");
    let done = stability(&folder, "0.01:0.02:0.01", &[]);
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    let shown = sweep(&folder, &["show", "--all", "results/grid-stability.parquet"]).output();
    let shown = said(&shown.expect("it starts"));
    assert!(shown.contains("too_slow"), "{shown}");
}

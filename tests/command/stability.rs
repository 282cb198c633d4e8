//! `sweep stability` as a user meets it: what it writes, says and refuses.

#![cfg(unix)]

use std::fs;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use crate::{signal, sweep_binary};

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

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout)
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
            "42 not, 0 without a response; 2 points",
            "point 0: 239 to 259 rpm, quasi periodic, up to 0.39",
            "point 0: 295 to 316 rpm, period doubling, up to 0.28",
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
        [("0:100:1", "above 0 rpm"), ("-5:100:1", "0 rpm or more"), ("5", "FROM:TO:STEP")]
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
fn a_signal_stops_it_and_leaves_nothing() {
    let folder = folder_with("");
    let mut command = sweep(&folder, &["stability", "grid.toml", "--speed", "60:1300:0.05"]);
    let child = command.stderr(Stdio::piped()).spawn().expect("it starts");
    std::thread::sleep(Duration::from_secs(1));
    signal("TERM", child.id());
    let ended = child.wait_with_output().expect("it ends");
    assert_eq!(ended.status.code(), Some(143), "{}", said(&ended));
    assert!(said(&ended).contains("nothing was written"), "{}", said(&ended));
    let left: Vec<_> = fs::read_dir(folder.path().join("results")).into_iter().flatten().collect();
    assert!(left.is_empty(), "{left:?}");
}

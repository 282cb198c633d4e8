//! `sweep boundary` as a user meets it: what it writes, refuses and leaves behind.

#![cfg(unix)]

use std::fs;
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::{signal, sweep_binary};

/// A tenth of a second of every trajectory is plenty for what is tested here.
const GRID: &str = r#"
[spin]
profile = "triangular"
peak_rpm = 350.0
ramp_s = 50.0
[time]
end_s = END
[integrator]
method = "rk4"
step_s = 2.0e-4
[[axis]]
parameter = "unbalance_mass_kg"
values = [0.2, 0.4]
[[axis]]
parameter = "damping_n_s_per_m"
values = [60.0, 300.0]
[[axis]]
parameter = "spin_peak_rpm"
values = [300.0, 350.0, 400.0]
"#;

fn folder_with(end_s: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("grid.toml"), GRID.replace("END", end_s)).expect("the grid is written");
    folder
}

fn boundary(folder: &tempfile::TempDir, arguments: &[&str]) -> Command {
    let mut command = Command::new(sweep_binary());
    command.current_dir(folder.path()).args(["boundary", "grid.toml"]).args(arguments);
    command
}

#[test]
fn a_curve_for_every_combination_of_further_axes_in_a_figure() {
    let folder = folder_with("0.1");
    let done = boundary(&folder, &["--quantity", "min_gap_nonlinear_m"]).output().expect("it starts");
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(0), "{said}");
    // No gap closes in a tenth of a second: six rows say so.
    assert!(said.contains("6 none_in_range_reliable"), "{said}");
    let file = "results/grid-boundary.parquet";
    assert!(folder.path().join(file).is_file());
    let drawn = Command::new(sweep_binary())
        .current_dir(folder.path())
        .args(["plot", file, "-o", "curve.svg"])
        .output()
        .expect("it starts");
    assert_eq!(drawn.status.code(), Some(0), "{}", String::from_utf8_lossy(&drawn.stderr));
    let sweep = |arguments: &[&str]| {
        let done = Command::new(sweep_binary()).current_dir(folder.path()).args(arguments).output();
        let done = done.expect("it starts");
        (
            done.status.code(),
            [done.stdout, done.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()),
        )
    };
    let (code, [shown, said]) = sweep(&["show", file]);
    assert_eq!(code, Some(0), "{said}");
    assert!(shown.contains("6 none_in_range_reliable"), "{shown}");
    // It carries the grid's plan, but is not that grid's map.
    let (code, [_, said]) = sweep(&["run", "grid.toml", "--out", file]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("is no result of `sweep run`"), "{said}");
}

#[test]
fn what_cannot_be_traced_is_refused_before_any_work() {
    let folder = folder_with("0.1");
    fs::write(folder.path().join("notes.parquet"), "mine").expect("the notes are written");
    for (arguments, expected) in [
        (["--tolerance", "1e9"], "--tolerance 1000000000 is out of range"),
        (["--quantity", "ratio_tub"], "expected one of ratio_max"),
        (["--lattice", "0"], "--lattice"),
        (["--out", "notes.parquet"], "is no result of `sweep boundary`"),
    ] {
        let refused = boundary(&folder, &arguments).output().expect("it starts");
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(said.contains(expected), "{said}");
    }
    assert_eq!(fs::read(folder.path().join("notes.parquet")).expect("still there"), b"mine");
    assert!(!folder.path().join("results").exists());
}

#[test]
fn an_interrupt_leaves_nothing_half_written() {
    // Long enough that the signal comes in the middle, on any machine.
    let folder = folder_with("200");
    let child = boundary(&folder, &["--out", "x.parquet"]).stderr(Stdio::piped()).spawn().expect("it starts");
    std::thread::sleep(Duration::from_millis(500));
    signal("INT", child.id());
    let done = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(130), "{said}");
    assert!(said.contains("nothing was written"), "{said}");
    let left: Vec<_> = fs::read_dir(folder.path())
        .expect("the folder is there")
        .map(|entry| entry.expect("an entry").file_name())
        .collect();
    assert_eq!(left, ["grid.toml"]);
}

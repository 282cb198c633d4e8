//! `sweep dwell` as a user meets it: what it writes, says and refuses.

use std::fs;
use std::process::{Command, Output};

use crate::home::sweep_binary;

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

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout)
}

#[test]
fn every_motion_of_a_held_speed_has_a_row() {
    let folder = folder();
    let done = sweep(&folder, &["dwell", "grid.toml", "--speed", "250,297.5"], None);
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    let file = "results/grid-dwell.parquet";
    let shown = said(&sweep(&folder, &["show", file], None));
    for told in [&said(&done), &shown] {
        for line in [
            "4 at 4 points and speeds: 2 periodic, 1 periodic 2, 1 quasi periodic",
            "tub yaw 152.3 mrad, quasi periodic, at unbalance_mass_kg 0.4, 250 rpm",
            "tub pitch 163.7 mrad, periodic 2, at unbalance_mass_kg 0.4, 297.5 rpm",
        ] {
            assert!(told.contains(line), "{line}\n{told}");
        }
    }
    let gate = ["require", file, "nonlinear_tub_yaw < 0.1"];
    assert_eq!(sweep(&folder, &gate, None).status.code(), Some(4));
    let at = "unbalance_mass_kg=0.4";
    let drawn = sweep(&folder, &["plot", file, "--at", at, "-o", "a.svg"], None);
    assert_eq!(drawn.status.code(), Some(0), "{}", said(&drawn));
    let picture = fs::read_to_string(folder.path().join("a.svg")).expect("it is there");
    assert!(picture.contains("ends in: two frequencies"));
}

#[test]
fn bytes_depend_on_neither_threads_nor_instruction_set_nor_shards() {
    let folder = folder();
    for search in [&["--starts", "3", "--threshold"][..], &["--carry", "down"]] {
        let arguments = |more: &[&'static str]| {
            [&["dwell", "grid.toml", "--speed", "240:300:30"], search, more].concat()
        };
        let bytes = |more: &[&'static str], simd| {
            let done = sweep(&folder, &arguments(more), simd);
            assert_eq!(done.status.code(), Some(0), "{}", said(&done));
            more.last().map(|name| fs::read(folder.path().join(name)).unwrap_or_default())
        };
        let first = bytes(&["--threads", "1", "--out", "a.parquet"], None);
        assert!(first == bytes(&["--threads", "2", "--out", "b.parquet"], Some("scalar")));
        for shard in [["--shard", "1/2"], ["--shard", "2/2"]] {
            bytes(&[shard[0], shard[1], "--out", "c.parquet"], None);
        }
        let merge =
            ["merge", "grid.toml", "--speed", "240:300:30", "--dwell", "--out", "c.parquet"];
        let merged = sweep(&folder, &[&merge[..], search].concat(), None);
        assert_eq!(merged.status.code(), Some(0), "{}", said(&merged));
        let joined = fs::read(folder.path().join("c.parquet")).expect("it is there");
        assert!(first == Some(joined));
        for name in ["a.parquet", "b.parquet", "c.parquet"] {
            fs::remove_file(folder.path().join(name)).expect("it is there");
        }
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    let folder = folder();
    for (more, expected) in [
        (&["--speed", "0"][..], "above 0 rpm"),
        (&["--speed", "250,240"], "rising"),
        (&["--speed", "250", "--starts", "0"], "1..=1024"),
        (&["--speed", "250", "--kick=-1"], "above 0"),
        (&["--speed", "250", "--carry", "sideways"], "up or down"),
        (&["--speed", "250", "--carry", "up", "--threshold"], "cannot be used with"),
    ] {
        let refused = sweep(&folder, &[&["dwell", "grid.toml"], more].concat(), None);
        assert_eq!(refused.status.code(), Some(2), "{more:?}");
        assert!(said(&refused).contains(expected), "{more:?}: {}", said(&refused));
    }
}

//! A machine as they are sold, as a user meets it: loads of stops and feet, what friction rules
//! out, and what is refused.

#![cfg(unix)]

use std::fs;
use std::path::Path;

use crate::home::{Home, said};

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

fn home(machine: &str) -> Home {
    let home = Home::new(GRID);
    fs::write(home.path("machine.toml"), machine).expect("the folder can be written");
    home
}

fn example() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples/friction.toml");
    fs::read_to_string(path).expect("the example is there")
}

/// A column of the result's two rows.
fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines().filter(|line| !line.starts_with('#'));
    let header = lines.next().expect("a header");
    let place = header.split(',').position(|column| column == name).expect("the column is there");
    let value = |row: &str| row.split(',').nth(place).and_then(|value| value.parse().ok());
    lines.map(|row| value(row).expect("a number")).collect()
}

#[test]
fn loads_of_stops_and_feet_are_columns() {
    let home = home(&example());
    let run = home.sweep(&["run", "g.toml", "--out", "map.parquet"]);
    assert!(run.status.success(), "{}", said(&run));
    let export = home.sweep(&["export", "map.parquet", "map.csv"]);
    assert!(export.status.success(), "{}", said(&export));
    let csv = fs::read_to_string(home.path("map.csv")).expect("it was written");
    let of = |name: &str| column(&csv, name);
    // A little laundry reaches no stop and stands safely; a kilogram does neither.
    let [pushes, contacts] = [of("stop_force_nonlinear_n"), of("stop_contact_nonlinear_s")];
    assert!(pushes[0] < 1.0 && contacts[0] == 0.0, "{pushes:?} N, {contacts:?} s");
    assert!(pushes[1] > 100.0 && contacts[1] > 0.02, "{pushes:?} N, {contacts:?} s");
    let [feet, margins] = [of("foot_load_nonlinear_n"), of("slip_margin_nonlinear_n")];
    assert!(feet[0] > 100.0 && margins[0] > 150.0, "{feet:?} N, {margins:?} N");
    assert!(feet[1] < feet[0] - 50.0 && margins[1] < margins[0] - 50.0, "{feet:?}, {margins:?}");
}

#[test]
fn what_needs_stops_or_a_cabinet_says_so() {
    let text = example();
    let bare = text.split("[[stops]]").next().expect("a first part");
    let home = home(bare);
    let run = home.sweep(&["run", "g.toml"]);
    assert_eq!(run.status.code(), Some(2), "{}", said(&run));
    let told = said(&run);
    for part in ["`stop_force` needs", "`foot_load` needs", "[[stops]]", "[cabinet]"] {
        assert!(told.contains(part), "{part} is not in {told}");
    }
}

#[test]
fn feet_that_do_not_hold_the_cabinet_are_refused() {
    let text = example();
    let lifted = text.replace("centre_m = [0.18, -0.1, 0.0] ", "centre_m = [1.8, -0.1, 0.0] ");
    let two = text.rsplitn(3, "[[feet]]").last().expect("a first part");
    let (before, after) = text.split_once("[cabinet]").expect("a cabinet");
    let (_, feet) = after.split_once("[[feet]]").expect("feet");
    let without = format!("{before}[[feet]]{feet}");
    for (machine, expected) in [
        (lifted.as_str(), "lifts at rest"),
        (two, "the cabinet stands on 2 feet"),
        (without.as_str(), "feet without a cabinet"),
    ] {
        let run = home(machine).sweep(&["run", "g.toml"]);
        assert_eq!(run.status.code(), Some(2), "{}", said(&run));
        assert!(said(&run).contains(expected), "{expected} is not in {}", said(&run));
    }
}

#[test]
fn stability_is_for_smooth_forces() {
    let home = home(&example());
    let at = "unbalance_mass_kg=1";
    for words in
        [&["stability", "g.toml", "--speed", "240:260:10"][..], &["explain", "g.toml", "--at", at]]
    {
        let found = home.sweep(words);
        assert_eq!(found.status.code(), Some(2), "{words:?}: {}", said(&found));
        assert!(said(&found).contains("dampers with friction, and stops"), "{}", said(&found));
    }
}

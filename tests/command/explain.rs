//! `sweep explain` as a user meets it: what it finds, says and refuses.

#![cfg(unix)]

use std::fs;
use std::process::{Command, Output};

use serde_json::Value;

use crate::home::{said, sweep_binary};

const AXES: &str = r#"
[[axis]]
parameter = "unbalance_mass_kg"
values = [0.4]
[[axis]]
parameter = "damping_n_s_per_m"
values = [100.0, 140.0, 300.0]
"#;

fn grid(spin: &str, axes: &str) -> String {
    format!(
        "machine = \"paper\"\n[spin]\n{spin}\n[time]\nend_s = 50.0\nwindow_s = [30.0, 50.0]\n\
         [integrator]\nmethod = \"rk4-mass-scaled\"\naccuracy = 1e-3\n{axes}"
    )
}

const PAPER: &str = "profile = \"triangular\"\npeak_rpm = 350.0\nramp_s = 50.0";

fn explain(grid: &str, arguments: &[&str]) -> Output {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("grid.toml"), grid).expect("it is written");
    let mut command = Command::new(sweep_binary());
    command.current_dir(folder.path()).args(["explain", "grid.toml"]).args(arguments);
    command.output().expect("it starts")
}

fn within(value: &Value, meant: f64, tolerance: f64) {
    let value = value.as_f64().expect("a number");
    assert!((value - meant).abs() <= tolerance, "{value}, not {meant} +- {tolerance}");
}

#[test]
fn the_papers_machine_has_two_tongues_with_the_references_edges_and_dampings() {
    let more = ["--json", "--ratio-limit", "2.5", "--name", "own", "--progress", "none"];
    let arguments = [&["--at", "damping_n_s_per_m=140"], &more[..]].concat();
    let done = explain(&grid(PAPER, AXES), &arguments);
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    let found: Value = serde_json::from_slice(&done.stdout).expect("it is JSON");
    assert_eq!(found["swept"]["reliable"], true);
    assert_eq!((&found["swept"]["ratio_limit"], &found["name"]), (&2.5.into(), &"own".into()));
    let tongues = found["tongues"].as_array().expect("a list");
    assert_eq!(tongues.len(), 2);
    // Edges, growth and critical damping as in stability.json, which another program made.
    let reference = [
        ("quasi_periodic", [238.4, 259.8], 230.0, [1, 2]),
        ("period_doubling", [294.5, 317.0], 253.0, [2, 2]),
    ];
    for (tongue, (kind, [from, to], damping, modes)) in tongues.iter().zip(reference) {
        assert_eq!(tongue["kind"], kind);
        within(&tongue["from_rpm"], from, 0.1);
        within(&tongue["to_rpm"], to, 0.1);
        within(&tongue["closed_by"]["damping_n_s_per_m"], damping, 1.0);
        assert_eq!(tongue["resonance"]["modes"], serde_json::json!(modes));
        let sum = tongue["resonance"]["sum_cpm"].as_f64().expect("a number");
        let speed = tongue["growth_at_rpm"].as_f64().expect("a number");
        assert!((sum / speed - 1.0).abs() < 0.02, "{sum} {speed}");
        // 7 rpm a second, once: the window ends at the turn.
        let crossed = tongue["crossed"].as_array().expect("a list");
        assert_eq!(crossed.len(), 1);
        within(&crossed[0]["from_s"], from / 7.0, 0.02);
        within(&crossed[0]["to_s"], to / 7.0, 0.02);
        let e_folds = crossed[0]["e_folds"].as_f64().expect("a number");
        let amplification = crossed[0]["amplification"].as_f64().expect("a number");
        // No direction grows less than it would by the exponents, give or take what the ramp does.
        assert!(e_folds > 0.3 && amplification > 0.9 * e_folds.exp(), "{e_folds} {amplification}");
    }
    assert!(found["entered_on_responses"]["ratio_max"].as_f64().expect("a number") < 2.0);
}

/// A corner of Fig. 12 whose response folds back: one wide band, and no damping that was not tried.
#[test]
fn a_folded_response_is_one_band_and_its_jump_is_named() {
    let axes = AXES.replace("[0.4]", "[1.0]").replace("100.0, 140.0", "60.0, 140.0");
    let at = ["--at", "damping_n_s_per_m=60", "--speed", "200:350:1", "--json"];
    let done = explain(&grid(PAPER, &axes), &at);
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    let found: Value = serde_json::from_slice(&done.stdout).expect("it is JSON");
    within(&found["speeds"]["jumps_rpm"][0], 243.06, 0.1);
    let tongues = found["tongues"].as_array().expect("a list");
    assert_eq!(tongues.len(), 2, "{tongues:?}");
    within(&tongues[0]["to_rpm"], 243.06, 0.1);
    within(&tongues[1]["from_rpm"], 243.06, 0.1);
    for tongue in tongues {
        let closed = &tongue["closed_by"];
        // What is said to close it leaves no growth anywhere about it.
        if let Some(damping) = closed["damping_n_s_per_m"].as_f64() {
            let axes = axes.replace("60.0, 140.0", &format!("{damping}"));
            let [from, to] = [0, 1].map(|end| closed["nothing_grows_from_to_rpm"][end].to_string());
            let speed = format!("{from}:{to}:1");
            let at = format!("damping_n_s_per_m={damping}");
            let done = explain(&grid(PAPER, &axes), &["--at", &at, "--speed", &speed, "--json"]);
            let found: Value = serde_json::from_slice(&done.stdout).expect("it is JSON");
            assert_eq!(found["tongues"], serde_json::json!([]), "{damping}");
        }
    }
}

#[test]
fn a_stable_machine_is_told_so() {
    let done =
        explain(&grid(PAPER, AXES), &["--at", "damping_n_s_per_m=300", "--speed", "200:340:5"]);
    let told = said(&done);
    assert_eq!(done.status.code(), Some(0), "{told}");
    for line in ["stable at every speed from 200 to 340 rpm", "and the models agree"] {
        assert!(told.contains(line), "{line}\n{told}");
    }
    // What is said follows the limits: friction lets the vertical motion be less.
    let strict = format!("{}[reliability]\nratio_min = 0.98\n", grid(PAPER, AXES));
    let at = ["--at", "damping_n_s_per_m=300", "--at", "friction_n=60", "--speed", "300:340:20"];
    let done = explain(&strict, &at);
    let told = said(&done);
    for line in ["0.98 and 2", "over-estimates, a ratio is below 0.98"] {
        assert!(told.contains(line), "{line}\n{told}");
    }
    assert!(!told.contains("the models agree"), "{told}");
}

#[test]
fn what_makes_no_sense_is_refused_before_any_work() {
    let paper = grid(PAPER, AXES);
    let backwards = "profile = \"table\"\ntime_s = [0, 9, 20]\nspeed_rpm = [0, 100, -100]";
    let still = "profile = \"table\"\ntime_s = [0]\nspeed_rpm = [0]";
    for (grid, arguments, expected) in [
        (&paper, &[][..], "damping_n_s_per_m"),
        (&paper, &["--at", "damping_n_s_per_m=140", "--at", "tub_mas_kg=1"][..], "tub_mass_kg"),
        (&paper, &["--at", "damping_n_s_per_m=140", "--speed", "0:9:1"][..], "above 0 rpm"),
        (&grid(backwards, ""), &[][..], "turns forwards"),
        (&grid(still, ""), &[][..], "a profile that exceeds"),
    ] {
        let refused = explain(grid, arguments);
        assert_eq!(refused.status.code(), Some(2), "{arguments:?}: {}", said(&refused));
        assert!(said(&refused).contains(expected), "{expected}: {}", said(&refused));
    }
}

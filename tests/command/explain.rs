//! Tests of `sweep explain`: its results and errors.

#![cfg(unix)]

use std::fs;
use std::process::{Command, Output};

use serde_json::Value;

use crate::test_folder::{all_output, sweep_binary};

const AXES: &str = r#"
[[axis]]
parameter = "unbalance_mass_kg"
values = [0.4]
[[axis]]
parameter = "damping_n_s_per_m"
values = [100.0, 140.0, 300.0]
"#;

fn grid_text(spin: &str, axes: &str) -> String {
    format!(
        "machine = \"paper\"\n[spin]\n{spin}\n[time]\nend_s = 50.0\nwindow_s = [30.0, 50.0]\n\
         [integrator]\nmethod = \"rk4-mass-scaled\"\naccuracy = 1e-3\n{axes}"
    )
}

const PAPER_SPIN: &str = "profile = \"triangular\"\npeak_rpm = 350.0\nramp_s = 50.0";

fn run_explain(grid: &str, arguments: &[&str]) -> Output {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("grid.toml"), grid).expect("it is written");
    let mut command = Command::new(sweep_binary());
    command.current_dir(folder.path()).args(["explain", "grid.toml"]).args(arguments);
    command.output().expect("it starts")
}

fn assert_number_near(value: &Value, expected: f64, tolerance: f64) {
    let number = value.as_f64().expect("a number");
    assert!((number - expected).abs() <= tolerance, "{number}, not {expected} +- {tolerance}");
}

#[test]
fn tongues_of_the_papers_machine_agree_with_the_reference() {
    let options = ["--json", "--ratio-limit", "2.5", "--name", "own", "--progress", "none"];
    let arguments = [&["--at", "damping_n_s_per_m=140"], &options[..]].concat();
    let command_output = run_explain(&grid_text(PAPER_SPIN, AXES), &arguments);
    assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
    let explanation: Value = serde_json::from_slice(&command_output.stdout).expect("it is JSON");
    assert_eq!(explanation["swept"]["reliable"], true);
    assert_eq!(
        (&explanation["swept"]["ratio_limit"], &explanation["name"]),
        (&2.5.into(), &"own".into())
    );
    let tongues = explanation["tongues"].as_array().expect("a list");
    assert_eq!(tongues.len(), 2);
    // The edges, growth and critical damping are those of an independent program, in
    // stability.json.
    let reference = [
        ("quasi_periodic", [238.4, 259.8], 230.0, [1, 2]),
        ("period_doubling", [294.5, 317.0], 253.0, [2, 2]),
    ];
    for (tongue, (kind, [from, to], critical_damping, mode_numbers)) in
        tongues.iter().zip(reference)
    {
        assert_eq!(tongue["kind"], kind);
        assert_number_near(&tongue["from_rpm"], from, 0.1);
        assert_number_near(&tongue["to_rpm"], to, 0.1);
        assert_number_near(&tongue["closed_by"]["damping_n_s_per_m"], critical_damping, 1.0);
        assert_eq!(tongue["resonance"]["modes"], serde_json::json!(mode_numbers));
        let sum_cpm = tongue["resonance"]["sum_cpm"].as_f64().expect("a number");
        let growth_speed_rpm = tongue["growth_at_rpm"].as_f64().expect("a number");
        assert!((sum_cpm / growth_speed_rpm - 1.0).abs() < 0.02, "{sum_cpm} {growth_speed_rpm}");
        // The run passes once at 7 rpm/s, because the window ends where the spin turns.
        let crossings = tongue["crossed"].as_array().expect("a list");
        assert_eq!(crossings.len(), 1);
        assert_number_near(&crossings[0]["from_s"], from / 7.0, 0.02);
        assert_number_near(&crossings[0]["to_s"], to / 7.0, 0.02);
        let e_folds = crossings[0]["e_folds"].as_f64().expect("a number");
        let amplification = crossings[0]["amplification"].as_f64().expect("a number");
        // Disturbances grow by at least 0.9 times the growth that the exponents predict. The ramp
        // of the speed explains the rest.
        assert!(e_folds > 0.3 && amplification > 0.9 * e_folds.exp(), "{e_folds} {amplification}");
    }
    assert!(explanation["entered_on_responses"]["ratio_max"].as_f64().expect("a number") < 2.0);
}

/// The curve of responses at 1 kg and 60 N s/m (Fig. 12 of the paper) folds back, so that a jump
/// divides its wide unstable range into two tongues. The critical damping is checked by
/// computation.
#[test]
fn a_folded_response_has_one_band_with_a_jump() {
    let changed_axes = AXES.replace("[0.4]", "[1.0]").replace("100.0, 140.0", "60.0, 140.0");
    let explain_options = ["--at", "damping_n_s_per_m=60", "--speed", "200:350:1", "--json"];
    let command_output = run_explain(&grid_text(PAPER_SPIN, &changed_axes), &explain_options);
    assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
    let explanation: Value = serde_json::from_slice(&command_output.stdout).expect("it is JSON");
    assert_number_near(&explanation["speeds"]["jumps_rpm"][0], 243.06, 0.1);
    let tongues = explanation["tongues"].as_array().expect("a list");
    assert_eq!(tongues.len(), 2, "{tongues:?}");
    assert_number_near(&tongues[0]["to_rpm"], 243.06, 0.1);
    assert_number_near(&tongues[1]["from_rpm"], 243.06, 0.1);
    for tongue in tongues {
        let closing_damping = &tongue["closed_by"];
        // With the critical damping no disturbance grows near the tongue.
        if let Some(damping) = closing_damping["damping_n_s_per_m"].as_f64() {
            let changed_axes = changed_axes.replace("60.0, 140.0", &format!("{damping}"));
            let [from_rpm, to_rpm] =
                [0, 1].map(|end| closing_damping["nothing_grows_from_to_rpm"][end].to_string());
            let speed_range = format!("{from_rpm}:{to_rpm}:1");
            let point_option = format!("damping_n_s_per_m={damping}");
            let command_output = run_explain(
                &grid_text(PAPER_SPIN, &changed_axes),
                &["--at", &point_option, "--speed", &speed_range, "--json"],
            );
            let explanation: Value =
                serde_json::from_slice(&command_output.stdout).expect("it is JSON");
            assert_eq!(explanation["tongues"], serde_json::json!([]), "{damping}");
        }
    }
}

#[test]
fn a_stable_machine_has_no_tongues() {
    let command_output = run_explain(
        &grid_text(PAPER_SPIN, AXES),
        &["--at", "damping_n_s_per_m=300", "--speed", "200:340:5"],
    );
    let messages = all_output(&command_output);
    assert_eq!(command_output.status.code(), Some(0), "{messages}");
    for line in ["stable at every speed from 200 to 340 rpm", "and the models agree"] {
        assert!(messages.contains(line), "{line}\n{messages}");
    }
    // With friction the nonlinear vertical motion is smaller than the linear one, so that a ratio
    // is below `ratio_min`, and the summary names both limits.
    let strict_grid = format!("{}[reliability]\nratio_min = 0.98\n", grid_text(PAPER_SPIN, AXES));
    let strict_options =
        ["--at", "damping_n_s_per_m=300", "--at", "friction_n=60", "--speed", "300:340:20"];
    let command_output = run_explain(&strict_grid, &strict_options);
    let messages = all_output(&command_output);
    for line in ["0.98 and 2", "over-estimates: a ratio is below 0.98"] {
        assert!(messages.contains(line), "{line}\n{messages}");
    }
    assert!(!messages.contains("the models agree"), "{messages}");
}

#[test]
fn contradictory_options_are_errors_before_the_computation() {
    let paper_grid = grid_text(PAPER_SPIN, AXES);
    let standing_spin = "profile = \"table\"\ntime_s = [0]\nspeed_rpm = [0]";
    for (grid_text, arguments, expected_text) in [
        (&paper_grid, &[][..], "damping_n_s_per_m"),
        (
            &paper_grid,
            &["--at", "damping_n_s_per_m=140", "--at", "tub_mas_kg=1"][..],
            "tub_mass_kg",
        ),
        (&paper_grid, &["--at", "damping_n_s_per_m=140", "--speed", "0:9:1"][..], "above 0 rpm"),
        (&grid_text(standing_spin, ""), &[][..], "a profile that exceeds"),
    ] {
        let refused_output = run_explain(grid_text, arguments);
        assert_eq!(
            refused_output.status.code(),
            Some(2),
            "{arguments:?}: {}",
            all_output(&refused_output)
        );
        assert!(
            all_output(&refused_output).contains(expected_text),
            "{expected_text}: {}",
            all_output(&refused_output)
        );
    }
}

/// The drum runs up, pauses and runs up backwards. The paper's machine is symmetric, so that its
/// tongues are the same in both directions; a machine with a stiffer spring is not symmetric.
#[test]
fn a_spin_may_reverse_and_pause() {
    let cycle_spin = "profile = \"table\"\ntime_s = [0, 20, 22, 30, 50]\n\
                 speed_rpm = [0, 280, 0, 0, -280]";
    let arguments = ["--at", "damping_n_s_per_m=140", "--speed", "225:275:5", "--json"];
    let explain_json = |options: &[&str]| {
        let command_output =
            run_explain(&grid_text(cycle_spin, AXES), &[&arguments, options].concat());
        assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
        serde_json::from_slice::<Value>(&command_output.stdout).expect("it is JSON")
    };
    let explanation = explain_json(&[]);
    assert_eq!(explanation["speeds"], explanation["speeds_backwards"]);
    let tongues = explanation["tongues"].as_array().expect("a list");
    let [forward, backward] = &tongues[..] else { panic!("{tongues:?}") };
    assert_eq!([&forward["is_backward"], &backward["is_backward"]], [false, true]);
    for name in ["from_rpm", "to_rpm", "growth_per_s"] {
        let forward_value = forward[name].as_f64().expect("a number");
        assert_number_near(&backward[name], forward_value, 1e-3);
    }
    let crossing_start_s = |tongue: &Value, crossing: usize| {
        tongue["crossed"][crossing]["from_s"].as_f64().expect("a number")
    };
    // The run passes twice forwards, up and down, and once backwards.
    let crossing_counts =
        [forward, backward].map(|tongue| tongue["crossed"].as_array().map(Vec::len));
    assert_eq!(crossing_counts, [Some(2), Some(1)]);
    assert!(
        crossing_start_s(forward, 0) < 20.0
            && crossing_start_s(forward, 1) < 22.0
            && crossing_start_s(backward, 0) > 45.0
    );
    let departure_j = backward["crossed"][0]["departure_j"][0].as_f64().expect("a number");
    assert!(departure_j > 0.0);
    let asymmetric_explanation = explain_json(&["--at", "spring_1_stiffness_n_per_m=10000"]);
    let lower_edges_rpm: Vec<f64> = asymmetric_explanation["tongues"]
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|tongue| tongue["from_rpm"].as_f64())
        .collect();
    assert!(
        lower_edges_rpm.len() == 2 && (lower_edges_rpm[0] - lower_edges_rpm[1]).abs() > 0.05,
        "{lower_edges_rpm:?}"
    );
}

/// The models of the paper's machine differ due to its tongues, mostly the first one. The run
/// passes the end of the last tongue late, where disturbances grow little.
#[test]
fn tongues_that_are_passed_late_are_not_causes() {
    let explain_json = |mass: &str, speed: &str| {
        let changed_axes = AXES.replace("[0.4]", &format!("[{mass}]"));
        let arguments = ["--at", "damping_n_s_per_m=100", "--speed", speed, "--json"];
        let command_output = run_explain(&grid_text(PAPER_SPIN, &changed_axes), &arguments);
        assert_eq!(command_output.status.code(), Some(0), "{}", all_output(&command_output));
        serde_json::from_slice::<Value>(&command_output.stdout).expect("it is JSON")
    };
    let whole_range_explanation = explain_json("0.4", "225:325:5");
    let deviation = &whole_range_explanation["deviation"];
    assert_eq!(deviation["tongues_are_the_cause"], true, "{deviation}");
    assert!(deviation["ratio_without_tongues"].as_f64().expect("a number") < 2.0, "{deviation}");
    // The only unstable one of these speeds is the end of the last tongue.
    let last_speeds_explanation = explain_json("0.4", "315:325:1");
    let deviation = &last_speeds_explanation["deviation"];
    assert_eq!(deviation["tongues_are_the_cause"], false, "{deviation}");
    assert!(deviation["e_folds_of_tongues"].as_f64().expect("a number") < 0.2, "{deviation}");
    assert!(deviation["ratio_without_tongues"].as_f64().expect("a number") > 2.0, "{deviation}");
}

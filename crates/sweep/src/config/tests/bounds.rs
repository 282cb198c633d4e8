//! Tests of the bounds on input, and of the time to check input within them.

use std::fmt::Write as _;

use proptest::prelude::*;

use super::super::*;
use super::{SMALLEST, load_text};
use crate::estimate;

/// Returns a grid whose spin is a table with a number of rows.
fn with_a_table(rows: usize, more: &str) -> String {
    let column = |value: fn(usize) -> f64| {
        (0..rows).fold(String::new(), |mut text, k| {
            let _ = write!(text, "{},", value(k));
            text
        })
    };
    let times = column(|k| k as f64 / 64.0);
    let speeds = column(|k| (k % 100) as f64);
    format!(
        "[spin]\nprofile = \"table\"\ntime_s = [{times}]\nspeed_rpm = [{speeds}]\n\
         [time]\nend_s = 320\n{more}"
    )
}

/// Loads a grid with a list of points.
fn load_list(grid: &str, list: &str) -> Result<Plan, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.toml");
    std::fs::write(folder.path().join("points.csv"), list).unwrap();
    let design = "[design]\nmethod = \"list\"\nfile = \"points.csv\"\n";
    std::fs::write(&path, format!("{grid}{design}")).unwrap();
    load(&path, &[]).map_err(|diagnostics| diagnostics.to_string())
}

#[test]
fn the_longest_spin_is_checked_and_a_longer_one_is_refused() {
    // Six axes have 64 corners, at each of which the machine and the whole table are checked.
    let masses = ["tub_mass_kg", "shaft_mass_kg", "drum_mass_kg", "unbalance_mass_kg"];
    let range = "range = { from = 1, to = 2, count = 2 }\n";
    let axis = |name: &str| format!("[[axis]]\nparameter = \"{name}\"\n{range}");
    let mut axes: String = masses.map(axis).concat();
    axes.push_str(&axis("damping_n_s_per_m"));
    axes.push_str(&axis("spin_table_2_speed_rpm"));
    let plan = load_text(with_a_table(spin::MAX_ROWS, &axes), &[]).unwrap();
    assert_eq!(plan.corners(), 64);
    let refused = load_text(with_a_table(spin::MAX_ROWS + 1, &axes), &[]).unwrap_err();
    assert!(refused.contains("`time_s` has 20001 numbers"), "{refused}");
    assert!(refused.contains("at most 20000"), "{refused}");
    assert!(!refused.contains("is empty"), "{refused}");
}

#[test]
fn a_list_of_millions_of_points_is_checked() {
    // The only wrong point is in the last row.
    let mut list = "spring_1_cabinet_x_m,shaft_mass_kg\n".to_owned();
    list.push_str(&"0.1,1e0\n".repeat(3_000_000));
    let plan = load_list(SMALLEST, &list).unwrap();
    assert_eq!(plan.points(), 3_000_000);
    assert!((250..=256).contains(&plan.some_corners().len()));
    list.push_str("0.1,0\n");
    let refused = load_list(SMALLEST, &list).unwrap_err();
    assert!(refused.contains("points.csv:3000002:5"), "{refused}");
    assert!(refused.contains("value 3000001"), "{refused}");
}

#[test]
fn extreme_points_of_a_long_list_are_corners() {
    let mut list = "bearing_stiffness_n_per_m,shaft_mass_kg\n".to_owned();
    for point in 0..100_000 {
        list.push_str(match point {
            30_011 => "5e10,4\n",
            77_777 => "2e8,0.5\n",
            _ => "2e8,4\n",
        });
    }
    let corners = load_list(SMALLEST, &list).unwrap().some_corners();
    assert!(corners.contains(&vec![5e10, 4.0]) && corners.contains(&vec![2e8, 0.5]), "{corners:?}");
}

#[test]
fn points_that_would_take_minutes_to_check_are_refused() {
    let mut list = "spin_table_2_speed_rpm\n".to_owned();
    list.push_str(&"5\n".repeat(50_001));
    let refused = load_list(&with_a_table(20_000, ""), &list).unwrap_err();
    assert!(refused.contains("50001") && refused.contains("at most 50000 points"), "{refused}");
    // An axis of a mass leaves the table as it is, so that it is checked once.
    let list = list.replace("spin_table_2_speed_rpm", "tub_mass_kg");
    assert_eq!(load_list(&with_a_table(20_000, ""), &list).unwrap().points(), 50_001);
}

/// Loads a grid with a tub so light that its dampers make it stiff.
fn light(tub_mass_kg: f64, end_s: f64, integrator: &str) -> Result<Plan, String> {
    let grid = SMALLEST.replace("end_s = 50", &format!("end_s = {end_s}"));
    let set = format!("[set]\ntub_mass_kg = {tub_mass_kg:e}\n");
    load_text(format!("{grid}{set}[integrator]\n{integrator}\n"), &[])
}

#[test]
fn a_machine_that_is_too_stiff_is_refused_with_every_explicit_method() {
    for method in ["rk4-mass-scaled", "dopri5", "rk4"] {
        let refused = light(1e-9, 50.0, &format!("method = \"{method}\"")).unwrap_err();
        assert!(refused.contains("the machine is too stiff"), "{refused}");
        assert!(refused.contains("use method = \"additive\""), "{refused}");
    }
    assert!(light(1e-9, 50.0, "method = \"additive\"").is_ok());
    assert!(light(1e-6, 1.0, "method = \"rk4-mass-scaled\"").is_ok());
}

#[test]
fn a_machine_with_too_stiff_dampers_is_refused_with_the_additive_method() {
    for method in ["dopri5", "additive"] {
        let set = "[set]\ndamping_n_s_per_m = 1e12\n";
        let grid = format!("{SMALLEST}{set}[integrator]\nmethod = \"{method}\"\n");
        let refused = load_text(grid, &[]).unwrap_err();
        assert!(refused.contains("the machine is too stiff"), "{refused}");
        assert!(!refused.contains("use method"), "it is of no use: {refused}");
    }
}

#[test]
fn a_step_above_the_stability_limit_is_refused_with_a_suitable_method() {
    let grid = format!("{SMALLEST}[integrator]\nmethod = \"rk4\"\nstep_s = 1e-3\n");
    let refused = load_text(grid, &[]).unwrap_err();
    assert!(refused.contains("past the stability limit of rk4"), "{refused}");
    assert!(refused.contains("method = \"additive\""), "{refused}");
}

#[test]
fn the_estimate_of_a_stiff_machine_is_from_a_beginning() {
    let plan = light(1e-6, 10.0, "method = \"dopri5\"").unwrap();
    let estimate = estimate::estimate(&plan, 1).unwrap();
    assert!(estimate.sampled_s < 1.0, "{estimate:?}");
}

#[test]
fn mistakes_beside_an_unknown_choice_are_reported() {
    let refused = |text: &str, parts: &[&str]| {
        let refused = load_text(text, &[]).unwrap_err();
        for part in parts {
            assert!(refused.contains(part), "no {part} in\n{refused}");
        }
    };
    refused(
        "[spin]\nprofile = \"sinus\"\npeak_rpm = \"fast\"\nramp_s = -1\nspeed = 3\n\
         [time]\nend_s = 50\n",
        &["unknown profile", "`peak_rpm` has the wrong type", "`ramp_s` = -1", "key `speed`"],
    );
    refused(
        &format!(
            "{SMALLEST}[integrator]\nmethod = \"euler\"\nstep_s = 0\n\
             rtol = \"small\"\norder = 1\n"
        ),
        &["unknown method", "`step_s` = 0", "`rtol` has the wrong type", "unknown key `order`"],
    );
    refused(
        &format!(
            "{SMALLEST}[design]\nmethod = \"halton\"\npoints = 0\nseed = -1\nskip = 3\n\
             [[axis]]\nparameter = \"tub_mas_kg\"\n"
        ),
        &[
            "unknown method",
            "`points` = 0",
            "`seed` = -1",
            "unknown key `skip`",
            "unknown parameter `tub_mas_kg`",
            "`range` is missing",
        ],
    );
    let refused = load_list(SMALLEST, "tub_mas_kg,shaft_mass_kg\n1,x\n1,-5\n1\n").unwrap_err();
    for part in
        ["unknown parameter", "`x` is not a number", "value 2 of `shaft_mass_kg`", "a row of"]
    {
        assert!(refused.contains(part), "no {part} in\n{refused}");
    }
    assert!(refused.contains("4 mistakes"), "{refused}");
}

#[test]
fn a_range_with_too_few_different_values_is_refused() {
    let load = |from: f64, to: f64, count: u64, spacing: &str| {
        let ends = format!("from = {from:?}, to = {to:?}");
        let range = format!("{{ {ends}, count = {count}, spacing = \"{spacing}\" }}");
        let axis = format!("[[axis]]\nparameter = \"tub_mass_kg\"\nrange = {range}\n");
        load_text(format!("{SMALLEST}{axis}"), &[])
    };
    let close = 1.0 + 2.0 * f64::EPSILON;
    for spacing in ["linear", "log"] {
        let refused = load(1.0, close, 5, spacing).unwrap_err();
        assert!(refused.contains("has no 5 different values"), "{refused}");
        assert!(refused.contains("at most 2"), "{refused}");
        assert_eq!(load(1.0, close, 2, spacing).unwrap().points(), 2);
        assert_eq!(load(1.0, 2.0, 1_000_000_000_000, spacing).unwrap().points(), 1_000_000_000_000);
    }
    let design = "[design]\nmethod = \"sobol\"\npoints = 1024\n\
        [[axis]]\nparameter = \"tub_mass_kg\"\n";
    let range = format!("range = {{ from = 1.0, to = {close:?} }}\n");
    let refused = load_text(format!("{SMALLEST}{design}{range}"), &[]).unwrap_err();
    assert!(refused.contains("has no 1024 different values"), "{refused}");
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 200,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn values_of_a_range_that_is_accepted_are_all_different(
        from in 1e-6_f64..1e6,
        ulps in 1_u64..400,
        count in 2_u64..60,
        down in any::<bool>(),
        log in any::<bool>(),
    ) {
        let to = f64::from_bits(from.to_bits() + ulps);
        let [from, to] = if down { [to, from] } else { [from, to] };
        let spacing = if log { "log" } else { "linear" };
        let ends = format!("from = {from:?}, to = {to:?}");
        let range = format!("{{ {ends}, count = {count}, spacing = \"{spacing}\" }}");
        let grid = format!("{SMALLEST}[[axis]]\nparameter = \"tub_mass_kg\"\nrange = {range}\n");
        match load_text(grid, &[]) {
            Ok(plan) => {
                let values: Vec<f64> = (0..count).map(|i| plan.axes[0].values.value(i)).collect();
                let ordered = |pair: &[f64]| (pair[0] > pair[1]) == down && pair[0] != pair[1];
                prop_assert!(values.windows(2).all(ordered), "{values:?}");
            }
            Err(refused) => {
                prop_assert!(refused.contains("different values") && count > 2, "{refused}");
            }
        }
    }
}

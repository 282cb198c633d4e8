//! Tests of the bounds on the size of input, and that input within the bounds is checked quickly.

use std::fmt::Write as _;

use proptest::prelude::*;

use super::super::*;
use super::{MINIMAL_GRID, load_text};
use crate::estimate;

/// Returns a grid whose spin is a table with a number of rows.
fn grid_with_table(row_count: usize, sections: &str) -> String {
    let column_text = |value: fn(usize) -> f64| {
        (0..row_count).fold(String::new(), |mut text, k| {
            let _ = write!(text, "{},", value(k));
            text
        })
    };
    let times = column_text(|k| k as f64 / 64.0);
    let speeds = column_text(|k| (k % 100) as f64);
    format!(
        "[spin]\nprofile = \"table\"\ntime_s = [{times}]\nspeed_rpm = [{speeds}]\n\
         [time]\nend_s = 320\n{sections}"
    )
}

/// Loads a grid with a list of points.
fn load_list(grid_text: &str, list_text: &str) -> Result<Plan, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.toml");
    std::fs::write(folder.path().join("points.csv"), list_text).unwrap();
    let design_section = "[design]\nmethod = \"list\"\nfile = \"points.csv\"\n";
    std::fs::write(&path, format!("{grid_text}{design_section}")).unwrap();
    load(&path, &[]).map_err(|diagnostics| diagnostics.to_string())
}

#[test]
fn the_longest_spin_is_checked_and_a_longer_one_is_refused() {
    // Six axes have 64 corners, at each of which the machine and the whole table are checked.
    let masses = ["tub_mass_kg", "shaft_mass_kg", "drum_mass_kg", "unbalance_mass_kg"];
    let range_key = "range = { from = 1, to = 2, count = 2 }\n";
    let axis_text = |name: &str| format!("[[axis]]\nparameter = \"{name}\"\n{range_key}");
    let mut axis_texts: String = masses.map(axis_text).concat();
    axis_texts.push_str(&axis_text("damping_n_s_per_m"));
    axis_texts.push_str(&axis_text("spin_table_2_speed_rpm"));
    let plan = load_text(grid_with_table(spin::MAX_TABLE_ROWS, &axis_texts), &[]).unwrap();
    assert_eq!(plan.corner_count(), 64);
    let refusal =
        load_text(grid_with_table(spin::MAX_TABLE_ROWS + 1, &axis_texts), &[]).unwrap_err();
    assert!(refusal.contains("`time_s` has 20001 numbers"), "{refusal}");
    assert!(refusal.contains("at most 20000"), "{refusal}");
    assert!(!refusal.contains("is empty"), "{refusal}");
}

#[test]
fn a_list_of_millions_of_points_is_checked() {
    // The only invalid point is in the last row.
    let mut list_text = "spring_1_cabinet_x_m,shaft_mass_kg\n".to_owned();
    list_text.push_str(&"0.1,1e0\n".repeat(3_000_000));
    let plan = load_list(MINIMAL_GRID, &list_text).unwrap();
    assert_eq!(plan.points(), 3_000_000);
    assert!((250..=256).contains(&plan.corners_to_prepare().len()));
    list_text.push_str("0.1,0\n");
    let refusal = load_list(MINIMAL_GRID, &list_text).unwrap_err();
    assert!(refusal.contains("points.csv:3000002:5"), "{refusal}");
    assert!(refusal.contains("value 3000001"), "{refusal}");
}

#[test]
fn extreme_points_of_a_long_list_are_corners() {
    let mut list_text = "bearing_stiffness_n_per_m,shaft_mass_kg\n".to_owned();
    for point in 0..100_000 {
        list_text.push_str(match point {
            30_011 => "5e10,4\n",
            77_777 => "2e8,0.5\n",
            _ => "2e8,4\n",
        });
    }
    let corners = load_list(MINIMAL_GRID, &list_text).unwrap().corners_to_prepare();
    assert!(corners.contains(&vec![5e10, 4.0]) && corners.contains(&vec![2e8, 0.5]), "{corners:?}");
}

#[test]
fn points_that_would_take_minutes_to_check_are_refused() {
    let mut list_text = "spin_table_2_speed_rpm\n".to_owned();
    list_text.push_str(&"5\n".repeat(50_001));
    let refusal = load_list(&grid_with_table(20_000, ""), &list_text).unwrap_err();
    assert!(refusal.contains("50001") && refusal.contains("at most 50000 points"), "{refusal}");
    // If the list varies a mass, the table is the same at all points, so that it is checked once.
    let mass_list_text = list_text.replace("spin_table_2_speed_rpm", "tub_mass_kg");
    assert_eq!(load_list(&grid_with_table(20_000, ""), &mass_list_text).unwrap().points(), 50_001);
}

/// Loads a grid with a tub that is light enough for its dampers to make it stiff.
fn load_light_tub(tub_mass_kg: f64, end_s: f64, integrator: &str) -> Result<Plan, String> {
    let grid = MINIMAL_GRID.replace("end_s = 50", &format!("end_s = {end_s}"));
    let set_section = format!("[set]\ntub_mass_kg = {tub_mass_kg:e}\n");
    load_text(format!("{grid}{set_section}[integrator]\n{integrator}\n"), &[])
}

#[test]
fn a_machine_that_is_too_stiff_is_refused_with_every_explicit_method() {
    for method in ["rk4-mass-scaled", "dopri5", "rk4"] {
        let refusal = load_light_tub(1e-9, 50.0, &format!("method = \"{method}\"")).unwrap_err();
        assert!(refusal.contains("the machine is too stiff"), "{refusal}");
        assert!(refusal.contains("use method = \"additive\""), "{refusal}");
    }
    assert!(load_light_tub(1e-9, 50.0, "method = \"additive\"").is_ok());
    assert!(load_light_tub(1e-6, 1.0, "method = \"rk4-mass-scaled\"").is_ok());
}

#[test]
fn a_machine_with_too_stiff_dampers_is_refused_with_the_additive_method() {
    for method in ["dopri5", "additive"] {
        let set_section = "[set]\ndamping_n_s_per_m = 1e12\n";
        let grid = format!("{MINIMAL_GRID}{set_section}[integrator]\nmethod = \"{method}\"\n");
        let refusal = load_text(grid, &[]).unwrap_err();
        assert!(refusal.contains("the machine is too stiff"), "{refusal}");
        assert!(!refusal.contains("use method"), "it is of no use: {refusal}");
    }
}

#[test]
fn a_step_above_the_stability_limit_is_refused_with_a_suitable_method() {
    let grid = format!("{MINIMAL_GRID}[integrator]\nmethod = \"rk4\"\nstep_s = 1e-3\n");
    let refusal = load_text(grid, &[]).unwrap_err();
    assert!(refusal.contains("past the stability limit of rk4"), "{refusal}");
    assert!(refusal.contains("method = \"additive\""), "{refusal}");
}

#[test]
fn the_estimate_of_a_stiff_machine_takes_a_short_sample() {
    let plan = load_light_tub(1e-6, 10.0, "method = \"dopri5\"").unwrap();
    let estimate = estimate::estimate(&plan, 1).unwrap();
    assert!(estimate.sampled_s < 1.0, "{estimate:?}");
}

#[test]
fn mistakes_together_with_an_unknown_choice_are_reported() {
    let assert_refused = |text: &str, message_parts: &[&str]| {
        let message = load_text(text, &[]).unwrap_err();
        for message_part in message_parts {
            assert!(message.contains(message_part), "no {message_part} in\n{message}");
        }
    };
    assert_refused(
        "[spin]\nprofile = \"sinus\"\npeak_rpm = \"fast\"\nramp_s = -1\nspeed = 3\n\
         [time]\nend_s = 50\n",
        &["unknown profile", "`peak_rpm` has the wrong type", "`ramp_s` = -1", "key `speed`"],
    );
    assert_refused(
        &format!(
            "{MINIMAL_GRID}[integrator]\nmethod = \"euler\"\nstep_s = 0\n\
             rtol = \"small\"\norder = 1\n"
        ),
        &["unknown method", "`step_s` = 0", "`rtol` has the wrong type", "unknown key `order`"],
    );
    assert_refused(
        &format!(
            "{MINIMAL_GRID}[design]\nmethod = \"halton\"\npoints = 0\nseed = -1\nskip = 3\n\
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
    let refusal = load_list(MINIMAL_GRID, "tub_mas_kg,shaft_mass_kg\n1,x\n1,-5\n1\n").unwrap_err();
    for message_part in
        ["unknown parameter", "`x` is not a number", "value 2 of `shaft_mass_kg`", "a row of"]
    {
        assert!(refusal.contains(message_part), "no {message_part} in\n{refusal}");
    }
    assert!(refusal.contains("4 mistakes"), "{refusal}");
}

#[test]
fn a_range_with_too_few_different_values_is_refused() {
    let load_range = |from: f64, to: f64, count: u64, spacing: &str| {
        let range_ends = format!("from = {from:?}, to = {to:?}");
        let range_table = format!("{{ {range_ends}, count = {count}, spacing = \"{spacing}\" }}");
        let axis_text = format!("[[axis]]\nparameter = \"tub_mass_kg\"\nrange = {range_table}\n");
        load_text(format!("{MINIMAL_GRID}{axis_text}"), &[])
    };
    let second_next_number = 1.0 + 2.0 * f64::EPSILON;
    for spacing in ["linear", "log"] {
        let refusal = load_range(1.0, second_next_number, 5, spacing).unwrap_err();
        assert!(refusal.contains("has no 5 different values"), "{refusal}");
        assert!(refusal.contains("at most 2"), "{refusal}");
        assert_eq!(load_range(1.0, second_next_number, 2, spacing).unwrap().points(), 2);
        assert_eq!(
            load_range(1.0, 2.0, 1_000_000_000_000, spacing).unwrap().points(),
            1_000_000_000_000
        );
    }
    let design_and_axis = "[design]\nmethod = \"sobol\"\npoints = 1024\n\
        [[axis]]\nparameter = \"tub_mass_kg\"\n";
    let range_key = format!("range = {{ from = 1.0, to = {second_next_number:?} }}\n");
    let refusal =
        load_text(format!("{MINIMAL_GRID}{design_and_axis}{range_key}"), &[]).unwrap_err();
    assert!(refusal.contains("has no 1024 different values"), "{refusal}");
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
        is_descending in any::<bool>(),
        is_logarithmic in any::<bool>(),
    ) {
        let to = f64::from_bits(from.to_bits() + ulps);
        let [from, to] = if is_descending { [to, from] } else { [from, to] };
        let spacing = if is_logarithmic { "log" } else { "linear" };
        let range_ends = format!("from = {from:?}, to = {to:?}");
        let range_table = format!("{{ {range_ends}, count = {count}, spacing = \"{spacing}\" }}");
        let axis_text = format!("[[axis]]\nparameter = \"tub_mass_kg\"\nrange = {range_table}\n");
        let grid = format!("{MINIMAL_GRID}{axis_text}");
        match load_text(grid, &[]) {
            Ok(plan) => {
                let values: Vec<f64> = (0..count).map(|i| plan.axes[0].values.value(i)).collect();
                let is_ordered = |pair: &[f64]| {
                    (pair[0] > pair[1]) == is_descending && pair[0] != pair[1]
                };
                prop_assert!(values.windows(2).all(is_ordered), "{values:?}");
            }
            Err(refusal) => {
                prop_assert!(refusal.contains("different values") && count > 2, "{refusal}");
            }
        }
    }
}

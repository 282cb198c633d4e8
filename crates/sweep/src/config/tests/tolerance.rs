//! Tests of ranges that are given as tolerances about the machine's numbers.

use super::super::WasherGridInput;
use crate::plan::Plan;

const GRID: &str = "[spin]\nprofile = \"ramp\"\npeak_rpm = 300\nramp_s = 2\n[time]\nend_s = 2\n";

fn load_plan(sections: &str, sets: &[&str]) -> Result<Plan, String> {
    let set_values = sets.iter().map(|set| (*set).to_owned()).collect();
    let input = WasherGridInput::text("plan", format!("{GRID}{sections}"), set_values);
    input.load().map_err(|mistakes| mistakes.to_string())
}

#[test]
fn an_axis_with_a_tolerance_is_about_the_machines_number() {
    let axis_section = |parameter: &str, tolerance: &str| {
        format!("[[axis]]\nparameter = \"{parameter}\"\ntolerance = {tolerance}\ncount = 3\n")
    };
    let axis_values = |plan: &Plan| [0, 1, 2].map(|k| plan.axes[0].values.value(k));
    let damping_axis = axis_section("damping_n_s_per_m", "\"5 %\"");
    for (number, expected_values) in [(120, [114.0, 120.0, 126.0]), (200, [190.0, 200.0, 210.0])] {
        let sections = format!("{damping_axis}[set]\ndamping_n_s_per_m = {number}\n");
        assert_eq!(axis_values(&load_plan(&sections, &[]).unwrap()), expected_values);
    }
    let mass_sections = axis_section("drum_mass_kg", "0.5") + "[set]\ndrum_mass_kg = 8\n";
    let mass_plan = load_plan(&mass_sections, &[]).unwrap();
    assert_eq!(axis_values(&mass_plan), [7.5, 8.0, 8.5]);
    // The plan has the tolerance in addition to the values, so that it can be read back.
    let plan_json = mass_plan.to_json();
    assert_eq!(plan_json["axis"][0]["tolerance"], 0.5);
    assert_eq!(load_plan(&damping_axis, &[]).unwrap().to_json()["axis"][0]["tolerance"], "5 %");
    let reloaded_plan = WasherGridInput::from_plan("plan", &plan_json).load().unwrap();
    assert_eq!(axis_values(&reloaded_plan), [7.5, 8.0, 8.5]);
    // An option with the axis' name fixes it.
    assert_eq!(load_plan(&mass_sections, &["drum_mass_kg=9"]).unwrap().axes.len(), 0);
}

#[test]
fn a_distribution_with_a_tolerance_is_about_the_machines_number() {
    let design_sections = |kind: &str| {
        format!(
            "[design]\nmethod = \"monte_carlo\"\npoints = 16\n[[axis]]\nparameter = \
             \"unbalance_mass_kg\"\ndistribution = {{ kind = \"{kind}\", tolerance = \"30 %\" }}\n"
        )
    };
    for (kind, distribution_keys) in
        [("normal", ["mean", "sd"]), ("lognormal", ["median", "sigma"])]
    {
        let plan_json = load_plan(&design_sections(kind), &[]).unwrap().to_json();
        assert_eq!(plan_json["axis"][0]["tolerance"], "30 %");
        let distribution = &plan_json["axis"][0]["distribution"];
        let distribution_numbers = distribution_keys.map(|key| distribution[key].as_f64().unwrap());
        assert!((distribution_numbers[0] - 0.4).abs() < 1e-12, "{distribution}");
        let expected_spread = if kind == "normal" { 0.04 } else { 1.3_f64.ln() / 3.0 };
        assert!((distribution_numbers[1] - expected_spread).abs() < 1e-12, "{distribution}");
        let bounds = ["from", "to"].map(|key| distribution[key].as_f64().unwrap());
        assert!(
            (bounds[0] - 0.28).abs() < 1e-12 && (bounds[1] - 0.52).abs() < 1e-12,
            "{distribution}"
        );
    }
    let uniform_plan = load_plan(&design_sections("uniform"), &[]).unwrap();
    assert!((0..16).all(|point| (0.28..=0.52).contains(&uniform_plan.axis_values(point)[0])));
    let sobol_sections = "[design]\nmethod = \"sobol\"\npoints = 8\n[[axis]]\nparameter = \
                \"unbalance_mass_kg\"\ntolerance = \"25%\"\n";
    let sobol_plan = load_plan(sobol_sections, &[]).unwrap();
    assert_eq!(sobol_plan.to_json()["axis"][0]["tolerance"], "25 %");
    assert!((0..8).all(|point| (0.3..=0.5).contains(&sobol_plan.axis_values(point)[0])));
}

#[test]
fn wrong_tolerances_are_refused() {
    let axis_section = |tolerance: &str, keys: &str| {
        format!("[[axis]]\nparameter = \"drum_mass_kg\"\ntolerance = {tolerance}\n{keys}")
    };
    for (section, message_part) in [
        (axis_section("\"5 kg\"", "count = 3\n"), "\"5 kg\" is no tolerance"),
        (axis_section("\"-5 %\"", "count = 3\n"), "is no tolerance"),
        (axis_section("0.5", ""), "`count` is missing"),
        (axis_section("0.5", "count = 3\nvalues = [1, 2]\n"), "`values` does not belong"),
        (axis_section("1e3", "count = 3\n"), "`drum_mass_kg` = -99"),
        (axis_section("true", "count = 3\n"), "wrong type"),
    ] {
        let refusal = load_plan(&section, &[]).unwrap_err();
        assert!(refusal.contains(message_part), "{message_part}: {refusal}");
    }
    let damping_axis =
        "[[axis]]\nparameter = \"damping_n_s_per_m\"\ntolerance = \"5 %\"\ncount = 3\n";
    let refusal = load_plan(damping_axis, &["damper_1_damping_n_s_per_m=90"]).unwrap_err();
    assert!(refusal.contains("has no single number"), "{refusal}");
    // The friction is 0, of which every percentage is 0 too.
    let friction_axis = "[[axis]]\nparameter = \"friction_n\"\ntolerance = \"5 %\"\ncount = 3\n";
    let refusal = load_plan(friction_axis, &[]).unwrap_err();
    assert!(refusal.contains("so is every percentage of it"), "{refusal}");
}

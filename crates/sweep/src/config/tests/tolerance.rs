//! Tests of ranges that are given as tolerances about the machine's numbers.

use super::super::WasherGridInput;
use crate::plan::Plan;

const GRID: &str = "[spin]\nprofile = \"ramp\"\npeak_rpm = 300\nramp_s = 2\n[time]\nend_s = 2\n";

fn load(sections: &str, sets: &[&str]) -> Result<Plan, String> {
    let sets = sets.iter().map(|set| (*set).to_owned()).collect();
    let input = WasherGridInput::text("plan", format!("{GRID}{sections}"), sets);
    input.load().map_err(|mistakes| mistakes.to_string())
}

#[test]
fn an_axis_with_a_tolerance_is_about_the_machines_number() {
    let axis = |parameter: &str, tolerance: &str| {
        format!("[[axis]]\nparameter = \"{parameter}\"\ntolerance = {tolerance}\ncount = 3\n")
    };
    let values = |plan: &Plan| [0, 1, 2].map(|k| plan.axes[0].values.value(k));
    let damping = axis("damping_n_s_per_m", "\"5 %\"");
    for (number, expected) in [(120, [114.0, 120.0, 126.0]), (200, [190.0, 200.0, 210.0])] {
        let set = format!("{damping}[set]\ndamping_n_s_per_m = {number}\n");
        assert_eq!(values(&load(&set, &[]).unwrap()), expected);
    }
    let mass = axis("drum_mass_kg", "0.5") + "[set]\ndrum_mass_kg = 8\n";
    let plan = load(&mass, &[]).unwrap();
    assert_eq!(values(&plan), [7.5, 8.0, 8.5]);
    // The plan has the tolerance in addition to the values, so that it can be read back.
    let json = plan.to_json();
    assert_eq!(json["axis"][0]["tolerance"], 0.5);
    assert_eq!(load(&damping, &[]).unwrap().to_json()["axis"][0]["tolerance"], "5 %");
    let reloaded = WasherGridInput::from_plan("plan", &json).load().unwrap();
    assert_eq!(values(&reloaded), [7.5, 8.0, 8.5]);
    // An option with the axis' name fixes it.
    assert_eq!(load(&mass, &["drum_mass_kg=9"]).unwrap().axes.len(), 0);
}

#[test]
fn a_distribution_with_a_tolerance_is_about_the_machines_number() {
    let design = |kind: &str| {
        format!(
            "[design]\nmethod = \"monte_carlo\"\npoints = 16\n[[axis]]\nparameter = \
             \"unbalance_mass_kg\"\ndistribution = {{ kind = \"{kind}\", tolerance = \"30 %\" }}\n"
        )
    };
    for (kind, keys) in [("normal", ["mean", "sd"]), ("lognormal", ["median", "sigma"])] {
        let plan = load(&design(kind), &[]).unwrap().to_json();
        assert_eq!(plan["axis"][0]["tolerance"], "30 %");
        let distribution = &plan["axis"][0]["distribution"];
        let numbers = keys.map(|key| distribution[key].as_f64().unwrap());
        assert!((numbers[0] - 0.4).abs() < 1e-12, "{distribution}");
        let spread = if kind == "normal" { 0.04 } else { 1.3_f64.ln() / 3.0 };
        assert!((numbers[1] - spread).abs() < 1e-12, "{distribution}");
        let bounds = ["from", "to"].map(|key| distribution[key].as_f64().unwrap());
        assert!(
            (bounds[0] - 0.28).abs() < 1e-12 && (bounds[1] - 0.52).abs() < 1e-12,
            "{distribution}"
        );
    }
    let plan = load(&design("uniform"), &[]).unwrap();
    assert!((0..16).all(|point| (0.28..=0.52).contains(&plan.axis_values(point)[0])));
    let axis = "[design]\nmethod = \"sobol\"\npoints = 8\n[[axis]]\nparameter = \
                \"unbalance_mass_kg\"\ntolerance = \"25%\"\n";
    let plan = load(axis, &[]).unwrap();
    assert_eq!(plan.to_json()["axis"][0]["tolerance"], "25 %");
    assert!((0..8).all(|point| (0.3..=0.5).contains(&plan.axis_values(point)[0])));
}

#[test]
fn wrong_tolerances_are_refused() {
    let axis = |tolerance: &str, keys: &str| {
        format!("[[axis]]\nparameter = \"drum_mass_kg\"\ntolerance = {tolerance}\n{keys}")
    };
    for (text, part) in [
        (axis("\"5 kg\"", "count = 3\n"), "\"5 kg\" is no tolerance"),
        (axis("\"-5 %\"", "count = 3\n"), "is no tolerance"),
        (axis("0.5", ""), "`count` is missing"),
        (axis("0.5", "count = 3\nvalues = [1, 2]\n"), "`values` does not belong"),
        (axis("1e3", "count = 3\n"), "`drum_mass_kg` = -99"),
        (axis("true", "count = 3\n"), "wrong type"),
    ] {
        let refusal = load(&text, &[]).unwrap_err();
        assert!(refusal.contains(part), "{part}: {refusal}");
    }
    let axis = "[[axis]]\nparameter = \"damping_n_s_per_m\"\ntolerance = \"5 %\"\ncount = 3\n";
    let refusal = load(axis, &["damper_1_damping_n_s_per_m=90"]).unwrap_err();
    assert!(refusal.contains("has no single number"), "{refusal}");
    // A percentage of 0 is no range.
    let axis = "[[axis]]\nparameter = \"friction_n\"\ntolerance = \"5 %\"\ncount = 3\n";
    let refusal = load(axis, &[]).unwrap_err();
    assert!(refusal.contains("so is every percentage of it"), "{refusal}");
}

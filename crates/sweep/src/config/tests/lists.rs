//! Tests of lists of points in the formats of loggers and spreadsheets.

use super::super::load;
use crate::plan::Plan;

const GRID: &str = "[spin]\nprofile = \"ramp\"\npeak_rpm = 300\nramp_s = 2\n[time]\nend_s = 2\n\
    [design]\nmethod = \"list\"\nfile = \"points.csv\"\n";

/// Loads a grid with a list of points.
fn load_list(sections: &str, list_text: &str) -> Result<Plan, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.toml");
    std::fs::write(folder.path().join("points.csv"), list_text).unwrap();
    std::fs::write(&path, format!("{GRID}{sections}")).unwrap();
    load(&path, &[]).map_err(|mistakes| mistakes.to_string())
}

#[test]
fn units_are_converted_and_ignored_columns_are_noted() {
    let list_text = "Unbalance mass [g];weather;damping_n_s_per_mm\n300;fair;0,12\n450;foul;0,1\n";
    let plan = load_list("", list_text).unwrap();
    let names: Vec<&str> = plan.axes.iter().map(|axis| &*axis.parameter.name).collect();
    assert_eq!(names, ["unbalance_mass_kg", "damping_n_s_per_m"]);
    assert_eq!([plan.axis_values(0), plan.axis_values(1)], [[0.3, 120.0], [0.45, 100.0]]);
    let notes_text = plan.reading_notes.notes.join("\n");
    assert!(notes_text.contains("left out the column `weather`"), "{notes_text}");
    assert!(notes_text.contains("`Unbalance mass [g]` is unbalance_mass_kg"), "{notes_text}");
}

#[test]
fn the_grid_file_may_name_the_parameters_of_columns() {
    let columns_section = "[columns]\n\"m_u [g]\" = \"unbalance_mass_kg\"\n";
    let plan = load_list(columns_section, "m_u [g]\n300\n").unwrap();
    assert_eq!(plan.axis_values(0), [0.3]);
    let wrong_section = columns_section.replace("unbalance_mass_kg", "laundry");
    let refusal = load_list(&wrong_section, "m_u [g]\n300\n").unwrap_err();
    assert!(refusal.contains("is called `laundry`"), "{refusal}");
    let refusal = load_list("[columns]\nx = 5\n", "m_u [g]\n300\n").unwrap_err();
    assert!(refusal.contains("wrong type"), "{refusal}");
}

#[test]
fn a_list_without_points_or_parameters_is_refused() {
    for (list_text, message_part) in [
        ("unbalance_mass_kg,weather\n", "is empty"),
        ("weather,height\n1,2\n", "no column of a parameter"),
        ("weather\n", "no column of a parameter"),
        ("mass,id\n1,2\n", "did you mean"),
        ("id\n2\n", "no column but `id`"),
        ("", "is empty"),
        ("sep=;\n", "is empty"),
    ] {
        let refusal = load_list("", list_text).unwrap_err();
        assert!(refusal.contains(message_part), "{list_text}: {refusal}");
    }
}

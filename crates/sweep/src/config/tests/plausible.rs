//! Tests of notes on unusual numbers.

use super::super::WasherGridInput;

fn reading_notes(sections: &str, sets: &[&str]) -> Vec<String> {
    let grid =
        "[spin]\nprofile = \"ramp\"\npeak_rpm = 300\nramp_s = 2\n[time]\nend_s = 2\n".to_owned();
    let set_values = sets.iter().map(|set| (*set).to_owned()).collect();
    let input = WasherGridInput::text("plan", format!("{grid}{sections}"), set_values);
    input.load().unwrap_or_else(|mistakes| panic!("{mistakes}")).reading_notes.notes
}

#[test]
fn a_number_in_another_unit_is_noted_with_its_converted_value() {
    for (assignment, note_part) in [
        ("tub_mass_kg=23870", "23870 g would be 23.87 kg"),
        ("radial_clearance_m=10", "10 mm would be 0.01 m"),
        ("unbalance_mass_kg=400", "400 g would be 0.4 kg"),
        ("spring_stiffness_n_per_m=8.35", "8.35 N/mm would be 8350 N/m"),
        ("damping_n_s_per_m=0.12", "0.12 N s/mm would be 120 N s/m"),
        ("spin_peak_rpm=30000", "machines have 0 to 5000"),
    ] {
        let assignment_notes = reading_notes("", &[assignment]);
        assert!(
            !assignment_notes.is_empty() && assignment_notes[0].contains(note_part),
            "{assignment}: {assignment_notes:?}"
        );
    }
    let axis_section = "[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [100, 400, 800]\n";
    assert!(reading_notes(axis_section, &[])[0].contains("800 g would be 0.8 kg"));
    assert!(
        reading_notes("", &["unbalance_mass_kg=60"])[0].contains("more than tub, shaft and drum")
    );
}

#[test]
fn usual_numbers_have_no_notes() {
    assert_eq!(reading_notes("", &[]), [""; 0]);
    assert_eq!(reading_notes("", &["damping_n_s_per_m=0", "unbalance_mass_kg=1.5"]), [""; 0]);
    let [compact_notes, industrial_notes] = ["compact_grid", "industrial_grid"].map(|name| {
        let path = format!("{}/../../docs/examples/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        WasherGridInput::file(path.into(), Vec::new())
            .load()
            .expect("it is right")
            .reading_notes
            .notes
    });
    assert_eq!((compact_notes, industrial_notes), (Vec::new(), Vec::new()));
}

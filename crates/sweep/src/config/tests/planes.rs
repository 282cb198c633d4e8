//! Tests of unbalances in named planes of the drum.

use washer_model::Machine;

use super::super::WasherGridInput;
use super::super::machine_file;
use sweep_engine::plan::NumberSources;

/// Returns the machine of the built-in machine's file after a change of its text.
fn load_machine(change_file: impl Fn(String) -> String) -> Result<Machine, String> {
    let folder = tempfile::tempdir().unwrap();
    let machine_text = change_file(machine_file(&Machine::paper(), &NumberSources::default()));
    std::fs::write(folder.path().join("m.toml"), machine_text).unwrap();
    let grid = "machine = \"m.toml\"\n[spin]\nprofile = \"ramp\"\npeak_rpm = 300\nramp_s = 2\n\
        [time]\nend_s = 2\n";
    let path = folder.path().join("g.toml");
    std::fs::write(&path, grid).unwrap();
    let plan = WasherGridInput::file(path, Vec::new()).load();
    plan.map(|plan| plan.model.machine).map_err(|mistakes| mistakes.to_string())
}

const FURTHER_UNBALANCE_SECTION: &str =
    "\n[[further_unbalances]]\nplane = \"front\"\nmass_kg = 0.2\nradius_m = -0.2\n";

/// Returns the text of a machine file in which the unbalance has `plane = "rear"` instead of a
/// position.
fn with_rear_unbalance(file: &str) -> String {
    let lines = file.lines().scan(false, |is_in_unbalance, line| {
        *is_in_unbalance =
            if line.starts_with('[') { line == "[unbalance]" } else { *is_in_unbalance };
        let is_position = *is_in_unbalance && line.starts_with("x_m");
        Some(if is_position { "plane = \"rear\"\n".to_owned() } else { format!("{line}\n") })
    });
    lines.collect()
}

#[test]
fn unbalances_lie_in_named_planes() {
    let machine =
        load_machine(|file| with_rear_unbalance(&file) + FURTHER_UNBALANCE_SECTION).unwrap();
    let paper_machine = Machine::paper();
    assert_eq!(machine.unbalance.x_m, paper_machine.drum.hinge_x_m);
    assert_eq!(machine.further_unbalances[0].x_m, paper_machine.drum.front_x_m);
    assert_eq!(machine.further_unbalances[0].radius_m, -0.2);
}

#[test]
fn loads_have_angles_and_dampers_have_stages() {
    let section_with_angle =
        FURTHER_UNBALANCE_SECTION.replace("radius_m", "angle_deg = -120\nradius_m");
    let change_file = |machine_text: String| {
        let damper_keys = "[[dampers]]\nfree_stroke_m = 0.006\nouter_damping_n_s_per_m = 30\n";
        machine_text.replacen("[[dampers]]\n", damper_keys, 1).replacen(
            "[unbalance]\n",
            "[unbalance]\nangle_deg = 30\n",
            1,
        ) + &section_with_angle
    };
    let machine = load_machine(change_file).unwrap();
    assert_eq!(machine.unbalance.angle_deg, 30.0);
    assert_eq!(machine.further_unbalances[0].angle_deg, -120.0);
    assert_eq!(machine.dampers[0].free_stroke_m, 0.006);
    assert_eq!(machine.dampers[0].outer_damping_n_s_per_m, 30.0);
    assert_eq!(machine.dampers[1].free_stroke_m, 0.0);
    // The text of the machine reads back to the same machine.
    let written_file = machine_file(&machine, &NumberSources::default());
    assert_eq!(load_machine(|_| written_file.clone()).unwrap(), machine);
    let refusal =
        load_machine(|file| file + &section_with_angle.replace("-120", "500")).unwrap_err();
    assert!(refusal.contains("angle_deg"), "{refusal}");
}

#[test]
fn an_unbalance_has_either_a_plane_or_a_position() {
    let section_with_both = FURTHER_UNBALANCE_SECTION.replace("mass_kg", "x_m = 0.1\nmass_kg");
    let refusal = load_machine(|file| file + &section_with_both).unwrap_err();
    assert!(refusal.contains("`plane` beside `x_m`"), "{refusal}");
    let section_without_both = FURTHER_UNBALANCE_SECTION.replace("plane = \"front\"\n", "");
    let refusal = load_machine(|file| file + &section_without_both).unwrap_err();
    assert!(refusal.contains("`x_m` is missing"), "{refusal}");
    let section_of_unknown_plane = FURTHER_UNBALANCE_SECTION.replace("front", "middle");
    let refusal = load_machine(|file| file + &section_of_unknown_plane).unwrap_err();
    assert!(refusal.contains("unknown plane \"middle\""), "{refusal}");
}

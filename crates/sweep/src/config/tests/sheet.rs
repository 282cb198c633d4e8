//! Tests of machine files with the numbers of a data sheet.

use super::*;

/// The short file that `sweep init --machine --short` writes.
const SHORT_MACHINE: &str = include_str!("../../commands/starter_machine.toml");

/// Loads a plan with a machine file of this text.
fn load_machine(machine_text: &str) -> Result<Plan, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("machine.toml"), machine_text).unwrap();
    let grid_path = folder.path().join("grid.toml");
    std::fs::write(&grid_path, format!("machine = \"machine.toml\"\n{MINIMAL_GRID}")).unwrap();
    load(&grid_path, &[]).map_err(|mistakes| mistakes.to_string())
}

#[test]
fn a_data_sheet_makes_a_machine_near_the_built_in_one() {
    let plan = load_machine(SHORT_MACHINE).unwrap();
    let Washer { machine, spin, .. } = &plan.model;
    assert_eq!(machine.violations(), []);
    let built_in_machine = Machine::paper();
    let mut assumed_count = 0;
    for parameter in washer_model::MachineParameter::all(machine, spin) {
        let Some(assumption) = parameter.assumption() else { continue };
        if !plan.sources.is_assumed(parameter.name()) {
            continue;
        }
        assumed_count += 1;
        let source = plan.sources.source(&[parameter.name()]);
        assert_eq!(source, Some(format!("assumed: {}", assumption.rule)));
        let [machine_value, built_in_value] =
            [machine, &built_in_machine].map(|machine| parameter.get(machine, spin).unwrap());
        let [bound_a, bound_b] = assumption.expected_bounds(machine_value, machine);
        let name = parameter.name();
        // The built-in machine's number is within the bounds that the rule expects about its own.
        let is_within = bound_a.min(bound_b) - 1e-9 <= built_in_value
            && built_in_value <= bound_a.max(bound_b) + 1e-9;
        assert!(is_within, "{name}: {built_in_value} is not from {bound_a} to {bound_b}");
    }
    assert_eq!(assumed_count, 27);
    // The file that the command writes has the rule beside each assumed number.
    let complete_file = machine_file(machine, &plan.sources);
    assert!(
        complete_file
            .contains("[assumed: half the drum's depth before O, as the built-in machine]")
    );
    assert_eq!(load_machine(&complete_file).unwrap().model.machine, *machine);
}

#[test]
fn a_given_number_replaces_a_rule() {
    let short_file = SHORT_MACHINE;
    let machine_text =
        short_file.replace("[drum]\n", "[shaft]\nmass_kg = 5\n[drum]\nmass_kg = 4\n");
    let machine = load_machine(&machine_text).unwrap().model.machine;
    assert_eq!((machine.shaft.mass_kg, machine.drum.mass_kg), (5.0, 4.0));
    assert!((machine.tub.mass_kg - 22.85).abs() < 1e-12);
}

#[test]
fn missing_and_contradicting_numbers_of_a_data_sheet_are_reported() {
    let short_file = SHORT_MACHINE;
    let refusal_message =
        |old: &str, new: &str| load_machine(&short_file.replace(old, new)).unwrap_err();
    let message = refusal_message("moving_mass_kg = 31.85", "");
    assert!(message.contains("`moving_mass_kg` is missing"), "{message}");
    let message = refusal_message("[drum]\n", "[tub]\nmass_kg = 20\n[drum]\n");
    assert!(message.contains("`moving_mass_kg` beside the tub's mass"), "{message}");
    let message = refusal_message("[drum]\n", "[drum]\nmass_kg = 40\n");
    assert!(message.contains("the rule for the left-out `tub_mass_kg` gives"), "{message}");
    // A missing depth is one mistake. The numbers that rules derive from the depth are not reported
    // besides.
    let message = refusal_message("depth_m = 0.30", "");
    assert!(message.contains("`depth_m` is missing"), "{message}");
    assert!(!message.contains("[tub]") && !message.contains("gravity"), "{message}");
}

#[test]
fn bushings_alone_can_carry_a_machine() {
    let machine_text = include_str!("../../../../../docs/examples/industrial.toml");
    let plan = load_machine(machine_text).unwrap();
    assert!(plan.model.machine.springs.is_empty());
    let Washer { machine, spin, .. } = plan.model.clone();
    let prepared_point =
        crate::plan::prepare_point(machine, spin, &crate::plan::timing(&plan)).unwrap();
    // A mass of 689 kg on a stiffness of 1,467,056 N/m.
    let expected_m = 689.0 * 9.81 / 1_467_056.0;
    assert!(
        (prepared_point.static_sag_m() / expected_m - 1.0).abs() < 0.3,
        "{}",
        prepared_point.static_sag_m()
    );
    let without_bushings = machine_text.split("[[bushings]]").next().unwrap();
    let refusal_message = load_machine(without_bushings).unwrap_err();
    assert!(
        refusal_message.contains("at least one [[springs]] or [[bushings]]"),
        "{refusal_message}"
    );
}

//! Tests of machine files with the numbers of a data sheet.

use super::*;

/// The short file that `sweep init --machine --short` writes.
const SHORT_MACHINE: &str = include_str!("../../commands/starter_machine.toml");

/// Loads a plan with a machine file of this text.
fn load_machine(text: &str) -> Result<Plan, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("machine.toml"), text).unwrap();
    let grid = folder.path().join("grid.toml");
    std::fs::write(&grid, format!("machine = \"machine.toml\"\n{MINIMAL_GRID}")).unwrap();
    load(&grid, &[]).map_err(|mistakes| mistakes.to_string())
}

#[test]
fn a_data_sheet_makes_a_machine_near_the_built_in_one() {
    let plan = load_machine(SHORT_MACHINE).unwrap();
    let Washer { machine, spin, .. } = &plan.model;
    assert_eq!(machine.violations(), []);
    let built_in = Machine::paper();
    let mut assumed = 0;
    for parameter in washer_model::MachineParameter::all(machine, spin) {
        let Some(assumption) = parameter.assumption() else { continue };
        if !plan.sources.is_assumed(parameter.name()) {
            continue;
        }
        assumed += 1;
        let source = plan.sources.source(&[parameter.name()]);
        assert_eq!(source, Some(format!("assumed: {}", assumption.rule)));
        let [value, paper] =
            [machine, &built_in].map(|machine| parameter.get(machine, spin).unwrap());
        let [least, greatest] = assumption.expected_bounds(value, machine);
        let name = parameter.name();
        // The paper's value lies within the range about the assumed value.
        let is_within = least.min(greatest) - 1e-9 <= paper && paper <= least.max(greatest) + 1e-9;
        assert!(is_within, "{name}: {paper} is not from {least} to {greatest}");
    }
    assert_eq!(assumed, 27);
    // The complete file has the rule of each number.
    let complete = machine_file(machine, &plan.sources);
    assert!(
        complete.contains("[assumed: half the drum's depth before O, as the built-in machine]")
    );
    assert_eq!(load_machine(&complete).unwrap().model.machine, *machine);
}

#[test]
fn a_given_number_replaces_a_rule() {
    let short = SHORT_MACHINE;
    let text = short.replace("[drum]\n", "[shaft]\nmass_kg = 5\n[drum]\nmass_kg = 4\n");
    let machine = load_machine(&text).unwrap().model.machine;
    assert_eq!((machine.shaft.mass_kg, machine.drum.mass_kg), (5.0, 4.0));
    assert!((machine.tub.mass_kg - 22.85).abs() < 1e-12);
}

#[test]
fn missing_and_contradicting_numbers_of_a_data_sheet_are_reported() {
    let short = SHORT_MACHINE;
    let refusal = |old: &str, new: &str| load_machine(&short.replace(old, new)).unwrap_err();
    let message = refusal("moving_mass_kg = 31.85", "");
    assert!(message.contains("`moving_mass_kg` is missing"), "{message}");
    let message = refusal("[drum]\n", "[tub]\nmass_kg = 20\n[drum]\n");
    assert!(message.contains("`moving_mass_kg` beside the tub's mass"), "{message}");
    let message = refusal("[drum]\n", "[drum]\nmass_kg = 40\n");
    assert!(message.contains("the rule for the left-out `tub_mass_kg` gives"), "{message}");
    // A missing depth is one mistake, and the numbers that would follow from it are not further
    // ones.
    let message = refusal("depth_m = 0.30", "");
    assert!(message.contains("`depth_m` is missing"), "{message}");
    assert!(!message.contains("[tub]") && !message.contains("gravity"), "{message}");
}

#[test]
fn bushings_alone_can_carry_a_machine() {
    let file = include_str!("../../../../../docs/examples/industrial.toml");
    let plan = load_machine(file).unwrap();
    assert!(plan.model.machine.springs.is_empty());
    let Washer { machine, spin, .. } = plan.model.clone();
    let point = crate::plan::prepare_point(machine, spin, &crate::plan::timing(&plan)).unwrap();
    // The static deflection of 689 kg on 1,467,056 N/m.
    let expected_m = 689.0 * 9.81 / 1_467_056.0;
    assert!((point.static_sag_m() / expected_m - 1.0).abs() < 0.3, "{}", point.static_sag_m());
    let without_bushings = file.split("[[bushings]]").next().unwrap();
    let found = load_machine(without_bushings).unwrap_err();
    assert!(found.contains("at least one [[springs]] or [[bushings]]"), "{found}");
}

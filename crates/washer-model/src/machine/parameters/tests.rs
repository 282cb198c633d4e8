//! Tests of the names, ranges and targets of parameters.

use super::Range::{Any, Negative, NonNegative, Positive};
use super::*;
use crate::Profile;

fn ramped_spin() -> Spin {
    Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 }
}

#[test]
fn every_parameter_is_found_by_its_name_and_reads_back_what_was_written() {
    for parameter in MachineParameter::all(&Machine::paper(), &ramped_spin()) {
        let mut machine = Machine::paper();
        let mut spin = ramped_spin();
        assert_eq!(
            MachineParameter::find(parameter.name(), &machine, &spin).as_ref(),
            Ok(&parameter)
        );
        if matches!(parameter.target(), Target::Window(_)) {
            assert_eq!(parameter.get(&machine, &spin), None);
            continue;
        }
        let Some(initial_value) = parameter.get(&machine, &spin) else {
            // This number is optional.
            assert!(parameter.name().ends_with("friction_linear_speed_m_per_s"), "{parameter:?}");
            parameter.set(&mut machine, &mut spin, 0.125);
            assert_eq!(parameter.get(&machine, &spin), Some(0.125), "{parameter:?}");
            continue;
        };
        assert!(parameter.range().contains(initial_value), "{parameter:?} = {initial_value}");
        parameter.set(&mut machine, &mut spin, initial_value + 0.125);
        assert_eq!(parameter.get(&machine, &spin), Some(initial_value + 0.125), "{parameter:?}");
    }
}

#[test]
fn each_parameter_writes_its_parts_and_nothing_else() {
    let parameters = MachineParameter::all(&Machine::paper(), &ramped_spin());
    for parameter in &parameters {
        let mut machine = Machine::paper();
        let mut spin = ramped_spin();
        let values_before: Vec<_> = parameters.iter().map(|p| p.get(&machine, &spin)).collect();
        parameter.set(&mut machine, &mut spin, 0.875);
        let single_names = parameter.single_names(&machine);
        for (other, value_before) in parameters.iter().zip(values_before) {
            if other.single_names(&machine).iter().all(|name| !single_names.contains(name)) {
                // A default free length is the distance between the ends of its spring.
                let depends_on_ends =
                    other.name().ends_with("free_length_m") && other.index == parameter.index;
                assert!(
                    depends_on_ends || other.get(&machine, &spin) == value_before,
                    "{parameter:?} wrote {other:?}"
                );
            }
        }
    }
}

#[test]
fn names_end_with_their_unit_and_are_unique() {
    let parameters = MachineParameter::all(&Machine::paper(), &ramped_spin());
    let mut names: Vec<_> = parameters.iter().map(MachineParameter::name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), parameters.len());
    for parameter in &parameters {
        let unit = parameter.unit();
        let suffix = unit_suffix(unit).unwrap_or_else(|| panic!("no suffix is known for {unit}"));
        assert!(parameter.name().ends_with(suffix), "{parameter:?}");
    }
}

#[test]
fn sources_cite_the_paper() {
    let names_without_source = [
        "tub_front_x_m",
        "drum_hinge_x_m",
        "drum_front_x_m",
        "bearing_front_x_m",
        "bearing_rear_x_m",
    ];
    // The paper's machine has no friction, no second stage of dampers and no cubic stiffness.
    let absent_features = ["friction", "cubic", "free_stroke", "outer_damping"];
    let is_absent = |name: &str| absent_features.iter().any(|part| name.contains(part));
    let mut source_counts = [0; 5];
    for parameter in MachineParameter::all(&Machine::paper(), &ramped_spin()) {
        let name = parameter.name();
        if is_absent(name) {
            assert!(parameter.source().starts_with("assumed: "), "{parameter:?}");
            continue;
        }
        let is_body = ["tub_", "shaft_"].iter().any(|prefix| name.starts_with(prefix));
        let (expected_source, count) = if is_body && name.contains("_inertia_") {
            ("paper, Table 3", &mut source_counts[0])
        } else if name.contains("_cabinet_") || (name.contains("_tub_") && !is_body) {
            ("paper, Table 4", &mut source_counts[1])
        } else if ["n_per_m", "n_s_per_m", "n_m_per_rad"].iter().any(|unit| name.ends_with(unit)) {
            ("paper, section 3.1", &mut source_counts[2])
        } else if is_body && !names_without_source.contains(&name) {
            ("paper, Table 2", &mut source_counts[3])
        } else if names_without_source.contains(&name)
            || name.ends_with("free_length_m")
            || name == "radial_clearance_m"
        {
            assert!(parameter.source().starts_with("assumed: "), "{parameter:?}");
            source_counts[4] += 1;
            continue;
        } else {
            continue;
        };
        assert_eq!(parameter.source(), expected_source, "{parameter:?}");
        *count += 1;
    }
    assert_eq!(source_counts, [6, 36, 12, 4, 10]);
}

#[test]
fn numbers_that_a_machine_lacks_differ_from_misspellings() {
    let machine = Machine::paper();
    let spin = ramped_spin();
    let find = |name: &str| MachineParameter::find(name, &machine, &spin).map(|p| p.index);
    let in_other_models = |reason: &str| Err(UnknownParameter::in_other_models(reason));
    assert_eq!(find("spring_4_tub_z_m"), Ok(3));
    assert_eq!(
        find("spring_5_tub_z_m"),
        in_other_models("the machine has 4 springs, numbered from 1")
    );
    assert_eq!(
        find("damper_3_damping_n_s_per_m"),
        in_other_models("the machine has 2 dampers, numbered from 1")
    );
    let mut extended_machine = machine.clone();
    extended_machine.further_unbalances = vec![crate::Unbalance::default(); 2];
    extended_machine.stops = vec![crate::BumpStop::default()];
    let find_extended =
        |name: &str| MachineParameter::find(name, &extended_machine, &spin).map(|p| p.index);
    assert_eq!(find_extended("unbalance_2_mass_kg"), Ok(0));
    assert_eq!(find_extended("unbalance_3_mass_kg"), Ok(1));
    assert_eq!(find_extended("stop_1_direction_y"), Ok(0));
    for name in ["unbalance_1_mass_kg", "unbalance_4_mass_kg"] {
        let expected = in_other_models("the machine has 3 unbalances, numbered from 1");
        assert_eq!(find_extended(name), expected, "{name}");
    }
    assert_eq!(
        find("stop_1_clearance_m"),
        in_other_models("the machine has 0 stops, numbered from 1")
    );
    for name in [
        "spring_0_tub_z_m",
        "spring_01_tub_z_m",
        "spring_+1_tub_z_m",
        "spring__tub_z_m",
        "spring_99999999999999999999_tub_z_m",
        "spring_1_tub_w_m",
        "tub_mass",
        "",
    ] {
        assert!(find(name).is_err_and(|expected| expected.is_in_no_model), "{name}");
    }
    let table_spin = Spin::Table { time_s: vec![0.0, 1.0], speed_rpm: vec![0.0, 100.0] };
    let find = |name: &str| MachineParameter::find(name, &machine, &table_spin).map(|p| p.index);
    assert_eq!(find("spin_ramp_s"), in_other_models("a spin given as a table has no such number"));
    let point_parameters: Vec<_> = MachineParameter::all(&machine, &table_spin)
        .into_iter()
        .filter(|p| p.source() == "the grid file's [spin]")
        .collect();
    let names: Vec<_> = point_parameters.iter().map(MachineParameter::name).collect();
    assert_eq!(
        names,
        [
            "spin_table_1_time_s",
            "spin_table_1_speed_rpm",
            "spin_table_2_time_s",
            "spin_table_2_speed_rpm"
        ]
    );
    let mut changed_spin = table_spin.clone();
    point_parameters[3].set(&mut machine.clone(), &mut changed_spin, 90.0);
    assert_eq!(changed_spin, Spin::Table { time_s: vec![0.0, 1.0], speed_rpm: vec![0.0, 90.0] });
    assert_eq!(
        find("spin_table_3_time_s"),
        in_other_models("the spin's table has 2 points, numbered from 1")
    );
    let names = ["window_from_s", "window_to_s", "tub_mass_kg"];
    let targets =
        names.map(|name| MachineParameter::find(name, &machine, &table_spin).unwrap().target());
    assert_eq!(targets, [Target::Window(0), Target::Window(1), Target::Machine]);
}

#[test]
fn a_parameter_of_several_numbers_has_no_value_when_they_differ() {
    let mut machine = Machine::paper();
    let spin = ramped_spin();
    let common_damping = MachineParameter::find("damping_n_s_per_m", &machine, &spin).unwrap();
    assert_eq!(common_damping.get(&machine, &spin), Some(140.0));
    machine.dampers[1].damping_n_s_per_m = 100.0;
    assert_eq!(common_damping.get(&machine, &spin), None);
}

#[test]
fn ranges_refuse_nan_and_infinity() {
    for range in [Any, Positive, NonNegative, Negative, Range::Within(-1e5, 1e5)] {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e13, -1e13] {
            assert!(!range.contains(value), "{range:?} {value}");
        }
    }
    assert!(!Positive.contains(0.0) && Positive.contains(1e-9));
    assert!(NonNegative.contains(0.0) && !NonNegative.contains(-1e-9));
    assert!(!Negative.contains(0.0) && Negative.contains(-1e-9));
}

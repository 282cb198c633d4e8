//! Tests of tables of points whose columns are the axes of a plan.

use super::super::{WasherGridInput, check_columns};

const GRID: &str = "[spin]\nprofile = \"ramp\"\npeak_rpm = 300\nramp_s = 2\n\
    [time]\nend_s = 2\n\
    [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.5, 0.3]\n\
    [[axis]]\nparameter = \"tub_mass_kg\"\nvalues = [20]\n";

fn find_axis_columns(columns: &[(&str, &[f64])]) -> Result<Vec<Option<usize>>, String> {
    let plan = WasherGridInput::text("plan", GRID.to_owned(), Vec::new()).load().unwrap();
    let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
    let finite_values =
        |k: usize| columns[k].1.iter().map(|&value| value.is_finite().then_some(value));
    check_columns(&plan, &names, finite_values).map_err(|mistakes| mistakes.to_string())
}

#[test]
fn a_million_mistakes_are_counted() {
    let message = find_axis_columns(&[("unbalance_mass_kg", &[9.0; 1_000_000])]).unwrap_err();
    assert!(
        message.contains("1000000 mistakes (100 shown)"),
        "{}",
        &message[message.len() - 200..]
    );
}

#[test]
fn columns_are_found_by_name_and_an_axis_of_one_value_may_be_left_out() {
    assert_eq!(
        find_axis_columns(&[("unbalance_mass_kg", &[0.1, 0.2, 0.5])]),
        Ok(vec![Some(0), None])
    );
    let columns: [(&str, &[f64]); 2] = [("tub_mass_kg", &[20.0]), ("unbalance_mass_kg", &[0.3])];
    assert_eq!(find_axis_columns(&columns), Ok(vec![Some(1), Some(0)]));
}

#[test]
fn every_mistake_names_its_column_and_row() {
    for (columns, message_part) in [
        (&[("unbalance_mass", &[0.1][..])][..], "did you mean `unbalance_mass_kg`"),
        (&[("unbalance_mass", &[0.1][..])][..], "has no column `unbalance_mass_kg`"),
        (&[("unbalance_mass_kg", &[0.1, 0.6])], "row 2 of `unbalance_mass_kg` = 0.6 is off"),
        (&[("unbalance_mass_kg", &[-0.1])], "row 1 of `unbalance_mass_kg` = -0.1 is out of"),
        (&[("unbalance_mass_kg", &[0.1, f64::NAN])], "row 2 of `unbalance_mass_kg` has no"),
        (
            &[("unbalance_mass_kg", &[0.1]), ("unbalance_mass_kg", &[0.1])],
            "the column `unbalance_mass_kg` is given twice",
        ),
        (
            &[("unbalance_mass_kg", &[0.1]), ("shaft_mass_kg", &[5.0])],
            "`shaft_mass_kg` is no axis of this plan",
        ),
    ] {
        let message = find_axis_columns(columns).unwrap_err();
        assert!(message.contains(message_part), "{message}");
    }
}

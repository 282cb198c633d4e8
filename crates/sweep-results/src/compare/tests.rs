//! Tests of comparisons, on files with known differences.

use std::path::Path;
use std::sync::Arc;
use sweep_files::key;

use arrow_array::UInt64Array;
use serde_json::{Value, json};

use super::*;
use crate::sample::{self, ColumnData, RATIOS, number_array, text_array};

fn write_table(columns: Vec<ColumnData>, keys: &[(&str, Value)]) -> ResultTable {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x.parquet");
    sample::write(&path, columns, keys);
    ResultTable::open(&path).unwrap()
}

fn map_table(ratios: &[Option<f64>]) -> ResultTable {
    write_table(sample::map_columns(ratios), &[(key::PLAN, sample::plan())])
}

#[test]
fn a_file_equals_itself() {
    let comparison = compare(&map_table(&RATIOS), &map_table(&RATIOS)).unwrap();
    assert!(comparison.is_empty(), "{comparison:?}");
    assert_eq!((comparison.shared_rows.len(), comparison.flips(false).count()), (6, 0));
    assert!(comparison.most_deviating(5, false, SharedRow::ratio_deviation).is_empty());
    let shift = comparison.boundary.unwrap();
    assert!(
        shift.unmatched_lines.is_empty()
            && shift.crossings.iter().all(|crossing| crossing.shift_range() == [0.0; 2])
    );
}

#[test]
fn flips_are_found_and_sensitive_rows_are_separate() {
    let mut ratios = RATIOS;
    ratios[1] = Some(2.25); // reliable before
    ratios[2] = Some(1.25); // not reliable before
    ratios[3] = Some(1.0); // failed before
    ratios[4] = Some(1.0); // not reliable before, and sensitive
    let comparison = compare(&map_table(&RATIOS), &map_table(&ratios)).unwrap();
    let count_flips = |sensitive| {
        comparison.flips(sensitive).map(|row| (row.rows[0], row.flip)).collect::<Vec<_>>()
    };
    assert_eq!(count_flips(false), [(1, Flip::Lost), (2, Flip::Gained), (3, Flip::Defined)]);
    assert_eq!(count_flips(true), [(4, Flip::Gained)]);
    let count_lost =
        |comparison: &Comparison| comparison.shared_rows.iter().filter(|row| row.is_lost).count();
    assert_eq!(count_lost(&comparison), 1);
    ratios[0] = None; // reliable before
    assert_eq!(count_lost(&compare(&map_table(&RATIOS), &map_table(&ratios)).unwrap()), 2);
    let most_deviating = comparison.most_deviating(3, false, SharedRow::ratio_deviation);
    assert_eq!(most_deviating.iter().map(|row| row.rows[0]).collect::<Vec<_>>(), [3, 2, 1]);
    assert!(
        (most_deviating[1].ratio_deviation() - 1.0).abs() < 1e-12,
        "2.5 to 1.25 is a factor of two"
    );
    let gap_row = comparison.most_deviating(2, false, SharedRow::gap_deviation_m)[1];
    assert!((gap_row.gap_deviation_m() - 1.25e-3).abs() < 1e-12, "{gap_row:?}");
    assert!(comparison.shared_rows.iter().filter(|row| row.differs).count() == 4);
    assert!(
        comparison
            .changed_columns
            .iter()
            .any(|column| column.name == "ratio_max" && column.rows == 4)
    );
    assert!(!comparison.is_empty());
}

#[test]
fn over_estimated_rows_are_counted_in_both_files() {
    let mut ratios = RATIOS;
    ratios[0] = Some(0.4);
    let comparison = compare(&map_table(&RATIOS), &map_table(&ratios)).unwrap();
    assert_eq!(comparison.over_estimated_rows, Some([0, 1]));
}

#[test]
fn deviations_from_missing_numbers_are_infinite() {
    let mut ratios = RATIOS;
    ratios[0] = None;
    ratios[3] = Some(1.0); // failed before
    let comparison = compare(&map_table(&RATIOS), &map_table(&ratios)).unwrap();
    for deviation in [SharedRow::ratio_deviation, SharedRow::gap_deviation_m] {
        let rows = comparison.most_deviating(5, false, deviation);
        assert_eq!(rows.iter().map(|row| row.rows[0]).collect::<Vec<_>>(), [0, 3]);
        assert!(rows.iter().all(|row| deviation(row) == f64::INFINITY));
    }
    assert!(comparison.has_ratios && comparison.has_gaps);
    let boundaries = compare(&boundary_table(&[Some(1.0)]), &boundary_table(&[Some(1.0)])).unwrap();
    assert!(!boundaries.has_ratios && !boundaries.has_gaps);
}

#[test]
fn changed_plan_values_are_named() {
    let mut plan = sample::plan();
    plan["machine"]["body"]["mass_kg"] = json!(20.0);
    plan["set"] = json!({ "body_mass_kg": 20.0 });
    let second_table = write_table(sample::map_columns(&RATIOS), &[(key::PLAN, plan)]);
    let comparison = compare(&map_table(&RATIOS), &second_table).unwrap();
    let paths: Vec<&str> = comparison.plan.iter().map(|change| change.path.as_str()).collect();
    assert_eq!(paths, ["machine.body.mass_kg", "set"]);
    assert_eq!(
        (&comparison.plan[0].first, &comparison.plan[0].second),
        (&json!(24.0), &json!(20.0))
    );
}

#[test]
fn maps_of_different_grids_are_compared_at_common_points() {
    // The second grid has one mass, and dampings that differ by rounding.
    let mut plan = sample::plan();
    plan["axis"][0]["values"] = json!([0.1]);
    let mut columns = sample::map_columns(&RATIOS[..3]);
    let dampings = [60.0, 70.0 * (1.0 + 1e-15), 90.0].map(Some);
    columns[2] = ("damping_n_s_per_m", "N s/m", number_array(&dampings));
    let second_table = write_table(columns, &[(key::PLAN, plan)]);
    let comparison = compare(&map_table(&RATIOS), &second_table).unwrap();
    assert_eq!((comparison.shared_rows.len(), comparison.unmatched_rows), (2, [4, 1]));
    assert!(comparison.changed_columns.is_empty(), "{:?}", comparison.changed_columns);
}

/// Returns the sample's map with dampings that follow from a tolerance about a nominal value.
fn map_with_tolerance(nominal: f64, tolerance: &str, ratios: &[Option<f64>]) -> ResultTable {
    let mut plan = sample::plan();
    let [from, to] = [nominal - 10.0, nominal + 10.0];
    plan["axis"][1] = json!({
        "parameter": "damping_n_s_per_m",
        "range": { "from": from, "to": to, "count": 3, "spacing": "linear" },
        "tolerance": tolerance,
    });
    let mut columns = sample::map_columns(ratios);
    let dampings: Vec<_> = (0..6).map(|i| Some(from + 10.0 * f64::from(i % 3))).collect();
    columns[2] = ("damping_n_s_per_m", "N s/m", number_array(&dampings));
    write_table(columns, &[(key::PLAN, plan)])
}

#[test]
fn rows_of_different_nominal_values_are_matched_by_point() {
    let mut ratios = RATIOS;
    ratios[0] = Some(2.5); // reliable before
    let first_table = map_with_tolerance(100.0, "10 %", &RATIOS);
    let comparison = compare(&first_table, &map_with_tolerance(200.0, "10 %", &ratios)).unwrap();
    assert!(comparison.is_matched_by_point);
    assert_eq!((comparison.shared_rows.len(), comparison.unmatched_rows), (6, [0, 0]));
    assert!(comparison.shared_rows.iter().all(|row| row.rows[0] == row.rows[1]));
    assert_eq!(
        (&*comparison.shared_rows[5].key, &*comparison.shared_rows[5].second_key),
        (&[0.2, 110.0][..], &[0.2, 210.0][..])
    );
    let flips: Vec<u64> = comparison.flips(false).map(|row| row.rows[0]).collect();
    assert_eq!(flips, [0]);
    let columns: Vec<&str> =
        comparison.changed_columns.iter().map(|column| column.name.as_str()).collect();
    assert!(!columns.contains(&"damping_n_s_per_m") && columns.contains(&"ratio_max"));
    // Each file's crossings lie between its own values.
    let comparison = compare(&first_table, &map_with_tolerance(200.0, "10 %", &RATIOS)).unwrap();
    assert!(comparison.changed_columns.is_empty() && !comparison.is_empty());
    let brackets = comparison.boundary.unwrap().crossings.remove(0).brackets;
    assert_eq!(brackets, [[100.0, 110.0], [200.0, 210.0]]);

    // Equal nominal values match by their axes, and different tolerances make different grids.
    assert!(
        !compare(&first_table, &map_with_tolerance(100.0, "10 %", &RATIOS))
            .unwrap()
            .is_matched_by_point
    );
    let error = compare(&first_table, &map_with_tolerance(200.0, "5 %", &RATIOS)).unwrap_err();
    assert!(error.to_string().contains("they share no row"), "{error}");
}

#[test]
fn an_axis_of_one_value_may_be_missing_in_the_other_file() {
    let table_with_spins = |values: &[f64]| {
        let mut plan = sample::plan();
        plan["axis"].as_array_mut().unwrap().push(json!({ "parameter": "forcing_rad_per_s" }));
        let mut columns = sample::map_columns(&RATIOS);
        let spin_values: Vec<_> = values.iter().copied().map(Some).collect();
        columns.insert(3, ("forcing_rad_per_s", "rad/s", number_array(&spin_values)));
        write_table(columns, &[(key::PLAN, plan)])
    };
    let comparison = compare(&map_table(&RATIOS), &table_with_spins(&[350.0; 6])).unwrap();
    assert_eq!(comparison.single_valued_axes, [(1, "forcing_rad_per_s".to_owned(), 350.0)]);
    assert_eq!(comparison.shared_rows.len(), 6);
    let table_with_two_spins = table_with_spins(&[300.0, 300.0, 300.0, 350.0, 350.0, 350.0]);
    let error = compare(&map_table(&RATIOS), &table_with_two_spins).unwrap_err();
    assert!(matches!(error, ResultsError::Refused(_)));
    assert!(
        error.to_string().contains("only the second has the axis `forcing_rad_per_s`"),
        "{error}"
    );
}

#[test]
fn files_without_common_rows_are_refused_with_the_reason() {
    let mut columns = sample::map_columns(&RATIOS);
    columns[1] = ("unbalance_mass_kg", "kg", number_array(&[Some(0.7); 6]));
    let second_table = write_table(columns, &[(key::PLAN, sample::plan())]);
    let message = compare(&map_table(&RATIOS), &second_table).unwrap_err().to_string();
    assert!(message.contains("share no row"), "{message}");
    let message =
        compare(&map_table(&RATIOS), &boundary_table(&[Some(100.0)])).unwrap_err().to_string();
    assert!(message.contains("are map and boundary"), "{message}");
}

#[test]
fn rows_with_equal_keys_are_paired_in_order() {
    let design_table = |ratios: [f64; 2]| {
        let plan = json!({ "axis": [{ "parameter": "unbalance_mass_kg" }], "design": {} });
        let columns: Vec<ColumnData> = vec![
            ("unbalance_mass_kg", "kg", number_array(&[Some(0.1); 2])),
            ("ratio_max", "1", number_array(&ratios.map(Some))),
            ("status", "", text_array(&["ok"; 2])),
        ];
        write_table(columns, &[(key::PLAN, plan)])
    };
    let comparison = compare(&design_table([1.0, 3.0]), &design_table([1.0, 4.0])).unwrap();
    assert_eq!(
        comparison.shared_rows.iter().map(|row| row.rows).collect::<Vec<_>>(),
        [[0, 0], [1, 1]]
    );
    assert_eq!(comparison.changed_columns[0].rows, 1);
}

/// Returns a boundary file with a mass for each position. Brackets are 0.5 wide; a position of
/// `None` makes a line without a crossing.
fn boundary_table(positions: &[Option<f64>]) -> ResultTable {
    let rows = positions.len();
    let shifted_positions = |offset: f64| {
        positions
            .iter()
            .map(|position| position.map(|position| position + offset))
            .collect::<Vec<_>>()
    };
    let masses: Vec<_> = (0..rows).map(|k| Some(0.1 + 0.1 * k as f64)).collect();
    let crossing_numbers = positions.iter().map(|position| u64::from(position.is_some()));
    let columns: Vec<ColumnData> = vec![
        ("unbalance_mass_kg", "kg", number_array(&masses)),
        ("damping_n_s_per_m", "N s/m", number_array(positions)),
        ("damping_low_n_s_per_m", "N s/m", number_array(&shifted_positions(-0.25))),
        ("damping_high_n_s_per_m", "N s/m", number_array(&shifted_positions(0.25))),
        ("crossing", "1", Arc::new(UInt64Array::from_iter_values(crossing_numbers))),
    ];
    let settings = json!({ "quantity": "ratio_max", "limit": 2.0 });
    write_table(columns, &[(key::PLAN, sample::plan()), (key::BOUNDARY, settings)])
}

#[test]
fn a_shift_is_certain_only_beyond_the_brackets() {
    let first_table = boundary_table(&[Some(100.0), Some(120.0), None, Some(140.0)]);
    let second_table = boundary_table(&[Some(100.3), Some(123.0), Some(150.0), Some(140.0)]);
    let comparison = compare(&first_table, &second_table).unwrap();
    let shift = comparison.boundary.unwrap();
    assert_eq!((shift.axis.as_str(), shift.unit.as_str()), ("damping_n_s_per_m", "N s/m"));
    assert_eq!((shift.crossings.len(), shift.count_certain_shifts()), (3, 1));
    let most_shifted = shift.most_shifted().unwrap();
    assert_eq!((most_shifted.shift_range(), most_shifted.certain_shift()), ([2.5, 3.5], 2.5));
    // The shifts are 0.3 and 3, each give or take 0.5; the third crossing has not moved.
    let mean_shift = shift.mean_shift_range().unwrap();
    assert!(
        (mean_shift[0] - 2.3 / 3.0).abs() < 1e-9 && (mean_shift[1] - 4.3 / 3.0).abs() < 1e-9,
        "{mean_shift:?}"
    );
    assert_eq!(shift.unmatched_lines.len(), 1);
    assert_eq!(shift.unmatched_lines[0].1, [0, 1]);
    let shift = compare(&first_table, &boundary_table(&[None, None, None, None]))
        .unwrap()
        .boundary
        .unwrap();
    assert_eq!((shift.mean_shift_range(), shift.unmatched_lines.len()), (None, 3));
}

#[test]
fn a_boundary_of_maps_lies_between_neighbours() {
    // The ratios 1, 1.5, 2.5 along the damping cross 2 between 70 and 80.
    let mut ratios = RATIOS;
    ratios[1] = Some(2.2);
    let shift = compare(&map_table(&RATIOS), &map_table(&ratios)).unwrap().boundary.unwrap();
    let first_crossing = &shift.crossings[0];
    assert_eq!(first_crossing.brackets, [[70.0, 80.0], [60.0, 70.0]]);
    assert_eq!((first_crossing.shift_range(), first_crossing.certain_shift()), ([-20.0, 0.0], 0.0));
}

#[test]
fn a_missing_file_is_an_error() {
    assert!(ResultTable::open(Path::new("/nonexistent.parquet")).is_err());
}

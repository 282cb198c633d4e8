//! Files with planted differences.

use std::path::Path;
use std::sync::Arc;
use sweep_files::key;

use arrow_array::UInt64Array;
use serde_json::{Value, json};

use super::*;
use crate::sample::{self, Made, RATIOS, numbers, texts};

fn file(columns: Vec<Made>, keys: &[(&str, Value)]) -> ResultTable {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("x.parquet");
    sample::write(&path, columns, keys);
    ResultTable::open(&path).unwrap()
}

fn map(ratios: &[Option<f64>]) -> ResultTable {
    file(sample::map(ratios), &[(key::PLAN, sample::plan())])
}

#[test]
fn a_file_does_not_differ_from_itself() {
    let found = compare(&map(&RATIOS), &map(&RATIOS)).unwrap();
    assert!(found.is_empty(), "{found:?}");
    assert_eq!((found.shared.len(), found.flips(false).count()), (6, 0));
    assert!(found.greatest(5, false, SharedRow::ratio_by).is_empty());
    let moved = found.boundary.unwrap();
    assert!(moved.unlike.is_empty() && moved.crossings.iter().all(|c| c.by() == [0.0; 2]));
}

#[test]
fn planted_flips_are_found_and_sensitive_rows_stand_apart() {
    let mut ratios = RATIOS;
    ratios[1] = Some(2.25); // reliable before
    ratios[2] = Some(1.25); // not reliable before
    ratios[3] = Some(1.0); // failed before
    ratios[4] = Some(1.0); // not reliable before, and sensitive
    let found = compare(&map(&RATIOS), &map(&ratios)).unwrap();
    let flips =
        |sensitive| found.flips(sensitive).map(|row| (row.rows[0], row.flip)).collect::<Vec<_>>();
    assert_eq!(flips(false), [(1, Flip::Lost), (2, Flip::Gained), (3, Flip::Defined)]);
    assert_eq!(flips(true), [(4, Flip::Gained)]);
    let lost = |found: &Comparison| found.shared.iter().filter(|row| row.is_lost).count();
    assert_eq!(lost(&found), 1);
    ratios[0] = None; // reliable before
    assert_eq!(lost(&compare(&map(&RATIOS), &map(&ratios)).unwrap()), 2);
    let greatest = found.greatest(3, false, SharedRow::ratio_by);
    assert_eq!(greatest.iter().map(|row| row.rows[0]).collect::<Vec<_>>(), [3, 2, 1]);
    assert!((greatest[1].ratio_by() - 1.0).abs() < 1e-12, "2.5 to 1.25 is a factor of two");
    let gap = found.greatest(2, false, SharedRow::gap_by_m)[1];
    assert!((gap.gap_by_m() - 1.25e-3).abs() < 1e-12, "{gap:?}");
    assert!(found.shared.iter().filter(|row| row.differs).count() == 4);
    assert!(found.columns.iter().any(|column| column.name == "ratio_max" && column.rows == 4));
    assert!(!found.is_empty());
}

#[test]
fn rows_that_the_linear_model_over_estimates_are_counted_in_both_files() {
    let mut ratios = RATIOS;
    ratios[0] = Some(0.4);
    let found = compare(&map(&RATIOS), &map(&ratios)).unwrap();
    assert_eq!(found.over_estimated, Some([0, 1]));
}

#[test]
fn numbers_that_came_or_went_changed_by_more_than_any_measure() {
    let mut ratios = RATIOS;
    ratios[0] = None;
    ratios[3] = Some(1.0); // failed before
    let found = compare(&map(&RATIOS), &map(&ratios)).unwrap();
    for by in [SharedRow::ratio_by, SharedRow::gap_by_m] {
        let rows = found.greatest(5, false, by);
        assert_eq!(rows.iter().map(|row| row.rows[0]).collect::<Vec<_>>(), [0, 3]);
        assert!(rows.iter().all(|row| by(row) == f64::INFINITY));
    }
    assert!(found.has_ratios && found.has_gaps);
    let boundaries = compare(&boundary(&[Some(1.0)]), &boundary(&[Some(1.0)])).unwrap();
    assert!(!boundaries.has_ratios && !boundaries.has_gaps);
}

#[test]
fn what_was_set_otherwise_is_named() {
    let mut plan = sample::plan();
    plan["machine"]["body"]["mass_kg"] = json!(20.0);
    plan["set"] = json!({ "body_mass_kg": 20.0 });
    let second = file(sample::map(&RATIOS), &[(key::PLAN, plan)]);
    let found = compare(&map(&RATIOS), &second).unwrap();
    let paths: Vec<&str> = found.plan.iter().map(|change| change.path.as_str()).collect();
    assert_eq!(paths, ["machine.body.mass_kg", "set"]);
    assert_eq!((&found.plan[0].first, &found.plan[0].second), (&json!(24.0), &json!(20.0)));
}

#[test]
fn maps_of_other_grids_compare_where_they_meet() {
    // Only the lighter mass, and dampings by other arithmetic.
    let mut plan = sample::plan();
    plan["axis"][0]["values"] = json!([0.1]);
    let mut columns = sample::map(&RATIOS[..3]);
    let dampings = [60.0, 70.0 * (1.0 + 1e-15), 90.0].map(Some);
    columns[2] = ("damping_n_s_per_m", "N s/m", numbers(&dampings));
    let second = file(columns, &[(key::PLAN, plan)]);
    let found = compare(&map(&RATIOS), &second).unwrap();
    assert_eq!((found.shared.len(), found.alone), (2, [4, 1]));
    assert!(found.columns.is_empty(), "{:?}", found.columns);
}

#[test]
fn an_axis_that_one_file_lacks_is_left_out_if_it_has_one_value() {
    let with_spin = |values: &[f64]| {
        let mut plan = sample::plan();
        plan["axis"].as_array_mut().unwrap().push(json!({ "parameter": "forcing_rad_per_s" }));
        let mut columns = sample::map(&RATIOS);
        let values: Vec<_> = values.iter().copied().map(Some).collect();
        columns.insert(3, ("forcing_rad_per_s", "rad/s", numbers(&values)));
        file(columns, &[(key::PLAN, plan)])
    };
    let found = compare(&map(&RATIOS), &with_spin(&[350.0; 6])).unwrap();
    assert_eq!(found.fixed, [(1, "forcing_rad_per_s".to_owned(), 350.0)]);
    assert_eq!(found.shared.len(), 6);
    let two = with_spin(&[300.0, 300.0, 300.0, 350.0, 350.0, 350.0]);
    let refused = compare(&map(&RATIOS), &two).unwrap_err();
    assert!(matches!(refused, ResultsError::Refused(_)));
    assert!(
        refused.to_string().contains("only the second has the axis `forcing_rad_per_s`"),
        "{refused}"
    );
}

#[test]
fn what_shares_nothing_is_refused_with_the_reason() {
    let mut columns = sample::map(&RATIOS);
    columns[1] = ("unbalance_mass_kg", "kg", numbers(&[Some(0.7); 6]));
    let second = file(columns, &[(key::PLAN, sample::plan())]);
    let refused = compare(&map(&RATIOS), &second).unwrap_err().to_string();
    assert!(refused.contains("share no row"), "{refused}");
    let refused = compare(&map(&RATIOS), &boundary(&[Some(100.0)])).unwrap_err().to_string();
    assert!(refused.contains("are map and boundary"), "{refused}");
}

#[test]
fn rows_of_one_key_pair_in_order() {
    let listed = |ratios: [f64; 2]| {
        let plan = json!({ "axis": [{ "parameter": "unbalance_mass_kg" }], "design": {} });
        let columns: Vec<Made> = vec![
            ("unbalance_mass_kg", "kg", numbers(&[Some(0.1); 2])),
            ("ratio_max", "1", numbers(&ratios.map(Some))),
            ("status", "", texts(&["ok"; 2])),
        ];
        file(columns, &[(key::PLAN, plan)])
    };
    let found = compare(&listed([1.0, 3.0]), &listed([1.0, 4.0])).unwrap();
    assert_eq!(found.shared.iter().map(|row| row.rows).collect::<Vec<_>>(), [[0, 0], [1, 1]]);
    assert_eq!(found.columns[0].rows, 1);
}

/// A boundary of as many masses, half a unit wide; where there is none, none in range.
fn boundary(at: &[Option<f64>]) -> ResultTable {
    let rows = at.len();
    let shifted = |by: f64| at.iter().map(|at| at.map(|at| at + by)).collect::<Vec<_>>();
    let masses: Vec<_> = (0..rows).map(|i| Some(0.1 + 0.1 * i as f64)).collect();
    let crossing = at.iter().map(|at| u64::from(at.is_some()));
    let columns: Vec<Made> = vec![
        ("unbalance_mass_kg", "kg", numbers(&masses)),
        ("damping_n_s_per_m", "N s/m", numbers(at)),
        ("damping_low_n_s_per_m", "N s/m", numbers(&shifted(-0.25))),
        ("damping_high_n_s_per_m", "N s/m", numbers(&shifted(0.25))),
        ("crossing", "1", Arc::new(UInt64Array::from_iter_values(crossing))),
    ];
    let about = json!({ "quantity": "ratio_max", "limit": 2.0 });
    file(columns, &[(key::PLAN, sample::plan()), (key::BOUNDARY, about)])
}

#[test]
fn a_boundary_that_moves_does_so_for_certain_only_past_its_brackets() {
    let first = boundary(&[Some(100.0), Some(120.0), None, Some(140.0)]);
    let second = boundary(&[Some(100.3), Some(123.0), Some(150.0), Some(140.0)]);
    let found = compare(&first, &second).unwrap();
    let moved = found.boundary.unwrap();
    assert_eq!((moved.axis.as_str(), moved.unit.as_str()), ("damping_n_s_per_m", "N s/m"));
    assert_eq!((moved.crossings.len(), moved.certain()), (3, 1));
    let farthest = moved.farthest().unwrap();
    assert_eq!((farthest.by(), farthest.at_least()), ([2.5, 3.5], 2.5));
    // 0.3 and 3, give or take half a unit; the third is where it was.
    let mean = moved.mean().unwrap();
    assert!((mean[0] - 2.3 / 3.0).abs() < 1e-9 && (mean[1] - 4.3 / 3.0).abs() < 1e-9, "{mean:?}");
    assert_eq!(moved.unlike.len(), 1);
    assert_eq!(moved.unlike[0].1, [0, 1]);
    let moved = compare(&first, &boundary(&[None, None, None, None])).unwrap().boundary.unwrap();
    assert_eq!((moved.mean(), moved.unlike.len()), (None, 3));
}

#[test]
fn the_boundary_of_maps_lies_between_neighbours() {
    // Along damping: 1, 1.5, 2.5 crosses 2 between 70 and 80.
    let mut ratios = RATIOS;
    ratios[1] = Some(2.2);
    let moved = compare(&map(&RATIOS), &map(&ratios)).unwrap().boundary.unwrap();
    let lighter = &moved.crossings[0];
    assert_eq!(lighter.bracket, [[70.0, 80.0], [60.0, 70.0]]);
    assert_eq!((lighter.by(), lighter.at_least()), ([-20.0, 0.0], 0.0));
}

#[test]
fn a_file_that_is_not_there_is_an_error() {
    assert!(ResultTable::open(Path::new("/nonexistent.parquet")).is_err());
}

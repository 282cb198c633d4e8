//! Which columns there are, in which order, and what they say.

use washer_row::{Criterion, Metric};

use super::*;
use crate::store::synthetic;

#[test]
fn columns_stand_as_the_contract_says() {
    let names: Vec<String> =
        synthetic::layout().schema().fields().iter().map(|f| f.name().clone()).collect();
    assert_eq!(
        names,
        [
            "point",
            "unbalance_mass_kg",
            "damping_n_s_per_m",
            "nonlinear_tub_front_y",
            "nonlinear_tub_yaw",
            "linear_tub_front_y",
            "linear_tub_yaw",
            "ratio_tub_front_y",
            "ratio_tub_yaw",
            "ratio_max",
            "ratio_max_channel",
            "reliable",
            "sensitive",
            "method",
            "error",
            "min_gap_nonlinear_m",
            "min_gap_linear_m",
            "status",
            "fail_time_s",
            "steps_nonlinear",
            "steps_linear",
            "rejected_nonlinear",
            "rejected_linear",
        ]
    );
}

#[test]
fn metrics_have_columns_in_the_order_asked_for_and_criteria_say_what_they_are() {
    let mut layout = synthetic::layout();
    let plain = layout.schema().fields().len();
    let metrics = vec![Metric::StaticSag, Metric::ClashTime, Metric::CabinetForce];
    layout.measures = Measures { criterion: Criterion::Rms, metrics, ..Measures::default() };
    let mut rows = ResultRows::new(&layout);
    let mut outcome = synthetic::outcome(0, 2);
    outcome.static_sag_m = Some(0.013);
    outcome.nonlinear.metrics = vec![1.5, 400.0];
    outcome.linear.metrics = vec![0.5, 300.0];
    rows.push(vec![0.1, 60.0], outcome);
    let batch = rows.take().unwrap();
    assert_eq!(batch.num_columns(), plain + 5);
    let expected = [
        ("static_sag_m", 0.013),
        ("clash_time_nonlinear_s", 1.5),
        ("clash_time_linear_s", 0.5),
        ("cabinet_force_nonlinear_n", 400.0),
        ("cabinet_force_linear_n", 300.0),
    ];
    let first = batch.schema().index_of("static_sag_m").unwrap();
    for (k, (name, value)) in expected.into_iter().enumerate() {
        assert_eq!(batch.schema().field(first + k).name(), name);
        let column = batch.column(first + k).as_any().downcast_ref::<Float64Array>().unwrap();
        assert_eq!(column.value(0), value, "{name}");
    }
    let description = &layout.dictionary()["nonlinear_tub_yaw"]["description"];
    assert!(description.as_str().unwrap().contains("root mean square"), "{description}");
}

#[test]
fn every_field_carries_unit_and_description() {
    let layout = synthetic::layout();
    let dictionary = layout.dictionary();
    for field in layout.schema().fields() {
        let unit = &field.metadata()["unit"];
        assert_eq!(dictionary[field.name()]["unit"], unit.as_str());
        assert!(!field.metadata()["description"].is_empty(), "{}", field.name());
    }
    assert_eq!(dictionary["nonlinear_tub_yaw"]["unit"], "rad");
}

#[test]
fn name_dictionaries_do_not_depend_on_which_names_appear() {
    let layout = synthetic::layout();
    let mut rows = ResultRows::new(&layout);
    rows.push(vec![0.1, 60.0], synthetic::outcome(0, 2));
    let batch = rows.take().unwrap();
    let names = |column: &str| {
        let array = batch.column_by_name(column).unwrap();
        let array = array.as_any().downcast_ref::<DictionaryArray<Int32Type>>().unwrap();
        let values = array.values().as_any().downcast_ref::<StringArray>().unwrap();
        values.iter().flatten().map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(names("status"), ROW_STATUSES);
    assert_eq!(names("ratio_max_channel"), ["tub_front_y", "tub_yaw"]);
}

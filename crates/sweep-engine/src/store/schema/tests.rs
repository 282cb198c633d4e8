//! Tests of columns and batches.

use super::*;
use crate::store::synthetic;

#[test]
fn every_field_carries_unit_and_description() {
    let layout = synthetic::layout();
    for field in layout.schema().fields() {
        assert!(field.metadata().contains_key("unit"), "{}", field.name());
        assert!(!field.metadata()["description"].is_empty(), "{}", field.name());
    }
}

#[test]
fn name_dictionaries_do_not_depend_on_which_names_appear() {
    let layout = synthetic::layout();
    let mut rows = BatchBuilder::new(&layout);
    rows.push_row(0, vec![0.1, 60.0], synthetic::row(0));
    let batch = rows.take_batch().unwrap();
    let names = |column: &str| {
        let array = batch.column_by_name(column).unwrap();
        let array = array.as_any().downcast_ref::<DictionaryArray<Int32Type>>().unwrap();
        let values = array.values().as_any().downcast_ref::<StringArray>().unwrap();
        values.iter().flatten().map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(names("status"), synthetic::STATUSES);
}

//! Tests of the names, the order and the descriptions of columns.

use arrow_array::Float64Array;
use sweep_engine::columns::point_rows;
use sweep_engine::store::{BatchBuilder, CellType};
use washer_row::{Criterion, Status};

use super::*;

const CHANNELS: [Channel; 2] = [Channel::TubFrontY, Channel::TubYaw];

fn columns_for(measures: &Measures) -> Columns {
    Columns::for_measures(&CHANNELS, 2.0.into(), measures, false)
}

fn layout_for(measures: Measures) -> sweep_engine::store::Layout {
    let axis_column = |name: &str, unit: &str| {
        DeclaredColumn::new(name, unit, format!("swept {name}"), CellType::Axis)
    };
    let axes =
        vec![axis_column("unbalance_mass_kg", "kg"), axis_column("damping_n_s_per_m", "N s/m")];
    sweep_engine::store::Layout::map(axes, columns_for(&measures).declared())
}

#[test]
fn columns_of_a_run_are_in_the_documented_order() {
    let names: Vec<String> = layout_for(Measures::default())
        .schema()
        .fields()
        .iter()
        .map(|f| f.name().clone())
        .collect();
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
            "converged",
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
fn metrics_have_columns_in_the_requested_order_and_criteria_describe_the_amplitudes() {
    let column_count_without_metrics = layout_for(Measures::default()).schema().fields().len();
    let metrics = vec![Metric::StaticSag, Metric::ClashTime, Metric::CabinetForce];
    let measures = Measures { criterion: Criterion::Rms, metrics, ..Measures::default() };
    let layout = layout_for(measures.clone());
    let trajectory_with_metrics = |metrics: &[f64]| Trajectory {
        amplitudes: vec![0.1, 0.2],
        metrics: metrics.to_vec(),
        ..Trajectory::failed(Status::Ok)
    };
    let mut outcome = Outcome::new(
        0,
        trajectory_with_metrics(&[1.5, 400.0]),
        trajectory_with_metrics(&[0.5, 300.0]),
    );
    outcome.static_sag_m = Some(0.013);
    let mut batch_builder = BatchBuilder::new(&layout);
    batch_builder.push_row(
        0,
        vec![0.1, 60.0],
        point_rows(&columns_for(&measures).columns, 0, [&outcome]).rows.remove(0),
    );
    let batch = batch_builder.take_batch().unwrap();
    assert_eq!(batch.num_columns(), column_count_without_metrics + 5);
    let expected_columns = [
        ("static_sag_m", 0.013),
        ("clash_time_nonlinear_s", 1.5),
        ("clash_time_linear_s", 0.5),
        ("cabinet_force_nonlinear_n", 400.0),
        ("cabinet_force_linear_n", 300.0),
    ];
    let first_index = batch.schema().index_of("static_sag_m").unwrap();
    for (k, (name, value)) in expected_columns.into_iter().enumerate() {
        assert_eq!(batch.schema().field(first_index + k).name(), name);
        let column = batch.column(first_index + k).as_any().downcast_ref::<Float64Array>().unwrap();
        assert_eq!(column.value(0), value, "{name}");
    }
    let schema = layout.schema();
    let description =
        &schema.field_with_name("nonlinear_tub_yaw").unwrap().metadata()["description"];
    assert!(description.contains("root mean square"), "{description}");
}

//! Rows computed by a formula, for tests of the store and the runner without a model.

use serde_json::json;
use sweep_files::FileKind;

use super::{CellType, DeclaredColumn, Job, Layout, PointRows, RowCells};

/// The statuses of rows.
pub const STATUSES: [&str; 4] = ["ok", "diverged", "step_limit", "linear_diverged"];

/// Returns a layout with two axes and the columns of one channel.
pub fn layout() -> Layout {
    let make_column =
        |name: &str, unit: &str, kind| DeclaredColumn::new(name, unit, format!("the {name}"), kind);
    let measured_column = |name: &str| make_column(name, "m", CellType::Measured);
    Layout {
        axes: vec![
            make_column("mass_kg", "kg", CellType::Axis),
            make_column("damping", "N s/m", CellType::Axis),
        ],
        columns: vec![
            measured_column("nonlinear_a"),
            measured_column("linear_a"),
            make_column("ratio_max", "1", CellType::Measured),
            make_column("reliable", "", CellType::Flag),
            make_column("sensitive", "", CellType::Flag),
            make_column("method", "", CellType::Name(vec!["rk4", "dopri5"])),
            make_column("error", "1", CellType::Measured),
            make_column("converged", "", CellType::Flag),
            make_column("status", "", CellType::Name(STATUSES.to_vec())),
            make_column("fail_time_s", "s", CellType::Time),
            make_column("steps", "1", CellType::Count),
        ],
        kind: FileKind::Map,
        tasks_per_point: 1,
        has_several_rows: false,
        metadata: Vec::new(),
    }
}

/// Returns a job with a number of points.
pub fn job(points: u64) -> Job<'static> {
    Job {
        plan: json!({ "name": "synthetic", "points": points, "step_s": 2.0e-4 }),
        version: "0.0.0-test",
        numerics: 1,
        points,
        layout: layout(),
        limits: 2.0.into(),
        axis_values: Box::new(|point| {
            vec![0.05 * (point / 9 + 1) as f64, 60.0 + 10.0 * (point % 9) as f64]
        }),
    }
}

/// Returns the row of a point. The first 60 points have every kind of row: reliable, unreliable,
/// undefined, and failed in each way.
pub fn row(point: u64) -> RowCells {
    let point_number = point as f64;
    let status = if [4, 7].contains(&(point % 20)) { 1 + point / 20 % 3 } else { 0 };
    let linear_amplitude =
        if point % 30 == 11 { 0.0 } else { 1.0 + (0.37 * point_number).sin().abs() };
    let nonlinear_amplitude = linear_amplitude * (0.5 + point_number % 5.0);
    let is_ok = status == 0;
    let cell_unless_failed = |value: f64| Some(value.to_bits()).filter(|_| is_ok);
    let ratio =
        (is_ok && linear_amplitude != 0.0).then_some(nonlinear_amplitude / linear_amplitude);
    vec![
        cell_unless_failed(nonlinear_amplitude),
        cell_unless_failed(linear_amplitude),
        ratio.map(f64::to_bits),
        ratio.map(|ratio| u64::from(ratio < 2.0)),
        [None, Some(0), Some(1)][(point % 3) as usize],
        Some(point % 2),
        (!point.is_multiple_of(5)).then_some((1e-5 * (1.0 + point_number)).to_bits()),
        (!point.is_multiple_of(5)).then_some(u64::from(point_number < 30.0)),
        Some(status),
        (!is_ok).then_some((point_number / 7.0).to_bits()),
        Some(1000 + point),
    ]
}

/// Returns a point with its row.
pub fn point_rows(point: u64) -> PointRows {
    PointRows { point, rows: vec![row(point)] }
}

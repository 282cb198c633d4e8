//! Outcomes from a formula, for tests of the store and the runner without physics.

use serde_json::json;
use washer_model::Channel;
use washer_row::{Level, Measures, Outcome, Status, Trajectory};

use super::{AxisColumn, Job, Layout, RowKind};

/// Two axes, two channels.
pub(crate) fn layout() -> Layout {
    let axis = |name: &str, unit: &str| AxisColumn {
        name: name.into(),
        unit: unit.into(),
        description: format!("swept {name}"),
    };
    Layout {
        axes: vec![axis("unbalance_mass_kg", "kg"), axis("damping_n_s_per_m", "N s/m")],
        channels: vec![Channel::TubFrontY, Channel::TubYaw],
        ratio_limit: 2.0,
        measures: Measures::default(),
        rows: RowKind::Run,
    }
}

pub(crate) fn job(points: u64) -> Job<'static> {
    Job {
        plan: json!({ "name": "synthetic", "points": points, "step_s": 2.0e-4 }),
        version: "0.0.0-test",
        numerics: 1,
        points,
        layout: layout(),
        axis_values: Box::new(|point| {
            vec![0.05 * (point / 9 + 1) as f64, 60.0 + 10.0 * (point % 9) as f64]
        }),
    }
}

/// Every kind of row comes by within 60 points: reliable, not, undefined, failed in each model and
/// in each way.
pub(crate) fn outcome(point: u64, channels: usize) -> Outcome {
    let x = point as f64;
    let model = |scale: f64, status: Status| Trajectory {
        status,
        fail_time_s: (status == Status::Diverged).then_some(x / 7.0),
        amplitudes: if status == Status::Ok {
            (0..channels).map(|c| scale * (1.0 + (x * 0.37 + c as f64).sin().abs())).collect()
        } else {
            Vec::new()
        },
        min_gap_m: (status == Status::Ok).then_some(0.01 - scale * 1e-3),
        steps: 1000 + point,
        rejected: point % 3,
        ..Trajectory::failed(status)
    };
    let failing = |salt: u64| match (point + salt) % 20 {
        7 => Status::ALL[((point + salt) / 20 % 5) as usize + 1],
        _ => Status::Ok,
    };
    let still = if point % 30 == 11 { 0.0 } else { 1.0 };
    let mut outcome =
        Outcome::new(point, model(still * (0.5 + x % 5.0), failing(0)), model(still, failing(3)));
    outcome.method = Level::ALL[(point % 4) as usize];
    outcome.error = (!point.is_multiple_of(5)).then_some(1e-5 * (1.0 + x));
    outcome.sensitive = [None, Some(false), Some(true)][(point % 3) as usize];
    outcome
}

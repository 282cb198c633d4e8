//! Tests of plans that are read back from results.

use washer_row::Metric;

use super::super::WasherGridInput;
use super::super::machine::machine_with_every_element;

const GRID: &str = r#"
name = "again"
set = { tub_mass_kg = 24.5 }
spin = { profile = "table", time_s = [0, 10, 50], speed_rpm = [0, 300, 1e2] }
time = { end_s = 50, window_s = [30, 50] }
integrator = { accuracy = 1e-4 }
reliability = { ratio_limit = 1.5, channels = ["tub_yaw", "tub_pitch"], criterion = "rms" }
metrics = ["static_sag", "growth"]
stability = { speed_rpm = "200:240:20" }
[[axis]]
parameter = "unbalance_mass_kg"
values = [0.1, 0.30000000000000004]
[[axis]]
parameter = "bearing_stiffness_n_per_m"
range = { from = 1e7, to = 2e8, count = 4, spacing = "log" }
"#;

#[test]
fn a_plan_is_read_back_from_its_json() {
    let mut plan = WasherGridInput::text("again", GRID.to_owned(), Vec::new()).load().unwrap();
    let reload_from_json = |plan: &crate::Plan| {
        let input = WasherGridInput::from_plan("again", &plan.to_json());
        input.load().unwrap_or_else(|mistakes| panic!("{mistakes}"))
    };
    assert_eq!(reload_from_json(&plan), plan);
    // This machine has stops, and the metric of stop forces needs no held speeds.
    plan.model.measures.metrics = vec![Metric::StopForce];
    plan.model.held_speeds = None;
    plan.model.machine = machine_with_every_element();
    plan.model.machine.feet = [[0.5, -0.4, 0.3], [0.5, -0.4, -0.3], [-0.2, -0.4, 0.0]]
        .map(|foot_m| washer_model::Foot { foot_m })
        .to_vec();
    plan.model.measures.stops = plan.model.machine.stops.len();
    plan.model.measures.feet = plan.model.machine.feet.len();
    assert_eq!(reload_from_json(&plan), plan);
}

//! Failures are rows, each its own: the others are the same bits with and without them.

use super::*;
use crate::interrupt::Interrupt;

/// Springs too soft to carry the machine, unbalances that throw it out of the model's range, and points that go well.
const GRID: &str = r#"
[spin]
profile = "ramp"
peak_rpm = 1200
ramp_s = 1
[time]
end_s = 3
window_s = [0.5, 1]
[integrator]
method = "rk4"
[[axis]]
parameter = "spring_stiffness_n_per_m"
values = [1, 500, 7000]
[[axis]]
parameter = "unbalance_mass_kg"
values = [0.1, 10, 300]
"#;

fn plan(text: &str) -> Plan {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.toml");
    std::fs::write(&path, text).unwrap();
    crate::config::load(&path, &[]).unwrap()
}

fn evaluate(engine: &ModelEngine<'_>, points: Range<u64>) -> Vec<Outcome> {
    engine.evaluate(points, &Watch::new(&Interrupt::new())).unwrap()
}

#[test]
fn a_failed_point_is_a_row_and_leaves_the_others_bits_alone() {
    let plan = plan(GRID);
    let engine = ModelEngine::new(&plan).unwrap();
    let together = evaluate(&engine, 0..9);
    let statuses: Vec<_> = together.iter().map(|outcome| outcome.nonlinear.status).collect();
    for status in [Status::Ok, Status::Diverged, Status::NoEquilibrium] {
        assert!(statuses.contains(&status), "no {status:?} in {statuses:?}");
    }
    for outcome in &together {
        let model = &outcome.nonlinear;
        assert_eq!(model.amplitudes.is_empty(), model.status != Status::Ok);
        assert_eq!(model.fail_time_s.is_some(), model.status == Status::Diverged);
        assert_eq!(evaluate(&engine, outcome.point..outcome.point + 1), std::slice::from_ref(outcome));
    }
}

#[test]
fn a_panic_in_one_points_evaluation_is_that_points_row() {
    let plan = plan(GRID);
    let engine = ModelEngine::new(&plan).unwrap();
    let evaluate = |points: Range<u64>| {
        assert!(!points.contains(&7), "a defect at point seven");
        engine.evaluate_together(points, &|point| plan.scenario(point))
    };
    let outcomes = together_or_alone(5..9, &evaluate);
    assert_eq!(outcomes.iter().map(|outcome| outcome.point).collect::<Vec<_>>(), [5, 6, 7, 8]);
    let panicked = &outcomes[2];
    assert_eq!((panicked.nonlinear.status, panicked.linear.status), (Status::Panicked, Status::Panicked));
    assert!(panicked.nonlinear.amplitudes.is_empty() && panicked.nonlinear.fail_time_s.is_none());
    let undisturbed = engine.evaluate_together(5..9, &|point| plan.scenario(point));
    for k in [0, 1, 3] {
        assert_eq!(outcomes[k], undisturbed[k]);
    }
}

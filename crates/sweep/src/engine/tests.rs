//! Tests of failed rows: they do not change the bits of the other rows.

mod fast;

use sweep_engine::Interrupt;
use sweep_files::panics::{into_content, lock};

use super::*;

/// A grid with springs too soft to carry the machine, unbalances that drive the solution out of the
/// model's range, and points without a failure.
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

impl ModelEngine<'_> {
    /// Returns the outcomes from which the rows of points are written, in the order of the points.
    pub(crate) fn outcomes_at(&self, axis_values: &[Vec<f64>]) -> Vec<Outcome> {
        let remaining = Mutex::new(axis_values.iter().enumerate());
        let source =
            || lock(&remaining).next().map(|(point, values)| (point as u64, values.clone()));
        let outcomes = Mutex::new(Vec::new());
        let sink = |outcome: &Outcome| lock(&outcomes).push(outcome.clone());
        self.integrate_rows(&source, &sink, &RunContext::new(&Interrupt::new()));
        let mut outcomes = into_content(outcomes);
        outcomes.sort_by_key(|outcome| outcome.point);
        outcomes
    }
}

fn load_plan(text: &str) -> Plan {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.toml");
    std::fs::write(&path, text).unwrap();
    crate::config::load(&path, &[]).unwrap()
}

fn evaluate_points(engine: &ModelEngine<'_>, points: std::ops::Range<u64>) -> Vec<Outcome> {
    let first_point = points.start;
    let values: Vec<_> = points.map(|point| engine.plan.axis_values(point)).collect();
    let mut outcomes = engine.outcomes_at(&values);
    outcomes.iter_mut().for_each(|outcome| outcome.point += first_point);
    outcomes
}

#[test]
fn a_single_stiff_point_of_a_long_list_is_integrated() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.toml");
    let mut list_text = "bearing_stiffness_n_per_m\n".to_owned();
    for point in 0..600 {
        list_text.push_str(if point == 301 { "5e10\n" } else { "2e8\n" });
    }
    std::fs::write(folder.path().join("points.csv"), list_text).unwrap();
    let grid_text = "[spin]\nprofile = \"triangular\"\npeak_rpm = 100\nramp_s = 1\n\
                [time]\nend_s = 1\nwindow_s = [0.5, 1]\n[set]\nfriction_n = 40\n\
                [design]\nmethod = \"list\"\nfile = \"points.csv\"\n";
    std::fs::write(&path, grid_text).unwrap();
    let plan = crate::config::load(&path, &[]).unwrap();
    let engine = ModelEngine::new(&plan).unwrap();
    let row = evaluate_points(&engine, 301..302).remove(0);
    assert_eq!([row.nonlinear.status, row.linear.status], [Status::Ok; 2]);
}

#[test]
fn a_failed_point_is_a_row_and_does_not_change_the_others() {
    let plan = load_plan(GRID);
    let engine = ModelEngine::new(&plan).unwrap();
    let all_outcomes = evaluate_points(&engine, 0..9);
    let statuses: Vec<_> = all_outcomes.iter().map(|outcome| outcome.nonlinear.status).collect();
    for status in [Status::Ok, Status::Diverged, Status::NoEquilibrium] {
        assert!(statuses.contains(&status), "no {status:?} in {statuses:?}");
    }
    for outcome in &all_outcomes {
        let model = &outcome.nonlinear;
        assert_eq!(model.amplitudes.is_empty(), model.status != Status::Ok);
        assert_eq!(model.fail_time_s.is_some(), model.status == Status::Diverged);
        assert_eq!(
            evaluate_points(&engine, outcome.point..outcome.point + 1),
            std::slice::from_ref(outcome)
        );
    }
}

#[test]
fn levels_are_found_anew_after_a_stop() {
    let fast_grid = GRID.replace("\"rk4\"", "\"rk4-mass-scaled\"");
    let plan = load_plan(&fast_grid.replace("[1, 500, 7000]", "[6000, 7000]"));
    let engine = ModelEngine::new(&plan).unwrap();
    let raised_interrupt = Interrupt::new();
    let unraised_interrupt = Interrupt::new();
    raised_interrupt.raise(15);
    assert!(engine.levels_unless_stopped(&RunContext::new(&raised_interrupt)).is_none());
    let found_levels = engine.levels_unless_stopped(&RunContext::new(&unraised_interrupt)).unwrap();
    assert_eq!(found_levels, ModelEngine::new(&plan).unwrap().levels());
}

#[test]
fn a_panic_over_one_item_leaves_the_other_results() {
    let double_all = |items: &[u32]| {
        assert!(!items.contains(&7), "a defect at seven");
        items.iter().map(|item| Some(2 * item)).collect()
    };
    let results = map_isolating_panics(&[5, 6, 7, 8], double_all, || None);
    assert_eq!(results, [Some(10), Some(12), None, Some(16)]);
}

#[test]
fn groups_of_any_size_give_the_same_bits_in_the_fewest_lanes() {
    for trajectories in 1..=9 {
        let simd = Simd::widest().narrowest_for(trajectories);
        let is_narrower = |other: &Simd| other.is_available() && other.lanes() < simd.lanes();
        let fits_in_lanes = |lanes: usize| lanes >= trajectories;
        assert!(
            fits_in_lanes(simd.lanes()) || simd == Simd::widest(),
            "{trajectories} in {simd:?}"
        );
        assert!(
            !Simd::ALL
                .iter()
                .filter(|other| is_narrower(other))
                .any(|other| fits_in_lanes(other.lanes()))
        );
    }
    let plan = load_plan(GRID);
    let engine = ModelEngine::new(&plan).unwrap();
    let all_outcomes = evaluate_points(&engine, 0..9);
    for size in [1, 2, 3, 4, 8] {
        let point_ranges = (0..9).step_by(size).map(|from| from..(from + size as u64).min(9));
        let outcomes_by_part: Vec<_> =
            point_ranges.flat_map(|part| evaluate_points(&engine, part)).collect();
        assert_eq!(outcomes_by_part, all_outcomes, "by {size}");
    }
}

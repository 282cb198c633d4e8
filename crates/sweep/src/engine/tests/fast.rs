//! Tests of the fast method's accuracy against plain RK4: on the paper's map, with channels and
//! windows that are likely to hide errors, and on other machines. `tests/random_rows.rs` tests it
//! on random machines of every kind.

use rayon::prelude::*;
use washer_row::MethodKind;

use super::super::*;
use crate::method::{rk4, rk4_mass_scaled};

fn load_plan(text: &str) -> Plan {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.toml");
    std::fs::write(&path, text).unwrap();
    crate::config::load(&path, &[]).unwrap()
}

fn outcomes_of_plan(plan: &Plan) -> Vec<Outcome> {
    let engine = ModelEngine::new(plan).unwrap();
    let values: Vec<_> = (0..plan.points()).map(|point| plan.axis_values(point)).collect();
    values.par_chunks(256).map(|values| engine.outcomes_at(values)).collect::<Vec<_>>().concat()
}

/// Lower limit of the gap (m) to which differences of gaps are related: the clearance of the
/// built-in machine.
const CLEARANCE_M: f64 = 0.01;

/// Returns the greatest relative difference of two rows' amplitudes, gaps and ratios by turn.
fn greatest_error(a: &Outcome, b: &Outcome) -> f64 {
    let relative_difference = |a: f64, b: f64| if a == b { 0.0 } else { (a - b).abs() / b.abs() };
    let models = [(&a.nonlinear, &b.nonlinear), (&a.linear, &b.linear)];
    let amplitudes = models.iter().flat_map(|(a, b)| a.amplitudes.iter().zip(&b.amplitudes));
    let gap_pairs = models.iter().filter_map(|(a, b)| a.min_gap_m.zip(b.min_gap_m));
    let gap_errors = gap_pairs.map(|(a, b)| (a - b).abs() / b.abs().max(CLEARANCE_M));
    let turn_ratio_pairs = a.turn_ratios.iter().flatten().zip(b.turn_ratios.iter().flatten());
    amplitudes
        .map(|(a, b)| relative_difference(*a, *b))
        .chain(turn_ratio_pairs.map(|(a, b)| relative_difference(*a, *b)))
        .chain(gap_errors)
        .fold(0.0, f64::max)
}

/// Computes all rows by plain RK4 with a step (s).
fn rows_by_rk4(plan: &Plan, step_s: f64) -> Vec<Outcome> {
    outcomes_of_plan(&Plan { integrator: rk4(step_s), ..plan.clone() })
}

/// Computes the row of one point by plain RK4 with a step (s).
fn row_by_rk4(plan: &Plan, point: u64, step_s: f64) -> Outcome {
    let plan = Plan { integrator: rk4(step_s), ..plan.clone() };
    ModelEngine::new(&plan).unwrap().outcomes_at(&[plan.axis_values(point)]).remove(0)
}

/// Computes the rows of a plan by the fast method and compares them with plain RK4 at 2e-4 s.
fn compare_with_rk4(plan: &Plan, accuracy: f64) -> Vec<Outcome> {
    compare_with_rk4_at(2e-4, plan, accuracy)
}

/// Computes the rows of a plan by the fast method and compares them with plain RK4 at a step (s).
/// Every row that is marked as converged must have the same verdict and an error within 5 times the
/// accuracy, and few rows may exceed the accuracy itself. At most one row of eight that is not
/// chaotic may not have converged.
fn compare_with_rk4_at(step_s: f64, plan: &Plan, accuracy: f64) -> Vec<Outcome> {
    let fast_plan = Plan { integrator: rk4_mass_scaled(accuracy), ..plan.clone() };
    let rows = outcomes_of_plan(&fast_plan);
    let expected_rows = rows_by_rk4(plan, step_s);
    let mut inaccurate_row_count = 0;
    for (point, (row, expected)) in rows.iter().zip(&expected_rows).enumerate() {
        // The error may be that of RK4, where a violent motion amplifies its truncation error.
        let finer;
        let expected = if greatest_error(row, expected) > accuracy {
            finer = row_by_rk4(plan, point as u64, step_s / 8.0);
            &finer
        } else {
            expected
        };
        assert_eq!(row.nonlinear.status, expected.nonlinear.status, "{row:?}");
        if row.converged == Some(false) {
            continue;
        }
        assert_eq!(row.verdict.reliable, expected.verdict.reliable, "{}: {row:?}", plan.name);
        let row_error = greatest_error(row, expected);
        inaccurate_row_count += u64::from(row_error > accuracy);
        assert!(
            row_error <= 5.0 * accuracy,
            "{}: error {row_error:e} of {row:?} against {expected:?}",
            plan.name
        );
    }
    let is_skipped = |row: &&Outcome| row.converged == Some(false) && row.sensitive == Some(false);
    let skipped_count = rows.iter().filter(is_skipped).count();
    assert!(
        skipped_count <= rows.len() / 8,
        "{}: {skipped_count} rows are not compared",
        plan.name
    );
    // In the 1287 rows of Fig. 12 these are violent motions with an error of the least gap of up to
    // 4.4 times the accuracy.
    assert!(
        inaccurate_row_count <= plan.points() / 300,
        "{inaccurate_row_count} rows are beyond {accuracy:e}"
    );
    rows
}

#[test]
fn every_row_of_fig12_is_that_of_rk4_or_flagged() {
    let plan = load_plan(include_str!("../../../../../sweeps/fig12.toml"));
    assert_eq!(plan.points(), 39 * 33);
    let rows = compare_with_rk4(&plan, 1e-3);
    let unconverged_count = rows.iter().filter(|row| row.converged == Some(false)).count();
    assert!(unconverged_count < 13, "{unconverged_count} rows have not converged: more than 1 %");
    for level in [MethodKind::Capped1, MethodKind::Capped2, MethodKind::Rk4] {
        assert!(rows.iter().any(|row| row.method == level), "no row holds {level:?}");
    }
}

#[test]
fn a_single_channel_is_as_accurate_as_all() {
    // With all channels the ratio of the yaw reveals these rows' errors. With the tub's front alone
    // an early peak hides them. The ratios are those of an independent program.
    let points_and_ratios = [(0.7, 60.0, 2.0012), (1.0, 67.5, 2.2821), (0.9, 60.0, 1.976)];
    let plan = load_plan(
        "[spin]\nprofile = \"triangular\"\npeak_rpm = 350\nramp_s = 50\n[time]\nend_s = \
         50\nwindow_s = [30, 50]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.7, 1.0]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [60, 67.5]\n\
         [reliability]\nchannels = [\"tub_front_y\"]\n",
    );
    let engine = ModelEngine::new(&plan).unwrap();
    for (mass_kg, damping, ratio) in points_and_ratios {
        let row = &engine.outcomes_at(&[vec![mass_kg, damping]])[0];
        let found_ratio = row.verdict.greatest.unwrap().1;
        assert!(
            (found_ratio / ratio - 1.0).abs() < 1e-3,
            "{mass_kg} kg, {damping} N s/m: {found_ratio} for {ratio}"
        );
    }
}

#[test]
fn rows_agree_with_rk4_on_other_machines() {
    // These machines have other proportions and speeds, or bearings and hinges so soft that the
    // cap matters.
    let machines = [
        "unbalance_x_m = 0.36\nspring_stiffness_n_per_m = 11000\nspin_peak_rpm = 600",
        "bearing_stiffness_n_per_m = 2e6\nflexure_stiffness_n_m_per_rad = 15000",
        "bearing_stiffness_n_per_m = 3e5\ntub_mass_kg = 18",
        "flexure_stiffness_n_m_per_rad = 2500\nunbalance_radius_m = 0.25",
        "bearing_front_x_m = 0.09\nbearing_rear_x_m = -0.02\nspin_peak_rpm = 1100",
        "damper_1_damping_n_s_per_m = 60\nspring_2_stiffness_n_per_m = 6000\ndrum_mass_kg = 5",
    ];
    for (k, constants) in machines.into_iter().enumerate() {
        let damping_parameter = if constants.contains("damper_1") {
            "damper_2_damping_n_s_per_m"
        } else {
            "damping_n_s_per_m"
        };
        let plan = load_plan(&format!(
            "name = \"machine-{k}\"\n[set]\n{constants}\n[spin]\nprofile = \"ramp\"\npeak_rpm = \
             350\nramp_s = 12\n\
             [time]\nend_s = 14\nwindow_s = [4, 14]\n\
             [[axis]]\nparameter = \"unbalance_mass_kg\"\nrange = {{ from = 0.1, to = 1.2, count \
             = 6 }}\n\
             [[axis]]\nparameter = \"{damping_parameter}\"\nrange = {{ from = 40, to = 240, count \
             = 5 }}\n"
        ));
        for (accuracy, step_s) in [(1e-3, 2e-4), (1e-4, 1e-4)] {
            compare_with_rk4_at(step_s, &plan, accuracy);
        }
    }
}

#[test]
fn rows_agree_with_rk4_on_machines_with_friction_stops_and_gasket() {
    let machine = include_str!("../../../../../docs/examples/friction.toml");
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("machine.toml"), machine).unwrap();
    let stiff_stops = "stop_1_stiffness_n_per_m = 1e7\nstop_2_stiffness_n_per_m = 1e7\n";
    let constants_of_cases = ["", "friction_n = 90\nfriction_speed_m_per_s = 0.003\n", stiff_stops];
    for (k, set) in constants_of_cases.into_iter().enumerate() {
        let path = folder.path().join(format!("grid-{k}.toml"));
        let text = format!(
            "name = \"elements-{k}\"\nmachine = \"machine.toml\"\n[set]\n{set}\
             stop_1_clearance_m = 0.008\nstop_2_clearance_m = 0.008\n\
             [spin]\nprofile = \"ramp\"\npeak_rpm = 350\nramp_s = 12\n[time]\nend_s = \
             14\nwindow_s = [4, 14]\n\
             [[axis]]\nparameter = \"unbalance_mass_kg\"\nrange = {{ from = 0.1, to = 1.2, \
             count = 6 }}\n\
             [[axis]]\nparameter = \"damping_n_s_per_m\"\nrange = {{ from = 0, to = 100, count \
             = 3 }}\n"
        );
        std::fs::write(&path, text).unwrap();
        let plan = crate::config::load(&path, &[]).unwrap();
        // The rows' own step is 2e-4 s or shorter.
        let rows = compare_with_rk4_at(5e-5, &plan, 1e-3);
        let sensitive_count = rows.iter().filter(|row| row.sensitive == Some(true)).count();
        // A motion that bounces between stops of 1e7 N/m is chaotic: no step makes it converge.
        let max_sensitive_count =
            if set == stiff_stops { 2 * rows.len() / 3 } else { rows.len() / 6 };
        assert!(
            sensitive_count <= max_sensitive_count,
            "{set}: {sensitive_count} of {} rows",
            rows.len()
        );
        let engine = ModelEngine::new(&plan).unwrap();
        let note = engine.levels()[0].note.clone().unwrap();
        assert!(note.starts_with("no modes are capped, because friction and stops"), "{note}");
        let has_method = |level| rows.iter().any(|row| row.method == level);
        assert!(
            has_method(MethodKind::Additive) && has_method(MethodKind::Dop853Adaptive),
            "{set}"
        );
        assert!(rows.iter().all(|row| !row.method.is_capped()), "{set}");
    }
}

#[test]
fn rows_by_other_criteria_agree_with_rk4() {
    for criterion in ["envelope", "rms"] {
        let plan = load_plan(&format!(
            "name = \"{criterion}\"\nmetrics = \
             [\"cabinet_force\", \"static_sag\", \"clash_time\"]\n\
             [set]\nradial_clearance_m = 5e-4\n\
             [spin]\nprofile = \"ramp\"\npeak_rpm = 350\nramp_s = 12\n[time]\nend_s = \
             14\nwindow_s = [4, 14]\n\
             [[axis]]\nparameter = \"unbalance_mass_kg\"\nrange = {{ from = 0.1, to = 1.2, count \
             = 6 }}\n\
             [[axis]]\nparameter = \"damping_n_s_per_m\"\nrange = {{ from = 40, to = 240, count = \
             5 }}\n\
             [reliability]\ncriterion = \"{criterion}\"\n"
        ));
        let rows = compare_with_rk4(&plan, 1e-3);
        let mut peak_plan = plan.clone();
        peak_plan.model.measures = Default::default();
        let rows_by_peaks = compare_with_rk4(&peak_plan, 1e-3);
        let clashing_count = rows.iter().filter(|row| row.nonlinear.metrics[1] > 0.0).count();
        assert!(
            (1..rows.len()).contains(&clashing_count),
            "{clashing_count} of {} rows",
            rows.len()
        );
        for (row, row_by_peaks) in rows.iter().zip(&rows_by_peaks) {
            assert!(
                row.static_sag_m.is_some_and(|sag_m| (0.012..0.016).contains(&sag_m)),
                "{row:?}"
            );
            let [force_n, clash_s] = row.nonlinear.metrics[..] else { panic!("{row:?}") };
            assert!(force_n > 300.0 && (0.0..=10.0).contains(&clash_s), "{row:?}");
            assert!(clash_s == 0.0 || row.nonlinear.min_gap_m.unwrap() < 0.0, "{row:?}");
            if criterion == "rms" {
                let rms_and_peaks =
                    row.linear.amplitudes.iter().zip(&row_by_peaks.linear.amplitudes);
                assert!(
                    rms_and_peaks.into_iter().all(|(rms, peak)| 0.1 * peak < *rms && rms < peak),
                    "{row:?}"
                );
                continue;
            }
            // The ratio in the turn of the nonlinear model's peak is at least that of the peaks: in
            // this turn the linear amplitude is at most its own peak.
            let peak_ratios = &row_by_peaks.verdict.ratios;
            for (by_turn, by_peaks) in row.turn_ratios.iter().zip(peak_ratios) {
                assert!(by_turn.unwrap() > 0.99 * by_peaks.unwrap(), "{row:?}");
            }
        }
    }
}

#[test]
fn a_row_near_the_limit_is_refined() {
    let plan = load_plan(include_str!("../../../../../sweeps/fig12.toml"));
    let axis_values = [vec![0.4, 140.0]];
    let row = &ModelEngine::new(&plan).unwrap().outcomes_at(&axis_values)[0];
    assert_eq!(row.method, MethodKind::Capped1);
    let ratio = row.verdict.greatest.unwrap().1;
    let reliability =
        sweep_engine::Reliability { limits: ratio.into(), ..plan.reliability.clone() };
    let plan = Plan { reliability, ..plan };
    let row = &ModelEngine::new(&plan).unwrap().outcomes_at(&axis_values)[0];
    assert_eq!((row.method, row.sensitive), (MethodKind::Rk4, Some(false)));
    // This is the error of the uncapped level, which the capped level does not reach.
    assert!(row.error.unwrap() < 1e-5, "{row:?}");
}

#[test]
fn a_row_does_not_depend_on_the_rows_beside_it() {
    let plan = load_plan(include_str!("../../../../../sweeps/quick.toml"));
    let plan = Plan { integrator: rk4_mass_scaled(1e-3), ..plan };
    let engine = ModelEngine::new(&plan).unwrap();
    let values: Vec<_> = (0..plan.points()).map(|point| plan.axis_values(point)).collect();
    let all_outcomes = engine.outcomes_at(&values);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    assert_eq!(pool.install(|| engine.outcomes_at(&values)), all_outcomes, "on three threads");
    for point in [3, 40, 77] {
        let single_outcome = engine.outcomes_at(&values[point..=point]).remove(0);
        assert_eq!(Outcome { point: point as u64, ..single_outcome }, all_outcomes[point]);
    }
}

#[test]
fn a_search_for_the_verdict_alone_gives_the_rows_verdict() {
    let plan = load_plan(include_str!("../../../../../sweeps/quick.toml"));
    let plan = Plan { integrator: rk4_mass_scaled(1e-3), ..plan };
    let engine = ModelEngine::new(&plan).unwrap();
    let values: Vec<_> = (0..plan.points()).map(|point| plan.axis_values(point)).collect();
    let side_engine =
        ModelEngine { purpose: OutcomePurpose::Side, ..ModelEngine::new(&plan).unwrap() };
    let outcomes_for_side = side_engine.outcomes_at(&values);
    let rows = engine.outcomes_at(&values);
    let total_steps =
        |outcomes: &[Outcome]| outcomes.iter().map(|outcome| outcome.nonlinear.steps).sum::<u64>();
    assert!(total_steps(&outcomes_for_side) < total_steps(&rows));
    for (side, row) in outcomes_for_side.iter().zip(&rows) {
        assert_eq!(side.verdict.reliable, row.verdict.reliable, "{side:?}");
    }
}

#[test]
fn rows_of_a_drum_that_brakes_hard_follow_the_bearings() {
    for brake_s in [1.5e-3, 4e-3] {
        let plan = load_plan(&format!(
            "name = \"brake\"\nmetrics = [\"cabinet_force\"]\n[spin]\nprofile = \"table\"\n\
             time_s = [0, 1.5, {}, 4.3]\nspeed_rpm = [0, 556, 100, 200]\n\
             [time]\nend_s = 4.3\nwindow_s = [2.25, 3.6]\n\
             [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.05, 0.5, 1.0]\n\
             [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [110, 280]\n",
            1.5 + brake_s
        ));
        let fast_plan = Plan { integrator: rk4_mass_scaled(1e-3), ..plan };
        let fast_rows = outcomes_of_plan(&fast_plan);
        // This step times the frequency of the bearings' fastest mode is 0.12.
        let following_method = rk4(1.25e-5);
        let expected_rows = outcomes_of_plan(&Plan { integrator: following_method, ..fast_plan });
        for (row, expected) in fast_rows.iter().zip(&expected_rows) {
            assert_eq!((row.converged, row.sensitive), (Some(true), Some(false)), "{row:?}");
            let models = [(&row.nonlinear, &expected.nonlinear), (&row.linear, &expected.linear)];
            for (model, expected) in models {
                let force_n = model.metrics[0];
                let expected_n = expected.metrics[0];
                assert!((force_n / expected_n - 1.0).abs() < 1e-3, "{force_n} for {expected_n}");
            }
            assert!(greatest_error(row, expected) < 1e-3, "{row:?}");
        }
    }
}

/// With friction no ringing of the bearings counts as decayed. The additive method damps it, so
/// that its runs agree on a wrong result; these rows must be refined beyond it.
#[test]
fn rows_with_friction_and_ringing_bearings_converge() {
    let plan = load_with_elements(
        "[spin]\nprofile = \"table\"\ntime_s = [0, 0.3, 0.301, 0.6]\n\
         speed_rpm = [0, 1000, 1000, 0]\n[time]\nend_s = 0.6\nwindow_s = [0.599, 0.6]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.9]\n\
         [[axis]]\nparameter = \"friction_n\"\nvalues = [20, 70]\n[reliability]\n",
    );
    let rows = compare_with_rk4_at(1e-5, &plan, 1e-3);
    assert!(rows.iter().all(|row| row.converged == Some(true)), "{rows:?}");
}

/// When the drum begins to brake, the hinge of the linear model rings. Capped levels agree on
/// speeds of dampers that are wrong by up to 2e-3, at some of these peaks.
#[test]
fn speeds_of_dampers_are_accurate_where_the_hinge_rings() {
    for peak_rpm in (324..=350).step_by(2) {
        let plan = load_with_elements(&format!(
            "metrics = [\"damper_speed\"]\n\
             [spin]\nprofile = \"triangular\"\npeak_rpm = {peak_rpm}\nramp_s = 2.77\n\
             [time]\nend_s = 5\nwindow_s = [1.9, 5]\n\
             [set]\nfriction_n = 41.75\nflexure_stiffness_n_m_per_rad = 53321\n\
             tub_mass_kg = 15.1\nunbalance_mass_kg = 0.37\ndamping_n_s_per_m = 174\n\
             [reliability]\nratio_limit = 1.5\n\
             channels = [\"total_centre_y\", \"total_centre_z\", \"tub_pitch\"]\n",
        ));
        let row = outcomes_of_plan(&plan).remove(0);
        let expected = rows_by_rk4(&plan, 1e-4).remove(0);
        assert_eq!(row.converged, Some(true), "{peak_rpm} rpm");
        for (speed, expected_speed) in row.linear.metrics.iter().zip(&expected.linear.metrics) {
            let relative = (speed / expected_speed - 1.0).abs();
            assert!(
                relative < 1e-3,
                "{speed} and {expected_speed} m/s differ by {relative:e} at {peak_rpm} rpm"
            );
        }
    }
}

#[test]
fn motions_of_micrometres_agree_with_rk4() {
    let plan = load_plan(
        "name = \"tiny\"\n[spin]\nprofile = \"ramp\"\npeak_rpm = 350\nramp_s = 12\n\
         [time]\nend_s = 14\nwindow_s = [4, 14]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0, 1e-6, 3e-5, 1e-4]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [60, 120, 240]\n\
         [reliability]\nratio_limit = 1.001\n",
    );
    for accuracy in [1e-2, 1e-3] {
        let rows = compare_with_rk4_at(1e-4, &plan, accuracy);
        assert!(rows.iter().all(|row| row.converged == Some(true)));
    }
}

/// Loads a grid over a machine with every kind of element.
fn load_with_elements(text: &str) -> Plan {
    let machine = include_str!("../../../../../docs/examples/friction.toml");
    let unbalance = "[[further_unbalances]]\nmass_kg = 0.1\nx_m = 0.1\nradius_m = -0.2\n";
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("machine.toml"), format!("{machine}\n{unbalance}")).unwrap();
    let path = folder.path().join("grid.toml");
    std::fs::write(&path, format!("name = \"elements\"\nmachine = \"machine.toml\"\n{text}"))
        .unwrap();
    crate::config::load(&path, &[]).unwrap()
}

/// Neither a jump after the window nor one whose ringing has decayed before it sends a row to
/// levels that resolve the bearings' modes.
#[test]
fn a_drum_that_stands_in_its_window_needs_no_fine_steps() {
    // The drum stops at 20 s, 130 s before the window; and it starts 2 s after the window.
    let stopped_grid = "[spin]\nprofile = \"triangular\"\npeak_rpm = 350.0\nramp_s = 10.0\n\
                   [time]\nend_s = 200.0\nwindow_s = [150.0, 200.0]\n";
    let waiting_grid = "[spin]\nprofile = \"table\"\ntime_s = [0.0, 10.0, 20.0]\n\
                   speed_rpm = [0.0, 0.0, 300.0]\n\
                   [time]\nend_s = 20.0\nwindow_s = [0.0, 8.0]\n";
    for (grid, verdict) in [(stopped_grid, Some(true)), (waiting_grid, None)] {
        let plan = load_plan(grid);
        let row = outcomes_of_plan(&plan).remove(0);
        assert!(row.method.is_capped(), "{:?} in {grid}", row.method);
        assert_eq!((row.converged, row.verdict.reliable), (Some(true), verdict), "{grid}");
    }
}

//! The fast method's promises, held against plain RK4: on the paper's map, with the channels and
//! windows that once hid errors, and on other machines. `examples/differential_test.rs` looks for
//! exceptions at random.

use rayon::prelude::*;
use washer_row::{Level, Verdict};

use super::super::*;
use crate::method::Integrator;

fn load(text: &str) -> Plan {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.toml");
    std::fs::write(&path, text).unwrap();
    crate::config::load(&path, &[]).unwrap()
}

fn rows(plan: &Plan) -> Vec<Outcome> {
    let engine = ModelEngine::new(plan).unwrap();
    let values: Vec<_> = (0..plan.points()).map(|point| plan.axis_values(point)).collect();
    values.par_chunks(256).map(|values| engine.evaluate_at(values)).collect::<Vec<_>>().concat()
}

fn reliable(plan: &Plan, outcome: &Outcome) -> Option<bool> {
    let rule = &plan.reliability;
    Verdict::new(outcome, rule.channels.len(), rule.limits).reliable
}

/// Shares of the gap are of this (m), the built-in machine's.
const CLEARANCE_M: f64 = 0.01;

/// The greatest relative difference of two rows' amplitudes, gaps and ratios by turn.
fn error(a: &Outcome, b: &Outcome) -> f64 {
    let relative = |a: f64, b: f64| if a == b { 0.0 } else { (a - b).abs() / b.abs() };
    let models = [(&a.nonlinear, &b.nonlinear), (&a.linear, &b.linear)];
    let amplitudes = models.iter().flat_map(|(a, b)| a.amplitudes.iter().zip(&b.amplitudes));
    let gaps = models.iter().filter_map(|(a, b)| a.min_gap_m.zip(b.min_gap_m));
    let gaps = gaps.map(|(a, b)| (a - b).abs() / b.abs().max(CLEARANCE_M));
    let turns = a.turn_ratios.iter().flatten().zip(b.turn_ratios.iter().flatten());
    amplitudes
        .map(|(a, b)| relative(*a, *b))
        .chain(turns.map(|(a, b)| relative(*a, *b)))
        .chain(gaps)
        .fold(0.0, f64::max)
}

/// Plain RK4 at a step (s).
fn by_rk4(plan: &Plan, step_s: f64) -> Vec<Outcome> {
    rows(&Plan { integrator: Integrator::Rk4 { step_s }, ..plan.clone() })
}

/// Runs a plan by the fast method and by plain RK4 at 2e-4 s. Verdicts are the same, and amplitudes
/// of every row that is not flagged within the accuracy; few rows are flagged, and only such where
/// RK4 at another step differs.
fn hold_against_rk4(plan: &Plan, accuracy: f64) -> Vec<Outcome> {
    hold_against_rk4_at(2e-4, plan, accuracy)
}

/// As [`hold_against_rk4`], at a step (s) of RK4.
fn hold_against_rk4_at(step_s: f64, plan: &Plan, accuracy: f64) -> Vec<Outcome> {
    let fast = Plan { integrator: Integrator::Rk4MassScaled { accuracy }, ..plan.clone() };
    let at = |step_s: f64| by_rk4(plan, step_s);
    let (rows, expected) = (rows(&fast), at(step_s));
    for (row, expected) in rows.iter().zip(&expected) {
        assert_eq!(row.nonlinear.status, expected.nonlinear.status, "{row:?}");
        if row.converged == Some(false) {
            continue;
        }
        assert_eq!(reliable(plan, row), reliable(plan, expected), "{}: {row:?}", plan.name);
        let error = error(row, expected);
        assert!(
            error <= accuracy,
            "{}: error {error:e} of {row:?} against {expected:?}",
            plan.name
        );
    }
    rows
}

#[test]
fn every_row_of_fig12_is_that_of_rk4_or_flagged() {
    let plan = load(include_str!("../../../../../sweeps/fig12.toml"));
    assert_eq!(plan.points(), 39 * 33);
    let rows = hold_against_rk4(&plan, 1e-3);
    let left = rows.iter().filter(|row| row.converged == Some(false)).count();
    assert!(left < 13, "{left} rows are in doubt: more than 1 %");
    for level in [Level::Fast, Level::Fine, Level::Finest, Level::Rk4] {
        assert!(rows.iter().any(|row| row.method == level), "no row holds {level:?}");
    }
}

#[test]
fn one_channel_alone_hides_nothing() {
    // With all channels the yaw's ratio shows what these rows do; with the tub's front alone an
    // early peak hides it.
    let points = [(0.7, 60.0, 2.0012), (1.0, 67.5, 2.2821), (0.9, 60.0, 1.976)];
    let plan = load(
        "[spin]\nprofile = \"triangular\"\npeak_rpm = 350\nramp_s = 50\n[time]\nend_s = \
         50\nwindow_s = [30, 50]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.7, 1.0]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [60, 67.5]\n\
         [reliability]\nchannels = [\"tub_front_y\"]\n",
    );
    let engine = ModelEngine::new(&plan).unwrap();
    for (mass_kg, damping, ratio) in points {
        let row = &engine.evaluate_at(&[vec![mass_kg, damping]])[0];
        let found = Verdict::new(row, 1, 2.0).greatest.unwrap().1;
        // By an independent program.
        assert!(
            (found / ratio - 1.0).abs() < 1e-3,
            "{mass_kg} kg, {damping} N s/m: {found} for {ratio}"
        );
    }
}

#[test]
fn rows_are_rk4s_on_other_machines() {
    // Other proportions, speeds, and bearings and hinges soft enough for the cap to matter.
    let machines = [
        "unbalance_x_m = 0.36\nspring_stiffness_n_per_m = 11000\nspin_peak_rpm = 600",
        "bearing_stiffness_n_per_m = 2e6\nflexure_stiffness_n_m_per_rad = 15000",
        "bearing_stiffness_n_per_m = 3e5\ntub_mass_kg = 18",
        "flexure_stiffness_n_m_per_rad = 2500\nunbalance_radius_m = 0.25",
        "bearing_front_x_m = 0.09\nbearing_rear_x_m = -0.02\nspin_peak_rpm = 1100",
        "damper_1_damping_n_s_per_m = 60\nspring_2_stiffness_n_per_m = 6000\ndrum_mass_kg = 5",
    ];
    for (k, set) in machines.into_iter().enumerate() {
        let axis = if set.contains("damper_1") {
            "damper_2_damping_n_s_per_m"
        } else {
            "damping_n_s_per_m"
        };
        let plan = load(&format!(
            "name = \"machine-{k}\"\n[set]\n{set}\n[spin]\nprofile = \"ramp\"\npeak_rpm = \
             350\nramp_s = 12\n\
             [time]\nend_s = 14\nwindow_s = [4, 14]\n\
             [[axis]]\nparameter = \"unbalance_mass_kg\"\nrange = {{ from = 0.1, to = 1.2, count \
             = 6 }}\n\
             [[axis]]\nparameter = \"{axis}\"\nrange = {{ from = 40, to = 240, count = 5 }}\n"
        ));
        // At 2e-4 s the least gap of the most violent of these motions errs by 1.2e-5 itself.
        for (accuracy, step_s) in [(1e-3, 2e-4), (1e-5, 1e-4)] {
            hold_against_rk4_at(step_s, &plan, accuracy);
        }
    }
}

#[test]
fn rows_are_rk4s_on_machines_with_friction_stops_and_gasket() {
    let machine = include_str!("../../../../../docs/examples/friction.toml");
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("machine.toml"), machine).unwrap();
    let stiff = "stop_1_stiffness_n_per_m = 1e7\nstop_2_stiffness_n_per_m = 1e7\n";
    let sets = ["", "friction_n = 90\nfriction_speed_m_per_s = 0.003\n", stiff];
    for (k, set) in sets.into_iter().enumerate() {
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
        // Their own step is 2e-4 s or shorter.
        let rows = hold_against_rk4_at(5e-5, &plan, 1e-3);
        let sensitive = rows.iter().filter(|row| row.sensitive == Some(true)).count();
        // Whatever bounces between stops of 1e7 N/m is chaotic: no step settles it.
        let most = if set == stiff { 2 * rows.len() / 3 } else { rows.len() / 6 };
        assert!(sensitive <= most, "{set}: {sensitive} of {} rows", rows.len());
        let engine = ModelEngine::new(&plan).unwrap();
        let why = engine.ladders()[0].held_back.clone().unwrap();
        assert!(why.starts_with("no modes are capped, because friction and stops"), "{why}");
        let is_by = |level| rows.iter().any(|row| row.method == level);
        assert!(is_by(Level::Additive) && is_by(Level::Dop853), "{set}");
        assert!(rows.iter().all(|row| !row.method.is_capped()), "{set}");
    }
}

#[test]
fn a_hinge_that_a_harmonic_leaves_ringing_is_for_rk4() {
    // Found at random. The fourth multiple of the first drum's speed passes a whirl of the hinge,
    // the fifth of the second's; runs with caps then differed by less than they erred.
    let first = "shaft_mass_kg = 3.86\nunbalance_x_m = 0.2916\nbearing_front_x_m = 0.0314\n\
                 spring_stiffness_n_per_m = 7609\ntub_inertia_22_kg_m2 = 1.662\n[spin]\n\
                 peak_rpm = 1122.16\nramp_s = 16.38\nprofile = \"cycloidal\"\n[time]\n\
                 end_s = 17.7\nwindow_s = [14.43, 17.63]\n[[axis]]\n\
                 parameter = \"unbalance_mass_kg\"\nvalues = [0.684]\n";
    // To the digit: with others, a rung's difference is just too great to be believed.
    let second = "flexure_stiffness_n_m_per_rad = 31178.002401051155\n\
                  drum_mass_kg = 5.589787339275833\ntub_centre_x_m = 0.20277924386626595\n\
                  spring_1_stiffness_n_per_m = 6192.090134011787\n\
                  damper_1_cabinet_z_m = 0.176478840730275\n\
                  tub_inertia_22_kg_m2 = 1.934925471454601\n\
                  bearing_stiffness_n_per_m = 19499717.491631024\n[spin]\n\
                  peak_rpm = 714.8832846878588\nramp_s = 12.423426686268481\n\
                  profile = \"cycloidal\"\n[time]\nend_s = 13.035487480823836\n\
                  window_s = [10.199688419753814, 11.11666621077582]\n[[axis]]\n\
                  parameter = \"unbalance_mass_kg\"\n\
                  values = [0.03333381472758287, 0.3724337796742048, 1.118547191224822]\n";
    for (set, accuracy) in [(first, 1e-3), (second, 1e-4)] {
        let plan = load(&format!(
            "name = \"ringing\"\n[set]\n{set}[[axis]]\nparameter = \"damping_n_s_per_m\"\n\
             values = [52.13919840031138, 113.17681329184855, 291.07849509336336]\n\
             [reliability]\nchannels = [\"drum_front_y\", \"drum_front_z\"]\n"
        ));
        hold_against_rk4(&plan, accuracy);
        let why = |accuracy: f64| {
            let integrator = Integrator::Rk4MassScaled { accuracy };
            let plan = Plan { integrator, ..plan.clone() };
            ModelEngine::new(&plan).unwrap().ladders()[0].held_back.clone()
        };
        let told = why(accuracy).unwrap();
        assert!(told.starts_with("rk4 alone, because the hinge"), "{told}");
        // It does not matter to a hundredth.
        assert_eq!(why(1e-2), None);
    }
}

#[test]
fn the_linear_model_is_for_rk4_where_its_hinge_is_slow() {
    // Found at random: a run-up in 2.8 s, and a capped hinge that moves a turn's peak by 1.25e-3.
    let plan = load(
        "name = \"run-up\"\n[set]\nspring_stiffness_n_per_m = 4625.321549577943\n\
         tub_mass_kg = 39.96408261772628\nshaft_mass_kg = 6.259861412717385\n\
         unbalance_x_m = 0.2545037019090662\ndamper_1_cabinet_z_m = 0.19022007053402973\n\
         tub_inertia_22_kg_m2 = 1.2021965764225742\n[spin]\nprofile = \"cycloidal\"\n\
         ramp_s = 2.7838091211795457\npeak_rpm = 1081.499224922469\n[time]\n\
         end_s = 4.765039823226733\nwindow_s = [3.7933294868202796, 3.920869017693415]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\n\
         values = [0.0430144754540303, 0.5358586558816326, 1.3335690312893769]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\n\
         values = [60.95214729616112, 113.45113365139412, 262.2739377736158]\n\
         [reliability]\ncriterion = \"envelope\"\n\
         channels = [\"drum_front_y\", \"total_centre_y\", \"tub_yaw\"]\n",
    );
    hold_against_rk4(&plan, 1e-3);
}

#[test]
fn rows_by_other_criteria_are_rk4s() {
    for criterion in ["envelope", "rms"] {
        let plan = load(&format!(
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
        let rows = hold_against_rk4(&plan, 1e-3);
        let mut by_peaks = plan.clone();
        by_peaks.model.measures = Default::default();
        let peaks = hold_against_rk4(&by_peaks, 1e-3);
        let clashing = rows.iter().filter(|row| row.nonlinear.metrics[1] > 0.0).count();
        assert!((1..rows.len()).contains(&clashing), "{clashing} of {} rows", rows.len());
        for (row, peak) in rows.iter().zip(&peaks) {
            assert!(
                row.nonlinear.turns.is_empty() && row.linear.turns.is_empty(),
                "nothing is held for long"
            );
            assert!(
                row.static_sag_m.is_some_and(|sag_m| (0.012..0.016).contains(&sag_m)),
                "{row:?}"
            );
            let [force_n, clash_s] = row.nonlinear.metrics[..] else { panic!("{row:?}") };
            assert!(force_n > 300.0 && (0.0..=10.0).contains(&clash_s), "{row:?}");
            assert!(clash_s == 0.0 || row.nonlinear.min_gap_m.unwrap() < 0.0, "{row:?}");
            if criterion == "rms" {
                let smaller = row.linear.amplitudes.iter().zip(&peak.linear.amplitudes);
                assert!(
                    smaller.into_iter().all(|(rms, peak)| 0.1 * peak < *rms && rms < peak),
                    "{row:?}"
                );
                continue;
            }
            // In the turn in which the nonlinear motion is greatest the linear one is at most as
            // great as it ever is.
            let of_peaks = Verdict::new(peak, 6, 2.0).ratios;
            for (by_turn, of_peaks) in row.turn_ratios.iter().zip(of_peaks) {
                assert!(by_turn.unwrap() > 0.99 * of_peaks.unwrap(), "{row:?}");
            }
        }
    }
}

#[test]
fn where_the_verdict_is_in_doubt_rk4_is_held_against_rk4() {
    let plan = load(include_str!("../../../../../sweeps/fig12.toml"));
    let at = [vec![0.4, 140.0]];
    let row = &ModelEngine::new(&plan).unwrap().evaluate_at(&at)[0];
    assert_eq!(row.method, Level::Fast);
    let ratio = Verdict::new(row, plan.reliability.channels.len(), 2.0).greatest.unwrap().1;
    let reliability =
        sweep_engine::Reliability { limits: ratio.into(), ..plan.reliability.clone() };
    let plan = Plan { reliability, ..plan };
    let row = &ModelEngine::new(&plan).unwrap().evaluate_at(&at)[0];
    assert_eq!((row.method, row.sensitive), (Level::Rk4, Some(false)));
    // What RK4 has left, not what the capped rung had.
    assert!(row.error.unwrap() < 1e-5, "{row:?}");
}

#[test]
fn a_row_does_not_depend_on_its_company() {
    let plan = load(include_str!("../../../../../sweeps/quick.toml"));
    let plan = Plan { integrator: Integrator::Rk4MassScaled { accuracy: 1e-3 }, ..plan };
    let engine = ModelEngine::new(&plan).unwrap();
    let values: Vec<_> = (0..plan.points()).map(|point| plan.axis_values(point)).collect();
    let together = engine.evaluate_at(&values);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    assert_eq!(pool.install(|| engine.evaluate_at(&values)), together, "on three threads");
    for point in [3, 40, 77] {
        let alone = engine.evaluate_at(&values[point..=point]).remove(0);
        assert_eq!(Outcome { point: point as u64, ..alone }, together[point]);
    }
}

#[test]
fn a_side_is_that_of_the_row() {
    let plan = load(include_str!("../../../../../sweeps/quick.toml"));
    let plan = Plan { integrator: Integrator::Rk4MassScaled { accuracy: 1e-3 }, ..plan };
    let engine = ModelEngine::new(&plan).unwrap();
    let values: Vec<_> = (0..plan.points()).map(|point| plan.axis_values(point)).collect();
    let of_sides = ModelEngine { demand: Demand::Side, ..ModelEngine::new(&plan).unwrap() };
    let sides = of_sides.evaluate_at(&values);
    let rows = engine.evaluate_at(&values);
    let steps =
        |outcomes: &[Outcome]| outcomes.iter().map(|outcome| outcome.nonlinear.steps).sum::<u64>();
    assert!(steps(&sides) < steps(&rows));
    for (side, row) in sides.iter().zip(&rows) {
        assert_eq!(reliable(&plan, side), reliable(&plan, row), "{side:?}");
    }
}

#[test]
fn rows_of_a_drum_that_brakes_hard_follow_the_bearings() {
    for brake_s in [1.5e-3, 4e-3] {
        let plan = load(&format!(
            "name = \"brake\"\nmetrics = [\"cabinet_force\"]\n[spin]\nprofile = \"table\"\n\
             time_s = [0, 1.5, {}, 4.3]\nspeed_rpm = [0, 556, 100, 200]\n\
             [time]\nend_s = 4.3\nwindow_s = [2.25, 3.6]\n\
             [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.05, 0.5, 1.0]\n\
             [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [110, 280]\n",
            1.5 + brake_s
        ));
        let fast = Plan { integrator: Integrator::Rk4MassScaled { accuracy: 1e-3 }, ..plan };
        let found = rows(&fast);
        // The bearings' fastest mode times this is 0.12.
        let following = Integrator::Rk4 { step_s: 1.25e-5 };
        let expected = rows(&Plan { integrator: following, ..fast });
        for (row, expected) in found.iter().zip(&expected) {
            assert_eq!((row.converged, row.sensitive), (Some(true), Some(false)), "{row:?}");
            let models = [(&row.nonlinear, &expected.nonlinear), (&row.linear, &expected.linear)];
            for (model, expected) in models {
                let (force_n, expected_n) = (model.metrics[0], expected.metrics[0]);
                assert!((force_n / expected_n - 1.0).abs() < 1e-3, "{force_n} for {expected_n}");
            }
            assert!(error(row, expected) < 1e-3, "{row:?}");
        }
    }
}

/// A violent motion amplifies what caps and RK4's longer step both leave of the ringing: they
/// differed by 8e-4 and were off by 1.7e-3.
#[test]
fn what_rings_is_amplified_behind_a_brake() {
    let plan = load(
        "name = \"ringing\"\n[set]\nshaft_mass_kg = 3.406326684829569\n\
         unbalance_x_m = 0.23469487999594235\n\
         unbalance_radius_m = 0.2609159187955395\nspring_1_stiffness_n_per_m = 5194.192586995209\n\
         damper_1_cabinet_z_m = 0.24032825169408803\ntub_inertia_22_kg_m2 = 1.476623801580004\n\
         damping_n_s_per_m = 81.54147037035253\n[spin]\nprofile = \"table\"\n\
         time_s = [0, 3.2540941726803574, 3.307508043550657, 5.572530039804953]\n\
         speed_rpm = [0, 500.17488602488885, 198.65863634768985, 235.96275542558917]\n\
         [time]\nend_s = 5.572530039804953\nwindow_s = [4.624442267632961, 5.44019855740512]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\n\
         values = [0.5368875594601593, 1.566117042524969]\n\
         [reliability]\n\
         channels = [\"tub_front_y\", \"tub_front_z\", \"drum_front_y\", \"tub_pitch\"]\n",
    );
    let rows = hold_against_rk4_at(1.25e-5, &plan, 1e-3);
    assert!(rows.iter().all(|row| row.converged == Some(true)), "{rows:?}");
}

/// With bearings so soft that the step which follows them is nearly half the reference's, these two
/// steps agreed on an error of 1.1e-3.
#[test]
fn steps_that_are_compared_differ() {
    let plan = load(
        "name = \"soft\"\n[set]\ndrum_mass_kg = 3.0672895035166636\n\
         spring_1_stiffness_n_per_m = 5440.2046368061165\n\
         bearing_stiffness_n_per_m = 12206019.3111594\n\
         [spin]\nprofile = \"table\"\n\
         time_s = [0, 2.2121765039996992, 2.2125259115142906, 5.058084938276249]\n\
         speed_rpm = [0, 380.4275827972234, 123.62981908158707, 289.3513868666495]\n\
         [time]\nend_s = 5.058084938276249\nwindow_s = [3.3452510873473074, 4.220096392621979]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [1.3, 1.441730770097038]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [47.06558943728102, 84.8]\n\
         [reliability]\ncriterion = \"envelope\"\nratio_limit = 1.2\n\
         channels = [\"tub_front_z\", \"tub_pitch\"]\n",
    );
    let rows = hold_against_rk4_at(1.25e-5, &plan, 1e-3);
    assert!(rows.iter().all(|row| row.converged == Some(true)), "{rows:?}");
}

/// Behind the window this motion is violent, and a hinge capped at 2.4 times the drum's speed bends
/// so far that the least gap was off by 1.5 % of the clearance.
#[test]
fn the_least_gap_is_rk4s() {
    let plan = load(
        "name = \"gap\"\n[set]\ndrum_mass_kg = 5.406491404715016\n\
         unbalance_x_m = 0.22410493288716418\ntub_centre_x_m = 0.2039027527351977\n\
         spring_1_stiffness_n_per_m = 12263.916592800042\n\
         damper_1_cabinet_z_m = 0.21287088178113664\n\
         [spin]\nprofile = \"cycloidal\"\nramp_s = 9.585938081440052\n\
         peak_rpm = 344.91885174263746\n\
         [time]\nend_s = 8.20487821389264\nwindow_s = [4.817892319576785, 5.515425223753077]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.388, 1.4404433669845518]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\n\
         values = [78.95674007915304, 198.0136871717317]\n\
         [reliability]\nchannels = [\"tub_yaw\", \"tub_pitch\"]\n",
    );
    let rows = hold_against_rk4(&plan, 1e-2);
    assert!(rows.iter().any(|row| row.method == Level::Fast), "{rows:?}");
}

/// Hinge and bearings ring after the jump at the start, by more than the accuracy. With 300 N s/m
/// too little of it is left where the gap is least and where amplitudes are taken.
#[test]
fn ringing_that_has_decayed_is_no_reason_for_rk4() {
    let plan = load(
        "name = \"decayed\"\n[spin]\nprofile = \"triangular\"\npeak_rpm = 350\nramp_s = 30\n\
         [time]\nend_s = 30\nwindow_s = [18, 30]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.4]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [80, 300]\n\
         [reliability]\n",
    );
    let rows = hold_against_rk4_at(1.25e-5, &plan, 1e-5);
    let is_capped = rows.iter().map(|row| row.method != Level::Rk4);
    assert_eq!(is_capped.collect::<Vec<_>>(), [false, true, true, true], "{rows:?}");
}

/// With friction nothing that rings counts as decayed, and the additive method damps it: however
/// alike its runs were, these rows did not converge.
#[test]
fn bearings_that_ring_with_friction_are_followed() {
    let plan = load_with_elements(
        "[spin]\nprofile = \"table\"\ntime_s = [0, 0.3, 0.301, 0.6]\n\
         speed_rpm = [0, 1000, 1000, 0]\n[time]\nend_s = 0.6\nwindow_s = [0.599, 0.6]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.9]\n\
         [[axis]]\nparameter = \"friction_n\"\nvalues = [20, 70]\n[reliability]\n",
    );
    let rows = hold_against_rk4_at(1e-5, &plan, 1e-3);
    assert!(rows.iter().all(|row| row.converged == Some(true)), "{rows:?}");
}

#[test]
fn motions_of_micrometres_are_rk4s() {
    let plan = load(
        "name = \"tiny\"\n[spin]\nprofile = \"ramp\"\npeak_rpm = 350\nramp_s = 12\n\
         [time]\nend_s = 14\nwindow_s = [4, 14]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0, 1e-6, 3e-5, 1e-4]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [60, 120, 240]\n\
         [reliability]\nratio_limit = 1.001\n",
    );
    for accuracy in [1e-2, 1e-3] {
        let rows = hold_against_rk4_at(1e-4, &plan, accuracy);
        assert!(rows.iter().all(|row| row.converged == Some(true)));
    }
}

#[test]
fn what_a_shorter_step_settles_is_not_chaos() {
    // The motion passes bands that amplify errors by 1e9; RK4 at 2e-4 s and at 1.25 times that
    // differ by up to half of it.
    let plan = load(
        "name = \"bands\"\n[spin]\nprofile = \"triangular\"\npeak_rpm = 350\nramp_s = 50\n\
         [time]\nend_s = 50\nwindow_s = [30, 50]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.788888888888889, 0.98]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [51, 68, 82, 100]\n\
         [reliability]\nchannels = [\"tub_front_y\"]\n",
    );
    let rows = hold_against_rk4_at(5e-5, &plan, 1e-3);
    let told: Vec<_> = rows.iter().map(|row| (row.converged, row.sensitive)).collect();
    assert!(told.iter().all(|told| *told == (Some(true), Some(false))), "{told:?}");
    assert!(rows.iter().any(|row| row.method == Level::Rk4));
}

#[test]
fn a_course_in_common_is_enough_for_the_reference() {
    // Bearings swing in another phase at 2.5e-4 and at 2e-4 s, amplitudes differ by 6e-5.
    let plan = load(
        "name = \"phases\"\n[spin]\nprofile = \"triangular\"\npeak_rpm = 350\nramp_s = 50\n\
         [time]\nend_s = 50\nwindow_s = [30, 50]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.925]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [67.5]\n\
         [reliability]\n",
    );
    let [row, halved] = [rows(&plan), by_rk4(&plan, 1e-4)].map(|mut rows| rows.remove(0));
    let reference_steps = (plan.end_s / 2e-4).ceil() as u64;
    assert!(row.nonlinear.steps.abs_diff(reference_steps) < 300, "{row:?}");
    assert!(error(&row, &halved) < row.error.unwrap(), "{row:?}");
}

#[test]
fn what_caps_move_more_than_the_motion_keeps_their_share_of_the_error() {
    // Drum and tub only just touch; by rungs of which the motion's error is a two hundredth of
    // their difference, the linear model's clash is off by 2.1 ms of a window of 7.7 s.
    let plan = load(
        "name = \"touch\"\nmetrics = [\"clash_time\"]\n\
         [set]\nradial_clearance_m = 6.4893e-5\nspring_stiffness_n_per_m = 10938.614853334686\n\
         flexure_stiffness_n_m_per_rad = 40277.11852226668\n\
         bearing_front_x_m = 0.04738533810203463\ndamper_1_cabinet_z_m = 0.2610664791957081\n\
         bearing_stiffness_n_per_m = 35829783.1735218\n\
         [spin]\nprofile = \"cycloidal\"\nramp_s = 9.835266586180735\n\
         peak_rpm = 329.8003582651781\n\
         [time]\nend_s = 17.95778480216649\nwindow_s = [8.14524348199697, 15.840870507074882]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.07024286604888448]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [318.649120794626]\n\
         [reliability]\nchannels = [\"total_centre_y\"]\n",
    );
    let clashes_s = [rows(&plan), by_rk4(&plan, 5e-5)].map(|rows| rows[0].linear.metrics[0]);
    assert!((clashes_s[0] - clashes_s[1]).abs() < 1e-5, "{clashes_s:?}");
}

/// A grid over the machine that has every element.
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

/// Of the linear model's, two rungs differ by 2.2e-4, and the second is off by half of that; in the
/// other row by 7.9e-4, and it is off by 1.86 times as much.
#[test]
fn of_a_dampers_speed_more_than_the_difference_is_left() {
    let half = "metrics = [\"damper_speed\"]\n\
         [set]\ndamper_2_friction_n = 32.29446664041393\n\
         friction_speed_m_per_s = 0.03249944710961427\n\
         spring_4_cubic_n_per_m3 = 1640884.1976942278\n\
         stop_1_clearance_m = 0.006173321835234946\nstop_3_clearance_m = 0.013218648981935102\n\
         stop_1_stiffness_n_per_m = 95482.1329099734\n\
         stop_3_stiffness_n_per_m = 101496.47865015626\n\
         bushing_1_cubic_y_n_per_m3 = 2291651.0285562826\n\
         spring_stiffness_n_per_m = 5477.318373401297\nshaft_mass_kg = 2.6515823944258283\n\
         drum_mass_kg = 3.0731212663597787\nunbalance_x_m = 0.22127676639310473\n\
         unbalance_radius_m = 0.1441217134439857\ntub_centre_x_m = 0.1910751828617434\n\
         damper_1_cabinet_z_m = 0.39034163235573593\n\
         [spin]\nprofile = \"table\"\n\
         time_s = [0, 7.31215345049732, 13.78462741960416, 18.372869342485455]\n\
         speed_rpm = [0, 90.65759425028169, 90.65759425028169, 139.1504025769288]\n\
         [time]\nend_s = 18.372869342485455\nwindow_s = [4.980165110205926, 12.602212127704373]\n\
         [integrator]\nmethod = \"rk4-mass-scaled\"\naccuracy = 1e-4\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [1.007945314835644]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [132.22392082946095]\n\
         [reliability]\ncriterion = \"rms\"\nchannels = [\"total_centre_z\"]\n";
    let nearly_twice = "metrics = [\"damper_speed\"]\n\
         [set]\nspring_1_cubic_n_per_m3 = 761236.6961790422\n\
         spring_4_cubic_n_per_m3 = 1269052.6849561897\n\
         stop_1_clearance_m = 0.0050930628589481355\n\
         stop_2_stiffness_n_per_m = 2496985.326360089\n\
         stop_1_softness_m = 0.00034565357777105254\n\
         bushing_1_cubic_y_n_per_m3 = 5796759.021365514\n\
         unbalance_radius_m = 0.20999100142402988\ntub_centre_x_m = 0.26640406991411214\n\
         damper_1_cabinet_z_m = 0.300577294192135\n\
         [spin]\nprofile = \"table\"\n\
         time_s = [0, 4.039853327908258, 9.381373245737775, 17.267588707615996]\n\
         speed_rpm = [0, 130.42168451549546, 130.42168451549546, 284.2446424548779]\n\
         [time]\nend_s = 17.267588707615996\nwindow_s = [3.645898737771381, 13.717877349095932]\n\
         [integrator]\nmethod = \"rk4-mass-scaled\"\naccuracy = 1e-3\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\n\
         values = [0.03174037651771169, 0.6507894861672803]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\n\
         values = [87.72674725914545, 323.1708202303464]\n\
         [reliability]\nratio_limit = 3\nchannels = [\"total_centre_y\"]\n";
    for (text, accuracy) in [(half, 1e-4), (nearly_twice, 1e-3)] {
        let plan = load_with_elements(text);
        for (fast, plain) in rows(&plan).iter().zip(&by_rk4(&plan, 1e-4)) {
            for (fast, plain) in fast.linear.metrics.iter().zip(&plain.linear.metrics) {
                let least = plain.max(washer_row::CREEPING_M_PER_S);
                assert!((fast - plain).abs() < accuracy * least, "{fast} m/s, by RK4 {plain}");
            }
        }
    }
}

/// Of the linear model's time of contact with a stop, 2 % of the window, two capped rungs differ by
/// less than 1 %, and the second is off by 1.4 %.
#[test]
fn a_short_contact_is_not_settled_by_the_share_of_the_motion() {
    let plan = load_with_elements(
        "metrics = [\"stop_contact\"]\n\
         [set]\nfriction_speed_m_per_s = 0.03341763888962692\n\
         spring_4_cubic_n_per_m3 = 220381.33244462984\n\
         stop_1_clearance_m = 0.0033074743600852987\nstop_2_clearance_m = 0.019545476565143164\n\
         stop_3_stiffness_n_per_m = 41744.86723844327\ntub_mass_kg = 28.052039513717226\n\
         shaft_mass_kg = 7.156181434864196\ndrum_mass_kg = 2.6632391982345003\n\
         unbalance_radius_m = 0.2242747867394754\nbearing_front_x_m = 0.07784436246215565\n\
         [spin]\nprofile = \"ramp\"\nramp_s = 5.180193922242635\npeak_rpm = 380.13268075885605\n\
         [time]\nend_s = 15.554757960646327\nwindow_s = [7.88826645705481, 8.898097869123456]\n\
         [integrator]\nmethod = \"rk4-mass-scaled\"\naccuracy = 1e-2\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\n\
         values = [0.0688195105951556, 1.3592322133333739]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\n\
         values = [81.76416277638512, 221.86212589825885]\n\
         [reliability]\ncriterion = \"rms\"\nratio_limit = 5\n\
         channels = [\"drum_front_z\", \"total_centre_y\", \"tub_yaw\"]\n",
    );
    let floor_s = 1e-2 * (plan.window_s[1] - plan.window_s[0]);
    for (fast, plain) in rows(&plan).iter().zip(&by_rk4(&plan, 1e-4)) {
        for (fast, plain) in fast.linear.metrics.iter().zip(&plain.linear.metrics) {
            let off = (fast - plain).abs() / plain.max(floor_s);
            assert!(off < 1e-2, "{fast} s, by RK4 {plain}");
        }
    }
}

/// A motion by half a radian, of which a stop's push is off by 3.6e-3 while the last two rungs and
/// the twin agree to 3.3e-4; the rungs before differ by a third.
#[test]
fn runs_that_meet_by_chance_have_not_converged() {
    let plan = load_with_elements(
        "metrics = [\"stop_force\"]\n\
         [set]\nfriction_n = 120.36896776901074\nstop_1_clearance_m = 0.005297885594987613\n\
         stop_3_clearance_m = 0.02471392219099766\nstop_1_stiffness_n_per_m = 9667523.862787548\n\
         stop_2_stiffness_n_per_m = 19877.916219923085\n\
         bushing_1_cubic_y_n_per_m3 = 1968931.6691129277\n\
         unbalance_2_mass_kg = 0.13224203894531014\n\
         spring_stiffness_n_per_m = 11788.255609061018\nunbalance_x_m = 0.4005765838985148\n\
         tub_centre_x_m = 0.2550833796264678\nbearing_front_x_m = 0.06096174156338944\n\
         radial_clearance_m = 0.008603141071103267\n\
         [spin]\nprofile = \"ramp\"\nramp_s = 8.573098413311188\npeak_rpm = 775.7224287749027\n\
         [time]\nend_s = 10.997724240766944\nwindow_s = [7.861152775234532, 8.807735457981615]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [1.3864876009284073]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [177.11761272811856]\n\
         [reliability]\ncriterion = \"envelope\"\n\
         channels = [\"total_centre_y\", \"total_centre_z\"]\n",
    );
    let row = &rows(&plan)[0];
    assert_eq!((row.nonlinear.status, row.converged), (Status::Ok, Some(false)), "{row:?}");
}

#[test]
fn a_clash_by_a_micrometre_is_not_settled_by_the_share_of_caps() {
    // Two capped rungs differ by 2.4 ms in a time of 45 ms, and the second is off by 5.5 ms.
    let plan = load(
        "name = \"touch\"\nmetrics = [\"clash_time\"]\n\
         [set]\nradial_clearance_m = 8.00250089946135e-5\ndrum_mass_kg = 4.534164646399942\n\
         unbalance_x_m = 0.31630071726726944\ntub_inertia_22_kg_m2 = 1.3936982677322127\n\
         bearing_stiffness_n_per_m = 129763443.75555964\n\
         [spin]\nprofile = \"cycloidal\"\nramp_s = 6.306515485311183\n\
         peak_rpm = 429.5925869958344\n\
         [time]\nend_s = 10.170297026102327\nwindow_s = [7.474363179172588, 8.397319032877213]\n\
         [integrator]\nmethod = \"rk4-mass-scaled\"\naccuracy = 1e-2\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.06989003941784606]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [193.06203483388177]\n\
         [reliability]\nchannels = [\"drum_front_y\"]\n",
    );
    let clashes_s = [rows(&plan), by_rk4(&plan, 5e-5)].map(|rows| rows[0].linear.metrics[0]);
    assert!((clashes_s[0] / clashes_s[1] - 1.0).abs() < 1e-2, "{clashes_s:?}");
}

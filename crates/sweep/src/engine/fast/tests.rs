//! The fast method's promises, held against the reference method on the paper's map and on other machines.

use super::*;
use crate::interrupt::Interrupt;
use crate::plan::{AxisValues, Integrator};
use crate::run::Engine;

fn load(text: &str) -> Plan {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.toml");
    std::fs::write(&path, text).unwrap();
    crate::config::load(&path, &[]).unwrap()
}

/// The plan's outcomes, settled first as a run does.
fn outcomes(plan: &Plan) -> (Vec<Outcome>, Option<Settled>) {
    let interrupt = Interrupt::new();
    let watch = Watch::new(&interrupt);
    let engine = ModelEngine::new(plan).unwrap();
    engine.settle(None, &watch).unwrap();
    let groups: Vec<u64> = (0..plan.points()).step_by(32).collect();
    let all: Vec<Vec<Outcome>> = groups
        .par_iter()
        .map(|&start| engine.evaluate(start..(start + 32).min(plan.points()), &watch).unwrap())
        .collect();
    (all.concat(), engine.settled().copied())
}

fn verdicts(plan: &Plan, outcomes: &[Outcome]) -> Vec<Option<bool>> {
    let rule = &plan.reliability;
    outcomes.iter().map(|o| Verdict::new(o, rule.channels.len(), rule.ratio_limit).reliable).collect()
}

/// Runs a plan by the fast method and by the reference; the same verdicts, and no error of a steady point above the accuracy.
fn hold_against_reference(plan: &Plan, accuracy: f64) -> Vec<Outcome> {
    let fast = Plan { integrator: Integrator::Rk4MassScaled { accuracy }, ..plan.clone() };
    let (rows, settled) = outcomes(&fast);
    let settled = settled.unwrap();
    let reference = Plan { integrator: Integrator::Rk4 { step_s: settled.reference_step_s }, ..plan.clone() };
    let (expected, _) = outcomes(&reference);
    assert_eq!(verdicts(&fast, &rows), verdicts(&reference, &expected), "{}: {settled:?}", plan.name);
    let pairs = rows.iter().cloned().zip(expected);
    let steady: Vec<Pair> = pairs.filter(|(row, _)| row.sensitive == Some(false)).collect();
    let worst = steady.iter().filter_map(error).fold(0.0, f64::max);
    assert!(worst <= accuracy, "{}: error {worst:e} with {settled:?}", plan.name);
    rows
}

#[test]
fn verdicts_of_fig12_are_the_references() {
    let plan = load(include_str!("../../../../../sweeps/fig12.toml"));
    assert_eq!(plan.points(), 39 * 33);
    let rows = hold_against_reference(&plan, 1e-3);
    // Both kinds of points are there, and the reference was needed for few.
    let sensitive = rows.iter().filter(|row| row.sensitive == Some(true)).count();
    assert!(sensitive > 100, "{sensitive} sensitive points");
    let by_reference = rows.iter().filter(|row| row.linear.steps > 100_000).count();
    assert!((1..100).contains(&by_reference), "{by_reference} points by the reference method");
}

#[test]
fn verdicts_are_the_references_on_other_machines() {
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
        let axis = if set.contains("damper_1") { "damper_2_damping_n_s_per_m" } else { "damping_n_s_per_m" };
        let plan = load(&format!(
            "name = \"machine-{k}\"\n[set]\n{set}\n[spin]\nprofile = \"ramp\"\npeak_rpm = 350\nramp_s = 12\n\
             [time]\nend_s = 14\nwindow_s = [4, 14]\n\
             [[axis]]\nparameter = \"unbalance_mass_kg\"\nrange = {{ from = 0.1, to = 1.2, count = 6 }}\n\
             [[axis]]\nparameter = \"{axis}\"\nrange = {{ from = 40, to = 240, count = 5 }}\n"
        ));
        for accuracy in [1e-3, 1e-5] {
            hold_against_reference(&plan, accuracy);
        }
    }
}

#[test]
fn verdicts_by_other_criteria_are_the_references() {
    for criterion in ["envelope", "rms"] {
        let plan = load(&format!(
            "name = \"{criterion}\"\nmetrics = [\"cabinet_force\", \"static_sag\", \"clash_time\"]\n\
             [set]\nradial_clearance_m = 5e-4\n\
             [spin]\nprofile = \"ramp\"\npeak_rpm = 350\nramp_s = 12\n[time]\nend_s = 14\nwindow_s = [4, 14]\n\
             [[axis]]\nparameter = \"unbalance_mass_kg\"\nrange = {{ from = 0.1, to = 1.2, count = 6 }}\n\
             [[axis]]\nparameter = \"damping_n_s_per_m\"\nrange = {{ from = 40, to = 240, count = 5 }}\n\
             [reliability]\ncriterion = \"{criterion}\"\n"
        ));
        let by_peaks = Plan { measures: Default::default(), ..plan.clone() };
        let rows = hold_against_reference(&plan, 1e-3);
        let (peaks, _) =
            outcomes(&Plan { integrator: Integrator::Rk4MassScaled { accuracy: 1e-3 }, ..by_peaks });
        let clashing = rows.iter().filter(|row| row.nonlinear.metrics[1] > 0.0).count();
        assert!((1..rows.len()).contains(&clashing), "{clashing} of {} rows", rows.len());
        for (row, peak) in rows.iter().zip(&peaks) {
            assert!(
                row.nonlinear.turns.is_empty() && row.linear.turns.is_empty(),
                "nothing is held for long"
            );
            assert!(row.static_sag_m.is_some_and(|sag_m| (0.012..0.016).contains(&sag_m)), "{row:?}");
            let [force_n, clash_s] = row.nonlinear.metrics[..] else { panic!("{row:?}") };
            assert!(force_n > 300.0 && (0.0..=10.0).contains(&clash_s), "{row:?}");
            assert!(clash_s == 0.0 || row.nonlinear.min_gap_m.unwrap() < 0.0, "{row:?}");
            if criterion == "rms" {
                let smaller = row.linear.amplitudes.iter().zip(&peak.linear.amplitudes);
                assert!(smaller.into_iter().all(|(rms, peak)| 0.1 * peak < *rms && rms < peak), "{row:?}");
                continue;
            }
            // In the turn in which the nonlinear motion is greatest the linear one is at most as great as it ever is.
            let of_peaks = Verdict::new(peak, 6, 2.0).ratios;
            for (by_turn, of_peaks) in row.turn_ratios.iter().zip(of_peaks) {
                assert!(by_turn.unwrap() > 0.99 * of_peaks.unwrap(), "{row:?}");
            }
        }
    }
}

#[test]
fn the_sample_holds_the_corners_and_two_percent() {
    let mut plan = load(include_str!("../../../../../sweeps/fig12.toml"));
    let drawn = sample(&plan);
    assert!(drawn.len() as u64 * SAMPLED >= plan.points());
    assert!(plan.corner_points().iter().all(|corner| drawn.contains(corner)));
    assert!(drawn.is_sorted() && drawn.iter().all(|&point| point < plan.points()));
    plan.axes[0].values = AxisValues::Linear { from: 0.05, to: 1.0, count: 1_000_000_000_000 };
    assert!(sample(&plan).len() as u64 <= MOST_SAMPLED + 8);
}

#[test]
fn what_is_remembered_is_not_found_out_again() {
    let plan = load(include_str!("../../../../../sweeps/quick.toml"));
    let interrupt = Interrupt::new();
    let watch = Watch::new(&interrupt);
    let engine = ModelEngine::new(&plan).unwrap();
    let known = Settled { observed_error: Some(0.25), step_s: 1e-3, ..engine.unchecked(1e-3) };
    let value = serde_json::to_value(known).unwrap();
    assert_eq!(engine.settle(Some(value.clone()), &watch), Some(value));
    assert_eq!((engine.settled(), engine.observed_accuracy()), (Some(&known), Some(0.25)));
}

#[test]
fn a_sample_that_breaks_the_accuracy_tightens_step_and_cap() {
    // The rule's choice for a hundredth is too coarse for a millionth of this machine's amplitudes; the check must notice.
    let plan = load(
        "[spin]\nprofile = \"ramp\"\npeak_rpm = 1200\nramp_s = 5\n[time]\nend_s = 6\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [100, 200]\n",
    );
    let interrupt = Interrupt::new();
    let engine = ModelEngine::new(&plan).unwrap();
    let coarse = engine.unchecked(1e-2);
    let strict = 1e-7;
    let settled = engine.check_from(coarse, strict, &Watch::new(&interrupt)).unwrap();
    assert!(settled.tightened > 0 && settled.step_s < coarse.step_s);
    assert!(settled.observed_error.unwrap() <= strict, "{settled:?}");
}

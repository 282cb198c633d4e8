//! Fits of reference data: run-ups by an independent program, with known numbers.

mod fixed;

use std::path::Path;

use super::*;
use lane_ode::Cancel;
use sweep_engine::design::{Design, DesignRule};
use sweep_files::ParquetFile;

/// The spin of the reference data; a shorter run has its beginning.
const GRID: &str = "spin = { profile = \"triangular\", peak_rpm = 350, ramp_s = 12 }\n\
                    time = { end_s = 24 }\n";
/// The noise of the noisy files (m/s^2, rad). Basis: their `.json`. Doubling it contradicts them.
const NOISE: [f64; 4] = [0.3, 0.3, 5e-4, 5e-4];

const VISCOUS: [(&str, f64); 3] = [
    ("unbalance_mass_kg", 0.43),
    ("damping_n_s_per_m", 152.0),
    ("spring_stiffness_n_per_m", 8350.0),
];
const FRICTION: [(&str, f64); 5] = [
    ("unbalance_mass_kg", 0.36),
    ("damping_n_s_per_m", 25.0),
    ("spring_stiffness_n_per_m", 7700.0),
    ("friction_n", 34.0),
    ("friction_speed_m_per_s", 0.01),
];

/// Returns a reference file up to a time.
fn reference(name: &str, end_s: f64) -> Measurement {
    let path = format!("{}/testdata/fit/{name}.csv", env!("CARGO_MANIFEST_DIR"));
    let mut measurement = Measurement::read(Path::new(&path), &[]).unwrap();
    let rows = measurement.time_s.partition_point(|time| *time <= end_s);
    measurement.time_s.truncate(rows);
    measurement.speed_rpm.iter_mut().for_each(|speed| speed.truncate(rows));
    measurement.signals.iter_mut().for_each(|signal| signal.values.truncate(rows));
    measurement
}

fn case_at(numbers: &[(&str, f64)], factor: f64, measurement: Measurement) -> FitCase {
    let parameter_settings =
        numbers.iter().map(|(name, value)| format!("{name}={}", value * factor));
    let parameter_settings: Vec<String> =
        parameter_settings.chain(["friction_linear_speed_m_per_s=0.1".to_owned()]).collect();
    prepare_case(
        &WasherGridInput::text("reference", GRID.to_owned(), Vec::new()),
        &parameter_settings,
        measurement,
    )
    .unwrap()
}

fn options(free: &[&str]) -> FitOptions {
    FitOptions {
        free: free.iter().map(|name| (*name).to_owned()).collect(),
        own: Vec::new(),
        model: ModelKind::Nonlinear.name().to_owned(),
        no_shift: false,
        starts: 1,
        bootstrap: 0,
        known: vec!["none".to_owned()],
        draws: 0,
    }
}

/// Returns the problem of fitting the nonlinear model by the method that commands choose.
fn problem(cases: Vec<FitCase>, free: Vec<FreeParameter>, fits_shift: bool) -> Problem<'static> {
    let method = Problem::select_method(&cases).unwrap();
    let simd = simd_from_environment().unwrap();
    let model = ModelKind::Nonlinear;
    Problem { cases, free, model, fits_shift, method, simd, cancel: Cancel::Never }
}

fn fitted(cases: Vec<FitCase>, options: &FitOptions) -> FitReport {
    let context = FitContext {
        cancel: Cancel::Never,
        report_evaluations: &|_| {},
        output: None,
        fresh: false,
    };
    fit(cases, options, &context).unwrap().unwrap().report
}

/// Returns the errors of the fitted numbers in standard errors.
fn standardised_errors(report: &FitReport, truth: &[(&str, f64)]) -> Vec<f64> {
    let standardised_error = |fit: &report::FittedNumber| {
        let (_, truth) = truth.iter().find(|(name, _)| *name == fit.name).unwrap();
        (fit.value - truth) / fit.standard_error.unwrap()
    };
    report.parameters.iter().map(standardised_error).collect()
}

/// Returns noise of standard deviation 1 with a correlation of neighbours.
pub(super) fn noise(seed: u64, signal: usize, count: usize, correlation: f64) -> Vec<f64> {
    const SETTLED: usize = 200;
    let normal = Distribution {
        shape: DistributionShape::Normal { mean: 0.0, sd: 1.0 },
        from: -6.0,
        to: 6.0,
    };
    let draw = Design::Spread { rule: DesignRule::MonteCarlo, points: 0, seed };
    let mut previous = 0.0;
    let values = (0..(count + SETTLED) as u64).map(|row| {
        let innovation = normal.quantile(draw.position(row, signal).unwrap());
        previous = correlation * previous + (1.0 - correlation * correlation).sqrt() * innovation;
        previous
    });
    values.skip(SETTLED).collect()
}

#[test]
fn the_model_at_the_truth_is_the_exact_record() {
    for (name, truth) in [("viscous_exact", &VISCOUS[..]), ("friction_exact", &FRICTION[..])] {
        let cases = vec![case_at(truth, 1.0, reference(name, 8.0))];
        let problem = problem(cases, Vec::new(), false);
        for comparison in problem.compare(&[]).unwrap() {
            let values = &problem.cases[0].measurement.signals[comparison.signal].values;
            let largest =
                |values: &[f64]| values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            let share = largest(&comparison.residual) / largest(values);
            // Accelerations are second differences over 1 ms.
            assert!(share < 2e-3, "{name}, signal {}: {share}", comparison.signal);
        }
    }
}

#[test]
fn reference_data_lead_to_the_truth() {
    let names: Vec<&str> = VISCOUS.iter().map(|(name, _)| *name).collect();
    for factor in [0.7, 1.3] {
        let cases = vec![case_at(&VISCOUS, factor, reference("viscous", 8.0))];
        let report = fitted(cases, &options(&names));
        let standardised_errors = standardised_errors(&report, &VISCOUS);
        assert!(report.follows && report.is_converged, "{report:?}");
        assert!(
            standardised_errors.iter().all(|error| error.abs() < 3.0),
            "{standardised_errors:?}: {}",
            report.to_text()
        );
        assert!(report.evaluations < 25 && report.undetermined.is_empty(), "{}", report.to_text());
        for (noise, known) in report.first.noise.values().zip(NOISE) {
            assert!((noise / known - 1.0).abs() < 0.2, "{}", report.to_text());
        }
        assert!(report.first.shift_s.unwrap().abs() < 1e-3);
        // The noise is a third of the smallest column.
        assert!(
            report.first.explained_ratio.values().all(|share| *share > 0.88),
            "{}",
            report.to_text()
        );
        let expected_text = "tub_front_y_m_per_s2 0.291315 (32.3 %)";
        assert!(report.to_text().contains(expected_text), "{}", report.to_text());
    }
}

#[test]
fn a_model_without_the_friction_says_that_it_does_not_follow() {
    let start: Vec<(&str, f64)> =
        vec![("friction_n", 0.0), ("damping_n_s_per_m", 100.0), ("unbalance_mass_kg", 0.4)];
    let cases = vec![case_at(&start, 1.0, reference("friction", 8.0))];
    let free = ["unbalance_mass_kg", "damping_n_s_per_m", "spring_stiffness_n_per_m"];
    let report = fitted(cases, &options(&free));
    assert!(!report.follows, "{}", report.to_text());
    assert!(report.parameters.iter().all(|fit| fit.interval_95.is_none()));
    assert!(report.to_text().contains("does not follow"));
}

#[test]
fn an_interval_goes_no_farther_than_its_range() {
    // A record of a few seconds does not tell friction from damping.
    let cases = vec![case_at(&FRICTION, 1.1, reference("friction", 4.0))];
    let report = fitted(cases, &options(&["damping_n_s_per_m", "friction_n"]));
    let interval_start =
        |fit: &report::FittedNumber| fit.interval_95.map(|[interval_start, _]| interval_start);
    let least = report.parameters.iter().filter_map(interval_start).reduce(f64::min);
    assert_eq!(least, Some(0.0), "{}", report.to_text());
}

#[test]
fn a_search_that_came_to_no_end_gives_no_intervals() {
    let cases = vec![case_at(&VISCOUS, 1.0, reference("viscous", 3.0))];
    let free = read_free_parameters(&options(&["damping_n_s_per_m"]), &cases).unwrap();
    let problem = problem(cases, free, false);
    let x = problem.start_point();
    let comparisons = problem.compare(&x).unwrap();
    let equations = problem.normal_equations(&comparisons);
    let statistics = Statistics::from_comparisons(&problem, &comparisons, &equations);
    for is_converged in [true, false] {
        let x = x.clone();
        let equations = equations.clone();
        let report_data = report::ReportData {
            problem: &problem,
            suspected_unit_by_case: &[None],
            minima: &[Descent { x, equations, evaluations: 1, is_converged }],
            comparisons: &comparisons,
            start_comparisons: &comparisons,
            statistics: &statistics,
            evaluations: 1,
            step_effect: None,
            bootstrap_fits: None,
            draws: 0,
        };
        let report = report_data.report().unwrap();
        assert_eq!(report.parameters[0].interval_95.is_some(), is_converged, "{report:?}");
        assert_eq!(report.parameters[0].standard_error.is_some(), is_converged, "{report:?}");
        assert_eq!((report.follows, report.objection.is_none()), (is_converged, is_converged));
        let text = report.to_text();
        let first = text.lines().next().unwrap();
        assert_eq!(first.contains("the search did not come to its end"), !is_converged, "{text}");
        assert_eq!(text.contains("follows the measurement"), is_converged, "{text}");
    }
}

#[test]
fn a_fitted_machine_file_says_where_its_numbers_are_from() {
    let start = [VISCOUS[0], VISCOUS[1], ("friction_n", 5.0)];
    let cases = vec![case_at(&start, 1.0, reference("viscous", 1.0))];
    let free = read_free_parameters(&options(&["damping_n_s_per_m"]), &cases).unwrap();
    let problem = problem(cases, free, false);
    let (machine, _) = problem.machine(0, &problem.start_point());
    let text = crate::config::machine_file(&machine, &problem.number_sources());
    let line_with_key = |key: &str| text.lines().find(|line| line.starts_with(key)).unwrap();
    assert!(line_with_key("damping_n_s_per_m").ends_with("[given: fit to viscous.csv]"), "{text}");
    assert!(line_with_key("friction_n").ends_with("[given: --at]"), "{text}");
    assert!(line_with_key("stiffness_n_per_m").ends_with("[paper, section 3.1]"), "{text}");
}

#[test]
#[ignore = "half a minute; run by tests_with_tools"]
fn friction_is_told_from_viscous_damping() {
    let names: Vec<&str> = FRICTION.iter().map(|(name, _)| *name).collect();
    for factor in [0.7, 1.3] {
        let cases = vec![case_at(&FRICTION, factor, reference("friction", 24.0))];
        let report = fitted(cases, &options(&names));
        let standardised_errors = standardised_errors(&report, &FRICTION);
        assert!(report.follows, "{}", report.to_text());
        assert!(
            standardised_errors.iter().all(|error| error.abs() < 3.0),
            "{standardised_errors:?}: {}",
            report.to_text()
        );
    }
}

#[test]
#[ignore = "a minute; run by tests_with_tools"]
fn intervals_hold_the_truth_as_often_as_they_say() {
    const DRAWS: usize = 50;
    let names: Vec<&str> = VISCOUS.iter().map(|(name, _)| *name).collect();
    let mut covering_counts = vec![0; VISCOUS.len()];
    for draw in 0..DRAWS {
        let mut measurement = reference("viscous_exact", 8.0);
        for (s, signal) in measurement.signals.iter_mut().enumerate() {
            let noise = noise(draw as u64, s, signal.values.len(), 0.0);
            signal.values.iter_mut().zip(noise).for_each(|(value, z)| *value += NOISE[s] * z);
        }
        let report = fitted(vec![case_at(&VISCOUS, 0.97, measurement)], &options(&names));
        assert!(report.follows, "draw {draw}: {}", report.to_text());
        for ((covering_count, fit), (_, truth)) in
            covering_counts.iter_mut().zip(&report.parameters).zip(VISCOUS)
        {
            let [from, to] = fit.interval_95.unwrap();
            *covering_count += usize::from(from <= truth && truth <= to);
        }
    }
    println!("of {DRAWS} intervals hold the truth: {covering_counts:?}");
    let total_covering_count: usize = covering_counts.iter().sum();
    let share = total_covering_count as f64 / (DRAWS * VISCOUS.len()) as f64;
    assert!((0.90..=0.99).contains(&share), "{covering_counts:?}");
    assert!(covering_counts.iter().all(|count| *count >= 43), "{covering_counts:?}");
}

/// Returns the seed of draws that the environment gives, or a default.
fn seed() -> u64 {
    std::env::var("SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(0)
}

#[test]
fn intervals_know_that_noise_is_correlated_or_grows() {
    const DRAWS: u64 = 100;
    for (name, truth) in [("viscous_exact", &VISCOUS[..]), ("friction_exact", &FRICTION[..])] {
        let names: Vec<&str> = truth.iter().map(|(name, _)| *name).collect();
        let cases = vec![case_at(truth, 1.0, reference(name, 24.0))];
        let free = read_free_parameters(&options(&names), &cases).unwrap();
        let problem = problem(cases, free, true);
        let exact = problem.compare(&problem.start_point()).unwrap();
        // The noise grows with the motion itself, or with its envelope over half a second.
        for (correlation, growth, by_envelope) in [
            (0.0, 0.0, false),
            (0.6, 0.0, false),
            (0.9, 0.0, false),
            (0.0, 2.0, false),
            (0.6, 2.0, false),
            (0.0, 2.0, true),
            (0.6, 2.0, true),
            (0.9, 2.0, true),
        ] {
            let mut covering_counts = vec![0; truth.len()];
            let mut objections = 0;
            let mut quantile: f64 = 0.0;
            for draw in 0..DRAWS {
                let mut comparisons = exact.clone();
                for (comparison, (.., signal)) in comparisons.iter_mut().zip(problem.signals()) {
                    let motion = signal.samples().map(|(row, _)| comparison.model[row]);
                    let mut noise_size = algebra::subtract_mean(motion.collect()).0;
                    if by_envelope {
                        let square = |neighbours: &[f64]| {
                            algebra::dot(neighbours, neighbours) / neighbours.len() as f64
                        };
                        let count = noise_size.len();
                        let neighbours =
                            |k: usize| &noise_size[k.saturating_sub(12)..(k + 13).min(count)];
                        noise_size = (0..count).map(|k| square(neighbours(k)).sqrt()).collect();
                    }
                    let rms_noise_size =
                        (algebra::dot(&noise_size, &noise_size) / noise_size.len() as f64).sqrt();
                    let draw = DRAWS * seed() + draw;
                    let noise =
                        noise(draw, comparison.signal, comparison.residual.len(), correlation);
                    let noise = noise.iter().zip(&noise_size).map(|(noise, noise_size)| {
                        NOISE[comparison.signal]
                            * noise
                            * (1.0 + growth * (noise_size / rms_noise_size).abs())
                    });
                    comparison.residual = algebra::subtract_mean(noise.collect()).0;
                }
                // Near the truth the model is linear, so that one step of Gauss and Newton
                // suffices.
                let equations = problem.normal_equations(&comparisons);
                let inverse_normal = algebra::pseudo_inverse(&equations.normal);
                let step: Vec<f64> =
                    inverse_normal.iter().map(|row| algebra::dot(row, &equations.rhs)).collect();
                for SignalComparison { residual, slopes, .. } in &mut comparisons {
                    for (slope, step) in slopes.iter().zip(&step) {
                        residual.iter_mut().zip(slope).for_each(|(left, s)| *left -= step * s);
                    }
                }
                let equations = problem.normal_equations(&comparisons);
                let statistics = Statistics::from_comparisons(&problem, &comparisons, &equations);
                if let Some(objection) = statistics.objection(&problem) {
                    if objections == 0 {
                        println!("{objection}");
                    }
                    objections += 1;
                }
                for (k, covering_count) in covering_counts.iter_mut().enumerate() {
                    let half_width = statistics.quantiles[k] * statistics.covariance[k][k].sqrt();
                    *covering_count += u64::from(step[k].abs() < half_width);
                }
                quantile = f64::max(quantile, statistics.quantiles[0]);
            }
            let share =
                covering_counts.iter().sum::<u64>() as f64 / (DRAWS * truth.len() as u64) as f64;
            let kind = format!("{name}, {correlation}, {growth}, {by_envelope}");
            println!(
                "{kind}: {covering_counts:?} of {DRAWS} hold the truth: {share:.3}; {objections} \
                 object; quantile up to {quantile:.2}"
            );
            assert!(growth > 0.0 || objections == 0, "{kind}: {objections}");
            // Correlations are estimated less well than variances. An interval takes the widest of
            // several estimates, and so may hold the truth in more than 95 % of draws.
            let expected = if correlation > 0.0 || growth > 0.0 { 0.90..=1.0 } else { 0.90..=0.99 };
            assert!(expected.contains(&share), "{kind}: {covering_counts:?}");
        }
    }
}

#[test]
fn a_linear_model_says_what_the_nonlinear_one_would_have() {
    let cases = vec![case_at(&VISCOUS, 1.0, reference("viscous", 8.0))];
    let linear_options = FitOptions {
        model: ModelKind::Linear.name().to_owned(),
        ..options(&["spring_stiffness_n_per_m"])
    };
    let report = fitted(cases, &linear_options);
    let expected_text = "the nonlinear model would move spring_stiffness_n_per_m by";
    assert!(report.objection.as_ref().is_some_and(|why| why.contains(expected_text)), "{report:?}");
}

#[test]
fn what_cannot_be_fitted_is_said() {
    let error_text = |free: &[&str], measurement: Measurement| {
        let context = FitContext {
            cancel: Cancel::Never,
            report_evaluations: &|_| {},
            output: None,
            fresh: false,
        };
        let cases = vec![case_at(&VISCOUS, 1.0, measurement)];
        match fit(cases, &options(free), &context) {
            Err(error) => error.to_string(),
            Ok(_) => panic!("{free:?}"),
        }
    };
    let short_record = || reference("viscous", 1.0);
    for (free, expected_text) in [
        (&["dampng_n_s_per_m"][..], "did you mean `damping_n_s_per_m`"),
        (&["damping_n_s_per_m", "damping_n_s_per_m"], "free twice"),
        (&["damping_n_s_per_m=200:100"], "is no range"),
        (&["damping_n_s_per_m=-5:100"], "is no range"),
        (&["window_from_s"], "no number of the machine"),
        (&["friction_n"], "no value to start from"),
        (&["radial_clearance_m"], "does not depend on radial_clearance_m"),
        (&["spin_ramp_s"], "a spin given as a table"),
    ] {
        let text = error_text(free, short_record());
        assert!(text.contains(expected_text), "{free:?}: {text}");
    }
    let mut record_from_4_s = reference("viscous", 8.0);
    let first_row = record_from_4_s.time_s.partition_point(|time| *time < 4.0);
    let columns = record_from_4_s.signals.iter_mut().map(|signal| &mut signal.values);
    columns
        .chain(&mut record_from_4_s.speed_rpm)
        .for_each(|values| drop(values.drain(..first_row)));
    record_from_4_s.time_s =
        record_from_4_s.time_s[first_row..].iter().map(|time| time - 4.0).collect();
    let text = error_text(&["damping_n_s_per_m"], record_from_4_s);
    assert!(text.contains("viscous.csv begins at 117 rpm"), "{text}");
    let mut sparse_record = short_record();
    sparse_record.time_s.truncate(1);
    sparse_record.speed_rpm = None;
    sparse_record.signals.iter_mut().for_each(|signal| signal.values.truncate(1));
    assert!(error_text(&["damping_n_s_per_m"], sparse_record).contains("6 unknowns for 4 samples"));
}

#[test]
fn units_that_are_wrong_and_loads_that_differ_are_seen() {
    let mut degrees_record = reference("viscous", 5.0);
    // Degrees instead of radians.
    let convert_to_degrees =
        |values: &mut Vec<f64>| values.iter_mut().for_each(|v| *v *= 57.295_78);
    convert_to_degrees(&mut degrees_record.signals[2].values);
    let mut other_record = reference("viscous", 5.0);
    other_record.name = "other".to_owned();
    let mut cases =
        vec![case_at(&VISCOUS, 1.0, degrees_record), case_at(&VISCOUS, 1.0, other_record)];
    cases[1].plan.model.machine.unbalance.mass_kg = 0.6;
    let mut options = options(&["damping_n_s_per_m"]);
    options.own = vec!["unbalance_mass_kg=0.1:1".to_owned()];
    let report = fitted(cases, &options);
    let degree_notes: Vec<&String> =
        report.notes.iter().filter(|it| it.contains("degrees")).collect();
    assert!(
        degree_notes.len() == 1 && degree_notes[0].starts_with("tub_yaw_rad of viscous.csv"),
        "{report:?}"
    );
    let [_, first, second] = &report.parameters[..] else { panic!("{report:?}") };
    assert_eq!(first.file.as_deref(), Some("viscous.csv"));
    assert_eq!(second.file.as_deref(), Some("other"));
    assert!((second.value - 0.43).abs() < 0.02, "{}", report.to_text());
}

#[test]
fn records_in_g_are_seen_where_the_search_starts() {
    const G: f64 = 9.806_65;
    for (factor, known) in [(1.0 / G, "seems to be in g"), (G, "from g once too often")] {
        let mut measurement = reference("viscous_exact", 8.0);
        // Only accelerations are kept: a great damping makes those of the model as small as a
        // record in g.
        measurement.signals.truncate(2);
        for signal in &mut measurement.signals {
            signal.values.iter_mut().for_each(|value| *value *= factor);
        }
        let case = case_at(&VISCOUS, 1.0, measurement);
        let report = fitted(vec![case], &options(&["damping_n_s_per_m"]));
        let unit_notes = report.notes.iter().filter(|note| note.contains(known));
        assert_eq!(unit_notes.count(), 2, "{report:?}");
    }
}

#[test]
fn a_number_that_does_not_count_at_the_start_is_found_from_others() {
    // Without friction the record does not depend on the friction's speed.
    let start = [("friction_n", 0.0), FRICTION[0], FRICTION[1], FRICTION[2]];
    let cases = || vec![case_at(&start, 1.0, reference("friction", 8.0))];
    let mut options = options(&["friction_n=0:60", "friction_speed_m_per_s=0.005:0.02"]);
    let context = FitContext {
        cancel: Cancel::Never,
        report_evaluations: &|_| {},
        output: None,
        fresh: false,
    };
    let error = fit(cases(), &options, &context).err().unwrap().to_string();
    assert!(error.contains("does not depend on friction_speed_m_per_s"), "{error}");
    options.starts = 6;
    let report = fitted(cases(), &options);
    assert!((report.parameters[0].value / 34.0 - 1.0).abs() < 0.1, "{}", report.to_text());
}

#[test]
fn a_wrong_unit_of_speed_or_time_is_named() {
    let record = |speed_factor: f64, time_factor: f64| {
        let mut measurement = reference("viscous", 8.0);
        let speeds = measurement.speed_rpm.iter_mut().flatten();
        speeds.for_each(|speed| *speed *= speed_factor);
        measurement.time_s.iter_mut().for_each(|time_s| *time_s *= time_factor);
        measurement
    };
    let start = [("unbalance_mass_kg", 0.34), ("damping_n_s_per_m", 120.0), VISCOUS[2]];
    let free = options(&["unbalance_mass_kg", "damping_n_s_per_m"]);
    for (speed_factor, time_factor, expected_text) in [
        (std::f64::consts::TAU / 60.0, 1.0, "speed_rpm of viscous.csv seems to be in rad/s"),
        (1.0 / 60.0, 1.0, "speed_rpm of viscous.csv seems to be in Hz"),
        (0.1, 1.0, "speed_rpm of viscous.csv seems to be in tens of rpm"),
        (6.0, 1.0, "speed_rpm of viscous.csv seems to be in degrees per s"),
        (1.0, 1.0 / 60.0, "time_s of viscous.csv seems to be in min"),
        (1.0, 0.1, "time_s of viscous.csv seems to be in tens of s"),
        (1.0, 10.0, "time_s of viscous.csv seems to be in tenths of s"),
    ] {
        let cases = vec![case_at(&start, 1.0, record(speed_factor, time_factor))];
        let report = fitted(cases, &free);
        let text = report.to_text();
        println!(
            "{} {expected_text}: {:?} {text}",
            report.evaluations, report.first.explained_ratio
        );
        assert!(
            !report.follows && text.contains(&format!("      unit  {expected_text}")),
            "{expected_text}: {text}"
        );
        assert!(text.contains("converted, a short fit explains"), "{text}");
        assert!(
            text.starts_with("     model  does not follow the measurement: the model "),
            "{text}"
        );
        // The search does not go on in wrong units: an evaluation at the start and eight others.
        assert!(report.evaluations < 10, "{expected_text}: {} evaluations", report.evaluations);
        assert!(report.first.explained_ratio.values().all(|ratio| *ratio < 0.25), "{report:?}");
        let suspects_unit = |note: &String| note.contains("it seems to");
        assert!(!report.notes.iter().any(suspects_unit), "{expected_text}: {:?}", report.notes);
    }
    let report = fitted(vec![case_at(&start, 1.0, record(1.0, 1.0))], &free);
    println!("right units: {:?}", report.first.explained_ratio);
    assert!(report.first.explained_ratio.values().all(|ratio| *ratio > 0.75), "{report:?}");
    // No wrong unit is suspected in a record in the right units, though another machine's model
    // does not explain it.
    let report = fitted(vec![case_at(&VISCOUS, 0.8, record(1.0, 1.0))], &options(&[start[0].0]));
    assert!(report.objection.unwrap_or_default().contains("the model explains"));
    assert!(report.suspected_units.is_empty());
}

/// A model at wrong speeds may differ from a channel by the factor of another unit.
#[test]
fn a_wrong_unit_of_speed_is_no_wrong_unit_of_a_channel() {
    let cases = vec![case_at(&VISCOUS, 1.0, reference("viscous", 3.0))];
    let problem = problem(cases, Vec::new(), false);
    let mut comparisons = problem.compare(&[]).unwrap();
    let yaw = &mut comparisons[2];
    let column = problem.cases[0].measurement.signals[2].quantity.column();
    yaw.model.iter_mut().for_each(|value| *value = value.to_radians());
    let equations = problem.normal_equations(&comparisons);
    let statistics = Statistics::from_comparisons(&problem, &comparisons, &equations);
    let is_converged = true;
    let minima = [Descent { x: Vec::new(), equations, evaluations: 1, is_converged }];
    let notes = |suspected_unit_by_case: &[Option<String>]| {
        let report_data = report::ReportData {
            problem: &problem,
            suspected_unit_by_case,
            minima: &minima,
            comparisons: &comparisons,
            start_comparisons: &comparisons,
            statistics: &statistics,
            evaluations: 1,
            step_effect: None,
            bootstrap_fits: None,
            draws: 0,
        };
        report_data.report().unwrap().notes
    };
    let unit_notes = notes(&[None]);
    let is_named = |note: &String| note.starts_with(&column) && note.contains("in degrees");
    assert!(unit_notes.iter().any(is_named), "{unit_notes:?}");
    assert!(notes(&[Some("speed_rpm seems to be in rad/s".to_owned())]).is_empty());
}

#[test]
fn a_signal_in_white_noise_is_followed() {
    let mut measurement = reference("viscous_exact", 8.0);
    measurement.signals.drain(..2);
    for (s, signal) in measurement.signals.iter_mut().enumerate() {
        let size = 2.0 * algebra::dot(&signal.centred_values(), &signal.centred_values()).sqrt();
        let size = size / (signal.values.len() as f64).sqrt();
        let noise = noise(3, s, signal.values.len(), 0.0);
        signal.values.iter_mut().zip(noise).for_each(|(value, z)| *value += size * z);
    }
    let report =
        fitted(vec![case_at(&VISCOUS, 0.9, measurement)], &options(&["unbalance_mass_kg"]));
    assert!(report.first.explained_ratio.values().all(|ratio| *ratio < 0.5), "{report:?}");
    assert!(report.follows, "{}", report.to_text());
    assert!(standardised_errors(&report, &VISCOUS)[0].abs() < 3.0, "{}", report.to_text());
}

#[test]
fn a_start_that_is_far_off_is_no_wrong_unit() {
    let start = [("unbalance_mass_kg", 0.043), VISCOUS[1], VISCOUS[2]];
    let cases = vec![case_at(&start, 1.0, reference("viscous", 8.0))];
    let report = fitted(cases, &options(&["unbalance_mass_kg"]));
    assert!(report.follows && report.notes.is_empty(), "{report:?}");
}

#[test]
fn an_interrupted_fit_goes_on_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("x.toml");
    let partial = folder.path().join("x.toml.partial");
    let cases = || vec![case_at(&VISCOUS, 0.9, reference("viscous", 3.0))];
    let options = options(&["damping_n_s_per_m", "unbalance_mass_kg"]);
    let uninterrupted = fitted(cases(), &options);
    let evaluation_count = AtomicUsize::new(0);
    let count_evaluation = |_| {
        evaluation_count.fetch_add(1, Ordering::Relaxed);
    };
    let is_requested = || evaluation_count.load(Ordering::Relaxed) >= 3;
    let context = FitContext {
        cancel: Cancel::When(&is_requested),
        report_evaluations: &count_evaluation,
        output: Some(&output),
        fresh: false,
    };
    assert!(fit(cases(), &options, &context).unwrap().is_none());
    let part_file = ParquetFile::open(&partial.join("part-00000000.parquet")).unwrap();
    // The start is evaluated once, although each descent begins with it.
    assert_eq!(part_file.rows(), 2);
    let fields = part_file.schema().fields().iter().take(4).map(|field| field.name().as_str());
    let expected = ["damping_n_s_per_m", "unbalance_mass_kg", "file_1_shift_s", "cost"];
    assert_eq!(fields.collect::<Vec<_>>(), expected);

    // Another fit does not change stored evaluations, nor does a second process.
    let context = FitContext {
        cancel: Cancel::When(&|| true),
        report_evaluations: &|_| {},
        output: Some(&output),
        fresh: false,
    };
    let without_shift = FitOptions { no_shift: true, ..options.clone() };
    let error = fit(cases(), &without_shift, &context).err().unwrap().to_string();
    assert!(error.contains("/fit/shift: was true, is false"), "{error}");

    let evaluation_count = AtomicUsize::new(0);
    let count_evaluation = |_| {
        evaluation_count.fetch_add(1, Ordering::Relaxed);
    };
    let context = FitContext {
        cancel: Cancel::Never,
        report_evaluations: &count_evaluation,
        output: Some(&output),
        fresh: false,
    };
    let resumed = fit(cases(), &options, &context).unwrap().unwrap();
    assert_eq!(serde_json::json!(resumed.report), serde_json::json!(uninterrupted));
    let error_while_open = fit(cases(), &options, &context).err().unwrap().to_string();
    assert!(error_while_open.contains("is in use by process"), "{error_while_open}");
    assert_eq!(resumed.evaluations.unwrap().complete(), None);
    assert!(!partial.exists());
}

#[test]
fn a_damaged_part_of_a_fit_costs_its_evaluations() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("x.toml");
    let part_path = folder.path().join("x.toml.partial/part-00000000.parquet");
    let cases = || vec![case_at(&VISCOUS, 0.9, reference("viscous", 3.0))];
    let options = options(&["damping_n_s_per_m"]);
    let uninterrupted = fitted(cases(), &options);
    let fit = || {
        let context = FitContext {
            cancel: Cancel::Never,
            report_evaluations: &|_| {},
            output: Some(&output),
            fresh: false,
        };
        fit(cases(), &options, &context).unwrap().unwrap()
    };
    drop(fit());
    let undamaged = std::fs::read(&part_path).unwrap();
    let mut bytes = undamaged.clone();
    bytes[undamaged.len() / 2] ^= 1;
    std::fs::write(&part_path, bytes).unwrap();
    let repeated = fit();
    assert_eq!(serde_json::json!(repeated.report), serde_json::json!(uninterrupted));
    assert!(part_path.with_extension("parquet.damaged").exists());
    let note = repeated.evaluations.unwrap().complete().unwrap();
    assert!(note.contains("part-00000000.parquet.damaged"), "{note}");
}

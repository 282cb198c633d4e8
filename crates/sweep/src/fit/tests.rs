//! Fits of reference data: run-ups by an independent program, with known numbers.

mod fixed;

use std::path::Path;

use super::*;
use lane_ode::Cancel;
use sweep_engine::design::{Design, DesignRule};
use sweep_files::ParquetFile;

/// The grid with the spin of the reference data. A record up to an earlier time has the first part
/// of this spin.
const SPIN_GRID: &str = "spin = { profile = \"triangular\", peak_rpm = 350, ramp_s = 12 }\n\
                    time = { end_s = 24 }\n";
/// The standard deviations of the noise in the noisy reference files, by signal (m/s^2 for the
/// accelerations, rad for the angles). Basis: the `.json` files beside these. Doubling one fails
/// the test of the estimated noise.
const NOISE_SD: [f64; 4] = [0.3, 0.3, 5e-4, 5e-4];

/// The numbers of the machine in the reference files `viscous` and `viscous_exact`.
const VISCOUS_TRUTH: [(&str, f64); 3] = [
    ("unbalance_mass_kg", 0.43),
    ("damping_n_s_per_m", 152.0),
    ("spring_stiffness_n_per_m", 8350.0),
];
/// The numbers of the machine in the reference files `friction` and `friction_exact`.
const FRICTION_TRUTH: [(&str, f64); 5] = [
    ("unbalance_mass_kg", 0.36),
    ("damping_n_s_per_m", 25.0),
    ("spring_stiffness_n_per_m", 7700.0),
    ("friction_n", 34.0),
    ("friction_speed_m_per_s", 0.01),
];

/// Returns the measurement in a reference file up to a time.
fn read_reference(name: &str, end_s: f64) -> Measurement {
    let path = format!("{}/testdata/fit/{name}.csv", env!("CARGO_MANIFEST_DIR"));
    let mut measurement = Measurement::read(Path::new(&path), &[]).unwrap();
    let row_count = measurement.time_s.partition_point(|time| *time <= end_s);
    measurement.time_s.truncate(row_count);
    measurement.speed_rpm.iter_mut().for_each(|speed| speed.truncate(row_count));
    measurement.signals.iter_mut().for_each(|signal| signal.values.truncate(row_count));
    measurement
}

fn case_with_numbers(
    numbers: &[(&str, f64)],
    start_factor: f64,
    measurement: Measurement,
) -> FitCase {
    let parameter_settings =
        numbers.iter().map(|(name, value)| format!("{name}={}", value * start_factor));
    let parameter_settings: Vec<String> =
        parameter_settings.chain(["friction_linear_speed_m_per_s=0.1".to_owned()]).collect();
    prepare_case(
        &WasherGridInput::text("reference", SPIN_GRID.to_owned(), Vec::new()),
        &parameter_settings,
        measurement,
    )
    .unwrap()
}

fn fit_options(free: &[&str]) -> FitOptions {
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
fn nonlinear_problem(
    cases: Vec<FitCase>,
    free: Vec<FreeParameter>,
    fits_shift: bool,
) -> Problem<'static> {
    let method = Problem::select_method(&cases).unwrap();
    let simd = simd_from_environment().unwrap();
    let model = ModelKind::Nonlinear;
    Problem {
        cases,
        free_parameters: free,
        model_kind: model,
        fits_shift,
        method,
        simd,
        cancel: Cancel::Never,
    }
}

fn fit_report(cases: Vec<FitCase>, options: &FitOptions) -> FitReport {
    let context = FitContext {
        cancel: Cancel::Never,
        report_evaluations: &|_| {},
        output: None,
        fresh: false,
    };
    fit(cases, options, &context).unwrap().unwrap().report
}

/// Returns the error of each fitted number, divided by its standard error.
fn compute_standardised_errors(report: &FitReport, true_numbers: &[(&str, f64)]) -> Vec<f64> {
    let standardised_error = |fit: &report::FittedNumber| {
        let (_, true_value) = true_numbers.iter().find(|(name, _)| *name == fit.name).unwrap();
        (fit.value - true_value) / fit.standard_error.unwrap()
    };
    report.parameters.iter().map(standardised_error).collect()
}

/// Returns noise of standard deviation 1 in which neighbouring samples have a given correlation.
pub(super) fn correlated_noise(
    seed: u64,
    signal: usize,
    count: usize,
    correlation: f64,
) -> Vec<f64> {
    const SETTLING_ROWS: usize = 200;
    let normal = Distribution {
        shape: DistributionShape::Normal { mean: 0.0, sd: 1.0 },
        from: -6.0,
        to: 6.0,
    };
    let draw_design = Design::Spread { rule: DesignRule::MonteCarlo, points: 0, seed };
    let mut previous = 0.0;
    let values = (0..(count + SETTLING_ROWS) as u64).map(|row| {
        let innovation = normal.quantile(draw_design.position(row, signal).unwrap());
        previous = correlation * previous + (1.0 - correlation * correlation).sqrt() * innovation;
        previous
    });
    values.skip(SETTLING_ROWS).collect()
}

#[test]
fn the_model_at_the_truth_is_the_exact_record() {
    for (name, true_numbers) in
        [("viscous_exact", &VISCOUS_TRUTH[..]), ("friction_exact", &FRICTION_TRUTH[..])]
    {
        let cases = vec![case_with_numbers(true_numbers, 1.0, read_reference(name, 8.0))];
        let problem = nonlinear_problem(cases, Vec::new(), false);
        for comparison in problem.compare(&[]).unwrap() {
            let values = &problem.cases[0].measurement.signals[comparison.signal_index].values;
            let largest_magnitude = |values: &[f64]| {
                values.iter().fold(0.0_f64, |maximum, value| maximum.max(value.abs()))
            };
            let residual_ratio =
                largest_magnitude(&comparison.residual) / largest_magnitude(values);
            // The tolerance allows for the accelerations, which are second differences over 1 ms.
            assert!(
                residual_ratio < 2e-3,
                "{name}, signal {}: {residual_ratio}",
                comparison.signal_index
            );
        }
    }
}

#[test]
fn reference_data_lead_to_the_truth() {
    let names: Vec<&str> = VISCOUS_TRUTH.iter().map(|(name, _)| *name).collect();
    for factor in [0.7, 1.3] {
        let cases = vec![case_with_numbers(&VISCOUS_TRUTH, factor, read_reference("viscous", 8.0))];
        let report = fit_report(cases, &fit_options(&names));
        let standardised_errors = compute_standardised_errors(&report, &VISCOUS_TRUTH);
        assert!(report.follows && report.is_converged, "{report:?}");
        assert!(
            standardised_errors.iter().all(|error| error.abs() < 3.0),
            "{standardised_errors:?}: {}",
            report.to_text()
        );
        assert!(report.evaluations < 25 && report.undetermined.is_empty(), "{}", report.to_text());
        for (noise_rms, true_noise_sd) in report.first.noise.values().zip(NOISE_SD) {
            assert!((noise_rms / true_noise_sd - 1.0).abs() < 0.2, "{}", report.to_text());
        }
        assert!(report.first.shift_s.unwrap().abs() < 1e-3);
        // In the signal with the smallest motion the noise is a third of the motion.
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
    let start_numbers: Vec<(&str, f64)> =
        vec![("friction_n", 0.0), ("damping_n_s_per_m", 100.0), ("unbalance_mass_kg", 0.4)];
    let cases = vec![case_with_numbers(&start_numbers, 1.0, read_reference("friction", 8.0))];
    let free_names = ["unbalance_mass_kg", "damping_n_s_per_m", "spring_stiffness_n_per_m"];
    let report = fit_report(cases, &fit_options(&free_names));
    assert!(!report.follows, "{}", report.to_text());
    assert!(report.parameters.iter().all(|fit| fit.interval_95.is_none()));
    assert!(report.to_text().contains("does not follow"));
}

#[test]
fn an_interval_goes_no_farther_than_its_range() {
    // A record of a few seconds does not distinguish friction from damping.
    let cases = vec![case_with_numbers(&FRICTION_TRUTH, 1.1, read_reference("friction", 4.0))];
    let report = fit_report(cases, &fit_options(&["damping_n_s_per_m", "friction_n"]));
    let interval_lower_end =
        |fit: &report::FittedNumber| fit.interval_95.map(|[interval_start, _]| interval_start);
    let least_lower_end = report.parameters.iter().filter_map(interval_lower_end).reduce(f64::min);
    assert_eq!(least_lower_end, Some(0.0), "{}", report.to_text());
}

#[test]
fn a_search_that_came_to_no_end_gives_no_intervals() {
    let cases = vec![case_with_numbers(&VISCOUS_TRUTH, 1.0, read_reference("viscous", 3.0))];
    let free = read_free_parameters(&fit_options(&["damping_n_s_per_m"]), &cases).unwrap();
    let problem = nonlinear_problem(cases, free, false);
    let start_point = problem.start_point();
    let comparisons = problem.compare(&start_point).unwrap();
    let equations = problem.normal_equations(&comparisons);
    let statistics = Statistics::from_comparisons(&problem, &comparisons, &equations);
    for is_converged in [true, false] {
        let x = start_point.clone();
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
        let report_text = report.to_text();
        let first_line = report_text.lines().next().unwrap();
        assert_eq!(
            first_line.contains("the search did not come to its end"),
            !is_converged,
            "{report_text}"
        );
        assert_eq!(report_text.contains("follows the measurement"), is_converged, "{report_text}");
    }
}

#[test]
fn a_fitted_machine_file_says_where_its_numbers_are_from() {
    let start_numbers = [VISCOUS_TRUTH[0], VISCOUS_TRUTH[1], ("friction_n", 5.0)];
    let cases = vec![case_with_numbers(&start_numbers, 1.0, read_reference("viscous", 1.0))];
    let free = read_free_parameters(&fit_options(&["damping_n_s_per_m"]), &cases).unwrap();
    let problem = nonlinear_problem(cases, free, false);
    let (start_machine, _) = problem.machine(0, &problem.start_point());
    let machine_text = crate::config::machine_file(&start_machine, &problem.number_sources());
    let line_with_key =
        |key: &str| machine_text.lines().find(|line| line.starts_with(key)).unwrap();
    assert!(
        line_with_key("damping_n_s_per_m").ends_with("[given: fit to viscous.csv]"),
        "{machine_text}"
    );
    assert!(line_with_key("friction_n").ends_with("[given: --at]"), "{machine_text}");
    assert!(line_with_key("stiffness_n_per_m").ends_with("[paper, section 3.1]"), "{machine_text}");
}

#[test]
#[ignore = "half a minute; run by tests_with_tools"]
fn friction_is_told_from_viscous_damping() {
    let names: Vec<&str> = FRICTION_TRUTH.iter().map(|(name, _)| *name).collect();
    for factor in [0.7, 1.3] {
        let cases =
            vec![case_with_numbers(&FRICTION_TRUTH, factor, read_reference("friction", 24.0))];
        let report = fit_report(cases, &fit_options(&names));
        let standardised_errors = compute_standardised_errors(&report, &FRICTION_TRUTH);
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
    let names: Vec<&str> = VISCOUS_TRUTH.iter().map(|(name, _)| *name).collect();
    let mut covering_counts = vec![0; VISCOUS_TRUTH.len()];
    for draw in 0..DRAWS {
        let mut measurement = read_reference("viscous_exact", 8.0);
        for (s, signal) in measurement.signals.iter_mut().enumerate() {
            let noise_values = correlated_noise(draw as u64, s, signal.values.len(), 0.0);
            signal
                .values
                .iter_mut()
                .zip(noise_values)
                .for_each(|(value, z)| *value += NOISE_SD[s] * z);
        }
        let report = fit_report(
            vec![case_with_numbers(&VISCOUS_TRUTH, 0.97, measurement)],
            &fit_options(&names),
        );
        assert!(report.follows, "draw {draw}: {}", report.to_text());
        for ((covering_count, fit), (_, true_value)) in
            covering_counts.iter_mut().zip(&report.parameters).zip(VISCOUS_TRUTH)
        {
            let [interval_from, interval_to] = fit.interval_95.unwrap();
            *covering_count +=
                usize::from(interval_from <= true_value && true_value <= interval_to);
        }
    }
    println!("of {DRAWS} intervals hold the truth: {covering_counts:?}");
    let total_covering_count: usize = covering_counts.iter().sum();
    let coverage = total_covering_count as f64 / (DRAWS * VISCOUS_TRUTH.len()) as f64;
    assert!((0.90..=0.99).contains(&coverage), "{covering_counts:?}");
    assert!(covering_counts.iter().all(|count| *count >= 43), "{covering_counts:?}");
}

/// Returns the seed of draws that the environment gives, or a default.
fn seed_from_environment() -> u64 {
    std::env::var("SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(0)
}

#[test]
fn intervals_know_that_noise_is_correlated_or_grows() {
    const DRAWS: u64 = 100;
    for (name, true_numbers) in
        [("viscous_exact", &VISCOUS_TRUTH[..]), ("friction_exact", &FRICTION_TRUTH[..])]
    {
        let names: Vec<&str> = true_numbers.iter().map(|(name, _)| *name).collect();
        let cases = vec![case_with_numbers(true_numbers, 1.0, read_reference(name, 24.0))];
        let free = read_free_parameters(&fit_options(&names), &cases).unwrap();
        let problem = nonlinear_problem(cases, free, true);
        let exact_comparisons = problem.compare(&problem.start_point()).unwrap();
        // The noise grows with the magnitude of the motion, or with its root mean square over half
        // a second.
        for (correlation, noise_growth, grows_with_envelope) in [
            (0.0, 0.0, false),
            (0.6, 0.0, false),
            (0.9, 0.0, false),
            (0.0, 2.0, false),
            (0.6, 2.0, false),
            (0.0, 2.0, true),
            (0.6, 2.0, true),
            (0.9, 2.0, true),
        ] {
            let mut covering_counts = vec![0; true_numbers.len()];
            let mut objection_count = 0;
            let mut max_quantile: f64 = 0.0;
            for draw in 0..DRAWS {
                let mut comparisons = exact_comparisons.clone();
                for (comparison, (.., signal)) in comparisons.iter_mut().zip(problem.signals()) {
                    let motion_samples =
                        signal.samples().map(|(row, _)| comparison.model_values[row]);
                    let mut noise_sizes = algebra::subtract_mean(motion_samples.collect()).0;
                    if grows_with_envelope {
                        let mean_square = |neighbours: &[f64]| {
                            algebra::dot(neighbours, neighbours) / neighbours.len() as f64
                        };
                        let sample_count = noise_sizes.len();
                        let samples_near = |k: usize| {
                            &noise_sizes[k.saturating_sub(12)..(k + 13).min(sample_count)]
                        };
                        noise_sizes = (0..sample_count)
                            .map(|k| mean_square(samples_near(k)).sqrt())
                            .collect();
                    }
                    let rms_noise_size = (algebra::dot(&noise_sizes, &noise_sizes)
                        / noise_sizes.len() as f64)
                        .sqrt();
                    let draw_seed = DRAWS * seed_from_environment() + draw;
                    let unit_noise = correlated_noise(
                        draw_seed,
                        comparison.signal_index,
                        comparison.residual.len(),
                        correlation,
                    );
                    let scaled_noise =
                        unit_noise.iter().zip(&noise_sizes).map(|(noise, noise_size)| {
                            NOISE_SD[comparison.signal_index]
                                * noise
                                * (1.0 + noise_growth * (noise_size / rms_noise_size).abs())
                        });
                    comparison.residual = algebra::subtract_mean(scaled_noise.collect()).0;
                }
                // Near the truth the model is linear, so that one step of Gauss and Newton
                // suffices.
                let equations = problem.normal_equations(&comparisons);
                let inverse_normal_matrix = algebra::pseudo_inverse(&equations.normal_matrix);
                let gauss_newton_step: Vec<f64> = inverse_normal_matrix
                    .iter()
                    .map(|row| algebra::dot(row, &equations.rhs))
                    .collect();
                for SignalComparison { residual, slopes, .. } in &mut comparisons {
                    for (slope, parameter_step) in slopes.iter().zip(&gauss_newton_step) {
                        residual.iter_mut().zip(slope).for_each(|(residual_value, slope_value)| {
                            *residual_value -= parameter_step * slope_value
                        });
                    }
                }
                let equations = problem.normal_equations(&comparisons);
                let statistics = Statistics::from_comparisons(&problem, &comparisons, &equations);
                if let Some(objection) = statistics.objection(&problem) {
                    if objection_count == 0 {
                        println!("{objection}");
                    }
                    objection_count += 1;
                }
                for (k, covering_count) in covering_counts.iter_mut().enumerate() {
                    let half_width = statistics.quantiles[k] * statistics.covariance[k][k].sqrt();
                    *covering_count += u64::from(gauss_newton_step[k].abs() < half_width);
                }
                max_quantile = f64::max(max_quantile, statistics.quantiles[0]);
            }
            let coverage = covering_counts.iter().sum::<u64>() as f64
                / (DRAWS * true_numbers.len() as u64) as f64;
            let case_name = format!("{name}, {correlation}, {noise_growth}, {grows_with_envelope}");
            println!(
                "{case_name}: {covering_counts:?} of {DRAWS} hold the truth: {coverage:.3}; \
                 {objection_count} object; quantile up to {max_quantile:.2}"
            );
            assert!(noise_growth > 0.0 || objection_count == 0, "{case_name}: {objection_count}");
            // Correlations are estimated less well than variances. An interval has the greatest
            // width of several estimates, and so may contain the true value in more than 95 % of
            // draws.
            let expected_coverage =
                if correlation > 0.0 || noise_growth > 0.0 { 0.90..=1.0 } else { 0.90..=0.99 };
            assert!(expected_coverage.contains(&coverage), "{case_name}: {covering_counts:?}");
        }
    }
}

#[test]
fn a_linear_model_says_what_the_nonlinear_one_would_have() {
    let cases = vec![case_with_numbers(&VISCOUS_TRUTH, 1.0, read_reference("viscous", 8.0))];
    let linear_options = FitOptions {
        model: ModelKind::Linear.name().to_owned(),
        ..fit_options(&["spring_stiffness_n_per_m"])
    };
    let report = fit_report(cases, &linear_options);
    let expected_text = "the nonlinear model would move spring_stiffness_n_per_m by";
    assert!(
        report.objection.as_ref().is_some_and(|objection| objection.contains(expected_text)),
        "{report:?}"
    );
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
        let cases = vec![case_with_numbers(&VISCOUS_TRUTH, 1.0, measurement)];
        match fit(cases, &fit_options(free), &context) {
            Err(error) => error.to_string(),
            Ok(_) => panic!("{free:?}"),
        }
    };
    let read_short_record = || read_reference("viscous", 1.0);
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
        let message = error_text(free, read_short_record());
        assert!(message.contains(expected_text), "{free:?}: {message}");
    }
    let mut record_from_4_s = read_reference("viscous", 8.0);
    let first_row = record_from_4_s.time_s.partition_point(|time| *time < 4.0);
    let columns = record_from_4_s.signals.iter_mut().map(|signal| &mut signal.values);
    columns
        .chain(&mut record_from_4_s.speed_rpm)
        .for_each(|values| drop(values.drain(..first_row)));
    record_from_4_s.time_s =
        record_from_4_s.time_s[first_row..].iter().map(|time| time - 4.0).collect();
    let message = error_text(&["damping_n_s_per_m"], record_from_4_s);
    assert!(message.contains("viscous.csv begins at 117 rpm"), "{message}");
    let mut sparse_record = read_short_record();
    sparse_record.time_s.truncate(1);
    sparse_record.speed_rpm = None;
    sparse_record.signals.iter_mut().for_each(|signal| signal.values.truncate(1));
    assert!(error_text(&["damping_n_s_per_m"], sparse_record).contains("6 unknowns for 4 samples"));
}

#[test]
fn units_that_are_wrong_and_loads_that_differ_are_seen() {
    let mut degrees_record = read_reference("viscous", 5.0);
    // The signal has degrees, although its name says radians.
    let convert_to_degrees =
        |angles_rad: &mut Vec<f64>| angles_rad.iter_mut().for_each(|angle| *angle *= 57.295_78);
    convert_to_degrees(&mut degrees_record.signals[2].values);
    let mut other_record = read_reference("viscous", 5.0);
    other_record.name = "other".to_owned();
    let mut cases = vec![
        case_with_numbers(&VISCOUS_TRUTH, 1.0, degrees_record),
        case_with_numbers(&VISCOUS_TRUTH, 1.0, other_record),
    ];
    cases[1].plan.model.machine.unbalance.mass_kg = 0.6;
    let mut owned_options = fit_options(&["damping_n_s_per_m"]);
    owned_options.own = vec!["unbalance_mass_kg=0.1:1".to_owned()];
    let report = fit_report(cases, &owned_options);
    let degree_notes: Vec<&String> =
        report.notes.iter().filter(|note| note.contains("degrees")).collect();
    assert!(
        degree_notes.len() == 1 && degree_notes[0].starts_with("tub_yaw_rad of viscous.csv"),
        "{report:?}"
    );
    let [_, first_mass, second_mass] = &report.parameters[..] else { panic!("{report:?}") };
    assert_eq!(first_mass.file.as_deref(), Some("viscous.csv"));
    assert_eq!(second_mass.file.as_deref(), Some("other"));
    assert!((second_mass.value - 0.43).abs() < 0.02, "{}", report.to_text());
}

#[test]
fn records_in_g_are_seen_where_the_search_starts() {
    const STANDARD_GRAVITY_M_PER_S2: f64 = 9.806_65;
    for (unit_factor, expected_part) in [
        (1.0 / STANDARD_GRAVITY_M_PER_S2, "seems to be in g"),
        (STANDARD_GRAVITY_M_PER_S2, "from g once too often"),
    ] {
        let mut measurement = read_reference("viscous_exact", 8.0);
        // Only accelerations are kept, because a fit with large damping makes the accelerations of
        // the model as small as a record in g.
        measurement.signals.truncate(2);
        for signal in &mut measurement.signals {
            signal.values.iter_mut().for_each(|value| *value *= unit_factor);
        }
        let case = case_with_numbers(&VISCOUS_TRUTH, 1.0, measurement);
        let report = fit_report(vec![case], &fit_options(&["damping_n_s_per_m"]));
        let unit_notes = report.notes.iter().filter(|note| note.contains(expected_part));
        assert_eq!(unit_notes.count(), 2, "{report:?}");
    }
}

#[test]
fn a_number_that_does_not_count_at_the_start_is_found_from_others() {
    // Without friction the record does not depend on the friction's speed.
    let start_numbers =
        [("friction_n", 0.0), FRICTION_TRUTH[0], FRICTION_TRUTH[1], FRICTION_TRUTH[2]];
    let make_cases =
        || vec![case_with_numbers(&start_numbers, 1.0, read_reference("friction", 8.0))];
    let mut friction_options =
        fit_options(&["friction_n=0:60", "friction_speed_m_per_s=0.005:0.02"]);
    let context = FitContext {
        cancel: Cancel::Never,
        report_evaluations: &|_| {},
        output: None,
        fresh: false,
    };
    let error = fit(make_cases(), &friction_options, &context).err().unwrap().to_string();
    assert!(error.contains("does not depend on friction_speed_m_per_s"), "{error}");
    friction_options.starts = 6;
    let report = fit_report(make_cases(), &friction_options);
    assert!((report.parameters[0].value / 34.0 - 1.0).abs() < 0.1, "{}", report.to_text());
}

#[test]
fn a_wrong_unit_of_speed_or_time_is_named() {
    let record_in_units = |speed_factor: f64, time_factor: f64| {
        let mut measurement = read_reference("viscous", 8.0);
        let speeds = measurement.speed_rpm.iter_mut().flatten();
        speeds.for_each(|speed| *speed *= speed_factor);
        measurement.time_s.iter_mut().for_each(|time_s| *time_s *= time_factor);
        measurement
    };
    let start_numbers =
        [("unbalance_mass_kg", 0.34), ("damping_n_s_per_m", 120.0), VISCOUS_TRUTH[2]];
    let mass_and_damping_options = fit_options(&["unbalance_mass_kg", "damping_n_s_per_m"]);
    for (speed_factor, time_factor, expected_text) in [
        (std::f64::consts::TAU / 60.0, 1.0, "speed_rpm of viscous.csv seems to be in rad/s"),
        (1.0 / 60.0, 1.0, "speed_rpm of viscous.csv seems to be in Hz"),
        (0.1, 1.0, "speed_rpm of viscous.csv seems to be in tens of rpm"),
        (6.0, 1.0, "speed_rpm of viscous.csv seems to be in degrees per s"),
        (1.0, 1.0 / 60.0, "time_s of viscous.csv seems to be in min"),
        (1.0, 0.1, "time_s of viscous.csv seems to be in tens of s"),
        (1.0, 10.0, "time_s of viscous.csv seems to be in tenths of s"),
    ] {
        let cases = vec![case_with_numbers(
            &start_numbers,
            1.0,
            record_in_units(speed_factor, time_factor),
        )];
        let report = fit_report(cases, &mass_and_damping_options);
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
        // The search ends early in wrong units, after the start and eight further evaluations.
        assert!(report.evaluations < 10, "{expected_text}: {} evaluations", report.evaluations);
        assert!(report.first.explained_ratio.values().all(|ratio| *ratio < 0.25), "{report:?}");
        let suspects_unit = |note: &String| note.contains("it seems to");
        assert!(!report.notes.iter().any(suspects_unit), "{expected_text}: {:?}", report.notes);
    }
    let report = fit_report(
        vec![case_with_numbers(&start_numbers, 1.0, record_in_units(1.0, 1.0))],
        &mass_and_damping_options,
    );
    println!("right units: {:?}", report.first.explained_ratio);
    assert!(report.first.explained_ratio.values().all(|ratio| *ratio > 0.75), "{report:?}");
    // No wrong unit is suspected in a record with the right units, even where the model of another
    // machine does not explain the record.
    let report = fit_report(
        vec![case_with_numbers(&VISCOUS_TRUTH, 0.8, record_in_units(1.0, 1.0))],
        &fit_options(&[start_numbers[0].0]),
    );
    assert!(report.objection.unwrap_or_default().contains("the model explains"));
    assert!(report.suspected_units.is_empty());
}

/// If the speeds are wrong, the model may differ from a signal by the factor of another unit, so
/// that no unit of the signal is suspected besides.
#[test]
fn a_wrong_unit_of_speed_is_no_wrong_unit_of_a_channel() {
    let cases = vec![case_with_numbers(&VISCOUS_TRUTH, 1.0, read_reference("viscous", 3.0))];
    let problem = nonlinear_problem(cases, Vec::new(), false);
    let mut comparisons = problem.compare(&[]).unwrap();
    let yaw_comparison = &mut comparisons[2];
    let yaw_column = problem.cases[0].measurement.signals[2].quantity.column();
    yaw_comparison.model_values.iter_mut().for_each(|value| *value = value.to_radians());
    let equations = problem.normal_equations(&comparisons);
    let statistics = Statistics::from_comparisons(&problem, &comparisons, &equations);
    let is_converged = true;
    let minima = [Descent { x: Vec::new(), equations, evaluations: 1, is_converged }];
    let report_notes = |suspected_unit_by_case: &[Option<String>]| {
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
    let unit_notes = report_notes(&[None]);
    let is_yaw_note = |note: &String| note.starts_with(&yaw_column) && note.contains("in degrees");
    assert!(unit_notes.iter().any(is_yaw_note), "{unit_notes:?}");
    assert!(report_notes(&[Some("speed_rpm seems to be in rad/s".to_owned())]).is_empty());
}

#[test]
fn a_signal_in_white_noise_is_followed() {
    let mut measurement = read_reference("viscous_exact", 8.0);
    measurement.signals.drain(..2);
    for (s, signal) in measurement.signals.iter_mut().enumerate() {
        let noise_sd =
            2.0 * algebra::dot(&signal.centred_values(), &signal.centred_values()).sqrt();
        let scaled_noise_sd = noise_sd / (signal.values.len() as f64).sqrt();
        let noise_values = correlated_noise(3, s, signal.values.len(), 0.0);
        signal
            .values
            .iter_mut()
            .zip(noise_values)
            .for_each(|(value, z)| *value += scaled_noise_sd * z);
    }
    let report = fit_report(
        vec![case_with_numbers(&VISCOUS_TRUTH, 0.9, measurement)],
        &fit_options(&["unbalance_mass_kg"]),
    );
    assert!(report.first.explained_ratio.values().all(|ratio| *ratio < 0.5), "{report:?}");
    assert!(report.follows, "{}", report.to_text());
    assert!(
        compute_standardised_errors(&report, &VISCOUS_TRUTH)[0].abs() < 3.0,
        "{}",
        report.to_text()
    );
}

#[test]
fn a_start_that_is_far_off_is_no_wrong_unit() {
    let start_numbers = [("unbalance_mass_kg", 0.043), VISCOUS_TRUTH[1], VISCOUS_TRUTH[2]];
    let cases = vec![case_with_numbers(&start_numbers, 1.0, read_reference("viscous", 8.0))];
    let report = fit_report(cases, &fit_options(&["unbalance_mass_kg"]));
    assert!(report.follows && report.notes.is_empty(), "{report:?}");
}

#[test]
fn an_interrupted_fit_goes_on_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let machine_file_path = folder.path().join("x.toml");
    let partial_folder = folder.path().join("x.toml.partial");
    let make_cases =
        || vec![case_with_numbers(&VISCOUS_TRUTH, 0.9, read_reference("viscous", 3.0))];
    let two_number_options = fit_options(&["damping_n_s_per_m", "unbalance_mass_kg"]);
    let uninterrupted_report = fit_report(make_cases(), &two_number_options);
    let evaluation_count = AtomicUsize::new(0);
    let count_evaluation = |_| {
        evaluation_count.fetch_add(1, Ordering::Relaxed);
    };
    let is_requested = || evaluation_count.load(Ordering::Relaxed) >= 3;
    let context = FitContext {
        cancel: Cancel::When(&is_requested),
        report_evaluations: &count_evaluation,
        output: Some(&machine_file_path),
        fresh: false,
    };
    assert!(fit(make_cases(), &two_number_options, &context).unwrap().is_none());
    let part_file = ParquetFile::open(&partial_folder.join("part-00000000.parquet")).unwrap();
    // The start is evaluated once, although each descent begins with it.
    assert_eq!(part_file.rows(), 2);
    let fields = part_file.schema().fields().iter().take(4).map(|field| field.name().as_str());
    let expected_names = ["damping_n_s_per_m", "unbalance_mass_kg", "file_1_shift_s", "cost"];
    assert_eq!(fields.collect::<Vec<_>>(), expected_names);

    // A fit with other options does not change stored evaluations.
    let context = FitContext {
        cancel: Cancel::When(&|| true),
        report_evaluations: &|_| {},
        output: Some(&machine_file_path),
        fresh: false,
    };
    let options_without_shift = FitOptions { no_shift: true, ..two_number_options.clone() };
    let error = fit(make_cases(), &options_without_shift, &context).err().unwrap().to_string();
    assert!(error.contains("/fit/shift: was true, is false"), "{error}");

    let evaluation_count = AtomicUsize::new(0);
    let count_evaluation = |_| {
        evaluation_count.fetch_add(1, Ordering::Relaxed);
    };
    let context = FitContext {
        cancel: Cancel::Never,
        report_evaluations: &count_evaluation,
        output: Some(&machine_file_path),
        fresh: false,
    };
    let resumed_fit = fit(make_cases(), &two_number_options, &context).unwrap().unwrap();
    assert_eq!(serde_json::json!(resumed_fit.report), serde_json::json!(uninterrupted_report));
    let error_while_open =
        fit(make_cases(), &two_number_options, &context).err().unwrap().to_string();
    assert!(error_while_open.contains("is in use by process"), "{error_while_open}");
    assert_eq!(resumed_fit.evaluations.unwrap().complete(), None);
    assert!(!partial_folder.exists());
}

#[test]
fn a_damaged_part_of_a_fit_costs_its_evaluations() {
    let folder = tempfile::tempdir().unwrap();
    let machine_file_path = folder.path().join("x.toml");
    let part_path = folder.path().join("x.toml.partial/part-00000000.parquet");
    let make_cases =
        || vec![case_with_numbers(&VISCOUS_TRUTH, 0.9, read_reference("viscous", 3.0))];
    let damping_options = fit_options(&["damping_n_s_per_m"]);
    let uninterrupted_report = fit_report(make_cases(), &damping_options);
    let run_fit = || {
        let context = FitContext {
            cancel: Cancel::Never,
            report_evaluations: &|_| {},
            output: Some(&machine_file_path),
            fresh: false,
        };
        fit(make_cases(), &damping_options, &context).unwrap().unwrap()
    };
    drop(run_fit());
    let undamaged_bytes = std::fs::read(&part_path).unwrap();
    let mut damaged_bytes = undamaged_bytes.clone();
    damaged_bytes[undamaged_bytes.len() / 2] ^= 1;
    std::fs::write(&part_path, damaged_bytes).unwrap();
    let repeated_fit = run_fit();
    assert_eq!(serde_json::json!(repeated_fit.report), serde_json::json!(uninterrupted_report));
    assert!(part_path.with_extension("parquet.damaged").exists());
    let note = repeated_fit.evaluations.unwrap().complete().unwrap();
    assert!(note.contains("part-00000000.parquet.damaged"), "{note}");
}

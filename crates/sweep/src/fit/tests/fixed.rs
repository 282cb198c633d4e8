//! Fits whose fixed numbers have errors, and the tolerances of fixed numbers.

use super::*;
use lane_ode::Cancel;

#[test]
fn intervals_count_what_the_fixed_numbers_may_be_off() {
    // The machine file's radius of the unbalance is 5 % larger than that of the record.
    let mut case = case_with_numbers(&VISCOUS_TRUTH, 0.95, read_reference("viscous", 8.0));
    case.plan.model.machine.unbalance.radius_m *= 1.05;
    let radius_m = case.plan.model.machine.unbalance.radius_m;
    let names: Vec<&str> = VISCOUS_TRUTH.iter().map(|(name, _)| *name).collect();
    let report_of_exact_numbers = fit_report(vec![case.clone()], &fit_options(&names));
    assert!(
        report_of_exact_numbers.follows
            && report_of_exact_numbers.to_text().contains("fixed numbers are taken as exact")
    );
    assert!(
        compute_standardised_errors(&report_of_exact_numbers, &VISCOUS_TRUTH)[0].abs() > 10.0,
        "{}",
        report_of_exact_numbers.to_text()
    );
    let options_with_known = |known: &[&str]| {
        let known_texts = known.iter().map(|text| (*text).to_owned()).collect();
        FitOptions { known: known_texts, ..fit_options(&names) }
    };
    for options in [options_with_known(&[]), options_with_known(&["none", "unbalance_radius_m=5%"])]
    {
        let report = fit_report(vec![case.clone()], &options);
        let mass_fit = &report.parameters[0];
        assert!(
            compute_standardised_errors(&report, &VISCOUS_TRUTH)
                .iter()
                .all(|error| error.abs() < 3.0),
            "{}",
            report.to_text()
        );
        assert_eq!(mass_fit.value, report_of_exact_numbers.parameters[0].value);
        assert_eq!(mass_fit.noise_error, report_of_exact_numbers.parameters[0].standard_error);
        let dependence = mass_fit.depends_on.as_ref().unwrap();
        // The record determines only the product of mass and radius.
        assert_eq!(dependence.name, "unbalance_radius_m", "{}", report.to_text());
        let relative_effect_ratio =
            dependence.moves_by.abs() / mass_fit.value / (dependence.error / radius_m);
        println!("{}: {dependence:?}", report.fixed_numbers);
        assert!(
            (relative_effect_ratio - 1.0).abs() < 0.1 && dependence.error <= dependence.tolerance,
            "{}",
            report.to_text()
        );
        assert!(mass_fit.standard_error.unwrap() < 0.08 * mass_fit.value, "{}", report.to_text());
        assert_eq!(report.fixed_numbers == 1, !options.known.is_empty());
        let text = report.to_text();
        assert!(text.contains("unbalance_mass_kg on unbalance_radius_m: an error of"), "{text}");
    }
}

/// With the fixed number among the unknowns and its tolerance as a prior, the inverse of the normal
/// matrix is the posterior covariance, and a step of Gauss and Newton's leads to the mean.
#[test]
fn tolerances_are_the_prior_of_an_unknown() {
    let mut case = case_with_numbers(&VISCOUS_TRUTH, 0.95, read_reference("viscous", 8.0));
    case.plan.model.machine.unbalance.radius_m *= 1.05;
    let radius_m = case.plan.model.machine.unbalance.radius_m;
    let mut names: Vec<&str> = VISCOUS_TRUTH.iter().map(|(name, _)| *name).collect();
    let cases = vec![case];
    let context = FitContext {
        cancel: Cancel::Never,
        report_evaluations: &|_| {},
        output: None,
        fresh: false,
    };
    let finished_fit = fit(cases.clone(), &fit_options(&names), &context).unwrap().unwrap();
    let FinishedFit { problem, mut x, comparisons, .. } = finished_fit;
    let equations = problem.normal_equations(&comparisons);
    let variances: Vec<f64> = equations.sigma.iter().map(|sigma| sigma * sigma).collect();
    let known_texts = ["none", "unbalance_radius_m=5%"].map(str::to_owned);
    let fixed_numbers =
        FixedNumbers::read(&known_texts, &cases[0], &problem.free_parameters).unwrap();
    let influences = fixed_numbers.influences(&problem, &x, &comparisons, &equations, &variances);
    let radius_index = names.len();
    names.push("unbalance_radius_m");
    x.insert(radius_index, radius_m);
    let free = read_free_parameters(&fit_options(&names), &cases).unwrap();
    let Problem { model_kind: model, fits_shift, method, simd, cancel, .. } = problem;
    let joint_problem = Problem {
        cases,
        free_parameters: free,
        model_kind: model,
        fits_shift,
        method,
        simd,
        cancel,
    };
    let NormalEquations { normal_matrix: mut normal, rhs, .. } =
        joint_problem.normal_equations(&joint_problem.compare(&x).unwrap());
    normal[radius_index][radius_index] += 1.0 / (0.05 * radius_m).powi(2);
    let joint_covariance = algebra::pseudo_inverse(&normal);
    let joint_step: Vec<f64> = joint_covariance.iter().map(|row| algebra::dot(row, &rhs)).collect();
    let radius_influence = &influences.numbers[0];
    println!("{radius_m} m: moved by {joint_step:?}, {radius_influence:?}");
    assert!(
        (radius_influence.error / joint_covariance[radius_index][radius_index].sqrt() - 1.0).abs()
            < 0.01,
        "{radius_influence:?}"
    );
    let noise_covariance = algebra::pseudo_inverse(&equations.normal_matrix);
    let unknown_indices: Vec<usize> = (0..x.len()).filter(|k| *k != radius_index).collect();
    for (i, &row) in unknown_indices.iter().enumerate() {
        let joint_error = |k: usize| joint_covariance[k][k].sqrt();
        for (j, &column) in unknown_indices.iter().enumerate() {
            let approximate_covariance =
                noise_covariance[i][j] + radius_influence.effects[i] * radius_influence.effects[j];
            let covariance_difference = (approximate_covariance - joint_covariance[row][column])
                / (joint_error(row) * joint_error(column));
            assert!(
                covariance_difference.abs() < 0.01,
                "{row}, {column}: {approximate_covariance}, {joint_covariance:?}"
            );
        }
        let squared_effect = influences.covariance[i][i] - radius_influence.effects[i].powi(2);
        let effect_difference =
            (squared_effect.max(0.0).sqrt() - joint_step[row].abs()) / joint_error(row);
        assert!(effect_difference.abs() < 0.05, "{row}: {squared_effect}, {joint_step:?}");
    }
}

/// A fixed number whose effect on the record differs from those of the free numbers widens
/// intervals at most by the error that the record leaves it.
#[test]
fn the_record_limits_errors_of_fixed_numbers() {
    let names = ["unbalance_mass_kg", "damping_n_s_per_m"];
    let report_with_tolerance = |tolerance_text: &str| {
        let known_texts = vec!["none".to_owned(), tolerance_text.to_owned()];
        let options = FitOptions { known: known_texts, ..fit_options(&names) };
        fit_report(
            vec![case_with_numbers(&VISCOUS_TRUTH, 1.0, read_reference("viscous", 8.0))],
            &options,
        )
    };
    let [narrow_report, wide_report] = [
        report_with_tolerance("spring_1_stiffness_n_per_m=5%"),
        report_with_tolerance("spring_1_stiffness_n_per_m=20%"),
    ];
    let damping_dependence_error =
        |report: &FitReport| report.parameters[1].depends_on.as_ref().unwrap().error;
    assert!(
        damping_dependence_error(&narrow_report) < 0.02 * 8350.0,
        "{}",
        narrow_report.to_text()
    );
    assert!(
        (damping_dependence_error(&wide_report) / damping_dependence_error(&narrow_report) - 1.0)
            .abs()
            < 0.1,
        "{}",
        wide_report.to_text()
    );
    assert!(wide_report.to_text().contains("the record limits it"), "{}", wide_report.to_text());
}

#[test]
fn a_gain_moves_the_estimates_that_it_scales() {
    let known_texts = ["none", "gain=3%"].map(str::to_owned).to_vec();
    let options = FitOptions { known: known_texts, ..fit_options(&["unbalance_mass_kg"]) };
    let mut measurement = read_reference("viscous", 8.0);
    measurement.signals.truncate(1);
    let report = fit_report(vec![case_with_numbers(&VISCOUS_TRUTH, 1.0, measurement)], &options);
    let mass_fit = &report.parameters[0];
    let gain_dependence = mass_fit.depends_on.as_ref().unwrap();
    assert_eq!(gain_dependence.name, "gain of tub_front_y_m_per_s2");
    assert!(
        (gain_dependence.moves_by.abs() / mass_fit.value / 0.03 - 1.0).abs() < 0.2,
        "{}",
        report.to_text()
    );
}

#[test]
fn tolerances_that_mean_nothing_are_refused_with_their_place() {
    let cases = [case_with_numbers(&VISCOUS_TRUTH, 1.0, read_reference("viscous", 1.0))];
    let free = read_free_parameters(&fit_options(&["spring_stiffness_n_per_m"]), &cases).unwrap();
    let read_tolerance = |text: &str| FixedNumbers::read(&[text.to_owned()], &cases[0], &free);
    for (text, expected_part) in [
        ("tub_mass_kg", "has no tolerance"),
        ("tub_mass_kg=much", "is no tolerance"),
        ("tub_mass_kg=-2%", "is no tolerance"),
        ("tub_mas_kg=2%", "`tub_mas_kg` has no tolerance"),
        ("spring_1_stiffness_n_per_m=2%", "is free"),
        ("spin_ramp_s=2%", "`spin_ramp_s`"),
        ("window_to_s=2%", "no number of the machine"),
        ("friction_n=2%", "`friction_n` is 0"),
        ("gain=0.1", "a gain's tolerance"),
    ] {
        let message = read_tolerance(text).unwrap_err().to_string();
        assert!(
            message.contains(expected_part) && message.contains("--known"),
            "{text}: {message}"
        );
    }
    for text in ["tub_mass_kg=2%", "tub_mass_kg=0.5", "damping_n_s_per_m= 10 %", "gain=1%"] {
        assert!(read_tolerance(text).is_ok(), "{text}");
    }
}

#[test]
#[ignore = "two minutes; run by tests_with_tools"]
fn intervals_hold_the_truth_as_often_as_the_fixed_numbers_are_known() {
    const DRAWS: u64 = 40;
    const FIXED_TOLERANCES: [(&str, f64); 4] = [
        ("tub_mass_kg", 0.02),
        ("unbalance_radius_m", 0.05),
        ("tub_inertia_22_kg_m2", 0.05),
        ("shaft_mass_kg", 0.02),
    ];
    let names: Vec<&str> = VISCOUS_TRUTH.iter().map(|(name, _)| *name).collect();
    let mut known_texts = ["none", "gain=3%"].map(str::to_owned).to_vec();
    known_texts.extend(FIXED_TOLERANCES.map(|(name, ratio)| format!("{name}={}%", 100.0 * ratio)));
    let options_with_known = FitOptions { known: known_texts, ..fit_options(&names) };
    let options_with_defaults = FitOptions { known: Vec::new(), ..fit_options(&names) };
    let mut covering_counts = vec![0; VISCOUS_TRUTH.len()];
    let mut covering_counts_of_noise = vec![0; VISCOUS_TRUTH.len()];
    let mut covering_counts_of_defaults = vec![0; VISCOUS_TRUTH.len()];
    let mut width_sums = vec![[0.0; 3]; VISCOUS_TRUTH.len()];
    let mut greatest_error_ratio = 0.0_f64;
    let mut following_count = 0;
    for draw in 0..DRAWS {
        let draw_seed = DRAWS * seed_from_environment() + draw;
        let mut measurement = read_reference("viscous_exact", 8.0);
        let fixed_number_errors = correlated_noise(draw_seed, 20, FIXED_TOLERANCES.len(), 0.0);
        let gain_errors = correlated_noise(draw_seed, 21, measurement.signals.len(), 0.0);
        for (s, signal) in measurement.signals.iter_mut().enumerate() {
            let noise_values = correlated_noise(draw_seed, s, signal.values.len(), 0.0);
            let gain = 1.0 + 0.03 * gain_errors[s];
            for (value, z) in signal.values.iter_mut().zip(noise_values) {
                *value = gain * *value + NOISE_SD[s] * z;
            }
        }
        // The fixed numbers in the machine file have random errors within their tolerances.
        let mut case = case_with_numbers(&VISCOUS_TRUTH, 0.97, measurement);
        let mut spin = case.plan.model.spin.clone();
        for ((name, ratio), error) in FIXED_TOLERANCES.iter().zip(&fixed_number_errors) {
            let machine = &mut case.plan.model.machine;
            let parameter = MachineParameter::find(name, machine, &spin).unwrap();
            let value = parameter.get(machine, &spin).unwrap();
            parameter.set(machine, &mut spin, value * (1.0 + ratio * error));
        }
        let default_report = fit_report(vec![case.clone()], &options_with_defaults);
        let tolerance_report = fit_report(vec![case], &options_with_known);
        // A model with large errors may not follow the record, and then the report has no
        // intervals.
        following_count += usize::from(tolerance_report.follows);
        let parameter_fits =
            tolerance_report.parameters.iter().zip(&default_report.parameters).zip(VISCOUS_TRUTH);
        for (k, ((fit, default_fit), (_, true_value))) in parameter_fits.enumerate() {
            let Some([interval_from, interval_to]) = fit.interval_95 else { continue };
            let [default_from, default_to] = default_fit.interval_95.unwrap();
            let noise_error = fit.noise_error.unwrap();
            let estimate_error = (fit.value - true_value).abs();
            greatest_error_ratio = greatest_error_ratio.max(estimate_error / noise_error);
            covering_counts[k] += usize::from((interval_from..=interval_to).contains(&true_value));
            covering_counts_of_defaults[k] +=
                usize::from((default_from..=default_to).contains(&true_value));
            covering_counts_of_noise[k] += usize::from(estimate_error <= 1.96 * noise_error);
            let half_widths = [
                1.96 * noise_error,
                0.5 * (interval_to - interval_from),
                0.5 * (default_to - default_from),
            ];
            width_sums[k]
                .iter_mut()
                .zip(half_widths)
                .for_each(|(sum, width)| *sum += width / true_value);
        }
    }
    println!(
        "{following_count} of {DRAWS} follow; hold the truth: {covering_counts:?}, by defaults \
         {covering_counts_of_defaults:?}, by noise {covering_counts_of_noise:?}; at most \
         {greatest_error_ratio:.0} standard errors off"
    );
    let mean_percent = |sum: &f64| 100.0 * sum / following_count as f64;
    for ((name, _), width_sums_of_parameter) in VISCOUS_TRUTH.iter().zip(&width_sums) {
        let mean_widths: Vec<f64> = width_sums_of_parameter.iter().map(mean_percent).collect();
        println!("{name}: half widths by noise, tolerances and defaults {mean_widths:.2?} %");
    }
    let total_covering_count: usize = covering_counts.iter().sum();
    let coverage = |counts: &[usize]| {
        counts.iter().sum::<usize>() as f64 / (following_count * VISCOUS_TRUTH.len()) as f64
    };
    assert!(following_count >= 3 && coverage(&covering_counts) >= 0.8, "{covering_counts:?}");
    assert!(coverage(&covering_counts_of_defaults) >= 0.9, "{covering_counts_of_defaults:?}");
    assert!(
        5 * covering_counts_of_noise.iter().sum::<usize>() < 4 * total_covering_count,
        "{covering_counts_of_noise:?}"
    );
}

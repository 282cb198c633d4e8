//! Fits whose fixed numbers are off, and the tolerances of these.

use super::*;
use lane_ode::Cancel;

#[test]
fn intervals_count_what_the_fixed_numbers_may_be_off() {
    // The record is of an unbalance farther out than the machine file says.
    let mut case = case_at(&VISCOUS, 0.95, reference("viscous", 8.0));
    case.plan.model.machine.unbalance.radius_m *= 1.05;
    let radius_m = case.plan.model.machine.unbalance.radius_m;
    let names: Vec<&str> = VISCOUS.iter().map(|(name, _)| *name).collect();
    let exact = fitted(vec![case.clone()], &options(&names));
    assert!(exact.follows && exact.to_text().contains("fixed numbers are taken as exact"));
    assert!(standardised_errors(&exact, &VISCOUS)[0].abs() > 10.0, "{}", exact.to_text());
    let assert_dependence = |known: &[&str]| {
        let known = known.iter().map(|text| (*text).to_owned()).collect();
        FitOptions { known, ..options(&names) }
    };
    for options in [assert_dependence(&[]), assert_dependence(&["none", "unbalance_radius_m=5%"])] {
        let report = fitted(vec![case.clone()], &options);
        let mass = &report.parameters[0];
        assert!(
            standardised_errors(&report, &VISCOUS).iter().all(|error| error.abs() < 3.0),
            "{}",
            report.to_text()
        );
        assert_eq!(mass.value, exact.parameters[0].value);
        assert_eq!(mass.noise_error, exact.parameters[0].standard_error);
        let dependence = mass.depends_on.as_ref().unwrap();
        // Mass times radius shakes.
        assert_eq!(dependence.name, "unbalance_radius_m", "{}", report.to_text());
        let ratio = dependence.moves_by.abs() / mass.value / (dependence.error / radius_m);
        println!("{}: {dependence:?}", report.fixed_numbers);
        assert!(
            (ratio - 1.0).abs() < 0.1 && dependence.error <= dependence.tolerance,
            "{}",
            report.to_text()
        );
        assert!(mass.standard_error.unwrap() < 0.08 * mass.value, "{}", report.to_text());
        assert_eq!(report.fixed_numbers == 1, !options.known.is_empty());
        let text = report.to_text();
        assert!(text.contains("unbalance_mass_kg on unbalance_radius_m: an error of"), "{text}");
    }
}

/// With the fixed number among the unknowns and its tolerance as a prior, the inverse of the normal
/// matrix is the posterior covariance, and a step of Gauss and Newton's leads to the mean.
#[test]
fn tolerances_are_the_prior_of_an_unknown() {
    let mut case = case_at(&VISCOUS, 0.95, reference("viscous", 8.0));
    case.plan.model.machine.unbalance.radius_m *= 1.05;
    let radius_m = case.plan.model.machine.unbalance.radius_m;
    let mut names: Vec<&str> = VISCOUS.iter().map(|(name, _)| *name).collect();
    let cases = vec![case];
    let context = FitContext {
        cancel: Cancel::Never,
        report_evaluations: &|_| {},
        output: None,
        fresh: false,
    };
    let fitted = fit(cases.clone(), &options(&names), &context).unwrap().unwrap();
    let FinishedFit { problem, mut x, comparisons, .. } = fitted;
    let equations = problem.normal_equations(&comparisons);
    let variances: Vec<f64> = equations.sigma.iter().map(|sigma| sigma * sigma).collect();
    let known = ["none", "unbalance_radius_m=5%"].map(str::to_owned);
    let known = FixedNumbers::read(&known, &cases[0], &problem.free).unwrap();
    let influences = known.influences(&problem, &x, &comparisons, &equations, &variances);
    let radius = names.len();
    names.push("unbalance_radius_m");
    x.insert(radius, radius_m);
    let free = read_free_parameters(&options(&names), &cases).unwrap();
    let Problem { model, fits_shift, method, simd, cancel, .. } = problem;
    let joint = Problem { cases, free, model, fits_shift, method, simd, cancel };
    let NormalEquations { mut normal, rhs, .. } =
        joint.normal_equations(&joint.compare(&x).unwrap());
    normal[radius][radius] += 1.0 / (0.05 * radius_m).powi(2);
    let covariance = algebra::pseudo_inverse(&normal);
    let moved: Vec<f64> = covariance.iter().map(|row| algebra::dot(row, &rhs)).collect();
    let number = &influences.numbers[0];
    println!("{radius_m} m: moved by {moved:?}, {number:?}");
    assert!((number.error / covariance[radius][radius].sqrt() - 1.0).abs() < 0.01, "{number:?}");
    let by_noise = algebra::pseudo_inverse(&equations.normal);
    let unknowns: Vec<usize> = (0..x.len()).filter(|k| *k != radius).collect();
    for (i, &row) in unknowns.iter().enumerate() {
        let error = |k: usize| covariance[k][k].sqrt();
        for (j, &column) in unknowns.iter().enumerate() {
            let ours = by_noise[i][j] + number.effects[i] * number.effects[j];
            let off = (ours - covariance[row][column]) / (error(row) * error(column));
            assert!(off.abs() < 0.01, "{row}, {column}: {ours}, {covariance:?}");
        }
        let square = influences.covariance[i][i] - number.effects[i].powi(2);
        let off = (square.max(0.0).sqrt() - moved[row].abs()) / error(row);
        assert!(off.abs() < 0.05, "{row}: {square}, {moved:?}");
    }
}

/// A number that the record tells from all free ones widens intervals no farther than it leaves the
/// number open.
#[test]
fn the_record_limits_errors_of_fixed_numbers() {
    let names = ["unbalance_mass_kg", "damping_n_s_per_m"];
    let with = |known: &str| {
        let known = vec!["none".to_owned(), known.to_owned()];
        let options = FitOptions { known, ..options(&names) };
        fitted(vec![case_at(&VISCOUS, 1.0, reference("viscous", 8.0))], &options)
    };
    let [narrow, wide] =
        [with("spring_1_stiffness_n_per_m=5%"), with("spring_1_stiffness_n_per_m=20%")];
    let error = |report: &FitReport| report.parameters[1].depends_on.as_ref().unwrap().error;
    assert!(error(&narrow) < 0.02 * 8350.0, "{}", narrow.to_text());
    assert!((error(&wide) / error(&narrow) - 1.0).abs() < 0.1, "{}", wide.to_text());
    assert!(wide.to_text().contains("the record limits it"), "{}", wide.to_text());
}

#[test]
fn a_gain_moves_the_estimates_that_it_scales() {
    let known = ["none", "gain=3%"].map(str::to_owned).to_vec();
    let options = FitOptions { known, ..options(&["unbalance_mass_kg"]) };
    let mut measurement = reference("viscous", 8.0);
    measurement.signals.truncate(1);
    let report = fitted(vec![case_at(&VISCOUS, 1.0, measurement)], &options);
    let mass = &report.parameters[0];
    let on = mass.depends_on.as_ref().unwrap();
    assert_eq!(on.name, "gain of tub_front_y_m_per_s2");
    assert!((on.moves_by.abs() / mass.value / 0.03 - 1.0).abs() < 0.2, "{}", report.to_text());
}

#[test]
fn tolerances_that_mean_nothing_are_refused_with_their_place() {
    let cases = [case_at(&VISCOUS, 1.0, reference("viscous", 1.0))];
    let free = read_free_parameters(&options(&["spring_stiffness_n_per_m"]), &cases).unwrap();
    let read = |text: &str| FixedNumbers::read(&[text.to_owned()], &cases[0], &free);
    for (text, said) in [
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
        let message = read(text).unwrap_err().to_string();
        assert!(message.contains(said) && message.contains("--known"), "{text}: {message}");
    }
    for text in ["tub_mass_kg=2%", "tub_mass_kg=0.5", "damping_n_s_per_m= 10 %", "gain=1%"] {
        assert!(read(text).is_ok(), "{text}");
    }
}

#[test]
#[ignore = "two minutes; run by tests_with_tools"]
fn intervals_hold_the_truth_as_often_as_the_fixed_numbers_are_known() {
    const DRAWS: u64 = 40;
    const FIXED: [(&str, f64); 4] = [
        ("tub_mass_kg", 0.02),
        ("unbalance_radius_m", 0.05),
        ("tub_inertia_22_kg_m2", 0.05),
        ("shaft_mass_kg", 0.02),
    ];
    let names: Vec<&str> = VISCOUS.iter().map(|(name, _)| *name).collect();
    let mut known = ["none", "gain=3%"].map(str::to_owned).to_vec();
    known.extend(FIXED.map(|(name, ratio)| format!("{name}={}%", 100.0 * ratio)));
    let with_known = FitOptions { known, ..options(&names) };
    let with_defaults = FitOptions { known: Vec::new(), ..options(&names) };
    let mut held = vec![0; VISCOUS.len()];
    let mut held_without = vec![0; VISCOUS.len()];
    let mut held_by_defaults = vec![0; VISCOUS.len()];
    let mut widths = vec![[0.0; 3]; VISCOUS.len()];
    let mut farthest = 0.0_f64;
    let mut following = 0;
    for draw in 0..DRAWS {
        let draw = DRAWS * seed() + draw;
        let mut measurement = reference("viscous_exact", 8.0);
        let errors = noise(draw, 20, FIXED.len(), 0.0);
        let gains = noise(draw, 21, measurement.signals.len(), 0.0);
        for (s, signal) in measurement.signals.iter_mut().enumerate() {
            let noise = noise(draw, s, signal.values.len(), 0.0);
            let gain = 1.0 + 0.03 * gains[s];
            for (value, z) in signal.values.iter_mut().zip(noise) {
                *value = gain * *value + NOISE[s] * z;
            }
        }
        // The machine file is off, as seen from the record.
        let mut case = case_at(&VISCOUS, 0.97, measurement);
        let mut spin = case.plan.model.spin.clone();
        for ((name, ratio), error) in FIXED.iter().zip(&errors) {
            let machine = &mut case.plan.model.machine;
            let parameter = MachineParameter::find(name, machine, &spin).unwrap();
            let value = parameter.get(machine, &spin).unwrap();
            parameter.set(machine, &mut spin, value * (1.0 + ratio * error));
        }
        let by_defaults = fitted(vec![case.clone()], &with_defaults);
        let report = fitted(vec![case], &with_known);
        // A machine that is far off may not follow, and then has no intervals to be wrong.
        following += usize::from(report.follows);
        let fits = report.parameters.iter().zip(&by_defaults.parameters).zip(VISCOUS);
        for (k, ((fit, by_defaults), (_, truth))) in fits.enumerate() {
            let Some([from, to]) = fit.interval_95 else { continue };
            let [default_from, default_to] = by_defaults.interval_95.unwrap();
            let noise_error = fit.noise_error.unwrap();
            let off = (fit.value - truth).abs();
            farthest = farthest.max(off / noise_error);
            held[k] += usize::from((from..=to).contains(&truth));
            held_by_defaults[k] += usize::from((default_from..=default_to).contains(&truth));
            held_without[k] += usize::from(off <= 1.96 * noise_error);
            let all = [1.96 * noise_error, 0.5 * (to - from), 0.5 * (default_to - default_from)];
            widths[k].iter_mut().zip(all).for_each(|(sum, width)| *sum += width / truth);
        }
    }
    println!(
        "{following} of {DRAWS} follow; hold the truth: {held:?}, by defaults \
         {held_by_defaults:?}, by noise {held_without:?}; at most {farthest:.0} standard errors off"
    );
    let mean = |sum: &f64| 100.0 * sum / following as f64;
    for ((name, _), widths) in VISCOUS.iter().zip(&widths) {
        let widths: Vec<f64> = widths.iter().map(mean).collect();
        println!("{name}: half widths by noise, tolerances and defaults {widths:.2?} %");
    }
    let all: usize = held.iter().sum();
    let share =
        |held: &[usize]| held.iter().sum::<usize>() as f64 / (following * VISCOUS.len()) as f64;
    assert!(following >= 3 && share(&held) >= 0.8, "{held:?}");
    assert!(share(&held_by_defaults) >= 0.9, "{held_by_defaults:?}");
    assert!(5 * held_without.iter().sum::<usize>() < 4 * all, "{held_without:?}");
}

//! Tests of a page's checked points, which have the levels, errors and bits of the program's rows.

use washer_row::{Criterion, Outcome, Status};

use super::*;

const GRID: &str = r#"
name = "live"
spin = { profile = "triangular", peak_rpm = 350, ramp_s = 50 }
time = { end_s = 50, window_s = [30, 50] }
[[axis]]
parameter = "unbalance_mass_kg"
values = [0.1, 0.4, 0.95]
[[axis]]
parameter = "damping_n_s_per_m"
values = [60, 180, 300]
"#;

fn load_plan(text: &str) -> Plan {
    WasherGridInput::text("live", text.to_owned(), Vec::new()).load().unwrap()
}

/// Asserts that a checked point of a page is a row of the program.
fn assert_point_is_row(outcome: &Outcome, setup: &Setup, values: &[f64]) {
    let checked_point = washer_live::check_point(setup, values).unwrap();
    let errors = checked_point.errors[0].zip(checked_point.errors[1]).map(|(a, b)| a.max(b));
    assert_eq!(errors, outcome.error, "{values:?}");
    assert_eq!(checked_point.method_kinds[0], outcome.method, "{values:?}");
    assert_eq!((checked_point.outcome, values), (Outcome { point: 0, ..outcome.clone() }, values));
    for (amplitudes, run) in
        checked_point.amplitudes.iter().zip([&outcome.nonlinear, &outcome.linear])
    {
        let channels = setup.rule.channels.iter();
        let amplitudes: Vec<f64> = channels.map(|channel| amplitudes[channel.index()]).collect();
        if run.status == Status::Ok {
            assert_eq!(amplitudes, run.amplitudes, "{values:?}");
        }
    }
}

#[test]
fn a_checked_point_is_the_row_of_the_map() {
    let plan = load_plan(GRID);
    let (setup, _) = build_setup(&plan, &usual_sliders(&plan)).unwrap();
    // A page reads its setup from numbers, so the test does, too.
    let setup = Setup::from_numbers(&setup.to_numbers()).unwrap();
    let engine = ModelEngine::new(&plan).unwrap();
    // The first point converges at once, the second late, and the third is chaotic.
    for values in [[0.1, 300.0], [0.4, 180.0], [0.95, 180.0]] {
        let outcomes = engine.outcomes_at(&[values.to_vec()]);
        assert_point_is_row(&outcomes[0], &setup, &values);
    }
}

#[test]
fn every_criterion_and_metric_is_the_rows() {
    let further_keys = r#"
metrics = ["static_sag", "cabinet_force", "clash_time", "growth"]
reliability = { criterion = "CRITERION" }
stability = { speed_rpm = "200:240:20" }
"#;
    for criterion in ["rms", "envelope"] {
        let further_keys_of_criterion = further_keys.replace("CRITERION", criterion);
        let mut plan = load_plan(&(further_keys_of_criterion + GRID));
        assert_eq!(take_held_metrics(&mut plan), (vec![200.0, 220.0, 240.0], vec![Metric::Growth]));
        let (setup, _) = build_setup(&plan, &[]).unwrap();
        let setup = Setup::from_numbers(&setup.to_numbers()).unwrap();
        let engine = ModelEngine::new(&plan).unwrap();
        let values = [0.95, 300.0];
        let outcome = &engine.outcomes_at(&[values.to_vec()])[0];
        assert_eq!(outcome.linear.metrics.len(), 2);
        assert!(outcome.static_sag_m > Some(0.0));
        assert_point_is_row(outcome, &setup, &values);
        let checked_point = washer_live::check_point(&setup, &values).unwrap();
        let verdict = &outcome.verdict;
        // The page has the ratios by turn of every channel.
        let turn_ratios = checked_point.outcome.turn_ratios;
        assert!(criterion == "rms" || turn_ratios == verdict.ratios);
        let ratios =
            setup.rule.channels.iter().map(|channel| checked_point.ratios[channel.index()]);
        assert_eq!(ratios.collect::<Vec<_>>(), verdict.ratios, "{criterion}");
    }
}

#[test]
fn motions_of_held_speeds_are_the_rows() {
    let further_keys = "metrics = [\"dwell\"]\nstability = { speed_rpm = \"240,250\" }\n";
    let mut plan = load_plan(&(further_keys.to_owned() + GRID));
    let values = [0.4, 140.0];
    let outcome = &ModelEngine::new(&plan).unwrap().outcomes_at(&[values.to_vec()])[0];
    let (speeds_rpm, metrics) = take_held_metrics(&mut plan);
    assert_eq!(metrics, [Metric::Dwell]);
    let (setup, _) = build_setup(&plan, &[]).unwrap();
    assert!(outcome.dwell_peaks.is_some());
    assert_eq!(
        washer_live::find_largest_attractor(&setup, &values, &speeds_rpm).unwrap(),
        outcome.dwell_peaks
    );
}

#[test]
fn a_point_beyond_the_axes_is_the_row_of_a_wider_grid() {
    let plan = load_plan(GRID);
    let sliders =
        requested_sliders(&plan, &[parse_slider_range("tub_mass_kg=20:28").unwrap()]).unwrap();
    let (setup, _) = build_setup(&plan, &sliders).unwrap();
    let wide_plan = plan_with_sliders(&plan, &sliders);
    let engine = ModelEngine::new(&wide_plan).unwrap();
    let values = [0.4, 240.0, 26.0];
    assert_point_is_row(&engine.outcomes_at(&[values.to_vec()])[0], &setup, &values);
}

#[test]
fn a_setup_comes_back_from_its_numbers() {
    let mut plan = load_plan(&GRID.replace(
        "\"triangular\", peak_rpm = 350, ramp_s = 50",
        "\"table\", time_s = [0, 20, 50], speed_rpm = [0, 350, 100]",
    ));
    plan.model.machine = crate::config::machine::machine_with_every_element();
    (plan.model.measures.stops, plan.model.measures.feet) =
        (plan.model.machine.stops.len(), plan.model.machine.feet.len());
    plan.model.measures.metrics = vec![Metric::SlipMargin, Metric::CabinetForce];
    plan.model.measures.criterion = Criterion::Envelope;
    plan.model.machine.springs[1].free_length_m = Some(0.2);
    plan.model.machine.dampers[0].friction_n = 20.0;
    plan.model.machine.dampers[0].friction_linear_speed_m_per_s = Some(0.1);
    let (mut setup, _) = build_setup(&plan, &[]).unwrap();
    let numbers = setup.to_numbers();
    // The numbers contain no texts.
    for levels in setup.levels.iter_mut().chain(&mut setup.wide_levels) {
        assert!(levels.note.take().is_some() || levels.levels.len() > 3);
    }
    assert_eq!(Setup::from_numbers(&numbers), Some(setup));
    assert_eq!(Setup::from_numbers(&numbers[..numbers.len() - 1]), None);
    assert_eq!(Setup::from_numbers(&[f64::NAN; 400]), None);
}

#[test]
fn sliders_that_cannot_be_are_refused() {
    let plan = load_plan(GRID);
    for (text, expected) in [
        ("tub_mas_kg=1:2", "no parameter has this name"),
        ("damping_n_s_per_m=1:2", "no slider yet"),
        ("tub_mass_kg=-1:2", "greater than 0"),
    ] {
        let error =
            requested_sliders(&plan, &[parse_slider_range(text).unwrap()]).unwrap_err().to_string();
        assert!(error.contains(expected), "{text}: {error}");
    }
    for text in ["tub_mass_kg", "tub_mass_kg=1", "tub_mass_kg=2:1", "tub_mass_kg=a:b"] {
        assert!(parse_slider_range(text).is_err(), "{text}");
    }
    assert!(usual_sliders(&plan).iter().all(|Axis { parameter, values, .. }| {
        let names = ["unbalance_mass_kg", "damping_n_s_per_m"];
        values.value(0) < values.value(1) && !names.contains(&&*parameter.name)
    }));
}

//! Tests of boundary searches with the real models against grids.

use crate::config;
use crate::engine::ModelEngine;
use crate::model::Washer;
use crate::plan::Plan;
use sweep_engine::boundary::{
    BoundaryOptions, BoundaryTask, SideChange, SideChangeKind, TracedBoundary, quantity,
    trace_boundary,
};
use sweep_engine::evaluator::{CachedEvaluator, SearchStop};
use sweep_engine::store::{OpenOutcome, Trials};
use sweep_engine::{Interrupt, Model as _};
use sweep_parameter::Worse;
use sweep_plot::contour::zero_lines;
use washer_row::{Criterion, Outcome};

const GRID_HEAD: &str = r#"
name = "short"
[spin]
profile = "triangular"
peak_rpm = 350.0
ramp_s = 50.0
[time]
end_s = 50.0
window_s = [30.0, 50.0]
[integrator]
method = "rk4"
step_s = 2.5e-4
"#;

/// The axes of Fig. 12 at three masses, with dampings at intervals of 12 N s/m.
const FIG12_AXES: &str = r#"
[[axis]]
parameter = "unbalance_mass_kg"
values = [0.1, 0.35, 0.6]
[[axis]]
parameter = "damping_n_s_per_m"
range = { from = 60.0, to = 300.0, count = 21 }
"#;

fn load_plan(text: &str) -> Plan {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.toml");
    std::fs::write(&path, text).unwrap();
    config::load(&path, &[]).unwrap_or_else(|mistakes| panic!("{mistakes}"))
}

#[test]
fn a_held_speed_may_be_a_number() {
    let held_speeds_by_text = |speed: &str| {
        let stability_section = format!("[stability]\nspeed_rpm = {speed}\n");
        load_plan(&format!("metrics = [\"dwell\"]\n{GRID_HEAD}{stability_section}{FIG12_AXES}"))
            .model
            .held_speeds
    };
    assert!(
        held_speeds_by_text("250").is_some()
            && held_speeds_by_text("250") == held_speeds_by_text("\"250\"")
    );
    assert_eq!(held_speeds_by_text("297.5"), held_speeds_by_text("\"297.5\""));
}

type Task = BoundaryTask<Washer>;

/// Returns the options for the boundary of the greatest ratio.
fn ratio_boundary_options(tolerance: Option<f64>, lattice: u16) -> BoundaryOptions {
    BoundaryOptions { quantity: "ratio_max".to_owned(), limit: None, tolerance, lattice }
}

fn trace_task(
    task: &Task,
    threads: usize,
    interrupt: &Interrupt,
) -> Result<TracedBoundary, SearchStop> {
    let engine = Washer::engine(&task.plan, task.column_name()).unwrap();
    let evaluator = CachedEvaluator::new(engine, threads, interrupt, None, &|_| {}).unwrap();
    trace_boundary(
        &task.distance_evaluator(&evaluator),
        &task.first_values,
        task.curve_count,
        &task.range,
        &mut |_| {},
    )
}

/// Returns the axis values of all points of a grid.
fn points_of_grid(plan: &Plan) -> Vec<Vec<f64>> {
    (0..plan.points()).map(|point| plan.axis_values(point)).collect()
}

#[test]
fn a_boundary_agrees_with_the_grid_and_does_not_depend_on_the_threads() {
    let plan = load_plan(&format!("{GRID_HEAD}{FIG12_AXES}"));
    let task = Task::new(&plan, &ratio_boundary_options(Some(0.5), 3)).unwrap();
    let interrupt = Interrupt::new();
    let boundaries_by_threads =
        [1, 3].map(|threads| trace_task(&task, threads, &interrupt).unwrap());
    let [one_thread_bytes, three_threads_bytes] =
        [0, 1].map(|k| task.table(&boundaries_by_threads[k]).finish().unwrap().1);
    assert!(one_thread_bytes == three_threads_bytes, "other bytes on three threads");

    let engine = ModelEngine::new(&plan).unwrap();
    let outcomes = engine.outcomes_at(&points_of_grid(&plan));
    for (row, outcomes) in boundaries_by_threads[0].rows_by_curve[0].iter().zip(outcomes.chunks(21))
    {
        assert!(row.trial_count < 21, "{row:?}");
        let side_change = row.side_changes[0];
        let dampings_and_distances: Vec<(f64, f64)> = outcomes
            .iter()
            .map(|outcome| {
                let verdict = &outcome.verdict;
                let [_, damping] = plan.axis_values(outcome.point)[..] else { panic!("two axes") };
                (damping, (verdict.greatest.unwrap().1 / 2.0).ln())
            })
            .collect();
        let Some([low, high]) = side_change.bracket else {
            assert_eq!((row.first_value, side_change.kind), (0.1, SideChangeKind::AllReliable));
            assert!(dampings_and_distances.iter().all(|(_, distance)| *distance < 0.0));
            continue;
        };
        assert_eq!((row.side_changes.len(), side_change.kind), (1, SideChangeKind::Crossing));
        assert!(high - low <= 0.5);
        for (damping, distance) in &dampings_and_distances {
            let is_reliable = *distance < 0.0;
            assert!(
                if is_reliable { *damping > low } else { *damping < high },
                "{damping} {distance} {side_change:?}"
            );
        }
        let contour_damping = dampings_and_distances.windows(2).find_map(|pair| {
            let [(damping_a, distance_a), (damping_b, distance_b)] = [pair[0], pair[1]];
            (distance_a >= 0.0 && distance_b < 0.0).then(|| {
                damping_a + (damping_b - damping_a) * distance_a / (distance_a - distance_b)
            })
        });
        assert!(
            (contour_damping.unwrap() - side_change.position.unwrap()).abs() < 1.0,
            "{contour_damping:?} {side_change:?}"
        );
    }
}

/// Returns the distance of an outcome's greatest ratio from the limit.
fn ratio_distance_of(outcome: &Outcome, plan: &Plan) -> f64 {
    let (quantity, _) = quantity::find_quantity(plan, "ratio_max", None).unwrap();
    quantity.distance(outcome.verdict.greatest.unwrap().1)
}

/// Returns the distances of a grid's greatest ratios from the limit, in rows by the first axis.
fn ratio_distances_of_grid(plan: &Plan) -> Vec<Vec<f64>> {
    let engine = ModelEngine::new(plan).unwrap();
    let outcomes = engine.outcomes_at(&points_of_grid(plan));
    let ratio_distance = |outcome: &Outcome| ratio_distance_of(outcome, plan);
    outcomes
        .chunks(plan.axes[1].values.len() as usize)
        .map(|row| row.iter().map(ratio_distance).collect())
        .collect()
}

#[test]
fn a_boundary_agrees_with_the_contour_of_a_fine_grid_by_every_criterion() {
    // The masses are about 0.4 kg; one mass of the search lies between those of the grid.
    let head_without_integrator = GRID_HEAD.split("[integrator]").next().unwrap();
    let masses_kg = [0.39, 0.40, 0.41];
    let axes_text = |masses: &[f64], from: f64, to: f64, count: u32| {
        format!(
            "[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = {masses:?}\n\
             [[axis]]\nparameter = \"damping_n_s_per_m\"\n\
             range = {{ from = {from:?}, to = {to:?}, count = {count} }}\n"
        )
    };
    for criterion in Criterion::ALL {
        let criterion_head = format!(
            "{head_without_integrator}[reliability]\ncriterion = \"{}\"\n",
            criterion.name()
        );
        let coarse_plan = load_plan(&format!(
            "{criterion_head}{}",
            axes_text(&[0.39, 0.395, 0.41], 60.0, 300.0, 33)
        ));
        let task = Task::new(&coarse_plan, &ratio_boundary_options(Some(0.5), 4)).unwrap();
        let rows = trace_task(&task, 2, &Interrupt::new()).unwrap().rows_by_curve.remove(0);
        let side_changes: Vec<_> =
            rows.iter().map(|row| row.side_changes.last().copied().unwrap()).collect();
        assert!(
            side_changes.iter().all(|side_change| side_change.kind == SideChangeKind::Crossing),
            "{criterion:?}: {side_changes:?}"
        );
        // The dampings are 0.5 N s/m apart about the last crossing.
        let lowest_damping = side_changes[0].position.unwrap().round() - 4.0;
        let damping_count = 29;
        let fine_plan = load_plan(&format!(
            "{criterion_head}{}",
            axes_text(&masses_kg, lowest_damping, lowest_damping + 14.0, damping_count)
        ));
        let dampings: Vec<f64> =
            (0..damping_count).map(|k| lowest_damping + 0.5 * f64::from(k)).collect();
        let fine_distances = ratio_distances_of_grid(&fine_plan);
        let contour_damping =
            zero_lines(&masses_kg, &dampings, |i, j| fine_distances[i][j]).concat();
        for (row, side_change) in rows.iter().zip(&side_changes) {
            let contour_point = contour_damping.windows(2).find_map(|pair| {
                let [[x0, y0], [x1, y1]] = [pair[0], pair[1]];
                let is_between = (x0.min(x1)..=x0.max(x1)).contains(&row.first_value) && x0 != x1;
                is_between.then(|| y0 + (y1 - y0) * (row.first_value - x0) / (x1 - x0))
            });
            let contour_damping = contour_point.unwrap();
            let crossing = side_change.position.unwrap();
            assert!(
                (contour_damping - crossing).abs() < 0.25,
                "{criterion:?} at {} kg: {contour_damping} and {crossing}",
                row.first_value
            );
        }
    }
}

/// A bracket that an earlier search found: the value of the first axis, and both ends.
struct ReferenceBracket {
    first_value: f64,
    low: f64,
    high: f64,
}

/// Returns the brackets of a grid in `testdata/boundary/brackets.csv`.
fn read_reference_brackets(grid: &str) -> Vec<ReferenceBracket> {
    let mut brackets = Vec::new();
    for line in include_str!("../testdata/boundary/brackets.csv").lines() {
        let cells: Vec<&str> = line.split(',').collect();
        if cells[0] == grid {
            let number = |k: usize| cells[k].parse().unwrap();
            brackets.push(ReferenceBracket {
                first_value: number(1),
                low: number(3),
                high: number(4),
            });
        }
    }
    brackets
}

#[test]
fn grids_of_the_repository_have_the_brackets_of_an_earlier_search() {
    let grids = [
        ("fig12", include_str!("../../../sweeps/fig12.toml"), 400),
        ("fig12_envelope", include_str!("../../../sweeps/fig12_envelope.toml"), 120),
        ("fig12_rms", include_str!("../../../sweeps/fig12_rms.toml"), 120),
        ("quick", include_str!("../../../sweeps/quick.toml"), 170),
    ];
    for (name, text, max_trials) in grids {
        let task = Task::new(&load_plan(text), &ratio_boundary_options(None, 6)).unwrap();
        let traced_boundary = trace_task(&task, 2, &Interrupt::new()).unwrap();
        println!(
            "{name}: {} points in {} rounds",
            traced_boundary.trial_count, traced_boundary.batch_count
        );
        assert!(
            traced_boundary.trial_count <= max_trials,
            "{name}: {} points",
            traced_boundary.trial_count
        );
        let mut brackets = Vec::new();
        for row in &traced_boundary.rows_by_curve[0] {
            for side_change in
                row.side_changes.iter().filter(|side_change| side_change.bracket.is_some())
            {
                assert_eq!(side_change.kind, SideChangeKind::Crossing, "{name}: {row:?}");
                brackets.push((row.first_value, side_change.bracket.unwrap()));
            }
        }
        let expected_brackets = read_reference_brackets(name);
        assert_eq!(brackets.len(), expected_brackets.len(), "{name}: {brackets:?}");
        for ((first, [low, high]), expected) in brackets.iter().zip(expected_brackets) {
            assert!((first - expected.first_value).abs() < 1e-4 && high - low <= 0.5);
            // An error of 1e-3 in the ratio moves the flattest of these crossings by this margin.
            let damping_margin = 0.05;
            let overlaps_expected =
                *low <= expected.high + damping_margin && expected.low <= high + damping_margin;
            assert!(overlaps_expected, "{name} at {first} kg: {low} to {high}");
        }
    }
}

#[test]
fn an_interrupt_stops_a_search_before_the_next_group() {
    let plan = load_plan(&format!("{GRID_HEAD}{FIG12_AXES}"));
    let task = Task::new(&plan, &ratio_boundary_options(None, 6)).unwrap();
    assert_eq!(task.range.tolerance, 0.5, "1/480 of 240 N s/m");
    let interrupt = Interrupt::new();
    interrupt.raise(2);
    assert!(matches!(trace_task(&task, 2, &interrupt), Err(SearchStop::Interrupted)));
}

#[test]
fn an_interrupted_search_repeats_no_trial_and_ends_the_same() {
    let plan = load_plan(&format!("{GRID_HEAD}{FIG12_AXES}"));
    let task = Task::new(&plan, &ratio_boundary_options(Some(2.0), 2)).unwrap();
    let uninterrupted_boundary = trace_task(&task, 1, &Interrupt::new()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("x.parquet");
    let job = task.job();
    let mut stop_count = 0;
    let (result, trials) = loop {
        let Ok(OpenOutcome::Open(trials)) =
            Trials::open(&output, &job, task.trial_columns(), false)
        else {
            panic!()
        };
        let interrupt = Interrupt::new();
        let trials_before = trials.trial_count();
        // The search is interrupted after five trials, in the middle of a batch.
        let interrupt_after_five_trials = |done: u64| {
            if done >= trials_before as u64 + 5 {
                interrupt.raise(2);
            }
        };
        let engine = Washer::engine(&task.plan, task.column_name()).unwrap();
        let evaluator =
            CachedEvaluator::new(engine, 2, &interrupt, Some(trials), &interrupt_after_five_trials)
                .unwrap();
        let distances = task.distance_evaluator(&evaluator);
        let result = trace_boundary(
            &distances,
            &task.first_values,
            task.curve_count,
            &task.range,
            &mut |_| {},
        );
        drop(distances);
        let trials = evaluator.into_cache().unwrap();
        match result {
            Ok(result) => break (result, trials),
            Err(SearchStop::Interrupted) => assert!(trials.trial_count() > trials_before),
            Err(SearchStop::Failed(error)) => panic!("{error}"),
        }
        stop_count += 1;
    };
    assert!(stop_count > 1);
    assert_eq!(
        (result, trials.trial_count()),
        (uninterrupted_boundary.clone(), uninterrupted_boundary.trial_count)
    );
}

#[test]
fn a_narrow_reliable_interval_is_followed_over_a_dampers_position() {
    // The position of one damper decides which dampings are reliable, if any are.
    let head_without_integrator = GRID_HEAD.split("[integrator]").next().unwrap();
    let axes_text = "[[axis]]\nparameter = \"damper_1_cabinet_z_m\"\n\
                range = { from = 0.1, to = 0.3, count = 17 }\n\
                [[axis]]\nparameter = \"damping_n_s_per_m\"\n\
                range = { from = 60.0, to = 300.0, count = 33 }\n";
    let plan = load_plan(&format!("{head_without_integrator}{axes_text}"));
    let task = Task::new(&plan, &ratio_boundary_options(None, 6)).unwrap();
    let rows = trace_task(&task, 2, &Interrupt::new()).unwrap().rows_by_curve.remove(0);
    // At 0.1 m no damping is reliable. From 0.125 m on, all dampings above a crossing are reliable.
    // The row between the two has a reliable interval that contains no point of the lattice.
    let first_change_kinds: Vec<SideChangeKind> =
        rows.iter().map(|row| row.side_changes[0].kind).collect();
    assert_eq!(
        first_change_kinds[..3],
        [SideChangeKind::AllUnreliable, SideChangeKind::Crossing, SideChangeKind::Crossing],
        "{rows:?}"
    );
    let engine = ModelEngine::new(&plan).unwrap();
    for row in &rows[..3] {
        let dampings: Vec<f64> = (0..=24).map(|k| 60.0 + 10.0 * f64::from(k)).collect();
        let points: Vec<Vec<f64>> =
            dampings.iter().map(|damping| vec![row.first_value, *damping]).collect();
        for (damping, outcome) in dampings.iter().zip(engine.outcomes_at(&points)) {
            let is_reliable = ratio_distance_of(&outcome, &plan) < 0.0;
            let bracket_below = row
                .side_changes
                .iter()
                .rev()
                .find(|side_change| side_change.bracket.is_some_and(|b| b[1] <= *damping));
            let expected_reliable = match (bracket_below, row.side_changes[0].distances[0]) {
                (Some(side_change), _) => side_change.distances[1].unwrap() < 0.0,
                (None, Some(distance)) => distance < 0.0,
                (None, None) => row.side_changes[0].kind == SideChangeKind::AllReliable,
            };
            let is_bracketed = |side_change: &SideChange| {
                side_change.bracket.is_some_and(|b| b[0] < *damping && *damping < b[1])
            };
            let failure_context = (row.first_value, damping, &row.side_changes);
            assert!(
                expected_reliable == is_reliable || row.side_changes.iter().any(is_bracketed),
                "{failure_context:?}"
            );
        }
    }
}

#[test]
fn plans_without_a_boundary_are_refused_with_the_reason() {
    let mass_axis = "[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.2]\n";
    let refusal_text = |text: &str, tolerance: Option<f64>| {
        let plan = load_plan(&format!("{GRID_HEAD}{text}"));
        Task::new(&plan, &ratio_boundary_options(tolerance, 6)).unwrap_err().to_string()
    };
    assert_eq!(
        refusal_text(mass_axis, None),
        "a boundary runs over two axes, and this grid has 1: give [[axis]] twice, first the one \
         along which the curve is wanted, then the one that is searched; one that --at gives a \
         value is no axis, one with `values` of one number is"
    );
    let axes_with_one_value =
        format!("{mass_axis}[[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [100.0]\n");
    assert_eq!(
        refusal_text(&axes_with_one_value, None),
        "the second axis, `damping_n_s_per_m`, has one value: give it the range to search, as \
         range = { from, to, count } or as `values` whose least and greatest are its ends"
    );
    for tolerance in [0.0, -1.0, f64::NAN, 1e9] {
        let error = refusal_text(FIG12_AXES, Some(tolerance));
        assert!(error.contains("--tolerance") && error.contains("240"), "{error}");
    }
    let design_and_axis = "[design]\nmethod = \"sobol\"\npoints = 8\n\
                  [[axis]]\nparameter = \"unbalance_mass_kg\"\n\
                  range = { from = 0.1, to = 0.2 }\n";
    assert_eq!(
        refusal_text(design_and_axis, None),
        "a boundary runs over the axes of a grid, and this file has a [design]: remove it, and \
         give [[axis]] twice"
    );
}

#[test]
fn every_column_that_is_worse_in_one_direction_has_a_boundary() {
    let plan = load_plan(&format!("{GRID_HEAD}{FIG12_AXES}"));
    let columns = quantity::traceable_columns(&plan);
    let names: Vec<&str> = columns.iter().map(|(column, _)| column.name.as_str()).collect();
    assert_eq!(names[0], "ratio_max");
    for name in [
        "ratio_min",
        "ratio_drum_front_y",
        "nonlinear_tub_yaw",
        "min_gap_linear_m",
        "cabinet_force_nonlinear_n",
        "static_sag_m",
        "damper_1_speed_linear_m_per_s",
    ] {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
    // The paper's machine has no feet and no stops, and the grid has no held speeds.
    for name in ["steps_nonlinear", "slip_margin_nonlinear_n", "growth_per_s", "damping_n_s_per_m"]
    {
        assert!(!names.contains(&name), "{name}");
    }
    for name in names {
        let (quantity, plan) = quantity::find_quantity(&plan, name, Some(0.75)).unwrap();
        assert_eq!((quantity.name.as_str(), quantity.value(0.0)), (name, 0.75));
        for value in [0.5, 1.5, 3.0] {
            let distance = quantity.distance(value);
            assert_eq!(distance < 0.0, (quantity.worse == Worse::Greater) == (value < 0.75));
            assert!((quantity.value(distance) - value).abs() < 1e-14, "{name}");
        }
        assert!(Washer::layout(&plan).position(name).is_some(), "{name}");
    }
    let (_, single_channel_plan) = quantity::find_quantity(&plan, "ratio_tub_yaw", None).unwrap();
    assert_eq!(single_channel_plan.reliability.channels.len(), 1);
    assert_eq!(single_channel_plan.reliability.channels[0].name, "tub_yaw");
    let refusal_text =
        |name, limit| quantity::find_quantity(&plan, name, limit).unwrap_err().to_string();
    assert!(refusal_text("growth_per_s", None).contains("[stability]"));
    assert!(
        refusal_text("cabinet_force", None).contains("did you mean `cabinet_force_nonlinear_n`?")
    );
    assert!(refusal_text("cabinet_force_linear_n", None).contains("no limit of its own"));
    assert!(refusal_text("ratio_max", Some(0.0)).contains("greater than 0"));
    assert!(refusal_text("clash_time_linear_s", Some(0.0)).contains("greater than 0"));
}

#[test]
fn a_boundary_of_an_expression_or_a_condition_is_where_rows_say_so() {
    let plan = load_plan(&format!("{GRID_HEAD}{FIG12_AXES}"));
    let try_new_task = |quantity: &str, limit| {
        let quantity = quantity.to_owned();
        Task::new(
            &plan,
            &BoundaryOptions { quantity, limit, ..ratio_boundary_options(Some(2.0), 3) },
        )
    };
    let crossing_dampings = |task: &Task| {
        let rows = trace_task(task, 2, &Interrupt::new()).unwrap().rows_by_curve.remove(0);
        let side_changes = rows.into_iter().flat_map(|row| row.side_changes);
        let dampings: Vec<f64> =
            side_changes.filter_map(|side_change| side_change.position).collect();
        assert!(!dampings.is_empty());
        dampings
    };
    // A force crosses its limit where twice the force crosses twice the limit, and where the
    // condition that the force is below its limit changes.
    let force_crossings =
        crossing_dampings(&try_new_task("cabinet_force_nonlinear_n", Some(900.0)).unwrap());
    let doubled_force_crossings =
        crossing_dampings(&try_new_task("2 * cabinet_force_nonlinear_n", Some(1800.0)).unwrap());
    let condition_crossings =
        crossing_dampings(&try_new_task("cabinet_force_nonlinear_n < 900", None).unwrap());
    assert_eq!(force_crossings.len(), doubled_force_crossings.len());
    assert_eq!(force_crossings.len(), condition_crossings.len());
    for ((force, doubled), condition) in
        force_crossings.iter().zip(&doubled_force_crossings).zip(&condition_crossings)
    {
        assert!(
            (force - doubled).abs() < 1e-6 && (force - condition).abs() < 2.0,
            "{force} {condition}"
        );
    }
    // A stricter condition is false at more dampings.
    let stricter_task =
        try_new_task("cabinet_force_nonlinear_n < 900 and min_gap_nonlinear_m > 0", None).unwrap();
    assert_eq!(stricter_task.quantity.limit, 0.0);
    assert!(stricter_task.column_name().is_none());
    let refusal_text = |quantity, limit| try_new_task(quantity, limit).unwrap_err().to_string();
    assert!(refusal_text("2 * ratio_max", None).contains("--limit"));
    assert!(refusal_text("ratio_max < 2", Some(2.0)).contains("none with a condition"));
    assert!(refusal_text("ratio_maxx < 2", None).contains("ratio_max"));
    assert!(refusal_text("max(ratio_max) < 2", None).contains("of a row"));
}

#[test]
fn a_force_crosses_its_limit_within_the_bracket() {
    let plan = load_plan(&format!("{GRID_HEAD}{FIG12_AXES}"));
    let limit_n = 900.0;
    let quantity = "cabinet_force_nonlinear_n".to_owned();
    let task = Task::new(
        &plan,
        &BoundaryOptions { quantity, limit: Some(limit_n), ..ratio_boundary_options(Some(2.0), 3) },
    )
    .unwrap();
    let rows = trace_task(&task, 2, &Interrupt::new()).unwrap().rows_by_curve.remove(0);
    let crossings = rows
        .iter()
        .flat_map(|row| row.side_changes.iter().map(|side_change| (row.first_value, side_change)));
    let mut crossing_count = 0;
    for (mass, side_change) in
        crossings.filter(|(_, side_change)| side_change.kind == SideChangeKind::Crossing)
    {
        let bracket_points = side_change.bracket.unwrap().map(|damping| vec![mass, damping]);
        let outcomes = ModelEngine::new(&task.plan).unwrap().outcomes_at(&bracket_points);
        let forces: Vec<f64> =
            outcomes.iter().map(|outcome| outcome.nonlinear.metrics[0]).collect();
        assert!((forces[0] < limit_n) != (forces[1] < limit_n), "{mass} kg: {forces:?}");
        crossing_count += 1;
    }
    assert!(crossing_count > 0, "{rows:?}");
}

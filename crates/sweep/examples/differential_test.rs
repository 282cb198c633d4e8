//! Tests the fast method's promise with random machines, spin profiles, windows, channels, limits
//! and criteria. Each row is compared with that of plain RK4.
//!
//! ```sh
//! cargo run --release -p sweep --example differential_test -- 20000      # rows
//! cargo run --release -p sweep --example differential_test -- 20000 1    # with a seed
//! # The grid of an exception, by its seed:
//! cargo run --release -p sweep --example differential_test -- 9 1000042
//! cargo run --release -p sweep --example differential_test -- 900 1 grazing
//! cargo run --release -p sweep --example differential_test -- 900 1 elements
//! cargo run --release -p sweep --example differential_test -- 900 1 jumps
//! cargo run --release -p sweep --example differential_test -- 900 1 tiny
//! ```
//!
//! Without a seed, or with `clock` in its place, the seed is taken from the clock and printed.
//!
//! The promise: every row that is neither sensitive nor unconverged has RK4's status, RK4's verdict
//! and RK4's amplitudes within the accuracy. RK4 runs with a step of 1e-4 s, and with an eighth of
//! that in grids with a row that differs. The program exits with 1 if a row breaks the promise.
//!
//! With `grazing`, drum and tub just touch in one of a grid's rows, and the time of their clash is
//! compared, too. With `elements`, machines have varied friction dampers, stops, a gasket, feet and
//! a second unbalance, as in docs/examples/friction.toml, and the loads of each stop and foot are
//! compared, too. With `jumps`, the drum brakes within milliseconds, and RK4 has a shorter step.
//! With `tiny`, unbalances are 0 to 1e-3 kg.

use std::process::ExitCode;

use rayon::prelude::*;
use sweep::{
    Integrator, Interrupt, MapRow, MethodKind, ModelEngine, Plan, RunContext, rk4, rk4_mass_scaled,
};
use washer_row::Criterion;

/// Accuracies that grids request of the fast method, in turn. Basis: the default twice, a finer and
/// a coarser one. Doubling them doubles the accepted errors.
const ACCURACIES: [f64; 4] = [1e-3, 1e-3, 1e-4, 1e-2];

/// Number of rows of a grid: three masses by three dampings.
pub(crate) const GRID_ROWS: u64 = 9;

/// Maximum number of grids that are tried, one after the other, until one is valid. Basis: at most
/// three in ten are refused, so that one of 40 is valid. Doubling it changes nothing.
const MAX_REFUSED_GRIDS: u64 = 40;

/// Step of RK4 (s) that resolves the vibration of the bearings after jumps of the speed. Basis: an
/// eighth of [`REFERENCE_STEP_S`]. Doubling it makes the reference's error 16 times as large.
const JUMP_STEP_S: f64 = 1.25e-5;

/// Step of RK4 (s) in all other grids. Basis: stable with bearings as stiff as the paper's, the
/// stiffest of these grids. Doubling it makes the reference's error 16 times as large.
const REFERENCE_STEP_S: f64 = 1e-4;

const CHANNELS: [&str; 8] = [
    "tub_front_y",
    "tub_front_z",
    "drum_front_y",
    "drum_front_z",
    "total_centre_y",
    "total_centre_z",
    "tub_yaw",
    "tub_pitch",
];

/// The parameters that vary, each with its central value and its greatest factor.
const VARIED_PARAMETERS: [(&str, f64, f64); 14] = [
    ("spring_stiffness_n_per_m", 8000.0, 2.0),
    ("bearing_stiffness_n_per_m", 2e8, 1.0),
    ("flexure_stiffness_n_m_per_rad", 29670.0, 3.0),
    ("tub_mass_kg", 23.87, 1.8),
    ("shaft_mass_kg", 4.34, 1.8),
    ("drum_mass_kg", 3.64, 1.8),
    ("unbalance_x_m", 0.3, 1.5),
    ("unbalance_radius_m", 0.2, 1.4),
    ("tub_centre_x_m", 0.24061, 1.3),
    ("bearing_front_x_m", 0.05, 1.6),
    ("spring_1_stiffness_n_per_m", 8000.0, 1.6),
    ("damper_1_cabinet_z_m", 0.28, 1.6),
    ("tub_inertia_22_kg_m2", 1.61, 1.5),
    ("radial_clearance_m", 0.01, 2.0),
];

/// A machine with every kind of element except a second unbalance.
const MACHINE_WITH_ELEMENTS: &str = include_str!("../../../docs/examples/friction.toml");

/// The parameters of elements that vary, each with its central value m and an exponent e: values
/// are between m / 10^e and m * 10^e.
const VARIED_ELEMENTS: [(&str, f64, f64); 17] = [
    ("friction_n", 50.0, 0.5),
    ("damper_2_friction_n", 50.0, 0.5),
    ("friction_speed_m_per_s", 0.01, 0.7),
    ("spring_1_cubic_n_per_m3", 1e6, 1.0),
    ("spring_4_cubic_n_per_m3", 1e6, 1.0),
    ("stop_1_clearance_m", 0.01, 0.5),
    ("stop_2_clearance_m", 0.01, 0.5),
    ("stop_3_clearance_m", 0.02, 0.3),
    ("stop_1_stiffness_n_per_m", 4e5, 1.5),
    ("stop_2_stiffness_n_per_m", 4e5, 1.5),
    ("stop_3_stiffness_n_per_m", 4e4, 0.5),
    ("stop_1_softness_m", 1e-4, 1.0),
    ("bushing_1_cubic_y_n_per_m3", 5e6, 1.0),
    ("unbalance_2_mass_kg", 0.1, 0.5),
    ("cabinet_friction", 0.4, 0.3),
    ("foot_1_x_m", 0.47, 0.1),
    ("foot_2_z_m", -0.26, 0.1),
];

/// The kind of a trial: the inputs of a grid that vary in addition to the machine's proportions.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum TrialKind {
    Plain,
    Grazing,
    Elements,
    Jumps,
    Tiny,
}

/// The kinds of trials by their names on the command line, without the plain one.
const TRIAL_KINDS: [(&str, TrialKind); 4] = [
    ("grazing", TrialKind::Grazing),
    ("elements", TrialKind::Elements),
    ("jumps", TrialKind::Jumps),
    ("tiny", TrialKind::Tiny),
];

/// A random number generator with a seed (splitmix64).
struct RandomGenerator(u64);

impl RandomGenerator {
    fn next_f64(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next_f64()
    }

    /// Returns a factor from `1 / max_factor` to `max_factor`, with a uniform logarithm.
    fn factor(&mut self, max_factor: f64) -> f64 {
        max_factor.powf(self.between(-1.0, 1.0))
    }

    fn choose<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[(self.next_f64() * items.len() as f64) as usize]
    }
}

/// Returns a grid file of nine points.
fn random_grid(seed: u64) -> String {
    let mut rng = RandomGenerator(seed.wrapping_mul(0x2545_f491_4f6c_dd1d));
    let end_s = rng.between(4.0, 26.0);
    let peak_rpm = *rng.choose(&[120.0, 300.0, 350.0, 350.0, 500.0, 900.0]) * rng.factor(1.3);
    let spin = match (rng.next_f64() * 4.0) as u32 {
        0 => format!("profile = \"cycloidal\"\nramp_s = {}", end_s * rng.between(0.5, 1.2)),
        1 => format!("profile = \"triangular\"\nramp_s = {}", end_s * rng.between(0.3, 1.2)),
        2 => format!("profile = \"ramp\"\nramp_s = {}", end_s * rng.between(0.3, 1.2)),
        _ => {
            let [first_s, second_s] =
                [end_s * rng.between(0.2, 0.4), end_s * rng.between(0.5, 0.9)];
            let [low, high] = [peak_rpm * rng.between(0.2, 0.9), peak_rpm];
            format!(
                "profile = \"table\"\ntime_s = [0, {first_s}, {second_s}, {end_s}]\n\
                 speed_rpm = [0, {low}, {low}, {high}]"
            )
        }
    };
    let peak_line =
        if spin.contains("table") { String::new() } else { format!("\npeak_rpm = {peak_rpm}") };
    let from_s = end_s * rng.between(0.0, 0.8);
    let to_s = rng.between(from_s + 0.1 * (end_s - from_s), end_s);
    let mut set_lines = String::new();
    for (name, value, max_factor) in VARIED_PARAMETERS {
        if rng.next_f64() < 0.4 && max_factor > 1.0 {
            set_lines += &format!("{name} = {}\n", value * rng.factor(max_factor));
        }
    }
    if rng.next_f64() < 0.15 {
        set_lines +=
            &format!("bearing_stiffness_n_per_m = {}\n", 2e8 * 10f64.powf(rng.between(-2.5, 0.0)));
    }
    let mut channels: Vec<_> = CHANNELS.into_iter().filter(|_| rng.next_f64() < 0.35).collect();
    if channels.is_empty() {
        channels.push(*rng.choose(&CHANNELS));
    }
    let criterion = *rng.choose(&["peak", "peak", "peak", "envelope", "rms"]);
    let ratio_limit = *rng.choose(&[1.2, 1.5, 2.0, 2.0, 3.0, 5.0]);
    let masses = [0.05, 0.4, 1.0].map(|mass| mass * rng.factor(1.6));
    let dampings = [60.0, 120.0, 240.0].map(|damping| damping * rng.factor(1.5));
    format!(
        "name = \"trial-{seed}\"\nmetrics = [\"cabinet_force\"]\n\
         [set]\n{set_lines}[spin]\n{spin}{peak_line}\n\
         [time]\nend_s = {end_s}\nwindow_s = [{from_s}, {to_s}]\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = {masses:?}\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = {dampings:?}\n\
         [reliability]\ncriterion = \"{criterion}\"\nratio_limit = {ratio_limit}\n\
         channels = {channels:?}\n"
    )
}

/// The result of trials. Counts are numbers of rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct TrialTotals {
    pub(crate) rows: u64,
    pub(crate) refused: u64,
    sensitive: u64,
    /// The number of sensitive rows for which RK4 with its step, twice and an eighth of it agrees
    /// within the accuracy.
    needlessly_sensitive: u64,
    pub(crate) unconverged: u64,
    /// Unconverged rows that are within the accuracy.
    needlessly_unconverged: u64,
    failed: u64,
    wrong_status: u64,
    wrong_verdict: u64,
    /// The number of rows whose amplitudes have an error above the accuracy.
    inaccurate: u64,
    /// The number of rows whose error is above their own `error`, but within the accuracy.
    above_error: u64,
    /// The greatest error of the rows that keep the promise, relative to the accuracy.
    greatest_error: f64,
    by_method: [u64; MethodKind::ALL.len()],
    /// The greatest error relative to the row's own `error`, by method.
    error_over_estimate: [f64; MethodKind::ALL.len()],
    /// A description of each row that breaks the promise.
    pub(crate) exceptions: Vec<String>,
    /// The number of grids with exceptions. A grid is one machine, whose rows fail together.
    pub(crate) exceptional_grids: u64,
}

impl TrialTotals {
    fn merge(mut self, other: Self) -> Self {
        self.rows += other.rows;
        self.refused += other.refused;
        self.sensitive += other.sensitive;
        self.needlessly_sensitive += other.needlessly_sensitive;
        self.unconverged += other.unconverged;
        self.needlessly_unconverged += other.needlessly_unconverged;
        for (share, other) in self.error_over_estimate.iter_mut().zip(other.error_over_estimate) {
            *share = share.max(other);
        }
        self.failed += other.failed;
        self.wrong_status += other.wrong_status;
        self.wrong_verdict += other.wrong_verdict;
        self.inaccurate += other.inaccurate;
        self.above_error += other.above_error;
        self.greatest_error = self.greatest_error.max(other.greatest_error);
        for (count, other) in self.by_method.iter_mut().zip(other.by_method) {
            *count += other;
        }
        self.exceptions.extend(other.exceptions);
        self.exceptional_grids += other.exceptional_grids;
        self
    }
}

fn relative_difference((a, b): (&f64, &f64)) -> f64 {
    relative_difference_above(0.0, *a, *b)
}

/// Returns the difference of two numbers relative to the greater of the second one and
/// `min_scale`.
fn relative_difference_above(min_scale: f64, a: f64, b: f64) -> f64 {
    if a == b { 0.0 } else { (a - b).abs() / b.abs().max(min_scale) }
}

/// Minimum of the bound that a row's own `error` gives. Basis: RK4 at 1e-4 s has errors of this
/// size. Doubling it accepts rows with twice the error where their `error` is smaller.
const ERROR_FLOOR: f64 = 1e-6;

/// The two models, by their names in columns.
const MODELS: [&str; 2] = ["nonlinear", "linear"];

/// Returns the difference of two rows' numbers in a column, relative to the greater of the second
/// one and `min_scale`; `None` where a row has none.
fn column_difference(column: &str, min_scale: f64, a: &MapRow, b: &MapRow) -> Option<f64> {
    Some(relative_difference_above(min_scale, a.number(column)?, b.number(column)?))
}

/// Returns the greatest relative difference of the numbers of two rows.
fn relative_row_difference(plan: &Plan, a: &MapRow, b: &MapRow) -> f64 {
    greatest_difference(plan, a, b).1
}

/// Returns the name of the quantity with the greatest relative difference between two rows, and
/// that difference.
fn greatest_difference(plan: &Plan, a: &MapRow, b: &MapRow) -> (String, f64) {
    let mut differences = metric_differences(plan, a, b);
    // Least gaps and times of failure are those of the whole run, which goes on after the window.
    let clearance_m = plan.model.machine.radial_clearance_m;
    for model in MODELS {
        differences.push((format!("amplitudes {model}"), amplitude_difference(model, a, b)));
        let gap = format!("min_gap_{model}_m");
        if let Some(difference) = column_difference(&gap, clearance_m, a, b) {
            differences.push((gap, difference));
        }
    }
    if let Some((a, b)) = a.number("fail_time_s").zip(b.number("fail_time_s")) {
        differences.push(("fail_time".to_owned(), (a - b).abs() / plan.end_s));
    }
    if plan.model.measures.criterion == Criterion::Envelope {
        // Ratios by turn are no quotients of amplitudes. A ratio has the errors of both models.
        let ratios = [a, b].map(|row| row.verdict().ratios);
        let defined = ratios[0].iter().flatten().zip(ratios[1].iter().flatten());
        let greatest = defined.map(relative_difference).fold(0.0, f64::max) / 2.0;
        differences.push(("turn_ratios".to_owned(), greatest));
    }
    let greatest = differences.into_iter().max_by(|(_, a), (_, b)| a.total_cmp(b));
    greatest.expect("every row has amplitudes")
}

fn amplitude_difference(model: &str, a: &MapRow, b: &MapRow) -> f64 {
    let amplitudes = [a, b].map(|row| row.amplitudes(model));
    amplitudes[0].iter().zip(&amplitudes[1]).map(relative_difference).fold(0.0, f64::max)
}

/// Returns the relative difference of each metric, with the name of its column.
fn metric_differences(plan: &Plan, a: &MapRow, b: &MapRow) -> Vec<(String, f64)> {
    let machine = &plan.model.machine;
    let moving_kg = machine.tub.mass_kg + machine.shaft.mass_kg + machine.drum.mass_kg;
    let weight_n = moving_kg * machine.gravity_m_per_s2;
    let metrics = MODELS.into_iter().flat_map(|model| {
        plan.model.measures.model_columns().filter_map(move |number| {
            let min_scale = number.metric.scale(plan.window_s, weight_n);
            let column = number.column(model);
            let share = column_difference(&column, min_scale, a, b)?;
            Some((column, share))
        })
    });
    metrics.collect()
}

fn evaluate_with(plan: &Plan, integrator: Integrator) -> Vec<MapRow> {
    let plan = Plan { integrator, ..plan.clone() };
    let values: Vec<_> = (0..plan.points()).map(|point| plan.axis_values(point)).collect();
    let interrupt = Interrupt::new();
    let engine = ModelEngine::new(&plan).expect("an instruction set");
    engine.evaluate_points(&values, &RunContext::new(&interrupt)).expect("no interrupt")
}

/// Returns the clearance at which drum and tub just touch in one of the rows, as an argument of
/// `--set`; `None` if that row failed.
fn find_grazing_clearance(seed: u64, plan: &Plan) -> Option<String> {
    let mut rng = RandomGenerator(!seed);
    let rows = evaluate_with(plan, rk4_mass_scaled(1e-3));
    let gap_m = rng.choose(&rows).number("min_gap_nonlinear_m")?;
    let closest_approach_m = plan.model.machine.radial_clearance_m - gap_m;
    let overlap = 10f64.powf(rng.between(-6.0, -1.5));
    Some(format!("radial_clearance_m={}", closest_approach_m * (1.0 - overlap)))
}

/// Writes the file of a machine with elements, and returns the grid with that machine.
fn write_machine_with_elements(seed: u64, grid: &str, folder: &std::path::Path) -> String {
    let mut rng = RandomGenerator(seed.rotate_left(32));
    let unbalance = "[[further_unbalances]]\nmass_kg = 0.1\nx_m = 0.1\nradius_m = -0.2\n";
    // Each grid has a separate machine file, because grids are read while others are written.
    let machine = format!("machine-{seed}.toml");
    std::fs::write(folder.join(&machine), format!("{MACHINE_WITH_ELEMENTS}\n{unbalance}"))
        .expect("the temporary folder can be written to");
    let mut set_lines = String::new();
    for (name, value, exponent) in VARIED_ELEMENTS {
        let is_set_already = name.starts_with("damper_2") && set_lines.contains("friction_n");
        if rng.next_f64() < 0.5 && !is_set_already {
            set_lines +=
                &format!("{name} = {}\n", value * 10f64.powf(rng.between(-exponent, exponent)));
        }
    }
    grid.replacen("[set]\n", &format!("machine = \"{machine}\"\n[set]\n{set_lines}"), 1)
}

/// Returns the grid with a drum that runs up, brakes within milliseconds, and continues.
fn grid_with_jumps(seed: u64, grid: &str) -> String {
    let mut rng = RandomGenerator(seed.rotate_left(16));
    let end_s = rng.between(3.0, 6.0);
    let brake_start_s = end_s * rng.between(0.2, 0.6);
    let brake_s = 10f64.powf(rng.between(-3.5, -1.0));
    let from_s = rng.between(0.0, 0.9 * end_s);
    let [fast, slow, last] =
        [(200.0, 600.0), (20.0, 200.0), (50.0, 300.0)].map(|(from, to)| rng.between(from, to));
    let to_s = rng.between(from_s + 0.05 * end_s, end_s);
    let (before, rest) = grid.split_once("[spin]").expect("a spin");
    let (_, after) = rest.split_once("[[axis]]").expect("an axis");
    format!(
        "{before}[spin]\nprofile = \"table\"\ntime_s = [0, {brake_start_s}, {}, {end_s}]\n\
         speed_rpm = [0, {fast}, {slow}, {last}]\n\
         [time]\nend_s = {end_s}\nwindow_s = [{from_s}, {to_s}]\n[[axis]]{after}",
        brake_start_s + brake_s
    )
}

/// Returns the grid with very small unbalances, and with a ratio limit that such motions may pass.
fn grid_with_tiny_unbalances(seed: u64, grid: &str) -> String {
    let mut rng = RandomGenerator(seed.rotate_left(48));
    let masses = [0.0, rng.between(0.0, 1e-4), 10f64.powf(rng.between(-6.0, -3.0))];
    let (before, rest) = grid.split_once("values = [").expect("masses");
    let (_, after) = rest.split_once(']').expect("their end");
    let grid = format!("{before}values = {masses:?}{after}");
    let (before, rest) = grid.split_once("ratio_limit = ").expect("a limit");
    let (_, after) = rest.split_once('\n').expect("its end");
    let limit = *rng.choose(&[1.0001, 1.001, 1.01, 1.2, 2.0]);
    format!("{before}ratio_limit = {limit}\n{after}")
}

/// Compares the rows of a grid with those of RK4.
fn check_grid(seed: u64, kind: TrialKind, folder: &std::path::Path) -> TrialTotals {
    let path = folder.join(format!("{seed}.toml"));
    let mut grid_text = random_grid(seed);
    let is_grazing = kind == TrialKind::Grazing;
    if is_grazing {
        grid_text = grid_text.replace("cabinet_force", "clash_time");
    }
    if kind == TrialKind::Elements {
        let loads = "\"cabinet_force\", \"stop_force\", \"stop_contact\", \"foot_load\", \
                     \"slip_margin\", \"damper_speed\"";
        grid_text = grid_text.replace("\"cabinet_force\"", loads);
        grid_text = write_machine_with_elements(seed, &grid_text, folder);
    }
    if kind == TrialKind::Jumps {
        grid_text = grid_with_jumps(seed, &grid_text);
    }
    if kind == TrialKind::Tiny {
        grid_text = grid_with_tiny_unbalances(seed, &grid_text);
    }
    let accuracy = ACCURACIES[(seed % 4) as usize];
    let step_s = if kind == TrialKind::Jumps { JUMP_STEP_S } else { REFERENCE_STEP_S };
    std::fs::write(&path, &grid_text).expect("the temporary folder can be written to");
    let mut loaded_plan = sweep::load(&path, &[]).ok();
    if is_grazing {
        let clearance = loaded_plan.and_then(|plan| find_grazing_clearance(seed, &plan));
        loaded_plan = clearance.and_then(|set| sweep::load(&path, &[set]).ok());
    }
    if std::env::var("DUMP").is_ok() {
        eprintln!("{grid_text}");
    }
    let Some(plan) = loaded_plan else {
        return TrialTotals { refused: 1, ..TrialTotals::default() };
    };
    let evaluate = |integrator| evaluate_with(&plan, integrator);
    let rows = evaluate(rk4_mass_scaled(accuracy));
    let reference_rows = evaluate(rk4(step_s));
    let mut coarser_rows = None;
    let mut finer_rows = None;
    let mut totals = TrialTotals { rows: rows.len() as u64, ..TrialTotals::default() };
    for (i, (row, reference)) in rows.iter().zip(&reference_rows).enumerate() {
        let method = MethodKind::named(row.name("method").unwrap_or_default()).unwrap_or_default();
        totals.by_method[method as usize] += 1;
        totals.failed += u64::from(row.status() != "ok");
        let mut find_coarser_row =
            || coarser_rows.get_or_insert_with(|| evaluate(rk4(2.0 * step_s)))[i].clone();
        let mut find_finer_row =
            || finer_rows.get_or_insert_with(|| evaluate(rk4(step_s / 8.0)))[i].clone();
        if row.flag("sensitive") == Some(true) {
            totals.sensitive += 1;
            let settles = [find_coarser_row(), find_finer_row()].iter().all(|other| {
                other.status() == reference.status()
                    && relative_row_difference(&plan, other, reference) <= accuracy
            });
            totals.needlessly_sensitive += u64::from(settles);
            continue;
        }
        let finer_reference;
        let mut reference = reference;
        let estimate = row.number("error").unwrap_or(f64::INFINITY).max(ERROR_FLOOR);
        let differs = relative_row_difference(&plan, row, reference) > accuracy.min(estimate)
            || row.flag("reliable") != reference.flag("reliable");
        if differs {
            // The reference may be wrong, because the fast method refines rows to shorter steps.
            finer_reference = find_finer_row();
            reference = &finer_reference;
        }
        let error = relative_row_difference(&plan, row, reference);
        if row.flag("converged") == Some(false) {
            totals.unconverged += 1;
            let is_right = row.status() == reference.status() && error <= accuracy;
            totals.needlessly_unconverged += u64::from(is_right);
            continue;
        }
        let mut report_exception = |counter: fn(&mut TrialTotals) -> &mut u64, quantity: &str| {
            *counter(&mut totals) += 1;
            let method = method.name();
            let estimate = row.number("error").unwrap_or(f64::NAN);
            let (number, _) = greatest_difference(&plan, row, reference);
            totals.exceptions.push(format!(
                "seed {seed}, row {i}, {method}: wrong {quantity}, by {error:.2e} in {number}; \
                 `error` is {estimate:.2e}"
            ));
        };
        if row.status() != reference.status() {
            report_exception(|totals| &mut totals.wrong_status, "status");
        } else if error > accuracy {
            report_exception(|totals| &mut totals.inaccurate, "number");
        } else if row.flag("reliable") != reference.flag("reliable") {
            report_exception(|totals| &mut totals.wrong_verdict, "verdict");
        } else {
            totals.greatest_error = totals.greatest_error.max(error / accuracy);
            let ratio = &mut totals.error_over_estimate[method as usize];
            *ratio = ratio.max(error / estimate);
            totals.above_error +=
                u64::from(row.number("error").is_some_and(|own| error > own.max(ERROR_FLOOR)));
        }
    }
    totals.exceptional_grids = u64::from(!totals.exceptions.is_empty());
    totals
}

/// Returns a seed from the clock, so that no constant can be fitted to it.
pub(crate) fn seed_from_clock() -> u64 {
    let duration = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    duration.map_or(0, |duration| duration.as_secs() % 1_000_000)
}

/// Checks grids of nine rows, from a seed on. A seed of a million or more is that of the first
/// grid, which messages about exceptions name.
pub(crate) fn check_grids(rows: u64, first_seed: u64, kind: TrialKind) -> TrialTotals {
    let name = format!("sweep-differential-test-{}-{}", std::process::id(), kind as u8);
    let folder = std::env::temp_dir().join(name);
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    let grid_count = rows.div_ceil(GRID_ROWS);
    let first_seed = if first_seed < 1_000_000 { first_seed * 1_000_000 } else { first_seed };
    let totals = (first_seed..first_seed + grid_count)
        .into_par_iter()
        .map(|seed| {
            // A refused grid is replaced by another one.
            let seeds = (0..MAX_REFUSED_GRIDS).map(|k| seed + k * grid_count);
            let mut totals = TrialTotals::default();
            for seed in seeds {
                totals = totals.merge(check_grid(seed, kind, &folder));
                if totals.rows > 0 {
                    break;
                }
            }
            totals
        })
        .reduce(TrialTotals::default, TrialTotals::merge);
    // A temporary folder that cannot be removed is harmless.
    let _ = std::fs::remove_dir_all(&folder);
    totals
}

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let row_count = arguments.next().and_then(|argument| argument.parse::<u64>().ok());
    let seed = match arguments.next().as_deref() {
        None | Some("clock") => Some(seed_from_clock()),
        Some(argument) => argument.parse().ok(),
    };
    let (Some(row_count), Some(first_seed)) = (row_count, seed) else {
        let kinds = TRIAL_KINDS.map(|(name, _)| name).join("|");
        eprintln!("usage: differential_test ROWS [SEED|clock [{kinds}]]");
        return ExitCode::from(2);
    };
    let find_kind = |argument: String| {
        TRIAL_KINDS.into_iter().find(|(name, _)| *name == argument).ok_or(argument)
    };
    let kind = match arguments.next().map_or(Ok(("", TrialKind::Plain)), find_kind) {
        Ok((_, kind)) => kind,
        Err(argument) => {
            eprintln!("{argument} is none of {}", TRIAL_KINDS.map(|(name, _)| name).join(", "));
            return ExitCode::from(2);
        }
    };
    // A thread that waits for rows of its grid starts another grid on the same stack, which
    // therefore is large.
    let pool = rayon::ThreadPoolBuilder::new().stack_size(1 << 28).build_global();
    pool.expect("nothing has used the pool");
    let totals = check_grids(row_count, first_seed, kind);
    let grids = row_count.div_ceil(GRID_ROWS);
    eprintln!(
        "{} rows of {grids} grids ({} refused), seed {first_seed}",
        totals.rows, totals.refused
    );
    eprintln!("  by method {:?}: {:?}", MethodKind::ALL.map(MethodKind::name), totals.by_method);
    eprintln!(
        "  failed {}, sensitive {} ({} of them needlessly), unconverged {} ({} of them right)",
        totals.failed,
        totals.sensitive,
        totals.needlessly_sensitive,
        totals.unconverged,
        totals.needlessly_unconverged
    );
    eprintln!(
        "  wrong: status {}, verdict {}, numbers {}; worst of the rest {:.2} of the accuracy; \
         {} above their `error`",
        totals.wrong_status,
        totals.wrong_verdict,
        totals.inaccurate,
        totals.greatest_error,
        totals.above_error
    );
    eprintln!(
        "  greatest error as a share of `error`, by method: {:.2?}",
        totals.error_over_estimate
    );
    totals.exceptions.iter().for_each(|line| eprintln!("  {line}"));
    if totals.exceptions.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

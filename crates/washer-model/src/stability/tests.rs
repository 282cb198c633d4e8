//! Against numbers from a program independent of this one, against the machine as it is, and
//! against its simulation.

use super::plain::{Plain, Trace};
use super::*;
use crate::coordinates::COORDINATES;
use crate::tests::reference::reference;
use crate::{Machine, Method, ModelKind, Spin, Start, Timing, history, prepare};
use faer::c64;
use serde_json::Value;
use std::f64::consts::PI;

const TIMING: Timing = Timing { end_s: 20.0, window_s: [0.0, 20.0], checkpoints: 0 };

fn prepared(machine: Machine, speed_rpm: f64) -> Point {
    let spin = Spin::Table { time_s: vec![0.0], speed_rpm: vec![speed_rpm] };
    prepare(Simd::best(), &[(machine, spin)], &TIMING).remove(0).unwrap()
}

fn paper(case: &Value) -> Machine {
    with(number(case, "unbalance_mass_kg"), number(case, "damping_n_s_per_m"))
}

fn with(unbalance_mass_kg: f64, damping_n_s_per_m: f64) -> Machine {
    let mut machine = Machine::paper();
    machine.unbalance.mass_kg = unbalance_mass_kg;
    machine.dampers.iter_mut().for_each(|d| d.damping_n_s_per_m = damping_n_s_per_m);
    machine
}

fn number(case: &Value, name: &str) -> f64 {
    case[name].as_f64().unwrap()
}

fn list(name: &str) -> Vec<Value> {
    reference("stability.json")[name].as_array().unwrap().clone()
}

/// The responses of one machine at these speeds.
fn over(machine: Machine, speeds_rpm: &[f64]) -> Vec<Response> {
    let point = prepared(machine, 100.0);
    let dwells: Vec<_> =
        speeds_rpm.iter().map(|&speed_rpm| Dwell { point: &point, speed_rpm }).collect();
    respond(&dwells).into_iter().map(Result::unwrap).collect()
}

fn at(machine: Machine, speed_rpm: f64) -> Response {
    over(machine, &[speed_rpm]).remove(0)
}

/// The multipliers of the machine as it is, by plain Runge-Kutta.
fn plain(machine: Machine, speed_rpm: f64, start: [f64; STATES]) -> Vec<c64> {
    let point = prepared(machine, speed_rpm);
    let row = Settings::new(&point).case(speed_rpm).unwrap().row;
    let matrix = Simd::one_lane(Plain::new(&row, start, 1e4).unwrap()).unwrap();
    let matrix = Mat::from_fn(STATES, STATES, |i, j| matrix[i][j].0);
    let mut multipliers = matrix.eigenvalues().unwrap();
    multipliers.sort_by(|a, b| b.norm_sqr().total_cmp(&a.norm_sqr()));
    multipliers
}

/// Of one row what is found, and every multiplier.
fn found(row: &Row<'_>) -> (Box<Found>, Vec<c64>) {
    let found = Simd::dispatch_narrow(Respond { rows: &[*row] }).remove(0).unwrap();
    let matrix = Mat::from_fn(STATES, STATES, |i, j| found.monodromy[i][j].0);
    let multipliers = matrix.eigenvalues().unwrap();
    (found, multipliers)
}

#[test]
fn val_growth_and_amplitudes_match_an_independent_program() {
    for case in list("points") {
        let ours = at(paper(&case), number(&case, "speed_rpm"));
        let [growth, frequency] = ["growth_per_s", "frequency_cpm"].map(|name| number(&case, name));
        // Where all decays, what decays slowest is the hinge, which is left out here.
        if growth > 0.0 {
            let apart = ours.growth_per_s() - growth;
            assert!(apart.abs() < 1e-3, "{case}: {apart:e}");
            let apart = ours.frequency_cpm() - frequency;
            assert!(apart.abs() < 1e-2, "{case}: {apart:e}");
        }
        for (channel, name) in [(6, "amplitude_tub_yaw_rad"), (7, "amplitude_tub_pitch_rad")] {
            let error = ours.nonlinear[channel] / number(&case, name) - 1.0;
            println!("{name} {error:e} growth {:e}", ours.growth_per_s() - growth);
            // The reference takes the largest of its steps' ends, 1e-4 s apart, and so misses up to
            // this of a peak.
            let between_steps = 0.5 * (PI * 1e-4 * ours.speed_rpm / 60.0).powi(2);
            assert!(-1e-5 < error && error < 1e-5 + between_steps, "{case}: {error:e}");
        }
        let kind = match (growth > 0.0, number(&case, "frequency_cpm")) {
            (false, _) => Kind::Stable,
            (true, frequency) if 2.0 * frequency == ours.speed_rpm => Kind::PeriodDoubling,
            (true, _) => Kind::QuasiPeriodic,
        };
        assert_eq!(ours.kind(), kind, "{case}");
    }
}

#[test]
fn val_edges_match_an_independent_program() {
    for case in list("edges") {
        let edges: Vec<f64> =
            case["edges_rpm"].as_array().unwrap().iter().map(|e| e.as_f64().unwrap()).collect();
        let beside: Vec<f64> = edges.iter().flat_map(|edge| [edge - 0.05, edge + 0.05]).collect();
        let unstable: Vec<bool> =
            over(paper(&case), &beside).iter().map(|r| r.kind() != Kind::Stable).collect();
        assert_eq!(unstable, [false, true, true, false, false, true, true, false], "{case}");
    }
}

#[test]
fn val_the_damping_that_closes_a_tongue_matches_an_independent_program() {
    for case in list("critical") {
        let from = if case["tongue"] == "f1+f2" { 245.0 } else { 302.0 };
        let speeds: Vec<f64> = (0..40).map(|k| from + 0.25 * f64::from(k)).collect();
        let largest = |beside: f64| {
            let damping = number(&case, "damping_n_s_per_m") + beside;
            let responses = over(with(number(&case, "unbalance_mass_kg"), damping), &speeds);
            responses.iter().map(Response::growth_per_s).fold(f64::NEG_INFINITY, f64::max)
        };
        let [below, above] = [largest(-0.5), largest(0.5)];
        assert!(below > 0.0 && above < 0.0, "{case}: {below} {above}");
    }
}

#[test]
fn multipliers_are_those_of_the_machine_as_it_is() {
    for (machine, speed_rpm) in [
        (with(0.4, 140.0), 60.0),
        (with(0.4, 140.0), 238.44),
        (with(0.4, 140.0), 250.0),
        (with(0.4, 100.0), 317.667),
        (with(1.0, 250.0), 303.0),
        (with(0.4, 140.0), 1200.0),
    ] {
        let ours = at(machine.clone(), speed_rpm);
        let theirs = plain(machine, speed_rpm, ours.start);
        let mu = c64::new(ours.multiplier[0], ours.multiplier[1]);
        let nearest = theirs
            .iter()
            .min_by(|a, b| (**a - mu).norm().total_cmp(&(**b - mu).norm()))
            .map(|mu| growth_per_s([mu.re, mu.im], speed_rpm))
            .unwrap();
        let apart = ours.growth_per_s() - nearest;
        println!("{speed_rpm}: {} {apart:e}", ours.growth_per_s());
        assert!(apart.abs() < 2e-4, "{speed_rpm}: {nearest} {apart:e}");
        // Nothing else grows; what decays as slowly as this is the hinge.
        for other in theirs.iter().map(|mu| growth_per_s([mu.re, mu.im], speed_rpm)) {
            let is_ours = other <= nearest.max(-0.1) + 1e-9;
            assert!(is_ours, "{speed_rpm}: {other} beside {nearest}");
        }
    }
}

/// Of the machine at a constant speed with a small disturbance: how fast that grows, from the state
/// after every turn.
fn simulated_growth_per_s(machine: Machine, response: &Response) -> f64 {
    let speed_rpm = response.speed_rpm;
    let point = prepared(machine, speed_rpm);
    let mut start = Start::default();
    for i in 0..COORDINATES {
        start.deviations[i] = response.start[i] - point.equilibrium()[i];
        start.speeds[i] = response.start[COORDINATES + i];
    }
    for i in [4, 5] {
        start.deviations[i] += 1e-6;
    }
    let turn_s = 60.0 / speed_rpm;
    let method = Method::Rk4 { step_s: 2e-4 };
    let history = history(ModelKind::Nonlinear, &method, &point, &start, turn_s);
    // A thousandfold at most: after that the disturbance is not small.
    let end_s = TIMING.end_s.min(7.0 / response.growth_per_s());
    let turns = (end_s / turn_s) as usize;
    // From turn to turn: what the response itself has in it drops out.
    let states: Vec<[f64; COORDINATES]> =
        (0..turns).map(|k| history.instant(k).unwrap().deviations).collect();
    let moved: Vec<[f64; COORDINATES]> =
        states.windows(2).map(|pair| core::array::from_fn(|i| pair[1][i] - pair[0][i])).collect();
    // Once the others have decayed, two multipliers are left: least squares of d[k + 2] = a d[k +
    // 1] + b d[k].
    let (mut g, mut h) = ([[0.0; 2]; 2], [0.0; 2]);
    for k in turns / 2..moved.len() - 2 {
        for i in 0..COORDINATES {
            let [d0, d1, d2] = [moved[k][i], moved[k + 1][i], moved[k + 2][i]];
            g[0][0] += d1 * d1;
            g[0][1] += d1 * d0;
            g[1][1] += d0 * d0;
            h[0] += d1 * d2;
            h[1] += d0 * d2;
        }
    }
    let determinant = g[0][0] * g[1][1] - g[0][1] * g[0][1];
    let a = (h[0] * g[1][1] - h[1] * g[0][1]) / determinant;
    let b = (g[0][0] * h[1] - g[0][1] * h[0]) / determinant;
    let discriminant = 0.25 * a * a + b;
    let largest =
        if discriminant < 0.0 { (-b).sqrt() } else { (0.5 * a).abs() + discriminant.sqrt() };
    largest.ln() / turn_s
}

#[test]
fn disturbances_of_simulated_dwells_grow_as_fast() {
    let growing: Vec<Value> =
        list("points").into_iter().filter(|case| number(case, "growth_per_s") > 0.2).collect();
    assert!(growing.len() >= 10);
    for case in growing.iter().take(10) {
        let response = at(paper(case), number(case, "speed_rpm"));
        let simulated = simulated_growth_per_s(paper(case), &response);
        let error = simulated / response.growth_per_s() - 1.0;
        println!("{error:e}");
        assert!(error.abs() < 0.01, "{case}: {simulated}");
    }
}

/// Without unbalance a drum that is symmetric about its axis looks the same at every angle: with
/// its hinge's angles seen from where it does not turn, the equations are the same at all times.
#[test]
fn multipliers_of_a_round_drum_are_exponentials_of_eigenvalues() {
    let mut machine = with(0.0, 140.0);
    machine.drum.inertia_kg_m2[2] = machine.drum.inertia_kg_m2[1];
    for speed_rpm in [60.0, 250.0, 900.0] {
        let point = prepared(machine.clone(), speed_rpm);
        let (turn_s, speed) = (60.0 / speed_rpm, speed_rpm * TAU / 60.0);
        let matrices = point.matrices(0.0, speed, 0.0);
        let full = |m: &[[f64; COORDINATES]; COORDINATES]| {
            Mat::from_fn(COORDINATES, COORDINATES, |i, j| m[i][j])
        };
        let mass = full(&matrices.mass).partial_piv_lu();
        use faer::linalg::solvers::Solve as _;
        let [k, c] = [&matrices.stiffness, &matrices.damping].map(|m| mass.solve(full(m)));
        let unit = 1e4;
        let system = Mat::from_fn(STATES, STATES, |i, j| {
            let (row, column) = (i % COORDINATES, j % COORDINATES);
            let of_model = match (i < COORDINATES, j < COORDINATES) {
                (true, true) => 0.0,
                (true, false) => f64::from(u8::from(row == column)) * unit,
                (false, true) => -k[(row, column)] / unit,
                (false, false) => -c[(row, column)],
            };
            let turning = match (row, column, i / COORDINATES == j / COORDINATES) {
                (8, 9, true) => -speed,
                (9, 8, true) => speed,
                _ => 0.0,
            };
            of_model + turning
        });
        let row = Settings::new(&point).case(speed_rpm).unwrap().row;
        let ours = found(&row).1;
        // The suspension's.
        let slow = system.eigenvalues().unwrap().into_iter().filter(|s| s.norm() < 100.0);
        let slow: Vec<c64> = slow.collect();
        assert_eq!(slow.len(), 2 * SUSPENSION_MODES, "{slow:?}");
        for s in slow {
            let mu = (s * turn_s).exp();
            let nearest = ours.iter().map(|our| (our - mu).norm()).fold(f64::INFINITY, f64::min);
            println!("{speed_rpm}: {s} {nearest:e}");
            assert!(nearest < 1e-4, "{speed_rpm}: {s} {nearest:e}");
        }
    }
}

#[test]
fn the_product_of_all_multipliers_is_the_exponential_of_the_trace() {
    let point = prepared(with(0.4, 140.0), 250.0);
    let capped = Settings::new(&point).case(250.0).unwrap().row;
    // With steps so short that the formula takes nothing from the capped modes.
    let row = Row { steps: 32 * capped.steps, ..capped };
    let (found, multipliers) = found(&row);
    let product = multipliers.into_iter().product::<c64>();
    let trace = Simd::one_lane(Trace { row, start: found.start });
    let error = product.re.ln() / trace - 1.0;
    println!("{product} {trace} {error:e}");
    assert!(error.abs() < 1e-5 && product.im.abs() < 1e-9, "{product} {trace} {error:e}");
}

#[test]
fn responses_do_not_depend_on_company() {
    let points = [with(0.4, 140.0), with(0.9, 90.0), with(0.05, 300.0)].map(|m| prepared(m, 100.0));
    let dwells: Vec<_> = (0..30)
        .map(|k| Dwell { point: &points[k % 3], speed_rpm: 20.0 + 40.0 * k as f64 })
        .collect();
    let together = respond(&dwells);
    for (dwell, answer) in dwells.iter().zip(&together).step_by(7) {
        assert_eq!(&respond(&[*dwell])[0], answer);
    }
}

#[test]
fn val_the_linear_models_exact_motions_differ_from_frozen_ones() {
    // By another program: 65.20 against 65.95 per minute in the first mode at 1200 rpm, and a
    // second mode whose damping differs by 8 % at its resonance.
    let point = prepared(with(0.4, 140.0), 100.0);
    let first = exact_motions(&point, 1200.0).unwrap()[0];
    println!("{} {}", first.frequency_rpm(), first.frozen.frequency_rpm());
    assert!((first.frequency_rpm() - 65.20).abs() < 0.01);
    let second = exact_motions(&point, 147.76).unwrap()[1];
    let apart = second.damping_ratio() / second.frozen.damping_ratio() - 1.0;
    println!("{apart}");
    assert!((apart.abs() - 0.08).abs() < 0.03, "{apart}");
}

#[test]
#[ignore = "prints what a response costs"]
fn cost() {
    let point = prepared(with(0.4, 140.0), 100.0);
    let dwells: Vec<_> =
        (0..560).map(|k| Dwell { point: &point, speed_rpm: 210.0 + 0.25 * f64::from(k) }).collect();
    let began = std::time::Instant::now();
    let count = respond(&dwells).iter().filter(|a| a.is_ok()).count();
    println!("{:.3} ms each, {count} found", 1e3 * began.elapsed().as_secs_f64() / 560.0);
}

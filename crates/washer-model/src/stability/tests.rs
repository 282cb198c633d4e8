//! Against numbers from a program independent of this one, against the machine as it is, and
//! against its simulation.

mod company;

use super::orbit::{Row, linear_responses};
use super::plain::{Plain, Trace};
use super::search::{Solve, finish};
use super::settings::Settings;
use super::*;
use crate::coordinates::COORDINATES;
use crate::steps::SUSPENSION_MODES;
use crate::tests::reference::reference;
use crate::{BumpStop, Channel, Machine, Method, ModelKind, Spin, Start, Timing, history, prepare};
use faer::{Mat, c64};
use lane_ode::{Cancel, Simd};
use serde_json::Value;
use std::f64::consts::PI;

const TIMING: Timing = Timing { end_s: 20.0, window_s: [0.0, 20.0], checkpoints: 0 };

pub(super) fn prepared(machine: Machine, speed_rpm: f64) -> Point {
    let spin = Spin::Table { time_s: vec![0.0], speed_rpm: vec![speed_rpm] };
    prepare(Simd::best(), &[(machine, spin)], &TIMING).remove(0).unwrap()
}

fn paper(case: &Value) -> Machine {
    with(number(case, "unbalance_mass_kg"), number(case, "damping_n_s_per_m"))
}

pub(super) fn with(unbalance_mass_kg: f64, damping_n_s_per_m: f64) -> Machine {
    let mut machine = Machine::paper();
    machine.unbalance.mass_kg = unbalance_mass_kg;
    machine.dampers.iter_mut().for_each(|d| d.damping_n_s_per_m = damping_n_s_per_m);
    machine
}

/// A stop that the tub never comes near, and that would do nothing.
pub(super) fn idle_stop() -> BumpStop {
    BumpStop {
        tub_m: [0.35, -0.28, 0.0],
        direction: [0.0, -1.0, 0.0],
        clearance_m: 1.0,
        stiffness_n_per_m: 0.0,
        damping_n_s_per_m: 0.0,
        softness_m: 1e-4,
    }
}

fn number(case: &Value, name: &str) -> f64 {
    case[name].as_f64().unwrap()
}

fn list(name: &str) -> Vec<Value> {
    reference("stability.json")[name].as_array().unwrap().clone()
}

/// The responses of one machine at these speeds.
fn over(machine: Machine, speeds_rpm: &[f64]) -> Vec<Response> {
    over_point(&prepared(machine, 100.0), speeds_rpm)
}

fn over_point(point: &Point, speeds_rpm: &[f64]) -> Vec<Response> {
    let dwells: Vec<_> = speeds_rpm.iter().map(|&speed_rpm| Dwell { point, speed_rpm }).collect();
    all(&dwells).into_iter().map(|responses| responses.unwrap().remove(0)).collect()
}

/// All responses of some dwells.
fn all(dwells: &[Dwell<'_>]) -> Vec<Result<Vec<Response>, NoAnswer>> {
    respond(dwells, Cancel::Never)
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

/// Finds a row's response near a state, and every multiplier.
fn found(row: &Row<'_>, start: [f64; STATES]) -> ([f64; STATES], Vec<c64>) {
    let mut solves = [Solve::new(*row, start, None)];
    assert!(finish(&mut solves, Cancel::Never));
    let [solve] = solves;
    let (start, seen) = solve.found().unwrap();
    let unit = |i: usize| if i < COORDINATES { 1.0 } else { row.unit_per_s() };
    let matrix = Mat::from_fn(STATES, STATES, |i, j| seen.monodromy[i][j].0 * unit(j) / unit(i));
    (start, matrix.eigenvalues().unwrap())
}

#[test]
fn val_growth_and_amplitudes_match_an_independent_program() {
    for case in list("points") {
        let ours = at(paper(&case), number(&case, "speed_rpm"));
        let [growth, frequency] = ["growth_per_s", "frequency_cpm"].map(|name| number(&case, name));
        // If all decays, the hinge decays slowest, which is left out here.
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

/// Stiff bearings are capped with the hinge, and soft ones are not. The growth is that of the
/// suspension either way, not that of the hinge, which decays half as fast.
#[test]
fn growth_of_a_stable_response_hardly_depends_on_stiff_bearings() {
    let at = |stiffness_n_per_m: f64| {
        let mut machine = crate::tests::friction::machine(0.4, [40.0, 40.0], None);
        machine.bearings.front_stiffness_n_per_m = stiffness_n_per_m;
        machine.bearings.rear_stiffness_n_per_m = stiffness_n_per_m;
        at(machine, 420.0).growth_per_s()
    };
    let uncapped_per_s = at(1e8);
    for stiffness_n_per_m in [1e9, 5e10] {
        let growth_per_s = at(stiffness_n_per_m);
        println!("{stiffness_n_per_m:e} N/m: {growth_per_s}, uncapped {uncapped_per_s}");
        let apart = growth_per_s / uncapped_per_s - 1.0;
        assert!(apart.abs() < 0.1, "{stiffness_n_per_m:e} N/m: {growth_per_s}, {uncapped_per_s}");
    }
}

/// Returns how far a small disturbance of a dwell moves the machine from turn to turn: what the
/// response itself has in it drops out.
fn simulated(machine: Machine, response: &Response, end_s: f64) -> Vec<[f64; COORDINATES]> {
    let speed_rpm = response.speed_rpm;
    let point = prepared(machine, speed_rpm);
    let step_s = if point.machine.elements.are_nonsmooth() { 5e-5 } else { 2e-4 };
    let mut start = Start::default();
    for i in 0..COORDINATES {
        start.deviations[i] = response.start[i] - point.equilibrium()[i];
        start.speeds[i] = response.start[COORDINATES + i];
    }
    for i in [4, 5] {
        start.deviations[i] += 1e-6;
    }
    let turn_s = 60.0 / speed_rpm;
    let method = Method::Rk4 { step_s };
    let history = history(ModelKind::Nonlinear, &method, &point, &start, turn_s);
    let turns = (TIMING.end_s.min(end_s) / turn_s) as usize;
    let states: Vec<[f64; COORDINATES]> =
        (0..turns).map(|k| history.instant(k).unwrap().deviations).collect();
    states.windows(2).map(|pair| core::array::from_fn(|i| pair[1][i] - pair[0][i])).collect()
}

/// Returns how fast that grows.
fn simulated_growth_per_s(machine: Machine, response: &Response) -> f64 {
    // A thousandfold at most: after that the disturbance is not small.
    let moved = simulated(machine, response, 7.0 / response.growth_per_s());
    let turns_per_s = response.speed_rpm / 60.0;
    largest_multiplier(&moved).ln() * turns_per_s
}

/// Returns the size of the multiplier that these moves of once a turn grow by.
///
/// Once the others have decayed, a single real multiplier is left, a pair, or one beside a pair. By
/// the characteristic polynomial of these n, each move is a linear combination of the n before it,
/// which least squares give: the multipliers are the eigenvalues of its companion matrix. With too
/// many the equations are singular, and their solution is rounding, so a further one is fitted only
/// if fewer leave more than rounding, and a third only if a pair leaves more than motions that have
/// nearly decayed.
fn largest_multiplier(moved: &[[f64; COORDINATES]]) -> f64 {
    /// The greatest parts of the moves that a single multiplier and a pair leave, if they are all.
    const LEFT: [f64; 2] = [1e-6, 1e-2];
    let late = &moved[moved.len().div_ceil(2)..];
    let fit = |count: usize| {
        use faer::linalg::solvers::SolveLstsq as _;
        let rows = (late.len() - count) * COORDINATES;
        let at = |row: usize, turn: usize| late[row / COORDINATES + turn][row % COORDINATES];
        let before = Mat::from_fn(rows, count, at);
        let after = Mat::from_fn(rows, 1, |i, _| at(i, count));
        let factors = before.qr().solve_lstsq(&after);
        let left = (&before * &factors - &after).norm_l2() / after.norm_l2();
        let companion = Mat::from_fn(count, count, |i, k| match i + 1 == count {
            true => factors[(k, 0)],
            false => f64::from(u8::from(k == i + 1)),
        });
        let sizes = companion.eigenvalues().unwrap().into_iter().map(|mu| mu.norm());
        (sizes.fold(0.0, f64::max), left)
    };
    let [single, pair] = [1, 2].map(fit);
    if single.1 < LEFT[0] {
        single.0
    } else if pair.1 < LEFT[1] {
        pair.0
    } else {
        fit(3).0
    }
}

/// A single multiplier, beside which another has decayed to rounding, a pair, and both.
#[test]
fn the_largest_multiplier_is_found_of_one_to_three() {
    let shape: [f64; COORDINATES] = core::array::from_fn(|i| 1e-6 * (1.0 + i as f64));
    let other: [f64; COORDINATES] = core::array::from_fn(|i| 1e-6 * (i as f64 - 4.3));
    let moves = |of: &dyn Fn(i32) -> [f64; 2]| -> Vec<[f64; COORDINATES]> {
        let at = |k: i32| {
            let [a, b] = of(k);
            core::array::from_fn(|i| a * shape[i] + b * other[i])
        };
        (0..60).map(at).collect()
    };
    let single = moves(&|k| [(-1.09_f64).powi(k), 0.3_f64.powi(k)]);
    assert!((largest_multiplier(&single) - 1.09).abs() < 1e-6, "{}", largest_multiplier(&single));
    let pair = moves(&|k| {
        let size = 1.07_f64.powi(k);
        [size * (2.1 * f64::from(k)).cos(), size * (2.1 * f64::from(k)).sin()]
    });
    assert!((largest_multiplier(&pair) - 1.07).abs() < 1e-6, "{}", largest_multiplier(&pair));
    let two = moves(&|k| [(-1.09_f64).powi(k), 1.05_f64.powi(k)]);
    assert!((largest_multiplier(&two) - 1.09).abs() < 1e-6, "{}", largest_multiplier(&two));
    // The shares of a machine whose pair and third multiplier grow nearly as fast.
    let three = moves(&|k| {
        let size = 1.25_f64.powi(k);
        let pair = size * (2.1 * f64::from(k)).cos();
        [pair, 0.5 * size * (2.1 * f64::from(k)).sin() + (-1.2_f64).powi(k)]
    });
    assert!((largest_multiplier(&three) - 1.25).abs() < 1e-6, "{}", largest_multiplier(&three));
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
        let turn_s = 60.0 / speed_rpm;
        let speed = speed_rpm * TAU / 60.0;
        let matrices = point.matrices(0.0, speed, 0.0);
        let full = |m: &[[f64; COORDINATES]; COORDINATES]| {
            Mat::from_fn(COORDINATES, COORDINATES, |i, j| m[i][j])
        };
        let mass = full(&matrices.mass).partial_piv_lu();
        use faer::linalg::solvers::Solve as _;
        let [k, c] = [&matrices.stiffness, &matrices.damping].map(|m| mass.solve(full(m)));
        let unit = 1e4;
        let system = Mat::from_fn(STATES, STATES, |i, j| {
            let row = i % COORDINATES;
            let column = j % COORDINATES;
            let model = match (i < COORDINATES, j < COORDINATES) {
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
            model + turning
        });
        let row = Settings::new(&point).case(speed_rpm).unwrap().row;
        let rest =
            core::array::from_fn(|i| if i < COORDINATES { point.equilibrium()[i] } else { 0.0 });
        let ours = found(&row, rest).1;
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
    let near = at(with(0.4, 140.0), 250.0).start;
    let (start, multipliers) = found(&row, near);
    let product = multipliers.into_iter().product::<c64>();
    let trace = Simd::one_lane(Trace { row, start });
    let error = product.re.ln() / trace - 1.0;
    println!("{product} {trace} {error:e}");
    assert!(error.abs() < 1e-5 && product.im.abs() < 1e-9, "{product} {trace} {error:e}");
}

#[test]
fn responses_do_not_depend_on_company() {
    let points = [with(0.4, 140.0), with(0.9, 90.0), with(0.05, 300.0)].map(|m| prepared(m, 100.0));
    let mut rubs = with(0.4, 20.0);
    add_elements(&mut rubs, &mut fastrand::Rng::with_seed(1));
    let rubs = prepared(rubs, 100.0);
    let dwells: Vec<_> = (0..30)
        .map(|k| Dwell { point: &points[k % 3], speed_rpm: 20.0 + 40.0 * k as f64 })
        .chain([240.0, 270.0, 300.0].map(|speed_rpm| Dwell { point: &rubs, speed_rpm }))
        .collect();
    let together = all(&dwells);
    for (dwell, answer) in dwells.iter().zip(&together).step_by(8) {
        assert_eq!(&all(&[*dwell])[0], answer);
    }
    // At 20 rpm, the first, a machine is slower than where its curve begins.
    assert!(together[0].as_ref().unwrap()[0].is_on_curve);
}

/// Followed both ways every 0.25 rpm by an independent program, and lost where it folds.
#[test]
fn val_branches_match_an_independent_program() {
    for case in reference("branches.json").as_array().unwrap() {
        let machine = with(number(case, "unbalance_mass_kg"), number(case, "damping_n_s_per_m"));
        let point = prepared(machine, 100.0);
        let mut folds_rpm = Vec::new();
        for (way, lost) in [("up", "up_lost_after_rpm"), ("down", "down_lost_below_rpm")] {
            let rows = case[way].as_array().unwrap();
            let dwells: Vec<Dwell<'_>> = rows
                .iter()
                .map(|row| Dwell { point: &point, speed_rpm: number(row, "speed_rpm") })
                .collect();
            for (row, responses) in rows.iter().zip(all(&dwells)) {
                let responses = responses.unwrap();
                let ours = if way == "up" { responses.first() } else { responses.last() }.unwrap();
                for (channel, name) in [(6, "tub_yaw_rad"), (7, "tub_pitch_rad")] {
                    let error = ours.nonlinear[channel] / number(row, name) - 1.0;
                    assert!(error.abs() < 1e-4, "{row}: {name} {error:e}");
                }
                let growth = number(row, "growth_per_s");
                if growth > 0.0 {
                    let apart = ours.growth_per_s() - growth;
                    assert!(apart.abs() < 5e-3, "{row}: {apart:e}");
                }
                folds_rpm.extend(ours.between_rpm);
            }
            if let Some(lost_rpm) = case[lost].as_f64() {
                let nearest = folds_rpm.iter().flatten().map(|rpm: &f64| (rpm - lost_rpm).abs());
                let nearest = nearest.fold(f64::INFINITY, f64::min);
                println!("{lost_rpm} rpm: a fold {nearest} rpm from it");
                assert!(nearest < 0.1, "{lost}: {folds_rpm:?}");
            }
        }
    }
}

/// The curve creeps up to a spring that passes its hook, and comes to no speed above 148 rpm.
#[test]
fn where_the_curve_is_lost_another_comes_down() {
    let point = prepared(with(0.9, 20.0), 100.0);
    let dwells = [240.0, 260.0, 340.0].map(|speed_rpm| Dwell { point: &point, speed_rpm });
    let found: Vec<_> = all(&dwells).into_iter().map(Result::unwrap).collect();
    // A response that a search finds comes first.
    let [beside, down] = &found[0][..] else { panic!("{found:?}") };
    assert_eq!((beside.branch, beside.between_rpm), (down.branch + 1, [None; 2]));
    for responses in &found[1..] {
        let [response] = &responses[..] else { panic!("{found:?}") };
        assert_eq!((response.branch, response.between_rpm), (down.branch, down.between_rpm));
    }
    assert!(down.between_rpm[0].is_some() && !found.concat().iter().any(|it| it.is_on_curve));
    assert_eq!([1, 2].map(|k| found[k][0].kind()), [Kind::PeriodDoubling, Kind::Stable]);
}

/// A machine of its own: masses, inertias, stiffnesses, damping and unbalance of the paper's,
/// each times a factor.
fn random(random: &mut fastrand::Rng) -> Machine {
    let mut factor = |least: f64, most: f64| least * (most / least).powf(random.f64());
    let mut machine = with(factor(0.05, 1.5), factor(30.0, 250.0));
    machine.tub.mass_kg *= factor(0.5, 2.0);
    machine.drum.mass_kg *= factor(0.5, 2.0);
    for i in 0..3 {
        machine.tub.inertia_kg_m2[i] *= factor(0.6, 1.6);
    }
    machine.springs.iter_mut().for_each(|s| s.stiffness_n_per_m *= factor(0.5, 2.0));
    machine.dampers.iter_mut().for_each(|d| d.damping_n_s_per_m *= factor(0.7, 1.4));
    machine.flexure.stiffness_n_m_per_rad *= factor(0.5, 2.0);
    machine
}

/// Friction in the dampers, and stops to either side, for a machine.
fn add_elements(machine: &mut Machine, random: &mut fastrand::Rng) {
    let friction_n = 5.0 + 75.0 * random.f64();
    for damper in &mut machine.dampers {
        damper.friction_n = friction_n;
        damper.friction_linear_speed_m_per_s = Some(0.1);
    }
    let clearance_m = 0.004 + 0.016 * random.f64();
    machine.stops = [1.0, -1.0]
        .map(|side| BumpStop {
            tub_m: [0.35, 0.0, 0.28 * side],
            direction: [0.0, 0.0, side],
            clearance_m,
            stiffness_n_per_m: 4e4,
            damping_n_s_per_m: 100.0,
            softness_m: 1e-4,
        })
        .into();
}

/// Random machines, every other with friction and stops: disturbances of simulated dwells grow as
/// fast as is said, or decay where the response is said to be stable. SEED and MACHINES choose
/// others.
#[test]
#[ignore = "minutes of work"]
fn random_machines_do_what_is_said() {
    let given = |name: &str, or: u64| std::env::var(name).map_or(or, |it| it.parse().unwrap());
    let mut numbers = fastrand::Rng::with_seed(given("SEED", 2026));
    let mut grown = [0, 0];
    let mut decayed = [0, 0];
    let mut worst = [0.0_f64; 2];
    let machines = given("MACHINES", 3);
    // Few machines may have no growing response: more are drawn until there is one of either kind.
    let lacks = |counts: &[i32]| counts.contains(&0);
    for number in 0..machines + 40 {
        if number >= machines && !lacks(&grown) && !lacks(&decayed) {
            break;
        }
        let kind = (number % 2) as usize;
        let mut machine = random(&mut numbers);
        if kind == 1 {
            add_elements(&mut machine, &mut numbers);
        }
        let point = prepared(machine.clone(), 100.0);
        let speeds: Vec<f64> = (0..40).map(|_| 60.0 + 300.0 * numbers.f64()).collect();
        let dwells: Vec<_> =
            speeds.iter().map(|&speed_rpm| Dwell { point: &point, speed_rpm }).collect();
        let found = all(&dwells);
        let there = || found.iter().flatten().filter_map(|responses| responses.first());
        for response in there().filter(|it| (0.2..2.0).contains(&it.growth_per_s())).take(2) {
            let simulated = simulated_growth_per_s(machine.clone(), response);
            let error = (simulated / response.growth_per_s() - 1.0).abs();
            println!("machine {number}, {} rpm: {error:e}", response.speed_rpm);
            worst[kind] = worst[kind].max(error);
            grown[kind] += 1;
        }
        for response in there().filter(|it| it.growth_per_s() < -0.3).take(1) {
            let moved = simulated(machine.clone(), response, 20.0);
            let size = |d: &[f64; COORDINATES]| d[4].abs().max(d[5].abs());
            let largest = |moved: &[[f64; COORDINATES]]| moved.iter().map(size).fold(0.0, f64::max);
            // Against the disturbance itself: what had left for another motion would have moved
            // farthest on its way, and rest in the end.
            let [begin, end] = [moved.len() / 5, moved.len() * 4 / 5];
            let disturbance = largest(&moved[..begin]);
            let left = largest(&moved[end..]) / disturbance;
            println!("machine {number}, {} rpm: {left:e} left", response.speed_rpm);
            assert!(disturbance < 1e-4, "machine {number}: {response:?}");
            assert!(left < 0.1, "machine {number}: {response:?}");
            decayed[kind] += 1;
        }
    }
    println!("{grown:?} grown, worst {worst:?}; {decayed:?} decayed");
    assert!(worst[0] < 0.02 && worst[1] < 0.05, "{worst:?}");
    assert!(!lacks(&grown) && !lacks(&decayed), "{grown:?} grown, {decayed:?} decayed");
}

/// A curve rises through a speed and falls through it in turn: of random machines with little
/// damping, neighbouring branches have an even and an odd number. SEED and MACHINES choose others.
#[test]
fn no_branch_is_lost_between_two_others() {
    let given = |name: &str, or: u64| std::env::var(name).map_or(or, |it| it.parse().unwrap());
    let mut numbers = fastrand::Rng::with_seed(given("SEED", 61));
    let mut folded = 0;
    let mut lost = Vec::new();
    for number in 0..given("MACHINES", 4) {
        let mut machine = random(&mut numbers);
        let damping_n_s_per_m = 10.0 + 50.0 * numbers.f64();
        machine.dampers.iter_mut().for_each(|it| it.damping_n_s_per_m = damping_n_s_per_m);
        machine.springs.iter_mut().for_each(|it| it.cubic_n_per_m3 = 5e6 * numbers.f64());
        let point = prepared(machine, 100.0);
        let speeds: Vec<f64> = (0..120).map(|_| 90.0 + 250.0 * numbers.f64()).collect();
        let dwells: Vec<_> =
            speeds.iter().map(|&speed_rpm| Dwell { point: &point, speed_rpm }).collect();
        for (responses, speed_rpm) in all(&dwells).into_iter().zip(speeds) {
            let Ok(responses) = responses else { continue };
            let on_curve = responses.iter().filter(|response| response.is_on_curve);
            let branches: Vec<u32> = on_curve.map(|response| response.branch).collect();
            let alternates = |pair: &[u32]| pair[0] % 2 != pair[1] % 2;
            folded += usize::from(branches.len() > 1);
            if !branches.windows(2).all(alternates) {
                lost.push((number, speed_rpm, branches));
            }
        }
    }
    println!("{folded} speeds with several responses");
    assert!(folded > 0 && lost.is_empty(), "{lost:?}");
}

/// Responses of random machines are those that steps of 0.05 rpm lead to, until these are lost; and
/// there the curve has a fold.
#[test]
#[ignore = "minutes of work"]
fn followed_responses_are_those_of_short_steps() {
    let count = 30;
    let mut numbers = fastrand::Rng::with_seed(32);
    let points: Vec<Point> = (0..count).map(|_| prepared(random(&mut numbers), 100.0)).collect();
    let speed = |step: u32| 60.0 + 0.05 * f64::from(step);
    let mut settings: Vec<Settings<'_>> = points.iter().map(Settings::new).collect();
    let mut states: Vec<Option<[f64; STATES]>> =
        points.iter().map(|point| Some(over_point(point, &[speed(0)])[0].start)).collect();
    // The change of each by the last step: across a resonance steps move a response far, but the
    // next one hardly farther than the last.
    let mut moved = vec![0.0_f64; count];
    let mut kept = Vec::new();
    let mut worst = 0.0_f64;
    let mut jumps = Vec::new();
    for step in 1..=6000 {
        let followed = settings.iter_mut().zip(&states);
        let mut solves: Vec<Solve<'_>> = followed
            .filter_map(|(settings, state)| {
                Some(Solve::new(settings.case(speed(step)).unwrap().row, (*state)?, None))
            })
            .collect();
        assert!(finish(&mut solves, Cancel::Never));
        let mut solves = solves.into_iter();
        for (k, state) in states.iter_mut().enumerate() {
            let Some(from) = *state else { continue };
            let found = solves.next().unwrap().found().map(|(found, _)| found);
            let by = |to: &[f64; STATES]| {
                (0..COORDINATES).map(|i| (to[i] - from[i]).abs()).fold(0.0, f64::max)
            };
            *state = found.filter(|found| by(found) < f64::max(1e-3, 5.0 * moved[k]));
            moved[k] = state.as_ref().map_or(0.0, by);
            if state.is_none() {
                jumps.push((k, speed(step)));
            }
        }
        if step % 100 == 0 {
            let here = states.iter().enumerate();
            kept.extend(here.filter_map(|(k, state)| Some((k, speed(step), (*state)?))));
        }
    }
    // The curve of each point is followed once.
    kept.sort_by_key(|(k, ..)| *k);
    let dwells: Vec<_> =
        kept.iter().map(|&(k, speed_rpm, _)| Dwell { point: &points[k], speed_rpm }).collect();
    for (responses, (k, speed_rpm, state)) in all(&dwells).into_iter().zip(&kept) {
        let apart = responses.map_or(f64::NAN, |responses| {
            let apart = (0..COORDINATES).map(|i| (responses[0].start[i] - state[i]).abs());
            apart.fold(0.0, f64::max)
        });
        worst = worst.max(apart);
        if apart.is_nan() || apart >= 1e-6 {
            println!("machine {k} at {speed_rpm} rpm: {apart:e}");
        }
        assert!(!apart.is_nan());
    }
    println!("{} compared, at most {worst:e} apart; jumps: {jumps:?}", kept.len());
    for (k, lost_rpm) in jumps {
        let ends = over_point(&points[k], &[lost_rpm - 0.3])[0].between_rpm;
        assert!(ends[1].is_some_and(|fold| (fold - lost_rpm).abs() < 0.3), "{k}: {ends:?}");
    }
    assert!(worst < 1e-6);
}

/// A drum with two different inertias across its axis drives the hinge by harmonics of its turn.
#[test]
fn near_resonances_of_the_hinge_responses_are_those_of_the_machine_as_it_is() {
    let mut machine = with(0.8, 140.0);
    machine.drum.inertia_kg_m2[2] *= 1.3;
    machine.springs[0].stiffness_n_per_m *= 1.2;
    let point = prepared(machine, 100.0);
    let mut settings = Settings::new(&point);
    let speeds: Vec<f64> = (0..=20)
        .flat_map(|k| [630.0, 760.0, 830.0, 960.0].map(|from| from + 3.0 * f64::from(k)))
        .collect();
    let ours = over_point(&point, &speeds);
    let mut plain: Vec<Solve<'_>> = speeds
        .iter()
        .zip(&ours)
        .map(|(&rpm, ours)| {
            Solve::new(settings.case(rpm).unwrap().without_caps().unwrap().row, ours.start, None)
        })
        .collect();
    assert!(finish(&mut plain, Cancel::Never));
    let mut worst = 0.0_f64;
    for (ours, plain) in ours.iter().zip(plain) {
        let plain = plain.found().unwrap().1.peaks;
        for k in 0..CHANNELS {
            let apart = (ours.nonlinear[k] / plain[k] - 1.0).abs();
            worst = worst.max(apart);
            assert!(apart < 6e-5, "{} rpm, channel {k}: {apart:e}", ours.speed_rpm);
        }
    }
    println!("{worst:e}");
}

/// Friction, stops, a gasket, stiffening springs, a second unbalance.
#[test]
fn val_machines_with_elements_match_an_independent_program() {
    let mut compared = 0;
    for case in reference("stability_elements.json").as_array().unwrap() {
        let point = prepared(crate::tests::elements::machine(case), 100.0);
        let rows = case["points"].as_array().unwrap();
        let dwells: Vec<Dwell<'_>> = rows
            .iter()
            .map(|row| Dwell { point: &point, speed_rpm: number(row, "speed_rpm") })
            .collect();
        for (row, responses) in rows.iter().zip(all(&dwells)) {
            assert_eq!(row["converged"], true);
            let place = format!("{} at {} rpm", case["name"], row["speed_rpm"]);
            let ours = responses.unwrap_or_else(|none| panic!("{place}: {none}")).remove(0);
            for channel in [0, 1, 6, 7] {
                let name = Channel::ALL[channel].name();
                let unit = Channel::ALL[channel].unit();
                let theirs = number(row, &format!("amplitude_{name}_{unit}"));
                let error = ours.nonlinear[channel] / theirs - 1.0;
                assert!(error.abs() < 1.2e-5, "{place}: {name} {error:e}");
            }
            // If all decays, the hinge decays slowest, which is left out here.
            let growth = number(row, "growth_per_s");
            if growth > 0.0 {
                let apart = ours.growth_per_s() - growth;
                assert!(apart.abs() < 1e-3, "{place}: {apart:e}");
            }
            compared += 1;
        }
    }
    assert_eq!(compared, 39);
}

#[test]
fn val_the_linear_models_exact_motions_differ_from_frozen_ones() {
    // Another program has 65.20 against 65.95 per minute in the first mode at 1200 rpm, and a
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
fn a_linear_response_takes_friction_at_its_own_speed() {
    let of = |speed_rpm: f64, given_m_per_s: Option<f64>| {
        let machine = crate::tests::friction::machine(0.3, [40.0, 60.0], given_m_per_s);
        let point = prepared(machine, speed_rpm);
        let case = Settings::new(&point).case(150.0).unwrap();
        let peaks = linear_responses(&[case.row], Cancel::Never).remove(0).peaks;
        (point.friction_speeds()[0].speed_m_per_s, peaks[Channel::TubFrontZ.index()])
    };
    let [(slow_m_per_s, slow_m), (fast_m_per_s, fast_m)] = [of(60.0, None), of(300.0, None)];
    assert!((slow_m_per_s / fast_m_per_s - 1.0).abs() > 0.1, "{slow_m_per_s}, {fast_m_per_s}");
    assert!((slow_m / fast_m - 1.0).abs() < 3e-3, "whatever the run: {slow_m}, {fast_m}");
    let (_, given_m) = of(60.0, Some(fast_m_per_s));
    assert!((given_m / slow_m - 1.0).abs() > 0.01, "{given_m}, {slow_m}");
}

#[test]
#[ignore = "prints what a response costs"]
fn cost() {
    let point = prepared(with(0.4, 140.0), 100.0);
    let dwells: Vec<_> =
        (0..560).map(|k| Dwell { point: &point, speed_rpm: 210.0 + 0.25 * f64::from(k) }).collect();
    let began = std::time::Instant::now();
    let count = all(&dwells).iter().filter(|a| a.is_ok()).count();
    println!("{:.3} ms each, {count} found", 1e3 * began.elapsed().as_secs_f64() / 560.0);
}

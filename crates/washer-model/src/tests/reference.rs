//! Tests against numbers from independent programs (`tests/reference/README.md` says how they
//! were made).

use crate::coordinates::COORDINATES;
use crate::linear;
use crate::machine::Machine;
use crate::machine::spin::SpinState;
use crate::nonlinear;
use crate::nonlinear::coefficients::MachineCoefficients;
use crate::nonlinear::coupling::{Coupling, Sag};
use crate::nonlinear::equilibrium;
use crate::{
    Channel, Method, ModelKind, Profile, Spin, Timing, highest_frequency_rad_per_s, modes, prepare,
    simulate,
};
use core::f64::consts::TAU;
use lane_ode::{N, OutOfLine, Simd};
use serde_json::Value;

pub(crate) fn read_reference(file: &str) -> Value {
    let path = format!("{}/tests/reference/{file}", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

pub(crate) fn read_numbers<const K: usize>(value: &Value) -> [f64; K] {
    let numbers = value.as_array().unwrap();
    std::array::from_fn(|i| numbers[i].as_f64().unwrap())
}

/// Asserts that each entry of a matrix differs from the reference by less than `tolerance`,
/// relative to the largest entry of the reference. Returns the greatest difference.
pub(crate) fn assert_matrix(
    name: &str,
    computed: &[[f64; COORDINATES]; COORDINATES],
    reference: &Value,
    tolerance: f64,
) -> f64 {
    let rows = reference.as_array().unwrap();
    let expected: [[f64; COORDINATES]; COORDINATES] =
        std::array::from_fn(|i| read_numbers(&rows[i]));
    let max_magnitude = expected.iter().flatten().fold(0.0_f64, |m, a| m.max(a.abs()));
    let mut max_error = 0.0_f64;
    for i in 0..COORDINATES {
        for j in 0..COORDINATES {
            let error = (computed[i][j] - expected[i][j]).abs() / max_magnitude;
            assert!(
                error < tolerance,
                "{name}[{i}][{j}]: {} against {}",
                computed[i][j],
                expected[i][j]
            );
            max_error = max_error.max(error);
        }
    }
    max_error
}

/// Returns the paper's machine with the unbalance mass and damping of a case.
pub(crate) fn read_machine(case: &Value) -> Machine {
    let mut machine = Machine::paper();
    machine.unbalance.mass_kg = case["unbalance_mass"].as_f64().unwrap();
    if let Some(damping) = case["damping"].as_f64() {
        machine.dampers.iter_mut().for_each(|d| d.damping_n_s_per_m = damping);
    }
    machine
}

pub(crate) fn read_spin(case: &Value) -> SpinState<f64> {
    let number = |name: &str| N(case[name].as_f64().unwrap());
    SpinState::new(number("theta").sin_cos(), number("theta_dot"), number("theta_ddot"))
}

#[test]
fn val_accelerations_match_an_independent_right_hand_side() {
    for case in read_reference("rhs.json")["cases"].as_array().unwrap() {
        let coefficients = MachineCoefficients::new(&read_machine(case));
        let [q, u] = ["q", "u"].map(|name| read_numbers::<COORDINATES>(&case[name]).map(N));
        let computed = nonlinear::accelerations(
            &coefficients,
            &Coupling::Springs,
            &Sag::new(&[0.0; COORDINATES]),
            &read_spin(case),
            &q,
            &u,
        );
        let expected: [f64; COORDINATES] = read_numbers(&case["acceleration"]);
        let max_magnitude = expected.iter().fold(0.0_f64, |m, a| m.max(a.abs()));
        for i in 0..COORDINATES {
            let error = (computed[i].0 - expected[i]).abs() / max_magnitude;
            assert!(
                error < 1e-9,
                "coordinate {}: {} against {}",
                i + 1,
                computed[i].0,
                expected[i]
            );
        }
    }
}

#[test]
fn val_equilibrium_matches_an_independent_solution() {
    for case in read_reference("equilibrium.json")["cases"].as_array().unwrap() {
        let (q, solved_lanes) =
            equilibrium::solve_equilibrium(N(0.0), &MachineCoefficients::new(&read_machine(case)));
        assert_eq!(solved_lanes & 1, 1);
        let expected: [f64; COORDINATES] = read_numbers(&case["q"]);
        for i in 0..COORDINATES {
            assert!(
                (q[i].0 - expected[i]).abs() < 1e-12,
                "q{}: {} against {}",
                i + 1,
                q[i].0,
                expected[i]
            );
        }
    }
}

#[test]
fn val_linear_matrices_match_an_independent_expansion() {
    for case in read_reference("linear_matrices.json")["cases"].as_array().unwrap() {
        let coefficients = MachineCoefficients::new(&read_machine(case));
        let (q, _) = equilibrium::solve_equilibrium(N(0.0), &coefficients);
        let point = linear::Linearisation { machine: &coefficients, q: &q }.run().remove(0);
        let computed = point.matrices(&coefficients.bodies, &read_spin(case));
        for (name, computed) in
            [("M", computed.mass), ("C", computed.damping), ("K", computed.stiffness)]
        {
            assert_matrix(name, &computed, &case[name], 1e-9);
        }
        let expected: [f64; COORDINATES] = read_numbers(&case["F"]);
        let max_magnitude = expected.iter().fold(0.0_f64, |m, a| m.max(a.abs()));
        for i in 0..COORDINATES {
            let error = (computed.force[i] - expected[i]).abs() / max_magnitude;
            assert!(error < 1e-9, "F[{i}]: {} against {}", computed.force[i], expected[i]);
        }
    }
}

#[test]
fn val_eigenvalues_match_an_independent_solution() {
    let timing = Timing { end_s: 1.0, window_s: [0.0, 1.0], checkpoints: 0 };
    for case in read_reference("modes.json")["cases"].as_array().unwrap() {
        let spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 100.0, ramp_s: 1.0 };
        let point =
            prepare(Simd::Scalar, &[(read_machine(case), spin)], &timing).remove(0).unwrap();
        let speed_rad_per_s = case["speed_rpm"].as_f64().unwrap() * TAU / 60.0;
        let computed =
            modes(&point, case["theta"].as_f64().unwrap(), speed_rad_per_s).unwrap().modes;
        for (computed, expected) in computed.iter().zip(case["eigenvalues"].as_array().unwrap()) {
            let [re, im] = read_numbers(expected);
            let error = (computed.re_per_s - re).hypot(computed.im_rad_per_s - im) / re.hypot(im);
            assert!(
                error < 1e-7,
                "{} {} against {re} {im}",
                computed.re_per_s,
                computed.im_rad_per_s
            );
        }
        let highest_rad_per_s = highest_frequency_rad_per_s(&point, speed_rad_per_s).unwrap();
        let [re, im] = read_numbers(case["eigenvalues"].as_array().unwrap().last().unwrap());
        // The reference's highest frequency is that at theta = 0 only.
        assert!(
            (highest_rad_per_s / f64::hypot(re, im) - 1.0).abs() < 2e-3,
            "{highest_rad_per_s} against {im}"
        );
    }
}

/// Reads the names of the columns and the rows of a reference CSV file.
fn read_table(file: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let path = format!("{}/tests/reference/{file}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names = lines.next().unwrap().split(',').map(str::to_owned).collect();
    let rows = lines.map(|line| line.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    (names, rows)
}

#[test]
fn val_reliability_map_matches_that_of_an_independent_program() {
    let (names, rows) = read_table("reliability_map.csv");
    let scenarios: Vec<_> = rows
        .iter()
        .map(|row| {
            let mut machine = Machine::paper();
            machine.unbalance.mass_kg = row[0];
            machine.dampers.iter_mut().for_each(|d| d.damping_n_s_per_m = row[1]);
            (machine, Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 })
        })
        .collect();
    let timing = Timing { end_s: 50.0, window_s: [30.0, 50.0], checkpoints: 0 };
    let simd = Simd::widest();
    let points: Vec<_> =
        prepare(simd, &scenarios, &timing).into_iter().map(Result::unwrap).collect();
    let points: Vec<_> = points.iter().collect();
    let method = Method::rk4(2e-4);
    let [nonlinear, linear] =
        [ModelKind::Nonlinear, ModelKind::Linear].map(|m| simulate(simd, m, &method, &points));
    let column_index = |name: &str| names.iter().position(|n| n == name).unwrap();
    let mut compared_count = 0;
    for (i, row) in rows.iter().enumerate() {
        let mut largest_ratio = 0.0_f64;
        for channel in Channel::ALL {
            if matches!(channel, Channel::TotalCentreY | Channel::TotalCentreZ) {
                continue;
            }
            let [computed_nonlinear, computed_linear] =
                [&nonlinear, &linear].map(|r| r[i].amplitudes[channel.index()]);
            largest_ratio = largest_ratio.max(computed_nonlinear / computed_linear);
            for (prefix, computed) in
                [("nonlinear", computed_nonlinear), ("linear", computed_linear)]
            {
                let expected = row[column_index(&format!("{prefix}_{}", channel.name()))];
                let is_regular = row[column_index("step_sensitivity")] < 1e-4;
                if prefix == "linear" || is_regular {
                    let error = (computed - expected).abs() / expected;
                    assert!(
                        error < 1e-4,
                        "{prefix} {} at {:?}: {computed} against {expected}",
                        channel.name(),
                        &row[..2]
                    );
                    compared_count += 1;
                }
            }
        }
        assert_eq!(
            largest_ratio < 2.0,
            row[column_index("ratio_max")] < 2.0,
            "verdict at {:?}",
            &row[..2]
        );
    }
    assert!(
        compared_count > 500,
        "only {compared_count} amplitudes were regular enough to compare"
    );
}

//! Tests of the orders of convergence, at the ends of steps and inside them.

use super::{
    CoupledEquation, Equation, SwingEquation, TestMethod, TestOutcome, TestTrajectory, solve,
};
use crate::{Segment, SegmentEnd, Simd, Tolerance};

const END_S: f64 = 6.0;

/// A tolerance that accepts any step. With segments of one step each, an adaptive method then has a
/// fixed step.
const ACCEPT_ALL: Tolerance = tolerance(1e30, u64::MAX);

/// Creates an equal relative and absolute tolerance.
const fn tolerance(relative: f64, max_steps: u64) -> Tolerance {
    Tolerance { relative, absolute: relative, max_steps, longest_step_s: None }
}

/// Returns the error at the end and the largest error inside a step, for each number of steps.
fn end_and_inside_errors(method: TestMethod, steps: &[u32]) -> Vec<[f64; 2]> {
    let trajectories: Vec<_> = steps
        .iter()
        .map(|&n| match method {
            TestMethod::Rk4 | TestMethod::Dop853 => {
                TestTrajectory::swing(1.0, END_S, 1, END_S / f64::from(n))
            }
            TestMethod::Dop853Adaptive(_) | TestMethod::Dopri5(_) | TestMethod::Additive(_) => {
                TestTrajectory::swing(1.0, END_S, n, END_S)
            }
        })
        .collect();
    let (outcomes, _) = solve::<SwingEquation, 3, 1>(Simd::widest(), method, &trajectories);
    let exact_state = SwingEquation::exact_state(&[1.0], END_S);
    let errors_of_outcome = |(n, outcome): (&u32, TestOutcome<3>)| {
        assert!(matches!(outcome.segment_end, SegmentEnd::Completed(_)), "{outcome:?}");
        assert_eq!((outcome.step_count.accepted, outcome.step_count.rejected), (u64::from(*n), 0));
        let end_error = (0..3).map(|i| (outcome.x[i] - exact_state[i]).abs()).fold(0.0, f64::max);
        [end_error, outcome.error_inside]
    };
    steps.iter().zip(outcomes).map(errors_of_outcome).collect()
}

/// Computes the slope of the logarithm of the error over that of the step, by least squares.
fn convergence_order(steps: &[u32], errors: impl Iterator<Item = f64>) -> f64 {
    let log_points: Vec<_> =
        steps.iter().zip(errors).map(|(&n, e)| (-f64::from(n).ln(), e.ln())).collect();
    let count = log_points.len() as f64;
    let (mx, my) =
        log_points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / count, y + p.1 / count));
    let (xy, xx) = log_points
        .iter()
        .fold((0.0, 0.0), |(xy, xx), p| (xy + (p.0 - mx) * (p.1 - my), xx + (p.0 - mx).powi(2)));
    xy / xx
}

/// Measures the slopes at the end and inside steps.
fn convergence_orders(name: &str, method: TestMethod, steps: &[u32]) -> [f64; 2] {
    let errors = end_and_inside_errors(method, steps);
    let orders = [0, 1].map(|column| convergence_order(steps, errors.iter().map(|e| e[column])));
    let [coarse, fine] = [0, steps.len() - 1].map(|i| errors[i][0]);
    eprintln!(
        "{name}: order {:.3}, between steps {:.3}; errors {coarse:.1e} to {fine:.1e}",
        orders[0], orders[1]
    );
    orders
}

#[test]
fn rk4_and_the_cubic_inside_its_steps_have_order_4() {
    let [order, inside] = convergence_orders("rk4", TestMethod::Rk4, &[200, 283, 400, 566, 800]);
    assert!((order - 4.0).abs() < 0.1, "order {order}");
    assert!((inside - 4.0).abs() < 0.1, "between steps {inside}");
}

#[test]
fn dop853_has_order_8_and_its_coefficients_are_consistent() {
    for method in [TestMethod::Dop853, TestMethod::Dop853Adaptive(ACCEPT_ALL)] {
        let [order, _] = convergence_orders(&format!("{method:?}"), method, &[10, 14, 20, 28]);
        assert!((7.7..9.3).contains(&order), "order {order}");
    }
}

#[test]
fn dop853_is_stable_on_the_imaginary_axis_to_its_limit() {
    let limit = crate::dop853::DOP853_STABILITY_LIMIT;
    for k in 1..=1000 {
        let y = limit * f64::from(k) / 1000.0;
        assert!(crate::dop853::amplification(y) <= 1.0 + 1e-9, "{y}");
    }
    assert!(crate::dop853::amplification(1.001 * limit) > 1.0);
}

#[test]
fn dopri5_and_its_dense_output_have_order_5() {
    // Dense output of order 4 has a local error of order h^5, which does not accumulate, so that it
    // is as accurate as the method.
    let [order, inside] =
        convergence_orders("dopri5", TestMethod::Dopri5(ACCEPT_ALL), &[64, 91, 128, 181, 256]);
    assert!((order - 5.0).abs() < 0.1, "order {order}");
    assert!((inside - 5.0).abs() < 0.1, "between steps {inside}");
}

#[test]
fn the_additive_method_has_order_5() {
    let [order, inside] =
        convergence_orders("additive", TestMethod::Additive(ACCEPT_ALL), &[64, 91, 128, 181, 256]);
    assert!((order - 5.0).abs() < 0.1, "order {order}");
    // The cubic inside steps has order 4.
    assert!((inside - 4.0).abs() < 0.1, "between steps {inside}");
}

#[test]
fn the_additive_method_keeps_the_tolerance_at_steps_beyond_the_stiff_period() {
    // With a rigid spring in place of the stiff one, the masses would oscillate at an angular
    // frequency of sqrt(1/2).
    let segments = vec![Segment { start_s: 0.0, end_s: 10.0, step_s: 1e-4 }];
    let trajectory =
        TestTrajectory { parameters: [1e8], start_state: [1.0, 1.0, 0.0, 0.0], segments };
    for relative in [1e-4, 1e-6] {
        let run_tolerance = tolerance(relative, 5_000);
        let (outcomes, _) = solve::<CoupledEquation, 4, 1>(
            Simd::widest(),
            TestMethod::Additive(run_tolerance),
            core::slice::from_ref(&trajectory),
        );
        let TestOutcome { segment_end, x, step_count, .. } = outcomes[0];
        assert!(matches!(segment_end, SegmentEnd::Completed(_)), "{segment_end:?}");
        let error = (x[0] - (10.0 * 0.5_f64.sqrt()).cos()).abs();
        eprintln!("additive at {relative:e}: error {error:.1e}, {step_count:?}");
        assert!(error < 10.0 * relative, "{relative:e} gave {error:e}");
        // An explicit formula would need about 5e4 steps.
        assert!(step_count.accepted + step_count.rejected < 1_000, "{step_count:?}");
    }
}

/// Integrates a swing at four tolerances, each a hundredth of the one before, and checks that
/// errors are below 30 times the tolerance. Returns the ratios of the numbers of steps.
fn step_count_ratios(method: fn(Tolerance) -> TestMethod) -> Vec<f64> {
    let trajectory = TestTrajectory::swing(1.0, 20.0, 1, 1e-3);
    let exact_state = SwingEquation::exact_state(&[1.0], 20.0);
    let mut step_counts = Vec::new();
    for relative in [1e-5, 1e-7, 1e-9, 1e-11] {
        let tolerance = tolerance(relative, 100_000);
        let (outcomes, _) = solve::<SwingEquation, 3, 1>(
            Simd::widest(),
            method(tolerance),
            core::slice::from_ref(&trajectory),
        );
        let TestOutcome { segment_end, x, step_count, .. } = outcomes[0];
        assert!(matches!(segment_end, SegmentEnd::Completed(_)));
        let error = (0..3).map(|i| (x[i] - exact_state[i]).abs()).fold(0.0, f64::max);
        eprintln!("{:?}: error {error:.2e}, {step_count:?}", method(tolerance));
        assert!(error < 30.0 * relative, "{relative:e} gave {error:e}");
        step_counts.push(step_count.accepted as f64);
    }
    step_counts.windows(2).map(|pair| pair[1] / pair[0]).collect()
}

#[test]
fn steps_follow_the_tolerance_by_the_order_of_the_error_estimate() {
    // The local error of dopri5 is proportional to h^5: a hundredth of the tolerance takes
    // 100^(1/5) = 2.51 times as many steps.
    let ratios = step_count_ratios(TestMethod::Dopri5);
    assert!(ratios.iter().all(|ratio| (2.1..2.9).contains(ratio)), "{ratios:?}");
    // That of dop853 is proportional to h^8 if steps are short: 100^(1/8) = 1.78.
    let ratios = step_count_ratios(TestMethod::Dop853Adaptive);
    assert!(ratios.iter().all(|ratio| (1.4..2.1).contains(ratio)), "{ratios:?}");
}

#[test]
fn no_step_is_longer_than_the_longest() {
    let trajectory = TestTrajectory::swing(1.0, 20.0, 1, 1e-3);
    for longest_step_s in [0.02, 0.05] {
        let tolerance = Tolerance { longest_step_s: Some(longest_step_s), ..ACCEPT_ALL };
        for method in [TestMethod::Dop853Adaptive(tolerance), TestMethod::Additive(tolerance)] {
            let (outcomes, _) = solve::<SwingEquation, 3, 1>(
                Simd::widest(),
                method,
                core::slice::from_ref(&trajectory),
            );
            // Steps grow from the first one at most by a factor of 5, and the last one is shorter.
            let accepted_steps = outcomes[0].step_count.accepted as f64;
            let min_steps = 20.0 / longest_step_s;
            assert!(
                (min_steps..min_steps + 4.0).contains(&accepted_steps),
                "{method:?}: {accepted_steps}"
            );
        }
    }
}

#[test]
fn every_segment_ends_exactly_at_its_end() {
    // Times and steps that are not binary fractions.
    let end_times = [0.1, 0.7, 1.0 / 3.0, 2.2, 5.3, 0.049, 7.77];
    for method in [
        TestMethod::Rk4,
        TestMethod::Dop853,
        TestMethod::Dop853Adaptive(tolerance(1e-6, 100_000)),
        TestMethod::Dopri5(tolerance(1e-6, 100_000)),
        TestMethod::Additive(tolerance(1e-6, 100_000)),
    ] {
        let trajectories: Vec<_> = end_times
            .into_iter()
            .map(|end_s| {
                let boundaries_s = [0.0, 0.3 * end_s, 0.31 * end_s, end_s];
                let segment =
                    |pair: &[f64]| Segment { start_s: pair[0], end_s: pair[1], step_s: 0.007 };
                TestTrajectory {
                    segments: boundaries_s.windows(2).map(segment).collect(),
                    ..TestTrajectory::swing(1.0, 1.0, 1, 1.0)
                }
            })
            .collect();
        for simd in super::instruction_sets() {
            let (outcomes, _) = solve::<SwingEquation, 3, 1>(simd, method, &trajectories);
            for (end_s, outcome) in end_times.into_iter().zip(outcomes) {
                assert!(matches!(outcome.segment_end, SegmentEnd::Completed(_)));
                assert_eq!(
                    outcome.observed_to_s.to_bits(),
                    end_s.to_bits(),
                    "{method:?} on {simd:?}"
                );
            }
        }
    }
}

#[test]
fn fixed_steps_divide_a_segment_into_the_fewest_equal_steps() {
    let step_count = |end_s: f64, step_s: f64| {
        crate::fixed::fixed_steps(&Segment { start_s: 0.0, end_s, step_s })
    };
    assert_eq!(step_count(50.0, 2e-4), 250_000);
    assert_eq!(step_count(1.0, 0.3), 4);
    // The quotients 0.7 / 0.1, 0.3 / 0.1 and 4.35 / 0.01 are slightly below 7, 3 and 435 by
    // rounding.
    assert_eq!([step_count(0.7, 0.1), step_count(0.3, 0.1), step_count(4.35, 0.01)], [7, 3, 435]);
    // The quotient 1.1 / 0.1 is slightly above 11 by rounding.
    assert_eq!(step_count(1.1, 0.1), 11);
    assert_eq!(step_count(0.01, 1.0), 1);
}

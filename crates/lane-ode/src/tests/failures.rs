//! Tests that a failing trajectory ends with its reason and time, without effect on other lanes.

use super::{Equation, TestMethod, TestOutcome, TestTrajectory, instruction_sets, solve};
use crate::{Failure, Lane, N, Segment, SegmentEnd, Tolerance};

/// The equations x' = a x^2 + b / (c - t) + sqrt(d - t), y' = w z, z' = -w y, which diverge, have a
/// pole, are undefined or oscillate fast, depending on the parameters.
struct FailingEquation;

impl Equation<3, 5> for FailingEquation {
    const RANGE_LIMIT: f64 = 1e3;

    #[inline(always)]
    fn derivative<T: Lane>(&[a, b, c, d, w]: &[N<T>; 5], t_s: N<T>, x: &[N<T>; 3]) -> [N<T>; 3] {
        [a * (x[0] * x[0]) + (b / (c - t_s) + (d - t_s).sqrt()), (w * x[2]).v(), -(w * x[1]).v()]
    }
}

const SEGMENT: Segment = Segment { start_s: 0.0, end_s: 2.0, step_s: 1e-3 };

fn trajectory(parameters: [f64; 5]) -> TestTrajectory<3, 5> {
    let segments = vec![Segment { end_s: 0.25, ..SEGMENT }, Segment { start_s: 0.25, ..SEGMENT }];
    TestTrajectory { parameters, start_state: [1.0, 1.0, 0.0], segments }
}

/// Returns a trajectory that does not fail.
fn regular_trajectory(i: usize) -> TestTrajectory<3, 5> {
    trajectory([0.01, 0.0, 100.0, 100.0 + i as f64, 2.0 + 0.37 * i as f64])
}

fn diverging_trajectory() -> TestTrajectory<3, 5> {
    trajectory([1.0, 0.0, 100.0, 100.0, 2.0])
}

fn trajectory_undefined_after(t_s: f64) -> TestTrajectory<3, 5> {
    trajectory([0.01, 0.0, 100.0, t_s, 2.0])
}

fn trajectory_with_pole_at(t_s: f64) -> TestTrajectory<3, 5> {
    trajectory([0.0, 1.0, t_s, 100.0, 2.0])
}

fn fast_trajectory() -> TestTrajectory<3, 5> {
    trajectory([0.01, 0.0, 100.0, 100.0, 1e4])
}

const TOLERANCE: Tolerance =
    Tolerance { relative: 1e-8, absolute: 1e-10, max_steps: 2000, longest_step_s: None };
const ADAPTIVE_METHODS: [TestMethod; 3] = [
    TestMethod::Dop853Adaptive(TOLERANCE),
    TestMethod::Dopri5(TOLERANCE),
    TestMethod::Additive(TOLERANCE),
];

/// Solves failing trajectories among regular ones in several orders, and asserts that the regular
/// ones have the same bits as without failing ones. Returns the outcomes of the failing ones.
fn solve_among_regular(
    method: TestMethod,
    failing_trajectories: &[TestTrajectory<3, 5>],
) -> Vec<TestOutcome<3>> {
    let mut first_failed_outcomes: Option<Vec<TestOutcome<3>>> = None;
    for simd in instruction_sets() {
        let unmixed_outcomes: Vec<_> = (0..12).map(regular_trajectory).collect();
        let (unmixed_outcomes, _) = solve::<FailingEquation, 3, 5>(simd, method, &unmixed_outcomes);
        assert!(unmixed_outcomes.iter().all(|o| matches!(o.segment_end, SegmentEnd::Completed(_))));
        for offset in 0..4 {
            // Every third trajectory from `offset` on fails.
            let mut mixed_trajectories: Vec<_> = (0..12).map(regular_trajectory).collect();
            let mut failing_positions = Vec::new();
            for (i, trajectory) in failing_trajectories.iter().enumerate() {
                let position = offset + 3 * i;
                mixed_trajectories.insert(position, trajectory.clone());
                failing_positions.push(position);
            }
            let (outcomes, _) = solve::<FailingEquation, 3, 5>(simd, method, &mixed_trajectories);
            let mut failed_outcomes = Vec::new();
            let mut completed_outcomes = Vec::new();
            for (i, outcome) in outcomes.into_iter().enumerate() {
                if failing_positions.contains(&i) {
                    failed_outcomes.push(outcome)
                } else {
                    completed_outcomes.push(outcome)
                }
            }
            for (i, (mixed, expected)) in
                completed_outcomes.iter().zip(&unmixed_outcomes).enumerate()
            {
                assert!(
                    mixed.is_same(expected),
                    "{simd:?}, sound {i}: {mixed:?} against {expected:?}"
                );
            }
            let first_failure =
                first_failed_outcomes.get_or_insert_with(|| failed_outcomes.clone());
            for (outcome, first_failure) in failed_outcomes.iter().zip(first_failure.iter()) {
                assert_eq!(
                    (outcome.segment_end, outcome.step_count),
                    (first_failure.segment_end, first_failure.step_count),
                    "{simd:?}"
                );
            }
        }
    }
    first_failed_outcomes.unwrap()
}

fn failure_reason_and_time(outcome: &TestOutcome<3>) -> (Failure, f64) {
    let SegmentEnd::Failed { reason, time_s, .. } = outcome.segment_end else {
        panic!("it did not fail: {outcome:?}")
    };
    (reason, time_s)
}

#[test]
fn a_diverged_trajectory_ends_alone() {
    for method in [TestMethod::Rk4, TestMethod::Dop853].into_iter().chain(ADAPTIVE_METHODS) {
        let outcomes = solve_among_regular(method, &[diverging_trajectory()]);
        let (reason, time_s) = failure_reason_and_time(&outcomes[0]);
        assert_eq!(reason, Failure::Diverged, "{method:?}");
        // From x = 1 the solution of x' > x^2 + 9 diverges before t = (pi/2 - atan(1/3)) / 3 =
        // 0.42.
        assert!((0.1..0.42).contains(&time_s), "{method:?}: {time_s} s");
    }
}

#[test]
fn a_state_that_is_not_finite_ends_alone() {
    for method in [TestMethod::Rk4, TestMethod::Dop853].into_iter().chain(ADAPTIVE_METHODS) {
        let outcomes = solve_among_regular(
            method,
            &[trajectory_undefined_after(0.7), trajectory_undefined_after(0.2)],
        );
        for (outcome, expected_s) in outcomes.iter().zip([0.7, 0.2]) {
            let (reason, time_s) = failure_reason_and_time(outcome);
            assert_eq!(reason, Failure::Diverged, "{method:?}");
            assert!((time_s - expected_s).abs() < 2e-3, "{method:?}: {time_s} s");
        }
    }
}

#[test]
fn a_step_too_small_for_time_ends_alone() {
    for method in ADAPTIVE_METHODS {
        let outcomes = solve_among_regular(
            method,
            &[trajectory_with_pole_at(0.6), trajectory_with_pole_at(1.5)],
        );
        for (outcome, expected_s) in outcomes.iter().zip([0.6, 1.5]) {
            let (reason, time_s) = failure_reason_and_time(outcome);
            assert_eq!(reason, Failure::StepTooSmall, "{outcome:?}");
            assert!((time_s - expected_s).abs() < 1e-9, "{time_s} s");
        }
    }
}

#[test]
fn a_trajectory_at_its_limit_of_steps_ends_alone() {
    for outcome in ADAPTIVE_METHODS
        .iter()
        .flat_map(|method| solve_among_regular(*method, &[fast_trajectory(), fast_trajectory()]))
    {
        let (reason, _) = failure_reason_and_time(&outcome);
        assert_eq!(reason, Failure::StepLimit);
        let SegmentEnd::Failed { count, .. } = outcome.segment_end else { unreachable!() };
        assert_eq!(count.accepted + count.rejected, 2000);
    }
}

#[test]
fn all_failures_together_do_not_change_other_trajectories() {
    let failing_trajectories = [
        diverging_trajectory(),
        trajectory_undefined_after(0.3),
        trajectory_with_pole_at(0.9),
        fast_trajectory(),
    ];
    for method in ADAPTIVE_METHODS {
        let reasons: Vec<_> = solve_among_regular(method, &failing_trajectories)
            .iter()
            .map(|o| failure_reason_and_time(o).0)
            .collect();
        assert_eq!(
            reasons,
            [Failure::Diverged, Failure::Diverged, Failure::StepTooSmall, Failure::StepLimit]
        );
    }
}

//! Tests that the integrators allocate no memory after set-up.

use super::{SwingEquation, TestMethod, TestTrajectory, instruction_sets, solve};
use crate::{SegmentEnd, Tolerance};

#[test]
fn the_allocation_counter_counts() {
    let heap_use = allocation_counter::measure(|| drop(core::hint::black_box(vec![1.0_f64; 8])));
    assert_eq!(heap_use.count_total, 1);
}

#[test]
fn an_integration_allocates_nothing() {
    let trajectories: Vec<_> = (0..21)
        .map(|i| TestTrajectory::swing(1.0 + 0.1 * f64::from(i), 3.0, 1 + i % 3, 1e-3))
        .collect();
    let tolerance =
        Tolerance { relative: 1e-8, absolute: 1e-8, max_steps: 100_000, longest_step_s: None };
    for simd in instruction_sets() {
        let adaptive_methods =
            [TestMethod::Dop853Adaptive, TestMethod::Dopri5, TestMethod::Additive]
                .map(|method| method(tolerance));
        for method in [TestMethod::Rk4, TestMethod::Dop853].into_iter().chain(adaptive_methods) {
            let (outcomes, allocations) = solve::<SwingEquation, 3, 1>(simd, method, &trajectories);
            assert!(
                outcomes.iter().all(|o| matches!(o.segment_end, SegmentEnd::Completed(_))
                    && o.step_count.accepted > 5)
            );
            assert_eq!(allocations, 0, "{method:?} on {simd:?}");
        }
    }
}

//! Tests that the integration of a trajectory allocates nothing after set-up.

use super::instruments::{ALL_RECORDERS, paper_machine, prepare_point, triangular_spin};
use crate::{Method, ModelKind, Recorders, simulate_with};
use lane_ode::{Simd, Tolerance};

#[test]
fn a_long_trajectory_allocates_no_more_than_a_short_one() {
    let tolerance =
        Tolerance { relative: 1e-4, absolute: 1e-7, max_steps: 1_000_000, longest_step_s: None };
    let count_allocations = |simd, model, method: &Method, recorders, end_s| {
        // There are more points than lanes, so that lanes start further points.
        let points: Vec<_> = (0..11)
            .map(|i| {
                prepare_point(
                    paper_machine(0.1 + 0.05 * f64::from(i), 140.0),
                    triangular_spin(),
                    end_s,
                )
            })
            .collect();
        let points: Vec<_> = points.iter().collect();
        let mut step_count = 0;
        let allocation_info = allocation_counter::measure(|| {
            step_count = simulate_with(simd, model, method, &points, recorders)
                .0
                .iter()
                .map(|r| r.accepted_steps)
                .sum();
        });
        (allocation_info.count_total, step_count)
    };
    for simd in Simd::ALL.into_iter().filter(|simd| simd.is_available()) {
        for model in [ModelKind::Nonlinear, ModelKind::Linear] {
            for method in [Method::rk4(2e-4), Method::dopri5(tolerance)] {
                for recorders in [Recorders::default(), ALL_RECORDERS] {
                    let (short_count, short_steps) =
                        count_allocations(simd, model, &method, recorders, 0.02);
                    let (long_count, long_steps) =
                        count_allocations(simd, model, &method, recorders, 0.2);
                    assert!(long_steps > 5 * short_steps, "{short_steps} and {long_steps} steps");
                    // The set-up of each of the 11 points may allocate once more or less, depending
                    // on the last point in its lane. Steps must not allocate.
                    assert!(
                        long_count <= short_count + 11,
                        "{model:?} by {method:?} on {simd:?}: {short_count}, {long_count}"
                    );
                }
            }
        }
    }
}

//! After set-up a trajectory leaves the heap alone, however long.

use super::instruments::{EVERYTHING, paper, ready, triangular};
use crate::{Method, ModelKind, Recorders, simulate_with};
use lane_ode::{Simd, Tolerance};

#[test]
fn a_longer_trajectory_asks_no_more_of_the_heap_than_a_short_one() {
    let tolerance = Tolerance { relative: 1e-4, absolute: 1e-7, max_steps: 1_000_000 };
    let everything = EVERYTHING;
    let asked = |simd, model, method: &Method, wanted, end_s| {
        // More points than lanes: lanes that take up another are counted too.
        let points: Vec<_> = (0..11)
            .map(|i| ready(paper(0.1 + 0.05 * f64::from(i), 140.0), triangular(), end_s))
            .collect();
        let points: Vec<_> = points.iter().collect();
        let mut steps = 0;
        let heap = allocation_counter::measure(|| {
            steps =
                simulate_with(simd, model, method, &points, wanted).0.iter().map(|r| r.steps).sum();
        });
        (heap.count_total, steps)
    };
    for simd in Simd::ALL.into_iter().filter(|simd| simd.is_available()) {
        for model in [ModelKind::Nonlinear, ModelKind::Linear] {
            for method in [Method::Rk4 { step_s: 2e-4 }, Method::Dopri5(tolerance)] {
                for wanted in [Recorders::default(), everything] {
                    let (short, few) = asked(simd, model, &method, wanted, 0.02);
                    let (long, many) = asked(simd, model, &method, wanted, 0.2);
                    assert!(many > 5 * few, "{few} and {many} steps");
                    // Set-up of a point may ask once more or less, by who had its lane before;
                    // steps must not ask at all.
                    assert!(
                        long <= short + 11,
                        "{model:?} by {method:?} on {simd:?}: {short}, {long}"
                    );
                }
            }
        }
    }
}

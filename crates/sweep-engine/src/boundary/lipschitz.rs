//! Piyavskii's method for pairs of roots between samples of one side.
//!
//! S. A. Piyavskii, "An algorithm for finding the absolute extremum of a function", USSR
//! Computational Mathematics and Mathematical Physics 12(4):57-67 (1972). A function whose slope
//! is at most `L` cannot reach zero between two samples of one sign unless `L` times their gap
//! exceeds the sum of their distances from zero. Where it does, the next sample is where the
//! function can get farthest beyond zero.
//!
//! `L` is estimated from the samples beside the gap, as in Ya. D. Sergeyev, "An information global
//! optimization algorithm with local tuning", SIAM Journal on Optimization 5(4):858-870 (1995).

use super::sample::LineSample;

/// The reliability parameter of Sergeyev: the estimate of `L` over the steepest slope in a gap and
/// in the gaps beside it. Basis: with 1.3, `sweeps/fig12.toml` loses its folds; with 1.33 it has
/// them. Doubling it takes 14 % more trials there, and 11 % more in the test `random_level_sets`,
/// which then misses a fifth fewer stretches.
const RELIABILITY: f64 = 1.75;

/// Returns the positions to evaluate next: one in every gap wider than `min_gap` that may hide two
/// roots.
pub(super) fn candidate_positions(samples: &[LineSample], min_gap: f64) -> Vec<f64> {
    let slopes: Vec<f64> = samples.windows(2).map(|gap| slope_between(&gap[0], &gap[1])).collect();
    let mut positions = Vec::new();
    for (k, gap) in samples.windows(2).enumerate() {
        let low = gap[0];
        let high = gap[1];
        let width = high.position - low.position;
        let distances = low.finite_distance().zip(high.finite_distance());
        let Some((distance_low, distance_high)) = distances else { continue };
        if low.side() != high.side() || width <= min_gap {
            continue;
        }
        let adjacent_slopes = &slopes[k.saturating_sub(1)..slopes.len().min(k + 2)];
        let steepest_slope = adjacent_slopes.iter().copied().fold(0.0, f64::max);
        let lipschitz_constant = RELIABILITY * steepest_slope;
        if lipschitz_constant * width > distance_low.abs() + distance_high.abs() {
            let middle = 0.5 * (low.position + high.position);
            positions.push(
                middle + (distance_low.abs() - distance_high.abs()) / (2.0 * lipschitz_constant),
            );
        }
    }
    positions
}

/// Returns the steepness between two samples of one side; 0 between others, whose bracket may
/// contain a jump.
fn slope_between(lower: &LineSample, upper: &LineSample) -> f64 {
    match (lower.finite_distance(), upper.finite_distance()) {
        (Some(distance_low), Some(distance_high)) if lower.side() == upper.side() => {
            ((distance_high - distance_low) / (upper.position - lower.position)).abs()
        }
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples_at(samples: &[(f64, f64)]) -> Vec<LineSample> {
        samples.iter().map(|&(position, d)| LineSample { position, distance: Some(d) }).collect()
    }

    /// Adds samples until no gap may hide a pair of roots, and returns whether a dip below zero was
    /// found.
    fn finds_dip(function: impl Fn(f64) -> f64, min_gap: f64) -> bool {
        let mut samples: Vec<(f64, f64)> =
            [0.0, 40.0, 80.0].map(|position| (position, function(position))).to_vec();
        loop {
            let positions = candidate_positions(&samples_at(&samples), min_gap);
            if positions.is_empty() {
                return samples.iter().any(|(_, distance)| *distance < 0.0);
            }
            samples.extend(positions.iter().map(|position| (*position, function(*position))));
            samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
    }

    #[test]
    fn a_gap_is_searched_only_if_the_slope_allows_two_roots() {
        // The slope of 0.01 allows a change of 0.8 over the gap, and the samples' distances add up
        // to twice as much.
        assert!(candidate_positions(&samples_at(&[(0.0, 1.2), (40.0, 0.8)]), 5.0).is_empty());
        let positions = candidate_positions(&samples_at(&[(0.0, 1.2), (40.0, 0.1)]), 5.0);
        assert_eq!(positions.len(), 1);
        assert!(
            20.0 < positions[0] && positions[0] < 40.0,
            "nearer to the sample at 0.1: {positions:?}"
        );
        assert!(
            candidate_positions(&samples_at(&[(0.0, 1.2), (40.0, 0.1)]), 40.0).is_empty(),
            "not wide enough"
        );
        assert!(
            candidate_positions(&samples_at(&[(0.0, 0.4), (40.0, -0.4)]), 5.0).is_empty(),
            "a bracket"
        );
    }

    #[test]
    fn a_dip_with_slopes_like_those_beside_it_is_found_wherever_it_is() {
        for k in 0..=200 {
            let bottom_position = 5.0 + 0.15 * f64::from(k);
            // The dip is 12 wide, and its slope is that of the samples at 40 and 80.
            let function =
                |x: f64| ((x - bottom_position).abs() * 0.05 - 0.3).min(0.025 * (x - 40.0) + 0.5);
            assert!(finds_dip(function, 1.0), "{bottom_position}");
        }
    }
}

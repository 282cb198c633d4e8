//! Computes the separation of two runs of the same point.

use super::{Checkpoint, Checkpoints};
use crate::point::PlannedSegment;
use crate::{COORDINATES, Point};

/// The number of coordinates that are compared. The last two, the hinge's, are left out: the hinge
/// rings with little damping, mostly without effect on any output.
const COMPARED_COORDINATES: usize = COORDINATES - 2;

impl Point {
    /// Computes the separation of two runs of the nonlinear model at their common checkpoints.
    /// Returns for each instant (s) the greatest difference of any coordinate except the hinge's,
    /// relative to the greatest deviation of this coordinate from equilibrium in the whole run `b`,
    /// or to the least amplitude of a motion ([`Self::rest_limit_m`]) if that is greater.
    pub fn separations(&self, a: &Checkpoints, b: &Checkpoints) -> Vec<(f64, f64)> {
        let mut largest_deviations = [self.rest_limit_m(); COMPARED_COORDINATES];
        for checkpoint in b {
            for (i, largest_deviation) in largest_deviations.iter_mut().enumerate() {
                *largest_deviation =
                    largest_deviation.max((checkpoint.coordinates[i] - self.equilibrium[i]).abs());
            }
        }
        let separation = |((a, b), segment): ((&Checkpoint, &Checkpoint), &PlannedSegment)| {
            let relative_difference =
                |i: usize| (a.coordinates[i] - b.coordinates[i]).abs() / largest_deviations[i];
            (segment.end_s, (0..COMPARED_COORDINATES).map(relative_difference).fold(0.0, f64::max))
        };
        a.iter().zip(b).zip(&*self.segments).map(separation).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Machine, Profile, Spin, Timing, prepare};
    use lane_ode::Simd;

    #[test]
    fn rounding_noise_is_no_separation() {
        let spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 300.0, ramp_s: 2.0 };
        let timing = Timing { end_s: 2.0, window_s: [0.0, 2.0], checkpoints: 4 };
        let point = prepare(Simd::widest(), &[(Machine::paper(), spin)], &timing).remove(0);
        let point = point.unwrap();
        let checkpoints_at = |deviation: f64| {
            let coordinates = point.equilibrium.map(|q| q + deviation);
            vec![Checkpoint { coordinates }; point.segments.len()]
        };
        let greatest_separation = |a: f64, b: f64| {
            let separations = point.separations(&checkpoints_at(a), &checkpoints_at(b));
            separations.into_iter().map(|(_, distance)| distance).fold(0.0, f64::max)
        };
        assert!(greatest_separation(1e-15, -1e-15) < 1e-2);
        assert!((greatest_separation(1e-3, 2e-3) - 0.5).abs() < 1e-9);
        assert_eq!(greatest_separation(1e-3, 1e-3), 0.0);
    }
}

//! The difference of two runs of one trajectory.

use super::{Course, Waypoint};
use crate::point::PlannedLeg;
use crate::{COORDINATES, ModelKind, Point};

/// Coordinates that follow the motion of interest. The hinge's two are left out: they also ring,
/// hardly damped, and mostly without effect on any output.
const FOLLOWED: usize = COORDINATES - 2;

impl Point {
    /// The greatest difference between two runs of a model at this point, over all instants that
    /// both recorded and all coordinates but the hinge's, as a share of that coordinate's greatest
    /// deviation from equilibrium: within the window of its greatest there, outside of its greatest
    /// anywhere.
    ///
    /// Zero if there is nothing to compare. Unlike a difference of amplitudes, it shows deviations
    /// after an early peak.
    pub fn course_difference(&self, model: ModelKind, a: &Course, b: &Course) -> f64 {
        let rest = match model {
            ModelKind::Nonlinear => self.equilibrium,
            ModelKind::Linear => [0.0; COORDINATES],
        };
        let mut greatest = [[0.0_f64; FOLLOWED]; 2];
        let mut difference = greatest;
        for ((a, b), leg) in a.iter().zip(b).zip(&*self.legs) {
            let (a, b) = (&a.coordinates, &b.coordinates);
            for i in 0..FOLLOWED {
                let (deviation, apart) = ((b[i] - rest[i]).abs(), (a[i] - b[i]).abs());
                for place in 0..=usize::from(leg.in_window) {
                    greatest[place][i] = greatest[place][i].max(deviation);
                    difference[place][i] = difference[place][i].max(apart);
                }
            }
        }
        let shares = difference.as_flattened().iter().zip(greatest.as_flattened());
        shares
            .map(|(apart, greatest)| if *apart == 0.0 { 0.0 } else { apart / greatest })
            .fold(0.0, f64::max)
    }

    /// From when on (s) the gap between drum and tub may be least, if it swings by this much beside
    /// what a run has: the beginning of the first leg in which it came so near to its least.
    pub fn gap_least_from_s(&self, course: &Course, swing_m: f64) -> f64 {
        let farthest_m = course.last().map_or(0.0, |last| last.radial_m);
        let is_near = |at: &Waypoint| at.radial_m >= farthest_m - 2.0 * swing_m;
        let mut legs = self.legs.iter().zip(course);
        legs.find(|(_, end)| is_near(end)).map_or(0.0, |(leg, _)| leg.start_s)
    }

    /// How far two runs of the nonlinear model are apart at each instant that both recorded: the
    /// instant (s) and the greatest difference of any coordinate but the hinge's, as a share of
    /// that coordinate's greatest deviation from equilibrium in the whole run.
    pub fn departure(&self, a: &Course, b: &Course) -> Vec<(f64, f64)> {
        let mut greatest = [0.0_f64; FOLLOWED];
        for now in b {
            for (i, greatest) in greatest.iter_mut().enumerate() {
                *greatest = greatest.max((now.coordinates[i] - self.equilibrium[i]).abs());
            }
        }
        let apart = |((a, b), leg): ((&Waypoint, &Waypoint), &PlannedLeg)| {
            let share = |i: usize| {
                let apart = (a.coordinates[i] - b.coordinates[i]).abs();
                if apart == 0.0 { 0.0 } else { apart / greatest[i] }
            };
            (leg.end_s, (0..FOLLOWED).map(share).fold(0.0, f64::max))
        };
        a.iter().zip(b).zip(&*self.legs).map(apart).collect()
    }
}

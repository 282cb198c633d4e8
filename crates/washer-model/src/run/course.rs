//! The difference of two runs of one trajectory.

use super::{Course, Waypoint};
use crate::point::PlannedLeg;
use crate::{COORDINATES, Point};

/// Coordinates that follow the motion of interest. The hinge's two are left out: they also ring,
/// hardly damped, and mostly without effect on any output.
const FOLLOWED: usize = COORDINATES - 2;

impl Point {
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

//! The difference of two runs of one trajectory.

use super::Course;
use crate::coordinates::COORDINATES;
use crate::kind::ModelKind;
use crate::point::Point;

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
    #[must_use]
    pub fn course_difference(&self, model: ModelKind, a: &Course, b: &Course) -> f64 {
        let rest = match model {
            ModelKind::Nonlinear => self.equilibrium,
            ModelKind::Linear => [0.0; COORDINATES],
        };
        let mut greatest = [[0.0_f64; FOLLOWED]; 2];
        let mut difference = greatest;
        for ((a, b), leg) in a.iter().zip(b).zip(&*self.legs) {
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
}

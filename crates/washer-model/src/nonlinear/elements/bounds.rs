//! The steepest that a machine's elements can be: linear ones that bound the stiffness and damping
//! of all elements, so that the choice of steps sees friction, stops and stiffening springs.

use crate::coordinates::{COORDINATES, TUB};
use crate::nonlinear::elements::{Elements, StopOf, TubMotion};
use crate::nonlinear::frame::{difference, dot};
use lane_ode::N;

/// How far tub points move from where they rest (m): more than any machine has room for.
const TRAVEL_M: f64 = 0.05;

/// A stop this many times its softness deep is closed but for less than a thousandth.
const CLOSED: f64 = 20.0;

impl Elements<f64> {
    /// Elements whose tangents at the equilibrium `q` are the steepest that these have anywhere
    /// near it; `None` if these are linear along their lines.
    pub(crate) fn steepest(&self, q: &[f64; COORDINATES]) -> Option<Self> {
        if !self.has_further.holds() {
            return None;
        }
        let mut steepest = self.clone();
        let tub = TubMotion::new(&TUB.map(|i| N(q[i])), &[N(0.0); 4]);
        for spring in &mut steepest.springs {
            let ends = &spring.ends;
            let place = tub.point(&ends.tub).displacement;
            let span = difference(place, &difference(ends.cabinet, &ends.tub));
            let length = dot(&span, &span).sqrt();
            let (elongation, cubic) = (length - spring.free_length, spring.cubic);
            let tension = spring.stiffness * length - spring.stiffness_times_free_length
                + cubic * elongation * elongation * elongation;
            let farthest = elongation.abs() + TRAVEL_M;
            spring.stiffness += 3.0 * (cubic * farthest * farthest).v();
            // Its tension at rest stays, on which its stiffness across the line depends.
            spring.stiffness_times_free_length = spring.stiffness * length - tension;
            spring.cubic = N(0.0);
        }
        for damper in &mut steepest.dampers {
            damper.damping += damper.friction / damper.speed_squared.sqrt();
            damper.friction = N(0.0);
        }
        for stop in &mut steepest.stops {
            let depth = stop.depth(&tub.point(&stop.tub));
            let StopOf { clearance, softness_squared, .. } = *stop;
            stop.clearance = clearance + depth - CLOSED * softness_squared.sqrt();
        }
        for bushing in &mut steepest.bushings {
            let place = tub.point(&bushing.tub).displacement;
            for i in 0..3 {
                let farthest = place[i].abs() + TRAVEL_M;
                bushing.stiffness[i] += 3.0 * (bushing.cubic[i] * farthest * farthest).v();
                bushing.cubic[i] = N(0.0);
            }
        }
        Some(steepest)
    }
}

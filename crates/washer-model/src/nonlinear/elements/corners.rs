//! Forces with corners as functions of one motion each: a damper's friction of the speed along the
//! damper, a stop's force of depth and speed.

use super::{CabinetLine, Elements, ForceLaw as _, TubMotion};
use crate::lanes::{ToDual as _, lane_struct};
use lane_ode::{Lane, N};

lane_struct! {
    /// A force along a motion of the tub (N), and the derivatives by depth (N/m) and speed (N s/m).
    #[derive(Clone, Copy)]
    CornerForce { force, by_depth, by_speed }
}

impl<T: Lane> Elements<T> {
    /// Computes the depth (m) and the speed (m/s) of each motion. The depth of a friction is zero.
    #[inline(always)]
    pub(crate) fn corner_motions(&self, tub: &TubMotion<T>) -> Vec<[N<T>; 2]> {
        let mut motions = Vec::with_capacity(self.dampers.len() + self.stops.len());
        for number in 0..self.dampers.len() {
            motions.push([tub.midpoint[0].lit(0.0), self.damper_speed(number, tub)]);
        }
        for stop in &self.stops {
            let point = tub.point(&stop.tub);
            motions.push([stop.depth(&point), stop.speed(&point)]);
        }
        motions
    }

    /// Appends the forces at such motions to a list.
    #[inline(always)]
    pub(crate) fn corner_forces(&self, motions: &[[N<T>; 2]], forces: &mut Vec<CornerForce<T>>) {
        let (damper_motions, stop_motions) = motions.split_at(self.dampers.len());
        for (damper, [zero, speed]) in self.dampers.iter().zip(damper_motions) {
            let still = zero.constant();
            let mut rate = speed.constant();
            rate.0.slope = zero.lit(1.0).0;
            let line = CabinetLine { span: [still; 3], length: still, rate };
            let N(force) = damper.constant().optional_force(&line);
            let [force, by_speed] = [N(force.value), N(force.slope)];
            forces.push(CornerForce { force, by_depth: *zero, by_speed });
        }
        for (stop, [depth, speed]) in self.stops.iter().zip(stop_motions) {
            let stop = stop.constant();
            let mut deeper = depth.constant();
            let mut faster = speed.constant();
            deeper.0.slope = depth.lit(1.0).0;
            faster.0.slope = depth.lit(1.0).0;
            let N(by_depth) = -stop.force_at(deeper, speed.constant());
            let N(by_speed) = -stop.force_at(depth.constant(), faster);
            forces.push(CornerForce {
                force: N(by_depth.value),
                by_depth: N(by_depth.slope),
                by_speed: N(by_speed.slope),
            });
        }
    }
}

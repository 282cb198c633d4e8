//! Forces with corners, by the motion that each hangs on: of a damper with friction the speed along
//! it, of a stop its depth and speed.

use super::{CabinetLine, Elements, Law as _, TubMotion};
use crate::lanes::{Constant as _, lane_struct};
use lane_ode::{Lane, N};

lane_struct! {
    /// A force along a motion of the tub (N), and its derivatives by depth (N/m) and speed (N s/m).
    #[derive(Clone, Copy)]
    CornerForce { force, by_depth, by_speed }
}

impl<T: Lane> Elements<T> {
    /// The motions, depth (m) and speed (m/s) of each; a friction's has no depth.
    #[inline(always)]
    pub(crate) fn at_corners(&self, tub: &TubMotion<T>) -> Vec<[N<T>; 2]> {
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

    /// Adds the forces along such motions to a list.
    #[inline(always)]
    pub(crate) fn corner_forces(&self, motions: &[[N<T>; 2]], forces: &mut Vec<CornerForce<T>>) {
        let (of_dampers, of_stops) = motions.split_at(self.dampers.len());
        for (damper, [zero, speed]) in self.dampers.iter().zip(of_dampers) {
            let (still, mut rate) = (zero.constant(), speed.constant());
            rate.0.slope = zero.lit(1.0).0;
            let line = CabinetLine { span: [still; 3], length: still, rate };
            let N(force) = damper.constant().push_further(&line);
            let [force, by_speed] = [N(force.value), N(force.slope)];
            forces.push(CornerForce { force, by_depth: *zero, by_speed });
        }
        for (stop, [depth, speed]) in self.stops.iter().zip(of_stops) {
            let stop = stop.constant();
            let (mut deeper, mut faster) = (depth.constant(), speed.constant());
            deeper.0.slope = depth.lit(1.0).0;
            faster.0.slope = depth.lit(1.0).0;
            let N(push) = -stop.push_at(deeper, speed.constant());
            let N(of_speed) = -stop.push_at(depth.constant(), faster);
            let [force, by_depth, by_speed] = [push.value, push.slope, of_speed.slope].map(N);
            forces.push(CornerForce { force, by_depth, by_speed });
        }
    }
}

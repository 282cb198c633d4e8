//! Computes each force with a corner as a function of a single motion: the friction of a damper as
//! a function of its length and speed, and the force of a stop as a function of depth and speed.

use super::{CabinetLine, Elements, ForceLaw as _, StopMotion, TubMotion};
use crate::lanes::{ToDual as _, lane_struct};
use lane_ode::{Lane, N};

lane_struct! {
    /// A force along a motion of the tub (N), and its derivatives with respect to depth (N/m) and
    /// speed (N s/m).
    #[derive(Clone, Copy)]
    CornerForce { force, force_per_depth, force_per_speed }
}

impl<T: Lane> Elements<T> {
    /// Computes depth (m) and speed (m/s) of the motion along each damper, then each stop. A
    /// damper's depth is its length.
    #[inline(always)]
    pub(crate) fn corner_motions(&self, tub: &TubMotion<T>) -> Vec<[N<T>; 2]> {
        let mut motions = Vec::with_capacity(self.dampers.len() + self.stops.len());
        for number in 0..self.dampers.len() {
            motions.push(self.damper_motion(number, tub));
        }
        for stop in &self.stops {
            let StopMotion { depth, speed, .. } = stop.motion(tub);
            motions.push([depth, speed]);
        }
        motions
    }

    /// Appends the force of each damper and stop at its motion to a list.
    #[inline(always)]
    pub(crate) fn append_corner_forces(
        &self,
        motions: &[[N<T>; 2]],
        forces: &mut Vec<CornerForce<T>>,
    ) {
        let (damper_motions, stop_motions) = motions.split_at(self.dampers.len());
        for (damper, [length, speed]) in self.dampers.iter().zip(damper_motions) {
            let damper = damper.constant();
            let zero = length.lit(0.0);
            let mut line = CabinetLine {
                span: [zero.constant(); 3],
                length: length.constant(),
                length_rate: speed.constant(),
            };
            line.length_rate.0.slope = zero.lit(1.0).0;
            let N(force_per_speed) = damper.optional_force(&line);
            let mut force_per_depth = zero;
            if damper.has_second_stage.is_set() {
                line.length_rate.0.slope = zero.0;
                line.length.0.slope = zero.lit(1.0).0;
                force_per_depth = N(damper.optional_force(&line).0.slope);
            }
            let [force, force_per_speed] = [N(force_per_speed.value), N(force_per_speed.slope)];
            forces.push(CornerForce { force, force_per_depth, force_per_speed });
        }
        for (stop, [depth, speed]) in self.stops.iter().zip(stop_motions) {
            let stop = stop.constant();
            let mut depth_dual = depth.constant();
            let mut speed_dual = speed.constant();
            depth_dual.0.slope = depth.lit(1.0).0;
            speed_dual.0.slope = depth.lit(1.0).0;
            let N(force_per_depth) = -stop.force_at_depth(depth_dual, speed.constant());
            let N(force_per_speed) = -stop.force_at_depth(depth.constant(), speed_dual);
            forces.push(CornerForce {
                force: N(force_per_depth.value),
                force_per_depth: N(force_per_depth.slope),
                force_per_speed: N(force_per_speed.slope),
            });
        }
    }
}

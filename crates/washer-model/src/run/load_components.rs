//! The components of the loads that are recorded, by the elements' force laws.

use super::suspension::load_on_cabinet_axes;
use crate::machine::feet::LOAD_COMPONENTS;
use crate::nonlinear::elements::{Elements, TubMotion};
use crate::nonlinear::frame::Vec3;
use lane_ode::{Lane, N};

/// The loads of a machine that are recorded.
#[derive(Clone, Copy)]
pub(super) struct LoadSelection {
    /// Whether the force on the cabinet is recorded.
    pub(super) has_cabinet_force: bool,
    /// Whether the loads of the feet and the margins are recorded.
    pub(super) has_feet: bool,
    /// The number of stops that are recorded.
    pub(super) stop_count: usize,
    /// The number of dampers that are recorded.
    pub(super) damper_count: usize,
}

impl LoadSelection {
    /// Returns the number of load components: the load on the cabinet if feet are recorded, depth
    /// and force of each stop, and the speed of each damper.
    pub(super) fn component_count(self) -> usize {
        self.first_stop_component() + 2 * self.stop_count + self.damper_count
    }

    /// Returns the index of the first component after the load on the cabinet.
    pub(super) const fn first_stop_component(self) -> usize {
        if self.has_feet { LOAD_COMPONENTS } else { 0 }
    }

    /// Computes the load components by the elements' force laws. Returns the force on the tub.
    #[inline(always)]
    pub(super) fn evaluate<T: Lane>(
        self,
        elements: &Elements<T>,
        tub: &TubMotion<T>,
        components: &mut [N<T>],
    ) -> Vec3<T> {
        let no_force = [tub.midpoint[0].lit(0.0); 3];
        let mut tub_load = (no_force, no_force);
        if self.has_cabinet_force || self.has_feet {
            tub_load = elements.load_on_tub(tub);
        }
        if self.has_feet {
            components[..LOAD_COMPONENTS].copy_from_slice(&load_on_cabinet_axes(tub, &tub_load));
        }
        let first_stop = self.first_stop_component();
        for k in 0..self.stop_count {
            [components[first_stop + 2 * k], components[first_stop + 2 * k + 1]] =
                elements.stop_depth_and_force(k, tub);
        }
        let first_damper = first_stop + 2 * self.stop_count;
        for k in 0..self.damper_count {
            components[first_damper + k] = elements.damper_motion(k, tub)[1];
        }
        tub_load.0
    }
}

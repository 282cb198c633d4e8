//! Bounds the tangents of the elements by linear elements with the greatest stiffness and damping
//! that the machine's elements reach. The steps of integrators are chosen by these bounds.

use crate::coordinates::{COORDINATES, TUB_COORDINATES};
use crate::nonlinear::elements::{
    DamperCoefficients, Elements, SpringCoefficients, StopCoefficients, TubMotion,
};
use crate::nonlinear::frame::{dot, subtract};
use lane_ode::N;

/// The greatest travel of a tub point from its position at rest (m). Basis: cabinets leave less
/// room than this. Doubling it quadruples the bound of cubic stiffnesses.
const MAX_TRAVEL_M: f64 = 0.05;

/// The depth at which a stop counts as in full contact, as a multiple of its softness. Basis: at
/// this depth the slope of the force is within a thousandth of its limit. Doubling it reduces the
/// difference to a quarter.
const CONTACT_DEPTH_PER_SOFTNESS: f64 = 20.0;

impl Elements<f64> {
    /// Returns linear elements with the greatest tangents that the elements have near the
    /// equilibrium `q`; `None` if all elements are linear along their lines.
    pub(crate) fn with_steepest_tangents(&self, q: &[f64; COORDINATES]) -> Option<Self> {
        if !self.has_optional_forces.is_set() {
            return None;
        }
        let mut linear_elements = self.clone();
        let tub = TubMotion::new(&TUB_COORDINATES.map(|i| N(q[i])), &[N(0.0); 4]);
        for spring in &mut linear_elements.springs {
            let ends = &spring.ends;
            let displacement = tub.point_motion(&ends.tub_end).displacement;
            let span = subtract(displacement, &subtract(ends.cabinet_end, &ends.tub_end));
            let length = dot(&span, &span).sqrt();
            let elongation = length - spring.free_length;
            let cubic_stiffness = spring.cubic_stiffness;
            let tension = spring.stiffness * length - spring.stiffness_times_free_length
                + cubic_stiffness * elongation * elongation * elongation;
            let max_elongation = elongation.abs() + MAX_TRAVEL_M;
            spring.stiffness += 3.0 * (cubic_stiffness * max_elongation * max_elongation).v();
            // The tension at rest is kept, because the stiffness across the line depends on it.
            spring.stiffness_times_free_length = spring.stiffness * length - tension;
            spring.cubic_stiffness = N(0.0);
        }
        let mut onset_springs = Vec::new();
        for damper in &mut linear_elements.dampers {
            onset_springs.extend(damper.onset_spring());
            damper.damping += damper.coulomb_friction / damper.friction_speed_squared.sqrt()
                + damper.outer_damping;
            damper.coulomb_friction = N(0.0);
            damper.outer_damping = N(0.0);
        }
        linear_elements.springs.append(&mut onset_springs);
        for stop in &mut linear_elements.stops {
            let depth = stop.depth(&tub.point_motion(&stop.tub_point));
            let StopCoefficients { clearance, softness_squared, .. } = *stop;
            stop.clearance =
                clearance + depth - CONTACT_DEPTH_PER_SOFTNESS * softness_squared.sqrt();
        }
        for bushing in &mut linear_elements.bushings {
            let displacement = tub.point_motion(&bushing.tub_point).displacement;
            for i in 0..3 {
                let max_elongation = displacement[i].abs() + MAX_TRAVEL_M;
                bushing.stiffness[i] +=
                    3.0 * (bushing.cubic_stiffness[i] * max_elongation * max_elongation).v();
                bushing.cubic_stiffness[i] = N(0.0);
            }
        }
        Some(linear_elements)
    }
}

impl DamperCoefficients<f64> {
    /// Returns a spring without tension at rest that is as stiff as the onset of friction at the
    /// end of the free stroke, where the share of friction that acts grows by up to 1 / (2 sigma)
    /// per unit of length. Returns `None` without a free stroke.
    fn onset_spring(&self) -> Option<SpringCoefficients<f64>> {
        if !self.has_free_stroke() {
            return None;
        }
        let stiffness = self.coulomb_friction / (2.0 * self.softness_squared.sqrt());
        Some(SpringCoefficients {
            ends: self.ends,
            stiffness,
            stiffness_times_free_length: (stiffness * self.rest_length).v(),
            cubic_stiffness: N(0.0),
            free_length: self.rest_length,
        })
    }
}

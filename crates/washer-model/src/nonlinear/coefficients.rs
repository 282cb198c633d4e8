//! The coefficients of the equations, one machine per lane.

use crate::Machine;
use crate::lanes::{AnyLaneFlag, lane_struct};
use crate::nonlinear::elements::Elements;
use lane_ode::{Lane, N};

lane_struct! {
    /// The coefficients of a machine.
    #[derive(Clone, Debug)]
    MachineCoefficients { bodies: Bodies<T>, elements: Elements<T> }
}

impl MachineCoefficients<f64> {
    pub(crate) fn new(machine: &Machine) -> Self {
        Self { bodies: Bodies::new(machine), elements: Elements::new(machine) }
    }

    /// Returns the coefficients from which the linear model is derived, with viscous damping in
    /// place of friction.
    pub(crate) fn with_viscous_friction(&self) -> Self {
        Self { bodies: self.bodies, elements: self.elements.with_viscous_friction() }
    }
}

lane_struct! {
    /// The coefficients of bodies, flexure and bearings (model page, sections 1 to 3).
    #[derive(Clone, Copy, Debug)]
    Bodies {
        gravity: N<T>,
        tub_mass: N<T>, tub_inverse_mass: N<T>, tub_centre_x: N<T>, tub_i11: N<T>, tub_i22: N<T>,
        tub_i33: N<T>,
        shaft_i11: N<T>, shaft_i22: N<T>, shaft_i33: N<T>,
        /// The mass of shaft, drum and unbalance.
        rotor_mass: N<T>, rotor_inverse_mass: N<T>,
        /// The masses of tub and rotor as shares of the total mass.
        tub_mass_share: N<T>, rotor_mass_share: N<T>,
        /// The position of the rotor's mass centre from P_S: `shaft_centre_offset * s1 +
        /// drum_mass_share * rho`.
        shaft_centre_offset: N<T>, drum_mass_share: N<T>,
        /// The vector rho from the hinge P_D to the drum's mass centre, in drum axes: (L_DM, e, 0)
        /// where all unbalances are in the plane of d1 and d2.
        rho_1: N<T>, rho_2: N<T>, rho_3: N<T>,
        /// The reduced mass mu of shaft and drum times the distance l from the shaft's mass centre
        /// to the hinge.
        mu_l: N<T>,
        /// mu l^2.
        mu_l2: N<T>,
        /// The inertia about the hinge of the drum and of a reduced mass mu at rho together, in
        /// drum axes.
        drum_i11: N<T>, drum_i22: N<T>, drum_i33: N<T>, drum_i12: N<T>, drum_i13: N<T>,
        drum_i23: N<T>,
        /// True if a drum has an unbalance outside the plane of d1 and d2. Otherwise `rho_3`,
        /// `drum_i13` and `drum_i23` are zero, and the equations skip their terms.
        is_skewed: AnyLaneFlag<T>,
        flexure_stiffness: N<T>,
        front_bearing_x: N<T>, rear_bearing_x: N<T>,
        front_bearing_stiffness: N<T>, rear_bearing_stiffness: N<T>,
        /// The inverse of the bearings' stiffness matrix over (offset, tilt) of their midpoint.
        bearing_force_compliance: N<T>, bearing_cross_compliance: N<T>,
        bearing_moment_compliance: N<T>,
        tub_front_x: N<T>, hinge_x: N<T>, hinge_to_front_distance: N<T>, clearance: N<T>,
    }
}

impl<T: Copy> Bodies<T> {
    /// Returns the bearings' compliances in one direction: offset by force, offset by moment, tilt
    /// by moment.
    #[inline(always)]
    pub(crate) fn bearing_compliance(&self) -> [N<T>; 3] {
        [
            self.bearing_force_compliance,
            self.bearing_cross_compliance,
            self.bearing_moment_compliance,
        ]
    }
}

impl<T: Lane> Bodies<T> {
    /// Returns whether a lane's drum has an unbalance outside the plane of d1 and d2.
    pub(crate) fn is_skewed_in(&self, lane: usize) -> bool {
        [self.rho_3, self.drum_i13, self.drum_i23].iter().any(|moment| moment.0.get(lane) != 0.0)
    }
}

impl Bodies<f64> {
    pub(crate) fn new(machine: &Machine) -> Self {
        let Machine { tub, shaft, drum, flexure, bearings, .. } = machine;
        // The drum of Tables 2 and 3, with its unbalances added one by one (section 2 of the model
        // page).
        let mut m_d = drum.mass_kg;
        let [mut x_d, mut e, mut e_3] = [drum.centre_x_m, 0.0, 0.0];
        let [mut i11, mut i22, mut i33] = drum.inertia_kg_m2;
        let [mut i12, mut i13, mut i23] = [0.0; 3];
        for unbalance in machine.unbalances() {
            let m_u = unbalance.mass_kg;
            let total_mass = m_d + m_u;
            let dx = unbalance.x_m - x_d;
            let [y, z] = unbalance.position_m();
            let dy = y - e;
            let dz = z - e_3;
            let reduced_mass = m_u * m_d / total_mass;
            i11 += reduced_mass * dy * dy;
            i11 += reduced_mass * dz * dz;
            i22 += reduced_mass * dx * dx;
            i22 += reduced_mass * dz * dz;
            i33 += reduced_mass * (dy * dy + dx * dx);
            i12 -= reduced_mass * dx * dy;
            i13 -= reduced_mass * dx * dz;
            i23 -= reduced_mass * dy * dz;
            x_d += m_u / total_mass * dx;
            e += m_u / total_mass * dy;
            e_3 += m_u / total_mass * dz;
            m_d = total_mass;
        }
        let is_skewed = [e_3, i13, i23].iter().any(|moment| *moment != 0.0);
        let rho_1 = x_d - drum.hinge_x_m;
        let rho_2 = e;
        let rho_3 = e_3;
        // Shaft and drum about their common mass centre: the relative motion of their own mass
        // centres has the reduced mass mu.
        let m_s = shaft.mass_kg;
        let rotor_mass = m_s + m_d;
        let mu = m_s * m_d / rotor_mass;
        let l = drum.hinge_x_m - shaft.centre_x_m;
        let front_x_m = bearings.front_x_m;
        let rear_x_m = bearings.rear_x_m;
        let k_f = bearings.front_stiffness_n_per_m;
        let k_r = bearings.rear_stiffness_n_per_m;
        let bearing_distance = front_x_m - rear_x_m;
        Self {
            gravity: N(machine.gravity_m_per_s2),
            tub_mass: N(tub.mass_kg),
            tub_inverse_mass: N(1.0 / tub.mass_kg),
            tub_centre_x: N(tub.centre_x_m),
            tub_i11: N(tub.inertia_kg_m2[0]),
            tub_i22: N(tub.inertia_kg_m2[1]),
            tub_i33: N(tub.inertia_kg_m2[2]),
            shaft_i11: N(shaft.inertia_kg_m2[0]),
            shaft_i22: N(shaft.inertia_kg_m2[1]),
            shaft_i33: N(shaft.inertia_kg_m2[2]),
            rotor_mass: N(rotor_mass),
            rotor_inverse_mass: N(1.0 / rotor_mass),
            tub_mass_share: N(tub.mass_kg / (tub.mass_kg + rotor_mass)),
            rotor_mass_share: N(rotor_mass / (tub.mass_kg + rotor_mass)),
            shaft_centre_offset: N((m_s * shaft.centre_x_m + m_d * drum.hinge_x_m) / rotor_mass),
            drum_mass_share: N(m_d / rotor_mass),
            rho_1: N(rho_1),
            rho_2: N(rho_2),
            rho_3: N(rho_3),
            mu_l: N(mu * l),
            mu_l2: N(mu * l * l),
            drum_i11: N(i11 + mu * rho_2 * rho_2 + mu * rho_3 * rho_3),
            drum_i22: N(i22 + mu * rho_1 * rho_1 + mu * rho_3 * rho_3),
            drum_i33: N(i33 + mu * (rho_1 * rho_1 + rho_2 * rho_2)),
            drum_i12: N(i12 - mu * rho_1 * rho_2),
            drum_i13: N(i13 - mu * rho_1 * rho_3),
            drum_i23: N(i23 - mu * rho_2 * rho_3),
            is_skewed: AnyLaneFlag::new(is_skewed),
            flexure_stiffness: N(flexure.stiffness_n_m_per_rad),
            front_bearing_x: N(bearings.front_x_m),
            rear_bearing_x: N(bearings.rear_x_m),
            front_bearing_stiffness: N(bearings.front_stiffness_n_per_m),
            rear_bearing_stiffness: N(bearings.rear_stiffness_n_per_m),
            bearing_force_compliance: N((rear_x_m * rear_x_m / k_f + front_x_m * front_x_m / k_r)
                / (bearing_distance * bearing_distance)),
            bearing_cross_compliance: N(
                (-rear_x_m / k_f - front_x_m / k_r) / (bearing_distance * bearing_distance)
            ),
            bearing_moment_compliance: N(
                (1.0 / k_f + 1.0 / k_r) / (bearing_distance * bearing_distance)
            ),
            tub_front_x: N(tub.front_x_m),
            hinge_x: N(drum.hinge_x_m),
            hinge_to_front_distance: N(drum.front_x_m - drum.hinge_x_m),
            clearance: N(machine.radial_clearance_m),
        }
    }
}

//! The machine's numbers as the equations use them, one set per lane.

use crate::machine::Machine;
use lane_ode::{Dual, Lane, N, Real};

/// Declares a struct of lane values that can be made constant in all lanes, filled lane by lane, and lifted to duals.
macro_rules! lane_struct {
    ($(#[$meta:meta])* $name:ident { $($(#[$fmeta:meta])* $field:ident),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct $name<T> { $($(#[$fmeta])* pub(crate) $field: N<T>,)* }

        impl<T: Real> $name<T> {
            /// The scalar values in every lane.
            #[inline(always)]
            pub(crate) fn splat(zero: N<T>, from: &$name<f64>) -> Self {
                Self { $($field: zero.lit(from.$field.0),)* }
            }
            /// As constants of a dual number.
            #[inline(always)]
            pub(crate) fn constant(&self) -> $name<Dual<T>> {
                $name { $($field: self.$field.constant(),)* }
            }
        }

        impl<T: Lane> $name<T> {
            /// Puts scalar values into one lane.
            pub(crate) fn set_lane(&mut self, lane: usize, from: &$name<f64>) {
                $(self.$field.0.set(lane, from.$field.0);)*
            }
        }
    };
}

lane_struct! {
    /// Bodies, flexure and bearings (model page, sections 1 to 3).
    Bodies {
        gravity,
        tub_mass, tub_per_mass, tub_centre, tub_i11, tub_i22, tub_i33,
        shaft_i11, shaft_i22, shaft_i33,
        /// Mass of shaft, drum and unbalance.
        rotor_mass, rotor_per_mass,
        /// Of the whole mass.
        tub_share, rotor_share,
        /// The rotor's centre from the bearing midpoint is `along_shaft * s1 + drum_share * rho`.
        along_shaft, drum_share,
        /// rho, from the hinge P_D to the drum's mass centre, in drum axes: (L_DM, e, 0).
        rho_1, rho_2,
        /// Reduced mass of shaft and drum times the distance from the shaft's centre to the hinge.
        mu_l,
        /// Likewise times the distance squared.
        mu_l2,
        /// The drum's inertia about the hinge, of its own and of the reduced mass at rho; in drum axes.
        drum_i11, drum_i22, drum_i33, drum_i12,
        flexure_stiffness,
        bearing_front, bearing_rear, front_stiffness, rear_stiffness,
        /// The bearings' stiffness over (offset, tilt) of their midpoint, inverted: offset by force, offset by moment, tilt by moment.
        bearing_force_compliance, bearing_mixed_compliance, bearing_moment_compliance,
        tub_front, drum_hinge, hinge_to_front, clearance,
    }
}

lane_struct! {
    /// A spring between cabinet and tub.
    SpringOf { cabinet_x, cabinet_y, cabinet_z, tub_x, tub_y, tub_z, stiffness, stiffness_times_free_length }
}

lane_struct! {
    /// A damper between cabinet and tub.
    DamperOf { cabinet_x, cabinet_y, cabinet_z, tub_x, tub_y, tub_z, damping }
}

impl Bodies<f64> {
    pub(crate) fn new(machine: &Machine) -> Self {
        let Machine { tub, shaft, drum, unbalance, flexure, bearings, .. } = machine;
        let m_0 = drum.mass_kg;
        let m_u = unbalance.mass_kg;
        let m_d = m_0 + m_u;
        // Section 2: the drum of Tables 2 and 3 as a function of the unbalance mass.
        let dx = unbalance.x_m - drum.centre_x_m;
        let r_u = unbalance.radius_m;
        let mu_r = m_u * m_0 / m_d;
        let drum_inertia = [
            drum.inertia_kg_m2[0] + mu_r * r_u * r_u,
            drum.inertia_kg_m2[1] + mu_r * dx * dx,
            drum.inertia_kg_m2[2] + mu_r * (r_u * r_u + dx * dx),
        ];
        let drum_i12 = -mu_r * dx * r_u;
        let rho_1 = drum.centre_x_m + m_u / m_d * dx - drum.hinge_x_m;
        let rho_2 = m_u / m_d * r_u;
        // Shaft and drum about their common centre: the reduced mass moves with the line between their centres.
        let m_s = shaft.mass_kg;
        let rotor_mass = m_s + m_d;
        let mu = m_s * m_d / rotor_mass;
        let l = drum.hinge_x_m - shaft.centre_x_m;
        let (front, rear) = (bearings.front_x_m, bearings.rear_x_m);
        let (k_f, k_r) = (bearings.front_stiffness_n_per_m, bearings.rear_stiffness_n_per_m);
        let span = front - rear;
        Self {
            gravity: N(machine.gravity_m_per_s2),
            tub_mass: N(tub.mass_kg),
            tub_per_mass: N(1.0 / tub.mass_kg),
            tub_centre: N(tub.centre_x_m),
            tub_i11: N(tub.inertia_kg_m2[0]),
            tub_i22: N(tub.inertia_kg_m2[1]),
            tub_i33: N(tub.inertia_kg_m2[2]),
            shaft_i11: N(shaft.inertia_kg_m2[0]),
            shaft_i22: N(shaft.inertia_kg_m2[1]),
            shaft_i33: N(shaft.inertia_kg_m2[2]),
            rotor_mass: N(rotor_mass),
            rotor_per_mass: N(1.0 / rotor_mass),
            tub_share: N(tub.mass_kg / (tub.mass_kg + rotor_mass)),
            rotor_share: N(rotor_mass / (tub.mass_kg + rotor_mass)),
            along_shaft: N((m_s * shaft.centre_x_m + m_d * drum.hinge_x_m) / rotor_mass),
            drum_share: N(m_d / rotor_mass),
            rho_1: N(rho_1),
            rho_2: N(rho_2),
            mu_l: N(mu * l),
            mu_l2: N(mu * l * l),
            drum_i11: N(drum_inertia[0] + mu * rho_2 * rho_2),
            drum_i22: N(drum_inertia[1] + mu * rho_1 * rho_1),
            drum_i33: N(drum_inertia[2] + mu * (rho_1 * rho_1 + rho_2 * rho_2)),
            drum_i12: N(drum_i12 - mu * rho_1 * rho_2),
            flexure_stiffness: N(flexure.stiffness_n_m_per_rad),
            bearing_front: N(bearings.front_x_m),
            bearing_rear: N(bearings.rear_x_m),
            front_stiffness: N(bearings.front_stiffness_n_per_m),
            rear_stiffness: N(bearings.rear_stiffness_n_per_m),
            bearing_force_compliance: N((rear * rear / k_f + front * front / k_r) / (span * span)),
            bearing_mixed_compliance: N((-rear / k_f - front / k_r) / (span * span)),
            bearing_moment_compliance: N((1.0 / k_f + 1.0 / k_r) / (span * span)),
            tub_front: N(tub.front_x_m),
            drum_hinge: N(drum.hinge_x_m),
            hinge_to_front: N(drum.front_x_m - drum.hinge_x_m),
            clearance: N(machine.radial_clearance_m),
        }
    }
}

/// Distance between two points.
fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|i| b[i] - a[i]);
    (x * x + y * y + z * z).sqrt()
}

impl SpringOf<f64> {
    pub(crate) fn new(spring: &crate::machine::Spring) -> Self {
        let free_length = spring.free_length_m.unwrap_or_else(|| distance(spring.cabinet_m, spring.tub_m));
        let ([cabinet_x, cabinet_y, cabinet_z], [tub_x, tub_y, tub_z]) =
            (spring.cabinet_m.map(N), spring.tub_m.map(N));
        Self {
            cabinet_x,
            cabinet_y,
            cabinet_z,
            tub_x,
            tub_y,
            tub_z,
            stiffness: N(spring.stiffness_n_per_m),
            stiffness_times_free_length: N(spring.stiffness_n_per_m * free_length),
        }
    }
}

impl DamperOf<f64> {
    pub(crate) fn new(damper: &crate::machine::Damper) -> Self {
        let ([cabinet_x, cabinet_y, cabinet_z], [tub_x, tub_y, tub_z]) =
            (damper.cabinet_m.map(N), damper.tub_m.map(N));
        let damping = N(damper.damping_n_s_per_m);
        Self { cabinet_x, cabinet_y, cabinet_z, tub_x, tub_y, tub_z, damping }
    }
}

/// A whole machine over lanes.
#[derive(Clone, Debug)]
pub(crate) struct Coefficients<T> {
    pub(crate) bodies: Bodies<T>,
    pub(crate) springs: Vec<SpringOf<T>>,
    pub(crate) dampers: Vec<DamperOf<T>>,
}

impl Coefficients<f64> {
    pub(crate) fn new(machine: &Machine) -> Self {
        Self {
            bodies: Bodies::new(machine),
            springs: machine.springs.iter().map(SpringOf::new).collect(),
            dampers: machine.dampers.iter().map(DamperOf::new).collect(),
        }
    }
}

impl<T: Lane> Coefficients<T> {
    /// The same machine in every lane.
    #[inline(always)]
    pub(crate) fn splat(zero: N<T>, from: &Coefficients<f64>) -> Self {
        let mut lanes = Self {
            bodies: Bodies::splat(zero, &from.bodies),
            springs: Vec::with_capacity(from.springs.len()),
            dampers: Vec::with_capacity(from.dampers.len()),
        };
        for spring in &from.springs {
            lanes.springs.push(SpringOf::splat(zero, spring));
        }
        for damper in &from.dampers {
            lanes.dampers.push(DamperOf::splat(zero, damper));
        }
        lanes
    }

    /// Puts a machine with as many springs and dampers into one lane.
    pub(crate) fn set_lane(&mut self, lane: usize, from: &Coefficients<f64>) {
        self.bodies.set_lane(lane, &from.bodies);
        self.springs.iter_mut().zip(&from.springs).for_each(|(to, from)| to.set_lane(lane, from));
        self.dampers.iter_mut().zip(&from.dampers).for_each(|(to, from)| to.set_lane(lane, from));
    }
}

impl<T: Real> Coefficients<T> {
    /// As constants of a dual number.
    #[inline(always)]
    pub(crate) fn constant(&self) -> Coefficients<Dual<T>> {
        let mut lifted = Coefficients {
            bodies: self.bodies.constant(),
            springs: Vec::with_capacity(self.springs.len()),
            dampers: Vec::with_capacity(self.dampers.len()),
        };
        // Loops, not closures: only what is inlined into an instruction set's entry function is compiled for it.
        for spring in &self.springs {
            lifted.springs.push(spring.constant());
        }
        for damper in &self.dampers {
            lifted.dampers.push(damper.constant());
        }
        lifted
    }
}

//! The machine in SI units, as a machine file describes it.

pub(crate) mod feet;
pub(crate) mod parameters;
pub(crate) mod spin;
pub(crate) mod violations;

/// A front-loading washing machine on its suspension. Lengths are in metres from O, the midpoint
/// between the bearing centres before loading; x runs along the drum axis towards the door, y up, z
/// horizontal.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    /// The acceleration of gravity, which acts along -y.
    pub gravity_m_per_s2: f64,
    /// The radial clearance between drum and tub at rest.
    pub radial_clearance_m: f64,
    /// The tub, body T.
    pub tub: Tub,
    /// The shaft with its rotor, body S.
    pub shaft: Shaft,
    /// The drum without unbalance, body D.
    pub drum: Drum,
    /// The unbalance that every machine has: laundry stuck to the drum's wall, as a point mass.
    pub unbalance: Unbalance,
    /// Further unbalances: laundry in other planes, or counterweights.
    pub further_unbalances: Vec<Unbalance>,
    /// The bending flexibility between shaft and drum.
    pub flexure: Flexure,
    /// The two radial bearings between tub and shaft.
    pub bearings: Bearings,
    /// The springs between cabinet and tub.
    pub springs: Vec<Spring>,
    /// The dampers between cabinet and tub.
    pub dampers: Vec<Damper>,
    /// The stops between cabinet and tub.
    pub stops: Vec<BumpStop>,
    /// The bushings between cabinet and tub, such as a door gasket.
    pub bushings: Vec<Bushing>,
    /// The cabinet, if it is described. Only the loads of the feet depend on the cabinet.
    pub cabinet: Option<Cabinet>,
    /// The three or four feet of the cabinet, if a cabinet is described.
    pub feet: Vec<Foot>,
}

/// The tub, body T, which hangs on the springs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tub {
    pub mass_kg: f64,
    /// The mass centre on the tub axis (L_T).
    pub centre_x_m: f64,
    /// The principal moments of inertia about the mass centre, in body axes.
    pub inertia_kg_m2: [f64; 3],
    /// The front centre P_TE on the tub axis.
    pub front_x_m: f64,
}

/// The shaft with its rotor, body S.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaft {
    pub mass_kg: f64,
    /// The mass centre on the shaft axis, negative behind O (-L_S).
    pub centre_x_m: f64,
    /// The principal moments of inertia about the mass centre, in body axes.
    pub inertia_kg_m2: [f64; 3],
}

/// The drum without unbalance, body D.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drum {
    /// The mass m_0.
    pub mass_kg: f64,
    /// The mass centre x_0 on the axis.
    pub centre_x_m: f64,
    /// The principal moments of inertia about the mass centre, in body axes.
    pub inertia_kg_m2: [f64; 3],
    /// The hinge P_D between drum and shaft (L_D).
    pub hinge_x_m: f64,
    /// The front centre P_DE (L_D + L_DE).
    pub front_x_m: f64,
}

/// An unbalance: a point mass fixed to the drum.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Unbalance {
    /// The mass m_u.
    pub mass_kg: f64,
    /// The position x_u along the axis.
    pub x_m: f64,
    /// The distance r_u from the axis; negative for a further unbalance on the opposite side.
    pub radius_m: f64,
    /// The angle about the axis from d2 towards d3, in which the drum turns.
    pub angle_deg: f64,
}

/// The drum shaft's bending stiffness K_D.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flexure {
    /// The stiffness against the angle between the axes of S and D.
    pub stiffness_n_m_per_rad: f64,
}

/// Two radial bearings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bearings {
    /// The front bearing centre (L_fb).
    pub front_x_m: f64,
    /// The rear bearing centre, negative (-L_rb).
    pub rear_x_m: f64,
    /// The radial stiffness K_fb.
    pub front_stiffness_n_per_m: f64,
    /// The radial stiffness K_rb.
    pub rear_stiffness_n_per_m: f64,
}

/// A spring between a cabinet point and a tub point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// The end at the cabinet, in cabinet axes from O.
    pub cabinet_m: [f64; 3],
    /// The end at the tub, in tub axes from P_T.
    pub tub_m: [f64; 3],
    pub stiffness_n_per_m: f64,
    /// The length at which the spring has no tension; if absent, the distance between the given
    /// ends.
    pub free_length_m: Option<f64>,
    /// The tension per cube of the elongation (k_3), added to the tension of the linear stiffness.
    pub cubic_n_per_m3: f64,
}

/// A damper between a cabinet point and a tub point, viscous, with friction, or both, in one stage
/// or in two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damper {
    /// The end at the cabinet, in cabinet axes from O.
    pub cabinet_m: [f64; 3],
    /// The end at the tub, in tub axes from P_T.
    pub tub_m: [f64; 3],
    /// The damping along the line between the ends.
    pub damping_n_s_per_m: f64,
    /// The friction F_f: the force at speeds well above `friction_speed_m_per_s`.
    pub friction_n: f64,
    /// The speed v_s below which friction fades to zero.
    pub friction_speed_m_per_s: f64,
    /// The speed amplitude V at which the linear model's viscous damping 4 F_f / (pi V) dissipates
    /// as much energy in a cycle as friction does; if absent, the amplitude of the linear motion.
    pub friction_linear_speed_m_per_s: Option<f64>,
    /// The free stroke s: friction and outer damping act only if the damper's length differs from
    /// its length at rest by more than s.
    pub free_stroke_m: f64,
    /// The width over which friction and outer damping set in beyond the free stroke.
    pub free_stroke_softness_m: f64,
    /// The damping beyond the free stroke, added to the damping that always acts.
    pub outer_damping_n_s_per_m: f64,
}

/// A rubber stop at the cabinet, which a tub point meets after a clearance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BumpStop {
    /// The tub point, in tub axes from P_T.
    pub tub_m: [f64; 3],
    /// The direction from the tub to the stop, in cabinet axes; a vector of any length but 0.
    pub direction: [f64; 3],
    /// The distance that the tub point may move in that direction from its position before loading.
    pub clearance_m: f64,
    /// The stiffness in contact.
    pub stiffness_n_per_m: f64,
    /// The damping in contact.
    pub damping_n_s_per_m: f64,
    /// The depth s of compression over which contact sets in.
    pub softness_m: f64,
}

impl BumpStop {
    /// The default softness. Basis: a tenth of a millimetre of rubber. Doubling it makes the force
    /// set in over twice the depth.
    pub const SOFTNESS_M: f64 = 1e-4;
}

impl Default for BumpStop {
    /// Returns a stop without stiffness, above the bearings' midpoint.
    fn default() -> Self {
        Self {
            tub_m: [0.0; 3],
            direction: [0.0, 1.0, 0.0],
            clearance_m: 0.0,
            stiffness_n_per_m: 0.0,
            damping_n_s_per_m: 0.0,
            softness_m: Self::SOFTNESS_M,
        }
    }
}

/// A bushing: springs and dampers along the cabinet's three axes on one tub point. The force is
/// zero while the tub point is at its position before loading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bushing {
    /// The tub point, in tub axes from P_T.
    pub tub_m: [f64; 3],
    /// The stiffness along c1, c2 and c3.
    pub stiffness_n_per_m: [f64; 3],
    /// The force per cube of the displacement along each axis, added to the force of the linear
    /// stiffness.
    pub cubic_n_per_m3: [f64; 3],
    /// The damping along each axis.
    pub damping_n_s_per_m: [f64; 3],
}

/// The cabinet with everything fixed to it. It does not move.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cabinet {
    pub mass_kg: f64,
    pub centre_m: [f64; 3],
    /// The coefficient of friction between feet and floor.
    pub friction_coefficient: f64,
}

/// A foot of the cabinet.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Foot {
    /// The point at which the foot meets the floor.
    pub foot_m: [f64; 3],
}

impl Unbalance {
    /// Returns the position across the drum's axis, along d2 and d3 (m). Multiples of 90 degrees
    /// are exact.
    pub(crate) fn position_m(&self) -> [f64; 2] {
        let quarters = (self.angle_deg / 90.0).round();
        let (sin, cos) = libm::sincos((self.angle_deg - 90.0 * quarters).to_radians());
        let [y, z] = match quarters.rem_euclid(4.0) {
            0.0 => [cos, sin],
            1.0 => [-sin, cos],
            2.0 => [-cos, -sin],
            _ => [sin, -cos],
        };
        [self.radius_m * y, self.radius_m * z]
    }
}

impl Damper {
    /// The default of the speed v_s below which friction fades. Basis: a usual value of suspension
    /// dampers. Doubling it makes friction viscous up to twice the speed.
    pub const FRICTION_SPEED_M_PER_S: f64 = 0.01;
    /// The default width over which forces beyond a free stroke set in. Basis: the default of
    /// stops. Doubling it makes the forces set in over twice the length.
    pub const FREE_STROKE_SOFTNESS_M: f64 = BumpStop::SOFTNESS_M;
    /// The initial estimate in the iteration for the speed amplitude V. Basis: a usual speed
    /// amplitude. Doubling it changes the number of iterations only.
    pub(crate) const INITIAL_LINEAR_SPEED_M_PER_S: f64 = 0.1;
}

impl Machine {
    /// Returns the machine's mirror image in the vertical plane through the drum's axis. With its
    /// drum turning backwards, the image moves as the mirror image of this machine with its drum
    /// turning forwards.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let mut mirror_image = self.clone();
        let negate_z = |position: &mut [f64; 3]| position[2] = -position[2];
        for spring in &mut mirror_image.springs {
            negate_z(&mut spring.cabinet_m);
            negate_z(&mut spring.tub_m);
        }
        for damper in &mut mirror_image.dampers {
            negate_z(&mut damper.cabinet_m);
            negate_z(&mut damper.tub_m);
        }
        for stop in &mut mirror_image.stops {
            negate_z(&mut stop.tub_m);
            negate_z(&mut stop.direction);
        }
        for bushing in &mut mirror_image.bushings {
            negate_z(&mut bushing.tub_m);
        }
        for unbalance in mirror_image.unbalances_mut() {
            unbalance.angle_deg = -unbalance.angle_deg;
        }
        for foot in &mut mirror_image.feet {
            negate_z(&mut foot.foot_m);
        }
        if let Some(cabinet) = &mut mirror_image.cabinet {
            negate_z(&mut cabinet.centre_m);
        }
        mirror_image
    }

    /// Iterates over all unbalances, beginning with the one that every machine has.
    pub(crate) fn unbalances(&self) -> impl Iterator<Item = &Unbalance> {
        core::iter::once(&self.unbalance).chain(&self.further_unbalances)
    }

    /// Iterates over all unbalances, beginning with the one that every machine has.
    fn unbalances_mut(&mut self) -> impl Iterator<Item = &mut Unbalance> {
        core::iter::once(&mut self.unbalance).chain(&mut self.further_unbalances)
    }

    /// Returns the weight of tub, shaft, drum and unbalances (N).
    pub fn weight_n(&self) -> f64 {
        let bodies_mass_kg = self.tub.mass_kg + self.shaft.mass_kg + self.drum.mass_kg;
        let further_mass_kg: f64 =
            self.further_unbalances.iter().map(|unbalance| unbalance.mass_kg).sum();
        let mass_kg = bodies_mass_kg + self.unbalance.mass_kg + further_mass_kg;
        self.gravity_m_per_s2 * mass_kg
    }

    /// Returns the machine of Park, Jeong and Yoo (Machines 2021, 9(11), 289): Tables 2 to 4 and
    /// section 3.1, the drum without its unbalance as section 2 of the model page derives it, and
    /// this project's assumptions where the paper gives no value (bearing positions, hinge, fronts,
    /// clearance, free lengths of the springs).
    pub fn paper() -> Self {
        let [unbalance_mass_kg, drum_mass_kg, drum_x_m] = [0.4, 3.64, 0.200];
        let unbalance =
            Unbalance { mass_kg: unbalance_mass_kg, x_m: 0.300, radius_m: 0.200, angle_deg: 0.0 };
        // Tables 2 and 3 list the drum with its 0.4 kg unbalance, so that the point mass is
        // subtracted (model page, section 2).
        let reduced_mass_kg = unbalance_mass_kg * drum_mass_kg / (unbalance_mass_kg + drum_mass_kg);
        let offset_m = unbalance.x_m - drum_x_m;
        let r = unbalance.radius_m;
        let inertia_with_unbalance = [0.196, 0.162, 0.177];
        let point_inertia = [r * r, offset_m * offset_m, r * r + offset_m * offset_m];
        let bare_inertia =
            std::array::from_fn(|i| inertia_with_unbalance[i] - reduced_mass_kg * point_inertia[i]);
        let spring = |x: f64, z_sign: f64| Spring {
            cabinet_m: [x, 0.3002, z_sign * 0.2506],
            tub_m: [x, 0.1626, z_sign * 0.1626],
            stiffness_n_per_m: 8000.0,
            free_length_m: None,
            cubic_n_per_m3: 0.0,
        };
        let damper = |z_sign: f64| Damper {
            cabinet_m: [0.3068, -0.2800, z_sign * 0.2800],
            tub_m: [0.3068, -0.1626, z_sign * 0.1626],
            damping_n_s_per_m: 140.0,
            friction_n: 0.0,
            friction_speed_m_per_s: Damper::FRICTION_SPEED_M_PER_S,
            friction_linear_speed_m_per_s: None,
            free_stroke_m: 0.0,
            free_stroke_softness_m: Damper::FREE_STROKE_SOFTNESS_M,
            outer_damping_n_s_per_m: 0.0,
        };
        Self {
            gravity_m_per_s2: 9.81,
            radial_clearance_m: 0.010,
            tub: Tub {
                mass_kg: 23.87,
                centre_x_m: 0.24061,
                inertia_kg_m2: [1.03, 1.61, 1.53],
                front_x_m: 0.450,
            },
            shaft: Shaft {
                mass_kg: 4.34,
                centre_x_m: -0.01811,
                inertia_kg_m2: [0.0553, 0.0384, 0.0384],
            },
            drum: Drum {
                mass_kg: drum_mass_kg,
                centre_x_m: drum_x_m,
                inertia_kg_m2: bare_inertia,
                hinge_x_m: 0.150,
                front_x_m: 0.450,
            },
            unbalance,
            further_unbalances: Vec::new(),
            flexure: Flexure { stiffness_n_m_per_rad: 29_670.0 },
            bearings: Bearings {
                front_x_m: 0.050,
                rear_x_m: -0.050,
                front_stiffness_n_per_m: 2e8,
                rear_stiffness_n_per_m: 2e8,
            },
            springs: vec![
                spring(0.3268, 1.0),
                spring(0.3268, -1.0),
                spring(0.0868, 1.0),
                spring(0.0868, -1.0),
            ],
            dampers: vec![damper(1.0), damper(-1.0)],
            stops: Vec::new(),
            bushings: Vec::new(),
            cabinet: None,
            feet: Vec::new(),
        }
    }
}

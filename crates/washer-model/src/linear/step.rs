//! The linear model in the form that an integrator evaluates.
//!
//! The constants of a trajectory are computed once, and functions of theta once per instant. A
//! stage only multiplies known matrices by coordinates, speeds and loads. The terms of the
//! coordinates are computed before those of the speeds: a stage's coordinates are known one stage
//! earlier, so that few operations wait for the accelerations of the stage before.

use crate::COORDINATES;
use crate::coordinates::{HINGE_PITCH, HINGE_YAW, ROTOR_ROTATIONS, STATES, TUB_COORDINATES};
use crate::lanes::lane_struct;
use crate::linear::rotor_terms::{
    self as rotor_terms, ENTRIES, INERTIA_ENTRIES, ROWS, RotorCoefficients,
};
use crate::linear::symmetric::Symmetric4;
use crate::linear::{LinearConstants, harmonics};
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::Bodies;
use crate::nonlinear::coupling::{Coupling, HingeMass, mass_scaled_system};
use crate::nonlinear::floating::{FloatingChain, LdltFactors};
use crate::nonlinear::forces::{AxisLoad, Deflection};
use lane_ode::{Lane, N};

lane_struct! {
    /// The constants of one machine that the stages read; `N<f64>` for one, `N<T>` for one per
    /// lane.
    ///
    /// The tub's accelerations are in the order of `TUB_COORDINATES`; loads are forces (y, z) and
    /// moments (y, z) on the shaft's axis.
    #[derive(Clone, Copy, Debug)]
    StepConstants {
        tub_acceleration_per_position: [[N<T>; 4]; 4],
        tub_acceleration_per_speed: [[N<T>; 4]; 4],
        tub_acceleration_per_load: [[N<T>; 4]; 4],
        /// The second derivatives of the bearings' deflection per unit of load on the tub, by the
        /// tub's accelerations: the lower triangle of a symmetric matrix.
        tub_compliance: [[N<T>; 4]; 4],
        tub_axis: [[N<T>; 2]; 2],
        rotor_inverse_mass: N<T>,
        rotor_axis: [[N<T>; 2]; 2],
        /// The bearings' stiffness in one direction: force by offset, force by tilt, moment by
        /// tilt.
        bearing_stiffness: [N<T>; 3],
        /// The inverse of the bearings' stiffness.
        bearing_compliance: [N<T>; 3],
    }
}

impl StepConstants<f64> {
    /// Computes the constants of a machine.
    pub(crate) fn new(bodies: &Bodies<f64>, linear: &LinearConstants<f64>) -> Self {
        let zero = N(0.0);
        let inertia = LdltFactors::new(linear.tub_inertia);
        // Computes the tub's accelerations from forces and torques about its mass centre and from
        // loads on its axis.
        let accelerations_under = |[y, z, yaw, pitch]: [N<f64>; 4], load: [N<f64>; 4]| {
            let chain = FloatingChain {
                inverse_mass: linear.tub_inverse_mass,
                force: [y, z],
                drift: [zero; 2],
                arm: linear.tub_arm,
                axis: linear.tub_axis,
                axis_drift: [zero; 2],
                torque: [yaw, pitch],
            };
            let load = AxisLoad { force: [load[0], load[1]], moment: [load[2], load[3]] };
            let ([y, z], [yaw, pitch]) = chain.accelerations(&inertia, &load);
            [y, z, yaw, pitch]
        };
        let mut constants = Self {
            tub_acceleration_per_position: [[zero; 4]; 4],
            tub_acceleration_per_speed: [[zero; 4]; 4],
            tub_acceleration_per_load: [[zero; 4]; 4],
            tub_compliance: [[zero; 4]; 4],
            tub_axis: linear.tub_axis,
            rotor_inverse_mass: linear.rotor_inverse_mass,
            rotor_axis: linear.rotor_axis,
            bearing_stiffness: [
                bodies.front_bearing_stiffness + bodies.rear_bearing_stiffness,
                bodies.front_bearing_stiffness * bodies.front_bearing_x
                    + bodies.rear_bearing_stiffness * bodies.rear_bearing_x,
                bodies.front_bearing_stiffness * (bodies.front_bearing_x * bodies.front_bearing_x)
                    + bodies.rear_bearing_stiffness
                        * (bodies.rear_bearing_x * bodies.rear_bearing_x),
            ],
            bearing_compliance: bodies.bearing_compliance(),
        };
        for column in 0..4 {
            let force_by_column = |matrix: &[[N<f64>; 4]; 4]| matrix.map(|row| -row[column]);
            let mut unit_reaction = [zero; 4];
            unit_reaction[column] = N(-1.0);
            let accelerations_per_position =
                accelerations_under(force_by_column(&linear.tub_stiffness), [zero; 4]);
            let accelerations_per_speed =
                accelerations_under(force_by_column(&linear.tub_damping), [zero; 4]);
            let accelerations_per_load = accelerations_under([zero; 4], unit_reaction);
            for row in 0..4 {
                constants.tub_acceleration_per_position[row][column] =
                    accelerations_per_position[row];
                constants.tub_acceleration_per_speed[row][column] = accelerations_per_speed[row];
                constants.tub_acceleration_per_load[row][column] = accelerations_per_load[row];
            }
            let deflection = constants.deflection(&to_coordinate_order(
                &accelerations_per_load,
                &[zero; 2],
                &[zero; 4],
            ));
            for row in 0..4 {
                constants.tub_compliance[row][column] = deflection[row];
            }
        }
        constants
    }
}

impl<T: Lane> StepConstants<T> {
    /// Computes the bearings' offset (y, z) and tilt (y, z) from coordinates, or their second
    /// derivatives from accelerations.
    #[inline(always)]
    fn deflection(&self, q: &[N<T>; COORDINATES]) -> [N<T>; 4] {
        Deflection::from_linear_model(q, &self.tub_axis, &self.rotor_axis).as_vector()
    }

    /// Computes the load of the bearings' springs on the shaft.
    #[inline(always)]
    fn spring_load(&self, [y, z, tilt_y, tilt_z]: &[N<T>; 4]) -> [N<T>; 4] {
        let [force_per_offset, force_per_tilt, moment_per_tilt] = self.bearing_stiffness;
        let zero = y.lit(0.0);
        [
            zero - force_per_offset * *y - force_per_tilt * *tilt_y,
            zero - force_per_offset * *z - force_per_tilt * *tilt_z,
            zero - force_per_tilt * *y - moment_per_tilt * *tilt_y,
            zero - force_per_tilt * *z - moment_per_tilt * *tilt_z,
        ]
    }
}

/// The inertia, gyroscopic terms and bearings of the rotor at one instant, in its angle's axes.
#[derive(Clone, Copy)]
pub(crate) struct RotorArrays<T> {
    entries: [N<T>; ENTRIES],
    /// The inverse of the inertia about the mass centre.
    inverse_inertia: Symmetric4<T>,
    bearing_arrays: BearingArrays<T>,
}

/// The bearings with scaled mass at an instant (`nonlinear/coupling.rs`); not computed for springs.
#[derive(Clone, Copy)]
struct BearingArrays<T> {
    /// The inverse of w^2 K^-1 + C.
    system_inverse: Symmetric4<T>,
    /// The factor of the deflection, w^2 + theta'^2, with w the cap of the bearings' modes.
    deflection_factor: N<T>,
    rotor: RotorLoadResponse<T>,
}

/// The accelerations of the rotor per unit of load on its axis: of the midpoint (y, z), and of the
/// rotations.
#[derive(Clone, Copy)]
struct RotorLoadResponse<T> {
    translation: [[N<T>; 4]; 2],
    rotation: [[N<T>; 4]; 4],
}

impl<T: Lane> RotorArrays<T> {
    /// Computes the arrays at an instant.
    #[inline(always)]
    pub(crate) fn new(
        constants: &StepConstants<T>,
        coupling: &Coupling<T>,
        rotor_coefficients: &RotorCoefficients<T>,
        spin: &SpinState<T>,
        hinge_mass: Option<HingeMass<T>>,
    ) -> Self {
        let zero = spin.sin.lit(0.0);
        let zero_matrix = Symmetric4([[zero; 4]; 4]);
        let bearing_arrays = BearingArrays {
            system_inverse: zero_matrix,
            deflection_factor: zero,
            rotor: RotorLoadResponse { translation: [[zero; 4]; 2], rotation: [[zero; 4]; 4] },
        };
        let mut rotor =
            Self { entries: [zero; ENTRIES], inverse_inertia: zero_matrix, bearing_arrays };
        rotor.update(constants, coupling, rotor_coefficients, spin, hinge_mass);
        rotor
    }

    /// Overwrites the arrays with those of another instant of the same machine.
    #[inline(always)]
    pub(crate) fn update(
        &mut self,
        constants: &StepConstants<T>,
        coupling: &Coupling<T>,
        rotor_coefficients: &RotorCoefficients<T>,
        spin: &SpinState<T>,
        hinge_mass: Option<HingeMass<T>>,
    ) {
        let functions = harmonics::spin_functions(spin);
        let zero = spin.sin.lit(0.0);
        rotor_coefficients.sum_loads(&functions, &mut self.entries);
        // The inverse is a long chain of dependent operations. It comes last, because a stage
        // begins with operations that do not need it.
        let mut inertia_entries = [zero; INERTIA_ENTRIES];
        rotor_coefficients.sum_inertia(&functions, &mut inertia_entries);
        let mut inertia = [[zero; 4]; 4];
        for row in 0..4 {
            for column in 0..=row {
                inertia[row][column] = inertia_entries[rotor_terms::inertia_entry(row, column)];
            }
        }
        if let Some(mass) = hinge_mass {
            for (index, r) in [2, 3].into_iter().enumerate() {
                inertia[r][r] += mass.inertia;
                self.entries[rotor_terms::force_entry(2 + r)] += mass.torque[index];
            }
            self.entries[rotor_terms::damping_entry(4, 3)] -= mass.torque_per_speed;
            self.entries[rotor_terms::damping_entry(5, 2)] += mass.torque_per_speed;
        }
        self.inverse_inertia = Symmetric4(inertia).inverse();
        if let Coupling::MassScaled(scaling) = coupling {
            let cap_squared = scaling.bearing_cap_squared;
            let arms = rotor_terms::arms(&self.entries);
            let (rotor, compliance) =
                RotorLoadResponse::new(constants, &self.inverse_inertia, &arms);
            let system_matrix = bearing_system(constants, cap_squared, &compliance);
            self.bearing_arrays = BearingArrays {
                system_inverse: Symmetric4(system_matrix).inverse(),
                deflection_factor: cap_squared + spin.speed * spin.speed,
                rotor,
            };
        }
    }
}

impl<T: Lane> RotorLoadResponse<T> {
    /// Computes the accelerations per unit of load and the rotor's compliance C, from the inverse
    /// of the rotor's inertia and the partial velocities of its mass centre.
    #[inline(always)]
    fn new(
        constants: &StepConstants<T>,
        inverse: &Symmetric4<T>,
        arm: &[[N<T>; 2]; 4],
    ) -> (Self, Symmetric4<T>) {
        let zero = constants.rotor_inverse_mass.lit(0.0);
        let axis = &constants.rotor_axis;
        let mut rotation = [[zero; 4]; 4];
        for row in 0..4 {
            let by_yaw = inverse.entry(row, 0);
            let by_pitch = inverse.entry(row, 1);
            // The partial velocity by the yaw has no y component.
            let mut rotation_per_force =
                [zero - by_pitch * arm[1][0], zero - by_yaw * arm[0][1] - by_pitch * arm[1][1]];
            for r in 2..4 {
                for i in 0..2 {
                    rotation_per_force[i] -= inverse.entry(row, r) * arm[r][i];
                }
            }
            let rotation_per_moment =
                [(by_pitch * axis[1][0]).v(), by_yaw * axis[0][1] + by_pitch * axis[1][1]];
            rotation[row] = [
                rotation_per_force[0],
                rotation_per_force[1],
                rotation_per_moment[0],
                rotation_per_moment[1],
            ];
        }
        // The rotor's compliance C: the accelerations of its midpoint and axis per unit of load.
        let mut compliance = [[zero; 4]; 4];
        compliance[0][0] = constants.rotor_inverse_mass;
        compliance[1][1] = constants.rotor_inverse_mass;
        for r in 0..4 {
            if r > 0 {
                compliance[0][0] -= arm[r][0] * rotation[r][0];
            }
            compliance[1][0] -= arm[r][1] * rotation[r][0];
            compliance[1][1] -= arm[r][1] * rotation[r][1];
        }
        for column in 0..4 {
            if column < 3 {
                compliance[2][column] = (axis[1][0] * rotation[1][column]).v();
            }
            compliance[3][column] =
                axis[0][1] * rotation[0][column] + axis[1][1] * rotation[1][column];
        }
        let compliance = Symmetric4(compliance);
        let mut translation = [[zero; 4]; 2];
        for i in 0..2 {
            for column in 0..4 {
                translation[i][column] = compliance.entry(i, column);
            }
        }
        (Self { translation, rotation }, compliance)
    }
}

/// Computes the lower triangle of w^2 K^-1 + C from the rotor's part of C, where C is the
/// compliance of both halves.
#[inline(always)]
fn bearing_system<T: Lane>(
    constants: &StepConstants<T>,
    cap_squared: N<T>,
    rotor: &Symmetric4<T>,
) -> [[N<T>; 4]; 4] {
    mass_scaled_system(
        cap_squared,
        constants.bearing_compliance,
        &constants.tub_compliance,
        &rotor.0,
    )
}

impl<T: Lane> BearingArrays<T> {
    /// Computes the load of the bearings on the tub, from the deflection and from its second
    /// derivative without loads of the bearings.
    #[inline(always)]
    fn reaction(&self, deflection: &[N<T>; 4], second_derivative: &[N<T>; 4]) -> [N<T>; 4] {
        let mut right_hand_side = *second_derivative;
        for i in 0..4 {
            right_hand_side[i] += self.deflection_factor * deflection[i];
        }
        self.system_inverse.times(&right_hand_side)
    }
}

/// Computes the accelerations du/dt at deviations `q` from equilibrium and speeds `u`.
#[inline(always)]
pub(crate) fn accelerations<T: Lane>(
    constants: &StepConstants<T>,
    coupling: &Coupling<T>,
    rotor_arrays: &RotorArrays<T>,
    q: &[N<T>; COORDINATES],
    u: &[N<T>; COORDINATES],
) -> [N<T>; COORDINATES] {
    let deflection = constants.deflection(q);
    match coupling {
        Coupling::Springs => {
            let load = constants.spring_load(&deflection);
            HalfAccelerations::new(constants, rotor_arrays, Some(load), q, u).to_coordinates()
        }
        Coupling::MassScaled(_) => {
            let bearing_arrays = &rotor_arrays.bearing_arrays;
            let mut halves = HalfAccelerations::new(constants, rotor_arrays, None, q, u);
            let second_derivative = constants.deflection(&halves.to_coordinates());
            let reaction = bearing_arrays.reaction(&deflection, &second_derivative);
            halves.add_bearing_reaction(constants, &bearing_arrays.rotor, &reaction);
            halves.to_coordinates()
        }
    }
}

/// Computes the derivative k of a state for the implicit part of the additive method, as
/// `nonlinear/implicit_stage.rs` does for the nonlinear model. The springs of bearings and hinge
/// are evaluated at r + g k with `g` in s, all other forces and the inertia at deviations `q` from
/// equilibrium and speeds `u`.
#[inline(always)]
pub(crate) fn solve_implicit_stage<T: Lane>(
    constants: &StepConstants<T>,
    rotor_coefficients: &RotorCoefficients<T>,
    flexure_stiffness: N<T>,
    spin: &SpinState<T>,
    (q, u): (&[N<T>; COORDINATES], &[N<T>; COORDINATES]),
    r: &[N<T>; STATES],
    g: N<T>,
) -> [N<T>; STATES] {
    // The coordinates of r + g k without the share of the accelerations a, which is g^2 a.
    let mut predicted_coordinates = *q;
    for i in 0..COORDINATES {
        predicted_coordinates[i] = r[i] + g * r[COORDINATES + i];
    }
    let g_squared = (g * g).v();
    let hinge_mass = HingeMass {
        inertia: (g_squared * flexure_stiffness).v(),
        torque: [
            (flexure_stiffness * (q[HINGE_YAW] - predicted_coordinates[HINGE_YAW])).v(),
            (flexure_stiffness * (q[HINGE_PITCH] - predicted_coordinates[HINGE_PITCH])).v(),
        ],
        torque_per_speed: g.lit(0.0),
    };
    let rotor_arrays =
        RotorArrays::new(constants, &Coupling::Springs, rotor_coefficients, spin, Some(hinge_mass));
    let mut halves = HalfAccelerations::new(constants, &rotor_arrays, None, q, u);
    let arms = rotor_terms::arms(&rotor_arrays.entries);
    let (accelerations_per_load, compliance) =
        RotorLoadResponse::new(constants, &rotor_arrays.inverse_inertia, &arms);
    let inverse_g_squared = g_squared.recip();
    let deflection = constants.deflection(&predicted_coordinates);
    let mut right_hand_side = constants.deflection(&halves.to_coordinates());
    for i in 0..4 {
        right_hand_side[i] += inverse_g_squared * deflection[i];
    }
    // The system is solved by elimination, because determinants overflow in idle lanes, whose g is
    // almost zero.
    let reaction = LdltFactors::new(bearing_system(constants, inverse_g_squared, &compliance))
        .solve(right_hand_side);
    halves.add_bearing_reaction(constants, &accelerations_per_load, &reaction);
    let a = halves.to_coordinates();
    let mut k = *r;
    for i in 0..COORDINATES {
        k[i] = r[COORDINATES + i] + g * a[i];
        k[COORDINATES + i] = a[i];
    }
    k
}

/// The accelerations of both halves: of the tub, of the rotor's midpoint and of its rotations.
struct HalfAccelerations<T> {
    tub: [N<T>; 4],
    midpoint: [N<T>; 2],
    rotation: [N<T>; 4],
}

impl<T: Lane> HalfAccelerations<T> {
    /// Computes the accelerations, under a load of the bearings on the shaft if one is given.
    #[inline(always)]
    fn new(
        constants: &StepConstants<T>,
        rotor_arrays: &RotorArrays<T>,
        load: Option<[N<T>; 4]>,
        q: &[N<T>; COORDINATES],
        u: &[N<T>; COORDINATES],
    ) -> Self {
        let mut tub = [q[0]; 4];
        for row in 0..4 {
            tub[row] =
                (constants.tub_acceleration_per_position[row][0] * q[TUB_COORDINATES[0]]).v();
            for column in 1..4 {
                tub[row] += constants.tub_acceleration_per_position[row][column]
                    * q[TUB_COORDINATES[column]];
            }
        }
        let entries = &rotor_arrays.entries;
        let arm = rotor_terms::arms(entries);
        let mut rotor = [q[0]; ROWS];
        for row in 0..ROWS {
            rotor[row] = entries[rotor_terms::force_entry(row)];
            for column in 0..4 {
                if rotor_terms::depends_on_rotation(row, column) {
                    rotor[row] -= entries[rotor_terms::stiffness_entry(row, column)]
                        * q[ROTOR_ROTATIONS[column]];
                }
            }
        }
        if let Some(load) = load {
            for row in 0..4 {
                for column in 0..4 {
                    tub[row] += constants.tub_acceleration_per_load[row][column] * load[column];
                }
            }
            let [force_y, force_z, moment_y, moment_z] = load;
            for r in 0..4 {
                if r > 0 {
                    rotor[2 + r] -= arm[r][0] * force_y;
                }
                rotor[2 + r] -= arm[r][1] * force_z;
            }
            let axis = &constants.rotor_axis;
            rotor[2] += axis[0][1] * moment_z;
            rotor[3] = rotor[3] + axis[1][0] * moment_y + axis[1][1] * moment_z;
            rotor[0] += force_y;
            rotor[1] += force_z;
        }
        for row in 0..4 {
            for column in 0..4 {
                tub[row] +=
                    constants.tub_acceleration_per_speed[row][column] * u[TUB_COORDINATES[column]];
            }
        }
        for row in 0..ROWS {
            for column in 0..4 {
                if rotor_terms::depends_on_rotation(row, column) {
                    rotor[row] -= entries[rotor_terms::damping_entry(row, column)]
                        * u[ROTOR_ROTATIONS[column]];
                }
            }
        }
        let rotation =
            rotor_arrays.inverse_inertia.times(&[rotor[2], rotor[3], rotor[4], rotor[5]]);
        let mut midpoint = [
            (rotor[0] * constants.rotor_inverse_mass).v(),
            (rotor[1] * constants.rotor_inverse_mass).v(),
        ];
        for r in 0..4 {
            if r > 0 {
                midpoint[0] -= arm[r][0] * rotation[r];
            }
            midpoint[1] -= arm[r][1] * rotation[r];
        }
        Self { tub, midpoint, rotation }
    }

    /// Adds the accelerations by a load of the bearings on the tub, and its opposite on the rotor.
    #[inline(always)]
    fn add_bearing_reaction(
        &mut self,
        constants: &StepConstants<T>,
        rotor: &RotorLoadResponse<T>,
        tub_load: &[N<T>; 4],
    ) {
        for column in 0..4 {
            for row in 0..4 {
                self.tub[row] -=
                    constants.tub_acceleration_per_load[row][column] * tub_load[column];
                self.rotation[row] -= rotor.rotation[row][column] * tub_load[column];
            }
            for i in 0..2 {
                self.midpoint[i] -= rotor.translation[i][column] * tub_load[column];
            }
        }
    }

    #[inline(always)]
    fn to_coordinates(&self) -> [N<T>; COORDINATES] {
        to_coordinate_order(&self.tub, &self.midpoint, &self.rotation)
    }
}

/// Arranges the accelerations of the tub, of the rotor's midpoint and of the rotor's rotations in
/// the order of the coordinates.
#[inline(always)]
fn to_coordinate_order<T: Copy>(
    tub: &[N<T>; 4],
    midpoint: &[N<T>; 2],
    rotation: &[N<T>; 4],
) -> [N<T>; COORDINATES] {
    let [a1, a2, a5, a6] = *tub;
    let [a3, a4] = *midpoint;
    let [a7, a8, a9, a10] = *rotation;
    [a1, a2, a3, a4, a5, a6, a7, a8, a9, a10]
}

//! The linear model: the exact linearisation about the static equilibrium (section 5 of the model
//! page, Eq. 41).
//!
//! Every coefficient is a trigonometric polynomial in theta. Automatic differentiation of the
//! nonlinear equations at five angles determines the coefficients, once per point. As in the
//! nonlinear model, the two halves are solved about their mass centres, and only the bearings
//! couple them.

pub(crate) mod harmonics;
pub(crate) mod outputs;
pub(crate) mod rotor_terms;
pub(crate) mod sparse;
pub(crate) mod step;
pub(crate) mod symmetric;

use crate::COORDINATES;
use crate::coordinates::{
    ROTOR_ROTATIONS, SHAFT_Y, SHAFT_Z, TUB_COORDINATES, TUB_ROTATIONS, TUB_Y, TUB_Z,
    with_derivative,
};
use crate::lanes::{InLanes as _, ToDual as _, lane_struct};
use crate::linear::harmonics::{FUNCTIONS, HARMONICS, SAMPLE_ANGLES};
use crate::linear::rotor_terms::{ENTRIES, INERTIA_ENTRIES, ROWS, RotorCoefficients};
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::{Bodies, MachineCoefficients};
use crate::nonlinear::forces::{AxisLoad, Deflection};
use crate::nonlinear::frame::Tilt;
use crate::nonlinear::{Half, assemble_rotor_in_lanes, assemble_tub};
use lane_ode::{Dual, Lane, N, OutOfLine, Real};

/// The number of entries of all arrays of the rotor. Those of the inertia come last.
const ALL_ENTRIES: usize = ENTRIES + INERTIA_ENTRIES;

lane_struct! {
    /// The coefficients that do not depend on the spin. Rows are forces (y, z) and torques about a
    /// half's mass centre, columns the coordinates of `TUB_COORDINATES`.
    #[derive(Clone, Copy, Debug)]
    LinearConstants {
        tub_inverse_mass: N<T>,
        /// The partial velocities of the tub's mass centre.
        tub_arm: [[N<T>; 2]; 2],
        tub_axis: [[N<T>; 2]; 2],
        tub_inertia: [[N<T>; 2]; 2],
        tub_stiffness: [[N<T>; 4]; 4],
        tub_damping: [[N<T>; 4]; 4],
        rotor_inverse_mass: N<T>,
        rotor_axis: [[N<T>; 2]; 2],
    }
}

/// The linear model of a machine.
#[derive(Clone, Debug)]
pub(crate) struct LinearCoefficients {
    pub(crate) constants: LinearConstants<f64>,
    pub(crate) rotor_coefficients: RotorCoefficients<f64>,
}

/// The linearisation of one machine per lane about the equilibrium `q`.
pub(crate) struct Linearisation<'a, T> {
    pub(crate) machine: &'a MachineCoefficients<T>,
    pub(crate) q: &'a [N<T>; COORDINATES],
}

impl<T: Lane> OutOfLine for Linearisation<'_, T> {
    type Output = Vec<LinearCoefficients>;

    #[inline(always)]
    fn run(self) -> Vec<LinearCoefficients> {
        let Self { machine, q } = self;
        let zero = q[0].lit(0.0);
        let zeros = [zero; COORDINATES];
        let bodies = &machine.bodies;
        let shaft_load = Deflection::new(q, &Tilt::tub(q), &Tilt::shaft(q)).load_on_shaft(bodies);
        let dual_machine = machine.constant();

        // The tub's equations do not depend on the spin.
        let tub_at_rest = assemble_tub(machine, q, &zeros);
        let [tub_stiffness, tub_damping] = tub_tangents(machine, q);

        let mut samples = [[[zero; HARMONICS]; ALL_ENTRIES]; 3];
        for (k, &(cos, sin)) in SAMPLE_ANGLES.iter().enumerate() {
            for (spin_case, (speed, acceleration)) in
                [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)].into_iter().enumerate()
            {
                let angle = (zero.lit(sin), zero.lit(cos));
                let spin = SpinState::new(angle, zero.lit(speed), zero.lit(acceleration));
                let Half { mut chain, inertia, .. } =
                    assemble_rotor_in_lanes(bodies, &spin, q, &zeros);
                chain.add_load(&shaft_load);
                let (force, torque) = chain.generalised_forces();
                let arm = chain.arm;
                let dual_spin = spin.constant();
                // The stiffness depends on speed and acceleration. The damping is proportional to
                // the speed, so that a unit speed determines it.
                let direction_count = if spin_case == 1 { 8 } else { 4 };
                for direction in 0..direction_count {
                    let column = direction % 4;
                    let entry_index = if direction < 4 {
                        rotor_terms::stiffness_entry
                    } else {
                        rotor_terms::damping_entry
                    };
                    let (dq, du) = if direction < 4 { (1.0, 0.0) } else { (0.0, 1.0) };
                    let q = with_derivative(q, ROTOR_ROTATIONS[column], dq);
                    let u = with_derivative(&zeros, ROTOR_ROTATIONS[column], du);
                    let Half { mut chain, .. } =
                        assemble_rotor_in_lanes(&dual_machine.bodies, &dual_spin, &q, &u);
                    chain.add_load(&shaft_load.constant());
                    let row_slopes: [_; ROWS] =
                        transform_to_mass_centre(chain.generalised_forces(), &arm);
                    for row in 0..ROWS {
                        samples[spin_case][entry_index(row, column)][k] = -row_slopes[row];
                    }
                }
                for i in 0..2 {
                    samples[spin_case][rotor_terms::force_entry(i)][k] = force[i];
                }
                for r in 0..4 {
                    samples[spin_case][rotor_terms::force_entry(2 + r)][k] =
                        torque[r] - arm[r][0] * force[0] - arm[r][1] * force[1];
                    for s in 0..=r {
                        samples[spin_case][ENTRIES + rotor_terms::inertia_entry(r, s)][k] =
                            inertia[r][s];
                    }
                    samples[spin_case][rotor_terms::arm_entry(r, 0)][k] = arm[r][0];
                    samples[spin_case][rotor_terms::arm_entry(r, 1)][k] = arm[r][1];
                }
            }
        }

        let constants = LinearConstants {
            tub_inverse_mass: bodies.tub_inverse_mass,
            tub_arm: tub_at_rest.chain.arm,
            tub_axis: tub_at_rest.chain.axis,
            tub_inertia: tub_at_rest.inertia,
            tub_stiffness,
            tub_damping,
            rotor_inverse_mass: bodies.rotor_inverse_mass,
            rotor_axis: Tilt::shaft(q).axis_partials(),
        };
        (0..T::LANES)
            .map(|lane| LinearCoefficients {
                constants: constants.get_lane(lane),
                rotor_coefficients: lane_rotor_coefficients(
                    &samples,
                    lane,
                    bodies.is_skewed_in(lane),
                ),
            })
            .collect()
    }
}

/// Computes stiffness and damping of the tub about the equilibrium `q`, as in [`LinearConstants`].
#[inline(always)]
pub(crate) fn tub_tangents<T: Lane>(
    machine: &MachineCoefficients<T>,
    q: &[N<T>; COORDINATES],
) -> [[[N<T>; 4]; 4]; 2] {
    let zero = q[0].lit(0.0);
    let zeros = [zero; COORDINATES];
    let shaft_load =
        Deflection::new(q, &Tilt::tub(q), &Tilt::shaft(q)).load_on_shaft(&machine.bodies);
    let tub_load = shaft_load.reaction().constant();
    let arm = assemble_tub(machine, q, &zeros).chain.arm;
    let dual_machine = machine.constant();
    let mut tangents = [[[zero; 4]; 4]; 2];
    for (column, &j) in TUB_COORDINATES.iter().enumerate() {
        for (tangent, (dq, du)) in tangents.iter_mut().zip([(1.0, 0.0), (0.0, 1.0)]) {
            let Half { mut chain, .. } = assemble_tub(
                &dual_machine,
                &with_derivative(q, j, dq),
                &with_derivative(&zeros, j, du),
            );
            chain.add_load(&tub_load);
            let rows: [_; 4] = transform_to_mass_centre(chain.generalised_forces(), &arm);
            for (row, slope) in rows.iter().enumerate() {
                tangent[row][column] = -*slope;
            }
        }
    }
    tangents
}

/// Transforms the slopes of generalised forces from the bearing midpoint to the mass centre, with
/// the equilibrium's arms: the inverse of `FloatingChain::generalised_forces`.
#[inline(always)]
fn transform_to_mass_centre<T: Real, const ROTATIONS: usize, const ROWS: usize>(
    (midpoint, rotation): ([N<Dual<T>>; 2], [N<Dual<T>>; ROTATIONS]),
    arm: &[[N<T>; 2]; ROTATIONS],
) -> [N<T>; ROWS] {
    let force = [N(midpoint[0].0.slope), N(midpoint[1].0.slope)];
    let mut rows = [force[0]; ROWS];
    rows[1] = force[1];
    for r in 0..ROTATIONS {
        rows[2 + r] = N(rotation[r].0.slope) - arm[r][0] * force[0] - arm[r][1] * force[1];
    }
    rows
}

/// Computes the coefficients of one lane from samples at rest, at unit speed and at unit
/// acceleration.
fn lane_rotor_coefficients<T: Lane>(
    samples: &[[[N<T>; HARMONICS]; ALL_ENTRIES]; 3],
    lane: usize,
    is_skewed: bool,
) -> RotorCoefficients<f64> {
    let entry_coefficients = |entry: usize| {
        let mut coefficients = [0.0; FUNCTIONS];
        let coefficients_at = |spin_case: usize| {
            harmonics::harmonic_coefficients(samples[spin_case][entry].map(|v| v.0.get(lane)))
        };
        let rest_coefficients = coefficients_at(0);
        let unit_speed_coefficients = coefficients_at(1);
        let unit_acceleration_coefficients = coefficients_at(2);
        coefficients[harmonics::CONSTANT..harmonics::SPEED].copy_from_slice(&rest_coefficients);
        if (rotor_terms::damping_entry(0, 0)..ENTRIES).contains(&entry) {
            coefficients[harmonics::SPEED..harmonics::SPIN]
                .copy_from_slice(&unit_speed_coefficients);
        } else {
            for harmonic in 0..HARMONICS {
                coefficients[harmonics::SPIN + harmonic] =
                    unit_speed_coefficients[harmonic] - rest_coefficients[harmonic];
            }
            coefficients[harmonics::ACCELERATION] =
                unit_acceleration_coefficients[0] - rest_coefficients[0];
        }
        coefficients
    };
    let inertia = core::array::from_fn(|entry| entry_coefficients(ENTRIES + entry));
    RotorCoefficients::select_coefficients(
        &inertia,
        &core::array::from_fn(entry_coefficients),
        is_skewed,
    )
}

/// The matrices M, C and K and the force F of Eq. 41 in the coordinates q, for one machine at one
/// instant.
#[derive(Clone, Debug)]
pub struct Matrices {
    /// The mass matrix.
    pub mass: [[f64; COORDINATES]; COORDINATES],
    /// The damping and gyroscopic matrix.
    pub damping: [[f64; COORDINATES]; COORDINATES],
    /// The stiffness matrix.
    pub stiffness: [[f64; COORDINATES]; COORDINATES],
    /// The force.
    pub force: [f64; COORDINATES],
}

impl LinearCoefficients {
    /// Returns the model with another stiffness and damping of the tub.
    pub(crate) fn with_tub_tangents(
        &self,
        [tub_stiffness, tub_damping]: [[[N<f64>; 4]; 4]; 2],
    ) -> Self {
        let mut model = self.clone();
        model.constants.tub_stiffness = tub_stiffness;
        model.constants.tub_damping = tub_damping;
        model
    }

    /// Computes the bearings' part of the stiffness matrix, without the part that comes from their
    /// static load.
    pub(crate) fn bearing_stiffness(
        &self,
        bodies: &Bodies<f64>,
    ) -> [[f64; COORDINATES]; COORDINATES] {
        let LinearConstants { tub_axis, rotor_axis, .. } = &self.constants;
        let unit_deflection = |i: usize| {
            let mut unit_coordinates = [N(0.0); COORDINATES];
            unit_coordinates[i] = N(1.0);
            Deflection::from_linear_model(&unit_coordinates, tub_axis, rotor_axis)
        };
        let generalised_force = |i: usize, load: &AxisLoad<f64>| {
            let Deflection { offset, tilt } = unit_deflection(i);
            let force = load.force[0] * offset[0] + load.force[1] * offset[1];
            -(force + (load.moment[0] * tilt[0] + load.moment[1] * tilt[1])).0
        };
        let mut stiffness = [[0.0; COORDINATES]; COORDINATES];
        for j in 0..COORDINATES {
            let load = unit_deflection(j).load_on_shaft(bodies);
            for (i, row) in stiffness.iter_mut().enumerate() {
                row[j] = generalised_force(i, &load);
            }
        }
        stiffness
    }

    /// Computes the matrices at an instant. `bodies` are those of the same machine.
    pub(crate) fn matrices(&self, bodies: &Bodies<f64>, spin: &SpinState<f64>) -> Matrices {
        let constants = &self.constants;
        let (inertia, entries) = self.rotor_coefficients.evaluate(&harmonics::spin_functions(spin));
        let tub = MassCentreMap {
            midpoint_coordinates: [TUB_Y, TUB_Z],
            rotation_coordinates: TUB_ROTATIONS,
            arm: constants.tub_arm,
        };
        let rotor = MassCentreMap {
            midpoint_coordinates: [SHAFT_Y, SHAFT_Z],
            rotation_coordinates: ROTOR_ROTATIONS,
            arm: rotor_terms::arms(&entries),
        };
        let mut matrices = Matrices {
            mass: [[0.0; COORDINATES]; COORDINATES],
            damping: [[0.0; COORDINATES]; COORDINATES],
            stiffness: self.bearing_stiffness(bodies),
            force: rotor.generalised_forces(|row| entries[rotor_terms::force_entry(row)]),
        };
        let mut add_column =
            |j: usize, stiffness: [f64; COORDINATES], damping: [f64; COORDINATES]| {
                for i in 0..COORDINATES {
                    matrices.stiffness[i][j] += stiffness[i];
                    matrices.damping[i][j] += damping[i];
                }
            };
        for column in 0..4 {
            let stiffness = tub.generalised_forces(|row| constants.tub_stiffness[row][column]);
            add_column(
                TUB_COORDINATES[column],
                stiffness,
                tub.generalised_forces(|row| constants.tub_damping[row][column]),
            );
            let stiffness =
                rotor.generalised_forces(|row| entries[rotor_terms::stiffness_entry(row, column)]);
            add_column(
                ROTOR_ROTATIONS[column],
                stiffness,
                rotor.generalised_forces(|row| entries[rotor_terms::damping_entry(row, column)]),
            );
        }
        tub.write_mass(&mut matrices.mass, constants.tub_inverse_mass, |r, s| {
            constants.tub_inertia[r][s]
        });
        rotor.write_mass(&mut matrices.mass, constants.rotor_inverse_mass, |r, s| {
            inertia[rotor_terms::inertia_entry(r, s)]
        });
        matrices
    }
}

/// The map between a half's mass centre and the coordinates.
struct MassCentreMap<const R: usize> {
    midpoint_coordinates: [usize; 2],
    rotation_coordinates: [usize; R],
    arm: [[N<f64>; 2]; R],
}

impl<const R: usize> MassCentreMap<R> {
    /// Computes the generalised forces from the half's force (y, z) and torques about its mass
    /// centre: the inverse of `transform_to_mass_centre`.
    fn generalised_forces(&self, rows: impl Fn(usize) -> N<f64>) -> [f64; COORDINATES] {
        let mut forces = [0.0; COORDINATES];
        let force = [rows(0), rows(1)];
        for i in 0..2 {
            forces[self.midpoint_coordinates[i]] = force[i].0;
        }
        for (r, [y, z]) in self.arm.into_iter().enumerate() {
            forces[self.rotation_coordinates[r]] = (rows(2 + r) + y * force[0] + z * force[1]).0;
        }
        forces
    }

    /// Writes the half's block of the mass matrix: J^T M J with the Jacobian J of the map.
    fn write_mass(
        &self,
        mass: &mut [[f64; COORDINATES]; COORDINATES],
        inverse_mass: N<f64>,
        inertia: impl Fn(usize, usize) -> N<f64>,
    ) {
        let mass_kg = 1.0 / inverse_mass.0;
        let arm = &self.arm;
        let rotations = &self.rotation_coordinates;
        for (i, midpoint) in self.midpoint_coordinates.into_iter().enumerate() {
            mass[midpoint][midpoint] = mass_kg;
            for r in 0..R {
                mass[midpoint][rotations[r]] = mass_kg * arm[r][i].0;
                mass[rotations[r]][midpoint] = mass_kg * arm[r][i].0;
            }
        }
        for r in 0..R {
            for s in 0..=r {
                let arm_product = arm[r][0].0 * arm[s][0].0 + arm[r][1].0 * arm[s][1].0;
                let mass_entry = inertia(r, s).0 + mass_kg * arm_product;
                mass[rotations[r]][rotations[s]] = mass_entry;
                mass[rotations[s]][rotations[r]] = mass_entry;
            }
        }
    }
}

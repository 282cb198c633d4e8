//! The sparsity pattern of the rotor's linear equations: the nonzero harmonics of each entry.
//!
//! Rows are y and z of the midpoint, then the rotations about the mass centre. Columns are q7 to
//! q10, because the rotor's forces depend on q3 and q4 through the bearings only. The pattern is
//! that of machines whose unbalances lie in the plane of d1 and d2, which is upright at rest. Other
//! machines have all harmonics, and further terms for those that the pattern lacks.

use crate::lanes::lane_struct;
use crate::linear::harmonics::{
    ACCELERATION, CONSTANT, COS, COS_2, FUNCTIONS, SIN, SIN_2, SPEED, SPEED_COS, SPEED_COS_2,
    SPEED_SIN, SPEED_SIN_2, SPIN, SPIN_COS, SPIN_COS_2, SPIN_SIN, SPIN_SIN_2,
};
use crate::linear::sparse::{FurtherTerms, sparse_sums};
use lane_ode::{Lane, N};

/// The number of the rotor's rows.
pub(crate) const ROWS: usize = 6;
/// The number of the rotor's rotations.
pub(crate) const ROTATIONS: usize = 4;

/// The first entry of the partial velocities.
const FIRST_ARM: usize = 0;
/// The first entry of the force.
const FIRST_FORCE: usize = FIRST_ARM + 2 * ROTATIONS;
/// The first entry of the stiffness.
const FIRST_STIFFNESS: usize = FIRST_FORCE + ROWS;
/// The first entry of the damping.
const FIRST_DAMPING: usize = FIRST_STIFFNESS + ROWS * ROTATIONS;

/// The number of entries of all arrays of the rotor except the inertia.
pub(crate) const ENTRIES: usize = FIRST_DAMPING + ROWS * ROTATIONS;
/// The number of entries of the inertia's lower triangle.
pub(crate) const INERTIA_ENTRIES: usize = ROTATIONS * (ROTATIONS + 1) / 2;

/// Returns the entry of the inertia about the mass centre, for `row` not less than `column`.
pub(crate) const fn inertia_entry(row: usize, column: usize) -> usize {
    row * (row + 1) / 2 + column
}

/// Returns the entry of the mass centre's partial velocity by a rotation, along y (0) or z (1).
pub(crate) const fn arm_entry(rotation: usize, direction: usize) -> usize {
    FIRST_ARM + 2 * rotation + direction
}

/// Returns the entry of the force.
pub(crate) const fn force_entry(row: usize) -> usize {
    FIRST_FORCE + row
}

/// Whether a force depends on a rotation and its speed. Only the force along y does not depend on
/// the yaw.
pub(crate) const fn depends_on_rotation(row: usize, column: usize) -> bool {
    row > 0 || column > 0
}

/// Returns the entry of the stiffness matrix.
pub(crate) const fn stiffness_entry(row: usize, column: usize) -> usize {
    FIRST_STIFFNESS + row * ROTATIONS + column
}

/// Returns the entry of the damping and gyroscopic matrix.
pub(crate) const fn damping_entry(row: usize, column: usize) -> usize {
    FIRST_DAMPING + row * ROTATIONS + column
}

lane_struct! {
    /// The coefficients of all terms of the rotor, for one machine in `f64`, for one machine per
    /// lane in `T`.
    #[derive(Clone, Debug)]
    RotorCoefficients {
        inertia_terms: InertiaTerms<T>,
        load_terms: RotorTerms<T>,
        further_inertia_terms: FurtherTerms<T>,
        further_load_terms: FurtherTerms<T>,
    }
}

impl<T: Lane> RotorCoefficients<T> {
    /// Computes the inertia's entries from the functions of the spin at an instant.
    #[inline(always)]
    pub(crate) fn sum_inertia(
        &self,
        functions: &[N<T>; FUNCTIONS],
        sums: &mut [N<T>; INERTIA_ENTRIES],
    ) {
        self.inertia_terms.sum(functions, sums);
        self.further_inertia_terms.add(functions, sums);
    }

    /// Computes the entries of arms, force, stiffness and damping from the functions of the spin at
    /// an instant.
    #[inline(always)]
    pub(crate) fn sum_loads(&self, functions: &[N<T>; FUNCTIONS], sums: &mut [N<T>; ENTRIES]) {
        self.load_terms.sum(functions, sums);
        self.further_load_terms.add(functions, sums);
    }
}

impl RotorCoefficients<f64> {
    /// Selects the terms of a machine from all coefficients. Only a skewed drum has further terms.
    pub(crate) fn select_coefficients(
        inertia: &[[f64; FUNCTIONS]; INERTIA_ENTRIES],
        loads: &[[f64; FUNCTIONS]; ENTRIES],
        is_skewed: bool,
    ) -> Self {
        let mut terms = Self {
            inertia_terms: InertiaTerms::select_coefficients(inertia),
            load_terms: RotorTerms::select_coefficients(loads),
            further_inertia_terms: FurtherTerms::NONE,
            further_load_terms: FurtherTerms::NONE,
        };
        if is_skewed {
            terms.further_inertia_terms =
                FurtherTerms::select_coefficients(inertia, &InertiaTerms::POSITIONS);
            terms.further_load_terms =
                FurtherTerms::select_coefficients(loads, &RotorTerms::POSITIONS);
        }
        terms
    }

    /// Evaluates the inertia's entries and all other entries from the functions of the spin at an
    /// instant.
    pub(crate) fn evaluate(
        &self,
        functions: &[N<f64>; FUNCTIONS],
    ) -> ([N<f64>; INERTIA_ENTRIES], [N<f64>; ENTRIES]) {
        let mut inertia = [N(0.0); INERTIA_ENTRIES];
        let mut loads = [N(0.0); ENTRIES];
        self.sum_inertia(functions, &mut inertia);
        self.sum_loads(functions, &mut loads);
        (inertia, loads)
    }
}

/// Returns the partial velocities of the mass centre.
#[inline(always)]
pub(crate) fn arms<T: Copy>(entries: &[N<T>; ENTRIES]) -> [[N<T>; 2]; ROTATIONS] {
    let mut arms = [[entries[0]; 2]; ROTATIONS];
    for r in 0..ROTATIONS {
        arms[r] = [entries[arm_entry(r, 0)], entries[arm_entry(r, 1)]];
    }
    arms
}

sparse_sums! {
    /// The coefficients of the inertia's terms.
    InertiaTerms: FUNCTIONS => INERTIA_ENTRIES;
    inertia_entry(0, 0) => CONSTANT COS SIN COS_2 SIN_2;
    inertia_entry(1, 0) => CONSTANT COS SIN COS_2 SIN_2;
    inertia_entry(1, 1) => CONSTANT COS COS_2;
    inertia_entry(2, 0) => CONSTANT COS SIN COS_2 SIN_2;
    inertia_entry(2, 1) => CONSTANT COS SIN COS_2 SIN_2;
    inertia_entry(2, 2) => CONSTANT COS_2 SIN_2;
    inertia_entry(3, 0) => CONSTANT COS SIN COS_2 SIN_2;
    inertia_entry(3, 1) => CONSTANT COS SIN COS_2 SIN_2;
    inertia_entry(3, 2) => COS SIN COS_2 SIN_2;
    inertia_entry(3, 3) => CONSTANT COS SIN COS_2 SIN_2;
}

sparse_sums! {
    /// The coefficients of the terms of arms, force, stiffness and damping.
    RotorTerms: FUNCTIONS => ENTRIES;
    arm_entry(0, 1) => CONSTANT COS SIN;
    arm_entry(1, 0) => CONSTANT COS;
    arm_entry(1, 1) => CONSTANT COS;
    arm_entry(2, 0) => SIN;
    arm_entry(2, 1) => COS SIN;
    arm_entry(3, 0) => CONSTANT COS;
    arm_entry(3, 1) => CONSTANT COS SIN;
    force_entry(0) => SPIN_COS;
    force_entry(1) => SPIN_COS SPIN_SIN;
    force_entry(2) => SPIN SPIN_COS SPIN_SIN SPIN_COS_2 SPIN_SIN_2 ACCELERATION;
    force_entry(3) => CONSTANT COS SPIN SPIN_COS SPIN_SIN SPIN_COS_2 SPIN_SIN_2 ACCELERATION;
    force_entry(4) => SIN SPIN_COS_2 SPIN_SIN_2 ACCELERATION;
    force_entry(5) => CONSTANT COS SPIN SPIN_COS SPIN_SIN SPIN_COS_2 SPIN_SIN_2;
    stiffness_entry(0, 1) => SPIN_COS;
    stiffness_entry(0, 2) => SPIN_SIN;
    stiffness_entry(0, 3) => SPIN_COS;
    stiffness_entry(1, 0) => SPIN_COS SPIN_SIN;
    stiffness_entry(1, 1) => SPIN_COS;
    stiffness_entry(1, 2) => SPIN_COS SPIN_SIN;
    stiffness_entry(1, 3) => SPIN_COS SPIN_SIN;
    stiffness_entry(2, 0) => SPIN SPIN_COS SPIN_SIN SPIN_COS_2 SPIN_SIN_2;
    stiffness_entry(2, 1) => SPIN SPIN_COS SPIN_SIN SPIN_COS_2 SPIN_SIN_2 ACCELERATION;
    stiffness_entry(2, 2) => SPIN SPIN_COS SPIN_SIN SPIN_COS_2 SPIN_SIN_2 ACCELERATION;
    stiffness_entry(2, 3) => SPIN SPIN_COS SPIN_SIN SPIN_COS_2 SPIN_SIN_2 ACCELERATION;
    stiffness_entry(3, 0) => SPIN SPIN_COS SPIN_SIN SPIN_COS_2 SPIN_SIN_2 ACCELERATION;
    stiffness_entry(3, 1) => CONSTANT COS SPIN SPIN_COS SPIN_COS_2;
    stiffness_entry(3, 2) => SIN SPIN SPIN_COS SPIN_SIN SPIN_COS_2 SPIN_SIN_2 ACCELERATION;
    stiffness_entry(3, 3) => CONSTANT COS SPIN SPIN_COS SPIN_SIN SPIN_COS_2 SPIN_SIN_2 ACCELERATION;
    stiffness_entry(4, 0) => SPIN SPIN_COS_2 SPIN_SIN_2 ACCELERATION;
    stiffness_entry(4, 1) => SIN SPIN SPIN_COS_2 SPIN_SIN_2 ACCELERATION;
    stiffness_entry(4, 2) => CONSTANT SPIN SPIN_COS_2 SPIN_SIN_2;
    stiffness_entry(4, 3) => SIN SPIN_COS_2 SPIN_SIN_2 ACCELERATION;
    stiffness_entry(5, 0) => SPIN SPIN_COS SPIN_SIN SPIN_COS_2 SPIN_SIN_2 ACCELERATION;
    stiffness_entry(5, 1) => CONSTANT COS SPIN SPIN_COS SPIN_COS_2 SPIN_SIN_2 ACCELERATION;
    stiffness_entry(5, 2) => SIN SPIN_COS SPIN_SIN SPIN_COS_2 SPIN_SIN_2 ACCELERATION;
    stiffness_entry(5, 3) => CONSTANT COS SPIN SPIN_COS SPIN_SIN SPIN_COS_2 SPIN_SIN_2;
    damping_entry(0, 1) => SPEED_SIN;
    damping_entry(0, 2) => SPEED_COS;
    damping_entry(0, 3) => SPEED_SIN;
    damping_entry(1, 0) => SPEED_COS SPEED_SIN;
    damping_entry(1, 1) => SPEED_SIN;
    damping_entry(1, 2) => SPEED_COS SPEED_SIN;
    damping_entry(1, 3) => SPEED_COS SPEED_SIN;
    damping_entry(2, 0) => SPEED_COS SPEED_SIN SPEED_COS_2 SPEED_SIN_2;
    damping_entry(2, 1) => SPEED SPEED_SIN SPEED_COS_2 SPEED_SIN_2;
    damping_entry(2, 2) => SPEED SPEED_COS SPEED_SIN SPEED_COS_2 SPEED_SIN_2;
    damping_entry(2, 3) => SPEED SPEED_COS SPEED_SIN SPEED_COS_2 SPEED_SIN_2;
    damping_entry(3, 0) => SPEED SPEED_COS SPEED_SIN SPEED_COS_2 SPEED_SIN_2;
    damping_entry(3, 1) => SPEED_SIN SPEED_SIN_2;
    damping_entry(3, 2) => SPEED SPEED_COS SPEED_SIN SPEED_COS_2 SPEED_SIN_2;
    damping_entry(3, 3) => SPEED SPEED_COS SPEED_SIN SPEED_COS_2 SPEED_SIN_2;
    damping_entry(4, 0) => SPEED SPEED_SIN SPEED_COS_2 SPEED_SIN_2;
    damping_entry(4, 1) => SPEED SPEED_COS SPEED_COS_2 SPEED_SIN_2;
    damping_entry(4, 2) => SPEED_COS_2 SPEED_SIN_2;
    damping_entry(4, 3) => SPEED SPEED_COS_2 SPEED_SIN_2;
    damping_entry(5, 0) => SPEED SPEED_COS SPEED_SIN SPEED_COS_2 SPEED_SIN_2;
    damping_entry(5, 1) => SPEED SPEED_SIN SPEED_COS_2 SPEED_SIN_2;
    damping_entry(5, 2) => SPEED SPEED_COS SPEED_SIN SPEED_COS_2 SPEED_SIN_2;
    damping_entry(5, 3) => SPEED_COS SPEED_SIN SPEED_COS_2 SPEED_SIN_2;
}

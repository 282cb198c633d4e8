//! The equations of motion of a chain of bodies that floats in the c2-c3 plane of the cabinet (here
//! y and z). Both halves of the machine are such chains: the tub (q1, q2; q5, q6) and the rotor
//! (q3, q4; q7 to q10).
//!
//! About the chain's mass centre the two translations decouple from the rotations (section 4.1 of
//! the model page). Their inertia matrix J is 2x2 for the tub and 4x4 for the rotor.

use crate::nonlinear::forces::AxisLoad;
use lane_ode::{Lane, N, Real};

/// The accelerations of a half's midpoint (y, z) and axis (y, z).
pub(crate) struct AxisResponse<T> {
    /// The accelerations without forces on the axis.
    pub(crate) unloaded_accelerations: [N<T>; 4],
    /// The accelerations per unit of force (y, z) and moment (y, z) on the axis: the lower triangle
    /// of a symmetric matrix.
    pub(crate) compliance: [[N<T>; 4]; 4],
}

/// The equations of motion of one half of the machine, with `R` rotations. The first rotation is
/// the axis's yaw about c2, whose partial velocities have no y component; the second is the axis's
/// pitch.
#[derive(Clone, Copy)]
pub(crate) struct FloatingChain<T, const R: usize> {
    /// The reciprocal of the chain's mass.
    pub(crate) inverse_mass: N<T>,
    /// The force on the chain along y and z.
    pub(crate) force: [N<T>; 2],
    /// The acceleration of the mass centre relative to the bearing midpoint at constant speeds, y
    /// and z.
    pub(crate) drift: [N<T>; 2],
    /// The partial velocities of the mass centre relative to the bearing midpoint, y and z.
    pub(crate) arm: [[N<T>; 2]; R],
    /// The partial derivatives of the axis (a1) by yaw and pitch, y and z.
    pub(crate) axis: [[N<T>; 2]; 2],
    /// The acceleration of the axis (a1) at constant speeds, y and z.
    pub(crate) axis_drift: [N<T>; 2],
    /// The generalised forces less the inertia forces at constant speeds, about the mass centre.
    pub(crate) torque: [N<T>; R],
}

impl<T: Real, const R: usize> FloatingChain<T, R> {
    /// Adds a load on the axis.
    #[inline(always)]
    pub(crate) fn add_load(&mut self, load: &AxisLoad<T>) {
        (self.force, self.torque) = self.loaded_force_and_torque(load);
    }

    /// Adds a unit of generalised force on a coordinate, in the order y, z, rotations.
    #[inline(always)]
    pub(crate) fn add_unit_force(&mut self, coordinate: usize) {
        if coordinate < 2 {
            self.force[coordinate] = self.force[coordinate] + 1.0;
            for r in 0..R {
                self.torque[r] -= self.arm[r][coordinate];
            }
        } else {
            self.torque[coordinate - 2] = self.torque[coordinate - 2] + 1.0;
        }
    }

    /// Returns the sums of the chain's force and torques and those of a load on the axis.
    #[inline(always)]
    fn loaded_force_and_torque(&self, load: &AxisLoad<T>) -> ([N<T>; 2], [N<T>; R]) {
        let [moment_y, moment_z] = load.moment;
        let mut torque = self.torque;
        torque[0] += self.axis[0][1] * moment_z;
        torque[1] = torque[1] + self.axis[1][0] * moment_y + self.axis[1][1] * moment_z;
        for r in 0..R {
            if r > 0 {
                torque[r] -= self.arm[r][0] * load.force[0];
            }
            torque[r] -= self.arm[r][1] * load.force[1];
        }
        ([self.force[0] + load.force[0], self.force[1] + load.force[1]], torque)
    }

    /// Computes the accelerations of midpoint and axis and the compliance C = 1/m + G^T J^-1 G.
    /// `inertia_factors` holds the factors of J.
    #[inline(always)]
    pub(crate) fn axis_response(&self, inertia_factors: &LdltFactors<T, R>) -> AxisResponse<T> {
        let zero = self.inverse_mass.lit(0.0);
        // The rows of G: the torques that `add_load` adds per unit of force and moment, which by
        // virtual work are also the motions of the axis per unit of rotation.
        let mut torques_per_load = [[zero; 4]; R];
        for r in 0..R {
            torques_per_load[r][0] = -self.arm[r][0];
            torques_per_load[r][1] = -self.arm[r][1];
        }
        for r in 0..2 {
            torques_per_load[r][2] = self.axis[r][0];
            torques_per_load[r][3] = self.axis[r][1];
        }
        let mut torque = self.torque;
        // With J = L D L^T, C = 1/m + (L^-1 G)^T D^-1 (L^-1 G): one triangular solve serves both
        // sides.
        for j in 0..R {
            for i in j + 1..R {
                let l_entry = inertia_factors.lower_entry(i, j);
                torque[i] -= l_entry * torque[j];
                for k in 0..4 {
                    torques_per_load[i][k] -= l_entry * torques_per_load[j][k];
                }
            }
        }
        let mut unloaded_accelerations = [
            self.force[0] * self.inverse_mass - self.drift[0],
            self.force[1] * self.inverse_mass - self.drift[1],
            self.axis_drift[0],
            self.axis_drift[1],
        ];
        let mut compliance = [[zero; 4]; 4];
        compliance[0][0] = self.inverse_mass;
        compliance[1][1] = self.inverse_mass;
        for r in 0..R {
            for i in 0..4 {
                let weighted_torque =
                    (torques_per_load[r][i] * inertia_factors.reciprocal_pivot(r)).v();
                unloaded_accelerations[i] += weighted_torque * torque[r];
                for j in 0..=i {
                    compliance[i][j] += weighted_torque * torques_per_load[r][j];
                }
            }
        }
        AxisResponse { unloaded_accelerations, compliance }
    }

    /// Computes the accelerations under a load on the axis: those of the bearing midpoint along y
    /// and z, then those of the rotations. `inertia_factors` holds the factors of J.
    #[inline(always)]
    pub(crate) fn accelerations(
        &self,
        inertia_factors: &LdltFactors<T, R>,
        load: &AxisLoad<T>,
    ) -> ([N<T>; 2], [N<T>; R]) {
        let (force, torque) = self.loaded_force_and_torque(load);
        let rotational_accelerations = inertia_factors.solve(torque);
        let mut translational_accelerations = [
            force[0] * self.inverse_mass - self.drift[0],
            force[1] * self.inverse_mass - self.drift[1],
        ];
        for r in 0..R {
            if r > 0 {
                translational_accelerations[0] -= self.arm[r][0] * rotational_accelerations[r];
            }
            translational_accelerations[1] -= self.arm[r][1] * rotational_accelerations[r];
        }
        (translational_accelerations, rotational_accelerations)
    }

    /// Computes the generalised forces f in M q'' = f: for the bearing midpoint along y and z, then
    /// for the rotations.
    #[inline(always)]
    pub(crate) fn generalised_forces(&self) -> ([N<T>; 2], [N<T>; R]) {
        let midpoint_force = [
            self.force[0] - self.drift[0] / self.inverse_mass,
            self.force[1] - self.drift[1] / self.inverse_mass,
        ];
        let mut rotation_torques = self.torque;
        for r in 0..R {
            rotation_torques[r] = rotation_torques[r]
                + self.arm[r][0] * midpoint_force[0]
                + self.arm[r][1] * midpoint_force[1];
        }
        (midpoint_force, rotation_torques)
    }
}

/// The L D L^T factors of a symmetric positive definite matrix.
#[derive(Clone, Copy)]
pub(crate) struct LdltFactors<T, const R: usize> {
    /// L below the diagonal, without its unit diagonal, and 1/D on the diagonal.
    packed_factors: [[N<T>; R]; R],
}

impl<T: Real, const R: usize> LdltFactors<T, R> {
    /// Factors the lower triangle of `a`.
    #[inline(always)]
    pub(crate) fn new(mut a: [[N<T>; R]; R]) -> Self {
        for j in 0..R {
            let pivot = a[j][j].recip();
            for i in j + 1..R {
                let l = (a[i][j] * pivot).v();
                for k in j + 1..=i {
                    // Entries of column j before the division by the pivot: row i still has its
                    // own, and the upper triangle has those of the rows between j and i.
                    let undivided_entry = if k == i { a[i][j] } else { a[j][k] };
                    a[i][k] -= l * undivided_entry;
                }
                // The strict upper triangle keeps the column before its division by the pivot, for
                // the following rows.
                a[j][i] = a[i][j];
                a[i][j] = l;
            }
            a[j][j] = pivot;
        }
        Self { packed_factors: a }
    }

    /// Returns entry (row, column) of L, below the diagonal.
    #[inline(always)]
    fn lower_entry(&self, row: usize, column: usize) -> N<T> {
        self.packed_factors[row][column]
    }

    /// Returns an entry of 1/D.
    #[inline(always)]
    fn reciprocal_pivot(&self, row: usize) -> N<T> {
        self.packed_factors[row][row]
    }

    /// Returns a mask of the lanes whose matrix is positive definite.
    #[inline(always)]
    pub(crate) fn positive_definite_lanes(&self) -> u32
    where
        T: Lane,
    {
        let zero = self.packed_factors[0][0].lit(0.0);
        (0..R).fold(u32::MAX, |bits, j| bits & T::bits(zero.0.less(self.packed_factors[j][j].0)))
    }

    /// Solves for one right-hand side.
    #[inline(always)]
    pub(crate) fn solve(&self, mut b: [N<T>; R]) -> [N<T>; R] {
        for j in 0..R {
            for i in j + 1..R {
                b[i] -= self.packed_factors[i][j] * b[j];
            }
        }
        for j in (0..R).rev() {
            b[j] = (b[j] * self.packed_factors[j][j]).v();
            for i in j + 1..R {
                b[j] -= self.packed_factors[i][j] * b[i];
            }
        }
        b
    }
}

//! A body chain that floats in the cabinet's y-z plane: the form both halves of the machine take.
//!
//! Tub (q1, q2; q5, q6) and rotor (shaft and drum: q3, q4; q7 to q10) meet only through the bearing forces, so the mass matrix
//! has a 4x4 and a 6x6 block. In each, two coordinates move the whole chain along y and z. Written for
//! the chain's mass centre instead of its bearing midpoint, those two decouple from the rotations:
//!
//! ```text
//! m a_G = F            J v' = torque            q''_yz = a_G - drift - sum_r arm_r v'_r
//! ```
//!
//! with arm_r the partial velocity of the mass centre relative to the bearing midpoint, and drift that point's acceleration at
//! constant speeds. This is the Schur complement of the block in closed form: J is 2x2 or 4x4.

use lane_ode::{N, Real};

/// Equations of motion of one half of the machine, with `R` rotations. The first rotation is about c2, so that its
/// arm has no y component.
pub(crate) struct Floating<T, const R: usize> {
    /// Mass of the chain.
    pub(crate) mass_kg: N<T>,
    /// Force on the chain along y and z.
    pub(crate) force: [N<T>; 2],
    /// Acceleration of the mass centre relative to the bearing midpoint at constant speeds, y and z.
    pub(crate) drift: [N<T>; 2],
    /// Partial velocities of the mass centre relative to the bearing midpoint, y and z.
    pub(crate) arm: [[N<T>; 2]; R],
    /// Inertia about the mass centre; only the lower triangle is read.
    pub(crate) inertia: [[N<T>; R]; R],
    /// Generalised forces less inertia forces at constant speeds, about the mass centre.
    pub(crate) torque: [N<T>; R],
}

impl<T: Real, const R: usize> Floating<T, R> {
    /// Accelerations: y and z of the bearing midpoint, then the rotations.
    #[inline(always)]
    pub(crate) fn accelerations(self) -> ([N<T>; 2], [N<T>; R]) {
        let rotation = solve_symmetric(self.inertia, self.torque);
        let per_mass = self.mass_kg.recip();
        let mut translation: [N<T>; 2] = core::array::from_fn(|i| self.force[i] * per_mass - self.drift[i]);
        for r in 0..R {
            if r > 0 {
                translation[0] -= self.arm[r][0] * rotation[r];
            }
            translation[1] -= self.arm[r][1] * rotation[r];
        }
        (translation, rotation)
    }
}

impl<T: Real, const R: usize> Floating<T, R> {
    /// Forces that the coordinates (y and z of the bearing midpoint, then the rotations) see: `f` in M q'' = f.
    pub(crate) fn generalised_forces(&self) -> ([N<T>; 2], [N<T>; R]) {
        let midpoint: [N<T>; 2] = core::array::from_fn(|i| self.force[i] - self.mass_kg * self.drift[i]);
        let rotation = core::array::from_fn(|r| {
            self.torque[r] + self.arm[r][0] * midpoint[0] + self.arm[r][1] * midpoint[1]
        });
        (midpoint, rotation)
    }
}

/// Solves `a x = b` for a symmetric positive definite `a` (lower triangle) by its L D L^T factors.
#[inline(always)]
pub(crate) fn solve_symmetric<T: Real, const R: usize>(a: [[N<T>; R]; R], b: [N<T>; R]) -> [N<T>; R] {
    Factors::new(a).solve(b)
}

/// L D L^T factors of a symmetric positive definite matrix.
#[derive(Clone, Copy)]
pub(crate) struct Factors<T, const R: usize> {
    /// L below the diagonal (unit diagonal not stored), 1/D on it.
    packed: [[N<T>; R]; R],
}

impl<T: Real, const R: usize> Factors<T, R> {
    /// Factors the lower triangle of `a`.
    #[inline(always)]
    pub(crate) fn new(mut a: [[N<T>; R]; R]) -> Self {
        for j in 0..R {
            let pivot = a[j][j].recip();
            for i in j + 1..R {
                let l = (a[i][j] * pivot).v();
                for k in j + 1..=i {
                    // a[k][j] still holds the unscaled column for k = i, and l * d for those above it.
                    let unscaled = if k == i { a[i][j] } else { a[j][k] };
                    a[i][k] -= l * unscaled;
                }
                // The strict upper triangle keeps the unscaled column for the rows below.
                a[j][i] = a[i][j];
                a[i][j] = l;
            }
            a[j][j] = pivot;
        }
        Self { packed: a }
    }

    /// Solves for one right-hand side.
    #[inline(always)]
    pub(crate) fn solve(&self, mut b: [N<T>; R]) -> [N<T>; R] {
        for j in 0..R {
            for i in j + 1..R {
                b[i] -= self.packed[i][j] * b[j];
            }
        }
        for j in (0..R).rev() {
            b[j] = (b[j] * self.packed[j][j]).v();
            for i in j + 1..R {
                b[j] -= self.packed[i][j] * b[i];
            }
        }
        b
    }
}

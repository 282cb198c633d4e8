//! Inversion of small symmetric matrices.

use lane_ode::{N, Real};

/// A symmetric 4x4 matrix, stored by the lower triangle.
#[derive(Clone, Copy)]
pub(crate) struct Symmetric4<T>(pub(crate) [[N<T>; 4]; 4]);

impl<T: Real> Symmetric4<T> {
    /// Returns entry (row, column) of either triangle.
    #[inline(always)]
    pub(crate) fn entry(&self, row: usize, column: usize) -> N<T> {
        if row < column { self.0[column][row] } else { self.0[row][column] }
    }

    /// Returns the product with a vector.
    #[inline(always)]
    pub(crate) fn times(&self, v: &[N<T>; 4]) -> [N<T>; 4] {
        let mut product = *v;
        for row in 0..4 {
            product[row] = (self.entry(row, 0) * v[0]).v();
            for column in 1..4 {
                product[row] += self.entry(row, column) * v[column];
            }
        }
        product
    }

    /// Returns the inverse of a positive definite matrix by 2x2 blocks, with M = [A, B^T; B, D] and
    /// the Schur complement S = D - B A^-1 B^T. Two divisions make a shorter chain of dependent
    /// operations than four pivots.
    #[inline(always)]
    pub(crate) fn inverse(&self) -> Self {
        let m = &self.0;
        let zero = m[0][0].lit(0.0);
        let mut inverse = [[zero; 4]; 4];
        let a_inverse = invert_2x2([m[0][0], m[1][0], m[1][1]]);
        // W = B A^-1
        let mut w = [[zero; 2]; 2];
        for i in 0..2 {
            for j in 0..2 {
                w[i][j] = m[2 + i][0] * a_inverse[j] + m[2 + i][1] * a_inverse[1 + j];
            }
        }
        let mut s = [m[2][2], m[3][2], m[3][3]];
        for j in 0..2 {
            s[0] -= w[0][j] * m[2][j];
            s[1] -= w[1][j] * m[2][j];
            s[2] -= w[1][j] * m[3][j];
        }
        let s_inverse = invert_2x2(s);
        // Z = S^-1 W
        let mut z = [[zero; 2]; 2];
        for i in 0..2 {
            for j in 0..2 {
                z[i][j] = s_inverse[i] * w[0][j] + s_inverse[1 + i] * w[1][j];
                inverse[2 + i][j] = -z[i][j];
            }
        }
        inverse[0][0] = a_inverse[0] + w[0][0] * z[0][0] + w[1][0] * z[1][0];
        inverse[1][0] = a_inverse[1] + w[0][1] * z[0][0] + w[1][1] * z[1][0];
        inverse[1][1] = a_inverse[2] + w[0][1] * z[0][1] + w[1][1] * z[1][1];
        inverse[2][2] = s_inverse[0];
        inverse[3][2] = s_inverse[1];
        inverse[3][3] = s_inverse[2];
        Self(inverse)
    }
}

/// Inverts a symmetric 2x2 matrix; matrix and inverse have the entries (0, 0), (1, 0) and (1, 1).
#[inline(always)]
fn invert_2x2<T: Real>([a, b, d]: [N<T>; 3]) -> [N<T>; 3] {
    let inverse_determinant = (a * d - (b * b).v()).recip();
    [(d * inverse_determinant).v(), -(b * inverse_determinant).v(), (a * inverse_determinant).v()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_times_the_matrix_is_the_identity() {
        let mut rng = fastrand::Rng::with_seed(7);
        for _ in 0..100 {
            // The matrix G G^T + 0.1 is positive definite and far from singular.
            let g: [[f64; 4]; 4] =
                core::array::from_fn(|_| core::array::from_fn(|_| rng.f64() - 0.5));
            let matrix = Symmetric4(core::array::from_fn(|i| {
                core::array::from_fn(|j| {
                    let dot_product: f64 = (0..4).map(|k| g[i][k] * g[j][k]).sum();
                    N(if i == j { 0.1 + dot_product } else { dot_product })
                })
            }));
            let inverse = matrix.inverse();
            for j in 0..4 {
                let column = core::array::from_fn(|i| inverse.entry(i, j));
                for (i, entry) in matrix.times(&column).into_iter().enumerate() {
                    let expected = if i == j { 1.0 } else { 0.0 };
                    assert!((entry.0 - expected).abs() < 1e-12, "({i}, {j}): {}", entry.0);
                }
            }
        }
    }
}

//! Solves linear equations of a fixed size by Gauss's elimination, on the stack.

use crate::N;

/// The triangular factors of a square matrix with row pivoting.
#[derive(Clone)]
pub struct Lu<const C: usize> {
    /// The factor L below the diagonal (without its unit diagonal), the factor U above it, and the
    /// reciprocals of U's diagonal on it.
    packed_factors: [[N<f64>; C]; C],
    /// The row of the matrix for each row of the factors.
    row_order: [usize; C],
}

impl<const C: usize> Lu<C> {
    /// Factors `a`, with the largest remaining entry of a column as pivot (Golub and Van Loan,
    /// Matrix Computations, Algorithm 3.4.1). Returns `None` if a pivot is zero or not finite.
    #[inline(always)]
    pub fn new(mut a: [[N<f64>; C]; C]) -> Option<Self> {
        let mut row_order = [0; C];
        for i in 0..C {
            row_order[i] = i;
        }
        for j in 0..C {
            let mut pivot_index = j;
            for i in j + 1..C {
                if a[i][j].0.abs() > a[pivot_index][j].0.abs() {
                    pivot_index = i;
                }
            }
            let pivot_size = a[pivot_index][j].0.abs();
            if !(pivot_size > 0.0 && pivot_size.is_finite()) {
                return None;
            }
            a.swap(j, pivot_index);
            row_order.swap(j, pivot_index);
            let reciprocal = a[j][j].recip();
            let pivot_row = a[j];
            for i in j + 1..C {
                let l = (a[i][j] * reciprocal).v();
                for k in j + 1..C {
                    a[i][k] -= l * pivot_row[k];
                }
                a[i][j] = l;
            }
            a[j][j] = reciprocal;
        }
        Some(Self { packed_factors: a, row_order })
    }

    /// Solves for one right-hand side.
    #[inline(always)]
    pub fn solve(&self, b: &[N<f64>; C]) -> [N<f64>; C] {
        let mut x = *b;
        for i in 0..C {
            x[i] = b[self.row_order[i]];
        }
        // The substitution goes column by column, so that each pass is independent over the rows.
        for j in 0..C {
            for i in j + 1..C {
                x[i] -= self.packed_factors[i][j] * x[j];
            }
        }
        for j in (0..C).rev() {
            x[j] = (x[j] * self.packed_factors[j][j]).v();
            for i in 0..j {
                x[i] -= self.packed_factors[i][j] * x[j];
            }
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solutions_satisfy_the_equations() {
        // Some pivots are zero, so that rows must be exchanged.
        let a = [
            [0.0, 2.0, -1.0, 3.0],
            [0.0, 0.0, 4.0, 1e-3],
            [5.0, -1.0, 0.5, 2.0],
            [1.0, 1e6, 0.0, 7.0],
        ];
        let x = [1.5, -2.0, 0.25, 3.0];
        let b = core::array::from_fn(|i| N((0..4).map(|j| a[i][j] * x[j]).sum::<f64>()));
        let solution = Lu::new(a.map(|row| row.map(N))).unwrap().solve(&b);
        for i in 0..4 {
            assert!((solution[i].0 - x[i]).abs() < 1e-12, "{i}: {} for {}", solution[i].0, x[i]);
        }
    }

    #[test]
    fn singular_matrices_have_no_factors() {
        assert!(Lu::new([[1.0, 2.0], [2.0, 4.0]].map(|row| row.map(N))).is_none());
        assert!(Lu::new([[1.0, 2.0], [f64::NAN, 4.0]].map(|row| row.map(N))).is_none());
        assert!(Lu::new([[f64::INFINITY, 2.0], [1.0, 4.0]].map(|row| row.map(N))).is_none());
    }
}

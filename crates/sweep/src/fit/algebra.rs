//! Eigenvalues and pseudo-inverses of small symmetric matrices.

/// A symmetric matrix as its eigenvalues and eigenvectors.
pub(crate) struct EigenDecomposition {
    /// The eigenvalues in ascending order.
    pub(crate) values: Vec<f64>,
    /// The eigenvector of each eigenvalue, of unit length.
    pub(crate) vectors: Vec<Vec<f64>>,
}

impl EigenDecomposition {
    /// Decomposes a matrix by Jacobi's rotations, to the same bits on any machine.
    ///
    /// G. H. Golub, C. F. Van Loan, Matrix Computations, section 8.5.
    pub(crate) fn from_matrix(matrix: &[Vec<f64>]) -> Self {
        let n = matrix.len();
        let mut a = matrix.to_vec();
        let mut v: Vec<Vec<f64>> =
            (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect();
        for _ in 0..60 {
            let mut largest_ratio = 0.0_f64;
            for p in 0..n {
                for q in p + 1..n {
                    let scale = (a[p][p] * a[q][q]).abs().sqrt();
                    if a[p][q] == 0.0 || a[p][q].abs() <= 1e-18 * scale {
                        continue;
                    }
                    largest_ratio = largest_ratio.max(a[p][q].abs() / scale.max(f64::MIN_POSITIVE));
                    let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                    let c = 1.0 / (t * t + 1.0).sqrt();
                    let s = t * c;
                    for row in &mut a {
                        (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                    }
                    for k in 0..n {
                        (a[p][k], a[q][k]) = (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
                        (v[p][k], v[q][k]) = (c * v[p][k] - s * v[q][k], s * v[p][k] + c * v[q][k]);
                    }
                }
            }
            if largest_ratio < 1e-15 {
                break;
            }
        }
        let mut ascending_order: Vec<usize> = (0..n).collect();
        ascending_order.sort_by(|&i, &j| a[i][i].total_cmp(&a[j][j]));
        Self {
            values: ascending_order.iter().map(|&i| a[i][i]).collect(),
            vectors: ascending_order.iter().map(|&i| v[i].clone()).collect(),
        }
    }

    /// Applies a function to the matrix (to its eigenvalues) and returns the product of the result
    /// with a vector.
    pub(crate) fn apply(&self, x: &[f64], eigenvalue_function: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut product = vec![0.0; x.len()];
        for (value, vector) in self.values.iter().zip(&self.vectors) {
            let component = eigenvalue_function(*value) * dot(vector, x);
            product.iter_mut().zip(vector).for_each(|(product, v)| *product += component * v);
        }
        product
    }
}

/// Returns the scalar product of two vectors.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Scales a matrix to a unit diagonal, and returns it with the square roots of its diagonal. A row
/// of zeros stays, with the scale 1.
pub(crate) fn scale_to_unit_diagonal(matrix: &[Vec<f64>]) -> (Vec<Vec<f64>>, Vec<f64>) {
    let scales: Vec<f64> = (0..matrix.len())
        .map(|i| if matrix[i][i] > 0.0 { matrix[i][i].sqrt() } else { 1.0 })
        .collect();
    let scale_row = |(i, row): (usize, &Vec<f64>)| {
        row.iter().enumerate().map(|(j, x)| x / (scales[i] * scales[j])).collect()
    };
    (matrix.iter().enumerate().map(scale_row).collect(), scales)
}

/// Returns the pseudo-inverse of a symmetric matrix. The matrix is scaled to a unit diagonal, and
/// eigenvalues below 1e-13 then count as zero, because rounding errors are as large.
pub(crate) fn pseudo_inverse(matrix: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let (unit_matrix, scales) = scale_to_unit_diagonal(matrix);
    let eigen = EigenDecomposition::from_matrix(&unit_matrix);
    let inverse_column = |j: usize| {
        let mut scaled_unit_vector = vec![0.0; unit_matrix.len()];
        scaled_unit_vector[j] = 1.0 / scales[j];
        let x =
            eigen.apply(&scaled_unit_vector, |value| if value > 1e-13 { 1.0 / value } else { 0.0 });
        x.iter().zip(&scales).map(|(x, scale)| x / scale).collect()
    };
    (0..matrix.len()).map(inverse_column).collect()
}

/// Subtracts the mean from numbers, and returns them with the mean.
pub(super) fn subtract_mean(mut values: Vec<f64>) -> (Vec<f64>, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter_mut().for_each(|value| *value -= mean);
    (values, mean)
}

/// Returns the quantile of some numbers at a probability; `None` without numbers.
pub(super) fn quantile(values: impl Iterator<Item = f64>, probability: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get((probability * (values.len() as f64 - 1.0)).round() as usize).copied()
}

/// Returns the quantiles of some numbers between which 95 % of them lie; `None` without numbers.
pub(super) fn interval_95(values: impl Iterator<Item = f64> + Clone) -> Option<[f64; 2]> {
    Some([quantile(values.clone(), 0.025)?, quantile(values, 0.975)?])
}

/// Adds the outer product of a vector with itself, times a factor.
pub(super) fn add_outer(sum: &mut [Vec<f64>], vector: &[f64], factor: f64) {
    for (row, a) in sum.iter_mut().zip(vector) {
        row.iter_mut().zip(vector).for_each(|(sum, b)| *sum += factor * a * b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_inverse_undoes_its_matrix_on_any_scale() {
        let scales = [1.0, 1e4, 1e-5, 30.0];
        let matrix: Vec<Vec<f64>> = (0..4)
            .map(|i| {
                let entry = |j: usize| {
                    let correlation = if i == j { 1.0 } else { 0.7_f64.powi((i + j) as i32) };
                    correlation * scales[i] * scales[j]
                };
                (0..4).map(entry).collect()
            })
            .collect();
        let inverse = pseudo_inverse(&matrix);
        for i in 0..4 {
            for j in 0..4 {
                let product = dot(&matrix[i], &inverse[j]) * scales[j] / scales[i];
                let expected = f64::from(u8::from(i == j));
                assert!((product - expected).abs() < 1e-11, "{i} {j}: {product}");
            }
        }
        let eigen = EigenDecomposition::from_matrix(&[vec![2.0, 1.0], vec![1.0, 2.0]]);
        assert!((eigen.values[0] - 1.0).abs() < 1e-15 && (eigen.values[1] - 3.0).abs() < 1e-15);
    }
}

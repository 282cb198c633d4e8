//! The search for the least cost by the method of Levenberg and Marquardt.
//!
//! D. W. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, Journal of
//! the Society for Industrial and Applied Mathematics 11 (1963), 431-441.

use super::algebra::{EigenDecomposition, dot, scale_to_unit_diagonal};
use super::model::NormalEquations;
use sweep_engine::Error;

/// The least predicted decrease of the cost for which a descent goes on. Basis: a hundredth of a
/// standard error. Doubling it ends descents a little earlier.
const MIN_COST_DECREASE: f64 = 2e-4;
/// The greatest predicted decrease of the cost at the end of a descent in which no step achieves
/// it. Basis: a third of a standard error. Doubling it accepts rougher ends as converged.
const MAX_UNACHIEVED_DECREASE: f64 = 0.1;
/// The greatest step of a number, as a part of the number or of a tenth of its range. Basis: the
/// linearisation does not hold for longer steps. Doubling it makes descents shorter, and more of
/// their steps fail.
const MAX_STEP_RATIO: f64 = 0.5;
/// The least damping. Basis: that after six successful steps. Doubling it hardly changes a step.
const MIN_DAMPING: f64 = 1e-9;
/// The greatest number of evaluations of a whole descent. Basis: fits of the tests end in 6 to 70.
/// Doubling it makes searches without an end twice as long.
pub(super) const MAX_EVALUATIONS: usize = 200;

/// The end of a descent.
#[derive(Clone, Debug)]
pub(crate) struct Descent {
    pub(crate) x: Vec<f64>,
    pub(crate) equations: NormalEquations,
    /// The number of points at which the model and its derivatives were computed.
    pub(crate) evaluations: usize,
    /// Whether no step decreases the cost further.
    pub(crate) is_converged: bool,
}

/// Descends from a start within ranges; `None` if the model fails at the start.
pub(crate) fn descend(
    start: &[f64],
    ranges: &[[f64; 2]],
    max_evaluations: usize,
    evaluate: &dyn Fn(&[f64]) -> Result<Option<NormalEquations>, DescentError>,
) -> Result<Option<Descent>, DescentError> {
    let Some(mut current) = evaluate(start)? else { return Ok(None) };
    let mut x = start.to_vec();
    let mut evaluations = 1;
    let mut damping = 1e-3;
    let mut step_scale = 1.0;
    let finish_descent = |x, equations, evaluations, is_converged| {
        Ok(Some(Descent { x, equations, evaluations, is_converged }))
    };
    loop {
        // A number at an end of its range stays if the step would leave the range.
        let free_indices: Vec<usize> = (0..x.len())
            .filter(|&k| {
                let [from, to] = ranges[k];
                let rhs = current.rhs[k];
                current.normal_matrix[k][k] > 0.0
                    && !(x[k] <= from && rhs < 0.0 || x[k] >= to && rhs > 0.0)
            })
            .collect();
        let free_normal: Vec<Vec<f64>> = free_indices
            .iter()
            .map(|&i| free_indices.iter().map(|&j| current.normal_matrix[i][j]).collect())
            .collect();
        let (unit_matrix, scales) = scale_to_unit_diagonal(&free_normal);
        let eigen = EigenDecomposition::from_matrix(&unit_matrix);
        let scaled_rhs: Vec<f64> =
            free_indices.iter().zip(&scales).map(|(&k, s)| current.rhs[k] / s).collect();
        let solve_damped =
            |damping: f64| eigen.apply(&scaled_rhs, |value| 1.0 / (value.max(0.0) + damping));
        // The decrease of the cost, as predicted by the quadratic model.
        let predicted_decrease = dot(&solve_damped(MIN_DAMPING), &scaled_rhs);
        if predicted_decrease < MIN_COST_DECREASE {
            return finish_descent(x, current, evaluations, true);
        }
        loop {
            let solution = solve_damped(damping);
            let step: Vec<f64> = solution.iter().zip(&scales).map(|(step, s)| step / s).collect();
            let step_length =
                free_indices.iter().zip(&step).fold(step_scale, |scale_limit: f64, (&k, step)| {
                    let range_width = ranges[k][1] - ranges[k][0];
                    let magnitude_of_range =
                        if range_width.is_finite() { 0.1 * range_width } else { 0.0 };
                    let magnitude = x[k].abs().max(start[k].abs()).max(magnitude_of_range);
                    scale_limit.min(MAX_STEP_RATIO * magnitude / step.abs())
                });
            let mut trial_point = x.clone();
            for (&k, step) in free_indices.iter().zip(&step) {
                trial_point[k] =
                    (trial_point[k] + step_length * step).clamp(ranges[k][0], ranges[k][1]);
            }
            // Rounding errors and corners of friction may hide a small decrease.
            if evaluations >= max_evaluations || damping > 1e4 {
                return finish_descent(
                    x,
                    current,
                    evaluations,
                    damping > 1e4 && predicted_decrease < MAX_UNACHIEVED_DECREASE,
                );
            }
            evaluations += 1;
            match evaluate(&trial_point)? {
                Some(trial_equations) if trial_equations.cost < current.cost => {
                    // A large residual makes successful steps too short. The next one is longer by
                    // the ratio of this step's actual and predicted decrease.
                    let decrease_ratio = (current.cost - trial_equations.cost)
                        / (step_length * dot(&solution, &scaled_rhs));
                    let extended_step_scale =
                        (step_length / (2.0 - decrease_ratio).max(0.25)).max(1.0);
                    step_scale = if damping > MIN_DAMPING { 1.0 } else { extended_step_scale };
                    (x, current) = (trial_point, trial_equations);
                    damping = (damping * 0.1).max(MIN_DAMPING);
                    break;
                }
                _ if step_scale > 1.0 => step_scale = 1.0,
                _ => damping = (damping * 10.0).max(1e-4),
            }
        }
    }
}

/// The reason why a search has no result.
#[derive(Debug)]
pub(crate) enum DescentError {
    /// The work was cancelled.
    Cancelled,
    /// A request that cannot be answered.
    Refused(Error),
}

impl<E: Into<Error>> From<E> for DescentError {
    fn from(error: E) -> Self {
        Self::Refused(error.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley as residuals 10 (b - a^2) and 1 - a of noise 1.
    fn rosenbrock_equations(x: &[f64]) -> Result<Option<NormalEquations>, DescentError> {
        let residual = [-10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]];
        let slopes = [[-20.0 * x[0], 1.0], [10.0, 0.0]];
        let normal = slopes.map(|a| slopes.map(|b| dot(&a, &b)).to_vec()).to_vec();
        let rhs = slopes.map(|a| dot(&a, &residual)).to_vec();
        Ok(Some(NormalEquations {
            cost: dot(&residual, &residual),
            sigma: vec![1.0; 2],
            normal_matrix: normal,
            rhs,
        }))
    }

    #[test]
    fn steps_grow_where_a_large_residual_makes_them_short() {
        // Residuals x + 1 and bend x^2 + x - 1: Gauss and Newton's steps leave `bend` of the way.
        let curvature = 0.97;
        let evaluate = |x: &[f64]| -> Result<Option<NormalEquations>, DescentError> {
            let residual = [x[0] + 1.0, curvature * x[0] * x[0] + x[0] - 1.0].map(|r| 100.0 * r);
            let slopes = [-100.0, -100.0 * (2.0 * curvature * x[0] + 1.0)];
            let normal = vec![vec![dot(&slopes, &slopes)]];
            let rhs = vec![dot(&slopes, &residual)];
            Ok(Some(NormalEquations {
                cost: dot(&residual, &residual),
                sigma: vec![1.0; 2],
                normal_matrix: normal,
                rhs,
            }))
        };
        let unbounded_ranges = [[f64::NEG_INFINITY, f64::INFINITY]];
        let descent =
            descend(&[1.0], &unbounded_ranges, MAX_EVALUATIONS, &evaluate).unwrap().unwrap();
        assert!(descent.is_converged && descent.evaluations < 40, "{descent:?}");
        assert!(descent.x[0].abs() < 0.01, "{descent:?}");
    }

    #[test]
    fn a_curved_valley_is_followed_to_its_end_or_to_a_bound() {
        let unbounded_ranges = [[f64::NEG_INFINITY, f64::INFINITY]; 2];
        let descent =
            descend(&[-1.2, 1.0], &unbounded_ranges, MAX_EVALUATIONS, &rosenbrock_equations)
                .unwrap()
                .unwrap();
        assert!(descent.is_converged && descent.evaluations < 60, "{descent:?}");
        assert!(
            (descent.x[0] - 1.0).abs() < 0.02 && (descent.x[1] - 1.0).abs() < 0.04,
            "{descent:?}"
        );
        let bounded_ranges = [[-2.0, 0.5], [-2.0, 2.0]];
        let descent =
            descend(&[-1.2, 1.0], &bounded_ranges, MAX_EVALUATIONS, &rosenbrock_equations)
                .unwrap()
                .unwrap();
        assert!(
            (descent.x[0] - 0.5).abs() < 1e-9 && (descent.x[1] - 0.25).abs() < 0.02,
            "{descent:?}"
        );
    }
}

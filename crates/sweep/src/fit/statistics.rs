//! Errors of fitted numbers, and tests of the model against the data.

use super::algebra::{
    EigenDecomposition, dot, pseudo_inverse, scale_to_unit_diagonal, subtract_mean,
};
use super::fixed_numbers::{FixedInfluence, FixedInfluences};
use super::measurement::Signal;
use super::model::{NormalEquations, Problem, SignalComparison};

/// The greatest lag of a residual's autocorrelation. Basis: a second at some hundred samples a
/// second. Doubling it sees slower noise, and doubles the time.
const MAX_LAGS: usize = 400;
/// The shortest time of a motion of a suspension, as a share of the drum's fastest turn. Basis:
/// four times the fastest turn is above every mode. Doubling it leaves out faster motions.
const FASTEST_PERIOD_TURNS: f64 = 0.25;
/// The time within which every motion of a suspension swings back (s). Basis: modes of a suspension
/// are faster than 1 Hz. Doubling it takes slower noise for a motion.
const SLOWEST_PERIOD_S: f64 = 1.0;
/// The number of standard deviations of a correlation that chance makes. Basis: in some ten
/// thousand correlations none is larger. Doubling it sees motions of twice the size only.
const MAX_CHANCE_DEVIATIONS: f64 = 4.0;
/// The number of parts that each record is cut into. Basis: a part of the tests is a second, which
/// a disturbance fills. Doubling it halves the shortest disturbance that is seen.
const RECORD_PART_COUNT: usize = 24;
/// The factor by which the variance of the parts' disagreement may exceed that by noise before the
/// model does not follow. Basis: twice the noise's deviation. Doubling it lets worse models pass.
const MAX_PART_DISAGREEMENT: f64 = 4.0;
/// The least part of a signal's variance that a model explains which follows it. Basis: a motion of
/// the right size that lags by an angle explains the square of the angle's cosine at best. A half
/// is an eighth of a turn; a model farther off is nearer to none, which is a quarter. Of the test
/// `a_wrong_unit_of_speed_or_time_is_named`, wrong units explain less than a quarter, right ones
/// more than three. Doubling it refuses every record with noise.
pub(super) const MIN_EXPLAINED_RATIO: f64 = 0.5;
/// The number of correlations that tell white noise from other residuals. Basis: a motion of a
/// suspension lasts longer than twenty samples, unless it is sampled twice a turn. Doubling it sees
/// slower motions in more noise.
const WHITENESS_TEST_LAGS: usize = 20;
/// The greatest motion that may be left over, as a share of the signal. Basis: a tenth is seen in a
/// figure. Doubling it lets worse models pass.
const MAX_MOTION_RATIO: f64 = 0.1;
/// The number of standard errors by which the nonlinear model may move a number of the linear one.
/// Basis: beyond it intervals would be wrong. Doubling it lets worse models pass.
const MAX_STANDARDISED_BIAS: f64 = 1.0;
/// The least value of 1 less a sample's leverage. Basis: for a sample that alone determines a
/// number it is 0, and the sample's residual says nothing of its noise. Doubling it halves how much
/// such a sample can widen intervals.
const MIN_ONE_MINUS_LEVERAGE: f64 = 0.1;
/// The least part of a noise's variance that does not grow with the motion. Basis: without any,
/// rows at rest would be exact, and their noise called a disagreement. Doubling it doubles the
/// noise that a record of a resting machine may have.
const MIN_CONSTANT_NOISE_RATIO: f64 = 0.1;
/// The relative half-width of a 95 % interval from which on a combination of numbers is
/// undetermined. Basis: a number that is known to half of its size is hardly known. Doubling it
/// reports fewer combinations.
const MIN_UNDETERMINED_HALF_WIDTH: f64 = 0.5;
/// The correlation from which on two numbers are reported together. Basis: their ratio is known
/// three times better than each. Doubling it reports none.
const MIN_REPORTED_CORRELATION: f64 = 0.95;

/// Standard errors to either end of a 95 % interval: the normal distribution's quantile of 0.975.
pub(super) const Z_975: f64 = 1.959_964;

/// Statistics of the residuals at a fit.
pub(crate) struct Statistics {
    /// The covariance of the unknowns, by the residuals' own correlation in time.
    pub(crate) covariance: Vec<Vec<f64>>,
    /// The quantile of 0.975 of each unknown's error over its standard error: Student's, by the
    /// degrees of freedom of its variance.
    pub(crate) quantiles: Vec<f64>,
    /// The dependence of the unknowns on fixed numbers, which widens intervals.
    pub(crate) influences: FixedInfluences,
    /// The factor by which autocorrelation widens variances: for each signal, the variance of a
    /// mean over that of independent samples.
    pub(crate) variance_inflation: Vec<f64>,
    /// The correlation of neighbouring residuals of each signal.
    pub(crate) neighbour_correlations: Vec<f64>,
    /// The part of each signal's variance that the model explains.
    pub(crate) explained_ratios: Vec<f64>,
    /// Whether each signal's residual is white noise.
    pub(crate) residual_is_white: Vec<bool>,
    /// The variance of the parts' disagreement on the unknowns, over that by noise.
    pub(crate) part_disagreement: f64,
    /// The residual of each signal that is a motion, as a share of the residual and of the signal,
    /// mean squares.
    pub(crate) motion_ratios: Vec<[f64; 2]>,
    /// The signal with the greatest residual in units of its noise, and the part of the record (s).
    pub(crate) worst_part: (usize, [f64; 2]),
    /// The number of standard errors by which the nonlinear model would move each unknown of the
    /// linear one.
    pub(crate) standardised_bias: Option<Vec<f64>>,
}

impl Statistics {
    /// Computes the statistics at the end of a descent.
    pub(crate) fn from_comparisons(
        problem: &Problem<'_>,
        comparisons: &[SignalComparison],
        equations: &NormalEquations,
    ) -> Self {
        let unknown_count = problem.unknown_count();
        let inverse_normal_matrix = pseudo_inverse(&equations.normal_matrix);
        let mut score_covariance = vec![vec![0.0; unknown_count]; unknown_count];
        let mut own_score_covariance = vec![vec![0.0; unknown_count]; unknown_count];
        let mut white_score_covariance = vec![vec![0.0; unknown_count]; unknown_count];
        let mut variance_inflation = Vec::new();
        let mut neighbour_correlations = Vec::new();
        let mut motion_ratios = Vec::new();
        let mut explained_ratios = Vec::new();
        let mut residual_is_white = Vec::new();
        let mut disagreement_sum = 0.0;
        let mut degrees_of_freedom = 0.0;
        let mut variance_estimates = vec![VarianceEstimate::default(); unknown_count];
        let mut worst_part = (0, [0.0; 2], 0.0);
        for (k, (((_, _, signal), comparison), sigma)) in
            problem.signals().zip(comparisons).zip(&equations.sigma).enumerate()
        {
            let rho = autocorrelation(&comparison.residual);
            let products_with_lags =
                sum_correlated_products(&comparison.slopes, &rho, 1.0 / (sigma * sigma));
            let products_without_lags =
                sum_correlated_products(&comparison.slopes, &[1.0], 1.0 / (sigma * sigma));
            // Intervals are widened, never narrowed.
            let widening_factor = (0..unknown_count).fold(1.0_f64, |greatest, i| {
                if products_without_lags[i][i] > 0.0 {
                    greatest.max(products_with_lags[i][i] / products_without_lags[i][i])
                } else {
                    greatest
                }
            });
            let is_narrower =
                (0..unknown_count).any(|i| products_with_lags[i][i] < products_without_lags[i][i]);
            let signal_score_covariance =
                if is_narrower { &products_without_lags } else { &products_with_lags };
            add_scaled(
                &mut score_covariance,
                signal_score_covariance,
                if is_narrower { widening_factor } else { 1.0 },
            );
            let lag_window = correlation_window(&comparison.residual);
            let scores = compute_scores(comparison, &inverse_normal_matrix, *sigma);
            add_scaled(
                &mut own_score_covariance,
                &sum_correlated_products(&scores, &lag_window, 1.0),
                1.0,
            );
            add_scaled(
                &mut white_score_covariance,
                &sum_correlated_products(&scores, &[1.0], 1.0),
                1.0,
            );
            let noise_scale = estimate_noise_scale(comparison, signal);
            for (variance_estimate, row) in
                variance_estimates.iter_mut().zip(&inverse_normal_matrix)
            {
                variance_estimate.add(
                    comparison,
                    row,
                    &noise_scale,
                    widening_factor / (sigma * sigma),
                    &lag_window,
                );
            }
            let residual_square = dot(&comparison.residual, &comparison.residual);
            let centred_values = signal.centred_values();
            let case = &problem.cases[comparison.case_index];
            // Noise that grows with the motion is scaled, because few of its values are great and
            // their correlations are accidental.
            let scaled_residual: Vec<f64> = comparison
                .residual
                .iter()
                .zip(&noise_scale)
                .map(|(residual_value, s)| residual_value / s)
                .collect();
            let residual_motion_ratio = compute_motion_ratio(
                &scaled_residual,
                case.sampling_rate_hz(signal),
                60.0 / case.greatest_rpm(),
            );
            motion_ratios.push([
                residual_motion_ratio,
                residual_motion_ratio * residual_square / dot(&centred_values, &centred_values),
            ]);
            explained_ratios.push(1.0 - residual_square / dot(&centred_values, &centred_values));
            residual_is_white.push(is_white_noise(&comparison.residual));
            neighbour_correlations.push(correlation(&comparison.residual, 1));
            variance_inflation.push(widening_factor);
            // Each part of the record pulls at the unknowns on its own.
            let sample_count = comparison.residual.len();
            for part in 0..RECORD_PART_COUNT {
                let sample_range = part * sample_count / RECORD_PART_COUNT
                    ..(part + 1) * sample_count / RECORD_PART_COUNT;
                let Some(part_residual) = comparison.residual.get(sample_range.clone()) else {
                    continue;
                };
                let part_slopes: Vec<&[f64]> = comparison
                    .slopes
                    .iter()
                    .map(|slope| slope.get(sample_range.clone()).unwrap_or_default())
                    .collect();
                let part_noise_scale = &noise_scale[sample_range.clone()];
                let noise_slopes: Vec<Vec<f64>> = part_slopes
                    .iter()
                    .map(|slope| {
                        slope
                            .iter()
                            .zip(part_noise_scale)
                            .map(|(slope_value, scale_value)| slope_value * scale_value)
                            .collect()
                    })
                    .collect();
                let part_information = sum_correlated_products(
                    &noise_slopes,
                    &[1.0],
                    widening_factor / (sigma * sigma),
                );
                let (unit_matrix, scales) = scale_to_unit_diagonal(&part_information);
                let eigen = EigenDecomposition::from_matrix(&unit_matrix);
                let rhs: Vec<f64> = part_slopes
                    .iter()
                    .zip(&scales)
                    .map(|(slope, scale)| dot(slope, part_residual) / (sigma * sigma) / scale)
                    .collect();
                for (value, vector) in eigen.values.iter().zip(&eigen.vectors) {
                    if *value > 1e-6 {
                        disagreement_sum += dot(vector, &rhs).powi(2) / value;
                        degrees_of_freedom += 1.0;
                    }
                }
                let relative_energy = dot(part_residual, part_residual)
                    / (part_residual.len().max(1) as f64 * sigma * sigma);
                if relative_energy > worst_part.2 {
                    let times = &problem.cases[comparison.case_index].measurement.time_s;
                    let sample_rows: Vec<usize> = signal.samples().map(|(row, _)| row).collect();
                    let sample_s =
                        |sample: usize| times[sample_rows[sample.min(sample_rows.len() - 1)]];
                    worst_part = (
                        k,
                        [sample_s(sample_range.start), sample_s(sample_range.end)],
                        relative_energy,
                    );
                }
            }
        }
        let part_disagreement =
            disagreement_sum / (degrees_of_freedom - unknown_count as f64).max(1.0);
        let sandwich_covariance = |score_covariance: &[Vec<f64>]| {
            multiply(&multiply(&inverse_normal_matrix, score_covariance), &inverse_normal_matrix)
        };
        let raised_covariance = raise_variances(
            sandwich_covariance(&score_covariance),
            &sandwich_covariance(&own_score_covariance),
        );
        let raised_again =
            raise_variances(raised_covariance, &sandwich_covariance(&white_score_covariance));
        // Disagreement of the record's parts beyond their noise is an error of the unknowns.
        let covariance = raised_again
            .iter()
            .map(|row| row.iter().map(|x| x * part_disagreement.max(1.0)).collect())
            .collect();
        let worst_part = (worst_part.0, worst_part.1);
        let quantiles = variance_estimates
            .iter()
            .map(|variance_estimate| student_quantile_975(variance_estimate.degrees_of_freedom()))
            .collect();
        Self {
            covariance,
            quantiles,
            influences: FixedInfluences::default(),
            variance_inflation,
            neighbour_correlations,
            explained_ratios,
            residual_is_white,
            part_disagreement,
            motion_ratios,
            worst_part,
            standardised_bias: None,
        }
    }

    /// Returns the signal of which the model explains least, and how much: if that is less than
    /// half of the variance and the rest is more than white noise.
    pub(super) fn least_explained_signal(&self) -> Option<(usize, f64)> {
        let signals = self.explained_ratios.iter().zip(&self.residual_is_white).enumerate();
        signals
            .filter(|(_, (ratio, is_white))| **ratio < MIN_EXPLAINED_RATIO && !**is_white)
            .map(|(k, (ratio, _))| (k, *ratio))
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Returns the reason why the model does not follow, if it does not.
    pub(crate) fn objection(&self, problem: &Problem<'_>) -> Option<String> {
        let mut reasons = Vec::new();
        let column_name = |k: usize| {
            problem
                .signals()
                .nth(k)
                .map_or_else(String::new, |(.., signal)| signal.quantity.column())
        };
        if let Some((k, ratio)) = self.least_explained_signal() {
            let percent = 100.0 * ratio.max(0.0);
            reasons.push(format!(
                "the model explains {percent:.0} % of {}'s variance",
                column_name(k)
            ));
        }
        let motion_shares =
            self.motion_ratios.iter().map(|[_, by_lags]| by_lags.sqrt()).enumerate();
        if let Some((k, motion_share)) = motion_shares.max_by(|a, b| a.1.total_cmp(&b.1))
            && motion_share > MAX_MOTION_RATIO
        {
            let percent = 100.0 * motion_share;
            let column = column_name(k);
            reasons.push(format!(
                "{percent:.0} % of {column} are left over as a motion, not as noise"
            ));
        }
        if self.part_disagreement > MAX_PART_DISAGREEMENT {
            reasons.push(format!(
                "parts of the record ask for values {:.1} times as far apart as noise makes them",
                self.part_disagreement.sqrt()
            ));
        }
        let biases = self.standardised_bias.iter().flatten().zip(&problem.free_parameters);
        if let Some((greatest_bias, free)) = biases.max_by(|a, b| a.0.total_cmp(b.0))
            && *greatest_bias > MAX_STANDARDISED_BIAS
        {
            let name = free.parameter.name();
            reasons.push(format!(
                "the nonlinear model would move {name} by {greatest_bias:.1} standard errors"
            ));
        }
        if reasons.is_empty() {
            return None;
        }
        let (k, [from, to]) = self.worst_part;
        let worst_place_text = format!("; worst is {} from {from:.1} to {to:.1} s", column_name(k));
        Some(reasons.join(", and ") + &worst_place_text)
    }

    /// Returns the dependences on fixed numbers, the strongest first.
    pub(super) fn influences(&self) -> &[FixedInfluence] {
        &self.influences.numbers
    }

    /// Returns the variance of each signal's noise over its independent samples.
    pub(super) fn signal_variances(&self, equations: &NormalEquations) -> Vec<f64> {
        let disagreement = self.part_disagreement.max(1.0);
        let signals = equations.sigma.iter().zip(&self.variance_inflation);
        signals
            .map(|(sigma, variance_inflation)| sigma * sigma * variance_inflation * disagreement)
            .collect()
    }

    /// Returns the covariance of the free numbers by the measurement's noise and the tolerances of
    /// the fixed numbers.
    pub(crate) fn free_covariance(&self, problem: &Problem<'_>) -> Vec<Vec<f64>> {
        let mut covariance = self.noise_covariance(problem);
        add_scaled(&mut covariance, &self.influences.covariance, 1.0);
        covariance
    }

    /// Returns the covariance of the free numbers by the measurement's noise alone.
    pub(super) fn noise_covariance(&self, problem: &Problem<'_>) -> Vec<Vec<f64>> {
        let free_count = problem.free_parameters.len();
        self.covariance[..free_count].iter().map(|row| row[..free_count].to_vec()).collect()
    }

    /// Describes the combinations of numbers that the data do not determine.
    pub(crate) fn describe_undetermined(&self, problem: &Problem<'_>, x: &[f64]) -> Vec<String> {
        let covariance = self.noise_covariance(problem);
        let names: Vec<&str> =
            problem.free_parameters.iter().map(|free| free.parameter.name()).collect();
        // The change of a number that is 0 is relative to its start.
        let magnitudes =
            problem.free_parameters.iter().zip(x).map(|(free, x)| x.abs().max(free.start.abs()));
        let reference_sizes: Vec<f64> =
            magnitudes.map(|size| if size > 0.0 { size } else { 1.0 }).collect();
        let relative_row = |(i, row): (usize, &Vec<f64>)| -> Vec<f64> {
            row.iter()
                .zip(&reference_sizes)
                .map(|(c, size)| c / (reference_sizes[i] * size))
                .collect()
        };
        let relative_covariance: Vec<Vec<f64>> =
            covariance.iter().enumerate().map(relative_row).collect();
        let mut descriptions = Vec::new();
        let eigen = EigenDecomposition::from_matrix(&relative_covariance);
        for (value, vector) in eigen.values.iter().zip(&eigen.vectors).rev() {
            let half_width = Z_975 * value.max(0.0).sqrt();
            if half_width < MIN_UNDETERMINED_HALF_WIDTH {
                continue;
            }
            let largest_entry = vector.iter().fold(0.0_f64, |largest, v| largest.max(v.abs()));
            let sign = vector.iter().find(|v| v.abs() == largest_entry).map_or(1.0, |v| v.signum());
            let change_texts: Vec<String> = vector
                .iter()
                .zip(&names)
                .filter(|(v, _)| v.abs() > 0.1 * largest_entry)
                .map(|(v, name)| {
                    let percent = 100.0 * half_width.min(9.99) * v * sign;
                    let direction = if percent > 0.0 { "up" } else { "down" };
                    format!("{name} {direction} by {:.0} %", percent.abs())
                })
                .collect();
            descriptions.push(format!(
                "{}: that hardly changes the residual, so the data cannot tell",
                change_texts.join(" with ")
            ));
        }
        for i in 0..names.len() {
            for j in 0..i {
                let error_product = (covariance[i][i] * covariance[j][j]).sqrt();
                let correlation = covariance[i][j] / error_product;
                if error_product > 0.0 && correlation.abs() > MIN_REPORTED_CORRELATION {
                    let relation = if correlation < 0.0 { "for" } else { "with" };
                    descriptions.push(format!(
                        "{} goes {relation} {} (correlation {correlation:.3}): they are known \
                         together better than each alone",
                        names[j], names[i]
                    ));
                }
            }
        }
        descriptions
    }
}

/// Adds a matrix times a factor to a sum.
pub(super) fn add_scaled(sum: &mut [Vec<f64>], part: &[Vec<f64>], factor: f64) {
    for (sum, part) in sum.iter_mut().zip(part) {
        sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += factor * part);
    }
}

/// Returns a covariance whose variances are at least those of another estimate, with the same
/// correlations.
fn raise_variances(mut covariance: Vec<Vec<f64>>, other: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let deviation_ratio = |k: usize| {
        let variance = covariance[k][k];
        if variance > 0.0 { (other[k][k] / variance).max(1.0).sqrt() } else { 1.0 }
    };
    let ratios: Vec<f64> = (0..covariance.len()).map(deviation_ratio).collect();
    for (row, row_ratio) in covariance.iter_mut().zip(&ratios) {
        row.iter_mut().zip(&ratios).for_each(|(entry, ratio)| *entry *= row_ratio * ratio);
    }
    covariance
}

/// Computes the score of every unknown at every sample, slope times residual over the variance,
/// with the residual that the sample would have in a fit without it.
///
/// J. G. MacKinnon, H. White, Journal of Econometrics 29 (1985), 305-325: HC3.
fn compute_scores(
    comparison: &SignalComparison,
    inverse_normal: &[Vec<f64>],
    sigma: f64,
) -> Vec<Vec<f64>> {
    let variance = sigma * sigma;
    let slopes_with_rows =
        || comparison.slopes.iter().zip(inverse_normal).filter(|(slope, _)| !slope.is_empty());
    let predicted_scores: Vec<f64> = (0..comparison.residual.len())
        .map(|sample| {
            let project_on_sample = |row: &[f64]| -> f64 {
                comparison
                    .slopes
                    .iter()
                    .zip(row)
                    .filter_map(|(g, b)| Some(g.get(sample)? * b))
                    .sum()
            };
            let leverage: f64 =
                slopes_with_rows().map(|(slope, row)| slope[sample] * project_on_sample(row)).sum();
            comparison.residual[sample]
                / (1.0 - leverage / variance).max(MIN_ONE_MINUS_LEVERAGE)
                / variance
        })
        .collect();
    let unknown_score =
        |slope: &Vec<f64>| slope.iter().zip(&predicted_scores).map(|(g, r)| g * r).collect();
    comparison.slopes.iter().map(unknown_score).collect()
}

/// The variance of an estimate, and the variance of that variance.
///
/// F. E. Satterthwaite, Biometrics Bulletin 2 (1946), 110-114; for variances by residuals
/// G. W. Imbens, M. Kolesár, Review of Economics and Statistics 98 (2016), 701-712.
#[derive(Clone, Debug, Default)]
struct VarianceEstimate {
    variance: f64,
    half_squared_error: f64,
}

impl VarianceEstimate {
    /// Adds a signal, by the row of the inverse of the normal matrix for the unknown, the noise of
    /// each sample over its mean, the weight of a sample, and the window of its correlations.
    fn add(
        &mut self,
        comparison: &SignalComparison,
        inverse_normal_row: &[f64],
        noise_scale: &[f64],
        sample_weight: f64,
        lag_window: &[f64],
    ) {
        let sample_variances = noise_scale.iter().enumerate().map(|(sample, noise)| {
            let products = comparison.slopes.iter().zip(inverse_normal_row);
            let influence: f64 =
                products.filter_map(|(slope, b)| Some(slope.get(sample)? * b)).sum();
            sample_weight * (influence * noise).powi(2)
        });
        let mut variance_sum = 0.0;
        let mut square_sum = 0.0;
        for sample_variance in sample_variances {
            variance_sum += sample_variance;
            square_sum += sample_variance * sample_variance;
        }
        // The estimated correlations add their own errors, twice as much at low frequencies as at
        // that of a motion.
        let lag_factor = dot(lag_window, lag_window);
        self.variance += variance_sum;
        self.half_squared_error += square_sum * lag_factor;
    }

    /// Returns the degrees of freedom of the variance.
    fn degrees_of_freedom(&self) -> f64 {
        self.variance * self.variance / self.half_squared_error.max(f64::MIN_POSITIVE)
    }
}

/// Returns Student's quantile of 0.975, by Cornish and Fisher's expansion: within 1 % from three
/// degrees of freedom, fewer are taken as three.
///
/// M. Abramowitz, I. A. Stegun, Handbook of Mathematical Functions, 26.7.5.
fn student_quantile_975(degrees_of_freedom: f64) -> f64 {
    let z = Z_975;
    let inverse_degrees = 1.0 / degrees_of_freedom.max(3.0);
    let first_term = (z.powi(3) + z) / 4.0;
    let second_term = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0;
    let third_term = (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0;
    z + inverse_degrees
        * (first_term + inverse_degrees * (second_term + inverse_degrees * third_term))
}

/// Estimates the standard deviation of a residual's noise at every sample, over its mean: its
/// variance as a constant and a part that grows with the square of the model's motion, by least
/// squares.
fn estimate_noise_scale(comparison: &SignalComparison, signal: &Signal) -> Vec<f64> {
    let motion =
        subtract_mean(signal.samples().map(|(row, _)| comparison.model_values[row]).collect()).0;
    let (motion_squares, mean_motion_square) =
        subtract_mean(motion.iter().map(|m| m * m).collect());
    let (residual_squares, mean_residual_square) =
        subtract_mean(comparison.residual.iter().map(|r| r * r).collect());
    let unbounded_growth = dot(&motion_squares, &residual_squares)
        / dot(&motion_squares, &motion_squares).max(f64::MIN_POSITIVE);
    let max_growth = (1.0 - MIN_CONSTANT_NOISE_RATIO) * mean_residual_square
        / mean_motion_square.max(f64::MIN_POSITIVE);
    // `clamp` would panic where squares of the measurement overflow.
    let growth = unbounded_growth.min(max_growth).max(0.0);
    if mean_residual_square == 0.0 {
        return vec![1.0; motion_squares.len()];
    }
    let relative_variance = |energy: &f64| 1.0 + growth * energy / mean_residual_square;
    motion_squares.iter().map(|energy| relative_variance(energy).sqrt()).collect()
}

/// Returns the product of a matrix and a symmetric one.
fn multiply(a: &[Vec<f64>], b: &[Vec<f64>]) -> Vec<Vec<f64>> {
    a.iter().map(|row| b.iter().map(|column| dot(row, column)).collect()).collect()
}

/// Computes the sum over all pairs of samples of slope, correlation by lag and slope, times a
/// weight.
fn sum_correlated_products(slopes: &[Vec<f64>], rho: &[f64], weight: f64) -> Vec<Vec<f64>> {
    let unknown_count = slopes.len();
    let mut sum = vec![vec![0.0; unknown_count]; unknown_count];
    for (lag, rho) in rho.iter().enumerate() {
        for i in 0..unknown_count {
            for j in 0..unknown_count {
                let lagged_slope = slopes[j].get(lag..).unwrap_or_default();
                let product = weight * rho * dot(&slopes[i], lagged_slope);
                sum[i][j] += product;
                if lag > 0 {
                    sum[j][i] += product;
                }
            }
        }
    }
    sum
}

/// Returns the correlation of values with those `lag` samples later, without regard to gaps in
/// time.
fn correlation(values: &[f64], lag: usize) -> f64 {
    dot(values, &values[lag..]) / dot(values, values).max(f64::MIN_POSITIVE)
}

/// Returns whether the correlations of a residual are within the random errors of those of white
/// noise.
///
/// G. E. P. Box, D. A. Pierce, Journal of the American Statistical Association 65 (1970),
/// 1509-1526.
fn is_white_noise(residual: &[f64]) -> bool {
    let lag_count = WHITENESS_TEST_LAGS.min(residual.len() / 4);
    let squared_correlations: f64 =
        (1..=lag_count).map(|lag| correlation(residual, lag).powi(2)).sum();
    let expected_statistic = lag_count as f64;
    residual.len() as f64 * squared_correlations
        <= expected_statistic + MAX_CHANCE_DEVIATIONS * (2.0 * expected_statistic).sqrt()
}

/// Returns the autocorrelation by lag, tapered to zero where it is within its random errors. The
/// taper has a flat top, because Bartlett's would reduce the correlation of slow noise by a third.
///
/// D. N. Politis, J. P. Romano, Journal of Time Series Analysis 16 (1995), 67-103.
fn autocorrelation(residual: &[f64]) -> Vec<f64> {
    let window = correlation_window(residual);
    window.iter().enumerate().map(|(lag, taper)| taper * correlation(residual, lag)).collect()
}

/// Returns the weights of the autocorrelation by lag: 1 up to the last lag with a correlation above
/// its random error, and linearly to zero at twice this lag.
fn correlation_window(residual: &[f64]) -> Vec<f64> {
    let squares: Vec<f64> = residual.iter().map(|value| value * value).collect();
    let total_square = squares.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    // The variance of a correlation by White, which holds for noise of varying size.
    let random_error = |lag: usize| 2.0 * dot(&squares, &squares[lag..]).sqrt() / total_square;
    let max_lag = MAX_LAGS.min(residual.len() / 4);
    let mut last_significant_lag = 0;
    let mut lag = 1;
    while lag < max_lag && lag <= last_significant_lag + 5 {
        if correlation(residual, lag).abs() > random_error(lag) {
            last_significant_lag = lag;
        }
        lag += 1;
    }
    let taper_weight = |lag: usize| (2.0 - lag as f64 / last_significant_lag as f64).min(1.0);
    std::iter::once(1.0)
        .chain((1..max_lag.min(2 * last_significant_lag)).map(taper_weight))
        .collect()
}

/// Returns the part of a residual's mean square that is a motion: the greatest negative
/// autocorrelation, if it is above its random error. Slow noise has no negative autocorrelation,
/// and hum is faster than a suspension.
fn compute_motion_ratio(residual: &[f64], rate_hz: f64, turn_s: f64) -> f64 {
    let block_samples =
        ((FASTEST_PERIOD_TURNS * turn_s * rate_hz) as usize).clamp(1, residual.len());
    let block_mean = |samples: &[f64]| samples.iter().sum::<f64>() / block_samples as f64;
    let (block_means, _) =
        subtract_mean(residual.chunks_exact(block_samples).map(block_mean).collect());
    let max_lag =
        ((SLOWEST_PERIOD_S * rate_hz) as usize / block_samples).min(block_means.len() / 4);
    let rho: Vec<f64> = (1..max_lag).map(|lag| correlation(&block_means, lag)).collect();
    let lowest = rho.iter().copied().fold(0.0, f64::min);
    // The variance of a correlation by Bartlett, for noise with these positive correlations.
    let slow_squares: f64 = rho.iter().take_while(|rho| **rho > 0.0).map(|rho| rho * rho).sum();
    let random_error =
        MAX_CHANCE_DEVIATIONS * ((1.0 + 2.0 * slow_squares) / block_means.len() as f64).sqrt();
    let block_energy_ratio = block_samples as f64 * dot(&block_means, &block_means)
        / dot(residual, residual).max(f64::MIN_POSITIVE);
    if -lowest > random_error { -lowest * block_energy_ratio } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::super::tests::correlated_noise;
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn correlated_noise_widens_an_interval_by_what_it_does_to_a_mean() {
        for correlation in [0.6, 0.8, 0.9] {
            let residual = correlated_noise(11, 0, 20_000, correlation);
            let rho = autocorrelation(&residual);
            let slopes = vec![vec![1.0; residual.len()]];
            let variance_ratio =
                sum_correlated_products(&slopes, &rho, 1.0)[0][0] / residual.len() as f64;
            let limit_ratio = (1.0 + correlation) / (1.0 - correlation);
            assert!(
                (variance_ratio / limit_ratio - 1.0).abs() < 0.2,
                "{correlation}: {variance_ratio}, not {limit_ratio}"
            );
        }
        assert_eq!(autocorrelation(&correlated_noise(11, 1, 20_000, 0.0)), [1.0]);
    }

    #[test]
    fn white_noise_is_told_from_correlated_noise_and_motions() {
        for seed in 0..50 {
            assert!(is_white_noise(&correlated_noise(seed, 0, 1200, 0.0)), "{seed}");
            assert!(!is_white_noise(&correlated_noise(seed, 0, 1200, 0.3)), "{seed}");
            let motion = (0..1200).map(|k| (0.4 * f64::from(k)).sin());
            let noisy_motion = motion.zip(correlated_noise(seed, 1, 1200, 0.0)).map(|(a, b)| a + b);
            assert!(!is_white_noise(&noisy_motion.collect::<Vec<f64>>()), "{seed}");
        }
    }

    #[test]
    fn a_motion_is_told_from_noise_and_hum() {
        let rate_hz = 500.0;
        let turn_s = 60.0 / 350.0;
        let tone_at = |hz: f64| move |k: usize| (TAU * hz * k as f64 / rate_hz).sin();
        for correlation in [0.0, 0.6, 0.9, 0.97] {
            let noise = correlated_noise(5, 0, 12_000, correlation);
            assert_eq!(compute_motion_ratio(&noise, rate_hz, turn_s), 0.0, "{correlation}");
            for (hz, expected) in [(1.5, 0.5), (5.0, 0.5), (50.0, 0.0)] {
                let motion = (0..12_000).map(tone_at(hz));
                let noisy_tone: Vec<f64> =
                    motion.zip(&noise).map(|(tone, noise)| tone + 0.5_f64.sqrt() * noise).collect();
                let found_ratio = compute_motion_ratio(&noisy_tone, rate_hz, turn_s);
                assert!(
                    (found_ratio - expected).abs() < 0.15,
                    "{correlation}, {hz} Hz: {found_ratio}"
                );
            }
        }
    }
}

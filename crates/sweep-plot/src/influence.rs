//! The influence of each parameter on a quantity of scattered points.

/// Two measures of a parameter's influence. Both are taken of ranks, so that they depend neither on
/// units nor on logarithms, and an outlier does not dominate them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RankInfluence {
    /// The rank correlation, from -1 to 1: the extent to which the quantity rises or falls with the
    /// parameter throughout.
    ///
    /// C. Spearman, The proof and measurement of association between two things, American Journal
    /// of Psychology 15 (1904), 72-101.
    pub(crate) rank_correlation: f64,
    /// The root of the share of the ranks' variance that the parameter alone explains, from 0 to 1.
    /// It is the magnitude of `rank_correlation` for a quantity that only rises or only falls, and
    /// larger for one that does both. `None` for too few points.
    ///
    /// The square is the correlation ratio without the bias of bins: T. L. Kelley, An unbiased
    /// correlation ratio measure, Proceedings of the National Academy of Sciences 21 (1935),
    /// 554-559.
    pub(crate) root_correlation_ratio: Option<f64>,
}

impl RankInfluence {
    /// Returns the influence of `x` on `y` over pairs that have both values.
    pub(crate) fn new(x: &[f64], y: &[f64]) -> Option<Self> {
        let finite_pairs = x.iter().zip(y).filter(|(x, y)| x.is_finite() && y.is_finite());
        let (x, y): (Vec<f64>, Vec<f64>) = finite_pairs.unzip();
        let x_ranks = compute_ranks(&x);
        let y_ranks = compute_ranks(&y);
        Some(Self {
            rank_correlation: compute_correlation(&x_ranks, &y_ranks)?,
            root_correlation_ratio: correlation_ratio(&x_ranks, &y_ranks),
        })
    }

    /// Returns the larger of both measures, which orders the parameters.
    pub(crate) fn strength(self) -> f64 {
        self.rank_correlation.abs().max(self.root_correlation_ratio.unwrap_or_default())
    }
}

/// Returns the magnitude of a rank correlation that chance alone exceeds in one of twenty samples
/// of this number of points, if the quantity does not depend on the parameter.
pub(crate) fn chance_correlation(points: usize) -> f64 {
    if points < 2 { 1.0 } else { (1.96 / ((points - 1) as f64).sqrt()).min(1.0) }
}

/// Returns the ranks from 1; equal values share the mean of their ranks.
fn compute_ranks(values: &[f64]) -> Vec<f64> {
    let mut sorted_indices: Vec<usize> = (0..values.len()).collect();
    sorted_indices.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    for ties in sorted_indices.chunk_by(|&a, &b| values[a] == values[b]) {
        // A run of m values after k others has the ranks k + 1 to k + m.
        let lower_count =
            sorted_indices.partition_point(|&other_index| values[other_index] < values[ties[0]]);
        let rank = lower_count as f64 + (ties.len() + 1) as f64 / 2.0;
        ties.iter().for_each(|&index| ranks[index] = rank);
    }
    ranks
}

/// Returns the correlation of two lists of ranks; `None` if either is constant.
fn compute_correlation(x: &[f64], y: &[f64]) -> Option<f64> {
    let mean_rank = (x.len() + 1) as f64 / 2.0;
    let sum_terms = |term: &dyn Fn(usize) -> f64| (0..x.len()).map(term).sum::<f64>();
    let covariance_sum = sum_terms(&|k| (x[k] - mean_rank) * (y[k] - mean_rank));
    let x_square_sum = sum_terms(&|k| (x[k] - mean_rank).powi(2));
    let y_square_sum = sum_terms(&|k| (y[k] - mean_rank).powi(2));
    (x_square_sum > 0.0 && y_square_sum > 0.0)
        .then(|| covariance_sum / (x_square_sum * y_square_sum).sqrt())
}

/// Maximum number of bins of the correlation ratio. Basis: enough to follow a curve with several
/// turns. Doubling it doubles the noise of the ratio.
const MAX_BINS: usize = 20;
/// Minimum number of points to a bin. Basis: the mean of ten ranks is stable. Doubling it halves
/// the bins of small designs.
const MIN_BIN_POINTS: usize = 10;

/// Returns the root of the corrected correlation ratio of ranks, over bins of equally many points.
/// Equal values of `x` share a bin.
fn correlation_ratio(x: &[f64], y: &[f64]) -> Option<f64> {
    let point_count = x.len();
    let bin_count = (point_count / MIN_BIN_POINTS).min(MAX_BINS);
    if bin_count < 2 {
        return None;
    }
    let mut sums = vec![(0_usize, 0.0); bin_count];
    for (x, y) in x.iter().zip(y) {
        let bin_index = ((x - 0.5) / point_count as f64 * bin_count as f64) as usize;
        let (count, sum) = &mut sums[bin_index.min(bin_count - 1)];
        (*count, *sum) = (*count + 1, *sum + y);
    }
    let mean_rank = (point_count + 1) as f64 / 2.0;
    let filled_bins: Vec<(usize, f64)> = sums.into_iter().filter(|(count, _)| *count > 0).collect();
    let between_bins = filled_bins
        .iter()
        .map(|(count, sum)| *count as f64 * (sum / *count as f64 - mean_rank).powi(2));
    let total_square_sum: f64 = y.iter().map(|y| (y - mean_rank).powi(2)).sum();
    let filled_count = filled_bins.len();
    if filled_count < 2 || filled_count >= point_count || total_square_sum <= 0.0 {
        return None;
    }
    let explained_fraction = between_bins.sum::<f64>() / total_square_sum;
    let corrected_fraction = 1.0
        - (1.0 - explained_fraction) * (point_count - 1) as f64
            / (point_count - filled_count) as f64;
    Some(corrected_fraction.max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rising_numbers(count: i32) -> Vec<f64> {
        (0..count).map(f64::from).collect()
    }

    #[test]
    fn equal_values_share_the_mean_of_their_ranks() {
        assert_eq!(compute_ranks(&[5.0, 1.0, 5.0, 9.0]), [2.5, 1.0, 2.5, 4.0]);
    }

    #[test]
    fn the_rank_correlation_agrees_with_a_hand_calculation() {
        // Differences of ranks 0, 1, -1, 0: 1 - 6 * 2 / (4 * 15).
        let influence =
            RankInfluence::new(&[1.0, 2.0, 3.0, 4.0], &[10.0, 30.0, 20.0, 900.0]).unwrap();
        assert!((influence.rank_correlation - 0.8).abs() < 1e-12);
        assert_eq!(influence.root_correlation_ratio, None, "four points are too few for bins");
        assert_eq!(RankInfluence::new(&[1.0, 1.0], &[1.0, 2.0]), None);
    }

    #[test]
    fn a_hill_has_a_correlation_ratio_but_no_rank_correlation() {
        let x = rising_numbers(400);
        let exponential_values: Vec<f64> = x.iter().map(|x| (0.1 * x).exp()).collect();
        let influence = RankInfluence::new(&x, &exponential_values).unwrap();
        assert!(
            influence.rank_correlation == 1.0 && influence.root_correlation_ratio.unwrap() > 0.99,
            "{influence:?}"
        );
        let hill_values: Vec<f64> = x.iter().map(|x| -(x - 199.5).abs()).collect();
        let influence = RankInfluence::new(&x, &hill_values).unwrap();
        assert!(
            influence.rank_correlation.abs() < 1e-3
                && influence.root_correlation_ratio.unwrap() > 0.99,
            "{influence:?}"
        );
    }

    #[test]
    fn an_independent_quantity_correlates_less_than_by_chance() {
        // Fractional parts of multiples of the golden ratio are unrelated to the order of x.
        let x = rising_numbers(400);
        let y: Vec<f64> = x.iter().map(|x| (x * 0.618_033_988_749_895).fract()).collect();
        let influence = RankInfluence::new(&x, &y).unwrap();
        assert!(
            influence.rank_correlation.abs() < chance_correlation(400)
                && influence.root_correlation_ratio.unwrap() < 0.2,
            "{influence:?}"
        );
        assert!((chance_correlation(400) - 0.098).abs() < 1e-3);
    }

    #[test]
    fn pairs_without_a_value_are_left_out() {
        let influence =
            RankInfluence::new(&[1.0, 2.0, 3.0, 4.0], &[1.0, f64::NAN, 3.0, 4.0]).unwrap();
        assert_eq!(influence.rank_correlation, 1.0);
    }
}

//! The spin from a tachometer: a spline of first degree, which is a table of the spin's.

use serde::Serialize;
use washer_model::Spin;

use super::algebra::quantile;
use super::normal_quantile_sampler;

/// The least noise of a tachometer, as a part of its greatest speed. Basis: rounding to five
/// digits. Doubling it gives exact speeds fewer knots.
const MIN_NOISE_RATIO: f64 = 1e-5;
/// The number of positions in a span at which a further knot is tried. Basis: a knot between two of
/// them is followed by further ones beside it. Doubling it doubles the time.
const TRIED_KNOT_POSITIONS: usize = 31;
/// The number of random splines. Basis: a standard deviation of so many draws is known to a sixth.
/// Doubling it doubles the time of their part of the covariance.
const RANDOM_SPLINE_COUNT: u64 = 16;
/// The greatest number of knots. Basis: an hour of spin cycles has some hundred corners. Doubling
/// it doubles the longest time.
const MAX_KNOTS: usize = 1000;

/// A smoothed measurement of the spin.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct SmoothedSpin {
    #[serde(skip)]
    pub(crate) spin: Spin,
    /// The noise, from second differences (rpm).
    pub(crate) noise_rpm: f64,
    /// The number of the spline's knots.
    pub(crate) knots: usize,
    /// Random splines, distributed by the noise about the fitted one.
    #[serde(skip)]
    pub(crate) random_spins: Vec<Spin>,
}

/// Fits the least-squares spline of first degree, with as many knots as the noise justifies. Its
/// integral, the angle, stays near the measured one, because the residuals of each span have a mean
/// near zero.
pub(crate) fn smooth_spin(time_s: &[f64], speed_rpm: &[f64]) -> Option<SmoothedSpin> {
    let samples: Vec<[f64; 2]> = time_s
        .iter()
        .zip(speed_rpm)
        .filter(|(_, speed)| !speed.is_nan())
        .map(|(time, speed)| [*time, *speed])
        .collect();
    let [first_s, _] = samples.first()?;
    let [last_s, _] = samples.last()?;
    let greatest_rpm =
        samples.iter().fold(0.0_f64, |greatest, [_, speed]| greatest.max(speed.abs()));
    let (rounding_rpm, samples_per_step) = estimate_digit_rounding(&samples).unwrap_or((0.0, 0.0));
    let noise_rpm = estimate_noise(&samples).max(MIN_NOISE_RATIO * greatest_rpm).max(rounding_rpm);
    // The least gain of a knot by the Bayesian information criterion, with its position as a
    // parameter. A step of the tachometer's digits is no reason for a knot.
    let min_gain =
        (3.0 * libm::log(samples.len() as f64)).max(2.0 * samples_per_step) * noise_rpm * noise_rpm;
    let mut knots = vec![*first_s, *last_s];
    let mut speeds = fit_spline(&samples, &knots)?;
    while knots.len() < MAX_KNOTS {
        let further_knots = find_further_knots(&samples, &knots, &speeds, min_gain);
        if further_knots.is_empty() {
            break;
        }
        knots.extend(further_knots);
        knots.sort_by(f64::total_cmp);
        speeds = fit_spline(&samples, &knots)?;
    }
    let spin_of_speeds = |mut speeds: Vec<f64>| {
        let mut times = knots.clone();
        if *first_s > 0.0 {
            // The spline continues to the start of the run on the line of its first span, which
            // ends at zero.
            let slope = (speeds[1] - speeds[0]) / (knots[1] - knots[0]);
            let start_rpm = speeds[0] - slope * first_s;
            let [lower_rpm, upper_rpm] = [speeds[0].min(0.0), speeds[0].max(0.0)];
            times.insert(0, 0.0);
            speeds.insert(0, start_rpm.clamp(lower_rpm, upper_rpm));
        }
        Spin::Table { time_s: times, speed_rpm: speeds }
    };
    let (spline_equations, _) = SplineEquations::from_samples(&samples, &knots);
    let sample_normal = normal_quantile_sampler(RANDOM_SPLINE_COUNT);
    let draw_spin = |point: u64| {
        let standard_normal: Vec<f64> = (0..knots.len()).map(|k| sample_normal(point, k)).collect();
        let deviations = spline_equations.scale_standard_normal(&standard_normal);
        spin_of_speeds(
            speeds
                .iter()
                .zip(&deviations)
                .map(|(speed, deviations)| speed + noise_rpm * deviations)
                .collect(),
        )
    };
    let random_spins = (0..RANDOM_SPLINE_COUNT).map(draw_spin).collect();
    Some(SmoothedSpin { spin: spin_of_speeds(speeds), noise_rpm, knots: knots.len(), random_spins })
}

/// Estimates the standard deviation of white noise about a smooth curve, from the median of the
/// distances of samples to the line through their neighbours. Jumps do not change the median.
fn estimate_noise(samples: &[[f64; 2]]) -> f64 {
    let distances = samples.windows(3).map(|neighbours| {
        let fraction_before =
            (neighbours[1][0] - neighbours[0][0]) / (neighbours[2][0] - neighbours[0][0]);
        let [weight_before, weight_after] = [1.0 - fraction_before, fraction_before];
        let distance =
            neighbours[1][1] - weight_before * neighbours[0][1] - weight_after * neighbours[2][1];
        distance.abs() / (1.0 + weight_before * weight_before + weight_after * weight_after).sqrt()
    });
    // The median of |x| of a normal distribution.
    quantile(distances, 0.5).map_or(0.0, |median| median / 0.674_489_75)
}

/// Returns the rounding error of a tachometer whose digits are coarser than its noise, and the
/// usual number of samples between changes of a digit. Neighbouring samples do not show the noise
/// of such a tachometer, because most of them are equal.
fn estimate_digit_rounding(samples: &[[f64; 2]]) -> Option<(f64, f64)> {
    let changes_rpm = samples.windows(2).map(|pair| (pair[1][1] - pair[0][1]).abs());
    let digit_changes_rpm = changes_rpm.filter(|step| *step > 0.0);
    let change_count = digit_changes_rpm.clone().count();
    let step_rpm =
        quantile(digit_changes_rpm, 0.5).filter(|_| 2 * change_count <= samples.len())?;
    Some((step_rpm / 12.0_f64.sqrt(), samples.len() as f64 / change_count as f64))
}

/// Returns the index of the span in which a time lies, and the part of the span before it.
fn find_span(knots: &[f64], time_s: f64) -> (usize, f64) {
    let span = knots.partition_point(|&knot| knot <= time_s).clamp(1, knots.len() - 1) - 1;
    (span, (time_s - knots[span]) / (knots[span + 1] - knots[span]))
}

/// The normal equations of a spline after elimination. Their matrix is tridiagonal.
struct SplineEquations {
    diagonal: Vec<f64>,
    elimination_factors: Vec<f64>,
}

impl SplineEquations {
    /// Computes the normal equations of splines with these knots, and their right side.
    fn from_samples(samples: &[[f64; 2]], knots: &[f64]) -> (Self, Vec<f64>) {
        let mut diagonal = vec![0.0; knots.len()];
        let mut off_diagonal = vec![0.0; knots.len()];
        let mut rhs = vec![0.0; knots.len()];
        for &[time, speed] in samples {
            let (k, fraction) = find_span(knots, time);
            let complement = 1.0 - fraction;
            diagonal[k] += complement * complement;
            diagonal[k + 1] += fraction * fraction;
            off_diagonal[k] += complement * fraction;
            rhs[k] += complement * speed;
            rhs[k + 1] += fraction * speed;
        }
        let mut elimination_factors = vec![0.0; knots.len()];
        for k in 1..knots.len() {
            elimination_factors[k - 1] = off_diagonal[k - 1] / diagonal[k - 1];
            diagonal[k] -= elimination_factors[k - 1] * off_diagonal[k - 1];
            rhs[k] -= elimination_factors[k - 1] * rhs[k - 1];
        }
        rhs.iter_mut().zip(&diagonal).for_each(|(rhs, pivot)| *rhs /= pivot);
        (Self { diagonal, elimination_factors }, rhs)
    }

    fn substitute_back(&self, mut rhs: Vec<f64>) -> Vec<f64> {
        for k in (1..rhs.len()).rev() {
            rhs[k - 1] -= self.elimination_factors[k - 1] * rhs[k];
        }
        rhs
    }

    /// Transforms independent numbers of variance 1 to numbers whose covariance is the inverse of
    /// the normal matrix.
    fn scale_standard_normal(&self, standard_normal: &[f64]) -> Vec<f64> {
        self.substitute_back(
            standard_normal
                .iter()
                .zip(&self.diagonal)
                .map(|(standard_normal, pivot)| standard_normal / pivot.sqrt())
                .collect(),
        )
    }
}

/// Fits the spline's values at its knots, by least squares. `None` if they are not all determined.
fn fit_spline(samples: &[[f64; 2]], knots: &[f64]) -> Option<Vec<f64>> {
    let (equations, rhs) = SplineEquations::from_samples(samples, knots);
    let speeds = equations.substitute_back(rhs);
    speeds.iter().all(|speed| speed.is_finite()).then_some(speeds)
}

/// Finds the best further knot of each span in which it gains more than `min_gain`.
fn find_further_knots(
    samples: &[[f64; 2]],
    knots: &[f64],
    speeds: &[f64],
    min_gain: f64,
) -> Vec<f64> {
    let mut new_knots = Vec::new();
    for (span, span_ends) in knots.windows(2).enumerate() {
        let first_sample = samples.partition_point(|[time, _]| *time < span_ends[0]);
        let end_sample = samples.partition_point(|[time, _]| *time <= span_ends[1]);
        let span_samples = &samples[first_sample..end_sample];
        let mut best_gain_and_knot = (min_gain, None);
        for position in 1..=TRIED_KNOT_POSITIONS {
            let sample = position * span_samples.len() / (TRIED_KNOT_POSITIONS + 1);
            // Each span keeps at least a few samples.
            if sample < 3 || sample + 4 > span_samples.len() {
                continue;
            }
            let knot = span_samples[sample][0];
            let mut residual_projection = 0.0;
            let mut hat_square_sum = 0.0;
            for &[time, speed] in span_samples {
                let fraction = (time - span_ends[0]) / (span_ends[1] - span_ends[0]);
                let residual =
                    speed - speeds[span] * (1.0 - fraction) - speeds[span + 1] * fraction;
                let hat_value = match time <= knot {
                    true => (time - span_ends[0]) / (knot - span_ends[0]),
                    false => (span_ends[1] - time) / (span_ends[1] - knot),
                };
                residual_projection += hat_value * residual;
                hat_square_sum += hat_value * hat_value;
            }
            let gain = residual_projection * residual_projection / hat_square_sum;
            if gain > best_gain_and_knot.0 {
                best_gain_and_knot = (gain, Some(knot));
            }
        }
        new_knots.extend(best_gain_and_knot.1);
    }
    new_knots
}

#[cfg(test)]
mod tests {
    use super::*;
    use sweep_engine::design::{Design, DesignRule, Distribution, DistributionShape};

    #[test]
    fn a_spline_of_noisy_speeds_with_kinks_keeps_the_angle() {
        let true_speed_rpm = |t: f64| if t < 7.3 { 40.0 * t } else { 292.0 - 20.0 * (t - 7.3) };
        let normal = Distribution {
            shape: DistributionShape::Normal { mean: 0.0, sd: 1.5 },
            from: -9.0,
            to: 9.0,
        };
        let random_design = Design::Spread { rule: DesignRule::MonteCarlo, points: 0, seed: 5 };
        let time_s: Vec<f64> = (0..3000).map(|k| 0.003 + 0.004 * f64::from(k)).collect();
        let noisy_speeds: Vec<f64> = time_s
            .iter()
            .enumerate()
            .map(|(k, t)| {
                true_speed_rpm(*t) + normal.quantile(random_design.position(k as u64, 0).unwrap())
            })
            .collect();
        let smoothed_spin = smooth_spin(&time_s, &noisy_speeds).unwrap();
        assert!((smoothed_spin.noise_rpm - 1.5).abs() < 0.1, "{smoothed_spin:?}");
        assert!((3..12).contains(&smoothed_spin.knots), "{smoothed_spin:?}");
        // At the end of a straight span of n samples: a variance of 4 / n.
        let Spin::Table { time_s: knots, .. } = &smoothed_spin.spin else {
            panic!("{smoothed_spin:?}")
        };
        let samples_in_last_span = (knots[knots.len() - 1] - knots[knots.len() - 2]) / 0.004;
        let end_speed_rpm = |spin: &Spin| spin.speeds_rpm([time_s[2999]]).next().unwrap();
        let fitted_end_rpm = end_speed_rpm(&smoothed_spin.spin);
        let squared_deviations: f64 = smoothed_spin
            .random_spins
            .iter()
            .map(|spin| (end_speed_rpm(spin) - fitted_end_rpm).powi(2))
            .sum();
        let relative_deviation = (squared_deviations / smoothed_spin.random_spins.len() as f64)
            .sqrt()
            / (1.5 * (4.0 / samples_in_last_span).sqrt());
        assert!((0.5..2.0).contains(&relative_deviation), "{relative_deviation}");
        let mut angle_error_turns = 0.0_f64;
        let mut greatest_angle_error = 0.0_f64;
        for (t, spline_rpm) in
            time_s.iter().zip(smoothed_spin.spin.speeds_rpm(time_s.iter().copied()))
        {
            angle_error_turns += (spline_rpm - true_speed_rpm(*t)) / 60.0 * 0.004;
            greatest_angle_error = greatest_angle_error.max(angle_error_turns.abs());
        }
        // Turns; the noise itself wanders by 1.5 / 60 sqrt(12 * 0.004) = 5e-3.
        assert!(greatest_angle_error < 0.01, "{greatest_angle_error}");
        let exact_speeds: Vec<f64> = time_s.iter().map(|t| true_speed_rpm(*t)).collect();
        let smoothed_exact = smooth_spin(&time_s, &exact_speeds).unwrap();
        let greatest_difference = time_s
            .iter()
            .zip(smoothed_exact.spin.speeds_rpm(time_s.iter().copied()))
            .fold(0.0_f64, |greatest, (t, spline_rpm)| {
                greatest.max((spline_rpm - true_speed_rpm(*t)).abs())
            });
        assert!(greatest_difference < 0.2, "{greatest_difference}: {smoothed_exact:?}");
        // Speeds that are rounded to whole digits get no further knots.
        for digit_rpm in [1.0, 5.0] {
            let rounded_speeds: Vec<f64> = time_s
                .iter()
                .map(|t| (true_speed_rpm(*t) / digit_rpm).round() * digit_rpm)
                .collect();
            let smoothed_rounded = smooth_spin(&time_s, &rounded_speeds).unwrap();
            assert!(
                (smoothed_rounded.noise_rpm / digit_rpm - 12.0_f64.sqrt().recip()).abs() < 1e-9,
                "{smoothed_rounded:?}"
            );
            assert!(smoothed_rounded.knots < 12, "{digit_rpm}: {smoothed_rounded:?}");
        }
    }
}

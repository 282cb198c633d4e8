//! The spin from a tachometer: a spline of first degree, which is a table of the spin's.

use serde::Serialize;
use washer_model::Spin;

use super::algebra::quantile;
use super::normal_draws;

/// The least noise of a tachometer, as a part of its greatest speed. Basis: rounding to five
/// digits. Doubling it gives exact speeds fewer knots.
const MIN_NOISE_RATIO: f64 = 1e-5;
/// The number of positions in a span at which a further knot is tried. Basis: a knot between two of
/// them is followed by further ones beside it. Doubling it doubles the time.
const TRIED_POSITIONS: usize = 31;
/// The number of random splines. Basis: a standard deviation of so many draws is known to a sixth.
/// Doubling it doubles the time of their part of the covariance.
const RANDOM_SPLINES: u64 = 16;
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
    pub(crate) drawn: Vec<Spin>,
}

/// Fits the least-squares spline of first degree, with as many knots as the noise justifies. Its
/// integral, the angle, stays near the measured one, because the residuals of each span have a mean
/// near zero.
pub(crate) fn smoothed(time_s: &[f64], speed_rpm: &[f64]) -> Option<SmoothedSpin> {
    let samples: Vec<[f64; 2]> = time_s
        .iter()
        .zip(speed_rpm)
        .filter(|(_, speed)| !speed.is_nan())
        .map(|(time, speed)| [*time, *speed])
        .collect();
    let [first, _] = samples.first()?;
    let [last, _] = samples.last()?;
    let greatest_rpm = samples.iter().fold(0.0_f64, |most, [_, speed]| most.max(speed.abs()));
    let (rounding_rpm, held) = stairs(&samples).unwrap_or((0.0, 0.0));
    let noise_rpm = noise(&samples).max(MIN_NOISE_RATIO * greatest_rpm).max(rounding_rpm);
    // The least gain of a knot by the Bayesian information criterion, with its position as a
    // parameter. A step of the tachometer's digits is no reason for a knot.
    let worth = (3.0 * libm::log(samples.len() as f64)).max(2.0 * held) * noise_rpm * noise_rpm;
    let mut knots = vec![*first, *last];
    let mut speeds = fitted(&samples, &knots)?;
    while knots.len() < MAX_KNOTS {
        let further = further(&samples, &knots, &speeds, worth);
        if further.is_empty() {
            break;
        }
        knots.extend(further);
        knots.sort_by(f64::total_cmp);
        speeds = fitted(&samples, &knots)?;
    }
    let spin = |mut speeds: Vec<f64>| {
        let mut times = knots.clone();
        if *first > 0.0 {
            // The spline continues to the start of the run on the line of its first span, which
            // ends at zero.
            let slope = (speeds[1] - speeds[0]) / (knots[1] - knots[0]);
            let start = speeds[0] - slope * first;
            let [low, high] = [speeds[0].min(0.0), speeds[0].max(0.0)];
            times.insert(0, 0.0);
            speeds.insert(0, start.clamp(low, high));
        }
        Spin::Table { time_s: times, speed_rpm: speeds }
    };
    let (normal, _) = SplineEquations::from_samples(&samples, &knots);
    let usual = normal_draws(RANDOM_SPLINES);
    let draw = |point: u64| {
        let even: Vec<f64> = (0..knots.len()).map(|k| usual(point, k)).collect();
        let moved = normal.drawn(&even);
        spin(speeds.iter().zip(&moved).map(|(speed, moved)| speed + noise_rpm * moved).collect())
    };
    let drawn = (0..RANDOM_SPLINES).map(draw).collect();
    Some(SmoothedSpin { spin: spin(speeds), noise_rpm, knots: knots.len(), drawn })
}

/// Estimates the standard deviation of white noise about a smooth curve, from the median of the
/// distances of samples to the line through their neighbours. Jumps do not change the median.
fn noise(samples: &[[f64; 2]]) -> f64 {
    let distances = samples.windows(3).map(|three| {
        let share = (three[1][0] - three[0][0]) / (three[2][0] - three[0][0]);
        let [before, after] = [1.0 - share, share];
        let distance = three[1][1] - before * three[0][1] - after * three[2][1];
        distance.abs() / (1.0 + before * before + after * after).sqrt()
    });
    // The median of |x| of a normal distribution.
    quantile(distances, 0.5).map_or(0.0, |median| median / 0.674_489_75)
}

/// Returns the rounding error of a tachometer whose digits are coarser than its noise, and the
/// usual number of samples between changes of a digit. Neighbouring samples do not show the noise
/// of such a tachometer, because most of them are equal.
fn stairs(samples: &[[f64; 2]]) -> Option<(f64, f64)> {
    let steps = samples.windows(2).map(|pair| (pair[1][1] - pair[0][1]).abs());
    let steps = steps.filter(|step| *step > 0.0);
    let count = steps.clone().count();
    let step = quantile(steps, 0.5).filter(|_| 2 * count <= samples.len())?;
    Some((step / 12.0_f64.sqrt(), samples.len() as f64 / count as f64))
}

/// Returns the index of the span in which a time lies, and the part of the span before it.
fn place(knots: &[f64], time_s: f64) -> (usize, f64) {
    let span = knots.partition_point(|&knot| knot <= time_s).clamp(1, knots.len() - 1) - 1;
    (span, (time_s - knots[span]) / (knots[span + 1] - knots[span]))
}

/// The normal equations of a spline after elimination. Their matrix is tridiagonal.
struct SplineEquations {
    diagonal: Vec<f64>,
    factors: Vec<f64>,
}

impl SplineEquations {
    /// Computes the normal equations of splines with these knots, and their right side.
    fn from_samples(samples: &[[f64; 2]], knots: &[f64]) -> (Self, Vec<f64>) {
        let mut diagonal = vec![0.0; knots.len()];
        let mut beside = vec![0.0; knots.len()];
        let mut right = vec![0.0; knots.len()];
        for &[time, speed] in samples {
            let (k, share) = place(knots, time);
            let rest = 1.0 - share;
            diagonal[k] += rest * rest;
            diagonal[k + 1] += share * share;
            beside[k] += rest * share;
            right[k] += rest * speed;
            right[k + 1] += share * speed;
        }
        let mut factors = vec![0.0; knots.len()];
        for k in 1..knots.len() {
            factors[k - 1] = beside[k - 1] / diagonal[k - 1];
            diagonal[k] -= factors[k - 1] * beside[k - 1];
            right[k] -= factors[k - 1] * right[k - 1];
        }
        right.iter_mut().zip(&diagonal).for_each(|(right, size)| *right /= size);
        (Self { diagonal, factors }, right)
    }

    fn back(&self, mut right: Vec<f64>) -> Vec<f64> {
        for k in (1..right.len()).rev() {
            right[k - 1] -= self.factors[k - 1] * right[k];
        }
        right
    }

    /// Transforms independent numbers of variance 1 to numbers whose covariance is the inverse of
    /// the normal matrix.
    fn drawn(&self, even: &[f64]) -> Vec<f64> {
        self.back(even.iter().zip(&self.diagonal).map(|(even, size)| even / size.sqrt()).collect())
    }
}

/// Fits the spline's values at its knots, by least squares. `None` if they are not all determined.
fn fitted(samples: &[[f64; 2]], knots: &[f64]) -> Option<Vec<f64>> {
    let (normal, right) = SplineEquations::from_samples(samples, knots);
    let speeds = normal.back(right);
    speeds.iter().all(|speed| speed.is_finite()).then_some(speeds)
}

/// Finds the best further knot of each span in which it gains more than `worth`.
fn further(samples: &[[f64; 2]], knots: &[f64], speeds: &[f64], worth: f64) -> Vec<f64> {
    let mut found = Vec::new();
    for (span, ends) in knots.windows(2).enumerate() {
        let from = samples.partition_point(|[time, _]| *time < ends[0]);
        let to = samples.partition_point(|[time, _]| *time <= ends[1]);
        let inside = &samples[from..to];
        let mut best = (worth, None);
        for tried in 1..=TRIED_POSITIONS {
            let place = tried * inside.len() / (TRIED_POSITIONS + 1);
            // Each span keeps at least a few samples.
            if place < 3 || place + 4 > inside.len() {
                continue;
            }
            let knot = inside[place][0];
            let mut along = 0.0;
            let mut size = 0.0;
            for &[time, speed] in inside {
                let share = (time - ends[0]) / (ends[1] - ends[0]);
                let residual = speed - speeds[span] * (1.0 - share) - speeds[span + 1] * share;
                let hat = match time <= knot {
                    true => (time - ends[0]) / (knot - ends[0]),
                    false => (ends[1] - time) / (ends[1] - knot),
                };
                along += hat * residual;
                size += hat * hat;
            }
            let gain = along * along / size;
            if gain > best.0 {
                best = (gain, Some(knot));
            }
        }
        found.extend(best.1);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use sweep_engine::design::{Design, DesignRule, Distribution, DistributionShape};

    #[test]
    fn a_noisy_course_with_kinks_keeps_its_angle() {
        let course = |t: f64| if t < 7.3 { 40.0 * t } else { 292.0 - 20.0 * (t - 7.3) };
        let normal = Distribution {
            shape: DistributionShape::Normal { mean: 0.0, sd: 1.5 },
            from: -9.0,
            to: 9.0,
        };
        let noise = Design::Spread { rule: DesignRule::MonteCarlo, points: 0, seed: 5 };
        let time_s: Vec<f64> = (0..3000).map(|k| 0.003 + 0.004 * f64::from(k)).collect();
        let speed: Vec<f64> = time_s
            .iter()
            .enumerate()
            .map(|(k, t)| course(*t) + normal.quantile(noise.position(k as u64, 0).unwrap()))
            .collect();
        let found = smoothed(&time_s, &speed).unwrap();
        assert!((found.noise_rpm - 1.5).abs() < 0.1, "{found:?}");
        assert!((3..12).contains(&found.knots), "{found:?}");
        // At the end of a straight span of n samples: a variance of 4 / n.
        let Spin::Table { time_s: knots, .. } = &found.spin else { panic!("{found:?}") };
        let span = (knots[knots.len() - 1] - knots[knots.len() - 2]) / 0.004;
        let end = |spin: &Spin| spin.speeds_rpm([time_s[2999]]).next().unwrap();
        let middle = end(&found.spin);
        let square: f64 = found.drawn.iter().map(|spin| (end(spin) - middle).powi(2)).sum();
        let error = (square / found.drawn.len() as f64).sqrt() / (1.5 * (4.0 / span).sqrt());
        assert!((0.5..2.0).contains(&error), "{error}");
        let mut angle = 0.0_f64;
        let mut worst = 0.0_f64;
        for (t, ours) in time_s.iter().zip(found.spin.speeds_rpm(time_s.iter().copied())) {
            angle += (ours - course(*t)) / 60.0 * 0.004;
            worst = worst.max(angle.abs());
        }
        // Turns; the noise itself wanders by 1.5 / 60 sqrt(12 * 0.004) = 5e-3.
        assert!(worst < 0.01, "{worst}");
        let exact: Vec<f64> = time_s.iter().map(|t| course(*t)).collect();
        let found = smoothed(&time_s, &exact).unwrap();
        let apart = time_s
            .iter()
            .zip(found.spin.speeds_rpm(time_s.iter().copied()))
            .fold(0.0_f64, |most, (t, ours)| most.max((ours - course(*t)).abs()));
        assert!(apart < 0.2, "{apart}: {found:?}");
        // Stairs of whole digits are no course.
        for digit in [1.0, 5.0] {
            let rounded: Vec<f64> =
                time_s.iter().map(|t| (course(*t) / digit).round() * digit).collect();
            let found = smoothed(&time_s, &rounded).unwrap();
            assert!((found.noise_rpm / digit - 12.0_f64.sqrt().recip()).abs() < 1e-9, "{found:?}");
            assert!(found.knots < 12, "{digit}: {found:?}");
        }
    }
}

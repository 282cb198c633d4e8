//! The spectrum of a residual, in which a motion without a model is a peak above the noise.
//!
//! P. D. Welch, IEEE Transactions on Audio and Electroacoustics 15 (1967), 70-73.

use std::f64::consts::TAU;

use super::algebra::dot;

/// The length (s) of the segments whose powers are averaged; they overlap by half. Basis: it
/// resolves half a hertz. Doubling it resolves finer lines in more noise.
const SEGMENT_S: f64 = 4.0;
/// The greatest frequency (Hz). Basis: no suspension moves faster. Doubling it doubles the size of
/// the spectrum.
const MAX_FREQUENCY_HZ: f64 = 50.0;

/// Computes the frequencies (Hz) and the square root of the power density of equally spaced values.
pub(crate) fn compute_spectrum(values: &[f64], step_s: f64) -> (Vec<f64>, Vec<f64>) {
    let length = ((SEGMENT_S / step_s).round() as usize).clamp(2, values.len().max(2));
    let angle = |k: usize| TAU * k as f64 / length as f64;
    let circle: Vec<(f64, f64)> = (0..length).map(|k| libm::sincos(angle(k))).collect();
    let window: Vec<f64> = circle.iter().map(|(_, cos)| 0.5 - 0.5 * cos).collect();
    let size = dot(&window, &window);
    let segments: Vec<&[f64]> = values.windows(length).step_by(length.div_ceil(2)).collect();
    let hz = |bin: usize| bin as f64 / (length as f64 * step_s);
    let bins = 1..=(1..=length / 2).take_while(|&bin| hz(bin) <= MAX_FREQUENCY_HZ).count();
    let density = |bin: usize| {
        let power = |segment: &&[f64]| {
            let mut cosine_sum = 0.0;
            let mut sine_sum = 0.0;
            for (k, (value, weight)) in segment.iter().zip(&window).enumerate() {
                let (sin, cos) = circle[k * bin % length];
                cosine_sum += weight * value * cos;
                sine_sum += weight * value * sin;
            }
            cosine_sum * cosine_sum + sine_sum * sine_sum
        };
        let mean = segments.iter().map(power).sum::<f64>() / segments.len().max(1) as f64;
        (2.0 * step_s * mean / size).sqrt()
    };
    (bins.clone().map(hz).collect(), bins.map(density).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use sweep_engine::design::{Design, DesignRule, Distribution, DistributionShape};

    #[test]
    fn a_tone_stands_at_its_frequency_above_even_noise() {
        let normal = Distribution {
            shape: DistributionShape::Normal { mean: 0.0, sd: 0.3 },
            from: -6.0,
            to: 6.0,
        };
        let noise = Design::Spread { rule: DesignRule::MonteCarlo, points: 0, seed: 3 };
        let value = |k: u64| {
            let tone = (TAU * 6.25 * 0.002 * k as f64).sin();
            tone + normal.quantile(noise.position(k, 0).unwrap())
        };
        let values: Vec<f64> = (0..12_000).map(value).collect();
        let (hz, density) = compute_spectrum(&values, 0.002);
        assert!(hz.len() == 200 && hz[199] == 50.0, "{hz:?}");
        let most = (0..200).max_by(|&a, &b| density[a].total_cmp(&density[b])).unwrap();
        assert_eq!(hz[most], 6.25);
        // White noise has its variance evenly up to half the rate of samples.
        let above = density[60..].iter().map(|x| x * x).sum::<f64>() / 140.0;
        assert!((above / (0.09 / 250.0) - 1.0).abs() < 0.1, "{above}");
    }
}

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
    let segment_samples = ((SEGMENT_S / step_s).round() as usize).clamp(2, values.len().max(2));
    let sample_angle = |k: usize| TAU * k as f64 / segment_samples as f64;
    let cosines_and_sines: Vec<(f64, f64)> =
        (0..segment_samples).map(|k| libm::sincos(sample_angle(k))).collect();
    let hann_window: Vec<f64> = cosines_and_sines.iter().map(|(_, cos)| 0.5 - 0.5 * cos).collect();
    let window_energy = dot(&hann_window, &hann_window);
    let segments: Vec<&[f64]> =
        values.windows(segment_samples).step_by(segment_samples.div_ceil(2)).collect();
    let bin_frequency_hz = |bin: usize| bin as f64 / (segment_samples as f64 * step_s);
    let bin_range = 1..=(1..=segment_samples / 2)
        .take_while(|&bin| bin_frequency_hz(bin) <= MAX_FREQUENCY_HZ)
        .count();
    let root_density = |bin: usize| {
        let segment_power = |segment: &&[f64]| {
            let mut cosine_sum = 0.0;
            let mut sine_sum = 0.0;
            for (k, (value, weight)) in segment.iter().zip(&hann_window).enumerate() {
                let (sin, cos) = cosines_and_sines[k * bin % segment_samples];
                cosine_sum += weight * value * cos;
                sine_sum += weight * value * sin;
            }
            cosine_sum * cosine_sum + sine_sum * sine_sum
        };
        let mean_power =
            segments.iter().map(segment_power).sum::<f64>() / segments.len().max(1) as f64;
        (2.0 * step_s * mean_power / window_energy).sqrt()
    };
    (bin_range.clone().map(bin_frequency_hz).collect(), bin_range.map(root_density).collect())
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
        let noise_design = Design::Spread { rule: DesignRule::MonteCarlo, points: 0, seed: 3 };
        let noisy_tone = |k: u64| {
            let tone = (TAU * 6.25 * 0.002 * k as f64).sin();
            tone + normal.quantile(noise_design.position(k, 0).unwrap())
        };
        let values: Vec<f64> = (0..12_000).map(noisy_tone).collect();
        let (frequencies_hz, densities) = compute_spectrum(&values, 0.002);
        assert!(frequencies_hz.len() == 200 && frequencies_hz[199] == 50.0, "{frequencies_hz:?}");
        let peak_bin = (0..200).max_by(|&a, &b| densities[a].total_cmp(&densities[b])).unwrap();
        assert_eq!(frequencies_hz[peak_bin], 6.25);
        // White noise has its variance evenly up to half the rate of samples.
        let noise_density = densities[60..].iter().map(|x| x * x).sum::<f64>() / 140.0;
        assert!((noise_density / (0.09 / 250.0) - 1.0).abs() < 0.1, "{noise_density}");
    }
}

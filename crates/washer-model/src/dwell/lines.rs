//! The strongest line in the spectrum of states that are sampled once a turn.

use core::array::from_fn;
use core::f64::consts::TAU;

/// Number of trial frequencies for every sample. Basis: half the width of a line. Doubling it
/// doubles the time of the search.
const TRIALS_PER_SAMPLE: usize = 2;

/// Number of frequencies that are computed side by side. Basis: the lanes of the widest vectors.
/// Doubling it changes the time only.
const FREQUENCIES_PER_PASS: usize = 8;

/// Number of rounds of the ternary search for a line's frequency. Basis: 1e-7 of the first
/// interval. Doubling it reaches rounding.
const TERNARY_SEARCH_ROUNDS: usize = 40;

/// Number of harmonics of a line that are subtracted from a signal. Doubling it reduces the
/// residual of curves with sharp bends.
const HARMONICS: usize = 12;

/// Number of passes in each of which all harmonics are subtracted. Basis: windowed lines overlap,
/// so that one pass leaves a part of each line. Doubling it reduces the residual.
const SUBTRACTION_PASSES: usize = 4;

/// The strongest line in the spectrum of several signals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SpectralLine {
    /// The frequency from 0 to a half, in cycles per sample.
    pub(super) frequency: f64,
    /// The root mean square of the signals without the line and its multiples, relative to that of
    /// the signals.
    pub(super) residual: f64,
}

/// Returns the weight of sample `n` of `sample_count` in Hann's window.
fn hann_window(n: usize, sample_count: usize) -> f64 {
    let sin = libm::sin(0.5 * TAU * (n as f64 + 0.5) / sample_count as f64);
    sin * sin
}

/// Returns the weighted means of a signal times exp(-2 pi i f n) at some frequencies f.
fn fourier_means<const M: usize>(
    signal: &[f64],
    hann_weights: &[f64],
    frequencies: [f64; M],
) -> [[f64; 2]; M] {
    let sin = frequencies.map(|frequency| libm::sin(TAU * frequency));
    let cos = frequencies.map(|frequency| libm::cos(TAU * frequency));
    let mut re = [1.0_f64; M];
    let mut im = [0.0_f64; M];
    let mut sums = [[0.0; 2]; M];
    let mut weight_sum = 0.0;
    for (value, hann_weight) in signal.iter().zip(hann_weights) {
        let weighted_value = hann_weight * value;
        weight_sum += hann_weight;
        for k in 0..M {
            sums[k][0] += weighted_value * re[k];
            sums[k][1] -= weighted_value * im[k];
            (re[k], im[k]) = (re[k] * cos[k] - im[k] * sin[k], re[k] * sin[k] + im[k] * cos[k]);
        }
    }
    sums.map(|sum| sum.map(|component| component / weight_sum))
}

/// Returns the power of all signals together at some frequencies.
fn signal_powers<const M: usize>(
    signals: &[Vec<f64>],
    hann_weights: &[f64],
    frequencies: [f64; M],
) -> [f64; M] {
    let mut total_powers = [0.0; M];
    for signal in signals {
        for (power, [re, im]) in
            total_powers.iter_mut().zip(fourier_means(signal, hann_weights, frequencies))
        {
            *power += re * re + im * im;
        }
    }
    total_powers
}

/// Returns the strongest line of signals of equal length, after their means are subtracted; `None`
/// if the signals are too short or constant.
pub(super) fn find_strongest_line(signals: &[Vec<f64>]) -> Option<SpectralLine> {
    let sample_count = signals.first()?.len();
    let hann_weights: Vec<f64> = (0..sample_count).map(|n| hann_window(n, sample_count)).collect();
    let mut residuals = signals.to_vec();
    for signal in &mut residuals {
        let [[mean, _]] = fourier_means(signal, &hann_weights, [0.0]);
        signal.iter_mut().for_each(|value| *value -= mean);
    }
    let weighted_power = |signals: &[Vec<f64>]| -> f64 {
        let signal_power = |signal: &Vec<f64>| -> f64 {
            signal
                .iter()
                .zip(&hann_weights)
                .map(|(value, hann_weight)| hann_weight * value * value)
                .sum()
        };
        signals.iter().map(signal_power).sum()
    };
    let total_power = weighted_power(&residuals);
    let frequency_at =
        |trial: usize| 0.5 * trial as f64 / (TRIALS_PER_SAMPLE * sample_count) as f64;
    // The lowest frequencies are excluded, because the mean dominates them.
    let trials: Vec<usize> =
        (2 * TRIALS_PER_SAMPLE * 2..=TRIALS_PER_SAMPLE * sample_count).collect();
    let mut strongest_power_and_trial = (0.0, *trials.first()?);
    for trials in trials.chunks(FREQUENCIES_PER_PASS) {
        let frequencies = from_fn::<_, FREQUENCIES_PER_PASS, _>(|k| {
            frequency_at(trials[k.min(trials.len() - 1)])
        });
        let frequency_powers = signal_powers(&residuals, &hann_weights, frequencies);
        let trial_powers = frequency_powers.into_iter().zip(trials.iter().copied());
        strongest_power_and_trial =
            trial_powers.fold(strongest_power_and_trial, |strongest_power_and_trial, trial| {
                if trial.0 < strongest_power_and_trial.0 {
                    strongest_power_and_trial
                } else {
                    trial
                }
            });
    }
    let (_, strongest_trial) = strongest_power_and_trial;
    let mut min_frequency = frequency_at(strongest_trial - 1);
    let mut max_frequency = frequency_at(strongest_trial + 1).min(0.5);
    for _ in 0..TERNARY_SEARCH_ROUNDS {
        let third_of_interval = (max_frequency - min_frequency) / 3.0;
        let [lower_power, upper_power] = signal_powers(
            &residuals,
            &hann_weights,
            [min_frequency + third_of_interval, max_frequency - third_of_interval],
        );
        if lower_power < upper_power {
            min_frequency += third_of_interval;
        } else {
            max_frequency -= third_of_interval;
        }
    }
    let frequency = 0.5 * (min_frequency + max_frequency);
    let harmonics: Vec<Harmonic> = (0..=HARMONICS)
        .map(|k| Harmonic::new((k as f64 * frequency).fract(), sample_count))
        .collect();
    for _ in 0..SUBTRACTION_PASSES {
        for harmonic in &harmonics {
            for signal in &mut residuals {
                harmonic.subtract_from(signal, &hann_weights);
            }
        }
    }
    let residual = (weighted_power(&residuals) / total_power).sqrt();
    (residual.is_finite()).then_some(SpectralLine { frequency, residual })
}

/// A line at a multiple of a frequency.
struct Harmonic {
    /// The frequency without whole cycles per sample.
    frequency: f64,
    /// The cosine and the sine of the phase at every sample.
    wave: Vec<[f64; 2]>,
}

impl Harmonic {
    fn new(frequency: f64, sample_count: usize) -> Self {
        let phase = |n: usize| TAU * (frequency * n as f64).fract();
        let wave = (0..sample_count).map(phase).map(|phase| [libm::cos(phase), libm::sin(phase)]);
        Self { frequency, wave: wave.collect() }
    }

    fn subtract_from(&self, signal: &mut [f64], hann_weights: &[f64]) {
        let [[re, im]] = fourier_means(signal, hann_weights, [self.frequency]);
        // A real signal also has a line at the negative frequency. Both lines coincide at the
        // frequencies 0 and 0.5.
        let frequency_distance =
            self.frequency.min((self.frequency - 0.5).abs()).min(1.0 - self.frequency);
        let line_count = if frequency_distance < 1.0 / signal.len() as f64 { 1.0 } else { 2.0 };
        for (value, [cos, sin]) in signal.iter_mut().zip(&self.wave) {
            *value -= line_count * (re * cos - im * sin);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_closed_curve_has_only_a_line_and_its_multiples() {
        let sample_signal = |f: &dyn Fn(f64) -> f64| (0..256).map(|n| f(f64::from(n))).collect();
        let frequency = 0.371_3;
        let curve_signal: Vec<f64> = sample_signal(&|n| {
            let phase = TAU * frequency * n;
            phase.cos() / (1.3 - 0.3 * phase.sin())
        });
        let line = find_strongest_line(std::slice::from_ref(&curve_signal)).unwrap();
        assert!((line.frequency - frequency).abs() < 1e-6 && line.residual < 0.01, "{line:?}");
        let mut x = 0.3;
        let noise: Vec<f64> = sample_signal(&|_| 0.0)
            .into_iter()
            .map(|_: f64| {
                x = 3.99 * x * (1.0 - x);
                x
            })
            .collect();
        let line = find_strongest_line(&[noise]).unwrap();
        assert!(line.residual > 0.3, "{line:?}");
    }
}

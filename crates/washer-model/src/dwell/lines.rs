//! Lines in the spectrum of states once a turn.

use core::array::from_fn;
use core::f64::consts::TAU;

/// Trials of a frequency for every sample.
const TRIALS: usize = 2;

/// Frequencies tried side by side.
const AT_ONCE: usize = 8;

/// Rounds in which the interval around a line shrinks to two thirds.
const ROUNDS: usize = 40;

/// Multiples of a frequency that are taken out of a signal, and how often.
const HARMONICS: usize = 12;
const SWEEPS: usize = 4;

/// The strongest line of some signals, and how much of them is not of its multiples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Line {
    /// From 0 to a half, in cycles a sample.
    pub(super) frequency: f64,
    /// Root mean square of the rest, as a share.
    pub(super) rest: f64,
}

/// Hann's window.
fn window(n: usize, count: usize) -> f64 {
    let sin = libm::sin(0.5 * TAU * (n as f64 + 0.5) / count as f64);
    sin * sin
}

/// The means of a signal times exp(-2 pi i f n), through the window, at some frequencies.
fn parts<const M: usize>(signal: &[f64], windows: &[f64], frequencies: [f64; M]) -> [[f64; 2]; M] {
    let sin = frequencies.map(|frequency| libm::sin(TAU * frequency));
    let cos = frequencies.map(|frequency| libm::cos(TAU * frequency));
    let (mut re, mut im) = ([1.0_f64; M], [0.0_f64; M]);
    let (mut sums, mut whole) = ([[0.0; 2]; M], 0.0);
    for (value, window) in signal.iter().zip(windows) {
        let seen = window * value;
        whole += window;
        for k in 0..M {
            sums[k][0] += seen * re[k];
            sums[k][1] -= seen * im[k];
            (re[k], im[k]) = (re[k] * cos[k] - im[k] * sin[k], re[k] * sin[k] + im[k] * cos[k]);
        }
    }
    sums.map(|sum| sum.map(|part| part / whole))
}

/// The power of signals at some frequencies.
fn powers<const M: usize>(
    signals: &[Vec<f64>],
    windows: &[f64],
    frequencies: [f64; M],
) -> [f64; M] {
    let mut powers = [0.0; M];
    for signal in signals {
        for (power, [re, im]) in powers.iter_mut().zip(parts(signal, windows, frequencies)) {
            *power += re * re + im * im;
        }
    }
    powers
}

/// The strongest line of signals of one length.
pub(super) fn strongest(signals: &[Vec<f64>]) -> Option<Line> {
    let count = signals.first()?.len();
    let windows: Vec<f64> = (0..count).map(|n| window(n, count)).collect();
    let mut rests = signals.to_vec();
    for signal in &mut rests {
        let [[mean, _]] = parts(signal, &windows, [0.0]);
        signal.iter_mut().for_each(|value| *value -= mean);
    }
    let squares = |signals: &[Vec<f64>]| -> f64 {
        let square = |signal: &Vec<f64>| -> f64 {
            signal.iter().zip(&windows).map(|(value, window)| window * value * value).sum()
        };
        signals.iter().map(square).sum()
    };
    let whole = squares(&rests);
    let at = |trial: usize| 0.5 * trial as f64 / (TRIALS * count) as f64;
    // Two samples of the mean's own line are left out.
    let trials: Vec<usize> = (2 * TRIALS * 2..=TRIALS * count).collect();
    let mut best = (0.0, *trials.first()?);
    for trials in trials.chunks(AT_ONCE) {
        let frequencies = from_fn::<_, AT_ONCE, _>(|k| at(trials[k.min(trials.len() - 1)]));
        let powers = powers(&rests, &windows, frequencies);
        let found = powers.into_iter().zip(trials.iter().copied());
        best = found.fold(best, |best, found| if found.0 < best.0 { best } else { found });
    }
    let (_, best) = best;
    let (mut low, mut high) = (at(best - 1), at(best + 1).min(0.5));
    for _ in 0..ROUNDS {
        let third = (high - low) / 3.0;
        let [below, above] = powers(&rests, &windows, [low + third, high - third]);
        if below < above {
            low += third;
        } else {
            high -= third;
        }
    }
    let frequency = 0.5 * (low + high);
    let multiples: Vec<Multiple> =
        (0..=HARMONICS).map(|k| Multiple::new((k as f64 * frequency).fract(), count)).collect();
    for _ in 0..SWEEPS {
        for multiple in &multiples {
            for signal in &mut rests {
                multiple.take_out(signal, &windows);
            }
        }
    }
    let rest = (squares(&rests) / whole).sqrt();
    (rest.is_finite()).then_some(Line { frequency, rest })
}

/// A line of given frequency.
struct Multiple {
    frequency: f64,
    /// Cosine and sine of its phase at every sample.
    wave: Vec<[f64; 2]>,
}

impl Multiple {
    fn new(frequency: f64, count: usize) -> Self {
        let phase = |n: usize| TAU * (frequency * n as f64).fract();
        let wave = (0..count).map(phase).map(|phase| [libm::cos(phase), libm::sin(phase)]);
        Self { frequency, wave: wave.collect() }
    }

    fn take_out(&self, signal: &mut [f64], windows: &[f64]) {
        let [[re, im]] = parts(signal, windows, [self.frequency]);
        // At 0 and at a half the line is its own mirror image.
        let away = self.frequency.min((self.frequency - 0.5).abs()).min(1.0 - self.frequency);
        let twice = if away < 1.0 / signal.len() as f64 { 1.0 } else { 2.0 };
        for (value, [cos, sin]) in signal.iter_mut().zip(&self.wave) {
            *value -= twice * (re * cos - im * sin);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_and_its_multiples_are_all_of_a_closed_curve() {
        let signal = |f: &dyn Fn(f64) -> f64| (0..256).map(|n| f(f64::from(n))).collect();
        let frequency = 0.371_3;
        let curve: Vec<f64> = signal(&|n| {
            let phase = TAU * frequency * n;
            phase.cos() / (1.3 - 0.3 * phase.sin())
        });
        let line = strongest(std::slice::from_ref(&curve)).unwrap();
        assert!((line.frequency - frequency).abs() < 1e-6 && line.rest < 0.01, "{line:?}");
        let mut x = 0.3;
        let noise: Vec<f64> = signal(&|_| 0.0)
            .into_iter()
            .map(|_: f64| {
                x = 3.99 * x * (1.0 - x);
                x
            })
            .collect();
        let line = strongest(&[noise]).unwrap();
        assert!(line.rest > 0.3, "{line:?}");
    }
}

//! Lines in the spectrum of states once a turn.

use core::f64::consts::TAU;

/// Trials of a frequency for every sample.
const TRIALS: usize = 2;

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

/// The mean of a signal times exp(-2 pi i f n), through the window.
fn part(signal: &[f64], windows: &[f64], frequency: f64) -> [f64; 2] {
    let (sin, cos) = (libm::sin(TAU * frequency), libm::cos(TAU * frequency));
    let (mut re, mut im) = (1.0_f64, 0.0_f64);
    let mut sum = [0.0; 3];
    for (value, window) in signal.iter().zip(windows) {
        sum[0] += window * value * re;
        sum[1] -= window * value * im;
        sum[2] += window;
        (re, im) = (re * cos - im * sin, re * sin + im * cos);
    }
    [sum[0] / sum[2], sum[1] / sum[2]]
}

/// The strongest line of signals of one length.
pub(super) fn strongest(signals: &[Vec<f64>]) -> Option<Line> {
    let count = signals.first()?.len();
    let windows: Vec<f64> = (0..count).map(|n| window(n, count)).collect();
    let mut rests = signals.to_vec();
    for signal in &mut rests {
        let [mean, _] = part(signal, &windows, 0.0);
        signal.iter_mut().for_each(|value| *value -= mean);
    }
    let squares = |signals: &[Vec<f64>]| -> f64 {
        let square = |signal: &Vec<f64>| -> f64 {
            signal.iter().zip(&windows).map(|(value, window)| window * value * value).sum()
        };
        signals.iter().map(square).sum()
    };
    let whole = squares(&rests);
    let power = |frequency: f64| -> f64 {
        let of = |signal: &Vec<f64>| {
            let [re, im] = part(signal, &windows, frequency);
            re * re + im * im
        };
        rests.iter().map(of).sum()
    };
    // Two samples of the mean's own line are left out.
    let trials = TRIALS * count;
    let at = |trial: usize| 0.5 * trial as f64 / trials as f64;
    let best = (2 * TRIALS * 2..=trials).max_by(|&a, &b| power(at(a)).total_cmp(&power(at(b))))?;
    let (mut low, mut high) = (at(best - 1), at(best + 1).min(0.5));
    for _ in 0..ROUNDS {
        let third = (high - low) / 3.0;
        if power(low + third) < power(high - third) {
            low += third;
        } else {
            high -= third;
        }
    }
    let frequency = 0.5 * (low + high);
    for _ in 0..SWEEPS {
        for harmonic in 0..=HARMONICS {
            let of = (harmonic as f64 * frequency).fract();
            for signal in &mut rests {
                take_out(signal, &windows, of);
            }
        }
    }
    let rest = (squares(&rests) / whole).sqrt();
    (rest.is_finite()).then_some(Line { frequency, rest })
}

/// Takes a line out of a signal.
fn take_out(signal: &mut [f64], windows: &[f64], frequency: f64) {
    let [re, im] = part(signal, windows, frequency);
    // At 0 and at a half the line is its own mirror image.
    let away = frequency.min((frequency - 0.5).abs()).min(1.0 - frequency);
    let twice = if away < 1.0 / signal.len() as f64 { 1.0 } else { 2.0 };
    for (n, value) in signal.iter_mut().enumerate() {
        let phase = TAU * (frequency * n as f64).fract();
        *value -= twice * (re * libm::cos(phase) - im * libm::sin(phase));
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

//! Tests of the error of peaks that are found from steps.

use crate::{N, Peaks, Sample};
use core::f64::consts::TAU;

/// A sum of two sine waves, with its first two derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Waves {
    pub(super) amplitude: [f64; 2],
    pub(super) frequency: [f64; 2],
    pub(super) phase: [f64; 2],
}

impl Waves {
    fn derivatives(&self, t: f64) -> [f64; 3] {
        let mut y = [0.0; 3];
        for k in 0..2 {
            let a = self.amplitude[k];
            let w = self.frequency[k];
            let (sin, cos) = (w * t + self.phase[k]).sin_cos();
            y[0] += a * sin;
            y[1] += a * w * cos;
            y[2] -= a * w * w * sin;
        }
        y
    }

    /// Computes the largest magnitude from 0 to `end_s`: the largest on a fine grid, refined by
    /// Newton's method.
    fn exact_peak(&self, end_s: f64) -> f64 {
        let cell_count = 4000;
        let step = end_s / f64::from(cell_count);
        let magnitude = |i: i32| self.derivatives(step * f64::from(i))[0].abs();
        let largest_index =
            (0..=cell_count).max_by(|&i, &j| magnitude(i).total_cmp(&magnitude(j))).unwrap();
        let mut t = step * f64::from(largest_index);
        for _ in 0..20 {
            let [_, slope, curvature] = self.derivatives(t);
            t -= slope / curvature;
        }
        let is_inside =
            (0.0..=end_s).contains(&t) && (t - step * f64::from(largest_index)).abs() <= step;
        if is_inside {
            self.derivatives(t)[0].abs().max(magnitude(largest_index))
        } else {
            magnitude(largest_index)
        }
    }

    pub(super) fn sample(&self, t: f64) -> Sample<f64> {
        let [value, slope, curvature] = self.derivatives(t).map(N);
        Sample { value, slope, curvature }
    }

    /// Returns the peak that [`Peaks`] determines in `steps` equal steps.
    fn sampled_peak(&self, end_s: f64, steps: u32) -> f64 {
        self.sampled_peak_by(Peaks::advance, end_s, steps)
    }

    /// Returns the peak that [`Peaks`] determines in `steps` equal steps by the method `advance`.
    fn sampled_peak_by(&self, advance: Advance, end_s: f64, steps: u32) -> f64 {
        let h = end_s / f64::from(steps);
        let mut peaks = Peaks::<f64, 1>::new(N(0.0));
        peaks.begin(&[self.sample(0.0)], true);
        for i in 1..=steps {
            advance(&mut peaks, N(h), &[self.sample(h * f64::from(i))], true);
        }
        peaks.lane_peaks(0)[0]
    }
}

type Advance = fn(&mut Peaks<f64, 1>, N<f64>, &[Sample<f64>; 1], bool);

/// Returns the largest error relative to the amplitude, over many sums of a wave of unit frequency
/// and a slower one.
fn largest_error(steps_per_period: u32) -> f64 {
    largest_error_by(Peaks::advance, steps_per_period)
}

/// Returns the largest error like [`largest_error`], by the method `advance`.
fn largest_error_by(advance: Advance, steps_per_period: u32) -> f64 {
    let mut rng = fastrand::Rng::with_seed(7);
    let mut max_error = 0.0_f64;
    for _ in 0..400 {
        let waves = Waves {
            amplitude: [1.0, 0.3 * rng.f64()],
            frequency: [TAU, TAU * (0.2 + 0.8 * rng.f64())],
            phase: [TAU * rng.f64(), TAU * rng.f64()],
        };
        let periods = 3;
        let exact_peak = waves.exact_peak(f64::from(periods));
        let sampled_peak =
            waves.sampled_peak_by(advance, f64::from(periods), periods * steps_per_period);
        max_error = max_error.max((sampled_peak - exact_peak).abs() / exact_peak);
    }
    max_error
}

#[test]
fn the_sampling_error_stays_below_1e_5_down_to_ten_steps_a_period() {
    // The longest steps that the washing machine's models take are 6.25 ms at 350 rpm, or 27 steps
    // in a turn.
    for steps in [10, 12, 16, 27, 100] {
        let error = largest_error(steps);
        eprintln!("{steps} steps a period: {error:.2e} of the amplitude");
        assert!(error < 1e-5, "{steps} steps a period: {error:e}");
    }
}

#[test]
fn the_sampling_error_is_of_sixth_order() {
    let [coarse_error, fine_error] = [12, 24].map(largest_error);
    let observed_order = (coarse_error / fine_error).log2();
    eprintln!("order of a peak's sampling error: {observed_order:.2}");
    assert!(observed_order > 5.5, "{observed_order}");
}

#[test]
fn without_curvatures_the_sampling_error_is_of_fourth_order() {
    let [coarse_error, fine_error] =
        [24, 48].map(|steps| largest_error_by(Peaks::advance_by_slopes, steps));
    let observed_order = (coarse_error / fine_error).log2();
    eprintln!(
        "without curvatures, 48 steps a period: {fine_error:.2e} of the amplitude, order \
         {observed_order:.2}"
    );
    assert!(observed_order > 3.5 && fine_error < 1e-5, "{observed_order} {fine_error:e}");
}

#[test]
fn samples_alone_miss_the_peak() {
    // Interpolation inside steps finds the peak between the samples.
    let waves = Waves { amplitude: [1.0, 0.0], frequency: [TAU, 1.0], phase: [0.4, 0.0] };
    let samples =
        (0..=20).map(|i| waves.derivatives(f64::from(i) / 10.0)[0].abs()).fold(0.0, f64::max);
    assert!(1.0 - samples > 1e-3);
    assert!((waves.sampled_peak(2.0, 20) - 1.0).abs() < 1e-5);
}

#[test]
fn a_peak_outside_the_window_does_not_count() {
    let waves = Waves { amplitude: [1.0, 0.0], frequency: [TAU, 1.0], phase: [0.0, 0.0] };
    let mut peaks = Peaks::<f64, 1>::new(N(0.0));
    peaks.begin(&[waves.sample(0.0)], false);
    // The step over the crest at 1/4 is outside the window, the step down from it is inside.
    let descending_sample = waves.sample(0.35);
    peaks.advance(N(0.35), &[descending_sample], false);
    peaks.begin(&[descending_sample], true);
    peaks.advance(N(0.1), &[waves.sample(0.45)], true);
    assert_eq!(peaks.lane_peaks(0)[0], descending_sample.value.0);
    peaks.reset(0);
    assert_eq!(peaks.lane_peaks(0)[0], 0.0);
}

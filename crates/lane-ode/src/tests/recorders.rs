//! Tests of interval peaks, mean squares and times above zero on waves with known results.

use super::array::Array;
use super::peaks::Waves;
use crate::{IntervalPeaks, Lane, N, Peaks, Sample, SquareIntegrals, TimeAbove};
use core::f64::consts::TAU;

fn random_waves(seed: u64) -> Waves {
    let mut rng = fastrand::Rng::with_seed(seed);
    Waves {
        amplitude: [1.0, 0.3 * rng.f64()],
        frequency: [TAU, TAU * (0.2 + 0.8 * rng.f64())],
        phase: [TAU * rng.f64(), TAU * rng.f64()],
    }
}

/// Returns the peaks of the parts between division times, from `steps` equal steps over 0 to
/// `end_s`.
fn part_peaks(waves: &Waves, division_times_s: &[f64], end_s: f64, steps: u32) -> Vec<f64> {
    let h = end_s / f64::from(steps);
    let mut peaks = IntervalPeaks::<f64, 1>::new(N(0.0));
    peaks.reset(0, division_times_s);
    peaks.begin(&[waves.sample(0.0)], true);
    for i in 1..=steps {
        let t = h * f64::from(i);
        peaks.advance(N(t), N(h), &[waves.sample(t)], true);
    }
    peaks.finish(0).into_iter().map(|[peak]| peak).collect()
}

/// Returns the peak between two times, from steps that end at both.
fn peak_between(waves: &Waves, start_s: f64, end_s: f64) -> f64 {
    const STEPS: u32 = 4000;
    let h = (end_s - start_s) / f64::from(STEPS);
    let mut peaks = Peaks::<f64, 1>::new(N(0.0));
    peaks.begin(&[waves.sample(start_s)], true);
    for i in 1..=STEPS {
        peaks.advance(N(h), &[waves.sample(start_s + h * f64::from(i))], true);
    }
    peaks.lane_peaks(0)[0]
}

#[test]
fn the_peak_of_a_part_is_that_of_a_separate_trajectory() {
    // The division times are at the end of a step, one step apart, several within a step, and far
    // apart.
    let division_times_s = [0.5, 0.71, 0.775, 0.78, 0.79, 1.7, 4.3];
    let boundaries_s: Vec<f64> = [0.0].into_iter().chain(division_times_s).chain([5.0]).collect();
    for seed in 0..20 {
        let waves = random_waves(seed);
        let peaks = part_peaks(&waves, &division_times_s, 5.0, 100);
        assert_eq!(peaks.len(), division_times_s.len() + 1);
        for (peak, part_bounds_s) in peaks.iter().zip(boundaries_s.windows(2)) {
            let expected_peak = peak_between(&waves, part_bounds_s[0], part_bounds_s[1]);
            assert!(
                (peak - expected_peak).abs() < 1e-6,
                "{part_bounds_s:?}: {peak} for {expected_peak}"
            );
        }
    }
    assert_eq!(part_peaks(&random_waves(1), &[], 5.0, 100).len(), 1);
}

#[test]
fn the_parts_of_a_lane_do_not_depend_on_division_times_of_other_lanes() {
    let division_times_s = [vec![0.3, 0.33, 2.0], vec![], vec![0.301, 1.999]];
    let mut combined_peaks = IntervalPeaks::<Array<3>, 1>::new(N(Array([0.0; 3])));
    let waves_by_lane: Vec<Waves> = (0..3).map(random_waves).collect();
    let sample_at = |t: f64| {
        let mut lanes = Sample::constant(N(Array([0.0; 3])), N(Array([0.0; 3])));
        for (lane, waves) in waves_by_lane.iter().enumerate() {
            let sample_of_wave = waves.sample(t);
            lanes.value.0.set(lane, sample_of_wave.value.0);
            lanes.slope.0.set(lane, sample_of_wave.slope.0);
            lanes.curvature.0.set(lane, sample_of_wave.curvature.0);
        }
        [lanes]
    };
    for (lane, lane_times_s) in division_times_s.iter().enumerate() {
        combined_peaks.reset(lane, lane_times_s);
    }
    combined_peaks.begin(&sample_at(0.0), [true; 3]);
    for i in 1..=60 {
        let t = 0.05 * f64::from(i);
        let h = N(Array([0.05; 3]));
        combined_peaks.advance(N(Array([t; 3])), h, &sample_at(t), [true; 3]);
    }
    for lane in 0..3 {
        let mut separate_peaks = IntervalPeaks::<f64, 1>::new(N(0.0));
        separate_peaks.reset(0, &division_times_s[lane]);
        separate_peaks.begin(&[waves_by_lane[lane].sample(0.0)], true);
        for i in 1..=60 {
            let t = 0.05 * f64::from(i);
            separate_peaks.advance(N(t), N(0.05), &[waves_by_lane[lane].sample(t)], true);
        }
        assert_eq!(combined_peaks.finish(lane), separate_peaks.finish(0), "lane {lane}");
    }
}

/// Returns the relative error of the integral of the square over slightly more than two periods.
fn square_error(steps: u32) -> f64 {
    let amplitude = 1.5;
    let phase = 0.4;
    let end_s = 2.3;
    let waves = Waves { amplitude: [amplitude, 0.0], frequency: [TAU, 1.0], phase: [phase, 0.0] };
    let h = end_s / f64::from(steps);
    let mut square_integrals = SquareIntegrals::<f64, 1>::new(N(0.0));
    square_integrals.begin(&[waves.sample(0.0)]);
    for i in 1..=steps {
        // Steps outside the window do not change the integral.
        square_integrals.advance(N(h), &[waves.sample(h * f64::from(i))], true);
        square_integrals.advance(N(0.0), &[waves.sample(h * f64::from(i))], true);
    }
    square_integrals.advance(N(1.0), &[waves.sample(end_s + 1.0)], false);
    let antiderivative = |t: f64| t / 2.0 - (2.0 * (TAU * t + phase)).sin() / (4.0 * TAU);
    let exact_integral = amplitude * amplitude * (antiderivative(end_s) - antiderivative(0.0));
    (square_integrals.lane_integrals(0)[0] - exact_integral).abs() / exact_integral
}

#[test]
fn integrals_of_squares_are_of_sixth_order() {
    let [coarse_error, fine_error] = [30, 60].map(square_error);
    let observed_order = (coarse_error / fine_error).log2();
    eprintln!(
        "integral of a square: {fine_error:.1e} at 26 steps a period, order {observed_order:.2}"
    );
    assert!(observed_order > 5.5 && fine_error < 1e-6, "{observed_order} {fine_error:e}");
}

/// Returns the time above zero of a sine wave minus `height` over whole periods: computed from
/// `steps` steps, and exact.
fn times_above(height: f64, phase: f64, periods: u32, steps: u32) -> [f64; 2] {
    let waves = Waves { amplitude: [1.0, 0.0], frequency: [TAU, 1.0], phase: [phase, 0.0] };
    let sample_at = |t: f64| {
        let sample = waves.sample(t);
        Sample { value: N(sample.value.0 - height), ..sample }
    };
    let h = f64::from(periods) / f64::from(steps);
    let mut recorder = TimeAbove::<f64>::new(N(0.0));
    recorder.begin(&sample_at(0.0));
    for i in 1..=steps {
        recorder.advance(N(h), &sample_at(h * f64::from(i)), true);
    }
    let exact_time_s =
        f64::from(periods) * (core::f64::consts::PI - 2.0 * height.clamp(-1.0, 1.0).asin()) / TAU;
    [recorder.lane_time_s(0), exact_time_s]
}

#[test]
fn time_above_zero_is_found_between_steps() {
    for phase in [0.0, 0.3, 1.0, 2.2, 4.0] {
        for height in [-1.5, -0.999, -0.3, 0.0, 0.5, 0.97, 0.999, 1.5] {
            // Above a height of 0.999 the wave stays for a seventieth of a period, or a seventh of
            // a step.
            let [coarse_time_s, exact] = times_above(height, phase, 3, 30);
            assert!(
                (coarse_time_s - exact).abs() < 1e-3,
                "{height} at {phase}: {coarse_time_s} for {exact}"
            );
            let [fine_time_s, exact] = times_above(height, phase, 3, 300);
            assert!(
                (fine_time_s - exact).abs() < 1e-6,
                "{height} at {phase}: {fine_time_s} for {exact}"
            );
        }
    }
}

#[test]
fn steps_outside_the_window_add_no_time() {
    let mut time_above = TimeAbove::<f64>::new(N(0.0));
    let constant_one = Sample::constant(N(1.0), N(0.0));
    time_above.begin(&constant_one);
    time_above.advance(N(1.0), &constant_one, false);
    time_above.advance(N(0.25), &constant_one, true);
    assert_eq!(time_above.lane_time_s(0), 0.25);
    time_above.reset(0);
    assert_eq!(time_above.lane_time_s(0), 0.0);
}

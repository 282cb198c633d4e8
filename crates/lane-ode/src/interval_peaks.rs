//! Finds the peaks in every part of a trajectory that is divided at given times.

use crate::quintic::{Quintic, clamp_to_step};
use crate::{Lane, MAX_LANES, N, Peaks, Sample};

/// The largest magnitudes of `M` outputs in every part of each lane's trajectory. Each lane has its
/// own division times, at which its trajectory is divided into parts.
///
/// Steps need not end at division times. A step is divided by the polynomial of degree 5 through
/// values, slopes and curvatures at both ends of the step. A lane allocates when it starts a
/// trajectory, not in steps.
#[derive(Clone, Debug)]
pub struct IntervalPeaks<T, const M: usize> {
    peaks: Peaks<T, M>,
    /// The end of each lane's current part; infinity for the last part.
    interval_end_s: N<T>,
    /// The remaining division times of each lane, the next one last.
    division_times_s: [Vec<f64>; MAX_LANES],
    /// The peaks of each lane's completed parts.
    completed_peaks: [Vec<[f64; M]>; MAX_LANES],
}

impl<T: Lane, const M: usize> IntervalPeaks<T, M> {
    /// Creates the peaks of trajectories without division times or samples.
    #[inline(always)]
    pub fn new(zero: N<T>) -> Self {
        Self {
            peaks: Peaks::new(zero),
            interval_end_s: zero.lit(f64::INFINITY),
            division_times_s: [const { Vec::new() }; MAX_LANES],
            completed_peaks: [const { Vec::new() }; MAX_LANES],
        }
    }

    /// Begins another trajectory in one lane. The division times increase, and are within the
    /// window.
    pub fn reset(&mut self, lane: usize, division_times_s: &[f64]) {
        self.peaks.reset(lane);
        self.division_times_s[lane].clear();
        self.division_times_s[lane].extend(division_times_s.iter().rev());
        self.completed_peaks[lane].clear();
        self.completed_peaks[lane].reserve(division_times_s.len());
        let first_division_s = self.division_times_s[lane].pop().unwrap_or(f64::INFINITY);
        self.interval_end_s.0.set(lane, first_division_s);
    }

    /// Returns the peaks of the intervals of one lane and ends its trajectory. The last interval
    /// may be incomplete.
    pub fn finish(&mut self, lane: usize) -> Vec<[f64; M]> {
        self.interval_end_s.0.set(lane, f64::INFINITY);
        let mut lane_peaks = core::mem::take(&mut self.completed_peaks[lane]);
        lane_peaks.push(self.peaks.lane_peaks(lane));
        lane_peaks
    }

    /// Adds the samples at the start of the first step, in the lanes in which `counted_lanes` is
    /// true.
    #[inline(always)]
    pub fn begin(&mut self, samples: &[Sample<T>; M], counted_lanes: T::Mask) {
        self.peaks.begin(samples, counted_lanes);
    }

    /// Adds the samples at `end_s`, the end of a step of `length_s` that began at the last samples.
    #[inline(always)]
    pub fn advance(
        &mut self,
        end_s: N<T>,
        length_s: N<T>,
        samples: &[Sample<T>; M],
        counted_lanes: T::Mask,
    ) {
        let mut remaining_s = length_s;
        loop {
            let is_divided_mask = self.interval_end_s.0.less(end_s.0);
            let lanes_with_division = T::bits(is_divided_mask);
            let mut part_end_samples = *samples;
            let mut part_length_s = remaining_s;
            if lanes_with_division != 0 {
                // Lanes without a division time in the step advance to the step's end at once.
                let time_to_division_s = self.interval_end_s - (end_s - remaining_s);
                let fraction = N(T::select(
                    is_divided_mask,
                    clamp_to_step(time_to_division_s / remaining_s).0,
                    remaining_s.lit(1.0).0,
                ));
                for i in 0..M {
                    let interpolated_sample =
                        Quintic::new(remaining_s, &self.peaks.last_samples[i], &samples[i])
                            .sample(fraction, remaining_s);
                    part_end_samples[i] = Sample {
                        value: N(T::select(
                            is_divided_mask,
                            interpolated_sample.value.0,
                            part_end_samples[i].value.0,
                        )),
                        slope: N(T::select(
                            is_divided_mask,
                            interpolated_sample.slope.0,
                            part_end_samples[i].slope.0,
                        )),
                        curvature: N(T::select(
                            is_divided_mask,
                            interpolated_sample.curvature.0,
                            part_end_samples[i].curvature.0,
                        )),
                    };
                }
                part_length_s = (fraction * remaining_s).v();
            }
            self.peaks.advance(part_length_s, &part_end_samples, counted_lanes);
            if lanes_with_division == 0 {
                return;
            }
            remaining_s -= part_length_s;
            for lane in (0..T::LANES).filter(|lane| lanes_with_division >> lane & 1 == 1) {
                self.completed_peaks[lane].push(self.peaks.lane_peaks(lane));
                self.peaks.reset(lane);
                let next_division_s = self.division_times_s[lane].pop().unwrap_or(f64::INFINITY);
                self.interval_end_s.0.set(lane, next_division_s);
            }
            self.peaks.begin(&part_end_samples, is_divided_mask);
        }
    }
}

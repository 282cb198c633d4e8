//! Finds the peaks in every part of a trajectory that is divided at given times.

use crate::quintic::{Quintic, clamp_to_step};
use crate::{Lane, MAX_LANES, N, Peaks, Sample};

/// The largest magnitudes of `M` outputs in every part of each lane's trajectory. Each lane has its
/// own times (cuts) that divide the trajectory into parts.
///
/// Steps need not end at the cuts. A step is divided at a cut by the polynomial of degree 5 through
/// values, slopes and curvatures at both ends of the step. A lane allocates when it starts a
/// trajectory, not in steps.
#[derive(Clone, Debug)]
pub struct IntervalPeaks<T, const M: usize> {
    peaks: Peaks<T, M>,
    /// The end of each lane's current part; infinity for the last part.
    interval_end_s: N<T>,
    /// The remaining cuts of each lane, the next one last.
    cuts_s: [Vec<f64>; MAX_LANES],
    /// The peaks of each lane's completed parts.
    completed_peaks: [Vec<[f64; M]>; MAX_LANES],
}

impl<T: Lane, const M: usize> IntervalPeaks<T, M> {
    /// Creates the peaks of trajectories without cuts or samples.
    #[inline(always)]
    pub fn new(zero: N<T>) -> Self {
        Self {
            peaks: Peaks::new(zero),
            interval_end_s: zero.lit(f64::INFINITY),
            cuts_s: [const { Vec::new() }; MAX_LANES],
            completed_peaks: [const { Vec::new() }; MAX_LANES],
        }
    }

    /// Begins another trajectory in one lane. The cuts are increasing times within the window.
    pub fn reset(&mut self, lane: usize, cuts_s: &[f64]) {
        self.peaks.reset(lane);
        self.cuts_s[lane].clear();
        self.cuts_s[lane].extend(cuts_s.iter().rev());
        self.completed_peaks[lane].clear();
        self.completed_peaks[lane].reserve(cuts_s.len());
        let first_cut_s = self.cuts_s[lane].pop().unwrap_or(f64::INFINITY);
        self.interval_end_s.0.set(lane, first_cut_s);
    }

    /// Returns the peaks of the parts of one lane and ends its trajectory. The last part may be
    /// incomplete.
    pub fn finish(&mut self, lane: usize) -> Vec<[f64; M]> {
        self.interval_end_s.0.set(lane, f64::INFINITY);
        let mut peaks_of_lane = core::mem::take(&mut self.completed_peaks[lane]);
        peaks_of_lane.push(self.peaks.lane(lane));
        peaks_of_lane
    }

    /// Adds the samples at the start of the first step, in the lanes in which `counts` is true.
    #[inline(always)]
    pub fn begin(&mut self, samples: &[Sample<T>; M], counts: T::Mask) {
        self.peaks.begin(samples, counts);
    }

    /// Adds the samples at `end_s`, the end of a step of `length_s` that began at the last samples.
    #[inline(always)]
    pub fn advance(
        &mut self,
        end_s: N<T>,
        length_s: N<T>,
        samples: &[Sample<T>; M],
        counts: T::Mask,
    ) {
        let mut rest_s = length_s;
        loop {
            let cut = self.interval_end_s.0.less(end_s.0);
            let cut_lanes = T::bits(cut);
            let mut part_end = *samples;
            let mut part_length_s = rest_s;
            if cut_lanes != 0 {
                // Lanes without a cut in the step advance to its end at once.
                let to_cut = self.interval_end_s - (end_s - rest_s);
                let fraction =
                    N(T::select(cut, clamp_to_step(to_cut / rest_s).0, rest_s.lit(1.0).0));
                for i in 0..M {
                    let interpolated =
                        Quintic::new(rest_s, &self.peaks.last_samples[i], &samples[i])
                            .sample(fraction, rest_s);
                    part_end[i] = Sample {
                        value: N(T::select(cut, interpolated.value.0, part_end[i].value.0)),
                        slope: N(T::select(cut, interpolated.slope.0, part_end[i].slope.0)),
                        curvature: N(T::select(
                            cut,
                            interpolated.curvature.0,
                            part_end[i].curvature.0,
                        )),
                    };
                }
                part_length_s = (fraction * rest_s).v();
            }
            self.peaks.advance(part_length_s, &part_end, counts);
            if cut_lanes == 0 {
                return;
            }
            rest_s -= part_length_s;
            for lane in (0..T::LANES).filter(|lane| cut_lanes >> lane & 1 == 1) {
                self.completed_peaks[lane].push(self.peaks.lane(lane));
                self.peaks.reset(lane);
                let next_cut_s = self.cuts_s[lane].pop().unwrap_or(f64::INFINITY);
                self.interval_end_s.0.set(lane, next_cut_s);
            }
            self.peaks.begin(&part_end, cut);
        }
    }
}

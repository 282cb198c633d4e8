//! Finds peaks during integration: the largest magnitude of each output at the ends of steps and
//! between them.

use crate::quintic::Quintic;
use crate::{Lane, N, Sample};

/// The largest magnitudes so far of `M` outputs.
///
/// Between two steps an output stays within the control polygon of the cubic through its values and
/// slopes. Only a step whose polygon exceeds the peak so far is searched, with second derivatives,
/// so that the sampling error is of sixth order in the step.
#[derive(Clone, Copy, Debug)]
pub struct Peaks<T, const M: usize> {
    peaks: [N<T>; M],
    pub(crate) last_samples: [Sample<T>; M],
}

impl<T: Lane, const M: usize> Peaks<T, M> {
    /// Creates peaks without samples.
    #[inline(always)]
    pub fn new(zero: N<T>) -> Self {
        Self { peaks: [zero; M], last_samples: [Sample::constant(zero, zero); M] }
    }

    /// Sets the peaks of one lane to zero.
    #[inline(always)]
    pub fn reset(&mut self, lane: usize) {
        self.peaks.iter_mut().for_each(|peak| peak.0.set(lane, 0.0));
    }

    /// Returns the peaks of one lane.
    #[inline(always)]
    pub fn lane_peaks(&self, lane: usize) -> [f64; M] {
        self.peaks.map(|peak| peak.0.get(lane))
    }

    /// Adds the samples at the start of the first step, in the lanes in which `counted_lanes` is
    /// true.
    #[inline(always)]
    pub fn begin(&mut self, samples: &[Sample<T>; M], counted_lanes: T::Mask) {
        for i in 0..M {
            self.raise_peak(i, samples[i].value.abs(), counted_lanes);
        }
        self.last_samples = *samples;
    }

    /// Adds the samples at the end of a step of `length_s` that began at the last samples, in the
    /// lanes in which `counted_lanes` is true.
    #[inline(always)]
    pub fn advance(&mut self, length_s: N<T>, samples: &[Sample<T>; M], counted_lanes: T::Mask) {
        let zero = length_s.lit(0.0);
        let third_length_s = (length_s * (1.0 / 3.0)).v();
        let mut max_rise = zero;
        let mut polygon_rises = [zero; M];
        for i in 0..M {
            let start = self.last_samples[i];
            let end = &samples[i];
            self.raise_peak(i, end.value.abs(), counted_lanes);
            // The height of the control polygon above the peak.
            let polygon_height = (start.value + third_length_s * start.slope)
                .abs()
                .0
                .larger((end.value - third_length_s * end.slope).abs().0);
            polygon_rises[i] = N(polygon_height) - self.peaks[i];
            max_rise = N(polygon_rises[i].0.larger(max_rise.0));
        }
        if T::bits(zero.0.less(T::select(counted_lanes, max_rise.0, zero.0))) != 0 {
            for i in 0..M {
                let rise = N(T::select(counted_lanes, polygon_rises[i].0, zero.0));
                if T::bits(zero.0.less(rise.0)) != 0 {
                    let extremum =
                        Quintic::new(length_s, &self.last_samples[i], &samples[i]).extremum();
                    let extremum = zero.where_less(rise, extremum.abs(), zero);
                    self.peaks[i] = N(extremum.0.larger(self.peaks[i].0));
                }
            }
        }
        self.last_samples = *samples;
    }

    /// Adds samples like [`Peaks::advance`], for outputs whose curvatures are not known. A step is
    /// then the cubic through values and slopes, and the sampling error is of fourth order.
    #[inline(always)]
    pub fn advance_by_slopes(
        &mut self,
        length_s: N<T>,
        samples: &[Sample<T>; M],
        counted_lanes: T::Mask,
    ) {
        let mut samples = *samples;
        for i in 0..M {
            Sample::set_cubic_curvatures(length_s, &mut self.last_samples[i], &mut samples[i]);
        }
        self.advance(length_s, &samples, counted_lanes);
    }

    #[inline(always)]
    fn raise_peak(&mut self, i: usize, magnitude: N<T>, counted_lanes: T::Mask) {
        let raised_peak = magnitude.0.larger(self.peaks[i].0);
        self.peaks[i] = N(T::select(counted_lanes, raised_peak, self.peaks[i].0));
    }
}

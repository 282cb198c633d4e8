//! Measures the time for which an output is positive, between the ends of steps too.

use crate::quintic::Quintic;
use crate::{Lane, N, Sample};

/// Greatest number of bisections for a zero. Basis: 2^-40 of the step is far below the error of any
/// step. Doubling it doubles the time and changes only rounding errors.
const MAX_BISECTIONS: usize = 40;

/// The time for which one output was positive.
///
/// A step is searched for a zero if the control polygon of the cubic through its values and slopes
/// crosses zero. On each side of its extremum the output crosses zero at most once.
#[derive(Clone, Copy, Debug)]
pub struct TimeAbove<T> {
    time_s: N<T>,
    last_sample: Sample<T>,
}

impl<T: Lane> TimeAbove<T> {
    /// Creates a time without samples.
    #[inline(always)]
    pub fn new(zero: N<T>) -> Self {
        Self { time_s: zero, last_sample: Sample::constant(zero, zero) }
    }

    /// Sets the time of one lane to zero.
    pub fn reset(&mut self, lane: usize) {
        self.time_s.0.set(lane, 0.0);
    }

    /// Returns the time of one lane (s).
    pub fn lane_time_s(&self, lane: usize) -> f64 {
        self.time_s.0.get(lane)
    }

    /// Sets the sample at the start of the first step.
    #[inline(always)]
    pub fn begin(&mut self, sample: &Sample<T>) {
        self.last_sample = *sample;
    }

    /// Adds a step of `length_s` from the last sample to `sample`, in the lanes in which
    /// `counted_lanes` is true.
    #[inline(always)]
    pub fn advance(&mut self, length_s: N<T>, sample: &Sample<T>, counted_lanes: T::Mask) {
        let zero = length_s.lit(0.0);
        let one = length_s.lit(1.0);
        let third_length_s = (length_s * (1.0 / 3.0)).v();
        // The control points a, b, c, d of the cubic.
        let a = self.last_sample.value;
        let d = sample.value;
        let b = a + third_length_s * self.last_sample.slope;
        let c = d - third_length_s * sample.slope;
        // The greatest height of the control polygon above zero and its greatest depth below zero,
        // which bound the cubic.
        let max_height = N(a.0.larger(b.0).larger(c.0.larger(d.0)));
        let max_depth = N((-a).0.larger((-b).0).larger((-c).0.larger((-d).0)));
        let mut fraction_above_zero = max_depth.where_less(zero, one, zero);
        let is_counted = N(T::select(counted_lanes, one.0, zero.0));
        let has_zero =
            max_depth.where_less(zero, zero, zero.where_less(max_height, is_counted, zero));
        if T::bits(zero.0.less(has_zero.0)) != 0 {
            let positive_fraction =
                positive_fraction_of_step(&Quintic::new(length_s, &self.last_sample, sample));
            fraction_above_zero = zero.where_less(has_zero, positive_fraction, fraction_above_zero);
        }
        self.time_s += N(T::select(counted_lanes, (fraction_above_zero * length_s).v().0, zero.0));
        self.last_sample = *sample;
    }

    /// Adds a step like [`TimeAbove::advance`], for an output whose curvature is not known. The
    /// step is then the cubic through values and slopes.
    #[inline(always)]
    pub fn advance_by_slopes(
        &mut self,
        length_s: N<T>,
        sample: &Sample<T>,
        counted_lanes: T::Mask,
    ) {
        let mut sample = *sample;
        Sample::set_cubic_curvatures(length_s, &mut self.last_sample, &mut sample);
        self.advance(length_s, &sample, counted_lanes);
    }
}

/// Returns the fraction of the step in which the polynomial is above zero.
#[inline(always)]
fn positive_fraction_of_step<T: Lane>(quintic: &Quintic<T>) -> N<T> {
    let extremum = quintic.extremum_position();
    let zero = extremum.lit(0.0);
    positive_length_between(quintic, zero, extremum)
        + positive_length_between(quintic, extremum, extremum.lit(1.0))
}

/// Returns the length over which the polynomial is positive between two points, between which it
/// crosses zero at most once.
#[inline(always)]
fn positive_length_between<T: Lane>(quintic: &Quintic<T>, start: N<T>, end: N<T>) -> N<T> {
    let zero = start.lit(0.0);
    let start_value = quintic.value(start);
    let end_value = quintic.value(end);
    let mut low_position = start;
    let mut high_position = end;
    // Bisects to the point where the sign changes from that at `start`. If it does not change,
    // `low_position` converges to `end`.
    for _ in 0..MAX_BISECTIONS {
        let middle_position = (0.5 * (low_position + high_position)).v();
        let value = quintic.value(middle_position);
        let is_positive = zero.where_less(value, middle_position.lit(1.0), zero);
        let starts_positive = zero.where_less(start_value, middle_position.lit(1.0), zero);
        let has_start_sign = (is_positive - starts_positive).abs().where_less(
            middle_position.lit(0.5),
            middle_position.lit(1.0),
            zero,
        );
        low_position = zero.where_less(has_start_sign, middle_position, low_position);
        high_position = zero.where_less(has_start_sign, high_position, middle_position);
    }
    let start_length = (low_position - start).abs();
    let end_length = (end - low_position).abs();
    let positive_start_length = zero.where_less(start_value, start_length, zero);
    let positive_end_length = zero.where_less(end_value, end_length, zero);
    positive_start_length + positive_end_length
}

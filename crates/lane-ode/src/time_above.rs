//! Measures the time for which an output is positive, between the ends of steps too.

use crate::quintic::Quintic;
use crate::{Lane, N, Sample};

/// Number of bisections that find a zero. Basis: 2^-40 of the step is far below any step's error.
/// Doubling it doubles the time and changes nothing above rounding.
const HALVINGS: usize = 40;

/// The time for which one output was positive.
///
/// A step is examined where the control polygon of the cubic through its values and slopes crosses
/// zero. On each side of its extremum the output crosses zero at most once.
#[derive(Clone, Copy, Debug)]
pub struct TimeAbove<T> {
    time_s: N<T>,
    last: Sample<T>,
}

impl<T: Lane> TimeAbove<T> {
    /// Creates a time without samples.
    #[inline(always)]
    pub fn new(zero: N<T>) -> Self {
        Self { time_s: zero, last: Sample::still(zero, zero) }
    }

    /// Forgets one lane.
    pub fn reset(&mut self, lane: usize) {
        self.time_s.0.set(lane, 0.0);
    }

    /// Returns the time of one lane (s).
    pub fn lane(&self, lane: usize) -> f64 {
        self.time_s.0.get(lane)
    }

    /// Sets a sample without a step before it.
    #[inline(always)]
    pub fn begin(&mut self, sample: &Sample<T>) {
        self.last = *sample;
    }

    /// Adds a step of `length_s` from the last sample to this one, in the lanes in which `counts`
    /// is true.
    #[inline(always)]
    pub fn advance(&mut self, length_s: N<T>, sample: &Sample<T>, counts: T::Mask) {
        let zero = length_s.lit(0.0);
        let one = length_s.lit(1.0);
        let third = (length_s * (1.0 / 3.0)).v();
        // Control points of the cubic.
        let a = self.last.value;
        let d = sample.value;
        let b = a + third * self.last.slope;
        let c = d - third * sample.slope;
        // The greatest and the least height of the control polygon, which bound the cubic.
        let height = N(a.0.larger(b.0).larger(c.0.larger(d.0)));
        let depth = N((-a).0.larger((-b).0).larger((-c).0.larger((-d).0)));
        let mut share = depth.where_less(zero, one, zero);
        let counted = N(T::select(counts, one.0, zero.0));
        let in_doubt = depth.where_less(zero, zero, zero.where_less(height, counted, zero));
        if T::bits(zero.0.less(in_doubt.0)) != 0 {
            let inside = positive_share(&Quintic::new(length_s, &self.last, sample));
            share = zero.where_less(in_doubt, inside, share);
        }
        self.time_s += N(T::select(counts, (share * length_s).v().0, zero.0));
        self.last = *sample;
    }

    /// Adds a step as [`TimeAbove::advance`] does, for an output whose curvature is not known. The
    /// step is then the cubic through values and slopes.
    #[inline(always)]
    pub fn advance_by_slopes(&mut self, length_s: N<T>, sample: &Sample<T>, counts: T::Mask) {
        let mut sample = *sample;
        Sample::curve_as_cubic(length_s, &mut self.last, &mut sample);
        self.advance(length_s, &sample, counts);
    }
}

/// Returns the share of the step in which the polynomial is above zero.
#[inline(always)]
fn positive_share<T: Lane>(quintic: &Quintic<T>) -> N<T> {
    let turn = quintic.extremum_position();
    let zero = turn.lit(0.0);
    positive_length_between(quintic, zero, turn)
        + positive_length_between(quintic, turn, turn.lit(1.0))
}

/// Returns the length for which the polynomial is positive between two points, between which it
/// crosses zero at most once.
#[inline(always)]
fn positive_length_between<T: Lane>(quintic: &Quintic<T>, from: N<T>, to: N<T>) -> N<T> {
    let zero = from.lit(0.0);
    let at_from = quintic.value(from);
    let at_to = quintic.value(to);
    let mut low = from;
    let mut high = to;
    // Bisects towards the point where the sign changes from that at `from`; if it does not change,
    // towards `to`.
    for _ in 0..HALVINGS {
        let middle = (0.5 * (low + high)).v();
        let value = quintic.value(middle);
        let is_above = zero.where_less(value, middle.lit(1.0), zero);
        let was_above = zero.where_less(at_from, middle.lit(1.0), zero);
        let same = (is_above - was_above).abs().where_less(middle.lit(0.5), middle.lit(1.0), zero);
        low = zero.where_less(same, middle, low);
        high = zero.where_less(same, high, middle);
    }
    let before = (low - from).abs();
    let after = (to - low).abs();
    let above_before = zero.where_less(at_from, before, zero);
    let above_after = zero.where_less(at_to, after, zero);
    above_before + above_after
}

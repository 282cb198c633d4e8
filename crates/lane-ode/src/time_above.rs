//! How long an output is above zero, between steps as well as at them.

use crate::quintic::Quintic;
use crate::{Lane, N, Sample};

/// Halvings that find where an output passes zero: to a millionth of a millionth of the step.
const HALVINGS: usize = 40;

/// Time that one output has spent above zero.
///
/// A step is examined where the control polygon of the cubic through its values and slopes crosses
/// zero. On each side of its extremum the output crosses zero at most once.
#[derive(Clone, Copy, Debug)]
pub struct TimeAbove<T> {
    time_s: N<T>,
    last: Sample<T>,
}

impl<T: Lane> TimeAbove<T> {
    /// Nothing seen yet.
    #[inline(always)]
    pub fn new(zero: N<T>) -> Self {
        Self { time_s: zero, last: Sample::still(zero, zero) }
    }

    /// Forgets one lane.
    pub fn reset(&mut self, lane: usize) {
        self.time_s.0.set(lane, 0.0);
    }

    /// The time of one lane (s).
    pub fn lane(&self, lane: usize) -> f64 {
        self.time_s.0.get(lane)
    }

    /// A sample that no step leads to.
    #[inline(always)]
    pub fn begin(&mut self, sample: &Sample<T>) {
        self.last = *sample;
    }

    /// The sample at the end of a step of `length_s` that began at the last one; `counts` says in
    /// which lanes it counts.
    #[inline(always)]
    pub fn advance(&mut self, length_s: N<T>, sample: &Sample<T>, counts: T::Mask) {
        let zero = length_s.lit(0.0);
        let one = length_s.lit(1.0);
        let third = (length_s * (1.0 / 3.0)).v();
        let (a, d) = (self.last.value, sample.value);
        let (b, c) = (a + third * self.last.slope, d - third * sample.slope);
        // How far it may reach above zero, and below.
        let height = N(a.0.larger(b.0).larger(c.0.larger(d.0)));
        let depth = N((-a).0.larger((-b).0).larger((-c).0.larger((-d).0)));
        let mut share = depth.where_less(zero, one, zero);
        let counted = N(T::select(counts, one.0, zero.0));
        let in_doubt = depth.where_less(zero, zero, zero.where_less(height, counted, zero));
        if T::bits(zero.0.less(in_doubt.0)) != 0 {
            let inside = share_above(&Quintic::new(length_s, &self.last, sample));
            share = zero.where_less(in_doubt, inside, share);
        }
        self.time_s += N(T::select(counts, (share * length_s).v().0, zero.0));
        self.last = *sample;
    }

    /// As [`TimeAbove::advance`], for an output whose curvature is not known: then a step is the
    /// cubic through values and slopes.
    #[inline(always)]
    pub fn advance_by_slopes(&mut self, length_s: N<T>, sample: &Sample<T>, counts: T::Mask) {
        let mut sample = *sample;
        Sample::curve_as_cubic(length_s, &mut self.last, &mut sample);
        self.advance(length_s, &sample, counts);
    }
}

/// Which part of the step the polynomial is above zero.
#[inline(always)]
fn share_above<T: Lane>(quintic: &Quintic<T>) -> N<T> {
    let turn = quintic.extremum_at();
    let zero = turn.lit(0.0);
    above_between(quintic, zero, turn) + above_between(quintic, turn, turn.lit(1.0))
}

/// Likewise between two places, between which it passes zero at most once.
#[inline(always)]
fn above_between<T: Lane>(quintic: &Quintic<T>, from: N<T>, to: N<T>) -> N<T> {
    let zero = from.lit(0.0);
    let (at_from, at_to) = (quintic.value(from), quintic.value(to));
    let (mut low, mut high) = (from, to);
    // Towards the place where the sign changes from that at `from`; without one, towards `to`.
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
    let of_before = zero.where_less(at_from, before, zero);
    let of_after = zero.where_less(at_to, after, zero);
    of_before + of_after
}

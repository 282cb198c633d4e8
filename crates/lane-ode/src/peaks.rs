//! Streaming peaks: the largest magnitude of each output between steps as well as at them.

use crate::lane::Lane;
use crate::num::N;

/// An output with its first two derivatives in time.
#[derive(Clone, Copy, Debug)]
pub struct Sample<T> {
    /// The output.
    pub value: N<T>,
    /// Its first derivative, per second.
    pub slope: N<T>,
    /// Its second derivative, per second squared.
    pub curvature: N<T>,
}

impl<T: Copy> Sample<T> {
    /// An output that stands still.
    #[inline(always)]
    #[must_use]
    pub const fn still(value: N<T>, zero: N<T>) -> Self {
        Self { value, slope: zero, curvature: zero }
    }
}

/// Largest magnitude so far of `M` outputs.
///
/// Between two steps an output stays within the control polygon of the cubic through its values and slopes. Only where that reaches
/// above the peak so far is a step looked into, with second derivatives: then the sampling error is of sixth order in the step.
#[derive(Clone, Copy, Debug)]
pub struct Peaks<T, const M: usize> {
    peak: [N<T>; M],
    last: [Sample<T>; M],
}

impl<T: Lane, const M: usize> Peaks<T, M> {
    /// No output seen yet.
    #[inline(always)]
    #[must_use]
    pub fn new(zero: N<T>) -> Self {
        Self { peak: [zero; M], last: [Sample::still(zero, zero); M] }
    }

    /// Forgets one lane.
    #[inline(always)]
    pub fn reset(&mut self, lane: usize) {
        self.peak.iter_mut().for_each(|peak| peak.0.set(lane, 0.0));
    }

    /// The peaks of one lane.
    #[inline(always)]
    #[must_use]
    pub fn lane(&self, lane: usize) -> [f64; M] {
        self.peak.map(|peak| peak.0.get(lane))
    }

    /// Samples that no step leads to; `counts` says in which lanes they count.
    #[inline(always)]
    pub fn begin(&mut self, samples: &[Sample<T>; M], counts: T::Mask) {
        for i in 0..M {
            self.raise(i, samples[i].value.abs(), counts);
        }
        self.last = *samples;
    }

    /// The samples at the end of a step of `length_s` that began at the last ones.
    #[inline(always)]
    pub fn advance(&mut self, length_s: N<T>, samples: &[Sample<T>; M], counts: T::Mask) {
        let zero = length_s.lit(0.0);
        let third = (length_s * (1.0 / 3.0)).v();
        let mut highest = zero;
        let mut rises = [zero; M];
        for i in 0..M {
            let (last, now) = (self.last[i], &samples[i]);
            self.raise(i, now.value.abs(), counts);
            // How far the control polygon reaches above the peak.
            let polygon =
                (last.value + third * last.slope).abs().0.larger((now.value - third * now.slope).abs().0);
            rises[i] = N(polygon) - self.peak[i];
            highest = N(rises[i].0.larger(highest.0));
        }
        if T::bits(zero.0.less(T::select(counts, highest.0, zero.0))) != 0 {
            for i in 0..M {
                let rise = N(T::select(counts, rises[i].0, zero.0));
                if T::bits(zero.0.less(rise.0)) != 0 {
                    let inside = Quintic::new(length_s, &self.last[i], &samples[i]).extremum();
                    let inside = zero.where_less(rise, inside.abs(), zero);
                    self.peak[i] = N(inside.0.larger(self.peak[i].0));
                }
            }
        }
        self.last = *samples;
    }

    #[inline(always)]
    fn raise(&mut self, i: usize, size: N<T>, counts: T::Mask) {
        let raised = size.0.larger(self.peak[i].0);
        self.peak[i] = N(T::select(counts, raised, self.peak[i].0));
    }
}

/// The polynomial of degree 5 that meets values, slopes and curvatures at both ends of a step; over s from 0 to 1.
struct Quintic<T> {
    c: [N<T>; 6],
}

impl<T: Lane> Quintic<T> {
    #[inline(always)]
    fn new(h: N<T>, start: &Sample<T>, end: &Sample<T>) -> Self {
        let (Sample { value: y0, slope: d0, curvature: e0 }, Sample { value: y1, slope: d1, curvature: e1 }) =
            (*start, *end);
        let hh = (h * h).v();
        let (v0, v1) = ((h * d0).v(), (h * d1).v());
        let (a0, a1) = ((0.5 * (hh * e0).v()).v(), (0.5 * (hh * e1).v()).v());
        // Residuals at s = 1 of value, slope and half curvature, after the terms fixed at s = 0.
        let r = y1 - y0 - v0 - a0;
        let s = v1 - v0 - 2.0 * a0;
        let t = a1 - a0;
        Self { c: [y0, v0, a0, 10.0 * r - 4.0 * s + t, 7.0 * s - 15.0 * r - 2.0 * t, 6.0 * r - 3.0 * s + t] }
    }

    /// The value where the slope vanishes, by Newton's method from where the cubic's slope would; at worst an end's.
    #[inline(always)]
    fn extremum(&self) -> N<T> {
        let c = &self.c;
        let slope_end = c[1] + 2.0 * c[2] + 3.0 * c[3] + 4.0 * c[4] + 5.0 * c[5];
        // Secant start: where a straight slope would cross zero.
        let mut s = within_step(c[1] / (c[1] - slope_end));
        for _ in 0..4 {
            let slope = c[1] + s * (2.0 * c[2] + s * (3.0 * c[3] + s * (4.0 * c[4] + (5.0 * s) * c[5])));
            let curvature = 2.0 * c[2] + s * (6.0 * c[3] + s * (12.0 * c[4] + (20.0 * s) * c[5]));
            s = within_step(s - slope / curvature);
        }
        c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))
    }
}

/// Between 0 and 1; NaN becomes 1.
#[inline(always)]
fn within_step<T: Lane>(s: N<T>) -> N<T> {
    let s = s.where_less(s.lit(1.0), s, s.lit(1.0));
    s.lit(0.0).where_less(s, s, s.lit(0.0))
}

//! Streaming peaks: the largest magnitude of each output between steps as well as at them.

use crate::lane::Lane;
use crate::num::N;

/// An output with its first derivative.
pub type Sample<T> = (N<T>, N<T>);

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
        Self { peak: [zero; M], last: [(zero, zero); M] }
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

    /// A sample that no step leads to.
    #[inline(always)]
    pub fn begin(&mut self, sample: [Sample<T>; M], counts: T::Mask) {
        for i in 0..M {
            self.raise(i, sample[i].0.abs(), counts);
        }
        self.last = sample;
    }

    /// The sample at the end of a step of `length_s`. `counts` says in which lanes; `second` gives second derivatives at
    /// both ends, and is asked only where a peak may lie inside the step.
    #[inline(always)]
    pub fn step(
        &mut self,
        length_s: N<T>,
        sample: [Sample<T>; M],
        counts: T::Mask,
        second: impl FnOnce() -> [[N<T>; M]; 2],
    ) {
        let third = (length_s * (1.0 / 3.0)).v();
        let zero = length_s.lit(0.0);
        let mut excess = zero;
        let mut rises = [zero; M];
        for i in 0..M {
            let ((y0, d0), (y1, d1)) = (self.last[i], sample[i]);
            self.raise(i, y1.abs(), counts);
            let reach = N((y0 + third * d0).abs().0.larger((y1 - third * d1).abs().0));
            let rise = reach - self.peak[i];
            rises[i] = rise;
            excess = N(rise.0.larger(excess.0));
        }
        let excess = N(T::select(counts, excess.0, zero.0));
        if T::bits(zero.0.less(excess.0)) != 0 {
            let [second_0, second_1] = second();
            for i in 0..M {
                let may = N(T::select(counts, rises[i].0, zero.0));
                if T::bits(zero.0.less(may.0)) != 0 {
                    let inside = Quintic::new(length_s, self.last[i], second_0[i], sample[i], second_1[i]).extremum();
                    let inside = zero.where_less(may, inside.abs(), zero);
                    self.peak[i] = N(inside.0.larger(self.peak[i].0));
                }
            }
        }
        self.last = sample;
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
    fn new(h: N<T>, (y0, d0): Sample<T>, e0: N<T>, (y1, d1): Sample<T>, e1: N<T>) -> Self {
        let hh = (h * h).v();
        let (v0, v1) = ((h * d0).v(), (h * d1).v());
        let (a0, a1) = ((0.5 * (hh * e0).v()).v(), (0.5 * (hh * e1).v()).v());
        // Residuals at s = 1 of value, slope and half curvature, after the terms fixed at s = 0.
        let r = y1 - y0 - v0 - a0;
        let s = v1 - v0 - 2.0 * a0;
        let t = a1 - a0;
        Self {
            c: [y0, v0, a0, 10.0 * r - 4.0 * s + t, 7.0 * s - 15.0 * r - 2.0 * t, 6.0 * r - 3.0 * s + t],
        }
    }

    /// The value where the slope vanishes, by Newton's method from where the cubic's slope would; at worst an end's.
    #[inline(always)]
    fn extremum(&self) -> N<T> {
        let c = &self.c;
        let one = c[0].lit(1.0);
        let zero = c[0].lit(0.0);
        let slope_end = c[1] + 2.0 * c[2] + 3.0 * c[3] + 4.0 * c[4] + 5.0 * c[5];
        // Secant start: where a straight slope would cross zero.
        let clamp = |s: N<T>| {
            let s = s.where_less(one, s, one);
            zero.where_less(s, s, zero)
        };
        let mut s = clamp(c[1] / (c[1] - slope_end));
        for _ in 0..4 {
            let slope = c[1] + s * (2.0 * c[2] + s * (3.0 * c[3] + s * (4.0 * c[4] + (5.0 * s) * c[5])));
            let curvature = 2.0 * c[2] + s * (6.0 * c[3] + s * (12.0 * c[4] + (20.0 * s) * c[5]));
            s = clamp(s - slope / curvature);
        }
        c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))
    }
}

//! Interpolates an output between the ends of a step by the polynomial through values, slopes and
//! curvatures.

use crate::{Lane, N};

/// An output with its first two derivatives in time.
#[derive(Clone, Copy, Debug)]
pub struct Sample<T> {
    /// The output.
    pub value: N<T>,
    /// The first derivative, per second.
    pub slope: N<T>,
    /// The second derivative, per second squared.
    pub curvature: N<T>,
}

impl<T: Copy> Sample<T> {
    /// Returns a sample of a constant output.
    #[inline(always)]
    pub const fn constant(value: N<T>, zero: N<T>) -> Self {
        Self { value, slope: zero, curvature: zero }
    }
}

impl<T: Lane> Sample<T> {
    /// Sets the curvatures at both ends of a step to those of the cubic through values and slopes.
    #[inline(always)]
    pub(crate) fn set_cubic_curvatures(length_s: N<T>, start: &mut Self, end: &mut Self) {
        let mean_slope = (end.value - start.value) / length_s;
        start.curvature = (6.0 * mean_slope - (4.0 * start.slope + 2.0 * end.slope)) / length_s;
        end.curvature = (2.0 * start.slope + 4.0 * end.slope - 6.0 * mean_slope) / length_s;
    }

    /// Interpolates between two samples, at a `fraction` (0 to 1) of the step of `length_s` between
    /// them, by the polynomial of degree 5 with the values, slopes and curvatures of both.
    #[inline(always)]
    pub fn interpolate(start: &Self, end: &Self, length_s: N<T>, fraction: f64) -> Self {
        Quintic::new(length_s, start, end).sample(length_s.lit(fraction), length_s)
    }
}

/// The polynomial of degree 5 with given values, slopes and curvatures at both ends of a step, over
/// s from 0 to 1.
pub(crate) struct Quintic<T> {
    c: [N<T>; 6],
}

impl<T: Lane> Quintic<T> {
    #[inline(always)]
    pub(crate) fn new(h: N<T>, start: &Sample<T>, end: &Sample<T>) -> Self {
        let (
            Sample { value: y0, slope: d0, curvature: e0 },
            Sample { value: y1, slope: d1, curvature: e1 },
        ) = (*start, *end);
        let hh = (h * h).v();
        let v0 = (h * d0).v();
        let v1 = (h * d1).v();
        let a0 = (0.5 * (hh * e0).v()).v();
        let a1 = (0.5 * (hh * e1).v()).v();
        // Residuals at s = 1 of value, slope and half curvature, after the terms fixed at s = 0.
        let r = y1 - y0 - v0 - a0;
        let s = v1 - v0 - 2.0 * a0;
        let t = a1 - a0;
        Self {
            c: [
                y0,
                v0,
                a0,
                10.0 * r - 4.0 * s + t,
                7.0 * s - 15.0 * r - 2.0 * t,
                6.0 * r - 3.0 * s + t,
            ],
        }
    }

    /// Returns the value where the slope vanishes, or the value at an end of the step if the slope
    /// vanishes nowhere.
    #[inline(always)]
    pub(crate) fn extremum(&self) -> N<T> {
        self.value(self.extremum_position())
    }

    /// Finds the s at which the slope vanishes, by Newton's method from the zero of a linear slope.
    /// Returns an end of the step if the slope vanishes nowhere in it.
    #[inline(always)]
    pub(crate) fn extremum_position(&self) -> N<T> {
        let c = &self.c;
        let slope_end = c[1] + 2.0 * c[2] + 3.0 * c[3] + 4.0 * c[4] + 5.0 * c[5];
        let mut s = clamp_to_step(c[1] / (c[1] - slope_end));
        for _ in 0..4 {
            s = clamp_to_step(s - self.slope(s) / self.curvature(s));
        }
        s
    }

    /// Returns the value at s.
    #[inline(always)]
    pub(crate) fn value(&self, s: N<T>) -> N<T> {
        let c = &self.c;
        c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))
    }

    /// Returns value and time derivatives at s, of a step of length `h`.
    #[inline(always)]
    pub(crate) fn sample(&self, s: N<T>, h: N<T>) -> Sample<T> {
        Sample {
            value: self.value(s),
            slope: self.slope(s) / h,
            curvature: self.curvature(s) / h / h,
        }
    }

    /// Returns the first derivative by s.
    #[inline(always)]
    fn slope(&self, s: N<T>) -> N<T> {
        let c = &self.c;
        c[1] + s * (2.0 * c[2] + s * (3.0 * c[3] + s * (4.0 * c[4] + (5.0 * s) * c[5])))
    }

    /// Returns the second derivative by s.
    #[inline(always)]
    fn curvature(&self, s: N<T>) -> N<T> {
        let c = &self.c;
        2.0 * c[2] + s * (6.0 * c[3] + s * (12.0 * c[4] + (20.0 * s) * c[5]))
    }
}

/// Clamps s to the range from 0 to 1; NaN becomes 1.
#[inline(always)]
pub(crate) fn clamp_to_step<T: Lane>(s: N<T>) -> N<T> {
    let s = s.where_less(s.lit(1.0), s, s.lit(1.0));
    s.lit(0.0).where_less(s, s, s.lit(0.0))
}

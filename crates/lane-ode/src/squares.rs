//! Integrates squares of outputs during integration, for root mean squares.

use crate::{Lane, N, Sample};

/// The integrals over time of the squares of `M` outputs.
///
/// Each step is integrated by the rule through values and first and second derivatives at both
/// ends. This rule is exact for polynomials of degree 5, so the error is of sixth order in the
/// step.
#[derive(Clone, Copy, Debug)]
pub struct SquareIntegrals<T, const M: usize> {
    integrals: [N<T>; M],
    /// The square and its two derivatives at the start of the next step.
    last_squares: [Sample<T>; M],
}

impl<T: Lane, const M: usize> SquareIntegrals<T, M> {
    /// Creates integrals without samples.
    #[inline(always)]
    pub fn new(zero: N<T>) -> Self {
        Self { integrals: [zero; M], last_squares: [Sample::constant(zero, zero); M] }
    }

    /// Sets the integrals of one lane to zero.
    pub fn reset(&mut self, lane: usize) {
        self.integrals.iter_mut().for_each(|integral| integral.0.set(lane, 0.0));
    }

    /// Returns the integrals of one lane, in the square of the output's unit times seconds.
    pub fn lane_integrals(&self, lane: usize) -> [f64; M] {
        self.integrals.map(|integral| integral.0.get(lane))
    }

    /// Sets the samples at the start of the first step.
    #[inline(always)]
    pub fn begin(&mut self, samples: &[Sample<T>; M]) {
        for i in 0..M {
            self.last_squares[i] = square_sample(&samples[i]);
        }
    }

    /// Adds a step of `length_s` from the last samples to `samples`, in the lanes in which
    /// `counted_lanes` is true.
    #[inline(always)]
    pub fn advance(&mut self, length_s: N<T>, samples: &[Sample<T>; M], counted_lanes: T::Mask) {
        let zero = length_s.lit(0.0);
        for i in 0..M {
            let start = self.last_squares[i];
            let end = square_sample(&samples[i]);
            // Hermite's rule, with the weights 1/2, 1/10 and 1/120 for the powers of the step.
            let end_terms = (0.5 * (start.value + end.value)).v();
            let slope_terms = (0.1 * (start.slope - end.slope)).v();
            let curvature_terms = ((1.0 / 120.0) * (start.curvature + end.curvature)).v();
            let mean_square = end_terms + length_s * (slope_terms + length_s * curvature_terms);
            self.integrals[i] +=
                N(T::select(counted_lanes, (length_s * mean_square).v().0, zero.0));
            self.last_squares[i] = end;
        }
    }
}

/// Returns an output's square with its derivatives.
#[inline(always)]
fn square_sample<T: Lane>(y: &Sample<T>) -> Sample<T> {
    Sample {
        value: (y.value * y.value).v(),
        slope: (2.0 * (y.value * y.slope).v()).v(),
        curvature: (2.0 * (y.slope * y.slope + y.value * y.curvature)).v(),
    }
}

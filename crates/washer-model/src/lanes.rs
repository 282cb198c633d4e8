//! Moving whole structures in and out of single lanes.

use lane_ode::{Lane, N};

/// A structure of lane values whose lanes each hold an `S`.
pub(crate) trait SetLane<S> {
    /// Overwrites lane `lane`.
    fn set_lane(&mut self, lane: usize, from: &S);
}

impl<T: Lane> SetLane<N<f64>> for N<T> {
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, from: &N<f64>) {
        self.0.set(lane, from.0);
    }
}

impl<A: SetLane<B>, B, const K: usize> SetLane<[B; K]> for [A; K] {
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, from: &[B; K]) {
        self.iter_mut().zip(from).for_each(|(to, from)| to.set_lane(lane, from));
    }
}

/// The reverse: one lane's value.
pub(crate) trait GetLane<S> {
    /// Reads lane `lane`.
    fn get_lane(&self, lane: usize) -> S;
}

impl<T: Lane> GetLane<N<f64>> for N<T> {
    #[inline(always)]
    fn get_lane(&self, lane: usize) -> N<f64> {
        N(self.0.get(lane))
    }
}

impl<A: GetLane<B>, B, const K: usize> GetLane<[B; K]> for [A; K] {
    #[inline(always)]
    fn get_lane(&self, lane: usize) -> [B; K] {
        core::array::from_fn(|i| self[i].get_lane(lane))
    }
}

/// A constant structure in every lane.
pub(crate) trait Splat<S> {
    /// `from` in every lane.
    fn splat(zero: Self::Number, from: &S) -> Self
    where
        Self: Sized;
    /// The lanes' number.
    type Number: Copy;
}

impl<T: Lane> Splat<N<f64>> for N<T> {
    type Number = N<T>;
    #[inline(always)]
    fn splat(zero: N<T>, from: &N<f64>) -> Self {
        zero.lit(from.0)
    }
}

impl<A: Splat<B> + Copy, B, const K: usize> Splat<[B; K]> for [A; K] {
    type Number = A::Number;
    #[inline(always)]
    fn splat(zero: A::Number, from: &[B; K]) -> Self {
        let mut all = [A::splat(zero, &from[0]); K];
        for i in 1..K {
            all[i] = A::splat(zero, &from[i]);
        }
        all
    }
}

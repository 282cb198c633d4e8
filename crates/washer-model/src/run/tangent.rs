//! A model's partial derivatives: the model once more, over lanes of dual numbers.

use crate::coordinates::STATES;
use crate::machine::spin::SpinStretch;
use crate::nonlinear::coupling::Coupling;
use crate::run::model::Model;
use crate::{COORDINATES, Point};
use lane_ode::{Dual, Lane, N, Partials};

/// A model over dual numbers, with the same trajectory in every lane. Each lane carries a direction
/// of its own.
pub(crate) struct Tangent<T, J> {
    zero: T,
    model: J,
}

impl<T: Lane, J: Model<Dual<T>>> Tangent<T, J> {
    #[inline(always)]
    pub(crate) fn new(zero: T, point: &Point) -> Self {
        Self { zero, model: J::splat(N(zero).constant(), point, Coupling::Springs) }
    }

    /// Puts a point in place.
    pub(crate) fn set_point(&mut self, point: &Point) {
        for lane in 0..T::LANES {
            self.model.set_point(lane, point);
        }
    }

    /// Puts a stretch of its spin in place.
    pub(crate) fn set_spin(&mut self, stretch: &SpinStretch) {
        for lane in 0..T::LANES {
            self.model.set_spin(lane, stretch);
        }
    }

    /// The derivatives of the accelerations at time `t_s` and state `x`.
    #[inline(always)]
    pub(crate) fn partials(
        &self,
        t_s: f64,
        x: &[N<f64>; STATES],
        partials: &mut Partials<COORDINATES>,
    ) {
        partials.find(self.zero, &self.model, t_s, x);
    }
}

//! Integrators whose lanes are trajectories. Each is compiled as a kernel of its own: one function
//! of all of them takes the compiler longer than all apart.

use crate::Formula;
use crate::coordinates::STATES;
use crate::run::model::Model;
use lane_ode::{Lane, Task, Tolerance, dop853, dopri5, rk4};

pub(crate) trait Stepper {
    fn integrate<T: Lane, P: Task<T, STATES, System: Model<T>>>(self, zero: T, task: &mut P);
}

/// One of fixed steps, as gears have it.
pub(crate) trait Fixed: Stepper {
    const NEW: Self;
    const FORMULA: Formula;
}

pub(crate) struct ByRk4;

impl Stepper for ByRk4 {
    #[inline(always)]
    fn integrate<T: Lane, P: Task<T, STATES, System: Model<T>>>(self, zero: T, task: &mut P) {
        rk4::integrate(zero, task);
    }
}

impl Fixed for ByRk4 {
    const NEW: Self = Self;
    const FORMULA: Formula = Formula::Rk4;
}

pub(crate) struct ByDop853;

impl Stepper for ByDop853 {
    #[inline(always)]
    fn integrate<T: Lane, P: Task<T, STATES, System: Model<T>>>(self, zero: T, task: &mut P) {
        dop853::integrate(zero, task);
    }
}

impl Fixed for ByDop853 {
    const NEW: Self = Self;
    const FORMULA: Formula = Formula::Dop853;
}

pub(crate) struct ByDopri5(pub(crate) Tolerance);

impl Stepper for ByDopri5 {
    #[inline(always)]
    fn integrate<T: Lane, P: Task<T, STATES, System: Model<T>>>(self, zero: T, task: &mut P) {
        dopri5::integrate(zero, task, &self.0);
    }
}

pub(crate) struct ByAdditive(pub(crate) Tolerance);

impl Stepper for ByAdditive {
    #[inline(always)]
    fn integrate<T: Lane, P: Task<T, STATES, System: Model<T>>>(self, zero: T, task: &mut P) {
        P::System::integrate_additive(zero, task, &self.0);
    }
}

//! The explicit Runge-Kutta formulas that run in fixed steps, and the longest steps at which they
//! are stable.

use crate::ModelKind;
use lane_ode::dop853::DOP853_STABILITY_LIMIT;
use lane_ode::rk4::RK4_STABILITY_LIMIT;

/// The part of a formula's limit of stability that is used.
///
/// Basis: rows of random machines (`examples/differential_test.rs`) stay within their error
/// estimates. Halving it doubles the cost of every level.
const STABILITY_SHARE: f64 = 0.97;

/// An explicit Runge-Kutta formula with a fixed step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Formula {
    /// The classical formula of order 4.
    Rk4,
    /// The formula of order 8 of Dormand and Prince.
    Dop853,
}

impl Formula {
    /// Returns the formula that integrates a model with capped modes.
    ///
    /// The linear model spends most of its time on its matrices, which are computed at every
    /// distinct instant of a step: two for order 4, eleven for order 8. Therefore order 4 takes
    /// less time.
    pub const fn for_model(model: ModelKind) -> Self {
        match model {
            ModelKind::Nonlinear => Self::Dop853,
            ModelKind::Linear => Self::Rk4,
        }
    }

    /// Returns the order of the formula: the power of the step to which its error is proportional.
    pub const fn order(self) -> u32 {
        match self {
            Self::Rk4 => 4,
            Self::Dop853 => 8,
        }
    }

    /// Returns the greatest product of step and frequency (rad) that is used.
    ///
    /// This is below the formula's limit of stability, because large motions may be faster than the
    /// eigenvalues about an equilibrium.
    pub const fn limit(self) -> f64 {
        match self {
            Self::Rk4 => STABILITY_SHARE * RK4_STABILITY_LIMIT,
            Self::Dop853 => STABILITY_SHARE * DOP853_STABILITY_LIMIT,
        }
    }
}

//! The method of single trajectories that belong to no row: no capped modes, and an error of some
//! 1e-9.

use washer_model::{Formula, Method, ModelKind, StepSelector};

use crate::method::REFERENCE_STEP_RATIO;

/// Maximum step (s) of the classical Runge-Kutta method. Basis: amplitudes of the paper's machine
/// have an error of some 1e-9. Doubling it makes the error 16 times as large.
const MAX_REFERENCE_STEP_S: f64 = 2e-4;

/// Maximum step (s) of the method of order 8 where forces have corners. Basis: in three rows of
/// four of `sweeps/friction.toml` the errors are below 1e-4. Doubling it halves the time and at
/// least doubles the errors.
const MAX_CORNER_STEP_S: f64 = 2.5e-4;

/// Returns the method of a single trajectory of a model.
pub(crate) fn reference_method(steps: &StepSelector<'_>, model: ModelKind) -> Method {
    if model == ModelKind::Nonlinear && steps.has_nonsmooth_force() {
        let stable_step_s = steps.uncapped_step_s(model).unwrap_or(f64::INFINITY);
        return Method::dop853(MAX_CORNER_STEP_S.min(0.5 * stable_step_s));
    }
    Method::rk4(reference_step_s(steps))
}

/// Returns the step (s) of classical Runge-Kutta for a single trajectory.
pub(crate) fn reference_step_s(steps: &StepSelector<'_>) -> f64 {
    let longest_step_s = steps.plain_step_s(Formula::Rk4).unwrap_or(f64::INFINITY);
    MAX_REFERENCE_STEP_S.min(REFERENCE_STEP_RATIO * longest_step_s)
}

//! The method of single trajectories that are no row's: nothing capped, converged to some 1e-9.

use washer_model::{Formula, Method, ModelKind, StepSelector};

use crate::method::REFERENCE_SHARE;

/// The step (s) of classical Runge-Kutta, where the machine allows it: amplitudes are converged to
/// about 1e-9.
const REFERENCE_STEP_S: f64 = 2e-4;

/// The step (s) of order 8 where forces have corners: their errors are below 1e-4 in three rows of
/// four of `sweeps/friction.toml`.
const CORNER_STEP_S: f64 = 2.5e-4;

/// Returns the method of a single trajectory.
pub(crate) fn reference(steps: &StepSelector<'_>, model: ModelKind) -> Method {
    if model == ModelKind::Nonlinear && steps.are_nonsmooth() {
        let stable_s = steps.uncapped_step_s(model).unwrap_or(f64::INFINITY);
        return Method::Dop853 { step_s: CORNER_STEP_S.min(0.5 * stable_s) };
    }
    Method::Rk4 { step_s: reference_step_s(steps) }
}

/// Returns the step (s) of classical Runge-Kutta for a single trajectory.
pub(crate) fn reference_step_s(steps: &StepSelector<'_>) -> f64 {
    let longest_s = steps.plain_step_s(Formula::Rk4).unwrap_or(f64::INFINITY);
    REFERENCE_STEP_S.min(REFERENCE_SHARE * longest_s)
}

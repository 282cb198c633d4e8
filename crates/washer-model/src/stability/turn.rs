//! The integration of a turn of the drum by classical Runge-Kutta, for several groups of lanes.

use crate::coordinates::{COORDINATES, HINGE_PITCH, HINGE_YAW, STATES};
use lane_ode::{Lane, N, System};

/// The equal steps of one turn of each lane's drum.
#[derive(Clone, Copy)]
pub(crate) struct StepGrid<T> {
    /// The length of a step (s).
    pub(super) step_s: N<T>,
    /// The number of steps of a turn.
    pub(super) step_count: usize,
    /// The factor of the hinge's speeds after each step, if the hinge is damped numerically.
    pub(super) hinge_damping_factor: Option<f64>,
}

impl<T: Lane> StepGrid<T> {
    /// Returns the time (s) after a number of steps.
    #[inline(always)]
    pub(super) fn time_s(&self, step_count: f64) -> N<T> {
        (self.step_s * step_count).v()
    }
}

/// The instant of each stage: 0 is the start of the step, 1 its middle, 2 its end.
const STAGE_INSTANTS: [usize; 4] = [0, 1, 1, 2];
/// The coefficients a21, a32 and a43 of the tableau; the last entry is not used.
pub(super) const A: [f64; 4] = [0.5, 0.5, 1.0, 0.0];
/// The weights b of the tableau.
pub(super) const B: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];

/// The forcing of a step: at its start, its middle and its end.
pub(super) type StepForcings<F> = [F; 3];

/// Returns the forcing of the first step.
#[inline(always)]
fn first_forcings<T: Lane, S: System<T, STATES>>(
    system: &S,
    grid: &StepGrid<T>,
) -> StepForcings<S::Forcing> {
    let mut forcings = [system.forcing_out_of_line(grid.time_s(0.0)); 3];
    // This is a loop, because a closure would be compiled without the instruction set.
    for instant in 1..3 {
        forcings[instant] = system.forcing_out_of_line(grid.time_s(0.5 * instant as f64));
    }
    forcings
}

/// Updates the forcing of the previous step to that of step `k`.
#[inline(always)]
fn update_forcings<T: Lane, S: System<T, STATES>>(
    system: &S,
    grid: &StepGrid<T>,
    k: usize,
    forcings: &mut StepForcings<S::Forcing>,
) {
    let k = k as f64;
    forcings[0] = forcings[2];
    // A loop compiles to a single copy of its code.
    for (instant, step_count) in [(1, 0.5), (2, 1.0)] {
        system.update_forcing(grid.time_s(k + step_count), &mut forcings[instant]);
    }
}

/// Integrates a step.
#[inline(always)]
pub(super) fn integrate_step<T: Lane, S: System<T, STATES>>(
    system: &S,
    h: N<T>,
    forcings: &StepForcings<S::Forcing>,
    x: &mut [N<T>; STATES],
) {
    compute_stages(system, h, forcings, x, STAGE_INSTANTS.len(), None::<(usize, &mut NoObserver)>);
}

/// Computes the first `stage_count` stages of a step; with all stages, `x` advances to the end of
/// the step. An observer receives the state at the start of the step.
#[inline(always)]
fn compute_stages<T: Lane, S: System<T, STATES>, W: StepObserver<T, S>>(
    system: &S,
    h: N<T>,
    forcings: &StepForcings<S::Forcing>,
    x: &mut [N<T>; STATES],
    stage_count: usize,
    mut observer: Option<(usize, &mut W)>,
) {
    let mut stage_state = *x;
    let mut next_state = *x;
    for stage in 0..stage_count {
        let slope = system.derivative(&forcings[STAGE_INSTANTS[stage]], &stage_state);
        if stage == 0
            && let Some((k, observer)) = &mut observer
        {
            observer.observe(*k, &forcings[0], x, &slope);
        }
        let a_step = (h * A[stage]).v();
        let b_step = (h * B[stage]).v();
        if stage == STAGE_INSTANTS.len() - 1 {
            for i in 0..STATES {
                x[i] = next_state[i] + b_step * slope[i];
            }
            return;
        }
        for i in 0..STATES {
            stage_state[i] = x[i] + a_step * slope[i];
            next_state[i] += b_step * slope[i];
        }
    }
}

/// An observer of the states of a turn.
pub(crate) trait StepObserver<T: Lane, S: System<T, STATES>> {
    /// Receives the state at the start of step `k` with its slope, and finally the state at the
    /// turn's end.
    fn observe(&mut self, k: usize, forcing: &S::Forcing, x: &[N<T>; STATES], dx: &[N<T>; STATES]);
}

/// The observer of turns that are not recorded.
pub(super) struct NoObserver;

impl<T: Lane, S: System<T, STATES>> StepObserver<T, S> for NoObserver {
    #[inline(always)]
    fn observe(&mut self, _: usize, _: &S::Forcing, _: &[N<T>; STATES], _: &[N<T>; STATES]) {}
}

/// Integrates a turn from each of `states`. The observer receives the states of the first turn.
#[inline(always)]
pub(crate) fn integrate_turn<T: Lane, S: System<T, STATES>, W: StepObserver<T, S>>(
    system: &S,
    grid: &StepGrid<T>,
    states: &mut [[N<T>; STATES]],
    mut observer: Option<&mut W>,
) {
    let mut forcings = first_forcings(system, grid);
    // An observer needs a further step for the slope at the turn's end.
    let step_count = grid.step_count + usize::from(observer.is_some());
    for k in 0..step_count {
        if k > 0 {
            update_forcings(system, grid, k, &mut forcings);
        }
        let stage_count = if k < grid.step_count { STAGE_INSTANTS.len() } else { 1 };
        for (index, x) in states.iter_mut().enumerate() {
            let observer = match &mut observer {
                Some(observer) if index == 0 => Some((k, &mut **observer)),
                _ => None,
            };
            compute_stages(system, grid.step_s, &forcings, x, stage_count, observer);
            // The further step changes no state.
            if let Some(damping_factor) = grid.hinge_damping_factor
                && k < grid.step_count
            {
                for i in [HINGE_YAW, HINGE_PITCH] {
                    x[COORDINATES + i] = (x[COORDINATES + i] * damping_factor).v();
                }
            }
        }
    }
}

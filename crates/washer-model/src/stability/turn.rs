//! A turn of the drum by classical Runge-Kutta: states in lanes, several of them side by side.

use crate::coordinates::STATES;
use lane_ode::{Lane, N, System};

/// Even steps over one turn of each lane's drum.
#[derive(Clone, Copy)]
pub(crate) struct Clock<T> {
    /// Length of a step (s).
    pub(super) step_s: N<T>,
    /// Steps a turn.
    pub(super) steps: usize,
}

impl<T: Lane> Clock<T> {
    /// Time (s) at a number of steps.
    #[inline(always)]
    pub(super) fn time_s(&self, steps: f64) -> N<T> {
        (self.step_s * steps).v()
    }
}

/// Of each stage of the formula which of start, middle and end of a step it is evaluated at,
const AT: [usize; 4] = [0, 1, 1, 2];
/// when that is, as a share of the step,
pub(super) const WHEN: [f64; 4] = [0.0, 0.5, 0.5, 1.0];
/// how far along its slope the next stage is, as a share of the step,
pub(super) const REACH: [f64; 4] = [0.5, 0.5, 1.0, 0.0];
/// and what its slope has in the step.
pub(super) const WEIGHT: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];

/// The forcing of a step: at its start, its middle and its end.
pub(super) type Forcings<F> = [F; 3];

/// Those of the first step.
#[inline(always)]
fn first<T: Lane, S: System<T, STATES>>(system: &S, clock: &Clock<T>) -> Forcings<S::Forcing> {
    let start = system.forcing(clock.time_s(0.0));
    let mut forcings = [start; 3];
    system.renew(clock.time_s(0.5), &mut forcings[1]);
    system.renew(clock.time_s(1.0), &mut forcings[2]);
    forcings
}

/// Those of step `k`, from those of the one before.
#[inline(always)]
fn next<T: Lane, S: System<T, STATES>>(
    system: &S,
    clock: &Clock<T>,
    k: usize,
    forcings: &mut Forcings<S::Forcing>,
) {
    let k = k as f64;
    forcings[0] = forcings[2];
    system.renew(clock.time_s(k + 0.5), &mut forcings[1]);
    system.renew(clock.time_s(k + 1.0), &mut forcings[2]);
}

/// One step; gives the slope at its start.
#[inline(always)]
pub(super) fn step<T: Lane, S: System<T, STATES>>(
    system: &S,
    h: N<T>,
    forcings: &Forcings<S::Forcing>,
    x: &mut [N<T>; STATES],
) -> [N<T>; STATES] {
    let start = *x;
    let mut along = start;
    let mut first = start;
    for stage in 0..4 {
        let slope = system.derivative(&forcings[AT[stage]], &along);
        if stage == 0 {
            first = slope;
        }
        let (reach, weight) = ((h * REACH[stage]).v(), (h * WEIGHT[stage]).v());
        for i in 0..STATES {
            along[i] = start[i] + reach * slope[i];
            x[i] += weight * slope[i];
        }
    }
    first
}

/// Takes what is to be seen of a turn.
pub(crate) trait Watch<T: Lane, S: System<T, STATES>> {
    /// The state at the start of step `k`, with its slope; at last the turn's end.
    fn see(&mut self, k: usize, forcing: &S::Forcing, x: &[N<T>; STATES], dx: &[N<T>; STATES]);
}

/// Sees nothing.
pub(super) struct Unwatched;

impl<T: Lane, S: System<T, STATES>> Watch<T, S> for Unwatched {
    #[inline(always)]
    fn see(&mut self, _: usize, _: &S::Forcing, _: &[N<T>; STATES], _: &[N<T>; STATES]) {}
}

/// One turn of every one of these states; the first is watched, if any is.
#[inline(always)]
pub(crate) fn turn<T: Lane, S: System<T, STATES>, W: Watch<T, S>>(
    system: &S,
    clock: &Clock<T>,
    states: &mut [[N<T>; STATES]],
    mut watch: Option<&mut W>,
) {
    let mut forcings = first(system, clock);
    // The step after the last is for the slope at the turn's end.
    let steps = clock.steps + usize::from(watch.is_some());
    for k in 0..steps {
        if k > 0 {
            next(system, clock, k, &mut forcings);
        }
        let is_over = k == clock.steps;
        for (place, x) in states.iter_mut().enumerate() {
            let at = *x;
            let slope = step(system, clock.step_s, &forcings, x);
            if place == 0
                && let Some(watch) = &mut watch
            {
                watch.see(k, &forcings[0], &at, &slope);
            }
            if is_over {
                *x = at;
            }
        }
    }
}

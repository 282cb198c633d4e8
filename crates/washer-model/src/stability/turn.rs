//! A turn of the drum by classical Runge-Kutta: states in lanes, several of them side by side.

use crate::coordinates::{COORDINATES, HINGE_PITCH, HINGE_YAW, STATES};
use lane_ode::{Lane, N, System};

/// Even steps over one turn of each lane's drum.
#[derive(Clone, Copy)]
pub(crate) struct Clock<T> {
    /// Length of a step (s).
    pub(super) step_s: N<T>,
    /// Steps a turn.
    pub(super) steps: usize,
    /// The part of the hinge's speeds that a step leaves, where it is damped.
    pub(super) hinge_kept: Option<f64>,
}

impl<T: Lane> Clock<T> {
    /// Returns the time (s) at a number of steps.
    #[inline(always)]
    pub(super) fn time_s(&self, steps: f64) -> N<T> {
        (self.step_s * steps).v()
    }
}

/// The instants of the formula's stages: 0 is the start of a step, 1 its middle, 2 its end.
const AT: [usize; 4] = [0, 1, 1, 2];
/// The distance of the next stage along each stage's slope, as a share of the step: the
/// coefficients a of the tableau.
pub(super) const NEXT_STAGE: [f64; 4] = [0.5, 0.5, 1.0, 0.0];
/// The weights of the stages' slopes in the step: the coefficients b of the tableau.
pub(super) const WEIGHT: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];

/// The forcing of a step: at its start, its middle and its end.
pub(super) type Forcings<F> = [F; 3];

/// Returns the instants of the first step.
#[inline(always)]
fn first<T: Lane, S: System<T, STATES>>(system: &S, clock: &Clock<T>) -> Forcings<S::Forcing> {
    let mut forcings = [system.forcing_aside(clock.time_s(0.0)); 3];
    // No closure: it would be compiled without the instruction set.
    for place in 1..3 {
        forcings[place] = system.forcing_aside(clock.time_s(0.5 * place as f64));
    }
    forcings
}

/// Returns the instants of step `k`, from those of the step before.
#[inline(always)]
fn next<T: Lane, S: System<T, STATES>>(
    system: &S,
    clock: &Clock<T>,
    k: usize,
    forcings: &mut Forcings<S::Forcing>,
) {
    let k = k as f64;
    forcings[0] = forcings[2];
    // A loop, for one copy of its code.
    for (place, steps) in [(1, 0.5), (2, 1.0)] {
        system.renew(clock.time_s(k + steps), &mut forcings[place]);
    }
}

/// Integrates a step.
#[inline(always)]
pub(super) fn step<T: Lane, S: System<T, STATES>>(
    system: &S,
    h: N<T>,
    forcings: &Forcings<S::Forcing>,
    x: &mut [N<T>; STATES],
) {
    stages(system, h, forcings, x, AT.len(), None::<(usize, &mut Unwatched)>);
}

/// Computes the first stages of a step, which all of them take. Its start is seen.
#[inline(always)]
fn stages<T: Lane, S: System<T, STATES>, W: Watch<T, S>>(
    system: &S,
    h: N<T>,
    forcings: &Forcings<S::Forcing>,
    x: &mut [N<T>; STATES],
    count: usize,
    mut watch: Option<(usize, &mut W)>,
) {
    let mut along = *x;
    let mut end = *x;
    for stage in 0..count {
        let slope = system.derivative(&forcings[AT[stage]], &along);
        if stage == 0
            && let Some((k, watch)) = &mut watch
        {
            watch.see(*k, &forcings[0], x, &slope);
        }
        let reach = (h * NEXT_STAGE[stage]).v();
        let weight = (h * WEIGHT[stage]).v();
        if stage == AT.len() - 1 {
            for i in 0..STATES {
                x[i] = end[i] + weight * slope[i];
            }
            return;
        }
        for i in 0..STATES {
            along[i] = x[i] + reach * slope[i];
            end[i] += weight * slope[i];
        }
    }
}

/// Takes what is to be seen of a turn.
pub(crate) trait Watch<T: Lane, S: System<T, STATES>> {
    /// Returns the state at the start of step `k`, with its slope; at last the turn's end.
    fn see(&mut self, k: usize, forcing: &S::Forcing, x: &[N<T>; STATES], dx: &[N<T>; STATES]);
}

/// Sees nothing.
pub(super) struct Unwatched;

impl<T: Lane, S: System<T, STATES>> Watch<T, S> for Unwatched {
    #[inline(always)]
    fn see(&mut self, _: usize, _: &S::Forcing, _: &[N<T>; STATES], _: &[N<T>; STATES]) {}
}

/// Integrates a turn of every one of these states; the first is watched, if any is.
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
        let count = if k < clock.steps { AT.len() } else { 1 };
        for (place, x) in states.iter_mut().enumerate() {
            let watch = match &mut watch {
                Some(watch) if place == 0 => Some((k, &mut **watch)),
                _ => None,
            };
            stages(system, clock.step_s, &forcings, x, count, watch);
            // The step after the last changes no state.
            if let Some(kept) = clock.hinge_kept
                && k < clock.steps
            {
                for i in [HINGE_YAW, HINGE_PITCH] {
                    x[COORDINATES + i] = (x[COORDINATES + i] * kept).v();
                }
            }
        }
    }
}

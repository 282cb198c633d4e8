//! What a turn does to small disturbances of a response.
//!
//! A disturbance d obeys d'' = K(t) d + C(t) d', with the partial derivatives of the accelerations
//! along the response. Over a turn these are smooth and periodic, so dual numbers give them at a
//! few even instants, and the trigonometric polynomial through those at all others. Classical
//! Runge-Kutta takes all disturbances through the turn together.

use super::turn::{AT, Clock, REACH, WEIGHT};
use crate::coordinates::{COORDINATES, STATES};
use crate::run::model::Nonlinear;
use core::array::from_fn;
use lane_ode::{Dual, Lane, N, System as _, trig};

/// Instants a turn at which the derivatives are taken: harmonics of the turn up to the seventh.
pub(super) const INSTANTS: usize = 16;

/// Disturbances taken through a step at once, so that they stay in the nearest cache.
const BLOCK: usize = 4;

/// Derivatives interpolated at once, whose sums then stay in registers.
const TOGETHER: usize = 10;

/// Of every acceleration, its derivative by each coordinate, then by each speed.
pub(super) type Slopes<T> = [[N<T>; STATES]; COORDINATES];

/// The derivatives at states of even instants of a turn, the first at its start.
#[inline(always)]
pub(super) fn slopes_along<T: Lane>(
    zero: N<T>,
    model: &Nonlinear<Dual<T>>,
    clock: &Clock<T>,
    states: &[[N<T>; STATES]],
) -> Vec<Slopes<T>> {
    let every = clock.steps / INSTANTS;
    let mut along = vec![[[zero; STATES]; COORDINATES]; INSTANTS];
    for (k, slopes) in along.iter_mut().enumerate() {
        let forcing = model.forcing(clock.time_s((k * every) as f64).constant());
        let mut state = [zero.constant(); STATES];
        for i in 0..STATES {
            state[i] = states[k][i].constant();
        }
        for j in 0..STATES {
            state[j].0.slope = zero.lit(1.0).0;
            let derivative = model.derivative(&forcing, &state);
            state[j].0.slope = zero.0;
            for i in 0..COORDINATES {
                slopes[i][j] = N(derivative[COORDINATES + i].0.slope);
            }
        }
    }
    along
}

/// Where each unit disturbance of the start is after the turn: by the disturbed coordinate or
/// speed, then by the coordinate or speed of the end. The weights are those of [`weights`].
#[inline(always)]
pub(super) fn monodromy<T: Lane>(
    zero: N<T>,
    along: &[Slopes<T>],
    weights: &[[f64; INSTANTS]],
    clock: &Clock<T>,
) -> Vec<[N<T>; STATES]> {
    let mut columns = vec![[zero; STATES]; STATES];
    for j in 0..STATES {
        columns[j][j] = zero.lit(1.0);
    }
    // Of a step the start, the middle and the end; start and end change places.
    let mut at = [along[0], along[0], along[0]];
    let (mut start, mut end) = (0, 2);
    for k in 0..clock.steps {
        (start, end) = (end, start);
        between(zero, along, weights, 2 * k + 1, &mut at[1]);
        between(zero, along, weights, 2 * k + 2, &mut at[end]);
        let slopes = [&at[start], &at[1], &at[end]];
        for block in columns.chunks_exact_mut(BLOCK) {
            step(zero, clock.step_s, slopes, block);
        }
    }
    columns
}

/// Weights of the values at [`INSTANTS`] even instants in the trigonometric polynomial through
/// them, at each place from the first instant up to the second where turns of so many steps need
/// them: at the ends of steps and halfway between.
pub(super) fn weights(steps: usize) -> Vec<[f64; INSTANTS]> {
    let parts = 2 * steps / INSTANTS;
    let weight = |place: usize, instant: usize| {
        let turns = (place as f64 / parts as f64 - instant as f64) / INSTANTS as f64;
        let cosine = |harmonic: usize| trig::sin_cos_turns(N(harmonic as f64 * turns)).1.0;
        let harmonics: f64 = (1..INSTANTS / 2).map(|harmonic| 2.0 * cosine(harmonic)).sum();
        (1.0 + harmonics + cosine(INSTANTS / 2)) / INSTANTS as f64
    };
    (0..parts).map(|place| from_fn(|instant| weight(place, instant))).collect()
}

/// The derivatives at one of the places of [`weights`], counted through the turn.
#[inline(always)]
fn between<T: Lane>(
    zero: N<T>,
    along: &[Slopes<T>],
    weights: &[[f64; INSTANTS]],
    place: usize,
    slopes: &mut Slopes<T>,
) {
    let (first, part) = (place / weights.len(), place % weights.len());
    if part == 0 {
        *slopes = along[first % INSTANTS];
        return;
    }
    let mut factors = [zero; INSTANTS];
    for instant in 0..INSTANTS {
        factors[(first + instant) % INSTANTS] = zero.lit(weights[part][instant]);
    }
    for i in 0..COORDINATES {
        for first in (0..STATES).step_by(TOGETHER) {
            let mut sums = [zero; TOGETHER];
            for instant in 0..INSTANTS {
                for j in 0..TOGETHER {
                    sums[j] += along[instant][i][first + j] * factors[instant];
                }
            }
            slopes[i][first..first + TOGETHER].copy_from_slice(&sums);
        }
    }
}

/// One step of some disturbances; the derivatives are those at its start, middle and end.
#[inline(always)]
fn step<T: Lane>(zero: N<T>, h: N<T>, at: [&Slopes<T>; 3], block: &mut [[N<T>; STATES]]) {
    let mut along = [[zero; STATES]; BLOCK];
    along.copy_from_slice(block);
    let start = along;
    for stage in 0..4 {
        let slopes = at[AT[stage]];
        let mut accelerations = [[zero; COORDINATES]; BLOCK];
        // Rows by two, so that what is loaded of a disturbance serves both.
        for i in (0..COORDINATES).step_by(2) {
            let mut sums = [[zero; BLOCK]; 2];
            for j in 0..STATES {
                for c in 0..BLOCK {
                    sums[0][c] += slopes[i][j] * along[c][j];
                    sums[1][c] += slopes[i + 1][j] * along[c][j];
                }
            }
            for c in 0..BLOCK {
                accelerations[c][i] = sums[0][c];
                accelerations[c][i + 1] = sums[1][c];
            }
        }
        let (reach, weight) = ((h * REACH[stage]).v(), (h * WEIGHT[stage]).v());
        for c in 0..BLOCK {
            for i in 0..COORDINATES {
                let (speed, acceleration) = (along[c][COORDINATES + i], accelerations[c][i]);
                along[c][i] = start[c][i] + reach * speed;
                block[c][i] += weight * speed;
                along[c][COORDINATES + i] = start[c][COORDINATES + i] + reach * acceleration;
                block[c][COORDINATES + i] += weight * acceleration;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;

    #[test]
    fn a_trigonometric_polynomial_is_met_between_its_instants() {
        let wave = |turns: f64| 0.3 + (TAU * turns).sin() - 0.5 * (7.0 * TAU * turns + 0.2).cos();
        let values: [f64; INSTANTS] = from_fn(|k| wave(k as f64 / INSTANTS as f64));
        for (part, weights) in weights(5 * INSTANTS / 2).iter().enumerate() {
            let sum: f64 = weights.iter().zip(values).map(|(weight, value)| weight * value).sum();
            let turns = part as f64 / 5.0 / INSTANTS as f64;
            assert!((sum - wave(turns)).abs() < 1e-14, "{part}: {sum}");
        }
    }
}

//! What a turn does to small disturbances of a response.
//!
//! A disturbance d obeys d'' = K(t) d + C(t) d', with the partial derivatives of the accelerations
//! along the response. Over a turn these are smooth and periodic, so dual numbers give them at a
//! few even instants, and the trigonometric polynomial through those at all others. Classical
//! Runge-Kutta takes all disturbances through the turn together.

use super::turn::{Clock, REACH, WEIGHT, WHEN};
use crate::coordinates::{COORDINATES, STATES};
use crate::run::model::Nonlinear;
use lane_ode::{Dual, Lane, N, System, trig};

/// Instants a turn at which the derivatives are taken, at most: harmonics of the turn up to the
/// seventh.
pub(super) const INSTANTS: usize = 16;

/// Disturbances taken through a step at once, so that they stay in the nearest cache.
const BLOCK: usize = 5;

/// Steps whose derivatives are kept at once, where they are taken in every step.
const STEPS_AT_ONCE: usize = 32;

/// Derivatives interpolated at once, whose sums then stay in registers.
const TOGETHER: usize = 10;

/// Of every acceleration, its derivative by each coordinate, then by each speed.
pub(super) type Slopes<T> = [[N<T>; STATES]; COORDINATES];

/// The derivatives at so many even instants of a turn, the first at its start, of its states at
/// [`INSTANTS`] of them.
#[inline(always)]
pub(super) fn slopes_along<T: Lane>(
    zero: N<T>,
    model: &Nonlinear<Dual<T>>,
    clock: &Clock<T>,
    states: &[[N<T>; STATES]],
    instants: usize,
) -> Vec<Slopes<T>> {
    let (every, of_states) = (clock.steps / instants, INSTANTS / instants);
    let mut along = Vec::with_capacity(instants);
    for k in 0..instants {
        let forcing = model.forcing(clock.time_s((k * every) as f64).constant());
        let mut found = [[zero; STATES]; COORDINATES];
        slopes(zero, model, &forcing, &states[k * of_states], &mut found);
        along.push(found);
    }
    along
}

/// Where each unit disturbance of the start is after the turn: by the disturbed coordinate or
/// speed, then by the coordinate or speed of the end. The weights are those of [`weights`].
#[inline(always)]
pub(super) fn monodromy<T: Lane>(
    zero: N<T>,
    along: &[Slopes<T>],
    weights: &[Vec<f64>],
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
        let slopes = [&at[start], &at[1], &at[1], &at[end]];
        for block in columns.chunks_exact_mut(BLOCK) {
            step(zero, clock.step_s, slopes, block);
        }
    }
    columns
}

/// As [`monodromy`] of some rows in lanes, each by itself, where forces have corners: the
/// derivatives are those at every stage of every step, so that it is the derivative of what the
/// steps do. `path` has the states at the steps' starts. `model` and `clock` have the rows one
/// after another, again and again: lanes share a row's steps, then its disturbances.
#[inline(always)]
pub(super) fn along_every_step<T: Lane>(
    zero: N<T>,
    model: &Nonlinear<Dual<T>>,
    clock: &Clock<T>,
    path: &[[N<T>; STATES]],
    rows: usize,
) -> Vec<Vec<[N<T>; STATES]>> {
    let shares = T::LANES / rows;
    let mut columns = vec![vec![[zero; STATES]; STATES.div_ceil(BLOCK * T::LANES) * BLOCK]; rows];
    for columns in &mut columns {
        for j in 0..STATES {
            columns[j / T::LANES][j].0.set(j % T::LANES, 1.0);
        }
    }
    let mut slopes = vec![[[[[0.0; STATES]; COORDINATES]; 4]; STEPS_AT_ONCE]; rows];
    let mut steps = vec![0; T::LANES];
    for first in (0..clock.steps).step_by(STEPS_AT_ONCE) {
        let last = (first + STEPS_AT_ONCE).min(clock.steps) - 1;
        for step in (first..=last).step_by(shares) {
            for lane in 0..T::LANES {
                steps[lane] = (step + (lane / rows).min(shares - 1)).min(last);
            }
            let found = slopes_of_stages(zero, model, clock, path, rows, &steps);
            for lane in 0..T::LANES {
                let of_step = &mut slopes[lane % rows][steps[lane] - first];
                for stage in 0..4 {
                    for i in 0..COORDINATES {
                        for j in 0..STATES {
                            of_step[stage][i][j] = found[stage][i][j].0.get(lane);
                        }
                    }
                }
            }
        }
        for row in 0..rows {
            let step_s = zero.lit(clock.step_s.0.get(row));
            for k in 0..=last - first {
                let mut at = [[[zero; STATES]; COORDINATES]; 4];
                for stage in 0..4 {
                    for i in 0..COORDINATES {
                        for j in 0..STATES {
                            at[stage][i][j] = zero.lit(slopes[row][k][stage][i][j]);
                        }
                    }
                }
                let stages = [&at[0], &at[1], &at[2], &at[3]];
                for block in columns[row].chunks_exact_mut(BLOCK) {
                    step(zero, step_s, stages, block);
                }
            }
        }
    }
    columns
}

/// The derivatives at the stages of each lane's step of the path.
#[inline(always)]
fn slopes_of_stages<T: Lane>(
    zero: N<T>,
    model: &Nonlinear<Dual<T>>,
    clock: &Clock<T>,
    path: &[[N<T>; STATES]],
    rows: usize,
    steps: &[usize],
) -> [Slopes<T>; 4] {
    let (mut step, mut start) = (zero, [zero; STATES]);
    for lane in 0..T::LANES {
        step.0.set(lane, steps[lane] as f64);
        for i in 0..STATES {
            start[i].0.set(lane, path[steps[lane]][i].0.get(lane % rows));
        }
    }
    let mut found = [[[zero; STATES]; COORDINATES]; 4];
    let mut along = start;
    for stage in 0..4 {
        let time_s = (clock.step_s * (step + WHEN[stage])).v();
        let forcing = model.forcing(time_s.constant());
        let rate = slopes(zero, model, &forcing, &along, &mut found[stage]);
        let reach = (clock.step_s * REACH[stage]).v();
        for i in 0..STATES {
            along[i] = start[i] + reach * rate[i];
        }
    }
    found
}

/// The derivatives at a state; gives the state's derivative by time.
#[inline(always)]
fn slopes<T: Lane>(
    zero: N<T>,
    model: &Nonlinear<Dual<T>>,
    forcing: &<Nonlinear<Dual<T>> as System<Dual<T>, STATES>>::Forcing,
    at: &[N<T>; STATES],
    slopes: &mut Slopes<T>,
) -> [N<T>; STATES] {
    let (mut state, mut rate) = ([zero.constant(); STATES], [zero; STATES]);
    for i in 0..STATES {
        state[i] = at[i].constant();
    }
    for j in 0..STATES {
        state[j].0.slope = zero.lit(1.0).0;
        let derivative = model.derivative(forcing, &state);
        state[j].0.slope = zero.0;
        for i in 0..COORDINATES {
            slopes[i][j] = N(derivative[COORDINATES + i].0.slope);
        }
        for i in 0..STATES {
            rate[i] = N(derivative[i].0.value);
        }
    }
    rate
}

/// Weights of the values at so many even instants in the trigonometric polynomial through them, at
/// each place from the first instant up to the second where turns of so many steps need them: at
/// the ends of steps and halfway between.
pub(super) fn weights(steps: usize, instants: usize) -> Vec<Vec<f64>> {
    let parts = 2 * steps / instants;
    let weight = |place: usize, instant: usize| {
        let turns = (place as f64 / parts as f64 - instant as f64) / instants as f64;
        let cosine = |harmonic: usize| trig::sin_cos_turns(N(harmonic as f64 * turns)).1.0;
        let harmonics: f64 = (1..instants / 2).map(|harmonic| 2.0 * cosine(harmonic)).sum();
        (1.0 + harmonics + cosine(instants / 2)) / instants as f64
    };
    let of_place = |place| (0..instants).map(|instant| weight(place, instant)).collect();
    (0..parts).map(of_place).collect()
}

/// The derivatives at one of the places of [`weights`], counted through the turn.
#[inline(always)]
fn between<T: Lane>(
    zero: N<T>,
    along: &[Slopes<T>],
    weights: &[Vec<f64>],
    place: usize,
    slopes: &mut Slopes<T>,
) {
    let (first, part) = (place / weights.len(), place % weights.len());
    if part == 0 {
        *slopes = along[first % along.len()];
        return;
    }
    let mut factors = [zero; INSTANTS];
    for (instant, weight) in weights[part].iter().enumerate() {
        factors[(first + instant) % along.len()] = zero.lit(*weight);
    }
    for i in 0..COORDINATES {
        for first in (0..STATES).step_by(TOGETHER) {
            let mut sums = [zero; TOGETHER];
            for instant in 0..along.len() {
                for j in 0..TOGETHER {
                    sums[j] += along[instant][i][first + j] * factors[instant];
                }
            }
            slopes[i][first..first + TOGETHER].copy_from_slice(&sums);
        }
    }
}

/// One step of some disturbances; the derivatives are those at its stages.
#[inline(always)]
fn step<T: Lane>(zero: N<T>, h: N<T>, at: [&Slopes<T>; 4], block: &mut [[N<T>; STATES]]) {
    let mut along = [[zero; STATES]; BLOCK];
    along.copy_from_slice(block);
    let start = along;
    for stage in 0..4 {
        let slopes = at[stage];
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
    use core::array::from_fn;
    use core::f64::consts::TAU;

    #[test]
    fn a_trigonometric_polynomial_is_met_between_its_instants() {
        let wave = |turns: f64| 0.3 + (TAU * turns).sin() - 0.5 * (7.0 * TAU * turns + 0.2).cos();
        let values: [f64; INSTANTS] = from_fn(|k| wave(k as f64 / INSTANTS as f64));
        for (part, weights) in weights(5 * INSTANTS / 2, INSTANTS).iter().enumerate() {
            let sum: f64 = weights.iter().zip(values).map(|(weight, value)| weight * value).sum();
            let turns = part as f64 / 5.0 / INSTANTS as f64;
            assert!((sum - wave(turns)).abs() < 1e-14, "{part}: {sum}");
        }
    }
}

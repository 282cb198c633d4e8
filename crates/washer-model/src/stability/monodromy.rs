//! What a turn does to small disturbances of a response.
//!
//! A disturbance d obeys d'' = K(t) d + C(t) d', with the partial derivatives of the accelerations
//! along the response, which dual numbers give. Over a turn these are smooth and periodic, so that
//! they are taken at a few even instants, and from the trigonometric polynomial through those at
//! all others. Where forces have corners, they are taken at every stage of every step, so that what
//! is found is the derivative of what the steps do. Classical Runge-Kutta takes all disturbances
//! through the turn together. Lanes share a row's instants, then its disturbances.

use super::turn::{Clock, REACH, WEIGHT, WHEN};
use crate::coordinates::{COORDINATES, STATES};
use crate::run::model::Nonlinear;
use core::ops::Range;
use lane_ode::{Dual, Lane, MAX_LANES, N, System, trig};

/// Instants a turn at which the derivatives are taken, at most: harmonics of the turn up to the
/// seventh.
pub(super) const INSTANTS: usize = 16;

/// Rows and columns of a state's disturbance.
pub(super) type Square = [[N<f64>; STATES]; STATES];

/// Disturbances taken through a step at once, so that they stay in the nearest cache.
const BLOCK: usize = 5;

/// Steps whose derivatives are kept at once: as many for every turn.
const AT_ONCE: usize = 8;

/// Of every acceleration, its derivative by each coordinate, then by each speed.
type Slopes = [[N<f64>; STATES]; COORDINATES];

/// Rows along their turns.
pub(super) struct Along<'a, T> {
    /// In lanes one row after another, again and again.
    pub(super) model: Nonlinear<Dual<T>>,
    pub(super) clock: Clock<T>,
    pub(super) rows: usize,
    /// At how many even places of a turn derivatives are taken: of every step where forces have
    /// corners.
    pub(super) places: usize,
    /// States in the rows' lanes, at so many places of the turn or at a multiple of them.
    pub(super) path: &'a [[N<T>; STATES]],
}

impl<T: Lane> Along<'_, T> {
    /// Of each row what its turn makes of disturbances of its start. The weights are those of
    /// [`weights`]; none where forces have corners.
    #[inline(always)]
    pub(super) fn monodromies(&self, zero: N<T>, weights: &[Vec<f64>]) -> Vec<Square> {
        let has_corners = weights.is_empty();
        let mut taken: Vec<Vec<Slopes>> = vec![Vec::new(); self.rows];
        if !has_corners {
            self.take(zero, 0..self.places, 1, &mut taken);
        }
        let vectors = STATES.div_ceil(BLOCK * T::LANES) * BLOCK;
        let mut columns = vec![vec![[zero; STATES]; vectors]; self.rows];
        for columns in &mut columns {
            for j in 0..STATES {
                columns[j / T::LANES][j].0.set(j % T::LANES, 1.0);
            }
        }
        let mut between = [[[N(0.0); STATES]; COORDINATES]; 2 * AT_ONCE + 1];
        for first in (0..self.clock.steps).step_by(AT_ONCE) {
            if has_corners {
                self.take(zero, first..first + AT_ONCE, WHEN.len(), &mut taken);
            }
            for (row, columns) in columns.iter_mut().enumerate() {
                if !has_corners {
                    for (k, slopes) in between.iter_mut().enumerate() {
                        interpolate(&taken[row], weights, 2 * first + k, slopes);
                    }
                }
                let step_s = zero.lit(self.clock.step_s.0.get(row));
                for k in 0..AT_ONCE {
                    let (of, [b, c, d]) = if has_corners {
                        (&taken[row][WHEN.len() * k..], [1, 2, 3])
                    } else {
                        (&between[2 * k..], [1, 1, 2])
                    };
                    for block in columns.chunks_exact_mut(BLOCK) {
                        step(zero, step_s, [&of[0], &of[b], &of[c], &of[d]], block);
                    }
                }
            }
        }
        let mut found = vec![[[N(0.0); STATES]; STATES]; self.rows];
        for (found, columns) in found.iter_mut().zip(&columns) {
            for i in 0..STATES {
                for j in 0..STATES {
                    found[i][j] = N(columns[j / T::LANES][i].0.get(j % T::LANES));
                }
            }
        }
        found
    }

    /// Of each row the derivatives at the first stages of steps that begin at some places.
    #[inline(always)]
    fn take(&self, zero: N<T>, places: Range<usize>, stages: usize, taken: &mut [Vec<Slopes>]) {
        let (shares, last) = (T::LANES / self.rows, places.end - 1);
        let (every, steps) = (self.path.len() / self.places, self.clock.steps / self.places);
        for taken in &mut *taken {
            taken.resize(stages * places.len(), [[N(0.0); STATES]; COORDINATES]);
        }
        let mut at = [0; MAX_LANES];
        let mut found = [[zero; STATES]; COORDINATES];
        for place in places.clone().step_by(shares) {
            let (mut step, mut start) = (zero, [zero; STATES]);
            for lane in 0..T::LANES {
                at[lane] = (place + (lane / self.rows).min(shares - 1)).min(last);
                step.0.set(lane, (at[lane] * steps) as f64);
                for i in 0..STATES {
                    start[i].0.set(lane, self.path[at[lane] * every][i].0.get(lane % self.rows));
                }
            }
            let mut along = start;
            for stage in 0..stages {
                let time_s = (self.clock.step_s * (step + WHEN[stage])).v();
                let rate = self.slopes(zero, time_s, &along, &mut found);
                let reach = (self.clock.step_s * REACH[stage]).v();
                for i in 0..STATES {
                    along[i] = start[i] + reach * rate[i];
                }
                for lane in 0..T::LANES {
                    let place = stages * (at[lane] - places.start) + stage;
                    let taken = &mut taken[lane % self.rows][place];
                    for i in 0..COORDINATES {
                        for j in 0..STATES {
                            taken[i][j] = N(found[i][j].0.get(lane));
                        }
                    }
                }
            }
        }
    }

    /// The derivatives at a state; gives the state's derivative by time.
    #[inline(always)]
    fn slopes(
        &self,
        zero: N<T>,
        time_s: N<T>,
        at: &[N<T>; STATES],
        slopes: &mut [[N<T>; STATES]; COORDINATES],
    ) -> [N<T>; STATES] {
        let forcing = self.model.forcing(time_s.constant());
        let (mut state, mut rate) = ([zero.constant(); STATES], [zero; STATES]);
        for i in 0..STATES {
            state[i] = at[i].constant();
        }
        for j in 0..STATES {
            state[j].0.slope = zero.lit(1.0).0;
            let derivative = self.model.derivative(&forcing, &state);
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
}

/// Weights of the values at so many even instants in the trigonometric polynomial through them, at
/// each place from the first instant up to the second where turns of so many steps need them: at
/// the ends of steps and halfway between.
#[inline(always)]
pub(super) fn weights(steps: usize, instants: usize) -> Vec<Vec<f64>> {
    let parts = 2 * steps / instants;
    let mut weights = vec![vec![0.0; instants]; parts];
    // No closure: it would be compiled without the instruction set.
    for place in 0..parts {
        for instant in 0..instants {
            let turns = (place as f64 / parts as f64 - instant as f64) / instants as f64;
            let mut harmonics = 0.0;
            for harmonic in 1..instants / 2 {
                harmonics += 2.0 * trig::sin_cos_turns(N(harmonic as f64 * turns)).1.0;
            }
            let (_, last) = trig::sin_cos_turns(N((instants / 2) as f64 * turns));
            weights[place][instant] = (1.0 + harmonics + last.0) / instants as f64;
        }
    }
    weights
}

/// The derivatives at one of the places of [`weights`], counted through the turn.
#[inline(always)]
fn interpolate(taken: &[Slopes], weights: &[Vec<f64>], place: usize, slopes: &mut Slopes) {
    let (first, part) = (place / weights.len(), place % weights.len());
    if part == 0 {
        *slopes = taken[first % taken.len()];
        return;
    }
    let mut factors = [0.0; INSTANTS];
    for (instant, weight) in weights[part].iter().enumerate() {
        factors[(first + instant) % taken.len()] = *weight;
    }
    for i in 0..COORDINATES {
        let mut sums = [N(0.0); STATES];
        for instant in 0..taken.len() {
            for j in 0..STATES {
                sums[j] += taken[instant][i][j] * factors[instant];
            }
        }
        slopes[i] = sums;
    }
}

/// One step of some disturbances; the derivatives are those at its stages.
#[inline(always)]
fn step<T: Lane>(zero: N<T>, h: N<T>, at: [&Slopes; 4], block: &mut [[N<T>; STATES]]) {
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
                let pair = [zero.lit(slopes[i][j].0), zero.lit(slopes[i + 1][j].0)];
                for c in 0..BLOCK {
                    sums[0][c] += pair[0] * along[c][j];
                    sums[1][c] += pair[1] * along[c][j];
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

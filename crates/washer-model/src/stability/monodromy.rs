//! The effect of a turn on small disturbances of a response.
//!
//! A disturbance d obeys d'' = K(t) d + C(t) d', with the partial derivatives of the accelerations
//! along the response, which dual numbers give. Over a turn these are smooth and periodic but for
//! what forces with corners do (`corners.rs`), so that they are taken at a few even instants, and
//! from the trigonometric polynomial through those at all others. Classical Runge-Kutta takes all
//! disturbances through the turn together. Lanes share a row's instants, then its disturbances.

use super::corners::{Corner, Corners, Slopes};
use super::turn::{Clock, NEXT_STAGE, WEIGHT};
use crate::coordinates::{COORDINATES, STATES};
use crate::lanes::InLanes as _;
use crate::nonlinear::elements::corners::CornerForce;
use crate::run::model::Nonlinear;
use faer::Mat;
use lane_ode::{Aside, Dual, Lane, MAX_LANES, N, System, trig};

/// Instants a turn at which the derivatives are taken, at most: harmonics of the turn up to the
/// seventh.
pub(super) const INSTANTS: usize = 16;

/// The number of instants where forces have corners, which give motions more harmonics.
pub(super) const INSTANTS_AT_CORNERS: usize = 32;

/// Rows and columns of a state's disturbance.
pub(crate) type Square = [[N<f64>; STATES]; STATES];

/// Returns the matrix of disturbances whose speeds count per a unit (1/s).
pub(crate) fn per_unit(matrix: &Square, unit_per_s: f64) -> Mat<f64> {
    let unit = |i: usize| if i < COORDINATES { 1.0 } else { unit_per_s };
    Mat::from_fn(STATES, STATES, |i, j| matrix[i][j].0 * unit(j) / unit(i))
}

/// The number of lanes of disturbances taken through a step at once. Basis: they stay in the
/// nearest cache. Doubling it is slower.
const BLOCK: usize = 5;
/// The number of wide lanes that hold all disturbances. Basis: the number of states. Doubling it
/// leaves lanes empty.
const WIDE_BLOCK: usize = STATES.div_ceil(MAX_LANES);

/// Steps whose derivatives are kept at once: as many for every turn.
const AT_ONCE: usize = 8;

/// Starts, middles and ends of these. Where forces have corners, steps are so short that what is
/// smooth is a parabola through the first, the middle and the last.
const PLACES: usize = 2 * AT_ONCE + 1;

/// Rows along their turns.
pub(super) struct Along<'a, T> {
    pub(super) zero: N<T>,
    /// The weights of [`weights`].
    pub(super) weights: &'a [Vec<f64>],
    /// In lanes one row after another, again and again.
    pub(super) model: Nonlinear<Dual<T>>,
    pub(super) clock: Clock<T>,
    pub(super) rows: usize,
    /// At how many even instants of a turn derivatives are taken.
    pub(super) instants: usize,
    /// States in the rows' lanes, at so many instants of the turn or at a multiple of them.
    pub(super) path: &'a [[N<T>; STATES]],
    /// Forces with corners in the rows' lanes, at the start, middle and end of all steps.
    pub(super) forces: &'a [CornerForce<T>],
}

/// The smooth coefficients over a turn of a row.
#[derive(Clone)]
struct Smooth {
    /// Derivatives, less those of forces with corners.
    slopes: Slopes,
    /// These forces' motions.
    corners: Vec<Corner<f64>>,
}

impl Smooth {
    /// The coefficients of no forces.
    const NONE: Self = Self { slopes: [[N(0.0); STATES]; COORDINATES], corners: Vec::new() };
}

/// The number of times that each summand counts.
type Times = [f64; INSTANTS_AT_CORNERS];

/// Sums of the same, each by times of its own. Coordinate by coordinate, so that what is summed
/// stays in the nearest cache, and several at once, so that what is loaded serves them all.
#[inline(always)]
fn sum(of: &[Smooth], times: &[Times], sums: &mut [Smooth]) {
    let ((times_of_four, times_of_rest), (fours, rest)) =
        (times.as_chunks::<4>(), sums.as_chunks_mut::<4>());
    for i in 0..COORDINATES {
        for place in 0..fours.len() {
            sum_slopes(of, i, &times_of_four[place], &mut fours[place]);
        }
        for place in 0..rest.len() {
            sum_slopes(of, i, &[times_of_rest[place]], core::array::from_mut(&mut rest[place]));
        }
    }
    for (place, times) in times.iter().enumerate() {
        sums[place].corners.clear();
        for m in 0..of[0].corners.len() {
            let mut corner = Corner::none(N(0.0));
            for k in 0..of.len() {
                corner.add(&of[k].corners[m], times[k]);
            }
            sums[place].corners.push(corner);
        }
    }
}

/// Returns the derivatives of one acceleration.
#[inline(always)]
fn sum_slopes<const SUMS: usize>(
    of: &[Smooth],
    i: usize,
    times: &[Times; SUMS],
    sums: &mut [Smooth; SUMS],
) {
    let mut sum = [[N(0.0); STATES]; SUMS];
    for k in 0..of.len() {
        for place in 0..SUMS {
            for j in 0..STATES {
                sum[place][j] += of[k].slopes[i][j] * times[place][k];
            }
        }
    }
    for place in 0..SUMS {
        sums[place].slopes[i] = sum[place];
    }
}

/// Computes the monodromy matrix of each row's turn.
impl<T: Lane> Aside for Along<'_, T> {
    type Output = Vec<Square>;

    #[inline(always)]
    fn run(self) -> Vec<Square> {
        let Self { zero, weights, .. } = self;
        let taken = self.take(zero);
        let block = if T::LANES == MAX_LANES { WIDE_BLOCK } else { BLOCK };
        let vectors = STATES.div_ceil(block * T::LANES) * block;
        let mut columns = vec![vec![[zero; STATES]; vectors]; self.rows];
        for columns in &mut columns {
            for j in 0..STATES {
                columns[j / T::LANES][j].0.set(j % T::LANES, 1.0);
            }
        }
        let mut at = vec![Smooth::NONE; PLACES];
        let mut three = [Smooth::NONE; 3];
        let mut parabolas = [[0.0; INSTANTS_AT_CORNERS]; PLACES];
        for k in 0..PLACES {
            let t = k as f64 / AT_ONCE as f64 - 1.0;
            let through = [0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)];
            parabolas[k][..through.len()].copy_from_slice(&through);
        }
        for first in (0..self.clock.steps).step_by(AT_ONCE) {
            for (row, columns) in columns.iter_mut().enumerate() {
                if self.forces.is_empty() {
                    interpolate(&taken[row], weights, 2 * first, &mut at);
                } else {
                    interpolate(&taken[row], weights, 2 * first, &mut three);
                    sum(&three, &parabolas, &mut at);
                    for k in 0..PLACES {
                        self.apply(row, 2 * first + k, 1.0, &mut at[k]);
                    }
                }
                let step_s = zero.lit(self.clock.step_s.0.get(row));
                for k in 0..AT_ONCE {
                    let start = &at[2 * k].slopes;
                    let middle = &at[2 * k + 1].slopes;
                    let end = &at[2 * k + 2].slopes;
                    let at = [start, middle, middle, end];
                    if T::LANES == MAX_LANES {
                        for block in columns.as_chunks_mut::<WIDE_BLOCK>().0 {
                            step(zero, step_s, at, block);
                        }
                    } else {
                        for block in columns.as_chunks_mut::<BLOCK>().0 {
                            step(zero, step_s, at, block);
                        }
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
}

impl<T: Lane> Along<'_, T> {
    /// Computes what is taken of each row at its instants.
    #[inline(always)]
    fn take(&self, zero: N<T>) -> Vec<Vec<Smooth>> {
        let shares = T::LANES / self.rows;
        let last = self.instants - 1;
        let every = self.path.len() / self.instants;
        let steps = self.clock.steps / self.instants;
        let mut taken = vec![vec![Smooth::NONE; self.instants]; self.rows];
        let mut at = [0; MAX_LANES];
        let mut found = [[zero; STATES]; COORDINATES];
        for instant in (0..self.instants).step_by(shares) {
            let mut step = zero;
            let mut state = [zero; STATES];
            for lane in 0..T::LANES {
                at[lane] = (instant + (lane / self.rows).min(shares - 1)).min(last);
                step.0.set(lane, (at[lane] * steps) as f64);
                for i in 0..STATES {
                    state[i].0.set(lane, self.path[at[lane] * every][i].0.get(lane % self.rows));
                }
            }
            let spin = self.model.forcing_aside((self.clock.step_s * step).v().constant());
            self.slopes(zero, &spin, &state, &mut found);
            let mut corners = Vec::new();
            if !self.forces.is_empty() {
                corners = zero.0.aside(Corners { model: &self.model, spin: &spin, x: &state });
            }
            for lane in 0..T::LANES {
                let row = lane % self.rows;
                let smooth = &mut taken[row][at[lane]];
                for i in 0..COORDINATES {
                    for j in 0..STATES {
                        smooth.slopes[i][j] = N(found[i][j].0.get(lane));
                    }
                }
                smooth.corners = corners.iter().map(|corner| corner.get_lane(lane)).collect();
                self.apply(row, 2 * at[lane] * steps, -1.0, smooth);
            }
        }
        taken
    }

    /// Adds to a row's derivatives at a place of the list of forces what these add, so many times.
    #[inline(always)]
    fn apply(&self, row: usize, place: usize, times: f64, to: &mut Smooth) {
        let count = to.corners.len();
        for m in 0..count {
            let force = self.forces[place * count + m].get_lane(row);
            to.corners[m].apply(&force, times, &mut to.slopes);
        }
    }

    /// Returns the derivatives at a state.
    #[inline(always)]
    fn slopes(
        &self,
        zero: N<T>,
        forcing: &<Nonlinear<Dual<T>> as System<Dual<T>, STATES>>::Forcing,
        at: &[N<T>; STATES],
        slopes: &mut [[N<T>; STATES]; COORDINATES],
    ) {
        let mut state = [zero.constant(); STATES];
        for i in 0..STATES {
            state[i] = at[i].constant();
        }
        for j in 0..STATES {
            state[j].0.slope = zero.lit(1.0).0;
            let derivative = self.model.derivative_aside(forcing, &state);
            state[j].0.slope = zero.0;
            for i in 0..COORDINATES {
                slopes[i][j] = N(derivative[COORDINATES + i].0.slope);
            }
        }
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

/// Returns what is smooth from a place of [`weights`] on, counted through the turn, at even places
/// of the next [`PLACES`].
#[inline(always)]
fn interpolate(taken: &[Smooth], weights: &[Vec<f64>], from: usize, at: &mut [Smooth]) {
    let mut times = [[0.0; INSTANTS_AT_CORNERS]; PLACES];
    let times = &mut times[..at.len()];
    let every = (PLACES - 1) / (at.len() - 1);
    for (k, times) in times.iter_mut().enumerate() {
        let place = from + k * every;
        let first = place / weights.len();
        let part = place % weights.len();
        for (instant, weight) in weights[part].iter().enumerate() {
            times[(first + instant) % taken.len()] = *weight;
        }
    }
    sum(taken, times, at);
}

/// Integrates a step of some disturbances; the derivatives are those at its stages.
#[inline(always)]
fn step<T: Lane, const BLOCK: usize>(
    zero: N<T>,
    h: N<T>,
    at: [&Slopes; 4],
    block: &mut [[N<T>; STATES]; BLOCK],
) {
    let mut along = *block;
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
        let reach = (h * NEXT_STAGE[stage]).v();
        let weight = (h * WEIGHT[stage]).v();
        for c in 0..BLOCK {
            for i in 0..COORDINATES {
                let speed = along[c][COORDINATES + i];
                let acceleration = accelerations[c][i];
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

//! The two models of an oscillator, over lanes: the nonlinear equations, and their linearisation
//! about the equilibrium.

use std::marker::PhantomData;

use lane_ode::{Dual, Lane, Lu, N, Partials, System};

use crate::Oscillator;

/// Greatest number of Newton steps to the equilibrium, from zero. Basis: Newton's method needs a
/// few steps. Doubling it doubles the time for oscillators without an equilibrium near zero.
const MAX_NEWTON_STEPS: usize = 50;
/// Limit of the magnitude of coordinates, beyond which a trajectory has diverged. Basis: far above
/// any motion. Doubling it makes no difference.
const DIVERGENCE_LIMIT: f64 = 1e12;

/// The two models, in the order of columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OscillatorModel {
    /// The nonlinear equations.
    Nonlinear,
    /// The linearisation about the equilibrium.
    Linear,
}

/// The parameters of a point, with the numbers that are computed once for all of its trajectories.
#[derive(Clone, Debug)]
pub(crate) struct PreparedPoint<const C: usize, const P: usize> {
    pub(crate) p: [f64; P],
    pub(crate) window_s: [f64; 2],
    equilibrium: [f64; C],
    /// The derivatives of the free motion's accelerations at the equilibrium.
    tangent: Partials<C>,
}

impl<const C: usize, const P: usize> PreparedPoint<C, P> {
    /// Prepares the point with these parameters; `None` if there is no equilibrium near zero.
    pub(crate) fn new<O: Oscillator<C, D, P>, const D: usize>(
        p: [f64; P],
        window_s: [f64; 2],
    ) -> Option<Self> {
        let zero_state = [0.0; C];
        let mut equilibrium = zero_state;
        let mut tangent = compute_tangent::<O, C, D, P>(&p, &zero_state, &zero_state);
        // Rounding may prevent convergence to the last bit, so that the number of steps is limited.
        for _ in 0..MAX_NEWTON_STEPS {
            let residual = O::accelerations(&p.map(N), &equilibrium.map(N), &zero_state.map(N));
            if residual.iter().all(|a| a.0 == 0.0) {
                break;
            }
            let newton_step = Lu::new(tangent.by_coordinate)?.solve(&residual);
            let previous_equilibrium = equilibrium;
            for i in 0..C {
                equilibrium[i] -= newton_step[i].0;
            }
            if !equilibrium.iter().all(|q| q.is_finite()) {
                return None;
            }
            if previous_equilibrium == equilibrium {
                break;
            }
            tangent = compute_tangent::<O, C, D, P>(&p, &equilibrium, &zero_state);
        }
        Some(Self { p, window_s, equilibrium, tangent })
    }

    /// Returns an upper bound of the frequencies of the linear model's free motions (rad/s), from
    /// the norms of its matrices.
    pub(crate) fn highest_frequency_rad_per_s(&self) -> f64 {
        let row_sum_norm = |matrix: &[[N<f64>; C]; C]| {
            let row_sum = |row: &[N<f64>; C]| row.iter().map(|entry| entry.0.abs()).sum::<f64>();
            matrix.iter().map(row_sum).fold(0.0, f64::max)
        };
        row_sum_norm(&self.tangent.by_coordinate).sqrt() + row_sum_norm(&self.tangent.by_speed)
    }
}

/// Computes the derivatives of the free motion's accelerations at a state, by dual numbers.
fn compute_tangent<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize>(
    p: &[f64; P],
    q: &[f64; C],
    u: &[f64; C],
) -> Partials<C> {
    let to_constant = |value: f64| N(value).constant();
    let mut partials = Partials::zero();
    let p = p.map(to_constant);
    for j in 0..C {
        let [mut q, mut u]: [[N<Dual<f64>>; C]; 2] = [q, u].map(|state| state.map(to_constant));
        q[j].0.slope = 1.0;
        let by_coordinate = O::accelerations(&p, &q, &u);
        q[j].0.slope = 0.0;
        u[j].0.slope = 1.0;
        let by_speed = O::accelerations(&p, &q, &u);
        for i in 0..C {
            partials.by_coordinate[i][j] = N(by_coordinate[i].0.slope);
            partials.by_speed[i][j] = N(by_speed[i].0.slope);
        }
    }
    partials
}

/// A model as a first-order system over lanes, with one point in each lane. States are deviations
/// from equilibrium.
pub(crate) struct Equations<O, T, const C: usize, const D: usize, const P: usize> {
    model: OscillatorModel,
    p: [N<T>; P],
    equilibrium: [N<T>; C],
    by_coordinate: [[N<T>; C]; C],
    by_speed: [[N<T>; C]; C],
    divergence_limit: N<T>,
    oscillator: PhantomData<O>,
}

impl<O: Oscillator<C, D, P>, T: Lane, const C: usize, const D: usize, const P: usize>
    Equations<O, T, C, D, P>
{
    /// Creates the system without points in its lanes.
    pub(crate) fn new(model: OscillatorModel, zero: N<T>) -> Self {
        Self {
            model,
            p: [zero; P],
            equilibrium: [zero; C],
            by_coordinate: [[zero; C]; C],
            by_speed: [[zero; C]; C],
            divergence_limit: zero.lit(DIVERGENCE_LIMIT),
            oscillator: PhantomData,
        }
    }

    /// Writes a point into a lane.
    pub(crate) fn set_point(&mut self, lane: usize, point: &PreparedPoint<C, P>) {
        set_lane(&mut self.p, lane, &point.p.map(N));
        set_lane(&mut self.equilibrium, lane, &point.equilibrium.map(N));
        let Partials { by_coordinate, by_speed } = &point.tangent;
        set_lane(self.by_coordinate.as_flattened_mut(), lane, by_coordinate.as_flattened());
        set_lane(self.by_speed.as_flattened_mut(), lane, by_speed.as_flattened());
    }
}

impl<O: Oscillator<C, D, P>, T: Lane, const C: usize, const D: usize, const P: usize> System<T, D>
    for Equations<O, T, C, D, P>
{
    type Forcing = [N<T>; C];

    #[inline(always)]
    fn forcing(&self, t_s: N<T>) -> [N<T>; C] {
        O::forcing(&self.p, t_s)
    }

    #[inline(always)]
    fn derivative(&self, forcing: &[N<T>; C], x: &[N<T>; D]) -> [N<T>; D] {
        let (q, u): ([N<T>; C], [N<T>; C]) = split_state(x);
        let mut acceleration = q;
        match self.model {
            OscillatorModel::Nonlinear => {
                let mut position = q;
                for i in 0..C {
                    position[i] = q[i] + self.equilibrium[i];
                }
                acceleration = O::accelerations(&self.p, &position, &u);
            }
            OscillatorModel::Linear => {
                for i in 0..C {
                    let mut sum = q[i].lit(0.0);
                    for j in 0..C {
                        sum = self.by_coordinate[i][j] * q[j] + sum;
                        sum = self.by_speed[i][j] * u[j] + sum;
                    }
                    acceleration[i] = sum;
                }
            }
        }
        let mut slopes = *x;
        for i in 0..C {
            slopes[i] = u[i];
            slopes[C + i] = acceleration[i] + forcing[i];
        }
        slopes
    }

    #[inline(always)]
    fn in_range(&self, x: &[N<T>; D]) -> T::Mask {
        let mut max_magnitude = x[0].abs();
        for i in 1..C {
            // A coordinate that is NaN is selected as the larger one, and fails the comparison with
            // the limit.
            max_magnitude =
                N(T::select(x[i].abs().0.less(max_magnitude.0), max_magnitude.0, x[i].abs().0));
        }
        max_magnitude.0.less(self.divergence_limit.0)
    }
}

/// Splits a state into coordinates and speeds.
fn split_state<T: Copy, const C: usize, const D: usize>(x: &[T; D]) -> ([T; C], [T; C]) {
    const { assert!(D == 2 * C, "a state is the coordinates and their speeds") };
    (std::array::from_fn(|i| x[i]), std::array::from_fn(|i| x[C + i]))
}

fn set_lane<T: Lane>(lane_values: &mut [N<T>], lane: usize, numbers: &[N<f64>]) {
    for (lane_value, number) in lane_values.iter_mut().zip(numbers) {
        lane_value.0.set(lane, number.0);
    }
}

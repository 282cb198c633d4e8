//! Both models of an oscillator in lanes: the equations as they are, and their tangent at the
//! equilibrium.

use std::marker::PhantomData;

use lane_ode::{Dual, Lane, Lu, N, Partials, System};

use crate::Oscillator;

/// Newton steps to the equilibrium, from all coordinates at zero.
const MOST_STEPS: usize = 50;
/// Coordinates beyond this have diverged.
const FARTHEST: f64 = 1e12;

/// Both models, in the order of columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Model {
    /// The equations as they are.
    Nonlinear,
    /// The tangent at the equilibrium.
    Linear,
}

/// A point made ready once.
#[derive(Clone, Debug)]
pub(crate) struct Case<const C: usize, const P: usize> {
    pub(crate) p: [f64; P],
    pub(crate) window_s: [f64; 2],
    equilibrium: [f64; C],
    /// Of the free motion at the equilibrium.
    tangent: Partials<C>,
}

impl<const C: usize, const P: usize> Case<C, P> {
    /// The point at these parameters; none without an equilibrium near zero.
    pub(crate) fn new<O: Oscillator<C, D, P>, const D: usize>(
        p: [f64; P],
        window_s: [f64; 2],
    ) -> Option<Self> {
        let still = [0.0; C];
        let (mut equilibrium, mut tangent) = (still, tangent::<O, C, D, P>(&p, &still, &still));
        // Rounding may keep it from standing still.
        for _ in 0..MOST_STEPS {
            let rest = O::accelerations(&p.map(N), &equilibrium.map(N), &still.map(N));
            if rest.iter().all(|a| a.0 == 0.0) {
                break;
            }
            let step = Lu::new(tangent.by_coordinate)?.solve(&rest);
            let before = equilibrium;
            for i in 0..C {
                equilibrium[i] -= step[i].0;
            }
            if !equilibrium.iter().all(|q| q.is_finite()) {
                return None;
            }
            if before == equilibrium {
                break;
            }
            tangent = self::tangent::<O, C, D, P>(&p, &equilibrium, &still);
        }
        Some(Self { p, window_s, equilibrium, tangent })
    }

    /// No free motion of the linear model is faster (rad/s): norms of its matrices.
    pub(crate) fn fastest_rad_per_s(&self) -> f64 {
        let norm = |matrix: &[[N<f64>; C]; C]| {
            let of = |row: &[N<f64>; C]| row.iter().map(|entry| entry.0.abs()).sum::<f64>();
            matrix.iter().map(of).fold(0.0, f64::max)
        };
        norm(&self.tangent.by_coordinate).sqrt() + norm(&self.tangent.by_speed)
    }
}

/// The derivatives of the free motion at a state, by dual numbers.
fn tangent<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize>(
    p: &[f64; P],
    q: &[f64; C],
    u: &[f64; C],
) -> Partials<C> {
    let constant = |value: f64| N(value).constant();
    let mut found = Partials::zero();
    let p = p.map(constant);
    for j in 0..C {
        let [mut q, mut u]: [[N<Dual<f64>>; C]; 2] = [q, u].map(|state| state.map(constant));
        q[j].0.slope = 1.0;
        let by_coordinate = O::accelerations(&p, &q, &u);
        q[j].0.slope = 0.0;
        u[j].0.slope = 1.0;
        let by_speed = O::accelerations(&p, &q, &u);
        for i in 0..C {
            found.by_coordinate[i][j] = N(by_coordinate[i].0.slope);
            found.by_speed[i][j] = N(by_speed[i].0.slope);
        }
    }
    found
}

/// One of the models as a first-order system, in lanes that hold a point each. States are
/// deviations from equilibrium.
pub(crate) struct Equations<O, T, const C: usize, const D: usize, const P: usize> {
    model: Model,
    p: [N<T>; P],
    equilibrium: [N<T>; C],
    by_coordinate: [[N<T>; C]; C],
    by_speed: [[N<T>; C]; C],
    farthest: N<T>,
    of: PhantomData<O>,
}

impl<O: Oscillator<C, D, P>, T: Lane, const C: usize, const D: usize, const P: usize>
    Equations<O, T, C, D, P>
{
    /// Lanes without points.
    pub(crate) fn new(model: Model, zero: N<T>) -> Self {
        Self {
            model,
            p: [zero; P],
            equilibrium: [zero; C],
            by_coordinate: [[zero; C]; C],
            by_speed: [[zero; C]; C],
            farthest: zero.lit(FARTHEST),
            of: PhantomData,
        }
    }

    /// Gives a lane a point.
    pub(crate) fn take(&mut self, lane: usize, case: &Case<C, P>) {
        set(&mut self.p, lane, &case.p.map(N));
        set(&mut self.equilibrium, lane, &case.equilibrium.map(N));
        let Partials { by_coordinate, by_speed } = &case.tangent;
        set(self.by_coordinate.as_flattened_mut(), lane, by_coordinate.as_flattened());
        set(self.by_speed.as_flattened_mut(), lane, by_speed.as_flattened());
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
        let (q, u): ([N<T>; C], [N<T>; C]) = halves(x);
        let mut free = q;
        match self.model {
            Model::Nonlinear => {
                let mut place = q;
                for i in 0..C {
                    place[i] = q[i] + self.equilibrium[i];
                }
                free = O::accelerations(&self.p, &place, &u);
            }
            Model::Linear => {
                for i in 0..C {
                    let mut sum = q[i].lit(0.0);
                    for j in 0..C {
                        sum = self.by_coordinate[i][j] * q[j] + sum;
                        sum = self.by_speed[i][j] * u[j] + sum;
                    }
                    free[i] = sum;
                }
            }
        }
        let mut slopes = *x;
        for i in 0..C {
            slopes[i] = u[i];
            slopes[C + i] = free[i] + forcing[i];
        }
        slopes
    }

    #[inline(always)]
    fn in_range(&self, x: &[N<T>; D]) -> T::Mask {
        let mut largest = x[0].abs();
        for i in 1..C {
            // A coordinate that is not finite is the larger one, and not below the limit.
            largest = N(T::select(x[i].abs().0.less(largest.0), largest.0, x[i].abs().0));
        }
        largest.0.less(self.farthest.0)
    }
}

/// The coordinates of a state, and their speeds.
fn halves<T: Copy, const C: usize, const D: usize>(x: &[T; D]) -> ([T; C], [T; C]) {
    const { assert!(D == 2 * C, "a state is the coordinates and their speeds") };
    (std::array::from_fn(|i| x[i]), std::array::from_fn(|i| x[C + i]))
}

fn set<T: Lane>(to: &mut [N<T>], lane: usize, from: &[N<f64>]) {
    for (to, from) in to.iter_mut().zip(from) {
        to.0.set(lane, from.0);
    }
}

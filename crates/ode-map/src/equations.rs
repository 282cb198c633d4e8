//! Both models of an oscillator in lanes: the equations as they are, and their tangent at the
//! equilibrium.

use std::marker::PhantomData;

use lane_ode::{Dual, Lane, Lu, N, Real};

use crate::Oscillator;

/// The tangent of the free motion at an equilibrium: q'' is `by_coordinate` times the deviation and
/// `by_speed` times the speeds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tangent<T, const C: usize> {
    by_coordinate: [[N<T>; C]; C],
    by_speed: [[N<T>; C]; C],
}

/// A point made ready once.
#[derive(Clone, Debug)]
pub(crate) struct Case<const C: usize, const P: usize> {
    pub(crate) p: [f64; P],
    pub(crate) window_s: [f64; 2],
    equilibrium: [f64; C],
    tangent: Tangent<f64, C>,
}

/// Newton steps to the equilibrium, from all coordinates at zero.
const MOST_STEPS: usize = 50;

impl<const C: usize, const P: usize> Case<C, P> {
    /// The point at these parameters; none without an equilibrium near zero.
    pub(crate) fn new<O: Oscillator<C, D, P>, const D: usize>(
        p: [f64; P],
        window_s: [f64; 2],
    ) -> Option<Self> {
        let mut equilibrium = [0.0; C];
        for _ in 0..MOST_STEPS {
            let tangent = tangent::<O, C, D, P>(&p, &equilibrium, &[0.0; C]);
            let rest = O::accelerations(&p.map(N), &equilibrium.map(N), &[N(0.0); C]);
            if rest.iter().all(|a| a.0 == 0.0) {
                return Some(Self { p, window_s, equilibrium, tangent });
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
                return Some(Self { p, window_s, equilibrium, tangent });
            }
        }
        // Rounding keeps it from standing still.
        let tangent = tangent::<O, C, D, P>(&p, &equilibrium, &[0.0; C]);
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
) -> Tangent<f64, C> {
    let constant = |value: &f64| N(*value).constant();
    let mut found = Tangent { by_coordinate: [[N(0.0); C]; C], by_speed: [[N(0.0); C]; C] };
    let p = std::array::from_fn(|k| constant(&p[k]));
    for j in 0..C {
        let [mut q, mut u]: [[N<Dual<f64>>; C]; 2] =
            [q, u].map(|state| std::array::from_fn(|i| constant(&state[i])));
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

/// One of the two models, in lanes that hold a point each. States are deviations from equilibrium.
pub(crate) trait Side<T: Real, const C: usize, const P: usize>: Sized {
    /// Lanes without points.
    fn new(zero: N<T>) -> Self;
    /// Gives a lane a point.
    fn take(&mut self, lane: usize, case: &Case<C, P>)
    where
        T: Lane;
    /// What drives it.
    fn forcing(&self, t: N<T>) -> [N<T>; C];
    /// The free motion.
    fn accelerations(&self, q: &[N<T>; C], u: &[N<T>; C]) -> [N<T>; C];
    /// The derivatives of the free motion of a point at a state.
    fn tangent(case: &Case<C, P>, q: &[f64; C], u: &[f64; C]) -> Tangent<f64, C>;
    /// How fast what drives a point changes.
    fn forcing_slope(case: &Case<C, P>, t_s: f64) -> [N<f64>; C];
}

impl<const C: usize> Tangent<f64, C> {
    /// The derivatives by coordinates, and those by speeds.
    pub(crate) const fn parts(self) -> [[[N<f64>; C]; C]; 2] {
        [self.by_coordinate, self.by_speed]
    }
}

/// The equations as they are.
pub(crate) struct Nonlinear<O, T, const C: usize, const D: usize, const P: usize> {
    p: [N<T>; P],
    equilibrium: [N<T>; C],
    of: PhantomData<O>,
}

impl<T: Real, O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> Side<T, C, P>
    for Nonlinear<O, T, C, D, P>
{
    fn new(zero: N<T>) -> Self {
        Self { p: [zero; P], equilibrium: [zero; C], of: PhantomData }
    }

    fn take(&mut self, lane: usize, case: &Case<C, P>)
    where
        T: Lane,
    {
        set(&mut self.p, lane, &case.p);
        set(&mut self.equilibrium, lane, &case.equilibrium);
    }

    #[inline(always)]
    fn forcing(&self, t: N<T>) -> [N<T>; C] {
        O::forcing(&self.p, t)
    }

    #[inline(always)]
    fn accelerations(&self, q: &[N<T>; C], u: &[N<T>; C]) -> [N<T>; C] {
        let mut place = *q;
        for i in 0..C {
            place[i] = q[i] + self.equilibrium[i];
        }
        O::accelerations(&self.p, &place, u)
    }

    fn tangent(case: &Case<C, P>, q: &[f64; C], u: &[f64; C]) -> Tangent<f64, C> {
        let place = std::array::from_fn(|i| q[i] + case.equilibrium[i]);
        tangent::<O, C, D, P>(&case.p, &place, u)
    }

    fn forcing_slope(case: &Case<C, P>, t_s: f64) -> [N<f64>; C] {
        forcing_slope::<O, C, D, P>(case, t_s)
    }
}

/// The tangent at the equilibrium.
pub(crate) struct Linear<O, T, const C: usize, const D: usize, const P: usize> {
    p: [N<T>; P],
    tangent: Tangent<T, C>,
    of: PhantomData<O>,
}

impl<T: Real, O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> Side<T, C, P>
    for Linear<O, T, C, D, P>
{
    fn new(zero: N<T>) -> Self {
        let tangent = Tangent { by_coordinate: [[zero; C]; C], by_speed: [[zero; C]; C] };
        Self { p: [zero; P], tangent, of: PhantomData }
    }

    fn take(&mut self, lane: usize, case: &Case<C, P>)
    where
        T: Lane,
    {
        set(&mut self.p, lane, &case.p);
        for i in 0..C {
            for j in 0..C {
                let Tangent { by_coordinate, by_speed } = &mut self.tangent;
                by_coordinate[i][j].0.set(lane, case.tangent.by_coordinate[i][j].0);
                by_speed[i][j].0.set(lane, case.tangent.by_speed[i][j].0);
            }
        }
    }

    #[inline(always)]
    fn forcing(&self, t: N<T>) -> [N<T>; C] {
        O::forcing(&self.p, t)
    }

    #[inline(always)]
    fn accelerations(&self, q: &[N<T>; C], u: &[N<T>; C]) -> [N<T>; C] {
        let mut sums = *q;
        for i in 0..C {
            let mut sum = q[i].lit(0.0);
            for j in 0..C {
                sum = self.tangent.by_coordinate[i][j] * q[j] + sum;
                sum = self.tangent.by_speed[i][j] * u[j] + sum;
            }
            sums[i] = sum;
        }
        sums
    }

    fn tangent(case: &Case<C, P>, _: &[f64; C], _: &[f64; C]) -> Tangent<f64, C> {
        case.tangent
    }

    fn forcing_slope(case: &Case<C, P>, t_s: f64) -> [N<f64>; C] {
        forcing_slope::<O, C, D, P>(case, t_s)
    }
}

fn forcing_slope<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize>(
    case: &Case<C, P>,
    t_s: f64,
) -> [N<f64>; C] {
    let p = case.p.map(|value| N(value).constant());
    O::forcing(&p, N(Dual { value: t_s, slope: 1.0 })).map(|driven| N(driven.0.slope))
}

fn set<T: Lane, const K: usize>(to: &mut [N<T>; K], lane: usize, from: &[f64; K]) {
    for (to, from) in to.iter_mut().zip(from) {
        to.0.set(lane, *from);
    }
}

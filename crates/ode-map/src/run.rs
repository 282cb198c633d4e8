//! Trajectories of one model through the lanes of a method, and the peaks of each.

use std::marker::PhantomData;

use lane_ode::rodas::{self, Stiff};
use lane_ode::{
    Ended, Failure, Forcing, Kernel, Lane, Leg, MAX_LANES, N, Partials, Peaks, Sample, Simd, Step,
    System, Task, Tolerance, dopri5, rk4,
};

use crate::Oscillator;
use crate::equations::{Case, Linear, Nonlinear, Side};

/// Coordinates beyond this have diverged.
const FARTHEST: f64 = 1e12;

/// Accepted and rejected steps of a trajectory at most.
const MOST_STEPS: u64 = 100_000_000;

/// How a trajectory is integrated.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Method {
    /// Fixed steps (s).
    Rk4(f64),
    /// Dormand-Prince, relative and absolute tolerance.
    Dopri5(f64, f64),
    /// Rodas5P, the same.
    Rodas5p(f64, f64),
}

/// What came of a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Run<const C: usize> {
    /// Why it ended early, and when (s).
    pub(crate) failure: Option<(Failure, f64)>,
    /// Largest deviations from equilibrium in the window.
    pub(crate) peaks: [f64; C],
    pub(crate) steps: u64,
    pub(crate) rejected: u64,
}

/// Both models, in the order of columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Model {
    Nonlinear,
    Linear,
}

/// One model at every point from rest to `end_s`, by one method. Once `is_stopped` says so, what
/// comes means nothing.
pub(crate) fn runs<O, const C: usize, const D: usize, const P: usize>(
    model: Model,
    method: Method,
    cases: &[&Case<C, P>],
    end_s: f64,
    is_stopped: &dyn Fn() -> bool,
) -> Vec<Run<C>>
where
    O: Oscillator<C, D, P>,
{
    let of = Work::<O, C, D, P> { model, method, cases, end_s, is_stopped, of: PhantomData };
    match method {
        // The stiff method goes trajectory by trajectory.
        Method::Rodas5p(..) => Simd::Scalar.dispatch(of),
        _ => Simd::best().dispatch(of),
    }
}

struct Work<'a, O, const C: usize, const D: usize, const P: usize> {
    model: Model,
    method: Method,
    cases: &'a [&'a Case<C, P>],
    end_s: f64,
    is_stopped: &'a dyn Fn() -> bool,
    of: PhantomData<O>,
}

impl<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> Kernel
    for Work<'_, O, C, D, P>
{
    type Output = Vec<Run<C>>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Vec<Run<C>> {
        match self.model {
            Model::Nonlinear => {
                self.of_side::<T, Nonlinear<O, T, C, D, P>, Nonlinear<O, f64, C, D, P>>(zero)
            }
            Model::Linear => {
                self.of_side::<T, Linear<O, T, C, D, P>, Linear<O, f64, C, D, P>>(zero)
            }
        }
    }
}

impl<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> Work<'_, O, C, D, P> {
    #[inline(always)]
    fn of_side<T: Lane, S: Side<T, C, P>, S1: Side<f64, C, P>>(&self, zero: T) -> Vec<Run<C>> {
        match self.method {
            Method::Rk4(_) => {
                let mut task = Trajectories::<T, S, C, D, P>::new(zero, self);
                rk4::integrate(zero, &mut task);
                task.runs
            }
            Method::Dopri5(relative, absolute) => {
                let mut task = Trajectories::<T, S, C, D, P>::new(zero, self);
                let tolerance = Tolerance { relative, absolute, max_steps: MOST_STEPS };
                dopri5::integrate(zero, &mut task, &tolerance);
                task.runs
            }
            Method::Rodas5p(relative, absolute) => {
                let mut task = Trajectories::<f64, S1, C, D, P>::new(0.0, self);
                let tolerance = Tolerance { relative, absolute, max_steps: MOST_STEPS };
                rodas::integrate::<D, C, _>(&mut task, &tolerance);
                task.runs
            }
        }
    }
}

/// The equations of one side as a first-order system.
struct First<S, T, const C: usize> {
    side: S,
    farthest: N<T>,
}

impl<T: Lane, S: Side<T, C, P>, const C: usize, const D: usize, const P: usize> System<T, D>
    for Sided<S, T, C, P>
{
    type Forcing = [N<T>; C];

    #[inline(always)]
    fn forcing(&self, t_s: N<T>) -> [N<T>; C] {
        self.0.side.forcing(t_s)
    }

    #[inline(always)]
    fn derivative(&self, forcing: &[N<T>; C], x: &[N<T>; D]) -> [N<T>; D] {
        let (q, u) = halves(x);
        let free = self.0.side.accelerations(&q, &u);
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
        largest.0.less(self.0.farthest.0)
    }
}

/// Names the number of parameters too.
struct Sided<S, T, const C: usize, const P: usize>(First<S, T, C>);

fn halves<T: Copy, const C: usize, const D: usize>(x: &[T; D]) -> ([T; C], [T; C]) {
    const { assert!(D == 2 * C, "a state is the coordinates and their speeds") };
    (std::array::from_fn(|i| x[i]), std::array::from_fn(|i| x[C + i]))
}

/// Trajectories fed into lanes, and their peaks.
struct Trajectories<'a, T, S, const C: usize, const D: usize, const P: usize> {
    system: Sided<S, T, C, P>,
    cases: &'a [&'a Case<C, P>],
    end_s: f64,
    step_s: f64,
    is_stopped: &'a dyn Fn() -> bool,
    taken: usize,
    /// Which trajectory and which of its legs each lane holds.
    held: [(usize, usize); MAX_LANES],
    peaks: Peaks<T, C>,
    /// One where a lane is in its window.
    inside: N<T>,
    runs: Vec<Run<C>>,
}

impl<'a, T: Lane, S: Side<T, C, P>, const C: usize, const D: usize, const P: usize>
    Trajectories<'a, T, S, C, D, P>
{
    fn new<O>(zero: T, of: &Work<'a, O, C, D, P>) -> Self {
        let zero = N(zero);
        let none = Run { failure: None, peaks: [0.0; C], steps: 0, rejected: 0 };
        let step_s = match of.method {
            Method::Rk4(step_s) => step_s,
            // The first to try; its error says what follows.
            Method::Dopri5(..) | Method::Rodas5p(..) => 1e-6 * of.end_s,
        };
        Self {
            system: Sided(First { side: S::new(zero), farthest: zero.lit(FARTHEST) }),
            cases: of.cases,
            end_s: of.end_s,
            step_s,
            is_stopped: of.is_stopped,
            taken: 0,
            held: [(0, 0); MAX_LANES],
            peaks: Peaks::new(zero),
            inside: zero,
            runs: vec![none; of.cases.len()],
        }
    }

    /// Ends of a trajectory's legs: the window's edges, and the run's end.
    fn ends(&self, trajectory: usize) -> [f64; 4] {
        let [from_s, to_s] = self.cases[trajectory].window_s;
        [0.0, from_s, to_s, self.end_s]
    }

    #[inline(always)]
    fn samples(&self, x: &[N<T>; D], dx: &[N<T>; D]) -> [Sample<T>; C] {
        std::array::from_fn(|i| Sample { value: x[i], slope: x[C + i], curvature: dx[C + i] })
    }

    fn counts(&self) -> T::Mask {
        self.inside.lit(0.5).0.less(self.inside.0)
    }
}

impl<T: Lane, S: Side<T, C, P>, const C: usize, const D: usize, const P: usize> Task<T, D>
    for Trajectories<'_, T, S, C, D, P>
{
    type System = Sided<S, T, C, P>;

    fn system(&self) -> &Self::System {
        &self.system
    }

    fn next_leg(&mut self, lane: usize, ended: Ended, x: &mut [N<T>; D]) -> Option<Leg> {
        let (trajectory, leg) = self.held[lane];
        let mut next = leg + 1;
        match ended {
            Ended::Idle => next = usize::MAX,
            Ended::Arrived(count) => {
                let run = &mut self.runs[trajectory];
                run.steps += count.accepted;
                run.rejected += count.rejected;
            }
            Ended::Failed { reason, time_s, count } => {
                let run = &mut self.runs[trajectory];
                run.steps += count.accepted;
                run.rejected += count.rejected;
                run.failure = Some((reason, time_s));
                next = usize::MAX;
            }
        }
        loop {
            if next < 3 {
                let (trajectory, _) = self.held[lane];
                let ends = self.ends(trajectory);
                // A window may begin with the run, or end with it.
                if ends[next] < ends[next + 1] {
                    self.held[lane].1 = next;
                    self.inside.0.set(lane, if next == 1 { 1.0 } else { 0.0 });
                    let (start_s, end_s) = (ends[next], ends[next + 1]);
                    return Some(Leg { start_s, end_s, step_s: self.step_s.min(end_s - start_s) });
                }
                next += 1;
                continue;
            }
            if !matches!(ended, Ended::Idle) && self.held[lane].0 == trajectory {
                self.runs[trajectory].peaks = self.peaks.lane(lane);
            }
            self.peaks.reset(lane);
            self.inside.0.set(lane, 0.0);
            let taken = self.taken;
            let case = *self.cases.get(taken)?;
            self.taken += 1;
            self.held[lane] = (taken, 0);
            self.system.0.side.take(lane, case);
            for value in x.iter_mut() {
                value.0.set(lane, 0.0);
            }
            next = 0;
        }
    }

    #[inline(always)]
    fn begin(&mut self, _: &Forcing<Self, T, D>, x: &[N<T>; D], dx: &[N<T>; D]) {
        let (samples, counts) = (self.samples(x, dx), self.counts());
        self.peaks.begin(&samples, counts);
    }

    #[inline(always)]
    fn observe(&mut self, _: &Forcing<Self, T, D>, step: &Step<'_, T, D>) {
        let (samples, counts) = (self.samples(step.after, step.slope_after), self.counts());
        self.peaks.advance(step.length_s, &samples, counts);
    }

    fn is_stopped(&self) -> bool {
        (self.is_stopped)()
    }
}

impl<S: Side<f64, C, P>, const C: usize, const D: usize, const P: usize> Stiff<D, C>
    for Trajectories<'_, f64, S, C, D, P>
{
    fn partials(&self, t_s: f64, x: &[N<f64>; D], partials: &mut Partials<C>) {
        let case = self.cases[self.held[0].0];
        let (q, u) = halves(&x.map(|value| value.0));
        [partials.by_coordinate, partials.by_speed] = S::tangent(case, &q, &u).parts();
        partials.by_time = S::forcing_slope(case, t_s);
    }
}

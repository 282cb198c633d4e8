//! Trajectories of one model through the lanes of a method, and the peaks of each.

use std::marker::PhantomData;

use lane_ode::{
    Forcing, Kernel, Lane, MAX_LANES, N, Peaks, Sample, Segment, SegmentEnd, Simd, Step, Task,
    Tolerance, dopri5, rk4,
};

use crate::Oscillator;
use crate::equations::{Case, Equations, Model};

/// Accepted and rejected steps of a trajectory at most.
const MOST_STEPS: u64 = 100_000_000;

/// The first step that adaptive methods try, as a part of the run; its error says what follows.
const FIRST_STEP: f64 = 1e-6;

/// Stretches of a trajectory: before its window, in it and behind it.
const LEGS: usize = 3;

/// How a trajectory is integrated.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Method {
    /// Fixed steps (s).
    Rk4(f64),
    /// Dormand-Prince, relative and absolute tolerance.
    Dopri5(f64, f64),
}

/// What came of a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Run<const C: usize> {
    /// Why it ended early, as a position among statuses; and when (s), if it had begun.
    pub(crate) failure: Option<(usize, Option<f64>)>,
    /// Largest deviations from equilibrium in the window.
    pub(crate) peaks: [f64; C],
    pub(crate) steps: u64,
    pub(crate) rejected: u64,
}

impl<const C: usize> Run<C> {
    /// A trajectory that has not begun.
    pub(crate) const NONE: Self = Self { failure: None, peaks: [0.0; C], steps: 0, rejected: 0 };
}

/// One model at every point from rest to `end_s`, by one method.
pub(crate) struct Work<'a, O, const C: usize, const D: usize, const P: usize> {
    pub(crate) model: Model,
    pub(crate) method: Method,
    pub(crate) cases: &'a [&'a Case<C, P>],
    pub(crate) end_s: f64,
    /// Once it says so, what comes means nothing.
    pub(crate) is_stopped: &'a dyn Fn() -> bool,
    pub(crate) of: PhantomData<O>,
}

impl<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> Work<'_, O, C, D, P> {
    /// What comes of every point.
    pub(crate) fn runs(self) -> Vec<Run<C>> {
        Simd::best().dispatch(self)
    }
}

impl<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> Kernel
    for Work<'_, O, C, D, P>
{
    type Output = Vec<Run<C>>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Vec<Run<C>> {
        let of = |relative, absolute| Tolerance { relative, absolute, max_steps: MOST_STEPS };
        match self.method {
            Method::Rk4(step_s) => {
                let mut task = Trajectories::new(zero, &self, step_s);
                rk4::integrate(zero, &mut task);
                task.runs
            }
            Method::Dopri5(relative, absolute) => {
                let mut task = Trajectories::new(zero, &self, FIRST_STEP * self.end_s);
                dopri5::integrate(zero, &mut task, &of(relative, absolute));
                task.runs
            }
        }
    }
}

/// Trajectories fed into lanes, and their peaks.
struct Trajectories<'a, O, T, const C: usize, const D: usize, const P: usize> {
    work: &'a Work<'a, O, C, D, P>,
    system: Equations<O, T, C, D, P>,
    step_s: f64,
    taken: usize,
    /// Which trajectory and which of its legs each lane holds.
    held: [(usize, usize); MAX_LANES],
    peaks: Peaks<T, C>,
    /// One where a lane is in its window.
    inside: N<T>,
    runs: Vec<Run<C>>,
}

impl<'a, O: Oscillator<C, D, P>, T: Lane, const C: usize, const D: usize, const P: usize>
    Trajectories<'a, O, T, C, D, P>
{
    /// In steps of `step_s`, or for adaptive methods with that to try first.
    fn new(zero: T, work: &'a Work<'a, O, C, D, P>, step_s: f64) -> Self {
        let zero = N(zero);
        Self {
            work,
            system: Equations::new(work.model, zero),
            step_s,
            taken: 0,
            held: [(0, 0); MAX_LANES],
            peaks: Peaks::new(zero),
            inside: zero,
            runs: vec![Run::NONE; work.cases.len()],
        }
    }

    #[inline(always)]
    fn samples(&self, x: &[N<T>; D], dx: &[N<T>; D]) -> [Sample<T>; C] {
        std::array::from_fn(|i| Sample { value: x[i], slope: x[C + i], curvature: dx[C + i] })
    }

    fn counts(&self) -> T::Mask {
        self.inside.lit(0.5).0.less(self.inside.0)
    }
}

impl<O: Oscillator<C, D, P>, T: Lane, const C: usize, const D: usize, const P: usize> Task<T, D>
    for Trajectories<'_, O, T, C, D, P>
{
    type System = Equations<O, T, C, D, P>;

    fn system(&self) -> &Self::System {
        &self.system
    }

    fn next_segment(
        &mut self,
        lane: usize,
        ended: SegmentEnd,
        x: &mut [N<T>; D],
    ) -> Option<Segment> {
        let (trajectory, mut leg) = self.held[lane];
        if let SegmentEnd::Completed(count) | SegmentEnd::Failed { count, .. } = ended {
            let run = &mut self.runs[trajectory];
            run.steps += count.accepted;
            run.rejected += count.rejected;
            run.peaks = self.peaks.lane(lane);
        }
        match ended {
            SegmentEnd::Completed(_) => leg += 1,
            SegmentEnd::Failed { reason, time_s, .. } => {
                self.runs[trajectory].failure = Some((1 + reason as usize, Some(time_s)));
                leg = LEGS;
            }
            SegmentEnd::Idle => leg = LEGS,
        }
        loop {
            while leg < LEGS {
                // The window's edges cut the run.
                let [from_s, to_s] = self.work.cases[self.held[lane].0].window_s;
                let ends = [0.0, from_s, to_s, self.work.end_s];
                let (start_s, end_s) = (ends[leg], ends[leg + 1]);
                // A window may begin with the run, or end with it.
                if start_s < end_s {
                    self.held[lane].1 = leg;
                    self.inside.0.set(lane, if leg == 1 { 1.0 } else { 0.0 });
                    return Some(Segment {
                        start_s,
                        end_s,
                        step_s: self.step_s.min(end_s - start_s),
                    });
                }
                leg += 1;
            }
            self.peaks.reset(lane);
            self.inside.0.set(lane, 0.0);
            let case = *self.work.cases.get(self.taken)?;
            self.held[lane] = (self.taken, 0);
            self.taken += 1;
            self.system.take(lane, case);
            x.iter_mut().for_each(|value| value.0.set(lane, 0.0));
            leg = 0;
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
        (self.work.is_stopped)()
    }
}

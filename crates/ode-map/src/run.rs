//! Integrates trajectories of one model in lanes, and finds the peaks of each.

use std::marker::PhantomData;

use lane_ode::{
    Cancel, Forcing, Kernel, Lane, MAX_LANES, N, ObservedStep, Peaks, Sample, Segment, SegmentEnd,
    Simd, Task, Tolerance, dopri5, rk4,
};

use crate::Oscillator;
use crate::equations::{Equations, OscillatorModel, PreparedPoint};

/// Greatest number of steps of a trajectory, accepted and rejected ones together. Basis: this
/// number takes hours. Doubling it doubles the time until such a trajectory fails.
const MAX_STEPS: u64 = 100_000_000;

/// First step that adaptive methods try, relative to the length of the run. Basis: far shorter than
/// any motion's period; the step control then corrects it. Doubling it saves less than a step.
const FIRST_STEP_RATIO: f64 = 1e-6;

/// Number of segments of a trajectory: before its window, in it and after it.
const SEGMENT_COUNT: usize = 3;

/// A method of integration with its parameters.
#[derive(Clone, Copy, Debug)]
pub(crate) enum OscillatorMethod {
    /// RK4 with this fixed step (s).
    Rk4(f64),
    /// Dormand-Prince 5(4) with these relative and absolute tolerances.
    Dopri5(f64, f64),
}

/// The result of a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ModelRun<const C: usize> {
    /// The reason of a failure, as an index into the list of statuses, and its time (s) if the
    /// trajectory had begun.
    pub(crate) failure: Option<(usize, Option<f64>)>,
    /// Largest deviations from equilibrium in the window.
    pub(crate) peaks: [f64; C],
    pub(crate) steps: u64,
    pub(crate) rejected: u64,
}

impl<const C: usize> ModelRun<C> {
    /// The result of a trajectory that has not begun.
    pub(crate) const EMPTY: Self = Self { failure: None, peaks: [0.0; C], steps: 0, rejected: 0 };
}

/// The integration of one model at every point, from rest to `end_s`, by one method.
pub(crate) struct Integration<'a, O, const C: usize, const D: usize, const P: usize> {
    pub(crate) model: OscillatorModel,
    pub(crate) method: OscillatorMethod,
    pub(crate) points: &'a [&'a PreparedPoint<C, P>],
    pub(crate) end_s: f64,
    /// The cancellation of the integration, after which the results are meaningless.
    pub(crate) cancel: Cancel<'a>,
    pub(crate) oscillator: PhantomData<O>,
}

impl<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize>
    Integration<'_, O, C, D, P>
{
    /// Integrates every point and returns the results.
    pub(crate) fn integrate(self) -> Vec<ModelRun<C>> {
        Simd::widest().dispatch(self)
    }
}

impl<O: Oscillator<C, D, P>, const C: usize, const D: usize, const P: usize> Kernel
    for Integration<'_, O, C, D, P>
{
    type Output = Vec<ModelRun<C>>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Vec<ModelRun<C>> {
        let tolerance = |relative, absolute| Tolerance {
            relative,
            absolute,
            max_steps: MAX_STEPS,
            longest_step_s: None,
        };
        match self.method {
            OscillatorMethod::Rk4(step_s) => {
                let mut task = Trajectories::new(zero, &self, step_s);
                rk4::integrate(zero, &mut task);
                task.runs
            }
            OscillatorMethod::Dopri5(relative, absolute) => {
                let mut task = Trajectories::new(zero, &self, FIRST_STEP_RATIO * self.end_s);
                dopri5::integrate(zero, &mut task, &tolerance(relative, absolute));
                task.runs
            }
        }
    }
}

/// The task that passes the trajectories through lanes, and records their peaks.
struct Trajectories<'a, O, T, const C: usize, const D: usize, const P: usize> {
    integration: &'a Integration<'a, O, C, D, P>,
    system: Equations<O, T, C, D, P>,
    step_s: f64,
    started_count: usize,
    /// The index of the trajectory and of its segment in each lane.
    current_segments: [(usize, usize); MAX_LANES],
    peaks: Peaks<T, C>,
    /// A number for each lane: 1 within the window, else 0.
    window_indicator: N<T>,
    runs: Vec<ModelRun<C>>,
}

impl<'a, O: Oscillator<C, D, P>, T: Lane, const C: usize, const D: usize, const P: usize>
    Trajectories<'a, O, T, C, D, P>
{
    /// Creates the task with steps of `step_s`, which is the first step for adaptive methods.
    fn new(zero: T, integration: &'a Integration<'a, O, C, D, P>, step_s: f64) -> Self {
        let zero = N(zero);
        Self {
            integration,
            system: Equations::new(integration.model, zero),
            step_s,
            started_count: 0,
            current_segments: [(0, 0); MAX_LANES],
            peaks: Peaks::new(zero),
            window_indicator: zero,
            runs: vec![ModelRun::EMPTY; integration.points.len()],
        }
    }

    #[inline(always)]
    fn samples(&self, x: &[N<T>; D], dx: &[N<T>; D]) -> [Sample<T>; C] {
        std::array::from_fn(|i| Sample { value: x[i], slope: x[C + i], curvature: dx[C + i] })
    }

    fn window_mask(&self) -> T::Mask {
        self.window_indicator.lit(0.5).0.less(self.window_indicator.0)
    }
}

impl<O: Oscillator<C, D, P>, T: Lane, const C: usize, const D: usize, const P: usize> Task<T, D>
    for Trajectories<'_, O, T, C, D, P>
{
    type System = Equations<O, T, C, D, P>;

    fn system(&self) -> &Self::System {
        &self.system
    }

    fn next_segment(&mut self, lane: usize, end: SegmentEnd, x: &mut [N<T>; D]) -> Option<Segment> {
        let (trajectory, mut segment) = self.current_segments[lane];
        if let SegmentEnd::Completed(count) | SegmentEnd::Failed { count, .. } = end {
            let run = &mut self.runs[trajectory];
            run.steps += count.accepted;
            run.rejected += count.rejected;
            run.peaks = self.peaks.lane_peaks(lane);
        }
        match end {
            SegmentEnd::Completed(_) => segment += 1,
            SegmentEnd::Failed { reason, time_s, .. } => {
                self.runs[trajectory].failure = Some((1 + reason as usize, Some(time_s)));
                segment = SEGMENT_COUNT;
            }
            SegmentEnd::Idle => segment = SEGMENT_COUNT,
        }
        loop {
            while segment < SEGMENT_COUNT {
                // The run is divided into segments at the ends of the window.
                let [from_s, to_s] =
                    self.integration.points[self.current_segments[lane].0].window_s;
                let boundaries_s = [0.0, from_s, to_s, self.integration.end_s];
                let start_s = boundaries_s[segment];
                let end_s = boundaries_s[segment + 1];
                // A segment is empty if the window begins with the run or ends with it.
                if start_s < end_s {
                    self.current_segments[lane].1 = segment;
                    self.window_indicator.0.set(lane, if segment == 1 { 1.0 } else { 0.0 });
                    return Some(Segment {
                        start_s,
                        end_s,
                        step_s: self.step_s.min(end_s - start_s),
                    });
                }
                segment += 1;
            }
            self.peaks.reset(lane);
            self.window_indicator.0.set(lane, 0.0);
            let point = *self.integration.points.get(self.started_count)?;
            self.current_segments[lane] = (self.started_count, 0);
            self.started_count += 1;
            self.system.set_point(lane, point);
            x.iter_mut().for_each(|value| value.0.set(lane, 0.0));
            segment = 0;
        }
    }

    #[inline(always)]
    fn begin(&mut self, _: &Forcing<Self, T, D>, x: &[N<T>; D], dx: &[N<T>; D]) {
        let samples = self.samples(x, dx);
        let window_mask = self.window_mask();
        self.peaks.begin(&samples, window_mask);
    }

    #[inline(always)]
    fn observe(&mut self, _: &Forcing<Self, T, D>, step: &ObservedStep<'_, T, D>) {
        let samples = self.samples(step.end_state, step.end_slope);
        let window_mask = self.window_mask();
        self.peaks.advance(step.length_s, &samples, window_mask);
    }

    fn cancel(&self) -> Cancel<'_> {
        self.integration.cancel
    }
}

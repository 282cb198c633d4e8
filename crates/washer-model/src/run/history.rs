//! Time histories: trajectories at given instants, independent of their steps.
//!
//! The trajectory is the one whose peaks [`simulate`](crate::simulate) records, with the same bits
//! in every step: steps do not end at the requested instants, at which states are interpolated.
//! Inside a step the state is the method's dense output, or for RK4 the cubic Hermite polynomial of
//! the states and slopes at both ends. The polynomial has order 4 like the method: the relative
//! error is at most (h w)^4 / 384 for a motion of frequency w, or 1e-9 at 1200 rpm and a step of
//! 2e-4 s.

use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::machine::spin::segment_index;
use crate::nonlinear::coupling::Coupling;
use crate::nonlinear::outputs::squared_distance;
use crate::run::method::{
    LinearFamily, ModelFamily, NonlinearFamily, Rk4Stepper, Stepper, StepperVisitor,
    coupling_for_method, start_segment,
};
use crate::run::model::{LaneModel, LinearModel, NonlinearModel};
use crate::run::snapshots::position_in_step;
use crate::run::suspension::compute_forces;
use crate::{COORDINATES, Method, MethodKind, ModelKind, Point, SuspensionForces};
use core::marker::PhantomData;
use lane_ode::{
    Cancel, Failure, Kernel, Lane, MAX_LANES, N, ObservedStep, OutOfLine, Sample, Segment,
    SegmentEnd, Simd, Task,
};

/// A trajectory at given instants.
#[derive(Clone, Debug)]
pub struct History<'a> {
    /// The reason and the time (s) of a failure, after which there are no instants.
    pub failure: Option<(Failure, f64)>,
    point: &'a Point,
    model: ModelKind,
    times_s: Vec<f64>,
    states: Vec<[f64; STATES]>,
}

/// The outputs of a trajectory at an instant.
#[derive(Clone, Debug, PartialEq)]
pub struct InstantOutputs {
    /// The channels' deviations from equilibrium (m, rad), in the order of `Channel::ALL`.
    pub channels: [f64; CHANNELS],
    /// The channels' rates (m/s, rad/s).
    pub rates: [f64; CHANNELS],
    /// The channels' accelerations (m/s^2, rad/s^2) by the equations of motion.
    pub accelerations: [f64; CHANNELS],
    /// The gap between drum and tub (m).
    pub gap_m: f64,
    /// The deviations of the coordinates q1 to q10 from equilibrium (m, rad).
    pub deviations: [f64; COORDINATES],
    /// The speeds u1 to u10 (m/s, rad/s).
    pub speeds: [f64; COORDINATES],
}

/// The initial state of a trajectory, relative to rest at equilibrium.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InitialDeviation {
    /// The deviations of the coordinates q1 to q10 from equilibrium (m, rad).
    pub deviations: [f64; COORDINATES],
    /// The speeds u1 to u10 (m/s, rad/s).
    pub speeds: [f64; COORDINATES],
}

/// Integrates one model at one point, and returns its states at 0, `interval_s`, 2 `interval_s` and
/// so on to the end of the run.
pub fn integrate_history<'a>(
    model: ModelKind,
    method: &Method,
    point: &'a Point,
    initial_deviation: &InitialDeviation,
    interval_s: f64,
) -> History<'a> {
    let end_s = point.segments.last().map_or(0.0, |segment| segment.end_s);
    let times_s = (0..instant_count(end_s, interval_s)).map(|k| k as f64 * interval_s).collect();
    let requests =
        [HistoryRequest { point, method: *method, initial_deviation: *initial_deviation, times_s }];
    let sampled_states = integrate(model, &requests, Cancel::Never).pop().unwrap_or_default();
    let [request] = requests;
    History::new(model, request, sampled_states)
}

/// Returns the number of instants from 0 to `end_s` at intervals of `interval_s`.
pub fn instant_count(end_s: f64, interval_s: f64) -> usize {
    // Rounding may make the quotient slightly less than a whole number.
    1 + (end_s / interval_s * (1.0 + 1e-12)).floor() as usize
}

/// A request for the history of a trajectory.
#[derive(Clone, Debug)]
pub struct HistoryRequest<'a> {
    /// The machine and its spin.
    pub point: &'a Point,
    /// The method of integration.
    pub method: Method,
    pub initial_deviation: InitialDeviation,
    /// The instants in order, the first at 0.
    pub times_s: Vec<f64>,
}

/// Integrates one model at several points. If the method of all is RK4, as many points as there are
/// lanes are integrated at once. The bits of a history do not depend on the other points. Histories
/// end early once `cancel` is requested. `cancel` is polled at least every
/// [`CANCEL_POLL_STEPS`](lane_ode::CANCEL_POLL_STEPS) steps.
pub fn integrate_histories<'a>(
    model: ModelKind,
    requests: Vec<HistoryRequest<'a>>,
    cancel: Cancel<'_>,
) -> Vec<History<'a>> {
    let is_rk4 = requests.iter().all(|request| request.method.kind == MethodKind::Rk4);
    let batch_len = if is_rk4 { histories_per_batch() } else { 1 };
    let mut requests = requests.into_iter();
    let mut histories = Vec::with_capacity(requests.len());
    loop {
        let batch: Vec<HistoryRequest<'a>> = requests.by_ref().take(batch_len).collect();
        if batch.is_empty() {
            return histories;
        }
        let sampled_states = integrate(model, &batch, cancel);
        for (request, states) in batch.into_iter().zip(sampled_states) {
            histories.push(History::new(model, request, states));
        }
    }
}

/// Returns the number of points that [`integrate_histories`] integrates at once.
pub fn histories_per_batch() -> usize {
    Simd::narrow_set().lanes()
}

/// Integrates one model, with at most as many requests as there are lanes.
fn integrate(
    model: ModelKind,
    requests: &[HistoryRequest<'_>],
    cancel: Cancel<'_>,
) -> Vec<SampledStates> {
    match model {
        ModelKind::Nonlinear => integrate_family::<NonlinearFamily>(requests, cancel),
        ModelKind::Linear => integrate_family::<LinearFamily>(requests, cancel),
    }
}

/// Integrates a single request in one lane by any method, or several requests in lanes by RK4.
fn integrate_family<F: ModelFamily>(
    requests: &[HistoryRequest<'_>],
    cancel: Cancel<'_>,
) -> Vec<SampledStates> {
    let family = PhantomData::<F>;
    match requests {
        [single] => {
            single.method.visit_stepper(HistoryKernel { requests, cancel, stepper: (), family })
        }
        _ => {
            let stepper = Rk4Stepper;
            Simd::dispatch_narrow(HistoryKernel { requests, cancel, stepper, family })
        }
    }
}

impl<F: ModelFamily> StepperVisitor<F> for HistoryKernel<'_, F, ()> {
    type Output = Vec<SampledStates>;

    fn visit<S: Stepper>(self, stepper: S) -> Vec<SampledStates> {
        let Self { requests, cancel, family, .. } = self;
        Simd::one_lane(HistoryKernel { requests, cancel, stepper, family })
    }
}

impl<'a> History<'a> {
    fn new(model: ModelKind, request: HistoryRequest<'a>, samples: SampledStates) -> Self {
        let HistoryRequest { point, times_s, .. } = request;
        let SampledStates { states, failure } = samples;
        Self { failure, point, model, times_s, states }
    }

    /// Returns the number of instants, fewer than requested if the trajectory failed.
    pub fn len(&self) -> usize {
        self.states.len()
    }

    /// Returns false, because every history has the instant of its start.
    pub fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// Computes the outputs at instant `k`; `None` if the trajectory failed before.
    pub fn instant_outputs(&self, k: usize) -> Option<InstantOutputs> {
        let state = self.states.get(k)?;
        let time_s = self.times_s[k];
        let ([channels, rates, accelerations], gap_m) = match self.model {
            ModelKind::Nonlinear => {
                compute_outputs::<NonlinearModel<f64>>(self.point, time_s, state)
            }
            ModelKind::Linear => compute_outputs::<LinearModel<f64>>(self.point, time_s, state),
        };
        let mut deviations: [f64; COORDINATES] = core::array::from_fn(|i| state[i]);
        if self.model == ModelKind::Nonlinear {
            deviations = core::array::from_fn(|i| state[i] - self.point.equilibrium[i]);
        }
        Some(InstantOutputs {
            channels,
            rates,
            accelerations,
            gap_m,
            deviations,
            speeds: core::array::from_fn(|i| state[COORDINATES + i]),
        })
    }

    /// Computes the forces of the suspension at instant `k`; `None` if the trajectory failed
    /// before.
    pub fn forces(&self, k: usize) -> Option<SuspensionForces> {
        self.states.get(k).map(|state| compute_forces(self.point, self.model, state))
    }
}

/// Computes the channels with their rates and accelerations, and the gap, at a state.
fn compute_outputs<M: LaneModel<f64>>(
    point: &Point,
    time_s: f64,
    state: &[f64; STATES],
) -> ([[f64; CHANNELS]; 3], f64) {
    let mut model = M::splat(N(0.0), point, Coupling::Springs);
    model.set_spin(0, &point.spin_segments[segment_index(&point.spin_segments, time_s)]);
    let forcing = model.forcing(N(time_s));
    let state = state.map(N);
    let derivative = model.derivative(&forcing, &state);
    let (radial_position, channels) = model.observe(&forcing, &state, &derivative, true);
    let gap_m =
        point.machine.bodies.clearance.0 - squared_distance(&radial_position).value.0.sqrt();
    let channels = channels.unwrap_or([Sample::constant(N(f64::NAN), N(f64::NAN)); CHANNELS]);
    let values = channels.map(|sample| sample.value.0);
    let rates = channels.map(|sample| sample.slope.0);
    let accelerations = channels.map(|sample| sample.curvature.0);
    ([values, rates, accelerations], gap_m)
}

/// The states at the requested instants, up to a failure.
#[derive(Default)]
struct SampledStates {
    states: Vec<[f64; STATES]>,
    failure: Option<(Failure, f64)>,
}

/// The kernel that integrates histories.
struct HistoryKernel<'a, F, S> {
    /// The requests, at most as many as there are lanes.
    requests: &'a [HistoryRequest<'a>],
    cancel: Cancel<'a>,
    stepper: S,
    family: PhantomData<F>,
}

impl<F: ModelFamily, S: Stepper> Kernel for HistoryKernel<'_, F, S> {
    type Output = Vec<SampledStates>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let mut task = SamplingTask::<T, F::OnLanes<T>>::new(N(zero), self.requests, self.cancel);
        self.stepper.integrate(zero, &mut task);
        task.samples
    }
}

impl<F: ModelFamily, S: Stepper> OutOfLine for HistoryKernel<'_, F, S> {
    type Output = Vec<SampledStates>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        Kernel::run(self, 0.0)
    }
}

/// The integration of one trajectory in each lane, which samples the states at the requested
/// instants.
struct SamplingTask<'a, T, M> {
    model: M,
    zero: N<T>,
    requests: &'a [HistoryRequest<'a>],
    cancel: Cancel<'a>,
    /// The index of each lane's segment, once the lane has started.
    segment_indices: [Option<usize>; MAX_LANES],
    samples: Vec<SampledStates>,
}

impl<'a, T: Lane, M: LaneModel<T>> SamplingTask<'a, T, M> {
    #[inline(always)]
    fn new(zero: N<T>, requests: &'a [HistoryRequest<'a>], cancel: Cancel<'a>) -> Self {
        let HistoryRequest { point, method, .. } = &requests[0];
        let mut model = M::splat(zero, point, coupling_for_method(method, zero));
        for (lane, request) in requests.iter().enumerate().skip(1) {
            model.set_point(lane, request.point);
        }
        let to_start_sample = |request: &HistoryRequest<'_>| {
            let mut start_state = M::rest_state(request.point);
            for i in 0..COORDINATES {
                start_state[i] += request.initial_deviation.deviations[i];
                start_state[COORDINATES + i] += request.initial_deviation.speeds[i];
            }
            SampledStates { states: vec![start_state], failure: None }
        };
        let samples = requests.iter().map(to_start_sample).collect();
        Self { model, zero, requests, cancel, segment_indices: [None; MAX_LANES], samples }
    }
}

impl<T: Lane, M: LaneModel<T>> Task<T, STATES> for SamplingTask<'_, T, M> {
    type System = M;

    #[inline(always)]
    fn system(&self) -> &M {
        &self.model
    }

    #[inline(never)]
    fn next_segment(
        &mut self,
        lane: usize,
        segment_end: SegmentEnd,
        x: &mut [N<T>; STATES],
    ) -> Option<Segment> {
        // Lanes without a request keep the initial state of the last one.
        let request_index = lane.min(self.requests.len() - 1);
        let HistoryRequest { point, method, .. } = &self.requests[request_index];
        let samples = &mut self.samples[request_index];
        let next_segment_index = match segment_end {
            SegmentEnd::Idle if request_index < lane => point.segments.len(),
            SegmentEnd::Idle => 0,
            SegmentEnd::Completed(_) => self.segment_indices[lane].map_or(0, |segment| segment + 1),
            SegmentEnd::Failed { reason, time_s, .. } => {
                samples.failure = Some((reason, time_s));
                point.segments.len()
            }
        };
        let segment = point.segments.get(next_segment_index);
        if next_segment_index == 0 || segment.is_none() {
            // An idle lane has a state at which the model is defined.
            for (x, start_state) in x.iter_mut().zip(samples.states[0]) {
                x.0.set(lane, start_state);
            }
        }
        let segment = segment?;
        self.segment_indices[lane] = Some(next_segment_index);
        Some(start_segment(&mut self.model, lane, method, point, segment))
    }

    #[inline(always)]
    fn begin(&mut self, _: &M::Forcing, _: &[N<T>; STATES], _: &[N<T>; STATES]) {}

    #[inline(always)]
    fn observe(&mut self, _: &M::Forcing, step: &ObservedStep<'_, T, STATES>) {
        // If a step leaves the range of the model, the states inside it are meaningless too.
        let lanes_in_range = T::bits(self.model.in_range(step.end_state));
        loop {
            let mut position = self.zero;
            let mut has_instant = [false; MAX_LANES];
            for (lane, request) in self.requests.iter().enumerate() {
                let end_s = step.end_s.0.get(lane);
                let length_s = step.length_s.0.get(lane);
                let next_time_s = request.times_s.get(self.samples[lane].states.len());
                if let Some(time_s) = next_time_s
                    && lanes_in_range >> lane & 1 == 1
                    && let Some(lane_position) = position_in_step(*time_s, end_s, length_s)
                {
                    has_instant[lane] = true;
                    position.0.set(lane, lane_position);
                }
            }
            if has_instant == [false; MAX_LANES] {
                return;
            }
            let states = step.interpolate(position);
            for lane in (0..self.requests.len()).filter(|&lane| has_instant[lane]) {
                self.samples[lane].states.push(states.map(|x| x.0.get(lane)));
            }
        }
    }

    fn cancel(&self) -> Cancel<'_> {
        self.cancel
    }
}

#[cfg(test)]
mod tests;

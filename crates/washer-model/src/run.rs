//! Integrates trajectories: points pass through the lanes of an integrator, and each leaves a
//! record.

pub(crate) mod active_recorders;
mod checkpoints;
pub(crate) mod equations;
mod gauge;
pub(crate) mod history;
mod load_components;
mod load_laws;
pub(crate) mod loads;
pub(crate) mod method;
pub(crate) mod model;
pub(crate) mod recorders;
mod snapshots;
pub(crate) mod suspension;

pub use gauge::Gauge;
pub use method::{Method, MethodKind};
pub use recorders::{Reading, Recorders};
pub use snapshots::Snapshot;

use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::nonlinear::outputs::{RADIAL_COMPONENTS, squared_distance};
use crate::run::method::{
    LinearFamily, ModelFamily, NonlinearFamily, Stepper, StepperVisitor, coupling_for_method,
    start_segment,
};
use crate::run::model::LaneModel;
use crate::{COORDINATES, ModelKind, Point};
use active_recorders::{ActiveRecorders, ObservedState, Substeps};
use core::marker::PhantomData;
use lane_ode::{
    Cancel, Failure, Kernel, Lane, MAX_LANES, N, ObservedStep, OutOfLine, Peaks, Sample, Segment,
    SegmentEnd, Simd, StepCount, Task,
};

/// The coordinates at the ends of a trajectory's segments, up to its own end.
pub type Checkpoints = Vec<Checkpoint>;

/// The coordinates of a trajectory at the end of a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checkpoint {
    /// The coordinates q1 to q10 (m, rad).
    pub coordinates: [f64; COORDINATES],
}

/// The record of one trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// The reason and the time (s) of a failure.
    pub failure: Option<(Failure, f64)>,
    /// The largest deviation of each channel from equilibrium within the window (m, rad), in the
    /// order of `Channel::ALL`.
    pub amplitudes: [f64; CHANNELS],
    /// The least gap between drum and tub over the whole run (m).
    pub min_gap_m: f64,
    /// The number of accepted steps.
    pub accepted_steps: u64,
    /// The number of steps that an adaptive method rejected.
    pub rejected_steps: u64,
}

/// Integrates one model at every point and records peaks. The result of a point depends neither on
/// the instruction set nor on the other points.
pub fn simulate(simd: Simd, model: ModelKind, method: &Method, points: &[&Point]) -> Vec<Record> {
    simulate_with(simd, model, method, points, Recorders::default()).0
}

/// Integrates one model at every point, like [`simulate`], with further recorders. Returns a
/// [`Reading`] for each point, or none at all if no recorder is in use.
pub fn simulate_with(
    simd: Simd,
    model: ModelKind,
    method: &Method,
    points: &[&Point],
    recorders: Recorders,
) -> (Vec<Record>, Vec<Reading>) {
    simulate_until(simd, model, method, points, recorders, Cancel::Never).unwrap_or_default()
}

/// Integrates one model at every point, like [`simulate_with`]. Returns `None` if `cancel` is
/// requested before the end of all trajectories. `cancel` is polled at least every
/// [`CANCEL_POLL_STEPS`](lane_ode::CANCEL_POLL_STEPS) steps.
pub fn simulate_until(
    simd: Simd,
    model: ModelKind,
    method: &Method,
    points: &[&Point],
    recorders: Recorders,
    cancel: Cancel<'_>,
) -> Option<(Vec<Record>, Vec<Reading>)> {
    if points.is_empty() {
        return Some((Vec::new(), Vec::new()));
    }
    let request = (SimulationRequest { points, method, recorders, cancel }, simd);
    match model {
        ModelKind::Nonlinear => method.visit_stepper::<NonlinearFamily, _>(request),
        ModelKind::Linear => method.visit_stepper::<LinearFamily, _>(request),
    }
}

/// The arguments of a simulation, before model and integrator are types.
struct SimulationRequest<'a> {
    points: &'a [&'a Point],
    method: &'a Method,
    recorders: Recorders,
    cancel: Cancel<'a>,
}

impl<F: ModelFamily> StepperVisitor<F> for (SimulationRequest<'_>, Simd) {
    type Output = Option<(Vec<Record>, Vec<Reading>)>;

    fn visit<S: Stepper>(self, stepper: S) -> Self::Output {
        let (request, simd) = self;
        simd.dispatch(SimulationKernel(request, stepper, PhantomData::<F>))
    }
}

/// The kernel of a simulation.
struct SimulationKernel<'a, F, S>(SimulationRequest<'a>, S, PhantomData<F>);

impl<F: ModelFamily, S: Stepper> Kernel for SimulationKernel<'_, F, S> {
    type Output = Option<(Vec<Record>, Vec<Reading>)>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let mut task = SimulationTask::<T, F::OnLanes<T>>::new(N(zero), self.0, F::KIND);
        self.1.integrate(zero, &mut task);
        task.into_records()
    }
}

/// The record of a trajectory that has not ended or has failed.
const EMPTY_RECORD: Record = Record {
    failure: None,
    amplitudes: [f64::NAN; CHANNELS],
    min_gap_m: f64::NAN,
    accepted_steps: 0,
    rejected_steps: 0,
};

/// The trajectory in a lane.
#[derive(Clone, Copy, Default)]
struct LaneState {
    /// The index of the point.
    point_index: usize,
    /// The index of the current segment.
    segment_index: usize,
    /// The steps up to the current segment.
    step_count: StepCount,
}

/// The integration of every point by one model. A lane whose trajectory ends starts the next point.
struct SimulationTask<'a, T, M> {
    model: M,
    points: &'a [&'a Point],
    cancel: Cancel<'a>,
    /// The number of points that have started.
    started_count: usize,
    /// The number of points that have ended.
    finished_count: usize,
    lane_states: [LaneState; MAX_LANES],
    method: &'a Method,
    channel_peaks: Peaks<T, CHANNELS>,
    /// The greatest square of the radial distance between the fronts of drum and tub.
    radial_peaks: Peaks<T, 1>,
    /// 1 in lanes that are inside their window, 0 in others.
    window_indicator: N<T>,
    records: Vec<Record>,
    active_recorders: Option<ActiveRecorders<T>>,
    /// The coordinates at the ends of each point's segments; empty if checkpoints are not recorded.
    checkpoints: Vec<Checkpoints>,
}

impl<T: Lane, M: LaneModel<T>> Task<T, STATES> for SimulationTask<'_, T, M> {
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
        let lane_state = &mut self.lane_states[lane];
        let mut failure = None;
        match segment_end {
            SegmentEnd::Idle => return self.start_next_point(lane, x),
            SegmentEnd::Completed(count) => lane_state.step_count.add(count),
            SegmentEnd::Failed { reason, time_s, count } => {
                lane_state.step_count.add(count);
                failure = Some((reason, time_s));
            }
        }
        let point = self.points[lane_state.point_index];
        if let Some(checkpoints) = self.checkpoints.get_mut(lane_state.point_index) {
            let coordinates = core::array::from_fn(|i| x[i].0.get(lane));
            checkpoints.push(Checkpoint { coordinates });
        }
        if failure.is_none() && lane_state.segment_index + 1 < point.segments.len() {
            lane_state.segment_index += 1;
            return Some(self.start_segment(lane));
        }
        self.finished_count += 1;
        let StepCount { accepted: accepted_steps, rejected: rejected_steps } =
            lane_state.step_count;
        let record = &mut self.records[lane_state.point_index];
        *record = Record { failure, accepted_steps, rejected_steps, ..EMPTY_RECORD };
        if failure.is_none() {
            record.amplitudes = self.channel_peaks.lane_peaks(lane);
            let [radial_squared] = self.radial_peaks.lane_peaks(lane);
            record.min_gap_m = point.machine.bodies.clearance.0 - radial_squared.sqrt();
        }
        if let Some(active_recorders) = &mut self.active_recorders {
            active_recorders.finish(lane, lane_state.point_index, point, failure.is_some());
        }
        self.start_next_point(lane, x)
    }

    #[inline(always)]
    fn begin(&mut self, forcing: &M::Forcing, x: &[N<T>; STATES], dx: &[N<T>; STATES]) {
        self.window_indicator.0.run_out_of_line(RecordStart { task: self, forcing, x, dx });
    }

    #[inline(always)]
    fn observe(&mut self, forcing: &M::Forcing, step: &ObservedStep<'_, T, STATES>) {
        let lanes_in_window = self.lanes_in_window();
        let (radial_position, channels) = self.model.observe(
            forcing,
            step.end_state,
            step.end_slope,
            T::bits(lanes_in_window) != 0,
        );
        if let Some(channels) = channels {
            self.channel_peaks.advance(step.length_s, &channels, lanes_in_window);
            let step_times = Some((step.end_s, step.length_s));
            self.record(
                step_times,
                (step.end_state, step.end_slope),
                &radial_position,
                &channels,
                lanes_in_window,
            );
        }
        self.radial_peaks.advance(
            step.length_s,
            &[squared_distance(&radial_position)],
            all_lanes(self.window_indicator),
        );
    }

    fn cancel(&self) -> Cancel<'_> {
        self.cancel
    }
}

/// The recording of the state at the start of a segment. It is rare, so that it is not inlined into
/// the loop over steps.
struct RecordStart<'r, 'a, T: Lane, M: LaneModel<T>> {
    task: &'r mut SimulationTask<'a, T, M>,
    forcing: &'r M::Forcing,
    x: &'r [N<T>; STATES],
    dx: &'r [N<T>; STATES],
}

impl<T: Lane, M: LaneModel<T>> OutOfLine for RecordStart<'_, '_, T, M> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { task, forcing, x, dx } = self;
        let lanes_in_window = task.lanes_in_window();
        let (radial_position, channels) =
            task.model.observe(forcing, x, dx, T::bits(lanes_in_window) != 0);
        if let Some(channels) = channels {
            task.channel_peaks.begin(&channels, lanes_in_window);
            task.record(None, (x, dx), &radial_position, &channels, lanes_in_window);
        }
        task.radial_peaks
            .begin(&[squared_distance(&radial_position)], all_lanes(task.window_indicator));
    }
}

/// Returns the mask that is true in every lane.
#[inline(always)]
pub(crate) fn all_lanes<T: Lane>(any_value: N<T>) -> T::Mask {
    any_value.lit(0.0).0.less(any_value.lit(1.0).0)
}

impl<'a, T: Lane, M: LaneModel<T>> SimulationTask<'a, T, M> {
    /// Creates the task before any point has started; `request` has at least one point.
    #[inline(always)]
    fn new(zero: N<T>, request: SimulationRequest<'a>, model: ModelKind) -> Self {
        let SimulationRequest { points, method, recorders, cancel } = request;
        let substeps = Substeps::for_method(method);
        let with_capacity_for = |point: &&Point| Vec::with_capacity(point.segments.len());
        let checkpoints = match recorders.with_checkpoints {
            true => points.iter().map(with_capacity_for).collect(),
            false => Vec::new(),
        };
        Self {
            model: M::splat(zero, points[0], coupling_for_method(method, zero)),
            points,
            cancel,
            started_count: 0,
            finished_count: 0,
            lane_states: [LaneState::default(); MAX_LANES],
            method,
            channel_peaks: Peaks::new(zero),
            radial_peaks: Peaks::new(zero),
            window_indicator: zero,
            records: vec![EMPTY_RECORD; points.len()],
            active_recorders: ActiveRecorders::new(
                zero,
                recorders,
                (model, substeps),
                points[0],
                points.len(),
            ),
            checkpoints,
        }
    }

    /// Returns all records and readings; `None` if some trajectory has not ended.
    fn into_records(self) -> Option<(Vec<Record>, Vec<Reading>)> {
        if self.finished_count < self.points.len() {
            return None;
        }
        let mut readings = self
            .active_recorders
            .map_or_else(Vec::new, |active_recorders| active_recorders.readings);
        if !self.checkpoints.is_empty() {
            readings.resize(self.checkpoints.len(), Reading::default());
        }
        for (reading, checkpoints) in readings.iter_mut().zip(self.checkpoints) {
            reading.checkpoints = checkpoints;
        }
        Some((self.records, readings))
    }

    /// Passes a state and its outputs to the recorders in use.
    #[inline(always)]
    fn record(
        &mut self,
        step: Option<(N<T>, N<T>)>,
        (x, dx): (&[N<T>; STATES], &[N<T>; STATES]),
        radial_position: &[Sample<T>; RADIAL_COMPONENTS],
        channels: &[Sample<T>; CHANNELS],
        lanes_in_window: T::Mask,
    ) {
        if let Some(recorders) = &mut self.active_recorders {
            self.window_indicator.0.run_out_of_line(ObservedState {
                recorders,
                step,
                x,
                dx,
                radial_position,
                channels,
                lanes_in_window,
            });
        }
    }

    /// Returns the lanes that are inside their windows.
    #[inline(always)]
    fn lanes_in_window(&self) -> T::Mask {
        self.window_indicator.lit(0.0).0.less(self.window_indicator.0)
    }

    /// Starts the next point in a lane, if there is one.
    fn start_next_point(&mut self, lane: usize, x: &mut [N<T>; STATES]) -> Option<Segment> {
        self.window_indicator.0.set(lane, 0.0);
        // An idle lane has the initial state of its last point, at which the model is defined.
        let is_idle = self.started_count == self.points.len();
        let index = if is_idle { self.lane_states[lane].point_index } else { self.started_count };
        let point = self.points[index];
        for (x, at_rest) in x.iter_mut().zip(M::rest_state(point)) {
            x.0.set(lane, at_rest);
        }
        if is_idle {
            return None;
        }
        self.started_count += 1;
        self.lane_states[lane] = LaneState { point_index: index, ..LaneState::default() };
        self.model.set_point(lane, point);
        self.channel_peaks.reset(lane);
        self.radial_peaks.reset(lane);
        if let Some(active_recorders) = &mut self.active_recorders {
            active_recorders.set_point(lane, point);
        }
        Some(self.start_segment(lane))
    }

    /// Starts the lane's current segment.
    fn start_segment(&mut self, lane: usize) -> Segment {
        let lane_state = &self.lane_states[lane];
        let point = self.points[lane_state.point_index];
        let segment = &point.segments[lane_state.segment_index];
        self.window_indicator.0.set(lane, f64::from(u8::from(segment.is_in_window)));
        start_segment(&mut self.model, lane, self.method, point, segment)
    }
}

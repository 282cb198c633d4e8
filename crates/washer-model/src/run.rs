//! Trajectories: points run through the lanes of an integrator, and their records.

mod course;
pub(crate) mod equations;
pub(crate) mod extras;
pub(crate) mod history;
pub(crate) mod loads;
pub(crate) mod method;
pub(crate) mod model;
pub(crate) mod recorders;
mod snapshots;
pub(crate) mod suspension;

pub use loads::Gauge;
pub use method::{Level, Method, MethodNumbers};
pub use recorders::{Reading, Recorders};
pub use snapshots::Snapshot;

use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::nonlinear::outputs::{RADIAL, squared};
use crate::run::method::{ByMethod, Family, OfLinear, OfNonlinear, Stepper, coupling, enter};
use crate::run::model::Model;
use crate::{COORDINATES, ModelKind, Point};
use core::marker::PhantomData;
use extras::{Extras, Instants, Seen};
use lane_ode::{
    Aside, Count, Failure, Kernel, Lane, MAX_LANES, N, Peaks, Sample, Segment, SegmentEnd, Simd,
    Step, Task,
};

/// Says whether to stop.
pub type Stop<'a> = &'a dyn Fn() -> bool;

/// The ends of a trajectory's legs, up to its own end.
pub type Course = Vec<Waypoint>;

/// A trajectory at the end of a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// Coordinates (m, rad).
    pub coordinates: [f64; COORDINATES],
}

/// The record of one trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Why and when (s) it failed, if it did.
    pub failure: Option<(Failure, f64)>,
    /// Largest deviation from equilibrium within the window, in the order of `Channel::ALL` (m,
    /// rad).
    pub amplitudes: [f64; CHANNELS],
    /// Least gap between drum and tub over the whole run (m).
    pub min_gap_m: f64,
    /// Steps of the integrator.
    pub steps: u64,
    /// Steps that an adaptive method took back.
    pub rejected: u64,
}

/// Integrates one model at every point and records peaks. The result does not depend on the
/// instruction set, nor on which points come together.
pub fn simulate(simd: Simd, model: ModelKind, method: &Method, points: &[&Point]) -> Vec<Record> {
    simulate_with(simd, model, method, points, Recorders::default()).0
}

/// As [`simulate`], and records one [`Reading`] per point if anything else is wanted.
pub fn simulate_with(
    simd: Simd,
    model: ModelKind,
    method: &Method,
    points: &[&Point],
    wanted: Recorders,
) -> (Vec<Record>, Vec<Reading>) {
    simulate_until(simd, model, method, points, wanted, &|| false).unwrap_or_default()
}

/// As [`simulate_with`]; `None` if `stop` says so before all trajectories have ended. It is asked
/// every [`STEPS_AT_ONCE`](lane_ode::STEPS_AT_ONCE) steps at least.
pub fn simulate_until(
    simd: Simd,
    model: ModelKind,
    method: &Method,
    points: &[&Point],
    wanted: Recorders,
    stop: Stop<'_>,
) -> Option<(Vec<Record>, Vec<Reading>)> {
    if points.is_empty() {
        return Some((Vec::new(), Vec::new()));
    }
    let order = (Order { points, method, wanted, stop }, simd);
    match model {
        ModelKind::Nonlinear => method.choose::<OfNonlinear, _>(order),
        ModelKind::Linear => method.choose::<OfLinear, _>(order),
    }
}

/// What to simulate, by either model.
struct Order<'a> {
    points: &'a [&'a Point],
    method: &'a Method,
    wanted: Recorders,
    stop: Stop<'a>,
}

impl<F: Family> ByMethod<F> for (Order<'_>, Simd) {
    type Output = Option<(Vec<Record>, Vec<Reading>)>;

    fn by<S: Stepper>(self, stepper: S) -> Self::Output {
        self.1.dispatch(Simulate(self.0, stepper, PhantomData::<F>))
    }
}

struct Simulate<'a, F, S>(Order<'a>, S, PhantomData<F>);

impl<F: Family, S: Stepper> Kernel for Simulate<'_, F, S> {
    type Output = Option<(Vec<Record>, Vec<Reading>)>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let mut run = Run::<T, F::Over<T>>::new(N(zero), self.0, F::KIND);
        self.1.integrate(zero, &mut run);
        run.recorded()
    }
}

const EMPTY: Record = Record {
    failure: None,
    amplitudes: [f64::NAN; CHANNELS],
    min_gap_m: f64::NAN,
    steps: 0,
    rejected: 0,
};

/// Which trajectory a lane holds, and where in it.
#[derive(Clone, Copy, Default)]
struct LaneState {
    point: usize,
    leg: usize,
    count: Count,
}

/// The task: every point through one model.
struct Run<'a, T, M> {
    model: M,
    points: &'a [&'a Point],
    stop: Stop<'a>,
    taken: usize,
    finished: usize,
    lanes: [LaneState; MAX_LANES],
    method: &'a Method,
    channels: Peaks<T, CHANNELS>,
    radial: Peaks<T, 1>,
    /// 1 where a lane is inside its window, else 0.
    windows: N<T>,
    records: Vec<Record>,
    extras: Option<Extras<T>>,
    /// Coordinates at the ends of each point's legs; empty unless wanted.
    courses: Vec<Course>,
}

impl<T: Lane, M: Model<T>> Task<T, STATES> for Run<'_, T, M> {
    type System = M;

    #[inline(always)]
    fn system(&self) -> &M {
        &self.model
    }

    #[inline(never)]
    fn next_segment(
        &mut self,
        lane: usize,
        ended: SegmentEnd,
        x: &mut [N<T>; STATES],
    ) -> Option<Segment> {
        let state = &mut self.lanes[lane];
        let mut failure = None;
        match ended {
            SegmentEnd::Idle => return self.next_point(lane, x),
            SegmentEnd::Completed(count) => state.count.add(count),
            SegmentEnd::Failed { reason, time_s, count } => {
                state.count.add(count);
                failure = Some((reason, time_s));
            }
        }
        let point = self.points[state.point];
        if let Some(course) = self.courses.get_mut(state.point) {
            let coordinates = core::array::from_fn(|i| x[i].0.get(lane));
            course.push(Waypoint { coordinates });
        }
        if failure.is_none() && state.leg + 1 < point.legs.len() {
            state.leg += 1;
            return Some(self.enter(lane));
        }
        self.finished += 1;
        let Count { accepted: steps, rejected } = state.count;
        let record = &mut self.records[state.point];
        *record = Record { failure, steps, rejected, ..EMPTY };
        if failure.is_none() {
            record.amplitudes = self.channels.lane(lane);
            let [radial_squared] = self.radial.lane(lane);
            record.min_gap_m = point.machine.bodies.clearance.0 - radial_squared.sqrt();
        }
        if let Some(extras) = &mut self.extras {
            extras.finish(lane, state.point, point, failure.is_some());
        }
        self.next_point(lane, x)
    }

    #[inline(always)]
    fn begin(&mut self, forcing: &M::Forcing, x: &[N<T>; STATES], dx: &[N<T>; STATES]) {
        self.windows.0.aside(Begin { run: self, forcing, x, dx });
    }

    #[inline(always)]
    fn observe(&mut self, forcing: &M::Forcing, step: &Step<'_, T, STATES>) {
        let inside = self.inside();
        let (radial, channels) =
            self.model.observe(forcing, step.after, step.slope_after, T::bits(inside) != 0);
        if let Some(channels) = channels {
            self.channels.advance(step.length_s, &channels, inside);
            let times = Some((step.end_s, step.length_s));
            self.show(times, (step.after, step.slope_after), &radial, &channels, inside);
        }
        self.radial.advance(step.length_s, &[squared(&radial)], everywhere(self.windows));
    }

    fn is_stopped(&self) -> bool {
        (self.stop)()
    }
}

/// A leg begins.
struct Begin<'r, 'a, T: Lane, M: Model<T>> {
    run: &'r mut Run<'a, T, M>,
    forcing: &'r M::Forcing,
    x: &'r [N<T>; STATES],
    dx: &'r [N<T>; STATES],
}

impl<T: Lane, M: Model<T>> Aside for Begin<'_, '_, T, M> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { run, forcing, x, dx } = self;
        let inside = run.inside();
        let (radial, channels) = run.model.observe(forcing, x, dx, T::bits(inside) != 0);
        if let Some(channels) = channels {
            run.channels.begin(&channels, inside);
            run.show(None, (x, dx), &radial, &channels, inside);
        }
        run.radial.begin(&[squared(&radial)], everywhere(run.windows));
    }
}

/// True in every lane.
#[inline(always)]
pub(crate) fn everywhere<T: Lane>(like: N<T>) -> T::Mask {
    like.lit(0.0).0.less(like.lit(1.0).0)
}

impl<'a, T: Lane, M: Model<T>> Run<'a, T, M> {
    /// Every point still to be taken up; there is at least one.
    #[inline(always)]
    fn new(zero: N<T>, order: Order<'a>, model: ModelKind) -> Self {
        let Order { points, method, wanted, stop } = order;
        let instants = Instants::of(method);
        let course = |point: &&Point| Vec::with_capacity(point.legs.len());
        Self {
            model: M::splat(zero, points[0], coupling(method, zero)),
            points,
            stop,
            taken: 0,
            finished: 0,
            lanes: [LaneState::default(); MAX_LANES],
            method,
            channels: Peaks::new(zero),
            radial: Peaks::new(zero),
            windows: zero,
            records: vec![EMPTY; points.len()],
            extras: Extras::new(zero, wanted, (model, instants), points[0], points.len()),
            courses: if wanted.course { points.iter().map(course).collect() } else { Vec::new() },
        }
    }

    /// All records; `None` if some point has none.
    fn recorded(self) -> Option<(Vec<Record>, Vec<Reading>)> {
        if self.finished < self.points.len() {
            return None;
        }
        let mut found = self.extras.map_or_else(Vec::new, |extras| extras.found);
        if !self.courses.is_empty() {
            found.resize(self.courses.len(), Reading::default());
        }
        for (extra, course) in found.iter_mut().zip(self.courses) {
            extra.course = course;
        }
        Some((self.records, found))
    }

    /// Passes an instant to the recorders in use.
    #[inline(always)]
    fn show(
        &mut self,
        step: Option<(N<T>, N<T>)>,
        (x, dx): (&[N<T>; STATES], &[N<T>; STATES]),
        radial: &[Sample<T>; RADIAL],
        channels: &[Sample<T>; CHANNELS],
        inside: T::Mask,
    ) {
        if let Some(extras) = &mut self.extras {
            self.windows.0.aside(Seen { extras, step, x, dx, radial, channels, inside });
        }
    }

    #[inline(always)]
    fn inside(&self) -> T::Mask {
        self.windows.lit(0.0).0.less(self.windows.0)
    }

    /// Takes up the next point, if there is one.
    fn next_point(&mut self, lane: usize, x: &mut [N<T>; STATES]) -> Option<Segment> {
        self.windows.0.set(lane, 0.0);
        // An idle lane rests at the start of its last point, where the model is defined.
        let is_last = self.taken == self.points.len();
        let index = if is_last { self.lanes[lane].point } else { self.taken };
        let point = self.points[index];
        for (x, at_rest) in x.iter_mut().zip(M::at_rest(point)) {
            x.0.set(lane, at_rest);
        }
        if is_last {
            return None;
        }
        self.taken += 1;
        self.lanes[lane] = LaneState { point: index, ..LaneState::default() };
        self.model.set_point(lane, point);
        self.channels.reset(lane);
        self.radial.reset(lane);
        if let Some(extras) = &mut self.extras {
            extras.set_point(lane, point);
        }
        Some(self.enter(lane))
    }

    /// Starts the lane's current leg.
    fn enter(&mut self, lane: usize) -> Segment {
        let state = &self.lanes[lane];
        let point = self.points[state.point];
        let leg = &point.legs[state.leg];
        self.windows.0.set(lane, f64::from(u8::from(leg.in_window)));
        enter(&mut self.model, lane, *self.method, point, leg)
    }
}

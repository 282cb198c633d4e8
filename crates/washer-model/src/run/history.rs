//! Time histories: trajectories at given instants, independent of their steps.
//!
//! It is the trajectory whose peaks [`simulate`](crate::simulate) records, with the same bits in
//! every step: instants are interpolated, and steps do not end on them. Inside a step the state is
//! the method's own dense output, or for Runge-Kutta the cubic through the states and slopes at
//! both ends. That is of fourth order like the method; the error is at most (h w)^4 / 384 of a
//! motion of frequency w, or 1e-9 at 1200 rpm and a step of 2e-4 s.

use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::machine::spin::stretch_at;
use crate::nonlinear::coupling::Coupling;
use crate::nonlinear::outputs::squared;
use crate::run::method::{
    ByMethod, ByRk4, Family, OfLinear, OfNonlinear, Stepper, coupling, enter,
};
use crate::run::model::{Linear, Model, Nonlinear};
use crate::run::snapshots::share_of_step;
use crate::run::suspension::forces;
use crate::{COORDINATES, Forces, Method, ModelKind, Point, Stop};
use core::marker::PhantomData;
use lane_ode::{
    Aside, Failure, Kernel, Lane, MAX_LANES, N, Sample as Sampled, Segment, SegmentEnd, Simd, Step,
    Task,
};

/// One trajectory at some instants.
#[derive(Clone, Debug)]
pub struct History<'a> {
    /// Why and when (s) it failed, if it did; there are no instants from there on.
    pub failure: Option<(Failure, f64)>,
    point: &'a Point,
    model: ModelKind,
    times_s: Vec<f64>,
    states: Vec<[f64; STATES]>,
}

/// One instant of a history.
#[derive(Clone, Debug, PartialEq)]
pub struct Instant {
    /// Deviations from equilibrium in the order of `Channel::ALL` (m, rad).
    pub channels: [f64; CHANNELS],
    /// Their rates (m/s, rad/s).
    pub rates: [f64; CHANNELS],
    /// Their accelerations (m/s^2, rad/s^2), by the equations at the instant.
    pub accelerations: [f64; CHANNELS],
    /// Gap between drum and tub (m).
    pub gap_m: f64,
    /// Coordinates q1 to q10 as deviations from equilibrium (m, rad).
    pub deviations: [f64; COORDINATES],
    /// Their speeds u1 to u10 (m/s, rad/s).
    pub speeds: [f64; COORDINATES],
}

/// Where a trajectory starts: deviations from equilibrium at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Start {
    /// Of q1 to q10 (m, rad).
    pub deviations: [f64; COORDINATES],
    /// Speeds u1 to u10 (m/s, rad/s).
    pub speeds: [f64; COORDINATES],
}

/// Integrates one model at one point and keeps its state at 0, `every_s`, 2 `every_s` and so on to
/// the end of the run.
pub fn history<'a>(
    model: ModelKind,
    method: &Method,
    point: &'a Point,
    start: &Start,
    every_s: f64,
) -> History<'a> {
    let end_s = point.legs.last().map_or(0.0, |leg| leg.end_s);
    let times_s = (0..instants(end_s, every_s)).map(|k| k as f64 * every_s).collect();
    let asked = [Asked { point, method: *method, start: *start, times_s }];
    let sampled = sample(model, &asked, &|| false).pop().unwrap_or_default();
    let [asked] = asked;
    of(model, asked, sampled)
}

/// How many instants there are from 0 to an end, so far apart.
pub fn instants(end_s: f64, every_s: f64) -> usize {
    // The quotient may come out a hair below the whole number that was meant.
    1 + (end_s / every_s * (1.0 + 1e-12)).floor() as usize
}

/// One trajectory that is asked for.
#[derive(Clone, Debug)]
pub struct Asked<'a> {
    /// Its machine and spin.
    pub point: &'a Point,
    /// What integrates it.
    pub method: Method,
    /// Where it starts.
    pub start: Start,
    /// Its instants in order, the first at 0.
    pub times_s: Vec<f64>,
}

/// Integrates one model at several points. By plain Runge-Kutta, so many points at once as there
/// are lanes; each history has the same bits alone. It comes as far as it is when `stop` says so,
/// which is asked every [`STEPS_AT_ONCE`](lane_ode::STEPS_AT_ONCE) steps at least.
pub fn histories<'a>(model: ModelKind, asked: Vec<Asked<'a>>, stop: Stop<'_>) -> Vec<History<'a>> {
    let is_plain = asked.iter().all(|one| matches!(one.method, Method::Rk4 { .. }));
    let at_once = if is_plain { together() } else { 1 };
    let mut asked = asked.into_iter();
    let mut found = Vec::with_capacity(asked.len());
    loop {
        let some: Vec<Asked<'a>> = asked.by_ref().take(at_once).collect();
        if some.is_empty() {
            return found;
        }
        let sampled = sample(model, &some, stop);
        found.extend(some.into_iter().zip(sampled).map(|(one, states)| of(model, one, states)));
    }
}

/// How many points [`histories`] takes at once.
pub fn together() -> usize {
    Simd::narrow().lanes()
}

fn sample(model: ModelKind, asked: &[Asked<'_>], stop: Stop<'_>) -> Vec<States> {
    match model {
        ModelKind::Nonlinear => sample_by::<OfNonlinear>(asked, stop),
        ModelKind::Linear => sample_by::<OfLinear>(asked, stop),
    }
}

/// One in one lane; several, by plain Runge-Kutta, side by side.
fn sample_by<F: Family>(asked: &[Asked<'_>], stop: Stop<'_>) -> Vec<States> {
    let family = PhantomData::<F>;
    match asked {
        [one] => one.method.choose(Sample { asked, stop, stepper: (), family }),
        _ => Simd::dispatch_narrow(Sample { asked, stop, stepper: ByRk4, family }),
    }
}

impl<F: Family> ByMethod<F> for Sample<'_, F, ()> {
    type Output = Vec<States>;

    fn by<S: Stepper>(self, stepper: S) -> Vec<States> {
        let Self { asked, stop, family, .. } = self;
        Simd::one_lane(Sample { asked, stop, stepper, family })
    }
}

fn of(model: ModelKind, asked: Asked<'_>, sampled: States) -> History<'_> {
    let Asked { point, times_s, .. } = asked;
    let States { states, failure } = sampled;
    History { failure, point, model, times_s, states }
}

impl History<'_> {
    /// How many instants there are; fewer than asked for if the trajectory failed.
    pub fn len(&self) -> usize {
        self.states.len()
    }

    /// Whether there are none. There is always the start.
    pub fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// The outputs at instant `k`, if the trajectory got there.
    pub fn instant(&self, k: usize) -> Option<Instant> {
        let state = self.states.get(k)?;
        let time_s = self.times_s[k];
        let ([channels, rates, accelerations], gap_m) = match self.model {
            ModelKind::Nonlinear => observed::<Nonlinear<f64>>(self.point, time_s, state),
            ModelKind::Linear => observed::<Linear<f64>>(self.point, time_s, state),
        };
        let mut deviations: [f64; COORDINATES] = core::array::from_fn(|i| state[i]);
        if self.model == ModelKind::Nonlinear {
            deviations = core::array::from_fn(|i| state[i] - self.point.equilibrium[i]);
        }
        Some(Instant {
            channels,
            rates,
            accelerations,
            gap_m,
            deviations,
            speeds: core::array::from_fn(|i| state[COORDINATES + i]),
        })
    }

    /// The forces of springs and dampers at instant `k`, if the trajectory got there.
    pub fn forces(&self, k: usize) -> Option<Forces> {
        self.states.get(k).map(|state| forces(self.point, self.model, state))
    }
}

/// Channels with their rates and accelerations, and the gap, of a state.
fn observed<M: Model<f64>>(
    point: &Point,
    time_s: f64,
    state: &[f64; STATES],
) -> ([[f64; CHANNELS]; 3], f64) {
    let mut model = M::splat(N(0.0), point, Coupling::Springs);
    model.set_spin(0, &point.stretches[stretch_at(&point.stretches, time_s)]);
    let (forcing, state) = (model.forcing(N(time_s)), state.map(N));
    let (radial, channels) =
        model.observe(&forcing, &state, &model.derivative(&forcing, &state), true);
    let gap_m = point.machine.bodies.clearance.0 - squared(&radial).value.0.sqrt();
    let of = |take: fn(&Sampled<f64>) -> N<f64>| {
        channels.map_or([f64::NAN; CHANNELS], |channels| channels.map(|sample| take(&sample).0))
    };
    ([of(|it| it.value), of(|it| it.slope), of(|it| it.curvature)], gap_m)
}

/// States at the instants, as far as it came.
#[derive(Default)]
struct States {
    states: Vec<[f64; STATES]>,
    failure: Option<(Failure, f64)>,
}

struct Sample<'a, F, S> {
    /// No more than there are lanes.
    asked: &'a [Asked<'a>],
    stop: Stop<'a>,
    stepper: S,
    family: PhantomData<F>,
}

impl<F: Family, S: Stepper> Kernel for Sample<'_, F, S> {
    type Output = Vec<States>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let mut sampling = Sampling::<T, F::Over<T>>::new(N(zero), self.asked, self.stop);
        self.stepper.integrate(zero, &mut sampling);
        sampling.found
    }
}

impl<F: Family, S: Stepper> Aside for Sample<'_, F, S> {
    type Output = Vec<States>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        Kernel::run(self, 0.0)
    }
}

/// The task: a trajectory in each lane, its states kept where instants fall.
struct Sampling<'a, T, M> {
    model: M,
    zero: N<T>,
    asked: &'a [Asked<'a>],
    stop: Stop<'a>,
    /// Which leg each lane is on, once it has begun.
    legs: [Option<usize>; MAX_LANES],
    found: Vec<States>,
}

impl<'a, T: Lane, M: Model<T>> Sampling<'a, T, M> {
    #[inline(always)]
    fn new(zero: N<T>, asked: &'a [Asked<'a>], stop: Stop<'a>) -> Self {
        let Asked { point, method, .. } = &asked[0];
        let mut model = M::splat(zero, point, coupling(method, zero));
        for (lane, asked) in asked.iter().enumerate().skip(1) {
            model.set_point(lane, asked.point);
        }
        let begun = |asked: &Asked<'_>| {
            let mut start = M::at_rest(asked.point);
            for i in 0..COORDINATES {
                start[i] += asked.start.deviations[i];
                start[COORDINATES + i] += asked.start.speeds[i];
            }
            States { states: vec![start], failure: None }
        };
        let found = asked.iter().map(begun).collect();
        Self { model, zero, asked, stop, legs: [None; MAX_LANES], found }
    }
}

impl<T: Lane, M: Model<T>> Task<T, STATES> for Sampling<'_, T, M> {
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
        let place = lane.min(self.asked.len() - 1);
        let (Asked { point, method, .. }, found) = (&self.asked[place], &mut self.found[place]);
        let next = match ended {
            SegmentEnd::Idle if place < lane => point.legs.len(),
            SegmentEnd::Idle => 0,
            SegmentEnd::Completed(_) => self.legs[lane].map_or(0, |leg| leg + 1),
            SegmentEnd::Failed { reason, time_s, .. } => {
                found.failure = Some((reason, time_s));
                point.legs.len()
            }
        };
        let leg = point.legs.get(next);
        if next == 0 || leg.is_none() {
            // An idle lane rests where the model is defined.
            for (x, start) in x.iter_mut().zip(found.states[0]) {
                x.0.set(lane, start);
            }
        }
        let leg = leg?;
        self.legs[lane] = Some(next);
        Some(enter(&mut self.model, lane, *method, point, leg))
    }

    #[inline(always)]
    fn begin(&mut self, _: &M::Forcing, _: &[N<T>; STATES], _: &[N<T>; STATES]) {}

    #[inline(always)]
    fn observe(&mut self, _: &M::Forcing, step: &Step<'_, T, STATES>) {
        // A step that left the model's range is meaningless, also inside.
        let in_range = T::bits(self.model.in_range(step.after));
        loop {
            let mut share = self.zero;
            let mut reached = [false; MAX_LANES];
            for (lane, asked) in self.asked.iter().enumerate() {
                let (end_s, length_s) = (step.end_s.0.get(lane), step.length_s.0.get(lane));
                let next = asked.times_s.get(self.found[lane].states.len());
                if let Some(time_s) = next
                    && in_range >> lane & 1 == 1
                    && let Some(at) = share_of_step(*time_s, end_s, length_s)
                {
                    reached[lane] = true;
                    share.0.set(lane, at);
                }
            }
            if reached == [false; MAX_LANES] {
                return;
            }
            let states = step.at(share);
            for lane in (0..self.asked.len()).filter(|&lane| reached[lane]) {
                self.found[lane].states.push(states.map(|x| x.0.get(lane)));
            }
        }
    }

    fn is_stopped(&self) -> bool {
        (self.stop)()
    }
}

#[cfg(test)]
mod tests;

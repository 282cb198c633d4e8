//! Time histories: one trajectory at even instants, independent of its steps.
//!
//! It is the trajectory whose peaks [`simulate`](crate::simulate) records, with the same bits in
//! every step: instants are interpolated, and steps do not end on them. Inside a step the state is
//! the method's own dense output, or for Runge-Kutta the cubic through the states and slopes at
//! both ends. That is of fourth order like the method; the error is at most (h w)^4 / 384 of a
//! motion of frequency w, or 1e-9 at 1200 rpm and a step of 2e-4 s.

use crate::channel::CHANNELS;
use crate::coordinates::{COORDINATES, STATES};
use crate::fast::geared::Formula;
use crate::kind::ModelKind;
use crate::machine::spin::stretch_at;
use crate::nonlinear::coupling::Coupling;
use crate::nonlinear::outputs::squared;
use crate::point::Point;
use crate::run::model::{Linear, Model, Nonlinear};
use crate::run::stiff::{OnLeg, StiffTask};
use crate::run::suspension::{Forces, forces};
use crate::run::{Family, Method, OfLinear, OfNonlinear, Stop, coupling, first_step};
use core::marker::PhantomData;
use lane_ode::{
    Dual, Ended, Failure, Leg, N, Sample as Sampled, ScalarKernel, Simd, Step, Task, dop853,
    dopri5, rk4, rodas,
};

/// An instant this share of a step past its end is its end.
const SLACK: f64 = 1e-9;

/// One trajectory at even instants.
#[derive(Clone, Debug)]
pub struct History<'a> {
    /// Why and when (s) it failed, if it did; there are no instants from there on.
    pub failure: Option<(Failure, f64)>,
    point: &'a Point,
    model: ModelKind,
    every_s: f64,
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
#[must_use]
pub fn history<'a>(
    model: ModelKind,
    method: &Method,
    point: &'a Point,
    start: &Start,
    every_s: f64,
) -> History<'a> {
    history_until(model, method, point, start, every_s, &|| false)
}

/// As [`history`], as far as it has come when `stop` says so. It is asked every
/// [`STEPS_AT_ONCE`](lane_ode::STEPS_AT_ONCE) steps at least.
#[must_use]
pub fn history_until<'a>(
    model: ModelKind,
    method: &Method,
    point: &'a Point,
    start: &Start,
    every_s: f64,
    stop: Stop<'_>,
) -> History<'a> {
    let (states, failure) = match model {
        ModelKind::Nonlinear => Simd::one_lane(Sample::<OfNonlinear> {
            point,
            method,
            start,
            every_s,
            stop,
            family: PhantomData,
        }),
        ModelKind::Linear => Simd::one_lane(Sample::<OfLinear> {
            point,
            method,
            start,
            every_s,
            stop,
            family: PhantomData,
        }),
    };
    History { failure, point, model, every_s, states }
}

impl History<'_> {
    /// How many instants there are; fewer than asked for if the trajectory failed.
    #[must_use]
    pub fn len(&self) -> usize {
        self.states.len()
    }

    /// Whether there are none. There is always the start.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// The outputs at instant `k`, if the trajectory got there.
    #[must_use]
    pub fn instant(&self, k: usize) -> Option<Instant> {
        let state = self.states.get(k)?;
        let time_s = k as f64 * self.every_s;
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
    #[must_use]
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

struct Sample<'a, F> {
    point: &'a Point,
    method: &'a Method,
    start: &'a Start,
    every_s: f64,
    stop: Stop<'a>,
    family: PhantomData<F>,
}

impl<F: Family> ScalarKernel for Sample<'_, F> {
    type Output = (Vec<[f64; STATES]>, Option<(Failure, f64)>);

    #[inline(always)]
    fn run(self) -> Self::Output {
        let mut start = <F::Over<f64> as Model<f64>>::at_rest(self.point);
        for i in 0..COORDINATES {
            start[i] += self.start.deviations[i];
            start[COORDINATES + i] += self.start.speeds[i];
        }
        let mut sampling = Sampling::<F::Over<f64>> {
            model: Model::splat(N(0.0), self.point, coupling(self.method, N(0.0))),
            point: self.point,
            every_s: self.every_s,
            method: self.method,
            stop: self.stop,
            leg: None,
            start,
            states: vec![start],
            failure: None,
        };
        match self.method {
            Method::Rk4 { .. } => rk4::integrate(0.0, &mut sampling),
            Method::Geared(_) => match F::FORMULA {
                Formula::Rk4 => rk4::integrate(0.0, &mut sampling),
                Formula::Dop853 => dop853::integrate(0.0, &mut sampling),
            },
            Method::Dopri5(tolerance) => dopri5::integrate(0.0, &mut sampling, tolerance),
            Method::Rodas5p(tolerance) => {
                let mut task =
                    StiffTask::<f64, _, F::Over<Dual<f64>>>::new(0.0, sampling, self.point);
                rodas::integrate(&mut task, tolerance);
                sampling = task.task;
            }
        }
        (sampling.states, sampling.failure)
    }
}

/// The task: one trajectory, its states kept where instants fall.
struct Sampling<'a, M> {
    model: M,
    point: &'a Point,
    every_s: f64,
    method: &'a Method,
    stop: Stop<'a>,
    /// Which leg it is on, once it has begun.
    leg: Option<usize>,
    start: [f64; STATES],
    states: Vec<[f64; STATES]>,
    failure: Option<(Failure, f64)>,
}

impl<M: Model<f64>> OnLeg for Sampling<'_, M> {
    fn place(&self) -> (&Point, usize) {
        (self.point, self.leg.unwrap_or(0))
    }
}

impl<M: Model<f64>> Task<f64, STATES> for Sampling<'_, M> {
    type System = M;

    #[inline(always)]
    fn system(&self) -> &M {
        &self.model
    }

    #[inline(never)]
    fn next_leg(&mut self, _: usize, ended: Ended, x: &mut [N<f64>; STATES]) -> Option<Leg> {
        let next = match ended {
            Ended::Idle => 0,
            Ended::Arrived(_) => self.leg.map_or(0, |leg| leg + 1),
            Ended::Failed { reason, time_s, .. } => {
                self.failure = Some((reason, time_s));
                self.point.legs.len()
            }
        };
        if next == 0 {
            *x = self.start.map(N);
        }
        self.leg = Some(next);
        let leg = self.point.legs.get(next)?;
        let (step_s, caps) = first_step(self.method, leg);
        self.model.set_spin(0, &self.point.stretches[leg.stretch]);
        if let Some(caps) = caps {
            self.model.set_caps(0, &caps);
        }
        Some(Leg { start_s: leg.start_s, end_s: leg.end_s, step_s })
    }

    #[inline(always)]
    fn begin(&mut self, _: &M::Forcing, _: &[N<f64>; STATES], _: &[N<f64>; STATES]) {}

    #[inline(always)]
    fn observe(&mut self, _: &M::Forcing, step: &Step<'_, f64, STATES>) {
        let (end_s, length_s) = (step.end_s.0, step.length_s.0);
        // A step that left the model's range is meaningless, also inside.
        if length_s == 0.0 || !self.model.in_range(step.after) {
            return;
        }
        loop {
            let time_s = self.states.len() as f64 * self.every_s;
            if time_s > end_s + SLACK * length_s {
                return;
            }
            let share = (1.0 - (end_s - time_s) / length_s).clamp(0.0, 1.0);
            self.states.push(step.at(N(share)).map(|x| x.0));
        }
    }

    fn is_stopped(&self) -> bool {
        (self.stop)()
    }
}

#[cfg(test)]
mod tests;

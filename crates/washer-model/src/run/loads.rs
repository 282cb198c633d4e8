//! Loads of stops and of the cabinet's feet, and the speeds of dampers, over lanes.
//!
//! The laws are those of the equations (`nonlinear/elements.rs`), evaluated over dual numbers for
//! their rates; the linear model's are first order in its deviations from equilibrium.

use crate::coordinates::{COORDINATES, STATES, TUB};
use crate::kind::ModelKind;
use crate::lanes::{Constant as _, InLanes as _};
use crate::machine::feet::{FEET, LOAD, turning_n};
use crate::nonlinear::elements::{Elements, TubMotion};
use crate::nonlinear::frame::Tilt;
use crate::point::Point;
use lane_ode::{Dual, Lane, N, Peaks, Sample, TimeAbove};

/// The record of one stop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StopLoad {
    /// Its greatest push (N).
    pub push_n: f64,
    /// How long it is closed (s).
    pub contact_s: f64,
}

/// Least values are found as greatest distances below this (N), farther than any load.
const FAR_N: f64 = 1_048_576.0;

/// Added under the root of the horizontal force (N^2), which has no rate at 0.
const LEAST_SQUARED_N2: f64 = 1e-18;

/// The margin against slipping, after the feet.
const SLIP: usize = FEET;
/// The margin against walking, after that.
const WALK: usize = FEET + 1;

/// Coordinates of the tub and their speeds, in the order of [`TUB`].
struct TubState<T> {
    q: [N<T>; 4],
    u: [N<T>; 4],
}

/// Calls `$use` with the motion of the tub in a state.
macro_rules! with_motion {
    ($state:expr, $motion:ident => $use:expr) => {{
        let TubState { q, u } = $state;
        let tilt = Tilt::new(q[2], q[3]);
        let rate = tilt.motion(u[2], u[3]).rate;
        let $motion = TubMotion {
            tilt: &tilt,
            midpoint: [q[0], q[1]],
            midpoint_velocity: [u[0], u[1]],
            rate: &rate,
        };
        $use
    }};
}

/// Force (N) and moment about O (N m) of the suspension on the cabinet, cabinet axes.
#[inline(always)]
fn on_cabinet<T: Lane>(elements: &Elements<T>, tub: &TubMotion<'_, T>) -> [N<T>; LOAD] {
    let (force, moment) = elements.on_tub(tub);
    let [fx, fy, fz] = tub.tilt.in_cabinet_axes(&force);
    let [mx, my, mz] = tub.tilt.in_cabinet_axes(&moment);
    let [y, z] = tub.midpoint;
    // What is on the tub, turned round; P_T is at (0, y, z).
    [-fx, -fy, -fz, -(mx + (y * fz - z * fy)), -(my + z * fx), -(mz - y * fx)]
}

/// The same as a number, at a state: whole coordinates of the nonlinear model, deviations of the
/// linear one.
pub(crate) fn load_on_cabinet(
    point: &Point,
    model: ModelKind,
    state: &[f64; STATES],
) -> [f64; LOAD] {
    let elements = &point.machine.elements;
    let elements = match model {
        ModelKind::Nonlinear => elements.constant(),
        ModelKind::Linear => elements.with_viscous_friction().constant(),
    };
    let dual = |at_rest: f64, number: f64| match model {
        ModelKind::Nonlinear => N(Dual { value: number, slope: 0.0 }),
        ModelKind::Linear => N(Dual { value: at_rest, slope: number }),
    };
    let tub = TubState {
        q: TUB.map(|q| dual(point.equilibrium[q], state[q])),
        u: TUB.map(|q| dual(0.0, state[COORDINATES + q])),
    };
    let load = with_motion!(&tub, motion => on_cabinet(&elements, &motion));
    load.map(|N(first_order)| first_order.value + first_order.slope)
}

/// The speed along each damper (m/s) by the linear model, at deviations from equilibrium.
pub(crate) fn damper_speeds_m_per_s(point: &Point, deviations: &[f64; STATES]) -> Vec<f64> {
    let elements = point.machine.elements.constant();
    let dual = |value: f64, slope: f64| N(Dual { value, slope });
    let tub = TubState {
        q: TUB.map(|q| dual(point.equilibrium[q], deviations[q])),
        u: TUB.map(|q| dual(0.0, deviations[COORDINATES + q])),
    };
    let speed = |number| with_motion!(&tub, motion => elements.damper_speed(number, &motion));
    (0..elements.dampers.len()).map(|number| speed(number).0.slope).collect()
}

/// First order of something in the tub's deviations from equilibrium.
#[derive(Clone, Copy)]
struct FirstOrder<T> {
    rest: N<T>,
    by_place: [N<T>; 4],
    by_speed: [N<T>; 4],
}

impl<T: Lane> FirstOrder<T> {
    #[inline(always)]
    fn new(zero: N<T>) -> Self {
        Self { rest: zero, by_place: [zero; 4], by_speed: [zero; 4] }
    }

    fn set(&mut self, lane: usize, rest: f64, k: usize, by_place: f64, by_speed: f64) {
        self.rest.0.set(lane, rest);
        self.by_place[k].0.set(lane, by_place);
        self.by_speed[k].0.set(lane, by_speed);
    }

    #[inline(always)]
    fn at(&self, tub: &[Sample<T>; 4]) -> N<Dual<T>> {
        let mut value = self.rest;
        let mut slope = self.rest.lit(0.0);
        for k in 0..4 {
            value += self.by_place[k] * tub[k].value;
            value += self.by_speed[k] * tub[k].slope;
            slope += self.by_place[k] * tub[k].slope;
            slope += self.by_speed[k] * tub[k].curvature;
        }
        N(Dual { value: value.0, slope: slope.0 })
    }
}

/// One of the two models' loads.
enum Laws<T> {
    /// Of the machine's elements, over duals for rates.
    Nonlinear(Elements<Dual<T>>),
    /// Loads on the cabinet; of each stop depth and push; the speed of each damper.
    Linear {
        load: [FirstOrder<T>; LOAD],
        stops: Vec<[FirstOrder<T>; 2]>,
        speeds: Vec<FirstOrder<T>>,
    },
}

impl<T: Lane> Laws<T> {
    /// Puts a point into one lane.
    fn set_point(&mut self, lane: usize, point: &Point) {
        match self {
            Self::Nonlinear(elements) => elements.set_lane(lane, &point.machine.elements),
            Self::Linear { load, stops, speeds } => {
                let elements = point.machine.elements.with_viscous_friction().constant();
                let rest = TUB.map(|q| point.equilibrium[q]);
                for k in 0..4 {
                    let of_place = |by: f64| {
                        let q = core::array::from_fn(|i| {
                            N(Dual { value: rest[i], slope: if i == k { by } else { 0.0 } })
                        });
                        let u = core::array::from_fn(|i| {
                            let by = if i == k { 1.0 - by } else { 0.0 };
                            N(Dual { value: 0.0, slope: by })
                        });
                        TubState { q, u }
                    };
                    let [place, speed] = [of_place(1.0), of_place(0.0)];
                    let by_place = with_motion!(&place, tub => on_cabinet(&elements, &tub));
                    let by_speed = with_motion!(&speed, tub => on_cabinet(&elements, &tub));
                    for (i, load) in load.iter_mut().enumerate() {
                        let (place, speed) = (by_place[i].0, by_speed[i].0);
                        load.set(lane, place.value, k, place.slope, speed.slope);
                    }
                    for (number, stop) in stops.iter_mut().enumerate() {
                        let by_place = with_motion!(&place, tub => elements.stop(number, &tub));
                        let by_speed = with_motion!(&speed, tub => elements.stop(number, &tub));
                        for (i, stop) in stop.iter_mut().enumerate() {
                            let (place, speed) = (by_place[i].0, by_speed[i].0);
                            stop.set(lane, place.value, k, place.slope, speed.slope);
                        }
                    }
                    for (number, first_order) in speeds.iter_mut().enumerate() {
                        let of_place =
                            with_motion!(&place, tub => elements.damper_speed(number, &tub)).0;
                        let of_speed =
                            with_motion!(&speed, tub => elements.damper_speed(number, &tub)).0;
                        let rest = of_place.value;
                        first_order.set(lane, rest, k, of_place.slope, of_speed.slope);
                    }
                }
            }
        }
    }
}

/// What has been seen of one stop.
struct SeenStop<T> {
    push: Peaks<T, 1>,
    /// Time with a depth above zero.
    contact: TimeAbove<T>,
}

/// The loads so far, over lanes.
///
/// They have no second derivative here. So the motion between the ends of a long step is
/// interpolated first, and the loads evaluated at a few places of it.
pub(crate) struct Loads<T> {
    laws: Laws<T>,
    /// How far the loads of the feet are below [`FAR_N`], and then the two margins.
    below: Peaks<T, { FEET + 2 }>,
    own: [N<T>; FEET],
    shares: [[N<T>; LOAD]; FEET],
    places: [[N<T>; 2]; FEET],
    friction: N<T>,
    weight: N<T>,
    feet: usize,
    stops: Vec<SeenStop<T>>,
    /// The speed of each damper; none unless asked for.
    speeds: Vec<Peaks<T, 1>>,
    /// Coordinates, speeds and accelerations of [`TUB`] where the next step begins.
    last: [Sample<T>; 4],
    /// Parts that a step is cut into.
    parts: u32,
}

impl<T: Lane> Loads<T> {
    /// Nothing seen yet, with the same point in every lane; the speeds of dampers only
    /// `with_speeds`.
    #[inline(always)]
    pub(crate) fn new(
        zero: N<T>,
        model: ModelKind,
        point: &Point,
        parts: u32,
        with_speeds: bool,
    ) -> Self {
        let elements = &point.machine.elements;
        let number = elements.stops.len();
        let dampers = if with_speeds { elements.dampers.len() } else { 0 };
        let laws = match model {
            ModelKind::Nonlinear => Laws::Nonlinear(Elements::splat(zero.constant(), elements)),
            ModelKind::Linear => {
                let none = FirstOrder::new(zero);
                Laws::Linear {
                    load: [none; LOAD],
                    stops: vec![[none; 2]; number],
                    speeds: vec![none; dampers],
                }
            }
        };
        let mut stops = Vec::with_capacity(number);
        for _ in 0..number {
            stops.push(SeenStop { push: Peaks::new(zero), contact: TimeAbove::new(zero) });
        }
        let mut speeds = Vec::with_capacity(dampers);
        for _ in 0..dampers {
            speeds.push(Peaks::new(zero));
        }
        let mut loads = Self {
            laws,
            below: Peaks::new(zero),
            own: [zero; FEET],
            shares: [[zero; LOAD]; FEET],
            places: [[zero; 2]; FEET],
            friction: zero,
            weight: zero,
            feet: 0,
            stops,
            speeds,
            last: [Sample::still(zero, zero); 4],
            parts,
        };
        for lane in 0..T::LANES {
            loads.set_point(lane, point);
        }
        loads
    }

    /// Begins a point's trajectory in one lane.
    pub(crate) fn set_point(&mut self, lane: usize, point: &Point) {
        self.laws.set_point(lane, point);
        self.below.reset(lane);
        for stop in &mut self.stops {
            stop.push.reset(lane);
            stop.contact.reset(lane);
        }
        for speed in &mut self.speeds {
            speed.reset(lane);
        }
        if let Some(feet) = &point.feet {
            self.feet = feet.count;
            for k in 0..FEET {
                self.own[k].0.set(lane, feet.own_n[k]);
                for i in 0..LOAD {
                    self.shares[k][i].0.set(lane, feet.shares[k][i]);
                }
                for i in 0..2 {
                    self.places[k][i].0.set(lane, feet.places_m[k][i]);
                }
            }
            self.friction.0.set(lane, feet.friction);
            self.weight.0.set(lane, feet.weight_n);
        }
    }

    /// The least load of each foot of one lane (N); empty without feet.
    pub(crate) fn foot_loads_n(&self, lane: usize) -> Vec<f64> {
        self.below.lane(lane)[..self.feet].iter().map(|below| FAR_N - below).collect()
    }

    /// The least margin against slipping of one lane (N); none without feet.
    pub(crate) fn slip_margin_n(&self, lane: usize) -> Option<f64> {
        (self.feet > 0).then(|| FAR_N - self.below.lane(lane)[SLIP])
    }

    /// The least margin against walking of one lane (N); none without feet.
    pub(crate) fn walk_margin_n(&self, lane: usize) -> Option<f64> {
        (self.feet > 0).then(|| FAR_N - self.below.lane(lane)[WALK])
    }

    /// What one lane has seen of each stop; empty without stops.
    pub(crate) fn stops(&self, lane: usize) -> Vec<StopLoad> {
        let of_stop = |stop: &SeenStop<T>| {
            let [push_n] = stop.push.lane(lane);
            StopLoad { push_n, contact_s: stop.contact.lane(lane) }
        };
        self.stops.iter().map(of_stop).collect()
    }

    /// The greatest speed of each damper of one lane (m/s); empty unless asked for.
    pub(crate) fn damper_speeds_m_per_s(&self, lane: usize) -> Vec<f64> {
        let of_damper = |speed: &Peaks<T, 1>| {
            let [speed_m_per_s] = speed.lane(lane);
            speed_m_per_s
        };
        self.speeds.iter().map(of_damper).collect()
    }

    /// A state whose derivative is `dx`: at the end of a step, of which end and length (s) are
    /// given, or where a leg begins. `counts` says in which lanes it counts.
    #[inline(always)]
    pub(crate) fn see(
        &mut self,
        step: Option<(N<T>, N<T>)>,
        x: &[N<T>; STATES],
        dx: &[N<T>; STATES],
        counts: T::Mask,
    ) {
        let mut now = self.last;
        for (sample, q) in now.iter_mut().zip(TUB) {
            *sample = Sample { value: x[q], slope: dx[q], curvature: dx[COORDINATES + q] };
        }
        let parts = if step.is_some() { self.parts } else { 1 };
        let share = 1.0 / f64::from(parts);
        // One loop, for one copy of the laws' code.
        for part in 1..=parts {
            let mut tub = now;
            let mut step_s = None;
            if let Some((_, length_s)) = step {
                step_s = Some((share * length_s).v());
                if part < parts {
                    for k in 0..4 {
                        let at = share * f64::from(part);
                        tub[k] = Sample::between(&self.last[k], &now[k], length_s, at);
                    }
                }
            }
            self.see_instant(step_s, &tub, counts);
        }
        self.last = now;
    }

    #[inline(always)]
    fn see_instant(&mut self, step_s: Option<N<T>>, tub: &[Sample<T>; 4], counts: T::Mask) {
        let mut q = [tub[0].value.constant(); 4];
        let mut u = q;
        for k in 0..4 {
            q[k] = N(Dual { value: tub[k].value.0, slope: tub[k].slope.0 });
            u[k] = N(Dual { value: tub[k].slope.0, slope: tub[k].curvature.0 });
        }
        let state = TubState { q, u };
        if self.feet > 0 {
            let mut load = [q[0]; LOAD];
            match &self.laws {
                Laws::Nonlinear(elements) => {
                    load = with_motion!(&state, motion => on_cabinet(elements, &motion));
                }
                Laws::Linear { load: first_order, .. } => {
                    for i in 0..LOAD {
                        load[i] = first_order[i].at(tub);
                    }
                }
            }
            self.see_feet(step_s, &load, counts);
        }
        for k in 0..self.stops.len() {
            let [depth, push] = match &self.laws {
                Laws::Nonlinear(elements) => {
                    with_motion!(&state, motion => elements.stop(k, &motion))
                }
                Laws::Linear { stops, .. } => [stops[k][0].at(tub), stops[k][1].at(tub)],
            };
            self.see_stop(k, step_s, &sample(depth), &sample(push), counts);
        }
        for k in 0..self.speeds.len() {
            let speed = match &self.laws {
                Laws::Nonlinear(elements) => {
                    with_motion!(&state, motion => elements.damper_speed(k, &motion))
                }
                Laws::Linear { speeds, .. } => speeds[k].at(tub),
            };
            match step_s {
                Some(step_s) => self.speeds[k].advance_by_slopes(step_s, &[sample(speed)], counts),
                None => self.speeds[k].begin(&[sample(speed)], counts),
            }
        }
    }

    #[inline(always)]
    fn see_feet(&mut self, step_s: Option<N<T>>, load: &[N<Dual<T>>; LOAD], counts: T::Mask) {
        let far = load[0].lit(FAR_N);
        let mut below = [sample(far); FEET + 2];
        let (mut loads, mut places) = ([far; FEET], [[far; 2]; FEET]);
        for k in 0..FEET {
            let mut carried = self.own[k].constant();
            for i in 0..LOAD {
                carried += self.shares[k][i].constant() * load[i];
            }
            below[k] = sample(far - carried);
            loads[k] = carried;
            for i in 0..2 {
                places[k][i] = self.places[k][i].constant();
            }
        }
        let squared = load[0] * load[0] + load[2] * load[2] + load[0].lit(LEAST_SQUARED_N2);
        let margin = self.friction.constant() * (self.weight.constant() - load[1]);
        let margin = margin - squared.sqrt();
        below[SLIP] = sample(far - margin);
        below[WALK] = sample(far - (margin - turning_n(&places, &loads, load)));
        match step_s {
            Some(step_s) => self.below.advance_by_slopes(step_s, &below, counts),
            None => self.below.begin(&below, counts),
        }
    }

    #[inline(always)]
    fn see_stop(
        &mut self,
        k: usize,
        step_s: Option<N<T>>,
        depth: &Sample<T>,
        push: &Sample<T>,
        counts: T::Mask,
    ) {
        let stop = &mut self.stops[k];
        match step_s {
            Some(step_s) => {
                stop.push.advance_by_slopes(step_s, &[*push], counts);
                stop.contact.advance_by_slopes(step_s, depth, counts);
            }
            None => {
                stop.push.begin(&[*push], counts);
                stop.contact.begin(depth);
            }
        }
    }
}

/// A value with its rate.
#[inline(always)]
fn sample<T: Lane>(dual: N<Dual<T>>) -> Sample<T> {
    let (value, slope) = (N(dual.0.value), N(dual.0.slope));
    Sample { value, slope, curvature: value.lit(0.0) }
}

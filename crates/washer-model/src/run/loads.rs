//! Loads of the cabinet, of its feet and of stops, and the speeds of dampers, over lanes.
//!
//! The laws are those of the equations (`nonlinear/elements.rs`), evaluated over dual numbers for
//! their rates; the linear model's are first order in its deviations from equilibrium.

use super::suspension::{deviating, dual, forces, on_cabinet};
use crate::coordinates::{STATES, TUB};
use crate::lanes::{Constant as _, InLanes as _};
use crate::machine::feet::{FEET, LOAD, LoadDistribution, turning_force_n};
use crate::nonlinear::elements::{Elements, TubMotion};
use crate::nonlinear::frame::{Vec3, dot};
use crate::run::model::tub_samples;
use crate::{COORDINATES, ModelKind, Point};
use lane_ode::{Dual, Lane, N, Peaks, Sample, TimeAbove};

sweep_parameter::named! {
    /// A number that can be recorded of a trajectory, within the window.
    pub enum Gauge {
        /// Time with a gap below zero (s).
        ClashTime = "clash_time",
        /// The greatest magnitude of the sum of all forces of springs and dampers on the cabinet
        /// (N); at rest it is the weight.
        CabinetForce = "cabinet_force",
        /// The greatest push of each stop (N).
        StopForce = "stop_force",
        /// How long each stop is closed (s).
        StopContact = "stop_contact",
        /// The least vertical load of each foot (N), below zero where it would lift; none if the
        /// machine has no cabinet.
        FootLoad = "foot_load",
        /// The least margin against slipping (N): friction on all feet together less the
        /// horizontal force; below zero the cabinet slips. None if the machine has no cabinet.
        SlipMargin = "slip_margin",
        /// The least margin against walking (N): that against slipping less what turning takes of
        /// it. None if the machine has no cabinet.
        WalkMargin = "walk_margin",
        /// The greatest speed of each damper along it (m/s).
        DamperSpeed = "damper_speed",
    }
}

/// Which gauges are read.
pub(crate) type Gauges = [bool; Gauge::ALL.len()];

/// Least values are found as greatest distances below this (N), farther than any load.
const FAR_N: f64 = 1_048_576.0;

/// Added under the root of the horizontal force (N^2), which has no rate at 0.
const LEAST_SQUARED_N2: f64 = 1e-18;

/// The margin against slipping, after the feet.
const SLIP: usize = FEET;
/// The margin against walking, after that.
const WALK: usize = FEET + 1;

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

/// What is recorded of a machine.
#[derive(Clone, Copy)]
struct Recorded {
    /// The force on the cabinet.
    force: bool,
    /// Loads of the feet, and margins.
    feet: bool,
    stops: usize,
    dampers: usize,
}

impl Recorded {
    /// How many numbers it is taken from: the load on the cabinet, depth and push of each stop, the
    /// speed of each damper.
    fn numbers(self) -> usize {
        LOAD + 2 * self.stops + self.dampers
    }

    /// These numbers by the elements' laws; gives the force on the tub.
    #[inline(always)]
    fn evaluate<T: Lane>(
        self,
        elements: &Elements<T>,
        tub: &TubMotion<T>,
        numbers: &mut [N<T>],
    ) -> Vec3<T> {
        let nothing = [tub.midpoint[0].lit(0.0); 3];
        let mut on_tub = (nothing, nothing);
        if self.force || self.feet {
            on_tub = elements.load_on_tub(tub);
        }
        if self.feet {
            numbers[..LOAD].copy_from_slice(&on_cabinet(tub, &on_tub));
        }
        for k in 0..self.stops {
            [numbers[LOAD + 2 * k], numbers[LOAD + 2 * k + 1]] = elements.stop(k, tub);
        }
        for k in 0..self.dampers {
            numbers[LOAD + 2 * self.stops + k] = elements.damper_speed(k, tub);
        }
        on_tub.0
    }
}

/// One of the two models' laws.
enum Laws<T> {
    /// Of the machine's elements, over duals for rates.
    Nonlinear(Elements<Dual<T>>),
    /// Of the force on the cabinet, and of the recorded numbers.
    Linear { force: [FirstOrder<T>; 3], numbers: Vec<FirstOrder<T>> },
}

impl<T: Lane> Laws<T> {
    /// Puts a point into one lane.
    fn set_point(&mut self, lane: usize, point: &Point, recorded: Recorded) {
        let (force, numbers) = match self {
            Self::Nonlinear(elements) => return elements.set_lane(lane, &point.machine.elements),
            Self::Linear { force, numbers } => (force, numbers),
        };
        let elements = point.machine.elements.with_viscous_friction().constant();
        let unit = |of: usize| core::array::from_fn(|i| f64::from(u8::from(i == of)));
        let evaluated = |of: usize| {
            let mut numbers = vec![dual(0.0, 0.0); recorded.numbers()];
            recorded.evaluate(&elements, &deviating(point, &unit(of)), &mut numbers);
            numbers
        };
        let force_at = |state: &[f64; STATES]| forces(point, ModelKind::Linear, state).cabinet_n;
        for k in 0..4 {
            let [place, speed] = [TUB[k], COORDINATES + TUB[k]];
            let by = evaluated(place).into_iter().zip(evaluated(speed));
            for (number, (N(by_place), N(by_speed))) in numbers.iter_mut().zip(by) {
                number.set(lane, by_place.value, k, by_place.slope, by_speed.slope);
            }
            if recorded.force {
                let rest = force_at(&[0.0; STATES]);
                let [by_place, by_speed] = [place, speed].map(|of| force_at(&unit(of)));
                for i in 0..3 {
                    force[i].set(lane, rest[i], k, by_place[i] - rest[i], by_speed[i] - rest[i]);
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
    recorded: Recorded,
    laws: Laws<T>,
    /// Those of [`Recorded`] at the present instant.
    numbers: Vec<N<Dual<T>>>,
    /// The square of the force on the cabinet.
    force_squared: Peaks<T, 1>,
    /// How far the loads of the feet are below [`FAR_N`], and then the two margins.
    below: Peaks<T, { FEET + 2 }>,
    spread: Option<LoadDistribution<T>>,
    stops: Vec<SeenStop<T>>,
    /// The speed of each damper; none unless asked for.
    speeds: Vec<Peaks<T, 1>>,
    /// Coordinates, speeds and accelerations of [`TUB`] where the next step begins.
    last: [Sample<T>; 4],
    /// Parts that a step is cut into.
    parts: u32,
}

impl<T: Lane> Loads<T> {
    /// Nothing seen yet, with the same point in every lane; `None` if none of it is wanted.
    #[inline(always)]
    pub(crate) fn new(
        zero: N<T>,
        wanted: Gauges,
        model: ModelKind,
        point: &Point,
        parts: u32,
    ) -> Option<Self> {
        // Those from the cabinet's force on.
        let [_, force, of_elements @ ..] = wanted;
        let with_elements = of_elements != [false; Gauge::ALL.len() - 2];
        if !with_elements && !force {
            return None;
        }
        let elements = &point.machine.elements;
        let with_dampers = wanted[Gauge::DamperSpeed as usize];
        let recorded = Recorded {
            force,
            feet: with_elements && point.feet.is_some(),
            stops: if with_elements { elements.stops.len() } else { 0 },
            dampers: if with_dampers { elements.dampers.len() } else { 0 },
        };
        // No closures: they would be compiled without the instruction set.
        let laws = match model {
            ModelKind::Nonlinear => Laws::Nonlinear(Elements::splat(zero.constant(), elements)),
            ModelKind::Linear => {
                let none = FirstOrder::new(zero);
                Laws::Linear { force: [none; 3], numbers: vec![none; recorded.numbers()] }
            }
        };
        let mut stops = Vec::with_capacity(recorded.stops);
        for _ in 0..recorded.stops {
            stops.push(SeenStop { push: Peaks::new(zero), contact: TimeAbove::new(zero) });
        }
        let spread = match &point.feet {
            Some(feet) if recorded.feet => Some(LoadDistribution::splat(zero, &feet.spread)),
            _ => None,
        };
        let mut loads = Self {
            recorded,
            laws,
            numbers: vec![zero.constant(); recorded.numbers()],
            force_squared: Peaks::new(zero),
            below: Peaks::new(zero),
            spread,
            stops,
            speeds: vec![Peaks::new(zero); recorded.dampers],
            last: [Sample::still(zero, zero); 4],
            parts,
        };
        for lane in 0..T::LANES {
            loads.set_point(lane, point);
        }
        Some(loads)
    }

    /// Begins a point's trajectory in one lane.
    pub(crate) fn set_point(&mut self, lane: usize, point: &Point) {
        self.laws.set_point(lane, point, self.recorded);
        self.force_squared.reset(lane);
        self.below.reset(lane);
        for stop in &mut self.stops {
            stop.push.reset(lane);
            stop.contact.reset(lane);
        }
        for speed in &mut self.speeds {
            speed.reset(lane);
        }
        if let (Some(spread), Some(feet)) = (&mut self.spread, &point.feet) {
            spread.set_lane(lane, &feet.spread);
        }
    }

    /// What a gauge shows of one lane, that of a point: a number of each part, or the only one.
    pub(crate) fn of(&self, gauge: Gauge, lane: usize, point: &Point) -> Vec<f64> {
        let greatest = |peaks: &Peaks<T, 1>| peaks.lane(lane)[0];
        let least = |of: core::ops::Range<usize>| {
            let below_n = &self.below.lane(lane)[if self.spread.is_some() { of } else { 0..0 }];
            below_n.iter().map(|below_n| FAR_N - below_n).collect()
        };
        match gauge {
            Gauge::ClashTime => Vec::new(),
            Gauge::CabinetForce => vec![greatest(&self.force_squared).sqrt()],
            Gauge::StopForce => self.stops.iter().map(|stop| greatest(&stop.push)).collect(),
            Gauge::StopContact => self.stops.iter().map(|stop| stop.contact.lane(lane)).collect(),
            Gauge::FootLoad => least(0..point.feet.as_ref().map_or(0, |feet| feet.count)),
            Gauge::SlipMargin => least(SLIP..WALK),
            Gauge::WalkMargin => least(WALK..WALK + 1),
            Gauge::DamperSpeed => self.speeds.iter().map(greatest).collect(),
        }
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
        let now = tub_samples(x, dx);
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
        let Self { recorded, laws, numbers, .. } = self;
        let zero = tub[0].value.lit(0.0);
        let mut squared = Sample::still(zero, zero);
        match laws {
            Laws::Nonlinear(elements) => {
                let mut q = [tub[0].value.constant(); 4];
                let mut u = q;
                for k in 0..4 {
                    q[k] = N(Dual { value: tub[k].value.0, slope: tub[k].slope.0 });
                    u[k] = N(Dual { value: tub[k].slope.0, slope: tub[k].curvature.0 });
                }
                // On the tub and in its axes: as large as on the cabinet.
                let force = recorded.evaluate(elements, &TubMotion::new(&q, &u), numbers);
                squared = sample(dot(&force, &force));
            }
            Laws::Linear { force, numbers: laws } => {
                for component in force {
                    let N(force) = component.at(tub);
                    let (force, rate) = (N(force.value), N(force.slope));
                    squared.value += force * force;
                    squared.slope += (2.0 * force).v() * rate;
                }
                for (number, law) in numbers.iter_mut().zip(laws) {
                    *number = law.at(tub);
                }
            }
        }
        if recorded.force {
            see(&mut self.force_squared, step_s, &[squared], counts);
        }
        if let Some(spread) = &self.spread {
            see(&mut self.below, step_s, &below(spread, &self.numbers), counts);
        }
        let (of_stops, of_dampers) = self.numbers[LOAD..].split_at(2 * self.stops.len());
        for (stop, of_stop) in self.stops.iter_mut().zip(of_stops.chunks(2)) {
            let depth = sample(of_stop[0]);
            see(&mut stop.push, step_s, &[sample(of_stop[1])], counts);
            match step_s {
                Some(step_s) => stop.contact.advance_by_slopes(step_s, &depth, counts),
                None => stop.contact.begin(&depth),
            }
        }
        for (peaks, speed) in self.speeds.iter_mut().zip(of_dampers) {
            see(peaks, step_s, &[sample(*speed)], counts);
        }
    }
}

/// Of each foot how far its load is below [`FAR_N`], then of both margins, by the load on the
/// cabinet.
#[inline(always)]
fn below<T: Lane>(spread: &LoadDistribution<T>, load: &[N<Dual<T>>]) -> [Sample<T>; FEET + 2] {
    let spread = spread.constant();
    let far = load[0].lit(FAR_N);
    let mut cabinet = [far; LOAD];
    cabinet.copy_from_slice(&load[..LOAD]);
    let load = &cabinet;
    let mut below = [sample(far); FEET + 2];
    let mut loads = spread.own;
    for k in 0..FEET {
        for i in 0..LOAD {
            loads[k] += spread.shares[k][i] * load[i];
        }
        below[k] = sample(far - loads[k]);
    }
    let squared = load[0] * load[0] + load[2] * load[2] + load[0].lit(LEAST_SQUARED_N2);
    let margin = spread.friction * (spread.weight - load[1]) - squared.sqrt();
    below[SLIP] = sample(far - margin);
    below[WALK] = sample(far - (margin - turning_force_n(&spread.places, &loads, load)));
    below
}

/// Shows numbers to their peaks: after a step of a length (s), or where a leg begins.
#[inline(always)]
fn see<T: Lane, const M: usize>(
    peaks: &mut Peaks<T, M>,
    step_s: Option<N<T>>,
    samples: &[Sample<T>; M],
    counts: T::Mask,
) {
    match step_s {
        Some(step_s) => peaks.advance_by_slopes(step_s, samples, counts),
        None => peaks.begin(samples, counts),
    }
}

/// A value with its rate.
#[inline(always)]
fn sample<T: Lane>(dual: N<Dual<T>>) -> Sample<T> {
    let (value, slope) = (N(dual.0.value), N(dual.0.slope));
    Sample { value, slope, curvature: value.lit(0.0) }
}

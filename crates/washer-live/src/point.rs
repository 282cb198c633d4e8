//! One point, ready to run, and its runs by one rung.

use lane_ode::{Failure, Simd};
use washer_model::{
    Channel, Machine, ModelKind, Point, Record, Spin, Start, Target, Timing, Wanted, history,
    prepare, simulate_with,
};

use crate::setup::{Rung, Setup};

/// Why a point has no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoPoint {
    /// The machine cannot be: a number is out of its range.
    Impossible,
    /// The machine has no static equilibrium.
    NoEquilibrium,
}

/// What both models do at a point, the nonlinear one first.
pub type Peaks = [Record; 2];

/// One model's motion at even instants.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Why and when (s) it failed, if it did; there are no instants from there on.
    pub failure: Option<(Failure, f64)>,
    /// Deviations from equilibrium in the order of [`Channel::ALL`] (m, rad).
    pub channels: Vec<[f64; Channel::ALL.len()]>,
    /// Gap between drum and tub (m).
    pub gaps_m: Vec<f64>,
}

/// The machine, spin and window of a point: the setup's with these values of its sliders.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scenario {
    machine: Machine,
    pub(crate) spin: Spin,
    window_s: [f64; 2],
}

impl Scenario {
    /// Missing values are the setup's.
    pub(crate) fn new(setup: &Setup, values: &[f64]) -> Result<Self, NoPoint> {
        let Setup { machine, spin, window_s, .. } = setup.clone();
        let mut scenario = Self { machine, spin, window_s };
        for (parameter, &value) in setup.sliders.parameters.iter().zip(values) {
            if !parameter.range().contains(value) {
                return Err(NoPoint::Impossible);
            }
            match parameter.target() {
                Target::Window(edge) => scenario.window_s[edge] = value,
                _ => parameter.set(&mut scenario.machine, &mut scenario.spin, value),
            }
        }
        let [from_s, to_s] = scenario.window_s;
        let window_is_sound = from_s < to_s && to_s <= setup.end_s;
        let violations = [scenario.machine.violations(), scenario.spin.violations()].concat();
        if !window_is_sound || !violations.is_empty() {
            return Err(NoPoint::Impossible);
        }
        Ok(scenario)
    }

    fn timing(&self, setup: &Setup) -> Timing {
        let Setup { end_s, checkpoints, .. } = *setup;
        Timing { end_s, window_s: self.window_s, checkpoints }
    }
}

/// The rungs of both models that hold at these values.
pub(crate) fn ladders<'a>(setup: &'a Setup, values: &[f64]) -> &'a [Vec<Rung>; 2] {
    let further = setup.sliders.parameters.iter().zip(values).skip(setup.sliders.axes);
    let has_moved = |(parameter, value): (&washer_model::Parameter, &f64)| {
        parameter.get(&setup.machine, &setup.spin) != Some(*value)
    };
    if further.into_iter().any(has_moved) { &setup.wide_ladders } else { &setup.ladders }
}

/// A point made ready.
///
/// # Errors
/// [`NoPoint`].
pub(crate) fn ready(setup: &Setup, values: &[f64]) -> Result<(Scenario, Point), NoPoint> {
    let scenario = Scenario::new(setup, values)?;
    let machines = [(scenario.machine.clone(), scenario.spin.clone())];
    let mut points = prepare(Simd::Scalar, &machines, &scenario.timing(setup));
    match points.pop() {
        Some(Ok(point)) => Ok((scenario, point)),
        _ => Err(NoPoint::NoEquilibrium),
    }
}

/// Both models at points by the quick rung, in lanes. Nothing is compared with these runs.
#[must_use]
pub fn peaks(setup: &Setup, points: &[&[f64]]) -> Vec<Result<Peaks, NoPoint>> {
    let ready: Vec<_> = points.iter().map(|values| self::ready(setup, values)).collect();
    let mut found: Vec<Result<Peaks, NoPoint>> = Vec::with_capacity(points.len());
    // Runs of the same rungs go through the lanes together.
    let is_alike = |a: &usize, b: &usize| {
        core::ptr::eq(ladders(setup, points[*a]), ladders(setup, points[*b]))
    };
    let places: Vec<usize> = (0..points.len()).collect();
    for alike in places.chunk_by(is_alike) {
        let ladders = ladders(setup, points[alike[0]]);
        let runs: Vec<&Point> =
            alike.iter().filter_map(|&k| ready[k].as_ref().ok()).map(|(_, point)| point).collect();
        let [nonlinear, linear] = [ModelKind::Nonlinear, ModelKind::Linear].map(|model| {
            let method = quick(&ladders[model as usize]).method;
            simulate_with(Simd::best(), model, &method, &runs, Wanted::default()).0
        });
        let mut pairs = nonlinear.into_iter().zip(linear);
        for &k in alike {
            found.push(match &ready[k] {
                Ok(_) => pairs.next().map(|(a, b)| [a, b]).ok_or(NoPoint::NoEquilibrium),
                Err(why) => Err(*why),
            });
        }
    }
    found
}

/// The rung of quick answers: the lowest that a row may hold, because the one below only shows its
/// error. Where there is nothing but plain RK4, its longest step.
fn quick(rungs: &[Rung]) -> &Rung {
    match rungs.get(1) {
        Some(second) if second.is_capped => second,
        _ => &rungs[0],
    }
}

/// The motion of one model at a point by a rung of its ladder, or by the quick one, every `every_s`
/// from 0 to the end.
///
/// # Errors
/// [`NoPoint`].
pub fn motion(
    setup: &Setup,
    values: &[f64],
    model: ModelKind,
    rung: Option<usize>,
    every_s: f64,
) -> Result<Motion, NoPoint> {
    let (_, point) = ready(setup, values)?;
    let rungs = &ladders(setup, values)[model as usize];
    let rung = rung.and_then(|rung| rungs.get(rung)).unwrap_or(quick(rungs));
    let history = history(model, &rung.method, &point, &Start::default(), every_s);
    let instants = (0..history.len()).filter_map(|k| history.instant(k));
    let (channels, gaps_m) = instants.map(|instant| (instant.channels, instant.gap_m)).unzip();
    Ok(Motion { failure: history.failure, channels, gaps_m })
}

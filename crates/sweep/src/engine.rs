//! The engine: a range of grid points through both models, in lanes.

mod fast;

pub use fast::Settled;
pub(crate) use fast::reference_step_s;

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;

use lane_ode::{Failure, Simd, Tolerance};
use serde_json::Value;
use washer_model::{Extra, Method, ModelKind, Point, Record, Timing, Wanted, prepare, simulate_with};

use crate::measures::{Criterion, Metric};
use crate::outcome::{Outcome, Status, Trajectory};
use crate::plan::{Integrator, Plan, Scenario};
use crate::run::{Engine, Watch};

/// Points that go through the lanes together before progress is told and the stop flag is looked at.
pub(crate) const GROUP: u64 = 64;

/// Steps that one leg of an adaptive trajectory may take.
const MAX_ADAPTIVE_STEPS: u64 = 100_000_000;

/// Why there is no engine for a plan.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EngineError {
    /// `SWEEP_SIMD` names nothing this machine has.
    #[error("SWEEP_SIMD={0}: expected one that this machine has: {1}")]
    Simd(String, String),
}

/// Both models over a plan's points.
pub struct ModelEngine<'a> {
    plan: &'a Plan,
    simd: Simd,
    scheme: Scheme,
    timing: Timing,
    wanted: Wanted,
}

/// How trajectories are integrated.
enum Scheme {
    /// By one method.
    Direct(Method),
    /// By the fast method and what makes up for its error.
    Fast { accuracy: f64, settled: OnceLock<Settled> },
}

/// The instruction set that `SWEEP_SIMD` asks for, else the best.
///
/// # Errors
/// A name that is not one of this machine's.
pub fn simd_from_environment() -> Result<Simd, EngineError> {
    let Ok(name) = std::env::var("SWEEP_SIMD") else { return Ok(Simd::best()) };
    let available = || Simd::ALL.into_iter().filter(|simd| simd.is_available());
    available().find(|simd| simd.name() == name).ok_or_else(|| {
        let names: Vec<_> = available().map(Simd::name).collect();
        EngineError::Simd(name, names.join(", "))
    })
}

/// Dormand-Prince with a grid file's tolerances.
pub(crate) fn dopri5(rtol: f64, atol: f64) -> Method {
    Method::Dopri5(Tolerance { relative: rtol, absolute: atol, max_steps: MAX_ADAPTIVE_STEPS })
}

/// The stiff method with a grid file's tolerances.
pub(crate) fn rodas5p(rtol: f64, atol: f64) -> Method {
    Method::Rodas5p(Tolerance { relative: rtol, absolute: atol, max_steps: MAX_ADAPTIVE_STEPS })
}

impl<'a> ModelEngine<'a> {
    /// An engine for a plan, on the best instruction set or the one asked for.
    ///
    /// # Errors
    /// A method or an instruction set that is not there.
    pub fn new(plan: &'a Plan) -> Result<Self, EngineError> {
        let scheme = match plan.integrator {
            Integrator::Rk4 { step_s } => Scheme::Direct(Method::Rk4 { step_s }),
            Integrator::Dopri5 { rtol, atol } => Scheme::Direct(dopri5(rtol, atol)),
            Integrator::Rodas5p { rtol, atol } => Scheme::Direct(rodas5p(rtol, atol)),
            Integrator::Rk4MassScaled { accuracy } => Scheme::Fast { accuracy, settled: OnceLock::new() },
        };
        let timing = Timing { end_s: plan.end_s, window_s: plan.window_s };
        let wanted = plan.measures.wanted();
        Ok(Self { plan, simd: simd_from_environment()?, scheme, timing, wanted })
    }

    /// Takes over what the fast method works with from another engine; too late once it has been asked for.
    pub fn assume(&self, known: Settled) {
        if let Scheme::Fast { settled, .. } = &self.scheme {
            settled.get_or_init(|| known);
        }
    }

    /// What the fast method works with, if that is the plan's: as settled, or else as the rule says.
    #[must_use]
    pub fn settled(&self) -> Option<&Settled> {
        match &self.scheme {
            Scheme::Direct(_) => None,
            Scheme::Fast { accuracy, settled } => Some(settled.get_or_init(|| self.unchecked(*accuracy))),
        }
    }

    /// One outcome per point given by the values of its axes, on the grid or between its points; `point` of an outcome
    /// is the position among them.
    #[must_use]
    pub fn evaluate_at(&self, axis_values: &[Vec<f64>]) -> Vec<Outcome> {
        // Positions in a slice fit both.
        self.group(0..axis_values.len() as u64, &|point| self.plan.scenario_at(&axis_values[point as usize]))
    }

    fn group(&self, points: Range<u64>, scenario: &dyn Fn(u64) -> Scenario) -> Vec<Outcome> {
        together_or_alone(points, &|points| self.evaluate_together(points, scenario))
    }

    fn evaluate_together(&self, points: Range<u64>, scenario: &dyn Fn(u64) -> Scenario) -> Vec<Outcome> {
        let points: Vec<u64> = points.collect();
        let prepared = self.prepare(&points, scenario);
        let mut outcomes = match &self.scheme {
            Scheme::Direct(method) => self.all(&prepared, method, &points),
            Scheme::Fast { accuracy, settled } => {
                let settled = settled.get_or_init(|| self.unchecked(*accuracy));
                self.certain(*accuracy, settled, &prepared, &points)
            }
        };
        outcomes.iter_mut().for_each(Outcome::forget_turns);
        outcomes
    }

    /// Points made ready, those of one window together; `None` where there is no equilibrium.
    fn prepare(&self, points: &[u64], scenario: &dyn Fn(u64) -> Scenario) -> Vec<Option<Point>> {
        let scenarios: Vec<Scenario> = points.iter().map(|&point| scenario(point)).collect();
        let mut prepared = Vec::with_capacity(scenarios.len());
        for alike in scenarios.chunk_by(|a, b| a.window_s == b.window_s) {
            let machines: Vec<_> =
                alike.iter().map(|scenario| (scenario.machine.clone(), scenario.spin.clone())).collect();
            let timing = Timing { window_s: alike[0].window_s, ..self.timing };
            prepared.extend(prepare(self.simd, &machines, &timing).into_iter().map(Result::ok));
        }
        prepared
    }

    /// Both models at every point, by one method.
    fn all(&self, prepared: &[Option<Point>], method: &Method, points: &[u64]) -> Vec<Outcome> {
        let ready: Vec<&Point> = prepared.iter().flatten().collect();
        let (nonlinear, linear) = self.both(&ready, method);
        let (mut nonlinear, mut linear) = (nonlinear.into_iter(), linear.into_iter());
        let next =
            |trajectories: &mut std::vec::IntoIter<Trajectory>, prepared: &Option<Point>| match prepared {
                Some(_) => trajectories.next().unwrap_or(Trajectory::failed(Status::Panicked)),
                None => Trajectory::failed(Status::NoEquilibrium),
            };
        points
            .iter()
            .zip(prepared)
            .map(|(&point, prepared)| {
                let (nonlinear, linear) = (next(&mut nonlinear, prepared), next(&mut linear, prepared));
                let mut outcome = Outcome::new(point, nonlinear, linear);
                outcome.compare_turns(&self.plan.reliability.channels);
                if self.plan.measures.metrics.contains(&Metric::StaticSag) {
                    outcome.static_sag_m = prepared.as_ref().map(Point::static_sag_m);
                }
                outcome
            })
            .collect()
    }

    /// Both models at every point; in a pool, a thread that has run out of work takes one of them.
    fn both(&self, points: &[&Point], method: &Method) -> (Vec<Trajectory>, Vec<Trajectory>) {
        let nonlinear = || self.trajectories(points, ModelKind::Nonlinear, method);
        let linear = || self.trajectories(points, ModelKind::Linear, method);
        match rayon::current_thread_index() {
            Some(_) => rayon::join(nonlinear, linear),
            // An estimate is of one thread.
            None => (nonlinear(), linear()),
        }
    }

    /// One model at every point, by one method.
    fn trajectories(&self, points: &[&Point], model: ModelKind, method: &Method) -> Vec<Trajectory> {
        let (records, extras) = simulate_with(self.simd, model, method, points, self.wanted);
        // None at all if nothing was wanted.
        let mut extras = extras.into_iter();
        records.iter().map(|record| self.trajectory(record, extras.next().unwrap_or_default())).collect()
    }

    fn trajectory(&self, record: &Record, extra: Extra) -> Trajectory {
        let Record { failure, steps, rejected, .. } = *record;
        if let Some((reason, time_s)) = failure {
            let status = match reason {
                Failure::Diverged => Status::Diverged,
                Failure::StepTooSmall => Status::StepTooSmall,
                Failure::StepLimit => Status::StepLimit,
            };
            return Trajectory { fail_time_s: Some(time_s), steps, rejected, ..Trajectory::failed(status) };
        }
        let channels = &self.plan.reliability.channels;
        let amplitudes = match self.plan.measures.criterion {
            Criterion::Peak | Criterion::Envelope => record.amplitudes,
            Criterion::Rms => extra.root_mean_squares.unwrap_or(record.amplitudes),
        };
        let metrics = self.plan.measures.of_model().filter_map(|metric| match metric {
            Metric::CabinetForce => extra.cabinet_force_n,
            Metric::ClashTime => extra.clash_time_s,
            Metric::StaticSag => None,
        });
        Trajectory {
            status: Status::Ok,
            fail_time_s: None,
            amplitudes: channels.iter().map(|channel| amplitudes[channel.index()]).collect(),
            min_gap_m: Some(record.min_gap_m),
            steps,
            rejected,
            metrics: metrics.collect(),
            turns: extra.turns,
        }
    }
}

/// One outcome per point of a group. A panic in one point's evaluation must not cost the others theirs: then each is
/// evaluated alone, which gives the same bits.
fn together_or_alone(points: Range<u64>, evaluate: &dyn Fn(Range<u64>) -> Vec<Outcome>) -> Vec<Outcome> {
    let together = catch_unwind(AssertUnwindSafe(|| evaluate(points.clone())));
    together.unwrap_or_else(|_| {
        points
            .map(|point| {
                let alone = catch_unwind(AssertUnwindSafe(|| evaluate(point..point + 1)));
                alone.ok().and_then(|mut outcomes| outcomes.pop()).unwrap_or_else(|| panicked(point))
            })
            .collect()
    })
}

fn panicked(point: u64) -> Outcome {
    Outcome::new(point, Trajectory::failed(Status::Panicked), Trajectory::failed(Status::Panicked))
}

impl Engine for ModelEngine<'_> {
    fn evaluate(&self, points: Range<u64>, watch: &Watch<'_>) -> Option<Vec<Outcome>> {
        let mut outcomes = Vec::new();
        let mut start = points.start;
        while start < points.end {
            if watch.stopped() {
                return None;
            }
            let end = (start + GROUP).min(points.end);
            outcomes.extend(self.group(start..end, &|point| self.plan.scenario(point)));
            watch.done(end - start);
            start = end;
        }
        Some(outcomes)
    }

    fn simd(&self) -> &str {
        self.simd.name()
    }

    fn settle(&self, remembered: Option<Value>, watch: &Watch<'_>) -> Option<Value> {
        let Scheme::Fast { accuracy, settled } = &self.scheme else { return Some(Value::Null) };
        let known = remembered.and_then(|value| serde_json::from_value(value).ok());
        let found = match known {
            Some(known) => known,
            None => self.check(*accuracy, watch)?,
        };
        let found = settled.get_or_init(|| found);
        Some(serde_json::to_value(found).unwrap_or_default())
    }

    fn observed_accuracy(&self) -> Option<f64> {
        match &self.scheme {
            Scheme::Direct(_) => None,
            Scheme::Fast { settled, .. } => settled.get().and_then(|settled| settled.observed_error),
        }
    }
}

#[cfg(test)]
mod tests;

//! The engine: a range of grid points through both models, in lanes.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};

use lane_ode::{Failure, Simd, Tolerance};
use washer_model::{Method, ModelKind, Point, Record, Timing, prepare, simulate};

use crate::outcome::{Outcome, Status, Trajectory};
use crate::plan::{Integrator, Plan, Scenario};
use crate::run::{Engine, Watch};

/// Points that go through the lanes together before progress is told and the stop flag is looked at.
const GROUP: u64 = 64;

/// Steps that one leg of an adaptive trajectory may take.
const MAX_ADAPTIVE_STEPS: u64 = 100_000_000;

/// Why there is no engine for a plan.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EngineError {
    /// `SWEEP_SIMD` names nothing this machine has.
    #[error("SWEEP_SIMD={0}: expected one that this machine has: {1}")]
    Simd(String, String),
    /// The method is not there yet.
    #[error(
        "method \"rk4-mass-scaled\" is not available in this version; set method = \"rk4\" with step_s = 2e-4 \
         under [integrator], or \"dopri5\""
    )]
    Method,
}

/// Both models over a plan's points.
pub struct ModelEngine<'a> {
    plan: &'a Plan,
    simd: Simd,
    method: Method,
    timing: Timing,
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

impl<'a> ModelEngine<'a> {
    /// An engine for a plan, on the best instruction set or the one asked for.
    ///
    /// # Errors
    /// A method or an instruction set that is not there.
    pub fn new(plan: &'a Plan) -> Result<Self, EngineError> {
        let method = match plan.integrator {
            Integrator::Rk4 { step_s } => Method::Rk4 { step_s },
            Integrator::Dopri5 { rtol, atol } => {
                Method::Dopri5(Tolerance { relative: rtol, absolute: atol, max_steps: MAX_ADAPTIVE_STEPS })
            }
            Integrator::Rk4MassScaled { .. } => return Err(EngineError::Method),
        };
        let timing = Timing { end_s: plan.end_s, window_s: plan.window_s };
        Ok(Self { plan, simd: simd_from_environment()?, method, timing })
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
        let scenarios: Vec<_> = points
            .clone()
            .map(|point| {
                let scenario = scenario(point);
                (scenario.machine, scenario.spin)
            })
            .collect();
        let prepared = prepare(self.simd, &scenarios, &self.timing);
        let ready: Vec<&Point> = prepared.iter().filter_map(|point| point.as_ref().ok()).collect();
        let mut nonlinear = simulate(self.simd, ModelKind::Nonlinear, &self.method, &ready).into_iter();
        let mut linear = simulate(self.simd, ModelKind::Linear, &self.method, &ready).into_iter();
        points
            .zip(&prepared)
            .map(|(point, prepared)| {
                let next = |records: &mut std::vec::IntoIter<Record>| match prepared {
                    Ok(_) => records.next().map_or_else(|| failed(Status::Panicked), |r| self.trajectory(&r)),
                    Err(_) => failed(Status::NoEquilibrium),
                };
                let (nonlinear, linear) = (next(&mut nonlinear), next(&mut linear));
                Outcome { point, nonlinear, linear, sensitive: None }
            })
            .collect()
    }

    fn trajectory(&self, record: &Record) -> Trajectory {
        let Record { failure, steps, rejected, .. } = *record;
        if let Some((reason, time_s)) = failure {
            let status = match reason {
                Failure::Diverged => Status::Diverged,
                Failure::StepTooSmall => Status::StepTooSmall,
                Failure::StepLimit => Status::StepLimit,
            };
            return Trajectory { fail_time_s: Some(time_s), steps, rejected, ..failed(status) };
        }
        let channels = &self.plan.reliability.channels;
        Trajectory {
            status: Status::Ok,
            fail_time_s: None,
            amplitudes: channels.iter().map(|channel| record.amplitudes[channel.index()]).collect(),
            min_gap_m: Some(record.min_gap_m),
            steps,
            rejected,
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
                alone.ok().and_then(|mut outcomes| outcomes.pop()).unwrap_or_else(|| Outcome {
                    point,
                    nonlinear: failed(Status::Panicked),
                    linear: failed(Status::Panicked),
                    sensitive: None,
                })
            })
            .collect()
    })
}

fn failed(status: Status) -> Trajectory {
    Trajectory { status, fail_time_s: None, amplitudes: Vec::new(), min_gap_m: None, steps: 0, rejected: 0 }
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
}

#[cfg(test)]
mod tests;

//! Periodic responses over a grid and speeds: the engine of `sweep stability`, and what a finished
//! file says.

pub(crate) mod tongues;

use std::collections::BTreeMap;

use lane_ode::Simd;
use washer_model::{Dwell, Machine, Point, Response, Spin, Target, Timing, prepare};
use washer_row::{Growth, Outcome, Status, Trajectory};

use crate::engine::{
    Engine, EngineError, Watch, responses, simd_from_environment, together_or_alone,
};
use crate::exit::Error;
use crate::plan::Plan;

/// Rows that a thread takes at once: enough to fill lanes, few enough that a signal is soon heard.
const AT_ONCE: usize = 32;

/// Refuses a grid whose axes contradict the speeds, or mean nothing at a constant speed. `option`
/// is what gave the speeds.
///
/// # Errors
/// [`Error::Option`]; [`Error::Corners`].
pub(crate) fn check(plan: &Plan, option: &'static str, given: &str) -> Result<(), Error> {
    smooth(plan)?;
    let refuse =
        |expected: String| Err(Error::Option { option, given: given.to_owned(), expected });
    for axis in &plan.axes {
        let name = axis.parameter.name();
        match axis.parameter.target() {
            Target::Spin => {
                return refuse(format!(
                    "a grid without the axis `{name}`: here the drum turns at each speed of \
                     {option} in turn, whatever its profile; remove the axis, and give its range \
                     as {option}"
                ));
            }
            Target::Window(_) => {
                return refuse(format!(
                    "a grid without the axis `{name}`: a periodic response is the same in every \
                     turn, and has no window; remove the axis"
                ));
            }
            Target::Machine
            | Target::Cabinet
            | Target::Bearings(_)
            | Target::Springs(_)
            | Target::Dampers(_) => {}
        }
    }
    Ok(())
}

/// Refuses machines whose forces have corners: the derivatives along a response are taken at a few
/// instants of a turn, between which they are to be smooth.
///
/// # Errors
/// [`Error::Corners`].
pub(crate) fn smooth(plan: &Plan) -> Result<(), Error> {
    plan.corners_of_forces().map_or(Ok(()), |what| Err(Error::Corners { what }))
}

/// Both models' periodic responses at a plan's points and speeds. Row r is the point r / speeds at
/// the speed r % speeds.
pub(crate) struct DwellEngine<'a> {
    plan: &'a Plan,
    speeds_rpm: &'a [f64],
    simd: Simd,
}

impl<'a> DwellEngine<'a> {
    /// On the best instruction set or the one asked for.
    ///
    /// # Errors
    /// An instruction set that is not there.
    pub(crate) fn new(plan: &'a Plan, speeds_rpm: &'a [f64]) -> Result<Self, EngineError> {
        Ok(Self { plan, speeds_rpm, simd: simd_from_environment()? })
    }

    /// These rows, those of neighbouring points and speeds in lanes together.
    fn rows(&self, rows: &[u64]) -> Vec<Outcome> {
        let speeds = self.speeds_rpm.len() as u64;
        let mut wanted: Vec<u64> = rows.iter().map(|row| row / speeds).collect();
        wanted.dedup();
        let points: BTreeMap<u64, Result<Point, Status>> =
            wanted.iter().copied().zip(self.ready(&wanted)).collect();
        let (mut outcomes, mut dwells) = (Vec::with_capacity(rows.len()), Vec::new());
        let mut asked = Vec::with_capacity(rows.len());
        for &row in rows {
            match &points[&(row / speeds)] {
                Ok(point) => {
                    let speed_rpm = self.speeds_rpm[(row % speeds) as usize];
                    dwells.push(Dwell { point, speed_rpm });
                    asked.push(row);
                }
                Err(status) => outcomes.push(failed(row, *status)),
            }
        }
        for (row, found) in asked.into_iter().zip(responses(&dwells)) {
            outcomes.push(match found {
                Ok(response) => self.outcome(row, &response),
                Err(status) => failed(row, status),
            });
        }
        outcomes
    }

    fn ready(&self, points: &[u64]) -> Vec<Result<Point, Status>> {
        // The response at a constant speed knows nothing of the run.
        let timing = Timing { end_s: 1.0, window_s: [0.0, 1.0], checkpoints: 0 };
        let scenarios = points.iter().map(|&point| self.plan.scenario(point));
        let machines: Vec<(Machine, Spin)> =
            scenarios.map(|scenario| (scenario.machine, scenario.spin)).collect();
        let together = |machines: &[(Machine, Spin)]| {
            let ready = prepare(self.simd, machines, &timing).into_iter();
            ready.map(|point| point.map_err(|_| Status::NoEquilibrium)).collect()
        };
        together_or_alone(&machines, together, || Err(Status::Panicked))
    }

    fn outcome(&self, row: u64, response: &Response) -> Outcome {
        let channels = &self.plan.reliability.channels;
        let of_model = |amplitudes: &[f64]| Trajectory {
            amplitudes: channels.iter().map(|channel| amplitudes[channel.index()]).collect(),
            ..Trajectory::failed(Status::Ok)
        };
        let (nonlinear, linear) = (of_model(&response.nonlinear), of_model(&response.linear));
        Outcome { growth: Some(Growth::from(response)), ..Outcome::new(row, nonlinear, linear) }
    }
}

fn failed(row: u64, status: Status) -> Outcome {
    Outcome::new(row, Trajectory::failed(status), Trajectory::failed(status))
}

impl Engine for DwellEngine<'_> {
    fn evaluate(
        &self,
        next: &(dyn Fn() -> Option<u64> + Sync),
        keep: &(dyn Fn(Outcome) + Sync),
        watch: &Watch<'_>,
    ) {
        rayon::broadcast(|_| {
            while !watch.stopped() {
                let rows: Vec<u64> = std::iter::from_fn(next).take(AT_ONCE).collect();
                if rows.is_empty() {
                    break;
                }
                self.rows(&rows).into_iter().for_each(keep);
            }
        });
    }

    fn simd(&self) -> &str {
        Simd::narrow().name()
    }
}

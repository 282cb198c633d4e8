//! Periodic responses over a grid and speeds: the engine of `sweep stability`, and what a finished
//! file says.

#[cfg(test)]
mod tests;
pub(crate) mod tongues;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lane_ode::Simd;
use serde_json::json;
use washer_model::{Dwell, Machine, Point, Response, Spin, Target, prepare};
use washer_row::{Growth, Outcome, Status, Trajectory};

use crate::columns::Columns;
use crate::dwell::{Motions, Search};
use crate::engine::{
    Engine, RunContext, find_responses, map_isolating_panics, simd_from_environment,
};
use crate::plan::{Plan, timing};
use sweep_engine::store::{Column, Holds, Layout, axis_columns};
use sweep_engine::{Error, Job, RowSink, RowSource};
use sweep_files::{FileKind, key};

/// Rows that a thread takes at once: those of enough points to fill lanes, because a point's rows
/// share its curve of responses; but no fewer and no more than these.
const POINTS_AT_ONCE: u64 = 8;
const AT_ONCE: [u64; 2] = [32, 2048];

/// Refuses a grid whose axes contradict the speeds, or mean nothing at a constant speed. `option`
/// is what gave the speeds.
///
/// # Errors
/// [`Error::Refused`].
pub(crate) fn check(plan: &Plan, option: &'static str, given: &str) -> Result<(), Error> {
    let refuse = |expected: String| Err(Error::option(option, given, expected));
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

/// A plan's points at constant speeds, speeds varying fastest: by a search the motions that they
/// end in, else their periodic responses.
#[derive(Clone, Copy)]
pub(crate) struct Held<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) speeds_rpm: &'a [f64],
    pub(crate) search: Option<Search>,
}

impl<'a> Held<'a> {
    const fn kind(&self) -> FileKind<'static> {
        match self.search {
            Some(_) => FileKind::Dwell,
            None => FileKind::Stability,
        }
    }

    /// The command that does it.
    pub(crate) fn verb(&self) -> &'static str {
        self.kind().word()
    }

    /// Where its result goes, unless it is said.
    pub(crate) fn output(&self, out: Option<&Path>) -> PathBuf {
        let default = || format!("results/{}-{}.parquet", self.plan.name, self.verb()).into();
        out.map_or_else(default, Path::to_owned)
    }

    /// A row for each point and speed, or several.
    pub(crate) fn job(&self) -> Job<'a> {
        let Self { plan, speeds_rpm, search } = *self;
        let (columns, asked, metadata) = match search {
            Some(search) => {
                let asked = search.json(speeds_rpm);
                (search.columns(plan), asked.clone(), (key::DWELL, asked))
            }
            None => {
                let asked = json!({ "speed_rpm": speeds_rpm });
                let metadata = (key::STABILITY, json!({ "speeds_rpm": speeds_rpm }));
                (Columns::of_dwells(plan).declared(), asked, metadata)
            }
        };
        let mut axes = axis_columns(plan);
        axes.push(Column::new("speed_rpm", "rpm", "constant spin of the shaft", Holds::Axis));
        let speeds = speeds_rpm.len() as u64;
        let layout = Layout {
            axes,
            columns,
            kind: self.kind(),
            rows_a_point: speeds,
            has_several: true,
            metadata: vec![metadata],
        };
        let mut job = Job::of(plan);
        job.plan[self.verb()] = asked;
        Job {
            points: plan.points() * speeds,
            layout,
            axis_values: Box::new(move |row| {
                let mut values = plan.axis_values(row / speeds);
                values.push(speeds_rpm[(row % speeds) as usize]);
                values
            }),
            ..job
        }
    }

    /// What does it, on the best instruction set or the one asked for.
    ///
    /// # Errors
    /// An instruction set that is not there.
    pub(crate) fn engine(&self) -> Result<DwellEngine<'a>, Error> {
        let asked = match self.search {
            Some(search) => Asked::Motions(Motions::new(self.plan, search)),
            None => Asked::Responses(Columns::of_dwells(self.plan)),
        };
        Ok(DwellEngine { held: *self, simd: simd_from_environment()?, asked })
    }
}

/// What is asked of a plan's points at its speeds.
enum Asked {
    /// The periodic responses of both models.
    Responses(Columns),
    /// The motions that the nonlinear one ends in.
    Motions(Motions),
}

/// What is asked of a plan's points at constant speeds. Row r is the point r / speeds at the speed
/// r % speeds.
pub(crate) struct DwellEngine<'a> {
    held: Held<'a>,
    simd: Simd,
    asked: Asked,
}

impl DwellEngine<'_> {
    /// Keeps these rows, those of neighbouring points and speeds in lanes together, as they come.
    fn rows(&self, rows: &[u64], keep: &RowSink<'_>, watch: &RunContext<'_>) {
        // What comes of a search that was stopped means nothing.
        let is_stopped = || watch.stopped();
        let keep = |done| {
            if !is_stopped() {
                keep(done)
            }
        };
        let speeds = self.held.speeds_rpm.len() as u64;
        let mut wanted: Vec<u64> = rows.iter().map(|row| row / speeds).collect();
        wanted.dedup();
        let points: BTreeMap<u64, Result<Point, Status>> =
            wanted.iter().copied().zip(self.ready(&wanted)).collect();
        let mut asked = Vec::new();
        for &row in rows {
            let speed_rpm = self.held.speeds_rpm[(row % speeds) as usize];
            match &points[&(row / speeds)] {
                Ok(point) => asked.push((row, Dwell { point, speed_rpm })),
                Err(status) => keep(match &self.asked {
                    Asked::Responses(columns) => columns.done(Outcome::failed(row, *status)),
                    Asked::Motions(motions) => motions.failed(row, *status),
                }),
            }
        }
        match &self.asked {
            Asked::Responses(columns) => {
                let dwells: Vec<Dwell<'_>> = asked.iter().map(|(_, dwell)| *dwell).collect();
                for ((row, _), found) in asked.iter().zip(find_responses(&dwells, &is_stopped)) {
                    let none = |status| Outcome::failed(*row, status);
                    let outcome = found.map_or_else(none, |found| self.outcome(*row, &found));
                    keep(columns.done(outcome));
                }
            }
            Asked::Motions(motions) => {
                motions.find(self.simd, self.held.speeds_rpm, &asked, &keep, watch);
            }
        }
    }

    fn ready(&self, points: &[u64]) -> Vec<Result<Point, Status>> {
        let scenarios = points.iter().map(|&point| self.held.plan.scenario(point));
        let machines: Vec<(Machine, Spin)> =
            scenarios.map(|scenario| (scenario.model.machine, scenario.model.spin)).collect();
        let together = |machines: &[(Machine, Spin)]| {
            let ready = prepare(self.simd, machines, &timing(self.held.plan)).into_iter();
            ready.map(|point| point.map_err(|_| Status::NoEquilibrium)).collect()
        };
        map_isolating_panics(&machines, together, || Err(Status::Panicked))
    }

    fn outcome(&self, row: u64, responses: &[Response]) -> Outcome {
        let mut outcomes = responses.iter().map(|response| self.outcome_of(row, response));
        let first = outcomes.next().unwrap_or_else(|| Outcome::failed(row, Status::NoResponse));
        Outcome { coexisting: outcomes.collect(), ..first }
    }

    fn outcome_of(&self, row: u64, response: &Response) -> Outcome {
        let channels = &self.held.plan.reliability.channels;
        let of_model = |amplitudes: &[f64]| Trajectory {
            amplitudes: channels.iter().map(|channel| amplitudes[channel.index()]).collect(),
            ..Trajectory::default()
        };
        let (nonlinear, linear) = (of_model(&response.nonlinear), of_model(&response.linear));
        Outcome { growth: Some(Growth::from(response)), ..Outcome::new(row, nonlinear, linear) }
    }
}

impl Engine for DwellEngine<'_> {
    fn evaluate(&self, next: &RowSource<'_>, keep: &RowSink<'_>, watch: &RunContext<'_>) {
        let speeds = self.held.speeds_rpm.len() as u64;
        // All threads have some of few rows.
        let share =
            self.held.plan.points().saturating_mul(speeds) / rayon::current_num_threads() as u64;
        let at_once = match &self.asked {
            Asked::Responses(_) => share.min(POINTS_AT_ONCE * speeds).clamp(AT_ONCE[0], AT_ONCE[1]),
            Asked::Motions(motions) => motions.at_once(share, speeds),
        };
        rayon::broadcast(|_| {
            while !watch.stopped() {
                let rows = std::iter::from_fn(next).map(|(row, _)| row);
                let rows: Vec<u64> = rows.take(at_once as usize).collect();
                if rows.is_empty() {
                    break;
                }
                self.rows(&rows, keep, watch);
            }
        });
    }

    /// A point's rows share its machine made ready, and the curve of its responses.
    fn is_helped_by_neighbours(&self) -> bool {
        true
    }

    fn simd(&self) -> &str {
        match self.asked {
            Asked::Responses(_) => Simd::best().name(),
            Asked::Motions(_) => self.simd.name(),
        }
    }
}

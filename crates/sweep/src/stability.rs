//! Periodic responses over a grid and held speeds: the engine of `sweep stability`, and the summary
//! of a finished file.

#[cfg(test)]
mod tests;
pub(crate) mod tongues;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lane_ode::{Cancel, Simd};
use serde_json::json;
use washer_model::{HeldSpeed, Machine, Point, Response, Spin, Target, prepare};
use washer_row::{Growth, Outcome, Status, Trajectory};

use crate::columns::Columns;
use crate::dwell::{AttractorEngine, AttractorSearch};
use crate::engine::{
    Engine, Evaluator, RunContext, find_responses, map_isolating_panics, simd_from_environment,
};
use crate::plan::{Plan, compared_channels, failure_reason, point_input, timing};
use sweep_engine::store::{CellType, DeclaredColumn, Layout, axis_columns};
use sweep_engine::{Error, Job, RowSink, RowSource};
use sweep_files::{FileKind, key};

/// Number of points whose rows a thread computes together. Basis: the rows of a point share its
/// curve of responses, so that this number of points fills the lanes. Doubling it leaves threads
/// without work at the end of a run.
const POINTS_PER_BATCH: u64 = 8;

/// Minimum and maximum number of rows that a thread computes together. Basis: fewer than the
/// minimum leave lanes empty, and more than the maximum delay the first rows. Doubling the maximum
/// doubles this delay.
const MIN_AND_MAX_ROWS_PER_BATCH: [u64; 2] = [32, 2048];

/// Refuses a grid with an axis of the spin, which contradicts held speeds, or of the window, which
/// has no meaning at held speeds. `option` is the name of the option that gave the speeds, and
/// `text` its value.
///
/// # Errors
///
/// Returns [`Error::Refused`] for such an axis.
pub(crate) fn check_axes(plan: &Plan, option: &'static str, text: &str) -> Result<(), Error> {
    let refuse_axis = |expected: String| Err(Error::option(option, text, expected));
    for axis in &plan.axes {
        let name = &axis.parameter.name;
        match axis.parameter.handle.target() {
            Target::Spin => {
                return refuse_axis(format!(
                    "a grid without the axis `{name}`: here the drum is held at each speed of \
                     {option}, whatever its profile; remove the axis, and give its range as \
                     {option}"
                ));
            }
            Target::Window(_) => {
                return refuse_axis(format!(
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

/// The points of a plan at held speeds, of which the speeds vary fastest. With a search the rows
/// are attractors, without one periodic responses.
#[derive(Clone, Copy)]
pub(crate) struct HeldPlan<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) speeds_rpm: &'a [f64],
    pub(crate) search: Option<AttractorSearch>,
}

impl<'a> HeldPlan<'a> {
    const fn kind(&self) -> FileKind<'static> {
        match self.search {
            Some(_) => FileKind::Dwell,
            None => FileKind::Stability,
        }
    }

    /// Returns the name of the command.
    pub(crate) fn command_name(&self) -> &'static str {
        self.kind().short_name()
    }

    /// Returns the path of the result, by default one in `results`.
    pub(crate) fn output(&self, out: Option<&Path>) -> PathBuf {
        let default_path =
            || format!("results/{}-{}.parquet", self.plan.name, self.command_name()).into();
        out.map_or_else(default_path, Path::to_owned)
    }

    /// Returns the job of the engine, with one or several rows for each point and speed.
    pub(crate) fn job(&self) -> Job<'a> {
        let Self { plan, speeds_rpm, search } = *self;
        let (columns, options, metadata) = match search {
            Some(search) => {
                let options = search.to_json(speeds_rpm);
                (search.declared_columns(plan), options.clone(), (key::DWELL, options))
            }
            None => {
                let options = json!({ "speed_rpm": speeds_rpm });
                let metadata = (key::STABILITY, json!({ "speeds_rpm": speeds_rpm }));
                (Columns::for_responses(plan).declared(), options, metadata)
            }
        };
        let mut axes = axis_columns(plan);
        axes.push(DeclaredColumn::new(
            "speed_rpm",
            "rpm",
            "constant spin of the shaft",
            CellType::Axis,
        ));
        let speed_count = speeds_rpm.len() as u64;
        let layout = Layout {
            axes,
            columns,
            kind: self.kind(),
            tasks_per_point: speed_count,
            has_several_rows: true,
            metadata: vec![metadata],
        };
        let mut job = Job::new(plan);
        job.plan[self.command_name()] = options;
        Job {
            points: plan.points() * speed_count,
            layout,
            axis_values: Box::new(move |row| {
                let mut values = plan.axis_values(row / speed_count);
                values.push(speeds_rpm[(row % speed_count) as usize]);
                values
            }),
            ..job
        }
    }

    /// Returns the engine, with the instruction set that `SWEEP_SIMD` names, if it is set.
    ///
    /// # Errors
    /// Returns an error if this processor has no instruction set of that name.
    pub(crate) fn engine(&self) -> Result<Engine<'a>, Error> {
        let analysis = match self.search {
            Some(search) => HeldAnalysis::Attractors(AttractorEngine::new(self.plan, search)),
            None => HeldAnalysis::Responses(Columns::for_responses(self.plan)),
        };
        let simd = simd_from_environment()?;
        let simd_name = match analysis {
            HeldAnalysis::Responses(_) => Simd::widest().name(),
            HeldAnalysis::Attractors(_) => simd.name(),
        };
        let evaluator = HeldSpeedEvaluator { held_plan: *self, simd, analysis };
        // The rows of a point share its curve of responses.
        let plan = self.plan;
        Ok(Engine {
            shares_work_of_rows: true,
            failure_reason: Box::new(move |point| failure_reason(plan, point)),
            ..Engine::new(evaluator, simd_name)
        })
    }
}

/// The kind of motions that are sought at held speeds.
enum HeldAnalysis {
    /// The periodic responses of both models.
    Responses(Columns),
    /// The motions in which the nonlinear model ends.
    Attractors(AttractorEngine),
}

/// An evaluator of rows at held speeds. Row r is the point r / speeds at the speed r % speeds.
pub(crate) struct HeldSpeedEvaluator<'a> {
    held_plan: HeldPlan<'a>,
    simd: Simd,
    analysis: HeldAnalysis,
}

impl HeldSpeedEvaluator<'_> {
    /// Computes rows, which share the lanes, and passes them to `sink`.
    fn evaluate_rows(&self, rows: &[u64], sink: &RowSink<'_>, context: &RunContext<'_>) {
        // Rows of a stopped search are meaningless.
        let is_stopped = || context.must_stop();
        let pass_unless_stopped = |rows| {
            if !is_stopped() {
                sink(rows)
            }
        };
        let speed_count = self.held_plan.speeds_rpm.len() as u64;
        let mut point_indices: Vec<u64> = rows.iter().map(|row| row / speed_count).collect();
        point_indices.dedup();
        let points: BTreeMap<u64, Result<Point, Status>> =
            point_indices.iter().copied().zip(self.prepare(&point_indices)).collect();
        let mut requests = Vec::new();
        for &row in rows {
            let speed_rpm = self.held_plan.speeds_rpm[(row % speed_count) as usize];
            match &points[&(row / speed_count)] {
                Ok(point) => requests.push((row, HeldSpeed { point, speed_rpm })),
                Err(status) => match &self.analysis {
                    HeldAnalysis::Responses(columns) => {
                        columns.pass(&Outcome::failed(row, *status), &pass_unless_stopped);
                    }
                    HeldAnalysis::Attractors(engine) => {
                        pass_unless_stopped(engine.failed_row(row, *status))
                    }
                },
            }
        }
        match &self.analysis {
            HeldAnalysis::Responses(columns) => {
                let held_speeds: Vec<HeldSpeed<'_>> =
                    requests.iter().map(|(_, held_speed)| *held_speed).collect();
                for ((row, _), result) in
                    requests.iter().zip(find_responses(&held_speeds, Cancel::When(&is_stopped)))
                {
                    let failed_outcome = |status| Outcome::failed(*row, status);
                    let outcome = result
                        .map_or_else(failed_outcome, |responses| self.outcome(*row, &responses));
                    columns.pass(&outcome, &pass_unless_stopped);
                }
            }
            HeldAnalysis::Attractors(engine) => {
                engine.evaluate(
                    self.simd,
                    self.held_plan.speeds_rpm,
                    &requests,
                    &pass_unless_stopped,
                    context,
                );
            }
        }
    }

    /// Prepares points for integration, each for all rows at its speeds.
    fn prepare(&self, points: &[u64]) -> Vec<Result<Point, Status>> {
        let plan = self.held_plan.plan;
        let inputs = points.iter().map(|&point| point_input(plan, &plan.axis_values(point)));
        let machines: Vec<(Machine, Spin)> =
            inputs.map(|input| (input.machine, input.spin)).collect();
        let prepare_group = |machines: &[(Machine, Spin)]| {
            let points = prepare(self.simd, machines, &timing(plan)).into_iter();
            points.map(|point| point.map_err(|_| Status::NoEquilibrium)).collect()
        };
        map_isolating_panics(&machines, prepare_group, || Err(Status::Panicked))
    }

    /// Returns the outcome of a row: that of the first response, with those of further responses as
    /// coexisting outcomes.
    fn outcome(&self, row: u64, responses: &[Response]) -> Outcome {
        let mut outcomes = responses.iter().map(|response| self.response_outcome(row, response));
        let first_outcome =
            outcomes.next().unwrap_or_else(|| Outcome::failed(row, Status::NoResponse));
        Outcome { coexisting: outcomes.collect(), ..first_outcome }
    }

    fn response_outcome(&self, row: u64, response: &Response) -> Outcome {
        let channels = compared_channels(self.held_plan.plan);
        let trajectory_with_peaks = |amplitudes: &[f64]| Trajectory {
            amplitudes: channels.iter().map(|channel| amplitudes[channel.index()]).collect(),
            ..Trajectory::default()
        };
        let nonlinear = trajectory_with_peaks(&response.nonlinear_peaks);
        let linear = trajectory_with_peaks(&response.linear_peaks);
        let mut outcome = Outcome::new(row, nonlinear, linear);
        outcome.compare(&channels, self.held_plan.plan.reliability.limits);
        Outcome { growth: Some(Growth::from(response)), ..outcome }
    }
}

impl Evaluator for HeldSpeedEvaluator<'_> {
    fn evaluate(&self, source: &RowSource<'_>, sink: &RowSink<'_>, context: &RunContext<'_>) {
        let speed_count = self.held_plan.speeds_rpm.len() as u64;
        // A small job is divided between all threads.
        let rows_per_thread = self.held_plan.plan.points().saturating_mul(speed_count)
            / rayon::current_num_threads() as u64;
        let rows_per_batch = match &self.analysis {
            HeldAnalysis::Responses(_) => rows_per_thread
                .min(POINTS_PER_BATCH * speed_count)
                .clamp(MIN_AND_MAX_ROWS_PER_BATCH[0], MIN_AND_MAX_ROWS_PER_BATCH[1]),
            HeldAnalysis::Attractors(engine) => engine.rows_per_batch(rows_per_thread, speed_count),
        };
        rayon::broadcast(|_| {
            while !context.must_stop() {
                let source_rows = std::iter::from_fn(source).map(|(row, _)| row);
                let remaining_rows: Vec<u64> = source_rows.take(rows_per_batch as usize).collect();
                if remaining_rows.is_empty() {
                    break;
                }
                self.evaluate_rows(&remaining_rows, sink, context);
            }
        });
    }
}

//! Trajectories of one model at one refinement level, and the numbers that rows take from them.

use lane_ode::{Cancel, Failure, Simd};
use sweep_parameter::RatioLimits;
use washer_model::{
    Channel, Checkpoints, Gauge, Method, ModelKind, Point, Reading, Record, Recorders,
    simulate_until,
};

use crate::{Criterion, Deviations, Measures, Status, Trajectory};

/// The numbers that rows take from trajectories, and their accuracy.
#[derive(Clone, Debug, PartialEq)]
pub struct RowRule {
    /// The end of the run, which starts at 0.
    pub end_s: f64,
    /// The window (s) of points that do not set their own, a closed interval.
    pub window_s: [f64; 2],
    /// The largest relative error of a row's numbers; infinite if levels are not compared.
    pub accuracy: f64,
    /// The limits of reliable ratios.
    pub limits: RatioLimits,
    /// The channels that the verdict compares.
    pub channels: Vec<Channel>,
    /// The measures of the motions.
    pub measures: Measures,
}

impl RowRule {
    /// Returns the recorders that trajectories need.
    pub fn recorders(&self) -> Recorders {
        Recorders { with_checkpoints: self.accuracy.is_finite(), ..self.measures.recorders() }
    }
}

/// The results of a trajectory at one refinement level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelRun {
    /// The numbers that a row takes from the trajectory.
    pub trajectory: Trajectory,
    /// The amplitudes of all channels by the rule's criterion.
    pub amplitudes: Deviations,
    /// The coordinates at the checkpoints, if levels are compared.
    pub checkpoints: Checkpoints,
}

impl LevelRun {
    /// Creates a failed run, which has only a status.
    pub fn failed(status: Status) -> Self {
        Self { trajectory: Trajectory::failed(status), ..Self::default() }
    }

    fn new(record: &Record, mut reading: Reading, rule: &RowRule, point: &Point) -> Self {
        let checkpoints = std::mem::take(&mut reading.checkpoints);
        let amplitudes = match rule.measures.criterion {
            Criterion::Peak | Criterion::Envelope => record.amplitudes,
            Criterion::Rms => reading.root_mean_squares.unwrap_or(record.amplitudes),
        };
        let rest_limit = point.rest_limit_m();
        let amplitudes = amplitudes.map(|value| if value < rest_limit { 0.0 } else { value });
        let trajectory = trajectory(record, reading, &amplitudes, rule);
        Self { trajectory, amplitudes, checkpoints }
    }
}

/// Integrates one model at every point by one method; returns `None` if `cancel` was requested
/// before the end.
pub fn integrate_points(
    simd: Simd,
    model: ModelKind,
    method: &Method,
    points: &[&Point],
    rule: &RowRule,
    cancel: Cancel<'_>,
) -> Option<Vec<LevelRun>> {
    let mut friction_speeds = points.iter().flat_map(|point| point.friction_speeds());
    let mut recorders = rule.recorders();
    recorders.gauges[Gauge::DamperSpeed as usize] |=
        friction_speeds.any(|speed| model == ModelKind::Linear || !speed.is_from_motion);
    let (records, readings) = simulate_until(simd, model, method, points, recorders, cancel)?;
    // There are no readings if no recorder is in use.
    let mut readings = readings.into_iter();
    let run = |(record, point): (&Record, &&Point)| {
        let reading = readings.next().unwrap_or_default();
        let factor = point.friction_speed_factor(model, reading.gauge_values(Gauge::DamperSpeed));
        let mut run = LevelRun::new(record, reading, rule, point);
        run.trajectory.friction_speed_off = factor.filter(|_| record.failure.is_none());
        run
    };
    Some(records.iter().zip(points).map(run).collect())
}

fn trajectory(
    record: &Record,
    reading: Reading,
    amplitudes: &Deviations,
    rule: &RowRule,
) -> Trajectory {
    let Record { failure, accepted_steps, rejected_steps, .. } = *record;
    if let Some((reason, time_s)) = failure {
        let status = match reason {
            Failure::Diverged => Status::Diverged,
            Failure::StepTooSmall => Status::StepTooSmall,
            Failure::StepLimit => Status::StepLimit,
        };
        return Trajectory {
            fail_time_s: Some(time_s),
            steps: accepted_steps,
            rejected: rejected_steps,
            ..Trajectory::failed(status)
        };
    }
    let metrics = rule.measures.model_columns().filter_map(|column| column.value(&reading));
    Trajectory {
        amplitudes: rule.channels.iter().map(|channel| amplitudes[channel.index()]).collect(),
        min_gap_m: Some(record.min_gap_m),
        steps: accepted_steps,
        rejected: rejected_steps,
        metrics: metrics.collect(),
        turns: reading.turns,
        ..Trajectory::default()
    }
}

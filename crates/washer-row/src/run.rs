//! One model's trajectories at one refinement level, and what a row takes from each.

use lane_ode::{Failure, Simd};
use sweep_parameter::RatioLimits;
use washer_model::{
    Channel, Course, Gauge, Method, ModelKind, Point, Reading, Record, Recorders, simulate_until,
};

use crate::measures::REST_SHARE;
use crate::{Criterion, Deviations, Measures, Status, Trajectory};

/// What rows take from trajectories, and what they must be good for.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// The run is from 0 to here.
    pub end_s: f64,
    /// What is measured is measured in this closed interval, unless a point has its own.
    pub window_s: [f64; 2],
    /// Largest error of a row's numbers, relative; infinite where nothing is compared.
    pub accuracy: f64,
    /// Ratios between them are reliable.
    pub limits: RatioLimits,
    /// What the verdict compares.
    pub channels: Vec<Channel>,
    /// What is measured of the motions.
    pub measures: Measures,
}

impl Rule {
    /// What trajectories must record.
    pub fn wanted(&self) -> Recorders {
        Recorders { course: self.accuracy.is_finite(), ..self.measures.wanted() }
    }
}

/// A trajectory at one refinement level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelRun {
    /// What a row takes from it.
    pub trajectory: Trajectory,
    /// Amplitudes by the rule's criterion, of channels that it does not compare too.
    pub amplitudes: Deviations,
    /// The motion at the ends of the run's parts, if anything is compared.
    pub course: Course,
}

impl LevelRun {
    /// Nothing but a status.
    pub fn failed(status: Status) -> Self {
        Self { trajectory: Trajectory::failed(status), ..Self::default() }
    }

    fn new(record: &Record, mut extra: Reading, rule: &Rule, point: &Point) -> Self {
        let course = std::mem::take(&mut extra.course);
        let amplitudes = match rule.measures.criterion {
            Criterion::Peak | Criterion::Envelope => record.amplitudes,
            Criterion::Rms => extra.root_mean_squares.unwrap_or(record.amplitudes),
        };
        let at_rest = REST_SHARE * point.clearance_m();
        let amplitudes = amplitudes.map(|one| if one < at_rest { 0.0 } else { one });
        let trajectory = trajectory(record, extra, &amplitudes, rule);
        Self { trajectory, amplitudes, course }
    }
}

/// One model at every point, by one method; `None` once `is_stopped` says so.
pub fn runs(
    simd: Simd,
    model: ModelKind,
    method: &Method,
    points: &[&Point],
    rule: &Rule,
    is_stopped: &dyn Fn() -> bool,
) -> Option<Vec<LevelRun>> {
    let mut taken = points.iter().flat_map(|point| point.friction_speeds());
    let mut wanted = rule.wanted();
    wanted.gauges[Gauge::DamperSpeed as usize] |=
        taken.any(|taken| model == ModelKind::Linear || !taken.is_own);
    let (records, extras) = simulate_until(simd, model, method, points, wanted, is_stopped)?;
    // None at all if nothing was wanted.
    let mut extras = extras.into_iter();
    let run = |(record, point): (&Record, &&Point)| {
        let extra = extras.next().unwrap_or_default();
        let off = point.friction_speed_off(model, extra.gauge(Gauge::DamperSpeed));
        let mut run = LevelRun::new(record, extra, rule, point);
        run.trajectory.friction_speed_off = off.filter(|_| record.failure.is_none());
        run
    };
    Some(records.iter().zip(points).map(run).collect())
}

fn trajectory(record: &Record, extra: Reading, amplitudes: &Deviations, rule: &Rule) -> Trajectory {
    let Record { failure, steps, rejected, .. } = *record;
    if let Some((reason, time_s)) = failure {
        let status = match reason {
            Failure::Diverged => Status::Diverged,
            Failure::StepTooSmall => Status::StepTooSmall,
            Failure::StepLimit => Status::StepLimit,
        };
        return Trajectory {
            fail_time_s: Some(time_s),
            steps,
            rejected,
            ..Trajectory::failed(status)
        };
    }
    let metrics = rule.measures.of_model().filter_map(|number| number.of(&extra));
    Trajectory {
        amplitudes: rule.channels.iter().map(|channel| amplitudes[channel.index()]).collect(),
        min_gap_m: Some(record.min_gap_m),
        steps,
        rejected,
        metrics: metrics.collect(),
        turns: extra.turns,
        ..Trajectory::default()
    }
}

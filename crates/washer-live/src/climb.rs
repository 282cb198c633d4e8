//! A point as a row of the map has it: each model by finer and finer rungs, until two runs agree.
//!
//! The rule is that of `sweep`'s engine (`engine/ladder.rs`, `engine/climb.rs`) for rows without
//! further metrics: a test there holds this one against it, bit by bit.

use lane_ode::Simd;
use washer_model::{Course, ModelKind, Point, Record, Wanted, simulate_with};

use crate::point::{NoPoint, ladders, ready};
use crate::setup::{Rung, Setup};

/// Fail times that differ by less than this share of the run are one.
const SAME_TIME: f64 = 1e-4;

const MODELS: [ModelKind; 2] = [ModelKind::Nonlinear, ModelKind::Linear];

/// One model as far up its ladder as it had to go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Climbed {
    /// The last run.
    pub record: Record,
    /// By which rung of the ladder.
    pub rung: usize,
    /// What the program calls that rung.
    pub level: u8,
    /// The error left, relative; absent where nothing says so.
    pub error: Option<f64>,
}

/// A checked point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checked {
    /// The nonlinear and the linear model.
    pub models: [Climbed; 2],
    /// Whether the last rung does not agree with the one before: the motion is chaotic.
    pub is_sensitive: bool,
}

/// One model's runs so far.
#[derive(Default)]
struct Climb {
    rung: usize,
    run: Option<(Record, Course)>,
    error: Option<f64>,
}

/// Checks a point.
///
/// # Errors
/// [`NoPoint`].
pub fn check(setup: &Setup, values: &[f64]) -> Result<Checked, NoPoint> {
    let (_, point) = ready(setup, values)?;
    let ladders = ladders(setup, values);
    let mut climbs = [Climb::default(), Climb::default()];
    loop {
        let mut wanted = [0, 1].map(|model| climbs[model].higher(&ladders[model], setup.accuracy));
        if wanted == [None, None] {
            let errors: f64 = climbs.iter().filter_map(|climb| climb.error).sum();
            // The verdict is plain RK4's: where the error left could turn it, RK4 has the word.
            if margin(&climbs, setup).is_some_and(|margin| margin <= errors) {
                for model in 0..2 {
                    let top = ladders[model].len() - 1;
                    let rung = climbs[model].rung;
                    wanted[model] = (rung < top).then(|| (rung + 1).max(top - 1));
                }
            }
        }
        if wanted == [None, None] {
            break;
        }
        for (model, rung) in wanted.into_iter().enumerate() {
            if let Some(rung) = rung {
                climbs[model].run(rung, &ladders[model], &point, MODELS[model], setup);
            }
        }
    }
    let is_chaotic = |model: usize| {
        climbs[model].rung + 1 == ladders[model].len()
            && climbs[model].error.is_none_or(|error| error > setup.accuracy)
    };
    let is_sensitive = is_chaotic(0) || is_chaotic(1);
    let climbed = |model: usize| {
        let Climb { rung, ref run, error } = climbs[model];
        let (record, _) = run.as_ref().ok_or(NoPoint::NoEquilibrium)?;
        Ok(Climbed { record: *record, rung, level: ladders[model][rung].level, error })
    };
    Ok(Checked { models: [climbed(0)?, climbed(1)?], is_sensitive })
}

impl Climb {
    /// The rung to go to; none if it is there, or at the top.
    fn higher(&self, rungs: &[Rung], accuracy: f64) -> Option<usize> {
        let Some((record, _)) = &self.run else { return Some(0) };
        let top = rungs.len() - 1;
        if record.failure.is_some() && self.rung + 1 < top {
            // It may be the caps that do not hold.
            return Some(top - 1);
        }
        let is_settled = self.rung == top || self.error.is_some_and(|error| error <= accuracy);
        (!is_settled).then_some(self.rung + 1)
    }

    fn run(&mut self, rung: usize, rungs: &[Rung], point: &Point, model: ModelKind, of: &Setup) {
        let wanted = Wanted { course: true, ..Wanted::default() };
        let method = &rungs[rung].method;
        let (records, extras) = simulate_with(Simd::best(), model, method, &[point], wanted);
        let now = records.into_iter().zip(extras.into_iter().map(|extra| extra.course)).next();
        if let (Some(before), Some(now)) = (&self.run, &now) {
            let found = difference(before, now, point, model, of);
            let unseen = unseen(&now.0, &rungs[rung], point, of);
            self.error = found.map(|found| rungs[rung].convergence.error_left(found, unseen));
        }
        (self.rung, self.run) = (rung, now);
    }
}

/// How far the greatest ratio is from the limit, as a share of the limit.
fn margin(climbs: &[Climb; 2], setup: &Setup) -> Option<f64> {
    let record = |climb: &Climb| climb.run.as_ref().map(|(record, _)| *record);
    let [nonlinear, linear] = [record(&climbs[0])?, record(&climbs[1])?];
    if nonlinear.failure.is_some() || linear.failure.is_some() {
        return None;
    }
    let ratio = |channel: usize| {
        let of = linear.amplitudes[channel];
        (of != 0.0).then(|| nonlinear.amplitudes[channel] / of)
    };
    let ratios = setup.channels.iter().filter_map(|channel| ratio(channel.index()));
    let greatest = ratios.reduce(|so_far, ratio| if ratio > so_far { ratio } else { so_far })?;
    Some((greatest / setup.ratio_limit - 1.0).abs())
}

/// How far two runs are apart, relative; `None` if one of them failed, or both at different times.
fn difference(
    (a, course_a): &(Record, Course),
    (b, course_b): &(Record, Course),
    point: &Point,
    model: ModelKind,
    setup: &Setup,
) -> Option<f64> {
    match (a.failure, b.failure) {
        (None, None) => {}
        (Some((a, a_s)), Some((b, b_s))) => {
            let alike = a == b && (a_s - b_s).abs() <= SAME_TIME * setup.end_s;
            return alike.then_some(0.0);
        }
        _ => return None,
    }
    let mut greatest = point.course_difference(model, course_a, course_b);
    let mut compare = |a: f64, b: f64, least: f64| {
        if a != b {
            let share = (a - b).abs() / b.abs().max(least);
            greatest = if share.is_nan() { f64::INFINITY } else { greatest.max(share) };
        }
    };
    for channel in &setup.channels {
        compare(a.amplitudes[channel.index()], b.amplitudes[channel.index()], 0.0);
    }
    compare(a.min_gap_m, b.min_gap_m, point.clearance_m());
    Some(greatest)
}

/// The error that capped rungs have in common: bearings and hinge that are left swinging.
fn unseen(record: &Record, rung: &Rung, point: &Point, setup: &Setup) -> f64 {
    if !rung.is_capped || record.failure.is_some() {
        return 0.0;
    }
    let swings = point.ringing();
    let share = |channel: usize| match swings[channel] {
        0.0 => 0.0,
        swing => swing / record.amplitudes[channel],
    };
    setup.channels.iter().map(|channel| share(channel.index())).fold(0.0, f64::max)
}

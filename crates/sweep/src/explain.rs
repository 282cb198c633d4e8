//! Why the linear model fails at a point: the tongues of instability that its run crosses, and what
//! they do to the run.

mod cause;
pub(crate) mod format;
pub(crate) mod json;
mod profile;
mod tongue;

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use washer_model::{
    Channel, Crossed, Crossing, Ending, LeftRange, NoEquilibrium, Point, Response, Spin,
    StepSelector, Timing, cross, modes, peaks_without_departures,
};

use crate::engine::{ModelEngine, reference_step_s, simd_from_environment};
use crate::plan::{self, Plan, Scenario};
use crate::speeds::Speeds;
use sweep_engine::config::NamedValues;
use sweep_engine::{Effort, Error, Interrupt, Progress, RunContext, threads};

pub(crate) use cause::Cause;
use sweep_parameter::RatioLimits;
use tongue::{Asker, Seen, tongues};
pub(crate) use tongue::{Closing, End, Resonance, Tongue};
use washer_row::{Outcome, ROW_STATUSES, Status, Verdict, row_status};

/// Distance between the speeds that are looked at (rpm), unless `--speed` says another.
const STEP_RPM: f64 = 1.0;

/// Speeds from this share of the slowest mode's frequency are looked at, unless `--speed` says
/// others. Parametric resonances of a mode f are at 2 f / k: this is the fourth.
const LOWEST_SHARE: f64 = 0.5;

/// What is found at a point.
pub(crate) struct Explanation {
    /// The grid's name.
    pub(crate) name: String,
    /// The point: parameters by name.
    pub(crate) at: NamedValues,
    /// The swept verdict.
    pub(crate) swept: Swept,
    /// What is seen beside tongues, by the way in which the drum turns: forwards first.
    pub(crate) seen: Vec<Seen>,
    /// From lowest to fastest speed of the profile within the run (rpm), below 0 backwards.
    pub(crate) profile_rpm: [f64; 2],
    /// Each, with the times at which the run crosses it.
    pub(crate) tongues: Vec<(Tongue, Vec<Passage>)>,
    /// The same run, each tongue entered on its periodic response: amplitudes in the window, per
    /// channel of the plan; none where no tongue is crossed before the window ends.
    pub(crate) without_departures: Option<Result<Vec<f64>, LeftRange>>,
    /// The deviation, and how much of it the tongues' growth makes; none without a ratio.
    pub(crate) cause: Option<Cause>,
}

/// What `sweep run` says of the point.
pub(crate) struct Swept {
    pub(crate) channels: Vec<Channel>,
    pub(crate) window_s: [f64; 2],
    pub(crate) limits: RatioLimits,
    /// One of the result file's.
    pub(crate) status: &'static str,
    pub(crate) fail_time_s: Option<f64>,
    /// Amplitudes by the nonlinear and the linear model, per channel; empty of a model that failed.
    pub(crate) amplitudes: [Vec<f64>; 2],
    pub(crate) verdict: Verdict,
}

impl Swept {
    /// The plan's channels of all.
    pub(crate) fn of_plan(&self, peaks: &[f64; Channel::ALL.len()]) -> Vec<f64> {
        self.channels.iter().map(|channel| peaks[channel.index()]).collect()
    }

    /// The greatest ratio of other amplitudes of the nonlinear model to the linear one's.
    pub(crate) fn greatest_of(&self, nonlinear: &[f64]) -> Option<(f64, Channel)> {
        let pairs = nonlinear.iter().zip(&self.amplitudes[1]).zip(&self.channels);
        let ratios = pairs
            .filter(|((_, linear), _)| **linear != 0.0)
            .map(|((nonlinear, linear), channel)| (nonlinear / linear, *channel));
        ratios.reduce(|most, next| if next.0 > most.0 { next } else { most })
    }
}

/// A stretch of time in which the profile is inside a tongue.
pub(crate) struct Passage {
    /// From when to when (s).
    pub(crate) from_to_s: [f64; 2],
    /// Whether the run ends inside.
    pub(crate) is_cut: bool,
    /// The integral over it of the growth at the speed of each instant.
    pub(crate) e_folds: f64,
    /// What it does to disturbances.
    pub(crate) crossed: Result<Crossed, LeftRange>,
}

/// Explains a plan's one point. Once the interrupt is raised it ends early, and what it returns
/// means nothing.
///
/// # Errors
/// A profile without a speed to look at, a machine without equilibrium or modes, and an instruction
/// set that is not there.
pub(crate) fn explain(
    plan: &Plan,
    at: NamedValues,
    speeds: Option<Speeds>,
    effort: Effort<'_>,
) -> Result<Explanation, Error> {
    threads::pool(effort.threads()?)?.install(|| explained(plan, at, speeds, effort))
}

fn explained(
    plan: &Plan,
    at: NamedValues,
    speeds: Option<Speeds>,
    Effort { progress, interrupt, .. }: Effort<'_>,
) -> Result<Explanation, Error> {
    let simd = simd_from_environment()?;
    let scenario = plan.scenario(0);
    let spin = &scenario.model.spin;
    let profile_rpm = profile::range(spin, plan.end_s);
    let point = ready(plan, &scenario).map_err(Error::model)?;
    let directions = directions(plan, &scenario, &point, profile_rpm, speeds)?;
    // Behind those that are looked at come speeds that nobody can count beforehand.
    let speeds_of = |direction: &Direction| direction.looked.values().len() as u64;
    let total: u64 = directions.iter().map(speeds_of).sum();
    let done = AtomicU64::new(0);
    let progress = Progress::for_search(progress, total, "speeds looked at", 0);
    let counted = |speeds: usize| {
        let done = done.fetch_add(speeds as u64, Ordering::Relaxed) + speeds as u64;
        progress.show_search(done.min(total), done);
    };
    counted(0);
    let mut askers = Vec::with_capacity(directions.len());
    for direction in &directions {
        let mut asker = Asker {
            simd,
            plan,
            scenario: &direction.scenario,
            point: &direction.point,
            is_backward: direction.is_backward,
            interrupt,
            counted: &counted,
            followed: Vec::new(),
        };
        asker.follow(direction.looked.to.max(direction.fastest_rpm));
        askers.push(asker);
    }
    let look = || {
        let each = askers.iter().zip(&directions);
        each.map(|(asker, direction)| tongues(asker, direction.looked)).collect::<Vec<_>>()
    };
    let (looked, swept) = rayon::join(look, || swept(plan, interrupt));
    let (found, seen): (Vec<Vec<Tongue>>, Vec<Seen>) = looked.into_iter().unzip();
    let found: Vec<Tongue> = found.into_iter().flatten().collect();
    let swept = swept?;
    let asker_of = |tongue: &Tongue| {
        let asks = |asker: &&Asker<'_>| asker.is_backward == tongue.is_backward;
        askers.iter().find(asks).unwrap_or(&askers[0])
    };
    let ends_in = || -> Vec<Option<Ending>> {
        let directions = found.chunk_by(|a, b| a.is_backward == b.is_backward);
        directions.flat_map(|found| tongue::ends_in(asker_of(&found[0]), found)).collect()
    };
    let crossings = || crossings(plan, (&point, spin), &askers, &found, &swept);
    let closings = || found.par_iter().map(|tongue| tongue.closing(asker_of(tongue)));
    let ((crossings, ends_in), closings) =
        rayon::join(|| rayon::join(crossings, ends_in), || closings().collect::<Vec<_>>());
    let (passages, without_departures) = crossings;
    let step_s = reference_step_s(&StepSelector::new([(&point, spin)], plan.end_s));
    let growing = found.iter().zip(&passages).flat_map(|(tongue, passages)| {
        passages.iter().map(|passage| (passage, tongue.growths.as_slice()))
    });
    let keeps_limit = |amplitudes: &Vec<f64>| {
        swept.greatest_of(amplitudes).is_some_and(|(ratio, _)| ratio < swept.limits.most)
    };
    let has_passed = matches!(&without_departures, Some(Ok(amplitudes)) if keeps_limit(amplitudes));
    let cause = cause::cause((&point, spin), step_s, &swept, has_passed, growing);
    let tongues = found.into_iter().zip(closings).zip(ends_in).zip(passages);
    let tongues = tongues.map(|(((tongue, closing), ends_in), passages)| {
        (Tongue { closing: Some(closing), ends_in, ..tongue }, passages)
    });
    Ok(Explanation {
        name: plan.name.clone(),
        at,
        seen,
        profile_rpm,
        tongues: tongues.collect(),
        without_departures,
        cause,
        swept,
    })
}

/// A way in which a run's drum turns. Backwards it moves as the mirrored machine does forwards.
struct Direction {
    is_backward: bool,
    /// The machine and its spin, mirrored if the drum turns backwards.
    scenario: Scenario,
    point: Point,
    looked: Speeds,
    /// The profile's fastest speed in this direction (rpm).
    fastest_rpm: f64,
}

/// Returns the ways in which a profile between two speeds (rpm) turns the drum, with the speeds to
/// look at: those that were asked for, or from half of the slowest mode's frequency up.
///
/// # Errors
/// A machine without modes, and a profile that has no speed to look at.
fn directions(
    plan: &Plan,
    scenario: &Scenario,
    point: &Point,
    [least_rpm, most_rpm]: [f64; 2],
    asked: Option<Speeds>,
) -> Result<Vec<Direction>, Error> {
    let slowest_rpm = modes(point, 0.0, 0.0).map_err(Error::model)?.modes[0].frequency_rpm();
    let from_rpm = (LOWEST_SHARE * slowest_rpm).floor().max(1.0);
    let mut directions = Vec::new();
    for (is_backward, fastest_rpm) in [(false, most_rpm), (true, -least_rpm)] {
        let is_turned = fastest_rpm > 0.0 || !is_backward && least_rpm >= 0.0;
        let looked = match asked {
            Some(asked) if is_turned => asked,
            None if fastest_rpm > from_rpm => Speeds::new(from_rpm, fastest_rpm, STEP_RPM),
            _ => continue,
        };
        let scenario = if is_backward { mirrored(scenario) } else { scenario.clone() };
        let point = ready(plan, &scenario).map_err(Error::model)?;
        directions.push(Direction { is_backward, scenario, point, looked, fastest_rpm });
    }
    if directions.is_empty() {
        let fastest_rpm = most_rpm.max(-least_rpm);
        let expected = format!(
            "a profile that exceeds {from_rpm} rpm, half of the slowest mode's frequency, within \
             the run; to look at other speeds, give --speed FROM:TO:STEP"
        );
        return Err(Error::option("[spin]", format!("at most {fastest_rpm:.3} rpm"), expected));
    }
    Ok(directions)
}

/// Returns the mirror image of a machine and its spin.
fn mirrored(scenario: &Scenario) -> Scenario {
    let mut mirrored = scenario.clone();
    mirrored.model.machine = scenario.model.machine.mirrored();
    match &mut mirrored.model.spin {
        Spin::Ramped { peak_rpm, .. } => *peak_rpm = -*peak_rpm,
        Spin::Table { speed_rpm, .. } => speed_rpm.iter_mut().for_each(|speed| *speed = -*speed),
    }
    mirrored
}

/// A machine with its spin, ready to be integrated.
fn ready(plan: &Plan, scenario: &Scenario) -> Result<Point, NoEquilibrium> {
    let timing = Timing { window_s: scenario.window_s, ..plan::timing(plan) };
    plan::ready(scenario.model.machine.clone(), scenario.model.spin.clone(), &timing)
}

fn swept(plan: &Plan, interrupt: &Interrupt) -> Result<Swept, Error> {
    let scenario = plan.scenario(0);
    let channels = plan.reliability.channels.clone();
    let (engine, watch) = (ModelEngine::new(plan)?, RunContext::new(interrupt));
    let outcomes = engine.evaluate_in_context(&[Vec::new()], &watch);
    let outcome = outcomes.and_then(|mut outcomes| outcomes.pop());
    // Where it was stopped: nothing.
    let outcome = outcome.unwrap_or_else(|| Outcome::failed(0, Status::Panicked));
    let (status, fail_time_s) = row_status(&outcome);
    let verdict = Verdict::new(&outcome, channels.len(), plan.reliability.limits);
    Ok(Swept {
        channels,
        window_s: scenario.window_s,
        limits: plan.reliability.limits,
        status: ROW_STATUSES[status],
        fail_time_s,
        amplitudes: [outcome.nonlinear.amplitudes, outcome.linear.amplitudes],
        verdict,
    })
}

type WithoutDepartures = Option<Result<Vec<f64>, LeftRange>>;

/// When the run crosses each tongue and what comes of it; and the amplitudes of the run that enters
/// them on their periodic responses.
fn crossings(
    plan: &Plan,
    (point, spin): (&Point, &Spin),
    askers: &[Asker<'_>],
    tongues: &[Tongue],
    swept: &Swept,
) -> (Vec<Vec<Passage>>, WithoutDepartures) {
    let end_s = plan.end_s;
    // In order of time, with the tongue of each.
    let times = tongues.iter().enumerate().flat_map(|(k, tongue)| {
        let [from, to] = tongue.from_to_rpm;
        let band_rpm = if tongue.is_backward { [-to, -from] } else { [from, to] };
        let inside = profile::times_inside_s(spin, end_s, band_rpm);
        inside.into_iter().map(move |from_to_s| (k, from_to_s))
    });
    let mut times: Vec<(usize, [f64; 2])> = times.collect();
    times.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    for i in 1..times.len() {
        // Neighbours share an edge, found twice.
        times[i].1[0] = times[i].1[0].max(times[i - 1].1[1]);
    }
    let mut responses: Vec<[Option<Response>; 2]> = vec![[None, None]; times.len()];
    for asker in askers {
        let is_of_asker =
            |number: &usize| tongues[times[*number].0].is_backward == asker.is_backward;
        let numbers: Vec<usize> = (0..times.len()).filter(is_of_asker).collect();
        let ends_s = numbers.iter().flat_map(|&number| times[number].1);
        let speeds: Vec<f64> = spin.speeds_rpm(ends_s).map(f64::abs).collect();
        let mut found = asker.responses(&speeds).into_iter();
        for number in numbers {
            responses[number] = [found.next().flatten(), found.next().flatten()];
        }
    }
    let crossings: Vec<Crossing<'_>> = times
        .iter()
        .zip(&responses)
        .map(|((k, from_to_s), [entry, exit])| Crossing {
            from_to_s: *from_to_s,
            responses: [entry.as_ref(), exit.as_ref()],
            is_backward: tongues[*k].is_backward,
        })
        .collect();
    if askers.iter().any(|asker| asker.interrupt.stopped()) {
        return (Vec::new(), None);
    }
    let step_s = reference_step_s(&StepSelector::new([(point, spin)], end_s));
    let before_end = |crossing: &&Crossing<'_>| crossing.from_to_s[0] < swept.window_s[1];
    let (crossed, peaks) = rayon::join(
        || cross(point, step_s, &crossings),
        || {
            crossings.iter().find(before_end)?;
            let peaks = peaks_without_departures(point, step_s, &crossings, swept.window_s);
            Some(peaks.map(|peaks| swept.of_plan(&peaks)))
        },
    );
    let mut passages: Vec<Vec<Passage>> = tongues.iter().map(|_| Vec::new()).collect();
    for ((k, from_to_s), crossed) in times.into_iter().zip(crossed) {
        passages[k].push(Passage {
            from_to_s,
            is_cut: from_to_s[1] >= end_s,
            e_folds: profile::e_folds(spin, from_to_s, &tongues[k].growths),
            crossed,
        });
    }
    (passages, peaks)
}

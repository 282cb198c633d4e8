//! The cause of a failure of the linear model at a point: the tongues of instability that its run
//! crosses, and their effect on the run.

mod cause;
pub(crate) mod format;
pub(crate) mod json;
mod profile;
mod tongue;

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use washer_model::{
    Attractor, Channel, Crossing, CrossingEffect, LeftRangeError, Point, PointInput, Response,
    Spin, StepSelector, follow_crossings, modes, peaks_without_departures,
};

use crate::engine::{ModelEngine, reference_step_s, simd_from_environment};
use crate::estimate::LONG_WORK_S;
use crate::map_row::MapRow;
use crate::plan::{Plan, compared_channels, point_input, prepare_input};
use crate::speeds::Speeds;
use sweep_engine::columns::MODEL_NAMES;
use sweep_engine::config::NamedValues;
use sweep_engine::{
    Error, Execution, Interrupt, Progress, ProgressMode, format_duration, tell, threads,
};

pub(crate) use cause::Cause;
use sweep_parameter::RatioLimits;
pub(crate) use tongue::{Closing, ModeResonance, Tongue, TongueEnd};
use tongue::{ResponseFinder, SpeedScan, find_tongues};
use washer_row::Verdict;

/// The step between the speeds at which responses are sought (rpm), unless `--speed` gives another.
/// Basis: the tongues of the paper's machine are wider. Doubling it halves the time and misses
/// tongues of up to twice the width.
const DEFAULT_SPEED_STEP_RPM: f64 = 1.0;

/// The lowest speed at which responses are sought, as a share of the slowest mode's frequency,
/// unless `--speed` gives another. Basis: parametric resonances of a mode of frequency f are at
/// 2 f / k, and the one for k = 4 is at 0.5 f. Doubling it leaves out the third and the fourth.
const LOWEST_SPEED_RATIO: f64 = 0.5;

/// The maximum time of the whole command, as a multiple of the time of the scan. Basis: 2.4 for the
/// machine of docs/examples/friction.toml at 0.4 kg. Doubling it doubles the announced time.
const TOTAL_WORK_FACTOR: f64 = 3.0;

/// The least time (s) of a command that is announced. Basis: a user does not wonder before.
/// Doubling it announces fewer commands.
const ANNOUNCED_TIME_S: f64 = 10.0;

/// The tongues of a point, and how they affect its verdict.
pub(crate) struct Explanation {
    /// The grid's name.
    pub(crate) name: String,
    /// The values of the parameters of the point, by name.
    pub(crate) parameters: NamedValues,
    /// The row of the point in a map.
    pub(crate) map_result: MapResult,
    /// The scans over speed, one for each direction in which the drum turns, forwards first.
    pub(crate) scans: Vec<SpeedScan>,
    /// The lowest and the greatest speed of the profile within the run (rpm), negative backwards.
    pub(crate) profile_rpm: [f64; 2],
    /// The tongues, each with its passages in order of time.
    pub(crate) tongues: Vec<(Tongue, Vec<Passage>)>,
    /// The amplitudes, by channel of the plan, of the same run when it is put on the periodic
    /// response at the entry of each tongue; `None` if no tongue is crossed before the window ends.
    pub(crate) without_departures: Option<Result<Vec<f64>, LeftRangeError>>,
    /// The deviation of the models, and the share of it that growth in tongues explains; `None`
    /// without a ratio.
    pub(crate) cause: Option<Cause>,
}

/// The row of a point in a map.
pub(crate) struct MapResult {
    pub(crate) channels: Vec<Channel>,
    pub(crate) window_s: [f64; 2],
    pub(crate) limits: RatioLimits,
    /// The status of the row, by its name in result files.
    pub(crate) status: &'static str,
    pub(crate) fail_time_s: Option<f64>,
    /// The amplitudes of the nonlinear and of the linear model, by channel; empty for a model whose
    /// integration failed.
    pub(crate) amplitudes: [Vec<f64>; 2],
    pub(crate) verdict: Verdict,
}

impl MapResult {
    /// Returns the peaks of the plan's channels, out of those of all channels.
    pub(crate) fn plan_channels(&self, peaks: &[f64; Channel::ALL.len()]) -> Vec<f64> {
        self.channels.iter().map(|channel| peaks[channel.index()]).collect()
    }

    /// Returns the greatest ratio of given nonlinear amplitudes to those of the linear model.
    pub(crate) fn greatest_ratio(&self, nonlinear: &[f64]) -> Option<(f64, Channel)> {
        let amplitude_pairs = nonlinear.iter().zip(&self.amplitudes[1]).zip(&self.channels);
        let ratios = amplitude_pairs
            .filter(|((_, linear), _)| **linear != 0.0)
            .map(|((nonlinear, linear), channel)| (nonlinear / linear, *channel));
        ratios.reduce(|greatest, ratio| if ratio.0 > greatest.0 { ratio } else { greatest })
    }
}

/// A stretch of time in which the profile is inside a tongue.
pub(crate) struct Passage {
    /// The times of entry and exit (s).
    pub(crate) interval_s: [f64; 2],
    /// Whether the run ends inside the tongue.
    pub(crate) ends_inside: bool,
    /// The integral over the passage of the growth at the speed of each instant.
    pub(crate) e_folds: f64,
    /// The growth of disturbances in the passage.
    pub(crate) effect: Result<CrossingEffect, LeftRangeError>,
}

/// Explains the verdict of a plan's only point. Once the interrupt is raised it ends early, and the
/// result is meaningless.
///
/// # Errors
/// Returns an error if the profile reaches no speed at which responses are sought, if the machine
/// has no equilibrium or no modes, and if this processor lacks the instruction set.
pub(crate) fn explain(
    plan: &Plan,
    parameters: NamedValues,
    speeds: Option<Speeds>,
    execution: Execution<'_>,
) -> Result<Explanation, Error> {
    threads::build_pool(execution.threads()?)?
        .install(|| explain_in_pool(plan, parameters, speeds, execution))
}

fn explain_in_pool(
    plan: &Plan,
    parameters: NamedValues,
    speeds: Option<Speeds>,
    Execution { progress: progress_mode, interrupt, .. }: Execution<'_>,
) -> Result<Explanation, Error> {
    let simd = simd_from_environment()?;
    let input = point_input(plan, &plan.axis_values(0));
    let spin = &input.spin;
    let profile_rpm = profile::speed_range_rpm(spin, plan.end_s);
    let point = prepare_input(plan, &input).map_err(Error::model)?;
    let directions = find_directions(plan, &input, &point, profile_rpm, speeds)?;
    // The total is that of the scans. The searches after them take a number of speeds that is not
    // known beforehand.
    let speed_count = |direction: &TurningDirection| direction.speeds_to_scan.values().len() as u64;
    let total_speeds: u64 = directions.iter().map(speed_count).sum();
    let speeds_done = AtomicU64::new(0);
    let progress = Progress::for_search(progress_mode, total_speeds, "speeds looked at", 0);
    let count_speeds = |speeds: usize| {
        let speeds_done = speeds_done.fetch_add(speeds as u64, Ordering::Relaxed) + speeds as u64;
        progress.show_search(speeds_done.min(total_speeds), speeds_done);
    };
    count_speeds(0);
    let mut finders = Vec::with_capacity(directions.len());
    for direction in &directions {
        let mut finder = ResponseFinder {
            simd,
            plan,
            input: &direction.input,
            point: &direction.point,
            is_backward: direction.is_backward,
            interrupt,
            count_speeds: &count_speeds,
            curves: Vec::new(),
        };
        finder.follow_curves(direction.speeds_to_scan.to_rpm.max(direction.fastest_rpm));
        finders.push(finder);
    }
    if progress_mode != ProgressMode::None {
        let finders_and_directions = finders.iter().zip(&directions);
        let thread_s: f64 = finders_and_directions
            .map(|(finder, direction)| {
                speed_count(direction) as f64 * finder.seconds_per_speed(direction.speeds_to_scan)
            })
            .sum();
        let scan_s = thread_s / rayon::current_num_threads() as f64;
        announce_long_scan(total_speeds, scan_s).iter().for_each(|line| tell(line));
    }
    let run_scans = || {
        finders
            .iter()
            .zip(&directions)
            .map(|(finder, direction)| find_tongues(finder, direction.speeds_to_scan))
            .collect::<Vec<_>>()
    };
    let (scan_results, map_result) =
        rayon::join(run_scans, || evaluate_map_result(plan, interrupt));
    let (tongues, scans): (Vec<Vec<Tongue>>, Vec<SpeedScan>) = scan_results.into_iter().unzip();
    let tongues: Vec<Tongue> = tongues.into_iter().flatten().collect();
    let map_result = map_result?;
    let finder_for = |tongue: &Tongue| {
        let has_same_direction =
            |finder: &&ResponseFinder<'_>| finder.is_backward == tongue.is_backward;
        finders.iter().find(has_same_direction).unwrap_or(&finders[0])
    };
    let find_all_endings = || -> Vec<Option<Attractor>> {
        let tongues_by_direction = tongues.chunk_by(|a, b| a.is_backward == b.is_backward);
        let find_endings =
            |tongues: &[Tongue]| tongue::find_endings(finder_for(&tongues[0]), tongues);
        tongues_by_direction.flat_map(find_endings).collect()
    };
    let find_all_crossings =
        || find_crossings(plan, (&point, spin), &finders, &tongues, &map_result);
    let find_all_closings =
        || tongues.par_iter().map(|tongue| tongue.find_closing(finder_for(tongue)));
    let ((crossing_results, endings), closings) = rayon::join(
        || rayon::join(find_all_crossings, find_all_endings),
        || find_all_closings().collect::<Vec<_>>(),
    );
    let (passages, without_departures) = crossing_results;
    let step_s = reference_step_s(&StepSelector::new([(&point, spin)], plan.end_s));
    let growing_passages = tongues.iter().zip(&passages).flat_map(|(tongue, passages)| {
        passages.iter().map(|passage| (passage, tongue.growths.as_slice()))
    });
    let is_below_limit = |amplitudes: &Vec<f64>| {
        map_result
            .greatest_ratio(amplitudes)
            .is_some_and(|(ratio, _)| ratio < map_result.limits.upper)
    };
    let deviation_has_passed =
        matches!(&without_departures, Some(Ok(amplitudes)) if is_below_limit(amplitudes));
    let cause = cause::find_cause(
        (&point, spin),
        step_s,
        &map_result,
        deviation_has_passed,
        growing_passages,
    );
    let tongues = tongues.into_iter().zip(closings).zip(endings).zip(passages);
    let tongues = tongues.map(|(((tongue, closing), ending), passages)| {
        (Tongue { closing: Some(closing), ending, ..tongue }, passages)
    });
    Ok(Explanation {
        name: plan.name.clone(),
        parameters,
        scans,
        profile_rpm,
        tongues: tongues.collect(),
        without_departures,
        cause,
        map_result,
    })
}

/// Returns the time of a scan over a number of speeds, if a user notices it, and what makes a long
/// one shorter.
fn announce_long_scan(speeds: u64, scan_s: f64) -> Option<String> {
    let total_s = TOTAL_WORK_FACTOR * scan_s;
    if total_s < ANNOUNCED_TIME_S {
        return None;
    }
    let scan_text = format_duration(scan_s);
    let total_text = format_duration(total_s);
    let mut text = format!(
        "{speeds} speeds take about {scan_text}; the edges, endings and remedies of unstable \
         bands may add to {total_text}"
    );
    if total_s > LONG_WORK_S {
        text += "\nit is shorter with fewer speeds (--speed FROM:TO:STEP)";
    }
    Some(text)
}

/// A direction in which the drum turns in a run. A machine that turns backwards moves like its
/// mirror image that turns forwards.
struct TurningDirection {
    is_backward: bool,
    /// The machine and its spin, mirrored if the drum turns backwards.
    input: PointInput,
    point: Point,
    /// The speeds at which responses are sought.
    speeds_to_scan: Speeds,
    /// The greatest speed of the profile in this direction (rpm).
    fastest_rpm: f64,
}

/// Returns the directions in which a profile between two speeds (rpm) turns the drum, with the
/// speeds at which responses are sought: `requested`, or those from half of the slowest mode's
/// frequency up.
///
/// # Errors
/// Returns an error if the machine has no modes, or if the profile reaches none of these speeds.
fn find_directions(
    plan: &Plan,
    input: &PointInput,
    point: &Point,
    [lowest_rpm, highest_rpm]: [f64; 2],
    requested_speeds: Option<Speeds>,
) -> Result<Vec<TurningDirection>, Error> {
    let slowest_rpm = modes(point, 0.0, 0.0).map_err(Error::model)?.modes[0].frequency_rpm();
    let from_rpm = (LOWEST_SPEED_RATIO * slowest_rpm).floor().max(1.0);
    let mut directions = Vec::new();
    for (is_backward, fastest_rpm) in [(false, highest_rpm), (true, -lowest_rpm)] {
        let turns_this_way = fastest_rpm > 0.0 || !is_backward && lowest_rpm >= 0.0;
        let speeds_to_scan = match requested_speeds {
            Some(requested_speeds) if turns_this_way => requested_speeds,
            None if fastest_rpm > from_rpm => {
                Speeds::new(from_rpm, fastest_rpm, DEFAULT_SPEED_STEP_RPM)
            }
            _ => continue,
        };
        let input = if is_backward { mirror_input(input) } else { input.clone() };
        let point = prepare_input(plan, &input).map_err(Error::model)?;
        directions.push(TurningDirection {
            is_backward,
            input,
            point,
            speeds_to_scan,
            fastest_rpm,
        });
    }
    if directions.is_empty() {
        let fastest_rpm = highest_rpm.max(-lowest_rpm);
        let expected = format!(
            "a profile that exceeds {from_rpm} rpm, half of the slowest mode's frequency, within \
             the run; to look at other speeds, give --speed FROM:TO:STEP"
        );
        return Err(Error::option("[spin]", format!("at most {fastest_rpm:.3} rpm"), expected));
    }
    Ok(directions)
}

/// Returns the mirror image of a machine and its spin.
fn mirror_input(input: &PointInput) -> PointInput {
    let mut mirrored = input.clone();
    mirrored.machine = input.machine.mirrored();
    match &mut mirrored.spin {
        Spin::Ramped { peak_rpm, .. } => *peak_rpm = -*peak_rpm,
        Spin::Table { speed_rpm, .. } => speed_rpm.iter_mut().for_each(|speed| *speed = -*speed),
    }
    mirrored
}

/// Computes the row of the plan's only point. Once the interrupt is raised, the result is
/// meaningless.
fn evaluate_map_result(plan: &Plan, interrupt: &Interrupt) -> Result<MapResult, Error> {
    let engine = ModelEngine::new(plan)?;
    let row = engine.evaluate_only_point(interrupt);
    let amplitudes_of_model =
        |model| row.as_ref().map_or_else(Vec::new, |row| row.amplitudes(model));
    Ok(MapResult {
        channels: compared_channels(plan),
        window_s: plan.window_at(&plan.axis_values(0)),
        limits: plan.reliability.limits,
        status: row.as_ref().map_or("", MapRow::status),
        fail_time_s: row.as_ref().and_then(|row| row.number("fail_time_s")),
        amplitudes: MODEL_NAMES.map(amplitudes_of_model),
        verdict: row.as_ref().map(MapRow::verdict).unwrap_or_default(),
    })
}

/// The type of [`Explanation::without_departures`].
type WithoutDepartures = Option<Result<Vec<f64>, LeftRangeError>>;

/// Returns the passages of the run through each tongue, and the amplitudes of the same run when it
/// is put on the periodic response at the entry of each tongue.
fn find_crossings(
    plan: &Plan,
    (point, spin): (&Point, &Spin),
    finders: &[ResponseFinder<'_>],
    tongues: &[Tongue],
    map_result: &MapResult,
) -> (Vec<Vec<Passage>>, WithoutDepartures) {
    let end_s = plan.end_s;
    // Each passage has the number of its tongue; the passages are in order of time.
    let intervals = tongues.iter().enumerate().flat_map(|(k, tongue)| {
        let [from, to] = tongue.range_rpm;
        let band_rpm = if tongue.is_backward { [-to, -from] } else { [from, to] };
        let intervals_s = profile::intervals_inside_s(spin, end_s, band_rpm);
        intervals_s.into_iter().map(move |interval_s| (k, interval_s))
    });
    let mut intervals: Vec<(usize, [f64; 2])> = intervals.collect();
    intervals.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    for i in 1..intervals.len() {
        // Adjacent tongues share an edge that was located twice, with an error each.
        intervals[i].1[0] = intervals[i].1[0].max(intervals[i - 1].1[1]);
    }
    let mut responses: Vec<[Option<Response>; 2]> = vec![[None, None]; intervals.len()];
    for finder in finders {
        let is_in_direction =
            |number: &usize| tongues[intervals[*number].0].is_backward == finder.is_backward;
        let interval_numbers: Vec<usize> = (0..intervals.len()).filter(is_in_direction).collect();
        let ends_s = interval_numbers.iter().flat_map(|&number| intervals[number].1);
        let speeds: Vec<f64> = spin.speeds_rpm(ends_s).map(f64::abs).collect();
        let mut end_responses = finder.find_responses(&speeds).into_iter();
        for number in interval_numbers {
            responses[number] = [end_responses.next().flatten(), end_responses.next().flatten()];
        }
    }
    let crossings: Vec<Crossing<'_>> = intervals
        .iter()
        .zip(&responses)
        .map(|((k, interval_s), [entry, exit])| Crossing {
            interval_s: *interval_s,
            responses: [entry.as_ref(), exit.as_ref()],
            is_backward: tongues[*k].is_backward,
        })
        .collect();
    if finders.iter().any(|finder| finder.interrupt.is_raised()) {
        return (Vec::new(), None);
    }
    let step_s = reference_step_s(&StepSelector::new([(point, spin)], end_s));
    let begins_before_window_end =
        |crossing: &&Crossing<'_>| crossing.interval_s[0] < map_result.window_s[1];
    let (effects, peaks) = rayon::join(
        || follow_crossings(point, step_s, &crossings),
        || {
            crossings.iter().find(begins_before_window_end)?;
            let peaks = peaks_without_departures(point, step_s, &crossings, map_result.window_s);
            Some(peaks.map(|peaks| map_result.plan_channels(&peaks)))
        },
    );
    let mut passages: Vec<Vec<Passage>> = tongues.iter().map(|_| Vec::new()).collect();
    for ((k, interval_s), effect) in intervals.into_iter().zip(effects) {
        passages[k].push(Passage {
            interval_s,
            ends_inside: interval_s[1] >= end_s,
            e_folds: profile::e_folds(spin, interval_s, &tongues[k].growths),
            effect,
        });
    }
    (passages, peaks)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_scan_is_announced_with_what_makes_it_shorter() {
        assert_eq!(announce_long_scan(20, 1.0), None);
        let text = announce_long_scan(296, 25.0).expect("it is noticed");
        assert_eq!(
            text,
            "296 speeds take about 25 s; the edges, endings and remedies of unstable bands may add \
             to 1 min 15 s"
        );
        let text = announce_long_scan(296, 3600.0).expect("it is noticed");
        assert!(text.contains("3 h 00 min\n") && text.contains("--speed FROM:TO:STEP"), "{text}");
    }
}

//! The tongues of a point, which are ranges of speed in which its periodic response is unstable:
//! their edges, their frequencies, and the damping that closes them.

use lane_ode::{Cancel, Simd};
use rayon::iter::ParallelIterator as _;
use rayon::slice::ParallelSlice as _;
use serde::Serialize;
use washer_model::{
    Attractor, GeometryLimit, HeldSpeed, Point, PointInput, Response, ResponseCurves,
    StabilityKind, StartRule, find_attractors_from_responses, modes,
};

use crate::plan::{Plan, prepare_input};
use crate::speeds::Speeds;
use sweep_engine::Interrupt;

/// The number of speeds whose responses are computed together. Basis: several times the number of
/// lanes. Doubling it leaves threads without work at the end of a short scan.
const SPEEDS_PER_BATCH: usize = 32;

/// The width (rpm) of the bracket at which the search for an edge ends. Basis: edges are reported
/// with two decimals. Doubling it saves less than one round of a search.
const EDGE_TOLERANCE_RPM: f64 = 0.01;

/// The number of trial speeds between two others in one round of a search. Basis: they fill the
/// lanes. Doubling it saves a round in four and doubles the work of each.
const TRIALS_PER_INTERVAL: usize = 8;

/// The number of rounds of the search for the greatest growth between the scanned speeds. Basis:
/// two rounds locate it within a twentieth of a step. Doubling it refines that to 1/400.
const PEAK_ROUND_COUNT: usize = 2;

/// The number of speeds at which growth is computed in a trial of stronger dampers. Basis: growth
/// over a tongue has one maximum, which further rounds refine. Doubling it doubles the time of a
/// trial.
const SPEEDS_PER_DAMPING_TRIAL: usize = 24;

/// The margin on each side of a tongue in which a trial looks for growth, as a share of the width.
/// Basis: it leaves room for a tongue that moves with the damping. Doubling it spreads the trial
/// speeds.
const DAMPING_TRIAL_MARGIN_RATIO: f64 = 0.25;

/// The rate (1/s) at which all disturbances must decay, at the speeds of a trial, for a tongue to
/// count as closed. Basis: between two of these speeds the growth exceeds that at them by less.
/// Doubling it raises the damping that is reported slightly.
const CLOSED_DECAY_PER_S: f64 = 5e-4;

/// The maximum factor by which dampers are made stronger. Basis: no machine has such dampers.
/// Doubling it adds a round to searches that fail.
const MAX_DAMPING_FACTOR: f64 = 32.0;

/// The number of factors of the damping in one round of trials. Basis: their machines share the
/// lanes. Doubling it doubles the work of a round.
const FACTORS_PER_ROUND: usize = 4;

/// The ratio of two successive factors while none closes the tongue. Basis: one round reaches 5.8
/// times the damping. Doubling it leaves a wider bracket to the next round.
const DAMPING_FACTOR_RATIO: f64 = 1.55;

/// The relative width of the bracket at which the search for the factor ends. Basis: factors are
/// reported with three digits. Doubling it saves less than one round.
const DAMPING_FACTOR_TOLERANCE: f64 = 5e-4;

/// The maximum number of speeds by which the time of a scan is estimated. Basis: the lanes of the
/// widest instruction set. Doubling it doubles the time of an estimate.
const MAX_TIMED_SPEEDS: usize = 8;

/// The positions of trials about the root that linear interpolation gives, in tolerances. Basis:
/// the inner two bracket the root within the tolerance if growth is nearly linear, and the outer
/// two if it is less so. Doubling them needs another round where growth is linear.
const ROOT_OFFSETS: [f64; 4] = [-8.0, -0.4, 0.4, 8.0];

/// The number of modes, from the slowest, that may take part in a resonance: those of the
/// suspension. Doubling it admits the modes of the bearings and of the hinge.
const SUSPENSION_MODE_COUNT: usize = 4;

/// The maximum multiple of the speed at which frequencies may meet. Basis: the growth of parametric
/// resonances falls with their order. Doubling it finds multiples by chance.
const MAX_ORDER: u32 = 3;

/// Maximum relative distance of a sum of frequencies from a multiple of the speed. Basis: the
/// frequencies are those of the linear model, and an unstable motion has others. Doubling it finds
/// multiples by chance.
const MAX_RESONANCE_DISTANCE: f64 = 0.05;

/// The periodic responses of one machine over speed, computed where they are requested.
pub(crate) struct ResponseFinder<'a> {
    pub(crate) simd: Simd,
    pub(crate) plan: &'a Plan,
    pub(crate) input: &'a PointInput,
    pub(crate) point: &'a Point,
    /// Whether the machine is the mirror image of one whose drum turns backwards.
    pub(crate) is_backward: bool,
    /// The interrupt. Once it is raised, no response is found, and results are meaningless.
    pub(crate) interrupt: &'a Interrupt,
    /// A function that is called with the number of speeds that are done.
    pub(crate) count_speeds: &'a (dyn Fn(usize) + Sync),
    /// The curve of responses over speed, once it is followed.
    pub(crate) curves: Vec<ResponseCurves<'a>>,
}

impl ResponseFinder<'_> {
    /// Follows the curve of responses up to a speed (rpm).
    pub(crate) fn follow_curves(&mut self, fastest_rpm: f64) {
        let cancel = Cancel::Flag(self.interrupt.flag());
        self.curves = ResponseCurves::continue_curves(&[(self.point, fastest_rpm)], None, cancel);
    }

    /// Measures the time (s) of one thread for the response at a speed, by a few of the speeds.
    pub(crate) fn seconds_per_speed(&self, speeds: Speeds) -> f64 {
        let speeds_rpm = speeds.values();
        let stride = speeds_rpm.len().div_ceil(MAX_TIMED_SPEEDS);
        let timed_speeds: Vec<(usize, f64)> =
            speeds_rpm.iter().step_by(stride).map(|&speed_rpm| (0, speed_rpm)).collect();
        let cancel = Cancel::Flag(self.interrupt.flag());
        let start_time = std::time::Instant::now();
        ResponseCurves::find_at_speeds(&mut self.curves.clone(), &timed_speeds, cancel);
        start_time.elapsed().as_secs_f64() / timed_speeds.len() as f64
    }

    /// Returns the response of a machine that runs up at each speed, if there is one. It uses all
    /// threads.
    pub(crate) fn find_responses(&self, speeds_rpm: &[f64]) -> Vec<Option<Response>> {
        let find_batch = |speeds: &[f64]| {
            let requests: Vec<(usize, f64)> =
                speeds.iter().map(|&speed_rpm| (0, speed_rpm)).collect();
            let cancel = Cancel::Flag(self.interrupt.flag());
            if cancel.is_requested() {
                return vec![None; speeds.len()];
            }
            let results =
                ResponseCurves::find_at_speeds(&mut self.curves.clone(), &requests, cancel);
            (self.count_speeds)(results.len());
            let first_response = |answer: Result<Vec<_>, _>| answer.ok()?.into_iter().next();
            results.into_iter().map(first_response).collect::<Vec<_>>()
        };
        let batches: Vec<_> = speeds_rpm.par_chunks(SPEEDS_PER_BATCH).map(find_batch).collect();
        batches.into_iter().flatten().collect()
    }
}

/// The reason why a tongue ends at a speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum TongueEnd {
    /// The growth is 0, and the response is stable beyond.
    Edge,
    /// The response beyond has another kind of instability.
    OtherKind,
    /// The range of the scan ends.
    Range,
    /// No response was found beyond.
    NoResponse,
}

/// A range of speeds in which the response has one kind of instability.
pub(crate) struct Tongue {
    /// Whether the drum turns backwards.
    pub(crate) is_backward: bool,
    /// The speeds (rpm) of the lower and of the upper edge.
    pub(crate) range_rpm: [f64; 2],
    /// The reasons why the tongue ends at the lower and at the upper edge.
    pub(crate) ends: [TongueEnd; 2],
    /// Pairs of speed (rpm) and growth (1/s) in order of speed, from edge to edge.
    pub(crate) growths: Vec<[f64; 2]>,
    /// The response with the greatest growth.
    pub(crate) fastest_response: Response,
    /// The resonance of modes at this response, if there is one.
    pub(crate) resonance: Option<ModeResonance>,
    /// The damping that closes the tongue, once it is searched for.
    pub(crate) closing: Option<Closing>,
    /// The motion of a drum held at the speed of the greatest growth, once it is computed.
    pub(crate) ending: Option<Attractor>,
}

/// Two frequencies of modes, or one twice, whose sum or difference is a multiple of the speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct ModeResonance {
    /// The numbers of the modes, from 1; equal for one mode.
    pub(crate) modes: [usize; 2],
    /// The frequencies of the modes (cycles per minute).
    pub(crate) frequencies_cpm: [f64; 2],
    /// The sign of the second frequency: 1 in a sum, -1 in a difference.
    pub(crate) sign: f64,
    /// The sum or difference (cycles per minute).
    pub(crate) sum_cpm: f64,
    /// The multiple of the speed that the sum is near.
    pub(crate) order: u32,
}

/// The damping that closes a tongue, so that no disturbance grows at its speeds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub(crate) enum Closing {
    /// A common factor of all dampers, which a trial has confirmed.
    Factor {
        /// The factor by which every damper is made stronger.
        #[serde(rename = "damping_factor")]
        factor: f64,
        /// The resulting damping of each damper, if all have the same.
        damping_n_s_per_m: Option<f64>,
        /// The lowest and the greatest speed (rpm) of the trial.
        #[serde(rename = "nothing_grows_from_to_rpm")]
        stable_rpm: [f64; 2],
    },
    /// No factor up to the greatest one that was tried.
    NotUpTo {
        /// The greatest factor that was tried.
        #[serde(rename = "damping_factor_above")]
        factor: f64,
    },
    /// The machine has no damping.
    NoDampers,
}

/// The responses over a range of speeds, apart from the tongues in it.
pub(crate) struct SpeedScan {
    /// Whether the drum turns backwards.
    pub(crate) is_backward: bool,
    /// The speeds at which responses were sought.
    pub(crate) speeds: Speeds,
    /// The number of these speeds without a response.
    pub(crate) without_response: usize,
    /// The speeds (rpm) of the folds at which a machine that runs up leaves its branch of
    /// responses.
    pub(crate) jumps_rpm: Vec<f64>,
    /// The speeds (rpm) at which the response is not on the curve of a machine that runs up.
    pub(crate) off_curve_rpm: Vec<f64>,
    /// The speeds (rpm) at which the response exceeds a limit of the machine's geometry, each with
    /// the limit.
    pub(crate) exceeded_limits: Vec<(f64, GeometryLimit)>,
}

/// Finds the tongues within a range of speeds.
pub(crate) fn find_tongues(
    finder: &ResponseFinder<'_>,
    speeds: Speeds,
) -> (Vec<Tongue>, SpeedScan) {
    let responses = finder.find_responses(&speeds.values());
    let found_responses = || responses.iter().flatten();
    let on_curve = found_responses().filter(|response| response.is_on_curve);
    let fold_speeds = on_curve.filter_map(|response| response.fold_speeds_rpm[1]);
    let mut jumps_rpm: Vec<f64> = fold_speeds.filter(|&rpm| rpm <= speeds.to_rpm).collect();
    jumps_rpm.dedup();
    let kind_of = |response: &Option<Response>| response.as_ref().map(Response::kind);
    let mut tongues = Vec::new();
    let mut next_index = 0_usize;
    for responses_of_kind in responses.chunk_by(|a, b| kind_of(a) == kind_of(b)) {
        let response_before = next_index.checked_sub(1).map(|last| &responses[last]);
        next_index += responses_of_kind.len();
        let unstable_kind =
            kind_of(&responses_of_kind[0]).filter(|kind| *kind != StabilityKind::Stable);
        let Some(unstable_kind) = unstable_kind else { continue };
        let unstable_responses: Vec<&Response> = responses_of_kind.iter().flatten().collect();
        let locate_edge = |inside: &Response, outside: Option<&Option<Response>>| match outside {
            None => (inside.speed_rpm, TongueEnd::Range),
            Some(None) => (inside.speed_rpm, TongueEnd::NoResponse),
            Some(Some(other)) => {
                let is_stable = other.kind() == StabilityKind::Stable;
                let inside = speed_and_growth(inside);
                let rpm = find_edge_rpm(finder, unstable_kind, inside, speed_and_growth(other));
                (rpm, if is_stable { TongueEnd::Edge } else { TongueEnd::OtherKind })
            }
        };
        let lower_edge = locate_edge(unstable_responses[0], response_before);
        let upper_edge = locate_edge(
            unstable_responses[unstable_responses.len() - 1],
            responses.get(next_index),
        );
        tongues.push(measure_tongue(
            finder,
            unstable_kind,
            &unstable_responses,
            [lower_edge, upper_edge],
        ));
    }
    let without_response = responses.iter().filter(|response| response.is_none()).count();
    let exceeded_limit = |response: &Response| Some((response.speed_rpm, response.exceeded_limit?));
    let exceeded_limits = found_responses().filter_map(exceeded_limit).collect();
    let off_curve = found_responses().filter(|response| !response.is_on_curve);
    let off_curve_rpm = off_curve.map(|response| response.speed_rpm).collect();
    let is_backward = finder.is_backward;
    let scan = SpeedScan {
        is_backward,
        speeds,
        without_response,
        jumps_rpm,
        off_curve_rpm,
        exceeded_limits,
    };
    (tongues, scan)
}

/// Finds the motion in which a drum ends that is held at the speed of each tongue's greatest
/// growth, starting from the slightly disturbed response.
pub(crate) fn find_endings(
    finder: &ResponseFinder<'_>,
    tongues: &[Tongue],
) -> Vec<Option<Attractor>> {
    let held_speed_of = |tongue: &Tongue| HeldSpeed {
        point: finder.point,
        speed_rpm: tongue.fastest_response.speed_rpm,
    };
    let held_speeds: Vec<HeldSpeed<'_>> = tongues.iter().map(held_speed_of).collect();
    let responses =
        tongues.iter().map(|tongue| Ok(vec![tongue.fastest_response.clone()])).collect();
    let starts = StartRule { start_count: 1, ..StartRule::default() };
    let cancel = Cancel::Flag(finder.interrupt.flag());
    let attractors =
        find_attractors_from_responses(finder.simd, &held_speeds, responses, &[], &starts, cancel);
    let first_attractors =
        attractors.into_iter().map(|found| found.ok()?.attractors.into_iter().next());
    first_attractors.collect()
}

/// Returns the tongue of a run of speeds with responses of one kind, between two ends.
fn measure_tongue(
    finder: &ResponseFinder<'_>,
    kind: StabilityKind,
    responses: &[&Response],
    [lower_edge, upper_edge]: [(f64, TongueEnd); 2],
) -> Tongue {
    let mut growths: Vec<[f64; 2]> =
        responses.iter().map(|response| [response.speed_rpm, response.growth_per_s()]).collect();
    for (rpm, end) in [lower_edge, upper_edge] {
        if end == TongueEnd::Edge {
            growths.push([rpm, 0.0]);
        }
    }
    growths.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let fastest_response = find_fastest_response(finder, kind, responses, &growths);
    let speed_rpm = fastest_response.speed_rpm;
    let index = growths.partition_point(|[rpm, _]| *rpm < speed_rpm);
    if growths.get(index).is_none_or(|[rpm, _]| *rpm != speed_rpm) {
        growths.insert(index, speed_and_growth(&fastest_response));
    }
    let resonance = find_nearest_resonance(finder.point, &fastest_response);
    Tongue {
        is_backward: finder.is_backward,
        range_rpm: [lower_edge.0, upper_edge.0],
        ends: [lower_edge.1, upper_edge.1],
        growths,
        fastest_response,
        resonance,
        closing: None,
        ending: None,
    }
}

/// Returns equally spaced speeds between two others, without these.
fn speeds_between(low: f64, high: f64, count: usize) -> Vec<f64> {
    (1..=count).map(|k| low + (high - low) * (k as f64 / (count + 1) as f64)).collect()
}

/// Returns the speed (rpm) of a response and its growth (1/s).
fn speed_and_growth(response: &Response) -> [f64; 2] {
    [response.speed_rpm, response.growth_per_s()]
}

/// Returns trial values between those of `inside` and `outside`, in this order, about the root of
/// the growth. `inside` and `outside` are pairs of a value and its growth; between them the growth
/// is assumed to be linear.
fn trials_about_root(inside: [f64; 2], outside: [f64; 2], tolerance: f64) -> Vec<f64> {
    let linear_root = (inside[1] / (inside[1] - outside[1])).clamp(0.0, 1.0);
    let root = if linear_root.is_nan() { 0.5 } else { linear_root };
    let difference = outside[0] - inside[0];
    let shares_about_root = ROOT_OFFSETS.map(|offset| root + offset * tolerance / difference.abs());
    let mut trial_shares: Vec<f64> =
        shares_about_root.into_iter().filter(|share| *share > 0.0 && *share < 1.0).collect();
    if trial_shares.len() < ROOT_OFFSETS.len() {
        trial_shares.push(0.5);
        trial_shares.sort_by(f64::total_cmp);
    }
    trial_shares.into_iter().map(|share| inside[0] + share * difference).collect()
}

/// Returns the speed (rpm) at which a kind of instability ends, between a speed with this kind and
/// one without. `inside` and `outside` are these speeds (rpm), each with its growth (1/s).
fn find_edge_rpm(
    finder: &ResponseFinder<'_>,
    kind: StabilityKind,
    mut inside: [f64; 2],
    mut outside: [f64; 2],
) -> f64 {
    while (outside[0] - inside[0]).abs() > EDGE_TOLERANCE_RPM {
        let trials = match outside[1] < 0.0 {
            true => trials_about_root(inside, outside, EDGE_TOLERANCE_RPM),
            false => speeds_between(inside[0], outside[0], TRIALS_PER_INTERVAL),
        };
        for (rpm, response) in trials.iter().zip(finder.find_responses(&trials)) {
            let is_inside = response.as_ref().is_some_and(|response| response.kind() == kind);
            let trial = response.as_ref().map_or([*rpm, f64::NAN], speed_and_growth);
            if !is_inside {
                outside = trial;
                break;
            }
            inside = trial;
        }
    }
    0.5 * (inside[0] + outside[0])
}

/// Returns the response of a kind with the greatest growth, at a speed of the run or between two
/// speeds of the run.
fn find_fastest_response(
    finder: &ResponseFinder<'_>,
    kind: StabilityKind,
    responses: &[&Response],
    growths: &[[f64; 2]],
) -> Response {
    let compare_growth =
        |a: &&Response, b: &&Response| a.growth_per_s().total_cmp(&b.growth_per_s());
    let mut fastest: Response =
        (*responses.iter().copied().max_by(compare_growth).unwrap_or(responses[0])).clone();
    let index = growths.partition_point(|[rpm, _]| *rpm < fastest.speed_rpm);
    let speed_at = |k: usize| growths.get(k).map_or(fastest.speed_rpm, |[rpm, _]| *rpm);
    let mut bracket_rpm = [speed_at(index.saturating_sub(1)), speed_at(index + 1)];
    for _ in 0..PEAK_ROUND_COUNT {
        let [low_rpm, high_rpm] = bracket_rpm;
        let trials = speeds_between(low_rpm, high_rpm, TRIALS_PER_INTERVAL);
        for response in finder.find_responses(&trials).into_iter().flatten() {
            if response.kind() == kind && response.growth_per_s() > fastest.growth_per_s() {
                fastest = response;
            }
        }
        let step_rpm = (high_rpm - low_rpm) / (TRIALS_PER_INTERVAL + 1) as f64;
        bracket_rpm = [fastest.speed_rpm - step_rpm, fastest.speed_rpm + step_rpm]
            .map(|rpm| rpm.clamp(low_rpm, high_rpm));
    }
    fastest
}

/// Returns the sum or difference of the modes' frequencies that is nearest to a multiple of the
/// speed. A period doubling admits odd multiples, a fold even ones, and both twice the frequency of
/// one mode.
fn find_nearest_resonance(point: &Point, response: &Response) -> Option<ModeResonance> {
    let frequencies_at_speed = |speed_rpm: f64| -> Option<Vec<f64>> {
        let modes_at_speed = modes(point, 0.0, speed_rpm * core::f64::consts::TAU / 60.0).ok()?;
        Some(modes_at_speed.modes.iter().map(washer_model::Mode::frequency_rpm).collect())
    };
    let frequencies = frequencies_at_speed(response.speed_rpm)?;
    let participants: Vec<usize> =
        response.participating_modes.iter().map(|mode| mode.mode - 1).collect();
    let pairs: Vec<(usize, usize)> = match (response.kind(), participants.as_slice()) {
        (_, []) => return None,
        (StabilityKind::QuasiPeriodic, &[one]) => (0..SUSPENSION_MODE_COUNT)
            .filter(|other| *other != one)
            .map(|other| (one, other))
            .collect(),
        (StabilityKind::QuasiPeriodic, &[one, other, ..]) => vec![(one, other)],
        (_, participants) => participants.iter().map(|&one| (one, one)).collect(),
    };
    let is_admitted_order = |order: &u32| match response.kind() {
        StabilityKind::PeriodDoubling => order % 2 == 1,
        StabilityKind::Fold => order.is_multiple_of(2),
        StabilityKind::QuasiPeriodic | StabilityKind::Stable => true,
    };
    let resonance_of_pair = |(one, other): (usize, usize), sign: f64, order: u32| {
        // Sums name the lower mode first, differences the higher frequency.
        let is_swapped =
            if sign > 0.0 { one > other } else { frequencies[one] < frequencies[other] };
        let modes = if is_swapped { [other, one] } else { [one, other] };
        let frequencies_cpm = modes.map(|mode| frequencies[mode]);
        let sum_cpm = frequencies_cpm[0] + sign * frequencies_cpm[1];
        ModeResonance { modes: modes.map(|mode| mode + 1), frequencies_cpm, sign, sum_cpm, order }
    };
    let orders = || (1..=MAX_ORDER).filter(is_admitted_order);
    let candidates = pairs.iter().flat_map(|&pair| {
        let resonances_of_pair =
            [1.0, -1.0].into_iter().flat_map(|sign| orders().map(move |order| (sign, order)));
        resonances_of_pair.map(move |(sign, order)| resonance_of_pair(pair, sign, order))
    });
    let distance_to_multiple = |resonance: &ModeResonance| {
        let multiple_rpm = f64::from(resonance.order) * response.speed_rpm;
        (resonance.sum_cpm / multiple_rpm - 1.0).abs()
    };
    let nearest =
        candidates.min_by(|a, b| distance_to_multiple(a).total_cmp(&distance_to_multiple(b)));
    nearest.filter(|nearest| distance_to_multiple(nearest) < MAX_RESONANCE_DISTANCE)
}

/// Returns the factors of the damping to try next, between that of `open_trial`, with which the
/// tongue is open, and that of `closed_trial`, with which it is closed, once there is one. A trial
/// is a factor with the growth (1/s) that remains.
fn trial_factors(open_trial: [f64; 2], closed_trial: Option<[f64; 2]>) -> Vec<f64> {
    let growth_above_limit = |[factor, growth]: [f64; 2]| [factor, growth + CLOSED_DECAY_PER_S];
    match closed_trial {
        None => (1..=FACTORS_PER_ROUND)
            .map(|k| open_trial[0] * DAMPING_FACTOR_RATIO.powi(k as i32))
            .collect(),
        Some(closed_trial) => {
            let tolerance = DAMPING_FACTOR_TOLERANCE * open_trial[0];
            trials_about_root(
                growth_above_limit(open_trial),
                growth_above_limit(closed_trial),
                tolerance,
            )
        }
    }
}

impl Tongue {
    /// Searches for the least factor of the damping that closes the tongue. Increasing factors are
    /// tried together until one closes it, and then factors in the bracket that it ends.
    pub(crate) fn find_closing(&self, finder: &ResponseFinder<'_>) -> Closing {
        let dampers = &finder.input.machine.dampers;
        if dampers.iter().all(|damper| damper.damping_n_s_per_m == 0.0) {
            return Closing::NoDampers;
        }
        // A trial is a factor of the damping, with the growth at this factor.
        let mut open_trial = [1.0, self.fastest_response.growth_per_s()];
        let mut closed_trial: Option<[f64; 2]> = None;
        while closed_trial.is_none_or(|closed_trial| {
            closed_trial[0] - open_trial[0] > DAMPING_FACTOR_TOLERANCE * open_trial[0]
        }) {
            let factors = trial_factors(open_trial, closed_trial);
            let growths = self.remaining_growths(finder, &factors);
            for (factor, growth) in factors.into_iter().zip(growths) {
                if growth <= -CLOSED_DECAY_PER_S {
                    closed_trial = Some([factor, growth]);
                    break;
                }
                open_trial = [factor, growth];
            }
            if closed_trial.is_none() && open_trial[0] > MAX_DAMPING_FACTOR {
                return Closing::NotUpTo { factor: MAX_DAMPING_FACTOR };
            }
        }
        let factor = closed_trial.map_or(MAX_DAMPING_FACTOR, |[factor, _]| factor);
        let first_damping = dampers[0].damping_n_s_per_m;
        let is_same_for_all =
            dampers.iter().all(|damper| damper.damping_n_s_per_m == first_damping);
        let damping_n_s_per_m = is_same_for_all.then_some(factor * first_damping);
        Closing::Factor { factor, damping_n_s_per_m, stable_rpm: self.trial_range_rpm() }
    }

    /// Returns the lowest and the greatest speed (rpm) at which growth is sought in machines with
    /// stronger dampers.
    fn trial_range_rpm(&self) -> [f64; 2] {
        let [from, to] = self.range_rpm;
        let margin = DAMPING_TRIAL_MARGIN_RATIO * (to - from) + 1.0;
        [(from - margin).max(0.5 * from), to + margin]
    }

    /// Returns the greatest growth (1/s) about the tongue for each factor of the damping, infinite
    /// if a response is missing. The machines share the lanes.
    fn remaining_growths(&self, finder: &ResponseFinder<'_>, factors: &[f64]) -> Vec<f64> {
        let prepare_with_factor = |factor: f64| {
            let mut input = finder.input.clone();
            for damper in &mut input.machine.dampers {
                damper.damping_n_s_per_m *= factor;
            }
            prepare_input(finder.plan, &input).ok()
        };
        let points: Vec<Option<Point>> =
            factors.iter().map(|&factor| prepare_with_factor(factor)).collect();
        let range_rpm = self.trial_range_rpm();
        let cancel = Cancel::Flag(finder.interrupt.flag());
        let points_and_speeds: Vec<(&Point, f64)> =
            points.iter().flatten().map(|point| (point, range_rpm[1])).collect();
        // The curves begin below the tongue, at the response of the machine with its own damping.
        let response_below = finder.find_responses(&[range_rpm[0]]).pop().flatten();
        let mut curves =
            ResponseCurves::continue_curves(&points_and_speeds, response_below.as_ref(), cancel);
        let mut growths = vec![f64::NEG_INFINITY; points_and_speeds.len()];
        let mut brackets_rpm = vec![range_rpm; points_and_speeds.len()];
        let mut speed_count = SPEEDS_PER_DAMPING_TRIAL;
        for _ in 0..=PEAK_ROUND_COUNT {
            // A machine with growth at one speed needs no further ones: its tongue is open.
            let may_be_closed =
                (0..points_and_speeds.len()).filter(|&k| growths[k] <= -CLOSED_DECAY_PER_S);
            let requests: Vec<(usize, f64)> = may_be_closed
                .flat_map(|k| {
                    let [low, high] = brackets_rpm[k];
                    let range_ends = if speed_count == SPEEDS_PER_DAMPING_TRIAL {
                        vec![low, high]
                    } else {
                        vec![]
                    };
                    let speeds =
                        range_ends.into_iter().chain(speeds_between(low, high, speed_count));
                    speeds.map(move |rpm| (k, rpm))
                })
                .collect();
            let answers = ResponseCurves::find_at_speeds(&mut curves, &requests, cancel);
            (finder.count_speeds)(answers.len());
            // The speed of a greater growth than before; 0 if this round has none.
            let mut greatest_rpm = vec![0.0; points_and_speeds.len()];
            for ((k, rpm), responses) in requests.into_iter().zip(answers) {
                let first_response =
                    responses.ok().and_then(|responses| responses.into_iter().next());
                let growth =
                    first_response.map_or(f64::INFINITY, |response| response.growth_per_s());
                if growth > growths[k] {
                    growths[k] = growth;
                    greatest_rpm[k] = rpm;
                }
            }
            for (bracket_rpm, rpm) in brackets_rpm.iter_mut().zip(greatest_rpm) {
                let step_rpm = (bracket_rpm[1] - bracket_rpm[0]) / (speed_count + 1) as f64;
                if rpm > 0.0 {
                    *bracket_rpm = [rpm - step_rpm, rpm + step_rpm]
                        .map(|rpm| rpm.clamp(range_rpm[0], range_rpm[1]));
                }
            }
            speed_count = TRIALS_PER_INTERVAL;
        }
        let mut growths = growths.into_iter();
        let next_growth = |point: &Option<Point>| point.as_ref().and_then(|_| growths.next());
        points.iter().map(next_growth).map(|growth| growth.unwrap_or(f64::INFINITY)).collect()
    }
}

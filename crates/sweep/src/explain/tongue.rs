//! Tongues of a point: bands of speed in which its periodic response is unstable, with their edges,
//! their frequencies, and the damping that closes them.

use lane_ode::Simd;
use rayon::iter::ParallelIterator as _;
use rayon::slice::ParallelSlice as _;
use serde::Serialize;
use washer_model::{
    Beyond, Dwell, Ending, Kind, Point, Response, Responses, Starts, endings_beside, modes,
};

use super::ready;
use crate::plan::{Plan, Scenario};
use crate::speeds::Speeds;
use sweep_engine::Interrupt;

/// Speeds that are asked at once: enough to fill lanes.
const AT_ONCE: usize = 32;

/// An edge is looked for until it is between two speeds this close (rpm).
const EDGE_RPM: f64 = 0.01;

/// Speeds between two others, in a search.
const BETWEEN: usize = 8;

/// Rounds in which the largest growth is looked for between its neighbours.
const PEAK_ROUNDS: usize = 2;

/// Speeds of a tongue whose damping is being raised, and how far beyond its edges they go, as a
/// share of its width.
const TRIAL_SPEEDS: usize = 24;
const TRIAL_MARGIN: f64 = 0.25;

/// A machine whose disturbances die at this rate (1/s) everywhere it was looked at is closed: a
/// smaller one may grow between two speeds.
const CLOSED_BY_PER_S: f64 = 5e-4;

/// Dampers are not made stronger than this.
const MOST_DAMPING_FACTOR: f64 = 32.0;

/// Such factors that are tried at once, in lanes, each so many times the last; the one that closes
/// a tongue is found this closely, relative.
const FACTORS: usize = 4;
const FACTOR_STEP: f64 = 1.55;
const FACTOR_TOLERANCE: f64 = 5e-4;

/// Where growth ends is looked for, once it is between two places: by how many tolerances about
/// where that is if growth falls evenly.
const ABOUT_ROOT: [f64; 4] = [-8.0, -0.4, 0.4, 8.0];

/// Modes that may take part.
const SUSPENSION_MODES: usize = 4;

/// Whole multiples of the speed at which frequencies may meet.
const MOST_ORDER: u32 = 3;

/// Frequencies farther than this from a multiple of the speed, relative, explain nothing.
const FARTHEST_MISS: f64 = 0.05;

/// What is asked about, and by which instruction set.
pub(crate) struct Asker<'a> {
    pub(crate) simd: Simd,
    pub(crate) plan: &'a Plan,
    pub(crate) scenario: &'a Scenario,
    pub(crate) point: &'a Point,
    /// Whether these are the mirror image of a machine whose drum turns backwards.
    pub(crate) is_backward: bool,
    /// Once it is raised, no response is found, and what is made of that means nothing.
    pub(crate) interrupt: &'a Interrupt,
    /// Told of so many more speeds that are answered.
    pub(crate) counted: &'a (dyn Fn(usize) + Sync),
    /// The point's responses over speed.
    pub(crate) followed: Vec<Responses<'a>>,
}

impl Asker<'_> {
    /// Follows the point's responses up to a speed (rpm).
    pub(crate) fn follow(&mut self, fastest_rpm: f64) {
        let is_stopped = || self.interrupt.stopped();
        self.followed = Responses::follow(&[(self.point, fastest_rpm)], None, &is_stopped);
    }

    /// The responses at some speeds of a machine that runs up, on all threads; none where there is
    /// none.
    pub(crate) fn responses(&self, speeds_rpm: &[f64]) -> Vec<Option<Response>> {
        let of_part = |speeds: &[f64]| {
            let asked: Vec<(usize, f64)> = speeds.iter().map(|&speed_rpm| (0, speed_rpm)).collect();
            let is_stopped = || self.interrupt.stopped();
            if is_stopped() {
                return vec![None; speeds.len()];
            }
            let found = Responses::at(&mut self.followed.clone(), &asked, &is_stopped);
            (self.counted)(found.len());
            let first = |answer: Result<Vec<_>, _>| answer.ok()?.into_iter().next();
            found.into_iter().map(first).collect::<Vec<_>>()
        };
        let parts: Vec<_> = speeds_rpm.par_chunks(AT_ONCE).map(of_part).collect();
        parts.into_iter().flatten().collect()
    }
}

/// What a tongue ends in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum End {
    /// Growth is 0.
    Edge,
    /// The motion grows on, in another way.
    OtherKind,
    /// The range of speeds ends while it grows.
    Range,
    /// No response was found beyond.
    NoResponse,
}

/// A run of speeds at which the response is unstable in one way.
pub(crate) struct Tongue {
    /// Whether the drum turns backwards.
    pub(crate) is_backward: bool,
    /// Edges (rpm).
    pub(crate) from_to_rpm: [f64; 2],
    /// What they are.
    pub(crate) ends: [End; 2],
    /// Speeds (rpm) and growth there (1/s), in order of speed, edges included.
    pub(crate) growths: Vec<[f64; 2]>,
    /// The response that grows most.
    pub(crate) at: Response,
    /// The frequencies of modes that meet there, if any do.
    pub(crate) resonance: Option<Resonance>,
    /// What closes it; not known at first.
    pub(crate) closing: Option<Closing>,
    /// What the drum held where it grows most ends in; not known at first.
    pub(crate) ends_in: Option<Ending>,
}

/// Two frequencies of modes whose sum or difference is a multiple of the speed; or one, twice.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Resonance {
    /// Numbers of the modes; the same for one mode.
    pub(crate) modes: [usize; 2],
    /// Their frequencies (cycles per minute).
    pub(crate) frequencies_cpm: [f64; 2],
    /// The sign of the second frequency: 1 in a sum, -1 in a difference.
    pub(crate) sign: f64,
    /// Sum or difference (cycles per minute).
    pub(crate) sum_cpm: f64,
    /// Turns of the drum to which the sum belongs.
    pub(crate) order: u32,
}

/// How much more damping closes a tongue: nothing grows then, in any way, about where it was.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub(crate) enum Closing {
    /// Every damper this many times as strong, tried; the damping (N s/m) if all have the same.
    Factor {
        /// How many times.
        #[serde(rename = "damping_factor")]
        factor: f64,
        /// What each damper then has, if all have the same.
        damping_n_s_per_m: Option<f64>,
        /// The speeds (rpm) between which nothing grew.
        #[serde(rename = "nothing_grows_from_to_rpm")]
        looked_rpm: [f64; 2],
    },
    /// Not up to this many times.
    NotUpTo {
        #[serde(rename = "damping_factor_above")]
        factor: f64,
    },
    /// There is no damping to raise.
    NoDampers,
}

/// What is seen over a range of speeds beside tongues.
pub(crate) struct Seen {
    /// Whether the drum turns backwards.
    pub(crate) is_backward: bool,
    /// The speeds that were looked at.
    pub(crate) looked: Speeds,
    /// How many of them have no response.
    pub(crate) without_response: usize,
    /// Speeds (rpm) at which a machine that runs up leaves its branch of responses.
    pub(crate) jumps_rpm: Vec<f64>,
    /// Speeds (rpm) at which the response is not on the curve of a machine that runs up.
    pub(crate) off_curve_rpm: Vec<f64>,
    /// Speeds (rpm) at which the response passes the machine's geometry, and what of it.
    pub(crate) beyond: Vec<(f64, Beyond)>,
}

/// The tongues within a range of speeds, and what else is seen there.
pub(crate) fn tongues(asker: &Asker<'_>, looked: Speeds) -> (Vec<Tongue>, Seen) {
    let speeds = looked.values();
    let responses = asker.responses(&speeds);
    let there = || responses.iter().flatten();
    let on_curve = there().filter(|response| response.is_on_curve);
    let ends = on_curve.filter_map(|response| response.between_rpm[1]);
    let mut jumps_rpm: Vec<f64> = ends.filter(|&rpm| rpm <= looked.to).collect();
    jumps_rpm.dedup();
    let kind = |response: &Option<Response>| response.as_ref().map(Response::kind);
    let mut tongues = Vec::new();
    let mut next = 0_usize;
    for alike in responses.chunk_by(|a, b| kind(a) == kind(b)) {
        let before = next.checked_sub(1).map(|last| &responses[last]);
        next += alike.len();
        let Some(of_run) = kind(&alike[0]).filter(|kind| *kind != Kind::Stable) else { continue };
        let run: Vec<&Response> = alike.iter().flatten().collect();
        let edge = |inside: &Response, beyond: Option<&Option<Response>>| match beyond {
            None => (inside.speed_rpm, End::Range),
            Some(None) => (inside.speed_rpm, End::NoResponse),
            Some(Some(other)) => {
                let is_stable = other.kind() == Kind::Stable;
                let rpm = edge_rpm(asker, of_run, at(inside), at(other));
                (rpm, if is_stable { End::Edge } else { End::OtherKind })
            }
        };
        let (from, to) = (edge(run[0], before), edge(run[run.len() - 1], responses.get(next)));
        tongues.push(tongue(asker, of_run, &run, [from, to]));
    }
    let without_response = responses.iter().filter(|response| response.is_none()).count();
    let beyond = there().filter_map(|it| Some((it.speed_rpm, it.beyond?))).collect();
    let off_curve = there().filter(|response| !response.is_on_curve);
    let off_curve_rpm = off_curve.map(|response| response.speed_rpm).collect();
    let is_backward = asker.is_backward;
    (tongues, Seen { is_backward, looked, without_response, jumps_rpm, off_curve_rpm, beyond })
}

/// What the drum ends in that is held where each of these grows most, slightly disturbed.
pub(crate) fn ends_in(asker: &Asker<'_>, tongues: &[Tongue]) -> Vec<Option<Ending>> {
    let dwell = |of: &Tongue| Dwell { point: asker.point, speed_rpm: of.at.speed_rpm };
    let dwells: Vec<Dwell<'_>> = tongues.iter().map(dwell).collect();
    let responses = tongues.iter().map(|tongue| Ok(vec![tongue.at.clone()])).collect();
    let starts = Starts { count: 1, ..Starts::default() };
    let is_stopped = || asker.interrupt.stopped();
    let found = endings_beside(asker.simd, &dwells, responses, &[], &starts, &is_stopped);
    found.into_iter().map(|found| found.ok()?.motions.into_iter().next()).collect()
}

fn tongue(asker: &Asker<'_>, kind: Kind, run: &[&Response], [from, to]: [(f64, End); 2]) -> Tongue {
    let mut growths: Vec<[f64; 2]> =
        run.iter().map(|response| [response.speed_rpm, response.growth_per_s()]).collect();
    for (rpm, end) in [from, to] {
        if end == End::Edge {
            growths.push([rpm, 0.0]);
        }
    }
    growths.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let at = peak(asker, kind, run, &growths);
    let place = growths.partition_point(|[rpm, _]| *rpm < at.speed_rpm);
    if growths.get(place).is_none_or(|[rpm, _]| *rpm != at.speed_rpm) {
        growths.insert(place, [at.speed_rpm, at.growth_per_s()]);
    }
    let resonance = resonance(asker.point, &at);
    Tongue {
        is_backward: asker.is_backward,
        from_to_rpm: [from.0, to.0],
        ends: [from.1, to.1],
        growths,
        at,
        resonance,
        closing: None,
        ends_in: None,
    }
}

/// Speeds between two others, apart from these.
fn between(low: f64, high: f64, count: usize) -> Vec<f64> {
    (1..=count).map(|k| low + (high - low) * (k as f64 / (count + 1) as f64)).collect()
}

/// The speed (rpm) of a response, and growth there (1/s).
fn at(response: &Response) -> [f64; 2] {
    [response.speed_rpm, response.growth_per_s()]
}

/// Places from `open` to `closed` about where growth ends if it falls evenly between them, as it
/// does over short ways; each is given with the growth there. In their order.
fn about_root(open: [f64; 2], closed: [f64; 2], tolerance: f64) -> Vec<f64> {
    let fall = (open[1] / (open[1] - closed[1])).clamp(0.0, 1.0);
    let share = if fall.is_nan() { 0.5 } else { fall };
    let way = closed[0] - open[0];
    let about = ABOUT_ROOT.map(|by| share + by * tolerance / way.abs());
    let mut shares: Vec<f64> = about.into_iter().filter(|it| *it > 0.0 && *it < 1.0).collect();
    if shares.len() < ABOUT_ROOT.len() {
        shares.push(0.5);
        shares.sort_by(f64::total_cmp);
    }
    shares.into_iter().map(|share| open[0] + share * way).collect()
}

/// Where a kind of instability ends between a speed at which it is there and one at which it is
/// not, each given with the growth there.
fn edge_rpm(asker: &Asker<'_>, kind: Kind, mut inside: [f64; 2], mut outside: [f64; 2]) -> f64 {
    while (outside[0] - inside[0]).abs() > EDGE_RPM {
        let trials = match outside[1] < 0.0 {
            true => about_root(inside, outside, EDGE_RPM),
            false => between(inside[0], outside[0], BETWEEN),
        };
        for (rpm, response) in trials.iter().zip(asker.responses(&trials)) {
            let is_there = response.as_ref().is_some_and(|it| it.kind() == kind);
            let found = response.as_ref().map_or([*rpm, f64::NAN], at);
            if !is_there {
                outside = found;
                break;
            }
            inside = found;
        }
    }
    0.5 * (inside[0] + outside[0])
}

/// The response of a run that grows most, between its speeds too.
fn peak(asker: &Asker<'_>, kind: Kind, run: &[&Response], growths: &[[f64; 2]]) -> Response {
    let most = |a: &&Response, b: &&Response| a.growth_per_s().total_cmp(&b.growth_per_s());
    let mut best: Response = (*run.iter().copied().max_by(most).unwrap_or(run[0])).clone();
    let place = growths.partition_point(|[rpm, _]| *rpm < best.speed_rpm);
    let rpm_at = |k: usize| growths.get(k).map_or(best.speed_rpm, |[rpm, _]| *rpm);
    let mut around = [rpm_at(place.saturating_sub(1)), rpm_at(place + 1)];
    for _ in 0..PEAK_ROUNDS {
        let trials = between(around[0], around[1], BETWEEN);
        let responses = asker.responses(&trials);
        let of_kind = responses.into_iter().flatten().filter(|it| it.kind() == kind);
        for response in of_kind {
            if response.growth_per_s() > best.growth_per_s() {
                best = response;
            }
        }
        let reach = (around[1] - around[0]) / (BETWEEN + 1) as f64;
        around = [best.speed_rpm - reach, best.speed_rpm + reach]
            .map(|rpm| rpm.clamp(around[0], around[1]));
    }
    best
}

/// The sum or difference of the modes' frequencies that is nearest to a multiple of the speed, of
/// those that the kind of instability admits: at half the speed two equal ones or a sum at an odd
/// multiple, at none of it an even multiple.
fn resonance(point: &Point, at: &Response) -> Option<Resonance> {
    let frequencies = |speed_rpm: f64| -> Option<Vec<f64>> {
        let found = modes(point, 0.0, speed_rpm * core::f64::consts::TAU / 60.0).ok()?;
        Some(found.modes.iter().map(washer_model::Mode::frequency_rpm).collect())
    };
    let here = frequencies(at.speed_rpm)?;
    let named: Vec<usize> = at.participants.iter().map(|mode| mode.mode - 1).collect();
    let pairs: Vec<(usize, usize)> = match (at.kind(), named.as_slice()) {
        (_, []) => return None,
        (Kind::QuasiPeriodic, &[one]) => {
            (0..SUSPENSION_MODES).filter(|other| *other != one).map(|other| (one, other)).collect()
        }
        (Kind::QuasiPeriodic, &[one, other, ..]) => vec![(one, other)],
        (_, named) => named.iter().map(|&one| (one, one)).collect(),
    };
    let admits = |order: &u32| match at.kind() {
        Kind::PeriodDoubling => order % 2 == 1,
        Kind::Fold => order.is_multiple_of(2),
        Kind::QuasiPeriodic | Kind::Stable => true,
    };
    let meeting = |(one, other): (usize, usize), sign: f64, order: u32| {
        let is_turned = if sign > 0.0 { one > other } else { here[one] < here[other] };
        let modes = if is_turned { [other, one] } else { [one, other] };
        let frequencies_cpm = modes.map(|mode| here[mode]);
        let sum_cpm = frequencies_cpm[0] + sign * frequencies_cpm[1];
        Resonance { modes: modes.map(|mode| mode + 1), frequencies_cpm, sign, sum_cpm, order }
    };
    let orders = || (1..=MOST_ORDER).filter(admits);
    let all = pairs.iter().flat_map(|&pair| {
        let signed = [1.0, -1.0].into_iter().flat_map(|sign| orders().map(move |at| (sign, at)));
        signed.map(move |(sign, order)| meeting(pair, sign, order))
    });
    let miss = |of: &Resonance| (of.sum_cpm / (f64::from(of.order) * at.speed_rpm) - 1.0).abs();
    let nearest = all.min_by(|a, b| miss(a).total_cmp(&miss(b)));
    nearest.filter(|nearest| miss(nearest) < FARTHEST_MISS)
}

/// Factors to try next, between one that leaves growth and one that does not if that is known, each
/// given with the growth that it leaves.
fn trials(open: [f64; 2], closed: Option<[f64; 2]>) -> Vec<f64> {
    let beyond = |[factor, growth]: [f64; 2]| [factor, growth + CLOSED_BY_PER_S];
    match closed {
        None => (1..=FACTORS).map(|k| open[0] * FACTOR_STEP.powi(k as i32)).collect(),
        Some(closed) => about_root(beyond(open), beyond(closed), FACTOR_TOLERANCE * open[0]),
    }
}

impl Tongue {
    /// The least damping found that closes it: factors are tried side by side, then more closely
    /// about the first that does.
    pub(crate) fn closing(&self, asker: &Asker<'_>) -> Closing {
        let dampers = &asker.scenario.model.machine.dampers;
        if dampers.iter().all(|damper| damper.damping_n_s_per_m == 0.0) {
            return Closing::NoDampers;
        }
        // Factors and the growth that they leave.
        let mut open = [1.0, self.at.growth_per_s()];
        let mut closed: Option<[f64; 2]> = None;
        while closed.is_none_or(|closed| closed[0] - open[0] > FACTOR_TOLERANCE * open[0]) {
            let factors = trials(open, closed);
            let growths = self.growths_left(asker, &factors);
            let tried = factors.iter().zip(growths).map(|(&factor, growth)| [factor, growth]);
            for tried in tried {
                if tried[1] <= -CLOSED_BY_PER_S {
                    closed = Some(tried);
                    break;
                }
                open = tried;
            }
            if closed.is_none() && open[0] > MOST_DAMPING_FACTOR {
                return Closing::NotUpTo { factor: MOST_DAMPING_FACTOR };
            }
        }
        let closed = closed.map_or(MOST_DAMPING_FACTOR, |[factor, _]| factor);
        let first = dampers[0].damping_n_s_per_m;
        let is_common = dampers.iter().all(|damper| damper.damping_n_s_per_m == first);
        let damping_n_s_per_m = is_common.then_some(closed * first);
        Closing::Factor { factor: closed, damping_n_s_per_m, looked_rpm: self.about_rpm() }
    }

    /// The speeds (rpm) at which it is looked for in other machines.
    fn about_rpm(&self) -> [f64; 2] {
        let [from, to] = self.from_to_rpm;
        let margin = TRIAL_MARGIN * (to - from) + 1.0;
        [(from - margin).max(0.5 * from), to + margin]
    }

    /// The most that anything grows about where it is (1/s), for each number of times that dampers
    /// are as strong; infinite where a response is missing. On lanes.
    fn growths_left(&self, asker: &Asker<'_>, factors: &[f64]) -> Vec<f64> {
        let machine = |factor: f64| {
            let mut scenario = asker.scenario.clone();
            for damper in &mut scenario.model.machine.dampers {
                damper.damping_n_s_per_m *= factor;
            }
            ready(asker.plan, &scenario).ok()
        };
        let points: Vec<Option<Point>> = factors.iter().map(|&factor| machine(factor)).collect();
        let about = self.about_rpm();
        let is_stopped = || asker.interrupt.stopped();
        let wanted: Vec<(&Point, f64)> =
            points.iter().flatten().map(|point| (point, about[1])).collect();
        // From below the tongue, on the response of the machine as it is.
        let below = asker.responses(&[about[0]]).pop().flatten();
        let mut followed = Responses::follow(&wanted, below.as_ref(), &is_stopped);
        let mut growths = vec![f64::NEG_INFINITY; wanted.len()];
        let mut around = vec![about; wanted.len()];
        let mut count = TRIAL_SPEEDS;
        for _ in 0..=PEAK_ROUNDS {
            // What is open stays so.
            let places = (0..wanted.len()).filter(|&place| growths[place] <= -CLOSED_BY_PER_S);
            let asked: Vec<(usize, f64)> = places
                .flat_map(|place| {
                    let [low, high] = around[place];
                    let ends = if count == TRIAL_SPEEDS { vec![low, high] } else { vec![] };
                    let speeds = ends.into_iter().chain(between(low, high, count));
                    speeds.map(move |rpm| (place, rpm))
                })
                .collect();
            let found = Responses::at(&mut followed, &asked, &is_stopped);
            (asker.counted)(found.len());
            let mut most_rpm = vec![0.0; wanted.len()];
            for ((place, rpm), responses) in asked.into_iter().zip(found) {
                let first = responses.ok().and_then(|responses| responses.into_iter().next());
                let growth = first.map_or(f64::INFINITY, |response| response.growth_per_s());
                if growth > growths[place] {
                    (growths[place], most_rpm[place]) = (growth, rpm);
                }
            }
            for (around, rpm) in around.iter_mut().zip(most_rpm) {
                let reach = (around[1] - around[0]) / (count + 1) as f64;
                let near = [rpm - reach, rpm + reach].map(|rpm| rpm.clamp(about[0], about[1]));
                *around = if rpm > 0.0 { near } else { *around };
            }
            count = BETWEEN;
        }
        let mut growths = growths.into_iter();
        let of = |point: &Option<Point>| point.as_ref().and_then(|_| growths.next());
        points.iter().map(of).map(|growth| growth.unwrap_or(f64::INFINITY)).collect()
    }
}

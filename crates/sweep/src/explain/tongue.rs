//! Tongues of a point: runs of speeds at which its periodic response is unstable, their edges, the
//! frequencies behind them, and the damping that closes them.

use lane_ode::Simd;
use rayon::iter::ParallelIterator as _;
use rayon::slice::ParallelSlice as _;
use washer_model::{Dwell, Kind, Point, Response, modes, respond};

use super::ready;
use crate::interrupt::Interrupt;
use crate::plan::{Plan, Scenario};
use crate::speeds::Speeds;

/// Speeds that are asked at once: enough to fill lanes.
const AT_ONCE: usize = 16;

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

/// Dampers are not made stronger than this.
const MOST_DAMPING_FACTOR: f64 = 32.0;

/// The factor that closes a tongue is found this closely, relative.
const FACTOR_TOLERANCE: f64 = 1e-3;

/// Modes that may take part.
const SUSPENSION_MODES: usize = 4;

/// Whole multiples of the speed at which frequencies may meet.
const MOST_ORDER: u32 = 3;

/// Frequencies farther than this from a multiple of the speed, relative, explain nothing.
const FARTHEST_MISS: f64 = 0.05;

/// Half of the distance in speed over which frequencies' slopes are taken, as a share of it.
const SLOPE_SHARE: f64 = 0.01;

/// What is asked about, and by which instruction set.
pub(crate) struct Asker<'a> {
    pub(crate) simd: Simd,
    pub(crate) plan: &'a Plan,
    pub(crate) scenario: &'a Scenario,
    pub(crate) point: &'a Point,
    /// Once it is raised, no response is found, and what is made of that means nothing.
    pub(crate) interrupt: &'a Interrupt,
}

impl Asker<'_> {
    /// The responses at some speeds, on all threads; none where there is none.
    pub(crate) fn responses(&self, speeds_rpm: &[f64]) -> Vec<Option<Response>> {
        self.responses_of(self.point, speeds_rpm)
    }

    fn responses_of(&self, point: &Point, speeds_rpm: &[f64]) -> Vec<Option<Response>> {
        let of_part = |speeds: &[f64]| {
            if self.interrupt.stopped() {
                return vec![None; speeds.len()];
            }
            let dwells: Vec<Dwell<'_>> =
                speeds.iter().map(|&speed_rpm| Dwell { point, speed_rpm }).collect();
            respond(&dwells).into_iter().map(Result::ok).collect::<Vec<_>>()
        };
        let parts: Vec<_> = speeds_rpm.par_chunks(AT_ONCE).map(of_part).collect();
        parts.into_iter().flatten().collect()
    }
}

/// What a tongue ends in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
}

/// Two frequencies of modes whose sum or difference is a multiple of the speed; or one, twice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Resonance {
    /// Numbers of the modes; the same for one mode.
    pub(crate) modes: [usize; 2],
    /// Their frequencies (cycles per minute).
    pub(crate) frequencies_cpm: [f64; 2],
    /// Of the second frequency: 1 in a sum, -1 in a difference.
    pub(crate) sign: f64,
    /// Turns of the drum to which the sum belongs.
    pub(crate) order: u32,
    /// How much the sum rises with the speed (cycles per turn).
    pub(crate) slope: f64,
}

impl Resonance {
    /// Sum or difference (cycles per minute).
    pub(crate) fn sum_cpm(&self) -> f64 {
        self.frequencies_cpm[0] + self.sign * self.frequencies_cpm[1]
    }

    /// By how much the sum would have to rise (cycles per minute) for the tongue to move by a
    /// distance in speed (rpm), to first order.
    pub(crate) fn rise_cpm(&self, distance_rpm: f64) -> f64 {
        distance_rpm * (f64::from(self.order) - self.slope)
    }
}

/// How much more damping closes a tongue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Closing {
    /// Every damper this many times as strong; the damping (N s/m) if all have the same.
    Factor(f64, Option<f64>),
    /// Not up to this many times.
    NotUpTo(f64),
    /// There is no damping to raise.
    NoDampers,
}

/// The tongues within a range of speeds, and how many speeds have no response.
pub(crate) fn tongues(asker: &Asker<'_>, looked: Speeds) -> (Vec<Tongue>, usize) {
    let speeds = looked.values();
    let responses = asker.responses(&speeds);
    let without = responses.iter().filter(|response| response.is_none()).count();
    let kind = |k: usize| responses[k].as_ref().map(Response::kind);
    let mut tongues = Vec::new();
    let mut first = 0;
    while first < speeds.len() {
        let Some(of_run) = kind(first).filter(|kind| *kind != Kind::Stable) else {
            first += 1;
            continue;
        };
        let last = (first..speeds.len()).take_while(|&k| kind(k) == Some(of_run)).last();
        let last = last.unwrap_or(first);
        let run: Vec<&Response> = responses[first..=last].iter().flatten().collect();
        let beyond = [first.checked_sub(1), Some(last + 1).filter(|&next| next < speeds.len())];
        let edge = |side: usize, inside: usize| match beyond[side] {
            None => (speeds[inside], End::Range),
            Some(k) => match kind(k) {
                None => (speeds[inside], End::NoResponse),
                Some(other) => {
                    let rpm = edge_rpm(asker, of_run, speeds[inside], speeds[k]);
                    (rpm, if other == Kind::Stable { End::Edge } else { End::OtherKind })
                }
            },
        };
        let (from, to) = (edge(0, first), edge(1, last));
        tongues.push(tongue(asker, of_run, &run, [from, to]));
        first = last + 1;
    }
    (tongues, without)
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
        from_to_rpm: [from.0, to.0],
        ends: [from.1, to.1],
        growths,
        at,
        resonance,
        closing: None,
    }
}

/// Speeds between two others, apart from these.
fn between(low: f64, high: f64, count: usize) -> Vec<f64> {
    (1..=count).map(|k| low + (high - low) * (k as f64 / (count + 1) as f64)).collect()
}

/// Where a kind of instability ends between a speed at which it is there and one at which it is
/// not.
fn edge_rpm(asker: &Asker<'_>, kind: Kind, mut inside: f64, mut outside: f64) -> f64 {
    while (outside - inside).abs() > EDGE_RPM {
        let trials = between(inside, outside, BETWEEN);
        let responses = asker.responses(&trials);
        let is_there = |k: usize| responses[k].as_ref().is_some_and(|it| it.kind() == kind);
        let first_out = (0..trials.len()).find(|&k| !is_there(k));
        let (before, after) = match first_out {
            Some(0) => (inside, trials[0]),
            Some(k) => (trials[k - 1], trials[k]),
            None => (trials[trials.len() - 1], outside),
        };
        (inside, outside) = (before, after);
    }
    0.5 * (inside + outside)
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
    let apart = SLOPE_SHARE * at.speed_rpm;
    let beside = [frequencies(at.speed_rpm - apart)?, frequencies(at.speed_rpm + apart)?];
    let named: Vec<usize> = at.participants.iter().map(|mode| mode.mode - 1).collect();
    let (&a, partners) = match named.as_slice() {
        [] => return None,
        [one] => (one, (0..SUSPENSION_MODES).collect::<Vec<_>>()),
        [one, other, ..] => (one, vec![*one, *other]),
    };
    let is_pair = at.kind() == Kind::QuasiPeriodic;
    let mut best: Option<(f64, Resonance)> = None;
    let ones: Vec<usize> = if is_pair { vec![a] } else { named.clone() };
    for &one in &ones {
        for &other in if is_pair { &partners } else { &ones } {
            let is_same = one == other;
            if is_pair == is_same {
                continue;
            }
            for sign in [1.0, -1.0] {
                for order in 1..=MOST_ORDER {
                    let admits = match at.kind() {
                        Kind::PeriodDoubling => order % 2 == 1,
                        Kind::Fold => order % 2 == 0,
                        Kind::QuasiPeriodic | Kind::Stable => true,
                    };
                    let (first, second) = if sign < 0.0 && here[one] < here[other] {
                        (other, one)
                    } else {
                        (one, other)
                    };
                    let sum = |of: &[f64]| of[first] + sign * of[second];
                    let target = f64::from(order) * at.speed_rpm;
                    let miss = (sum(&here) / target - 1.0).abs();
                    if !admits || best.is_some_and(|(so_far, _)| miss >= so_far) {
                        continue;
                    }
                    let ordered = if sign > 0.0 {
                        [first.min(second), first.max(second)]
                    } else {
                        [first, second]
                    };
                    best = Some((
                        miss,
                        Resonance {
                            modes: ordered.map(|mode| mode + 1),
                            frequencies_cpm: ordered.map(|mode| here[mode]),
                            sign,
                            order,
                            slope: (sum(&beside[1]) - sum(&beside[0])) / (2.0 * apart),
                        },
                    ));
                }
            }
        }
    }
    best.filter(|(miss, _)| *miss < FARTHEST_MISS).map(|(_, resonance)| resonance)
}

impl Tongue {
    /// How much more damping in every damper closes it, by bisection.
    pub(crate) fn closing(&self, asker: &Asker<'_>) -> Closing {
        let dampers = &asker.scenario.machine.dampers;
        if dampers.iter().all(|damper| damper.damping_n_s_per_m == 0.0) {
            return Closing::NoDampers;
        }
        let (mut open, mut closed) = (1.0, 2.0);
        while self.is_open(asker, closed) {
            if closed >= MOST_DAMPING_FACTOR {
                return Closing::NotUpTo(closed);
            }
            (open, closed) = (closed, 2.0 * closed);
        }
        while closed - open > FACTOR_TOLERANCE * open {
            let middle = 0.5 * (open + closed);
            if self.is_open(asker, middle) { open = middle } else { closed = middle }
        }
        let factor = 0.5 * (open + closed);
        let first = dampers[0].damping_n_s_per_m;
        let is_common = dampers.iter().all(|damper| damper.damping_n_s_per_m == first);
        Closing::Factor(factor, is_common.then_some(factor * first))
    }

    /// Whether something grows in its way, about where it is, with dampers so many times as strong.
    fn is_open(&self, asker: &Asker<'_>, factor: f64) -> bool {
        let mut scenario = asker.scenario.clone();
        for damper in &mut scenario.machine.dampers {
            damper.damping_n_s_per_m *= factor;
        }
        let Ok(point) = ready(asker.simd, asker.plan, &scenario) else { return false };
        let kind = self.at.kind();
        let [from, to] = self.from_to_rpm;
        let margin = TRIAL_MARGIN * (to - from) + 1.0;
        let mut around = [(from - margin).max(0.5 * from), to + margin];
        let mut count = TRIAL_SPEEDS;
        for _ in 0..=PEAK_ROUNDS {
            let trials = between(around[0], around[1], count);
            let found = asker.responses_of(&point, &trials);
            let found = || found.iter().flatten();
            if found().any(|response| response.kind() == kind) {
                return true;
            }
            let of_stable = found().filter(|response| response.kind() == Kind::Stable);
            let most = of_stable.max_by(|a, b| a.growth_per_s().total_cmp(&b.growth_per_s()));
            let Some(most) = most else { return false };
            let reach = (around[1] - around[0]) / (count + 1) as f64;
            around = [most.speed_rpm - reach, most.speed_rpm + reach];
            count = BETWEEN;
        }
        false
    }
}

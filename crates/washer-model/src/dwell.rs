//! What a machine held at a speed ends in: its motions, by trajectories from many starts.
//!
//! A search, not a proof: a motion that no start leads to is not found.

mod course;
mod exponent;
mod hold;
mod lines;
mod multipliers;
mod starts;
#[cfg(test)]
mod tests;

use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::run::model::{LaneModel, Nonlinear};
use crate::stability::orbit::Row;
use crate::stability::settings::{Case, Settings};
use crate::{Dwell, Modes, NoAnswer, Reading, Recorders, Response, respond};
use course::{BLOCK, Course, Need, WINDOW, are_alike};
use exponent::exponents;
use hold::{Held, hold, recorded};
use lane_ode::Simd;
use multipliers::{Orbit, growths_per_s};
use starts::{
    Directions, Kick, MODE_DIRECTIONS, directions, disturbed, is_from_rest, kicked, kicks,
    random_kicks,
};
use std::sync::Arc;

pub use exponent::Exponent;

/// Motions are the same whose largest deviations agree to this share in all channels; chaotic ones,
/// of which no two stretches agree, and those that have not settled, to the second. What has not
/// settled is on its way to a motion that has, if they agree to the third.
const SAME: f64 = 0.01;
const SAME_ROUGHLY: f64 = 0.5;
const SAME_NEARLY: f64 = 0.05;

/// Rounds in which the gap between a kick that comes back and one that does not is halved.
const HALVINGS: usize = 5;

/// From where and for how long motions are looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Starts {
    /// How many at least, the disturbed responses among them.
    pub count: usize,
    /// The hardest kick (rad/s of the tub's rocking).
    pub kick_rad_per_s: f64,
    /// How long a trajectory may take (s).
    pub longest_s: f64,
    /// Whether to look for the smallest kick that does not come back.
    pub with_threshold: bool,
    /// Further records of each motion.
    pub wanted: Recorders,
}

impl Default for Starts {
    fn default() -> Self {
        Self {
            count: 12,
            kick_rad_per_s: 6.0,
            longest_s: 600.0,
            with_threshold: false,
            wanted: Recorders::default(),
        }
    }
}

/// How a trajectory ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum State {
    /// It settled.
    Ok,
    /// It went farther than the model is good for.
    LeftRange {
        /// When, to a turn (s).
        time_s: f64,
    },
    /// It did not settle in time.
    NotSettled,
    /// It wandered as chaos does, but trajectories from its own states ended elsewhere.
    Transient {
        /// Its mean life (s): the time that these trajectories took together, by the number of
        /// those that ended.
        life_s: f64,
    },
}

/// What a motion settled into.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Settled {
    /// It repeats.
    Periodic {
        /// After so many turns.
        turns: u32,
    },
    /// Two frequencies that no turn locks: states once a turn fill a closed curve.
    QuasiPeriodic {
        /// The strongest line of these states, from 0 to half the drum's speed (cycles per
        /// minute); the drum's speed less it is another.
        frequency_cpm: f64,
    },
    /// Neighbours part: the largest Lyapunov exponent is above 0 by three standard errors, and
    /// trajectories from eight of its states stayed in it for 240 s.
    Chaotic,
}

/// A motion that a held speed ends in.
#[derive(Clone, Debug, PartialEq)]
pub struct Ending {
    /// How its first trajectory ended.
    pub state: State,
    /// What it is, once it has settled.
    pub settled: Option<Settled>,
    /// How many starts ended in it; none where only a transient did.
    pub starts: u32,
    /// The smallest kick (rad/s) off the response that led to it: 0 where a disturbed response did,
    /// none where only a kick of the machine at rest, a transient or a carried state did.
    pub least_kick_rad_per_s: Option<f64>,
    /// Largest deviation from equilibrium over its last turns (32 where it repeats, 128 with two
    /// frequencies, else 256), in the order of [`Channel::ALL`](crate::Channel::ALL) (m, rad).
    pub peaks: [f64; CHANNELS],
    /// Least gap between drum and tub at the ends of steps of these turns (m).
    pub min_gap_m: f64,
    /// How fast neighbours part: of periodic motions by their multipliers, without an error; of
    /// others by a perturbed run, where their spectrum does not say what they are.
    pub exponent: Option<Exponent>,
    /// How long the trajectory was followed (s).
    pub time_s: f64,
    /// Its last state where the unbalance is up: coordinates (m, rad), then their speeds (per s).
    pub end: [f64; STATES],
    /// Such states, once a turn, of its last 256 turns at most; coordinates from equilibrium.
    pub sections: Vec<[f64; STATES]>,
    /// What [`Starts::wanted`] asks for, over 128 further turns.
    pub extra: Reading,
}

/// What was found at a speed.
#[derive(Clone, Debug, PartialEq)]
pub struct Endings {
    /// The periodic responses: none where none was found, and the machine then starts from rest.
    pub responses: Vec<Response>,
    /// The motions in the order in which starts led to them: the first is the one that the
    /// disturbed periodic response ends in.
    pub motions: Vec<Ending>,
    /// How many starts there were.
    pub starts: u32,
    /// The smallest kick (rad/s) that does not come back to the first motion, of those that were
    /// tried; none where all do, or it was not asked for.
    pub threshold_rad_per_s: Option<f64>,
}

/// Motions of some dwells, on lanes of `simd` at most. What is found of one does not depend on the
/// others. Of the dwells whose place in `carried` has a state, that state alone is a start,
/// disturbed as the responses are.
///
/// # Errors
/// Per dwell, [`NoAnswer`]. Once `is_stopped` says so, [`NoAnswer::Stopped`].
pub fn endings(
    simd: Simd,
    dwells: &[Dwell<'_>],
    carried: &[Option<[f64; STATES]>],
    starts: &Starts,
    is_stopped: &dyn Fn() -> bool,
) -> Vec<Result<Endings, NoAnswer>> {
    endings_beside(simd, dwells, respond(dwells, is_stopped), carried, starts, is_stopped)
}

/// As [`endings`], of dwells whose periodic responses are known, as [`respond`] gives them.
///
/// # Errors
/// As there.
pub fn endings_beside(
    simd: Simd,
    dwells: &[Dwell<'_>],
    answers: Vec<Result<Vec<Response>, NoAnswer>>,
    carried: &[Option<[f64; STATES]>],
    starts: &Starts,
    is_stopped: &dyn Fn() -> bool,
) -> Vec<Result<Endings, NoAnswer>> {
    let mut hunts: Vec<Result<Hunt<'_>, NoAnswer>> = Vec::with_capacity(dwells.len());
    let mut settings: Option<Settings<'_>> = None;
    for (k, (dwell, answer)) in dwells.iter().zip(answers).enumerate() {
        let is_same = |of: &Settings<'_>| core::ptr::eq(of.point, dwell.point);
        let settings = match settings.take().filter(is_same) {
            Some(known) => settings.insert(known),
            None => settings.insert(Settings::new(dwell.point)),
        };
        let responses = match answer {
            Ok(responses) => responses,
            Err(NoAnswer::NoResponse) => Vec::new(),
            Err(none) => {
                hunts.push(Err(none));
                continue;
            }
        };
        let carried = carried.get(k).copied().flatten();
        let hunt = |case| Hunt::new(case, responses, carried, starts);
        hunts.push(settings.case(dwell.speed_rpm).map(hunt));
    }
    let mut is_whole = finish(simd, &mut hunts, is_stopped);
    for hunt in hunts.iter_mut().flatten() {
        hunt.start_survivors();
    }
    is_whole = is_whole && finish(simd, &mut hunts, is_stopped);
    for hunt in hunts.iter_mut().flatten() {
        hunt.find_transients();
    }
    if starts.with_threshold {
        for hunt in hunts.iter_mut().flatten() {
            hunt.bracket();
        }
        for _ in 0..HALVINGS {
            for hunt in hunts.iter_mut().flatten() {
                hunt.halve();
            }
            is_whole = is_whole && finish(simd, &mut hunts, is_stopped);
            for hunt in hunts.iter_mut().flatten() {
                hunt.narrow();
            }
        }
    }
    let found = hunts.into_iter().map(|hunt| match hunt {
        Ok(hunt) if is_whole => Ok(hunt.found()),
        Ok(_) => Err(NoAnswer::Stopped),
        Err(none) => Err(none),
    });
    let mut found: Vec<Result<(Endings, Row<'_>), NoAnswer>> = found.collect();
    if starts.wanted.need_all_states() {
        record(simd, found.iter_mut().flatten(), starts.wanted);
    }
    found.into_iter().map(|found| found.map(|(endings, _)| endings)).collect()
}

/// Follows motions on, with further records.
fn record<'a, 'f>(
    simd: Simd,
    found: impl Iterator<Item = &'f mut (Endings, Row<'a>)>,
    wanted: Recorders,
) where
    'a: 'f,
{
    let (mut motions, mut held) = (Vec::new(), Vec::new());
    for (endings, row) in found {
        let within = |motion: &&mut Ending| !matches!(motion.state, State::LeftRange { .. });
        for motion in endings.motions.iter_mut().filter(within) {
            held.push(Held { row: *row, state: motion.end });
            motions.push(motion);
        }
    }
    for (motion, (_, extra)) in motions.into_iter().zip(recorded(simd, &held, WINDOW, wanted)) {
        motion.extra = extra;
    }
}

/// Takes all trajectories to their ends, those of all hunts in lanes together. False if it was
/// stopped.
fn finish(
    simd: Simd,
    hunts: &mut [Result<Hunt<'_>, NoAnswer>],
    is_stopped: &dyn Fn() -> bool,
) -> bool {
    loop {
        if is_stopped() {
            return false;
        }
        let mut running: Vec<&mut Course<'_>> = Vec::new();
        let mut asking = Vec::new();
        let mut twins = Vec::new();
        let mut repeating: Vec<(&mut Course<'_>, u32)> = Vec::new();
        let mut orbits: Vec<Orbit<'_, '_>> = Vec::new();
        for hunt in hunts.iter_mut().flatten() {
            let direction = hunt.directions[MODE_DIRECTIONS - 1];
            let case = &hunt.case;
            for course in &mut hunt.courses {
                match course.need {
                    Need::Turns => running.push(course),
                    Need::Multipliers(period) => {
                        orbits.push(Orbit { case, held: course.held, period });
                        repeating.push((course, period));
                    }
                    Need::Exponent => {
                        twins.push((course.held, direction));
                        asking.push(course);
                    }
                    Need::Nothing => {}
                }
            }
        }
        if running.is_empty() && asking.is_empty() && repeating.is_empty() {
            return true;
        }
        let growths = growths_per_s(&orbits, is_stopped);
        for ((course, period), growth_per_s) in repeating.into_iter().zip(growths) {
            course.take_growth(period, growth_per_s);
        }
        let held: Vec<Held<'_>> = running.iter().map(|course| course.held).collect();
        for (course, turns) in running.into_iter().zip(hold(simd, &held, BLOCK)) {
            course.take(turns);
        }
        if !asking.is_empty() {
            for (course, exponent) in asking.into_iter().zip(exponents(simd, &twins)) {
                course.take_exponent(exponent);
            }
        }
    }
}

/// From where a trajectory starts.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Origin {
    /// A periodic response, disturbed.
    Response,
    /// A periodic response, kicked.
    Kicked(Kick),
    /// The machine at rest, kicked, whose drum is at speed at once.
    Rest,
    /// The state that another speed ended in.
    Carried,
    /// A state of another trajectory.
    Trajectory,
}

/// The search at one dwell.
struct Hunt<'a> {
    case: Case<'a>,
    responses: Vec<Response>,
    from: [f64; STATES],
    directions: Directions,
    longest_s: f64,
    courses: Vec<Course<'a>>,
    /// The origin of each course.
    origins: Vec<Origin>,
    /// Courses that are starts; the others look for the threshold, or try whether chaos survives.
    starts: usize,
    /// The number of a chaotic course, and those of the courses from its states.
    survivors: Vec<(usize, core::ops::Range<usize>)>,
    /// By direction along mode shapes, sizes of kicks that come back and that do not (rad/s).
    brackets: [Option<[f64; 2]>; MODE_DIRECTIONS],
    /// The smallest kick in a random direction that does not come back (rad/s).
    random_gone: Option<f64>,
}

impl<'a> Hunt<'a> {
    fn new(
        case: Case<'a>,
        responses: Vec<Response>,
        carried: Option<[f64; STATES]>,
        starts: &Starts,
    ) -> Self {
        let point = case.row.point;
        let frozen: Arc<Modes> = Arc::clone(&case.frozen);
        let rest = <Nonlinear<f64> as LaneModel<f64>>::at_rest(point);
        let from = responses.first().map_or(rest, |response| response.start);
        let mut states: Vec<([f64; STATES], Origin)> = Vec::new();
        let directions = directions(point, &frozen, random_kicks(starts.count));
        if let Some(carried) = carried {
            states.push((disturbed(point, &frozen, &carried), Origin::Carried));
        } else {
            let firsts = responses.iter().map(|response| response.start);
            let firsts: Vec<_> = if responses.is_empty() { vec![from] } else { firsts.collect() };
            let beside = |first| (disturbed(point, &frozen, first), Origin::Response);
            states.extend(firsts.iter().map(beside));
            let count = starts.count.saturating_sub(states.len());
            for kick in kicks(count, starts.kick_rad_per_s) {
                let (off, origin) = match is_from_rest(kick) {
                    true => (&rest, Origin::Rest),
                    false => (&from, Origin::Kicked(kick)),
                };
                states.push((kicked(off, &directions, kick), origin));
            }
        }
        let mut hunt = Self {
            case,
            responses,
            from,
            directions,
            longest_s: starts.longest_s,
            courses: Vec::new(),
            origins: Vec::new(),
            starts: states.len(),
            survivors: Vec::new(),
            brackets: [None; MODE_DIRECTIONS],
            random_gone: None,
        };
        for (state, origin) in states {
            hunt.start(state, origin);
        }
        hunt
    }

    fn start(&mut self, state: [f64; STATES], origin: Origin) {
        let held = Held { row: self.case.row, state };
        let grows = |response: &&Response| response.growth_per_s() > 0.0;
        let unstable = self.responses.iter().filter(grows);
        let leaves = unstable.map(|response| vec![response.start]).collect();
        self.courses.push(Course::new(held, leaves, self.longest_s));
        self.origins.push(origin);
    }

    /// Starts trajectories from states of each chaotic motion that starts ended in.
    fn start_survivors(&mut self) {
        for chaotic in 0..self.starts {
            if !self.courses[chaotic].is_chaotic() || self.survivors_of(chaotic).is_some() {
                continue;
            }
            let first = self.courses.len();
            let leaves = self.courses[chaotic].leaves().to_vec();
            for state in self.courses[chaotic].own_states() {
                let held = Held { row: self.case.row, state };
                self.courses.push(Course::survivor(held, leaves.clone()));
                self.origins.push(Origin::Trajectory);
            }
            self.survivors.push((chaotic, first..self.courses.len()));
        }
    }

    /// Returns the trajectories from states of the motion that a course is in.
    fn survivors_of(&self, course: usize) -> Option<core::ops::Range<usize>> {
        let ending = self.courses[course].ending();
        let of_same = |(other, _): &&(usize, core::ops::Range<usize>)| {
            are_same(&self.courses[*other].ending(), &ending)
        };
        self.survivors.iter().find(of_same).map(|(_, survivors)| survivors.clone())
    }

    /// Calls what is chaotic a transient where one of the trajectories from its states ended
    /// elsewhere.
    fn find_transients(&mut self) {
        let mut lives: Vec<(usize, f64)> = Vec::new();
        for chaotic in (0..self.starts).filter(|&course| self.courses[course].is_chaotic()) {
            let Some(survivors) = self.survivors_of(chaotic) else { continue };
            let survivors = &self.courses[survivors];
            let ended = survivors.iter().filter(|course| course.has_ended()).count();
            if ended > 0 {
                let time_s: f64 = survivors.iter().map(Course::time_s).sum();
                lives.push((chaotic, time_s / ended as f64));
            }
        }
        for (course, life_s) in lives {
            self.courses[course].call_transient(life_s);
        }
    }

    /// Whether a course ended where the first one did.
    fn comes_back(&self, course: usize) -> bool {
        are_same(&self.courses[0].ending(), &self.courses[course].ending())
    }

    /// Of every direction the kicks between which some stop coming back.
    fn bracket(&mut self) {
        for (course, origin) in self.origins.iter().enumerate() {
            if let Origin::Kicked((direction, size)) = *origin
                && direction >= MODE_DIRECTIONS
                && !self.comes_back(course)
            {
                self.random_gone = Some(self.random_gone.map_or(size, |least| least.min(size)));
            }
        }
        for direction in 0..MODE_DIRECTIONS {
            let mut kicks: Vec<(f64, bool)> = Vec::new();
            for (course, origin) in self.origins.iter().enumerate() {
                if let Origin::Kicked((of, size)) = *origin
                    && of == direction
                {
                    kicks.push((size, self.comes_back(course)));
                }
            }
            kicks.sort_by(|a, b| a.0.total_cmp(&b.0));
            let gone = kicks.iter().position(|(_, comes_back)| !comes_back);
            self.brackets[direction] = gone.map(|gone| {
                let back = gone.checked_sub(1).map_or(0.0, |back| kicks[back].0);
                [back, kicks[gone].0]
            });
        }
    }

    /// Starts in the middle of the brackets.
    fn halve(&mut self) {
        for direction in 0..MODE_DIRECTIONS {
            if let Some([back, gone]) = self.brackets[direction] {
                let kick = (direction, 0.5 * (back + gone));
                self.start(kicked(&self.from, &self.directions, kick), Origin::Kicked(kick));
            }
        }
    }

    /// Halves the brackets by what came of their middles.
    fn narrow(&mut self) {
        let asked = self.brackets.iter().flatten().count();
        for course in self.courses.len() - asked..self.courses.len() {
            let comes_back = self.comes_back(course);
            if let Origin::Kicked((direction, size)) = self.origins[course]
                && let Some(bracket) = &mut self.brackets[direction]
            {
                bracket[usize::from(!comes_back)] = size;
            }
        }
    }

    fn found(self) -> (Endings, Row<'a>) {
        let mut motions: Vec<Ending> = Vec::new();
        for (course, origin) in self.courses[..self.starts].iter().zip(&self.origins) {
            let mut ending = course.ending();
            ending.least_kick_rad_per_s = match origin {
                Origin::Response => Some(0.0),
                Origin::Kicked((_, size)) => Some(*size),
                Origin::Rest | Origin::Carried | Origin::Trajectory => None,
            };
            match motions.iter_mut().find(|motion| are_same(motion, &ending)) {
                Some(known) => known.also(&ending),
                None => motions.push(ending),
            }
        }
        let ends_of_transients = self.survivors.iter().flat_map(|(_, survivors)| survivors.clone());
        for course in ends_of_transients.filter(|&course| self.courses[course].has_ended()) {
            let ending = Ending { starts: 0, ..self.courses[course].ending() };
            if !motions.iter().any(|motion| are_same(motion, &ending)) {
                motions.push(ending);
            }
        }
        let gone = self.brackets.iter().flatten().map(|[_, gone]| *gone).chain(self.random_gone);
        let endings = Endings {
            motions,
            starts: self.starts as u32,
            threshold_rad_per_s: gone.reduce(f64::min),
            responses: self.responses,
        };
        (endings, self.case.row)
    }
}

/// Whether two trajectories ended in the same motion.
fn are_same(a: &Ending, b: &Ending) -> bool {
    match (a.state, b.state) {
        (State::LeftRange { .. }, State::LeftRange { .. }) => return true,
        (State::LeftRange { .. }, _) | (_, State::LeftRange { .. }) => return false,
        _ => {}
    }
    let is_rough = |of: &Ending| matches!(of.settled, None | Some(Settled::Chaotic));
    let share = match (a.settled, b.settled) {
        _ if is_rough(a) && is_rough(b) => SAME_ROUGHLY,
        (None, _) | (_, None) => SAME_NEARLY,
        _ => SAME,
    };
    are_alike(&a.peaks, &b.peaks, share)
}

impl Endings {
    /// Whether a motion's largest deviations are about those of a periodic response: what has not
    /// settled there comes to it or leaves it slowly.
    pub fn is_near_response(&self, motion: &Ending) -> bool {
        let near =
            |response: &Response| are_alike(&motion.peaks, &response.nonlinear, SAME_ROUGHLY);
        self.responses.iter().any(near)
    }
}

impl Ending {
    /// What motions are, by name: in words what they do once a turn, then why that is not known.
    pub const KINDS: [&str; 8] = [
        "periodic",
        "periodic_2",
        "periodic_m",
        "quasi_periodic",
        "chaotic",
        "transient",
        "left_range",
        "not_settled",
    ];

    /// Its position in [`Self::KINDS`].
    pub fn kind(&self) -> usize {
        match (self.settled, self.state) {
            (Some(Settled::Periodic { turns }), _) => (turns as usize).min(3) - 1,
            (Some(Settled::QuasiPeriodic { .. }), _) => 3,
            (Some(Settled::Chaotic), _) => 4,
            (None, State::Transient { .. }) => 5,
            (None, State::LeftRange { .. }) => 6,
            (None, State::Ok | State::NotSettled) => 7,
        }
    }

    /// Another start ended here. Of chaotic motions, and of what has not settled, the largest
    /// deviations are those of all starts.
    fn also(&mut self, other: &Self) {
        let starts = self.starts + 1;
        let kicks = [self.least_kick_rad_per_s, other.least_kick_rad_per_s];
        let least_kick_rad_per_s = kicks.into_iter().flatten().reduce(f64::min);
        if self.settled.is_none() && other.settled.is_some() {
            *self = other.clone();
        } else if matches!(self.settled, None | Some(Settled::Chaotic)) {
            for (peak, other) in self.peaks.iter_mut().zip(other.peaks) {
                *peak = peak.max(other);
            }
            self.min_gap_m = self.min_gap_m.min(other.min_gap_m);
        }
        self.starts = starts;
        self.least_kick_rad_per_s = least_kick_rad_per_s;
    }
}

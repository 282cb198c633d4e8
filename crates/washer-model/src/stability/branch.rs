//! The periodic response followed over speed, from a low one up and round its folds, or from a high
//! one down.
//!
//! A curve of states and speeds, both in units of their own, is followed by pseudo-arclength
//! (Keller 1977): along the tangent and its turning, then back onto the curve in the plane across
//! the tangent, by the derivatives where the step has led. Steps grow where few corrections are
//! needed and shrink where many are. The curve depends on the machine alone. So does what is found
//! of it at a speed: the part of the curve counts up to where it first is [`BEYOND`] times as fast.
//! Where it never is, it is lost, and a second one counts too, followed down.

use super::monodromy::{INSTANTS, Square};
use super::orbit::{Asked, Turned};
use super::search::{Search, apart, factored, missing};
use super::settings::Settings;
use crate::coordinates::{COORDINATES, STATES};
use lane_ode::{Lu, N};

/// A place on the curve: coordinates, their speeds, and the drum's speed.
const PLACE: usize = STATES + 1;

/// Position of the drum's speed in a place.
const SPEED: usize = STATES;

/// Units of a place: of coordinates (m, rad),
const UNIT: f64 = 0.01;

/// of their speeds, UNIT times this (1/s),
const UNIT_PER_S: f64 = 10.0;

/// and of the logarithm of the drum's speed.
const UNIT_OF_SPEED: f64 = 0.02;

/// A response may lie on the curve after this many times its speed, but no later.
pub(super) const BEYOND: f64 = 1.25;

/// The length of the first step. Basis: a centimetre, or 2 % of the speed. Doubling it makes the
/// first step fail more often.
const FIRST_STEP: f64 = 1.0;
/// The length of the longest step, which no correction exceeds. Basis: longer ones are shortened by
/// the tangent's turning. Doubling it makes few curves faster.
const LONGEST_STEP: f64 = 4.0;
/// The length of the shortest step, after which the curve is lost. Basis: ten halvings. Doubling it
/// loses curves at narrow folds.
const SHORTEST_STEP: f64 = 1e-3;

/// Once a step is shorter than this, derivatives are taken at all instants of a turn until one is
/// the longest: those at a few may be what makes it short.
const SHORT_STEP: f64 = 0.5;

/// The factor of a step's length after few corrections. Basis: steps of most curves are as long as
/// they may be. Doubling it makes steps fail.
const LONGER: f64 = 1.6;
/// The greatest number of corrections that are few. Basis: a curve that hardly bends takes four.
/// Doubling it makes all steps longer until they fail.
const FEW_CORRECTIONS: usize = 4;

/// The factor of a step's length after many corrections. Basis: about half the bend of the curve.
/// Doubling it makes steps longer.
const SHORTER: f64 = 0.7;
/// The least number of corrections that are many. Basis: one more than keeps the length. Doubling
/// it shortens no step.
const MANY_CORRECTIONS: usize = 6;

/// The greatest number of corrections; then the step is done again, half as long. Basis: a step
/// that converges takes fewer. Doubling it wastes turns.
const MAX_CORRECTIONS: usize = 9;

/// A correction is to leave less than this share of what was missing.
const FAST_ENOUGH: f64 = 0.5;

/// The greatest miss of a turn (`missing`) of a place on the curve. Basis: a thousandth of the
/// greatest distance of guesses. Doubling it saves less than a correction.
const CLOSED_TURN: f64 = 1e-7;

/// Cosine of the most that the tangent may turn in a step.
const MOST_TURNED: f64 = 0.8;

/// A place is no neighbour if it was corrected by more than this share of the step.
const MOST_CORRECTED: f64 = 0.5;

/// A place's tangent is its own if the derivatives were taken at all instants, and no farther from
/// it than this.
const OWN: f64 = 1e-3;

/// Relative difference of speeds by which the curve's slope along the speed is taken.
const BESIDE: f64 = 1e-5;

/// The relative error of a fold's speed. Basis: less than any file's digits. Doubling it saves less
/// than a round.
const FOLD: f64 = 1e-6;
/// The greatest number of rounds in which a fold is found. Basis: each squares the error. Doubling
/// it changes nothing.
const FOLD_ROUNDS: usize = 5;

/// The relative difference of the speeds of two folds, in steps of a turn, below which they are
/// none. Where forces have corners, a motion meets them a step earlier or later as the speed
/// changes by a step of a turn, which makes stairs of a curve. Basis: those of a machine that hits
/// a stop are up to 0.45 steps high. Doubling it takes narrow folds of the machine for stairs.
const STAIR_STEPS: f64 = 0.5;

/// Nodes on either side of a fold are no farther from it than this.
const BY_FOLD: f64 = 0.3;

/// Places of a curve, at most.
const MOST_PLACES: usize = 4000;

/// A smooth curve is lost that comes no farther than a first step in so many places: it creeps up
/// to where forces are not smooth, as a spring's is that passes its hook.
const CREEPING: usize = 100;

/// Coordinates (m, rad) beyond which no machine goes.
const FARTHEST: f64 = 1.0;

type Place = [f64; PLACE];

fn dot(a: &Place, b: &Place) -> f64 {
    (0..PLACE).fold(0.0, |sum, i| sum + a[i] * b[i])
}

fn unit(direction: &Place) -> Place {
    let size = dot(direction, direction).sqrt();
    direction.map(|entry| entry / size)
}

fn along(from: &Place, by: f64, direction: &Place) -> Place {
    core::array::from_fn(|i| from[i] + by * direction[i])
}

fn unit_of(i: usize) -> f64 {
    if i < COORDINATES { UNIT } else { UNIT * UNIT_PER_S }
}

fn place_of(state: &[f64; STATES], speed_rpm: f64) -> Place {
    core::array::from_fn(|i| {
        if i == SPEED { libm::log(speed_rpm) / UNIT_OF_SPEED } else { state[i] / unit_of(i) }
    })
}

fn state_of(place: &Place) -> [f64; STATES] {
    core::array::from_fn(|i| place[i] * unit_of(i))
}

fn speed_of(place: &Place) -> f64 {
    libm::exp(place[SPEED] * UNIT_OF_SPEED)
}

/// A response on the curve.
#[derive(Clone)]
struct Node {
    at: Place,
    /// The tangent onwards, of length 1.
    tangent: Place,
    /// Whether that is the place's own, not one close by.
    is_own: bool,
    /// Length of the curve up to here.
    length: f64,
    /// The monodromy matrix, here or close by.
    monodromy: Square,
    /// The steps of its turn, if forces have corners.
    steps: Option<usize>,
}

/// Interpolates between two nodes, at a share of the length: the cubic through both along both
/// tangents, and its slope by the length.
fn between(a: &Node, b: &Node, share: f64) -> (Place, Place) {
    let length = b.length - a.length;
    let t = share;
    let u = 1.0 - share;
    let at = core::array::from_fn(|i| {
        u * u * ((1.0 + 2.0 * t) * a.at[i] + t * length * a.tangent[i])
            + t * t * ((1.0 + 2.0 * u) * b.at[i] - u * length * b.tangent[i])
    });
    let slope = core::array::from_fn(|i| {
        let chord = 6.0 * t * u * (b.at[i] - a.at[i]) / length;
        chord + u * (1.0 - 3.0 * t) * a.tangent[i] + t * (1.0 - 3.0 * u) * b.tangent[i]
    });
    (at, slope)
}

/// Returns the share up to which something is so.
fn bisected(is_before: impl Fn(f64) -> bool) -> f64 {
    let mut low = 0.0;
    let mut high = 1.0;
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if is_before(middle) { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// A step: from where it is corrected, and in which plane.
#[derive(Clone)]
struct Step {
    onto: Place,
    across: Place,
    corrections: usize,
    /// The number of these by the derivatives in use.
    since: usize,
    missing: f64,
    /// The curve's equations at `onto`, once that is seen.
    seen: Option<Box<Jacobian>>,
}

/// The curve's equations about a place.
#[derive(Clone)]
struct Jacobian {
    monodromy: Square,
    /// The factors of the equations with the step's plane below.
    factors: Lu<PLACE>,
}

/// A stretch by a fold that gets one more node: after which node it begins, and how often more the
/// fold is looked for in it, if it is.
#[derive(Clone, Copy)]
struct Turning {
    after: usize,
    rounds: usize,
}

/// A response at a speed that was asked for, as the curve has it: where to look for it.
pub(super) struct Guess {
    /// The number of folds before it on the curve.
    pub(super) branch: u32,
    /// Speeds (rpm) of the folds between which the branch is, lower and upper; none where it has no
    /// end that counts.
    pub(super) between_rpm: [Option<f64>; 2],
    /// The state where the unbalance is up.
    pub(super) state: [f64; STATES],
    /// Factors of 1 - Phi nearby.
    pub(super) factors: Option<Lu<STATES>>,
    /// Whether it is of the curve that is followed up.
    pub(super) is_on_curve: bool,
}

impl Guess {
    /// Whether it is where one of the curves is.
    pub(super) fn is_followed(&self) -> bool {
        self.is_on_curve || self.factors.is_some()
    }
}

/// The curve of a point's responses.
#[derive(Clone)]
pub(super) struct Curve<'a> {
    pub(super) settings: Settings<'a>,
    /// It is followed until it is as fast as this (rpm), or as slow.
    until_rpm: f64,
    is_down: bool,
    nodes: Vec<Node>,
    /// Positions of nodes where it turns back in speed.
    folds: Vec<usize>,
    at: Place,
    /// Length of the next step.
    length: f64,
    /// Whether derivatives are taken at all instants of a turn.
    is_careful: bool,
    /// The step that is being taken; none once it is over.
    step: Option<Step>,
    /// The stretch in which a fold is being looked for.
    turning: Option<Turning>,
}

impl<'a> Curve<'a> {
    /// Returns a curve of which nothing is known.
    pub(super) fn new(settings: Settings<'a>) -> Self {
        Self {
            settings,
            until_rpm: 0.0,
            is_down: false,
            nodes: Vec::new(),
            folds: Vec::new(),
            at: [0.0; PLACE],
            length: FIRST_STEP,
            is_careful: false,
            step: None,
            turning: None,
        }
    }

    /// Begins to follow the curve from a response at a speed (rpm) up or down to another speed.
    pub(super) fn begin(&mut self, speed_rpm: f64, start: &[f64; STATES], until_rpm: f64) {
        (self.until_rpm, self.is_down) = (until_rpm, until_rpm < speed_rpm);
        let mut across = [0.0; PLACE];
        across[SPEED] = if self.is_down { -1.0 } else { 1.0 };
        self.correct(place_of(start, speed_rpm), across);
    }

    /// Takes the next step, or ends.
    fn advance(&mut self) {
        self.step = None;
        let Some(last) = self.nodes.last() else { return };
        let at_rpm = speed_of(&last.at);
        let count = self.nodes.len();
        let is_far = (0..COORDINATES).any(|i| (last.at[i] * UNIT).abs() > FARTHEST);
        let begins_rpm = speed_of(&self.nodes[0].at);
        let [low_rpm, high_rpm] = match self.is_down {
            true => [self.until_rpm.next_up(), begins_rpm.next_up()],
            false => [begins_rpm, self.until_rpm],
        };
        let is_within = (low_rpm..high_rpm).contains(&at_rpm);
        let creeps = |before: &Node| last.length - before.length < FIRST_STEP;
        let is_stuck = count > CREEPING
            && creeps(&self.nodes[count - CREEPING])
            && !self.settings.point.machine.elements.are_nonsmooth();
        if !is_within || is_far || is_stuck || count >= MOST_PLACES {
            return;
        }
        if self.length < SHORTEST_STEP {
            // Steps of a turn that are longer than corners are wide make stairs of a curve, and
            // ranges of speed with steps of their own break it.
            let from = last.length - FIRST_STEP;
            if !self.is_down && self.settings.follow_closer() {
                let kept = self.nodes.partition_point(|node| node.length < from).max(1);
                self.nodes.truncate(kept);
                self.length = FIRST_STEP;
                self.look_again();
            }
            return;
        }
        // Along the tangent, and as it turned in the last step.
        let mut onto = along(&last.at, self.length, &last.tangent);
        if count > 1 {
            let before = &self.nodes[count - 2];
            let by = 0.5 * self.length * self.length / (last.length - before.length);
            let turned = core::array::from_fn(|i| last.tangent[i] - before.tangent[i]);
            onto = along(&onto, by, &turned);
        }
        self.correct(onto, last.tangent);
    }

    /// Makes the next step so many times as long.
    fn scale(&mut self, by: f64) {
        self.length = (by * self.length).min(LONGEST_STEP);
        self.is_careful = self.length < SHORT_STEP || self.is_careful && self.length < LONGEST_STEP;
    }

    fn correct(&mut self, onto: Place, across: Place) {
        self.at = onto;
        let missing = f64::INFINITY;
        self.step = Some(Step { onto, across, corrections: 0, since: 0, missing, seen: None });
    }

    /// Shortens a step that led nowhere.
    fn shorten(&mut self) {
        match self.turning.take() {
            // A fold that cannot be found more closely is where it is.
            Some(Turning { after, rounds }) if rounds > 0 => self.folds.push(after + 1),
            Some(_) => {}
            None => self.scale(0.5),
        }
        self.advance();
    }

    /// Takes in what a turn from where the step begins makes of the state, of disturbances and,
    /// beside it, of the speed.
    fn saw(&mut self, step: Step, seen: &Turned, beside: &Turned) {
        let Some(monodromy) = seen.seen.as_ref().map(|seen| seen.monodromy) else {
            return self.shorten();
        };
        let mut matrix = [[N(0.0); PLACE]; PLACE];
        for i in 0..STATES {
            for j in 0..STATES {
                let own = f64::from(u8::from(i == j));
                matrix[i][j] = N(monodromy[i][j].0 * (unit_of(j) / unit_of(i)) - own);
            }
            let by_speed = (beside.end[i] - seen.end[i]) / libm::log1p(BESIDE);
            matrix[i][SPEED] = N(by_speed * UNIT_OF_SPEED / unit_of(i));
        }
        matrix[SPEED] = step.across.map(N);
        let Some(factors) = factored(&matrix) else { return self.shorten() };
        let jacobian = Box::new(Jacobian { monodromy, factors });
        self.corrected(Step { seen: Some(jacobian), since: 0, ..step }, &seen.end);
    }

    /// Takes in what a turn from where the step has come makes of the state.
    fn corrected(&mut self, mut step: Step, end: &[f64; STATES]) {
        let Some(jacobian) = &step.seen else { return self.shorten() };
        let speed_rpm = speed_of(&self.at);
        let missing = missing(self.settings.point, speed_rpm, &state_of(&self.at), end);
        let is_slow = step.corrections > 1 && missing > FAST_ENOUGH * step.missing;
        if !missing.is_finite() || step.corrections == MAX_CORRECTIONS || is_slow && step.since == 0
        {
            return self.shorten();
        }
        if is_slow {
            // The derivatives of another place are of no more use.
            (step.missing, step.seen) = (f64::INFINITY, None);
            self.step = Some(step);
            return;
        }
        let end = place_of(end, speed_rpm);
        let mut gap = [N(0.0); PLACE];
        for i in 0..STATES {
            gap[i] = N(self.at[i] - end[i]);
        }
        let off: Place = core::array::from_fn(|i| step.onto[i] - self.at[i]);
        gap[SPEED] = N(dot(&step.across, &off));
        let correction = jacobian.factors.solve(&gap);
        self.at = core::array::from_fn(|i| self.at[i] + correction[i].0);
        let off: Place = core::array::from_fn(|i| self.at[i] - step.onto[i]);
        let off = dot(&off, &off);
        if off.is_nan() || off > LONGEST_STEP * LONGEST_STEP {
            return self.shorten();
        }
        (step.corrections, step.since, step.missing) =
            (step.corrections + 1, step.since + 1, missing);
        if missing < CLOSED_TURN { self.arrived(step) } else { self.step = Some(step) }
    }

    /// Whether the curve goes on up in speed: each fold turns it.
    fn rises(&self) -> bool {
        self.folds.len().is_multiple_of(2) != self.is_down
    }

    /// Arrives at the last node once more, with derivatives of that very place.
    fn look_again(&mut self) {
        self.scale(0.5);
        if let Some(last) = self.nodes.pop() {
            // A fold that it is would be found twice.
            self.folds.retain(|fold| *fold < self.nodes.len());
            self.correct(last.at, last.tangent);
        }
    }

    fn arrived(&mut self, step: Step) {
        let Some(jacobian) = step.seen else { return self.shorten() };
        let mut one = [N(0.0); PLACE];
        one[SPEED] = N(1.0);
        let tangent = jacobian.factors.solve(&one).map(|entry| entry.0);
        let tangent = unit(&tangent);
        let before = match self.turning {
            Some(turning) => self.nodes.get(turning.after),
            None => self.nodes.last(),
        };
        let apart = |from: &Place| {
            let apart: Place = core::array::from_fn(|i| self.at[i] - from[i]);
            dot(&apart, &apart).sqrt()
        };
        let off = apart(&step.onto);
        let mut length = 0.0;
        let mut turns_back = false;
        if let Some(before) = before {
            let gone = apart(&before.at);
            let cosine = dot(&before.tangent, &tangent);
            let is_turned = cosine.is_nan() || cosine < MOST_TURNED;
            if is_turned || off > MOST_CORRECTED * gone {
                // From a tangent that is not quite its own, no step would be short enough.
                let is_own = before.is_own || self.turning.is_some();
                return if is_own { self.shorten() } else { self.look_again() };
            }
            length = before.length + gone;
            // At a fold itself the tangent may point to either side: how many folds there are says
            // which way the curve goes on, and two of them close by are not taken for one.
            turns_back = self.rises() == (tangent[SPEED] < 0.0);
        }
        let is_own = off < OWN && self.is_careful;
        let monodromy = jacobian.monodromy;
        let steps = self.settings.steps_at_corners();
        let node = Node { at: self.at, tangent, is_own, length, monodromy, steps };
        if let Some(turning) = self.turning {
            return self.closer(node, turning);
        }
        self.nodes.push(node);
        if step.corrections <= FEW_CORRECTIONS {
            self.scale(LONGER);
        } else if step.corrections >= MANY_CORRECTIONS {
            self.scale(SHORTER);
        }
        if turns_back {
            let after = self.nodes.len() - 2;
            if self.nodes[after].tangent[SPEED] * tangent[SPEED] < 0.0 {
                self.look_for_fold(Turning { after, rounds: FOLD_ROUNDS });
            } else {
                // It turned twice about the last fold.
                self.folds.push(after + 1);
                self.advance();
            }
        } else {
            self.advance();
        }
    }

    /// Takes in a node of a stretch in which the speed turns back.
    fn closer(&mut self, node: Node, turning: Turning) {
        let Turning { after, rounds } = turning;
        let [a, b] = [&self.nodes[after], &self.nodes[after + 1]];
        let bend = (b.tangent[SPEED] - a.tangent[SPEED]) / (b.length - a.length);
        let slope = node.tangent[SPEED];
        let error = 0.5 * slope * slope / bend.abs() * UNIT_OF_SPEED;
        let is_before = a.tangent[SPEED] * slope > 0.0;
        self.nodes.insert(after + 1, node);
        if rounds == 0 {
            if let Some(fold) = self.folds.last_mut().filter(|fold| **fold > after) {
                *fold += 1;
            }
            return self.surround();
        }
        if error < FOLD || rounds == 1 {
            self.folds.push(after + 1);
            return self.surround();
        }
        let after = if is_before { after + 1 } else { after };
        self.look_for_fold(Turning { after, rounds: rounds - 1 });
    }

    /// Puts nodes close by on either side of the last fold: there two branches are so near each
    /// other that they are told apart by little.
    fn surround(&mut self) {
        self.turning = None;
        let Some(&fold) = self.folds.last() else { return self.advance() };
        let is_long = |after: usize| {
            let pair = self.nodes.get(after).zip(self.nodes.get(after + 1));
            pair.is_some_and(|(a, b)| b.length - a.length > BY_FOLD)
        };
        let Some(after) = [fold - 1, fold].into_iter().find(|&after| is_long(after)) else {
            return self.advance();
        };
        let (onto, slope) = between(&self.nodes[after], &self.nodes[after + 1], 0.5);
        self.correct(onto, unit(&slope));
        self.turning = Some(Turning { after, rounds: 0 });
    }

    fn look_for_fold(&mut self, turning: Turning) {
        let [a, b] = [&self.nodes[turning.after], &self.nodes[turning.after + 1]];
        let rises = a.tangent[SPEED] > 0.0;
        let share = bisected(|share| (between(a, b, share).1[SPEED] > 0.0) == rises);
        let (onto, slope) = between(a, b, share);
        self.correct(onto, unit(&slope));
        self.turning = Some(turning);
    }

    /// Returns the folds without stairs: the pairs of neighbours that are nearest in speed cancel
    /// out, as long as they are as near as a stair of the steps by which they were found. Later
    /// parts of the curve may have shorter steps.
    fn folds_of_machine(&self) -> Vec<usize> {
        let mut folds = self.folds.clone();
        let height_steps = |pair: &[usize]| {
            let [a, b] = [&self.nodes[pair[0]], &self.nodes[pair[1]]];
            let steps = a.steps.min(b.steps)?;
            Some(((a.at[SPEED] - b.at[SPEED]) * UNIT_OF_SPEED).abs() * steps as f64)
        };
        loop {
            let pairs = folds.windows(2).map(height_steps).enumerate();
            let heights = pairs.filter_map(|(pair, height)| Some((pair, height?)));
            let lowest = heights.min_by(|a, b| a.1.total_cmp(&b.1));
            match lowest {
                Some((pair, height)) if height < STAIR_STEPS => {
                    folds.drain(pair..pair + 2);
                }
                _ => return folds,
            }
        }
    }

    /// Whether it ends before what counts of it at a speed (rpm) does.
    pub(super) fn is_lost(&self, speed_rpm: f64) -> bool {
        let is_short = |node: &Node| speed_of(&node.at) < BEYOND * speed_rpm;
        let begins_rpm = self.settings.lowest_rpm();
        begins_rpm.is_ok_and(|it| it < speed_rpm) && self.nodes.iter().all(is_short)
    }

    /// Returns the number of folds.
    pub(super) fn folds(&self) -> u32 {
        self.folds_of_machine().len() as u32
    }

    /// Returns where responses at a speed (rpm) are to be looked for, in the order of the curve;
    /// none where the curve does not get there.
    pub(super) fn guesses(&self, speed_rpm: f64) -> Vec<Guess> {
        let is_past = |node: &Node| !self.is_down && speed_of(&node.at) >= BEYOND * speed_rpm;
        let end = self.nodes.iter().position(is_past);
        let nodes = &self.nodes[..end.map_or(self.nodes.len(), |end| end + 1)];
        let target = libm::log(speed_rpm) / UNIT_OF_SPEED;
        let folds = self.folds_of_machine();
        let mut guesses = Vec::new();
        for (k, pair) in nodes.windows(2).enumerate() {
            let [a, b] = pair else { continue };
            let [from, to] = [a.at[SPEED], b.at[SPEED]];
            let rises = to > from;
            // A speed that is a node's own counts once.
            let is_within = if rises {
                (from < target || k == 0 && from == target) && target <= to
            } else {
                to <= target && target < from
            };
            if !is_within {
                continue;
            }
            let share = bisected(|share| (between(a, b, share).0[SPEED] < target) == rises);
            let mean = |i: usize, j: usize| {
                (1.0 - share) * a.monodromy[i][j].0 + share * b.monodromy[i][j].0
            };
            let monodromy = core::array::from_fn(|i| core::array::from_fn(|j| N(mean(i, j))));
            let branch = folds.iter().filter(|&&fold| fold <= k).count();
            let fold = |number: usize| {
                let place = *folds.get(number)?;
                nodes.get(place).map(|node| speed_of(&node.at))
            };
            let ends = [branch.checked_sub(1).and_then(fold), fold(branch)];
            guesses.push(Guess {
                branch: branch as u32,
                between_rpm: if (branch % 2 == 0) != self.is_down {
                    ends
                } else {
                    [ends[1], ends[0]]
                },
                state: state_of(&between(a, b, share).0),
                factors: apart(&monodromy),
                is_on_curve: !self.is_down,
            });
        }
        guesses
    }
}

impl<'a> Search<'a> for Curve<'a> {
    fn wants(&mut self) -> Vec<Asked<'a>> {
        let Some(step) = &self.step else { return Vec::new() };
        let is_seen = step.seen.is_none();
        let Ok(mut row) = self.settings.followed(speed_of(&self.at)) else {
            self.step = None;
            return Vec::new();
        };
        if self.is_careful {
            row.instants = row.instants.max(INSTANTS);
        }
        let start = state_of(&self.at);
        let mut asked = vec![Asked { row, start, is_seen }];
        if is_seen {
            let row = row.beside(row.speed_rpm * (1.0 + BESIDE));
            asked.push(Asked { row, start, is_seen: false });
        }
        asked
    }

    fn take(&mut self, turned: Vec<Turned>) {
        match (self.step.take(), turned.as_slice()) {
            (Some(step), [seen, beside]) => self.saw(step, seen, beside),
            (Some(step), [turned]) => self.corrected(step, &turned.end),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Machine;
    use crate::stability::tests::{idle_stop, prepared};

    /// The paper's machine, with a stop that does nothing or without.
    fn point(has_stop: bool) -> crate::Point {
        let mut machine = Machine::paper();
        machine.stops.extend(has_stop.then(idle_stop));
        prepared(machine, 100.0)
    }

    /// A curve through these speeds (rpm), each a length of 1 from the last, that turns back at
    /// these nodes.
    fn curve<'a>(point: &'a crate::Point, speeds_rpm: &[f64], folds: &[usize]) -> Curve<'a> {
        let mut curve = Curve::new(Settings::new(point));
        let steps = curve.settings.steps_at_corners();
        for (k, &speed_rpm) in speeds_rpm.iter().enumerate() {
            let at = place_of(&[0.0; STATES], speed_rpm);
            let tangent = [0.0; PLACE];
            let monodromy = [[N(0.0); STATES]; STATES];
            let length = k as f64;
            curve.nodes.push(Node { at, tangent, is_own: true, length, monodromy, steps });
        }
        curve.folds = folds.to_vec();
        curve
    }

    #[test]
    fn a_stair_of_steps_at_corners_is_no_fold_of_the_machine() {
        let speeds_rpm = [200.0, 220.05, 220.0, 240.0, 230.0, 260.0];
        let found = |has_stop: bool, speed_rpm: f64| {
            let point = point(has_stop);
            let guesses = curve(&point, &speeds_rpm, &[1, 2, 3, 4]).guesses(speed_rpm);
            guesses.iter().map(|it| (it.branch, it.between_rpm[1].is_some())).collect::<Vec<_>>()
        };
        assert_eq!(found(false, 210.0), [(0, true)]);
        assert_eq!(found(false, 250.0), [(4, false)]);
        assert_eq!(found(true, 210.0), [(0, true)]);
        assert_eq!(found(true, 225.0), [(0, true)]);
        assert_eq!(found(true, 250.0), [(2, false)]);
    }

    /// A curve whose later parts need shorter steps keeps its branches before them.
    #[test]
    fn stairs_are_measured_by_their_own_steps() {
        let point = point(true);
        let mut curve = curve(&point, &[200.0, 220.05, 220.0, 240.0, 230.0, 260.0], &[1, 2, 3, 4]);
        while curve.settings.follow_closer() {}
        let branches = |speed_rpm: f64| {
            let guesses = curve.guesses(speed_rpm).into_iter();
            guesses.map(|it| it.branch).collect::<Vec<_>>()
        };
        assert_eq!(branches(225.0), [0]);
        assert_eq!(branches(250.0), [2]);
    }

    /// Many stairs by a fold leave the fold itself.
    #[test]
    fn stairs_by_a_fold_leave_its_farthest_speed() {
        let point = point(true);
        let steps = Settings::new(&point).steps_at_corners().unwrap() as f64;
        let stair_rpm = |height_steps: f64| 230.0 * libm::exp(height_steps / steps);
        let mut speeds_rpm = vec![200.0];
        speeds_rpm.extend([0.0, -0.2, 0.4, -0.4, 0.0].map(stair_rpm));
        speeds_rpm.extend([171.0, 260.0]);
        let guesses = curve(&point, &speeds_rpm, &[1, 2, 3, 4, 5, 6]).guesses(190.0);
        let [back, on] = &guesses[..] else { panic!("{} guesses", guesses.len()) };
        assert_eq!([back.branch, on.branch], [1, 2]);
        let is_at = |end_rpm: Option<f64>, rpm: f64| (end_rpm.unwrap() - rpm).abs() < 1e-9;
        assert!(is_at(back.between_rpm[0], 171.0), "{:?}", back.between_rpm);
        assert!(is_at(back.between_rpm[1], stair_rpm(0.4)), "{:?}", back.between_rpm);
        assert!(is_at(on.between_rpm[0], 171.0), "{:?}", on.between_rpm);
        assert_eq!(on.between_rpm[1], None);
    }

    #[test]
    fn a_fold_that_is_looked_at_again_is_not_counted_twice() {
        let point = point(false);
        let mut curve = curve(&point, &[200.0, 220.0, 240.0], &[1, 2]);
        curve.look_again();
        assert_eq!((curve.nodes.len(), curve.folds), (2, vec![1]));
    }

    /// Before and behind two folds within a step the curve goes the same way.
    #[test]
    fn a_curve_that_turns_twice_about_a_fold_has_two() {
        let point = point(false);
        let mut curve = curve(&point, &[220.0, 230.0], &[1]);
        let mut up = [0.0; PLACE];
        up[SPEED] = 1.0;
        for node in &mut curve.nodes {
            node.tangent = up;
        }
        let one = |i: usize, j: usize| N(f64::from(u8::from(i == j)));
        let matrix = core::array::from_fn(|i| core::array::from_fn(|j| one(i, j)));
        let factors = factored::<PLACE>(&matrix).unwrap();
        let jacobian = Jacobian { monodromy: [[N(0.0); STATES]; STATES], factors };
        curve.correct(place_of(&[0.0; STATES], 240.0), up);
        let step = curve.step.take().unwrap();
        curve.until_rpm = 300.0;
        curve.arrived(Step { seen: Some(Box::new(jacobian)), ..step });
        assert_eq!((curve.nodes.len(), &curve.folds[..]), (3, &[1, 2][..]));
        assert!(curve.turning.is_none() && curve.rises());
    }

    #[test]
    fn a_curve_followed_down_has_its_branches_the_other_way_round() {
        let point = point(false);
        let mut curve = curve(&point, &[260.0, 220.0, 240.0, 200.0], &[1, 2]);
        curve.is_down = true;
        let found = |speed_rpm: f64| {
            let guesses = curve.guesses(speed_rpm).into_iter();
            guesses
                .map(|it| {
                    (it.branch, it.between_rpm.map(|rpm| rpm.map(f64::round)), it.is_on_curve)
                })
                .collect::<Vec<_>>()
        };
        assert_eq!(found(250.0), [(0, [Some(220.0), None], false)]);
        assert_eq!(found(210.0), [(2, [None, Some(240.0)], false)]);
        assert_eq!(found(230.0).iter().map(|it| it.0).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!(found(230.0)[1].1, [Some(220.0), Some(240.0)]);
        assert!(curve.is_lost(210.0) && !curve.is_lost(205.0) && !curve.is_lost(40.0));
    }
}

//! Periodic responses at speeds that are asked for: where the curve of a point's responses has
//! them, and what becomes of disturbances there.

use super::branch::{BEYOND, Curve, Guess};
use super::monodromy::per_unit;
use super::orbit::{Asked, LinearResponse, Row, Seen, linear_responses, together, turns};
use super::participants::{named, shares, vector_of};
use super::search::{Solve, finish, missing};
use super::settings::{Case, Settings};
use super::{Beyond, Dwell, Kind, NoAnswer, Response, rounded};
use crate::coordinates::{COORDINATES, STATES};
use crate::modes::modes;
use crate::point::Point;
use crate::run::model::{LaneModel, Nonlinear};
use crate::run::suspension::attachments;
use crate::steps::SUSPENSION_MODES;
use core::f64::consts::TAU;
use faer::{Mat, c64};
use lane_ode::Cancel;

/// A motion is judged if the modes that are right have this share of its energy.
const JUDGED_SHARE: f64 = 0.5;

/// Growth closer to 0 than this (1/s) is asked of the machine as it is: it is more than caps may
/// move it.
const CLOSE_TO_EDGE_PER_S: f64 = 2e-3;

/// The highest harmonic of the drum's speed that may ring the hinge; where forces have corners,
/// harmonics have no end. Basis: higher ones of smooth forces are below the tolerance. Doubling it
/// checks more responses.
const HARMONICS_OF_HINGE: f64 = 7.0;
/// The miss of a turn of the machine as it is beyond which a response is found for that machine.
/// Basis: caps leave as much out of the bearings' own deflection. Doubling it keeps responses of
/// the capped machine that are as far off.
const RETURN_MISS: f64 = 2e-4;

/// A response that is farther than this (m, rad) from where the curve has it is another.
const FARTHEST_FROM_GUESS: f64 = 5e-3;

/// Responses that are nearer than this (m, rad) are one.
const SAME: f64 = 1e-6;

/// The distance (m, rad) from which on two guesses of a curve are two branches. Basis: it is ten
/// times the distance of responses that are one. Doubling it leaves neighbours this close to a fold
/// as they were found.
const APART_GUESSES: f64 = 10.0 * SAME;

/// The longest step (m, rad) of the damped search that follows an undamped one without success.
/// Basis: it is a fifth of the distance within which a result belongs to its guess. Doubling it
/// loses responses beside folds to their neighbours; halving it doubles the turns.
const DAMPED_STEP: f64 = 0.2 * FARTHEST_FROM_GUESS;

/// The factor by which the suspension's slowest transient decays before Newton's method goes on,
/// where no curve has a response. Basis: Newton's method converges from a thousandth of a motion.
/// Doubling it makes the integration a tenth shorter.
const TRANSIENT_LEFT: f64 = 1e-3;

/// The longest such integration (s). Basis: a mode that decays by the factor above within it loses
/// 0.06 /s or more. Doubling it doubles what a speed without any response costs.
const LONGEST_TRANSIENT_S: f64 = 120.0;

/// Returns the periodic responses at constant speeds, on lanes; a run of dwells of one point shares
/// its curve of responses. Per dwell as [`Responses::at`].
pub fn respond(dwells: &[Dwell<'_>], cancel: Cancel<'_>) -> Vec<Result<Vec<Response>, NoAnswer>> {
    let same = |a: &Dwell<'_>, b: &Dwell<'_>| core::ptr::eq(a.point, b.point);
    let mut points = Vec::new();
    let mut asked = Vec::new();
    for group in dwells.chunk_by(same) {
        let fastest_rpm = group.iter().map(|dwell| dwell.speed_rpm).fold(0.0, f64::max);
        asked.extend(group.iter().map(|dwell| (points.len(), dwell.speed_rpm)));
        points.push((group[0].point, fastest_rpm));
    }
    let mut followed = Responses::follow(&points, None, cancel);
    Responses::at(&mut followed, &asked, cancel)
}

/// A point's periodic responses over speed.
#[derive(Clone)]
pub struct Responses<'a> {
    /// Their curve from a low speed up.
    up: Curve<'a>,
    /// The one, if that is lost, from a high speed down.
    down: Option<Curve<'a>>,
}

impl<'a> Responses<'a> {
    /// Follows the responses of some points from a low speed up, each to the fastest speed (rpm)
    /// that will be asked for; on lanes. `from` another machine's response, it begins with the one
    /// nearby at that speed. What there is when `cancel` is requested means nothing.
    #[must_use]
    pub fn follow(
        points: &[(&'a Point, f64)],
        from: Option<&Response>,
        cancel: Cancel<'_>,
    ) -> Vec<Self> {
        let begun = points.iter().map(|&(point, fastest_rpm)| {
            let curve = Curve::new(Settings::new(point));
            let lowest = from.map_or_else(|| curve.settings.lowest_rpm(), |it| Ok(it.speed_rpm));
            let lowest = lowest.ok().filter(|&lowest| lowest < fastest_rpm);
            let until_rpm = from.map_or(BEYOND, |_| 1.0) * fastest_rpm;
            (curve, lowest.map(|lowest| [lowest, until_rpm]))
        });
        let Some(up) = followed(begun.collect(), from, cancel) else { return Vec::new() };
        // A remedy is tried on its own branch alone.
        let is_lost = |curve: &Curve<'_>, rpm: f64| from.is_none() && curve.is_lost(rpm);
        let lost = up.iter().zip(points).filter(|(curve, (_, rpm))| is_lost(curve, *rpm));
        let begun = lost.map(|(curve, (point, _))| {
            let [highest, lowest] = [curve.settings.highest_rpm(), curve.settings.lowest_rpm()];
            let ends = highest.ok().zip(lowest.ok()).filter(|(highest, lowest)| highest > lowest);
            (Curve::new(Settings::new(point)), ends.map(<[f64; 2]>::from))
        });
        let Some(down) = followed(begun.collect(), None, cancel) else { return Vec::new() };
        let mut down = down.into_iter();
        let all = up.into_iter().zip(points).map(|(up, (_, rpm))| {
            let down = if is_lost(&up, *rpm) { down.next() } else { None };
            Self { up, down }
        });
        all.collect()
    }

    /// Returns where responses at a speed (rpm) are to be looked for: on the curve, and where that
    /// is lost on the second, whose branches count on.
    fn guesses(&self, speed_rpm: f64) -> Vec<Guess> {
        let mut guesses = self.up.guesses(speed_rpm);
        if let Some(down) = self.down.as_ref().filter(|_| self.up.is_lost(speed_rpm)) {
            let others = down.guesses(speed_rpm).into_iter();
            let first = self.up.folds() + 1;
            guesses.extend(others.map(|it| Guess { branch: first + it.branch, ..it }));
        }
        guesses
    }

    /// Finds for each place in `followed` and speed (rpm) the responses that the point's curve
    /// passes there, in its order, on lanes. The first is that of a machine that runs up, until its
    /// branch ends. Behind them are those of the second curve, where the first is lost, and what a
    /// search from the linear model's response finds beside both, where the machine has friction or
    /// stops; where the first curve has none, this search's comes first. What is found does not
    /// depend on what else is asked for, nor on how much farther the curve was followed.
    ///
    /// Where growth is close to 0, a response is that of the machine as it is, by classical
    /// Runge-Kutta in steps that follow its bearings.
    ///
    /// # Errors
    /// Per place and speed, [`NoAnswer`]. Once `cancel` is requested, [`NoAnswer::Stopped`].
    pub fn at(
        followed: &mut [Self],
        asked: &[(usize, f64)],
        cancel: Cancel<'_>,
    ) -> Vec<Result<Vec<Response>, NoAnswer>> {
        let stopped = || asked.iter().map(|_| Err(NoAnswer::Stopped)).collect();
        if cancel.is_requested() {
            return stopped();
        }
        let mut cases = Vec::with_capacity(asked.len());
        let mut rows = Vec::new();
        for &(place, speed_rpm) in asked {
            let Some(Self { up, .. }) = followed.get_mut(place) else { return stopped() };
            let case = up.settings.case(speed_rpm);
            rows.extend(case.as_ref().ok().map(|case| up.settings.linear(case.row)));
            cases.push(case);
        }
        let mut linear = linear_responses(&rows, cancel).into_iter();
        let (mut looked, mut solves): (Vec<Look<'_>>, Vec<Solve<'_>>) = Default::default();
        for (number, (case, (place, speed_rpm))) in cases.iter().zip(asked).enumerate() {
            let Ok(case) = case else { continue };
            let Some(linear) = linear.next() else { continue };
            let mut guesses = followed[*place].guesses(*speed_rpm);
            // Friction and stops make responses beside those of the curve. A machine that is slower
            // than where the curve begins is in the only one that there is.
            let is_beside = guesses.iter().all(|guess| !guess.is_on_curve);
            if is_beside || case.row.has_corners() {
                let branch = guesses.last().map_or(0, |last| last.branch + 1);
                let begins_rpm = followed[*place].up.settings.lowest_rpm();
                let is_on_curve = begins_rpm.is_ok_and(|begins_rpm| *speed_rpm < begins_rpm);
                let guess = from_linear(case.row.point, &linear);
                let at = if is_beside { 0 } else { guesses.len() };
                guesses.insert(at, Guess { branch, is_on_curve, ..guess });
            }
            for guess in guesses {
                solves.push(Solve::new(case.row, guess.state, guess.factors.clone()));
                looked.push(Look { number, case: case.clone(), guess, linear: linear.peaks });
            }
        }
        if !finish(&mut solves, cancel) {
            return stopped();
        }
        let mut found: Vec<Result<Response, NoAnswer>> =
            looked.iter().zip(solves).map(|(look, solve)| look.answer(solve)).collect();
        if cancel.is_requested() || !search_again(&looked, &mut found, cancel) {
            return stopped();
        }
        forget_known(&looked, &mut found);
        if !find_lost_branches(&looked, &mut found, cancel) {
            return stopped();
        }
        // Responses close to an edge, or moved by the caps, are asked of the machine as it is.
        let are_moved = are_moved(&looked, &found, cancel);
        let mut close = Vec::new();
        for (place, response) in found.iter().enumerate() {
            let Ok(response) = response else { continue };
            let is_close = response.growth_per_s().abs() < CLOSE_TO_EDGE_PER_S;
            if (is_close || are_moved[place]) && looked[place].case.row.caps.is_some() {
                close.push((place, looked[place].case.without_caps(), response.start));
            }
        }
        let mut searches: Vec<(usize, Solve<'_>)> = Vec::new();
        for (place, case, start) in close {
            match case {
                Ok(case) => {
                    searches.push((place, Solve::new(case.row, start, None)));
                    looked[place].case = case;
                }
                Err(none) => found[place] = Err(none),
            }
        }
        let starts: Vec<(usize, [f64; STATES])> =
            searches.iter().map(|(place, solve)| (*place, solve.start())).collect();
        if !take_found(&looked, &mut found, searches, cancel) {
            return stopped();
        }
        // A harmonic that rings the hinge may be far from the capped machine's response.
        let ways: [fn(&Case<'a>, [f64; STATES]) -> Solve<'a>; 2] = [
            |case, start| Solve::damped(case.row, start, DAMPED_STEP),
            |case, start| Solve::after_transient(case.row, start, transient_turns(case)),
        ];
        for way in ways {
            let missing = starts.iter().filter(|(place, _)| is_missing(&found[*place]));
            let searches =
                missing.map(|(place, start)| (*place, way(&looked[*place].case, *start)));
            let searches: Vec<(usize, Solve<'_>)> = searches.collect();
            if !take_found(&looked, &mut found, searches, cancel) {
                return stopped();
            }
        }
        if !find_lost_branches(&looked, &mut found, cancel) {
            return stopped();
        }
        let none = |case: Result<Case<'_>, NoAnswer>| case.err().unwrap_or(NoAnswer::NoResponse);
        let mut answers: Vec<Result<Vec<Response>, NoAnswer>> =
            cases.into_iter().map(|case| Err(none(case))).collect();
        for (look, response) in looked.iter().zip(found) {
            let answer = &mut answers[look.number];
            match (response, answer.as_mut()) {
                (Ok(response), Ok(responses)) => responses.push(response),
                (Ok(response), Err(_)) => *answer = Ok(vec![response]),
                (Err(none), Err(first)) => *first = none,
                (Err(_), Ok(_)) => {}
            }
        }
        answers
    }
}

/// Curves followed between two speeds (rpm), each from the linear model's response, or `from`
/// another machine's; none once `cancel` is requested.
fn followed<'a>(
    begun: Vec<(Curve<'a>, Option<[f64; 2]>)>,
    from: Option<&Response>,
    cancel: Cancel<'_>,
) -> Option<Vec<Curve<'a>>> {
    let (mut curves, ends): (Vec<Curve<'a>>, Vec<Option<[f64; 2]>>) = begun.into_iter().unzip();
    let starts: Vec<Option<Row<'_>>> = curves
        .iter_mut()
        .zip(&ends)
        .map(|(curve, ends)| curve.settings.followed((*ends)?[0]).ok())
        .collect();
    // A curve does not depend on where the linear model takes friction.
    let rows: Vec<Row<'_>> = curves
        .iter()
        .zip(&starts)
        .filter_map(|(curve, start)| {
            Some(Row { point: curve.settings.without_friction(), ..(*start)? })
        })
        .collect();
    let linear = together(&rows, cancel);
    let begun = starts.iter().flatten().zip(&linear);
    let mut solves: Vec<Solve<'_>> = begun
        .map(|(row, linear)| {
            let at_linear = || from_linear(row.point, linear).state;
            Solve::new(*row, from.map_or_else(at_linear, |it| it.start), None)
        })
        .collect();
    let is_whole = finish(&mut solves, cancel);
    let mut solves = solves.into_iter();
    for ((curve, ends), start) in curves.iter_mut().zip(&ends).zip(&starts) {
        if let (Some(row), Some([_, until_rpm])) = (start, ends)
            && let Some((state, _)) = solves.next().and_then(Solve::found)
        {
            curve.begin(row.speed_rpm, &state, *until_rpm);
        }
    }
    (is_whole && finish(&mut curves, cancel)).then_some(curves)
}

/// Searches again for responses that were not found. Those that a curve has are searched by damped
/// steps. At a speed at which nothing is found then, the machine turns from the linear model's
/// response until its transient has decayed: it is in a stable response, if it comes to one.
/// Returns false once `cancel` is requested.
fn search_again(
    looked: &[Look<'_>],
    found: &mut [Result<Response, NoAnswer>],
    cancel: Cancel<'_>,
) -> bool {
    let mut again: Vec<(usize, Solve<'_>)> = Vec::new();
    for (place, look) in looked.iter().enumerate() {
        if look.guess.is_followed() && is_missing(&found[place]) {
            again.push((place, Solve::damped(look.case.row, look.guess.state, DAMPED_STEP)));
        }
    }
    if !take_found(looked, found, again, cancel) {
        return false;
    }
    let mut again: Vec<(usize, Solve<'_>)> = Vec::new();
    for (place, look) in looked.iter().enumerate() {
        let mut at_speed =
            looked.iter().zip(found.iter()).filter(|(it, _)| it.number == look.number);
        if !look.guess.is_followed() && at_speed.all(|(_, response)| is_missing(response)) {
            let turns = transient_turns(&look.case);
            let row = look.case.row;
            let state = look.guess.state;
            again.push((place, Solve::after_transient(row, state, turns)));
        }
    }
    take_found(looked, found, again, cancel)
}

/// Finds branches that were lost to their neighbours.
///
/// A curve that passes a speed rises through it and falls through it in turn, so that branches
/// that are neighbours there have an even and an odd number, and branches vanish in pairs, at
/// folds. Where an odd number of a curve's guesses has no response of its own, one was lost:
/// searches that are repelled by the responses known at that speed find it. Returns false once
/// `cancel` says so.
fn find_lost_branches(
    looked: &[Look<'_>],
    found: &mut [Result<Response, NoAnswer>],
    cancel: Cancel<'_>,
) -> bool {
    forget_twice_found(looked, found);
    let mut searches: Vec<(usize, Solve<'_>)> = Vec::new();
    let places: Vec<usize> =
        (0..looked.len()).filter(|&place| looked[place].guess.is_followed()).collect();
    let curve = |place: usize| (looked[place].number, looked[place].guess.is_on_curve);
    for on_curve in places.chunk_by(|&a, &b| curve(a) == curve(b)) {
        let lost = on_curve.iter().filter(|&&place| is_missing(&found[place]));
        let lost: Vec<usize> = lost.copied().collect();
        if lost.len().is_multiple_of(2) {
            continue;
        }
        let known: Vec<[f64; STATES]> =
            on_curve.iter().filter_map(|&place| Some(found[place].as_ref().ok()?.start)).collect();
        for place in lost {
            let Look { case, guess, .. } = &looked[place];
            let solve = Solve::deflated(case.row, guess.state, DAMPED_STEP, known.clone());
            searches.push((place, solve));
        }
    }
    let is_whole = take_found(looked, found, searches, cancel);
    forget_twice_found(looked, found);
    is_whole
}

/// Leaves out all but one of a curve's responses at a speed that are one: the nearest to its guess
/// stays.
fn forget_twice_found(looked: &[Look<'_>], found: &mut [Result<Response, NoAnswer>]) {
    let farthest = |a: &[f64; STATES], b: &[f64; STATES]| {
        (0..COORDINATES).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max)
    };
    for place in 0..found.len() {
        for other in place + 1..found.len() {
            let Look { guess, number, .. } = &looked[place];
            let other_look = &looked[other];
            if other_look.number != *number {
                break;
            }
            let are_followed = guess.is_followed() && other_look.guess.is_followed();
            let are_apart = farthest(&guess.state, &other_look.guess.state) > APART_GUESSES;
            let (Ok(a), Ok(b)) = (&found[place], &found[other]) else { continue };
            if are_followed && are_apart && farthest(&a.start, &b.start) < SAME {
                let from_first = farthest(&a.start, &guess.state);
                let from_second = farthest(&b.start, &other_look.guess.state);
                let farther = if from_first > from_second { place } else { other };
                found[farther] = Err(NoAnswer::NoResponse);
            }
        }
    }
}

fn is_missing(response: &Result<Response, NoAnswer>) -> bool {
    matches!(response, Err(NoAnswer::NoResponse))
}

/// Returns the number of turns after which the suspension's slowest transient has decayed.
fn transient_turns(case: &Case<'_>) -> usize {
    let modes = &case.frozen.modes[..SUSPENSION_MODES];
    let decay_per_s = modes.iter().map(|mode| -mode.re_per_s).fold(f64::INFINITY, f64::min);
    let transient_s = -libm::log(TRANSIENT_LEFT) / decay_per_s.max(0.0);
    (transient_s.min(LONGEST_TRANSIENT_S) / case.row.turn_s()).ceil() as usize
}

/// Takes searches to their ends, and what they find to its place.
fn take_found<'a>(
    looked: &[Look<'a>],
    found: &mut [Result<Response, NoAnswer>],
    searches: Vec<(usize, Solve<'a>)>,
    cancel: Cancel<'_>,
) -> bool {
    let (places, mut solves): (Vec<usize>, Vec<Solve<'_>>) = searches.into_iter().unzip();
    if !finish(&mut solves, cancel) {
        return false;
    }
    for (place, solve) in places.into_iter().zip(solves) {
        found[place] = looked[place].answer(solve);
    }
    true
}

/// Leaves out what is found from the linear response and is on a curve all the same, and what is on
/// both.
fn forget_known(looked: &[Look<'_>], found: &mut [Result<Response, NoAnswer>]) {
    for place in 0..found.len() {
        let Look { number, guess, .. } = &looked[place];
        let Ok(Response { start, .. }) = &found[place] else { continue };
        let is_same =
            |known: &Response| (0..COORDINATES).all(|i| (known.start[i] - start[i]).abs() < SAME);
        let first = looked.partition_point(|look| look.number < *number);
        let last = if guess.is_followed() { place } else { found.len() };
        let alike = (first..last).take_while(|other| looked[*other].number == *number);
        let mut others = alike.filter(|other| *other != place);
        let is_known = !guess.is_on_curve && others.any(|it| found[it].as_ref().is_ok_and(is_same));
        if is_known {
            found[place] = Err(NoAnswer::NoResponse);
        }
    }
}

/// Checks whether a turn of the machine as it is leaves these responses, where a harmonic of the
/// drum's speed may be near the hinge's frequency.
fn are_moved(
    looked: &[Look<'_>],
    found: &[Result<Response, NoAnswer>],
    cancel: Cancel<'_>,
) -> Vec<bool> {
    let mut are_moved = vec![false; looked.len()];
    let mut places = Vec::new();
    let mut asked = Vec::new();
    for (place, (look, response)) in looked.iter().zip(found).enumerate() {
        let hinge = look.case.frozen.modes[SUSPENSION_MODES].frequency_rpm();
        let is_near =
            look.case.row.has_corners() || hinge < HARMONICS_OF_HINGE * look.case.row.speed_rpm;
        if let (true, Ok(response), Some(_)) = (is_near, response, look.case.row.caps)
            && let Ok(plain) = look.case.without_caps()
        {
            places.push(place);
            asked.push(Asked { row: plain.row, start: response.start, is_seen: false });
        }
    }
    for ((place, asked), turned) in places.into_iter().zip(&asked).zip(turns(&asked, cancel)) {
        let Row { point, speed_rpm, .. } = asked.row;
        let missing = missing(point, speed_rpm, &asked.start, &turned.end);
        are_moved[place] = missing.is_nan() || missing > RETURN_MISS;
    }
    are_moved
}

/// Returns the linear model's response, where there is one; else the machine at rest.
fn from_linear(point: &Point, linear: &LinearResponse) -> Guess {
    let rest = <Nonlinear<f64> as LaneModel<f64>>::at_rest(point);
    let is_known = linear.start.iter().all(|x| x.is_finite());
    let deviation = |i: usize| if is_known { linear.start[i] } else { 0.0 };
    let state = core::array::from_fn(|i| rest[i] + deviation(i));
    Guess { branch: 0, between_rpm: [None; 2], state, factors: None, is_on_curve: false }
}

/// A response that is looked for.
struct Look<'a> {
    /// Position of what was asked.
    number: usize,
    case: Case<'a>,
    guess: Guess,
    /// Largest deviations by the linear model.
    linear: [f64; crate::channel::CHANNELS],
}

impl Look<'_> {
    fn answer(&self, solve: Solve<'_>) -> Result<Response, NoAnswer> {
        let (start, seen) = solve.found().ok_or(NoAnswer::NoResponse)?;
        let is_far = |i: usize| (start[i] - self.guess.state[i]).abs() > FARTHEST_FROM_GUESS;
        if self.guess.is_followed() && (0..COORDINATES).any(is_far) {
            return Err(NoAnswer::NoResponse);
        }
        let row = &self.case.row;
        let unit_per_s = row.unit_per_s();
        let matrix = per_unit(&seen.monodromy, unit_per_s);
        let (mu, vector) = leading_multiplier(&self.case, &matrix).ok_or(NoAnswer::Eigenvalues)?;
        let mut response = Response {
            speed_rpm: row.speed_rpm,
            is_on_curve: self.guess.is_on_curve,
            branch: self.guess.branch,
            between_rpm: self.guess.between_rpm,
            beyond: beyond(row.point, &seen),
            nonlinear: seen.peaks,
            linear: self.linear,
            start,
            multiplier: [mu.re, mu.im].map(rounded),
            participants: Vec::new(),
        };
        if response.kind() != Kind::Stable {
            let speed = row.speed_rpm * TAU / 60.0;
            let frozen = modes(row.point, 0.0, speed).map_err(|_| NoAnswer::Eigenvalues)?;
            response.participants = named(row.point, &frozen, &vector, unit_per_s);
        }
        Ok(response)
    }
}

/// Returns the largest of a monodromy matrix's multipliers whose motion is the suspension's, in the
/// upper half plane, and its vector; none where the eigenvalues are not finite. The matrix's speeds
/// count per the row's unit.
///
/// The hinge's motion, where it is not capped, counts if it grows. It hardly decays, so that a
/// stable response would else be said to be near an edge at speeds and stiffnesses without caps
/// alone.
pub(crate) fn leading_multiplier(case: &Case<'_>, matrix: &Mat<f64>) -> Option<(c64, Mat<c64>)> {
    let unit_per_s = case.row.unit_per_s();
    let mut multipliers = matrix.eigenvalues().ok()?;
    if multipliers.iter().any(|mu| !mu.re.is_finite() || !mu.im.is_finite()) {
        return None;
    }
    multipliers.retain(|mu| mu.im >= 0.0);
    multipliers
        .sort_by(|a, b| b.norm_sqr().total_cmp(&a.norm_sqr()).then_with(|| b.im.total_cmp(&a.im)));
    multipliers.into_iter().find_map(|mu| {
        let vector = vector_of(matrix, mu);
        let shares = shares(&case.frozen, &vector, unit_per_s);
        let count = if mu.norm_sqr() > 1.0 { case.judged } else { SUSPENSION_MODES };
        let judged = shares.iter().filter(|(mode, _)| *mode < count);
        let share: f64 = judged.map(|(_, energy)| energy).sum();
        // Not finite where there is no such disturbance.
        (share >= JUDGED_SHARE).then_some((mu, vector))
    })
}

/// Returns what of the machine's geometry a motion passes.
fn beyond(point: &Point, seen: &Seen) -> Option<Beyond> {
    let rest = attachments(point, point.equilibrium());
    let mut is_past = [false; 2];
    for state in &seen.states {
        let now = attachments(point, &core::array::from_fn(|i| state[i]));
        for ((is_past, now), rest) in is_past.iter_mut().zip(now).zip(&rest) {
            *is_past |= now.iter().zip(rest).any(|(now, rest)| {
                let along: f64 = now.iter().zip(rest).map(|(a, b)| a * b).sum();
                along.is_nan() || along <= 0.0
            });
        }
    }
    if is_past[0] {
        Some(Beyond::SpringHooks)
    } else if is_past[1] {
        Some(Beyond::DamperEnds)
    } else if seen.gap_m.is_nan() || seen.gap_m <= 0.0 {
        Some(Beyond::Clearance)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::CHANNELS;
    use crate::stability::tests::{prepared, with};

    /// The paper's machine with little damping has three responses at 255 rpm. One that its search
    /// did not find, or found in another's place, is found again.
    #[test]
    fn a_branch_that_was_lost_is_found_again() {
        let point = prepared(with(0.3, 30.0), 100.0);
        let mut followed = Responses::follow(&[(&point, 255.0)], None, Cancel::Never).remove(0);
        let case = followed.up.settings.case(255.0).unwrap();
        let guesses = followed.guesses(255.0).into_iter();
        let looked: Vec<Look<'_>> = guesses
            .map(|guess| Look { number: 0, case: case.clone(), guess, linear: [0.0; CHANNELS] })
            .collect();
        let searches = looked.iter();
        let searches = searches.map(|look| Solve::new(look.case.row, look.guess.state, None));
        let mut solves: Vec<Solve<'_>> = searches.collect();
        assert!(finish(&mut solves, Cancel::Never));
        let answers = looked.iter().zip(solves).map(|(look, solve)| look.answer(solve));
        let found: Vec<Result<Response, NoAnswer>> = answers.collect();
        let branches = found.iter().map(|response| response.as_ref().unwrap().branch);
        assert_eq!(branches.collect::<Vec<_>>(), [0, 1, 2]);
        for place in 0..3 {
            for instead in [Err(NoAnswer::NoResponse), found[(place + 1) % 3].clone()] {
                let mut lost = found.clone();
                lost[place] = instead;
                assert!(find_lost_branches(&looked, &mut lost, Cancel::Never));
                let [again, before] =
                    [&lost, &found].map(|found| found[place].as_ref().unwrap().start);
                let apart = (0..COORDINATES).map(|i| (again[i] - before[i]).abs());
                assert!(apart.fold(0.0, f64::max) < SAME, "{place}");
            }
        }
        // An even number may have vanished together, at a fold: they are not searched for.
        let mut none = vec![Err(NoAnswer::NoResponse), found[1].clone(), Err(NoAnswer::NoResponse)];
        assert!(find_lost_branches(&looked, &mut none, Cancel::Never));
        assert!(is_missing(&none[0]) && is_missing(&none[2]));
    }
}

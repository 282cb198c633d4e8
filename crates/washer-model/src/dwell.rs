//! The attractors of a machine at a held speed, by trajectories from many starts.
//!
//! An attractor is not found if no trajectory leads to it.

mod exponent;
mod lines;
mod multipliers;
mod starts;
#[cfg(test)]
mod tests;
mod trajectory;
mod turns;

use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::run::model::{LaneModel, NonlinearModel};
use crate::stability::period_map::TurnSetup;
use crate::stability::settings::{HeldCase, Settings};
use crate::{HeldSpeed, Modes, Reading, Recorders, Response, ResponseError, find_responses};
use exponent::compute_exponents;
use lane_ode::{Cancel, Simd};
use multipliers::{PeriodicOrbit, compute_growths_per_s};
use starts::{
    Directions, Kick, MODE_DIRECTIONS, add_kick, is_from_rest, kick_directions, perturb,
    plan_kicks, random_kick_count,
};
use std::sync::Arc;
use trajectory::{BLOCK_TURNS, HeldTrajectory, NextComputation, WINDOW_TURNS, are_peaks_close};
use turns::{HeldState, integrate_turns, record_turns};

pub use exponent::Exponent;

/// Maximum relative difference of the largest deviations, in every channel, of two settled motions
/// that count as the same. Doubling it may merge different motions.
const SETTLED_TOLERANCE: f64 = 0.01;

/// Maximum relative difference of the largest deviations of two motions that count as the same if
/// both are chaotic or have not settled. Basis: two intervals of a chaotic motion differ by up to
/// this. Doubling it merges any two such motions.
const CHAOS_TOLERANCE: f64 = 0.5;

/// Maximum relative difference of the largest deviations of a motion that has not settled and of
/// the settled motion that it counts as approaching. Doubling it may merge different motions.
const UNSETTLED_TOLERANCE: f64 = 0.05;

/// Number of bisections between a kick after which the machine returns and one after which it does
/// not. Doubling it divides the width of the bracket by 32.
const THRESHOLD_BISECTIONS: usize = 5;

/// The starts of the trajectories at a held speed, and their length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartRule {
    /// The number of starts; each perturbed response is a start even if there are more responses
    /// than this.
    pub start_count: usize,
    /// The hardest kick (rad/s of the tub's rocking).
    pub max_kick_rad_per_s: f64,
    /// The maximum time of a trajectory (s).
    pub max_time_s: f64,
    /// Whether to search for the smallest kick after which the machine does not return.
    pub finds_threshold: bool,
    /// The recorders of additional outputs of each motion.
    pub recorders: Recorders,
}

impl Default for StartRule {
    fn default() -> Self {
        Self {
            start_count: 12,
            max_kick_rad_per_s: 6.0,
            max_time_s: 600.0,
            finds_threshold: false,
            recorders: Recorders::default(),
        }
    }
}

/// The outcome of a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AttractorStatus {
    /// The trajectory settled.
    Ok,
    /// The trajectory left the range in which the model holds.
    LeftRange {
        /// The time at which it left the range, to within a turn (s).
        time_s: f64,
    },
    /// The trajectory did not settle within [`StartRule::max_time_s`].
    NotSettled,
    /// The trajectory looked chaotic, but trajectories from its states ended in other motions.
    Transient {
        /// The mean life (s): the total time of these trajectories over the number of those that
        /// ended.
        life_s: f64,
    },
}

/// The kind of a settled motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MotionKind {
    /// A motion that repeats.
    Periodic {
        /// The period in turns of the drum.
        turns: u32,
    },
    /// A motion with a second frequency that is not locked to the drum's: the states once a turn
    /// lie on a closed curve.
    QuasiPeriodic {
        /// The strongest line of these states, from 0 to half the drum's speed (cycles per minute).
        /// The drum's speed less this frequency is an equivalent frequency.
        frequency_cpm: f64,
    },
    /// A motion whose largest Lyapunov exponent is above 0 by three standard errors, and in which
    /// trajectories from eight of its states stayed for 240 s.
    Chaotic,
}

/// A motion in which trajectories at a held speed end: an attractor, or the reason why none was
/// reached.
#[derive(Clone, Debug, PartialEq)]
pub struct Attractor {
    /// The outcome of the first trajectory.
    pub status: AttractorStatus,
    /// The kind of the motion, if it has settled.
    pub motion_kind: Option<MotionKind>,
    /// The number of starts that ended in the motion; 0 if only transients ended in it.
    pub starts: u32,
    /// The smallest kick from the response that led to the motion (rad/s); 0 if a perturbed
    /// response led to it, `None` if only a kick of the machine at rest, a transient or a carried
    /// state led to it.
    pub least_kick_rad_per_s: Option<f64>,
    /// The largest deviations from equilibrium over the last turns (32 turns of a periodic motion,
    /// 128 of a motion with two frequencies, 256 of all others), in the order of
    /// [`Channel::ALL`](crate::Channel::ALL) (m, rad).
    pub peaks: [f64; CHANNELS],
    /// The least gap between drum and tub at the ends of steps of these turns (m).
    pub min_gap_m: f64,
    /// The rate at which neighbouring trajectories separate. It comes from the Floquet multipliers
    /// of periodic motions, without an error, and from a perturbed run for other motions; `None` if
    /// the spectrum shows two frequencies.
    pub exponent: Option<Exponent>,
    /// The length of the trajectory (s).
    pub time_s: f64,
    /// The last state at which the unbalance is up: coordinates (m, rad), then their speeds
    /// (per s).
    pub end_state: [f64; STATES],
    /// The states at which the unbalance is up, of at most the last 256 turns; coordinates are from
    /// equilibrium.
    pub sections: Vec<[f64; STATES]>,
    /// The records of [`StartRule::recorders`] over 128 further turns.
    pub extra_reading: Reading,
}

/// The motions in which a machine ends at a held speed.
#[derive(Clone, Debug, PartialEq)]
pub struct Attractors {
    /// The periodic responses. If none was found, the machine starts from rest.
    pub responses: Vec<Response>,
    /// The motions in the order in which starts led to them: the first is that of the perturbed
    /// periodic response.
    pub attractors: Vec<Attractor>,
    /// The number of starts.
    pub starts: u32,
    /// The smallest tried kick (rad/s) after which the machine does not return to the first motion;
    /// `None` if it always returns, or without [`StartRule::finds_threshold`].
    pub threshold_rad_per_s: Option<f64>,
}

/// Finds the motions in which machines end at held speeds, on lanes of `simd` or of a narrower
/// instruction set. The results at a held speed do not depend on the other held speeds. A held
/// speed with a state in `carried_states` has this state, perturbed like a response, as its only
/// start.
///
/// # Errors
/// Returns [`ResponseError`] for a held speed without an answer, and [`ResponseError::Stopped`]
/// once `cancel` is requested.
pub fn find_attractors(
    simd: Simd,
    held_speeds: &[HeldSpeed<'_>],
    carried_states: &[Option<[f64; STATES]>],
    rule: &StartRule,
    cancel: Cancel<'_>,
) -> Vec<Result<Attractors, ResponseError>> {
    find_attractors_from_responses(
        simd,
        held_speeds,
        find_responses(held_speeds, cancel),
        carried_states,
        rule,
        cancel,
    )
}

/// Finds motions like [`find_attractors`], from the results of [`find_responses`] for these held
/// speeds.
///
/// # Errors
/// Returns the errors of [`find_attractors`].
pub fn find_attractors_from_responses(
    simd: Simd,
    held_speeds: &[HeldSpeed<'_>],
    responses_by_speed: Vec<Result<Vec<Response>, ResponseError>>,
    carried_states: &[Option<[f64; STATES]>],
    rule: &StartRule,
    cancel: Cancel<'_>,
) -> Vec<Result<Attractors, ResponseError>> {
    let mut searches: Vec<Result<SpeedSearch<'_>, ResponseError>> =
        Vec::with_capacity(held_speeds.len());
    let mut settings: Option<Settings<'_>> = None;
    for (k, (held_speed, responses_or_error)) in
        held_speeds.iter().zip(responses_by_speed).enumerate()
    {
        // Consecutive held speeds of the same point share the point's settings.
        let is_same_point =
            |settings: &Settings<'_>| core::ptr::eq(settings.point, held_speed.point);
        let settings = match settings.take().filter(is_same_point) {
            Some(same_point_settings) => settings.insert(same_point_settings),
            None => settings.insert(Settings::new(held_speed.point)),
        };
        let responses = match responses_or_error {
            Ok(responses) => responses,
            Err(ResponseError::NoResponse) => Vec::new(),
            Err(reason) => {
                searches.push(Err(reason));
                continue;
            }
        };
        let carried_state = carried_states.get(k).copied().flatten();
        let new_search = |held_case| SpeedSearch::new(held_case, responses, carried_state, rule);
        searches.push(settings.held_case(held_speed.speed_rpm).map(new_search));
    }
    let mut is_complete = run_to_end(simd, &mut searches, cancel);
    for search in searches.iter_mut().flatten() {
        search.start_survivors();
    }
    is_complete = is_complete && run_to_end(simd, &mut searches, cancel);
    for search in searches.iter_mut().flatten() {
        search.find_transients();
    }
    if rule.finds_threshold {
        for search in searches.iter_mut().flatten() {
            search.find_brackets();
        }
        for _ in 0..THRESHOLD_BISECTIONS {
            for search in searches.iter_mut().flatten() {
                search.start_at_midpoints();
            }
            is_complete = is_complete && run_to_end(simd, &mut searches, cancel);
            for search in searches.iter_mut().flatten() {
                search.bisect_brackets();
            }
        }
    }
    let results = searches.into_iter().map(|search| match search {
        Ok(search) if is_complete => Ok(search.into_attractors()),
        Ok(_) => Err(ResponseError::Stopped),
        Err(reason) => Err(reason),
    });
    let mut results: Vec<Result<(Attractors, TurnSetup<'_>), ResponseError>> = results.collect();
    if rule.recorders.need_all_states() {
        record_motions(simd, results.iter_mut().flatten(), rule.recorders);
    }
    results.into_iter().map(|results| results.map(|(attractors, _)| attractors)).collect()
}

/// Integrates motions further, and records them with `recorders`.
fn record_motions<'a, 'f>(
    simd: Simd,
    results: impl Iterator<Item = &'f mut (Attractors, TurnSetup<'a>)>,
    recorders: Recorders,
) where
    'a: 'f,
{
    let mut motions = Vec::new();
    let mut held_states = Vec::new();
    for (attractors, setup) in results {
        let is_in_range =
            |motion: &&mut Attractor| !matches!(motion.status, AttractorStatus::LeftRange { .. });
        for motion in attractors.attractors.iter_mut().filter(is_in_range) {
            held_states.push(HeldState { setup: *setup, state: motion.end_state });
            motions.push(motion);
        }
    }
    for (motion, (_, extra_reading)) in
        motions.into_iter().zip(record_turns(simd, &held_states, WINDOW_TURNS, recorders))
    {
        motion.extra_reading = extra_reading;
    }
}

/// Integrates the trajectories of all searches together until they end. Returns false once `cancel`
/// is requested.
fn run_to_end(
    simd: Simd,
    searches: &mut [Result<SpeedSearch<'_>, ResponseError>],
    cancel: Cancel<'_>,
) -> bool {
    loop {
        if cancel.is_requested() {
            return false;
        }
        let mut turn_trajectories: Vec<&mut HeldTrajectory<'_>> = Vec::new();
        let mut exponent_trajectories = Vec::new();
        let mut exponent_requests = Vec::new();
        let mut multiplier_trajectories: Vec<(&mut HeldTrajectory<'_>, u32)> = Vec::new();
        let mut periodic_orbits: Vec<PeriodicOrbit<'_, '_>> = Vec::new();
        for search in searches.iter_mut().flatten() {
            let direction = search.directions[MODE_DIRECTIONS - 1];
            let held_case = &search.held_case;
            for trajectory in &mut search.trajectories {
                match trajectory.next_computation {
                    NextComputation::Turns => turn_trajectories.push(trajectory),
                    NextComputation::Multipliers(period_turns) => {
                        periodic_orbits.push(PeriodicOrbit {
                            held_case,
                            held_state: trajectory.held_state,
                            period_turns,
                        });
                        multiplier_trajectories.push((trajectory, period_turns));
                    }
                    NextComputation::Exponent => {
                        exponent_requests.push((trajectory.held_state, direction));
                        exponent_trajectories.push(trajectory);
                    }
                    NextComputation::Nothing => {}
                }
            }
        }
        if turn_trajectories.is_empty()
            && exponent_trajectories.is_empty()
            && multiplier_trajectories.is_empty()
        {
            return true;
        }
        let growths_per_s = compute_growths_per_s(&periodic_orbits, cancel);
        for ((trajectory, period_turns), growth_per_s) in
            multiplier_trajectories.into_iter().zip(growths_per_s)
        {
            trajectory.add_growth(period_turns, growth_per_s);
        }
        let held_states: Vec<HeldState<'_>> =
            turn_trajectories.iter().map(|trajectory| trajectory.held_state).collect();
        for (trajectory, turns) in
            turn_trajectories.into_iter().zip(integrate_turns(simd, &held_states, BLOCK_TURNS))
        {
            trajectory.add_turns(turns);
        }
        if !exponent_trajectories.is_empty() {
            let exponents = compute_exponents(simd, &exponent_requests);
            for (trajectory, exponent) in exponent_trajectories.into_iter().zip(exponents) {
                trajectory.add_exponent(exponent);
            }
        }
    }
}

/// The start of a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Origin {
    /// A perturbed periodic response.
    Response,
    /// A kick from the first periodic response.
    Kicked(Kick),
    /// A kick of the machine at rest, whose drum turns at the held speed at once.
    Rest,
    /// The final state at another speed.
    Carried,
    /// A state of another trajectory.
    Trajectory,
}

/// The search for the motions of a machine at a held speed.
struct SpeedSearch<'a> {
    held_case: HeldCase<'a>,
    responses: Vec<Response>,
    /// The state that is kicked: the first response, or rest without responses.
    kicked_state: [f64; STATES],
    directions: Directions,
    max_time_s: f64,
    trajectories: Vec<HeldTrajectory<'a>>,
    /// The origin of each trajectory.
    origins: Vec<Origin>,
    /// The number of trajectories from starts, which come first. Further trajectories search for
    /// the threshold, or test whether chaos lasts.
    start_count: usize,
    /// The indices of chaotic trajectories, each with the range of indices of the trajectories from
    /// its states.
    survivors: Vec<(usize, core::ops::Range<usize>)>,
    /// The brackets of the threshold, by direction along mode shapes: the size of a kick after
    /// which the machine returns, and of one after which it does not (rad/s).
    brackets: [Option<[f64; 2]>; MODE_DIRECTIONS],
    /// The smallest kick in a random direction after which the machine does not return (rad/s).
    random_threshold_rad_per_s: Option<f64>,
}

impl<'a> SpeedSearch<'a> {
    fn new(
        held_case: HeldCase<'a>,
        responses: Vec<Response>,
        carried_state: Option<[f64; STATES]>,
        rule: &StartRule,
    ) -> Self {
        let point = held_case.setup.point;
        let frozen_modes: Arc<Modes> = Arc::clone(&held_case.frozen_modes);
        let rest_state = <NonlinearModel<f64> as LaneModel<f64>>::rest_state(point);
        let kicked_state = responses.first().map_or(rest_state, |response| response.start_state);
        let mut states: Vec<([f64; STATES], Origin)> = Vec::new();
        let directions = kick_directions(point, &frozen_modes, random_kick_count(rule.start_count));
        if let Some(carried_state) = carried_state {
            states.push((perturb(point, &frozen_modes, &carried_state), Origin::Carried));
        } else {
            let response_states = responses.iter().map(|response| response.start_state);
            let response_states: Vec<_> =
                if responses.is_empty() { vec![kicked_state] } else { response_states.collect() };
            let to_perturbed_start =
                |start| (perturb(point, &frozen_modes, start), Origin::Response);
            states.extend(response_states.iter().map(to_perturbed_start));
            let count = rule.start_count.saturating_sub(states.len());
            for kick in plan_kicks(count, rule.max_kick_rad_per_s) {
                let (state, origin) = match is_from_rest(kick) {
                    true => (&rest_state, Origin::Rest),
                    false => (&kicked_state, Origin::Kicked(kick)),
                };
                states.push((add_kick(state, &directions, kick), origin));
            }
        }
        let mut search = Self {
            held_case,
            responses,
            kicked_state,
            directions,
            max_time_s: rule.max_time_s,
            trajectories: Vec::new(),
            origins: Vec::new(),
            start_count: states.len(),
            survivors: Vec::new(),
            brackets: [None; MODE_DIRECTIONS],
            random_threshold_rad_per_s: None,
        };
        for (state, origin) in states {
            search.start_trajectory(state, origin);
        }
        search
    }

    fn start_trajectory(&mut self, state: [f64; STATES], origin: Origin) {
        let held_state = HeldState { setup: self.held_case.setup, state };
        let is_unstable = |response: &&Response| response.growth_per_s() > 0.0;
        let unstable_responses = self.responses.iter().filter(is_unstable);
        let unstable_orbits =
            unstable_responses.map(|response| vec![response.start_state]).collect();
        self.trajectories.push(HeldTrajectory::new(held_state, unstable_orbits, self.max_time_s));
        self.origins.push(origin);
    }

    /// Starts trajectories from the states of each chaotic motion.
    fn start_survivors(&mut self) {
        for chaotic in 0..self.start_count {
            if !self.trajectories[chaotic].is_chaotic() || self.find_survivors(chaotic).is_some() {
                continue;
            }
            let first_survivor = self.trajectories.len();
            let unstable_orbits = self.trajectories[chaotic].unstable_orbits().to_vec();
            for state in self.trajectories[chaotic].recent_states() {
                let held_state = HeldState { setup: self.held_case.setup, state };
                self.trajectories
                    .push(HeldTrajectory::new_survivor(held_state, unstable_orbits.clone()));
                self.origins.push(Origin::Trajectory);
            }
            self.survivors.push((chaotic, first_survivor..self.trajectories.len()));
        }
    }

    /// Returns the trajectories that started from states of a trajectory's motion.
    fn find_survivors(&self, trajectory: usize) -> Option<core::ops::Range<usize>> {
        let attractor = self.trajectories[trajectory].to_attractor();
        let is_same_motion = |(other, _): &&(usize, core::ops::Range<usize>)| {
            are_same_motion(&self.trajectories[*other].to_attractor(), &attractor)
        };
        self.survivors.iter().find(is_same_motion).map(|(_, survivors)| survivors.clone())
    }

    /// Marks chaotic motions as transients if one of the trajectories from their states ended in
    /// another motion.
    fn find_transients(&mut self) {
        let mut mean_lives_s: Vec<(usize, f64)> = Vec::new();
        for chaotic in (0..self.start_count).filter(|&start| self.trajectories[start].is_chaotic())
        {
            let Some(survivors) = self.find_survivors(chaotic) else { continue };
            let survivors = &self.trajectories[survivors];
            let ended_count = survivors.iter().filter(|trajectory| trajectory.has_ended()).count();
            if ended_count > 0 {
                let time_s: f64 = survivors.iter().map(HeldTrajectory::time_s).sum();
                mean_lives_s.push((chaotic, time_s / ended_count as f64));
            }
        }
        for (trajectory, life_s) in mean_lives_s {
            self.trajectories[trajectory].mark_transient(life_s);
        }
    }

    /// Whether a trajectory ended in the motion of the first one.
    fn returns_to_first(&self, trajectory: usize) -> bool {
        are_same_motion(
            &self.trajectories[0].to_attractor(),
            &self.trajectories[trajectory].to_attractor(),
        )
    }

    /// Brackets the threshold in every direction along mode shapes, and finds the smallest random
    /// kick after which the machine does not return.
    fn find_brackets(&mut self) {
        for (trajectory, origin) in self.origins.iter().enumerate() {
            if let Origin::Kicked((direction, size)) = *origin
                && direction >= MODE_DIRECTIONS
                && !self.returns_to_first(trajectory)
            {
                let smallest_kick_rad_per_s = self
                    .random_threshold_rad_per_s
                    .map_or(size, |smallest_kick_rad_per_s| smallest_kick_rad_per_s.min(size));
                self.random_threshold_rad_per_s = Some(smallest_kick_rad_per_s);
            }
        }
        for direction in 0..MODE_DIRECTIONS {
            let mut direction_kicks: Vec<(f64, bool)> = Vec::new();
            for (trajectory, origin) in self.origins.iter().enumerate() {
                if let Origin::Kicked((kick_direction, size)) = *origin
                    && kick_direction == direction
                {
                    direction_kicks.push((size, self.returns_to_first(trajectory)));
                }
            }
            direction_kicks.sort_by(|a, b| a.0.total_cmp(&b.0));
            let first_index_above =
                direction_kicks.iter().position(|(_, has_returned)| !has_returned);
            self.brackets[direction] = first_index_above.map(|first_index_above| {
                let size_below = first_index_above
                    .checked_sub(1)
                    .map_or(0.0, |index_below| direction_kicks[index_below].0);
                [size_below, direction_kicks[first_index_above].0]
            });
        }
    }

    /// Starts a trajectory at the midpoint of each bracket.
    fn start_at_midpoints(&mut self) {
        for direction in 0..MODE_DIRECTIONS {
            if let Some([below, above]) = self.brackets[direction] {
                let kick = (direction, 0.5 * (below + above));
                let state = add_kick(&self.kicked_state, &self.directions, kick);
                self.start_trajectory(state, Origin::Kicked(kick));
            }
        }
    }

    /// Halves the brackets by the outcomes of the trajectories from their midpoints.
    fn bisect_brackets(&mut self) {
        let midpoint_count = self.brackets.iter().flatten().count();
        for trajectory in self.trajectories.len() - midpoint_count..self.trajectories.len() {
            let has_returned = self.returns_to_first(trajectory);
            if let Origin::Kicked((direction, size)) = self.origins[trajectory]
                && let Some(bracket) = &mut self.brackets[direction]
            {
                bracket[usize::from(!has_returned)] = size;
            }
        }
    }

    fn into_attractors(self) -> (Attractors, TurnSetup<'a>) {
        let mut motions: Vec<Attractor> = Vec::new();
        for (trajectory, origin) in self.trajectories[..self.start_count].iter().zip(&self.origins)
        {
            let mut attractor = trajectory.to_attractor();
            attractor.least_kick_rad_per_s = match origin {
                Origin::Response => Some(0.0),
                Origin::Kicked((_, size)) => Some(*size),
                Origin::Rest | Origin::Carried | Origin::Trajectory => None,
            };
            match motions.iter_mut().find(|motion| are_same_motion(motion, &attractor)) {
                Some(existing) => existing.merge(&attractor),
                None => motions.push(attractor),
            }
        }
        let transient_trajectories =
            self.survivors.iter().flat_map(|(_, survivors)| survivors.clone());
        for trajectory in
            transient_trajectories.filter(|&trajectory| self.trajectories[trajectory].has_ended())
        {
            let attractor = Attractor { starts: 0, ..self.trajectories[trajectory].to_attractor() };
            if !motions.iter().any(|motion| are_same_motion(motion, &attractor)) {
                motions.push(attractor);
            }
        }
        let mode_thresholds = self.brackets.iter().flatten().map(|[_, above]| *above);
        let attractors = Attractors {
            attractors: motions,
            starts: self.start_count as u32,
            threshold_rad_per_s: mode_thresholds
                .chain(self.random_threshold_rad_per_s)
                .reduce(f64::min),
            responses: self.responses,
        };
        (attractors, self.held_case.setup)
    }
}

/// Whether two trajectories ended in the same motion.
fn are_same_motion(a: &Attractor, b: &Attractor) -> bool {
    match (a.status, b.status) {
        (AttractorStatus::LeftRange { .. }, AttractorStatus::LeftRange { .. }) => return true,
        (AttractorStatus::LeftRange { .. }, _) | (_, AttractorStatus::LeftRange { .. }) => {
            return false;
        }
        _ => {}
    }
    let is_irregular =
        |attractor: &Attractor| matches!(attractor.motion_kind, None | Some(MotionKind::Chaotic));
    let tolerance = match (a.motion_kind, b.motion_kind) {
        _ if is_irregular(a) && is_irregular(b) => CHAOS_TOLERANCE,
        (None, _) | (_, None) => UNSETTLED_TOLERANCE,
        _ => SETTLED_TOLERANCE,
    };
    are_peaks_close(&a.peaks, &b.peaks, tolerance)
}

impl Attractors {
    /// Whether the largest deviations of a motion are near those of a periodic response. A motion
    /// near a response that has not settled approaches or leaves the response slowly.
    pub fn is_near_response(&self, motion: &Attractor) -> bool {
        let is_near = |response: &Response| {
            are_peaks_close(&motion.peaks, &response.nonlinear_peaks, CHAOS_TOLERANCE)
        };
        self.responses.iter().any(is_near)
    }
}

impl Attractor {
    /// The names of the kinds of motions: first those of settled motions, then the reasons why a
    /// kind is not known.
    pub const KIND_NAMES: [&str; 8] = [
        "periodic",
        "periodic_2",
        "periodic_m",
        "quasi_periodic",
        "chaotic",
        "transient",
        "left_range",
        "not_settled",
    ];

    /// Returns the index of the motion's kind in [`Self::KIND_NAMES`].
    pub fn kind_index(&self) -> usize {
        match (self.motion_kind, self.status) {
            (Some(MotionKind::Periodic { turns }), _) => (turns as usize).min(3) - 1,
            (Some(MotionKind::QuasiPeriodic { .. }), _) => 3,
            (Some(MotionKind::Chaotic), _) => 4,
            (None, AttractorStatus::Transient { .. }) => 5,
            (None, AttractorStatus::LeftRange { .. }) => 6,
            (None, AttractorStatus::Ok | AttractorStatus::NotSettled) => 7,
        }
    }

    /// Adds another start that ended in this motion. The largest deviations of motions that are
    /// chaotic or have not settled are those of all their starts.
    fn merge(&mut self, other: &Self) {
        let starts = self.starts + 1;
        let kicks_rad_per_s = [self.least_kick_rad_per_s, other.least_kick_rad_per_s];
        let least_kick_rad_per_s = kicks_rad_per_s.into_iter().flatten().reduce(f64::min);
        if self.motion_kind.is_none() && other.motion_kind.is_some() {
            *self = other.clone();
        } else if matches!(self.motion_kind, None | Some(MotionKind::Chaotic)) {
            for (peak, other) in self.peaks.iter_mut().zip(other.peaks) {
                *peak = peak.max(other);
            }
            self.min_gap_m = self.min_gap_m.min(other.min_gap_m);
        }
        self.starts = starts;
        self.least_kick_rad_per_s = least_kick_rad_per_s;
    }
}

//! A trajectory at a held speed, which is integrated until it settles into a motion.
//!
//! A motion has settled if its states once a turn repeat after a whole number of turns and its
//! multipliers show that the orbit is stable; if its spectrum has two frequencies; or if its
//! largest Lyapunov exponent is positive.

use super::exponent::state_distance;
use super::lines::find_strongest_line;
use super::starts::largest_deviation;
use super::turns::{HeldState, TurnRecord};
use super::{Attractor, AttractorStatus, MotionKind};
use crate::channel::CHANNELS;
use crate::coordinates::{STATES, TUB_PITCH, TUB_YAW};
use crate::{Exponent, Reading};

/// Number of turns between two tests of a trajectory. Doubling it ends trajectories up to 16 turns
/// later.
pub(super) const BLOCK_TURNS: usize = 16;

/// Number of turns of a window, over which largest deviations are taken. Doubling it doubles the
/// least time of motions that do not repeat.
pub(super) const WINDOW_TURNS: usize = 128;

/// Longest period that is tested, in turns. Doubling it finds longer periods, but needs more turns
/// than [`PERIOD_TEST_TURNS`].
const MAX_PERIOD_TURNS: usize = 16;

/// Number of turns that must repeat. Doubling it doubles the least time of a periodic motion.
const PERIOD_TEST_TURNS: usize = 32;

/// Tolerance of the states that repeat, as a share of the motion's size. Doubling it ends
/// trajectories sooner and less exactly.
const PERIOD_TOLERANCE: f64 = 1e-4;

/// Tolerance of the states that repeat, as a share of the motion's size, once two windows have the
/// same largest deviations. Doubling it takes more motions with two frequencies for periodic ones.
const WIDE_PERIOD_TOLERANCE: f64 = 1e-3;

/// Factor of the tolerance with which no shorter period may fit. Basis: a disturbance that changes
/// sign with every period and decays slowly looks like twice the period; test
/// `slow_decay_is_not_taken_for_a_doubled_period`. Doubling it delays the end of motions of several
/// turns.
const SHORTER_PERIOD_FACTOR: f64 = 20.0;

/// Maximum remaining change of a periodic motion that has settled, as a share of its size. Doubling
/// it doubles the error of its amplitudes.
const REMAINING_TOLERANCE: f64 = 2e-3;

/// Minimum decrease of the changes between two stretches of [`PERIOD_TEST_TURNS`] / 2 turns, as a
/// share, for the extrapolation of the remaining change. Basis: changes that hardly decrease would
/// make it infinite or negative. Doubling it halves the greatest extrapolated change.
const MIN_DECREASE: f64 = 1e-3;

/// Maximum relative difference of the largest deviations of two windows of a steady motion.
/// Doubling it ends trajectories sooner and less exactly.
const STEADY_TOLERANCE: f64 = 3e-3;

/// Maximum relative difference of the largest deviations of two windows for which a Lyapunov
/// exponent is computed. Basis: windows of chaotic motions differ by up to this. Doubling it
/// computes exponents of motions that still grow.
const CHAOS_WINDOW_TOLERANCE: f64 = 0.4;

/// Number of windows before the first Lyapunov exponent of a motion that does not settle; the next
/// one is computed after twice the turns. Doubling it delays the detection of chaos.
const WINDOWS_BEFORE_EXPONENT: usize = 4;

/// Maximum residual of the spectrum without the strongest line and its multiples, as a share, for a
/// motion with two frequencies. Doubling it accepts more motions with three frequencies.
const MAX_SPECTRUM_RESIDUAL: f64 = 0.1;

/// Tolerance of a period, as a share of the motion's size, with which a motion with a positive
/// exponent counts as passing from one motion to another. Basis: chaotic motions repeat less
/// accurately. Doubling it finds less chaos.
const PASSING_PERIOD_TOLERANCE: f64 = 0.05;

/// Maximum residual of the spectrum, as a share, with which a motion with a positive exponent
/// counts as passing from one motion to another. Basis: chaotic motions have larger residuals.
/// Doubling it finds less chaos.
const PASSING_SPECTRUM_RESIDUAL: f64 = 0.3;

/// Distance from an unstable orbit, as a share of the orbit's size, below which no motion counts as
/// settled. Doubling it delays motions that are close to an unstable orbit.
const CLOSE_ORBIT_DISTANCE: f64 = 1e-2;

/// Distance from an unstable orbit, as a share of the orbit's size, below which a motion that
/// departs from the orbit does not count as settled. Doubling it delays large motions about an
/// unstable orbit.
const NEAR_ORBIT_DISTANCE: f64 = 0.5;

/// Minimum ratio of the distances from an unstable orbit in two successive windows with which a
/// motion departs from it. Doubling it misses slow departures.
const DEPARTURE_RATIO: f64 = 1.02;

/// Time (s) for which trajectories from states of a chaotic motion must stay in it. Basis: a motion
/// of 660 s of mean life ends from at least one of eight states within 240 s with a probability of
/// 1 - exp(-8 * 240 / 660) = 0.945; test `chaos_survives_or_is_a_transient` has it. Doubling it
/// halves the rate of escape that is detected with the same probability.
const SURVIVAL_S: f64 = 240.0;

/// Number of trajectories from states of a chaotic motion. Basis: the probability that
/// [`SURVIVAL_S`] states. Doubling it halves the rate of escape that is detected with the same
/// probability.
const SURVIVOR_COUNT: usize = 8;

/// The computation that a trajectory needs next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NextComputation {
    /// A block of turns.
    Turns,
    /// The multipliers of the periodic orbit, with its period in turns.
    Multipliers(u32),
    /// The largest Lyapunov exponent.
    Exponent,
    /// No computation: the trajectory has ended.
    Nothing,
}

/// A trajectory at a held speed.
pub(super) struct HeldTrajectory<'a> {
    pub(super) held_state: HeldState<'a>,
    /// Unstable periodic orbits, by their states once a turn, which trajectories leave slowly.
    unstable_orbits: Vec<Vec<[f64; STATES]>>,
    /// The turns of the last two windows.
    turns: Vec<TurnRecord>,
    /// The number of turns so far.
    turn_count: usize,
    /// The number of turns after which the trajectory ends even if it has not settled.
    max_turns: usize,
    pub(super) next_computation: NextComputation,
    /// The number of turns before which no further exponent is computed.
    next_exponent_turn: usize,
    exponent: Option<Exponent>,
    status: AttractorStatus,
    motion_kind: Option<MotionKind>,
}

impl<'a> HeldTrajectory<'a> {
    pub(super) fn new(
        held_state: HeldState<'a>,
        unstable_orbits: Vec<Vec<[f64; STATES]>>,
        max_time_s: f64,
    ) -> Self {
        let max_windows =
            (max_time_s / held_state.setup.turn_s() / WINDOW_TURNS as f64).ceil().max(2.0);
        Self {
            held_state,
            unstable_orbits,
            turns: Vec::with_capacity(2 * WINDOW_TURNS + BLOCK_TURNS),
            turn_count: 0,
            max_turns: max_windows as usize * WINDOW_TURNS,
            next_computation: NextComputation::Turns,
            next_exponent_turn: 0,
            exponent: None,
            status: AttractorStatus::NotSettled,
            motion_kind: None,
        }
    }

    /// Creates a trajectory from a state of a chaotic one, which tests for [`SURVIVAL_S`] whether
    /// the motion lasts. Its exponent is not computed.
    pub(super) fn new_survivor(
        held_state: HeldState<'a>,
        unstable_orbits: Vec<Vec<[f64; STATES]>>,
    ) -> Self {
        Self {
            next_exponent_turn: usize::MAX,
            ..Self::new(held_state, unstable_orbits, SURVIVAL_S)
        }
    }

    /// Whether the motion is chaotic, unless survivors show that it is a transient.
    pub(super) fn is_chaotic(&self) -> bool {
        self.motion_kind == Some(MotionKind::Chaotic)
    }

    /// Returns [`SURVIVOR_COUNT`] equally spaced states of the last turns.
    pub(super) fn recent_states(&self) -> Vec<[f64; STATES]> {
        let interval_turns = (self.turns.len() / SURVIVOR_COUNT).max(1);
        self.turns
            .iter()
            .rev()
            .step_by(interval_turns)
            .take(SURVIVOR_COUNT)
            .map(|turn| turn.end_state)
            .collect()
    }

    /// Returns the known unstable periodic orbits.
    pub(super) fn unstable_orbits(&self) -> &[Vec<[f64; STATES]>] {
        &self.unstable_orbits
    }

    /// Marks the motion as a transient with a mean life (s).
    pub(super) fn mark_transient(&mut self, life_s: f64) {
        self.status = AttractorStatus::Transient { life_s };
        self.motion_kind = None;
    }

    /// Returns the integrated time (s).
    pub(super) fn time_s(&self) -> f64 {
        self.turn_count as f64 * self.turn_s()
    }

    /// Whether the trajectory has settled or left the model's range.
    pub(super) fn has_ended(&self) -> bool {
        self.motion_kind.is_some() || matches!(self.status, AttractorStatus::LeftRange { .. })
    }

    /// Adds the next [`BLOCK_TURNS`] turns and chooses the next computation. Fewer turns mean that
    /// the trajectory has left the model's range.
    pub(super) fn add_turns(&mut self, turns: Vec<TurnRecord>) {
        self.turn_count += turns.len();
        if turns.len() < BLOCK_TURNS {
            let time_s = (self.turn_count + 1) as f64 * self.turn_s();
            self.status = AttractorStatus::LeftRange { time_s };
            self.next_computation = NextComputation::Nothing;
            self.turns.extend(turns);
            return;
        }
        self.turns.extend(turns);
        let surplus_turns = self.turns.len().saturating_sub(2 * WINDOW_TURNS);
        self.turns.drain(..surplus_turns);
        if let Some(last_turn) = self.turns.last() {
            self.held_state.state = last_turn.end_state;
        }
        // Near an unstable orbit a trajectory looks settled, and needs further turns.
        if !self.is_near_unstable_orbit() {
            self.test_motion();
        }
        if self.next_computation == NextComputation::Turns && self.turn_count >= self.max_turns {
            self.next_computation = NextComputation::Nothing;
        }
    }

    /// Tests whether the motion repeats or has two frequencies, or may be chaotic.
    fn test_motion(&mut self) {
        if let Some(period) = self.find_unambiguous_period(PERIOD_TOLERANCE)
            && self.has_steady_peaks(PERIOD_TEST_TURNS, PERIOD_TOLERANCE)
            && self.remaining_change(period) < REMAINING_TOLERANCE
        {
            self.next_computation = NextComputation::Multipliers(period);
            return;
        }
        if !self.turn_count.is_multiple_of(WINDOW_TURNS) || self.turns.len() < 2 * WINDOW_TURNS {
            return;
        }
        let may_compute_exponent = self.turn_count >= self.next_exponent_turn;
        if self.has_steady_peaks(WINDOW_TURNS, STEADY_TOLERANCE) {
            if let Some(period) = self.find_unambiguous_period(WIDE_PERIOD_TOLERANCE) {
                if self.remaining_change(period) < REMAINING_TOLERANCE {
                    self.next_computation = NextComputation::Multipliers(period);
                }
            } else if let Some(quasi_periodic) = self.find_two_frequencies(MAX_SPECTRUM_RESIDUAL) {
                self.mark_settled(quasi_periodic);
            } else if may_compute_exponent {
                self.next_computation = NextComputation::Exponent;
            }
        } else if may_compute_exponent
            && self.turn_count >= WINDOWS_BEFORE_EXPONENT * WINDOW_TURNS
            && self.has_steady_peaks(WINDOW_TURNS, CHAOS_WINDOW_TOLERANCE)
        {
            self.next_computation = NextComputation::Exponent;
        }
    }

    /// Adds the growth (1/s) of the fastest growing disturbance of the periodic orbit. An orbit
    /// whose disturbances grow is a saddle, which the trajectory passes.
    pub(super) fn add_growth(&mut self, period: u32, growth_per_s: Option<f64>) {
        self.next_computation = NextComputation::Turns;
        match growth_per_s {
            Some(rate_per_s) if rate_per_s <= 0.0 => {
                self.exponent = Some(Exponent { rate_per_s, error_per_s: 0.0 });
                return self.mark_settled(MotionKind::Periodic { turns: period });
            }
            Some(_) => {
                let orbit =
                    self.turns.iter().rev().take(period as usize).map(|turn| turn.end_state);
                self.unstable_orbits.push(orbit.collect());
            }
            None => {}
        }
        if self.turn_count >= self.max_turns {
            self.next_computation = NextComputation::Nothing;
        }
    }

    /// Adds the largest Lyapunov exponent. A motion with a positive exponent is chaotic, unless it
    /// passes from one motion to another; near these it almost repeats or has few lines.
    pub(super) fn add_exponent(&mut self, exponent: Option<Exponent>) {
        self.next_computation = NextComputation::Turns;
        self.exponent = exponent;
        self.next_exponent_turn = 2 * self.turn_count;
        let is_passing = self.find_period(PASSING_PERIOD_TOLERANCE).is_some()
            || self.find_two_frequencies(PASSING_SPECTRUM_RESIDUAL).is_some();
        let is_positive = exponent.is_some_and(|exponent| exponent.is_positive());
        if is_positive && !is_passing {
            self.mark_settled(MotionKind::Chaotic);
        } else if !is_positive
            && self.has_steady_peaks(WINDOW_TURNS, STEADY_TOLERANCE)
            && let Some(quasi_periodic) = self.find_two_frequencies(f64::INFINITY)
        {
            self.mark_settled(quasi_periodic);
        } else if self.turn_count >= self.max_turns {
            self.next_computation = NextComputation::Nothing;
        }
    }

    fn mark_settled(&mut self, motion_kind: MotionKind) {
        self.status = AttractorStatus::Ok;
        self.motion_kind = Some(motion_kind);
        self.next_computation = NextComputation::Nothing;
    }

    fn turn_s(&self) -> f64 {
        self.held_state.setup.turn_s()
    }

    /// Returns a state with its coordinates from equilibrium.
    fn subtract_equilibrium(&self, state: &[f64; STATES]) -> [f64; STATES] {
        let equilibrium = self.held_state.setup.point.equilibrium();
        core::array::from_fn(|i| state[i] - equilibrium.get(i).copied().unwrap_or(0.0))
    }

    /// Returns the motion in which the trajectory ended.
    pub(super) fn to_attractor(&self) -> Attractor {
        let turn_count = match self.motion_kind {
            Some(MotionKind::Periodic { .. }) => PERIOD_TEST_TURNS,
            Some(MotionKind::QuasiPeriodic { .. }) => WINDOW_TURNS,
            Some(MotionKind::Chaotic) | None => 2 * WINDOW_TURNS,
        };
        let turns = &self.turns[self.turns.len().saturating_sub(turn_count)..];
        Attractor {
            status: self.status,
            motion_kind: self.motion_kind,
            starts: 1,
            peaks: largest_peaks(turns),
            min_gap_m: turns.iter().map(|turn| turn.min_gap_m).fold(f64::INFINITY, f64::min),
            exponent: self.exponent,
            least_kick_rad_per_s: None,
            time_s: self.time_s(),
            end_state: self.held_state.state,
            sections: self
                .turns
                .iter()
                .map(|turn| self.subtract_equilibrium(&turn.end_state))
                .collect(),
            extra_reading: Reading::default(),
        }
    }

    /// Whether the trajectory is close to an unstable orbit, or near one and departs from it.
    fn is_near_unstable_orbit(&self) -> bool {
        let window_turns = (self.turns.len() / 2).min(WINDOW_TURNS);
        let (earlier_turns, later_turns) = self.turns.split_at(self.turns.len() - window_turns);
        self.unstable_orbits.iter().any(|orbit| {
            let state_sizes =
                orbit.iter().map(|state| largest_deviation(self.held_state.setup.point, state));
            let orbit_size = state_sizes.fold(0.0, f64::max);
            let orbit_distance = |turn: &TurnRecord| {
                let distances = orbit
                    .iter()
                    .map(|state| state_distance(&self.held_state.setup, &turn.end_state, state));
                distances.fold(f64::INFINITY, f64::min) / orbit_size
            };
            let max_distance =
                |turns: &[TurnRecord]| turns.iter().map(orbit_distance).fold(0.0, f64::max);
            let later_distance = max_distance(later_turns);
            let earlier_distance =
                max_distance(&earlier_turns[earlier_turns.len() - window_turns..]);
            later_distance < CLOSE_ORBIT_DISTANCE
                || (later_distance < NEAR_ORBIT_DISTANCE
                    && later_distance > DEPARTURE_RATIO * earlier_distance)
        })
    }

    /// Whether the largest deviations of the last turns agree with those of as many turns before.
    fn has_steady_peaks(&self, turns: usize, tolerance: f64) -> bool {
        let Some(first_turn) = self.turns.len().checked_sub(2 * turns) else { return false };
        let (earlier_turns, later_turns) = self.turns[first_turn..].split_at(turns);
        are_peaks_close(&largest_peaks(earlier_turns), &largest_peaks(later_turns), tolerance)
    }

    /// Returns the period (turns) of the last turns, within a tolerance as a share of the motion's
    /// size.
    fn find_period(&self, tolerance: f64) -> Option<u32> {
        let first_turn = self.turns.len().checked_sub(PERIOD_TEST_TURNS)?;
        let deviation =
            |turn: &TurnRecord| largest_deviation(self.held_state.setup.point, &turn.end_state);
        let motion_size = self.turns[first_turn..].iter().map(deviation).fold(0.0, f64::max);
        let repeats_after = |period: &usize| {
            *period <= first_turn
                && (first_turn..self.turns.len()).all(|k| {
                    let [state, earlier] = [k, k - period].map(|k| &self.turns[k].end_state);
                    state_distance(&self.held_state.setup, state, earlier) < tolerance * motion_size
                })
        };
        (1..=MAX_PERIOD_TURNS).find(repeats_after).map(|period| period as u32)
    }

    /// Returns [`Self::find_period`], if no shorter period fits with the tolerance times
    /// [`SHORTER_PERIOD_FACTOR`].
    fn find_unambiguous_period(&self, tolerance: f64) -> Option<u32> {
        let period = self.find_period(tolerance)?;
        (self.find_period(SHORTER_PERIOD_FACTOR * tolerance) == Some(period)).then_some(period)
    }

    /// Returns the remaining change of a periodic motion, as a share of its size. The changes
    /// between windows of whole periods are extrapolated as a geometric series.
    fn remaining_change(&self, period: u32) -> f64 {
        let window_turns = PERIOD_TEST_TURNS / 2 / period as usize * period as usize;
        let Some(first_turn) = self.turns.len().checked_sub(3 * window_turns) else {
            return f64::INFINITY;
        };
        let max_change_from = |from: usize| {
            let change_at = |k: usize| {
                state_distance(
                    &self.held_state.setup,
                    &self.turns[k].end_state,
                    &self.turns[k + window_turns].end_state,
                )
            };
            (from..from + window_turns).map(change_at).fold(0.0, f64::max)
        };
        let earlier_change = max_change_from(first_turn);
        let later_change = max_change_from(first_turn + window_turns);
        let change_ratio = (later_change / earlier_change).min(1.0 - MIN_DECREASE);
        later_change * change_ratio
            / (1.0 - change_ratio)
            / largest_deviation(self.held_state.setup.point, &self.held_state.state)
    }

    /// Returns a motion with two frequencies, if the residual of the spectrum of yaw and pitch once
    /// a turn is below `max_residual`.
    fn find_two_frequencies(&self, max_residual: f64) -> Option<MotionKind> {
        let state_signal =
            |i: usize| -> Vec<f64> { self.turns.iter().map(|turn| turn.end_state[i]).collect() };
        let line = find_strongest_line(&[state_signal(TUB_YAW), state_signal(TUB_PITCH)])?;
        let frequency_cpm = line.frequency * self.held_state.setup.speed_rpm;
        (line.residual < max_residual).then_some(MotionKind::QuasiPeriodic { frequency_cpm })
    }
}

/// Returns the largest deviations over turns.
fn largest_peaks(turns: &[TurnRecord]) -> [f64; CHANNELS] {
    core::array::from_fn(|i| turns.iter().map(|turn| turn.peaks[i]).fold(0.0, f64::max))
}

/// Whether largest deviations agree in every channel, to a share of the larger one.
pub(super) fn are_peaks_close(a: &[f64; CHANNELS], b: &[f64; CHANNELS], tolerance: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance * a.max(*b))
}

//! One trajectory at a constant speed, turn by turn until what is seen of it no longer changes.

use super::exponent::apart;
use super::hold::{Held, Turn};
use super::lines::strongest;
use super::starts::size;
use super::{Ending, Settled, State};
use crate::channel::CHANNELS;
use crate::coordinates::{STATES, TUB_PITCH, TUB_YAW};
use crate::{Exponent, Reading};

/// Turns between two looks.
pub(super) const BLOCK: usize = 16;

/// Turns over which largest deviations are taken.
pub(super) const WINDOW: usize = 128;

/// The longest period, in turns.
const LONGEST_PERIOD: usize = 16;

/// Turns that must repeat, and how well: soon, or once the windows are alike.
const REPEATING: usize = 32;
const REPEATS: f64 = 1e-4;
const ROUGHLY_REPEATS: f64 = 1e-3;

/// A motion has a longer period where it misses shorter ones by this much more; else it still
/// settles.
const CLEARLY: f64 = 20.0;

/// A motion that repeats has settled where it has less than this share of its size to go.
/// Changes that shrink by less than the second in [`REPEATING`] / 2 turns are taken to shrink by
/// that.
const TO_GO: f64 = 2e-3;
const SLOWEST: f64 = 1e-3;

/// Windows are alike whose largest deviations differ by less than this share; those of chaotic
/// motions by less than the second.
const ALIKE: f64 = 3e-3;
const ROUGHLY_ALIKE: f64 = 0.4;

/// The first window after which a motion that does not settle is asked for its exponent; each next
/// time it has gone on for twice as long.
const FIRST_ASKED: usize = 4;

/// A spectrum whose strongest line and multiples leave less than this share is of two frequencies.
const TWO_LINES: f64 = 0.1;

/// What repeats this well, or has a line this strong, is on its way from one motion to another
/// where neighbours part: chaos does neither.
const ON_ITS_WAY: [f64; 2] = [0.05, 0.3];

/// Closer than the first share to an unstable response nothing is settled; nor closer than the
/// second while a window is farther from it than the one before, by more than the third.
const CLOSE: f64 = 1e-2;
const NEAR: f64 = 0.5;
const FARTHER: f64 = 1.02;

/// The time (s) that trajectories from states of a chaotic motion have to stay in it, and the
/// number of these. Basis: a motion of 660 s of mean life ends from at least one of eight states
/// within 240 s with a probability of 1 - exp(-8 * 240 / 660) = 0.945; test
/// `chaos_survives_or_is_a_transient` has it. Doubling either halves the rate of escape that is
/// seen with the same probability.
const SURVIVAL_S: f64 = 240.0;
const SURVIVORS: usize = 8;

/// What a trajectory needs next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Need {
    Turns,
    /// The multipliers of the periodic orbit that it repeats, of so many turns.
    Multipliers(u32),
    Exponent,
    Nothing,
}

/// A trajectory on its way.
pub(super) struct Course<'a> {
    pub(super) held: Held<'a>,
    /// Unstable periodic orbits, which it leaves slowly: their states once a turn.
    leaves: Vec<Vec<[f64; STATES]>>,
    /// The last two windows.
    turns: Vec<Turn>,
    made: usize,
    most: usize,
    pub(super) need: Need,
    /// Turns before which it is not asked for its exponent again.
    asked_from: usize,
    exponent: Option<Exponent>,
    state: State,
    settled: Option<Settled>,
}

impl<'a> Course<'a> {
    pub(super) fn new(held: Held<'a>, leaves: Vec<Vec<[f64; STATES]>>, longest_s: f64) -> Self {
        let windows = (longest_s / held.row.turn_s() / WINDOW as f64).ceil().max(2.0);
        Self {
            held,
            leaves,
            turns: Vec::with_capacity(2 * WINDOW + BLOCK),
            made: 0,
            most: windows as usize * WINDOW,
            need: Need::Turns,
            asked_from: 0,
            exponent: None,
            state: State::NotSettled,
            settled: None,
        }
    }

    /// Returns the trajectory that goes on from a state of another as long as chaos has to survive:
    /// it is not asked for its exponent.
    pub(super) fn survivor(held: Held<'a>, leaves: Vec<Vec<[f64; STATES]>>) -> Self {
        Self { asked_from: usize::MAX, ..Self::new(held, leaves, SURVIVAL_S) }
    }

    /// Whether it is chaotic, as far as is known.
    pub(super) fn is_chaotic(&self) -> bool {
        self.settled == Some(Settled::Chaotic)
    }

    /// Returns states of its last turns, evenly.
    pub(super) fn own_states(&self) -> Vec<[f64; STATES]> {
        let every = (self.turns.len() / SURVIVORS).max(1);
        self.turns.iter().rev().step_by(every).take(SURVIVORS).map(|turn| turn.end).collect()
    }

    /// Returns the unstable periodic orbits that it met.
    pub(super) fn leaves(&self) -> &[Vec<[f64; STATES]>] {
        &self.leaves
    }

    /// Calls it a transient, which lives for this long on average.
    pub(super) fn call_transient(&mut self, life_s: f64) {
        self.state = State::Transient { life_s };
        self.settled = None;
    }

    /// Returns how long it was followed (s).
    pub(super) fn time_s(&self) -> f64 {
        self.made as f64 * self.turn_s()
    }

    /// Whether it ended in a motion or left the model's range.
    pub(super) fn has_ended(&self) -> bool {
        self.settled.is_some() || matches!(self.state, State::LeftRange { .. })
    }

    /// Its next [`BLOCK`] turns.
    pub(super) fn take(&mut self, turns: Vec<Turn>) {
        self.made += turns.len();
        if turns.len() < BLOCK {
            self.state = State::LeftRange { time_s: (self.made + 1) as f64 * self.turn_s() };
            self.need = Need::Nothing;
            self.turns.extend(turns);
            return;
        }
        self.turns.extend(turns);
        let kept = self.turns.len().saturating_sub(2 * WINDOW);
        self.turns.drain(..kept);
        if let Some(last) = self.turns.last() {
            self.held.state = last.end;
        }
        if self.is_leaving() {
            // It has not left yet.
        } else if let Some(turns) = self.clear_period(REPEATS)
            && self.are_alike(REPEATING, REPEATS)
            && self.to_go(turns) < TO_GO
        {
            self.need = Need::Multipliers(turns);
        } else if self.made.is_multiple_of(WINDOW) && self.turns.len() == 2 * WINDOW {
            let may_ask = self.made >= self.asked_from;
            if self.are_alike(WINDOW, ALIKE) {
                if let Some(turns) = self.clear_period(ROUGHLY_REPEATS) {
                    if self.to_go(turns) < TO_GO {
                        self.need = Need::Multipliers(turns);
                    }
                } else if let Some(two) = self.two_frequencies(TWO_LINES) {
                    self.settle(two);
                } else if may_ask {
                    self.need = Need::Exponent;
                }
            } else if may_ask
                && self.made >= FIRST_ASKED * WINDOW
                && self.are_alike(WINDOW, ROUGHLY_ALIKE)
            {
                self.need = Need::Exponent;
            }
        }
        if self.need == Need::Turns && self.made >= self.most {
            self.need = Need::Nothing;
        }
    }

    /// Takes how fast the fastest disturbance of the orbit that it repeats grows (1/s). An orbit
    /// whose disturbances grow is a saddle: the trajectory is on its way past it.
    pub(super) fn take_growth(&mut self, period: u32, growth_per_s: Option<f64>) {
        self.need = Need::Turns;
        match growth_per_s {
            Some(per_s) if per_s <= 0.0 => {
                self.exponent = Some(Exponent { per_s, error_per_s: 0.0 });
                return self.settle(Settled::Periodic { turns: period });
            }
            Some(_) => {
                let orbit = self.turns.iter().rev().take(period as usize).map(|turn| turn.end);
                self.leaves.push(orbit.collect());
            }
            None => {}
        }
        if self.made >= self.most {
            self.need = Need::Nothing;
        }
    }

    /// How fast its neighbours part.
    pub(super) fn take_exponent(&mut self, exponent: Option<Exponent>) {
        (self.need, self.exponent) = (Need::Turns, exponent);
        self.asked_from = 2 * self.made;
        let [repeats, line] = ON_ITS_WAY;
        let is_on_its_way = self.period(repeats).is_some() || self.two_frequencies(line).is_some();
        let is_positive = exponent.is_some_and(|exponent| exponent.is_positive());
        if is_positive && !is_on_its_way {
            self.settle(Settled::Chaotic);
        } else if !is_positive
            && self.are_alike(WINDOW, ALIKE)
            && let Some(two) = self.two_frequencies(f64::INFINITY)
        {
            self.settle(two);
        } else if self.made >= self.most {
            self.need = Need::Nothing;
        }
    }

    fn settle(&mut self, settled: Settled) {
        (self.state, self.settled, self.need) = (State::Ok, Some(settled), Need::Nothing);
    }

    fn turn_s(&self) -> f64 {
        self.held.row.turn_s()
    }

    fn off_rest(&self, state: &[f64; STATES]) -> [f64; STATES] {
        let rest = self.held.row.point.equilibrium();
        core::array::from_fn(|i| state[i] - rest.get(i).copied().unwrap_or(0.0))
    }

    /// Where it ended.
    pub(super) fn ending(&self) -> Ending {
        let of = match self.settled {
            Some(Settled::Periodic { .. }) => REPEATING,
            Some(Settled::QuasiPeriodic { .. }) => WINDOW,
            Some(Settled::Chaotic) | None => 2 * WINDOW,
        };
        let turns = &self.turns[self.turns.len().saturating_sub(of)..];
        Ending {
            state: self.state,
            settled: self.settled,
            starts: 1,
            peaks: peaks(turns),
            min_gap_m: turns.iter().map(|turn| turn.gap_m).fold(f64::INFINITY, f64::min),
            exponent: self.exponent,
            least_kick_rad_per_s: None,
            time_s: self.time_s(),
            end: self.held.state,
            sections: self.turns.iter().map(|turn| self.off_rest(&turn.end)).collect(),
            extra: Reading::default(),
        }
    }

    /// Whether it is still beside an orbit that it leaves.
    fn is_leaving(&self) -> bool {
        let window = (self.turns.len() / 2).min(WINDOW);
        let (before, after) = self.turns.split_at(self.turns.len() - window);
        self.leaves.iter().any(|orbit| {
            let sizes = orbit.iter().map(|state| size(self.held.row.point, state));
            let size = sizes.fold(0.0, f64::max);
            let of = |turn: &Turn| {
                let gaps = orbit.iter().map(|state| apart(&self.held.row, &turn.end, state));
                gaps.fold(f64::INFINITY, f64::min) / size
            };
            let farthest = |turns: &[Turn]| turns.iter().map(of).fold(0.0, f64::max);
            let now = farthest(after);
            let then = farthest(&before[before.len() - window..]);
            now < CLOSE || (now < NEAR && now > FARTHER * then)
        })
    }

    /// Whether the largest deviations of the last so many turns are those of the turns before.
    fn are_alike(&self, turns: usize, share: f64) -> bool {
        let Some(first) = self.turns.len().checked_sub(2 * turns) else { return false };
        let (before, after) = self.turns[first..].split_at(turns);
        are_alike(&peaks(before), &peaks(after), share)
    }

    /// After how many turns the last ones repeat, to this share of the motion's size.
    fn period(&self, share: f64) -> Option<u32> {
        let first = self.turns.len().checked_sub(REPEATING)?;
        let of = |turn: &Turn| size(self.held.row.point, &turn.end);
        let size = self.turns[first..].iter().map(of).fold(0.0, f64::max);
        let repeats = |period: &usize| {
            *period <= first
                && (first..self.turns.len()).all(|k| {
                    let [now, then] = [k, k - period].map(|k| &self.turns[k].end);
                    apart(&self.held.row, now, then) < share * size
                })
        };
        (1..=LONGEST_PERIOD).find(repeats).map(|period| period as u32)
    }

    /// As [`Self::period`], where shorter ones are clearly none.
    fn clear_period(&self, share: f64) -> Option<u32> {
        let period = self.period(share)?;
        (self.period(CLEARLY * share) == Some(period)).then_some(period)
    }

    /// How far it is, as a share of its size, from where it comes to if each change between
    /// stretches of whole periods is as large a part of the last as that was of the one before.
    fn to_go(&self, period: u32) -> f64 {
        let stretch = REPEATING / 2 / period as usize * period as usize;
        let Some(first) = self.turns.len().checked_sub(3 * stretch) else { return f64::INFINITY };
        let change = |from: usize| {
            let of =
                |k: usize| apart(&self.held.row, &self.turns[k].end, &self.turns[k + stretch].end);
            (from..from + stretch).map(of).fold(0.0, f64::max)
        };
        let (then, now) = (change(first), change(first + stretch));
        let part = (now / then).min(1.0 - SLOWEST);
        now * part / (1.0 - part) / size(self.held.row.point, &self.held.state)
    }

    /// Two frequencies, if their lines leave no more than this share of yaw and pitch once a turn.
    fn two_frequencies(&self, most: f64) -> Option<Settled> {
        let signal = |i: usize| -> Vec<f64> { self.turns.iter().map(|turn| turn.end[i]).collect() };
        let line = strongest(&[signal(TUB_YAW), signal(TUB_PITCH)])?;
        let frequency_cpm = line.frequency * self.held.row.speed_rpm;
        (line.rest < most).then_some(Settled::QuasiPeriodic { frequency_cpm })
    }
}

fn peaks(turns: &[Turn]) -> [f64; CHANNELS] {
    core::array::from_fn(|i| turns.iter().map(|turn| turn.peaks[i]).fold(0.0, f64::max))
}

/// Whether largest deviations agree to a share of the larger in every channel.
pub(super) fn are_alike(a: &[f64; CHANNELS], b: &[f64; CHANNELS], share: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= share * a.max(*b))
}

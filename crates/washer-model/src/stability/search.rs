//! Searches driven by integrations over a turn: the driver of many side by side, and the search for
//! a periodic response at one speed.

use super::monodromy::Square;
use super::orbit::{Asked, Row, Seen, Turned, turns};
use crate::coordinates::{COORDINATES, STATES};
use crate::point::Point;
use core::f64::consts::TAU;
use lane_ode::{Aside, Cancel, Lu, N, Simd};

/// A search that asks for turns until it is over.
pub(super) trait Search<'a> {
    /// Returns the turns that it needs next; none once it is over.
    fn wants(&mut self) -> Vec<Asked<'a>>;

    /// Takes in what it asked for, in that order.
    fn take(&mut self, turned: Vec<Turned>);
}

/// Takes searches to their ends, the turns of all of them in lanes together. False if `cancel`
/// said so before that.
pub(super) fn finish<'a, S: Search<'a>>(searches: &mut [S], cancel: Cancel<'_>) -> bool {
    loop {
        let wanted: Vec<Vec<Asked<'a>>> = searches.iter_mut().map(Search::wants).collect();
        let asked: Vec<Asked<'a>> = wanted.concat();
        if asked.is_empty() {
            return true;
        }
        let mut turned = turns(&asked, cancel).into_iter();
        if cancel.is_requested() {
            return false;
        }
        for (search, wanted) in searches.iter_mut().zip(wanted) {
            if !wanted.is_empty() {
                search.take(turned.by_ref().take(wanted.len()).collect());
            }
        }
    }
}

/// Turns that the search for a response may take.
const MOST_TURNS: usize = 80;

/// The share of a response's greatest coordinate by which another turn should move it when it is
/// looked at for the last time. Basis: a hundredth of what it may be. Doubling it saves few turns.
const LAST_LOOK_MISS: f64 = 1e-10;

/// The share by which that turn may move it. Basis: amplitudes are compared to 1e-5. Doubling it
/// changes nothing.
const FOUND_MISS: f64 = 1e-8;

/// Smaller deviations (m, rad) count as this: without unbalance there is none but rounding.
const LEAST_SIZE: f64 = 1e-4;

/// The matrix is taken anew where a correction leaves more than this share of what was missing.
const FAST_ENOUGH: f64 = 0.2;

/// The miss after which a correction by the Jacobian at the state itself is the last one. Basis:
/// such a correction squares the miss. Doubling it ends searches a correction earlier.
const NEXT_IS_LAST: f64 = 1e-3;

/// The distance (m, rad; speeds over the drum's speed) within which a known response repels a
/// search. Basis: neighbours beside a fold are some millimetres apart, as in test
/// `a_branch_that_was_lost_is_found_again`. Doubling it makes searches pass neighbours that they
/// are meant to find.
const REPULSION_RANGE: f64 = 5e-3;

/// The largest difference from 1 of a step's factor with which a search may end. Basis: a search
/// that has converged takes steps of 1e-7 of a known response's distance, whose factor differs from
/// 1 by as much. Doubling it changes nothing there.
const DEFLATION_LEFT: f64 = 1e-3;

/// Returns how far a turn is from closing, as a share of its deviation; not finite if it left the
/// model's range.
pub(crate) fn missing(
    point: &Point,
    speed_rpm: f64,
    start: &[f64; STATES],
    end: &[f64; STATES],
) -> f64 {
    let rest = point.equilibrium();
    let speed = speed_rpm * TAU / 60.0;
    let mut missing = 0.0_f64;
    let mut size = LEAST_SIZE;
    for i in 0..COORDINATES {
        size = size.max((start[i] - rest[i]).abs());
        let by_speed = end[COORDINATES + i] - start[COORDINATES + i];
        let gap = (end[i] - start[i]).abs() + by_speed.abs() / speed;
        // NaN stays.
        missing = if gap > missing || gap.is_nan() { gap } else { missing };
    }
    missing / size
}

/// Factors of 1 - Phi.
pub(super) fn apart(monodromy: &Square) -> Option<Lu<STATES>> {
    let mut apart = monodromy.map(|row| row.map(|entry| -entry));
    for i in 0..STATES {
        apart[i][i] = apart[i][i] + 1.0;
    }
    factored(&apart)
}

/// Factors of a matrix.
pub(super) fn factored<const C: usize>(matrix: &[[N<f64>; C]; C]) -> Option<Lu<C>> {
    Simd::one_lane(Factor(matrix))
}

struct Factor<'a, const C: usize>(&'a [[N<f64>; C]; C]);

impl<const C: usize> Aside for Factor<'_, C> {
    type Output = Option<Lu<C>>;

    #[inline(always)]
    fn run(self) -> Option<Lu<C>> {
        Lu::new(*self.0)
    }
}

/// The search for a periodic response at one speed, by Newton's method: once with the matrix of a
/// response nearby, whose hinge rings in another phase, then with one of its own as long as that
/// brings it closer fast enough.
pub(super) struct Solve<'a> {
    row: Row<'a>,
    state: [f64; STATES],
    /// The factors of 1 - Phi; none where the next turn is to give it.
    factors: Option<Lu<STATES>>,
    turns: usize,
    /// Turns that the motion itself takes before the first correction.
    transient_turns: usize,
    /// The largest correction of a coordinate (m, rad).
    longest_step: f64,
    /// Responses that it is not to find, because they are known.
    known: Vec<[f64; STATES]>,
    missing: f64,
    is_last: bool,
    is_over: bool,
    found: Option<Box<Seen>>,
}

impl<'a> Solve<'a> {
    /// Returns a search from a state nearby, with factors of 1 - Phi of a response nearby if there
    /// are any.
    pub(super) fn new(row: Row<'a>, state: [f64; STATES], factors: Option<Lu<STATES>>) -> Self {
        Self {
            row,
            state,
            factors,
            turns: 0,
            transient_turns: 0,
            longest_step: f64::INFINITY,
            known: Vec::new(),
            missing: f64::INFINITY,
            is_last: false,
            is_over: false,
            found: None,
        }
    }

    /// Returns the search by damped Newton steps: none changes a coordinate by more than this (m,
    /// rad). It stays near its start where another response is close by.
    pub(super) fn damped(row: Row<'a>, state: [f64; STATES], longest_step: f64) -> Self {
        Self { longest_step, ..Self::new(row, state, None) }
    }

    /// Returns the damped search by deflated Newton steps (Farrell, Birkisson and Funke 2015):
    /// known responses repel it, so that it finds another.
    pub(super) fn deflated(
        row: Row<'a>,
        state: [f64; STATES],
        longest_step: f64,
        known: Vec<[f64; STATES]>,
    ) -> Self {
        Self { known, ..Self::damped(row, state, longest_step) }
    }

    /// Returns the factor that deflation puts on a Newton step: with the residual multiplied by
    /// m(x) = product over known responses r of 1 + 1 / |x - r|^2, the step d becomes
    /// d / (1 - d ln m), where d ln m is the derivative of ln m along d.
    fn deflation(&self, step: &[N<f64>; STATES]) -> f64 {
        let speed_rad_per_s = self.row.speed_rpm * TAU / 60.0;
        let unit = |i: usize| {
            if i < COORDINATES { REPULSION_RANGE } else { REPULSION_RANGE * speed_rad_per_s }
        };
        let mut along = 0.0;
        for known in &self.known {
            let mut squared = 0.0;
            let mut product = 0.0;
            for i in 0..STATES {
                let offset = (self.state[i] - known[i]) / unit(i);
                squared += offset * offset;
                product += offset * step[i].0 / unit(i);
            }
            along -= 2.0 * product / (squared * (1.0 + squared));
        }
        1.0 / (1.0 - along)
    }

    /// Returns the search that integrates the transient over a number of turns before it corrects.
    pub(super) fn after_transient(row: Row<'a>, state: [f64; STATES], turns: usize) -> Self {
        Self { transient_turns: turns, ..Self::new(row, state, None) }
    }

    /// Returns the state that it has come to.
    pub(super) const fn start(&self) -> [f64; STATES] {
        self.state
    }

    /// Returns the state with the unbalance up and the record of the turn from there; `None` if no
    /// response was found.
    pub(super) fn found(self) -> Option<([f64; STATES], Box<Seen>)> {
        Some((self.state, self.found?))
    }
}

impl<'a> Search<'a> for Solve<'a> {
    fn wants(&mut self) -> Vec<Asked<'a>> {
        if self.is_over {
            return Vec::new();
        }
        if self.transient_turns > 0 {
            return vec![Asked { row: self.row, start: self.state, is_seen: false }];
        }
        let is_seen = self.is_last || self.factors.is_none();
        let mut row = self.row;
        let is_careful = self.is_last || self.longest_step.is_finite();
        if !(is_careful || row.is_stepwise()) {
            // To come nearer, derivatives at half the instants are enough: of what was missing they
            // leave some 1e-7. But where motions have many harmonics they may lead past a response
            // for ever, from side to side: a damped search takes them at all instants.
            row.instants /= 2;
        }
        vec![Asked { row, start: self.state, is_seen }]
    }

    fn take(&mut self, turned: Vec<Turned>) {
        let Some(Turned { end, seen }) = turned.into_iter().next() else { return };
        if self.transient_turns > 0 {
            self.transient_turns -= 1;
            self.state = end;
            self.is_over = end.iter().any(|x| !x.is_finite());
            return;
        }
        self.turns += 1;
        let missing = missing(self.row.point, self.row.speed_rpm, &self.state, &end);
        if self.is_last && missing < FOUND_MISS {
            (self.is_over, self.found) = (true, seen);
            return;
        }
        let is_own = seen.is_some();
        let is_borrowed = self.turns == 1 && seen.is_none();
        match seen {
            Some(seen) => {
                self.factors = apart(&seen.monodromy);
                self.is_over = self.factors.is_none();
            }
            None if missing > FAST_ENOUGH * self.missing => self.factors = None,
            None => {}
        }
        self.is_over |= !missing.is_finite() || self.turns == MOST_TURNS;
        if let (false, Some(factors)) = (self.is_over, &self.factors) {
            let gap = core::array::from_fn(|i| N(end[i] - self.state[i]));
            let correction = factors.solve(&gap);
            let longest = correction[..COORDINATES].iter().map(|by| by.0.abs()).fold(0.0, f64::max);
            let factor = self.deflation(&correction);
            let share = factor * (self.longest_step / (factor.abs() * longest)).min(1.0);
            for i in 0..STATES {
                self.state[i] += share * correction[i].0;
            }
            // The next correction leaves as much less as the last one did.
            let rate = if self.missing.is_finite() { missing / self.missing } else { 1.0 };
            let is_close =
                missing * rate.min(1.0) < LAST_LOOK_MISS || is_own && missing < NEXT_IS_LAST;
            // A search that known responses still deflect has not converged.
            self.is_last = is_close && (share - 1.0).abs() < DEFLATION_LEFT;
            if is_borrowed {
                self.factors = None;
            }
            // Slow progress is judged over corrections, not over looks.
            self.missing = missing;
        }
        self.is_over |= self.state.iter().any(|x| !x.is_finite());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stability::settings::Settings;
    use crate::stability::tests::{prepared, with};

    /// A step towards a known response is turned round; far from all of them it stays as it is.
    #[test]
    fn known_responses_repel() {
        let point = prepared(with(0.4, 140.0), 100.0);
        let row = Settings::new(&point).case(250.0).unwrap().row;
        let known = [0.0; STATES];
        // Newton's step from beside a known response leads to it; the deflated one is so many times
        // as long.
        let factor = |distance_m: f64| {
            let mut state = known;
            state[0] = distance_m;
            let mut step = [N(0.0); STATES];
            step[0] = N(-distance_m);
            Solve::deflated(row, state, f64::INFINITY, vec![known]).deflation(&step)
        };
        assert!((factor(1e-6) + 1.0).abs() < 1e-3, "{}", factor(1e-6));
        assert!((factor(1.0) - 1.0).abs() < 1e-3, "{}", factor(1.0));
        let plain = Solve::new(row, known, None).deflation(&[N(1.0); STATES]);
        assert_eq!(plain, 1.0);
    }
}

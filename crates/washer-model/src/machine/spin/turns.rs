//! The times at which the drum completes turns, and the division of the window into turns.

use super::{Spin, SpinSegment};
use core::f64::consts::TAU;
use lane_ode::{N, trig};

/// The greatest number of bisections and Newton steps in the search for the time of a whole turn.
/// Basis: bisection reaches the spacing of floating-point numbers in 64 steps. Doubling it changes
/// nothing.
const MAX_ITERATIONS: usize = 64;

/// A piece of a segment in which the drum turns in one direction; times are from the segment's
/// start.
struct MonotonePiece<'a> {
    segment: &'a SpinSegment,
    from_s: f64,
    to_s: f64,
}

impl Spin {
    /// Returns the turns of the drum within a window (s), in either direction.
    pub fn turns_within(&self, window_s: [f64; 2]) -> f64 {
        let segments = self.segments();
        let monotone_pieces = monotone_pieces(&segments, window_s);
        monotone_pieces
            .iter()
            .filter(|piece| piece.start_s() >= window_s[0])
            .map(MonotonePiece::turns)
            .sum()
    }

    /// Returns the times from 0 to `end_s` at which the drum has made a whole number of turns; the
    /// first is 0.
    pub fn whole_turn_times_s(&self, end_s: f64) -> Vec<f64> {
        whole_turn_times_s(&self.segments(), [0.0, end_s])
    }
}

/// Returns the times at which a window is divided into whole turns of the drum, counted from the
/// start of the run in either direction (at theta = 2 pi k if the drum never reverses). Partial
/// turns at the window's ends are joined to the adjacent whole turn, so that a window with less
/// than two whole turns is not divided.
pub(crate) fn turn_division_times_s(segments: &[SpinSegment], window_s: [f64; 2]) -> Vec<f64> {
    let mut times_s = whole_turn_times_s(segments, window_s);
    times_s.pop();
    if !times_s.is_empty() {
        times_s.remove(0);
    }
    times_s
}

/// Returns the times in the closed window at which the drum has made a whole number of turns.
fn whole_turn_times_s(segments: &[SpinSegment], window_s: [f64; 2]) -> Vec<f64> {
    let mut times_s = Vec::new();
    let mut turns_before = 0.0_f64;
    let mut next_turn = 0.0;
    for piece in monotone_pieces(segments, window_s) {
        let turns_after = turns_before + piece.turns();
        if piece.start_s() >= window_s[0] {
            next_turn = turns_before.ceil().max(next_turn);
            let mut earliest_s = piece.from_s;
            while next_turn <= turns_after {
                earliest_s = piece.time_of_turns(next_turn - turns_before, earliest_s);
                times_s
                    .push((piece.segment.start_s.0 + earliest_s).clamp(window_s[0], window_s[1]));
                next_turn += 1.0;
            }
        }
        turns_before = turns_after;
    }
    times_s
}

/// Divides the run up to the window's end at the window's beginning and at reversals of the drum.
fn monotone_pieces(segments: &[SpinSegment], [from_s, to_s]: [f64; 2]) -> Vec<MonotonePiece<'_>> {
    let mut monotone_pieces = Vec::new();
    for (k, segment) in segments.iter().enumerate().filter(|(_, segment)| segment.start_s.0 < to_s)
    {
        let end_s =
            segments.get(k + 1).map_or(to_s, |next_segment| next_segment.start_s.0.min(to_s));
        let duration_s = end_s - segment.start_s.0;
        let mut boundaries_s = vec![0.0, duration_s];
        let mut add_boundary = |t_s: f64| {
            if 0.0 < t_s && t_s < duration_s {
                boundaries_s.push(t_s);
            }
        };
        add_boundary(from_s - segment.start_s.0);
        // A cycloidal ramp does not reverse.
        if segment.wave_turns.0 == 0.0 {
            add_boundary(-segment.turns_per_s.0 / (2.0 * segment.turns_per_s2.0));
        }
        boundaries_s.sort_by(f64::total_cmp);
        monotone_pieces.extend(boundaries_s.windows(2).map(|interval| MonotonePiece {
            segment,
            from_s: interval[0],
            to_s: interval[1],
        }));
    }
    monotone_pieces
}

impl MonotonePiece<'_> {
    /// Returns the time at which the piece begins, from the start of the run.
    fn start_s(&self) -> f64 {
        self.segment.start_s.0 + self.from_s
    }

    /// Returns the turns made in the piece.
    fn turns(&self) -> f64 {
        self.turns_until(self.to_s)
    }

    /// Returns the turns made in the piece up to a time.
    fn turns_until(&self, t: f64) -> f64 {
        (self.segment.turns(t) - self.segment.turns(self.from_s)).abs()
    }

    /// Returns the time at which a number of turns has been made in the piece, not before
    /// `earliest_s`.
    fn time_of_turns(&self, turns: f64, earliest_s: f64) -> f64 {
        let segment = self.segment;
        if segment.wave_turns.0 == 0.0 {
            let sign =
                if segment.turns(self.to_s) < segment.turns(self.from_s) { -1.0 } else { 1.0 };
            let turn_rate = sign * segment.turn_rate(self.from_s);
            // Solves turns = turn_rate t + sign b t^2 by the formula without cancellation.
            let discriminant_root = (turn_rate * turn_rate
                + 4.0 * sign * segment.turns_per_s2.0 * turns)
                .max(0.0)
                .sqrt();
            let elapsed_s =
                if turns > 0.0 { 2.0 * turns / (turn_rate + discriminant_root) } else { 0.0 };
            return (self.from_s + elapsed_s).clamp(earliest_s, self.to_s);
        }
        let mut lower_bound_s = earliest_s;
        let mut upper_bound_s = self.to_s;
        let mut t = lower_bound_s;
        for _ in 0..MAX_ITERATIONS {
            let remaining_turns = turns - self.turns_until(t);
            if remaining_turns > 0.0 {
                lower_bound_s = t;
            } else {
                upper_bound_s = t;
            }
            let newton_s = t + remaining_turns / segment.turn_rate(t).abs();
            let next_estimate_s = if lower_bound_s < newton_s && newton_s < upper_bound_s {
                newton_s
            } else {
                0.5 * (lower_bound_s + upper_bound_s)
            };
            if next_estimate_s == t {
                break;
            }
            t = next_estimate_s;
        }
        t
    }
}

impl SpinSegment {
    /// Returns the turns made up to `t` after the start; negative for backward turns.
    fn turns(&self, t: f64) -> f64 {
        let (_, cos) = trig::sin_cos_turns(N(self.wave_hz.0 * t));
        t * (self.turns_per_s.0 + self.turns_per_s2.0 * t) + self.wave_turns.0 * (cos.0 - 1.0)
    }

    /// Returns the turns per second at `t` after the start.
    fn turn_rate(&self, t: f64) -> f64 {
        let (sin, _) = trig::sin_cos_turns(N(self.wave_hz.0 * t));
        self.turns_per_s.0 + 2.0 * self.turns_per_s2.0 * t
            - TAU * self.wave_hz.0 * self.wave_turns.0 * sin.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Profile;

    /// Returns the fractional part of the angle in turns, from the equations' sine and cosine.
    fn phase_turns(spin: &Spin, t_s: f64) -> f64 {
        let segments = spin.segments();
        let segment = segments.iter().rev().find(|segment| segment.start_s.0 <= t_s).unwrap();
        let state = segment.state_at(N(t_s));
        state.sin.0.atan2(state.cos.0) / TAU
    }

    #[test]
    fn whole_turns_end_at_multiples_of_two_pi() {
        for spin in [
            Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 },
            Spin::Ramped { profile: Profile::Cycloidal, peak_rpm: 1200.0, ramp_s: 20.0 },
            Spin::Ramped { profile: Profile::Ramp, peak_rpm: -600.0, ramp_s: 4.0 },
            Spin::Table {
                time_s: vec![0.0, 5.0, 9.0, 20.0],
                speed_rpm: vec![30.0, 200.0, 50.0, 700.0],
            },
        ] {
            for window_s in [[0.0, 30.0], [13.3, 29.9]] {
                let times_s = whole_turn_times_s(&spin.segments(), window_s);
                let turns = spin.turns_within(window_s);
                assert!(
                    (times_s.len() as f64 - turns).abs() <= 1.0,
                    "{} for {turns}: {spin:?}",
                    times_s.len()
                );
                assert!(times_s.is_sorted() && times_s.len() > 30, "{spin:?}");
                for t_s in &times_s {
                    assert!(window_s[0] <= *t_s && *t_s <= window_s[1]);
                    assert!(phase_turns(&spin, *t_s).abs() < 1e-9, "{t_s}: {spin:?}");
                }
            }
        }
    }

    #[test]
    fn partial_turns_are_joined_to_the_adjacent_whole_turn() {
        // The drum makes one turn per second after the first turn, which takes two seconds.
        let spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 60.0, ramp_s: 2.0 };
        let turn_times_s = |window_s| turn_division_times_s(&spin.segments(), window_s);
        let assert_near = |times: Vec<f64>, expected: &[f64]| {
            assert_eq!(times.len(), expected.len(), "{times:?}");
            assert!(times.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{times:?}");
        };
        assert_near(turn_times_s([2.5, 6.5]), &[4.0, 5.0]);
        // A window from whole turn to whole turn has no partial turns.
        assert_near(turn_times_s([2.0, 5.0]), &[3.0, 4.0]);
        assert_near(turn_times_s([2.5, 4.5]), &[]);
        assert_near(turn_times_s([2.5, 3.4]), &[]);
        assert_near(turn_times_s([3.2, 3.4]), &[]);
        let zero_spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 0.0, ramp_s: 2.0 };
        assert_near(turn_division_times_s(&zero_spin.segments(), [0.0, 100.0]), &[]);
    }

    #[test]
    fn backward_turns_are_counted_too() {
        // The drum makes a turn per second forwards, stops and reverses, and makes a turn per
        // second backwards.
        let spin = Spin::Table {
            time_s: vec![0.0, 3.0, 7.0, 8.0],
            speed_rpm: vec![60.0, 60.0, -60.0, -60.0],
        };
        let times = whole_turn_times_s(&spin.segments(), [0.0, 10.0]);
        let expected = [0.0, 1.0, 2.0, 3.0, 5.0, 7.0, 8.0, 9.0, 10.0];
        assert_eq!(times.len(), expected.len(), "{times:?}");
        assert!(times.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-7), "{times:?}");
        assert!((spin.turns_within([1.0, 10.0]) - 7.0).abs() < 1e-12);
    }
}

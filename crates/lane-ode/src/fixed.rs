//! The common part of methods with a fixed step: each lane's place in its leg, and how legs end.

use crate::{Count, Ended, Failure, Lane, Leg, MAX_LANES, N, Task};

/// Most steps between two calls of [`Task::is_stopped`]: some hundredths of a second.
pub const STEPS_AT_ONCE: u64 = 1 << 14;

/// Steps of one lane's leg: the smallest whole number of equal steps not above the leg's own.
pub(crate) fn fixed_steps(leg: &Leg) -> u64 {
    // Rounding may leave the quotient just above the intended whole number.
    let steps = ((leg.end_s - leg.start_s) / leg.step_s * (1.0 - 1e-12)).ceil().max(1.0);
    steps as u64
}

/// The time of each lane's leg. Its end is exact, whatever the rounding error of the step.
#[derive(Clone, Copy)]
pub(crate) struct Clock<T> {
    start: N<T>,
    end: N<T>,
    /// Step of each lane; zero where a lane is idle.
    pub(crate) h: N<T>,
    /// Steps in the leg.
    total: N<T>,
}

impl<T: Lane> Clock<T> {
    /// Time after `index` steps.
    #[inline(always)]
    pub(crate) fn at(&self, index: N<T>) -> N<T> {
        index.where_less(self.total, index * self.h + self.start, self.end)
    }
}

/// How far a lane is in its leg.
#[derive(Clone, Copy, Default)]
struct Progress {
    is_active: bool,
    total: u64,
    left: u64,
}

/// The legs that the lanes are in.
pub(crate) struct Legs<T> {
    pub(crate) clock: Clock<T>,
    /// Steps made in the leg.
    pub(crate) index: N<T>,
    lanes: [Progress; MAX_LANES],
    ended: [Option<Ended>; MAX_LANES],
}

impl<T: Lane> Legs<T> {
    /// Lanes that have no leg yet.
    #[inline(always)]
    pub(crate) fn new(zero: N<T>) -> Self {
        Self {
            clock: Clock { start: zero, end: zero, h: zero, total: zero },
            index: zero,
            lanes: [Progress::default(); MAX_LANES],
            ended: [Some(Ended::Idle); MAX_LANES],
        }
    }

    /// Gives every lane whose leg has ended its next one. Returns how many steps all lanes can make
    /// before one of them is at its end, or the task wants to be asked whether it is stopped;
    /// `None` when it is, or when no lane has anything left to do.
    #[inline(always)]
    pub(crate) fn take_up<const D: usize, P: Task<T, D>>(
        &mut self,
        task: &mut P,
        x: &mut [N<T>; D],
    ) -> Option<u64> {
        for lane in 0..T::LANES {
            let Some(how) = self.ended[lane].take() else { continue };
            let leg = task.next_leg(lane, how, x);
            let steps = leg.as_ref().map_or(0, fixed_steps);
            self.lanes[lane] = Progress { is_active: leg.is_some(), total: steps, left: steps };
            let (from, to) = leg.map_or((0.0, 0.0), |l| (l.start_s, l.end_s));
            self.clock.start.0.set(lane, from);
            self.clock.end.0.set(lane, to);
            self.clock.h.0.set(lane, (to - from) / steps.max(1) as f64);
            self.clock.total.0.set(lane, steps as f64);
            self.index.0.set(lane, 0.0);
        }
        if task.is_stopped() {
            return None;
        }
        let active = self.lanes[..T::LANES].iter().filter(|lane| lane.is_active);
        active.map(|lane| lane.left.min(STEPS_AT_ONCE)).min()
    }

    /// Ends the legs of lanes that are out of range at `time`, `done` steps after the last taking
    /// up. Returns whether there are any.
    #[inline(always)]
    pub(crate) fn fail(&mut self, in_range: T::Mask, time: N<T>, done: u64) -> bool {
        let out = !T::bits(in_range);
        for lane in (0..T::LANES).filter(|lane| self.lanes[*lane].is_active && out >> lane & 1 == 1)
        {
            let made = self.lanes[lane].total - self.lanes[lane].left + done;
            self.ended[lane] = Some(Ended::Failed {
                reason: Failure::Diverged,
                time_s: time.0.get(lane),
                count: Count { accepted: made, rejected: 0 },
            });
        }
        self.ended.iter().any(Option::is_some)
    }

    /// Counts `done` steps of every lane, and notes which of them have arrived.
    #[inline(always)]
    pub(crate) fn arrive(&mut self, done: u64) {
        for lane in 0..T::LANES {
            let progress = &mut self.lanes[lane];
            if progress.is_active {
                progress.left -= done;
                if progress.left == 0 && self.ended[lane].is_none() {
                    self.ended[lane] =
                        Some(Ended::Arrived(Count { accepted: progress.total, rejected: 0 }));
                }
            }
        }
    }
}

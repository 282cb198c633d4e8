//! The clocks of adaptive methods: every lane with its own time, step and end.

use crate::control::StepControl;
use crate::{Count, Ended, Failure, Lane, MAX_LANES, N, Task, Tolerance};

/// The leg of one lane.
#[derive(Clone, Copy, Default)]
struct Progress {
    is_active: bool,
    end_s: f64,
    count: Count,
}

/// Where the lanes are in time.
pub(crate) struct Lanes<T> {
    pub(crate) time: N<T>,
    control: StepControl<T>,
    legs: [Progress; MAX_LANES],
    /// How a lane's leg ended, until the next is asked for.
    ended: [Option<Ended>; MAX_LANES],
}

impl<T: Lane> Lanes<T> {
    /// Without a leg yet.
    #[inline(always)]
    pub(crate) fn new(zero: N<T>) -> Self {
        Self {
            time: zero,
            control: StepControl::new(zero),
            legs: [Progress::default(); MAX_LANES],
            ended: [Some(Ended::Idle); MAX_LANES],
        }
    }

    /// Asks for the next leg where one has ended; whether there was such a lane.
    #[inline(always)]
    pub(crate) fn take_up<const D: usize, P: Task<T, D>>(
        &mut self,
        task: &mut P,
        x: &mut [N<T>; D],
    ) -> bool {
        let mut has_begun = false;
        for lane in 0..T::LANES {
            let Some(how) = self.ended[lane].take() else { continue };
            has_begun = true;
            let leg = task.next_leg(lane, how, x);
            self.legs[lane] = Progress {
                is_active: leg.is_some(),
                end_s: leg.map_or(0.0, |l| l.end_s),
                ..Progress::default()
            };
            self.time.0.set(lane, leg.map_or(0.0, |l| l.start_s));
            self.control.start(lane, leg.map_or(0.0, |l| l.step_s));
        }
        has_begun
    }

    /// Whether some lane has a leg.
    #[inline(always)]
    pub(crate) fn are_active(&self) -> bool {
        self.legs[..T::LANES].iter().any(|lane| lane.is_active)
    }

    /// The steps to try: never past the end of a leg, nor a sliver short of it.
    #[inline(always)]
    pub(crate) fn steps(&self) -> N<T> {
        let mut h = self.control.step;
        for (lane, leg) in self.legs[..T::LANES].iter().enumerate() {
            let left = leg.end_s - self.time.0.get(lane);
            if leg.is_active && h.0.get(lane) * 1.01 >= left {
                h.0.set(lane, left);
            } else if !leg.is_active {
                h.0.set(lane, 0.0);
            }
        }
        h
    }

    /// Where a lane's step of these ends.
    #[inline(always)]
    pub(crate) fn reached(&self, lane: usize, h: N<T>) -> f64 {
        let (step, time, end_s) = (h.0.get(lane), self.time.0.get(lane), self.legs[lane].end_s);
        if time + step >= end_s || step == end_s - time { end_s } else { time + step }
    }

    /// After steps `h` with this error, in lanes where they were accepted and where the states they
    /// led to are in range: how far each lane has gone.
    #[inline(always)]
    pub(crate) fn settle(
        &mut self,
        h: N<T>,
        error: N<T>,
        lanes: [T::Mask; 2],
        tolerance: &Tolerance,
    ) -> N<T> {
        let mut length = h.lit(0.0);
        let lanes = lanes.map(T::bits);
        let next = self.control.proposals(error, h);
        // Lane by lane: bookkeeping in scalars is small beside a step's evaluations.
        for lane in 0..T::LANES {
            if !self.legs[lane].is_active {
                continue;
            }
            let [is_accepted, is_in_range] = lanes.map(|bits| bits >> lane & 1 == 1);
            let reached = self.reached(lane, h);
            self.control.settle(lane, is_accepted, &next);
            let leg = &mut self.legs[lane];
            let count = &mut leg.count;
            let time = if is_accepted {
                count.accepted += 1;
                length.0.set(lane, h.0.get(lane));
                self.time.0.set(lane, reached);
                reached
            } else {
                count.rejected += 1;
                self.time.0.get(lane)
            };
            let least = 16.0 * f64::EPSILON * time.abs().max(leg.end_s);
            let is_stuck = !is_accepted && self.control.step.0.get(lane) <= least;
            let fail = |reason, time_s| Some(Ended::Failed { reason, time_s, count: *count });
            self.ended[lane] = if !is_in_range && (is_accepted || is_stuck) {
                fail(Failure::Diverged, time)
            } else if is_stuck {
                fail(Failure::StepTooSmall, time)
            } else if is_accepted && reached >= leg.end_s {
                Some(Ended::Arrived(*count))
            } else if count.accepted + count.rejected >= tolerance.max_steps {
                fail(Failure::StepLimit, time)
            } else {
                None
            };
        }
        length
    }
}

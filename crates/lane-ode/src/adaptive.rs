//! The clocks of adaptive methods: every lane with its own time, step and end.

use crate::control::{StepControl, Tolerance, Verdict};
use crate::lane::{Lane, MAX_LANES};
use crate::num::N;
use crate::system::{Count, Ended, Failure, Task};

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
        let [accepted, in_range] = lanes.map(T::bits);
        let next = self.control.proposals(error, h);
        // Lane by lane: bookkeeping in scalars is small beside a step's evaluations.
        for (lane, leg) in
            self.legs[..T::LANES].iter_mut().enumerate().filter(|(_, lane)| lane.is_active)
        {
            let step = h.0.get(lane);
            let time = self.time.0.get(lane);
            let is_last = time + step >= leg.end_s || step == leg.end_s - time;
            let fail = |reason, time_s, count| Some(Ended::Failed { reason, time_s, count });
            if accepted >> lane & 1 == 1 {
                let reached = if is_last { leg.end_s } else { time + step };
                length.0.set(lane, step);
                self.time.0.set(lane, reached);
                leg.count.accepted += 1;
                if in_range >> lane & 1 == 0 {
                    self.ended[lane] = fail(Failure::Diverged, reached, leg.count);
                } else if is_last {
                    self.ended[lane] = Some(Ended::Arrived(leg.count));
                }
                self.control.settle(lane, Verdict::Accepted, &next);
            } else {
                leg.count.rejected += 1;
                self.control.settle(lane, Verdict::Rejected, &next);
                let step = self.control.step.0.get(lane);
                if step <= 16.0 * f64::EPSILON * time.abs().max(leg.end_s) {
                    let reason = if in_range >> lane & 1 == 0 {
                        Failure::Diverged
                    } else {
                        Failure::StepTooSmall
                    };
                    self.ended[lane] = fail(reason, time, leg.count);
                }
            }
            let made = leg.count.accepted + leg.count.rejected;
            if made >= tolerance.max_steps && self.ended[lane].is_none() {
                self.ended[lane] = fail(Failure::StepLimit, time, leg.count);
            }
        }
        length
    }
}

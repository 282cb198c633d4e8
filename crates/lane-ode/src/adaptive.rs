//! Times, steps and segments of the lanes in adaptive methods. Each lane has its own time, step and
//! segment.

use crate::control::{ControlExponents, StepControl};
use crate::{Failure, Lane, MAX_LANES, N, SegmentEnd, StepCount, Task, Tolerance};

/// The current segment of one lane.
#[derive(Clone, Copy, Default)]
struct AdaptiveSegment {
    is_active: bool,
    end_s: f64,
    step_count: StepCount,
}

/// The times and steps of the lanes.
pub(crate) struct AdaptiveLanes<T> {
    pub(crate) time_s: N<T>,
    control: StepControl<T>,
    segments: [AdaptiveSegment; MAX_LANES],
    /// The end of a lane's segment, until the next one is requested.
    segment_ends: [Option<SegmentEnd>; MAX_LANES],
}

impl<T: Lane> AdaptiveLanes<T> {
    /// Creates lanes without a segment.
    #[inline(always)]
    pub(crate) fn new(zero: N<T>, exponents: ControlExponents) -> Self {
        Self {
            time_s: zero,
            control: StepControl::new(zero, exponents),
            segments: [AdaptiveSegment::default(); MAX_LANES],
            segment_ends: [Some(SegmentEnd::Idle); MAX_LANES],
        }
    }

    /// Requests the next segment for every lane whose segment has ended. Returns whether any lane's
    /// segment had ended.
    #[inline(always)]
    pub(crate) fn start_pending_lanes<const D: usize, P: Task<T, D>>(
        &mut self,
        task: &mut P,
        x: &mut [N<T>; D],
    ) -> bool {
        let mut any_started = false;
        for lane in 0..T::LANES {
            let Some(end) = self.segment_ends[lane].take() else { continue };
            any_started = true;
            let segment = task.next_segment(lane, end, x);
            self.segments[lane] = AdaptiveSegment {
                is_active: segment.is_some(),
                end_s: segment.map_or(0.0, |segment| segment.end_s),
                ..AdaptiveSegment::default()
            };
            self.time_s.0.set(lane, segment.map_or(0.0, |segment| segment.start_s));
            self.control.start(lane, segment.map_or(0.0, |segment| segment.step_s));
        }
        any_started
    }

    /// Whether any lane has a segment.
    #[inline(always)]
    pub(crate) fn has_active_lane(&self) -> bool {
        self.segments[..T::LANES].iter().any(|segment| segment.is_active)
    }

    /// Returns the steps to try, of at most the tolerance's longest step. A step that would end
    /// beyond its segment's end, or just before it, is changed to end there.
    #[inline(always)]
    pub(crate) fn steps(&self, tolerance: &Tolerance) -> N<T> {
        let step = self.control.step;
        let longest_step = step.lit(tolerance.longest_step_s.unwrap_or(f64::INFINITY));
        let mut h = step.where_less(longest_step, step, longest_step);
        for (lane, segment) in self.segments[..T::LANES].iter().enumerate() {
            let remaining_s = segment.end_s - self.time_s.0.get(lane);
            if segment.is_active && h.0.get(lane) * 1.01 >= remaining_s {
                h.0.set(lane, remaining_s);
            } else if !segment.is_active {
                h.0.set(lane, 0.0);
            }
        }
        h
    }

    /// Returns the time at the end of a lane's step.
    #[inline(always)]
    pub(crate) fn step_end_s(&self, lane: usize, h: N<T>) -> f64 {
        let step_s = h.0.get(lane);
        let time_s = self.time_s.0.get(lane);
        let end_s = self.segments[lane].end_s;
        if time_s + step_s >= end_s || step_s == end_s - time_s { end_s } else { time_s + step_s }
    }

    /// Accepts or rejects steps `h` by their error, and ends segments. `masks` holds the mask of
    /// lanes whose errors are small enough, and the mask of lanes whose new states are in range.
    /// Returns the length by which each lane has advanced.
    #[inline(always)]
    pub(crate) fn accept_or_reject(
        &mut self,
        h: N<T>,
        error: N<T>,
        lane_masks: [T::Mask; 2],
        tolerance: &Tolerance,
    ) -> N<T> {
        let mut length_s = h.lit(0.0);
        let lane_masks = lane_masks.map(T::bits);
        let proposals = self.control.propose_steps(error, h);
        // The lanes are handled one by one, which takes little time compared with the evaluations
        // of a step.
        for lane in 0..T::LANES {
            if !self.segments[lane].is_active {
                continue;
            }
            let [is_accepted, is_in_range] = lane_masks.map(|bits| bits >> lane & 1 == 1);
            let end_time_s = self.step_end_s(lane, h);
            self.control.update(lane, is_accepted, &proposals);
            let segment = &mut self.segments[lane];
            let step_count = &mut segment.step_count;
            let time_s = if is_accepted {
                step_count.accepted += 1;
                length_s.0.set(lane, h.0.get(lane));
                self.time_s.0.set(lane, end_time_s);
                end_time_s
            } else {
                step_count.rejected += 1;
                self.time_s.0.get(lane)
            };
            let min_step = 16.0 * f64::EPSILON * time_s.abs().max(segment.end_s);
            let is_stuck = !is_accepted && self.control.step.0.get(lane) <= min_step;
            let to_failed_end =
                |reason, time_s| Some(SegmentEnd::Failed { reason, time_s, count: *step_count });
            self.segment_ends[lane] = if !is_in_range && (is_accepted || is_stuck) {
                to_failed_end(Failure::Diverged, time_s)
            } else if is_stuck {
                to_failed_end(Failure::StepTooSmall, time_s)
            } else if is_accepted && end_time_s >= segment.end_s {
                Some(SegmentEnd::Completed(*step_count))
            } else if step_count.accepted + step_count.rejected >= tolerance.max_steps {
                to_failed_end(Failure::StepLimit, time_s)
            } else {
                None
            };
        }
        length_s
    }
}

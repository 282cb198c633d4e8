//! The common part of methods with a fixed step: times of the lanes, and ends of their segments.

use crate::{Failure, Lane, MAX_LANES, N, Segment, SegmentEnd, StepCount, Task};

/// Greatest number of steps between two polls of [`Task::cancel`]. Basis: these steps take some
/// hundredths of a second. Doubling it doubles the time until an interrupt takes effect.
pub const CANCEL_POLL_STEPS: u64 = 1 << 14;

/// Returns the number of equal steps in a segment: the smallest number with steps of at most the
/// segment's `step_s`.
pub(crate) fn fixed_steps(segment: &Segment) -> u64 {
    // Rounding may make the quotient slightly greater than the intended whole number.
    let steps =
        ((segment.end_s - segment.start_s) / segment.step_s * (1.0 - 1e-12)).ceil().max(1.0);
    steps as u64
}

/// The clock of each lane's segment. A segment's end is exact in spite of the step's rounding
/// error.
#[derive(Clone, Copy)]
pub(crate) struct SegmentClock<T> {
    start_s: N<T>,
    end_s: N<T>,
    /// The step of each lane; zero in an idle lane.
    pub(crate) h: N<T>,
    /// The number of steps in the segment.
    step_total: N<T>,
}

impl<T: Lane> SegmentClock<T> {
    /// Returns the time after `step_index` steps.
    #[inline(always)]
    pub(crate) fn time_after(&self, step_index: N<T>) -> N<T> {
        step_index.where_less(self.step_total, step_index * self.h + self.start_s, self.end_s)
    }
}

/// The progress of a lane's segment.
#[derive(Clone, Copy, Default)]
struct FixedProgress {
    is_active: bool,
    total_steps: u64,
    remaining_steps: u64,
}

/// The current segments of the lanes.
pub(crate) struct FixedSegments<T> {
    pub(crate) clock: SegmentClock<T>,
    /// The number of steps made in each lane's segment.
    pub(crate) step_index: N<T>,
    progress_by_lane: [FixedProgress; MAX_LANES],
    segment_ends: [Option<SegmentEnd>; MAX_LANES],
}

impl<T: Lane> FixedSegments<T> {
    /// Creates lanes without a segment.
    #[inline(always)]
    pub(crate) fn new(zero: N<T>) -> Self {
        Self {
            clock: SegmentClock { start_s: zero, end_s: zero, h: zero, step_total: zero },
            step_index: zero,
            progress_by_lane: [FixedProgress::default(); MAX_LANES],
            segment_ends: [Some(SegmentEnd::Idle); MAX_LANES],
        }
    }

    /// Requests the next segment for every lane whose segment has ended. Returns the number of
    /// steps that all lanes can make before one of them is at its end, or before
    /// [`Task::cancel`] is polled next; `None` if the task is stopped or no lane has a segment.
    #[inline(always)]
    pub(crate) fn start_pending_lanes<const D: usize, P: Task<T, D>>(
        &mut self,
        task: &mut P,
        x: &mut [N<T>; D],
    ) -> Option<u64> {
        for lane in 0..T::LANES {
            let Some(end) = self.segment_ends[lane].take() else { continue };
            let segment = task.next_segment(lane, end, x);
            let step_count = segment.as_ref().map_or(0, fixed_steps);
            self.progress_by_lane[lane] = FixedProgress {
                is_active: segment.is_some(),
                total_steps: step_count,
                remaining_steps: step_count,
            };
            let (start_s, end_s) =
                segment.map_or((0.0, 0.0), |segment| (segment.start_s, segment.end_s));
            self.clock.start_s.0.set(lane, start_s);
            self.clock.end_s.0.set(lane, end_s);
            self.clock.h.0.set(lane, (end_s - start_s) / step_count.max(1) as f64);
            self.clock.step_total.0.set(lane, step_count as f64);
            self.step_index.0.set(lane, 0.0);
        }
        if task.cancel().is_requested() {
            return None;
        }
        let active_lanes = self.progress_by_lane[..T::LANES].iter().filter(|lane| lane.is_active);
        active_lanes.map(|lane| lane.remaining_steps.min(CANCEL_POLL_STEPS)).min()
    }

    /// Ends the segments of lanes that are out of range at `times_s`, `new_steps` steps after the
    /// last call of [`Self::start_pending_lanes`]. Returns whether any lane's segment has ended.
    #[inline(always)]
    pub(crate) fn end_failed_segments(
        &mut self,
        in_range: T::Mask,
        times_s: N<T>,
        new_steps: u64,
    ) -> bool {
        let out_of_range = !T::bits(in_range);
        for lane in (0..T::LANES)
            .filter(|lane| self.progress_by_lane[*lane].is_active && out_of_range >> lane & 1 == 1)
        {
            let accepted_steps = self.progress_by_lane[lane].total_steps
                - self.progress_by_lane[lane].remaining_steps
                + new_steps;
            self.segment_ends[lane] = Some(SegmentEnd::Failed {
                reason: Failure::Diverged,
                time_s: times_s.0.get(lane),
                count: StepCount { accepted: accepted_steps, rejected: 0 },
            });
        }
        self.segment_ends.iter().any(Option::is_some)
    }

    /// Counts `new_steps` steps of every lane, and ends the segments that are completed.
    #[inline(always)]
    pub(crate) fn count_steps(&mut self, new_steps: u64) {
        for lane in 0..T::LANES {
            let progress = &mut self.progress_by_lane[lane];
            if progress.is_active {
                progress.remaining_steps -= new_steps;
                if progress.remaining_steps == 0 && self.segment_ends[lane].is_none() {
                    self.segment_ends[lane] = Some(SegmentEnd::Completed(StepCount {
                        accepted: progress.total_steps,
                        rejected: 0,
                    }));
                }
            }
        }
    }
}

//! The interface of integrators: systems, trajectories, and the steps that observers receive.

use crate::{Cancel, Lane, N, OutOfLine};

/// A first-order system x' = f(t, x) with `D` states, over lanes.
pub trait System<T: Lane, const D: usize> {
    /// The part of f that depends on time only. It is computed once for stages at the same time.
    type Forcing: Copy;

    /// Computes the forcing at time `t_s`, which may differ between lanes.
    fn forcing(&self, t_s: N<T>) -> Self::Forcing;

    /// Replaces a forcing of this system by that at another time, which costs less than a new one
    /// if forcings are large.
    #[inline(always)]
    fn update_forcing(&self, t_s: N<T>, forcing: &mut Self::Forcing) {
        *forcing = self.forcing(t_s);
    }

    /// Computes [`Self::forcing`] in a function that all callers share, for callers that need the
    /// forcing rarely.
    #[inline(always)]
    fn forcing_out_of_line(&self, t_s: N<T>) -> Self::Forcing
    where
        Self: Sized,
    {
        t_s.0.run_out_of_line(ForcingCall::<T, D, Self> { system: self, t_s })
    }

    /// Computes f at state `x`.
    fn derivative(&self, forcing: &Self::Forcing, x: &[N<T>; D]) -> [N<T>; D];

    /// Computes [`Self::derivative`] in a function that all callers share.
    #[inline(always)]
    fn derivative_out_of_line(&self, forcing: &Self::Forcing, x: &[N<T>; D]) -> [N<T>; D]
    where
        Self: Sized,
    {
        x[0].0.run_out_of_line(DerivativeCall { system: self, forcing, x })
    }

    /// Returns the lanes whose states are in the model's range. The trajectory of a lane that
    /// leaves the range has diverged. NaN is out of range.
    fn in_range(&self, x: &[N<T>; D]) -> T::Mask;
}

struct ForcingCall<'a, T, const D: usize, S> {
    system: &'a S,
    t_s: N<T>,
}

impl<T: Lane, const D: usize, S: System<T, D>> OutOfLine for ForcingCall<'_, T, D, S> {
    type Output = S::Forcing;

    #[inline(always)]
    fn run(self) -> S::Forcing {
        self.system.forcing(self.t_s)
    }
}

struct DerivativeCall<'a, T: Lane, const D: usize, S: System<T, D>> {
    system: &'a S,
    forcing: &'a S::Forcing,
    x: &'a [N<T>; D],
}

impl<T: Lane, const D: usize, S: System<T, D>> OutOfLine for DerivativeCall<'_, T, D, S> {
    type Output = [N<T>; D];

    #[inline(always)]
    fn run(self) -> [N<T>; D] {
        self.system.derivative(self.forcing, self.x)
    }
}

/// A system x' = H(t, x, x) with a part that is too stiff for explicit formulas. This part depends
/// on the last argument, in which H is linear.
pub trait SemiImplicit<T: Lane, const D: usize>: System<T, D> {
    /// Solves k = H(t, x, r + g k) for k, with `g_s` above zero.
    fn solve_implicit_stage(
        &self,
        forcing: &Self::Forcing,
        x: &[N<T>; D],
        r: &[N<T>; D],
        g_s: N<T>,
    ) -> [N<T>; D];
}

/// A queue of trajectories. A lane whose trajectory has ended starts the next one at once.
pub trait Task<T: Lane, const D: usize> {
    /// The system that is integrated.
    type System: System<T, D>;

    /// Returns the system with the lanes' current parameters.
    fn system(&self) -> &Self::System;

    /// Receives the end of the segment in lane `lane`, and returns the next segment. The next
    /// segment belongs to the same trajectory or to a new one, whose parameters and start state are
    /// then written into the lane. Returns `None` if there is no further trajectory.
    fn next_segment(&mut self, lane: usize, end: SegmentEnd, x: &mut [N<T>; D]) -> Option<Segment>;

    /// Receives the state at the start of a segment in one or more lanes, where the trajectory may
    /// have a kink or be a new one. Other lanes, which are inside a segment, receive their last
    /// state once more.
    fn begin(&mut self, forcing: &Forcing<Self, T, D>, x: &[N<T>; D], dx: &[N<T>; D]);

    /// Receives a step of every lane. The step's length is zero in idle lanes.
    fn observe(&mut self, forcing: &Forcing<Self, T, D>, step: &ObservedStep<'_, T, D>);

    /// Returns the cancellation of the computation, after which unfinished trajectories are
    /// abandoned. It is polled at least once every [`CANCEL_POLL_STEPS`](crate::CANCEL_POLL_STEPS)
    /// steps, because a segment may take hours.
    fn cancel(&self) -> Cancel<'_> {
        Cancel::Never
    }
}

/// The forcing of a task's system.
pub type Forcing<P, T, const D: usize> = <<P as Task<T, D>>::System as System<T, D>>::Forcing;

/// A segment of a trajectory, without kinks. The last step ends exactly at the segment's end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// The time of the segment's start.
    pub start_s: f64,
    /// The time of the segment's end.
    pub end_s: f64,
    /// The longest step of fixed-step methods, which fill the segment with a whole number of equal
    /// steps; the first step that adaptive methods try.
    pub step_s: f64,
}

/// The end of a lane's segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SegmentEnd {
    /// The lane had no segment yet.
    Idle,
    /// The segment was integrated to its end.
    Completed(StepCount),
    /// The trajectory cannot be continued.
    Failed {
        /// The reason.
        reason: Failure,
        /// The time of the last valid state.
        time_s: f64,
        /// The number of steps in the segment so far.
        count: StepCount,
    },
}

/// The reason why a trajectory cannot be continued.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Failure {
    /// The state left the range of the model, or became non-finite.
    Diverged,
    /// The tolerance requires steps below the resolution of time.
    StepTooSmall,
    /// The greatest number of steps was reached.
    StepLimit,
}

/// The number of steps of one segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepCount {
    /// The number of accepted steps.
    pub accepted: u64,
    /// The number of rejected steps.
    pub rejected: u64,
}

impl StepCount {
    /// Adds the steps of another segment.
    pub const fn add(&mut self, other: Self) {
        self.accepted += other.accepted;
        self.rejected += other.rejected;
    }
}

/// A step with the data that an observer needs to interpolate in it.
pub struct ObservedStep<'a, T, const D: usize> {
    /// The time at the end.
    pub end_s: N<T>,
    /// The length; zero in an idle lane.
    pub length_s: N<T>,
    /// The state at the start.
    pub start_state: &'a [N<T>; D],
    /// The derivative at the start.
    pub start_slope: &'a [N<T>; D],
    /// The state at the end.
    pub end_state: &'a [N<T>; D],
    /// The derivative at the end.
    pub end_slope: &'a [N<T>; D],
    /// The fourth-order term of the method's own dense output, if it has one.
    pub dense_term: Option<&'a [N<T>; D]>,
}

impl<T: Lane, const D: usize> ObservedStep<'_, T, D> {
    /// Interpolates the state a fraction `s` (0 to 1) into the step, by the method's dense output
    /// or the cubic through both ends.
    ///
    /// The formula is that of Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I,
    /// section II.6 (`contd5`).
    #[inline(always)]
    pub fn interpolate(&self, s: N<T>) -> [N<T>; D] {
        let remainder = 1.0 - s;
        let mut x = *self.start_state;
        for i in 0..D {
            let difference = self.end_state[i] - self.start_state[i];
            let start_term = self.length_s * self.start_slope[i] - difference;
            let end_term = difference - self.length_s * self.end_slope[i] - start_term;
            let curvature_term = match self.dense_term {
                Some(dense) => end_term + remainder * dense[i],
                None => end_term,
            };
            x[i] += s * (difference + remainder * (start_term + s * curvature_term));
        }
        x
    }
}

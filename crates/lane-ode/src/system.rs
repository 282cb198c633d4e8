//! What integrators need of a system, and what they report of a trajectory.

use crate::{Aside, Lane, N};

/// A first-order system x' = f(t, x) with `D` states, in lanes.
pub trait System<T: Lane, const D: usize> {
    /// The part of f that depends on time alone; computed once where several stages share a time.
    type Forcing: Copy;

    /// The forcing at time `t_s`, which may differ between lanes.
    fn forcing(&self, t_s: N<T>) -> Self::Forcing;

    /// Overwrites a forcing of this system with that at another time; cheaper than a new one where
    /// forcings are large.
    #[inline(always)]
    fn renew(&self, t_s: N<T>, forcing: &mut Self::Forcing) {
        *forcing = self.forcing(t_s);
    }

    /// [`Self::forcing`] as a function of its own that all callers share: for where it is not most
    /// of the time.
    #[inline(always)]
    fn forcing_aside(&self, t_s: N<T>) -> Self::Forcing
    where
        Self: Sized,
    {
        t_s.0.aside(ForcingAside::<T, D, Self> { system: self, t_s })
    }

    /// f at state `x`.
    fn derivative(&self, forcing: &Self::Forcing, x: &[N<T>; D]) -> [N<T>; D];

    /// [`Self::derivative`], likewise.
    #[inline(always)]
    fn derivative_aside(&self, forcing: &Self::Forcing, x: &[N<T>; D]) -> [N<T>; D]
    where
        Self: Sized,
    {
        x[0].0.aside(DerivativeAside { system: self, forcing, x })
    }

    /// The lanes whose states are in the model's range. A lane that leaves it has diverged. NaN is
    /// outside.
    fn in_range(&self, x: &[N<T>; D]) -> T::Mask;
}

struct ForcingAside<'a, T, const D: usize, S> {
    system: &'a S,
    t_s: N<T>,
}

impl<T: Lane, const D: usize, S: System<T, D>> Aside for ForcingAside<'_, T, D, S> {
    type Output = S::Forcing;

    #[inline(always)]
    fn run(self) -> S::Forcing {
        self.system.forcing(self.t_s)
    }
}

struct DerivativeAside<'a, T: Lane, const D: usize, S: System<T, D>> {
    system: &'a S,
    forcing: &'a S::Forcing,
    x: &'a [N<T>; D],
}

impl<T: Lane, const D: usize, S: System<T, D>> Aside for DerivativeAside<'_, T, D, S> {
    type Output = [N<T>; D];

    #[inline(always)]
    fn run(self) -> [N<T>; D] {
        self.system.derivative(self.forcing, self.x)
    }
}

/// A system x' = H(t, x, x) with a part that is too stiff for explicit formulas: the part is in the
/// last argument, in which H is linear.
pub trait SemiImplicit<T: Lane, const D: usize>: System<T, D> {
    /// k with k = H(t, x, r + g k), for `g_s` above zero.
    fn derivative_ahead(
        &self,
        forcing: &Self::Forcing,
        x: &[N<T>; D],
        r: &[N<T>; D],
        g_s: N<T>,
    ) -> [N<T>; D];
}

/// Trajectories fed into lanes one after another: a lane that ends takes up the next at once.
pub trait Task<T: Lane, const D: usize> {
    /// The system whose trajectories they are.
    type System: System<T, D>;

    /// The system with the parameters that the lanes hold.
    fn system(&self) -> &Self::System;

    /// Reports how lane `lane` came to the end of its leg, and asks for the next: another leg of
    /// the same trajectory, the first leg of a new one (write its parameters and its state), or
    /// none.
    fn next_leg(&mut self, lane: usize, ended: Ended, x: &mut [N<T>; D]) -> Option<Leg>;

    /// A leg has begun in some lane: the trajectory may have a kink here, or be a new one. Lanes
    /// whose legs went on are given the sample that they had.
    fn begin(&mut self, forcing: &Forcing<Self, T, D>, x: &[N<T>; D], dx: &[N<T>; D]);

    /// Every lane has made a step, of zero length if it is idle.
    fn observe(&mut self, forcing: &Forcing<Self, T, D>, step: &Step<'_, T, D>);

    /// Whether to stop; trajectories that have not ended by then never do. Asked every
    /// [`STEPS_AT_ONCE`](crate::STEPS_AT_ONCE) steps at least, because one leg may take hours.
    fn is_stopped(&self) -> bool {
        false
    }
}

/// The forcing of a task's system.
pub type Forcing<P, T, const D: usize> = <<P as Task<T, D>>::System as System<T, D>>::Forcing;

/// A stretch of a trajectory without kinks. Its last step ends exactly at its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// Where it starts.
    pub start_s: f64,
    /// Where it ends.
    pub end_s: f64,
    /// Fixed-step methods: the longest step; a whole number of equal steps fills the leg. Adaptive
    /// methods: the first step to try.
    pub step_s: f64,
}

/// How a lane's leg ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ended {
    /// There was none yet.
    Idle,
    /// At its end.
    Arrived(Count),
    /// Before it.
    Failed {
        /// Why.
        reason: Failure,
        /// When.
        time_s: f64,
        /// Steps so far.
        count: Count,
    },
}

/// Why a trajectory cannot go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Failure {
    /// The state left the range of the model, or is not finite.
    Diverged,
    /// The error asked for needs steps that time cannot resolve.
    StepTooSmall,
    /// The allowance of steps is used up.
    StepLimit,
}

/// Steps of one leg.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Accepted.
    pub accepted: u64,
    /// Rejected.
    pub rejected: u64,
}

impl Count {
    /// Adds another leg's.
    pub const fn add(&mut self, other: Self) {
        self.accepted += other.accepted;
        self.rejected += other.rejected;
    }
}

/// A step just made, with all that an observer needs to interpolate in it.
pub struct Step<'a, T, const D: usize> {
    /// Its end in time.
    pub end_s: N<T>,
    /// Its length; zero in an idle lane.
    pub length_s: N<T>,
    /// State at its start.
    pub before: &'a [N<T>; D],
    /// Derivative there.
    pub slope_before: &'a [N<T>; D],
    /// State at its end.
    pub after: &'a [N<T>; D],
    /// Derivative there.
    pub slope_after: &'a [N<T>; D],
    /// The fourth-order term of the method's own dense output, if it has one.
    pub dense: Option<&'a [N<T>; D]>,
}

impl<T: Lane, const D: usize> Step<'_, T, D> {
    /// The state a fraction `s` (0 to 1) into the step: the method's dense output, or the cubic
    /// through both ends.
    ///
    /// Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.6 (`contd5`).
    #[inline(always)]
    pub fn at(&self, s: N<T>) -> [N<T>; D] {
        let rest = 1.0 - s;
        let mut x = *self.before;
        for i in 0..D {
            let difference = self.after[i] - self.before[i];
            let start = self.length_s * self.slope_before[i] - difference;
            let end = difference - self.length_s * self.slope_after[i] - start;
            let inner = match self.dense {
                Some(dense) => end + rest * dense[i],
                None => end,
            };
            x[i] += s * (difference + rest * (start + s * inner));
        }
        x
    }
}

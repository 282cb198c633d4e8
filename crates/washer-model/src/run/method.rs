//! The methods of integration, in one place: what each takes, what a row says of it, and what it is
//! compiled from.
//!
//! Each is compiled as a kernel of its own: one function of all of them takes the compiler longer
//! than all apart.

use crate::coordinates::STATES;
use crate::nonlinear::coupling::Coupling;
use crate::point::PlannedLeg;
use crate::run::model::{Linear, Model, Nonlinear};
use crate::{Caps, Formula, ModelKind, Point};
use lane_ode::{Lane, N, Segment, Task, Tolerance, additive, dop853, dopri5, rk4};

/// How trajectories are integrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Classical Runge-Kutta of order 4.
    Rk4 {
        /// Longest step.
        step_s: f64,
    },
    /// The model's formula ([`Formula::for_model`]) on the machine whose bearings, and hinge if it
    /// has a cap, have scaled mass, so that none of their modes is faster than a cap (section 4.3
    /// of the model page).
    Capped {
        /// The longest step.
        step_s: f64,
        /// The caps.
        caps: Caps,
    },
    /// Dormand and Prince's formula of order 8, bearings and hinge as they are. The linear model
    /// takes RK4 in its place.
    Dop853 {
        /// Longest step.
        step_s: f64,
    },
    /// Dormand-Prince 5(4).
    Dopri5(Tolerance),
    /// Kennedy and Carpenter's additive method of order 5(4), the springs of bearings and hinge
    /// implicit: however stiff these are, they do not hold its steps short.
    Additive(Tolerance),
}

sweep_parameter::named! {
    /// The method that a row's numbers come from, with its refinement level if modes are capped.
    /// The position is its code in unfinished files, so new ones go to the end.
    #[derive(Default)]
    pub enum Level {
        /// Capped bearing modes, the longest stable steps.
        Capped0 = "capped_0",
        /// Capped bearing modes, the second level.
        Capped1 = "capped_1",
        /// Capped bearing modes, the third level.
        Capped2 = "capped_2",
        /// Capped bearing modes, the fourth level.
        Capped3 = "capped_3",
        /// Capped bearing modes, the fifth level.
        Capped4 = "capped_4",
        /// Capped bearing modes, the shortest steps.
        Capped5 = "capped_5",
        /// Plain RK4.
        #[default]
        Rk4 = "rk4",
        /// Dormand-Prince 5(4).
        Dopri5 = "dopri5",
        /// The additive method.
        Additive = "additive",
        /// Dormand and Prince's formula of order 8 with nothing capped.
        Dop853 = "dop853",
    }
}

impl Level {
    /// The levels with capped bearing modes, coarsest first.
    pub const CAPPED: [Self; 6] =
        [Self::Capped0, Self::Capped1, Self::Capped2, Self::Capped3, Self::Capped4, Self::Capped5];

    /// Returns whether modes of the bearings are capped.
    pub fn is_capped(self) -> bool {
        Self::CAPPED.contains(&self)
    }
}

/// The numbers that a method takes.
#[derive(Debug)]
pub enum MethodNumbers<'a> {
    /// Longest step (s).
    Step(&'a mut f64),
    /// Longest step (s) and caps.
    Capped(&'a mut f64, &'a mut Caps),
    /// Of steps that an adaptive method chooses.
    Tolerance(&'a mut Tolerance),
}

/// What is compiled once for each method, over a model.
pub(crate) trait ByMethod<F: Family>: Sized {
    type Output;
    fn by<S: Stepper>(self, stepper: S) -> Self::Output;
}

impl Method {
    /// That of a level, with its numbers still to be put in.
    pub const fn of(level: Level) -> Self {
        const CAPS: Caps = Caps { bearings_rad_per_s: 0.0, hinge_rad_per_s: None };
        const TOLERANCE: Tolerance = Tolerance { relative: 0.0, absolute: 0.0, max_steps: 0 };
        match level {
            Level::Capped0
            | Level::Capped1
            | Level::Capped2
            | Level::Capped3
            | Level::Capped4
            | Level::Capped5 => Self::Capped { step_s: 0.0, caps: CAPS },
            Level::Rk4 => Self::Rk4 { step_s: 0.0 },
            Level::Dopri5 => Self::Dopri5(TOLERANCE),
            Level::Additive => Self::Additive(TOLERANCE),
            Level::Dop853 => Self::Dop853 { step_s: 0.0 },
        }
    }

    /// What it takes, to be read or put in.
    pub const fn numbers(&mut self) -> MethodNumbers<'_> {
        match self {
            Self::Rk4 { step_s } | Self::Dop853 { step_s } => MethodNumbers::Step(step_s),
            Self::Capped { step_s, caps } => MethodNumbers::Capped(step_s, caps),
            Self::Dopri5(tolerance) | Self::Additive(tolerance) => {
                MethodNumbers::Tolerance(tolerance)
            }
        }
    }

    /// Whether trajectories side by side in lanes have steps of their own.
    pub const fn has_own_steps(&self) -> bool {
        matches!(self, Self::Dopri5(_) | Self::Additive(_))
    }

    /// Does something by the integrator of this method.
    pub(crate) fn choose<F: Family, B: ByMethod<F>>(&self, task: B) -> B::Output {
        // A match on the formula would compile both of its arms.
        const { assert!(F::Capped::FORMULA as u8 == Formula::for_model(F::KIND) as u8) };
        match *self {
            Self::Rk4 { .. } => task.by(ByRk4),
            Self::Capped { .. } | Self::Dop853 { .. } => task.by(F::Capped::NEW),
            Self::Dopri5(tolerance) => task.by(ByDopri5(tolerance)),
            Self::Additive(tolerance) => task.by(ByAdditive(tolerance)),
        }
    }
}

/// First step that an adaptive method tries.
const FIRST_STEP_S: f64 = 1e-5;

/// Starts a leg in a lane with its spin and its step.
pub(crate) fn enter<T: Lane, M: Model<T>>(
    model: &mut M,
    lane: usize,
    mut method: Method,
    point: &Point,
    leg: &PlannedLeg,
) -> Segment {
    model.set_spin(lane, &point.stretches[leg.stretch]);
    let step_s = match method.numbers() {
        MethodNumbers::Step(step_s) | MethodNumbers::Capped(step_s, _) => *step_s,
        MethodNumbers::Tolerance(_) => FIRST_STEP_S,
    };
    Segment { start_s: leg.start_s, end_s: leg.end_s, step_s }
}

/// How bearings and hinge act where a trajectory starts.
#[inline(always)]
pub(crate) fn coupling<T: Lane>(method: &Method, zero: N<T>) -> Coupling<T> {
    let Method::Capped { caps, .. } = method else { return Coupling::Springs };
    Coupling::new(zero, Some(caps))
}

/// A model before the lanes' type is known, and what integrates it.
pub(crate) trait Family {
    type Over<T: Lane>: Model<T>;
    /// [`Method::Capped`] and [`Method::Dop853`], by the model's formula.
    type Capped: Fixed;
    const KIND: ModelKind;
}

pub(crate) enum OfNonlinear {}
pub(crate) enum OfLinear {}
impl Family for OfNonlinear {
    type Over<T: Lane> = Nonlinear<T>;
    type Capped = ByDop853;
    const KIND: ModelKind = ModelKind::Nonlinear;
}
impl Family for OfLinear {
    type Over<T: Lane> = Linear<T>;
    type Capped = ByRk4;
    const KIND: ModelKind = ModelKind::Linear;
}

pub(crate) trait Stepper {
    fn integrate<T: Lane, P: Task<T, STATES, System: Model<T>>>(self, zero: T, task: &mut P);
}

/// A stepper of fixed steps.
pub(crate) trait Fixed: Stepper {
    const NEW: Self;
    const FORMULA: Formula;
}

/// Integrators whose lanes are trajectories.
macro_rules! steppers {
    ($($Stepper:ident $(($by:ty))? = |$self:ident, $zero:ident, $task:ident| $run:expr;)+) => {$(
        pub(crate) struct $Stepper$((pub(crate) $by))?;

        impl Stepper for $Stepper {
            #[inline(always)]
            fn integrate<T: Lane, P: Task<T, STATES, System: Model<T>>>(
                $self,
                $zero: T,
                $task: &mut P,
            ) {
                $run;
            }
        }
    )+};
}

steppers! {
    ByRk4 = |self, zero, task| rk4::integrate(zero, task);
    ByDop853 = |self, zero, task| dop853::integrate(zero, task);
    ByDopri5(Tolerance) = |self, zero, task| dopri5::integrate(zero, task, &self.0);
    ByAdditive(Tolerance) = |self, zero, task| additive::integrate(zero, task, &self.0);
}

impl Fixed for ByRk4 {
    const NEW: Self = Self;
    const FORMULA: Formula = Formula::Rk4;
}

impl Fixed for ByDop853 {
    const NEW: Self = Self;
    const FORMULA: Formula = Formula::Dop853;
}

//! The methods of integration: their parameters, their names in rows, and their steppers.
//!
//! Each stepper is compiled as a separate kernel, because the compiler takes longer for one
//! function with all of them than for all functions together.

use crate::coordinates::STATES;
use crate::nonlinear::coupling::Coupling;
use crate::point::PlannedSegment;
use crate::run::model::{LaneModel, Linear, Nonlinear};
use crate::{Caps, Formula, ModelKind, Point};
use lane_ode::{Lane, N, Segment, Task, Tolerance, additive, dop853, dopri5, rk4};

/// A method of integration with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Classical Runge-Kutta of order 4.
    Rk4 { step_s: f64 },
    /// The model's formula ([`Formula::for_model`]) for the machine with scaled mass at the
    /// bearings, and at the hinge if the hinge has a cap, which keeps the frequencies of their
    /// modes below the caps (section 4.3 of the model page).
    Capped { step_s: f64, caps: Caps },
    /// Dormand and Prince's formula of order 8 with fixed steps, without caps. The linear model
    /// uses RK4 instead.
    Dop853 { step_s: f64 },
    /// Dormand and Prince's method of order 5(4), adaptive.
    Dopri5(Tolerance),
    /// Kennedy and Carpenter's additive method of order 5(4), adaptive. The springs of bearings and
    /// hinge are implicit, so that their stiffness does not limit the step.
    Additive(Tolerance),
}

sweep_parameter::named! {
    /// The method of a row's numbers, with the refinement level if modes are capped. Unfinished
    /// files store the position in this list, so that new methods are added at the end.
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
        /// RK4 without capped modes.
        #[default]
        Rk4 = "rk4",
        /// Dormand-Prince 5(4).
        Dopri5 = "dopri5",
        /// The additive method.
        Additive = "additive",
        /// Dormand and Prince's formula of order 8 without capped modes.
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

/// The parameters of a method.
#[derive(Debug)]
pub enum MethodNumbers<'a> {
    /// The longest step (s).
    Step(&'a mut f64),
    /// The longest step (s) and the caps.
    Capped(&'a mut f64, &'a mut Caps),
    /// The tolerance of an adaptive method.
    Tolerance(&'a mut Tolerance),
}

/// A function that is generic over the stepper, and is therefore compiled once for each stepper.
pub(crate) trait StepperVisitor<F: ModelFamily>: Sized {
    type Output;
    fn visit<S: Stepper>(self, stepper: S) -> Self::Output;
}

impl Method {
    /// Returns the method of a level with parameters of zero, which the caller sets.
    pub const fn with_zero_numbers(level: Level) -> Self {
        let caps = Caps { bearings_rad_per_s: 0.0, hinge_rad_per_s: None };
        let tolerance = Tolerance { relative: 0.0, absolute: 0.0, max_steps: 0 };
        match level {
            Level::Capped0
            | Level::Capped1
            | Level::Capped2
            | Level::Capped3
            | Level::Capped4
            | Level::Capped5 => Self::Capped { step_s: 0.0, caps },
            Level::Rk4 => Self::Rk4 { step_s: 0.0 },
            Level::Dopri5 => Self::Dopri5(tolerance),
            Level::Additive => Self::Additive(tolerance),
            Level::Dop853 => Self::Dop853 { step_s: 0.0 },
        }
    }

    /// Returns the parameters, to be read or set.
    pub const fn numbers_mut(&mut self) -> MethodNumbers<'_> {
        match self {
            Self::Rk4 { step_s } | Self::Dop853 { step_s } => MethodNumbers::Step(step_s),
            Self::Capped { step_s, caps } => MethodNumbers::Capped(step_s, caps),
            Self::Dopri5(tolerance) | Self::Additive(tolerance) => {
                MethodNumbers::Tolerance(tolerance)
            }
        }
    }

    /// Whether each lane has its own steps, which an adaptive method chooses.
    pub const fn adapts_steps(&self) -> bool {
        matches!(self, Self::Dopri5(_) | Self::Additive(_))
    }

    /// Calls a visitor with the stepper of this method.
    pub(crate) fn visit_stepper<F: ModelFamily, V: StepperVisitor<F>>(
        &self,
        visitor: V,
    ) -> V::Output {
        // A match on the formula would compile both arms for each model.
        const { assert!(F::FixedStepStepper::FORMULA as u8 == Formula::for_model(F::KIND) as u8) };
        match *self {
            Self::Rk4 { .. } => visitor.visit(Rk4Stepper),
            Self::Capped { .. } | Self::Dop853 { .. } => {
                visitor.visit(F::FixedStepStepper::INSTANCE)
            }
            Self::Dopri5(tolerance) => visitor.visit(Dopri5Stepper(tolerance)),
            Self::Additive(tolerance) => visitor.visit(AdditiveStepper(tolerance)),
        }
    }
}

/// The first step (s) that an adaptive method tries.
///
/// Basis: a tenth of the shortest steps in a run, which the controller reaches within two steps.
/// Doubling it changes less than one step of a run.
const FIRST_STEP_S: f64 = 1e-5;

/// Starts a segment of a point in a lane: sets the spin, and returns the segment with its step.
pub(crate) fn start_segment<T: Lane, M: LaneModel<T>>(
    model: &mut M,
    lane: usize,
    mut method: Method,
    point: &Point,
    segment: &PlannedSegment,
) -> Segment {
    model.set_spin(lane, &point.spin_segments[segment.spin_segment]);
    let step_s = match method.numbers_mut() {
        MethodNumbers::Step(step_s) | MethodNumbers::Capped(step_s, _) => *step_s,
        MethodNumbers::Tolerance(_) => FIRST_STEP_S,
    };
    Segment { start_s: segment.start_s, end_s: segment.end_s, step_s }
}

/// Returns the coupling of tub and rotor by a method's caps.
#[inline(always)]
pub(crate) fn coupling_for_method<T: Lane>(method: &Method, zero: N<T>) -> Coupling<T> {
    let Method::Capped { caps, .. } = method else { return Coupling::Springs };
    Coupling::new(zero, Some(caps))
}

/// The nonlinear or the linear model, as a type that is independent of the lanes.
pub(crate) trait ModelFamily {
    /// The model over lanes.
    type OnLanes<T: Lane>: LaneModel<T>;
    /// The stepper of [`Method::Capped`] and [`Method::Dop853`], by the model's formula.
    type FixedStepStepper: FixedStepper;
    /// The model as a value.
    const KIND: ModelKind;
}

/// The nonlinear model over any lanes.
pub(crate) enum NonlinearFamily {}
/// The linear model over any lanes.
pub(crate) enum LinearFamily {}
impl ModelFamily for NonlinearFamily {
    type OnLanes<T: Lane> = Nonlinear<T>;
    type FixedStepStepper = Dop853Stepper;
    const KIND: ModelKind = ModelKind::Nonlinear;
}
impl ModelFamily for LinearFamily {
    type OnLanes<T: Lane> = Linear<T>;
    type FixedStepStepper = Rk4Stepper;
    const KIND: ModelKind = ModelKind::Linear;
}

/// An integrator of a task whose lanes are trajectories.
pub(crate) trait Stepper {
    /// Integrates all trajectories of a task.
    fn integrate<T: Lane, P: Task<T, STATES, System: LaneModel<T>>>(self, zero: T, task: &mut P);
}

/// A stepper of fixed steps, which has no parameters.
pub(crate) trait FixedStepper: Stepper {
    /// The only value of the stepper's type.
    const INSTANCE: Self;
    /// The formula of the stepper.
    const FORMULA: Formula;
}

/// Declares steppers: the type with its parameters, and the call of its integrator.
macro_rules! steppers {
    ($($Stepper:ident $(($field:ty))? = |$self:ident, $zero:ident, $task:ident| $run:expr;)+) => {$(
        pub(crate) struct $Stepper$((pub(crate) $field))?;

        impl Stepper for $Stepper {
            #[inline(always)]
            fn integrate<T: Lane, P: Task<T, STATES, System: LaneModel<T>>>(
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
    Rk4Stepper = |self, zero, task| rk4::integrate(zero, task);
    Dop853Stepper = |self, zero, task| dop853::integrate(zero, task);
    Dopri5Stepper(Tolerance) = |self, zero, task| dopri5::integrate(zero, task, &self.0);
    AdditiveStepper(Tolerance) = |self, zero, task| additive::integrate(zero, task, &self.0);
}

impl FixedStepper for Rk4Stepper {
    const INSTANCE: Self = Self;
    const FORMULA: Formula = Formula::Rk4;
}

impl FixedStepper for Dop853Stepper {
    const INSTANCE: Self = Self;
    const FORMULA: Formula = Formula::Dop853;
}

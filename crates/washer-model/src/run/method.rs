//! The methods of integration: their kinds, their parameters, and their steppers.
//!
//! Each stepper is compiled as a separate kernel, because the compiler takes longer for one
//! function with all of them than for all functions together.

use crate::coordinates::STATES;
use crate::nonlinear::coupling::Coupling;
use crate::point::PlannedSegment;
use crate::run::model::{LaneModel, LinearModel, NonlinearModel};
use crate::{Caps, Formula, ModelKind, Point};
use lane_ode::{Lane, N, Segment, Task, Tolerance, additive, dop853, dop853_adaptive, dopri5, rk4};

sweep_parameter::named! {
    /// The kinds of methods. The position in this list is the code in results and pages, so that
    /// new kinds are added at the end.
    ///
    /// Capped kinds integrate the machine by the model's formula ([`Formula::for_model`]). The mass
    /// at the bearings, and at the hinge if that has a cap, is scaled so that none of their modes
    /// is faster than its cap (section 4.3 of the model page).
    #[derive(Default)]
    pub enum MethodKind {
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
        /// Classical Runge-Kutta of order 4, without capped modes.
        #[default]
        Rk4 = "rk4",
        /// Dormand and Prince's method of order 5(4), adaptive.
        Dopri5 = "dopri5",
        /// Kennedy and Carpenter's additive method of order 5(4), adaptive. The springs of bearings
        /// and hinge are implicit, so that their stiffness does not limit the step.
        Additive = "additive",
        /// Dormand and Prince's formula of order 8 with fixed steps, without capped modes. The
        /// linear model uses classical Runge-Kutta instead.
        Dop853 = "dop853",
        /// Dormand and Prince's formula of order 8 with adaptive steps up to the limit of
        /// stability. The linear model uses [`Self::Dopri5`] instead.
        Dop853Adaptive = "dop853_adaptive",
    }
}

impl MethodKind {
    /// The kinds with capped bearing modes, coarsest first.
    pub const CAPPED: [Self; 6] =
        [Self::Capped0, Self::Capped1, Self::Capped2, Self::Capped3, Self::Capped4, Self::Capped5];

    /// Whether modes of the bearings are capped.
    pub const fn is_capped(self) -> bool {
        matches!(
            self,
            Self::Capped0
                | Self::Capped1
                | Self::Capped2
                | Self::Capped3
                | Self::Capped4
                | Self::Capped5
        )
    }

    /// Whether each lane has its own steps, which follow the error estimate.
    pub const fn adapts_steps(self) -> bool {
        matches!(self, Self::Dopri5 | Self::Additive | Self::Dop853Adaptive)
    }
}

/// A method of integration: the kind with its parameters. Parameters that the kind does not use are
/// zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Method {
    /// The kind.
    pub kind: MethodKind,
    /// The longest step (s), or the first step that an adaptive method tries.
    pub step_s: f64,
    /// The caps of capped kinds.
    pub caps: Caps,
    /// The tolerance of adaptive kinds.
    pub tolerance: Tolerance,
}

/// A function that is generic over the stepper, and is therefore compiled once for each stepper.
pub(crate) trait StepperVisitor<F: ModelFamily>: Sized {
    type Output;
    fn visit<S: Stepper>(self, stepper: S) -> Self::Output;
}

impl Method {
    /// Returns a method of a kind whose parameters are zero, except for the first step of adaptive
    /// kinds.
    pub const fn new(kind: MethodKind) -> Self {
        Self {
            kind,
            step_s: if kind.adapts_steps() { FIRST_STEP_S } else { 0.0 },
            caps: Caps { bearings_rad_per_s: 0.0, hinge_rad_per_s: None },
            tolerance: Tolerance {
                relative: 0.0,
                absolute: 0.0,
                max_steps: 0,
                longest_step_s: None,
            },
        }
    }

    /// Returns classical Runge-Kutta in fixed steps (s).
    pub const fn rk4(step_s: f64) -> Self {
        Self { step_s, ..Self::new(MethodKind::Rk4) }
    }

    /// Returns the formula of order 8 in fixed steps (s).
    pub const fn dop853(step_s: f64) -> Self {
        Self { step_s, ..Self::new(MethodKind::Dop853) }
    }

    /// Returns the formula of order 8 in adaptive steps.
    pub const fn dop853_adaptive(tolerance: Tolerance) -> Self {
        Self { tolerance, ..Self::new(MethodKind::Dop853Adaptive) }
    }

    /// Returns a capped kind in fixed steps (s).
    pub const fn capped(kind: MethodKind, step_s: f64, caps: Caps) -> Self {
        Self { step_s, caps, ..Self::new(kind) }
    }

    /// Returns Dormand and Prince's adaptive method.
    pub const fn dopri5(tolerance: Tolerance) -> Self {
        Self { tolerance, ..Self::new(MethodKind::Dopri5) }
    }

    /// Returns the additive method.
    pub const fn additive(tolerance: Tolerance) -> Self {
        Self { tolerance, ..Self::new(MethodKind::Additive) }
    }

    /// Returns a one-line description of the method with its parameters for a model.
    pub fn describe(&self, model: ModelKind) -> String {
        let name = self.kind.name();
        let step_ms = 1e3 * self.step_s;
        if self.kind.adapts_steps() {
            return format!("{name} (tolerance {:.0e})", self.tolerance.relative);
        }
        if !self.kind.is_capped() {
            return format!("{name} (step {step_ms:.3} ms)");
        }
        let order = Formula::for_model(model).order();
        let cap_rad_per_s = self.caps.bearings_rad_per_s;
        format!(
            "{name} (order {order}, step {step_ms:.3} ms, bearings capped at {cap_rad_per_s:.0} \
             rad/s)"
        )
    }

    /// Calls a visitor with the stepper of this method.
    pub(crate) fn visit_stepper<F: ModelFamily, V: StepperVisitor<F>>(
        &self,
        visitor: V,
    ) -> V::Output {
        // A match on the formula would compile both arms for each model.
        const { assert!(F::FixedStepStepper::FORMULA as u8 == Formula::for_model(F::KIND) as u8) };
        match self.kind {
            MethodKind::Rk4 => visitor.visit(Rk4Stepper),
            MethodKind::Dopri5 => visitor.visit(Dopri5Stepper(self.tolerance)),
            MethodKind::Dop853Adaptive => visitor.visit(F::adaptive_stepper(self.tolerance)),
            MethodKind::Additive => visitor.visit(AdditiveStepper(self.tolerance)),
            MethodKind::Capped0
            | MethodKind::Capped1
            | MethodKind::Capped2
            | MethodKind::Capped3
            | MethodKind::Capped4
            | MethodKind::Capped5
            | MethodKind::Dop853 => visitor.visit(F::FixedStepStepper::INSTANCE),
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
    method: &Method,
    point: &Point,
    segment: &PlannedSegment,
) -> Segment {
    model.set_spin(lane, &point.spin_segments[segment.spin_segment_index]);
    Segment { start_s: segment.start_s, end_s: segment.end_s, step_s: method.step_s }
}

/// Returns the coupling of tub and rotor by a method's caps.
#[inline(always)]
pub(crate) fn coupling_for_method<T: Lane>(method: &Method, zero: N<T>) -> Coupling<T> {
    if !method.kind.is_capped() {
        return Coupling::Springs;
    }
    Coupling::new(zero, Some(&method.caps))
}

/// The nonlinear or the linear model, as a type that is independent of the lanes.
pub(crate) trait ModelFamily {
    /// The model over lanes.
    type OnLanes<T: Lane>: LaneModel<T>;
    /// The stepper of capped kinds and of [`MethodKind::Dop853`], by the model's formula.
    type FixedStepStepper: FixedStepper;
    /// The stepper of [`MethodKind::Dop853Adaptive`].
    type AdaptiveStepper: Stepper;
    /// The model as a value.
    const KIND: ModelKind;
    /// Returns the stepper of [`MethodKind::Dop853Adaptive`] with its tolerance.
    fn adaptive_stepper(tolerance: Tolerance) -> Self::AdaptiveStepper;
}

/// The nonlinear model over any lanes.
pub(crate) enum NonlinearFamily {}
/// The linear model over any lanes.
pub(crate) enum LinearFamily {}
impl ModelFamily for NonlinearFamily {
    type OnLanes<T: Lane> = NonlinearModel<T>;
    type FixedStepStepper = Dop853Stepper;
    type AdaptiveStepper = Dop853AdaptiveStepper;
    const KIND: ModelKind = ModelKind::Nonlinear;

    fn adaptive_stepper(tolerance: Tolerance) -> Dop853AdaptiveStepper {
        Dop853AdaptiveStepper(tolerance)
    }
}
impl ModelFamily for LinearFamily {
    type OnLanes<T: Lane> = LinearModel<T>;
    type FixedStepStepper = Rk4Stepper;
    type AdaptiveStepper = Dopri5Stepper;
    const KIND: ModelKind = ModelKind::Linear;

    fn adaptive_stepper(tolerance: Tolerance) -> Dopri5Stepper {
        Dopri5Stepper(tolerance)
    }
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
    Dop853AdaptiveStepper(Tolerance) =
        |self, zero, task| dop853_adaptive::integrate(zero, task, &self.0);
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

//! A reference for tests: the monodromy matrix without caps and interpolation, by classical
//! Runge-Kutta in steps that resolve the bearings' modes.

use super::monodromy::StateMatrix;
use super::period_map::{TurnSetup, lane_model};
use super::turn::{NoObserver, StepGrid, StepObserver, integrate_turn};
use crate::coordinates::STATES;
use crate::modes::{ModesError, highest_frequency_rad_per_s};
use crate::run::model::NonlinearModel;
use core::f64::consts::TAU;
use lane_ode::{Dual, Lu, N, OutOfLine, System as _};

/// The product of step and greatest frequency (rad).
const STEP_PHASE_RAD: f64 = 1.0;

/// The greatest relative correction of a response. Basis: a tenth of the tolerance of responses.
/// Doubling it changes nothing.
const RESPONSE_TOLERANCE: f64 = 1e-9;

/// The greatest number of iterations of Newton's method, which starts at the tested response.
const MAX_ITERATIONS: usize = 6;

/// The computation of the monodromy matrix of a response, with speeds in the unit `unit_per_s`.
pub(super) struct ReferenceMonodromy<'a> {
    setup: TurnSetup<'a>,
    start_state: [f64; STATES],
    unit_per_s: f64,
}

impl<'a> ReferenceMonodromy<'a> {
    /// Creates the computation from a state close to the response.
    pub(super) fn new(
        setup: &TurnSetup<'a>,
        start_state: [f64; STATES],
        unit_per_s: f64,
    ) -> Result<Self, ModesError> {
        let highest_rad_per_s =
            highest_frequency_rad_per_s(setup.point, setup.speed_rpm * TAU / 60.0)?;
        let step_count =
            (setup.turn_s() * highest_rad_per_s / STEP_PHASE_RAD).ceil().max(100.0) as usize;
        Ok(Self { setup: TurnSetup { step_count, caps: None, ..*setup }, start_state, unit_per_s })
    }
}

impl OutOfLine for ReferenceMonodromy<'_> {
    /// The matrix; `None` if Newton's method does not converge.
    type Output = Option<StateMatrix>;

    #[inline(always)]
    fn run(self) -> Option<StateMatrix> {
        let zero = N(0.0).constant();
        let tangent_model: NonlinearModel<Dual<f64>> = lane_model(zero, &[self.setup]);
        let grid = StepGrid {
            step_s: zero.lit(self.setup.step_s()),
            step_count: self.setup.step_count,
            hinge_damping_factor: None,
        };
        let mut x = self.start_state;
        for _ in 0..MAX_ITERATIONS {
            let mut columns = vec![[zero; STATES]; STATES];
            for j in 0..STATES {
                for i in 0..STATES {
                    columns[j][i] = zero.lit(x[i]);
                }
                columns[j][j].0.slope = 1.0;
            }
            integrate_turn(&tangent_model, &grid, &mut columns, None::<&mut NoObserver>);
            let mut matrix = [[N(0.0); STATES]; STATES];
            let mut newton_matrix = matrix;
            let mut residual = [N(0.0); STATES];
            for i in 0..STATES {
                residual[i] = N(columns[0][i].0.value - x[i]);
                for j in 0..STATES {
                    let slope = columns[j][i].0.slope;
                    matrix[i][j] = N(slope);
                    newton_matrix[i][j] = N(-slope);
                }
                newton_matrix[i][i] = newton_matrix[i][i] + 1.0;
            }
            let correction = Lu::new(newton_matrix)?.solve(&residual);
            let mut largest_correction = 0.0_f64;
            let mut largest_deviation = 0.0_f64;
            for i in 0..STATES {
                if !correction[i].0.is_finite() {
                    return None;
                }
                x[i] += correction[i].0;
                if i < STATES / 2 {
                    largest_correction = largest_correction.max(correction[i].0.abs());
                    largest_deviation =
                        largest_deviation.max((x[i] - self.setup.point.equilibrium()[i]).abs());
                }
            }
            if largest_correction <= RESPONSE_TOLERANCE * largest_deviation {
                return Some(scale_speeds(&matrix, self.unit_per_s));
            }
        }
        None
    }
}

/// Converts a matrix of derivatives to speeds in the unit `unit_per_s`.
fn scale_speeds(matrix: &StateMatrix, unit_per_s: f64) -> StateMatrix {
    let component_unit = |i: usize| if i < STATES / 2 { 1.0 } else { unit_per_s };
    let mut scaled_matrix = *matrix;
    for i in 0..STATES {
        for j in 0..STATES {
            scaled_matrix[i][j] = N(matrix[i][j].0 * component_unit(j) / component_unit(i));
        }
    }
    scaled_matrix
}

/// The integral over a turn from a state of the sum of the Jacobian's diagonal.
pub(super) struct TraceIntegral<'a> {
    pub(super) setup: TurnSetup<'a>,
    pub(super) start_state: [f64; STATES],
}

struct TraceObserver<'m> {
    model: &'m NonlinearModel<Dual<f64>>,
    step_s: f64,
    step_count: usize,
    integral: f64,
}

impl StepObserver<Dual<f64>, NonlinearModel<Dual<f64>>> for TraceObserver<'_> {
    fn observe(
        &mut self,
        k: usize,
        forcing: &<NonlinearModel<Dual<f64>> as lane_ode::System<Dual<f64>, STATES>>::Forcing,
        x: &[N<Dual<f64>>; STATES],
        _: &[N<Dual<f64>>; STATES],
    ) {
        if k == self.step_count {
            return;
        }
        for j in STATES / 2..STATES {
            let mut dual_state = *x;
            dual_state[j].0.slope = 1.0;
            self.integral += self.step_s * self.model.derivative(forcing, &dual_state)[j].0.slope;
        }
    }
}

impl OutOfLine for TraceIntegral<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let zero = N(0.0).constant();
        let model: NonlinearModel<Dual<f64>> = lane_model(zero, &[self.setup]);
        let step_s = self.setup.step_s();
        let step_count = self.setup.step_count;
        let grid = StepGrid { step_s: zero.lit(step_s), step_count, hinge_damping_factor: None };
        let mut states = [self.start_state.map(|x| zero.lit(x))];
        let mut observer = TraceObserver { model: &model, step_s, step_count, integral: 0.0 };
        integrate_turn(&model, &grid, &mut states, Some(&mut observer));
        observer.integral
    }
}

//! The equations of motion of a point as plain functions of time and state, for integrators of
//! other programs.

use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::machine::spin::{SpinSegment, segment_index};
use crate::nonlinear::coupling::Coupling;
use crate::run::model::{LaneModel, LinearModel, NonlinearModel};
use crate::{COORDINATES, ModelKind, Point};
use lane_ode::{Dual, N, OutOfLine, Partials, Simd};
use std::sync::Arc;

/// The length of a state: the ten coordinates q1 to q10 (m, rad), then their speeds.
pub const STATE_LEN: usize = STATES;

/// The equations of motion x' = f(t, x) of one point. The nonlinear model's coordinates are those
/// of the model page, the linear model's are deviations from equilibrium.
pub struct PointEquations {
    model: EitherModel,
    rest_state: [f64; STATES],
    spin_segments: Arc<[SpinSegment]>,
    /// The index of the spin segment at the last call.
    spin_segment_index: usize,
}

/// A model over plain numbers and over dual numbers.
struct DifferentiableModel<M, J> {
    model: M,
    dual_model: J,
}

/// The nonlinear or the linear model.
enum EitherModel {
    Nonlinear(Box<DifferentiableModel<NonlinearModel<f64>, NonlinearModel<Dual<f64>>>>),
    Linear(Box<DifferentiableModel<LinearModel<f64>, LinearModel<Dual<f64>>>>),
}

impl PointEquations {
    /// Creates the equations of one model at a point.
    pub fn new(point: &Point, model: ModelKind) -> Self {
        let (model, rest_state) = match model {
            ModelKind::Nonlinear => (
                EitherModel::Nonlinear(DifferentiableModel::new(point)),
                <NonlinearModel<f64> as LaneModel<f64>>::rest_state(point),
            ),
            ModelKind::Linear => (
                EitherModel::Linear(DifferentiableModel::new(point)),
                <LinearModel<f64> as LaneModel<f64>>::rest_state(point),
            ),
        };
        Self {
            model,
            rest_state,
            spin_segments: Arc::clone(&point.spin_segments),
            spin_segment_index: 0,
        }
    }

    /// Returns the state at rest in static equilibrium, from which trajectories start.
    pub const fn rest_state(&self) -> &[f64; STATE_LEN] {
        &self.rest_state
    }

    /// Returns the times (s) at which the spin's acceleration, and therefore f, may jump. An
    /// integrator should end steps there.
    pub fn kinks_s(&self) -> impl Iterator<Item = f64> + '_ {
        self.spin_segments.iter().skip(1).map(|spin_segment| spin_segment.start_s.0)
    }

    /// Computes f at time `t_s`; at a kink, its limit from the right.
    pub fn derivative(&mut self, t_s: f64, x: &[f64; STATE_LEN]) -> [f64; STATE_LEN] {
        self.select_spin_segment(t_s);
        match &self.model {
            EitherModel::Nonlinear(models) => {
                Simd::one_lane(DerivativeKernel { model: &models.model, t_s, x })
            }
            EitherModel::Linear(models) => {
                Simd::one_lane(DerivativeKernel { model: &models.model, t_s, x })
            }
        }
    }

    /// Computes the Jacobian of f with respect to the state, by rows, exact to rounding.
    pub fn jacobian(&mut self, t_s: f64, x: &[f64; STATE_LEN]) -> [[f64; STATE_LEN]; STATE_LEN] {
        self.select_spin_segment(t_s);
        let partials = match &self.model {
            EitherModel::Nonlinear(models) => {
                Simd::one_lane(JacobianKernel { dual_model: &models.dual_model, t_s, x })
            }
            EitherModel::Linear(models) => {
                Simd::one_lane(JacobianKernel { dual_model: &models.dual_model, t_s, x })
            }
        };
        let mut jacobian_rows = [[0.0; STATES]; STATES];
        for i in 0..COORDINATES {
            jacobian_rows[i][COORDINATES + i] = 1.0;
            for j in 0..COORDINATES {
                jacobian_rows[COORDINATES + i][j] = partials.by_coordinate[i][j].0;
                jacobian_rows[COORDINATES + i][COORDINATES + j] = partials.by_speed[i][j].0;
            }
        }
        jacobian_rows
    }

    /// Computes the channels' deviations from equilibrium (m, rad) in the order of
    /// [`crate::Channel::ALL`], and their rates.
    pub fn channels(
        &mut self,
        t_s: f64,
        x: &[f64; STATE_LEN],
    ) -> ([f64; CHANNELS], [f64; CHANNELS]) {
        self.select_spin_segment(t_s);
        match &self.model {
            EitherModel::Nonlinear(models) => {
                Simd::one_lane(ChannelKernel { model: &models.model, t_s, x })
            }
            EitherModel::Linear(models) => {
                Simd::one_lane(ChannelKernel { model: &models.model, t_s, x })
            }
        }
    }

    /// Sets the spin segment of the models to that of a time.
    fn select_spin_segment(&mut self, t_s: f64) {
        let is_before = |k: usize| {
            self.spin_segments.get(k).is_none_or(|spin_segment| t_s < spin_segment.start_s.0)
        };
        if is_before(self.spin_segment_index + 1)
            && (self.spin_segment_index == 0 || !is_before(self.spin_segment_index))
        {
            return;
        }
        self.spin_segment_index = segment_index(&self.spin_segments, t_s);
        let spin_segment = &self.spin_segments[self.spin_segment_index];
        match &mut self.model {
            EitherModel::Nonlinear(models) => models.set_spin(spin_segment),
            EitherModel::Linear(models) => models.set_spin(spin_segment),
        }
    }
}

impl<M: LaneModel<f64>, J: LaneModel<Dual<f64>>> DifferentiableModel<M, J> {
    fn new(point: &Point) -> Box<Self> {
        Box::new(Self {
            model: M::splat(N(0.0), point, Coupling::Springs),
            dual_model: J::splat(N(0.0).constant(), point, Coupling::Springs),
        })
    }

    fn set_spin(&mut self, spin_segment: &SpinSegment) {
        self.model.set_spin(0, spin_segment);
        self.dual_model.set_spin(0, spin_segment);
    }
}

/// The kernel that computes f.
struct DerivativeKernel<'a, M> {
    model: &'a M,
    t_s: f64,
    x: &'a [f64; STATES],
}

impl<M: LaneModel<f64>> OutOfLine for DerivativeKernel<'_, M> {
    type Output = [f64; STATES];
    #[inline(always)]
    fn run(self) -> [f64; STATES] {
        let forcing = self.model.forcing(N(self.t_s));
        self.model.derivative(&forcing, &self.x.map(N)).map(|N(rate)| rate)
    }
}

/// The kernel that computes the Jacobian of f by automatic differentiation.
struct JacobianKernel<'a, J> {
    dual_model: &'a J,
    t_s: f64,
    x: &'a [f64; STATES],
}

impl<J: LaneModel<Dual<f64>>> OutOfLine for JacobianKernel<'_, J> {
    type Output = Partials<COORDINATES>;
    #[inline(always)]
    fn run(self) -> Partials<COORDINATES> {
        let mut partials = Partials::zero();
        partials.compute(0.0, self.dual_model, self.t_s, &self.x.map(N));
        partials
    }
}

/// The kernel that computes the channels and their rates.
struct ChannelKernel<'a, M> {
    model: &'a M,
    t_s: f64,
    x: &'a [f64; STATES],
}

impl<M: LaneModel<f64>> OutOfLine for ChannelKernel<'_, M> {
    type Output = ([f64; CHANNELS], [f64; CHANNELS]);
    #[inline(always)]
    fn run(self) -> Self::Output {
        let x = self.x.map(N);
        let forcing = self.model.forcing(N(self.t_s));
        let dx = self.model.derivative(&forcing, &x);
        let mut values = [0.0; CHANNELS];
        let mut rates = [0.0; CHANNELS];
        if let (_, Some(channels)) = self.model.observe(&forcing, &x, &dx, true) {
            for i in 0..CHANNELS {
                values[i] = channels[i].value.0;
                rates[i] = channels[i].slope.0;
            }
        }
        (values, rates)
    }
}

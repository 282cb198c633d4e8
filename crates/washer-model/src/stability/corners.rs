//! The effect of forces with corners on disturbances.
//!
//! A force F along a motion of the tub adds r F to the accelerations, where r is the vector of
//! accelerations per unit of force. The derivative of this term is r dF + F dr. F and dF change
//! abruptly, within a step. The vector r, its derivative dr, and the dependence of the motion on
//! the tub's coordinates are smooth over a turn.

use crate::coordinates::{COORDINATES, ROTOR_ROTATIONS, STATES, TUB_COORDINATES};
use crate::lanes::lane_struct;
use crate::machine::spin::SpinState;
use crate::nonlinear::elements::corners::CornerForce;
use crate::run::model::NonlinearModel;
use lane_ode::{Dual, Lane, N, OutOfLine};

/// The derivative of every acceleration by each coordinate, then by each speed.
pub(super) type AccelerationDerivatives = [[N<f64>; STATES]; COORDINATES];

/// The coordinates on which accelerations per unit of force depend; those of the tub come first.
const LOAD_RESPONSE_COORDINATES: [usize; TUB_COORDINATES.len() + ROTOR_ROTATIONS.len()] = {
    let [a, b, c, d] = TUB_COORDINATES;
    let [e, f, g, h] = ROTOR_ROTATIONS;
    [a, b, c, d, e, f, g, h]
};

lane_struct! {
    /// A motion on which a force with corners depends, at an instant.
    #[derive(Clone, Copy)]
    CornerMotion {
        /// The derivatives of the motion's speed by the tub's speeds, which equal those of its
        /// depth by the tub's coordinates.
        speed_per_tub_speed: [N<T>; TUB_COORDINATES.len()],
        /// The derivatives of the motion's speed by the tub's coordinates.
        speed_per_coordinate: [N<T>; TUB_COORDINATES.len()],
        /// The accelerations that a unit of force along the motion causes.
        acceleration_per_force: [N<T>; COORDINATES],
        /// The derivatives of `acceleration_per_force` by [`LOAD_RESPONSE_COORDINATES`].
        acceleration_per_force_derivative: [[N<T>; LOAD_RESPONSE_COORDINATES.len()]; COORDINATES],
    }
}

impl<T: Lane> CornerMotion<T> {
    #[inline(always)]
    pub(super) fn zero(zero: N<T>) -> Self {
        let zeros = [zero; TUB_COORDINATES.len()];
        Self {
            speed_per_tub_speed: zeros,
            speed_per_coordinate: zeros,
            acceleration_per_force: [zero; COORDINATES],
            acceleration_per_force_derivative: [[zero; LOAD_RESPONSE_COORDINATES.len()];
                COORDINATES],
        }
    }
}

/// The computation of the motions of all forces with corners at a state.
pub(super) struct CornerMotionEvaluation<'a, T> {
    pub(super) model: &'a NonlinearModel<Dual<T>>,
    pub(super) spin: &'a SpinState<Dual<T>>,
    pub(super) x: &'a [N<T>; STATES],
}

impl<T: Lane> OutOfLine for CornerMotionEvaluation<'_, T> {
    type Output = Vec<CornerMotion<T>>;

    #[inline(always)]
    fn run(self) -> Vec<CornerMotion<T>> {
        let Self { model, spin, x } = self;
        let zero = x[0].lit(0.0);
        let mut state = [zero.constant(); STATES];
        for i in 0..STATES {
            state[i] = x[i].constant();
        }
        let mut corner_motions = vec![CornerMotion::zero(zero); model.corner_motions(&state).len()];
        for direction in 0..LOAD_RESPONSE_COORDINATES.len() {
            state[LOAD_RESPONSE_COORDINATES[direction]].0.slope = zero.lit(1.0).0;
            let motions = model.corner_motions(&state);
            let accelerations_per_load = model.accelerations_per_load(spin, &state);
            if direction < TUB_COORDINATES.len() {
                for m in 0..corner_motions.len() {
                    corner_motions[m].speed_per_coordinate[direction] = N(motions[m][1].0.slope);
                }
            }
            // A force loads a coordinate by the derivative of the motion's speed by that
            // coordinate's speed (virtual power). The motion's speed is linear in the tub's speeds.
            for k in 0..TUB_COORDINATES.len() {
                let mut unit_speed_state = state;
                for tub_coordinate in TUB_COORDINATES {
                    unit_speed_state[COORDINATES + tub_coordinate] = zero.constant();
                }
                unit_speed_state[COORDINATES + TUB_COORDINATES[k]] = zero.lit(1.0).constant();
                let speeds = model.corner_motions(&unit_speed_state);
                for m in 0..corner_motions.len() {
                    let corner = &mut corner_motions[m];
                    let speed = speeds[m][1];
                    corner.speed_per_tub_speed[k] = N(speed.0.value);
                    for i in 0..COORDINATES {
                        let Dual { value, slope } = (speed * accelerations_per_load[k][i]).v().0;
                        corner.acceleration_per_force_derivative[i][direction] += N(slope);
                        if direction == 0 {
                            corner.acceleration_per_force[i] += N(value);
                        }
                    }
                }
            }
            state[LOAD_RESPONSE_COORDINATES[direction]].0.slope = zero.0;
        }
        corner_motions
    }
}

impl CornerMotion<f64> {
    /// Adds another motion times a factor.
    #[inline(always)]
    pub(super) fn add_scaled(&mut self, other: &Self, factor: f64) {
        let factor = N(factor);
        for k in 0..TUB_COORDINATES.len() {
            self.speed_per_tub_speed[k] += factor * other.speed_per_tub_speed[k];
            self.speed_per_coordinate[k] += factor * other.speed_per_coordinate[k];
        }
        for i in 0..COORDINATES {
            self.acceleration_per_force[i] += factor * other.acceleration_per_force[i];
            for k in 0..LOAD_RESPONSE_COORDINATES.len() {
                self.acceleration_per_force_derivative[i][k] +=
                    factor * other.acceleration_per_force_derivative[i][k];
            }
        }
    }

    /// Adds the derivatives of the accelerations due to a force along the motion, times a factor.
    #[inline(always)]
    pub(super) fn add_force_derivatives(
        &self,
        force: &CornerForce<f64>,
        factor: f64,
        derivatives: &mut AccelerationDerivatives,
    ) {
        for i in 0..COORDINATES {
            for k in 0..LOAD_RESPONSE_COORDINATES.len() {
                derivatives[i][LOAD_RESPONSE_COORDINATES[k]] +=
                    (force.force * self.acceleration_per_force_derivative[i][k]).v() * factor;
            }
        }
        for k in 0..TUB_COORDINATES.len() {
            let speed_per_tub_speed = (force.force_per_speed * self.speed_per_tub_speed[k]).v();
            let speed_per_coordinate = force.force_per_depth * self.speed_per_tub_speed[k]
                + force.force_per_speed * self.speed_per_coordinate[k];
            for i in 0..COORDINATES {
                derivatives[i][TUB_COORDINATES[k]] +=
                    (self.acceleration_per_force[i] * speed_per_coordinate).v() * factor;
                derivatives[i][COORDINATES + TUB_COORDINATES[k]] +=
                    (self.acceleration_per_force[i] * speed_per_tub_speed).v() * factor;
            }
        }
    }
}

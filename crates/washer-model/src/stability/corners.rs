//! Effects of forces with corners on disturbances.
//!
//! A force F along a motion of the tub adds the response r F to the accelerations. Its derivatives
//! are r dF + F dr: F and its slopes turn within a step, while r, dr and how the motion hangs on
//! the tub's coordinates are smooth over a turn.

use crate::coordinates::{COORDINATES, ROTOR_TURNS, STATES, TUB};
use crate::lanes::lane_struct;
use crate::machine::spin::SpinState;
use crate::nonlinear::elements::corners::CornerForce;
use crate::run::model::Nonlinear;
use lane_ode::{Aside, Dual, Lane, N};

/// The derivative of every acceleration by each coordinate, then by each speed.
pub(super) type Slopes = [[N<f64>; STATES]; COORDINATES];

/// Coordinates on which responses hang, the tub's first.
const BENDS: [usize; TUB.len() + ROTOR_TURNS.len()] = {
    let [a, b, c, d] = TUB;
    let [e, f, g, h] = ROTOR_TURNS;
    [a, b, c, d, e, f, g, h]
};

lane_struct! {
    /// A motion that a force with corners hangs on, at an instant.
    #[derive(Clone, Copy)]
    Corner {
        /// Derivatives of its speed by the tub's speeds, which are its depth's by the coordinates,
        by_speed: [N<T>; TUB.len()],
        /// and of its speed by the coordinates.
        by_place: [N<T>; TUB.len()],
        /// The addition of a unit of force along it to the accelerations,
        response: [N<T>; COORDINATES],
        /// and how that changes with coordinates.
        bend: [[N<T>; BENDS.len()]; COORDINATES],
    }
}

impl<T: Lane> Corner<T> {
    #[inline(always)]
    pub(super) fn none(zero: N<T>) -> Self {
        let none = [zero; TUB.len()];
        Self {
            by_speed: none,
            by_place: none,
            response: [zero; COORDINATES],
            bend: [[zero; BENDS.len()]; COORDINATES],
        }
    }
}

/// The motions of a machine's forces with corners in a state.
pub(super) struct Corners<'a, T> {
    pub(super) model: &'a Nonlinear<Dual<T>>,
    pub(super) spin: &'a SpinState<Dual<T>>,
    pub(super) x: &'a [N<T>; STATES],
}

impl<T: Lane> Aside for Corners<'_, T> {
    type Output = Vec<Corner<T>>;

    #[inline(always)]
    fn run(self) -> Vec<Corner<T>> {
        let Self { model, spin, x } = self;
        let zero = x[0].lit(0.0);
        let mut state = [zero.constant(); STATES];
        for i in 0..STATES {
            state[i] = x[i].constant();
        }
        let mut corners = vec![Corner::none(zero); model.corner_motions(&state).len()];
        for by in 0..BENDS.len() {
            state[BENDS[by]].0.slope = zero.lit(1.0).0;
            let motions = model.corner_motions(&state);
            let by_load = model.accelerations_per_load(spin, &state);
            if by < TUB.len() {
                for m in 0..corners.len() {
                    corners[m].by_place[by] = N(motions[m][1].0.slope);
                }
            }
            // A force loads each coordinate by the derivative of the motion's speed by the
            // coordinate's (virtual power). A motion's speed is linear in the tub's.
            for k in 0..TUB.len() {
                let mut unit = state;
                for of in TUB {
                    unit[COORDINATES + of] = zero.constant();
                }
                unit[COORDINATES + TUB[k]] = zero.lit(1.0).constant();
                let speeds = model.corner_motions(&unit);
                for m in 0..corners.len() {
                    let corner = &mut corners[m];
                    let speed = speeds[m][1];
                    corner.by_speed[k] = N(speed.0.value);
                    for i in 0..COORDINATES {
                        let Dual { value, slope } = (speed * by_load[k][i]).v().0;
                        corner.bend[i][by] += N(slope);
                        if by == 0 {
                            corner.response[i] += N(value);
                        }
                    }
                }
            }
            state[BENDS[by]].0.slope = zero.0;
        }
        corners
    }
}

impl Corner<f64> {
    /// Adds another, so many times.
    #[inline(always)]
    pub(super) fn add(&mut self, other: &Self, times: f64) {
        let times = N(times);
        for k in 0..TUB.len() {
            self.by_speed[k] += times * other.by_speed[k];
            self.by_place[k] += times * other.by_place[k];
        }
        for i in 0..COORDINATES {
            self.response[i] += times * other.response[i];
            for k in 0..BENDS.len() {
                self.bend[i][k] += times * other.bend[i][k];
            }
        }
    }

    /// Adds what a force along it adds to the derivatives of the accelerations, so many times.
    #[inline(always)]
    pub(super) fn apply(&self, of: &CornerForce<f64>, times: f64, slopes: &mut Slopes) {
        for i in 0..COORDINATES {
            for k in 0..BENDS.len() {
                slopes[i][BENDS[k]] += (of.force * self.bend[i][k]).v() * times;
            }
        }
        for k in 0..TUB.len() {
            let by_speed = (of.by_speed * self.by_speed[k]).v();
            let by_place = of.by_depth * self.by_speed[k] + of.by_speed * self.by_place[k];
            for i in 0..COORDINATES {
                slopes[i][TUB[k]] += (self.response[i] * by_place).v() * times;
                slopes[i][COORDINATES + TUB[k]] += (self.response[i] * by_speed).v() * times;
            }
        }
    }
}

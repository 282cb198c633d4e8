//! Computes the partial derivatives of a second-order system by dual numbers, exact to rounding.

use crate::{Dual, Lane, N, System};

/// The derivatives of the accelerations of a system of `C` coordinates by its state.
///
/// The state is C coordinates q, then their speeds u, so that q' = u and only the derivatives of u'
/// = a(t, q, u) are stored.
#[derive(Clone, Debug)]
pub struct Partials<const C: usize> {
    /// The derivative of acceleration i with respect to coordinate j, in row i and column j.
    pub by_coordinate: [[N<f64>; C]; C],
    /// The derivative of acceleration i with respect to speed j, in row i and column j.
    pub by_speed: [[N<f64>; C]; C],
}

impl<const C: usize> Partials<C> {
    /// Returns derivatives that are all zero.
    pub const fn zero() -> Self {
        Self { by_coordinate: [[N(0.0); C]; C], by_speed: [[N(0.0); C]; C] }
    }

    /// Computes the derivatives at time `t_s` and state `x`. `system` has the same parameters in
    /// every lane; each lane differentiates along its own direction, and the results do not depend
    /// on the number of lanes.
    #[inline(always)]
    pub fn compute<T: Lane, const D: usize, S: System<Dual<T>, D>>(
        &mut self,
        zero: T,
        system: &S,
        t_s: f64,
        x: &[N<f64>; D],
    ) {
        const { assert!(D == 2 * C, "a state is the coordinates and their speeds") };
        let zero = N(zero);
        let forcing = system.forcing_out_of_line(zero.lit(t_s).constant());
        let mut constant_state = [zero.constant(); D];
        for i in 0..D {
            constant_state[i] = zero.lit(x[i].0).constant();
        }
        // The directions are a loop, so that the right-hand side is compiled once for all of them.
        for group in 0..D.div_ceil(T::LANES) {
            let first_direction = group * T::LANES;
            let mut seeded_state = constant_state;
            for lane in 0..T::LANES.min(D - first_direction) {
                seeded_state[first_direction + lane].0.slope.set(lane, 1.0);
            }
            let slopes = system.derivative_out_of_line(&forcing, &seeded_state);
            for i in 0..C {
                let slope = slopes[C + i].0.slope;
                for lane in 0..T::LANES.min(D - first_direction) {
                    let direction = first_direction + lane;
                    if direction < C {
                        self.by_coordinate[i][direction] = N(slope.get(lane));
                    } else {
                        self.by_speed[i][direction - C] = N(slope.get(lane));
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::array::Array;

    /// A driven pendulum with a mass that a spring of stiffness `stiffness` (1/s^2) connects to it.
    struct SprungPendulum {
        stiffness: f64,
    }

    impl<T: Lane> System<T, 4> for SprungPendulum {
        type Forcing = N<T>;

        fn forcing(&self, t_s: N<T>) -> N<T> {
            let (sin, _) = t_s.sin_cos();
            sin
        }

        fn derivative(&self, forcing: &N<T>, x: &[N<T>; 4]) -> [N<T>; 4] {
            let [angle, position, angular_speed, speed] = *x;
            let spring_pull = (position - angle) * self.stiffness;
            let (sin, _) = angle.sin_cos();
            [
                angular_speed,
                speed,
                spring_pull - 9.0 * sin - 0.1 * angular_speed + *forcing,
                4.0 * *forcing - 2.0 * spring_pull.v(),
            ]
        }

        fn in_range(&self, x: &[N<T>; 4]) -> T::Mask {
            x[0].abs().0.less(x[0].lit(1.5).0)
        }
    }

    #[test]
    fn derivatives_are_exact_and_do_not_depend_on_the_lanes() {
        let pendulum = SprungPendulum { stiffness: 50.0 };
        let x = [0.4, 0.5, -1.0, 2.0].map(N);
        let mut one_lane = Partials::<2>::zero();
        one_lane.compute(0.0, &pendulum, 2.0, &x);
        let mut four_lanes = Partials::<2>::zero();
        four_lanes.compute(Array([0.0; 4]), &pendulum, 2.0, &x);
        assert_eq!(format!("{one_lane:?}"), format!("{four_lanes:?}"));
        let by_coordinate = [[-50.0 - 9.0 * 0.4_f64.cos(), 50.0], [100.0, -100.0]];
        let by_speed = [[-0.1, 0.0], [0.0, 0.0]];
        for i in 0..2 {
            for j in 0..2 {
                let by_coordinate = (one_lane.by_coordinate[i][j].0, by_coordinate[i][j]);
                let by_speed = (one_lane.by_speed[i][j].0, by_speed[i][j]);
                for (computed, expected) in [by_coordinate, by_speed] {
                    assert!((computed - expected).abs() < 1e-13, "{i}, {j}: {computed} {expected}");
                }
            }
        }
    }
}

//! Partial derivatives of a second-order system, exact to rounding: the same source over dual
//! numbers.

use crate::{Dual, Lane, N, System};

/// How the accelerations of a system of `C` coordinates change with its state and with time.
///
/// The state is C coordinates q, then their speeds u, so that q' = u and only u' = a(t, q, u) has
/// derivatives worth storing.
#[derive(Clone, Debug)]
pub struct Partials<const C: usize> {
    /// Row i, column j: by coordinate j.
    pub by_coordinate: [[N<f64>; C]; C],
    /// Row i, column j: by speed j.
    pub by_speed: [[N<f64>; C]; C],
    /// By time alone.
    pub by_time: [N<f64>; C],
}

impl<const C: usize> Partials<C> {
    /// All zero.
    pub const fn zero() -> Self {
        Self { by_coordinate: [[N(0.0); C]; C], by_speed: [[N(0.0); C]; C], by_time: [N(0.0); C] }
    }

    /// The derivatives at time `t_s` and state `x`. `system` has the same parameters in every lane;
    /// each lane takes a direction of its own, and the results do not depend on how many there are.
    #[inline(always)]
    pub fn find<T: Lane, const D: usize, S: System<Dual<T>, D>>(
        &mut self,
        zero: T,
        system: &S,
        t_s: f64,
        x: &[N<f64>; D],
    ) {
        const { assert!(D == 2 * C, "a state is the coordinates and their speeds") };
        let zero = N(zero);
        let mut time = zero.lit(t_s).constant();
        let still = system.forcing_aside(time);
        time.0.slope = zero.lit(1.0).0;
        let moving = system.forcing_aside(time);
        let mut constant = [zero.constant(); D];
        for i in 0..D {
            constant[i] = zero.lit(x[i].0).constant();
        }
        let groups = D.div_ceil(T::LANES);
        // One copy of the right-hand side for all directions; the last group is time.
        for group in 0..=groups {
            let first = group * T::LANES;
            let mut seeded = constant;
            let mut forcing = &moving;
            if group < groups {
                forcing = &still;
                for lane in 0..T::LANES.min(D - first) {
                    seeded[first + lane].0.slope.set(lane, 1.0);
                }
            }
            let slopes = system.derivative_aside(forcing, &seeded);
            for i in 0..C {
                let slope = slopes[C + i].0.slope;
                if group == groups {
                    self.by_time[i] = N(slope.get(0));
                    continue;
                }
                for lane in 0..T::LANES.min(D - first) {
                    let direction = first + lane;
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

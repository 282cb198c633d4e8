//! Static equilibrium: where the machine rests under its weight, unbalance up (section 4 of the model page).

use crate::coefficients::Coefficients;
use crate::floating::Factors;
use crate::linear::seeded;
use crate::nonlinear::{COORDINATES, Halves, halves};
use crate::spin::SpinState;
use lane_ode::{Lane, N, Real};

/// Newton steps before giving up.
const MAX_ITERATIONS: usize = 60;
/// Longest step in any coordinate (m, rad): keeps a soft machine from being thrown through itself.
const LONGEST_STEP: f64 = 0.1;
/// A step below this (m, rad) is the last: Newton's method squares the error, so what remains is rounding.
const LAST_STEP: f64 = 1e-12;

/// Coordinates at rest, and in which lanes they were found. A machine that can only balance on a point, or not at all, has
/// none: its stiffness is not positive definite.
#[inline(always)]
pub(crate) fn find<T: Lane>(zero: N<T>, machine: &Coefficients<T>) -> ([N<T>; COORDINATES], u32) {
    let one = zero.lit(1.0);
    let machine = machine.constant();
    let mut q = [zero; COORDINATES];
    let mut found = 0_u32;
    let mut lost = 0_u32;
    for _ in 0..MAX_ITERATIONS {
        let mut stiffness = [[zero; COORDINATES]; COORDINATES];
        let mut force = [zero; COORDINATES];
        for j in 0..COORDINATES {
            let f = static_forces(&machine, &seeded(&q, j, 1.0));
            for i in 0..COORDINATES {
                stiffness[i][j] = N(f[i].0.slope.neg());
                force[i] = N(f[i].0.value);
            }
        }
        let factors = Factors::new(stiffness);
        let is_stable = factors.is_positive();
        let step = factors.solve(force);
        let mut longest = zero;
        for s in &step {
            longest = N(s.0.abs().larger(longest.0));
        }
        let scale = longest.where_less(zero.lit(LONGEST_STEP), one, zero.lit(LONGEST_STEP) / longest);
        let going = !(found | lost);
        for lane in (0..T::LANES).filter(|lane| going >> lane & 1 == 1) {
            for i in 0..COORDINATES {
                q[i].0.set(lane, q[i].0.get(lane) + scale.0.get(lane) * step[i].0.get(lane));
            }
            let longest = longest.0.get(lane);
            if !longest.is_finite() || is_stable >> lane & 1 == 0 {
                lost |= 1 << lane;
            } else if longest < LAST_STEP {
                found |= 1 << lane;
            }
        }
        if (found | lost) & ((1 << T::LANES) - 1) == (1 << T::LANES) - 1 {
            break;
        }
    }
    (q, found)
}

/// Generalised forces at rest.
#[inline(always)]
fn static_forces<T: Real>(machine: &Coefficients<T>, q: &[N<T>; COORDINATES]) -> [N<T>; COORDINATES] {
    let zero = q[0].lit(0.0);
    let spin = SpinState::new((zero, zero.lit(1.0)), zero, zero);
    let Halves { tub, rotor } = halves(&machine.view(), &spin, q, &[zero; COORDINATES]);
    let ([f1, f2], [f5, f6]) = tub.floating.generalised_forces();
    let ([f3, f4], [f7, f8, f9, f10]) = rotor.floating.generalised_forces();
    [f1, f2, f3, f4, f5, f6, f7, f8, f9, f10]
}

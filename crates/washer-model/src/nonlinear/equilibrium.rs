//! Static equilibrium: the place of rest under the machine's weight, unbalance up (section 4.2 of
//! the model page).

use crate::coordinates::{
    COORDINATES, SHAFT_PITCH, SHAFT_Y, SHAFT_YAW, SHAFT_Z, TUB_PITCH, TUB_Y, TUB_YAW, TUB_Z, seeded,
};
use crate::lanes::Constant as _;
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::Coefficients;
use crate::nonlinear::floating::Factors;
use crate::nonlinear::{Halves, halves};
use lane_ode::{Aside, Lane, N};

/// Newton steps before giving up.
const MAX_ITERATIONS: usize = 120;
/// From here on only a part of each step is taken: stops that open and close in turn would keep
/// whole ones going round.
const CAUTIOUS_FROM: usize = 60;
/// That part.
const CAUTION: f64 = 0.6;
/// Longest step in any coordinate (m, rad): keeps a soft machine from being thrown through itself.
const LONGEST_STEP: f64 = 0.1;
/// A step below this (m, rad) is the last: Newton's method squares the error, so only rounding
/// remains.
const LAST_STEP: f64 = 1e-12;
/// Added to the stiffness (N/m, N m/rad) where the machine is not stable, and raised tenfold until
/// it is. Unloaded springs that hang straight hold nothing sideways; they do once the machine has
/// sagged.
const LEAST_SHIFT: f64 = 10.0;
/// A machine that needs more has no place of rest.
const GREATEST_SHIFT: f64 = 1e9;

/// [`find`], aside.
pub(crate) struct Find<'a, T> {
    pub(crate) zero: N<T>,
    pub(crate) machine: &'a Coefficients<T>,
}

impl<T: Lane> Aside for Find<'_, T> {
    type Output = ([N<T>; COORDINATES], u32);

    #[inline(always)]
    fn run(self) -> Self::Output {
        find(self.zero, self.machine)
    }
}

/// Coordinates at rest, and in which lanes they were found. A machine without a stable place of
/// rest has none: its stiffness is not positive definite.
#[inline(always)]
pub(crate) fn find<T: Lane>(zero: N<T>, machine: &Coefficients<T>) -> ([N<T>; COORDINATES], u32) {
    let one = zero.lit(1.0);
    let machine = machine.constant();
    let mut q = [zero; COORDINATES];
    let mut found = 0_u32;
    let mut lost = 0_u32;
    let mut shift = zero;
    for iteration in 0..MAX_ITERATIONS {
        let mut stiffness = [[zero; COORDINATES]; COORDINATES];
        let mut force = [zero; COORDINATES];
        for j in 0..COORDINATES {
            let f = static_forces(&machine, &seeded(&q, j, 1.0));
            for i in 0..COORDINATES {
                stiffness[i][j] = N(f[i].0.slope.neg());
                force[i] = N(f[i].0.value);
            }
            stiffness[j][j] += shift;
        }
        let factors = Factors::new(stiffness);
        let is_stable = factors.is_positive();
        let step = factors.solve(force);
        let mut longest = zero;
        for s in &step {
            longest = N(s.0.abs().larger(longest.0));
        }
        let scale =
            longest.where_less(zero.lit(LONGEST_STEP), one, zero.lit(LONGEST_STEP) / longest);
        let scale = if iteration < CAUTIOUS_FROM { scale } else { (scale * CAUTION).v() };
        let going = !(found | lost);
        for lane in (0..T::LANES).filter(|lane| going >> lane & 1 == 1) {
            let (added, longest) = (shift.0.get(lane), longest.0.get(lane));
            if is_stable >> lane & 1 == 0 || !longest.is_finite() {
                lost |= u32::from(added > GREATEST_SHIFT) << lane;
                shift.0.set(lane, (10.0 * added).max(LEAST_SHIFT));
                continue;
            }
            for i in 0..COORDINATES {
                q[i].0.set(lane, q[i].0.get(lane) + scale.0.get(lane) * step[i].0.get(lane));
            }
            found |= u32::from(added == 0.0 && longest < LAST_STEP) << lane;
            shift.0.set(lane, if added > LEAST_SHIFT { 0.1 * added } else { 0.0 });
        }
        if (found | lost) & ((1 << T::LANES) - 1) == (1 << T::LANES) - 1 {
            break;
        }
    }
    (q, found)
}

/// The motions of tub and drum together: the word for each, the coordinates that move, the unit of
/// its stiffness.
const RIGID_MOTIONS: [(&str, [usize; 2], &str); 4] = [
    ("up or down", [TUB_Y, SHAFT_Y], "N/m"),
    ("sideways", [TUB_Z, SHAFT_Z], "N/m"),
    ("round the vertical (yaw)", [TUB_YAW, SHAFT_YAW], "N m/rad"),
    ("over its front or back (pitch)", [TUB_PITCH, SHAFT_PITCH], "N m/rad"),
];

/// Returns the motion of tub and drum together that is least stable at coordinates `q`, with its
/// stiffness and unit, if some stiffness is negative. Stiffnesses of translations and rotations are
/// compared as shares of the greatest of their kind.
#[inline(never)]
pub(crate) fn unstable_motion(
    machine: &Coefficients<f64>,
    q: &[f64; COORDINATES],
) -> Option<(&'static str, f64, &'static str)> {
    let machine = machine.constant();
    let q = q.map(N);
    let stiffness = RIGID_MOTIONS.map(|(_, moved, _)| {
        let pushed_back = |along: usize| {
            let forces = static_forces(&machine, &seeded(&q, along, 1.0));
            moved.iter().map(|&i| -forces[i].0.slope).sum::<f64>()
        };
        moved.into_iter().map(pushed_back).sum::<f64>()
    });
    let greatest = |kind: &[f64]| kind.iter().fold(0.0_f64, |most, k| most.max(k.abs()));
    let scales = [greatest(&stiffness[..2]), greatest(&stiffness[2..])];
    let shares = (0..RIGID_MOTIONS.len()).map(|k| (k, stiffness[k] / scales[k / 2]));
    let (least, _) =
        shares.filter(|(_, share)| *share < 0.0).min_by(|(_, a), (_, b)| a.total_cmp(b))?;
    let (motion, _, unit) = RIGID_MOTIONS[least];
    Some((motion, stiffness[least], unit))
}

/// Generalised forces at rest.
#[inline(always)]
fn static_forces<T: Lane>(
    machine: &Coefficients<T>,
    q: &[N<T>; COORDINATES],
) -> [N<T>; COORDINATES] {
    let zero = q[0].lit(0.0);
    let spin = SpinState::new((zero, zero.lit(1.0)), zero, zero);
    let Halves { tub, rotor } = halves(machine, &spin, q, &[zero; COORDINATES]);
    let ([f1, f2], [f5, f6]) = tub.floating.generalised_forces();
    let ([f3, f4], [f7, f8, f9, f10]) = rotor.floating.generalised_forces();
    [f1, f2, f3, f4, f5, f6, f7, f8, f9, f10]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::{BumpStop, Machine};

    #[test]
    fn springs_that_hang_straight_hold_a_machine_once_it_has_sagged() {
        let mut machine = Machine::paper();
        for spring in &mut machine.springs {
            spring.cabinet_m[2] = spring.tub_m[2];
        }
        let coefficients = Coefficients::new(&machine);
        let (q, found) = find(N(0.0), &coefficients);
        assert_eq!(found & 1, 1);
        let weight_n = (23.87 + 4.34 + 4.04) * 9.81;
        let sag_m = -(q[0].0 + 0.2068 * q[5].0);
        assert!((sag_m - weight_n / 32_000.0).abs() < 1e-5, "{sag_m} m in the springs' mid-plane");
        for force in static_forces(&coefficients.constant(), &seeded(&q, 0, 0.0)) {
            assert!(force.0.value.abs() < 1e-5, "{} N or N m left", force.0.value);
        }
    }

    #[test]
    fn a_machine_rests_on_a_stop_however_stiff() {
        for stiffness_n_per_m in [4e4, 1e7, 1e9] {
            let mut machine = Machine::paper();
            // A little below, in front: it sags by 14 mm without.
            machine.stops = vec![BumpStop {
                tub_m: [0.3, -0.2, 0.0],
                direction: [0.0, -1.0, 0.0],
                clearance_m: 0.005,
                stiffness_n_per_m,
                // Its force before it closes, k s^2 / (4 |depth|), is to be none.
                softness_m: 1e-6,
                ..BumpStop::default()
            }];
            let (q, found) = find(N(0.0), &Coefficients::new(&machine));
            assert_eq!(found & 1, 1, "{stiffness_n_per_m:e}");
            let lower_m = -(q[0].0 + 0.3 * q[5].0.sin() - 0.2 * (q[5].0.cos() - 1.0));
            let into_m = lower_m - 0.005;
            // It carries about the weight, 320 N; the springs' moment may add to that.
            assert!(into_m > -1e-4 && into_m * stiffness_n_per_m < 400.0, "{lower_m}");
        }
    }

    #[test]
    fn a_machine_that_falls_names_the_motion() {
        let mut machine = Machine::paper();
        // Upright below the tub, loaded by its weight.
        for spring in &mut machine.springs {
            spring.cabinet_m[1] = -0.3;
            spring.tub_m[1] = -0.1626;
            spring.cabinet_m[2] = spring.tub_m[2];
        }
        let coefficients = Coefficients::new(&machine);
        let (q, found) = find(N(0.0), &coefficients);
        assert_eq!(found & 1, 0);
        let (motion, stiffness, _) = unstable_motion(&coefficients, &q.map(|q| q.0)).unwrap();
        // About O, which the springs stand before: yaw moves them sideways.
        assert_eq!(motion, "round the vertical (yaw)");
        assert!(stiffness < 0.0, "{stiffness}");
    }

    #[test]
    fn springs_that_cannot_carry_the_machine_hold_nothing() {
        let mut machine = Machine::paper();
        for spring in &mut machine.springs {
            spring.stiffness_n_per_m = 1.0;
        }
        assert_eq!(find(N(0.0), &Coefficients::new(&machine)).1 & 1, 0);
    }
}

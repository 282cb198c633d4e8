//! Finds the static equilibrium under the machine's weight, unbalance up (section 4.2 of the model
//! page).
//!
//! 1. Linearise the static forces by automatic differentiation.
//! 2. Solve for the Newton step, with a shift added to the stiffness where it is not positive
//!    definite.
//! 3. Shorten the step to a bound, and in later iterations damp it.
//! 4. Stop when an unshifted step is below the tolerance, or when the shift exceeds its limit.

use crate::coordinates::{
    COORDINATES, SHAFT_PITCH, SHAFT_Y, SHAFT_YAW, SHAFT_Z, TUB_PITCH, TUB_Y, TUB_YAW, TUB_Z,
    with_derivative,
};
use crate::lanes::ToDual as _;
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::MachineCoefficients;
use crate::nonlinear::floating::LdltFactors;
use crate::nonlinear::{Halves, assemble_coupled_halves};
use lane_ode::{Lane, N, OutOfLine};

/// The greatest number of Newton steps. Basis: twice the number of undamped steps. Doubling it
/// costs time for machines without an equilibrium.
const MAX_ITERATIONS: usize = 120;
/// The iteration from which steps are damped. Basis: half of all iterations.
/// Doubling it delays the equilibria of machines whose stops open and close in turn, between which
/// undamped steps cycle.
const FIRST_DAMPED_ITERATION: usize = 60;
/// The factor of a damped step. Basis: below 1, so that a cycle of two iterations contracts.
/// Doubling it would lengthen the steps instead.
const DAMPING_FACTOR: f64 = 0.6;
/// The greatest step in any coordinate (m, rad). Basis: short against the machine, so that a soft
/// machine does not turn over between two iterations. Doubling it halves the number of steps of
/// machines that sag far.
const MAX_NEWTON_STEP: f64 = 0.1;
/// The tolerance of the last step (m, rad). Basis: Newton's method squares the error, so that only
/// rounding remains. Doubling it changes nothing.
const NEWTON_STEP_TOLERANCE: f64 = 1e-12;
/// The least shift that is added to a stiffness matrix that is not positive definite (N/m, N
/// m/rad); the shift is raised tenfold until the sum is positive definite. Vertical springs, for
/// example, have no stiffness sideways before they carry load. Basis: small against any
/// suspension's stiffness. Doubling it changes the path, not the equilibrium.
const MIN_STIFFNESS_SHIFT: f64 = 10.0;
/// The greatest shift (N/m, N m/rad). Basis: far above any suspension's stiffness, so that a
/// machine that needs a greater one has no equilibrium. Doubling it costs a fraction of an
/// iteration.
const MAX_STIFFNESS_SHIFT: f64 = 1e9;

/// The solution of [`solve_equilibrium`], which is not inlined into kernels.
pub(crate) struct EquilibriumSolution<'a, T> {
    pub(crate) zero: N<T>,
    pub(crate) machine: &'a MachineCoefficients<T>,
}

impl<T: Lane> OutOfLine for EquilibriumSolution<'_, T> {
    type Output = ([N<T>; COORDINATES], u32);

    #[inline(always)]
    fn run(self) -> Self::Output {
        solve_equilibrium(self.zero, self.machine)
    }
}

/// Returns the equilibrium coordinates, and a mask of the lanes in which an equilibrium was found.
/// The stiffness matrix at an equilibrium is positive definite.
#[inline(always)]
pub(crate) fn solve_equilibrium<T: Lane>(
    zero: N<T>,
    machine: &MachineCoefficients<T>,
) -> ([N<T>; COORDINATES], u32) {
    let one = zero.lit(1.0);
    let machine = machine.constant();
    let mut q = [zero; COORDINATES];
    let mut solved_lanes = 0_u32;
    let mut unsolvable_lanes = 0_u32;
    let mut stiffness_shift = zero;
    for iteration in 0..MAX_ITERATIONS {
        let mut stiffness = [[zero; COORDINATES]; COORDINATES];
        let mut force = [zero; COORDINATES];
        for j in 0..COORDINATES {
            let forces = static_forces(&machine, &with_derivative(&q, j, 1.0));
            for i in 0..COORDINATES {
                stiffness[i][j] = N(forces[i].0.slope.neg());
                force[i] = N(forces[i].0.value);
            }
            stiffness[j][j] += stiffness_shift;
        }
        let factors = LdltFactors::new(stiffness);
        let stable_lanes = factors.positive_definite_lanes();
        let newton_step = factors.solve(force);
        let mut largest_step = zero;
        for component in &newton_step {
            largest_step = N(component.0.abs().larger(largest_step.0));
        }
        let step_factor = largest_step.where_less(
            zero.lit(MAX_NEWTON_STEP),
            one,
            zero.lit(MAX_NEWTON_STEP) / largest_step,
        );
        let step_factor = if iteration < FIRST_DAMPED_ITERATION {
            step_factor
        } else {
            (step_factor * DAMPING_FACTOR).v()
        };
        let unfinished_lanes = !(solved_lanes | unsolvable_lanes);
        for lane in (0..T::LANES).filter(|lane| unfinished_lanes >> lane & 1 == 1) {
            let current_shift = stiffness_shift.0.get(lane);
            let largest_step = largest_step.0.get(lane);
            if stable_lanes >> lane & 1 == 0 || !largest_step.is_finite() {
                unsolvable_lanes |= u32::from(current_shift > MAX_STIFFNESS_SHIFT) << lane;
                stiffness_shift.0.set(lane, (10.0 * current_shift).max(MIN_STIFFNESS_SHIFT));
                continue;
            }
            for i in 0..COORDINATES {
                q[i].0.set(
                    lane,
                    q[i].0.get(lane) + step_factor.0.get(lane) * newton_step[i].0.get(lane),
                );
            }
            solved_lanes |=
                u32::from(current_shift == 0.0 && largest_step < NEWTON_STEP_TOLERANCE) << lane;
            stiffness_shift.0.set(
                lane,
                if current_shift > MIN_STIFFNESS_SHIFT { 0.1 * current_shift } else { 0.0 },
            );
        }
        if (solved_lanes | unsolvable_lanes) & ((1 << T::LANES) - 1) == (1 << T::LANES) - 1 {
            break;
        }
    }
    (q, solved_lanes)
}

/// The rigid motions of tub and drum together: name, coordinates, and unit of the stiffness.
const RIGID_MOTIONS: [(&str, [usize; 2], &str); 4] = [
    ("up or down", [TUB_Y, SHAFT_Y], "N/m"),
    ("sideways", [TUB_Z, SHAFT_Z], "N/m"),
    ("round the vertical (yaw)", [TUB_YAW, SHAFT_YAW], "N m/rad"),
    ("over its front or back (pitch)", [TUB_PITCH, SHAFT_PITCH], "N m/rad"),
];

/// Returns the least stable motion of tub and drum together at coordinates `q`, with its stiffness
/// and unit, if any stiffness is negative. Stiffnesses of translations are compared relative to the
/// greatest stiffness of a translation, those of rotations relative to the greatest stiffness of a
/// rotation.
#[inline(never)]
pub(crate) fn unstable_motion(
    machine: &MachineCoefficients<f64>,
    q: &[f64; COORDINATES],
) -> Option<(&'static str, f64, &'static str)> {
    let machine = machine.constant();
    let q = q.map(N);
    let rigid_stiffnesses = RIGID_MOTIONS.map(|(_, coordinates, _)| {
        let stiffness_by = |column: usize| {
            let forces = static_forces(&machine, &with_derivative(&q, column, 1.0));
            coordinates.iter().map(|&i| -forces[i].0.slope).sum::<f64>()
        };
        coordinates.into_iter().map(stiffness_by).sum::<f64>()
    });
    let greatest_stiffness = |stiffnesses: &[f64]| {
        stiffnesses.iter().fold(0.0_f64, |greatest_stiffness, k| greatest_stiffness.max(k.abs()))
    };
    let greatest_stiffnesses =
        [greatest_stiffness(&rigid_stiffnesses[..2]), greatest_stiffness(&rigid_stiffnesses[2..])];
    let relative_stiffnesses =
        (0..RIGID_MOTIONS.len()).map(|k| (k, rigid_stiffnesses[k] / greatest_stiffnesses[k / 2]));
    let (least_stable_index, _) = relative_stiffnesses
        .filter(|(_, relative_stiffness)| *relative_stiffness < 0.0)
        .min_by(|(_, a), (_, b)| a.total_cmp(b))?;
    let (motion, _, unit) = RIGID_MOTIONS[least_stable_index];
    Some((motion, rigid_stiffnesses[least_stable_index], unit))
}

/// Computes the generalised forces at rest.
#[inline(always)]
fn static_forces<T: Lane>(
    machine: &MachineCoefficients<T>,
    q: &[N<T>; COORDINATES],
) -> [N<T>; COORDINATES] {
    let zero = q[0].lit(0.0);
    let spin = SpinState::new((zero, zero.lit(1.0)), zero, zero);
    let Halves { tub, rotor } = assemble_coupled_halves(machine, &spin, q, &[zero; COORDINATES]);
    let ([f1, f2], [f5, f6]) = tub.chain.generalised_forces();
    let ([f3, f4], [f7, f8, f9, f10]) = rotor.chain.generalised_forces();
    [f1, f2, f3, f4, f5, f6, f7, f8, f9, f10]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::{BumpStop, Machine};

    #[test]
    fn vertical_springs_have_an_equilibrium() {
        let mut machine = Machine::paper();
        for spring in &mut machine.springs {
            spring.cabinet_m[2] = spring.tub_m[2];
        }
        let coefficients = MachineCoefficients::new(&machine);
        let (q, solved_lanes) = solve_equilibrium(N(0.0), &coefficients);
        assert_eq!(solved_lanes & 1, 1);
        let weight_n = (23.87 + 4.34 + 4.04) * 9.81;
        let sag_m = -(q[0].0 + 0.2068 * q[5].0);
        assert!((sag_m - weight_n / 32_000.0).abs() < 1e-5, "{sag_m} m in the springs' mid-plane");
        for force in static_forces(&coefficients.constant(), &with_derivative(&q, 0, 0.0)) {
            assert!(force.0.value.abs() < 1e-5, "{} N or N m left", force.0.value);
        }
    }

    #[test]
    fn a_machine_rests_on_a_stop_of_any_stiffness() {
        for stiffness_n_per_m in [4e4, 1e7, 1e9] {
            let mut machine = Machine::paper();
            // The stop is 5 mm below the tub's front, which sags by 14 mm without it.
            machine.stops = vec![BumpStop {
                tub_m: [0.3, -0.2, 0.0],
                direction: [0.0, -1.0, 0.0],
                clearance_m: 0.005,
                stiffness_n_per_m,
                // Makes the force before contact, k s^2 / (4 |depth|), negligible.
                softness_m: 1e-6,
                ..BumpStop::default()
            }];
            let (q, solved_lanes) = solve_equilibrium(N(0.0), &MachineCoefficients::new(&machine));
            assert_eq!(solved_lanes & 1, 1, "{stiffness_n_per_m:e}");
            let lowering_m = -(q[0].0 + 0.3 * q[5].0.sin() - 0.2 * (q[5].0.cos() - 1.0));
            let depth_m = lowering_m - 0.005;
            // The stop carries about the weight, 320 N, and a part of the springs' moment.
            assert!(depth_m > -1e-4 && depth_m * stiffness_n_per_m < 400.0, "{lowering_m}");
        }
    }

    #[test]
    fn an_unstable_machine_names_its_unstable_motion() {
        let mut machine = Machine::paper();
        // The springs stand below the tub, under its weight.
        for spring in &mut machine.springs {
            spring.cabinet_m[1] = -0.3;
            spring.tub_m[1] = -0.1626;
            spring.cabinet_m[2] = spring.tub_m[2];
        }
        let coefficients = MachineCoefficients::new(&machine);
        let (q, solved_lanes) = solve_equilibrium(N(0.0), &coefficients);
        assert_eq!(solved_lanes & 1, 0);
        let (motion, stiffness, _) = unstable_motion(&coefficients, &q.map(|q| q.0)).unwrap();
        // The springs are in front of O, so that yaw moves them sideways.
        assert_eq!(motion, "round the vertical (yaw)");
        assert!(stiffness < 0.0, "{stiffness}");
    }

    #[test]
    fn springs_too_soft_for_the_weight_have_no_equilibrium() {
        let mut machine = Machine::paper();
        for spring in &mut machine.springs {
            spring.stiffness_n_per_m = 1.0;
        }
        assert_eq!(solve_equilibrium(N(0.0), &MachineCoefficients::new(&machine)).1 & 1, 0);
    }
}

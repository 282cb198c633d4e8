//! Error control: the refinement levels of a trajectory, and the error of a level.
//!
//! A row is integrated at finer and finer levels h_0 > h_1 > ... Let d_k be the greatest relative
//! difference of the row's numbers between level k and level k - 1. The error of level k is
//!
//! ```text
//! e_k = s max(d_k, d_(k-1) / c)
//! ```
//!
//! The trajectory is done at the first level where e_k is at most the accuracy. The rule is
//! Richardson's (Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, II.4) without
//! its extrapolation: the difference of two levels bounds the error of the finer one where the
//! error decreases by enough. The safety factor s is 6 where the step is shorter
//! ([`STEP_SAFETY_FACTOR`]), and 2 where the tolerance is smaller ([`SAFETY_FACTOR`]). The second
//! term is for two levels that agree by chance: c is the contraction of the error from level to
//! level: 1.5 for the next step ([`CONTRACTION`]), 10 for the next tolerance
//! ([`TOLERANCE_RATIO`]), and 100 where another method begins, which is about as accurate as two
//! further tolerances of the method before. Steps of a formula of order p are in the ratio
//! 1.5^(1/p).
//!
//! 1. With smooth forces, levels 0 to 5 cap the bearings' modes ([`StepSelector`]). The hinge's
//!    mode is not capped, and limits the first step.
//! 2. Two more levels have no capped modes. They are of order 4, which is stable at long steps at
//!    the least cost.
//! 3. With friction and stops, no modes are capped, and steps are adaptive, because they are short
//!    at corners of forces only. The first two levels are the additive method's, whose steps may be
//!    long against the bearings' periods, then come three of order 8, each with a tolerance of a
//!    tenth of that of the level before.
//! 4. The last two levels resolve the bearings' modes. They are for rows in which bearings that
//!    ring after a jump of the drum's acceleration matter.
//!
//! Numbers of two levels can agree by chance, for instance the least gaps of two chaotic motions.
//! Levels whose motions separate by a tenth ([`Separation::is_complete`]) follow different motions,
//! and their separation is their difference.
//!
//! Two levels that leave the same ringing unresolved share its error, so that their difference does
//! not show it. This error is bounded by the static deflection under the jump
//! ([`Point::ringing`](washer_model::Point::ringing)), times the amplification of a motion whose
//! first difference is beyond the accuracy. A row goes to the first level whose unresolved ringing
//! is within the accuracy.
//!
//! Fifteen constants decide `error`, `converged` and `sensitive`. Seven are in this file (of
//! [`RESOLVING_RAD`], both numbers count); [`CONTRACTION`] follows from them, and orders are facts
//! of caps and formulas. The number of levels of a method is in `levels.rs`, and the three of chaos
//! are in `separation.rs`. Four are limits of the model: the steps relative to the limit of
//! stability (`STABILITY_SHARE`, `CAP_LIMIT_SHARE` and `MIN_HINGE_SPEED_RATIO` beside
//! [`StepSelector`]), and the swing of a body under a jump of its load (`SWING_FACTOR`). Each
//! metric has a scale besides.

use std::iter::repeat_n;

use lane_ode::Tolerance;
use washer_model::{Formula, Method, MethodKind, ModelKind, StepSelector, capped_method};

use crate::levels::{FamilyStart, LEVELS_PER_METHOD, RefinementLevels};
use crate::separation::Separation;

/// Safety factor: the estimated error of a level, divided by its difference from the level before.
///
/// Basis: at corners errors are not proportional to the tolerance. 2 is enough where they decrease
/// by [`CONTRACTION`]. With 3, `sweeps/friction.toml` takes a tenth more time. Doubling it doubles
/// the `error` of machines with friction and stops, and of chaotic rows.
const SAFETY_FACTOR: f64 = 2.0;

/// Safety factor of levels with a shorter step.
///
/// Basis: near the hinge's frequency a cap changes the hinge's modes, and steps of uncapped levels
/// may not resolve soft bearings. Errors then decrease by less than [`CONTRACTION`] from one step
/// to the next; 6 is enough where they decrease by 7/6. With 2, three of 10,000 smooth rows of
/// `differential_test` have errors beyond their accuracy; with 10, as many as with 6, and
/// `sweeps/fig12.toml` takes 3 % more time.
const STEP_SAFETY_FACTOR: f64 = 6.0;

/// The contraction of the error from one step to the next, where it decreases by the method's
/// order: 1.5.
///
/// Derived: of two levels with errors E and E / c the difference is (1 - 1 / c) E, and
/// [`SAFETY_FACTOR`] s times that is at least E / c where c is at least 1 + 1 / s.
const CONTRACTION: f64 = 1.0 + 1.0 / SAFETY_FACTOR;

/// The order with which errors decrease with the step for capped modes: the error of a cap is
/// proportional to its inverse square, and the cap to the inverse step.
const CAPPED_ORDER: u32 = 2;

/// The ratio of the relative tolerance at a level to that at the level before. The first tolerance
/// of a method is the accuracy times this ratio.
///
/// Basis: `sweeps/friction.toml`, where the error of a trajectory is about ten times its tolerance
/// per step and proportional to it. Doubling it saves a third of the first level's time and sends
/// more rows to the next level.
const TOLERANCE_RATIO: f64 = 0.1;

/// The absolute tolerance (m, rad, m/s, rad/s) of adaptive methods, divided by the relative one.
///
/// Basis: for a motion of 2 cm both are equal. Doubling it lengthens the steps of smaller motions.
const ABSOLUTE_TO_RELATIVE: f64 = 2e-2;

/// The number of levels of order 8 at corners.
///
/// Basis: in `sweeps/friction.toml` two levels leave 9 rows of 120 not converged, three leave 6 at
/// a tenth more time. Doubling it takes longer in the rows that do not converge.
const CORNER_LEVELS: usize = 3;

/// The product of the first step that resolves the bearings' modes and their frequency (rad), for
/// the formula of each model: of order 8 for the nonlinear one, of order 4 for the linear one.
///
/// Basis: a step of order 4 damps by z^6 / 144 where z is this product, so that at 0.2 ringing at
/// 10^4 rad/s loses a fifth of its amplitude in 10 s. Order 8 has an error of 5e-5 per radian at
/// 1.4. With 0.7 for order 4, rows of `differential_test -- 180 965457 jumps` have errors up to
/// 3.5e-4. Doubling it damps the ringing away.
const RESOLVING_RAD: [f64; 2] = [1.4, 0.2];

/// The greatest number of steps of an adaptive trajectory.
///
/// Basis: this number of steps takes hours, so that a trajectory that reaches it makes no progress.
/// Doubling it doubles the time until such a row fails.
pub const MAX_ADAPTIVE_STEPS: u64 = 100_000_000;

/// The step (s) for a machine whose modes are unknown, whose rows fail. It decides nothing.
const UNKNOWN_STEP_S: f64 = 1e-3;

/// Returns the ratio of one level's step to the next one's, for errors that decrease with this
/// order, a power of two: the root of [`CONTRACTION`] of this order.
fn step_ratio(order: u32) -> f64 {
    // Square roots, because the bits of `powf` may depend on the platform.
    (0..order.ilog2()).fold(CONTRACTION, |ratio, _| ratio.sqrt())
}

/// Returns the contraction of the error from a level to the next.
///
/// `kind` is that of the next level's method, and `start` that of the first level. The difference
/// of a level that starts to resolve modes is their ringing, and says nothing of its own error: the
/// contraction is infinite.
pub(crate) fn contraction(kind: MethodKind, start: FamilyStart) -> f64 {
    match (start, kind) {
        (FamilyStart::Modes, _) => f64::INFINITY,
        (FamilyStart::Method, _) => 1.0 / (TOLERANCE_RATIO * TOLERANCE_RATIO),
        (FamilyStart::None, kind) if kind.adapts_steps() => 1.0 / TOLERANCE_RATIO,
        (FamilyStart::None, _) => CONTRACTION,
    }
}

/// Returns the relative difference of two levels from that of their numbers and the separation of
/// their motions.
pub(crate) fn difference_of_levels(numbers: f64, separation: Separation) -> f64 {
    if separation.is_complete() { numbers.max(separation.greatest_distance) } else { numbers }
}

/// Returns the error of a level, whose method is of this kind, from its difference from the level
/// before, and that level's own difference divided by its contraction. `None` if the error is not a
/// finite number.
pub(crate) fn error_of_level(
    kind: MethodKind,
    difference: f64,
    contracted_difference: f64,
) -> Option<f64> {
    let safety_factor = if kind.adapts_steps() { SAFETY_FACTOR } else { STEP_SAFETY_FACTOR };
    finite_error(safety_factor, difference.max(contracted_difference))
}

/// Returns the error of a chaotic trajectory from the differences of its finest level from the
/// level before and from the perturbed run. `None` if the error is not a finite number.
pub(crate) fn error_of_chaos(difference: f64, perturbed_difference: f64) -> Option<f64> {
    finite_error(SAFETY_FACTOR, difference.max(perturbed_difference))
}

/// Returns the error that belongs to a difference; `None` if it is not a finite number.
fn finite_error(safety_factor: f64, difference: f64) -> Option<f64> {
    let error = safety_factor * difference;
    error.is_finite().then_some(error)
}

/// Returns the amplification of unresolved ringing, from the difference of the first two levels.
/// The levels are chosen so that a motion without amplification has a difference below the
/// accuracy. If the difference is greater, the amplification is at least the quotient of difference
/// and accuracy.
pub(crate) fn amplification(first_difference: f64, accuracy: f64) -> f64 {
    (first_difference / accuracy).max(1.0)
}

/// Returns the refinement levels of a model for these machines.
pub fn refinement_levels(
    steps: &StepSelector<'_>,
    model: ModelKind,
    accuracy: f64,
) -> RefinementLevels {
    if model == ModelKind::Nonlinear && steps.has_nonsmooth_force() {
        return levels_at_corners(steps, accuracy);
    }
    let mut levels = Vec::new();
    // The rows of a machine whose modes are unknown report that themselves, at any step.
    let first_s = steps.plain_step_s(Formula::Rk4).unwrap_or(UNKNOWN_STEP_S);
    let ratio = step_ratio(CAPPED_ORDER);
    if let Ok(Some(longest_s)) = steps.capped_step_s(model) {
        let mut step_s = longest_s;
        for kind in MethodKind::CAPPED {
            if step_s < ratio * first_s {
                break;
            }
            levels.push(capped_method(model, kind, step_s));
            step_s /= ratio;
        }
    }
    push_uncapped_levels(&mut levels, Formula::Rk4, first_s);
    push_resolving_levels(&mut levels, steps, model);
    RefinementLevels::checked(levels, None)
}

/// Returns the levels of the nonlinear model for a machine with friction or stops, whose forces
/// have corners.
fn levels_at_corners(steps: &StepSelector<'_>, accuracy: f64) -> RefinementLevels {
    let longest_s = steps.plain_step_s(Formula::Dop853).unwrap_or(UNKNOWN_STEP_S);
    let tolerance = |level: usize| {
        // A product, because the bits of `powi` may depend on the platform.
        let ratio: f64 = repeat_n(TOLERANCE_RATIO, level + 1).product();
        let relative = accuracy * ratio;
        Tolerance {
            relative,
            absolute: ABSOLUTE_TO_RELATIVE * relative,
            max_steps: MAX_ADAPTIVE_STEPS,
            longest_step_s: None,
        }
    };
    let mut levels = Vec::new();
    for level in 0..LEVELS_PER_METHOD {
        levels.push(Method::additive(tolerance(level)));
    }
    for level in 0..CORNER_LEVELS {
        let longest_step_s = Some(longest_s);
        levels.push(Method::dop853_adaptive(Tolerance { longest_step_s, ..tolerance(level) }));
    }
    push_resolving_levels(&mut levels, steps, ModelKind::Nonlinear);
    RefinementLevels::checked(levels, Some(UNCAPPED_REASON.to_owned()))
}

/// Adds the levels whose steps resolve the bearings' modes.
fn push_resolving_levels(levels: &mut Vec<Method>, steps: &StepSelector<'_>, model: ModelKind) {
    let formula = Formula::for_model(model);
    let resolving_rad = match formula {
        Formula::Dop853 => RESOLVING_RAD[0],
        Formula::Rk4 => RESOLVING_RAD[1],
    };
    let step_s = match steps.plain_step_s(formula) {
        Some(stable_s) => stable_s * resolving_rad / formula.limit(),
        None => UNKNOWN_STEP_S,
    };
    push_uncapped_levels(levels, formula, step_s);
}

/// Adds levels of a formula without capped modes, the first with a step of `first_s`.
fn push_uncapped_levels(levels: &mut Vec<Method>, formula: Formula, first_s: f64) {
    let mut step_s = first_s;
    for _ in 0..LEVELS_PER_METHOD {
        levels.push(match formula {
            Formula::Rk4 => Method::rk4(step_s),
            Formula::Dop853 => Method::dop853(step_s),
        });
        step_s /= step_ratio(formula.order());
    }
}

/// The reason why a machine with friction or stops has no levels with capped modes.
const UNCAPPED_REASON: &str =
    "no modes are capped, because friction and stops give forces corners, which shake the hinge";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_is_a_multiple_of_the_difference_or_more_if_the_difference_before_was_great() {
        let additive =
            |difference, before| error_of_level(MethodKind::Additive, difference, before);
        assert_eq!(additive(1e-4, 0.0), Some(2e-4));
        assert_eq!(additive(1e-4, 2e-4), Some(4e-4));
        let rk4 = |difference, before| error_of_level(MethodKind::Rk4, difference, before);
        assert_eq!(rk4(0.25, 0.0), Some(1.5));
        assert_eq!(rk4(0.25, 0.5), Some(3.0));
        for error in [additive, rk4] {
            assert_eq!(error(f64::INFINITY, 0.0), None);
            assert_eq!(error(1e-4, f64::INFINITY), None);
        }
    }

    /// Two chaotic motions may have the same least gap.
    #[test]
    fn numbers_of_different_motions_do_not_count_as_equal() {
        let separation = |distance| Separation::new(&[(0.0, 1e-9), (20.0, distance)]);
        assert_eq!(difference_of_levels(1e-4, separation(0.05)), 1e-4);
        assert_eq!(difference_of_levels(1e-4, separation(0.3)), 0.3);
        assert_eq!(difference_of_levels(0.5, separation(0.3)), 0.5);
    }

    #[test]
    fn a_new_family_contracts_the_error_more_than_a_shorter_step() {
        assert_eq!(contraction(MethodKind::Dop853, FamilyStart::None), 1.5);
        assert_eq!(contraction(MethodKind::Dop853Adaptive, FamilyStart::None), 10.0);
        assert!((contraction(MethodKind::Dop853Adaptive, FamilyStart::Method) - 100.0) < 1e-9);
        assert_eq!(contraction(MethodKind::Dop853, FamilyStart::Modes), f64::INFINITY);
        assert_eq!(contraction(MethodKind::Additive, FamilyStart::None), 10.0);
    }

    /// Levels whose errors decrease by a sixth or more have errors of at most the estimate.
    #[test]
    fn the_error_is_an_upper_bound_if_errors_decrease_by_a_sixth() {
        for contraction_of_error in [7.0 / 6.0, 1.3, CONTRACTION, 5.0, 100.0] {
            let difference = contraction_of_error - 1.0;
            let error = error_of_level(MethodKind::Capped1, difference, 0.0);
            assert!(error.unwrap() >= 0.999_999);
        }
    }

    /// Levels whose errors decrease at least as those of caps do have errors of at most the
    /// estimate, even with the safety factor of tolerances.
    #[test]
    fn the_estimate_bounds_errors_of_the_order_of_caps() {
        for steeper in [0.0, 0.5, 1.0, 4.0, 8.0] {
            let order = f64::from(CAPPED_ORDER) + steeper;
            let error = |level: i32| step_ratio(CAPPED_ORDER).powf(-f64::from(level) * order);
            let [first, second] = [1, 2].map(|level| error(level - 1) - error(level));
            let contracted = first / contraction(MethodKind::Capped1, FamilyStart::None);
            for kind in [MethodKind::Capped1, MethodKind::Additive] {
                let [first_error, second_error] =
                    [(first, 0.0), (second, contracted)].map(|(a, b)| error_of_level(kind, a, b));
                assert!(first_error.unwrap() >= 0.999_999 * error(1));
                assert!(second_error.unwrap() >= 0.999_999 * error(2));
            }
        }
    }

    #[test]
    fn errors_of_the_order_of_a_formula_decrease_by_the_same_factor_for_each() {
        for order in [CAPPED_ORDER, Formula::Rk4.order(), Formula::Dop853.order()] {
            let contraction: f64 = repeat_n(step_ratio(order), order as usize).product();
            assert!((contraction - CONTRACTION).abs() < 1e-12, "order {order}");
        }
    }
}

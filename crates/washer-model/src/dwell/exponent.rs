//! Largest Lyapunov exponents, by perturbed runs whose separation is rescaled after every turn
//! (Benettin's method).

use super::starts::largest_deviation;
use super::turns::{HeldState, integrate_turns};
use crate::coordinates::{COORDINATES, STATES, TUB_COORDINATES};
use crate::stability::period_map::TurnSetup;
use core::f64::consts::TAU;
use lane_ode::Simd;

/// Separation of a perturbed run after rescaling, relative to the greatest coordinate. Basis: far
/// above rounding errors, and small enough to grow linearly within a turn. Doubling it changes
/// nothing.
const RESCALED_SEPARATION: f64 = 1e-7;

/// Turns before the measurement, in which the separation aligns with the fastest growing direction.
/// Doubling it lengthens each measurement by 16 turns.
const TRANSIENT_TURNS: usize = 16;

/// Number of parts whose scatter gives the standard error. Doubling it doubles the length of a
/// measurement.
const MEASUREMENT_PARTS: usize = 8;

/// Number of turns of a part. Doubling it doubles the length of a measurement and makes the parts
/// less dependent on each other.
const PART_TURNS: usize = 32;

/// The rate at which trajectories from neighbouring states separate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exponent {
    /// The largest Lyapunov exponent (1/s).
    pub rate_per_s: f64,
    /// The standard error (1/s), from the scatter of parts; 0 for exponents from multipliers.
    pub error_per_s: f64,
}

impl Exponent {
    /// Whether the exponent is above 0 by more than three standard errors.
    pub fn is_positive(&self) -> bool {
        self.rate_per_s > 3.0 * self.error_per_s
    }
}

/// Returns the distance of two states (m, rad): the maximum over the tub's coordinates of the
/// difference of the coordinate plus the difference of its speed divided by the drum's speed.
pub(super) fn state_distance(setup: &TurnSetup<'_>, a: &[f64; STATES], b: &[f64; STATES]) -> f64 {
    let speed_rad_per_s = setup.speed_rpm * TAU / 60.0;
    let coordinate_difference = |&i: &usize| {
        let j = COORDINATES + i;
        (a[i] - b[i]).abs() + (a[j] - b[j]).abs() / speed_rad_per_s
    };
    TUB_COORDINATES.iter().map(coordinate_difference).fold(0.0, f64::max)
}

/// Returns the largest Lyapunov exponents of trajectories from `requests`: initial states, each
/// with the direction of speeds of the initial perturbation; `None` if a run leaves the model's
/// range.
pub(super) fn compute_exponents(
    simd: Simd,
    requests: &[(HeldState<'_>, [f64; COORDINATES])],
) -> Vec<Option<Exponent>> {
    let initial_separations: Vec<f64> = requests
        .iter()
        .map(|(held_state, _)| {
            RESCALED_SEPARATION * largest_deviation(held_state.setup.point, &held_state.state)
        })
        .collect();
    // In the list, each run is followed by its perturbed run.
    let mut run_pairs = Vec::with_capacity(2 * requests.len());
    for ((held_state, direction), initial_separations) in requests.iter().zip(&initial_separations)
    {
        let speed_rad_per_s = held_state.setup.speed_rpm * TAU / 60.0;
        let mut perturbed_state = *held_state;
        for i in 0..COORDINATES {
            perturbed_state.state[COORDINATES + i] +=
                initial_separations * speed_rad_per_s * direction[i];
        }
        run_pairs.extend([*held_state, perturbed_state]);
    }
    let mut growth_in_parts = vec![[0.0_f64; MEASUREMENT_PARTS]; requests.len()];
    for turn in 0..TRANSIENT_TURNS + MEASUREMENT_PARTS * PART_TURNS {
        let turns = integrate_turns(simd, &run_pairs, 1);
        for (k, initial_separations) in initial_separations.iter().enumerate() {
            let (Some(reference_turn), Some(perturbed_turn)) =
                (turns[2 * k].first(), turns[2 * k + 1].first())
            else {
                growth_in_parts[k][0] = f64::NAN;
                continue;
            };
            let setup = run_pairs[2 * k].setup;
            let separation =
                state_distance(&setup, &reference_turn.end_state, &perturbed_turn.end_state);
            if let Some(measured_turn) = turn.checked_sub(TRANSIENT_TURNS) {
                growth_in_parts[k][measured_turn / PART_TURNS] +=
                    libm::log(separation / initial_separations);
            }
            run_pairs[2 * k].state = reference_turn.end_state;
            run_pairs[2 * k + 1].state = core::array::from_fn(|i| {
                reference_turn.end_state[i]
                    + (perturbed_turn.end_state[i] - reference_turn.end_state[i])
                        * (initial_separations / separation)
            });
        }
    }
    let exponents =
        growth_in_parts.iter().zip(requests).map(|(growth_in_parts, (held_state, _))| {
            let part_s = PART_TURNS as f64 * held_state.setup.turn_s();
            let mean_growth = growth_in_parts.iter().sum::<f64>() / MEASUREMENT_PARTS as f64;
            let sum_of_squares: f64 = growth_in_parts
                .iter()
                .map(|part| (part - mean_growth) * (part - mean_growth))
                .sum();
            let standard_error =
                (sum_of_squares / (MEASUREMENT_PARTS * (MEASUREMENT_PARTS - 1)) as f64).sqrt();
            let exponent =
                Exponent { rate_per_s: mean_growth / part_s, error_per_s: standard_error / part_s };
            (exponent.rate_per_s.is_finite() && exponent.error_per_s.is_finite())
                .then_some(exponent)
        });
    exponents.collect()
}

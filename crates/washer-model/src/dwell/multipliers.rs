//! Floquet multipliers of periodic orbits of several turns.

use super::turns::HeldState;
use crate::coordinates::STATES;
use crate::stability::monodromy::{StateMatrix, scale_speeds};
use crate::stability::period_map::{TurnRequest, compute_turns};
use crate::stability::responses::leading_multiplier;
use crate::stability::settings::HeldCase;
use lane_ode::{Cancel, N};

/// A periodic orbit: a state on the orbit, and the number of turns after which the state repeats.
pub(super) struct PeriodicOrbit<'c, 'a> {
    pub(super) held_case: &'c HeldCase<'a>,
    pub(super) held_state: HeldState<'a>,
    pub(super) period_turns: u32,
}

/// Returns the growth (1/s) of the fastest growing disturbance of each orbit, negative if all
/// decay: ln |mu| over the period, with mu the largest multiplier of the suspension's motions. The
/// monodromy matrix is the product of those of the turns. An orbit has `None` if its eigenvalues
/// are not finite, and all orbits have `None` once `cancel` is requested.
pub(super) fn compute_growths_per_s(
    orbits: &[PeriodicOrbit<'_, '_>],
    cancel: Cancel<'_>,
) -> Vec<Option<f64>> {
    let mut monodromy_matrices: Vec<Option<StateMatrix>> = vec![None; orbits.len()];
    let mut states: Vec<[f64; STATES]> =
        orbits.iter().map(|orbit| orbit.held_state.state).collect();
    let max_period_turns = orbits.iter().map(|orbit| orbit.period_turns).max().unwrap_or(0);
    for turn in 0..max_period_turns {
        let unfinished_orbits: Vec<usize> =
            (0..orbits.len()).filter(|&k| turn < orbits[k].period_turns).collect();
        let requests: Vec<TurnRequest<'_>> = unfinished_orbits
            .iter()
            .map(|&k| TurnRequest {
                setup: orbits[k].held_state.setup,
                start_state: states[k],
                is_recorded: true,
            })
            .collect();
        let results = compute_turns(&requests, cancel);
        if cancel.is_requested() {
            return vec![None; orbits.len()];
        }
        for (k, result) in unfinished_orbits.into_iter().zip(results) {
            states[k] = result.end_state;
            if let Some(record) = result.record {
                monodromy_matrices[k] = Some(match &monodromy_matrices[k] {
                    Some(previous) => multiply_matrices(&record.monodromy, previous),
                    None => record.monodromy,
                });
            }
        }
    }
    let orbit_growth = |(orbit, matrix): (&PeriodicOrbit<'_, '_>, Option<StateMatrix>)| {
        let setup = &orbit.held_state.setup;
        let matrix = scale_speeds(&matrix?, setup.unit_per_s());
        let (multiplier, _) = leading_multiplier(orbit.held_case, &matrix)?;
        let period_s = f64::from(orbit.period_turns) * setup.turn_s();
        Some(0.5 * libm::log(multiplier.norm_sqr()) / period_s)
    };
    orbits.iter().zip(monodromy_matrices).map(orbit_growth).collect()
}

fn multiply_matrices(left: &StateMatrix, right: &StateMatrix) -> StateMatrix {
    let mut product = [[N(0.0); STATES]; STATES];
    for i in 0..STATES {
        for k in 0..STATES {
            for j in 0..STATES {
                product[i][j] += left[i][k] * right[k][j];
            }
        }
    }
    product
}

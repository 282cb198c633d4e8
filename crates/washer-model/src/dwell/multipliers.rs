//! Floquet multipliers of periodic orbits of several turns.

use super::turns::HeldState;
use crate::coordinates::STATES;
use crate::stability::monodromy::{Square, per_unit};
use crate::stability::orbit::{Asked, turns};
use crate::stability::respond::leading_multiplier;
use crate::stability::settings::Case;
use lane_ode::{Cancel, N};

/// A periodic orbit: a state on it, and the turns after which it repeats.
pub(super) struct Orbit<'c, 'a> {
    pub(super) case: &'c Case<'a>,
    pub(super) held: HeldState<'a>,
    pub(super) period: u32,
}

/// Returns the growth (1/s) of the fastest growing disturbance of each orbit, negative if all
/// decay: ln |mu| over the period, with mu the largest multiplier of the suspension's motions. The
/// monodromy matrix is the product of those of the turns. It returns `None` for eigenvalues that
/// are not finite, and for all orbits once `is_stopped` returns true.
pub(super) fn growths_per_s(orbits: &[Orbit<'_, '_>], cancel: Cancel<'_>) -> Vec<Option<f64>> {
    let mut matrices: Vec<Option<Square>> = vec![None; orbits.len()];
    let mut states: Vec<[f64; STATES]> = orbits.iter().map(|orbit| orbit.held.state).collect();
    let longest = orbits.iter().map(|orbit| orbit.period).max().unwrap_or(0);
    for turn in 0..longest {
        let open: Vec<usize> = (0..orbits.len()).filter(|&k| turn < orbits[k].period).collect();
        let asked: Vec<Asked<'_>> = open
            .iter()
            .map(|&k| Asked { row: orbits[k].held.row, start: states[k], is_seen: true })
            .collect();
        let turned = turns(&asked, cancel);
        if cancel.is_requested() {
            return vec![None; orbits.len()];
        }
        for (k, turned) in open.into_iter().zip(turned) {
            states[k] = turned.end;
            if let Some(seen) = turned.seen {
                matrices[k] = Some(match &matrices[k] {
                    Some(before) => product(&seen.monodromy, before),
                    None => seen.monodromy,
                });
            }
        }
    }
    let growth = |(orbit, matrix): (&Orbit<'_, '_>, Option<Square>)| {
        let row = &orbit.held.row;
        let matrix = per_unit(&matrix?, row.unit_per_s());
        let (mu, _) = leading_multiplier(orbit.case, &matrix)?;
        let period_s = f64::from(orbit.period) * row.turn_s();
        Some(0.5 * libm::log(mu.norm_sqr()) / period_s)
    };
    orbits.iter().zip(matrices).map(growth).collect()
}

fn product(after: &Square, before: &Square) -> Square {
    let mut product = [[N(0.0); STATES]; STATES];
    for i in 0..STATES {
        for k in 0..STATES {
            for j in 0..STATES {
                product[i][j] += after[i][k] * before[k][j];
            }
        }
    }
    product
}

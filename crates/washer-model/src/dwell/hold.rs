//! Turns at constant speeds, one after the other: trajectories in lanes, what is seen of each turn.

use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::run::active_recorders::{ActiveRecorders, StepParts};
use crate::run::model::Nonlinear;
use crate::stability::orbit::{Row, Watched, by_kind, clock, model};
use crate::stability::turn::turn;
use crate::{ModelKind, Reading, Recorders};
use lane_ode::{Kernel, Lane, N, Simd, System as _};

/// A machine held at a speed.
#[derive(Clone, Copy)]
pub(super) struct Held<'a> {
    pub(super) row: Row<'a>,
    /// Where the unbalance is up: coordinates (m, rad), then their speeds (per s).
    pub(super) state: [f64; STATES],
}

/// What is seen of a turn.
#[derive(Clone, Debug)]
pub(super) struct Turn {
    /// The state at its end.
    pub(super) end: [f64; STATES],
    /// Largest deviations from equilibrium (m, rad).
    pub(super) peaks: [f64; CHANNELS],
    /// Least gap between drum and tub at the ends of its steps (m).
    pub(super) gap_m: f64,
}

/// So many turns of each; fewer where one leaves the model's range. They share lanes of `simd` at
/// most, and what is found of one does not depend on the others.
pub(super) fn hold(simd: Simd, held: &[Held<'_>], turns: usize) -> Vec<Vec<Turn>> {
    let found = recorded(simd, held, turns, Recorders::default());
    found.into_iter().map(|(turns, _)| turns).collect()
}

/// As [`hold`], with further records of these turns if any are wanted.
pub(super) fn recorded(
    simd: Simd,
    held: &[Held<'_>],
    turns: usize,
    wanted: Recorders,
) -> Vec<(Vec<Turn>, Reading)> {
    let find = |held: &[Held<'_>]| {
        let groups = held.chunks(simd.lanes());
        let group =
            |held: &[Held<'_>]| simd.narrowed(held.len()).dispatch(Hold { held, turns, wanted });
        groups.flat_map(group).collect()
    };
    by_kind(held, |held| (held.row.kind(), false), find)
}

/// Rows of one kind, no more than there are lanes.
struct Hold<'a> {
    held: &'a [Held<'a>],
    turns: usize,
    wanted: Recorders,
}

impl Kernel for Hold<'_> {
    type Output = Vec<(Vec<Turn>, Reading)>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let mut found = Vec::with_capacity(self.held.len());
        for held in self.held.chunks(T::LANES) {
            hold_lanes(N(zero), held, self.turns, self.wanted, &mut found);
        }
        found
    }
}

#[inline(always)]
fn hold_lanes<T: Lane>(
    zero: N<T>,
    held: &[Held<'_>],
    turns: usize,
    wanted: Recorders,
    found: &mut Vec<(Vec<Turn>, Reading)>,
) {
    let rows: Vec<Row<'_>> = held.iter().map(|held| held.row).collect();
    let clock = clock(zero, &rows);
    let model: Nonlinear<T> = model(zero, &rows);
    let mut states = [[zero; STATES]];
    for lane in 0..T::LANES {
        for i in 0..STATES {
            states[0][i].0.set(lane, held[lane.min(held.len() - 1)].state[i]);
        }
    }
    let first = found.len();
    found.extend(held.iter().map(|_| (Vec::with_capacity(turns), Reading::default())));
    let mut watched = Watched::new(zero, &model, &clock);
    watched.with_states = false;
    let of = (ModelKind::Nonlinear, StepParts::new(rows[0].caps.is_none()));
    watched.extras = ActiveRecorders::new(zero, wanted, of, rows[0].point, held.len());
    if let Some(extras) = &mut watched.extras {
        for lane in 0..T::LANES {
            extras.set_point(lane, rows[lane.min(rows.len() - 1)].point);
        }
    }
    for made in 0..turns {
        turn(&model, &clock, &mut states, Some(&mut watched));
        let in_range = T::bits(model.in_range(&states[0]));
        for (lane, held) in held.iter().enumerate() {
            let (of_lane, _) = &mut found[first + lane];
            if in_range >> lane & 1 == 1 && of_lane.len() == made {
                let radial_m = watched.radial_squared.0.get(lane).sqrt();
                of_lane.push(Turn {
                    end: core::array::from_fn(|i| states[0][i].0.get(lane)),
                    peaks: watched.peaks.lane(lane),
                    gap_m: held.row.point.clearance_m() - radial_m,
                });
            }
        }
        for lane in 0..T::LANES {
            watched.peaks.reset(lane);
        }
        watched.radial_squared = zero;
    }
    if let Some(mut extras) = watched.extras {
        for (lane, held) in held.iter().enumerate() {
            let (of_lane, extra) = &mut found[first + lane];
            extras.finish(lane, lane, held.row.point, of_lane.len() < turns);
            *extra = core::mem::take(&mut extras.readings[lane]);
        }
    }
}

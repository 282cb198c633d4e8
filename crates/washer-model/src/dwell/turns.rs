//! Integration of trajectories at held speeds, turn by turn in lanes, with a record of each turn.

use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::run::active_recorders::{ActiveRecorders, StepParts};
use crate::run::model::Nonlinear;
use crate::stability::orbit::{Row, Watched, by_kind, clock, model};
use crate::stability::turn::turn;
use crate::{ModelKind, Reading, Recorders};
use lane_ode::{Kernel, Lane, N, Simd, System as _};

/// The state of a machine at a held speed.
#[derive(Clone, Copy)]
pub(super) struct HeldState<'a> {
    pub(super) row: Row<'a>,
    /// The state at which the unbalance is up: coordinates (m, rad), then their speeds (per s).
    pub(super) state: [f64; STATES],
}

/// The record of a turn of the drum.
#[derive(Clone, Debug)]
pub(super) struct TurnRecord {
    /// The state at the end of the turn.
    pub(super) end: [f64; STATES],
    /// The largest deviations from equilibrium (m, rad).
    pub(super) peaks: [f64; CHANNELS],
    /// The least gap between drum and tub at the ends of steps (m).
    pub(super) gap_m: f64,
}

/// Integrates a number of turns from each state. A trajectory that leaves the model's range has
/// fewer. Trajectories share lanes of `simd` or of a narrower instruction set, and do not depend on
/// each other.
pub(super) fn integrate_turns(
    simd: Simd,
    held: &[HeldState<'_>],
    turns: usize,
) -> Vec<Vec<TurnRecord>> {
    let found = record_turns(simd, held, turns, Recorders::default());
    found.into_iter().map(|(turns, _)| turns).collect()
}

/// Integrates like [`integrate_turns`], with the recorders of `wanted` over all turns.
pub(super) fn record_turns(
    simd: Simd,
    held: &[HeldState<'_>],
    turns: usize,
    wanted: Recorders,
) -> Vec<(Vec<TurnRecord>, Reading)> {
    let find = |held: &[HeldState<'_>]| {
        let groups = held.chunks(simd.lanes());
        let group = |held: &[HeldState<'_>]| {
            simd.narrowed(held.len()).dispatch(TurnsKernel { held, turns, wanted })
        };
        groups.flat_map(group).collect()
    };
    by_kind(held, |held| (held.row.kind(), false), find)
}

/// The integration of turns from states whose rows are of one kind.
struct TurnsKernel<'a> {
    held: &'a [HeldState<'a>],
    turns: usize,
    wanted: Recorders,
}

impl Kernel for TurnsKernel<'_> {
    type Output = Vec<(Vec<TurnRecord>, Reading)>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let mut found = Vec::with_capacity(self.held.len());
        for held in self.held.chunks(T::LANES) {
            integrate_lanes(N(zero), held, self.turns, self.wanted, &mut found);
        }
        found
    }
}

#[inline(always)]
fn integrate_lanes<T: Lane>(
    zero: N<T>,
    held: &[HeldState<'_>],
    turns: usize,
    wanted: Recorders,
    found: &mut Vec<(Vec<TurnRecord>, Reading)>,
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
    let parts = StepParts::new(rows[0].caps.is_none());
    let run = (ModelKind::Nonlinear, parts);
    watched.extras = ActiveRecorders::new(zero, wanted, run, rows[0].point, held.len());
    if let Some(extras) = &mut watched.extras {
        for lane in 0..T::LANES {
            extras.set_point(lane, rows[lane.min(rows.len() - 1)].point);
        }
    }
    for finished in 0..turns {
        turn(&model, &clock, &mut states, Some(&mut watched));
        let in_range = T::bits(model.in_range(&states[0]));
        for (lane, held) in held.iter().enumerate() {
            let (records, _) = &mut found[first + lane];
            // A trajectory that has left the range has no further records.
            if in_range >> lane & 1 == 1 && records.len() == finished {
                let radial_m = watched.radial_squared.0.get(lane).sqrt();
                records.push(TurnRecord {
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
            let (records, extra) = &mut found[first + lane];
            extras.finish(lane, lane, held.row.point, records.len() < turns);
            *extra = core::mem::take(&mut extras.readings[lane]);
        }
    }
}

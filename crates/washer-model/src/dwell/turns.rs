//! Integration of trajectories at held speeds, turn by turn in lanes, with a record of each turn.

use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::run::active_recorders::{ActiveRecorders, Substeps};
use crate::run::model::NonlinearModel;
use crate::stability::period_map::{
    TurnRecorder, TurnSetup, lane_model, map_in_batches, step_grid,
};
use crate::stability::turn::integrate_turn;
use crate::{ModelKind, Reading, Recorders};
use lane_ode::{Kernel, Lane, N, Simd, System as _};

/// The state of a machine at a held speed.
#[derive(Clone, Copy)]
pub(super) struct HeldState<'a> {
    pub(super) setup: TurnSetup<'a>,
    /// The state at which the unbalance is up: coordinates (m, rad), then their speeds (per s).
    pub(super) state: [f64; STATES],
}

/// The record of a turn of the drum.
#[derive(Clone, Debug)]
pub(super) struct TurnRecord {
    /// The state at the end of the turn.
    pub(super) end_state: [f64; STATES],
    /// The largest deviations from equilibrium (m, rad).
    pub(super) peaks: [f64; CHANNELS],
    /// The least gap between drum and tub at the ends of steps (m).
    pub(super) min_gap_m: f64,
}

/// Integrates a number of turns from each state, and returns the records of each trajectory's
/// turns. A trajectory that leaves the model's range has fewer records. Trajectories share lanes of
/// `simd` or of a narrower instruction set, and do not depend on each other.
pub(super) fn integrate_turns(
    simd: Simd,
    held_states: &[HeldState<'_>],
    turns: usize,
) -> Vec<Vec<TurnRecord>> {
    let results = record_turns(simd, held_states, turns, Recorders::default());
    results.into_iter().map(|(turns, _)| turns).collect()
}

/// Integrates like [`integrate_turns`], with the recorders of `requested_recorders` over all turns.
pub(super) fn record_turns(
    simd: Simd,
    held_states: &[HeldState<'_>],
    turns: usize,
    requested_recorders: Recorders,
) -> Vec<(Vec<TurnRecord>, Reading)> {
    let integrate_batch = |held_states: &[HeldState<'_>]| {
        let lane_groups = held_states.chunks(simd.lanes());
        let integrate_group = |held_states: &[HeldState<'_>]| {
            simd.narrowest_for(held_states.len()).dispatch(HeldTurnsKernel {
                held_states,
                turns,
                requested_recorders,
            })
        };
        lane_groups.flat_map(integrate_group).collect()
    };
    map_in_batches(held_states, |held_state| (held_state.setup.batch_key(), false), integrate_batch)
}

/// The integration of turns from states with the same batch key.
struct HeldTurnsKernel<'a> {
    held_states: &'a [HeldState<'a>],
    turns: usize,
    requested_recorders: Recorders,
}

impl Kernel for HeldTurnsKernel<'_> {
    type Output = Vec<(Vec<TurnRecord>, Reading)>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let mut results = Vec::with_capacity(self.held_states.len());
        for held_states in self.held_states.chunks(T::LANES) {
            integrate_lanes(
                N(zero),
                held_states,
                self.turns,
                self.requested_recorders,
                &mut results,
            );
        }
        results
    }
}

#[inline(always)]
fn integrate_lanes<T: Lane>(
    zero: N<T>,
    held_states: &[HeldState<'_>],
    turns: usize,
    requested_recorders: Recorders,
    results: &mut Vec<(Vec<TurnRecord>, Reading)>,
) {
    let setups: Vec<TurnSetup<'_>> =
        held_states.iter().map(|held_state| held_state.setup).collect();
    let grid = step_grid(zero, &setups);
    let model: NonlinearModel<T> = lane_model(zero, &setups);
    let mut states = [[zero; STATES]];
    for lane in 0..T::LANES {
        for i in 0..STATES {
            states[0][i].0.set(lane, held_states[lane.min(held_states.len() - 1)].state[i]);
        }
    }
    let first_result = results.len();
    results.extend(held_states.iter().map(|_| (Vec::with_capacity(turns), Reading::default())));
    let mut recorder = TurnRecorder::new(zero, &model, &grid);
    recorder.records_states = false;
    let substeps = Substeps::new(setups[0].caps.is_none());
    let run_kind = (ModelKind::Nonlinear, substeps);
    recorder.further_recorders = ActiveRecorders::new(
        zero,
        requested_recorders,
        run_kind,
        setups[0].point,
        held_states.len(),
    );
    if let Some(further_recorders) = &mut recorder.further_recorders {
        for lane in 0..T::LANES {
            further_recorders.set_point(lane, setups[lane.min(setups.len() - 1)].point);
        }
    }
    for finished_turns in 0..turns {
        integrate_turn(&model, &grid, &mut states, Some(&mut recorder));
        let lanes_in_range = T::bits(model.in_range(&states[0]));
        for (lane, held_state) in held_states.iter().enumerate() {
            let (records, _) = &mut results[first_result + lane];
            // A trajectory that has left the range gets no further records.
            if lanes_in_range >> lane & 1 == 1 && records.len() == finished_turns {
                let radial_m = recorder.max_radial_squared.0.get(lane).sqrt();
                records.push(TurnRecord {
                    end_state: core::array::from_fn(|i| states[0][i].0.get(lane)),
                    peaks: recorder.peaks.lane_peaks(lane),
                    min_gap_m: held_state.setup.point.clearance_m() - radial_m,
                });
            }
        }
        for lane in 0..T::LANES {
            recorder.peaks.reset(lane);
        }
        recorder.max_radial_squared = zero;
    }
    if let Some(mut further_recorders) = recorder.further_recorders {
        for (lane, held_state) in held_states.iter().enumerate() {
            let (records, reading) = &mut results[first_result + lane];
            further_recorders.finish(lane, lane, held_state.setup.point, records.len() < turns);
            *reading = core::mem::take(&mut further_recorders.readings[lane]);
        }
    }
}

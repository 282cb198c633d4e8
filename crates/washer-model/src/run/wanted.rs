//! What may be recorded on request, and what such records hold.

use super::Course;
use crate::Snapshot;
use crate::channel::CHANNELS;

/// The record of one stop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StopLoad {
    /// Its greatest push (N).
    pub push_n: f64,
    /// How long it is closed (s).
    pub contact_s: f64,
}

/// Records to make beyond a [`Record`](super::Record); none by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Wanted {
    /// Root mean squares of the channels.
    pub root_mean_squares: bool,
    /// Largest deviations of the channels in every turn of the drum.
    pub turns: bool,
    /// The greatest force that springs and dampers together put on the cabinet.
    pub cabinet_force: bool,
    /// How long drum and tub overlap.
    pub clash_time: bool,
    /// The greatest push of each stop, and how long it is closed.
    pub stops: bool,
    /// The least load of each foot of the cabinet, and the least margins against slipping and
    /// walking.
    pub feet: bool,
    /// The greatest speed of each damper.
    pub damper_speeds: bool,
    /// The coordinates at the ends of legs ([`Timing::checkpoints`](crate::Timing)).
    pub course: bool,
    /// All outputs at the point's own instants ([`Point::seen_at`](crate::Point::seen_at)), within
    /// the window.
    pub snapshots: bool,
}

/// The records that [`Wanted`] asks for, of one trajectory, within the window.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Extra {
    /// Root mean square of each channel's deviation from equilibrium, in the order of
    /// `Channel::ALL` (m, rad).
    pub root_mean_squares: Option<[f64; CHANNELS]>,
    /// Per turn of the drum, each channel's largest deviation from equilibrium (m, rad). Turns are
    /// counted from the start of the run by the angle that the drum travels; parts of turns at the
    /// window's ends belong to the whole turn beside them, and a window without whole turns counts
    /// as one. Empty unless asked for.
    pub turns: Vec<[f64; CHANNELS]>,
    /// The greatest magnitude of the sum of all forces of springs and dampers on the cabinet (N);
    /// at rest it is the weight.
    pub cabinet_force_n: Option<f64>,
    /// Time with a gap below zero (s).
    pub clash_time_s: Option<f64>,
    /// By how much more or less that would be, with the gap off by as much as ringing can make it
    /// (s). Where drum and tub only just touch, it is much of the time itself. Absent where modes
    /// are not capped, because such runs follow the ringing.
    pub clash_doubt_s: Option<f64>,
    /// Of each stop, in the machine's order.
    pub stops: Vec<StopLoad>,
    /// The least vertical load of each foot (N), below zero where it would lift, in the machine's
    /// order; empty if it has no cabinet.
    pub foot_loads_n: Vec<f64>,
    /// The least margin against slipping (N): friction on all feet together less the horizontal
    /// force; below zero the cabinet slips. Absent if the machine has no cabinet.
    pub slip_margin_n: Option<f64>,
    /// The least margin against walking (N): that against slipping less what turning takes of it.
    /// Absent if the machine has no cabinet.
    pub walk_margin_n: Option<f64>,
    /// The greatest speed of each damper along it (m/s), in the machine's order; empty unless asked
    /// for.
    pub damper_speeds_m_per_s: Vec<f64>,
    /// Coordinates at the ends of legs, as far as the trajectory came; also of one that failed.
    /// Empty unless asked for.
    pub course: Course,
    /// All outputs at the point's own instants. Empty unless asked for.
    pub snapshots: Vec<Snapshot>,
}

impl Wanted {
    /// Whether any record needs more than the ends of legs.
    pub(crate) fn anything(self) -> bool {
        Self { course: false, ..self } != Self::default()
    }
}

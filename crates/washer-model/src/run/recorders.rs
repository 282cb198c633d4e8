//! What may be recorded on request, and what such records hold.

use super::Course;
use super::loads::{Gauge, Gauges};
use crate::Snapshot;
use crate::channel::CHANNELS;

/// Records to make beyond a [`Record`](super::Record); none by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Recorders {
    /// Root mean squares of the channels.
    pub root_mean_squares: bool,
    /// Largest deviations of the channels in every turn of the drum.
    pub turns: bool,
    /// Which [`Gauge`](super::Gauge)s are read.
    pub gauges: Gauges,
    /// The coordinates at the ends of legs ([`Timing::checkpoints`](crate::Timing)).
    pub course: bool,
    /// All outputs at the point's own instants ([`Point::seen_at`](crate::Point::seen_at)), within
    /// the window.
    pub snapshots: bool,
}

/// The records that [`Recorders`] asks for, of one trajectory, within the window.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reading {
    /// Root mean square of each channel's deviation from equilibrium, in the order of
    /// `Channel::ALL` (m, rad).
    pub root_mean_squares: Option<[f64; CHANNELS]>,
    /// Per turn of the drum, each channel's largest deviation from equilibrium (m, rad). Turns are
    /// counted from the start of the run by the angle that the drum travels; parts of turns at the
    /// window's ends belong to the whole turn beside them, and a window without whole turns counts
    /// as one. Empty unless asked for.
    pub turns: Vec<[f64; CHANNELS]>,
    /// By [`Gauge`]: of each part in the machine's order, or the only one; empty unless asked for.
    pub gauges: [Vec<f64>; Gauge::ALL.len()],
    /// Coordinates at the ends of legs, as far as the trajectory came; also of one that failed.
    /// Empty unless asked for.
    pub course: Course,
    /// All outputs at the point's own instants. Empty unless asked for.
    pub snapshots: Vec<Snapshot>,
}

impl Reading {
    /// What a gauge showed, if it was asked for.
    pub fn gauge(&self, gauge: Gauge) -> &[f64] {
        &self.gauges[gauge as usize]
    }
}

impl Recorders {
    /// Whether it asks for a gauge.
    pub(crate) const fn reads(&self, gauge: Gauge) -> bool {
        self.gauges[gauge as usize]
    }

    /// Nothing but a gauge.
    pub fn gauge(gauge: Gauge) -> Self {
        Self { gauges: Gauge::ALL.map(|one| one == gauge), ..Self::default() }
    }

    /// Whether any record needs more than the ends of legs.
    pub(crate) fn anything(self) -> bool {
        Self { course: false, ..self } != Self::default()
    }
}

//! The optional recorders of a trajectory, and their readings.

use super::Checkpoints;
use super::gauge::{Gauge, GaugeSelection};
use crate::Snapshot;
use crate::channel::CHANNELS;

/// The recorders in use in addition to that of [`Record`](super::Record); none by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Recorders {
    /// Whether root mean squares of the channels are computed.
    pub with_root_mean_squares: bool,
    /// Whether the largest deviations in every turn of the drum are recorded.
    pub with_turns: bool,
    /// The [`Gauge`](super::Gauge)s in use.
    pub gauges: GaugeSelection,
    /// Whether the coordinates at the ends of segments are recorded
    /// ([`Timing::with_checkpoints`](crate::Timing)).
    pub with_checkpoints: bool,
    /// Whether all outputs are recorded at instants of the point within the window
    /// ([`Point::with_snapshots_at`](crate::Point::with_snapshots_at)).
    pub with_snapshots: bool,
}

/// The readings of [`Recorders`] for one trajectory, within the window.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reading {
    /// The root mean square of each channel's deviation from equilibrium (m, rad), in the order of
    /// `Channel::ALL`.
    pub root_mean_squares: Option<[f64; CHANNELS]>,
    /// The largest deviation of each channel from equilibrium (m, rad) in each turn of the drum.
    /// Turns are counted from the start of the run by the angle of the drum. A partial turn at an
    /// end of the window is joined to the adjacent whole turn, and a window without whole turns
    /// counts as one turn. Empty without this recorder.
    pub turns: Vec<[f64; CHANNELS]>,
    /// The values of each [`Gauge`]: one for each element in the machine's order, or a single one.
    /// Empty for gauges that are not in use.
    pub gauges: [Vec<f64>; Gauge::ALL.len()],
    /// The coordinates at the ends of segments up to the end or the failure of the trajectory.
    /// Empty without this recorder.
    pub checkpoints: Checkpoints,
    /// The outputs at the point's instants within the window. Empty without this recorder.
    pub snapshots: Vec<Snapshot>,
}

impl Reading {
    /// Returns the recorded values of a gauge; none if the gauge was not in use.
    pub fn gauge_values(&self, gauge: Gauge) -> &[f64] {
        &self.gauges[gauge as usize]
    }
}

impl Recorders {
    /// Returns whether a gauge is in use.
    pub(crate) const fn has_gauge(&self, gauge: Gauge) -> bool {
        self.gauges[gauge as usize]
    }

    /// Creates recorders of which only a gauge is in use.
    pub fn with_gauge(gauge: Gauge) -> Self {
        Self { gauges: Gauge::ALL.map(|other| other == gauge), ..Self::default() }
    }

    /// Returns whether any recorder needs the states between the ends of segments.
    pub(crate) fn need_all_states(self) -> bool {
        Self { with_checkpoints: false, ..self } != Self::default()
    }
}

//! The recorders that are in use only on request: root mean squares, turns, gauges and snapshots.
//!
//! These recorders run over lanes after every step, in a function that is not inlined
//! ([`Lane::run_out_of_line`]), so that the loop over steps is not slower if they are not in use.

use super::gauge::Gauge;
use super::loads::LoadRecorder;
use super::snapshots::Snapshots;
use super::{Method, MethodKind};
use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::machine::spin::turn_division_times_s;
use crate::nonlinear::outputs::{RADIAL_COMPONENTS, squared_distance};
use crate::{ModelKind, Point, Reading, Recorders};
use lane_ode::{IntervalPeaks, Lane, N, OutOfLine, Sample, SquareIntegrals, TimeAbove};

/// The number of parts into which a long step is divided; loads are evaluated at their ends.
///
/// Basis: steps of order 8 last a few ms, and forces peak within them; not measured. Doubling it
/// doubles the cost of loads.
const LONG_STEP_SUBSTEPS: u32 = 4;

/// The length (s) of the parts into which a step with capped modes is divided.
///
/// Basis: forty parts in a period of 25 Hz, the turns of a drum at 1500 rpm. Doubling it halves the
/// cost of loads and misses more of their peaks.
const CAPPED_SUBSTEP_S: f64 = 1e-3;

/// The parts of a step at whose ends loads are evaluated.
#[derive(Clone, Copy)]
pub(crate) struct Substeps {
    /// The number of parts.
    count: u32,
}

impl Substeps {
    /// Creates the division of steps: into one part if steps are short because the bearings limit
    /// them, else into [`LONG_STEP_SUBSTEPS`] parts.
    pub(crate) const fn new(are_short: bool) -> Self {
        Self { count: if are_short { 1 } else { LONG_STEP_SUBSTEPS } }
    }

    /// Creates the division of the steps of a method.
    pub(crate) fn for_method(method: &Method) -> Self {
        if method.kind.is_capped() {
            let count = (method.step_s / CAPPED_SUBSTEP_S).ceil() as u32;
            return Self { count: count.clamp(1, LONG_STEP_SUBSTEPS) };
        }
        Self::new(method.kind == MethodKind::Rk4)
    }
}

/// The state of the recorders in use, over lanes.
pub(crate) struct ActiveRecorders<T> {
    recorders: Recorders,
    square_integrals: SquareIntegrals<T, CHANNELS>,
    turn_peaks: IntervalPeaks<T, CHANNELS>,
    loads: Option<LoadRecorder<T>>,
    /// The time for which the gap is negative.
    clash_time: TimeAbove<T>,
    clearance_squared: N<T>,
    snapshots: Option<Snapshots<T>>,
    /// The readings of every point; empty for points that have not ended.
    pub(crate) readings: Vec<Reading>,
}

impl<T: Lane> ActiveRecorders<T> {
    /// Creates the recorders for `count` points, one of which is `point`; `None` if none of these
    /// recorders is in use.
    #[inline(always)]
    pub(crate) fn new(
        zero: N<T>,
        recorders: Recorders,
        (model, substeps): (ModelKind, Substeps),
        point: &Point,
        count: usize,
    ) -> Option<Self> {
        // This is not `bool::then`, whose closure would be compiled without the kernel's
        // instruction set.
        if !recorders.need_all_states() {
            return None;
        }
        let snapshots = if recorders.with_snapshots { Some(Snapshots::new(zero)) } else { None };
        Some(Self {
            recorders,
            square_integrals: SquareIntegrals::new(zero),
            turn_peaks: IntervalPeaks::new(zero),
            loads: LoadRecorder::new(zero, recorders, model, point, substeps.count),
            clash_time: TimeAbove::new(zero),
            clearance_squared: zero,
            snapshots,
            readings: vec![Reading::default(); count],
        })
    }

    /// Begins a point's trajectory in one lane.
    pub(crate) fn set_point(&mut self, lane: usize, point: &Point) {
        self.square_integrals.reset(lane);
        let clearance_m = point.machine.bodies.clearance.0;
        self.clash_time.reset(lane);
        self.clearance_squared.0.set(lane, clearance_m * clearance_m);
        if self.recorders.with_turns {
            self.turn_peaks
                .reset(lane, &turn_division_times_s(&point.spin_segments, point.window_s()));
        }
        if let Some(loads) = &mut self.loads {
            loads.set_point(lane, point);
        }
        if let Some(snapshots) = &mut self.snapshots {
            snapshots.set_point(lane, point);
        }
    }

    /// Ends the trajectory in a lane and stores the readings of its point, which has the index
    /// `index`. A failed trajectory has no readings.
    pub(crate) fn finish(&mut self, lane: usize, index: usize, point: &Point, has_failed: bool) {
        let recorders = self.recorders;
        let turns = if recorders.with_turns { self.turn_peaks.finish(lane) } else { Vec::new() };
        let snapshots = match &mut self.snapshots {
            Some(snapshots) => snapshots.finish(lane),
            None => Vec::new(),
        };
        if has_failed {
            return;
        }
        let [from_s, to_s] = point.window_s();
        // Rounding may make the integral of a motion at rest negative.
        let to_root_mean_square = |integral: f64| (integral / (to_s - from_s)).max(0.0).sqrt();
        let gauges = Gauge::ALL.map(|gauge| match &self.loads {
            _ if !recorders.has_gauge(gauge) => Vec::new(),
            _ if gauge == Gauge::ClashTime => vec![self.clash_time.lane_time_s(lane)],
            Some(loads) => loads.gauge_values(gauge, lane, point),
            None => Vec::new(),
        });
        let root_mean_squares = match recorders.with_root_mean_squares {
            true => Some(self.square_integrals.lane_integrals(lane).map(to_root_mean_square)),
            false => None,
        };
        let checkpoints = Vec::new();
        self.readings[index] = Reading { root_mean_squares, turns, gauges, checkpoints, snapshots };
    }
}

/// A state and its outputs, which are passed to the recorders.
pub(crate) struct ObservedState<'a, T: Lane> {
    pub(crate) recorders: &'a mut ActiveRecorders<T>,
    /// The end and the length (s) of the step that ends at the state; `None` at the start of a
    /// segment.
    pub(crate) step: Option<(N<T>, N<T>)>,
    pub(crate) x: &'a [N<T>; STATES],
    pub(crate) dx: &'a [N<T>; STATES],
    pub(crate) radial_position: &'a [Sample<T>; RADIAL_COMPONENTS],
    pub(crate) channels: &'a [Sample<T>; CHANNELS],
    /// The lanes that are inside their windows.
    pub(crate) lanes_in_window: T::Mask,
}

impl<T: Lane> OutOfLine for ObservedState<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self {
            recorders: active_recorders,
            step,
            x,
            dx,
            radial_position,
            channels,
            lanes_in_window,
        } = self;
        let recorders = active_recorders.recorders;
        if recorders.with_root_mean_squares {
            match step {
                Some((_, length_s)) => {
                    active_recorders.square_integrals.advance(length_s, channels, lanes_in_window)
                }
                None => active_recorders.square_integrals.begin(channels),
            }
        }
        if recorders.with_turns {
            match step {
                Some((end_s, length_s)) => {
                    active_recorders.turn_peaks.advance(end_s, length_s, channels, lanes_in_window)
                }
                None => active_recorders.turn_peaks.begin(channels, lanes_in_window),
            }
        }
        if let Some(loads) = &mut active_recorders.loads {
            loads.record(step, x, dx, lanes_in_window);
        }
        if let Some(snapshots) = &mut active_recorders.snapshots {
            snapshots.record(step, (x, dx), channels);
        }
        if recorders.has_gauge(Gauge::ClashTime) {
            // The gap is negative where the square of the radial distance exceeds that of the
            // clearance.
            let mut squared_overlap = squared_distance(radial_position);
            squared_overlap.value -= active_recorders.clearance_squared;
            match step {
                Some((_, length_s)) => {
                    active_recorders.clash_time.advance(length_s, &squared_overlap, lanes_in_window)
                }
                None => active_recorders.clash_time.begin(&squared_overlap),
            }
        }
    }
}

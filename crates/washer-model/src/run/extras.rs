//! Records made only on request: measures of motion other than peaks, and further metrics.
//!
//! They are computed in the lanes, step by step, in a function of their own ([`Lane::aside`]), so
//! that the loop over steps does not change where they are not in use.

use super::Method;
use super::loads::{Gauge, Loads};
use super::snapshots::Snapshots;
use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::machine::spin::cuts_s;
use crate::nonlinear::outputs::{RADIAL, squared};
use crate::{ModelKind, Point, Reading, Recorders};
use lane_ode::{Aside, Lane, N, PartPeaks, Sample, SquareIntegrals, TimeAbove};

/// Parts into which forces and speeds cut steps that are not held short by the bearings.
const PARTS_OF_A_LONG_STEP: u32 = 4;

/// Parts of steps with capped modes need be no shorter than this (s).
const SHORTEST_PART_S: f64 = 1e-3;

/// Where recorders look between the ends of steps.
#[derive(Clone, Copy)]
pub(crate) struct Instants {
    /// Parts into which they cut a step.
    parts: u32,
}

impl Instants {
    /// Of steps that are held short by the bearings, or of longer ones.
    pub(crate) const fn of_steps(are_short: bool) -> Self {
        Self { parts: if are_short { 1 } else { PARTS_OF_A_LONG_STEP } }
    }

    /// Of a method's steps.
    pub(crate) fn of(method: &Method) -> Self {
        match method {
            Method::Rk4 { .. } => Self::of_steps(true),
            Method::Capped { step_s, .. } => {
                let parts = (step_s / SHORTEST_PART_S).ceil() as u32;
                Self { parts: parts.clamp(1, PARTS_OF_A_LONG_STEP) }
            }
            _ => Self::of_steps(false),
        }
    }
}

/// The recorders, over lanes.
pub(crate) struct Extras<T> {
    wanted: Recorders,
    squares: SquareIntegrals<T, CHANNELS>,
    turns: PartPeaks<T, CHANNELS>,
    loads: Option<Loads<T>>,
    clash: TimeAbove<T>,
    clearance_squared: N<T>,
    snapshots: Option<Snapshots<T>>,
    /// Of every point, as far as they have ended.
    pub(crate) found: Vec<Reading>,
}

impl<T: Lane> Extras<T> {
    /// For `count` points, of which `point` is any; `None` if nothing is wanted.
    #[inline(always)]
    pub(crate) fn new(
        zero: N<T>,
        wanted: Recorders,
        (model, instants): (ModelKind, Instants),
        point: &Point,
        count: usize,
    ) -> Option<Self> {
        // No closure: it would be compiled without the instruction set.
        if !wanted.anything() {
            return None;
        }
        let Instants { parts } = instants;
        let snapshots = if wanted.snapshots { Some(Snapshots::new(zero)) } else { None };
        Some(Self {
            wanted,
            squares: SquareIntegrals::new(zero),
            turns: PartPeaks::new(zero),
            loads: Loads::new(zero, wanted.gauges, model, point, parts),
            clash: TimeAbove::new(zero),
            clearance_squared: zero,
            snapshots,
            found: vec![Reading::default(); count],
        })
    }

    /// Begins a point's trajectory in one lane.
    pub(crate) fn set_point(&mut self, lane: usize, point: &Point) {
        self.squares.reset(lane);
        let clearance_m = point.machine.bodies.clearance.0;
        self.clash.reset(lane);
        self.clearance_squared.0.set(lane, clearance_m * clearance_m);
        if self.wanted.turns {
            self.turns.reset(lane, &cuts_s(&point.stretches, point.window_s()));
        }
        if let Some(loads) = &mut self.loads {
            loads.set_point(lane, point);
        }
        if let Some(snapshots) = &mut self.snapshots {
            snapshots.set_point(lane, point);
        }
    }

    /// Ends a lane's trajectory, that of point `index`. A failed one leaves no record.
    pub(crate) fn finish(&mut self, lane: usize, index: usize, point: &Point, failed: bool) {
        let turns = if self.wanted.turns { self.turns.finish(lane) } else { Vec::new() };
        let snapshots = self.snapshots.as_mut().map_or_else(Vec::new, |it| it.finish(lane));
        if failed {
            return;
        }
        let [from_s, to_s] = point.window_s();
        // Rounding can leave a tiny integral just below zero.
        let mean = |integral: f64| (integral / (to_s - from_s)).max(0.0).sqrt();
        let wanted = self.wanted;
        let gauges = Gauge::ALL.map(|gauge| match &self.loads {
            _ if !wanted.reads(gauge) => Vec::new(),
            _ if gauge == Gauge::ClashTime => vec![self.clash.lane(lane)],
            Some(loads) => loads.of(gauge, lane, point),
            None => Vec::new(),
        });
        self.found[index] = Reading {
            root_mean_squares: wanted.root_mean_squares.then(|| self.squares.lane(lane).map(mean)),
            turns,
            gauges,
            course: Vec::new(),
            snapshots,
        };
    }
}

/// An instant as the recorders see it.
pub(crate) struct Seen<'a, T: Lane> {
    pub(crate) extras: &'a mut Extras<T>,
    /// End and length of the step that leads here (s); none where a leg begins.
    pub(crate) step: Option<(N<T>, N<T>)>,
    pub(crate) x: &'a [N<T>; STATES],
    pub(crate) dx: &'a [N<T>; STATES],
    pub(crate) radial: &'a [Sample<T>; RADIAL],
    pub(crate) channels: &'a [Sample<T>; CHANNELS],
    /// Which lanes are inside their windows.
    pub(crate) inside: T::Mask,
}

impl<T: Lane> Aside for Seen<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { extras, step, x, dx, radial, channels, inside } = self;
        let wanted = extras.wanted;
        if wanted.root_mean_squares {
            match step {
                Some((_, length_s)) => extras.squares.advance(length_s, channels, inside),
                None => extras.squares.begin(channels),
            }
        }
        if wanted.turns {
            match step {
                Some((end_s, length_s)) => extras.turns.advance(end_s, length_s, channels, inside),
                None => extras.turns.begin(channels, inside),
            }
        }
        if let Some(loads) = &mut extras.loads {
            loads.see(step, x, dx, inside);
        }
        if let Some(snapshots) = &mut extras.snapshots {
            snapshots.see(step, (x, dx), channels);
        }
        if wanted.reads(Gauge::ClashTime) {
            let mut overlap = squared(radial);
            overlap.value -= extras.clearance_squared;
            match step {
                Some((_, length_s)) => extras.clash.advance(length_s, &overlap, inside),
                None => extras.clash.begin(&overlap),
            }
        }
    }
}

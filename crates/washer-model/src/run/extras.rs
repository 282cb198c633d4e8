//! What is recorded of a trajectory only when asked for: other measures of motion than its peak, and further metrics.
//!
//! All of it is found in the lanes, step by step, in a function of its own ([`Lane::aside`]): what nobody asks for leaves the loop over
//! steps as it is.

use super::cabinet_force::GreatestForce;
use super::{Course, Method, ModelKind};
use crate::model::STATES;
use crate::outputs::{CHANNELS, RADIAL, squared};
use crate::point::Point;
use crate::spin::cuts_s;
use lane_ode::{Aside, Lane, N, PartPeaks, Sample, SquareIntegrals, TimeAbove};

/// Parts into which the cabinet's force cuts steps that are not held short by the bearings.
const PARTS_OF_A_LONG_STEP: u32 = 4;

/// What to record beyond a [`Record`](super::Record); nothing by default.
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
    /// The coordinates at the ends of legs ([`Timing::checkpoints`](crate::Timing)).
    pub course: bool,
}

/// What was asked for by [`Wanted`], of one trajectory, within the window.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Extra {
    /// Root mean square of each channel's deviation from equilibrium, in the order of `Channel::ALL` (m, rad).
    pub root_mean_squares: Option<[f64; CHANNELS]>,
    /// Per turn of the drum, each channel's largest deviation from equilibrium (m, rad). Turns are counted from the start of the run by
    /// the angle that the drum travels; parts of turns at the window's ends belong to the whole turn beside them, and a window
    /// without whole turns counts as one. Empty unless asked for.
    pub turns: Vec<[f64; CHANNELS]>,
    /// The greatest magnitude of the sum of all forces of springs and dampers on the cabinet (N); at rest it is the weight.
    pub cabinet_force_n: Option<f64>,
    /// Time with a gap below zero (s).
    pub clash_time_s: Option<f64>,
    /// Coordinates at the ends of legs, as far as the trajectory came; also of one that failed. Empty unless asked for.
    pub course: Course,
}

impl Wanted {
    /// Whether anything is to be looked at between the ends of legs.
    fn anything(self) -> bool {
        Self { course: false, ..self } != Self::default()
    }
}

/// The recorders, over lanes.
pub(super) struct Extras<T> {
    wanted: Wanted,
    squares: SquareIntegrals<T, CHANNELS>,
    turns: PartPeaks<T, CHANNELS>,
    force: Option<GreatestForce<T>>,
    clash: TimeAbove<T>,
    clearance_squared: N<T>,
    /// Of every point, as far as they have ended.
    pub(super) found: Vec<Extra>,
}

impl<T: Lane> Extras<T> {
    /// For `count` points, of which one is given to start with; none if nothing is wanted.
    #[inline(always)]
    pub(super) fn new(
        zero: N<T>,
        wanted: Wanted,
        (model, method): (ModelKind, &Method),
        point: &Point,
        count: usize,
    ) -> Option<Self> {
        // No closure: it would be compiled without the instruction set.
        if !wanted.anything() {
            return None;
        }
        let parts = match method {
            Method::Rk4 { .. } => 1,
            Method::Geared(_) | Method::Dopri5(_) | Method::Rodas5p(_) => PARTS_OF_A_LONG_STEP,
        };
        let force =
            if wanted.cabinet_force { Some(GreatestForce::new(zero, model, point, parts)) } else { None };
        Some(Self {
            wanted,
            squares: SquareIntegrals::new(zero),
            turns: PartPeaks::new(zero),
            force,
            clash: TimeAbove::new(zero),
            clearance_squared: zero,
            found: vec![Extra::default(); count],
        })
    }

    /// Begins a point's trajectory in one lane.
    pub(super) fn set_point(&mut self, lane: usize, point: &Point) {
        self.squares.reset(lane);
        self.clash.reset(lane);
        let clearance_m = point.machine.bodies.clearance.0;
        self.clearance_squared.0.set(lane, clearance_m * clearance_m);
        if self.wanted.turns {
            self.turns.reset(lane, &cuts_s(&point.stretches, point.window_s()));
        }
        if let Some(force) = &mut self.force {
            force.set_point(lane, point);
        }
    }

    /// Ends a lane's trajectory, that of point `index`; nothing is kept of one that failed.
    pub(super) fn finish(&mut self, lane: usize, index: usize, point: &Point, failed: bool) {
        let turns = if self.wanted.turns { self.turns.finish(lane) } else { Vec::new() };
        if failed {
            return;
        }
        let [from_s, to_s] = point.window_s();
        // Rounding can leave the integral of next to nothing a hair below zero.
        let mean = |integral: f64| (integral / (to_s - from_s)).max(0.0).sqrt();
        let wanted = self.wanted;
        self.found[index] = Extra {
            root_mean_squares: wanted.root_mean_squares.then(|| self.squares.lane(lane).map(mean)),
            turns,
            cabinet_force_n: self.force.as_ref().map(|force| force.lane_n(lane)),
            clash_time_s: wanted.clash_time.then(|| self.clash.lane(lane)),
            course: Course::new(),
        };
    }
}

/// What the recorders are shown of an instant.
pub(super) struct Seen<'a, T: Lane> {
    pub(super) extras: &'a mut Extras<T>,
    /// End and length of the step that leads here (s); none where a leg begins.
    pub(super) step: Option<(N<T>, N<T>)>,
    pub(super) x: &'a [N<T>; STATES],
    pub(super) dx: &'a [N<T>; STATES],
    pub(super) radial: &'a [Sample<T>; RADIAL],
    pub(super) channels: &'a [Sample<T>; CHANNELS],
    /// Which lanes are inside their windows.
    pub(super) inside: T::Mask,
}

impl<T: Lane> Aside for Seen<'_, T> {
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
        if let Some(force) = &mut extras.force {
            force.see(step, x, dx, inside);
        }
        if wanted.clash_time {
            let mut overlap = squared(radial);
            overlap.value -= extras.clearance_squared;
            match step {
                Some((_, length_s)) => extras.clash.advance(length_s, &overlap, inside),
                None => extras.clash.begin(&overlap),
            }
        }
    }
}

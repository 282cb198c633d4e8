//! Periodic responses: points at constant speeds, in lanes.
//!
//! The period map is a turn of the machine with capped modes, which leave exact what turns with the
//! drum (`coupling.rs`), by classical Runge-Kutta in few steps. The linear model's is affine, so
//! that one linear solve finds what it returns to. From there the nonlinear model's fixed point is
//! found by Newton's method: with the linear model's matrix as long as that brings it closer fast
//! enough, else with the response's own (`monodromy.rs`).

use super::monodromy::{INSTANTS, monodromy, slopes_along, weights};
use super::turn::{Clock, Watch, turn};
use crate::channel::CHANNELS;
use crate::coordinates::{COORDINATES, STATES};
use crate::machine::spin::SpinStretch;
use crate::nonlinear::coupling::{Caps, Coupling};
use crate::point::Point;
use crate::run::model::{Linear, Model, Nonlinear};
use core::f64::consts::TAU;
use lane_ode::{Dual, Kernel, Lane, Lu, N, Peaks};

/// Rows and columns of a state's disturbance.
pub(super) type Square = [[N<f64>; STATES]; STATES];

/// A point at a constant speed.
#[derive(Clone, Copy)]
pub(super) struct Row<'a> {
    pub(super) point: &'a Point,
    pub(super) speed_rpm: f64,
    /// Steps of a turn.
    pub(super) steps: usize,
    /// On the modes of bearings and hinge; none if the steps follow these.
    pub(super) caps: Option<Caps>,
    /// A response nearby, from which the search starts; else it starts from the linear model's.
    pub(super) from: Option<[f64; STATES]>,
}

impl Row<'_> {
    pub(super) fn turn_s(&self) -> f64 {
        60.0 / self.speed_rpm
    }

    pub(super) fn step_s(&self) -> f64 {
        self.turn_s() / self.steps as f64
    }

    /// Disturbances' speeds count per this: a rate that makes the fastest of them of one size with
    /// the coordinates.
    pub(super) fn unit_per_s(&self) -> f64 {
        1.0 / self.step_s()
    }
}

/// Turns that the search for a response may take.
const MOST_TURNS: usize = 30;

/// A response is found once another turn moves it by less than this share of its greatest
/// coordinate.
const CLOSE: f64 = 1e-10;

/// Smaller deviations (m, rad) count as this: without unbalance there is none but rounding.
const LEAST_SIZE: f64 = 1e-4;

/// The matrix is taken anew where a correction leaves more than this share of what was missing.
const FAST_ENOUGH: f64 = 0.2;

/// What is found of a row.
pub(super) struct Found {
    /// Amplitudes of the linear model's response (m, rad).
    pub(super) linear: [f64; CHANNELS],
    /// Of the nonlinear model's.
    pub(super) nonlinear: [f64; CHANNELS],
    /// The nonlinear response at theta = 0.
    pub(super) start: [f64; STATES],
    /// What a turn does to disturbances of it; speeds per [`Row::unit_per_s`].
    pub(super) monodromy: Square,
}

/// Finds the responses of rows whose turns have equally many steps, and all of which are capped or
/// none; `None` where there is no response.
pub(super) struct Respond<'a> {
    pub(super) rows: &'a [Row<'a>],
}

impl Kernel for Respond<'_> {
    type Output = Vec<Option<Box<Found>>>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let mut found = Vec::with_capacity(self.rows.len());
        let Some(first) = self.rows.first() else { return found };
        let weights = weights(first.steps);
        for rows in self.rows.chunks(T::LANES) {
            respond(N(zero), rows, &weights, &mut found);
        }
        found
    }
}

/// A model with each row in its lane, and the last in those that are left over.
#[inline(always)]
pub(super) fn model<T: Lane, M: Model<T>>(zero: N<T>, rows: &[Row<'_>]) -> M {
    let coupling = Coupling::new(zero, rows[0].caps.as_ref());
    let mut model = M::splat(zero, rows[0].point, coupling);
    for lane in 0..T::LANES {
        let row = &rows[lane.min(rows.len() - 1)];
        model.set_point(lane, row.point);
        model.set_spin(lane, &SpinStretch::steady(row.speed_rpm));
        if let Some(caps) = &row.caps {
            model.set_caps(lane, caps);
        }
    }
    model
}

#[inline(always)]
fn respond<T: Lane>(
    zero: N<T>,
    rows: &[Row<'_>],
    weights: &[[f64; INSTANTS]],
    found: &mut Vec<Option<Box<Found>>>,
) {
    let mut clock = Clock { step_s: zero, steps: rows[0].steps };
    for lane in 0..T::LANES {
        clock.step_s.0.set(lane, rows[lane.min(rows.len() - 1)].step_s());
    }
    let linear: Linear<T> = model(zero, rows);
    let answer = linear_response(zero, &linear, &clock, rows.len());
    let mut states = answer.start;
    for lane in 0..rows.len() {
        let rest = <Nonlinear<T> as Model<T>>::at_rest(rows[lane].point);
        for i in 0..STATES {
            let deviation = states[i].0.get(lane);
            // Where even the linear model has none, the search starts at rest.
            let deviation = if deviation.is_finite() { deviation } else { 0.0 };
            let start = match &rows[lane].from {
                Some(from) => from[i],
                None => rest[i] + deviation,
            };
            states[i].0.set(lane, start);
        }
    }
    let nonlinear: Nonlinear<T> = model(zero, rows);
    let tangent: Nonlinear<Dual<T>> = model(zero.constant(), rows);
    let is_found = [false; lane_ode::MAX_LANES];
    let mut search = Search { rows, weights, states, jacobians: answer.jacobians, is_found };
    let (peaks, columns) = search.run(&nonlinear, &tangent, &clock);
    for lane in 0..rows.len() {
        if !search.is_found[lane] {
            found.push(None);
            continue;
        }
        let unit_per_s = rows[lane].unit_per_s();
        let unit = |i: usize| if i < COORDINATES { 1.0 } else { unit_per_s };
        let mut monodromy = [[N(0.0); STATES]; STATES];
        for i in 0..STATES {
            for j in 0..STATES {
                monodromy[i][j] = N(columns[j][i].0.get(lane) * unit(j) / unit(i));
            }
        }
        found.push(Some(Box::new(Found {
            linear: answer.peaks.lane(lane),
            nonlinear: peaks.lane(lane),
            start: core::array::from_fn(|i| search.states[i].0.get(lane)),
            monodromy,
        })));
    }
}

/// What the linear model answers.
struct LinearAnswer<T> {
    /// Its response at theta = 0.
    start: [N<T>; STATES],
    peaks: Peaks<T, CHANNELS>,
    /// Of each lane the factors of 1 - Phi.
    jacobians: Vec<Option<Lu<STATES>>>,
}

#[inline(always)]
fn linear_response<T: Lane>(
    zero: N<T>,
    model: &Linear<T>,
    clock: &Clock<T>,
    lanes: usize,
) -> LinearAnswer<T> {
    // From rest, then from a unit of each coordinate and speed.
    let mut ends = vec![[zero; STATES]; 1 + STATES];
    for j in 0..STATES {
        ends[1 + j][j] = zero.lit(1.0);
    }
    let mut answer = LinearAnswer {
        start: [zero; STATES],
        peaks: Peaks::new(zero),
        jacobians: Vec::with_capacity(lanes),
    };
    // The second time around it is watched. A loop, for one copy of the model's code.
    for is_known in [false, true] {
        if is_known {
            ends.truncate(1);
            ends[0] = answer.start;
        }
        let mut watched = Watched::new(zero, model, clock);
        watched.with_peaks = is_known;
        turn(model, clock, &mut ends, if is_known { Some(&mut watched) } else { None });
        if is_known {
            answer.peaks = watched.peaks;
            break;
        }
        for lane in 0..T::LANES {
            let mut apart = [[N(0.0); STATES]; STATES];
            let mut reached = [N(0.0); STATES];
            for i in 0..STATES {
                reached[i] = N(ends[0][i].0.get(lane));
                for j in 0..STATES {
                    apart[i][j] = reached[i] - N(ends[1 + j][i].0.get(lane));
                }
                apart[i][i] = apart[i][i] + 1.0;
            }
            let factors = Lu::new(apart);
            if let Some(factors) = &factors {
                let returns = factors.solve(&reached);
                for i in 0..STATES {
                    answer.start[i].0.set(lane, returns[i].0);
                }
            }
            if lane < lanes {
                answer.jacobians.push(factors);
            }
        }
    }
    answer
}

/// The search for the nonlinear responses.
struct Search<'a, T> {
    rows: &'a [Row<'a>],
    /// [`weights`] of the rows' turns.
    weights: &'a [[f64; INSTANTS]],
    states: [N<T>; STATES],
    /// Factors of 1 - Phi of each lane.
    jacobians: Vec<Option<Lu<STATES>>>,
    is_found: [bool; lane_ode::MAX_LANES],
}

impl<T: Lane> Search<'_, T> {
    /// Searches, and watches a last turn from what was found: its peaks, and what becomes of unit
    /// disturbances of its start.
    #[inline(always)]
    fn run(
        &mut self,
        model: &Nonlinear<T>,
        tangent: &Nonlinear<Dual<T>>,
        clock: &Clock<T>,
    ) -> (Peaks<T, CHANNELS>, Vec<[N<T>; STATES]>) {
        let lanes = self.rows.len();
        let zero = self.states[0].lit(0.0);
        let mut is_over = [false; lane_ode::MAX_LANES];
        let mut last = [f64::INFINITY; lane_ode::MAX_LANES];
        let mut watched = Watched::new(zero, model, clock);
        let mut are_all_over = false;
        let mut turns = 0;
        loop {
            let mut ends = [self.states];
            let is_last = are_all_over || turns == MOST_TURNS;
            watched.states.clear();
            watched.with_peaks = is_last;
            turn(model, clock, &mut ends, Some(&mut watched));
            turns += 1;
            let mut is_slow = [false; lane_ode::MAX_LANES];
            let mut are_any_slow = false;
            if !is_last {
                for lane in 0..lanes {
                    let missing = self.missing(&ends[0], lane);
                    if !is_over[lane] && missing > FAST_ENOUGH * last[lane] {
                        is_slow[lane] = true;
                        are_any_slow = true;
                    }
                    last[lane] = missing;
                }
            }
            // One call, for one copy of the model's code.
            if is_last || are_any_slow {
                let slopes = slopes_along(zero, tangent, clock, &watched.states);
                let columns = monodromy(zero, &slopes, self.weights, clock);
                if is_last {
                    return (watched.peaks, columns);
                }
                self.renew(&columns, &is_slow);
            }
            are_all_over = true;
            for lane in 0..lanes {
                if is_over[lane] {
                    continue;
                }
                let is_corrected = self.correct(&ends[0], lane);
                self.is_found[lane] = is_corrected && last[lane] < CLOSE;
                is_over[lane] = !is_corrected || self.is_found[lane];
                are_all_over &= is_over[lane];
            }
        }
    }

    /// How far a lane's turn is from closing, as a share of its deviation; not finite if it left
    /// the model's range.
    #[inline(always)]
    fn missing(&self, end: &[N<T>; STATES], lane: usize) -> f64 {
        let rest = self.rows[lane].point.equilibrium();
        let speed = TAU / self.rows[lane].turn_s();
        let (mut missing, mut size) = (0.0_f64, LEAST_SIZE);
        for i in 0..COORDINATES {
            let x = self.states[i].0.get(lane);
            size = size.max((x - rest[i]).abs());
            let by_speed = (end[COORDINATES + i] - self.states[COORDINATES + i]).0.get(lane);
            let gap = (end[i].0.get(lane) - x).abs() + by_speed.abs() / speed;
            // NaN stays.
            missing = if gap > missing || gap.is_nan() { gap } else { missing };
        }
        missing / size
    }

    /// Takes the matrices of these lanes from the turn itself.
    #[inline(always)]
    fn renew(&mut self, columns: &[[N<T>; STATES]], lanes: &[bool]) {
        for lane in 0..self.rows.len() {
            if !lanes[lane] {
                continue;
            }
            let mut apart = [[N(0.0); STATES]; STATES];
            for i in 0..STATES {
                for j in 0..STATES {
                    apart[i][j] = N(-columns[j][i].0.get(lane));
                }
                apart[i][i] = apart[i][i] + 1.0;
            }
            self.jacobians[lane] = Lu::new(apart);
        }
    }

    /// Moves a lane's state by Newton's correction; false if there is none.
    #[inline(always)]
    fn correct(&mut self, end: &[N<T>; STATES], lane: usize) -> bool {
        let Some(factors) = &self.jacobians[lane] else { return false };
        let mut missing = [N(0.0); STATES];
        for i in 0..STATES {
            missing[i] = N((end[i] - self.states[i]).0.get(lane));
        }
        let correction = factors.solve(&missing);
        let mut is_finite = true;
        for i in 0..STATES {
            is_finite &= correction[i].0.is_finite();
        }
        if is_finite {
            for i in 0..STATES {
                let x = self.states[i].0.get(lane) + correction[i].0;
                self.states[i].0.set(lane, x);
            }
        }
        is_finite
    }
}

/// What is seen of a turn.
struct Watched<'m, T, M> {
    model: &'m M,
    clock: &'m Clock<T>,
    with_peaks: bool,
    /// Above 0 in every lane.
    windows: N<T>,
    peaks: Peaks<T, CHANNELS>,
    /// At even instants, the first at the turn's start.
    states: Vec<[N<T>; STATES]>,
}

impl<'m, T: Lane, M: Model<T>> Watched<'m, T, M> {
    #[inline(always)]
    fn new(zero: N<T>, model: &'m M, clock: &'m Clock<T>) -> Self {
        let (windows, peaks) = (zero.lit(1.0), Peaks::new(zero));
        let states = Vec::with_capacity(INSTANTS + 1);
        Self { model, clock, with_peaks: false, windows, peaks, states }
    }
}

impl<T: Lane, M: Model<T>> Watch<T, M> for Watched<'_, T, M> {
    #[inline(always)]
    fn see(&mut self, k: usize, forcing: &M::Forcing, x: &[N<T>; STATES], dx: &[N<T>; STATES]) {
        if k.is_multiple_of(self.clock.steps / INSTANTS) {
            self.states.push(*x);
        }
        if !self.with_peaks {
            return;
        }
        let everywhere = self.windows.lit(0.0).0.less(self.windows.0);
        if let (_, Some(channels)) = self.model.observe(forcing, x, dx, true) {
            if k == 0 {
                self.peaks.begin(&channels, everywhere);
            } else {
                self.peaks.advance(self.clock.step_s, &channels, everywhere);
            }
        }
    }
}

//! The period map: what one turn at a constant speed makes of a state, points in lanes.
//!
//! It is a turn of the machine with capped modes, which leave exact what turns with the drum
//! (`coupling.rs`), by classical Runge-Kutta in few steps. What returns to itself is looked for by
//! `search.rs` at one speed, and followed over speed by `branch.rs`.

use super::monodromy::{Along, INSTANTS, Square, weights};
use super::stepwise::Stepwise;
use super::turn::{Clock, Watch, turn};
use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::machine::spin::SpinStretch;
use crate::nonlinear::coupling::{Caps, Coupling};
use crate::nonlinear::elements::corners::CornerForce;
use crate::nonlinear::outputs::squared;
use crate::point::Point;
use crate::ready::{MAX_RUNS, Search, own};
use crate::run::active_recorders::{ActiveRecorders, ObservedState};
use crate::run::all_lanes;
use crate::run::model::{LaneModel, Linear, Nonlinear};
use crate::run::suspension::damper_speeds_m_per_s;
use core::array::from_fn;
use lane_ode::rk4::RK4_STABILITY_LIMIT;
use lane_ode::{Aside, Cancel, Kernel, Lane, Lu, N, Peaks, Simd};

/// Step times cap, as a share of the formula's limit. Gyroscopic effects may make whirls of the
/// capped hinge faster than its cap.
const CAP_SHARE: f64 = 0.7;

/// The nepers that a turn's steps take off the hinge's speeds, where derivatives are those of the
/// steps, as where responses with corners are followed: 2 % of its swing is left. Where it is in
/// tune with a multiple of the drum's speed, hits of stops would make it swing so far that the
/// curve is not followed over it.
const OFF_HINGE: f64 = 8.0;

/// A point at a constant speed.
#[derive(Clone, Copy)]
pub(crate) struct Row<'a> {
    pub(crate) point: &'a Point,
    pub(crate) speed_rpm: f64,
    /// Steps of a turn.
    pub(crate) steps: usize,
    /// Even instants of it at which derivatives are taken; as many as steps: those of the steps.
    pub(crate) instants: usize,
    /// On the modes of bearings and hinge; none if the steps follow these.
    pub(crate) caps: Option<Caps>,
}

/// The properties that rows share that turn side by side.
pub(crate) type Kind = (usize, usize, bool, bool);

impl Row<'_> {
    /// Returns the row at another speed close by, with the steps and caps of this one as shares of
    /// a turn.
    pub(super) fn beside(self, speed_rpm: f64) -> Self {
        let caps = self.caps.map(|_| caps(self.steps, 60.0 / speed_rpm));
        Self { speed_rpm, caps, ..self }
    }

    pub(crate) fn turn_s(&self) -> f64 {
        60.0 / self.speed_rpm
    }

    pub(super) fn step_s(&self) -> f64 {
        self.turn_s() / self.steps as f64
    }

    /// Disturbances' speeds count per this: a rate that makes the fastest of them of one size with
    /// the coordinates.
    pub(crate) fn unit_per_s(&self) -> f64 {
        1.0 / self.step_s()
    }

    /// Whether derivatives are those of the steps themselves.
    pub(super) fn is_stepwise(&self) -> bool {
        self.instants == self.steps
    }

    /// Whether forces have corners.
    pub(super) fn has_corners(&self) -> bool {
        self.point.machine.elements.are_nonsmooth()
    }

    pub(crate) fn kind(&self) -> Kind {
        (self.steps, self.instants, self.caps.is_some(), self.has_corners())
    }
}

/// A turn that is asked for.
#[derive(Clone, Copy)]
pub(crate) struct Asked<'a> {
    pub(crate) row: Row<'a>,
    /// The state where the unbalance is up: coordinates (m, rad), then their speeds (per s).
    pub(crate) start: [f64; STATES],
    /// Whether to see all of it, not its end alone.
    pub(crate) is_seen: bool,
}

/// A turn.
pub(crate) struct Turned {
    /// The state at its end.
    pub(crate) end: [f64; STATES],
    /// The record, if one was asked for.
    pub(crate) seen: Option<Box<Seen>>,
}

/// The record of a turn.
pub(crate) struct Seen {
    /// The monodromy matrix.
    pub(crate) monodromy: Square,
    /// Largest deviations from equilibrium (m, rad).
    pub(crate) peaks: [f64; CHANNELS],
    /// Least gap between drum and tub at the ends of its steps (m).
    pub(crate) gap_m: f64,
    /// States at even instants.
    pub(crate) states: Vec<[f64; STATES]>,
}

/// Takes turns, in lanes, those of a kind together. What is found of one does not depend on the
/// others. Once `cancel` is requested, some are missing.
pub(crate) fn turns(asked: &[Asked<'_>], cancel: Cancel<'_>) -> Vec<Turned> {
    // Turns of a kind that are seen come first.
    let kind = |asked: &Asked<'_>| (asked.row.kind(), !asked.is_seen);
    by_kind(asked, kind, |asked| {
        let turns = Turns { asked, cancel };
        // Wide lanes that are mostly empty take longer than narrow ones.
        let is_few = asked.len() <= Simd::narrow().lanes();
        // Rows that differentiate their steps fill all lanes with disturbances, even for one turn.
        let is_filled = asked.iter().any(|asked| asked.is_seen && asked.row.is_stepwise());
        if is_few && !is_filled {
            Simd::dispatch_narrow(turns)
        } else {
            Simd::best().dispatch(turns)
        }
    })
}

/// Computes what is asked of each: of those of a row's kind together, which come in the order of
/// `kind`'s second part. What is missing of some is missing at the end.
pub(crate) fn by_kind<A: Copy, R>(
    all: &[A],
    kind: impl Fn(&A) -> (Kind, bool),
    find: impl Fn(&[A]) -> Vec<R>,
) -> Vec<R> {
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by_key(|&k| kind(&all[k]));
    let mut found: Vec<Option<R>> = all.iter().map(|_| None).collect();
    for places in order.chunk_by(|&a, &b| kind(&all[a]).0 == kind(&all[b]).0) {
        let together: Vec<A> = places.iter().map(|&k| all[k]).collect();
        for (&k, one) in places.iter().zip(find(&together)) {
            found[k] = Some(one);
        }
    }
    found.into_iter().flatten().collect()
}

/// Integrations over a turn, all of one model and kind of step.
struct Turns<'a> {
    asked: &'a [Asked<'a>],
    cancel: Cancel<'a>,
}

impl Kernel for Turns<'_> {
    type Output = Vec<Turned>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let mut turned = Vec::with_capacity(self.asked.len());
        let Some(first) = self.asked.first() else { return turned };
        let Row { steps, instants, .. } = first.row;
        let is_weighed = first.is_seen && !first.row.is_stepwise();
        let weights = if is_weighed { weights(steps, instants) } else { Vec::new() };
        for asked in self.asked.chunks(T::LANES) {
            if self.cancel.is_requested() {
                break;
            }
            see(N(zero), asked, &weights, &mut turned);
        }
        turned
    }
}

/// Returns the caps that so many steps a turn allow.
pub(super) fn caps(steps: usize, turn_s: f64) -> Caps {
    let cap = CAP_SHARE * RK4_STABILITY_LIMIT * steps as f64 / turn_s;
    Caps { bearings_rad_per_s: cap, hinge_rad_per_s: Some(cap) }
}

/// Returns a model with each row in its lane, and the last in those that are left over.
#[inline(always)]
pub(crate) fn model<T: Lane, M: LaneModel<T>>(zero: N<T>, rows: &[Row<'_>]) -> M {
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

/// Returns the clock of rows in lanes, the last in those that are left over.
#[inline(always)]
pub(crate) fn clock<T: Lane>(zero: N<T>, rows: &[Row<'_>]) -> Clock<T> {
    let kept = || libm::exp(-OFF_HINGE / rows[0].steps as f64);
    let hinge_kept = rows[0].is_stepwise().then(kept);
    let mut clock = Clock { step_s: zero, steps: rows[0].steps, hinge_kept };
    for lane in 0..T::LANES {
        clock.step_s.0.set(lane, rows[lane.min(rows.len() - 1)].step_s());
    }
    clock
}

#[inline(always)]
fn see<T: Lane>(zero: N<T>, asked: &[Asked<'_>], weights: &[Vec<f64>], turned: &mut Vec<Turned>) {
    let rows: Vec<Row<'_>> = asked.iter().map(|asked| asked.row).collect();
    let clock = clock(zero, &rows);
    let model: Nonlinear<T> = model(zero, &rows);
    let mut ends = [[zero; STATES]];
    for lane in 0..T::LANES {
        for i in 0..STATES {
            ends[0][i].0.set(lane, asked[lane.min(asked.len() - 1)].start[i]);
        }
    }
    let seen = asked.iter().filter(|asked| asked.is_seen).count();
    let mut watched = Watched::new(zero, &model, &clock);
    if !rows[0].is_stepwise() {
        watched.with_corners = rows[0].has_corners();
        watched.instants = rows[0].instants.max(INSTANTS);
    }
    turn(&model, &clock, &mut ends, if seen > 0 { Some(&mut watched) } else { None });
    let mut monodromies: Vec<Square> = Vec::new();
    if rows[0].is_stepwise() {
        for Asked { row, start, .. } in &asked[..seen] {
            let constant = zero.constant();
            let row = [*row];
            let model = self::model(constant, &row);
            let clock = self::clock(constant, &row);
            monodromies.push(zero.0.aside(Stepwise { zero, model, clock, start: *start }));
        }
    } else if seen > 0 {
        let spread: Vec<Row<'_>> = rows[..seen].iter().copied().cycle().take(T::LANES).collect();
        let along = Along {
            zero,
            weights,
            model: self::model(zero.constant(), &spread),
            clock: self::clock(zero, &spread),
            rows: seen,
            instants: rows[0].instants,
            path: &watched.states[..watched.instants],
            forces: &watched.forces,
        };
        monodromies = zero.0.aside(along);
    }
    let in_lane = |state: &[N<T>; STATES], lane: usize| -> [f64; STATES] {
        from_fn(|i| state[i].0.get(lane))
    };
    for (lane, asked) in asked.iter().enumerate() {
        let seen = asked.is_seen.then(|| {
            let clearance_m = asked.row.point.clearance_m();
            Box::new(Seen {
                monodromy: monodromies[lane],
                peaks: watched.peaks.lane(lane),
                gap_m: clearance_m - watched.radial_squared.0.get(lane).sqrt(),
                states: watched.states.iter().map(|state| in_lane(state, lane)).collect(),
            })
        });
        turned.push(Turned { end: in_lane(&ends[0], lane), seen });
    }
}

/// The linear model's response to a constant speed.
pub(super) struct LinearResponse {
    /// Deviations and their speeds where the unbalance is up; not finite where there is none.
    pub(super) start: [f64; STATES],
    /// Largest deviations from equilibrium (m, rad).
    pub(super) peaks: [f64; CHANNELS],
    /// Deviations and their speeds at even instants, [`INSTANTS`] to a turn.
    states: Vec<[f64; STATES]>,
}

impl LinearResponse {
    /// Returns the speed amplitudes (m/s) of dampers.
    fn damper_speeds_m_per_s(&self, point: &Point) -> Vec<f64> {
        let at = |state| damper_speeds_m_per_s(point, state);
        let along: Vec<Vec<f64>> = self.states[..INSTANTS].iter().map(at).collect();
        let squares = |k: usize| along.iter().map(|speeds| speeds[k] * speeds[k]).sum::<f64>();
        (0..along[0].len()).map(|k| (2.0 * squares(k) / INSTANTS as f64).sqrt()).collect()
    }
}

/// Returns the linear model's responses. Where the speeds at which it takes friction are the
/// motion's own, they are those of the response. Once `is_stopped` says so, some are missing.
pub(super) fn linear_responses(rows: &[Row<'_>], cancel: Cancel<'_>) -> Vec<LinearResponse> {
    let mut found = together(rows, cancel);
    let searched = |(k, row): (usize, &Row<'_>)| Some((k, Search::from_least(row.point)?));
    let mut open: Vec<(usize, Search)> = rows.iter().enumerate().filter_map(searched).collect();
    for _ in 0..MAX_RUNS {
        let at_speeds = |(k, search): &(usize, Search)| {
            rows[*k].point.with_own_friction_speeds(&search.speeds_m_per_s())
        };
        let points: Vec<Point> = open.iter().map(at_speeds).collect();
        let asked = open.iter().zip(&points).map(|((k, _), point)| Row { point, ..rows[*k] });
        let responses = together(&asked.collect::<Vec<_>>(), cancel);
        if cancel.is_requested() {
            break;
        }
        let mut left = Vec::new();
        for (((k, mut search), point), response) in open.into_iter().zip(&points).zip(responses) {
            if !search.update(&own(point, &response.damper_speeds_m_per_s(point))) {
                left.push((k, search));
            }
            found[k] = response;
        }
        open = left;
    }
    found
}

/// Computes the responses with friction taken at the points' speeds, in lanes, those of a kind
/// together.
pub(super) fn together(rows: &[Row<'_>], cancel: Cancel<'_>) -> Vec<LinearResponse> {
    let find = |rows: &[Row<'_>]| Simd::dispatch_narrow(OfLinear { rows, cancel });
    by_kind(rows, |row| (row.kind(), false), find)
}

/// Computes the linear responses of rows of one kind. The map over a turn is affine, so one linear
/// solve finds its fixed point.
struct OfLinear<'a> {
    rows: &'a [Row<'a>],
    cancel: Cancel<'a>,
}

impl Kernel for OfLinear<'_> {
    type Output = Vec<LinearResponse>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let mut found = Vec::with_capacity(self.rows.len());
        for rows in self.rows.chunks(T::LANES) {
            if self.cancel.is_requested() {
                break;
            }
            linear(N(zero), rows, &mut found);
        }
        found
    }
}

#[inline(always)]
fn linear<T: Lane>(zero: N<T>, rows: &[Row<'_>], found: &mut Vec<LinearResponse>) {
    let clock = clock(zero, rows);
    let model: Linear<T> = model(zero, rows);
    // From rest, then from a unit of each coordinate and speed.
    let mut ends = vec![[zero; STATES]; 1 + STATES];
    for j in 0..STATES {
        ends[1 + j][j] = zero.lit(1.0);
    }
    let mut start = [zero; STATES];
    // The second time around it is watched. A loop, for one copy of the model's code.
    for is_known in [false, true] {
        if is_known {
            ends.truncate(1);
            ends[0] = start;
        }
        let mut watched = Watched::new(zero, &model, &clock);
        turn(&model, &clock, &mut ends, if is_known { Some(&mut watched) } else { None });
        for lane in 0..rows.len() {
            if is_known {
                found.push(LinearResponse {
                    start: from_fn(|i| start[i].0.get(lane)),
                    peaks: watched.peaks.lane(lane),
                    states: watched.states.iter().map(|x| from_fn(|i| x[i].0.get(lane))).collect(),
                });
                continue;
            }
            let mut apart = [[N(0.0); STATES]; STATES];
            let mut reached = [N(0.0); STATES];
            for i in 0..STATES {
                reached[i] = N(ends[0][i].0.get(lane));
                for j in 0..STATES {
                    apart[i][j] = reached[i] - N(ends[1 + j][i].0.get(lane));
                }
                apart[i][i] = apart[i][i] + 1.0;
            }
            let returns = Lu::new(apart).map(|factors| factors.solve(&reached));
            for i in 0..STATES {
                start[i].0.set(lane, returns.as_ref().map_or(f64::NAN, |state| state[i].0));
            }
        }
    }
}

/// The record of a turn in the making.
pub(crate) struct Watched<'m, T, M> {
    model: &'m M,
    clock: &'m Clock<T>,
    /// The number of equally spaced instants in a turn.
    instants: usize,
    /// Whether to keep states at these.
    pub(crate) with_states: bool,
    pub(crate) peaks: Peaks<T, CHANNELS>,
    /// The greatest distance of the drum from the tub's axis, squared (m^2).
    pub(crate) radial_squared: N<T>,
    /// The states at these instants, the first at the turn's start.
    states: Vec<[N<T>; STATES]>,
    /// Forces with corners at the start, middle and end of all steps, if these are wanted.
    forces: Vec<CornerForce<T>>,
    with_corners: bool,
    /// The last state seen, and its slope.
    before: [[N<T>; STATES]; 2],
    /// Further records.
    pub(crate) extras: Option<ActiveRecorders<T>>,
}

impl<'m, T: Lane, M: LaneModel<T>> Watched<'m, T, M> {
    #[inline(always)]
    pub(crate) fn new(zero: N<T>, model: &'m M, clock: &'m Clock<T>) -> Self {
        Self {
            model,
            clock,
            instants: INSTANTS,
            with_states: true,
            peaks: Peaks::new(zero),
            radial_squared: zero,
            states: Vec::new(),
            forces: Vec::new(),
            with_corners: false,
            before: [[zero; STATES]; 2],
            extras: None,
        }
    }
}

/// Forces with corners at a state.
struct Cornered<'a, T, M> {
    model: &'a M,
    x: &'a [N<T>; STATES],
    forces: &'a mut Vec<CornerForce<T>>,
}

impl<T: Lane, M: LaneModel<T>> Aside for Cornered<'_, T, M> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.model.corner_forces(self.x, self.forces);
    }
}

impl<'m, T: Lane, M: LaneModel<T>> Watch<T, M> for Watched<'m, T, M> {
    #[inline(always)]
    fn see(&mut self, k: usize, forcing: &M::Forcing, x: &[N<T>; STATES], dx: &[N<T>; STATES]) {
        if self.with_states && k.is_multiple_of(self.clock.steps / self.instants) {
            self.states.push(*x);
        }
        if self.with_corners {
            if k > 0 {
                let [start, rate] = &self.before;
                let eighth = (self.clock.step_s * 0.125).v();
                let mut middle = *x;
                for i in 0..STATES {
                    middle[i] = (0.5 * (start[i] + x[i])).v() + eighth * (rate[i] - dx[i]);
                }
                x[0].0.aside(Cornered { model: self.model, x: &middle, forces: &mut self.forces });
            }
            x[0].0.aside(Cornered { model: self.model, x, forces: &mut self.forces });
            self.before = [*x, *dx];
        }
        let everywhere = all_lanes(x[0]);
        if let (radial, Some(channels)) = self.model.observe(forcing, x, dx, true) {
            if k == 0 {
                self.peaks.begin(&channels, everywhere);
            } else {
                self.peaks.advance(self.clock.step_s, &channels, everywhere);
            }
            if let Some(extras) = &mut self.extras {
                let step = if k == 0 {
                    None
                } else {
                    Some((self.clock.time_s(k as f64), self.clock.step_s))
                };
                x[0].0.aside(ObservedState {
                    recorders: extras,
                    step,
                    x,
                    dx,
                    radial: &radial,
                    channels: &channels,
                    lanes_in_window: everywhere,
                });
            }
            let most = self.radial_squared.0;
            let here = squared(&radial).value.0;
            self.radial_squared = N(T::select(most.less(here), here, most));
        }
    }
}

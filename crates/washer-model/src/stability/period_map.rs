//! The period map: the state after one turn at a constant speed, for many points in lanes.
//!
//! The turn is integrated by classical Runge-Kutta in few steps, with capped modes, which do not
//! change motions that turn with the drum (`coupling.rs`). `newton.rs` finds fixed points of the
//! map at one speed, and `continuation.rs` continues them over speed.

use super::monodromy::{INSTANTS_PER_TURN, SmoothMonodromy, StateMatrix, interpolation_weights};
use super::stepwise_monodromy::StepwiseMonodromy;
use super::turn::{StepGrid, StepObserver, integrate_turn};
use crate::channel::CHANNELS;
use crate::coordinates::STATES;
use crate::machine::spin::SpinSegment;
use crate::nonlinear::coupling::{Caps, Coupling};
use crate::nonlinear::elements::corners::CornerForce;
use crate::nonlinear::outputs::squared_distance;
use crate::point::Point;
use crate::preparation::{MAX_LINEAR_RUNS, SpeedAmplitudeSearch, select_motion_speeds};
use crate::run::active_recorders::{ActiveRecorders, ObservedState};
use crate::run::all_lanes;
use crate::run::model::{LaneModel, LinearModel, NonlinearModel};
use crate::run::suspension::damper_speeds_m_per_s;
use core::array::from_fn;
use lane_ode::rk4::RK4_STABILITY_LIMIT;
use lane_ode::{Cancel, Kernel, Lane, Lu, N, OutOfLine, Peaks, Simd};

/// The product of step and cap, as a share of the formula's limit of stability. Basis: gyroscopic
/// effects may make whirls of the capped hinge faster than its cap. Doubling it is unstable.
const CAP_STABILITY_SHARE: f64 = 0.7;

/// The logarithmic decrement that a turn adds to the hinge's speeds if the steps themselves are
/// differentiated, as in the continuation of responses with corners. Basis: without damping,
/// impacts on stops excite a hinge in resonance with a harmonic of the drum's speed so strongly
/// that the continuation ends. With it, 2 % of the hinge's speed remain after a turn; doubling it
/// leaves 0.04 %.
const HINGE_DAMPING_PER_TURN: f64 = 8.0;

/// A point at a constant speed, and the discretisation of its turns.
#[derive(Clone, Copy)]
pub(crate) struct TurnSetup<'a> {
    pub(crate) point: &'a Point,
    pub(crate) speed_rpm: f64,
    /// The number of integration steps of a turn.
    pub(crate) step_count: usize,
    /// The number of equally spaced instants of a turn at which partial derivatives are computed.
    /// If it equals the number of steps, the steps themselves are differentiated.
    pub(crate) instant_count: usize,
    /// The caps of the modes of bearings and hinge; `None` if the steps resolve these modes.
    pub(crate) caps: Option<Caps>,
    /// The least width (m) of the corners of stops and free strokes; 0 leaves them as they are.
    pub(crate) corner_width_m: f64,
}

/// The properties that all turns of a batch have in common: steps, instants, whether there are
/// caps, and whether forces have corners.
pub(crate) type BatchKey = (usize, usize, bool, bool);

impl TurnSetup<'_> {
    /// Returns the set-up at a nearby speed, with the same number of steps, caps that change in
    /// proportion to the speed, and corners that change in proportion to the step.
    pub(super) fn at_nearby_speed(self, speed_rpm: f64) -> Self {
        let caps = self.caps.map(|_| caps_for_steps(self.step_count, 60.0 / speed_rpm));
        let corner_width_m = self.corner_width_m * (self.speed_rpm / speed_rpm);
        Self { speed_rpm, caps, corner_width_m, ..self }
    }

    /// Returns the duration of a turn (s).
    pub(crate) fn turn_s(&self) -> f64 {
        60.0 / self.speed_rpm
    }

    /// Returns the length of a step (s).
    pub(super) fn step_s(&self) -> f64 {
        self.turn_s() / self.step_count as f64
    }

    /// Returns the unit (1/s) of the speeds of disturbances, with which speeds and coordinates of
    /// the fastest disturbances have the same magnitude.
    pub(crate) fn unit_per_s(&self) -> f64 {
        1.0 / self.step_s()
    }

    /// Whether derivatives are those of the discrete steps instead of those of the motion.
    pub(super) fn differentiates_steps(&self) -> bool {
        self.instant_count == self.step_count
    }

    /// Whether forces have corners.
    pub(super) fn has_corners(&self) -> bool {
        self.point.machine.elements.has_nonsmooth_force()
    }

    pub(crate) fn batch_key(&self) -> BatchKey {
        (self.step_count, self.instant_count, self.caps.is_some(), self.has_corners())
    }
}

/// A request to integrate a turn.
#[derive(Clone, Copy)]
pub(crate) struct TurnRequest<'a> {
    pub(crate) setup: TurnSetup<'a>,
    /// The state at which the unbalance is up: coordinates (m, rad), then their speeds (per s).
    pub(crate) start_state: [f64; STATES],
    /// Whether the result has a record in addition to the end of the turn.
    pub(crate) is_recorded: bool,
}

/// The result of the integration of a turn.
pub(crate) struct TurnResult {
    /// The state at the end.
    pub(crate) end_state: [f64; STATES],
    /// The record, if it was requested.
    pub(crate) record: Option<Box<OrbitRecord>>,
}

/// The record of a turn.
pub(crate) struct OrbitRecord {
    /// The monodromy matrix.
    pub(crate) monodromy: StateMatrix,
    /// The largest deviations from equilibrium (m, rad).
    pub(crate) peaks: [f64; CHANNELS],
    /// The least gap between drum and tub at the ends of steps (m).
    pub(crate) min_gap_m: f64,
    /// The states at equally spaced instants.
    pub(crate) states: Vec<[f64; STATES]>,
}

/// Integrates turns in lanes, those with the same [`BatchKey`] together. The result of a turn does
/// not depend on the other turns. Once `cancel` is requested, results at the end are missing.
pub(crate) fn compute_turns(requests: &[TurnRequest<'_>], cancel: Cancel<'_>) -> Vec<TurnResult> {
    // Recorded turns come first in a batch.
    let request_key = |request: &TurnRequest<'_>| (request.setup.batch_key(), !request.is_recorded);
    map_in_batches(requests, request_key, |requests| {
        let kernel = TurnKernel { requests, cancel };
        // Mostly empty wide lanes take longer than narrow lanes.
        let is_narrow_enough = requests.len() <= Simd::narrow_set().lanes();
        // The differentiation of steps fills all lanes with disturbances, even for one turn.
        let fills_lanes = requests
            .iter()
            .any(|request| request.is_recorded && request.setup.differentiates_steps());
        if is_narrow_enough && !fills_lanes {
            Simd::dispatch_narrow(kernel)
        } else {
            Simd::widest().dispatch(kernel)
        }
    })
}

/// Applies a function to batches of items with the same [`BatchKey`], and returns the results in
/// the order of the items. A batch is sorted by the second part of `key`. If the function returns
/// too few results, the last items of the batch have no results.
pub(crate) fn map_in_batches<A: Copy, R>(
    items: &[A],
    key: impl Fn(&A) -> (BatchKey, bool),
    compute: impl Fn(&[A]) -> Vec<R>,
) -> Vec<R> {
    let mut item_order: Vec<usize> = (0..items.len()).collect();
    item_order.sort_by_key(|&k| key(&items[k]));
    let mut results: Vec<Option<R>> = items.iter().map(|_| None).collect();
    for batch in item_order.chunk_by(|&a, &b| key(&items[a]).0 == key(&items[b]).0) {
        let batch_items: Vec<A> = batch.iter().map(|&k| items[k]).collect();
        for (&k, result) in batch.iter().zip(compute(&batch_items)) {
            results[k] = Some(result);
        }
    }
    results.into_iter().flatten().collect()
}

/// The integration of turns with the same [`BatchKey`].
struct TurnKernel<'a> {
    requests: &'a [TurnRequest<'a>],
    cancel: Cancel<'a>,
}

impl Kernel for TurnKernel<'_> {
    type Output = Vec<TurnResult>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let mut results = Vec::with_capacity(self.requests.len());
        let Some(first) = self.requests.first() else { return results };
        let TurnSetup { step_count, instant_count, .. } = first.setup;
        let needs_weights = first.is_recorded && !first.setup.differentiates_steps();
        let weights = if needs_weights {
            interpolation_weights(step_count, instant_count)
        } else {
            Vec::new()
        };
        for requests in self.requests.chunks(T::LANES) {
            if self.cancel.is_requested() {
                break;
            }
            integrate_batch(N(zero), requests, &weights, &mut results);
        }
        results
    }
}

/// Returns the highest caps that are stable with a number of steps a turn.
pub(super) fn caps_for_steps(step_count: usize, turn_s: f64) -> Caps {
    let cap_rad_per_s = CAP_STABILITY_SHARE * RK4_STABILITY_LIMIT * step_count as f64 / turn_s;
    Caps { bearings_rad_per_s: cap_rad_per_s, hinge_rad_per_s: Some(cap_rad_per_s) }
}

/// Returns a model with a set-up in each lane; surplus lanes repeat the last set-up.
#[inline(always)]
pub(crate) fn lane_model<T: Lane, M: LaneModel<T>>(zero: N<T>, setups: &[TurnSetup<'_>]) -> M {
    let coupling = Coupling::new(zero, setups[0].caps.as_ref());
    let mut model = M::splat(zero, setups[0].point, coupling);
    for lane in 0..T::LANES {
        let setup = &setups[lane.min(setups.len() - 1)];
        model.set_point(lane, setup.point);
        model.set_spin(lane, &SpinSegment::at_constant_speed(setup.speed_rpm));
        if let Some(caps) = &setup.caps {
            model.set_caps(lane, caps);
        }
        if setup.corner_width_m > 0.0 {
            model.widen_corners(lane, setup.corner_width_m);
        }
    }
    model
}

/// Returns the steps of the set-ups in lanes; surplus lanes repeat the last set-up.
#[inline(always)]
pub(crate) fn step_grid<T: Lane>(zero: N<T>, setups: &[TurnSetup<'_>]) -> StepGrid<T> {
    let damping_factor = || libm::exp(-HINGE_DAMPING_PER_TURN / setups[0].step_count as f64);
    let hinge_damping_factor = setups[0].differentiates_steps().then(damping_factor);
    let mut grid =
        StepGrid { step_s: zero, step_count: setups[0].step_count, hinge_damping_factor };
    for lane in 0..T::LANES {
        grid.step_s.0.set(lane, setups[lane.min(setups.len() - 1)].step_s());
    }
    grid
}

/// Integrates as many turns as there are lanes, and computes the monodromy matrices of recorded
/// turns.
#[inline(always)]
fn integrate_batch<T: Lane>(
    zero: N<T>,
    requests: &[TurnRequest<'_>],
    weights: &[Vec<f64>],
    results: &mut Vec<TurnResult>,
) {
    let setups: Vec<TurnSetup<'_>> = requests.iter().map(|request| request.setup).collect();
    let grid = step_grid(zero, &setups);
    let model: NonlinearModel<T> = lane_model(zero, &setups);
    let mut end_states = [[zero; STATES]];
    for lane in 0..T::LANES {
        for i in 0..STATES {
            end_states[0][i].0.set(lane, requests[lane.min(requests.len() - 1)].start_state[i]);
        }
    }
    let recorded_count = requests.iter().filter(|request| request.is_recorded).count();
    let mut recorder = TurnRecorder::new(zero, &model, &grid);
    if !setups[0].differentiates_steps() {
        recorder.records_corner_forces = setups[0].has_corners();
        recorder.instant_count = setups[0].instant_count.max(INSTANTS_PER_TURN);
    }
    integrate_turn(
        &model,
        &grid,
        &mut end_states,
        if recorded_count > 0 { Some(&mut recorder) } else { None },
    );
    let mut monodromy_matrices: Vec<StateMatrix> = Vec::new();
    if setups[0].differentiates_steps() {
        for TurnRequest { setup, start_state, .. } in &requests[..recorded_count] {
            let dual_zero = zero.constant();
            let setups = [*setup];
            let model = self::lane_model(dual_zero, &setups);
            let grid = self::step_grid(dual_zero, &setups);
            monodromy_matrices.push(zero.0.run_out_of_line(StepwiseMonodromy {
                zero,
                model,
                grid,
                start_state: *start_state,
            }));
        }
    } else if recorded_count > 0 {
        let repeated_setups: Vec<TurnSetup<'_>> =
            setups[..recorded_count].iter().copied().cycle().take(T::LANES).collect();
        let monodromy = SmoothMonodromy {
            zero,
            weights,
            model: self::lane_model(zero.constant(), &repeated_setups),
            grid: self::step_grid(zero, &repeated_setups),
            turn_count: recorded_count,
            instant_count: setups[0].instant_count,
            states: &recorder.states[..recorder.instant_count],
            corner_forces: &recorder.corner_forces,
        };
        monodromy_matrices = zero.0.run_out_of_line(monodromy);
    }
    let extract_lane = |state: &[N<T>; STATES], lane: usize| -> [f64; STATES] {
        from_fn(|i| state[i].0.get(lane))
    };
    for (lane, request) in requests.iter().enumerate() {
        let record = request.is_recorded.then(|| {
            let clearance_m = request.setup.point.clearance_m();
            Box::new(OrbitRecord {
                monodromy: monodromy_matrices[lane],
                peaks: recorder.peaks.lane_peaks(lane),
                min_gap_m: clearance_m - recorder.max_radial_squared.0.get(lane).sqrt(),
                states: recorder.states.iter().map(|state| extract_lane(state, lane)).collect(),
            })
        });
        results.push(TurnResult { end_state: extract_lane(&end_states[0], lane), record });
    }
}

/// The linear model's response to a constant speed.
pub(super) struct LinearResponse {
    /// The deviations and their speeds when the unbalance is up; not finite without a response.
    pub(super) state: [f64; STATES],
    /// The largest deviations from equilibrium (m, rad).
    pub(super) peaks: [f64; CHANNELS],
    /// The deviations and their speeds at [`INSTANTS_PER_TURN`] equally spaced instants of a turn.
    states: Vec<[f64; STATES]>,
}

impl LinearResponse {
    /// Returns the speed amplitudes (m/s) of dampers.
    fn damper_speeds_m_per_s(&self, point: &Point) -> Vec<f64> {
        let speeds_at = |state| damper_speeds_m_per_s(point, state);
        let damper_speeds: Vec<Vec<f64>> =
            self.states[..INSTANTS_PER_TURN].iter().map(speeds_at).collect();
        let sum_of_squares = |k: usize| {
            damper_speeds
                .iter()
                .map(|damper_speeds| damper_speeds[k] * damper_speeds[k])
                .sum::<f64>()
        };
        (0..damper_speeds[0].len())
            .map(|k| (2.0 * sum_of_squares(k) / INSTANTS_PER_TURN as f64).sqrt())
            .collect()
    }
}

/// Returns the linear model's responses. The friction of dampers without a given speed amplitude is
/// linearised at the amplitude of the response itself. Once `cancel` is requested, responses are
/// missing or not final.
pub(super) fn linear_responses_with_motion_friction(
    setups: &[TurnSetup<'_>],
    cancel: Cancel<'_>,
) -> Vec<LinearResponse> {
    let mut responses = solve_linear_responses(setups, cancel);
    let new_search = |(k, setup): (usize, &TurnSetup<'_>)| {
        Some((k, SpeedAmplitudeSearch::from_min_speeds(setup.point)?))
    };
    let mut unfinished_searches: Vec<(usize, SpeedAmplitudeSearch)> =
        setups.iter().enumerate().filter_map(new_search).collect();
    for _ in 0..MAX_LINEAR_RUNS {
        let point_at_speeds = |(k, search): &(usize, SpeedAmplitudeSearch)| {
            setups[*k].point.with_motion_friction_speeds(&search.speeds_m_per_s())
        };
        let points: Vec<Point> = unfinished_searches.iter().map(point_at_speeds).collect();
        let requests = unfinished_searches
            .iter()
            .zip(&points)
            .map(|((k, _), point)| TurnSetup { point, ..setups[*k] });
        let batch_responses = solve_linear_responses(&requests.collect::<Vec<_>>(), cancel);
        if cancel.is_requested() {
            break;
        }
        let mut next_searches = Vec::new();
        for (((k, mut search), point), response) in
            unfinished_searches.into_iter().zip(&points).zip(batch_responses)
        {
            if !search.update(&select_motion_speeds(point, &response.damper_speeds_m_per_s(point)))
            {
                next_searches.push((k, search));
            }
            responses[k] = response;
        }
        unfinished_searches = next_searches;
    }
    responses
}

/// Computes the linear model's responses in lanes, with friction linearised at the speed amplitudes
/// of the points.
pub(super) fn solve_linear_responses(
    setups: &[TurnSetup<'_>],
    cancel: Cancel<'_>,
) -> Vec<LinearResponse> {
    let compute_batch =
        |setups: &[TurnSetup<'_>]| Simd::dispatch_narrow(LinearKernel { setups, cancel });
    map_in_batches(setups, |setup| (setup.batch_key(), false), compute_batch)
}

/// The computation of the linear responses of set-ups with the same [`BatchKey`]. The period map is
/// affine, so that one linear solve finds its fixed point.
struct LinearKernel<'a> {
    setups: &'a [TurnSetup<'a>],
    cancel: Cancel<'a>,
}

impl Kernel for LinearKernel<'_> {
    type Output = Vec<LinearResponse>;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Self::Output {
        let mut responses = Vec::with_capacity(self.setups.len());
        for setups in self.setups.chunks(T::LANES) {
            if self.cancel.is_requested() {
                break;
            }
            solve_linear_batch(N(zero), setups, &mut responses);
        }
        responses
    }
}

/// Computes as many linear responses as there are lanes.
#[inline(always)]
fn solve_linear_batch<T: Lane>(
    zero: N<T>,
    setups: &[TurnSetup<'_>],
    responses: &mut Vec<LinearResponse>,
) {
    let grid = step_grid(zero, setups);
    let model: LinearModel<T> = lane_model(zero, setups);
    // The first turn starts from rest, the others from a unit of each coordinate and speed.
    let mut end_states = vec![[zero; STATES]; 1 + STATES];
    for j in 0..STATES {
        end_states[1 + j][j] = zero.lit(1.0);
    }
    let mut start_state = [zero; STATES];
    // The turn from the fixed point is recorded. The loop compiles to a single copy of the model's
    // code.
    for is_from_fixed_point in [false, true] {
        if is_from_fixed_point {
            end_states.truncate(1);
            end_states[0] = start_state;
        }
        let mut recorder = TurnRecorder::new(zero, &model, &grid);
        integrate_turn(
            &model,
            &grid,
            &mut end_states,
            if is_from_fixed_point { Some(&mut recorder) } else { None },
        );
        for lane in 0..setups.len() {
            if is_from_fixed_point {
                responses.push(LinearResponse {
                    state: from_fn(|i| start_state[i].0.get(lane)),
                    peaks: recorder.peaks.lane_peaks(lane),
                    states: recorder.states.iter().map(|x| from_fn(|i| x[i].0.get(lane))).collect(),
                });
                continue;
            }
            let mut matrix = [[N(0.0); STATES]; STATES];
            let mut end_from_rest = [N(0.0); STATES];
            for i in 0..STATES {
                end_from_rest[i] = N(end_states[0][i].0.get(lane));
                for j in 0..STATES {
                    matrix[i][j] = end_from_rest[i] - N(end_states[1 + j][i].0.get(lane));
                }
                matrix[i][i] = matrix[i][i] + 1.0;
            }
            let fixed_point = Lu::new(matrix).map(|factors| factors.solve(&end_from_rest));
            for i in 0..STATES {
                start_state[i]
                    .0
                    .set(lane, fixed_point.as_ref().map_or(f64::NAN, |state| state[i].0));
            }
        }
    }
}

/// An observer that records a turn.
pub(crate) struct TurnRecorder<'m, T, M> {
    model: &'m M,
    grid: &'m StepGrid<T>,
    /// The number of equally spaced instants in a turn.
    instant_count: usize,
    /// Whether to record the states at these instants.
    pub(crate) records_states: bool,
    pub(crate) peaks: Peaks<T, CHANNELS>,
    /// The square of the greatest distance of the drum from the tub's axis (m^2).
    pub(crate) max_radial_squared: N<T>,
    /// The states at the equally spaced instants, the first at the turn's start.
    states: Vec<[N<T>; STATES]>,
    /// The forces with corners at the start, middle and end of all steps, if they are recorded.
    corner_forces: Vec<CornerForce<T>>,
    records_corner_forces: bool,
    /// The last observed state, and its slope.
    last_sample: [[N<T>; STATES]; 2],
    /// The further recorders that the caller has requested.
    pub(crate) further_recorders: Option<ActiveRecorders<T>>,
}

impl<'m, T: Lane, M: LaneModel<T>> TurnRecorder<'m, T, M> {
    #[inline(always)]
    pub(crate) fn new(zero: N<T>, model: &'m M, grid: &'m StepGrid<T>) -> Self {
        Self {
            model,
            grid,
            instant_count: INSTANTS_PER_TURN,
            records_states: true,
            peaks: Peaks::new(zero),
            max_radial_squared: zero,
            states: Vec::new(),
            corner_forces: Vec::new(),
            records_corner_forces: false,
            last_sample: [[zero; STATES]; 2],
            further_recorders: None,
        }
    }
}

/// The evaluation of the forces with corners at a state.
struct CornerForcesAtState<'a, T, M> {
    model: &'a M,
    x: &'a [N<T>; STATES],
    corner_forces: &'a mut Vec<CornerForce<T>>,
}

impl<T: Lane, M: LaneModel<T>> OutOfLine for CornerForcesAtState<'_, T, M> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.model.append_corner_forces(self.x, self.corner_forces);
    }
}

impl<'m, T: Lane, M: LaneModel<T>> StepObserver<T, M> for TurnRecorder<'m, T, M> {
    #[inline(always)]
    fn observe(&mut self, k: usize, forcing: &M::Forcing, x: &[N<T>; STATES], dx: &[N<T>; STATES]) {
        if self.records_states && k.is_multiple_of(self.grid.step_count / self.instant_count) {
            self.states.push(*x);
        }
        if self.records_corner_forces {
            if k > 0 {
                let [start_state, rate] = &self.last_sample;
                let eighth_step = (self.grid.step_s * 0.125).v();
                let mut middle_state = *x;
                for i in 0..STATES {
                    middle_state[i] =
                        (0.5 * (start_state[i] + x[i])).v() + eighth_step * (rate[i] - dx[i]);
                }
                x[0].0.run_out_of_line(CornerForcesAtState {
                    model: self.model,
                    x: &middle_state,
                    corner_forces: &mut self.corner_forces,
                });
            }
            x[0].0.run_out_of_line(CornerForcesAtState {
                model: self.model,
                x,
                corner_forces: &mut self.corner_forces,
            });
            self.last_sample = [*x, *dx];
        }
        let all_lanes_mask = all_lanes(x[0]);
        if let (radial_position, Some(channels)) = self.model.observe(forcing, x, dx, true) {
            if k == 0 {
                self.peaks.begin(&channels, all_lanes_mask);
            } else {
                self.peaks.advance(self.grid.step_s, &channels, all_lanes_mask);
            }
            if let Some(further_recorders) = &mut self.further_recorders {
                let radial_position = &radial_position;
                let channels = &channels;
                let step = if k == 0 {
                    None
                } else {
                    Some((self.grid.time_s(k as f64), self.grid.step_s))
                };
                x[0].0.run_out_of_line(ObservedState {
                    recorders: further_recorders,
                    step,
                    x,
                    dx,
                    radial_position,
                    channels,
                    lanes_in_window: all_lanes_mask,
                });
            }
            let max_squared = self.max_radial_squared.0;
            let radial_squared = squared_distance(&radial_position).value.0;
            self.max_radial_squared =
                N(T::select(max_squared.less(radial_squared), radial_squared, max_squared));
        }
    }
}

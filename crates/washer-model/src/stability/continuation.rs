//! Continues the periodic response over the drum's speed: from a low speed up and round the folds,
//! or from a high speed down.
//!
//! The curve of states and speeds, scaled by units, is continued by pseudo-arclength (Keller 1977).
//! The predictor of second order follows the tangent and its change; Newton's method corrects the
//! point in the plane across the tangent. Steps grow if few corrections are needed and shrink if
//! many are. The curve depends on the machine alone. At a requested speed, the responses are those
//! on the part of the curve before it first reaches [`OVERSHOOT_RATIO`] times the speed. If the
//! curve ends at a lower speed, a second curve is continued from a high speed down, and has further
//! responses.

use super::monodromy::{INSTANTS_PER_TURN, StateMatrix};
use super::newton::{
    PeriodMapSearch, factor_fixed_point_equations, factor_matrix, relative_residual,
};
use super::period_map::{TurnRequest, TurnResult};
use super::settings::Settings;
use crate::coordinates::{COORDINATES, STATES};
use lane_ode::{Lu, N};

/// The dimension of the curve's points: coordinates, their speeds, and the drum's speed.
const CURVE_DIMENSION: usize = STATES + 1;

/// The index of the logarithm of the drum's speed in a point of the curve.
const LOG_SPEED_INDEX: usize = STATES;

/// The unit of coordinates in a point of the curve (m, rad). Doubling it halves their weight in the
/// arclength.
const COORDINATE_UNIT: f64 = 0.01;

/// The unit of speeds in a point of the curve, over [`COORDINATE_UNIT`] (1/s).
const SPEED_UNIT_PER_S: f64 = 10.0;

/// The unit of the logarithm of the drum's speed in a point of the curve. Doubling it halves the
/// weight of the speed in the arclength.
const LOG_SPEED_UNIT: f64 = 0.02;

/// The ratio of speeds up to which the curve is searched for responses: the part of the curve after
/// it first reaches this ratio times a speed has no responses at that speed.
pub(super) const OVERSHOOT_RATIO: f64 = 1.25;

/// The length of the first step. Basis: a centimetre, or 2 % of the speed. Doubling it makes the
/// first step fail more often.
const FIRST_STEP_LENGTH: f64 = 1.0;
/// The length of the longest step, which no correction exceeds. Basis: longer steps are rejected
/// because the tangent turns too much. Doubling it saves time on few curves.
const MAX_STEP_LENGTH: f64 = 4.0;
/// The length of the shortest step, after which the curve is lost. Basis: ten halvings. Doubling it
/// loses curves at narrow folds.
const MIN_STEP_LENGTH: f64 = 1e-3;

/// The step length below which derivatives are computed at all instants of a turn, until a step has
/// the greatest length again. Derivatives at few instants may be the reason for short steps.
const ALL_INSTANTS_STEP_LENGTH: f64 = 0.5;

/// The factor by which the step grows after few corrections. Basis: steps of most curves have the
/// longest length. Doubling it makes more steps fail.
const STEP_INCREASE_FACTOR: f64 = 1.6;
/// The greatest number of corrections after which the step grows. Basis: a curve that hardly bends
/// takes four. Doubling it makes all steps longer until they fail.
const MAX_CORRECTIONS_TO_GROW: usize = 4;

/// The factor by which the step shrinks after many corrections. Basis: it halves the bend of the
/// curve within a step.
/// Doubling it makes steps longer.
const STEP_DECREASE_FACTOR: f64 = 0.7;
/// The least number of corrections after which the step shrinks. Basis: one more than the number
/// after which the length does not change. Doubling it shortens no step.
const MIN_CORRECTIONS_TO_SHRINK: usize = 6;

/// The greatest number of corrections, after which the step is repeated with half its length.
/// Basis: a step that converges takes fewer. Doubling it wastes turns.
const MAX_CORRECTIONS: usize = 9;

/// The greatest ratio of successive residuals with which the Jacobian is used again. Doubling it
/// uses a Jacobian as long as the residual does not grow.
const MAX_RESIDUAL_RATIO: f64 = 0.5;

/// The greatest relative residual of a node. Basis: a thousandth of the greatest distance of
/// guesses. Doubling it saves less than a correction.
const NODE_TOLERANCE: f64 = 1e-7;

/// The least cosine of the angle between the tangents of successive nodes; a step with a sharper
/// turn is rejected.
const MIN_TANGENT_COSINE: f64 = 0.8;

/// The greatest distance of a node from its predicted point, as a share of the node's distance from
/// the last node. A step with a greater ratio is rejected, because its node may be on another part
/// of the curve.
const MAX_CORRECTION_SHARE: f64 = 0.5;

/// The greatest distance between a node and its predicted point at which a tangent from derivatives
/// at the predicted point counts as the node's tangent.
const MAX_OWN_TANGENT_DISTANCE: f64 = 1e-3;

/// The relative difference of speeds for the derivative of the period map by the speed. Doubling it
/// doubles the truncation error and halves the rounding error of the derivative.
const RELATIVE_SPEED_DIFFERENCE: f64 = 1e-5;

/// The relative error of a fold's speed. Basis: below the digits that files have. Doubling it saves
/// less than one iteration.
const FOLD_TOLERANCE: f64 = 1e-6;
/// The greatest number of iterations that locate a fold. Basis: each iteration squares the error.
/// Doubling it changes nothing.
const MAX_FOLD_ITERATIONS: usize = 5;

/// The relative difference of the speeds of two successive folds, times the number of steps of a
/// turn, below which both are spurious. If forces have corners, a small change of the speed moves a
/// corner into another step of the turn, so that the curve has stairs with spurious folds. Basis:
/// the stairs of a machine that hits a stop have differences up to 0.45. Doubling it removes narrow
/// folds of the machine.
const SPURIOUS_FOLD_TOLERANCE: f64 = 0.5;

/// The greatest distance (arclength) of the nodes beside a fold from the fold, where two branches
/// are close together and guesses must be accurate.
const MAX_NODE_DISTANCE_AT_FOLD: f64 = 0.3;

/// The greatest number of nodes of a curve. Doubling it doubles the time of curves that do not end.
const MAX_NODES: usize = 4000;

/// The number of nodes within which a smooth curve must advance by [`FIRST_STEP_LENGTH`], or it is
/// lost. Basis: a curve that approaches a singularity of a force, as of a spring that passes its
/// hook, advances ever more slowly. Doubling it doubles the time until such a curve ends.
const MAX_STALLED_NODES: usize = 100;

/// The magnitude of a coordinate (m, rad) beyond which a curve ends, because no machine moves that
/// far.
const MAX_COORDINATE: f64 = 1.0;

/// A point of the curve: the state and the logarithm of the drum's speed, each over its unit.
type CurvePoint = [f64; CURVE_DIMENSION];

fn dot_product(a: &CurvePoint, b: &CurvePoint) -> f64 {
    (0..CURVE_DIMENSION).fold(0.0, |sum, i| sum + a[i] * b[i])
}

fn normalize(direction: &CurvePoint) -> CurvePoint {
    let norm = dot_product(direction, direction).sqrt();
    direction.map(|entry| entry / norm)
}

fn add_scaled(origin: &CurvePoint, scale: f64, direction: &CurvePoint) -> CurvePoint {
    core::array::from_fn(|i| origin[i] + scale * direction[i])
}

fn component_unit(i: usize) -> f64 {
    if i < COORDINATES { COORDINATE_UNIT } else { COORDINATE_UNIT * SPEED_UNIT_PER_S }
}

fn to_curve_point(state: &[f64; STATES], speed_rpm: f64) -> CurvePoint {
    core::array::from_fn(|i| {
        if i == LOG_SPEED_INDEX {
            libm::log(speed_rpm) / LOG_SPEED_UNIT
        } else {
            state[i] / component_unit(i)
        }
    })
}

fn to_state(point: &CurvePoint) -> [f64; STATES] {
    core::array::from_fn(|i| point[i] * component_unit(i))
}

fn to_speed_rpm(point: &CurvePoint) -> f64 {
    libm::exp(point[LOG_SPEED_INDEX] * LOG_SPEED_UNIT)
}

/// A computed response on the curve.
#[derive(Clone)]
struct Node {
    position: CurvePoint,
    /// The unit tangent in the direction of continuation.
    tangent: CurvePoint,
    /// Whether the tangent was computed at the node itself instead of at a nearby point.
    has_own_tangent: bool,
    /// The length of the curve from its beginning to the node.
    arclength: f64,
    /// The monodromy matrix, at the node itself or at a nearby point.
    monodromy: StateMatrix,
    /// The number of steps of the node's turn, if forces have corners.
    step_count: Option<usize>,
}

/// Interpolates between two nodes, at a share of the arclength. Returns the point of the cubic
/// through both nodes with their tangents, and its derivative by the arclength.
fn interpolate_nodes(a: &Node, b: &Node, arclength_share: f64) -> (CurvePoint, CurvePoint) {
    let arclength_difference = b.arclength - a.arclength;
    let t = arclength_share;
    let u = 1.0 - arclength_share;
    let position = core::array::from_fn(|i| {
        u * u * ((1.0 + 2.0 * t) * a.position[i] + t * arclength_difference * a.tangent[i])
            + t * t * ((1.0 + 2.0 * u) * b.position[i] - u * arclength_difference * b.tangent[i])
    });
    let derivative = core::array::from_fn(|i| {
        let chord_slope = 6.0 * t * u * (b.position[i] - a.position[i]) / arclength_difference;
        chord_slope + u * (1.0 - 3.0 * t) * a.tangent[i] + t * (1.0 - 3.0 * u) * b.tangent[i]
    });
    (position, derivative)
}

/// Returns the number from 0 to 1 up to which a condition holds, by bisection.
fn bisect(is_before: impl Fn(f64) -> bool) -> f64 {
    let mut lower_bound = 0.0;
    let mut upper_bound = 1.0;
    for _ in 0..50 {
        let midpoint = 0.5 * (lower_bound + upper_bound);
        if is_before(midpoint) { lower_bound = midpoint } else { upper_bound = midpoint }
    }
    0.5 * (lower_bound + upper_bound)
}

/// A predictor-corrector step: the predicted point, and the plane through it in which it is
/// corrected.
#[derive(Clone)]
struct CorrectorStep {
    predicted_point: CurvePoint,
    plane_normal: CurvePoint,
    correction_count: usize,
    /// The number of corrections with the current Jacobian.
    correction_count_since_jacobian: usize,
    residual: f64,
    /// The linearised equations of the curve, once they are computed.
    jacobian: Option<Box<CurveJacobian>>,
}

/// The linearised equations of the curve about a point.
#[derive(Clone)]
struct CurveJacobian {
    monodromy: StateMatrix,
    /// The factors of the equations, of which the last one is that of the step's plane.
    factors: Lu<CURVE_DIMENSION>,
}

/// An interval between two nodes that is divided by a further node, to find a fold.
#[derive(Clone, Copy)]
struct FoldBracket {
    /// The index of the node at which the interval begins.
    first_node_index: usize,
    /// The number of remaining iterations for the fold; zero if the fold is known and the interval
    /// is next to it.
    iterations_left: usize,
}

/// The initial guess of a response at a speed, by interpolation of the curve.
pub(super) struct Guess {
    /// The number of folds on the curve before the response.
    pub(super) branch: u32,
    /// The speeds (rpm) of the lower and of the upper fold at the ends of the branch; `None` at an
    /// end without a fold.
    pub(super) fold_speeds_rpm: [Option<f64>; 2],
    /// The state at which the unbalance is up.
    pub(super) state: [f64; STATES],
    /// The factors of 1 - Phi at a nearby response.
    pub(super) factors: Option<Lu<STATES>>,
    /// Whether the response is on the curve that is continued up from a low speed.
    pub(super) is_on_curve: bool,
}

impl Guess {
    /// Whether the guess is on one of the two curves.
    pub(super) fn is_on_either_curve(&self) -> bool {
        self.is_on_curve || self.factors.is_some()
    }
}

/// The curve of the periodic responses of a machine over speed.
#[derive(Clone)]
pub(super) struct ResponseCurve<'a> {
    pub(super) settings: Settings<'a>,
    /// The speed (rpm) at which the continuation ends.
    end_rpm: f64,
    goes_down: bool,
    nodes: Vec<Node>,
    /// The indices of the nodes at which the speed turns back.
    fold_node_indices: Vec<usize>,
    /// The current point of the corrector.
    position: CurvePoint,
    /// The length of the next step.
    step_length: f64,
    /// Whether derivatives are computed at all instants of a turn.
    uses_all_instants: bool,
    /// The current step; `None` once the continuation has ended.
    step: Option<CorrectorStep>,
    /// The interval in which a fold is searched for.
    fold_bracket: Option<FoldBracket>,
}

impl<'a> ResponseCurve<'a> {
    /// Creates a curve without nodes.
    pub(super) fn new(settings: Settings<'a>) -> Self {
        Self {
            settings,
            end_rpm: 0.0,
            goes_down: false,
            nodes: Vec::new(),
            fold_node_indices: Vec::new(),
            position: [0.0; CURVE_DIMENSION],
            step_length: FIRST_STEP_LENGTH,
            uses_all_instants: false,
            step: None,
            fold_bracket: None,
        }
    }

    /// Begins the continuation from a response at a speed (rpm) up or down to another speed.
    pub(super) fn begin(&mut self, speed_rpm: f64, start_state: &[f64; STATES], end_rpm: f64) {
        self.end_rpm = end_rpm;
        self.goes_down = end_rpm < speed_rpm;
        let mut plane_normal = [0.0; CURVE_DIMENSION];
        plane_normal[LOG_SPEED_INDEX] = if self.goes_down { -1.0 } else { 1.0 };
        self.start_correction(to_curve_point(start_state, speed_rpm), plane_normal);
    }

    /// Predicts the next point of the curve, or ends the continuation.
    fn predict_next(&mut self) {
        self.step = None;
        let Some(last_node) = self.nodes.last() else { return };
        let last_rpm = to_speed_rpm(&last_node.position);
        let node_count = self.nodes.len();
        let is_out_of_range = (0..COORDINATES)
            .any(|i| (last_node.position[i] * COORDINATE_UNIT).abs() > MAX_COORDINATE);
        let first_rpm = to_speed_rpm(&self.nodes[0].position);
        let [low_rpm, high_rpm] = match self.goes_down {
            true => [self.end_rpm.next_up(), first_rpm.next_up()],
            false => [first_rpm, self.end_rpm],
        };
        let is_within_range = (low_rpm..high_rpm).contains(&last_rpm);
        let is_stalled_since = |previous_node: &Node| {
            last_node.arclength - previous_node.arclength < FIRST_STEP_LENGTH
        };
        let is_stalled = node_count > MAX_STALLED_NODES
            && is_stalled_since(&self.nodes[node_count - MAX_STALLED_NODES])
            && !self.settings.point.machine.elements.has_nonsmooth_force();
        if !is_within_range || is_out_of_range || is_stalled || node_count >= MAX_NODES {
            return;
        }
        if self.step_length < MIN_STEP_LENGTH {
            // A curve has stairs if the steps of a turn are longer than the width of corners, and
            // jumps if the number of steps changes with the speed. Shorter steps of a turn may
            // allow the continuation to proceed.
            let max_kept_arclength = last_node.arclength - FIRST_STEP_LENGTH;
            if !self.goes_down && self.settings.refine_continuation() {
                let kept_node_count =
                    self.nodes.partition_point(|node| node.arclength < max_kept_arclength).max(1);
                self.nodes.truncate(kept_node_count);
                self.step_length = FIRST_STEP_LENGTH;
                self.recompute_last_node();
            }
            return;
        }
        // The predictor of second order: the tangent, and its change in the last step.
        let mut predicted_point =
            add_scaled(&last_node.position, self.step_length, &last_node.tangent);
        if node_count > 1 {
            let previous_node = &self.nodes[node_count - 2];
            let curvature_factor = 0.5 * self.step_length * self.step_length
                / (last_node.arclength - previous_node.arclength);
            let tangent_change =
                core::array::from_fn(|i| last_node.tangent[i] - previous_node.tangent[i]);
            predicted_point = add_scaled(&predicted_point, curvature_factor, &tangent_change);
        }
        self.start_correction(predicted_point, last_node.tangent);
    }

    /// Multiplies the length of the next step by a factor.
    fn scale_step(&mut self, factor: f64) {
        self.step_length = (factor * self.step_length).min(MAX_STEP_LENGTH);
        self.uses_all_instants = self.step_length < ALL_INSTANTS_STEP_LENGTH
            || self.uses_all_instants && self.step_length < MAX_STEP_LENGTH;
    }

    /// Starts the corrector at a predicted point, in the plane with this normal.
    fn start_correction(&mut self, predicted_point: CurvePoint, plane_normal: CurvePoint) {
        self.position = predicted_point;
        let residual = f64::INFINITY;
        self.step = Some(CorrectorStep {
            predicted_point,
            plane_normal,
            correction_count: 0,
            correction_count_since_jacobian: 0,
            residual,
            jacobian: None,
        });
    }

    /// Rejects the current step, and tries a shorter one.
    fn reject_step(&mut self) {
        match self.fold_bracket.take() {
            // A fold that cannot be located more accurately is taken at the last node.
            Some(FoldBracket { first_node_index, iterations_left }) if iterations_left > 0 => {
                self.fold_node_indices.push(first_node_index + 1)
            }
            Some(_) => {}
            None => self.scale_step(0.5),
        }
        self.predict_next();
    }

    /// Computes the Jacobian of the step from a turn with its monodromy matrix and a turn at a
    /// slightly higher speed, and corrects the current point.
    fn receive_jacobian(
        &mut self,
        step: CorrectorStep,
        turn: &TurnResult,
        faster_turn: &TurnResult,
    ) {
        let Some(monodromy) = turn.record.as_ref().map(|record| record.monodromy) else {
            return self.reject_step();
        };
        let mut matrix = [[N(0.0); CURVE_DIMENSION]; CURVE_DIMENSION];
        for i in 0..STATES {
            for j in 0..STATES {
                let identity_entry = f64::from(u8::from(i == j));
                matrix[i][j] =
                    N(monodromy[i][j].0 * (component_unit(j) / component_unit(i)) - identity_entry);
            }
            let speed_derivative = (faster_turn.end_state[i] - turn.end_state[i])
                / libm::log1p(RELATIVE_SPEED_DIFFERENCE);
            matrix[i][LOG_SPEED_INDEX] = N(speed_derivative * LOG_SPEED_UNIT / component_unit(i));
        }
        matrix[LOG_SPEED_INDEX] = step.plane_normal.map(N);
        let Some(factors) = factor_matrix(&matrix) else { return self.reject_step() };
        let jacobian = Box::new(CurveJacobian { monodromy, factors });
        self.correct_position(
            CorrectorStep { jacobian: Some(jacobian), correction_count_since_jacobian: 0, ..step },
            &turn.end_state,
        );
    }

    /// Corrects the current point, from the state at the end of a turn that starts at this point.
    fn correct_position(&mut self, mut step: CorrectorStep, end_state: &[f64; STATES]) {
        let Some(jacobian) = &step.jacobian else { return self.reject_step() };
        let speed_rpm = to_speed_rpm(&self.position);
        let residual =
            relative_residual(self.settings.point, speed_rpm, &to_state(&self.position), end_state);
        let converges_slowly =
            step.correction_count > 1 && residual > MAX_RESIDUAL_RATIO * step.residual;
        if !residual.is_finite()
            || step.correction_count == MAX_CORRECTIONS
            || converges_slowly && step.correction_count_since_jacobian == 0
        {
            return self.reject_step();
        }
        if converges_slowly {
            // The Jacobian of a distant point no longer reduces the residual.
            step.residual = f64::INFINITY;
            step.jacobian = None;
            self.step = Some(step);
            return;
        }
        let end_point = to_curve_point(end_state, speed_rpm);
        let mut defect = [N(0.0); CURVE_DIMENSION];
        for i in 0..STATES {
            defect[i] = N(self.position[i] - end_point[i]);
        }
        let offset: CurvePoint =
            core::array::from_fn(|i| step.predicted_point[i] - self.position[i]);
        defect[LOG_SPEED_INDEX] = N(dot_product(&step.plane_normal, &offset));
        let correction = jacobian.factors.solve(&defect);
        self.position = core::array::from_fn(|i| self.position[i] + correction[i].0);
        let offset: CurvePoint =
            core::array::from_fn(|i| self.position[i] - step.predicted_point[i]);
        let offset = dot_product(&offset, &offset);
        if offset.is_nan() || offset > MAX_STEP_LENGTH * MAX_STEP_LENGTH {
            return self.reject_step();
        }
        step.correction_count += 1;
        step.correction_count_since_jacobian += 1;
        step.residual = residual;
        if residual < NODE_TOLERANCE { self.accept_step(step) } else { self.step = Some(step) }
    }

    /// Whether the speed increases along the curve after the last node. Each fold reverses it.
    fn is_rising(&self) -> bool {
        self.fold_node_indices.len().is_multiple_of(2) != self.goes_down
    }

    /// Computes the last node again, with the derivatives at the node itself.
    fn recompute_last_node(&mut self) {
        self.scale_step(0.5);
        if let Some(last_node) = self.nodes.pop() {
            // If the node is a fold, it will be found again.
            self.fold_node_indices.retain(|fold| *fold < self.nodes.len());
            self.start_correction(last_node.position, last_node.tangent);
        }
    }

    /// Accepts the current point as a node, unless the step is too long for the curve's bend, and
    /// starts the next step.
    fn accept_step(&mut self, step: CorrectorStep) {
        let Some(jacobian) = step.jacobian else { return self.reject_step() };
        let mut right_hand_side = [N(0.0); CURVE_DIMENSION];
        right_hand_side[LOG_SPEED_INDEX] = N(1.0);
        let tangent = jacobian.factors.solve(&right_hand_side).map(|entry| entry.0);
        let tangent = normalize(&tangent);
        let previous_node = match self.fold_bracket {
            Some(bracket) => self.nodes.get(bracket.first_node_index),
            None => self.nodes.last(),
        };
        let distance_from = |origin: &CurvePoint| {
            let difference: CurvePoint = core::array::from_fn(|i| self.position[i] - origin[i]);
            dot_product(&difference, &difference).sqrt()
        };
        let correction_distance = distance_from(&step.predicted_point);
        let mut arclength = 0.0;
        let mut turns_back = false;
        if let Some(previous_node) = previous_node {
            let chord = distance_from(&previous_node.position);
            let cosine = dot_product(&previous_node.tangent, &tangent);
            let has_turned = cosine.is_nan() || cosine < MIN_TANGENT_COSINE;
            if has_turned || correction_distance > MAX_CORRECTION_SHARE * chord {
                // If the last node's tangent is that of a nearby point, the node is computed again,
                // because shorter steps would also fail.
                let has_own_tangent = previous_node.has_own_tangent || self.fold_bracket.is_some();
                return if has_own_tangent {
                    self.reject_step()
                } else {
                    self.recompute_last_node()
                };
            }
            arclength = previous_node.arclength + chord;
            // Close to a fold the sign of the tangent's speed is uncertain. The number of folds
            // gives the direction, so that two close folds are not merged.
            turns_back = self.is_rising() == (tangent[LOG_SPEED_INDEX] < 0.0);
        }
        let has_own_tangent =
            correction_distance < MAX_OWN_TANGENT_DISTANCE && self.uses_all_instants;
        let monodromy = jacobian.monodromy;
        let node = Node {
            position: self.position,
            tangent,
            has_own_tangent,
            arclength,
            monodromy,
            step_count: self.settings.steps_at_corners(),
        };
        if let Some(bracket) = self.fold_bracket {
            return self.narrow_fold_bracket(node, bracket);
        }
        self.nodes.push(node);
        if step.correction_count <= MAX_CORRECTIONS_TO_GROW {
            self.scale_step(STEP_INCREASE_FACTOR);
        } else if step.correction_count >= MIN_CORRECTIONS_TO_SHRINK {
            self.scale_step(STEP_DECREASE_FACTOR);
        }
        if turns_back {
            let first_node_index = self.nodes.len() - 2;
            if self.nodes[first_node_index].tangent[LOG_SPEED_INDEX] * tangent[LOG_SPEED_INDEX]
                < 0.0
            {
                self.interpolate_fold(FoldBracket {
                    first_node_index,
                    iterations_left: MAX_FOLD_ITERATIONS,
                });
            } else {
                // The curve turned back twice about the last fold.
                self.fold_node_indices.push(first_node_index + 1);
                self.predict_next();
            }
        } else {
            self.predict_next();
        }
    }

    /// Inserts a node into an interval in which the speed turns back, and continues in the half
    /// with the fold.
    fn narrow_fold_bracket(&mut self, node: Node, bracket: FoldBracket) {
        let FoldBracket { first_node_index, iterations_left } = bracket;
        let [before, after] = [&self.nodes[first_node_index], &self.nodes[first_node_index + 1]];
        let curvature = (after.tangent[LOG_SPEED_INDEX] - before.tangent[LOG_SPEED_INDEX])
            / (after.arclength - before.arclength);
        let speed_slope = node.tangent[LOG_SPEED_INDEX];
        let error = 0.5 * speed_slope * speed_slope / curvature.abs() * LOG_SPEED_UNIT;
        let is_before_fold = before.tangent[LOG_SPEED_INDEX] * speed_slope > 0.0;
        self.nodes.insert(first_node_index + 1, node);
        if iterations_left == 0 {
            if let Some(fold) =
                self.fold_node_indices.last_mut().filter(|fold| **fold > first_node_index)
            {
                *fold += 1;
            }
            return self.add_nodes_at_fold();
        }
        if error < FOLD_TOLERANCE || iterations_left == 1 {
            self.fold_node_indices.push(first_node_index + 1);
            return self.add_nodes_at_fold();
        }
        let first_node_index = if is_before_fold { first_node_index + 1 } else { first_node_index };
        self.interpolate_fold(FoldBracket {
            first_node_index,
            iterations_left: iterations_left - 1,
        });
    }

    /// Adds nodes on both sides of the last fold, where two branches are close together.
    fn add_nodes_at_fold(&mut self) {
        self.fold_bracket = None;
        let Some(&fold) = self.fold_node_indices.last() else { return self.predict_next() };
        let is_long_interval = |first_node_index: usize| {
            let pair = self.nodes.get(first_node_index).zip(self.nodes.get(first_node_index + 1));
            pair.is_some_and(|(a, b)| b.arclength - a.arclength > MAX_NODE_DISTANCE_AT_FOLD)
        };
        let Some(first_node_index) = [fold - 1, fold]
            .into_iter()
            .find(|&first_node_index| is_long_interval(first_node_index))
        else {
            return self.predict_next();
        };
        let (position, slope) = interpolate_nodes(
            &self.nodes[first_node_index],
            &self.nodes[first_node_index + 1],
            0.5,
        );
        self.start_correction(position, normalize(&slope));
        self.fold_bracket = Some(FoldBracket { first_node_index, iterations_left: 0 });
    }

    /// Starts a correction at the fold of the cubic through the nodes of an interval.
    fn interpolate_fold(&mut self, bracket: FoldBracket) {
        let [before, after] =
            [&self.nodes[bracket.first_node_index], &self.nodes[bracket.first_node_index + 1]];
        let is_rising = before.tangent[LOG_SPEED_INDEX] > 0.0;
        let arclength_share = bisect(|arclength_share| {
            (interpolate_nodes(before, after, arclength_share).1[LOG_SPEED_INDEX] > 0.0)
                == is_rising
        });
        let (position, slope) = interpolate_nodes(before, after, arclength_share);
        self.start_correction(position, normalize(&slope));
        self.fold_bracket = Some(bracket);
    }

    /// Returns the folds without spurious ones: pairs of successive folds are removed, the nearest
    /// in speed first, as long as their difference times the number of steps of a turn is below
    /// [`SPURIOUS_FOLD_TOLERANCE`]. The number of steps is that of the pair's own nodes, because
    /// later parts of the curve may have shorter steps.
    fn genuine_fold_indices(&self) -> Vec<usize> {
        let mut fold_indices = self.fold_node_indices.clone();
        let difference_in_steps = |pair: &[usize]| {
            let [first, second] = [&self.nodes[pair[0]], &self.nodes[pair[1]]];
            let step_count = first.step_count.min(second.step_count)?;
            let log_speeds = first.position[LOG_SPEED_INDEX] - second.position[LOG_SPEED_INDEX];
            Some((log_speeds * LOG_SPEED_UNIT).abs() * step_count as f64)
        };
        loop {
            let pairs = fold_indices.windows(2).map(difference_in_steps).enumerate();
            let differences = pairs.filter_map(|(pair, step_count)| Some((pair, step_count?)));
            let nearest_pair = differences.min_by(|a, b| a.1.total_cmp(&b.1));
            match nearest_pair {
                Some((pair, difference)) if difference < SPURIOUS_FOLD_TOLERANCE => {
                    fold_indices.drain(pair..pair + 2);
                }
                _ => return fold_indices,
            }
        }
    }

    /// Whether the curve ends before it reaches [`OVERSHOOT_RATIO`] times a speed (rpm).
    pub(super) fn is_lost(&self, speed_rpm: f64) -> bool {
        let is_below_overshoot =
            |node: &Node| to_speed_rpm(&node.position) < OVERSHOOT_RATIO * speed_rpm;
        let lowest_rpm = self.settings.lowest_rpm();
        lowest_rpm.is_ok_and(|it| it < speed_rpm) && self.nodes.iter().all(is_below_overshoot)
    }

    /// Returns the number of folds.
    pub(super) fn fold_count(&self) -> u32 {
        self.genuine_fold_indices().len() as u32
    }

    /// Returns the guesses of all responses of the curve at a speed (rpm), in the curve's order.
    pub(super) fn guesses_at(&self, speed_rpm: f64) -> Vec<Guess> {
        let is_past_overshoot = |node: &Node| {
            !self.goes_down && to_speed_rpm(&node.position) >= OVERSHOOT_RATIO * speed_rpm
        };
        let overshoot_index = self.nodes.iter().position(is_past_overshoot);
        let nodes = &self.nodes
            [..overshoot_index.map_or(self.nodes.len(), |overshoot_index| overshoot_index + 1)];
        let target_log_speed = libm::log(speed_rpm) / LOG_SPEED_UNIT;
        let fold_indices = self.genuine_fold_indices();
        let mut guesses = Vec::new();
        for (k, pair) in nodes.windows(2).enumerate() {
            let [a, b] = pair else { continue };
            let [from_log_speed, to_log_speed] =
                [a.position[LOG_SPEED_INDEX], b.position[LOG_SPEED_INDEX]];
            let is_rising = to_log_speed > from_log_speed;
            // A node at exactly the requested speed counts once.
            let contains_target = if is_rising {
                (from_log_speed < target_log_speed || k == 0 && from_log_speed == target_log_speed)
                    && target_log_speed <= to_log_speed
            } else {
                to_log_speed <= target_log_speed && target_log_speed < from_log_speed
            };
            if !contains_target {
                continue;
            }
            let arclength_share = bisect(|arclength_share| {
                (interpolate_nodes(a, b, arclength_share).0[LOG_SPEED_INDEX] < target_log_speed)
                    == is_rising
            });
            let interpolate_entry = |i: usize, j: usize| {
                (1.0 - arclength_share) * a.monodromy[i][j].0
                    + arclength_share * b.monodromy[i][j].0
            };
            let monodromy =
                core::array::from_fn(|i| core::array::from_fn(|j| N(interpolate_entry(i, j))));
            let branch = fold_indices.iter().filter(|&&fold| fold <= k).count();
            let fold_speed_rpm = |number: usize| {
                let node = *fold_indices.get(number)?;
                nodes.get(node).map(|node| to_speed_rpm(&node.position))
            };
            let bounds_rpm =
                [branch.checked_sub(1).and_then(fold_speed_rpm), fold_speed_rpm(branch)];
            guesses.push(Guess {
                branch: branch as u32,
                fold_speeds_rpm: if (branch % 2 == 0) != self.goes_down {
                    bounds_rpm
                } else {
                    [bounds_rpm[1], bounds_rpm[0]]
                },
                state: to_state(&interpolate_nodes(a, b, arclength_share).0),
                factors: factor_fixed_point_equations(&monodromy),
                is_on_curve: !self.goes_down,
            });
        }
        guesses
    }
}

impl<'a> PeriodMapSearch<'a> for ResponseCurve<'a> {
    fn next_requests(&mut self) -> Vec<TurnRequest<'a>> {
        let Some(step) = &self.step else { return Vec::new() };
        let is_recorded = step.jacobian.is_none();
        let Ok(mut setup) = self.settings.continuation_setup(to_speed_rpm(&self.position)) else {
            self.step = None;
            return Vec::new();
        };
        if self.uses_all_instants {
            setup.instant_count = setup.instant_count.max(INSTANTS_PER_TURN);
        }
        let start_state = to_state(&self.position);
        let mut requests = vec![TurnRequest { setup, start_state, is_recorded }];
        if is_recorded {
            let setup = setup.at_nearby_speed(setup.speed_rpm * (1.0 + RELATIVE_SPEED_DIFFERENCE));
            requests.push(TurnRequest { setup, start_state, is_recorded: false });
        }
        requests
    }

    fn receive_results(&mut self, results: Vec<TurnResult>) {
        match (self.step.take(), results.as_slice()) {
            (Some(step), [turn, faster_turn]) => self.receive_jacobian(step, turn, faster_turn),
            (Some(step), [turn]) => self.correct_position(step, &turn.end_state),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Machine;
    use crate::stability::tests::{idle_stop, prepare_at_speed};

    /// Returns the paper's machine, with a stop that has no force if `has_stop`.
    fn prepare_point(has_stop: bool) -> crate::Point {
        let mut machine = Machine::paper();
        machine.stops.extend(has_stop.then(idle_stop));
        prepare_at_speed(machine, 100.0)
    }

    /// Returns a curve through the given speeds (rpm) at an arclength of 1 from each other, with
    /// folds at the given nodes.
    fn new_curve<'a>(
        point: &'a crate::Point,
        speeds_rpm: &[f64],
        folds: &[usize],
    ) -> ResponseCurve<'a> {
        let mut curve = ResponseCurve::new(Settings::new(point));
        let step_count = curve.settings.steps_at_corners();
        for (k, &speed_rpm) in speeds_rpm.iter().enumerate() {
            let position = to_curve_point(&[0.0; STATES], speed_rpm);
            let tangent = [0.0; CURVE_DIMENSION];
            let monodromy = [[N(0.0); STATES]; STATES];
            curve.nodes.push(Node {
                position,
                tangent,
                has_own_tangent: true,
                arclength: k as f64,
                monodromy,
                step_count,
            });
        }
        curve.fold_node_indices = folds.to_vec();
        curve
    }

    #[test]
    fn a_stair_of_steps_at_corners_is_no_fold_of_the_machine() {
        let speeds_rpm = [200.0, 220.05, 220.0, 240.0, 230.0, 260.0];
        let branches_at = |has_stop: bool, speed_rpm: f64| {
            let point = prepare_point(has_stop);
            let guesses = new_curve(&point, &speeds_rpm, &[1, 2, 3, 4]).guesses_at(speed_rpm);
            guesses
                .iter()
                .map(|guess| (guess.branch, guess.fold_speeds_rpm[1].is_some()))
                .collect::<Vec<_>>()
        };
        assert_eq!(branches_at(false, 210.0), [(0, true)]);
        assert_eq!(branches_at(false, 250.0), [(4, false)]);
        assert_eq!(branches_at(true, 210.0), [(0, true)]);
        assert_eq!(branches_at(true, 225.0), [(0, true)]);
        assert_eq!(branches_at(true, 250.0), [(2, false)]);
    }

    /// Checks that a curve whose later parts need shorter steps keeps the branches of its earlier
    /// parts.
    #[test]
    fn stairs_are_measured_by_their_own_steps() {
        let point = prepare_point(true);
        let mut curve =
            new_curve(&point, &[200.0, 220.05, 220.0, 240.0, 230.0, 260.0], &[1, 2, 3, 4]);
        while curve.settings.refine_continuation() {}
        let branches_at = |speed_rpm: f64| {
            let guesses = curve.guesses_at(speed_rpm).into_iter();
            guesses.map(|guess| guess.branch).collect::<Vec<_>>()
        };
        assert_eq!(branches_at(225.0), [0]);
        assert_eq!(branches_at(250.0), [2]);
    }

    /// Checks that the fold itself remains if several stairs are near it.
    #[test]
    fn stairs_by_a_fold_leave_its_farthest_speed() {
        let point = prepare_point(true);
        let step_count = Settings::new(&point).steps_at_corners().unwrap() as f64;
        let stair_rpm = |height_steps: f64| 230.0 * libm::exp(height_steps / step_count);
        let mut speeds_rpm = vec![200.0];
        speeds_rpm.extend([0.0, -0.2, 0.4, -0.4, 0.0].map(stair_rpm));
        speeds_rpm.extend([171.0, 260.0]);
        let guesses = new_curve(&point, &speeds_rpm, &[1, 2, 3, 4, 5, 6]).guesses_at(190.0);
        let [backward_guess, forward_guess] = &guesses[..] else {
            panic!("{} guesses", guesses.len())
        };
        assert_eq!([backward_guess.branch, forward_guess.branch], [1, 2]);
        let is_at_speed = |end_rpm: Option<f64>, rpm: f64| (end_rpm.unwrap() - rpm).abs() < 1e-9;
        assert!(
            is_at_speed(backward_guess.fold_speeds_rpm[0], 171.0),
            "{:?}",
            backward_guess.fold_speeds_rpm
        );
        assert!(
            is_at_speed(backward_guess.fold_speeds_rpm[1], stair_rpm(0.4)),
            "{:?}",
            backward_guess.fold_speeds_rpm
        );
        assert!(
            is_at_speed(forward_guess.fold_speeds_rpm[0], 171.0),
            "{:?}",
            forward_guess.fold_speeds_rpm
        );
        assert_eq!(forward_guess.fold_speeds_rpm[1], None);
    }

    #[test]
    fn a_fold_that_is_looked_at_again_is_not_counted_twice() {
        let point = prepare_point(false);
        let mut curve = new_curve(&point, &[200.0, 220.0, 240.0], &[1, 2]);
        curve.recompute_last_node();
        assert_eq!((curve.nodes.len(), curve.fold_node_indices), (2, vec![1]));
    }

    /// Two folds within a step leave the direction of the curve unchanged.
    #[test]
    fn a_curve_that_turns_twice_about_a_fold_has_two() {
        let point = prepare_point(false);
        let mut curve = new_curve(&point, &[220.0, 230.0], &[1]);
        let mut upward_tangent = [0.0; CURVE_DIMENSION];
        upward_tangent[LOG_SPEED_INDEX] = 1.0;
        for node in &mut curve.nodes {
            node.tangent = upward_tangent;
        }
        let identity_entry = |i: usize, j: usize| N(f64::from(u8::from(i == j)));
        let matrix = core::array::from_fn(|i| core::array::from_fn(|j| identity_entry(i, j)));
        let factors = factor_matrix::<CURVE_DIMENSION>(&matrix).unwrap();
        let jacobian = CurveJacobian { monodromy: [[N(0.0); STATES]; STATES], factors };
        curve.start_correction(to_curve_point(&[0.0; STATES], 240.0), upward_tangent);
        let step = curve.step.take().unwrap();
        curve.end_rpm = 300.0;
        curve.accept_step(CorrectorStep { jacobian: Some(Box::new(jacobian)), ..step });
        assert_eq!((curve.nodes.len(), &curve.fold_node_indices[..]), (3, &[1, 2][..]));
        assert!(curve.fold_bracket.is_none() && curve.is_rising());
    }

    #[test]
    fn a_curve_followed_down_has_its_branches_the_other_way_round() {
        let point = prepare_point(false);
        let mut curve = new_curve(&point, &[260.0, 220.0, 240.0, 200.0], &[1, 2]);
        curve.goes_down = true;
        let branches_at = |speed_rpm: f64| {
            let guesses = curve.guesses_at(speed_rpm).into_iter();
            guesses
                .map(|guess| {
                    (
                        guess.branch,
                        guess.fold_speeds_rpm.map(|rpm| rpm.map(f64::round)),
                        guess.is_on_curve,
                    )
                })
                .collect::<Vec<_>>()
        };
        assert_eq!(branches_at(250.0), [(0, [Some(220.0), None], false)]);
        assert_eq!(branches_at(210.0), [(2, [None, Some(240.0)], false)]);
        assert_eq!(branches_at(230.0).iter().map(|guess| guess.0).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!(branches_at(230.0)[1].1, [Some(220.0), Some(240.0)]);
        assert!(curve.is_lost(210.0) && !curve.is_lost(205.0) && !curve.is_lost(40.0));
    }
}

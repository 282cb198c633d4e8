//! Searches that evaluate the period map: the driver that runs many searches together, and Newton's
//! method for a periodic response at one speed.

use super::monodromy::StateMatrix;
use super::period_map::{OrbitRecord, TurnRequest, TurnResult, TurnSetup, compute_turns};
use crate::coordinates::{COORDINATES, STATES};
use crate::point::Point;
use core::f64::consts::TAU;
use lane_ode::{Cancel, Lu, N, OutOfLine, Simd};

/// A search that requests turns until it is over.
pub(super) trait PeriodMapSearch<'a> {
    /// Returns the turns that the search needs next; none once the search is over.
    fn next_requests(&mut self) -> Vec<TurnRequest<'a>>;

    /// Receives the results of the requested turns, in the order of the requests.
    fn receive_results(&mut self, results: Vec<TurnResult>);
}

/// Runs searches to their ends, with the turns of all searches together in lanes. Returns false
/// once `cancel` is requested.
pub(super) fn run_searches<'a, S: PeriodMapSearch<'a>>(
    searches: &mut [S],
    cancel: Cancel<'_>,
) -> bool {
    loop {
        let requests_by_search: Vec<Vec<TurnRequest<'a>>> =
            searches.iter_mut().map(PeriodMapSearch::next_requests).collect();
        let requests: Vec<TurnRequest<'a>> = requests_by_search.concat();
        if requests.is_empty() {
            return true;
        }
        let mut results = compute_turns(&requests, cancel).into_iter();
        if cancel.is_requested() {
            return false;
        }
        for (search, search_requests) in searches.iter_mut().zip(requests_by_search) {
            if !search_requests.is_empty() {
                search.receive_results(results.by_ref().take(search_requests.len()).collect());
            }
        }
    }
}

/// The greatest number of turns of a search for a response. Doubling it doubles the time of
/// searches that fail.
const MAX_SEARCH_TURNS: usize = 80;

/// The expected relative residual below which the next turn is the last one of a search. Basis: a
/// hundredth of [`RESPONSE_TOLERANCE`]. Doubling it saves few turns.
const LAST_TURN_TOLERANCE: f64 = 1e-10;

/// The greatest relative residual of a response. Basis: amplitudes are compared to 1e-5. Doubling
/// it changes nothing.
const RESPONSE_TOLERANCE: f64 = 1e-8;

/// The least size of a motion (m, rad) in a relative residual. Basis: without unbalance the motion
/// consists of rounding errors only. Doubling it changes nothing for greater motions.
const MIN_DEVIATION: f64 = 1e-4;

/// The greatest ratio of successive residuals with which the Jacobian is used again. Doubling it
/// takes more corrections, with fewer Jacobians.
const MAX_RESIDUAL_RATIO: f64 = 0.2;

/// The relative residual below which a correction with the Jacobian at the state itself is the last
/// one. Basis: such a correction squares the residual. Doubling it ends searches a correction
/// earlier.
const QUADRATIC_CONVERGENCE_RESIDUAL: f64 = 1e-3;

/// The distance (m, rad; speeds over the drum's speed) within which a known response repels a
/// search. Basis: neighbouring responses near a fold are some millimetres apart, as in test
/// `a_branch_that_was_lost_is_found_again`. Doubling it makes searches miss neighbours that they
/// should find.
const REPULSION_RANGE: f64 = 5e-3;

/// The largest difference from 1 of the factor of a Newton step with which a search may end. Basis:
/// a search that has converged takes steps of 1e-7 of a known response's distance, whose factor
/// differs from 1 by as much. Doubling it changes nothing for such searches.
const MAX_FINAL_DEFLATION: f64 = 1e-3;

/// Returns the distance of a turn's end from its start, relative to its deviation from equilibrium;
/// not finite if the motion left the model's range.
pub(crate) fn relative_residual(
    point: &Point,
    speed_rpm: f64,
    start_state: &[f64; STATES],
    end_state: &[f64; STATES],
) -> f64 {
    let equilibrium = point.equilibrium();
    let speed_rad_per_s = speed_rpm * TAU / 60.0;
    let mut residual = 0.0_f64;
    let mut largest_deviation = MIN_DEVIATION;
    for i in 0..COORDINATES {
        largest_deviation = largest_deviation.max((start_state[i] - equilibrium[i]).abs());
        let speed_defect = end_state[COORDINATES + i] - start_state[COORDINATES + i];
        let defect = (end_state[i] - start_state[i]).abs() + speed_defect.abs() / speed_rad_per_s;
        // A residual of NaN is kept.
        residual = if defect > residual || defect.is_nan() { defect } else { residual };
    }
    residual / largest_deviation
}

/// Factors 1 - Phi, the matrix of Newton's equations for a fixed point of the period map, from the
/// monodromy matrix Phi. Returns `None` if it is singular.
pub(super) fn factor_fixed_point_equations(monodromy: &StateMatrix) -> Option<Lu<STATES>> {
    let mut equation_matrix = monodromy.map(|row| row.map(|entry| -entry));
    for i in 0..STATES {
        equation_matrix[i][i] = equation_matrix[i][i] + 1.0;
    }
    factor_matrix(&equation_matrix)
}

/// Factors a matrix; returns `None` if it is singular.
pub(super) fn factor_matrix<const C: usize>(matrix: &[[N<f64>; C]; C]) -> Option<Lu<C>> {
    Simd::one_lane(MatrixFactorization(matrix))
}

struct MatrixFactorization<'a, const C: usize>(&'a [[N<f64>; C]; C]);

impl<const C: usize> OutOfLine for MatrixFactorization<'_, C> {
    type Output = Option<Lu<C>>;

    #[inline(always)]
    fn run(self) -> Option<Lu<C>> {
        Lu::new(*self.0)
    }
}

/// The search for a periodic response at one speed by Newton's method. The first correction uses
/// the Jacobian of a nearby response, if it is known. Later corrections use the Jacobian at the
/// search's own states, which is computed again when the residual decreases too slowly.
pub(super) struct NewtonSearch<'a> {
    setup: TurnSetup<'a>,
    state: [f64; STATES],
    /// The factors of 1 - Phi; `None` if the next turn computes them.
    factors: Option<Lu<STATES>>,
    turn_count: usize,
    /// The number of remaining turns of the transient before the first correction.
    transient_turns: usize,
    /// The largest correction of a coordinate (m, rad).
    max_newton_step: f64,
    /// The known responses, which the search is not to find again.
    known_responses: Vec<[f64; STATES]>,
    residual: f64,
    is_last_turn: bool,
    is_over: bool,
    record: Option<Box<OrbitRecord>>,
}

impl<'a> NewtonSearch<'a> {
    /// Creates a search from a nearby state, with the factors of 1 - Phi of a nearby response, if
    /// they are known.
    pub(super) fn new(
        setup: TurnSetup<'a>,
        state: [f64; STATES],
        factors: Option<Lu<STATES>>,
    ) -> Self {
        Self {
            setup,
            state,
            factors,
            turn_count: 0,
            transient_turns: 0,
            max_newton_step: f64::INFINITY,
            known_responses: Vec::new(),
            residual: f64::INFINITY,
            is_last_turn: false,
            is_over: false,
            record: None,
        }
    }

    /// Creates a search by damped Newton steps, none of which changes a coordinate by more than
    /// `max_newton_step` (m, rad). Such a search stays near its start if another response is close.
    pub(super) fn new_damped(
        setup: TurnSetup<'a>,
        state: [f64; STATES],
        max_newton_step: f64,
    ) -> Self {
        Self { max_newton_step, ..Self::new(setup, state, None) }
    }

    /// Creates a damped search by deflated Newton steps (Farrell, Birkisson and Funke 2015): known
    /// responses repel the search, so that it finds another response.
    pub(super) fn new_deflated(
        setup: TurnSetup<'a>,
        state: [f64; STATES],
        max_newton_step: f64,
        known_responses: Vec<[f64; STATES]>,
    ) -> Self {
        Self { known_responses, ..Self::new_damped(setup, state, max_newton_step) }
    }

    /// Returns the factor by which deflation multiplies a Newton step: with the residual multiplied
    /// by m(x) = product over known responses r of 1 + 1 / |x - r|^2, the step d becomes d / (1 - d
    /// ln m), where d ln m is the derivative of ln m along d.
    fn deflation_factor(&self, step: &[N<f64>; STATES]) -> f64 {
        let speed_rad_per_s = self.setup.speed_rpm * TAU / 60.0;
        let repulsion_unit = |i: usize| {
            if i < COORDINATES { REPULSION_RANGE } else { REPULSION_RANGE * speed_rad_per_s }
        };
        let mut log_derivative = 0.0;
        for known_response in &self.known_responses {
            let mut squared_distance = 0.0;
            let mut scalar_product = 0.0;
            for i in 0..STATES {
                let relative_offset = (self.state[i] - known_response[i]) / repulsion_unit(i);
                squared_distance += relative_offset * relative_offset;
                scalar_product += relative_offset * step[i].0 / repulsion_unit(i);
            }
            log_derivative -= 2.0 * scalar_product / (squared_distance * (1.0 + squared_distance));
        }
        1.0 / (1.0 - log_derivative)
    }

    /// Creates a search that integrates the transient over a number of turns before Newton's
    /// method.
    pub(super) fn new_after_transient(
        setup: TurnSetup<'a>,
        state: [f64; STATES],
        turn_count: usize,
    ) -> Self {
        Self { transient_turns: turn_count, ..Self::new(setup, state, None) }
    }

    /// Returns the current state.
    pub(super) const fn state(&self) -> [f64; STATES] {
        self.state
    }

    /// Returns the response, as the state at which the unbalance is up and the record of the turn
    /// from there; `None` if the search has failed.
    pub(super) fn into_response(self) -> Option<([f64; STATES], Box<OrbitRecord>)> {
        Some((self.state, self.record?))
    }
}

impl<'a> PeriodMapSearch<'a> for NewtonSearch<'a> {
    fn next_requests(&mut self) -> Vec<TurnRequest<'a>> {
        if self.is_over {
            return Vec::new();
        }
        if self.transient_turns > 0 {
            return vec![TurnRequest {
                setup: self.setup,
                start_state: self.state,
                is_recorded: false,
            }];
        }
        let is_recorded = self.is_last_turn || self.factors.is_none();
        let mut setup = self.setup;
        let uses_all_instants = self.is_last_turn || self.max_newton_step.is_finite();
        if !(uses_all_instants || setup.differentiates_steps()) {
            // Derivatives at half the instants reduce the residual to some 1e-7 of its value, which
            // is enough before the last turn. If motions have many harmonics, the iteration may
            // oscillate about a response, so that a damped search uses all instants.
            setup.instant_count /= 2;
        }
        vec![TurnRequest { setup, start_state: self.state, is_recorded }]
    }

    fn receive_results(&mut self, results: Vec<TurnResult>) {
        let Some(TurnResult { end_state, record }) = results.into_iter().next() else { return };
        if self.transient_turns > 0 {
            self.transient_turns -= 1;
            self.state = end_state;
            self.is_over = end_state.iter().any(|x| !x.is_finite());
            return;
        }
        self.turn_count += 1;
        let residual =
            relative_residual(self.setup.point, self.setup.speed_rpm, &self.state, &end_state);
        if self.is_last_turn && residual < RESPONSE_TOLERANCE {
            self.is_over = true;
            self.record = record;
            return;
        }
        let has_own_factors = record.is_some();
        let has_borrowed_factors = self.turn_count == 1 && record.is_none();
        match record {
            Some(record) => {
                self.factors = factor_fixed_point_equations(&record.monodromy);
                self.is_over = self.factors.is_none();
            }
            None if residual > MAX_RESIDUAL_RATIO * self.residual => self.factors = None,
            None => {}
        }
        self.is_over |= !residual.is_finite() || self.turn_count == MAX_SEARCH_TURNS;
        if let (false, Some(factors)) = (self.is_over, &self.factors) {
            let defect = core::array::from_fn(|i| N(end_state[i] - self.state[i]));
            let correction = factors.solve(&defect);
            let max_correction =
                correction[..COORDINATES].iter().map(|change| change.0.abs()).fold(0.0, f64::max);
            let deflation_ratio = self.deflation_factor(&correction);
            let step_factor = deflation_ratio
                * (self.max_newton_step / (deflation_ratio.abs() * max_correction)).min(1.0);
            for i in 0..STATES {
                self.state[i] += step_factor * correction[i].0;
            }
            // The next correction is expected to reduce the residual by the same rate.
            let convergence_rate =
                if self.residual.is_finite() { residual / self.residual } else { 1.0 };
            let is_nearly_converged = residual * convergence_rate.min(1.0) < LAST_TURN_TOLERANCE
                || has_own_factors && residual < QUADRATIC_CONVERGENCE_RESIDUAL;
            // A search whose steps are still deflated by known responses has not converged.
            self.is_last_turn =
                is_nearly_converged && (step_factor - 1.0).abs() < MAX_FINAL_DEFLATION;
            if has_borrowed_factors {
                self.factors = None;
            }
            self.residual = residual;
        }
        self.is_over |= self.state.iter().any(|x| !x.is_finite());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stability::settings::Settings;
    use crate::stability::tests::{machine_with, prepare_at_speed};

    /// Checks that deflation reverses a step towards a known response, and does not change a step
    /// far from known responses.
    #[test]
    fn known_responses_repel() {
        let point = prepare_at_speed(machine_with(0.4, 140.0), 100.0);
        let setup = Settings::new(&point).held_case(250.0).unwrap().setup;
        let known_response = [0.0; STATES];
        // The ratio of the deflated step to Newton's, which leads to the known response.
        let deflation_ratio = |distance_m: f64| {
            let mut state = known_response;
            state[0] = distance_m;
            let mut newton_step = [N(0.0); STATES];
            newton_step[0] = N(-distance_m);
            NewtonSearch::new_deflated(setup, state, f64::INFINITY, vec![known_response])
                .deflation_factor(&newton_step)
        };
        assert!((deflation_ratio(1e-6) + 1.0).abs() < 1e-3, "{}", deflation_ratio(1e-6));
        assert!((deflation_ratio(1.0) - 1.0).abs() < 1e-3, "{}", deflation_ratio(1.0));
        let factor_without_known =
            NewtonSearch::new(setup, known_response, None).deflation_factor(&[N(1.0); STATES]);
        assert_eq!(factor_without_known, 1.0);
    }
}

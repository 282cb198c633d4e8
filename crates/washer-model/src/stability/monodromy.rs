//! The monodromy matrix of a response: the effect of a turn on small disturbances.
//!
//! A disturbance d obeys d'' = K(t) d + C(t) d', with the partial derivatives of the accelerations
//! along the response, by dual numbers. Without forces with corners (`corners.rs`) these are smooth
//! and periodic. They are computed at a few equally spaced instants, and interpolated by the
//! trigonometric polynomial in between. Classical Runge-Kutta integrates all disturbances together.
//! Lanes hold instants of a turn while derivatives are computed, and disturbances while these are
//! integrated.

use super::corners::{AccelerationDerivatives, CornerMotion, CornerMotionEvaluation};
use super::turn::{A, B, StepGrid};
use crate::coordinates::{COORDINATES, STATES};
use crate::lanes::InLanes as _;
use crate::nonlinear::elements::corners::CornerForce;
use crate::run::model::NonlinearModel;
use faer::Mat;
use lane_ode::{Dual, Lane, MAX_LANES, N, OutOfLine, System, trig};

/// The number of instants of a turn at which derivatives are computed, if no force has corners.
/// Basis: it resolves harmonics of the turn up to the seventh. Doubling it resolves the fifteenth.
pub(super) const INSTANTS_PER_TURN: usize = 16;

/// The number of instants of a turn at which derivatives are computed, if forces have corners.
/// Basis: corners give motions more harmonics. Doubling it doubles the number of derivatives.
pub(super) const INSTANTS_PER_TURN_WITH_CORNERS: usize = 32;

/// A matrix of the derivatives of a state by another state.
pub(crate) type StateMatrix = [[N<f64>; STATES]; STATES];

/// Converts a matrix of derivatives to speeds in a unit (1/s).
pub(crate) fn scale_speeds(matrix: &StateMatrix, unit_per_s: f64) -> Mat<f64> {
    let component_unit = |i: usize| if i < COORDINATES { 1.0 } else { unit_per_s };
    Mat::from_fn(STATES, STATES, |i, j| matrix[i][j].0 * component_unit(j) / component_unit(i))
}

/// The number of vector registers with disturbances that are integrated through a step at once.
/// Basis: they fit in the first-level cache. Doubling it is slower.
const VECTORS_PER_BLOCK: usize = 5;
/// The number of the widest vectors that hold all disturbances. Basis: the number of states.
/// Doubling it leaves lanes empty.
const WIDE_VECTORS_PER_BLOCK: usize = STATES.div_ceil(MAX_LANES);

/// The number of steps whose derivatives are interpolated at once. Basis: every number of steps is
/// a multiple of it. Doubling it needs twice the memory.
const STEPS_PER_BLOCK: usize = 8;

/// The number of starts, middles and ends of [`STEPS_PER_BLOCK`] steps. If forces have corners,
/// these steps are so short that the smooth derivatives are interpolated by parabolas through the
/// first, the middle and the last instant.
const INSTANTS_PER_BLOCK: usize = 2 * STEPS_PER_BLOCK + 1;

/// The computation of the monodromy matrices of several turns, whose set-ups differ in points and
/// speeds only.
pub(super) struct SmoothMonodromy<'a, T> {
    pub(super) zero: N<T>,
    /// The result of [`interpolation_weights`].
    pub(super) weights: &'a [Vec<f64>],
    /// The model. Lane k has turn k modulo `turn_count`.
    pub(super) model: NonlinearModel<Dual<T>>,
    pub(super) grid: StepGrid<T>,
    pub(super) turn_count: usize,
    /// The number of equally spaced instants of a turn at which derivatives are computed.
    pub(super) instant_count: usize,
    /// The states at equally spaced instants, a lane for each turn. Their number is a multiple of
    /// `instant_count`.
    pub(super) states: &'a [[N<T>; STATES]],
    /// The forces with corners in the turns' lanes, at the start, middle and end of all steps.
    pub(super) corner_forces: &'a [CornerForce<T>],
}

/// The smooth coefficients of the equations of disturbances at an instant.
#[derive(Clone)]
struct SmoothCoefficients {
    /// The derivatives of the accelerations without those of forces with corners.
    derivatives: AccelerationDerivatives,
    /// The motions on which the forces with corners depend.
    corner_motions: Vec<CornerMotion<f64>>,
}

impl SmoothCoefficients {
    /// Coefficients that are all zero.
    const ZERO: Self =
        Self { derivatives: [[N(0.0); STATES]; COORDINATES], corner_motions: Vec::new() };
}

/// The weights of the samples in a sum.
type SampleWeights = [f64; INSTANTS_PER_TURN_WITH_CORNERS];

/// Computes several weighted sums of the same samples: coordinate by coordinate, so that the
/// summands stay in the first-level cache, and four sums at a time, so that each loaded summand is
/// used four times.
#[inline(always)]
fn compute_weighted_sums(
    samples: &[SmoothCoefficients],
    weights: &[SampleWeights],
    sums: &mut [SmoothCoefficients],
) {
    let ((weights_by_four, remaining_weights), (sums_by_four, remaining_sums)) =
        (weights.as_chunks::<4>(), sums.as_chunks_mut::<4>());
    for i in 0..COORDINATES {
        for index in 0..sums_by_four.len() {
            compute_weighted_accelerations(
                samples,
                i,
                &weights_by_four[index],
                &mut sums_by_four[index],
            );
        }
        for index in 0..remaining_sums.len() {
            compute_weighted_accelerations(
                samples,
                i,
                &[remaining_weights[index]],
                core::array::from_mut(&mut remaining_sums[index]),
            );
        }
    }
    for (index, weights) in weights.iter().enumerate() {
        sums[index].corner_motions.clear();
        for m in 0..samples[0].corner_motions.len() {
            let mut corner = CornerMotion::zero(N(0.0));
            for k in 0..samples.len() {
                corner.add_scaled(&samples[k].corner_motions[m], weights[k]);
            }
            sums[index].corner_motions.push(corner);
        }
    }
}

/// Sets the derivatives of acceleration `i` in each sum to the weighted sum of those of the
/// samples.
#[inline(always)]
fn compute_weighted_accelerations<const SUMS: usize>(
    samples: &[SmoothCoefficients],
    i: usize,
    weights: &[SampleWeights; SUMS],
    sums: &mut [SmoothCoefficients; SUMS],
) {
    let mut row_sums_of_samples = [[N(0.0); STATES]; SUMS];
    for k in 0..samples.len() {
        for index in 0..SUMS {
            for j in 0..STATES {
                row_sums_of_samples[index][j] += samples[k].derivatives[i][j] * weights[index][k];
            }
        }
    }
    for index in 0..SUMS {
        sums[index].derivatives[i] = row_sums_of_samples[index];
    }
}

/// Computes the monodromy matrix of each turn.
impl<T: Lane> OutOfLine for SmoothMonodromy<'_, T> {
    type Output = Vec<StateMatrix>;

    #[inline(always)]
    fn run(self) -> Vec<StateMatrix> {
        let Self { zero, weights, .. } = self;
        let samples = self.sample_coefficients(zero);
        let vectors_per_block =
            if T::LANES == MAX_LANES { WIDE_VECTORS_PER_BLOCK } else { VECTORS_PER_BLOCK };
        let vector_count = STATES.div_ceil(vectors_per_block * T::LANES) * vectors_per_block;
        let mut columns = vec![vec![[zero; STATES]; vector_count]; self.turn_count];
        for columns in &mut columns {
            for j in 0..STATES {
                columns[j / T::LANES][j].0.set(j % T::LANES, 1.0);
            }
        }
        let mut coefficients = vec![SmoothCoefficients::ZERO; INSTANTS_PER_BLOCK];
        let mut endpoints_and_middle = [SmoothCoefficients::ZERO; 3];
        let mut parabola_weights = [[0.0; INSTANTS_PER_TURN_WITH_CORNERS]; INSTANTS_PER_BLOCK];
        for k in 0..INSTANTS_PER_BLOCK {
            let t = k as f64 / STEPS_PER_BLOCK as f64 - 1.0;
            let lagrange_weights = [0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)];
            parabola_weights[k][..lagrange_weights.len()].copy_from_slice(&lagrange_weights);
        }
        for first_step in (0..self.grid.step_count).step_by(STEPS_PER_BLOCK) {
            for (turn, columns) in columns.iter_mut().enumerate() {
                if self.corner_forces.is_empty() {
                    interpolate(&samples[turn], weights, 2 * first_step, &mut coefficients);
                } else {
                    interpolate(&samples[turn], weights, 2 * first_step, &mut endpoints_and_middle);
                    compute_weighted_sums(
                        &endpoints_and_middle,
                        &parabola_weights,
                        &mut coefficients,
                    );
                    for k in 0..INSTANTS_PER_BLOCK {
                        self.add_corner_derivatives(
                            turn,
                            2 * first_step + k,
                            1.0,
                            &mut coefficients[k],
                        );
                    }
                }
                let step_s = zero.lit(self.grid.step_s.0.get(turn));
                for k in 0..STEPS_PER_BLOCK {
                    let start_derivatives = &coefficients[2 * k].derivatives;
                    let middle_derivatives = &coefficients[2 * k + 1].derivatives;
                    let end_derivatives = &coefficients[2 * k + 2].derivatives;
                    let coefficients = [
                        start_derivatives,
                        middle_derivatives,
                        middle_derivatives,
                        end_derivatives,
                    ];
                    if T::LANES == MAX_LANES {
                        for disturbances in columns.as_chunks_mut::<WIDE_VECTORS_PER_BLOCK>().0 {
                            integrate_step(zero, step_s, coefficients, disturbances);
                        }
                    } else {
                        for disturbances in columns.as_chunks_mut::<VECTORS_PER_BLOCK>().0 {
                            integrate_step(zero, step_s, coefficients, disturbances);
                        }
                    }
                }
            }
        }
        let mut monodromy_matrices = vec![[[N(0.0); STATES]; STATES]; self.turn_count];
        for (matrix, columns) in monodromy_matrices.iter_mut().zip(&columns) {
            for i in 0..STATES {
                for j in 0..STATES {
                    matrix[i][j] = N(columns[j / T::LANES][i].0.get(j % T::LANES));
                }
            }
        }
        monodromy_matrices
    }
}

impl<T: Lane> SmoothMonodromy<'_, T> {
    /// Computes the smooth coefficients of each turn at all instants.
    #[inline(always)]
    fn sample_coefficients(&self, zero: N<T>) -> Vec<Vec<SmoothCoefficients>> {
        let instants_at_once = T::LANES / self.turn_count;
        let last_instant = self.instant_count - 1;
        let state_stride = self.states.len() / self.instant_count;
        let steps_per_instant = self.grid.step_count / self.instant_count;
        let mut samples = vec![vec![SmoothCoefficients::ZERO; self.instant_count]; self.turn_count];
        let mut lane_instants = [0; MAX_LANES];
        let mut derivatives = [[zero; STATES]; COORDINATES];
        for instant in (0..self.instant_count).step_by(instants_at_once) {
            let mut step_index = zero;
            let mut state = [zero; STATES];
            for lane in 0..T::LANES {
                lane_instants[lane] = (instant
                    + (lane / self.turn_count).min(instants_at_once - 1))
                .min(last_instant);
                step_index.0.set(lane, (lane_instants[lane] * steps_per_instant) as f64);
                for i in 0..STATES {
                    state[i].0.set(
                        lane,
                        self.states[lane_instants[lane] * state_stride][i]
                            .0
                            .get(lane % self.turn_count),
                    );
                }
            }
            let spin =
                self.model.forcing_out_of_line((self.grid.step_s * step_index).v().constant());
            self.compute_derivatives(zero, &spin, &state, &mut derivatives);
            let mut corner_motions = Vec::new();
            if !self.corner_forces.is_empty() {
                corner_motions = zero.0.run_out_of_line(CornerMotionEvaluation {
                    model: &self.model,
                    spin: &spin,
                    x: &state,
                });
            }
            for lane in 0..T::LANES {
                let turn = lane % self.turn_count;
                let coefficients = &mut samples[turn][lane_instants[lane]];
                for i in 0..COORDINATES {
                    for j in 0..STATES {
                        coefficients.derivatives[i][j] = N(derivatives[i][j].0.get(lane));
                    }
                }
                coefficients.corner_motions =
                    corner_motions.iter().map(|corner| corner.get_lane(lane)).collect();
                self.add_corner_derivatives(
                    turn,
                    2 * lane_instants[lane] * steps_per_instant,
                    -1.0,
                    coefficients,
                );
            }
        }
        samples
    }

    /// Adds the derivatives of the forces with corners at an instant of a turn, times a sign.
    #[inline(always)]
    fn add_corner_derivatives(
        &self,
        turn: usize,
        instant: usize,
        sign: f64,
        coefficients: &mut SmoothCoefficients,
    ) {
        let corner_count = coefficients.corner_motions.len();
        for m in 0..corner_count {
            let force = self.corner_forces[instant * corner_count + m].get_lane(turn);
            coefficients.corner_motions[m].add_force_derivatives(
                &force,
                sign,
                &mut coefficients.derivatives,
            );
        }
    }

    /// Computes the derivatives of the accelerations at a state.
    #[inline(always)]
    fn compute_derivatives(
        &self,
        zero: N<T>,
        forcing: &<NonlinearModel<Dual<T>> as System<Dual<T>, STATES>>::Forcing,
        reference_state: &[N<T>; STATES],
        derivatives: &mut [[N<T>; STATES]; COORDINATES],
    ) {
        let mut state = [zero.constant(); STATES];
        for i in 0..STATES {
            state[i] = reference_state[i].constant();
        }
        for j in 0..STATES {
            state[j].0.slope = zero.lit(1.0).0;
            let derivative = self.model.derivative_out_of_line(forcing, &state);
            state[j].0.slope = zero.0;
            for i in 0..COORDINATES {
                derivatives[i][j] = N(derivative[COORDINATES + i].0.slope);
            }
        }
    }
}

/// Returns the weights of the values at the instants in the trigonometric polynomial through the
/// values. There is a list of weights for the start and the middle of each step between the first
/// and the second instant.
#[inline(always)]
pub(super) fn interpolation_weights(step_count: usize, instant_count: usize) -> Vec<Vec<f64>> {
    let subdivisions = 2 * step_count / instant_count;
    let mut weights = vec![vec![0.0; instant_count]; subdivisions];
    // This is a loop, because a closure would be compiled without the instruction set.
    for subdivision in 0..subdivisions {
        for instant in 0..instant_count {
            let turns =
                (subdivision as f64 / subdivisions as f64 - instant as f64) / instant_count as f64;
            let mut harmonic_sum = 0.0;
            for harmonic in 1..instant_count / 2 {
                harmonic_sum += 2.0 * trig::sin_cos_turns(N(harmonic as f64 * turns)).1.0;
            }
            let (_, last_cosine) = trig::sin_cos_turns(N((instant_count / 2) as f64 * turns));
            weights[subdivision][instant] =
                (1.0 + harmonic_sum + last_cosine.0) / instant_count as f64;
        }
    }
    weights
}

/// Interpolates the samples of a turn at `coefficients.len()` equally spaced instants out of the
/// [`INSTANTS_PER_BLOCK`] half steps from `first_instant` on.
#[inline(always)]
fn interpolate(
    samples: &[SmoothCoefficients],
    weights: &[Vec<f64>],
    first_instant: usize,
    coefficients: &mut [SmoothCoefficients],
) {
    let mut weights_by_sample = [[0.0; INSTANTS_PER_TURN_WITH_CORNERS]; INSTANTS_PER_BLOCK];
    let weights_by_sample = &mut weights_by_sample[..coefficients.len()];
    let instant_stride = (INSTANTS_PER_BLOCK - 1) / (coefficients.len() - 1);
    for (k, weights_by_sample) in weights_by_sample.iter_mut().enumerate() {
        let instant_index = first_instant + k * instant_stride;
        let first_sample = instant_index / weights.len();
        let subdivision = instant_index % weights.len();
        for (instant, weight) in weights[subdivision].iter().enumerate() {
            weights_by_sample[(first_sample + instant) % samples.len()] = *weight;
        }
    }
    compute_weighted_sums(samples, weights_by_sample, coefficients);
}

/// Integrates a block of disturbances through a step, with the derivatives at each stage.
#[inline(always)]
fn integrate_step<T: Lane, const VECTORS_PER_BLOCK: usize>(
    zero: N<T>,
    h: N<T>,
    stage_derivatives: [&AccelerationDerivatives; 4],
    disturbances: &mut [[N<T>; STATES]; VECTORS_PER_BLOCK],
) {
    let mut stage_states = *disturbances;
    let start_states = stage_states;
    for stage in 0..4 {
        let derivatives = stage_derivatives[stage];
        let mut accelerations = [[zero; COORDINATES]; VECTORS_PER_BLOCK];
        // Two rows are computed at a time, so that each loaded component of a disturbance is used
        // twice.
        for i in (0..COORDINATES).step_by(2) {
            let mut row_sums = [[zero; VECTORS_PER_BLOCK]; 2];
            for j in 0..STATES {
                let row_pair = [zero.lit(derivatives[i][j].0), zero.lit(derivatives[i + 1][j].0)];
                for c in 0..VECTORS_PER_BLOCK {
                    row_sums[0][c] += row_pair[0] * stage_states[c][j];
                    row_sums[1][c] += row_pair[1] * stage_states[c][j];
                }
            }
            for c in 0..VECTORS_PER_BLOCK {
                accelerations[c][i] = row_sums[0][c];
                accelerations[c][i + 1] = row_sums[1][c];
            }
        }
        let a_step = (h * A[stage]).v();
        let b_step = (h * B[stage]).v();
        for c in 0..VECTORS_PER_BLOCK {
            for i in 0..COORDINATES {
                let speed = stage_states[c][COORDINATES + i];
                let acceleration = accelerations[c][i];
                stage_states[c][i] = start_states[c][i] + a_step * speed;
                disturbances[c][i] += b_step * speed;
                stage_states[c][COORDINATES + i] =
                    start_states[c][COORDINATES + i] + a_step * acceleration;
                disturbances[c][COORDINATES + i] += b_step * acceleration;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::array::from_fn;
    use core::f64::consts::TAU;

    #[test]
    fn interpolation_reproduces_a_trigonometric_polynomial() {
        let wave_value =
            |turns: f64| 0.3 + (TAU * turns).sin() - 0.5 * (7.0 * TAU * turns + 0.2).cos();
        let values: [f64; INSTANTS_PER_TURN] =
            from_fn(|k| wave_value(k as f64 / INSTANTS_PER_TURN as f64));
        for (subdivision, weights) in
            interpolation_weights(5 * INSTANTS_PER_TURN / 2, INSTANTS_PER_TURN).iter().enumerate()
        {
            let interpolated_value: f64 =
                weights.iter().zip(values).map(|(weight, value)| weight * value).sum();
            let turns = subdivision as f64 / 5.0 / INSTANTS_PER_TURN as f64;
            assert!(
                (interpolated_value - wave_value(turns)).abs() < 1e-14,
                "{subdivision}: {interpolated_value}"
            );
        }
    }
}

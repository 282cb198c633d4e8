//! The Floquet modes of the linear model, which is periodic in theta: its Floquet exponents are the
//! exact frequencies and dampings, whereas modal analysis freezes theta.

use super::monodromy::{INSTANTS_PER_TURN, StateMatrix, scale_speeds};
use super::participation::modal_energies;
use super::period_map::{TurnSetup, lane_model};
use super::turn::{NoObserver, StepGrid, integrate_turn};
use super::{ResponseError, round_last_digits};
use crate::coordinates::{COORDINATES, STATES};
use crate::modes::{Mode, highest_frequency_rad_per_s, modes};
use crate::point::Point;
use crate::run::model::LinearModel;
use core::f64::consts::TAU;
use faer::{Mat, c64};
use lane_ode::{Kernel, Lane, N, Simd};

/// The product of step and frequency of the fastest mode (rad). Basis: it makes the bearings' modes
/// accurate as well. Doubling it makes their errors 16 times as large.
const STEP_PHASE_RAD: f64 = 0.1;

/// The least magnitude of a multiplier. Basis: smaller multipliers are lost in the rounding errors
/// of larger ones. Doubling it also drops modes whose logarithmic decay in a turn is less by up to
/// ln 2.
const MIN_MULTIPLIER: f64 = 1e-5;

/// The least number of steps of a turn. Doubling it doubles the time at high speeds.
const MIN_STEPS_PER_TURN: f64 = 100.0;

/// A Floquet mode of the linear model, and the mode with theta frozen that is most similar to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloquetMode {
    /// The mode at theta = 0.
    pub frozen_mode: Mode,
    /// The real part of the Floquet exponent (1/s).
    pub re_per_s: f64,
    /// The imaginary part of the Floquet exponent (rad/s). It is determined up to multiples of the
    /// drum's speed; of these values it is the one nearest to the frequency of the mode with theta
    /// frozen.
    pub im_rad_per_s: f64,
}

impl FloquetMode {
    /// Returns the frequency in cycles per minute.
    #[must_use]
    pub fn frequency_rpm(&self) -> f64 {
        self.im_rad_per_s * 60.0 / TAU
    }

    /// Returns the damping ratio, relative to critical damping.
    #[must_use]
    pub fn damping_ratio(&self) -> f64 {
        let squared_magnitude =
            self.re_per_s * self.re_per_s + self.im_rad_per_s * self.im_rad_per_s;
        -self.re_per_s / squared_magnitude.sqrt()
    }
}

/// Returns the linear model's Floquet modes while the drum turns at `speed_rpm`, above 0, one for
/// each mode with theta frozen at 0, the slowest mode first. Modes whose multiplier is lost in
/// rounding errors are skipped.
///
/// # Errors
/// Returns [`ResponseError::NoEigenvalues`] if the eigenvalues cannot be computed.
pub fn floquet_modes(point: &Point, speed_rpm: f64) -> Result<Vec<FloquetMode>, ResponseError> {
    let speed_rad_per_s = speed_rpm * TAU / 60.0;
    let highest_rad_per_s = highest_frequency_rad_per_s(point, speed_rad_per_s)
        .map_err(|_| ResponseError::NoEigenvalues)?;
    let step_count =
        (highest_rad_per_s * 60.0 / speed_rpm / STEP_PHASE_RAD).ceil().max(MIN_STEPS_PER_TURN);
    let setup = TurnSetup {
        point,
        speed_rpm,
        step_count: step_count as usize,
        instant_count: INSTANTS_PER_TURN,
        caps: None,
        corner_width_m: 0.0,
    };
    let unit_per_s = setup.unit_per_s();
    let matrix = scale_speeds(&Simd::dispatch_narrow(LinearMonodromy(setup)), unit_per_s);
    let decomposition = matrix.eigen().map_err(|_| ResponseError::NoEigenvalues)?;
    let eigenvalues = decomposition.S().column_vector();
    let eigenvectors = decomposition.U();
    let frozen_modes =
        modes(point, 0.0, speed_rad_per_s).map_err(|_| ResponseError::NoEigenvalues)?;
    // The similarity of each eigenvector with each mode.
    let mut similarities = Vec::with_capacity(STATES * COORDINATES);
    for eigenvalue_index in 0..STATES {
        let eigenvector = Mat::from_fn(STATES, 1, |i, _| eigenvectors[(i, eigenvalue_index)]);
        let mode_energies = modal_energies(&frozen_modes, &eigenvector, unit_per_s);
        let total_energy: f64 = mode_energies.iter().map(|(_, energy)| energy).sum();
        if !(eigenvalues[eigenvalue_index].re.is_finite()
            && eigenvalues[eigenvalue_index].im.is_finite()
            && total_energy > 0.0)
        {
            return Err(ResponseError::NoEigenvalues);
        }
        similarities.extend(
            mode_energies
                .into_iter()
                .map(|(mode, energy)| (energy / total_energy, mode, eigenvalue_index)),
        );
    }
    similarities.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    // A conjugate pair of eigenvalues belongs to one mode; the most similar pairs of mode and
    // eigenvalue are assigned first.
    let mut sorted_modes = Vec::with_capacity(COORDINATES);
    let mut has_eigenvalue = [false; COORDINATES];
    let mut is_assigned = [false; STATES];
    for (_, mode, eigenvalue_index) in similarities {
        if has_eigenvalue[mode] || is_assigned[eigenvalue_index] {
            continue;
        }
        let mu = eigenvalues[eigenvalue_index];
        let is_conjugate = |other: c64| (other - mu.conj()).norm() <= 1e-9 * mu.norm();
        let conjugate_index = (0..STATES).find(|&other| {
            other != eigenvalue_index && !is_assigned[other] && is_conjugate(eigenvalues[other])
        });
        is_assigned[eigenvalue_index] = true;
        if let Some(conjugate_index) = conjugate_index {
            is_assigned[conjugate_index] = true;
        }
        has_eigenvalue[mode] = true;
        if mu.norm_sqr() > MIN_MULTIPLIER * MIN_MULTIPLIER {
            sorted_modes.push(nearest_floquet_mode(&frozen_modes.modes[mode], mu, speed_rpm));
        }
    }
    let frozen_frequency = |mode: &FloquetMode| mode.frozen_mode.magnitude_rad_per_s;
    sorted_modes.sort_by(|a, b| frozen_frequency(a).total_cmp(&frozen_frequency(b)));
    Ok(sorted_modes)
}

/// Returns the Floquet mode of a multiplier, with the exponent nearest to that of a frozen mode.
fn nearest_floquet_mode(frozen_mode: &Mode, mu: c64, speed_rpm: f64) -> FloquetMode {
    let re = round_last_digits(mu.re);
    let im = round_last_digits(mu.im);
    let speed_rad_per_s = speed_rpm * TAU / 60.0;
    let re_per_s = super::growth_per_s([re, im], speed_rpm);
    let argument_turns = libm::atan2(im, re) / TAU;
    let nearest_rad_per_s = |argument_turns: f64| {
        let whole_turns =
            (frozen_mode.im_rad_per_s / speed_rad_per_s - argument_turns).round_ties_even();
        (argument_turns + whole_turns) * speed_rad_per_s
    };
    // The conjugate multiplier belongs to the same mode.
    let [from_multiplier, from_conjugate] =
        [nearest_rad_per_s(argument_turns), nearest_rad_per_s(-argument_turns)];
    let frequency_distance = |im: f64| (im - frozen_mode.im_rad_per_s).abs();
    let im_rad_per_s = if frequency_distance(from_multiplier) <= frequency_distance(from_conjugate)
    {
        from_multiplier
    } else {
        from_conjugate
    };
    FloquetMode { frozen_mode: *frozen_mode, re_per_s, im_rad_per_s }
}

/// The computation of the linear model's monodromy matrix, without caps.
struct LinearMonodromy<'a>(TurnSetup<'a>);

impl Kernel for LinearMonodromy<'_> {
    /// The monodromy matrix.
    type Output = StateMatrix;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> StateMatrix {
        let zero = N(zero);
        let setup = self.0;
        // Every lane has the same machine and one disturbance; the first group has no disturbance.
        let model: LinearModel<T> = lane_model(zero, &[setup]);
        let grid = StepGrid {
            step_s: zero.lit(setup.step_s()),
            step_count: setup.step_count,
            hinge_damping_factor: None,
        };
        let mut lane_groups = vec![[zero; STATES]; 1 + STATES.div_ceil(T::LANES)];
        for j in 0..STATES {
            lane_groups[1 + j / T::LANES][j].0.set(j % T::LANES, 1.0);
        }
        integrate_turn(&model, &grid, &mut lane_groups, None::<&mut NoObserver>);
        let mut matrix = [[N(0.0); STATES]; STATES];
        for i in 0..STATES {
            for j in 0..STATES {
                let end_difference = lane_groups[1 + j / T::LANES][i] - lane_groups[0][i];
                matrix[i][j] = N(end_difference.0.get(j % T::LANES));
            }
        }
        matrix
    }
}

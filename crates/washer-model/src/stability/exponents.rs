//! The linear model exactly: it is periodic in theta, and its Floquet exponents are its true
//! frequencies and dampings, where modal analysis freezes theta.

use super::monodromy::{INSTANTS, Square, per_unit};
use super::orbit::{Row, model};
use super::participants::energies;
use super::turn::{Clock, Unwatched, turn};
use super::{NoAnswer, rounded};
use crate::coordinates::{COORDINATES, STATES};
use crate::modes::{Mode, highest_frequency_rad_per_s, modes};
use crate::point::Point;
use crate::run::model::Linear;
use core::f64::consts::TAU;
use faer::{Mat, c64};
use lane_ode::{Kernel, Lane, N, Simd};

/// Step times the fastest mode: the bearings' frequencies and dampings are to be right too.
const STEP_PHASE: f64 = 0.1;

/// A multiplier below this is lost beside the others' rounding.
const LEAST_MULTIPLIER: f64 = 1e-5;

/// Steps a turn, however fast.
const LEAST_STEPS: f64 = 100.0;

/// A mode with theta frozen, and the motion of the turning drum that is most of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exact {
    /// The mode at theta = 0.
    pub frozen: Mode,
    /// Real part of the motion's exponent (1/s).
    pub re_per_s: f64,
    /// Imaginary part (rad/s). Whole multiples of the drum's speed could be added: this is the one
    /// nearest to the mode's.
    pub im_rad_per_s: f64,
}

impl Exact {
    /// Returns the frequency in cycles per minute.
    #[must_use]
    pub fn frequency_rpm(&self) -> f64 {
        self.im_rad_per_s * 60.0 / TAU
    }

    /// Returns the share of critical damping.
    #[must_use]
    pub fn damping_ratio(&self) -> f64 {
        let squared = self.re_per_s * self.re_per_s + self.im_rad_per_s * self.im_rad_per_s;
        -self.re_per_s / squared.sqrt()
    }
}

/// Returns the linear model's motions while the drum turns at `speed_rpm`, above 0, one for each
/// mode with theta frozen at 0, the slowest mode first; without those that decay so far within a
/// turn that nothing is left to see.
///
/// # Errors
/// [`NoAnswer::Eigenvalues`].
pub fn exact_motions(point: &Point, speed_rpm: f64) -> Result<Vec<Exact>, NoAnswer> {
    let speed = speed_rpm * TAU / 60.0;
    let highest = highest_frequency_rad_per_s(point, speed).map_err(|_| NoAnswer::Eigenvalues)?;
    let steps = (highest * 60.0 / speed_rpm / STEP_PHASE).ceil().max(LEAST_STEPS);
    let row = Row { point, speed_rpm, steps: steps as usize, instants: INSTANTS, caps: None };
    let unit_per_s = row.unit_per_s();
    let matrix = per_unit(&Simd::dispatch_narrow(OfTurn(row)), unit_per_s);
    let decomposition = matrix.eigen().map_err(|_| NoAnswer::Eigenvalues)?;
    let values = decomposition.S().column_vector();
    let vectors = decomposition.U();
    let frozen = modes(point, 0.0, speed).map_err(|_| NoAnswer::Eigenvalues)?;
    // The similarity of each motion with each mode.
    let mut likeness = Vec::with_capacity(STATES * COORDINATES);
    for k in 0..STATES {
        let vector = Mat::from_fn(STATES, 1, |i, _| vectors[(i, k)]);
        let energies = energies(&frozen, &vector, unit_per_s);
        let whole: f64 = energies.iter().map(|(_, energy)| energy).sum();
        if !(values[k].re.is_finite() && values[k].im.is_finite() && whole > 0.0) {
            return Err(NoAnswer::Eigenvalues);
        }
        likeness.extend(energies.into_iter().map(|(mode, energy)| (energy / whole, mode, k)));
    }
    likeness.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    // A pair of conjugates belongs to one mode, and the likest pairs are taken first.
    let mut exact = Vec::with_capacity(COORDINATES);
    let mut is_given = [false; COORDINATES];
    let mut is_taken = [false; STATES];
    for (_, mode, k) in likeness {
        if is_given[mode] || is_taken[k] {
            continue;
        }
        let mu = values[k];
        let is_pair = |other: c64| (other - mu.conj()).norm() <= 1e-9 * mu.norm();
        let conjugate =
            (0..STATES).find(|&other| other != k && !is_taken[other] && is_pair(values[other]));
        is_taken[k] = true;
        if let Some(conjugate) = conjugate {
            is_taken[conjugate] = true;
        }
        is_given[mode] = true;
        if mu.norm_sqr() > LEAST_MULTIPLIER * LEAST_MULTIPLIER {
            exact.push(exponent(&frozen.modes[mode], mu, speed_rpm));
        }
    }
    let slowness = |exact: &Exact| exact.frozen.magnitude_rad_per_s;
    exact.sort_by(|a, b| slowness(a).total_cmp(&slowness(b)));
    Ok(exact)
}

/// Returns the exponent of a multiplier, the nearest to a mode.
fn exponent(frozen: &Mode, mu: c64, speed_rpm: f64) -> Exact {
    let re = rounded(mu.re);
    let im = rounded(mu.im);
    let speed = speed_rpm * TAU / 60.0;
    let re_per_s = super::growth_per_s([re, im], speed_rpm);
    let turns = libm::atan2(im, re) / TAU;
    let nearest = |turns: f64| {
        let whole = (frozen.im_rad_per_s / speed - turns).round_ties_even();
        (turns + whole) * speed
    };
    // The conjugate belongs to it too.
    let [one, other] = [nearest(turns), nearest(-turns)];
    let apart = |im: f64| (im - frozen.im_rad_per_s).abs();
    let im_rad_per_s = if apart(one) <= apart(other) { one } else { other };
    Exact { frozen: *frozen, re_per_s, im_rad_per_s }
}

/// A turn of the linear model, without caps.
struct OfTurn<'a>(Row<'a>);

impl Kernel for OfTurn<'_> {
    /// The monodromy matrix.
    type Output = Square;

    #[inline(always)]
    fn run<T: Lane>(self, zero: T) -> Square {
        let zero = N(zero);
        let row = self.0;
        // The one machine in every lane, a disturbance in each; the first group has none.
        let linear: Linear<T> = model(zero, &[row]);
        let clock = Clock { step_s: zero.lit(row.step_s()), steps: row.steps, hinge_kept: None };
        let mut groups = vec![[zero; STATES]; 1 + STATES.div_ceil(T::LANES)];
        for j in 0..STATES {
            groups[1 + j / T::LANES][j].0.set(j % T::LANES, 1.0);
        }
        turn(&linear, &clock, &mut groups, None::<&mut Unwatched>);
        let mut matrix = [[N(0.0); STATES]; STATES];
        for i in 0..STATES {
            for j in 0..STATES {
                let moved = groups[1 + j / T::LANES][i] - groups[0][i];
                matrix[i][j] = N(moved.0.get(j % T::LANES));
            }
        }
        matrix
    }
}

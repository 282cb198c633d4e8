//! The participation of the linear model's modes in the disturbance that grows fastest.

use super::ParticipatingMode;
use crate::modes::Modes;

use crate::coordinates::{COORDINATES, STATES};
use crate::modes::shape;
use crate::point::Point;
use faer::linalg::solvers::Solve as _;
use faer::{Mat, c64};

/// The share of the energy in the participating modes above which no further mode is added. Basis:
/// the remaining modes do not characterise the motion. Doubling it always gives two modes.
const NAMED_ENERGY_SHARE: f64 = 0.9;

/// The greatest number of participating modes. Basis: a parametric resonance has one or two.
/// Doubling it adds modes that take part by accident.
const MAX_NAMED_MODES: usize = 2;

/// The number of inverse iterations. Basis: each reduces other eigenvectors by the ratio of the
/// shift to the distance of their eigenvalues. Doubling it changes rounding only.
const INVERSE_ITERATIONS: usize = 3;

/// The relative distance of the shift of inverse iteration from the multiplier, at which the matrix
/// would be singular.
const RELATIVE_SHIFT: f64 = 1e-9;

/// Returns the index of every mode and the mode's share of a disturbance's energy at theta = 0;
/// shares are not finite for a disturbance of zero.
pub(super) fn energy_shares(
    frozen_modes: &Modes,
    disturbance: &Mat<c64>,
    unit_per_s: f64,
) -> Vec<(usize, f64)> {
    let mut mode_shares = modal_energies(frozen_modes, disturbance, unit_per_s);
    let total_energy: f64 = mode_shares.iter().map(|(_, energy)| energy).sum();
    mode_shares.iter_mut().for_each(|(_, energy)| *energy /= total_energy);
    mode_shares
}

/// Returns the one or two modes with most of a disturbance's energy.
pub(super) fn participating_modes(
    point: &Point,
    frozen_modes: &Modes,
    disturbance: &Mat<c64>,
    unit_per_s: f64,
) -> Vec<ParticipatingMode> {
    let mut mode_shares = energy_shares(frozen_modes, disturbance, unit_per_s);
    mode_shares.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let mut named_modes = Vec::with_capacity(MAX_NAMED_MODES);
    let mut named_energy_share = 0.0;
    for (mode_index, share) in mode_shares.into_iter().take(MAX_NAMED_MODES) {
        if named_energy_share >= NAMED_ENERGY_SHARE {
            break;
        }
        named_energy_share += share;
        let mode = &frozen_modes.modes[mode_index];
        named_modes.push(ParticipatingMode {
            mode: mode_index + 1,
            frequency_cpm: mode.frequency_rpm(),
            motion: shape::dominant_motion(point, &frozen_modes.mass, &mode.shape),
            share,
        });
    }
    named_modes
}

/// Returns the eigenvector of a multiplier, by inverse iteration.
pub(super) fn eigenvector(monodromy: &Mat<f64>, multiplier: c64) -> Mat<c64> {
    let shift = multiplier * (1.0 + RELATIVE_SHIFT);
    let shifted_matrix = Mat::from_fn(STATES, STATES, |i, j| {
        let entry = c64::new(monodromy[(i, j)], 0.0);
        if i == j { entry - shift } else { entry }
    });
    let factors = shifted_matrix.partial_piv_lu();
    let mut iterate = Mat::from_fn(STATES, 1, |_, _| c64::new(1.0, 0.0));
    for _ in 0..INVERSE_ITERATIONS {
        iterate = factors.solve(iterate);
        let norm = (0..STATES).map(|i| iterate[(i, 0)].norm_sqr()).sum::<f64>().sqrt();
        iterate = Mat::from_fn(STATES, 1, |i, _| iterate[(i, 0)] / norm);
    }
    iterate
}

/// Returns the index of every mode and the mode's part of a disturbance's energy: the squares of
/// the modal coordinates, weighted by the energy of a unit coordinate.
pub(super) fn modal_energies(
    frozen_modes: &Modes,
    disturbance: &Mat<c64>,
    unit_per_s: f64,
) -> Vec<(usize, f64)> {
    // The right eigenvectors, two for each mode: those of the conjugate pair, or for an overdamped
    // mode its shape as a displacement and as a velocity.
    let eigenvectors = Mat::from_fn(STATES, STATES, |i, column| {
        let mode = &frozen_modes.modes[column / 2];
        let [re, im] = mode.shape[i % COORDINATES];
        let is_speed = i >= COORDINATES;
        let is_second_of_pair = column % 2 == 1;
        if mode.im_rad_per_s == 0.0 {
            let component = if is_speed == is_second_of_pair { re } else { 0.0 };
            return c64::new(component, 0.0);
        }
        let sign = if is_second_of_pair { -1.0 } else { 1.0 };
        let entry = c64::new(re, sign * im);
        let s = c64::new(mode.re_per_s, sign * mode.im_rad_per_s);
        if is_speed { entry * s / unit_per_s } else { entry }
    });
    let modal_coordinates = eigenvectors.partial_piv_lu().solve(disturbance);
    let mode_energy = |mode_index: usize| {
        let mode = &frozen_modes.modes[mode_index];
        let squared_coordinates =
            [2 * mode_index, 2 * mode_index + 1].map(|i| modal_coordinates[(i, 0)].norm_sqr());
        let modal_stiffness = mode.magnitude_rad_per_s * mode.magnitude_rad_per_s;
        if mode.im_rad_per_s == 0.0 {
            modal_stiffness * squared_coordinates[0]
                + unit_per_s * unit_per_s * squared_coordinates[1]
        } else {
            modal_stiffness * (squared_coordinates[0] + squared_coordinates[1])
        }
    };
    (0..COORDINATES).map(|mode_index| (mode_index, mode_energy(mode_index))).collect()
}

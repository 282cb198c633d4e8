//! Which modes of the linear model take part in what grows.

use super::Participant;
use crate::modes::Modes;

use crate::coordinates::{COORDINATES, STATES};
use crate::modes::shape;
use crate::point::Point;
use faer::linalg::solvers::Solve as _;
use faer::{Mat, c64};

/// The share of the energy that the modes carry that are named. Basis: what is left is no part of
/// the motion's name. Doubling it names two modes always.
const ENOUGH: f64 = 0.9;

/// The greatest number of modes that are named. Basis: a resonance is of one or two. Doubling it
/// names accidental ones.
const MAX_NAMED: usize = 2;

/// Rounds of inverse iteration; the first leaves what the shift's distance is to the next
/// eigenvalue's.
const ROUNDS: usize = 3;

/// The distance from the multiplier, relative, at which its vector is looked for: exactly there the
/// matrix is singular.
const BESIDE: f64 = 1e-9;

/// Returns for every mode, by its place, the share of a disturbance's energy at theta = 0; not
/// finite where there is no such disturbance.
pub(super) fn shares(frozen: &Modes, vector: &Mat<c64>, unit_per_s: f64) -> Vec<(usize, f64)> {
    let mut shares = energies(frozen, vector, unit_per_s);
    let whole: f64 = shares.iter().map(|(_, energy)| energy).sum();
    shares.iter_mut().for_each(|(_, energy)| *energy /= whole);
    shares
}

/// Returns the one or two modes that have most of a disturbance's energy.
pub(super) fn named(
    point: &Point,
    frozen: &Modes,
    vector: &Mat<c64>,
    unit_per_s: f64,
) -> Vec<Participant> {
    let mut shares = shares(frozen, vector, unit_per_s);
    shares.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let mut named = Vec::with_capacity(MAX_NAMED);
    let mut sum = 0.0;
    for (k, share) in shares.into_iter().take(MAX_NAMED) {
        if sum >= ENOUGH {
            break;
        }
        sum += share;
        let mode = &frozen.modes[k];
        named.push(Participant {
            mode: k + 1,
            frequency_cpm: mode.frequency_rpm(),
            motion: shape::motion(point, &frozen.mass, &mode.shape),
            share,
        });
    }
    named
}

/// Returns the eigenvector of a multiplier, by inverse iteration.
pub(super) fn vector_of(monodromy: &Mat<f64>, multiplier: c64) -> Mat<c64> {
    let beside = multiplier * (1.0 + BESIDE);
    let shifted = Mat::from_fn(STATES, STATES, |i, j| {
        let entry = c64::new(monodromy[(i, j)], 0.0);
        if i == j { entry - beside } else { entry }
    });
    let factors = shifted.partial_piv_lu();
    let mut vector = Mat::from_fn(STATES, 1, |_, _| c64::new(1.0, 0.0));
    for _ in 0..ROUNDS {
        vector = factors.solve(vector);
        let size = (0..STATES).map(|i| vector[(i, 0)].norm_sqr()).sum::<f64>().sqrt();
        vector = Mat::from_fn(STATES, 1, |i, _| vector[(i, 0)] / size);
    }
    vector
}

/// Computes what every mode has of a disturbance's energy: its modal coordinates, which are its
/// products with the left eigenvectors, squared and weighted by the energy of a unit.
pub(super) fn energies(frozen: &Modes, vector: &Mat<c64>, unit_per_s: f64) -> Vec<(usize, f64)> {
    // Right eigenvectors, two columns a mode: the pair's, or for a motion that does not swing its
    // shape standing and its shape moving.
    let columns = Mat::from_fn(STATES, STATES, |i, column| {
        let mode = &frozen.modes[column / 2];
        let [re, im] = mode.shape[i % COORDINATES];
        let is_speed = i >= COORDINATES;
        let is_second = column % 2 == 1;
        if mode.im_rad_per_s == 0.0 {
            let part = if is_speed == is_second { re } else { 0.0 };
            return c64::new(part, 0.0);
        }
        let sign = if is_second { -1.0 } else { 1.0 };
        let entry = c64::new(re, sign * im);
        let s = c64::new(mode.re_per_s, sign * mode.im_rad_per_s);
        if is_speed { entry * s / unit_per_s } else { entry }
    });
    let coordinates = columns.partial_piv_lu().solve(vector);
    let energy = |k: usize| {
        let mode = &frozen.modes[k];
        let squares = [2 * k, 2 * k + 1].map(|i| coordinates[(i, 0)].norm_sqr());
        let stiffness = mode.magnitude_rad_per_s * mode.magnitude_rad_per_s;
        if mode.im_rad_per_s == 0.0 {
            stiffness * squares[0] + unit_per_s * unit_per_s * squares[1]
        } else {
            stiffness * (squares[0] + squares[1])
        }
    };
    (0..COORDINATES).map(|k| (k, energy(k))).collect()
}

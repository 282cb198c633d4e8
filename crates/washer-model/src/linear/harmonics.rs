//! Trigonometric polynomials in theta, and the functions of the spin that multiply them.

use crate::machine::spin::SpinState;
use lane_ode::{N, Real};

/// The number of harmonics 0 to 2: 1, cos, sin, cos 2, sin 2.
pub(crate) const HARMONICS: usize = 5;

/// The sampling angles 2 pi k / 5 of a polynomial of harmonics 0 to 2, by cosine and sine.
pub(crate) const SAMPLE_ANGLES: [(f64, f64); HARMONICS] = [
    (1.0, 0.0),
    (0.309_016_994_374_947_45, 0.951_056_516_295_153_5),
    (-0.809_016_994_374_947_5, 0.587_785_252_292_473_1),
    (-0.809_016_994_374_947_5, -0.587_785_252_292_473_1),
    (0.309_016_994_374_947_45, -0.951_056_516_295_153_5),
];

/// Computes the coefficients of 1, cos, sin, cos 2, sin 2 from values at [`SAMPLE_ANGLES`] (a
/// discrete Fourier transform).
pub(crate) fn harmonic_coefficients(values: [f64; HARMONICS]) -> [f64; HARMONICS] {
    let mut coefficients = [0.0; HARMONICS];
    for (k, value) in values.into_iter().enumerate() {
        let (cos, sin) = SAMPLE_ANGLES[k];
        let (cos_2, sin_2) = SAMPLE_ANGLES[2 * k % HARMONICS];
        for (coefficient, basis) in coefficients.iter_mut().zip([0.5, cos, sin, cos_2, sin_2]) {
            *coefficient = (0.4 * value).mul_add(basis, *coefficient);
        }
    }
    coefficients
}

/// The index of the constant function 1.
pub(crate) const CONSTANT: usize = 0;
/// The index of cos theta.
pub(crate) const COS: usize = 1;
/// The index of sin theta.
pub(crate) const SIN: usize = 2;
/// The index of cos 2 theta.
pub(crate) const COS_2: usize = 3;
/// The index of sin 2 theta.
pub(crate) const SIN_2: usize = 4;
/// The index of theta'.
pub(crate) const SPEED: usize = 5;
/// The index of theta' cos theta.
pub(crate) const SPEED_COS: usize = 6;
/// The index of theta' sin theta.
pub(crate) const SPEED_SIN: usize = 7;
/// The index of theta' cos 2 theta.
pub(crate) const SPEED_COS_2: usize = 8;
/// The index of theta' sin 2 theta.
pub(crate) const SPEED_SIN_2: usize = 9;
/// The index of theta'^2.
pub(crate) const SPIN: usize = 10;
/// The index of theta'^2 cos theta + theta'' sin theta.
pub(crate) const SPIN_COS: usize = 11;
/// The index of theta'^2 sin theta - theta'' cos theta.
pub(crate) const SPIN_SIN: usize = 12;
/// The index of theta'^2 cos 2 theta + theta'' sin 2 theta.
pub(crate) const SPIN_COS_2: usize = 13;
/// The index of theta'^2 sin 2 theta - theta'' cos 2 theta.
pub(crate) const SPIN_SIN_2: usize = 14;
/// The index of theta''.
pub(crate) const ACCELERATION: usize = 15;
/// The number of functions of the spin.
pub(crate) const FUNCTIONS: usize = 16;

/// Computes all functions at an instant. The model page (section 5) derives the pairs of theta'^2
/// and theta''.
#[inline(always)]
pub(crate) fn spin_functions<T: Real>(spin: &SpinState<T>) -> [N<T>; FUNCTIONS] {
    let SpinState { sin, cos, sin_2, cos_2, speed, acceleration, .. } = *spin;
    let speed_squared = (speed * speed).v();
    let mut functions = [sin.lit(1.0); FUNCTIONS];
    functions[COS] = cos;
    functions[SIN] = sin;
    functions[COS_2] = cos_2;
    functions[SIN_2] = sin_2;
    functions[SPEED] = speed;
    functions[SPEED_COS] = (speed * cos).v();
    functions[SPEED_SIN] = (speed * sin).v();
    functions[SPEED_COS_2] = (speed * cos_2).v();
    functions[SPEED_SIN_2] = (speed * sin_2).v();
    functions[SPIN] = speed_squared;
    functions[SPIN_COS] = speed_squared * cos + acceleration * sin;
    functions[SPIN_SIN] = speed_squared * sin - acceleration * cos;
    functions[SPIN_COS_2] = speed_squared * cos_2 + acceleration * sin_2;
    functions[SPIN_SIN_2] = speed_squared * sin_2 - acceleration * cos_2;
    functions[ACCELERATION] = acceleration;
    functions
}

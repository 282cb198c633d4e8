//! Trigonometric polynomials in theta, and the functions of the spin that multiply them.

use crate::machine::spin::SpinState;
use lane_ode::{N, Real};

/// Harmonics 0 to 2: 1, cos, sin, cos 2, sin 2.
pub(crate) const HARMONICS: usize = 5;

/// Angles at which a polynomial of harmonics 0 to 2 is sampled: cos and sin of 2 pi k / 5.
pub(crate) const SAMPLES: [(f64, f64); HARMONICS] = [
    (1.0, 0.0),
    (0.309_016_994_374_947_45, 0.951_056_516_295_153_5),
    (-0.809_016_994_374_947_5, 0.587_785_252_292_473_1),
    (-0.809_016_994_374_947_5, -0.587_785_252_292_473_1),
    (0.309_016_994_374_947_45, -0.951_056_516_295_153_5),
];

/// Coefficients of 1, cos, sin, cos 2, sin 2 from values at [`SAMPLES`].
pub(crate) fn coefficients(values: [f64; HARMONICS]) -> [f64; HARMONICS] {
    let mut c = [0.0; HARMONICS];
    for (k, value) in values.into_iter().enumerate() {
        let (cos, sin) = SAMPLES[k];
        let (cos_2, sin_2) = SAMPLES[2 * k % HARMONICS];
        for (c, basis) in c.iter_mut().zip([0.5, cos, sin, cos_2, sin_2]) {
            *c = (0.4 * value).mul_add(basis, *c);
        }
    }
    c
}

// The functions of an instant: harmonics, ...
pub(crate) const ONE: usize = 0;
pub(crate) const COS: usize = 1;
pub(crate) const SIN: usize = 2;
pub(crate) const COS_2: usize = 3;
pub(crate) const SIN_2: usize = 4;
// ... times theta', ...
pub(crate) const SPEED: usize = 5;
pub(crate) const SPEED_COS: usize = 6;
pub(crate) const SPEED_SIN: usize = 7;
pub(crate) const SPEED_COS_2: usize = 8;
pub(crate) const SPEED_SIN_2: usize = 9;
// ... and as theta'^2 and theta'' bring them.
pub(crate) const SPIN: usize = 10;
pub(crate) const SPIN_COS: usize = 11;
pub(crate) const SPIN_SIN: usize = 12;
pub(crate) const SPIN_COS_2: usize = 13;
pub(crate) const SPIN_SIN_2: usize = 14;
pub(crate) const ACCELERATION: usize = 15;
/// How many there are.
pub(crate) const FUNCTIONS: usize = 16;

/// All functions at one instant. The model page (section 5) says why theta'^2 and theta'' come in
/// pairs.
#[inline(always)]
pub(crate) fn functions<T: Real>(spin: &SpinState<T>) -> [N<T>; FUNCTIONS] {
    let SpinState { sin, cos, sin_2, cos_2, speed, acceleration, .. } = *spin;
    let squared = (speed * speed).v();
    let mut f = [sin.lit(1.0); FUNCTIONS];
    f[COS] = cos;
    f[SIN] = sin;
    f[COS_2] = cos_2;
    f[SIN_2] = sin_2;
    f[SPEED] = speed;
    f[SPEED_COS] = (speed * cos).v();
    f[SPEED_SIN] = (speed * sin).v();
    f[SPEED_COS_2] = (speed * cos_2).v();
    f[SPEED_SIN_2] = (speed * sin_2).v();
    f[SPIN] = squared;
    f[SPIN_COS] = squared * cos + acceleration * sin;
    f[SPIN_SIN] = squared * sin - acceleration * cos;
    f[SPIN_COS_2] = squared * cos_2 + acceleration * sin_2;
    f[SPIN_SIN_2] = squared * sin_2 - acceleration * cos_2;
    f[ACCELERATION] = acceleration;
    f
}

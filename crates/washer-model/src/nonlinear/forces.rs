//! The forces of the bearings, and of the flexure between drum and shaft (section 3 of the model
//! page).

use crate::lanes::lane_struct;
use crate::nonlinear::coefficients::Bodies;
use lane_ode::{N, Real};

lane_struct! {
    /// The resultant of forces on points of a body's axis (y and z components in cabinet axes).
    #[derive(Clone, Copy, Debug)]
    AxisLoad {
        /// The sum of the forces.
        force: [N<T>; 2],
        /// The sum of the forces times their positions along the axis.
        moment: [N<T>; 2],
    }
}

impl<T: Real> AxisLoad<T> {
    /// Returns the opposite load, which acts on the other body.
    #[inline(always)]
    pub(crate) fn reaction(&self) -> Self {
        let [[fy, fz], [my, mz]] = [self.force, self.moment];
        Self { force: [-fy, -fz], moment: [-my, -mz] }
    }
}

lane_struct! {
    /// The offset of the shaft's bearing midpoint from the tub's, and the tilt of the shaft's axis
    /// against the tub's, both along c2 and c3.
    #[derive(Clone, Copy, Debug)]
    Deflection { offset: [N<T>; 2], tilt: [N<T>; 2] }
}

impl<T: Real> Deflection<T> {
    /// Computes the bearing load on the shaft.
    #[inline(always)]
    pub(crate) fn load_on_shaft(&self, b: &Bodies<T>) -> AxisLoad<T> {
        let zero = b.front_bearing_stiffness.lit(0.0);
        let mut load = AxisLoad { force: [zero; 2], moment: [zero; 2] };
        for (position, stiffness) in [
            (b.front_bearing_x, b.front_bearing_stiffness),
            (b.rear_bearing_x, b.rear_bearing_stiffness),
        ] {
            for i in 0..2 {
                let force = -(stiffness * (self.offset[i] + position * self.tilt[i])).v();
                load.force[i] += force;
                load.moment[i] += position * force;
            }
        }
        load
    }
}

/// Computes the moments of the flexure about q9 and q10 from their sines and cosines: the
/// derivatives of K_D phi^2 / 2 with cos phi = cos q9 cos q10.
#[inline(always)]
pub(crate) fn flexure_moments<T: Real>(
    stiffness: N<T>,
    (s9, c9): (N<T>, N<T>),
    (s10, c10): (N<T>, N<T>),
) -> [N<T>; 2] {
    // sin^2 phi = 1 - cos^2 phi, written without cancellation.
    let sin_squared = s9 * s9 + (c9 * c9) * (s10 * s10);
    let moment_factor = (stiffness * phi_over_sin(sin_squared, (c9 * c10).v())).v();
    [(moment_factor * (s9 * c10)).v(), (moment_factor * (c9 * s10)).v()]
}

/// The coefficients of asin(x)/x in powers of x^2: c_k = c_{k-1} (2k - 1)^2 / (2k (2k + 1)).
const ASIN_SERIES: [f64; 22] = {
    let mut coefficients = [1.0; 22];
    let mut k = 1;
    while k < coefficients.len() {
        let two_k = 2.0 * k as f64;
        coefficients[k] =
            coefficients[k - 1] * ((two_k - 1.0) * (two_k - 1.0)) / (two_k * (two_k + 1.0));
        k += 1;
    }
    coefficients
};

/// The greatest sin^2 phi for the short series of five terms. Basis: the first dropped term is
/// below 2e-17. Doubling it makes that term 32 times as large.
const SMALL_SIN_SQUARED: f64 = 1.0 / 1024.0;

/// Computes phi / sin phi from sin^2 phi and cos phi, for phi up to pi/2 and beyond.
#[inline(always)]
fn phi_over_sin<T: Real>(sin_squared: N<T>, cos: N<T>) -> N<T> {
    let mut short_series = sin_squared.lit(ASIN_SERIES[4]);
    for k in (0..4).rev() {
        short_series = short_series * sin_squared + ASIN_SERIES[k];
    }
    let bound = sin_squared.lit(SMALL_SIN_SQUARED);
    let is_sin_small = sin_squared.0.less(bound.0);
    // The sine decreases again beyond pi/2, so that the sign of the cosine is tested too.
    let is_cos_positive = cos.lit(0.0).0.less(cos.0);
    if T::all(is_sin_small) && T::all(is_cos_positive) {
        return short_series;
    }
    let quarter_angle_ratio = phi_over_sin_by_quarters(sin_squared, cos);
    N(T::select(
        is_cos_positive,
        T::select(is_sin_small, short_series.0, quarter_angle_ratio.0),
        quarter_angle_ratio.0,
    ))
}

/// Computes phi / sin phi from the quarter angle: with s = sin^2(phi/4) it is (asin sqrt(s) /
/// sqrt(s)) / (cos(phi/4) cos(phi/2)).
#[inline(always)]
fn phi_over_sin_by_quarters<T: Real>(sin_squared: N<T>, cos: N<T>) -> N<T> {
    let sin_half_squared = 0.5 * (sin_squared / (1.0 + cos));
    let cos_half_squared = 1.0 - sin_half_squared.v();
    let sin_quarter_squared = (0.5 * (sin_half_squared.v() / (1.0 + cos_half_squared.sqrt()))).v();
    let mut asin_series = sin_quarter_squared.lit(ASIN_SERIES[21]);
    for k in (0..21).rev() {
        asin_series = asin_series * sin_quarter_squared + ASIN_SERIES[k];
    }
    asin_series / ((1.0 - sin_quarter_squared) * cos_half_squared).v().sqrt()
}

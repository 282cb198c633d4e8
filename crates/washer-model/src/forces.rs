//! Forces: springs, dampers, bearings and the drum shaft's flexure (section 3 of the model page).

use crate::coefficients::Bodies;
use crate::coupling::Deflection;
use crate::frame::{Tilt, Vec3, dot, plus_cross, scaled, sum};
use crate::nonlinear::MachineView;
use lane_ode::{Dual, N, Real};

/// Cabinet forces (y, z) on points of a body's axis.
pub(crate) struct AxisLoad<T> {
    /// Their sum.
    pub(crate) force: [N<T>; 2],
    /// Their sum, each times its position along the axis.
    pub(crate) moment: [N<T>; 2],
}

impl<T: Real> AxisLoad<T> {
    /// As a constant of a dual number.
    #[inline(always)]
    pub(crate) fn constant(&self) -> AxisLoad<Dual<T>> {
        let [[fy, fz], [my, mz]] = [self.force, self.moment];
        AxisLoad { force: [fy.constant(), fz.constant()], moment: [my.constant(), mz.constant()] }
    }

    /// What the other body feels.
    #[inline(always)]
    pub(crate) fn reaction(&self) -> Self {
        let [[fy, fz], [my, mz]] = [self.force, self.moment];
        Self { force: [-fy, -fz], moment: [-my, -mz] }
    }
}

/// What springs and dampers do to the tub.
pub(crate) struct SuspensionLoad<T> {
    /// y and z of the force, cabinet axes.
    pub(crate) force: [N<T>; 2],
    /// Moment about the bearing midpoint P_T, tub axes.
    pub(crate) moment: Vec3<T>,
}

impl<T: Real> Deflection<T> {
    /// Bearing forces on the shaft.
    #[inline(always)]
    pub(crate) fn load(&self, b: &Bodies<T>) -> AxisLoad<T> {
        let zero = b.front_stiffness.lit(0.0);
        let mut load = AxisLoad { force: [zero; 2], moment: [zero; 2] };
        for (position, stiffness) in
            [(b.bearing_front, b.front_stiffness), (b.bearing_rear, b.rear_stiffness)]
        {
            for i in 0..2 {
                let force = -(stiffness * (self.offset[i] + position * self.tilt[i])).v();
                load.force[i] += force;
                load.moment[i] += position * force;
            }
        }
        load
    }
}

/// Springs and dampers.
#[inline(always)]
pub(crate) fn suspension_load<T: Real>(
    machine: &MachineView<'_, T>,
    tilt: &Tilt<T>,
    midpoint: &[N<T>; 2],
    midpoint_velocity: &[N<T>; 2],
    rate: &Vec3<T>,
) -> SuspensionLoad<T> {
    let (force, moment) = suspension_on_tub(machine, tilt, midpoint, midpoint_velocity, rate);
    SuspensionLoad {
        force: [
            tilt.axis_c[1] * force[0] + tilt.second_c[1] * force[1],
            tilt.axis_c[2] * force[0] + tilt.second_c[2] * force[1] + tilt.cos_yaw * force[2],
        ],
        moment,
    }
}

/// Force of springs and dampers on the tub, and its moment about the bearing midpoint P_T; in tub axes, where their tub ends
/// stand still.
#[inline(always)]
pub(crate) fn suspension_on_tub<T: Real>(
    machine: &MachineView<'_, T>,
    tilt: &Tilt<T>,
    midpoint: &[N<T>; 2],
    midpoint_velocity: &[N<T>; 2],
    rate: &Vec3<T>,
) -> (Vec3<T>, Vec3<T>) {
    let zero = midpoint[0].lit(0.0);
    let mut force = [zero; 3];
    let mut moment = [zero; 3];
    for s in machine.springs {
        let end = [s.tub_x, s.tub_y, s.tub_z];
        let d = span(tilt, midpoint, &[s.cabinet_x, s.cabinet_y, s.cabinet_z], &end);
        let pull = s.stiffness_times_free_length / dot(&d, &d).sqrt() - s.stiffness;
        let f = scaled(pull, d);
        force = sum(force, &f);
        moment = plus_cross(&moment, &end, &f);
    }
    if !machine.dampers.is_empty() {
        // Velocity of the midpoint in tub axes.
        let [vy, vz] = *midpoint_velocity;
        let base = [
            tilt.axis_c[1] * vy + tilt.axis_c[2] * vz,
            tilt.second_c[1] * vy + tilt.second_c[2] * vz,
            (tilt.cos_yaw * vz).v(),
        ];
        for damper in machine.dampers {
            let end = [damper.tub_x, damper.tub_y, damper.tub_z];
            let d = span(tilt, midpoint, &[damper.cabinet_x, damper.cabinet_y, damper.cabinet_z], &end);
            let velocity = plus_cross(&base, rate, &end);
            // Eqs. 33 to 35: F = -C (v . n) n.
            let f = scaled(-(damper.damping * dot(&d, &velocity)).v() / dot(&d, &d), d);
            force = sum(force, &f);
            moment = plus_cross(&moment, &end, &f);
        }
    }
    (force, moment)
}

/// From a cabinet end to a tub end, in tub axes. t3 has no y component.
#[inline(always)]
fn span<T: Real>(tilt: &Tilt<T>, midpoint: &[N<T>; 2], cabinet: &Vec3<T>, end: &Vec3<T>) -> Vec3<T> {
    let [x, y, z] = [cabinet[0], cabinet[1] - midpoint[0], cabinet[2] - midpoint[1]];
    let [t1, t2] = [&tilt.axis_c, &tilt.second_c];
    [
        end[0] - t1[0] * x - t1[1] * y - t1[2] * z,
        end[1] - t2[0] * x - t2[1] * y - t2[2] * z,
        end[2] - tilt.sin_yaw * x - tilt.cos_yaw * z,
    ]
}

/// The drum shaft's flexure: derivatives of K_D phi^2 / 2 with cos phi = cos q9 cos q10.
pub(crate) struct Flexure<T> {
    pub(crate) about_9: N<T>,
    pub(crate) about_10: N<T>,
}

impl<T: Real> Flexure<T> {
    #[inline(always)]
    pub(crate) fn new(stiffness: N<T>, s9: N<T>, c9: N<T>, s10: N<T>, c10: N<T>) -> Self {
        // sin^2 phi without cancellation.
        let sin_squared = s9 * s9 + (c9 * c9) * (s10 * s10);
        let factor = (stiffness * phi_over_sin(sin_squared, (c9 * c10).v())).v();
        Self { about_9: (factor * (s9 * c10)).v(), about_10: (factor * (c9 * s10)).v() }
    }
}

/// Coefficients of asin(x)/x in powers of x^2: c_k = c_{k-1} (2k - 1)^2 / (2k (2k + 1)).
const ASIN_SERIES: [f64; 22] = {
    let mut c = [1.0; 22];
    let mut k = 1;
    while k < c.len() {
        let two_k = 2.0 * k as f64;
        c[k] = c[k - 1] * ((two_k - 1.0) * (two_k - 1.0)) / (two_k * (two_k + 1.0));
        k += 1;
    }
    c
};

/// Up to here, sin^2 phi is small enough for a short series: its first dropped term is below 2e-17.
const SMALL_SIN_SQUARED: f64 = 1.0 / 1024.0;

/// phi / sin phi from sin^2 phi and cos phi, for phi up to pi/2 and beyond.
#[inline(always)]
fn phi_over_sin<T: Real>(sin_squared: N<T>, cos: N<T>) -> N<T> {
    let mut short = sin_squared.lit(ASIN_SERIES[4]);
    for k in (0..4).rev() {
        short = short * sin_squared + ASIN_SERIES[k];
    }
    let bound = sin_squared.lit(SMALL_SIN_SQUARED);
    let is_small = sin_squared.0.less(bound.0);
    // A folded hinge has a small sine too.
    let is_ahead = cos.lit(0.0).0.less(cos.0);
    if T::all(is_small) && T::all(is_ahead) {
        return short;
    }
    let long = phi_over_sin_by_quarters(sin_squared, cos);
    N(T::select(is_ahead, T::select(is_small, short.0, long.0), long.0))
}

/// The same by quarter angles: with s = sin^2(phi/4), phi / sin phi = (asin sqrt(s) / sqrt(s)) / (cos(phi/4) cos(phi/2)).
#[inline(always)]
fn phi_over_sin_by_quarters<T: Real>(sin_squared: N<T>, cos: N<T>) -> N<T> {
    let half = 0.5 * (sin_squared / (1.0 + cos));
    let cos_half_squared = 1.0 - half.v();
    let quarter = (0.5 * (half.v() / (1.0 + cos_half_squared.sqrt()))).v();
    let mut series = quarter.lit(ASIN_SERIES[21]);
    for k in (0..21).rev() {
        series = series * quarter + ASIN_SERIES[k];
    }
    series / ((1.0 - quarter) * cos_half_squared).v().sqrt()
}

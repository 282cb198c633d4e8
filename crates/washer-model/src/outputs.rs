//! From coordinates to what is observed: channels and gap (section 6 of the model page).

use crate::channel::Channel;
use crate::coefficients::Bodies;
use crate::frame::{Tilt, Vec3, combination, difference, dot, scaled};
use crate::nonlinear::COORDINATES;
use lane_ode::{N, Real};

/// Number of channels.
pub(crate) const CHANNELS: usize = Channel::ALL.len();

/// Number of outputs: every channel, then the two components of the radial distance.
pub(crate) const OUTPUTS: usize = CHANNELS + 2;

/// Positions (m) and angles (rad) in the order of [`Channel::ALL`], then where the drum's front centre stands from the tub
/// axis, along t2 and t3 (m).
#[inline(always)]
pub(crate) fn outputs<T: Real>(
    b: &Bodies<T>,
    (sin, cos): (N<T>, N<T>),
    q: &[N<T>; COORDINATES],
) -> [N<T>; OUTPUTS] {
    let tub = Tilt::new(q[4], q[5]);
    let shaft = Tilt::new(q[6], q[7]);
    let (s9, c9) = q[8].sin_cos();
    let (s10, c10) = q[9].sin_cos();
    // d1 and rho = rho_1 d1 + rho_2 d2, by way of S.
    let drum_axis = from_spin(&shaft, sin, cos, [(c9 * c10).v(), s10, -(s9 * c10).v()]);
    let rho = {
        let (x, y) = (c10 * b.rho_1 - s10 * b.rho_2, s10 * b.rho_1 + c10 * b.rho_2);
        from_spin(&shaft, sin, cos, [(c9 * x).v(), y, -(s9 * x).v()])
    };

    let midpoint = [q[0], q[1]];
    let rotor_midpoint = [q[2], q[3]];
    let tub_front = in_cabinet(&midpoint, scaled(b.tub_front, tub.axis_c));
    let drum_front =
        in_cabinet(&rotor_midpoint, combination(b.drum_hinge, &shaft.axis_c, b.hinge_to_front, &drum_axis));
    let tub_centre = in_cabinet(&midpoint, scaled(b.tub_centre, tub.axis_c));
    let rotor_centre =
        in_cabinet(&rotor_midpoint, combination(b.along_shaft, &shaft.axis_c, b.drum_share, &rho));
    let total_centre = combination(b.tub_share, &tub_centre, b.rotor_share, &rotor_centre);

    let apart = difference(drum_front, &tub_front);
    let along_2 = dot(&tub.second_c, &apart);
    let along_3 = tub.sin_yaw * apart[0] + tub.cos_yaw * apart[2];
    [
        tub_front[1],
        tub_front[2],
        drum_front[1],
        drum_front[2],
        total_centre[1],
        total_centre[2],
        q[4],
        q[5],
        along_2,
        along_3,
    ]
}

/// Squared distance of the drum's front centre from the tub axis. Its square, because a distance has a kink at zero.
#[inline(always)]
pub(crate) fn radial_squared<T: Real>(outputs: &[N<T>; OUTPUTS]) -> N<T> {
    let [y, z] = [outputs[CHANNELS], outputs[CHANNELS + 1]];
    y * y + z * z
}

/// From S to cabinet axes.
#[inline(always)]
fn from_spin<T: Real>(shaft: &Tilt<T>, sin: N<T>, cos: N<T>, v: Vec3<T>) -> Vec3<T> {
    shaft.to_cabinet(&[v[0], cos * v[1] - sin * v[2], sin * v[1] + cos * v[2]])
}

/// A point of a body: its bearing midpoint, which does not move along x, plus an offset in cabinet axes.
#[inline(always)]
fn in_cabinet<T: Real>(midpoint: &[N<T>; 2], offset: Vec3<T>) -> Vec3<T> {
    [offset[0], offset[1] + midpoint[0], offset[2] + midpoint[1]]
}

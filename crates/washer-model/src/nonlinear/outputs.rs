//! Observed quantities of a motion: channels and gap, with their time derivatives (section 6 of the
//! model page).

use crate::channel::{CHANNELS, channels};
use crate::coordinates::{
    COORDINATES, HINGE_PITCH, HINGE_YAW, SHAFT_PITCH, SHAFT_Y, SHAFT_YAW, TUB_PITCH, TUB_Y, TUB_YAW,
};
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::Bodies;
use crate::nonlinear::frame::{
    Tilt, TiltMotion, Vec3, combination, difference, plus_cross, scaled, sum,
};
use crate::nonlinear::{into_spin, out_of_hinge, out_of_spin};
use lane_ode::{N, Real, Sample};

/// Components of the radial distance between drum and tub.
pub(crate) const RADIAL: usize = 2;

/// Coordinates (m, rad) with their first and second time derivatives.
pub(crate) struct Moving<T> {
    pub(crate) q: [N<T>; COORDINATES],
    pub(crate) u: [N<T>; COORDINATES],
    pub(crate) a: [N<T>; COORDINATES],
}

/// A vector with its first and second time derivatives.
struct Course<T> {
    value: Vec3<T>,
    rate: Vec3<T>,
    second: Vec3<T>,
}

/// The points that channels are taken from.
struct Places<T> {
    tub_front: Course<T>,
    drum_front: Course<T>,
    total_centre: Course<T>,
}

/// What a channel is taken from, with its derivatives.
macro_rules! taken {
    ($places:ident, $motion:ident, [point $place:ident $axis:literal]) => {
        component(&$places.$place, $axis)
    };
    ($places:ident, $motion:ident, [angle $q:ident]) => {
        sample($motion.q[$q], $motion.u[$q], $motion.a[$q])
    };
}

macro_rules! observe {
    ($($(#[$doc:meta])* $name:ident, $key:literal, $description:literal, $kind:ident,
        $from:tt, steady $steady:tt $(, turning cos $cos:tt sin $sin:tt rest $rest:tt)?;
    )+) => {
        #[inline(always)]
        fn observed<T: Real>(places: &Places<T>, motion: &Moving<T>) -> [Sample<T>; CHANNELS] {
            [$(taken!(places, motion, $from)),+]
        }
    };
}
channels!(observe);

/// j a + k b
#[inline(always)]
fn blend<T: Real>(j: N<T>, a: &Course<T>, k: N<T>, b: &Course<T>) -> Course<T> {
    Course {
        value: combination(j, &a.value, k, &b.value),
        rate: combination(j, &a.rate, k, &b.rate),
        second: combination(j, &a.second, k, &b.second),
    }
}

/// Directions of the body axes and their rates, from which every output is made. Cabinet axes
/// unless noted.
pub(crate) struct Axes<T> {
    tub: Tilt<T>,
    /// Angular velocity and acceleration of the tub, tub axes.
    tub_turn: [Vec3<T>; 2],
    tub_axis: Course<T>,
    shaft_axis: Course<T>,
    /// The drum's d1 and d2.
    drum: [Course<T>; 2],
}

impl<T: Real> Axes<T> {
    #[inline(always)]
    pub(crate) fn new(spin: &SpinState<T>, motion: &Moving<T>) -> Self {
        let Moving { q, u, a } = motion;
        let tub = Tilt::of_tub(q);
        let of_tub = tub.motion(u[TUB_YAW], u[TUB_PITCH]);
        let shaft = Tilt::of_shaft(q);
        let of_shaft = shaft.motion(u[SHAFT_YAW], u[SHAFT_PITCH]);
        let (s9, c9) = q[HINGE_YAW].sin_cos();

        // Angular velocity and acceleration: shaft in S, then drum in E; as in `nonlinear::rotor`,
        // with u' now.
        let omega_s = {
            let [x, y, z] = into_spin(spin, &of_shaft.rate);
            [x + spin.speed, y, z]
        };
        let alpha_s = {
            let alpha = angular_acceleration(&shaft, &of_shaft, motion, SHAFT_YAW);
            let [x, y, z] = into_spin(spin, &alpha);
            [x + spin.acceleration, y + spin.speed * omega_s[2], z - spin.speed * omega_s[1]]
        };
        let (u9, u10) = (u[HINGE_YAW], u[HINGE_PITCH]);
        let [ex, ey, ez] =
            [c9 * omega_s[0] - s9 * omega_s[2], omega_s[1] + u9, s9 * omega_s[0] + c9 * omega_s[2]];
        let turn = [
            [ex, ey, ez + u10],
            [
                c9 * alpha_s[0] - s9 * alpha_s[2] + (u10 * ey - u9 * ez),
                alpha_s[1] - u10 * ex + a[HINGE_YAW],
                s9 * alpha_s[0] + c9 * alpha_s[2] + u9 * ex + a[HINGE_PITCH],
            ],
        ];
        let (s10, c10) = q[HINGE_PITCH].sin_cos();
        let zero = s9.lit(0.0);
        Self {
            tub_turn: [of_tub.rate, angular_acceleration(&tub, &of_tub, motion, TUB_YAW)],
            tub_axis: axis_course(&tub, &of_tub, motion, TUB_YAW),
            shaft_axis: axis_course(&shaft, &of_shaft, motion, SHAFT_YAW),
            drum: [
                drum_course(&shaft, spin, (s9, c9), &turn, &[c10, s10, zero]),
                drum_course(&shaft, spin, (s9, c9), &turn, &[-s10, c10, zero]),
            ],
            tub,
        }
    }

    /// Position of the drum's front centre relative to the tub axis, along t2 and t3 (m).
    #[inline(always)]
    pub(crate) fn radial(&self, b: &Bodies<T>, motion: &Moving<T>) -> [Sample<T>; RADIAL] {
        let tub_front = point(motion, TUB_Y, &self.tub_axis, b.tub_front);
        let drum_front = self.drum_front(b, motion);
        let [omega, alpha] = &self.tub_turn;
        let apart = self.tub.in_own_axes(&difference(drum_front.value, &tub_front.value));
        let velocity = self.tub.in_own_axes(&difference(drum_front.rate, &tub_front.rate));
        let acceleration = self.tub.in_own_axes(&difference(drum_front.second, &tub_front.second));
        // As seen from the turning tub.
        let rate = plus_cross(&velocity, &apart, omega);
        let second =
            plus_cross(&plus_cross(&acceleration, &apart, alpha), &sum(velocity, &rate), omega);
        [sample(apart[1], rate[1], second[1]), sample(apart[2], rate[2], second[2])]
    }

    /// Positions (m) and angles (rad) in the order of [`Channel::ALL`].
    #[inline(always)]
    pub(crate) fn channels(&self, b: &Bodies<T>, motion: &Moving<T>) -> [Sample<T>; CHANNELS] {
        let tub_front = point(motion, TUB_Y, &self.tub_axis, b.tub_front);
        let tub_centre = point(motion, TUB_Y, &self.tub_axis, b.tub_centre);
        let drum_front = self.drum_front(b, motion);
        let rho = blend(b.rho_1, &self.drum[0], b.rho_2, &self.drum[1]);
        let one = b.tub_share.lit(1.0);
        let rotor_centre = blend(b.along_shaft, &self.shaft_axis, b.drum_share, &rho);
        let rotor_centre = point(motion, SHAFT_Y, &rotor_centre, one);
        let total_centre = blend(b.tub_share, &tub_centre, b.rotor_share, &rotor_centre);
        observed(&Places { tub_front, drum_front, total_centre }, motion)
    }

    #[inline(always)]
    fn drum_front(&self, b: &Bodies<T>, motion: &Moving<T>) -> Course<T> {
        let one = b.drum_hinge.lit(1.0);
        let front = blend(b.drum_hinge, &self.shaft_axis, b.hinge_to_front, &self.drum[0]);
        point(motion, SHAFT_Y, &front, one)
    }
}

/// Squared distance of the drum's front centre from the tub axis. Its square, because a distance
/// has a kink at zero.
#[inline(always)]
pub(crate) fn squared<T: Real>([y, z]: &[Sample<T>; RADIAL]) -> Sample<T> {
    sample(
        y.value * y.value + z.value * z.value,
        (2.0 * (y.value * y.slope + z.value * z.slope)).v(),
        (2.0 * (y.slope * y.slope
            + y.value * y.curvature
            + (z.slope * z.slope + z.value * z.curvature)))
            .v(),
    )
}

#[inline(always)]
fn sample<T>(value: N<T>, slope: N<T>, curvature: N<T>) -> Sample<T> {
    Sample { value, slope, curvature }
}

#[inline(always)]
fn component<T: Real>(course: &Course<T>, i: usize) -> Sample<T> {
    sample(course.value[i], course.rate[i], course.second[i])
}

/// Angular acceleration of a frame tilted by coordinate `yaw` and the next, in its axes.
#[inline(always)]
fn angular_acceleration<T: Real>(
    tilt: &Tilt<T>,
    at: &TiltMotion<T>,
    motion: &Moving<T>,
    yaw: usize,
) -> Vec3<T> {
    let [yaw, pitch] = [motion.a[yaw], motion.a[yaw + 1]];
    [at.acceleration_x + yaw * tilt.sin_pitch, at.acceleration_y + yaw * tilt.cos_pitch, pitch]
}

/// The axis of such a frame.
#[inline(always)]
fn axis_course<T: Real>(
    tilt: &Tilt<T>,
    at: &TiltMotion<T>,
    Moving { u, a, .. }: &Moving<T>,
    yaw: usize,
) -> Course<T> {
    let (rates, seconds) = ([u[yaw], u[yaw + 1]], [a[yaw], a[yaw + 1]]);
    let zero = rates[0].lit(0.0);
    let by_yaw = [tilt.axis_c[2], zero, -tilt.axis_c[0]];
    let by_pitch = &tilt.second_c;
    let at_constant_speeds = tilt.in_cabinet_axes(&at.axis_acceleration);
    let by_accelerations = combination(seconds[0], &by_yaw, seconds[1], by_pitch);
    Course {
        value: tilt.axis_c,
        rate: combination(rates[0], &by_yaw, rates[1], by_pitch),
        second: sum(at_constant_speeds, &by_accelerations),
    }
}

/// A vector fixed in the drum, given in E; `turn` is the drum's angular velocity and acceleration
/// there.
#[inline(always)]
fn drum_course<T: Real>(
    shaft: &Tilt<T>,
    spin: &SpinState<T>,
    hinge: (N<T>, N<T>),
    turn: &[Vec3<T>; 2],
    v: &Vec3<T>,
) -> Course<T> {
    let zero = v[0].lit(0.0);
    let still = [zero; 3];
    let rate = plus_cross(&still, &turn[0], v);
    let second = plus_cross(&plus_cross(&still, &turn[1], v), &turn[0], &rate);
    Course {
        value: out_of_drum(shaft, spin, hinge, v),
        rate: out_of_drum(shaft, spin, hinge, &rate),
        second: out_of_drum(shaft, spin, hinge, &second),
    }
}

/// From E to cabinet axes.
#[inline(always)]
fn out_of_drum<T: Real>(
    shaft: &Tilt<T>,
    spin: &SpinState<T>,
    (s9, c9): (N<T>, N<T>),
    v: &Vec3<T>,
) -> Vec3<T> {
    shaft.in_cabinet_axes(&out_of_spin(spin, &out_of_hinge(s9, c9, v)))
}

/// A point `reach` along an axis from a bearing midpoint, whose y is coordinate `first`; midpoints
/// do not move along x.
#[inline(always)]
fn point<T: Real>(motion: &Moving<T>, first: usize, axis: &Course<T>, reach: N<T>) -> Course<T> {
    let mut course = Course {
        value: scaled(reach, axis.value),
        rate: scaled(reach, axis.rate),
        second: scaled(reach, axis.second),
    };
    for i in 0..2 {
        course.value[1 + i] += motion.q[first + i];
        course.rate[1 + i] += motion.u[first + i];
        course.second[1 + i] += motion.a[first + i];
    }
    course
}

//! The frame of a body whose axis is tilted by yaw and pitch: of the tub, or of the shaft without
//! its spin (Table 1 of the paper, first two angles).
//!
//! The frame is R = Ry(yaw) Rz(pitch), with the columns a1 (the axis), a2 and a3. Vectors are in
//! frame axes, or in cabinet axes where a name ends in `_c`.

use crate::coordinates::{COORDINATES, SHAFT_PITCH, SHAFT_YAW, TUB_PITCH, TUB_YAW};
use lane_ode::{N, Real};

/// A vector of three components.
pub(crate) type Vec3<T> = [N<T>; 3];

/// Returns k v.
#[inline(always)]
pub(crate) fn scale<T: Real, const K: usize>(k: N<T>, mut v: [N<T>; K]) -> [N<T>; K] {
    for x in &mut v {
        *x = (k * *x).v();
    }
    v
}

/// Returns a + b.
#[inline(always)]
pub(crate) fn add<T: Real, const K: usize>(mut a: [N<T>; K], b: &[N<T>; K]) -> [N<T>; K] {
    for i in 0..K {
        a[i] += b[i];
    }
    a
}

/// Returns a - b.
#[inline(always)]
pub(crate) fn subtract<T: Real, const K: usize>(mut a: [N<T>; K], b: &[N<T>; K]) -> [N<T>; K] {
    for i in 0..K {
        a[i] -= b[i];
    }
    a
}

/// Returns j a + k b.
#[inline(always)]
pub(crate) fn linear_combination<T: Real>(j: N<T>, a: &Vec3<T>, k: N<T>, b: &Vec3<T>) -> Vec3<T> {
    [j * a[0] + k * b[0], j * a[1] + k * b[1], j * a[2] + k * b[2]]
}

/// Returns start + a x b.
#[inline(always)]
pub(crate) fn add_cross_product<T: Real>(start: &Vec3<T>, a: &Vec3<T>, b: &Vec3<T>) -> Vec3<T> {
    [
        start[0] + a[1] * b[2] - a[2] * b[1],
        start[1] + a[2] * b[0] - a[0] * b[2],
        start[2] + a[0] * b[1] - a[1] * b[0],
    ]
}

/// Returns a . b.
#[inline(always)]
pub(crate) fn dot<T: Real>(a: &Vec3<T>, b: &Vec3<T>) -> N<T> {
    a[0] * b[0] + (a[1] * b[1] + a[2] * b[2])
}

/// The orientation of a tilted frame.
#[derive(Clone, Copy)]
pub(crate) struct Tilt<T> {
    pub(crate) sin_yaw: N<T>,
    pub(crate) cos_yaw: N<T>,
    pub(crate) sin_pitch: N<T>,
    pub(crate) cos_pitch: N<T>,
    /// The axis a1 in cabinet axes.
    pub(crate) axis_c: Vec3<T>,
    /// The vector a2 in cabinet axes.
    pub(crate) second_axis_c: Vec3<T>,
}

impl<T: Real> Tilt<T> {
    /// Returns the tub's orientation.
    #[inline(always)]
    pub(crate) fn tub(q: &[N<T>; COORDINATES]) -> Self {
        Self::new(q[TUB_YAW], q[TUB_PITCH])
    }

    /// Returns the shaft's orientation before the spin.
    #[inline(always)]
    pub(crate) fn shaft(q: &[N<T>; COORDINATES]) -> Self {
        Self::new(q[SHAFT_YAW], q[SHAFT_PITCH])
    }

    #[inline(always)]
    pub(crate) fn new(yaw: N<T>, pitch: N<T>) -> Self {
        let (sin_yaw, cos_yaw) = yaw.sin_cos();
        let (sin_pitch, cos_pitch) = pitch.sin_cos();
        Self {
            sin_yaw,
            cos_yaw,
            sin_pitch,
            cos_pitch,
            axis_c: [(cos_yaw * cos_pitch).v(), sin_pitch, (-sin_yaw * cos_pitch).v()],
            second_axis_c: [(-cos_yaw * sin_pitch).v(), cos_pitch, (sin_yaw * sin_pitch).v()],
        }
    }

    /// Transforms a vector from frame axes to cabinet axes. a3 is (sin yaw, 0, cos yaw).
    #[inline(always)]
    pub(crate) fn rotate_to_cabinet(&self, v: &Vec3<T>) -> Vec3<T> {
        let [a1, a2] = [&self.axis_c, &self.second_axis_c];
        [
            a1[0] * v[0] + (a2[0] * v[1] + self.sin_yaw * v[2]),
            a1[1] * v[0] + a2[1] * v[1],
            a1[2] * v[0] + (a2[2] * v[1] + self.cos_yaw * v[2]),
        ]
    }

    /// Transforms a vector from cabinet axes to frame axes.
    #[inline(always)]
    pub(crate) fn rotate_to_frame(&self, v: &Vec3<T>) -> Vec3<T> {
        [
            dot(&self.axis_c, v),
            dot(&self.second_axis_c, v),
            self.sin_yaw * v[0] + self.cos_yaw * v[2],
        ]
    }

    /// Computes the frame's angular velocity, and at constant generalised speeds the frame's
    /// angular acceleration and the second derivative of its axis.
    #[inline(always)]
    pub(crate) fn motion_at_constant_speeds(
        &self,
        yaw_rate: N<T>,
        pitch_rate: N<T>,
    ) -> TiltMotion<T> {
        let angular_velocity =
            [(yaw_rate * self.sin_pitch).v(), (yaw_rate * self.cos_pitch).v(), pitch_rate];
        let [x, y, z] = angular_velocity;
        TiltMotion {
            angular_velocity,
            angular_acceleration_x: (y * z).v(),
            angular_acceleration_y: -(x * z).v(),
            axis_acceleration: [-(y * y + z * z), (x * y).v(), (2.0 * (x * z).v()).v()],
        }
    }

    /// Returns the derivatives of the axis by yaw and by pitch, y and z.
    #[inline(always)]
    pub(crate) fn axis_partials(&self) -> [[N<T>; 2]; 2] {
        [[self.sin_yaw.lit(0.0), self.axis_yaw_z()], [self.second_axis_c[1], self.second_axis_c[2]]]
    }

    /// Returns the z component of the axis's derivative by yaw, whose y component is zero.
    #[inline(always)]
    pub(crate) fn axis_yaw_z(&self) -> N<T> {
        -self.axis_c[0]
    }
}

/// The motion of a tilted frame at constant generalised speeds.
pub(crate) struct TiltMotion<T> {
    /// The angular velocity.
    pub(crate) angular_velocity: Vec3<T>,
    /// The angular acceleration about a1.
    pub(crate) angular_acceleration_x: N<T>,
    /// The angular acceleration about a2. The angular acceleration about a3 is zero.
    pub(crate) angular_acceleration_y: N<T>,
    /// The second derivative of a1.
    pub(crate) axis_acceleration: Vec3<T>,
}

//! The outputs of a motion: channels and gap, with their time derivatives (section 6 of the model
//! page).

use crate::channel::{CHANNELS, channels};
use crate::coordinates::{
    COORDINATES, HINGE_PITCH, HINGE_YAW, SHAFT_PITCH, SHAFT_Y, SHAFT_YAW, TUB_PITCH, TUB_Y, TUB_YAW,
};
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::Bodies;
use crate::nonlinear::frame::{
    Tilt, TiltMotion, Vec3, add, add_cross_product, linear_combination, scale, subtract,
};
use crate::nonlinear::{from_shaft_axes, hinge_to_shaft_axes, to_shaft_axes};
use lane_ode::{N, Real, Sample};

/// The number of components of the radial distance between drum and tub.
pub(crate) const RADIAL_COMPONENTS: usize = 2;

/// Coordinates (m, rad) with first and second time derivatives.
pub(crate) struct MovingCoordinates<T> {
    pub(crate) q: [N<T>; COORDINATES],
    pub(crate) u: [N<T>; COORDINATES],
    pub(crate) a: [N<T>; COORDINATES],
}

/// A vector with first and second time derivatives.
struct MovingVector<T> {
    value: Vec3<T>,
    rate: Vec3<T>,
    acceleration: Vec3<T>,
}

/// The points whose motions are channels.
struct ChannelPoints<T> {
    tub_front: MovingVector<T>,
    drum_front: MovingVector<T>,
    total_centre: MovingVector<T>,
}

/// Expands to the motion of one channel.
macro_rules! channel_motion {
    ($points:ident, $motion:ident, [point $point:ident $axis:literal]) => {
        component_sample(&$points.$point, $axis)
    };
    ($points:ident, $motion:ident, [angle $q:ident]) => {
        new_sample($motion.q[$q], $motion.u[$q], $motion.a[$q])
    };
}

macro_rules! declare_outputs {
    ($($(#[$doc:meta])* $name:ident, $key:literal, $description:literal, $kind:ident,
        $from:tt, steady $steady:tt $(, turning cos $cos:tt sin $sin:tt rest $rest:tt)?;
    )+) => {
        #[inline(always)]
        fn channel_motions<T: Real>(
            points: &ChannelPoints<T>,
            motion: &MovingCoordinates<T>,
        ) -> [Sample<T>; CHANNELS] {
            [$(channel_motion!(points, motion, $from)),+]
        }
    };
}
channels!(declare_outputs);

/// Returns j a + k b.
#[inline(always)]
fn combine_moving_vectors<T: Real>(
    j: N<T>,
    a: &MovingVector<T>,
    k: N<T>,
    b: &MovingVector<T>,
) -> MovingVector<T> {
    MovingVector {
        value: linear_combination(j, &a.value, k, &b.value),
        rate: linear_combination(j, &a.rate, k, &b.rate),
        acceleration: linear_combination(j, &a.acceleration, k, &b.acceleration),
    }
}

/// The bodies' axes with their time derivatives, from which every output is computed; in cabinet
/// axes unless noted.
pub(crate) struct BodyAxes<T> {
    tub: Tilt<T>,
    /// The angular velocity and acceleration of the tub, in tub axes.
    tub_rates: [Vec3<T>; 2],
    tub_axis: MovingVector<T>,
    shaft_axis: MovingVector<T>,
    /// The drum's axes d1 and d2.
    drum_axes: [MovingVector<T>; 2],
}

impl<T: Real> BodyAxes<T> {
    #[inline(always)]
    pub(crate) fn new(spin: &SpinState<T>, motion: &MovingCoordinates<T>) -> Self {
        let MovingCoordinates { q, u, a } = motion;
        let tub = Tilt::tub(q);
        let tub_motion = tub.motion_at_constant_speeds(u[TUB_YAW], u[TUB_PITCH]);
        let shaft = Tilt::shaft(q);
        let shaft_motion = shaft.motion_at_constant_speeds(u[SHAFT_YAW], u[SHAFT_PITCH]);
        let (s9, c9) = q[HINGE_YAW].sin_cos();

        // Angular velocities and accelerations of the shaft in axes S and of the drum in axes E, as
        // in `nonlinear::assemble_rotor` but with u'.
        let omega_s = {
            let [x, y, z] = to_shaft_axes(spin, &shaft_motion.angular_velocity);
            [x + spin.speed, y, z]
        };
        let alpha_s = {
            let alpha = angular_acceleration(&shaft, &shaft_motion, motion, SHAFT_YAW);
            let [x, y, z] = to_shaft_axes(spin, &alpha);
            [x + spin.acceleration, y + spin.speed * omega_s[2], z - spin.speed * omega_s[1]]
        };
        let u9 = u[HINGE_YAW];
        let u10 = u[HINGE_PITCH];
        let [ex, ey, ez] =
            [c9 * omega_s[0] - s9 * omega_s[2], omega_s[1] + u9, s9 * omega_s[0] + c9 * omega_s[2]];
        let drum_rates = [
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
            tub_rates: [
                tub_motion.angular_velocity,
                angular_acceleration(&tub, &tub_motion, motion, TUB_YAW),
            ],
            tub_axis: moving_axis(&tub, &tub_motion, motion, TUB_YAW),
            shaft_axis: moving_axis(&shaft, &shaft_motion, motion, SHAFT_YAW),
            drum_axes: [
                moving_drum_vector(&shaft, spin, (s9, c9), &drum_rates, &[c10, s10, zero]),
                moving_drum_vector(&shaft, spin, (s9, c9), &drum_rates, &[-s10, c10, zero]),
            ],
            tub,
        }
    }

    /// Computes the position of the drum's front centre relative to the tub axis, along t2 and t3
    /// (m).
    #[inline(always)]
    pub(crate) fn radial_position(
        &self,
        b: &Bodies<T>,
        motion: &MovingCoordinates<T>,
    ) -> [Sample<T>; RADIAL_COMPONENTS] {
        let tub_front = moving_point(motion, TUB_Y, &self.tub_axis, b.tub_front_x);
        let drum_front = self.drum_front(b, motion);
        let [omega, alpha] = &self.tub_rates;
        let separation = self.tub.rotate_to_frame(&subtract(drum_front.value, &tub_front.value));
        let relative_velocity =
            self.tub.rotate_to_frame(&subtract(drum_front.rate, &tub_front.rate));
        let relative_acceleration =
            self.tub.rotate_to_frame(&subtract(drum_front.acceleration, &tub_front.acceleration));
        // Derivatives in the rotating frame of the tub.
        let rate = add_cross_product(&relative_velocity, &separation, omega);
        let acceleration = add_cross_product(
            &add_cross_product(&relative_acceleration, &separation, alpha),
            &add(relative_velocity, &rate),
            omega,
        );
        [
            new_sample(separation[1], rate[1], acceleration[1]),
            new_sample(separation[2], rate[2], acceleration[2]),
        ]
    }

    /// Computes positions (m) and angles (rad) in the order of [`Channel::ALL`].
    #[inline(always)]
    pub(crate) fn channels(
        &self,
        b: &Bodies<T>,
        motion: &MovingCoordinates<T>,
    ) -> [Sample<T>; CHANNELS] {
        let tub_front = moving_point(motion, TUB_Y, &self.tub_axis, b.tub_front_x);
        let tub_centre = moving_point(motion, TUB_Y, &self.tub_axis, b.tub_centre_x);
        let drum_front = self.drum_front(b, motion);
        let mut rho =
            combine_moving_vectors(b.rho_1, &self.drum_axes[0], b.rho_2, &self.drum_axes[1]);
        let one = b.tub_mass_share.lit(1.0);
        if b.is_skewed.is_set() {
            rho = combine_moving_vectors(
                one,
                &rho,
                b.rho_3,
                &moving_cross_product(&self.drum_axes[0], &self.drum_axes[1]),
            );
        }
        let rotor_centre = combine_moving_vectors(
            b.shaft_centre_offset,
            &self.shaft_axis,
            b.drum_mass_share,
            &rho,
        );
        let rotor_centre = moving_point(motion, SHAFT_Y, &rotor_centre, one);
        let total_centre = combine_moving_vectors(
            b.tub_mass_share,
            &tub_centre,
            b.rotor_mass_share,
            &rotor_centre,
        );
        channel_motions(&ChannelPoints { tub_front, drum_front, total_centre }, motion)
    }

    #[inline(always)]
    fn drum_front(&self, b: &Bodies<T>, motion: &MovingCoordinates<T>) -> MovingVector<T> {
        let one = b.hinge_x.lit(1.0);
        let front_offset = combine_moving_vectors(
            b.hinge_x,
            &self.shaft_axis,
            b.hinge_to_front_distance,
            &self.drum_axes[0],
        );
        moving_point(motion, SHAFT_Y, &front_offset, one)
    }
}

/// Computes the squared distance of the drum's front centre from the tub axis. The distance is not
/// smooth at zero, unlike its square.
#[inline(always)]
pub(crate) fn squared_distance<T: Real>([y, z]: &[Sample<T>; RADIAL_COMPONENTS]) -> Sample<T> {
    new_sample(
        y.value * y.value + z.value * z.value,
        (2.0 * (y.value * y.slope + z.value * z.slope)).v(),
        (2.0 * (y.slope * y.slope
            + y.value * y.curvature
            + (z.slope * z.slope + z.value * z.curvature)))
            .v(),
    )
}

#[inline(always)]
fn new_sample<T>(value: N<T>, slope: N<T>, curvature: N<T>) -> Sample<T> {
    Sample { value, slope, curvature }
}

#[inline(always)]
fn component_sample<T: Real>(vector: &MovingVector<T>, i: usize) -> Sample<T> {
    new_sample(vector.value[i], vector.rate[i], vector.acceleration[i])
}

/// Computes the angular acceleration of a frame tilted by coordinate `yaw_coordinate` and the next
/// one, in frame axes.
#[inline(always)]
fn angular_acceleration<T: Real>(
    tilt: &Tilt<T>,
    tilt_motion: &TiltMotion<T>,
    motion: &MovingCoordinates<T>,
    yaw_coordinate: usize,
) -> Vec3<T> {
    let yaw_acceleration = motion.a[yaw_coordinate];
    let pitch_acceleration = motion.a[yaw_coordinate + 1];
    [
        tilt_motion.angular_acceleration_x + yaw_acceleration * tilt.sin_pitch,
        tilt_motion.angular_acceleration_y + yaw_acceleration * tilt.cos_pitch,
        pitch_acceleration,
    ]
}

/// Computes the motion of the axis of a frame tilted by coordinate `yaw_coordinate` and the next
/// one.
#[inline(always)]
fn moving_axis<T: Real>(
    tilt: &Tilt<T>,
    tilt_motion: &TiltMotion<T>,
    MovingCoordinates { u, a, .. }: &MovingCoordinates<T>,
    yaw_coordinate: usize,
) -> MovingVector<T> {
    let rates = [u[yaw_coordinate], u[yaw_coordinate + 1]];
    let accelerations = [a[yaw_coordinate], a[yaw_coordinate + 1]];
    let zero = rates[0].lit(0.0);
    let axis_per_yaw = [tilt.axis_c[2], zero, -tilt.axis_c[0]];
    let axis_per_pitch = &tilt.second_axis_c;
    let acceleration_at_constant_speeds = tilt.rotate_to_cabinet(&tilt_motion.axis_acceleration);
    let tangential_acceleration =
        linear_combination(accelerations[0], &axis_per_yaw, accelerations[1], axis_per_pitch);
    MovingVector {
        value: tilt.axis_c,
        rate: linear_combination(rates[0], &axis_per_yaw, rates[1], axis_per_pitch),
        acceleration: add(acceleration_at_constant_speeds, &tangential_acceleration),
    }
}

/// Computes the motion of a vector that is fixed in the drum and given in axes E. `drum_rates`
/// holds the drum's angular velocity and acceleration in axes E.
#[inline(always)]
fn moving_drum_vector<T: Real>(
    shaft: &Tilt<T>,
    spin: &SpinState<T>,
    hinge_sin_cos: (N<T>, N<T>),
    drum_rates: &[Vec3<T>; 2],
    v: &Vec3<T>,
) -> MovingVector<T> {
    let zero = v[0].lit(0.0);
    let zeros = [zero; 3];
    let rate = add_cross_product(&zeros, &drum_rates[0], v);
    let acceleration =
        add_cross_product(&add_cross_product(&zeros, &drum_rates[1], v), &drum_rates[0], &rate);
    MovingVector {
        value: drum_to_cabinet_axes(shaft, spin, hinge_sin_cos, v),
        rate: drum_to_cabinet_axes(shaft, spin, hinge_sin_cos, &rate),
        acceleration: drum_to_cabinet_axes(shaft, spin, hinge_sin_cos, &acceleration),
    }
}

/// Computes the motion of the cross product of two moving vectors.
#[inline(always)]
fn moving_cross_product<T: Real>(a: &MovingVector<T>, b: &MovingVector<T>) -> MovingVector<T> {
    let zero = [a.value[0].lit(0.0); 3];
    let value = add_cross_product(&zero, &a.value, &b.value);
    let rate = add_cross_product(&add_cross_product(&zero, &a.rate, &b.value), &a.value, &b.rate);
    let rate_product = add_cross_product(&zero, &a.rate, &b.rate);
    let acceleration =
        add_cross_product(&add(rate_product, &rate_product), &a.acceleration, &b.value);
    MovingVector {
        value,
        rate,
        acceleration: add_cross_product(&acceleration, &a.value, &b.acceleration),
    }
}

/// Transforms a vector from the hinge's axes E to cabinet axes.
#[inline(always)]
fn drum_to_cabinet_axes<T: Real>(
    shaft: &Tilt<T>,
    spin: &SpinState<T>,
    (s9, c9): (N<T>, N<T>),
    v: &Vec3<T>,
) -> Vec3<T> {
    shaft.rotate_to_cabinet(&from_shaft_axes(spin, &hinge_to_shaft_axes(s9, c9, v)))
}

/// Computes the motion of the point at `distance` along an axis from a bearing midpoint.
/// `coordinate` is the index of the midpoint's displacement along c2, which the displacement along
/// c3 follows; midpoints do not move along c1.
#[inline(always)]
fn moving_point<T: Real>(
    motion: &MovingCoordinates<T>,
    coordinate: usize,
    axis: &MovingVector<T>,
    distance: N<T>,
) -> MovingVector<T> {
    let mut moving_vector = MovingVector {
        value: scale(distance, axis.value),
        rate: scale(distance, axis.rate),
        acceleration: scale(distance, axis.acceleration),
    };
    for i in 0..2 {
        moving_vector.value[1 + i] += motion.q[coordinate + i];
        moving_vector.rate[1 + i] += motion.u[coordinate + i];
        moving_vector.acceleration[1 + i] += motion.a[coordinate + i];
    }
    moving_vector
}

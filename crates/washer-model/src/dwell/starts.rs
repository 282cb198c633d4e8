//! The starts of trajectories: perturbed periodic responses, and kicks.

use crate::coordinates::{STATES, TUB_COORDINATES, TUB_PITCH, TUB_YAW};
use crate::modes::shape;
use crate::stability::round_last_digits;
use crate::steps::SUSPENSION_MODES;
use crate::{COORDINATES, Modes, Point};

/// Perturbation of a periodic response in each of the suspension's modes, as a share of its
/// greatest coordinate. Doubling it makes trajectories leave an unstable response earlier by ln 2
/// over the growth.
const PERTURBATION_SHARE: f64 = 1e-4;

/// Weakest kick, relative to the hardest. Basis: kicks from 0.5 to 6 rad/s by default. Doubling it
/// misses motions close to the response.
const MIN_KICK_RATIO: f64 = 1.0 / 12.0;

/// Number of directions of kicks along mode shapes: two modes, and both at once. Doubling it takes
/// further combinations of modes.
pub(super) const MODE_DIRECTIONS: usize = 3;

/// Seed of the random directions, for every machine and speed. Another seed gives other directions.
const DIRECTION_SEED: u64 = 2021;

/// A kick: the number of its direction and its size (rad/s).
pub(super) type Kick = (usize, f64);

/// The velocities of a kick of 1 rad/s, by direction.
pub(super) type Directions = Vec<[f64; COORDINATES]>;

/// Returns the largest deviation of the tub's coordinates from equilibrium (m, rad), at least 1e-4.
pub(super) fn largest_deviation(point: &Point, state: &[f64; STATES]) -> f64 {
    let equilibrium = point.equilibrium();
    TUB_COORDINATES.iter().map(|&i| (state[i] - equilibrium[i]).abs()).fold(1e-4, f64::max)
}

/// Returns a state that is perturbed in each of the suspension's modes.
pub(super) fn perturb(point: &Point, frozen_modes: &Modes, state: &[f64; STATES]) -> [f64; STATES] {
    let perturbation_size = PERTURBATION_SHARE * largest_deviation(point, state);
    let mut perturbed_state = *state;
    for mode in &frozen_modes.modes[..SUSPENSION_MODES] {
        let max_displacement =
            TUB_COORDINATES.iter().map(|&i| mode.shape[i][0].abs()).fold(0.0, f64::max);
        for i in 0..COORDINATES {
            perturbed_state[i] +=
                perturbation_size * round_last_digits(mode.shape[i][0] / max_displacement);
        }
    }
    perturbed_state
}

/// Returns directions of kicks: those along mode shapes, then random ones. All are combinations of
/// the suspension's modes, so that bearings do not ring.
///
/// A kick along mode shapes turns the tub by 1 rad/s: in the two modes that rock most, and in both
/// at once. A random kick has the kinetic energy of the first, and a direction that is uniform over
/// the sphere of this energy, because a basin may lie in none of the directions of mode shapes.
pub(super) fn kick_directions(
    point: &Point,
    frozen_modes: &Modes,
    random_count: usize,
) -> Directions {
    let mut rocking_modes: Vec<(usize, f64)> = (0..SUSPENSION_MODES)
        .map(|k| {
            let motion =
                shape::dominant_motion(point, &frozen_modes.mass, &frozen_modes.modes[k].shape);
            (k, motion.yaw_share + motion.pitch_share)
        })
        .collect();
    rocking_modes.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    // The amplitude of a mode of unit modal mass that turns the tub by 1.
    let rocking_amplitude = |rank: usize| -> f64 {
        let shape = &frozen_modes.modes[rocking_modes[rank].0].shape;
        let yaw = shape[TUB_YAW][0];
        let pitch = shape[TUB_PITCH][0];
        1.0 / (yaw * yaw + pitch * pitch).sqrt()
    };
    let scale_shape = |rank: usize| -> [f64; COORDINATES] {
        let shape = &frozen_modes.modes[rocking_modes[rank].0].shape;
        core::array::from_fn(|i| round_last_digits(shape[i][0] * rocking_amplitude(rank)))
    };
    let first_scaled_shape = scale_shape(0);
    let second_scaled_shape = scale_shape(1);
    let mut directions = vec![
        first_scaled_shape,
        second_scaled_shape,
        core::array::from_fn(|i| first_scaled_shape[i] + second_scaled_shape[i]),
    ];
    let mut random_numbers = fastrand::Rng::with_seed(DIRECTION_SEED);
    for _ in 0..random_count {
        let components: [f64; SUSPENSION_MODES] =
            core::array::from_fn(|_| draw_normal(&mut random_numbers));
        let length = components.iter().map(|component| component * component).sum::<f64>().sqrt();
        let velocity = |i: usize| -> f64 {
            let shapes = frozen_modes.modes[..SUSPENSION_MODES].iter().map(|mode| mode.shape[i][0]);
            components.iter().zip(shapes).map(|(component, shape)| component * shape).sum()
        };
        let velocity_scale = rocking_amplitude(0) / length;
        directions.push(core::array::from_fn(|i| round_last_digits(velocity_scale * velocity(i))));
    }
    directions
}

/// Returns a number of the standard normal distribution (Box and Muller).
fn draw_normal(random_numbers: &mut fastrand::Rng) -> f64 {
    let radius = (-2.0 * libm::log(1.0 - random_numbers.f64())).sqrt();
    radius * libm::cos(core::f64::consts::TAU * random_numbers.f64())
}

/// Returns the number of random directions among a number of kicks: every third kick has one.
pub(super) const fn random_kick_count(count: usize) -> usize {
    count / 3
}

/// Whether a kick is given to the machine at rest, as is every second kick in a random direction. A
/// kick from a response stays in the response's basin if that is wide, whereas the machine at rest
/// is far from a large response.
pub(super) const fn is_from_rest((direction, _): Kick) -> bool {
    direction >= MODE_DIRECTIONS && (direction - MODE_DIRECTIONS).is_multiple_of(2)
}

/// Returns a number of kicks up to a size (rad/s): those along mode shapes first, the hardest in
/// all directions before weaker ones, then random ones, from the hardest to the weakest.
pub(super) fn plan_kicks(count: usize, max_kick_rad_per_s: f64) -> Vec<Kick> {
    let random_count = random_kick_count(count);
    let mode_kick_count = count - random_count;
    let kick_size_rad_per_s = |level: usize, level_count: usize| {
        let log_step = if level_count > 1 {
            libm::log(MIN_KICK_RATIO) / (level_count - 1) as f64
        } else {
            0.0
        };
        max_kick_rad_per_s * libm::exp(log_step * level as f64)
    };
    let level_count = mode_kick_count.div_ceil(MODE_DIRECTIONS);
    let mut kicks = Vec::with_capacity(count);
    for k in 0..mode_kick_count {
        kicks.push((k % MODE_DIRECTIONS, kick_size_rad_per_s(k / MODE_DIRECTIONS, level_count)));
    }
    for k in 0..random_count {
        kicks.push((MODE_DIRECTIONS + k, kick_size_rad_per_s(k, random_count)));
    }
    kicks
}

/// Returns a state with the velocities of a kick added.
pub(super) fn add_kick(
    state: &[f64; STATES],
    directions: &Directions,
    (direction, size_rad_per_s): Kick,
) -> [f64; STATES] {
    core::array::from_fn(|i| match i.checked_sub(COORDINATES) {
        Some(i) => state[COORDINATES + i] + size_rad_per_s * directions[direction][i],
        None => state[i],
    })
}

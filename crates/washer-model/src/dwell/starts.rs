//! Where trajectories start: beside a periodic response, and kicked off it.

use crate::coordinates::{STATES, TUB, TUB_PITCH, TUB_YAW};
use crate::fast::SUSPENSION_MODES;
use crate::modes::shape;
use crate::stability::rounded;
use crate::{COORDINATES, Modes, Point};

/// A start is off the periodic response by this share of its greatest coordinate, in each of the
/// suspension's modes.
const DISTURBED: f64 = 1e-4;

/// The least kick is this share of the greatest.
const LEAST_KICK: f64 = 1.0 / 12.0;

/// Directions of kicks: two modes, and both at once.
pub(super) const DIRECTIONS: usize = 3;

/// A kick: its direction and its size (rad/s).
pub(super) type Kick = (usize, f64);

/// The largest coordinate of the tub (m, rad), from rest.
pub(super) fn size(point: &Point, state: &[f64; STATES]) -> f64 {
    let rest = point.equilibrium();
    TUB.iter().map(|&i| (state[i] - rest[i]).abs()).fold(1e-4, f64::max)
}

/// A state beside this one, in the suspension's modes.
pub(super) fn disturbed(point: &Point, frozen: &Modes, state: &[f64; STATES]) -> [f64; STATES] {
    let by = DISTURBED * size(point, state);
    let mut beside = *state;
    for mode in &frozen.modes[..SUSPENSION_MODES] {
        let largest = TUB.iter().map(|&i| mode.shape[i][0].abs()).fold(0.0, f64::max);
        for i in 0..COORDINATES {
            beside[i] += by * rounded(mode.shape[i][0] / largest);
        }
    }
    beside
}

/// Speeds of a kick that turns the tub by 1 rad/s: of the two modes of the suspension that rock
/// most, and of both at once. They are the modes' own, so that bearings do not ring.
pub(super) fn directions(point: &Point, frozen: &Modes) -> [[f64; COORDINATES]; DIRECTIONS] {
    let mut modes: Vec<(usize, f64)> = (0..SUSPENSION_MODES)
        .map(|k| {
            let motion = shape::motion(point, &frozen.mass, &frozen.modes[k].shape);
            (k, motion.yaw + motion.pitch)
        })
        .collect();
    modes.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let unit = |place: usize| -> [f64; COORDINATES] {
        let shape = &frozen.modes[modes[place].0].shape;
        let (yaw, pitch) = (shape[TUB_YAW][0], shape[TUB_PITCH][0]);
        let turns = (yaw * yaw + pitch * pitch).sqrt();
        core::array::from_fn(|i| rounded(shape[i][0] / turns))
    };
    let (first, second) = (unit(0), unit(1));
    [first, second, core::array::from_fn(|i| first[i] + second[i])]
}

/// So many kicks up to a size (rad/s), the hardest in all directions first.
pub(super) fn kicks(count: usize, greatest_rad_per_s: f64) -> Vec<Kick> {
    let levels = count.div_ceil(DIRECTIONS);
    let step = if levels > 1 { libm::log(LEAST_KICK) / (levels - 1) as f64 } else { 0.0 };
    let size = |level: usize| greatest_rad_per_s * libm::exp(step * level as f64);
    (0..count).map(|k| (k % DIRECTIONS, size(k / DIRECTIONS))).collect()
}

/// A state with a kick added.
pub(super) fn kicked(
    state: &[f64; STATES],
    directions: &[[f64; COORDINATES]; DIRECTIONS],
    (direction, size): Kick,
) -> [f64; STATES] {
    core::array::from_fn(|i| match i.checked_sub(COORDINATES) {
        Some(i) => state[COORDINATES + i] + size * directions[direction][i],
        None => state[i],
    })
}

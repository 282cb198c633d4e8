//! Names of mode shapes, by the motion of tub and drum that dominates each.

use crate::coordinates::{
    HINGE_PITCH, HINGE_YAW, SHAFT_PITCH, SHAFT_Y, SHAFT_YAW, SHAFT_Z, TUB_PITCH, TUB_Y, TUB_YAW,
    TUB_Z,
};
use crate::modes::mass_inner_product;
use crate::{COORDINATES, Point};
use core::fmt;

/// The plane of a motion, through the drum axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MotionPlane {
    /// The horizontal plane: translation along c3, rotation about c2.
    Horizontal,
    /// The vertical plane: translation along c2, rotation about c3.
    Vertical,
    /// Neither plane has most of the energy.
    Both,
}

/// The kind of motion of a mode shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Movement {
    /// Translation of tub and drum as one body.
    Translation,
    /// Rotation of tub and drum as one body about their common mass centre.
    Rocking,
    /// Bending of the drum against its shaft.
    Bending,
    /// Translation of the shaft against the tub.
    BearingTranslation,
    /// Tilt of the shaft against the tub.
    BearingTilt,
    /// No movement has more than half of the energy.
    Mixed,
}

/// The dominant movement of a mode shape, which has more than half of the energy, and the shares of
/// the kinetic energy in the motions of the machine as one rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModeMotion {
    pub movement: Movement,
    /// The plane of the movement.
    pub plane: MotionPlane,
    /// The share of the rigid translation along c2.
    pub vertical_translation_share: f64,
    /// The share of the rigid translation along c3.
    pub horizontal_translation_share: f64,
    /// The share of the rigid rotation about c2 through the mass centre.
    pub yaw_share: f64,
    /// The share of the rigid rotation about c3 through the mass centre.
    pub pitch_share: f64,
}

/// Expands to the names of movements, each in every plane.
macro_rules! motion_names {
    ($($movement:literal)*) => {
        [$(
            concat!($movement, ", horizontal plane"),
            concat!($movement, ", vertical plane"),
            concat!($movement, ", both planes"),
        )*]
    };
}

impl ModeMotion {
    /// The names of motions, by movement and then by plane.
    pub const NAMES: [&str; 18] = motion_names![
        "translation"
        "rocking"
        "drum bending on its shaft"
        "shaft against tub in the bearings"
        "shaft tilting in the bearings"
        "mixed"
    ];

    /// Returns the position of the name in [`Self::NAMES`].
    pub const fn name_index(&self) -> usize {
        3 * self.movement as usize + self.plane as usize
    }
}

impl fmt::Display for ModeMotion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::NAMES[self.name_index()])
    }
}

/// The share of a mode's energy above which a motion is in one plane. Basis: convention, a motion
/// with three fifths of its energy in a plane looks like one of that plane. Doubling it puts every
/// mode in both planes.
const PLANE_SHARE: f64 = 0.6;

/// The share of a mode's energy that a movement has to exceed to name the mode. Basis: only one
/// movement can have more than half. Doubling it names no mode.
const MAJORITY_SHARE: f64 = 0.5;

/// The coordinates of motions in the horizontal plane: q2 and q4 along c3; q5, q7 and q9 about c2.
const HORIZONTAL_COORDINATES: [usize; 5] = [TUB_Z, SHAFT_Z, TUB_YAW, SHAFT_YAW, HINGE_YAW];

/// The coordinates of the motions as one rigid body: along c2, along c3, about c2, about c3. The
/// drum has none, because its angles are relative to the shaft.
const RIGID_COORDINATE_PAIRS: [[usize; 2]; 4] =
    [[TUB_Y, SHAFT_Y], [TUB_Z, SHAFT_Z], [TUB_YAW, SHAFT_YAW], [TUB_PITCH, SHAFT_PITCH]];

/// Returns the movement with the greatest share of a shape of unit modal mass, if that movement has
/// more than half of the energy in both planes together.
pub(crate) fn dominant_motion(
    point: &Point,
    mass: &[[f64; COORDINATES]; COORDINATES],
    shape: &[[f64; 2]; COORDINATES],
) -> ModeMotion {
    let energy_shares = rigid_energy_shares(mass, shape);
    let [vertical_translation_share, horizontal_translation_share, yaw_share, pitch_share] =
        energy_shares;
    let movement = if energy_shares.iter().sum::<f64>() < 1.0 - MAJORITY_SHARE {
        relative_movement(point, shape)
    } else {
        rigid_movement(energy_shares)
    };
    let mut horizontal_part = [[0.0; 2]; COORDINATES];
    for i in HORIZONTAL_COORDINATES {
        horizontal_part[i] = shape[i];
    }
    let horizontal_energy_share = mass_inner_product(mass, &horizontal_part, &horizontal_part)[0];
    let plane = if horizontal_energy_share > PLANE_SHARE {
        MotionPlane::Horizontal
    } else if horizontal_energy_share < 1.0 - PLANE_SHARE {
        MotionPlane::Vertical
    } else {
        MotionPlane::Both
    };
    ModeMotion {
        movement,
        plane,
        vertical_translation_share,
        horizontal_translation_share,
        yaw_share,
        pitch_share,
    }
}

/// Returns the rigid movement that has the greatest of these shares, in the order of
/// [`RIGID_COORDINATE_PAIRS`], and more than half of the energy.
fn rigid_movement([vertical, horizontal, yaw, pitch]: [f64; 4]) -> Movement {
    let is_translation = vertical.max(horizontal) > yaw.max(pitch);
    if is_translation && vertical + horizontal > MAJORITY_SHARE {
        Movement::Translation
    } else if !is_translation && yaw + pitch > MAJORITY_SHARE {
        Movement::Rocking
    } else {
        Movement::Mixed
    }
}

/// Computes the shares of a shape's energy in the rigid motions, in the order of
/// [`RIGID_COORDINATE_PAIRS`]. Rotations are made orthogonal to the translations, so that they are
/// about the mass centre.
fn rigid_energy_shares(
    mass: &[[f64; COORDINATES]; COORDINATES],
    shape: &[[f64; 2]; COORDINATES],
) -> [f64; 4] {
    let mut basis: Vec<[[f64; 2]; COORDINATES]> = Vec::with_capacity(RIGID_COORDINATE_PAIRS.len());
    for coordinates in RIGID_COORDINATE_PAIRS {
        let mut rigid_vector = [[0.0; 2]; COORDINATES];
        for i in coordinates {
            rigid_vector[i][0] = 1.0;
        }
        for basis_vector in &basis {
            let projection = mass_inner_product(mass, basis_vector, &rigid_vector)[0];
            for i in 0..COORDINATES {
                rigid_vector[i][0] -= projection * basis_vector[i][0];
            }
        }
        let mass_norm = mass_inner_product(mass, &rigid_vector, &rigid_vector)[0].sqrt();
        basis.push(rigid_vector.map(|[re, _]| [re / mass_norm, 0.0]));
    }
    core::array::from_fn(|k| {
        let [re, im] = mass_inner_product(mass, &basis[k], shape);
        re * re + im * im
    })
}

/// Returns the relative movement of the bodies with the greatest strain energy: bending of the
/// flexure, translation or tilt in the bearings.
fn relative_movement(point: &Point, shape: &[[f64; 2]; COORDINATES]) -> Movement {
    let bodies = &point.machine.bodies;
    let squared_amplitude = |i: usize| shape[i][0].powi(2) + shape[i][1].powi(2);
    let squared_difference = |i: usize, j: usize| {
        (shape[i][0] - shape[j][0]).powi(2) + (shape[i][1] - shape[j][1]).powi(2)
    };
    let bending_energy = bodies.flexure_stiffness.0
        * (squared_amplitude(HINGE_YAW) + squared_amplitude(HINGE_PITCH));
    let front_stiffness = bodies.front_bearing_stiffness.0;
    let rear_stiffness = bodies.rear_bearing_stiffness.0;
    let squared_offset = squared_difference(SHAFT_Y, TUB_Y) + squared_difference(SHAFT_Z, TUB_Z);
    let translation_energy = (front_stiffness + rear_stiffness) * squared_offset;
    let tilt_stiffness = front_stiffness * bodies.front_bearing_x.0.powi(2)
        + rear_stiffness * bodies.rear_bearing_x.0.powi(2);
    let squared_tilt =
        squared_difference(SHAFT_YAW, TUB_YAW) + squared_difference(SHAFT_PITCH, TUB_PITCH);
    let tilting_energy = tilt_stiffness * squared_tilt;
    if bending_energy > translation_energy.max(tilting_energy) {
        Movement::Bending
    } else if translation_energy > tilting_energy {
        Movement::BearingTranslation
    } else {
        Movement::BearingTilt
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mode_is_named_after_the_movement_with_most_of_its_energy() {
        for (shares, movement) in [
            ([0.1, 0.6, 0.3, 0.0], Movement::Translation),
            ([0.4, 0.4, 0.1, 0.1], Movement::Translation),
            ([0.0, 0.3, 0.65, 0.0], Movement::Rocking),
            ([0.05, 0.1, 0.42, 0.42], Movement::Rocking),
            // The greatest single share and the majority of the shares belong to different
            // movements.
            ([0.45, 0.0, 0.29, 0.26], Movement::Mixed),
            ([0.0, 0.45, 0.29, 0.2], Movement::Mixed),
            ([0.3, 0.25, 0.42, 0.0], Movement::Mixed),
        ] {
            assert_eq!(rigid_movement(shares), movement, "{shares:?}");
        }
    }

    /// Checks that the names of random machines' modes follow the greatest of their shares; the
    /// seed is printed.
    #[test]
    fn names_of_random_machines_follow_the_shares() {
        let time_since_epoch =
            std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap();
        let seed =
            std::env::var("SEED").map_or(time_since_epoch.as_secs(), |text| text.parse().unwrap());
        println!("SEED={seed}");
        let mut random_numbers = fastrand::Rng::with_seed(seed);
        let mut translation_count = 0;
        let mut rocking_count = 0;
        let mut mixed_count = 0;
        for _ in 0..40 {
            let mut machine = crate::Machine::paper();
            let mut random_factor = || 0.4 * 6.0_f64.powf(random_numbers.f64());
            machine.tub.mass_kg *= random_factor();
            machine.tub.centre_x_m *= random_factor();
            machine.tub.inertia_kg_m2 =
                machine.tub.inertia_kg_m2.map(|moment| moment * random_factor());
            for spring in &mut machine.springs {
                spring.stiffness_n_per_m *= random_factor();
            }
            let spin = crate::Spin::Table { time_s: vec![0.0], speed_rpm: vec![100.0] };
            let timing = crate::Timing { end_s: 1.0, window_s: [0.0, 1.0], checkpoints: 0 };
            let points = crate::prepare(lane_ode::Simd::widest(), &[(machine, spin)], &timing);
            let Some(Ok(point)) = points.into_iter().next() else { continue };
            let modes = crate::modes::modes(&point, 0.0, 10.0).unwrap();
            for mode in &modes.modes[..4] {
                let motion = dominant_motion(&point, &modes.mass, &mode.shape);
                let translation_share =
                    motion.vertical_translation_share.max(motion.horizontal_translation_share);
                let rocking_share = motion.yaw_share.max(motion.pitch_share);
                match motion.movement {
                    Movement::Translation => {
                        assert!(translation_share > rocking_share, "{motion:?}");
                        translation_count += 1;
                    }
                    Movement::Rocking => {
                        assert!(rocking_share >= translation_share, "{motion:?}");
                        rocking_count += 1;
                    }
                    Movement::Mixed => {
                        assert!(
                            translation_share.max(rocking_share) <= MAJORITY_SHARE,
                            "{motion:?}"
                        );
                        mixed_count += 1;
                    }
                    _ => {}
                }
            }
        }
        println!("{translation_count} translations, {rocking_count} rockings, {mixed_count} mixed");
        assert!(translation_count > 0 && rocking_count > 0);
    }
}

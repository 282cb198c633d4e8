//! Mode shapes in words: the motion of tub and drum that dominates each.

use crate::coordinates::{
    HINGE_YAW, SHAFT_PITCH, SHAFT_Y, SHAFT_YAW, SHAFT_Z, TUB_PITCH, TUB_Y, TUB_YAW, TUB_Z,
};
use crate::modes::inner;
use crate::{COORDINATES, Point};
use core::fmt;

/// A plane through the drum axis, or both.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Plane {
    /// Along c3, about c2.
    Horizontal,
    /// Along c2, about c3.
    Vertical,
    /// Neither prevails.
    Both,
}

/// What moves in a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Movement {
    /// Tub and drum together, their axis staying parallel to itself.
    Translation,
    /// Tub and drum together, about their common mass centre.
    Rocking,
    /// The drum against its shaft.
    Bending,
    /// The shaft against the tub, its axis staying parallel to itself.
    BearingTranslation,
    /// The shaft against the tub, tilting.
    BearingTilt,
    /// None of these has more than half of the energy.
    Mixed,
}

/// The movement with the greatest share of a mode shape, if that is more than half of its energy,
/// and the shares of its kinetic energy in the motions of the machine as one rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// What moves.
    pub movement: Movement,
    /// Where.
    pub plane: Plane,
    /// Share of the motion along c2,
    pub vertical_translation: f64,
    /// along c3,
    pub horizontal_translation: f64,
    /// about c2 through the mass centre,
    pub yaw: f64,
    /// and about c3. The rest is relative motion of the bodies.
    pub pitch: f64,
}

/// Every movement in every plane, in words.
macro_rules! motion_names {
    ($($what:literal)*) => {
        [$(
            concat!($what, ", horizontal plane"),
            concat!($what, ", vertical plane"),
            concat!($what, ", both planes"),
        )*]
    };
}

impl Motion {
    /// Every name of a motion, by movement and then by plane.
    pub const NAMES: [&str; 18] = motion_names![
        "translation"
        "rocking"
        "drum bending on its shaft"
        "shaft against tub in the bearings"
        "shaft tilting in the bearings"
        "mixed"
    ];

    /// Position of its name in [`Self::NAMES`].
    pub const fn name_index(&self) -> usize {
        3 * self.movement as usize + self.plane as usize
    }
}

impl fmt::Display for Motion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::NAMES[self.name_index()])
    }
}

/// The share of a mode's energy (1) above which a motion is in one plane. Basis: convention, a
/// motion with three fifths of its energy in a plane looks like one of that plane. Doubling it puts
/// every mode in both planes.
const PREVAILS: f64 = 0.6;

/// The share of a mode's energy (1) that a movement has to exceed to name the mode. Basis: only one
/// movement can have more than half. Doubling it names no mode.
const MAJORITY: f64 = 0.5;

/// Coordinates of the horizontal plane: q2, q4 along c3, q5, q7, q9 about c2.
const HORIZONTAL: [usize; 5] = [TUB_Z, SHAFT_Z, TUB_YAW, SHAFT_YAW, HINGE_YAW];

/// The machine moving as one: along c2, along c3, about c2, about c3. Body angles of the drum are
/// against the shaft.
const RIGID: [[usize; 2]; 4] =
    [[TUB_Y, SHAFT_Y], [TUB_Z, SHAFT_Z], [TUB_YAW, SHAFT_YAW], [TUB_PITCH, SHAFT_PITCH]];

/// Returns the movement with the greatest share of a shape of unit modal mass, if that movement has
/// more than half of the energy in both planes together.
pub(crate) fn motion(
    point: &Point,
    mass: &[[f64; COORDINATES]; COORDINATES],
    shape: &[[f64; 2]; COORDINATES],
) -> Motion {
    let shares = rigid_shares(mass, shape);
    let [vertical_translation, horizontal_translation, yaw, pitch] = shares;
    let movement = if shares.iter().sum::<f64>() < 1.0 - MAJORITY {
        relative_movement(point, shape)
    } else {
        rigid_movement(shares)
    };
    let mut in_plane = [[0.0; 2]; COORDINATES];
    for i in HORIZONTAL {
        in_plane[i] = shape[i];
    }
    let horizontal = inner(mass, &in_plane, &in_plane)[0];
    let plane = if horizontal > PREVAILS {
        Plane::Horizontal
    } else if horizontal < 1.0 - PREVAILS {
        Plane::Vertical
    } else {
        Plane::Both
    };
    Motion { movement, plane, vertical_translation, horizontal_translation, yaw, pitch }
}

/// Returns the rigid movement that has the greatest of these shares, in the order of [`RIGID`], and
/// more than half of the energy.
fn rigid_movement([vertical, horizontal, yaw, pitch]: [f64; 4]) -> Movement {
    let is_translation = vertical.max(horizontal) > yaw.max(pitch);
    if is_translation && vertical + horizontal > MAJORITY {
        Movement::Translation
    } else if !is_translation && yaw + pitch > MAJORITY {
        Movement::Rocking
    } else {
        Movement::Mixed
    }
}

/// Likeness of a shape to each rigid motion. Rotations are made orthogonal to the translations, and
/// so are about the mass centre.
fn rigid_shares(
    mass: &[[f64; COORDINATES]; COORDINATES],
    shape: &[[f64; 2]; COORDINATES],
) -> [f64; 4] {
    let mut basis: Vec<[[f64; 2]; COORDINATES]> = Vec::with_capacity(RIGID.len());
    for coordinates in RIGID {
        let mut rigid = [[0.0; 2]; COORDINATES];
        for i in coordinates {
            rigid[i][0] = 1.0;
        }
        for other in &basis {
            let along = inner(mass, other, &rigid)[0];
            for i in 0..COORDINATES {
                rigid[i][0] -= along * other[i][0];
            }
        }
        let scale = inner(mass, &rigid, &rigid)[0].sqrt();
        basis.push(rigid.map(|[re, _]| [re / scale, 0.0]));
    }
    core::array::from_fn(|k| {
        let [re, im] = inner(mass, &basis[k], shape);
        re * re + im * im
    })
}

/// Which spring between the bodies holds most energy: the flexure, or the bearings pushed or
/// tilted.
fn relative_movement(point: &Point, shape: &[[f64; 2]; COORDINATES]) -> Movement {
    let bodies = &point.machine.bodies;
    let squared = |i: usize| shape[i][0].powi(2) + shape[i][1].powi(2);
    let apart = |i: usize, j: usize| {
        (shape[i][0] - shape[j][0]).powi(2) + (shape[i][1] - shape[j][1]).powi(2)
    };
    let bending = bodies.flexure_stiffness.0 * (squared(8) + squared(9));
    let (front, rear) = (bodies.front_stiffness.0, bodies.rear_stiffness.0);
    let pushing = (front + rear) * (apart(2, 0) + apart(3, 1));
    let arm = front * bodies.bearing_front.0.powi(2) + rear * bodies.bearing_rear.0.powi(2);
    let tilting = arm * (apart(6, 4) + apart(7, 5));
    if bending > pushing.max(tilting) {
        Movement::Bending
    } else if pushing > tilting {
        Movement::BearingTranslation
    } else {
        Movement::BearingTilt
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mode_has_the_name_of_the_movement_with_most_of_its_energy() {
        for (shares, movement) in [
            ([0.1, 0.6, 0.3, 0.0], Movement::Translation),
            ([0.4, 0.4, 0.1, 0.1], Movement::Translation),
            ([0.0, 0.3, 0.65, 0.0], Movement::Rocking),
            ([0.05, 0.1, 0.42, 0.42], Movement::Rocking),
            // The greatest share is of a movement without a majority, the majority of another.
            ([0.45, 0.0, 0.29, 0.26], Movement::Mixed),
            ([0.0, 0.45, 0.29, 0.2], Movement::Mixed),
            ([0.3, 0.25, 0.42, 0.0], Movement::Mixed),
        ] {
            assert_eq!(rigid_movement(shares), movement, "{shares:?}");
        }
    }

    /// Names of random machines' modes follow the greatest of their shares; the seed is printed.
    #[test]
    fn names_of_random_machines_follow_the_shares() {
        let clock = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap();
        let seed = std::env::var("SEED").map_or(clock.as_secs(), |it| it.parse().unwrap());
        println!("SEED={seed}");
        let mut numbers = fastrand::Rng::with_seed(seed);
        let (mut translations, mut rockings, mut mixed) = (0, 0, 0);
        for _ in 0..40 {
            let mut machine = crate::Machine::paper();
            let mut factor = || 0.4 * 6.0_f64.powf(numbers.f64());
            machine.tub.mass_kg *= factor();
            machine.tub.centre_x_m *= factor();
            machine.tub.inertia_kg_m2 = machine.tub.inertia_kg_m2.map(|it| it * factor());
            for spring in &mut machine.springs {
                spring.stiffness_n_per_m *= factor();
            }
            let spin = crate::Spin::Table { time_s: vec![0.0], speed_rpm: vec![100.0] };
            let timing = crate::Timing { end_s: 1.0, window_s: [0.0, 1.0], checkpoints: 0 };
            let points = crate::prepare(lane_ode::Simd::best(), &[(machine, spin)], &timing);
            let Some(Ok(point)) = points.into_iter().next() else { continue };
            let found = crate::modes::modes(&point, 0.0, 10.0).unwrap();
            for mode in &found.modes[..4] {
                let motion = motion(&point, &found.mass, &mode.shape);
                let translation = motion.vertical_translation.max(motion.horizontal_translation);
                let rocking = motion.yaw.max(motion.pitch);
                match motion.movement {
                    Movement::Translation => {
                        assert!(translation > rocking, "{motion:?}");
                        translations += 1;
                    }
                    Movement::Rocking => {
                        assert!(rocking >= translation, "{motion:?}");
                        rockings += 1;
                    }
                    Movement::Mixed => {
                        assert!(translation.max(rocking) <= MAJORITY, "{motion:?}");
                        mixed += 1;
                    }
                    _ => {}
                }
            }
        }
        println!("{translations} translations, {rockings} rockings, {mixed} mixed");
        assert!(translations > 0 && rockings > 0);
    }
}

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
}

/// The movement with the greatest share of a mode shape, and the shares of its kinetic energy in
/// the motions of the machine as one rigid body.
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
    pub const NAMES: [&str; 15] = motion_names![
        "translation"
        "rocking"
        "drum bending on its shaft"
        "shaft against tub in the bearings"
        "shaft tilting in the bearings"
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

/// Above this share of its energy a motion is in one plane.
const PREVAILS: f64 = 0.6;

/// Coordinates of the horizontal plane: q2, q4 along c3, q5, q7, q9 about c2.
const HORIZONTAL: [usize; 5] = [TUB_Z, SHAFT_Z, TUB_YAW, SHAFT_YAW, HINGE_YAW];

/// The machine moving as one: along c2, along c3, about c2, about c3. Body angles of the drum are
/// against the shaft.
const RIGID: [[usize; 2]; 4] =
    [[TUB_Y, SHAFT_Y], [TUB_Z, SHAFT_Z], [TUB_YAW, SHAFT_YAW], [TUB_PITCH, SHAFT_PITCH]];

/// Returns the movement with the greatest share of a shape of unit modal mass. Shares of one
/// movement in two planes do not add up: each is a motion of its own.
pub(crate) fn motion(
    point: &Point,
    mass: &[[f64; COORDINATES]; COORDINATES],
    shape: &[[f64; 2]; COORDINATES],
) -> Motion {
    let shares = rigid_shares(mass, shape);
    let [vertical_translation, horizontal_translation, yaw, pitch] = shares;
    let movement = if shares.iter().sum::<f64>() < 0.5 {
        relative_movement(point, shape)
    } else if vertical_translation.max(horizontal_translation) > yaw.max(pitch) {
        Movement::Translation
    } else {
        Movement::Rocking
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

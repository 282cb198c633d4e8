//! The speed amplitudes at which the linear model of a point takes friction.

use crate::{Damper, Machine};
use core::f64::consts::PI;

/// The speed amplitude at which the linear model takes the friction of a damper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionSpeed {
    pub damper: usize,
    pub speed_m_per_s: f64,
    /// Whether the speed was found from the linear motion, not given by the user.
    pub is_from_motion: bool,
    /// The speed v_s (m/s), below which the force law of friction is that of a viscous damper.
    pub(crate) viscous_limit_m_per_s: f64,
}

impl FrictionSpeed {
    /// Returns the speed amplitude of every damper with friction; a default stands for amplitudes
    /// that follow from the motion. Friction beyond a free stroke is linearised about the position
    /// at rest and has no speed amplitude.
    pub(crate) fn all(machine: &Machine) -> Vec<Self> {
        let friction_speed = |(index, damper): (usize, &Damper)| {
            let given = damper.friction_linear_speed_m_per_s;
            (damper.friction_n != 0.0 && damper.free_stroke_m == 0.0).then(|| Self {
                damper: index,
                speed_m_per_s: given.unwrap_or(Damper::FIRST_LINEAR_SPEED_M_PER_S),
                is_from_motion: given.is_none(),
                viscous_limit_m_per_s: 4.0 * damper.friction_speed_m_per_s / PI,
            })
        };
        machine.dampers.iter().enumerate().filter_map(friction_speed).collect()
    }
}

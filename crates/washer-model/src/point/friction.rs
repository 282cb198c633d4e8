//! The speed amplitudes at which the linear model of a point linearises friction.

use crate::{Damper, Machine};
use core::f64::consts::PI;

/// The speed amplitude at which the linear model linearises the friction of a damper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionSpeed {
    pub damper_index: usize,
    pub speed_m_per_s: f64,
    /// Whether the speed was found from the linear motion, not given by the user.
    pub is_from_motion: bool,
    /// The speed v_s (m/s), below which the force law of friction is that of a viscous damper.
    pub(crate) viscous_limit_m_per_s: f64,
}

impl FrictionSpeed {
    /// Returns the speed amplitude of every damper with friction; an amplitude that follows from
    /// the motion has the default as an initial estimate. Friction beyond a free stroke is
    /// linearised about the position at rest and has no speed amplitude.
    pub(crate) fn for_dampers(machine: &Machine) -> Vec<Self> {
        let friction_speed = |(index, damper): (usize, &Damper)| {
            let user_speed = damper.friction_linear_speed_m_per_s;
            (damper.friction_n != 0.0 && damper.free_stroke_m == 0.0).then(|| Self {
                damper_index: index,
                speed_m_per_s: user_speed.unwrap_or(Damper::INITIAL_LINEAR_SPEED_M_PER_S),
                is_from_motion: user_speed.is_none(),
                viscous_limit_m_per_s: 4.0 * damper.friction_speed_m_per_s / PI,
            })
        };
        machine.dampers.iter().enumerate().filter_map(friction_speed).collect()
    }
}

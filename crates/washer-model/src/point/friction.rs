//! At which speed amplitudes the linear model of a point takes friction.

use crate::{Damper, Machine};
use core::f64::consts::PI;

/// At which speed amplitude the linear model takes the friction of a damper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionSpeed {
    /// Position of the damper in the machine.
    pub damper: usize,
    /// The speed amplitude (m/s).
    pub speed_m_per_s: f64,
    /// Whether it is that of the linear motion, not a given one.
    pub is_own: bool,
    /// Below this (m/s) friction is viscous by its own law.
    pub(crate) least_m_per_s: f64,
}

impl FrictionSpeed {
    /// Of every damper with friction; own ones not found yet.
    pub(crate) fn all(machine: &Machine) -> Vec<Self> {
        let of_damper = |(damper, of): (usize, &Damper)| {
            let given = of.friction_linear_speed_m_per_s;
            (of.friction_n != 0.0).then(|| Self {
                damper,
                speed_m_per_s: given.unwrap_or(Damper::FIRST_LINEAR_SPEED_M_PER_S),
                is_own: given.is_none(),
                least_m_per_s: 4.0 * of.friction_speed_m_per_s / PI,
            })
        };
        machine.dampers.iter().enumerate().filter_map(of_damper).collect()
    }
}

//! Prescribed spin of the shaft: angle, speed and acceleration as functions of time.

use lane_ode::{N, Real};

/// Speed of the drum over time, as a user describes it. Speeds in rpm, times in s.
#[derive(Clone, Debug, PartialEq)]
pub enum Spin {
    /// Cycloidal run-up, then constant (Eq. 42): w = peak (t/ramp - sin(2 pi t/ramp) / 2 pi).
    Cycloidal {
        /// Speed reached at the end of the ramp.
        peak_rpm: f64,
        /// Duration of the ramp.
        ramp_s: f64,
    },
    /// Linear up over `ramp_s`, linear down over `ramp_s`, then at rest.
    Triangular {
        /// Speed at the turn.
        peak_rpm: f64,
        /// Duration of each flank.
        ramp_s: f64,
    },
    /// Linear up over `ramp_s`, then constant.
    Ramp {
        /// Speed reached at the end of the ramp.
        peak_rpm: f64,
        /// Duration of the ramp.
        ramp_s: f64,
    },
    /// Linear between the given points; constant beyond the last.
    Table {
        /// Times, increasing, the first 0.
        time_s: Vec<f64>,
        /// Speeds at these times.
        speed_rpm: Vec<f64>,
    },
}

/// The spin at one instant, as the equations read it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SpinState<T> {
    pub(crate) sin: N<T>,
    pub(crate) cos: N<T>,
    /// Of twice the angle.
    pub(crate) sin_2: N<T>,
    pub(crate) cos_2: N<T>,
    /// theta', rad/s.
    pub(crate) speed: N<T>,
    /// theta'', rad/s^2.
    pub(crate) acceleration: N<T>,
}

impl<T: Real> SpinState<T> {
    /// From the sine and cosine of theta.
    #[inline(always)]
    pub(crate) fn new((sin, cos): (N<T>, N<T>), speed: N<T>, acceleration: N<T>) -> Self {
        let sin_2 = (2.0 * (sin * cos).v()).v();
        let cos_2 = 1.0 - 2.0 * (sin * sin).v();
        Self { sin, cos, sin_2, cos_2, speed, acceleration }
    }
}

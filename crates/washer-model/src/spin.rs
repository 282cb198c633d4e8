//! Prescribed spin of the shaft: angle, speed and acceleration as functions of time.

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

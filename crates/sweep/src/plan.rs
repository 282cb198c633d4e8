//! What a run is about to do, with every value resolved and checked: the one thing that flows from the
//! configuration into the engine, the store and the reports.

use washer_model::{Channel, Machine, Spin};

/// A validated run: every grid point of every axis, and how each is integrated.
///
/// A plan can only be made by the configuration, which refuses bad input, so the rest of the program takes its
/// numbers as they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Name of the run; the output defaults to `results/<name>.parquet`.
    pub name: String,
    /// The machine after `[set]` and `--set`, before the axes.
    pub machine: Machine,
    /// The spin after `[set]` and `--set`, before the axes.
    pub spin: Spin,
    /// Integration runs over `0..=end_s`.
    pub end_s: f64,
    /// Amplitudes are taken over this closed interval.
    pub window_s: [f64; 2],
    /// Method and its settings.
    pub integrator: Integrator,
    /// The grid's axes; the first varies slowest.
    pub axes: Vec<Axis>,
    /// What counts as reliable.
    pub reliability: Reliability,
}

/// How a trajectory is integrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Integrator {
    /// Classical Runge-Kutta with a fixed step.
    Rk4 {
        /// Step; the last one before a window edge or the end is shortened by the plan to hit it exactly.
        step_s: f64,
    },
    /// Dormand-Prince 5(4), adaptive.
    Dopri5 {
        /// Relative tolerance per component.
        rtol: f64,
        /// Absolute tolerance per component (m, rad, m/s, rad/s).
        atol: f64,
    },
    /// Classical Runge-Kutta over the mass-scaled bearings.
    Rk4MassScaled {
        /// Relative error asked of every amplitude.
        accuracy: f64,
    },
}

/// One swept parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Name from the parameter table.
    pub parameter: &'static washer_model::Parameter,
    /// The values along it.
    pub values: AxisValues,
}

/// Values of an axis, made on demand: an axis of a million values takes no memory.
#[derive(Clone, Debug, PartialEq)]
pub enum AxisValues {
    /// As listed.
    List(Vec<f64>),
    /// Evenly spaced, both ends included.
    Linear {
        /// First value.
        from: f64,
        /// Last value.
        to: f64,
        /// How many, at least 1.
        count: u64,
    },
    /// Evenly spaced in the logarithm, both ends included.
    Log {
        /// First value.
        from: f64,
        /// Last value.
        to: f64,
        /// How many, at least 1.
        count: u64,
    },
}

/// The verdict's rule.
#[derive(Clone, Debug, PartialEq)]
pub struct Reliability {
    /// A point is reliable when its greatest ratio is below this.
    pub ratio_limit: f64,
    /// The channels that are compared, in column order.
    pub channels: Vec<Channel>,
}

/// One grid point's input: the machine and spin with that point's axis values in place.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// The machine.
    pub machine: Machine,
    /// The spin.
    pub spin: Spin,
}

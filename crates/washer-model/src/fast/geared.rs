//! Gears: a formula whose step and caps follow the drum's speed.

use crate::{Caps, ModelKind};
use lane_ode::dop853::{DOP853_STABILITY_LIMIT, DOP853_STAGES};
use lane_ode::rk4::RK4_STABILITY_LIMIT;

/// Order of the polynomials between steps in which peaks are found.
const INTERPOLATION_ORDER: i32 = 6;

/// The step phase h w at which the relative error of these polynomials is `error`. For a motion of
/// frequency w it is (h w)^6 / 46080. A motion driven at w also has a part at 3 w, a hundredth of
/// it, say, whose error is 729 times as large.
pub(crate) fn interpolation_phase(error: f64) -> f64 {
    (6300.0 * error).powf(1.0 / 6.0)
}

/// An explicit Runge-Kutta formula with a fixed step. Each model has one for its capped modes:
/// [`Formula::of`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Formula {
    /// The classical one of order 4.
    Rk4,
    /// Dormand's and Prince's of order 8.
    Dop853,
}

impl Formula {
    /// The formula of a model's capped steps.
    ///
    /// Most of the linear model's time goes into its matrices at every instant that a formula asks
    /// for: two a step by order 4, eleven by order 8. So order 4 takes less time, and its shorter
    /// steps bear caps twice as high.
    pub const fn of(model: ModelKind) -> Self {
        match model {
            ModelKind::Nonlinear => Self::Dop853,
            ModelKind::Linear => Self::Rk4,
        }
    }

    /// Evaluations of the right-hand side per second of motion.
    pub fn evaluations_per_s(self, step_s: f64) -> f64 {
        let stages = match self {
            Self::Rk4 => 4.0,
            Self::Dop853 => DOP853_STAGES as f64,
        };
        stages / step_s
    }

    /// The greatest h w in use. Classical Runge-Kutta damps motion near its limit of stability, so
    /// that nearly all of the limit is in use. The formula of order 8 hardly does: with 0.97 of its
    /// limit instead of 0.83, errors were twenty times as large.
    pub const fn limit(self) -> f64 {
        match self {
            Self::Rk4 => 0.97 * RK4_STABILITY_LIMIT,
            Self::Dop853 => 0.83 * DOP853_STABILITY_LIMIT,
        }
    }

    /// Relative error of a motion over one radian, by `step_phase` = h w.
    pub(crate) fn error_per_radian(self, step_phase: f64) -> f64 {
        match self {
            Self::Rk4 => step_phase.powi(4) / 120.0,
            // The nonlinear terms of order 9; a linear oscillation has a tenth of this.
            Self::Dop853 => step_phase.powi(8) / 362_880.0,
        }
    }

    /// The step phase h w at which that error is `error`.
    pub(crate) fn step_phase(self, error: f64) -> f64 {
        match self {
            Self::Rk4 => (120.0 * error).powf(0.25),
            Self::Dop853 => (362_880.0 * error).powf(0.125),
        }
    }
}

/// Step and caps up to a speed of the drum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gear {
    /// In use until the drum has turned faster than this (rad/s).
    pub up_to_rad_per_s: f64,
    /// Longest step (s).
    pub step_s: f64,
    /// The caps.
    pub caps: Caps,
}

/// How many gears there are.
pub(crate) const GEARS: usize = 3;

/// Steps and caps of a model's formula, by gears.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geared {
    /// From the slowest drum to the fastest; the last has no upper speed.
    pub gears: [Gear; GEARS],
}

impl Geared {
    /// The same step and caps at every speed.
    pub const fn steady(step_s: f64, caps: Caps) -> Self {
        Self { gears: [Gear { up_to_rad_per_s: f64::INFINITY, step_s, caps }; GEARS] }
    }

    /// The gear of the fastest drum.
    pub const fn top(&self) -> &Gear {
        &self.gears[GEARS - 1]
    }

    /// The greatest ratio of this choice's error to that of a coarser one, over the parts of the
    /// error (truncation, interpolation between steps, caps of bearings and hinge) and over the
    /// speeds of the drum.
    pub fn share_of_error(&self, coarser: &Self) -> f64 {
        let speeds = self.gears.iter().chain(&coarser.gears).map(|gear| gear.up_to_rad_per_s);
        let shares = speeds.filter(|speed| *speed > 0.0).map(|speed| {
            let (fine, coarse) = (self.gear(speed), coarser.gear(speed));
            let of_steps = (fine.step_s / coarse.step_s).powi(INTERPOLATION_ORDER);
            let of_cap = |fine: f64, coarse: f64| (coarse / fine) * (coarse / fine);
            let of_bearings = of_cap(fine.caps.bearings_rad_per_s, coarse.caps.bearings_rad_per_s);
            let of_hinge = match (fine.caps.hinge_rad_per_s, coarse.caps.hinge_rad_per_s) {
                (Some(fine), Some(coarse)) => of_cap(fine, coarse),
                (Some(_), None) => f64::INFINITY,
                (None, _) => 0.0,
            };
            of_steps.max(of_bearings).max(of_hinge)
        });
        shares.fold(0.0, f64::max)
    }

    /// The gear for a drum that has not turned faster than `fastest_rad_per_s` so far.
    pub(crate) fn gear(&self, fastest_rad_per_s: f64) -> &Gear {
        self.gears
            .iter()
            .find(|gear| fastest_rad_per_s <= gear.up_to_rad_per_s)
            .unwrap_or(self.top())
    }
}

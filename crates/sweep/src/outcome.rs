//! What came of a grid point: one row of the result file.

/// Why a trajectory ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Status {
    /// Reached the end.
    Ok,
    /// A state left the range in which the model means anything, or became non-finite.
    Diverged,
    /// The adaptive step fell below what time can resolve.
    StepTooSmall,
    /// The adaptive method used up its allowance of steps.
    StepLimit,
    /// The machine has no static equilibrium at this point.
    NoEquilibrium,
    /// The evaluation of this point panicked; a defect of this program, kept to the one row.
    Panicked,
}

impl Status {
    /// Every status; the position is its code in chunk files, so new ones go to the end.
    pub const ALL: [Self; 6] =
        [Self::Ok, Self::Diverged, Self::StepTooSmall, Self::StepLimit, Self::NoEquilibrium, Self::Panicked];
}

/// One model's trajectory at one grid point.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// How it ended.
    pub status: Status,
    /// When it failed, if it did during the integration.
    pub fail_time_s: Option<f64>,
    /// Largest deviation from equilibrium within the window, per channel of the plan; empty if the model failed.
    pub amplitudes: Vec<f64>,
    /// Least gap between drum and tub over the whole run; `None` if the model failed.
    pub min_gap_m: Option<f64>,
    /// Accepted steps.
    pub steps: u64,
    /// Rejected steps.
    pub rejected: u64,
}

/// Both models at one grid point.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Index in grid order.
    pub point: u64,
    /// The nonlinear model.
    pub nonlinear: Trajectory,
    /// The linear model.
    pub linear: Trajectory,
    /// Whether the nonlinear motion is chaotic, so that the verdict is stable but the ratio's digits are not;
    /// `None` where it was not assessed.
    pub sensitive: Option<bool>,
}

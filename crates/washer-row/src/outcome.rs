//! The outcome of a grid point: one row of the result file.

use washer_model::{Beyond, Channel, Disturbance, Endings, NoAnswer, Response};

use crate::Level;

/// Why a trajectory ended. The position is its code in chunk files, so new ones go to the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Status {
    /// Reached the end.
    #[default]
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
    /// No periodic response was found at a constant speed.
    NoResponse,
    /// Its multipliers could not be computed.
    NoMultipliers,
    /// The drum is so slow that a turn takes too many steps.
    TooSlow,
}

impl From<NoAnswer> for Status {
    fn from(none: NoAnswer) -> Self {
        match none {
            NoAnswer::NoResponse | NoAnswer::Stopped => Self::NoResponse,
            NoAnswer::Eigenvalues => Self::NoMultipliers,
            NoAnswer::TooSlow => Self::TooSlow,
        }
    }
}

/// One model's trajectory at one grid point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    /// How it ended.
    pub status: Status,
    /// When it failed, if it did during the integration.
    pub fail_time_s: Option<f64>,
    /// Largest deviation from equilibrium within the window, per channel of the plan; empty if the
    /// model failed.
    pub amplitudes: Vec<f64>,
    /// Least gap between drum and tub over the whole run; `None` if the model failed.
    pub min_gap_m: Option<f64>,
    /// Accepted steps.
    pub steps: u64,
    /// Rejected steps.
    pub rejected: u64,
    /// The model's metrics that the plan asks for, in column order; empty if the model failed.
    pub metrics: Vec<f64>,
    /// The factor by which the speeds at which the linear model takes friction are off from those
    /// of this motion. `None` without friction, if the model failed, and for the nonlinear model
    /// where no speed is given.
    pub friction_speed_off: Option<f64>,
    /// Largest deviations by turn of the drum, in the order of `Channel::ALL`: while the two models
    /// are being compared by them.
    pub turns: Vec<Deviations>,
}

/// Every channel's deviation, in the order of `Channel::ALL` (m, rad).
pub type Deviations = [f64; Channel::ALL.len()];

impl Trajectory {
    /// Nothing but a status.
    pub fn failed(status: Status) -> Self {
        Self { status, ..Self::default() }
    }
}

/// A response at a constant speed, and what becomes of small disturbances of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// Whether it is on the curve of responses that begins at a low speed.
    pub is_on_curve: bool,
    /// How many folds the curve has before it.
    pub branch: u32,
    /// Speeds (rpm) of the folds between which that branch lies, lower and upper.
    pub between_rpm: [Option<f64>; 2],
    /// What of the machine's geometry it passes.
    pub beyond: Option<Beyond>,
    /// The fastest growing one.
    pub fastest: Disturbance,
    /// Modes of the linear model that take part in what grows, most first.
    pub modes: [Option<GrowingMode>; 2],
}

/// A mode of the linear model that takes part in what grows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GrowingMode {
    /// Its number, the slowest's being 1.
    pub number: u32,
    /// Position of its name in `Motion::NAMES`.
    pub name: u32,
    /// Its damped natural frequency (cycles per minute).
    pub frequency_cpm: f64,
}

impl From<&Response> for Growth {
    fn from(response: &Response) -> Self {
        let mode = |place: usize| {
            let participant = response.participants.get(place)?;
            Some(GrowingMode {
                number: participant.mode as u32,
                name: participant.motion.name_index() as u32,
                frequency_cpm: participant.frequency_cpm,
            })
        };
        Self {
            is_on_curve: response.is_on_curve,
            branch: response.branch,
            between_rpm: response.between_rpm,
            beyond: response.beyond,
            fastest: response.disturbance(),
            modes: [mode(0), mode(1)],
        }
    }
}

/// How far the motions go that some constant speeds end in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dwelt {
    /// The largest of all these motions; of one that left the model's range, before it did.
    pub deviations: Deviations,
    /// The speed (rpm) at which the tub turns farthest, by yaw or by pitch.
    pub speed_rpm: f64,
    /// What that motion is: position in [`washer_model::Ending::KIND_NAMES`].
    pub kind: usize,
}

impl Dwelt {
    /// The farthest of the motions found at these speeds (rpm), of which some may have none; the
    /// first of equals counts.
    pub fn of<E>(speeds_rpm: &[f64], found: &[Result<Endings, E>]) -> Option<Self> {
        let motions = speeds_rpm.iter().zip(found).flat_map(|(&speed_rpm, found)| {
            let motions = found.iter().flat_map(|found| &found.motions);
            motions.map(move |motion| (speed_rpm, motion))
        });
        let mut farthest = 0.0;
        motions.fold(None, |most: Option<Self>, (speed_rpm, motion)| {
            let this = Self { deviations: motion.peaks, speed_rpm, kind: motion.kind() };
            let mut most = most.unwrap_or(this);
            if this.turned_rad() > farthest {
                farthest = this.turned_rad();
                most = Self { deviations: most.deviations, ..this };
            }
            for (most, one) in most.deviations.iter_mut().zip(motion.peaks) {
                *most = most.max(one);
            }
            Some(most)
        })
    }

    /// How far the tub turns, by yaw or by pitch (rad).
    fn turned_rad(&self) -> f64 {
        let turned = |channel: Channel| self.deviations[channel.index()];
        turned(Channel::TubYaw).max(turned(Channel::TubPitch))
    }
}

/// Both models at one grid point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Index in grid order.
    pub point: u64,
    /// The nonlinear model.
    pub nonlinear: Trajectory,
    /// The linear model.
    pub linear: Trajectory,
    /// The method and level of the nonlinear model's numbers.
    pub method: Level,
    /// The relative error left in the row's numbers, at most, from the differences of its levels;
    /// `None` where nothing was compared.
    pub error: Option<f64>,
    /// Whether that is within the accuracy asked for. `None` where nothing was compared.
    pub converged: Option<bool>,
    /// Whether the motion is chaotic: plain RK4 does not agree with itself at two steps, and a near
    /// twin departs exponentially. `None` where nothing was compared.
    pub sensitive: Option<bool>,
    /// Ratios per channel of the plan where they are found turn by turn; `None` where undefined.
    /// Empty where the amplitudes' quotients are the ratios, or a model failed.
    pub turn_ratios: Vec<Option<f64>>,
    /// How far the machine sinks to its equilibrium, if the plan asks for it and there is one.
    pub static_sag_m: Option<f64>,
    /// What becomes of disturbances at a constant speed: the row's own, or the one of the plan's
    /// speeds at which they grow fastest. `None` where it is not asked for or not known.
    pub growth: Option<Growth>,
    /// How far motions at the plan's constant speeds go, if it asks for that.
    pub dwelt: Option<Dwelt>,
    /// Other responses at the same point and constant speed: rows of their own, behind this one.
    pub coexisting: Vec<Outcome>,
}

impl Outcome {
    /// Both models' trajectories, not yet assessed together.
    pub fn new(point: u64, nonlinear: Trajectory, linear: Trajectory) -> Self {
        Self { point, nonlinear, linear, ..Self::default() }
    }

    /// Nothing but a status, of both models.
    pub fn failed(point: u64, status: Status) -> Self {
        Self::new(point, Trajectory::failed(status), Trajectory::failed(status))
    }

    /// It, then the others at the same point and speed, apart.
    pub fn into_rows(mut self) -> impl Iterator<Item = Self> {
        let coexisting = core::mem::take(&mut self.coexisting);
        core::iter::once(self).chain(coexisting)
    }
}

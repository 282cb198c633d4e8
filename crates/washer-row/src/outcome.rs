//! The outcome of a grid point: one row of the result file.

use sweep_parameter::Verdict;
use washer_model::{
    Attractor, AttractorStatus, Attractors, Channel, Disturbance, GeometryLimit, Response,
    ResponseError,
};

use crate::MethodKind;

/// The reason why a trajectory ended. Its position in this list is its code in chunk files, so that
/// new reasons are added at the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Status {
    /// The trajectory reached the end of the run.
    #[default]
    Ok,
    /// A state left the range of the model, or became non-finite.
    Diverged,
    /// The adaptive step fell below the resolution of time in double precision.
    StepTooSmall,
    /// The adaptive method reached its greatest number of steps.
    StepLimit,
    /// The machine has no static equilibrium at this point.
    NoEquilibrium,
    /// The evaluation of this point panicked, which is a defect of this program. Other rows are not
    /// affected.
    Panicked,
    /// No periodic response was found at a held speed.
    NoResponse,
    /// The multipliers of the response could not be computed.
    NoMultipliers,
    /// The drum turns so slowly that a turn takes too many steps.
    TooSlow,
}

impl From<ResponseError> for Status {
    fn from(error: ResponseError) -> Self {
        match error {
            ResponseError::NoResponse | ResponseError::Stopped => Self::NoResponse,
            ResponseError::NoEigenvalues => Self::NoMultipliers,
            ResponseError::TooSlow => Self::TooSlow,
        }
    }
}

/// The values of the result file's `status` column, in the order of its dictionary.
///
/// If the nonlinear model failed, the row has that model's status, even if the linear model failed
/// too. If only the linear model failed, the row has its status with the prefix `linear_`.
pub const ROW_STATUSES: [&str; 14] = [
    "ok",
    "diverged",
    "step_too_small",
    "step_limit",
    "no_equilibrium",
    "panicked",
    "linear_diverged",
    "linear_step_too_small",
    "linear_step_limit",
    "linear_no_equilibrium",
    "linear_panicked",
    "no_response",
    "no_multipliers",
    "too_slow",
];

/// The number of statuses that a single model can have. Each except `ok` has a second name with the
/// prefix `linear_`.
const MODEL_STATUSES: usize = Status::Panicked as usize + 1;

/// Returns the index in [`ROW_STATUSES`] of the row of two trajectories, and the failing model's
/// time of failure.
fn row_status(nonlinear: &Trajectory, linear: &Trajectory) -> (usize, Option<f64>) {
    // The statuses that apply only to a whole row follow those with the prefix.
    let to_row_status = |status: Status, linear_offset: usize| match status as usize {
        code if code < MODEL_STATUSES => code + linear_offset,
        code => code + MODEL_STATUSES - 1,
    };
    if nonlinear.status != Status::Ok {
        (to_row_status(nonlinear.status, 0), nonlinear.fail_time_s)
    } else if linear.status != Status::Ok {
        (to_row_status(linear.status, MODEL_STATUSES - 1), linear.fail_time_s)
    } else {
        (0, None)
    }
}

/// The trajectory of one model at one grid point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    /// The reason why the trajectory ended.
    pub status: Status,
    /// The time of a failure during the integration.
    pub fail_time_s: Option<f64>,
    /// The amplitude within the window by the plan's criterion, per channel of the plan; empty if
    /// the model failed.
    pub amplitudes: Vec<f64>,
    /// The least gap between drum and tub over the whole run; `None` if the model failed.
    pub min_gap_m: Option<f64>,
    pub steps: u64,
    pub rejected: u64,
    /// The model's metrics that the plan asks for, in column order; empty if the model failed.
    pub metrics: Vec<f64>,
    /// The greatest ratio, in either direction, between a damper's speed amplitude in this motion
    /// and the one at which the linear model takes its friction. `None` without friction, if the
    /// model failed, and for the nonlinear model if no speed amplitude is given.
    pub friction_speed_off: Option<f64>,
    /// The largest deviations in each turn of the drum, by which both models are compared; empty
    /// without the envelope criterion.
    pub turns: Vec<Deviations>,
}

/// The deviation of every channel (m, rad), in the order of `Channel::ALL`.
pub type Deviations = [f64; Channel::ALL.len()];

impl Trajectory {
    /// Creates a failed trajectory, which has only a status.
    pub fn failed(status: Status) -> Self {
        Self { status, ..Self::default() }
    }
}

/// A periodic response at a held speed, and the growth of small disturbances about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// Whether the response is on the curve of responses that begins at a low speed.
    pub is_on_curve: bool,
    /// The number of folds of the curve before the response.
    pub branch: u32,
    /// The speeds (rpm) of the lower and of the upper fold at the ends of the branch.
    pub fold_speeds_rpm: [Option<f64>; 2],
    /// The limit of the machine's geometry that the response exceeds, if it does.
    pub exceeded_limit: Option<GeometryLimit>,
    /// The disturbance that grows fastest.
    pub fastest: Disturbance,
    /// The modes of the linear model that take part in that disturbance, the greatest share first.
    pub modes: [Option<GrowingMode>; 2],
}

/// A mode of the linear model that takes part in a growing disturbance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GrowingMode {
    /// The number of the mode, 1 for the slowest.
    pub number: u32,
    /// The position of the mode's name in `ModeMotion::NAMES`.
    pub name: u32,
    /// The damped natural frequency (cycles per minute).
    pub frequency_cpm: f64,
}

impl From<&Response> for Growth {
    fn from(response: &Response) -> Self {
        let mode = |rank: usize| {
            let participating_mode = response.participating_modes.get(rank)?;
            Some(GrowingMode {
                number: participating_mode.mode as u32,
                name: participating_mode.motion.name_index() as u32,
                frequency_cpm: participating_mode.frequency_cpm,
            })
        };
        Self {
            is_on_curve: response.is_on_curve,
            branch: response.branch,
            fold_speeds_rpm: response.fold_speeds_rpm,
            exceeded_limit: response.exceeded_limit,
            fastest: response.disturbance(),
            modes: [mode(0), mode(1)],
        }
    }
}

/// The largest deviations of the attractors at some held speeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DwellPeaks {
    /// The largest deviations over all attractors. A motion that leaves the range of the model is
    /// included up to that time.
    pub deviations: Deviations,
    /// The speed (rpm) at which the tub has the greatest yaw or pitch.
    pub speed_rpm: f64,
    /// The kind of the attractor with the greatest yaw or pitch: the position in
    /// [`washer_model::Attractor::KIND_NAMES`].
    pub kind: usize,
}

impl DwellPeaks {
    /// Computes the largest deviations of the attractors found at speeds (rpm); `None` if there are
    /// no attractors. Among attractors with equal rotation, the first one determines speed and
    /// kind. Transients are left out, because they end in other motions, which are among the
    /// attractors.
    pub fn from_attractors<E>(
        speeds_rpm: &[f64],
        results: &[Result<Attractors, E>],
    ) -> Option<Self> {
        let is_transient =
            |motion: &Attractor| matches!(motion.status, AttractorStatus::Transient { .. });
        let attractors = speeds_rpm.iter().zip(results).flat_map(|(&speed_rpm, result)| {
            let attractors = result.iter().flat_map(|found| &found.attractors);
            attractors
                .filter(move |motion| !is_transient(motion))
                .map(move |motion| (speed_rpm, motion))
        });
        let mut greatest_rotation_rad = 0.0;
        attractors.fold(None, |peaks: Option<Self>, (speed_rpm, motion)| {
            let candidate = Self { deviations: motion.peaks, speed_rpm, kind: motion.kind_index() };
            let mut peaks = peaks.unwrap_or(candidate);
            if candidate.tub_rotation_rad() > greatest_rotation_rad {
                greatest_rotation_rad = candidate.tub_rotation_rad();
                peaks = Self { deviations: peaks.deviations, ..candidate };
            }
            for (peak, deviation) in peaks.deviations.iter_mut().zip(motion.peaks) {
                *peak = peak.max(deviation);
            }
            Some(peaks)
        })
    }

    /// Returns the greater deviation of yaw and pitch (rad).
    fn tub_rotation_rad(&self) -> f64 {
        let deviation = |channel: Channel| self.deviations[channel.index()];
        deviation(Channel::TubYaw).max(deviation(Channel::TubPitch))
    }
}

/// The result of both models at one grid point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// The index in grid order.
    pub point: u64,
    pub nonlinear: Trajectory,
    pub linear: Trajectory,
    /// The position of the row's status in [`ROW_STATUSES`].
    pub status: usize,
    /// The time at which the model named by the status failed.
    pub fail_time_s: Option<f64>,
    /// The kind of the method of the nonlinear trajectory.
    pub method: MethodKind,
    /// The estimate of the row's relative error by the differences of its levels; `None` if no
    /// levels were compared.
    pub error: Option<f64>,
    /// Whether the error is within the accuracy. `None` if no levels were compared.
    pub converged: Option<bool>,
    /// Whether the motion is chaotic: its levels do not agree, and a perturbed run separates
    /// exponentially. `None` if no levels were compared.
    pub sensitive: Option<bool>,
    /// The comparison of the two trajectories, once it is made.
    pub verdict: Verdict,
    /// The ratios of the envelope criterion, per channel of the plan; `None` where undefined. Empty
    /// if the ratios are quotients of amplitudes, or if a model failed.
    pub turn_ratios: Vec<Option<f64>>,
    /// The sag of the machine, if the plan asks for it and there is an equilibrium.
    pub static_sag_m: Option<f64>,
    /// The growth of disturbances at the row's held speed, or the greatest growth over the plan's
    /// held speeds. `None` if the plan does not ask for it or it is unknown.
    pub growth: Option<Growth>,
    /// The largest deviations at the plan's held speeds, if the plan asks for them.
    pub dwell_peaks: Option<DwellPeaks>,
    /// The outcomes of other responses at the same point and speed, which are rows after this one.
    pub coexisting: Vec<Outcome>,
}

impl Outcome {
    /// Creates an outcome of two trajectories.
    pub fn new(point: u64, nonlinear: Trajectory, linear: Trajectory) -> Self {
        let (status, fail_time_s) = row_status(&nonlinear, &linear);
        Self { point, nonlinear, linear, status, fail_time_s, ..Self::default() }
    }

    /// Creates an outcome in which both models failed.
    pub fn failed(point: u64, status: Status) -> Self {
        Self::new(point, Trajectory::failed(status), Trajectory::failed(status))
    }
}

#[cfg(test)]
mod tests {
    use washer_model::{MotionKind, Reading};

    use super::*;

    fn attractor(status: AttractorStatus, yaw_rad: f64) -> Attractor {
        let motion_kind = match status {
            AttractorStatus::Ok => Some(MotionKind::Periodic { turns: 1 }),
            _ => None,
        };
        let mut peaks = [0.0; Channel::ALL.len()];
        peaks[Channel::TubYaw.index()] = yaw_rad;
        Attractor {
            status,
            motion_kind,
            starts: 1,
            least_kick_rad_per_s: None,
            peaks,
            min_gap_m: 0.01,
            exponent: None,
            time_s: 60.0,
            end_state: [0.0; washer_model::STATE_LEN],
            sections: Vec::new(),
            extra_reading: Reading::default(),
        }
    }

    #[test]
    fn dwell_peaks_are_those_of_motions_that_last() {
        let attractors = vec![
            attractor(AttractorStatus::Ok, 0.02),
            attractor(AttractorStatus::Transient { life_s: 9.0 }, 0.06),
            attractor(AttractorStatus::Ok, 0.03),
        ];
        let found =
            Attractors { responses: Vec::new(), attractors, starts: 3, threshold_rad_per_s: None };
        let peaks = DwellPeaks::from_attractors(&[250.0], &[Ok::<_, ()>(found)]).unwrap();
        assert_eq!(peaks.deviations[Channel::TubYaw.index()], 0.03);
        assert_eq!(Attractor::KIND_NAMES[peaks.kind], "periodic");
    }
}

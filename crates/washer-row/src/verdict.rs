//! From two trajectories to a verdict: the ratios, the greatest of them, reliable or not, and the
//! row's status.

use sweep_parameter::RatioLimits;

use crate::outcome::{Outcome, Status};

/// Every value of the result file's `status` column, in the order of its dictionary.
///
/// A row whose nonlinear model failed carries that model's reason, whatever became of the linear
/// one; a row whose linear model alone failed carries that reason behind `linear_`.
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

/// Statuses that either model can have, each of which has a name behind `linear_` too.
const OF_EITHER: usize = Status::Panicked as usize + 1;

/// The row's entry in [`ROW_STATUSES`], and the failing model's time of failure.
pub fn row_status(outcome: &Outcome) -> (usize, Option<f64>) {
    // Those of both models together stand behind those of either.
    let code = |status: Status, of_linear: usize| match status as usize {
        code if code < OF_EITHER => code + of_linear,
        code => code + OF_EITHER - 1,
    };
    if outcome.nonlinear.status != Status::Ok {
        (code(outcome.nonlinear.status, 0), outcome.nonlinear.fail_time_s)
    } else if outcome.linear.status != Status::Ok {
        (code(outcome.linear.status, OF_EITHER - 1), outcome.linear.fail_time_s)
    } else {
        (0, None)
    }
}

/// How the two models compare at one grid point.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Nonlinear over linear amplitude per channel of the plan, or the greatest such ratio over the
    /// drum's turns; `None` where the linear amplitude is zero or a model failed.
    pub ratios: Vec<Option<f64>>,
    /// The greatest defined ratio and its channel's position in the plan; the first channel wins a
    /// tie.
    pub greatest: Option<(usize, f64)>,
    /// The same of the least.
    pub least: Option<(usize, f64)>,
    /// Whether the ratios are between the limits; `None` where no ratio is defined.
    pub reliable: Option<bool>,
}

impl Verdict {
    /// Compares the amplitudes of an outcome over `channels` channels.
    pub fn new(outcome: &Outcome, channels: usize, limits: impl Into<RatioLimits>) -> Self {
        let limits = limits.into();
        let (nonlinear, linear) = (&outcome.nonlinear.amplitudes, &outcome.linear.amplitudes);
        let by_turns = &outcome.turn_ratios;
        let ratios: Vec<Option<f64>> = (0..channels)
            .map(|i| match (nonlinear.get(i), linear.get(i)) {
                (Some(nonlinear), Some(linear)) if *linear != 0.0 => Some(nonlinear / linear),
                _ => None,
            })
            .enumerate()
            .map(|(i, of_amplitudes)| by_turns.get(i).copied().unwrap_or(of_amplitudes))
            .collect();
        let extreme = |is_further: fn(f64, f64) -> bool| {
            let defined = ratios.iter().enumerate().filter_map(|(i, ratio)| Some((i, (*ratio)?)));
            defined.reduce(|most, next| if is_further(next.1, most.1) { next } else { most })
        };
        let [greatest, least] = [extreme(|a, b| a > b), extreme(|a, b| a < b)];
        let reliable = least.zip(greatest).map(|((_, least), (_, most))| limits.trust(least, most));
        Self { ratios, greatest, least, reliable }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::Trajectory;

    fn trajectory(status: Status, amplitudes: &[f64], fail_time_s: Option<f64>) -> Trajectory {
        Trajectory { fail_time_s, amplitudes: amplitudes.to_vec(), ..Trajectory::failed(status) }
    }

    fn outcome(nonlinear: Trajectory, linear: Trajectory) -> Outcome {
        Outcome::new(0, nonlinear, linear)
    }

    #[test]
    fn greatest_ratio_decides_and_the_first_channel_wins_a_tie() {
        let row = outcome(
            trajectory(Status::Ok, &[2.0, 3.0, 6.0], None),
            trajectory(Status::Ok, &[2.0, 1.0, 2.0], None),
        );
        let verdict = Verdict::new(&row, 3, 3.0);
        assert_eq!(verdict.ratios, [Some(1.0), Some(3.0), Some(3.0)]);
        assert_eq!(verdict.greatest, Some((1, 3.0)));
        assert_eq!(verdict.reliable, Some(false), "reliable means below the limit, not at it");
        assert_eq!(Verdict::new(&row, 3, 3.5).reliable, Some(true));
    }

    #[test]
    fn a_lower_limit_refuses_what_the_linear_model_over_estimates() {
        let row = outcome(
            trajectory(Status::Ok, &[1.5, 0.3, 0.3], None),
            trajectory(Status::Ok, &[1.0, 2.0, 2.0], None),
        );
        let reliable =
            |least| Verdict::new(&row, 3, RatioLimits { most: 2.0, least }).reliable.unwrap();
        assert_eq!(Verdict::new(&row, 3, 2.0).least, Some((1, 0.15)));
        assert!(reliable(None) && reliable(Some(0.1)));
        assert!(!reliable(Some(0.15)) && !reliable(Some(0.5)), "at the limit is not above it");
    }

    #[test]
    fn ratios_by_turns_stand_in_the_place_of_the_amplitudes() {
        let mut row = outcome(
            trajectory(Status::Ok, &[2.0, 3.0], None),
            trajectory(Status::Ok, &[2.0, 1.0], None),
        );
        row.turn_ratios = vec![Some(4.0), None];
        let verdict = Verdict::new(&row, 2, 3.5);
        assert_eq!((verdict.ratios, verdict.greatest), (vec![Some(4.0), None], Some((0, 4.0))));
        assert_eq!(verdict.reliable, Some(false));
    }

    #[test]
    fn zero_linear_amplitude_leaves_that_ratio_undefined() {
        let row = outcome(
            trajectory(Status::Ok, &[1.0, 1.0], None),
            trajectory(Status::Ok, &[0.0, 1.0], None),
        );
        assert_eq!(Verdict::new(&row, 2, 2.0).ratios, [None, Some(1.0)]);
        assert_eq!(Verdict::new(&row, 2, 2.0).reliable, Some(true));
        let still = outcome(
            trajectory(Status::Ok, &[0.0, 0.0], None),
            trajectory(Status::Ok, &[0.0, 0.0], None),
        );
        assert_eq!(
            Verdict::new(&still, 2, 2.0),
            Verdict { ratios: vec![None, None], greatest: None, least: None, reliable: None }
        );
    }

    #[test]
    fn a_failed_model_leaves_everything_undefined_and_names_itself() {
        let row = outcome(
            trajectory(Status::Diverged, &[], Some(3.5)),
            trajectory(Status::Ok, &[1.0, 1.0], None),
        );
        assert_eq!(Verdict::new(&row, 2, 2.0).reliable, None);
        assert_eq!(row_status(&row), (1, Some(3.5)));
        let row = outcome(
            trajectory(Status::Ok, &[1.0], None),
            trajectory(Status::StepLimit, &[], Some(2.0)),
        );
        let (status, time) = row_status(&row);
        assert_eq!((ROW_STATUSES[status], time), ("linear_step_limit", Some(2.0)));
    }

    #[test]
    fn both_failed_reports_the_nonlinear_reason_and_time() {
        let row = outcome(
            trajectory(Status::Panicked, &[], None),
            trajectory(Status::Diverged, &[], Some(1.0)),
        );
        let (status, time) = row_status(&row);
        assert_eq!((ROW_STATUSES[status], time), ("panicked", None));
    }
}

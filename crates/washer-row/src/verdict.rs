//! The verdict of a row: the ratios of its two trajectories, the greatest of them, and whether the
//! linear model is reliable.

use sweep_parameter::{RatioLimits, Verdict};

use crate::outcome::Outcome;

/// Compares the amplitudes of an outcome over `channels` channels: their ratios, or the greatest
/// ratios over the drum's turns. A ratio is not defined if the linear amplitude is zero or a model
/// failed.
pub(crate) fn verdict(
    outcome: &Outcome,
    channels: usize,
    limits: impl Into<RatioLimits>,
) -> Verdict {
    let nonlinear = &outcome.nonlinear.amplitudes;
    let linear = &outcome.linear.amplitudes;
    let ratio = |i: usize| {
        if let Some(turn_ratio) = outcome.turn_ratios.get(i) {
            return *turn_ratio;
        }
        match (nonlinear.get(i), linear.get(i)) {
            (Some(nonlinear), Some(linear)) if *linear != 0.0 => Some(nonlinear / linear),
            _ => None,
        }
    };
    Verdict::new((0..channels).map(ratio).collect(), limits.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::{ROW_STATUSES, Status, Trajectory};

    fn trajectory(status: Status, amplitudes: &[f64], fail_time_s: Option<f64>) -> Trajectory {
        Trajectory { fail_time_s, amplitudes: amplitudes.to_vec(), ..Trajectory::failed(status) }
    }

    fn outcome(nonlinear: Trajectory, linear: Trajectory) -> Outcome {
        Outcome::new(0, nonlinear, linear)
    }

    #[test]
    fn the_first_of_equal_ratios_is_the_greatest() {
        let row = outcome(
            trajectory(Status::Ok, &[2.0, 3.0, 6.0], None),
            trajectory(Status::Ok, &[2.0, 1.0, 2.0], None),
        );
        let found = verdict(&row, 3, 3.0);
        assert_eq!(found.ratios, [Some(1.0), Some(3.0), Some(3.0)]);
        assert_eq!(found.greatest, Some((1, 3.0)));
        assert_eq!(found.reliable, Some(false), "reliable means below the limit, not at it");
        assert_eq!(verdict(&row, 3, 3.5).reliable, Some(true));
    }

    #[test]
    fn a_ratio_below_the_lower_limit_is_not_reliable() {
        let row = outcome(
            trajectory(Status::Ok, &[1.5, 0.3, 0.3], None),
            trajectory(Status::Ok, &[1.0, 2.0, 2.0], None),
        );
        let reliable =
            |lower| verdict(&row, 3, RatioLimits { upper: 2.0, lower }).reliable.unwrap();
        assert_eq!(verdict(&row, 3, 2.0).least, Some((1, 0.15)));
        assert!(reliable(None) && reliable(Some(0.1)));
        assert!(!reliable(Some(0.15)) && !reliable(Some(0.5)), "at the limit is not above it");
    }

    #[test]
    fn ratios_by_turns_replace_those_of_amplitudes() {
        let mut row = outcome(
            trajectory(Status::Ok, &[2.0, 3.0], None),
            trajectory(Status::Ok, &[2.0, 1.0], None),
        );
        row.turn_ratios = vec![Some(4.0), None];
        let found = verdict(&row, 2, 3.5);
        assert_eq!((found.ratios, found.greatest), (vec![Some(4.0), None], Some((0, 4.0))));
        assert_eq!(found.reliable, Some(false));
    }

    #[test]
    fn the_ratio_to_a_zero_linear_amplitude_is_undefined() {
        let row = outcome(
            trajectory(Status::Ok, &[1.0, 1.0], None),
            trajectory(Status::Ok, &[0.0, 1.0], None),
        );
        assert_eq!(verdict(&row, 2, 2.0).ratios, [None, Some(1.0)]);
        assert_eq!(verdict(&row, 2, 2.0).reliable, Some(true));
        let at_rest = outcome(
            trajectory(Status::Ok, &[0.0, 0.0], None),
            trajectory(Status::Ok, &[0.0, 0.0], None),
        );
        assert_eq!(
            verdict(&at_rest, 2, 2.0),
            Verdict { ratios: vec![None, None], ..Verdict::default() }
        );
    }

    #[test]
    fn a_failed_model_gives_the_status_and_no_verdict() {
        let row = outcome(
            trajectory(Status::Diverged, &[], Some(3.5)),
            trajectory(Status::Ok, &[1.0, 1.0], None),
        );
        assert_eq!(verdict(&row, 2, 2.0).reliable, None);
        assert_eq!((row.status, row.fail_time_s), (1, Some(3.5)));
        let row = outcome(
            trajectory(Status::Ok, &[1.0], None),
            trajectory(Status::StepLimit, &[], Some(2.0)),
        );
        assert_eq!((ROW_STATUSES[row.status], row.fail_time_s), ("linear_step_limit", Some(2.0)));
    }

    #[test]
    fn the_nonlinear_model_gives_the_status_if_both_failed() {
        let row = outcome(
            trajectory(Status::Panicked, &[], None),
            trajectory(Status::Diverged, &[], Some(1.0)),
        );
        assert_eq!((ROW_STATUSES[row.status], row.fail_time_s), ("panicked", None));
    }
}

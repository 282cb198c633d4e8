//! The share of tongues in the deviation of the nonlinear model from the linear one.
//!
//! In a tongue a disturbance grows by the exponential of its e-folds, the integral of the growth
//! over the time that the run spends there. From these follows, at every instant, how much tongues
//! have added to the difference of the two models, and the motion without it. Tongues are the cause
//! of a verdict if the motion without them keeps the limit.

use washer_model::{History, InitialDeviation, Method, ModelKind, Point, Spin, integrate_history};

use super::profile::growth_at;
use super::{MapResult, Passage};

/// The time between instants at which the two models are compared (s). Basis: the fastest motion of
/// the suspension has a period of some 0.2 s. Doubling it misses up to a twentieth of a deviation.
const INSTANT_STEP_S: f64 = 0.005;

/// The deviation that decides the verdict, and the part of the tongues before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cause {
    /// The time (s) at which the nonlinear model first exceeds the limit within the window, or, if
    /// it never does, that of its greatest deviation.
    pub(crate) time_s: f64,
    /// The drum's speed at this time (rpm), negative backwards.
    pub(crate) speed_rpm: f64,
    /// The growth (e-folds) in tongues until the greatest deviation.
    pub(crate) e_folds: f64,
    /// The greatest ratio of the motion without the part that tongues add.
    pub(crate) ratio_without: f64,
    /// Whether `ratio_without` keeps the limit, so that the tongues are a sufficient cause.
    pub(crate) is_sufficient: bool,
}

/// The growth of a disturbance in a passage through a tongue, at the instants of a run.
struct PassageGrowth {
    /// The instants, up to that of the entry, whose greatest difference is the disturbance at the
    /// entry.
    entry_instants: std::ops::RangeInclusive<usize>,
    /// The growth (e-folds) until each instant.
    e_folds: Vec<f64>,
}

/// Finds the cause of the deviation in the channel with the greatest ratio; `None` without a ratio.
/// `has_passed` tells whether the run keeps the limit when it enters each tongue on its periodic
/// response: then the deviation has passed through the tongues.
pub(super) fn find_cause<'p>(
    (point, spin): (&Point, &Spin),
    step_s: f64,
    map_result: &MapResult,
    has_passed: bool,
    passages: impl Iterator<Item = (&'p Passage, &'p [[f64; 2]])>,
) -> Option<Cause> {
    let (channel_position, _) = map_result.verdict.greatest?;
    let channel = map_result.channels[channel_position].index();
    let record_history = |model| {
        integrate_history(
            model,
            &Method::rk4(step_s),
            point,
            &InitialDeviation::default(),
            INSTANT_STEP_S,
        )
    };
    let [nonlinear, linear] = [ModelKind::Nonlinear, ModelKind::Linear].map(record_history);
    let channel_value =
        |history: &History<'_>, k: usize| Some(history.instant_outputs(k)?.channels[channel]);
    let instant_count = nonlinear.len().min(linear.len());
    let deviations: Option<Vec<[f64; 2]>> = (0..instant_count)
        .map(|k| Some([channel_value(&nonlinear, k)?, channel_value(&linear, k)?]))
        .collect();
    let deviations = deviations?;
    let amplitude = *map_result.amplitudes[1].get(channel_position)?;
    let index_of = |time_s: f64| (time_s / INSTANT_STEP_S) as usize;
    let window_instants =
        index_of(map_result.window_s[0])..(index_of(map_result.window_s[1]) + 1).min(instant_count);
    let times_s = (0..instant_count).map(|k| k as f64 * INSTANT_STEP_S);
    let speeds_rpm: Vec<f64> = spin.speeds_rpm(times_s).collect();
    let passage_growths: Vec<PassageGrowth> = passages
        .map(|(passage, growths)| find_passage_growth(passage, growths, &speeds_rpm))
        .collect();
    let limit = map_result.limits.upper;
    let remainder = remove_growth(
        &deviations,
        &passage_growths,
        window_instants,
        (amplitude, limit),
        has_passed,
    )?;
    Some(Cause {
        time_s: remainder.first_instant as f64 * INSTANT_STEP_S,
        speed_rpm: speeds_rpm[remainder.first_instant],
        e_folds: remainder.e_folds,
        ratio_without: remainder.ratio_without,
        is_sufficient: remainder.ratio_without < limit,
    })
}

/// Returns the growth of a passage at instants with these speeds (rpm).
///
/// The disturbance at the entry is the greatest difference of the models in the turn before it, or
/// in the first turn of a run that begins in the tongue.
fn find_passage_growth(
    passage: &Passage,
    growths: &[[f64; 2]],
    speeds_rpm: &[f64],
) -> PassageGrowth {
    let [from_s, to_s] = passage.interval_s;
    let last_index = speeds_rpm.len().saturating_sub(1);
    let entry_index = ((from_s / INSTANT_STEP_S) as usize).min(last_index);
    let turn_s = 60.0 / speeds_rpm.get(entry_index).map_or(1.0, |rpm| rpm.abs().max(1.0));
    let instants_per_turn = (turn_s / INSTANT_STEP_S).ceil() as usize;
    let entry_instants = match entry_index.checked_sub(instants_per_turn) {
        Some(before) => before..=entry_index,
        None => 0..=instants_per_turn.min(last_index),
    };
    let mut e_fold_sum = 0.0;
    let e_folds = speeds_rpm.iter().enumerate().map(|(k, rpm)| {
        // The part of the interval about the instant that is in the passage.
        let start_s = ((k as f64 - 0.5) * INSTANT_STEP_S).max(from_s);
        let end_s = ((k as f64 + 0.5) * INSTANT_STEP_S).min(to_s);
        if end_s > start_s {
            e_fold_sum += (end_s - start_s) * growth_at(growths, rpm.abs());
        }
        e_fold_sum
    });
    let e_folds = e_folds.collect();
    PassageGrowth { entry_instants, e_folds }
}

/// The motion without the part that tongues add.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Remainder {
    /// The first instant at which the deviation exceeds the limit, or that of the greatest
    /// deviation.
    first_instant: usize,
    /// The growth in tongues (e-folds) until the instant of the greatest deviation.
    e_folds: f64,
    /// The greatest ratio of this motion.
    ratio_without: f64,
}

/// Removes the part that tongues add to the motion within a window of instants; `None` for an empty
/// window. `values` has the deviations of the nonlinear and of the linear model at each instant.
/// The amplitude is that of the linear model.
///
/// Suppose that the run entered tongues with the differences D1, D2, ..., and that until an instant
/// they have multiplied disturbances by G1, G2, ... A difference that has passed through all of
/// them would be smaller by G1 G2 ... without them: they have added the share 1 - 1 / (G1 G2 ...)
/// of it. To a difference that may have arisen outside of them they have added at most this share,
/// and at most D1 (G1 - 1) + D2 (G2 - 1) + ...
fn remove_growth(
    values: &[[f64; 2]],
    passage_growths: &[PassageGrowth],
    window: std::ops::Range<usize>,
    (amplitude, limit): (f64, f64),
    has_passed: bool,
) -> Option<Remainder> {
    let difference_at = |k: usize| values.get(k).map_or(0.0, |[a, b]| (a - b).abs());
    let entered_tongues: Vec<(f64, &[f64])> = passage_growths
        .iter()
        .map(|growth| {
            let disturbance = growth.entry_instants.clone().map(difference_at).fold(0.0, f64::max);
            (disturbance, growth.e_folds.as_slice())
        })
        .collect();
    let e_folds_until = |k: usize| -> f64 {
        entered_tongues.iter().map(|(_, e_folds_until)| e_folds_until[k]).sum()
    };
    let deviation_without = |k: usize| -> f64 {
        let [nonlinear, linear] = values[k];
        let difference = difference_at(k);
        if difference == 0.0 {
            return nonlinear.abs();
        }
        let mut added_share = -(-e_folds_until(k)).exp_m1();
        if !has_passed {
            let added_by_tongue = |(disturbance, e_folds_until): &(f64, &[f64])| {
                disturbance * e_folds_until[k].exp_m1()
            };
            let added_by_tongue: f64 = entered_tongues.iter().map(added_by_tongue).sum();
            added_share = added_share.min(added_by_tongue / difference);
        }
        (linear + (nonlinear - linear) * (1.0 - added_share)).abs()
    };
    let deviation_at = |k: &usize| values[*k][0].abs();
    let greatest_instant =
        window.clone().max_by(|a, b| deviation_at(a).total_cmp(&deviation_at(b)))?;
    let first_beyond_limit =
        window.clone().find(|k| deviation_at(k) > limit * amplitude).unwrap_or(greatest_instant);
    let amplitude_without = window.map(deviation_without).fold(0.0, f64::max);
    let ratio_without = amplitude_without / amplitude;
    Some(Remainder {
        first_instant: first_beyond_limit,
        e_folds: e_folds_until(greatest_instant),
        ratio_without,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns deviations of both models by instant: an oscillation of the linear model, and a
    /// difference of the given size.
    fn oscillation_with(difference: impl Fn(usize) -> f64) -> Vec<[f64; 2]> {
        let linear_value = |k: usize| (0.9 * k as f64).sin();
        (0..1000)
            .map(|k| [linear_value(k) + difference(k) * (0.37 * k as f64).cos(), linear_value(k)])
            .collect()
    }

    /// Returns a tongue between two instants, in which a disturbance grows by so many e-folds.
    fn passage_growth_between(from: usize, to: usize, e_folds: f64) -> PassageGrowth {
        let passed_share = |k: usize| (k.clamp(from, to) - from) as f64 / (to - from) as f64;
        PassageGrowth {
            entry_instants: from - 40..=from,
            e_folds: (0..1000).map(|k| e_folds * passed_share(k)).collect(),
        }
    }

    /// Returns a difference of this size that grows by so many e-folds between two instants.
    fn growing_difference(
        size: f64,
        from: usize,
        to: usize,
        e_folds: f64,
    ) -> impl Fn(usize) -> f64 {
        move |k| size * (e_folds * (k.clamp(from, to) - from) as f64 / (to - from) as f64).exp()
    }

    fn compute_ratio_without(values: &[[f64; 2]], passage_growths: &[PassageGrowth]) -> f64 {
        remove_growth(values, passage_growths, 500..1000, (1.0, 2.0), false).unwrap().ratio_without
    }

    #[test]
    fn growth_in_a_tongue_is_removed() {
        let values = oscillation_with(growing_difference(0.2, 300, 600, 3.0));
        let tongues = [passage_growth_between(300, 600, 3.0)];
        let remainder = remove_growth(&values, &tongues, 500..1000, (1.0, 2.0), false).unwrap();
        assert!(
            remainder.first_instant < 600 && (remainder.e_folds - 3.0).abs() < 1e-9,
            "{remainder:?}"
        );
        assert!((1.0..1.3).contains(&remainder.ratio_without), "{remainder:?}");
    }

    /// The tongue has enough growth, but the run enters it after its deviation.
    #[test]
    fn a_tongue_after_the_deviation_is_no_cause() {
        let values = oscillation_with(growing_difference(0.2, 300, 600, 3.0));
        let ratio = compute_ratio_without(&values, &[passage_growth_between(700, 900, 3.0)]);
        assert!(ratio > 3.0, "{ratio}");
    }

    /// The difference grows by 3 e-folds, of which only 0.07 are in the tongue.
    #[test]
    fn a_tongue_with_little_growth_is_no_cause() {
        let values = oscillation_with(growing_difference(0.2, 300, 600, 3.0));
        let ratio = compute_ratio_without(&values, &[passage_growth_between(300, 400, 0.07)]);
        assert!(ratio > 3.0, "{ratio}");
    }

    /// A deviation that decays after the tongue is still due to the tongue.
    #[test]
    fn a_deviation_that_decays_after_a_tongue_is_due_to_it() {
        let difference = growing_difference(0.5, 200, 400, 3.0);
        let values =
            oscillation_with(|k| difference(k) * (-0.005 * (k.max(400) - 400) as f64).exp());
        let ratio = compute_ratio_without(&values, &[passage_growth_between(200, 400, 3.0)]);
        assert!((1.0..1.6).contains(&ratio), "{ratio}");
    }

    /// A tongue that is passed with a small difference does not cause a later deviation.
    #[test]
    fn a_deviation_that_arises_after_a_tongue_is_not_due_to_it() {
        let values = oscillation_with(|k| if k < 600 { 0.01 } else { 4.0 });
        let ratio = compute_ratio_without(&values, &[passage_growth_between(200, 400, 3.0)]);
        assert!(ratio > 4.0, "{ratio}");
    }

    /// A deviation that has passed through a tongue may grow further after it.
    #[test]
    fn a_deviation_that_passed_through_a_tongue_is_smaller_without_it() {
        let values = oscillation_with(growing_difference(0.1, 300, 700, 3.7));
        let tongues = [passage_growth_between(300, 500, 1.85)];
        let ratio_with = |has_passed: bool| {
            remove_growth(&values, &tongues, 500..1000, (1.0, 2.0), has_passed)
                .unwrap()
                .ratio_without
        };
        assert!((1.0..1.8).contains(&ratio_with(true)), "{}", ratio_with(true));
        assert!(ratio_with(false) > 4.0, "{}", ratio_with(false));
    }

    #[test]
    fn growths_of_successive_tongues_multiply() {
        let first_growth = growing_difference(0.1, 100, 300, 1.7);
        let second_growth = growing_difference(1.0, 400, 600, 1.7);
        let values = oscillation_with(|k| first_growth(k) * second_growth(k));
        let tongues =
            [passage_growth_between(100, 300, 1.7), passage_growth_between(400, 600, 1.7)];
        assert!(compute_ratio_without(&values, &tongues[..1]) > 2.0);
        let ratio = compute_ratio_without(&values, &tongues);
        assert!((1.0..1.2).contains(&ratio), "{ratio}");
    }
}

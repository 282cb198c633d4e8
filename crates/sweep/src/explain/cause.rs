//! Whether tongues come early enough, and grow enough, to make a run deviate.
//!
//! In a tongue a disturbance grows by the exponential of its e-folds, the integral of the growth
//! over the time that the run spends there. So what tongues add to the difference of the two models
//! is known at every instant, and so is the motion without it. Tongues are the cause of a verdict
//! where the motion without them keeps the limit.

use washer_model::{History, Method, ModelKind, Point, Spin, Start, history};

use super::profile::growth_at;
use super::{Passage, Swept};

/// The time between instants at which the two models are compared (s). Basis: the fastest motion of
/// the suspension takes some 0.2 s. Doubling it misses up to a twentieth of a deviation.
const INTERVAL_S: f64 = 0.005;

/// The deviation that decides the verdict, and what the tongues before it do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cause {
    /// The time (s) at which the nonlinear model first exceeds the limit within the window, or is
    /// farthest, if it does not.
    pub(crate) time_s: f64,
    /// The drum's speed then (rpm), below 0 backwards.
    pub(crate) speed_rpm: f64,
    /// The growth (e-folds) that the tongues make until the greatest deviation.
    pub(crate) e_folds: f64,
    /// The greatest ratio of the motion without what tongues add to it.
    pub(crate) ratio_without: f64,
    /// Whether that keeps the limit.
    pub(crate) is_enough: bool,
}

/// A passage through a tongue, as the instants of a run see it.
struct Growing {
    /// The instants from which the disturbance at the entry is taken, and the entry.
    present: std::ops::RangeInclusive<usize>,
    /// The growth (e-folds) until each instant.
    e_folds: Vec<f64>,
}

/// Compares the models in the channel with the greatest ratio; none without a ratio. `has_passed`
/// is true where the run keeps the limit if it enters each tongue on its periodic response: the
/// deviation has then passed through the tongues.
pub(super) fn cause<'p>(
    (point, spin): (&Point, &Spin),
    step_s: f64,
    swept: &Swept,
    has_passed: bool,
    passages: impl Iterator<Item = (&'p Passage, &'p [[f64; 2]])>,
) -> Option<Cause> {
    let (place, _) = swept.verdict.greatest?;
    let channel = swept.channels[place].index();
    let run = |model| history(model, &Method::Rk4 { step_s }, point, &Start::default(), INTERVAL_S);
    let [nonlinear, linear] = [ModelKind::Nonlinear, ModelKind::Linear].map(run);
    let value = |history: &History<'_>, k: usize| Some(history.instant(k)?.channels[channel]);
    let count = nonlinear.len().min(linear.len());
    let values: Option<Vec<[f64; 2]>> =
        (0..count).map(|k| Some([value(&nonlinear, k)?, value(&linear, k)?])).collect();
    let values = values?;
    let amplitude = *swept.amplitudes[1].get(place)?;
    let index = |time_s: f64| (time_s / INTERVAL_S) as usize;
    let window = index(swept.window_s[0])..(index(swept.window_s[1]) + 1).min(count);
    let times_s = (0..count).map(|k| k as f64 * INTERVAL_S);
    let speeds_rpm: Vec<f64> = spin.speeds_rpm(times_s).collect();
    let growing: Vec<Growing> =
        passages.map(|(passage, growths)| growing(passage, growths, &speeds_rpm)).collect();
    let limit = swept.limits.most;
    let judged = judge(&values, &growing, window, (amplitude, limit), has_passed)?;
    Some(Cause {
        time_s: judged.first as f64 * INTERVAL_S,
        speed_rpm: speeds_rpm[judged.first],
        e_folds: judged.e_folds,
        ratio_without: judged.ratio_without,
        is_enough: judged.ratio_without < limit,
    })
}

/// Returns a passage as instants with these speeds (rpm) see it.
///
/// The disturbance at the entry is taken from the turn before it, or of a run that begins in the
/// tongue from its first turn.
fn growing(passage: &Passage, growths: &[[f64; 2]], speeds_rpm: &[f64]) -> Growing {
    let [from_s, to_s] = passage.from_to_s;
    let last = speeds_rpm.len().saturating_sub(1);
    let entry = ((from_s / INTERVAL_S) as usize).min(last);
    let turn_s = 60.0 / speeds_rpm.get(entry).map_or(1.0, |rpm| rpm.abs().max(1.0));
    let turn = (turn_s / INTERVAL_S).ceil() as usize;
    let present = match entry.checked_sub(turn) {
        Some(before) => before..=entry,
        None => 0..=turn.min(last),
    };
    let mut sum = 0.0;
    let e_folds = speeds_rpm.iter().enumerate().map(|(k, rpm)| {
        // The part of the interval about the instant that is in the passage.
        let begin_s = ((k as f64 - 0.5) * INTERVAL_S).max(from_s);
        let end_s = ((k as f64 + 0.5) * INTERVAL_S).min(to_s);
        if end_s > begin_s {
            sum += (end_s - begin_s) * growth_at(growths, rpm.abs());
        }
        sum
    });
    let e_folds = e_folds.collect();
    Growing { present, e_folds }
}

/// What [`judge`] finds.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Judged {
    /// The first instant beyond the limit, or the farthest.
    first: usize,
    /// The growth until the farthest instant.
    e_folds: f64,
    ratio_without: f64,
}

/// Returns the greatest ratio within a window of instants without what tongues add; none of an
/// empty window. `values` has the deviation by the nonlinear and by the linear model at each
/// instant, and the amplitude is the linear model's.
///
/// Let tongues that the run entered with the differences D1, D2, ... have multiplied disturbances
/// by G1, G2, ... until an instant. A deviation that has passed through them would be smaller by
/// G1 G2 ... without them: they have added the share 1 - 1 / (G1 G2 ...) of it. Of a deviation
/// that may have arisen outside they have added no more than that, and at most
/// D1 (G1 - 1) + D2 (G2 - 1) + ...
fn judge(
    values: &[[f64; 2]],
    growing: &[Growing],
    window: std::ops::Range<usize>,
    (amplitude, limit): (f64, f64),
    has_passed: bool,
) -> Option<Judged> {
    let difference = |k: usize| values.get(k).map_or(0.0, |[a, b]| (a - b).abs());
    let entered: Vec<(f64, &[f64])> = growing
        .iter()
        .map(|one| {
            let present = one.present.clone().map(difference).fold(0.0, f64::max);
            (present, one.e_folds.as_slice())
        })
        .collect();
    let e_folds = |k: usize| -> f64 { entered.iter().map(|(_, e_folds)| e_folds[k]).sum() };
    let without = |k: usize| -> f64 {
        let [nonlinear, linear] = values[k];
        let present = difference(k);
        if present == 0.0 {
            return nonlinear.abs();
        }
        let mut share = -(-e_folds(k)).exp_m1();
        if !has_passed {
            let grown = |(entry, e_folds): &(f64, &[f64])| entry * e_folds[k].exp_m1();
            let grown: f64 = entered.iter().map(grown).sum();
            share = share.min(grown / present);
        }
        (linear + (nonlinear - linear) * (1.0 - share)).abs()
    };
    let far = |k: &usize| values[*k][0].abs();
    let farthest = window.clone().max_by(|a, b| far(a).total_cmp(&far(b)))?;
    let first = window.clone().find(|k| far(k) > limit * amplitude).unwrap_or(farthest);
    let left = window.map(without).fold(0.0, f64::max);
    Some(Judged { first, e_folds: e_folds(farthest), ratio_without: left / amplitude })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By instant the deviations by both models: an oscillation of the linear one, and a difference
    /// of this size.
    fn values(difference: impl Fn(usize) -> f64) -> Vec<[f64; 2]> {
        let linear = |k: usize| (0.9 * k as f64).sin();
        (0..1000)
            .map(|k| [linear(k) + difference(k) * (0.37 * k as f64).cos(), linear(k)])
            .collect()
    }

    /// A tongue from an instant to another, in which a disturbance grows by so many e-folds.
    fn tongue(from: usize, to: usize, e_folds: f64) -> Growing {
        let share = |k: usize| (k.clamp(from, to) - from) as f64 / (to - from) as f64;
        Growing {
            present: from - 40..=from,
            e_folds: (0..1000).map(|k| e_folds * share(k)).collect(),
        }
    }

    /// A difference of this size that grows by so many e-folds from an instant to another.
    fn grows(size: f64, from: usize, to: usize, e_folds: f64) -> impl Fn(usize) -> f64 {
        move |k| size * (e_folds * (k.clamp(from, to) - from) as f64 / (to - from) as f64).exp()
    }

    fn ratio_without(values: &[[f64; 2]], growing: &[Growing]) -> f64 {
        judge(values, growing, 500..1000, (1.0, 2.0), false).unwrap().ratio_without
    }

    #[test]
    fn growth_that_the_tongues_made_is_taken_away() {
        let values = values(grows(0.2, 300, 600, 3.0));
        let tongues = [tongue(300, 600, 3.0)];
        let found = judge(&values, &tongues, 500..1000, (1.0, 2.0), false).unwrap();
        assert!(found.first < 600 && (found.e_folds - 3.0).abs() < 1e-9, "{found:?}");
        assert!((1.0..1.3).contains(&found.ratio_without), "{found:?}");
    }

    /// The tongue grows as much as is needed, but the run is through with its deviation.
    #[test]
    fn a_tongue_that_comes_late_is_no_cause() {
        let values = values(grows(0.2, 300, 600, 3.0));
        let without = ratio_without(&values, &[tongue(700, 900, 3.0)]);
        assert!(without > 3.0, "{without}");
    }

    /// The difference grows by 3 e-folds, of which the tongue makes 0.07.
    #[test]
    fn a_tongue_that_grows_little_is_no_cause() {
        let values = values(grows(0.2, 300, 600, 3.0));
        let without = ratio_without(&values, &[tongue(300, 400, 0.07)]);
        assert!(without > 3.0, "{without}");
    }

    /// What decayed after the tongue is still what the tongue made.
    #[test]
    fn a_deviation_that_decays_after_its_tongue_is_its_own() {
        let grown = grows(0.5, 200, 400, 3.0);
        let values = values(|k| grown(k) * (-0.005 * (k.max(400) - 400) as f64).exp());
        let without = ratio_without(&values, &[tongue(200, 400, 3.0)]);
        assert!((1.0..1.6).contains(&without), "{without}");
    }

    /// A tongue that is passed with a small difference does not make what comes after it.
    #[test]
    fn a_deviation_that_arises_after_its_tongue_is_not_its_own() {
        let values = values(|k| if k < 600 { 0.01 } else { 4.0 });
        let without = ratio_without(&values, &[tongue(200, 400, 3.0)]);
        assert!(without > 4.0, "{without}");
    }

    /// A deviation that has passed through the tongue may have grown on after it.
    #[test]
    fn a_deviation_that_passed_a_tongue_is_smaller_without_it() {
        let values = values(grows(0.1, 300, 700, 3.7));
        let tongues = [tongue(300, 500, 1.85)];
        let ratio = |has_passed: bool| {
            judge(&values, &tongues, 500..1000, (1.0, 2.0), has_passed).unwrap().ratio_without
        };
        assert!((1.0..1.8).contains(&ratio(true)), "{}", ratio(true));
        assert!(ratio(false) > 4.0, "{}", ratio(false));
    }

    #[test]
    fn tongues_one_after_the_other_multiply() {
        let first = grows(0.1, 100, 300, 1.7);
        let second = grows(1.0, 400, 600, 1.7);
        let values = values(|k| first(k) * second(k));
        let tongues = [tongue(100, 300, 1.7), tongue(400, 600, 1.7)];
        assert!(ratio_without(&values, &tongues[..1]) > 2.0);
        let without = ratio_without(&values, &tongues);
        assert!((1.0..1.2).contains(&without), "{without}");
    }
}

//! The fast method, with an error that is looked at and verdicts that are certain.
//!
//! Trajectories run with the modes of bearings and hinge capped (`washer_model::Capping`). Three things make up for that:
//!
//! * Before the first point, a sample of the grid is run by the reference method, plain RK4 at a converged step, as well. If the worst
//!   amplitude error is above the accuracy asked for, step and cap are tightened for all points, and the sample is compared again.
//! * A point whose ratio comes near the limit or passes it is run a second time with a shorter step and a higher cap. Where the two differ by more than
//!   a third of the accuracy, the motion amplifies small changes (most are chaotic): the row is flagged as sensitive.
//! * A point whose ratio is within its error of the limit, or that failed, is run by the reference method, whose numbers its row
//!   then holds. So the verdicts are those of the reference map.
//!
//! Everything follows from the plan alone, so that every process of a run comes to the same rows.

use std::panic::{AssertUnwindSafe, catch_unwind};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use washer_model::{Capping, Caps, Cases, Method, ModelKind, Point};

use super::{GROUP, ModelEngine, panicked};
use crate::outcome::{Outcome, Status, Trajectory};
use crate::plan::{Plan, Scenario};
use crate::run::Watch;
use crate::verdict::Verdict;

/// Step of the reference method, where the machine allows it (s): amplitudes are converged to about 1e-9.
const REFERENCE_STEP_S: f64 = 2e-4;

/// Share of the longest stable step that the reference method may use.
const REFERENCE_SHARE: f64 = 0.75;

/// One point in so many is in the sample.
const SAMPLED: u64 = 50;

/// No sample is larger: it is held in memory.
const MOST_SAMPLED: u64 = 1_000_000;

/// The second run's step, as a share of the first's; its cap is higher by as much.
const SECOND_STEP: f64 = 0.8;

/// A motion whose two runs differ by more than this share of the accuracy amplifies small changes. The difference of the runs
/// is 0.36 (cap) to 0.59 (step) of the first one's error.
const SENSITIVE_SHARE: f64 = 1.0 / 3.0;

/// Ratios above this share of the limit are looked at twice.
const SUSPECT_SHARE: f64 = 0.6;

/// A ratio is uncertain within this many times its error.
const UNCERTAINTY: f64 = 10.0;

/// The most that a ratio is held uncertain by, as a factor: beyond it lies another regime of motion.
const MOST_UNCERTAIN: f64 = 2.0;

/// How often step and cap are tightened before the reference method does everything.
const TIGHTENINGS: u32 = 4;

/// Each time, the accuracy that they are chosen for is divided by this.
const TIGHTENED_BY: f64 = 8.0;

/// What was settled before the first point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settled {
    /// Longest step of the fast method.
    pub step_s: f64,
    /// Cap on the bearing modes; none if it gains nothing.
    pub cap_rad_per_s: Option<f64>,
    /// Cap on those of the hinge, if they have one.
    pub hinge_cap_rad_per_s: Option<f64>,
    /// Step of the reference method.
    pub reference_step_s: f64,
    /// How often step and cap were tightened because the sample broke the accuracy.
    pub tightened: u32,
    /// Points in the sample.
    pub sampled: u64,
    /// Those of them that are sensitive; their digits say nothing about the method.
    pub sampled_sensitive: u64,
    /// Worst relative error of an amplitude over the rest of the sample; absent if nothing was compared.
    pub observed_error: Option<f64>,
}

impl Settled {
    fn fast(&self) -> Method {
        self.at_share(1.0)
    }

    fn second(&self) -> Method {
        self.at_share(SECOND_STEP)
    }

    /// With a step of this share, and caps higher by as much.
    fn at_share(&self, share: f64) -> Method {
        let caps = self.cap_rad_per_s.map(|cap| Caps {
            bearings_rad_per_s: cap / share,
            hinge_rad_per_s: self.hinge_cap_rad_per_s.map(|cap| cap / share),
        });
        Capping { step_s: share * self.step_s, caps }.method()
    }

    fn reference(&self) -> Method {
        Method::Rk4 { step_s: self.reference_step_s }
    }
}

/// Step of the reference method.
pub(crate) fn reference_step_s(cases: &Cases<'_>) -> f64 {
    REFERENCE_STEP_S.min(cases.plain_step_s().map_or(f64::INFINITY, |longest_s| REFERENCE_SHARE * longest_s))
}

/// Fast and reference outcome of a sample point.
type Pair = (Outcome, Outcome);

impl ModelEngine<'_> {
    /// Step and cap by the rule alone, from the corners of the grid.
    pub(super) fn unchecked(&self, accuracy: f64) -> Settled {
        let scenarios: Vec<_> = self
            .plan
            .some_corners()
            .iter()
            .map(|values| {
                let Scenario { machine, spin, .. } = self.plan.scenario_at(values);
                (machine, spin)
            })
            .collect();
        let prepared = washer_model::prepare(self.simd, &scenarios, &self.timing);
        let ready: Vec<_> = prepared
            .iter()
            .zip(&scenarios)
            .filter_map(|(point, (_, spin))| point.as_ref().ok().map(|point| (point, spin)))
            .collect();
        let cases = Cases::new(ready, self.plan.end_s);
        let reference_step_s = reference_step_s(&cases);
        // Corners without an equilibrium or without modes are rows that say so; the rest is integrated as the reference is.
        let capping = cases.choose(accuracy).unwrap_or(Capping { step_s: reference_step_s, caps: None });
        Settled {
            step_s: capping.step_s,
            cap_rad_per_s: capping.caps.map(|caps| caps.bearings_rad_per_s),
            hinge_cap_rad_per_s: capping.caps.and_then(|caps| caps.hinge_rad_per_s),
            reference_step_s,
            tightened: 0,
            sampled: 0,
            sampled_sensitive: 0,
            observed_error: None,
        }
    }

    /// Step and cap, held against the reference on a sample; `None` when stopped.
    pub(super) fn check(&self, accuracy: f64, watch: &Watch<'_>) -> Option<Settled> {
        self.check_from(self.unchecked(accuracy), accuracy, watch)
    }

    /// As [`Self::check`], with the first step and cap given.
    fn check_from(&self, mut settled: Settled, accuracy: f64, watch: &Watch<'_>) -> Option<Settled> {
        let sample = sample(self.plan);
        let reference = self.each(&sample, watch, &|points| self.by(&settled.reference(), points))?;
        for tightened in 0..=TIGHTENINGS {
            if tightened == TIGHTENINGS {
                settled.step_s = settled.reference_step_s;
                settled.cap_rad_per_s = None;
                settled.hinge_cap_rad_per_s = None;
            } else if tightened > 0 {
                settled = self.unchecked(accuracy / TIGHTENED_BY.powi(tightened as i32));
            }
            let fast = self.each(&sample, watch, &|points| self.flagged(accuracy, &settled, points))?;
            let pairs: Vec<Pair> = fast.into_iter().zip(reference.iter().cloned()).collect();
            let errors = pairs.iter().filter(|(fast, _)| fast.sensitive != Some(true)).filter_map(error);
            settled.tightened = tightened;
            settled.sampled = sample.len() as u64;
            settled.sampled_sensitive =
                pairs.iter().filter(|(fast, _)| fast.sensitive == Some(true)).count() as u64;
            settled.observed_error = errors.reduce(f64::max);
            if settled.observed_error.is_none_or(|worst| worst <= accuracy) {
                break;
            }
        }
        Some(settled)
    }

    /// One outcome per point, on all threads of the pool.
    fn each(
        &self,
        sample: &[u64],
        watch: &Watch<'_>,
        evaluate: &(dyn Fn(&[u64]) -> Vec<Outcome> + Sync),
    ) -> Option<Vec<Outcome>> {
        let groups: Option<Vec<_>> = sample
            .par_chunks(GROUP as usize / 4)
            .map(|points| {
                let defect = |_| points.iter().map(|&point| panicked(point)).collect();
                let outcomes = || catch_unwind(AssertUnwindSafe(|| evaluate(points))).unwrap_or_else(defect);
                if watch.stopped() { None } else { Some(outcomes()) }
            })
            .collect();
        groups.map(|groups| groups.concat())
    }

    /// Outcomes of some points, their verdicts certain.
    pub(super) fn certain(
        &self,
        accuracy: f64,
        settled: &Settled,
        prepared: &[Option<Point>],
        points: &[u64],
    ) -> Vec<Outcome> {
        let mut outcomes = self.all(prepared, &settled.fast(), points);
        let spreads = self.flag(accuracy, settled, prepared, &mut outcomes);
        let error = settled.observed_error.unwrap_or(0.0).max(accuracy);
        let doubtful: Vec<usize> =
            (0..outcomes.len()).filter(|&i| self.is_doubtful(&outcomes[i], error.max(spreads[i]))).collect();
        let of_doubtful: Vec<&Point> = doubtful.iter().filter_map(|&i| prepared[i].as_ref()).collect();
        let (nonlinear, linear) = self.both(&of_doubtful, &settled.reference());
        let mut again = nonlinear.into_iter().zip(linear);
        for i in doubtful {
            if let Some((nonlinear, linear)) = again.next() {
                outcomes[i].nonlinear = nonlinear;
                outcomes[i].linear = linear;
                outcomes[i].compare_turns(&self.plan.reliability.channels);
            }
        }
        outcomes
    }

    /// Outcomes by one method.
    fn by(&self, method: &Method, points: &[u64]) -> Vec<Outcome> {
        let prepared = self.prepare(points, &|point| self.plan.scenario(point));
        let mut outcomes = self.all(&prepared, method, points);
        outcomes.iter_mut().for_each(Outcome::forget_turns);
        outcomes
    }

    /// Outcomes by the fast method, with their flags.
    fn flagged(&self, accuracy: f64, settled: &Settled, points: &[u64]) -> Vec<Outcome> {
        let prepared = self.prepare(points, &|point| self.plan.scenario(point));
        let mut outcomes = self.all(&prepared, &settled.fast(), points);
        self.flag(accuracy, settled, &prepared, &mut outcomes);
        outcomes.iter_mut().for_each(Outcome::forget_turns);
        outcomes
    }

    /// Runs suspects a second time, flags those whose motion amplifies the difference, and returns the differences.
    fn flag(
        &self,
        accuracy: f64,
        settled: &Settled,
        prepared: &[Option<Point>],
        outcomes: &mut [Outcome],
    ) -> Vec<f64> {
        let mut spreads = vec![0.0; outcomes.len()];
        let is_suspect = |outcome: &Outcome| {
            self.ratio(outcome).is_some_and(|ratio| ratio > SUSPECT_SHARE * self.plan.reliability.ratio_limit)
        };
        let suspects: Vec<usize> = (0..outcomes.len()).filter(|&i| is_suspect(&outcomes[i])).collect();
        let points: Vec<&Point> = suspects.iter().filter_map(|&i| prepared[i].as_ref()).collect();
        let again = self.trajectories(&points, ModelKind::Nonlinear, &settled.second());
        for outcome in outcomes.iter_mut() {
            outcome.sensitive = (outcome.nonlinear.status == Status::Ok).then_some(false);
        }
        for (i, again) in suspects.into_iter().zip(again) {
            spreads[i] = self.spread(&outcomes[i], again).unwrap_or(f64::INFINITY);
            outcomes[i].sensitive = Some(spreads[i] > SENSITIVE_SHARE * accuracy);
        }
        spreads
    }

    /// Relative difference of an outcome from that with another run of the nonlinear model; `None` if either has none.
    fn spread(&self, outcome: &Outcome, again: Trajectory) -> Option<f64> {
        let of_amplitudes = difference(&outcome.nonlinear, &again)?;
        if outcome.turn_ratios.is_empty() {
            return Some(of_amplitudes);
        }
        let mut other = Outcome::new(outcome.point, again, outcome.linear.clone());
        other.compare_turns(&self.plan.reliability.channels);
        Some(of_amplitudes.max(ratio_difference(outcome, &other)))
    }

    /// Whether an error of this size (relative, of an amplitude) could turn the verdict, or the trajectory did not come to one.
    fn is_doubtful(&self, outcome: &Outcome, error: f64) -> bool {
        let failed = |model: &Trajectory| !matches!(model.status, Status::Ok | Status::NoEquilibrium);
        if failed(&outcome.nonlinear) || failed(&outcome.linear) {
            return true;
        }
        let margin = (1.0 + UNCERTAINTY * error).min(MOST_UNCERTAIN);
        let limit = self.plan.reliability.ratio_limit;
        self.ratio(outcome).is_some_and(|ratio| ratio < margin * limit && ratio * margin > limit)
    }

    fn ratio(&self, outcome: &Outcome) -> Option<f64> {
        let reliability = &self.plan.reliability;
        let verdict = Verdict::new(outcome, reliability.channels.len(), reliability.ratio_limit);
        verdict.greatest.map(|(_, ratio)| ratio)
    }
}

/// The corners of the grid, and one point in every [`SAMPLED`], drawn by its place alone.
fn sample(plan: &Plan) -> Vec<u64> {
    let points = plan.points();
    let every = SAMPLED.max(points / MOST_SAMPLED);
    let drawn = (0..points.div_ceil(every)).map(|block| {
        let length = every.min(points - block * every);
        let hash = blake3::hash(&block.to_le_bytes());
        let draw = hash.as_bytes().iter().take(8).fold(0_u64, |draw, byte| draw << 8 | u64::from(*byte));
        block * every + draw % length
    });
    let mut sample: Vec<u64> = plan.corner_points().into_iter().chain(drawn).collect();
    sample.sort_unstable();
    sample.dedup();
    sample
}

/// Worst relative error of a sample point's amplitudes, over both models; `None` if either run has none.
fn error((fast, reference): &Pair) -> Option<f64> {
    let nonlinear = difference(&reference.nonlinear, &fast.nonlinear)?;
    let linear = difference(&reference.linear, &fast.linear)?;
    Some(nonlinear.max(linear).max(ratio_difference(reference, fast)))
}

/// Greatest relative difference of two outcomes' ratios by turns, where both have them.
fn ratio_difference(a: &Outcome, b: &Outcome) -> f64 {
    let relative = |(a, b): (&Option<f64>, &Option<f64>)| a.zip(*b).map_or(0.0, |(a, b)| (b - a).abs() / a);
    a.turn_ratios.iter().zip(&b.turn_ratios).map(relative).fold(0.0, f64::max)
}

/// Greatest relative difference of two trajectories' amplitudes; `None` if either has none.
fn difference(a: &Trajectory, b: &Trajectory) -> Option<f64> {
    if a.status != Status::Ok || b.status != Status::Ok {
        return None;
    }
    let relative = |(a, b): (&f64, &f64)| if a == b { 0.0 } else { (b - a).abs() / a.abs() };
    Some(a.amplitudes.iter().zip(&b.amplitudes).map(relative).fold(0.0, f64::max))
}

#[cfg(test)]
mod tests;

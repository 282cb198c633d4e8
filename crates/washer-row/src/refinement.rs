//! Refines a row: stores the finest trajectory of each model, and decides which level is integrated
//! next.

use washer_model::{MethodKind, ModelKind, Point, UnresolvedModes};

use crate::error_control::{
    amplification, contraction, difference_of_levels, error_of_chaos, error_of_level,
};
use crate::levels::{FamilyStart, RefinementLevels};
use crate::measures::TURN_FLOOR;
use crate::metrics::Metric;
use crate::outcome::{Outcome, Status, Trajectory};
use crate::run::{LevelRun, RowRule};
use crate::separation::Separation;

/// The purpose of an outcome, on which its accuracy depends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutcomePurpose {
    /// A row, with every number and the verdict within the accuracy.
    Row,
    /// The side of the limit on which the ratio lies, and the ratio itself if it is near the limit.
    Side,
    /// The growth of disturbances at constant speeds, for which no trajectory is integrated.
    Growth,
}

/// The rules by which all rows of a run are refined.
#[derive(Clone, Copy, Debug)]
pub struct RefinementRule<'a> {
    /// The levels of both models, in the order of [`ModelKind::ALL`].
    pub levels: &'a [RefinementLevels; 2],
    /// The purpose of outcomes.
    pub purpose: OutcomePurpose,
    /// The numbers that rows take from trajectories, and their accuracy.
    pub row_rule: &'a RowRule,
}

impl<'a> RefinementRule<'a> {
    /// Returns the rule of one model's trajectory of a point.
    fn for_model(&self, model: usize, point: &'a Point) -> ModelRule<'a> {
        let kind = ModelKind::ALL[model];
        ModelRule { levels: &self.levels[model], rule: self.row_rule, point, kind }
    }
}

/// The rule by which one model's trajectory of a point is refined.
#[derive(Clone, Copy)]
struct ModelRule<'a> {
    levels: &'a RefinementLevels,
    rule: &'a RowRule,
    point: &'a Point,
    kind: ModelKind,
}

impl ModelRule<'_> {
    /// Returns the greatest ratio of unresolved ringing to a row's number: the vibration of
    /// bearings and hinge that a level's steps do not resolve, relative to the amplitudes, to the
    /// clearance and, where the hinge rings, to the speeds of dampers, times the amplification of
    /// the motion. Ringing about a standstill counts only if it exceeds the least amplitude of a
    /// moving machine, below which the verdict knows no motion.
    fn relative_ringing(&self, level: usize, refinement: &ModelRefinement) -> f64 {
        let Some(run) = &refinement.run else { return 0.0 };
        let Some(unresolved) = self.levels.unresolved_modes(level) else { return 0.0 };
        let amplitude_bounds = self.point.ringing(unresolved);
        let at_rest_m = self.point.rest_limit_m();
        let mut greatest_ringing = amplitude_bounds.gap_m / self.point.clearance_m();
        for (channel, amplitude) in self.rule.channels.iter().zip(&run.trajectory.amplitudes) {
            let bound = amplitude_bounds.channels[channel.index()];
            if bound > at_rest_m || *amplitude > 0.0 && bound > 0.0 {
                greatest_ringing = greatest_ringing.max(bound / amplitude);
            }
        }
        match unresolved {
            UnresolvedModes::HingeAndBearings => {
                let speeds = self.relative_speed_ringing(amplitude_bounds.tub_speed_m_per_s, run);
                amplification(refinement.first_difference, self.rule.accuracy)
                    * greatest_ringing.max(speeds)
            }
            UnresolvedModes::Bearings => greatest_ringing,
        }
    }

    /// Returns the greatest ratio of a speed by unresolved ringing (m/s) to the speed of a damper.
    fn relative_speed_ringing(&self, ringing_m_per_s: f64, run: &LevelRun) -> f64 {
        let columns = self.rule.measures.model_columns();
        let speeds = run.trajectory.metrics.iter().zip(columns);
        speeds
            .filter(|(_, column)| column.metric == Metric::DamperSpeed)
            .map(|(speed_m_per_s, column)| {
                let least = column.metric.scale(self.rule.window_s, self.point.weight_n());
                ringing_m_per_s / speed_m_per_s.max(least)
            })
            .fold(0.0, f64::max)
    }
}

/// The trajectory of one model under refinement.
#[derive(Clone, Debug, Default)]
struct ModelRefinement {
    /// The level of `run`.
    level: usize,
    /// The finest run that is not a perturbed one.
    run: Option<LevelRun>,
    /// The difference of each run from the one before.
    differences: Vec<LevelDifference>,
    /// The difference of the first two levels; zero before there are two.
    first_difference: f64,
    /// The comparison with a perturbed run, once it has run.
    perturbed_comparison: Option<PerturbedComparison>,
}

/// The difference of a level from the one before.
#[derive(Clone, Copy, Debug)]
struct LevelDifference {
    /// The relative difference of the numbers; `None` if the levels cannot be compared.
    difference_of_numbers: Option<f64>,
    /// The separation of the motions.
    separation: Separation,
    /// The change by which the level starts a family.
    start: FamilyStart,
}

impl LevelDifference {
    /// Returns the relative difference of the levels: that of the numbers, or the distance of the
    /// motions if the levels follow different ones. `None` if the levels cannot be compared.
    fn relative(self) -> Option<f64> {
        Some(difference_of_levels(self.difference_of_numbers?, self.separation))
    }

    /// Returns the difference divided by the contraction of the error from this level to the
    /// next, whose method is of this kind. Families that cannot be compared say nothing of each
    /// other's errors.
    fn contracted_to(self, kind: MethodKind) -> f64 {
        match (self.relative(), self.start) {
            (Some(relative), start) => relative / contraction(kind, start),
            (None, FamilyStart::None) => f64::INFINITY,
            (None, _) => 0.0,
        }
    }
}

/// The comparison of a perturbed run with its original.
#[derive(Clone, Copy, Debug)]
struct PerturbedComparison {
    is_chaotic: bool,
    /// The relative difference of the two runs' numbers; `None` if a run failed.
    difference: Option<f64>,
}

impl ModelRefinement {
    fn add_run(&mut self, level: usize, run: LevelRun, rule: ModelRule<'_>) {
        let Some(previous_run) = self.run.take() else {
            self.level = level;
            self.run = Some(run);
            return;
        };
        let difference =
            relative_difference(&previous_run.trajectory, &run.trajectory, rule.point, rule.rule);
        let separation = match rule.kind {
            ModelKind::Nonlinear => {
                let [previous, current] = [&previous_run, &run].map(|run| &run.checkpoints);
                Separation::new(&rule.point.separations(previous, current))
            }
            ModelKind::Linear => Separation::default(),
        };
        if rule.levels.is_perturbed(level) {
            let is_chaotic = separation.is_exponential();
            self.perturbed_comparison = Some(PerturbedComparison { is_chaotic, difference });
            self.run = Some(previous_run);
            return;
        }
        let start = rule.levels.family_start(level);
        let level_difference =
            LevelDifference { difference_of_numbers: difference, separation, start };
        self.differences.push(level_difference);
        if self.differences.len() == 1 && self.level == 0 {
            self.first_difference = level_difference.relative().unwrap_or(f64::INFINITY);
        }
        self.level = level;
        self.run = Some(run);
    }

    /// Whether the last two levels follow different motions.
    fn is_separated(&self) -> bool {
        self.differences.last().is_some_and(|difference| difference.separation.is_complete())
    }

    fn is_chaotic(&self) -> bool {
        self.perturbed_comparison.is_some_and(|comparison| comparison.is_chaotic)
    }

    /// Whether the numbers are those of one chaotic trajectory, from which those of the perturbed
    /// run differ. A motion that is chaotic for a part of the run may have numbers that do not
    /// depend on that part.
    fn is_sensitive(&self, accuracy: f64) -> bool {
        self.perturbed_comparison.is_some_and(|PerturbedComparison { is_chaotic, difference }| {
            let error = difference.and_then(|difference| error_of_chaos(0.0, difference));
            is_chaotic && error.is_none_or(|error| error > accuracy)
        })
    }

    fn has_failed(&self) -> bool {
        self.run.as_ref().is_some_and(|run| run.trajectory.status != Status::Ok)
    }

    /// Returns the error of the finest run; `None` if there is no estimate.
    fn error(&self, rule: ModelRule<'_>) -> Option<f64> {
        let last = self.differences.last()?;
        if let Some(PerturbedComparison { is_chaotic: true, difference }) =
            self.perturbed_comparison
        {
            return error_of_chaos(last.difference_of_numbers?, difference?);
        }
        let kind = rule.levels.levels[self.level].kind;
        let contracted_difference = match self.differences[..] {
            [.., previous, _] => previous.contracted_to(kind),
            _ => 0.0,
        };
        let error = error_of_level(kind, last.relative()?, contracted_difference)?;
        Some(error.max(rule.relative_ringing(self.level, self)))
    }

    /// Returns the level to run next if the error is above the accuracy or the verdict
    /// `is_in_doubt`; `None` if the run is accurate enough, or no finer level would reduce the
    /// error.
    fn next_level(&self, rule: ModelRule<'_>, is_in_doubt: bool) -> Option<usize> {
        let levels = rule.levels;
        if self.run.is_none() {
            return Some(0);
        }
        if !levels.is_checked() || self.is_chaotic() {
            return None;
        }
        let accuracy = rule.rule.accuracy;
        let is_converged = self.error(rule).is_some_and(|error| error <= accuracy);
        if is_converged && !is_in_doubt {
            return None;
        }
        let has_little_ringing = |level: &usize| rule.relative_ringing(*level, self) <= accuracy;
        let is_finest_useful = self.level + 1 == levels.levels.len()
            || self.level + 1 == levels.first_resolving() && has_little_ringing(&self.level);
        if is_finest_useful {
            // A chaotic motion does not converge at any step, and its levels separate, because they
            // differ by more than a perturbed run does. A perturbed run tells such a motion from
            // one that needs finer steps.
            let may_be_chaos = !is_converged && self.is_separated();
            let needs_perturbed_run = may_be_chaos && self.perturbed_comparison.is_none();
            return needs_perturbed_run.then(|| levels.perturbed_index(self.level));
        }
        let mut first_candidate = self.level + 1;
        // Capped modes may be the cause of the failure.
        if self.has_failed() {
            first_candidate = first_candidate.max(levels.first_uncapped());
        }
        // Levels with the same unresolved ringing have the same error from it, which their
        // difference does not show.
        (first_candidate..levels.levels.len()).find(has_little_ringing)
    }
}

/// A row under refinement.
#[derive(Clone, Debug, Default)]
pub struct RowRefinement([ModelRefinement; 2]);

/// The action that a row needs next.
#[derive(Clone, Debug)]
pub enum NextStep {
    /// The requested runs: for each the position of the model in [`ModelKind::ALL`] and the index
    /// of its level.
    Runs(Vec<(usize, usize)>),
    /// The outcome of the row, which needs no further run.
    Done(Box<Outcome>),
}

impl RowRefinement {
    /// Takes the runs that the last call has requested, none at first, and returns the next step.
    /// `point_index` is the point of the outcome.
    pub fn advance(
        &mut self,
        runs: Vec<((usize, usize), LevelRun)>,
        point_index: u64,
        point: &Point,
        refinement_rule: RefinementRule<'_>,
    ) -> NextStep {
        for ((model, level), run) in runs {
            self.0[model].add_run(level, run, refinement_rule.for_model(model, point));
        }
        self.next_step(point_index, point, refinement_rule)
    }

    /// Returns the finest run of a model with its level and its error; `None` if no run was added.
    /// The error is `None` if there is no estimate.
    pub fn finest_run(
        &self,
        model: usize,
        point: &Point,
        refinement_rule: RefinementRule<'_>,
    ) -> Option<(&LevelRun, usize, Option<f64>)> {
        let refinement = &self.0[model];
        let error = refinement.error(refinement_rule.for_model(model, point));
        refinement.run.as_ref().map(|run| (run, refinement.level, error))
    }

    /// Returns the number of steps of a model's finest run; zero if no run was added.
    pub fn steps(&self, model: usize) -> u64 {
        self.0[model].run.as_ref().map_or(0, |run| run.trajectory.steps)
    }

    /// Returns the next step, once every requested run has been taken.
    fn next_step(
        &self,
        point_index: u64,
        point: &Point,
        refinement_rule: RefinementRule<'_>,
    ) -> NextStep {
        if refinement_rule.purpose == OutcomePurpose::Growth {
            return NextStep::Done(Box::new(Outcome::failed(point_index, Status::Ok)));
        }
        let errors =
            [0, 1].map(|model| self.0[model].error(refinement_rule.for_model(model, point)));
        let outcome = self.outcome(point_index, point, refinement_rule, errors);
        let verdict_margin = outcome.as_ref().and_then(|outcome| outcome.verdict.margin);
        let error = errors[0].zip(errors[1]).map(|(nonlinear, linear)| nonlinear + linear);
        let is_verdict_certain =
            verdict_margin.zip(error).is_some_and(|(verdict_margin, error)| error < verdict_margin);
        let mut runs = Vec::new();
        if !(refinement_rule.purpose == OutcomePurpose::Side && is_verdict_certain) {
            // An error greater than the margin could change the verdict.
            let is_in_doubt = verdict_margin.is_some() && error.is_some() && !is_verdict_certain;
            for (model, refinement) in self.0.iter().enumerate() {
                let next =
                    refinement.next_level(refinement_rule.for_model(model, point), is_in_doubt);
                runs.extend(next.map(|level| (model, level)));
            }
        }
        match outcome {
            Some(outcome) if runs.is_empty() => NextStep::Done(Box::new(outcome)),
            _ => NextStep::Runs(runs),
        }
    }

    /// Returns the outcome of the runs added so far; `None` unless both models have one.
    fn outcome(
        &self,
        point_index: u64,
        point: &Point,
        refinement_rule: RefinementRule<'_>,
        errors: [Option<f64>; 2],
    ) -> Option<Outcome> {
        let RefinementRule { levels, row_rule: rule, .. } = refinement_rule;
        let [nonlinear, linear] = &self.0;
        let trajectory = |refinement: &ModelRefinement| {
            refinement.run.as_ref().map(|run| run.trajectory.clone())
        };
        let mut outcome = Outcome::new(point_index, trajectory(nonlinear)?, trajectory(linear)?);
        outcome.compare(&rule.channels, rule.limits);
        outcome.method = levels[0].levels[nonlinear.level].kind;
        if rule.measures.metrics.contains(&Metric::StaticSag) {
            outcome.static_sag_m = Some(point.static_sag_m());
        }
        if levels.iter().all(RefinementLevels::is_checked) {
            let [nonlinear_error, linear_error] = errors;
            let greatest = |(a, b): (f64, f64)| a.max(b);
            outcome.error = nonlinear_error.zip(linear_error).map(greatest);
            outcome.converged = Some(outcome.error.is_some_and(|error| error <= rule.accuracy));
            outcome.sensitive = Some(nonlinear.is_sensitive(rule.accuracy));
        }
        Some(outcome)
    }
}

/// Returns the greatest relative difference of the numbers that a row takes from two trajectories;
/// `None` if only one of them failed. If both failed, the times of failure are compared, relative
/// to the run's length.
fn relative_difference(
    first: &Trajectory,
    second: &Trajectory,
    point: &Point,
    rule: &RowRule,
) -> Option<f64> {
    if first.status != second.status {
        return None;
    }
    if second.status != Status::Ok {
        let (first_s, second_s) = first.fail_time_s.zip(second.fail_time_s)?;
        return Some((first_s - second_s).abs() / rule.end_s);
    }
    let mut greatest_difference = 0.0_f64;
    let mut compare = |first: f64, second: f64, scale: f64| {
        if first != second {
            let difference = (first - second).abs() / second.abs().max(scale);
            // A NaN is treated as an infinite difference.
            greatest_difference = if difference.is_nan() {
                f64::INFINITY
            } else {
                greatest_difference.max(difference)
            };
        }
    };
    for (first, second) in first.amplitudes.iter().zip(&second.amplitudes) {
        compare(*first, *second, 0.0);
    }
    if let Some((first, second)) = first.min_gap_m.zip(second.min_gap_m) {
        compare(first, second, point.clearance_m());
    }
    for ((first, second), column) in
        first.metrics.iter().zip(&second.metrics).zip(rule.measures.model_columns())
    {
        compare(*first, *second, column.metric.scale(rule.window_s, point.weight_n()));
    }
    for (first, second) in first.turns.iter().zip(&second.turns) {
        for channel in &rule.channels {
            let i = channel.index();
            compare(first[i], second[i], TURN_FLOOR);
        }
    }
    Some(greatest_difference)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motion may be chaotic for a part of the run on which its numbers do not depend.
    #[test]
    fn chaotic_rows_are_sensitive_if_the_numbers_of_the_perturbed_run_differ() {
        let is_sensitive = |is_chaotic, difference| {
            let perturbed_comparison = Some(PerturbedComparison { is_chaotic, difference });
            let refinement = ModelRefinement { perturbed_comparison, ..Default::default() };
            refinement.is_sensitive(1e-3)
        };
        assert!(is_sensitive(true, Some(1e-2)));
        assert!(is_sensitive(true, None));
        assert!(!is_sensitive(true, Some(1e-4)));
        assert!(!is_sensitive(false, Some(1e-2)));
        assert!(!ModelRefinement::default().is_sensitive(1e-3));
    }
}

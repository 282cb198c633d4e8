//! The map's row of a fitted machine, and its margin to instability.

use std::f64::consts::TAU;

use serde::Serialize;
use washer_model::{HeldSpeed, MachineParameter, Response};
use washer_row::{Growth, Status, Verdict as RowVerdict};

use super::algebra::{dot, interval_95};
use super::draw_parameters;
use super::model::Problem;
use super::statistics::{Statistics, Z_975};
use crate::engine::{ModelEngine, fastest_growth, find_responses};
use crate::map_row::MapRow;
use crate::plan::{Axis, AxisValues, Plan, axis_between, prepare_point, timing};
use sweep_engine::commands::cells::format_range;
use sweep_engine::{Error, Interrupt, RunContext};

/// The number of speeds at which the stability of the fitted machine is computed. Basis: bands of
/// instability of the paper's machine are several times wider than their distance. Doubling it
/// doubles the time.
const GROWTH_SPEED_COUNT: u32 = 120;

/// The number of directions of fixed numbers' errors that count in a margin, those that move the
/// estimates most. Basis: the eighth adds some percent to an interval. Doubling it doubles the time
/// that the interval takes.
const MAX_MARGIN_DIRECTIONS: usize = 8;

/// The map's row at the fitted machine.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct FittedVerdict {
    pub(crate) reliable: Option<bool>,
    pub(crate) ratio_max: Option<f64>,
    pub(crate) ratio_limit: f64,
    /// The part of the rows over the fitted distribution that are reliable.
    pub(crate) probability_reliable: Option<f64>,
    /// The interval in which the greatest ratio of 95 % of these rows lies.
    pub(crate) ratio_max_95: Option<[f64; 2]>,
    /// The number of these rows.
    pub(crate) draws: usize,
    /// The growth of the fastest growing disturbance of the periodic responses up to the greatest
    /// speed. If it is negative, the machine is outside every band of instability.
    pub(crate) growth_per_s: Option<f64>,
    pub(crate) growth_at_rpm: Option<f64>,
    /// The 95 % interval of that growth, by the fitted numbers' errors and the speeds' distance.
    pub(crate) growth_95: Option<[f64; 2]>,
    /// Whether the responses at all these speeds are on the curve of a machine that runs up.
    pub(crate) growth_on_curve: Option<bool>,
}

impl FittedVerdict {
    /// Formats the side of a band of instability on which the machine is, if its growth is known;
    /// the machine is at the edge if the interval of its growth contains 0.
    pub(super) fn margin_text(&self, format_short: &dyn Fn(f64) -> String) -> Option<String> {
        let growth = self.growth_per_s?;
        let speed = self.growth_at_rpm?;
        let is_growing = growth > 0.0;
        let side_text = match self.growth_95 {
            Some([from, to]) if from <= 0.0 && 0.0 <= to => {
                "at the edge of a band of instability, within its error"
            }
            _ if is_growing => "inside a band of instability",
            _ => "outside every band of instability",
        };
        let verb = if is_growing { "grow" } else { "die away" };
        let interval_text = self.growth_95.map_or_else(String::new, |ends| {
            let [from, to] = if is_growing { ends } else { [-ends[1], -ends[0]] };
            format!(" ({} in 95 %)", format_range([from, to], format_short))
        });
        let off_curve_note = match self.growth_on_curve {
            Some(false) => {
                "; off the curve of responses at some speeds, where it may be in another motion \
                 (`sweep stability`)"
            }
            _ => "",
        };
        let rate_text = format_short(growth.abs());
        Some(format!(
            "{side_text}: disturbances {verb} by {rate_text} /s{interval_text} at {speed:.0} \
             rpm{off_curve_note}"
        ))
    }
}

/// The computation of rows of the map for a fitted machine.
pub(super) struct FittedMap<'a> {
    pub(super) problem: &'a Problem<'a>,
    /// The unknowns.
    pub(super) x: &'a [f64],
    pub(super) statistics: &'a Statistics,
    /// The number of rows of the map over the fitted distribution.
    pub(super) draws: u64,
}

impl FittedMap<'_> {
    /// Computes the row of a case's map at its fitted machine, and over the fitted distribution.
    pub(super) fn verdict(&self, case: usize, model_follows: bool) -> Result<FittedVerdict, Error> {
        let problem = self.problem;
        let x = self.x;
        // The map has the spin of the grid, because a measured spin has no parameters.
        let mut plan = Plan { axes: Vec::new(), design: None, ..problem.cases[case].plan.clone() };
        let case_parameters: Vec<usize> = (0..problem.free_parameters.len())
            .filter(|&k| problem.free_parameters[k].belongs_to(case))
            .collect();
        // Free numbers compensate for errors of the fixed ones, which would count twice.
        let covariance = self.statistics.noise_covariance(problem);
        let mut parameter_sets = vec![x.to_vec()];
        if model_follows {
            parameter_sets.extend(draw_parameters(problem, x, &covariance, self.draws));
        }
        for &k in &case_parameters {
            let values_of_parameter = || parameter_sets.iter().map(|set| set[k]);
            let least_value = values_of_parameter().fold(f64::INFINITY, f64::min);
            let greatest_value = values_of_parameter().fold(f64::NEG_INFINITY, f64::max);
            let parameter = plan.model.parameter(problem.free_parameters[k].parameter.clone());
            plan.axes.push(match least_value < greatest_value {
                true => axis_between(parameter, least_value, greatest_value),
                false => {
                    Axis { parameter, values: AxisValues::List(vec![least_value]), tolerance: None }
                }
            });
        }
        let points: Vec<Vec<f64>> = parameter_sets
            .iter()
            .map(|set| case_parameters.iter().map(|&k| set[k]).collect())
            .collect();
        let engine = ModelEngine::new(&plan)?;
        let is_cancelled = || problem.cancel.is_requested();
        let interrupt = Interrupt::new();
        let context = RunContext::with_time_limit(&interrupt, &is_cancelled);
        let rows = engine.evaluate_points(&points, &context).unwrap_or_default();
        let verdicts: Vec<RowVerdict> = rows.iter().map(MapRow::verdict).collect();
        let greatest_ratio = |verdict: &RowVerdict| verdict.greatest.map(|(_, ratio)| ratio);
        let sample_verdicts = verdicts.get(1..).unwrap_or_default();
        let reliable_count =
            sample_verdicts.iter().filter(|verdict| verdict.reliable == Some(true)).count();
        let free_covariance = model_follows.then_some(&covariance[..]);
        let (growth, growth_95) =
            match self.fastest_growth_and_interval(case, &plan, free_covariance) {
                Some((growth, interval)) => (Some(growth), interval),
                None => (None, None),
            };
        Ok(FittedVerdict {
            reliable: verdicts.first().and_then(|verdict| verdict.reliable),
            ratio_max: verdicts.first().and_then(greatest_ratio),
            ratio_limit: plan.reliability.limits.upper,
            probability_reliable: (!sample_verdicts.is_empty())
                .then(|| reliable_count as f64 / sample_verdicts.len() as f64),
            ratio_max_95: interval_95(sample_verdicts.iter().filter_map(greatest_ratio)),
            draws: sample_verdicts.len(),
            growth_per_s: growth.map(|growth| growth.fastest.growth_per_s()),
            growth_at_rpm: growth.map(|growth| growth.fastest.speed_rpm),
            growth_95,
            growth_on_curve: growth.map(|growth| growth.is_on_curve),
        })
    }

    /// Returns the fastest growing disturbance of the fitted machine at speeds up to its greatest,
    /// and the 95 % interval of its growth if the covariance of the free numbers is given.
    fn fastest_growth_and_interval(
        &self,
        case: usize,
        plan: &Plan,
        covariance: Option<&[Vec<f64>]>,
    ) -> Option<(Growth, Option<[f64; 2]>)> {
        let x = self.x;
        let (_, spin) = self.problem.machine(case, x);
        let step_rpm =
            spin.max_speed_rad_per_s(plan.end_s) * 60.0 / TAU / f64::from(GROWTH_SPEED_COUNT);
        let speeds: Vec<f64> = (GROWTH_SPEED_COUNT / 5..=GROWTH_SPEED_COUNT)
            .map(|k| step_rpm * f64::from(k))
            .filter(|speed| *speed > 0.0)
            .collect();
        let growth = fastest_growth(&self.find_responses_at(case, plan, (x, &[]), &speeds)?)?;
        let interval = covariance.and_then(|covariance| {
            self.growth_interval_95(case, plan, (&growth, step_rpm), covariance)
        });
        Some((growth, interval))
    }

    /// Returns the responses of a case's machine at some speeds, with changed fixed numbers.
    fn find_responses_at(
        &self,
        case: usize,
        plan: &Plan,
        (x, fixed_changes): (&[f64], &[(MachineParameter, f64)]),
        speeds: &[f64],
    ) -> Option<Vec<Result<Vec<Response>, Status>>> {
        let (mut machine, mut spin) = self.problem.machine(case, x);
        for (parameter, change) in fixed_changes {
            if let Some(value) = parameter.get(&machine, &spin) {
                parameter.set(&mut machine, &mut spin, value + change);
            }
        }
        if !machine.violations().is_empty() {
            return None;
        }
        let point = prepare_point(machine, spin, &timing(plan)).ok()?;
        let held_speeds: Vec<HeldSpeed<'_>> =
            speeds.iter().map(|&speed_rpm| HeldSpeed { point: &point, speed_rpm }).collect();
        Some(find_responses(&held_speeds, self.problem.cancel))
    }

    /// Computes the 95 % interval of the greatest growth. Its variance is that of the free numbers'
    /// noise and of the fixed numbers' errors, with the compensation by the free numbers, to first
    /// order. The upper end includes growth between two speeds. The result is `None` if a varied
    /// machine has no response.
    fn growth_interval_95(
        &self,
        case: usize,
        plan: &Plan,
        (growth, step_rpm): (&Growth, f64),
        covariance: &[Vec<f64>],
    ) -> Option<[f64; 2]> {
        let x = self.x;
        let middle_rpm = growth.fastest.speed_rpm;
        let speeds = [middle_rpm - step_rpm, middle_rpm, middle_rpm + step_rpm];
        let growths_at = |x: &[f64],
                          fixed_changes: &[(MachineParameter, f64)]|
         -> Option<Vec<f64>> {
            let responses = self.find_responses_at(case, plan, (x, fixed_changes), &speeds)?;
            responses
                .iter()
                .map(|response_result| Some(response_result.as_ref().ok()?.first()?.growth_per_s()))
                .collect()
        };
        let greatest_growth =
            |growths: &[f64]| growths.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let fitted_growths = growths_at(x, &[])?;
        let mut slopes = vec![0.0; covariance.len()];
        for (k, free) in self.problem.free_parameters.iter().enumerate() {
            let error = covariance[k][k].max(0.0).sqrt();
            if !free.belongs_to(case) || error == 0.0 {
                continue;
            }
            let mut varied_unknowns = x.to_vec();
            let step = if x[k] + error > free.range[1] { -error } else { error };
            varied_unknowns[k] = (x[k] + step).max(free.range[0]);
            let growth_change = greatest_growth(&growths_at(&varied_unknowns, &[])?)
                - greatest_growth(&fitted_growths);
            if varied_unknowns[k] != x[k] {
                slopes[k] = growth_change / (varied_unknowns[k] - x[k]);
            }
        }
        let mut variance: f64 =
            covariance.iter().zip(&slopes).map(|(row, slope)| slope * dot(row, &slopes)).sum();
        for direction in self.statistics.influences.directions.iter().take(MAX_MARGIN_DIRECTIONS) {
            // A number at an end of its range can change in one direction only.
            let varied_growths = [1.0, -1.0].into_iter().find_map(|sign| {
                let varied_value = |(k, (x, by)): (usize, (&f64, &f64))| {
                    let [from, to] = self.problem.unknown_range(k);
                    (x - sign * by).clamp(from, to)
                };
                let unknowns_and_effects = x.iter().zip(&direction.effects).enumerate();
                let varied: Vec<f64> = unknowns_and_effects.map(varied_value).collect();
                let changes = direction.changes.iter();
                let signed_changes: Vec<(MachineParameter, f64)> =
                    changes.map(|(parameter, by)| (parameter.clone(), sign * by)).collect();
                growths_at(&varied, &signed_changes)
            });
            let change = greatest_growth(&varied_growths?) - greatest_growth(&fitted_growths);
            variance += change * change;
        }
        let half_width = Z_975 * variance.max(0.0).sqrt();
        // The vertex of the parabola through three neighbours is at most this far above the middle.
        let rise_between_speeds =
            (2.0 * fitted_growths[1] - fitted_growths[0] - fitted_growths[2]).max(0.0) / 8.0;
        let fitted_growth_per_s = growth.fastest.growth_per_s();
        Some([
            fitted_growth_per_s - half_width,
            fitted_growth_per_s + half_width + rise_between_speeds,
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_margin_within_its_error_is_at_the_edge() {
        let format_margin = |growth: f64, interval: Option<[f64; 2]>| {
            let verdict = FittedVerdict {
                reliable: None,
                ratio_max: None,
                ratio_limit: 1.2,
                probability_reliable: None,
                ratio_max_95: None,
                draws: 0,
                growth_per_s: Some(growth),
                growth_at_rpm: Some(250.0),
                growth_95: interval,
                growth_on_curve: Some(true),
            };
            verdict.margin_text(&|value| format!("{value:.1}")).unwrap()
        };
        for (growth, interval, expected_text) in [
            (
                0.1,
                Some([-0.1, 0.3]),
                "at the edge of a band of instability, within its error: \
                disturbances grow by 0.1 /s (-0.1 to 0.3 in 95 %) at 250 rpm",
            ),
            (
                -0.1,
                Some([-0.3, 0.1]),
                "at the edge of a band of instability, within its error: \
                disturbances die away by 0.1 /s (-0.1 to 0.3 in 95 %) at 250 rpm",
            ),
            (
                0.2,
                Some([0.1, 0.3]),
                "inside a band of instability: disturbances grow by 0.2 /s \
                (0.1 to 0.3 in 95 %) at 250 rpm",
            ),
            (
                -0.2,
                Some([-0.3, -0.1]),
                "outside every band of instability: disturbances die away \
                by 0.2 /s (0.1 to 0.3 in 95 %) at 250 rpm",
            ),
            (
                -0.2,
                None,
                "outside every band of instability: disturbances die away by 0.2 /s at \
                250 rpm",
            ),
        ] {
            assert_eq!(format_margin(growth, interval), expected_text);
        }
    }
}

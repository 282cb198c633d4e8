//! The report of a fit: one structure, as text and as JSON.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;
use washer_model::MethodKind;

use super::algebra::{dot, interval_95, subtract_mean};
use super::model::{Problem, SignalComparison};
use super::search::Descent;
use super::speed::SmoothedSpin;
use super::statistics::{Statistics, Z_975};
use super::verdict::{FittedMap, FittedVerdict};
use crate::config;
use sweep_engine::Error;
use sweep_engine::commands::cells::{Lines as _, format_range, format_table};
use sweep_engine::config::section::format_count;

/// The greatest factor between a signal's size and the model's size in another unit at which the
/// signal is reported to be in that unit. Basis: models of the test data differ from their records
/// by less. Doubling it names wrong units of more records.
const MAX_UNIT_MISMATCH: f64 = 1.5;
/// The ratio of the error of a fixed number after the fit to its tolerance, below which the report
/// says that the record limits the error. Basis: a ratio nearer to 1 does not change two digits of
/// an interval. At twice this ratio the report says so of every number.
const RECORD_LIMIT_RATIO: f64 = 0.9;
/// The objection to a fit whose search did not converge.
const UNFINISHED_SEARCH_OBJECTION: &str = "not known: the search did not come to its end, so no \
                                 intervals; expected a nearer start (`--set NAME=VALUE`), ranges, \
                                 or fewer `--free`";

/// A map from names of columns to numbers.
type NumbersByColumn<T> = BTreeMap<String, T>;

/// The result of a fit. Numbers that are not known are null.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct FitReport {
    /// Whether the model is known to follow the measurement within its noise. If not, there are no
    /// intervals.
    pub(crate) follows: bool,
    /// The reason why the model is not known to follow the measurement.
    pub(crate) objection: Option<String>,
    pub(crate) parameters: Vec<FittedNumber>,
    /// The rows of the correlation matrix, in the order of the parameters.
    pub(crate) correlations: Vec<Vec<f64>>,
    /// Descriptions of the combinations of parameters that the data do not determine.
    #[serde(rename = "untold")]
    pub(crate) undetermined: Vec<String>,
    /// The number of fixed numbers that have a tolerance.
    pub(crate) fixed_numbers: usize,
    /// The report of the first file, which is also the first entry of `files`.
    #[serde(flatten)]
    pub(crate) first: FileReport,
    pub(crate) files: Vec<FileReport>,
    /// All minima, the least first.
    pub(crate) minima: Vec<Minimum>,
    /// Whether the search converged.
    #[serde(rename = "settled")]
    pub(crate) is_converged: bool,
    /// The number of points at which the model and its derivatives were computed.
    pub(crate) evaluations: usize,
    /// The integration's step (s), if it is fixed.
    pub(crate) step_s: Option<f64>,
    /// The greatest change of a parameter, in standard errors, when the integration step is halved.
    pub(crate) step_effect: Option<f64>,
    /// The columns of speeds and times that seem to be in another unit, a clause each.
    pub(crate) suspected_units: Vec<String>,
    /// Notes on units, clocks and gaps.
    pub(crate) notes: Vec<String>,
}

/// A fitted number.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct FittedNumber {
    pub(crate) name: String,
    pub(crate) unit: String,
    /// The file to which the value belongs; `None` if all files share the value.
    pub(crate) file: Option<String>,
    pub(crate) start: f64,
    pub(crate) value: f64,
    pub(crate) standard_error: Option<f64>,
    /// The standard error by the measurement's noise alone.
    pub(crate) noise_error: Option<f64>,
    /// The fixed number whose tolerance changes the fitted value most.
    pub(crate) depends_on: Option<Dependence>,
    /// The 95 % interval within the range of the number.
    pub(crate) interval_95: Option<[f64; 2]>,
    /// The 95 % interval from fits to resampled residuals (`--bootstrap`).
    pub(crate) bootstrap_95: Option<[f64; 2]>,
    /// Whether the value is at a limit of its range.
    #[serde(rename = "at_bound")]
    pub(crate) is_at_bound: bool,
}

/// The dependence of a fitted number on a fixed one.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Dependence {
    pub(crate) name: String,
    pub(crate) unit: String,
    /// The standard deviation of the fixed number.
    pub(crate) tolerance: f64,
    /// The standard deviation of the fixed number after the fit, which the record may have reduced.
    pub(crate) error: f64,
    /// The change of the fitted number by `error`.
    pub(crate) moves_by: f64,
}

impl FittedNumber {
    /// Returns the parameter's name, followed by its file in parentheses if the value belongs to
    /// one file.
    fn label_with_file(&self) -> String {
        let file = self.file.iter().map(|file| format!(" ({file})"));
        std::iter::once(self.name.clone()).chain(file).collect()
    }
}

/// The report of a measurement.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct FileReport {
    pub(crate) file: String,
    pub(crate) samples: usize,
    /// The standard deviation of the part of the residual that is noise.
    pub(crate) noise: NumbersByColumn<f64>,
    pub(crate) offset: NumbersByColumn<f64>,
    /// The time (s) by which the model's clock is ahead.
    pub(crate) shift_s: Option<f64>,
    pub(crate) residual_rms: NumbersByColumn<f64>,
    /// The part of the variance that the model explains.
    #[serde(rename = "explained")]
    pub(crate) explained_ratio: NumbersByColumn<f64>,
    /// The correlation of neighbouring residuals.
    pub(crate) autocorrelation: NumbersByColumn<f64>,
    /// The variance inflation factor of correlated residuals.
    #[serde(rename = "widening")]
    pub(crate) variance_inflation: NumbersByColumn<f64>,
    /// The noise (rpm) and the knots of the measured spin.
    pub(crate) spin: Option<SmoothedSpin>,
    pub(crate) gaps_s: Vec<[f64; 2]>,
    /// The fitted machine, as a machine file has it.
    pub(crate) machine: Value,
    pub(crate) verdict: Option<FittedVerdict>,
}

/// A minimum of the cost.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Minimum {
    pub(crate) values: NumbersByColumn<f64>,
    /// Twice the logarithm of the likelihood ratio to the first minimum.
    pub(crate) cost_above: f64,
    pub(crate) evaluations: usize,
}

/// The data of a report.
pub(super) struct ReportData<'a> {
    pub(super) problem: &'a Problem<'a>,
    /// For each case, the statement that its speed or time seems to be in another unit; `None` if
    /// it does not.
    pub(super) suspected_unit_by_case: &'a [Option<String>],
    pub(super) minima: &'a [Descent],
    pub(super) comparisons: &'a [SignalComparison],
    pub(super) start_comparisons: &'a [SignalComparison],
    pub(super) statistics: &'a Statistics,
    pub(super) evaluations: usize,
    pub(super) step_effect: Option<f64>,
    pub(super) bootstrap_fits: Option<&'a [Vec<f64>]>,
    /// The number of samples drawn from the fitted distribution for the verdict's probability.
    pub(super) draws: u64,
}

impl ReportData<'_> {
    /// Returns the report of the fit.
    pub(super) fn report(&self) -> Result<FitReport, Error> {
        let Self { problem, statistics, .. } = *self;
        let best = &self.minima[0];
        let suspected_units: Vec<String> =
            self.suspected_unit_by_case.iter().flatten().cloned().collect();
        // If a unit is suspected, the search is limited to a few evaluations. Its early end is then
        // no reason to reject the fit.
        let is_unfinished = !best.is_converged && suspected_units.is_empty();
        let unfinished_objection = is_unfinished.then(|| UNFINISHED_SEARCH_OBJECTION.to_owned());
        let objection = unfinished_objection.or_else(|| statistics.objection(problem));
        let follows = objection.is_none();
        let covariance = statistics.free_covariance(problem);
        let noise_covariance = statistics.noise_covariance(problem);
        let standard_error = |k: usize| covariance[k][k].max(0.0).sqrt();
        let noise_standard_error = |k: usize| noise_covariance[k][k].max(0.0).sqrt();
        let free_count = problem.free_parameters.len();
        let correlation_of = |i: usize, j: usize| match standard_error(i) * standard_error(j) {
            _ if i == j => 1.0,
            error_product if error_product > 0.0 => covariance[i][j] / error_product,
            _ => 0.0,
        };
        let correlation_row = |i: usize| (0..free_count).map(|j| correlation_of(i, j)).collect();
        let file_reports = (0..problem.cases.len()).map(|case| self.file_report(case, follows));
        let file_reports = file_reports.collect::<Result<Vec<FileReport>, Error>>()?;
        let parameters: Vec<FittedNumber> = (0..free_count)
            .map(|k| self.fitted_number(k, [standard_error(k), noise_standard_error(k)], follows))
            .collect();
        let report_minimum = |descent: &Descent| Minimum {
            values: parameters
                .iter()
                .map(FittedNumber::label_with_file)
                .zip(descent.x.iter().copied())
                .collect(),
            cost_above: descent.equations.cost - best.equations.cost,
            evaluations: descent.evaluations,
        };
        Ok(FitReport {
            follows,
            objection,
            correlations: (0..free_count).map(correlation_row).collect(),
            undetermined: statistics.describe_undetermined(problem, &best.x),
            fixed_numbers: statistics.influences().len(),
            first: file_reports[0].clone(),
            files: file_reports,
            minima: self.minima.iter().map(report_minimum).collect(),
            parameters,
            is_converged: best.is_converged,
            evaluations: self.evaluations,
            step_s: (problem.method.kind == MethodKind::Rk4).then_some(problem.method.step_s),
            step_effect: self.step_effect,
            suspected_units,
            notes: self.notes(),
        })
    }

    fn fitted_number(
        &self,
        k: usize,
        [error, noise_error]: [f64; 2],
        follows: bool,
    ) -> FittedNumber {
        let free_parameter = &self.problem.free_parameters[k];
        let value = self.minima[0].x[k];
        let is_at_bound = free_parameter.range.contains(&value);
        let has_interval = follows && !is_at_bound && error > 0.0;
        let [range_from, range_to] = self.problem.unknown_range(k);
        let noise_half_width = self.statistics.quantiles[k] * noise_error;
        let fixed_variance = Z_975 * Z_975 * (error * error - noise_error * noise_error).max(0.0);
        let half_width = (noise_half_width * noise_half_width + fixed_variance).sqrt();
        let interval = [(value - half_width).max(range_from), (value + half_width).min(range_to)];
        FittedNumber {
            name: free_parameter.parameter.name().to_owned(),
            unit: free_parameter.parameter.unit().to_owned(),
            file: free_parameter.case.map(|case| self.problem.cases[case].measurement.name.clone()),
            start: free_parameter.start,
            value,
            standard_error: has_interval.then_some(error),
            noise_error: has_interval.then_some(noise_error),
            depends_on: has_interval.then(|| self.strongest_dependence(k)).flatten(),
            interval_95: has_interval.then_some(interval),
            bootstrap_95: self
                .bootstrap_fits
                .and_then(|bootstrap_fits| interval_95(bootstrap_fits.iter().map(|x| x[k]))),
            is_at_bound,
        }
    }

    /// Returns the strongest dependence of a free number on a fixed one.
    fn strongest_dependence(&self, k: usize) -> Option<Dependence> {
        let influences = self.statistics.influences().iter();
        let strongest_influence =
            influences.max_by(|a, b| a.effects[k].abs().total_cmp(&b.effects[k].abs()))?;
        Some(Dependence {
            name: strongest_influence.name.clone(),
            unit: strongest_influence.unit.to_owned(),
            tolerance: strongest_influence.tolerance,
            error: strongest_influence.error,
            moves_by: strongest_influence.effects[k],
        })
    }

    fn file_report(&self, case: usize, follows: bool) -> Result<FileReport, Error> {
        let problem = self.problem;
        let x = &self.minima[0].x;
        let measurement = &problem.cases[case].measurement;
        let fitted_map = FittedMap { problem, x, statistics: self.statistics, draws: self.draws };
        let case_comparisons = || {
            let numbered_comparisons = problem.signals().zip(self.comparisons).enumerate();
            numbered_comparisons.filter(move |(_, ((signal_case, ..), _))| *signal_case == case)
        };
        let numbers_by_column =
            |value: &dyn Fn(usize, &SignalComparison) -> f64| -> NumbersByColumn<f64> {
                case_comparisons()
                    .map(|(k, ((.., signal), comparison))| {
                        (signal.quantity.column(), value(k, comparison))
                    })
                    .collect()
            };
        let residual_rms = |comparison: &SignalComparison| {
            (dot(&comparison.residual, &comparison.residual) / comparison.residual.len() as f64)
                .sqrt()
        };
        Ok(FileReport {
            file: measurement.name.clone(),
            samples: measurement.count_samples(),
            noise: numbers_by_column(&|k, comparison| {
                residual_rms(comparison) * (1.0 - self.statistics.motion_ratios[k][0]).sqrt()
            }),
            offset: numbers_by_column(&|_, comparison| comparison.offset),
            shift_s: problem.fits_shift.then(|| problem.shift_s(case, x)),
            residual_rms: numbers_by_column(&|_, comparison| residual_rms(comparison)),
            explained_ratio: numbers_by_column(&|k, _| self.statistics.explained_ratios[k]),
            autocorrelation: numbers_by_column(&|k, _| self.statistics.neighbour_correlations[k]),
            variance_inflation: numbers_by_column(&|k, _| self.statistics.variance_inflation[k]),
            spin: problem.cases[case].smoothed_spin.clone(),
            gaps_s: measurement.gaps_s.clone(),
            machine: config::machine_json(&problem.machine(case, x).0),
            verdict: (self.draws > 0).then(|| fitted_map.verdict(case, follows)).transpose()?,
        })
    }

    /// Returns notes on units, clocks and gaps.
    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        // The start may be wrong by the factor of a unit. It is if channels of several units
        // follow, because no number of the machine compensates for the unit of one of them.
        let mistaken_units =
            || self.problem.signals().map(|(.., signal)| signal.quantity.units().1);
        let have_one_unit = mistaken_units().all(|unit| Some(unit) == mistaken_units().next());
        let considers_start = have_one_unit || self.statistics.objection(self.problem).is_some();
        let signals =
            self.problem.signals().zip(self.comparisons.iter().zip(self.start_comparisons));
        for ((case, _, signal), (end_comparison, start_comparison)) in signals {
            // A model at wrong speeds does not show the unit of a channel.
            if self.suspected_unit_by_case[case].is_some() {
                continue;
            }
            let (unit, unit_by_mistake) = signal.quantity.units();
            let Some((other_unit, factor)) = unit_by_mistake else { continue };
            let centred_values = signal.centred_values();
            let signal_to_model_ratio = |comparison: &SignalComparison| {
                let model_values = signal.samples().map(|(row, _)| comparison.model_values[row]);
                let (model_values, _) = subtract_mean(model_values.collect());
                (dot(&centred_values, &centred_values) / dot(&model_values, &model_values)).sqrt()
            };
            let ratios = [
                Some(signal_to_model_ratio(end_comparison)),
                considers_start.then(|| signal_to_model_ratio(start_comparison)),
            ];
            let is_near_factor = |size: f64, factor: f64| {
                (1.0 / MAX_UNIT_MISMATCH..MAX_UNIT_MISMATCH).contains(&(size / factor))
            };
            let converted_twice = format!("have been converted from {other_unit} once too often");
            let column = signal.quantity.column();
            let file = &self.problem.cases[case].measurement.name;
            for (factor, correction) in
                [(factor, format!("be in {other_unit}")), (1.0 / factor, converted_twice)]
            {
                let ratio = ratios.into_iter().flatten().find(|size| is_near_factor(*size, factor));
                notes.extend(ratio.map(|size| {
                    format!(
                        "{column} of {file} is {size:.3} times as large as the model's: it seems \
                         to {correction} ({factor:.4}), expected {unit}"
                    )
                }));
            }
        }
        for case in &self.problem.cases {
            let measurement = &case.measurement;
            if let Some(start) = measurement.clock_start() {
                notes.push(format!(
                    "{}: its clock reads {start} at the first row; the run is taken to begin \
                     there",
                    measurement.name
                ));
            }
            if measurement.rows_before_start > 0 {
                let rows = format_count(measurement.rows_before_start, "row");
                notes.push(format!("{}: {rows} before time 0 left out", measurement.name));
            }
            for [from, to] in &measurement.gaps_s {
                notes.push(format!("{} has no rows from {from} to {to} s", measurement.name));
            }
            if let Some(first) = case.first_rpm().filter(|first| first.abs() > 5.0) {
                notes.push(format!(
                    "{} begins at {first:.1} rpm: the model starts at rest there, and is not the \
                     machine's before its start has died away",
                    measurement.name
                ));
            }
        }
        notes
    }
}

impl FitReport {
    /// Formats the report as a command prints it.
    pub(crate) fn to_text(&self) -> String {
        let format_short = |value: f64| {
            if value == 0.0 || (1e-3..1e5).contains(&value.abs()) {
                let digits = (5 - value.abs().log10().floor().clamp(-4.0, 5.0) as i32).max(0);
                format!("{value:.*}", digits as usize)
            } else {
                format!("{value:.4e}")
            }
        };
        let format_interval = |ends| format_range(ends, format_short);
        let table_row = |fit: &FittedNumber| {
            let unknown = if fit.is_at_bound { "at its bound" } else { "not known" };
            let interval_text = fit.interval_95.map_or_else(|| unknown.to_owned(), format_interval);
            let error_text = fit.standard_error.map_or_else(|| "-".to_owned(), format_short);
            let mut cells = vec![
                fit.label_with_file(),
                fit.unit.clone(),
                format_short(fit.value),
                error_text,
                interval_text,
            ];
            cells.extend(fit.bootstrap_95.map(format_interval));
            cells
        };
        let rows: Vec<Vec<String>> = self.parameters.iter().map(table_row).collect();
        let mut headings =
            ["", "unit", "value", "standard error", "95 % interval"].map(str::to_owned).to_vec();
        if self.parameters.iter().any(|fit| fit.bootstrap_95.is_some()) {
            headings.push("by bootstrap".to_owned());
        }
        let mut text = String::new();
        let model_text = match &self.objection {
            None => "follows the measurement within its noise".to_owned(),
            Some(reason) if reason == UNFINISHED_SEARCH_OBJECTION => reason.clone(),
            Some(reason) => {
                format!("does not follow the measurement: {reason}; so no intervals")
            }
        };
        text.line("model", model_text);
        self.suspected_units.iter().for_each(|clause| text.line("unit", clause));
        // Without free parameters there is no table of fitted values.
        if !rows.is_empty() {
            text.push_str(&format_table(&headings, &rows, ""));
        }
        let mut add_line = |heading: &str, text_of_line: &str| text.line(heading, text_of_line);
        self.undetermined.iter().for_each(|text| add_line("untold", text));
        for fit in &self.parameters {
            let Some(fixed) = &fit.depends_on else { continue };
            let error_text = format!("{} {}", format_short(fixed.error), fixed.unit);
            // An error that is clearly below the tolerance shows that the record limits it.
            let limit_text = if fixed.error < RECORD_LIMIT_RATIO * fixed.tolerance {
                format!(" (of {}: the record limits it)", format_short(fixed.tolerance))
            } else {
                String::new()
            };
            let effect_text = format!(
                "{} on {}: an error of {}{limit_text} moves it by {} {}, most of {}",
                fit.label_with_file(),
                fixed.name,
                error_text.trim_end(),
                format_short(fixed.moves_by.abs()),
                fit.unit,
                format_count(self.fixed_numbers, "fixed number"),
            );
            let noise_text = fit.noise_error.map_or_else(|| "-".to_owned(), format_short);
            add_line(
                "depends",
                &format!("{effect_text}; by noise alone its standard error is {noise_text}"),
            );
        }
        if self.follows && self.fixed_numbers == 0 && !self.parameters.is_empty() {
            add_line("depends", "on nothing: fixed numbers are taken as exact");
        }
        for file in &self.files {
            let column_text = |(column, noise): (&String, &f64)| {
                let explained_ratio = file.explained_ratio.get(column).copied().unwrap_or_default();
                let residual = 100.0 * (1.0 - explained_ratio).max(0.0).sqrt();
                format!("{column} {} ({residual:.1} %)", format_short(*noise))
            };
            let column_texts: Vec<String> = file.noise.iter().map(column_text).collect();
            add_line("file", &format!("{}: {} samples", file.file, file.samples));
            add_line("noise", &format!("{} (residual over signal)", column_texts.join(", ")));
            if let Some(shift_s) = file.shift_s {
                let direction = if shift_s < 0.0 { "late" } else { "early" };
                add_line("clock", &format!("{:.6} s {direction}", shift_s.abs()));
            }
            if let Some(spin) = &file.spin {
                let noise_text = format_short(spin.noise_rpm);
                add_line(
                    "spin",
                    &format!("measured: {} knots, noise {noise_text} rpm", spin.knots),
                );
            }
            if let Some(verdict) = &file.verdict {
                let verdict_text = match verdict.reliable {
                    Some(true) => "reliable",
                    Some(false) => "not reliable",
                    None => "undefined",
                };
                let ratio_text = verdict
                    .ratio_max
                    .map(|ratio| format!(", greatest ratio {}", format_short(ratio)));
                let ratio_text = ratio_text.unwrap_or_default();
                let probability_text = match (verdict.probability_reliable, verdict.ratio_max_95) {
                    (Some(probability), Some(ratio_range)) => format!(
                        "; reliable with probability {probability:.3} (ratio {} in 95 % of {} \
                         rows)",
                        format_interval(ratio_range),
                        verdict.draws
                    ),
                    _ => "; no probability, because the intervals are not known".to_owned(),
                };
                // If the model does not follow the measurement, its verdict does not hold for the
                // measured machine.
                let scope_text = if self.follows { "" } else { "of the numbers above alone: " };
                add_line(
                    "verdict",
                    &format!("{scope_text}{verdict_text}{ratio_text}{probability_text}"),
                );
                if let Some(margin) = verdict.margin_text(&format_short) {
                    add_line("margin", &format!("{scope_text}{margin}"));
                }
            }
        }
        for (k, minimum) in self.minima.iter().enumerate().skip(1) {
            let value_texts: Vec<String> = minimum
                .values
                .iter()
                .map(|(name, x)| format!("{name} {}", format_short(*x)))
                .collect();
            let cost_text = format_short(minimum.cost_above);
            add_line(
                "minimum",
                &format!("{}: {}, cost above {cost_text}", k + 1, value_texts.join(", ")),
            );
        }
        let effect_text = self.step_effect.map_or_else(String::new, |effect| {
            format!("; half the step moves numbers by {effect:.3} standard errors at most")
        });
        add_line("search", &format!("{} evaluations{effect_text}", self.evaluations));
        self.notes.iter().for_each(|note| add_line("note", note));
        text
    }
}

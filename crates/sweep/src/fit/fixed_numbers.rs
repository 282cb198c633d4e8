//! Tolerances of the numbers that are not fitted, and how estimates depend on them.
//!
//! An estimate is computed with the fixed numbers of its machine. If these have errors d, the free
//! numbers compensate for them in part. Let J be the slopes of the model by the unknowns, K those
//! by the fixed numbers in standard deviations, W the weights, A = J' W J, and r the residual. To
//! first order, unknowns and fixed numbers together have the posterior information [J K]' W [J K] +
//! diag(0, 1), since d has the covariance 1 before the record. By its Schur complement, with B =
//! A^-1 J' W K and M = 1 - J A^-1 J' W,
//!
//! - d has the covariance S = (1 + K' M' W M K)^-1 and the mean m = S K' M' W r,
//! - the unknowns have the covariance A^-1 + B S B', and their mean is B m below the estimate.
//!
//! The estimate keeps d = 0, so that the fitted machine with its fixed numbers follows the record.
//! The mean square of its error is the unknowns' covariance and the square of their mean's distance
//! from it, A^-1 + B (S + m m') B'. Averaged over records, S + m m' is 1, the covariance of d.
//!
//! A. Tarantola, Inverse Problem Theory and Methods for Model Parameter Estimation (2005), chapter
//! 3: the least-squares criterion.

use washer_model::{Machine, MachineParameter, Spin, Target};

use super::algebra::{EigenDecomposition, add_outer, dot, pseudo_inverse, subtract_mean};
use super::measurement::Signal;
use super::model::{FitCase, FreeParameter, NormalEquations, Problem, SignalComparison};
use sweep_engine::Diagnostics;
use sweep_engine::config::{Location, Report as Mistakes};

/// The word among the options by which numbers without a given tolerance are taken as exact.
const EXACT_NUMBERS_OPTION: &str = "none";
/// The name of the sensors' gains among the fixed numbers.
const GAIN_NAME: &str = "gain";
/// The default standard deviation of a sensor's gain, relative to the gain. Basis: an accelerometer
/// that is not calibrated itself. Doubling it doubles what gains add to intervals.
const DEFAULT_GAIN_TOLERANCE: f64 = 0.03;
/// The step of the difference quotient by a fixed number, in units of its tolerance. Basis: a
/// relative change of some 1e-3, as far from rounding as from curvature. Doubling it doubles the
/// derivative's error by curvature.
const DERIVATIVE_STEP: f64 = 0.02;
/// The greatest number of stored derivatives by fixed numbers. In longer records only every `n`th
/// sample is stored and counts `n` times. Basis: 160 MB. Doubling it doubles the memory.
const MAX_SLOPE_VALUES: usize = 20_000_000;

/// The endings of the names of lengths that are too short for a tape measure.
const SHORT_LENGTH_SUFFIXES: [&str; 2] = ["clearance_m", "softness_m"];

/// The standard deviation of a fixed number, relative to the number or in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
enum FixedTolerance {
    Relative(f64),
    Absolute(f64),
}

impl FixedTolerance {
    /// Returns the default tolerance of a number by its name and unit. Basis: masses by a scale;
    /// lengths by a tape measure along bent sheet, short ones by a caliper; the place of a load by
    /// eye; moments of inertia from drawings without ribs; springs from a catalogue; dampers and
    /// friction are hardly known better. Doubling one doubles what numbers of its kind add to
    /// intervals, unless the record limits them.
    fn default_for(name: &str, unit: &str) -> Self {
        match unit {
            "kg" => Self::Relative(0.02),
            "m" if name.ends_with("radius_m") => Self::Relative(0.05),
            "m" if SHORT_LENGTH_SUFFIXES.iter().any(|end| name.ends_with(end)) => {
                Self::Relative(0.1)
            }
            "m" => Self::Absolute(0.005),
            "kg m^2" | "N/m" => Self::Relative(0.05),
            // The acceleration of gravity is known exactly enough.
            "m/s^2" => Self::Relative(0.0),
            _ => Self::Relative(0.1),
        }
    }

    /// Parses a percentage such as `2%`, or a number in the parameter's unit.
    fn parse(text: &str) -> Option<Self> {
        let trimmed_text = text.trim();
        let (number, is_percent) = match trimmed_text.strip_suffix('%') {
            Some(number) => (number.trim(), true),
            None => (trimmed_text, false),
        };
        let number: f64 = number.parse().ok()?;
        let is_valid = number.is_finite() && number >= 0.0;
        is_valid.then_some(if is_percent {
            Self::Relative(number / 100.0)
        } else {
            Self::Absolute(number)
        })
    }

    /// Returns the standard deviation of a number.
    fn standard_deviation(self, value: f64) -> f64 {
        match self {
            Self::Relative(ratio) => ratio * value.abs(),
            Self::Absolute(deviation) => deviation,
        }
    }
}

/// The fixed numbers of a fit with their tolerances.
#[derive(Clone, Debug, Default)]
pub(super) struct FixedNumbers {
    tolerances: Vec<(MachineParameter, f64)>,
    gain_tolerance: f64,
}

/// The effect of a fixed number's error on the unknowns.
#[derive(Clone, Debug)]
pub(crate) struct FixedInfluence {
    pub(crate) name: String,
    pub(crate) unit: &'static str,
    /// The standard deviation of the fixed number before the fit.
    pub(crate) tolerance: f64,
    /// The standard deviation of the fixed number after the fit.
    pub(crate) error: f64,
    /// The parameter of the machine; `None` for the gain of a sensor.
    pub(crate) parameter: Option<MachineParameter>,
    /// The mean change of each unknown by `error`, including the errors of other fixed numbers that
    /// correlate with it after the fit. Exact knowledge of the number would reduce the errors of
    /// the unknowns by this change.
    pub(crate) effects: Vec<f64>,
}

/// A principal direction of the errors of all fixed numbers: errors of one standard deviation,
/// which are independent of the errors along the other directions.
#[derive(Clone, Debug)]
pub(crate) struct ErrorDirection {
    /// The changes of the machine's numbers.
    pub(crate) changes: Vec<(MachineParameter, f64)>,
    /// The change of each unknown.
    pub(crate) effects: Vec<f64>,
}

/// The effects of all fixed numbers.
#[derive(Clone, Debug, Default)]
pub(crate) struct FixedInfluences {
    /// The effect of each fixed number, in descending order of the effect on any unknown.
    pub(crate) numbers: Vec<FixedInfluence>,
    /// The addition to the covariance of the unknowns.
    pub(crate) covariance: Vec<Vec<f64>>,
    /// The principal directions of the errors, in descending order of the effect on any unknown.
    pub(crate) directions: Vec<ErrorDirection>,
}

/// The error of one standard deviation of a fixed number, and its effect on the signals.
struct FixedError {
    influence: FixedInfluence,
    /// The change of every signal at every `stride`th sample.
    signal_changes: Vec<Vec<f64>>,
}

impl FixedNumbers {
    /// Reads the given tolerances. All other numbers of the machine that are not free have default
    /// tolerances, unless `none` is among the options.
    ///
    /// # Errors
    /// Returns every mistake in the tolerances.
    pub(super) fn read(
        options: &[String],
        case: &FitCase,
        free: &[FreeParameter],
    ) -> Result<Self, Diagnostics> {
        let mistakes = Mistakes::default();
        let mut parameters: Vec<(MachineParameter, FixedTolerance)> = Vec::new();
        let mut given_gain: Option<FixedTolerance> = None;
        let is_exact_numbers_option = |text: &&String| text.trim() == EXACT_NUMBERS_OPTION;
        for text in options.iter().filter(|text| !is_exact_numbers_option(text)) {
            let location = Location::new(mistakes.add("--known", text.as_str()), 0..text.len());
            let refuse = |title: String| {
                let expected = "expected NAME=2% or NAME=0.01 in its unit, gain=3% or none";
                mistakes.refuse::<()>(&location, title, expected);
            };
            let Some((name, tolerance)) = text.split_once('=') else {
                refuse(format!("`{text}` has no tolerance"));
                continue;
            };
            let Some(tolerance) = FixedTolerance::parse(tolerance) else {
                refuse(format!("`{}` is no tolerance", tolerance.trim()));
                continue;
            };
            match (name.trim(), tolerance) {
                (GAIN_NAME, FixedTolerance::Relative(_)) => given_gain = Some(tolerance),
                (GAIN_NAME, FixedTolerance::Absolute(_)) => {
                    refuse("a gain's tolerance is a part".to_owned())
                }
                (name, _) => match find_fixed_numbers(name, case, free) {
                    Ok(numbers) => {
                        if tolerance == FixedTolerance::Relative(0.0)
                            || numbers
                                .iter()
                                .all(|(_, value)| tolerance.standard_deviation(*value) > 0.0)
                        {
                            let numbers = numbers.into_iter();
                            parameters.extend(numbers.map(|(number, _)| (number, tolerance)));
                        } else {
                            refuse(format!("`{name}` is 0: its tolerance is no part of it"));
                        }
                    }
                    Err(reason) => refuse(reason),
                },
            }
        }
        let uses_defaults = !options.iter().any(|text| is_exact_numbers_option(&text));
        let default_gain = if uses_defaults { DEFAULT_GAIN_TOLERANCE } else { 0.0 };
        let fixed_numbers = Self {
            tolerances: numbers_with_tolerances(case, free, &parameters, uses_defaults),
            gain_tolerance: given_gain.map_or(default_gain, |gain| gain.standard_deviation(1.0)),
        };
        mistakes.finish(Some(fixed_numbers))
    }

    /// Computes the dependence of the unknowns on the fixed numbers, on all threads of the current
    /// rayon pool. `variances` has the variance of each signal's noise for its independent samples.
    pub(super) fn influences(
        &self,
        problem: &Problem<'_>,
        x: &[f64],
        comparisons: &[SignalComparison],
        equations: &NormalEquations,
        variances: &[f64],
    ) -> FixedInfluences {
        let gain_count = if self.gain_tolerance > 0.0 { comparisons.len() } else { 0 };
        let sample_count: usize =
            comparisons.iter().map(|comparison| comparison.residual.len()).sum();
        let stride =
            (sample_count * (self.tolerances.len() + gain_count)).div_ceil(MAX_SLOPE_VALUES).max(1);
        let mut fixed_errors = self.machine_errors(problem, x, comparisons, equations, stride);
        if gain_count > 0 {
            fixed_errors.extend(self.gain_errors(problem, comparisons, equations, stride));
        }
        let inverse_normal_matrix = pseudo_inverse(&equations.normal_matrix);
        for FixedError { influence, .. } in &mut fixed_errors {
            influence.effects =
                inverse_normal_matrix.iter().map(|row| dot(row, &influence.effects)).collect();
        }
        let Posterior { covariance: posterior_covariance, mean } =
            compute_posterior(&fixed_errors, comparisons, variances, stride);
        let mut second_moment = posterior_covariance.clone();
        add_outer(&mut second_moment, &mean, 1.0);
        let unknowns = problem.unknown_count();
        // Multiplies B and a vector of errors in standard deviations.
        let combine_effects = |by: &[f64]| -> Vec<f64> {
            let mut sum_of_effects = vec![0.0; unknowns];
            for (FixedError { influence, .. }, component) in fixed_errors.iter().zip(by) {
                sum_of_effects
                    .iter_mut()
                    .zip(&influence.effects)
                    .for_each(|(sum, effect)| *sum += component * effect);
            }
            sum_of_effects
        };
        let changes_by_moment: Vec<Vec<f64>> =
            second_moment.iter().map(|row| combine_effects(row)).collect();
        let mut covariance = vec![vec![0.0; unknowns]; unknowns];
        for (FixedError { influence, .. }, unknown_changes) in
            fixed_errors.iter().zip(&changes_by_moment)
        {
            for (row, effect) in covariance.iter_mut().zip(&influence.effects) {
                row.iter_mut()
                    .zip(unknown_changes)
                    .for_each(|(sum, change)| *sum += effect * change);
            }
        }
        let strongest_effect = |effects: &[f64]| {
            let effects = effects.iter().enumerate();
            effects.fold(0.0_f64, |greatest, (k, effect)| {
                greatest.max(effect * effect / inverse_normal_matrix[k][k].max(1e-300))
            })
        };
        let eigen = EigenDecomposition::from_matrix(&second_moment);
        let principal_direction = |(value, vector): (&f64, &Vec<f64>)| {
            let deviation = value.max(0.0).sqrt();
            let error_components: Vec<f64> = vector.iter().map(|entry| deviation * entry).collect();
            let changes =
                fixed_errors.iter().zip(&error_components).filter_map(|(error, component)| {
                    let parameter = error.influence.parameter.clone()?;
                    Some((parameter, component * error.influence.tolerance))
                });
            ErrorDirection {
                changes: changes.collect(),
                effects: combine_effects(&error_components),
            }
        };
        let mut directions: Vec<ErrorDirection> =
            eigen.values.iter().zip(&eigen.vectors).map(principal_direction).collect();
        directions
            .sort_by(|a, b| strongest_effect(&b.effects).total_cmp(&strongest_effect(&a.effects)));
        let changes_by_covariance: Vec<Vec<f64>> =
            posterior_covariance.iter().map(|row| combine_effects(row)).collect();
        let mut numbers: Vec<FixedInfluence> =
            fixed_errors.into_iter().map(|error| error.influence).collect();
        for (k, influence) in numbers.iter_mut().enumerate() {
            let error_ratio = posterior_covariance[k][k].max(0.0).sqrt();
            influence.error = error_ratio * influence.tolerance;
            let effects = influence.effects.iter_mut().zip(&changes_by_covariance[k]);
            effects.for_each(|(effect, effect_on_unknowns)| {
                *effect = if error_ratio > 0.0 { effect_on_unknowns / error_ratio } else { 0.0 }
            });
        }
        numbers
            .sort_by(|a, b| strongest_effect(&b.effects).total_cmp(&strongest_effect(&a.effects)));
        FixedInfluences { numbers, covariance, directions }
    }

    /// Computes the effect on the signals of an error of one standard deviation of each number of
    /// the machine. The field `effects` has the change of the normal equations' right side, not yet
    /// that of the unknowns. The effect is zero if no valid machine has the changed number.
    fn machine_errors(
        &self,
        problem: &Problem<'_>,
        x: &[f64],
        comparisons: &[SignalComparison],
        equations: &NormalEquations,
        stride: usize,
    ) -> Vec<FixedError> {
        let unit_error = |(parameter, tolerance): &(MachineParameter, f64)| FixedError {
            influence: FixedInfluence {
                name: parameter.name().to_owned(),
                unit: parameter.unit(),
                tolerance: *tolerance,
                error: *tolerance,
                parameter: Some(parameter.clone()),
                effects: vec![0.0; x.len()],
            },
            signal_changes: comparisons
                .iter()
                .map(|comparison| vec![0.0; comparison.residual.len().div_ceil(stride)])
                .collect(),
        };
        let mut errors: Vec<FixedError> = self.tolerances.iter().map(unit_error).collect();
        for case in 0..problem.cases.len() {
            // A number at an end of its range can change in one direction only.
            let allowed_step = |k: usize| {
                let (mut machine, mut spin) = problem.machine(case, x);
                apply_change(&self.tolerances[k], DERIVATIVE_STEP, &mut machine, &mut spin);
                if machine.violations().is_empty() { DERIVATIVE_STEP } else { -DERIVATIVE_STEP }
            };
            let steps: Vec<f64> = (0..self.tolerances.len()).map(allowed_step).collect();
            let case_signals: Vec<usize> = (0..comparisons.len())
                .filter(|&signal| comparisons[signal].case_index == case)
                .collect();
            let project_changes = |changes: Vec<Vec<f64>>| {
                let mut rhs = vec![0.0; x.len()];
                let mut thinned_changes = Vec::with_capacity(changes.len());
                for (change, &signal) in changes.into_iter().zip(&case_signals) {
                    let change = subtract_mean(change).0;
                    let variance = equations.sigma[signal] * equations.sigma[signal];
                    for (rhs, slope) in rhs.iter_mut().zip(&comparisons[signal].slopes) {
                        *rhs += dot(slope, &change) / variance;
                    }
                    thinned_changes.push(change.into_iter().step_by(stride).collect::<Vec<f64>>());
                }
                (rhs, thinned_changes)
            };
            let apply_step = |k: usize, machine: &mut Machine, spin: &mut Spin| {
                apply_change(&self.tolerances[k], steps[k], machine, spin);
            };
            let projected_changes = problem.compute_changes(
                case,
                x,
                comparisons,
                (steps.len(), apply_step),
                project_changes,
            );
            for ((error, effect), step) in errors.iter_mut().zip(projected_changes).zip(&steps) {
                let Some((rhs, changes)) = effect else { continue };
                let unscaled_effects = error.influence.effects.iter_mut().zip(rhs);
                unscaled_effects.for_each(|(sum, rhs)| *sum += rhs / step);
                for (thinned_change, &signal) in changes.into_iter().zip(&case_signals) {
                    error.signal_changes[signal] =
                        thinned_change.into_iter().map(|value| value / step).collect();
                }
            }
        }
        errors
    }

    /// Computes the effect of an error of one standard deviation of each sensor's gain. The field
    /// `effects` has the change of the normal equations' right side, not yet that of the unknowns.
    fn gain_errors(
        &self,
        problem: &Problem<'_>,
        comparisons: &[SignalComparison],
        equations: &NormalEquations,
        stride: usize,
    ) -> Vec<FixedError> {
        let gain_error = |(k, ((.., signal), comparison)): (
            usize,
            ((usize, usize, &Signal), &SignalComparison),
        )| {
            let variance = equations.sigma[k] * equations.sigma[k];
            let gain_motion =
                signal.samples().map(|(row, _)| self.gain_tolerance * comparison.model_values[row]);
            let motion = subtract_mean(gain_motion.collect()).0;
            let mut signal_changes: Vec<Vec<f64>> = comparisons
                .iter()
                .map(|comparison| vec![0.0; comparison.residual.len().div_ceil(stride)])
                .collect();
            signal_changes[k] = motion.iter().copied().step_by(stride).collect();
            let influence = FixedInfluence {
                name: format!("{GAIN_NAME} of {}", signal.quantity.column()),
                unit: "",
                tolerance: self.gain_tolerance,
                error: self.gain_tolerance,
                parameter: None,
                effects: comparison
                    .slopes
                    .iter()
                    .map(|slope| dot(slope, &motion) / variance)
                    .collect(),
            };
            FixedError { influence, signal_changes }
        };
        problem.signals().zip(comparisons).enumerate().map(gain_error).collect()
    }
}

/// The distribution of the fixed numbers' errors after the fit, in units of their tolerances.
struct Posterior {
    covariance: Vec<Vec<f64>>,
    mean: Vec<f64>,
}

/// Computes the distribution of the fixed numbers' errors after the fit.
fn compute_posterior(
    errors: &[FixedError],
    comparisons: &[SignalComparison],
    variances: &[f64],
    stride: usize,
) -> Posterior {
    let weights: Vec<f64> =
        variances.iter().map(|variance| (stride as f64 / variance).sqrt()).collect();
    let weighted_residual: Vec<f64> = comparisons
        .iter()
        .zip(&weights)
        .flat_map(|(comparison, weight)| {
            comparison.residual.iter().step_by(stride).map(move |residual| weight * residual)
        })
        .collect();
    // Computes the part of a number's effect for which the unknowns do not compensate.
    let uncompensated_change = |error: &FixedError| -> Vec<f64> {
        let mut weighted_samples = Vec::with_capacity(weighted_residual.len());
        for ((change, comparison), weight) in
            error.signal_changes.iter().zip(comparisons).zip(&weights)
        {
            let mut remaining_change = change.clone();
            for (slope, effect) in comparison.slopes.iter().zip(&error.influence.effects) {
                let slope = slope.iter().step_by(stride);
                remaining_change
                    .iter_mut()
                    .zip(slope)
                    .for_each(|(change, slope)| *change -= effect * slope);
            }
            weighted_samples.extend(remaining_change.iter().map(|change| weight * change));
        }
        weighted_samples
    };
    let uncompensated_parts: Vec<Vec<f64>> = errors.iter().map(uncompensated_change).collect();
    let mut information = vec![vec![0.0; errors.len()]; errors.len()];
    for i in 0..errors.len() {
        for j in 0..=i {
            let product = dot(&uncompensated_parts[i], &uncompensated_parts[j]);
            information[i][j] = product;
            information[j][i] = product;
        }
        information[i][i] += 1.0;
    }
    let covariance = pseudo_inverse(&information);
    let scores: Vec<f64> =
        uncompensated_parts.iter().map(|samples| dot(samples, &weighted_residual)).collect();
    let mean = covariance.iter().map(|row| dot(row, &scores)).collect();
    Posterior { covariance, mean }
}

/// Adds a multiple of its tolerance to a number of the machine.
fn apply_change(
    (parameter, tolerance): &(MachineParameter, f64),
    multiple: f64,
    machine: &mut Machine,
    spin: &mut Spin,
) {
    if let Some(value) = parameter.get(machine, spin) {
        parameter.set(machine, spin, value + multiple * tolerance);
    }
}

/// Returns the fixed numbers that a name means, with their values: a single one, or one for each
/// element if the elements have different values.
///
/// # Errors
/// Returns the reason why the name means no fixed number.
fn find_fixed_numbers(
    name: &str,
    case: &FitCase,
    free: &[FreeParameter],
) -> Result<Vec<(MachineParameter, f64)>, String> {
    let machine = &case.plan.model.machine;
    let spin = case.spin();
    let parameter = MachineParameter::find(name, machine, spin)
        .map_err(|error| format!("`{name}` has no tolerance: {error}"))?;
    if !can_be_fixed(&parameter) {
        return Err(format!("`{name}` is no number of the machine"));
    }
    let single_names = parameter.single_names(machine);
    let is_free = |free: &FreeParameter| {
        free.parameter.single_names(machine).iter().any(|name| single_names.contains(name))
    };
    if free.iter().any(is_free) {
        return Err(format!("`{name}` is free: only fixed numbers have a tolerance"));
    }
    if let Some(value) = parameter.get(machine, spin) {
        return Ok(vec![(parameter, value)]);
    }
    let read_single = |name: &std::borrow::Cow<'static, str>| {
        let parameter = MachineParameter::find(name, machine, spin).ok()?;
        let value = parameter.get(machine, spin)?;
        Some((parameter, value))
    };
    let numbers: Vec<_> = single_names.iter().filter_map(read_single).collect();
    match numbers.is_empty() {
        true => Err(format!("`{name}` has no value here")),
        false => Ok(numbers),
    }
}

/// Returns whether a parameter is a number of the machine, neither of the spin nor of the window.
fn can_be_fixed(parameter: &MachineParameter) -> bool {
    !matches!(parameter.target(), Target::Spin | Target::Window(_))
}

/// Returns the fixed numbers of a machine with their tolerances. A value that several elements
/// share is one number, because elements of one batch have one error.
fn numbers_with_tolerances(
    case: &FitCase,
    free: &[FreeParameter],
    given_tolerances: &[(MachineParameter, FixedTolerance)],
    uses_defaults: bool,
) -> Vec<(MachineParameter, f64)> {
    let machine = &case.plan.model.machine;
    let spin = case.spin();
    let single_names_of = |parameter: &MachineParameter| parameter.single_names(machine);
    let mut names_with_value: Vec<_> =
        free.iter().flat_map(|free| single_names_of(&free.parameter)).collect();
    let mut numbers = Vec::new();
    // The last one of several given tolerances of a number applies.
    let given_in_reverse =
        given_tolerances.iter().rev().map(|(parameter, tolerance)| (parameter.clone(), *tolerance));
    let fixed_parameters = || MachineParameter::all(machine, spin).into_iter().filter(can_be_fixed);
    let parameters_of_several_numbers =
        fixed_parameters().filter(|parameter| parameter.target().has_several_numbers());
    let parameters_of_one_number =
        fixed_parameters().filter(|parameter| !parameter.target().has_several_numbers());
    // A number with its default value, such as 0, belongs to an element that the machine lacks.
    let is_present = |parameter: &MachineParameter| {
        parameter.default_value().is_none_or(|value| parameter.get(machine, spin) != Some(value))
    };
    let with_default_tolerance = |parameter: MachineParameter| {
        let tolerance = FixedTolerance::default_for(parameter.name(), parameter.unit());
        (parameter, tolerance)
    };
    let default_tolerances = parameters_of_several_numbers
        .chain(parameters_of_one_number)
        .filter(is_present)
        .map(with_default_tolerance)
        .filter(|_| uses_defaults);
    for (parameter, tolerance) in given_in_reverse.chain(default_tolerances) {
        let names = single_names_of(&parameter);
        if names.iter().any(|single_name| names_with_value.contains(single_name)) {
            continue;
        }
        let Some(value) = parameter.get(machine, spin) else { continue };
        let deviation = tolerance.standard_deviation(value);
        names_with_value.extend(names);
        if deviation > 0.0 {
            numbers.push((parameter, deviation));
        }
    }
    numbers
}

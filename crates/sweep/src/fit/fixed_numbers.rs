//! Tolerances of the numbers that are not fitted, and how estimates depend on them.
//!
//! An estimate holds for the fixed numbers of its machine. If these are off by d, the free numbers
//! make up for it as far as they can. Let J be the slopes of the model by the unknowns, K those by
//! the fixed numbers in standard deviations, W the weights, A = J' W J, and r the residual. To
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

/// The word that takes numbers without a tolerance of their own as exact.
const NONE_WORD: &str = "none";
/// The name of the sensors' gains among the fixed numbers.
const GAIN_NAME: &str = "gain";
/// The default standard deviation of a sensor's gain. Basis: an accelerometer without a calibration
/// of its own. Doubling it doubles what gains add to intervals.
const GAIN_RATIO: f64 = 0.03;
/// The step of a derivative by a fixed number, in tolerances. Basis: a relative change of some
/// 1e-3, as far from rounding as from curvature. Doubling it doubles the derivative's error by
/// curvature.
const STEP_TOLERANCES: f64 = 0.02;
/// The greatest number of values of the slopes by fixed numbers. In longer records every `n`th
/// sample counts `n` times. Basis: 160 MB. Doubling it doubles the memory.
const MAX_SLOPE_VALUES: usize = 20_000_000;

/// The endings of the names of lengths that are too short for a tape measure.
const SHORT_LENGTHS: [&str; 2] = ["clearance_m", "softness_m"];

/// A standard deviation, as a part of the number or in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
enum FixedTolerance {
    Relative(f64),
    Absolute(f64),
}

impl FixedTolerance {
    /// Returns the default for numbers of a name and a unit. Basis: masses by a scale; lengths by a
    /// tape measure along bent sheet, short ones by a caliper; the place of a load by eye; moments
    /// of inertia from drawings without ribs; springs of a catalogue; hardly more of dampers and
    /// friction. Doubling one doubles what numbers of its kind add to intervals, unless the record
    /// limits them.
    fn by_kind(name: &str, unit: &str) -> Self {
        match unit {
            "kg" => Self::Relative(0.02),
            "m" if name.ends_with("radius_m") => Self::Relative(0.05),
            "m" if SHORT_LENGTHS.iter().any(|end| name.ends_with(end)) => Self::Relative(0.1),
            "m" => Self::Absolute(0.005),
            "kg m^2" | "N/m" => Self::Relative(0.05),
            // Gravity is known.
            "m/s^2" => Self::Relative(0.0),
            _ => Self::Relative(0.1),
        }
    }

    /// Reads `2%`, or a number in the parameter's unit.
    fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        let (number, is_percent) = match text.strip_suffix('%') {
            Some(number) => (number.trim(), true),
            None => (text, false),
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
    fn deviation(self, value: f64) -> f64 {
        match self {
            Self::Relative(ratio) => ratio * value.abs(),
            Self::Absolute(size) => size,
        }
    }
}

/// The fixed numbers of a fit with their tolerances.
#[derive(Clone, Debug, Default)]
pub(super) struct FixedNumbers {
    numbers: Vec<(MachineParameter, f64)>,
    gain_ratio: f64,
}

/// The effect of a fixed number's error on the unknowns.
#[derive(Clone, Debug)]
pub(crate) struct FixedInfluence {
    pub(crate) name: String,
    pub(crate) unit: &'static str,
    /// The standard deviation before the record.
    pub(crate) tolerance: f64,
    /// The standard deviation after the record.
    pub(crate) error: f64,
    /// The number of the machine; none of a sensor's gain.
    pub(crate) parameter: Option<MachineParameter>,
    /// The mean change of each unknown by that error, with the errors of other fixed numbers that
    /// the record leaves open together with it: what knowing the number would take off the
    /// unknowns' errors.
    pub(crate) effects: Vec<f64>,
}

/// Errors of all fixed numbers together, of one standard deviation, that are independent of those
/// of other directions.
#[derive(Clone, Debug)]
pub(crate) struct ErrorDirection {
    /// The changes of numbers of the machine.
    pub(crate) changes: Vec<(MachineParameter, f64)>,
    /// The change of each unknown.
    pub(crate) effects: Vec<f64>,
}

/// The effects of all fixed numbers.
#[derive(Clone, Debug, Default)]
pub(crate) struct FixedInfluences {
    /// The strongest dependence of any unknown first.
    pub(crate) numbers: Vec<FixedInfluence>,
    /// The addition to the covariance of the unknowns.
    pub(crate) covariance: Vec<Vec<f64>>,
    /// The principal directions of the errors, those first that move the unknowns most.
    pub(crate) directions: Vec<ErrorDirection>,
}

/// An error of a fixed number of one standard deviation.
struct FixedError {
    influence: FixedInfluence,
    /// The change of every signal at every sample, or at every `stride`th.
    change: Vec<Vec<f64>>,
}

impl FixedNumbers {
    /// Reads the tolerances that are given. All other numbers of the machine that are not free have
    /// those of their kind, unless `none` is among the given.
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
        let mut gain: Option<FixedTolerance> = None;
        let is_none = |text: &&String| text.trim() == NONE_WORD;
        for text in options.iter().filter(|text| !is_none(text)) {
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
                (GAIN_NAME, FixedTolerance::Relative(_)) => gain = Some(tolerance),
                (GAIN_NAME, FixedTolerance::Absolute(_)) => {
                    refuse("a gain's tolerance is a part".to_owned())
                }
                (name, _) => match single_numbers(name, case, free) {
                    Ok(numbers) => {
                        if tolerance == FixedTolerance::Relative(0.0)
                            || numbers.iter().all(|(_, value)| tolerance.deviation(*value) > 0.0)
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
        let with_defaults = !options.iter().any(|text| is_none(&text));
        let default_gain = if with_defaults { GAIN_RATIO } else { 0.0 };
        let fixed_numbers = Self {
            numbers: fixed_numbers(case, free, &parameters, with_defaults),
            gain_ratio: gain.map_or(default_gain, |gain| gain.deviation(1.0)),
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
        let gain_count = if self.gain_ratio > 0.0 { comparisons.len() } else { 0 };
        let samples: usize = comparisons.iter().map(|comparison| comparison.residual.len()).sum();
        let stride =
            (samples * (self.numbers.len() + gain_count)).div_ceil(MAX_SLOPE_VALUES).max(1);
        let mut errors = self.machine_errors(problem, x, comparisons, equations, stride);
        if gain_count > 0 {
            errors.extend(self.gain_errors(problem, comparisons, equations, stride));
        }
        let inverse_normal = pseudo_inverse(&equations.normal);
        for FixedError { influence, .. } in &mut errors {
            influence.effects =
                inverse_normal.iter().map(|row| dot(row, &influence.effects)).collect();
        }
        let Posterior { covariance: posterior_covariance, mean } =
            compute_posterior(&errors, comparisons, variances, stride);
        let mut second_moment = posterior_covariance.clone();
        add_outer(&mut second_moment, &mean, 1.0);
        let unknowns = problem.unknowns();
        // The product of B and a vector of errors in standard deviations.
        let effect_on_unknowns = |by: &[f64]| -> Vec<f64> {
            let mut effect_on_unknowns = vec![0.0; unknowns];
            for (FixedError { influence, .. }, by) in errors.iter().zip(by) {
                effect_on_unknowns
                    .iter_mut()
                    .zip(&influence.effects)
                    .for_each(|(sum, move_by)| *sum += by * move_by);
            }
            effect_on_unknowns
        };
        let total_changes: Vec<Vec<f64>> =
            second_moment.iter().map(|row| effect_on_unknowns(row)).collect();
        let mut covariance = vec![vec![0.0; unknowns]; unknowns];
        for (FixedError { influence, .. }, total_changes) in errors.iter().zip(&total_changes) {
            for (row, by) in covariance.iter_mut().zip(&influence.effects) {
                row.iter_mut().zip(total_changes).for_each(|(sum, change)| *sum += by * change);
            }
        }
        let strength = |effects: &[f64]| {
            let effects = effects.iter().enumerate();
            effects.fold(0.0_f64, |greatest, (k, by)| {
                greatest.max(by * by / inverse_normal[k][k].max(1e-300))
            })
        };
        let eigen = EigenDecomposition::from_matrix(&second_moment);
        let direction = |(value, vector): (&f64, &Vec<f64>)| {
            let size = value.max(0.0).sqrt();
            let error_components: Vec<f64> = vector.iter().map(|entry| size * entry).collect();
            let changes = errors.iter().zip(&error_components).filter_map(|(error, by)| {
                let parameter = error.influence.parameter.clone()?;
                Some((parameter, by * error.influence.tolerance))
            });
            ErrorDirection {
                changes: changes.collect(),
                effects: effect_on_unknowns(&error_components),
            }
        };
        let mut directions: Vec<ErrorDirection> =
            eigen.values.iter().zip(&eigen.vectors).map(direction).collect();
        directions.sort_by(|a, b| strength(&b.effects).total_cmp(&strength(&a.effects)));
        let changes_by_error: Vec<Vec<f64>> =
            posterior_covariance.iter().map(|row| effect_on_unknowns(row)).collect();
        let mut numbers: Vec<FixedInfluence> =
            errors.into_iter().map(|error| error.influence).collect();
        for (k, influence) in numbers.iter_mut().enumerate() {
            let ratio = posterior_covariance[k][k].max(0.0).sqrt();
            influence.error = ratio * influence.tolerance;
            let effects = influence.effects.iter_mut().zip(&changes_by_error[k]);
            effects.for_each(|(by, effect_on_unknowns)| {
                *by = if ratio > 0.0 { effect_on_unknowns / ratio } else { 0.0 }
            });
        }
        numbers.sort_by(|a, b| strength(&b.effects).total_cmp(&strength(&a.effects)));
        FixedInfluences { numbers, covariance, directions }
    }

    /// Computes the effect on the signals of an error of one standard deviation of each number of
    /// the machine, with the change of the normal equations' right side in place of the moves. The
    /// effect is zero if no machine has the changed number.
    fn machine_errors(
        &self,
        problem: &Problem<'_>,
        x: &[f64],
        comparisons: &[SignalComparison],
        equations: &NormalEquations,
        stride: usize,
    ) -> Vec<FixedError> {
        let error = |(parameter, tolerance): &(MachineParameter, f64)| FixedError {
            influence: FixedInfluence {
                name: parameter.name().to_owned(),
                unit: parameter.unit(),
                tolerance: *tolerance,
                error: *tolerance,
                parameter: Some(parameter.clone()),
                effects: vec![0.0; x.len()],
            },
            change: comparisons
                .iter()
                .map(|comparison| vec![0.0; comparison.residual.len().div_ceil(stride)])
                .collect(),
        };
        let mut errors: Vec<FixedError> = self.numbers.iter().map(error).collect();
        for case in 0..problem.cases.len() {
            // A number at an end of its range can change in one direction only.
            let signed_step = |k: usize| {
                let (mut machine, mut spin) = problem.machine(case, x);
                apply_change(&self.numbers[k], STEP_TOLERANCES, &mut machine, &mut spin);
                if machine.violations().is_empty() { STEP_TOLERANCES } else { -STEP_TOLERANCES }
            };
            let steps: Vec<f64> = (0..self.numbers.len()).map(signed_step).collect();
            let case_signals: Vec<usize> =
                (0..comparisons.len()).filter(|&signal| comparisons[signal].case == case).collect();
            let reduce = |changes: Vec<Vec<f64>>| {
                let mut rhs = vec![0.0; x.len()];
                let mut thinned = Vec::with_capacity(changes.len());
                for (change, &signal) in changes.into_iter().zip(&case_signals) {
                    let change = subtract_mean(change).0;
                    let variance = equations.sigma[signal] * equations.sigma[signal];
                    for (rhs, slope) in rhs.iter_mut().zip(&comparisons[signal].slopes) {
                        *rhs += dot(slope, &change) / variance;
                    }
                    thinned.push(change.into_iter().step_by(stride).collect::<Vec<f64>>());
                }
                (rhs, thinned)
            };
            let apply = |k: usize, machine: &mut Machine, spin: &mut Spin| {
                apply_change(&self.numbers[k], steps[k], machine, spin);
            };
            let effects =
                problem.compute_changes(case, x, comparisons, (steps.len(), apply), reduce);
            for ((error, effect), step) in errors.iter_mut().zip(effects).zip(&steps) {
                let Some((rhs, changes)) = effect else { continue };
                let effects = error.influence.effects.iter_mut().zip(rhs);
                effects.for_each(|(sum, rhs)| *sum += rhs / step);
                for (change, &signal) in changes.into_iter().zip(&case_signals) {
                    error.change[signal] = change.into_iter().map(|value| value / step).collect();
                }
            }
        }
        errors
    }

    /// Computes the effect of an error of one standard deviation of each sensor's gain, with the
    /// change of the normal equations' right side in place of the moves.
    fn gain_errors(
        &self,
        problem: &Problem<'_>,
        comparisons: &[SignalComparison],
        equations: &NormalEquations,
        stride: usize,
    ) -> Vec<FixedError> {
        let error = |(k, ((.., signal), comparison)): (
            usize,
            ((usize, usize, &Signal), &SignalComparison),
        )| {
            let variance = equations.sigma[k] * equations.sigma[k];
            let motion = signal.samples().map(|(row, _)| self.gain_ratio * comparison.model[row]);
            let motion = subtract_mean(motion.collect()).0;
            let mut change: Vec<Vec<f64>> = comparisons
                .iter()
                .map(|comparison| vec![0.0; comparison.residual.len().div_ceil(stride)])
                .collect();
            change[k] = motion.iter().copied().step_by(stride).collect();
            let influence = FixedInfluence {
                name: format!("{GAIN_NAME} of {}", signal.quantity.column()),
                unit: "",
                tolerance: self.gain_ratio,
                error: self.gain_ratio,
                parameter: None,
                effects: comparison
                    .slopes
                    .iter()
                    .map(|slope| dot(slope, &motion) / variance)
                    .collect(),
            };
            FixedError { influence, change }
        };
        problem.signals().zip(comparisons).enumerate().map(error).collect()
    }
}

/// The errors of fixed numbers after the record, in standard deviations before it.
struct Posterior {
    covariance: Vec<Vec<f64>>,
    mean: Vec<f64>,
}

/// Computes the errors of fixed numbers after the record.
fn compute_posterior(
    errors: &[FixedError],
    comparisons: &[SignalComparison],
    variances: &[f64],
    stride: usize,
) -> Posterior {
    let weights: Vec<f64> =
        variances.iter().map(|variance| (stride as f64 / variance).sqrt()).collect();
    let residual: Vec<f64> = comparisons
        .iter()
        .zip(&weights)
        .flat_map(|(comparison, weight)| {
            comparison.residual.iter().step_by(stride).map(move |residual| weight * residual)
        })
        .collect();
    // The part of each change for which the unknowns do not compensate.
    let uncompensated = |error: &FixedError| -> Vec<f64> {
        let mut samples = Vec::with_capacity(residual.len());
        for ((change, comparison), weight) in error.change.iter().zip(comparisons).zip(&weights) {
            let mut change = change.clone();
            for (slope, by) in comparison.slopes.iter().zip(&error.influence.effects) {
                let slope = slope.iter().step_by(stride);
                change.iter_mut().zip(slope).for_each(|(change, slope)| *change -= by * slope);
            }
            samples.extend(change.iter().map(|change| weight * change));
        }
        samples
    };
    let uncompensated_parts: Vec<Vec<f64>> = errors.iter().map(uncompensated).collect();
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
        uncompensated_parts.iter().map(|samples| dot(samples, &residual)).collect();
    let mean = covariance.iter().map(|row| dot(row, &scores)).collect();
    Posterior { covariance, mean }
}

/// Changes a number by a multiple of its tolerance.
fn apply_change(
    (parameter, tolerance): &(MachineParameter, f64),
    count: f64,
    machine: &mut Machine,
    spin: &mut Spin,
) {
    if let Some(value) = parameter.get(machine, spin) {
        parameter.set(machine, spin, value + count * tolerance);
    }
}

/// Returns the fixed numbers of a name with their values: one, or one for each element if the name
/// stands for elements that differ.
///
/// # Errors
/// Returns the reason why the name has no fixed number.
fn single_numbers(
    name: &str,
    case: &FitCase,
    free: &[FreeParameter],
) -> Result<Vec<(MachineParameter, f64)>, String> {
    let machine = &case.plan.model.machine;
    let spin = case.spin();
    let parameter = MachineParameter::find(name, machine, spin)
        .map_err(|error| format!("`{name}` has no tolerance: {error}"))?;
    if !is_fixed_kind(&parameter) {
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

/// Whether a parameter is a number of the machine.
fn is_fixed_kind(parameter: &MachineParameter) -> bool {
    !matches!(parameter.target(), Target::Spin | Target::Window(_))
}

/// Returns the numbers of a machine that have a tolerance. A number that several elements share is
/// one number, because they are of one batch.
fn fixed_numbers(
    case: &FitCase,
    free: &[FreeParameter],
    given: &[(MachineParameter, FixedTolerance)],
    with_defaults: bool,
) -> Vec<(MachineParameter, f64)> {
    let machine = &case.plan.model.machine;
    let spin = case.spin();
    let single_names = |parameter: &MachineParameter| parameter.single_names(machine);
    let mut free_names: Vec<_> =
        free.iter().flat_map(|free| single_names(&free.parameter)).collect();
    let mut numbers = Vec::new();
    // The last tolerance of a number holds.
    let given = given.iter().rev().map(|(parameter, tolerance)| (parameter.clone(), *tolerance));
    let fixed_parameters =
        || MachineParameter::all(machine, spin).into_iter().filter(is_fixed_kind);
    let with_several_numbers =
        fixed_parameters().filter(|parameter| parameter.target().has_several_numbers());
    let with_single_number =
        fixed_parameters().filter(|parameter| !parameter.target().has_several_numbers());
    // A number with its default value, such as 0, belongs to a part that the machine does not have.
    let is_present = |parameter: &MachineParameter| {
        parameter.default_value().is_none_or(|value| parameter.get(machine, spin) != Some(value))
    };
    let by_kind = |parameter: MachineParameter| {
        let tolerance = FixedTolerance::by_kind(parameter.name(), parameter.unit());
        (parameter, tolerance)
    };
    let defaults = with_several_numbers
        .chain(with_single_number)
        .filter(is_present)
        .map(by_kind)
        .filter(|_| with_defaults);
    for (parameter, tolerance) in given.chain(defaults) {
        let names = single_names(&parameter);
        if names.iter().any(|part| free_names.contains(part)) {
            continue;
        }
        let Some(value) = parameter.get(machine, spin) else { continue };
        let size = tolerance.deviation(value);
        free_names.extend(names);
        if size > 0.0 {
            numbers.push((parameter, size));
        }
    }
    numbers
}

//! Tolerances of the numbers that are not fitted, and how estimates depend on them.
//!
//! An estimate holds for the fixed numbers of its machine. If one of those is off, the free numbers
//! make up for it and the model may follow as well as before. So to first order, with the slopes J
//! of the model by the unknowns, those K by a fixed number, and weights W, an error d of the fixed
//! number moves the unknowns by (J' W J)^-1 J' W K d, and its variance adds to theirs.

use washer_model::{Machine, Parameter, Spin, Target};

use super::algebra::{centred, dot, inverse};
use super::model::{Against, Case, Free, Problem, Summary};
use sweep_engine::Diagnostics;
use sweep_engine::config::{Location, Report as Mistakes};

/// The word for exact fixed numbers.
const NONE: &str = "none";
/// The word for tolerances by kind of all numbers that none is given for.
const DEFAULT: &str = "default";
/// The name of the sensors' gains among the fixed numbers.
const GAIN: &str = "gain";
/// The default standard deviation of a sensor's gain. Basis: an accelerometer without a calibration
/// of its own. Doubling it doubles what gains add to intervals.
const GAIN_RATIO: f64 = 0.03;
/// The step of a derivative by a fixed number, in tolerances. Basis: a relative change of some
/// 1e-3, as far from rounding as from curvature. Doubling it doubles the derivative's error by
/// curvature.
const STEP_TOLERANCES: f64 = 0.02;

/// A standard deviation: a part of the number, or in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Tolerance {
    Relative(f64),
    Absolute(f64),
}

impl Tolerance {
    /// Returns the default for numbers of a unit. Basis: a scale, a tape measure along bent sheet,
    /// drawings without ribs, springs and dampers of a catalogue. Doubling one doubles what numbers
    /// of its kind add to intervals.
    fn by_unit(unit: &str) -> Self {
        match unit {
            "kg" => Self::Relative(0.02),
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
pub(super) struct Known {
    numbers: Vec<(Parameter, f64)>,
    gain_ratio: f64,
    /// Whether the tolerances widen intervals; else they only say which number matters most.
    pub(super) is_widening: bool,
}

/// What an error of a fixed number does to the unknowns.
#[derive(Clone, Debug)]
pub(crate) struct Influence {
    pub(crate) name: String,
    pub(crate) unit: &'static str,
    /// The standard deviation.
    pub(crate) tolerance: f64,
    /// The number of the machine; none of a sensor's gain.
    pub(crate) parameter: Option<Parameter>,
    /// The change of each unknown by an error of one standard deviation.
    pub(crate) moves: Vec<f64>,
}

impl Known {
    /// Reads the tolerances that are given. Those by kind are taken for all other numbers of the
    /// machine that are not free if `default` is among the given; and if nothing is given, without
    /// widening an interval.
    ///
    /// # Errors
    /// Every mistake in them.
    pub(super) fn read(given: &[String], case: &Case, free: &[Free]) -> Result<Self, Diagnostics> {
        let mistakes = Mistakes::default();
        let mut parameters: Vec<(Parameter, Tolerance)> = Vec::new();
        let mut gain: Option<Tolerance> = None;
        let is_word = |text: &String, word: &str| text.trim() == word;
        for text in given.iter().filter(|text| !is_word(text, NONE) && !is_word(text, DEFAULT)) {
            let at = Location::new(mistakes.add("--known", text.as_str()), 0..text.len());
            let refuse = |title: String| {
                let expected =
                    "expected NAME=2% or NAME=0.01 in its unit, gain=3%, default or none";
                mistakes.refuse::<()>(&at, title, expected);
            };
            let Some((name, tolerance)) = text.split_once('=') else {
                refuse(format!("`{text}` has no tolerance"));
                continue;
            };
            let Some(tolerance) = Tolerance::parse(tolerance) else {
                refuse(format!("`{}` is no tolerance", tolerance.trim()));
                continue;
            };
            match (name.trim(), tolerance) {
                (GAIN, Tolerance::Relative(_)) => gain = Some(tolerance),
                (GAIN, Tolerance::Absolute(_)) => refuse("a gain's tolerance is a part".to_owned()),
                (name, _) => match single_numbers(name, case, free) {
                    Ok(numbers) => {
                        if tolerance == Tolerance::Relative(0.0)
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
        let with_defaults = given.is_empty() || given.iter().any(|text| is_word(text, DEFAULT));
        let default_gain = if with_defaults { GAIN_RATIO } else { 0.0 };
        let known = Self {
            numbers: fixed_numbers(case, free, &parameters, with_defaults),
            gain_ratio: gain.map_or(default_gain, |gain| gain.deviation(1.0)),
            is_widening: !given.is_empty(),
        };
        mistakes.finish(Some(known))
    }

    /// Computes how the unknowns depend on the fixed numbers, the strongest dependence of any
    /// unknown first. On all threads of the rayon pool it is called in.
    pub(super) fn influences(
        &self,
        problem: &Problem<'_>,
        x: &[f64],
        against: &[Against],
        summary: &Summary,
    ) -> Vec<Influence> {
        let bread = inverse(&summary.normal);
        let moves = |pull: &[f64]| -> Vec<f64> { bread.iter().map(|row| dot(row, pull)).collect() };
        let mut found: Vec<Influence> = self
            .pulls(problem, x, against, summary)
            .into_iter()
            .zip(&self.numbers)
            .map(|(pull, (parameter, tolerance))| Influence {
                name: parameter.name().to_owned(),
                unit: parameter.unit(),
                tolerance: *tolerance,
                parameter: Some(parameter.clone()),
                moves: moves(&pull),
            })
            .collect();
        if self.gain_ratio > 0.0 {
            for (((.., signal), one), sigma) in problem.signals().zip(against).zip(&summary.sigma) {
                let model = signal.samples().map(|(row, _)| one.model[row]);
                let error = centred(model.map(|value| self.gain_ratio * value).collect()).0;
                let pull = one.slopes.iter().map(|slope| dot(slope, &error) / (sigma * sigma));
                found.push(Influence {
                    name: format!("{GAIN} of {}", signal.quantity.column()),
                    unit: "",
                    tolerance: self.gain_ratio,
                    parameter: None,
                    moves: moves(&pull.collect::<Vec<f64>>()),
                });
            }
        }
        let strength = |influence: &Influence| {
            let moves = influence.moves.iter().enumerate();
            moves.fold(0.0_f64, |most, (k, by)| most.max(by * by / bread[k][k].max(1e-300)))
        };
        found.sort_by(|a, b| strength(b).total_cmp(&strength(a)));
        found
    }

    /// Computes by how much an error of one standard deviation of each fixed number pulls at the
    /// unknowns; not at all where the machine cannot have it.
    fn pulls(
        &self,
        problem: &Problem<'_>,
        x: &[f64],
        against: &[Against],
        summary: &Summary,
    ) -> Vec<Vec<f64>> {
        let mut sums = vec![vec![0.0; x.len()]; self.numbers.len()];
        for case in 0..problem.cases.len() {
            // A number at an end of its range can change one way only.
            let way = |k: usize| {
                let (mut machine, mut spin) = problem.machine(case, x);
                change(&self.numbers[k], STEP_TOLERANCES, &mut machine, &mut spin);
                if machine.violations().is_empty() { STEP_TOLERANCES } else { -STEP_TOLERANCES }
            };
            let steps: Vec<f64> = (0..self.numbers.len()).map(way).collect();
            let pulls =
                problem.pulls(case, x, (against, &summary.sigma[..]), steps.len(), |k, m, s| {
                    change(&self.numbers[k], steps[k], m, s);
                });
            for ((sum, pull), step) in sums.iter_mut().zip(pulls).zip(&steps) {
                let pull = pull.into_iter().flatten();
                sum.iter_mut().zip(pull).for_each(|(sum, pull)| *sum += pull / step);
            }
        }
        sums
    }
}

/// Changes a number by so many tolerances.
fn change(
    (parameter, tolerance): &(Parameter, f64),
    count: f64,
    machine: &mut Machine,
    spin: &mut Spin,
) {
    if let Some(value) = parameter.get(machine, spin) {
        parameter.set(machine, spin, value + count * tolerance);
    }
}

/// Returns the fixed numbers of a name with their values: one, or one for every element where a
/// name is of several elements that differ; or why there are none.
fn single_numbers(name: &str, case: &Case, free: &[Free]) -> Result<Vec<(Parameter, f64)>, String> {
    let machine = &case.plan.model.machine;
    let spin = case.spin();
    let found = Parameter::find(name, machine, spin)
        .map_err(|error| format!("`{name}` has no tolerance: {error}"))?;
    if !is_fixed_kind(&found) {
        return Err(format!("`{name}` is no number of the machine"));
    }
    let parts = found.parts(machine);
    let is_free = |free: &Free| free.parameter.parts(machine).iter().any(|it| parts.contains(it));
    if free.iter().any(is_free) {
        return Err(format!("`{name}` is free: only fixed numbers have a tolerance"));
    }
    if let Some(value) = found.get(machine, spin) {
        return Ok(vec![(found, value)]);
    }
    let part = |part: &std::borrow::Cow<'static, str>| {
        let parameter = Parameter::find(part, machine, spin).ok()?;
        let value = parameter.get(machine, spin)?;
        Some((parameter, value))
    };
    let numbers: Vec<_> = parts.iter().filter_map(part).collect();
    match numbers.is_empty() {
        true => Err(format!("`{name}` has no value here")),
        false => Ok(numbers),
    }
}

/// Whether a parameter is a number of the machine.
fn is_fixed_kind(parameter: &Parameter) -> bool {
    !matches!(parameter.target(), Target::Spin | Target::Window(_))
}

/// Returns the numbers of a machine that have a tolerance. What several elements share is one
/// number: they are of one batch.
fn fixed_numbers(
    case: &Case,
    free: &[Free],
    given: &[(Parameter, Tolerance)],
    with_defaults: bool,
) -> Vec<(Parameter, f64)> {
    let machine = &case.plan.model.machine;
    let spin = case.spin();
    let parts = |parameter: &Parameter| parameter.parts(machine);
    let mut taken: Vec<_> = free.iter().flat_map(|free| parts(&free.parameter)).collect();
    let mut found = Vec::new();
    // The last that is given of a number holds.
    let given = given.iter().rev().map(|(parameter, tolerance)| (parameter.clone(), *tolerance));
    let all = || Parameter::all(machine, spin).into_iter().filter(is_fixed_kind);
    let shared = all().filter(|parameter| parameter.target().is_several());
    let single = all().filter(|parameter| !parameter.target().is_several());
    // A number that a machine file may leave out and does belongs to a part that is not there.
    let is_there = |parameter: &Parameter| {
        parameter.left_out().is_none_or(|value| parameter.get(machine, spin) != Some(value))
    };
    let by_kind = |parameter: Parameter| {
        let tolerance = Tolerance::by_unit(parameter.unit());
        (parameter, tolerance)
    };
    let defaults = shared.chain(single).filter(is_there).map(by_kind).filter(|_| with_defaults);
    for (parameter, tolerance) in given.chain(defaults) {
        let own = parts(&parameter);
        if own.iter().any(|part| taken.contains(part)) {
            continue;
        }
        let Some(value) = parameter.get(machine, spin) else { continue };
        let size = tolerance.deviation(value);
        taken.extend(own);
        if size > 0.0 {
            found.push((parameter, size));
        }
    }
    found
}

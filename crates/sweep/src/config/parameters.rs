//! Constants (`[set]`, `--set`, `--at`) and axes: names from the parameter table with a value each.

use std::borrow::Cow;
use std::collections::BTreeMap;

use washer_model::{Machine, Parameter, Range, Spin, UnknownParameter, decimal};

use super::NamedValues;
use super::grid::Draft;
use super::list::{self, List};
use super::report::{Diagnostic, Report};
use super::scalars;
use super::section::{Field, Section, check_number, quoted, refused_number, short};
use super::source::{Located, Location};
use crate::design::{Design, Distribution, MOST_AXES, REACH, Shape};
use crate::plan::{Axis, AxisValues, Plan};

/// Most grid points that are accepted. A hundred thousand points a second would take four months.
pub(super) const MOST_POINTS: u64 = 1_000_000_000_000;

/// Names offered as the nearest one; a machine of thousands of springs has more than a reader wants
/// compared.
const COMPARED: usize = 400;

/// A name with its value, and the numbers it writes.
struct Constant<'a> {
    name: Located<&'a str>,
    parameter: Parameter,
    value: Located<f64>,
}

/// A constant that was put in place.
pub(super) struct WrittenConstant {
    name: Located<String>,
    parts: Vec<Cow<'static, str>>,
}

/// The range of a parameter of the spin.
pub(super) fn range(parameter: &str, spin: &Spin) -> Range {
    Parameter::find(parameter, &Machine::paper(), spin)
        .map_or(Range::Any, |parameter| parameter.range())
}

/// Reads `[set]`, then `--set`, which overrides it, and writes both into the plan.
pub(super) fn constants(
    root: &mut Section<'_>,
    sets: &[String],
    draft: &mut Draft,
    report: &mut Report,
) {
    let mut constants = Vec::new();
    if let Some(section) = root.table("set", "[set]", report).given() {
        let section = section.value;
        for name in section.names() {
            let number =
                |range: Range, report: &mut Report| section.number_named(name.value, range, report);
            constants.extend(constant(name.clone(), number, draft, report));
        }
        apply(&constants, draft, report);
    }
    let sets: Vec<String> =
        sets.iter().filter(|argument| !scalars::is_one(argument)).cloned().collect();
    let constants = arguments("--set", &sets, draft, report);
    let before = draft.plan.clone();
    apply(&constants, draft, report);
    // What is set to what it was leaves the plan as it was.
    let changes = |constant: &&Constant<'_>| {
        let mut after = before.clone();
        write(&constant.parameter, &mut after, constant.value.value);
        after != before
    };
    draft.plan.set = constants
        .iter()
        .filter(changes)
        .map(|constant| (constant.name.value.to_owned(), constant.value.value.into()))
        .collect();
}

/// Puts one point in place of the axes: `--at` gives every axis of several values, and may give
/// more.
pub(super) fn point(at: &[String], draft: &mut Draft, report: &mut Report) -> NamedValues {
    let constants = arguments("--at", at, draft, report);
    let named = |name: &str| {
        at.iter().any(|argument| argument.split('=').next().is_some_and(|n| n.trim() == name))
    };
    for (k, axis) in std::mem::take(&mut draft.plan.axes).into_iter().enumerate() {
        if named(axis.parameter.name()) {
            continue;
        }
        if axis.values.len() == 1 {
            write(&axis.parameter, &mut draft.plan, axis.values.value(0));
        } else if let Some(place) = draft.origins.get(&format!("axis[{k}]")) {
            let name = axis.parameter.name();
            let title = format!("a point of the grid needs a value of `{name}`");
            report.push(
                Diagnostic::new(title)
                    .at(place, format!("expected --at {name}=VALUE for this axis")),
            );
        }
    }
    draft.plan.design = None;
    apply(&constants, draft, report);
    constants
        .iter()
        .map(|constant| (constant.name.value.to_owned(), constant.value.value))
        .collect()
}

/// Reads NAME=VALUE arguments.
fn arguments<'a>(
    option: &str,
    arguments: &'a [String],
    draft: &Draft,
    report: &mut Report,
) -> Vec<Constant<'a>> {
    let mut constants = Vec::new();
    for argument in arguments {
        let source = report.sources.add(option, argument.as_str());
        let whole = Location::new(source, 0..argument.len());
        let Some((name, value)) = argument.split_once('=') else {
            let title = format!("`{}` is not a constant", short(argument));
            report.push(Diagnostic::new(title).at(&whole, "expected NAME=VALUE"));
            continue;
        };
        let value_at = Location::new(source, name.len() + 1..argument.len());
        let name = Located { value: name.trim(), at: Location::new(source, 0..name.len()) };
        let number = |range: Range, report: &mut Report| match value.trim().parse() {
            Ok(number) => check_number(&quoted(name.value), number, value_at, range, report),
            Err(_) => {
                let title = format!("`{}` is not a number", short(value));
                report.push(Diagnostic::new(title).at(&value_at, format!("expected {range}")));
                None
            }
        };
        constants.extend(constant(name.clone(), number, draft, report));
    }
    constants
}

/// A constant if its name is right and `number` has one in the parameter's range.
fn constant<'a>(
    name: Located<&'a str>,
    number: impl FnOnce(Range, &mut Report) -> Option<Located<f64>>,
    draft: &Draft,
    report: &mut Report,
) -> Option<Constant<'a>> {
    let parameter = find(&name, draft, report)?;
    let value = number(parameter.range(), report)?;
    Some(Constant { name, parameter, value })
}

/// The parameter of this name.
fn find(name: &Located<&str>, draft: &Draft, report: &mut Report) -> Option<Parameter> {
    let (machine, spin) = (&draft.plan.machine, &draft.plan.spin);
    let error = match Parameter::find(name.value, machine, spin) {
        Ok(parameter) => return Some(parameter),
        Err(error) => error,
    };
    report.push_with(|_| unknown(name, &error, machine, spin));
    None
}

pub(super) fn unknown(
    name: &Located<&str>,
    error: &UnknownParameter,
    machine: &Machine,
    spin: &Spin,
) -> Diagnostic {
    let title = format!("unknown parameter {}", quoted(name.value));
    let diagnostic = Diagnostic::new(title).at(&name.at, error.to_string());
    let section = match name.value {
        "window_s" => Some("[time], or as `window_from_s` and `window_to_s` here"),
        "end_s" => Some("[time]"),
        "step_s" | "rtol" | "atol" | "accuracy" | "method" => Some("[integrator]"),
        "ratio_limit" | "criterion" | "channels" => Some("[reliability]"),
        _ => None,
    };
    match (error, section) {
        (UnknownParameter::Name, Some(section)) => diagnostic.help(format!(
            "`{}` is set in {section} of the grid file and is the same at every point",
            name.value
        )),
        (UnknownParameter::Name, None) => {
            let all = Parameter::all(machine, spin);
            let near =
                diagnostic.nearest(name.value, all.iter().take(COMPARED).map(Parameter::name));
            near.help("`sweep parameters` lists every name")
        }
        (
            UnknownParameter::Number { .. }
            | UnknownParameter::TablePoint { .. }
            | UnknownParameter::TableSpin
            | UnknownParameter::NoCabinet,
            _,
        ) => diagnostic,
    }
}

/// Writes constants of equal rank; no number may be written twice, as nothing says which comes
/// last.
fn apply(constants: &[Constant<'_>], draft: &mut Draft, report: &mut Report) {
    let mut written: BTreeMap<Cow<'static, str>, &Constant<'_>> = BTreeMap::new();
    for constant in constants {
        let parts = constant.parameter.parts(&draft.plan.machine);
        match parts.iter().find_map(|part| written.get(part)) {
            Some(first) => report.push(twice(&constant.name, &first.name)),
            None => {
                write(&constant.parameter, &mut draft.plan, constant.value.value);
                for part in &parts {
                    draft.origins.put(part.clone().into_owned(), constant.value.at.clone());
                    written.insert(part.clone(), constant);
                }
                let name =
                    Located { value: constant.name.value.to_owned(), at: constant.name.at.clone() };
                draft.constants.push(WrittenConstant { name, parts });
            }
        }
    }
}

fn write(parameter: &Parameter, plan: &mut Plan, value: f64) {
    crate::plan::write(parameter, &mut plan.machine, &mut plan.spin, &mut plan.window_s, value);
}

fn twice(second: &Located<&str>, first: &Located<&str>) -> Diagnostic {
    let title = if second.value == first.value {
        format!("`{}` is given twice", second.value)
    } else {
        format!("`{}` and `{}` write the same number", first.value, second.value)
    };
    Diagnostic::new(title)
        .at(&second.at, "expected each number once")
        .at(&first.at, "first written here")
}

/// What axes write so far, by the single numbers.
type Swept = BTreeMap<Cow<'static, str>, Located<String>>;

/// Takes note that an axis writes this parameter's numbers; not if another one does.
fn claim(
    name: &Located<&str>,
    parameter: &Parameter,
    swept: &mut Swept,
    draft: &Draft,
    report: &mut Report,
) -> bool {
    let parts = parameter.parts(&draft.plan.machine);
    if let Some(first) = parts.iter().find_map(|part| swept.get(part)) {
        let first = Located { value: first.value.as_str(), at: first.at.clone() };
        report.push(twice(name, &first));
        return false;
    }
    for constant in &draft.constants {
        if constant.parts.iter().all(|part| parts.contains(part)) {
            let title = format!(
                "`{}` is swept by an axis: this constant has no effect",
                constant.name.value
            );
            let diagnostic = Diagnostic::new(title)
                .at(&constant.name.at, "expected a parameter that no axis sweeps");
            report.push(diagnostic.at(&name.at, "swept here"));
        }
    }
    let own = Located { value: name.value.to_owned(), at: name.at.clone() };
    swept.extend(parts.into_iter().map(|part| (part, own.clone())));
    true
}

/// Reads every `[[axis]]` of a design that fills a box: a range each, without a count.
pub(super) fn box_of_axes(
    root: &mut Section<'_>,
    design: Located<Design>,
    draft: &mut Draft,
    report: &mut Report,
) {
    let mut swept = Swept::new();
    let sections = root.tables("axis", report);
    let most = match &design.value {
        Design::Sobol { .. } => MOST_AXES,
        Design::LatinHypercube { .. } | Design::MonteCarlo { .. } | Design::List { .. } => {
            usize::MAX
        }
    };
    if sections.is_empty() || sections.len() > most {
        let title =
            format!("a design by \"{}\" over {} axes", design.value.method(), sections.len());
        let expected = match most {
            usize::MAX => "expected at least one [[axis]] with a range".to_owned(),
            most => format!("expected from 1 to {most} [[axis]], each with a range"),
        };
        report.push(Diagnostic::new(title).at(&design.at, expected));
    }
    for mut section in sections {
        let field = section.text("parameter", report);
        let name = section.require(field, "parameter", "the name of a parameter", report);
        let parameter = name.as_ref().and_then(|name| find(name, draft, report));
        let range = parameter.as_ref().map_or(Range::Any, Parameter::range);
        section.misplace(
            &["values"],
            "a design spreads its points over `range = { from = ..., to = ... }`",
        );
        let distributed =
            section.table("distribution", "distribution = { kind, ... }", report).given();
        let values = if let Some(distributed) = distributed {
            section.misplace(&["range"], "the distribution has its own `from` and `to`");
            distribution(distributed.value, range, report)
        } else {
            let field = section.table("range", "range = { from, to }", report);
            let spaced =
                section.require(field, "range", "`range = { from = ..., to = ... }`", report);
            spaced.and_then(|spaced| extent(spaced.value, range, design.value.points(), report))
        };
        section.finish(report);
        let (Some(name), Some(parameter)) = (name, parameter) else { continue };
        if claim(&name, &parameter, &mut swept, draft, report)
            && let Some(values) = values
        {
            draft.origins.put(format!("axis[{}]", draft.plan.axes.len()), values.at);
            draft.plan.axes.push(Axis { parameter, values: values.value });
        }
    }
    draft.plan.design = Some(design.value);
}

/// The axes of a list: its columns.
pub(super) fn listed_axes(
    root: &mut Section<'_>,
    mut list: List,
    draft: &mut Draft,
    report: &mut Report,
) {
    for section in root.tables("axis", report) {
        let diagnostic = Diagnostic::new("an [[axis]] beside a list of points");
        report
            .push(diagnostic.at(section.at(), "the columns of the list are the axes; remove this"));
    }
    let mut swept = Swept::new();
    for (k, column) in std::mem::take(&mut list.columns).into_iter().enumerate() {
        let name = Located { value: column.name.value.as_str(), at: column.name.at.clone() };
        if name.value == list::ID {
            continue;
        }
        let Some(parameter) = find(&name, draft, report) else { continue };
        let range = parameter.range();
        let mut sound = true;
        for (row, &value) in
            column.values.iter().enumerate().filter(|(_, value)| !range.contains(**value))
        {
            sound = false;
            report.push_with(|sources| {
                let what = format!("value {} of {}", row + 1, quoted(name.value));
                refused_number(&what, value, &list.place(sources, k, row), range)
            });
        }
        if claim(&name, &parameter, &mut swept, draft, report) && sound {
            draft.origins.put(format!("axis[{}]", draft.plan.axes.len()), name.at.clone());
            draft.plan.axes.push(Axis { parameter, values: AxisValues::List(column.values) });
        }
    }
    draft.plan.design = Some(list.design);
}

/// The kinds of distributions by name; "uniform" is a range by another name.
const DISTRIBUTIONS: [&str; 3] = ["normal", "lognormal", "uniform"];

/// A distribution, cut at `from` and `to`.
fn distribution(
    mut section: Section<'_>,
    range: Range,
    report: &mut Report,
) -> Option<Located<AxisValues>> {
    let at = section.at().clone();
    let field = section.choice("kind", &DISTRIBUTIONS, report);
    let expected = "`normal`, `lognormal` or `uniform`";
    let kind = section.require(field, "kind", expected, report).map(|kind| kind.value);
    let mut number = |key: &'static str, range: Range, needed: bool| {
        let field = section.number(key, range, report);
        if needed {
            section.require(field, key, "a number", report).map(|number| number.value)
        } else {
            field.given().map(|number| number.value)
        }
    };
    let shape = match kind {
        Some(0) => {
            let numbers = (number("mean", Range::Any, true), number("sd", Range::Positive, true));
            numbers.0.zip(numbers.1).map(|(mean, sd)| Shape::Normal { mean, sd })
        }
        Some(1) => {
            let median = number("median", Range::Positive, true);
            let sigma = number("sigma", Range::Positive, true);
            median.zip(sigma).map(|(median, sigma)| Shape::Lognormal { median, sigma })
        }
        _ => None,
    };
    let is_uniform = kind == Some(2);
    let [from, to] = ["from", "to"].map(|key| number(key, range, is_uniform));
    section.finish(report);
    let refuse = |title: String, expected: String, report: &mut Report| {
        report.push(Diagnostic::new(title).at(&at, expected));
        None
    };
    let bounds = match shape {
        Some(shape) => [from.unwrap_or(shape.at(-REACH)), to.unwrap_or(shape.at(REACH))],
        None => [from?, to?],
    };
    let [from, to] = bounds;
    if from.partial_cmp(&to) != Some(std::cmp::Ordering::Less) {
        let title = format!("a distribution from {} to {}", decimal(from), decimal(to));
        return refuse(title, "expected `from` below `to`".to_owned(), report);
    }
    if let Some(&beyond) = bounds.iter().find(|&&bound| !range.contains(bound)) {
        let title = format!("the distribution reaches to {}", decimal(beyond));
        let expected = format!("expected {range}: cut it by `from` and `to`");
        return refuse(title, expected, report);
    }
    let value = match shape {
        None => AxisValues::Linear { from, to, count: 2 },
        Some(shape) => {
            let reach = [shape.at(-REACH), shape.at(REACH)];
            if to <= reach[0] || reach[1] <= from {
                let title = format!(
                    "nothing of the distribution lies from {} to {}",
                    decimal(from),
                    decimal(to)
                );
                let [low, high] = reach.map(decimal);
                return refuse(title, format!("expected bounds within {low} and {high}"), report);
            }
            AxisValues::Distributed(Distribution { shape, from, to })
        }
    };
    Some(Located { value, at })
}

/// A range without a count.
fn extent(
    mut section: Section<'_>,
    range: Range,
    points: u64,
    report: &mut Report,
) -> Option<Located<AxisValues>> {
    let at = section.at().clone();
    section.misplace(&["count"], "the number of points belongs in [design], as `points`");
    let [from, to] = ["from", "to"].map(|key| {
        let field = section.number(key, range, report);
        section.require(field, key, "a number", report)
    });
    let logarithmic = section.choice("spacing", &["linear", "log"], report).or(0);
    section.finish(report);
    let (from, to, logarithmic) = (from?, to?, logarithmic? == 1);
    let refusal = if from.value == to.value {
        let title = format!("a design cannot spread points from {0} to {0}", decimal(from.value));
        Some((title, &to.at, "expected another number"))
    } else if logarithmic && !(from.value > 0.0 && to.value > 0.0) {
        let end = if from.value > 0.0 { &to } else { &from };
        let title = format!("{} has no logarithm", decimal(end.value));
        Some((title, &end.at, "expected a number greater than 0, or spacing = \"linear\""))
    } else if most_distinct(from.value, to.value).is_some_and(|most| most < points) {
        let title = format!(
            "a range from {} to {} has no {points} different values",
            decimal(from.value),
            decimal(to.value)
        );
        Some((title, &to.at, "expected ends farther apart, or fewer `points` in [design]"))
    } else {
        None
    };
    if let Some((title, at, expected)) = refusal {
        report.push(Diagnostic::new(title).at(at, expected));
        return None;
    }
    // Two values are the ends; the design finds the points between.
    let (from, to, count) = (from.value, to.value, 2);
    let value = if logarithmic {
        AxisValues::Log { from, to, count }
    } else {
        AxisValues::Linear { from, to, count }
    };
    Some(Located { value, at })
}

/// Neighbours on a range are apart by at least this share of the greater end, or else rounding
/// would put some on one number.
const CLOSEST: f64 = 8.0 * f64::EPSILON;

/// How many values a range has room for, if that is fewer than any range may have.
fn most_distinct(from: f64, to: f64) -> Option<u64> {
    let steps = ((to - from).abs() / (CLOSEST * from.abs().max(to.abs()))).floor();
    // Both ends are exact, however close.
    (steps < MOST_POINTS as f64).then_some((steps as u64 + 1).max(2))
}

/// Reads every `[[axis]]` of a grid.
pub(super) fn axes(root: &mut Section<'_>, draft: &mut Draft, report: &mut Report) {
    let mut swept = Swept::new();
    let mut points: Option<u64> = Some(1);
    for mut section in root.tables("axis", report) {
        let field = section.text("parameter", report);
        let name = section.require(field, "parameter", "the name of a parameter", report);
        let parameter = name.as_ref().and_then(|name| find(name, draft, report));
        let range = parameter.as_ref().map_or(Range::Any, Parameter::range);
        let values = values(&mut section, range, report);
        section.finish(report);

        let count = values.as_ref().map_or(1, |values| values.value.len());
        let product = points
            .and_then(|points| points.checked_mul(count))
            .filter(|&points| points <= MOST_POINTS);
        if let (Some(points), None, Some(values)) = (points, product, &values) {
            let title = format!("too many grid points: {points} before this axis, times {count}");
            report.push(
                Diagnostic::new(title)
                    .at(&values.at, format!("expected at most {MOST_POINTS} in all")),
            );
        }
        points = product;

        let (Some(name), Some(parameter)) = (name, parameter) else { continue };
        if !claim(&name, &parameter, &mut swept, draft, report) {
            continue;
        }
        if let (Some(values), Some(_)) = (values, product) {
            draft.origins.put(format!("axis[{}]", draft.plan.axes.len()), values.at);
            draft.plan.axes.push(Axis { parameter, values: values.value });
        }
    }
}

/// The values of an axis: listed, or a range.
fn values(
    section: &mut Section<'_>,
    range: Range,
    report: &mut Report,
) -> Option<Located<AxisValues>> {
    let listed = section.right_numbers("values", range, report);
    let spaced = section.table("range", "range = { from, to, count }", report);
    match (listed, spaced) {
        (Field::Absent, Field::Absent) => {
            section.missing(
                "values",
                "`values = [...]` or `range = { from = ..., to = ..., count = ... }`",
                report,
            );
            None
        }
        (Field::Given(listed), Field::Absent) => list(listed, report),
        (Field::Absent, Field::Given(spaced)) => spacing(spaced.value, range, report),
        (Field::Given(listed), Field::Given(spaced)) => {
            let diagnostic = Diagnostic::new("an axis has both `values` and `range`");
            report.push(
                diagnostic.at(&spaced.at, "expected only one of them").at(&listed.at, "given here"),
            );
            None
        }
        (Field::Bad, _) | (_, Field::Bad) => None,
    }
}

fn list(
    listed: Located<(Vec<Located<f64>>, bool)>,
    report: &mut Report,
) -> Option<Located<AxisValues>> {
    let (values, mut sound) = listed.value;
    if values.is_empty() && sound {
        report.push(
            Diagnostic::new("`values` is empty").at(&listed.at, "expected at least one number"),
        );
        return None;
    }
    let mut order: Vec<&Located<f64>> = values.iter().collect();
    order.sort_by(|a, b| a.value.total_cmp(&b.value).then(a.at.span.start.cmp(&b.at.span.start)));
    for pair in order.windows(2) {
        if pair[0].value == pair[1].value {
            let title = format!("the value {} is twice on this axis", decimal(pair[1].value));
            let diagnostic = Diagnostic::new(title).at(&pair[1].at, "expected each value once");
            report.push(diagnostic.at(&pair[0].at, "first given here"));
            sound = false;
        }
    }
    let values = AxisValues::List(values.iter().map(|value| value.value).collect());
    sound.then_some(Located { value: values, at: listed.at })
}

fn spacing(
    mut section: Section<'_>,
    range: Range,
    report: &mut Report,
) -> Option<Located<AxisValues>> {
    let at = section.at().clone();
    let end = |key: &'static str, section: &mut Section<'_>, report: &mut Report| {
        let field = section.number(key, range, report);
        section.require(field, key, "a number", report)
    };
    let from = end("from", &mut section, report);
    let to = end("to", &mut section, report);
    let field = section.count("count", MOST_POINTS, report);
    let count = section.require(field, "count", "the number of values, both ends included", report);
    let logarithmic = section.choice("spacing", &["linear", "log"], report).or(0);
    section.finish(report);
    let (from, to, count, logarithmic) = (from?, to?, count?, logarithmic? == 1);
    let mut refuse = |title: String, at: &Location, expected: &str| {
        report.push(Diagnostic::new(title).at(at, expected));
        None
    };
    if from.value == to.value && count.value > 1 {
        let title = format!(
            "a range from {0} to {0} has one value, not {1}",
            decimal(from.value),
            count.value
        );
        return refuse(title, &to.at, "expected another number, or count = 1");
    }
    if let Some(most) = most_distinct(from.value, to.value).filter(|&most| most < count.value) {
        let title = format!(
            "a range from {} to {} has no {} different values",
            decimal(from.value),
            decimal(to.value),
            count.value
        );
        let expected = format!("expected at most {most}, or ends farther apart");
        return refuse(title, &count.at, &expected);
    }
    if from.value != to.value && count.value == 1 {
        return refuse(
            "one value cannot be both ends of a range".to_owned(),
            &count.at,
            "expected at least 2",
        );
    }
    if logarithmic && !(from.value > 0.0 && to.value > 0.0) {
        let end = if from.value > 0.0 { &to } else { &from };
        let title = format!("{} has no logarithm", decimal(end.value));
        return refuse(title, &end.at, "expected a number greater than 0, or spacing = \"linear\"");
    }
    let (from, to, count) = (from.value, to.value, count.value);
    let value = if logarithmic {
        AxisValues::Log { from, to, count }
    } else {
        AxisValues::Linear { from, to, count }
    };
    Some(Located { value, at })
}

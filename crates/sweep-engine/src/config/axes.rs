//! Axes: parameters with the values that a grid, a design or a list gives them.

use std::borrow::Cow;
use std::collections::BTreeMap;

use sweep_parameter::{Parameter as _, Range, decimal};

use super::Read;
use super::grid::Draft;
use super::list::{self, List};
use super::parameters::{find, twice};
use super::report::{Diagnostic, Report};
use super::section::{Field, Section, quoted, refused_number};
use super::source::{Located, Location};
use crate::design::{Design, Distribution, MOST_AXES, REACH, Shape};
use crate::plan::{Axis, AxisValues};

/// Most grid points that are accepted. A hundred thousand points a second would take four months.
pub const MOST_POINTS: u64 = 1_000_000_000_000;

/// What axes write so far, by the single numbers.
type Swept = BTreeMap<Cow<'static, str>, Located<String>>;

/// Takes note that an axis writes this parameter's numbers; not if another one does.
fn claim<M: Read>(
    name: &Located<&str>,
    parameter: &M::Parameter,
    swept: &mut Swept,
    draft: &Draft<M>,
    report: &mut Report,
) -> bool {
    let parts = draft.plan.model.parts(parameter);
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
pub fn box_of_axes<M: Read>(
    root: &mut Section<'_>,
    design: Located<Design>,
    draft: &mut Draft<M>,
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
        let range = parameter.as_ref().map_or(Range::Any, |parameter| parameter.range());
        section.misplace(
            &["values"],
            "a design spreads its points over `range = { from = ..., to = ... }`",
        );
        let distributed =
            section.table("distribution", "distribution = { kind, ... }", report).given();
        let values = if let Some(distributed) = distributed {
            section.misplace(&["range"], "the distribution has its own `from` and `to`");
            distribution(distributed.value, range, design.value.points(), report)
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
pub fn listed_axes<M: Read>(
    root: &mut Section<'_>,
    mut list: List,
    draft: &mut Draft<M>,
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
    points: u64,
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
        Some(_) => None,
        None => {
            // An unknown kind has no list of keys, but each key has its range.
            for (key, range) in [
                ("mean", Range::Any),
                ("sd", Range::Positive),
                ("median", Range::Positive),
                ("sigma", Range::Positive),
            ] {
                number(key, range, false);
            }
            None
        }
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
    // Most of a distribution lies within one deviation of its middle.
    let [low, high] = shape.map_or(bounds, |shape| [shape.at(-1.0), shape.at(1.0)]);
    let [low, high] = [low.max(from), high.min(to)];
    if low < high && most_distinct(low, high).is_some_and(|most| most < points) {
        let title = format!(
            "a distribution from {} to {} has no {points} different values",
            decimal(from),
            decimal(to)
        );
        return refuse(
            title,
            "expected a wider one, or fewer `points` in [design]".to_owned(),
            report,
        );
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
pub fn axes<M: Read>(root: &mut Section<'_>, draft: &mut Draft<M>, report: &mut Report) {
    let mut swept = Swept::new();
    let mut points: Option<u64> = Some(1);
    for mut section in root.tables("axis", report) {
        let field = section.text("parameter", report);
        let name = section.require(field, "parameter", "the name of a parameter", report);
        let parameter = name.as_ref().and_then(|name| find(name, draft, report));
        let range = parameter.as_ref().map_or(Range::Any, |parameter| parameter.range());
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

//! Axes: parameters with the values that a grid, a design or a list gives them.

use sweep_parameter::{Range, decimal};
use sweep_results::nearest;

use super::draft::ClaimedNumbers;
use super::list::{self, List};
use super::parameters::{MAX_COMPARED_NAMES, find};
use super::report::{Diagnostic, Report};
use super::section::check_number;
use super::{Draft, Field, Located, Location, Section, quoted, refused_number, short};
use crate::Model;
use crate::design::{DesignRule, DistributionShape, MOST_AXES, TAIL_DEVIATIONS};
use crate::plan::MAX_POINTS;
use crate::{Axis, AxisTolerance, AxisValues, Design, Distribution, ModelParameter};

/// Claims the numbers that an axis writes. Returns false, after a report, if another axis writes
/// them. `is_about` says that the axis is a tolerance about the model's own number.
fn claim<M: Model>(
    name: &Located<&str>,
    parameter: &ModelParameter<M>,
    swept: &mut ClaimedNumbers,
    is_about: bool,
    draft: &Draft<'_, M>,
) -> bool {
    let report = draft.report;
    let parts = &parameter.parts;
    if !swept.claim(name, parts.clone(), report) {
        return false;
    }
    // A tolerance lies about the constant, so that the constant has an effect.
    for constant in draft.constants.iter().filter(|_| !is_about) {
        if constant.parameter.parts.iter().all(|part| parts.contains(part)) {
            let title = format!(
                "`{}` is swept by an axis: this constant has no effect",
                constant.name.value
            );
            let diagnostic = Diagnostic::new(title)
                .at(&constant.name.at, "expected a parameter that no axis sweeps");
            report.push(diagnostic.at(&name.at, "swept here"));
        }
    }
    true
}

/// Returns whether options fix all numbers of an axis, which then sweeps nothing.
fn is_fixed<M: Model>(parameter: &ModelParameter<M>, draft: &Draft<'_, M>) -> bool {
    let parts = &parameter.parts;
    let mut options = draft.constants.iter().filter(|constant| constant.is_over_file);
    options.any(|constant| parts.iter().all(|part| constant.parameter.parts.contains(part)))
}

/// Reads every `[[axis]]`: the values of a grid, or the ranges of a design.
pub fn axes<M: Model>(root: &Section<'_>, design: Option<Design>, draft: &mut Draft<'_, M>) {
    let report = root.report;
    let mut swept = ClaimedNumbers::default();
    let sections = root.tables("axis");
    if let (Some(design), Some(at)) = (&design, report.place("design")) {
        let most = if matches!(design, Design::Spread { rule: DesignRule::Sobol, .. }) {
            MOST_AXES
        } else {
            usize::MAX
        };
        if sections.is_empty() || sections.len() > most {
            let title = format!("a design by \"{}\" over {} axes", design.method(), sections.len());
            let expected = match most {
                usize::MAX => "expected at least one [[axis]] with a range".to_owned(),
                most => format!("expected from 1 to {most} [[axis]], each with a range"),
            };
            report.refuse::<()>(&at, title, expected);
        }
    }
    let mut points: Option<u64> = Some(1);
    for section in sections {
        let field = section.text("parameter");
        let name = section.require(field, "parameter", "the name of a parameter");
        let parameter = name.as_ref().and_then(|name| find(name, draft));
        let own = parameter.as_ref().map(|parameter| SweptFacts::new(parameter, draft));
        let own = own.unwrap_or(SweptFacts { name: "", range: Range::Any, value: None });
        let values = match &design {
            Some(design) => extent(&section, &own, design.points()),
            None => values(&section, &own),
        };
        let is_about = section.key_at("tolerance").is_some()
            || section.key_inside("distribution", "tolerance");
        section.finish();
        if parameter.as_ref().is_some_and(|parameter| is_fixed(parameter, draft)) {
            continue;
        }
        if design.is_none() {
            let count = values.as_ref().map_or(1, |values| values.value.values.len());
            let product = points.and_then(|points| points.checked_mul(count));
            let product = product.filter(|&points| points <= MAX_POINTS);
            if let (Some(points), None, Some(values)) = (points, product, &values) {
                let title =
                    format!("too many grid points: {points} before this axis, times {count}");
                let expected = format!("expected at most {MAX_POINTS} in all");
                report.refuse::<()>(&values.at, title, expected);
            }
            points = product;
        }
        if let (Some(name), Some(parameter)) = (name, parameter)
            && claim(&name, &parameter, &mut swept, is_about, draft)
            && let (Some(Located { value, at }), Some(_)) = (values, points)
        {
            let SpreadValues { values, tolerance } = value;
            add(Axis { parameter, values, tolerance }, at, draft);
        }
    }
    // A plan whose axes are all fixed is a single point.
    let is_point = draft.plan.axes.is_empty();
    draft.plan.design = design.filter(|_| !is_point);
}

/// Adds an axis to the plan.
pub fn add<M: Model>(axis: Axis<M>, at: Location, draft: &mut Draft<'_, M>) {
    draft.report.put(format!("axis[{}]", draft.plan.axes.len()), at);
    draft.plan.axes.push(axis);
}

/// Makes the columns of a list the plan's axes.
pub fn listed_axes<M: Model>(root: &Section<'_>, mut list: List, draft: &mut Draft<'_, M>) {
    let report = root.report;
    for section in root.tables("axis") {
        let expected = "the columns of the list are the axes; remove this";
        report.refuse::<()>(section.at(), "an [[axis]] beside a list of points", expected);
    }
    let mut swept = ClaimedNumbers::default();
    list.table.notes().into_iter().for_each(|note| report.note(format!("the list: {note}")));
    for column in std::mem::take(&mut list.table.columns) {
        let name = Located { value: column.name.value.as_str(), at: column.name.at.clone() };
        if name.value == list::ID || !column.is_known && is_foreign(&name, draft) {
            continue;
        }
        let Some(parameter) = find(&name, draft) else { continue };
        let range = parameter.range;
        let mut sound = true;
        for (row, &value) in
            column.values.iter().enumerate().filter(|(_, value)| !range.contains(**value))
        {
            sound = false;
            if list.table.is_refused(value) {
                continue;
            }
            report.push_with(|sources| {
                let what = format!("value {} of {}", row + 1, quoted(name.value));
                refused_number(&what, value, &list.table.place(sources, column.place, row), range)
            });
        }
        if claim(&name, &parameter, &mut swept, false, draft) && sound {
            let values = AxisValues::List(column.values);
            let axis = Axis { parameter, values, tolerance: None };
            add(axis, name.at.clone(), draft);
        }
    }
    if draft.plan.axes.is_empty() && report.is_clean() {
        let refusal = Diagnostic::new("the list of points has no column of a parameter")
            .help("`[columns]` in the grid file may name what its columns hold");
        let expected = "expected a file whose header names parameters";
        let at = report.place("design.file");
        report.push(at.into_iter().fold(refusal, |refusal, at| refusal.at(&at, expected)));
    }
    draft.plan.design = Some(list.design);
}

/// Returns whether a name is so different from all parameters that its column holds something else.
fn is_foreign<M: Model>(name: &Located<&str>, draft: &Draft<'_, M>) -> bool {
    let model = &draft.plan.model;
    let Err(error) = model.find(name.value) else { return false };
    let all = model.parameters();
    let near = nearest(name.value, all.iter().take(MAX_COMPARED_NAMES).map(|one| &*one.name));
    error.is_in_no_model && near.is_none()
}

/// The kinds of distributions by name, with their numbers; "uniform" is another name of a range.
pub const DISTRIBUTIONS: [(&str, &[(&str, Range)]); 3] = [
    ("normal", &[("mean", Range::Any), ("sd", Range::Positive)]),
    ("lognormal", &[("median", Range::Positive), ("sigma", Range::Positive)]),
    ("uniform", &[]),
];

/// The model's facts about a swept parameter.
struct SweptFacts<'p> {
    /// The name of the parameter; empty if it is unknown, which has been reported.
    name: &'p str,
    /// The range of valid values.
    range: Range,
    /// The value without the axis, if the model has a single number for it.
    value: Option<f64>,
}

impl<'p> SweptFacts<'p> {
    fn new<M: Model>(parameter: &'p ModelParameter<M>, draft: &Draft<'_, M>) -> Self {
        let plan = &draft.plan;
        let value = match parameter.window_edge {
            Some(edge) => Some(plan.window_s[edge]),
            None => parameter.value,
        };
        Self { name: &parameter.name, range: parameter.range, value }
    }

    /// Reads `tolerance`: a range about the model's own number, by a distance in its unit or in
    /// percent of it.
    fn tolerance(&self, section: &Section<'_>) -> Field<ToleranceRange> {
        section.text_or_number("tolerance").then(|found| {
            let report = section.report;
            let at = found.at;
            let text = found.value.trim();
            let percent = text.strip_suffix('%').map(str::trim_end);
            let number = percent.unwrap_or(text).parse().ok();
            let Some(number) = number.filter(|number| Range::Positive.contains(*number)) else {
                let title = format!("`tolerance` = \"{}\" is no tolerance", short(text));
                let expected = "expected a positive number in the parameter's unit, or percent of \
                    its value as in \"5 %\"";
                return report.refuse(&at, title, expected);
            };
            if self.name.is_empty() {
                return None;
            }
            let Some(middle) = self.value else {
                let title =
                    format!("`{}` has no single number as the middle of a tolerance", self.name);
                let expected =
                    "expected a range: it sets numbers that differ, or that the model lacks";
                return report.refuse(&at, title, expected);
            };
            // This order of operations is exact: 120 less 5 % is 114.
            let [from, to] = match percent {
                Some(_) => [100.0 - number, 100.0 + number].map(|part| middle * part / 100.0),
                None => [middle - number, middle + number],
            };
            let [from, to] = [from.min(to), from.max(to)];
            for end in [from, to] {
                check_number(&quoted(self.name), end, at.clone(), self.range, report)?;
            }
            if from == to {
                let title = format!("`{}` is 0, and so is every percentage of it", self.name);
                return report.refuse(&at, title, "expected a tolerance in the parameter's unit");
            }
            let tolerance = match percent {
                Some(_) => AxisTolerance::Percent(number),
                None => AxisTolerance::Distance(number),
            };
            Some(Located { value: ToleranceRange { tolerance, from, middle, to }, at })
        })
    }
}

/// The values of an axis, with the tolerance from which they follow.
struct SpreadValues {
    values: AxisValues,
    tolerance: Option<AxisTolerance>,
}

fn without_tolerance(found: Located<AxisValues>) -> Located<SpreadValues> {
    let value = SpreadValues { values: found.value, tolerance: None };
    Located { value, at: found.at }
}

/// A range about the model's own number.
#[derive(Clone, Copy)]
struct ToleranceRange {
    tolerance: AxisTolerance,
    from: f64,
    middle: f64,
    to: f64,
}

/// Standard deviations between the middle of a tolerance and its ends. Basis: a process that just
/// meets it (capability 1) has 99.7 % within. Doubling it halves the spread of parts.
const DEVIATIONS: f64 = 3.0;

impl ToleranceRange {
    /// Returns evenly spaced values with both ends.
    const fn values(self, count: u64) -> SpreadValues {
        let values = AxisValues::Linear { from: self.from, to: self.to, count };
        SpreadValues { values, tolerance: Some(self.tolerance) }
    }

    /// Returns the shape of a distribution within the tolerance, by its index in [`DISTRIBUTIONS`];
    /// `None` for a uniform one.
    fn shape(self, kind: usize) -> Option<DistributionShape> {
        match kind {
            0 => Some(DistributionShape::Normal {
                mean: self.middle,
                sd: (self.to - self.from) / 2.0 / DEVIATIONS,
            }),
            1 => Some(DistributionShape::Lognormal {
                median: self.middle,
                sigma: libm::log(self.to / self.middle) / DEVIATIONS,
            }),
            _ => None,
        }
    }
}

/// Reads a distribution truncated at `from` and `to`.
fn distribution(
    section: Section<'_>,
    own: &SweptFacts<'_>,
    points: u64,
) -> Option<Located<SpreadValues>> {
    let at = section.at().clone();
    let report = section.report;
    let range = own.range;
    let field = section.choice("kind", &DISTRIBUTIONS.map(|(kind, _)| kind));
    let kind = section.require(field, "kind", "`normal`, `lognormal` or `uniform`");
    let kind = kind.map(|kind| kind.value);
    let number = |key, range, needed: bool| {
        let field = section.number(key, range);
        let field = section.expect(field, key, needed.then_some("a number"));
        field.given().map(|number| number.value)
    };
    let field = own.tolerance(&section);
    let mut tolerance = None;
    let (shape, bounds) = if let Field::Absent = field {
        // An unknown kind has no list of keys, but each key has a range.
        let keys = kind.map_or(&DISTRIBUTIONS[..], |kind| &DISTRIBUTIONS[kind..=kind]);
        let keys = keys.iter().flat_map(|(_, numbers)| *numbers);
        let numbers: Vec<_> =
            keys.map(|&(key, range)| number(key, range, kind.is_some())).collect();
        let shape = match (kind, numbers.as_slice()) {
            (Some(0), &[Some(mean), Some(sd)]) => Some(DistributionShape::Normal { mean, sd }),
            (Some(1), &[Some(median), Some(sigma)]) => {
                Some(DistributionShape::Lognormal { median, sigma })
            }
            _ => None,
        };
        let [from, to] = ["from", "to"].map(|key| number(key, range, kind == Some(2)));
        section.finish();
        let bounds = match shape {
            Some(shape) => [
                from.unwrap_or(shape.at(-TAIL_DEVIATIONS)),
                to.unwrap_or(shape.at(TAIL_DEVIATIONS)),
            ],
            None => [from?, to?],
        };
        (shape, bounds)
    } else {
        let reason = "`tolerance` gives it, about the machine's own number";
        section.misplace(&["mean", "sd", "median", "sigma", "from", "to"], reason);
        section.finish();
        let range = field.given()?.value;
        if kind? == 1 && range.from <= 0.0 {
            let title = format!("a tolerance down to {} has no logarithm", decimal(range.from));
            return report.refuse(&at, title, "expected a positive range, or kind = \"normal\"");
        }
        tolerance = Some(range.tolerance);
        (range.shape(kind?), [range.from, range.to])
    };
    let [from, to] = bounds;
    let [from_said, to_said] = bounds.map(decimal);
    if from.partial_cmp(&to) != Some(std::cmp::Ordering::Less) {
        let title = format!("a distribution from {from_said} to {to_said}");
        return report.refuse(&at, title, "expected `from` below `to`");
    }
    if let Some(&beyond) = bounds.iter().find(|&&bound| !range.contains(bound)) {
        let title = format!("the distribution reaches to {}", decimal(beyond));
        return report.refuse(&at, title, format!("expected {range}: cut it by `from` and `to`"));
    }
    // Most of a distribution lies within one deviation of its middle.
    let [low, high] = shape.map_or(bounds, |shape| [shape.at(-1.0), shape.at(1.0)]);
    let [low, high] = [low.max(from), high.min(to)];
    if low < high && most_distinct(low, high).is_some_and(|most| most < points) {
        let title = format!(
            "a distribution from {from_said} to {to_said} has no {points} different values"
        );
        let expected = "expected a wider one, or fewer `points` in [design]";
        return report.refuse(&at, title, expected);
    }
    let values = match shape {
        None => AxisValues::Linear { from, to, count: 2 },
        Some(shape) => {
            let [low, high] = [shape.at(-TAIL_DEVIATIONS), shape.at(TAIL_DEVIATIONS)];
            if to <= low || high <= from {
                let title =
                    format!("no part of the distribution lies between {from_said} and {to_said}");
                let [low, high] = [low, high].map(decimal);
                let expected = format!("expected bounds within {low} and {high}");
                return report.refuse(&at, title, expected);
            }
            AxisValues::Distributed(Distribution { shape, from, to })
        }
    };
    Some(Located { value: SpreadValues { values, tolerance }, at })
}

/// Reads the range or distribution over which a design spreads `points` points.
fn extent(
    section: &Section<'_>,
    own: &SweptFacts<'_>,
    points: u64,
) -> Option<Located<SpreadValues>> {
    let reason = "a design spreads its points over `range = { from = ..., to = ... }`";
    section.misplace(&["values"], reason);
    let tolerance = own.tolerance(section);
    if !matches!(tolerance, Field::Absent) {
        section.misplace(&["range", "distribution"], BESIDE_TOLERANCE);
        section.misplace(&["count"], "the number of points belongs in [design], as `points`");
        let Located { value: range, at } = tolerance.given()?;
        return Some(Located { value: range.values(2), at });
    }
    match section.table("distribution", "distribution = { kind, ... }").given() {
        Some(distributed) => {
            section.misplace(&["range"], "the distribution has its own `from` and `to`");
            distribution(distributed.value, own, points)
        }
        None => {
            let field = section.table("range", "range = { from, to }");
            let spaced = section.require(field, "range", "`range = { from = ..., to = ... }`")?;
            spacing(spaced.value, own.range, Some(points)).map(without_tolerance)
        }
    }
}

/// The reason for rejecting other keys beside a tolerance.
const BESIDE_TOLERANCE: &str = "`tolerance` gives the ends, about the machine's own number";

/// Minimum distance between neighbouring values, as a share of the greater end. Basis: closer
/// values could round to the same number.
const MIN_SEPARATION: f64 = 8.0 * f64::EPSILON;

/// Returns the maximum number of distinct values in a range; `None` if it exceeds every limit.
fn most_distinct(from: f64, to: f64) -> Option<u64> {
    let steps = ((to - from).abs() / (MIN_SEPARATION * from.abs().max(to.abs()))).floor();
    // Both ends are exact, however close they are.
    (steps < MAX_POINTS as f64).then_some((steps as u64 + 1).max(2))
}

/// Reads the values of an axis: listed, or as a range.
fn values(section: &Section<'_>, own: &SweptFacts<'_>) -> Option<Located<SpreadValues>> {
    let range = own.range;
    let tolerance = own.tolerance(section);
    if !matches!(tolerance, Field::Absent) {
        section.misplace(&["values", "range"], BESIDE_TOLERANCE);
        let expected = "the number of values, both ends included";
        let count = section.whole("count", &(2..=MAX_POINTS));
        let count = section.require(count, "count", expected);
        let Located { value: range, at } = tolerance.given()?;
        let count = count?.value;
        if let Some(most) = most_distinct(range.from, range.to).filter(|&most| most < count) {
            let title = format!("a tolerance has no {count} different values");
            return section.report.refuse(&at, title, format!("expected at most {most}"));
        }
        return Some(Located { value: range.values(count), at });
    }
    let listed = section.right_numbers("values", range);
    let spaced = section.table("range", "range = { from, to, count }");
    match (listed, spaced) {
        (Field::Absent, Field::Absent) => {
            section.missing(
                "values",
                "`values = [...]` or `range = { from = ..., to = ..., count = ... }`",
            );
            None
        }
        (Field::Given(listed), Field::Absent) => {
            list(listed, section.report).map(without_tolerance)
        }
        (Field::Absent, Field::Given(spaced)) => {
            spacing(spaced.value, range, None).map(without_tolerance)
        }
        (Field::Given(listed), Field::Given(spaced)) => {
            let diagnostic = Diagnostic::new("an axis has both `values` and `range`");
            section.report.push(
                diagnostic.at(&spaced.at, "expected only one of them").at(&listed.at, "given here"),
            );
            None
        }
        (Field::Bad, _) | (_, Field::Bad) => None,
    }
}

fn list(
    listed: Located<(Vec<Located<f64>>, bool)>,
    report: &Report,
) -> Option<Located<AxisValues>> {
    let (values, mut sound) = listed.value;
    if values.is_empty() && sound {
        return report.refuse(&listed.at, "`values` is empty", "expected at least one number");
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

/// Reads a range with a count, or one for the `points` points of a design.
pub fn spacing(
    section: Section<'_>,
    range: Range,
    points: Option<u64>,
) -> Option<Located<AxisValues>> {
    let at = section.at().clone();
    let report = section.report;
    let [from, to] =
        ["from", "to"].map(|key| section.require(section.number(key, range), key, "a number"));
    let count = match points {
        None => {
            let expected = "the number of values, both ends included";
            section.require(section.whole("count", &(1..=MAX_POINTS)), "count", expected)
        }
        Some(value) => {
            let reason = "the number of points belongs in [design], as `points`";
            section.misplace(&["count"], reason);
            Some(Located { value, at: at.clone() })
        }
    };
    let logarithmic = section.choice("spacing", &["linear", "log"]).or(0);
    section.finish();
    let from = from?;
    let to = to?;
    let count = count?;
    let logarithmic = logarithmic? == 1;
    let is_point = from.value == to.value;
    let is_design = points.is_some();
    let [low, high] = [from.value, to.value].map(decimal);
    if is_point && is_design {
        let title = format!("a design cannot spread points from {low} to {high}");
        return report.refuse(&to.at, title, "expected another number");
    }
    if is_point && count.value > 1 {
        let title = format!("a range from {low} to {high} has one value, not {}", count.value);
        return report.refuse(&to.at, title, "expected another number, or count = 1");
    }
    if !is_point && !is_design && count.value == 1 {
        let title = "one value cannot be both ends of a range";
        return report.refuse(&count.at, title, "expected at least 2");
    }
    if logarithmic && !(from.value > 0.0 && to.value > 0.0) {
        let end = if from.value > 0.0 { &to } else { &from };
        let title = format!("{} has no logarithm", decimal(end.value));
        let expected = "expected a number greater than 0, or spacing = \"linear\"";
        return report.refuse(&end.at, title, expected);
    }
    if let Some(most) = most_distinct(from.value, to.value).filter(|&most| most < count.value) {
        let title = format!("a range from {low} to {high} has no {} different values", count.value);
        if is_design {
            let expected = "expected ends farther apart, or fewer `points` in [design]";
            return report.refuse(&to.at, title, expected);
        }
        let expected = format!("expected at most {most}, or ends farther apart");
        return report.refuse(&count.at, title, expected);
    }
    // A design's range has its two ends as values; the design chooses the points between.
    let from = from.value;
    let to = to.value;
    let count = if is_design { 2 } else { count.value };
    let value = if logarithmic {
        AxisValues::Log { from, to, count }
    } else {
        AxisValues::Linear { from, to, count }
    };
    Some(Located { value, at })
}

//! Axes: parameters with the values that a grid, a design or a list gives them.

use sweep_parameter::{Range, decimal};
use sweep_results::nearest_name;

use super::draft::WrittenNumbers;
use super::list::{self, PointList};
use super::parameters::{MAX_COMPARED_NAMES, find_parameter};
use super::report::{Diagnostic, Report};
use super::section::check_number;
use super::{Draft, Field, Located, Location, Section, number_mistake, quote, shorten};
use crate::Model;
use crate::design::{DesignRule, DistributionShape, MAX_AXES, TAIL_DEVIATIONS};
use crate::plan::MAX_POINTS;
use crate::{Axis, AxisTolerance, AxisValues, Design, Distribution, ModelParameter};

/// Records the numbers that an axis writes. Returns false, after a report, if another axis writes
/// one of them. `has_tolerance` is true for an axis with a tolerance about the model's own number.
fn record_written_numbers<M: Model>(
    name: &Located<&str>,
    parameter: &ModelParameter<M>,
    written_numbers: &mut WrittenNumbers,
    has_tolerance: bool,
    draft: &Draft<'_, M>,
) -> bool {
    let report = draft.report;
    let number_names = &parameter.number_names;
    if !written_numbers.record(name, number_names.clone(), report) {
        return false;
    }
    // The constant has an effect on a tolerance, as its nominal value.
    for constant in draft.constants.iter().filter(|_| !has_tolerance) {
        if constant.parameter.number_names.iter().all(|part| number_names.contains(part)) {
            let title = format!(
                "`{}` is swept by an axis: this constant has no effect",
                constant.name.value
            );
            let diagnostic = Diagnostic::new(title)
                .at_location(&constant.name.location, "expected a parameter that no axis sweeps");
            report.push(diagnostic.at_location(&name.location, "swept here"));
        }
    }
    true
}

/// Returns whether options fix all numbers of an axis, so that it sweeps nothing.
fn is_fixed<M: Model>(swept_parameter: &ModelParameter<M>, draft: &Draft<'_, M>) -> bool {
    let number_names = &swept_parameter.number_names;
    let mut overriding_constants =
        draft.constants.iter().filter(|constant| constant.overrides_file);
    overriding_constants.any(|constant| {
        number_names.iter().all(|part| constant.parameter.number_names.contains(part))
    })
}

/// Reads every `[[axis]]`: the values of a grid, or the ranges of a design.
pub fn read_axes<M: Model>(root: &Section<'_>, design: Option<Design>, draft: &mut Draft<'_, M>) {
    let report = root.report;
    let mut written_numbers = WrittenNumbers::default();
    let sections = root.tables("axis");
    if let (Some(design), Some(location)) = (&design, report.location("design")) {
        let max_count = if matches!(design, Design::Spread { rule: DesignRule::Sobol, .. }) {
            MAX_AXES
        } else {
            usize::MAX
        };
        if sections.is_empty() || sections.len() > max_count {
            let title = format!("a design by \"{}\" over {} axes", design.method(), sections.len());
            let expectation = match max_count {
                usize::MAX => "expected at least one [[axis]] with a range".to_owned(),
                max_count => format!("expected from 1 to {max_count} [[axis]], each with a range"),
            };
            report.refuse::<()>(&location, title, expectation);
        }
    }
    let mut point_count: Option<u64> = Some(1);
    for section in sections {
        let field = section.text("parameter");
        let name = section.require(field, "parameter", "the name of a parameter");
        let parameter = name.as_ref().and_then(|name| find_parameter(name, draft));
        let swept_parameter =
            parameter.as_ref().map(|parameter| SweptParameter::new(parameter, draft));
        let swept_parameter =
            swept_parameter.unwrap_or(SweptParameter { name: "", range: Range::Any, value: None });
        let values = match &design {
            Some(design) => read_design_values(&section, &swept_parameter, design.points()),
            None => read_values(&section, &swept_parameter),
        };
        let has_tolerance = section.key_location("tolerance").is_some()
            || section.has_inner_key("distribution", "tolerance");
        section.finish();
        if parameter.as_ref().is_some_and(|parameter| is_fixed(parameter, draft)) {
            continue;
        }
        if design.is_none() {
            let value_count = values.as_ref().map_or(1, |values| values.value.values.len());
            let new_point_count =
                point_count.and_then(|point_count| point_count.checked_mul(value_count));
            let new_point_count = new_point_count.filter(|&point_count| point_count <= MAX_POINTS);
            if let (Some(point_count), None, Some(values)) = (point_count, new_point_count, &values)
            {
                let title = format!(
                    "too many grid points: {point_count} before this axis, times {value_count}"
                );
                let expectation = format!("expected at most {MAX_POINTS} in all");
                report.refuse::<()>(&values.location, title, expectation);
            }
            point_count = new_point_count;
        }
        if let (Some(name), Some(parameter)) = (name, parameter)
            && record_written_numbers(&name, &parameter, &mut written_numbers, has_tolerance, draft)
            && let (Some(Located { value, location }), Some(_)) = (values, point_count)
        {
            let ValuesWithTolerance { values, tolerance } = value;
            add_axis(Axis { parameter, values, tolerance }, location, draft);
        }
    }
    // A plan whose axes are all fixed is a single point.
    let has_one_value = draft.plan.axes.is_empty();
    draft.plan.design = design.filter(|_| !has_one_value);
}

/// Adds an axis to the plan.
pub fn add_axis<M: Model>(axis: Axis<M>, location: Location, draft: &mut Draft<'_, M>) {
    draft.report.record_location(format!("axis[{}]", draft.plan.axes.len()), location);
    draft.plan.axes.push(axis);
}

/// Makes the columns of a list the plan's axes.
pub fn add_list_axes<M: Model>(root: &Section<'_>, mut list: PointList, draft: &mut Draft<'_, M>) {
    let report = root.report;
    for section in root.tables("axis") {
        let expectation = "the columns of the list are the axes; remove this";
        report.refuse::<()>(section.location(), "an [[axis]] beside a list of points", expectation);
    }
    let mut written_numbers = WrittenNumbers::default();
    list.table.notes().into_iter().for_each(|note| report.add_note(format!("the list: {note}")));
    for column in std::mem::take(&mut list.table.columns) {
        let name =
            Located { value: column.name.value.as_str(), location: column.name.location.clone() };
        if name.value == list::ID_COLUMN || !column.is_known && is_unlike_parameters(&name, draft) {
            continue;
        }
        let Some(parameter) = find_parameter(&name, draft) else { continue };
        let range = parameter.range;
        let mut is_valid = true;
        for (row, &value) in
            column.values.iter().enumerate().filter(|(_, value)| !range.contains(**value))
        {
            is_valid = false;
            if list.table.is_rejected(value) {
                continue;
            }
            report.push_with(|sources| {
                let description = format!("value {} of {}", row + 1, quote(name.value));
                number_mistake(
                    &description,
                    value,
                    &list.table.locate(sources, column.column_index, row),
                    range,
                )
            });
        }
        if record_written_numbers(&name, &parameter, &mut written_numbers, false, draft) && is_valid
        {
            let values = AxisValues::List(column.values);
            let axis = Axis { parameter, values, tolerance: None };
            add_axis(axis, name.location.clone(), draft);
        }
    }
    if draft.plan.axes.is_empty() && report.is_clean() {
        let refusal = Diagnostic::new("the list of points has no column of a parameter")
            .with_help("`[columns]` in the grid file may name what its columns hold");
        let expectation = "expected a file whose header names parameters";
        let location = report.location("design.file");
        report.push(
            location
                .into_iter()
                .fold(refusal, |refusal, location| refusal.at_location(&location, expectation)),
        );
    }
    draft.plan.design = Some(list.design);
}

/// Returns whether a name is so different from all parameters that its column holds something else.
fn is_unlike_parameters<M: Model>(name: &Located<&str>, draft: &Draft<'_, M>) -> bool {
    let model = &draft.plan.model;
    let Err(error) = model.find(name.value) else { return false };
    let parameters = model.parameters();
    let nearest_name = nearest_name(
        name.value,
        parameters.iter().take(MAX_COMPARED_NAMES).map(|parameter| &*parameter.name),
    );
    error.is_in_no_model && nearest_name.is_none()
}

/// The kinds of distributions by name, with their numbers; "uniform" is another name of a range.
pub const DISTRIBUTIONS: [(&str, &[(&str, Range)]); 3] = [
    ("normal", &[("mean", Range::Any), ("sd", Range::Positive)]),
    ("lognormal", &[("median", Range::Positive), ("sigma", Range::Positive)]),
    ("uniform", &[]),
];

/// A swept parameter, as the model describes it.
struct SweptParameter<'p> {
    /// The name of the parameter; empty if it is unknown, which has been reported.
    name: &'p str,
    /// The range of valid values.
    range: Range,
    /// The value without the axis, if the model has a single number for it.
    value: Option<f64>,
}

impl<'p> SweptParameter<'p> {
    fn new<M: Model>(parameter: &'p ModelParameter<M>, draft: &Draft<'_, M>) -> Self {
        let plan = &draft.plan;
        let value = match parameter.window_edge {
            Some(edge) => Some(plan.window_s[edge]),
            None => parameter.value,
        };
        Self { name: &parameter.name, range: parameter.range, value }
    }

    /// Reads `tolerance`: a range about the model's own number, as a distance in the parameter's
    /// unit or in percent of the number.
    fn read_tolerance(&self, section: &Section<'_>) -> Field<ToleranceRange> {
        section.text_or_number("tolerance").and_then(|tolerance_text| {
            let report = section.report;
            let location = tolerance_text.location;
            let text = tolerance_text.value.trim();
            let percent_text = text.strip_suffix('%').map(str::trim_end);
            let number = percent_text.unwrap_or(text).parse().ok();
            let Some(number) = number.filter(|number| Range::Positive.contains(*number)) else {
                let title = format!("`tolerance` = \"{}\" is no tolerance", shorten(text));
                let expectation = "expected a positive number in the parameter's unit, or percent \
                                   of its value as in \"5 %\"";
                return report.refuse(&location, title, expectation);
            };
            if self.name.is_empty() {
                return None;
            }
            let Some(nominal) = self.value else {
                let title =
                    format!("`{}` has no single number as the middle of a tolerance", self.name);
                let expectation =
                    "expected a range: it sets numbers that differ, or that the model lacks";
                return report.refuse(&location, title, expectation);
            };
            // This order of operations is exact for round numbers: 120 less 5 % is 114.
            let [from, to] = match percent_text {
                Some(_) => [100.0 - number, 100.0 + number].map(|part| nominal * part / 100.0),
                None => [nominal - number, nominal + number],
            };
            let [from, to] = [from.min(to), from.max(to)];
            for range_end in [from, to] {
                check_number(&quote(self.name), range_end, location.clone(), self.range, report)?;
            }
            if from == to {
                let title = format!("`{}` is 0, and so is every percentage of it", self.name);
                return report.refuse(
                    &location,
                    title,
                    "expected a tolerance in the parameter's unit",
                );
            }
            let tolerance = match percent_text {
                Some(_) => AxisTolerance::Percent(number),
                None => AxisTolerance::Distance(number),
            };
            Some(Located { value: ToleranceRange { tolerance, from, nominal, to }, location })
        })
    }
}

/// The values of an axis, with the tolerance from which they follow.
struct ValuesWithTolerance {
    values: AxisValues,
    tolerance: Option<AxisTolerance>,
}

fn without_tolerance(found: Located<AxisValues>) -> Located<ValuesWithTolerance> {
    let value = ValuesWithTolerance { values: found.value, tolerance: None };
    Located { value, location: found.location }
}

/// A range about the model's own number, the nominal value.
#[derive(Clone, Copy)]
struct ToleranceRange {
    tolerance: AxisTolerance,
    from: f64,
    nominal: f64,
    to: f64,
}

/// Standard deviations between the nominal value and either end of a tolerance. Basis: a process
/// that just meets its tolerance (capability 1) has 99.7 % of its parts within. Doubling it halves
/// the spread of parts.
const TOLERANCE_DEVIATIONS: f64 = 3.0;

impl ToleranceRange {
    /// Returns evenly spaced values with both ends.
    const fn spaced_values(self, value_count: u64) -> ValuesWithTolerance {
        let values = AxisValues::Linear { from: self.from, to: self.to, count: value_count };
        ValuesWithTolerance { values, tolerance: Some(self.tolerance) }
    }

    /// Returns the shape of a distribution within the tolerance, by its index in [`DISTRIBUTIONS`];
    /// `None` for a uniform one.
    fn distribution_shape(self, kind: usize) -> Option<DistributionShape> {
        match kind {
            0 => Some(DistributionShape::Normal {
                mean: self.nominal,
                sd: (self.to - self.from) / 2.0 / TOLERANCE_DEVIATIONS,
            }),
            1 => Some(DistributionShape::Lognormal {
                median: self.nominal,
                sigma: libm::log(self.to / self.nominal) / TOLERANCE_DEVIATIONS,
            }),
            _ => None,
        }
    }
}

/// Reads a distribution truncated at `from` and `to`.
fn read_distribution(
    section: Section<'_>,
    swept_parameter: &SweptParameter<'_>,
    points: u64,
) -> Option<Located<ValuesWithTolerance>> {
    let location = section.location().clone();
    let report = section.report;
    let range = swept_parameter.range;
    let field = section.choice("kind", &DISTRIBUTIONS.map(|(kind, _)| kind));
    let kind = section.require(field, "kind", "`normal`, `lognormal` or `uniform`");
    let kind = kind.map(|kind| kind.value);
    let read_number = |key, range, is_required: bool| {
        let field = section.number(key, range);
        let field = section.report_if_missing(field, key, is_required.then_some("a number"));
        field.into_located().map(|read_number| read_number.value)
    };
    let field = swept_parameter.read_tolerance(&section);
    let mut tolerance = None;
    let (shape, bounds) = if let Field::Absent = field {
        // The keys of an unknown kind are unknown, so that the keys of all kinds are read with
        // their ranges.
        let keys = kind.map_or(&DISTRIBUTIONS[..], |kind| &DISTRIBUTIONS[kind..=kind]);
        let keys = keys.iter().flat_map(|(_, numbers)| *numbers);
        let numbers: Vec<_> =
            keys.map(|&(key, range)| read_number(key, range, kind.is_some())).collect();
        let shape = match (kind, numbers.as_slice()) {
            (Some(0), &[Some(mean), Some(sd)]) => Some(DistributionShape::Normal { mean, sd }),
            (Some(1), &[Some(median), Some(sigma)]) => {
                Some(DistributionShape::Lognormal { median, sigma })
            }
            _ => None,
        };
        let [from, to] = ["from", "to"].map(|key| read_number(key, range, kind == Some(2)));
        section.finish();
        let bounds = match shape {
            Some(shape) => [
                from.unwrap_or(shape.value(-TAIL_DEVIATIONS)),
                to.unwrap_or(shape.value(TAIL_DEVIATIONS)),
            ],
            None => [from?, to?],
        };
        (shape, bounds)
    } else {
        let misplacement_reason = "`tolerance` gives it, about the machine's own number";
        section
            .mark_misplaced(&["mean", "sd", "median", "sigma", "from", "to"], misplacement_reason);
        section.finish();
        let range = field.into_located()?.value;
        if kind? == 1 && range.from <= 0.0 {
            let title = format!("a tolerance down to {} has no logarithm", decimal(range.from));
            return report.refuse(
                &location,
                title,
                "expected a positive range, or kind = \"normal\"",
            );
        }
        tolerance = Some(range.tolerance);
        (range.distribution_shape(kind?), [range.from, range.to])
    };
    let [from, to] = bounds;
    let [from_text, to_text] = bounds.map(decimal);
    if from.partial_cmp(&to) != Some(std::cmp::Ordering::Less) {
        let title = format!("a distribution from {from_text} to {to_text}");
        return report.refuse(&location, title, "expected `from` below `to`");
    }
    if let Some(&bound_out_of_range) = bounds.iter().find(|&&bound| !range.contains(bound)) {
        let title = format!("the distribution reaches to {}", decimal(bound_out_of_range));
        return report.refuse(
            &location,
            title,
            format!("expected {range}: cut it by `from` and `to`"),
        );
    }
    // Two thirds of a distribution lie within one deviation of its middle.
    let [low, high] = shape.map_or(bounds, |shape| [shape.value(-1.0), shape.value(1.0)]);
    let [low, high] = [low.max(from), high.min(to)];
    if low < high && max_distinct_values(low, high).is_some_and(|max_count| max_count < points) {
        let title = format!(
            "a distribution from {from_text} to {to_text} has no {points} different values"
        );
        let expectation = "expected a wider one, or fewer `points` in [design]";
        return report.refuse(&location, title, expectation);
    }
    let values = match shape {
        None => AxisValues::Linear { from, to, count: 2 },
        Some(shape) => {
            let [low, high] = [shape.value(-TAIL_DEVIATIONS), shape.value(TAIL_DEVIATIONS)];
            if to <= low || high <= from {
                let title =
                    format!("no part of the distribution lies between {from_text} and {to_text}");
                let [low, high] = [low, high].map(decimal);
                let expectation = format!("expected bounds within {low} and {high}");
                return report.refuse(&location, title, expectation);
            }
            AxisValues::Distributed(Distribution { shape, from, to })
        }
    };
    Some(Located { value: ValuesWithTolerance { values, tolerance }, location })
}

/// Reads the range or distribution over which a design spreads `points` points.
fn read_design_values(
    section: &Section<'_>,
    swept_parameter: &SweptParameter<'_>,
    points: u64,
) -> Option<Located<ValuesWithTolerance>> {
    let misplacement_reason = "a design spreads its points over `range = { from = ..., to = ... }`";
    section.mark_misplaced(&["values"], misplacement_reason);
    let tolerance = swept_parameter.read_tolerance(section);
    if !matches!(tolerance, Field::Absent) {
        section.mark_misplaced(&["range", "distribution"], MISPLACED_BESIDE_TOLERANCE);
        section.mark_misplaced(&["count"], "the number of points belongs in [design], as `points`");
        let Located { value: range, location } = tolerance.into_located()?;
        return Some(Located { value: range.spaced_values(2), location });
    }
    match section.table("distribution", "distribution = { kind, ... }").into_located() {
        Some(distributed) => {
            section.mark_misplaced(&["range"], "the distribution has its own `from` and `to`");
            read_distribution(distributed.value, swept_parameter, points)
        }
        None => {
            let field = section.table("range", "range = { from, to }");
            let range_section =
                section.require(field, "range", "`range = { from = ..., to = ... }`")?;
            read_range(range_section.value, swept_parameter.range, Some(points))
                .map(without_tolerance)
        }
    }
}

/// The reason for rejecting other keys beside a tolerance.
const MISPLACED_BESIDE_TOLERANCE: &str =
    "`tolerance` gives the ends, about the machine's own number";

/// Minimum distance between neighbouring values, as a share of the greater end. Basis: closer
/// values could round to the same number. Doubling it halves the greatest number of values in a
/// narrow range.
const MIN_SEPARATION: f64 = 8.0 * f64::EPSILON;

/// Returns the maximum number of distinct values in a range; `None` if it exceeds every limit.
fn max_distinct_values(from: f64, to: f64) -> Option<u64> {
    let steps = ((to - from).abs() / (MIN_SEPARATION * from.abs().max(to.abs()))).floor();
    // Both ends are exact, however close they are.
    (steps < MAX_POINTS as f64).then_some((steps as u64 + 1).max(2))
}

/// Reads the values of an axis: listed, or as a range.
fn read_values(
    section: &Section<'_>,
    swept_parameter: &SweptParameter<'_>,
) -> Option<Located<ValuesWithTolerance>> {
    let range = swept_parameter.range;
    let tolerance = swept_parameter.read_tolerance(section);
    if !matches!(tolerance, Field::Absent) {
        section.mark_misplaced(&["values", "range"], MISPLACED_BESIDE_TOLERANCE);
        let expectation = "the number of values, both ends included";
        let value_count = section.whole_number("count", &(2..=MAX_POINTS));
        let value_count = section.require(value_count, "count", expectation);
        let Located { value: range, location } = tolerance.into_located()?;
        let value_count = value_count?.value;
        if let Some(max_count) =
            max_distinct_values(range.from, range.to).filter(|&max_count| max_count < value_count)
        {
            let title = format!("a tolerance has no {value_count} different values");
            return section.report.refuse(
                &location,
                title,
                format!("expected at most {max_count}"),
            );
        }
        return Some(Located { value: range.spaced_values(value_count), location });
    }
    let value_list = section.valid_numbers("values", range);
    let range_section = section.table("range", "range = { from, to, count }");
    match (value_list, range_section) {
        (Field::Absent, Field::Absent) => {
            section.report_missing(
                "values",
                "`values = [...]` or `range = { from = ..., to = ..., count = ... }`",
            );
            None
        }
        (Field::Present(value_list), Field::Absent) => {
            check_value_list(value_list, section.report).map(without_tolerance)
        }
        (Field::Absent, Field::Present(range_section)) => {
            read_range(range_section.value, range, None).map(without_tolerance)
        }
        (Field::Present(value_list), Field::Present(range_section)) => {
            let diagnostic = Diagnostic::new("an axis has both `values` and `range`");
            section.report.push(
                diagnostic
                    .at_location(&range_section.location, "expected only one of them")
                    .at_location(&value_list.location, "given here"),
            );
            None
        }
        (Field::Rejected, _) | (_, Field::Rejected) => None,
    }
}

fn check_value_list(
    value_list: Located<(Vec<Located<f64>>, bool)>,
    report: &Report,
) -> Option<Located<AxisValues>> {
    let (values, mut is_valid) = value_list.value;
    if values.is_empty() && is_valid {
        return report.refuse(
            &value_list.location,
            "`values` is empty",
            "expected at least one number",
        );
    }
    let mut sorted_values: Vec<&Located<f64>> = values.iter().collect();
    sorted_values.sort_by(|a, b| {
        a.value.total_cmp(&b.value).then(a.location.span.start.cmp(&b.location.span.start))
    });
    for pair in sorted_values.windows(2) {
        if pair[0].value == pair[1].value {
            let title = format!("the value {} is twice on this axis", decimal(pair[1].value));
            let diagnostic =
                Diagnostic::new(title).at_location(&pair[1].location, "expected each value once");
            report.push(diagnostic.at_location(&pair[0].location, "first given here"));
            is_valid = false;
        }
    }
    let values = AxisValues::List(values.iter().map(|value| value.value).collect());
    is_valid.then_some(Located { value: values, location: value_list.location })
}

/// Reads a range with a count, or one for the `points` points of a design.
pub fn read_range(
    section: Section<'_>,
    range: Range,
    points: Option<u64>,
) -> Option<Located<AxisValues>> {
    let location = section.location().clone();
    let report = section.report;
    let [from, to] =
        ["from", "to"].map(|key| section.require(section.number(key, range), key, "a number"));
    let count = match points {
        None => {
            let expectation = "the number of values, both ends included";
            section.require(section.whole_number("count", &(1..=MAX_POINTS)), "count", expectation)
        }
        Some(value) => {
            let misplacement_reason = "the number of points belongs in [design], as `points`";
            section.mark_misplaced(&["count"], misplacement_reason);
            Some(Located { value, location: location.clone() })
        }
    };
    let is_logarithmic = section.choice("spacing", &["linear", "log"]).or_default(0);
    section.finish();
    let from = from?;
    let to = to?;
    let count = count?;
    let is_logarithmic = is_logarithmic? == 1;
    let has_one_value = from.value == to.value;
    let is_design = points.is_some();
    let [from_text, to_text] = [from.value, to.value].map(decimal);
    if has_one_value && is_design {
        let title = format!("a design cannot spread points from {from_text} to {to_text}");
        return report.refuse(&to.location, title, "expected another number");
    }
    if has_one_value && count.value > 1 {
        let title =
            format!("a range from {from_text} to {to_text} has one value, not {}", count.value);
        return report.refuse(&to.location, title, "expected another number, or count = 1");
    }
    if !has_one_value && !is_design && count.value == 1 {
        let title = "one value cannot be both ends of a range";
        return report.refuse(&count.location, title, "expected at least 2");
    }
    if is_logarithmic && !(from.value > 0.0 && to.value > 0.0) {
        let end = if from.value > 0.0 { &to } else { &from };
        let title = format!("{} has no logarithm", decimal(end.value));
        let expectation = "expected a number greater than 0, or spacing = \"linear\"";
        return report.refuse(&end.location, title, expectation);
    }
    if let Some(max_count) =
        max_distinct_values(from.value, to.value).filter(|&max_count| max_count < count.value)
    {
        let title = format!(
            "a range from {from_text} to {to_text} has no {} different values",
            count.value
        );
        if is_design {
            let expectation = "expected ends farther apart, or fewer `points` in [design]";
            return report.refuse(&to.location, title, expectation);
        }
        let expectation = format!("expected at most {max_count}, or ends farther apart");
        return report.refuse(&count.location, title, expectation);
    }
    // A range in a design has its two ends as values; the design chooses the points between them.
    let from = from.value;
    let to = to.value;
    let count = if is_design { 2 } else { count.value };
    let value = if is_logarithmic {
        AxisValues::Log { from, to, count }
    } else {
        AxisValues::Linear { from, to, count }
    };
    Some(Located { value, location })
}

//! Checks of a table whose columns are the axes of a plan, in place of its grid.

use super::parameters::unknown_parameter;
use super::{Diagnostic, Diagnostics, Located, Location, Report, number_mistake, quote};
use crate::Model;
use crate::{Axis, Plan};

/// Finds the column of each axis of a plan: its index in `names`, or `None` if the table leaves out
/// an axis of one value. Every value must lie between the ends of its axis, because the steps of
/// the method are chosen for that range. A row then depends only on the plan and its own values.
/// `values` yields the values of a column in order, `None` for a missing one.
///
/// # Errors
/// Every mistake: columns that are unknown, not an axis, repeated or missing, and values out of
/// range.
pub fn check_columns<M: Model, V>(
    plan: &Plan<M>,
    column_names: &[&str],
    values: impl Fn(usize) -> V,
) -> Result<Vec<Option<usize>>, Diagnostics>
where
    V: Iterator<Item = Option<f64>>,
{
    let report = Report::default();
    let (source, header_locations) = report.add_header("table", column_names);
    let mut axis_columns: Vec<Option<usize>> = vec![None; plan.axes.len()];
    for (k, (&value, location)) in column_names.iter().zip(&header_locations).enumerate() {
        let name = Located { value, location: location.clone() };
        let axis_index = plan.axes.iter().position(|axis| axis.parameter.name == name.value);
        let Some(axis_index) = axis_index else {
            report.push_with(|_| column_without_axis(&name, plan));
            continue;
        };
        if let Some(first_column) = axis_columns[axis_index] {
            let title = format!("the column {} is given twice", quote(name.value));
            let diagnostic =
                Diagnostic::new(title).at_location(&name.location, "expected each axis once");
            report
                .push(diagnostic.at_location(&header_locations[first_column], "first given here"));
            continue;
        }
        axis_columns[axis_index] = Some(k);
        let axis = &plan.axes[axis_index];
        let axis_bounds = axis.values.extremes();
        let [least, greatest] = axis_bounds;
        let is_on_axis = |value: &f64| (least..=greatest).contains(value);
        for (row, value) in
            values(k).enumerate().filter(|(_, value)| !value.is_some_and(|v| is_on_axis(&v)))
        {
            report.push_with(|_| value_off_axis(value, row, axis, axis_bounds, &name));
        }
    }
    for (axis, column) in plan.axes.iter().zip(&axis_columns) {
        if column.is_none() && axis.values.len() > 1 {
            let name = &axis.parameter.name;
            let title = format!("the table has no column {}", quote(name));
            let whole_header =
                Location::new(source, 0..header_locations.last().map_or(0, |last| last.span.end));
            let expectation = "expected a column for every axis of the plan";
            report.push(Diagnostic::new(title).at_location(&whole_header, expectation));
        }
    }
    report.finish(Some(axis_columns))
}

/// Returns the mistake of a column that holds no numbers.
pub fn not_numbers_mistake(names: &[String], column: usize, found: &str) -> Diagnostics {
    let title = format!("the column {} holds no numbers", quote(&names[column]));
    column_mistake(names, column, title, format!("expected numbers, found {found}"))
}

/// Returns the mistake of a column whose length differs from that of the first column.
pub fn wrong_length_mistake(
    names: &[String],
    column: usize,
    length: usize,
    first: usize,
) -> Diagnostics {
    let title = format!("the column {} has {length} values", quote(&names[column]));
    column_mistake(names, column, title, format!("expected {first}, as the first column has"))
}

fn column_mistake(
    names: &[String],
    column: usize,
    title: String,
    expectation: String,
) -> Diagnostics {
    let report = Report::default();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let (_, header_locations) = report.add_header("table", &names);
    report.push(Diagnostic::new(title).at_location(&header_locations[column], expectation));
    report.into_diagnostics()
}

/// Returns the mistake of a value that is not on its axis.
fn value_off_axis<M: Model>(
    value: Option<f64>,
    row: usize,
    axis: &Axis<M>,
    [least, greatest]: [f64; 2],
    name: &Located<&str>,
) -> Diagnostic {
    let description = format!("row {} of {}", row + 1, quote(name.value));
    let range = axis.parameter.range;
    match value {
        None => Diagnostic::new(format!("{description} has no value"))
            .at_location(&name.location, format!("expected {range}")),
        Some(value) if !range.contains(value) => {
            number_mistake(&description, value, &name.location, range)
        }
        Some(value) => {
            let title = format!("{description} = {value} is off the plan's axis");
            let expectation = format!("expected a number from {least} to {greatest}");
            let axis = &axis.parameter.name;
            Diagnostic::new(title)
                .at_location(&name.location, expectation)
                .with_help(format!("give `{axis}` a wider range in the plan's [[axis]]"))
        }
    }
}

/// Returns the mistake of a column that is no axis: a fixed parameter, or an unknown name.
fn column_without_axis<M: Model>(name: &Located<&str>, plan: &Plan<M>) -> Diagnostic {
    if let Err(error) = plan.model.find(name.value) {
        return unknown_parameter(name, &error, &plan.model);
    }
    let axes: Vec<String> = plan.axes.iter().map(|axis| quote(&axis.parameter.name)).collect();
    let expectation = match axes.as_slice() {
        [] => "this plan has no [[axis]]".to_owned(),
        axes => format!("expected the plan's axes: {}", axes.join(", ")),
    };
    let title = format!("{} is no axis of this plan", quote(name.value));
    Diagnostic::new(title).at_location(&name.location, expectation).with_help(format!(
        "add [[axis]] with parameter = \"{}\" and the range that the table may cover",
        name.value
    ))
}

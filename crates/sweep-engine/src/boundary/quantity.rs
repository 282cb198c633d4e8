//! The quantity of a boundary, its limit, and its distances from the limit. A quantity is any
//! column of numbers that a plan's rows can have, an expression of such columns, or a condition on
//! them.

use arrow_array::RecordBatch;
use arrow_schema::ArrowError;
use sweep_parameter::{Channel, Worse};
use sweep_results::{Column as KnownColumn, Goal, columns};

use crate::config::{Diagnostic, Location, Report};
use crate::store::{CellType, DeclaredColumn};
use crate::{Error, Model, Plan, nearest_name};

/// The prefix of the columns of ratios.
const RATIO_PREFIX: &str = "ratio_";
/// The name of the column of the least ratio.
const LEAST_RATIO_COLUMN: &str = "ratio_min";

/// A quantity with a limit, named as its column in a result file.
#[derive(Clone, Debug, PartialEq)]
pub struct TracedQuantity {
    /// The column's name.
    pub name: String,
    /// The unit.
    pub unit: String,
    /// The value at which the boundary runs.
    pub limit: f64,
    /// The side of the limit that is bad.
    pub worse: Worse,
    /// The scale of distances from the limit.
    pub distance_scale: DistanceScale,
}

/// The scale of distances from a limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DistanceScale {
    /// The logarithm of the quantity over its limit.
    Logarithm,
    /// The difference, divided by this unit.
    Difference(f64),
}

impl TracedQuantity {
    /// Returns the signed distance of a value from the limit, negative on the good side.
    pub fn distance(&self, value: f64) -> f64 {
        match (self.distance_scale, self.worse) {
            (DistanceScale::Logarithm, worse) => {
                let distance = worse.excess(libm::log(value / self.limit), 0.0);
                // A ratio on the good side of the limit stays there, even if its logarithm rounds
                // to 0.
                let is_good = worse.excess(value, self.limit) < 0.0;
                if is_good { distance.min(-f64::MIN_POSITIVE) } else { distance }
            }
            (DistanceScale::Difference(distance_unit), worse) => {
                worse.excess(value, self.limit) / distance_unit
            }
        }
    }

    /// Returns the quantity at a signed distance from the limit.
    pub fn value(&self, distance: f64) -> f64 {
        let signed_excess = self.worse.excess(distance, 0.0);
        match self.distance_scale {
            DistanceScale::Logarithm => self.limit * libm::exp(signed_excess),
            DistanceScale::Difference(distance_unit) => self.limit + signed_excess * distance_unit,
        }
    }
}

/// Returns every column whose limit can be traced, each with a plan that computes it. This includes
/// channels and metrics that the grid file leaves out.
pub fn traceable_columns<M: Model>(plan: &Plan<M>) -> Vec<(DeclaredColumn, Plan<M>)> {
    // The plan of a channel's columns compares this channel alone.
    let plan_of_channel = |channel: &Channel| {
        let mut plan = plan.clone();
        plan.reliability.channels = vec![*channel];
        (plan, Some(channel_column_names(channel.name)))
    };
    let mut plan_with_lower_limit = plan.clone();
    plan_with_lower_limit.reliability.limits.lower =
        Some(plan.reliability.limits.over_estimate_limit());
    let other_plans = [plan.clone(), plan_with_lower_limit].into_iter().chain(M::variants(plan));
    let plans_and_columns =
        M::ABOUT.channels.iter().map(plan_of_channel).chain(other_plans.map(|plan| (plan, None)));
    let mut columns: Vec<(DeclaredColumn, Plan<M>)> = Vec::new();
    for (plan, allowed_columns) in plans_and_columns {
        for column in M::layout(&plan).columns {
            let has_numbers =
                matches!(column.cell_type, CellType::Measured | CellType::Time | CellType::Count);
            let is_allowed = allowed_columns
                .as_ref()
                .is_none_or(|allowed_columns| allowed_columns.contains(&column.name));
            let is_new_column = columns.iter().all(|(known, _)| known.name != column.name);
            if has_numbers && column.metadata.worse.is_some() && is_allowed && is_new_column {
                columns.push((column, plan.clone()));
            }
        }
    }
    // The ratios that decide on the verdict come first.
    columns.sort_by_key(|(column, _)| !["ratio_max", LEAST_RATIO_COLUMN].contains(&&*column.name));
    columns
}

/// Returns whether a text is the name of a column, not an expression.
pub fn is_column_name(text: &str) -> bool {
    text.chars().all(|letter| letter.is_alphanumeric() || letter == '_')
}

/// A quantity that an expression computes from the columns of a row.
#[derive(Debug)]
pub struct DerivedQuantity<M: Model> {
    /// The quantity.
    pub quantity: TracedQuantity,
    /// The expression.
    pub goal: Goal,
    /// The plan whose rows have all its columns.
    pub plan: Plan<M>,
}

/// Returns the quantity of an expression of columns at a limit, or the margin of a condition at 0,
/// and the plan that computes the columns.
///
/// # Errors
/// A mistake in the expression, columns that no plan has together, a missing limit, or a limit
/// beside a condition.
pub fn derive_quantity<M: Model>(
    plan: &Plan<M>,
    text: &str,
    limit: Option<f64>,
) -> Result<DerivedQuantity<M>, Error> {
    let plans = plans_by_columns(plan);
    let columns_by_plan: Vec<Vec<KnownColumn>> =
        plans.iter().map(|plan| columns(&M::layout(plan).schema())).collect();
    let mut all_columns: Vec<KnownColumn> = Vec::new();
    for column in columns_by_plan.iter().flatten() {
        if all_columns.iter().all(|other| other.name != column.name) {
            all_columns.push(column.clone());
        }
    }
    let condition = Goal::constraint(text, &all_columns);
    let goal = match (condition, Goal::objective(text, &all_columns), limit) {
        (Ok(_), _, Some(limit)) => {
            let expectation = "none with a condition, which has limits of its own";
            return Err(Error::option("--limit", limit, expectation));
        }
        (Err(_), Ok(_), None) => {
            let expectation = format!("--limit with it, or a condition such as `{text} < 2`");
            return Err(Error::option("--quantity", text, expectation));
        }
        (Ok(goal), _, None) | (Err(_), Ok(goal), Some(_)) => goal,
        (Err(mistake), Err(number_mistake), limit) => {
            let report = Report::default();
            let mistake = if limit.is_some() { number_mistake } else { mistake };
            let location = Location::new(report.add("--quantity", text), mistake.span.clone());
            let mistake = Diagnostic::from_expression(mistake, &location);
            report.push(mistake.with_help("`--quantity` without a name lists the columns"));
            report.finish(None::<()>)?;
            return Err(Error::option("--quantity", text, "an expression of columns"));
        }
    };
    if !goal.is_by_row() {
        let expectation = "an expression of a row's columns, without min(), max() and the like";
        return Err(Error::option("--quantity", text, expectation));
    }
    let has_all_columns = |columns: &&Vec<KnownColumn>| {
        goal.columns().all(|name| columns.iter().any(|column| column.name == name))
    };
    let Some(plan_index) = columns_by_plan.iter().position(|columns| has_all_columns(&columns))
    else {
        let names: Vec<&str> = goal.columns().collect();
        let names = names.join(", ");
        let expectation = format!("columns that one grid file has; ask in it for all of {names}");
        return Err(Error::option("--quantity", text, expectation));
    };
    let quantity = match limit {
        None => TracedQuantity {
            name: format!("margin({text})"),
            unit: "1".to_owned(),
            limit: 0.0,
            worse: Worse::Less,
            distance_scale: DistanceScale::Difference(1.0),
        },
        Some(limit) => TracedQuantity {
            name: text.to_owned(),
            unit: goal.unit().to_owned(),
            limit,
            worse: Worse::Greater,
            distance_scale: DistanceScale::Difference(if limit == 0.0 { 1.0 } else { limit.abs() }),
        },
    };
    let plan = plans.into_iter().nth(plan_index).unwrap_or_else(|| plan.clone());
    Ok(DerivedQuantity { quantity, goal, plan })
}

/// Returns plans of the same points with more and more columns: the plan itself, each with a
/// further measurement, one with all of them, and one with all channels too.
fn plans_by_columns<M: Model>(plan: &Plan<M>) -> Vec<Plan<M>> {
    let variant_plans = M::variants(plan);
    let mut plan_with_channels = variant_plans.last().unwrap_or(plan).clone();
    plan_with_channels.reliability.channels = M::ABOUT.channels.to_vec();
    let mut plans = vec![plan.clone()];
    plans.extend(variant_plans);
    plans.push(plan_with_channels);
    plans
}

/// Returns the value of an expression in a row. For a condition this is its margin: the distance of
/// its operands as a share of the greater one, negative if the condition does not hold. If the
/// condition has several comparisons, the margin of the decisive one counts; a condition that
/// compares no numbers has a margin of 1 or -1.
///
/// # Errors
/// A batch without the columns of the expression.
pub fn row_margin(goal: &Goal, row: &RecordBatch) -> Result<Option<f64>, ArrowError> {
    let Some(goal_value) = goal.evaluate(row)? else { return Ok(None) };
    if !goal.is_constraint() {
        return Ok(Some(goal_value));
    }
    let relative_slack = goal.slack(row)?.map(|slack| slack.relative);
    // The condition itself decides at its limits, where the slack is 0.
    Ok(Some(match (goal_value == 0.0, relative_slack) {
        (true, relative_slack) => relative_slack.unwrap_or(1.0).max(f64::MIN_POSITIVE),
        (false, relative_slack) => relative_slack.unwrap_or(-1.0).min(0.0),
    }))
}

/// Returns the names of a channel's columns.
fn channel_column_names(name: &str) -> [String; 3] {
    [RATIO_PREFIX, "nonlinear_", "linear_"].map(|kind| format!("{kind}{name}"))
}

/// Returns the column of this name as a quantity, and the plan that computes it. The limit is the
/// column's own if none is given.
///
/// # Errors
/// A column that the plan's rows cannot have, or a column without a limit of its own if no limit is
/// given.
pub fn find_quantity<M: Model>(
    plan: &Plan<M>,
    name: &str,
    limit: Option<f64>,
) -> Result<(TracedQuantity, Plan<M>), Error> {
    let mut candidates = traceable_columns(plan);
    let Some(index) = candidates.iter().position(|(column, _)| column.name == name) else {
        let names = || candidates.iter().map(|(column, _)| column.name.as_str());
        let name_prefix = |name: &str| name.split('_').next().map(str::to_owned);
        let has_same_prefix = |known: &str| name_prefix(known) == name_prefix(name);
        let required_setting = M::ABOUT
            .required_settings
            .iter()
            .find(|(prefix, _)| name_prefix(name).as_deref() == Some(prefix));
        if let Some((_, required_setting)) =
            required_setting.filter(|_| !names().any(has_same_prefix))
        {
            return Err(Error::option("--quantity", name, required_setting));
        }
        let suggestion = nearest_name(name, names());
        let suggestion =
            suggestion.map_or(String::new(), |name| format!("; did you mean `{name}`?"));
        let all_channel_columns: Vec<String> = M::ABOUT
            .channels
            .iter()
            .flat_map(|channel| channel_column_names(channel.name))
            .collect();
        let is_channel_column = |name: &&str| all_channel_columns.iter().any(|known| known == name);
        let names: Vec<&str> = names().filter(|name| !is_channel_column(name)).collect();
        let names = names.join(", ");
        let [ratio, nonlinear, linear] = channel_column_names("CHANNEL");
        let optional_columns = M::ABOUT.further_columns;
        let expectation =
            format!("one of {names}, {ratio}, {nonlinear}, {linear}{optional_columns}{suggestion}");
        return Err(Error::option("--quantity", name, expectation));
    };
    let (column, mut plan) = candidates.swap_remove(index);
    let Some(limit_value) = limit.or(column.metadata.limit) else {
        let unit = &column.metadata.unit;
        let expectation = format!("--limit with it, in {unit}: it has no limit of its own");
        return Err(Error::option("--quantity", name, expectation));
    };
    let is_ratio = name.starts_with(RATIO_PREFIX);
    let distance_scale = column.limit_scale.unwrap_or(limit_value.abs());
    if !limit_value.is_finite() || (is_ratio && limit_value <= 0.0) || distance_scale == 0.0 {
        let expectation = format!("a number greater than 0, as {name} is never below");
        return Err(Error::option("--limit", limit_value, expectation));
    }
    if name == LEAST_RATIO_COLUMN {
        plan.reliability.limits.lower = Some(limit_value);
    } else if is_ratio {
        plan.reliability.limits.upper = limit_value;
    }
    let quantity = TracedQuantity {
        name: column.name,
        unit: column.metadata.unit,
        limit: limit_value,
        worse: column.metadata.worse.unwrap_or(Worse::Greater),
        distance_scale: if is_ratio {
            DistanceScale::Logarithm
        } else {
            DistanceScale::Difference(distance_scale)
        },
    };
    Ok((quantity, plan))
}

//! Objectives and constraints of a search, as expressions over rows in memory.

use arrow_array::RecordBatch;
use arrow_schema::ArrowError;

use crate::condition::{
    Accumulator, Aggregate, Condition, EvaluationContext, ExpressionError, ExpressionNode,
};
use crate::parse::parse_expression;
use sweep_files::{Cell, CellKind, Column, Rows};

/// An objective or a constraint of a search: a number over rows that the search reduces.
#[derive(Clone, Debug)]
pub struct Goal {
    expression: Condition,
    columns: Vec<Column>,
    /// Whether the expression is a constraint, whose number is its violation.
    is_constraint: bool,
}

impl Goal {
    /// Parses an objective over rows of these columns.
    ///
    /// # Errors
    /// The first error in the text.
    pub fn objective(text: &str, columns: &[Column]) -> Result<Self, ExpressionError> {
        let expression = parse_expression(text, columns, CellKind::Number)?;
        Ok(Self::new(expression, columns, false))
    }

    /// Parses a constraint over rows of these columns. Its number is its violation, in the units of
    /// its comparisons: 0 if all rows satisfy it, else that of the row that violates it most. The
    /// violation of comparisons joined by `and` is their sum, and of comparisons joined by `or` the
    /// least. An expression that compares no numbers is violated by 1.
    ///
    /// # Errors
    /// The first error in the text.
    pub fn constraint(text: &str, columns: &[Column]) -> Result<Self, ExpressionError> {
        let expression = parse_expression(text, columns, CellKind::Flag)?;
        Ok(Self::new(expression, columns, true))
    }

    fn new(expression: Condition, all_columns: &[Column], is_constraint: bool) -> Self {
        let columns = expression
            .columns
            .iter()
            .filter_map(|name| all_columns.iter().find(|column| column.name == *name))
            .cloned()
            .collect();
        Self { expression, columns, is_constraint }
    }

    /// Returns the text as typed.
    pub fn text(&self) -> &str {
        &self.expression.text
    }

    /// Whether the goal is a constraint.
    pub const fn is_constraint(&self) -> bool {
        self.is_constraint
    }

    /// Iterates over the names of the columns that the expression reads.
    pub fn columns(&self) -> impl Iterator<Item = &str> {
        self.expression.columns.iter().map(String::as_str)
    }

    /// Returns whether the expression reads columns outside of aggregates.
    pub const fn is_by_row(&self) -> bool {
        self.expression.is_by_row
    }

    /// Returns the unit, if the expression is a single column or an aggregate of one, else an empty
    /// text.
    pub fn unit(&self) -> &str {
        let is_column = |node: &ExpressionNode| matches!(node, ExpressionNode::Column(_));
        let has_unit = match (&self.expression.root, self.expression.aggregates.as_slice()) {
            (root, []) => is_column(root),
            // A count or a share has a condition as its argument, not a column of numbers.
            (ExpressionNode::Aggregate(_), [(_, node)]) => is_column(node),
            _ => false,
        };
        match self.columns.first() {
            Some(column) if has_unit => column.unit(),
            _ => "",
        }
    }

    /// Computes how far the rows are from violating a constraint: the slack of the row and the
    /// comparison that are nearest to it, below 0 if they violate it. `None` if the constraint
    /// compares no numbers, or one of them is missing.
    ///
    /// # Errors
    /// Fails if the batch lacks columns of the expression.
    pub fn slack(&self, batch: &RecordBatch) -> Result<Option<Slack>, ArrowError> {
        self.evaluate_rows(
            batch,
            |root, context| root.slack(context),
            |a, b| if b.relative < a.relative { b } else { a },
        )
    }

    /// Evaluates the objective, or the violation of the constraint, over all rows; `None` if a
    /// value that it needs is missing.
    ///
    /// # Errors
    /// Fails if the batch lacks columns of the expression.
    pub fn evaluate(&self, batch: &RecordBatch) -> Result<Option<f64>, ArrowError> {
        let evaluate_row = |root: &ExpressionNode, context: &EvaluationContext<'_>| {
            if self.is_constraint { root.violation(context) } else { root.value(context).number() }
        };
        self.evaluate_rows(batch, evaluate_row, f64::max)
    }

    /// Calls `evaluate_row` for each row and reduces the results to one; `None` if it has no result
    /// for one of the rows.
    fn evaluate_rows<T>(
        &self,
        batch: &RecordBatch,
        evaluate_row: impl Fn(&ExpressionNode, &EvaluationContext<'_>) -> Option<T>,
        reduce: impl Fn(T, T) -> T,
    ) -> Result<Option<T>, ArrowError> {
        let rows = Rows::from_batch(batch, &self.columns)?;
        let row_context =
            |row| EvaluationContext { row: rows.row(row), first_column: 0, aggregates: &[] };
        let evaluate_aggregate = |(function, node): &(Aggregate, ExpressionNode)| {
            let mut accumulator = Accumulator::default();
            for row in 0..rows.count {
                accumulator.add(*function, node, &row_context(row));
            }
            let result = accumulator.finish(*function);
            if result.is_complete { result.value } else { Cell::Null }
        };
        let aggregates: Vec<Cell> =
            self.expression.aggregates.iter().map(evaluate_aggregate).collect();
        let row_result = |row| {
            let context = EvaluationContext { aggregates: &aggregates, ..row_context(row) };
            evaluate_row(&self.expression.root, &context)
        };
        let row_count = if self.expression.is_by_row { rows.count } else { rows.count.min(1) };
        let values = (0..row_count).map(row_result).collect::<Option<Vec<T>>>();
        Ok(values.and_then(|values| values.into_iter().reduce(reduce)))
    }
}

/// The distance of a row from the limit of a constraint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slack {
    /// The distance, in the units of the comparison; below 0 beyond the limit.
    pub distance: f64,
    /// The distance, divided by the magnitude of the greater operand.
    pub relative: f64,
}

impl ExpressionNode {
    /// Returns the distance of a row from the limit of a condition; `None` if the condition
    /// compares no numbers.
    fn slack(&self, context: &EvaluationContext<'_>) -> Option<Slack> {
        match self {
            Self::And(left, right) | Self::Or(left, right) => {
                let is_conjunction = matches!(self, Self::And(..));
                let [left, right] = [left.slack(context)?, right.slack(context)?];
                // For `and` the nearer limit decides, for `or` the farther one.
                Some(if (left.relative < right.relative) == is_conjunction { left } else { right })
            }
            Self::Compare(operator, left, right) => {
                let left_value = left.value(context).number()?;
                let right_value = right.value(context).number()?;
                let distance = operator.slack(left_value, right_value)?;
                let magnitude = left_value.abs().max(right_value.abs()).max(f64::MIN_POSITIVE);
                Some(Slack { distance, relative: distance / magnitude })
            }
            _ => None,
        }
    }

    /// Returns by how much a row violates a condition; `None` if the condition is neither true nor
    /// false.
    fn violation(&self, context: &EvaluationContext<'_>) -> Option<f64> {
        if self.truth(context)? {
            return Some(0.0);
        }
        Some(match self {
            Self::And(left, right) => match (left.violation(context), right.violation(context)) {
                (Some(left), Some(right)) => left + right,
                // The operand that is false decides, even if the other is unknown.
                (left, right) => left.or(right)?,
            },
            Self::Or(left, right) => left.violation(context)?.min(right.violation(context)?),
            Self::Compare(operator, left, right) => {
                match (left.value(context).number(), right.value(context).number()) {
                    // The distance of equal operands from a strict comparison is 0, which would
                    // count as no violation.
                    (Some(left), Some(right)) => {
                        operator.violation(left, right).max(f64::MIN_POSITIVE)
                    }
                    _ => 1.0,
                }
            }
            _ => 1.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow_schema::{Field, Schema};

    use super::*;
    use crate::sample::{flag_array, number_array};
    use sweep_files::columns;

    fn sample_batch() -> RecordBatch {
        let named_arrays = [
            ("x_m", number_array(&[Some(1.0), Some(2.0), Some(4.0), Some(8.0), Some(10.0)])),
            ("y", number_array(&[Some(1.0), None, Some(3.0), Some(0.0), Some(-1.0)])),
            ("sound", flag_array(&[Some(true), Some(true), Some(false), Some(true), Some(true)])),
        ];
        let to_field = |(name, array): &(&str, arrow_array::ArrayRef)| {
            let unit = if *name == "x_m" { "m" } else { "1" };
            let unit_metadata = [("unit".to_owned(), unit.to_owned())];

            Field::new(*name, array.data_type().clone(), true).with_metadata(unit_metadata)
        };
        let schema = Schema::new(named_arrays.iter().map(to_field).collect::<Vec<_>>());
        let arrays = named_arrays.into_iter().map(|(_, array)| array).collect();
        RecordBatch::try_new(Arc::new(schema), arrays).unwrap()
    }

    #[test]
    fn objectives_cover_all_rows_and_are_missing_if_a_value_is() {
        let batch = sample_batch();
        let parse_objective =
            |text: &str| Goal::objective(text, &columns(&batch.schema())).unwrap();
        for (text, value, unit) in [
            ("max(x_m)", Some(10.0), "m"),
            // numpy.quantile([1, 2, 4, 8, 10], [0, 0.5, 0.6, 0.95, 1])
            ("quantile(x_m, 0)", Some(1.0), "m"),
            ("quantile(x_m, 0.5)", Some(4.0), "m"),
            ("quantile(x_m, 0.6)", Some(5.6), "m"),
            ("quantile(x_m, 0.95)", Some(9.6), "m"),
            ("quantile(x_m, 1)", Some(10.0), "m"),
            ("max(x_m) / min(x_m)", Some(10.0), ""),
            ("max(y)", None, ""),
            ("share(sound)", Some(0.8), ""),
        ] {
            let goal = parse_objective(text);
            let result = goal.evaluate(&batch).unwrap();
            match (result, value) {
                (Some(result), Some(value)) => assert!((result - value).abs() < 1e-12, "{text}"),
                _ => assert_eq!(result, value, "{text}"),
            }
            assert_eq!((goal.unit(), goal.is_by_row()), (unit, false), "{text}");
        }
        assert!(parse_objective("x_m").is_by_row());
    }

    #[test]
    fn slack_is_the_distance_of_the_worst_row_from_the_limit() {
        let batch = sample_batch();
        for (text, distance, relative) in [
            ("x_m <= 12.5", 2.5, 0.2),
            ("x_m <= 8", -2.0, -0.2),
            ("x_m > 0.5", 0.5, 0.5),
            ("max(x_m) <= 12.5 and min(x_m) >= 0.9", 0.1, 0.1),
            ("max(x_m) <= 12.5 or min(x_m) >= 0.9", 2.5, 0.2),
        ] {
            let goal = Goal::constraint(text, &columns(&batch.schema())).unwrap();
            let slack = goal.slack(&batch).unwrap().unwrap();
            assert!((slack.distance - distance).abs() < 1e-12, "{text}: {slack:?}");
            assert!((slack.relative - relative).abs() < 1e-12, "{text}: {slack:?}");
        }
        for text in ["sound", "y < 9", "x_m != 3", "not (x_m > 12)"] {
            let goal = Goal::constraint(text, &columns(&batch.schema())).unwrap();
            assert_eq!(goal.slack(&batch).unwrap(), None, "{text}");
        }
    }

    #[test]
    fn a_violation_is_that_of_the_worst_row() {
        let batch = sample_batch();
        for (text, violation) in [
            ("x_m <= 10", Some(0.0)),
            ("x_m <= 7.5", Some(2.5)),
            ("x_m < 10", Some(f64::MIN_POSITIVE)),
            ("max(x_m) <= 7.5 and min(x_m) >= 3", Some(4.5)),
            ("max(x_m) <= 7.5 or min(x_m) >= 3", Some(2.0)),
            ("sound", Some(1.0)),
            ("y < 9", None),
            ("x_m > 99 and y < 9", Some(98.0)),
            ("not sound", Some(1.0)),
        ] {
            let goal = Goal::constraint(text, &columns(&batch.schema())).unwrap();
            assert_eq!(goal.evaluate(&batch).unwrap(), violation, "{text}");
        }
    }

    #[test]
    fn errors_have_positions() {
        let columns = columns(&sample_batch().schema());
        for (text, text_at_error) in [
            ("quantile(x_m)", ")"),
            ("quantile(x_m, 95)", "95"),
            ("quantile(x_m, -1)", "-"),
            ("max(x_m) < 3", "max(x_m) < 3"),
        ] {
            let error = Goal::objective(text, &columns).unwrap_err();
            assert_eq!(&text[error.span.clone()], text_at_error, "{error:?}");
        }
    }
}

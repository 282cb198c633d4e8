//! Evaluation of conditions over the columns of a result, with SQL's three-valued logic: a
//! comparison with a missing value is neither true nor false.

use std::cmp::Ordering;
use std::ops::Range;

use crate::error::ResultsError;
use sweep_files::{Cell, ResultTable, Row};

/// A syntax or type error in the text of an expression.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExpressionError {
    /// The error, in a sentence.
    pub title: String,
    /// The position in the text, in bytes.
    pub span: Range<usize>,
    /// The text that was expected there.
    pub expected: String,
    /// A misspelt word, and the valid names.
    pub candidates: Option<(String, Vec<String>)>,
}

/// A comparison operator, as the predicate that the order of its operands has to satisfy.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ComparisonOperator(pub(crate) fn(Ordering) -> bool);

/// An aggregate function: it reduces all rows to one number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Aggregate {
    /// The number of rows for which a condition is true.
    Count,
    /// The share of rows for which a condition is true, among those for which it is true or false.
    Share,
    Least,
    Greatest,
    Mean,
    /// The quantile of this probability, interpolated linearly.
    Quantile(f64),
}

/// A node of an expression's syntax tree, whose types the parser has checked.
#[derive(Clone, Debug)]
pub(crate) enum ExpressionNode {
    Literal(Cell),
    /// A column, by its index in [`Condition::columns`].
    Column(usize),
    /// An aggregate, by its index in [`Condition::aggregates`].
    Aggregate(usize),
    Unary(fn(f64) -> f64, Box<ExpressionNode>),
    Binary(fn(f64, f64) -> f64, Box<ExpressionNode>, Box<ExpressionNode>),
    Not(Box<ExpressionNode>),
    And(Box<ExpressionNode>, Box<ExpressionNode>),
    Or(Box<ExpressionNode>, Box<ExpressionNode>),
    IsNull(Box<ExpressionNode>),
    Compare(ComparisonOperator, Box<ExpressionNode>, Box<ExpressionNode>),
}

/// An expression that is true or false, for every row or for a file as a whole.
#[derive(Clone, Debug)]
pub struct Condition {
    /// The text as typed.
    pub text: String,
    /// The names of the columns that the expression reads.
    pub columns: Vec<String>,
    pub(crate) root: ExpressionNode,
    pub(crate) aggregates: Vec<(Aggregate, ExpressionNode)>,
    /// Whether the expression reads columns outside of aggregates.
    pub(crate) is_by_row: bool,
}

impl Condition {
    /// Returns the names of the columns that the expression reads.
    pub(crate) fn column_names(&self) -> Vec<&str> {
        self.columns.iter().map(String::as_str).collect()
    }

    /// Returns whether the expression has aggregate functions.
    pub const fn has_aggregates(&self) -> bool {
        !self.aggregates.is_empty()
    }
}

/// The values that an expression is evaluated on.
pub(crate) struct EvaluationContext<'a> {
    pub(crate) row: Row<'a>,
    /// The index of the expression's first column in the row.
    pub(crate) first_column: usize,
    /// The values of the aggregates.
    pub(crate) aggregates: &'a [Cell],
}

impl ExpressionNode {
    /// Evaluates the expression.
    pub(crate) fn value(&self, context: &EvaluationContext<'_>) -> Cell {
        match self {
            Self::Literal(cell) => cell.clone(),
            Self::Column(column) => match context.row.cell(context.first_column + *column) {
                // Other writers store NaN where a value is missing.
                Cell::Number(value) => number_cell(Some(value)),
                cell => cell,
            },
            Self::Aggregate(index) => context.aggregates.get(*index).cloned().unwrap_or(Cell::Null),
            Self::Unary(operation, node) => number_cell(node.number(context).map(operation)),
            Self::Binary(operation, left, right) => {
                let operands = left.number(context).zip(right.number(context));
                number_cell(operands.map(|(left, right)| operation(left, right)))
            }
            Self::Not(_) | Self::And(..) | Self::Or(..) | Self::IsNull(_) | Self::Compare(..) => {
                self.truth(context).map_or(Cell::Null, Cell::Flag)
            }
        }
    }

    fn number(&self, context: &EvaluationContext<'_>) -> Option<f64> {
        self.value(context).number()
    }

    /// Evaluates the expression as a truth value; `None` is SQL's "unknown".
    pub(crate) fn truth(&self, context: &EvaluationContext<'_>) -> Option<bool> {
        match self {
            Self::Not(node) => node.truth(context).map(|truth| !truth),
            Self::And(left, right) => conjoin(left.truth(context), right.truth(context)),
            // De Morgan's law holds in three-valued logic too.
            Self::Or(left, right) => {
                let neither_holds = conjoin(
                    left.truth(context).map(|truth| !truth),
                    right.truth(context).map(|truth| !truth),
                );
                neither_holds.map(|truth| !truth)
            }
            Self::IsNull(node) => Some(node.value(context) == Cell::Null),
            Self::Compare(operator, left, right) => {
                operator.compare(&left.value(context), &right.value(context))
            }
            other => other.value(context).flag(),
        }
    }
}

/// Returns the conjunction of two truth values: false if either is false, else unknown if either is
/// unknown.
fn conjoin(first: Option<bool>, second: Option<bool>) -> Option<bool> {
    if first == Some(false) || second == Some(false) {
        return Some(false);
    }
    first.and(second)
}

/// Returns a cell with a number; a null cell without one, or for NaN.
fn number_cell(number: Option<f64>) -> Cell {
    number.filter(|number| !number.is_nan()).map_or(Cell::Null, Cell::Number)
}

impl ComparisonOperator {
    /// Returns how far the operands are from satisfying the comparison; 0 if they satisfy it. Equal
    /// operands violate `!=` by 1.
    pub(crate) fn violation(self, left: f64, right: f64) -> f64 {
        match [Ordering::Less, Ordering::Greater].map(self.0) {
            [true, true] => 1.0,
            [true, false] => (left - right).max(0.0),
            [false, true] => (right - left).max(0.0),
            [false, false] => (left - right).abs(),
        }
    }

    /// Returns how far two numbers are from breaking the comparison, below 0 where they break it;
    /// `None` for `!=`, which has no limit.
    pub(crate) fn slack(self, left: f64, right: f64) -> Option<f64> {
        match [Ordering::Less, Ordering::Greater].map(self.0) {
            [true, true] => None,
            [true, false] => Some(right - left),
            [false, true] => Some(left - right),
            [false, false] => Some(-(left - right).abs()),
        }
    }

    /// Compares two cells, whose kinds the parser has made equal.
    fn compare(self, left: &Cell, right: &Cell) -> Option<bool> {
        let ordering = match (left, right) {
            (Cell::Number(left), Cell::Number(right)) => left.partial_cmp(right)?,
            (Cell::Text(left), Cell::Text(right)) => left.cmp(right),
            (Cell::Flag(left), Cell::Flag(right)) => left.cmp(right),
            _ => return None,
        };
        Some((self.0)(ordering))
    }
}

/// The value of an aggregate function.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AggregateValue {
    /// The function over the rows that have a value.
    pub(crate) value: Cell,
    /// The number of rows that have a value.
    pub(crate) rows: u64,
    /// Whether every row has a value.
    pub(crate) is_complete: bool,
    /// Whether the function is a share.
    pub(crate) is_share: bool,
}

impl AggregateValue {
    /// Returns the number of rows for which the condition of a share is true.
    pub(crate) fn share_count(&self) -> Option<u64> {
        let share_of_rows = self.value.number().filter(|_| self.is_share)?;
        Some((share_of_rows * self.rows as f64).round() as u64)
    }
}

/// The accumulator of an aggregate function over rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Accumulator {
    rows: u64,
    rows_with_value: u64,
    /// The sum of the numbers; a condition counts as 1 where it is true.
    sum: f64,
    minimum: Option<f64>,
    maximum: Option<f64>,
    /// All numbers, kept for quantiles only.
    numbers: Vec<f64>,
}

impl Condition {
    /// Evaluates the aggregates over all rows that a filter accepts.
    ///
    /// # Errors
    /// [`crate::ResultsError::File`].
    pub(crate) fn compute_aggregates(
        &self,
        table: &ResultTable,
        filter: Option<&Condition>,
    ) -> Result<Vec<AggregateValue>, ResultsError> {
        if self.aggregates.is_empty() {
            return Ok(Vec::new());
        }
        let mut accumulators = vec![Accumulator::default(); self.aggregates.len()];
        for_each_row(table, &self.column_names(), filter, |context| {
            for ((function, node), accumulator) in self.aggregates.iter().zip(&mut accumulators) {
                accumulator.add(*function, node, context);
            }
            Ok(())
        })?;
        let functions = self.aggregates.iter().map(|(function, _)| *function);
        Ok(functions
            .zip(accumulators)
            .map(|(function, accumulator)| accumulator.finish(function))
            .collect())
    }
}

impl Accumulator {
    /// Adds a row.
    pub(crate) fn add(
        &mut self,
        function: Aggregate,
        node: &ExpressionNode,
        context: &EvaluationContext<'_>,
    ) {
        self.rows += 1;
        let number_of_row = match function {
            Aggregate::Count | Aggregate::Share => {
                node.truth(context).map(|truth| f64::from(u8::from(truth)))
            }
            _ => node.number(context),
        };
        let Some(number_of_row) = number_of_row else { return };
        self.rows_with_value += 1;
        self.sum += number_of_row;
        self.minimum =
            Some(self.minimum.map_or(number_of_row, |minimum| minimum.min(number_of_row)));
        self.maximum =
            Some(self.maximum.map_or(number_of_row, |maximum| maximum.max(number_of_row)));
        if let Aggregate::Quantile(_) = function {
            self.numbers.push(number_of_row);
        }
    }

    /// Returns the value of the function over the rows added.
    pub(crate) fn finish(self, function: Aggregate) -> AggregateValue {
        let value = match function {
            Aggregate::Count => Some(self.sum),
            Aggregate::Share | Aggregate::Mean => Some(self.sum / self.rows_with_value as f64),
            Aggregate::Least => self.minimum,
            Aggregate::Greatest => self.maximum,
            Aggregate::Quantile(probability) => quantile(self.numbers, probability),
        };
        AggregateValue {
            value: number_cell(value),
            rows: self.rows_with_value,
            is_complete: self.rows_with_value == self.rows,
            is_share: function == Aggregate::Share,
        }
    }
}

/// Returns a quantile with linear interpolation, as `numpy.quantile` does by default.
fn quantile(mut numbers: Vec<f64>, probability: f64) -> Option<f64> {
    numbers.sort_by(f64::total_cmp);
    let rank = probability * numbers.len().checked_sub(1)? as f64;
    let lower_number = numbers[rank.floor() as usize];
    let upper_number = numbers[rank.ceil() as usize];
    Some(lower_number + (upper_number - lower_number) * rank.fract())
}

/// Calls `visit` for each row that a filter accepts, with the columns of these names.
///
/// # Errors
/// [`crate::ResultsError::File`], and any error of `visit`.
pub(crate) fn for_each_row(
    table: &ResultTable,
    names: &[&str],
    filter: Option<&Condition>,
    mut visit: impl FnMut(&EvaluationContext<'_>) -> Result<(), ResultsError>,
) -> Result<(), ResultsError> {
    let filter_column = names.len();
    let names = [names, &filter.map_or_else(Vec::new, Condition::column_names)].concat();
    table.file().each_row(&names, |row| {
        let context =
            |first_column: usize| EvaluationContext { row, first_column, aggregates: &[] };
        let is_accepted =
            filter.is_none_or(|filter| filter.root.truth(&context(filter_column)) == Some(true));
        if is_accepted { visit(&context(0)) } else { Ok(()) }
    })
}

//! Expressions over rows in memory: what a search minimises, and conditions with how far rows are
//! from keeping them.

use arrow_array::RecordBatch;
use arrow_schema::ArrowError;

use crate::condition::{Condition, Context, Folding, Mistake, Node};
use crate::parse::expression;
use sweep_files::{Cell, CellKind, Column, Rows};

/// A number of rows that a search drives down.
#[derive(Clone, Debug)]
pub struct Goal {
    expression: Condition,
    columns: Vec<Column>,
    /// Whether it is a condition, whose number is its excess.
    is_condition: bool,
}

impl Goal {
    /// A number over rows of these columns.
    ///
    /// # Errors
    /// The first mistake in it.
    pub fn number(text: &str, columns: &[Column]) -> Result<Self, Mistake> {
        Self::of(expression(text, columns, CellKind::Number)?, columns, false)
    }

    /// How far rows of these columns are from keeping a condition, in the units of its comparisons:
    /// 0 where all rows keep it, else the row farthest from it counts. Of comparisons joined by
    /// `and` the excesses add up, of those joined by `or` the least counts. What is no comparison
    /// of numbers exceeds by 1.
    ///
    /// # Errors
    /// The first mistake in it.
    pub fn excess(text: &str, columns: &[Column]) -> Result<Self, Mistake> {
        Self::of(expression(text, columns, CellKind::Flag)?, columns, true)
    }

    fn of(expression: Condition, all: &[Column], is_condition: bool) -> Result<Self, Mistake> {
        let used = expression.columns.iter();
        let columns = used.filter_map(|name| all.iter().find(|column| column.name == *name));
        let columns = columns.cloned().collect();
        Ok(Self { expression, columns, is_condition })
    }

    /// As typed.
    pub fn text(&self) -> &str {
        &self.expression.text
    }

    /// Whether it speaks of single rows, so that a number needs there to be one.
    pub const fn is_by_row(&self) -> bool {
        self.expression.by_row
    }

    /// The unit of the column, if it is a column's least, greatest or mean number or a quantile.
    pub fn unit(&self) -> &str {
        let of_one = |node: &Node| matches!(node, Node::Column(_));
        let one = match (&self.expression.root, self.expression.folds.as_slice()) {
            (root, []) => of_one(root),
            (Node::Folded(_), [(_, node)]) => of_one(node),
            _ => false,
        };
        self.columns.first().filter(|_| one).map_or("", |column| &column.unit)
    }

    /// Its number over all rows; none where a value that it needs is missing.
    ///
    /// # Errors
    /// Rows of other columns.
    pub fn over(&self, batch: &RecordBatch) -> Result<Option<f64>, ArrowError> {
        let rows = Rows::of(batch, &self.columns)?;
        let at = |row| Context { row: rows.row(row), first: 0, folded: &[] };
        let fold = |(fold, node): &(_, Node)| {
            let mut folding = Folding::default();
            (0..rows.count).for_each(|row| folding.add(*fold, node, &at(row)));
            let folded = folding.finish(*fold);
            if folded.whole { folded.value } else { Cell::Null }
        };
        let folded: Vec<Cell> = self.expression.folds.iter().map(fold).collect();
        let number = |row| {
            let (root, at) = (&self.expression.root, Context { folded: &folded, ..at(row) });
            if self.is_condition { root.excess(&at) } else { root.value(&at).number() }
        };
        let rows = if self.expression.by_row { rows.count } else { rows.count.min(1) };
        let numbers = (0..rows).map(number).collect::<Option<Vec<f64>>>();
        Ok(numbers.and_then(|numbers| numbers.into_iter().reduce(f64::max)))
    }
}

impl Node {
    /// How far a row is from keeping this; none where that is neither true nor false.
    fn excess(&self, at: &Context<'_>) -> Option<f64> {
        if self.truth(at)? {
            return Some(0.0);
        }
        Some(match self {
            Self::And(left, right) => match (left.excess(at), right.excess(at)) {
                (Some(left), Some(right)) => left + right,
                // One is false whatever the other is.
                (left, right) => left.or(right)?,
            },
            Self::Or(left, right) => left.excess(at)?.min(right.excess(at)?),
            Self::Compare(comparison, left, right) => {
                match (left.value(at).number(), right.value(at).number()) {
                    // What breaks a strict comparison by nothing breaks it.
                    (Some(l), Some(r)) => comparison.excess(l, r).max(f64::MIN_POSITIVE),
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
    use crate::sample::{flags, numbers};
    use sweep_files::columns;

    fn batch() -> RecordBatch {
        let arrays = [
            ("x_m", numbers(&[Some(1.0), Some(2.0), Some(4.0), Some(8.0), Some(10.0)])),
            ("y", numbers(&[Some(1.0), None, Some(3.0), Some(0.0), Some(-1.0)])),
            ("sound", flags(&[Some(true), Some(true), Some(false), Some(true), Some(true)])),
        ];
        let field = |(name, array): &(&str, arrow_array::ArrayRef)| {
            let unit = if *name == "x_m" { "m" } else { "1" };
            let unit = [("unit".to_owned(), unit.to_owned())];
            Field::new(*name, array.data_type().clone(), true).with_metadata(unit)
        };
        let schema = Schema::new(arrays.iter().map(field).collect::<Vec<_>>());
        let arrays = arrays.into_iter().map(|(_, array)| array).collect();
        RecordBatch::try_new(Arc::new(schema), arrays).unwrap()
    }

    #[test]
    fn a_number_is_of_all_rows_and_missing_where_a_value_is() {
        let batch = batch();
        let of = |text: &str| Goal::number(text, &columns(&batch.schema())).unwrap();
        for (text, value, unit) in [
            ("max(x_m)", Some(10.0), "m"),
            // As numpy.quantile([1, 2, 4, 8, 10], [0, 0.5, 0.6, 0.95, 1]).
            ("quantile(x_m, 0)", Some(1.0), "m"),
            ("quantile(x_m, 0.5)", Some(4.0), "m"),
            ("quantile(x_m, 0.6)", Some(5.6), "m"),
            ("quantile(x_m, 0.95)", Some(9.6), "m"),
            ("quantile(x_m, 1)", Some(10.0), "m"),
            ("max(x_m) / min(x_m)", Some(10.0), ""),
            ("max(y)", None, ""),
            ("share(sound)", Some(0.8), ""),
        ] {
            let (goal, near) = (of(text), |v: f64| value.is_some_and(|w| (v - w).abs() < 1e-12));
            let found = goal.over(&batch).unwrap();
            assert!(found == value || found.is_some_and(near), "{text}: {found:?}");
            assert_eq!((goal.unit(), goal.is_by_row()), (unit, false), "{text}");
        }
        assert!(of("x_m").is_by_row());
    }

    #[test]
    fn an_excess_says_how_far_the_worst_row_is_from_keeping_a_condition() {
        let batch = batch();
        for (text, excess) in [
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
            let goal = Goal::excess(text, &columns(&batch.schema())).unwrap();
            assert_eq!(goal.over(&batch).unwrap(), excess, "{text}");
        }
    }

    #[test]
    fn mistakes_are_pointed_at() {
        let columns = columns(&batch().schema());
        for (text, at) in [
            ("quantile(x_m)", ")"),
            ("quantile(x_m, 95)", "95"),
            ("quantile(x_m, -1)", "-"),
            ("max(x_m) < 3", "max(x_m) < 3"),
        ] {
            let mistake = Goal::number(text, &columns).unwrap_err();
            assert_eq!(&text[mistake.span.clone()], at, "{mistake:?}");
        }
    }
}

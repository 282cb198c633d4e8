//! Selects the rows that come first in an order.

use crate::condition::{Condition, for_each_row};
use crate::error::ResultsError;
use crate::nearest::nearest_name;
use sweep_files::{Cell, CellKind, ResultTable};
use sweep_parameter::Worse;

/// Returns the cells of `columns` of the worst `count` rows that a filter accepts.
///
/// `order` names a column and the direction in which its values are worse; without it the first
/// rows are returned. Rows without a value of that column come last, equal ones in file order.
///
/// # Errors
/// [`ResultsError::Refused`] for a missing column, or for an order by texts;
/// [`ResultsError::File`].
pub fn top_rows(
    table: &ResultTable,
    columns: &[&str],
    filter: Option<&Condition>,
    column_and_direction: Option<(&str, Worse)>,
    count: usize,
) -> Result<Vec<Vec<Cell>>, ResultsError> {
    let path = table.path().display();
    let read_columns: Vec<&str> =
        columns.iter().copied().chain(column_and_direction.map(|(name, _)| name)).collect();
    let describe_unknown_column = |name: &&str| {
        let suggested_name =
            nearest_name(name, table.columns.iter().map(|column| column.name.as_str()));
        let suggestion = suggested_name.map_or_else(String::new, |suggested_name| {
            format!("; did you mean `{suggested_name}`?")
        });
        format!("{path} has no column `{name}`{suggestion}")
    };
    let unknown_columns: Vec<String> = read_columns
        .iter()
        .filter(|name| table.column(name).is_none())
        .map(describe_unknown_column)
        .collect();
    if !unknown_columns.is_empty() {
        return Err(ResultsError::Refused(unknown_columns.join("\n")));
    }
    if let Some((name, _)) = column_and_direction
        && table.column(name).is_some_and(|column| column.kind == CellKind::Text)
    {
        return Err(ResultsError::Refused(format!(
            "`{name}` of {path} holds no numbers, so it has no order"
        )));
    }
    let mut worst_rows = WorstRows::new(column_and_direction.map(|(_, worse)| worse), count);
    for_each_row(table, &read_columns, filter, |context| {
        let row = &context.row;
        let order_value = column_and_direction.and_then(|_| match row.cell(columns.len()) {
            Cell::Flag(flag) => Some(f64::from(u8::from(flag))),
            cell => cell.number(),
        });
        worst_rows
            .insert(order_value, || (0..columns.len()).map(|column| row.cell(column)).collect());
        Ok(())
    })?;
    Ok(worst_rows.finish())
}

/// A selection of the worst rows, or of the first rows if there is no direction that is worse.
pub(crate) struct WorstRows<T> {
    worse: Option<Worse>,
    count: usize,
    selected_rows: Vec<(Option<f64>, T)>,
}

impl<T> WorstRows<T> {
    /// Creates a selection of at most `count` rows.
    pub(crate) const fn new(worse: Option<Worse>, count: usize) -> Self {
        Self { worse, count, selected_rows: Vec::new() }
    }

    /// Adds a row if it may be among the selected ones. `create_row` is called only then.
    pub(crate) fn insert(&mut self, value: Option<f64>, create_row: impl FnOnce() -> T) {
        if self.worse.is_none() && self.selected_rows.len() == self.count {
            return;
        }
        self.selected_rows.push((value, create_row()));
        // The rows are sorted when there are twice as many as needed, which limits the memory, and
        // the time for a row.
        if self.selected_rows.len() == self.count.saturating_mul(2).max(1024) {
            self.sort();
        }
    }

    /// Returns the selected rows, those without a value last.
    pub(crate) fn finish(mut self) -> Vec<T> {
        self.sort();
        self.selected_rows.into_iter().map(|(_, row)| row).collect()
    }

    /// Sorts the rows and drops those beyond the count.
    fn sort(&mut self) {
        let Some(worse) = self.worse else { return };
        // The sort is stable, so that rows of equal values stay in file order.
        self.selected_rows.sort_by(|(a, _), (b, _)| match (a, b) {
            (Some(a), Some(b)) if worse == Worse::Less => a.total_cmp(b),
            (Some(a), Some(b)) => b.total_cmp(a),
            _ => b.is_some().cmp(&a.is_some()),
        });
        self.selected_rows.truncate(self.count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    fn top_ratios(filter: Option<&str>, worse: Worse, count: usize) -> Vec<Cell> {
        let table = sample::table();
        let filter = filter.map(|filter| Condition::parse(filter, &table).unwrap());
        let column_and_direction = Some(("ratio_max", worse));
        let rows =
            top_rows(&table, &["ratio_max"], filter.as_ref(), column_and_direction, count).unwrap();
        rows.into_iter().map(|mut row| row.remove(0)).collect()
    }

    #[test]
    fn rows_without_a_value_come_last() {
        let numbers =
            |values: &[f64]| values.iter().map(|value| Cell::Number(*value)).collect::<Vec<_>>();
        assert_eq!(top_ratios(None, Worse::Greater, 2), numbers(&[4.0, 2.5]));
        assert_eq!(top_ratios(None, Worse::Less, 3), numbers(&[1.0, 1.2, 1.5]));
        assert_eq!(top_ratios(None, Worse::Less, 9).last(), Some(&Cell::Null));
        assert_eq!(top_ratios(Some("not sensitive"), Worse::Greater, 1), numbers(&[2.5]));
        assert!(top_ratios(Some("false"), Worse::Greater, 1).is_empty());
    }

    #[test]
    fn columns_without_an_order_are_refused() {
        let table = sample::table();
        let error_message =
            |name| top_rows(&table, &["point"], None, Some((name, Worse::Greater)), 1);
        assert!(matches!(error_message("status"), Err(ResultsError::Refused(_))));
        assert!(matches!(error_message("none"), Err(ResultsError::Refused(_))));
        let message =
            top_rows(&table, &["none", "ratio_mx"], None, None, 1).unwrap_err().to_string();
        assert!(message.contains("`none`") && message.contains("did you mean `ratio_max`?"));
        assert!(error_message("reliable").is_ok());
    }
}

//! The rows that come first in an order.

use std::cmp::Ordering;

use crate::condition::{Condition, each_row};
use crate::error::ResultsError;
use crate::rows::{Cell, ResultTable};
use sweep_files::CellKind;
use sweep_parameter::Worse;

/// The first `count` rows by the column `by`, as if it were the worse the greater or the less it
/// is, or in file order, of those for which `keep` is true,
/// as the cells of `columns`. Rows without a value of `by` come last, equal ones in file order.
///
/// # Errors
/// [`ResultsError::Column`] for a column that is not there, [`ResultsError::NoOrder`] for one of
/// words, [`ResultsError::File`].
pub fn top(
    table: &ResultTable,
    columns: &[&str],
    keep: Option<&Condition>,
    by: Option<(&str, Worse)>,
    count: usize,
) -> Result<Vec<Vec<Cell>>, ResultsError> {
    for name in columns.iter().copied().chain(by.map(|(name, _)| name)) {
        if table.column(name).is_none() {
            let (path, name) = (table.path().to_owned(), name.to_owned());
            return Err(ResultsError::Column { path, name, nearest: None });
        }
    }
    if let Some((name, _)) = by
        && table.column(name).is_some_and(|column| column.kind == CellKind::Text)
    {
        let (path, name) = (table.path().to_owned(), name.to_owned());
        return Err(ResultsError::NoOrder { path, name });
    }
    let read: Vec<&str> = columns.iter().copied().chain(by.map(|(name, _)| name)).collect();
    let cells = Condition {
        text: String::new(),
        columns: read.iter().map(|name| (*name).to_owned()).collect(),
        root: crate::condition::Node::Literal(Cell::Null),
        folds: Vec::new(),
        by_row: true,
    };
    let mut found: Vec<(Option<f64>, Vec<Cell>)> = Vec::new();
    each_row(table, &[&cells], keep, |at| {
        if by.is_none() && found.len() == count {
            return Ok(());
        }
        let value = by.and_then(|_| match at.rows.cell(columns.len(), at.row) {
            Cell::Flag(flag) => Some(f64::from(u8::from(flag))),
            cell => cell.number(),
        });
        let row = (0..columns.len()).map(|column| at.rows.cell(column, at.row)).collect();
        found.push((value, row));
        if let Some((_, worse)) = by
            && found.len() == most_held(count)
        {
            keep_worst(&mut found, worse, count);
        }
        Ok(())
    })?;
    if let Some((_, worse)) = by {
        keep_worst(&mut found, worse, count);
    }
    Ok(found.into_iter().map(|(_, row)| row).collect())
}

/// Puts the worst first, those without a value last, and keeps so many.
pub(crate) fn keep_worst<T>(found: &mut Vec<(Option<f64>, T)>, worse: Worse, count: usize) {
    // A stable sort: rows of one value stay in file order.
    found.sort_by(|(a, _), (b, _)| match (a, b) {
        (Some(a), Some(b)) if worse == Worse::Less => a.total_cmp(b),
        (Some(a), Some(b)) => b.total_cmp(a),
        (Some(_), None) => Ordering::Less,
        (None, Some(_)) => Ordering::Greater,
        (None, None) => Ordering::Equal,
    });
    found.truncate(count);
}

/// Sorting now and then keeps what is held at twice what is asked for.
pub(crate) fn most_held(count: usize) -> usize {
    count.saturating_mul(2).max(1024)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    fn ratios(keep: Option<&str>, order: Worse, count: usize) -> Vec<Cell> {
        let table = sample::table();
        let keep = keep.map(|keep| Condition::parse(keep, &table).unwrap());
        let by = Some(("ratio_max", order));
        let rows = top(&table, &["ratio_max"], keep.as_ref(), by, count).unwrap();
        rows.into_iter().map(|mut row| row.remove(0)).collect()
    }

    #[test]
    fn rows_come_in_order_and_those_without_a_value_last() {
        let numbers = |values: &[f64]| values.iter().map(|v| Cell::Number(*v)).collect::<Vec<_>>();
        assert_eq!(ratios(None, Worse::Greater, 2), numbers(&[4.0, 2.5]));
        assert_eq!(ratios(None, Worse::Less, 3), numbers(&[1.0, 1.2, 1.5]));
        assert_eq!(ratios(None, Worse::Less, 9).last(), Some(&Cell::Null));
        assert_eq!(ratios(Some("not sensitive"), Worse::Greater, 1), numbers(&[2.5]));
        assert!(ratios(Some("false"), Worse::Greater, 1).is_empty());
    }

    #[test]
    fn what_has_no_order_is_refused() {
        let table = sample::table();
        let by = |name| top(&table, &["point"], None, Some((name, Worse::Greater)), 1);
        assert!(matches!(by("status"), Err(ResultsError::NoOrder { .. })));
        assert!(matches!(by("none"), Err(ResultsError::Column { .. })));
        assert!(by("reliable").is_ok());
    }
}

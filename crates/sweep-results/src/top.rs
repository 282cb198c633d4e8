//! The rows that come first in an order.

use crate::condition::{Condition, each_row};
use crate::error::{Result, ResultsError};
use crate::nearest::nearest;
use sweep_files::{Cell, CellKind, ResultTable};
use sweep_parameter::Worse;

/// The first `count` rows by the column `by`, as if it were the worse the greater or the less it
/// is, or in file order, of those for which `keep` is true,
/// as the cells of `columns`. Rows without a value of `by` come last, equal ones in file order.
///
/// # Errors
/// [`ResultsError::Refused`] for a column that is not there, or for an order by words;
/// [`ResultsError::File`].
pub fn top(
    table: &ResultTable,
    columns: &[&str],
    keep: Option<&Condition>,
    by: Option<(&str, Worse)>,
    count: usize,
) -> Result<Vec<Vec<Cell>>, ResultsError> {
    let path = table.path().display();
    let read: Vec<&str> = columns.iter().copied().chain(by.map(|(name, _)| name)).collect();
    let unknown = read.iter().filter(|name| table.column(name).is_none()).map(|name| {
        let near = nearest(name, table.columns.iter().map(|column| column.name.as_str()));
        let meant = near.map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
        format!("{path} has no column `{name}`{meant}")
    });
    let unknown: Vec<String> = unknown.collect();
    if !unknown.is_empty() {
        return Err(ResultsError::Refused(unknown.join("\n")));
    }
    if let Some((name, _)) = by
        && table.column(name).is_some_and(|column| column.kind == CellKind::Text)
    {
        return Err(ResultsError::Refused(format!(
            "`{name}` of {path} holds no numbers, so it has no order"
        )));
    }
    let mut found = Worst::new(by.map(|(_, worse)| worse), count);
    each_row(table, &read, keep, |at| {
        let value = by.and_then(|_| match at.row.cell(columns.len()) {
            Cell::Flag(flag) => Some(f64::from(u8::from(flag))),
            cell => cell.number(),
        });
        found.take(value, || (0..columns.len()).map(|column| at.row.cell(column)).collect());
        Ok(())
    })?;
    Ok(found.finish())
}

/// The worst of many, those without a value last; or the first, where nothing is bad.
pub(crate) struct Worst<T> {
    worse: Option<Worse>,
    count: usize,
    found: Vec<(Option<f64>, T)>,
}

impl<T> Worst<T> {
    /// So many at most.
    pub(crate) const fn new(worse: Option<Worse>, count: usize) -> Self {
        Self { worse, count, found: Vec::new() }
    }

    /// Takes one more, if it could be among them.
    pub(crate) fn take(&mut self, value: Option<f64>, one: impl FnOnce() -> T) {
        if self.worse.is_none() && self.found.len() == self.count {
            return;
        }
        self.found.push((value, one()));
        // Sorting now and then keeps what is held at twice what is asked for.
        if self.found.len() == self.count.saturating_mul(2).max(1024) {
            self.sort();
        }
    }

    pub(crate) fn finish(mut self) -> Vec<T> {
        self.sort();
        self.found.into_iter().map(|(_, one)| one).collect()
    }

    fn sort(&mut self) {
        let Some(worse) = self.worse else { return };
        // A stable sort: rows of one value stay in file order.
        self.found.sort_by(|(a, _), (b, _)| match (a, b) {
            (Some(a), Some(b)) if worse == Worse::Less => a.total_cmp(b),
            (Some(a), Some(b)) => b.total_cmp(a),
            _ => b.is_some().cmp(&a.is_some()),
        });
        self.found.truncate(self.count);
    }
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
        assert!(matches!(by("status"), Err(ResultsError::Refused(_))));
        assert!(matches!(by("none"), Err(ResultsError::Refused(_))));
        let unknown = top(&table, &["none", "ratio_mx"], None, None, 1).unwrap_err().to_string();
        assert!(unknown.contains("`none`") && unknown.contains("did you mean `ratio_max`?"));
        assert!(by("reliable").is_ok());
    }
}

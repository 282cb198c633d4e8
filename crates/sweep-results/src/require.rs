//! Checks of conditions over all rows of a result.

use serde::Serialize;

use crate::condition::{AggregateValue, Condition, EvaluationContext, for_each_row};
use crate::error::ResultsError;
use crate::top::WorstRows;
use sweep_files::{Cell, ResultTable};

/// A row that violates a condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViolatingRow {
    /// The row's number in the file, from 0.
    pub row: u64,
    /// Whether the condition is neither true nor false, because a value is missing.
    #[serde(rename = "undefined")]
    pub is_undefined: bool,
    /// The cells of the columns that identify the row, then of those that the condition reads.
    pub cells: Vec<(String, Cell)>,
}

/// The result of checking a condition.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ConditionCheck {
    /// The condition as typed.
    pub expression: String,
    /// Whether the condition is true for every checked row; a condition of aggregates alone, for
    /// the file.
    pub holds: bool,
    /// Whether the condition reads columns outside of aggregates.
    #[serde(rename = "by_row")]
    pub is_by_row: bool,
    /// The number of rows that were checked.
    pub rows: u64,
    /// The number of rows for which the condition is false.
    #[serde(rename = "failing")]
    pub failing_rows: u64,
    /// The number of rows for which the condition is neither true nor false.
    #[serde(rename = "undefined")]
    pub undefined_rows: u64,
    /// The values of the aggregates over the rows that have a value, in the order of their closing
    /// parentheses.
    #[serde(rename = "folded")]
    pub aggregate_values: Vec<Cell>,
    /// The number of rows that have a value, for each aggregate.
    #[serde(rename = "folded_rows")]
    pub aggregate_rows: Vec<u64>,
    /// For each aggregate that is a share, the number of rows for which its condition is true.
    pub share_counts: Vec<Option<u64>>,
    /// The rows that violate the condition. They are sorted by the first column of the condition
    /// that has a direction in which it is bad, the worst first.
    #[serde(rename = "offenders")]
    pub violating_rows: Vec<ViolatingRow>,
}

/// Checks a condition on the rows that a filter accepts.
///
/// A row with a missing value violates a condition whose truth depends on it, and an aggregate is
/// unknown unless every row has a value. With `allow_null` such rows pass, and aggregates skip
/// them. A condition never holds for an empty set of rows.
///
/// # Errors
/// [`ResultsError::File`].
pub fn check_condition(
    table: &ResultTable,
    condition: &Condition,
    filter: Option<&Condition>,
    allow_null: bool,
    max_violating_rows: usize,
) -> Result<ConditionCheck, ResultsError> {
    let results = condition.compute_aggregates(table, filter)?;
    let value_or_null = |result: &AggregateValue| {
        if result.is_complete || allow_null { result.value.clone() } else { Cell::Null }
    };
    let aggregates: Vec<Cell> = results.iter().map(value_or_null).collect();
    let mut condition_check = ConditionCheck {
        expression: condition.text.clone(),
        is_by_row: condition.is_by_row,
        aggregate_rows: results.iter().map(|result| result.rows).collect(),
        share_counts: results.iter().map(AggregateValue::share_count).collect(),
        aggregate_values: results.into_iter().map(|result| result.value).collect(),
        ..ConditionCheck::default()
    };
    let column_with_direction =
        |(k, name): (usize, &String)| Some((k, table.column(name)?.metadata.worse?));
    let order_column = condition.columns.iter().enumerate().find_map(column_with_direction);
    let mut violating_rows =
        WorstRows::new(order_column.map(|(_, direction)| direction), max_violating_rows);
    let mut file_truth = None;
    let key_columns = table.key_columns();
    let read_columns = [&condition.column_names()[..], &key_columns].concat();
    for_each_row(table, &read_columns, filter, |context| {
        condition_check.rows += 1;
        let context = EvaluationContext { aggregates: &aggregates, ..*context };
        let truth = condition.root.truth(&context);
        if !condition.is_by_row {
            file_truth = truth;
            return Ok(());
        }
        match truth {
            Some(true) => return Ok(()),
            Some(false) => condition_check.failing_rows += 1,
            None => condition_check.undefined_rows += 1,
        }
        if allow_null && truth.is_none() {
            return Ok(());
        }
        let order_value = order_column.and_then(|(column, _)| context.row.cell(column).number());
        violating_rows.insert(order_value, || {
            let first_key_column = condition.columns.len();
            let other_columns = (0..first_key_column)
                .filter(|&column| !key_columns.contains(&read_columns[column]));
            let columns = (first_key_column..read_columns.len()).chain(other_columns);
            let cells = columns
                .map(|column| (read_columns[column].to_owned(), context.row.cell(column)))
                .collect();
            ViolatingRow { row: context.row.index(), is_undefined: truth.is_none(), cells }
        });
        Ok(())
    })?;
    condition_check.violating_rows = violating_rows.finish();
    condition_check.holds = condition_check.rows > 0
        && if condition.is_by_row {
            condition_check.failing_rows == 0 && (allow_null || condition_check.undefined_rows == 0)
        } else {
            file_truth.unwrap_or(false)
        };
    Ok(condition_check)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    fn check_text(text: &str, filter: Option<&str>, allow_null: bool) -> ConditionCheck {
        let table = sample::table();
        let condition = Condition::parse(text, &table).unwrap();
        let filter = filter.map(|filter| Condition::parse(filter, &table).unwrap());
        check_condition(&table, &condition, filter.as_ref(), allow_null, 3).unwrap()
    }

    // The sample's ratios are 1, 1.5, 2.5, null, 4, 1.2; rows below 2 are reliable; row 3 has
    // diverged; row 4 is sensitive.
    #[test]
    fn violating_rows_are_listed_with_their_keys() {
        let result = check_text("ratio_max < 2", None, false);
        assert!(!result.holds && result.is_by_row);
        assert_eq!((result.rows, result.failing_rows, result.undefined_rows), (6, 2, 1));
        assert_eq!(
            result.violating_rows.iter().map(|violating_row| violating_row.row).collect::<Vec<_>>(),
            [2, 3, 4]
        );
        let first_violation = &result.violating_rows[0];
        let names: Vec<&str> =
            first_violation.cells.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["point", "unbalance_mass_kg", "damping_n_s_per_m", "ratio_max"]);
        assert_eq!(first_violation.cells[1].1, Cell::Number(0.1));
        assert_eq!(first_violation.cells[3].1, Cell::Number(2.5));
        assert!(result.violating_rows[1].is_undefined);
    }

    #[test]
    fn the_worst_violating_rows_come_first() {
        // The gaps are 0.009, 0.0085, 0.0075, null, 0.006, 0.0088 m.
        let result = check_text("min_gap_nonlinear_m > 0.0089", None, false);
        assert_eq!((result.failing_rows, result.undefined_rows), (4, 1));
        assert_eq!(
            result.violating_rows.iter().map(|violating_row| violating_row.row).collect::<Vec<_>>(),
            [4, 2, 1]
        );
    }

    #[test]
    fn missing_values_violate_conditions_unless_allowed() {
        assert!(!check_text("ratio_max < 9", None, false).holds);
        assert!(check_text("ratio_max < 9", None, true).holds);
        assert!(check_text("ratio_max < 9 or ratio_max is null", None, false).holds);
        assert!(check_text("ratio_max < 9 or status == 'diverged'", None, false).holds);
        assert!(!check_text("ratio_max is not null", None, false).holds);
        assert!(!check_text("not (ratio_max < 9)", None, true).holds);
        assert_eq!(check_text("not (ratio_max < 9)", None, true).undefined_rows, 1);
    }

    #[test]
    fn rows_outside_the_filter_are_not_checked_and_no_condition_holds_for_no_rows() {
        let result = check_text("ratio_max < 3", Some("not sensitive and status == \"ok\""), false);
        assert!(result.holds, "{result:?}");
        assert_eq!(result.rows, 4);
        assert!(!check_text("ratio_max < 3", Some("status == \"panicked\""), false).holds);
        assert!(!check_text("count(reliable) == 0", Some("status == \"panicked\""), false).holds);
    }

    #[test]
    fn aggregates_cover_all_rows() {
        for (text, holds) in [
            ("count(true) == 6", true),
            ("count(reliable) == 3", true),
            ("count(not reliable) == 2", true),
            ("share(reliable) == 3 / 5", true),
            ("share(not reliable) == 2 / 5", true),
            ("count(ratio_max is null) == 1", true),
            ("min(ratio_max) == 1 and max(ratio_max) == 4", true),
            ("mean(ratio_max) == (1 + 1.5 + 2.5 + 4 + 1.2) / 5", true),
            ("max(abs(damping_n_s_per_m - 70)) <= 10", true),
            ("max(-ratio_max) < -1", false),
            ("count(status != \"ok\") < 1", false),
        ] {
            let result = check_text(text, None, true);
            assert!(!result.is_by_row);
            assert_eq!(result.holds, holds, "{text}: {result:?}");
        }
        let by_row_with_aggregate = check_text("ratio_max <= max(ratio_max)", None, true);
        assert!(by_row_with_aggregate.holds && by_row_with_aggregate.is_by_row);
        assert_eq!(by_row_with_aggregate.aggregate_values, [Cell::Number(4.0)]);
        let filtered = check_text("max(ratio_max) == 2.5", Some("not sensitive"), true);
        assert!(filtered.holds, "{filtered:?}");
    }

    #[test]
    fn shares_come_with_their_counts() {
        let result = check_text("share(reliable) > 0.5 and mean(ratio_max) < 9", None, true);
        assert_eq!(result.share_counts, [Some(3), None]);
        assert_eq!(result.aggregate_rows, [5, 5]);
    }

    #[test]
    fn a_conjunction_is_split_at_its_outermost_ands() {
        let table = sample::table();
        for (text, conjuncts) in [
            ("ratio_max < 2", &["ratio_max < 2"][..]),
            ("ratio_max < 2 and reliable", &["ratio_max < 2", "reliable"]),
            (
                "not (reliable and sensitive) and count(reliable and sensitive) == 0 and reliable",
                &["not (reliable and sensitive)", "count(reliable and sensitive) == 0", "reliable"],
            ),
            ("reliable and sensitive or reliable", &["reliable and sensitive or reliable"]),
            ("(reliable and sensitive)", &["(reliable and sensitive)"]),
            ("status == ' and ' and reliable", &["status == ' and '", "reliable"]),
        ] {
            let condition = Condition::parse(text, &table).unwrap();
            assert_eq!(condition.conjuncts(), conjuncts);
            for conjunct in condition.conjuncts() {
                Condition::parse(conjunct, &table).unwrap();
            }
        }
    }

    // Other writers store a missing value as NaN.
    #[test]
    fn nan_is_null() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("nan.parquet");
        let ratios = [Some(1.0), Some(f64::NAN), Some(3.0), None];
        sample::write(&path, vec![("x", "1", sample::number_array(&ratios))], &[]);
        let table = ResultTable::open(&path).unwrap();
        let check_column = |text: &str, filter: Option<&str>| {
            let condition = Condition::parse(text, &table).unwrap();
            let filter = filter.map(|filter| Condition::parse(filter, &table).unwrap());
            check_condition(&table, &condition, filter.as_ref(), true, 3).unwrap()
        };
        assert!(check_column("count(x is null) == 2 and mean(x) == 2 and max(x) == 3", None).holds);
        assert_eq!(check_column("x > 0", Some("x is not null")).rows, 2);
        assert_eq!(check_column("x > 0", None).undefined_rows, 2);
        assert!(check_column("share(x > 2) == 0.5", None).holds);
    }

    // Row 3 has diverged, so no aggregate of ratios has a value of all rows.
    #[test]
    fn incomplete_aggregates_are_unknown_unless_allowed() {
        for text in [
            "max(ratio_max) < 9",
            "min(ratio_max) > 0",
            "mean(ratio_max) < 9",
            "count(ratio_max > 9) == 0",
            "count(not (ratio_max > 9)) > 0",
            "share(reliable) >= 0",
            "not (max(ratio_max) > 9)",
            "ratio_max is null or ratio_max <= max(ratio_max)",
        ] {
            let result = check_text(text, None, false);
            assert!(!result.holds, "{text}: {result:?}");
            assert_eq!((result.rows, &result.aggregate_rows[..]), (6, &[5][..]), "{text}");
            assert!(check_text(text, None, true).holds, "{text}");
            assert!(check_text(text, Some("ratio_max is not null"), false).holds, "{text}");
        }
        assert!(check_text("max(ratio_max) < 9 or count(true) == 6", None, false).holds);
        assert!(check_text("share(status == \"ok\") > 0.8", None, false).holds);
        // An aggregate of no values is unknown even with --allow-null.
        let check_without_values =
            check_text("max(ratio_max) < 9", Some("ratio_max is null"), true);
        assert!(
            !check_without_values.holds && check_without_values.aggregate_rows == [0],
            "{check_without_values:?}"
        );
    }
}

//! Whether conditions hold, and where not.

use serde::Serialize;

use crate::condition::{Condition, Context, Folded, each_row};
use crate::error::{Result, ResultsError};
use crate::top::Worst;
use sweep_files::{Cell, ResultTable};

/// A row that does not keep a condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Offender {
    /// Its number in the file, from 0.
    pub row: u64,
    /// Whether the condition is neither true nor false there, because a value is missing.
    pub undefined: bool,
    /// The columns that say where it is, and those that the condition reads.
    pub cells: Vec<(String, Cell)>,
}

/// What came of one condition.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Checked {
    /// The condition as typed.
    pub expression: String,
    /// Whether it is true: for every row, or of the file as a whole.
    pub holds: bool,
    /// Whether it speaks of single rows.
    pub by_row: bool,
    /// Rows it was evaluated on.
    pub rows: u64,
    /// Rows for which it is false.
    pub failing: u64,
    /// Rows for which it is neither true nor false.
    pub undefined: u64,
    /// Values of its functions over all rows, in the order of their closing parentheses; of the
    /// rows that have a value.
    pub folded: Vec<Cell>,
    /// How many rows those are.
    pub folded_rows: Vec<u64>,
    /// Rows that do not keep it: the worst in the first of its columns that can be bad.
    pub offenders: Vec<Offender>,
}

/// Checks a condition on the rows for which `keep` is true.
///
/// A row where a value is missing does not keep a condition unless that is true or false whatever
/// the value is, and a function over all rows has no value if it lacks one of any row. With
/// `allow_null` such rows pass, and functions leave them out. No rows at all keep no condition.
///
/// # Errors
/// [`ResultsError::File`].
pub fn check(
    table: &ResultTable,
    condition: &Condition,
    keep: Option<&Condition>,
    allow_null: bool,
    most_offenders: usize,
) -> Result<Checked, ResultsError> {
    let folds = condition.fold(table, keep)?;
    let known = |fold: &Folded| {
        if fold.whole || allow_null { fold.value.clone() } else { Cell::Null }
    };
    let folded: Vec<Cell> = folds.iter().map(known).collect();
    let mut checked = Checked {
        expression: condition.text.clone(),
        by_row: condition.by_row,
        folded_rows: folds.iter().map(|fold| fold.over).collect(),
        folded: folds.into_iter().map(|fold| fold.value).collect(),
        ..Checked::default()
    };
    let column = |(k, name): (usize, &String)| Some((k, table.column(name)?.worse?));
    let by = condition.columns.iter().enumerate().find_map(column);
    let (mut whole, mut offenders) = (None, Worst::new(by.map(|(_, worse)| worse), most_offenders));
    let places = table.places();
    let names = [&condition.names()[..], &places].concat();
    each_row(table, &names, keep, |at| {
        checked.rows += 1;
        let truth = condition.root.truth(&Context { folded: &folded, ..*at });
        if !condition.by_row {
            whole = Some(truth);
            return Ok(());
        }
        match truth {
            Some(true) => return Ok(()),
            Some(false) => checked.failing += 1,
            None => checked.undefined += 1,
        }
        if allow_null && truth.is_none() {
            return Ok(());
        }
        let value = by.and_then(|(column, _)| at.row.cell(column).number());
        offenders.take(value, || {
            let own = condition.columns.len();
            let read = (0..own).filter(|&column| !places.contains(&names[column]));
            let cells = (own..names.len()).chain(read);
            let cells = cells.map(|column| (names[column].to_owned(), at.row.cell(column)));
            Offender { row: at.row.index(), undefined: truth.is_none(), cells: cells.collect() }
        });
        Ok(())
    })?;
    checked.offenders = offenders.finish();
    checked.holds = checked.rows > 0
        && if condition.by_row {
            checked.failing == 0 && (allow_null || checked.undefined == 0)
        } else {
            whole.flatten().unwrap_or(false)
        };
    Ok(checked)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    fn checked(text: &str, keep: Option<&str>, allow_null: bool) -> Checked {
        let table = sample::table();
        let condition = Condition::parse(text, &table).unwrap();
        let keep = keep.map(|keep| Condition::parse(keep, &table).unwrap());
        check(&table, &condition, keep.as_ref(), allow_null, 3).unwrap()
    }

    // Ratios of the sample: 1, 1.5, 2.5, null, 4, 1.2; reliable where below 2; row 3 diverged; row
    // 4 is sensitive.
    #[test]
    fn rows_that_do_not_keep_a_condition_are_told_with_their_places() {
        let found = checked("ratio_max < 2", None, false);
        assert!(!found.holds && found.by_row);
        assert_eq!((found.rows, found.failing, found.undefined), (6, 2, 1));
        assert_eq!(found.offenders.iter().map(|o| o.row).collect::<Vec<_>>(), [2, 3, 4]);
        let first = &found.offenders[0];
        let names: Vec<&str> = first.cells.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["point", "unbalance_mass_kg", "damping_n_s_per_m", "ratio_max"]);
        assert_eq!(first.cells[1].1, Cell::Number(0.1));
        assert_eq!(first.cells[3].1, Cell::Number(2.5));
        assert!(found.offenders[1].undefined);
    }

    #[test]
    fn the_worst_of_the_rows_that_break_a_condition_come_first() {
        // Gaps fall with the ratio: 0.009, 0.0085, 0.0075, null, 0.006, 0.0088 m.
        let found = checked("min_gap_nonlinear_m > 0.0089", None, false);
        assert_eq!((found.failing, found.undefined), (4, 1));
        assert_eq!(found.offenders.iter().map(|o| o.row).collect::<Vec<_>>(), [4, 2, 1]);
    }

    #[test]
    fn what_is_missing_keeps_nothing_unless_that_is_said() {
        assert!(!checked("ratio_max < 9", None, false).holds);
        assert!(checked("ratio_max < 9", None, true).holds);
        assert!(checked("ratio_max < 9 or ratio_max is null", None, false).holds);
        assert!(checked("ratio_max < 9 or status == 'diverged'", None, false).holds);
        assert!(!checked("ratio_max is not null", None, false).holds);
        assert!(!checked("not (ratio_max < 9)", None, true).holds);
        assert_eq!(checked("not (ratio_max < 9)", None, true).undefined, 1);
    }

    #[test]
    fn rows_left_out_are_not_checked_and_none_left_keep_nothing() {
        let found = checked("ratio_max < 3", Some("not sensitive and status == \"ok\""), false);
        assert!(found.holds, "{found:?}");
        assert_eq!(found.rows, 4);
        assert!(!checked("ratio_max < 3", Some("status == \"panicked\""), false).holds);
        assert!(!checked("count(reliable) == 0", Some("status == \"panicked\""), false).holds);
    }

    #[test]
    fn functions_fold_all_rows() {
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
            let found = checked(text, None, true);
            assert!(!found.by_row);
            assert_eq!(found.holds, holds, "{text}: {found:?}");
        }
        let mixed = checked("ratio_max <= max(ratio_max)", None, true);
        assert!(mixed.holds && mixed.by_row);
        assert_eq!(mixed.folded, [Cell::Number(4.0)]);
        let kept = checked("max(ratio_max) == 2.5", Some("not sensitive"), true);
        assert!(kept.holds, "{kept:?}");
    }

    // NaN is how other writers store a missing value.
    #[test]
    fn nan_is_null() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("nan.parquet");
        let ratios = [Some(1.0), Some(f64::NAN), Some(3.0), None];
        sample::write(&path, vec![("x", "1", sample::numbers(&ratios))], &[]);
        let table = ResultTable::open(&path).unwrap();
        let passes = |text: &str, keep: Option<&str>| {
            let condition = Condition::parse(text, &table).unwrap();
            let keep = keep.map(|keep| Condition::parse(keep, &table).unwrap());
            check(&table, &condition, keep.as_ref(), true, 3).unwrap()
        };
        assert!(passes("count(x is null) == 2 and mean(x) == 2 and max(x) == 3", None).holds);
        assert_eq!(passes("x > 0", Some("x is not null")).rows, 2);
        assert_eq!(passes("x > 0", None).undefined, 2);
        assert!(passes("share(x > 2) == 0.5", None).holds);
    }

    // One of six rows diverged: nothing that looks at its ratio can be said of all rows.
    #[test]
    fn a_function_that_lacks_a_row_keeps_nothing_unless_that_is_said() {
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
            let found = checked(text, None, false);
            assert!(!found.holds, "{text}: {found:?}");
            assert_eq!((found.rows, &found.folded_rows[..]), (6, &[5][..]), "{text}");
            assert!(checked(text, None, true).holds, "{text}");
            assert!(checked(text, Some("ratio_max is not null"), false).holds, "{text}");
        }
        assert!(checked("max(ratio_max) < 9 or count(true) == 6", None, false).holds);
        assert!(checked("share(status == \"ok\") > 0.8", None, false).holds);
        // Not even --allow-null makes a number of nothing.
        let nothing = checked("max(ratio_max) < 9", Some("ratio_max is null"), true);
        assert!(!nothing.holds && nothing.folded_rows == [0], "{nothing:?}");
    }
}

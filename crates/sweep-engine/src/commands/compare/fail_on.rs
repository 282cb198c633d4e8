//! The option `--fail-on`: differences that a comparison must not have.

use std::str::FromStr;

use super::format_number;
use sweep_files::CellKind;
use sweep_results::{Comparison, ResultTable};

/// A kind of difference that makes the comparison fail.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum FailCriterion {
    Any,
    Plan,
    Rows,
    Flips,
    Lost,
    Sensitive,
    Ratio(f64),
    Gap(f64),
    Boundary(f64),
    /// A column of numbers, and the greatest change that is allowed.
    Column(String, f64),
}

impl FromStr for FailCriterion {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected_values = || {
            "expected any, plan, rows, flips, lost, sensitive, ratio=PART, gap=M, boundary=WIDTH \
             or COLUMN=CHANGE"
                .to_owned()
        };
        let (name, value) = match text.split_once('=') {
            Some((name, value)) => (name, Some(value)),
            None => (text, None),
        };
        let number = || {
            let number = value.and_then(|value| value.trim().parse::<f64>().ok());
            number
                .filter(|number| number.is_finite() && *number >= 0.0)
                .ok_or_else(|| format!("expected a number of at least 0, as in {name}=0.05"))
        };
        match (name.trim(), value) {
            ("any", None) => Ok(Self::Any),
            ("plan", None) => Ok(Self::Plan),
            ("rows", None) => Ok(Self::Rows),
            ("flips", None) => Ok(Self::Flips),
            ("lost", None) => Ok(Self::Lost),
            ("sensitive", None) => Ok(Self::Sensitive),
            ("ratio", _) => Ok(Self::Ratio(number()?)),
            ("gap", _) => Ok(Self::Gap(number()?)),
            ("boundary", _) => Ok(Self::Boundary(number()?)),
            ("any" | "plan" | "rows" | "flips" | "lost" | "sensitive" | "", _) => {
                Err(expected_values())
            }
            (column, Some(_)) => Ok(Self::Column(column.to_owned(), number()?)),
            _ => Err(expected_values()),
        }
    }
}

impl FailCriterion {
    /// Returns the name of the check and the kind of files that it needs, if the compared files are
    /// of another kind. In such files the check would never fail.
    pub(super) fn find_unmet_need(
        &self,
        comparison: &Comparison,
        tables: &[ResultTable; 2],
    ) -> Option<[&str; 2]> {
        let (is_met, name_and_need) = match self {
            Self::Any | Self::Plan | Self::Rows => return None,
            Self::Flips => (comparison.has_verdicts, ["flips", "two files with verdicts"]),
            Self::Lost => (comparison.has_verdicts, ["lost", "two files with verdicts"]),
            Self::Sensitive => (comparison.has_verdicts, ["sensitive", "two files with verdicts"]),
            Self::Ratio(_) => (comparison.has_ratios, ["ratio", "two files with `ratio_max`"]),
            Self::Gap(_) => (comparison.has_gaps, ["gap", "two files with `min_gap_nonlinear_m`"]),
            Self::Boundary(_) => {
                (comparison.boundary.is_some(), ["boundary", "two boundaries, or maps of two axes"])
            }
            Self::Column(name, _) => {
                let is_number_column = |table: &ResultTable| {
                    table.column(name).is_some_and(|column| column.kind == CellKind::Number)
                };
                let is_compared =
                    tables.iter().all(is_number_column) && !comparison.keys.contains(name);
                (is_compared, [name.as_str(), "a column of numbers in both files that is no axis"])
            }
        };
        (!is_met).then_some(name_and_need)
    }

    /// Describes the forbidden differences between the files; `None` if there are none.
    pub(super) fn describe_violation(&self, comparison: &Comparison) -> Option<String> {
        let insensitive_rows = || comparison.shared_rows.iter().filter(|row| !row.is_sensitive);
        let format_count =
            |noun: &str, count: usize| (count > 0).then(|| format!("{noun}: {count}"));
        match self {
            Self::Any => (!comparison.is_empty()).then(|| "the files differ".to_owned()),
            Self::Plan => format_count("differences of the plans", comparison.plan.len()),
            Self::Rows => format_count(
                "rows of one file alone",
                comparison.unmatched_rows.iter().sum::<u64>() as usize,
            ),
            Self::Flips => format_count("verdicts that flipped", comparison.flips(false).count()),
            Self::Lost => {
                let lost_rows = comparison.flips(false).filter(|row| row.is_lost).count();
                format_count("rows that are no longer reliable", lost_rows)
            }
            Self::Sensitive => {
                format_count("sensitive verdicts that flipped", comparison.flips(true).count())
            }
            Self::Column(name, max_change) => {
                let column =
                    comparison.changed_columns.iter().find(|column| column.name == *name)?;
                let worst_row = column
                    .worst_rows
                    .first()
                    .filter(|worst_row| worst_row.deviation() > *max_change)?;
                let unit = column.unit.as_str();
                let change_text = match worst_row.deviation() {
                    deviation if deviation.is_finite() => {
                        format!("changed by up to {}", format_number(deviation))
                    }
                    _ => "came or went".to_owned(),
                };
                Some(format!(
                    "{name} {change_text} {unit}, and may by {}",
                    format_number(*max_change)
                ))
            }
            Self::Ratio(max_change) => {
                let percent = format_number(100.0 * max_change);
                let noun = format!("ratios that changed by more than {percent} %, came or went");
                format_count(
                    &noun,
                    insensitive_rows().filter(|row| row.ratio_deviation() > *max_change).count(),
                )
            }
            Self::Gap(max_change) => {
                let max_change_text = format_number(*max_change);
                let noun =
                    format!("gaps that changed by more than {max_change_text} m, came or went");
                format_count(
                    &noun,
                    insensitive_rows().filter(|row| row.gap_deviation_m() > *max_change).count(),
                )
            }
            Self::Boundary(max_change) => {
                let shift = comparison.boundary.as_ref()?;
                let shifted_crossings = shift
                    .crossings
                    .iter()
                    .filter(|crossing| crossing.certain_shift() > *max_change);
                let noun = format!(
                    "crossings that moved by more than {} {}",
                    format_number(*max_change),
                    shift.unit
                );
                format_count(
                    noun.trim_end(),
                    shifted_crossings.count() + shift.unmatched_lines.len(),
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_fail_on_are_parsed() {
        assert_eq!("flips".parse(), Ok(FailCriterion::Flips));
        assert_eq!("ratio=0.05".parse(), Ok(FailCriterion::Ratio(0.05)));
        assert_eq!("boundary=2".parse(), Ok(FailCriterion::Boundary(2.0)));
        let column = FailCriterion::Column("growth_per_s".to_owned(), 0.5);
        assert_eq!("growth_per_s = 0.5".parse(), Ok(column));
        for (text, expected_kind) in [
            ("flip", "expected any, plan"),
            ("flips=3", "expected any, plan"),
            ("ratio", "as in ratio=0.05"),
            ("gap=-1", "at least 0"),
            ("growth_per_s=", "as in growth_per_s=0.05"),
            ("=1", "expected any, plan"),
            ("ratio=nan", "at least 0"),
        ] {
            let message = text.parse::<FailCriterion>().unwrap_err();
            assert!(message.contains(expected_kind), "{text}: {message}");
        }
    }
}

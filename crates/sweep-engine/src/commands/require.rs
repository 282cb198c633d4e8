//! `sweep require FILE EXPRESSION ...`: checks conditions on a result.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde::Serialize;
use serde_json::json;

use super::{conditions, format_cell, format_table};
use crate::store::refuse_unfinished;
use crate::{Error, Exit, show};
use sweep_plot::ShareInterval;
use sweep_results::{Cell, Condition, ConditionCheck, ResultTable, check_condition};

/// Arguments of `sweep require`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG_HELP)]
pub struct RequireArgs {
    /// A result of `sweep run`, or any other Parquet file of this program
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Condition on every row, or on the file as a whole
    #[arg(value_name = "EXPRESSION", required = true)]
    expressions: Vec<String>,
    /// Check only the rows for which this expression is true
    #[arg(long = "where", value_name = "EXPRESSION")]
    filter: Option<String>,
    /// Accept rows for which an expression is neither true nor false because a value is missing,
    /// and skip them in functions over all rows
    #[arg(long)]
    allow_null: bool,
    /// Maximum number of violating rows shown for each expression, the worst first
    #[arg(long, value_name = "N", default_value_t = 10)]
    rows: u16,
    /// Print the result of each expression as JSON
    #[arg(long)]
    json: bool,
}

/// The text that `--help` adds.
const LONG_HELP: &str = "\
An expression compares columns (`sweep show FILE` lists them), numbers and texts in quotes by < <= \
> >= == !=, joins comparisons by and, or, not, and calculates by + - * / and abs(). \
`COLUMN is null` and `COLUMN is not null` ask for missing values.

It speaks of every row, unless all of its columns stand within functions over all rows: count() \
and share() of a condition, min(), max() and mean() of a number, and quantile(NUMBER, 0.95).

A comparison with a missing value (null) is neither true nor false, as in SQL, and a row that is \
neither does not keep the expression: a point that failed does not pass a gate unnoticed. Nor has \
a function over all rows a value where one of them has none. --allow-null lets such rows pass, and \
lets functions leave them out. If there is no row to check, nothing holds.

Of an expression that fails and joins others by `and`, it says which of them fail. A share of \
points that a design places at random comes with the interval in which that of all such points \
lies with 95 % confidence (Wilson's).

The exit code is 0 where every expression holds, else 4.";

/// Checks the expressions.
///
/// # Errors
/// A file that cannot be read, and every mistake in the expressions.
pub fn run(args: &RequireArgs) -> Result<Exit, Error> {
    refuse_unfinished(&args.file)?;
    let file = ResultTable::open(&args.file)?;
    let conditions = conditions::parse_conditions("EXPRESSION", &args.expressions, &file)?;
    let filter = conditions::parse_filter(args.filter.as_ref(), &file)?;
    let max_rows = usize::from(args.rows);
    let is_random = is_random(&file);
    let expression_checks = conditions
        .iter()
        .map(|condition| {
            let whole_check =
                check_condition(&file, condition, filter.as_ref(), args.allow_null, max_rows)?;
            let parts =
                check_parts(&file, condition, filter.as_ref(), args.allow_null, whole_check.holds)?;
            Ok(ExpressionCheck {
                intervals: share_intervals(&whole_check, is_random),
                whole_check,
                parts,
            })
        })
        .collect::<Result<Vec<ExpressionCheck>, Error>>()?;
    let do_all_hold =
        expression_checks.iter().all(|expression_check| expression_check.whole_check.holds);
    if args.json {
        let json = json!({
            "file": args.file.display().to_string(),
            "where": args.filter,
            "holds": do_all_hold,
            "expressions": expression_checks,
        });
        show(&format!("{json:#}\n"))?;
    } else {
        show(
            &expression_checks
                .iter()
                .map(|expression_check| format_expression_check(args, expression_check, is_random))
                .collect::<String>(),
        )?;
    }
    Ok(if do_all_hold { Exit::Done } else { Exit::ConditionViolated })
}

/// An expression with the result of its check.
#[derive(Serialize)]
struct ExpressionCheck {
    #[serde(flatten)]
    whole_check: ConditionCheck,
    /// The 95 % confidence interval of each function over all rows; `None` for functions other than
    /// shares of random points.
    intervals: Vec<Option<[f64; 2]>>,
    /// The results of the parts that an expression joins by `and`, if the expression fails.
    parts: Vec<ConditionCheck>,
}

/// Returns whether a design placed the points at random, so that a share of them has a confidence
/// interval. Sobol points and Latin hypercubes are more even than random points, so that their
/// interval is no wider.
fn is_random(file: &ResultTable) -> bool {
    let method = file.plan.as_ref().and_then(|plan| plan["design"]["method"].as_str());
    method.is_some_and(|method| method != "list")
}

/// Computes Wilson's interval of every share.
fn share_intervals(condition_check: &ConditionCheck, is_random: bool) -> Vec<Option<[f64; 2]>> {
    let interval_of_share = |(count, rows): (&Option<u64>, &u64)| {
        let share = ShareInterval::wilson((*count)?, *rows).filter(|_| is_random)?;
        Some([share.low, share.high])
    };
    condition_check
        .share_counts
        .iter()
        .zip(&condition_check.aggregate_rows)
        .map(interval_of_share)
        .collect()
}

/// Checks each part that an expression joins by `and`, if the expression fails.
fn check_parts(
    file: &ResultTable,
    condition: &Condition,
    filter: Option<&Condition>,
    allow_null: bool,
    holds: bool,
) -> Result<Vec<ConditionCheck>, Error> {
    let conjunct_texts = condition.conjuncts();
    if holds || conjunct_texts.len() < 2 {
        return Ok(Vec::new());
    }
    let conjunct_texts: Vec<String> = conjunct_texts.into_iter().map(str::to_owned).collect();
    let parts = conditions::parse_conditions("EXPRESSION", &conjunct_texts, file)?;
    let part_checks = parts.iter().map(|part| check_condition(file, part, filter, allow_null, 0));
    Ok(part_checks.collect::<Result<Vec<_>, _>>()?)
}

/// Formats the result of an expression and of its parts.
fn format_expression_check(
    args: &RequireArgs,
    expression_check: &ExpressionCheck,
    is_random: bool,
) -> String {
    let mut text =
        format_condition_check(args, &expression_check.whole_check, &expression_check.intervals);
    for part in &expression_check.parts {
        let part_text = format_condition_check(args, part, &share_intervals(part, is_random));
        text.push_str(&format!("       {part_text}"));
    }
    text
}

/// Formats a value with its confidence interval, if it has one.
fn format_with_interval(cell: &Cell, interval: Option<&Option<[f64; 2]>>) -> String {
    match interval {
        Some(Some([low, high])) => {
            let [low, high] = [low, high].map(|end| format!("{end:.3}"));
            format!("{} (95 % confidence {low} to {high}, Wilson)", format_cell(cell))
        }
        _ => format_cell(cell),
    }
}

/// Formats the result of an expression: a line, and a table of the rows that violate it.
fn format_condition_check(
    args: &RequireArgs,
    condition_check: &ConditionCheck,
    share_intervals: &[Option<[f64; 2]>],
) -> String {
    let verdict = if condition_check.holds { "holds" } else { "FAILS" };
    let mut text = format!("{verdict}  {}", condition_check.expression);
    // Writing to a String cannot fail.
    let _ = match (condition_check.rows, condition_check.is_by_row) {
        (0, _) => writeln!(text, ": there is no row to check"),
        (rows, true) if condition_check.failing_rows + condition_check.undefined_rows == 0 => {
            writeln!(text, ": {rows} rows")
        }
        (rows, true) => {
            let undefined_note = match (condition_check.undefined_rows, args.allow_null) {
                (0, _) => String::new(),
                (count, true) => format!(", {count} undefined (null) and let pass"),
                (count, false) => format!(", {count} undefined (null)"),
            };
            writeln!(
                text,
                ": {} of {rows} rows false{undefined_note}",
                condition_check.failing_rows
            )
        }
        (rows, false) => {
            let value_texts = condition_check.aggregate_values.iter().enumerate();
            let value_texts =
                value_texts.map(|(k, cell)| format_with_interval(cell, share_intervals.get(k)));
            let value_texts: Vec<String> = value_texts.collect();
            let value_texts = value_texts.join(", ");
            match condition_check.aggregate_rows.iter().min() {
                Some(&complete_rows) if complete_rows < rows => {
                    let null_rows = rows - complete_rows;
                    let null_note = match args.allow_null {
                        true => "left out",
                        false => "(`status` says why; --allow-null leaves them out)",
                    };
                    writeln!(
                        text,
                        ": {value_texts} over {complete_rows} of {rows} rows, {null_rows} null \
                         {null_note}"
                    )
                }
                _ => writeln!(text, ": {value_texts} over {rows} rows"),
            }
        }
    };
    let Some(first) = condition_check.violating_rows.first() else { return text };
    let headings: Vec<String> = first.cells.iter().map(|(name, _)| name.clone()).collect();
    let format_cells = |violating_row: &sweep_results::ViolatingRow| {
        violating_row.cells.iter().map(|(_, cell)| format_cell(cell)).collect()
    };
    let rows: Vec<Vec<String>> = condition_check.violating_rows.iter().map(format_cells).collect();
    text.push_str(&format_table(&headings, &rows, "       "));
    let violation_count = condition_check.failing_rows
        + if args.allow_null { 0 } else { condition_check.undefined_rows };
    let hidden_rows = violation_count - condition_check.violating_rows.len() as u64;
    if hidden_rows > 0 {
        let _ = writeln!(text, "       and {hidden_rows} more (--rows)");
    }
    text
}

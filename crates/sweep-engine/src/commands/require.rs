//! `sweep require FILE EXPRESSION ...`: a gate.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::json;

use super::{conditions, table, word};
use crate::{Error, Exit, show};
use sweep_results::{Checked, ResultTable, check};

/// Arguments of `sweep require`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG)]
pub struct Args {
    /// A result of `sweep run`, or any other Parquet file of this program
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// What must hold: of every row, or of the file as a whole
    #[arg(value_name = "EXPRESSION", required = true)]
    expressions: Vec<String>,
    /// Check only the rows for which this expression is true
    #[arg(long = "where", value_name = "EXPRESSION")]
    keep: Option<String>,
    /// Let rows pass where an expression is neither true nor false because a value is missing, and
    /// let functions over all rows leave them out
    #[arg(long)]
    allow_null: bool,
    /// Show at most this many offending rows of each expression, the worst first
    #[arg(long, value_name = "N", default_value_t = 10)]
    rows: u16,
    /// Print what came of each expression as JSON
    #[arg(long)]
    json: bool,
}

/// What `--help` adds.
const LONG: &str = "\
An expression compares columns (`sweep show FILE` lists them), numbers and texts in quotes by < <= \
> >= == !=, joins comparisons by and, or, not, and calculates by + - * / and abs(). \
`COLUMN is null` and `COLUMN is not null` ask for missing values.

It speaks of every row, unless all of its columns stand within functions over all rows: count() \
and share() of a condition, min(), max() and mean() of a number, and quantile(NUMBER, 0.95).

A comparison with a missing value (null) is neither true nor false, as in SQL, and a row that is \
neither does not keep the expression: a point that failed does not pass a gate unnoticed. Nor has \
a function over all rows a value where one of them has none. --allow-null lets such rows pass, and \
lets functions leave them out. If there is no row to check, nothing holds.

The exit code is 0 where every expression holds, else 4.";

/// Checks the expressions.
///
/// # Errors
/// A file that cannot be read, and every mistake in the expressions.
pub fn run(args: &Args) -> Result<Exit, Error> {
    let file = ResultTable::open(&args.file)?;
    let conditions = conditions::parse("EXPRESSION", &args.expressions, &file)?;
    let keep = conditions::of_rows(args.keep.as_ref(), &file)?;
    let shown = usize::from(args.rows);
    let checked = conditions
        .iter()
        .map(|condition| check(&file, condition, keep.as_ref(), args.allow_null, shown))
        .collect::<Result<Vec<_>, _>>()?;
    let holds = checked.iter().all(|checked| checked.holds);
    if args.json {
        let said = json!({
            "file": args.file.display().to_string(),
            "where": args.keep,
            "holds": holds,
            "expressions": checked,
        });
        show(&format!("{said:#}\n"))?;
    } else {
        show(&checked.iter().map(|checked| format_checked(args, checked)).collect::<String>())?;
    }
    Ok(if holds { Exit::Done } else { Exit::NotHeld })
}

/// What came of an expression: a line, and the rows that do not keep it.
fn format_checked(args: &Args, checked: &Checked) -> String {
    let verdict = if checked.holds { "holds" } else { "FAILS" };
    let mut text = format!("{verdict}  {}", checked.expression);
    // Writing to a String cannot fail.
    let _ = match (checked.rows, checked.by_row) {
        (0, _) => writeln!(text, ": there is no row to check"),
        (rows, true) if checked.failing + checked.undefined == 0 => {
            writeln!(text, ": {rows} rows")
        }
        (rows, true) => {
            let undefined = match (checked.undefined, args.allow_null) {
                (0, _) => String::new(),
                (count, true) => format!(", {count} undefined (null) and let pass"),
                (count, false) => format!(", {count} undefined (null)"),
            };
            writeln!(text, ": {} of {rows} rows false{undefined}", checked.failing)
        }
        (rows, false) => {
            let values: Vec<String> = checked.folded.iter().map(word).collect();
            let values = values.join(", ");
            match checked.folded_rows.iter().min() {
                Some(&over) if over < rows => {
                    let missing = rows - over;
                    let say = match args.allow_null {
                        true => "left out",
                        false => "(`status` says why; --allow-null leaves them out)",
                    };
                    writeln!(text, ": {values} over {over} of {rows} rows, {missing} null {say}")
                }
                _ => writeln!(text, ": {values} over {rows} rows"),
            }
        }
    };
    let Some(first) = checked.offenders.first() else { return text };
    let headings: Vec<String> = first.cells.iter().map(|(name, _)| name.clone()).collect();
    let cells = |offender: &sweep_results::Offender| {
        offender.cells.iter().map(|(_, cell)| word(cell)).collect()
    };
    let rows: Vec<Vec<String>> = checked.offenders.iter().map(cells).collect();
    text.push_str(&table(&headings, &rows, "       "));
    let all = checked.failing + if args.allow_null { 0 } else { checked.undefined };
    let more = all - checked.offenders.len() as u64;
    if more > 0 {
        let _ = writeln!(text, "       and {more} more (--rows)");
    }
    text
}

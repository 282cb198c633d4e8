//! `sweep compare A B`: reports the differences between two results.

mod differences;
mod fail_on;
mod overridden;

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::{Value, json};

use super::{Lines as _, format_number, format_range, format_table, quote_for_shell};
use crate::config::section::{format_count, truncate};
use crate::store::refuse_unfinished;
use crate::{Error, Exit, Model, show, tell};
use fail_on::FailCriterion;
use overridden::{OverriddenNumbers, find_overridden};
use sweep_files::{FileKind, Output};
use sweep_plot::capitalise;
use sweep_results::{
    BoundaryShift, ColumnChange, Comparison, Flip, PlanChange, ResultTable, SharedRow, compare,
};

/// Arguments of `sweep compare`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG_HELP)]
pub struct CompareArgs {
    /// The result to compare with: a map, a boundary, or any other Parquet file of this program
    #[arg(value_name = "A")]
    first: PathBuf,
    /// The result that is compared with it
    #[arg(value_name = "B")]
    second: PathBuf,
    /// Print the differences as JSON
    #[arg(long, conflicts_with = "markdown")]
    json: bool,
    /// Print the differences as Markdown, for the summary of a CI job
    #[arg(long)]
    markdown: bool,
    /// Write the differences of maps, row by row, to a Parquet file that `sweep plot` draws
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Exit with 4 if the files differ in WHAT: any, plan, flips, lost, sensitive, rows,
    /// ratio=PART, gap=M, boundary=WIDTH or COLUMN=CHANGE, as --help explains; may be repeated
    #[arg(long, value_name = "WHAT", value_parser = str::parse::<FailCriterion>)]
    fail_on: Vec<FailCriterion>,
    /// Maximum number of rows shown of each kind
    #[arg(long, value_name = "N", default_value_t = 5)]
    rows: u16,
}

/// The text that `--help` adds.
const LONG_HELP: &str = "\
Two rows are compared if their axes have the same values to nine digits; rows of only one file \
are counted. Where axes have the same tolerances about other numbers, rows of the same point are \
compared. An axis that only one file has is ignored if it has a single value. Files of \
different kinds, and files without a common row, are refused.

A sensitive row is chaotic: its digits, and perhaps its verdict, are those of one trajectory. Such \
rows are shown separately, and only `any` and `sensitive` apply to them.

Values of --fail-on:
  any             anything differs
  plan            parameters, spin, method or version
  rows            a row is in one file only
  flips           a verdict differs, in a row that is not sensitive
  lost            a row is reliable in the first file only, and not sensitive
  sensitive       a verdict differs, in a sensitive row
  ratio=0.05      a ratio changed by more than 5 % either way, or is in one file only
  gap=0.001       a least gap changed by more than 1 mm, or is in one file only
  boundary=2      the boundary moved by more than 2 in the second axis's unit, whatever the brackets
                  leave open, or has other numbers of crossings
  COLUMN=0.1      any column of numbers changed by more than this in its unit, in a row that is not
                  sensitive, or has a value in one file only; its greatest changes are shown too";

/// Compares the files.
///
/// # Errors
/// Files that cannot be read or compared, and an output that cannot be written.
pub fn run<M: Model>(args: &CompareArgs) -> Result<Exit, Error> {
    let compared_files = [&args.first, &args.second];
    compared_files.into_iter().try_for_each(|path| refuse_unfinished(path))?;
    let compared_tables =
        [ResultTable::open(compared_files[0])?, ResultTable::open(compared_files[1])?];
    let output =
        args.out.as_deref().map(|path| Output::begin(path, FileKind::Differences)).transpose()?;
    let comparison = compare(&compared_tables[0], &compared_tables[1])?;
    if let Some([check_name, needed_files]) = args
        .fail_on
        .iter()
        .find_map(|fail_on| fail_on.find_unmet_need(&comparison, &compared_tables))
    {
        return Err(Error::option("--fail-on", check_name, needed_files));
    }
    if let (Some(output), Some(path)) = (output, &args.out) {
        if !comparison.has_verdicts {
            let expectation = "two maps: other files have no differences row by row";
            return Err(Error::option("--out", path.display(), expectation));
        }
        output.finish(
            &differences::differences_table(args, &comparison, &compared_tables, M::ABOUT.build)
                .into_bytes(path)?,
        )?;
    }
    let violations: Vec<String> =
        args.fail_on.iter().filter_map(|fail_on| fail_on.describe_violation(&comparison)).collect();
    let overridden_numbers = find_overridden::<M>(&compared_tables, &comparison);
    if args.json {
        show(&format!("{:#}\n", to_json(args, &comparison, &overridden_numbers, &violations)))?;
    } else if args.markdown {
        show(&format_markdown(args, &comparison, &overridden_numbers, &violations))?;
    } else {
        let violation_lines =
            violations.iter().map(|violation| format!("--fail-on: {violation}\n"));
        show(
            &(format_text(args, &comparison, &overridden_numbers)
                + &violation_lines.collect::<String>()),
        )?;
        if let Some(out_text) = &args.out {
            let out_text = out_text.display();
            tell(&format!(
                "wrote {out_text}: sweep plot {}",
                quote_for_shell(&out_text.to_string())
            ));
        }
    }
    Ok(if violations.is_empty() { Exit::Done } else { Exit::ConditionViolated })
}

/// Formats a value of a plan, and shortens it if it is long.
fn format_plan_value(value: &Value) -> String {
    match value {
        Value::Null => "absent".to_owned(),
        Value::String(text) => text.clone(),
        Value::Number(number) => number.as_f64().map_or_else(|| number.to_string(), format_number),
        other => truncate(&other.to_string(), 48),
    }
}

fn format_optional(value: Option<f64>) -> String {
    value.map_or_else(|| "null".to_owned(), format_number)
}

fn describe_verdict(row: &SharedRow, side: usize) -> &'static str {
    // The flip determines the verdict of either side.
    match (row.flip, side) {
        (Flip::Lost, 0) | (Flip::Gained, 1) => "reliable",
        (Flip::Lost, _) | (Flip::Gained, _) => "not",
        _ => "undefined",
    }
}

/// The cells of both files, and the change between them if the table has a column for it.
type ComparedCells = ([String; 2], Option<String>);

/// A table with a title, which every output format shows.
struct TitledTable {
    title: String,
    headings: Vec<String>,
    rows: Vec<Vec<String>>,
}

/// Returns the tables of rows that differ, without empty ones.
fn difference_tables(args: &CompareArgs, comparison: &Comparison) -> Vec<TitledTable> {
    let max_rows = usize::from(args.rows);
    let mut titled_tables = Vec::new();
    let mut add_table =
        |title: String, rows: Vec<&SharedRow>, cells: &dyn Fn(&SharedRow) -> ComparedCells| {
            if rows.is_empty() {
                return;
            }
            let table_row = |row: &SharedRow| -> Vec<String> {
                let (sides, change_text) = cells(row);
                row.key
                    .iter()
                    .map(|value| format_number(*value))
                    .chain(sides)
                    .chain(change_text)
                    .collect()
            };
            let rows: Vec<_> = rows.into_iter().map(table_row).collect();
            let headings = comparison.keys.iter().map(String::as_str).chain(["A", "B", "change"]);
            let headings = headings.take(rows[0].len()).map(str::to_owned).collect();
            titled_tables.push(TitledTable { title, headings, rows });
        };
    // If results have a lower limit of ratios, the least ratio decides on the verdict too.
    let has_lower_limit =
        comparison.changed_columns.iter().any(|column| column.name == "ratio_min");
    let verdict_cell = |row: &SharedRow, side: usize| {
        let ratio = match has_lower_limit {
            true => format!(
                "{} to {}",
                format_optional(row.least_ratios[side]),
                format_optional(row.ratios[side])
            ),
            false => format_optional(row.ratios[side]),
        };
        match row.flip {
            Flip::Defined => ratio,
            _ => format!("{ratio} {}", describe_verdict(row, side)),
        }
    };
    for (sensitive, row_kind) in [(false, ""), (true, " of sensitive rows")] {
        let title =
            format!("verdicts that flipped{row_kind}: {}", comparison.flips(sensitive).count());
        let rows = comparison.flips(sensitive).take(max_rows).collect();
        add_table(title, rows, &|row| ([0, 1].map(|side| verdict_cell(row, side)), None));
    }
    for (sensitive, row_kind) in [(false, ""), (true, " of sensitive rows")] {
        let rows = comparison.most_deviating(max_rows, sensitive, SharedRow::ratio_deviation);
        add_table(format!("greatest changes of the ratio{row_kind}"), rows, &|row| {
            let change_percent = row.ratio_quotient().map(|quotient| 100.0 * (quotient - 1.0));
            let change_text = change_percent
                .map_or_else(|| format_optional(None), |percent| format!("{percent:+.3} %"));
            (row.ratios.map(format_optional), Some(change_text))
        });
        let rows = comparison.most_deviating(max_rows, sensitive, SharedRow::gap_deviation_m);
        add_table(format!("greatest changes of the least gap{row_kind}, m"), rows, &|row| {
            let sign = if row.gap_difference_m() > Some(0.0) { "+" } else { "" };
            let change_text = format!("{sign}{}", format_optional(row.gap_difference_m()));
            (row.gaps_m.map(format_optional), Some(change_text))
        });
    }
    titled_tables.extend(
        args.fail_on.iter().filter_map(|fail_on| column_table(fail_on, comparison, max_rows)),
    );
    titled_tables
}

/// Returns the table of the greatest changes of a column that `--fail-on` names.
fn column_table(
    fail_on: &FailCriterion,
    comparison: &Comparison,
    max_rows: usize,
) -> Option<TitledTable> {
    let FailCriterion::Column(name, _) = fail_on else { return None };
    let column = comparison.changed_columns.iter().find(|column| column.name == *name)?;
    let rows = column.worst_rows.iter().take(max_rows).map(|worst| {
        let [first, second] = worst.values;
        let cell_change = first.zip(second).map(|(first, second)| second - first);
        let sign = if cell_change > Some(0.0) { "+" } else { "" };
        let key_cells =
            comparison.shared_rows[worst.row].key.iter().map(|value| format_number(*value));
        let value_cells = [
            format_optional(first),
            format_optional(second),
            format!("{sign}{}", format_optional(cell_change)),
        ];
        key_cells.chain(value_cells).collect()
    });
    let rows: Vec<Vec<String>> = rows.collect();
    let unit_separator = if column.unit.is_empty() { "" } else { ", " };
    let title = format!("greatest changes of {name}{unit_separator}{}", column.unit);
    let headings = comparison.keys.iter().map(String::as_str).chain(["A", "B", "change"]);
    let headings = headings.map(str::to_owned).collect();
    (!rows.is_empty()).then_some(TitledTable { title, headings, rows })
}

/// Returns the lines of the summary, each with a name: overridden numbers, shared rows, columns,
/// verdicts, the boundary.
fn summary_lines(
    comparison: &Comparison,
    overridden: &[OverriddenNumbers],
) -> Vec<(&'static str, String)> {
    let mut lines = Vec::new();
    for OverriddenNumbers { axis, paths } in overridden {
        let first_paths = paths.iter().take(MAX_PLAN_LINES).map(String::as_str).collect::<Vec<_>>();
        let ellipsis = if paths.len() > first_paths.len() { ", ..." } else { "" };
        let first_paths = first_paths.join(", ");
        let description = format!(
            "{first_paths}{ellipsis}: the axis {axis} sets this in both, so that the change does \
             not show"
        );
        lines.push(("overridden", description));
    }
    let [first, second] = comparison.unmatched_rows;
    let unmatched_note = match (first, second) {
        (0, 0) => String::new(),
        _ => format!(", {first} only in A, {second} only in B"),
    };
    lines.push(("rows", format!("{} in both{unmatched_note}", comparison.shared_rows.len())));
    if comparison.is_matched_by_point {
        let description = "rows are matched by point: the axes have tolerances about other \
                           numbers; tables have the values in A";
        lines.push(("matched", description.to_owned()));
    }
    for (file, describe_column, value) in &comparison.single_valued_axes {
        let file_name = ["A", "B"][*file];
        lines.push((
            "axis",
            format!("{describe_column} = {} in {file_name} alone, left out", format_number(*value)),
        ));
    }
    for (names, file_name) in comparison.unmatched_columns.iter().zip(["A", "B"]) {
        if !names.is_empty() {
            lines.push(("columns", format!("only in {file_name}: {}", names.join(", "))));
        }
    }
    if comparison.has_verdicts {
        let count_flips =
            |flip: Flip| comparison.flips(false).filter(|row| row.flip == flip).count();
        let [lost, gained, defined] = [Flip::Lost, Flip::Gained, Flip::Defined].map(count_flips);
        let flip_text =
            format!("{lost} lost, {gained} gained, {defined} defined in one file alone");
        let sensitive_flips = comparison.flips(true).count();
        lines.push(("verdicts", format!("{flip_text}; of sensitive rows {sensitive_flips}")));
    }
    if let Some([first, second]) = comparison.over_estimated_rows.filter(|counts| *counts != [0, 0])
    {
        let description = format!(
            "in {first} rows of A, {second} of B the linear model over-estimates: a ratio is below \
             1 / ratio_limit, or ratio_min"
        );
        lines.push(("too high", description));
    }
    if let Some(shift) = &comparison.boundary {
        lines.push(("boundary", describe_shift(shift)));
    }
    let differing_rows = comparison.shared_rows.iter().filter(|row| row.differs).count();
    let description = match differing_rows {
        0 => "every shared cell is the same, bit for bit".to_owned(),
        count_flips => {
            let describe_column =
                |column: &ColumnChange| format!("{} ({})", column.name, column.rows);
            let names: Vec<String> =
                comparison.changed_columns.iter().take(6).map(describe_column).collect();
            let ellipsis = if comparison.changed_columns.len() > 6 { ", ..." } else { "" };
            format!("{count_flips} rows, in {}{ellipsis}", names.join(", "))
        }
    };
    lines.push(("differ", description));
    lines
}

/// Describes the shift of the boundary.
fn describe_shift(shift: &BoundaryShift) -> String {
    let BoundaryShift { axis, unit, crossings, .. } = shift;
    let count = format_count(crossings.len(), "crossing");
    let mut description = match (shift.most_shifted(), shift.mean_shift_range()) {
        (Some(_), _) if crossings.iter().all(|crossing| crossing.shift_range() == [0.0; 2]) => {
            format!("{count} along {axis}, none moved")
        }
        (Some(_), _)
            if crossings.iter().all(|crossing| crossing.brackets[0] == crossing.brackets[1]) =>
        {
            format!("{count} along {axis}, none moved out of its bracket")
        }
        (Some(most_shifted), Some([least, greatest])) => {
            let axis_values = shift.keys.iter().zip(&most_shifted.key_values);
            let axis_values: Vec<String> = axis_values
                .map(|(name, value)| format!("{name} {}", format_number(*value)))
                .collect();
            let [from, to] = most_shifted.brackets.map(|ends| format_range(ends, format_number));
            let certain_shifts = shift.count_certain_shifts();
            let axis_values = axis_values.join(", ");
            format!(
                "{count} along {axis}, {certain_shifts} moved farther than brackets explain; in \
                 the mean by {least:+.3} to {greatest:+.3} {unit}; farthest at {axis_values}: from \
                 within {from} to within {to}"
            )
        }
        _ => "no crossing in both".to_owned(),
    };
    if !shift.unmatched_lines.is_empty() {
        let lines = format_count(shift.unmatched_lines.len(), "line");
        let _ = write!(description, "; other numbers of crossings in {lines}");
    }
    description
}

/// Formats the differences as text.
fn format_text(
    args: &CompareArgs,
    comparison: &Comparison,
    overridden: &[OverriddenNumbers],
) -> String {
    let mut text = String::new();
    text.line("A", args.first.display());
    text.line("B", args.second.display());
    if comparison.is_empty() {
        text.line("differ", "not at all");
        return text;
    }
    for PlanChange { path, first, second } in comparison.plan.iter().take(MAX_PLAN_LINES) {
        text.line(
            "plan",
            format!("{path}: {} -> {}", format_plan_value(first), format_plan_value(second)),
        );
    }
    if comparison.plan.len() > MAX_PLAN_LINES {
        text.line("", format!("and {} more (--json)", comparison.plan.len() - MAX_PLAN_LINES));
    }
    for (name, description) in summary_lines(comparison, overridden) {
        text.line(name, &description);
    }
    for TitledTable { title, headings, rows } in difference_tables(args, comparison) {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{title}");
        text.push_str(&format_table(&headings, &rows, "  "));
    }
    text
}

/// The maximum number of differences of the plans that are shown. Basis: half of the lines of a
/// terminal. Doubling it shows twice as many.
const MAX_PLAN_LINES: usize = 12;

/// Formats the differences as Markdown.
fn format_markdown(
    args: &CompareArgs,
    comparison: &Comparison,
    overridden: &[OverriddenNumbers],
    violations: &[String],
) -> String {
    let names = [&args.first, &args.second].map(|path| format_code(&path.display().to_string()));
    let mut text = format!("### {} compared with {}\n\n", names[1], names[0]);
    if comparison.is_empty() {
        text.push_str("They do not differ.\n");
        return text;
    }
    for violation in violations {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "- **`--fail-on`: {violation}**");
    }
    for PlanChange { path, first, second } in comparison.plan.iter().take(MAX_PLAN_LINES) {
        let first = format_code(&format_plan_value(first));
        let second = format_code(&format_plan_value(second));
        let _ = writeln!(text, "- plan: {} from {first} to {second}", format_code(path));
    }
    if comparison.plan.len() > MAX_PLAN_LINES {
        let _ = writeln!(text, "- plan: {} more", comparison.plan.len() - MAX_PLAN_LINES);
    }
    for (name, description) in summary_lines(comparison, overridden) {
        let _ = writeln!(text, "- {name}: {}", escape_markdown(&description));
    }
    for TitledTable { title, headings, rows } in difference_tables(args, comparison) {
        let row = |cells: &[String]| {
            let cells: Vec<String> = cells.iter().map(|cell| escape_markdown(cell)).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let _ = writeln!(text, "\n#### {}\n", capitalise(&escape_markdown(&title)));
        text.push_str(&row(&headings));
        let _ = writeln!(text, "|{}", "---:|".repeat(headings.len()));
        rows.iter().for_each(|cells| text.push_str(&row(cells)));
    }
    text
}

/// Formats a text as Markdown code.
fn format_code(text: &str) -> String {
    format!("`{}`", text.replace('`', "'"))
}

/// Escapes the characters of a text that have a meaning in Markdown.
fn escape_markdown(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        if "\\`*_|<>[]#".contains(c) {
            escaped.push('\\');
        }
        escaped.push(c);
    }
    escaped
}

/// Returns the differences as JSON.
fn to_json(
    args: &CompareArgs,
    comparison: &Comparison,
    overridden: &[OverriddenNumbers],
    violations: &[String],
) -> Value {
    let row = |row: &SharedRow| {
        let axis_values: serde_json::Map<String, Value> =
            comparison.keys.iter().cloned().zip(row.key.iter().map(|value| json!(value))).collect();
        json!({
            "rows": row.rows, "place": axis_values, "ratio": row.ratios, "gap_m": row.gaps_m,
            "flip": row.flip, "sensitive": row.is_sensitive,
        })
    };
    let max_rows = usize::from(args.rows);
    let row_list = |rows: Vec<&SharedRow>| rows.into_iter().map(row).collect::<Value>();
    let greatest_changes = |sensitive| {
        let [ratio, gap] = [SharedRow::ratio_deviation, SharedRow::gap_deviation_m]
            .map(|deviation| row_list(comparison.most_deviating(max_rows, sensitive, deviation)));
        json!({ "ratio": ratio, "gap": gap })
    };
    json!({
        "first": args.first.display().to_string(),
        "second": args.second.display().to_string(),
        "differ": !comparison.is_empty(),
        "fail_on": violations,
        "plan": comparison.plan,
        "overridden": overridden.iter().map(|overridden| json!({
            "axis": overridden.axis, "paths": overridden.paths,
        })).collect::<Value>(),
        "matched_by": if comparison.is_matched_by_point { "point" } else { "axes" },
        "rows": {
            "in_both": comparison.shared_rows.len(),
            "over_estimated": comparison.over_estimated_rows,
            "only_in_first": comparison.unmatched_rows[0],
            "only_in_second": comparison.unmatched_rows[1],
            "differing": comparison.shared_rows.iter().filter(|row| row.differs).count(),
        },
        "axes_left_out": comparison.single_valued_axes.iter().map(|(file, name, value)| json!({
            "file": (["first", "second"][*file]), "parameter": name, "value": value,
        })).collect::<Value>(),
        "columns": comparison.changed_columns,
        "columns_only_in": {
            "first": comparison.unmatched_columns[0],
            "second": comparison.unmatched_columns[1],
        },
        "flips": comparison.flips(false).map(row).collect::<Value>(),
        "greatest": greatest_changes(false),
        "sensitive": {
            "flips": comparison.flips(true).map(row).collect::<Value>(),
            "greatest": greatest_changes(true),
        },
        "boundary": comparison.boundary.as_ref().map(|shift| json!({
            "axis": shift.axis,
            "unit": shift.unit,
            "mean": shift.mean_shift_range(),
            "certain": shift.count_certain_shifts(),
            "crossings": shift.crossings.iter().map(|crossing| json!({
                "place": crossing.key_values, "number": crossing.number, "at": crossing.positions,
                "bracket": crossing.brackets,
                "by": crossing.shift_range(),
                "at_least": crossing.certain_shift(),
            })).collect::<Value>(),
            "other_numbers_of_crossings": shift.unmatched_lines.len(),
        })),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markdown_shows_texts_as_they_are() {
        assert_eq!(escape_markdown("ratio_max | <b>"), "ratio\\_max \\| \\<b\\>");
        assert_eq!(format_code("a`b"), "`a'b`");
    }
}

//! `sweep compare A B`: reports the differences between two results.

mod differences;
mod fail_on;
mod overridden;

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::{Value, json};

use super::{Lines as _, quoted, short, span, table};
use crate::config::section::{counted, cut};
use crate::store::refuse_unfinished;
use crate::{Error, Exit, Model, show, tell};
use fail_on::FailOn;
use overridden::{Overridden, overridden};
use sweep_files::{FileKind, Output};
use sweep_plot::capitalise;
use sweep_results::{
    BoundaryShift, ColumnChange, Comparison, Flip, PlanChange, ResultTable, SharedRow, compare,
};

/// Arguments of `sweep compare`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG)]
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
    /// Exit with 4 on such a difference: any, plan, flips, lost, sensitive, rows, ratio=PART,
    /// gap=M, boundary=WIDTH or COLUMN=CHANGE; may be repeated
    #[arg(long, value_name = "WHAT", value_parser = str::parse::<FailOn>)]
    fail_on: Vec<FailOn>,
    /// Maximum number of rows shown of each kind
    #[arg(long, value_name = "N", default_value_t = 5)]
    rows: u16,
}

/// The text that `--help` adds.
const LONG: &str = "\
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
    let files = [&args.first, &args.second];
    files.into_iter().try_for_each(|path| refuse_unfinished(path))?;
    let tables = [ResultTable::open(files[0])?, ResultTable::open(files[1])?];
    let output =
        args.out.as_deref().map(|path| Output::begin(path, FileKind::Differences)).transpose()?;
    let found = compare(&tables[0], &tables[1])?;
    if let Some([given, of]) =
        args.fail_on.iter().find_map(|fail_on| fail_on.unmet_need(&found, &tables))
    {
        return Err(Error::option("--fail-on", given, of));
    }
    if let (Some(output), Some(path)) = (output, &args.out) {
        if !found.has_verdicts {
            let expected = "two maps: other files have no differences row by row";
            return Err(Error::option("--out", path.display(), expected));
        }
        output
            .finish(&differences::table(args, &found, &tables, M::ABOUT.build).into_bytes(path)?)?;
    }
    let broken: Vec<String> =
        args.fail_on.iter().filter_map(|fail_on| fail_on.violation(&found)).collect();
    let overridden = overridden::<M>(&tables, &found);
    if args.json {
        show(&format!("{:#}\n", to_json(args, &found, &overridden, &broken)))?;
    } else if args.markdown {
        show(&markdown(args, &found, &overridden, &broken))?;
    } else {
        let broken = broken.iter().map(|broken| format!("--fail-on: {broken}\n"));
        show(&(text(args, &found, &overridden) + &broken.collect::<String>()))?;
        if let Some(out) = &args.out {
            let out = out.display();
            tell(&format!("wrote {out}: sweep plot {}", quoted(&out.to_string())));
        }
    }
    Ok(if broken.is_empty() { Exit::Done } else { Exit::NotHeld })
}

/// Formats a value of a plan, cut if it is long.
fn brief(value: &Value) -> String {
    match value {
        Value::Null => "absent".to_owned(),
        Value::String(text) => text.clone(),
        Value::Number(number) => number.as_f64().map_or_else(|| number.to_string(), short),
        other => cut(&other.to_string(), 48),
    }
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "null".to_owned(), short)
}

fn verdict(row: &SharedRow, limit_side: usize) -> &'static str {
    // The flip determines the verdict of either side.
    match (row.flip, limit_side) {
        (Flip::Lost, 0) | (Flip::Gained, 1) => "reliable",
        (Flip::Lost, _) | (Flip::Gained, _) => "not",
        _ => "undefined",
    }
}

/// The cells of both files, and the change between them if it is shown.
type ComparedCells = ([String; 2], Option<String>);

/// A table with a title, which every output format shows.
struct TitledTable {
    title: String,
    headings: Vec<String>,
    rows: Vec<Vec<String>>,
}

/// Returns the tables of rows that differ, without empty ones.
fn lists(args: &CompareArgs, found: &Comparison) -> Vec<TitledTable> {
    let most = usize::from(args.rows);
    let mut lists = Vec::new();
    let mut list =
        |title: String, rows: Vec<&SharedRow>, cells: &dyn Fn(&SharedRow) -> ComparedCells| {
            if rows.is_empty() {
                return;
            }
            let whole = |row: &SharedRow| -> Vec<String> {
                let (sides, change) = cells(row);
                row.key.iter().map(|value| short(*value)).chain(sides).chain(change).collect()
            };
            let rows: Vec<_> = rows.into_iter().map(whole).collect();
            let headings = found.keys.iter().map(String::as_str).chain(["A", "B", "change"]);
            let headings = headings.take(rows[0].len()).map(str::to_owned).collect();
            lists.push(TitledTable { title, headings, rows });
        };
    // If results have a lower limit of ratios, the least ratio decides on the verdict too.
    let two_sided = found.columns.iter().any(|column| column.name == "ratio_min");
    let verdict_cell = |row: &SharedRow, side: usize| {
        let ratio = match two_sided {
            true => format!("{} to {}", number(row.least_ratio[side]), number(row.ratio[side])),
            false => number(row.ratio[side]),
        };
        match row.flip {
            Flip::Defined => ratio,
            _ => format!("{ratio} {}", verdict(row, side)),
        }
    };
    for (sensitive, which) in [(false, ""), (true, " of sensitive rows")] {
        let title = format!("verdicts that flipped{which}: {}", found.flips(sensitive).count());
        let rows = found.flips(sensitive).take(most).collect();
        list(title, rows, &|row| ([0, 1].map(|side| verdict_cell(row, side)), None));
    }
    for (sensitive, which) in [(false, ""), (true, " of sensitive rows")] {
        let rows = found.most_deviating(most, sensitive, SharedRow::ratio_deviation);
        list(format!("greatest changes of the ratio{which}"), rows, &|row| {
            let change = row.ratio_quotient().map(|change| 100.0 * (change - 1.0));
            let change = change.map_or_else(|| number(None), |change| format!("{change:+.3} %"));
            (row.ratio.map(number), Some(change))
        });
        let rows = found.most_deviating(most, sensitive, SharedRow::gap_deviation_m);
        list(format!("greatest changes of the least gap{which}, m"), rows, &|row| {
            let sign = if row.gap_difference_m() > Some(0.0) { "+" } else { "" };
            let change = format!("{sign}{}", number(row.gap_difference_m()));
            (row.gap_m.map(number), Some(change))
        });
    }
    lists.extend(args.fail_on.iter().filter_map(|fail_on| column_list(fail_on, found, most)));
    lists
}

/// Returns the table of the greatest changes of a column that `--fail-on` names.
fn column_list(fail_on: &FailOn, found: &Comparison, most: usize) -> Option<TitledTable> {
    let FailOn::Column(name, _) = fail_on else { return None };
    let column = found.columns.iter().find(|column| column.name == *name)?;
    let rows = column.worst.iter().take(most).map(|worst| {
        let [first, second] = worst.values;
        let change = first.zip(second).map(|(first, second)| second - first);
        let sign = if change > Some(0.0) { "+" } else { "" };
        let key = found.shared[worst.row].key.iter().map(|value| short(*value));
        let own = [number(first), number(second), format!("{sign}{}", number(change))];
        key.chain(own).collect()
    });
    let rows: Vec<Vec<String>> = rows.collect();
    let unit = if column.unit.is_empty() { "" } else { ", " };
    let title = format!("greatest changes of {name}{unit}{}", column.unit);
    let headings = found.keys.iter().map(String::as_str).chain(["A", "B", "change"]);
    let headings = headings.map(str::to_owned).collect();
    (!rows.is_empty()).then_some(TitledTable { title, headings, rows })
}

/// Returns the lines of the summary, each with a name: overridden numbers, shared rows, columns,
/// verdicts, the boundary.
fn facts(found: &Comparison, overridden: &[Overridden]) -> Vec<(&'static str, String)> {
    let mut facts = Vec::new();
    for Overridden { axis, paths } in overridden {
        let shown = paths.iter().take(PLAN_SHOWN).map(String::as_str).collect::<Vec<_>>();
        let more = if paths.len() > shown.len() { ", ..." } else { "" };
        let shown = shown.join(", ");
        let told = format!(
            "{shown}{more}: the axis {axis} sets this in both, so that the change does not show"
        );
        facts.push(("overridden", told));
    }
    let [first, second] = found.unmatched_rows;
    let alone = match (first, second) {
        (0, 0) => String::new(),
        _ => format!(", {first} only in A, {second} only in B"),
    };
    facts.push(("rows", format!("{} in both{alone}", found.shared.len())));
    if found.is_matched_by_point {
        let told = "rows are matched by point: the axes have tolerances about other numbers; \
                    tables have the values in A";
        facts.push(("matched", told.to_owned()));
    }
    for (place, name, value) in &found.single_valued_axes {
        let which = ["A", "B"][*place];
        facts.push(("axis", format!("{name} = {} in {which} alone, left out", short(*value))));
    }
    for (names, which) in found.unmatched_columns.iter().zip(["A", "B"]) {
        if !names.is_empty() {
            facts.push(("columns", format!("only in {which}: {}", names.join(", "))));
        }
    }
    if found.has_verdicts {
        let count = |flip: Flip| found.flips(false).filter(|row| row.flip == flip).count();
        let [lost, gained, defined] = [Flip::Lost, Flip::Gained, Flip::Defined].map(count);
        let flips = format!("{lost} lost, {gained} gained, {defined} defined in one file alone");
        let sensitive = found.flips(true).count();
        facts.push(("verdicts", format!("{flips}; of sensitive rows {sensitive}")));
    }
    if let Some([first, second]) = found.over_estimated.filter(|of| *of != [0, 0]) {
        let told = format!(
            "in {first} rows of A, {second} of B the linear model over-estimates: a ratio is below \
             1 / ratio_limit, or ratio_min"
        );
        facts.push(("too high", told));
    }
    if let Some(moved) = &found.boundary {
        facts.push(("boundary", boundary(moved)));
    }
    let differing = found.shared.iter().filter(|row| row.differs).count();
    let told = match differing {
        0 => "every shared cell is the same, bit for bit".to_owned(),
        count => {
            let name = |column: &ColumnChange| format!("{} ({})", column.name, column.rows);
            let names: Vec<String> = found.columns.iter().take(6).map(name).collect();
            let more = if found.columns.len() > 6 { ", ..." } else { "" };
            format!("{count} rows, in {}{more}", names.join(", "))
        }
    };
    facts.push(("differ", told));
    facts
}

/// Describes the shift of the boundary.
fn boundary(moved: &BoundaryShift) -> String {
    let BoundaryShift { axis, unit, crossings, .. } = moved;
    let count = counted(crossings.len(), "crossing");
    let mut told = match (moved.most_shifted(), moved.mean_shift_range()) {
        (Some(_), _) if crossings.iter().all(|crossing| crossing.shift_range() == [0.0; 2]) => {
            format!("{count} along {axis}, none moved")
        }
        (Some(_), _) if crossings.iter().all(|one| one.bracket[0] == one.bracket[1]) => {
            format!("{count} along {axis}, none moved out of its bracket")
        }
        (Some(farthest), Some([least, greatest])) => {
            let place = moved.keys.iter().zip(&farthest.key_values);
            let place: Vec<String> =
                place.map(|(name, value)| format!("{name} {}", short(*value))).collect();
            let [from, to] = farthest.bracket.map(|ends| span(ends, short));
            let certain = moved.count_certain_shifts();
            let place = place.join(", ");
            format!(
                "{count} along {axis}, {certain} moved farther than brackets explain; in the mean \
                 by {least:+.3} to {greatest:+.3} {unit}; farthest at {place}: from within {from} \
                 to within {to}"
            )
        }
        _ => "no crossing in both".to_owned(),
    };
    if !moved.unmatched_lines.is_empty() {
        let lines = counted(moved.unmatched_lines.len(), "line");
        let _ = write!(told, "; other numbers of crossings in {lines}");
    }
    told
}

/// Formats the differences as text.
fn text(args: &CompareArgs, found: &Comparison, overridden: &[Overridden]) -> String {
    let mut text = String::new();
    text.line("A", args.first.display());
    text.line("B", args.second.display());
    if found.is_empty() {
        text.line("differ", "not at all");
        return text;
    }
    for PlanChange { path, first, second } in found.plan.iter().take(PLAN_SHOWN) {
        text.line("plan", format!("{path}: {} -> {}", brief(first), brief(second)));
    }
    if found.plan.len() > PLAN_SHOWN {
        text.line("", format!("and {} more (--json)", found.plan.len() - PLAN_SHOWN));
    }
    for (name, told) in facts(found, overridden) {
        text.line(name, &told);
    }
    for TitledTable { title, headings, rows } in lists(args, found) {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{title}");
        text.push_str(&table(&headings, &rows, "  "));
    }
    text
}

/// The maximum number of differences of the plans that are shown. Basis: half a screen. Doubling it
/// shows twice as many.
const PLAN_SHOWN: usize = 12;

/// Formats the differences as Markdown.
fn markdown(
    args: &CompareArgs,
    found: &Comparison,
    overridden: &[Overridden],
    broken: &[String],
) -> String {
    let names = [&args.first, &args.second].map(|path| code(&path.display().to_string()));
    let mut text = format!("### {} compared with {}\n\n", names[1], names[0]);
    if found.is_empty() {
        text.push_str("They do not differ.\n");
        return text;
    }
    for broken in broken {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "- **`--fail-on`: {broken}**");
    }
    for PlanChange { path, first, second } in found.plan.iter().take(PLAN_SHOWN) {
        let first = code(&brief(first));
        let second = code(&brief(second));
        let _ = writeln!(text, "- plan: {} from {first} to {second}", code(path));
    }
    if found.plan.len() > PLAN_SHOWN {
        let _ = writeln!(text, "- plan: {} more", found.plan.len() - PLAN_SHOWN);
    }
    for (name, told) in facts(found, overridden) {
        let _ = writeln!(text, "- {name}: {}", escaped(&told));
    }
    for TitledTable { title, headings, rows } in lists(args, found) {
        let row = |cells: &[String]| {
            let cells: Vec<String> = cells.iter().map(|cell| escaped(cell)).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let _ = writeln!(text, "\n#### {}\n", capitalise(&escaped(&title)));
        text.push_str(&row(&headings));
        let _ = writeln!(text, "|{}", "---:|".repeat(headings.len()));
        rows.iter().for_each(|cells| text.push_str(&row(cells)));
    }
    text
}

/// Formats a text as Markdown code.
fn code(text: &str) -> String {
    format!("`{}`", text.replace('`', "'"))
}

/// Escapes the characters of a text that have a meaning in Markdown.
fn escaped(text: &str) -> String {
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
    found: &Comparison,
    overridden: &[Overridden],
    broken: &[String],
) -> Value {
    let row = |row: &SharedRow| {
        let place: serde_json::Map<String, Value> =
            found.keys.iter().cloned().zip(row.key.iter().map(|value| json!(value))).collect();
        json!({
            "rows": row.rows, "place": place, "ratio": row.ratio, "gap_m": row.gap_m,
            "flip": row.flip, "sensitive": row.sensitive,
        })
    };
    let most = usize::from(args.rows);
    let all = |rows: Vec<&SharedRow>| rows.into_iter().map(row).collect::<Value>();
    let greatest = |sensitive| {
        let [ratio, gap] = [SharedRow::ratio_deviation, SharedRow::gap_deviation_m]
            .map(|by| all(found.most_deviating(most, sensitive, by)));
        json!({ "ratio": ratio, "gap": gap })
    };
    json!({
        "first": args.first.display().to_string(),
        "second": args.second.display().to_string(),
        "differ": !found.is_empty(),
        "fail_on": broken,
        "plan": found.plan,
        "overridden": overridden.iter().map(|one| json!({
            "axis": one.axis, "paths": one.paths,
        })).collect::<Value>(),
        "matched_by": if found.is_matched_by_point { "point" } else { "axes" },
        "rows": {
            "in_both": found.shared.len(),
            "over_estimated": found.over_estimated,
            "only_in_first": found.unmatched_rows[0],
            "only_in_second": found.unmatched_rows[1],
            "differing": found.shared.iter().filter(|row| row.differs).count(),
        },
        "axes_left_out": found.single_valued_axes.iter().map(|(place, name, value)| json!({
            "file": (["first", "second"][*place]), "parameter": name, "value": value,
        })).collect::<Value>(),
        "columns": found.columns,
        "columns_only_in": {
            "first": found.unmatched_columns[0],
            "second": found.unmatched_columns[1],
        },
        "flips": found.flips(false).map(row).collect::<Value>(),
        "greatest": greatest(false),
        "sensitive": {
            "flips": found.flips(true).map(row).collect::<Value>(),
            "greatest": greatest(true),
        },
        "boundary": found.boundary.as_ref().map(|moved| json!({
            "axis": moved.axis,
            "unit": moved.unit,
            "mean": moved.mean_shift_range(),
            "certain": moved.count_certain_shifts(),
            "crossings": moved.crossings.iter().map(|crossing| json!({
                "place": crossing.key_values, "number": crossing.number, "at": crossing.positions,
                "bracket": crossing.bracket,
                "by": crossing.shift_range(),
                "at_least": crossing.certain_shift(),
            })).collect::<Value>(),
            "other_numbers_of_crossings": moved.unmatched_lines.len(),
        })),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markdown_shows_texts_as_they_are() {
        assert_eq!(escaped("ratio_max | <b>"), "ratio\\_max \\| \\<b\\>");
        assert_eq!(code("a`b"), "`a'b`");
    }
}

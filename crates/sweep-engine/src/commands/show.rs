//! `sweep show FILE`: shows the content of a Parquet file.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::{Value, json};

use super::boundary::describe_limit;
use super::run::{format_counts_at, format_named_values};
use super::{
    Lines as _, conditions, format_cell, format_number, format_range, format_table, shorten,
};
use crate::store::read::{ColumnRange, FileOverview, ResultFile, Tally, read_overview, tally_rows};
use crate::store::{LockHolder, UnfinishedWork, find_unfinished, refuse_unfinished};
use crate::{Error, Exit, show};
use sweep_files::{ParquetFile, key};
use sweep_parameter::Worse;
use sweep_results::{Cell, Condition, ResultTable, ratio_limits, top_rows};

/// The number of rows that are shown without `--top`. Basis: they fit a terminal. Doubling it shows
/// twice as many.
const DEFAULT_SHOWN_ROWS: u16 = 10;

/// The maximum number of lines of one name that are shown. Basis: half of the lines of a terminal.
/// Doubling it shows twice as many.
const MAX_LINES_PER_NAME: usize = 12;

/// Arguments of `sweep show`.
#[derive(Debug, clap::Args)]
pub struct ShowArgs {
    /// A result, trace, modes, stability or boundary file; of an unfinished one the progress is
    /// shown
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Show this many rows, without a summary [default: 10 with --by or --where]
    #[arg(long, value_name = "N")]
    top: Option<u16>,
    /// Sort the rows by this column, the worst value first; a column without a bad direction is
    /// sorted from the greatest [default: file order]
    #[arg(long, value_name = "COLUMN")]
    by: Option<String>,
    /// Sort the rows from the least value
    #[arg(long, requires = "by")]
    ascending: bool,
    /// Sort the rows from the greatest value
    #[arg(long, requires = "by", conflicts_with = "ascending")]
    descending: bool,
    /// Show only rows for which this expression is true (expressions as in `sweep require`)
    #[arg(long = "where", value_name = "EXPRESSION")]
    filter: Option<String>,
    /// Columns of the rows, separated by commas [default: the axes, the verdict, and the columns of
    /// the other options]
    #[arg(long, value_name = "COLUMN,...", value_delimiter = ',')]
    columns: Vec<String>,
    /// Show the unit and range of every column, not only of the metrics
    #[arg(long, conflicts_with_all = ["top", "by", "filter", "columns", "json"])]
    all: bool,
    /// Print the summary or the rows as JSON, with every column
    #[arg(long)]
    json: bool,
}

/// The lines that a model adds to the summary of its files.
pub struct ModelSummary<'a> {
    /// The function that returns lines about a file other than a map, each with a name.
    pub lines: &'a dyn Fn(&ParquetFile) -> Result<Vec<(&'static str, String)>, Error>,
    /// The function that returns whether a column of a map is that of a metric, and is shown.
    pub is_metric_column: fn(&str) -> bool,
}

impl ModelSummary<'_> {
    /// A summary without further lines and metrics.
    pub const NONE: ModelSummary<'static> =
        ModelSummary { lines: &|_| Ok(Vec::new()), is_metric_column: |_| false };

    /// Returns the lines about a file. Of lines with the same name only the first ones are
    /// returned, with a count of the others.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn shortened_lines(
        &self,
        file: &ParquetFile,
    ) -> Result<Vec<(&'static str, String)>, Error> {
        let mut lines = Vec::new();
        for same_name_lines in (self.lines)(file)?.chunk_by(|a, b| a.0 == b.0) {
            lines.extend(same_name_lines.iter().take(MAX_LINES_PER_NAME).cloned());
            if same_name_lines.len() > MAX_LINES_PER_NAME {
                lines
                    .push(("", format!("and {} more", same_name_lines.len() - MAX_LINES_PER_NAME)));
            }
        }
        Ok(lines)
    }
}

/// Shows a file's content in short: for a result its verdicts, extremes and metrics, for any other
/// file its columns and their ranges; or some of its rows.
///
/// # Errors
/// A file that cannot be read, or is not Parquet; a column that it does not have; rows of a result
/// that is not finished.
pub fn run(args: &ShowArgs, model_summary: &ModelSummary<'_>) -> Result<Exit, Error> {
    let shows_rows = args.top.is_some() || args.by.is_some() || args.filter.is_some();
    if shows_rows || !args.columns.is_empty() {
        refuse_unfinished(&args.file)?;
        return show_rows(args);
    }
    if let Some(unfinished_work) = find_unfinished(&args.file)? {
        return show(&if args.json {
            format!("{:#}\n", json!(unfinished_work))
        } else {
            format_progress(&unfinished_work)
        });
    }
    let parquet_file = ParquetFile::open(&args.file)?;
    let overview = read_overview(&parquet_file)?;
    if args.json {
        let mut json = to_json(args, &parquet_file, &overview)?;
        json["lines"] = json!((model_summary.lines)(&parquet_file)?);
        return show(&format!("{json:#}\n"));
    }
    let mut text = String::new();
    text.line("file", args.file.display());
    match &overview.result {
        Some(result) => {
            add_provenance(&mut text, result);
            if parquet_file.is_copy() {
                let writer = parquet_file.created_by().unwrap_or("another program");
                text.line("checked", format!("no: a copy that {writer} wrote"));
            } else if !parquet_file.is_sealed() {
                text.line("checked", "no: it carries no digest, as files of older builds do not");
            }
            let tally = tally_rows(&parquet_file)?;
            let limits = ratio_limits(&result.plan).unwrap_or(f64::NAN.into());
            let extreme_values_by_point = extreme_locations(&parquet_file, result, &tally)?;
            let axis_values = |point| {
                let location =
                    extreme_values_by_point.iter().find(|(extreme, _)| *extreme == point);
                location.map_or(String::new(), |(_, values)| {
                    format_named_values(values.iter().map(|(axis, value)| (axis.as_str(), *value)))
                })
            };
            text.push_str(&format_counts_at(&tally, limits, &axis_values));
        }
        None => {
            text.line("made by", parquet_file.created_by().unwrap_or("unknown"));
            for (name, words) in model_summary.shortened_lines(&parquet_file)? {
                text.line(name, &words);
            }
            if let Some(boundary_settings) = parquet_file.json(key::BOUNDARY) {
                let quantity_name = boundary_settings["quantity"].as_str().unwrap_or("unknown");
                let limit =
                    boundary_settings["limit"].as_f64().map_or("unknown".to_owned(), format_number);
                text.line("boundary", describe_limit(quantity_name, limit));
            }
        }
    }
    add_columns(
        &mut text,
        &overview,
        args.all || overview.result.is_none(),
        model_summary.is_metric_column,
    );
    show(&text)
}

/// Formats the progress of a run or a search that has no result yet.
fn format_progress(unfinished_work: &UnfinishedWork) -> String {
    let mut text = String::new();
    text.line("file", unfinished_work.output.display());
    text.line("state", format!("unfinished: {}", unfinished_work.progress()));
    text.line("name", &unfinished_work.name);
    text.line("kept in", unfinished_work.folder.display());
    for LockHolder { pid, host, shard } in &unfinished_work.running {
        let shard = shard.map_or(String::new(), |shard| format!(", shard {shard}"));
        text.line("running", format!("process {pid} on {host}{shard}"));
    }
    if unfinished_work.running.is_empty() {
        text.line("next", "the command again that began it: it goes on from there");
    }
    text
}

/// Shows some rows of the file.
fn show_rows(args: &ShowArgs) -> Result<Exit, Error> {
    let file = ResultTable::open(&args.file)?;
    let filter = conditions::parse_filter(args.filter.as_ref(), &file)?;
    let columns = shown_columns(args, &file, filter.as_ref());
    let sort_direction = |sort_column| match (args.ascending, args.descending) {
        (true, _) => Worse::Less,
        (_, true) => Worse::Greater,
        _ => file
            .column(sort_column)
            .and_then(|column| column.metadata.worse)
            .unwrap_or(Worse::Greater),
    };
    let sort_column =
        args.by.as_deref().map(|sort_column| (sort_column, sort_direction(sort_column)));
    let max_rows = usize::from(args.top.unwrap_or(DEFAULT_SHOWN_ROWS));
    let column_names: Vec<&str> = columns.iter().map(String::as_str).collect();
    let rows = top_rows(&file, &column_names, filter.as_ref(), sort_column, max_rows)?;
    if args.json {
        let row_to_json = |row: &Vec<Cell>| -> Value {
            columns.iter().zip(row).map(|(name, cell)| (name.as_str(), json!(cell))).collect()
        };
        return show(&format!("{:#}\n", rows.iter().map(row_to_json).collect::<Value>()));
    }
    let rows: Vec<Vec<String>> =
        rows.iter().map(|row| row.iter().map(format_cell).collect()).collect();
    if rows.is_empty() {
        return show("no rows\n");
    }
    show(&format_table(&columns, &rows, ""))
}

/// Returns the columns of the rows to show: those of `--columns`, or else the axes, the verdict
/// with its ratio, and the columns of `--by` and `--where`.
fn shown_columns(args: &ShowArgs, file: &ResultTable, filter: Option<&Condition>) -> Vec<String> {
    if !args.columns.is_empty() {
        return args.columns.clone();
    }
    let key_columns = file.key_columns();
    let verdict_names =
        ["ratio_max", "ratio_max_channel", "reliable", "min_gap_nonlinear_m", "status"];
    let order_columns = args.by.iter().map(String::as_str);
    let filter_columns =
        filter.into_iter().flat_map(|filter| filter.columns.iter().map(String::as_str));
    let verdict_columns = verdict_names.into_iter().filter(|name| file.column(name).is_some());
    let mut columns: Vec<String> = Vec::new();
    for name in
        key_columns.into_iter().chain(verdict_columns).chain(order_columns).chain(filter_columns)
    {
        if !columns.iter().any(|shown| shown == name) {
            columns.push(name.to_owned());
        }
    }
    // Files without key columns or a verdict show all of their columns, and so does JSON.
    if columns.is_empty() || args.json {
        columns = file.columns.iter().map(|column| column.name.clone()).collect();
    }
    columns
}

/// Returns the content of the text as JSON, with the whole plan.
fn to_json(args: &ShowArgs, file: &ParquetFile, overview: &FileOverview) -> Result<Value, Error> {
    let column_to_json = |column_to_json: &ColumnRange| {
        let word_counts = || column_to_json.word_counts.iter().cloned().collect::<Value>();
        json!({
            "name": column_to_json.name,
            "unit": Some(&column_to_json.metadata.unit).filter(|unit| !unit.is_empty()),
            "worse": column_to_json.metadata.worse.map(Worse::name),
            "nulls": column_to_json.null_count,
            "least": column_to_json.range.map(|(least, _)| Cell::Number(least)),
            "greatest": column_to_json.range.map(|(_, greatest)| Cell::Number(greatest)),
            "counts": (!column_to_json.word_counts.is_empty()).then(word_counts),
        })
    };
    let mut json = json!({
        "file": args.file.display().to_string(),
        "rows": overview.row_count,
        "made_by": file.created_by(),
        "is_sealed": file.is_sealed(),
        "columns": overview.columns.iter().map(column_to_json).collect::<Value>(),
        "boundary": file.json(key::BOUNDARY),
        "plan": file.json(key::PLAN),
    });
    if let Some(result) = &overview.result {
        let tally = tally_rows(file)?;
        let locations = extreme_locations(file, result, &tally)?;
        let locations = locations
            .into_iter()
            .map(|(point, values)| (point.to_string(), values.into_iter().collect::<Value>()));
        json["version"] = json!(result.version);
        json["numerics"] = json!(result.numerics);
        json["plan_hash"] = json!(result.plan_hash);
        json["summary"] = json!(tally);
        json["points"] = locations.collect();
    }
    Ok(json)
}

/// Reads the values of the axes at the points of the extremes.
fn extreme_locations(
    file: &ParquetFile,
    result: &ResultFile,
    tally: &Tally,
) -> Result<Vec<(u64, Vec<(String, f64)>)>, Error> {
    let axes: Vec<&str> =
        plan_axes(&result.plan).iter().filter_map(|axis| axis["parameter"].as_str()).collect();
    let worst_of_columns = tally.extremes.iter().filter_map(|column| column.worst_value.as_ref());
    let extreme_points: Vec<u64> =
        tally.greatest_ratio.iter().chain(worst_of_columns).map(|extreme| extreme.point).collect();
    let mut locations = Vec::new();
    file.each_row(&axes, |row| {
        if extreme_points.contains(&row.index()) {
            let values =
                axes.iter().enumerate().map(|(k, axis)| ((*axis).to_owned(), row.value(k)));
            locations.push((row.index(), values.collect()));
        }
        Ok::<(), Error>(())
    })?;
    Ok(locations)
}

fn add_provenance(text: &mut String, result: &ResultFile) {
    let plan = &result.plan;
    text.line("name", plan["name"].as_str().unwrap_or_default());
    let build = crate::build::words(&result.version, result.numerics);
    text.line("made by", format!("{build}, plan {}", &result.plan_hash));
    let plan_sections =
        [("spin", "spin"), ("values", "parameters"), ("time", "time"), ("method", "integrator")];
    for (name, key) in plan_sections.into_iter().filter(|(_, key)| !plan[*key].is_null()) {
        text.line(name, format_json_value(&plan[key]));
    }
    if let Some(criterion) = plan["reliability"]["criterion"].as_str() {
        text.line("criterion", criterion);
    }
    if let Some(design) = plan.get("design") {
        text.line("design", format_json_value(design));
    }
    for axis in plan_axes(plan) {
        let name = axis["parameter"].as_str().unwrap_or_default();
        // The axes of a list are its columns, whose ranges are listed with the columns.
        let values_text = ["range", "values", "distribution"].iter().find_map(|key| axis.get(key));
        let values_text = values_text.map(format_json_value);
        let values_text =
            values_text.map_or(String::new(), |values_text| format!(": {values_text}"));
        text.line("axis", format!("{name}{values_text}"));
    }
    if let Some(set_constants) = plan["set"].as_object() {
        let assignments = set_constants
            .iter()
            .map(|(name, value)| format!("{name} = {}", format_json_value(value)));
        text.line("--set", assignments.collect::<Vec<_>>().join(", "));
    }
}

/// Formats a JSON value on one line, without quotes and brackets.
fn format_json_value(value: &Value) -> String {
    let join_parts = |parts: Vec<String>| parts.join(", ");
    match value {
        Value::Object(map) => join_parts(
            map.iter().map(|(key, value)| format!("{key} {}", format_json_value(value))).collect(),
        ),
        Value::Array(values) if values.len() > 12 => {
            let first_values = join_parts(values.iter().take(12).map(format_json_value).collect());
            format!("{first_values}, ... ({} values)", values.len())
        }
        Value::Array(values) => join_parts(values.iter().map(format_json_value).collect()),
        Value::String(text) => text.clone(),
        Value::Number(number) => number.as_f64().map_or_else(|| number.to_string(), format_number),
        other => other.to_string(),
    }
}

fn plan_axes(plan: &Value) -> &[Value] {
    plan["axis"].as_array().map_or(&[], Vec::as_slice)
}

/// Adds lines about columns with their units and ranges: all columns, or those of metrics and the
/// number of others.
fn add_columns(
    text: &mut String,
    file: &FileOverview,
    shows_all: bool,
    is_shown: fn(&str) -> bool,
) {
    text.line("rows", file.row_count);
    let shown_columns: Vec<&ColumnRange> =
        file.columns.iter().filter(|column| shows_all || is_shown(&column.name)).collect();
    let name_width = shown_columns.iter().map(|column| column.name.len()).max().unwrap_or(0);
    for column in &shown_columns {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "    {:name_width$}  {}", column.name, describe_range(column));
    }
    let hidden_count = file.columns.len() - shown_columns.len();
    if hidden_count > 0 {
        text.line("columns", format!("{hidden_count} more, shown by --all"));
    }
}

fn describe_range(column: &ColumnRange) -> String {
    let mut description_parts = Vec::new();
    if let Some((least, greatest)) = column.range {
        let range = format_range([least, greatest], format_number);
        description_parts.push(match column.metadata.shown_unit() {
            "" => range,
            unit => format!("{range} {unit}"),
        });
    }
    let names = column.word_counts.iter();
    description_parts.extend(names.map(|(name, count)| format!("{count} {}", shorten(name))));
    if column.null_count > 0 {
        description_parts.push(format!("{} null", column.null_count));
    }
    description_parts.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_values_are_shown_without_quotes_and_brackets() {
        let spin = serde_json::json!({ "profile": "ramp", "peak": 350.0 });
        assert_eq!(format_json_value(&spin), "peak 350, profile ramp");
        assert_eq!(format_json_value(&serde_json::json!([1, 2.5])), "1, 2.5");
        let long_list: Vec<u32> = (0..40).collect();
        assert!(
            format_json_value(&serde_json::json!(long_list)).ends_with("10, 11, ... (40 values)")
        );
    }
}

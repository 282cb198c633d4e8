//! `sweep report RESULT [FILE ...]`: writes a page to print with the verdicts of a result.

use std::path::{Path, PathBuf};

use super::show::ModelSummary;
use super::{conditions, format_cell, format_number};
use crate::columns::MODEL_NAMES;
use crate::store::read::{Tally, tally_rows};
use crate::store::refuse_unfinished;
use crate::{Error, Exit, GridInput, Model, Plan, tell};
use sweep_files::{FileKind, Output, ParquetFile, key};
use sweep_parameter::RatioLimits;
use sweep_plot::{
    Figures, describe_as_html, escape, format_significant, html_table, name_in_words,
    printable_page, quantity_in_words,
};
use sweep_results::{Cell, Column, ResultTable, check_condition, ratio_limits, top_rows};

/// Arguments of `sweep report`.
#[derive(Debug, clap::Args)]
pub struct ReportArgs {
    /// A result of `sweep run`
    #[arg(value_name = "RESULT")]
    result: PathBuf,
    /// Further files of this program, each shown with its figure
    #[arg(value_name = "FILE")]
    further: Vec<PathBuf>,
    /// The page [default: RESULT with the ending .report.html]
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// The question that the page answers
    #[arg(long, value_name = "TEXT", default_value = "Where can the linear model be trusted?")]
    question: String,
    /// Condition on the result, as in `sweep require`; may be repeated
    #[arg(long = "require", value_name = "EXPRESSION")]
    requirements: Vec<String>,
}

/// The resonances of a plan's model at the middle of every axis: motion, speed with its unit, and
/// damping ratio of each.
pub type Resonances<M> = dyn Fn(&Plan<M>) -> Vec<[String; 3]>;

/// Writes the page.
///
/// # Errors
/// Files that cannot be read or drawn, mistakes in the requirements, and a page that cannot be
/// written.
pub fn run<M: Model>(
    args: &ReportArgs,
    model_summary: &ModelSummary<'_>,
    resonances: &Resonances<M>,
    model: &dyn Figures,
) -> Result<Exit, Error> {
    let output = args.out.clone().unwrap_or_else(|| args.result.with_extension("report.html"));
    if let Some(path) = args.further.iter().find(|path| is_expression(path)) {
        let expectation = "a file; each expression needs a `--require` of its own";
        return Err(Error::option("FILE", path.display(), expectation));
    }
    refuse_unfinished(&args.result)?;
    let file = ResultTable::open(&args.result)?;
    let page_output = Output::begin(&output, FileKind::Html)?;
    if file.file().kind() != Some(FileKind::Map) {
        let expectation = format!("a {}; other files go behind it", FileKind::Map.name());
        return Err(Error::option("RESULT", args.result.display(), expectation));
    }
    let requirements = conditions::parse_conditions("--require", &args.requirements, &file)?;
    let (picture, description) = describe_as_html(&args.result, model)?;
    let plan = file.plan.clone().unwrap_or_default();
    let name = plan["name"].as_str().unwrap_or_default();

    let question = escape(&args.question);
    let mut body = format!("<header><h1>{question}</h1><p>{}</p></header>\n", escape(name));
    let tally = tally_rows(file.file())?;
    let limits = ratio_limits(&plan);
    // Rows without a verdict count on neither side, as in share().
    let points_with_verdict = tally.points.saturating_sub(tally.undefined);
    let reliable_percent = 100.0 * tally.reliable as f64 / (points_with_verdict as f64).max(1.0);
    let Tally { reliable, points, sensitive, undefined, over_estimated, .. } = &tally;
    let range_text = limits.map_or_else(String::new, describe_range);
    let describe_over_estimates = |limits: RatioLimits| {
        let limit_text = format_number(limits.over_estimate_limit());
        format!(
            " At {over_estimated}, the linear model over-estimates: a ratio is below {limit_text}."
        )
    };
    let over_estimate_note =
        limits.filter(|_| *over_estimated > 0).map_or_else(String::new, describe_over_estimates);
    body += &format!(
        "<p class=\"share\">{reliable_percent:.1} %</p>\n<p>{reliable} of {points_with_verdict} \
         points with a verdict are reliable: every ratio of the nonlinear model to the linear one \
         is {range_text}. Of all {points} points, {sensitive} are chaotic, and {undefined} have no \
         verdict.{over_estimate_note}</p>\n"
    );
    let headings = ["", "worst", "limit", "at"];
    body += &html_table("The worst of it", &headings, &worst_value_rows(&file)?);
    let mut do_all_hold = true;
    let mut requirement_rows = Vec::new();
    for condition in &requirements {
        let condition_check = check_condition(&file, condition, None, false, 1)?;
        do_all_hold &= condition_check.holds;
        let aggregate_values: Vec<String> =
            condition_check.aggregate_values.iter().map(format_cell).collect();
        let violating_rows = condition_check.failing_rows + condition_check.undefined_rows;
        let outcome = match condition_check.is_by_row {
            true => format!("{violating_rows} of {} rows break it", condition_check.rows),
            false => aggregate_values.join(", "),
        };
        let verdict_text = if condition_check.holds { "holds" } else { "FAILS" };
        if !condition_check.holds {
            tell(&format!("FAILS  {}: {outcome}", condition_check.expression));
        }
        requirement_rows.push(vec![condition_check.expression, outcome, verdict_text.to_owned()]);
    }
    body += &html_table("What is required", &["", "found", ""], &requirement_rows);
    body += &format!("<figure>{picture}</figure>\n");
    for path in &args.further {
        let further_file = ParquetFile::open(path)?;
        let (picture, _) = describe_as_html(path, model)?;
        let summary_lines = model_summary.shortened_lines(&further_file)?;
        let summary_lines: Vec<_> =
            summary_lines.into_iter().map(|(name, text)| vec![name.to_owned(), text]).collect();
        let file_stem = path.file_stem().unwrap_or_default().to_string_lossy();
        body += &html_table(&file_stem, &["", ""], &summary_lines);
        body += &format!("<figure>{picture}</figure>\n");
    }
    let loaded_plan = GridInput::<M>::from_plan(name, &plan).load();
    if let Ok(loaded_plan) = &loaded_plan {
        let resonance_rows: Vec<_> = resonances(loaded_plan).into_iter().map(Vec::from).collect();
        let headings = ["motion", "resonance", "damping ratio"];
        let middle_values: Vec<_> = loaded_plan
            .axes
            .iter()
            .map(|axis| Cell::Number(axis.values.interpolate(0.5)))
            .collect();
        let title = format!("Resonances at {}", format_axis_values(&file, &middle_values));
        body += &html_table(title.trim_end_matches(" at "), &headings, &resonance_rows);
    }
    body += &description;
    // A result does not have the sources of its numbers.
    body += "<p>Where each number is from: sweep parameters, with the grid file.</p>\n";
    let file_hashes = [key::PLAN_HASH, key::VERSION, key::NUMERICS, key::DIGEST].into_iter();
    let file_hashes = file_hashes.filter_map(|key| Some((key, file.file().value(key)?)));
    let file_hashes: Vec<String> =
        file_hashes.map(|(key, value)| format!("{key} {value}")).collect();
    let path = escape(&args.result.display().to_string());
    let file_hashes = escape(&file_hashes.join(", "));
    body += "<details><summary>File and hashes</summary>";
    body += &format!("<p>{path}</p><p>{file_hashes}</p></details>\n");
    page_output.finish(printable_page(&args.question, &body).as_bytes())?;
    tell(&format!("wrote {}", output.display()));
    Ok(if do_all_hold { Exit::Done } else { Exit::ConditionViolated })
}

/// Returns whether an argument looks like an expression and is not a file.
fn is_expression(path: &Path) -> bool {
    let is_operator = |c: char| "<>=()".contains(c);
    !path.exists() && path.to_string_lossy().contains(is_operator)
}

/// Describes the range of reliable ratios.
fn describe_range(limits: RatioLimits) -> String {
    let upper_text = format_number(limits.upper);
    limits.lower.map_or_else(
        || format!("below {upper_text}"),
        |lower| format!("between {} and {upper_text}", format_number(lower)),
    )
}

/// Returns the worst value, its limit and its point for every column that has a worse side, except
/// the columns of the linear model, and those of numbered elements, whose extremes are in other
/// columns.
fn worst_value_rows(file: &ResultTable) -> Result<Vec<Vec<String>>, Error> {
    let axes = file.axes();
    let mut table_rows = Vec::new();
    for column in &file.columns {
        let name = column.name.as_str();
        let is_numbered =
            name.split('_').nth(1).is_some_and(|word| word.chars().all(|c| c.is_ascii_digit()));
        let is_shown = !is_numbered && name.split('_').all(|word| word != MODEL_NAMES[1]);
        let Some(worse) = column.metadata.worse.filter(|_| is_shown) else { continue };
        let columns: Vec<&str> = [name].into_iter().chain(axes.iter().copied()).collect();
        let rows = top_rows(file, &columns, None, Some((name, worse)), 1)?;
        let Some([value, axis_cells @ ..]) = rows.first().map(Vec::as_slice) else { continue };
        let Cell::Number(number) = value else { continue };
        let format_value = |value: f64| join_unit(format_significant(value, 4), column.unit());
        table_rows.push(vec![
            quantity_in_words(name),
            format_value(*number),
            column.metadata.limit.map_or_else(String::new, format_value),
            format_axis_values(file, axis_cells),
        ]);
    }
    Ok(table_rows)
}

/// Formats the values of the axes.
fn format_axis_values(file: &ResultTable, axis_cells: &[Cell]) -> String {
    let unit_of_axis = |name: &str| file.column(name).map_or("", Column::unit);
    let axes = file.axes().into_iter().zip(axis_cells);
    let value_texts = axes.map(|(axis, cell)| {
        format!("{} {}", name_in_words(axis), join_unit(format_cell(cell), unit_of_axis(axis)))
    });
    value_texts.collect::<Vec<_>>().join(", ")
}

/// Joins a number and its unit by a space at which no line breaks.
fn join_unit(text: String, unit: &str) -> String {
    match unit {
        "" => text,
        unit => format!("{text} {unit}").replace(' ', "\u{a0}"),
    }
}

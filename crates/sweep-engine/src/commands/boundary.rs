//! `sweep boundary GRID.toml`: traces the curve on which a quantity is at its limit.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use super::grid::resume_command;
use super::{GridArgs, Lines as _, format_number, install_interrupt};
use crate::boundary::quantity::traceable_columns;
use crate::boundary::{
    BoundaryOptions, BoundaryRow, BoundaryTask, SideChangeKind, TracedBoundary, trace_boundary,
};
use crate::config::section::format_count;
use crate::evaluator::{CachedEvaluator, SearchStop};
use crate::store::{DeclaredColumn, OpenOutcome, Trials};
use crate::{
    Error, Execution, ExecutionArgs, Exit, Model, Plan, Progress, format_duration, show, tell,
};
use sweep_files::{FileKind, Output};
use sweep_parameter::Worse;
use sweep_plot::label;

/// Arguments of `sweep boundary`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG_HELP)]
pub struct BoundaryArgs {
    /// The grid: its first axis gives the rows, its second the range that is searched
    #[command(flatten)]
    pub grid: GridArgs,
    /// Boundary file [default: results/NAME-boundary.parquet]
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// The quantity, its limit, and the search.
    #[command(flatten)]
    pub options: BoundaryOptions,
    /// Threads and progress.
    #[command(flatten)]
    pub execution: ExecutionArgs,
    /// Start over, even if the boundary exists or the search of another plan has started
    #[arg(long)]
    pub fresh: bool,
}

/// The text that `--help` adds.
const LONG_HELP: &str = "\
For each value of the first axis, the file has the crossings of the limit along the second axis, \
each with its bracket. If there is no crossing, or the quantity jumps over its limit, the file \
says so and has no number. The range of the search is from the least to the greatest value of the \
second axis. Further axes give one curve for every combination of their values.

The file is a pure function of its input, whatever the number of threads and interruptions. An \
interrupted search leaves its evaluations in FILE.partial, and the same command continues from \
there.";

/// Traces the boundary of a grid.
///
/// # Errors
/// Mistakes in the grid file, a plan without a range to search, and errors of evaluating points or
/// writing the file.
pub fn run<M: Model>(args: &BoundaryArgs) -> Result<Exit, Error> {
    let plan: Plan<M> = args.grid.load()?;
    if args.options.quantity.is_empty() {
        return show(&list_columns(&plan));
    }
    let task = BoundaryTask::new(&plan, &args.options)?;
    let default_path = || PathBuf::from(format!("results/{}-boundary.parquet", plan.name));
    let output = args.out.clone().unwrap_or_else(default_path);
    let output_file = Output::begin(&output, FileKind::Boundary)?;
    let interrupt = install_interrupt()?;
    let mut trials = match Trials::open(&output, &task.job(), task.trial_columns(), args.fresh)? {
        OpenOutcome::Open(trials) => trials,
        OpenOutcome::Finished(()) => {
            let finished_note = "the boundary is there already (--fresh traces it again)";
            return Ok(print_summary(format!("{}: {finished_note}\n", plan.name), &output));
        }
    };
    trials.take_notes().iter().for_each(|note| tell(note));
    let stored_points = trials.trial_count() as u64;
    if stored_points > 0 {
        tell(&format!("going on: {} there", format_count(stored_points as usize, "point")));
    }
    let start_time = Instant::now();
    let execution = args.execution.with_interrupt(&interrupt);
    let (boundary, trials) = search(&task, Some(trials), execution)?;
    let Some(boundary) = boundary else {
        let stored_points = format_count(trials.map_or(0, |trials| trials.trial_count()), "point");
        let wall_time = format_duration(start_time.elapsed().as_secs_f64());
        let mut text =
            format!("{}: interrupted with {stored_points} kept, after {wall_time}\n", plan.name);
        text.line("go on", resume_command());
        tell(text.trim_end());
        return Ok(Exit::from_signal(interrupt.signal()));
    };
    output_file.finish(&task.table(&boundary).into_bytes(&output)?)?;
    if let Some(note) = trials.and_then(Trials::complete) {
        tell(&note);
    }
    let text = format_summary(&task, &boundary, start_time.elapsed().as_secs_f64());
    Ok(print_summary(text, &output))
}

/// Lists every column whose limit can be traced, with unit, worse side, limit and description.
fn list_columns<M: Model>(plan: &Plan<M>) -> String {
    let columns = traceable_columns(plan);
    let name_width = columns.iter().map(|(column, _)| column.name.len()).max().unwrap_or(0);
    let format_row = |(column, _): &(DeclaredColumn, Plan<M>)| {
        let DeclaredColumn { name, metadata, .. } = column;
        let unit = &metadata.unit;
        let worse_side = metadata.worse.map_or("", Worse::name);
        let limit = metadata.limit.map_or_else(|| "--limit".to_owned(), format_number);
        let description = metadata.description.split(';').next().unwrap_or_default();
        format!(
            "{name:name_width$}  {unit:>4}  worse the {worse_side:7}  limit \
             {limit:7}  {description}\n"
        )
    };
    columns.iter().map(format_row).collect()
}

/// Prints a summary, with the file and the command that draws it.
fn print_summary(mut text: String, output: &Path) -> Exit {
    text.line("file", output.display());
    text.suggest_command("plot", output);
    tell(text.trim_end());
    Exit::Done
}

/// Formats the limit that is traced: a quantity's, or a condition as the user typed it.
pub(super) fn describe_limit(quantity: &str, limit: impl Display) -> String {
    match label::condition(quantity) {
        Some(condition) => format!("the limit of {condition}"),
        None => format!("{quantity} = {limit}"),
    }
}

fn format_summary<M: Model>(
    task: &BoundaryTask<M>,
    boundary: &TracedBoundary,
    wall_s: f64,
) -> String {
    let BoundaryTask { plan, quantity, range, .. } = task;
    let grid_points: f64 = plan.axes.iter().map(|axis| axis.values.len() as f64).product();
    let mut text = format!(
        "{}: {} traced with {} (the grid has {grid_points}) in {}, {}\n",
        plan.name,
        describe_limit(&quantity.name, quantity.limit),
        format_count(boundary.trial_count, "point"),
        format_count(boundary.batch_count, "round"),
        format_duration(wall_s)
    );
    let all_rows = || boundary.rows_by_curve.iter().flatten();
    let count_kind = |row: &BoundaryRow, kind| {
        row.side_changes.iter().filter(|side_change| side_change.kind == kind).count()
    };
    let change_counts = SideChangeKind::ALL.into_iter().filter_map(|kind| {
        let count: usize = all_rows().map(|row| count_kind(row, kind)).sum();
        let [noun, qualifier] = noun_and_qualifier(kind);
        (count > 0).then(|| format_count(count, noun) + qualifier)
    });
    text.line("found", change_counts.collect::<Vec<_>>().join(", "));
    let folded_values =
        all_rows().filter(|row| count_kind(row, SideChangeKind::Crossing) > 1).count();
    if folded_values > 0 {
        let value_count = format_count(folded_values, "value");
        text.line("folds", format!("several crossings at {value_count} of the first axis"));
    }
    let brackets =
        all_rows().flat_map(|row| &row.side_changes).filter_map(|side_change| side_change.bracket);
    let bracket_width = |[low, high]: [f64; 2]| match range.is_second_log {
        true => (high / low).ln(),
        false => high - low,
    };
    if let Some(widest) = brackets.map(bracket_width).reduce(f64::max) {
        let unit = match range.is_second_log {
            true => "of its value",
            false => plan.axes.get(1).map_or("", |axis| axis.parameter.unit),
        };
        let widest = format_number(widest);
        let tolerance = format_number(range.tolerance);
        text.line("brackets", format!("at most {widest} {unit} wide (tolerance: {tolerance})"));
    }
    let cell_sizes = task.max_cell_size().into_iter().zip(&plan.axes);
    let cell_size_text: Vec<String> =
        cell_sizes.map(|(size, axis)| format!("{size:.3} {}", axis.parameter.unit)).collect();
    let cell_size_text = cell_size_text.join(" by ");
    let island_note =
        format!("of {cell_size_text} or more are found; smaller ones may be missed (--lattice)");
    text.line("islands", island_note);
    text
}

/// Returns the noun for changes of side of this kind, and the words that follow the noun.
const fn noun_and_qualifier(kind: SideChangeKind) -> [&'static str; 2] {
    match kind {
        SideChangeKind::Crossing => ["crossing", ""],
        SideChangeKind::Jump => ["jump", ""],
        SideChangeKind::Undefined => ["edge", " of undefined points"],
        SideChangeKind::AllReliable => ["line", " within the limit throughout"],
        SideChangeKind::AllUnreliable => ["line", " beyond the limit throughout"],
        SideChangeKind::AllUndefined => ["line", " undefined throughout"],
    }
}

/// Traces the boundary with the stored trials, if there are any, and returns the curves and the
/// trials, including new ones. The curves are `None` after an interrupt.
///
/// # Errors
/// Threads that cannot be started, a value of `SWEEP_SIMD` that this machine does not support, and
/// trials that cannot be stored.
pub fn search<M: Model>(
    task: &BoundaryTask<M>,
    trials: Option<Trials>,
    execution: Execution<'_>,
) -> Result<(Option<TracedBoundary>, Option<Trials>), Error> {
    let stored_points = trials.as_ref().map_or(0, |trials| trials.trial_count() as u64);
    let row_count = (task.first_values.len() * task.curve_count) as u64;
    let rows_done = AtomicU64::new(0);
    let progress = Progress::for_search(execution.progress, row_count, "rows", stored_points);
    let show_points = |points| progress.show_search(rows_done.load(Ordering::Relaxed), points);
    let threads = execution.threads()?;
    let engine = M::engine(&task.plan, task.column_name())?;
    let evaluator =
        CachedEvaluator::new(engine, threads, execution.interrupt, trials, &show_points)?;
    let mut record_rows_done = |row_count| rows_done.store(row_count as u64, Ordering::Relaxed);
    let distances = task.distance_evaluator(&evaluator);
    let boundary = trace_boundary(
        &distances,
        &task.first_values,
        task.curve_count,
        &task.range,
        &mut record_rows_done,
    );
    drop(distances);
    progress.finish();
    Ok((SearchStop::interrupted_to_none(boundary)?, evaluator.into_cache()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_condition_is_told_as_it_was_typed() {
        assert_eq!(describe_limit("ratio_max", 2.0), "ratio_max = 2");
        let margin_text = "margin(ratio_max < 2 and growth_per_s < 0)";
        assert_eq!(
            describe_limit(margin_text, 0.0),
            "the limit of ratio_max < 2 and growth_per_s < 0"
        );
    }
}

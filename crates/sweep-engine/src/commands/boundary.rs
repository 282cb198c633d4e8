//! `sweep boundary GRID.toml`: traces the curve on which a quantity is at its limit.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use super::grid::typed;
use super::{GridArgs, Lines as _, installed, short};
use crate::boundary::quantity::offered;
use crate::boundary::{BoundaryOptions, BoundaryTask, EdgeKind, Traced, TracedRow, trace};
use crate::config::section::counted;
use crate::evaluator::{CachedEvaluator, Stopped};
use crate::store::{DeclaredColumn, Opened, Trials};
use crate::{Effort, EffortArgs, Error, Exit, Model, Plan, Progress, duration, show, tell};
use sweep_files::{FileKind, Output};
use sweep_parameter::Worse;
use sweep_plot::label;

/// Arguments of `sweep boundary`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG)]
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
    pub effort: EffortArgs,
    /// Start over, even if the boundary exists or the search of another plan has started
    #[arg(long)]
    pub fresh: bool,
}

/// The text that `--help` adds.
const LONG: &str = "\
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
        return show(&listing(&plan));
    }
    let task = BoundaryTask::new(&plan, &args.options)?;
    let default = || PathBuf::from(format!("results/{}-boundary.parquet", plan.name));
    let output = args.out.clone().unwrap_or_else(default);
    let file = Output::begin(&output, FileKind::Boundary)?;
    let interrupt = installed()?;
    let mut trials = match Trials::open(&output, &task.job(), task.trial_columns(), args.fresh)? {
        Opened::Open(trials) => trials,
        Opened::Finished(()) => {
            let there = "the boundary is there already (--fresh traces it again)";
            return Ok(print_summary(format!("{}: {there}\n", plan.name), &output));
        }
    };
    trials.take_notes().iter().for_each(|note| tell(note));
    let there = trials.count() as u64;
    if there > 0 {
        tell(&format!("going on: {} there", counted(there as usize, "point")));
    }
    let began = Instant::now();
    let effort = args.effort.with(&interrupt);
    let (found, trials) = search(&task, Some(trials), effort)?;
    let Some(found) = found else {
        let kept = counted(trials.map_or(0, |trials| trials.count()), "point");
        let wall = duration(began.elapsed().as_secs_f64());
        let mut text = format!("{}: interrupted with {kept} kept, after {wall}\n", plan.name);
        text.line("go on", typed());
        tell(text.trim_end());
        return Ok(Exit::interrupted(interrupt.signal()));
    };
    file.finish(&task.table(&found).into_bytes(&output)?)?;
    if let Some(note) = trials.and_then(Trials::complete) {
        tell(&note);
    }
    let text = summary(&task, &found, began.elapsed().as_secs_f64());
    Ok(print_summary(text, &output))
}

/// Lists every column whose limit can be traced, with unit, worse side, limit and description.
fn listing<M: Model>(plan: &Plan<M>) -> String {
    let columns = offered(plan);
    let width = columns.iter().map(|(column, _)| column.name.len()).max().unwrap_or(0);
    let row = |(column, _): &(DeclaredColumn, Plan<M>)| {
        let side = column.worse.map_or("", Worse::name);
        let limit = column.limit.map_or_else(|| "--limit".to_owned(), |of| short(of.value));
        let meaning = column.description.split(';').next().unwrap_or_default();
        let DeclaredColumn { name, unit, .. } = column;
        format!("{name:width$}  {unit:>4}  worse the {side:7}  limit {limit:7}  {meaning}\n")
    };
    columns.iter().map(row).collect()
}

/// Prints a summary, with the file and the command that draws it.
fn print_summary(mut text: String, output: &Path) -> Exit {
    text.line("file", output.display());
    text.next("plot", output);
    tell(text.trim_end());
    Exit::Done
}

/// Formats the limit that is traced: a quantity's, or a condition as the user typed it.
pub(super) fn limit_in_words(quantity: &str, limit: impl Display) -> String {
    match label::condition(quantity) {
        Some(condition) => format!("the limit of {condition}"),
        None => format!("{quantity} = {limit}"),
    }
}

fn summary<M: Model>(task: &BoundaryTask<M>, traced: &Traced, wall_s: f64) -> String {
    let BoundaryTask { plan, quantity, search, .. } = task;
    let grid: f64 = plan.axes.iter().map(|axis| axis.values.len() as f64).product();
    let mut text = format!(
        "{}: {} traced with {} (the grid has {grid}) in {}, {}\n",
        plan.name,
        limit_in_words(&quantity.name, quantity.limit),
        counted(traced.trials, "point"),
        counted(traced.rounds, "round"),
        duration(wall_s)
    );
    let rows = || traced.curves.iter().flatten();
    let count_kind =
        |row: &TracedRow, kind| row.edges.iter().filter(|edge| edge.kind == kind).count();
    let found = EdgeKind::ALL.into_iter().filter_map(|kind| {
        let count: usize = rows().map(|row| count_kind(row, kind)).sum();
        let [noun, rest] = in_words(kind);
        (count > 0).then(|| counted(count, noun) + rest)
    });
    text.line("found", found.collect::<Vec<_>>().join(", "));
    let several = rows().filter(|row| count_kind(row, EdgeKind::Crossing) > 1).count();
    if several > 0 {
        let values = counted(several, "value");
        text.line("folds", format!("several crossings at {values} of the first axis"));
    }
    let brackets = rows().flat_map(|row| &row.edges).filter_map(|edge| edge.bracket);
    let width = |[low, high]: [f64; 2]| match search.second_log {
        true => (high / low).ln(),
        false => high - low,
    };
    if let Some(widest) = brackets.map(width).reduce(f64::max) {
        let unit = match search.second_log {
            true => "of its value",
            false => plan.axes.get(1).map_or("", |axis| axis.parameter.unit),
        };
        let widest = short(widest);
        let tolerance = short(search.tolerance);
        text.line("brackets", format!("at most {widest} {unit} wide (tolerance: {tolerance})"));
    }
    let cell = task.cell().into_iter().zip(&plan.axes);
    let cell: Vec<String> =
        cell.map(|(size, axis)| format!("{size:.3} {}", axis.parameter.unit)).collect();
    let cell = cell.join(" by ");
    let found = format!("of {cell} or more are found; smaller ones may be missed (--lattice)");
    text.line("islands", found);
    text
}

/// Returns an edge of this kind in words: a noun, and the words that follow it.
const fn in_words(kind: EdgeKind) -> [&'static str; 2] {
    match kind {
        EdgeKind::Crossing => ["crossing", ""],
        EdgeKind::Jump => ["jump", ""],
        EdgeKind::Undefined => ["edge", " of undefined points"],
        EdgeKind::NoneReliable => ["line", " within the limit throughout"],
        EdgeKind::NoneUnreliable => ["line", " beyond the limit throughout"],
        EdgeKind::NoneUndefined => ["line", " undefined throughout"],
    }
}

/// Traces the boundary. Stored trials are used and extended, if there are any, and returned. The
/// curves are `None` after an interrupt.
///
/// # Errors
/// Threads that cannot be started, a value of `SWEEP_SIMD` that this machine does not support, and
/// trials that cannot be stored.
pub fn search<M: Model>(
    task: &BoundaryTask<M>,
    trials: Option<Trials>,
    effort: Effort<'_>,
) -> Result<(Option<Traced>, Option<Trials>), Error> {
    let there = trials.as_ref().map_or(0, |trials| trials.count() as u64);
    let rows = (task.firsts.len() * task.curves) as u64;
    let rows_done = AtomicU64::new(0);
    let progress = Progress::for_search(effort.progress, rows, "rows", there);
    let shown = |points| progress.show_search(rows_done.load(Ordering::Relaxed), points);
    let threads = effort.threads()?;
    let engine = M::engine(&task.plan, task.column())?;
    let asking = CachedEvaluator::new(engine, threads, effort.interrupt, trials, &shown)?;
    let mut standing = |rows| rows_done.store(rows as u64, Ordering::Relaxed);
    let distances = task.distances(&asking);
    let found = trace(&distances, &task.firsts, task.curves, &task.search, &mut standing);
    drop(distances);
    progress.finish();
    Ok((Stopped::interrupted_to_none(found)?, asking.into_cache()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_condition_is_told_as_it_was_typed() {
        assert_eq!(limit_in_words("ratio_max", 2.0), "ratio_max = 2");
        let margin = "margin(ratio_max < 2 and growth_per_s < 0)";
        assert_eq!(limit_in_words(margin, 0.0), "the limit of ratio_max < 2 and growth_per_s < 0");
    }
}

//! `sweep run GRID.toml`: computes the rows of a grid.

use std::path::Path;

use super::{Lines as _, ResultArgs, format_number};
use crate::config::section::format_count;
use crate::progress::format_rate;
use crate::run::{self as runner, RunEnd, RunOptions, RunReport};
use crate::store::read::{ColumnExtreme, NameCounts, count_failed, failure_counts};
use crate::store::{Session, ShardRequest, Tally};
use crate::{
    Design, Engine, Error, ExecutionArgs, Exit, Interrupt, Job, Model, Plan, format_duration, tell,
    threads,
};
use sweep_parameter::RatioLimits;
use sweep_plot::ShareInterval;

/// The arguments of `sweep run`.
#[derive(Debug, clap::Args)]
pub struct RunArgs {
    /// The grid file and the output of the run.
    #[command(flatten)]
    pub target: ResultArgs,
    /// The threads, the progress, the shard, and whether to start over.
    #[command(flatten)]
    pub control: RunControlArgs,
}

/// The arguments for the work of a run, which do not change its result: threads, progress, shard,
/// and whether to start over.
#[derive(Debug, clap::Args)]
pub struct RunControlArgs {
    /// The threads and the progress.
    #[command(flatten)]
    pub execution: ExecutionArgs,
    /// Compute only one of N equal shards, which `sweep merge` joins; `auto/N` takes the number
    /// from SLURM_ARRAY_TASK_ID or JOB_COMPLETION_INDEX. In a Slurm array the default is that
    /// array's task and count (--shard 1/1 computes the whole)
    #[arg(long, value_name = "I/N")]
    pub shard: Option<ShardRequest>,
    /// Start over, even if the result exists or a run of another plan has started
    #[arg(long)]
    pub fresh: bool,
    /// Exit with 3 if any row failed
    #[arg(long)]
    pub fail_on_error: bool,
}

impl RunControlArgs {
    /// Returns the options for the runner.
    fn options(&self) -> Result<RunOptions<'static>, Error> {
        Ok(RunOptions {
            threads: threads::choose_count(self.execution.threads, &threads::read_variable)?,
            starts_over: self.fresh,
            shard: self.shard,
            progress: self.execution.progress,
            environment: &threads::read_variable,
            show_message: &tell,
        })
    }
}

/// Runs a grid.
///
/// # Errors
/// Mistakes in the grid file, and the errors of [`execute`].
pub fn run<M: Model>(args: &RunArgs) -> Result<Exit, Error> {
    let plan: Plan<M> = args.target.grid.load()?;
    let engine = M::engine(&plan, None)?;
    let report = execute(args, &plan, &engine, &install_interrupt()?, "")?;
    Ok(exit_code(&args.control, &report))
}

/// Installs the signal handlers of this process.
///
/// # Errors
/// Handlers that the system refuses.
pub fn install_interrupt() -> Result<Interrupt, Error> {
    Interrupt::install().map_err(Error::signal_handlers)
}

/// Runs a plan by an engine that was made for it, and prints a summary. `options` are further
/// arguments of the command line, which the summary repeats.
///
/// # Errors
/// Any [`crate::store::StoreError`]. Finished chunks are stored before.
pub fn execute<M: Model>(
    args: &RunArgs,
    plan: &Plan<M>,
    engine: &Engine<'_>,
    interrupt: &Interrupt,
    options: &str,
) -> Result<RunReport, Error> {
    let job = &Job::new(plan);
    let output = &args.target.output(plan);
    let add_result_lines = |text: &mut String, tally: &Tally| {
        text.push_str(&format_counts(tally, job));
        text.push_str(&format_failure_reasons(engine, tally, job));
        text.line("file", output.display());
        if matches!(plan.design, Some(Design::Spread { .. })) {
            text.line("share", format_share(tally));
        }
        text.suggest_command("plot", output);
        Ok(())
    };
    let run_command = RunCommand {
        name: &plan.name,
        subcommand: "run",
        row_noun: "points",
        target: &args.target,
        control: &args.control,
        further_options: [options, ""],
    };
    run_command.execute(engine, job, output, interrupt, &add_result_lines)
}

/// Returns the exit code of a run.
pub fn exit_code(control: &RunControlArgs, report: &RunReport) -> Exit {
    let by_status = match &report.end {
        RunEnd::Interrupted { signal, .. } => return Exit::from_signal(Some(*signal)),
        RunEnd::AlreadyFinished(_, tally) | RunEnd::Finished(tally) => &tally.by_status,
        RunEnd::Shard(_, by_status) => by_status,
    };
    exit_code_by_status(control.fail_on_error, by_status)
}

/// Returns the exit code of finished work, by the statuses of its rows.
pub(super) fn exit_code_by_status(fail_on_error: bool, by_status: &NameCounts) -> Exit {
    let is_failure = fail_on_error && count_failed(by_status) > 0;
    if is_failure { Exit::PointsFailed } else { Exit::Done }
}

/// A command that computes the rows of a file, with the words of its summary.
pub struct RunCommand<'a> {
    /// The name of the run.
    pub name: &'a str,
    /// The name of the command.
    pub subcommand: &'static str,
    /// The plural noun for the rows.
    pub row_noun: &'static str,
    /// The grid file and the output of the run.
    pub target: &'a ResultArgs,
    /// The threads, the progress, the shard, and whether to start over.
    pub control: &'a RunControlArgs,
    /// Further arguments for the command lines in the summary: those of this command, and those of
    /// `merge`. Each begins with a space, or is empty.
    pub further_options: [&'a str; 2],
}

/// A function that adds lines about a finished file to the summary: its content, its path, and the
/// next command.
type ResultLines<'a> = &'a dyn Fn(&mut String, &Tally) -> Result<(), Error>;

impl RunCommand<'_> {
    /// Computes the rows and prints a summary.
    ///
    /// # Errors
    /// Errors of evaluating points or writing files. Finished chunks are stored before.
    pub fn execute(
        &self,
        engine: &Engine<'_>,
        job: &Job<'_>,
        output: &Path,
        interrupt: &Interrupt,
        add_result_lines: ResultLines<'_>,
    ) -> Result<RunReport, Error> {
        let report = runner::run(engine, job, output, self.control.options()?, interrupt)?;
        report.notes.iter().for_each(|note| tell(note));
        tell(self.format_summary(&report, add_result_lines)?.trim_end());
        Ok(report)
    }

    /// Returns the summary of the run, at most twelve lines.
    fn format_summary(
        &self,
        report: &RunReport,
        add_result_lines: ResultLines<'_>,
    ) -> Result<String, Error> {
        let Self {
            name,
            row_noun: rows,
            target,
            further_options: [run_options, merge_options],
            ..
        } = self;
        let session = report.session.as_ref();
        let work_text = session.map(describe_work).unwrap_or_default();
        let mut text;
        match &report.end {
            RunEnd::AlreadyFinished(file, tally) => {
                let computed_note = format!("all {} {rows} are there already", file.points);
                text = format!("{name}: {computed_note} (--fresh computes them again)\n");
                add_result_lines(&mut text, tally)?;
            }
            RunEnd::Finished(tally) => {
                text = format!("{name}: {work_text}\n");
                add_result_lines(&mut text, tally)?;
            }
            RunEnd::Shard(shard, by_status) => {
                text = format!("{name}, shard {} of {}: {work_text}\n", shard.index, shard.count);
                if let Some(failure_text) = describe_failures(by_status) {
                    text.line("failed", failure_text);
                }
                let merge_command = target.command("merge") + merge_options;
                text.line("next", format!("{merge_command}, when all shards are done"));
            }
            RunEnd::Interrupted { stored_points, points, .. } => {
                let wall_time =
                    session.map(|session| format!(", after {}", format_duration(session.wall_s)));
                let wall_time = wall_time.unwrap_or_default();
                text = format!(
                    "{name}: interrupted with {stored_points} of {points} {rows} kept{wall_time}\n"
                );
                let shard = session.and_then(|session| session.shard.as_deref());
                let shard = shard.map(|shard| format!(" --shard {shard}")).unwrap_or_default();
                text.line(
                    "go on",
                    format!("{}{run_options}{shard}", target.command(self.subcommand)),
                );
            }
        }
        Ok(text)
    }
}

/// Describes the work of this process.
fn describe_work(session: &Session) -> String {
    let Session { simd, .. } = session;
    let wall_time = format_duration(session.wall_s);
    let rate_text = format_rate(session.points_per_s);
    let points_text = format_count(session.points as usize, "point");
    let threads_text = format_count(session.threads, "thread");
    format!("{points_text} in {wall_time}, {rate_text} on {threads_text} ({simd})")
}

/// Formats the counts of a result: verdicts, failures, extremes.
pub fn format_counts(tally: &Tally, job: &Job<'_>) -> String {
    format_counts_at(tally, job.limits, &|point| format_axis_values(point, job))
}

/// Formats the reasons why the first points of each status failed, as far as the engine knows them.
pub fn format_failure_reasons(engine: &Engine<'_>, tally: &Tally, job: &Job<'_>) -> String {
    let mut text = String::new();
    for (status, point) in &tally.first_failed {
        if let Some(reason) = (engine.failure_reason)(*point) {
            let axis_values = format_axis_values(*point * job.layout.tasks_per_point, job);
            let location =
                if axis_values.is_empty() { axis_values } else { format!(" at {axis_values}") };
            text.line("reason", format!("{status}{location}: {reason}"));
        }
    }
    text
}

/// Formats the values of the axes at a point.
fn format_axis_values(point: u64, job: &Job<'_>) -> String {
    let values = (job.axis_values)(point);
    format_named_values(job.layout.axes.iter().map(|axis| &*axis.name).zip(values))
}

/// Formats values with their names.
pub(super) fn format_named_values<'a>(values: impl Iterator<Item = (&'a str, f64)>) -> String {
    let named_values = values.map(|(axis, value)| format!("{axis} {}", format_number(value)));
    named_values.collect::<Vec<_>>().join(", ")
}

/// Returns the share of so many rows among those with a verdict, as `share(reliable)` counts it;
/// `None` if no row has a verdict.
fn verdict_share(rows: u64, tally: &Tally) -> Option<ShareInterval> {
    ShareInterval::wilson(rows, tally.reliable + tally.unreliable)
}

/// Formats a fraction as a percentage.
fn format_percent(fraction: f64) -> String {
    format!("{:.1}", 100.0 * fraction)
}

/// Formats the share of reliable points among those with a verdict, with its 95 % confidence
/// interval for independent random points.
fn format_share(tally: &Tally) -> String {
    match verdict_share(tally.reliable, tally) {
        None => "no point has a verdict".to_owned(),
        Some(ShareInterval { fraction, low, high }) => {
            let [share, low, high] = [fraction, low, high].map(format_percent);
            format!(
                "{share} % reliable, with 95 % confidence {low} to {high} % for points at random"
            )
        }
    }
}

/// Formats the counts of a result like [`format_counts`]. `axis_values` returns the values of the
/// axes at a point, in words.
pub fn format_counts_at(
    tally: &Tally,
    limits: RatioLimits,
    axis_values: &dyn Fn(u64) -> String,
) -> String {
    let mut text = String::new();
    let upper_limit = limits.upper;
    let range_text = limits.lower.map_or_else(
        || format!("below ratio {upper_limit}"),
        |lower| format!("with ratios from {lower} to {upper_limit}"),
    );
    let Tally { reliable, unreliable, undefined, over_estimated, sensitive, unconverged, .. } =
        tally;
    let other_counts = format!("{unreliable} not, {undefined} undefined");
    let verdict_text = match verdict_share(*reliable, tally) {
        None => format!("{reliable} {range_text}, {other_counts}: no row has a verdict"),
        Some(share) => {
            let uncounted_note = if *undefined > 0 { ", which the share leaves out" } else { "" };
            format!(
                "{reliable} ({} %) {range_text}, {other_counts}{uncounted_note}",
                format_percent(share.fraction)
            )
        }
    };
    text.line("reliable", verdict_text);
    text.push_str(&format_undefined_line(tally, axis_values));
    // An over-estimated row has a ratio, so that it has a verdict.
    if let Some(share) = verdict_share(*over_estimated, tally).filter(|_| *over_estimated > 0) {
        let limit_text = format_number(limits.over_estimate_limit());
        let rows = format!("in {over_estimated} ({} %)", format_percent(share.fraction));
        let row_counts = format!("{rows}, {} of them reliable", tally.over_estimated_reliable);
        let description =
            format!("{row_counts}: the linear model over-estimates, a ratio is below {limit_text}");
        text.line("too high", description);
    }
    if let Some(failure_text) = describe_failures(&tally.by_status) {
        text.line("failed", failure_text);
    }
    if *sensitive > 0 {
        text.line(
            "sensitive",
            format!("{sensitive}: chaotic, a perturbed run separates exponentially"),
        );
    }
    if *unconverged > 0 {
        let description =
            format!("all but {unconverged}, whose error is above the accuracy or unknown");
        text.line("converged", description);
    }
    if let Some(greatest) = &tally.greatest_error {
        let method_counts: Vec<String> =
            tally.by_method.iter().map(|(method, count)| format!("{count} {method}")).collect();
        // Rows of failed models have an infinite error.
        let finite_error = Some(greatest.value).filter(|finite_error| finite_error.is_finite());
        let error_note =
            finite_error.map(|finite_error| format!("at most {finite_error:.1e} left in a row; "));
        let error_note = error_note.unwrap_or_default();
        text.line("error", format!("{error_note}rows by method: {}", method_counts.join(", ")));
    }
    let location_text = |point: u64| match axis_values(point) {
        values if values.is_empty() => values,
        values => format!(" at {values}"),
    };
    if let Some(greatest) = &tally.greatest_ratio {
        text.line(
            "greatest",
            format!("ratio {:.3}{}", greatest.value, location_text(greatest.point)),
        );
    }
    for ColumnExtreme {
        column,
        worse,
        limit,
        rows_beyond_limit: rows_beyond,
        worst_value: worst,
    } in &tally.extremes
    {
        let Some(worst) = worst else { continue };
        let mut extreme_text =
            format!("{column} {}{}", format_number(worst.value), location_text(worst.point));
        if let Some(limit) = limit.filter(|_| *rows_beyond > 0) {
            let rows = format_count(*rows_beyond as usize, "row");
            extreme_text += &format!("; {rows} {} {}", worse.bad_side_word(), format_number(limit));
        }
        text.line(worse.worst_value_word(), extreme_text);
    }
    text
}

/// Formats the reason why rows without a failure have no verdict; empty if there are none.
fn format_undefined_line(tally: &Tally, axis_values: &dyn Fn(u64) -> String) -> String {
    let mut text = String::new();
    let Some(first) = tally.first_undefined_without_failure else { return text };
    let rows = format_count(tally.undefined_without_failure as usize, "row");
    let location = match axis_values(first) {
        values if values.is_empty() => values,
        values => format!(", the first at {values}"),
    };
    let condition = tally.undefined_condition.as_deref().unwrap_or("null");
    text.line(
        "undefined",
        format!("{rows} without a failure{location}: each ratio is {condition}"),
    );
    text
}

/// Returns the number of failed rows of each status, in words; `None` if there are none.
pub(super) fn describe_failures(by_status: &NameCounts) -> Option<String> {
    let failure_texts =
        failure_counts(by_status).map(|(status, count)| format!("{count} {status}"));
    let failure_texts = failure_texts.collect::<Vec<_>>().join(", ");
    (!failure_texts.is_empty()).then_some(failure_texts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::read::Extreme;
    use sweep_parameter::Worse;

    #[test]
    fn shares_are_of_the_rows_with_a_verdict() {
        let tally = Tally {
            points: 16,
            reliable: 6,
            unreliable: 2,
            undefined: 8,
            over_estimated: 4,
            ..Tally::default()
        };
        let summary = format_counts_at(&tally, 2.0.into(), &|_| String::new());
        let expected_line = "reliable  6 (75.0 %) below ratio 2, 2 not, 8 undefined, which the \
                             share leaves out\n";
        assert!(summary.contains(expected_line), "{summary}");
        assert!(summary.contains("too high  in 4 (50.0 %)"), "{summary}");
        let share = format_share(&tally);
        assert!(share.starts_with("75.0 %"), "{share}");
    }

    #[test]
    fn a_result_without_a_verdict_has_no_share() {
        let tally = Tally { points: 8, undefined: 8, ..Tally::default() };
        let summary = format_counts_at(&tally, 2.0.into(), &|_| String::new());
        let expected_line = "reliable  0 below ratio 2, 0 not, 8 undefined: no row has a verdict\n";
        assert!(summary.contains(expected_line), "{summary}");
    }

    #[test]
    fn an_infinite_error_is_left_out() {
        let greatest_error = Some(Extreme { value: f64::INFINITY, point: 0 });
        let by_method = [("capped_1".to_owned(), 1)].into();
        let tally = Tally { points: 1, greatest_error, by_method, ..Tally::default() };
        let summary = format_counts_at(&tally, 2.0.into(), &|_| String::new());
        assert!(summary.contains("error  rows by method: 1 capped_1"), "{summary}");
    }

    #[test]
    fn rows_without_a_ratio_are_explained_by_the_columns() {
        let summary_of = |undefined_without_failure, first_undefined_without_failure| {
            let tally = Tally {
                points: 3,
                undefined: 3,
                undefined_without_failure,
                first_undefined_without_failure,
                undefined_condition: Some("null where the linear one is zero".to_owned()),
                ..Tally::default()
            };
            format_counts_at(&tally, 2.0.into(), &|point| format!("mass_kg {point}"))
        };
        let expected_line = " undefined  2 rows without a failure, the first at mass_kg 1: each \
                             ratio is null where the linear one is zero\n";
        assert!(summary_of(2, Some(1)).contains(expected_line), "{}", summary_of(2, Some(1)));
        assert!(!summary_of(0, None).contains("without a failure"), "{}", summary_of(0, None));
    }

    #[test]
    fn rows_beyond_the_limit_of_a_marked_column_are_counted() {
        let summary_of = |rows_beyond_limit| {
            let worst = Some(Extreme { value: 2.5, point: 0 });
            let column = "speed_off".to_owned();
            let limit = Some(2.0);
            let extreme = ColumnExtreme {
                column,
                worse: Worse::Greater,
                limit,
                rows_beyond_limit,
                worst_value: worst,
            };
            let tally = Tally { extremes: vec![extreme], ..Tally::default() };
            format_counts_at(&tally, 2.0.into(), &|_| String::new())
        };
        assert!(summary_of(0).contains("  greatest  speed_off 2.5\n"), "{}", summary_of(0));
        assert!(
            summary_of(1).contains("  greatest  speed_off 2.5; 1 row above 2\n"),
            "{}",
            summary_of(1)
        );
        assert!(summary_of(2).contains("; 2 rows above 2\n"), "{}", summary_of(2));
    }

    #[test]
    fn the_share_counts_only_points_with_a_verdict() {
        let tally_of = |reliable, unreliable| Tally { reliable, unreliable, ..Tally::default() };
        let summary = format_share(&tally_of(8, 2));
        assert!(
            summary.starts_with("80.0 % reliable, with 95 % confidence 49.0 to 94.3 %"),
            "{summary}"
        );
        assert_eq!(format_share(&tally_of(0, 0)), "no point has a verdict");
    }
}

//! `sweep run GRID.toml`: computes the rows of a grid.

use std::path::Path;

use super::{Lines as _, ResultArgs, short};
use crate::config::section::counted;
use crate::progress::per_second;
use crate::run::{self as runner, Ended, RunOptions, RunReport};
use crate::store::read::{ColumnExtreme, NameCounts, failed, failures};
use crate::store::{Session, ShardRequest, Tally};
use crate::{
    Design, EffortArgs, Engine, Error, Exit, Interrupt, Job, Model, Plan, duration, tell, threads,
};
use sweep_parameter::RatioLimits;
use sweep_plot::Share;

/// The arguments of `sweep run`.
#[derive(Debug, clap::Args)]
pub struct RunArgs {
    /// The grid file and the output of the run.
    #[command(flatten)]
    pub target: ResultArgs,
    /// The threads, the progress, the shard, and whether to start over.
    #[command(flatten)]
    pub work: WorkArgs,
}

/// The arguments for the work of a run, which do not change its result: threads, progress, shard,
/// and whether to start over.
#[derive(Debug, clap::Args)]
pub struct WorkArgs {
    /// The threads and the progress.
    #[command(flatten)]
    pub effort: EffortArgs,
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

impl WorkArgs {
    /// Returns the options for the runner.
    fn options(&self) -> Result<RunOptions<'static>, Error> {
        Ok(RunOptions {
            threads: threads::count(self.effort.threads, &threads::process)?,
            fresh: self.fresh,
            shard: self.shard,
            progress: self.effort.progress,
            environment: &threads::process,
            tell: &tell,
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
    let report = execute(args, &plan, &engine, &installed()?, "")?;
    Ok(exit(&args.work, &report))
}

/// Installs the signal handlers of this process.
///
/// # Errors
/// Handlers that the system refuses.
pub fn installed() -> Result<Interrupt, Error> {
    Interrupt::install().map_err(Error::signals)
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
    let finished = |text: &mut String, tally: &Tally| {
        text.push_str(&rows(tally, job));
        text.push_str(&failure_reasons(engine, tally, job));
        text.line("file", output.display());
        if matches!(plan.design, Some(Design::Spread { .. })) {
            text.line("share", share(tally));
        }
        text.next("plot", output);
        Ok(())
    };
    let run = RunCommand {
        name: &plan.name,
        verb: "run",
        rows: "points",
        target: &args.target,
        work: &args.work,
        options: [options, ""],
    };
    run.execute(engine, job, output, interrupt, &finished)
}

/// Returns the exit code of a run.
pub fn exit(work: &WorkArgs, report: &RunReport) -> Exit {
    let by_status = match &report.ended {
        Ended::Interrupted { signal, .. } => return Exit::interrupted(Some(*signal)),
        Ended::Already(_, tally) | Ended::Finished(tally) => &tally.by_status,
        Ended::Shard(_, by_status) => by_status,
    };
    done(work.fail_on_error, by_status)
}

/// Returns the exit code of finished work, by the statuses of its rows.
pub(super) fn done(fail_on_error: bool, by_status: &NameCounts) -> Exit {
    let is_failure = fail_on_error && failed(by_status) > 0;
    if is_failure { Exit::PointsFailed } else { Exit::Done }
}

/// A command that computes the rows of a file, with the words of its summary.
pub struct RunCommand<'a> {
    /// The name of the run.
    pub name: &'a str,
    /// The name of the command.
    pub verb: &'static str,
    /// The plural noun for the rows.
    pub rows: &'static str,
    /// The grid file and the output of the run.
    pub target: &'a ResultArgs,
    /// The threads, the progress, the shard, and whether to start over.
    pub work: &'a WorkArgs,
    /// Further arguments for the command lines in the summary: those of this command, and those of
    /// `merge`. Each begins with a space, or is empty.
    pub options: [&'a str; 2],
}

/// A function that adds lines about a finished file to the summary: its content, its path, and the
/// next command.
type Finished<'a> = &'a dyn Fn(&mut String, &Tally) -> Result<(), Error>;

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
        finished: Finished<'_>,
    ) -> Result<RunReport, Error> {
        let report = runner::run(engine, job, output, self.work.options()?, interrupt)?;
        report.notes.iter().for_each(|note| tell(note));
        tell(self.summary(&report, finished)?.trim_end());
        Ok(report)
    }

    /// Returns the summary of the run, at most twelve lines.
    fn summary(&self, report: &RunReport, finished: Finished<'_>) -> Result<String, Error> {
        let Self { name, rows, target, options: [own, merge_options], .. } = self;
        let session = report.session.as_ref();
        let work = session.map(work).unwrap_or_default();
        let mut text;
        match &report.ended {
            Ended::Already(file, tally) => {
                let there = format!("all {} {rows} are there already", file.points);
                text = format!("{name}: {there} (--fresh computes them again)\n");
                finished(&mut text, tally)?;
            }
            Ended::Finished(tally) => {
                text = format!("{name}: {work}\n");
                finished(&mut text, tally)?;
            }
            Ended::Shard(shard, by_status) => {
                text = format!("{name}, shard {} of {}: {work}\n", shard.index, shard.count);
                if let Some(failed) = failed_words(by_status) {
                    text.line("failed", failed);
                }
                let merge = target.command("merge") + merge_options;
                text.line("next", format!("{merge}, when all shards are done"));
            }
            Ended::Interrupted { kept, points, .. } => {
                let after = session.map(|it| format!(", after {}", duration(it.wall_s)));
                let after = after.unwrap_or_default();
                text = format!("{name}: interrupted with {kept} of {points} {rows} kept{after}\n");
                let shard = session.and_then(|session| session.shard.as_deref());
                let shard = shard.map(|shard| format!(" --shard {shard}")).unwrap_or_default();
                text.line("go on", format!("{}{own}{shard}", target.command(self.verb)));
            }
        }
        Ok(text)
    }
}

/// Describes the work of this process.
fn work(session: &Session) -> String {
    let Session { simd, .. } = session;
    let wall = duration(session.wall_s);
    let rate = per_second(session.points_per_s);
    let points = counted(session.points as usize, "point");
    let threads = counted(session.threads, "thread");
    format!("{points} in {wall}, {rate} on {threads} ({simd})")
}

/// Formats the counts of a result in at most six lines: verdicts, failures, extremes.
pub fn rows(tally: &Tally, job: &Job<'_>) -> String {
    counts(tally, job.limits, &|point| place(point, job))
}

/// Formats the reasons why the first points of each status failed, as far as the engine knows them.
pub fn failure_reasons(engine: &Engine<'_>, tally: &Tally, job: &Job<'_>) -> String {
    let mut text = String::new();
    for (status, point) in &tally.first_failed {
        if let Some(reason) = (engine.failure_reason)(*point) {
            let place = place(*point * job.layout.rows_a_point, job);
            let at = if place.is_empty() { place } else { format!(" at {place}") };
            text.line("reason", format!("{status}{at}: {reason}"));
        }
    }
    text
}

/// Formats the values of the axes at a point.
fn place(point: u64, job: &Job<'_>) -> String {
    let values = (job.axis_values)(point);
    axis_values(job.layout.axes.iter().map(|axis| &*axis.name).zip(values))
}

/// Formats values of axes with the names of these.
pub(super) fn axis_values<'a>(values: impl Iterator<Item = (&'a str, f64)>) -> String {
    let words = values.map(|(axis, value)| format!("{axis} {}", short(value)));
    words.collect::<Vec<_>>().join(", ")
}

/// Formats the share of reliable points among those with a verdict, with its 95 % confidence
/// interval for independent random points.
fn share(tally: &Tally) -> String {
    match Share::wilson(tally.reliable, tally.reliable + tally.unreliable) {
        None => "no point has a verdict".to_owned(),
        Some(Share { fraction, low, high }) => {
            let [share, low, high] =
                [fraction, low, high].map(|fraction| format!("{:.1}", 100.0 * fraction));
            format!(
                "{share} % reliable, with 95 % confidence {low} to {high} % for points at random"
            )
        }
    }
}

/// Formats the counts of a result like [`rows`]. `at` returns the values of the axes at a point, in
/// words.
pub fn counts(tally: &Tally, limits: RatioLimits, at: &dyn Fn(u64) -> String) -> String {
    let mut text = String::new();
    // The share of rows that have a verdict, as `share(reliable)` counts them.
    let percent = |count: u64| {
        let judged = tally.reliable + tally.unreliable;
        100.0 * count as f64 / judged.max(1) as f64
    };
    let most = limits.most;
    let range = limits.least.map_or_else(
        || format!("below ratio {most}"),
        |least| format!("with ratios from {least} to {most}"),
    );
    let Tally { reliable, unreliable, undefined, over_estimated, sensitive, unconverged, .. } =
        tally;
    let share = percent(*reliable);
    let uncounted = if *undefined > 0 { ", which the share leaves out" } else { "" };
    let others = format!("{unreliable} not, {undefined} undefined{uncounted}");
    text.line("reliable", format!("{reliable} ({share:.1} %) {range}, {others}"));
    if *over_estimated > 0 {
        let share = percent(*over_estimated);
        let below = short(limits.over_estimate());
        let rows = format!("in {over_estimated} ({share:.1} %)");
        let which = format!("{rows}, {} of them reliable", tally.over_estimated_reliable);
        let told = format!("{which}: the linear model over-estimates, a ratio is below {below}");
        text.line("too high", told);
    }
    if let Some(failed) = failed_words(&tally.by_status) {
        text.line("failed", failed);
    }
    if *sensitive > 0 {
        text.line(
            "sensitive",
            format!("{sensitive}: chaotic, a perturbed run separates exponentially"),
        );
    }
    if *unconverged > 0 {
        let told = format!("all but {unconverged}, whose error is above the accuracy or unknown");
        text.line("converged", told);
    }
    if let Some(greatest) = &tally.greatest_error {
        let methods: Vec<String> =
            tally.by_method.iter().map(|(method, count)| format!("{count} {method}")).collect();
        // Rows of failed models have an infinite error.
        let error = Some(greatest.value).filter(|error| error.is_finite());
        let left = error.map(|error| format!("at most {error:.1e} left in a row; "));
        let left = left.unwrap_or_default();
        text.line("error", format!("{left}rows by method: {}", methods.join(", ")));
    }
    let place = |point: u64| match at(point) {
        place if place.is_empty() => place,
        place => format!(" at {place}"),
    };
    if let Some(greatest) = &tally.greatest_ratio {
        text.line("greatest", format!("ratio {:.3}{}", greatest.value, place(greatest.point)));
    }
    for ColumnExtreme { column, worse, limit, beyond, worst } in &tally.extremes {
        let Some(worst) = worst else { continue };
        let mut words = format!("{column} {}{}", short(worst.value), place(worst.point));
        if let Some(limit) = limit.filter(|_| *beyond > 0) {
            let rows = counted(*beyond as usize, "row");
            words += &format!("; {rows} {} {}", worse.bad_side(), short(limit));
        }
        text.line(worse.extreme(), words);
    }
    text
}

/// Returns the number of failed rows of each status, in words; `None` if there are none.
pub(super) fn failed_words(by_status: &NameCounts) -> Option<String> {
    let failed = failures(by_status).map(|(status, count)| format!("{count} {status}"));
    let failed = failed.collect::<Vec<_>>().join(", ");
    (!failed.is_empty()).then_some(failed)
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
        let summary = counts(&tally, 2.0.into(), &|_| String::new());
        let line = "reliable  6 (75.0 %) below ratio 2, 2 not, 8 undefined, which the share leaves \
                    out\n";
        assert!(summary.contains(line), "{summary}");
        assert!(summary.contains("too high  in 4 (50.0 %)"), "{summary}");
        let share = share(&tally);
        assert!(share.starts_with("75.0 %"), "{share}");
    }

    #[test]
    fn an_infinite_error_is_left_out() {
        let greatest_error = Some(Extreme { value: f64::INFINITY, point: 0 });
        let by_method = [("capped_1".to_owned(), 1)].into();
        let tally = Tally { points: 1, greatest_error, by_method, ..Tally::default() };
        let said = counts(&tally, 2.0.into(), &|_| String::new());
        assert!(said.contains("error  rows by method: 1 capped_1"), "{said}");
    }

    #[test]
    fn rows_beyond_the_limit_of_a_marked_column_are_counted() {
        let said = |beyond| {
            let worst = Some(Extreme { value: 2.5, point: 0 });
            let column = "speed_off".to_owned();
            let limit = Some(2.0);
            let extreme = ColumnExtreme { column, worse: Worse::Greater, limit, beyond, worst };
            let tally = Tally { extremes: vec![extreme], ..Tally::default() };
            counts(&tally, 2.0.into(), &|_| String::new())
        };
        assert!(said(0).contains("  greatest  speed_off 2.5\n"), "{}", said(0));
        assert!(said(1).contains("  greatest  speed_off 2.5; 1 row above 2\n"), "{}", said(1));
        assert!(said(2).contains("; 2 rows above 2\n"), "{}", said(2));
    }

    #[test]
    fn the_share_counts_only_points_with_a_verdict() {
        let tally = |reliable, unreliable| Tally { reliable, unreliable, ..Tally::default() };
        let said = share(&tally(8, 2));
        assert!(said.starts_with("80.0 % reliable, with 95 % confidence 49.0 to 94.3 %"), "{said}");
        assert_eq!(share(&tally(0, 0)), "no point has a verdict");
    }
}

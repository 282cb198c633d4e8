//! `sweep run GRID.toml`: the sweep.

use std::path::Path;

use super::{Lines as _, ResultArgs, short};
use crate::config::section::counted;
use crate::progress::per_second;
use crate::run::{self as runner, Ended, RunOptions, RunReport};
use crate::store::read::{DwellCounts, FAR_OFF, NameCounts, failed, failures};
use crate::store::{Session, ShardRequest, Tally};
use crate::{
    Design, EffortArgs, Engine, Error, Exit, Interrupt, Job, Model, Plan, duration, tell, threads,
};
use sweep_parameter::RatioLimits;
use sweep_plot::Share;

/// Arguments of `sweep run`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The run.
    #[command(flatten)]
    pub target: ResultArgs,
    /// How it is done.
    #[command(flatten)]
    pub work: WorkArgs,
}

/// How a run is done, by whichever engine.
#[derive(Debug, clap::Args)]
pub struct WorkArgs {
    /// Its threads and progress.
    #[command(flatten)]
    pub effort: EffortArgs,
    /// Compute one of N equal shards only, to be joined by `sweep merge`; `auto/N` takes the place
    /// from SLURM_ARRAY_TASK_ID or JOB_COMPLETION_INDEX. In a Slurm array the default is that
    /// array's task and count (--shard 1/1 is the whole)
    #[arg(long, value_name = "I/N")]
    pub shard: Option<ShardRequest>,
    /// Start over, even if the result is there or another plan was begun
    #[arg(long)]
    pub fresh: bool,
    /// Exit with 3 if any row failed
    #[arg(long)]
    pub fail_on_error: bool,
}

impl WorkArgs {
    /// As the runner takes them.
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
/// Mistakes in the grid file, and whatever kept the run from its end.
pub fn run<M: Model>(args: &Args) -> Result<Exit, Error> {
    let plan: Plan<M> = args.target.grid.load()?;
    let engine = M::engine(&plan, None)?;
    let report = execute(args, &plan, &engine, &installed()?, "")?;
    Ok(exit(&args.work, &report))
}

/// Signals, heeded from now on.
///
/// # Errors
/// What the system refuses.
pub fn installed() -> Result<Interrupt, Error> {
    Interrupt::install().map_err(Error::signals)
}

/// Runs a plan, with an engine made for it, and prints a summary. `options` are what the command
/// line has beside these arguments.
///
/// # Errors
/// Whatever of [`crate::store::StoreError`] kept it from its end; finished chunks are kept.
pub fn execute<M: Model>(
    args: &Args,
    plan: &Plan<M>,
    engine: &Engine<'_>,
    interrupt: &Interrupt,
    options: &str,
) -> Result<RunReport, Error> {
    let (job, output) = (&Job::of(plan), &args.target.output(plan));
    let finished = |text: &mut String, tally: &Tally| {
        text.push_str(&rows(tally, job));
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

/// How a run ends the program.
pub fn exit(work: &WorkArgs, report: &RunReport) -> Exit {
    let by_status = match &report.ended {
        Ended::Interrupted { signal, .. } => return Exit::interrupted(Some(*signal)),
        Ended::Already(_, tally) | Ended::Finished(tally) => &tally.by_status,
        Ended::Shard(_, by_status) => by_status,
    };
    done(work.fail_on_error, by_status)
}

/// How what is done ends the program.
pub(super) fn done(fail_on_error: bool, by_status: &NameCounts) -> Exit {
    let is_failure = fail_on_error && failed(by_status) > 0;
    if is_failure { Exit::PointsFailed } else { Exit::Done }
}

/// A command that computes the rows of a file, as its summary speaks of it.
pub struct RunCommand<'a> {
    /// The name of the run.
    pub name: &'a str,
    /// The command.
    pub verb: &'static str,
    /// What its rows are called.
    pub rows: &'static str,
    /// The run.
    pub target: &'a ResultArgs,
    /// How it is done.
    pub work: &'a WorkArgs,
    /// Options beside the target's, to copy: those of the command, and those that tell `merge` the
    /// same. Each begins with a space, or is empty.
    pub options: [&'a str; 2],
}

/// Says what a finished file holds, where it is and what to do with it.
type Finished<'a> = &'a dyn Fn(&mut String, &Tally) -> Result<(), Error>;

impl RunCommand<'_> {
    /// Computes the rows and prints a summary.
    ///
    /// # Errors
    /// Whatever keeps the file from being written; finished chunks are kept.
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

    /// What came of the run, in at most twelve lines.
    fn summary(&self, report: &RunReport, finished: Finished<'_>) -> Result<String, Error> {
        let Self { name, rows, target, options: [own, of_merge], .. } = self;
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
                text = format!("{name}, shard {} of {}: {work}\n", shard.index, shard.of);
                if let Some(failed) = failed_words(by_status) {
                    text.line("failed", failed);
                }
                let merge = target.command("merge") + of_merge;
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

/// What this process did.
fn work(session: &Session) -> String {
    let Session { simd, .. } = session;
    let (wall, rate) = (duration(session.wall_s), per_second(session.points_per_s));
    let points = counted(session.points as usize, "point");
    let threads = counted(session.threads, "thread");
    format!("{points} in {wall}, {rate} on {threads} ({simd})")
}

/// A result's rows: verdicts, failures, extremes. At most six lines.
pub fn rows(tally: &Tally, job: &Job<'_>) -> String {
    if let Some(dwells) = &tally.dwells {
        let DwellCounts { stable, unstable, beyond, unknown } = dwells;
        let (able, points) = (stable - beyond, tally.points);
        let beyond = match beyond {
            0 => String::new(),
            beyond => format!(", {beyond} beyond what a machine can do"),
        };
        let rows = format!("{able} of {points} rows, {unstable} not");
        let mut text = String::new();
        text.line("stable", format!("{rows}, {unknown} without a response{beyond}"));
        return text;
    }
    let at = |point: u64| {
        let values = (job.axis_values)(point);
        let place = job.layout.axes.iter().zip(values);
        let place = place.map(|(axis, value)| format!("{} {}", axis.name, short(value)));
        place.collect::<Vec<_>>().join(", ")
    };
    counts(tally, job.limits, &at)
}

/// The share of reliable points among those with a verdict, with the interval in which the true
/// share lies with 95 % confidence if points are independent and at random.
fn share(tally: &Tally) -> String {
    match Share::wilson(tally.reliable, tally.reliable + tally.unreliable) {
        None => "no point has a verdict".to_owned(),
        Some(Share { part, low, high }) => {
            let [part, low, high] = [part, low, high].map(|part| format!("{:.1}", 100.0 * part));
            format!(
                "{part} % reliable, with 95 % confidence {low} to {high} % for points at random"
            )
        }
    }
}

/// As [`rows`], where `at` says where a point lies.
pub fn counts(tally: &Tally, limits: RatioLimits, at: &dyn Fn(u64) -> String) -> String {
    let mut text = String::new();
    let percent = |count: u64| 100.0 * count as f64 / tally.points.max(1) as f64;
    let most = limits.most;
    let range = limits.least.map_or_else(
        || format!("below ratio {most}"),
        |least| format!("with ratios from {least} to {most}"),
    );
    let Tally { reliable, unreliable, undefined, over_estimated, sensitive, unconverged, .. } =
        tally;
    let share = percent(*reliable);
    let others = format!("{unreliable} not, {undefined} undefined");
    text.line("reliable", format!("{reliable} ({share:.1} %) {range}, {others}"));
    if *over_estimated > 0 {
        let (share, below) = (percent(*over_estimated), short(limits.over_estimate()));
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
        // What failed has no finite one.
        let error = Some(greatest.value).filter(|error| error.is_finite());
        let left = error.map(|error| format!("at most {error:.1e} left in a row; "));
        let left = left.unwrap_or_default();
        text.line("error", format!("{left}rows by method: {}", methods.join(", ")));
    }
    let place = |point: u64| match at(point) {
        place if place.is_empty() => place,
        place => format!(" at {place}"),
    };
    if let Some(greatest) = &tally.greatest_off {
        let (rows, most, place) = (tally.far_off, greatest.value, place(greatest.point));
        let which = format!("{rows} rows whose linear model takes it at a speed off by more than");
        text.line("friction", format!("{which} {FAR_OFF}; at most {most:.3}{place}"));
    }
    if let Some(greatest) = &tally.greatest_ratio {
        text.line("greatest", format!("ratio {:.3}{}", greatest.value, place(greatest.point)));
    }
    if let Some(least) = &tally.least_gap_nonlinear_m {
        text.line("least gap", format!("{:.5} m{}", least.value, place(least.point)));
    }
    text
}

/// How many failed and why, if any did.
pub(super) fn failed_words(by_status: &NameCounts) -> Option<String> {
    let failed = failures(by_status).map(|(status, count)| format!("{count} {status}"));
    let failed = failed.collect::<Vec<_>>().join(", ");
    (!failed.is_empty()).then_some(failed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::read::Extreme;

    #[test]
    fn an_error_that_nothing_has_is_left_out() {
        let greatest_error = Some(Extreme { value: f64::INFINITY, point: 0 });
        let by_method = [("capped_1".to_owned(), 1)].into();
        let tally = Tally { points: 1, greatest_error, by_method, ..Tally::default() };
        let said = counts(&tally, 2.0.into(), &|_| String::new());
        assert!(said.contains("error  rows by method: 1 capped_1"), "{said}");
    }

    #[test]
    fn the_share_is_of_points_with_a_verdict() {
        let tally = |reliable, unreliable| Tally { reliable, unreliable, ..Tally::default() };
        let said = share(&tally(8, 2));
        assert!(said.starts_with("80.0 % reliable, with 95 % confidence 49.0 to 94.3 %"), "{said}");
        assert_eq!(share(&tally(0, 0)), "no point has a verdict");
    }
}

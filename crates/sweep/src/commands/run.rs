//! `sweep run GRID.toml`: the sweep.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use super::cells::short;
use super::examples::Examples;
use super::grid::{ResultArgs, quoted};
use crate::engine::ModelEngine;
use crate::exit::{Error, Exit, tell};
use crate::interrupt::Interrupt;
use crate::plan::Plan;
use crate::progress::{Progress, ProgressMode, duration, per_second};
use crate::run::{self as runner, Ended, RunOptions, RunReport};
use crate::store::provenance::Session;
use crate::store::read::Tally;
use crate::store::{Job, ShardRequest};
use crate::threads::{self, Environment};
use crate::trace::{self, MOST_KEPT};
use sweep_files::{self as files, ParquetFile};
use sweep_plot::Share;

/// Shown by `--help`.
pub(super) const EXAMPLES: Examples = &[
    ["sweep run my.toml", "to results/NAME.parquet, on every core"],
    ["sweep run my.toml --set tub_mass_kg=20 --out light.parquet", "the same with another tub"],
    ["sweep run my.toml --progress plain 2> run.log", "a line every 5 s, for a log"],
    ["sweep run my.toml --shard 3/16", "one sixteenth; `sweep merge` joins them"],
];

/// Arguments of `sweep run`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The run.
    #[command(flatten)]
    pub target: ResultArgs,
    /// How it is done.
    #[command(flatten)]
    pub work: WorkArgs,
    /// Keep the time histories of every point too, decimated, in NAME.traces beside NAME.parquet:
    /// `sweep plot NAME.parquet --traces NAME.traces -o MAP.html` shows them on a click. They take
    /// a run of their own, some three times as long as the map
    #[arg(long)]
    pub keep_traces: bool,
    /// Exit with 3 if any row of the finished result failed
    #[arg(long)]
    pub fail_on_error: bool,
}

/// How a run is done, by whichever engine.
#[derive(Debug, clap::Args)]
pub struct WorkArgs {
    /// Worker threads [default: SLURM_CPUS_PER_TASK, else the cores of this machine]
    #[arg(long, value_name = "N", value_parser = threads::parse)]
    pub threads: Option<usize>,
    /// Compute one of N equal shards only, to be joined by `sweep merge`; `auto/N` takes the place
    /// from SLURM_ARRAY_TASK_ID or JOB_COMPLETION_INDEX. In a Slurm array the default is that
    /// array's task and count (--shard 1/1 is the whole)
    #[arg(long, value_name = "I/N")]
    pub shard: Option<ShardRequest>,
    /// Start over, even if the result is there or another plan was begun
    #[arg(long)]
    pub fresh: bool,
    /// How progress is shown: auto (a bar on a terminal, else a line a minute), plain (a line every
    /// 5 s) or none
    #[arg(long, value_name = "auto|plain|none", default_value = "auto")]
    pub progress: ProgressMode,
}

impl WorkArgs {
    /// As the runner takes them.
    ///
    /// # Errors
    /// A scheduler's number of threads that is none.
    pub(super) fn options<'a>(
        &self,
        environment: Environment<'a>,
    ) -> Result<RunOptions<'a>, Error> {
        Ok(RunOptions {
            threads: threads::count(self.threads, environment)?,
            fresh: self.fresh,
            shard: self.shard,
            progress: self.progress,
            environment,
            tell: &tell,
        })
    }
}

/// Runs a grid.
///
/// # Errors
/// Mistakes in the grid file, and whatever kept the run from its end.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let plan = args.target.grid.load()?;
    let engine = ModelEngine::new(&plan)?;
    execute(args, &plan, &engine)
}

/// Runs a plan, with an engine made for it, and prints a summary.
///
/// # Errors
/// Whatever of [`crate::store::StoreError`] kept it from its end; finished chunks are kept.
fn execute(args: &Args, plan: &Plan, engine: &ModelEngine<'_>) -> Result<Exit, Error> {
    if args.keep_traces && plan.points() > MOST_KEPT {
        return Err(Error::Option {
            option: "--keep-traces",
            given: format!("with {} points", plan.points()),
            expected: format!("at most {MOST_KEPT}; `sweep trace` writes those of single points"),
        });
    }
    let interrupt = Interrupt::install().map_err(|source| Error::File {
        action: "install signal handlers for",
        path: PathBuf::from("this process"),
        source,
    })?;
    let (job, output) = (Job::of(plan), args.target.output(plan));
    let environment: Environment<'_> = &|name| std::env::var(name).ok();
    let options = args.work.options(environment)?;
    let report = runner::run(engine, &job, &output, options, &interrupt)?;
    for note in &report.notes {
        tell(note);
    }
    tell(summary(args, plan, &job, &output, &report).trim_end());
    if args.keep_traces && matches!(report.ended, Ended::Already(..) | Ended::Finished(_)) {
        let folder = files::beside(&output, "traces");
        tell(&format!("traces of {} points go to {}", plan.points(), folder.display()));
        let progress = Mutex::new(Progress::new(args.work.progress, plan.points(), 0));
        let kept = AtomicU64::new(0);
        let done = || {
            let kept = kept.fetch_add(1, Ordering::Relaxed) + 1;
            // A thread that finds another showing it goes on.
            if let Ok(mut progress) = progress.try_lock() {
                progress.show(kept);
            }
        };
        let map = ParquetFile::open(&output)?;
        let stop = || interrupt.stopped();
        let ended = trace::keep(engine, &map, &folder, options.threads, &stop, &done);
        progress.lock().unwrap_or_else(PoisonError::into_inner).finish();
        ended?;
        if let Some(signal) = interrupt.signal() {
            tell("interrupted; the map is kept, and the traces so far");
            return Ok(if signal == 15 { Exit::Terminated } else { Exit::Interrupted });
        }
        tell(&format!("traces      {}", folder.display()));
    }
    Ok(match report.ended {
        Ended::Interrupted { signal: 15, .. } => Exit::Terminated,
        Ended::Interrupted { .. } => Exit::Interrupted,
        Ended::Already(_, tally) | Ended::Finished(tally)
            if args.fail_on_error && tally.by_status.failed() > 0 =>
        {
            Exit::PointsFailed
        }
        _ => Exit::Done,
    })
}

/// What came of the run, in at most twelve lines.
fn summary(args: &Args, plan: &Plan, job: &Job<'_>, output: &Path, report: &RunReport) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = match (&report.ended, &report.session) {
        (Ended::Already(file, _), _) => {
            writeln!(
                text,
                "{}: all {} points are there already (--fresh computes them again)",
                plan.name, file.points
            )
        }
        (Ended::Interrupted { kept, points, .. }, session) => writeln!(
            text,
            "{}: interrupted with {kept} of {points} points kept{}",
            plan.name,
            session
                .as_ref()
                .map(|session| format!(", after {}", duration(session.wall_s)))
                .unwrap_or_default()
        ),
        (Ended::Shard(shard), Some(session)) => {
            writeln!(
                text,
                "{}, shard {} of {}: {}",
                plan.name,
                shard.index,
                shard.of,
                work(session)
            )
        }
        (_, Some(session)) => writeln!(text, "{}: {}", plan.name, work(session)),
        (_, None) => Ok(()),
    };
    match &report.ended {
        Ended::Already(_, tally) | Ended::Finished(tally) => text.push_str(&rows(tally, job)),
        Ended::Interrupted { .. } | Ended::Shard(_) => {}
    }
    let out = quoted(&output.display().to_string());
    match &report.ended {
        Ended::Already(..) | Ended::Finished(_) => {
            line(&mut text, "file", &output.display().to_string());
            if let (true, Ended::Already(_, tally) | Ended::Finished(tally)) =
                (plan.design.is_some(), &report.ended)
            {
                line(&mut text, "share", &share(tally));
            }
            line(&mut text, "next", &format!("sweep plot {out}"));
        }
        Ended::Shard(_) => {
            line(
                &mut text,
                "next",
                &format!("{}, when all shards are done", args.target.command("merge")),
            );
        }
        Ended::Interrupted { .. } => {
            line(&mut text, "go on", &go_on(args, report.session.as_ref()))
        }
    }
    text
}

/// The command that goes on with an interrupted run, or with this shard of it.
fn go_on(args: &Args, session: Option<&Session>) -> String {
    let mut line = args.target.command("run");
    if let Some(shard) = session.and_then(|session| session.shard.as_deref()) {
        // Writing to a String cannot fail.
        let _ = write!(line, " --shard {shard}");
    }
    if args.keep_traces {
        line.push_str(" --keep-traces");
    }
    line
}

/// What this process did.
pub(super) fn work(session: &Session) -> String {
    format!(
        "{} points in {}, {} on {} thread{} ({})",
        session.points,
        duration(session.wall_s),
        per_second(session.points_per_s),
        session.threads,
        if session.threads == 1 { "" } else { "s" },
        session.simd
    )
}

/// A result's rows: verdicts, failures, extremes. At most six lines.
pub(super) fn rows(tally: &Tally, job: &Job<'_>) -> String {
    if let Some(dwells) = &tally.dwells {
        let mut text = String::new();
        let told = format!(
            "{} of {} rows, {} not, {} without a response",
            dwells.stable, tally.points, dwells.unstable, dwells.unknown
        );
        line(&mut text, "stable", &told);
        return text;
    }
    let at = |point: u64| {
        let values = (job.axis_values)(point);
        let place = job
            .layout
            .axes
            .iter()
            .zip(values)
            .map(|(axis, value)| format!("{} {}", axis.name, short(value)));
        place.collect::<Vec<_>>().join(", ")
    };
    counts(tally, job.layout.ratio_limit, &at)
}

/// The share of reliable points among those with a verdict, with the interval in which the true
/// share lies with 95 % confidence if points are independent and at random.
fn share(tally: &Tally) -> String {
    match Share::of(tally.reliable, tally.reliable + tally.unreliable) {
        None => "no point has a verdict".to_owned(),
        Some(Share { part, low, high }) => format!(
            "{:.1} % reliable, with 95 % confidence {:.1} to {:.1} % for points at random",
            100.0 * part,
            100.0 * low,
            100.0 * high
        ),
    }
}

/// As [`rows`], where `at` says where a point lies.
pub(super) fn counts(tally: &Tally, ratio_limit: f64, at: &dyn Fn(u64) -> String) -> String {
    let mut text = String::new();
    let percent = |count: u64| 100.0 * count as f64 / tally.points.max(1) as f64;
    let verdicts = format!(
        "{} ({:.1} %) below ratio {ratio_limit}, {} not, {} undefined",
        tally.reliable,
        percent(tally.reliable),
        tally.unreliable,
        tally.undefined
    );
    line(&mut text, "reliable", &verdicts);
    if tally.by_status.failed() > 0 {
        let by_status = tally.by_status.iter().filter(|(status, _)| *status != "ok");
        let list: Vec<String> =
            by_status.map(|(status, count)| format!("{count} {status}")).collect();
        line(&mut text, "failed", &list.join(", "));
    }
    if tally.sensitive > 0 {
        let told =
            format!("{}: chaotic, rk4 does not agree with itself at two steps", tally.sensitive);
        line(&mut text, "sensitive", &told);
    }
    if let Some(greatest) = &tally.greatest_error {
        let methods: Vec<String> =
            tally.by_method.iter().map(|(method, count)| format!("{count} {method}")).collect();
        let told = format!(
            "at most {:.1e} left in a row; rows by method: {}",
            greatest.value,
            methods.join(", ")
        );
        line(&mut text, "error", &told);
    }
    let place = |point: u64| match at(point) {
        place if place.is_empty() => place,
        place => format!(" at {place}"),
    };
    if let Some(greatest) = &tally.greatest_ratio {
        line(
            &mut text,
            "greatest",
            &format!("ratio {:.3}{}", greatest.value, place(greatest.point)),
        );
    }
    if let Some(least) = &tally.least_gap_nonlinear_m {
        line(&mut text, "least gap", &format!("{:.5} m{}", least.value, place(least.point)));
    }
    text
}

/// A named line of a summary.
pub(super) fn line(text: &mut String, name: &str, value: &str) {
    // Writing to a String cannot fail.
    let _ = writeln!(text, "{name:>10}  {value}");
}

impl clap::builder::ValueParserFactory for ProgressMode {
    type Parser = clap::builder::ValueParser;

    fn value_parser() -> Self::Parser {
        clap::builder::ValueParser::new(|text: &str| text.parse::<ProgressMode>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_is_of_points_with_a_verdict() {
        let tally = |reliable, unreliable| Tally { reliable, unreliable, ..Tally::default() };
        let said = share(&tally(8, 2));
        assert!(said.starts_with("80.0 % reliable, with 95 % confidence 49.0 to 94.3 %"), "{said}");
        assert_eq!(share(&tally(0, 0)), "no point has a verdict");
    }
}

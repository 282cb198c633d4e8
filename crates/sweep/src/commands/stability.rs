//! `sweep stability GRID.toml --speed FROM:TO:STEP`: periodic responses and whether they are
//! stable.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::plan::Plan;
use crate::speeds::{Speeds, turning};
use crate::stability::dwells;
use crate::stability::{DwellEngine, check, tongues};
use sweep_engine::commands::examples::Examples;
use sweep_engine::commands::grid::{ResultArgs, quoted};
use sweep_engine::commands::run::{WorkArgs, line, work};
use sweep_engine::exit::{Error, Exit, tell};
use sweep_engine::interrupt::Interrupt;
use sweep_engine::progress::duration;
use sweep_engine::run::{self as runner, Ended, RunReport};
use sweep_engine::threads::Environment;
use sweep_files::ParquetFile;

/// Shown by `--help`.
pub(super) const EXAMPLES: Examples = &[
    [
        "sweep stability my.toml --speed 60:400:1",
        "where a dwell at constant speed would shake itself up",
    ],
    ["sweep show results/first-stability.parquet", "the unstable speeds, and why"],
];

/// Arguments of `sweep stability`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG, mut_arg("out", |out| out.help(OUT)))]
pub struct Args {
    /// The grid, and the file: results/NAME-stability.parquet by default.
    #[command(flatten)]
    target: ResultArgs,
    /// Constant spin speeds, in rpm, above 0
    #[arg(long, value_name = "FROM:TO:STEP", value_parser = turning, allow_hyphen_values = true)]
    speed: Speeds,
    /// How it is done.
    #[command(flatten)]
    work: WorkArgs,
    /// Exit with 3 if any row has no response
    #[arg(long)]
    fail_on_error: bool,
}

/// Where the result goes, which is not where a run's goes.
const OUT: &str = "Result file [default: results/NAME-stability.parquet]";

/// What `--help` adds.
const LONG: &str = "\
A row for every point of the grid and every speed: the periodic response of both models while the \
drum turns at that speed for ever, and how fast a small disturbance of the nonlinear one grows. \
The spin profile, the window and the integrator of the grid file do not matter here. The result is \
written to results/NAME-stability.parquet unless --out names a file.

The file is a pure function of its input, whatever the number of threads, shards and \
interruptions. What an interrupted command has computed stays in FILE.partial, and the same \
command goes on from there.";

/// Finds the responses and writes them.
///
/// # Errors
/// Mistakes in the grid file or the options, and whatever keeps the file from being written;
/// finished chunks are kept.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let plan: Plan = args.target.grid.load()?;
    check(&plan, "--speed", &args.speed.to_string())?;
    let speeds_rpm = args.speed.values();
    let engine = DwellEngine::new(&plan, &speeds_rpm)?;
    let (job, output) = dwells(&plan, args.speed, args.target.out.as_deref());
    let interrupt = Interrupt::install().map_err(|source| Error::File {
        action: "install signal handlers for",
        path: PathBuf::from("this process"),
        source,
    })?;
    let environment: Environment<'_> = &|name| std::env::var(name).ok();
    let options = args.work.options(environment)?;
    let report = runner::run(&engine, &job, &output, options, &interrupt)?;
    for note in &report.notes {
        tell(note);
    }
    tell(summary(args, &plan.name, &output, &report)?.trim_end());
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

/// What came of it.
fn summary(args: &Args, name: &str, output: &Path, report: &RunReport) -> Result<String, Error> {
    let mut text = String::new();
    let speed = format!("--speed {}", args.speed);
    // Writing to a String cannot fail.
    let _ = match (&report.ended, &report.session) {
        (Ended::Already(file, _), _) => writeln!(
            text,
            "{name}: all {} rows are there already (--fresh computes them again)",
            file.points
        ),
        (Ended::Interrupted { kept, points, .. }, session) => {
            let after = session.as_ref().map(|session| duration(session.wall_s));
            let after = after.map(|wall| format!(", after {wall}")).unwrap_or_default();
            writeln!(text, "{name}: interrupted with {kept} of {points} rows kept{after}")
        }
        (Ended::Shard(shard), Some(session)) => {
            writeln!(text, "{name}, shard {} of {}: {}", shard.index, shard.of, work(session))
        }
        (_, Some(session)) => writeln!(text, "{name}: {}", work(session)),
        (_, None) => Ok(()),
    };
    match &report.ended {
        Ended::Already(..) | Ended::Finished(_) => {
            for (name, words) in tongues::summary(&ParquetFile::open(output)?)?.lines() {
                line(&mut text, name, &words);
            }
            let shown = output.display().to_string();
            line(&mut text, "file", &shown);
            line(&mut text, "next", &format!("sweep show {}", quoted(&shown)));
        }
        Ended::Shard(_) => {
            let merge = args.target.command("merge");
            line(&mut text, "next", &format!("{merge} {speed}, when all shards are done"));
        }
        Ended::Interrupted { .. } => {
            let mut again = format!("{} {speed}", args.target.command("stability"));
            let shard = report.session.as_ref().and_then(|session| session.shard.as_deref());
            if let Some(shard) = shard {
                let _ = write!(again, " --shard {shard}");
            }
            line(&mut text, "go on", &again);
        }
    }
    Ok(text)
}
